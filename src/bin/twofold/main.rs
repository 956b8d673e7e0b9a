//! `twofold`: compute any run; make, check, bless, inspect and report on the figures.

fn main() -> std::process::ExitCode {
    twofold::cli::commands::main()
}
