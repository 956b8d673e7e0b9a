//! `twofold new`: writes a system file to start from.

use std::path::PathBuf;

use crate::cli::speak::{deliver, is_standard_output};
use crate::cli::{CliError, Exit, models, print};
use crate::hybrid;
use crate::system::definition::State;
use crate::system::library;

/// Write a commented system file that runs as it stands, to be changed.
#[derive(Debug, clap::Args)]
#[command(
    override_usage = "twofold new [OPTIONS] <FILE>\n       twofold new --list",
    after_help = "Examples:\n  twofold new my.toml\n  twofold new my-circuit.toml --from chua\n  \
        twofold new my-ball.toml --from bouncing-ball\n  twofold new --list"
)]
pub struct Arguments {
    /// The file to write, .toml, or - for standard output.
    #[arg(value_name = "FILE", required_unless_present = "list")]
    file: Option<PathBuf>,
    /// Begin with a built-in system instead of the template.
    #[arg(long, value_name = "NAME")]
    from: Option<String>,
    /// Replace a file that is there.
    #[arg(long)]
    force: bool,
    /// Name the built-in systems and write nothing.
    #[arg(long, conflicts_with_all = ["file", "from", "force"])]
    list: bool,
}

/// The template.
const TEMPLATE: &str = include_str!("new.toml");

pub fn run(arguments: &Arguments) -> Result<Exit, CliError> {
    let Some(file) = &arguments.file else {
        print(&list())?;
        return Ok(Exit::Fine);
    };
    let text = match &arguments.from {
        None => TEMPLATE,
        Some(name) => library::text(name).or_else(|| library::general(name)).ok_or_else(|| {
            let (near, known) = models::known(name);
            CliError::Usage(format!(
                "--from {name}: there is no such built-in system{near} Built in are {known}"
            ))
        })?,
    };
    let tables = tables(text);
    if is_standard_output(file) {
        if arguments.force {
            return Err(CliError::no_effect(
                "--force",
                "standard output is no file that could be replaced; leave it out",
            ));
        }
        if let (Some((table, _)), Some(name)) = (tables.first(), &arguments.from) {
            return Err(CliError::Usage(format!(
                "--from {name}: the system reads {table}, which is written beside its file; give a \
                    file's name instead of -"
            )));
        }
        deliver(None, text.as_bytes())?;
        return Ok(Exit::Fine);
    }
    if !file.extension().is_some_and(|e| e.eq_ignore_ascii_case("toml")) {
        return Err(CliError::Usage(format!(
            "{}: a system's file is TOML; give it a name that ends in .toml",
            file.display()
        )));
    }
    let mut files = vec![(file.clone(), text)];
    files.extend(tables.into_iter().map(|(name, text)| (file.with_file_name(name), text)));
    if let Some((there, _)) =
        files.iter().find(|(f, _)| f.symlink_metadata().is_ok() && !arguments.force)
    {
        // A table keeps the name that the system reads.
        let choose = if there == file { "another name or folder" } else { "another folder" };
        return Err(CliError::Usage(format!(
            "{} is there already; choose {choose}, or replace it with --force",
            there.display()
        )));
    }
    // The system comes last: with it, everything is there.
    for (file, text) in files.iter().rev() {
        deliver(Some(file), text.as_bytes())?;
    }
    let name = file.display();
    let written: Vec<String> = files.iter().map(|(f, _)| f.display().to_string()).collect();
    // A general system has no switch to choose.
    let is_general = hybrid::definition::is_general(text, false);
    let switch = if is_general { "" } else { " --switch filippov" };
    print(&format!(
        "wrote {}; try\n  twofold plot --system {name}{switch} --out picture.png\n  twofold run \
            --system {name}{switch} --t-end 20",
        written.join(" and ")
    ))?;
    Ok(Exit::Fine)
}

/// A line for each system: name, title and states.
fn list() -> String {
    let width = library::names().chain(library::general_names()).map(str::len).max().unwrap_or(0);
    let line = |name: &str, title: &str, states: &[State]| {
        let states: Vec<&str> = states.iter().map(|s| s.name.as_str()).collect();
        format!("{name:width$}  {title} ({})", states.join(", "))
    };
    let switched = library::definitions().iter().map(|d| line(d.name(), d.title(), d.states()));
    let general = library::general_names()
        .filter_map(|name| hybrid::Definition::from_toml(library::general(name)?, name).ok())
        .map(|d| line(d.name(), d.title(), d.states()));
    switched.chain(general).collect::<Vec<_>>().join("\n")
}

/// The tables that a built-in system reads, with their texts.
fn tables(text: &str) -> Vec<(String, &'static str)> {
    let Ok(definition) = hybrid::Definition::from_toml(text, "system") else { return Vec::new() };
    let tables = definition.tables().iter();
    tables.filter_map(|(_, t)| Some((t.file.clone(), library::table(&t.file)?))).collect()
}
