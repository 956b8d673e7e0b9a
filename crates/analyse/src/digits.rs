//! Number of correct digits of an orbit by a method: its crossings of a plane compared with those
//! of a reference orbit in double-double arithmetic ([`reference()`]).
//!
//! A smoothed two-fold is an ordinary differential equation with one solution, but near the
//! singularity it amplifies disturbances; [`passage`](super::passage) measures by how much. This
//! module measures the effect on a method.

use nalgebra::SVector;
use serde::{Deserialize, Serialize};

use super::reference::{ExtendedCrossing, SectionPlane, reference};
use super::section::SectionRecorder;
use twofold_integrate::{
    DriveOptions, Failure, Flow, Method, Observer, Statistics, Step, StepCap, Stepper, Tolerance,
    WithStepper, drive,
};
use twofold_num::elementary::log10;
use twofold_num::{Arithmetic, DoubleDouble, Scalar};
use twofold_system::VectorField;

/// A method at a tolerance, relative and absolute alike.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Contender {
    /// The method.
    pub name: Method,
    /// rtol and atol.
    pub tolerance: f64,
}

/// Options of [`digits`]: everything that it depends on besides the equation.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DigitsQuestion {
    /// The start, at t = 0.
    pub start: [f64; 3],
    /// Crossings of this plane are compared.
    pub section: SectionPlane,
    /// They are compared up to this time of the reference orbit.
    pub t_end: f64,
    /// A crossing whose state has no component larger than this is a visit to the origin.
    pub near: f64,
    /// The methods that are compared.
    pub methods: Vec<Contender>,
    /// Their longest step.
    pub step_cap: StepCap,
    /// Step limit of each method.
    pub max_steps: u64,
}

/// One method's crossing.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DigitsRow {
    /// The method.
    pub contender: Contender,
    /// Its agreement with the reference orbit.
    pub agreement: Agreement,
}

/// A crossing of the reference orbit near the origin.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NearCrossing {
    /// Its time.
    pub t: f64,
    /// The largest component of its state.
    pub distance: f64,
}

/// The answer to a [`DigitsQuestion`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Digits {
    /// Method by method, in the order asked for, crossing by crossing.
    pub rows: Vec<DigitsRow>,
    /// The reference orbit's visits to the origin.
    pub visits: Vec<NearCrossing>,
    /// Work of all orbits together.
    pub statistics: Statistics,
}

/// More crossings than an orbit of the lengths in question makes.
const MOST_CROSSINGS: usize = 1000;

/// Compares the crossings of each method with those of the reference orbit.
///
/// # Errors
/// [`Failure`] of the reference orbit or of a method, among them a step budget used up.
pub fn digits<F: VectorField<3>>(field: &F, question: &DigitsQuestion) -> Result<Digits, Failure> {
    let DigitsQuestion { start, section, t_end, near, ref methods, step_cap, max_steps } =
        *question;
    let x0 = SVector::from(start);
    let exact =
        reference(field, x0.map(DoubleDouble::from_f64), section, MOST_CROSSINGS, t_end, false)?;
    let visits = exact.crossings.iter().filter(|c| c.extent() < near);
    let visits = visits.map(|c| NearCrossing { t: c.t.to_f64(), distance: c.extent() }).collect();
    let mut answer = Digits { rows: Vec::new(), visits, statistics: exact.statistics };
    for &contender in methods {
        let tolerance = Tolerance { rtol: contender.tolerance, atol: contender.tolerance };
        let follow = Follow { field, x0, section, exact: &exact.crossings, step_cap, max_steps };
        let (rows, statistics) = contender.name.with_stepper(tolerance, follow)?;
        answer.rows.extend(rows.into_iter().map(|agreement| DigitsRow { contender, agreement }));
        answer.statistics += &statistics;
    }
    Ok(answer)
}

/// A comparison as a computation over any stepper.
struct Follow<'a, F> {
    field: &'a F,
    x0: SVector<f64, 3>,
    section: SectionPlane,
    exact: &'a [ExtendedCrossing],
    step_cap: StepCap,
    max_steps: u64,
}

impl<F: VectorField<3>> WithStepper<3> for Follow<'_, F> {
    type Answer = Result<(Vec<Agreement>, Statistics), Failure>;
    fn with<M: Stepper<3>>(self, mut stepper: M) -> Self::Answer {
        let Self { field, x0, section, exact, step_cap, max_steps } = self;
        let rows = agreement(field, x0, section, exact, &mut stepper, step_cap, max_steps)?;
        Ok((rows, stepper.statistics().clone()))
    }
}

/// Agreement of a method with the reference orbit at one crossing.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Agreement {
    /// Number of the crossing, from 1.
    pub crossing: usize,
    /// Its time on the reference orbit.
    pub t: f64,
    /// Distance of the two states: the largest difference of a component.
    pub error: f64,
    /// log10 of `error`, not below [`Agreement::FLOOR`].
    pub log10_error: f64,
}

impl Agreement {
    /// A crossing is handed on in `f64`: smaller differences are not resolved.
    pub const FLOOR: f64 = -17.0;
}

/// Stops when enough crossings are recorded.
struct Until {
    section: SectionRecorder,
    crossings: usize,
}

impl Observer<3> for Until {
    fn step(&mut self, step: &Step<'_, 3>) -> Flow {
        self.section.step(step);
        if self.section.crossings().len() >= self.crossings { Flow::Stop } else { Flow::Continue }
    }
}

/// Runs `stepper` from `x0` and compares its n-th crossing of `plane` with the n-th of `reference`.
/// Fewer rows come back if the method has made fewer crossings when twice the reference's time is
/// over.
///
/// # Errors
///
/// If the method fails before its last crossing.
pub fn agreement<F: VectorField<3>, M: Stepper<3>>(
    field: &F,
    x0: SVector<f64, 3>,
    plane: SectionPlane,
    reference: &[ExtendedCrossing],
    stepper: &mut M,
    cap: StepCap,
    max_steps: u64,
) -> Result<Vec<Agreement>, Failure> {
    let Some(last) = reference.last() else { return Ok(Vec::new()) };
    let mut until = Until {
        section: SectionRecorder::new(plane.coordinate, plane.value),
        crossings: reference.len(),
    };
    let t_end = 2.0 * last.t.to_f64();
    let options = DriveOptions { step_cap: cap, max_steps, ..DriveOptions::to(t_end) };
    let _ = drive(field, x0, &options, stepper, &mut until, &())?.within_budget()?;
    let pairs = reference.iter().zip(until.section.crossings()).enumerate();
    Ok(pairs
        .map(|(i, (want, got))| {
            let gap = |c: usize| (DoubleDouble::from_f64(got.x[c]) - want.x[c]).to_f64().abs();
            let error = (0..3).map(gap).fold(0.0, f64::max);
            Agreement {
                crossing: i + 1,
                t: want.t.to_f64(),
                error,
                log10_error: log10(error).max(Agreement::FLOOR),
            }
        })
        .collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use twofold_num::Elementary;
    use twofold_num::elementary::exp;

    const GROWTH: f64 = 0.2;

    /// y and z turn about the origin once in 2 pi, farther and farther out.
    struct Spiral;
    impl VectorField<3> for Spiral {
        fn eval<S: Elementary>(&self, x: &SVector<S, 3>) -> SVector<S, 3> {
            SVector::from([-x[0], x[1].scale(GROWTH) - x[2], x[1] + x[2].scale(GROWTH)])
        }
    }

    #[test]
    fn digits_of_a_known_spiral() {
        let methods = [(Method::Dopri5, 1e-4), (Method::Dopri5, 1e-10), (Method::Taylor, 1e-17)];
        let question = DigitsQuestion {
            start: [0.0, 0.05, 0.0],
            section: SectionPlane { coordinate: 1, value: 0.0 },
            t_end: 12.0,
            near: 0.2,
            methods: methods.map(|(name, tolerance)| Contender { name, tolerance }).into(),
            step_cap: StepCap::None,
            max_steps: 10_000,
        };
        let found = digits(&Spiral, &question).unwrap();
        // y = 0 at pi/2, 3 pi/2, ..., 0.068, 0.128, 0.24 and 0.45 away: two are visits.
        let moment = |k: usize| std::f64::consts::PI * (k as f64 - 0.5);
        let away = |k: usize| 0.05 * exp(GROWTH * moment(k));
        assert_eq!(found.visits.len(), 2);
        for (v, k) in found.visits.iter().zip(1..) {
            assert!(
                (v.t - moment(k)).abs() < 1e-14 && (v.distance - away(k)).abs() < 1e-15,
                "{v:?}"
            );
        }
        assert_eq!(found.rows.len(), 12);
        for (r, i) in found.rows.iter().zip(0..) {
            let a = r.agreement;
            assert!(r.contender == question.methods[i / 4] && a.crossing == i % 4 + 1, "{r:?}");
            assert!((a.t - moment(a.crossing)).abs() < 1e-13, "{r:?}");
            assert!(
                (a.log10_error - log10(a.error).max(-17.0)).abs() < 1e-15 && a.log10_error >= -17.0,
                "{r:?}"
            );
            // Loose, tight, and as good as a double can be.
            let [low, high] = [[1e-7, 1e-2], [1e-14, 1e-9], [0.0, 1e-15]][i / 4];
            assert!((low..=high).contains(&a.error), "{r:?}");
        }
    }

    #[test]
    fn a_method_has_twice_the_references_time() {
        // Of five passages that a reference claims to have made by t = 6, the method makes those
        // before 12: pi/2, 3 pi/2, 5 pi/2 and 7 pi/2.
        let claimed = |k: usize| ExtendedCrossing {
            t: DoubleDouble::from_f64(6.0 - (4 - k) as f64),
            x: SVector::from([0.0; 3].map(DoubleDouble::from_f64)),
            direction: crate::Direction::Up,
        };
        let reference: Vec<_> = (0..5).map(claimed).collect();
        let mut method =
            twofold_integrate::Dopri5::<3>::new(Tolerance { rtol: 1e-10, atol: 1e-10 });
        let (start, plane) =
            (SVector::from([0.0, 0.05, 0.0]), SectionPlane { coordinate: 1, value: 0.0 });
        let rows = agreement(&Spiral, start, plane, &reference, &mut method, StepCap::None, 10_000)
            .unwrap();
        assert_eq!(rows.iter().map(|r| r.t).collect::<Vec<_>>(), [2.0, 3.0, 4.0, 5.0]);
    }
}
