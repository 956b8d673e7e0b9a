//! `twofold run`: computes one run of any system.

use std::io::{self, IsTerminal, Write};
use std::path::Path;

use serde_json::json;

use crate::cli::ending;
use crate::cli::exit::part_of;
use crate::cli::flags::{RunFlags, Use};
use crate::cli::general;
use crate::cli::progress::Progress;
use crate::cli::speak::{
    Delivery, complain, deliver, is_standard_output, say_older_part, try_delivery,
};
use crate::cli::{CliError, Exit};
use crate::job::general::GeneralRun;
use crate::job::spec::{Method, SwitchSpec};
use crate::job::{
    self, Answer, Executor, Horizon, JobError, Question, Run, Stop, encode, simulate,
};
use crate::record::files::Growing;

/// Compute one run: its path, or with --section its crossings of a plane.
///
/// CSV is written as it is computed: a run of any length needs little memory. A flag that would
/// have no effect on the run is refused. Ctrl-C keeps what has been computed: on standard output,
/// or beside --out under the name FILE.part, with a last line that says so.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  \
    twofold run --reading reconstructed --t-end 100 --section y=0\n  \
    twofold run --switch filippov --exit random:exponential:0.5 --t-end 80 --out orbit.csv\n  \
    twofold run --system wheel --t-end 60 --format json --out wheel.json\n  \
    twofold run --system my.toml --set gain=2 --t-end 1e6 --every 10 --out long.csv\n  \
    twofold figure fig7 --only ii --reading printed --print-spec | \
        twofold run --spec - --out section.csv")]
pub struct Arguments {
    #[command(flatten)]
    flags: RunFlags,
    /// Print the run's spec as JSON and compute nothing.
    #[arg(long, conflicts_with = "format")]
    print_spec: bool,
    /// Output format [default: what the name of --out ends in, else csv].
    #[arg(long, value_enum)]
    format: Option<Format>,
    /// With taylor-extended, compute the orbit with the next precision and with another order, too,
    /// and say on standard error until when all three agree to nine digits.
    #[arg(long)]
    horizon: bool,
    #[command(flatten)]
    delivery: Delivery,
}

#[derive(Clone, Copy, Debug, clap::ValueEnum)]
enum Format {
    /// A line of column names, a row per point, and the run's record in a last line that begins
    /// with #.
    Csv,
    /// Spec, statistics, columns and rows.
    Json,
}

/// Refuses to pour onto a terminal a run that no flag describes.
fn names_a_run(arguments: &Arguments, terminal: bool) -> Result<(), CliError> {
    let nothing = arguments.flags.first_given().is_none()
        && arguments.delivery.out.is_none()
        && !arguments.print_spec;
    if terminal && nothing {
        return Err(CliError::Usage(
            "name a system: twofold run --system FILE (twofold new my.toml writes one, twofold new \
                --list names those that are built in)"
                .into(),
        ));
    }
    Ok(())
}

pub fn run(arguments: &Arguments) -> Result<Exit, CliError> {
    names_a_run(arguments, io::stdout().is_terminal())?;
    if let Some(run) = general::run_of(&arguments.flags)? {
        return general_run(arguments, &run);
    }
    let spec = arguments.flags.spec(Use::Any)?;
    let out = arguments.delivery.out.as_deref();
    // A spec is JSON whatever the run's numbers would be.
    let format = if arguments.print_spec {
        Format::Json
    } else {
        ending::format(out, arguments.format, Format::Csv)?
    };
    try_delivery(out)?;
    if arguments.print_spec {
        let mut text = serde_json::to_vec_pretty(&spec).expect("specs are plain data");
        text.push(b'\n');
        deliver(out, &text)?;
        return Ok(Exit::Fine);
    }
    if arguments.horizon && spec.method.name != Method::TaylorExtended {
        let why = "--horizon: other methods' errors are those of their tolerance; leave it out, or \
            use --method taylor-extended";
        return Err(CliError::Usage(why.into()));
    }
    if arguments.horizon
        && matches!(spec.switch, SwitchSpec::Delayed { .. } | SwitchSpec::Relay { .. })
    {
        let why = "--horizon: it compares with the next precision, and such a switch is followed \
            with 106 bits at most; leave it out, or compare two tolerances";
        return Err(CliError::Usage(why.into()));
    }
    let progress = Progress::with_grace(arguments.delivery.quiet);
    progress.say_default_switch(&arguments.flags, &[]);
    let run = Run(spec);
    let exit = record(&run, format, out, &progress)?;
    if arguments.horizon {
        say_horizon(&run, &progress)?;
    }
    Ok(exit)
}

/// Follows a general system and delivers its rows as they come.
fn general_run(arguments: &Arguments, run: &GeneralRun) -> Result<Exit, CliError> {
    let out = arguments.delivery.out.as_deref();
    for (flag, given) in [("--print-spec", arguments.print_spec), ("--horizon", arguments.horizon)]
    {
        if given {
            return Err(CliError::no_effect(
                flag,
                "a general system's file is its own description; leave it out",
            ));
        }
    }
    let format = ending::format(out, arguments.format, Format::Csv)?;
    try_delivery(out)?;
    let progress = Progress::with_grace(arguments.delivery.quiet);
    progress.say_default_switch(&arguments.flags, &[]);
    let title = run.model.definition().title();
    if let Format::Json = format {
        let answer = Executor::new(None, &progress).ask(run)?;
        let bytes = encode::json(&answer, &run.about());
        let stopped =
            if answer.stop == Stop::Interrupted { progress.asked_to_stop() } else { None };
        return deliver_whole_or_part(&answer, &bytes, out, stopped)
            .map(|()| said_how_it_ended(run, &answer));
    }
    let monitor = job::Progress::begin(
        &progress,
        if title.is_empty() { "run" } else { title },
        run.options.t_end,
    );
    let reached = |t: f64| {
        let _ = monitor.reached(t);
        progress.asked_to_stop().is_none()
    };
    let file = out.filter(|f| !is_standard_output(f));
    let mut rows = match file {
        Some(file) => Rows::File(Growing::begin(file)?),
        None => Rows::Output,
    };
    let (mut failed, mut count) = (None, 0_u64);
    let mut csv = encode::CsvOfRun::new(run.about());
    let found = run.stream(
        &mut |part| {
            // A run that fails before its first row writes nothing.
            if !part.is_empty() {
                failed = rows.append(&csv.rows(part)).err();
            }
            count += part.len() as u64;
            failed.is_none()
        },
        &reached,
    );
    monitor.done(&if found.is_ok() { format!("{count} rows") } else { "failed".into() });
    match failed {
        Some(CliError::Output(e)) if e.kind() == io::ErrorKind::BrokenPipe => {
            return Ok(Exit::Fine);
        }
        Some(error) => return Err(error),
        None => {}
    }
    let (stop, answer, error) = match found {
        Ok(answer) => (answer.stop, Some(answer), None),
        Err(error) => (Stop::Failed, None, Some(general::failed(error))),
    };
    if count == 0 {
        if let Some(error) = error {
            return Err(error);
        }
        rows.append(&csv.rows(&run.table()))?;
    }
    rows.append_last(&csv.tail())?;
    let whole = matches!(stop, Stop::Finished | Stop::Found);
    if !whole {
        rows.append_last(&encode::cut_short(stop))?;
    }
    let part = file.filter(|_| !whole).map(part_of);
    if let Rows::File(rows) = rows {
        rows.finish(part.as_deref())?;
    }
    if let Some(file) = file.filter(|_| whole) {
        say_older_part(file);
    }
    let place = part.as_deref().map_or("standard output".to_owned(), |p| p.display().to_string());
    match (error, answer) {
        (Some(error), _) => {
            let said = format!("{error} (the {count} rows up to there are in {place})");
            Err(CliError::Stopped { said, exit: error.exit() })
        }
        (None, Some(answer)) if answer.stop == Stop::Interrupted => {
            let exit = progress.asked_to_stop().unwrap_or(Exit::Interrupted);
            let t: f64 = answer.fact("t").map_err(JobError::from)?;
            Err(stopped_at(t, count, part.as_deref(), exit))
        }
        (None, answer) => Ok(answer.map_or(Exit::Fine, |a| said_how_it_ended(run, &a))),
    }
}

/// Says why a run ended before its time, if it did by what its file says.
pub(super) fn said_how_it_ended(run: &GeneralRun, answer: &Answer) -> Exit {
    if let Some(zeno) = answer.facts.get("zeno") {
        let name = zeno["event"].as_str().unwrap_or_default();
        // Motion can rest on the surface of an event that sets a state; a mode has none.
        let mut events = run.model.definition().events().iter();
        let sets = events.any(|e| e.name == name && e.mode.is_none() && !e.set.is_empty());
        let known = match zeno["error"].as_f64() {
            Some(error) => format!("error at most {error:.1e}"),
            None => "its error is not known; a smaller --rtol may tell".to_owned(),
        };
        complain(&format!(
            "{name} happens infinitely often before t = {} ({known}), where the run ends{}",
            zeno["t"],
            if sets { "; after_zeno = \"stick\" lets it rest there" } else { "" },
        ));
    }
    if let Some(event) = answer.facts.get("stopped_by") {
        complain(&format!(
            "{} ends the run at t = {}",
            event.as_str().unwrap_or_default(),
            answer.facts["t"]
        ));
    }
    Exit::Fine
}

/// Largest difference between orbits that agree: nine digits.
const AGREEMENT: f64 = 1e-9;

fn say_horizon(run: &Run, progress: &Progress) -> Result<(), CliError> {
    let answer =
        Executor::new(None, progress).ask(&Horizon { run: run.0.clone(), within: AGREEMENT })?;
    let fact = |name: &str| answer.fact::<f64>(name).map_err(JobError::from);
    let whole = answer.stop == Stop::Finished && fact("horizon")? >= run.0.t_end;
    complain(&format!(
        "{} bits and {}, order {} and {} agree to {AGREEMENT:e} until t = {}{}",
        fact("precision")?,
        fact("other_precision")?,
        fact("order")?,
        fact("other_order")?,
        fact("horizon")?,
        if whole { ", the end" } else { "; later digits are rounding errors" }
    ));
    Ok(())
}

/// Computes the run and delivers it.
fn record(
    run: &Run,
    format: Format,
    out: Option<&Path>,
    progress: &Progress,
) -> Result<Exit, CliError> {
    let funnel = matches!(run.0.switch, SwitchSpec::Filippov { funnel: Some(_), .. });
    if let (Format::Csv, false) = (format, funnel) {
        return stream(run, out, progress);
    }
    let answer = Executor::new(None, progress).ask(run)?;
    let about = json!({ "kind": run.kind(), "question": run.json(), "stop": answer.stop });
    let bytes = match format {
        Format::Csv => encode::csv_of_run(run, &answer),
        Format::Json => encode::json(&answer, &about),
    };
    let stopped = if answer.stop == Stop::Interrupted { progress.asked_to_stop() } else { None };
    deliver_whole_or_part(&answer, &bytes, out, stopped).map(|()| Exit::Fine)
}

/// Delivers an answer; one whose run was stopped under another name, and as an error.
fn deliver_whole_or_part(
    answer: &Answer,
    bytes: &[u8],
    out: Option<&Path>,
    stopped: Option<Exit>,
) -> Result<(), CliError> {
    let Some(exit) = stopped else { return deliver(out, bytes) };
    let part = out.filter(|f| !is_standard_output(f)).map(part_of);
    deliver(part.as_deref(), bytes)?;
    let t: f64 = answer.fact("t").map_err(JobError::from)?;
    Err(stopped_at(t, answer.rows() as u64, part.as_deref(), exit))
}

fn stopped_at(t: f64, rows: u64, part: Option<&Path>, exit: Exit) -> CliError {
    let place = part.map_or("standard output".to_owned(), |p| p.display().to_string());
    CliError::Stopped {
        said: format!("interrupted at t = {t}: the {rows} rows up to there are in {place}"),
        exit,
    }
}

/// Destination of rows as they come.
enum Rows {
    File(Growing),
    Output,
}

impl Rows {
    fn append(&mut self, bytes: &[u8]) -> Result<(), CliError> {
        match self {
            Rows::File(file) => Ok(file.append(bytes)?),
            // A reader that went away wants no more.
            Rows::Output => Ok(io::stdout().lock().write_all(bytes)?),
        }
    }

    /// Appends what no reader waits for.
    fn append_last(&mut self, bytes: &[u8]) -> Result<(), CliError> {
        match self.append(bytes) {
            Err(CliError::Output(e)) if e.kind() == io::ErrorKind::BrokenPipe => Ok(()),
            other => other,
        }
    }
}

/// CSV as it is computed: memory stays flat, and who reads standard output sees rows as they come.
/// Whether the run came to its end is known when it has: a last line says if it did not.
fn stream(run: &Run, out: Option<&Path>, progress: &Progress) -> Result<Exit, CliError> {
    let file = out.filter(|f| !is_standard_output(f));
    let mut rows = match file {
        Some(file) => Rows::File(Growing::begin(file)?),
        None => Rows::Output,
    };
    let mut csv = encode::CsvOfRun::new(encode::about_run(run));
    let (mut failed, mut count) = (None, 0);
    let monitor = job::Progress::begin(progress, &run.label(), run.extent());
    let found = simulate::stream(
        &run.0,
        &mut |table| {
            count += table.len();
            failed = rows.append(&csv.rows(table)).err();
            failed.is_none()
        },
        &*monitor,
    );
    monitor.done(
        &found.as_ref().map_or("failed".to_owned(), |f| {
            format!("{} steps, {} rows", f.statistics.steps, f.rows)
        }),
    );
    match failed {
        Some(CliError::Output(e)) if e.kind() == io::ErrorKind::BrokenPipe => {
            return Ok(Exit::Fine);
        }
        Some(error) => return Err(error),
        None => {}
    }
    let found = match found {
        Ok(found) => found,
        Err(error) if count == 0 => return Err(error.into()),
        Err(error) => {
            rows.append_last(&csv.tail())?;
            rows.append_last(&encode::cut_short(Stop::Failed))?;
            let part = file.map(part_of);
            if let Rows::File(file) = rows {
                file.finish(part.as_deref())?;
            }
            let place = part.map_or("standard output".to_owned(), |p| p.display().to_string());
            let error = CliError::from(error);
            return Err(CliError::Stopped {
                said: format!("{error} (the {count} rows up to there are in {place})"),
                exit: error.exit(),
            });
        }
    };
    rows.append_last(&csv.tail())?;
    let stopped = if found.stop == Stop::Interrupted { progress.asked_to_stop() } else { None };
    let Some(exit) = stopped else {
        if let Rows::File(rows) = rows {
            rows.finish(None)?;
        }
        if let Some(file) = file {
            say_older_part(file);
        }
        return Ok(Exit::Fine);
    };
    rows.append_last(&encode::cut_short(found.stop))?;
    let part = file.map(part_of);
    if let Rows::File(file) = rows {
        file.finish(part.as_deref())?;
    }
    Err(stopped_at(found.t, found.rows, part.as_deref(), exit))
}

#[cfg(test)]
mod tests {
    use clap::Parser;

    use super::*;

    #[derive(Parser)]
    struct Line {
        #[command(flatten)]
        arguments: Arguments,
    }

    #[test]
    fn a_terminal_gets_no_run_that_no_flag_describes() {
        let asked = |line: &str, terminal: bool| {
            let line = Line::parse_from(std::iter::once("run").chain(line.split_whitespace()));
            names_a_run(&line.arguments, terminal)
        };
        let refused = asked("", true).unwrap_err();
        assert_eq!(refused.exit(), Exit::Usage);
        assert!(refused.to_string().starts_with("name a system: "), "{refused}");
        for (line, terminal) in
            [("", false), ("--out a.csv", true), ("--t-end 1", true), ("--print-spec", true)]
        {
            assert!(asked(line, terminal).is_ok(), "{line}");
        }
    }
}
