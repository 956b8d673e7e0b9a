//! The questions of commands, for callers that have a command's flags but need the answer itself:
//! papers' folders and Python.

use std::sync::Arc;

use clap::{Args, Command};

use super::CliError;
use super::commands::{lyapunov, orbit, rests, scan, sensitivities, sweep};
use super::flags::{RunFlags, Use};
use super::general;
use crate::job::AnyQuestion;
use crate::job::scan::Scan;
use crate::job::sweep::Sweep;
use crate::paper::plots::Recorded;

/// The question of a command.
pub enum Asked {
    /// One question.
    Question(AnyQuestion),
    /// Many runs, and how they move.
    Scan(Box<Scan>),
    /// Many runs, and where they end.
    Sweep(Box<Sweep>),
}

/// The commands that ask something.
pub const COMMANDS: [&str; 7] =
    ["run", "orbit", "lyapunov", "rests", "scan", "sensitivities", "sweep"];

/// The flags of `T` that can be given, without dashes.
pub fn known<T: Args>() -> Vec<String> {
    command::<T>().get_arguments().filter_map(|a| a.get_long().map(str::to_owned)).collect()
}

fn command<T: Args>() -> Command {
    T::augment_args(Command::new("twofold").no_binary_name(true).disable_help_flag(true))
}

/// Reads flags, such as `--t-end=10`.
///
/// # Errors
/// A message in one line.
pub fn parsed<T: Args>(flags: Vec<String>) -> Result<T, String> {
    let read = command::<T>().try_get_matches_from(flags).and_then(|m| T::from_arg_matches(&m));
    read.map_err(|error| {
        let text = error.to_string();
        text.lines().next().unwrap_or_default().trim_start_matches("error: ").to_owned()
    })
}

/// The run that flags describe.
///
/// # Errors
/// If a flag has no effect, or a value is wrong.
pub fn recorded(flags: &RunFlags, command: Use) -> Result<Recorded, CliError> {
    Ok(match general::run_of(flags)? {
        Some(run) => Recorded::General(run, flags.section.clone()),
        None => Recorded::Surfaces(flags.spec(command)?),
    })
}

/// The question of one of [`COMMANDS`] with these flags.
///
/// # Errors
/// If there is no such command, a flag has no effect, or a value is wrong.
pub fn asked(command: &str, flags: Vec<String>) -> Result<Asked, CliError> {
    fn read<T: Args>(flags: Vec<String>) -> Result<T, CliError> {
        parsed(flags).map_err(CliError::Usage)
    }
    Ok(Asked::Question(match command {
        "run" => recorded(&read(flags)?, Use::Any)?.question(),
        "orbit" => read::<orbit::Arguments>(flags)?.question()?,
        "lyapunov" => read::<lyapunov::Arguments>(flags)?.question()?,
        "rests" => Arc::new(read::<rests::Arguments>(flags)?.question()?),
        "sensitivities" => Arc::new(read::<sensitivities::Arguments>(flags)?.question()?),
        "scan" => return Ok(Asked::Scan(Box::new(read::<scan::Arguments>(flags)?.scan()?))),
        "sweep" => return Ok(Asked::Sweep(Box::new(read::<sweep::Arguments>(flags)?.sweep()?))),
        other => {
            return Err(CliError::Usage(format!(
                "{other}: there is no such command; choose among {}",
                COMMANDS.join(", ")
            )));
        }
    }))
}
