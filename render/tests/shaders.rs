//! Every WGSL file is listed, is whole, and agrees with its Rust mirror.

use std::collections::BTreeMap;
use std::path::Path;

use naga::valid::{Capabilities, ValidationFlags, Validator};
use render::shader::{SOURCES, joined, mirrors};

fn parsed(name: &str) -> naga::Module {
    naga::front::wgsl::parse_str(&joined(name).unwrap()).map_err(|e| e.message().to_owned()).unwrap()
}

#[test]
fn every_shader_on_disk_is_listed() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut found = Vec::new();
    let mut folders = vec![root.clone()];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).unwrap().map(Result::unwrap) {
            let path = entry.path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|e| e == "wgsl") {
                let name = path.strip_prefix(&root).unwrap().to_string_lossy().into_owned();
                found.push(name.strip_prefix("shader/").map_or(name.clone(), str::to_owned));
            }
        }
    }
    found.sort();
    let mut listed: Vec<String> = SOURCES.iter().map(|(name, _)| (*name).to_owned()).collect();
    listed.sort();
    assert_eq!(found, listed, "shader::SOURCES is the list of what is on disk");
}

#[test]
fn every_shader_is_valid() {
    for (name, _) in SOURCES.iter().filter(|(name, _)| !name.starts_with("shared/")) {
        let module = parsed(name);
        let validated = Validator::new(ValidationFlags::all(), Capabilities::all()).validate(&module);
        assert!(validated.is_ok(), "{name}: {validated:?}");
        assert!(!module.entry_points.is_empty(), "{name} has an entry point");
    }
}

#[test]
fn every_mirror_has_its_struct_s_layout() {
    let mut seen = BTreeMap::new();
    for (name, _) in SOURCES.iter().filter(|(name, _)| !name.starts_with("shared/")) {
        for (_, ty) in parsed(name).types.iter() {
            if let (Some(name), naga::TypeInner::Struct { members, span }) = (&ty.name, &ty.inner) {
                let fields: Vec<(String, usize)> =
                    members.iter().map(|m| (m.name.clone().unwrap(), m.offset as usize)).collect();
                seen.insert(name.clone(), (fields, *span as usize));
            }
        }
    }
    for mirror in mirrors() {
        let (fields, span) = &seen[mirror.name];
        let ours: Vec<(String, usize)> =
            mirror.fields.iter().map(|(name, offset)| ((*name).to_owned(), *offset)).collect();
        assert_eq!(&ours, fields, "fields of {}", mirror.name);
        assert_eq!(mirror.size, *span, "size of {}", mirror.name);
    }
    assert_eq!(mirrors().len(), 6, "Frame, Form, Fragment, Round, Decode, Surface");
}

#[test]
fn the_light_is_that_of_the_scene() {
    use render::scene::light;
    let text = joined("passes/slabs/slabs.wgsl").unwrap();
    for (name, value) in [
        ("AMBIENT", light::AMBIENT),
        ("DIFFUSE", light::DIFFUSE),
        ("SPECULAR", light::SPECULAR),
        ("SHININESS", light::SHININESS),
        ("FLAT", light::FLAT),
    ] {
        let line = text.lines().find(|l| l.starts_with(&format!("const {name}: f32 = "))).unwrap();
        let written: f64 = line.split(" = ").nth(1).unwrap().trim_end_matches(';').parse().unwrap();
        assert_eq!(written, value, "{name}");
    }
}
