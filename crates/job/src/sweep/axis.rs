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
mod tests;
