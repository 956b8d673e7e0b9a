//! `twofold paper`: a paper as a folder.

use std::path::PathBuf;

use serde_json::json;

use crate::cli::progress::Progress;
use crate::cli::speak::print_json;
use crate::cli::{CliError, Exit, in_pool, print};
use crate::folder::Folder;
use crate::folder::make::{State, begin, outcome};
use crate::job::{Executor, Store};
use crate::paper::verdict::PanelVerdict;

/// Make, check, report or bless a paper: a folder of systems, figures and claims (docs/papers.md).
///
/// Everything that is written goes to out/ in the folder, and with bless to expected/.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  twofold paper new my-paper && twofold paper make my-paper\n  \
        twofold paper check papers/giaouris-2008\n  twofold paper bless my-paper --reason \"first \
        results\""
)]
pub struct Arguments {
    #[command(subcommand)]
    action: Action,
}

#[derive(Debug, clap::Subcommand)]
enum Action {
    /// Write a small paper that runs, to be changed.
    New {
        /// A folder that does not exist yet.
        #[arg(value_name = "DIR")]
        folder: PathBuf,
    },
    /// Compute the figures into out/ and score the claims; what was computed before is taken from
    /// out/.store.
    Make(Flags),
    /// Compare pictures and outcomes with those in expected/; exit code 1 on a difference.
    Check(Flags),
    /// Make, and write out/report.html, out/codecheck.yml and out/ro-crate-metadata.json.
    Report(Flags),
    /// Keep pictures' hashes and outcomes in expected/.
    Bless {
        #[command(flatten)]
        flags: Flags,
        /// One line that says why; it is kept in expected/CHANGES.md.
        #[arg(long, value_name = "TEXT")]
        reason: String,
    },
}

#[derive(Clone, Debug, clap::Args)]
struct Flags {
    /// The paper's folder.
    #[arg(value_name = "DIR")]
    folder: PathBuf,
    /// Compute everything anew and keep nothing.
    #[arg(long)]
    fresh: bool,
    /// Threads; 0 is one per core. The bytes do not depend on it.
    #[arg(long, value_name = "N", default_value_t = 0)]
    threads: usize,
    /// The findings, as JSON on standard output.
    #[arg(long)]
    json: bool,
    /// No progress on standard error.
    #[arg(long)]
    quiet: bool,
}

pub fn run(arguments: &Arguments) -> Result<Exit, CliError> {
    let (flags, what) = match &arguments.action {
        Action::New { folder } => {
            begin(folder)?;
            print(&format!(
                "wrote {}; try: twofold paper make {}",
                folder.display(),
                folder.display()
            ))?;
            return Ok(Exit::Fine);
        }
        Action::Make(flags) => (flags, What::Make),
        Action::Check(flags) => (flags, What::Check),
        Action::Report(flags) => (flags, What::Report),
        Action::Bless { flags, reason } => {
            let reason = reason.trim();
            if reason.is_empty() || reason.contains('\n') {
                return Err(CliError::Usage(
                    "--reason: give one line that says why expectations change".into(),
                ));
            }
            (flags, What::Bless(reason))
        }
    };
    let folder = Folder::read(&flags.folder)?;
    let progress = Progress::new(flags.quiet);
    let store = (!flags.fresh).then(|| Store::new(folder.out().join(".store")));
    let executor = Executor::new(store, &progress);
    let made = in_pool(flags.threads, || folder.make(&executor))??;
    if let Some((claim, why)) = made.failure()
        && let Some(exit) = progress.asked_to_stop()
    {
        let said = format!(
            "interrupted at claim {claim} ({why}); what is finished is kept, and the same command \
                goes on"
        );
        return Err(CliError::Stopped { said, exit });
    }
    let (holds, all) = made.score();
    let pictures = made.pictures.len();
    let plural = if pictures == 1 { "" } else { "s" };
    let score = format!("{pictures} picture{plural}, {holds} of {all} claims agree");
    let failed = if made.failure().is_some() { Exit::Failed } else { Exit::Fine };
    let claims: Vec<_> = made
        .claims
        .iter()
        .map(|s| match &s.verdict {
            Ok(v) => json!({ "claim": v.claim, "outcome": outcome(v.agrees), "found": v.found,
                "odds": v.odds, "decided": v.decided, "rule_after_data": v.rule_after_data,
                "words_after_data": v.words_after_data }),
            Err(why) => json!({ "claim": s.claim.id, "outcome": "failed",
                "found": why.to_string() }),
        })
        .chain(made.panels().map(|v| {
            let claim = format!("{}/{}", v.picture, v.panel);
            json!({ "claim": claim, "outcome": outcome(v.agrees), "found": v.found,
                "because": v.because })
        }))
        .collect();
    let lines = || {
        let claims = made.claims.iter().map(|s| match &s.verdict {
            Ok(v) => format!("{}: {}: {}", v.claim, outcome(v.agrees), v.found),
            Err(why) => format!("{}: cannot be scored: {why}", s.claim.id),
        });
        let panel = |v: &PanelVerdict| {
            format!("{}/{}: {}: {}", v.picture, v.panel, outcome(v.agrees), v.found)
        };
        claims.chain(made.panels().map(panel))
    };
    match what {
        What::Make | What::Report => {
            let page = match what {
                What::Report => Some(folder.report(&made)?),
                _ => None,
            };
            if flags.json {
                print_json(&json!({ "format": "twofold-paper", "version": 1, "claims": claims,
                        "report": page }))?;
            } else {
                lines().try_for_each(|line| print(&line))?;
                let page = page.map_or(String::new(), |page| format!("; {}", page.display()));
                if let (What::Report, Some(lack)) = (what, folder.metadata_lack()) {
                    print(&lack)?;
                }
                print(&format!("{score}{page}"))?;
            }
            Ok(failed)
        }
        What::Check => {
            let findings = folder.compare(&made)?;
            let same = findings.iter().all(|f| f.state == State::Same);
            if flags.json {
                print_json(
                    &json!({ "format": "twofold-paper-check", "version": 1, "all_the_same": same,
                        "findings": findings, "claims": claims }),
                )?;
            } else {
                findings.iter().try_for_each(|f| print(&f.line()))?;
                print(&if same { format!("{score}; all the same as expected") } else { score })?;
                let new = findings.iter().filter(|f| f.state == State::New).count();
                if new > 0 {
                    // Beside what fails nothing is blessed.
                    let fails = findings.iter().any(|f| matches!(f.state, State::Failed { .. }));
                    let keep = if fails { "once nothing fails keep them" } else { "keep them" };
                    print(&format!(
                        "{new} new, with nothing to compare; {keep}: twofold paper bless {} \
                            --reason \"...\"",
                        flags.folder.display()
                    ))?;
                }
            }
            Ok(match same {
                true => Exit::Fine,
                false if failed == Exit::Failed => failed,
                false => Exit::CheckFailed,
            })
        }
        What::Bless(reason) => {
            let changed = folder.bless(&made, reason)?;
            if flags.json {
                print_json(
                    &json!({ "format": "twofold-paper-bless", "version": 1, "changed": changed }),
                )?;
            } else if changed.is_empty() {
                print("nothing changed")?;
            } else {
                print(&format!("blessed: {}", changed.join(", ")))?;
            }
            Ok(Exit::Fine)
        }
    }
}

#[derive(Clone, Copy)]
enum What<'a> {
    Make,
    Check,
    Report,
    Bless(&'a str),
}
