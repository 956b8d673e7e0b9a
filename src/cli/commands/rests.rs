//! `twofold rests`: finds equilibria and pseudo-equilibria.

use crate::cli::models;
use crate::cli::speak::{Delivery, deliver, state_in_words, try_delivery};
use crate::cli::{CliError, Exit, ending};
use crate::job::general::{Family, GeneralRests, RestPlace, Resting};
use crate::job::{Executor, JobError, encode};

/// Find the rests of a system in a box: equilibria of its fields and pseudo-equilibria on its
/// switching surfaces, with eigenvalues and stability.
///
/// Newton's method starts at up to 400 places of the box, for the fields and for every set of up to
/// four switching surfaces; a rest that no start leads to is not found. Rests that fill a curve are
/// one line, with its ends in the box. Systems with h, plus and minus are read as general ones; one
/// with a table [second] is refused.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  \
    twofold rests --system gene-switch --within x=0..2 --within y=0..2\n  \
    twofold rests --system my.toml --set gain=2 --within x=-3..3 --within v=-1..1 --format json")]
pub struct Arguments {
    /// A system: a built-in one or a file.
    #[arg(long, value_name = "NAME|FILE")]
    system: String,
    /// Give a parameter of the system another value; may be repeated.
    #[arg(long, value_name = "NAME=VALUE", allow_hyphen_values = true)]
    set: Vec<String>,
    /// Bounds of a state, such as x=-2..2; may be repeated [default: -10 to 10].
    #[arg(long, value_name = "STATE=LOW..HIGH", allow_hyphen_values = true)]
    within: Vec<String>,
    /// Output format [default: what the name of --out ends in, else text].
    #[arg(long, value_enum)]
    format: Option<Format>,
    #[command(flatten)]
    delivery: Delivery,
}

#[derive(Clone, Copy, Debug, clap::ValueEnum)]
enum Format {
    /// A line for each rest.
    Text,
    /// Everything.
    Json,
}

impl Arguments {
    /// The question that the flags ask.
    ///
    /// # Errors
    /// If the system cannot be read, or a bound is wrong.
    pub fn question(&self) -> Result<GeneralRests, CliError> {
        let model = models::any_model(&self.system, &self.set)?;
        let names = model.coordinates();
        models::each_once("--within", &self.within)?;
        let mut within = vec![(-10.0, 10.0); names.len()];
        for text in &self.within {
            let wrong = |why: &str| {
                CliError::Usage(format!(
                    "--within \"{text}\": {why}; give one such as {}=-2..2",
                    names[0]
                ))
            };
            let (name, range) = text.split_once('=').ok_or_else(|| wrong("there is no \"=\""))?;
            let (low, high) = range.split_once("..").ok_or_else(|| wrong("there is no \"..\""))?;
            let state = names.iter().position(|n| *n == name.trim()).ok_or_else(|| {
                wrong(&format!("there is no such state among {}", names.join(", ")))
            })?;
            let number =
                |text: &str| text.trim().parse::<f64>().map_err(|_| wrong("a bound is no number"));
            within[state] = (number(low)?, number(high)?);
            let (low, high) = within[state];
            if low.partial_cmp(&high) != Some(std::cmp::Ordering::Less) {
                return Err(wrong("the lower bound comes first and is less than the other"));
            }
        }
        Ok(GeneralRests { model, within })
    }
}

pub fn run(arguments: &Arguments) -> Result<Exit, CliError> {
    let question = arguments.question()?;
    let out = arguments.delivery.out.as_deref();
    let format = ending::format(out, arguments.format, Format::Text)?;
    try_delivery(out)?;
    let answer = Executor::quiet().ask(&question)?;
    let names = question.model.coordinates();
    let several = question.model.definition().modes().len() > 1;
    let bytes = match format {
        Format::Text => {
            let found: Vec<Resting> = answer.fact("rests").map_err(JobError::from)?;
            let sizes: Vec<f64> =
                question.within.iter().map(|(low, high)| low.abs().max(high.abs())).collect();
            let mut lines: Vec<String> =
                found.iter().map(|rest| line(rest, &names, &sizes, several)).collect();
            if lines.is_empty() {
                lines.push("no rest was found in the box (--within)".into());
            }
            if answer.facts.contains_key("limits") {
                let limits: Vec<String> = answer.fact("limits").map_err(JobError::from)?;
                lines.extend(limits.iter().map(|limit| format!("incomplete: {limit}")));
            }
            format!("{}\n", lines.join("\n")).into_bytes()
        }
        Format::Json => encode::json(&answer, &encode::about_run(&question)),
    };
    deliver(out, &bytes)?;
    Ok(Exit::Fine)
}

/// A number to twelve digits; what is within rounding of `size` is 0.
fn rounded(x: f64, size: f64) -> f64 {
    match size.is_finite() && x.abs() <= 1e-15 * size {
        true => 0.0,
        false => format!("{x:.11e}").parse().unwrap_or(x),
    }
}

/// A rest for people; `sizes` are those of the box that was searched.
fn line(rest: &Resting, names: &[&str], sizes: &[f64], with_mode: bool) -> String {
    let point = |state: &[f64]| {
        let state: Vec<f64> = state.iter().zip(sizes).map(|(x, size)| rounded(*x, *size)).collect();
        state_in_words(names, &state)
    };
    let changes = rest.family.as_ref().is_some_and(|f| f.changes);
    let on = |surfaces: &str, moves: &str| {
        format!("pseudo-equilibrium on {surfaces} = 0{}", if changes { "" } else { moves })
    };
    let mode = if with_mode { format!(", mode {}", rest.mode) } else { String::new() };
    // Weights are those at the point that is named.
    let (place, weights) = match &rest.place {
        RestPlace::Field => ("equilibrium".to_owned(), String::new()),
        RestPlace::Surface { surface, weight, attracting } => {
            let moves = match attracting {
                Some(true) => ", which attracts",
                Some(false) => ", which repels",
                None => ", to which the fields are tangent",
            };
            (on(surface, moves), format!(" (weight {})", rounded(*weight, 1.0)))
        }
        RestPlace::Intersection { surfaces, weights, attracting } => {
            let moves = match attracting {
                Some(true) => ", which attract",
                Some(false) => ", which repel",
                None => ", and the fields there do not tell whether these attract",
            };
            let weights: Vec<String> =
                weights.iter().map(|w| rounded(*w, 1.0).to_string()).collect();
            (on(&surfaces.join(" = 0 and "), moves), format!(" (weights {})", weights.join(", ")))
        }
    };
    let state = match &rest.family {
        None => point(&rest.state),
        Some(Family { dimension: 1, ends: Some([from, to]), .. }) => {
            format!(
                "every point of a curve from {} to {}, such as {}",
                point(from),
                point(to),
                point(&rest.state)
            )
        }
        Some(Family { dimension: 1, ends: None, .. }) => {
            format!("every point of a closed curve, such as {}", point(&rest.state))
        }
        Some(Family { dimension, .. }) => {
            format!("one of a set of {dimension} dimensions: {}", point(&rest.state))
        }
    };
    let largest = rest.eigenvalues.iter().flatten().fold(0.0, |most: f64, x| most.max(x.abs()));
    let values: Vec<String> = rest
        .eigenvalues
        .iter()
        .map(|value| value.map(|x| rounded(x, largest)))
        .map(|[re, im]| match im {
            0.0 => format!("{re}"),
            im if im < 0.0 => format!("{re} - {}i", -im),
            im => format!("{re} + {im}i"),
        })
        .collect();
    let values = if values.is_empty() {
        String::new()
    } else {
        format!("; eigenvalues {}", values.join(", "))
    };
    let behind = rest
        .behind
        .as_ref()
        .map(|event| format!("; behind the event {event:?}, which changes motion before"));
    let behind = behind.unwrap_or_default();
    format!("{place}{mode}: {state}{weights}; {}{values}{behind}", rest.kind)
}

#[cfg(test)]
mod tests {
    use super::rounded;

    #[test]
    fn numbers_of_rests_are_shown_without_rounding_errors() {
        for (x, size, shown) in [
            (0.862_499_999_999_999_9, 10.0, 0.8625),
            (-6.162_975_822_039_155e-33, 10.0, 0.0),
            (1e-12, 10.0, 1e-12),
            (3e-20, 1e-18, 3e-20),
            (1e-20, f64::INFINITY, 1e-20),
        ] {
            assert_eq!(rounded(x, size), shown, "{x}");
        }
    }
}
