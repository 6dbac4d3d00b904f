//! The same bytes however it is done; early termination within its bound; workers that fail.

use super::*;
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};

/// Of several blocks.
const SIZE: [u32; 2] = [100, 90];

fn scene(n: usize) -> (CellItem, Camera) {
    let mesh = lattice(n, 0.3, 3);
    let mut dice = Dice::new(8);
    let noise: Vec<f64> = mesh.0.iter().map(|_| dice.next()).collect();
    let side = n as f64;
    let camera =
        looks([side * 1.6, -side, side * 1.3], [side / 2.0; 3], Projection::Perspective { fov_rad: 0.8 });
    (item(&grid(&mesh, |i, _| noise[i]), varied(0.3)), camera)
}

/// As dense as bone, so that early termination has something to do.
fn dense(n: usize) -> (CellItem, Camera) {
    let (mut item, camera) = scene(n);
    item.transfer = Arc::new(transfer(&[[0.0, 0.1, 0.3, 0.9, 0.5], [1.0, 0.9, 0.7, 0.1, 0.9]], 0.6));
    (item, camera)
}

fn workers(count: usize, engine: Engine) -> Options {
    Options { workers: Some(count), engine, keep_segments: true, ..Options::default() }
}

#[test]
fn any_number_of_workers_and_either_engine_give_the_same_bytes() {
    let (item, camera) = scene(10);
    let known = draw(&item, &camera, SIZE, &workers(1, Engine::Threads));
    assert!(known.image.pixels.iter().filter(|p| p[3] > 0.0).count() > 500, "there is a picture");
    for engine in [Engine::Blocks, Engine::Threads, Engine::Simulated] {
        for count in [1, 2, 3, 4, 5, 8] {
            for (balance, spread) in
                [(false, Spread::Columns), (true, Spread::Columns), (true, Spread::Blocks)]
            {
                let options = Options { spread, balance, ..workers(count, engine) };
                let picture = draw(&item, &camera, SIZE, &options);
                assert!(picture.image == known.image, "{engine:?}, {count} workers: another picture");
                assert!(picture.segments == known.segments, "{engine:?}, {count} workers: other segments");
                assert_eq!(picture.stats.workers.len(), count, "each is counted");
                let [found, all] = [&picture.stats.total, &known.stats.total];
                assert_eq!(found.segments, all.segments, "the same work");
                if engine != Engine::Blocks {
                    assert_eq!(found.clusters, all.clusters, "each cluster once");
                }
            }
        }
    }
}

#[test]
fn pictures_of_several_tiles_are_the_same_bytes() {
    let size = [300, 170];
    let (item, camera) = scene(6);
    let blocks = draw(&item, &camera, size, &workers(2, Engine::Blocks));
    for count in [1, 3] {
        let picture = draw(&item, &camera, size, &workers(count, Engine::Threads));
        assert_eq!(picture.image.pixels, blocks.image.pixels, "{count} workers");
        assert_eq!(picture.segments, blocks.segments, "{count} workers");
    }
    let (item, camera) = dense(6);
    let whole = draw(&item, &camera, size, &workers(2, Engine::Blocks));
    for engine in [Engine::Blocks, Engine::Threads, Engine::Simulated] {
        let options = Options { early: Some(Early::default()), ..workers(3, engine) };
        let picture = draw(&item, &camera, size, &options);
        let off = picture.image.difference(&whole.image, [0.0; 3]).expect("same size").max;
        assert!(off <= 1.0, "{engine:?}: off by {off} of 1/255");
    }
}

#[test]
fn either_kind_of_instructions_gives_the_same_bytes() {
    let (item, camera) = scene(6);
    // Straight on, many faces are seen exactly from aside; inside, cells reach behind the eye.
    let straight = looks([3.0, -9.0, 3.0], [3.0; 3], Projection::Parallel { height_mm: 8.0 });
    let inside = looks([3.1, 2.9, 3.2], [5.0, 4.0, 3.0], Projection::Perspective { fov_rad: 1.5 });
    let still = grid(&lattice(6, 0.0, 3), |_, p| p.x / 6.0);
    for item in [item.clone(), CellItem { grid: still, ..item }] {
        for camera in [camera, straight, inside] {
            let wide = draw(&item, &camera, SIZE, &workers(1, Engine::Blocks));
            assert!(wide.image.pixels.iter().filter(|p| p[3] > 0.0).count() > 500, "there is a picture");
            let plain = draw(&item, &camera, SIZE, &Options { wide: false, ..workers(1, Engine::Blocks) });
            assert!(wide.image == plain.image && wide.segments == plain.segments, "AVX2 and without");
        }
    }
}

#[test]
fn any_order_of_cells_and_corners_gives_the_same_bytes() {
    let (first, camera) = scene(8);
    let known = draw(&first, &camera, SIZE, &workers(2, Engine::Threads));
    let mut cells: Vec<Vec<u32>> = (0..first.grid.len()).map(|c| first.grid.cell(c).1.to_vec()).collect();
    let mut dice = Dice::new(99);
    for round in 0..3 {
        for i in (1..cells.len()).rev() {
            cells.swap(i, (dice.next() * (i + 1) as f64) as usize);
            // An even permutation keeps the cell as it is.
            cells[i].rotate_left(1);
            cells[i].swap(0, 1);
        }
        let steps = first.grid.steps().to_vec();
        let kinds = vec![CellKind::Tetra; cells.len()];
        let grid = CellGrid::new(first.grid.points().to_vec(), kinds, cells.concat(), steps).expect("a grid");
        let other = CellItem { grid: Arc::new(grid), ..first.clone() };
        let picture = draw(&other, &camera, SIZE, &workers(2, Engine::Threads));
        assert!(picture.image == known.image && picture.segments == known.segments, "round {round}");
        assert_eq!(picture.stats.faults, known.stats.faults, "none turned round");
    }
}

#[test]
fn leaving_out_what_is_clear_changes_nothing_and_is_counted() {
    let (mut item, camera) = scene(8);
    let points: Mesh = (
        item.grid.points().to_vec(),
        (0..item.grid.len())
            .map(|c| {
                let (_, corners) = item.grid.cell(c);
                [corners[0], corners[1], corners[2], corners[3]]
            })
            .collect(),
    );
    item.grid = grid(&points, |_, p| p.x / 8.0);
    item.transfer = Arc::new(transfer(&[[0.5, 0.9, 0.1, 0.2, 0.0], [1.0, 0.1, 0.5, 0.9, 0.8]], 1.0));
    let with = draw(&item, &camera, SIZE, &workers(2, Engine::Threads));
    let without = draw(&item, &camera, SIZE, &Options { skip_clear: false, ..workers(2, Engine::Threads) });
    let off = with.image.difference(&without.image, [0.0; 3]).expect("same size").max;
    assert!(off < 0.01, "the same picture: {off}");
    assert!(with.stats.total.clear > 0, "some cells are clear");
    assert!(with.stats.total.scanned < without.stats.total.scanned, "and cost nothing");
    for stats in [&with.stats, &without.stats] {
        let t = &stats.total;
        assert_eq!(t.outside + t.clear + t.hidden + t.not_finite + t.scanned, stats.tetrahedra, "each once");
    }
}

#[test]
fn early_termination_stays_within_its_bound_and_saves_work() {
    let (item, camera) = dense(16);
    let whole = draw(&item, &camera, SIZE, &workers(2, Engine::Threads));
    for (threshold, most) in [(0.9, 0.8), (1.0 - 1.0 / 256.0, 0.9)] {
        for share in [false, true] {
            let ways =
                [(1, Engine::Threads), (2, Engine::Threads), (8, Engine::Simulated), (2, Engine::Blocks)];
            for (count, engine) in ways {
                let early = Some(Early { threshold, ..Early::default() });
                let options = Options { early, share, ..workers(count, engine) };
                let picture = draw(&item, &camera, SIZE, &options);
                let mut off = 0.0_f64;
                for (a, b) in picture.image.pixels.iter().zip(&whole.image.pixels) {
                    for c in 0..4 {
                        off = off.max(f64::from((a[c] - b[c]).abs()));
                    }
                }
                assert!(off <= 0.5 * (1.0 - threshold) + 1e-5, "{threshold}, {count} workers: off by {off}");
                let [some, all] = [picture.stats.total.scanned, whole.stats.total.scanned].map(|n| n as f64);
                if count == 1 {
                    assert!(some < most * all, "{threshold}: {some} of {all} cells scan-converted");
                    assert!(off > 0.0, "something was left out");
                }
                let t = &picture.stats.total;
                let sum = t.outside + t.clear + t.hidden + t.not_finite + t.scanned;
                if engine == Engine::Blocks {
                    assert!(sum >= picture.stats.tetrahedra, "each cell once in each block");
                    assert!(t.hidden > 0 && off > 0.0, "something was left out");
                } else {
                    assert_eq!(sum, picture.stats.tetrahedra, "each cell once");
                }
            }
        }
    }
}

#[test]
fn within_large_clusters_early_termination_looks_at_what_is_not_finished() {
    let (item, camera) = dense(40);
    let whole = draw(&item, &camera, SIZE, &workers(2, Engine::Blocks));
    let mut before = 0;
    for threshold in [0.9999, 1.0 - 1.0 / 256.0, 0.9, 0.6, 0.2] {
        let options =
            Options { early: Some(Early { threshold, ..Early::default() }), ..workers(2, Engine::Blocks) };
        let picture = draw(&item, &camera, SIZE, &options);
        let pairs = picture.image.pixels.iter().flatten().zip(whole.image.pixels.iter().flatten());
        let off = pairs.fold(0.0, |off: f64, (a, b)| off.max(f64::from((a - b).abs())));
        assert!(off <= 0.5 * (1.0 - threshold) + 1e-5, "{threshold}: off by {off}");
        let hidden = picture.stats.total.hidden;
        assert!(hidden > before, "{threshold}: {hidden} cells hidden, {before} by one that is nearer to 1");
        before = hidden;
    }
}

#[test]
fn clusters_of_many_sizes_are_dealt_out_by_their_cells() {
    let (item, camera) = dense(23);
    let options = Options { balance: false, ..workers(8, Engine::Simulated) };
    let dealt = draw(&item, &camera, [96, 90], &options).stats.imbalance();
    assert!(dealt < 1.12, "by their number it would be 1.2: {dealt}");
}

#[test]
fn work_is_shared_out_evenly_and_termination_is_shared() {
    let (item, camera) = dense(22);
    let early = Some(Early::default());
    let draw = |balance, share, early| {
        let spread = Spread::Blocks;
        let options = Options { early, spread, balance, share, ..workers(8, Engine::Simulated) };
        draw(&item, &camera, [96, 90], &options).stats
    };
    let [base, balanced] = [draw(false, false, None), draw(true, false, None)];
    assert!(balanced.imbalance() < 1.1, "balanced: {}", balanced.imbalance());
    assert!(balanced.imbalance() <= base.imbalance(), "and no worse than without: {}", base.imbalance());
    assert!(balanced.total.taken > 0 && base.total.taken == 0, "by taking over clusters");
    let [alone, shared] = [draw(true, false, early), draw(true, true, early)];
    assert!(shared.total.scanned < alone.total.scanned, "what others know saves cells");
    assert!(alone.total.scanned <= base.total.scanned, "so does what one knows oneself");
    let columns = Options { early, ..workers(8, Engine::Simulated) };
    let columns = super::draw(&item, &camera, [96, 90], &columns).stats;
    assert!(
        columns.total.scanned < shared.total.scanned,
        "columns of the picture save more than blocks of the grid"
    );
    assert!(shared.subscreens > 1, "subscreens of the size of cells: {}", shared.subscreens);
}

/// A link of channels, as between processes.
struct Channels {
    rank: usize,
    to: Vec<SyncSender<(usize, Vec<u8>)>>,
    from: Receiver<(usize, Vec<u8>)>,
    held: Option<(usize, Vec<u8>)>,
    /// Breaks down after so many messages.
    lasts: usize,
}

impl Channels {
    fn group(count: usize, lasts: usize) -> Vec<Self> {
        let (to, from): (Vec<_>, Vec<_>) = (0..count).map(|_| sync_channel(1 << 16)).unzip();
        let link = |(rank, from)| Self {
            rank,
            to: to.clone(),
            from,
            held: None,
            lasts: if rank == 1 { lasts } else { usize::MAX },
        };
        from.into_iter().enumerate().map(link).collect()
    }
}

impl Link for Channels {
    fn rank(&self) -> usize {
        self.rank
    }

    fn size(&self) -> usize {
        self.to.len()
    }

    fn send(&mut self, to: usize, message: Vec<u8>) -> Result<(), LinkError> {
        self.lasts = self.lasts.checked_sub(1).ok_or(LinkError::Lost { rank: self.rank })?;
        self.to[to].send((self.rank, message)).map_err(|_gone| LinkError::Lost { rank: to })
    }

    fn poll(&mut self) -> Result<Option<(usize, Vec<u8>)>, LinkError> {
        Ok(self.held.take().or_else(|| self.from.try_recv().ok()))
    }

    fn wait(&mut self) -> Result<(), LinkError> {
        // The others hear from the first that it is over.
        let wait = std::time::Duration::from_secs(if self.rank == 0 { 2 } else { 60 });
        self.held = Some(self.from.recv_timeout(wait).map_err(|_none| LinkError::Lost { rank: 1 })?);
        Ok(())
    }
}

/// Loses its first message.
struct Forgetful(Channels, bool);

impl Link for Forgetful {
    fn rank(&self) -> usize {
        self.0.rank()
    }

    fn size(&self) -> usize {
        self.0.size()
    }

    fn send(&mut self, to: usize, message: Vec<u8>) -> Result<(), LinkError> {
        self.0.send(to, message)
    }

    fn poll(&mut self) -> Result<Option<(usize, Vec<u8>)>, LinkError> {
        let found = self.0.poll()?;
        Ok(if found.is_some() && std::mem::take(&mut self.1) { None } else { found })
    }

    fn wait(&mut self) -> Result<(), LinkError> {
        self.0.wait()
    }
}

/// What becomes of each process of a group: the first does something, and the others serve.
fn group<T: Send>(
    count: usize,
    lasts: usize,
    first: impl FnOnce(&mut Group<Channels>) -> T + Send,
) -> (T, Vec<Result<(), CellsError>>) {
    std::thread::scope(|scope| {
        let mut links = Channels::group(count, lasts).into_iter();
        let link = links.next().expect("the first");
        let others: Vec<_> = links
            .map(|link| {
                scope.spawn(move || Group::join(link).map(|group| assert!(group.is_none(), "serves")))
            })
            .collect();
        let mut group = Group::join(link).expect("no error").expect("the first");
        let result = first(&mut group);
        drop(group);
        (result, others.into_iter().map(|other| other.join().expect("no panic")).collect())
    })
}

fn keeping() -> Options {
    Options { keep_segments: true, ..Options::default() }
}

/// What a group draws.
fn drawn(
    group: &mut Group<Channels>,
    item: &CellItem,
    camera: &Camera,
    options: &Options,
) -> Result<CellPicture, CellsError> {
    group.render(item, camera, SIZE, options, &|_, _| true)
}

#[test]
fn processes_that_have_only_their_part_give_the_same_bytes() {
    let (item, camera) = scene(6);
    let known = draw(&item, &camera, SIZE, &workers(1, Engine::Threads));
    for count in [1, 2, 3, 4, 6, 8] {
        for (spread, balance) in [(Spread::Columns, true), (Spread::Blocks, true), (Spread::Blocks, false)] {
            let options = Options { spread, balance, ..keeping() };
            let (picture, others) = group(count, usize::MAX, |group| drawn(group, &item, &camera, &options));
            let picture = picture.expect("a picture");
            assert!(picture.image == known.image && picture.segments == known.segments, "{count} processes");
            assert!(others.iter().all(Result::is_ok), "all end well: {others:?}");
            let all = picture.stats.tetrahedra;
            let held: Vec<u64> = picture.stats.workers.iter().map(|w| w.held).collect();
            assert_eq!(held[0], all, "the first has all");
            if count > 2 && !balance {
                assert!(held[1..].iter().sum::<u64>() < all, "the others have their parts: {held:?}");
            }
            assert_eq!(picture.stats.total.clusters, known.stats.total.clusters, "each cluster once");
            assert_eq!(picture.stats.total.cell_bytes > 0, count > 1, "cells are sent");
        }
    }
}

#[test]
fn other_views_scalars_and_grids_follow_each_other_and_only_what_is_lacking_is_sent() {
    let (first, camera) = scene(6);
    let (second, _) = scene(5);
    let values = |place, n: usize| (place, (0..n).map(|i| (i % 7) as f64 / 7.0).collect::<Vec<_>>());
    let (_, of_cells) = values(Place::Cells, first.grid.len());
    let mut step = first.grid.steps()[0].clone();
    step.cell_fields = vec![Field::new("s".to_owned(), 1, Values::F64(of_cells))];
    let grid = Arc::new((*first.grid).clone().with_steps(vec![step]).expect("a grid"));
    let first = CellItem { grid, ..first };
    let cells = CellItem { scalar: on(Place::Cells), ..first.clone() };
    let aside = looks([-9.0, 2.0, 11.0], [3.0; 3], Projection::Parallel { height_mm: 9.0 });
    let blocks = Options { spread: Spread::Blocks, balance: false, ..keeping() };
    let (bytes, others) = group(4, usize::MAX, |group| {
        let mut bytes = Vec::new();
        for (item, camera, options) in [
            (&first, &camera, &blocks),
            (&first, &aside, &blocks),
            (&cells, &camera, &blocks),
            (&cells, &camera, &keeping()),
            (&first, &aside, &keeping()),
            (&second, &camera, &keeping()),
            (&first, &camera, &Options { early: Some(Early::default()), ..keeping() }),
            (&first, &camera, &keeping()),
        ] {
            let picture = drawn(group, item, camera, options).expect("a picture");
            if options.early.is_none() {
                let known = draw(item, camera, SIZE, &workers(1, Engine::Threads));
                assert!(picture.image == known.image && picture.segments == known.segments, "{options:?}");
            }
            bytes.push(picture.stats.total.cell_bytes);
        }
        bytes
    });
    assert!(others.iter().all(Result::is_ok), "all end well: {others:?}");
    assert!(bytes[0] > 0, "the grid is dealt out");
    assert_eq!(bytes[1], 0, "and not again for another view");
    assert!(bytes[2] > 0 && bytes[2] < bytes[0], "another scalar is less than the grid: {bytes:?}");
}

#[test]
fn a_picture_can_be_given_up_and_another_drawn() {
    let (item, camera) = scene(6);
    let known = draw(&item, &camera, SIZE, &workers(1, Engine::Threads));
    let ((), others) = group(4, usize::MAX, |group| {
        for round in 0..20 {
            let count = std::sync::atomic::AtomicUsize::new(0);
            let goes_on =
                |_: usize, _: usize| count.fetch_add(1, std::sync::atomic::Ordering::Relaxed) < round;
            let result = group.render(&item, &camera, SIZE, &keeping(), &goes_on);
            // The others may have taken so much of the first's work that it was asked less often.
            let stopped = count.into_inner() > round;
            let expected = stopped.then_some(CellsError::Cancelled);
            assert_eq!(result.err(), expected, "round {round}");
            assert!(stopped || round > 3, "it is asked");
            let wrong = CellItem { step: 7, ..item.clone() };
            assert!(
                matches!(drawn(group, &wrong, &camera, &keeping()), Err(CellsError::Step { .. })),
                "asked"
            );
        }
        let picture = drawn(group, &item, &camera, &keeping()).expect("a picture");
        assert!(picture.image == known.image && picture.segments == known.segments, "as if nothing had been");
    });
    assert!(others.iter().all(Result::is_ok), "all end well: {others:?}");
}

#[test]
fn a_worker_that_is_lost_is_an_error_and_no_hang() {
    let (item, camera) = scene(6);
    for lasts in [0, 1, 3, 8] {
        let (results, others) = group(4, lasts, |group| {
            [(); 2].map(|()| drawn(group, &item, &camera, &keeping()).map(|_picture| ()))
        });
        for result in &results {
            assert!(matches!(result, Err(CellsError::Link(_))), "no picture, but a clear end: {result:?}");
        }
        assert!(others[0].is_err(), "the one that fails knows it: {others:?}");
        let ended = |result: &Result<(), CellsError>| matches!(result, Ok(()) | Err(CellsError::Link(_)));
        assert!(others[1..].iter().all(ended), "the others end: {others:?}");
    }
}

#[test]
fn a_worker_that_fails_says_why() {
    let (item, camera) = scene(4);
    let mut links = Channels::group(2, usize::MAX).into_iter();
    let [first, second] = [links.next().expect("first"), links.next().expect("second")];
    let second = Forgetful(second, true);
    let (result, other) = std::thread::scope(|scope| {
        let other = scope.spawn(move || Group::join(second).map(|_none| ()));
        let mut group = Group::join(first).expect("no error").expect("the first");
        let result = drawn(&mut group, &item, &camera, &keeping());
        drop(group);
        (result, other.join().expect("no panic"))
    });
    let fault = LinkError::Message { rank: 0 };
    assert_eq!(other, Err(CellsError::Link(fault.clone())), "it knows");
    let failed = LinkError::Failed { rank: 1, fault: fault.to_string() };
    assert_eq!(result.err(), Some(CellsError::Link(failed)), "the first is told");
}
