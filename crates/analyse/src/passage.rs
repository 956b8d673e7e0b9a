//! Passage of smoothed orbits through a two-fold, for stiffness parameters far smaller than other
//! modules can treat.
//!
//! **The law.** Near a two-fold at the origin of the normal form (Jeffrey 2013, eq. 4), x = eps u
//! and (y, z, t) = sqrt(eps) (Y, Z, T) remove eps: to leading order there is one inner problem, and
//! powers of eps count how often a motion has shrunk or grown on its way through it. The
//! desingularised sliding flow (y, z)' = (z + v- y, y + v+ z) has a weak and a strong eigenvalue;
//! with mu their ratio, a disturbance made at the singularity across the layer leaves it eps^(-1/(2
//! mu)) larger, one made along it eps^(-(1/mu - 1)/2), one carried in from outside eps^(1/2):
//! smaller. The straight line along the weak eigenvector, x = const, is a solution of the inner
//! problem (the canard that Kristiansen & Hogan 2015 find by blow-up); linearised about it, x
//! satisfies Weber's equation xi'' + a (T xi)' + b xi = 0 with a the weak eigenvalue times phi'(u)
//! there and b/a = -1/mu. [`Predicted`] has these numbers and what Weber's equation adds to the
//! powers: logarithms.
//!
//! **The method.** An orbit that comes in slides along a strongly attracting surface, where
//! explicit methods need a number of steps in proportion to 1/eps; errors made there shrink, as the
//! law says of all that is carried in. So it is followed by an implicit method in `f64` where it
//! slides, and by Taylor series that resolve the layer elsewhere. What is made at the singularity
//! grows: from [`HANDOVER`] on the arithmetic is double-double.

use nalgebra::SVector;
use serde::{Deserialize, Serialize};

use super::reference::{
    ExtendedCrossing, ExtendedPoint, REFERENCE_TOLERANCE, SectionPlane, first_crossing, refine,
};
use twofold_integrate::roots::CrossingFinder;
use twofold_integrate::{
    Failure, Flow, Observer, Radau5, Statistics, Step, Stepper, Taylor, Tolerance,
};
use twofold_num::elementary::sqrt;
use twofold_num::{Arithmetic, DoubleDouble, Scalar};
use twofold_system::VectorField;

/// Beyond this distance from the two-fold the incoming orbit is followed in `f64`. An error made
/// here leaves the singularity HANDOVER^(1 - 1/mu) times as large as one made at distance 1, and
/// that one shrinks by sqrt(eps): 1e-13 becomes less than 1e-7 at eps = 1e-2, and less and less
/// below.
pub const HANDOVER: f64 = 0.1;
/// Lower bound of the handover distance, in units of sqrt(eps).
const HANDOVER_INNER: f64 = 12.0;
/// Local tolerance of the incoming orbit in flight.
const FLIGHT: Tolerance = Tolerance { rtol: 1e-17, atol: 1e-17 };
/// Local tolerance of the incoming orbit while it slides.
const SLIDING: Tolerance = Tolerance { rtol: 1e-13, atol: 1e-15 };
/// Longest step of the incoming orbit.
const SLIDING_STEP: f64 = 0.02;
/// It slides while |x| is below so many eps and y, z > 0.
const IN_LAYER: f64 = 2.0;
/// A passage through the section with no component larger than so many sqrt(eps) is the visit.
const NEAR: f64 = 1.0;
/// The first passage through the surface farther out than so many sqrt(eps) counts as an exit.
const OFF: f64 = 1.0;
/// The surface is left where |x| first exceeds so many eps after the visit: more than hysteresis
/// swings near the two-fold.
const LEAVES: f64 = 3.0;
/// Most steps of one orbit.
const MOST_STEPS: u64 = 50_000_000;

/// The law's predictions for the normal form with constants v+, v-: formulas only.
///
/// ```
/// use twofold_analyse::passage::Predicted;
/// let law = Predicted::of(-1.2, -1.4);
/// assert!((1.0 / law.mu - 7.8).abs() < 0.1);
/// // A disturbance across the layer grows like eps^(-3.9).
/// assert!((law.across() + 3.9).abs() < 0.05);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Predicted {
    /// The weak eigenvalue of the desingularised sliding flow; the strong one is v+ + v- less this.
    pub weak: f64,
    /// Weak over strong.
    pub mu: f64,
    /// phi on the canard.
    pub phi: f64,
    /// (y', z') on the canard.
    pub velocity: [f64; 2],
    /// By what a turn around the two-fold outside the layer expands: the larger root of l + 1/l = 4
    /// v+ v- - 2.
    pub turn: f64,
}

impl Predicted {
    /// The formulas at v+, v-. Both must be negative and v+ v- > 1 (otherwise the numbers mean
    /// nothing).
    pub fn of(v_plus: f64, v_minus: f64) -> Self {
        let (mean, half) = (0.5 * (v_plus + v_minus), 0.5 * (v_plus - v_minus));
        let root = sqrt(half * half + 1.0);
        let (weak, strong) = (mean + root, mean - root);
        // The weak eigenvector is (1, weak - v-); phi = z/(y + z) there.
        let slope = weak - v_minus;
        let phi = slope / (1.0 + slope);
        let trace = 4.0 * v_plus * v_minus - 2.0;
        Self {
            weak,
            mu: weak / strong,
            phi,
            velocity: [phi + v_minus * (1.0 - phi), v_plus * phi + (1.0 - phi)],
            turn: 0.5 * (trace + sqrt(trace * trace - 4.0)),
        }
    }

    /// The power of eps by which a disturbance made across the layer grows: -1/(2 mu).
    pub fn across(&self) -> f64 {
        -0.5 / self.mu
    }

    /// The same along it: -(1/mu - 1)/2.
    pub fn along(&self) -> f64 {
        -0.5 * (1.0 / self.mu - 1.0)
    }

    /// The same for one carried in.
    pub fn carried(&self) -> f64 {
        0.5
    }

    /// d(z^2/eps)/d ln(1/eps) of the place where the surface is left, where z^2/eps = `z2` and the
    /// transition function has the slope `slope` (in h/eps) at the canard.
    ///
    /// Along the canard a deviation grows like T^(-1/mu) exp(|a| T^2/2), a = weak * slope, z =
    /// velocity T; it enters with size eps^((1/mu - 1)/2) and the surface is left when it is of
    /// order 1. Differentiated by ln(1/eps); for `z2` = infinity the asymptotic value.
    pub fn selection(&self, slope: f64, z2: f64) -> f64 {
        let a = self.weak.abs() * slope;
        let speed2 = self.velocity[1] * self.velocity[1];
        speed2 * (1.0 / self.mu - 1.0) / (a - speed2 / (self.mu * z2))
    }

    /// Correction of the powers [`Predicted::across`] and [`Predicted::along`] by the logarithm at
    /// a given eps, where z^2/eps = `z2`: the growth has 1/T as a factor (the faster the deviation
    /// grows when the surface is left, the less the place moves).
    pub fn correction(&self, slope: f64, z2: f64) -> f64 {
        0.5 * self.selection(slope, z2) / z2
    }
}

/// Options of [`passage()`]: everything that it depends on besides equation and eps.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PassageQuestion {
    /// The start, at t = 0. The first component is the switching function; the two-fold is the
    /// origin.
    pub start: [f64; 3],
    /// The second component is zero at visits and exits of the kind in which growth is measured:
    /// farther out than so many sqrt(eps).
    pub beyond: f64,
    /// When disturbances are made, relative to the visit, in units of sqrt(eps); increasing; may be
    /// empty.
    pub offsets: Vec<f64>,
    /// Size of disturbances made at t = 0; 0: none is made.
    pub carried: f64,
    /// Follow the orbit to its first upward passage through x = 0 this far from the two-fold; 0:
    /// not so far.
    pub far: f64,
    /// Everything must have happened before this time.
    pub by: f64,
}

impl PassageQuestion {
    /// The way to the far exit, without disturbances.
    pub fn far(start: [f64; 3], far: f64, by: f64) -> Self {
        Self { start, beyond: 3.0, offsets: Vec::new(), carried: 0.0, far, by }
    }
}

/// Growth of disturbances made at one moment, until the exit.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Disturbed {
    /// The moment relative to the visit, in units of sqrt(eps).
    pub offset: f64,
    /// By the component that was disturbed.
    pub factors: [f64; 3],
}

/// The answer to a [`PassageQuestion`]. What did not happen in time is absent.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PassageAnswer {
    /// When y = 0 was passed within sqrt(eps) of the two-fold.
    pub visit: Option<f64>,
    /// Point at which the surface was left: [`Leaving`].
    pub leaving: Option<[f64; 3]>,
    /// The first passage through x = 0 after the visit, farther out than sqrt(eps).
    pub surface: Option<[f64; 3]>,
    /// The first passage through y = 0 after the visit, farther out than `beyond` sqrt(eps).
    pub exit: Option<[f64; 3]>,
    /// The far exit.
    pub far: Option<[f64; 3]>,
    /// Growth of disturbances made near the visit, by moment.
    pub growth: Vec<Disturbed>,
    /// Growth until the exit of disturbances made at t = 0, by component.
    pub carried: Option<[f64; 3]>,
    /// Work of all orbits.
    pub statistics: Statistics,
}

/// The section on which visits and exits lie.
const SECTION: SectionPlane = SectionPlane { coordinate: 1, value: 0.0 };
/// The switching surface.
const SURFACE: SectionPlane = SectionPlane { coordinate: 0, value: 0.0 };

/// The larger of |y|, |z|.
fn extent(x: &SVector<f64, 3>) -> f64 {
    x[1].abs().max(x[2].abs())
}

fn nearest(x: &ExtendedPoint) -> SVector<f64, 3> {
    x.map(|c| c.to_f64())
}

/// Watches an orbit for the place where it leaves the switching surface behind a two-fold at the
/// origin: where |x| first exceeds 3 eps after the orbit has been within sqrt(eps). The rule does
/// not depend on how the switch is smoothed, so that hysteresis and noise can be asked the same;
/// linear between steps, which are short in the layer. A kick that leads out of it ends where it
/// leads.
#[derive(Clone, Copy, Debug)]
pub struct Leaving {
    eps: f64,
    visited: bool,
    last: Option<[f64; 3]>,
    left: Option<[f64; 3]>,
}

impl Leaving {
    /// For a layer of half-width `eps`.
    pub fn new(eps: f64) -> Self {
        Self { eps, visited: false, last: None, left: None }
    }

    /// The next state; states of one orbit in order.
    pub fn see(&mut self, x: [f64; 3]) {
        if self.left.is_some() {
            return;
        }
        self.visited |= x[1].abs().max(x[2].abs()) < sqrt(self.eps) * NEAR;
        let edge = LEAVES * self.eps;
        if let Some(before) = self.last
            && self.visited
            && before[0].abs() <= edge
            && x[0].abs() > edge
        {
            let share = (edge - before[0].abs()) / (x[0].abs() - before[0].abs());
            self.left = Some(std::array::from_fn(|i| before[i] + share * (x[i] - before[i])));
        }
        self.last = Some(x);
    }

    /// Point at which the surface was left, once it is known.
    pub fn place(&self) -> Option<[f64; 3]> {
        self.left
    }
}

impl<const N: usize> Observer<N> for Leaving {
    fn step(&mut self, step: &Step<'_, N>) -> Flow {
        if let [x, y, z, ..] = step.x1.as_slice() {
            self.see([*x, *y, *z]);
        }
        if self.left.is_some() { Flow::Stop } else { Flow::Continue }
    }
    fn kick(&mut self, _: f64, _: &SVector<f64, N>, after: &SVector<f64, N>) {
        if let [x, y, z, ..] = after.as_slice() {
            let (after, edge) = ([*x, *y, *z], LEAVES * self.eps);
            let within = self.last.is_some_and(|before| before[0].abs() <= edge);
            if self.left.is_none() && self.visited && within && after[0].abs() > edge {
                self.left = Some(after);
            }
            self.last = Some(after);
        }
    }
}

/// Follows the orbit from `start` in `f64` until it is near the two-fold. `None` if it is not in
/// time.
fn approach<F: VectorField<3>>(
    field: &F,
    start: SVector<f64, 3>,
    eps: f64,
    by: f64,
    work: &mut Statistics,
) -> Result<Option<(f64, SVector<f64, 3>)>, Failure> {
    let near = HANDOVER.max(HANDOVER_INNER * sqrt(eps));
    let slides = |x: &SVector<f64, 3>| x[0].abs() < IN_LAYER * eps && x[1] > 0.0 && x[2] > 0.0;
    let (mut flight, mut sliding) = (Taylor::<3>::new(FLIGHT), Radau5::<3>::new(SLIDING));
    let (mut t, mut x) = (0.0, start);
    // Whether the method that holds the state is the implicit one; none at the start.
    let mut implicit = None;
    while x.amax() >= near && t < by {
        let steps = flight.statistics().steps + sliding.statistics().steps;
        if steps >= MOST_STEPS {
            return Err(Failure::TooManySteps { t, limit: MOST_STEPS, state: Failure::state(&x) });
        }
        let now = slides(&x);
        let step = match (now, implicit == Some(now)) {
            (true, known) => {
                if !known {
                    sliding.restart(field, t, x, by, SLIDING_STEP)?;
                }
                sliding.step(field)?
            }
            (false, known) => {
                if !known {
                    flight.restart(field, t, x, by, f64::INFINITY)?;
                }
                flight.step(field)?
            }
        };
        implicit = Some(now);
        (t, x) = (step.t1, step.x1);
    }
    *work += flight.statistics();
    *work += sliding.statistics();
    Ok((t < by).then_some((t, x)))
}

/// An orbit in extended precision: what happened, and states to start again from.
struct Followed {
    passage: PassageAnswer,
    steps: Vec<(DoubleDouble, ExtendedPoint)>,
}

/// Follows the orbit through its visit and on.
fn follow<F: VectorField<3>>(
    field: &F,
    (t, x): (f64, SVector<f64, 3>),
    eps: f64,
    question: &PassageQuestion,
) -> Result<Followed, Failure> {
    let scale = sqrt(eps);
    let mut stepper = Taylor::<3, DoubleDouble>::extended(REFERENCE_TOLERANCE);
    stepper.restart_from(
        field,
        DoubleDouble::from_f64(t),
        x.map(DoubleDouble::from_f64),
        question.by,
        f64::INFINITY,
    )?;
    let (mut sections, mut surfaces) = (CrossingFinder::default(), CrossingFinder::default());
    let mut leaving = Leaving::new(eps);
    let mut found = PassageAnswer::default();
    let mut steps = vec![stepper.state()];
    while stepper.state().0.to_f64() < question.by {
        if stepper.statistics().steps >= MOST_STEPS {
            let (t, x) = stepper.state();
            return Err(Failure::TooManySteps {
                t: t.to_f64(),
                limit: MOST_STEPS,
                state: Failure::state(&nearest(&x)),
            });
        }
        let step = stepper.step(field)?;
        let (of_section, of_surface) =
            (sections.in_step(&step, |x| x[1]), surfaces.in_step(&step, |x| x[0]));
        for p in of_section {
            let (t, x) = refine(&stepper, &SECTION, p.theta);
            let (t, x) = (t.to_f64(), nearest(&x));
            if found.visit.is_none() && extent(&x) < NEAR * scale {
                found.visit = Some(t);
            } else if found.visit.is_some()
                && found.exit.is_none()
                && extent(&x) >= question.beyond * scale
            {
                found.exit = Some(x.into());
            }
        }
        for p in of_surface {
            let (t, x) = refine(&stepper, &SURFACE, p.theta);
            let (t, x) = (t.to_f64(), nearest(&x));
            if found.visit.is_none_or(|visit| t < visit) {
                continue;
            }
            if found.surface.is_none() && extent(&x) >= OFF * scale {
                found.surface = Some(x.into());
            }
            if found.far.is_none() && question.far > 0.0 && p.upward && x.norm() > question.far {
                found.far = Some(x.into());
            }
        }
        let (t, x) = stepper.state();
        leaving.see(nearest(&x).into());
        found.leaving = leaving.place();
        if found.exit.is_none() {
            steps.push((t, x));
        }
        let near_done = found.exit.is_some() && found.surface.is_some() && found.leaving.is_some();
        if near_done && (question.far <= 0.0 || found.far.is_some()) {
            break;
        }
    }
    found.statistics += stepper.statistics();
    Ok(Followed { passage: found, steps })
}

/// Largest response to a disturbance, in units of sqrt(eps), treated as linear (relative error
/// about 1e-3).
const LARGEST_RESPONSE: f64 = 1e-4;
/// Smallest response, in units of sqrt(eps), far above amplified rounding errors for eps >= 1e-6.
const SMALLEST_RESPONSE: f64 = 1e-7;
/// Aimed at. At eps = 1e-7 rounding near the visit is worth some 1e-7 of response: when 1e-5 was
/// aimed at, growth there was measured to a per cent only.
const RESPONSE: f64 = 5e-5;
/// Smallest disturbance, in units of eps across and sqrt(eps) along the layer: far above the
/// spacing of double-double numbers.
const SMALLEST_SIZE: f64 = 1e-30;
/// A disturbance must be small.
const LARGEST_SIZE: f64 = 1e-5;
/// Trials of a size.
const TRIALS: usize = 8;

/// Measures growth from the checkpoints of an orbit.
fn growth<F: VectorField<3>>(
    field: &F,
    eps: f64,
    followed: &mut Followed,
    question: &PassageQuestion,
) -> Result<(), Failure> {
    let Some(visit) = followed.passage.visit else { return Ok(()) };
    let scale = sqrt(eps);
    let mut work = Statistics::default();
    let wanted = |c: &ExtendedCrossing| extent(&nearest(&c.x)) >= question.beyond * scale;
    let mut stepper = Taylor::<3, DoubleDouble>::extended(REFERENCE_TOLERANCE);
    // In the units of the inner problem; the first guess is a small one.
    let mut sizes = [1e-16; 3];
    for &offset in &question.offsets {
        let moment = visit + offset * scale;
        let before = followed.steps.iter().rev().find(|(t, _)| t.to_f64() < moment);
        let (Some(&(t, x)), true) = (before, followed.passage.exit.is_some()) else { continue };
        stepper.restart_from(field, t, x, moment, f64::INFINITY)?;
        while stepper.state().0.to_f64() < moment {
            stepper.step(field)?;
        }
        let (t, x) = stepper.state();
        let Some(undisturbed) =
            first_crossing(field, (t, x), SECTION, wanted, question.by, &mut work)?
        else {
            continue;
        };
        let mut factors = [f64::NAN; 3];
        for component in 0..3 {
            let unit = if component == 0 { eps } else { scale };
            let size = &mut sizes[component];
            for _ in 0..TRIALS {
                let mut disturbed = x;
                disturbed[component] += DoubleDouble::from_f64(*size * unit);
                let moved =
                    first_crossing(field, (t, disturbed), SECTION, wanted, question.by, &mut work)?;
                let response =
                    moved.map_or(f64::INFINITY, |m| nearest(&(m.x - undisturbed.x)).amax() / scale);
                factors[component] = response * scale / (*size * unit);
                let inside = (SMALLEST_RESPONSE..=LARGEST_RESPONSE).contains(&response);
                // Far off, the response is no measure of itself.
                let next = (*size * (RESPONSE / response).clamp(1e-6, 1e6))
                    .clamp(SMALLEST_SIZE, LARGEST_SIZE);
                if inside || next == *size {
                    break;
                }
                *size = next;
            }
        }
        followed.passage.growth.push(Disturbed { offset, factors });
    }
    work += stepper.statistics();
    followed.passage.statistics += &work;
    Ok(())
}

/// Follows the orbit of `field`, whose switch has the width `eps`, through its first visit to the
/// two-fold at the origin.
///
/// # Errors
/// [`Failure`] of an orbit.
pub fn passage<F: VectorField<3>>(
    field: &F,
    eps: f64,
    question: &PassageQuestion,
) -> Result<PassageAnswer, Failure> {
    let mut work = Statistics::default();
    let start = SVector::from(question.start);
    let Some(near) = approach(field, start, eps, question.by, &mut work)? else {
        return Ok(PassageAnswer { statistics: work, ..PassageAnswer::default() });
    };
    let mut followed = follow(field, near, eps, question)?;
    growth(field, eps, &mut followed, question)?;
    if let (Some(exit), true) = (followed.passage.exit, question.carried != 0.0) {
        let mut factors = [f64::NAN; 3];
        let short =
            PassageQuestion { offsets: Vec::new(), carried: 0.0, far: 0.0, ..question.clone() };
        for (component, factor) in factors.iter_mut().enumerate() {
            let mut moved = start;
            moved[component] += question.carried;
            let Some(near) = approach(field, moved, eps, question.by, &mut work)? else { continue };
            let other = follow(field, near, eps, &short)?.passage;
            work += &other.statistics;
            if let Some(other) = other.exit {
                *factor = (SVector::from(other) - SVector::from(exit)).amax() / question.carried;
            }
        }
        followed.passage.carried = Some(factors);
    }
    followed.passage.statistics += &work;
    Ok(followed.passage)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn formulas_at_the_papers_constants() {
        let p = Predicted::of(-1.2, -1.4);
        for (got, want) in [
            (p.weak, -0.295_012_4),
            (p.mu, 0.127_988_4),
            (p.across(), -3.906_6),
            (p.along(), -3.406_6),
            (p.turn, 4.497_662),
            (p.velocity[1] - (p.weak - -1.4) * p.velocity[0], 0.0),
            (p.velocity[0] + p.velocity[1], p.weak),
        ] {
            assert!((got - want).abs() < 1e-4 * want.abs().max(1e-10), "{got} {want}");
        }
    }

    #[test]
    fn the_surface_is_left_where_x_first_exceeds_the_layer_after_the_visit() {
        let mut l = Leaving::new(1e-2);
        // Comes in, visits, leaves.
        for x in [
            [0.5, 0.3, 0.3],
            [0.0, 0.2, 0.2],
            [0.0, 0.05, 0.05],
            [0.02, -0.1, -0.1],
            [0.04, -0.2, -0.2],
            [0.3, -0.5, -0.5],
        ] {
            l.see(x);
        }
        let place = l.place().unwrap();
        assert!((place[0] - 0.03).abs() < 1e-15 && (place[1] + 0.15).abs() < 1e-15, "{place:?}");
    }

    #[test]
    fn a_surface_that_was_not_visited_is_not_left() {
        let seen = |states: &[[f64; 3]]| {
            let mut l = Leaving::new(1e-2);
            states.iter().for_each(|x| l.see(*x));
            l.place()
        };
        // Never within 0.1 of the two-fold in y and z.
        assert_eq!(seen(&[[0.0, 0.3, 0.05], [0.02, 0.05, -0.3], [0.04, -0.2, -0.2]]), None);
        // The layer is left before the visit, and not after it.
        assert_eq!(
            seen(&[[0.0, 0.3, 0.3], [0.5, 0.2, 0.2], [0.0, 0.05, 0.05], [0.02, -0.3, -0.3]]),
            None
        );
        // Two states near are one visit.
        assert!(seen(&[[0.0, 0.05, 0.0], [0.0, 0.05, 0.0], [0.04, -0.3, -0.3]]).is_some());
        // Downwards as well; the first place counts.
        let place =
            seen(&[[0.0, 0.05, 0.0], [-0.06, 0.15, 0.2], [0.0, 0.0, 0.0], [0.06, 1.0, 1.0]])
                .unwrap();
        assert!((place[0] + 0.03).abs() < 1e-15 && (place[1] - 0.1).abs() < 1e-15, "{place:?}");
    }

    #[test]
    fn after_a_kick_the_way_goes_on_from_where_it_led() {
        let kicked = |l: &mut Leaving, to: [f64; 3]| {
            l.kick(0.3, &SVector::from([9.0; 3]), &SVector::from(to))
        };
        let mut l = Leaving::new(1e-2);
        l.see([0.0, 0.05, 0.0]);
        kicked(&mut l, [0.02, 0.0, 0.05]);
        assert_eq!(l.place(), None);
        l.see([0.04, -0.1, -0.05]);
        let place = l.place().unwrap();
        assert!(
            (place[0] - 0.03).abs() < 1e-15
                && (place[1] + 0.05).abs() < 1e-15
                && place[2].abs() < 1e-15
        );
        // A kick out of the layer is where it is left, after the visit and once.
        for (start, left) in [([0.0, 0.05, 0.0], Some([0.04, 0.1, 0.2])), ([0.0, 0.5, 0.0], None)] {
            let mut l = Leaving::new(1e-2);
            l.see(start);
            for to in [[0.04, 0.1, 0.2], [0.0, 0.5, 0.0], [-0.04, 0.3, 0.4]] {
                kicked(&mut l, to);
            }
            l.see([-0.05, 0.5, 0.5]);
            assert_eq!(l.place(), left);
        }
    }

    /// y and z turn about the two-fold once in 2 pi, `GROWTH` per unit time farther out, and x goes
    /// by at the speed `drift`: all that happens is known.
    struct Screw {
        drift: f64,
    }
    const GROWTH: f64 = 0.2;
    impl VectorField<3> for Screw {
        fn eval<S: twofold_num::Elementary>(&self, x: &SVector<S, 3>) -> SVector<S, 3> {
            SVector::from([
                S::from_f64(self.drift),
                x[1].scale(GROWTH) - x[2],
                x[1] + x[2].scale(GROWTH),
            ])
        }
    }

    /// From (x, 0.05, 0) at eps = 0.01: y = 0 is passed at pi/2, 3 pi/2, ..., 0.068, 0.128, 0.240
    /// and 0.451 from the two-fold.
    fn screwed(crosses: f64, drift: f64, question: &PassageQuestion) -> PassageAnswer {
        let start = [-crosses * drift, 0.05, 0.0];
        passage(&Screw { drift }, 1e-2, &PassageQuestion { start, ..question.clone() }).unwrap()
    }

    #[test]
    fn what_happens_on_a_known_passage_is_found() {
        use std::f64::consts::PI;
        use twofold_num::elementary::exp;
        let near = PassageQuestion::far([0.0; 3], 0.0, 12.0);
        for (drift, crosses) in [(0.01, 1.0), (0.01, 2.0), (0.01, 8.0), (-0.01, 8.0)] {
            let far = PassageQuestion { far: 0.2, ..near.clone() };
            let p = screwed(crosses, drift, &far);
            // The first within 0.1; the exit is the first beyond 0.3, neither of the two between.
            assert!((p.visit.unwrap() - 0.5 * PI).abs() < 1e-12, "{p:?}");
            let [x, y, z] = p.exit.unwrap();
            assert!((x - drift * (3.5 * PI - crosses)).abs() < 1e-14 && y.abs() < 1e-14, "{p:?}");
            assert!((z + 0.05 * exp(GROWTH * 3.5 * PI)).abs() < 1e-14, "{p:?}");
            // x = 0 counts after the visit and beyond 0.1: 0.075 away at 2, 0.25 away at 8.
            let there = (crosses > 4.0).then_some(0.05 * exp(GROWTH * crosses));
            let radius = |x: [f64; 3]| sqrt(x[0] * x[0] + x[1] * x[1] + x[2] * x[2]);
            match there {
                Some(want) => assert!((radius(p.surface.unwrap()) - want).abs() < 1e-14, "{p:?}"),
                None => assert_eq!(p.surface, None),
            }
            // Far exits go up.
            assert_eq!(p.far, p.surface.filter(|_| drift > 0.0));
            assert_eq!(
                screwed(crosses, drift, &PassageQuestion { far: 0.3, ..near.clone() }).far,
                None
            );
            assert_eq!(screwed(crosses, drift, &near).far, None);
            if crosses > 4.0 {
                assert!((p.leaving.unwrap()[0].abs() - 0.03).abs() < 1e-12, "{p:?}");
            }
        }
        // The exit is the first, though y = 0 is passed again at 9 pi/2; what was all found is not
        // followed on, to where it overflows.
        let long = PassageQuestion { by: 16.0, ..near.clone() };
        let exits = [&long, &near].map(|q| screwed(2.0, 0.01, q).exit.unwrap());
        assert!((0..3).all(|i| (exits[0][i] - exits[1][i]).abs() < 1e-14), "{exits:?}");
        for far in [0.0, 0.2] {
            let [short, endless] = [12.0, 1e4]
                .map(|by| screwed(8.0, 0.01, &PassageQuestion { far, by, ..near.clone() }));
            assert_eq!((short.far.is_some(), endless.far.is_some()), (far > 0.0, far > 0.0));
            let steps = [short, endless].map(|p| p.statistics.steps);
            assert!(steps[1] < 2 * steps[0], "{steps:?}");
        }
        // Before its time is over nothing else has happened.
        let short = screwed(8.0, 0.01, &PassageQuestion { by: 7.0, ..near });
        assert!(
            short.visit.is_some()
                && short.exit.is_none()
                && short.surface.is_none()
                && short.leaving.is_none()
        );
    }

    #[test]
    fn growth_on_a_known_passage_is_what_the_linear_equation_says() {
        use std::f64::consts::PI;
        use twofold_num::elementary::{cos, exp, sin};
        let question = PassageQuestion {
            offsets: vec![-4.0, 0.0, 10.0],
            carried: 1e-7,
            ..PassageQuestion::far([0.0; 3], 0.0, 12.0)
        };
        let drift = 0.01;
        let p = screwed(8.0, drift, &question);
        // With w = y + i z a disturbance d changes ln w by q = d/w: y = 0 is passed Im q earlier,
        // Re q - GROWTH Im q farther out.
        let want = |t: f64| -> [f64; 3] {
            let end = 0.05 * exp(GROWTH * 3.5 * PI);
            let part =
                |re: f64, im: f64| f64::max(end * (re - GROWTH * im).abs(), (drift * im).abs());
            let r = 0.05 * exp(GROWTH * t);
            [1.0, part(cos(t) / r, -sin(t) / r), part(sin(t) / r, cos(t) / r)]
        };
        let close = |got: [f64; 3], want: [f64; 3], by: f64| {
            assert!(
                got.iter().zip(want).all(|(g, w)| (g / w - 1.0).abs() < by),
                "{got:?} {want:?}"
            );
        };
        assert_eq!(p.growth.iter().map(|g| g.offset).collect::<Vec<_>>(), question.offsets);
        for g in &p.growth {
            close(g.factors, want(0.5 * PI + 0.1 * g.offset), 1e-4);
        }
        close(p.carried.unwrap(), want(0.0), 1e-4);
    }

    #[test]
    fn the_layer_costs_the_incoming_orbit_hardly_anything() {
        use twofold_system::{Caricature, Smoothed, Transition};
        let eps = 1e-5;
        let field = Smoothed {
            system: Caricature::with_reinjection(1e-1, 1e-5),
            transition: Transition::Tanh,
            eps,
        };
        let mut work = Statistics::default();
        let (_, x) = approach(&field, SVector::from([0.2, 0.0, -1.0]), eps, 80.0, &mut work)
            .unwrap()
            .unwrap();
        assert!(
            x.amax() < HANDOVER && x.amax() > 0.9 * HANDOVER && x[0].abs() < IN_LAYER * eps,
            "{x}"
        );
        // Steps that resolve a layer of 1e-5 in sliding would be a million.
        assert!(work.steps < 5000, "{}", work.steps);
    }
}
