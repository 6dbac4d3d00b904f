//! From JSON to a [`Case`], with the path of a field in every complaint.
#![expect(
    clippy::needless_pass_by_value,
    reason = "all readers take a value and its path alike, so that `Fields` can call any of them"
)]

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use render::scene::{Camera, Projection, Shading, TextureFormat, VolumeMode};
use render::volume::TransferError;
use render::volume::{
    Affine, ControlPoint, Cutter, CutterError, Point, Shape, Side, SpaceError, Transfer, Vector,
};
use serde_json::{Map, Value};

use super::{Case, Fragment, Implant, NamedCutter, Other, Source, Volume};

mod extras;
mod grids;

/// A field that cannot be used.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Fault {
    /// `fragments[2].keep.c9`.
    pub at: String,
    /// What is wrong, in a clause.
    pub what: String,
    /// What to do, in a clause.
    pub remedy: &'static str,
}

type Read<T> = Result<T, Fault>;

fn fault<T>(at: impl Into<String>, what: impl Into<String>, remedy: &'static str) -> Read<T> {
    Err(Fault { at: at.into(), what: what.into(), remedy })
}

/// The fields of one object. What is taken is known; the rest is kept.
struct Fields {
    at: String,
    map: Map<String, Value>,
}

impl Fields {
    fn of(value: Value, at: String) -> Read<Self> {
        match value {
            Value::Object(map) => Ok(Self { at, map }),
            _ => fault(at, "is not an object", "write it as {\"key\": value, ...}"),
        }
    }

    fn path(&self, key: &str) -> String {
        if self.at.is_empty() { key.to_owned() } else { format!("{}.{key}", self.at) }
    }

    /// The value of a key with its path; `null` counts as absent.
    fn take(&mut self, key: &str) -> Option<(Value, String)> {
        let value = self.map.shift_remove(key).filter(|v| !v.is_null())?;
        Some((value, self.path(key)))
    }

    fn need(&mut self, key: &str) -> Read<(Value, String)> {
        let path = self.path(key);
        self.take(key).map_or_else(|| fault(path, "is missing", "add it"), Ok)
    }

    fn string(&mut self, key: &str) -> Read<String> {
        let (value, at) = self.need(key)?;
        string(value, at)
    }

    fn or<T>(&mut self, key: &str, default: T, read: impl Fn(Value, String) -> Read<T>) -> Read<T> {
        self.take(key).map_or(Ok(default), |(value, at)| read(value, at))
    }

    fn list<T>(&mut self, key: &str, read: impl Fn(Value, String) -> Read<T>) -> Read<Vec<T>> {
        match self.take(key) {
            None => Ok(Vec::new()),
            Some((Value::Array(items), at)) => {
                let one = |(i, value)| read(value, format!("{at}[{i}]"));
                items.into_iter().enumerate().map(one).collect()
            }
            Some((_, at)) => fault(at, "is not a list", "write it as [ ... ]"),
        }
    }
}

/// The case in a JSON document whose version was checked; paths are resolved against `folder`.
pub(super) fn case(document: Map<String, Value>, folder: &Path) -> Read<Case> {
    let mut fields = Fields { at: String::new(), map: document };
    fields.map.shift_remove("osteotome");
    let name = fields.or("name", String::new(), string)?;
    let volumes = fields.list("volumes", |v, at| volume(v, at, folder))?;
    let cutters = fields.list("cutters", cutter)?;
    let fragments = fields.list("fragments", fragment)?;
    let implants = fields.list("implants", |v, at| implant(v, at, folder))?;
    let labels = fields.list("labels", |v, at| extras::labels(v, at, folder))?;
    let grids = fields.list("grids", |v, at| grids::grid(v, at, folder))?;
    let (camera, camera_other) = match fields.take("camera") {
        Some((value, at)) => camera(value, at).map(|(camera, other)| (Some(camera), other))?,
        None => (None, Other::new()),
    };
    let background = fields.or("background", [0.0; 3], unit_numbers)?;
    let other = fields.map;
    let case = Case {
        name,
        volumes,
        cutters,
        fragments,
        implants,
        labels,
        grids,
        camera,
        camera_other,
        background,
        other,
    };
    check_references(&case)?;
    Ok(case)
}

fn check_references(case: &Case) -> Read<()> {
    let unique = |list: &str, ids: Vec<&str>| {
        for (i, id) in ids.iter().enumerate() {
            let at = format!("{list}[{i}].id");
            if id.is_empty() {
                return fault(at, "is empty", "give it a name");
            }
            if ids.iter().take(i).any(|earlier| earlier == id) {
                return fault(at, format!("\"{id}\" is there twice"), "rename one of the two");
            }
        }
        Ok(())
    };
    unique("volumes", case.volumes.iter().map(|v| v.id.as_str()).collect())?;
    unique("cutters", case.cutters.iter().map(|c| c.id.as_str()).collect())?;
    unique("fragments", case.fragments.iter().map(|f| f.id.as_str()).collect())?;
    unique("implants", case.implants.iter().map(|i| i.id.as_str()).collect())?;
    unique("labels", case.labels.iter().map(|l| l.id.as_str()).collect())?;
    unique("grids", case.grids.iter().map(|g| g.id.as_str()).collect())?;
    for (i, grid) in case.grids.iter().enumerate() {
        if let Some(id) = grid.fragment.as_deref().filter(|id| case.fragment(id).is_none()) {
            let text = format!("names fragment \"{id}\", which is not among the fragments");
            return fault(format!("grids[{i}].fragment"), text, "name one of the fragments");
        }
    }
    for (i, labels) in case.labels.iter().enumerate() {
        if case.volume(&labels.volume).is_none() {
            let text = format!("names volume \"{}\", which is not among the volumes", labels.volume);
            return fault(format!("labels[{i}].volume"), text, "name one of the volumes");
        }
    }
    let known =
        |at: String, keep: &BTreeMap<String, Side>| match keep.keys().find(|id| case.cutter(id).is_none()) {
            Some(id) => {
                let text = format!("names cutter \"{id}\", which is not among the cutters");
                fault(format!("{at}.keep.{id}"), text, "add the cutter or remove the key")
            }
            None => Ok(()),
        };
    for (i, fragment) in case.fragments.iter().enumerate() {
        if case.volume(&fragment.volume).is_none() {
            let text = format!("names volume \"{}\", which is not among the volumes", fragment.volume);
            return fault(format!("fragments[{i}].volume"), text, "name one of the volumes");
        }
        known(format!("fragments[{i}]"), &fragment.keep)?;
    }
    for (i, implant) in case.implants.iter().enumerate() {
        known(format!("implants[{i}]"), &implant.keep)?;
    }
    Ok(())
}

fn volume(value: Value, at: String, folder: &Path) -> Read<Volume> {
    let mut fields = Fields::of(value, at)?;
    let id = fields.string("id")?;
    let (value, at) = fields.need("source")?;
    let source = source(value, at, folder)?;
    let item = fields.or("item", 0, whole)?;
    let step = fields.or("step", 0, whole)?;
    let pose = fields.or("pose", Affine::identity(), pose)?;
    let visible = fields.or("visible", true, boolean)?;
    let texture = fields.or("texture", TextureFormat::Auto, texture)?;
    let (value, at) = fields.need("transfer")?;
    let (transfer, transfer_other) = transfer(value, at)?;
    let shading = fields.or("shading", Shading::None, |v, at| shading(v, at, "gradient"))?;
    let mode = fields.or("mode", VolumeMode::Composite, extras::mode)?;
    let blend = fields.or("blend", 1.0, extras::unit)?;
    let transfer = Arc::new(transfer);
    Ok(Volume {
        id,
        source,
        item,
        step,
        pose,
        visible,
        texture,
        transfer,
        transfer_other,
        shading,
        mode,
        blend,
        other: fields.map,
    })
}

fn transfer(value: Value, at: String) -> Read<(Transfer, Other)> {
    let mut fields = Fields::of(value, at)?;
    let points = fields.list("points", |value, at| {
        numbers::<5>(value, at).map(|[value, r, g, b, a]| ControlPoint { value, rgba: [r, g, b, a] })
    })?;
    let unit_mm = fields.or("unit_mm", 1.0, number)?;
    let error = match Transfer::new(points, unit_mm) {
        Ok(transfer) => return Ok((transfer, fields.map)),
        Err(error) => error,
    };
    let (key, remedy) = match &error {
        TransferError::Empty => ("points".to_owned(), "add at least one [value, r, g, b, a]"),
        TransferError::Order { index } => (format!("points[{index}]"), "order the points by value"),
        TransferError::Range { index } => (format!("points[{index}]"), "write r, g, b and a between 0 and 1"),
        _ => ("unit_mm".to_owned(), "write a length in mm, such as 1.0"),
    };
    fault(fields.path(&key), error.to_string(), remedy)
}

fn cutter(value: Value, at: String) -> Read<NamedCutter> {
    const KINDS: [&str; 4] = ["plane", "cylinder", "dome", "blade"];
    let mut fields = Fields::of(value, at)?;
    let id = fields.string("id")?;
    let mut given = KINDS.into_iter().filter_map(|kind| Some((kind, fields.take(kind)?))).collect::<Vec<_>>();
    let Some((kind, (value, at))) = given.pop() else {
        let remedy = "add \"plane\", \"cylinder\", \"dome\" or \"blade\"";
        return fault(fields.at, "is neither a plane nor a cylinder, dome or blade", remedy);
    };
    if let Some((other, _)) = given.pop() {
        return fault(fields.at, format!("is both a {other} and a {kind}"), "make two cutters of it");
    }
    let mut of = Fields::of(value, at)?;
    let shape = match kind {
        "plane" => Shape::Plane { point: of.point("point")?, normal: of.vector("normal")? },
        "cylinder" => Shape::Cylinder {
            point: of.point("point")?,
            axis: of.vector("axis")?,
            radius_mm: of.number("radius_mm")?,
        },
        "dome" => Shape::Dome { centre: of.point("centre")?, radius_mm: of.number("radius_mm")? },
        _ => Shape::Blade {
            point: of.point("point")?,
            normal: of.vector("normal")?,
            right: of.vector("right")?,
            width_mm: of.number("width_mm")?,
            height_mm: of.number("height_mm")?,
        },
    };
    let kerf_mm = fields.or("kerf_mm", 0.0, number)?;
    let error = match Cutter::new(shape, kerf_mm) {
        Ok(cutter) => return Ok(NamedCutter { id, cutter, cutter_other: of.map, other: fields.map }),
        Err(error) => error,
    };
    let (at, remedy) = match error {
        CutterError::NoDirection => (of.at, "write a direction that is not 0 0 0"),
        CutterError::NoRight => (of.path("right"), "write a direction across the normal"),
        CutterError::Radius { .. } => (of.path("radius_mm"), "write a radius in mm, more than 0"),
        CutterError::Extent { .. } => (of.at, "write a width and a height in mm, more than 0"),
        CutterError::Kerf { .. } => (fields.path("kerf_mm"), "write a thickness in mm, 0 or more"),
        CutterError::NothingInside { .. } => (fields.path("kerf_mm"), "write less than twice the radius"),
        _ => (of.at, "write finite numbers"),
    };
    fault(at, error.to_string(), remedy)
}

fn fragment(value: Value, at: String) -> Read<Fragment> {
    let mut fields = Fields::of(value, at)?;
    let id = fields.string("id")?;
    let volume = fields.string("volume")?;
    let keep = fields.or("keep", BTreeMap::new(), keep)?;
    let pose = fields.or("pose", Affine::identity(), pose)?;
    let visible = fields.or("visible", true, boolean)?;
    Ok(Fragment { id, volume, keep, pose, visible, other: fields.map })
}

fn keep(value: Value, at: String) -> Read<BTreeMap<String, Side>> {
    let fields = Fields::of(value, at.clone())?;
    let side = |(id, value): (String, Value)| match value.as_str() {
        Some("+") => Ok((id, Side::Plus)),
        Some("-") => Ok((id, Side::Minus)),
        _ => fault(format!("{at}.{id}"), "is not a side", "write \"+\" or \"-\""),
    };
    fields.map.into_iter().map(side).collect()
}

fn implant(value: Value, at: String, folder: &Path) -> Read<Implant> {
    let mut fields = Fields::of(value, at)?;
    let id = fields.string("id")?;
    let (value, at) = fields.need("source")?;
    let source = source(value, at, folder)?;
    let item = fields.or("item", 0, whole)?;
    let pose = fields.or("pose", Affine::identity(), pose)?;
    let scale = fields.or("scale", 1.0, scale)?;
    let keep = fields.or("keep", BTreeMap::new(), keep)?;
    let color = fields.or("color", Implant::COLOR, unit_numbers)?;
    let opacity = fields.or("opacity", 1.0, |value, at| match number(value, at.clone())? {
        opacity if (0.0..=1.0).contains(&opacity) => Ok(opacity),
        opacity => fault(at, format!("is {opacity}, not between 0 and 1"), "write 1 for an opaque surface"),
    })?;
    let visible = fields.or("visible", true, boolean)?;
    let shading = fields.or("shading", Shading::Lit, |v, at| shading(v, at, "headlight"))?;
    let other = fields.map;
    Ok(Implant { id, source, item, pose, scale, keep, color, opacity, visible, shading, other })
}

fn scale(value: Value, at: String) -> Read<f64> {
    match number(value, at.clone())? {
        scale if scale > 0.0 => Ok(scale),
        scale => fault(at, format!("is {scale}, not more than 0"), "write the millimetres of one unit"),
    }
}

fn camera(value: Value, at: String) -> Read<(Camera, Other)> {
    let mut fields = Fields::of(value, at)?;
    let eye = fields.point("eye")?;
    let target = fields.point("target")?;
    let up = fields.or("up", [0.0, 0.0, 1.0], numbers::<3>)?;
    let projection = match (fields.take("fov_deg"), fields.take("parallel_mm")) {
        (Some(_), Some(_)) => {
            return fault(fields.at, "has both fov_deg and parallel_mm", "remove one of them");
        }
        (None, Some((value, at))) => Projection::Parallel { height_mm: number(value, at)? },
        (Some((value, at)), None) => Projection::Perspective { fov_rad: number(value, at)?.to_radians() },
        (None, None) => Projection::Perspective { fov_rad: 30.0_f64.to_radians() },
    };
    let camera = Camera { eye, target, up: Vector::from(up), projection };
    match camera.frame() {
        Ok(_) => Ok((camera, fields.map)),
        Err(error) => fault(fields.at, error.to_string(), "correct it, or remove it to fit everything"),
    }
}

impl Fields {
    fn triple(&mut self, key: &str) -> Read<[f64; 3]> {
        let (value, at) = self.need(key)?;
        numbers(value, at)
    }

    fn point(&mut self, key: &str) -> Read<Point> {
        self.triple(key).map(Point::from)
    }

    fn vector(&mut self, key: &str) -> Read<Vector> {
        self.triple(key).map(Vector::from)
    }

    fn number(&mut self, key: &str) -> Read<f64> {
        let (value, at) = self.need(key)?;
        number(value, at)
    }
}

fn source(value: Value, at: String, folder: &Path) -> Read<Source> {
    let text = string(value, at.clone())?;
    if text.is_empty() {
        return fault(at, "is empty", "name a file or a folder");
    }
    Ok(match text.strip_prefix(Source::BUILTIN) {
        Some(name) => Source::Builtin(name.to_owned()),
        None => Source::Path(folder.join(PathBuf::from(text))),
    })
}

fn string(value: Value, at: String) -> Read<String> {
    match value {
        Value::String(text) => Ok(text),
        _ => fault(at, "is not a text", "write it in quotes"),
    }
}

fn boolean(value: Value, at: String) -> Read<bool> {
    value.as_bool().map_or_else(|| fault(at, "is not true or false", "write true or false"), Ok)
}

fn whole(value: Value, at: String) -> Read<usize> {
    let number = value.as_u64().and_then(|n| usize::try_from(n).ok());
    number.map_or_else(|| fault(at, "is not a whole number", "write 0 for the first"), Ok)
}

fn number(value: Value, at: String) -> Read<f64> {
    let number = value.as_f64().filter(|n| n.is_finite());
    number.map_or_else(|| fault(at, "is not a number", "write a number"), Ok)
}

fn numbers<const N: usize>(value: Value, at: String) -> Read<[f64; N]> {
    let Value::Array(items) = value else {
        return fault(at, format!("is not a list of {N} numbers"), "write it as [ ... ]");
    };
    let found = items.len();
    let read: Vec<f64> = items
        .into_iter()
        .enumerate()
        .map(|(i, value)| number(value, format!("{at}[{i}]")))
        .collect::<Read<_>>()?;
    match read.try_into() {
        Ok(numbers) => Ok(numbers),
        Err(_) => fault(at, format!("has {found} numbers, not {N}"), "write the right count"),
    }
}

fn unit_numbers(value: Value, at: String) -> Read<[f64; 3]> {
    let color = numbers::<3>(value, at.clone())?;
    if color.iter().all(|c| (0.0..=1.0).contains(c)) {
        Ok(color)
    } else {
        fault(at, "has a component outside 0 to 1", "write red, green and blue between 0 and 1")
    }
}

fn pose(value: Value, at: String) -> Read<Affine> {
    let numbers = numbers::<16>(value, at.clone())?;
    Affine::from_row_major(&numbers).and_then(Affine::require_rigid).or_else(|error| {
        let remedy = match error {
            SpaceError::NotRigid { .. } => "write a rotation and a translation, row by row, without scale",
            SpaceError::NotAffine => "write the matrix row by row; the last row is 0 0 0 1",
            _ => "write a rotation and a translation, row by row",
        };
        fault(at, error.to_string(), remedy)
    })
}

const TEXTURES: [TextureFormat; 8] = [
    TextureFormat::Auto,
    TextureFormat::R16,
    TextureFormat::R32f,
    TextureFormat::Bc4,
    TextureFormat::Bc5,
    TextureFormat::Rgba8,
    TextureFormat::Bc3,
    TextureFormat::Bc7,
];

fn texture(value: Value, at: String) -> Read<TextureFormat> {
    let text = string(value, at.clone())?;
    match TEXTURES.into_iter().find(|format| format.name() == text) {
        Some(format) => Ok(format),
        None => fault(
            at,
            format!("\"{text}\" is not a texture format"),
            "write auto, r16, r32f, bc4, bc5, rgba8, bc3 or bc7",
        ),
    }
}

/// `lit` is the name of the lit kind: `gradient` for volumes, `headlight` for surfaces.
fn shading(value: Value, at: String, lit: &str) -> Read<Shading> {
    let text = string(value, at.clone())?;
    match text.as_str() {
        "none" => Ok(Shading::None),
        text if text == lit => Ok(Shading::Lit),
        _ => fault(
            at,
            format!("\"{text}\" is not a shading here"),
            "write \"none\", \"gradient\" for a volume or \"headlight\" for an implant",
        ),
    }
}
