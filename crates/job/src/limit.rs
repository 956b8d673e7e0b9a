//! The limit of smoothed orbits as eps -> 0, before and after the first visit to a two-fold.

use std::sync::Arc;

use serde::Serialize;
use serde_json::Value;

use super::answer::{Answer, Stop};
use super::passage::TwoFoldPassage;
use super::question::{AnyQuestion, Ask, JobError, Question};
use super::recording::side_word;
use super::table::{Column, Entry, Table};
use twofold_analyse::limit::{AfterVisitQuestion, ConvergenceQuestion};
use twofold_analyse::passage::PassageQuestion;
use twofold_instances_switched as switched;
use twofold_integrate::Monitor;
use twofold_integrate::filippov::Mode;
use twofold_system::{System, Transition};

/// Distance of smoothed orbits from the Filippov orbit before its first visit to a two-fold. Table
/// `before`: a row per eps and time.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SmoothingLimit {
    /// The system.
    pub system: System,
    /// Orbits and times to compare.
    pub compared: ConvergenceQuestion,
}

impl Question for SmoothingLimit {
    fn kind(&self) -> &'static str {
        "smoothing-limit"
    }

    fn json(&self) -> Value {
        serde_json::to_value(self).expect("questions are plain data")
    }

    fn label(&self) -> String {
        "smoothed orbits before the visit".into()
    }

    fn cost(&self) -> f64 {
        5e4
    }

    fn compute(&self, _: &dyn Ask, _: &dyn Monitor) -> Result<Answer, JobError> {
        let found = switched::sliding(&self.system)?.convergence(&self.compared)?;
        let columns = [
            Column::numbers("eps"),
            Column::numbers("t"),
            Column::words("mode"),
            Column::numbers("distance"),
        ];
        let mut table = Table::new("before", columns);
        for row in &found.rows {
            let mode = if row.mode == Mode::SlidingAttracting { "sliding" } else { "free" };
            table.push([row.eps.into(), row.t.into(), mode.into(), row.distance.into()]);
        }
        Ok(Answer {
            statistics: Some(found.statistics),
            stop: Stop::Finished,
            ..Answer::of_tables(vec![table])
        })
    }
}

/// Crossings of smoothed orbits after the first visit to a two-fold, and the nearest member of the
/// funnel of Filippov futures. Tables: `funnel`, a row per future that makes the crossing; `after`,
/// a row per eps. Facts: `t_visit`, `width` (the funnel's, at the crossing).
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct AfterVisit {
    /// The system.
    pub system: System,
    /// Orbits and futures to compare.
    pub compared: AfterVisitQuestion,
}

/// An eps, and where its smoothed orbit crosses.
type Smoothed = (f64, Option<Vec<f64>>);

impl AfterVisit {
    /// The smoothed orbits, each a question of its own.
    fn passages(&self) -> Result<Vec<TwoFoldPassage>, JobError> {
        let AfterVisitQuestion { start, eps, beyond, t_end, .. } = &self.compared;
        let [x, y, z] = start[..] else {
            return Err(JobError::Other(format!(
                "the start has {} components, not three",
                start.len()
            )));
        };
        let followed = PassageQuestion::far([x, y, z], *beyond, *t_end);
        let passage = |&eps: &f64| {
            let (system, transition) = (self.system.clone(), Transition::Tanh);
            TwoFoldPassage { system, transition, eps, followed: followed.clone() }
        };
        Ok(eps.iter().map(passage).collect())
    }

    /// Crossing of each smoothed orbit, by eps; none if it was not reached.
    fn smoothed(&self, executor: &dyn Ask) -> Result<Vec<Smoothed>, JobError> {
        let passages = self.passages()?;
        let mut found = Vec::with_capacity(passages.len());
        for passage in passages {
            let eps = passage.eps;
            let answer = executor.ask(&passage)?;
            let far = |c: &str| answer.table("passage").and_then(|t| t.numbers(c).first().copied());
            let place: Option<Vec<f64>> =
                ["far_x", "far_y", "far_z"].into_iter().map(far).collect();
            found.push((eps, place.filter(|p| p.iter().all(|c| c.is_finite()))));
        }
        Ok(found)
    }
}

impl Question for AfterVisit {
    fn kind(&self) -> &'static str {
        "after-visit"
    }

    fn json(&self) -> Value {
        serde_json::to_value(self).expect("questions are plain data")
    }

    fn label(&self) -> String {
        "smoothed orbits after the visit".into()
    }

    fn cost(&self) -> f64 {
        1e5
    }

    fn rests_on(&self) -> Vec<AnyQuestion> {
        self.passages()
            .unwrap_or_default()
            .into_iter()
            .map(|passage| Arc::new(passage) as _)
            .collect()
    }

    fn compute(&self, executor: &dyn Ask, _: &dyn Monitor) -> Result<Answer, JobError> {
        let crossings = self.smoothed(executor)?;
        let mut crossing =
            |eps: f64| Ok(crossings.iter().find(|c| c.0 == eps).and_then(|c| c.1.clone()));
        let found = switched::sliding(&self.system)?.after_visit(&self.compared, &mut crossing)?;
        let kinds = |name: &str| {
            if name.ends_with("side") { Column::words(name) } else { Column::numbers(name) }
        };
        let names = self.system.coordinates();
        let (b, c) = (names[1], names[2]);
        let mut members = Table::new("funnel", ["exit_time", "side", b, c].map(kinds));
        for m in &found.members {
            members.push([
                m.exit_time.into(),
                side_word(m.side).into(),
                m.crossing[1].into(),
                m.crossing[2].into(),
            ]);
        }
        let columns =
            ["eps", b, c, "nearest_exit_time", "nearest_side", "distance", "width", "t_visit"];
        let mut after = Table::new("after", columns.map(kinds));
        for r in &found.rows {
            let mut row: Vec<Entry> =
                [r.eps, r.crossing[1], r.crossing[2], r.nearest.exit_time].map(Entry::from).into();
            row.push(side_word(r.nearest.side).into());
            row.extend([r.distance, found.width, found.t_visit].map(Entry::from));
            after.push(row);
        }
        let answer = Answer::of_tables(vec![members, after]);
        Ok(Answer { statistics: Some(found.statistics.clone()), stop: Stop::Finished, ..answer }
            .with_fact("t_visit", &found.t_visit)
            .with_fact("width", &found.width))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Executor;
    use crate::question::key;
    use crate::{Store, cases};
    use twofold_integrate::filippov::{FilippovOptions, FunnelGrid};
    use twofold_system::Caricature;

    fn caricature() -> System {
        Caricature::with_reinjection(0.1, 1e-5).into()
    }

    /// Free at t = 2, sliding at t = 9, before the visit at t = 13.196: distances of first order in
    /// eps. A file's equations say the same.
    #[test]
    fn distances_before_the_visit_halve_with_eps() {
        let (eps, times) = (vec![4e-3, 2e-3], vec![2.0, 9.0]);
        let compared = ConvergenceQuestion {
            start: vec![0.2, 0.0, -1.0],
            times,
            eps,
            settings: FilippovOptions::default(),
        };
        let recorded =
            cases::of(&caricature().definition().to_toml().replace("\"-y\"", "\"0 - y\""));
        let tables = [caricature(), recorded].map(|system| {
            let question = SmoothingLimit { system, compared: compared.clone() };
            question.compute(&Executor::quiet(), &()).unwrap().tables.remove(0)
        });
        let table = &tables[0];
        assert_eq!(
            (table.numbers("eps"), table.numbers("t")),
            (&[4e-3, 4e-3, 2e-3, 2e-3][..], &[2.0, 9.0, 2.0, 9.0][..])
        );
        assert_eq!(table.words("mode").collect::<Vec<_>>(), ["free", "sliding", "free", "sliding"]);
        let distance = table.numbers("distance");
        for k in 0..2 {
            assert!((distance[k] / distance[k + 2] - 2.0).abs() < 0.2, "{distance:?}");
        }
        assert!(
            distance
                .iter()
                .zip(tables[1].numbers("distance"))
                .all(|(a, b)| (a - b).abs() < 1e-6 * a)
        );
    }

    /// Crossings that are known already, one of which never came so far.
    #[test]
    fn where_smoothed_orbits_cross_is_their_passages_far_place() {
        let grid = FunnelGrid {
            shortest: 0.1,
            longest: 1.0,
            times: 3,
            horizon: 5.0,
            until_two_fold: true,
            per_step: 1,
        };
        let mut question = AfterVisit {
            system: caricature(),
            compared: AfterVisitQuestion {
                start: vec![0.2, 0.0, -1.0],
                t_end: 80.0,
                eps: vec![1e-2, 3e-3],
                beyond: 0.6,
                grid,
                refinements: 1,
                finer: 3,
                settings: FilippovOptions::default(),
            },
        };
        let folder = tempfile::tempdir().unwrap();
        let store = Store::new(folder.path());
        let passages = question.passages().unwrap();
        for (passage, x) in passages.iter().zip([1.0, f64::NAN]) {
            assert_eq!((passage.followed.far, passage.followed.by), (0.6, 80.0));
            let mut table = Table::new("passage", ["far_x", "far_y", "far_z"].map(Column::numbers));
            table.push([x.into(), 2.0.into(), 3.0.into()]);
            store.put(&key(passage), passage, &Answer::of_tables(vec![table])).unwrap();
        }
        let executor = Executor::new(Some(store), &());
        let crossings = vec![(1e-2, Some(vec![1.0, 2.0, 3.0])), (3e-3, None)];
        assert_eq!(question.smoothed(&executor).unwrap(), crossings);
        // So the table after the visit has the one place, and no row of the other.
        let after = question.compute(&executor, &()).unwrap().tables.remove(1);
        assert_eq!(
            [after.numbers("eps"), after.numbers("y"), after.numbers("z")],
            [[1e-2], [2.0], [3.0]]
        );
        let keys: Vec<_> = question.rests_on().iter().map(|q| key(&**q)).collect();
        assert_eq!(keys, passages.iter().map(|p| key(p)).collect::<Vec<_>>());
        question.compared.start.pop();
        assert!(question.rests_on().is_empty());
        assert!(
            question
                .compute(&executor, &())
                .unwrap_err()
                .to_string()
                .contains("2 components, not three")
        );
    }
}
