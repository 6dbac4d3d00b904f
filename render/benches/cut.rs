//! How long a mesh takes to be cut by a plane, and how far the volumes of its parts are from adding up.
//!
//! ```text
//! cargo bench -p render --bench cut               balls of 131 072 and 524 288 triangles of its own
//! cargo bench -p render --bench cut -- FILE       a mesh to be compared: see tests/peers/cut.py
//! ```
//! FILE is the count of vertices and of triangles as u64, then f64 coordinates, then u32 corners, little endian. For
//! each line `px py pz nx ny nz` on standard input, a plane, one line of JSON is written.

#![expect(clippy::unwrap_used, clippy::print_stdout, reason = "a measurement may fail loudly, and prints")]

use std::io::BufRead as _;
use std::time::Instant;

use render::volume::cut::{Plane, by_plane};
use render::volume::{Point, TriangleMesh, Vector};

fn main() {
    let file = std::env::args().skip(1).find(|argument| !argument.starts_with("--"));
    if let Some(file) = file {
        let mesh = read(&std::fs::read(file).unwrap());
        for line in std::io::stdin().lock().lines() {
            let line = line.unwrap();
            let numbers: Vec<f64> = line.split_whitespace().map(|word| word.parse().unwrap()).collect();
            let plane = Plane::new(Point::from_slice(&numbers[..3]), Vector::from_row_slice(&numbers[3..6]));
            measure(&mesh, &plane.unwrap());
        }
        return;
    }
    for size in [128, 256] {
        let mesh = ball(size);
        for round in 0..11 {
            let normal = Vector::new(1.0, 0.3 * f64::from(round) - 1.0, 0.5);
            measure(&mesh, &Plane::new(Point::new(1.0, 2.0, 3.0), normal).unwrap());
        }
    }
}

fn measure(mesh: &TriangleMesh, plane: &Plane) {
    let start = Instant::now();
    let parts = by_plane(mesh, plane).unwrap();
    let secs = start.elapsed().as_secs_f64();
    let parts = [parts.plus, parts.minus];
    let volumes = parts.each_ref().map(|part| part.as_ref().map_or(0.0, volume));
    let triangles = parts.each_ref().map(|part| part.as_ref().map_or(0, |mesh| mesh.triangles().len()));
    let whole = volume(mesh);
    let defect = (volumes[0] + volumes[1] - whole).abs() / whole.abs();
    println!("{{\"secs\": {secs:e}, \"defect\": {defect:e}, \"triangles\": {triangles:?}}}");
}

/// Enclosed volume about the origin, summed without loss (Neumaier).
fn volume(mesh: &TriangleMesh) -> f64 {
    let (mut sum, mut lost) = (0.0_f64, 0.0);
    for triangle in 0..mesh.triangles().len() {
        let [a, b, c] = mesh.corners(triangle).map(|p| p.coords);
        let term = a.dot(&b.cross(&c)) / 6.0;
        let next = sum + term;
        lost += if sum.abs() >= term.abs() { (sum - next) + term } else { (term - next) + sum };
        sum = next;
    }
    sum + lost
}

fn read(bytes: &[u8]) -> TriangleMesh {
    let count = |at: usize| u64::from_le_bytes(bytes[at..at + 8].try_into().unwrap()) as usize;
    let (vertices, triangles) = (count(0), count(8));
    let (places, corners) = bytes[16..].split_at(24 * vertices);
    let numbers: Vec<f64> =
        places.chunks_exact(8).map(|b| f64::from_le_bytes(b.try_into().unwrap())).collect();
    let names: Vec<u32> =
        corners.chunks_exact(4).map(|b| u32::from_le_bytes(b.try_into().unwrap())).collect();
    assert_eq!(names.len(), 3 * triangles, "the file's own count");
    let positions = numbers.chunks_exact(3).map(Point::from_slice).collect();
    TriangleMesh::new(positions, names.chunks_exact(3).map(|t| [t[0], t[1], t[2]]).collect()).unwrap()
}

/// A ball of radius 50 of 8 `n`² triangles: an octahedron with `n` parts along each edge, blown up.
fn ball(n: u32) -> TriangleMesh {
    let mut places = std::collections::HashMap::new();
    let mut positions = Vec::new();
    let mut triangles = Vec::new();
    for octant in 0..8_u32 {
        let sign = [0, 1, 2].map(|axis| if octant >> axis & 1 == 1 { -1_i64 } else { 1 });
        let mut at = |i: u32, j: u32| {
            let k = n - i - j;
            let place = [sign[0] * i64::from(i), sign[1] * i64::from(j), sign[2] * i64::from(k)];
            *places.entry(place).or_insert_with(|| {
                let out = Vector::from(place.map(|c| c as f64));
                positions.push(Point::from(out * (50.0 / out.norm())));
                positions.len() as u32 - 1
            })
        };
        let turn = |[a, b, c]: [u32; 3]| if octant.count_ones() % 2 == 0 { [a, b, c] } else { [a, c, b] };
        for i in 0..n {
            for j in 0..n - i {
                triangles.push(turn([at(i, j), at(i + 1, j), at(i, j + 1)]));
                if i + j + 1 < n {
                    triangles.push(turn([at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)]));
                }
            }
        }
    }
    TriangleMesh::new(positions, triangles).unwrap()
}
