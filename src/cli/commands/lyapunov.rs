//! `twofold lyapunov`: the largest Lyapunov exponent of any system.

use std::sync::Arc;

use crate::analyse::lyapunov::{Exponent, LyapunovOptions, Sign};
use crate::cli::ending;
use crate::cli::flags::{RunFlags, Use};
use crate::cli::general;
use crate::cli::progress::Progress;
use crate::cli::speak::{Delivery, deliver, try_delivery, with_error};
use crate::cli::{self, CliError};
use crate::integrate::StepCap;
use crate::job::general::{GeneralExponents, GeneralRun, MeanRate};
use crate::job::{AnyQuestion, Executor, JobError, LargestExponent, Stop, encode};

/// The largest Lyapunov exponent of the orbit from the start, with its 95 % interval: the mean rate
/// at which a tangent vector grows. Of Filippov motion and of general systems all exponents.
///
/// Above zero: neighbours part exponentially. Zero in the interval: a closed orbit, a torus, or
/// growth that is not exponential. Below: a rest. The interval holds the scatter of averages over
/// blocks of the orbit, what growth like a power of time adds, and the method's own errors. It
/// knows only what the orbit has seen: an orbit that changes its ways once in a long while has a
/// larger one.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  \
    twofold lyapunov --system chua --t-end 5000\n  \
    twofold lyapunov --reading reconstructed --switch hysteretic --t-end 2000 --format json\n  \
    twofold lyapunov --system stick-slip --switch filippov\n  \
    twofold lyapunov --system my.toml --set gain=2 --transient 500")]
pub struct Arguments {
    #[command(flatten)]
    flags: RunFlags,
    /// Time before averaging begins, in which the orbit settles and the vector turns into the
    /// fastest direction [default: a tenth of --t-end].
    #[arg(
        long,
        value_parser = crate::cli::flags::time,
        value_name = "T",
        allow_hyphen_values = true,
        help_heading = "Exponent"
    )]
    transient: Option<f64>,
    /// Output format [default: what the name of --out ends in, else text].
    #[arg(long, value_enum)]
    format: Option<Format>,
    #[command(flatten)]
    delivery: Delivery,
}

#[derive(Clone, Copy, Debug, clap::ValueEnum)]
enum Format {
    /// A line for people.
    Text,
    /// Everything.
    Json,
}

impl Arguments {
    /// The question that the flags ask.
    ///
    /// # Errors
    /// If a flag has no effect, or a value is wrong.
    pub fn question(&self) -> Result<AnyQuestion, CliError> {
        Ok(match self.all_exponents()? {
            Some(question) => Arc::new(question),
            None => Arc::new(self.of_surfaces()?),
        })
    }

    /// The question about a motion that is followed from switch to switch: a general system, or
    /// Filippov's motion.
    fn all_exponents(&self) -> Result<Option<GeneralExponents>, CliError> {
        if let Some(run) = general::run_of(&self.flags)? {
            return Ok(Some(self.of_general(run)?));
        }
        let Some(run) = general::filippov_run(&self.flags)? else { return Ok(None) };
        Ok(Some(self.averaged(run)?))
    }

    /// The question about a system with h, plus and minus.
    fn of_surfaces(&self) -> Result<LargestExponent, CliError> {
        let spec = self.flags.spec(Use::Exponent)?;
        let transient = self.transient.unwrap_or(0.1 * spec.t_end);
        if !(transient >= 0.0 && transient < spec.t_end) {
            let text = format!(
                "--transient is {transient}: give a time from 0 to below --t-end, {}",
                spec.t_end
            );
            return Err(CliError::Usage(text));
        }
        let settings = LyapunovOptions {
            tolerance: spec.method.tolerance,
            max_step: if let StepCap::Absolute(h) = spec.method.step_cap {
                h
            } else {
                f64::INFINITY
            },
            transient,
            duration: spec.t_end - transient,
            max_steps: spec.method.max_steps,
            kick: spec.schedule.kick,
        };
        Ok(LargestExponent {
            system: spec.system,
            switch: spec.switch,
            start: spec.start,
            settings,
        })
    }

    /// The question about a general system.
    fn of_general(&self, mut run: GeneralRun) -> Result<GeneralExponents, CliError> {
        for flag in ["--section", "--chord", "--every"] {
            if self.flags.given().contains(&flag) {
                return Err(CliError::no_effect(
                    flag,
                    "an exponent is an average along the whole orbit; leave it out",
                ));
            }
        }
        if self.flags.t_end.is_none() {
            run.options.t_end = run.options.t_start + 10_000.0;
        }
        self.averaged(run)
    }

    fn averaged(&self, run: GeneralRun) -> Result<GeneralExponents, CliError> {
        let length = run.options.t_end - run.options.t_start;
        let transient = self.transient.unwrap_or(0.1 * length);
        if !(transient >= 0.0 && transient < length) {
            let text = format!(
                "--transient is {transient}: give a time from 0 to below the run's length, {length}"
            );
            return Err(CliError::Usage(text));
        }
        let count = run.model.coordinates().len().min(MOST_EXPONENTS);
        Ok(GeneralExponents { run, transient, count })
    }
}

pub fn run(arguments: &Arguments) -> Result<cli::Exit, CliError> {
    if let Some(question) = arguments.all_exponents()? {
        return of_general(arguments, &question);
    }
    let question = arguments.of_surfaces()?;
    let transient = question.settings.transient;
    let out = arguments.delivery.out.as_deref();
    let format = ending::format(out, arguments.format, Format::Text)?;
    try_delivery(out)?;
    let progress = Progress::with_grace(arguments.delivery.quiet);
    progress.say_default_switch(&arguments.flags, &[]);
    let answer = match (Executor::new(None, &progress).ask(&question), progress.asked_to_stop()) {
        (Err(JobError::Interrupted), Some(exit)) => {
            return Err(CliError::Stopped {
                said: "interrupted before a mean and its error could be computed".into(),
                exit,
            });
        }
        (answer, _) => answer?,
    };
    if let Ok(failure) = answer.fact::<String>("failure") {
        return Err(CliError::Job(JobError::Other(failure)));
    }
    let found: Exponent = answer.fact("exponent").map_err(JobError::from)?;
    let bytes = match format {
        Format::Json => encode::json(&answer, &encode::about_run(&question)),
        Format::Text => {
            let half_width: f64 = answer.fact("half_width").map_err(JobError::from)?;
            let sign: Sign = answer.fact("sign").map_err(JobError::from)?;
            let value = found.value;
            let meaning = match sign {
                Sign::Positive => "neighbours part",
                Sign::Negative => "neighbours approach",
                Sign::Zero => "not distinguishable from zero",
            };
            let until = transient + found.duration;
            let value = with_error(value, half_width);
            format!(
                "{value} per unit time ({meaning}; mean over t = \
                    {transient} to {until}, 95 % interval)\n"
            )
            .into_bytes()
        }
    };
    deliver(out, &bytes)?;
    match progress.asked_to_stop() {
        Some(exit) if answer.stop == Stop::Interrupted => {
            let until = transient + found.duration;
            Err(CliError::Stopped {
                said: format!("interrupted: the mean is over t = {transient} to {until}"),
                exit,
            })
        }
        _ => Ok(cli::Exit::Fine),
    }
}

/// Most exponents of a general system that are computed.
const MOST_EXPONENTS: usize = 12;

/// The exponents of a motion with switches, by saltation matrices through its switches and resets.
fn of_general(arguments: &Arguments, question: &GeneralExponents) -> Result<cli::Exit, CliError> {
    let out = arguments.delivery.out.as_deref();
    let format = ending::format(out, arguments.format, Format::Text)?;
    try_delivery(out)?;
    let progress = Progress::with_grace(arguments.delivery.quiet);
    progress.say_default_switch(&arguments.flags, &[]);
    let answer = Executor::new(None, &progress).ask(question)?;
    let fact = |e| CliError::Job(JobError::Fact(e));
    let found: Vec<MeanRate> = answer.fact("exponents").map_err(fact)?;
    let (from, until): (f64, f64) =
        (answer.fact("from").map_err(fact)?, answer.fact("to").map_err(fact)?);
    let bytes = match format {
        Format::Json => encode::json(&answer, &encode::about_run(question)),
        Format::Text => {
            let mut text = String::new();
            for (i, MeanRate { value, half_width }) in found.iter().enumerate() {
                let value = value.unwrap_or(f64::NEG_INFINITY);
                let meaning = match () {
                    () if value == f64::NEG_INFINITY => {
                        "sliding, or a reset, takes this direction away"
                    }
                    () if value.abs() <= *half_width => "not distinguishable from zero",
                    () if value > 0.0 => "neighbours part",
                    () => "neighbours approach",
                };
                let mean = if i == 0 {
                    format!("; mean over t = {from} to {until}, 95 % interval")
                } else {
                    String::new()
                };
                let value = with_error(value, *half_width);
                text += &format!("{value} per unit time ({meaning}{mean})\n");
            }
            if found.len() < question.count {
                let missing = question.count - found.len();
                text += &format!(
                    "{missing} more not told from rounding: their directions are parallel to those \
                        above in 13 digits; give states units in which they are of like size\n"
                );
            }
            text.into_bytes()
        }
    };
    deliver(out, &bytes)?;
    Ok(cli::Exit::Fine)
}
