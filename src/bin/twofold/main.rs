//! `twofold`: compute any run; check, bless, inspect and report on the published figures.

mod bless;
mod check;
mod figure;
mod inspect;
mod published;
mod report;
mod run;
mod sweep;

use std::process::ExitCode;

use clap::{Parser, Subcommand};

/// Reference software for the breakdown of determinism at a two-fold singularity (Jeffrey 2013).
#[derive(Debug, Parser)]
#[command(version, about, long_about = None, propagate_version = true)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    Run(Box<run::Arguments>),
    Figure(figure::Arguments),
    Sweep(Box<sweep::Arguments>),
    Check(check::Arguments),
    Bless(bless::Arguments),
    Report(report::Arguments),
    Inspect(inspect::Arguments),
}

/// How a command that did not fail ended.
enum Outcome {
    /// All is well: exit code 0.
    Fine,
    /// A check failed: exit code 1.
    Differs,
}

/// A failure of usage, input or place: exit code 2. Its text says what was wrong, where, and what to do.
type Problem = Box<dyn std::error::Error>;

fn main() -> ExitCode {
    let result = match Arguments::parse().command {
        Command::Run(arguments) => run::run(&arguments),
        Command::Figure(arguments) => figure::run(&arguments),
        Command::Sweep(arguments) => sweep::run(&arguments),
        Command::Check(arguments) => check::run(&arguments),
        Command::Bless(arguments) => bless::run(&arguments),
        Command::Report(arguments) => report::run(&arguments),
        Command::Inspect(arguments) => inspect::run(&arguments),
    };
    match result {
        Ok(Outcome::Fine) => ExitCode::SUCCESS,
        Ok(Outcome::Differs) => ExitCode::from(1),
        Err(problem) => {
            eprintln!("error: {problem}");
            ExitCode::from(2)
        }
    }
}
