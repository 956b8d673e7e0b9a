//! Runs of general systems: which flags describe them, and how they are computed and delivered.

use super::CliError;
use super::flags::{RunFlags, SWITCH, Use};
use super::models::named;
use super::words::Method as Named;
use crate::hybrid::motion::{Exit as Side, Method, Record};
use crate::hybrid::selection::Intersection as Rule;
use crate::hybrid::{HybridError, Model, Options};
use crate::integrate::StepCap;
use crate::integrate::filippov::{self, ExitRule};
use crate::job::JobError;
use crate::job::general::{GeneralRun, expression, last_of_phase, model_of};
use crate::job::spec::SwitchSpec;
use crate::system::Expression;

/// Flags that have an effect on the run of a general system.
const WORK: [&str; 13] = [
    "--system",
    "--set",
    "--start",
    "--t-start",
    "--t-end",
    "--method",
    "--rtol",
    "--atol",
    "--max-step",
    "--max-steps",
    "--exit",
    "--intersection",
    "--section",
];

fn usage(text: String) -> CliError {
    CliError::Usage(text)
}

/// The run of a general system that the flags describe, if they name one.
///
/// # Errors
/// If a flag has no effect on it, or a value is wrong.
pub fn run_of(flags: &RunFlags) -> Result<Option<GeneralRun>, CliError> {
    let general = flags.system.as_deref().map_or(Ok(None), |name| named(name, &flags.set, false));
    let (model, of_many_states) = match general? {
        Some(model) => (model, false),
        None => match flags.model_of_many_states()? {
            Some(model) => (model, true),
            None => return Ok(None),
        },
    };
    let recording = ["--chord", "--every"];
    let chooses = ["--exit", "--intersection"];
    let smoothed = of_many_states && flags.is_smoothed();
    let works = |f: &&str| {
        (WORK.contains(f) && !(smoothed && chooses.contains(f)))
            || recording.contains(f)
            || (of_many_states && SWITCH.contains(f))
    };
    if let Some(flag) = flags.given().into_iter().find(|f| !works(f)) {
        let why = match flag {
            _ if smoothed && chooses.contains(&flag) => {
                "it belongs to the discontinuous system; leave it out, or use --switch filippov"
            }
            _ if of_many_states => {
                "it belongs to systems of up to four states, and this one has more; leave it out"
            }
            "--switch" => {
                "a general system is followed exactly, from switch to switch; leave it out, or \
                    write the system with h, plus and minus"
            }
            _ => {
                "it belongs to systems with one or two switching surfaces (h, plus, minus); leave \
                    it out"
            }
        };
        return Err(CliError::no_effect(flag, why));
    }
    let method = method(flags.method)?;
    let positive = |flag: &str, value: Option<f64>| match value {
        Some(v) if !(v.is_finite() && v > 0.0) => {
            Err(usage(format!("{flag} {v}: give a finite number above 0")))
        }
        other => Ok(other),
    };
    let defaults = Options::default();
    let record = match (&flags.section, flags.every, flags.chord) {
        (Some(_), Some(_), _) => {
            return Err(CliError::no_effect(
                "--every",
                "crossings of a section are not thinned; leave one of the two out",
            ));
        }
        (Some(_), _, Some(_)) => {
            return Err(CliError::no_effect(
                "--chord",
                "it belongs to a recorded path; leave it out, or leave out --section",
            ));
        }
        (_, Some(_), Some(_)) => {
            return Err(CliError::no_effect(
                "--chord",
                "--every says which points are recorded; leave one of the two out",
            ));
        }
        (Some(text), ..) => Record::Section(section(text, &model)?),
        (None, Some(every), _) => {
            Record::Times { every: positive("--every", Some(every))?.unwrap_or(every) }
        }
        (None, None, chord) => Record::Path { chord: positive("--chord", chord)?.unwrap_or(1e-3) },
    };
    let exit = match flags.exit.as_deref() {
        None => Side::Undecided,
        Some("at-once:plus") => Side::Plus,
        Some("at-once:minus") => Side::Minus,
        Some(other) => {
            return Err(usage(format!(
                "--exit \"{other}\": of a general system give at-once:plus or at-once:minus"
            )));
        }
    };
    if let Some(start) = &flags.start
        && start.len() != model.coordinates().len()
    {
        let states = model.coordinates().join(", ");
        return Err(usage(format!(
            "--start: {} given, {} wanted, a number for each of {states}",
            start.len(),
            model.coordinates().len()
        )));
    }
    let options = Options {
        mode: defaults.mode,
        extents: defaults.extents,
        t_start: flags.t_start.unwrap_or(0.0),
        t_end: flags.t_end.unwrap_or(150.0),
        start: flags.start.clone(),
        rtol: positive("--rtol", flags.rtol)?.unwrap_or(defaults.rtol),
        atol: positive("--atol", flags.atol)?,
        max_step: positive("--max-step", flags.max_step)?.unwrap_or(defaults.max_step),
        max_steps: flags.max_steps.unwrap_or(defaults.max_steps),
        record,
        exit,
        method,
        intersection: flags
            .intersection
            .as_deref()
            .map_or(Ok(Rule::Undecided), |text| intersection(text, &model))?,
    };
    Ok(Some(GeneralRun { model, options }))
}

/// The same for runs of which the ends are compared: --section or `period` says where they are
/// looked at.
///
/// # Errors
/// If a flag has no effect on it, or a value is wrong.
pub fn looked_at(flags: &RunFlags, period: Option<f64>) -> Result<Option<GeneralRun>, CliError> {
    let Some(mut run) = run_of(flags)? else {
        if period.is_some() {
            flags.check_system()?;
            let why = "equations with h, plus and minus do not see the time; leave it out, and \
                give --section";
            return Err(CliError::no_effect("--period", why));
        }
        return Ok(None);
    };
    for flag in ["--chord", "--every"] {
        if flags.given().contains(&flag) {
            return Err(CliError::no_effect(flag, "no paths are recorded here; leave it out"));
        }
    }
    let options = &mut run.options;
    match (period, &options.record) {
        (Some(_), Record::Section(_)) => {
            return Err(CliError::no_effect(
                "--period",
                "--section says where to look; leave one of the two out",
            ));
        }
        (Some(period), _) if period.is_finite() && period > 0.0 => {
            let Some((last, ends)) = last_of_phase(options, period) else {
                return Err(usage(format!(
                    "--period {period}: the run is shorter; give a later --t-end, or a shorter \
                        period"
                )));
            };
            if ends {
                options.t_end = last;
            }
            options.record = Record::Times { every: period };
        }
        (Some(period), _) => {
            return Err(usage(format!("--period is {period}: give a time above 0")));
        }
        (None, Record::Section(_)) => {}
        // As of systems with h and fewer states.
        (None, _) if flags.model_of_many_states()?.is_some() => {
            let second = format!("{}=0", run.model.coordinates()[1]);
            options.record = Record::Section(section(&second, &run.model)?);
        }
        (None, _) => options.record = Record::Times { every: f64::INFINITY },
    }
    Ok(Some(run))
}

/// The method that the flag names.
fn method(named: Option<Named>) -> Result<Method, CliError> {
    let (name, why) = match named {
        None | Some(Named::Dopri5) => return Ok(Method::Dopri5),
        Some(Named::Radau5) => return Ok(Method::Radau5),
        Some(Named::Taylor) => return Ok(Method::Taylor),
        Some(Named::Lsoda) => return Ok(Method::Lsoda),
        Some(Named::TaylorExtended) => {
            ("taylor-extended", "switches and events are located in double precision")
        }
        Some(Named::Layered) => ("layered", "it belongs to a smoothed switch"),
    };
    Err(usage(format!(
        "--method {name}: general systems are followed by dopri5, lsoda or radau5 where they are \
            stiff, or taylor for many digits; {why}"
    )))
}

/// Filippov's motion of a system with h, plus and minus, if the flags ask for it, as the run of a
/// general one.
///
/// # Errors
/// If a flag has no effect, or a value is wrong.
pub fn filippov_run(flags: &RunFlags) -> Result<Option<GeneralRun>, CliError> {
    let spec = flags.spec(Use::Exponent)?;
    let SwitchSpec::Filippov { exit, .. } = spec.switch else { return Ok(None) };
    let exit = match exit {
        ExitRule::AtOnce { side: filippov::Side::Plus } => Side::Plus,
        ExitRule::AtOnce { side: filippov::Side::Minus } => Side::Minus,
        _ => Side::Undecided,
    };
    // The tolerances of general systems, whose states have sizes of their own, unless others are
    // given.
    let (defaults, whole) =
        (Options::default(), flags.spec.as_ref().map(|_| spec.method.tolerance));
    let options = Options {
        t_end: spec.t_end,
        start: Some(spec.start),
        rtol: whole.map(|t| t.rtol).or(flags.rtol).unwrap_or(defaults.rtol),
        atol: whole.map(|t| t.atol).or(flags.atol),
        max_step: if let StepCap::Absolute(h) = spec.method.step_cap {
            h
        } else {
            defaults.max_step
        },
        max_steps: spec.method.max_steps,
        exit,
        ..defaults
    };
    Ok(Some(GeneralRun { model: model_of(&spec.system)?, options }))
}

/// Reads "bilinear", "hull-least-norm" or "order:x,v - belt".
fn intersection(text: &str, model: &Model) -> Result<Rule, CliError> {
    let wrong = |problem: String| usage(format!("--intersection \"{text}\": {problem}"));
    let named = match text {
        "bilinear" => return Ok(Rule::Bilinear),
        "hull-least-norm" => return Ok(Rule::HullLeastNorm),
        other => other.strip_prefix("order:").ok_or_else(|| {
            wrong(
                "give bilinear, hull-least-norm, or order: and the switching functions that \
                meet, the fastest first, such as order:x,y"
                    .into(),
            )
        })?,
    };
    let (mut order, mut depth, mut from) = (Vec::new(), 0, 0);
    for (i, letter) in named.char_indices().chain([(named.len(), ',')]) {
        match letter {
            '(' => depth += 1,
            ')' => depth -= 1,
            ',' if depth <= 0 => {
                order.push(expression(named[from..i].trim(), model).map_err(&wrong)?);
                from = i + 1;
            }
            _ => {}
        }
    }
    if from <= named.len() {
        return Err(wrong("a bracket is not closed".into()));
    }
    Ok(Rule::Order(order))
}

/// Reads "x - y = 0".
fn section(text: &str, model: &Model) -> Result<Expression, CliError> {
    let wrong = |problem: &str| {
        usage(format!(
            "--section \"{text}\": {problem}; give an equation such as {}=0",
            model.coordinates()[0]
        ))
    };
    let (left, right) = text.split_once('=').ok_or_else(|| wrong("there is no \"=\""))?;
    let read = |side: &str| {
        let parsed = expression(side, model).map_err(|e| wrong(&e))?;
        if parsed.is_condition() { Err(wrong("a condition is no number")) } else { Ok(parsed) }
    };
    let (left, right) = (read(left.trim())?, read(right.trim())?);
    Ok(Expression::Sub(Box::new(left), Box::new(right)))
}

/// The error of a failed run.
pub fn failed(error: HybridError) -> CliError {
    match error {
        HybridError::Equation(_) | HybridError::Start(_) | HybridError::Bad(_) => {
            usage(error.to_string())
        }
        other => CliError::Job(JobError::Other(other.to_string())),
    }
}
