//! NRRD with attached header and gzip, in LPS millimetres: what a grid is, and nothing more.
//!
//! Source: Teem, "Definition of NRRD file format", NRRD0004.

use std::fmt::Write as _;
use std::io::{self, Write as _};

use flate2::Compression;
use flate2::write::GzEncoder;
use render::volume::{Grid, Rescale, Samples};

/// The file of a grid. Samples are written as stored where the grid has no rescale, and else as the
/// values they mean, in 32-bit float, for NRRD has no rescale.
///
/// # Errors
/// What the compressor says; there is none in memory but its end.
pub fn nrrd(grid: &Grid) -> io::Result<Vec<u8>> {
    let plain = grid.rescale() == Rescale::default();
    let kind = match grid.samples() {
        _ if !plain => "float",
        Samples::U8(_) => "uchar",
        Samples::I8(_) => "signed char",
        Samples::U16(_) => "ushort",
        Samples::I16(_) => "short",
        Samples::U32(_) => "uint",
        Samples::I32(_) => "int",
        Samples::F64(_) => "double",
        _ => "float",
    };
    let [nx, ny, nz] = grid.extent();
    let m = grid.world_from_voxel().matrix();
    let column = |c: usize| format!("({},{},{})", m[(0, c)], m[(1, c)], m[(2, c)]);
    let mut header = String::from("NRRD0004\n# written by Osteotome\n");
    let written = write!(
        header,
        "type: {kind}\ndimension: 3\nspace: left-posterior-superior\nsizes: {nx} {ny} {nz}\n\
         space directions: {} {} {}\nkinds: domain domain domain\nendian: little\nencoding: gzip\n\
         space units: \"mm\" \"mm\" \"mm\"\nspace origin: {}\n\n",
        column(0),
        column(1),
        column(2),
        column(3)
    );
    written.map_err(io::Error::other)?;
    let mut out = GzEncoder::new(header.into_bytes(), Compression::fast());
    /// Little-endian bytes, a bounded piece at a time.
    macro_rules! each {
        ($v:expr) => {
            for piece in $v.chunks(1 << 16) {
                let bytes: Vec<u8> = piece.iter().flat_map(|s| s.to_le_bytes()).collect();
                out.write_all(&bytes)?;
            }
        };
    }
    match grid.samples() {
        _ if !plain => each!(grid.to_f32()),
        Samples::U8(v) => each!(v),
        Samples::I8(v) => each!(v),
        Samples::U16(v) => each!(v),
        Samples::I16(v) => each!(v),
        Samples::U32(v) => each!(v),
        Samples::I32(v) => each!(v),
        Samples::F32(v) => each!(v),
        Samples::F64(v) => each!(v),
        _ => each!(grid.to_f32()),
    }
    out.finish()
}

#[cfg(test)]
mod tests {
    use std::io::Read as _;

    use super::*;
    use crate::load;
    use render::volume::{Affine, Point, Vector};

    fn parts(file: &[u8]) -> (String, Vec<u8>) {
        let end = file.windows(2).position(|w| w == b"\n\n").expect("the header's end") + 2;
        let mut data = Vec::new();
        flate2::read::GzDecoder::new(&file[end..]).read_to_end(&mut data).expect("gzip");
        (String::from_utf8(file[..end].to_vec()).expect("text"), data)
    }

    #[test]
    fn header_and_samples_are_those_of_the_grid() {
        let world_from_voxel = Affine::from_columns(
            Vector::new(0.5, 0.0, 0.0),
            Vector::new(0.0, 0.0, -2.25),
            Vector::new(0.0, 1.0, 0.1),
            Point::new(-7.5, 3.0, 1e-7),
        )
        .expect("affine");
        let samples = Samples::I16(vec![-1, 2, -300, 4, 5, 6]);
        let grid = Grid::new([3, 2, 1], samples, Rescale::default(), world_from_voxel).expect("grid");
        let (header, data) = parts(&nrrd(&grid).expect("written"));
        for line in [
            "type: short",
            "sizes: 3 2 1",
            "space: left-posterior-superior",
            "space directions: (0.5,0,0) (0,0,-2.25) (0,1,0.1)",
            "space origin: (-7.5,3,0.0000001)",
        ] {
            assert!(header.lines().any(|l| l == line), "{line} is in {header}");
        }
        assert_eq!(data, [255, 255, 2, 0, 212, 254, 4, 0, 5, 0, 6, 0], "little-endian, x fastest");
    }

    #[test]
    fn the_loader_reads_the_same_volume_back() {
        let turn = Affine::rotation_about(Point::new(1.0, 2.0, 3.0), Vector::new(1.0, 2.0, 0.5), 0.3);
        let samples = Samples::U16((0..24).map(|i| i * 2700).collect());
        let grid = Grid::new([4, 3, 2], samples, Rescale::default(), turn).expect("grid");
        let folder = tempfile::tempdir().expect("folder");
        let path = folder.path().join("v.nrrd");
        std::fs::write(&path, nrrd(&grid).expect("written")).expect("saved");
        let items = load::open(&path, &load::Limits::default(), &load::Silent).expect("loaded");
        let load::Content::Volume(read) = &items[0].content else { panic!("a volume: {items:?}") };
        assert_eq!((read.extent(), read.samples()), (grid.extent(), grid.samples()), "samples");
        let apart = (read.world_from_voxel().matrix() - grid.world_from_voxel().matrix()).abs().max();
        assert!(apart < 1e-12, "the place differs by {apart} mm");
    }

    #[test]
    fn a_rescaled_grid_is_written_as_its_values() {
        let rescale = Rescale { slope: 0.5, intercept: -1.0 };
        let grid = Grid::new([2, 1, 1], Samples::U8(vec![0, 3]), rescale, Affine::identity()).expect("grid");
        let (header, data) = parts(&nrrd(&grid).expect("written"));
        assert!(header.contains("type: float\n"), "{header}");
        let expected: Vec<u8> = [-1.0_f32, 0.5].iter().flat_map(|v| v.to_le_bytes()).collect();
        assert_eq!(data, expected, "values");
    }
}
