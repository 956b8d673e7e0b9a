//! The paper's claims, panel by panel, and whether they hold.
//!
//! A claim is what the paper says of a panel (its words are quoted). A verdict is what our run shows, with its evidence.
//! Whether they agree is decided by one rule per kind of claim, stated in [`SectionClaim::score`] and [`judge`]; no panel is judged by hand.

use std::sync::Arc;

use serde::{Deserialize, Serialize};

pub use super::claim::Claim as SectionClaim;
use super::{Picture, Reading};
use crate::analyse::attractor::Evidence;
use crate::analyse::divider::Shared;
use crate::job::{AnyQuestion, Classification, Desk, JobError, PathComparison};

/// What the paper says of a panel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Claim {
    /// About a section (figs 7-9).
    Section(SectionClaim),
    /// "Less organisation" than in the next panel (6(i) against 6(ii)).
    LessOrganisedThanNext,
    /// "Changes in structure sensitive to random noise": this panel and the next differ (6(iii), 6(iv)).
    DiffersFromNext,
}

/// Two paths "differ markedly" when a quarter or more of their strides end where the other never comes.
pub const MARKED_DIFFERENCE: f64 = 0.25;

/// A panel's verdict: claim, evidence, agreement.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PanelVerdict {
    /// The picture's name.
    pub picture: String,
    /// The figure's reading.
    pub reading: Option<Reading>,
    /// The panel's label.
    pub panel: String,
    /// The method.
    pub method: String,
    /// What the paper says.
    pub claim: Claim,
    /// In its words, or nearly.
    pub claim_text: String,
    /// What was found, in one line.
    pub found: String,
    /// Whether they agree.
    pub agrees: bool,
    /// Why, or with what reservation.
    pub because: String,
    /// What the finding rests on.
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
        /// What they share.
        shared: Shared,
    },
}

impl Claim {
    /// The claim in words.
    pub fn text(self) -> String {
        match self {
            Claim::Section(claim) => claim.to_string(),
            Claim::LessOrganisedThanNext => "less organised than (ii)".into(),
            Claim::DiffersFromNext => "(iii) and (iv) differ".into(),
        }
    }
}

/// The question behind a panel's verdict; none if there is nothing to judge it by (one panel alone of two that the claim compares).
pub fn question(picture: &Picture, index: usize) -> Option<AnyQuestion> {
    let panel = picture.panels.get(index)?;
    Some(match panel.claim? {
        Claim::Section(_) => Arc::new(Classification::of(panel.run.clone())),
        Claim::LessOrganisedThanNext | Claim::DiffersFromNext => {
            Arc::new(PathComparison(panel.run.clone(), picture.panels.get(index + 1)?.run.clone()))
        }
    })
}

/// Judges every panel of a picture that a claim is made of.
///
/// # Errors
///
/// If a computation behind a verdict failed.
pub fn judge(picture: &Picture, desk: &Desk<'_>) -> Result<Vec<PanelVerdict>, JobError> {
    let mut verdicts = Vec::new();
    for (i, panel) in picture.panels.iter().enumerate() {
        let (Some(claim), Some(question)) = (panel.claim, question(picture, i)) else { continue };
        let answer = desk.ask(&*question)?;
        let (grounds, found, agrees, because) = match claim {
            Claim::Section(claim) => {
                let evidence: Evidence = answer.fact("evidence")?;
                let score = claim.score(&evidence);
                (Grounds::Section(Box::new(evidence.clone())), evidence.summary, score.agrees, score.because)
            }
            Claim::LessOrganisedThanNext | Claim::DiffersFromNext => {
                let (freshness, shared): ([f64; 2], Shared) = (answer.fact("freshness")?, answer.fact("shared")?);
                let (found, agrees) = if claim == Claim::LessOrganisedThanNext {
                    let [here, next] = freshness.map(|f| 100.0 * f);
                    let found = format!("{here:.0} % of its way leads to new places, {next:.0} % in the next panel");
                    (found, freshness[0] > freshness[1])
                } else {
                    let found = format!("the two share {:.0} % of their places", 100.0 * shared.overlap);
                    (found, shared.overlap <= 1.0 - MARKED_DIFFERENCE)
                };
                (Grounds::Paths { freshness, shared }, found.clone(), agrees, found)
            }
        };
        verdicts.push(PanelVerdict {
            picture: picture.name.clone(),
            reading: picture.reading,
            panel: panel.label.clone(),
            method: panel.run.method.name.name().to_owned(),
            claim,
            claim_text: claim.text(),
            found,
            agrees,
            because,
            evidence: grounds,
        });
    }
    Ok(verdicts)
}
