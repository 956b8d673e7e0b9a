//! `twofold orbit`: closed orbits and their stability.

use std::fmt::Write as _;
use std::path::Path;
use std::sync::Arc;

use serde_json::json;

use crate::analyse::branch::Stability;
use crate::analyse::floquet::ReturnPlane;
use crate::cli::ending;
use crate::cli::exit::part_of;
use crate::cli::flags::{RunFlags, Use};
use crate::cli::general;
use crate::cli::progress::Progress;
use crate::cli::speak::{
    Delivery, deliver, is_standard_output, state_in_words, try_delivery, with_digits,
};
use crate::cli::{CliError, Exit};
use crate::hybrid::motion::Record;
use crate::hybrid::motion::tangent::Return;
use crate::job::general::GeneralRun;
use crate::job::general_orbit::GeneralOrbit;
use crate::job::orbit::Along;
use crate::job::rest::{Rest, Stability as RestStability};
use crate::job::spec::Observation;
use crate::job::sweep::{Axis, Coordinate, Values};
use crate::job::{Answer, AnyQuestion, ClosedOrbit, Executor, JobError, Question, Stop, encode};
use crate::num::elementary::ln;

/// Find a closed orbit through a plane by Newton's method, with its period and Floquet multipliers;
/// with --along, follow it as a parameter changes, through folds, and say where it loses its
/// stability.
///
/// The motion from the start settles first (--settle), so that attracting orbits are found without
/// a guess; an orbit that repels needs a near --start and --settle 0. The discontinuous system's
/// orbits (--switch filippov) may cross the switching surface and slide on it; one that grazes it,
/// or comes to where its future is a set, has no return map, and that is said.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  \
    twofold orbit --system relay-third-order --switch filippov --section q=0\n  \
    twofold orbit --system buck --period 4e-4 --settle 0.05 --along input=20..26 --format csv \
    --out branch.csv\n  \
    twofold orbit --reading reconstructed --section y=0 --start 0.8063,0,-0.0002 --settle 0 \
    --format json")]
pub struct Arguments {
    #[command(flatten)]
    flags: RunFlags,
    /// Count crossings in which the plane's coordinate falls, not rises.
    #[arg(long, help_heading = "Orbit")]
    downward: bool,
    /// Crossings, or periods, per turn [default: as many crossings as the settled motion shows; of
    /// general systems 1].
    #[arg(long, value_name = "N", allow_negative_numbers = true, help_heading = "Orbit")]
    returns: Option<usize>,
    /// Time in which the motion settles before the search; 0: none [default: 200].
    #[arg(
        long,
        value_parser = crate::cli::flags::time,
        value_name = "T",
        allow_hyphen_values = true,
        help_heading = "Orbit"
    )]
    settle: Option<f64>,
    /// Give up on a return after this time.
    #[arg(
        long,
        value_parser = crate::cli::flags::time,
        value_name = "T",
        default_value_t = 1000.0,
        allow_hyphen_values = true,
        help_heading = "Orbit"
    )]
    longest_return: f64,
    /// Follow the orbit along a parameter of the system, or eps, from one value to another, in at
    /// least so many steps [default: 40].
    #[arg(
        long,
        value_name = "NAME=FROM..TO[:STEPS]",
        allow_hyphen_values = true,
        help_heading = "Orbit"
    )]
    along: Option<String>,
    /// Period of a general system that depends on the time, instead of --section.
    #[arg(
        long,
        value_parser = crate::cli::flags::time,
        value_name = "T",
        allow_hyphen_values = true,
        help_heading = "Orbit"
    )]
    period: Option<f64>,
    /// Output format [default: what the name of --out ends in, else text].
    #[arg(long, value_enum)]
    format: Option<Format>,
    #[command(flatten)]
    delivery: Delivery,
}

#[derive(Clone, Copy, Debug, clap::ValueEnum)]
enum Format {
    /// For people.
    Text,
    /// The orbit's crossings, or with --along a row per orbit.
    Csv,
    /// Everything.
    Json,
}

/// Most orbits of a branch.
const MOST_ORBITS: usize = 10_000;

impl Arguments {
    /// The question that the flags ask.
    ///
    /// # Errors
    /// If a flag has no effect, or a value is wrong.
    pub fn question(&self) -> Result<AnyQuestion, CliError> {
        Ok(match general::run_of(&self.flags)? {
            Some(run) => Arc::new(self.of_general(run)?),
            None => Arc::new(self.of_surfaces()?),
        })
    }

    /// The question about a system with h, plus and minus.
    fn of_surfaces(&self) -> Result<ClosedOrbit, CliError> {
        if self.period.is_some() {
            self.flags.check_system()?;
            let why = "equations with h, plus and minus do not see the time; leave it out, and \
                give --section";
            return Err(CliError::no_effect("--period", why));
        }
        let spec = self.flags.spec(Use::Orbit)?;
        let Observation::Section { coordinate, value } = spec.observe else {
            return Err(CliError::Usage(
                "a spec of an orbit has a section: make one with --section and --print-spec".into(),
            ));
        };
        let settle = self.settle.unwrap_or(200.0);
        for (flag, number, least) in [
            ("--settle", settle, "0 or more"),
            ("--longest-return", self.longest_return, "above 0"),
        ] {
            let good = number.is_finite() && (number > 0.0 || flag == "--settle" && number == 0.0);
            if !good {
                return Err(CliError::Usage(format!("{flag} is {number}: give a time {least}")));
            }
        }
        let along = self.followed(|name| name == "eps" && spec.system.parameter(name).is_none())?;
        Ok(ClosedOrbit {
            system: spec.system,
            switch: spec.switch,
            start: spec.start,
            settle,
            plane: ReturnPlane { axis: coordinate, value, upward: !self.downward },
            returns: self.returns,
            tolerance: spec.method.tolerance,
            longest_return: self.longest_return,
            along,
        })
    }

    /// The parameter to follow along; `of_switch`: whether a name is one of the switch's numbers,
    /// and not the system's.
    fn followed(&self, of_switch: impl Fn(&str) -> bool) -> Result<Option<Along>, CliError> {
        let Some(along) = self.along.as_deref().map(along).transpose()? else { return Ok(None) };
        let name = along.parameter.clone();
        let coordinate =
            if of_switch(&name) { Coordinate::Eps } else { Coordinate::Parameter(name.clone()) };
        let axis = Axis { coordinate, values: Values::Numbers(vec![along.from]) };
        match self.flags.replaced_by(&[axis]) {
            Some((flag, _)) => Err(CliError::no_effect(
                flag,
                format!("--along gives each orbit its {name}; leave it out"),
            )),
            None => Ok(Some(along)),
        }
    }

    /// The question about a general system.
    fn of_general(&self, mut run: GeneralRun) -> Result<GeneralOrbit, CliError> {
        let given = self.flags.given();
        let refused = [
            ("--downward", self.downward),
            ("--chord", given.contains(&"--chord")),
            ("--every", given.contains(&"--every")),
            ("--t-end", given.contains(&"--t-end")),
        ];
        if let Some((flag, _)) = refused.iter().find(|(_, given)| *given) {
            let why = match *flag {
                "--downward" => {
                    "a general system's orbit closes at rising crossings; for falling ones negate \
                        the section, such as --section \"-v=0\", and leave it out"
                }
                "--t-end" => {
                    "--settle and --longest-return say how long motion is followed; leave it out"
                }
                _ => "an orbit is its point, period and multipliers; leave it out",
            };
            return Err(CliError::no_effect(*flag, why));
        }
        let driven = run.model.depends_on_time();
        if self.period.is_some() && !run.model.is_driven() {
            let why = "nothing in the equations depends on the time; leave it out, and give \
                --section, or ask for rests (twofold rests)";
            return Err(CliError::no_effect("--period", why));
        }
        let after = match (self.period, &run.options.record) {
            (Some(_), Record::Section(_)) => {
                return Err(CliError::no_effect(
                    "--period",
                    "--section says where an orbit closes; leave one of the two out",
                ));
            }
            (Some(period), _) if period.is_finite() && period > 0.0 => {
                Return::Period(period * self.returns.unwrap_or(1) as f64)
            }
            (Some(period), _) => {
                return Err(CliError::Usage(format!("--period is {period}: give a time above 0")));
            }
            (None, Record::Section(_)) if driven => {
                return Err(CliError::Usage(
                    "the equations depend on the time: give their period (--period) instead of \
                        --section"
                        .into(),
                ));
            }
            (None, Record::Section(_)) => Return::Crossings(self.returns.unwrap_or(1)),
            (None, _) => {
                return Err(CliError::Usage(format!(
                    "an orbit needs a place or time to close: give --section, such as {}=0, or \
                        --period of equations that depend on the time",
                    run.model.coordinates()[0]
                )));
            }
        };
        if self.returns == Some(0) {
            return Err(CliError::Usage("--returns is 0: give 1 or more".into()));
        }
        let settle = self.settle.unwrap_or(200.0);
        if !(settle.is_finite() && settle >= 0.0) {
            return Err(CliError::Usage(format!("--settle is {settle}: give a time 0 or more")));
        }
        run.options.t_end = run.options.t_start + self.longest_return;
        let along = self.followed(|_| false)?;
        if let Some((along, text)) = along.as_ref().zip(self.along.as_deref())
            && !run.model.definition().parameters().iter().any(|p| p.name == along.parameter)
        {
            let known: Vec<&str> =
                run.model.definition().parameters().iter().map(|p| p.name.as_str()).collect();
            let known = if known.is_empty() { "none".into() } else { known.join(", ") };
            return Err(CliError::Usage(format!(
                "--along \"{text}\": the system has no parameter {}; it has {known}",
                along.parameter
            )));
        }
        Ok(GeneralOrbit { run, settle, after, along })
    }
}

pub fn run(arguments: &Arguments) -> Result<Exit, CliError> {
    if let Some(run) = general::run_of(&arguments.flags)? {
        return of_general(arguments, &arguments.of_general(run)?);
    }
    let question = arguments.of_surfaces()?;
    let out = arguments.delivery.out.as_deref();
    let format = ending::format(out, arguments.format, Format::Text)?;
    try_delivery(out)?;
    let progress = Progress::with_grace(arguments.delivery.quiet);
    progress.say_default_switch(&arguments.flags, &[]);
    let answer = match Executor::new(None, &progress).ask(&question) {
        Err(JobError::Interrupted) if progress.asked_to_stop().is_some() => {
            let exit = progress.asked_to_stop().unwrap_or(Exit::Interrupted);
            return Err(CliError::Stopped {
                said: "interrupted before an orbit was found".into(),
                exit,
            });
        }
        other => other?,
    };
    let bytes = match format {
        Format::Text => text(&question, &answer)?.into_bytes(),
        Format::Csv => {
            let about = json!({ "kind": question.kind(), "question": question.json(),
                "facts": answer.facts });
            encode::csv(answer.table("branch").unwrap_or(&answer.tables[0]), &about)
        }
        Format::Json => encode::json(&answer, &encode::about_run(&question)),
    };
    if !matches!(format, Format::Text) {
        say_branch(question.along.as_ref(), &answer, &progress);
    }
    finish(&answer, &progress, out, &bytes)
}

/// A closed orbit of a general system, through a section or over its period.
fn of_general(arguments: &Arguments, question: &GeneralOrbit) -> Result<Exit, CliError> {
    let out = arguments.delivery.out.as_deref();
    let format = ending::format(out, arguments.format, Format::Text)?;
    if let (Format::Csv, None) = (format, &question.along) {
        return Err(CliError::Usage(
            "--format csv: of one orbit of a general system give text or json".into(),
        ));
    }
    try_delivery(out)?;
    let progress = Progress::with_grace(arguments.delivery.quiet);
    progress.say_default_switch(&arguments.flags, &[]);
    let answer = match Executor::new(None, &progress).ask(question) {
        Err(JobError::Interrupted) if progress.asked_to_stop().is_some() => {
            let exit = progress.asked_to_stop().unwrap_or(Exit::Interrupted);
            return Err(CliError::Stopped {
                said: "interrupted before an orbit was found".into(),
                exit,
            });
        }
        other => other?,
    };
    let fact = |e| CliError::Job(JobError::Fact(e));
    let names = question.run.model.coordinates();
    let about = encode::about_run(question);
    if answer.facts.contains_key("rest") {
        let bytes = match format {
            Format::Json => encode::json(&answer, &about),
            Format::Csv => encode::csv(&answer.tables[0], &about),
            Format::Text => at_rest(&names, &answer.fact("rest").map_err(fact)?).into_bytes(),
        };
        return finish(&answer, &progress, out, &bytes);
    }
    let multipliers: Vec<[f64; 2]> = answer.fact("multipliers").map_err(fact)?;
    let point: Vec<f64> = answer.fact("point").map_err(fact)?;
    let (period, gap): (f64, f64) =
        (answer.fact("period").map_err(fact)?, answer.fact("gap").map_err(fact)?);
    let largest = multipliers.first().map_or(0.0, |[re, im]| (re * re + im * im).sqrt());
    // Where none is close to 1 it is not looked for.
    let error: f64 = answer.fact("multiplier_error").unwrap_or(0.0);
    let bytes = match (format, answer.table("branch")) {
        (Format::Json, _) => encode::json(&answer, &about),
        (Format::Csv, Some(branch)) => {
            let about = json!({ "kind": question.kind(), "question": question.json(),
                "facts": answer.facts });
            encode::csv(branch, &about)
        }
        _ => {
            let mut text = String::new();
            let mut line = |label: &str, what: String| {
                let _ = writeln!(text, "{label:<13} {what}");
            };
            line("period", format!("{period}"));
            line("point", state_in_words(&names, &point));
            if let Ok(mode) = answer.fact::<String>("mode") {
                line("mode", mode);
            }
            line("multipliers", complex(&multipliers, f64::NAN));
            let stability = match () {
                () if (largest - 1.0).abs() < error.max(1e-6) => {
                    "neutral: a multiplier is on the unit circle within its error"
                }
                () if largest < 1.0 => "attracts",
                () => "repels",
            };
            line("stability", stability.into());
            line("closed to", format!("{gap:.1e} of the largest state"));
            if let Ok(moved) = answer.fact::<f64>("moved") {
                let from =
                    if question.settle > 0.0 { "where the motion settled" } else { "the start" };
                let far = format!(
                    "{:.0} % of a state's size from {from}: perhaps another orbit",
                    100.0 * moved
                );
                line("lies", far);
            }
            if let Some(along) = &question.along {
                branch_lines(along, &answer, &mut line);
            }
            text.into_bytes()
        }
    };
    if !matches!(format, Format::Text) {
        say_branch(question.along.as_ref(), &answer, &progress);
    }
    finish(&answer, &progress, out, &bytes)
}

/// Says how a branch ends and where it bifurcates, for people who have its rows written to a file.
fn say_branch(along: Option<&Along>, answer: &Answer, progress: &Progress) {
    let Some(along) = along else { return };
    branch_lines(along, answer, &mut |label, what| progress.line(&format!("{label}: {what}")));
}

/// Delivers an answer; of an interrupted branch, as a part.
fn finish(
    answer: &Answer,
    progress: &Progress,
    out: Option<&Path>,
    bytes: &[u8],
) -> Result<Exit, CliError> {
    if answer.stop == Stop::Interrupted
        && let Some(exit) = progress.asked_to_stop()
    {
        let part = out.filter(|f| !is_standard_output(f)).map(part_of);
        deliver(part.as_deref(), bytes)?;
        let place = part.map_or("standard output".to_owned(), |p| p.display().to_string());
        let rows = answer.table("branch").map_or(0, |t| t.len());
        return Err(CliError::Stopped {
            said: format!("interrupted: the {rows} orbits up to there are in {place}"),
            exit,
        });
    }
    deliver(out, bytes)?;
    Ok(Exit::Fine)
}

/// Reads "alpha=0.05..0.2:40".
fn along(text: &str) -> Result<Along, CliError> {
    let wrong = |why: &str| {
        CliError::Usage(format!(
            "--along \"{text}\": {why}; give it as NAME=FROM..TO or NAME=FROM..TO:STEPS, such as \
                alpha=0.1..0.2:40"
        ))
    };
    let (name, range) = text.split_once('=').ok_or_else(|| wrong("there is no \"=\""))?;
    let (range, steps) = match range.rsplit_once(':') {
        Some((range, steps)) => {
            let steps: usize = steps
                .trim()
                .parse()
                .map_err(|_| wrong("what follows \":\" is no number of steps"))?;
            (range, steps)
        }
        None => (range, 40),
    };
    let (from, to) = range.split_once("..").ok_or_else(|| wrong("there is no \"..\""))?;
    let number = |text: &str| text.trim().parse::<f64>().ok().filter(|v| v.is_finite());
    match (number(from), number(to)) {
        (Some(from), Some(to)) if from != to && steps > 0 && steps <= MOST_ORBITS => {
            Ok(Along { parameter: name.trim().into(), from, to, steps, most: MOST_ORBITS })
        }
        (Some(_), Some(_)) => Err(wrong("two different ends and 1 to 10000 steps are needed")),
        _ => Err(wrong("its ends are not numbers")),
    }
}

/// The answer for people.
fn text(question: &ClosedOrbit, answer: &Answer) -> Result<String, CliError> {
    let fact = |e| CliError::Job(JobError::Fact(e));
    if answer.facts.contains_key("rest") {
        let rest = answer.fact("rest").map_err(fact)?;
        return Ok(at_rest(&question.system.coordinates(), &rest));
    }
    let period: f64 = answer.fact("period").map_err(fact)?;
    let point: Vec<f64> = answer.fact("point").map_err(fact)?;
    let multipliers: Vec<[f64; 2]> = answer.fact("multipliers").map_err(fact)?;
    let rate: Option<f64> = answer.fact("rate").map_err(fact)?;
    let returns: usize = answer.fact("returns").map_err(fact)?;
    let names = question.system.coordinates();
    let plane = format!("{} = {}", names[question.plane.axis], question.plane.value);
    let mut out = String::new();
    // Writing to a String cannot fail.
    let mut line = |label: &str, what: String| {
        let _ = writeln!(out, "{label:<13} {what}");
    };
    let crossings = if returns == 1 { "crossing" } else { "crossings" };
    line(
        "closed orbit",
        format!(
            "through {plane}, {returns} {}ward {crossings} per turn",
            if question.plane.upward { "up" } else { "down" }
        ),
    );
    line("period", format!("{period}"));
    line("point", state_in_words(&names, &point));
    // Where none is close to 1 it is not looked for.
    let error: f64 = answer.fact("multiplier_error").unwrap_or(0.0);
    line("multipliers", format!("{}, each +- {error:.1e}", complex(&multipliers, error)));
    line(
        "stability",
        match (answer.fact::<Stability>("stability").map_err(fact)?, rate) {
            (Stability::NotIsolated, _) => {
                "neutral: a multiplier is 1 within its error; the orbit is not isolated, or at a \
                    fold"
                    .into()
            }
            (Stability::Neutral, _) => {
                "neutral: a multiplier is on the unit circle within its error; linear terms do not \
                    decide"
                    .into()
            }
            (Stability::Stable, None) if multipliers.iter().all(|m| *m == [0.0; 2]) => {
                "attracts in finite time (all multipliers are zero)".into()
            }
            (Stability::Stable, None) => format!(
                "attracts, by more than {:.1e} per unit time: the multipliers are zero within \
                    their error",
                -ln(error) / period
            ),
            (Stability::Stable, Some(rate)) => format!(
                "attracts, by {rate:.6e} per unit time in \
                the end"
            ),
            (Stability::Unstable, rate) => format!(
                "repels, by {:.6e} per unit \
                time",
                -rate.unwrap_or(f64::NAN)
            ),
        },
    );
    if let Some(along) = &question.along {
        branch_lines(along, answer, &mut line);
    }
    Ok(out)
}

/// The branch for people.
fn branch_lines(along: &Along, answer: &Answer, line: &mut dyn FnMut(&str, String)) {
    let (Some(branch), name) = (answer.table("branch"), &along.parameter) else { return };
    let values = branch.numbers(name);
    let last = values.last().unwrap_or(&along.from);
    line("branch", format!("{} orbits, {name} = {} to {last}", values.len(), along.from));
    line("its end", ended(answer, name));
    if let Some(table) = answer.table("bifurcations") {
        for row in 0..table.len() {
            let change = table.words("change").nth(row).unwrap_or_default().to_owned();
            let (at, half) = (table.numbers(name)[row], table.numbers("uncertainty")[row]);
            line(&change, format!("at {name} = {at} +- {half:.1e}"));
        }
    }
}

fn complex(numbers: &[[f64; 2]], error: f64) -> String {
    if numbers.is_empty() {
        return "none: with one state there is no direction off the orbit".into();
    }
    let said = |m: &[f64; 2]| {
        let real = if m[0] == 0.0 { "0".to_owned() } else { with_digits(m[0], error, 9) };
        let sign = if m[1] < 0.0 { '-' } else { '+' };
        match with_digits(m[1].abs(), error, 9) {
            _ if m[1] == 0.0 => real,
            imaginary => format!("{real} {sign}{imaginary} i"),
        }
    };
    numbers.iter().map(said).collect::<Vec<_>>().join(", ")
}

/// The rest for people.
fn at_rest(names: &[&str], rest: &Rest) -> String {
    let state = state_in_words(names, &rest.state);
    let stability = match (rest.stability, rest.rate()) {
        (RestStability::Attracts, Some(rate)) => {
            format!("attracts, by {rate:.6e} per unit time in the end")
        }
        (RestStability::Attracts, None) => "attracts in finite time".into(),
        (RestStability::Repels, Some(rate)) if rate < 0.0 => {
            format!("repels, by {:.6e} per unit time", -rate)
        }
        (RestStability::Repels, _) => "repels".into(),
        (RestStability::Neutral, _) => "neutral: linear terms do not decide".into(),
        (RestStability::ToASet, _) => {
            "one of a set of rests, to which its neighbours come, each to a rest of its own".into()
        }
    };
    let numbers = if rest.eigenvalues.is_empty() {
        "none".into()
    } else {
        complex(&rest.eigenvalues, f64::NAN)
    };
    let end = match rest.stability {
        RestStability::Attracts | RestStability::ToASet => {
            "The motion comes to rest: there is no closed orbit near."
        }
        RestStability::Repels | RestStability::Neutral => {
            "The search ends at this point: no closed orbit was found. Give another --start."
        }
    };
    format!(
        "{:<13} {state}\n{:<13} {numbers}\n{:<13} {stability}\n{end}\n",
        rest.word(),
        "eigenvalues",
        "stability"
    )
}

fn ended(answer: &Answer, name: &str) -> String {
    use crate::analyse::branch::End;
    match answer.fact::<End>("end") {
        Ok(End::Reached) => "the range's other end".into(),
        Ok(End::TurnedBack) => {
            format!("it turned back and left the range of {name} where it came in")
        }
        Ok(End::Enough) => format!("{MOST_ORBITS} orbits"),
        Ok(End::Vanished) => "the orbit shrinks to a point".into(),
        Ok(End::Lost(why)) => format!("it cannot be followed further: {why}"),
        Ok(End::Interrupted) => "interrupted".into(),
        Err(e) => e.to_string(),
    }
}
