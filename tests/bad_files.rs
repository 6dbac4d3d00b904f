//! Files that must be refused or survived: every one through the program, in bounded time and memory.

use std::time::Duration;

use crate::support::program::run_within;
use crate::support::shared_data;

/// Most address space; the largest of these files is 3 MB, and what it honestly holds decodes to 15 MB.
const MEMORY: u64 = 3 << 30;
/// Longest time, on a busy machine.
const TIME: Duration = Duration::from_mins(1);

/// Broken, but readable in part or legal after all: these may load, and each must then carry a note that says what is
/// wrong. Everything else of the folder must be refused.
const MAY_LOAD: [&str; 8] = [
    "J2K_pixelrep_mismatch.dcm",
    "badVR.dcm",
    "ExplVR_BigEndNoMeta.dcm",
    "no_meta.dcm",
    "meta_missing_tsyntax.dcm",
    "JPEG2000-embedded-sequence-delimiter.dcm",
    "head_ge_missing_and_duplicate_slices.zip",
    "stl_binary_says_solid.stl",
];

/// The file that a complaint must name: the one opened, or the one missing that it points to.
fn at_fault(name: &str) -> &str {
    if name == "nrrd_missing_data_file.nhdr" { "not_here.raw" } else { name }
}

fn files() -> Vec<std::path::PathBuf> {
    let Some(data) = shared_data() else { return Vec::new() };
    let mut files: Vec<_> =
        std::fs::read_dir(data.join("bad")).unwrap().map(|entry| entry.unwrap().path()).collect();
    files.sort();
    assert!(files.len() >= 30, "the folder of bad files is whole: {}", files.len());
    files
}

#[test]
fn every_bad_file_is_refused_with_one_sentence_or_loads_with_a_note() {
    let mut faults = Vec::new();
    for path in files() {
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        let outcome = run_within(&["info", path.to_str().unwrap(), "--json"], TIME, MEMORY);
        let fault = match outcome.status.code() {
            Some(3) if !outcome.sentence().contains(at_fault(&name)) => {
                format!("does not name the file: {}", outcome.stderr)
            }
            Some(3) if outcome.stderr.trim().lines().count() != 1 => {
                format!("is not one sentence: {}", outcome.stderr)
            }
            Some(0) if !MAY_LOAD.contains(&name.as_str()) => format!("loads as if whole: {}", outcome.stdout),
            Some(0) if outcome.json()["items"][0]["notes"].as_array().is_none_or(Vec::is_empty) => {
                format!("has no notes: {}", outcome.stdout)
            }
            Some(0 | 3) => continue,
            _ => format!("ended by {} after {:?}: {}", outcome.status, outcome.wall, outcome.stderr),
        };
        faults.push(format!("{name}: {fault}"));
    }
    assert!(faults.is_empty(), "{} bad files went wrong:\n{}", faults.len(), faults.join("\n"));
}

/// What is no file of any kind: bytes of this repository's own sources under the names of known formats.
#[test]
fn text_under_a_known_name_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let text = include_bytes!("bad_files.rs");
    for ending in [
        "dcm", "nii", "nii.gz", "nrrd", "nhdr", "mha", "mhd", "stl", "obj", "ply", "gltf", "glb", "zip",
        "json",
    ] {
        let path = folder.path().join(format!("not_really.{ending}"));
        std::fs::write(&path, text).unwrap();
        let outcome = run_within(&["info", path.to_str().unwrap()], TIME, MEMORY);
        assert_eq!(outcome.code(), 3, "{ending}: {}{}", outcome.stdout, outcome.stderr);
        assert!(outcome.sentence().contains("not_really"), "{ending} names the file: {}", outcome.stderr);
    }
}

/// A file cut anywhere is refused or noted: never a crash.
#[test]
fn a_volume_cut_short_anywhere_never_crashes() {
    let folder = tempfile::tempdir().unwrap();
    let whole = folder.path().join("whole.nrrd");
    crate::support::cases::write_nrrd(&whole, [6, 5, 4], 1.0, |v| v[0] as i16);
    let bytes = std::fs::read(&whole).unwrap();
    let cut = folder.path().join("cut.nrrd");
    for length in (0..bytes.len()).step_by(23) {
        std::fs::write(&cut, &bytes[..length]).unwrap();
        let outcome = run_within(&["info", cut.to_str().unwrap()], TIME, MEMORY);
        assert_eq!(
            outcome.code(),
            3,
            "{length} of {} bytes: {}{}",
            bytes.len(),
            outcome.stdout,
            outcome.stderr
        );
    }
}
