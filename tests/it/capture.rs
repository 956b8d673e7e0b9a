//! Times of capture: docs/capture.md and docs/parameters.md say what the committed runs say.
//! `TWOFOLD_UPDATE=1 cargo test --test it capture::` writes the texts anew.

use std::fs;

use twofold::analyse::counts::wilson;
use twofold::jeffrey_2013::study::capture::{self, ByMethod};
use twofold::jeffrey_2013::study::census::PANELS;
use twofold::jeffrey_2013::study::claims::claims;
use twofold::jeffrey_2013::study::effects;
use twofold::jeffrey_2013::{Reading, audit};
use twofold::job::sweep::Rows;
use twofold::job::table::{Entry, Table};

use crate::census::{path, rows};
use crate::examples::visits;

pub fn table(name: &str) -> Table {
    rows(&format!("papers/jeffrey-2013/code/{name}.csv")).table()
}

/// Fig. 7(iii) by LSODA, from the census, and by the others.
fn methods() -> Vec<(Reading, Vec<ByMethod>)> {
    let census = table("census/fig7");
    let others =
        [("dopri5", "Dormand-Prince"), ("radau5", "Radau IIA"), ("taylor", "Taylor 10⁻¹⁵")];
    let of = |reading: Reading| {
        let alpha = || vec![("params.alpha", Entry::Number(reading.caricature().alpha))];
        let lsoda = ByMethod { name: "LSODA", runs: PANELS[2].runs(&census, alpha()) };
        let made = |(file, name): (&str, &'static str)| {
            (format!("capture/{file}-{}", reading.word()), name)
        };
        let by = |(file, name): (String, &'static str)| ByMethod {
            name,
            runs: twofold::jeffrey_2013::study::census::runs(&table(&file), &alpha()),
        };
        (reading, [lsoda].into_iter().chain(others.into_iter().map(made).map(by)).collect())
    };
    Reading::ALL.map(of).to_vec()
}

/// The texts between the marks of a page, in order, are these.
pub fn page_says(page: &str, begin: &str, end: &str, texts: &[String]) {
    let before = fs::read_to_string(path(page)).unwrap();
    let mut parts = before.split(begin);
    let mut after = parts.next().unwrap().to_owned();
    let mut texts = texts.iter();
    for part in parts {
        let (_, rest) =
            part.split_once(end).unwrap_or_else(|| panic!("a text in {page} has no end"));
        let text = texts.next().unwrap_or_else(|| panic!("{page} has more places than texts"));
        after.push_str(&format!("{begin}\n\n{}\n\n{end}{rest}", text.trim()));
    }
    assert!(texts.next().is_none(), "{page} has too few places for texts");
    if std::env::var_os("TWOFOLD_UPDATE").is_some() {
        fs::write(path(page), after).unwrap();
    } else {
        assert!(
            before == after,
            "{page} does not say what the runs say; TWOFOLD_UPDATE=1 writes:\n{after}"
        );
    }
}

#[test]
fn the_page_of_methods_says_what_the_study_says() {
    let rules = &claims().rules;
    let (fig7, fig8) = (table("census/fig7"), table("census/fig8"));
    let texts =
        [capture::capture_text(&methods(), rules), capture::effects_text(&fig7, &fig8, rules)];
    page_says("docs/capture.md", capture::BEGIN, capture::END, &texts);
}

#[test]
fn the_page_of_parameters_says_what_the_study_says() {
    let rules = &claims().rules;
    let candidates = audit::candidates().unwrap();
    assert_eq!(candidates.len(), 8);
    let [map7, map8, old7, old8] =
        ["capture/map7", "capture/map8", "audit/fig7", "audit/fig8"].map(table);
    let texts = [
        capture::likelihood_text(&candidates, rules),
        capture::priors_text(&candidates, rules),
        capture::map_text([&map7, &map8], [&old7, &old8], rules),
    ];
    page_says("docs/parameters.md", capture::BEGIN, capture::END, &texts);
}

/// The hazard ratios that the findings and README repeat.
#[test]
fn the_findings_have_the_hazard_ratios_of_the_study() {
    let rules = &claims().rules;
    let (_, reconstructed) = &methods()[1];
    let times =
        |m: &ByMethod| -> Vec<_> { m.runs.iter().map(|r| capture::time(r, rules.end)).collect() };
    let [findings, readme] =
        ["docs/findings.md", "README.md"].map(|page| fs::read_to_string(path(page)).unwrap());
    for name in ["Dormand-Prince", "Taylor 10⁻¹⁵"] {
        let method = reconstructed.iter().find(|m| m.name == name).unwrap();
        let ratio = effects::LogRank::of(&times(method), &times(&reconstructed[0]))
            .hazard_ratio(rules.confidence);
        let [low, high] = ratio.interval;
        let said = format!("{:.2} [{low:.2}, {high:.2}]", ratio.value);
        assert!(
            findings.contains(&said) && readme.contains(&format!("{:.2}", ratio.value)),
            "{}: {said}",
            method.name
        );
    }
}

/// Rows of sweeps under figures, computed anew: the same to the last bit.
pub fn come_out_the_same(numbers: &[(&str, u64)]) {
    for (name, number) in numbers {
        let rows: Rows = rows(&format!("papers/jeffrey-2013/code/{name}.csv"));
        let row = rows.get(*number).unwrap();
        assert_eq!(rows.sweep().row(*number, &()).unwrap().line(), row.line(), "{name}");
    }
}

/// No two rows of these sweeps have one start.
pub fn share_no_start(sweeps: &[&str]) {
    let starts = |name: &&str| -> Vec<u64> {
        table(name).numbers("shift.x").iter().map(|v| v.to_bits()).collect()
    };
    let mut all: Vec<u64> = sweeps.iter().flat_map(starts).collect();
    let count = all.len();
    all.sort_unstable();
    all.dedup();
    assert_eq!(all.len(), count, "{sweeps:?}");
}

/// No two samples that are compared share a start, as the rules have it.
#[test]
fn no_two_methods_share_a_start() {
    for reading in Reading::ALL {
        let mut names: Vec<String> = ["dopri5", "radau5", "taylor"]
            .map(|m| format!("capture/{m}-{}", reading.word()))
            .into();
        names.retain(|name| path(&format!("papers/jeffrey-2013/code/{name}.csv")).exists());
        let all: Vec<&str> =
            ["census/fig7"].into_iter().chain(names.iter().map(String::as_str)).collect();
        share_no_start(&all);
    }
}

/// Rows that are quick, computed anew: the same to the last bit; and visits.
#[test]
fn committed_rows_of_the_study_come_out_the_same() {
    come_out_the_same(&[
        ("capture/dopri5-printed", 3),
        ("capture/taylor-printed", 3),
        ("capture/map7", 4),
    ]);
    let table = audit::visits().unwrap();
    for (i, at) in visits::CANDIDATES.into_iter().enumerate() {
        assert_eq!(
            f64::from(visits::visits(at, 7).unwrap()),
            table.numbers("visits")[30 * i + 7],
            "{at:?}"
        );
    }
}

/// The project's statement about the printed numbers follows from the runs.
#[test]
fn the_likelihood_of_the_printed_numbers_is_bounded_without_a_prior() {
    let candidates = audit::candidates().unwrap();
    let printed = candidates.iter().find(|c| c.at == [1e-3, 1e-5]).unwrap();
    assert_eq!(printed.hits[..7].iter().filter(|k| **k == 0).count(), 4);
    let most: f64 =
        printed.hits.iter().zip(printed.runs).map(|(k, n)| wilson(*k, n, 0.95)[1]).product();
    assert!(most < 1e-3, "{most}");
    println!(
        "{}\n{}",
        capture::likelihood_text(&candidates, &claims().rules),
        capture::priors_text(&candidates, &claims().rules)
    );
}
