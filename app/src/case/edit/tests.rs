//! Every change: what it does, and what it refuses.

use super::*;
use crate::case::grids::FieldChoice;
use crate::case::{Case, Source, labels};
use render::volume::{ControlPoint, Vector};

fn volume(id: &str) -> Box<Volume> {
    let point = ControlPoint { value: 0.0, rgba: [0.0; 4] };
    let transfer = Arc::new(Transfer::new(vec![point], 1.0).expect("transfer"));
    Box::new(Volume::new(id, Source::Builtin("hip/ct".to_owned()), transfer))
}

fn plane(id: &str, x: f64, normal: [f64; 3]) -> NamedCutter {
    NamedCutter::new(id, Cutter::plane(Point::new(x, 0.0, 0.0), Vector::from(normal)).expect("plane"))
}

/// A volume and three planes, x = 0, y = 0 and x = 99.
fn planned() -> Case {
    let mut case = Case::default();
    for edit in [
        Edit::AddVolume(volume("ct")),
        Edit::AddCutter(plane("x", 0.0, [1.0, 0.0, 0.0])),
        Edit::AddCutter(plane("y", 0.0, [0.0, 1.0, 0.0])),
        Edit::AddCutter(plane("far", 99.0, [1.0, 0.0, 0.0])),
        Edit::AddImplant(Box::new(Implant::new("stem", Source::Builtin("hip/stem".to_owned())))),
    ] {
        apply(&mut case, edit).expect("planned");
    }
    case
}

fn corners() -> [Point; 8] {
    std::array::from_fn(|c| {
        Point::from(std::array::from_fn(|axis| if c >> axis & 1 == 1 { 10.0 } else { -10.0 }))
    })
}

fn split(case: &mut Case, cutters: &[&str]) -> Result<(), EditError> {
    let cutters = cutters.iter().map(|&c| c.to_owned()).collect();
    apply(case, Edit::Split { volume: "ct".to_owned(), cutters, corners: corners() })
}

fn fused(case: &mut Case, ids: &[&str]) -> Result<(), EditError> {
    let ids = ids.iter().map(|&id| id.to_owned()).collect();
    apply(case, Edit::Fuse { ids, corners: corners() })
}

/// The id of the fragment that keeps these sides, in the order of the cutters' names.
fn id_of(case: &Case, sides: &str) -> String {
    let text = |f: &Fragment| f.keep.values().map(|s| if *s == Side::Plus { '+' } else { '-' }).collect();
    case.fragments
        .iter()
        .find(|f| -> bool {
            let t: String = text(f);
            t == sides
        })
        .expect("a fragment")
        .id
        .clone()
}

#[test]
fn a_split_makes_every_piece_that_is_not_empty() {
    let mut case = planned();
    split(&mut case, &["x", "y", "far"]).expect("split");
    assert_eq!(case.fragments.len(), 4, "far cuts nothing off");
    for p in [[3.0, 4.0, 5.0], [-3.0, 4.0, 5.0], [0.0, -1.0, 2.0], [-9.0, -9.0, -9.0]] {
        let at = Point::from(p);
        let holds = |f: &&Fragment| case.piece(f).keep.iter().all(|(c, s)| c.keeps(*s, &at));
        assert_eq!(case.fragments.iter().filter(holds).count(), 1, "{p:?} is in one piece");
    }
}

#[test]
fn a_split_keeps_what_was_planned() {
    let mut case = planned();
    split(&mut case, &["x"]).expect("split");
    let (moved, kept) = (id_of(&case, "+"), id_of(&case, "-"));
    let pose = Affine::translation(Vector::new(5.0, 0.0, 0.0));
    apply(&mut case, Edit::SetFragmentPose { id: moved.clone(), pose }).expect("moved");
    split(&mut case, &["x"]).expect("again");
    assert_eq!(case.fragment(&moved).expect("same id").pose, pose, "the same split changes nothing");
    split(&mut case, &["x", "y"]).expect("finer");
    assert_eq!(case.fragments.len(), 4, "four");
    for f in &case.fragments {
        let of_moved = f.keep.get("x") == Some(&Side::Plus);
        assert_eq!(f.pose == pose, of_moved, "parts of {moved} are where it was, parts of {kept} not");
    }
    let ids: std::collections::BTreeSet<&str> = case.fragments.iter().map(|f| f.id.as_str()).collect();
    assert_eq!(ids.len(), 4, "ids are unique");
}

#[test]
fn a_split_by_nothing_or_by_too_much_is_refused() {
    let mut case = planned();
    assert!(matches!(split(&mut case, &[]), Err(EditError::Split(split::SplitError::NoCutter))), "none");
    assert!(matches!(split(&mut case, &["z"]), Err(EditError::Missing { kind: "cutter", .. })), "unknown");
    assert_eq!(case, planned(), "nothing happened");
}

#[test]
fn neighbours_fuse_and_diagonals_do_not() {
    let mut case = planned();
    split(&mut case, &["x", "y"]).expect("split");
    let (pp, pm, mm) = (id_of(&case, "++"), id_of(&case, "+-"), id_of(&case, "--"));
    let before = case.clone();
    assert!(matches!(fused(&mut case, &[&pp, &mm]), Err(EditError::Fuse { .. })), "diagonal");
    assert!(matches!(fused(&mut case, &[&pp, &pm, &mm]), Err(EditError::Fuse { .. })), "an L");
    assert!(matches!(fused(&mut case, &[&pp]), Err(EditError::Fuse { .. })), "one");
    assert_eq!(case, before, "nothing happened");
    fused(&mut case, &[&pp, &pm]).expect("neighbours");
    let keep = &case.fragment(&pp).expect("the first stays").keep;
    assert_eq!(keep.iter().collect::<Vec<_>>(), [(&"x".to_owned(), &Side::Plus)], "y no longer cuts");
    assert_eq!(case.fragments.len(), 3, "one fewer");
}

#[test]
fn all_pieces_fuse_to_the_whole() {
    let mut case = planned();
    split(&mut case, &["far", "x", "y"]).expect("split");
    let ids: Vec<String> = case.fragments.iter().map(|f| f.id.clone()).collect();
    fused(&mut case, &ids.iter().map(String::as_str).collect::<Vec<_>>()).expect("all of them");
    assert_eq!(case.fragments.len(), 1, "one");
    let keep = &case.fragments[0].keep;
    assert!(keep.keys().all(|id| id == "far"), "no cut through the volume is left: {keep:?}");
}

/// A place of the volume is, before and after, in the piece that the cut's side says, where it is now.
#[test]
fn a_fragment_is_split_where_it_was_moved_to() {
    let mut case = planned();
    split(&mut case, &["x"]).expect("split");
    let id = id_of(&case, "+");
    let pose = Affine::rotation_about(Point::new(3.0, 1.0, 0.0), Vector::z(), 1.5)
        * Affine::translation(Vector::new(40.0, 0.0, 0.0));
    apply(&mut case, Edit::SetFragmentPose { id: id.clone(), pose }).expect("moved");
    let now = pose.point(&Point::new(5.0, 1.0, 2.0));
    let dome = Cutter::dome(now, 3.0).and_then(|c| c.with_kerf(0.5)).expect("dome");
    apply(&mut case, Edit::AddCutter(NamedCutter::new("dome", dome))).expect("cutter");
    let cut =
        |id: &str| Edit::SplitFragment { id: id.to_owned(), cutter: "dome".to_owned(), corners: corners() };
    let before = case.clone();
    apply(&mut case, cut(&id)).expect("split where it is");
    assert_eq!(case.fragments.len(), 3, "two in the place of one");
    assert!(
        case.fragment(&id).is_none() && case.cutters.len() == before.cutters.len() + 1,
        "by its own cutter"
    );
    let parts: Vec<_> = case.fragments.iter().filter(|f| f.pose == pose).collect();
    let (mut inside, mut outside, mut taken) = (0, 0, 0);
    for i in 0..1000 {
        let unmoved = Point::new(f64::from(i % 10), f64::from(i / 10 % 10) - 4.5, f64::from(i / 100) - 4.5)
            + Vector::x() * 0.3;
        let holds = |f: &Fragment| case.piece(f).keep.iter().all(|(c, s)| c.keeps(*s, &unmoved));
        let known = dome.side(&pose.point(&unmoved));
        let found = [holds(parts[0]), holds(parts[1])];
        let expected = [known == Some(Side::Plus), known == Some(Side::Minus)];
        assert_eq!(found, expected, "{unmoved}");
        outside += usize::from(found[0]);
        inside += usize::from(found[1]);
        taken += usize::from(known.is_none());
    }
    assert!(inside > 20 && outside > 500 && taken > 5, "{inside} {outside} {taken}");
    let other = id_of(&before, "-");
    let missed = apply(&mut case, cut(&other));
    assert!(
        matches!(missed, Err(EditError::Misses { .. })),
        "it is not where the other piece is: {missed:?}"
    );
}

#[test]
fn an_unmoved_fragment_is_split_by_the_cutter_itself() {
    let mut case = planned();
    split(&mut case, &["x"]).expect("split");
    let (id, cutters) = (id_of(&case, "-"), case.cutters.len());
    let cut = |id: String| Edit::SplitFragment { id, cutter: "y".to_owned(), corners: corners() };
    apply(&mut case, cut(id)).expect("split");
    assert_eq!((case.fragments.len(), case.cutters.len()), (3, cutters), "no other cutter is needed");
    let part = id_of(&case, "-+");
    assert!(
        matches!(apply(&mut case, cut(part.clone())), Err(EditError::Misses { .. })),
        "it is cut already"
    );
    let rest = id_of(&case, "--");
    fused(&mut case, &[&part, &rest]).expect("and back");
    assert_eq!(case.fragments.len(), 2, "as before");
}

#[test]
fn what_is_used_is_not_removed() {
    let mut case = planned();
    split(&mut case, &["x"]).expect("split");
    let cut = apply(&mut case, Edit::RemoveCutter { id: "x".to_owned() });
    assert!(matches!(cut, Err(EditError::InUse { kind: "cutter", .. })), "cutter");
    let gone = apply(&mut case, Edit::RemoveVolume { id: "ct".to_owned() });
    assert!(matches!(gone, Err(EditError::InUse { kind: "volume", .. })), "volume");
    let (one, other) = (id_of(&case, "+"), id_of(&case, "-"));
    apply(&mut case, Edit::RemoveFragment { id: one }).expect("one piece may go");
    let last = apply(&mut case, Edit::RemoveFragment { id: other });
    assert!(matches!(last, Err(EditError::LastFragment { .. })), "the last would show the whole");
    apply(&mut case, Edit::Unsplit { volume: "ct".to_owned() }).expect("whole");
    apply(&mut case, Edit::RemoveCutter { id: "x".to_owned() }).expect("cutter is free");
    apply(&mut case, Edit::RemoveVolume { id: "ct".to_owned() }).expect("volume is free");
}

#[test]
fn a_rename_is_followed_everywhere() {
    let mut case = planned();
    split(&mut case, &["x"]).expect("split");
    let rename = |id: &str, to: &str| (id.to_owned(), to.to_owned());
    let (id, to) = rename("x", "neck");
    apply(&mut case, Edit::RenameCutter { id, to }).expect("cutter");
    let (id, to) = rename("ct", "hip");
    apply(&mut case, Edit::RenameVolume { id, to }).expect("volume");
    for f in &case.fragments {
        assert_eq!(f.volume, "hip", "volume");
        assert_eq!(f.keep.keys().collect::<Vec<_>>(), ["neck"], "cutter");
    }
    let (id, to) = rename("neck", "y");
    let taken = apply(&mut case, Edit::RenameCutter { id, to });
    assert!(matches!(taken, Err(EditError::Taken { .. })), "taken");
    let (id, to) = rename("stem", "");
    let nameless = apply(&mut case, Edit::RenameImplant { id, to });
    assert!(matches!(nameless, Err(EditError::Nameless { .. })), "empty");
}

#[test]
fn an_implant_keeps_sides_of_cutters_that_are_there() {
    let mut case = planned();
    let keep = |cutter: &str| Edit::SetImplantKeep {
        id: "stem".to_owned(),
        keep: BTreeMap::from([(cutter.to_owned(), Side::Minus)]),
    };
    let unknown = apply(&mut case, keep("z"));
    assert!(matches!(unknown, Err(EditError::Missing { kind: "cutter", .. })), "no such cutter");
    assert_eq!(case, planned(), "nothing happened");
    apply(&mut case, keep("x")).expect("cut");
    let used = apply(&mut case, Edit::RemoveCutter { id: "x".to_owned() });
    assert!(matches!(used, Err(EditError::InUse { user: "implant", .. })), "in use");
    apply(&mut case, Edit::RenameCutter { id: "x".to_owned(), to: "neck".to_owned() }).expect("renamed");
    assert_eq!(case.implants[0].keep.keys().collect::<Vec<_>>(), ["neck"], "the implant follows");
    apply(&mut case, Edit::SetImplantKeep { id: "stem".to_owned(), keep: BTreeMap::new() }).expect("whole");
    apply(&mut case, Edit::RemoveCutter { id: "neck".to_owned() }).expect("the cutter is free");
}

#[test]
fn numbers_out_of_range_are_refused() {
    let before = planned();
    let stem = || "stem".to_owned();
    let mut m = Affine::identity().to_row_major();
    m[0] = 2.0;
    let stretched = Affine::from_row_major(&m).expect("affine");
    for edit in [
        Edit::SetImplantOpacity { id: stem(), opacity: f64::NAN },
        Edit::SetImplantOpacity { id: stem(), opacity: 1.1 },
        Edit::SetImplantColor { id: stem(), color: [0.0, -0.1, 0.0] },
        Edit::SetImplantScale { id: stem(), scale: 0.0 },
        Edit::SetImplantScale { id: stem(), scale: f64::INFINITY },
        Edit::SetImplantPose { id: stem(), pose: stretched },
        Edit::SetVolumePose { id: "ct".to_owned(), pose: stretched },
        Edit::SetBackground([0.0, 0.0, 2.0]),
        Edit::AddVolume(volume("ct")),
        Edit::AddVolume(volume("")),
        Edit::AddFragment(Fragment::new("f", "no", BTreeMap::new())),
        Edit::AddFragment(Fragment::new("f", "ct", BTreeMap::from([("no".to_owned(), Side::Plus)]))),
    ] {
        let mut case = before.clone();
        assert!(apply(&mut case, edit.clone()).is_err(), "{edit:?} was accepted");
        assert_eq!(case, before, "{edit:?} left something");
    }
}

#[test]
fn only_changes_of_one_property_of_one_thing_are_one_drag() {
    let pose = |id: &str| Edit::SetImplantPose { id: id.to_owned(), pose: Affine::identity() };
    let opacity = Edit::SetImplantOpacity { id: "a".to_owned(), opacity: 0.5 };
    assert!(pose("a").continues(&pose("a")), "one drag");
    assert!(!pose("a").continues(&pose("b")), "another thing");
    assert!(!pose("a").continues(&opacity), "another property");
    let remove = Edit::RemoveCutter { id: "a".to_owned() };
    assert!(!remove.continues(&remove.clone()), "removing is a step of its own");
}

#[test]
fn labels_follow_their_volume_and_go_with_it() {
    let mut case = planned();
    apply(&mut case, Edit::AddVolume(volume("seg"))).expect("another volume");
    apply(&mut case, Edit::MakeLabels { id: "seg".to_owned(), volume: "ct".to_owned() }).expect("labels");
    assert_eq!((case.volumes.len(), case.labels.len()), (1, 1), "the volume has become a label set");
    assert_eq!(case.labels[0].source.as_ref(), Some(&case.volumes[0].source), "of the same data");
    let own = apply(&mut case, Edit::MakeLabels { id: "ct".to_owned(), volume: "ct".to_owned() });
    assert!(matches!(own, Err(EditError::OwnLabels { .. })), "{own:?}");
    apply(&mut case, Edit::RenameVolume { id: "ct".to_owned(), to: "hip".to_owned() }).expect("renamed");
    assert_eq!(case.labels[0].volume, "hip", "they follow");
    let change = |change| Edit::ChangeLabels { id: "seg".to_owned(), change };
    let color = [0.1, 0.2, 0.3, 0.4];
    apply(&mut case, change(LabelChange::Color { label: 3, color })).expect("a colour");
    assert_eq!(case.labels[0].color(3), color, "chosen");
    assert_eq!(case.labels[0].color(4), render::volume::default_color(4), "not chosen");
    let wrong = apply(&mut case, change(LabelChange::Color { label: 3, color: [0.0, 0.0, 1.5, 0.0] }));
    assert!(matches!(wrong, Err(EditError::Range { .. })), "{wrong:?}");
    let paint = || change(LabelChange::Paint(labels::Bricks::new()));
    let tint = |label| change(LabelChange::Color { label, color });
    assert!(paint().continues(&paint()) && tint(1).continues(&tint(1)), "one drag, one step");
    assert!(!tint(1).continues(&tint(2)) && !paint().continues(&tint(1)), "different things");
    apply(&mut case, Edit::RemoveVolume { id: "hip".to_owned() }).expect("removed");
    assert!(case.labels.is_empty(), "they go with it");
}

#[test]
fn a_blend_and_a_mode_are_checked() {
    let mut case = planned();
    let blend = |blend| Edit::SetBlend { id: "ct".to_owned(), blend };
    apply(&mut case, blend(0.25)).expect("a blend");
    assert!(matches!(apply(&mut case, blend(f64::NAN)), Err(EditError::Range { .. })), "not a number");
    let iso = |value, opacity| {
        let mode = VolumeMode::Isosurface { value, opacity };
        Edit::SetVolumeMode { id: "ct".to_owned(), mode }
    };
    apply(&mut case, iso(300.0, 0.5)).expect("a mode");
    for (value, opacity) in [(f64::INFINITY, 1.0), (0.0, -0.1)] {
        assert!(matches!(apply(&mut case, iso(value, opacity)), Err(EditError::Range { .. })), "{value}");
    }
    let kept = (case.volumes[0].blend, case.volumes[0].mode);
    assert_eq!(kept, (0.25, VolumeMode::Isosurface { value: 300.0, opacity: 0.5 }), "the last good ones");
}

#[test]
fn a_grid_rides_on_a_fragment_as_long_as_there_is_one() {
    let mut case = planned();
    split(&mut case, &["x"]).expect("two fragments");
    let ride = |on: &str| {
        let change = GridChange::Fragment(Some(on.to_owned()));
        Edit::ChangeGrid { id: "stress".to_owned(), change }
    };
    apply(
        &mut case,
        Edit::AddGrid(Box::new(UnstructuredGrid::new("stress", Source::Builtin("s".to_owned())))),
    )
    .expect("a grid");
    let before = case.clone();
    let missing = apply(&mut case, ride("nobody"));
    assert!(matches!(missing, Err(EditError::Missing { kind: "fragment", .. })), "{missing:?}");
    assert_eq!(case, before, "as it was");
    let rides_on = |case: &Case| case.grids[0].fragment.clone();
    let first = case.fragments[0].id.clone();
    apply(&mut case, ride(&first)).expect("rides");
    apply(&mut case, Edit::RenameFragment { id: first, to: "x".to_owned() }).expect("renamed");
    assert_eq!(rides_on(&case).as_deref(), Some("x"), "it follows the name");
    let halved = Edit::SplitFragment { id: "x".to_owned(), cutter: "y".to_owned(), corners: corners() };
    apply(&mut case, halved).expect("two halves");
    assert_eq!(rides_on(&case).as_deref(), Some("x-1"), "it stays with a half");
    split(&mut case, &["x"]).expect("as before the halves");
    assert_eq!(rides_on(&case), None, "no half is left");
    let first = case.fragments[0].id.clone();
    apply(&mut case, ride(&first)).expect("rides");
    split(&mut case, &["x", "y"]).expect("finer");
    let on = rides_on(&case).expect("a part of what it rode on");
    assert!(case.fragment(&on).is_some(), "that is there");
    let volume = case.fragments[0].volume.clone();
    apply(&mut case, Edit::Unsplit { volume }).expect("whole again");
    assert_eq!(rides_on(&case), None, "the fragment is gone");
    let change = |change| Edit::ChangeGrid { id: "stress".to_owned(), change };
    for (refused, what) in [
        (GridChange::Scale(0.0), "a scale of nothing"),
        (GridChange::Rename(String::new()), "no name"),
        (
            GridChange::Pose(Box::new(
                Affine::from_columns(Vector::x() * 2.0, Vector::y(), Vector::z(), Point::origin())
                    .expect("a matrix"),
            )),
            "a pose that scales",
        ),
    ] {
        let before = case.clone();
        assert!(apply(&mut case, change(refused)).is_err(), "{what}");
        assert_eq!(case, before, "as it was after {what}");
    }
    let scalar = FieldChoice { name: "p".to_owned(), place: None, part: None };
    apply(&mut case, change(GridChange::Unit("MPa".to_owned()))).expect("a unit");
    apply(&mut case, change(GridChange::Field(Some(scalar)))).expect("a field");
    assert_eq!(
        (case.grids[0].unit.as_str(), &case.grids[0].transfer),
        ("", &None),
        "another field has another unit"
    );
    apply(&mut case, change(GridChange::Remove)).expect("away");
    assert!(case.grids.is_empty(), "away");
}
