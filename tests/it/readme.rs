//! README and the pages of findings say what the references say.

use std::fs;
use std::path::Path;

use crate::claims::Reads;
use twofold::jeffrey_2013::study::{capture, census, verdict_table};
use twofold::paper::figures;
use twofold::record::Manifest;

fn text(path: &str) -> String {
    fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join(path)).unwrap()
}

#[test]
fn golden_table_of_verdicts_is_that_of_the_references() {
    let manifests: Vec<Manifest> = figures::all()
        .iter()
        .map(|f| Manifest::parse(figures::reference(&f.id).unwrap(), &f.id).unwrap())
        .collect();
    let written = text("docs/findings.md");
    let table = verdict_table::table(&manifests);
    assert_eq!(
        table.lines().filter(|l| l.contains("| agrees |") || l.contains("| differs |")).count(),
        11,
        "{table}"
    );
    let made = verdict_table::with_table(&written, &table)
        .expect("docs/findings.md has a place for the table of verdicts");
    assert!(
        made == written,
        "the table of verdicts in docs/findings.md is not that of papers/jeffrey-2013/expected; \
            run `twofold bless`:\n{table}"
    );
}

#[test]
fn golden_embedded_references_are_the_files() {
    for figure in figures::all() {
        assert_eq!(
            figures::reference(&figure.id),
            Some(
                fs::read_to_string(figures::reference_file(
                    &Path::new(env!("CARGO_MANIFEST_DIR")).join("figures"),
                    &figure.id
                ))
                .unwrap()
                .as_str()
            )
        );
    }
}

#[derive(serde::Deserialize)]
#[serde(deny_unknown_fields)]
struct Numbers {
    given: Vec<String>,
    number: Vec<Number>,
}

#[derive(serde::Deserialize)]
#[serde(deny_unknown_fields)]
struct Number {
    quotes: Vec<String>,
    command: String,
    test: Option<String>,
}

fn numbers() -> Numbers {
    toml::from_str(&text("docs/numbers.toml")).unwrap()
}

/// A page without what stands between two marks.
fn without(page: &str, begin: &str, end: &str) -> String {
    let (before, rest) = page.split_once(begin).unwrap();
    let (_, after) = rest.split_once(end).unwrap();
    format!("{before}{after}")
}

/// Blocks of text with single spaces: how a page is wrapped does not matter.
fn unwrapped(text: &str) -> Vec<String> {
    text.split("\n\n").map(|block| block.split_whitespace().collect::<Vec<_>>().join(" ")).collect()
}

/// The prose of the pages of findings. Their generated tables are compared elsewhere.
fn findings() -> String {
    let findings = without(&text("docs/findings.md"), verdict_table::BEGIN, verdict_table::END);
    let census = without(&text("docs/census.md"), census::BEGIN, census::END);
    let [mut captures, mut parameters] = ["docs/capture.md", "docs/parameters.md"].map(text);
    for page in [&mut captures, &mut parameters] {
        while page.contains(capture::BEGIN) {
            *page = without(page, capture::BEGIN, capture::END);
        }
    }
    let pages = [
        findings,
        text("docs/theorems.md"),
        text("docs/differences.md"),
        census,
        captures,
        parameters,
    ];
    unwrapped(&pages.join("\n\n")).join("\n")
}

#[test]
fn every_number_of_the_findings_is_named_in_the_file_of_numbers() {
    let Numbers { given, number } = numbers();
    let whole = findings();
    let mut left = whole.clone();
    for quote in number.iter().flat_map(|n| &n.quotes) {
        let quote = unwrapped(quote).join(" ");
        assert!(whole.contains(&quote), "the findings do not say \"{quote}\"");
        left = left.replace(&quote, "");
    }
    // Longest first, so that a short one does not eat a part of a long one.
    let mut given: Vec<String> = given.iter().map(|g| unwrapped(g).join(" ")).collect();
    given.sort_by_key(|g| std::cmp::Reverse(g.len()));
    for g in &given {
        left = left.replace(g.as_str(), "");
    }
    // Links lead to files, whose names have numbers.
    for line in left.lines().filter(|l| !l.starts_with("![")) {
        let unnamed: Vec<&str> = line
            .split(|c: char| !(c.is_ascii_digit() || ".,".contains(c)))
            .map(|n| n.trim_matches(['.', ',']))
            .filter(|n| n.bytes().any(|b| b.is_ascii_digit()))
            .collect();
        assert!(
            unnamed.is_empty(),
            "{unnamed:?} are in the findings but not in docs/numbers.toml: {line}"
        );
    }
}

#[test]
fn readme_is_short() {
    let readme = text("README.md");
    assert!(readme.lines().count() <= 120, "{} lines", readme.lines().count());
    assert!(
        readme.split_whitespace().count() <= 900,
        "{} words",
        readme.split_whitespace().count()
    );
    let long: Vec<&str> =
        readme.lines().filter(|l| l.chars().count() > 100 && !l.starts_with("![")).collect();
    assert!(long.is_empty(), "{long:?}");
}

/// A command in README that begins with "$" prints the lines below it.
#[test]
fn readme_shows_what_commands_print() {
    let readme = text("README.md");
    let mut lines = readme.lines();
    let mut shown = 0;
    while let Some(line) = lines.next() {
        let Some(command) = line.strip_prefix("    $ twofold ") else { continue };
        let said: Vec<&str> =
            lines.by_ref().take_while(|l| !l.is_empty()).map(|l| l.trim_start()).collect();
        let output = std::process::Command::new(env!("CARGO_BIN_EXE_twofold"))
            .args(command.split_whitespace())
            .output()
            .unwrap();
        let printed = String::from_utf8(output.stdout).unwrap();
        assert_eq!(printed.lines().collect::<Vec<_>>(), said, "{command}");
        shown += 1;
    }
    assert_eq!(shown, 1);
}

/// The rows of a table of `make bench-work-precision`: a problem's ratios by error, and how many
/// are at most 0.4.
fn ratios(table: &str) -> Vec<(&str, Vec<f64>, &str)> {
    let rows = table.lines().skip(2).take_while(|line| line.starts_with('|'));
    rows.map(|line| {
        let cells: Vec<&str> = line.trim_matches('|').split('|').map(str::trim).collect();
        let (numbers, met) = (&cells[1..cells.len() - 1], cells[cells.len() - 1]);
        (cells[0], numbers.iter().map(|c| c.parse().unwrap()).collect(), met)
    })
    .collect()
}

/// The speeds of README and docs/performance.md are those that the benchmark wrote.
#[test]
fn speeds_are_those_of_the_benchmark() {
    let results = text("benches/work-precision/results.md");
    let mut tables = results.split("\n| problem |").skip(1);
    let [all, files] = [tables.next().unwrap(), tables.next().unwrap()].map(ratios);
    let range = |rows: &[(&str, Vec<f64>, &str)], places: usize| {
        let all = rows.iter().flat_map(|row| row.1.iter().copied());
        let (low, high) =
            all.fold((f64::INFINITY, 0.0_f64), |(a, b), ratio| (a.min(ratio), b.max(ratio)));
        format!("{low:.places$}–{high:.places$}")
    };
    let smooth = "W1, set A, to t = 54; W1, set B, to t = 13; closed orbit, five periods";
    assert_eq!([all[0].0, all[1].0, all[2].0].join("; "), smooth);
    let said = format!(
        "At equal errors smooth runs take {} of the best other solver's time (from files {}), \
            Filippov's {} (",
        range(&all[..3], 2),
        range(&files[..3], 2),
        range(&all[3..4], 0)
    );
    let readme = text("README.md").replace('\n', " ").replace("([measured]", "(");
    assert!(readme.contains(&said), "README does not say: {said}");
    let page = text("docs/performance.md").replace("[sliding](glossary.md#sliding)", "sliding");
    for (problem, ratios, met) in all {
        let cell = |i: usize| {
            let places = if ratios[i] < 9.95 { 2 } else { 1 };
            format!("{:.places$}", ratios[i])
        };
        let row = format!("| {problem} | {} | {met} |", [0, 2, 4, 6, 8].map(cell).join(" | "));
        assert!(page.contains(&row), "docs/performance.md has no row: {row}");
    }
}

#[test]
fn the_commands_and_tests_behind_the_numbers_exist() {
    let help = |arguments: &[&str]| {
        let output = std::process::Command::new(env!("CARGO_BIN_EXE_twofold"))
            .args(arguments)
            .output()
            .unwrap();
        String::from_utf8(output.stdout).unwrap()
    };
    let makefile = text("Makefile") + &text("papers/jeffrey-2013/sweeps.mk");
    for Number { quotes, command, test } in numbers().number {
        assert!(!quotes.is_empty());
        let words: Vec<&str> = command.split_whitespace().collect();
        match words[..] {
            ["make", target] => {
                assert!(makefile.contains(&format!("\n{target}:")), "no target {target}")
            }
            ["twofold", sub, ..] => {
                assert!(help(&["--help"]).contains(&format!("\n  {sub}")), "no command {sub}");
                let known = help(&[sub, "--help"]);
                for flag in words.iter().filter(|w| w.starts_with("--")) {
                    assert!(known.contains(flag), "{sub} has no flag {flag}");
                }
            }
            _ => panic!("{command}: neither twofold nor make"),
        }
        if let Some(test) = test {
            assert!(!text(&test).is_empty());
        }
    }
}

#[test]
fn futures_come_back_as_often_as_the_findings_say() {
    let mut reads = Reads::by("readme::futures_come_back_as_often_as_the_findings_say");
    use twofold::integrate::filippov::EventKind;
    use twofold::integrate::filippov::ExitRule;
    use twofold::integrate::{Schedule, StepCap, Tolerance};
    use twofold::jeffrey_2013::Reading;
    use twofold::job::recording::Data;
    use twofold::job::simulate::simulate;
    use twofold::job::spec::*;
    for (reading, back) in [(Reading::Reconstructed, 40), (Reading::Printed, 35)] {
        let funnel = FunnelSpec {
            shortest: 0.1,
            longest: 3.0,
            times: 20,
            horizon: 300.0,
            until_two_fold: true,
        };
        let run = RunSpec {
            system: reading.caricature().into(),
            switch: SwitchSpec::Filippov { exit: ExitRule::All, funnel: Some(funnel) },
            start: vec![0.2, 0.0, -1.0],
            t_end: 100.0,
            method: MethodSpec {
                name: Method::Dopri5,
                tolerance: Tolerance { rtol: 1e-12, atol: 1e-12 },
                step_cap: StepCap::None,
                max_steps: DEFAULT_MAX_STEPS,
                precision: None,
                order: None,
            },
            schedule: Schedule::default(),
            observe: Observation::Path { chord: 1e-3 },
        };
        let Data::Funnel { futures, .. } = simulate(&run, &()).unwrap().data else {
            panic!("a funnel was asked for")
        };
        let comes_back = |f: &&twofold::job::recording::Future| {
            f.motion.events.iter().any(|e| matches!(e.kind, EventKind::TwoFoldReached { .. }))
        };
        let found = futures.iter().filter(comes_back).count();
        let word = reading.word();
        let quantity =
            format!("share of the first visit's futures that come back within 300, {word}");
        reads.read("3.6", &quantity, found as f64 / futures.len() as f64);
        assert_eq!((found, futures.len()), (back, 40), "{word}");
        // Fig. 4 says so on its face.
        let fig4 = twofold::jeffrey_2013::fig4::figure()
            .pictures
            .into_iter()
            .find(|p| p.reading == Some(reading.into()))
            .unwrap();
        let said = format!("{back} of 40 futures come back within 300 units of time;");
        assert!(fig4.panels[0].title.starts_with(&said), "{}", fig4.panels[0].title);
    }
}
