//! Round trips, every broken case, and saves that fail.

use super::*;
use crate::case::{Edit, edit};

/// A case with every kind of thing and an unknown key at every level.
const FULL: &str = r#"{
  "osteotome": 1, "later": {"deep": [1, {"x": null}]}, "name": "left hip",
  "volumes": [{"id": "ct", "source": "ct/", "item": 2, "step": 5, "texture": "bc3", "shading": "gradient",
    "window": [40, 400], "visible": false, "mode": {"isosurface": {"value": 250.5, "opacity": 0.75}}, "blend": 0.25,
    "pose": [0,-1,0,5, 1,0,0,-7.25, 0,0,1,0.1, 0,0,0,1],
    "transfer": {"points": [[-1024,0,0,0,0],[300,0.85,0.6,0.4,0.25]], "unit_mm": 2.5, "preset": "mine"}}],
  "cutters": [{"id": "c1", "plane": {"point": [1,2,3], "normal": [0,0,2], "extent": 40}, "note": "a"},
              {"id": "c2", "cylinder": {"point": [0,0,0], "axis": [0,1,0], "radius_mm": 40.5}},
              {"id": "c3", "dome": {"centre": [1,-2,3], "radius_mm": 20.25, "goal": "varus"}, "kerf_mm": 0.9},
              {"id": "c4", "blade": {"point": [1,2,3], "normal": [0,0,2], "right": [3,0,1],
                                     "width_mm": 30, "height_mm": 12.5}, "kerf_mm": 1.27, "saw": 7}],
  "fragments": [{"id": "head", "volume": "ct", "keep": {"c2": "-", "c1": "+"}, "goal": "medial"}],
  "implants": [{"id": "stem", "source": "builtin:hip/stem", "scale": 1000, "keep": {"c1": "-"}, "color": [1,0,0.5], "opacity": 0.5,
                "lot": 7}],
  "labels": [{"id": "lungs", "volume": "ct", "source": "ct/lungs.nrrd", "item": 1,
              "colors": {"1": [1.0, 0.0, 0.5, 0.5], "40": [0.0, 1.0, 0.0, 1.0]}, "visible": false, "by": "ann"},
             {"id": "mine", "volume": "ct", "colors": {}, "visible": true}],
  "grids": [{"id": "stress", "source": "ct/femur.vtu", "item": 1, "step": 2, "scale": 1000.0, "fragment": "head", "visible": false,
             "field": {"name": "S", "on": "cells", "part": "magnitude"}, "unit": "MPa", "load": "stance",
             "transfer": {"points": [[0,0,0,1,0.5],[90.5,1,0,0,1]], "unit_mm": 0.5, "map": "hot"}},
            {"id": "flow", "source": "flow.ex2", "field": {"name": "p", "part": 2}}],
  "camera": {"eye": [0,-500,0], "target": [0,0,0], "up": [0,0,1], "parallel_mm": 300, "lens": "x"},
  "background": [0, 0.5, 1]
}"#;

fn write_and_load(text: &str) -> Result<Case, FileError> {
    let folder = tempfile::tempdir().expect("folder");
    let path = folder.path().join("case.json");
    std::fs::write(&path, text).expect("written");
    load(&path)
}

#[test]
fn a_round_trip_keeps_everything_unknown_keys_too() {
    let folder = tempfile::tempdir().expect("folder");
    let (first, second) = (folder.path().join("a.json"), folder.path().join("b.json"));
    std::fs::write(&first, FULL).expect("written");
    let case = load(&first).expect("the full case");
    save(&case, &second).expect("saved");
    assert_eq!(load(&second).expect("again"), case, "the same case");
    let before: Value = serde_json::from_str(FULL).expect("json");
    let after: Value = serde_json::from_slice(&std::fs::read(&second).expect("read")).expect("json");
    for pointer in [
        "/later",
        "/name",
        "/volumes/0/window",
        "/volumes/0/transfer/preset",
        "/volumes/0/item",
        "/volumes/0/step",
        "/volumes/0/texture",
        "/volumes/0/shading",
        "/volumes/0/visible",
        "/volumes/0/mode",
        "/volumes/0/blend",
        "/labels/0/source",
        "/labels/0/item",
        "/labels/0/colors",
        "/labels/0/visible",
        "/labels/0/by",
        "/labels/1",
        "/grids/0/item",
        "/grids/0/step",
        "/grids/0/scale",
        "/grids/0/fragment",
        "/grids/0/visible",
        "/grids/0/field",
        "/grids/0/unit",
        "/grids/0/load",
        "/grids/0/transfer/map",
        "/grids/1/field",
        "/cutters/0/note",
        "/cutters/0/plane/extent",
        "/cutters/2/dome/goal",
        "/cutters/2/kerf_mm",
        "/cutters/3/kerf_mm",
        "/cutters/3/saw",
        "/fragments/0/goal",
        "/fragments/0/keep",
        "/implants/0/lot",
        "/implants/0/keep",
        "/implants/0/source",
        "/camera/lens",
    ] {
        assert!(before.pointer(pointer).is_some(), "{pointer} is in the test's case");
        assert_eq!(after.pointer(pointer), before.pointer(pointer), "{pointer} is written back");
    }
    assert_eq!(after.pointer("/volumes/0/source"), Some(&Value::from("ct")), "relative to the file");
    let keys: Vec<&String> = after.as_object().expect("object").keys().collect();
    assert_eq!(keys.first().map(|k| k.as_str()), Some("osteotome"), "the version stands first");
    let numbers = |v: &Value| -> Vec<f64> {
        v.pointer("/volumes/0/pose")
            .and_then(Value::as_array)
            .expect("pose")
            .iter()
            .map(|n| n.as_f64().expect("number"))
            .collect()
    };
    assert_eq!(numbers(&after), numbers(&before), "the pose to the last bit");
}

#[test]
fn what_is_optional_has_its_default() {
    let case = write_and_load(
        r#"{"osteotome": 1,
            "volumes": [{"id": "a", "source": "a.nrrd", "transfer": {"points": [[0,0,0,0,0]]}}],
            "fragments": [{"id": "f", "volume": "a"}],
            "implants": [{"id": "s", "source": "s.stl"}]}"#,
    )
    .expect("a small case");
    let volume = &case.volumes[0];
    assert!(volume.visible && case.fragments[0].visible && case.implants[0].visible, "visible");
    assert_eq!(volume.shading, render::scene::Shading::None, "volumes are plain");
    assert_eq!(case.implants[0].shading, render::scene::Shading::Lit, "implants are lit");
    assert_eq!((case.implants[0].scale, case.camera, case.background), (1.0, None, [0.0; 3]), "the rest");
    assert_eq!(volume.transfer.unit_mm(), 1.0, "opacity of one millimetre");
    let mode = render::scene::VolumeMode::Composite;
    assert_eq!((volume.mode, volume.blend, case.labels.len()), (mode, 1.0, 0), "composited, weighing one");
}

/// A change to [`FULL`] and the field that the complaint must name.
fn broken(pointer: &str, value: &str) -> (String, String) {
    let mut document: Value = serde_json::from_str(FULL).expect("json");
    let (parent, key) = pointer.rsplit_once('/').expect("a pointer");
    let slot = document.pointer_mut(parent).expect("the parent");
    let value: Value = serde_json::from_str(value).expect("json");
    match slot {
        Value::Object(map) => drop(map.insert(key.to_owned(), value)),
        Value::Array(items) => items[key.parse::<usize>().expect("index")] = value,
        _ => panic!("{pointer} has no parent"),
    }
    match write_and_load(&document.to_string()) {
        Err(FileError::Field { at, fault, remedy, .. }) => (at, format!("{fault}; {remedy}")),
        other => panic!("{pointer} was not complained about: {other:?}"),
    }
}

#[test]
fn every_broken_field_is_named_with_its_fault() {
    let mirror = "[-1,0,0,0, 0,1,0,0, 0,0,1,0, 0,0,0,1]";
    let scaled = "[2,0,0,0, 0,2,0,0, 0,0,2,0, 0,0,0,1]";
    for (pointer, value, at, part) in [
        ("/name", "3", "name", "not a text"),
        ("/volumes", "{}", "volumes", "not a list"),
        ("/volumes/0", "3", "volumes[0]", "not an object"),
        ("/volumes/0/id", "null", "volumes[0].id", "missing"),
        ("/volumes/0/id", "\"\"", "volumes[0].id", "empty"),
        ("/volumes/0/source", "\"\"", "volumes[0].source", "empty"),
        ("/volumes/0/item", "-1", "volumes[0].item", "whole number"),
        ("/volumes/0/step", "1.5", "volumes[0].step", "whole number"),
        ("/volumes/0/visible", "1", "volumes[0].visible", "true or false"),
        ("/volumes/0/texture", "\"dxt5\"", "volumes[0].texture", "\"dxt5\""),
        ("/volumes/0/shading", "\"headlight\"", "volumes[0].shading", "headlight"),
        ("/volumes/0/pose", "[1,2,3]", "volumes[0].pose", "3 numbers, not 16"),
        ("/volumes/0/pose", mirror, "volumes[0].pose", "not rigid"),
        ("/volumes/0/pose", scaled, "volumes[0].pose", "without scale"),
        ("/volumes/0/pose/3", "\"x\"", "volumes[0].pose[3]", "not a number"),
        ("/volumes/0/pose/15", "2", "volumes[0].pose", "0 0 0 1"),
        ("/volumes/0/transfer", "null", "volumes[0].transfer", "missing"),
        ("/volumes/0/transfer/points", "[]", "volumes[0].transfer.points", "at least one"),
        ("/volumes/0/transfer/points/1", "[-2000,0,0,0,0]", "volumes[0].transfer.points[1]", "order"),
        ("/volumes/0/transfer/points/1", "[300,2,0,0,0]", "volumes[0].transfer.points[1]", "0 to 1"),
        ("/volumes/0/transfer/points/1", "[300,0,0,0]", "volumes[0].transfer.points[1]", "not 5"),
        ("/volumes/0/transfer/unit_mm", "0", "volumes[0].transfer.unit_mm", "positive"),
        ("/volumes/0/blend", "1.5", "volumes[0].blend", "between 0 and 1"),
        ("/volumes/0/mode", "\"xray\"", "volumes[0].mode", "not a mode"),
        ("/volumes/0/mode", "{\"isosurface\": 3}", "volumes[0].mode.isosurface", "not an object"),
        ("/volumes/0/mode/isosurface/value", "null", "volumes[0].mode.isosurface.value", "missing"),
        ("/volumes/0/mode/isosurface/opacity", "2", "volumes[0].mode.isosurface.opacity", "between 0 and 1"),
        ("/labels/0/volume", "\"mri\"", "labels[0].volume", "\"mri\""),
        ("/labels/1/id", "\"lungs\"", "labels[1].id", "twice"),
        ("/labels/0/colors/0", "[0,0,0,1]", "labels[0].colors.0", "not a label"),
        ("/labels/0/colors/1", "[0,0,2,1]", "labels[0].colors.1", "outside 0 to 1"),
        ("/labels/0/colors/1", "[0,0,0]", "labels[0].colors.1", "3 numbers, not 4"),
        ("/grids/0/fragment", "\"neck\"", "grids[0].fragment", "\"neck\""),
        ("/grids/1/id", "\"stress\"", "grids[1].id", "twice"),
        ("/grids/0/scale", "-1", "grids[0].scale", "not more than 0"),
        ("/grids/0/field/on", "\"nodes\"", "grids[0].field.on", "not a place"),
        ("/grids/0/field/part", "\"x\"", "grids[0].field.part", "not a part"),
        ("/grids/0/field", "7", "grids[0].field", "not an object"),
        ("/grids/0/transfer/points", "[]", "grids[0].transfer.points", "at least one"),
        ("/cutters/0/plane", "null", "cutters[0]", "neither"),
        ("/cutters/1/plane", "{}", "cutters[1]", "both"),
        ("/cutters/0/plane/normal", "[0,0,0]", "cutters[0].plane", "no length"),
        ("/cutters/1/cylinder/radius_mm", "-4", "cutters[1].cylinder.radius_mm", "positive"),
        ("/cutters/2/dome/radius_mm", "0", "cutters[2].dome.radius_mm", "positive"),
        ("/cutters/2/dome/centre", "null", "cutters[2].dome.centre", "missing"),
        ("/cutters/2/kerf_mm", "-0.5", "cutters[2].kerf_mm", "0 mm or more"),
        ("/cutters/2/kerf_mm", "40.5", "cutters[2].kerf_mm", "nothing inside"),
        ("/cutters/3/blade/right", "[0,0,-1]", "cutters[3].blade.right", "along its normal"),
        ("/cutters/3/blade/height_mm", "0", "cutters[3].blade", "wider and higher"),
        ("/cutters/1/id", "\"c1\"", "cutters[1].id", "twice"),
        ("/fragments/0/volume", "\"mri\"", "fragments[0].volume", "\"mri\""),
        ("/fragments/0/keep/c9", "\"+\"", "fragments[0].keep.c9", "not among the cutters"),
        ("/fragments/0/keep/c1", "\"plus\"", "fragments[0].keep.c1", "not a side"),
        ("/fragments/0/keep", "[]", "fragments[0].keep", "not an object"),
        ("/implants/0/keep/c9", "\"+\"", "implants[0].keep.c9", "not among the cutters"),
        ("/implants/0/keep/c1", "true", "implants[0].keep.c1", "not a side"),
        ("/implants/0/scale", "0", "implants[0].scale", "not more than 0"),
        ("/implants/0/opacity", "1.5", "implants[0].opacity", "between 0 and 1"),
        ("/implants/0/color", "[0,0,9]", "implants[0].color", "0 to 1"),
        ("/implants/0/shading", "\"gradient\"", "implants[0].shading", "gradient"),
        ("/camera/eye", "[0,0,0]", "camera", "same point"),
        ("/camera/fov_deg", "30", "camera", "both"),
        ("/camera/parallel_mm", "-1", "camera", "positive"),
        ("/camera/target", "null", "camera.target", "missing"),
        ("/background", "[0,0]", "background", "2 numbers, not 3"),
    ] {
        let (found, text) = broken(pointer, value);
        assert_eq!(found, at, "{pointer} = {value}: {text}");
        assert!(text.contains(part), "{pointer} = {value}: {text}");
    }
}

#[test]
fn what_is_not_a_case_says_so() {
    let error = |text: &str| write_and_load(text).expect_err("not a case");
    assert!(matches!(error("{\"osteotome\": 1,"), FileError::NotJson { .. }), "cut off");
    assert!(matches!(error("[1]"), FileError::NotACase { .. }), "a list");
    assert!(matches!(error("{\"asset\": {}}"), FileError::NotACase { .. }), "glTF");
    assert!(matches!(error("{\"osteotome\": \"1\"}"), FileError::NotACase { .. }), "a text");
    assert!(matches!(error("{\"osteotome\": 2}"), FileError::Newer { .. }), "newer");
    let deep = format!("{{\"osteotome\": 1, \"x\": {}1", "[".repeat(100_000));
    assert!(matches!(error(&deep), FileError::NotJson { .. }), "too deep, without a crash");
    let missing = load(Path::new("/nowhere/at/all.json"));
    assert!(matches!(missing, Err(FileError::Unreadable { .. })), "no such file");
}

#[test]
fn a_newer_case_names_both_versions() {
    let text = write_and_load("{\"osteotome\": 7}").expect_err("newer").to_string();
    assert!(text.contains("version 7") && text.contains("up to 1"), "{text}");
}

#[test]
fn a_save_that_fails_leaves_the_old_file() {
    let folder = tempfile::tempdir().expect("folder");
    let path = folder.path().join("case.json");
    let mut case = write_and_load(FULL).expect("the full case");
    save(&case, &path).expect("saved");
    let before = std::fs::read(&path).expect("read");
    // A name that JSON cannot hold fails before anything is written.
    #[cfg(unix)]
    {
        use std::os::unix::ffi::OsStrExt as _;
        let name = std::ffi::OsStr::from_bytes(b"/data/\xFF.nrrd");
        let mut bad = case.clone();
        bad.volumes[0].source = crate::case::Source::Path(name.into());
        assert!(matches!(save(&bad, &path), Err(FileError::NotUnicode { .. })), "not Unicode");
    }
    // A folder in the way of the rename fails after everything is written.
    let blocked = folder.path().join("blocked.json");
    std::fs::create_dir_all(blocked.join("full")).expect("folder");
    assert!(matches!(save(&case, &blocked), Err(FileError::Unwritable { .. })), "a folder in the way");
    assert!(save(&case, &folder.path().join("none/case.json")).is_err(), "no such folder");
    assert_eq!(std::fs::read(&path).expect("read"), before, "the old file");
    let names: Vec<_> = std::fs::read_dir(folder.path()).expect("list").flatten().collect();
    assert_eq!(names.len(), 2, "no temporary file is left: {names:?}");
    edit::apply(&mut case, Edit::SetName("right hip".to_owned())).expect("renamed");
    save(&case, &path).expect("saved");
    assert_eq!(load(&path).expect("loaded").name, "right hip", "the new file");
}

#[cfg(target_os = "linux")]
#[test]
fn a_link_stays_a_link() {
    let folder = tempfile::tempdir().expect("folder");
    let (real, link) = (folder.path().join("real.json"), folder.path().join("link.json"));
    std::fs::write(&real, FULL).expect("written");
    std::os::unix::fs::symlink(&real, &link).expect("link");
    let case = load(&link).expect("through the link");
    save(&case, &link).expect("saved");
    assert!(std::fs::symlink_metadata(&link).expect("link").file_type().is_symlink(), "still a link");
    assert_eq!(load(&real).expect("loaded").name, "left hip", "the real file was replaced");
}

#[test]
fn a_case_is_told_from_other_json() {
    let folder = tempfile::tempdir().expect("folder");
    let path = folder.path().join("x.json");
    std::fs::write(&path, FULL).expect("written");
    assert!(looks_like_case(&path), "a case");
    std::fs::write(&path, "{\"asset\": {\"version\": \"2.0\"}}").expect("written");
    assert!(!looks_like_case(&path), "glTF");
    assert!(!looks_like_case(folder.path()), "a folder");
}
