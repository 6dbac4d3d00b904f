//! From a [`Case`] to JSON that people can read: known keys first, unknown ones after, short lists of
//! numbers on one line.

use std::collections::BTreeMap;
use std::path::{Component, Path, PathBuf};

use render::scene::{Projection, Shading, VolumeMode};
use render::volume::cells::{Part, Place};
use render::volume::{ControlPoint, Shape, Side, Transfer};
use serde_json::{Map, Value, json};

use super::grids::FieldChoice;
use super::{Case, Fragment, Implant, LabelSet, NamedCutter, Other, Source, UnstructuredGrid, Volume};

/// A source whose path is not Unicode, which JSON cannot hold.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct NotUnicode(pub PathBuf);

/// The document; sources are written relative to `folder` where they share more than a root with it.
pub(super) fn case(case: &Case, folder: &Path) -> Result<String, NotUnicode> {
    let mut volumes = Vec::new();
    for v in &case.volumes {
        volumes.push(volume(v, folder)?);
    }
    let mut implants = Vec::new();
    for i in &case.implants {
        implants.push(implant(i, folder)?);
    }
    let mut map = Map::new();
    put(&mut map, "osteotome", json!(1));
    put(&mut map, "name", json!(case.name));
    put(&mut map, "volumes", Value::Array(volumes));
    put(&mut map, "cutters", case.cutters.iter().map(cutter).collect());
    put(&mut map, "fragments", case.fragments.iter().map(fragment).collect());
    put(&mut map, "implants", Value::Array(implants));
    if !case.labels.is_empty() {
        let mut all = Vec::new();
        for l in &case.labels {
            all.push(labels(l, folder)?);
        }
        put(&mut map, "labels", Value::Array(all));
    }
    if !case.grids.is_empty() {
        let mut all = Vec::new();
        for g in &case.grids {
            all.push(grid(g, folder)?);
        }
        put(&mut map, "grids", Value::Array(all));
    }
    if let Some(camera) = &case.camera {
        let mut at = Map::new();
        put(&mut at, "eye", json!(camera.eye.coords.as_slice()));
        put(&mut at, "target", json!(camera.target.coords.as_slice()));
        put(&mut at, "up", json!(camera.up.as_slice()));
        match camera.projection {
            Projection::Perspective { fov_rad } => put(&mut at, "fov_deg", json!(fov_rad.to_degrees())),
            Projection::Parallel { height_mm } => put(&mut at, "parallel_mm", json!(height_mm)),
        }
        put(&mut map, "camera", with(at, &case.camera_other));
    }
    put(&mut map, "background", json!(case.background));
    let mut text = String::new();
    pretty(&with(map, &case.other), 0, &mut text);
    text.push('\n');
    Ok(text)
}

fn put(map: &mut Map<String, Value>, key: &str, value: Value) {
    map.insert(key.to_owned(), value);
}

fn with(mut map: Map<String, Value>, other: &Other) -> Value {
    for (key, value) in other {
        map.entry(key.clone()).or_insert_with(|| value.clone());
    }
    Value::Object(map)
}

fn volume(v: &Volume, folder: &Path) -> Result<Value, NotUnicode> {
    let mut map = Map::new();
    put(&mut map, "id", json!(v.id));
    put(&mut map, "source", source(&v.source, folder)?);
    if v.item > 0 {
        put(&mut map, "item", json!(v.item));
    }
    if v.step > 0 {
        put(&mut map, "step", json!(v.step));
    }
    put(&mut map, "pose", json!(v.pose.to_row_major()));
    put(&mut map, "visible", json!(v.visible));
    put(&mut map, "texture", json!(v.texture.name()));
    put(&mut map, "transfer", transfer(&v.transfer, &v.transfer_other));
    put(&mut map, "shading", json!(shading_name(v.shading, "gradient")));
    match v.mode {
        VolumeMode::Composite => {}
        VolumeMode::Mip => put(&mut map, "mode", json!("mip")),
        VolumeMode::Isosurface { value, opacity } => {
            put(&mut map, "mode", json!({"isosurface": {"value": value, "opacity": opacity}}));
        }
    }
    if v.blend != 1.0 {
        put(&mut map, "blend", json!(v.blend));
    }
    Ok(with(map, &v.other))
}

fn transfer(transfer: &Transfer, other: &Other) -> Value {
    let point = |p: &ControlPoint| {
        let [r, g, b, a] = p.rgba;
        json!([p.value, r, g, b, a])
    };
    let mut map = Map::new();
    put(&mut map, "points", transfer.points().iter().map(point).collect());
    put(&mut map, "unit_mm", json!(transfer.unit_mm()));
    with(map, other)
}

/// The name a file has for a texture format.
fn shading_name(shading: Shading, lit: &'static str) -> &'static str {
    match shading {
        Shading::None => "none",
        Shading::Lit => lit,
    }
}

fn cutter(c: &NamedCutter) -> Value {
    let mut shape = Map::new();
    let kind = match c.cutter.shape() {
        Shape::Plane { point, normal } => {
            put(&mut shape, "point", json!(point.coords.as_slice()));
            put(&mut shape, "normal", json!(normal.as_slice()));
            "plane"
        }
        Shape::Cylinder { point, axis, radius_mm } => {
            put(&mut shape, "point", json!(point.coords.as_slice()));
            put(&mut shape, "axis", json!(axis.as_slice()));
            put(&mut shape, "radius_mm", json!(radius_mm));
            "cylinder"
        }
        Shape::Dome { centre, radius_mm } => {
            put(&mut shape, "centre", json!(centre.coords.as_slice()));
            put(&mut shape, "radius_mm", json!(radius_mm));
            "dome"
        }
        Shape::Blade { point, normal, right, width_mm, height_mm } => {
            put(&mut shape, "point", json!(point.coords.as_slice()));
            put(&mut shape, "normal", json!(normal.as_slice()));
            put(&mut shape, "right", json!(right.as_slice()));
            put(&mut shape, "width_mm", json!(width_mm));
            put(&mut shape, "height_mm", json!(height_mm));
            "blade"
        }
    };
    let mut map = Map::new();
    put(&mut map, "id", json!(c.id));
    put(&mut map, kind, with(shape, &c.cutter_other));
    if c.cutter.kerf_mm() > 0.0 {
        put(&mut map, "kerf_mm", json!(c.cutter.kerf_mm()));
    }
    with(map, &c.other)
}

fn fragment(f: &Fragment) -> Value {
    let mut map = Map::new();
    put(&mut map, "id", json!(f.id));
    put(&mut map, "volume", json!(f.volume));
    put(&mut map, "keep", keep(&f.keep));
    put(&mut map, "pose", json!(f.pose.to_row_major()));
    put(&mut map, "visible", json!(f.visible));
    with(map, &f.other)
}

fn keep(sides: &BTreeMap<String, Side>) -> Value {
    let mut keep = Map::new();
    for (id, side) in sides {
        put(&mut keep, id, json!(if *side == Side::Plus { "+" } else { "-" }));
    }
    Value::Object(keep)
}

fn implant(i: &Implant, folder: &Path) -> Result<Value, NotUnicode> {
    let mut map = Map::new();
    put(&mut map, "id", json!(i.id));
    put(&mut map, "source", source(&i.source, folder)?);
    if i.item > 0 {
        put(&mut map, "item", json!(i.item));
    }
    put(&mut map, "pose", json!(i.pose.to_row_major()));
    if i.scale != 1.0 {
        put(&mut map, "scale", json!(i.scale));
    }
    if !i.keep.is_empty() {
        put(&mut map, "keep", keep(&i.keep));
    }
    put(&mut map, "color", json!(i.color));
    put(&mut map, "opacity", json!(i.opacity));
    put(&mut map, "visible", json!(i.visible));
    put(&mut map, "shading", json!(shading_name(i.shading, "headlight")));
    Ok(with(map, &i.other))
}

fn labels(l: &LabelSet, folder: &Path) -> Result<Value, NotUnicode> {
    let mut map = Map::new();
    put(&mut map, "id", json!(l.id));
    put(&mut map, "volume", json!(l.volume));
    if let Some(from) = &l.source {
        put(&mut map, "source", source(from, folder)?);
    }
    if l.item > 0 {
        put(&mut map, "item", json!(l.item));
    }
    let colors: Map<String, Value> = l.colors.iter().map(|(n, c)| (n.to_string(), json!(c))).collect();
    put(&mut map, "colors", Value::Object(colors));
    put(&mut map, "visible", json!(l.visible));
    Ok(with(map, &l.other))
}

fn grid(g: &UnstructuredGrid, folder: &Path) -> Result<Value, NotUnicode> {
    let mut map = Map::new();
    put(&mut map, "id", json!(g.id));
    put(&mut map, "source", source(&g.source, folder)?);
    if g.item > 0 {
        put(&mut map, "item", json!(g.item));
    }
    if g.step > 0 {
        put(&mut map, "step", json!(g.step));
    }
    put(&mut map, "pose", json!(g.pose.to_row_major()));
    if g.scale != 1.0 {
        put(&mut map, "scale", json!(g.scale));
    }
    if let Some(fragment) = &g.fragment {
        put(&mut map, "fragment", json!(fragment));
    }
    put(&mut map, "visible", json!(g.visible));
    if let Some(field) = &g.field {
        put(&mut map, "field", choice(field));
    }
    if !g.unit.is_empty() {
        put(&mut map, "unit", json!(g.unit));
    }
    if let Some(of) = &g.transfer {
        put(&mut map, "transfer", transfer(of, &g.transfer_other));
    }
    Ok(with(map, &g.other))
}

fn choice(choice: &FieldChoice) -> Value {
    let mut map = Map::new();
    put(&mut map, "name", json!(choice.name));
    if let Some(place) = choice.place {
        put(&mut map, "on", json!(if place == Place::Points { "points" } else { "cells" }));
    }
    match choice.part {
        Some(Part::Component(component)) => put(&mut map, "part", json!(component)),
        Some(Part::Magnitude) => put(&mut map, "part", json!("magnitude")),
        None => {}
    }
    Value::Object(map)
}

fn source(source: &Source, folder: &Path) -> Result<Value, NotUnicode> {
    match source {
        Source::Builtin(_) => Ok(json!(source.to_string())),
        Source::Path(path) => {
            let written = relative(path, folder).unwrap_or_else(|| path.clone());
            let text = written.to_str().ok_or_else(|| NotUnicode(path.clone()))?;
            Ok(json!(if cfg!(windows) { text.replace('\\', "/") } else { text.to_owned() }))
        }
    }
}

/// `path` as seen from `folder`; none where they have no more than a root in common, since such a path
/// would break as soon as the case is copied anywhere.
fn relative(path: &Path, folder: &Path) -> Option<PathBuf> {
    let a: Vec<Component<'_>> = path.components().collect();
    let b: Vec<Component<'_>> = folder.components().collect();
    let same = a.iter().zip(&b).take_while(|(p, q)| p == q).count();
    if !a.iter().take(same).any(|c| matches!(c, Component::Normal(_))) {
        return None;
    }
    let up = b.iter().skip(same).map(|_| Component::ParentDir);
    let way: PathBuf = up.chain(a.iter().skip(same).copied()).collect();
    Some(if way.as_os_str().is_empty() { PathBuf::from(".") } else { way })
}

/// JSON with an indent of two; a list without objects in it stands on one line.
fn pretty(value: &Value, depth: usize, out: &mut String) {
    let line = |out: &mut String, depth: usize| {
        out.push('\n');
        out.push_str(&"  ".repeat(depth));
    };
    match value {
        Value::Object(map) if !map.is_empty() => {
            out.push('{');
            for (i, (key, value)) in map.iter().enumerate() {
                if i > 0 {
                    out.push(',');
                }
                line(out, depth + 1);
                out.push_str(&json!(key).to_string());
                out.push_str(": ");
                pretty(value, depth + 1, out);
            }
            line(out, depth);
            out.push('}');
        }
        Value::Array(items) if items.iter().any(|v| v.is_object() || v.is_array()) => {
            out.push('[');
            for (i, value) in items.iter().enumerate() {
                if i > 0 {
                    out.push(',');
                }
                line(out, depth + 1);
                pretty(value, depth + 1, out);
            }
            line(out, depth);
            out.push(']');
        }
        Value::Array(items) => {
            let texts: Vec<String> = items.iter().map(Value::to_string).collect();
            out.push('[');
            out.push_str(&texts.join(", "));
            out.push(']');
        }
        plain => out.push_str(&plain.to_string()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_are_relative_where_that_survives_a_copy() {
        let from = |path: &str| relative(Path::new(path), Path::new("/home/ann/hip"));
        assert_eq!(from("/home/ann/hip/ct"), Some("ct".into()), "within");
        assert_eq!(from("/home/ann/data/ct.nrrd"), Some("../data/ct.nrrd".into()), "beside");
        assert_eq!(from("/home/ann/hip"), Some(".".into()), "the folder itself");
        assert_eq!(from("/mnt/scans/ct"), None, "elsewhere");
    }

    #[test]
    fn pretty_json_is_the_same_json() {
        let value = json!({"a": [1.5, 2], "b": {"c": [], "d": {}, "e": [[1, 2], [3]]}, "f\"": "x\ny"});
        let mut text = String::new();
        pretty(&value, 0, &mut text);
        assert_eq!(serde_json::from_str::<Value>(&text).expect("json"), value, "{text}");
        assert!(text.contains("\"a\": [1.5, 2],"), "numbers on one line: {text}");
    }
}
