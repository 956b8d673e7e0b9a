//! The largest Lyapunov exponent, from the variational equation.
//!
//! A tangent vector is carried along the orbit by v' = Df(x) v and renormalised before it grows or
//! shrinks out of range; the mean rate of its logarithm is the largest exponent (Benettin, Galgani,
//! Giorgilli & Strelcyn 1980, Meccanica 15, 9-30). Orbit and vector are stepped together, so that
//! the step resolves both: in the layer |h| < 20 eps of a smoothed system the vector is what limits
//! the step.
//!
//! Why not two close orbits (Benettin, Galgani & Strelcyn 1976)? One visit to a two-fold
//! singularity smoothed with eps = 1e-3 amplifies a displacement by up to 10^10. An initial
//! distance that stays small through that is below rounding; a larger one saturates, and the
//! exponent comes out too small. A tangent vector has no such ceiling.
//!
//! Kicks displace the orbit and leave the vector alone, which is the limit of two close orbits that
//! receive the same kicks: the exponent of the random system given its noise.

use nalgebra::SVector;
use serde::{Deserialize, Serialize};

use super::tangent::Tangent;
use twofold_integrate::ensemble::{
    Carried, Common, EnsembleRun, InstructionSet, Tolerances, ensemble_watched,
};
use twofold_integrate::{
    Dopri5, DriveOptions, Failure, Flow, Guarded, Kick, Kicker, Monitor, Observer, Step, StepCap,
    Stepper, Tolerance,
};
use twofold_num::elementary::{ln, sqrt};
use twofold_num::fit::{line, mean};
use twofold_system::{BatchedField, VectorField};

/// A largest Lyapunov exponent.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Exponent {
    /// Per unit time.
    pub value: f64,
    /// Standard error of the mean over the run, from block averages; the largest over block lengths
    /// (Flyvbjerg & Petersen 1989), because short blocks of a correlated series pretend to be
    /// independent.
    pub standard_error: f64,
    /// Time averaged over.
    pub duration: f64,
}

/// An exponent with a 95 % interval, which decides its sign.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Estimate {
    /// The mean over the run, with its standard error alone.
    pub exponent: Exponent,
    /// Half of the interval around the mean in which the exponent lies with 95 %: what scatters
    /// (`QUANTILE` standard errors), what growth slower than any exponential adds to a mean over a
    /// finite time, and what the method's local errors can add.
    pub half_width: f64,
}

/// The sign of an exponent, as its interval decides it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Sign {
    /// The whole interval is above zero.
    Positive,
    /// The whole interval is below zero.
    Negative,
    /// Zero is in it.
    Zero,
}

impl Estimate {
    /// The sign that the interval implies.
    pub fn sign(&self) -> Sign {
        match self.exponent.value {
            v if v > self.half_width => Sign::Positive,
            v if v < -self.half_width => Sign::Negative,
            _ => Sign::Zero,
        }
    }
}

/// Student's 97.5 % quantile for the seven degrees of freedom of the longest blocks.
const QUANTILE: f64 = 2.365;

/// Options of an exponent's computation.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LyapunovOptions {
    /// Local error of orbit and vector.
    pub tolerance: Tolerance,
    /// Longest step.
    pub max_step: f64,
    /// Time before averaging starts, in which the vector turns into the fastest direction.
    pub transient: f64,
    /// Time averaged over.
    pub duration: f64,
    /// Step limit.
    pub max_steps: u64,
    /// Random kicks.
    pub kick: Option<Kick>,
}

impl Default for LyapunovOptions {
    fn default() -> Self {
        Self {
            tolerance: Tolerance { rtol: 1e-9, atol: 1e-9 },
            max_step: f64::INFINITY,
            transient: 100.0,
            duration: 10_000.0,
            max_steps: 50_000_000,
            kick: None,
        }
    }
}

/// Blocks that the run is cut into. A power of two, so that neighbours can be joined.
const BLOCKS: usize = 64;
/// Fewest blocks that still give an error of an error of a quarter.
const FEWEST_BLOCKS: usize = 8;
/// The vector is renormalised when its length leaves (1/RANGE, RANGE): far from under- and overflow
/// and, below, from the absolute tolerance.
const RANGE: f64 = 100.0;

/// The largest Lyapunov exponent of the orbit of `field` from `x0`, `M` being 2 `N`: `largest::<3,
/// 6, _>(...)`.
///
/// ```
/// use nalgebra::Vector3;
/// use twofold_analyse::lyapunov::{LyapunovOptions, largest};
/// use twofold_system::{Definition, Field, System, Transition};
/// // The Lorenz system; its largest exponent is 0.9056. Both fields are the same: h has no effect.
/// let f = "['10*(y - x)', 'x*(28 - z) - y', 'x*y - 8/3*z']";
/// let text = format!("states = ['x', 'y', 'z']\nh = 'x'\nplus = {f}\nminus = {f}");
/// let lorenz = System::new(Definition::from_toml(&text, "lorenz.toml")?);
/// let field = Field::smoothed(&lorenz, Transition::Tanh, 1.0).bind::<3>()?;
/// let options = LyapunovOptions { transient: 10.0, duration: 100.0, ..Default::default() };
/// let exponent = largest::<3, 6, _>(&field, Vector3::new(1.0, 1.0, 20.0), &options)?;
/// assert!((exponent.value - 0.9).abs() < 5.0 * exponent.standard_error.max(0.02));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// If the orbit cannot be followed.
pub fn largest<const N: usize, const M: usize, F>(
    field: &F,
    x0: SVector<f64, N>,
    settings: &LyapunovOptions,
) -> Result<Exponent, Failure>
where
    F: VectorField<N>,
    for<'a> Tangent<'a, F, 1>: VectorField<M>,
{
    largest_along(&Tangent::<F, 1>(field), x0, N.min(3), settings)
}

/// The same for an equation that comes with its variational equation for one vector: `tangent` is
/// (x, v)' in `M` = 2 `N` dimensions. Kicks perturb the first `kicked_states` components.
///
/// # Errors
/// If the orbit cannot be followed.
pub fn largest_along<const N: usize, const M: usize, T: VectorField<M>>(
    tangent: &T,
    x0: SVector<f64, N>,
    kicked_states: usize,
    settings: &LyapunovOptions,
) -> Result<Exponent, Failure> {
    largest_watched(tangent, x0, kicked_states, settings, &())
}

/// [`estimate_along`] without the interval.
///
/// # Errors
/// If the orbit cannot be followed.
pub fn largest_watched<const N: usize, const M: usize, T: VectorField<M>>(
    tangent: &T,
    x0: SVector<f64, N>,
    kicked_states: usize,
    settings: &LyapunovOptions,
    monitor: &dyn Monitor,
) -> Result<Exponent, Failure> {
    Ok(estimate_along(tangent, x0, kicked_states, settings, monitor)?.exponent)
}

/// [`largest_along`] with its interval, reporting to `monitor` how far it has come. Where `monitor`
/// refuses, the mean is over the blocks that are finished: its duration says how long that was.
/// There is no number if they are fewer than eight of the 64.
///
/// # Errors
/// If the orbit cannot be followed.
pub fn estimate_along<const N: usize, const M: usize, T: VectorField<M>>(
    tangent: &T,
    x0: SVector<f64, N>,
    kicked_states: usize,
    settings: &LyapunovOptions,
    monitor: &dyn Monitor,
) -> Result<Estimate, Failure> {
    const { assert!(M == 2 * N) };
    let stepper = Guarded::new(Dopri5::new(settings.tolerance), settings.tolerance).of_states(N);
    averaged(
        &mut Alone { tangent, stepper, met: false, t: 0.0, state: begin(&x0) },
        kicked_states,
        settings,
        monitor,
    )
}

/// An orbit with a disturbance, `M` numbers.
pub(super) trait Disturbed<const M: usize> {
    /// Begins where it is, towards `stop`.
    fn begin(&mut self, stop: f64, max_step: f64) -> Result<(), Failure>;
    /// Makes a step.
    fn step(&mut self) -> Result<(), Failure>;
    /// The time reached, and the state with its tangent vector.
    fn reached(&self) -> (f64, SVector<f64, M>);
    /// Takes another state for the same disturbance.
    fn displace(&mut self, state: SVector<f64, M>);
    /// The disturbance's length.
    fn length(&self) -> f64;
    /// Divides the disturbance by a number.
    fn shorten(&mut self, by: f64);
    /// Steps made.
    fn steps(&self) -> u64;
}

/// An equation with its variational equation.
struct Alone<'a, T, const M: usize> {
    tangent: &'a T,
    stepper: Guarded<Dopri5<M>, M>,
    /// Whether the stepper has met the equation.
    met: bool,
    t: f64,
    state: SVector<f64, M>,
}

impl<T: VectorField<M>, const M: usize> Disturbed<M> for Alone<'_, T, M> {
    fn begin(&mut self, stop: f64, max_step: f64) -> Result<(), Failure> {
        let Self { tangent, stepper, met, t, state } = self;
        let begun = match std::mem::replace(met, true) {
            false => stepper.restart(*tangent, *t, *state, stop, max_step),
            true => stepper.restart_again(*tangent, *t, *state, stop, max_step),
        };
        begun.map_err(|failure| failure.of_states(M / 2))
    }
    fn step(&mut self) -> Result<(), Failure> {
        let step = self.stepper.step(self.tangent).map_err(|failure| failure.of_states(M / 2))?;
        (self.t, self.state) = (step.t1, step.x1);
        Ok(())
    }
    fn reached(&self) -> (f64, SVector<f64, M>) {
        (self.t, self.state)
    }
    fn displace(&mut self, state: SVector<f64, M>) {
        self.state = state;
    }
    fn length(&self) -> f64 {
        length(&self.state)
    }
    fn shorten(&mut self, by: f64) {
        for v in self.state.iter_mut().skip(M / 2) {
            *v /= by;
        }
    }
    fn steps(&self) -> u64 {
        self.stepper.statistics().steps
    }
}

/// The mean rate at which a disturbance grows, as [`estimate_along`] has it.
pub(super) fn averaged<const M: usize>(
    orbit: &mut dyn Disturbed<M>,
    kicked_states: usize,
    settings: &LyapunovOptions,
    monitor: &dyn Monitor,
) -> Result<Estimate, Failure> {
    let mut kicker = settings.kick.map(|kick| Kicker::new(kick, kicked_states));
    let mut kicks = 1_u64;
    let mut rates = Vec::with_capacity(BLOCKS);
    let mut t = 0.0;
    for block in 0..=BLOCKS {
        let end = block_end(settings, block);
        let start = t;
        let mut growth = -ln(orbit.length());
        while t < end {
            let kick_at = settings.kick.map_or(f64::INFINITY, |k| k.every * kicks as f64);
            let stop = end.min(kick_at);
            if stop > t {
                orbit.begin(stop, settings.max_step)?;
            }
            while t < stop {
                orbit.step()?;
                t = orbit.reached().0;
                let size = orbit.length();
                if !(1.0 / RANGE..=RANGE).contains(&size) {
                    growth += ln(size);
                    orbit.shorten(size);
                    if t < stop {
                        orbit.begin(stop, settings.max_step)?;
                    }
                }
                if orbit.steps().is_multiple_of(4096) && monitor.reached(t).is_break() {
                    return Ok(estimate_of(&rates, settings, t, orbit.steps()));
                }
                if orbit.steps() >= settings.max_steps {
                    let x: Vec<f64> = orbit.reached().1.iter().take(M / 2).copied().collect();
                    return Err(Failure::TooManySteps { t, limit: settings.max_steps, state: x });
                }
            }
            if stop == kick_at {
                kicks += 1;
                if let Some(k) = kicker.as_mut() {
                    orbit.displace(k.apply(orbit.reached().1));
                }
            }
        }
        growth += ln(orbit.length());
        if block > 0 {
            rates.push(growth / (t - start));
        }
    }
    Ok(estimate_of(&rates, settings, t, orbit.steps()))
}

/// [`largest_watched`] for many orbits side by side in the lanes of vector registers: of each the
/// number that it has alone, bit for bit, in the order of `starts`; `tangents` has a run for each.
/// There are no kicks. Nothing if `monitor` refuses.
///
/// # Panics
/// If `settings` have kicks, or `tangents` are of fewer runs.
pub fn largest_side_by_side<const N: usize, const M: usize, E: BatchedField<M>>(
    set: InstructionSet,
    tangents: &E,
    starts: &[SVector<f64, N>],
    settings: &LyapunovOptions,
    monitor: &dyn Monitor,
) -> Option<Vec<Result<Exponent, Failure>>> {
    const { assert!(M == 2 * N) };
    assert!(settings.kick.is_none(), "orbits without kicks");
    let LyapunovOptions { tolerance, max_step, transient, duration, max_steps, .. } = *settings;
    let stops: Vec<f64> = (0..=BLOCKS)
        .map(|block| block_end(settings, block))
        .skip_while(|end| *end <= 0.0)
        .collect();
    let options = DriveOptions {
        step_cap: StepCap::Absolute(max_step),
        max_steps,
        ..DriveOptions::to(transient + duration)
    };
    let runs: Vec<EnsembleRun<M>> =
        starts.iter().map(|x0| EnsembleRun { start: begin(x0), options }).collect();
    let carried = Carried { first: N, range: [1.0 / RANGE, RANGE], stops: &stops };
    let tolerances = Tolerances::All(tolerance);
    let common = Common { tolerances, plane: None, corners: None, carried: Some(carried), monitor };
    let growth = |run: usize| Growth {
        carried,
        growth: -ln(carried.length(&runs[run].start)),
        start: 0.0,
        counted: transient <= 0.0,
        rates: Vec::with_capacity(BLOCKS),
    };
    let mut found: Vec<Option<Result<Exponent, Failure>>> = vec![None; runs.len()];
    ensemble_watched(set, tangents, &runs, common, growth, &mut |run, end| {
        found[run] = Some(end.summary.and_then(|summary| {
            if summary.statistics.steps >= max_steps {
                let state = summary.x.iter().take(N).copied().collect();
                return Err(Failure::TooManySteps { t: summary.t, limit: max_steps, state });
            }
            Ok(mean_of(&end.observer.rates, settings))
        }));
    });
    found.into_iter().collect()
}

/// Gathers the rates of an orbit among others.
struct Growth<'a> {
    carried: Carried<'a>,
    /// In this block, as the logarithm of a factor.
    growth: f64,
    /// When the block began.
    start: f64,
    /// Whether the block counts: the first, if there is a transient, does not.
    counted: bool,
    rates: Vec<f64>,
}

impl<const M: usize> Observer<M> for Growth<'_> {
    fn step(&mut self, _: &Step<'_, M>) -> Flow {
        Flow::Continue
    }
    fn rescaled(&mut self, _: f64, length: f64) {
        self.growth += ln(length);
    }
    fn stopped(&mut self, t: f64, x: &SVector<f64, M>) {
        let rest = ln(self.carried.length(x));
        self.growth += rest;
        if self.counted {
            self.rates.push(self.growth / (t - self.start));
        }
        (self.growth, self.start, self.counted) = (-rest, t, true);
    }
}

/// The state to begin with: a start with no preferred direction; almost every vector turns into the
/// fastest one.
pub(super) fn begin<const N: usize, const M: usize>(x0: &SVector<f64, N>) -> SVector<f64, M> {
    SVector::from_fn(|i, _| if i < N { x0[i] } else { 1.0 / sqrt(N as f64) })
}

/// When a block ends; the transient is block 0.
fn block_end(settings: &LyapunovOptions, block: usize) -> f64 {
    settings.transient + settings.duration * block as f64 / BLOCKS as f64
}

/// The mean of the finished blocks.
fn mean_of(rates: &[f64], settings: &LyapunovOptions) -> Exponent {
    // Of fewer there is no error, and of a mean without error no use.
    let value = if rates.len() < FEWEST_BLOCKS { f64::NAN } else { mean(rates).0 };
    let duration = if rates.len() == BLOCKS {
        settings.duration
    } else {
        settings.duration * rates.len() as f64 / BLOCKS as f64
    };
    Exponent { value, standard_error: blocked_error(rates), duration }
}

/// The mean with its interval, `steps` having been made until `t`.
///
/// If vectors grow like a power of time, as at a shear or in regular motion, the mean falls like
/// ln(t)/t and its scatter does not show this error (Skokos 2010, Lect. Notes Phys. 790, 63-135,
/// sec. 5): ln |v| = exponent t + power ln t is fitted to the blocks, and the interval is widened
/// by the difference of the two exponents. The method's local errors, at most its tolerance in each
/// step, would make a vector grow or shrink by themselves: their bound is added.
pub(super) fn estimate_of(
    rates: &[f64],
    settings: &LyapunovOptions,
    t: f64,
    steps: u64,
) -> Estimate {
    let exponent = mean_of(rates, settings);
    // The mean of 1/t over a block; the first one has none if it begins at 0.
    let points = rates.iter().enumerate().filter_map(|(k, rate)| {
        let (from, to) = (block_end(settings, k), block_end(settings, k + 1));
        (from > 0.0).then(|| (ln(to / from) / (to - from), *rate))
    });
    let fitted = line(&points.collect::<Vec<_>>()).filter(|l| l.slope.abs() > l.slope_error);
    let slow = fitted.map_or(0.0, |l| (exponent.value - l.intercept).abs());
    let Tolerance { rtol, atol } = settings.tolerance;
    let method = (rtol + atol * RANGE) * steps as f64 / t.max(f64::MIN_POSITIVE);
    let half_width = QUANTILE * exponent.standard_error + slow + method;
    Estimate { exponent, half_width }
}

/// Length of the tangent vector.
fn length<const M: usize>(state: &SVector<f64, M>) -> f64 {
    sqrt(state.iter().skip(M / 2).map(|v| v * v).sum())
}

/// Standard error of the mean of a correlated series: the largest over repeated joining of
/// neighbours.
fn blocked_error(values: &[f64]) -> f64 {
    let mut values = values.to_vec();
    let mut largest = 0.0_f64;
    while values.len() >= FEWEST_BLOCKS {
        largest = largest.max(mean(&values).1);
        values = values.chunks_exact(2).map(|p| 0.5 * (p[0] + p[1])).collect();
    }
    largest
}

#[cfg(test)]
mod tests {
    use super::*;
    use twofold_num::Elementary;

    /// x' = A x with eigenvalues 0.3 and -1 in a skew basis.
    struct Linear;
    impl VectorField<2> for Linear {
        fn eval<S: Elementary>(&self, x: &SVector<S, 2>) -> SVector<S, 2> {
            SVector::from([x[0].scale(0.3) + x[1].scale(0.7), -x[1]])
        }
    }

    #[test]
    fn linear_system_has_its_eigenvalue() {
        let settings =
            LyapunovOptions { transient: 30.0, duration: 100.0, ..LyapunovOptions::default() };
        let e = largest::<2, 4, _>(&Linear, SVector::from([0.0, 0.0]), &settings).unwrap();
        assert!((e.value - 0.3).abs() < 1e-8 && e.standard_error < 1e-8, "{e:?}");
    }

    #[test]
    fn kicks_do_not_change_a_linear_system() {
        // Its orbit is thrown about, its tangent flow is the same everywhere.
        let kick = Kick {
            every: 0.3,
            size: 0.1,
            law: twofold_integrate::KickLaw::Normal,
            seed: 1,
            stream: 0,
        };
        let settings = LyapunovOptions {
            transient: 10.0,
            duration: 20.0,
            kick: Some(kick),
            ..LyapunovOptions::default()
        };
        struct Kicked;
        impl VectorField<3> for Kicked {
            fn eval<S: Elementary>(&self, x: &SVector<S, 3>) -> SVector<S, 3> {
                SVector::from([x[0].scale(-0.2) + x[1].scale(0.7), -x[1], x[2].scale(-0.5)])
            }
        }
        let e = largest::<3, 6, _>(&Kicked, SVector::zeros(), &settings).unwrap();
        assert!((e.value + 0.2).abs() < 1e-3, "{e:?}");
    }

    #[test]
    fn correlated_blocks_have_the_larger_error() {
        // Runs of eight equal values: 8 independent ones, not 64.
        let values: Vec<f64> =
            (0..64).map(|i| [0.3, 1.0, -0.5, 0.1, 0.9, -1.0, 0.4, 0.2][i / 8]).collect();
        assert!(blocked_error(&values) > 2.5 * mean(&values).1);
    }

    #[test]
    fn kicks_change_the_rate_where_the_rate_depends_on_the_state() {
        /// x1 is the rate at which x2 grows, and changes by kicks only.
        struct Rate;
        impl VectorField<2> for Rate {
            fn eval<S: Elementary>(&self, x: &SVector<S, 2>) -> SVector<S, 2> {
                SVector::from([x[0].scale(0.0), x[0] * x[1]])
            }
        }
        let kick = Kick {
            every: 0.7,
            size: 0.05,
            law: twofold_integrate::KickLaw::Normal,
            seed: 5,
            stream: 0,
        };
        let settings = LyapunovOptions {
            transient: 50.0,
            duration: 20.0,
            kick: Some(kick),
            ..LyapunovOptions::default()
        };
        let e = largest_along::<2, 4, _>(
            &Tangent::<Rate, 1>(&Rate),
            SVector::from([0.8, 0.0]),
            1,
            &settings,
        )
        .unwrap();
        // The mean of the rate over (50, 70), the n-th kick coming at 0.7 n.
        let mut kicker = Kicker::new(kick, 1);
        let (mut rate, mut want) = (SVector::from([0.8]), 0.0);
        for n in 0..101 {
            let [from, to] = [n, n + 1].map(|k| (0.7 * f64::from(k)).clamp(50.0, 70.0));
            want += rate[0] * (to - from) / 20.0;
            rate = kicker.apply(rate);
        }
        assert!((e.value - want).abs() < 1e-7 && e.duration == 20.0, "{e:?} {want}");
        assert!(e.standard_error > 1e-3, "{e:?}");
    }

    #[test]
    fn fewer_than_eight_blocks_have_no_mean() {
        let settings = LyapunovOptions { duration: 640.0, ..LyapunovOptions::default() };
        let of = |n: u32| mean_of(&(1..=n).map(f64::from).collect::<Vec<_>>(), &settings);
        assert!(of(0).value.is_nan() && of(7).value.is_nan());
        assert_eq!((of(7).duration, of(8).value, of(8).duration), (70.0, 4.5, 80.0));
        assert_eq!((of(9).value, of(64).value, of(64).duration), (5.0, 32.5, 640.0));
    }

    #[test]
    fn a_budget_of_steps_is_kept() {
        let settings = LyapunovOptions { max_steps: 10, ..LyapunovOptions::default() };
        let error = largest::<2, 4, _>(&Linear, SVector::from([0.0, 0.0]), &settings).unwrap_err();
        assert!(
            matches!(error, Failure::TooManySteps { limit: 10, ref state, .. } if state.len() == 2),
            "{error:?}"
        );
    }
}
