//! The time up to which an orbit in extended precision is free of rounding errors.

use std::sync::Arc;

use serde_json::{Value, json};

use super::answer::{Answer, Stop};
use super::question::{AnyQuestion, Ask, JobError, Question};
use super::run::Run;
use super::spec::{MethodSpec, Observation, RunSpec, SpecError, finest_extended};
use super::table::{Column, Entry, Table};
use twofold_integrate::{Method, Monitor, PRECISIONS, Tolerance, taylor};

/// The time up to which an orbit computed with [`Method::TaylorExtended`] agrees with two others:
/// one of the next precision, at its finest tolerance, and one of the same precision and another
/// order. Rounding shows in the first comparison, the series' truncation in both.
///
/// Compared are the states at [`Horizon::SAMPLES`] even times, in units of 1 + the state's largest
/// component.
///
/// Facts: `horizon`, the last of these times before the first at which either differs by more than
/// `within`; `by_precision` and `by_order`, the same for each alone; `precision`,
/// `other_precision`, `order`, `other_order`. Table `horizon`: the differences at each time.
#[derive(Clone, Debug, PartialEq)]
pub struct Horizon {
    /// The orbit. Its observation is ignored.
    pub run: RunSpec,
    /// Largest difference that counts as agreement.
    pub within: f64,
}

/// Degrees more of the comparison's series.
const MORE_DEGREES: u16 = 8;

impl Horizon {
    /// Number of times at which states are compared.
    pub const SAMPLES: usize = 1000;

    fn variant(&self, precision: u16, order: Option<u16>, tolerance: Tolerance) -> AnyQuestion {
        let method = MethodSpec { precision: Some(precision), order, tolerance, ..self.run.method };
        let every = self.run.t_end / Self::SAMPLES as f64;
        Arc::new(Run(RunSpec { method, observe: Observation::Times { every }, ..self.run.clone() }))
    }
}

impl Question for Horizon {
    fn kind(&self) -> &'static str {
        "horizon"
    }

    fn json(&self) -> Value {
        json!({ "run": Run(self.run.clone()).json(), "within": self.within,
            "more_degrees": MORE_DEGREES })
    }

    fn label(&self) -> String {
        "horizon of the precision".into()
    }

    fn cost(&self) -> f64 {
        10.0 * Run(self.run.clone()).cost()
    }

    fn compute(&self, executor: &dyn Ask, _: &dyn Monitor) -> Result<Answer, JobError> {
        let method = &self.run.method;
        if method.name != Method::TaylorExtended {
            let rule = "only orbits of taylor-extended have a horizon: other methods' errors are \
                those of their tolerance";
            return Err(
                SpecError { field: "method", value: method.name.name().to_owned(), rule }.into()
            );
        }
        let bits = method.precision.unwrap_or(PRECISIONS[0]);
        // Of the highest precision there is no better one: it is compared with the next lower,
        // whose horizon it then shows.
        let at = PRECISIONS.iter().position(|b| *b == bits).unwrap_or(0);
        let other = PRECISIONS.get(at + 1).copied().unwrap_or(PRECISIONS[PRECISIONS.len() - 2]);
        let order =
            method.order.unwrap_or(taylor::order_for(method.tolerance, finest_extended(bits)));
        let finest = Tolerance { rtol: finest_extended(other), atol: finest_extended(other) };
        let runs = [
            self.variant(bits, method.order, method.tolerance),
            self.variant(other, None, finest),
            self.variant(bits, Some(order + MORE_DEGREES), method.tolerance),
        ];
        executor.gather(&runs);
        let answers = runs.iter().map(|r| executor.ask(&**r)).collect::<Result<Vec<_>, _>>()?;
        let names = self.run.system.coordinates();
        let rows = answers.iter().map(|a| a.tables[0].len()).min().unwrap_or(0);
        let stop =
            answers.iter().map(|a| a.stop).find(|s| *s != Stop::Finished).unwrap_or(Stop::Finished);
        // States by answer and coordinate.
        let columns: Vec<Vec<&[f64]>> = answers
            .iter()
            .map(|a| names.iter().map(|n| a.tables[0].numbers(n)).collect())
            .collect();
        let mut table =
            Table::new("horizon", ["t", "by_precision", "by_order"].map(Column::numbers));
        let mut horizons = [None::<f64>; 2];
        let mut before = 0.0;
        for row in 0..rows {
            let t = answers[0].tables[0].numbers("t")[row];
            let size = 1.0 + columns[0].iter().map(|c| c[row].abs()).fold(0.0, f64::max);
            let apart = [1, 2].map(|k| {
                columns[0]
                    .iter()
                    .zip(&columns[k])
                    .map(|(a, b)| (a[row] - b[row]).abs())
                    .fold(0.0, f64::max)
                    / size
            });
            for (horizon, apart) in horizons.iter_mut().zip(apart) {
                if horizon.is_none() && apart > self.within {
                    *horizon = Some(before);
                }
            }
            table.push([t, apart[0], apart[1]].map(Entry::Number));
            before = t;
        }
        let [by_precision, by_order] = horizons.map(|h| h.unwrap_or(before));
        let mut answer = Answer::of_tables(vec![table])
            .with_fact("horizon", &by_precision.min(by_order))
            .with_fact("by_precision", &by_precision)
            .with_fact("by_order", &by_order)
            .with_fact("precision", &bits)
            .with_fact("other_precision", &other)
            .with_fact("order", &order)
            .with_fact("other_order", &(order + MORE_DEGREES));
        answer.stop = stop;
        Ok(answer)
    }
}

#[cfg(test)]
mod tests {
    use crate::Executor;
    use std::ops::ControlFlow;

    use super::*;
    use crate::spec::{DEFAULT_MAX_STEPS, SwitchSpec};
    use twofold_integrate::{Schedule, StepCap};
    use twofold_system::Caricature;

    fn run(name: Method, rtol: f64) -> RunSpec {
        RunSpec {
            system: Caricature::with_reinjection(1e-1, 1e-5).into(),
            switch: SwitchSpec::tanh(1e-3),
            start: vec![0.2, 0.0, -1.0],
            t_end: 20.0,
            method: MethodSpec {
                name,
                tolerance: Tolerance { rtol, atol: rtol },
                step_cap: StepCap::None,
                max_steps: DEFAULT_MAX_STEPS,
                precision: None,
                order: None,
            },
            schedule: Schedule::default(),
            observe: Observation::Times { every: 1.0 },
        }
    }

    #[test]
    fn a_coarse_tolerance_shows_as_a_short_horizon() {
        let horizon = |rtol: f64| {
            let answer = Horizon { run: run(Method::TaylorExtended, rtol), within: 1e-9 };
            let answer = answer.compute(&Executor::quiet(), &()).unwrap();
            assert_eq!((answer.stop, answer.rows()), (Stop::Finished, Horizon::SAMPLES + 1));
            let fact = |name: &str| answer.fact::<f64>(name).unwrap();
            assert_eq!(fact("horizon"), fact("by_precision").min(fact("by_order")));
            fact("horizon")
        };
        // Up to the first visit to the singularity, at about t = 13, little is lost; there 1e-15
        // becomes visible.
        let coarse = horizon(1e-15);
        assert!(coarse < 16.0 && coarse > 10.0, "{coarse}");
        assert_eq!(horizon(1e-32), 20.0);
    }

    fn decay(precision: Option<u16>, order: Option<u16>, rtol: f64) -> Horizon {
        let mut run = run(Method::TaylorExtended, rtol);
        (run.system, run.start, run.t_end) = (crate::cases::decays(2), vec![3.0, 1.0], 0.25);
        (run.method.precision, run.method.order) = (precision, order);
        Horizon { run, within: 1e-9 }
    }

    /// The next precision; of the highest the one below.
    #[test]
    fn every_precision_has_another_to_compare_with() {
        for (precision, rtol, bits, other) in
            [(None, 1e-20, 106, 192), (Some(106), 1e-20, 106, 192), (Some(192), 1e-20, 192, 106)]
        {
            let answer = decay(precision, Some(30), rtol).compute(&Executor::quiet(), &()).unwrap();
            let fact = |name: &str| answer.fact::<u16>(name).unwrap();
            assert_eq!(
                [fact("precision"), fact("other_precision"), fact("order")],
                [bits, other, 30]
            );
            assert_eq!(fact("other_order"), 38);
        }
    }

    /// Of the order 4 against the solution, which the other precision has to all its digits, and
    /// against the order 12: in units of 1 + the largest state.
    #[test]
    fn differences_are_in_units_of_one_and_the_state() {
        let mut horizon = decay(None, Some(4), 1e-6);
        // Half of the largest difference: some lie above it.
        let all = horizon.compute(&Executor::quiet(), &()).unwrap().tables.remove(0);
        let largest = |name: &str| all.numbers(name).iter().fold(0.0_f64, |a, b| a.max(*b));
        horizon.within = 0.5 * largest("by_precision").max(largest("by_order"));
        let answer = horizon.compute(&Executor::quiet(), &()).unwrap();
        let [own, other] = [4, 12].map(|order| {
            let run = horizon.variant(106, Some(order), horizon.run.method.tolerance);
            Executor::quiet().ask(&*run).unwrap().tables[0].clone()
        });
        let table = &answer.tables[0];
        let mut first_beyond = None;
        for (row, t) in table.numbers("t").iter().enumerate() {
            let of = |table: &Table| ["a1", "a2"].map(|name| table.numbers(name)[row]);
            let (state, size) = (of(&own), 1.0 + of(&own)[0]);
            let far = |b: [f64; 2]| (state[0] - b[0]).abs().max((state[1] - b[1]).abs()) / size;
            let wanted = [far([3.0 * (-t).exp(), (-2.0 * t).exp()]), far(of(&other))];
            for (column, wanted) in ["by_precision", "by_order"].into_iter().zip(wanted) {
                let found = table.numbers(column)[row];
                assert!((found - wanted).abs() < 1e-15, "{column} {t}: {found:e} {wanted:e}");
            }
            if table.numbers("by_precision")[row].max(table.numbers("by_order")[row])
                > horizon.within
            {
                first_beyond = first_beyond.or(Some(row));
            }
        }
        let last = first_beyond.expect("half of the largest is less") - 1;
        assert_eq!(answer.fact::<f64>("horizon").unwrap(), table.numbers("t")[last]);
    }

    #[test]
    fn an_interrupted_horizon_says_so() {
        struct Impatient;
        impl crate::Progress for Impatient {
            fn begin<'a>(&'a self, _: &str, _: f64) -> Box<dyn crate::JobMonitor + 'a> {
                Box::new(Impatient)
            }
        }
        impl crate::JobMonitor for Impatient {
            fn done(self: Box<Self>, _: &str) {}
        }
        impl Monitor for Impatient {
            fn reached(&self, t: f64) -> ControlFlow<()> {
                if t < 0.1 { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
            }
        }
        // Some ten thousand steps of the order 4; the others have few and are not asked.
        let horizon = decay(None, Some(4), 1e-20);
        let answer = horizon.compute(&Executor::new(None, &Impatient), &()).unwrap();
        assert_eq!(answer.stop, Stop::Interrupted);
        assert!(answer.rows() < Horizon::SAMPLES, "{}", answer.rows());
    }

    #[test]
    fn other_methods_have_none() {
        let error = Horizon { run: run(Method::Lsoda, 1e-9), within: 1e-9 }
            .compute(&Executor::quiet(), &())
            .unwrap_err();
        assert!(error.to_string().contains("taylor-extended"), "{error}");
    }
}
