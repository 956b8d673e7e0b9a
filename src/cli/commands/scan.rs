//! `twofold scan`: an orbit diagram along one setting, or a map of endings over two.

use std::path::PathBuf;

use crate::cli::ending;
use crate::cli::exit::part_of;
use crate::cli::flags::{RunFlags, Use};
use crate::cli::general;
use crate::cli::progress::Progress;
use crate::cli::speak::{Delivery, complain, deliver, is_standard_output, try_delivery};
use crate::cli::{CliError, Exit, in_pool};
use crate::draw::scan::{self, Scanned};
use crate::hybrid::Model;
use crate::hybrid::motion::Record;
use crate::job::scan::{Follow, Scan};
use crate::job::spec::Observation;
use crate::job::sweep::{Axis, Base, Sweep, SweepError};
use crate::job::table::{Entry, Table};
use crate::job::{self, encode};
use crate::record::Hash;
use crate::render::markup;
use crate::system::Expression;

use super::plot::{Format, general_small_print, small_print, write};

/// Vary one or two settings of a run and see what it does: over one, an orbit diagram (the late
/// crossings of the plane for each value); over two, such as a plane of starts, a map of what each
/// run ends on.
///
/// --follow begins each run where the one before ended, so that an attractor is followed up or down
/// for as long as it attracts. Endings are the outcomes of `twofold sweep`: rest, period-K,
/// irregular and so on. Runs that end on the same attractor have the same number. For more
/// settings, statistics and resuming see there. Ctrl-C keeps the rows that are finished: on
/// standard output, or beside --out under the name FILE.part.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  \
    twofold scan --system buck --period 4e-4 --over params.input=20..32:60 --t-end 0.08 --follow \
    both --plot buck.png --out buck.csv\n  \
    twofold scan --system chua --section y=0 --over start.x=-3..3:40 --over start.z=-6..6:40 \
    --t-end 200 --plot basins.png --out basins.csv")]
pub struct Arguments {
    #[command(flatten)]
    flags: RunFlags,
    /// A setting and its values: params.NAME, start.NAME, shift.NAME, eps ... =FROM..TO:COUNT,
    /// FROM..TO:log:COUNT or a,b,c; once or twice.
    #[arg(
        long,
        value_parser = crate::cli::flags::axis,
        value_name = "NAME=VALUES",
        required = true,
        allow_hyphen_values = true,
        help_heading = "Scan"
    )]
    over: Vec<Axis>,
    /// Over two settings, attractors this near (as a share of the largest number in any start or
    /// attractor) have one number [default: 0.01].
    #[arg(
        long,
        value_parser = crate::cli::flags::plain,
        value_name = "SHARE",
        allow_hyphen_values = true,
        help_heading = "Scan"
    )]
    alike: Option<f64>,
    /// Period of a general system that depends on the time: its states at the multiples of it,
    /// instead of a --section.
    #[arg(
        long,
        value_parser = crate::cli::flags::time,
        value_name = "T",
        allow_hyphen_values = true,
        help_heading = "Scan"
    )]
    period: Option<f64>,
    /// Over one setting, begin each run where that of the value below or above ended; both: up,
    /// then down. Not for switches with a memory.
    #[arg(long, value_enum, help_heading = "Scan")]
    follow: Option<Direction>,
    /// Draw the picture into this file (.png, .svg or .pdf).
    #[arg(long, value_name = "FILE", help_heading = "Scan")]
    plot: Option<PathBuf>,
    /// The state on the diagram's vertical axis, over one setting [default: the first one that is
    /// not the plane's].
    #[arg(long, value_name = "STATE", help_heading = "Scan")]
    show: Option<String>,
    /// Threads; 0 is one per core.
    #[arg(long, value_name = "N", default_value_t = 0)]
    threads: usize,
    #[command(flatten)]
    delivery: Delivery,
}

/// Format of a scan's rows.
#[derive(Clone, Copy, Debug, clap::ValueEnum)]
enum Rows {
    Csv,
}

#[derive(Clone, Copy, Debug, clap::ValueEnum)]
enum Direction {
    /// From the lowest value to the highest.
    Up,
    /// From the highest to the lowest.
    Down,
    /// Up, and down.
    Both,
}

/// Title, shown state, small print, method and hash of a diagram.
struct Drawn {
    title: String,
    /// The state on the vertical axis of an orbit diagram.
    shown: Option<String>,
    footer: Vec<String>,
    method: &'static str,
    hash: Hash,
}

impl Arguments {
    /// The scan that is asked for.
    ///
    /// # Errors
    /// If a flag has no effect, or a value is wrong.
    pub fn scan(&self) -> Result<Scan, CliError> {
        Ok(self.prepared()?.0)
    }

    fn prepared(&self) -> Result<(Scan, Drawn), CliError> {
        let usage = |text: String| Err(CliError::Usage(text));
        if let Some((flag, axis)) = self.flags.replaced_by(&self.over) {
            return Err(CliError::no_effect(
                flag,
                format!("--over {axis} gives every run its own; leave one of the two out"),
            ));
        }
        let two = match self.over.len() {
            1 => false,
            2 => true,
            n => {
                return usage(format!(
                    "--over is given {n} times: once for an orbit diagram, twice for a map; \
                        `twofold sweep` takes more"
                ));
            }
        };
        let alike = self.alike.unwrap_or(1e-2);
        if !two && self.alike.is_some() {
            return Err(CliError::no_effect(
                "--alike",
                "it says which attractors of a map count as one, and an orbit diagram compares \
                    none; leave it out, or give --over twice",
            ));
        }
        if !(alike > 0.0 && alike.is_finite()) {
            return usage(format!("--alike is {alike}: give a number above zero, such as 0.01"));
        }
        let over = |e: String| CliError::Usage(format!("--over: {e}"));
        let follow = self.follow.map(|direction| match direction {
            Direction::Up => Follow::Up,
            Direction::Down => Follow::Down,
            Direction::Both => Follow::Both,
        });
        let (base, title, small_print, fixed, method) =
            match general::looked_at(&self.flags, self.period)? {
                Some(run) => {
                    let options = &run.options;
                    match &options.record {
                        Record::Section(_)
                            if self.follow.is_some() && run.model.depends_on_time() =>
                        {
                            return usage(
                            "--follow: the equations depend on the time, and the next run begins \
                                at --t-start again: give their period (--period) instead of \
                                --section".into(),
                        );
                        }
                        Record::Section(section) if is_one_point(&run.model, section) => {
                            return usage(ONE_STATE.into());
                        }
                        Record::Times { every } if every.is_infinite() => {
                            let states = run.model.coordinates();
                            if states.len() == 1 {
                                return usage(ONE_STATE.into());
                            }
                            return usage(format!(
                                "a scan needs a place or time to look at: give --section, such as \
                                {}=0, or --period of equations that depend on the time",
                                states[0]
                            ));
                        }
                        _ => {}
                    }
                    let left =
                        self.flags.section.as_deref().and_then(|text| text.split('=').next());
                    let fixed = run
                        .model
                        .coordinates()
                        .iter()
                        .position(|n| left.is_some_and(|s| s.trim() == *n));
                    let (title, print) = (
                        run.model.definition().title().to_owned(),
                        vec![general_small_print(&run, run.options.t_end)],
                    );
                    let method = options.method.name();
                    (Base::from(run), title, print, fixed, method)
                }
                None => {
                    let spec = self.flags.spec(Use::Crossings)?;
                    if spec.system.dimension() == 1 {
                        return usage(ONE_STATE.into());
                    }
                    let fixed = match spec.observe {
                        Observation::Section { coordinate, .. } => Some(coordinate),
                        _ => None,
                    };
                    let (title, method) =
                        (spec.system.definition().title().to_owned(), spec.method.name.name());
                    let print = small_print(&spec);
                    (Base::from(spec), title, print, fixed, method)
                }
            };
        if self.over.iter().any(Axis::is_random) {
            return usage(
                "--over FROM..TO without a count is drawn at random, which `twofold sweep` does; \
                    give FROM..TO:COUNT"
                    .into(),
            );
        }
        let shown = self.shown(&base.states(), fixed)?;
        let sweep = Sweep::new(base, self.over.clone(), None).map_err(|e| match e {
            SweepError::Period(why) => CliError::Usage(why),
            other => over(other.to_string()),
        })?;
        let mut drawn = Drawn { title, shown, footer: small_print, method, hash: sweep.hash() };
        let scan = Scan::new(sweep, follow, alike).map_err(over)?;
        if self.plot.is_some()
            && two
            && !scan
                .axes()
                .iter()
                .all(|a| matches!(a.value(0, 0.5), Entry::Number(_) | Entry::Integer(_)))
        {
            return usage("--plot: a map is drawn over numbers".into());
        }
        let names: Vec<String> =
            scan.axes().iter().map(|a| markup::literal(&a.to_string())).collect();
        let varied: Vec<String> =
            scan.axes().iter().map(|axis| Scanned::from(axis).title).collect();
        drawn.footer = drawn.footer.iter().filter_map(|line| without(line, &varied)).collect();
        drawn.footer.insert(0, format!("over {}", names.join(", ")));
        Ok((scan, drawn))
    }

    /// The state of the vertical axis; `fixed` is the section's.
    fn shown(&self, names: &[&str], fixed: Option<usize>) -> Result<Option<String>, CliError> {
        match &self.show {
            Some(_) if self.over.len() > 1 || self.plot.is_none() => Err(CliError::no_effect(
                "--show",
                "it names the vertical axis of an orbit diagram's picture; leave it out, or give \
                    --plot and one --over",
            )),
            Some(name) if names.contains(&name.as_str()) => Ok(Some(name.clone())),
            Some(name) => Err(CliError::Usage(format!(
                "--show {name}: there is no such state; choose among {}",
                names.join(", ")
            ))),
            None => {
                let first = (0..names.len()).find(|i| Some(*i) != fixed).unwrap_or(0);
                Ok(Some(names[first].to_owned()))
            }
        }
    }
}

pub fn run(arguments: &Arguments) -> Result<Exit, CliError> {
    let (scan, drawn) = arguments.prepared()?;
    let format = arguments.plot.as_deref().map(|file| Format::of(file, None)).transpose()?;
    let out = arguments.delivery.out.as_deref();
    let Rows::Csv = ending::format(out, None, Rows::Csv)?;
    try_delivery(out)?;
    if let Some(file) = &arguments.plot {
        try_delivery(Some(file))?;
    }
    let progress = Progress::with_grace(arguments.delivery.quiet);
    progress.say_default_switch(&arguments.flags, &arguments.over);
    let runs = scan.runs();
    let monitor = job::Progress::begin(&progress, "scan", runs as f64);
    let found = in_pool(arguments.threads, || scan.compute(&*monitor))?;
    monitor.done(&format!("{} of {runs} runs", found.finished));
    let bytes = encode::csv(&found.table, &scan.about());
    if found.finished < runs
        && let Some(exit) = progress.asked_to_stop()
    {
        let part = out.filter(|f| !is_standard_output(f)).map(part_of);
        deliver(part.as_deref(), &bytes)?;
        let place = part.map_or("standard output".to_owned(), |p| p.display().to_string());
        let said = format!(
            "interrupted: {} of {runs} runs are finished, their rows are in {place}",
            found.finished
        );
        return Err(CliError::Stopped { said, exit });
    }
    deliver(out, &bytes)?;
    if let (Some(file), Some(format)) = (&arguments.plot, format) {
        write(&picture(&scan, &drawn, &found.table)?, file, format)?;
    }
    match found.first_error {
        None => Ok(Exit::Fine),
        Some(error) => {
            complain(&format!("error: {} of {runs} runs failed; the first: {error}", found.failed));
            Ok(Exit::Failed)
        }
    }
}

const ONE_STATE: &str = "a scan of one state needs a time to look at, since at a section by the \
    state itself it has one value: give --period (any, of equations that do not depend on the \
    time), or --section with a function of the time, such as sin(t)=0; a closed orbit's period is \
    followed by twofold orbit --along";

/// Whether a section of this system says what its one state is.
fn is_one_point(model: &Model, section: &Expression) -> bool {
    let parameters = model.definition().parameters().iter().map(|p| p.name.as_str());
    let still: Vec<&str> = model.coordinates().into_iter().chain(parameters).collect();
    model.coordinates().len() == 1 && section.names().iter().all(|name| still.contains(name))
}

/// A line of "name = value, name = value" without the values that every run of the scan has its own
/// of; `None` if nothing is left.
fn without(line: &str, varied: &[String]) -> Option<String> {
    let is_fixed = |part: &&str| {
        part.split_once(" = ").is_none_or(|(name, _)| !varied.iter().any(|v| v == name))
    };
    let fixed: Vec<&str> = line.split(", ").filter(is_fixed).collect();
    (!fixed.is_empty()).then(|| fixed.join(", "))
}

fn picture(scan: &Scan, drawn: &Drawn, table: &Table) -> Result<crate::render::Sheet, CliError> {
    let axes: Vec<Scanned> = scan.axes().iter().map(Scanned::from).collect();
    let mut sheet = if scan.is_map() {
        scan::map(&drawn.title, [&axes[0], &axes[1]], table).map_err(CliError::Usage)?
    } else {
        let value =
            |row: usize| table.column(&axes[0].column).map_or(f64::NAN, |c| c.get(row).value());
        let heights = drawn.shown.as_deref().map_or(&[][..], |s| table.numbers(s));
        let ways = table
            .column("follow")
            .map(|c| (0..table.len()).map(|row| c.get(row).word().to_owned()).collect::<Vec<_>>());
        let points = |way: &str| -> Vec<[f64; 2]> {
            let of = |row: &usize| ways.as_ref().is_none_or(|w| way.is_empty() || w[*row] == way);
            heights
                .iter()
                .enumerate()
                .filter(|(row, _)| of(row))
                .map(|(row, y)| [value(row), *y])
                .collect()
        };
        let series = match scan.follow() {
            Some(Follow::Both) => vec![("upwards", points("up")), ("downwards", points("down"))],
            _ => vec![("", points(""))],
        };
        scan::diagram(
            &drawn.title,
            &axes[0],
            &drawn.shown.as_deref().map_or(String::new(), markup::name),
            series,
        )
    };
    sheet.footer.clone_from(&drawn.footer);
    let sheet = sheet
        .provenance("Software", concat!("twofold ", env!("CARGO_PKG_VERSION")))
        .provenance("Picture", if scan.is_map() { "scan-map" } else { "scan-diagram" })
        .provenance("Reading", "none")
        .provenance("Method", drawn.method)
        .provenance("Spec-SHA256", drawn.hash.as_str())
        .provenance("Data-SHA256", Hash::of(&encode::bits(std::slice::from_ref(table))).as_str());
    Ok(sheet)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn small_print_says_nothing_of_what_is_varied() {
        let varied = ["*α*".to_owned(), "*ε*".to_owned()];
        assert_eq!(
            without("*α* = 9, *β* = 14, *t* = 0 … 5", &varied).as_deref(),
            Some("*β* = 14, *t* = 0 … 5")
        );
        assert_eq!(
            without("tanh smoothing, *ε* = 10^{-3}", &varied).as_deref(),
            Some("tanh smoothing")
        );
        assert_eq!(without("*α* = 9", &varied), None);
        assert_eq!(without("lsoda", &varied).as_deref(), Some("lsoda"));
    }
}
