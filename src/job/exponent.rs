//! The question of the largest Lyapunov exponent.

use nalgebra::SVector;
use serde::Serialize;
use serde_json::Value;

use super::answer::{Answer, Stop};
use super::desk::Desk;
use super::question::{JobError, Question};
use super::spec::SwitchSpec;
use crate::analyse::lyapunov::{self, Exponent};
use crate::analyse::tangent::Tangent;
use crate::integrate::Watch;
use crate::num::tape::Program;
use crate::system::{Compiled, Field, Hysteretic, Smoothed, System};

/// The largest Lyapunov exponent of the orbit from `start`. Fact: `exponent` ([`Exponent`]), or `failure` with the reason if the orbit
/// could not be followed (it leaves, or its motion is set-valued and has no tangent flow).
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LargestExponent {
    /// The system.
    pub system: System,
    /// The switch; kicks are part of the settings.
    pub switch: SwitchSpec,
    /// Where the orbit starts.
    pub start: Vec<f64>,
    /// How the exponent is computed.
    pub settings: lyapunov::Settings,
}

impl LargestExponent {
    fn exponent(&self, watch: &dyn Watch) -> Result<Exponent, String> {
        let start = |i: usize| self.start.get(i).copied().unwrap_or(f64::NAN);
        let dimension = self.system.dimension();
        if self.start.len() != dimension {
            return Err(format!("the start has {} numbers, the system {dimension} states", self.start.len()));
        }
        let field = match (self.switch, self.system.compiled()) {
            (SwitchSpec::Smoothed { eps, transition }, Some(Compiled::Caricature(system))) => {
                let field = Smoothed { system, transition, eps };
                let x = SVector::from_fn(|i, _| start(i));
                let tangent = Tangent::<_, 1>(&field);
                return lyapunov::largest_watched::<3, 6, _>(&tangent, x, 3, &self.settings, watch)
                    .map_err(|e| e.to_string());
            }
            (SwitchSpec::Hysteretic { eps, eps_prime, relaxation, .. }, Some(Compiled::Caricature(system))) => {
                let field = Hysteretic { system, eps, eps_prime, relaxation };
                let x = SVector::from_fn(|i, _| if i < 3 { start(i) } else { self.phi() });
                let tangent = Tangent::<_, 1>(&field);
                return lyapunov::largest_watched::<4, 8, _>(&tangent, x, 3, &self.settings, watch)
                    .map_err(|e| e.to_string());
            }
            (SwitchSpec::Smoothed { eps, transition }, _) => Field::smoothed(&self.system, transition, eps),
            (SwitchSpec::Hysteretic { eps, eps_prime, relaxation, .. }, _) => {
                Field::hysteretic(&self.system, eps, eps_prime, relaxation)
            }
            (SwitchSpec::Filippov { .. }, _) => return Err("a set-valued motion has no tangent flow".into()),
        };
        let tangent = field.variational(1);
        match field.dimension() {
            1 => self.along::<1, 2>(&tangent, watch),
            2 => self.along::<2, 4>(&tangent, watch),
            3 => self.along::<3, 6>(&tangent, watch),
            4 => self.along::<4, 8>(&tangent, watch),
            5 => self.along::<5, 10>(&tangent, watch),
            6 => self.along::<6, 12>(&tangent, watch),
            7 => self.along::<7, 14>(&tangent, watch),
            8 => self.along::<8, 16>(&tangent, watch),
            9 => self.along::<9, 18>(&tangent, watch),
            n => Err(format!("exponents are computed for up to nine states, not for {n}")),
        }
    }

    /// By the recorded equation and its variational equation.
    fn along<const N: usize, const M: usize>(&self, tangent: &Field, watch: &dyn Watch) -> Result<Exponent, String> {
        let tangent = tangent.bind::<M>().map_err(|e| e.to_string())?;
        let x = SVector::<f64, N>::from_fn(|i, _| self.start.get(i).copied().unwrap_or_else(|| self.phi()));
        lyapunov::largest_watched::<N, M, _>(&tangent, x, self.start.len(), &self.settings, watch)
            .map_err(|e| e.to_string())
    }

    /// phi at the start: within its relaxation time of the side that h says.
    fn phi(&self) -> f64 {
        let mut h = [f64::NAN];
        Program::new(&self.system.tape().select([0])).evaluate(&self.start, &mut h);
        if h[0] > 0.0 { 1.0 } else { 0.0 }
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

    fn compute(&self, _: &Desk<'_>, watch: &dyn Watch) -> Result<Answer, JobError> {
        let found = self.exponent(watch);
        let mut answer = Answer::of_tables(Vec::new());
        if let Ok(exponent) = &found
            && exponent.duration < self.settings.duration
        {
            if !exponent.value.is_finite() {
                return Err(JobError::Interrupted);
            }
            answer.stop = Stop::Interrupted;
        }
        Ok(match found {
            Ok(exponent) => answer.with_fact("exponent", &exponent),
            Err(failure) => answer.with_fact("failure", &failure),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::integrate::Tolerance;
    use crate::integrate::filippov::{ExitRule, Side};
    use crate::job::cases;
    use crate::system::{Caricature, Relaxation};

    fn question(system: System, switch: SwitchSpec, duration: f64) -> LargestExponent {
        let tolerance = Tolerance { rtol: 1e-9, atol: 1e-9 };
        let start = vec![1.0; system.dimension()];
        let settings = lyapunov::Settings { tolerance, transient: 20.0, duration, ..lyapunov::Settings::default() };
        LargestExponent { system, switch, start, settings }
    }

    fn hysteretic() -> SwitchSpec {
        SwitchSpec::hysteretic(1e-2, Relaxation::Single)
    }

    /// Decays at the rates 1, 2, 3 ... : neighbours approach each other at the lowest. phi, where it is a state, follows h, which is far from 0.
    #[test]
    fn the_slowest_of_many_decays_is_the_exponent() {
        for n in 1..=9 {
            for switch in [SwitchSpec::tanh(1e-2), hysteretic()].into_iter().take(if n < 9 { 2 } else { 1 }) {
                let answer = question(cases::decays(n), switch, 10.0).compute(&Desk::quiet(), &()).unwrap();
                let exponent: Exponent = answer.fact("exponent").unwrap_or_else(|e| panic!("{n} {switch:?}: {e}"));
                assert!((exponent.value + 1.0).abs() < 1e-5, "{n} {switch:?}: {exponent:?}");
                assert_eq!((exponent.duration, answer.stop), (10.0, Stop::Finished));
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
                let question =
                    LargestExponent { start: vec![0.2, 0.0, -1.0], ..question(system.clone(), switch, 30.0) };
                question.compute(&Desk::quiet(), &()).unwrap().fact::<Exponent>("exponent").unwrap()
            });
            assert!((a.value - b.value).abs() < 1e-4, "{a:?} {b:?}");
        }
    }

    #[test]
    fn what_has_no_exponent_says_why() {
        let said = |q: LargestExponent| q.compute(&Desk::quiet(), &()).unwrap().fact::<String>("failure").unwrap();
        let few = LargestExponent { start: vec![1.0], ..question(cases::decays(2), SwitchSpec::tanh(1e-2), 9.0) };
        assert!(said(few).contains("1 numbers, the system 2 states"));
        let exit = ExitRule::AtOnce { side: Side::Plus };
        let filippov = question(cases::decays(2), SwitchSpec::Filippov { exit, funnel: None }, 9.0);
        assert!(said(filippov).contains("no tangent flow"));
        assert!(said(question(cases::decays(10), SwitchSpec::tanh(1e-2), 9.0)).contains("not for 10"));
        assert!(said(question(cases::decays(9), hysteretic(), 9.0)).contains("not for 10"));
        // x' = x^2 leaves at t = 1.
        let leaving = cases::smooth(&["x"], "x + 1", &["x*x"]);
        assert!(!said(question(leaving, SwitchSpec::tanh(1e-2), 9.0)).is_empty());
    }

    #[test]
    fn phi_begins_on_the_side_of_the_start() {
        let system = cases::smooth(&["x", "y"], "y - 1", &["-x", "-y"]);
        for (y, phi) in [(1.5, 1.0), (0.5, 0.0), (1.0, 0.0)] {
            let question = LargestExponent { start: vec![0.0, y], ..question(system.clone(), hysteretic(), 9.0) };
            assert_eq!(question.phi(), phi, "{y}");
        }
    }

    /// Asked to stop at a third of the time; and before eight of the 64 blocks are done.
    #[test]
    fn an_interrupted_mean_says_so() {
        struct Until(f64);
        impl Watch for Until {
            fn reached(&self, t: f64) -> bool {
                t < self.0
            }
        }
        let turning =
            |duration| question(cases::smooth(&["x", "v"], "x + 9", &["v", "-x"]), SwitchSpec::tanh(1e-2), duration);
        let third = turning(3000.0).compute(&Desk::quiet(), &Until(1000.0)).unwrap();
        assert_eq!(third.stop, Stop::Interrupted);
        let exponent: Exponent = third.fact("exponent").unwrap();
        assert!((900.0..2500.0).contains(&exponent.duration) && exponent.value.abs() < 1e-2, "{exponent:?}");
        assert_eq!(turning(30_000.0).compute(&Desk::quiet(), &Until(1.0)), Err(JobError::Interrupted));
    }
}
