//! `twofold completions` and `twofold man`: both from the definition of the flags.

use std::path::PathBuf;

use clap::Command;
use clap_complete::Shell;

use crate::cli::{CliError, Exit, print, print_bytes};
use crate::record;

/// Print the completions for a shell.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  twofold completions bash > \
        ~/.local/share/bash-completion/completions/twofold\n  \
                        twofold completions zsh > ~/.zfunc/_twofold\n  \
                        twofold completions fish > ~/.config/fish/completions/twofold.fish")]
pub struct Completions {
    /// The shell.
    #[arg(value_enum)]
    shell: Shell,
}

/// Write the manual pages, one per command, into a folder.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n  twofold man ~/.local/share/man/man1")]
pub struct Man {
    /// The folder.
    #[arg(value_name = "DIR")]
    folder: PathBuf,
}

pub fn completions(arguments: &Completions, mut command: Command) -> Result<Exit, CliError> {
    let mut script = Vec::new();
    clap_complete::generate(arguments.shell, &mut command, "twofold", &mut script);
    print_bytes(&script)?;
    Ok(Exit::Fine)
}

pub fn man(arguments: &Man, mut command: Command) -> Result<Exit, CliError> {
    record::files::try_folder(&arguments.folder)?;
    command.build();
    let mut pages = vec![("twofold.1".to_owned(), page(command.clone())?)];
    for inner in command.get_subcommands().filter(|c| c.get_name() != "help") {
        let name = format!("twofold-{}", inner.get_name());
        pages.push((format!("{name}.1"), page(inner.clone())?));
    }
    for (file, bytes) in &pages {
        record::write(&arguments.folder.join(file), bytes)?;
    }
    print(&format!("wrote {} pages in {}", pages.len(), arguments.folder.display()))?;
    Ok(Exit::Fine)
}

/// One page. It carries no date: the same program writes the same page.
fn page(command: Command) -> Result<Vec<u8>, CliError> {
    let mut bytes = Vec::new();
    clap_mangen::Man::new(command).render(&mut bytes)?;
    Ok(bytes)
}
