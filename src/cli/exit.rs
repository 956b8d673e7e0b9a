//! Exit codes, and errors as messages.

use std::io;
use std::path::PathBuf;
use std::process::ExitCode;

use crate::job::JobError;
use crate::job::spec::SpecError;
use crate::paper::pipeline::PipelineError;
use crate::record::FileError;
use crate::record::files::is_made_here;
use crate::record::manifest::ManifestError;

/// The exit code of every program of this project.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Exit {
    /// All is well.
    Fine = 0,
    /// A check failed: something differs, is missing, or was not made by twofold.
    CheckFailed = 1,
    /// Bad usage or input: a flag, number or file that cannot be used, or a file that cannot be
    /// read or written.
    Usage = 2,
    /// The computation or the drawing failed, though what was asked for can be asked.
    Failed = 3,
    /// Ended by Ctrl-C (SIGINT): 128 + 2, as shells count.
    Interrupted = 130,
    /// Ended by SIGTERM, as batch systems send it, or by a closed terminal (SIGHUP): 128 + 15.
    Terminated = 143,
}

impl Exit {
    /// All of them, as `--help` says it.
    pub const HELP: &str = "Exit codes: 0 fine; 1 a check failed; 2 bad usage, bad input, or a \
        file that cannot be read or written; \
                            3 a computation failed; 130 interrupted (Ctrl-C); 143 terminated \
                            (SIGTERM).";
}

impl From<Exit> for ExitCode {
    fn from(exit: Exit) -> Self {
        ExitCode::from(exit as u8)
    }
}

/// An error of the command line. Its text says what is wrong, where, and what to do.
#[derive(Debug, thiserror::Error)]
pub enum CliError {
    /// Bad usage that only one command knows of.
    #[error("{0}")]
    Usage(String),
    /// A flag that would have no effect.
    #[error("{flag} has no effect here: {why}")]
    NoEffect {
        /// The flag.
        flag: String,
        /// Why not, and what to do.
        why: String,
    },
    /// No panel of that name.
    #[error("there is no panel \"{panel}\" in {figure}; choose one of {known}")]
    NoSuchPanel {
        /// The name that was asked for.
        panel: String,
        /// The figure.
        figure: String,
        /// The names that exist.
        known: String,
    },
    /// A wrong number.
    #[error("--{0}")]
    Spec(#[from] SpecError),
    /// A run failed.
    #[error(transparent)]
    Job(#[from] JobError),
    /// A run or a drawing of a figure failed.
    #[error(transparent)]
    Pipeline(#[from] PipelineError),
    /// A figure's manifest could not be used.
    #[error("{0}; restore it, or make it anew: twofold bless --reason \"...\"")]
    Manifest(#[from] ManifestError),
    /// A file could not be read or written.
    #[error("{source}{}", advice(source))]
    File {
        /// The file, and why.
        #[from]
        source: FileError,
    },
    /// A recomputed result differs from the kept one.
    #[error("{0}")]
    Differs(String),
    /// Threads could not be started.
    #[error("--threads {threads}: {reason}; give a smaller number, or 0 for one per core")]
    Threads {
        /// The number of threads.
        threads: usize,
        /// Why.
        reason: String,
    },
    /// Standard output could not be written.
    #[error("cannot write to standard output: {0}")]
    Output(#[from] io::Error),
    /// The user asked to stop; finished results are kept.
    #[error("{said}")]
    Stopped {
        /// The results that were kept, and their place.
        said: String,
        /// By which signal.
        exit: Exit,
    },
}

impl CliError {
    /// The exit code.
    pub fn exit(&self) -> Exit {
        let of_job = |e: &JobError| if e.is_bad_question() { Exit::Usage } else { Exit::Failed };
        match self {
            CliError::Job(source) | CliError::Pipeline(PipelineError::Job { source, .. }) => {
                of_job(source)
            }
            CliError::Pipeline(PipelineError::Render { .. }) => Exit::Failed,
            CliError::Stopped { exit, .. } => *exit,
            CliError::Differs(_) => Exit::CheckFailed,
            CliError::Pipeline(PipelineError::Table(_))
            | CliError::Usage(_)
            | CliError::NoEffect { .. }
            | CliError::NoSuchPanel { .. }
            | CliError::Spec(_)
            | CliError::Manifest(_)
            | CliError::File { .. }
            | CliError::Threads { .. }
            | CliError::Output(_) => Exit::Usage,
        }
    }

    /// A flag that would have no effect.
    pub fn no_effect(flag: impl Into<String>, why: impl Into<String>) -> Self {
        CliError::NoEffect { flag: flag.into(), why: why.into() }
    }
}

/// Advice about a place that cannot be used.
fn advice(error: &FileError) -> &'static str {
    if error.action == "read" || error.action == "list" {
        return "";
    }
    match error.source.kind() {
        io::ErrorKind::PermissionDenied => {
            "; choose a place you may write to (--out, if the command has it)"
        }
        io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded | io::ErrorKind::FileTooLarge => {
            "; free some space or choose another place (--out, if the command has it)"
        }
        io::ErrorKind::ReadOnlyFilesystem => {
            "; choose a writable place (--out, if the command has it)"
        }
        io::ErrorKind::NotADirectory | io::ErrorKind::AlreadyExists => {
            "; a part of this path is a file, choose another place (--out, if the command has it)"
        }
        io::ErrorKind::InvalidData if error.action == "open the journal" => {
            "; delete it to compute all rows anew, or keep it and give another --out"
        }
        _ if error.action.starts_with("find") => {
            "; something else removed or changed it meanwhile: run this again"
        }
        _ => "; choose another place (--out, if the command has it)",
    }
}

/// The path of an unfinished output: beside the finished one, with the suffix `.part`, or `.part2`
/// and so on if another program wrote a file of that name.
pub fn part_of(file: &std::path::Path) -> PathBuf {
    let named = |k: usize| {
        let mut name = file.as_os_str().to_owned();
        name.push(if k == 1 { ".part".to_owned() } else { format!(".part{k}") });
        PathBuf::from(name)
    };
    let free = |path: &PathBuf| path.symlink_metadata().is_err() || is_made_here(path);
    (1..100).map(named).find(free).unwrap_or_else(|| named(100))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_of_other_programs_are_no_parts() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("b.csv");
        let [one, two] = ["b.csv.part", "b.csv.part2"].map(|name| folder.path().join(name));
        assert_eq!(part_of(&file), one);
        std::fs::write(&one, "mine").unwrap();
        assert_eq!(part_of(&file), two);
        std::fs::write(&one, "t,x\n0,1\n# {\"made_by\":\"twofold 0.2.0\"}\n").unwrap();
        assert_eq!(part_of(&file), one);
    }

    #[test]
    fn advice_fits_the_failure() {
        let error = |action, kind: io::ErrorKind| {
            CliError::from(FileError { action, path: "x".into(), source: kind.into() }).to_string()
        };
        assert!(error("write", io::ErrorKind::StorageFull).contains("free some space"));
        assert!(
            error("write", io::ErrorKind::NotADirectory)
                .contains("is a file, choose another place")
        );
        let damaged = error("open the journal", io::ErrorKind::InvalidData);
        assert!(damaged.contains("delete it to compute"), "{damaged}");
        assert!(!error("read", io::ErrorKind::PermissionDenied).contains("--out"));
        assert!(error("find again", io::ErrorKind::NotFound).contains("run this again"));
    }
}
