//! Binary STL: triangles as they are, in the mesh's own units, with outward normals of their winding.

use render::volume::TriangleMesh;

/// The file of a mesh: an 80-byte header, the count, and 50 bytes a triangle. More than 2³² − 1 triangles
/// cannot be counted in it; a mesh in memory has 32-bit vertex numbers and never comes near.
pub fn stl(mesh: &TriangleMesh) -> Vec<u8> {
    let count = mesh.triangles().len();
    let mut bytes = vec![0_u8; 80];
    let title = b"Osteotome, millimetres";
    bytes[..title.len()].copy_from_slice(title);
    bytes.reserve(4 + 50 * count);
    bytes.extend_from_slice(&u32::try_from(count).unwrap_or(u32::MAX).to_le_bytes());
    for triangle in 0..count {
        let [a, b, c] = mesh.corners(triangle);
        // A triangle without area has no normal; readers then take the winding's.
        let normal = (b - a).cross(&(c - a)).try_normalize(0.0).unwrap_or_default();
        for vector in [normal, a.coords, b.coords, c.coords] {
            for component in vector.iter() {
                bytes.extend_from_slice(&(*component as f32).to_le_bytes());
            }
        }
        bytes.extend_from_slice(&[0, 0]);
    }
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;
    use render::volume::Point;

    #[test]
    fn a_triangle_has_its_place_and_its_normal() {
        let corners = vec![Point::origin(), Point::new(2.0, 0.0, 0.0), Point::new(0.0, 3.0, 0.5)];
        let mesh = TriangleMesh::new(corners, vec![[0, 1, 2]]).expect("mesh");
        let bytes = stl(&mesh);
        assert_eq!((bytes.len(), &bytes[80..84]), (134, &[1, 0, 0, 0][..]), "one triangle of 50 bytes");
        assert!(!bytes.starts_with(b"solid"), "not taken for the text kind");
        let float = |i: usize| {
            let at = 84 + 4 * i;
            f32::from_le_bytes(bytes[at..at + 4].try_into().expect("four bytes"))
        };
        assert_eq!([float(6), float(9), float(10), float(11)], [2.0, 0.0, 3.0, 0.5], "corners");
        assert!(float(2) > 0.98 && float(0) == 0.0, "the normal is upwards");
    }
}
