//! Exit rules: how repelling sliding ends, which Filippov's equation leaves open.

use serde::{Deserialize, Serialize};

use twofold_num::elementary::ln;
use twofold_num::random::RandomStream;

/// A side of the switching surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Side {
    /// h > 0, where f+ holds.
    Plus,
    /// h < 0, where f- holds.
    Minus,
}

impl Side {
    /// +1 or -1: the sign of h.
    pub fn sign(self) -> f64 {
        match self {
            Side::Plus => 1.0,
            Side::Minus => -1.0,
        }
    }
    /// The other side.
    pub fn other(self) -> Self {
        match self {
            Side::Plus => Side::Minus,
            Side::Minus => Side::Plus,
        }
    }
}

/// Law of the random time spent in repelling sliding.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum SlidingLaw {
    /// Uniform on [0, longest).
    Uniform {
        /// The upper end of the interval.
        longest: f64,
    },
    /// Exponential: at every moment the same chance of being thrown off.
    Exponential {
        /// The mean time.
        mean: f64,
    },
}

impl SlidingLaw {
    /// A time from `u`, uniform on [0, 1).
    fn time(&self, u: f64) -> f64 {
        match *self {
            SlidingLaw::Uniform { longest } => longest * u,
            SlidingLaw::Exponential { mean } => -mean * ln(1.0 - u),
        }
    }
}

/// The rule by which an orbit leaves repelling sliding.
///
/// In the repelling region sliding may end at any moment, to either side: Filippov's equation has
/// all these solutions (Filippov 1988, sec. 10), and a passage through a two-fold puts every orbit
/// there. The rule says which one is followed. Nothing is chosen silently: without a rule a run
/// ends where one is needed, and each departure is an event that names the rule with the time and
/// the side it gave. Out of a two-fold the orbit slides along the analytic invariant curve, the
/// smooth continuation of the way in (see [`two_fold`](super::two_fold)); every point of the
/// repelling region lies on some other sliding orbit out of the same two-fold, which
/// [`history`](super::history) finds. Whatever the rule says, an orbit that comes to the edge of
/// the repelling region (an invisible fold) leaves there, to the one side on which the field points
/// away.
///
/// ```
/// use twofold_integrate::filippov::{ExitRule, Side};
/// let rule = ExitRule::AfterTime { time: 0.3, side: Side::Minus };
/// assert_eq!(rule.to_string(), "after-time:0.3:minus");
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum ExitRule {
    /// At once. From a point of the repelling region: without sliding. At a two-fold where the fold
    /// of that side is visible: along the tangent orbit. Where it is invisible no orbit of that
    /// side starts at the two-fold itself; the orbit then leaves sliding at
    /// [`FilippovOptions::departure`](super::FilippovOptions::departure) of the two-fold's radius,
    /// the shortest sliding that is resolved.
    AtOnce {
        /// The side to leave to.
        side: Side,
    },
    /// After a given time of repelling sliding; 0 is [`ExitRule::AtOnce`] without the tangent
    /// orbit. At a two-fold, times below a millionth of the shortest departure are raised to that:
    /// nearer to it the two sides cannot be told apart. The event records the time that was used.
    AfterTime {
        /// The time.
        time: f64,
        /// The side to leave to.
        side: Side,
    },
    /// After a given length of path in repelling sliding (Euclidean, in the state's own units).
    AfterArc {
        /// The length.
        arc: f64,
        /// The side to leave to.
        side: Side,
    },
    /// After a random time to a random side, both drawn from the generator `num::random` (ChaCha8)
    /// at the moment when repelling sliding starts: first the time, then the side.
    Random {
        /// Law of the time.
        law: SlidingLaw,
        /// Probability of leaving to h > 0.
        plus_probability: f64,
        /// Seed of the generator.
        seed: u64,
        /// Stream of the generator: one per run.
        stream: u64,
    },
    /// No rule: a run goes on as long as none is needed, and ends with
    /// [`FilippovError::Undecided`](super::FilippovError::Undecided) where one is.
    Undecided,
    /// No choice: a run stops at the first set-valued point. [`funnel`](super::funnel) then follows
    /// the whole family.
    All,
}

impl std::fmt::Display for ExitRule {
    /// As it is written in words: "after-time:0.3:minus".
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let word = |side: &Side| if *side == Side::Plus { "plus" } else { "minus" };
        match self {
            ExitRule::AtOnce { side } => write!(f, "at-once:{}", word(side)),
            ExitRule::AfterTime { time, side } => write!(f, "after-time:{time:?}:{}", word(side)),
            ExitRule::AfterArc { arc, side } => write!(f, "after-arc:{arc:?}:{}", word(side)),
            ExitRule::Random {
                law: SlidingLaw::Exponential { mean }, plus_probability, ..
            } => {
                write!(
                    f,
                    "random:exponential:{mean:?}, to h > 0 with probability {plus_probability:?}"
                )
            }
            ExitRule::Random { law: SlidingLaw::Uniform { longest }, plus_probability, .. } => {
                write!(
                    f,
                    "random:uniform:{longest:?}, to h > 0 with probability {plus_probability:?}"
                )
            }
            ExitRule::Undecided => write!(f, "undecided"),
            ExitRule::All => write!(f, "all"),
        }
    }
}

impl ExitRule {
    /// Checks the rule's numbers.
    ///
    /// # Errors
    ///
    /// A message that names the wrong number and its allowed range.
    pub fn validate(&self) -> Result<(), String> {
        let positive = |name: &str, v: f64| {
            if v.is_finite() && v >= 0.0 {
                Ok(())
            } else {
                Err(format!("the exit rule's {name} must be a finite number not below 0, not {v}"))
            }
        };
        match *self {
            ExitRule::AtOnce { .. } | ExitRule::Undecided | ExitRule::All => Ok(()),
            ExitRule::AfterTime { time, .. } => positive("time", time),
            ExitRule::AfterArc { arc, .. } => positive("arc", arc),
            ExitRule::Random { law, plus_probability, .. } => {
                match law {
                    SlidingLaw::Uniform { longest } => positive("longest time", longest)?,
                    SlidingLaw::Exponential { mean } => positive("mean time", mean)?,
                }
                if (0.0..=1.0).contains(&plus_probability) {
                    Ok(())
                } else {
                    Err(format!(
                        "the exit rule's probability of the plus side must lie between 0 and 1, \
                            not {plus_probability}"
                    ))
                }
            }
        }
    }
}

/// The decision of a rule about one stretch of repelling sliding.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct ExitPlan {
    pub side: Side,
    pub time: f64,
    pub arc: f64,
    pub at_once: bool,
}

/// A rule at work: the rule with its generator.
#[derive(Clone, Debug)]
pub(super) struct Chooser {
    pub rule: ExitRule,
    stream: Option<RandomStream>,
}

impl Chooser {
    pub fn new(rule: ExitRule) -> Self {
        let stream = match rule {
            ExitRule::Random { seed, stream, .. } => Some(RandomStream::new(seed, stream)),
            _ => None,
        };
        Self { rule, stream }
    }

    /// The plan for the stretch that starts now; `None` for `Undecided` and `All`.
    pub fn plan(&mut self) -> Option<ExitPlan> {
        let never = f64::INFINITY;
        match self.rule {
            ExitRule::AtOnce { side } => {
                Some(ExitPlan { side, time: 0.0, arc: never, at_once: true })
            }
            ExitRule::AfterTime { time, side } => {
                Some(ExitPlan { side, time, arc: never, at_once: false })
            }
            ExitRule::AfterArc { arc, side } => {
                Some(ExitPlan { side, time: never, arc, at_once: false })
            }
            ExitRule::Random { law, plus_probability, .. } => {
                let stream = self.stream.as_mut()?;
                let time = law.time(stream.uniform());
                let side =
                    if stream.uniform() < plus_probability { Side::Plus } else { Side::Minus };
                Some(ExitPlan { side, time, arc: never, at_once: false })
            }
            ExitRule::Undecided | ExitRule::All => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn laws_have_their_means() {
        let mut stream = RandomStream::new(1, 0);
        let n = 20_000;
        let (mut uniform, mut exponential) = (0.0, 0.0);
        for _ in 0..n {
            uniform += SlidingLaw::Uniform { longest: 3.0 }.time(stream.uniform()) / f64::from(n);
            exponential +=
                SlidingLaw::Exponential { mean: 0.7 }.time(stream.uniform()) / f64::from(n);
        }
        // Five standard errors: 3/sqrt(12 n) and 0.7/sqrt(n).
        assert!(
            (uniform - 1.5).abs() < 0.031 && (exponential - 0.7).abs() < 0.025,
            "{uniform} {exponential}"
        );
    }
}
