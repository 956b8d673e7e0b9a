//! Our side of `make bench-work-precision`: the six problems of benches/work-precision/README.md,
//! each by every method that takes it, at every tolerance.
//!
//! Prints CSV: problem, program, tolerance, seconds, steps, final state. Times are taken as
//! `clock.rs` says. `reference` in place of a problem prints the end states by double-double
//! arithmetic, where they are to be had.

mod clock;

use clock::measure;
use nalgebra::{SVector, Vector3};
use twofold::hybrid::motion::{Method as GeneralMethod, Record};
use twofold::hybrid::{Definition as General, Model, Options, follow};
use twofold::integrate::delay::{Delayed, History, Inside, LateSwitch, Own, Sides};
use twofold::integrate::filippov::{AllModes, ExitRule, FilippovOptions, run as filippov};
use twofold::integrate::{
    DriveOptions, Ignore, Method, StepCap, Stepper, Tolerance, WithStepper, drive,
};
use twofold::system::{
    Bound, BoundField, Caricature, Field, Smoothed, System, Transition, VectorField,
};

const EPS: f64 = 1e-3;

/// Final state and steps, or why there are none.
type Done = Result<([f64; 3], u64), String>;

/// Runs an equation by a method.
struct To<'a, F> {
    field: &'a F,
    start: SVector<f64, 3>,
    options: DriveOptions,
}

impl<F: VectorField<3>> WithStepper<3> for To<'_, F> {
    type Answer = Done;
    fn with<M: Stepper<3>>(self, mut stepper: M) -> Done {
        let done = drive(self.field, self.start, &self.options, &mut stepper, &mut Ignore, &());
        done.map(|end| (end.x.into(), end.statistics.steps)).map_err(|failure| failure.to_string())
    }
}

/// The same for a switch with memory or delay.
struct Switched {
    start: SVector<f64, 3>,
    t_end: f64,
}

impl WithStepper<3> for Switched {
    type Answer = Done;
    fn with<M: Stepper<3>>(self, mut stepper: M) -> Done {
        let to = DriveOptions::to(self.t_end);
        let done = drive(&Own, self.start, &to, &mut stepper, &mut Ignore, &());
        done.map(|end| (end.x.into(), end.statistics.steps)).map_err(|failure| failure.to_string())
    }
}

/// A problem's numbers.
struct Problem {
    alpha: f64,
    beta: f64,
    start: [f64; 3],
    t_end: f64,
}

/// In f64 of the closed orbit of the printed reading; five periods (see `peers.hpp`).
const PERIODIC: [f64; 3] = [17.057344142481766, 0.0, -0.015417177803876677];
const FIVE_PERIODS: f64 = 101.23977502156168;

fn problem(name: &str) -> Option<Problem> {
    let (a, b) = ((1e-3, 1e-5), (1e-1, 1e-4));
    let start = [0.2, 0.0, -1.0];
    let ((alpha, beta), start, t_end) = match name {
        "w1-a" => (a, start, 54.0),
        "w1-b" | "sliding" | "delay" => (b, start, 13.0),
        "periodic" => (a, PERIODIC, FIVE_PERIODS),
        "hysteresis" => (a, [0.3, 0.0, 0.0], 60.0),
        _ => return None,
    };
    Some(Problem { alpha, beta, start, t_end })
}

const BAND: f64 = 0.1;
const DELAY: f64 = 1e-2;

/// The caricature as a general system with `sign`.
const GENERAL: &str = "states = ['x', 'y', 'z']\nstart = [0.2, 0, -1]\n\
    f = ['if(x > 0, -y, z)', 'if(x > 0, 1, -1.4) + (0.1 - 1e-4*y)*(x^2 + y^2 + z^2)', \
    'if(x > 0, -1.2, 1) + (0.1 - 1e-4*z)*(x^2 + y^2 + z^2)']";
/// The relay with memory as a general system of two modes.
const MODES: &str = include_str!("relay-memory.toml");

fn system(p: &Problem) -> Option<System> {
    System::builtin("caricature")?.with("alpha", p.alpha).ok()?.with("beta", p.beta).ok()
}

fn smoothed(name: &str, p: &Problem, tolerances: &[f64]) -> Option<()> {
    let caricature = Caricature { beta: p.beta, ..Caricature::with_reinjection(p.alpha, p.beta) };
    let compiled = Smoothed { system: caricature, transition: Transition::Tanh, eps: EPS };
    let file: BoundField<3> = Field::smoothed(&system(p)?, Transition::Tanh, EPS).bind().ok()?;
    let options = DriveOptions { step_cap: StepCap::Absolute(10.0), ..DriveOptions::to(p.t_end) };
    let start = SVector::from(p.start);
    for method in Method::ALL {
        for &size in tolerances {
            let tolerance = Tolerance { rtol: size, atol: size };
            let mut run =
                || method.with_stepper(tolerance, To { field: &compiled, start, options });
            measure(name, &format!("ours, {}", method.name()), size, &mut run);
            let mut run = || method.with_stepper(tolerance, To { field: &file, start, options });
            measure(name, &format!("ours, {} (file)", method.name()), size, &mut run);
        }
    }
    Some(())
}

fn late(name: &str, p: &Problem, methods: &[Method], tolerances: &[f64]) -> Option<()> {
    let (data, switch) = if name == "delay" {
        let history = History::Constant;
        (system(p)?, LateSwitch::Delayed { delay: DELAY, smooth: None, history })
    } else {
        let inside = Inside::Sign;
        (System::builtin("relay-third-order")?, LateSwitch::Relay { band: BAND, inside })
    };
    let bound: Bound<3> = data.bind().ok()?;
    let start = SVector::from(p.start);
    for &method in methods {
        for &size in tolerances {
            let tolerance = Tolerance { rtol: size, atol: size };
            let mut run = || {
                let delayed = Delayed { sides: Sides::new(&bound, &data), switch, x0: start };
                let to = Switched { start, t_end: p.t_end };
                delayed
                    .with_stepper(method, None, tolerance, to)
                    .map_err(|error| error.to_string())?
            };
            measure(name, &format!("ours, {} (file)", method.name()), size, &mut run);
        }
    }
    Some(())
}

fn sliding(p: &Problem, tolerances: &[f64]) -> Option<()> {
    let bound: Bound<3> = system(p)?.bind().ok()?;
    let start = SVector::from(p.start);
    for &size in tolerances {
        let tolerance = Tolerance { rtol: size, atol: size };
        let options = FilippovOptions { tolerance, ..FilippovOptions::default() };
        let mut run = || {
            let mut ignore = Ignore;
            let mut all = AllModes(&mut ignore);
            let end = filippov(&bound, start, p.t_end, &options, ExitRule::Undecided, &mut all)
                .map_err(|error| error.to_string())?;
            Ok((end.x.into(), end.statistics.steps))
        };
        measure("sliding", "ours, dopri5 (file)", size, &mut run);
    }
    Some(())
}

fn general(name: &str, text: &str, p: &Problem, tolerances: &[f64]) {
    let definition = General::from_toml(text, "problem.toml").expect("a system");
    let model = Model::new(definition);
    for (method, title) in [
        (GeneralMethod::Dopri5, "dopri5"),
        (GeneralMethod::Taylor, "taylor"),
        (GeneralMethod::Lsoda, "lsoda"),
        (GeneralMethod::Radau5, "radau5"),
    ] {
        for &size in tolerances {
            let options = Options {
                t_end: p.t_end,
                record: Record::Times { every: p.t_end },
                rtol: size,
                atol: Some(size),
                method,
                ..Options::default()
            };
            let mut run = || {
                let end = follow(&model, &options, &mut |_| true).map_err(|e| e.to_string())?;
                Ok(([end.x[0], end.x[1], end.x[2]], end.steps))
            };
            measure(name, &format!("ours, general {title}"), size, &mut run);
        }
    }
}

/// End states in double-double arithmetic.
fn reference() -> Option<()> {
    let tolerance = Tolerance { rtol: 1e-30, atol: 1e-30 };
    let method = Method::TaylorExtended;
    for name in ["w1-a", "w1-b", "periodic"] {
        let p = problem(name)?;
        let field: BoundField<3> =
            Field::smoothed(&system(&p)?, Transition::Tanh, EPS).bind().ok()?;
        let start = Vector3::new(p.start[0], p.start[1], p.start[2]);
        let options = DriveOptions::to(p.t_end);
        let ([x, y, z], steps) =
            method.with_stepper(tolerance, To { field: &field, start, options }).ok()?;
        println!("{name},reference,1e-30,0,{steps},{x},{y},{z}");
    }
    for name in ["hysteresis", "delay"] {
        late(name, &problem(name)?, &[method], &[1e-30])?;
    }
    Some(())
}

fn main() {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let (name, ladder) = words.split_first().expect("a problem and tolerances");
    let tolerances: Vec<f64> = ladder.iter().filter_map(|word| word.parse().ok()).collect();
    if name == "reference" {
        reference().expect("reference");
        return;
    }
    let p = problem(name).expect("a problem's name");
    let done = match name.as_str() {
        "sliding" => sliding(&p, &tolerances),
        "hysteresis" | "delay" => {
            let methods = [Method::Dopri5, Method::Taylor, Method::TaylorExtended];
            late(name, &p, &methods, &tolerances)
        }
        _ => smoothed(name, &p, &tolerances),
    };
    done.expect("the system");
    match name.as_str() {
        "sliding" => general(name, GENERAL, &p, &tolerances),
        "hysteresis" => general(name, MODES, &p, &tolerances),
        _ => (),
    }
}
