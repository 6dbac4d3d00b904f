//! glTF 2.0 and GLB: each node of the scene that has a mesh, moved to its place, as one item.
//!
//! The `gltf` crate reads and checks the JSON. What it leaves unchecked is done here: the chunks of a GLB,
//! one index that its own check trusts, and taking numbers out of buffers. Lengths in glTF are metres and become millimetres; the axes stay
//! as they are, as glTF's (y up) say nothing of a patient's.
//!
//! Source: Khronos, *glTF 2.0 Specification*, 3.4 (units), 3.5 (nodes), 3.6.2 (accessors), 3.7.2 (meshes).

use std::io::Read as _;
use std::path::{Component, Path};

use gltf::accessor::{DataType, Dimensions};
use gltf::mesh::Mode;
use nalgebra::{Matrix4, Quaternion, UnitQuaternion, Vector3};
use render::volume::Point;

use super::bytes::{self, Base64, Endian, Fault, Scalar};
use super::surface::{Frame, Surface, Unit};
use super::{Item, Limits, LoadError, Note, Progress, Severity};

const FORMAT: &str = "glTF";
/// Deepest node: a chain this long is no model, and each level takes stack.
const DEEPEST: usize = 256;
/// glTF's metres in millimetres.
const MM: f64 = 1000.0;

/// One item for each node with a mesh in the glTF or GLB file at `path`.
///
/// # Errors
/// [`LoadError`] for a file that cannot be read or contradicts itself, and for compressed meshes.
pub(super) fn read(path: &Path, limits: &Limits, progress: &dyn Progress) -> Result<Vec<Item>, LoadError> {
    let file = bytes::whole(path, FORMAT, limits)?;
    let folder = path.parent().unwrap_or(Path::new("."));
    let beside = |name: &str| {
        let name = Path::new(name);
        if name.components().any(|part| !matches!(part, Component::Normal(_))) {
            return Err(Fault::Unsupported(
                "a buffer outside its own folder".to_owned(),
                "put the buffer beside it, or export a GLB",
            ));
        }
        Ok(bytes::whole(&folder.join(name), FORMAT, limits)?)
    };
    parse(&file, &bytes::file_name(path), &beside, limits, progress)
        .map_err(|fault| fault.at(FORMAT, path, limits))
}

type Beside<'a> = &'a dyn Fn(&str) -> Result<Vec<u8>, Fault>;

fn parse(
    file: &[u8],
    name: &str,
    beside: Beside<'_>,
    limits: &Limits,
    progress: &dyn Progress,
) -> Result<Vec<Item>, Fault> {
    let (json, blob) = chunks(file)?;
    let document = document(json)?;
    let buffers = buffers(&document, blob, beside, limits)?;
    let scene = document.default_scene().or_else(|| document.scenes().next()).ok_or("it has no scene")?;
    let mut placed = Vec::new();
    let mut visited = vec![false; document.nodes().len()];
    for node in scene.nodes() {
        place(&node, &Matrix4::identity(), 0, &mut visited, &mut placed)?;
    }
    let total = placed.len();
    let mut items = Vec::new();
    let mut decoded = 0_u64;
    for (done, (node, world_from_node)) in placed.iter().enumerate() {
        bytes::step(progress, "reading glTF", done, total)?;
        let Some(mesh) = node.mesh() else { continue };
        let mut notes = vec![Note {
            severity: Severity::Fact,
            code: "gltf.metres",
            text: "Lengths in glTF are metres; they were multiplied by 1000 to be millimetres.".to_owned(),
        }];
        let mut surface = Surface::default();
        let mut others = 0_usize;
        for primitive in mesh.primitives() {
            if matches!(primitive.mode(), Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan) {
                take(&primitive, &buffers, world_from_node, limits, &mut surface)?;
            } else {
                others = others.saturating_add(1);
            }
        }
        // A mesh may be placed by many nodes: its copies count together.
        decoded = decoded.saturating_add((surface.positions.len() as u64).saturating_mul(24));
        decoded = decoded.saturating_add((surface.triangles.len() as u64).saturating_mul(12));
        bytes::afford(decoded, 1, limits)?;
        if others > 0 {
            notes.push(Note {
                severity: Severity::Loss,
                code: "gltf.points-and-lines",
                text: format!("{others} parts of points or lines were left out; only triangles are read."),
            });
        }
        if surface.triangles.is_empty() && others > 0 {
            continue;
        }
        // A mirror turns triangles inside out; their corners are swapped so that they face outward.
        if world_from_node.fixed_view::<3, 3>(0, 0).determinant() < 0.0 {
            for [_, b, c] in &mut surface.triangles {
                std::mem::swap(b, c);
            }
        }
        let own = node.name().or(mesh.name()).unwrap_or(name).to_owned();
        items.push(surface.finish(own, FORMAT, Frame::Lps, Unit::Known, notes)?);
    }
    if items.is_empty() { Err("its scene has no triangle".into()) } else { Ok(items) }
}

/// The JSON and the binary chunk of a GLB; a file that is no GLB is JSON only.
fn chunks(file: &[u8]) -> Result<(&[u8], Option<&[u8]>), Fault> {
    let Some(body) = file.strip_prefix(b"glTF") else { return Ok((file, None)) };
    let word = |bytes: &[u8]| {
        Scalar::U32.positions(bytes, Endian::Little).first().and_then(|&n| u64::try_from(n).ok())
    };
    let (header, mut body) = bytes::split(body, 8).ok_or("it ends in its header")?;
    let announced = header.get(4..).and_then(word).unwrap_or(0);
    if announced > file.len() as u64 {
        return Err(format!("it announces {announced} bytes but has {}", file.len()).into());
    }
    let mut found = [None; 2];
    while let Some((header, rest)) = bytes::split(body, 8) {
        let length = word(header).unwrap_or(0);
        let (chunk, rest) = bytes::split(rest, length)
            .ok_or_else(|| format!("a chunk announces {length} bytes but {} follow", rest.len()))?;
        let kind = header.get(4..).unwrap_or_default();
        let slots = found.iter_mut().zip([b"JSON", b"BIN\0"]);
        for (slot, _) in slots.filter(|(slot, name)| slot.is_none() && kind == *name) {
            *slot = Some(chunk);
        }
        body = rest;
    }
    let [json, binary] = found;
    Ok((json.ok_or("it has no JSON chunk")?, binary))
}

/// The checked document.
fn document(json: &[u8]) -> Result<gltf::Document, Fault> {
    let root: gltf::json::Root = gltf::json::deserialize::from_slice(json)
        .map_err(|error| format!("its JSON cannot be read ({error})"))?;
    let primitives = root.meshes.iter().flat_map(|mesh| &mesh.primitives);
    // The check of gltf-json 1.4.1 panics where the positions are not there.
    if let Some(lost) =
        primitives.flat_map(|p| p.attributes.values()).find(|&&index| root.get(index).is_none())
    {
        return Err(format!("a mesh names accessor {}, which is not there", lost.value()).into());
    }
    gltf::Document::from_json(root).map_err(|error| refusal(&error))
}

/// What the crate's refusal means to the user.
fn refusal(error: &gltf::Error) -> Fault {
    let gltf::Error::Validation(faults) = error else { return error.to_string().into() };
    let unsupported =
        faults.iter().any(|(_, fault)| matches!(fault, gltf::json::validation::Error::Unsupported));
    if unsupported {
        let feature = "an extension such as mesh compression".to_owned();
        return Fault::Unsupported(feature, "export it without extensions or compression");
    }
    match faults.first() {
        Some((place, fault)) => format!("{place}: {fault}").into(),
        None => error.to_string().into(),
    }
}

fn buffers(
    document: &gltf::Document,
    mut blob: Option<&[u8]>,
    beside: Beside<'_>,
    limits: &Limits,
) -> Result<Vec<Vec<u8>>, Fault> {
    let mut all = Vec::new();
    for buffer in document.buffers() {
        let data = match buffer.source() {
            gltf::buffer::Source::Bin => blob.take().ok_or("its binary chunk is missing")?.to_vec(),
            gltf::buffer::Source::Uri(uri) => match uri.strip_prefix("data:") {
                Some(inline) => {
                    let (_, text) = inline.split_once(";base64,").ok_or("a buffer's data is not base64")?;
                    let mut data = Vec::new();
                    let mut source = Base64::new(text.as_bytes()).take(limits.decoded_bytes);
                    source.read_to_end(&mut data).map_err(|error| error.to_string())?;
                    data
                }
                None => beside(&bytes::unescaped(uri).ok_or("the name of a buffer is no name")?)?,
            },
        };
        if data.len() < buffer.length() {
            let (found, needed) = (data.len(), buffer.length());
            return Err(format!("buffer {} has {found} bytes, but announces {needed}", buffer.index()).into());
        }
        all.push(data);
    }
    Ok(all)
}

/// Lists the nodes under `node` that have meshes, with their places.
#[expect(clippy::arithmetic_side_effects, reason = "f64 has no side effects")]
fn place<'a>(
    node: &gltf::Node<'a>,
    world_from_parent: &Matrix4<f64>,
    depth: usize,
    visited: &mut [bool],
    placed: &mut Vec<(gltf::Node<'a>, Matrix4<f64>)>,
) -> Result<(), Fault> {
    // glTF 3.5.2: the nodes are disjoint strict trees. Without this a loop would not end.
    let seen = visited.get_mut(node.index()).ok_or("a node is not there")?;
    if std::mem::replace(seen, true) || depth > DEEPEST {
        return Err(format!("node {} has two parents, or is its own, or lies too deep", node.index()).into());
    }
    let parent_from_node = match node.transform() {
        gltf::scene::Transform::Matrix { matrix } => Matrix4::from(matrix).cast::<f64>(),
        gltf::scene::Transform::Decomposed { translation, rotation, scale } => {
            let [x, y, z, w] = rotation.map(f64::from);
            let turn = UnitQuaternion::try_new(Quaternion::new(w, x, y, z), 0.0)
                .ok_or("a node's rotation is zero")?;
            Matrix4::new_translation(&Vector3::from(translation).cast::<f64>())
                * turn.to_homogeneous()
                * Matrix4::new_nonuniform_scaling(&Vector3::from(scale).cast::<f64>())
        }
    };
    let world_from_node = world_from_parent * parent_from_node;
    if node.mesh().is_some() {
        placed.push((node.clone(), world_from_node));
    }
    for child in node.children() {
        place(&child, &world_from_node, depth.saturating_add(1), visited, placed)?;
    }
    Ok(())
}

/// Adds a primitive's triangles to `surface`.
fn take(
    primitive: &gltf::Primitive<'_>,
    buffers: &[Vec<u8>],
    world_from_node: &Matrix4<f64>,
    limits: &Limits,
    surface: &mut Surface,
) -> Result<(), Fault> {
    let first = surface.positions.len() as u64;
    let places = primitive.get(&gltf::Semantic::Positions).ok_or("a mesh has no positions")?;
    if places.dimensions() != Dimensions::Vec3 || places.data_type() != DataType::F32 {
        return Err("its positions are not three 32-bit floats each".into());
    }
    bytes::afford(first.saturating_add(places.count() as u64), 24, limits)?;
    elements(&places, buffers, |element| {
        let numbers = Scalar::F32.reals(element, Endian::Little);
        if let [x, y, z] = numbers.as_slice() {
            let world = world_from_node.transform_point(&Point::new(*x, *y, *z));
            surface.positions.push(world.map(|metres| metres * MM));
        }
    })?;
    let count = places.count() as u64;
    let mut corners: Vec<u32> = Vec::new();
    if let Some(indices) = primitive.indices() {
        let scalar = match (indices.data_type(), indices.dimensions()) {
            (DataType::U8, Dimensions::Scalar) => Scalar::U8,
            (DataType::U16, Dimensions::Scalar) => Scalar::U16,
            (DataType::U32, Dimensions::Scalar) => Scalar::U32,
            _ => return Err("its indices are not unsigned whole numbers".into()),
        };
        bytes::afford(indices.count() as u64, 24, limits)?;
        let mut lost = None;
        elements(&indices, buffers, |element| {
            let named = scalar.positions(element, Endian::Little).first().copied().unwrap_or(-1);
            let inside = u64::try_from(named).ok().filter(|&v| v < count);
            match inside.and_then(|v| u32::try_from(v.saturating_add(first)).ok()) {
                Some(vertex) => corners.push(vertex),
                None => lost = Some(named),
            }
        })?;
        if let Some(named) = lost {
            return Err(format!("a triangle names vertex {named}, but there are only {count}").into());
        }
    } else {
        let end = u32::try_from(first.saturating_add(count)).map_err(|error| error.to_string())?;
        corners.extend(u32::try_from(first).unwrap_or(end)..end);
    }
    match primitive.mode() {
        Mode::TriangleStrip => surface.strip(&corners),
        Mode::TriangleFan => surface.fan(&corners)?,
        _ => surface.triangles.extend_from_slice(corners.as_chunks().0),
    }
    Ok(())
}

/// Calls `each` with the bytes of every element of an accessor.
fn elements(
    accessor: &gltf::Accessor<'_>,
    buffers: &[Vec<u8>],
    mut each: impl FnMut(&[u8]),
) -> Result<(), Fault> {
    if accessor.sparse().is_some() {
        return Err(Fault::Unsupported("sparse accessors".to_owned(), "export it without sparse accessors"));
    }
    let missing = || Fault::Broken(format!("accessor {} reaches past its buffer", accessor.index()));
    let view = accessor.view().ok_or_else(missing)?;
    let buffer = buffers.get(view.buffer().index()).ok_or_else(missing)?;
    let end = view.offset().checked_add(view.length()).ok_or_else(missing)?;
    let data = buffer.get(view.offset()..end).ok_or_else(missing)?;
    let size = accessor.size();
    let stride = view.stride().unwrap_or(size);
    // Otherwise a short buffer could hold any number of elements.
    if stride < size {
        return Err(format!("accessor {} has elements that overlap", accessor.index()).into());
    }
    let mut at = accessor.offset();
    for _ in 0..accessor.count() {
        let element = at.checked_add(size).and_then(|end| data.get(at..end)).ok_or_else(missing)?;
        each(element);
        at = at.checked_add(stride).ok_or_else(missing)?;
    }
    Ok(())
}

#[cfg(test)]
#[expect(
    clippy::indexing_slicing,
    clippy::arithmetic_side_effects,
    clippy::cast_possible_truncation,
    reason = "a test may fail loudly"
)]
mod tests {
    use render::volume::TriangleMesh;

    use super::super::bytes::trial::{sample, survives};
    use super::super::{Content, Silent};
    use super::*;

    /// Four corners of a square of 1 m, then the indices 0 1 2, 0 2 3 as u16.
    fn buffer() -> Vec<u8> {
        let corners: [f32; 12] = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 1.0, 0.0];
        let indices: [u16; 6] = [0, 1, 2, 0, 2, 3];
        let corners = corners.iter().flat_map(|c| c.to_le_bytes());
        corners.chain(indices.iter().flat_map(|i| i.to_le_bytes())).collect()
    }

    /// A scene of a parent moved by 1 m along x and a child turned a quarter about z and doubled.
    fn json(uri: &str, primitive: &str) -> String {
        format!(
            r#"{{"asset":{{"version":"2.0"}},"scene":0,"scenes":[{{"nodes":[0]}}],
            "nodes":[{{"name":"parent","translation":[1,0,0],"children":[1]}},
                {{"mesh":0,"rotation":[0,0,0.70710678,0.70710678],"scale":[2,2,2]}}],
            "meshes":[{{"name":"square","primitives":[{{"attributes":{{"POSITION":0}}{primitive}}}]}}],
            "accessors":[{{"bufferView":0,"componentType":5126,"count":4,"type":"VEC3","min":[0,0,0],"max":[1,1,0]}},
                {{"bufferView":1,"componentType":5123,"count":6,"type":"SCALAR"}}],
            "bufferViews":[{{"buffer":0,"byteLength":48}},{{"buffer":0,"byteOffset":48,"byteLength":12}}],
            "buffers":[{{{uri}"byteLength":60}}]}}"#
        )
    }

    fn glb(json: &str, buffer: &[u8]) -> Vec<u8> {
        let mut json = json.replace('\n', " ").into_bytes();
        json.resize(json.len().next_multiple_of(4), b' ');
        let length = (28 + json.len() + buffer.len()) as u32;
        let mut file = b"glTF".to_vec();
        file.extend(2_u32.to_le_bytes());
        file.extend(length.to_le_bytes());
        for (kind, chunk) in [(b"JSON", json.as_slice()), (b"BIN\0", buffer)] {
            file.extend((chunk.len() as u32).to_le_bytes());
            file.extend(kind);
            file.extend(chunk);
        }
        file
    }

    fn loaded(file: &[u8]) -> Result<Vec<Item>, Fault> {
        let beside =
            |name: &str| if name == "a b.bin" { Ok(buffer()) } else { Err(Fault::from("not there")) };
        parse(file, "a.glb", &beside, &Limits { decoded_bytes: 1 << 20, files: 10 }, &Silent)
    }

    fn only_mesh(items: &[Item]) -> &TriangleMesh {
        let [Item { content: Content::Mesh(mesh), .. }] = items else { panic!("not one mesh: {items:?}") };
        mesh
    }

    #[test]
    fn nodes_are_moved_to_their_place_and_metres_become_millimetres() {
        let items = loaded(&glb(&json("", r#","indices":1"#), &buffer())).expect("a scene");
        let mesh = only_mesh(&items);
        // By hand: (1, 0) turns to (0, 1), doubles to (0, 2), moves to (1, 2) m.
        let expected = [[1.0, 0.0], [1.0, 2.0], [-1.0, 2.0], [-1.0, 0.0]];
        for (p, [x, y]) in mesh.positions().iter().zip(expected) {
            assert!((p - Point::new(x * 1000.0, y * 1000.0, 0.0)).norm() < 1e-3, "{p} for {x} {y} m");
        }
        assert_eq!(mesh.triangles(), [[0, 1, 2], [0, 2, 3]], "triangles");
        assert_eq!(items[0].name, "square", "the node has no name, its mesh has");
        assert_eq!(items[0].notes.first().map(|n| n.code), Some("gltf.metres"), "told");
    }

    #[test]
    fn buffers_beside_it_and_inline_are_read_and_others_are_not() {
        let binary = loaded(&glb(&json("", r#","indices":1"#), &buffer())).expect("binary");
        let beside = json(r#""uri":"a%20b.bin","#, r#","indices":1"#);
        assert_eq!(only_mesh(&loaded(beside.as_bytes()).expect("beside")), only_mesh(&binary), "beside");
        // Made with Python's base64 from the same numbers.
        let inline = "AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAACAPwAAgD8AAAAAAAAAAAAAgD8AAAAAAAABAAIAAAACAAMA";
        let inline =
            json(&format!(r#""uri":"data:application/octet-stream;base64,{inline}","#), r#","indices":1"#);
        assert_eq!(only_mesh(&loaded(inline.as_bytes()).expect("inline")), only_mesh(&binary), "inline");
        let folder = tempfile::tempdir().expect("a folder");
        std::fs::create_dir(folder.path().join("in")).expect("a folder");
        std::fs::write(folder.path().join("secret.bin"), buffer()).expect("written");
        for uri in ["../secret.bin", "%2e%2e/secret.bin", "/etc/passwd", "file:///etc/passwd"] {
            let path = folder.path().join("in/a.gltf");
            std::fs::write(&path, json(&format!(r#""uri":"{uri}","#), "")).expect("written");
            assert!(read(&path, &Limits::default(), &Silent).is_err(), "{uri} lies outside");
        }
    }

    #[test]
    fn strips_and_fans_are_triangles() {
        let strip = loaded(&glb(&json("", r#","mode":5"#), &buffer())).expect("a strip");
        assert_eq!(only_mesh(&strip).triangles(), [[0, 1, 2], [2, 1, 3]], "strip");
        let fan = loaded(&glb(&json("", r#","mode":6,"indices":1"#), &buffer())).expect("a fan");
        assert_eq!(only_mesh(&fan).triangles(), [[0, 1, 2], [0, 2, 0], [0, 0, 2], [0, 2, 3]], "fan");
        assert!(loaded(&glb(&json("", r#","mode":1"#), &buffer())).is_err(), "lines are no surface");
    }

    #[test]
    fn contradictions_are_told() {
        let told = |json: &str| match loaded(&glb(json, &buffer())) {
            Err(fault) => format!("{fault:?}"),
            Ok(items) => panic!("{items:?}"),
        };
        let good = json("", r#","indices":1"#);
        let looped = told(&good.replace(r#""mesh":0,"#, r#""mesh":0,"children":[0],"#));
        assert!(looped.contains("its own"), "{looped}");
        let past = told(&good.replace(r#""count":6"#, r#""count":7"#));
        assert!(past.contains("reaches past"), "{past}");
        let long = told(&good.replace(r#""byteLength":60"#, r#""byteLength":600"#));
        assert!(long.contains("announces 600"), "{long}");
        let many = told(&good.replace(r#""count":4"#, r#""count":4000000000"#));
        assert!(many.contains("TooLarge"), "{many}");
        let index = told(&good.replace(r#""count":4"#, r#""count":3"#));
        assert!(index.contains("vertex 3, but there are only 3"), "{index}");
        let draco = r#"{"extensionsRequired":["KHR_draco_mesh_compression"],"asset""#;
        let draco = told(&good.replacen(r#"{"asset""#, draco, 1));
        assert!(draco.contains("Unsupported"), "{draco}");
    }

    #[test]
    fn a_mirrored_node_still_faces_outward() {
        let mirrored = json("", r#","indices":1"#).replace("[2,2,2]", "[2,2,-2]");
        let items = loaded(&glb(&mirrored, &buffer())).expect("a scene");
        assert_eq!(only_mesh(&items).triangles(), [[0, 2, 1], [0, 3, 2]], "corners swapped");
    }

    #[test]
    fn no_byte_makes_it_panic() {
        survives(&glb(&json("", r#","indices":1"#), &buffer()), loaded);
    }

    #[test]
    fn the_sample_files_have_the_facts_that_trimesh_reads() {
        let Some(path) = sample("mesh/tka_assembly.glb") else { return };
        let items = read(&path, &Limits::default(), &Silent).expect("the parts");
        // Name, triangles, vertices, lowest and highest x in metres, by trimesh 4.
        let facts = [
            ("tka_femoral_component", 24_442, 12_223, [-0.032_173_153_013, 0.034_182_444_215]),
            ("tka_tibial_tray", 64_388, 32_196, [-0.026_494_439_691, 0.026_482_973_248]),
            ("tka_tibial_insert", 15_042, 7_692, [-0.026_199_789_717, 0.020_715_178_922]),
        ];
        assert_eq!(items.len(), 3, "parts");
        for (item, (name, triangles, vertices, [low, high])) in items.iter().zip(facts) {
            let mesh = only_mesh(std::slice::from_ref(item));
            assert_eq!(item.name, name, "name");
            assert_eq!((mesh.triangles().len(), mesh.positions().len()), (triangles, vertices), "{name}");
            let [found_low, found_high] = mesh.bounds().map(|p| p.x);
            assert!((found_low - low * 1000.0).abs() < 1e-6, "{name}: {found_low} mm");
            assert!((found_high - high * 1000.0).abs() < 1e-6, "{name}: {found_high} mm");
        }
    }

    #[test]
    fn the_broken_samples_are_refused() {
        for (name, says) in
            [("bad/glb_truncated.glb", "but has 624686"), ("bad/glb_json_chunk_too_long.glb", "")]
        {
            let Some(path) = sample(name) else { return };
            let Err(error) = read(&path, &Limits::default(), &Silent) else { panic!("{name} accepted") };
            assert!(
                error.to_string().contains("glTF file is broken") && error.to_string().contains(says),
                "{error}"
            );
        }
    }
}
