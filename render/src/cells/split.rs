//! Cells as tetrahedra, the same across a face that two cells share.
//!
//! A cell is cut from its corner of the smallest number to every triangle of the faces that do not have it, and each face of
//! four corners is cut from its own smallest. On the faces that have it that comes to the same, so neighbours agree
//! (Dompierre et al. 1999, "How to subdivide pyramids, prisms and hexahedra into tetrahedra").

use crate::volume::cells::CellKind;

/// Corners of each face, the right-hand normal outward; a triangle's last is its first again.
fn faces(kind: CellKind) -> &'static [[usize; 4]] {
    match kind {
        CellKind::Tetra => &[[0, 2, 1, 0], [0, 1, 3, 0], [1, 2, 3, 1], [2, 0, 3, 2]],
        CellKind::Pyramid => &[[0, 3, 2, 1], [0, 1, 4, 0], [1, 2, 4, 1], [2, 3, 4, 2], [3, 0, 4, 3]],
        CellKind::Wedge => &[[0, 1, 2, 0], [3, 5, 4, 3], [0, 3, 4, 1], [1, 4, 5, 2], [2, 5, 3, 0]],
        CellKind::Hexahedron => {
            &[[0, 4, 7, 3], [1, 2, 6, 5], [0, 1, 5, 4], [3, 7, 6, 2], [0, 3, 2, 1], [4, 5, 6, 7]]
        }
    }
}

/// Calls `found` with each tetrahedron of a cell: positive where the cell is as VTK orders it.
pub(crate) fn tetrahedra(kind: CellKind, corners: &[u32], mut found: impl FnMut([u32; 4])) {
    let Some(&lowest) = corners.iter().min() else { return };
    for face in faces(kind) {
        let face = face.map(|f| corners[f]);
        if face.contains(&lowest) {
            continue;
        }
        if face[3] == face[0] {
            found([lowest, face[0], face[1], face[2]]);
            continue;
        }
        let first = (0..4).min_by_key(|&i| face[i]).unwrap_or(0);
        let around: [u32; 4] = std::array::from_fn(|i| face[(first + i) % 4]);
        found([lowest, around[0], around[1], around[2]]);
        found([lowest, around[0], around[2], around[3]]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashMap;

    /// Places of a cell's corners, all convex.
    fn place(kind: CellKind) -> Vec<[f64; 3]> {
        let base = vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
        match kind {
            CellKind::Tetra => vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
            CellKind::Pyramid => [base, vec![[0.5, 0.5, 1.0]]].concat(),
            // VTK's first triangle faces outward.
            CellKind::Wedge => vec![
                [0.0, 0.0, 0.0],
                [0.0, 1.0, 0.0],
                [1.0, 0.0, 0.0],
                [0.0, 0.0, 1.0],
                [0.0, 1.0, 1.0],
                [1.0, 0.0, 1.0],
            ],
            CellKind::Hexahedron => [base.clone(), base.iter().map(|p| [p[0], p[1], 1.0]).collect()].concat(),
        }
    }

    fn volume(t: [[f64; 3]; 4]) -> f64 {
        let e = |i: usize| [0, 1, 2].map(|a| t[i][a] - t[0][a]);
        let ([a, b, c], [d, e, f], [g, h, i]) = (e(1), e(2), e(3));
        (a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g)) / 6.0
    }

    #[test]
    fn parts_fill_the_cell_whatever_the_numbers() {
        for (kind, known) in CellKind::ALL.into_iter().zip([1.0 / 6.0, 1.0 / 3.0, 0.5, 1.0]) {
            let places = place(kind);
            let count = kind.corners();
            for turn in 0..40_u32 {
                // Numbers in many orders: multiples modulo a prime.
                let numbers: Vec<u32> = (0..count as u32).map(|i| (i + 1) * (turn + 1) % 41).collect();
                let of = |n: u32| places[numbers.iter().position(|&m| m == n).expect("a corner")];
                let mut all = 0.0;
                let mut sides: HashMap<[u32; 3], u32> = HashMap::new();
                tetrahedra(kind, &numbers, |t| {
                    let v = volume(t.map(of));
                    assert!(v > 0.0, "{kind:?} {turn}: a part is turned round");
                    all += v;
                    for skip in 0..4 {
                        let mut side: Vec<u32> = (0..4).filter(|&i| i != skip).map(|i| t[i]).collect();
                        side.sort_unstable();
                        *sides.entry([side[0], side[1], side[2]]).or_default() += 1;
                    }
                });
                assert!((all - known).abs() < 1e-12, "{kind:?} {turn}: {all} is not {known}");
                assert!(sides.values().all(|&n| n <= 2), "{kind:?} {turn}: no side has three cells");
                // Outer sides: cut from the smallest corner of each face, which is all that a neighbour knows.
                for face in faces(kind).iter().filter(|f| f[3] != f[0]) {
                    let face = face.map(|f| numbers[f]);
                    let low = face.into_iter().min().expect("four");
                    let outer = sides.iter().filter(|(s, n)| **n == 1 && s.iter().all(|v| face.contains(v)));
                    let outer: Vec<_> = outer.map(|(s, _)| *s).collect();
                    assert!(
                        outer.len() == 2 && outer.iter().all(|s| s.contains(&low)),
                        "{kind:?}: {outer:?}"
                    );
                }
            }
        }
    }
}
