//! Makes the figure: every number of it stands in figure.rs beside this.

#[cfg(target_os = "linux")]
#[path = "../../src/bin/twofold/mathematics.rs"]
mod mathematics;

fn main() -> std::process::ExitCode {
    twofold::cli::main(twofold::paper::figures::named("fig1"))
}
