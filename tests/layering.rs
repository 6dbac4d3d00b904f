//! Which part may know which: the table of ARCHITECTURE.md, held by tests.
//!
//! Two ways: `cargo tree` says what a crate links, and a scan of the sources says what a module names. The scan sees
//! paths (`wgpu::Device`, `use egui`, `crate::host`), not comments or strings.

use std::collections::BTreeSet;
use std::path::Path;
use std::process::Command;

use crate::support::root;

/// Crates that draw a user interface or open a window.
const UI: [&str; 7] = ["egui", "eframe", "egui_wgpu", "egui_extras", "winit", "rfd", "accesskit"];
/// Crates that read files of medicine, meshes or simulations.
const FORMATS: [&str; 13] = [
    "dicom",
    "dicom_core",
    "dicom_dictionary_std",
    "dicom_object",
    "dicom_pixeldata",
    "dicom_transfer_syntax_registry",
    "gltf",
    "jpeg2k",
    "jpeg_decoder",
    "nifti",
    "roxmltree",
    "tobj",
    "zip",
];
/// Crates that talk to the GPU.
const GPU: [&str; 3] = ["wgpu", "wgpu_hal", "naga"];

/// A part of the tree and what it must not name.
struct Rule {
    /// Paths below the root that start with one of these.
    within: &'static [&'static str],
    /// But not these.
    except: &'static [&'static str],
    /// Path heads that may not occur: a crate, or a path below `crate::`.
    forbidden: Vec<&'static str>,
}

fn rules() -> Vec<Rule> {
    let all = |lists: &[&[&'static str]]| lists.concat();
    let rule = |within, except, forbidden| Rule { within, except, forbidden };
    vec![
        rule(&["compress/src/"], &[], all(&[&UI, &FORMATS, &GPU, &["render", "app"]])),
        rule(&["render/src/"], &[], all(&[&UI, &FORMATS, &["app"]])),
        rule(
            &["render/src/volume/", "render/src/reference/"],
            &[],
            all(&[
                &GPU,
                &[
                    "compress",
                    "crate::gpu",
                    "crate::texture",
                    "crate::passes",
                    "crate::shader",
                    "crate::renderer",
                    "crate::cells",
                    "crate::cpu",
                ],
            ]),
        ),
        rule(
            &["render/src/cpu/"],
            &[],
            all(&[
                &UI,
                &GPU,
                &["compress", "crate::reference", "crate::gpu", "crate::passes", "crate::texture"],
            ]),
        ),
        rule(
            &["render/src/cells/"],
            &["render/src/cells/tests/"],
            all(&[
                &UI,
                &GPU,
                &[
                    "compress",
                    "crate::reference",
                    "crate::cpu",
                    "crate::gpu",
                    "crate::passes",
                    "crate::renderer",
                    "crate::texture",
                ],
            ]),
        ),
        rule(
            &["app/src/load/"],
            &[],
            all(&[
                &UI,
                &GPU,
                &["compress", "crate::case", "crate::host", "crate::tools", "crate::ui", "crate::headless"],
            ]),
        ),
        rule(
            &[
                "app/src/case/",
                "app/src/headless/",
                "app/src/scene",
                "app/src/sections",
                "app/src/jobs",
                "app/src/sample/",
                "app/src/save/",
                "app/src/steps/",
            ],
            &[],
            all(&[&UI, &FORMATS, &["wgpu", "naga", "crate::host", "crate::tools", "crate::ui"]]),
        ),
        rule(&["app/src/host/"], &[], all(&[&FORMATS])),
        rule(&["app/src/"], &["app/src/host/viewport"], all(&[&["wgpu", "naga"]])),
        rule(
            &["app/src/tools/", "app/src/ui/"],
            &[],
            all(&[
                &FORMATS,
                &[
                    "compress",
                    "render::reference",
                    "render::gpu",
                    "render::texture",
                    "render::passes",
                    "render::renderer",
                ],
            ]),
        ),
    ]
}

/// Every Rust source below `folder`, as (path below the root, text).
fn sources(folder: &str) -> Vec<(String, String)> {
    let mut found = Vec::new();
    let mut folders = vec![root().join(folder)];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(&folder).unwrap_or_else(|e| panic!("{e}: {}", folder.display())) {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|e| e == "rs") {
                let below = path.strip_prefix(root()).unwrap().to_string_lossy().replace('\\', "/");
                found.push((below, std::fs::read_to_string(&path).unwrap()));
            }
        }
    }
    found.sort();
    found
}

/// The code without its comments and without what stands in its strings.
fn code_only(text: &str) -> String {
    let mut code = String::with_capacity(text.len());
    let mut rest = text.chars().peekable();
    while let Some(c) = rest.next() {
        match (c, rest.peek()) {
            ('r', Some('"' | '#'))
                if !code.ends_with(|before: char| before.is_alphanumeric() || before == '_') =>
            {
                let mut end = String::from('"');
                while rest.next_if_eq(&'#').is_some() {
                    end.push('#');
                }
                if rest.next_if_eq(&'"').is_some() {
                    let mut inside = String::new();
                    while !inside.ends_with(&end) {
                        let Some(c) = rest.next() else { break };
                        inside.push(c);
                    }
                }
            }
            ('/', Some('/')) => {
                rest.by_ref().find(|c| *c == '\n');
                code.push('\n');
            }
            ('\'', Some('"')) => _ = rest.next(),
            ('\'', Some('\\')) => _ = (rest.next(), rest.next()),
            ('"', _) => {
                code.push_str("\"\"");
                while let Some(c) = rest.next() {
                    match c {
                        '\\' => _ = rest.next(),
                        '"' => break,
                        _ => {}
                    }
                }
            }
            _ => code.push(c),
        }
    }
    code
}

/// Every path that the code names, `use` lists spelled out: `use a::{b, c::d}` gives `a::b` and `a::c::d`.
fn paths(code: &str) -> BTreeSet<String> {
    let mut found = BTreeSet::new();
    let mut prefixes: Vec<String> = Vec::new();
    let mut path = String::new();
    let mut in_use = false;
    let mut chars = code.chars().peekable();
    while let Some(c) = chars.next() {
        if c.is_alphanumeric() || c == '_' {
            let mut word = String::from(c);
            while let Some(next) = chars.next_if(|n| n.is_alphanumeric() || *n == '_') {
                word.push(next);
            }
            match word.as_str() {
                "use" => (in_use, path) = (true, String::new()),
                "as" => path.clear(),
                _ => {
                    path.push_str(&word);
                    let head: String = if in_use { prefixes.concat() } else { String::new() };
                    found.insert(format!("{head}{path}"));
                }
            }
            while chars.next_if(|n| n.is_whitespace()).is_some() {}
            let goes_on = chars.peek().is_some_and(|next| *next == ':' || (in_use && *next == '{'));
            if !goes_on {
                path.clear();
            }
        } else if c == ':' && chars.peek() == Some(&':') {
            chars.next();
            path.push_str("::");
        } else if in_use && c == '{' {
            prefixes.push(std::mem::take(&mut path));
        } else if in_use && c == '}' {
            prefixes.pop();
            path.clear();
        } else if c == ';' {
            (in_use, path) = (false, String::new());
            prefixes.clear();
        } else if !c.is_whitespace() {
            path.clear();
        }
    }
    found
}

/// Whether `path` is `head` or lies below it. A lone word that is no path (`zip` the method, `render` a variable) does
/// not count: a crate is named with `::` after it.
fn lies_below(path: &str, head: &str) -> bool {
    path.strip_prefix(head)
        .is_some_and(|rest| rest.starts_with("::") || (rest.is_empty() && head.contains("::")))
}

#[test]
fn no_source_names_what_its_layer_may_not_know() {
    let sources: Vec<_> = ["compress/src", "render/src", "app/src"].into_iter().flat_map(sources).collect();
    let mut faults = Vec::new();
    for rule in rules() {
        for start in rule.within {
            if !sources.iter().any(|(path, _)| path.starts_with(start)) {
                faults.push(format!("{start} is ruled about, but is not there"));
            }
        }
        for (path, text) in &sources {
            let ruled = rule.within.iter().any(|start| path.starts_with(start));
            if !ruled || rule.except.iter().any(|start| path.starts_with(start)) {
                continue;
            }
            let named = paths(&code_only(text));
            for head in &rule.forbidden {
                if let Some(bad) = named.iter().find(|named| lies_below(named, head)) {
                    faults.push(format!("{path} names {bad}"));
                }
            }
        }
    }
    assert!(faults.is_empty(), "these cross a layer:\n{}", faults.join("\n"));
}

#[test]
fn no_tool_uses_another_tool() {
    let tools = root().join("app/src/tools");
    let names: Vec<String> = std::fs::read_dir(&tools)
        .unwrap_or_else(|e| panic!("{e}: {}", tools.display()))
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.is_dir())
        .map(|path| path.file_name().unwrap().to_string_lossy().into_owned())
        .collect();
    assert!(names.len() >= 2, "there are tools: {names:?}");
    let mut faults = Vec::new();
    for (path, text) in sources("app/src/tools") {
        let own = path.split('/').nth(3).unwrap_or_default().to_owned();
        if path.split('/').count() == 4 {
            continue; // tools/mod.rs lists them all.
        }
        for named in paths(&code_only(&text)) {
            for other in names.iter().filter(|name| **name != own) {
                let ways = [
                    format!("crate::tools::{other}"),
                    format!("super::super::{other}"),
                    format!("super::{other}"),
                ];
                // `super::` from tools/x/mod.rs is tools; from a file beside it, it is tools/x.
                let ways = if path.ends_with("/mod.rs") { &ways[..] } else { &ways[..2] };
                if ways.iter().any(|way| lies_below(&named, way)) {
                    faults.push(format!("{path} names {named}"));
                }
            }
        }
    }
    assert!(faults.is_empty(), "tools talk through the case, never to each other:\n{}", faults.join("\n"));
}

/// One line in cargo's `format` for all that a crate links, itself first.
fn tree(package: &str, format: &str) -> String {
    let output = Command::new(env!("CARGO"))
        .args(["tree", "--locked", "-e", "normal", "--prefix", "none", "--format", format, "-p", package])
        .current_dir(root())
        .output()
        .unwrap();
    assert!(output.status.success(), "cargo tree: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

/// The names of all that a crate links, itself left out.
fn linked(package: &str) -> BTreeSet<String> {
    let text = tree(package, "{p}");
    let names = text.lines().skip(1).filter_map(|line| line.split(' ').next());
    names.map(|name| name.replace('-', "_")).collect()
}

#[test]
fn no_crate_links_what_its_layer_may_not_know() {
    let all = |lists: &[&[&'static str]]| lists.concat();
    for (package, forbidden) in [
        ("compress", all(&[&UI, &FORMATS, &GPU, &["render", "app", "nalgebra", "glam"]])),
        ("render", all(&[&UI, &FORMATS, &["app"]])),
    ] {
        let linked = linked(package);
        assert!(linked.contains("rayon"), "{package} links something: {linked:?}");
        let bad: Vec<_> = forbidden.iter().filter(|name| linked.contains(**name)).collect();
        assert!(bad.is_empty(), "{package} links {bad:?}");
    }
}

#[test]
fn nothing_that_ships_is_under_a_licence_that_binds_the_whole() {
    let text = tree("app", "{p}|{l}");
    let packages: BTreeSet<_> =
        text.lines().filter_map(|line| line.trim_end_matches(" (*)").split_once('|')).collect();
    assert!(packages.len() > 50, "the tree was read: {}", packages.len());
    for (package, licence) in packages {
        // "A OR B" leaves the choice; a licence that binds is a fault where there is no other choice.
        let bound = licence.split(" OR ").all(|choice| choice.contains("GPL"));
        assert!(!licence.is_empty() && !bound, "{package} is under \"{licence}\"");
    }
}

#[test]
fn the_scan_sees_paths_and_not_comments_strings_or_words() {
    let text = "
        //! wgpu::Device in a comment
        use std::{io::{self, Read}, path::Path as P};
        use crate::host::{context, viewport::View};
        fn f(zip: u8) { let s = \"egui::Ui \\\" dicom::x\"; let c = '\"'; let r = r#\"a \"wgpu::Device\" b\"#; a.iter().zip(b); tobj :: load(); }";
    let found = paths(&code_only(text));
    for seen in [
        "std::io::Read",
        "std::path::Path",
        "crate::host::viewport::View",
        "crate::host::context",
        "tobj::load",
    ] {
        assert!(found.contains(seen), "{seen} is seen: {found:?}");
    }
    let named = |head: &str| found.iter().any(|path| lies_below(path, head));
    assert!(named("crate::host") && named("tobj"), "what is named is found");
    for unseen in ["wgpu", "egui", "dicom", "zip", "path"] {
        assert!(!named(unseen), "{unseen} is not named as a crate: {found:?}");
    }
}

#[test]
fn every_crate_is_under_the_house_rules() {
    for package in ["compress", "render", "app", "tests"] {
        let manifest = std::fs::read_to_string(root().join(package).join("Cargo.toml")).unwrap();
        assert!(manifest.contains("[lints]\nworkspace = true"), "{package} takes the workspace's lints");
        let versioned = manifest.lines().find(|line| line.contains("version = \""));
        assert!(versioned.is_none(), "versions stand in the root manifest only: {package}: {versioned:?}");
    }
    assert!(!Path::new(&root().join("rust-toolchain.toml")).exists(), "rust-version in Cargo.toml is enough");
}
