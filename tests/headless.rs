//! The command line, as a process: what it prints, where, and with which exit code.

use std::path::Path;
use std::time::Duration;

use serde_json::{Value, json};

use crate::support::compare::{colours, difference, open_rgb};
use crate::support::program::{Outcome, run, run_as};
use crate::support::{cases, gpu_wanted};

/// Software rendering in a development build on a busy machine.
const LIMIT: Duration = Duration::from_mins(2);

fn osteotome(args: &[&str]) -> Outcome {
    run(args, LIMIT)
}

fn text(path: &Path) -> &str {
    path.to_str().expect("a temporary path is plain text")
}

fn assert_error(outcome: &Outcome, code: i32, names: &str) {
    assert_eq!(outcome.code(), code, "the exit code: {}{}", outcome.stdout, outcome.stderr);
    assert!(outcome.stdout.is_empty(), "an error is no result: {}", outcome.stdout);
    assert!(outcome.sentence().contains(names), "the error names {names}: {}", outcome.stderr);
    assert!(
        !outcome.stderr.contains("RUST_BACKTRACE"),
        "an error is a sentence, no trace: {}",
        outcome.stderr
    );
}

#[test]
fn help_and_version_are_asked_for_and_succeed() {
    let help = osteotome(&["--help"]);
    assert_eq!(help.code(), 0, "{}", help.stderr);
    for command in ["info", "render", "section", "compress", "bench", "demo"] {
        assert!(help.stdout.contains(command), "the help tells of {command}: {}", help.stdout);
    }
    let version = osteotome(&["--version"]);
    assert_eq!((version.code(), version.stdout.trim()), (0, "osteotome 0.1.0"), "the version");
}

#[test]
fn a_program_without_mpi_does_not_do_everything_as_often_as_there_are_processes() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("picture.png");
    let render = ["render", "no-such-case.json", "--out", text(&out)];
    let outcome = run_as(0, 4, &render, LIMIT);
    assert_error(&outcome, 2, "--features mpi");
    let outcome = run_as(0, 4, &["info", "no-such-file"], LIMIT);
    assert_error(&outcome, 2, "only render");
    // One says it for all.
    for args in [&render[..], &["info", "no-such-file"]] {
        let outcome = run_as(2, 4, args, LIMIT);
        assert_eq!((outcome.code(), outcome.stderr.as_str()), (0, ""), "{args:?}");
    }
    assert_error(&run_as(0, 1, &render, LIMIT), 3, "no-such-case.json");
    assert!(!out.exists(), "no picture");
}

#[test]
fn wrong_usage_is_exit_code_2() {
    for args in [
        &["render"][..],
        &["render", "case.json"],
        &["render", "case.json", "--out", "p.png", "--size", "wide"],
        &["render", "case.json", "--out", "p.png", "--size", "0x10"],
        &["render", "case.json", "--out", "p.png", "--backend", "abacus"],
        &["section", "case.json", "--out", "p.png", "--plane", "front"],
        &["section", "case.json", "--out", "p.png", "--at", "1,2"],
        &["info"],
        &["info", "--no-such-flag"],
    ] {
        let outcome = osteotome(args);
        assert_eq!(outcome.code(), 2, "{args:?}: {}{}", outcome.stdout, outcome.stderr);
        assert!(!outcome.stderr.trim().is_empty(), "{args:?} says what is wrong");
    }
}

#[test]
fn unusable_input_is_exit_code_3_and_one_sentence_that_names_the_file() {
    let folder = tempfile::tempdir().unwrap();
    let picture = folder.path().join("p.png");
    assert_error(&osteotome(&["info", "no_such_file.nrrd"]), 3, "no_such_file.nrrd");
    assert_error(
        &osteotome(&["render", "no_such_case.json", "--out", text(&picture)]),
        3,
        "no_such_case.json",
    );

    let good = cases::cut_ball(folder.path());
    for (names, at, value) in [
        ("gone.nrrd", "/volumes/0/source", json!("gone.nrrd")),
        ("case.json", "/osteotome", json!(99)),
        ("case.json", "/fragments/0/volume", json!("nobody")),
        ("case.json", "/fragments/0/keep", json!({"nothing": "+"})),
        ("case.json", "/cutters/0/plane/normal", json!([0, 0, 0])),
        ("case.json", "/volumes/0/transfer/unit_mm", json!(0)),
    ] {
        let mut case = good.clone();
        *case.pointer_mut(at).unwrap() = value;
        let path = cases::write_case(folder.path(), &case);
        let outcome = osteotome(&["render", text(&path), "--out", text(&picture), "--backend", "reference"]);
        assert_error(&outcome, 3, names);
        assert!(!picture.exists(), "no picture of a case broken at {at}");
    }
    std::fs::write(folder.path().join("case.json"), "{ \"osteotome\": 1,").unwrap();
    let cut = osteotome(&["render", text(&folder.path().join("case.json")), "--out", text(&picture)]);
    assert_error(&cut, 3, "case.json");
}

#[test]
fn a_picture_that_cannot_be_written_is_an_error() {
    let folder = tempfile::tempdir().unwrap();
    let case = cases::write_case(folder.path(), &cases::cut_ball(folder.path()));
    let nowhere = folder.path().join("no_such_folder").join("p.png");
    let size = ["--size", "16x16", "--backend", "reference"];
    let outcome = osteotome(&[&["render", text(&case), "--out", text(&nowhere)], &size[..]].concat());
    assert_error(&outcome, 1, "no_such_folder");
    let odd = folder.path().join("p.bmp");
    let outcome = osteotome(&[&["render", text(&case), "--out", text(&odd)], &size[..]].concat());
    assert_error(&outcome, 2, "p.bmp");
}

#[test]
fn a_homogeneous_slab_has_the_opacity_of_its_thickness() {
    let folder = tempfile::tempdir().unwrap();
    // 24 voxels of 1.5 mm are 36 mm, edge to edge; 3 % in each 2 mm.
    cases::write_nrrd(&folder.path().join("slab.nrrd"), [24; 3], 1.5, |_| 100);
    let case = json!({
        "osteotome": 1, "name": "slab",
        "volumes": [{"id": "v", "source": "slab.nrrd", "texture": "r32f", "transfer": {
            "points": [[0, 1, 0.5, 0.25, 0.03]], "unit_mm": 2.0}}],
        "camera": {"eye": [17.25, -100, 17.25], "target": [17.25, 17.25, 17.25], "up": [0, 0, 1], "parallel_mm": 60},
        "background": [0.25, 0.25, 0.25]
    });
    let case = cases::write_case(folder.path(), &case);
    let opacity = 1.0 - 0.97_f64.powf(18.0);
    let mut backends = vec!["reference"];
    if gpu_wanted() {
        backends.push("gpu");
    }
    for backend in backends {
        let picture = folder.path().join(format!("{backend}.exr"));
        let size = ["--size", "40x20", "--quality", "finest"];
        let args = ["render", text(&case), "--out", text(&picture), "--backend", backend];
        let outcome = osteotome(&[&args, &size[..]].concat());
        assert_eq!(outcome.code(), 0, "{backend}: {}", outcome.stderr);
        assert!(
            outcome.stdout.is_empty(),
            "without --stats nothing is on standard output: {}",
            outcome.stdout
        );
        let drawn = image::open(&picture).unwrap().to_rgba32f();
        assert_eq!(drawn.dimensions(), (40, 20), "{backend}: the size asked for");
        let middle = drawn.get_pixel(20, 10).0.map(f64::from);
        for (channel, full) in [1.0, 0.5, 0.25, 1.0].into_iter().enumerate() {
            let apart = (middle[channel] - full * opacity).abs();
            assert!(apart < 0.25 / 255.0, "{backend}: {middle:?} is premultiplied by {opacity}");
        }
        assert_eq!(drawn.get_pixel(1, 1).0, [0.0; 4], "{backend}: without background, nothing is nothing");
    }
}

#[test]
fn the_gpu_draws_a_cut_and_implanted_case_as_the_reference_does() {
    if !gpu_wanted() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let case = cases::write_case(folder.path(), &cases::cut_ball(folder.path()));
    let draw = |backend: &str| {
        let picture = folder.path().join(format!("{backend}.png"));
        let args = ["render", text(&case), "--out", text(&picture), "--backend", backend];
        let outcome =
            osteotome(&[&args[..], &["--size", "128x96", "--quality", "finest", "--stats"]].concat());
        let stats = outcome.json();
        assert!(stats.is_object(), "{backend}: the statistics are one object: {stats}");
        open_rgb(&picture)
    };
    let (gpu, reference) = (draw("gpu"), draw("reference"));
    assert_eq!(gpu.dimensions(), (128, 96), "the size asked for");
    assert!(colours(&reference) > 200, "a picture of something: {} colours", colours(&reference));
    let (psnr, largest) = difference(&gpu, &reference);
    assert!(psnr >= 45.0 && largest <= 8, "the two agree: PSNR {psnr:.1} dB, largest {largest}/255");
}

#[test]
fn every_texture_draws_and_the_lossy_ones_say_so() {
    if !gpu_wanted() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let mut case = cases::cut_ball(folder.path());
    let mut first = None;
    for (texture, lossy) in [("r16", false), ("r32f", false), ("bc4", true), ("rgba8", true), ("bc3", true)] {
        case["volumes"][0]["texture"] = json!(texture);
        let path = cases::write_case(folder.path(), &case);
        let picture = folder.path().join(format!("{texture}.png"));
        let args = [
            "render",
            text(&path),
            "--out",
            text(&picture),
            "--size",
            "96x72",
            "--stats",
            "--backend",
            "gpu",
        ];
        let stats = osteotome(&args).json();
        let drawn = open_rgb(&picture);
        let textures = stats["textures"].as_array().unwrap_or_else(|| panic!("{texture}: {stats}"));
        assert!(!textures.is_empty(), "{texture}: {stats}");
        for made in textures {
            assert_eq!(made["format"], texture, "the texture asked for: {stats}");
            assert_eq!(made["lossy"], lossy, "{texture}: {stats}");
        }
        let said = stats["statement"].as_str().unwrap_or_default();
        assert_eq!(said.contains(texture), lossy, "what is lossy is said: {stats}");
        let (psnr, _) = difference(first.get_or_insert_with(|| drawn.clone()), &drawn);
        assert!(psnr > 28.0, "{texture} draws the same thing: PSNR {psnr:.1} dB");
    }
}

#[test]
fn moving_the_whole_case_by_a_kilometre_changes_nothing() {
    if !gpu_wanted() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let near = cases::cut_ball(folder.path());
    let by = [1.0e6, -1.0e6, 1.0e6];
    let mut far = near.clone();
    let shift = |point: &mut Value| {
        for (axis, by) in by.iter().enumerate() {
            point[axis] = json!(point[axis].as_f64().unwrap() + by);
        }
    };
    let moved = json!([1, 0, 0, by[0], 0, 1, 0, by[1], 0, 0, 1, by[2], 0, 0, 0, 1]);
    far["volumes"][0]["pose"] = moved.clone();
    far["implants"][0]["pose"] = moved;
    for point in ["/camera/eye", "/camera/target", "/cutters/0/plane/point"] {
        shift(far.pointer_mut(point).unwrap());
    }
    // The fragment's pose is about the world's origin: move there, turn, move back.
    let pose = |row: usize, column: usize| near["fragments"][0]["pose"][4 * row + column].as_f64().unwrap();
    for row in 0..3 {
        let turned: f64 = (0..3).map(|column| pose(row, column) * by[column]).sum();
        far["fragments"][0]["pose"][4 * row + 3] = json!(pose(row, 3) + by[row] - turned);
    }
    let draw = |case: &Value, name: &str| {
        let path = cases::write_case(folder.path(), case);
        let picture = folder.path().join(name);
        let outcome = osteotome(&["render", text(&path), "--out", text(&picture), "--size", "96x72"]);
        assert_eq!(outcome.code(), 0, "{name}: {}", outcome.stderr);
        open_rgb(&picture)
    };
    let near = draw(&near, "near.png");
    assert!(colours(&near) > 200, "a picture of something");
    let (_, largest) = difference(&near, &draw(&far, "far.png"));
    assert!(largest <= 1, "the largest change of a channel is {largest}/255");
}

#[test]
fn the_demo_case_is_written_as_files_that_info_and_render_take() {
    let folder = tempfile::tempdir().unwrap();
    let demo = folder.path().join("demo");
    let outcome = osteotome(&["demo", text(&demo)]);
    assert_eq!(outcome.code(), 0, "{}", outcome.stderr);
    let case = demo.join("case.json");
    let document: Value = serde_json::from_str(&std::fs::read_to_string(&case).unwrap()).unwrap();
    assert_eq!(document["osteotome"], 1, "the case file's version");
    assert!(document["volumes"].as_array().unwrap().len() >= 2, "a CT and an MRI");
    assert!(!document["implants"].as_array().unwrap().is_empty(), "an implant");
    for source in ["volumes", "implants"].iter().flat_map(|list| document[*list].as_array().unwrap()) {
        let path = demo.join(source["source"].as_str().unwrap());
        let info = osteotome(&["info", text(&path), "--json"]);
        assert_eq!(info.code(), 0, "{}: {}", path.display(), info.stderr);
    }
    if gpu_wanted() {
        let picture = folder.path().join("p.png");
        let outcome = osteotome(&["render", text(&case), "--out", text(&picture), "--size", "128x128"]);
        assert_eq!(outcome.code(), 0, "{}", outcome.stderr);
        assert!(colours(&open_rgb(&picture)) > 500, "a picture of a hip, not of nothing");
    }
}

#[test]
fn keys_that_a_case_does_not_know_are_no_error() {
    let folder = tempfile::tempdir().unwrap();
    let mut case = cases::cut_ball(folder.path());
    case["from_the_future"] = json!({"landmarks": [1, 2, 3]});
    case["volumes"][0]["note"] = json!("kept");
    let path = cases::write_case(folder.path(), &case);
    let picture = folder.path().join("p.png");
    let args = ["render", text(&path), "--out", text(&picture), "--backend", "reference", "--size", "16x16"];
    let outcome = osteotome(&args);
    assert_eq!(outcome.code(), 0, "{}", outcome.stderr);
    assert_eq!(open_rgb(&picture).dimensions(), (16, 16), "the size asked for");
}

#[test]
fn a_compressed_volume_is_a_ktx2_file() {
    let folder = tempfile::tempdir().unwrap();
    let volume = folder.path().join("v.nrrd");
    cases::write_nrrd(&volume, [20, 12, 8], 1.0, |v| (v[0] * 50) as i16);
    let out = folder.path().join("v.ktx2");
    let outcome = osteotome(&["compress", text(&volume), "--format", "bc4", "--out", text(&out), "--stats"]);
    assert!(outcome.json().is_object(), "the statistics are one object");
    let bytes = std::fs::read(&out).unwrap();
    assert_eq!(bytes[..12], *b"\xABKTX 20\xBB\r\n\x1A\n", "the identifier of KTX 2.0");
    // Khronos KTX 2.0, 3: vkFormat, typeSize, pixelWidth, pixelHeight, pixelDepth as u32 from byte 12.
    let word = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap());
    assert_eq!([word(20), word(24), word(28)], [20, 12, 8], "the extent");
    assert!([139, 140].contains(&word(12)), "VK_FORMAT_BC4_UNORM_BLOCK or _SNORM_BLOCK: {}", word(12));
    let threads = |n: &str| {
        let out = folder.path().join(n);
        let args = ["compress", text(&volume), "--format", "bc4", "--out", text(&out), "--threads", n];
        assert_eq!(osteotome(&args).code(), 0, "{n} threads");
        std::fs::read(out).unwrap()
    };
    assert!(threads("1") == threads("4"), "the bytes do not depend on the number of threads");
}

/// Twelve numbered volumes of one frame: a bright box that moves along x.
fn numbered_volumes(folder: &Path) {
    for step in 0..12_u8 {
        let mut file =
            b"NRRD0004\ntype: uchar\ndimension: 3\nspace: left-posterior-superior\nsizes: 24 20 16\n\
            space directions: (2,0,0) (0,2,0) (0,0,3)\nspace origin: (-24,-20,-24)\nencoding: raw\n\n"
                .to_vec();
        let inside = |x: usize, y: usize, z: usize| {
            (4..14).contains(&x.saturating_sub(usize::from(step) / 2))
                && (5..15).contains(&y)
                && (4..12).contains(&z)
        };
        for i in 0..24 * 20 * 16 {
            let (x, y, z) = (i % 24, i / 24 % 20, i / 480);
            let mixed = (i as u32 + 7680 * u32::from(step)).wrapping_mul(0x9E37_79B9);
            let noise = (mixed ^ mixed >> 15).wrapping_mul(0x85EB_CA6B) >> 28;
            file.push(noise as u8 + if inside(x, y, z) { 200 } else { 20 + step });
        }
        std::fs::write(folder.join(format!("beat_{step:02}.nrrd")), file).expect("written");
    }
}

#[test]
fn numbered_volumes_become_a_series_file_that_states_its_error_and_is_drawn() {
    let folder = tempfile::tempdir().expect("folder");
    let volumes = folder.path().join("volumes");
    std::fs::create_dir(&volumes).expect("folder");
    numbered_volumes(&volumes);
    let series = folder.path().join("beat.series");
    let args = [
        "compress",
        text(&volumes),
        "--format",
        "pvtc",
        "--layout",
        "4,3",
        "--out",
        text(&series),
        "--stats",
    ];
    let made = osteotome(&args);
    assert_eq!(made.code(), 0, "{}", made.stderr);
    let stats: Value = serde_json::from_str(&made.stdout).expect("one JSON object");
    assert_eq!((&stats["steps"], &stats["codec"]), (&json!(12), &json!("pvtc <4,3>")), "{stats}");
    assert_eq!(stats["payload_bytes"], json!(4 * 6 * 5 * 4 * 20), "5/48 of the samples: known beforehand");
    let largest = stats["largest_value_error"].as_f64().expect("an error");
    assert!(largest > 0.0 && stats["psnr_db"].as_f64().is_some_and(|p| p > 25.0), "{stats}");

    let info = osteotome(&["info", text(&series), "--json"]);
    assert_eq!(info.code(), 0, "{}", info.stderr);
    let info: Value = serde_json::from_str(&info.stdout).expect("JSON");
    let item = &info["items"][0];
    assert_eq!((&item["kind"], &item["steps"]), (&json!("series"), &json!(12)), "{item}");
    assert_eq!(item["extent"], json!([24, 20, 16]), "{item}");
    assert_eq!(item["largest_error"].as_f64(), Some(largest), "the file states the error that was measured");

    if !gpu_wanted() {
        return;
    }
    let case = folder.path().join("case.json");
    let picture = |step: usize, backend: &str| {
        let document = json!({
            "osteotome": 1,
            "volumes": [{"id": "beat", "source": "beat.series", "step": step,
                "transfer": {"points": [[0, 0, 0, 0, 0], [100, 0.9, 0.5, 0.3, 0.0], [210, 1, 0.9, 0.8, 0.6]]}}],
            "camera": {"eye": [40, -160, 60], "target": [0, 0, 0], "up": [0, 0, 1], "fov_deg": 25},
        });
        std::fs::write(&case, document.to_string()).expect("written");
        let out = folder.path().join(format!("{backend}_{step}.png"));
        let args = ["render", text(&case), "--out", text(&out), "--size", "96x80", "--backend", backend];
        let drawn = osteotome(&[&args[..], &["--quality", "finest", "--stats"]].concat());
        assert_eq!(drawn.code(), 0, "{}", drawn.stderr);
        (open_rgb(&out), serde_json::from_str::<Value>(&drawn.stdout).expect("JSON"))
    };
    let (first, stats) = picture(0, "gpu");
    assert_eq!(
        stats["textures"][0]["format"],
        json!("pvtc<4,3>"),
        "drawn from its compressed bytes: {stats}"
    );
    let (last, _) = picture(11, "gpu");
    assert!(difference(&first, &last).1 > 40, "the box has moved");
    let (truth, _) = picture(11, "reference");
    assert!(difference(&last, &truth).1 <= 4, "as the reference draws the decoded samples");
}

#[test]
fn a_goal_chooses_the_codecs_of_a_series() {
    let folder = tempfile::tempdir().expect("folder");
    numbered_volumes(folder.path());
    let series = folder.path().join("chosen.out");
    let chosen = |goal: &str| -> Value {
        let args = ["compress", text(folder.path()), "--format", "series", "--goal", goal];
        let made = osteotome(&[&args[..], &["--out", text(&series), "--stats"]].concat());
        assert_eq!(made.code(), 0, "{}", made.stderr);
        serde_json::from_str(&made.stdout).expect("one JSON object")
    };
    let fine = chosen("psnr=45");
    assert!(fine["psnr_db"].as_f64().is_none_or(|p| p >= 44.5), "{fine}");
    let small = chosen("mib=0.01");
    let bytes = |stats: &Value| stats["file_bytes"].as_f64().expect("bytes");
    // The header, the index and the times are beside what is compressed.
    assert!(bytes(&small) <= 0.01 * 1048576.0 + 1200.0, "{small}");
    assert!(bytes(&small) < bytes(&fine), "a smaller file: {small} {fine}");
    let wrong = osteotome(&["compress", "x", "--format", "series", "--goal", "soon", "--out", text(&series)]);
    assert_eq!(wrong.code(), 2, "no goal: {}", wrong.stderr);
}

#[test]
fn a_damaged_series_file_is_named_with_its_fault() {
    let folder = tempfile::tempdir().expect("folder");
    numbered_volumes(folder.path());
    let series = folder.path().join("beat.series");
    let made = osteotome(&["compress", text(folder.path()), "--format", "pvtc-te", "--out", text(&series)]);
    assert_eq!(made.code(), 0, "{}", made.stderr);
    let whole = std::fs::read(&series).expect("read");
    let cut = folder.path().join("cut.series");
    std::fs::write(&cut, &whole[..whole.len() / 2]).expect("written");
    assert_error(&osteotome(&["info", text(&cut)]), 3, "cut.series");
    let mut flipped = whole;
    flipped[600] ^= 0x10;
    let broken = folder.path().join("flipped.series");
    std::fs::write(&broken, flipped).expect("written");
    let picture = folder.path().join("p.png");
    assert_error(&osteotome(&["render", text(&broken), "--out", text(&picture)]), 3, "flipped.series");
    assert!(!picture.exists(), "a damaged step is no picture");
}

#[test]
fn a_section_shows_volumes_labels_and_the_lines_of_moved_fragments() {
    let folder = tempfile::tempdir().unwrap();
    // Values rise by 10 a voxel of 2 mm along x; labels of 4 mm along z.
    cases::write_nrrd(&folder.path().join("ramp.nrrd"), [40, 20, 20], 2.0, |[x, _, _]| x as i16 * 10);
    cases::write_nrrd(&folder.path().join("labels.nrrd"), [20, 10, 10], 4.0, |[_, _, z]| i16::from(z == 2));
    let transfer = json!({"points": [[0, 1, 1, 1, 0.1]]});
    let case = json!({
        "osteotome": 1, "name": "sections",
        "volumes": [{"id": "v", "source": "ramp.nrrd", "transfer": transfer}],
        "cutters": [{"id": "c", "plane": {"point": [39.5, 0, 0], "normal": [1, 0, 0]}}],
        "fragments": [{"id": "l", "volume": "v", "keep": {"c": "-"}},
            {"id": "r", "volume": "v", "keep": {"c": "+"}, "pose": [1,0,0,40, 0,1,0,0, 0,0,1,0, 0,0,0,1]}],
        "labels": [{"id": "s", "volume": "v", "source": "labels.nrrd", "colors": {"1": [1, 0, 0, 1]}}]
    });
    let case = cases::write_case(folder.path(), &case);
    let section = |args: &[&str]| {
        let picture = folder.path().join("s.png");
        let outcome = osteotome(
            &[
                &["section", text(&case), "--out", text(&picture), "--size", "120x40", "--mm-per-pixel", "1"],
                args,
            ]
            .concat(),
        );
        assert_eq!(outcome.code(), 0, "{args:?}: {}", outcome.stderr);
        open_rgb(&picture)
    };
    // Pixel (i, j) is at x = i - 10 + 0.5 and, seen from the front, z = 39.5 - j.
    let front = section(&["--plane", "coronal", "--at", "50,19,20"]);
    let at = |x: u32, z: u32| front.get_pixel(x + 10, 39 - z).0;
    let grey = at(20, 30)[0];
    assert!(at(20, 30) == [grey; 3] && at(30, 30)[0] > grey, "it rises to the left: {:?}", at(30, 30));
    assert_eq!(at(45, 30), [0, 0, 0], "the gap where the right part was");
    assert!(at(85, 30)[0] > at(30, 30)[0], "and there it is, brighter still: {:?}", at(85, 30));
    assert_eq!((at(20, 8), at(100, 8)), ([255, 0, 0], [255, 0, 0]), "the label on both parts");
    let cutter = [236, 112, 208];
    assert_eq!((at(39, 20), at(79, 20)), (cutter, cutter), "the cutter at each part");
    // A slab across x: the mean over 20 mm is the middle's value, MIP that 10 mm on.
    let across = ["--plane", "sagittal", "--at", "20,19,30"];
    let middle = |more: &[&str]| section(&[&across[..], more].concat()).get_pixel(60, 20).0[0];
    let thin = middle(&[]);
    assert!(middle(&["--thickness", "20"]).abs_diff(thin) <= 1, "the mean of what rises evenly");
    let brighter = middle(&["--thickness", "20", "--mode", "mip"]) - thin;
    let darker = thin - middle(&["--thickness", "20", "--mode", "minip"]);
    assert!(brighter > 10 && brighter.abs_diff(darker) <= 1, "as much either way: {brighter}, {darker}");
    // Obliquely along x = y the ramp is still there, and longer.
    let oblique = section(&["--plane", "-1,1,0", "--at", "20,19,30"]);
    assert!(colours(&oblique) > 10, "an oblique section");
}

#[test]
fn a_section_shows_a_grid_where_its_fragment_went_in_the_colours_of_its_scalar() {
    let folder = tempfile::tempdir().unwrap();
    cases::write_nrrd(&folder.path().join("flat.nrrd"), [40, 20, 20], 2.0, |_| 1000);
    // A hexahedron of 0.02 m along each axis, whose scalar rises from 0 to 10 along x.
    let corner = |i: usize| [[0, 0], [1, 0], [1, 1], [0, 1]][i % 4].map(|n| f64::from(n) * 0.02);
    let points: Vec<String> = (0..8)
        .map(|i| format!("{} {} {}", corner(i)[0], corner(i)[1], if i < 4 { 0.0 } else { 0.02 }))
        .collect();
    let text_of = format!(
        "# vtk DataFile Version 3.0\nmade\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS 8 double\n{}\nCELLS 1 9\n\
         8 0 1 2 3 4 5 6 7\nCELL_TYPES 1\n12\nPOINT_DATA 8\nSCALARS load double 1\nLOOKUP_TABLE default\n\
         0 10 10 0 0 10 10 0\n",
        points.join("\n")
    );
    std::fs::write(folder.path().join("load.vtk"), text_of).unwrap();
    let case = json!({
        "osteotome": 1, "name": "simulated",
        "volumes": [{"id": "v", "source": "flat.nrrd", "blend": 0, "transfer": {"points": [[0, 1, 1, 1, 0.1]]}}],
        "fragments": [{"id": "f", "volume": "v", "keep": {}, "pose": [1,0,0,0, 0,1,0,0, 0,0,1,30, 0,0,0,1]}],
        "grids": [{"id": "g", "source": "load.vtk", "scale": 1000, "fragment": "f",
            "transfer": {"points": [[2.5, 0, 1, 0, 0], [2.5, 0, 1, 0, 0.5], [10, 1, 0, 0, 0.5]]}}]
    });
    let case = cases::write_case(folder.path(), &case);
    let picture = folder.path().join("s.png");
    let place = ["--plane", "coronal", "--at", "20,10,40", "--size", "40x40", "--mm-per-pixel", "1"];
    let arguments = [&["section", text(&case), "--out", text(&picture)][..], &place].concat();
    let outcome = osteotome(&arguments);
    assert_eq!(outcome.code(), 0, "{}", outcome.stderr);
    let picture = open_rgb(&picture);
    // Pixel (i, j) is at x = i + 0.5 and z = 59.5 - j; the grid lies from x = 0 to 20 and from z = 30 to 50.
    let at = |x: u32, z: u32| picture.get_pixel(x, 59 - z).0;
    assert_eq!(at(4, 40), [0, 0, 0], "clear below 2.5");
    let [red, green, blue] = at(12, 40);
    // x = 12.5 has 6.25, half way from green to red.
    assert!(
        red.abs_diff(128) <= 1 && green.abs_diff(128) <= 1 && blue == 0,
        "half way: {red} {green} {blue}"
    );
    assert!(at(19, 49)[0] > 240 && at(19, 31)[0] > 240, "as high as the fragment went");
    assert_eq!((at(21, 40), at(12, 51), at(12, 29)), ([0; 3], [0; 3], [0; 3]), "nothing beside it");
}
