//! Unstructured grids.

use std::path::Path;
use std::sync::Arc;

use render::volume::Affine;
use render::volume::cells::{Part, Place};
use serde_json::Value;

use super::{Fields, Read, boolean, fault, pose, scale, source, string, transfer, whole};
use crate::case::grids::FieldChoice;
use crate::case::{Other, UnstructuredGrid};

pub(super) fn grid(value: Value, at: String, folder: &Path) -> Read<UnstructuredGrid> {
    let mut fields = Fields::of(value, at)?;
    let id = fields.string("id")?;
    let (value, at) = fields.need("source")?;
    let source = source(value, at, folder)?;
    let item = fields.or("item", 0, whole)?;
    let step = fields.or("step", 0, whole)?;
    let pose = fields.or("pose", Affine::identity(), pose)?;
    let scale = fields.or("scale", 1.0, scale)?;
    let fragment = fields.or("fragment", None, |value, at| string(value, at).map(Some))?;
    let visible = fields.or("visible", true, boolean)?;
    let field = fields.or("field", None, |value, at| choice(value, at).map(Some))?;
    let unit = fields.or("unit", String::new(), string)?;
    let (transfer, transfer_other) = match fields.take("transfer") {
        Some((value, at)) => {
            transfer(value, at).map(|(transfer, other)| (Some(Arc::new(transfer)), other))?
        }
        None => (None, Other::new()),
    };
    let other = fields.map;
    Ok(UnstructuredGrid {
        id,
        source,
        item,
        step,
        pose,
        scale,
        fragment,
        visible,
        field,
        unit,
        transfer,
        transfer_other,
        other,
    })
}

fn choice(value: Value, at: String) -> Read<FieldChoice> {
    if let Value::String(name) = value {
        return Ok(FieldChoice { name, place: None, part: None });
    }
    let mut fields = Fields::of(value, at)?;
    let name = fields.string("name")?;
    let place = fields.or("on", None, |value, at| match value.as_str() {
        Some("points") => Ok(Some(Place::Points)),
        Some("cells") => Ok(Some(Place::Cells)),
        _ => fault(at, "is not a place", "write \"points\" or \"cells\""),
    })?;
    let part = fields.or("part", None, |value, at| match value {
        Value::String(text) if text == "magnitude" => Ok(Some(Part::Magnitude)),
        Value::Number(_) => whole(value, at).map(|c| Some(Part::Component(c))),
        _ => fault(at, "is not a part of a field", "write a component from 0, or \"magnitude\""),
    })?;
    Ok(FieldChoice { name, place, part })
}
