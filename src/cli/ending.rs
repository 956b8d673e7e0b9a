//! The format that a file's name implies, checked early: rows under a picture's name would fail
//! only in another program.

use std::path::Path;

use clap::ValueEnum;

use super::CliError;
use super::speak::is_standard_output;

/// Names with one of these endings promise what is in the file.
const KNOWN: [&str; 6] = ["csv", "json", "parquet", "png", "svg", "pdf"];

const PICTURES: [&str; 3] = ["png", "svg", "pdf"];

/// The format that a command writes to `out`: the one that is asked for, else the one that the
/// file's name says, else the `usual` one.
///
/// # Errors
/// If the name says another one than what is asked for, or one that the command cannot write.
pub fn format<F: ValueEnum + Clone>(
    out: Option<&Path>,
    asked: Option<F>,
    usual: F,
) -> Result<F, CliError> {
    let word = |format: &F| {
        format.to_possible_value().map_or(String::new(), |value| value.get_name().to_owned())
    };
    let file = out.filter(|file| !is_standard_output(file));
    let ending = file.and_then(Path::extension).map(|e| e.to_string_lossy().to_ascii_lowercase());
    let Some((file, ending)) = file.zip(ending.filter(|e| KNOWN.contains(&e.as_str()))) else {
        return Ok(asked.unwrap_or(usual));
    };
    let refuse = |why: String| Err(CliError::Usage(format!("--out {}: {why}", file.display())));
    match (F::value_variants().iter().find(|format| word(format) == ending), asked) {
        (Some(named), None) => Ok(named.clone()),
        (Some(named), Some(asked)) if word(named) == word(&asked) => Ok(asked),
        (_, Some(asked)) => refuse(format!(
            "the name says {ending}, but {} is asked for; leave one of the two out, or make them \
                agree",
            word(&asked)
        )),
        (None, None) => {
            let written: Vec<String> = F::value_variants().iter().map(word).collect();
            let drawn = "; `twofold plot` draws a run, `twofold scan --plot` a scan";
            let drawn = if PICTURES.contains(&ending.as_str()) { drawn } else { "" };
            refuse(format!(
                "the name says {ending}, but what is written is {}{drawn}",
                written.join(" or ")
            ))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Clone, Debug, PartialEq, ValueEnum)]
    enum Format {
        Text,
        Csv,
        Json,
    }

    fn of(out: &str, asked: Option<Format>) -> Result<Format, String> {
        format(Some(Path::new(out)), asked, Format::Text).map_err(|e| e.to_string())
    }

    #[test]
    fn a_name_says_the_format_unless_it_says_nothing() {
        assert_eq!(of("a.json", None), Ok(Format::Json));
        assert_eq!(of("A.CSV", None), Ok(Format::Csv));
        assert_eq!(of("a.csv", Some(Format::Csv)), Ok(Format::Csv));
        for silent in ["a", "a.dat", "a.txt", ".csv", "-", "/dev/stdout"] {
            assert_eq!(of(silent, None), Ok(Format::Text), "{silent}");
            assert_eq!(of(silent, Some(Format::Json)), Ok(Format::Json), "{silent}");
        }
        assert_eq!(format(None, None, Format::Csv).unwrap(), Format::Csv);
    }

    #[test]
    fn what_a_name_promises_is_kept_or_refused() {
        let why = of("a.csv", Some(Format::Json)).unwrap_err();
        assert!(
            why.contains("a.csv") && why.contains("says csv") && why.contains("json is asked for"),
            "{why}"
        );
        let why = of("a.parquet", None).unwrap_err();
        assert!(why.contains("text or csv or json") && !why.contains("plot"), "{why}");
        let why = of("a.png", None).unwrap_err();
        assert!(why.contains("`twofold plot`"), "{why}");
        assert!(of("a.svg", Some(Format::Json)).is_err());
    }
}
