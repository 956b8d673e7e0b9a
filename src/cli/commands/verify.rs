//! `twofold verify`: whether a theorem follows from its certificate.

use std::path::PathBuf;

use serde_json::json;

use crate::cli::speak::{harmless, print_json};
use crate::cli::{CliError, Exit, print};
use crate::paper::code::theorems;
use crate::record::files::read_text;
use crate::verify::{Checker, Refused};

/// Check certificates of theorems (proofs/certificates) by computing what they claim anew.
///
/// Shares no code with the programs that made them: orbits are enclosed by a validated integrator
/// of the checker's own, and what follows is decided in exact arithmetic. The eight committed
/// certificates take about a minute. Exit code 0: every statement holds. 1: one does not follow, or
/// a number claimed is refused. 2: a file cannot be read as a certificate. proofs/README.md says
/// what is rigorous and what is compared.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  twofold verify proofs/certificates/*.json\n  twofold verify --json \
        sensitivity.json"
)]
pub struct Arguments {
    /// Certificates.
    #[arg(required = true, value_name = "CERT")]
    files: Vec<PathBuf>,
    /// JSON on standard output.
    #[arg(long)]
    json: bool,
}

pub fn run(arguments: &Arguments) -> Result<Exit, CliError> {
    let mut exit = Exit::Fine;
    let mut rows = Vec::new();
    let checker = Checker::new(theorems());
    for file in &arguments.files {
        let shown = file.display().to_string();
        let text = read_text(file)?;
        match checker.verify(&text) {
            Ok(v) => {
                if !arguments.json {
                    print(&format!("{}: verified", v.theorem))?;
                    for finding in &v.findings {
                        print(&format!("  {finding}"))?;
                    }
                }
                rows.push(json!({
                    "file": shown, "verified": true, "theorem": v.theorem, "statement": v.statement,
                        "findings": v.findings,
                }));
            }
            Err(Refused::Unreadable(why)) => {
                let why = match serde_json::from_str::<serde::de::IgnoredAny>(&text) {
                    Err(_) => "it is not JSON".to_owned(),
                    Ok(_) => harmless(&why),
                };
                return Err(CliError::Usage(format!("{shown}: not a certificate: {why}")));
            }
            Err(wrong @ Refused::Wrong { .. }) => {
                exit = Exit::CheckFailed;
                if !arguments.json {
                    print(&format!("{}: NOT VERIFIED: {}", shown, harmless(&wrong.to_string())))?;
                }
                rows.push(json!({ "file": shown, "verified": false, "why": wrong.to_string() }));
            }
        }
    }
    if arguments.json {
        print_json(&rows)?;
    }
    Ok(exit)
}
