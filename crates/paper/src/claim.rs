//! The paper's claims about its sections, and whether a verdict supports one.

use serde::{Deserialize, Serialize};

use twofold_analyse::attractor::{Evidence, Verdict};

/// The paper's claim about a section.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Claim {
    /// A periodic orbit with this many points of one direction: 1 for "periodic", 3 for "period
    /// three".
    Period(usize),
    /// A periodic orbit of whatever period.
    Periodic,
    /// Chaos.
    Chaos,
    /// Noise over an attractor, "only some of which is washed out".
    PartlyWashedOut,
}

/// A claim compared with a verdict.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Score {
    /// The claim.
    pub claim: Claim,
    /// Whether the verdict supports it.
    pub agrees: bool,
    /// Why, or with what reservation.
    pub because: String,
}

impl std::fmt::Display for Claim {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Period(1) => write!(f, "periodic"),
            Self::Period(k) => write!(f, "period {k}"),
            Self::Periodic => write!(f, "periodic"),
            Self::Chaos => write!(f, "chaos"),
            Self::PartlyWashedOut => write!(f, "structure partly washed out by noise"),
        }
    }
}

impl Claim {
    /// Holds the claim against what was found. The rules, the same for every panel:
    ///
    /// - a period agrees with that period, reached or still being approached, if the whole of the
    ///   shown part follows it;
    /// - chaos agrees with chaos and nothing else: not with a picture whose chaos ended in the
    ///   shown part;
    /// - "partly washed out" agrees with noise that leaves the islands of noise-free runs emptier
    ///   than the sea, but not as empty as noise-free runs leave them
    ///   ([`Contrast`](twofold_analyse::attractor::Contrast), whole interval), and that does not
    ///   merely hold the run around a closed orbit.
    pub fn score(self, evidence: &Evidence) -> Score {
        let (agrees, because) = match (self, &evidence.verdict) {
            (Self::Period(k), Verdict::Periodic(c) | Verdict::Spiralling(c)) if c.period != k => {
                (false, format!("the run ends on period {}, not {k}", c.period))
            }
            (Self::Period(_) | Self::Periodic, Verdict::Periodic(c) | Verdict::Spiralling(c))
                if evidence.mixed =>
            {
                (
                    false,
                    format!(
                        "the period is right, but the shown part is irregular until t = \
                    {:.0}",
                        c.captured_at
                    ),
                )
            }
            (Self::Period(_) | Self::Periodic, Verdict::Spiralling(c))
                if c.approach.is_some_and(|r| r.per_time < 0.0) =>
            {
                (false, "the run turns around this orbit and moves away from it".to_owned())
            }
            (Self::Period(_) | Self::Periodic, Verdict::Periodic(_)) if evidence.dots_only => {
                (true, "dots and nothing else".to_owned())
            }
            (Self::Period(_) | Self::Periodic, Verdict::Periodic(_) | Verdict::Spiralling(_)) => {
                (true, "still approaching in the shown part: discs, not dots".to_owned())
            }
            (Self::Chaos, Verdict::Chaotic { .. }) => (true, evidence.summary.clone()),
            (Self::Chaos, v) if evidence.mixed && v.cycle().is_some() => (
                false,
                format!(
                    "chaos only as a transient that reaches into the shown part; \
                    {}",
                    evidence.summary
                ),
            ),
            (Self::PartlyWashedOut, Verdict::Noisy { around: Some(_), .. }) => {
                (false, format!("no attractor is left to be washed out: {}", evidence.summary))
            }
            (Self::PartlyWashedOut, Verdict::Noisy { contrast: Some(c), .. }) => {
                let th = &evidence.thresholds;
                let (left, touched) =
                    (c.interval[0] > th.washed_out, c.interval[1] < th.untouched.min(c.free[0]));
                (left && touched, evidence.summary.clone())
            }
            (Self::PartlyWashedOut, Verdict::Noisy { contrast: None, .. }) => (
                false,
                "noise-free runs show no islands in a sea, so there is nothing that could be \
                    washed out"
                    .to_owned(),
            ),
            _ => (false, evidence.summary.clone()),
        };
        Score { claim: self, agrees, because }
    }
}
