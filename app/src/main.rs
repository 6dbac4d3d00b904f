//! The program `osteotome`: arguments in, exit code out. What it does is in the library, [`app::cli`].

fn main() -> std::process::ExitCode {
    app::cli::run(std::env::args_os())
}
