//! The arguments, and the way from them to a job and an exit code.
//!
//! Exit codes: 0 done; 2 wrong usage; 3 unusable input; 4 no usable GPU; 1 anything else. Results go to
//! standard output, everything else to standard error; an error is one sentence.

use std::ffi::OsString;
use std::io::Write as _;
use std::path::PathBuf;
use std::process::ExitCode;

use ::compress::bc::Level;
use ::compress::pvtc::Layout;
use clap::{Args, Parser, Subcommand, ValueEnum};

use crate::headless::{self, Failure, ranks};
use crate::host::HostError;
use crate::load::LoadError;
use crate::save::choice::Goal;

/// Surgical planning: volumes, cuts, fragments and implants, in a window or without one.
#[derive(Debug, Parser)]
#[command(name = "osteotome", version, args_conflicts_with_subcommands = true)]
pub struct Cli {
    /// What to do without a window.
    #[command(subcommand)]
    pub command: Option<Command>,
    /// A case, or data files and folders, to open in the window; none opens the built-in sample case.
    #[arg(value_name = "CASE|FILES")]
    pub paths: Vec<PathBuf>,
}

/// A job that needs no display.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Say what is in files, folders, archives or cases.
    Info(InfoArgs),
    /// Draw one picture of a case, or of a data file or folder.
    Render(RenderArgs),
    /// Draw a cross-section of a case, or of a data file or folder: thin or thick, along the body or oblique.
    Section(SectionArgs),
    /// Make a texture file (KTX2) of a volume.
    Compress(CompressArgs),
    /// Measure run time beside error; one JSON object a line with --json.
    Bench(BenchArgs),
    /// Write the built-in sample case as files.
    Demo(DemoArgs),
}

/// Arguments of `info`.
#[derive(Debug, Args)]
pub struct InfoArgs {
    /// Files, folders, archives or cases.
    #[arg(required = true, value_name = "PATH")]
    pub paths: Vec<PathBuf>,
    /// Print one JSON document.
    #[arg(long)]
    pub json: bool,
}

/// Arguments of `render`.
#[derive(Debug, Args)]
pub struct RenderArgs {
    /// A case file, or a data file or folder.
    #[arg(value_name = "CASE")]
    pub input: PathBuf,
    /// The picture: .png (8-bit, over the background) or .exr (32-bit float RGBA, premultiplied).
    #[arg(long, value_name = "FILE")]
    pub out: PathBuf,
    /// Width and height in pixels.
    #[arg(long, value_name = "WxH", default_value = "768x768", value_parser = size)]
    pub size: [u32; 2],
    /// What draws it: the GPU, the processor, or the exact reference.
    #[arg(long, value_enum, default_value_t = Backend::Auto)]
    pub backend: Backend,
    /// How fine a ray is sampled.
    #[arg(long, value_enum, default_value_t = QualityName::Good)]
    pub quality: QualityName,
    /// Print one JSON object of figures.
    #[arg(long)]
    pub stats: bool,
}

/// Arguments of `section`.
#[derive(Debug, Args)]
pub struct SectionArgs {
    /// A case file, or a data file or folder.
    #[arg(value_name = "CASE")]
    pub input: PathBuf,
    /// The picture: .png.
    #[arg(long, value_name = "FILE")]
    pub out: PathBuf,
    /// axial, coronal, sagittal, or the direction of view as x,y,z (LPS).
    #[arg(long, value_name = "PLANE", default_value = "axial", value_parser = plane, allow_hyphen_values = true)]
    pub plane: PlaneName,
    /// The place in the middle of the picture, x,y,z in mm (LPS); the middle of what is shown if not given.
    #[arg(long, value_name = "X,Y,Z", value_parser = triple, allow_hyphen_values = true)]
    pub at: Option<[f64; 3]>,
    /// Thickness of the slab; mm.
    #[arg(long, value_name = "MM", default_value_t = 0.0)]
    pub thickness: f64,
    /// What is shown of the values over the thickness.
    #[arg(long, value_enum, default_value_t = SlabName::Mean)]
    pub mode: SlabName,
    /// Width and height in pixels.
    #[arg(long, value_name = "WxH", default_value = "768x768", value_parser = size)]
    pub size: [u32; 2],
    /// Length of a pixel's side; everything fits if not given.
    #[arg(long, value_name = "MM")]
    pub mm_per_pixel: Option<f64>,
}

/// The direction of a cross-section.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum PlaneName {
    /// Across the body, seen from the feet.
    Axial,
    /// From the front.
    Coronal,
    /// From the patient's left.
    Sagittal,
    /// Along a direction of view; LPS.
    Along([f64; 3]),
}

/// What a slab shows.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum SlabName {
    /// The mean.
    Mean,
    /// The greatest value.
    Mip,
    /// The least value.
    #[value(name = "minip")]
    MinIp,
}

/// What draws a picture.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Backend {
    /// The GPU; where the machine has none, the processor, unless the case asks for a texture that loses something.
    Auto,
    /// The wgpu renderer.
    Gpu,
    /// The processor alone, from the samples as they are.
    Cpu,
    /// The reference: exact, on all CPU cores.
    Reference,
}

/// How fine a ray is sampled.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum QualityName {
    /// While the hand moves.
    Draft,
    /// One voxel.
    Good,
    /// As fine as it gets.
    Finest,
}

/// Arguments of `compress`.
#[derive(Debug, Args)]
pub struct CompressArgs {
    /// A data file or folder, or a case, whose first visible volume is taken.
    #[arg(value_name = "IN")]
    pub input: PathBuf,
    /// The format of the texture, or of the series.
    #[arg(long, value_enum)]
    pub format: Format,
    /// The KTX2 file of a texture, or the .series file of a volume over time.
    #[arg(long, value_name = "FILE")]
    pub out: PathBuf,
    /// For blocks: how much is tried.
    #[arg(long, value_enum, default_value_t = LevelName::Best)]
    pub level: LevelName,
    /// For pvtc: slices of a sub-volume (1, 2, 4, 8) and steps together (1 to 4).
    #[arg(long, value_name = "S,T", value_parser = layout, default_value = "4,2")]
    pub layout: Layout,
    /// For pvtc, pvtc-te and pvtc-se: how end points and indices are chosen.
    #[arg(long, value_enum, default_value_t = EncoderName::Fitted)]
    pub encoder: EncoderName,
    /// For a series: what packs the bytes once more, without loss.
    #[arg(long, value_enum, default_value_t = SecondStage::Zstd)]
    pub second: SecondStage,
    /// For series: psnr=DB, mib=MEBIBYTES or fps=STEPS.
    #[arg(long, value_name = "GOAL", value_parser = goal, default_value = "psnr=40")]
    pub goal: Goal,
    /// For series: reading from the disk that it is to play from, MB a second.
    #[arg(long, value_name = "MB", default_value_t = 500.0)]
    pub disk: f64,
    /// Threads used; all cores if not given. The bytes do not depend on it.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: Option<u16>,
    /// For colour formats: the transfer function, by name; else the case's own, or CT-Bone for CT and
    /// MR-Default for all else.
    #[arg(long, value_name = "NAME")]
    pub preset: Option<String>,
    /// Print one JSON object of figures.
    #[arg(long)]
    pub stats: bool,
}

/// How much an encoder of blocks tries.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum LevelName {
    /// What costs little.
    Fast,
    /// All that helps.
    Best,
}

impl LevelName {
    /// The encoder's level.
    pub fn of_encoder(self) -> Level {
        match self {
            Self::Fast => Level::Fast,
            Self::Best => Level::Best,
        }
    }
}

/// How PVTC chooses end points and indices. The bytes are as many.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum EncoderName {
    /// As in the papers: largest and smallest value.
    MinMax,
    /// For the least squared error.
    Fitted,
}

/// The second, lossless stage of a series.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum SecondStage {
    /// Bytes as they are.
    None,
    /// LZO1X.
    Lzo,
    /// LZ4.
    Lz4,
    /// Zstandard.
    Zstd,
}

/// A format that `compress` writes: of a texture, or of a volume over time.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Format {
    /// Opaque pre-classified colour, 4 bits a voxel.
    Bc1,
    /// Pre-classified colour and opacity, 8 bits a voxel.
    Bc3,
    /// Scalar, 4 bits a voxel.
    Bc4,
    /// Pre-classified colour and opacity, 32 bits a voxel.
    Rgba8,
    /// Scalar, 8 bits a voxel.
    R8,
    /// Scalar, 16 bits a voxel.
    R16,
    /// Pre-classified colour and opacity, 8 bits a voxel, accurate.
    Bc7,
    /// Volume over time: whatever keeps to --goal, tried on some of its steps.
    Series,
    /// Volume over time: PVTC of a layout <S,T>.
    Pvtc,
    /// Volume over time: PVTC-TE, three steps in the channels of BC1.
    PvtcTe,
    /// Volume over time: PVTC-SE, three slices in the channels of BC1.
    PvtcSe,
    /// Volume over time: 8 bits a voxel.
    Raw8,
    /// Volume over time: 16 bits a voxel.
    Raw16,
}

/// Arguments of `bench`.
#[derive(Debug, Args)]
pub struct BenchArgs {
    /// Which benchmark.
    #[arg(value_enum, value_name = "NAME")]
    pub name: BenchName,
    /// The data: a case, file or folder; the built-in CT if not given.
    #[arg(long, value_name = "PATH")]
    pub data: Option<PathBuf>,
    /// Print one JSON object a line instead of a table.
    #[arg(long)]
    pub json: bool,
    /// Write SVG plots into this folder.
    #[arg(long, value_name = "DIR")]
    pub plot: Option<PathBuf>,
    /// For series and play: voxels along each axis for one of the data's, by interpolation.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u8).range(1..=8))]
    pub enlarge: u8,
    /// For pareto and cells: a command that draws the same in turn with ours, such as "python3 tests/peers/vtk/volume.py" or
    /// "python3 tests/peers/vtk/cells.py".
    #[arg(long, value_name = "COMMAND")]
    pub peer: Option<String>,
}

/// A benchmark.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum BenchName {
    /// Frame time and error of textures and slice spacings.
    Frame,
    /// Time and error of making textures, beside making uncompressed ones.
    Compress,
    /// Time and error of the codecs of a volume over time, with each second stage.
    Series,
    /// Volumes a second from a file that is in no cache, compressed and not.
    Play,
    /// Observed order of error as spacing, grid and pixels are refined, on scenes of known pictures.
    Accuracy,
    /// Frame time against error over spacings, textures, terminations and renderers, with a peer's beside ours.
    Pareto,
    /// What skipping saves, on data: nothing skipped, a changed transfer function, a moved cut, seven ways to cut.
    Skips,
    /// Unstructured grids by cell projection: early termination, sharing and balancing, for 1 to 8 workers; with a peer, ours
    /// beside it instead.
    Cells,
}

/// Arguments of `demo`.
#[derive(Debug, Args)]
pub struct DemoArgs {
    /// The folder; made if it is not there.
    #[arg(value_name = "DIR")]
    pub folder: PathBuf,
}

/// Largest side of a picture; pixels.
pub const MAX_SIDE: u32 = 16_384;

/// `4,2`.
fn layout(text: &str) -> Result<Layout, String> {
    let wrong = || format!("\"{text}\" is no layout: write S,T as in 4,2");
    let (s, t) = text.split_once(',').ok_or_else(wrong)?;
    let number = |text: &str| text.trim().parse::<u8>().map_err(|_not_a_number| wrong());
    Layout::new(number(s)?, number(t)?).map_err(|e| e.to_string())
}

/// `psnr=40`.
fn goal(text: &str) -> Result<Goal, String> {
    let wrong = || format!("\"{text}\" is no goal: write psnr=40, mib=100 or fps=25");
    let (kind, number) = text.split_once('=').ok_or_else(wrong)?;
    let number: f64 = number.parse().map_err(|_not_a_number| wrong())?;
    if !(number.is_finite() && number > 0.0) {
        return Err(wrong());
    }
    match kind {
        "psnr" => Ok(Goal::Psnr(number)),
        "mib" => Ok(Goal::Bytes(number * f64::from(1 << 20))),
        "fps" => Ok(Goal::Fps(number)),
        _ => Err(wrong()),
    }
}

/// `axial`, or `0,0.5,1`.
fn plane(text: &str) -> Result<PlaneName, String> {
    Ok(match text {
        "axial" => PlaneName::Axial,
        "coronal" => PlaneName::Coronal,
        "sagittal" => PlaneName::Sagittal,
        _ => {
            let direction = triple(text).map_err(|_not_numbers| {
                format!("\"{text}\" is no plane: write axial, coronal, sagittal or a direction as in 0,0.5,1")
            })?;
            if direction == [0.0; 3] {
                return Err("0,0,0 is no direction: write one that has a length, as in 0,0.5,1".to_owned());
            }
            PlaneName::Along(direction)
        }
    })
}

/// `1.5,-20,300`.
fn triple(text: &str) -> Result<[f64; 3], String> {
    let wrong = || format!("\"{text}\" is no place: write X,Y,Z in mm, as in 1.5,-20,300");
    let number = |part: &str| part.trim().parse::<f64>().ok().filter(|v| v.is_finite()).ok_or_else(wrong);
    let numbers: Vec<f64> = text.split(',').map(number).collect::<Result<_, _>>()?;
    numbers.try_into().map_err(|_count| wrong())
}

/// `640x480`.
fn size(text: &str) -> Result<[u32; 2], String> {
    let wrong =
        || format!("\"{text}\" is not a size: write WIDTHxHEIGHT, each 1 to {MAX_SIDE}, as in 640x480");
    let (width, height) = text.split_once(['x', 'X']).ok_or_else(wrong)?;
    let side = |text: &str| text.parse().ok().filter(|n| (1..=MAX_SIDE).contains(n)).ok_or_else(wrong);
    Ok([side(width)?, side(height)?])
}

/// Runs the program on its arguments, the program's name first.
pub fn run(arguments: impl IntoIterator<Item = OsString>) -> ExitCode {
    env_logger::Builder::from_env(env_logger::Env::default().default_filter_or("error")).init();
    let cli = match Cli::try_parse_from(arguments) {
        Ok(cli) => cli,
        Err(error) => {
            // Help and version are errors to clap, with code 0. Nothing is left to do if the terminal is gone.
            drop(error.print());
            return ExitCode::from(u8::try_from(error.exit_code()).unwrap_or(2));
        }
    };
    if ranks::count() > 1 && !matches!(cli.command, Some(Command::Render(_))) {
        let fault = "mpirun has started several processes, and only render can be done by several";
        // One of them says so for all.
        return if ranks::is_first() {
            fail(&format!("{fault}; start this without mpirun"), 2)
        } else {
            ExitCode::SUCCESS
        };
    }
    let done = match &cli.command {
        None => return window(cli.paths),
        Some(Command::Info(args)) => headless::info::run(args),
        Some(Command::Render(args)) => headless::render::run(args),
        Some(Command::Section(args)) => headless::section::run(args),
        Some(Command::Compress(args)) => headless::compress::run(args),
        Some(Command::Bench(args)) => headless::bench::run(args),
        Some(Command::Demo(args)) => headless::demo::run(args),
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => fail(&failure.to_string(), failure.exit_code()),
    }
}

fn window(paths: Vec<PathBuf>) -> ExitCode {
    // A mistyped command reads as a path: say so here, not in a window that opens empty.
    for path in &paths {
        if let Err(source) = path.metadata() {
            let failure = Failure::Data(LoadError::Io { path: path.clone(), source });
            return fail(&failure.to_string(), failure.exit_code());
        }
    }
    match crate::host::run(paths) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            let no_gpu = matches!(error, HostError::Window(eframe::Error::Wgpu(_)));
            fail(&error.to_string(), if no_gpu { 4 } else { 1 })
        }
    }
}

/// One line on standard error, whatever the message holds.
fn fail(message: &str, code: u8) -> ExitCode {
    let line = message.split_whitespace().collect::<Vec<_>>().join(" ");
    // A closed standard error leaves nowhere to say that it is closed.
    drop(writeln!(std::io::stderr(), "osteotome: {line}"));
    ExitCode::from(code)
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory as _;

    #[test]
    fn the_arguments_are_consistent() {
        Cli::command().debug_assert();
    }

    #[test]
    fn a_size_is_two_positive_numbers() {
        assert_eq!(size("640x480"), Ok([640, 480]), "as written");
        for wrong in ["640", "0x10", "10x0", "-1x5", "99999x2", "ax3", "1x2x3", ""] {
            assert!(size(wrong).is_err(), "{wrong} was accepted");
        }
    }

    #[test]
    fn a_goal_is_a_kind_and_a_positive_number() {
        assert_eq!(goal("psnr=40"), Ok(Goal::Psnr(40.0)), "quality");
        assert_eq!(goal("mib=0.5"), Ok(Goal::Bytes(524_288.0)), "size");
        assert_eq!(goal("fps=25"), Ok(Goal::Fps(25.0)), "speed");
        for wrong in ["psnr", "psnr=", "psnr=-1", "fps=inf", "x=1", ""] {
            assert!(goal(wrong).is_err(), "{wrong} was accepted");
        }
    }

    #[test]
    fn a_layout_is_one_of_those_defined() {
        assert_eq!(layout("4,2").map(|l| (l.s(), l.t())), Ok((4, 2)), "as written");
        for wrong in ["4", "3,2", "4,5", "a,b", ""] {
            assert!(layout(wrong).is_err(), "{wrong} was accepted");
        }
    }

    #[test]
    fn a_plane_is_named_or_a_direction() {
        assert_eq!(plane("coronal"), Ok(PlaneName::Coronal), "by name");
        assert_eq!(plane("0,-0.5, 1"), Ok(PlaneName::Along([0.0, -0.5, 1.0])), "by its direction");
        for wrong in ["front", "1,2", "1,2,3,4", "0,0,0", "1,nan,0", ""] {
            assert!(plane(wrong).is_err(), "{wrong} was accepted");
        }
        let args = ["osteotome", "section", "a.json", "--out", "a.png", "--at", "-1,2,3"];
        assert!(Cli::try_parse_from(args).is_ok(), "a place may begin with a minus");
    }

    #[test]
    fn paths_without_a_command_open_the_window() {
        let cli = Cli::try_parse_from(["osteotome", "a.json", "b.stl"]).expect("two paths");
        assert!(cli.command.is_none() && cli.paths.len() == 2, "both paths");
        assert!(Cli::try_parse_from(["osteotome"]).expect("nothing").paths.is_empty(), "the sample case");
        assert!(Cli::try_parse_from(["osteotome", "render", "a.json"]).is_err(), "no --out");
    }
}
