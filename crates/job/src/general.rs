//! Questions about general systems: runs, closed orbits, exponents, rests.

use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use twofold_analyse::path::MOST_POINTS;
use twofold_hybrid::equation::EquationError;
use twofold_hybrid::motion::sensitivity::sensitivities;
use twofold_hybrid::motion::tangent::exponents;
use twofold_hybrid::motion::{Exit, Method, Record};
use twofold_hybrid::rests::find;
use twofold_hybrid::selection::Intersection;
use twofold_hybrid::{
    Definition, Ending, Equation, HybridError, Model, Options, Point, follow_watched,
};
use twofold_integrate::{Extents, Monitor};
use twofold_system::{Expression, System};

use super::answer::{Answer, Stop};
use super::question::{Ask, JobError, Question};
use super::table::{Column, Entry, Table};

/// A run of a general system.
///
/// ```
/// use twofold_hybrid::{Definition, Model, Options};
/// use twofold_job::{Executor, general::GeneralRun};
/// let text = "
///     states = ['x', 'v']
///     start = [1, 0]
///     f = ['v', '-9.81']
///     [[event]]
///     name = 'impact'
///     when = 'x'
///     direction = 'down'
///     set = { v = '-0.8*v' }
/// ";
/// let model = Model::new(Definition::from_toml(text, "ball.toml")?);
/// let options = Options { t_end: 2.0, ..Options::default() };
/// let answer = Executor::quiet().ask(&GeneralRun { model, options })?;
/// assert!(answer.tables[0].words("event").any(|event| event == "impact"));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct GeneralRun {
    /// The system.
    pub model: Model,
    /// Options of the run.
    pub options: Options,
}

/// A system with one switching surface (h, f+, f-) as a general one.
///
/// # Errors
/// If it has two surfaces.
pub fn model_of(system: &System) -> Result<Model, JobError> {
    if system.definition().second().is_some() {
        let why = "exponents of Filippov motion are computed for one switching function h; write \
            two with sign(...) in f = [...]";
        return Err(HybridError::Bad(why.into()).into());
    }
    let text = serde_json::to_string(&system.canonical()).unwrap_or_default();
    let name = if system.name().is_empty() { "the system" } else { system.name() };
    let definition =
        Definition::from_json(&text, name).map_err(|e| HybridError::Bad(e.to_string()))?;
    Ok(Model::new(definition))
}

/// Reads an expression of a system's states, parameters, terms and tables.
///
/// # Errors
/// Why it is none.
pub fn expression(text: &str, model: &Model) -> Result<Expression, String> {
    let definition = model.definition();
    let terms = definition.document().terms.0.iter().map(|(n, _)| n.as_str());
    let tables = definition.tables().iter().map(|(n, _)| n.as_str());
    let parameters = definition.parameters().iter().map(|p| p.name.as_str());
    let names: Vec<&str> =
        model.coordinates().into_iter().chain(parameters).chain(terms).chain(tables).collect();
    Expression::parse_general(text, &names).map_err(|e| {
        format!("{}{}", e.message, e.help.map_or(String::new(), |h| format!(" ({h})")))
    })
}

/// The last time of a run that lies a whole number of periods after its start, and whether that is
/// its end but for rounding; nothing if the run is shorter than one.
pub fn last_of_phase(options: &Options, period: f64) -> Option<(f64, bool)> {
    const ROUNDING: f64 = 1e-12;
    let length = options.t_end - options.t_start;
    let periods = (length / period * (1.0 + ROUNDING)).floor();
    let last = options.t_start + periods * period;
    let near = ROUNDING * length.max(options.t_end.abs());
    (periods >= 1.0).then(|| (last, (options.t_end - last).abs() <= near))
}

/// The state at which a run begins.
pub(crate) fn start_of(model: &Model, options: &Options) -> Result<Vec<f64>, HybridError> {
    let own = model.start().map_err(EquationError::from)?;
    Ok(options.start.clone().or(own).unwrap_or_default())
}

/// Refuses a period after which the equations are not the same, at times after `from`.
pub(crate) fn has_period(
    model: &Model,
    options: &Options,
    period: f64,
    from: f64,
) -> Result<(), HybridError> {
    let equation = Equation::new(model, None)?;
    let start = start_of(model, options)?;
    let largest = start.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
    let size = |x: &f64| if largest == 0.0 { 1.0 } else { x.abs().max(0.1 * largest) };
    let sizes: Vec<f64> = start.iter().map(size).collect();
    match equation.not_the_same_after(period, from, &sizes) {
        Some(what) => Err(HybridError::Bad(format!(
            "--period: {what} is not the same {period} later: give the period of what depends on \
                the time, with all its digits, or a multiple of it"
        ))),
        None => Ok(()),
    }
}

/// Rows are handed on in parts of so many.
const PART: usize = 4096;

impl GeneralRun {
    /// Everything that the run depends on, as JSON.
    pub fn json(&self) -> Value {
        let o = &self.options;
        json!({
            "system": self.model.json(),
            "t_start": o.t_start,
            "t_end": o.t_end,
            "start": o.start.clone().or_else(|| self.model.start().ok().flatten()),
            "method": { "name": o.method.name(), "rtol": o.rtol, "atol": o.atol,
                "max_step": o.max_step.is_finite().then_some(o.max_step),
                    "max_steps": o.max_steps },
            "observe": match &o.record {
                Record::Path { chord } => json!({ "path": { "chord": chord } }),
                Record::Times { every } => json!({ "times": { "every": every } }),
                Record::Section(e) => json!({ "section": e.to_string() }),
            },
            "intersection": match &o.intersection {
                Intersection::Undecided => json!("undecided"),
                Intersection::Bilinear => json!("bilinear"),
                Intersection::HullLeastNorm => json!("hull-least-norm"),
                Intersection::Order(named) => {
                    let order: Vec<String> = named.iter().map(ToString::to_string).collect();
                    json!({ "order": order })
                }
            },
            "exit": match o.exit {
                Exit::Undecided => "undecided",
                Exit::Plus => "at-once:plus",
                Exit::Minus => "at-once:minus",
            },
        })
    }

    /// The run that [`GeneralRun::json`] has written.
    ///
    /// # Errors
    /// If it is none.
    pub fn from_json(mut json: Value) -> Result<Self, String> {
        let model = Model::from_json(json["system"].take())?;
        let wrong = |what: &str| format!("{what} of a general run is none");
        let number = |value: &Value, what: &str| value.as_f64().ok_or_else(|| wrong(what));
        let read = |value: &Value| expression(value.as_str().unwrap_or_default(), &model);
        let (method, observe) = (&json["method"], &json["observe"]);
        // A value that is not finite is null in JSON.
        let length = |value: &Value| value.as_f64().unwrap_or(f64::INFINITY);
        let options = Options {
            t_start: number(&json["t_start"], "the start")?,
            t_end: number(&json["t_end"], "the end")?,
            start: serde_json::from_value(json["start"].clone()).map_err(|e| e.to_string())?,
            mode: 0,
            rtol: number(&method["rtol"], "rtol")?,
            atol: method["atol"].as_f64(),
            max_step: length(&method["max_step"]),
            max_steps: method["max_steps"].as_u64().ok_or_else(|| wrong("max_steps"))?,
            record: match observe.get("section") {
                Some(section) => Record::Section(read(section)?),
                None => match observe["path"].get("chord") {
                    Some(chord) => Record::Path { chord: number(chord, "the chord")? },
                    None => Record::Times { every: length(&observe["times"]["every"]) },
                },
            },
            exit: match json["exit"].as_str() {
                Some("at-once:plus") => Exit::Plus,
                Some("at-once:minus") => Exit::Minus,
                _ => Exit::Undecided,
            },
            method: method["name"]
                .as_str()
                .and_then(Method::named)
                .ok_or_else(|| wrong("the method"))?,
            intersection: match (
                json["intersection"].as_str(),
                json["intersection"]["order"].as_array(),
            ) {
                (Some("bilinear"), _) => Intersection::Bilinear,
                (Some("hull-least-norm"), _) => Intersection::HullLeastNorm,
                (_, Some(named)) => {
                    Intersection::Order(named.iter().map(read).collect::<Result<_, _>>()?)
                }
                _ => Intersection::Undecided,
            },
            extents: Extents::default(),
        };
        Ok(Self { model, options })
    }

    /// Description of this run in its files.
    pub fn about(&self) -> Value {
        json!({ "kind": "general-run", "question": self.json() })
    }

    /// An empty table for the points: time, states, and as far as the system has them the mode, the
    /// signs of its switching functions and the event.
    pub fn table(&self) -> Table {
        let definition = self.model.definition();
        let name =
            if matches!(self.options.record, Record::Section(_)) { "section" } else { "path" };
        let unit = |unit: &str| if unit.is_empty() { "1".to_owned() } else { unit.to_owned() };
        let mut columns = vec![Column::numbers("t")];
        columns.extend(definition.states().iter().map(|s| {
            let mut column = Column::numbers(&s.name);
            column.unit = unit(&s.about.unit);
            column
        }));
        let has = self.columns();
        columns.extend(has.iter().map(|name| Column::words(name)));
        Table::new(name, columns)
    }

    /// The names of the columns of words.
    fn columns(&self) -> Vec<&'static str> {
        let definition = self.model.definition();
        let mut names = Vec::new();
        if definition.modes().len() > 1 {
            names.push("mode");
        }
        if self.model.has_switches() {
            names.push("signs");
        }
        if matches!(self.options.record, Record::Section(_)) {
            names.push("direction");
        } else if !definition.events().is_empty() {
            names.push("event");
        }
        names
    }

    fn row(&self, columns: &[&str], point: &Point) -> Vec<Entry> {
        let mut row: Vec<Entry> =
            std::iter::once(point.t).chain(point.x.iter().copied()).map(Entry::Number).collect();
        row.extend(columns.iter().map(|column| match *column {
            "mode" => Entry::Word(self.model.definition().modes()[point.mode].name.clone()),
            "signs" => Entry::Word(point.signs.to_owned()),
            "direction" => {
                Entry::Word(if point.direction > Some(0.0) { "up" } else { "down" }.to_owned())
            }
            _ => Entry::Word(point.event.unwrap_or_default().to_owned()),
        }));
        row
    }

    /// Follows the system and hands its rows on in parts, which may come before an error; `more`
    /// says whether more is wanted. The answer holds facts, and no rows. If a state turns out to be
    /// small among the first rows, they are computed again, finer, before any is handed on.
    ///
    /// # Errors
    /// As [`twofold_hybrid::follow`].
    pub fn stream(
        &self,
        rows: &mut dyn FnMut(&Table) -> bool,
        reached: &dyn Fn(f64) -> bool,
    ) -> Result<Answer, HybridError> {
        let columns = self.columns();
        let empty = self.table();
        let extents = |table: &Table| match self.options.record {
            Record::Path { .. } => {
                let names = self.model.coordinates();
                Extents::of(names.iter().map(|name| table.numbers(name).iter().copied()))
            }
            Record::Times { .. } | Record::Section(_) => Extents::default(),
        };
        let mut options = self.options.clone();
        let found = loop {
            let mut table = empty.clone();
            // They are looked for once.
            let mut small = options.extents.has_small().then(Extents::default);
            let mut observe = |point: &Point| {
                table.push(self.row(&columns, point));
                let mut more = reached(point.t);
                if table.len() >= PART {
                    if small.get_or_insert_with(|| extents(&table)).has_small() {
                        return false;
                    }
                    more &= rows(&table);
                    table = empty.clone();
                }
                more
            };
            let found = follow_watched(&self.model, &options, &mut observe, reached);
            let small = small.unwrap_or_else(|| extents(&table));
            let stopped = found.as_ref().is_ok_and(|end| end.ending == Ending::Interrupted);
            if !small.has_small() || stopped && table.len() < PART {
                rows(&table);
                break found;
            }
            options.extents = small;
        };
        let outcome = found?;
        let mut answer = Answer::of_tables(vec![empty])
            .with_fact("t", &outcome.t)
            .with_fact("x", &outcome.x)
            .with_fact("steps", &outcome.steps)
            .with_fact("switches", &outcome.switches)
            .with_fact("events", &outcome.events);
        if columns.contains(&"signs") {
            let section = match &self.options.record {
                Record::Section(e) => Some(e),
                _ => None,
            };
            answer = answer
                .with_fact("signs", &Equation::new(&self.model, section)?.switching_functions());
        }
        match &outcome.ending {
            Ending::Finished => {}
            Ending::Stopped(event) => answer = answer.with_fact("stopped_by", event),
            Ending::Zeno { event, t, error } => {
                answer =
                    answer.with_fact("zeno", &json!({ "event": event, "t": t, "error": error }));
            }
            Ending::Interrupted => {}
        }
        answer.stop = match outcome.ending {
            Ending::Finished => Stop::Finished,
            Ending::Stopped(_) | Ending::Zeno { .. } => Stop::Found,
            Ending::Interrupted => Stop::Interrupted,
        };
        Ok(answer)
    }
}

impl Question for GeneralRun {
    fn kind(&self) -> &'static str {
        "general-run"
    }

    fn json(&self) -> Value {
        GeneralRun::json(self)
    }

    fn label(&self) -> String {
        let title = self.model.definition().title();
        if title.is_empty() { "run".to_owned() } else { title.to_owned() }
    }

    fn extent(&self) -> f64 {
        self.options.t_end
    }

    fn cost(&self) -> f64 {
        self.options.t_end - self.options.t_start
    }

    fn compute(&self, _: &dyn Ask, monitor: &dyn Monitor) -> Result<Answer, JobError> {
        let mut whole = self.table();
        let mut full = None;
        let mut keep = |part: &Table| {
            whole.extend(part.rows());
            if whole.len() > MOST_POINTS {
                full = whole.numbers("t").last().copied();
            }
            full.is_none()
        };
        let mut answer = self.stream(&mut keep, &|t| monitor.reached(t).is_continue())?;
        if let Some(t) = full {
            return Err(JobError::TooManyPoints { t, limit: MOST_POINTS });
        }
        answer.tables = vec![whole];
        Ok(answer)
    }
}

/// Lyapunov exponents of a general system, by saltation matrices through its switches and resets.
#[derive(Clone, Debug)]
pub struct GeneralExponents {
    /// System, start, times and method.
    pub run: GeneralRun,
    /// Time that is not averaged over.
    pub transient: f64,
    /// Number of exponents, the largest first.
    pub count: usize,
}

/// An exponent with its 95 % interval.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct MeanRate {
    /// Per unit time; none if sliding takes the direction away.
    pub value: Option<f64>,
    /// Half the width of the interval.
    pub half_width: f64,
}

impl Question for GeneralExponents {
    fn kind(&self) -> &'static str {
        "general-exponents"
    }

    fn label(&self) -> String {
        "Lyapunov exponents".into()
    }

    fn json(&self) -> Value {
        let mut json = self.run.json();
        json["transient"] = self.transient.into();
        json["count"] = self.count.into();
        json
    }

    fn cost(&self) -> f64 {
        self.run.cost() * self.count as f64
    }

    /// Facts: `from` and `to` (the times of the mean) and `exponents`, a list of [`MeanRate`]s.
    fn compute(&self, _: &dyn Ask, _: &dyn Monitor) -> Result<Answer, JobError> {
        let found = exponents(&self.run.model, &self.run.options, self.transient, self.count)?;
        let list: Vec<MeanRate> = found
            .values
            .iter()
            .zip(&found.errors)
            .map(|(value, error)| MeanRate {
                value: value.is_finite().then_some(*value),
                half_width: *error,
            })
            .collect();
        Ok(Answer::of_tables(Vec::new())
            .with_fact("from", &found.times.0)
            .with_fact("to", &found.times.1)
            .with_fact("exponents", &list))
    }
}

/// Derivatives of the state at the end of a run by the start and by parameters.
#[derive(Clone, Debug)]
pub struct GeneralSensitivities {
    /// System, start, times and method.
    pub run: GeneralRun,
    /// The parameters.
    pub by: Vec<String>,
}

impl Question for GeneralSensitivities {
    fn kind(&self) -> &'static str {
        "general-sensitivities"
    }

    fn label(&self) -> String {
        "sensitivities".into()
    }

    fn json(&self) -> Value {
        let mut json = self.run.json();
        json["by"] = json!(self.by);
        json
    }

    fn cost(&self) -> f64 {
        self.run.cost() * (self.run.model.coordinates().len() + self.by.len()) as f64
    }

    /// The table `sensitivities` has a row a state: its name, its `value` at the end and its
    /// derivatives by each component of the start (`start.x`) and by each parameter (`params.p`).
    /// Fact: `t`, when the run ended.
    fn compute(&self, _: &dyn Ask, _: &dyn Monitor) -> Result<Answer, JobError> {
        let by: Vec<&str> = self.by.iter().map(String::as_str).collect();
        let found = sensitivities(&self.run.model, &self.run.options, &by)?;
        let states = self.run.model.coordinates();
        let names = states
            .iter()
            .map(|s| format!("start.{s}"))
            .chain(by.iter().map(|p| format!("params.{p}")));
        let mut columns = vec![Column::words("state"), Column::numbers("value")];
        columns.extend(names.map(|name| Column::numbers(&name)));
        let mut table = Table::new("sensitivities", columns);
        for (i, state) in states.iter().enumerate() {
            let row = [found.x[i]]
                .into_iter()
                .chain(found.by_start[i].iter().chain(&found.by_parameter[i]).copied());
            table.push(
                std::iter::once(Entry::Word((*state).to_owned())).chain(row.map(Entry::Number)),
            );
        }
        Ok(Answer::of_tables(vec![table]).with_fact("t", &found.t))
    }
}

/// Equilibria and pseudo-equilibria of a general system in a box.
///
/// ```
/// use twofold_hybrid::{Definition, Model};
/// use twofold_job::{Executor, general::{GeneralRests, Resting}};
/// let text = "states = ['x']\nf = ['x - x^3']";
/// let model = Model::new(Definition::from_toml(text, "well.toml")?);
/// let within = vec![(-2.0, 2.0)];
/// let answer = Executor::quiet().ask(&GeneralRests { model, within })?;
/// let rests: Vec<Resting> = answer.fact("rests")?;
/// assert_eq!(rests.len(), 3); // -1, 0 and 1
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct GeneralRests {
    /// The system.
    pub model: Model,
    /// Bounds of each state.
    pub within: Vec<(f64, f64)>,
}

/// A rest as a fact.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Resting {
    /// The state.
    pub state: Vec<f64>,
    /// The mode's name.
    pub mode: String,
    /// In a field or on surfaces.
    pub place: RestPlace,
    /// The set that it belongs to, if it is not isolated.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub family: Option<Family>,
    /// Real and imaginary parts.
    pub eigenvalues: Vec<[f64; 2]>,
    /// Its stability by the eigenvalues: "attracts", "saddle" ...
    pub kind: String,
    /// An event that changes motion before it comes to the rest.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub behind: Option<String>,
}

/// Rests that are not isolated.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Family {
    /// The dimension of the set.
    pub dimension: usize,
    /// Both ends of a curve that has some.
    pub ends: Option<[Vec<f64>; 2]>,
    /// Whether stability is another in different parts of a curve.
    pub changes: bool,
}

/// Place at which a motion rests.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum RestPlace {
    /// On a switching surface: its function, the share of f+, and whether sliding attracts.
    Surface {
        /// The switching function.
        surface: String,
        /// Share of the field with the function above zero.
        weight: f64,
        /// Whether motion comes to the surface there; nothing where the fields are tangent to it.
        attracting: Option<bool>,
    },
    /// On several at once.
    Intersection {
        /// The switching functions.
        surfaces: Vec<String>,
        /// Of each, the share of the fields with the function above zero.
        weights: Vec<f64>,
        /// Whether motion comes to all of them, or leaves one; nothing if that depends on how fast
        /// each of them switches.
        attracting: Option<bool>,
    },
    /// In a field, away from surfaces.
    Field,
}

impl Question for GeneralRests {
    fn kind(&self) -> &'static str {
        "general-rests"
    }

    fn label(&self) -> String {
        "rests".into()
    }

    fn json(&self) -> Value {
        json!({ "system": self.model.json(), "within": self.within })
    }

    /// Facts: `states` (their names), `rests`, a list of [`Resting`]s, and, if the search met
    /// limits, `limits`, sentences about what was not looked at.
    fn compute(&self, _: &dyn Ask, _: &dyn Monitor) -> Result<Answer, JobError> {
        let found = find(&self.model, &self.within)?;
        let modes = self.model.definition().modes();
        let list: Vec<Resting> = found
            .rests
            .iter()
            .map(|rest| Resting {
                state: rest.x.clone(),
                mode: modes[rest.mode].name.clone(),
                place: match &rest.on[..] {
                    [] => RestPlace::Field,
                    [on] => RestPlace::Surface {
                        surface: on.surface.clone(),
                        weight: on.weight,
                        attracting: rest.attracting,
                    },
                    several => RestPlace::Intersection {
                        surfaces: several.iter().map(|on| on.surface.clone()).collect(),
                        weights: several.iter().map(|on| on.weight).collect(),
                        attracting: rest.attracting,
                    },
                },
                family: rest.family.as_ref().map(|f| Family {
                    dimension: f.dimension,
                    ends: f.ends.clone(),
                    changes: f.changes,
                }),
                eigenvalues: rest.eigenvalues.clone(),
                kind: rest.kind(),
                behind: rest.behind.clone(),
            })
            .collect();
        let answer = Answer::of_tables(Vec::new())
            .with_fact("states", &self.model.coordinates())
            .with_fact("rests", &list);
        if found.limits.is_empty() {
            return Ok(answer);
        }
        let limits: Vec<String> = found.limits.iter().map(ToString::to_string).collect();
        Ok(answer.with_fact("limits", &limits))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Executor;

    fn run(text: &str, t_end: f64) -> GeneralRun {
        let model = Model::new(Definition::from_toml(text, "f").unwrap());
        GeneralRun { model, options: Options { t_end, ..Options::default() } }
    }

    const DRIVEN: &str = "states = ['x']\nstart = [0]\nf = ['-x + 4*if(mod(t, 1) < 0.5, 1, 0)']";

    /// Names in no order of the alphabet, a table, expressions among the numbers: the run that is
    /// read is the one that was written.
    #[test]
    fn a_run_is_read_as_it_was_written() {
        let text = "states = ['x', 'v']\nstart = ['2*b', 0]\n[parameters]\nb = 0.1\na = \
            '3*b'\n[let]\ns = 'x - a'\nc = 's^2'\n\
            [tables.w]\nfile = 'w.csv'\ntime = 't'\ncolumn = 'w'\n[modes.z]\nf = ['v', '-sign(s) + \
            w']\n[modes.m]\nf = ['v', 'c']\n\
            [[event]]\nwhen = 'x + 1'\nmode = 'm'";
        let model = Model::new(Definition::from_toml(text, "f").unwrap())
            .with_table("w", "t,w\n0,0.1\n3,0.7\n20,0\n")
            .unwrap();
        let read = |text: &str| expression(text, &model).unwrap();
        for (record, intersection, method) in [
            (Record::Section(read("x - c*v/(1 + w)")), Intersection::Undecided, Method::Dopri5),
            (
                Record::Times { every: f64::INFINITY },
                Intersection::Order(vec![read("x - a")]),
                Method::Radau5,
            ),
            (Record::Times { every: 0.1 }, Intersection::Bilinear, Method::Taylor),
            (Record::Path { chord: 1e-3 }, Intersection::HullLeastNorm, Method::Dopri5),
        ] {
            let options = Options {
                record,
                intersection,
                method,
                start: Some(vec![0.1, 1.0 / 3.0]),
                exit: Exit::Plus,
                ..Options::default()
            };
            let run = GeneralRun { model: model.clone(), options };
            assert_eq!(GeneralRun::from_json(run.json()).unwrap(), run);
        }
        assert!(GeneralRun::from_json(json!({ "system": model.json(), "t_start": 0 })).is_err());
    }

    /// A body thrown 0.1 mm high beside a large state: its top is among the rows, which are handed
    /// on as they are kept.
    #[test]
    fn the_path_of_a_small_state_is_as_fine_as_that_of_a_large_one() {
        let text = "states = ['x', 'v', 'n']\nstart = [0, 0.04472135954999579, 0]\n\
            f = ['v', '-10', '1e-3']\n[[event]]\nwhen = 'x'\ndirection = \
            'down'\nset = { v = '-v' }";
        for (t_end, method) in
            [(0.02, Method::Dopri5), (20.0, Method::Dopri5), (0.02, Method::Taylor)]
        {
            let mut run = run(text, t_end);
            run.options.method = method;
            let answer = Executor::quiet().ask(&run).unwrap();
            let top = answer.tables[0].numbers("x").iter().fold(0.0, |a, b| f64::max(a, *b));
            assert!((top - 1e-4).abs() < 2e-7, "{top}");
            let mut rows = Vec::new();
            let mut keep = |part: &Table| {
                rows.extend(part.rows());
                true
            };
            run.stream(&mut keep, &|_| true).unwrap();
            assert!(rows == answer.tables[0].rows());
        }
    }

    /// Motion begins in the first mode.
    #[test]
    fn the_order_of_modes_is_a_part_of_the_question() {
        let of = |first: &str, second: &str| {
            run(
                &format!(
                    "states = ['x']\nstart = [0]\n[modes.{first}]\nf = ['1']\n[modes.{second}]\nf \
                        = ['1']"
                ),
                1.0,
            )
        };
        assert_ne!(Question::json(&of("a", "b")), Question::json(&of("b", "a")));
    }

    #[test]
    fn a_phase_is_counted_from_the_start() {
        let last = |t_start, t_end, period| {
            last_of_phase(&Options { t_start, t_end, ..Options::default() }, period)
        };
        assert_eq!(last(0.0, 1.0, 400e-6), Some((1.0, true)));
        assert_eq!(last(0.0, 50.9, 1.0), Some((50.0, false)));
        assert_eq!(last(0.5, 4.2, 1.0), Some((3.5, false)));
        assert_eq!(last(0.5, 1.2, 1.0), None);
    }

    #[test]
    fn runs_differ_in_their_questions_where_they_differ() {
        let (a, b) = (run(DRIVEN, 10.0), run(DRIVEN, 11.0));
        assert_ne!(Question::json(&a), Question::json(&b));
        let answer = Executor::quiet().ask(&a).unwrap();
        assert_eq!(answer.table("path").unwrap().numbers("t").last(), Some(&10.0));
    }

    #[test]
    fn what_the_asker_can_mend_is_said_to_be_so() {
        let mut wrong = run(DRIVEN, 10.0);
        wrong.options.start = Some(vec![1.0, 2.0]);
        assert!(Executor::quiet().ask(&wrong).unwrap_err().is_bad_question());
        let leaves = run("states = ['x']\nstart = [1]\nf = ['-sqrt(x) - 1']", 10.0);
        assert!(!Executor::quiet().ask(&leaves).unwrap_err().is_bad_question());
    }
}
