//! Makes the figure: every number of it stands in figure.rs beside this.

fn main() -> std::process::ExitCode {
    twofold::cli::main(twofold::paper::figures::basin::figure())
}
