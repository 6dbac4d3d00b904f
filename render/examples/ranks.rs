//! Several processes against threads: `mpirun -n 4 target/debug/examples/ranks WHAT`.
//!
//! `same` draws a made grid from several views, with all processes and with threads, and compares the bytes. `killed`,
//! `panics` and `refuses` do the same, but the last process is killed, breaks down or is sent nonsense in the middle of a
//! picture: then there has to be an error, and no picture. `long` sends messages longer than a piece.

use std::process::{Command, ExitCode};
use std::sync::Arc;

use render::cells::mpi::MpiLink;
use render::cells::{CellPicture, CellRenderer, Group, Link, LinkError, Options, Spread};
use render::scene::{Camera, CellItem, Projection};
use render::volume::cells::{CellGrid, CellKind, Field, Part, Place, Scalar, Step, Values};
use render::volume::{Affine, ControlPoint, Point, Transfer, Vector};

const SIZE: [u32; 2] = [160, 120];

fn main() -> ExitCode {
    let what = std::env::args().nth(1).unwrap_or_default();
    match run(&what) {
        Ok(said) => {
            print(&said);
            ExitCode::SUCCESS
        }
        Err(fault) => {
            print(&format!("error: {fault}"));
            ExitCode::FAILURE
        }
    }
}

#[expect(clippy::print_stdout, reason = "what a program for people to run is for")]
fn print(line: &str) {
    if !line.is_empty() {
        println!("{line}");
    }
}

fn run(what: &str) -> Result<String, Box<dyn std::error::Error>> {
    let mut link = MpiLink::begin()?;
    if what == "long" {
        return Ok(long(&mut link)?);
    }
    let last = link.rank() > 0 && link.rank() + 1 == link.size();
    let link = Ailing { link, what: if last { what } else { "" }.to_owned(), letters: 0 };
    let Some(mut group) = Group::join(link)? else { return Ok(String::new()) };
    let item = item()?;
    let mut known = CellRenderer::new();
    let mut bytes = Vec::new();
    for (eye, spread) in [([60.0, -50.0, 40.0], Spread::Columns), ([-30.0, 70.0, 20.0], Spread::Blocks)] {
        let camera = camera(eye);
        for balance in [true, false] {
            let options = Options { spread, balance, keep_segments: true, ..Options::default() };
            let all = |_: usize, _: usize| true;
            let picture = group.render(&item, &camera, SIZE, &options, &all)?;
            let by_threads = known.render(&item, &camera, SIZE, &options, &all)?;
            compare(&picture, &by_threads)?;
            bytes.push(picture.stats.total.bytes);
        }
    }
    Ok(format!("{} processes: the same bytes; sent {bytes:?}", group.size()))
}

fn compare(one: &CellPicture, other: &CellPicture) -> Result<(), String> {
    if one.image.pixels.iter().filter(|p| p[3] > 0.0).count() < 1000 {
        return Err("there is no picture".to_owned());
    }
    if one.image != other.image || one.segments != other.segments {
        return Err("processes and threads give different pictures".to_owned());
    }
    Ok(())
}

/// Messages longer than a piece, from all to all at once.
fn long(link: &mut MpiLink) -> Result<String, LinkError> {
    let (me, size) = (link.rank(), link.size());
    let made = |from: usize, to: usize| {
        (0..20_000_000 + 9_000_000 * from).map(|i| (i * 7 + 31 * from + to) as u8).collect::<Vec<_>>()
    };
    for to in (0..size).filter(|&to| to != me) {
        link.send(to, made(me, to))?;
        link.send(to, vec![1])?;
    }
    let mut short = 0;
    let mut came = vec![false; size];
    while short + 1 < size {
        match link.poll()? {
            Some((from, message)) if message.len() == 1 && came[from] => short += 1,
            Some((from, message)) if message == made(from, me) => came[from] = true,
            Some((from, _)) => return Err(LinkError::Message { rank: from }),
            None => link.wait()?,
        }
    }
    Ok(format!("process {me} has all"))
}

/// A link whose process comes to grief after some letters of a picture.
#[derive(Debug)]
struct Ailing {
    link: MpiLink,
    what: String,
    letters: usize,
}

impl Link for Ailing {
    fn rank(&self) -> usize {
        self.link.rank()
    }

    fn size(&self) -> usize {
        self.link.size()
    }

    fn send(&mut self, to: usize, message: Vec<u8>) -> Result<(), LinkError> {
        self.link.send(to, message)
    }

    #[expect(clippy::panic, reason = "this is about programs that break down")]
    fn poll(&mut self) -> Result<Option<(usize, Vec<u8>)>, LinkError> {
        let found = self.link.poll()?;
        self.letters += usize::from(found.is_some());
        if self.letters == 12 {
            match self.what.as_str() {
                "killed" => {
                    // What the system does to a program that takes too much memory.
                    let id = std::process::id().to_string();
                    drop(Command::new("kill").args(["-KILL", &id]).status());
                }
                "panics" => panic!("as it was told to"),
                "refuses" => return Ok(found.map(|(from, message)| (from, spoiled(message)))),
                _ => {}
            }
        }
        Ok(found)
    }

    fn wait(&mut self) -> Result<(), LinkError> {
        self.link.wait()
    }
}

/// A message that cannot be read.
fn spoiled(mut message: Vec<u8>) -> Vec<u8> {
    message[0] = 99;
    message
}

/// A box of tetrahedra, without order inside.
fn item() -> Result<CellItem, Box<dyn std::error::Error>> {
    let side = 24_u32;
    let number = |at: [u32; 3]| at[0] + (side + 1) * (at[1] + (side + 1) * at[2]);
    let place = |n: u32| [n % (side + 1), n / (side + 1) % (side + 1), n / (side + 1) / (side + 1)];
    let shake =
        |n: u32, axis: u32| f64::from((n * 3 + axis).wrapping_mul(2_654_435_761) >> 8) / f64::from(1 << 24);
    let points: Vec<Point> = (0..(side + 1).pow(3))
        .map(|n| {
            let [x, y, z] = place(n).map(f64::from);
            Point::new(x + 0.3 * shake(n, 0), y + 0.3 * shake(n, 1), z + 0.3 * shake(n, 2))
        })
        .collect();
    let mut corners = Vec::new();
    for cell in 0..side.pow(3) {
        for order in [[0, 1, 2], [1, 2, 0], [2, 0, 1], [0, 2, 1], [2, 1, 0], [1, 0, 2]] {
            let mut at = [cell % side, cell / side % side, cell / side / side];
            corners.push(number(at));
            for axis in order {
                at[axis] += 1;
                corners.push(number(at));
            }
        }
    }
    let values = (0..points.len() as u32).map(|n| (n as f32 * 0.1).sin()).collect();
    let field = Field::new("s".to_owned(), 1, Values::F32(values));
    let step = Step { time: 0.0, point_fields: vec![field], cell_fields: Vec::new() };
    let kinds = vec![CellKind::Tetra; corners.len() / 4];
    let grid = CellGrid::new(points, kinds, corners, vec![step])?;
    let point = |value, rgba| ControlPoint { value, rgba };
    let transfer =
        vec![point(-1.0, [0.1, 0.2, 0.9, 0.0]), point(0.2, [0.9, 0.4, 0.1, 0.2]), point(1.0, [1.0; 4])];
    Ok(CellItem {
        grid: Arc::new(grid),
        step: 0,
        scalar: Scalar { place: Place::Points, name: "s".to_owned(), part: Part::Component(0) },
        pose: Affine::identity(),
        transfer: Arc::new(Transfer::new(transfer, 3.0)?),
    })
}

fn camera(eye: [f64; 3]) -> Camera {
    Camera {
        eye: Point::from(eye),
        target: Point::from([12.0; 3]),
        up: Vector::new(0.0, 0.0, 1.0),
        projection: Projection::Perspective { fov_rad: 0.6 },
    }
}
