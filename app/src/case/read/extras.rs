//! Labels, and what a volume says of how it is drawn.

use std::collections::BTreeMap;
use std::path::Path;

use render::scene::VolumeMode;
use serde_json::Value;

use super::{Fields, Read, boolean, fault, number, numbers, source, whole};
use crate::case::LabelSet;
use crate::case::labels::MAX_LABEL;

pub(super) fn labels(value: Value, at: String, folder: &Path) -> Read<LabelSet> {
    let mut fields = Fields::of(value, at)?;
    let (id, volume) = (fields.string("id")?, fields.string("volume")?);
    let source = match fields.take("source") {
        Some((value, at)) => Some(source(value, at, folder)?),
        None => None,
    };
    let item = fields.or("item", 0, whole)?;
    let colors = fields.or("colors", BTreeMap::new(), colors)?;
    let visible = fields.or("visible", true, boolean)?;
    Ok(LabelSet { item, colors, visible, other: fields.map, ..LabelSet::new(id, volume, source) })
}

fn colors(value: Value, at: String) -> Read<BTreeMap<u32, [f64; 4]>> {
    let fields = Fields::of(value, at)?;
    let mut colors = BTreeMap::new();
    for (key, value) in fields.map {
        let at = format!("{}.{key}", fields.at);
        let Some(label) = key.parse().ok().filter(|label| (1..=MAX_LABEL).contains(label)) else {
            return fault(at, "is not a label", "write a whole number from 1 to 65535, in quotes");
        };
        let color = numbers::<4>(value, at.clone())?;
        if !color.iter().all(|c| (0.0..=1.0).contains(c)) {
            return fault(at, "has a component outside 0 to 1", "write [r, g, b, a] between 0 and 1");
        }
        colors.insert(label, color);
    }
    Ok(colors)
}

/// A number from 0 to 1.
pub(super) fn unit(value: Value, at: String) -> Read<f64> {
    match number(value, at.clone())? {
        part if (0.0..=1.0).contains(&part) => Ok(part),
        part => fault(at, format!("is {part}, not between 0 and 1"), "write a number from 0 to 1"),
    }
}

pub(super) fn mode(value: Value, at: String) -> Read<VolumeMode> {
    const REMEDY: &str = "write \"composite\", \"mip\" or {\"isosurface\": {\"value\": 300}}";
    match value {
        Value::String(text) if text == "composite" => Ok(VolumeMode::Composite),
        Value::String(text) if text == "mip" => Ok(VolumeMode::Mip),
        Value::Object(map) if map.contains_key("isosurface") && map.len() == 1 => {
            let mut outer = Fields { at, map };
            let (value, at) = outer.need("isosurface")?;
            let mut fields = Fields::of(value, at)?;
            let (value, at) = fields.need("value")?;
            let value = number(value, at)?;
            let opacity = fields.or("opacity", 1.0, unit)?;
            Ok(VolumeMode::Isosurface { value, opacity })
        }
        _ => fault(at, "is not a mode", REMEDY),
    }
}
