//! MetaImage headers as `SimpleITK` writes them.

use super::super::metaimage::read;
use super::*;

/// As `SimpleITK` writes it.
const HEAD: &str = "ObjectType = Image\nNDims = 3\nBinaryData = True\nBinaryDataByteOrderMSB = False\n\
    CompressedData = False\nTransformMatrix = 0.95533648912560598 0.29552020666133955 0 \
    -0.29552020666133955 0.95533648912560598 0 0 0 1\nOffset = 10 20 30\nCenterOfRotation = 0 0 0\n\
    AnatomicalOrientation = RAI\nElementSpacing = 1 2 3\nDimSize = 4 3 2\nElementType = MET_SHORT\n";

fn with(head: &str, data_file: &str, data: &[u8]) -> Vec<u8> {
    [format!("{head}ElementDataFile = {data_file}\n").as_bytes(), data].concat()
}

#[test]
fn local_packed_and_detached_data_are_one_volume() {
    let raw = load_bytes("a.mha", &with(HEAD, "LOCAL", &counted())).expect("loads");
    let grid = volume(&raw);
    assert_near(world(grid, [3.0, 2.0, 1.0]), TURNED, "as SimpleITK wrote it");
    assert_eq!((grid.value(3, 2, 1), codes(&raw)), (23.0, vec![]), "nothing departs");
    let mut packer = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::default());
    packer.write_all(&counted()).expect("in memory");
    let head = HEAD.replace("CompressedData = False", "CompressedData = True");
    let packed = packer.finish().expect("in memory");
    let packed = load_bytes("a.mha", &with(&head, "LOCAL", &packed)).expect("loads");
    assert_eq!(volume(&packed), grid, "packed");
    let (folder, path) = file("a.mhd", &with(&format!("{HEAD}HeaderSize = 3\n"), "a.raw", &[]));
    std::fs::write(folder.path().join("a.raw"), [vec![7; 3], counted()].concat()).expect("written");
    assert_eq!(volume(&only(load(&path).expect("loads"))), grid, "in another file");
}

#[test]
fn both_byte_orders_and_time_are_read() {
    let head = HEAD.replace("MSB = False", "MSB = True");
    let swapped: Vec<u8> = (0..24_i16).flat_map(i16::to_be_bytes).collect();
    let item = load_bytes("a.mha", &with(&head, "LOCAL", &swapped)).expect("loads");
    assert_eq!(volume(&item).value(3, 2, 1), 23.0, "big endian");
    let head = "ObjectType = Image\nNDims = 4\nDimSize = 2 2 1 3\nElementSpacing = 1 1 1 0.25\n\
        TransformMatrix = 1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1\nOffset = 0 0 0 0\nElementType = MET_UCHAR\n";
    let data: Vec<u8> = (0..12).collect();
    let item = load_bytes("a.mha", &with(head, "LOCAL", &data)).expect("loads");
    assert_eq!(series(&item).times_secs(), [0.0, 0.25, 0.5], "steps of a quarter second");
    assert_eq!(series(&item).steps()[2].value(1, 0, 0), 9.0, "the third step");
}

#[test]
fn wide_integers_are_kept_as_narrow_ones_where_they_fit() {
    let head = HEAD.replace("MET_SHORT", "MET_LONG_LONG");
    let data = |last: i64| (0..23_i64).chain([last]).flat_map(i64::to_le_bytes).collect::<Vec<u8>>();
    let item = load_bytes("a.mha", &with(&head, "LOCAL", &data(-5))).expect("loads");
    assert_eq!((volume(&item).value(3, 2, 1), volume(&item).samples().kind()), (-5.0, "i32"), "fits");
    let item = load_bytes("a.mha", &with(&head, "LOCAL", &data(1 << 40))).expect("loads");
    assert_eq!(volume(&item).samples().kind(), "f64", "does not fit");
    assert_eq!(codes(&item), ["volume.wide-integers"], "noted");
}

#[test]
fn damaged_headers_never_panic() {
    let good = with(HEAD, "LOCAL", &counted());
    let (_folder, path) = file("a.mha", &good);
    survives(&good, |bytes| {
        std::fs::write(&path, bytes).expect("written");
        read(&path, &Limits { decoded_bytes: 1 << 16, files: 1 }, &Silent)
    });
}
