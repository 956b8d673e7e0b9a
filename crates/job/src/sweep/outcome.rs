//! The outcome of one row of a sweep.

use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use super::far;
use crate::answer::{Answer, Stop};
use crate::classification::{Classification, SoFar};
use crate::question::{Ask, JobError, Question};
use crate::rest::{self, Rest};
use crate::run::Run;
use crate::simulate::simulate_until;
use crate::spec::SwitchSpec;
use twofold_analyse::attractor::{Evidence, Verdict};
use twofold_analyse::lyapunov::Exponent;
use twofold_integrate::Monitor;

/// Outcome of a run: the attractor that [`Classification`] finds, a rest ([`rest`]), or the far
/// state: the region that no orbit leaves. Fact: `outcome` ([`Outcome`]).
#[derive(Clone, Debug, PartialEq)]
pub struct OutcomeQuestion(pub Classification);

/// The outcome of a run, as the numbers of a row.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Outcome {
    /// In a word: `rest`, `period-1`, `leaving-period-1` (turns around it and moves away),
    /// `quasi-periodic`, `irregular`, `undecided`, `noisy`, `noisy-around-period-1`, `far`,
    /// `escaped`, `too-few`.
    pub word: String,
    /// Period of the closed orbit, 0 where there is none.
    pub period: u64,
    /// From then on the run only turns around that orbit; of a far run, when it entered the region
    /// without return.
    pub captured_at: Option<f64>,
    /// From then on it is there.
    pub settled_at: Option<f64>,
    /// Mean distance from the orbit at the end.
    pub radius: Option<f64>,
    /// Rate of the approach per unit time.
    pub rate: Option<f64>,
    /// Time for one turn.
    pub turn: Option<f64>,
    /// Largest Lyapunov exponent per unit time, where it was needed.
    pub exponent: Option<f64>,
    /// Standard error of `exponent`, from block means.
    pub exponent_error: Option<f64>,
    /// Crossings of the section.
    pub crossings: u64,
    /// Time reached.
    pub end: f64,
    /// Steps made.
    pub steps: u64,
}

/// An outcome with its place, which distinguishes attractors of one kind.
#[derive(Clone, Debug, PartialEq)]
pub struct Ending {
    /// The outcome.
    pub outcome: Outcome,
    /// The points of a closed orbit in the plane of the section, in the order of the motion, or the
    /// state at rest; else nothing.
    pub place: Vec<Vec<f64>>,
}

impl Ending {
    fn of(evidence: &Evidence, answer: &Answer) -> Result<Self, JobError> {
        Ok(Self {
            outcome: Outcome::judged(evidence, answer.fact("t")?, steps(answer)),
            place: place_of(evidence),
        })
    }
}

/// The points of the closed orbit, if it is one.
pub(super) fn place_of(evidence: &Evidence) -> Vec<Vec<f64>> {
    let cycle = evidence.verdict.cycle();
    cycle.map_or(Vec::new(), |c| c.points.iter().take(c.period).map(|p| p.u.to_vec()).collect())
}

/// A verdict as an outcome's word.
pub(super) fn word_of(verdict: &Verdict) -> String {
    match verdict {
        Verdict::Spiralling(c) if c.approach.is_some_and(|r| r.per_time < 0.0) => {
            format!("leaving-period-{}", c.period)
        }
        Verdict::Periodic(c) | Verdict::Spiralling(c) => format!("period-{}", c.period),
        Verdict::QuasiPeriodic(_) => "quasi-periodic".to_owned(),
        Verdict::Chaotic { .. } => "irregular".to_owned(),
        Verdict::Noisy { around: Some(c), .. } => format!("noisy-around-period-{}", c.period),
        other => other.name().to_owned(),
    }
}

/// Words of outcomes, K standing for a period.
const WORDS: [&str; 15] = [
    "rest",
    "period-K",
    "leaving-period-K",
    "quasi-periodic",
    "irregular",
    "undecided",
    "noisy",
    "noisy-around-period-K",
    "far",
    "escaped",
    "too-few",
    "moving",
    "stopped",
    "accumulates",
    "failed",
];

/// Whether a row may have this outcome.
pub fn is_outcome(word: &str) -> bool {
    let digits = word.trim_end_matches(|c: char| c.is_ascii_digit());
    let period = &word[digits.len()..];
    let word = match period.parse::<u64>() {
        Ok(1..) if !period.starts_with('0') => format!("{digits}K"),
        _ => word.to_owned(),
    };
    WORDS.contains(&word.as_str()) && (period.is_empty() != word.ends_with('K'))
}

/// Whether an outcome leaves open what the run ends on.
pub fn is_open(word: &str) -> bool {
    ["undecided", "too-few", "failed"].contains(&word)
}

impl Outcome {
    fn at_rest(rest: &Rest, answer: &Answer) -> Result<Self, JobError> {
        let bare = Self::bare("rest", answer.rows() as u64, answer.fact("t")?, steps(answer));
        Ok(Self { rate: rest.rate(), ..bare })
    }

    pub(super) fn judged(evidence: &Evidence, end: f64, steps: u64) -> Self {
        let cycle = evidence.verdict.cycle();
        let approach = cycle.and_then(|c| c.approach);
        Self {
            word: word_of(&evidence.verdict),
            period: cycle.map_or(0, |c| c.period as u64),
            captured_at: cycle.map(|c| c.captured_at),
            settled_at: cycle.and_then(|c| c.settled_at),
            radius: cycle.map(|c| c.radius),
            rate: approach.map(|r| r.per_time),
            turn: cycle.map(|c| c.duration),
            exponent: evidence.lyapunov.map(|l| l.value),
            exponent_error: evidence.lyapunov.map(|l| l.standard_error),
            crossings: evidence.crossings as u64,
            end,
            steps,
        }
    }

    fn far(answer: &Answer) -> Result<Self, JobError> {
        let end: f64 = answer.fact("t")?;
        Ok(Self {
            captured_at: Some(end),
            ..Self::bare("far", answer.rows() as u64, end, steps(answer))
        })
    }

    /// A word, and nothing of an orbit.
    pub(super) fn bare(word: &str, crossings: u64, end: f64, steps: u64) -> Self {
        Self {
            word: word.into(),
            period: 0,
            captured_at: None,
            settled_at: None,
            radius: None,
            rate: None,
            turn: None,
            exponent: None,
            exponent_error: None,
            crossings,
            end,
            steps,
        }
    }
}

fn steps(answer: &Answer) -> u64 {
    answer.statistics.as_ref().map_or(0, |s| s.steps)
}

impl Question for OutcomeQuestion {
    fn kind(&self) -> &'static str {
        "fate"
    }

    fn json(&self) -> Value {
        json!({ "classification": self.0.json(), "far": far::corner(&self.0.run) })
    }

    fn label(&self) -> String {
        self.0.label()
    }

    fn extent(&self) -> f64 {
        self.0.run.t_end
    }

    fn cost(&self) -> f64 {
        // The run is a part of it, and no question of its own.
        Run(self.0.run.clone()).cost() + self.0.cost()
    }

    fn compute(&self, executor: &dyn Ask, monitor: &dyn Monitor) -> Result<Answer, JobError> {
        let answer = self.run(executor, monitor)?;
        Ok(Answer::of_tables(Vec::new())
            .with_fact("outcome", &self.judged(executor, &answer)?.outcome))
    }
}

impl OutcomeQuestion {
    /// Whether a state is one that no orbit of the run's system comes back from.
    fn is_far(&self) -> Option<impl Fn(&[f64]) -> bool + use<>> {
        far::corner(&self.0.run).map(|c| move |x: &[f64]| x[1] > c && x[2] > c)
    }

    /// The answer to the run's question; of a run that goes far, up to there.
    ///
    /// # Errors
    ///
    /// Whatever the computation met.
    pub(super) fn run(
        &self,
        executor: &dyn Ask,
        monitor: &dyn Monitor,
    ) -> Result<Answer, JobError> {
        let run = &self.0.run;
        match (&self.is_far(), run.switch) {
            // Filippov motion has no layer to be stiff in: it gets to its end.
            (
                Some(is_far),
                SwitchSpec::Smoothed { .. }
                | SwitchSpec::Hysteretic { .. }
                | SwitchSpec::Delayed { .. }
                | SwitchSpec::Relay { .. },
            ) => Ok(simulate_until(run, is_far, monitor)?.to_answer(run)),
            _ => Run(run.clone()).compute(executor, monitor),
        }
    }

    /// The outcome and its place.
    ///
    /// # Errors
    ///
    /// Whatever the computation met.
    pub fn ending(&self, executor: &dyn Ask, monitor: &dyn Monitor) -> Result<Ending, JobError> {
        self.judged(executor, &self.run(executor, monitor)?)
    }

    /// Verdict on the answer to the run's question.
    ///
    /// # Errors
    ///
    /// Whatever the computation met.
    fn judged(&self, executor: &dyn Ask, answer: &Answer) -> Result<Ending, JobError> {
        match self.so_far(executor, answer)? {
            SoFar::Judged(outcome) => Ok(outcome),
            SoFar::Awaits(exponent) => {
                self.with_exponent(answer, exponent.found(&*executor.ask(&*exponent)?))
            }
        }
    }

    /// The same without the orbit's exponent.
    ///
    /// # Errors
    ///
    /// As [`OutcomeQuestion::judged`].
    pub(super) fn so_far(
        &self,
        executor: &dyn Ask,
        answer: &Answer,
    ) -> Result<SoFar<Ending>, JobError> {
        if answer.stop == Stop::Interrupted {
            return Err(JobError::Interrupted);
        }
        let state: Vec<f64> = answer.fact("state")?;
        if self.is_far().is_some_and(|far| far(&state)) {
            return Ok(SoFar::Judged(Ending { outcome: Outcome::far(answer)?, place: Vec::new() }));
        }
        if let Some(rest) = rest::at_end(executor, &self.0.run, answer)? {
            let outcome = Outcome::at_rest(&rest, answer)?;
            return Ok(SoFar::Judged(Ending { outcome, place: vec![rest.state] }));
        }
        Ok(match self.0.so_far(executor, answer)? {
            SoFar::Judged(evidence) => SoFar::Judged(Ending::of(&evidence, answer)?),
            SoFar::Awaits(exponent) => SoFar::Awaits(exponent),
        })
    }

    /// Verdict on the answer with the exponent that was awaited.
    ///
    /// # Errors
    ///
    /// If the answer is none to the run's question.
    pub(super) fn with_exponent(
        &self,
        answer: &Answer,
        exponent: Option<Exponent>,
    ) -> Result<Ending, JobError> {
        Ending::of(&self.0.with_exponent(answer, exponent)?, answer)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_of_outcomes_are_known_with_a_period_where_they_have_one() {
        for word in ["rest", "period-1", "leaving-period-12", "noisy", "noisy-around-period-3"] {
            assert!(is_outcome(word), "{word}");
        }
        for word in ["", "period", "period-", "period-0", "period-01", "period-K", "rest-1", "2"] {
            assert!(!is_outcome(word), "{word}");
        }
        assert!(WORDS.iter().filter(|word| is_open(word)).count() == 3);
    }
    use crate::Executor;
    use crate::cases;
    use crate::spec::Observation;
    use twofold_analyse::attractor::{Cycle, Rate};
    use twofold_integrate::Tolerance;
    use twofold_integrate::delay::{History, Inside};
    use twofold_integrate::filippov::ExitRule;
    use twofold_system::{System, Transition};

    /// Each verdict's word, and where its numbers go.
    #[test]
    fn an_outcome_is_its_verdict_in_a_row() {
        let system = cases::smooth(&["x", "v"], "x + 9", &["v", "-x"]);
        let section = Observation::Section { coordinate: 0, value: 0.0 };
        let run = cases::run(system, SwitchSpec::tanh(1e-2), 20.0, section);
        let evidence = Classification::of(run).ask(&Executor::quiet()).unwrap();
        let cycle = |per_time: Option<f64>| Cycle {
            period: 3,
            points: Vec::new(),
            duration: 4.5,
            radius: 1e-3,
            captured_at: 100.0,
            settled_at: Some(200.0),
            approach: per_time.map(|per_time| Rate {
                per_time,
                standard_error: 1e-4,
                from: 1.0,
                to: 2.0,
            }),
            rotation: None,
        };
        let lyapunov = Some(Exponent { value: 0.25, standard_error: 0.01, duration: 1e4 });
        for (verdict, word) in [
            (Verdict::Periodic(cycle(Some(-0.1))), "period-3"),
            (Verdict::Spiralling(cycle(Some(0.1))), "period-3"),
            (Verdict::Spiralling(cycle(Some(-0.1))), "leaving-period-3"),
            (Verdict::Spiralling(cycle(None)), "period-3"),
            (Verdict::QuasiPeriodic(cycle(None)), "quasi-periodic"),
            (Verdict::Chaotic { lyapunov, bands: 2 }, "irregular"),
            (Verdict::Undecided { lyapunov: None }, "undecided"),
            (Verdict::Noisy { contrast: None, around: Some(cycle(None)) }, "noisy-around-period-3"),
            (Verdict::Noisy { contrast: None, around: None }, "noisy"),
            (Verdict::Escaped { last_crossing: 3.0 }, "escaped"),
            (Verdict::TooFew { points: 3 }, "too-few"),
        ] {
            let cycle = verdict.cycle().cloned();
            let evidence = Evidence { verdict, lyapunov, crossings: 6, ..evidence.clone() };
            let found = Outcome::judged(&evidence, 20.0, 77);
            assert_eq!(
                (found.word.as_str(), found.crossings, found.end, found.steps),
                (word, 6, 20.0, 77)
            );
            let (captured, settled) =
                (cycle.as_ref().map(|_| 100.0), cycle.as_ref().map(|_| 200.0));
            assert_eq!((found.captured_at, found.settled_at), (captured, settled));
            assert_eq!(
                (found.radius, found.turn),
                (cycle.as_ref().map(|_| 1e-3), cycle.as_ref().map(|_| 4.5))
            );
            assert_eq!(found.period, if cycle.is_some() { 3 } else { 0 });
            assert_eq!(found.rate, cycle.and_then(|c| c.approach).map(|a| a.per_time));
            assert_eq!((found.exponent, found.exponent_error), (Some(0.25), Some(0.01)));
        }
    }

    /// A focus and a block that sticks, by every switch: they are rests.
    #[test]
    fn motion_ends_in_rests_by_every_switch() {
        let section = |coordinate| Observation::Section { coordinate, value: 0.0 };
        let outcome = |system: System, start: [f64; 2], switch, t_end, section| {
            let mut run = cases::run(system, switch, t_end, section);
            run.start = start.to_vec();
            run.method.tolerance = Tolerance { rtol: 1e-8, atol: 1e-8 };
            let question = OutcomeQuestion(Classification::of(run));
            question.ending(&Executor::quiet(), &()).unwrap().outcome.word
        };
        let focus = || cases::smooth(&["x", "y"], "x + 100", &["-0.05*x - y", "x - 0.05*y"]);
        let delayed = |eps: Option<f64>| SwitchSpec::Delayed {
            delay: 0.1,
            eps,
            transition: eps.map(|_| Transition::Tanh),
            history: History::Constant,
        };
        let relay = SwitchSpec::Relay { band: 0.1, inside: Inside::Sign };
        for switch in [relay, delayed(None), delayed(Some(0.1)), SwitchSpec::tanh(0.1)] {
            assert_eq!(outcome(focus(), [1.0, 0.0], switch, 2000.0, section(1)), "rest");
        }
        // Inside the band of a relay, which holds either field there.
        let held = || {
            let fields = "plus = ['-x - 1', '-2*y']\nminus = ['-x + 1', '-2*y']";
            cases::of(&format!("states = ['x', 'y']\nh = 'x'\n{fields}"))
        };
        for (x, band, axis) in [(0.3, 1.1, 1), (-0.3, 1.1, 1), (0.3, 5.0, 0), (-4.0, 1.5, 0)] {
            let word = outcome(held(), [x, 1.0], SwitchSpec::relay(band), 100.0, section(axis));
            assert_eq!(word, "rest", "{x} {band}");
        }
        let swings = outcome(held(), [0.3, 1.0], SwitchSpec::relay(0.9), 300.0, section(0));
        assert_eq!(swings, "period-1");
        let friction = || {
            let text =
                "states = ['x', 'v']\nh = 'v'\nplus = ['v', '-x - 1']\nminus = ['v', '1 - x']";
            cases::of(text)
        };
        let filippov = SwitchSpec::Filippov { exit: ExitRule::Undecided, funnel: None };
        for x in [0.2, 4.5, 10.3, -2.7] {
            assert_eq!(outcome(friction(), [x, 0.0], filippov, 600.0, section(1)), "rest", "{x}");
        }
        // A focus on the surface, of one field or of two: it decays far below what it began with.
        let on_surface = |plus: [&str; 2], minus: [&str; 2]| {
            let [plus, minus] = [plus, minus].map(|f| format!("['{}', '{}']", f[0], f[1]));
            cases::of(&format!("states = ['x', 'y']\nh = 'x'\nplus = {plus}\nminus = {minus}"))
        };
        let one = ["-0.1*x - y", "x - 0.1*y"];
        for (plus, minus) in [(one, one), (["-0.2*x - y", "x"], ["-0.05*x - y", "2*x"])] {
            for x in [0.5, 2.0, 3.0] {
                let system = on_surface(plus, minus);
                assert_eq!(outcome(system, [x, 0.0], filippov, 600.0, section(1)), "rest", "{x}");
            }
        }
        // Beside a second surface: off both, on one, and where both meet.
        let two = |h: [&str; 2], [pp, mp, pm, mm]: [&str; 4]| {
            cases::of(&format!(
                "states = ['x', 'y']\nh = '{}'\nplus = [{pp}]\nminus = [{mp}]\n\
                 [second]\nh = '{}'\nplus = [{pm}]\nminus = [{mm}]",
                h[0], h[1]
            ))
        };
        let focus = "'-0.1*(x - 5) - (y - 5)', 'x - 5 - 0.1*(y - 5)'";
        let quadrant = || two(["x", "y"], [focus, "'1', '1'", "'0', '1'", "'1', '1'"]);
        let [right, left] = ["'y', '-x - 0.5'", "'y', '-x + 0.5'"];
        let stick = || two(["y", "x + 50"], [right, left, right, left]);
        let twisting = || two(["x", "y"], ["'y', '-3'", "'y', '1'", "'y', '-1'", "'y', '3'"]);
        let relays = || two(["x", "y"], ["'-1', '-1'", "'1', '-1'", "'-1', '1'", "'1', '1'"]);
        for (system, start, axis) in [
            (quadrant(), [3.0, 2.0], 0),
            (stick(), [2.0, 0.0], 1),
            (stick(), [10.3, 0.0], 1),
            (twisting(), [1.0, 0.0], 0),
            (twisting(), [1.5, -0.5], 1),
            (relays(), [1.0, 2.0], 0),
        ] {
            let named = format!("{system:?} {start:?}");
            assert_eq!(outcome(system, start, filippov, 300.0, section(axis)), "rest", "{named}");
        }
        // A limit cycle is none, wherever the second surface is.
        let hopf = "'x - y - x*(x^2 + y^2)', 'x + y - y*(x^2 + y^2)'";
        for far in ["y + 100", "y - 0.5"] {
            let system = two(["x", far], [hopf; 4]);
            assert_eq!(outcome(system, [0.3, 0.1], filippov, 900.0, section(1)), "period-1");
        }
    }
}
