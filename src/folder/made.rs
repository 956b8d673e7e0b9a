//! Results of making a paper: pictures' records and scored claims.

use super::check::{Claim, Verdict};
use crate::job::JobError;
use crate::paper::pipeline::PictureRecord;
use crate::paper::verdict::PanelVerdict;

/// The result of a claim: a verdict, or the reason why there is none.
#[derive(Debug)]
pub struct Scored<'a> {
    /// The claim.
    pub claim: &'a Claim,
    /// Its verdict.
    pub verdict: Result<Verdict, JobError>,
}

/// Everything that was made.
#[derive(Debug)]
pub struct Made<'a> {
    /// The pictures' records, in the figures' order.
    pub pictures: Vec<PictureRecord>,
    /// The claims with their verdicts.
    pub claims: Vec<Scored<'a>>,
}

impl Made<'_> {
    /// The claims of panels (`says`), and whether they hold.
    pub fn panels(&self) -> impl Iterator<Item = &PanelVerdict> {
        self.pictures.iter().flat_map(|p| &p.verdicts)
    }

    /// Claims that hold, and all of them, those of panels among them.
    pub fn score(&self) -> (usize, usize) {
        let claims = self.claims.iter().map(|s| s.verdict.as_ref().is_ok_and(|v| v.agrees));
        let all: Vec<bool> = claims.chain(self.panels().map(|v| v.agrees)).collect();
        (all.iter().filter(|holds| **holds).count(), all.len())
    }

    /// The first claim that could not be scored.
    pub fn failure(&self) -> Option<(&str, &JobError)> {
        self.claims.iter().find_map(|s| Some((s.claim.id.as_str(), s.verdict.as_ref().err()?)))
    }
}

/// The word for an outcome.
pub fn outcome(agrees: bool) -> &'static str {
    if agrees { "agrees" } else { "differs" }
}
