//! `twofold figure`: the figures, several at once.

use super::chosen;
use crate::cli::{self, CliError, Exit, FigureFlags};

/// Compute figures and write them as PNG, SVG and PDF, with their numbers as CSV: all their
/// computations side by side, each once.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  twofold figure\n  twofold figure fig7 fig9 --out pictures\n  \
        twofold figure fig7 --t-end 100 --fresh"
)]
pub struct Arguments {
    /// Figures to make, such as fig7 (any other word lists their names); all if none is named.
    figures: Vec<String>,
    #[command(flatten)]
    flags: FigureFlags,
}

pub fn run(arguments: &Arguments) -> Result<Exit, CliError> {
    cli::run(chosen(&arguments.figures)?, &arguments.flags)?;
    Ok(Exit::Fine)
}
