//! The answers: a verdict, and the evidence behind it as a record that can be written to a file.

use serde::{Deserialize, Serialize};

use super::Thresholds;
use crate::lyapunov::Exponent;

/// One dot of a periodic orbit's section.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct CyclePoint {
    /// Its place in the plane: the mean over the turns of the orbit's last window.
    pub u: [f64; 2],
    /// Whether the orbit crosses upwards here.
    pub upward: bool,
    /// Largest distance from that mean in the window.
    pub spread: f64,
}

/// An exponential rate from a straight-line fit to ln(distance).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Rate {
    /// Rate per unit time at which the distance shrinks; negative when it grows.
    pub per_time: f64,
    /// Its standard error from the scatter about the line.
    pub standard_error: f64,
    /// Start of the fitted stretch of time.
    pub from: f64,
    /// End of the fitted stretch of time.
    pub to: f64,
}

/// A closed orbit as the section shows it, and how the run came to it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Cycle {
    /// Points of one direction per turn: one for "period one", three for "period three".
    pub period: usize,
    /// All dots: first those of the counted direction in the order of the motion, then those of the
    /// other.
    pub points: Vec<CyclePoint>,
    /// Time for one turn.
    pub duration: f64,
    /// Mean distance of the last window's points from their dots.
    pub radius: f64,
    /// From this time on the run only turns around the cycle. Before it lies the transient; its
    /// length is this time minus the start.
    pub captured_at: f64,
    /// From this time on every point is within a dot's size of its centre, if that has happened.
    pub settled_at: Option<f64>,
    /// Rate at which the distance from the cycle shrinks, where it could be fitted.
    pub approach: Option<Rate>,
    /// Mean angle of the motion around the cycle per turn, in full circles, in (-1/2, 1/2]; absent
    /// when the points lie on a line or within rounding of the centre.
    pub rotation: Option<f64>,
}

/// The attractor of a run, judged from its section.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case")]
pub enum Verdict {
    /// A periodic orbit: at the end every phase is a dot.
    Periodic(Cycle),
    /// Still on its way to (or, with a negative rate, away from) a periodic orbit, around which it
    /// turns in a spiral.
    Spiralling(Cycle),
    /// Rings: regular, neither closing up nor approaching anything at a visible rate.
    QuasiPeriodic(Cycle),
    /// Irregular and deterministic.
    Chaotic {
        /// The largest exponent given with the question.
        lyapunov: Option<Exponent>,
        /// Number of separate pieces visited in turn.
        bands: usize,
    },
    /// The tests of regularity contradict each other, or the largest exponent is consistent with
    /// zero.
    Undecided {
        /// The largest exponent given with the question, with its error.
        lyapunov: Option<Exponent>,
    },
    /// Random.
    Noisy {
        /// Density contrast between the sea and the islands of noise-free runs; absent without a
        /// comparison.
        contrast: Option<super::Contrast>,
        /// The closed orbit around which the noise holds the run in small clouds, if it does.
        around: Option<Cycle>,
    },
    /// The orbit stopped crossing the section.
    Escaped {
        /// Its last crossing.
        last_crossing: f64,
    },
    /// Not enough points to decide.
    TooFew {
        /// Points of the more frequent direction.
        points: usize,
    },
}

impl Verdict {
    /// The verdict in a word, as tables show it.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Periodic(_) => "periodic",
            Self::Spiralling(_) => "spiralling",
            Self::QuasiPeriodic(_) => "quasi-periodic",
            Self::Chaotic { .. } => "chaotic",
            Self::Undecided { .. } => "undecided",
            Self::Noisy { .. } => "noisy",
            Self::Escaped { .. } => "escaped",
            Self::TooFew { .. } => "too-few",
        }
    }

    /// The closed orbit, for the verdicts that have one.
    pub fn cycle(&self) -> Option<&Cycle> {
        match self {
            Self::Periodic(c) | Self::Spiralling(c) | Self::QuasiPeriodic(c) => Some(c),
            Self::Noisy { around, .. } => around.as_ref(),
            _ => None,
        }
    }
}

impl std::fmt::Display for Verdict {
    /// One line for a table.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Periodic(c) => {
                write!(f, "period {}, captured at t = {:.0}", c.period, c.captured_at)?;
                match c.settled_at {
                    Some(t) => write!(f, ", settled at t = {t:.0}"),
                    None => Ok(()),
                }
            }
            Self::Spiralling(c) => {
                write!(
                    f,
                    "spiralling onto period {}, captured at t = {:.0}, not settled, radius {:.3}",
                    c.period, c.captured_at, c.radius
                )?;
                match c.approach {
                    Some(r) => write!(f, ", rate {:.1e}", r.per_time),
                    None => Ok(()),
                }
            }
            Self::QuasiPeriodic(c) => {
                write!(
                    f,
                    "quasi-periodic around period {} since t = {:.0}, radius {:.3}",
                    c.period, c.captured_at, c.radius
                )
            }
            Self::Chaotic { lyapunov: Some(l), .. } => {
                write!(f, "chaotic, largest exponent {:.4} +- {:.4}", l.value, l.standard_error)
            }
            Self::Chaotic { lyapunov: None, .. } => write!(f, "chaotic"),
            Self::Undecided { lyapunov: Some(l) } => {
                write!(f, "undecided, largest exponent {:.4} +- {:.4}", l.value, l.standard_error)
            }
            Self::Undecided { lyapunov: None } => write!(f, "undecided"),
            Self::Noisy { contrast, around } => {
                write!(f, "noisy")?;
                if let Some(c) = around {
                    write!(f, ", in clouds of radius {:.1e} around period {}", c.radius, c.period)?;
                }
                match contrast {
                    Some(c) => {
                        // A ratio of densities: "1109 % fuller" would not be understood.
                        let [value, low, high, free] =
                            [c.value, c.interval[1], c.interval[0], c.free[0]].map(|v| 1.0 - v);
                        write!(
                            f,
                            ", islands {value:.2} [{low:.2}, {high:.2}] times as dense as the sea, \
                                at most {free:.2} without noise"
                        )
                    }
                    None => Ok(()),
                }
            }
            Self::Escaped { last_crossing } => {
                write!(f, "left the section at t = {last_crossing:.0}")
            }
            Self::TooFew { points } => write!(f, "too few crossings ({points})"),
        }
    }
}

/// Everything a verdict rests on.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Evidence {
    /// The verdict.
    pub verdict: Verdict,
    /// [`Verdict::name`], so that a reader of the file needs no knowledge of the enum.
    pub name: String,
    /// [`Verdict`] as one line of text.
    pub summary: String,
    /// Crossings given.
    pub crossings: usize,
    /// Diagonal of the box around them; not a number if there are none.
    #[serde(deserialize_with = "number_or_none")]
    pub extent: f64,
    /// Mean time between crossings of one direction; not a number if there are fewer than two.
    #[serde(deserialize_with = "number_or_none")]
    pub return_time: f64,
    /// From this time on the picture shows points.
    pub shown_from: f64,
    /// The run changed its character after that: a picture of the shown part holds both.
    pub mixed: bool,
    /// Everything shown is in dots: the run had settled on its periodic orbit by then.
    pub dots_only: bool,
    /// K of the 0-1 test: near 0 regular, near 1 irregular. Of the captured part if there is one,
    /// else of the end.
    pub zero_one: Option<f64>,
    /// Divergence of nearest neighbours, per return and per unit time: the largest exponent
    /// estimated from the points alone.
    pub divergence: Option<super::Divergence>,
    /// The largest exponent given with the question.
    pub lyapunov: Option<Exponent>,
    /// The limits used.
    pub thresholds: Thresholds,
}

/// JSON has no not-a-number: it is written as null, and read from it.
fn number_or_none<'de, D: serde::Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
    Ok(Option::<f64>::deserialize(deserializer)?.unwrap_or(f64::NAN))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn verdicts_read_as_they_should() {
        let cycle = Cycle {
            period: 3,
            points: Vec::new(),
            duration: 6.0,
            radius: 0.25,
            captured_at: 120.4,
            settled_at: None,
            approach: None,
            rotation: None,
        };
        let settled = Cycle { settled_at: Some(250.0), ..cycle.clone() };
        let rate = Rate { per_time: 3e-5, standard_error: 1e-7, from: 0.0, to: 1.0 };
        let falling = Cycle { approach: Some(rate), ..cycle.clone() };
        let lyapunov = Some(Exponent { value: 0.5, standard_error: 0.0125, duration: 1e3 });
        let contrast = super::super::Contrast {
            value: 0.25,
            interval: [0.2, 0.3],
            free: [0.9, 0.95],
            free_runs: 3,
            island_share: 0.1,
            outside: 0.0,
            points: 1000,
        };
        for (verdict, text) in [
            (Verdict::Periodic(cycle.clone()), "period 3, captured at t = 120"),
            (Verdict::Periodic(settled), "period 3, captured at t = 120, settled at t = 250"),
            (
                Verdict::Spiralling(falling),
                "spiralling onto period 3, captured at t = 120, not settled, radius 0.250, rate \
                    3.0e-5",
            ),
            (
                Verdict::QuasiPeriodic(cycle.clone()),
                "quasi-periodic around period 3 since t = 120, radius 0.250",
            ),
            (Verdict::Chaotic { lyapunov, bands: 1 }, "chaotic, largest exponent 0.5000 +- 0.0125"),
            (Verdict::Undecided { lyapunov: None }, "undecided"),
            (
                Verdict::Noisy { contrast: None, around: Some(cycle) },
                "noisy, in clouds of radius 2.5e-1 around period 3",
            ),
            (
                Verdict::Noisy { contrast: Some(contrast), around: None },
                "noisy, islands 0.75 [0.70, 0.80] times as dense as the sea, at most 0.10 without \
                    noise",
            ),
            (Verdict::Escaped { last_crossing: 7.4 }, "left the section at t = 7"),
            (Verdict::TooFew { points: 12 }, "too few crossings (12)"),
        ] {
            assert_eq!(verdict.to_string(), text);
        }
    }
}
