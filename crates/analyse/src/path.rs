//! The path of a run as a polyline that follows the dense output.

use nalgebra::SVector;

use twofold_integrate::{Extents, Flow, Observer, Step};

/// A point of a path: time and the state of a system with `D` states.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample<const D: usize = 3> {
    /// Time.
    pub t: f64,
    /// State; the hysteretic phi is not part of it.
    pub x: [f64; D],
}

/// Records a path: every accepted step's ends, and between them as many points of the interpolant
/// as it takes for the polyline to stay within `chord` of it. Of a state with more components, the
/// first `D` are kept and looked at.
///
/// ```
/// # use nalgebra::{SVector, Vector2};
/// # use twofold_integrate::{DriveOptions, Dopri5, Tolerance, drive};
/// # use twofold_num::Elementary;
/// # use twofold_system::VectorField;
/// # struct Oscillator;
/// # impl VectorField<2> for Oscillator {
/// #     fn eval<S: Elementary>(&self, x: &SVector<S, 2>) -> SVector<S, 2> {
/// #         Vector2::new(x[1], -x[0])
/// #     }
/// # }
/// # let mut method = Dopri5::new(Tolerance { rtol: 1e-9, atol: 1e-9 });
/// # let x0 = Vector2::new(1.0, 0.0);
/// use twofold_analyse::PathRecorder;
/// // x'' = -x from (1, 0); both states are kept.
/// let mut path = PathRecorder::<2>::new(&x0, 1e-3);
/// let to = DriveOptions::to(6.0);
/// let _ = drive(&Oscillator, x0, &to, &mut method, &mut path, &())?;
/// let samples = path.into_samples();
/// assert!(samples.iter().all(|s| (s.x[0].hypot(s.x[1]) - 1.0).abs() < 1e-6));
/// # Ok::<(), twofold_integrate::Failure>(())
/// ```
#[derive(Clone, Debug)]
pub struct PathRecorder<const D: usize = 3> {
    chord: f64,
    extents: Extents,
    most: usize,
    samples: Vec<Sample<D>>,
}

/// Maximum number of points of a recorder: 0.6 GB in memory, and about 1.5 GB more while they are
/// written as text. A full recorder stops the run.
pub const MOST_POINTS: usize = 20_000_000;

/// Halvings of one step: a bound against wild interpolants, far above what a tolerance of 1e-4 asks
/// for.
const MOST_HALVINGS: u32 = 10;

impl<const D: usize> PathRecorder<D> {
    /// A recorder that starts at `x0`; `chord` is the largest distance between polyline and
    /// interpolant, in the state's units, where they are compared: at the thirds of a step and the
    /// middles of its parts. Elsewhere it may be somewhat larger; a third of a step whose middle
    /// alone lies on its chord, an S, passes for straight.
    pub fn new<const N: usize>(x0: &SVector<f64, N>, chord: f64) -> Self {
        Self::starting(0.0, x0, chord)
    }

    /// A recorder that starts at time `t`.
    pub fn starting<const N: usize>(t: f64, x: &SVector<f64, N>, chord: f64) -> Self {
        let samples = vec![Sample { t, x: leading(x) }];
        Self { chord, extents: Extents::default(), most: MOST_POINTS, samples }
    }

    /// Keeps nearer to the small ones of states with these extents, which grow with the path.
    pub fn over(mut self, extents: Extents) -> Self {
        self.extents = extents;
        self
    }

    /// The extents of states as far as it knows them.
    pub(crate) fn known(&self) -> &Extents {
        &self.extents
    }

    /// Extents of the path so far.
    pub fn extents(&self) -> Extents {
        Extents::of((0..D).map(|i| self.samples.iter().map(move |s| s.x[i])))
    }

    /// Stops the run at `points` points instead of [`MOST_POINTS`]; the last step is recorded
    /// whole.
    pub fn at_most(mut self, points: usize) -> Self {
        self.most = points;
        self
    }

    /// Number of points that are kept now.
    #[allow(clippy::len_without_is_empty)] // a recorder begins with a point
    pub fn len(&self) -> usize {
        self.samples.len()
    }

    /// The points that are kept now.
    pub(crate) fn samples(&self) -> &[Sample<D>] {
        &self.samples
    }

    /// The path.
    pub fn into_samples(self) -> Vec<Sample<D>> {
        self.samples
    }

    /// Takes the path so far and clears the recorder; recording continues as if the points were
    /// still there.
    pub fn take(&mut self) -> Vec<Sample<D>> {
        std::mem::take(&mut self.samples)
    }

    fn chord_of(&self, state: usize) -> f64 {
        self.extents.chord(state, self.chord)
    }

    /// Adds interior points of `step` between the fractions `a` and `b` where the chord misses the
    /// curve.
    fn refine<const N: usize>(
        &mut self,
        step: &Step<'_, N>,
        a: (f64, [f64; D]),
        b: (f64, [f64; D]),
        halvings: u32,
    ) {
        if halvings == 0 {
            return;
        }
        let middle = 0.5 * (a.0 + b.0);
        let x = leading(&step.at(middle));
        let misses = |i: usize| (x[i] - 0.5 * (a.1[i] + b.1[i])).abs() > self.chord_of(i);
        if (0..D).any(misses) {
            self.refine(step, a, (middle, x), halvings - 1);
            self.samples.push(Sample { t: step.time(middle), x });
            self.refine(step, (middle, x), b, halvings - 1);
        }
    }
}

impl<const N: usize, const D: usize> Observer<N> for PathRecorder<D> {
    fn step(&mut self, step: &Step<'_, N>) -> Flow {
        // Thirds first: one midpoint test would accept an S-shaped step whose middle lies on the
        // chord.
        let knots = [0.0, 1.0 / 3.0, 2.0 / 3.0, 1.0].map(|s| (s, leading(&step.at(s))));
        let (start, end) = (knots[0].1, knots[3].1);
        knots[1..].iter().for_each(|(_, x)| self.extents.reach(x));
        let straight = knots[1..3].iter().all(|(s, x)| {
            (0..D).all(|i| (x[i] - (start[i] + s * (end[i] - start[i]))).abs() <= self.chord_of(i))
        });
        if !straight {
            for pair in knots.windows(2) {
                self.refine(step, pair[0], pair[1], MOST_HALVINGS);
                if pair[1].0 < 1.0 {
                    self.samples.push(Sample { t: step.time(pair[1].0), x: pair[1].1 });
                }
            }
        }
        self.samples.push(Sample { t: step.t1, x: end });
        if self.samples.len() < self.most { Flow::Continue } else { Flow::Stop }
    }

    fn kick(&mut self, t: f64, _before: &SVector<f64, N>, after: &SVector<f64, N>) {
        self.samples.push(Sample { t, x: leading(after) });
    }
}

/// Records the state at the multiples of an interval, on the dense output. Times are multiples, not
/// running sums. After a kick at such a moment the state is the one before it.
///
/// ```
/// # use nalgebra::{SVector, Vector2};
/// # use twofold_integrate::{DriveOptions, Dopri5, Tolerance, drive};
/// # use twofold_num::Elementary;
/// # use twofold_system::VectorField;
/// # struct Oscillator;
/// # impl VectorField<2> for Oscillator {
/// #     fn eval<S: Elementary>(&self, x: &SVector<S, 2>) -> SVector<S, 2> {
/// #         Vector2::new(x[1], -x[0])
/// #     }
/// # }
/// # let mut method = Dopri5::new(Tolerance { rtol: 1e-9, atol: 1e-9 });
/// # let x0 = Vector2::new(1.0, 0.0);
/// use twofold_analyse::TimesRecorder;
/// // x'' = -x from (1, 0), at t = 0, 0.5, ..., 6.
/// let mut times = TimesRecorder::<2>::new(&x0, 0.5);
/// let to = DriveOptions::to(6.0);
/// let _ = drive(&Oscillator, x0, &to, &mut method, &mut times, &())?;
/// assert_eq!(times.into_samples().len(), 13);
/// # Ok::<(), twofold_integrate::Failure>(())
/// ```
#[derive(Clone, Debug)]
pub struct TimesRecorder<const D: usize = 3> {
    every: f64,
    next: u64,
    most: usize,
    samples: Vec<Sample<D>>,
}

impl<const D: usize> TimesRecorder<D> {
    /// A recorder that begins with `x0` at time 0.
    pub fn new<const N: usize>(x0: &SVector<f64, N>, every: f64) -> Self {
        Self { every, next: 1, most: MOST_POINTS, samples: vec![Sample { t: 0.0, x: leading(x0) }] }
    }

    /// Stops when it has so many samples, instead of [`MOST_POINTS`], also within a step: given the
    /// same step again once they are taken away, it goes on in it.
    pub fn at_most(mut self, samples: usize) -> Self {
        self.most = samples;
        self
    }

    /// Whether a sample up to time `t` is not recorded yet.
    pub fn is_behind(&self, t: f64) -> bool {
        self.time() <= t
    }

    /// Time of the next sample.
    fn time(&self) -> f64 {
        self.next as f64 * self.every
    }

    /// The first of the interval's multiples that is not recorded yet, where it lies in this step.
    fn due<const N: usize>(&mut self, step: &Step<'_, N>) -> Option<Sample<D>> {
        let t = self.time();
        if t > step.t1 {
            return None;
        }
        self.next += 1;
        let length = step.length();
        let theta = if length > 0.0 { ((t - step.t0) / length).clamp(0.0, 1.0) } else { 1.0 };
        Some(Sample { t, x: leading(&step.at(theta)) })
    }

    /// The samples.
    pub fn into_samples(self) -> Vec<Sample<D>> {
        self.samples
    }

    /// Takes the samples so far and clears the recorder.
    pub fn take(&mut self) -> Vec<Sample<D>> {
        std::mem::take(&mut self.samples)
    }

    /// Number of samples that are kept now.
    #[allow(clippy::len_without_is_empty)]
    pub fn len(&self) -> usize {
        self.samples.len()
    }

    /// Takes in a step, and says how many samples came of it.
    pub(super) fn record<const N: usize>(&mut self, step: &Step<'_, N>) -> usize {
        let before = self.samples.len();
        while self.samples.len() < self.most
            && let Some(sample) = self.due(step)
        {
            self.samples.push(sample);
        }
        self.samples.len() - before
    }
}

impl<const N: usize, const D: usize> Observer<N> for TimesRecorder<D> {
    fn step(&mut self, step: &Step<'_, N>) -> Flow {
        self.record(step);
        if self.samples.len() < self.most { Flow::Continue } else { Flow::Stop }
    }
}

/// The first `D` components; missing ones are zero.
pub(crate) fn leading<const N: usize, const D: usize>(x: &SVector<f64, N>) -> [f64; D] {
    std::array::from_fn(|i| if i < N { x[i] } else { 0.0 })
}

#[cfg(test)]
mod tests {
    use super::*;
    use twofold_integrate::Interpolant;

    /// A half circle in one step.
    struct HalfCircle;
    impl Interpolant<3> for HalfCircle {
        fn at(&self, s: f64) -> SVector<f64, 3> {
            use twofold_num::elementary::{cos, sin};
            let a = std::f64::consts::PI * s;
            SVector::from([cos(a), sin(a), 0.0])
        }
        fn degree(&self) -> usize {
            8
        }
    }

    #[test]
    fn polyline_stays_near_the_curve() {
        let step = Step {
            t0: 0.0,
            t1: 1.0,
            x0: HalfCircle.at(0.0),
            x1: HalfCircle.at(1.0),
            interpolant: &HalfCircle,
        };
        let mut r = PathRecorder::<3>::new(&step.x0, 1e-3);
        r.step(&step);
        let samples = r.into_samples();
        assert!(samples.windows(2).all(|w| w[0].t < w[1].t));
        for w in samples.windows(2) {
            let m: Vec<f64> = (0..2).map(|i| 0.5 * (w[0].x[i] + w[1].x[i])).collect();
            assert!(1.0 - (m[0] * m[0] + m[1] * m[1]).sqrt() < 2e-3, "{w:?}");
        }
        assert!(samples.len() < 200);
    }

    #[test]
    fn samples_lie_at_multiples() {
        let step = |t0: f64, t1: f64| Step {
            t0,
            t1,
            x0: HalfCircle.at(0.0),
            x1: HalfCircle.at(1.0),
            interpolant: &HalfCircle,
        };
        let mut r = TimesRecorder::<3>::new(&HalfCircle.at(0.0), 0.1);
        for (a, b) in [(0.0, 0.25), (0.25, 0.27), (0.27, 1.0)] {
            assert_eq!(r.step(&step(a, b)), Flow::Continue);
        }
        let samples = r.into_samples();
        let times: Vec<f64> = samples.iter().map(|s| s.t).collect();
        assert_eq!(times, (0..=10).map(|k| f64::from(k) * 0.1).collect::<Vec<_>>());
        // 0.2 is four fifths into the first step.
        assert_eq!(samples[2].x, <[f64; 3]>::from(HalfCircle.at(0.2 / 0.25)));
        assert_eq!(samples[10].x, <[f64; 3]>::from(HalfCircle.at(1.0)));
    }

    /// Taken away a few at a time, also within a step, the samples are those of one who keeps them
    /// all.
    #[test]
    fn a_recorder_of_few_samples_goes_on_within_a_step() {
        let steps = [(0.0, 0.25), (0.25, 0.27), (0.27, 1.0)].map(|(t0, t1)| Step {
            t0,
            t1,
            x0: HalfCircle.at(0.0),
            x1: HalfCircle.at(1.0),
            interpolant: &HalfCircle,
        });
        let mut whole = TimesRecorder::<3>::new(&HalfCircle.at(0.0), 0.01);
        let mut few = whole.clone().at_most(4);
        let mut taken = Vec::new();
        for step in &steps {
            assert_eq!(whole.step(step), Flow::Continue);
            while few.step(step) == Flow::Stop || few.is_behind(step.t1) {
                assert_eq!(few.len(), 4);
                taken.extend(few.take());
            }
        }
        taken.extend(few.take());
        assert_eq!((taken.len(), taken), (101, whole.into_samples()));
    }

    #[test]
    fn a_full_recorder_stops_the_run() {
        let step = Step {
            t0: 0.0,
            t1: 1.0,
            x0: HalfCircle.at(0.0),
            x1: HalfCircle.at(1.0),
            interpolant: &HalfCircle,
        };
        let mut r: PathRecorder = PathRecorder::new(&step.x0, 1e-300).at_most(10_000);
        let steps = (1..100).find(|_| r.step(&step) == Flow::Stop).unwrap();
        // No chord is small enough for a step to make more than 3 * 2^10 points of it.
        let per_step = 3 * (1 << MOST_HALVINGS);
        assert!(
            steps >= 3 && (10_000..10_000 + per_step).contains(&r.len()),
            "{steps} steps, {} points",
            r.len()
        );
    }

    /// y and z as functions of x = s in (0, 1).
    struct Graph(fn(f64) -> [f64; 2]);
    impl Interpolant<3> for Graph {
        fn at(&self, s: f64) -> SVector<f64, 3> {
            let [y, z] = self.0(s);
            SVector::from([s, y, z])
        }
        fn degree(&self) -> usize {
            8
        }
    }

    fn recorded(graph: &Graph, chord: f64) -> Vec<Sample> {
        let step =
            Step { t0: 2.0, t1: 4.0, x0: graph.at(0.0), x1: graph.at(1.0), interpolant: graph };
        let mut r = PathRecorder::<3>::starting(2.0, &step.x0, chord);
        assert_eq!(r.step(&step), Flow::Continue);
        r.into_samples()
    }

    #[test]
    fn a_straight_step_needs_no_points_between() {
        let line = Graph(|s| [3.0 - 7.0 * s, 5.0 + 2.0 * s]);
        let samples = recorded(&line, 1e-9);
        assert_eq!(
            samples,
            [(2.0, 0.0), (4.0, 1.0)].map(|(t, s)| Sample { t, x: line.at(s).into() })
        );
    }

    #[test]
    fn an_s_whose_middle_lies_on_the_chord_is_followed() {
        // In either component, and below the chord as well as above.
        let hundred = |s: f64| s * (1.0 - s) * (1.0 - 2.0 * s);
        assert!(hundred(0.5) == 0.0 && hundred(0.2) > 0.09);
        for graph in [
            Graph(|s| [3.0 + s * (1.0 - s) * (1.0 - 2.0 * s), 5.0]),
            Graph(|s| [3.0, 5.0 - s * (1.0 - s) * (1.0 - 2.0 * s)]),
            Graph(|s| [3.0 + s * (1.0 - s), 5.0 - 2.0 * s]),
        ] {
            // The middle third is an S itself, 27 times as small, whose middle lies on its chord.
            let chord = 4e-3;
            let samples = recorded(&graph, chord);
            assert!(samples.len() < 60, "{}", samples.len());
            for w in samples.windows(2) {
                assert!(w[0].t < w[1].t && w[0].x[0] < w[1].x[0]);
                for k in 0..=20 {
                    let share = f64::from(k) / 20.0;
                    let s = w[0].x[0] + share * (w[1].x[0] - w[0].x[0]);
                    let on = graph.at(s);
                    assert!(
                        ((s - (w[0].t - 2.0) / 2.0) - share * (w[1].t - w[0].t) / 2.0).abs()
                            < 1e-15
                    );
                    // Halvings look at the middle; the largest gap of a cubic is a little beside
                    // it.
                    let ends = [w[0].x, w[1].x].map(SVector::from);
                    let off = (ends[0] + (ends[1] - ends[0]) * share - on).amax();
                    assert!(off < 1.2 * chord, "{off} at {s}");
                }
            }
        }
    }

    #[test]
    fn what_is_taken_is_forgotten_and_kicks_are_kept() {
        let step = Step {
            t0: 0.0,
            t1: 1.0,
            x0: HalfCircle.at(0.0),
            x1: HalfCircle.at(1.0),
            interpolant: &HalfCircle,
        };
        let mut r = PathRecorder::<2>::new(&step.x0, 10.0);
        r.step(&step);
        r.kick(1.0, &step.x1, &SVector::from([7.0, 8.0, 9.0]));
        assert_eq!(r.len(), 3);
        let taken = r.take();
        assert_eq!((taken.len(), taken[2], r.len()), (3, Sample { t: 1.0, x: [7.0, 8.0] }, 0));

        let mut r = TimesRecorder::<4>::new(&step.x0, 0.5);
        r.step(&step);
        assert_eq!(r.len(), 3);
        let taken = r.take();
        // Components beyond the state's dimension are zero.
        assert!(
            taken.len() == 3 && r.len() == 0 && taken[0].x == [1.0, 0.0, 0.0, 0.0],
            "{taken:?}"
        );
        // It goes on where it was.
        let next = Step { t0: 1.0, t1: 1.6, ..step };
        assert_eq!(r.record(&next), 1);
        assert_eq!(r.take()[0].t, 1.5);
    }
}
