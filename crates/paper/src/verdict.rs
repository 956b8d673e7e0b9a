//! The paper's claims, panel by panel, and whether they hold.
//!
//! A claim is what the paper says of a panel (its words are quoted). A verdict is what our run
//! shows, with its evidence. Whether they agree is decided by one rule per kind of claim, stated in
//! [`SectionClaim::score`] and [`judge`]; no panel is judged by hand.

use std::sync::Arc;

use serde::{Deserialize, Serialize};

use super::Picture;
pub use super::claim::Claim as SectionClaim;
use twofold_analyse::attractor::Evidence;
use twofold_analyse::divider::Shared;
use twofold_job::{AnyQuestion, Ask, Classification, JobError, PathComparison};
use twofold_num::elementary::sqrt;
use twofold_num::fit::mean;

/// The paper's claim about a panel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Claim {
    /// About a section.
    Section(SectionClaim),
    /// Less organisation than in the next panel.
    LessOrganisedThanNext,
    /// This panel and the next differ in structure.
    DiffersFromNext,
}

/// Two paths "differ markedly" when a quarter or more of their strides end where the other never
/// comes.
pub const MARKED_DIFFERENCE: f64 = 0.25;

/// A panel's verdict: claim, evidence, agreement.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PanelVerdict {
    /// The picture's name.
    pub picture: String,
    /// The figure's reading.
    pub reading: Option<String>,
    /// The panel's label.
    pub panel: String,
    /// The method.
    pub method: String,
    /// The paper's claim.
    pub claim: Claim,
    /// The claim in the paper's words, or close to them.
    pub claim_text: String,
    /// The finding, in one line.
    pub found: String,
    /// Whether they agree.
    pub agrees: bool,
    /// Why, or with what reservation.
    pub because: String,
    /// The evidence for the finding.
    pub evidence: Grounds,
}

/// The evidence behind a verdict.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Grounds {
    /// A section was classified.
    Section(Box<Evidence>),
    /// Two paths were compared.
    Paths {
        /// Share of strides into new places, of this panel's path and of the next one's.
        freshness: [f64; 2],
        /// Overlap of the two paths.
        shared: Shared,
    },
    /// Two panels were compared over starts that a reader could not tell apart.
    Freshness {
        /// Mean share of strides into new places, of this panel's paths and of the next one's.
        mean: [f64; 2],
        /// Its standard errors.
        standard_error: [f64; 2],
        /// Pairs of runs.
        runs: usize,
    },
}

impl Claim {
    /// The claim in words, about a panel and the next one.
    fn text(self, panel: &str, next: &str) -> String {
        match self {
            Claim::Section(claim) => claim.to_string(),
            Claim::LessOrganisedThanNext => format!("less organised than ({next})"),
            Claim::DiffersFromNext => format!("({panel}) and ({next}) differ"),
        }
    }
}

/// Runs from neighbouring starts by which the organisation of two panels is compared.
const NEIGHBOURS: usize = 12;
/// Distance between those starts.
const NEIGHBOUR_SHIFT: f64 = 1e-10;
/// A panel is less organised than the next if the means are so many standard errors of their
/// difference apart.
const CLEARLY: f64 = 2.0;

/// The comparisons of a panel with the next one from neighbouring starts, the paper's first.
fn neighbours(picture: &Picture, index: usize) -> Vec<PathComparison> {
    let (Some(here), Some(next)) = (picture.panels.get(index), picture.panels.get(index + 1))
    else {
        return Vec::new();
    };
    (0..NEIGHBOURS)
        .map(|k| {
            let [mut a, mut b] = [here.run.clone(), next.run.clone()];
            for run in [&mut a, &mut b] {
                run.start[0] += k as f64 * NEIGHBOUR_SHIFT;
            }
            PathComparison(a, b)
        })
        .collect()
}

/// The question behind a panel's verdict; none if there is nothing to judge it by (one panel alone
/// of two that the claim compares).
fn question(picture: &Picture, index: usize) -> Option<AnyQuestion> {
    let panel = picture.panels.get(index)?;
    Some(match panel.claim? {
        Claim::Section(_) => Arc::new(Classification::of(panel.run.clone())),
        Claim::LessOrganisedThanNext | Claim::DiffersFromNext => {
            Arc::new(PathComparison(panel.run.clone(), picture.panels.get(index + 1)?.run.clone()))
        }
    })
}

/// Every question that a panel's judgement asks.
pub fn questions(picture: &Picture, index: usize) -> Vec<AnyQuestion> {
    let compared = match picture.panels.get(index).and_then(|panel| panel.claim) {
        Some(Claim::LessOrganisedThanNext) => neighbours(picture, index),
        _ => Vec::new(),
    };
    question(picture, index)
        .into_iter()
        .chain(compared.into_iter().map(|c| Arc::new(c) as _))
        .collect()
}

/// Judges every panel of a picture that a claim is made of.
///
/// # Errors
///
/// If a computation behind a verdict failed.
pub fn judge(picture: &Picture, executor: &dyn Ask) -> Result<Vec<PanelVerdict>, JobError> {
    let mut verdicts = Vec::new();
    for (i, panel) in picture.panels.iter().enumerate() {
        let (Some(claim), Some(question)) = (panel.claim, question(picture, i)) else { continue };
        let answer = executor.ask(&*question)?;
        let (grounds, found, agrees, because) = match claim {
            Claim::Section(claim) => {
                let evidence: Evidence = answer.fact("evidence")?;
                let score = claim.score(&evidence);
                (
                    Grounds::Section(Box::new(evidence.clone())),
                    evidence.summary,
                    score.agrees,
                    score.because,
                )
            }
            Claim::LessOrganisedThanNext => {
                let mut shares = [Vec::new(), Vec::new()];
                for comparison in neighbours(picture, i) {
                    let freshness: [f64; 2] = executor.ask(&comparison)?.fact("freshness")?;
                    shares.iter_mut().zip(freshness).for_each(|(all, one)| all.push(one));
                }
                let [(here, here_error), (next, next_error)] = shares.map(|s| mean(&s));
                let error = sqrt(here_error * here_error + next_error * next_error);
                let [p, q, dp, dq] = [here, next, here_error, next_error].map(|v| 100.0 * v);
                let found = format!(
                    "{p:.1} +- {dp:.1} % of the path enters unvisited cells (next panel {q:.1} +- \
                        {dq:.1} %; {NEIGHBOURS} shifted starts)"
                );
                let grounds = Grounds::Freshness {
                    mean: [here, next],
                    standard_error: [here_error, next_error],
                    runs: NEIGHBOURS,
                };
                (grounds, found.clone(), here - next > CLEARLY * error, found)
            }
            Claim::DiffersFromNext => {
                let (freshness, shared): ([f64; 2], Shared) =
                    (answer.fact("freshness")?, answer.fact("shared")?);
                let found = format!(
                    "the two paths have {:.0} % of their cells in common",
                    100.0 * shared.overlap
                );
                (
                    Grounds::Paths { freshness, shared },
                    found.clone(),
                    shared.overlap <= 1.0 - MARKED_DIFFERENCE,
                    found,
                )
            }
        };
        let next = picture.panels.get(i + 1).map_or("", |next| next.label.as_str());
        verdicts.push(PanelVerdict {
            picture: picture.name.clone(),
            reading: picture.reading_name().map(str::to_owned),
            panel: panel.label.clone(),
            method: panel.run.method.name.name().to_owned(),
            claim,
            claim_text: claim.text(&panel.label, next),
            found,
            agrees,
            because,
            evidence: grounds,
        });
    }
    Ok(verdicts)
}
