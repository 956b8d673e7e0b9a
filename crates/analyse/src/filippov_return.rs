//! Return maps of discontinuous systems: closed orbits that cross the switching surface, or slide
//! on it.
//!
//! The map is as smooth as the fields as long as neighbouring orbits have the same events in the
//! same order (crossings, landings, departures by tangency; di Bernardo, Budd, Champneys &
//! Kowalczyk 2008, ch. 2.5 and 8): its derivative is then taken by central differences, and a
//! sliding stretch shows as multipliers that are zero. Where neighbours have other events, as at a
//! grazing orbit, there is no derivative, and where the orbit comes to a repelling stretch or a
//! two-fold there is no map: both are told.

use nalgebra::SVector;

use super::floquet::{Extent, FloquetOptions, ReturnPlane, Returned};
use twofold_integrate::filippov::{
    self, EventKind, ExitRule, FilippovError, FilippovObserver, Mode, ModeEvent, Side, SlidingFlow,
};
use twofold_integrate::roots::CrossingFinder;
use twofold_integrate::{Failure, Flow, Step};
use twofold_system::filippov::sliding_field;
use twofold_system::{PiecewiseSmooth, VectorField};

/// Why the return map, or its derivative, is not defined here.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Error {
    /// The motion could not go on.
    #[error(transparent)]
    Filippov(#[from] FilippovError),
    /// The orbit does not come back.
    #[error(
        "the orbit from {from:?} did not return to the plane within t = {within}: start nearer to \
            the closed orbit, or choose another plane"
    )]
    NoReturn {
        /// Start on the plane.
        from: Vec<f64>,
        /// Time given.
        within: f64,
    },
    /// The future is a set.
    #[error(
        "the orbit comes to a place from which it has many futures (t = {t}, state {state:?}): \
            there is no return map through it"
    )]
    SetValued {
        /// When.
        t: f64,
        /// The state.
        state: Vec<f64>,
    },
    /// The section lies where the orbit slides.
    #[error(
        "the orbit slides on the switching surface where it meets the plane: choose a plane that \
            it meets in flight"
    )]
    SlidesThere,
    /// The section meets the orbit on the surface.
    #[error(
        "the orbit meets the plane within {distance:e} of the switching surface, on whose other \
            side orbits have other events: choose another plane"
    )]
    OnSurface {
        /// Distance of the neighbouring orbits that were compared.
        distance: f64,
    },
    /// The orbit touches the surface.
    #[error(
        "the orbit grazes the switching surface: orbits within {distance:e} of it have other \
            events, and the return map has no derivative there"
    )]
    Grazing {
        /// Distance of the neighbouring orbits that were compared.
        distance: f64,
    },
}

/// The sequence of events on the way, without times and places.
type Itinerary = Vec<(std::mem::Discriminant<EventKind>, Option<Mode>, Option<Mode>)>;

/// Watches for crossings and set-valued moments.
struct ReturnObserver<const N: usize> {
    plane: ReturnPlane,
    returns: usize,
    passages: CrossingFinder,
    same: Vec<(f64, SVector<f64, N>, Mode)>,
    opposite: Vec<Vec<f64>>,
    itinerary: Itinerary,
    set_valued: Option<(f64, Vec<f64>)>,
    /// The box around what was seen.
    extent: Option<Extent<N>>,
}

impl<const N: usize> FilippovObserver<N> for ReturnObserver<N> {
    fn step(&mut self, mode: Mode, step: &Step<'_, N>) -> Flow {
        let extent = self.extent.get_or_insert_with(|| Extent::new(&step.x0));
        extent.add(|i| step.x1[i]);
        for p in self.passages.through_plane(step, self.plane.axis, self.plane.value) {
            let (t, x) = (step.time(p.theta), step.at(p.theta));
            if p.upward != self.plane.upward {
                self.opposite.push(Failure::state(&x));
            } else if self.same.len() < self.returns {
                self.same.push((t, x, mode));
            }
        }
        if self.same.len() >= self.returns || self.set_valued.is_some() {
            Flow::Stop
        } else {
            Flow::Continue
        }
    }

    fn event(&mut self, event: &ModeEvent<N>) -> Flow {
        let many = match event.kind {
            EventKind::EnteredRepelling
            | EventKind::TwoFoldReached { .. }
            | EventKind::Exit { .. }
            | EventKind::ExitAtBoundary { .. } => true,
            EventKind::StartedOnSurface => event.to == Some(Mode::SlidingRepelling),
            _ => false,
        };
        if many {
            self.set_valued.get_or_insert((event.t, Failure::state(&event.state)));
            return Flow::Stop;
        }
        self.itinerary.push((std::mem::discriminant(&event.kind), event.from, event.to));
        Flow::Continue
    }
}

/// A return without its derivative.
struct Plain<const N: usize> {
    point: SVector<f64, N>,
    time: f64,
    itinerary: Itinerary,
    same: Vec<Vec<f64>>,
    opposite: Vec<Vec<f64>>,
    extent: f64,
    /// The orbit's size as each state's unit has it.
    sizes: SVector<f64, N>,
    /// Each state's largest value.
    largest: SVector<f64, N>,
    passes: bool,
}

/// Differences are taken over this share of the orbit's extent, and over a tenth and a hundredth of
/// it where neighbours have other events.
const DIFFERENCE: f64 = 1e-5;
const SHARES: [f64; 3] = [1.0, 0.1, 0.01];

/// The return from `u`, a point of `plane`, after `returns` crossings in its direction, with the
/// derivative of the return map if it is asked for.
///
/// # Errors
/// [`enum@Error`].
pub fn return_map<P, const N: usize, const M: usize>(
    system: &P,
    plane: ReturnPlane,
    returns: usize,
    u: &SVector<f64, N>,
    settings: &FloquetOptions,
    derivative: bool,
) -> Result<Returned, Error>
where
    P: PiecewiseSmooth<N>,
    for<'a> SlidingFlow<'a, P, N>: VectorField<M>,
{
    let base = plain(system, plane, returns, u, settings)?;
    let (mut rows, mut derivative_error) = (Vec::new(), 0.0);
    if derivative {
        let grazes = base.itinerary.iter().any(|(kind, ..)| {
            *kind == std::mem::discriminant(&EventKind::Grazing { side: Side::Plus })
        });
        let size = DIFFERENCE * base.extent;
        let columns = SHARES.iter().find_map(|share| {
            let delta = base.sizes * (share * DIFFERENCE);
            // Some roundings of every component, over the difference.
            let rounding = (base.largest * (16.0 * f64::EPSILON)).component_div(&delta).amax();
            let of =
                |delta| columns(system, plane, returns, u, settings, &base, &delta).transpose();
            let (wide, narrow) = (of(delta)?, of(0.5 * delta)?);
            Some(wide.and_then(|wide| {
                let (rows, left_out) = extrapolated(&wide, &narrow?, &base.sizes);
                derivative_error = 6.0 * rounding + left_out;
                Ok(rows)
            }))
        });
        rows = match columns {
            Some(found) if !grazes => found?,
            _ => {
                let least = SHARES[SHARES.len() - 1];
                let distance = least * size;
                // Neighbours have other events if they begin on the other side.
                let is_above = |j: usize, by: f64| {
                    let mut moved = *u;
                    moved[j] += by * least * DIFFERENCE * base.sizes[j];
                    system.switching(&moved) > 0.0
                };
                let meets = |j: usize| is_above(j, 1.0) != is_above(j, -1.0);
                return Err(if !grazes && (0..N).any(|j| j != plane.axis && meets(j)) {
                    Error::OnSurface { distance }
                } else {
                    Error::Grazing { distance }
                });
            }
        };
    }
    Ok(Returned {
        point: Failure::state(&base.point),
        time: base.time,
        derivative: rows,
        same: base.same,
        opposite: base.opposite,
        extent: base.extent,
        sizes: Failure::state(&base.sizes),
        passes: base.passes,
        derivative_error,
        events: base.itinerary.len(),
    })
}

/// Derivatives by central differences over a distance and over half of it, extrapolated to none
/// (Richardson 1911), and what is left out: the next power of the distance, in which the map
/// changes as fast as in the one before.
fn extrapolated<const N: usize>(
    wide: &[f64],
    narrow: &[f64],
    sizes: &SVector<f64, N>,
) -> (Vec<f64>, f64) {
    let (mut entry, mut change) = (0.0_f64, 0.0_f64);
    for k in 0..N * N {
        let unit = sizes[k % N] / sizes[k / N];
        entry = entry.max((narrow[k] * unit).abs());
        change = change.max(((narrow[k] - wide[k]) * unit).abs());
    }
    let left_out = if change > 0.0 { change * (10.0 * change / entry).min(1.0) } else { 0.0 };
    (wide.iter().zip(narrow).map(|(w, n)| n + (n - w) / 3.0).collect(), left_out)
}

/// The derivative by differences over `delta` of each state, row by row; nothing if neighbours have
/// other events.
fn columns<P, const N: usize, const M: usize>(
    system: &P,
    plane: ReturnPlane,
    returns: usize,
    u: &SVector<f64, N>,
    settings: &FloquetOptions,
    base: &Plain<N>,
    delta: &SVector<f64, N>,
) -> Result<Option<Vec<f64>>, Error>
where
    P: PiecewiseSmooth<N>,
    for<'a> SlidingFlow<'a, P, N>: VectorField<M>,
{
    let mut rows = vec![0.0; N * N];
    for j in (0..N).filter(|j| *j != plane.axis) {
        let mut ends = [base.point; 2];
        for (end, sign) in ends.iter_mut().zip([1.0, -1.0]) {
            let mut moved = *u;
            moved[j] += sign * delta[j];
            let there = plain(system, plane, returns, &moved, settings)?;
            if there.itinerary != base.itinerary {
                return Ok(None);
            }
            *end = there.point;
        }
        for i in (0..N).filter(|i| *i != plane.axis) {
            rows[i * N + j] = (ends[0][i] - ends[1][i]) / (2.0 * delta[j]);
        }
    }
    Ok(Some(rows))
}

fn plain<P, const N: usize, const M: usize>(
    system: &P,
    plane: ReturnPlane,
    returns: usize,
    u: &SVector<f64, N>,
    settings: &FloquetOptions,
) -> Result<Plain<N>, Error>
where
    P: PiecewiseSmooth<N>,
    for<'a> SlidingFlow<'a, P, N>: VectorField<M>,
{
    // The rule is never used: a run stops where it would be.
    let rule = ExitRule::AtOnce { side: Side::Plus };
    let engine = filippov::FilippovOptions {
        tolerance: settings.tolerance,
        max_step: settings.max_step,
        ..Default::default()
    };
    let watch = || ReturnObserver {
        plane,
        returns,
        passages: CrossingFinder::default(),
        same: Vec::new(),
        opposite: Vec::new(),
        itinerary: Vec::new(),
        set_valued: None,
        extent: None,
    };
    let mut seen = watch();
    let end = filippov::run(system, *u, settings.longest_return, &engine, rule, &mut seen)?
        .within_budget()?;
    if let Some((t, state)) = seen.set_valued {
        return Err(Error::SetValued { t, state });
    }
    let Some((at, _, mode)) = seen.same.get(returns.saturating_sub(1)).copied() else {
        return Err(Error::NoReturn { from: Failure::state(u), within: end.t });
    };
    if mode.slides() {
        return Err(Error::SlidesThere);
    }
    // Land there by a run that ends there: the dense output is less accurate than the method.
    let landed = filippov::run(system, *u, at, &engine, rule, &mut watch())?.within_budget()?;
    let f = match mode {
        Mode::Plus => system.plus(&landed.x),
        Mode::Minus => system.minus(&landed.x),
        _ => sliding_field(system, &landed.x),
    };
    let dt = (plane.value - landed.x[plane.axis]) / f[plane.axis];
    let mut point = landed.x + f * dt;
    point[plane.axis] = plane.value;
    let side = match system.switching(u) {
        h if h > 0.0 => system.plus(u),
        h if h < 0.0 => system.minus(u),
        _ => f,
    };
    let extent = seen.extent.as_ref().map_or(0.0, Extent::diagonal);
    let sizes = seen.extent.as_ref().map(|extent| extent.sizes(settings.tolerance));
    let sizes = sizes.unwrap_or(SVector::zeros());
    let largest = seen.extent.as_ref().map_or(SVector::zeros(), Extent::largest);
    Ok(Plain {
        sizes,
        largest,
        extent,
        passes: (side[plane.axis] > 0.0) == plane.upward,
        point,
        time: landed.t + dt,
        itinerary: seen.itinerary,
        same: seen.same.iter().map(|(_, x, _)| Failure::state(x)).collect(),
        opposite: seen.opposite,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use twofold_integrate::Tolerance;
    use twofold_num::Elementary;

    /// s' = 1, y' = q'(s) with q(s) = s (s^2 - 1)(s^2 - 4), on both sides of an edge at a value of
    /// s or y: a system that is discontinuous in name only. y - q(s) stays what it is, so a return
    /// of a plane of y is a root of a polynomial.
    struct Quintic {
        edge: f64,
        of: usize,
    }
    impl PiecewiseSmooth<2> for Quintic {
        fn switching<S: Elementary>(&self, x: &SVector<S, 2>) -> S {
            x[self.of] - S::from_f64(self.edge)
        }
        fn plus<S: Elementary>(&self, x: &SVector<S, 2>) -> SVector<S, 2> {
            let s2 = x[0] * x[0];
            SVector::from([S::one(), (s2 * s2).scale(5.0) - s2.scale(15.0) + S::one().scale(4.0)])
        }
        fn minus<S: Elementary>(&self, x: &SVector<S, 2>) -> SVector<S, 2> {
            self.plus(x)
        }
    }

    fn settings(tolerance: f64) -> FloquetOptions {
        let tolerance = Tolerance { rtol: tolerance, atol: tolerance };
        FloquetOptions { tolerance, longest_return: 6.0, ..FloquetOptions::default() }
    }

    #[test]
    fn returns_of_a_polynomial_are_its_roots() {
        // Before the edge and after it the method is exact and its dense output, by which crossings
        // are found, is not: the crossing is landed on. Where the edge is crossed, the dense output
        // says.
        for (edge, value, tolerance) in
            [(9.0, 0.0, 1e-5), (9.0, 0.7, 1e-5), (-9.0, -3.0, 1e-5), (-0.3, 0.7, 1e-12)]
        {
            let plane = ReturnPlane { axis: 1, value, upward: true };
            let start = SVector::from([-2.0, value]);
            // Upwards at -2, 0, 2 with the slopes 24, 4, 24; the derivative is the slope at the
            // start over that at the end.
            for (returns, s, derivative) in [(1, 0.0, 6.0), (2, 2.0, 1.0)] {
                let r = return_map(
                    &Quintic { edge, of: 0 },
                    plane,
                    returns,
                    &start,
                    &settings(tolerance),
                    true,
                )
                .unwrap();
                assert!((r.point[0] - s).abs() < 1e-9 && r.point[1] == value, "{r:?}");
                assert!((r.time - (s + 2.0)).abs() < 1e-9, "{r:?}");
                assert!(
                    (r.derivative[0] - derivative).abs() < 1e-5 && r.derivative[1..] == [0.0; 3],
                    "{r:?}"
                );
                assert_eq!((r.same.len(), r.opposite.len()), (returns, returns));
                assert!(
                    r.opposite.iter().zip([-1.0, 1.0]).all(|(x, s)| (x[0] - s).abs() < 1e-3),
                    "{r:?}"
                );
                let plain = return_map(
                    &Quintic { edge, of: 0 },
                    plane,
                    returns,
                    &start,
                    &settings(tolerance),
                    false,
                )
                .unwrap();
                assert!(plain.derivative.is_empty() && plain.point == r.point);
            }
            let none =
                return_map(&Quintic { edge, of: 0 }, plane, 3, &start, &settings(tolerance), false);
            assert_eq!(none, Err(Error::NoReturn { from: vec![-2.0, value], within: 6.0 }));
        }
    }

    /// The return from -2 + d is at 6 d - 12.5 d^2 + 278.75 d^3: the last term, over the square of
    /// the difference, is 8e-7.
    #[test]
    fn a_bend_of_the_map_is_no_part_of_its_derivative() {
        let plane = ReturnPlane { axis: 1, value: 0.0, upward: true };
        let system = Quintic { edge: 9.0, of: 0 };
        let start = SVector::from([-2.0, 0.0]);
        let r = return_map(&system, plane, 1, &start, &settings(1e-12), true).unwrap();
        let error = (r.derivative[0] - 6.0).abs();
        assert!(error < r.derivative_error && r.derivative_error < 1e-8, "{error:e} {r:?}");
    }

    #[test]
    fn an_orbit_that_almost_touches_the_surface_has_no_derivative() {
        // Between -1 and 0 the orbit from (-2, 0) is lowest where q' = 0, at s^2 = (15 - sqrt
        // 145)/10.
        let s2 = 0.1 * (15.0 - twofold_num::elementary::sqrt(145.0));
        let lowest = -twofold_num::elementary::sqrt(s2) * (s2 - 1.0) * (s2 - 4.0);
        let of = |below: f64, derivative| {
            let plane = ReturnPlane { axis: 1, value: 0.0, upward: true };
            let system = Quintic { edge: lowest - below, of: 1 };
            return_map(&system, plane, 1, &SVector::from([-2.0, 0.0]), &settings(1e-12), derivative)
        };
        // Neighbours at 5e-5, 5e-6 and 5e-7 come 24 times as much lower, and all cross the surface;
        // the map itself is there.
        let Err(Error::Grazing { distance }) = of(1e-7, true) else { panic!("it grazes") };
        // Two wide, and as high as from the lowest point to the highest, at s^2 = (15 + sqrt
        // 145)/10.
        let s2 = 0.1 * (15.0 + twofold_num::elementary::sqrt(145.0));
        let highest = -twofold_num::elementary::sqrt(s2) * (s2 - 1.0) * (s2 - 4.0);
        let extent = twofold_num::elementary::sqrt(4.0 + (highest - lowest) * (highest - lowest));
        assert!((distance / (1e-7 * extent) - 1.0).abs() < 0.05, "{distance} {extent}");
        assert!(of(1e-7, false).is_ok());
        // The nearest two do not.
        let r = of(2e-5, true).unwrap();
        assert!((r.derivative[0] - 6.0).abs() < 1e-4, "{r:?}");
    }

    /// Where neighbours begin on both sides of the surface, on which they land at once.
    #[test]
    fn a_landing_at_the_plane_is_no_grazing() {
        struct Block;
        impl Block {
            fn side<S: Elementary>(x: &SVector<S, 2>, friction: f64) -> SVector<S, 2> {
                SVector::from([x[1], x[1].scale(0.1724) - x[0] + S::from_f64(friction)])
            }
        }
        impl PiecewiseSmooth<2> for Block {
            fn switching<S: Elementary>(&self, x: &SVector<S, 2>) -> S {
                x[1] - S::one()
            }
            fn plus<S: Elementary>(&self, x: &SVector<S, 2>) -> SVector<S, 2> {
                Self::side(x, -0.5)
            }
            fn minus<S: Elementary>(&self, x: &SVector<S, 2>) -> SVector<S, 2> {
                Self::side(x, 0.5)
            }
        }
        let plane = ReturnPlane { axis: 0, value: 0.0, upward: true };
        let options = FloquetOptions { longest_return: 30.0, ..settings(1e-11) };
        let of = |above: f64| {
            let start = SVector::from([0.0, 1.0 + above]);
            return_map(&Block, plane, 1, &start, &options, true)
        };
        for above in [1e-9, 1e-8, -1e-9] {
            assert!(matches!(of(above), Err(Error::OnSurface { .. })), "{above}: {:?}", of(above));
        }
        assert!(of(1e-6).is_ok_and(|r| r.derivative[3].abs() < 1e-8), "{:?}", of(1e-6));
    }

    /// A block on a belt in units `x` of length and `t` of time, its fields over `clock`, and `h`
    /// times its switching function: the closed orbit has the turning point 0.463089814616 and the
    /// period 6.736837191689.
    struct StickSlip {
        x: f64,
        t: f64,
        clock: f64,
        h: f64,
    }
    impl StickSlip {
        fn side<S: Elementary>(&self, s: &SVector<S, 2>, friction: f64) -> SVector<S, 2> {
            let (x, v) = (s[0].scale(1.0 / self.x), s[1].scale(self.t / self.x));
            let force = (v - S::from_f64(0.3)).scale(0.2) - x + S::from_f64(friction);
            let unit = self.x / self.t / self.clock;
            SVector::from([v.scale(unit), force.scale(unit / self.t)])
        }
    }
    impl PiecewiseSmooth<2> for StickSlip {
        fn switching<S: Elementary>(&self, s: &SVector<S, 2>) -> S {
            (s[1] - S::from_f64(0.3 * self.x / self.t)).scale(self.h)
        }
        fn plus<S: Elementary>(&self, s: &SVector<S, 2>) -> SVector<S, 2> {
            self.side(s, -1.0)
        }
        fn minus<S: Elementary>(&self, s: &SVector<S, 2>) -> SVector<S, 2> {
            self.side(s, 1.0)
        }
    }

    #[test]
    fn a_return_has_no_units() {
        let plane = ReturnPlane { axis: 1, value: 0.0, upward: true };
        let returned = |system: StickSlip| {
            let StickSlip { x, t, clock, h } = system;
            let tolerance = Tolerance { rtol: 1e-11, atol: 1e-11 * x.min(x / t).min(1.0) };
            let longest_return = 30.0 * t * clock;
            let options = FloquetOptions { tolerance, longest_return, ..FloquetOptions::default() };
            let start = SVector::from([0.463_089_814_616 * x, 0.0]);
            let found = return_map(&system, plane, 1, &start, &options, true);
            let r = found.unwrap_or_else(|e| panic!("{x:e} {t:e} {clock:e} {h:e}: {e}"));
            let time = r.time / (6.736_837_191_689 * t * clock) - 1.0;
            let place = r.point[0] / (0.463_089_814_616 * x) - 1.0;
            assert!(
                time.abs() < 1e-9 && place.abs() < 1e-9 && r.derivative[0].abs() < 1e-8,
                "{x:e} {t:e} {clock:e} {h:e}: {time} {place} {r:?}"
            );
        };
        for clock in [1e-12, 1e-9, 1e-3, 1.0, 1e6, 1e7, 1e8, 1e9, 1e12] {
            returned(StickSlip { x: 1.0, t: 1.0, clock, h: 1.0 });
        }
        for h in [1e-300, 1e-12, 1e12, 1e300] {
            returned(StickSlip { x: 1.0, t: 1.0, clock: 1.0, h });
        }
        for (x, t) in
            [(1e-9, 1e-9), (1.0, 1e-9), (1e-6, 1e-9), (1.0, 1e9), (1e-9, 1e-6), (1e9, 1.0)]
        {
            returned(StickSlip { x, t, clock: 1.0, h: 1.0 });
        }
    }

    #[test]
    fn a_plane_met_in_sliding_and_a_start_with_many_futures_are_refused() {
        /// Along y = 0 with the velocity 1; towards it, or away from it.
        struct Channel(f64);
        impl PiecewiseSmooth<2> for Channel {
            fn switching<S: Elementary>(&self, x: &SVector<S, 2>) -> S {
                x[1]
            }
            fn plus<S: Elementary>(&self, _: &SVector<S, 2>) -> SVector<S, 2> {
                SVector::from([S::one(), -S::from_f64(self.0)])
            }
            fn minus<S: Elementary>(&self, _: &SVector<S, 2>) -> SVector<S, 2> {
                SVector::from([S::one(), S::from_f64(self.0)])
            }
        }
        let of = |towards, y, value| {
            let plane = ReturnPlane { axis: 0, value, upward: true };
            return_map(
                &Channel(towards),
                plane,
                1,
                &SVector::from([0.0, y]),
                &settings(1e-9),
                false,
            )
        };
        // It lands at 1, and flies before.
        assert_eq!(of(1.0, 1.0, 2.0), Err(Error::SlidesThere));
        assert!((of(1.0, 1.0, 0.5).unwrap().point[1] - 0.5).abs() < 1e-12);
        // On the surface from the start.
        assert_eq!(of(1.0, 0.0, 2.0), Err(Error::SlidesThere));
        assert_eq!(of(-1.0, 0.0, 2.0), Err(Error::SetValued { t: 0.0, state: vec![0.0, 0.0] }));
    }
}
