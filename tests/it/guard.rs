//! Steps that jump over what a method cannot see are taken back: pulses and layers that are far
//! thinner than the steps around them.

use nalgebra::{SVector, Vector2};
use twofold::integrate::{
    DriveOptions, Failure, Ignore, Method, Stepper, Tolerance, WithStepper, drive,
};
use twofold::num::Elementary;
use twofold::system::VectorField;

/// Methods with error estimates from few places in a step.
const METHODS: [Method; 3] = [Method::Dopri5, Method::Radau5, Method::Lsoda];
const TOLERANCE: Tolerance = Tolerance { rtol: 1e-8, atol: 1e-8 };

struct To<'a, F, const N: usize>(&'a F, SVector<f64, N>, f64);

impl<F: VectorField<N>, const N: usize> WithStepper<N> for To<'_, F, N> {
    type Answer = Result<(SVector<f64, N>, u64), Failure>;
    fn with<M: Stepper<N>>(self, mut stepper: M) -> Self::Answer {
        let end = drive(self.0, self.1, &DriveOptions::to(self.2), &mut stepper, &mut Ignore, &())?;
        Ok((end.x, end.statistics.steps))
    }
}

/// A Gaussian pulse at s = 5 beside a wave too small to matter: (s, y)' = (1, exp(-((s -
/// 5)/width)^2) + wave sin(frequency s)).
struct Pulse {
    width: f64,
    wave: f64,
    frequency: f64,
}

impl VectorField<2> for Pulse {
    fn eval<S: Elementary>(&self, x: &SVector<S, 2>) -> SVector<S, 2> {
        let u = (x[0] - S::from_f64(5.0)).scale(1.0 / self.width);
        let wave = x[0].scale(self.frequency).sin().scale(self.wave);
        Vector2::new(S::from_f64(1.0), (-(u * u)).exp() + wave)
    }
}

#[test]
fn a_pulse_between_two_steps_is_found() {
    for width in [1e-2, 1e-4, 1e-6] {
        for method in METHODS {
            let field = Pulse { width, wave: 0.0, frequency: 1.0 };
            let (x, steps) =
                method.with_stepper(TOLERANCE, To(&field, Vector2::new(0.0, 0.0), 10.0)).unwrap();
            let area = std::f64::consts::PI.sqrt() * width;
            assert!((x[1] - area).abs() < 1e-6, "{method:?} {width:e}: {} for {area}", x[1]);
            assert!(steps < 3000, "{method:?} {width:e}: {steps} steps");
        }
    }
}

/// Functions of tanh and erf that are zero on both sides of u = (s - 5)/width: each passes from one
/// flat part to the other, and the right-hand side is the same at both ends of a step.
struct Steps {
    width: f64,
    of: usize,
}

impl Steps {
    /// Integrals over all u; of 1 - erf^2 by parts.
    fn area(&self) -> f64 {
        self.width * [2.0, 2.0, 2.0 * (2.0 / std::f64::consts::PI).sqrt()][self.of]
    }
}

impl VectorField<2> for Steps {
    fn eval<S: Elementary>(&self, x: &SVector<S, 2>) -> SVector<S, 2> {
        let (u, one) = ((x[0] - S::from_f64(5.0)).scale(1.0 / self.width), S::from_f64(1.0));
        let pulse = match self.of {
            0 => one - u.tanh() * u.tanh(),
            1 => (one + u.tanh()) * (one - u.tanh()),
            _ => one - u.erf() * u.erf(),
        };
        Vector2::new(one, pulse.scale(1.0 / self.width))
    }
}

#[test]
fn a_pulse_made_of_steps_is_found() {
    for (of, width) in (0..3).flat_map(|of| [1e-2, 1e-4, 1e-6].map(|width| (of, width))) {
        for method in METHODS {
            let field = Steps { width, of };
            let (x, _) =
                method.with_stepper(TOLERANCE, To(&field, Vector2::new(0.0, 0.0), 10.0)).unwrap();
            let area = field.area() / width;
            assert!((x[1] - area).abs() < 1e-5, "{method:?} {of} {width:e}: {} for {area}", x[1]);
        }
    }
}

/// A wave that no error estimate shows hides nothing: a step with too many of its periods to be
/// searched is made in shorter ones.
#[test]
fn a_pulse_among_a_thousand_waves_is_found() {
    for method in METHODS {
        let field = Pulse { width: 1e-3, wave: 1e-12, frequency: 2e4 };
        let (x, _) =
            method.with_stepper(TOLERANCE, To(&field, Vector2::new(0.0, 0.0), 10.0)).unwrap();
        let area = std::f64::consts::PI.sqrt() * 1e-3;
        assert!((x[1] - area).abs() < 1e-6, "{method:?}: {} for {area}", x[1]);
    }
}

/// Without anything thin a step is the method's own: the same bits, the same number of steps.
#[test]
fn a_step_that_hides_nothing_stands() {
    struct Pendulum;
    impl VectorField<2> for Pendulum {
        fn eval<S: Elementary>(&self, x: &SVector<S, 2>) -> SVector<S, 2> {
            Vector2::new(x[1], -x[0].sin())
        }
    }
    let start = Vector2::new(1.0, 0.0);
    let guarded = Method::Dopri5.with_stepper(TOLERANCE, To(&Pendulum, start, 20.0)).unwrap();
    let bare = To(&Pendulum, start, 20.0).with(twofold::integrate::Dopri5::new(TOLERANCE)).unwrap();
    assert_eq!((guarded.0.map(f64::to_bits), guarded.1), (bare.0.map(f64::to_bits), bare.1));
}
