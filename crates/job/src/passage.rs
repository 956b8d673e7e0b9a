//! Passage of an orbit through a two-fold, as questions.

use nalgebra::{SVector, Vector4};
use serde::Serialize;
use serde_json::Value;

use super::answer::{Answer, Stop};
use super::question::{Ask, JobError, Question};
use super::spec::{SpecError, SwitchSpec};
use super::table::{Column, Entry, Table};
use twofold_analyse::passage::{self, PassageAnswer, PassageQuestion};
use twofold_instances::{self as instances, How, Orbits};
use twofold_integrate::{DriveOptions, Method, Monitor, Schedule, Statistics, StepCap, Tolerance};
use twofold_system::{System, Transition};

/// Passage of the smoothed orbit by the two-fold at the origin. Table `passage`: one row with the
/// visit's time and the places of leaving (`left_`), of the first passage through x = 0
/// (`surface_`), of the exit on y = 0 (`exit_`) and of the far exit (`far_`); blank what did not
/// happen. Table `growth`: a row per moment at which disturbances are made (`offset`, in units of
/// sqrt(eps) after the visit), with the growth in each direction; -infinity stands for t = 0.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct TwoFoldPassage {
    /// The system; three states, the first one its switching function.
    pub system: System,
    /// The transition function.
    pub transition: Transition,
    /// The stiffness parameter.
    pub eps: f64,
    /// The orbit, and the disturbances that are measured.
    pub followed: PassageQuestion,
}

impl Question for TwoFoldPassage {
    fn kind(&self) -> &'static str {
        "two-fold-passage"
    }

    fn json(&self) -> Value {
        serde_json::to_value(self).expect("questions are plain data")
    }

    fn label(&self) -> String {
        format!("passage of the two-fold at eps = {:e}", self.eps)
    }

    fn cost(&self) -> f64 {
        // Sliding in f64, then a fixed number of short orbits in extended precision.
        let sliding = 0.1 / self.eps.max(1e-12);
        (if self.followed.carried == 0.0 { sliding } else { 4.0 * sliding })
            + 2e3 * self.followed.offsets.len() as f64
    }

    fn compute(&self, _: &dyn Ask, _: &dyn Monitor) -> Result<Answer, JobError> {
        let field = instances::smoothed(&self.system, self.transition, self.eps)?;
        let found = field.passage(self.eps, &self.followed)?;
        Ok(Answer {
            statistics: Some(found.statistics.clone()),
            stop: Stop::Finished,
            ..Answer::of_tables(self.tables(&found))
        })
    }
}

/// Columns of a place.
fn place(name: &str) -> [Column; 3] {
    ["x", "y", "z"].map(|c| Column::numbers(&format!("{name}_{c}")))
}

/// A place's cells; blank if there is none.
fn cells(place: Option<[f64; 3]>) -> [Entry; 3] {
    place.unwrap_or([f64::NAN; 3]).map(Entry::from)
}

impl TwoFoldPassage {
    fn tables(&self, found: &PassageAnswer) -> Vec<Table> {
        let places = ["left", "surface", "exit", "far"].into_iter().flat_map(place);
        let mut one = Table::new(
            "passage",
            ["eps", "t_visit"].map(Column::numbers).into_iter().chain(places),
        );
        let mut row: Vec<Entry> = vec![self.eps.into(), found.visit.unwrap_or(f64::NAN).into()];
        row.extend(
            [found.leaving, found.surface, found.exit, found.far].into_iter().flat_map(cells),
        );
        one.push(row);
        let columns = ["eps", "offset", "across", "along_y", "along_z"].map(Column::numbers);
        let mut growth = Table::new("growth", columns);
        let mut row = |offset: f64, factors: [f64; 3]| {
            let mut row: Vec<Entry> = vec![self.eps.into(), offset.into()];
            row.extend(factors.map(Entry::from));
            growth.push(row);
        };
        if let Some(factors) = found.carried {
            row(f64::NEG_INFINITY, factors);
        }
        found.growth.iter().for_each(|g| row(g.offset, g.factors));
        vec![one, growth]
    }
}

/// Points at which orbits leave the switching surface behind the two-fold at the origin, under any
/// switching rule: smoothing or hysteresis, with or without kicks. Table `leaving`: a row per run;
/// blank if the orbit was not there in time.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Leaving {
    /// The system; three states, the first one its switching function.
    pub system: System,
    /// The switching rule; not Filippov's motion, for which leaving is not defined.
    pub switch: SwitchSpec,
    /// The runs: their starts and what happens around them.
    pub runs: Vec<([f64; 3], Schedule)>,
    /// Tolerance of the method, Dormand-Prince 5(4), relative and absolute.
    pub tolerance: f64,
    /// Longest step, in units of eps.
    pub longest_step: f64,
    /// Everything must have happened before this time.
    pub by: f64,
}

impl Leaving {
    fn eps(&self) -> Result<f64, JobError> {
        match self.switch {
            SwitchSpec::Smoothed { eps, .. } | SwitchSpec::Hysteretic { eps, .. } => Ok(eps),
            SwitchSpec::Delayed { .. } | SwitchSpec::Relay { .. } => Err(SpecError {
                field: "switch",
                value: if let SwitchSpec::Relay { .. } = self.switch { "relay" } else { "delayed" }
                    .into(),
                rule: "leaving is measured in units of eps, for smoothed and hysteretic runs",
            }
            .into()),
            SwitchSpec::Filippov { .. } => Err(SpecError {
                field: "switch",
                value: "filippov".into(),
                rule: "where a Filippov motion leaves is its exit rule's choice, not a computation",
            }
            .into()),
        }
    }

    fn each<const N: usize>(
        &self,
        field: &(impl Orbits<N> + ?Sized),
        eps: f64,
        start: impl Fn([f64; 3]) -> SVector<f64, N>,
    ) -> Result<Answer, JobError> {
        let columns = std::iter::once(Column::numbers("eps")).chain(place("left"));
        let mut table = Table::new("leaving", columns);
        let mut work = Statistics::default();
        for (at, schedule) in &self.runs {
            let mut leaving = passage::Leaving::new(eps);
            let options = DriveOptions {
                schedule: *schedule,
                step_cap: StepCap::Absolute(self.longest_step * eps),
                max_steps: 100_000_000,
                ..DriveOptions::to(self.by)
            };
            let tolerance = Tolerance { rtol: self.tolerance, atol: self.tolerance };
            let how =
                How { method: Method::Dopri5, tolerance, precision: None, order: None, options };
            let end = field.orbit(start(*at), &how, &mut leaving, &())?.within_budget()?;
            work += &end.statistics;
            let mut row: Vec<Entry> = vec![eps.into()];
            row.extend(cells(leaving.place()));
            table.push(row);
        }
        Ok(Answer {
            statistics: Some(work),
            stop: Stop::Finished,
            ..Answer::of_tables(vec![table])
        })
    }
}

impl Question for Leaving {
    fn kind(&self) -> &'static str {
        "leaving"
    }

    fn json(&self) -> Value {
        serde_json::to_value(self).expect("questions are plain data")
    }

    fn label(&self) -> String {
        format!("where {} orbits leave the surface", self.runs.len())
    }

    fn cost(&self) -> f64 {
        self.runs.len() as f64 * 10.0 / self.eps().unwrap_or(1.0).max(1e-9)
    }

    fn compute(&self, _: &dyn Ask, _: &dyn Monitor) -> Result<Answer, JobError> {
        let eps = self.eps()?;
        match self.switch {
            SwitchSpec::Smoothed { transition, .. } => {
                self.each(&*instances::smoothed(&self.system, transition, eps)?, eps, SVector::from)
            }
            SwitchSpec::Hysteretic { eps_prime, relaxation, phi0, .. } => {
                let field = instances::hysteretic(&self.system, eps, eps_prime, relaxation)?;
                self.each(&*field, eps, |[x, y, z]| Vector4::new(x, y, z, phi0))
            }
            SwitchSpec::Delayed { .. } | SwitchSpec::Relay { .. } | SwitchSpec::Filippov { .. } => {
                unreachable!("refused above")
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Executor;
    use crate::cases;
    use twofold_integrate::filippov::{ExitRule, Side};
    use twofold_system::{Caricature, Relaxation};

    /// The caricature by its compiled equations, and by a file's that say the same in other words.
    fn caricatures() -> [System; 2] {
        let compiled = System::from(Caricature::with_reinjection(0.1, 1e-5));
        let recorded = cases::of(&compiled.definition().to_toml().replace("\"-y\"", "\"0 - y\""));
        assert!(compiled.compiled().is_some() && recorded.compiled().is_none());
        [compiled, recorded]
    }

    fn leaving(system: System, switch: SwitchSpec, starts: &[[f64; 3]], by: f64) -> Table {
        let runs = starts.iter().map(|start| (*start, Schedule::default())).collect();
        let question = Leaving { system, switch, runs, tolerance: 1e-9, longest_step: 1.0, by };
        question.compute(&Executor::quiet(), &()).unwrap().tables.remove(0)
    }

    /// On a straight line that passes the origin at time 1/2 and has x = 3 eps at 4/5; and one that
    /// passes it at no time.
    #[test]
    fn orbits_leave_at_three_widths() {
        let line = cases::smooth(&["x", "y", "z"], "x", &["0.01", "1", "0"]);
        for switch in [SwitchSpec::tanh(1e-3), SwitchSpec::hysteretic(1e-3, Relaxation::Single)] {
            let starts = [[-0.005, -0.5, 0.0], [-0.005, -0.5, 1.0], [-0.005, -0.5, 1e-3]];
            let table = leaving(line.clone(), switch, &starts, 1.0);
            assert_eq!(table.numbers("eps"), [1e-3; 3]);
            for (row, z) in [(0, 0.0), (2, 1e-3)] {
                for (name, wanted) in [("left_x", 0.003), ("left_y", 0.3), ("left_z", z)] {
                    assert!(
                        (table.numbers(name)[row] - wanted).abs() < 1e-9,
                        "{name}: {}",
                        table.numbers(name)[row]
                    );
                }
            }
            assert!(
                ["left_x", "left_y", "left_z"].iter().all(|name| table.numbers(name)[1].is_nan())
            );
            assert!(
                leaving(line.clone(), switch, &starts[..1], 0.7).numbers("left_x")[0].is_nan(),
                "too late"
            );
        }
        let [a, b] = caricatures()
            .map(|system| leaving(system, SwitchSpec::tanh(1e-2), &[[0.2, 0.0, -1.0]], 40.0));
        for name in ["left_x", "left_y", "left_z"] {
            let (a, b) = (a.numbers(name)[0], b.numbers(name)[0]);
            assert!((a - b).abs() < 1e-6, "{name}: {a} {b}");
        }
    }

    /// Quantities that were found fill their columns, others are blank; disturbances carried from
    /// the start come before all that were made near the visit.
    #[test]
    fn a_passage_is_two_tables() {
        let question = TwoFoldPassage {
            system: Caricature::with_reinjection(0.1, 1e-5).into(),
            transition: Transition::Tanh,
            eps: 1e-3,
            followed: PassageQuestion::far([0.2, 0.0, -1.0], 0.6, 80.0),
        };
        let found = PassageAnswer {
            visit: Some(13.0),
            leaving: Some([1.0, 2.0, 3.0]),
            exit: Some([4.0, 5.0, 6.0]),
            far: Some([7.0, 8.0, 9.0]),
            growth: vec![passage::Disturbed { offset: -2.0, factors: [10.0, 11.0, 12.0] }],
            carried: Some([13.0, 14.0, 15.0]),
            ..PassageAnswer::default()
        };
        let tables = question.tables(&found);
        let names =
            |t: &Table| t.columns.iter().map(|c| c.name.clone()).collect::<Vec<_>>().join(" ");
        assert_eq!(
            names(&tables[0]),
            "eps t_visit left_x left_y left_z surface_x surface_y surface_z exit_x exit_y exit_z \
                far_x far_y far_z"
        );
        let cells = |t: &Table, row: usize| {
            t.rows()[row].iter().map(|c| format!("{:?}", c.value())).collect::<Vec<_>>().join(" ")
        };
        assert_eq!(
            cells(&tables[0], 0),
            "0.001 13.0 1.0 2.0 3.0 NaN NaN NaN 4.0 5.0 6.0 7.0 8.0 9.0"
        );
        assert_eq!(names(&tables[1]), "eps offset across along_y along_z");
        assert_eq!(cells(&tables[1], 0), "0.001 -inf 13.0 14.0 15.0");
        assert_eq!(cells(&tables[1], 1), "0.001 -2.0 10.0 11.0 12.0");
        let nothing = question.tables(&PassageAnswer::default());
        assert!(
            nothing[1].is_empty() && nothing[0].rows()[0][1..].iter().all(|c| c.value().is_nan())
        );
    }

    #[test]
    fn a_filippov_motion_leaves_by_its_rule() {
        let exit = ExitRule::AtOnce { side: Side::Plus };
        let leaving = Leaving {
            system: Caricature::with_reinjection(0.1, 1e-5).into(),
            switch: SwitchSpec::Filippov { exit, funnel: None },
            runs: vec![([0.2, 0.0, -1.0], Schedule::default())],
            tolerance: 1e-9,
            longest_step: 1.0,
            by: 9.0,
        };
        let error = leaving.compute(&Executor::quiet(), &()).unwrap_err();
        assert!(
            error.is_bad_question() && error.to_string().contains("exit rule's choice"),
            "{error}"
        );
    }
}
