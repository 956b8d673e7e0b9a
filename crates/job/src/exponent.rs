//! The largest Lyapunov exponent as a question.

use nalgebra::SVector;
use serde::Serialize;
use serde_json::Value;

use super::answer::{Answer, Stop};
use super::question::{Ask, JobError, Question};
use super::spec::SwitchSpec;
use twofold_analyse::lyapunov::{self, Estimate, Exponent};
use twofold_analyse::tangent::Tangent;
use twofold_instances_switched::{self as switched, Late};
use twofold_instances_tangent::{Exponents, Growth};
use twofold_integrate::Monitor;
use twofold_integrate::ensemble::InstructionSet;
use twofold_system::{Bound, BoundField, Field, Hysteretic, ParameterBatch, Smoothed, System};

/// The largest Lyapunov exponent of the orbit from `start`. Facts: `exponent` ([`Exponent`]),
/// `half_width` of its 95 % interval and `sign` ([`Sign`](lyapunov::Sign)) by that interval; or
/// `failure` with the reason if the orbit could not be followed (it leaves, or its future is a
/// set).
///
/// ```
/// use twofold_analyse::lyapunov::{Exponent, LyapunovOptions};
/// use twofold_job::{Executor, LargestExponent, spec::SwitchSpec};
/// use twofold_system::System;
/// let question = LargestExponent {
///     system: System::builtin("fused-focus").expect("built in").with("mu", -0.02)?,
///     switch: SwitchSpec::tanh(1e-2),
///     start: vec![0.0, 0.3],
///     settings: LyapunovOptions { transient: 10.0, duration: 50.0, ..Default::default() },
/// };
/// let exponent: Exponent = Executor::quiet().ask(&question)?.fact("exponent")?;
/// assert!(exponent.value < 1.0 && exponent.duration == 50.0);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LargestExponent {
    /// The system.
    pub system: System,
    /// The switch; kicks are part of the settings.
    pub switch: SwitchSpec,
    /// Start of the orbit.
    pub start: Vec<f64>,
    /// Options of the computation.
    pub settings: lyapunov::LyapunovOptions,
}

impl LargestExponent {
    /// The exponent that an answer has, if the orbit could be followed.
    pub(super) fn found(&self, answer: &Answer) -> Option<Exponent> {
        answer.fact("exponent").ok()
    }

    /// The exponents of several questions that differ in start and in the equation's numbers alone,
    /// side by side in the lanes of vector registers: of each what its answer has
    /// ([`LargestExponent::found`]), bit for bit. Nothing if they differ in more, or lanes have no
    /// room for their equation.
    ///
    /// # Errors
    /// [`JobError::Interrupted`] if `monitor` asks to stop.
    pub(super) fn side_by_side(
        questions: &[&Self],
        set: InstructionSet,
        monitor: &dyn Monitor,
    ) -> Result<Option<Vec<Option<Exponent>>>, JobError> {
        let Some(first) = questions.first() else { return Ok(Some(Vec::new())) };
        let alike = |q: &&Self| q.settings == first.settings && q.start.len() == first.start.len();
        let smoothed = |q: &&Self| matches!(q.switch, SwitchSpec::Smoothed { .. });
        if first.settings.kick.is_some() || !questions.iter().all(|q| alike(q) && smoothed(q)) {
            return Ok(None);
        }
        match first.start.len() {
            2 => Self::in_lanes::<2, 4>(questions, set, monitor),
            3 => Self::in_lanes::<3, 6>(questions, set, monitor),
            4 => Self::in_lanes::<4, 8>(questions, set, monitor),
            _ => Ok(None),
        }
    }

    fn in_lanes<const N: usize, const M: usize>(
        questions: &[&Self],
        set: InstructionSet,
        monitor: &dyn Monitor,
    ) -> Result<Option<Vec<Option<Exponent>>>, JobError>
    where
        ParameterBatch<M>: Exponents<N>,
    {
        let fields: Option<Vec<BoundField<M>>> =
            questions.iter().map(|q| q.tangent()?.bind().ok()).collect();
        let Some(tangents) = fields.and_then(ParameterBatch::new) else { return Ok(None) };
        let starts: Vec<_> =
            questions.iter().map(|q| SVector::<f64, N>::from_column_slice(&q.start)).collect();
        let settings = &questions[0].settings;
        match tangents.exponents(set, &starts, settings, monitor) {
            Some(found) => Ok(Some(found.into_iter().map(Result::ok).collect())),
            None => Err(JobError::Interrupted),
        }
    }

    /// The smoothed equation with its variational equation, as data: the operations that
    /// [`LargestExponent::exponent`] goes through.
    fn tangent(&self) -> Option<Field> {
        let SwitchSpec::Smoothed { eps, transition } = self.switch else { return None };
        Some(match self.system.compiled() {
            Some(system) => {
                let field = Smoothed { system, transition, eps };
                // Symbolically, so that nothing is computed with derivatives that are zero
                // everywhere: a third of all instructions.
                Field::record(["x", "y", "z"], &field).variational(1)
            }
            _ => Field::smoothed(&self.system, transition, eps).variational(1),
        })
    }

    fn exponent(&self, monitor: &dyn Monitor) -> Result<Estimate, String> {
        let start = |i: usize| self.start.get(i).copied().unwrap_or(f64::NAN);
        let dimension = self.system.dimension();
        if self.start.len() != dimension {
            return Err(format!(
                "the start has {} numbers, the system {dimension} states",
                self.start.len()
            ));
        }
        let field = match (self.switch, self.system.compiled()) {
            (SwitchSpec::Smoothed { eps, transition }, Some(system)) => {
                let field = Smoothed { system, transition, eps };
                let x = SVector::from_fn(|i, _| start(i));
                let tangent = Tangent::<_, 1>(&field);
                return tangent.growth(x, 3, &self.settings, monitor).map_err(|e| e.to_string());
            }
            (SwitchSpec::Hysteretic { eps, eps_prime, relaxation, .. }, Some(system)) => {
                let field = Hysteretic { system, eps, eps_prime, relaxation };
                let x = SVector::from_fn(|i, _| if i < 3 { start(i) } else { self.phi() });
                let tangent = Tangent::<_, 1>(&field);
                return tangent.growth(x, 3, &self.settings, monitor).map_err(|e| e.to_string());
            }
            (SwitchSpec::Smoothed { eps, transition }, _) => {
                Field::smoothed(&self.system, transition, eps)
            }
            (SwitchSpec::Hysteretic { eps, eps_prime, relaxation, .. }, _) => {
                Field::hysteretic(&self.system, eps, eps_prime, relaxation)
            }
            (SwitchSpec::Delayed { .. } | SwitchSpec::Relay { .. }, _) => {
                return self.of_late_switch(monitor);
            }
            (SwitchSpec::Filippov { .. }, _) => {
                return Err(
                    "the largest exponent alone has no tangent flow across a jump; ask for all \
                        (twofold lyapunov)"
                        .into(),
                );
            }
        };
        let tangent = field.variational(1);
        match field.dimension() {
            1 => self.along::<1, 2>(&tangent, monitor),
            2 => self.along::<2, 4>(&tangent, monitor),
            3 => self.along::<3, 6>(&tangent, monitor),
            4 => self.along::<4, 8>(&tangent, monitor),
            5 => self.along::<5, 10>(&tangent, monitor),
            n => Err(format!(
                "the largest exponent alone is computed for up to five states, not for {n}; ask \
                    for all (twofold lyapunov)"
            )),
        }
    }

    /// Of a switch that depends on the past.
    fn of_late_switch(&self, monitor: &dyn Monitor) -> Result<Estimate, String> {
        match self.start.len() {
            1 => self.late::<1>(&self.bound()?, monitor),
            2 => self.late::<2>(&self.bound()?, monitor),
            3 => {
                self.late::<3>(&*switched::late(&self.system).map_err(|e| e.to_string())?, monitor)
            }
            4 => self.late::<4>(&self.bound()?, monitor),
            n => Err(format!(
                "exponents of switches with a past are computed for up to four states, not for {n}"
            )),
        }
    }

    fn bound<const N: usize>(&self) -> Result<Bound<N>, String> {
        self.system.bind().map_err(|e| e.to_string())
    }

    fn late<const N: usize>(
        &self,
        system: &dyn Late<N>,
        monitor: &dyn Monitor,
    ) -> Result<Estimate, String> {
        let Some(switch) = self.switch.late() else { return Err("this switch has no past".into()) };
        let x0 = SVector::from_column_slice(&self.start);
        system
            .late_growth(&self.system, switch, x0, &self.settings, monitor)
            .map_err(|e| e.to_string())
    }

    /// By the recorded equation and its variational equation.
    fn along<const N: usize, const M: usize>(
        &self,
        tangent: &Field,
        monitor: &dyn Monitor,
    ) -> Result<Estimate, String>
    where
        BoundField<M>: Growth<N>,
    {
        let tangent = tangent.bind::<M>().map_err(|e| e.to_string())?;
        let x = SVector::<f64, N>::from_fn(|i, _| {
            self.start.get(i).copied().unwrap_or_else(|| self.phi())
        });
        tangent.growth(x, self.start.len(), &self.settings, monitor).map_err(|e| e.to_string())
    }

    /// phi at the start, as runs have it.
    fn phi(&self) -> f64 {
        SwitchSpec::phi_at(&self.system, &self.start)
    }
}

impl Question for LargestExponent {
    fn kind(&self) -> &'static str {
        "largest-exponent"
    }

    fn json(&self) -> Value {
        serde_json::to_value(self).expect("settings are plain data")
    }

    fn label(&self) -> String {
        format!("largest exponent over {}", self.settings.duration)
    }

    fn cost(&self) -> f64 {
        let stiff = if matches!(self.switch, SwitchSpec::Hysteretic { .. }) { 20.0 } else { 1.0 };
        3.0 * stiff * (self.settings.transient + self.settings.duration)
    }

    fn extent(&self) -> f64 {
        self.settings.transient + self.settings.duration
    }

    fn compute(&self, _: &dyn Ask, monitor: &dyn Monitor) -> Result<Answer, JobError> {
        let found = self.exponent(monitor);
        let mut answer = Answer::of_tables(Vec::new());
        if let Ok(Estimate { exponent, .. }) = &found
            && exponent.duration < self.settings.duration
        {
            if !exponent.value.is_finite() {
                return Err(JobError::Interrupted);
            }
            answer.stop = Stop::Interrupted;
        }
        Ok(match found {
            Ok(estimate) => answer
                .with_fact("exponent", &estimate.exponent)
                .with_fact("half_width", &estimate.half_width)
                .with_fact("sign", &estimate.sign()),
            Err(failure) => answer.with_fact("failure", &failure),
        })
    }
}

#[cfg(test)]
mod tests {
    use crate::Executor;
    use std::ops::ControlFlow;

    use super::*;
    use crate::cases;
    use twofold_integrate::Tolerance;
    use twofold_integrate::filippov::{ExitRule, Side};
    use twofold_system::{Caricature, Relaxation, Transition};

    fn question(system: System, switch: SwitchSpec, duration: f64) -> LargestExponent {
        let tolerance = Tolerance { rtol: 1e-9, atol: 1e-9 };
        let start = vec![1.0; system.dimension()];
        let settings = lyapunov::LyapunovOptions {
            tolerance,
            transient: 20.0,
            duration,
            ..lyapunov::LyapunovOptions::default()
        };
        LargestExponent { system, switch, start, settings }
    }

    fn hysteretic() -> SwitchSpec {
        SwitchSpec::hysteretic(1e-2, Relaxation::Single)
    }

    /// Decays at the rates 1, 2, 3 ... : neighbours approach each other at the lowest. phi, where
    /// it is a state, follows h, which is far from 0.
    #[test]
    fn the_slowest_of_many_decays_is_the_exponent() {
        for n in 1..=5 {
            for switch in
                [SwitchSpec::tanh(1e-2), hysteretic()].into_iter().take(if n < 5 { 2 } else { 1 })
            {
                let answer = question(cases::decays(n), switch, 10.0)
                    .compute(&Executor::quiet(), &())
                    .unwrap();
                let exponent: Exponent =
                    answer.fact("exponent").unwrap_or_else(|e| panic!("{n} {switch:?}: {e}"));
                assert!((exponent.value + 1.0).abs() < 1e-5, "{n} {switch:?}: {exponent:?}");
                assert_eq!((exponent.duration, answer.stop), (10.0, Stop::Finished));
            }
        }
    }

    /// The same where the switch depends on the past, which these orbits never ask: h is far from
    /// 0.
    #[test]
    fn decays_have_the_slowest_rate_whatever_the_switch() {
        let smooth = SwitchSpec::Delayed {
            delay: 0.3,
            eps: Some(1e-2),
            transition: Some(Transition::Tanh),
            history: twofold_integrate::delay::History::Constant,
        };
        for n in 1..=4 {
            for switch in [SwitchSpec::delayed(0.3), SwitchSpec::relay(0.1), smooth] {
                let answer = question(cases::decays(n), switch, 10.0)
                    .compute(&Executor::quiet(), &())
                    .unwrap();
                let exponent: Exponent =
                    answer.fact("exponent").unwrap_or_else(|e| panic!("{n} {switch:?}: {e}"));
                assert!((exponent.value + 1.0).abs() < 1e-5, "{n} {switch:?}: {exponent:?}");
            }
        }
    }

    /// The compiled equations and those of the same system's file.
    #[test]
    fn the_caricature_is_its_file() {
        let compiled = System::from(Caricature::with_reinjection(0.1, 1e-5));
        let recorded = cases::of(&compiled.definition().to_toml().replace("\"-y\"", "\"0 - y\""));
        assert!(compiled.compiled().is_some() && recorded.compiled().is_none());
        for switch in [SwitchSpec::tanh(1e-2), hysteretic()] {
            let [a, b] = [&compiled, &recorded].map(|system| {
                let question = LargestExponent {
                    start: vec![0.2, 0.0, -1.0],
                    ..question(system.clone(), switch, 30.0)
                };
                question
                    .compute(&Executor::quiet(), &())
                    .unwrap()
                    .fact::<Exponent>("exponent")
                    .unwrap()
            });
            assert!((a.value - b.value).abs() < 1e-4, "{a:?} {b:?}");
        }
    }

    /// Orbits side by side have the exponents that they have alone: the compiled caricature's with
    /// numbers of their own, files' systems of two to four states, every transition function; some
    /// that cannot be followed, and vectors that shrink by far more than a step may.
    #[test]
    fn exponents_side_by_side_are_those_alone() {
        let compiled = |alpha: f64| System::from(Caricature::with_reinjection(alpha, 1e-5));
        let caricature = |alpha: f64, switch: SwitchSpec| {
            let question = question(compiled(alpha), switch, 4.0);
            let settings = lyapunov::LyapunovOptions { transient: 1.0, ..question.settings };
            LargestExponent { start: vec![0.2, alpha, -1.0], settings, ..question }
        };
        let smoothed = |eps: f64, transition: Transition| SwitchSpec::Smoothed { eps, transition };
        let mut all: Vec<(Vec<LargestExponent>, bool)> = Vec::new();
        let transitions = [
            Transition::PerturbedTanh { sigma: 0.1 },
            Transition::Arctan,
            Transition::Algebraic,
            Transition::Erf,
        ];
        for transition in transitions {
            all.push((
                (1..4)
                    .map(|k| caricature(0.1 * f64::from(k), smoothed(1e-2, transition)))
                    .collect(),
                true,
            ));
        }
        let tanh = |k: u32| {
            caricature(
                0.1 + 0.002 * f64::from(k),
                smoothed(1e-2 / f64::from(1 + k % 3), Transition::Tanh),
            )
        };
        let mut many: Vec<_> = (0..70).map(tanh).collect();
        many[7].start[0] = f64::NAN;
        many[9].start[1] = 1e200;
        all.push((many, true));
        for (states, growth) in [(2, "0.9"), (3, "0.9"), (4, "-2")] {
            let of = |k: u32| {
                let names = ["x", "y", "z", "w"];
                let mut fields: Vec<String> =
                    names.iter().map(|name| format!("0 - {name}*{k}")).collect();
                fields[0] = format!("x*({growth} - x*x) + tanh(y)");
                let fields: Vec<&str> = fields[..states].iter().map(String::as_str).collect();
                let system = cases::smooth(&names[..states], "y - 0.3", &fields);
                let start = vec![0.1 * f64::from(k); states];
                LargestExponent { start, ..question(system, SwitchSpec::tanh(1e-2), 20.0) }
            };
            all.push(((2..7).map(of).collect(), true));
        }
        // No exponent before its time: a budget of steps.
        let poor = |k: u32| {
            let question = caricature(0.1 + 0.01 * f64::from(k), SwitchSpec::tanh(1e-2));
            let settings = lyapunov::LyapunovOptions { max_steps: 500, ..question.settings };
            LargestExponent { settings, ..question }
        };
        all.push(((0..3).map(poor).collect(), true));
        // Settings that differ, kicks, other equations, five states.
        let [mut a, b] = [0.1, 0.2].map(|alpha| caricature(alpha, SwitchSpec::tanh(1e-2)));
        all.push((vec![a.clone(), caricature(0.1, smoothed(1e-2, Transition::Erf))], false));
        all.push((vec![a.clone(), caricature(0.1, hysteretic())], false));
        a.settings.duration = 10.0;
        all.push((vec![a.clone(), b.clone()], false));
        a.settings.kick = Some(twofold_integrate::Kick {
            every: 1.0,
            size: 1e-3,
            law: twofold_integrate::KickLaw::Sphere,
            seed: 1,
            stream: 1,
        });
        all.push((vec![a.clone(), a], false));
        let five = question(cases::decays(5), SwitchSpec::tanh(1e-2), 9.0);
        all.push((vec![five.clone(), five], false));
        for (questions, together) in all {
            let alone: Vec<Option<Exponent>> = questions
                .iter()
                .map(|question| question.found(&question.compute(&Executor::quiet(), &()).unwrap()))
                .collect();
            let bits = |all: &[Option<Exponent>]| -> Vec<_> {
                all.iter()
                    .map(|e| e.map(|e| [e.value, e.standard_error, e.duration].map(f64::to_bits)))
                    .collect()
            };
            let questions: Vec<_> = questions.iter().collect();
            for set in InstructionSet::ALL.into_iter().filter(|set| set.is_here()) {
                let found = LargestExponent::side_by_side(&questions, set, &()).unwrap();
                assert_eq!(found.is_some(), together, "{:?}", questions[0]);
                if let Some(found) = found {
                    assert_eq!(bits(&found), bits(&alone), "{set:?} {:?}", questions[0]);
                }
            }
            if questions.len() == 70 {
                let none = |i: usize| alone[i].is_none();
                assert!(none(7) && none(9) && !none(8), "{alone:?}");
            }
        }
    }

    #[test]
    fn what_has_no_exponent_says_why() {
        let said = |q: LargestExponent| {
            q.compute(&Executor::quiet(), &()).unwrap().fact::<String>("failure").unwrap()
        };
        let few = LargestExponent {
            start: vec![1.0],
            ..question(cases::decays(2), SwitchSpec::tanh(1e-2), 9.0)
        };
        assert!(said(few).contains("1 numbers, the system 2 states"));
        let exit = ExitRule::AtOnce { side: Side::Plus };
        let filippov = question(cases::decays(2), SwitchSpec::Filippov { exit, funnel: None }, 9.0);
        assert!(said(filippov).contains("ask for all"));
        assert!(
            said(question(cases::decays(6), SwitchSpec::tanh(1e-2), 9.0)).contains("not for 6")
        );
        assert!(said(question(cases::decays(5), hysteretic(), 9.0)).contains("not for 6"));
        assert!(
            said(question(cases::decays(5), SwitchSpec::relay(0.1), 9.0)).contains("not for 5")
        );
        // x' = x^2 leaves at t = 1.
        let leaving = cases::smooth(&["x"], "x + 1", &["x*x"]);
        assert!(!said(question(leaving, SwitchSpec::tanh(1e-2), 9.0)).is_empty());
    }

    #[test]
    fn phi_begins_on_the_side_of_the_start() {
        let system = cases::smooth(&["x", "y"], "y - 1", &["-x", "-y"]);
        for (y, phi) in [(1.5, 1.0), (0.5, 0.0), (1.0, 1.0)] {
            let question = LargestExponent {
                start: vec![0.0, y],
                ..question(system.clone(), hysteretic(), 9.0)
            };
            assert_eq!(question.phi(), phi, "{y}");
        }
    }

    /// Asked to stop at a third of the time; and before eight of the 64 blocks are done.
    #[test]
    fn an_interrupted_mean_says_so() {
        struct Until(f64);
        impl Monitor for Until {
            fn reached(&self, t: f64) -> ControlFlow<()> {
                if t < self.0 { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
            }
        }
        let turning = |duration| {
            question(
                cases::smooth(&["x", "v"], "x + 9", &["v", "-x"]),
                SwitchSpec::tanh(1e-2),
                duration,
            )
        };
        let third = turning(3000.0).compute(&Executor::quiet(), &Until(1000.0)).unwrap();
        assert_eq!(third.stop, Stop::Interrupted);
        let exponent: Exponent = third.fact("exponent").unwrap();
        assert!(
            (900.0..2500.0).contains(&exponent.duration) && exponent.value.abs() < 1e-2,
            "{exponent:?}"
        );
        assert_eq!(
            turning(30_000.0).compute(&Executor::quiet(), &Until(1.0)),
            Err(JobError::Interrupted)
        );
    }
}
