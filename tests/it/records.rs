//! Systems as data against the same systems as compiled Rust: bit for bit, in every arithmetic, at
//! random points and along orbits.

use crate::wheel::Wheel;
use nalgebra::SVector;
use proptest::prelude::*;
use twofold::analyse::tangent::Tangent;
use twofold::integrate::filippov::{self, ExitRule, Side, Trajectory};
use twofold::integrate::{
    Dopri5, DriveOptions, Flow, Observer, Schedule, Step, StepCap, Stepper, Taylor, Tolerance,
    drive,
};
use twofold::num::series::{Constants, Solution};
use twofold::num::{Arithmetic, DoubleDouble, Dual, Elementary, Tape};
use twofold::system::caricature::MinusSign;
use twofold::system::{
    Caricature, Field, Hysteretic, PiecewiseSmooth, Relaxation, Smoothed, System, Transition,
    VectorField,
};

/// All bits of a number; both zeros of a derivative or low part count as one, because a record
/// leaves out what is multiplied by 0.
trait Bits: Elementary {
    fn bits(self) -> Vec<u64>;
}

impl Bits for f64 {
    fn bits(self) -> Vec<u64> {
        vec![self.to_bits()]
    }
}

impl Bits for DoubleDouble {
    fn bits(self) -> Vec<u64> {
        vec![self.high().to_bits(), (self.low() + 0.0).to_bits()]
    }
}

impl<S: Bits, const N: usize> Bits for Dual<S, N> {
    fn bits(self) -> Vec<u64> {
        let partials = self.partials.into_iter().flat_map(|p| (p + S::zero()).bits());
        self.value.bits().into_iter().chain(partials).collect()
    }
}

fn bits<S: Bits, const N: usize>(x: SVector<S, N>) -> Vec<Vec<u64>> {
    x.iter().map(|v| v.bits()).collect()
}

/// The point in every arithmetic: plain, extended, and each with derivatives.
#[allow(clippy::type_complexity)] // said once, here
fn everywhere(x: [f64; 3], check: &mut dyn FnMut(&dyn Fn(&mut dyn Checker))) {
    let plain = SVector::from(x);
    let extended = plain.map(|v| DoubleDouble::new(v, v * 3e-17));
    check(&|c| c.f64(&plain));
    check(&|c| c.extended(&extended));
    check(&|c| c.dual(&SVector::from_fn(|i, _| Dual::variable(plain[i], i))));
    check(&|c| c.dual_extended(&SVector::from_fn(|i, _| Dual::variable(extended[i], i))));
}

/// A comparison that can be made in every arithmetic.
trait Checker {
    fn f64(&mut self, x: &SVector<f64, 3>);
    fn extended(&mut self, x: &SVector<DoubleDouble, 3>);
    fn dual(&mut self, x: &SVector<Dual<f64, 3>, 3>);
    fn dual_extended(&mut self, x: &SVector<Dual<DoubleDouble, 3>, 3>);
}

struct Pieces<'a, A, B>(&'a A, &'a B);

impl<A: PiecewiseSmooth<3>, B: PiecewiseSmooth<3>> Pieces<'_, A, B> {
    fn same<S: Bits>(&self, x: &SVector<S, 3>) {
        assert_eq!(self.0.switching(x).bits(), self.1.switching(x).bits(), "h at {x:?}");
        assert_eq!(bits(self.0.plus(x)), bits(self.1.plus(x)), "f+ at {x:?}");
        assert_eq!(bits(self.0.minus(x)), bits(self.1.minus(x)), "f- at {x:?}");
    }
}

impl<A: PiecewiseSmooth<3>, B: PiecewiseSmooth<3>> Checker for Pieces<'_, A, B> {
    fn f64(&mut self, x: &SVector<f64, 3>) {
        self.same(x);
    }
    fn extended(&mut self, x: &SVector<DoubleDouble, 3>) {
        self.same(x);
    }
    fn dual(&mut self, x: &SVector<Dual<f64, 3>, 3>) {
        self.same(x);
    }
    fn dual_extended(&mut self, x: &SVector<Dual<DoubleDouble, 3>, 3>) {
        self.same(x);
    }
}

struct Whole<'a, A, B>(&'a A, &'a B);

impl<A: VectorField<3>, B: VectorField<3>> Checker for Whole<'_, A, B> {
    fn f64(&mut self, x: &SVector<f64, 3>) {
        assert_eq!(bits(self.0.eval(x)), bits(self.1.eval(x)), "{x:?}");
    }
    fn extended(&mut self, x: &SVector<DoubleDouble, 3>) {
        assert_eq!(bits(self.0.eval(x)), bits(self.1.eval(x)), "{x:?}");
    }
    fn dual(&mut self, x: &SVector<Dual<f64, 3>, 3>) {
        assert_eq!(bits(self.0.eval(x)), bits(self.1.eval(x)), "{x:?}");
    }
    fn dual_extended(&mut self, x: &SVector<Dual<DoubleDouble, 3>, 3>) {
        assert_eq!(bits(self.0.eval(x)), bits(self.1.eval(x)), "{x:?}");
    }
}

fn caricature() -> Caricature {
    Caricature::with_reinjection(0.1, 1e-5)
}

const TRANSITIONS: [Transition; 5] = [
    Transition::Tanh,
    Transition::PerturbedTanh { sigma: 0.7 },
    Transition::Arctan,
    Transition::Algebraic,
    Transition::Erf,
];

proptest! {
    #[test]
    fn records_of_the_caricature_and_the_wheel(x in prop::array::uniform3(-2.0..2.0_f64)) {
        let mut misprinted = caricature();
        misprinted.first_component_of_minus = MinusSign::PrintedInEquation5;
        let wheel = Wheel { m: 1.1, j: 0.03, r0: 0.2, gamma: 0.6, ..Wheel::default() };
        for c in [caricature(), misprinted] {
            let record = System::from(c).bind::<3>().unwrap();
            everywhere(x, &mut |check| check(&mut Pieces(&c, &record)));
        }
        let record = wheel.system().bind::<3>().unwrap();
        everywhere(x, &mut |check| check(&mut Pieces(&wheel, &record)));
    }

    #[test]
    fn records_of_the_smoothed_systems(x in prop::array::uniform3(-2.0..2.0_f64),
        near in -0.03..0.03_f64) {
        for transition in TRANSITIONS {
            for x in [x, [near, x[1], x[2]]] {
                let compiled = Smoothed { system: caricature(), transition, eps: 1e-3 };
                let record = Field::smoothed(&System::from(caricature()), transition,
                    1e-3).bind::<3>().unwrap();
                everywhere(x, &mut |check| check(&mut Whole(&compiled, &record)));
            }
            let compiled = Smoothed { system: Wheel::default(), transition, eps: 1e-3 };
            let record = Field::smoothed(&Wheel::default().system(), transition,
                1e-3).bind::<3>().unwrap();
            everywhere(x, &mut |check| check(&mut Whole(&compiled, &record)));
        }
    }

    #[test]
    fn records_of_the_hysteretic_system(x in prop::array::uniform3(-2.0..2.0_f64),
        h in -2e-3..2e-3_f64, phi in 0.0..1.0_f64) {
        for relaxation in [Relaxation::Literal, Relaxation::Single] {
            let compiled = Hysteretic { system: caricature(), eps: 1e-3, eps_prime: 1e-2,
                relaxation };
            let record = Field::hysteretic(&System::from(caricature()), 1e-3, 1e-2,
                relaxation).bind::<4>().unwrap();
            for first in [x[0], h] {
                let state = SVector::from([first, x[1], x[2], phi]);
                prop_assert_eq!(bits(compiled.eval(&state)), bits(record.eval(&state)));
                let extended = state.map(|v| DoubleDouble::new(v, v * 3e-17));
                prop_assert_eq!(bits(compiled.eval(&extended)), bits(record.eval(&extended)));
            }
        }
    }

    #[test]
    fn records_of_the_variational_equation(x in prop::array::uniform3(-2.0..2.0_f64),
        h in -2e-3..2e-3_f64, v in prop::array::uniform9(-1.0..1.0_f64)) {
        let compiled = Smoothed { system: caricature(), transition: Transition::Tanh, eps: 1e-3 };
        let record = Field::smoothed(&System::from(caricature()), Transition::Tanh,
            1e-3).variational(3).bind::<12>().unwrap();
        let state = SVector::<f64, 12>::from_fn(|i, _| match i { 0 => h, i if i < 3 => x[i],
            i => v[i - 3] });
        let want: SVector<f64, 12> = Tangent::<_, 3>(&compiled).eval(&state);
        prop_assert_eq!(bits(want.add_scalar(0.0)), bits(record.eval(&state).add_scalar(0.0)));
    }

    #[test]
    fn a_sliding_flow_stays_on_the_surface_and_is_filippovs(y in -2.0..2.0_f64,
        z in -2.0..2.0_f64) {
        use twofold::system::filippov::{lie_derivatives, sliding_field};
        let system = System::builtin("caricature").unwrap();
        let flow = Field::sliding(&system).bind::<4>().unwrap();
        let x = SVector::from([0.0, y, z]);
        let f = flow.eval(&SVector::from([0.0, y, z, 0.0]));
        prop_assert_eq!(f[0], 0.0);
        let (p, q) = lie_derivatives(&caricature(), &x);
        prop_assert_eq!(f[3].to_bits(), (q - p).to_bits());
        let want = sliding_field(&caricature(), &x) * (q - p);
        for i in 0..3 {
            prop_assert!((f[i] - want[i]).abs() <= 1e-13 * (1.0 + want.norm()), "{} {}", f, want);
        }
    }

    #[test]
    fn reversed_systems_run_backwards(x in prop::array::uniform3(-2.0..2.0_f64)) {
        let system = System::builtin("wheel").unwrap();
        let (forward, back) = (system.bind::<3>().unwrap(), system.reversed().bind::<3>().unwrap());
        let x = SVector::from(x);
        prop_assert_eq!(back.plus(&x), -forward.plus(&x));
        prop_assert_eq!(back.minus(&x), -forward.minus(&x));
        prop_assert_eq!(back.switching(&x), forward.switching(&x));
        let field = Field::smoothed(&system, Transition::Tanh, 1e-2);
        prop_assert_eq!(field.reversed().bind::<3>().unwrap().eval(&x),
            -field.bind::<3>().unwrap().eval(&x));
    }
}

/// Every step's end.
#[derive(Default)]
struct Steps(Vec<u64>);

impl<const N: usize> Observer<N> for Steps {
    fn step(&mut self, step: &Step<'_, N>) -> Flow {
        self.0.push(step.t1.to_bits());
        self.0.extend(step.x1.iter().map(|x| x.to_bits()));
        Flow::Continue
    }
}

fn orbit<F: VectorField<N>, M: Stepper<N>, const N: usize>(
    field: &F,
    x0: [f64; N],
    t_end: f64,
    mut stepper: M,
) -> Vec<u64> {
    let options = DriveOptions {
        t_end,
        schedule: Schedule { restart_every: Some(20.0), kick: None },
        step_cap: StepCap::FractionOfSegment(0.1),
        max_steps: 10_000_000,
        kicked_states: 3,
    };
    let mut steps = Steps::default();
    let _ = drive(field, SVector::from(x0), &options, &mut stepper, &mut steps, &()).unwrap();
    assert!(steps.0.len() > 1000);
    steps.0
}

const TIGHT: Tolerance = Tolerance { rtol: 1e-8, atol: 1e-8 };

#[test]
fn whole_orbits_are_the_same() {
    let transition = Transition::Tanh;
    let system = System::from(caricature());
    let start = [0.2, 0.0, -1.0];
    let compiled = Smoothed { system: caricature(), transition, eps: 1e-3 };
    let record = Field::smoothed(&system, transition, 1e-3).bind::<3>().unwrap();
    let dopri5 = || Dopri5::<3>::new(TIGHT);
    assert_eq!(orbit(&compiled, start, 500.0, dopri5()), orbit(&record, start, 500.0, dopri5()));
    assert_eq!(
        orbit(&compiled, start, 200.0, Taylor::new(TIGHT)),
        orbit(&record, start, 200.0, Taylor::new(TIGHT))
    );
    let extended = || Taylor::extended(Tolerance { rtol: 1e-20, atol: 1e-20 });
    assert_eq!(orbit(&compiled, start, 50.0, extended()), orbit(&record, start, 50.0, extended()));

    let wheel = Smoothed { system: Wheel::default(), transition, eps: 1e-3 };
    let record = Field::smoothed(&Wheel::default().system(), transition, 1e-3).bind::<3>().unwrap();
    let start = [0.69267, 0.0, 0.0];
    assert_eq!(orbit(&wheel, start, 20.0, dopri5()), orbit(&record, start, 20.0, dopri5()));
    assert_eq!(
        orbit(&wheel, start, 8.0, Taylor::new(TIGHT)),
        orbit(&record, start, 8.0, Taylor::new(TIGHT))
    );

    let hysteretic = Hysteretic {
        system: caricature(),
        eps: 1e-3,
        eps_prime: 1e-2,
        relaxation: Relaxation::Literal,
    };
    let record = Field::hysteretic(&system, 1e-3, 1e-2, Relaxation::Literal).bind::<4>().unwrap();
    let start = [0.2, 0.0, -1.0, 1.0];
    let dopri5 = || Dopri5::<4>::new(TIGHT);
    assert_eq!(orbit(&hysteretic, start, 20.0, dopri5()), orbit(&record, start, 20.0, dopri5()));
}

#[test]
fn filippov_motions_are_the_same() {
    let motion = |system: &dyn Fn(&mut Trajectory<3>) -> SVector<f64, 3>| {
        let mut record = Trajectory::new(4);
        let end = system(&mut record);
        (
            bits(end),
            record.events.iter().map(|e| (e.t.to_bits(), bits(e.state))).collect::<Vec<_>>(),
        )
    };
    let rule = ExitRule::AfterTime { time: 0.4, side: Side::Plus };
    let (settings, start) = (filippov::FilippovOptions::default(), SVector::from([0.2, 0.0, -1.0]));
    let compiled =
        motion(&|r| filippov::run(&caricature(), start, 60.0, &settings, rule, r).unwrap().x);
    let bound = System::from(caricature()).bind::<3>().unwrap();
    let record = motion(&|r| filippov::run(&bound, start, 60.0, &settings, rule, r).unwrap().x);
    assert!(compiled.1.len() > 10);
    assert_eq!(compiled, record);
}

#[test]
fn the_fast_path_is_found_by_equations_not_by_name() {
    let system = System::from(caricature()).with("alpha", 0.25).unwrap();
    let want = Caricature { alpha: 0.25, ..caricature() };
    assert_eq!(system.compiled(), Some(want));
    assert_eq!(System::builtin("stick-slip").unwrap().compiled(), None);
    // The same equations under another name, and other equations under the same name.
    let renamed = twofold::system::library::text("caricature")
        .unwrap()
        .replace("name = \"caricature\"", "name = \"mine\"");
    let read = |text: &str| System::new(twofold::system::Definition::from_toml(text, "f").unwrap());
    assert!(read(&renamed).compiled().is_some());
    let changed =
        twofold::system::library::text("caricature").unwrap().replace("[\"z\", ", "[\"2*z\", ");
    assert_eq!(read(&changed).compiled(), None);
    assert_eq!(read(&changed).name(), "caricature");
}

#[test]
fn systems_come_back_from_json() {
    for name in twofold::system::library::names() {
        let mut system = System::builtin(name).unwrap();
        let parameter = system.parameters().next().unwrap().0.to_string();
        system = system
            .with(&parameter, "0.12345678901234567890123".parse::<twofold::num::Decimal>().unwrap())
            .unwrap();
        let json = serde_json::to_string(&system).unwrap();
        assert!(
            !json.contains("references") && json.contains("0.12345678901234567890123"),
            "{json}"
        );
        let back: System = serde_json::from_str(&json).unwrap();
        assert_eq!(back, system, "{name}");
        assert_eq!(back.definition().title(), system.definition().title());
        // A document under a built-in's name with other equations stays what it is.
        let other: System =
            serde_json::from_str(&json.replacen("\"h\":\"", "\"h\":\"1 + ", 1)).unwrap();
        assert_ne!(other.canonical(), system.canonical());
    }
}

#[test]
fn parameters_are_checked() {
    let system = System::from(caricature());
    let error = |name: &str, value: f64| system.clone().with(name, value).unwrap_err().to_string();
    assert!(error("aplha", 1.0).contains("did you mean `alpha`?"));
    assert!(error("alpha", f64::NAN).contains("finite"));
    assert_eq!(
        system.bind::<2>().unwrap_err().to_string(),
        "this equation has 3 states; it was asked for in dimension 2"
    );
}

#[test]
fn decimal_parameters_reach_extended_precision() {
    // x' = gamma: with gamma = pi/4 to 36 digits, the series' slope is pi/4 to 31, and to 16 if
    // read as binary.
    let text = "states = ['x']\nh = 'x'\nplus = ['4*gamma']\nminus = ['1']\n[parameters]\ngamma = \
        '0.785398163397448309615660845819875721'";
    let system = System::new(twofold::system::Definition::from_toml(text, "f").unwrap());
    let field = Field::plus(&system);
    let slope = |constants| {
        let mut s = Solution::<DoubleDouble>::new(2, field.tape(), constants);
        s.expand(&[DoubleDouble::zero()]);
        (s.component(0)[1] - DoubleDouble::PI).high().abs()
    };
    assert!(slope(Constants::Decimal) < 1e-30);
    assert!(slope(Constants::Binary) > 1e-17);
}

/// A chain of `n` masses on springs, the first rubbing on a belt.
fn chain(n: usize) -> String {
    let names: Vec<String> = (0..n).flat_map(|i| [format!("x{i}"), format!("v{i}")]).collect();
    let force = |i: usize| {
        let left = if i == 0 { String::new() } else { format!(" + x{}", i - 1) };
        let right = if i + 1 == n { String::new() } else { format!(" + x{}", i + 1) };
        format!("-2*x{i}{left}{right}")
    };
    let side = |sign: &str| -> String {
        let all: Vec<String> = (0..n)
            .flat_map(|i| {
                [format!("\"v{i}\""), format!("\"{}{}\"", force(i), if i == 0 { sign } else { "" })]
            })
            .collect();
        all.join(", ")
    };
    format!(
        "states = [{}]\nh = \"v0 - 0.3\"\nplus = [{}]\nminus = [{}]\n",
        names.iter().map(|n| format!("\"{n}\"")).collect::<Vec<_>>().join(", "),
        side(" - 1"),
        side(" + 1"),
    )
}

#[test]
fn eight_states_and_more() {
    let system = System::new(
        twofold::system::Definition::from_toml(&chain(4), "chain")
            .unwrap_or_else(|e| panic!("{e}")),
    );
    assert_eq!(system.dimension(), 8);
    let field = Field::smoothed(&system, Transition::Tanh, 1e-2).bind::<8>().unwrap();
    let x0 = SVector::<f64, 8>::from_fn(|i, _| 0.1 * i as f64);
    let mut steps = Steps::default();
    let options = DriveOptions {
        t_end: 20.0,
        schedule: Schedule::default(),
        step_cap: StepCap::None,
        max_steps: 1_000_000,
        kicked_states: 8,
    };
    let end = drive(&field, x0, &options, &mut Dopri5::new(TIGHT), &mut steps, &()).unwrap();
    assert!(end.x.iter().all(|x| x.abs() < 10.0));
    // Sixteen states and a tangent vector, evaluated without a dimension at compile time.
    let large = System::new(twofold::system::Definition::from_toml(&chain(8), "chain").unwrap());
    let tangent = Field::hysteretic(&large, 1e-2, 1e-1, Relaxation::Single).variational(1);
    assert_eq!(tangent.dimension(), 34);
    let mut out = vec![f64::NAN; 34];
    tangent.evaluate(&vec![0.25; 34], &mut out);
    assert!(out.iter().all(|v| v.is_finite()));
}

#[test]
fn recorded_rust_is_data_too() {
    let compiled = Smoothed { system: caricature(), transition: Transition::Tanh, eps: 1e-3 };
    let field = Field::record(["x", "y", "z"], &compiled);
    let tape: &Tape = field.tape();
    assert_eq!((tape.variables(), tape.tanh_count()), (3, 1));
    let x = SVector::from([1e-3, 0.4, -0.3]);
    assert_eq!(bits(field.bind::<3>().unwrap().eval(&x)), bits(compiled.eval(&x)));
}
