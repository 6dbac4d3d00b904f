//! NRRD headers as people and programs write them.

use super::super::nrrd::read;
use super::*;

const HEAD: &str = "NRRD0004\n# a comment\ntype: short\ndimension: 3\nspace: left-posterior-superior\n\
    sizes: 4 3 2\nspace directions: (0.95533648912560598,0.29552020666133955,0) \
    (-0.59104041332267909,1.910672978251212,0) (0,0,3)\nkinds: domain domain domain\nendian: little\n\
    space origin: (10,20,30)\n";

fn with(head: &str, encoding: &str, data: &[u8]) -> Vec<u8> {
    [format!("{head}encoding: {encoding}\n\n").as_bytes(), data].concat()
}

#[test]
fn raw_packed_text_and_detached_data_are_one_volume() {
    let raw = load_bytes("a.nrrd", &with(HEAD, "raw", &counted())).expect("loads");
    let grid = volume(&raw);
    assert_near(world(grid, [3.0, 2.0, 1.0]), TURNED, "as SimpleITK wrote it");
    assert_eq!((grid.value(3, 2, 1), codes(&raw)), (23.0, vec![]), "nothing departs");
    let packed = load_bytes("a.nrrd", &with(HEAD, "gzip", &gzip(&counted()))).expect("loads");
    assert_eq!(volume(&packed), grid, "gzip");
    let words: Vec<String> = (0..24).map(|i| i.to_string()).collect();
    let text = load_bytes("a.nrrd", &with(HEAD, "ascii", words.join(" ").as_bytes())).expect("loads");
    assert_eq!(volume(&text), grid, "text");
    let head = format!("{HEAD}data file: a.raw\nbyte skip: -1\n");
    let (folder, path) = file("a.nhdr", &with(&head, "raw", &[]));
    std::fs::write(folder.path().join("a.raw"), [b"something before".to_vec(), counted()].concat())
        .expect("written");
    assert_eq!(volume(&only(load(&path).expect("loads"))), grid, "the last bytes of another file");
}

#[test]
fn other_spaces_are_turned_to_lps() {
    for (space, signs) in [
        ("right-anterior-superior", [-1.0, -1.0, 1.0]),
        ("LAS", [1.0, -1.0, 1.0]),
        ("RAST", [-1.0, -1.0, 1.0]),
    ] {
        let head = HEAD.replace("left-posterior-superior", space);
        let item = load_bytes("a.nrrd", &with(&head, "raw", &counted())).expect("loads");
        let expected = [0, 1, 2].map(|i| TURNED[i] * signs[i]);
        assert_near(world(volume(&item), [3.0, 2.0, 1.0]), expected, space);
    }
    let head = "NRRD0004\ntype: uchar\ndimension: 3\nsizes: 4 3 2\nspacings: 1 2 3\n";
    let item = load_bytes("a.nrrd", &with(head, "raw", &[9; 24])).expect("loads");
    assert_eq!(volume(&item).spacing_mm(), [1.0, 2.0, 3.0], "spacings alone");
    assert_eq!(codes(&item), ["nrrd.no-orientation"], "noted");
}

#[test]
fn a_list_axis_first_or_last_is_time() {
    let axis = "space directions: (1,0,0) (0,1,0) (0,0,1)";
    let head = |directions: &str, sizes: &str, kinds: &str| {
        format!(
            "NRRD0005\ntype: uchar\ndimension: 4\nspace: LPS\nsizes: {sizes}\nspace directions: {directions}\n\
             kinds: {kinds}\nspace origin: (0,0,0)\n"
        )
    };
    let data: Vec<u8> = (0..12).collect();
    let plain = axis.trim_start_matches("space directions: ");
    let first = head(&format!("none {plain}"), "2 3 2 1", "list domain domain domain");
    let item = load_bytes("a.nrrd", &with(&first, "raw", &data)).expect("loads");
    assert_eq!(series(&item).steps()[1].value(1, 1, 0), 9.0, "step 1 of voxel 4: byte 2 · 4 + 1");
    let last = head(&format!("{plain} none"), "3 2 1 2", "domain domain domain list");
    let item = load_bytes("a.nrrd", &with(&last, "raw", &data)).expect("loads");
    assert_eq!(series(&item).steps()[1].value(1, 1, 0), 10.0, "byte 6 + 4");
    assert_eq!(codes(&item), ["volume.time-guessed"], "a list has no times");
    let colours = first.replace("list", "RGB-color");
    let error = load_bytes("a.nrrd", &with(&colours, "raw", &data)).expect_err("colours");
    assert!(matches!(error, LoadError::Unsupported { .. }), "{error}");
}

#[test]
fn damaged_headers_never_panic() {
    let good = with(HEAD, "raw", &counted());
    let (_folder, path) = file("a.nrrd", &good);
    survives(&good, |bytes| {
        std::fs::write(&path, bytes).expect("written");
        read(&path, &Limits { decoded_bytes: 1 << 16, files: 1 }, &Silent)
    });
}
