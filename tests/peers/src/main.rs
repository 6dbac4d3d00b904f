//! Other people's codecs beside ours, interleaved in one process, one thread: `peers <what> ...` prints a line of JSON a
//! codec and rate.

mod series;
mod zfp;

use std::process::ExitCode;

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let result = match arguments.split_first() {
        Some((what, rest)) if what == "series" => series::run(rest),
        _ => Err("usage: peers series FILE X Y Z STEPS".into()),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("{error}");
            ExitCode::FAILURE
        }
    }
}
