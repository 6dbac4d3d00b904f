//! Small cases, written as files the way another program would: by hand, without this project's writers.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use serde_json::{Value, json};

/// Writes a NRRD of 16-bit samples, `[x, y, z]`, x fastest, spaced by `spacing_mm`, the first voxel's centre at the
/// world's origin; `sample` gives the value at a voxel.
pub(crate) fn write_nrrd(
    path: &Path,
    extent: [usize; 3],
    spacing_mm: f64,
    sample: impl Fn([usize; 3]) -> i16,
) {
    let [nx, ny, nz] = extent;
    let mut bytes = format!(
        "NRRD0004\ntype: short\ndimension: 3\nspace: left-posterior-superior\nsizes: {nx} {ny} {nz}\n\
         space directions: ({spacing_mm},0,0) (0,{spacing_mm},0) (0,0,{spacing_mm})\n\
         kinds: domain domain domain\nendian: little\nencoding: raw\nspace origin: (0,0,0)\n\n"
    )
    .into_bytes();
    for z in 0..nz {
        for y in 0..ny {
            for x in 0..nx {
                bytes.extend_from_slice(&sample([x, y, z]).to_le_bytes());
            }
        }
    }
    std::fs::write(path, bytes).unwrap();
}

/// Writes an ASCII STL of a tetrahedron with corners at `corner` and `size_mm` along each axis from it.
pub(crate) fn write_tetrahedron(path: &Path, corner: [f64; 3], size_mm: f64) {
    let at = |axis: usize| std::array::from_fn(|i| corner[i] + if i == axis { size_mm } else { 0.0 });
    let p: [[f64; 3]; 4] = [corner, at(0), at(1), at(2)];
    let mut text = String::from("solid tetrahedron\n");
    for face in [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]] {
        text.push_str(" facet normal 0 0 0\n  outer loop\n");
        for corner in face {
            let [x, y, z] = p[corner];
            writeln!(text, "   vertex {x} {y} {z}").unwrap();
        }
        text.push_str("  endloop\n endfacet\n");
    }
    text.push_str("endsolid tetrahedron\n");
    std::fs::write(path, text).unwrap();
}

/// Writes `case` beside its data and gives its path.
pub(crate) fn write_case(folder: &Path, case: &Value) -> PathBuf {
    let path = folder.join("case.json");
    std::fs::write(&path, serde_json::to_string_pretty(case).unwrap()).unwrap();
    path
}

/// A cut ball with an implant in it: 32³ voxels of 2 mm, two fragments of which one has moved, a translucent
/// tetrahedron; perspective camera.
pub(crate) fn cut_ball(folder: &Path) -> Value {
    let centre = 15.5;
    // A tenth of a turn about z, then a step aside.
    let (sin, cos) = (std::f64::consts::TAU / 10.0).sin_cos();
    write_nrrd(&folder.join("ball.nrrd"), [32; 3], 2.0, |v| {
        let square: f64 = v.map(|c| (c as f64 - centre).powi(2)).iter().sum();
        // A soft edge: a hard one would measure the renderers' resampling of a step instead.
        ((13.0 - square.sqrt()) * 150.0).clamp(-1000.0, 1000.0) as i16
    });
    write_tetrahedron(&folder.join("stem.stl"), [20.0, 20.0, 20.0], 24.0);
    json!({
        "osteotome": 1, "name": "cut ball",
        "volumes": [{"id": "ct", "source": "ball.nrrd", "texture": "r16", "shading": "none", "transfer": {
            "points": [[0, 0.9, 0.5, 0.2, 0.0], [400, 0.9, 0.6, 0.3, 0.08], [1000, 1, 1, 0.9, 0.2]], "unit_mm": 1.0}}],
        "cutters": [{"id": "c1", "plane": {"point": [31, 31, 31], "normal": [1, 0.2, 0.3]}}],
        "fragments": [
            {"id": "left", "volume": "ct", "keep": {"c1": "+"}, "pose": [cos,-sin,0,30, sin,cos,0,-12, 0,0,1,-3, 0,0,0,1]},
            {"id": "right", "volume": "ct", "keep": {"c1": "-"}}],
        "implants": [{"id": "stem", "source": "stem.stl", "color": [0.2, 0.4, 0.9], "opacity": 0.5, "shading": "none"}],
        "camera": {"eye": [31, -110, 45], "target": [31, 31, 31], "up": [0, 0, 1], "fov_deg": 30},
        "background": [0, 0, 0]
    })
}
