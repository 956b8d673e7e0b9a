//! Output to the two standard streams. Text for people contains no control sequences, whatever
//! names it holds; a closed stream does not stop a computation.

use std::io::{self, Write};
use std::path::{Path, PathBuf};

use super::CliError;
use super::exit::part_of;
use crate::num::Short;
use crate::num::elementary::log10;
use crate::record;

/// A value for people with two digits more than its error leaves, and at least `places` decimal
/// places where that many mean something. An error that is not known counts as 10^-7 of it.
pub fn with_digits(value: f64, error: f64, places: usize) -> String {
    let size = value.abs().max(error);
    if !size.is_finite() || size == 0.0 {
        return format!("{value:.places$}");
    }
    let error = if error.is_nan() { 1e-7 * size } else { error.max(f64::EPSILON * size) };
    // So many that rounding does not move the interval.
    if (1e-3..1e6).contains(&size) {
        let places = (2.0 - log10(error)).ceil().clamp(places as f64, 17.0) as usize;
        format!("{value:.places$}")
    } else {
        let digits = (log10(size) - log10(error) + 3.0).floor().clamp(1.0, 17.0) as usize;
        format!("{value:.digits$e}")
    }
}

/// A value and its error for people: two digits of the error, and of the value no more than these
/// leave. The error is rounded up, so that the interval printed holds the one given.
pub fn with_error(value: f64, error: f64) -> String {
    let power = |x: f64| format!("{x:e}").split('e').nth(1).and_then(|e| e.parse::<i32>().ok());
    let size = value.abs().max(error);
    let (true, Some(first), Some(leading)) =
        (value.is_finite() && error.is_finite() && error > 0.0, power(error), power(size))
    else {
        return format!("{} +- {error:.1e}", with_digits(value, error, 6));
    };
    let plain = (1e-3..1e6).contains(&size);
    // The place of the last digit.
    let last = if plain { (first - 1).min(0) } else { first - 1 };
    let shown = match plain {
        true => format!("{value:.*}", last.unsigned_abs() as usize),
        false if value == 0.0 => "0".to_owned(),
        false => format!("{value:.*e}", (leading - last).unsigned_abs() as usize),
    };
    let unit: f64 = format!("1e{last}").parse().unwrap_or(f64::NAN);
    let moved = (value - shown.parse().unwrap_or(value)).abs();
    // Less what dividing adds to a whole number.
    let units = ((error + moved) / unit - 1e-9).ceil();
    match plain && first >= -3 {
        true => format!("{shown} +- {:.*}", last.unsigned_abs() as usize, units * unit),
        false => format!("{shown} +- {:.1e}", units * unit),
    }
}

/// A state for people: "x = 0.2, y = 1".
pub fn state_in_words(names: &[&str], state: &[f64]) -> String {
    let said = |(name, x): (&&str, &f64)| format!("{name} = {}", Short(*x));
    names.iter().zip(state).map(said).collect::<Vec<_>>().join(", ")
}

/// Prints text for people to standard output, and a newline.
///
/// # Errors
/// If it cannot be written. A reader that went away (`| head`) is no error.
pub fn print(text: &str) -> Result<(), CliError> {
    print_bytes(format!("{}\n", harmless(text)).as_bytes())
}

/// Prints a value as indented JSON to standard output.
///
/// # Errors
/// As [`print()`].
pub fn print_json<T: serde::Serialize>(value: &T) -> Result<(), CliError> {
    let text = serde_json::to_string_pretty(value)
        .expect("what is shown is plain data: string keys, no failing serialisers");
    // In JSON controls stand only in strings. Those below a space are escaped already, the others
    // may be.
    let escaped: String = text
        .chars()
        .map(|c| {
            if steers(c) && c != '\n' { format!("\\u{:04x}", u32::from(c)) } else { c.to_string() }
        })
        .collect();
    print_bytes(format!("{escaped}\n").as_bytes())
}

/// Writes data to standard output.
///
/// # Errors
/// As [`print()`].
pub fn print_bytes(bytes: &[u8]) -> Result<(), CliError> {
    let mut out = io::stdout().lock();
    match out.write_all(bytes).and_then(|()| out.flush()) {
        Err(e) if e.kind() == io::ErrorKind::BrokenPipe => Ok(()),
        other => Ok(other?),
    }
}

/// Prints one line for people to standard error. Failures to write it are ignored.
pub fn complain(text: &str) {
    let _ = io::stderr().lock().write_all(format!("{}\n", harmless(text)).as_bytes());
}

/// Output flags shared by all commands that compute an answer.
#[derive(Clone, Debug, clap::Args)]
pub struct Delivery {
    /// File to write instead of standard output (-).
    #[arg(long, value_name = "FILE")]
    pub out: Option<PathBuf>,
    /// No progress on standard error.
    #[arg(long)]
    pub quiet: bool,
}

/// Writes data to a file, or to standard output if `-` is named, or nothing.
///
/// # Errors
/// If it cannot be written.
pub fn deliver(to: Option<&Path>, bytes: &[u8]) -> Result<(), CliError> {
    match to {
        Some(file) if !is_standard_output(file) => {
            record::write(file, bytes)?;
            say_older_part(file);
            Ok(())
        }
        _ => print_bytes(bytes),
    }
}

/// Says that beside a finished file lies what an earlier run left that did not finish. It may be
/// all that there is of that run, and is kept.
pub fn say_older_part(file: &Path) {
    let part = part_of(file);
    if part.exists() {
        complain(&format!("{} is of an earlier run that did not finish", part.display()));
    }
}

/// Tries the place before anything is computed.
///
/// # Errors
/// If [`deliver`] could not write there.
pub fn try_delivery(to: Option<&Path>) -> Result<(), CliError> {
    match to {
        Some(file) if !is_standard_output(file) => Ok(record::files::try_place(file)?),
        _ => Ok(()),
    }
}

/// Whether `path` names an open standard stream, such as /dev/stdout.
pub fn is_standard_output(file: &Path) -> bool {
    ["-", "/dev/stdout", "/dev/fd/1", "/proc/self/fd/1"].iter().any(|name| file == Path::new(name))
}

/// Text without terminal control sequences and without characters that change the writing
/// direction. Line ends are kept.
pub fn harmless(text: &str) -> String {
    text.chars().map(|c| if steers(c) && c != '\n' { '\u{fffd}' } else { c }).collect()
}

fn steers(c: char) -> bool {
    c.is_control()
        || matches!(c, '\u{200e}' | '\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_steers_a_terminal() {
        let text = "a\u{1b}[2Jb\u{9b}2Jc\rd\u{7}e\u{202e}f\u{7f}g\nh é ε′";
        let said = harmless(text);
        assert_eq!(said, "a\u{fffd}[2Jb\u{fffd}2Jc\u{fffd}d\u{fffd}e\u{fffd}f\u{fffd}g\nh é ε′");
    }

    #[test]
    fn a_value_has_no_more_digits_than_its_error() {
        for (value, error, shown) in [
            (0.330_59, 0.125, "0.33 +- 0.13"),
            (0.330_59, 0.13, "0.33 +- 0.14"),
            (0.0, 1.5e-3, "0.0000 +- 0.0015"),
            (1234.56, 250.0, "1235 +- 251"),
            (2.714_6e-5, 1.1e-6, "2.71e-5 +- 1.2e-6"),
            (0.0, 1e-9, "0 +- 1.0e-9"),
            (f64::NEG_INFINITY, 0.0, "-inf +- 0.0e0"),
        ] {
            assert_eq!(with_error(value, error), shown);
        }
    }

    #[test]
    fn an_error_that_is_shown_covers_the_interval() {
        for value in [0.330_59, -12.345_678, 4.0e-7, 1.234e8, 0.05] {
            for error in [2.0e-9, 3.33e-4, 0.049, 0.1, 9.99] {
                let shown = with_error(value, error);
                let (near, wide) = shown.split_once(" +- ").unwrap();
                let [near, wide] = [near, wide].map(|n| n.parse::<f64>().unwrap());
                let slack = 1e-8 * error + 4.0 * f64::EPSILON * value.abs();
                assert!((near - value).abs() + error <= wide + slack, "{shown}");
                let enough = 1.2 * error + 4.0 * f64::EPSILON * value.abs();
                assert!(wide <= enough, "{shown}");
            }
        }
    }

    #[test]
    fn standard_output_has_several_names() {
        assert!(is_standard_output(Path::new("-")) && is_standard_output(Path::new("/dev/stdout")));
        assert!(!is_standard_output(Path::new("./-")) && !is_standard_output(Path::new("stdout")));
    }
}
