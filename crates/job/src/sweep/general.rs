//! The outcome of one row of a sweep of a general system.

use std::cell::RefCell;

use serde::{Deserialize, Serialize};
use serde_json::Value;
use twofold_analyse::attractor::{self, Evidence, SectionPoint, Thresholds, Verdict};
use twofold_analyse::lyapunov::Exponent;
use twofold_hybrid::motion::tangent::exponents_watched;
use twofold_hybrid::motion::{Method, Record, follow_to_rest};
use twofold_hybrid::{Ending, Options};
use twofold_integrate::Monitor;
use twofold_num::elementary::{ln, sqrt};
use twofold_system::Expression;

use super::outcome::place_of;
use super::{Coordinate, Outcome};
use crate::answer::Answer;
use crate::general::GeneralRun;
use crate::question::{Ask, JobError, Question};
use crate::table::{Column, Entry};

/// A motion rests that stays where it is for this share of its run longer, within so much of the
/// size of its states, and of the swing of the points that were looked at in the run's later half.
const LONGER: f64 = 0.05;
const STILL: f64 = 1e-6;
const STILL_OF_SWING: f64 = 1e-3;
/// The longest period looked for.
const LONGEST_PERIOD: usize = 64;
/// Points are the same that lie within so much of their swing in the later half of the run, or
/// within so many times the tolerance of the size of their states.
const SAME_OF_SWING: f64 = 1e-5;
const SAME_OF_TOLERANCE: f64 = 100.0;
/// States that have become small are known to this part of the least distance for states as large
/// as they were: to the error of their run.
const OF_FORMER: f64 = 1e-2;
/// Share below which a width shrinks from the third quarter of a run to the last, if it does.
const LESS: f64 = 0.7;
/// A motion without a clock falls to a rest if neighbours have come closer by this power of e in
/// the later half of the run, evenly: a factor of twenty.
const FALLS: f64 = 3.0;
/// Standard errors of an exponent in half of its 95 % interval.
const SIGNIFICANCE: f64 = 2.0;

/// Outcome of a run of a general system. Fact: `ending` ([`GeneralEnding`]).
#[derive(Clone, Debug, PartialEq)]
pub struct GeneralOutcome(pub GeneralRun);

/// End of a run of a general system.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct GeneralEnding {
    /// The outcome: of a run that looks at a section or at multiples of a time what
    /// [`attractor::classify`] says, of others `moving`; `rest`; `stopped` by an event, or where
    /// one `accumulates`.
    pub outcome: Outcome,
    /// The points of a closed orbit in two of the states, or the state at rest; else nothing.
    pub place: Vec<Vec<f64>>,
    /// The state at the end.
    pub state: Vec<f64>,
    /// The mode's name then.
    pub mode: String,
    /// The event that stopped the run, or accumulates; else nothing.
    pub event: String,
    /// Events that happened.
    pub events: u64,
    /// Switches met.
    pub switches: u64,
}

impl Question for GeneralOutcome {
    fn kind(&self) -> &'static str {
        "general-outcome"
    }

    fn json(&self) -> Value {
        GeneralRun::json(&self.0)
    }

    fn label(&self) -> String {
        Question::label(&self.0)
    }

    fn extent(&self) -> f64 {
        self.0.extent()
    }

    fn cost(&self) -> f64 {
        self.0.cost()
    }

    fn compute(&self, _: &dyn Ask, monitor: &dyn Monitor) -> Result<Answer, JobError> {
        Ok(Answer::of_tables(Vec::new()).with_fact("ending", &self.ending(monitor)?))
    }
}

impl GeneralOutcome {
    /// Follows the run, and says where it ends.
    ///
    /// # Errors
    /// Whatever the computation met.
    pub fn ending(&self, monitor: &dyn Monitor) -> Result<GeneralEnding, JobError> {
        let GeneralRun { model, options } = &self.0;
        let strobed = matches!(options.record, Record::Times { .. });
        let free = free(&self.0);
        let looks = is_looked_at(options);
        // The start is recorded, too, wherever it lies.
        let is_multiple = |t: f64| match options.record {
            Record::Times { every } if every.is_finite() && t == options.t_start => {
                let count = t / every;
                (count - count.round()).abs() <= 1e-12 * count.abs().max(1.0)
            }
            _ => true,
        };
        let section = RefCell::new(Vec::<SectionPoint>::new());
        let states = RefCell::new(Vec::<Vec<f64>>::new());
        let mut observe = |point: &twofold_hybrid::Point<'_>| {
            let x: Vec<f64> = free.iter().map(|i| point.x[*i]).collect();
            let u = [0, 1].map(|k| x.get(k).copied().unwrap_or(0.0));
            let (mut section, mut states) = (section.borrow_mut(), states.borrow_mut());
            // Seen every period is the state after the events of that moment.
            if strobed
                && point.event.is_some()
                && let Some(last) = section.last_mut()
                && last.t == point.t
            {
                last.u = u;
                states.pop();
                states.push(x.clone());
            }
            let seen = if strobed { is_multiple(point.t) } else { point.direction.is_some() };
            if point.event.is_none() && seen {
                section.push(SectionPoint {
                    t: point.t,
                    u,
                    upward: strobed || point.direction > Some(0.0),
                });
                states.push(x);
            }
            true
        };
        let longer = LONGER * (options.t_end - options.t_start);
        let shown_from = 0.5 * (options.t_start + options.t_end);
        let least = SAME_OF_TOLERANCE * options.rtol.max(f64::EPSILON);
        let within = |size: f64| {
            let swing = Late::of(&section.borrow(), shown_from).swing;
            let of_swing = if looks { STILL_OF_SWING * swing } else { f64::INFINITY };
            (STILL * size).min(of_swing.max(least * size))
        };
        let (found, rests) = follow_to_rest(
            model,
            options,
            &mut observe,
            &|t| monitor.reached(t).is_continue(),
            longer,
            &within,
        )?;
        let mut section = section.into_inner();
        let crossings = if looks { section.len() as u64 } else { 0 };
        let bare = |word: &str| Outcome::bare(word, crossings, found.t, found.steps);
        let (mut place, mut event) = (Vec::new(), String::new());
        let outcome = match &found.ending {
            Ending::Interrupted => return Err(JobError::Interrupted),
            Ending::Stopped(by) => {
                event.clone_from(by);
                bare("stopped")
            }
            Ending::Zeno { event: by, .. } => {
                event.clone_from(by);
                bare("accumulates")
            }
            Ending::Finished if rests => {
                place.push(found.x.clone());
                bare("rest")
            }
            Ending::Finished if looks => {
                let question = attractor::Question {
                    t_end: (!strobed).then_some(options.t_end),
                    shown_from,
                    ..attractor::Question::default()
                };
                let driven = model.is_driven();
                let of_states = |seen: [usize; 2]| {
                    let sizes = seen.iter().filter_map(|i| found.sizes.get(*free.get(*i)?));
                    sizes.fold(0.0_f64, |most, size| most.max(*size))
                };
                let mut former = of_states([0, 1]);
                let (mut evidence, mut middle) = judged(&section, &question, least, former);
                if !matches!(evidence.verdict, Verdict::Periodic(_))
                    && let Some(other) =
                        told_apart(&section, &states.into_inner(), &question, least, &of_states)
                {
                    (section, former, (evidence, middle)) = other;
                }
                let thin = is_thin(&evidence, &section, shown_from, least * former);
                let asks = match evidence.verdict {
                    Verdict::Chaotic { .. }
                    | Verdict::QuasiPeriodic(_)
                    | Verdict::Undecided { .. } => true,
                    Verdict::Periodic(_) | Verdict::Spiralling(_) => {
                        !driven && narrows(&section, shown_from, least)
                    }
                    // Where few turns are left a motion may have come near to a rest.
                    Verdict::Escaped { .. } | Verdict::TooFew { .. } => !driven,
                    _ => false,
                };
                let growth = if asks || thin { self.growth(monitor)? } else { Vec::new() };
                let has_sign = |of: usize| growth.get(of).is_some_and(Growth::is_clear);
                let left =
                    matches!(evidence.verdict, Verdict::Escaped { .. } | Verdict::TooFew { .. });
                if !driven && has_sign(0) && growth[0].total() < -FALLS {
                    // Along any other motion the field's own direction neither grows nor shrinks.
                    place.push(found.x.clone());
                    bare("rest")
                } else {
                    if asks && !left {
                        let lyapunov = growth.first().and_then(Growth::exponent);
                        let question = attractor::Question { lyapunov, ..question };
                        (evidence, middle) = judged(&section, &question, least, former);
                        let regular = !has_sign(0) && (driven || !has_sign(1));
                        let open = matches!(evidence.verdict, Verdict::Undecided { .. });
                        let by = growth.first().map_or(f64::INFINITY, |g| g.value);
                        let grows = matches!(evidence.verdict, Verdict::Chaotic { .. })
                            && grows_by(&section, shown_from, by);
                        if open || grows || !is_borne_out(&evidence, regular) {
                            let parts = growth.first().is_some_and(|g| g.is_clear() && g.parts());
                            evidence.verdict = if parts && keeps_its_size(&section, shown_from) {
                                Verdict::Chaotic { lyapunov, bands: 1 }
                            } else {
                                Verdict::Undecided { lyapunov }
                            };
                        }
                    } else if thin && growth.first().is_some_and(|g| g.is_clear() && g.value > 0.0)
                    {
                        let lyapunov = growth[0].exponent();
                        evidence.lyapunov = lyapunov;
                        evidence.verdict = if growth[0].parts() {
                            Verdict::Chaotic { lyapunov, bands: 1 }
                        } else {
                            Verdict::Undecided { lyapunov }
                        };
                    }
                    place = place_of(&evidence);
                    place.iter_mut().flatten().enumerate().for_each(|(i, u)| *u += middle[i % 2]);
                    Outcome { crossings, ..Outcome::judged(&evidence, found.t, found.steps) }
                }
            }
            Ending::Finished => bare("moving"),
        };
        Ok(GeneralEnding {
            outcome,
            place,
            mode: model.definition().modes()[found.mode].name.clone(),
            state: found.x,
            event,
            events: found.events,
            switches: found.switches,
        })
    }
}

impl GeneralOutcome {
    /// The two largest exponents of the later half of the run; none where tangent vectors end.
    fn growth(&self, monitor: &dyn Monitor) -> Result<Vec<Growth>, JobError> {
        let GeneralRun { model, options } = &self.0;
        let half = 0.5 * (options.t_end - options.t_start);
        let options = Options { method: Method::Dopri5, ..options.clone() };
        let goes_on = |_| monitor.reached(options.t_end).is_continue();
        let found = exponents_watched(model, &options, half, 2, &goes_on);
        if !goes_on(options.t_end) {
            return Err(JobError::Interrupted);
        }
        Ok(found.map_or_else(
            |_| Vec::new(),
            |found| {
                let pairs = found.values.iter().zip(&found.errors);
                pairs
                    .map(|(value, error)| Growth { value: *value, error: *error, duration: half })
                    .collect()
            },
        ))
    }
}

/// An exponent of a row, with half of its 95 % interval.
struct Growth {
    value: f64,
    error: f64,
    duration: f64,
}

impl Growth {
    /// Whether zero is twice as far away as an end of the interval: in one regular row of twenty
    /// it is not in the interval.
    fn is_clear(&self) -> bool {
        self.value.abs() > 2.0 * self.error
    }

    /// The logarithm of the factor by which vectors grew.
    fn total(&self) -> f64 {
        self.value * self.duration
    }

    /// Whether neighbours that rounding alone keeps apart would be as far apart as the motion goes.
    fn parts(&self) -> bool {
        const FROM_ROUNDING: f64 = 36.0;
        self.total() > FROM_ROUNDING
    }

    fn exponent(&self) -> Option<Exponent> {
        let Self { value, error, duration } = *self;
        let standard_error = error / SIGNIFICANCE;
        value.is_finite().then_some(Exponent { value, standard_error, duration })
    }
}

/// Whether the evidence is enough for its verdict: of chaos, that neighbours part and that the
/// motion does not reach further and further out; of a torus, that the exponents are those of
/// `regular` motion and that none of its fits shows an approach.
fn is_borne_out(evidence: &Evidence, regular: bool) -> bool {
    /// An approach of so many standard errors is one, though points of a torus are correlated.
    const SURE: f64 = 10.0;
    let th = &evidence.thresholds;
    match &evidence.verdict {
        Verdict::Chaotic { lyapunov, .. } => {
            lyapunov.is_some_and(|l| l.value > th.exponent_significance * l.standard_error)
        }
        Verdict::QuasiPeriodic(cycle) => {
            let approaches = cycle.approach.is_some_and(|r| {
                r.per_time.abs() > SURE * r.standard_error
                    && r.per_time.abs() * (r.to - r.from) > th.visible_change
            });
            regular && !approaches
        }
        Verdict::Periodic(_) | Verdict::Spiralling(_) => false,
        _ => true,
    }
}

/// Whether the dots of a closed orbit have widths from `from` on that are no rounding and do not
/// shrink: they may be bands of weak chaos. Below `least` widths are rounding.
fn is_thin(evidence: &Evidence, section: &[SectionPoint], from: f64, least: f64) -> bool {
    let Verdict::Periodic(cycle) = &evidence.verdict else { return false };
    let late = section.iter().filter(|p| p.t >= from && p.upward);
    let late: Vec<[f64; 2]> = late.map(|p| p.u).collect();
    let apart =
        |(a, b): (&[f64; 2], &[f64; 2])| [0, 1].iter().any(|k| (a[*k] - b[*k]).abs() > least);
    late.iter().zip(late.iter().skip(cycle.period)).any(apart) && !shrinks(section, cycle.period)
}

/// Whether the later half of a run's points from `from` on reaches not twice as far as the earlier
/// one: what grows without end by such an exponent reaches far more.
fn keeps_its_size(section: &[SectionPoint], from: f64) -> bool {
    const FURTHER: f64 = 2.0;
    let late: Vec<SectionPoint> = section.iter().filter(|p| p.t >= from).copied().collect();
    let (earlier, last) = late.split_at(late.len() / 2);
    Late::of(last, from).swing <= FURTHER * Late::of(earlier, from).swing
}

/// Whether the later half of a run's points from `from` on reaches farther than the earlier one as
/// motion does that grows by this exponent: chaos, too, may reach farther now and then.
fn grows_by(section: &[SectionPoint], from: f64, exponent: f64) -> bool {
    /// Part of the exponent.
    const PART: f64 = 0.5;
    let late: Vec<SectionPoint> = section.iter().filter(|p| p.t >= from).copied().collect();
    let (earlier, last) = late.split_at(late.len() / 2);
    let (Some(a), Some(b)) = (earlier.last(), last.last()) else { return false };
    let farther = Late::of(last, from).swing / Late::of(earlier, from).swing;
    ln(farther) > PART * exponent * (b.t - a.t)
}

/// Whether the two sides of the turns come together, as they do on the way to a rest: points at
/// which the section is met upward, and the next ones downward. Widths below `least` of the states'
/// size are rounding.
fn narrows(section: &[SectionPoint], from: f64, least: f64) -> bool {
    let widths: Vec<f64> = section
        .windows(2)
        .filter(|p| p[0].t >= from && p[0].upward && !p[1].upward)
        .map(|p| sqrt([0, 1].map(|k| p[1].u[k] - p[0].u[k]).map(|d| d * d).iter().sum()))
        .collect();
    let mean = |part: &[f64]| part.iter().sum::<f64>() / part.len() as f64;
    let (earlier, last) = widths.split_at(widths.len() / 2);
    mean(earlier) > least * Late::of(section, from).size && mean(last) < LESS * mean(earlier)
}

/// The points of the later half of a run.
struct Late {
    /// The middle of the box around them.
    middle: [f64; 2],
    /// Its diagonal.
    swing: f64,
    /// The largest of their components.
    size: f64,
}

impl Late {
    fn of(section: &[SectionPoint], from: f64) -> Self {
        let (mut low, mut high, mut size) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2], 0.0_f64);
        for p in section.iter().filter(|p| p.t >= from) {
            for k in 0..2 {
                (low[k], high[k]) = (low[k].min(p.u[k]), high[k].max(p.u[k]));
                size = size.max(p.u[k].abs());
            }
        }
        if low[0] > high[0] {
            return Self { middle: [0.0; 2], swing: 0.0, size: 0.0 };
        }
        let [a, b] = [high[0] - low[0], high[1] - low[1]];
        let middle = [0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1])];
        Self { middle, swing: sqrt(a * a + b * b), size }
    }
}

/// The verdict on a section wherever the origin of its states lies: seen from the middle of its
/// later half, where points are the same that the run does not tell apart; `former` is the largest
/// size of their states. Points on a line are no closed curve. Also that middle.
fn judged(
    section: &[SectionPoint],
    question: &attractor::Question<'_>,
    least: f64,
    former: f64,
) -> (Evidence, [f64; 2]) {
    let Late { mut middle, swing, size } = Late::of(section, question.shown_from);
    let from = |middle: [f64; 2]| -> (Vec<SectionPoint>, f64) {
        let u = |p: &SectionPoint| [p.u[0] - middle[0], p.u[1] - middle[1]];
        let seen: Vec<SectionPoint> =
            section.iter().map(|p| SectionPoint { u: u(p), ..*p }).collect();
        let extent = seen.iter().flat_map(|p| p.u).fold(0.0_f64, |most, u| most.max(u.abs()));
        (seen, extent)
    };
    let same = (SAME_OF_SWING * swing).max(least * size).max(OF_FORMER * least * former);
    let (mut seen, mut extent) = from(middle);
    if extent <= same {
        // One point from the first on: it has the size of its states for an extent, also at zero.
        middle = if size > same { [0.0; 2] } else { [-former; 2] };
        (seen, extent) = from(middle);
    }
    let by = |same: f64| {
        let dot = same / extent;
        let thresholds = Thresholds {
            dot,
            longest_period: LONGEST_PERIOD,
            exponent_significance: SIGNIFICANCE,
            ..Thresholds::default()
        };
        attractor::classify(&seen, question, &thresholds)
    };
    let mut evidence = by(same);
    // An orbit that is still approached shrinks; bands of chaos as thin do not.
    if !matches!(evidence.verdict, Verdict::Periodic(_)) {
        let wider = by(same.max(Thresholds::default().dot * swing));
        if let Verdict::Periodic(cycle) = &wider.verdict
            && shrinks(&seen, cycle.period)
        {
            evidence = wider;
        }
    }
    let nothing_turns = match &evidence.verdict {
        Verdict::QuasiPeriodic(cycle) => cycle.rotation.is_none(),
        Verdict::TooFew { points } => {
            *points >= Thresholds::default().fewest_points && reaches_out(&seen, 1.1)
        }
        Verdict::Chaotic { .. } => reaches_out(&seen, 2.0),
        _ => false,
    };
    if nothing_turns {
        evidence.verdict = Verdict::Undecided { lyapunov: None };
    }
    (evidence, middle)
}

/// A section as seen in two of its states, their largest size, and the verdict.
type Seen = (Vec<SectionPoint>, f64, (Evidence, [f64; 2]));

/// The section in the first two states in which an orbit's points lie apart, if they return in all
/// states: in the first two of all they may fall together.
fn told_apart(
    section: &[SectionPoint],
    states: &[Vec<f64>],
    question: &attractor::Question<'_>,
    least: f64,
    sizes: &dyn Fn([usize; 2]) -> f64,
) -> Option<Seen> {
    let up: Vec<&Vec<f64>> =
        section.iter().zip(states).filter(|(p, _)| p.upward).map(|(_, x)| x).collect();
    let late = up.get(up.len() / 2..)?;
    let count = late.first()?.len();
    let near: Vec<f64> = (0..count)
        .map(|i| {
            let all = || late.iter().map(|x| x[i]);
            let (low, high) =
                (all().fold(f64::INFINITY, f64::min), all().fold(-f64::INFINITY, f64::max));
            (SAME_OF_SWING * (high - low)).max(least * low.abs().max(high.abs()))
        })
        .collect();
    let returns = |period: usize| {
        late.iter()
            .zip(&late[period..])
            .all(|(a, b)| (0..count).all(|i| (a[i] - b[i]).abs() <= near[i]))
    };
    let period = (1..=LONGEST_PERIOD.min(late.len() / 5)).find(|period| returns(*period))?;
    let pairs = (1..count).flat_map(|b| (0..b).map(move |a| [a, b])).skip(1);
    pairs
        .map(|pair| {
            let points = section.iter().zip(states);
            let seen: Vec<SectionPoint> =
                points.map(|(p, x)| SectionPoint { u: pair.map(|i| x[i]), ..*p }).collect();
            let found = judged(&seen, question, least, sizes(pair));
            (seen, sizes(pair), found)
        })
        .find(|(_, _, (evidence, _))| {
            matches!(&evidence.verdict, Verdict::Periodic(cycle) if cycle.period == period)
        })
}

/// Whether the points of the last quarter reach further out than all before, by this factor.
fn reaches_out(section: &[SectionPoint], factor: f64) -> bool {
    let far = |points: &[SectionPoint]| {
        points.iter().flat_map(|p| p.u).fold(0.0_f64, |most, u| most.max(u.abs()))
    };
    let (before, last) = section.split_at(section.len() / 4 * 3);
    far(last) > factor * far(before)
}

/// Whether the points of one direction come closer to those a period before.
fn shrinks(section: &[SectionPoint], period: usize) -> bool {
    let up: Vec<[f64; 2]> = section.iter().filter(|p| p.upward).map(|p| p.u).collect();
    let moved: Vec<f64> = (period..up.len())
        .map(|i| {
            let [a, b] = [0, 1].map(|k| up[i][k] - up[i - period][k]);
            sqrt(a * a + b * b)
        })
        .collect();
    let (earlier, last) = moved[moved.len() / 2..].split_at(moved.len() / 4);
    let mean = |part: &[f64]| part.iter().sum::<f64>() / part.len() as f64;
    mean(last) < LESS * mean(earlier)
}

impl GeneralEnding {
    /// Cells of a row beside the outcome, in the order of [`columns`].
    pub(super) fn cells(&self) -> Vec<Entry> {
        let whole = |v: u64| Entry::Integer(i64::try_from(v).unwrap_or(i64::MAX));
        let state = self.state.iter().map(|v| Entry::Number(*v));
        let words = [&self.mode, &self.event].map(|word| Entry::Word(word.clone()));
        state.chain(words).chain([whole(self.events), whole(self.switches)]).collect()
    }
}

/// Empty columns of what a row says beside the outcome.
pub(super) fn columns(run: &GeneralRun) -> Vec<Column> {
    let states =
        run.model.coordinates().into_iter().map(|name| Column::numbers(&format!("end.{name}")));
    let more = [
        Column::words("mode"),
        Column::words("event"),
        Column::integers("events"),
        Column::integers("switches"),
    ];
    states.chain(more).collect()
}

/// The cells of a row without an ending.
pub(super) fn blank(run: &GeneralRun) -> Vec<Entry> {
    let number = Entry::Number(f64::NAN);
    let words = [
        Entry::Word(String::new()),
        Entry::Word(String::new()),
        Entry::Integer(0),
        Entry::Integer(0),
    ];
    std::iter::repeat_n(number, run.model.coordinates().len()).chain(words).collect()
}

/// Whether a run records crossings of a section, or multiples of a time.
fn is_looked_at(options: &Options) -> bool {
    match options.record {
        Record::Section(_) => true,
        Record::Times { every } => every.is_finite(),
        Record::Path { .. } => false,
    }
}

/// Start of a run.
pub(crate) fn start_of(run: &GeneralRun) -> Result<Vec<f64>, String> {
    let given =
        run.options.start.clone().map_or_else(|| run.model.start(), |start| Ok(Some(start)));
    given
        .map_err(|e| e.to_string())?
        .ok_or_else(|| "the file has no start; give --start".to_owned())
}

impl Coordinate {
    /// Gives a run of a general system this value; an error says why it would have no effect.
    pub(super) fn apply_to_general(
        &self,
        run: &mut GeneralRun,
        value: &Entry,
    ) -> Result<(), String> {
        let number = value.value();
        match self {
            Coordinate::Parameter(name) => {
                run.model = run.model.clone().with(name, number).map_err(|e| e.to_string())?
            }
            Coordinate::Start(name) | Coordinate::Shift(name) => {
                let states = run.model.coordinates();
                let i = states.iter().position(|s| s == name).ok_or_else(|| {
                    format!("the system has no state {name}; it has {}", states.join(", "))
                })?;
                let mut x = start_of(run)?;
                x[i] = if matches!(self, Coordinate::Start(_)) { number } else { x[i] + number };
                run.options.start = Some(x);
            }
            Coordinate::Rtol => run.options.rtol = number,
            Coordinate::Atol => run.options.atol = Some(number),
            Coordinate::Tolerance => (run.options.rtol, run.options.atol) = (number, Some(number)),
            Coordinate::MaxStep => run.options.max_step = number,
            Coordinate::TEnd => run.options.t_end = number,
            Coordinate::Method => {
                run.options.method = Method::named(value.word()).ok_or_else(|| {
                    format!(
                        "general systems are followed by dopri5, lsoda, radau5 or taylor, not {}",
                        value.word()
                    )
                })?;
            }
            other => {
                return Err(format!(
                    "{other} belongs to systems with h, plus and minus in up to four states; of a \
                        general system vary params.NAME, start.NAME, shift.NAME, rtol, atol, \
                        tolerance, max-step, t-end or method"
                ));
            }
        }
        Ok(())
    }
}

/// The states in which crossings are compared, the first two before others: those that the section
/// does not fix, or the only one.
fn free(run: &GeneralRun) -> Vec<usize> {
    let names = run.model.coordinates();
    let fixed = match &run.options.record {
        Record::Section(Expression::Sub(a, b)) => names.iter().position(|n| {
            [(a, b), (b, a)].iter().any(|(one, other)| {
                one.to_string() == *n && matches!(***other, Expression::Number(_))
            })
        }),
        _ => None,
    };
    (0..names.len()).filter(|i| Some(*i) != fixed || names.len() == 1).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use twofold_hybrid::{Definition, Model};

    /// The outcome of a run by a section `NAME = 0`, or every unit of time.
    fn word(text: &str, section: Option<&str>, t_end: f64) -> String {
        outcome(text, section, t_end).word
    }

    fn outcome(text: &str, section: Option<&str>, t_end: f64) -> Outcome {
        let model = Model::new(Definition::from_toml(text, "f").unwrap());
        let record = match section {
            Some(name) => {
                Record::Section(Expression::parse_general(&format!("{name} - 0"), &[name]).unwrap())
            }
            None => Record::Times { every: 1.0 },
        };
        let options = Options { record, t_end, ..Options::default() };
        GeneralOutcome(GeneralRun { model, options }).ending(&()).unwrap().outcome
    }

    /// A decay to a driven cycle, from a start between two multiples of the period to an end there:
    /// the multiples 1 to 60 are looked at, and a stop after the last of them is met.
    #[test]
    fn a_run_is_looked_at_by_multiples_and_goes_on_to_its_end() {
        let ending = |more: &str| {
            let text = format!("states = ['x']\nstart = [1]\nf = ['-x + cos(2*pi*t)']{more}");
            let model = Model::new(Definition::from_toml(&text, "f").unwrap());
            let record = Record::Times { every: 1.0 };
            let options = Options { t_start: 0.5, t_end: 60.9, record, ..Options::default() };
            GeneralOutcome(GeneralRun { model, options }).ending(&()).unwrap()
        };
        let found = ending("");
        assert_eq!((&*found.outcome.word, found.outcome.crossings), ("period-1", 60));
        let phase = 2.0 * std::f64::consts::PI * 60.9;
        let w = 2.0 * std::f64::consts::PI;
        let exact = (phase.cos() + w * phase.sin()) / (1.0 + w * w);
        assert!((found.state[0] - exact).abs() < 1e-8, "{} {exact}", found.state[0]);
        let found = ending("\n[[event]]\nat = 60.8\nstop = true");
        assert_eq!((&*found.outcome.word, found.outcome.end), ("stopped", 60.8));
    }

    fn map(states: &str, start: &str, sets: &[&str]) -> String {
        let names: Vec<&str> = states.split_whitespace().collect();
        let set = names.iter().zip(sets).map(|(name, set)| format!("{name} = '{set}'"));
        format!(
            "states = {names:?}\nstart = {start}\nf = {:?}\n[[event]]\nevery = 1\nset = {{ {} }}",
            vec!["0"; names.len()],
            set.collect::<Vec<_>>().join(", ")
        )
    }

    /// Linear contractions, isometries and expansions, and maps of the circle, in runs so short
    /// that the tests by points alone see chaos.
    #[test]
    fn regular_motion_is_not_irregular() {
        let turn = |m: f64| {
            let (c, s) = (1.1_f64.cos() * m, 1.1_f64.sin() * m);
            map("x y", "[1, 0]", &[&format!("{c}*x - {s}*y"), &format!("{s}*x + {c}*y")])
        };
        for m in [0.95, 0.97, 0.99, 0.995, 0.999, 1.0, 1.001, 1.01, 1.05] {
            for t_end in [100.0, 150.0, 200.0] {
                let found = word(&turn(m), None, t_end);
                let wrong = found == "irregular" || m != 1.0 && found == "quasi-periodic";
                assert!(!wrong, "{m} {t_end}: {found}");
            }
        }
        let rigid = map("th", "[0.3]", &["mod(th + 0.381966, 1)"]);
        let delayed = |a: f64| map("x y", "[0.4, 0.41]", &[&format!("{a}*x*(1 - y)"), "x"]);
        for t_end in [100.0, 150.0] {
            assert_eq!(word(&rigid, None, t_end), "undecided");
            for a in [1.9, 1.98, 2.02, 2.1] {
                let found = word(&delayed(a), None, t_end);
                assert_ne!(found, "irregular", "{a} {t_end}");
                assert!(a > 2.0 || found != "quasi-periodic", "{a} {t_end}");
            }
        }
        let relaxes = "states = ['x']\nstart = [0]\nf = ['-x + cos(1.0882796185405307*t)']";
        let driven = "states = ['x', 'v']\nstart = [2, 0]\n\
            f = ['4.83321946706122*v', '4.83321946706122*(-x - 0.02*v + cos(2*pi*t))']";
        for t_end in [100.0, 124.0, 166.0, 250.0] {
            for text in [relaxes, driven] {
                let found = word(text, None, t_end);
                assert!(["undecided", "period-1"].contains(&&*found), "{t_end}: {found}");
            }
        }
    }

    /// Two oscillators of frequencies 2 and 1/2, from a start on the section: two of the four
    /// points of their orbit have one x and one u.
    #[test]
    fn points_that_fall_together_in_two_states_are_told_apart_in_others() {
        let text = "states = ['x', 'y', 'u', 'v']\nstart = [1, 0, 1, 0]\n\
            f = ['x*g - 2*y', 'y*g + 2*x', 'u*k - v/2', 'v*k + u/2']\n[let]\n\
            g = '1 - x^2 - y^2'\nk = '1 - u^2 - v^2'";
        assert_eq!(word(text, Some("y"), 1000.0), "period-4");
    }

    /// A control at zero is at one point every period, however rounding moves it.
    #[test]
    fn a_control_at_rest_is_of_one_period() {
        let text = "states = ['x', 'v']\nstart = [1, 0]\n\
            f = ['v', '0.3*sin(2*pi*t) - 2*sign(v + 2*x)']";
        assert_eq!(word(text, None, 400.0), "period-1");
    }

    /// A focus is approached, and is no closed orbit on the way.
    #[test]
    fn a_focus_that_is_approached_is_a_rest() {
        let focus = |m: f64| {
            format!(
                "states = ['x', 'y']\nstart = [1, 0]\n\
                 f = ['-{m}*x - 2*y - x*(x^2 + y^2)', '2*x - {m}*y - y*(x^2 + y^2)']"
            )
        };
        for (m, t_end) in [(0.02, 400.0), (0.02, 600.0), (0.03, 400.0), (0.05, 400.0)] {
            assert_eq!(word(&focus(m), Some("y"), t_end), "rest", "{m} {t_end}");
        }
        let bistable = |x: f64| {
            format!(
                "states = ['x', 'y']\nstart = [{x}, 0]\nf = ['g*x - 2*y', '2*x + g*y']\n[let]\n\
                 r2 = 'x^2 + y^2'\ng = '0.01*(r2 - 1)*(4 - r2)/(1 + r2)^2'"
            )
        };
        for x in [0.95, 0.98] {
            assert_eq!(word(&bistable(x), Some("y"), 500.0), "rest", "{x}");
        }
        assert_eq!(word(&bistable(1.3), Some("y"), 3000.0), "period-1");
    }

    /// A linear focus, however near it is come to: it crosses a plane beside it in a part of the
    /// run.
    #[test]
    fn a_focus_that_is_reached_is_a_rest() {
        for a in [0.02, 0.03, 0.04, 0.06] {
            let text = format!(
                "states = ['x', 'y']\nstart = [-0.7, 0.187]\n\
                 f = ['-{a}*x + y + 0.013', '-x - {a}*y - {a}*0.013']"
            );
            for section in ["x", "y"] {
                assert_eq!(word(&text, Some(section), 400.0), "rest", "{a} {section}");
            }
        }
    }

    /// Linear growth in the plane is no chaos.
    #[test]
    fn unbounded_growth_is_not_irregular() {
        for a in [0.2, 0.3, 0.4] {
            let text = format!(
                "states = ['x', 'y']\nstart = [0.3, 0.187]\n\
                    f = ['{a}*x + y + 0.013', '-x + {a}*y + {a}*0.013']"
            );
            assert_eq!(word(&text, Some("y"), 400.0), "undecided", "{a}");
        }
    }

    /// A relay with hysteresis, of period 2 ln((1 + w)/(1 - w)) from the first turn on, seen where
    /// its one state is zero but for rounding.
    #[test]
    fn a_point_at_zero_has_the_size_of_its_states() {
        for w in [0.1_f64, 0.3, 0.5, 0.7, 0.9] {
            let text = format!(
                "states = ['x']\nstart = [0]\n[modes.up]\nf = ['1 - x']\n[modes.down]\n\
                 f = ['-x - 1']\n[[event]]\nfrom = 'up'\nwhen = 'x > {w}'\nmode = 'down'\n\
                 [[event]]\nfrom = 'down'\nwhen = 'x < -{w}'\nmode = 'up'"
            );
            let found = outcome(&text, Some("x"), 200.0);
            assert_eq!(found.word, "period-1", "{w}");
            let period = 2.0 * ((1.0 + w) / (1.0 - w)).ln();
            assert!((found.turn.unwrap() - period).abs() < 1e-9, "{w}");
            assert!(found.captured_at.unwrap() < 1.01 * period, "{w}");
        }
    }

    /// A tent map with a slope above one has no attracting orbit, however thin its bands are.
    #[test]
    fn thin_bands_of_weak_chaos_are_no_orbit() {
        for r in [1.0114489739419963_f64, 1.016477449795421] {
            let tent = map("x", "[0.3]", &[&format!("if(x < 0.5, {r}*x, {r}*(1 - x))")]);
            let found = outcome(&tent, None, 2000.0);
            assert_eq!(found.word, "undecided", "{r}");
            let off = (found.exponent.unwrap() - r.ln()).abs();
            assert!(off <= 3.0 * found.exponent_error.unwrap(), "{r}");
        }
    }

    #[test]
    fn chaos_and_tori_keep_their_words() {
        let henon = map("x y", "[0.1, 0.1]", &["1 - 1.4*x^2 + y", "0.3*x"]);
        let logistic = map("x", "[0.3]", &["3.9*x*(1 - x)"]);
        for text in [henon, logistic] {
            for t_end in [300.0, 1000.0] {
                assert_eq!(word(&text, None, t_end), "irregular", "{text} {t_end}");
            }
        }
        let lorenz = "states = ['x', 'y', 'z']\nstart = [1, 1, -7]\n\
            f = ['10*(y - x)', 'x*(1 - z) - y', 'x*y - 8/3*(z + 27)']";
        assert_eq!(word(lorenz, Some("z"), 200.0), "irregular");
        let torus = "states = ['x', 'y', 'u', 'v']\nstart = [1, 0, 1, 0]\n\
            f = ['x*g - y + 0.2*u', 'y*g + x', 'u*k - 1.618*v', 'v*k + 1.618*u']\n[let]\n\
            g = '1 - x^2 - y^2'\nk = '1 - u^2 - v^2'";
        let standard = map("p q", "[0, 2]", &["p + 0.1*sin(q)", "q + p + 0.1*sin(q)"]);
        let delayed = map("x y", "[0.4, 0.41]", &["2.1*x*(1 - y)", "x"]);
        for text in [standard, delayed] {
            assert_eq!(word(&text, None, 2000.0), "quasi-periodic", "{text}");
        }
        assert_eq!(word(torus, Some("y"), 2000.0), "quasi-periodic");
    }
}
