//! Events at fixed times of a run: restarts and kicks.
//!
//! Noise and restarts are not kinds of system. They cut the time axis into segments; each segment
//! is integrated as if it were a run of its own, which is what a loop around a solver does.

use nalgebra::SVector;
use serde::{Deserialize, Serialize};

use twofold_num::elementary::sqrt;
use twofold_num::random::RandomStream;

/// The longest step a method may take.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum StepCap {
    /// No cap.
    #[default]
    None,
    /// A fixed length.
    Absolute(f64),
    /// A fraction of the segment between restarts or kicks: what some solvers call MaxStepFraction.
    FractionOfSegment(f64),
}

impl StepCap {
    /// The cap for a segment of the given length.
    pub fn for_segment(&self, length: f64) -> f64 {
        match *self {
            StepCap::None => f64::INFINITY,
            StepCap::Absolute(h) => h,
            StepCap::FractionOfSegment(f) => f * length,
        }
    }
}

/// The law of a random perturbation of a given size.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum KickLaw {
    /// Length exactly `size`, direction uniform on the sphere.
    #[default]
    Sphere,
    /// Each component uniform on [-size, size).
    Cube,
    /// Each component normal with standard deviation `size`.
    Normal,
}

/// Kicks after every fixed interval. They act on the first three components: a hysteretic phi is
/// not kicked.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Kick {
    /// Time between kicks.
    pub every: f64,
    /// Size of a kick.
    pub size: f64,
    /// Law of a kick.
    pub law: KickLaw,
    /// Seed of the generator (ChaCha8).
    pub seed: u64,
    /// Stream of the generator: one per run.
    pub stream: u64,
}

/// Restarts and kicks around a run.
///
/// ```
/// use twofold_integrate::{DriveOptions, Schedule};
/// // As DriveOptions::to, with the method restarted every 20 units of time.
/// let schedule = Schedule { restart_every: Some(20.0), kick: None };
/// let options = DriveOptions { schedule, ..DriveOptions::to(100.0) };
/// assert_eq!(options.t_end, 100.0);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Schedule {
    /// Time between restarts, at which the method forgets its history.
    pub restart_every: Option<f64>,
    /// Kicks at fixed intervals.
    pub kick: Option<Kick>,
}

/// A segment of the time axis: integrate to `end`, then perhaps kick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Segment {
    pub end: f64,
    pub kick: bool,
}

impl Schedule {
    /// The segments that cover (t_start, t_end]. Times are multiples of the intervals, not running
    /// sums.
    pub(super) fn segments(
        &self,
        t_start: f64,
        t_end: f64,
    ) -> impl Iterator<Item = Segment> + use<> {
        let restart = self.restart_every;
        let kick = self.kick.map(|k| k.every);
        let mut counts = (1_u64, 1_u64);
        let mut done = t_start >= t_end;
        std::iter::from_fn(move || {
            if done {
                return None;
            }
            let time = |interval: Option<f64>, count: u64| {
                interval.map_or(f64::INFINITY, |d| t_start + count as f64 * d)
            };
            let (restart_at, kick_at) = (time(restart, counts.0), time(kick, counts.1));
            let end = restart_at.min(kick_at).min(t_end);
            // 0.3 * 1000 and 100 * 3 are one moment, whatever their last bits say.
            let same = |at: f64| (at - end).abs() <= 1e-9 * end.abs().max(1.0);
            if same(restart_at) {
                counts.0 += 1;
            }
            let kicked = same(kick_at);
            if kicked {
                counts.1 += 1;
            }
            let end = if same(t_end) { t_end } else { end };
            done = end >= t_end;
            Some(Segment { end, kick: kicked && !done })
        })
    }
}

/// Draws the kicks of one run.
#[derive(Clone, Debug)]
pub struct Kicker {
    kick: Kick,
    /// Number of leading components that are kicked.
    states: usize,
    stream: RandomStream,
}

impl Kicker {
    /// The kicks that `kick` describes, from the first on, to the first `states` components of the
    /// state.
    pub fn new(kick: Kick, states: usize) -> Self {
        Self { kick, states, stream: RandomStream::new(kick.seed, kick.stream) }
    }

    /// The next perturbation.
    pub fn draw(&mut self) -> Vec<f64> {
        let (size, n) = (self.kick.size, self.states);
        let stream = &mut self.stream;
        match self.kick.law {
            KickLaw::Sphere if n == 3 => stream.direction().map(|c| c * size).to_vec(),
            KickLaw::Sphere => {
                // Independent normals have no preferred direction.
                let mut direction = vec![0.0; n];
                let mut length = 0.0_f64;
                while length == 0.0 && n > 0 {
                    direction.iter_mut().for_each(|c| *c = stream.normal());
                    length = sqrt(direction.iter().map(|c| c * c).sum());
                }
                direction.iter().map(|c| size * (c / length)).collect()
            }
            KickLaw::Cube => (0..n).map(|_| stream.uniform_in(-size, size)).collect(),
            KickLaw::Normal => (0..n).map(|_| size * stream.normal()).collect(),
        }
    }

    /// `x` perturbed in its leading components.
    pub fn apply<const N: usize>(&mut self, mut x: SVector<f64, N>) -> SVector<f64, N> {
        for (c, d) in x.iter_mut().zip(self.draw()) {
            *c += d;
        }
        x
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn restarts_and_kicks_share_moments() {
        let s = Schedule {
            restart_every: Some(0.9),
            kick: Some(Kick { every: 0.3, size: 1e-3, law: KickLaw::Sphere, seed: 1, stream: 0 }),
        };
        let segments: Vec<_> = s.segments(0.0, 1.5).collect();
        let ends: Vec<_> = segments.iter().map(|s| s.end).collect();
        assert_eq!(ends.len(), 5, "{ends:?}");
        assert!(segments[..4].iter().all(|s| s.kick) && !segments[4].kick);
        assert_eq!(ends[4], 1.5);
    }

    /// Every schedule of small whole numbers, in several units of time, against what the words say:
    /// a segment ends at each multiple of either interval and at the end, a kick follows where a
    /// multiple of the kick's interval is and the run goes on.
    #[test]
    fn every_small_schedule_is_what_the_words_say() {
        let mut seen = 0;
        for unit in [1.0, 0.1, 0.3, 1.0 / 3.0, 1e-6, 7e4] {
            for restart in 0..=9_u32 {
                for kick in 0..=9_u32 {
                    for length in 1..=24_u32 {
                        let interval = |n: u32| (n > 0).then(|| f64::from(n) * unit);
                        let schedule = Schedule {
                            restart_every: interval(restart),
                            kick: interval(kick).map(|every| Kick {
                                every,
                                size: 1.0,
                                law: KickLaw::Cube,
                                seed: 0,
                                stream: 0,
                            }),
                        };
                        let t_end = f64::from(length) * unit;
                        let is_multiple = |n: u32, of: u32| of > 0 && n.is_multiple_of(of);
                        let wanted: Vec<(u32, bool)> = (1..=length)
                            .filter(|n| {
                                is_multiple(*n, restart) || is_multiple(*n, kick) || *n == length
                            })
                            .map(|n| (n, is_multiple(n, kick) && n < length))
                            .collect();
                        let found: Vec<Segment> = schedule.segments(0.0, t_end).collect();
                        let what = format!(
                            "unit {unit}, restart {restart}, kick {kick}, length {length}: \
                                {found:?}"
                        );
                        assert_eq!(found.len(), wanted.len(), "{what}");
                        for (segment, (n, kick)) in found.iter().zip(wanted) {
                            assert!(
                                (segment.end - f64::from(n) * unit).abs()
                                    <= 1e-9 * segment.end.max(1.0),
                                "{what}"
                            );
                            assert_eq!(segment.kick, kick, "{what}");
                        }
                        assert_eq!(found.last().map(|s| s.end), Some(t_end), "{what}");
                        assert!(found.windows(2).all(|w| w[0].end < w[1].end), "{what}");
                        seen += 1;
                    }
                }
            }
        }
        assert_eq!(seen, 6 * 10 * 10 * 24);
        assert_eq!(Schedule::default().segments(1.0, 1.0).count(), 0, "no time, no segment");
    }

    #[test]
    fn no_schedule_is_one_segment() {
        let segments: Vec<_> = Schedule::default().segments(0.0, 150.0).collect();
        assert_eq!(segments, [Segment { end: 150.0, kick: false }]);
    }

    #[test]
    fn full_length_counts() {
        let kick = Kick { every: 0.3, size: 1e-3, law: KickLaw::Sphere, seed: 1, stream: 0 };
        let s = Schedule { restart_every: Some(100.0), kick: Some(kick) };
        let n = s.segments(0.0, 2e5).filter(|s| s.kick).count();
        assert_eq!(n, 666_666);
        assert_eq!(
            Schedule { restart_every: Some(20.0), kick: None }.segments(0.0, 2e5).count(),
            10_000
        );
    }

    #[test]
    fn sphere_kicks_have_the_size() {
        let mut k = Kicker::new(
            Kick { every: 0.3, size: 1e-3, law: KickLaw::Sphere, seed: 5, stream: 1 },
            3,
        );
        for _ in 0..100 {
            let d = k.draw();
            assert!((d.iter().map(|c| c * c).sum::<f64>().sqrt() - 1e-3).abs() < 1e-17);
        }
        for states in [1, 2, 8] {
            let mut k = Kicker::new(
                Kick { every: 0.3, size: 1e-3, law: KickLaw::Sphere, seed: 5, stream: 1 },
                states,
            );
            let mut mean = vec![0.0; states];
            for _ in 0..2000 {
                let d = k.draw();
                assert!((d.iter().map(|c| c * c).sum::<f64>().sqrt() - 1e-3).abs() < 1e-17);
                mean.iter_mut().zip(&d).for_each(|(m, d)| *m += d / 2000.0);
            }
            // No preferred direction: four standard errors of a component's mean.
            assert!(
                mean.iter().all(|m| m.abs() < 4.0 * 1e-3 / (2000.0_f64 * states as f64).sqrt()),
                "{mean:?}"
            );
        }
    }
}
