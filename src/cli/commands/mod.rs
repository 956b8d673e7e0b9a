//! The commands of `twofold`.

mod audit;
mod bless;
mod check;
mod figure;
mod inspect;
pub(crate) mod lyapunov;
mod manual;
mod new;
pub(crate) mod orbit;
mod paper;
mod plot;
mod published;
mod report;
pub(crate) mod rests;
mod run;
pub(crate) mod scan;
pub(crate) mod sensitivities;
mod store;
pub(crate) mod sweep;
mod verify;

use std::process::ExitCode;

use clap::{CommandFactory, Parser, Subcommand};

use super::speak::complain;
use super::{CliError, Exit, LONG_VERSION, interrupt};
use crate::paper::{Figure, figures};

/// Integrate, draw and examine piecewise-smooth systems, and check papers about them.
#[derive(Debug, Parser)]
#[command(name = "twofold", version, long_version = LONG_VERSION, propagate_version = true,
    max_term_width = 120, help_template = overview(), after_help = Exit::HELP)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    Run(Box<run::Arguments>),
    Plot(Box<plot::Arguments>),
    Orbit(Box<orbit::Arguments>),
    Lyapunov(Box<lyapunov::Arguments>),
    Rests(rests::Arguments),
    Scan(Box<scan::Arguments>),
    Sensitivities(Box<sensitivities::Arguments>),
    New(new::Arguments),
    Figure(Box<figure::Arguments>),
    Sweep(Box<sweep::Arguments>),
    Check(check::Arguments),
    Audit(audit::Arguments),
    Bless(bless::Arguments),
    Report(report::Arguments),
    Inspect(inspect::Arguments),
    Verify(verify::Arguments),
    Store(store::Arguments),
    Paper(paper::Arguments),
    Completions(manual::Completions),
    Man(manual::Man),
}

/// The commands with a line each, for `twofold --help`.
const OVERVIEW: [(&str, &[(&str, &str)]); 3] = [
    (
        "Systems",
        &[
            ("new", "a system file to start from"),
            ("run", "one trajectory or Poincaré section"),
            ("plot", "a picture of a run"),
            ("orbit", "a closed orbit, its multipliers, its branch along a parameter"),
            ("lyapunov", "Lyapunov exponents with intervals"),
            ("rests", "equilibria and pseudo-equilibria"),
            ("scan", "orbit diagrams, and maps of where runs end"),
            ("sensitivities", "derivatives of a run's end"),
            ("sweep", "many runs, resumable, in shards"),
        ],
    ),
    (
        "Papers and figures",
        &[
            ("paper", "a paper as a folder: made, checked, reported"),
            ("figure", "compute the figures that ship with the program"),
            ("check", "compare them with their references"),
            ("report", "one page about them"),
            ("bless", "make them the references"),
        ],
    ),
    (
        "Files and the program",
        &[
            ("audit", "recompute a sample of a sweep's rows"),
            ("inspect", "what a picture says of its origin, and its seal"),
            ("verify", "check a theorem's certificate"),
            ("store", "answers kept from earlier computations"),
            ("completions", "completions for a shell"),
            ("man", "manual pages"),
            ("help", "the help of a command"),
        ],
    ),
];

/// The template of the program's help.
fn overview() -> String {
    let width = OVERVIEW.iter().flat_map(|(_, lines)| *lines).map(|(name, _)| name.len()).max();
    let width = width.unwrap_or(0);
    let mut text = String::from("{about}\n\n{usage-heading} {usage}\n");
    for (heading, lines) in OVERVIEW {
        text += &format!("\n{heading}:\n");
        for (name, what) in lines {
            text += &format!("  {name:width$}  {what}\n");
        }
    }
    text + "\nOptions:\n{options}{after-help}"
}

/// The definition of every command and flag, from which help, manual pages and docs/commands.md are
/// made.
pub fn definition() -> clap::Command {
    Arguments::command()
}

/// The program `twofold`.
pub fn main() -> ExitCode {
    interrupt::listen();
    let arguments = match Arguments::try_parse() {
        Ok(arguments) => arguments,
        Err(error) => return usage(&error).into(),
    };
    let words: Vec<String> =
        std::env::args_os().map(|word| word.to_string_lossy().into_owned()).collect();
    if let Some(file) = input_to_be_replaced(&words) {
        complain(&format!(
            "error: --out {file} would replace a file that this command reads; choose another place"
        ));
        return Exit::Usage.into();
    }
    let result = match arguments.command {
        Command::Run(arguments) => run::run(&arguments),
        Command::Plot(arguments) => plot::run(&arguments),
        Command::Orbit(arguments) => orbit::run(&arguments),
        Command::Lyapunov(arguments) => lyapunov::run(&arguments),
        Command::Rests(arguments) => rests::run(&arguments),
        Command::Scan(arguments) => scan::run(&arguments),
        Command::Sensitivities(arguments) => sensitivities::run(&arguments),
        Command::New(arguments) => new::run(&arguments),
        Command::Figure(arguments) => figure::run(&arguments),
        Command::Sweep(arguments) => sweep::run(&arguments),
        Command::Check(arguments) => check::run(&arguments),
        Command::Audit(arguments) => audit::run(&arguments),
        Command::Bless(arguments) => bless::run(&arguments),
        Command::Report(arguments) => report::run(&arguments),
        Command::Inspect(arguments) => inspect::run(&arguments),
        Command::Verify(arguments) => verify::run(&arguments),
        Command::Store(arguments) => store::run(&arguments),
        Command::Paper(arguments) => paper::run(&arguments),
        Command::Completions(arguments) => manual::completions(&arguments, Arguments::command()),
        Command::Man(arguments) => manual::man(&arguments, Arguments::command()),
    };
    match result {
        Ok(exit) => exit.into(),
        Err(error) => {
            complain(&format!("error: {error}"));
            error.exit().into()
        }
    }
}

/// The file of --out, if another word of the command line names the same file.
fn input_to_be_replaced(words: &[String]) -> Option<String> {
    let mut others = Vec::new();
    let mut out = None;
    let mut words = words.iter().skip(1);
    while let Some(word) = words.next() {
        match word.strip_prefix("--out").map(|rest| (rest, rest.strip_prefix('='))) {
            Some(("", _)) => out = words.next().cloned(),
            Some((_, Some(file))) => out = Some(file.to_owned()),
            _ => others.push(word.split_once('=').map_or(word.as_str(), |(_, value)| value)),
        }
    }
    let out = out?;
    let place = std::path::Path::new(&out).canonicalize().ok().filter(|place| place.is_file())?;
    let same = |word: &&str| std::path::Path::new(*word).canonicalize().is_ok_and(|p| p == place);
    others.iter().any(same).then_some(out)
}

/// Prints what clap has to say: help and version on standard output, errors on standard error.
pub(super) fn usage(error: &clap::Error) -> Exit {
    // A closed stream loses the text without an error; help that cannot be written is an error as
    // any output is.
    let shown = error.print().and_then(|()| std::io::Write::flush(&mut std::io::stdout()));
    match shown {
        _ if error.use_stderr() => Exit::Usage,
        Err(e) if e.kind() != std::io::ErrorKind::BrokenPipe => {
            complain(&format!("error: {e}"));
            Exit::Usage
        }
        _ => Exit::Fine,
    }
}

/// The figures of these names, or all.
fn chosen(names: &[String]) -> Result<Vec<Figure>, CliError> {
    let all = figures::all();
    if let Some(unknown) = names.iter().find(|n| !all.iter().any(|f| f.id == **n)) {
        let known: Vec<&str> = all.iter().map(|f| &*f.id).collect();
        return Err(CliError::Usage(format!(
            "there is no figure \"{unknown}\"; choose among {}",
            known.join(", ")
        )));
    }
    Ok(all.into_iter().filter(|f| names.is_empty() || names.iter().any(|n| *n == *f.id)).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_command_replaces_what_it_reads() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name).to_string_lossy().into_owned();
        std::fs::write(at("a.toml"), "").unwrap();
        let asked = |words: &[String]| {
            let all: Vec<String> =
                std::iter::once("twofold".to_owned()).chain(words.iter().cloned()).collect();
            input_to_be_replaced(&all).is_some()
        };
        let [system, out] = ["--system", "--out"].map(str::to_owned);
        let behind = folder.path().join(".").join("a.toml").to_string_lossy().into_owned();
        for (words, wanted) in [
            (vec![system.clone(), at("a.toml"), out.clone(), at("a.toml")], true),
            (vec![format!("--out={behind}"), format!("--system={}", at("a.toml"))], true),
            (vec![system.clone(), at("a.toml"), out.clone(), at("b.csv")], false),
            (vec![out, at("a.toml"), system, "wheel".to_owned()], false),
        ] {
            assert_eq!(asked(&words), wanted, "{words:?}");
        }
    }

    #[test]
    fn the_overview_has_a_line_for_every_command() {
        let mut listed: Vec<&str> =
            OVERVIEW.iter().flat_map(|(_, lines)| *lines).map(|(name, _)| *name).collect();
        let definition = Arguments::command();
        let mut known: Vec<&str> = definition.get_subcommands().map(|c| c.get_name()).collect();
        known.push("help");
        listed.sort_unstable();
        known.sort_unstable();
        assert_eq!(listed, known);
        let help = Arguments::command().render_long_help().to_string();
        let long: Vec<&str> = help.lines().filter(|l| l.chars().count() > 120).collect();
        assert!(long.is_empty(), "{long:?}");
        assert!(help.contains("\nOptions:\n") && help.contains("\nExit codes: "), "{help}");
    }

    #[test]
    fn the_definition_of_the_flags_is_sound() {
        Arguments::command().debug_assert();
    }
}
