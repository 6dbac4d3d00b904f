//! `bench`: run time beside error, one file a benchmark.
//!
//! `frame` draws, `textures` makes textures, `accuracy` refines scenes of known pictures, `pareto` sweeps what a picture
//! can be made cheaper by, `skips` says what skipping saves, `cells` draws unstructured grids; `series` and `play`, of volumes over time, lie beside what
//! they measure.
//!
//! Each result is one JSON object a line (`--json`) or a line of a table. Times are the median of
//! `REPEATS` runs after one that is not counted, so that neither the first upload nor one busy moment
//! decides; fewer where a measurement takes long.

mod accuracy;
mod cells;
mod frame;
mod painter;
mod pareto;
mod peer;
mod skips;
mod textures;

use std::path::Path;
use std::time::Duration;

use serde_json::{Map, Value};

use super::input::Input;
use super::plot::{Chart, Scale, Series};
use super::{Failure, input, say, write_file};
use crate::case::Source;
use crate::cli::{BenchArgs, BenchName};
use crate::sample;

/// Counted runs of each measurement.
const REPEATS: usize = 3;
/// No run is repeated once its measurement has taken this long: a software adapter is slow, but steady.
const ENOUGH: Duration = Duration::from_secs(10);

/// Runs a benchmark.
///
/// # Errors
/// [`Failure`].
pub fn run(args: &BenchArgs) -> Result<(), Failure> {
    let path = args.data.as_deref().unwrap_or(Path::new("the built-in data"));
    let mut bench = Bench { json: args.json, enlarge: usize::from(args.enlarge), rows: Vec::new() };
    let charts: Vec<(&str, Chart)> = match args.name {
        BenchName::Frame => {
            frame::run(&data(args)?, &mut bench)?;
            vec![("frame.svg", frame::chart(&bench.rows))]
        }
        BenchName::Compress => {
            textures::run(&data(args)?, path, &mut bench)?;
            vec![("compress.svg", textures::chart(&bench.rows))]
        }
        BenchName::Series => {
            super::series::bench(&data(args)?, path, &mut bench)?;
            vec![("series.svg", series_chart(&bench.rows))]
        }
        BenchName::Play => {
            super::play::bench(&data(args)?, path, &mut bench)?;
            vec![("play.svg", play_chart(&bench.rows))]
        }
        BenchName::Accuracy => {
            accuracy::run(&mut bench)?;
            accuracy::charts(&bench.rows)
        }
        BenchName::Skips => {
            skips::run(&data(args)?, &mut bench)?;
            Vec::new()
        }
        BenchName::Cells => {
            cells::run(args.data.as_deref(), args.peer.as_deref(), &mut bench)?;
            cells::charts(&bench.rows, args.peer.is_some())
        }
        BenchName::Pareto => {
            let case = args.data.as_deref().filter(|path| input::is_case(path));
            pareto::run(&data(args)?, case, args.peer.as_deref(), &mut bench)?;
            pareto::charts(&bench.rows)
        }
    };
    if let Some(folder) = &args.plot {
        std::fs::create_dir_all(folder).map_err(|source| Failure::Output { path: folder.clone(), source })?;
        for (name, chart) in charts {
            write_file(&folder.join(name), chart.svg().as_bytes())?;
        }
    }
    Ok(())
}

/// What is measured on: the data named, or those built in.
fn data(args: &BenchArgs) -> Result<Input, Failure> {
    match (&args.data, args.name) {
        (Some(path), _) => input::open(path),
        (None, BenchName::Series | BenchName::Play) => {
            input::of_source(&Source::Builtin(sample::BEAT.to_owned()))
        }
        (None, _) => input::builtin(),
    }
}

/// What was measured of one thing.
type Row = Map<String, Value>;

/// How a benchmark is run and what it found.
#[derive(Debug)]
pub(super) struct Bench {
    json: bool,
    enlarge: usize,
    rows: Vec<Row>,
}

impl Bench {
    /// Voxels along each axis for one of the data's.
    pub(super) fn enlarge(&self) -> usize {
        self.enlarge
    }

    /// Prints a row as soon as it is measured, and keeps it.
    pub(super) fn report(&mut self, row: Value) -> Result<(), Failure> {
        let Value::Object(row) = row else { return Ok(()) };
        if self.json {
            say(&Value::Object(row.clone()).to_string())?;
        } else {
            let cell = |(key, value): (&String, &Value)| match value.as_f64() {
                Some(number) if value.is_f64() => format!("{key} {number:.2}"),
                _ => format!("{key} {}", value.as_str().map_or_else(|| value.to_string(), str::to_owned)),
            };
            say(&row.iter().map(cell).collect::<Vec<_>>().join("  "))?;
        }
        self.rows.push(row);
        Ok(())
    }
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
}

/// Peak signal-to-noise ratio of a mean square in 1/255, dB; none where nothing differs.
pub(super) fn psnr(mean_square: f64) -> Option<f64> {
    (mean_square > 0.0).then(|| 10.0 * (255.0 * 255.0 / mean_square).log10())
}

fn series_chart(rows: &[Row]) -> Chart {
    let label = |row: &Row| format!("{} {}", row["encoder"], row["second"]).replace('"', "");
    Chart {
        title: "Codecs of a series: size against error".to_owned(),
        x: "bytes for one of the samples'".to_owned(),
        y: "PSNR, dB".to_owned(),
        y_scale: Scale::Linear,
        joined: false,
        series: series(rows, "codec", &|row| {
            (1.0 / number(row, "ratio"), number(row, "psnr_db"), label(row))
        }),
    }
}

fn play_chart(rows: &[Row]) -> Chart {
    let label = |row: &Row| format!("{} to texture", row["second"]).replace('"', "");
    Chart {
        title: "Playing from a file that is in no cache: speed against error".to_owned(),
        x: "volumes a second, from file to texture".to_owned(),
        y: "PSNR, dB".to_owned(),
        y_scale: Scale::Linear,
        joined: false,
        series: series(rows, "codec", &|row| {
            (number(row, "volumes_per_s"), number(row, "psnr_db"), label(row))
        }),
    }
}

fn number(row: &Row, key: &str) -> f64 {
    row.get(key).and_then(Value::as_f64).unwrap_or(f64::NAN)
}

/// Rows with one value of `key` are one series.
fn series(rows: &[Row], key: &str, point: &dyn Fn(&Row) -> (f64, f64, String)) -> Vec<Series> {
    let mut all: Vec<Series> = Vec::new();
    for row in rows {
        let name = row.get(key).and_then(Value::as_str).unwrap_or_default();
        match all.iter_mut().find(|s| s.name == name) {
            Some(series) => series.points.push(point(row)),
            None => all.push(Series { name: name.to_owned(), points: vec![point(row)] }),
        }
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_median_ignores_one_busy_moment() {
        assert_eq!(median(vec![5.0, 900.0, 4.0]), 5.0, "the middle");
        assert!(median(Vec::new()).is_nan(), "of nothing");
    }
}
