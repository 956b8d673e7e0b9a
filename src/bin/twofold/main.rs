//! `twofold`: compute any run; check, bless, inspect and report on the published figures.

#[allow(dead_code, missing_docs)] // each figure's `main` is for its own binary
#[path = "../../../figures/catalogue.rs"]
mod catalogue;

fn main() -> std::process::ExitCode {
    twofold::cli::commands::main(catalogue::all)
}
