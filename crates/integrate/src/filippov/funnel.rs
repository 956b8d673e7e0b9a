//! The funnel: all futures of a set-valued point, indexed by exit time and side.

use nalgebra::SVector;
use serde::{Deserialize, Serialize};

use super::engine::{Departure, Origin};
use super::exit::Chooser;
use super::two_fold::SlidingAtTwoFold;
use super::{
    ExitRule, FilippovError, FilippovOptions, FilippovSummary, Side, SlidingFlow, Trajectory,
    engine, flow::project,
};
use crate::{Statistics, StopReason};
use twofold_num::elementary::pow;
use twofold_system::filippov::{Region, region};
use twofold_system::{PiecewiseSmooth, Reversed, VectorField};

/// Grid of members of the funnel: exit times between the shortest and the longest, both sides of
/// each.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FunnelGrid {
    /// The shortest time of repelling sliding.
    pub shortest: f64,
    /// The longest time of repelling sliding. Members whose repelling region ends earlier leave
    /// there.
    pub longest: f64,
    /// Number of times, at least 1; spaced geometrically, because the funnel is self-similar at a
    /// two-fold.
    pub times: usize,
    /// Follow each member at most so long after the set-valued point.
    pub horizon: f64,
    /// Stop a member when it next comes to a two-fold: there the funnel begins again.
    pub until_two_fold: bool,
    /// Recorded points a step.
    pub per_step: usize,
}

/// One future.
#[derive(Clone, Debug)]
pub struct FunnelMember<const N: usize> {
    /// Time of repelling sliding asked for.
    pub exit_time: f64,
    /// The side left to.
    pub side: Side,
    /// The orbit from the set-valued point on.
    pub trajectory: Trajectory<N>,
    /// End and work of its run.
    pub summary: FilippovSummary<N>,
}

/// The orbit up to the set-valued point and its futures.
#[derive(Clone, Debug)]
pub struct Funnel<const N: usize> {
    /// The orbit up to there.
    pub approach: Trajectory<N>,
    /// The moment at which the future becomes a set.
    pub t: f64,
    /// The point.
    pub point: SVector<f64, N>,
    /// Whether it is a two-fold (or else a point of the repelling region).
    pub at_two_fold: bool,
    /// Work of the approach.
    pub statistics: Statistics,
    /// The futures: by exit time, plus before minus.
    pub members: Vec<FunnelMember<N>>,
}

/// The most points that all members of a funnel have together: 0.6 GB.
const MOST_POINTS: usize = 20_000_000;

/// Follows the orbit of `x0` to the first point where its future is a set, then that set:
/// [`ExitRule::All`].
///
/// ```
/// use nalgebra::Vector3;
/// use twofold_integrate::filippov::{FilippovOptions, FunnelGrid, funnel};
/// use twofold_system::System;
/// let normal_form = System::builtin("two-fold").expect("built in").bind::<3>()?;
/// let grid = FunnelGrid {
///     shortest: 0.1,
///     longest: 1.0,
///     times: 2,
///     horizon: 1.0,
///     until_two_fold: true,
///     per_step: 1,
/// };
/// let start = Vector3::new(0.0, 0.5, 0.5); // attracting sliding
/// let futures = funnel(&normal_form, start, 100.0, &FilippovOptions::default(), &grid)?;
/// assert!(futures.at_two_fold);
/// assert_eq!(futures.members.len(), 4); // two exit times, two sides
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// [`FilippovError::NoSuchExit`] if no set-valued point is reached by `t_end`; those of
/// [`run`](super::run).
pub fn funnel<P, const N: usize, const M: usize>(
    system: &P,
    x0: SVector<f64, N>,
    t_end: f64,
    settings: &FilippovOptions,
    grid: &FunnelGrid,
) -> Result<Funnel<N>, FilippovError>
where
    P: PiecewiseSmooth<N>,
    for<'a> SlidingFlow<'a, P, N>: VectorField<M>,
{
    let mut approach = Trajectory::new(grid.per_step);
    let there =
        super::run(system, x0, t_end, settings, ExitRule::All, &mut approach)?.within_budget()?;
    if there.stop != StopReason::SetValued {
        return Err(FilippovError::NoSuchExit {
            t: there.t,
            state: there.x.iter().copied().collect(),
            why: "the orbit came to no set-valued point before the end time; extend the run",
        });
    }
    let point = project(system, &there.x);
    let mut family = Funnel {
        approach,
        t: there.t,
        point,
        at_two_fold: there.mode.is_none(),
        statistics: there.statistics,
        members: Vec::new(),
    };
    family.members = family.members_on(system, settings, grid, None)?;
    Ok(family)
}

/// The past of a point of the repelling region, in forward time: the sliding orbit that leads from
/// where repelling sliding began (a two-fold, if it runs back into one) to `x`, with time 0 at its
/// beginning.
///
/// At a two-fold whose sliding flow is a node every point of the repelling region has such a past:
/// the full set of futures of the two-fold has, besides exit time and side, the sliding orbit as a
/// third index. [`funnel`] follows the analytic one; the others are reached by running on from any
/// `x`.
///
/// # Errors
/// [`FilippovError::NoSuchExit`] if `x` is not in the repelling region, or its past does not end by
/// `longest`.
pub fn history<P, const N: usize, const M: usize>(
    system: &P,
    x: SVector<f64, N>,
    longest: f64,
    settings: &FilippovOptions,
    per_step: usize,
) -> Result<Trajectory<N>, FilippovError>
where
    P: PiecewiseSmooth<N> + Clone,
    for<'a> SlidingFlow<'a, Reversed<P>, N>: VectorField<M>,
{
    let refuse =
        |why| FilippovError::NoSuchExit { t: 0.0, state: x.iter().copied().collect(), why };
    let on_surface = project(system, &x);
    if region(system, &on_surface) != Region::Repelling {
        return Err(refuse("it has a sliding past only in the repelling region"));
    }
    // Reversed, repelling sliding attracts and its past is a future. It stops at its first event
    // after the start.
    let mut back = Trajectory::new(per_step).until_events(2);
    let end = super::run(
        &Reversed(system.clone()),
        on_surface,
        longest,
        settings,
        ExitRule::All,
        &mut back,
    )?
    .within_budget()?;
    if end.stop == StopReason::EndTime {
        return Err(refuse("its past is longer than the given time"));
    }
    Ok(back.turned(end.t))
}

/// A trajectory from `a` to `b` through a two-fold: the future of `a` up to the singularity, then a
/// past of `b` from there on. That two such points are joined by a trajectory in finite time is
/// what Jeffrey (2013, sec. 3) calls non-deterministic chaos. Events are those of the first part;
/// the second part's pieces tell its modes.
///
/// # Errors
/// [`FilippovError::NoSuchExit`] if the future of `a` or the past of `b` comes to no two-fold
/// within `longest`, or to different ones.
pub fn connect<P, const N: usize, const M: usize>(
    system: &P,
    a: SVector<f64, N>,
    b: SVector<f64, N>,
    longest: f64,
    settings: &FilippovOptions,
    per_step: usize,
) -> Result<Trajectory<N>, FilippovError>
where
    P: PiecewiseSmooth<N> + Clone,
    for<'a> SlidingFlow<'a, P, N>: VectorField<M>,
    for<'a> SlidingFlow<'a, Reversed<P>, N>: VectorField<M>,
{
    let mut path = Trajectory::new(per_step);
    let there =
        super::run(system, a, longest, settings, ExitRule::All, &mut path)?.within_budget()?;
    let mut past = Trajectory::new(per_step);
    let back =
        super::run(&Reversed(system.clone()), b, longest, settings, ExitRule::All, &mut past)?
            .within_budget()?;
    let refuse = |x: &SVector<f64, N>, why| FilippovError::NoSuchExit {
        t: there.t,
        state: x.iter().copied().collect(),
        why,
    };
    if there.stop != StopReason::SetValued || there.mode.is_some() {
        return Err(refuse(
            &there.x,
            "the future of the first point comes to no two-fold in the given time",
        ));
    }
    if back.stop != StopReason::SetValued || back.mode.is_some() {
        return Err(refuse(
            &back.x,
            "the past of the second point comes from no two-fold in the given time",
        ));
    }
    if (there.x - back.x).amax() > 1e-9 * (1.0 + there.x.amax()) {
        return Err(refuse(&back.x, "the past of the second point comes from another two-fold"));
    }
    path.pieces.extend(past.turned(there.t + back.t).pieces);
    Ok(path)
}

impl<const N: usize> Funnel<N> {
    /// The futures on another grid; of one side only, if given.
    ///
    /// # Errors
    /// Those of [`run`](super::run).
    pub fn members_on<P, const M: usize>(
        &self,
        system: &P,
        settings: &FilippovOptions,
        grid: &FunnelGrid,
        only: Option<Side>,
    ) -> Result<Vec<FunnelMember<N>>, FilippovError>
    where
        P: PiecewiseSmooth<N>,
        for<'a> SlidingFlow<'a, P, N>: VectorField<M>,
    {
        let departure = if self.at_two_fold {
            Departure::TwoFold(SlidingAtTwoFold::near(system, &self.point).map(Box::new))
        } else {
            Departure::Repelling
        };
        let mut members = Vec::new();
        let mut points = 0;
        for k in 0..grid.times {
            let fraction = if grid.times > 1 { k as f64 / (grid.times - 1) as f64 } else { 1.0 };
            let exit_time = grid.shortest * pow(grid.longest / grid.shortest, fraction);
            for side in [Side::Plus, Side::Minus] {
                if only.is_some_and(|s| s != side) {
                    continue;
                }
                let mut trajectory = Trajectory::new(grid.per_step);
                if grid.until_two_fold {
                    trajectory = trajectory.until_two_fold();
                }
                let mut chooser = Chooser::new(ExitRule::AfterTime { time: exit_time, side });
                let origin = Origin { t: self.t, x: self.point, departure: departure.clone() };
                let until = self.t + grid.horizon;
                let summary = engine::run_from(
                    system,
                    origin,
                    until,
                    settings,
                    &mut chooser,
                    &mut trajectory,
                    &(),
                )?
                .within_budget()?;
                points += trajectory.points().count();
                if points > MOST_POINTS {
                    return Err(FilippovError::TooManyPoints {
                        limit: MOST_POINTS,
                        members: members.len(),
                    });
                }
                members.push(FunnelMember { exit_time, side, trajectory, summary });
            }
        }
        Ok(members)
    }
}
