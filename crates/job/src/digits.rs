//! Number of correct digits of an orbit, by method.

use serde::Serialize;
use serde_json::Value;

use super::answer::{Answer, Stop};
use super::question::{Ask, JobError, Question};
use super::table::{Column, Entry, Table};
use twofold_analyse::digits::DigitsQuestion;
use twofold_instances as instances;
use twofold_integrate::Monitor;
use twofold_system::{System, Transition};

/// Number of correct digits at each crossing of a plane, for several methods, compared with an
/// orbit in double-double arithmetic; tanh smoothing. Tables: `agreement`, a row per method and
/// passage, and `visits`, the reference orbit's passages near the origin.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct MethodDigits {
    /// The system.
    pub system: System,
    /// The stiffness parameter of the smoothing.
    pub eps: f64,
    /// Orbit, plane and methods that are compared.
    pub compared: DigitsQuestion,
}

impl Question for MethodDigits {
    fn kind(&self) -> &'static str {
        "method-digits"
    }

    fn json(&self) -> Value {
        serde_json::to_value(self).expect("questions are plain data")
    }

    fn label(&self) -> String {
        format!("digits of {} methods", self.compared.methods.len())
    }

    fn cost(&self) -> f64 {
        500.0 * self.compared.t_end * (1e-3 / self.eps).max(1.0)
    }

    fn compute(&self, _: &dyn Ask, _: &dyn Monitor) -> Result<Answer, JobError> {
        let found = instances::smoothed(&self.system, Transition::Tanh, self.eps)?
            .digits(&self.compared)?;
        let columns =
            [Column::words("method"), Column::numbers("tolerance"), Column::integers("crossing")];
        let mut rows = Table::new(
            "agreement",
            columns.into_iter().chain(["t", "error", "digits"].map(Column::numbers)),
        );
        for row in &found.rows {
            let a = &row.agreement;
            rows.push([
                row.contender.name.name().into(),
                row.contender.tolerance.into(),
                Entry::Integer(a.crossing as i64),
                a.t.into(),
                a.error.into(),
                (-a.log10_error).into(),
            ]);
        }
        let mut visits = Table::new("visits", ["t", "distance"].map(Column::numbers));
        visits.extend(found.visits.iter().map(|v| vec![v.t.into(), v.distance.into()]));
        let answer = Answer::of_tables(vec![rows, visits]);
        Ok(Answer { statistics: Some(found.statistics), stop: Stop::Finished, ..answer })
    }
}

#[cfg(test)]
mod tests {
    use crate::Executor;
    use std::f64::consts::PI;

    use super::*;
    use crate::cases;
    use crate::spec::Method;
    use twofold_analyse::digits::Contender;
    use twofold_analyse::reference::SectionPlane;
    use twofold_integrate::StepCap;

    /// y and z turn about the origin once in 2 pi: y = 0 is passed at pi/2 and 3 pi/2. The tighter
    /// the tolerance, the more digits.
    #[test]
    fn digits_are_what_is_right_behind_the_point() {
        let methods = [1e-4, 1e-10].map(|tolerance| Contender { name: Method::Dopri5, tolerance });
        let question = MethodDigits {
            system: cases::smooth(&["x", "y", "z"], "x + 9", &["-x", "-z", "y"]),
            eps: 1e-2,
            compared: DigitsQuestion {
                start: [0.0, 1.0, 0.0],
                section: SectionPlane { coordinate: 1, value: 0.0 },
                t_end: 6.0,
                near: 0.5,
                methods: methods.into(),
                step_cap: StepCap::None,
                max_steps: 10_000,
            },
        };
        let answer = question.compute(&Executor::quiet(), &()).unwrap();
        let rows = answer.table("agreement").unwrap();
        assert_eq!(rows.integers("crossing"), [1, 2, 1, 2]);
        assert!(
            rows.words("method").all(|word| word == "dopri5")
                && answer.table("visits").unwrap().is_empty()
        );
        for (row, [least, most]) in
            [[1.0, 6.0], [1.0, 6.0], [8.0, 13.0], [8.0, 13.0]].into_iter().enumerate()
        {
            let [t, error, digits] = ["t", "error", "digits"].map(|name| rows.numbers(name)[row]);
            assert!((t - PI * ((row % 2) as f64 + 0.5)).abs() < 1e-12, "{t}");
            assert!(
                (least..most).contains(&digits) && (digits + error.log10()).abs() < 1e-12,
                "{error} {digits}"
            );
        }
    }
}
