//! Other people's codecs beside ours, interleaved in one process: `peers WHAT ...` prints a line of JSON for each codec.

mod blocks;
mod series;
mod zfp;

use std::process::ExitCode;

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let result = match arguments.split_first() {
        Some((what, rest)) if what == "series" => series::run(rest),
        Some((what, rest)) if what == "blocks" => blocks::run(rest),
        _ => Err(format!("usage: peers series FILE X Y Z STEPS, or peers {}", blocks::USAGE).into()),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("{error}");
            ExitCode::FAILURE
        }
    }
}
