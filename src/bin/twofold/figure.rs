//! `twofold figure`: the figures, several at once.

use twofold::cli::{self, FigureFlags};

use super::{Outcome, Problem, check};

/// Compute figures and write them as PNG, SVG and PDF, with their numbers as CSV: all their computations side by side, each once.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Figures to make, such as fig7; all if none is named.
    figures: Vec<String>,
    #[command(flatten)]
    flags: FigureFlags,
}

pub fn run(arguments: &Arguments) -> Result<Outcome, Problem> {
    cli::run(check::chosen(&arguments.figures)?, &arguments.flags)?;
    Ok(Outcome::Fine)
}
