//! `twofold new`: a system of one's own, to begin with.

use std::path::PathBuf;

use crate::cli::speak::{deliver, is_standard_output};
use crate::cli::{CliError, Exit, print};
use crate::system::diagnostic::nearest;
use crate::system::library;

/// Write a commented system file that runs as it stands, to be changed: `twofold run --system FILE`.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  twofold new my.toml\n  twofold new my-circuit.toml --from chua\n  twofold new --list"
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
        let width = library::names().map(str::len).max().unwrap_or(0);
        let lines: Vec<String> = library::definitions()
            .iter()
            .map(|d| {
                format!(
                    "{:width$}  {} ({})",
                    d.name(),
                    d.title(),
                    d.states().iter().map(|s| s.name.as_str()).collect::<Vec<_>>().join(", ")
                )
            })
            .collect();
        print(&lines.join("\n"))?;
        return Ok(Exit::Fine);
    };
    let text = match &arguments.from {
        None => TEMPLATE,
        Some(name) => library::text(name).ok_or_else(|| {
            let known: Vec<&str> = library::names().collect();
            let help = nearest(name, &known).map_or(String::new(), |near| format!(", did you mean {near}?"));
            CliError::Usage(format!(
                "--from {name}: there is no such built-in system{help}; built in are {}",
                known.join(", ")
            ))
        })?,
    };
    if is_standard_output(file) {
        if arguments.force {
            return Err(CliError::no_effect(
                "--force",
                "standard output is no file that could be replaced; leave it out",
            ));
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
    if file.symlink_metadata().is_ok() && !arguments.force {
        return Err(CliError::Usage(format!(
            "{} is there already; choose another name, or replace it with --force",
            file.display()
        )));
    }
    deliver(Some(file), text.as_bytes())?;
    let name = file.display();
    print(&format!(
        "wrote {name}; try\n  twofold plot --system {name} --out picture.png\n  twofold run --system {name} --t-end 20"
    ))?;
    Ok(Exit::Fine)
}
