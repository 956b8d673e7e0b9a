//! Axes of a sweep: the coordinates that it varies, and their values.

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

use crate::spec::{Method, RunSpec, SwitchSpec};
use crate::table::{Column, ColumnKind, Entry};
use twofold_integrate::StepCap;
use twofold_integrate::filippov::ExitRule;
use twofold_num::elementary::{exp10, log10};
use twofold_system::Transition;

/// A number or name of a run that a sweep varies.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub enum Coordinate {
    /// `params.NAME`: a parameter of the system.
    Parameter(String),
    /// `start.NAME`: a component of the initial state.
    Start(String),
    /// `shift.NAME`: what is added to a component of the initial state.
    Shift(String),
    /// `rtol`.
    Rtol,
    /// `atol`.
    Atol,
    /// `tolerance`: both.
    Tolerance,
    /// `max-step`: the longest step.
    MaxStep,
    /// `t-end`: the final time.
    TEnd,
    /// `interval`: the time between restarts.
    Interval,
    /// `eps`: stiffness; eps' and the size of kicks stay as they are.
    Eps,
    /// `eps-prime`: relaxation time of a hysteretic switch.
    EpsPrime,
    /// `delay` of a delayed switch.
    Delay,
    /// `band` of a relay.
    Band,
    /// `sigma`: perturbation of the transition function.
    Sigma,
    /// `kick-every`: time between kicks.
    KickEvery,
    /// `kick-size`.
    KickSize,
    /// `seed` of the run's random numbers.
    Seed,
    /// `stream` of the run's random numbers.
    Stream,
    /// `method`, by name.
    Method,
}

/// Number of [`PLAIN`] coordinates that general systems have, too: the first ones.
const FOR_ALL: usize = 6;

/// The coordinates without a dot, by name.
const PLAIN: [(&str, Coordinate); 16] = [
    ("rtol", Coordinate::Rtol),
    ("atol", Coordinate::Atol),
    ("tolerance", Coordinate::Tolerance),
    ("max-step", Coordinate::MaxStep),
    ("t-end", Coordinate::TEnd),
    ("method", Coordinate::Method),
    ("interval", Coordinate::Interval),
    ("eps", Coordinate::Eps),
    ("eps-prime", Coordinate::EpsPrime),
    ("delay", Coordinate::Delay),
    ("band", Coordinate::Band),
    ("sigma", Coordinate::Sigma),
    ("kick-every", Coordinate::KickEvery),
    ("kick-size", Coordinate::KickSize),
    ("seed", Coordinate::Seed),
    ("stream", Coordinate::Stream),
];

/// Values along an axis. All are computed with portable arithmetic: the same bits on every machine.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum Values {
    /// These numbers.
    Numbers(Vec<f64>),
    /// These names.
    Names(Vec<String>),
    /// All whole numbers from one to the other.
    Whole {
        /// The first.
        from: u64,
        /// The last.
        to: u64,
    },
    /// Once, twice, three times ... a number.
    Multiples {
        /// The number.
        of: f64,
        /// Number of values.
        count: u64,
    },
    /// Evenly spaced, both ends included.
    Linear {
        /// The first.
        from: f64,
        /// The last.
        to: f64,
        /// Number of values.
        count: u64,
    },
    /// Evenly spaced in the logarithm, both ends included, rounded to 15 digits so that 1e-3..1 in
    /// 4 has 0.01 in it.
    Log {
        /// The first.
        from: f64,
        /// The last.
        to: f64,
        /// Number of values.
        count: u64,
    },
    /// Drawn uniformly from [from, to), anew for every row.
    Uniform {
        /// The lower end.
        from: f64,
        /// The upper end.
        to: f64,
    },
    /// Drawn from [from, to) uniformly in the logarithm, anew for every row.
    LogUniform {
        /// The lower end.
        from: f64,
        /// The upper end.
        to: f64,
    },
}

/// A coordinate and its values: `params.alpha=1e-3..1:log:13`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Axis {
    /// The varied coordinate.
    pub coordinate: Coordinate,
    /// Its values.
    pub values: Values,
}

/// An axis that cannot be.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("\"{axis}\": {problem}")]
pub struct AxisError {
    /// The axis, as it was given.
    pub axis: String,
    /// The problem, and its remedy.
    pub problem: String,
}

/// The forms of an axis, for error messages and help.
pub const FORMS: &str = "NAME=VALUES with VALUES one of a,b,c; FROM..TO:COUNT; FROM..TO:log:COUNT; \
    STEP*COUNT; FROM..TO or FROM..TO:log for random \
                         draws; for seed and stream FIRST..LAST";

impl fmt::Display for Coordinate {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Coordinate::Parameter(name) => write!(f, "params.{name}"),
            Coordinate::Start(name) => write!(f, "start.{name}"),
            Coordinate::Shift(name) => write!(f, "shift.{name}"),
            other => {
                f.write_str(PLAIN.iter().find(|(_, c)| c == other).map_or("", |(name, _)| name))
            }
        }
    }
}

impl From<Coordinate> for String {
    fn from(coordinate: Coordinate) -> Self {
        coordinate.to_string()
    }
}

impl TryFrom<String> for Coordinate {
    type Error = String;
    fn try_from(text: String) -> Result<Self, String> {
        text.parse()
    }
}

impl FromStr for Coordinate {
    type Err = String;
    fn from_str(text: &str) -> Result<Self, String> {
        match text.split_once('.') {
            Some(("params", name)) if !name.is_empty() => {
                Ok(Coordinate::Parameter(name.to_owned()))
            }
            Some(("start", name)) if !name.is_empty() => Ok(Coordinate::Start(name.to_owned())),
            Some(("shift", name)) if !name.is_empty() => Ok(Coordinate::Shift(name.to_owned())),
            _ => PLAIN.iter().find(|(name, _)| *name == text).map(|(_, c)| c.clone()).ok_or_else(
                || {
                    let known = |places: &[(&'static str, Coordinate)]| -> String {
                        places.iter().map(|(name, _)| *name).collect::<Vec<_>>().join(", ")
                    };
                    let (all, some) = PLAIN.split_at(FOR_ALL);
                    format!(
                        "\"{text}\" cannot be varied; choose among params.NAME, start.NAME, \
                        shift.NAME, {}; of systems with h, plus and minus also {}",
                        known(all),
                        known(some)
                    )
                },
            ),
        }
    }
}

impl FromStr for Axis {
    type Err = AxisError;

    fn from_str(text: &str) -> Result<Self, AxisError> {
        let wrong = |problem: String| AxisError { axis: text.to_owned(), problem };
        let (name, values) = text
            .split_once('=')
            .ok_or_else(|| wrong(format!("there is no \"=\"; give it as {FORMS}")))?;
        let coordinate: Coordinate = name.trim().parse().map_err(wrong)?;
        let values = values.trim();
        let axis = match coordinate {
            Coordinate::Method => {
                Values::Names(values.split(',').map(|v| v.trim().to_owned()).collect())
            }
            Coordinate::Seed | Coordinate::Stream => whole(values).map_err(wrong)?,
            _ => numbers(values).map_err(wrong)?,
        };
        let axis = Axis { coordinate, values: axis };
        axis.validate()?;
        Ok(axis)
    }
}

impl fmt::Display for Axis {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}=", self.coordinate)?;
        match &self.values {
            Values::Numbers(v)
                if matches!(self.coordinate, Coordinate::Seed | Coordinate::Stream) =>
            {
                f.write_str(&v.iter().map(|x| format!("{x:.0}")).collect::<Vec<_>>().join(","))
            }
            Values::Numbers(v) => {
                f.write_str(&v.iter().map(|x| format!("{x:?}")).collect::<Vec<_>>().join(","))
            }
            Values::Names(v) => f.write_str(&v.join(",")),
            Values::Whole { from, to } => write!(f, "{from}..{to}"),
            Values::Multiples { of, count } => write!(f, "{of:?}*{count}"),
            Values::Linear { from, to, count } => write!(f, "{from:?}..{to:?}:{count}"),
            Values::Log { from, to, count } => write!(f, "{from:?}..{to:?}:log:{count}"),
            Values::Uniform { from, to } => write!(f, "{from:?}..{to:?}"),
            Values::LogUniform { from, to } => write!(f, "{from:?}..{to:?}:log"),
        }
    }
}

fn number(text: &str) -> Result<f64, String> {
    match text.trim().parse::<f64>() {
        Ok(value) if value.is_finite() => Ok(value),
        _ => Err(format!("\"{}\" is not a finite number; give {FORMS}", text.trim())),
    }
}

fn count(text: &str) -> Result<u64, String> {
    text.trim().parse().map_err(|_| format!("\"{}\" is not a count; give {FORMS}", text.trim()))
}

fn numbers(text: &str) -> Result<Values, String> {
    if let Some((of, times)) = text.split_once('*') {
        return Ok(Values::Multiples { of: number(of)?, count: count(times)? });
    }
    let Some((from, rest)) = text.split_once("..") else {
        return Ok(Values::Numbers(text.split(',').map(number).collect::<Result<_, _>>()?));
    };
    let from = number(from)?;
    match rest.split(':').collect::<Vec<_>>().as_slice() {
        [to] => Ok(Values::Uniform { from, to: number(to)? }),
        [to, "log"] => Ok(Values::LogUniform { from, to: number(to)? }),
        [to, n] => Ok(Values::Linear { from, to: number(to)?, count: count(n)? }),
        [to, "log", n] => Ok(Values::Log { from, to: number(to)?, count: count(n)? }),
        _ => Err(format!("give {FORMS}")),
    }
}

fn whole(text: &str) -> Result<Values, String> {
    let one = |t: &str| {
        t.trim()
            .parse::<u64>()
            .map_err(|_| format!("\"{}\" is not a whole number from 0 on", t.trim()))
    };
    match text.split_once("..") {
        Some((from, to)) => Ok(Values::Whole { from: one(from)?, to: one(to)? }),
        None => {
            // f64 holds whole numbers up to 2^53; beyond it a list is given as ranges.
            let list: Vec<u64> = text.split(',').map(one).collect::<Result<_, _>>()?;
            if list.iter().any(|v| *v > 1 << 53) {
                return Err(
                    "a list holds numbers up to 2^53; give larger ones as FIRST..LAST".into()
                );
            }
            Ok(Values::Numbers(list.into_iter().map(|v| v as f64).collect()))
        }
    }
}

impl Axis {
    /// Checks the values in themselves.
    ///
    /// # Errors
    ///
    /// If there are none, or they cannot be spaced as asked, or names are not those of methods.
    pub fn validate(&self) -> Result<(), AxisError> {
        let wrong =
            |problem: &str| Err(AxisError { axis: self.to_string(), problem: problem.to_owned() });
        let finite = |v: &[f64]| v.iter().all(|x| x.is_finite());
        let integer = matches!(self.coordinate, Coordinate::Seed | Coordinate::Stream);
        match (&self.values, &self.coordinate) {
            (Values::Names(names), Coordinate::Method) => {
                let known: Vec<&str> = Method::ALL.iter().map(|m| m.name()).collect();
                if names.is_empty() || names.iter().any(|n| !known.contains(&n.as_str())) {
                    return wrong(&format!("give methods among {}", known.join(", ")));
                }
            }
            (Values::Names(_), _) => return wrong("give numbers"),
            (_, Coordinate::Method) => return wrong("give methods by name"),
            (Values::Whole { from, to }, _) if integer => {
                if to < from || *to > i64::MAX as u64 {
                    return wrong("give FIRST..LAST in rising order, up to 2^63");
                }
            }
            (Values::Whole { .. }, _) => {
                return wrong("ranges of whole numbers are for seed and stream");
            }
            (Values::Numbers(v), _) if integer => {
                if v.is_empty() || v.iter().any(|x| !(0.0..9.1e15).contains(x) || x.fract() != 0.0)
                {
                    return wrong("give whole numbers from 0 on");
                }
            }
            (_, Coordinate::Seed | Coordinate::Stream) => {
                return wrong("give whole numbers from 0 on");
            }
            (Values::Numbers(v), _) => {
                if v.is_empty() || !finite(v) {
                    return wrong("give finite numbers");
                }
            }
            (Values::Multiples { of, count }, _) => {
                if !of.is_finite() || *count == 0 {
                    return wrong("give a finite number and a count of 1 or more");
                }
            }
            (Values::Linear { from, to, count }, _) | (Values::Log { from, to, count }, _) => {
                if !finite(&[*from, *to]) || *count < 2 {
                    return wrong("give finite ends and a count of 2 or more");
                }
                if matches!(self.values, Values::Log { .. }) && !(*from > 0.0 && *to > 0.0) {
                    return wrong("a logarithmic range lies above zero");
                }
            }
            (Values::Uniform { from, to }, _) | (Values::LogUniform { from, to }, _) => {
                if !finite(&[*from, *to]) || from >= to {
                    return wrong("give a lower and a higher end, or FROM..TO:COUNT for a grid");
                }
                if matches!(self.values, Values::LogUniform { .. }) && *from <= 0.0 {
                    return wrong("a logarithmic range lies above zero");
                }
            }
        }
        Ok(())
    }

    /// Whether values are drawn and not listed.
    pub fn is_random(&self) -> bool {
        matches!(self.values, Values::Uniform { .. } | Values::LogUniform { .. })
    }

    /// Number of listed values; 1 for a random axis.
    pub fn count(&self) -> u64 {
        match &self.values {
            Values::Numbers(v) => v.len() as u64,
            Values::Names(v) => v.len() as u64,
            Values::Whole { from, to } => to - from + 1,
            Values::Multiples { count, .. }
            | Values::Linear { count, .. }
            | Values::Log { count, .. } => *count,
            Values::Uniform { .. } | Values::LogUniform { .. } => 1,
        }
    }

    /// The value of index `i`, or the one that `u`, uniform on [0, 1), draws.
    pub fn value(&self, i: u64, u: f64) -> Entry {
        let integer = matches!(self.coordinate, Coordinate::Seed | Coordinate::Stream);
        match &self.values {
            Values::Numbers(v) if integer => Entry::Integer(v[i as usize] as i64),
            Values::Numbers(v) => Entry::Number(v[i as usize]),
            Values::Names(v) => Entry::Word(v[i as usize].clone()),
            Values::Whole { from, .. } => Entry::Integer((from + i) as i64),
            Values::Multiples { of, .. } => Entry::Number((i + 1) as f64 * of),
            Values::Linear { from, to, count } => {
                let share = i as f64 / (count - 1) as f64;
                Entry::Number(if i + 1 == *count { *to } else { from + (to - from) * share })
            }
            Values::Log { from, to, count } => {
                let share = i as f64 / (count - 1) as f64;
                Entry::Number(match i {
                    0 => *from,
                    _ if i + 1 == *count => *to,
                    _ => rounded(exp10(log10(*from) + (log10(*to) - log10(*from)) * share)),
                })
            }
            Values::Uniform { from, to } => Entry::Number(from + (to - from) * u),
            Values::LogUniform { from, to } => {
                Entry::Number(exp10(log10(*from) + (log10(*to) - log10(*from)) * u))
            }
        }
    }

    /// An empty column for this axis.
    pub(super) fn column(&self) -> Column {
        let kind = match self.coordinate {
            Coordinate::Method => ColumnKind::Word,
            Coordinate::Seed | Coordinate::Stream => ColumnKind::Integer,
            _ => ColumnKind::Number,
        };
        Column::new(
            &self.coordinate.to_string(),
            if kind == ColumnKind::Word { "" } else { "1" },
            kind,
        )
    }
}

/// To 15 significant digits.
fn rounded(value: f64) -> f64 {
    // Rust prints and reads decimal numbers correctly rounded on every platform.
    format!("{value:.14e}").parse().unwrap_or(value)
}

impl Coordinate {
    /// Gives the run this value; an error says why it would have no effect.
    pub(super) fn apply(&self, run: &mut RunSpec, value: &Entry) -> Result<(), String> {
        let number = value.value();
        let component = |run: &RunSpec, name: &str| {
            let states = run.system.coordinates();
            let place = states.iter().position(|s| *s == name);
            place.ok_or_else(|| {
                format!("the system has no state {name}; it has {}", states.join(", "))
            })
        };
        let whole = match value {
            Entry::Integer(v) => u64::try_from(*v).unwrap_or(0),
            _ => 0,
        };
        let side = |run: &RunSpec| SwitchSpec::phi_at(&run.system, &run.start);
        let follows = match run.switch {
            SwitchSpec::Hysteretic { phi0, .. } => phi0 == side(run),
            _ => false,
        };
        match self {
            Coordinate::Parameter(name) => {
                run.system = run.system.clone().with(name, number).map_err(|e| e.to_string())?;
            }
            Coordinate::Start(name) => {
                let i = component(run, name)?;
                run.start[i] = number;
            }
            Coordinate::Shift(name) => {
                let i = component(run, name)?;
                run.start[i] += number;
            }
            Coordinate::Rtol => run.method.tolerance.rtol = number,
            Coordinate::Atol => run.method.tolerance.atol = number,
            Coordinate::Tolerance => {
                run.method.tolerance.rtol = number;
                run.method.tolerance.atol = number;
            }
            Coordinate::MaxStep => run.method.step_cap = StepCap::Absolute(number),
            Coordinate::TEnd => run.t_end = number,
            Coordinate::Interval => match run.switch {
                SwitchSpec::Filippov { .. } => {
                    return Err("restarts belong to smoothed and hysteretic runs".into());
                }
                _ => run.schedule.restart_every = Some(number),
            },
            Coordinate::Eps => match &mut run.switch {
                SwitchSpec::Smoothed { eps, .. }
                | SwitchSpec::Hysteretic { eps, .. }
                | SwitchSpec::Delayed { eps: Some(eps), .. } => *eps = number,
                SwitchSpec::Delayed { .. } => {
                    return Err("the sharp delayed switch has no eps; give the run one".into());
                }
                SwitchSpec::Relay { .. } => return Err("a relay has no eps; vary its band".into()),
                SwitchSpec::Filippov { .. } => {
                    return Err("the discontinuous system has no eps".into());
                }
            },
            Coordinate::EpsPrime => match &mut run.switch {
                SwitchSpec::Hysteretic { eps_prime, .. } => *eps_prime = number,
                _ => return Err("eps-prime belongs to the hysteretic switch".into()),
            },
            Coordinate::Delay => match &mut run.switch {
                SwitchSpec::Delayed { delay, .. } => *delay = number,
                _ => return Err("delay belongs to the delayed switch".into()),
            },
            Coordinate::Band => match &mut run.switch {
                SwitchSpec::Relay { band, .. } => *band = number,
                _ => return Err("band belongs to the relay".into()),
            },
            Coordinate::Sigma => match &mut run.switch {
                SwitchSpec::Smoothed {
                    transition: t @ (Transition::Tanh | Transition::PerturbedTanh { .. }),
                    ..
                }
                | SwitchSpec::Delayed {
                    transition: Some(t @ (Transition::Tanh | Transition::PerturbedTanh { .. })),
                    ..
                } => {
                    *t = Transition::PerturbedTanh { sigma: number };
                }
                _ => return Err("sigma perturbs the smoothed switch with tanh".into()),
            },
            Coordinate::KickEvery | Coordinate::KickSize => {
                let kick = run
                    .schedule
                    .kick
                    .as_mut()
                    .ok_or("there are no kicks to vary; give the run some")?;
                *(if *self == Coordinate::KickEvery { &mut kick.every } else { &mut kick.size }) =
                    number;
            }
            Coordinate::Seed | Coordinate::Stream => {
                let is_seed = *self == Coordinate::Seed;
                let mut random = false;
                if let Some(kick) = &mut run.schedule.kick {
                    *(if is_seed { &mut kick.seed } else { &mut kick.stream }) = whole;
                    random = true;
                }
                if let SwitchSpec::Filippov {
                    exit: ExitRule::Random { seed, stream, .. }, ..
                } = &mut run.switch
                {
                    *(if is_seed { seed } else { stream }) = whole;
                    random = true;
                }
                if !random {
                    return Err(
                        "nothing in this run is random; give it kicks or a random exit rule".into(),
                    );
                }
            }
            Coordinate::Method => {
                let found = Method::ALL.into_iter().find(|m| m.name() == value.word());
                run.method.name =
                    found.ok_or_else(|| format!("there is no method {}", value.word()))?;
            }
        }
        let phi = follows.then(|| side(run));
        if let (SwitchSpec::Hysteretic { phi0, .. }, Some(phi)) = (&mut run.switch, phi) {
            *phi0 = phi;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn values(text: &str) -> Vec<Entry> {
        let axis: Axis = text.parse().unwrap();
        assert_eq!(axis.to_string().parse::<Axis>().unwrap(), axis);
        let json = serde_json::to_string(&axis).unwrap();
        assert_eq!(serde_json::from_str::<Axis>(&json).unwrap(), axis);
        (0..axis.count()).map(|i| axis.value(i, 0.5)).collect()
    }

    #[test]
    fn every_form_has_its_values() {
        let numbers = |v: &[f64]| v.iter().map(|x| Entry::Number(*x)).collect::<Vec<_>>();
        assert_eq!(values("interval=20,40,100"), numbers(&[20.0, 40.0, 100.0]));
        assert_eq!(values("params.alpha=1e-3..1:log:4"), numbers(&[1e-3, 1e-2, 1e-1, 1.0]));
        assert_eq!(values("params.beta=1e-6..1e-3:log:13")[4..5], numbers(&[1e-5]));
        assert_eq!(values("start.x=-1..1:5"), numbers(&[-1.0, -0.5, 0.0, 0.5, 1.0]));
        assert_eq!(values("start.x=1..2:2"), numbers(&[1.0, 2.0]));
        assert_eq!(values("rtol=1e-3..1e-2:log:2"), numbers(&[1e-3, 1e-2]));
        assert_eq!(values("shift.x=1e-9*3"), numbers(&[1e-9, 2e-9, 3.0 * 1e-9]));
        assert_eq!(values("seed=7..9"), [7, 8, 9].map(Entry::Integer));
        assert_eq!(values("stream=3,1"), [3, 1].map(Entry::Integer));
        assert_eq!(values("method=lsoda,dopri5"), ["lsoda", "dopri5"].map(Entry::from));
        assert_eq!(values("shift.y=-1e-9..1e-9"), numbers(&[0.0]));
        assert_eq!(values("rtol=1e-10..1e-6:log"), numbers(&[1e-8]));
        // Written again with all of its digits.
        assert_eq!(values("params.beta=0.25,1e-5"), numbers(&[0.25, 1e-5]));
    }

    /// Values that only a file or a program can contain.
    #[test]
    fn values_that_do_not_fit_are_refused() {
        use Coordinate::{Method, Rtol, Seed};
        let whole = |from, to| Values::Whole { from, to };
        for (coordinate, values, word) in [
            (Rtol, Values::Numbers(vec![]), "finite numbers"),
            (Rtol, Values::Numbers(vec![1.0, f64::NAN]), "finite numbers"),
            (Rtol, Values::Names(vec!["lsoda".into()]), "give numbers"),
            (Rtol, whole(1, 2), "for seed and stream"),
            (Rtol, Values::Multiples { of: f64::NAN, count: 3 }, "finite number and a count"),
            (Rtol, Values::Linear { from: 0.0, to: f64::INFINITY, count: 3 }, "finite ends"),
            (Rtol, Values::Uniform { from: f64::NEG_INFINITY, to: 0.0 }, "lower and a higher"),
            (Method, Values::Names(vec![]), "methods among"),
            (Method, Values::Numbers(vec![1.0]), "by name"),
            (Seed, Values::Numbers(vec![]), "whole numbers"),
            (Seed, Values::Numbers(vec![1.0, 1.5]), "whole numbers"),
            (Seed, Values::Numbers(vec![-1.0]), "whole numbers"),
            (Seed, Values::Numbers(vec![1e16]), "whole numbers"),
            (Seed, Values::Uniform { from: 0.0, to: 1.0 }, "whole numbers"),
        ] {
            let error = Axis { coordinate, values }.validate().unwrap_err().to_string();
            assert!(error.contains(word), "{word}: {error}");
        }
        let last = i64::MAX as u64;
        assert_eq!(Axis { coordinate: Seed, values: whole(last, last) }.validate(), Ok(()));
    }

    /// An end with more digits than a grid's values are rounded to is hit exactly; so is 1/3 of a
    /// range.
    #[test]
    fn grids_end_where_they_are_asked_to() {
        // And in binary 0.2 + (0.9 - 0.2) is not 0.9.
        for (from, to) in [(0.1 + 0.2, 1.1 * 1.1), (0.2, 0.9)] {
            let log =
                Axis { coordinate: Coordinate::Rtol, values: Values::Log { from, to, count: 4 } };
            let linear = Axis {
                coordinate: Coordinate::Rtol,
                values: Values::Linear { from, to, count: 4 },
            };
            for axis in [log, linear] {
                assert_eq!((axis.value(0, 0.0), axis.value(3, 0.0)), (from.into(), to.into()));
                assert!(axis.value(1, 0.0).value() > from && axis.value(2, 0.0).value() < to);
                assert_eq!((axis.count(), axis.is_random()), (4, false));
            }
        }
        let drawn = |u| "rtol=1e-4..1:log".parse::<Axis>().unwrap().value(0, u).value();
        assert!((drawn(0.25) - 1e-3).abs() < 1e-15 && (drawn(0.0) - 1e-4).abs() < 1e-16);
        let drawn = |u| "rtol=-1..3".parse::<Axis>().unwrap().value(0, u).value();
        assert_eq!([0.0, 0.25, 0.75].map(drawn), [-1.0, 0.0, 2.0]);
    }

    /// Every coordinate changes what it names, and that alone; and says so where it has no effect.
    #[test]
    fn coordinates_change_what_they_name() {
        use crate::spec::Observation;
        use twofold_integrate::filippov::{Side, SlidingLaw};
        use twofold_integrate::{Kick, KickLaw};
        use twofold_system::{Caricature, Relaxation};
        let section = Observation::Section { coordinate: 1, value: 0.0 };
        let system = Caricature::with_reinjection(0.1, 1e-5).into();
        let mut tanh = crate::cases::run(system, SwitchSpec::tanh(1e-3), 20.0, section);
        tanh.schedule.kick =
            Some(Kick { every: 0.3, size: 1e-3, law: KickLaw::Sphere, seed: 9, stream: 5 });
        let hysteretic =
            RunSpec { switch: SwitchSpec::hysteretic(1e-3, Relaxation::Single), ..tanh.clone() };
        let law = SlidingLaw::Uniform { longest: 1.0 };
        let filippov = |exit| RunSpec {
            switch: SwitchSpec::Filippov { exit, funnel: None },
            ..hysteretic.clone()
        };
        let random =
            |seed, stream| filippov(ExitRule::Random { law, plus_probability: 0.5, seed, stream });
        let mut plain = filippov(ExitRule::AtOnce { side: Side::Plus });
        plain.schedule.kick = None;
        let arctan = RunSpec {
            switch: SwitchSpec::Smoothed { eps: 1e-3, transition: Transition::Arctan },
            ..plain.clone()
        };
        let delayed = RunSpec { switch: SwitchSpec::delayed(1e-3), ..plain.clone() };
        let relay = RunSpec { switch: SwitchSpec::relay(1e-3), ..plain.clone() };
        let changed = |run: &RunSpec, text: &str| {
            let axis: Axis = text.parse().unwrap();
            let mut run = run.clone();
            axis.coordinate
                .apply(&mut run, &axis.value(0, 0.5))
                .map(|()| serde_json::to_value(&run).unwrap())
        };
        type Change = fn(&mut RunSpec);
        let cases: [(&RunSpec, &str, Change); 24] = [
            (&tanh, "params.alpha=0.2", |r| {
                r.system = Caricature::with_reinjection(0.2, 1e-5).into()
            }),
            (&tanh, "start.y=7", |r| r.start[1] = 7.0),
            (&tanh, "shift.z=0.25", |r| r.start[2] = 1.25),
            (&tanh, "rtol=1e-6", |r| r.method.tolerance.rtol = 1e-6),
            (&tanh, "atol=1e-6", |r| r.method.tolerance.atol = 1e-6),
            (&tanh, "tolerance=1e-6", |r| {
                (r.method.tolerance.rtol, r.method.tolerance.atol) = (1e-6, 1e-6);
            }),
            (&tanh, "max-step=0.5", |r| r.method.step_cap = StepCap::Absolute(0.5)),
            (&tanh, "t-end=30", |r| r.t_end = 30.0),
            (&tanh, "interval=3", |r| r.schedule.restart_every = Some(3.0)),
            (&hysteretic, "interval=3", |r| r.schedule.restart_every = Some(3.0)),
            (&tanh, "eps=1e-2", |r| r.switch = SwitchSpec::tanh(1e-2)),
            (&hysteretic, "eps=1e-2", |r| {
                let SwitchSpec::Hysteretic { eps, .. } = &mut r.switch else { panic!() };
                *eps = 1e-2;
            }),
            (&hysteretic, "start.x=-1", |r| {
                let SwitchSpec::Hysteretic { phi0, .. } = &mut r.switch else { panic!() };
                (*phi0, r.start[0]) = (0.0, -1.0);
            }),
            (&hysteretic, "eps-prime=1e-4", |r| {
                let SwitchSpec::Hysteretic { eps_prime, .. } = &mut r.switch else { panic!() };
                *eps_prime = 1e-4;
            }),
            (&tanh, "sigma=0.5", |r| {
                r.switch = SwitchSpec::Smoothed {
                    eps: 1e-3,
                    transition: Transition::PerturbedTanh { sigma: 0.5 },
                };
            }),
            (&tanh, "kick-every=0.7", |r| r.schedule.kick.as_mut().unwrap().every = 0.7),
            (&tanh, "kick-size=0.7", |r| r.schedule.kick.as_mut().unwrap().size = 0.7),
            (&tanh, "seed=70", |r| r.schedule.kick.as_mut().unwrap().seed = 70),
            (&tanh, "stream=70", |r| r.schedule.kick.as_mut().unwrap().stream = 70),
            (&tanh, "method=radau5", |r| r.method.name = Method::Radau5),
            (&tanh, "method=lsoda,taylor", |r| r.method.name = Method::Lsoda),
            (&plain, "t-end=30", |r| r.t_end = 30.0),
            (&delayed, "delay=1e-2", |r| r.switch = SwitchSpec::delayed(1e-2)),
            (&relay, "band=1e-2", |r| r.switch = SwitchSpec::relay(1e-2)),
        ];
        for (run, text, change) in cases {
            let mut wanted = run.clone();
            change(&mut wanted);
            assert_eq!(changed(run, text), Ok(serde_json::to_value(&wanted).unwrap()), "{text}");
            assert_ne!(&wanted, run, "{text}");
        }
        // Two perturbed: the new one alone.
        let SwitchSpec::Smoothed { eps, .. } = tanh.switch else { panic!() };
        let sigma =
            |sigma| SwitchSpec::Smoothed { eps, transition: Transition::PerturbedTanh { sigma } };
        let perturbed =
            |s| serde_json::to_value(RunSpec { switch: sigma(s), ..tanh.clone() }).unwrap();
        assert_eq!(
            changed(&RunSpec { switch: sigma(0.25), ..tanh.clone() }, "sigma=0.5"),
            Ok(perturbed(0.5))
        );
        // A random exit rule and kicks share their seed.
        let (both, seeded) = (random(1, 2), changed(&random(1, 2), "seed=8").unwrap());
        let mut wanted = random(8, 2);
        wanted.schedule.kick.as_mut().unwrap().seed = 8;
        assert_eq!(seeded, serde_json::to_value(&wanted).unwrap());
        let mut alone = both;
        alone.schedule.kick = None;
        let wanted = RunSpec { schedule: alone.schedule, ..random(1, 8) };
        assert_eq!(changed(&alone, "stream=8"), Ok(serde_json::to_value(&wanted).unwrap()));
        for (run, text, word) in [
            (&tanh, "params.gamma=1", "gamma"),
            (&tanh, "start.q=1", "no state q"),
            (&tanh, "shift.q=1", "no state q"),
            (&plain, "interval=3", "restarts belong"),
            (&plain, "eps=1", "no eps"),
            (&delayed, "eps=1", "no eps"),
            (&tanh, "delay=1", "delayed switch"),
            (&relay, "eps=1", "no eps"),
            (&delayed, "band=1", "the relay"),
            (&tanh, "eps-prime=1", "hysteretic switch"),
            (&plain, "eps-prime=1", "hysteretic switch"),
            (&hysteretic, "sigma=1", "with tanh"),
            (&arctan, "sigma=1", "with tanh"),
            (&plain, "kick-size=1", "no kicks"),
            (&plain, "kick-every=1", "no kicks"),
            (&plain, "seed=1", "nothing in this run is random"),
            (&arctan, "stream=1", "nothing in this run is random"),
        ] {
            let why = changed(run, text).unwrap_err();
            assert!(why.contains(word), "{text}: {why}");
        }
    }

    #[test]
    fn columns_are_of_the_values_kind() {
        for (text, unit, kind) in [
            ("method=lsoda", "", ColumnKind::Word),
            ("seed=1", "1", ColumnKind::Integer),
            ("stream=1..2", "1", ColumnKind::Integer),
            ("shift.x=1", "1", ColumnKind::Number),
        ] {
            let axis: Axis = text.parse().unwrap();
            let column = axis.column();
            let name = text.split('=').next().unwrap();
            assert_eq!(
                (column.name.as_str(), column.unit.as_str(), column.kind()),
                (name, unit, kind)
            );
        }
    }

    #[test]
    fn nonsense_is_refused() {
        for (text, word) in [
            ("alpha", "="),
            ("alpha=1", "cannot be varied"),
            ("rtol=", "not a finite number"),
            ("rtol=1..2:1", "2 or more"),
            ("rtol=0..1:log:3", "above zero"),
            ("rtol=2..1", "lower"),
            ("seed=1.5", "whole"),
            ("seed=9..1", "rising"),
            ("method=euler", "lsoda"),
            ("shift.x=1*0", "count"),
            ("eps=inf", "not a finite number"),
            ("params.=1", "cannot be varied"),
            ("start.=1", "cannot be varied"),
            ("shift.=1", "cannot be varied"),
            ("rtol=1..1", "lower"),
            ("rtol=0..1:log", "above zero"),
            ("rtol=1..0:log:3", "above zero"),
            ("rtol=1..2:log:1", "2 or more"),
            ("rtol=1..2:3:4", "FROM..TO"),
            ("seed=0..9223372036854775808", "2^63"),
            ("seed=9007199254740993", "2^53"),
            ("seed=1*3", "whole"),
            ("method=", "lsoda"),
        ] {
            let error = text.parse::<Axis>().unwrap_err().to_string();
            assert!(error.contains(word), "{text}: {error}");
        }
    }
}
