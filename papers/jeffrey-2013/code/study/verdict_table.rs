//! The table of verdicts in docs/findings.md, from the committed manifests.

use std::fmt::Write as _;

use crate::Reading;
use twofold_job::record::{Manifest, PanelEntry, VerdictEntry};
use twofold_paper::Support;

/// Stands before the table.
pub const BEGIN: &str =
    "<!-- verdicts: made by `twofold bless` from papers/jeffrey-2013/expected; do not edit -->";
/// Stands after it.
pub const END: &str = "<!-- end of verdicts -->";

/// The figures whose claims are the paper's, in order.
const PAPER: [&str; 4] = ["fig6", "fig7", "fig8", "fig9"];

/// The table, and how many claims agree in each reading.
pub fn table(manifests: &[Manifest]) -> String {
    let mut text = String::from(
        "| panel | the paper says | printed reading | | census | reconstructed reading | | census \
            |\n|---|---|---|---|---|---|---|---|\n",
    );
    let mut counts = [[0_usize; 2]; 2];
    for figure in PAPER {
        let Some(manifest) = manifests.iter().find(|m| m.figure == figure) else { continue };
        let panels = |reading: Reading| -> &[PanelEntry] {
            manifest.picture(&format!("{figure}-{}", reading.word())).map_or(&[], |p| &p.panels)
        };
        for panel in panels(Reading::Printed) {
            let verdicts = Reading::ALL.map(|reading| {
                panels(reading)
                    .iter()
                    .find(|p| p.label == panel.label)
                    .and_then(|p| p.verdict.as_ref())
            });
            let [Some(first), _] = verdicts else { continue };
            let number = figure.trim_start_matches("fig");
            let name = format!("{number}({})", panel.label);
            let cells: Vec<String> = verdicts
                .iter()
                .zip(&mut counts)
                .zip(Reading::ALL)
                .map(|((verdict, count), reading)| match verdict {
                    Some(VerdictEntry { found, agrees, .. }) => {
                        *count = [count[0] + usize::from(*agrees), count[1] + 1];
                        format!(
                            "{} | {} | {}",
                            found.replace('|', "\\|"),
                            if *agrees { "agrees" } else { "differs" },
                            share(&name, reading)
                        )
                    }
                    None => " | | ".into(),
                })
                .collect();
            // Writing to a String cannot fail.
            let _ = writeln!(text, "| {name} | {} | {} |", first.claim, cells.join(" | "));
        }
    }
    let [printed, reconstructed] = counts.map(|[agree, of]| format!("{agree} of {of}"));
    let _ =
        write!(text, "\nClaims that agree: {printed} (printed), {reconstructed} (reconstructed).");
    text
}

/// The share of the census' runs that support a panel's claim, if the census repeats the panel.
fn share(panel: &str, reading: Reading) -> String {
    crate::census::support(panel, reading).map_or(String::new(), |Support { support, runs }| {
        format!("{:.0} %", 100.0 * support as f64 / runs.max(1) as f64)
    })
}

/// A page with its table replaced; `None` if it has no place for one.
pub fn with_table(page: &str, table: &str) -> Option<String> {
    let (before, rest) = page.split_once(BEGIN)?;
    let (_, after) = rest.split_once(END)?;
    Some(format!("{before}{BEGIN}\n\n{table}\n\n{END}{after}"))
}
