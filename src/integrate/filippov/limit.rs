//! The limit eps -> 0: how the smoothed system (eq. 8) tends to the Filippov motion.
//!
//! Before the first visit to a two-fold the motion is unique and smoothing is a perturbation: a transversal crossing
//! shifts the orbit by the time spent in the layer, O(eps); in attracting sliding the smoothed orbit follows a slow
//! manifold at the distance O(eps) of the surface with a slow flow O(eps) from the sliding flow (Fenichel 1979; Teixeira
//! & da Silva 2012). So the expected rate is 1. After the visit the motion is a set and a smoothed orbit tends to no
//! single Filippov orbit, but it must come near some member of the [`funnel`](super::funnel()).

use nalgebra::SVector;

use super::{
    EventKind, ExitRule, FilippovError, FilippovObserver, FunnelGrid, Mode, ModeEvent, Settings, Side, SlidingFlow,
    funnel, run,
};
use crate::integrate::Taylor;
use crate::integrate::dopri5::Dopri5;
use crate::integrate::roots::sign_changes;
use crate::integrate::step::{Failure, Flow, Step, Stepper, Tolerance};
use crate::num::DoubleDouble;
use crate::num::elementary::ln;
use crate::system::filippov::{Region, region};
use crate::system::{PiecewiseSmooth, Smoothed, Transition, VectorField};

/// One comparison of a smoothed orbit with the Filippov orbit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ConvergenceRow {
    /// The smoothing parameter.
    pub eps: f64,
    /// The time at which the two are compared.
    pub t: f64,
    /// The Filippov orbit's mode at that time.
    pub mode: Mode,
    /// Euclidean distance of the two states.
    pub distance: f64,
}

/// Remembers the states at given times.
struct AtTimes<'a, const N: usize> {
    times: &'a [f64],
    states: Vec<(Mode, SVector<f64, N>)>,
}

impl<const N: usize> FilippovObserver<N> for AtTimes<'_, N> {
    fn step(&mut self, mode: Mode, step: &Step<'_, N>) -> Flow {
        while let Some(&t) = self.times.get(self.states.len()) {
            if t > step.t1 {
                return Flow::Continue;
            }
            self.states.push((mode, step.at((t - step.t0) / step.length())));
        }
        Flow::Stop
    }
}

fn smooth<P: Clone>(system: &P, eps: f64) -> Smoothed<P> {
    Smoothed { system: system.clone(), transition: Transition::Tanh, eps }
}

/// The layer |h| < 19 eps must not be jumped over: h moves at a speed of order one.
fn layer_cap(eps: f64) -> f64 {
    (4.0 * eps).min(0.05)
}

/// Compares the smoothed orbit (tanh) of each `eps` with the Filippov orbit at each of `times` (increasing, all before the
/// first visit to a two-fold or other set-valued point).
///
/// # Errors
/// [`FilippovError::NoSuchExit`] if the Filippov orbit is no longer unique at the last time; failures of the methods.
pub fn convergence<P, const N: usize, const M: usize>(
    system: &P,
    x0: SVector<f64, N>,
    times: &[f64],
    eps: &[f64],
    settings: &Settings,
) -> Result<Vec<ConvergenceRow>, FilippovError>
where
    P: PiecewiseSmooth<N> + Clone,
    for<'a> SlidingFlow<'a, P, N>: VectorField<M>,
{
    let Some(&last) = times.last() else { return Ok(Vec::new()) };
    let mut exact = AtTimes { times, states: Vec::new() };
    let end = run(system, x0, last, settings, ExitRule::All, &mut exact)?.within_budget()?;
    if exact.states.len() < times.len() {
        return Err(FilippovError::NoSuchExit {
            t: end.t,
            state: Failure::state(&end.x),
            why: "the Filippov orbit is not unique up to the last comparison time; compare earlier",
        });
    }
    let mut rows = Vec::with_capacity(eps.len() * times.len());
    for &eps in eps {
        let field = smooth(system, eps);
        let mut method = Dopri5::<N>::new(settings.tolerance);
        let (mut t, mut x) = (0.0, x0);
        for (&until, (mode, exact)) in times.iter().zip(&exact.states) {
            method.restart(&field, t, x, until, layer_cap(eps))?;
            while t < until {
                let step = method.step(&field)?;
                (t, x) = (step.t1, step.x1);
            }
            rows.push(ConvergenceRow { eps, t, mode: *mode, distance: (x - exact).norm() });
        }
    }
    Ok(rows)
}

/// The rate of convergence at time `t`: the least-squares slope of ln distance against ln eps.
pub fn observed_rate(rows: &[ConvergenceRow], t: f64) -> f64 {
    let points: Vec<_> = rows.iter().filter(|r| r.t == t).map(|r| (ln(r.eps), ln(r.distance))).collect();
    let n = points.len() as f64;
    let (mx, my) = points.iter().fold((0.0, 0.0), |(a, b), (x, y)| (a + x / n, b + y / n));
    let (sxy, sxx) =
        points.iter().fold((0.0, 0.0), |(a, b), (x, y)| (a + (x - mx) * (y - my), b + (x - mx) * (x - mx)));
    sxy / sxx
}

/// Where a smoothed orbit goes after its first visit, and the member of the funnel that goes nearest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AfterVisit<const N: usize> {
    /// The smoothing parameter.
    pub eps: f64,
    /// The smoothed orbit's first crossing of h = 0 towards h > 0, in the crossing region, farther than `beyond` from
    /// the set-valued point.
    pub crossing: SVector<f64, N>,
    /// Exit time and side of the nearest member.
    pub exit_time: f64,
    /// See `exit_time`.
    pub side: Side,
    /// Distance of the two crossings.
    pub distance: f64,
    /// Largest distance between the crossings of any two members: the width of the funnel there.
    pub width: f64,
}

/// The first upward crossing farther than `beyond` from `point`.
fn first_crossing<const N: usize>(
    events: &[ModeEvent<N>],
    point: &SVector<f64, N>,
    beyond: f64,
) -> Option<SVector<f64, N>> {
    let up = EventKind::Crossing { to: Side::Plus };
    events.iter().find(|e| e.kind == up && (e.state - point).norm() > beyond).map(|e| e.state)
}

/// Follows the smoothed orbit of each `eps` through its first visit to the next crossing beyond `beyond`, and looks for
/// the nearest crossing among the funnel's members (a grid of exit times on both sides, refined by golden-section search).
///
/// # Errors
/// Those of [`funnel`]; [`FilippovError::NoSuchExit`] if an orbit or every member makes no such crossing by `t_end`.
#[allow(clippy::too_many_arguments)]
pub fn after_visit<P, const N: usize, const M: usize>(
    system: &P,
    x0: SVector<f64, N>,
    t_end: f64,
    eps: &[f64],
    beyond: f64,
    grid: &FunnelGrid,
    settings: &Settings,
) -> Result<Vec<AfterVisit<N>>, FilippovError>
where
    P: PiecewiseSmooth<N> + Clone,
    for<'a> SlidingFlow<'a, P, N>: VectorField<M>,
{
    let family = funnel(system, x0, t_end, settings, grid)?;
    let crossings: Vec<_> = family
        .members
        .iter()
        .filter_map(|m| first_crossing(&m.trajectory.events, &family.point, beyond).map(|c| (m.exit_time, m.side, c)))
        .collect();
    let mut width = 0.0_f64;
    for (i, a) in crossings.iter().enumerate() {
        for b in &crossings[..i] {
            width = width.max((a.2 - b.2).norm());
        }
    }
    let missing = |t: f64, x: &SVector<f64, N>| FilippovError::NoSuchExit {
        t,
        state: Failure::state(x),
        why: "no crossing beyond the given distance by the end time; extend the run or come nearer",
    };
    let mut rows = Vec::with_capacity(eps.len());
    for &eps in eps {
        let field = smooth(system, eps);
        // A visit multiplies local errors by up to 10^20 (figures/digits): only extended precision says where the exit is.
        let mut method = Taylor::<N, DoubleDouble>::extended(Tolerance { rtol: 1e-28, atol: 1e-28 });
        let (mut t, mut x) = (0.0, x0);
        method.restart(&field, t, x, t_end, f64::INFINITY)?;
        let crossing = 'flight: loop {
            if t >= t_end {
                return Err(missing(t, &x));
            }
            let step = method.step(&field)?;
            // Crossings before the visit do not count.
            if step.t1 > family.t {
                for theta in sign_changes(&step, |x| system.switching(x)) {
                    let c = step.at(theta);
                    if region(system, &c) == Region::CrossingUp && (c - family.point).norm() > beyond {
                        break 'flight c;
                    }
                }
            }
            (t, x) = (step.t1, step.x1);
        };
        let nearest = crossings.iter().min_by(|a, b| (a.2 - crossing).norm().total_cmp(&(b.2 - crossing).norm()));
        let Some(&(best, side, there)) = nearest else { return Err(missing(t, &x)) };
        let ratio = if grid.times > 1 {
            crate::num::elementary::pow(grid.longest / grid.shortest, 1.0 / (grid.times - 1) as f64)
        } else {
            1.0
        };
        let distance_at = |exit_time: f64| -> Result<f64, FilippovError> {
            let one = FunnelGrid { shortest: exit_time, longest: exit_time, times: 1, ..*grid };
            let f = super::funnel::members_of(system, &family, settings, &one, Some(side))?;
            Ok(f.first()
                .and_then(|m| first_crossing(&m.trajectory.events, &family.point, beyond))
                .map_or(f64::INFINITY, |c| (c - crossing).norm()))
        };
        let (mut exit_time, mut distance) = (best, (there - crossing).norm());
        let (mut low, mut high) = (best / ratio, best * ratio);
        for _ in 0..40 {
            let (a, b) = (low + 0.382 * (high - low), low + 0.618 * (high - low));
            let (da, db) = (distance_at(a)?, distance_at(b)?);
            for (time, d) in [(a, da), (b, db)] {
                if d < distance {
                    (exit_time, distance) = (time, d);
                }
            }
            if da < db { high = b } else { low = a }
        }
        rows.push(AfterVisit { eps, crossing, exit_time, side, distance, width });
    }
    Ok(rows)
}
