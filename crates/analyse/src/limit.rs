//! The limit eps -> 0: convergence of a smoothed system to the Filippov motion.
//!
//! Before the first visit to a two-fold the motion is unique and smoothing is a perturbation: a
//! transversal crossing shifts the orbit by the time spent in the layer, O(eps); in attracting
//! sliding the smoothed orbit follows a slow manifold at the distance O(eps) of the surface with a
//! slow flow O(eps) from the sliding flow (Fenichel 1979; Teixeira & da Silva 2012). So the
//! expected rate is 1 ([`convergence`]). After the visit the motion is a set and a smoothed orbit
//! tends to no single Filippov orbit, but it must come near some member of the [`funnel`]
//! ([`after_visit`]).

use nalgebra::SVector;
use serde::{Deserialize, Serialize};

use twofold_integrate::dopri5::Dopri5;
use twofold_integrate::filippov::{
    EventKind, ExitRule, FilippovError, FilippovObserver, FilippovOptions, Funnel, FunnelGrid,
    FunnelMember, Mode, Side, SlidingFlow, funnel, run,
};
use twofold_integrate::{Failure, Flow, Statistics, Step, Stepper};
use twofold_num::elementary::{ln, pow};
use twofold_num::fit::line;
use twofold_system::{PiecewiseSmooth, Smoothed, Transition, VectorField};

fn smooth<P: Clone>(system: &P, eps: f64) -> Smoothed<P> {
    Smoothed { system: system.clone(), transition: Transition::Tanh, eps }
}

/// Options of [`convergence`]: everything that it depends on besides the system.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ConvergenceQuestion {
    /// The start, at t = 0.
    pub start: Vec<f64>,
    /// When the orbits are compared; increasing, all before the first visit to a two-fold or other
    /// set-valued point.
    pub times: Vec<f64>,
    /// The smoothing parameters (tanh).
    pub eps: Vec<f64>,
    /// Options of the Filippov orbit; its tolerance is that of the smoothed orbits too.
    pub settings: FilippovOptions,
}

/// One comparison of a smoothed orbit with the Filippov orbit.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
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

/// The answer to a [`ConvergenceQuestion`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Convergence {
    /// By eps, then by time, both in the order asked for.
    pub rows: Vec<ConvergenceRow>,
    /// Work of all orbits together.
    pub statistics: Statistics,
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

/// The layer |h| < 19 eps must not be jumped over: h moves at a speed of order one.
fn layer_cap(eps: f64) -> f64 {
    (4.0 * eps).min(0.05)
}

/// The start of a question as a state.
fn state<const N: usize>(start: &[f64]) -> Result<SVector<f64, N>, FilippovError> {
    let wrong = || {
        FilippovError::Invalid(format!("the start has {} components, the system {N}", start.len()))
    };
    <[f64; N]>::try_from(start).map(SVector::from).map_err(|_| wrong())
}

/// Compares the smoothed orbit of each eps with the Filippov orbit.
///
/// # Errors
/// [`FilippovError::NoSuchExit`] if the Filippov orbit is no longer unique at the last time;
/// failures of the methods.
pub fn convergence<P, const N: usize, const M: usize>(
    system: &P,
    question: &ConvergenceQuestion,
) -> Result<Convergence, FilippovError>
where
    P: PiecewiseSmooth<N> + Clone,
    for<'a> SlidingFlow<'a, P, N>: VectorField<M>,
{
    let ConvergenceQuestion { start, times, eps, settings } = question;
    let x0 = state::<N>(start)?;
    let mut answer = Convergence {
        rows: Vec::with_capacity(eps.len() * times.len()),
        statistics: Statistics::default(),
    };
    let Some(&last) = times.last() else { return Ok(answer) };
    let mut exact = AtTimes { times, states: Vec::new() };
    let end = run(system, x0, last, settings, ExitRule::All, &mut exact)?.within_budget()?;
    if exact.states.len() < times.len() {
        return Err(FilippovError::NoSuchExit {
            t: end.t,
            state: Failure::state(&end.x),
            why: "the Filippov orbit is not unique up to the last comparison time; compare earlier",
        });
    }
    answer.statistics += &end.statistics;
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
            answer.rows.push(ConvergenceRow { eps, t, mode: *mode, distance: (x - exact).norm() });
        }
        answer.statistics += method.statistics();
    }
    Ok(answer)
}

/// The power of eps with which distances fall, points being (eps, distance): the least-squares
/// slope of ln distance against ln eps; not a number for fewer than two different eps.
pub fn observed_rate(points: impl IntoIterator<Item = [f64; 2]>) -> f64 {
    let logs: Vec<_> = points.into_iter().map(|[eps, distance]| (ln(eps), ln(distance))).collect();
    line(&logs).map_or(f64::NAN, |l| l.slope)
}

/// Options of [`after_visit`]: everything that it depends on besides the system.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AfterVisitQuestion {
    /// The start, at t = 0.
    pub start: Vec<f64>,
    /// The visit comes before this time.
    pub t_end: f64,
    /// The smoothing parameters (tanh).
    pub eps: Vec<f64>,
    /// Orbits are compared where they first cross h = 0 upwards, farther than this from the
    /// singularity; within the grid's horizon after the visit.
    pub beyond: f64,
    /// The members that are computed first.
    pub grid: FunnelGrid,
    /// Around the nearest of them ever finer grids are laid, so many in turn, each over the two
    /// neighbouring exit times of the one before.
    pub refinements: usize,
    /// Exit times of a refinement, at least 3.
    pub finer: usize,
    /// Options of the Filippov orbits.
    pub settings: FilippovOptions,
}

/// Crossing of a member of the funnel.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MemberCrossing {
    /// Its time of repelling sliding.
    pub exit_time: f64,
    /// The side it left to.
    pub side: Side,
    /// The crossing.
    pub crossing: Vec<f64>,
}

/// Crossing of a smoothed orbit after its first visit, and the nearest member of the funnel.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AfterVisitRow {
    /// The smoothing parameter.
    pub eps: f64,
    /// Point at which the smoothed orbit crosses.
    pub crossing: Vec<f64>,
    /// The member that crosses nearest.
    pub nearest: MemberCrossing,
    /// Distance of the two crossings.
    pub distance: f64,
}

/// The answer to an [`AfterVisitQuestion`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AfterVisit {
    /// When the future becomes a set.
    pub t_visit: f64,
    /// The state at that time.
    pub point: Vec<f64>,
    /// The crossings of the first grid's members, by exit time, plus before minus; members that
    /// make none are left out.
    pub members: Vec<MemberCrossing>,
    /// Largest distance between two of them: the width of the funnel there.
    pub width: f64,
    /// By eps, in the order asked for; those whose orbit makes no such crossing in time are left
    /// out.
    pub rows: Vec<AfterVisitRow>,
    /// Work of all orbits together.
    pub statistics: Statistics,
}

/// The futures of the singularity as crossings: what [`after_visit`] searches in.
struct Futures<'a, P, const N: usize> {
    system: &'a P,
    question: &'a AfterVisitQuestion,
    family: Funnel<N>,
    statistics: Statistics,
}

/// A member's crossing, as a state.
#[derive(Clone, Copy)]
struct Candidate<const N: usize> {
    exit_time: f64,
    side: Side,
    state: SVector<f64, N>,
}

impl<const N: usize> Candidate<N> {
    fn record(&self) -> MemberCrossing {
        let Self { exit_time, side, state } = *self;
        MemberCrossing { exit_time, side, crossing: Failure::state(&state) }
    }
}

impl<P, const N: usize> Futures<'_, P, N> {
    /// The first upward crossing, beyond the given distance, of each member that has one.
    fn crossings(&self, members: &[FunnelMember<N>]) -> Vec<Candidate<N>> {
        let up = EventKind::Crossing { to: Side::Plus };
        let far =
            |state: &SVector<f64, N>| (state - self.family.point).norm() > self.question.beyond;
        let found = members.iter().filter_map(|m| {
            let event = m.trajectory.events.iter().find(|e| e.kind == up && far(&e.state))?;
            Some(Candidate { exit_time: m.exit_time, side: m.side, state: event.state })
        });
        found.collect()
    }

    /// The member that crosses nearest to `x`: the nearest of the first grid, then of finer and
    /// finer grids around it, on its side. `None` if no member of the first grid crosses.
    fn nearest<const M: usize>(
        &mut self,
        first: &[Candidate<N>],
        x: &SVector<f64, N>,
    ) -> Result<Option<(Candidate<N>, f64)>, FilippovError>
    where
        P: PiecewiseSmooth<N>,
        for<'b> SlidingFlow<'b, P, N>: VectorField<M>,
    {
        let best = |members: &[Candidate<N>]| {
            let distances = members.iter().map(|m| (*m, (m.state - x).norm()));
            distances.min_by(|a, b| a.1.total_cmp(&b.1))
        };
        let Some(mut near) = best(first) else { return Ok(None) };
        let AfterVisitQuestion { grid, refinements, finer, settings, .. } = self.question;
        let mut ratio = pow(grid.longest / grid.shortest, 1.0 / (grid.times.max(2) - 1) as f64);
        for _ in 0..*refinements {
            let (shortest, longest) = (near.0.exit_time / ratio, near.0.exit_time * ratio);
            let around = FunnelGrid { shortest, longest, times: *finer, ..*grid };
            let members =
                self.family.members_on(self.system, settings, &around, Some(near.0.side))?;
            members.iter().for_each(|m| self.statistics += &m.summary.statistics);
            if let Some(finer) = best(&self.crossings(&members))
                && finer.1 < near.1
            {
                near = finer;
            }
            ratio = pow(ratio, 2.0 / (finer.saturating_sub(1).max(1)) as f64);
        }
        Ok(Some(near))
    }
}

/// Finds, for each eps, the member of the funnel whose crossing is nearest to that of the smoothed
/// orbit, which `crossing` computes: a visit multiplies local errors by up to 10^28, so it needs
/// extended precision ([`passage`](super::passage)).
///
/// # Errors
/// Those of [`funnel`] and of the methods.
pub fn after_visit<P, const N: usize, const M: usize>(
    system: &P,
    question: &AfterVisitQuestion,
    mut crossing: impl FnMut(f64) -> Result<Option<Vec<f64>>, FilippovError>,
) -> Result<AfterVisit, FilippovError>
where
    P: PiecewiseSmooth<N> + Clone + Sync,
    for<'a> SlidingFlow<'a, P, N>: VectorField<M>,
{
    let AfterVisitQuestion { start, t_end, eps, grid, settings, .. } = question;
    let x0 = state::<N>(start)?;
    let family = funnel(system, x0, *t_end, settings, grid)?;
    let mut statistics = family.statistics.clone();
    family.members.iter().for_each(|m| statistics += &m.summary.statistics);
    let visit = (family.t, family.point);
    let mut futures = Futures { system, question, family, statistics };
    let first = futures.crossings(&futures.family.members);
    let mut width = 0.0_f64;
    for (i, a) in first.iter().enumerate() {
        for b in &first[..i] {
            width = width.max((a.state - b.state).norm());
        }
    }
    let mut rows = Vec::with_capacity(eps.len());
    for &eps in eps {
        let Some(crossing) = crossing(eps)? else { continue };
        let crossing = state::<N>(&crossing)?;
        let Some((member, distance)) = futures.nearest(&first, &crossing)? else { continue };
        rows.push(AfterVisitRow {
            eps,
            crossing: Failure::state(&crossing),
            nearest: member.record(),
            distance,
        });
    }
    Ok(AfterVisit {
        t_visit: visit.0,
        point: Failure::state(&visit.1),
        members: first.iter().map(Candidate::record).collect(),
        width,
        rows,
        statistics: futures.statistics,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use twofold_num::Elementary;
    use twofold_system::Caricature;

    #[test]
    fn steps_are_a_fraction_of_the_layer_and_never_long() {
        assert_eq!([1e-3, 1.0].map(layer_cap), [4e-3, 0.05]);
    }

    #[test]
    fn the_rate_of_a_power_is_its_exponent() {
        let rate =
            |power: f64| observed_rate([1e-1, 1e-2, 1e-4].map(|eps| [eps, 3.0 * pow(eps, power)]));
        for power in [1.0, 2.0, -0.5] {
            assert!((rate(power) - power).abs() < 1e-12, "{power}: {}", rate(power));
        }
        assert!(
            observed_rate([[0.1, 1.0]]).is_nan()
                && observed_rate([[0.1, 1.0], [0.1, 2.0]]).is_nan()
        );
    }

    /// A caricature whose two-fold is elsewhere.
    #[derive(Clone)]
    struct Moved(Caricature, [f64; 3]);
    impl Moved {
        fn own<S: Elementary>(&self, x: &SVector<S, 3>) -> SVector<S, 3> {
            SVector::from_fn(|i, _| x[i] - S::from_f64(self.1[i]))
        }
    }
    impl PiecewiseSmooth<3> for Moved {
        fn switching<S: Elementary>(&self, x: &SVector<S, 3>) -> S {
            self.0.switching(&self.own(x))
        }
        fn plus<S: Elementary>(&self, x: &SVector<S, 3>) -> SVector<S, 3> {
            self.0.plus(&self.own(x))
        }
        fn minus<S: Elementary>(&self, x: &SVector<S, 3>) -> SVector<S, 3> {
            self.0.minus(&self.own(x))
        }
    }

    #[test]
    fn the_search_finds_a_member_that_is_known() {
        // Four exit times, each a quarter longer than the one before. Over a wider range members
        // would come by the same places again: the funnel of a two-fold is self-similar.
        let longest = 1.2 * 1.25 * 1.25 * 1.25;
        let grid = FunnelGrid {
            shortest: 1.2,
            longest,
            times: 4,
            horizon: 12.0,
            until_two_fold: true,
            per_step: 1,
        };
        let system = Moved(Caricature::with_reinjection(1e-1, 1e-5), [1.0, 2.0, -3.0]);
        let question = |beyond| AfterVisitQuestion {
            start: vec![1.2, 2.0, -4.0],
            t_end: 80.0,
            eps: Vec::new(),
            beyond,
            grid,
            refinements: 3,
            finer: 5,
            settings: FilippovOptions::default(),
        };
        let (near, far) = (question(0.6), question(1.2));
        let family =
            funnel(&system, state::<3>(&near.start).unwrap(), 80.0, &near.settings, &grid).unwrap();
        assert!((family.point - SVector::from(system.1)).amax() < 1e-9, "{}", family.point);
        let mut futures =
            Futures { system: &system, question: &near, family, statistics: Statistics::default() };
        let all = futures.crossings(&futures.family.members);
        let first: Vec<_> = all.iter().filter(|c| c.side == Side::Minus).copied().collect();
        assert_eq!((all.len(), first.len()), (8, 4));
        // Three refinements, each of a half of the interval's logarithm, leave an eighth between
        // neighbours.
        for place in [0.59, 1.41, 1.59, 2.41] {
            let time = 1.2 * pow(1.25, place);
            let only = FunnelGrid { shortest: time, longest: time, times: 1, ..grid };
            let there = futures
                .family
                .members_on(&system, &near.settings, &only, Some(Side::Minus))
                .unwrap();
            let there = futures.crossings(&there)[0].state;
            let (found, distance) = futures.nearest(&first, &there).unwrap().unwrap();
            let off = ln(found.exit_time / time).abs() / ln(1.25);
            assert!(
                off < 0.045 && found.side == Side::Minus && distance < 0.02,
                "{place}: {off} {distance}"
            );
        }
        assert!(futures.nearest(&[], &all[0].state).unwrap().is_none());
        // Crossings are looked for at a distance from the two-fold, wherever that is.
        let away = |c: &Candidate<3>| (c.state - SVector::from(system.1)).norm();
        assert!(all.iter().all(|c| away(c) > 0.6) && all.iter().any(|c| away(c) < 1.2));
        futures.question = &far;
        let farther = futures.crossings(&futures.family.members);
        assert!(!farther.is_empty() && farther.iter().all(|c| away(c) > 1.2));

        // The whole answer: by eps, where there is a crossing; the width is the largest distance
        // between two members' crossings.
        let question = AfterVisitQuestion { eps: vec![1e-2, 1e-3], refinements: 0, ..near.clone() };
        let there = Failure::state(&all[2].state);
        let answer =
            after_visit(&system, &question, |eps| Ok((eps < 5e-3).then(|| there.clone()))).unwrap();
        let [row] = &answer.rows[..] else { panic!("{:?}", answer.rows) };
        assert_eq!(
            (row.eps, row.distance, &row.crossing, &row.nearest),
            (1e-3, 0.0, &there, &all[2].record())
        );
        assert_eq!(answer.members, all.iter().map(Candidate::record).collect::<Vec<_>>());
        let width = all
            .iter()
            .flat_map(|a| all.iter().map(|b| (a.state - b.state).norm()))
            .fold(0.0, f64::max);
        assert_eq!(answer.width, width);
    }
}
