//! `twofold`: compute any run; make, check, bless, inspect and report on the figures.

#[cfg(target_os = "linux")]
mod mathematics;

fn main() -> std::process::ExitCode {
    twofold::cli::commands::main()
}
