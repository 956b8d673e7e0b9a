//! `twofold sensitivities`: how the end of a run changes with its start and its parameters.

use std::fmt::Write as _;

use crate::cli::flags::RunFlags;
use crate::cli::speak::{Delivery, deliver, try_delivery};
use crate::cli::{CliError, Exit, ending, general};
use crate::hybrid::motion::sensitivity::parameters;
use crate::job::general::GeneralSensitivities;
use crate::job::{Executor, JobError, encode};

/// Derivatives of the state at the end of a run by its start and its parameters, through every
/// switch, slide and reset on the way.
///
/// For general systems, and with --switch filippov for those with h, plus and minus. Parameters are
/// varied with the start held fixed. Where a surface is only touched, two are met at one moment, or
/// impacts accumulate there is no derivative; that is said with time and state.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  \
    twofold sensitivities --system bouncing-ball --t-end 1 --by g,r\n  \
    twofold sensitivities --system stick-slip --switch filippov --t-end 20 --format json")]
pub struct Arguments {
    #[command(flatten)]
    flags: RunFlags,
    /// The parameters, comma-separated [default: all that set no times of events].
    #[arg(long, value_name = "NAME,...", value_delimiter = ',', help_heading = "Sensitivities")]
    by: Option<Vec<String>>,
    /// Output format [default: what the name of --out ends in, else text].
    #[arg(long, value_enum)]
    format: Option<Format>,
    #[command(flatten)]
    delivery: Delivery,
}

#[derive(Clone, Copy, Debug, clap::ValueEnum)]
enum Format {
    /// A table for people.
    Text,
    /// A row for each state.
    Csv,
    /// Everything.
    Json,
}

impl Arguments {
    /// The question that the flags ask.
    ///
    /// # Errors
    /// If a flag has no effect, or a value is wrong.
    pub fn question(&self) -> Result<GeneralSensitivities, CliError> {
        let run = match general::run_of(&self.flags)? {
            Some(run) => {
                for flag in ["--section", "--chord", "--every"] {
                    if self.flags.given().contains(&flag) {
                        let why = "sensitivities are those of the state at --t-end; leave it out";
                        return Err(CliError::no_effect(flag, why));
                    }
                }
                run
            }
            None => general::filippov_run(&self.flags)?.ok_or_else(|| {
                CliError::Usage(
                    "sensitivities are computed of general systems and of Filippov motion; give \
                        --switch filippov"
                        .into(),
                )
            })?,
        };
        let by = self.by.clone().unwrap_or_else(|| parameters(&run.model));
        Ok(GeneralSensitivities { run, by })
    }
}

const ONE_SIDED: &str = "- the start lies on a switching surface: the derivatives from its two \
    sides differ; start beside it\n";

pub fn run(arguments: &Arguments) -> Result<Exit, CliError> {
    let question = arguments.question()?;
    let out = arguments.delivery.out.as_deref();
    let format = ending::format(out, arguments.format, Format::Text)?;
    try_delivery(out)?;
    let answer = Executor::quiet().ask(&question)?;
    let table = answer.table("sensitivities").ok_or(CliError::Job(JobError::Interrupted))?;
    let about = encode::about_run(&question);
    let bytes = match format {
        Format::Json => encode::json(&answer, &about),
        Format::Csv => encode::csv(table, &about),
        Format::Text => {
            let t: f64 = answer.fact("t").map_err(JobError::from)?;
            let numbers: Vec<(&str, &[f64])> =
                table.columns[1..].iter().map(|c| (&*c.name, table.numbers(&c.name))).collect();
            let mut text = format!("at t = {t}\n{:<10}", "state");
            numbers.iter().for_each(|(name, _)| {
                let _ = write!(text, " {name:>14}");
            });
            text.push('\n');
            for (row, state) in table.words("state").enumerate() {
                let _ = write!(text, "{state:<10}");
                numbers.iter().for_each(|(_, column)| {
                    let _ = match column[row] {
                        number if number.is_nan() => write!(text, " {:>14}", "-"),
                        number => write!(text, " {number:>14.6e}"),
                    };
                });
                text.push('\n');
            }
            if numbers.iter().any(|(_, column)| column.iter().any(|v| v.is_nan())) {
                text.push_str(ONE_SIDED);
            }
            text.into_bytes()
        }
    };
    deliver(out, &bytes)?;
    Ok(Exit::Fine)
}
