//! The method that works in the layer's own variable, against the reference, the other methods, and
//! its own promises.

use nalgebra::{SVector, Vector3};
use twofold::analyse::{Crossing, SectionRecorder};
use twofold::integrate::{
    Dopri5, DriveOptions, Failure, Flow, Ignore, Kick, KickLaw, Layered, Observer, Schedule, Step,
    StepCap, Stepper, Taylor, Tolerance, drive,
};
use twofold::job::spec::*;
use twofold::num::Elementary;
use twofold::system::{Caricature, Smoothed, System, Transition, VectorField};

/// Any field, so that each method is compiled once.
enum Field {
    Smooth(Smoothed<Caricature>),
    /// Turns in x, y and drifts in z by a smoothed switch on the circle of radius 1: the layer's
    /// variable is no sum of states.
    Circle,
    /// The same with a quotient.
    Quotient,
}

impl VectorField<3> for Field {
    fn eval<S: Elementary>(&self, x: &SVector<S, 3>) -> SVector<S, 3> {
        let c = S::from_f64;
        let phi = || ((x[0].squared() + x[1].squared() - c(1.0)) / c(1e-2)).tanh();
        match self {
            Field::Smooth(field) => field.eval(x),
            Field::Circle => Vector3::new(x[1].scale(2.0) + c(0.1), -x[0], phi() - x[2].scale(0.5)),
            Field::Quotient => Vector3::new(x[1], -x[0], phi() / (c(2.0) + x[2])),
        }
    }
}

fn caricature(alpha: f64, beta: f64, transition: Transition) -> Field {
    Field::Smooth(Smoothed {
        system: Caricature::with_reinjection(alpha, beta),
        transition,
        eps: 1e-3,
    })
}

const START: [f64; 3] = [0.2, 0.0, -1.0];

fn tolerance(size: f64) -> Tolerance {
    Tolerance { rtol: size, atol: size }
}

fn section(
    field: &Field,
    plane: (usize, f64),
    t_end: f64,
    mut method: impl Stepper<3>,
) -> Vec<Crossing> {
    let mut recorder = SectionRecorder::<3>::new(plane.0, plane.1);
    let end = drive(field, START.into(), &DriveOptions::to(t_end), &mut method, &mut recorder, &())
        .unwrap();
    assert_eq!(end.t, t_end);
    recorder.crossings().to_vec()
}

fn error(a: &Crossing, b: &Crossing) -> f64 {
    (0..3).map(|i| (a.x[i] - b.x[i]).abs()).fold((a.t - b.t).abs(), f64::max)
}

/// Largest error over the first rows of crossings computed in 113-bit arithmetic outside this
/// project.
fn against_the_reference(found: &[Crossing], text: &str, rows: usize) -> f64 {
    let lines = text.lines().filter(|l| !l.starts_with('#') && !l.starts_with("t,")).take(rows);
    let want: Vec<Vec<f64>> =
        lines.map(|l| l.split(',').take(3).map(|n| n.parse().unwrap()).collect()).collect();
    assert!(found.len() >= rows && want.len() == rows, "{found:?}");
    let worst = |(f, w): (&Crossing, &Vec<f64>)| {
        (f.t - w[0]).abs().max((f.x[0] - w[1]).abs()).max((f.x[2] - w[2]).abs())
    };
    found.iter().zip(&want).map(worst).fold(0.0, f64::max)
}

#[test]
fn before_the_first_visit_its_error_is_no_larger_than_dormand_princes() {
    let printed = (1e-3, crate::common::CROSSINGS_PRINTED, 4, 29.5);
    let reconstructed = (1e-1, crate::common::CROSSINGS_RECONSTRUCTED, 2, 4.8);
    for (alpha, text, rows, t_end) in [printed, reconstructed] {
        let field = caricature(alpha, 1e-5, Transition::Tanh);
        for size in [1e-6, 1.0536712e-8, 1e-10, 1e-12] {
            let layered = against_the_reference(
                &section(&field, (1, 0.0), t_end, Layered::new(tolerance(size))),
                text,
                rows,
            );
            let dopri5 = against_the_reference(
                &section(&field, (1, 0.0), t_end, Dopri5::new(tolerance(size))),
                text,
                rows,
            );
            println!("alpha {alpha}, tolerance {size:e}: layered {layered:e}, dopri5 {dopri5:e}");
            assert!(
                layered <= dopri5.max(1e-13),
                "alpha {alpha}, tolerance {size:e}: {layered:e} {dopri5:e}"
            );
        }
    }
}

/// Starts from which orbits go into the layer, or are in it, and are held there until they reach
/// the two-fold, at about t = 2.5.
fn held() -> impl Iterator<Item = [f64; 3]> {
    (0..24).map(|k| {
        let part = f64::from(k) / 24.0;
        [
            [11e-3, 0.0, -12e-3, 3e-3, -5e-3, 8e-3][k as usize % 6],
            0.3 + 0.15 * part,
            0.45 - 0.15 * part,
        ]
    })
}

/// The state in which an orbit ends.
fn end(field: &Field, start: [f64; 3], t_end: f64, mut method: impl Stepper<3>) -> SVector<f64, 3> {
    drive(field, start.into(), &DriveOptions::to(t_end), &mut method, &mut Ignore, &()).unwrap().x
}

#[test]
fn while_an_orbit_is_held_its_error_is_no_larger_than_dormand_princes() {
    for eps in [1e-3, 4e-3, 2e-2] {
        let field = Field::Smooth(Smoothed {
            system: Caricature::with_reinjection(1e-1, 1e-4),
            transition: Transition::Tanh,
            eps,
        });
        for t_end in [0.1, 0.5, 1.0, 1.8] {
            let truth: Vec<_> = held()
                .map(|start| end(&field, start, t_end, Taylor::extended(tolerance(1e-20))))
                .collect();
            for size in [1e-6, 1.0536712e-8, 1e-10, 1e-12] {
                // Of all starts together, root mean square: a single one may be lucky.
                let error = |find: &dyn Fn([f64; 3]) -> SVector<f64, 3>| {
                    let squares = held()
                        .zip(&truth)
                        .map(|(start, truth)| (find(start) - truth).norm_squared());
                    (squares.sum::<f64>() / truth.len() as f64).sqrt()
                };
                let layered =
                    error(&|start| end(&field, start, t_end, Layered::new(tolerance(size))));
                let dopri5 =
                    error(&|start| end(&field, start, t_end, Dopri5::new(tolerance(size))));
                println!(
                    "eps {eps}, t {t_end}, tolerance {size:e}: layered {layered:e}, dopri5 \
                        {dopri5:e}"
                );
                // Both may be far better than they need be.
                assert!(
                    layered <= dopri5.max(0.1 * size),
                    "eps {eps}, t {t_end}, {size:e}: {layered:e} {dopri5:e}"
                );
            }
        }
    }
}

#[test]
fn sections_are_met_while_an_orbit_is_held_and_where_it_leaves() {
    // Up to the two-fold and out of it: with eps = 2e-2 a passage loses few digits.
    let field = Field::Smooth(Smoothed {
        system: Caricature::with_reinjection(1e-1, 1e-4),
        transition: Transition::Tanh,
        eps: 2e-2,
    });
    let passages = |plane: (usize, f64),
                    method: &mut dyn FnMut(&mut SectionRecorder<3>, [f64; 3])| {
        let mut all = Vec::new();
        for start in held().step_by(5) {
            let mut recorder = SectionRecorder::<3>::new(plane.0, plane.1);
            method(&mut recorder, start);
            all.push(recorder.crossings().to_vec());
        }
        all
    };
    let t_end = 4.0;
    for plane in [(0, 0.0), (0, 1e-3), (1, 0.0), (1, 0.1), (2, 0.0)] {
        let layered = passages(plane, &mut |recorder, start| {
            let mut method = Layered::new(tolerance(1e-13));
            let end =
                drive(&field, start.into(), &DriveOptions::to(t_end), &mut method, recorder, &())
                    .unwrap();
            assert_eq!(end.t, t_end);
        });
        let taylor = passages(plane, &mut |recorder, start| {
            let mut method = Taylor::new(tolerance(1e-15));
            let end =
                drive(&field, start.into(), &DriveOptions::to(t_end), &mut method, recorder, &())
                    .unwrap();
            assert_eq!(end.t, t_end);
        });
        let mut worst = 0.0_f64;
        assert!(layered.iter().any(|found| !found.is_empty()), "{plane:?}");
        for (layered, taylor) in layered.iter().zip(&taylor) {
            assert_eq!(layered.len(), taylor.len(), "{plane:?}: {layered:?} {taylor:?}");
            for (l, t) in layered.iter().zip(taylor) {
                worst = worst.max(error(l, t));
                assert!(error(l, t) < 1e-9 && l.direction == t.direction, "{plane:?}: {l:?} {t:?}");
            }
        }
        println!("{plane:?}: {} crossings, {worst:e}", layered.iter().map(Vec::len).sum::<usize>());
    }
}

#[test]
fn sections_inside_the_layer_are_those_of_the_taylor_method() {
    // Planes in the middle of the layer, off it, at its edge, and far outside.
    let field = caricature(1e-1, 1e-5, Transition::Tanh);
    for plane in [(0, 0.0), (0, 3.7e-4), (0, -8e-3), (0, 0.3), (2, 0.1)] {
        let layered = section(&field, plane, 4.8, Layered::new(tolerance(1e-11)));
        let taylor = section(&field, plane, 4.8, Taylor::new(tolerance(1e-15)));
        assert_eq!(layered.len(), taylor.len(), "{plane:?}");
        assert!(!layered.is_empty(), "{plane:?}");
        for (l, t) in layered.iter().zip(&taylor) {
            assert!(error(l, t) < 1e-9 && l.direction == t.direction, "{plane:?}: {l:?} {t:?}");
        }
    }
}

#[test]
fn a_crossing_that_steps_may_not_go_through_at_once_goes_on_where_it_was_cut() {
    // From outside through the layer, which takes some 0.02; then on.
    let field = caricature(1e-1, 1e-5, Transition::Tanh);
    let end = |cap: f64| {
        let options = DriveOptions { step_cap: StepCap::Absolute(cap), ..DriveOptions::to(1.0) };
        let mut method = Layered::new(tolerance(1e-11));
        drive(&field, START.into(), &options, &mut method, &mut Ignore, &()).unwrap()
    };
    let whole = end(f64::INFINITY);
    assert!(whole.x[0] < -0.1, "{}", whole.x);
    for cap in [1e-2, 3.1e-3, 7e-4] {
        let cut = end(cap);
        assert!(cut.statistics.steps as f64 >= 1.0 / cap);
        assert!((cut.x - whole.x).amax() < 1e-9, "{cap}: {} {}", cut.x, whole.x);
    }
}

/// Looks into every step.
struct Looking {
    kinds: [u64; 3],
    worst: f64,
}
impl Observer<3> for Looking {
    fn step(&mut self, step: &Step<'_, 3>) -> Flow {
        self.kinds[match step.interpolant.degree() {
            // Dormand-Prince, eight places a part of the layer, the degree at this tolerance.
            4 => 2,
            18 => 0,
            _ => 1,
        }] += 1;
        // The interpolant meets both ends, has the coordinates that it says, and stays within its
        // reach.
        let (first, last) = (step.interpolant.at(0.0), step.interpolant.at(1.0));
        self.worst = self.worst.max((first - step.x0).amax()).max((last - step.x1).amax());
        for theta in [0.1, 0.5, 0.83] {
            let x = step.at(theta);
            for i in 0..3 {
                assert_eq!(x[i].to_bits(), step.coordinate(theta, i).to_bits());
                let (low, high) = (step.x0[i].min(step.x1[i]), step.x0[i].max(step.x1[i]));
                let reach = step.interpolant.reach(i) + 1e-12 * (1.0 + x[i].abs());
                assert!(
                    x[i] >= low - reach && x[i] <= high + reach,
                    "{i} {theta}: {} {low} {high} {reach}",
                    x[i]
                );
            }
        }
        Flow::Continue
    }
}

#[test]
fn every_kind_of_step_has_its_interpolant_and_ends_where_it_should() {
    let field = caricature(1e-1, 1e-5, Transition::Tanh);
    let kick = Kick { every: 0.7, size: 1e-3, law: KickLaw::Sphere, seed: 3, stream: 0 };
    // Kicks and restarts anywhere, also in the middle of the layer; caps far shorter than a
    // crossing.
    for (schedule, step_cap, t_end) in [
        (Schedule::default(), StepCap::None, 60.0),
        (
            Schedule { restart_every: Some(0.31), kick: Some(kick) },
            StepCap::FractionOfSegment(0.1),
            60.0,
        ),
        (Schedule::default(), StepCap::Absolute(3e-4), 14.0),
    ] {
        let mut looking = Looking { kinds: [0; 3], worst: 0.0 };
        let options = DriveOptions { schedule, step_cap, ..DriveOptions::to(t_end) };
        let mut method = Layered::new(tolerance(1e-9));
        let end = drive(&field, START.into(), &options, &mut method, &mut looking, &()).unwrap();
        assert_eq!(end.t, t_end);
        assert!(looking.worst < 1e-12, "{:e}", looking.worst);
        assert!(
            looking.kinds.iter().all(|kind| *kind > 0)
                && end.statistics.steps == looking.kinds.iter().sum::<u64>(),
            "{:?}",
            looking.kinds
        );
    }
}

#[test]
fn a_start_anywhere_in_the_layer_goes_on_as_taylor_does() {
    let field = caricature(1e-1, 1e-4, Transition::Tanh);
    // Crossing both ways, on the edges, and sliding (y and z positive) for a while.
    for start in [
        [0.0, 0.9, -0.8],
        [4e-3, -0.9, 0.8],
        [-11e-3, -0.9, 0.8],
        [1e-3, 0.5, -0.3],
        [0.0, 0.4, 0.7],
        [-30e-3, 0.4, 0.7],
    ] {
        let run = |stepper: &mut dyn FnMut(&DriveOptions) -> SVector<f64, 3>| {
            stepper(&DriveOptions::to(0.4))
        };
        let layered = run(&mut |options| {
            drive(
                &field,
                start.into(),
                options,
                &mut Layered::new(tolerance(1e-11)),
                &mut Ignore,
                &(),
            )
            .unwrap()
            .x
        });
        let taylor = run(&mut |options| {
            drive(
                &field,
                start.into(),
                options,
                &mut Taylor::new(tolerance(1e-15)),
                &mut Ignore,
                &(),
            )
            .unwrap()
            .x
        });
        assert!((layered - taylor).amax() < 2e-9, "{start:?}: {layered} {taylor}");
    }
}

#[test]
fn a_layer_that_is_no_plane_is_gone_through_in_time() {
    let run = |t_end: f64| {
        let mut method = Layered::new(tolerance(1e-11));
        drive(
            &Field::Circle,
            Vector3::new(0.2, 0.9, 0.3),
            &DriveOptions::to(t_end),
            &mut method,
            &mut Ignore,
            &(),
        )
        .unwrap()
        .x
    };
    let mut taylor = Taylor::new(tolerance(1e-15));
    let want = drive(
        &Field::Circle,
        Vector3::new(0.2, 0.9, 0.3),
        &DriveOptions::to(20.0),
        &mut taylor,
        &mut Ignore,
        &(),
    )
    .unwrap()
    .x;
    assert!((run(20.0) - want).amax() < 1e-8, "{} {want}", run(20.0));
}

#[test]
fn what_it_cannot_integrate_it_refuses() {
    for field in [Field::Quotient, caricature(1e-1, 1e-5, Transition::Arctan)] {
        let mut method = Layered::new(tolerance(1e-8));
        let failure =
            drive(&field, START.into(), &DriveOptions::to(1.0), &mut method, &mut Ignore, &())
                .unwrap_err();
        assert!(matches!(failure, Failure::NotApplicable { method: "layered", .. }), "{failure}");
        assert!(failure.to_string().contains("polynomial"), "{failure}");
    }
    let spec = |system: System, switch| RunSpec {
        start: vec![0.5; system.dimension()],
        system,
        switch,
        t_end: 1.0,
        method: MethodSpec::defaults(Method::Layered),
        schedule: Schedule::default(),
        observe: Observation::Section { coordinate: 1, value: 0.0 },
    };
    let caricature = || System::from(Caricature::with_reinjection(0.1, 1e-5));
    let wheel = System::builtin("wheel").unwrap();
    assert_eq!(spec(caricature(), SwitchSpec::tanh(1e-3)).validate(), Ok(()));
    let smoothed = |transition| SwitchSpec::Smoothed { eps: 1e-3, transition };
    for wrong in [
        spec(wheel, SwitchSpec::tanh(1e-3)),
        spec(caricature(), smoothed(Transition::Erf)),
        spec(caricature(), smoothed(Transition::PerturbedTanh { sigma: 0.1 })),
    ] {
        let refused = wrong.validate().unwrap_err();
        assert!(refused.field == "method" && refused.rule.contains("polynomial"), "{refused:?}");
    }
}
