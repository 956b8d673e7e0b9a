//! Reference orbits in double-double arithmetic (about 32 digits), against which methods are
//! measured.

use nalgebra::SVector;

use super::section::Direction;
pub use twofold_integrate::ensemble::SectionPlane;
use twofold_integrate::{
    Failure, Statistics, Stepper, StopReason, Taylor, Tolerance, roots::CrossingFinder,
};
use twofold_num::Arithmetic;
use twofold_num::{DoubleDouble, Elementary, Scalar};
use twofold_system::VectorField;

/// A point in double-double precision.
pub type ExtendedPoint<const N: usize = 3> = SVector<DoubleDouble, N>;

/// The local tolerance of reference orbits: below the precision of the arithmetic, since what a
/// step leaves out just before a two-fold has grown by 10^15 after it, and roundings, unlike it,
/// may cancel. Absolutely far below: at the two-fold every component is small.
pub const REFERENCE_TOLERANCE: Tolerance = Tolerance { rtol: 1e-33, atol: 1e-40 };

/// A surface whose crossings are recorded: the zeros of a height function, evaluated in the orbit's
/// arithmetic.
pub trait Surface<const N: usize> {
    /// The height of `x` over the surface.
    fn height<S: Elementary>(&self, x: &SVector<S, N>) -> S;
}

impl<const N: usize> Surface<N> for SectionPlane {
    fn height<S: Elementary>(&self, x: &SVector<S, N>) -> S {
        x[self.coordinate] - S::from_f64(self.value)
    }
}

/// A crossing of a surface, in double-double precision.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ExtendedCrossing<const N: usize = 3> {
    /// Time.
    pub t: DoubleDouble,
    /// State.
    pub x: ExtendedPoint<N>,
    /// Sense.
    pub direction: Direction,
}

impl<const N: usize> ExtendedCrossing<N> {
    /// The largest component of the state.
    pub fn extent(&self) -> f64 {
        self.x.iter().map(|c| c.to_f64().abs()).fold(0.0, f64::max)
    }
}

/// Crossings of a reference orbit, and how it ended.
#[derive(Clone, Debug, PartialEq)]
pub struct ReferenceOrbit<const N: usize = 3> {
    /// The crossings, in order of time.
    pub crossings: Vec<ExtendedCrossing<N>>,
    /// Work done.
    pub statistics: Statistics,
    /// [`StopReason::EndTime`], or [`StopReason::Observer`] when the count was reached.
    pub stop: StopReason,
}

/// The first `count` crossings of `surface` by the orbit through `x0` at t = 0, in double-double
/// arithmetic; fewer if `t_end` comes first. `decimal`: read the equation's constants as decimal
/// numbers ([`Constants::Decimal`](twofold_num::series::Constants)); without, the equation is the
/// one that `f64` methods solve.
///
/// # Errors
/// [`Failure`] of the method; [`Failure::TooManySteps`] on an orbit that takes more than two
/// million.
pub fn reference<F: VectorField<N>, const N: usize>(
    field: &F,
    x0: ExtendedPoint<N>,
    surface: impl Surface<N>,
    count: usize,
    t_end: f64,
    decimal: bool,
) -> Result<ReferenceOrbit<N>, Failure> {
    let mut stepper = Taylor::extended(REFERENCE_TOLERANCE);
    if decimal {
        stepper = stepper.with_decimal_constants();
    }
    stepper.restart_from(field, DoubleDouble::zero(), x0, t_end, f64::INFINITY)?;
    let mut found = Vec::new();
    let mut passages = CrossingFinder::default();
    while found.len() < count && stepper.state().0.to_f64() < t_end {
        next_crossings(&mut stepper, field, &surface, &mut passages, |crossing| {
            found.push(crossing)
        })?;
    }
    let stop = if found.len() >= count { StopReason::Observer } else { StopReason::EndTime };
    found.truncate(count);
    Ok(ReferenceOrbit { crossings: found, statistics: stepper.statistics().clone(), stop })
}

/// The first crossing of `surface` from (t, x) on, before `t_end`, that `wanted` accepts; the work
/// is added to `work`.
///
/// # Errors
/// Those of [`reference()`].
pub(super) fn first_crossing<F: VectorField<N>, const N: usize>(
    field: &F,
    (t, x): (DoubleDouble, ExtendedPoint<N>),
    surface: impl Surface<N>,
    wanted: impl Fn(&ExtendedCrossing<N>) -> bool,
    t_end: f64,
    work: &mut Statistics,
) -> Result<Option<ExtendedCrossing<N>>, Failure> {
    let mut stepper = Taylor::extended(REFERENCE_TOLERANCE);
    stepper.restart_from(field, t, x, t_end, f64::INFINITY)?;
    let mut found = None;
    let mut passages = CrossingFinder::default();
    while found.is_none() && stepper.state().0.to_f64() < t_end {
        next_crossings(&mut stepper, field, &surface, &mut passages, |c| {
            if found.is_none() && wanted(&c) {
                found = Some(c);
            }
        })?;
    }
    *work += stepper.statistics();
    Ok(found)
}

/// Steps of one reference orbit: a hundred times what orbits of some hundred units of time take; on
/// a stiff attractor, which takes as many per unit of time, they would never end.
const MOST_STEPS: u64 = 2_000_000;

/// One step; its crossings go to `found`.
fn next_crossings<F: VectorField<N>, const N: usize>(
    stepper: &mut Taylor<N, DoubleDouble>,
    field: &F,
    surface: &impl Surface<N>,
    passages: &mut CrossingFinder,
    mut found: impl FnMut(ExtendedCrossing<N>),
) -> Result<(), Failure> {
    if stepper.statistics().steps >= MOST_STEPS {
        let (t, x) = stepper.state();
        let state = Failure::state(&x.map(|c| c.to_f64()));
        return Err(Failure::TooManySteps { t: t.to_f64(), limit: MOST_STEPS, state });
    }
    let step = stepper.step(field)?;
    for passage in passages.in_step(&step, |x| surface.height(x)) {
        let (t, x) = refine(stepper, surface, passage.theta);
        found(ExtendedCrossing { t, x, direction: Direction::of(passage.upward) });
    }
    Ok(())
}

/// The crossing near the fraction `theta` of the last step, by the secant method: from 16 digits to
/// all.
pub(super) fn refine<const N: usize>(
    stepper: &Taylor<N, DoubleDouble>,
    surface: &impl Surface<N>,
    theta: f64,
) -> (DoubleDouble, ExtendedPoint<N>) {
    let height = |s| surface.height(&stepper.at(s).1);
    let mut a = DoubleDouble::new(theta, 1e-9);
    let mut b = DoubleDouble::from_f64(theta);
    let mut ha = height(a);
    for _ in 0..4 {
        let hb = height(b);
        if hb == ha || hb == DoubleDouble::zero() {
            break;
        }
        let next = b - hb * (b - a) / (hb - ha);
        (a, ha, b) = (b, hb, next);
    }
    stepper.at(b)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// x'' = -x.
    struct Oscillator;
    impl VectorField<2> for Oscillator {
        fn eval<S: Elementary>(&self, x: &SVector<S, 2>) -> SVector<S, 2> {
            SVector::from([x[1], -x[0]])
        }
    }

    const PLANE: SectionPlane = SectionPlane { coordinate: 0, value: 0.0 };

    fn start() -> ExtendedPoint<2> {
        SVector::from([1.0, 0.0].map(DoubleDouble::from_f64))
    }

    fn close(got: DoubleDouble, want: DoubleDouble) {
        assert!((got - want).abs().to_f64() < 1e-29, "{got:?} {want:?}");
    }

    #[test]
    fn crossings_have_thirty_digits() {
        let orbit = reference(&Oscillator, start(), PLANE, 10, 6.0, false).unwrap();
        // At pi/2 downwards and at 3 pi/2 upwards, with x' = -1 and 1.
        assert_eq!((orbit.crossings.len(), orbit.stop), (2, StopReason::EndTime));
        for (c, (half_turns, direction)) in
            orbit.crossings.iter().zip([(0.5, Direction::Down), (1.5, Direction::Up)])
        {
            close(c.t, DoubleDouble::PI * DoubleDouble::from_f64(half_turns));
            close(c.x[0], DoubleDouble::zero());
            close(c.x[1], DoubleDouble::from_f64(2.0 * half_turns - 2.0));
            assert_eq!(c.direction, direction);
        }
        // A sixth of a turn: cos = 1/2.
        let half =
            reference(&Oscillator, start(), SectionPlane { value: 0.5, ..PLANE }, 1, 6.0, false)
                .unwrap();
        assert_eq!((half.crossings.len(), half.stop), (1, StopReason::Observer));
        close(half.crossings[0].t * DoubleDouble::from_f64(3.0), DoubleDouble::PI);
    }

    #[test]
    fn as_many_crossings_as_asked_for() {
        for count in 1..4 {
            let orbit = reference(&Oscillator, start(), PLANE, count, 100.0, false).unwrap();
            assert_eq!((orbit.crossings.len(), orbit.stop), (count, StopReason::Observer));
        }
        let none = reference(&Oscillator, start(), PLANE, 1, 1.5, false).unwrap();
        assert_eq!((none.crossings.len(), none.stop), (0, StopReason::EndTime));
    }

    #[test]
    fn the_first_wanted_crossing_is_found_if_there_is_time() {
        let mut work = Statistics::default();
        let mut upward = |t_end| {
            let wanted = |c: &ExtendedCrossing<2>| c.direction == Direction::Up;
            first_crossing(
                &Oscillator,
                (DoubleDouble::zero(), start()),
                PLANE,
                wanted,
                t_end,
                &mut work,
            )
            .unwrap()
        };
        close(upward(20.0).unwrap().t, DoubleDouble::PI * DoubleDouble::from_f64(1.5));
        assert_eq!(upward(4.0), None);
        assert!(work.steps > 0);
    }

    #[test]
    fn the_extent_is_the_largest_component() {
        for x in [[1.0, -3.0], [-3.0, 1.0], [3.0, 0.0]] {
            let x = SVector::from(x.map(DoubleDouble::from_f64));
            assert_eq!(
                ExtendedCrossing { t: DoubleDouble::zero(), x, direction: Direction::Up }.extent(),
                3.0
            );
        }
    }
}
