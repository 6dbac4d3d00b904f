//! Which loader a file is for: by its first bytes, and by its name where these say nothing.

use std::fs::File;
use std::io::Read as _;
use std::path::Path;

use flate2::read::GzDecoder;

use super::{Item, Limits, LoadError, Progress};
use super::{dicom, exodus, gltf, metaimage, nifti, nrrd, obj, plot3d, ply, stl, vtk};

/// A loader.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Format {
    Dicom,
    /// An archive of DICOM files.
    Zip,
    Nifti,
    Nrrd,
    MetaImage,
    Stl,
    Obj,
    Ply,
    Gltf,
    Vtk,
    Exodus,
    Plot3d,
}

impl Format {
    /// Reads one file.
    pub(super) fn read(
        self,
        path: &Path,
        limits: &Limits,
        progress: &dyn Progress,
    ) -> Result<Vec<Item>, LoadError> {
        match self {
            Self::Dicom => {
                let file = dicom::Sources::files(path, vec![path.to_owned()], limits);
                dicom::read(&file, limits, progress)
            }
            Self::Zip => dicom::read(&dicom::Sources::zip(path, limits)?, limits, progress),
            Self::Nifti => nifti::read(path, limits, progress),
            Self::Nrrd => nrrd::read(path, limits, progress),
            Self::MetaImage => metaimage::read(path, limits, progress),
            Self::Stl => stl::read(path, limits, progress),
            Self::Obj => obj::read(path, limits, progress),
            Self::Ply => ply::read(path, limits, progress),
            Self::Gltf => gltf::read(path, limits, progress),
            Self::Vtk => vtk::read(path, limits, progress),
            Self::Exodus => exodus::read(path, limits, progress),
            Self::Plot3d => plot3d::read(path, limits, progress),
        }
    }
}

/// The format of a file; `None` where no loader knows it.
///
/// # Errors
/// [`LoadError::Io`].
pub(super) fn detect(path: &Path) -> Result<Option<Format>, LoadError> {
    let io = |source| LoadError::Io { path: path.to_owned(), source };
    let mut head = Vec::new();
    File::open(path).and_then(|f| f.take(4096).read_to_end(&mut head)).map_err(io)?;
    let name = path.file_name().map(|n| n.to_string_lossy().to_ascii_lowercase()).unwrap_or_default();
    Ok(by_content(&head).or_else(|| by_name(&name)))
}

fn by_content(head: &[u8]) -> Option<Format> {
    let starts = |magic: &[u8]| head.starts_with(magic);
    if starts(b"PK\x03\x04") || starts(b"PK\x05\x06") {
        return Some(Format::Zip);
    }
    if starts(b"glTF") {
        return Some(Format::Gltf);
    }
    if starts(b"NRRD0") {
        return Some(Format::Nrrd);
    }
    if starts(b"ply\n") || starts(b"ply\r") {
        return Some(Format::Ply);
    }
    if starts(b"# vtk DataFile") {
        return Some(Format::Vtk);
    }
    if starts(b"CDF\x01") || starts(b"CDF\x02") || starts(b"CDF\x05") {
        return Some(Format::Exodus);
    }
    if starts(&[0x1F, 0x8B]) {
        let mut inner = Vec::new();
        // A cut stream still gives what came before the cut.
        let ended = GzDecoder::new(head).take(600).read_to_end(&mut inner);
        return (ended.is_ok() || !inner.is_empty())
            .then_some(())
            .and_then(|()| nifti::begins_as_nifti(&inner).then_some(Format::Nifti));
    }
    if nifti::begins_as_nifti(head) {
        return Some(Format::Nifti);
    }
    if dicom::begins_as_dicom(head) {
        return Some(Format::Dicom);
    }
    let text = String::from_utf8_lossy(head);
    let text = text.trim_start_matches(['\u{feff}', ' ', '\t', '\r', '\n']);
    if text.starts_with("<VTKFile") || (text.starts_with("<?xml") && text.contains("<VTKFile")) {
        return Some(Format::Vtk);
    }
    let key = text.split('=').next().map(str::trim).unwrap_or_default();
    if ["ObjectType", "NDims", "Comment"].contains(&key) && text.contains("NDims") {
        return Some(Format::MetaImage);
    }
    None
}

fn by_name(name: &str) -> Option<Format> {
    let ends = |endings: &[&str]| endings.iter().any(|e| name.ends_with(e));
    [
        (Format::Stl, &[".stl"][..]),
        (Format::Obj, &[".obj"]),
        (Format::Ply, &[".ply"]),
        (Format::Gltf, &[".gltf", ".glb"]),
        (Format::Vtk, &[".vtk", ".vtu", ".pvtu", ".pvd"]),
        (Format::Exodus, &[".ex2", ".e", ".exo", ".exii"]),
        (Format::Plot3d, &[".xyz", ".q", ".p3d", "xyz.bin", "q.bin"]),
        (Format::Nifti, &[".nii", ".nii.gz", ".hdr"]),
        (Format::Nrrd, &[".nrrd", ".nhdr"]),
        (Format::MetaImage, &[".mha", ".mhd"]),
        (Format::Dicom, &[".dcm", ".dicom", ".ima"]),
        (Format::Zip, &[".zip"]),
    ]
    .into_iter()
    .find_map(|(format, endings)| ends(endings).then_some(format))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn content_speaks_before_the_name() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("mesh.stl");
        std::fs::write(&path, b"ply\nformat ascii 1.0\n").expect("written");
        assert_eq!(detect(&path).expect("read"), Some(Format::Ply), "a PLY by its first line");
        std::fs::write(&path, b"solid x").expect("written");
        assert_eq!(detect(&path).expect("read"), Some(Format::Stl), "an STL by its name");
        let path = folder.path().join("notes.txt");
        std::fs::write(&path, b"nothing of ours").expect("written");
        assert_eq!(detect(&path).expect("read"), None, "unknown");
    }
}
