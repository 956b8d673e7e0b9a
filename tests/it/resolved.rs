//! The census by methods that resolve the layer: docs/resolved.md says what code/resolved says.
//! `TWOFOLD_UPDATE=1 cargo test --test it resolved::` writes the texts anew.

use twofold::jeffrey_2013::Reading;
use twofold::jeffrey_2013::study::census::{CensusPanel, PANELS};
use twofold::jeffrey_2013::study::claims::claims;
use twofold::jeffrey_2013::study::effects::LogRank;
use twofold::jeffrey_2013::study::resolved::{self, Belongs, Compared, compared};
use twofold::jeffrey_2013::study::{capture, census};
use twofold::job::encode::from_csv;
use twofold::job::table::{Entry, Table};

use crate::capture::{come_out_the_same, page_says, share_no_start, table};
use crate::census::path;

fn tables(names: &[&str]) -> Vec<Table> {
    names.iter().map(|name| table(name)).collect()
}

fn lsoda() -> Vec<Table> {
    tables(&["census/fig7", "census/fig8"])
}

fn taylor() -> Vec<Table> {
    tables(&["resolved/taylor7", "resolved/taylor8"])
}

#[test]
fn the_page_says_what_the_runs_say() {
    let rules = &claims().rules;
    let (lsoda, taylor) = (lsoda(), taylor());
    let against_lsoda = compared(&lsoda, &taylor);
    assert_eq!(against_lsoda.len(), 12);
    assert!(against_lsoda.iter().all(|c| c.reference.len() == 300 && c.runs.len() == 100));
    let tolerances: Vec<_> = Reading::ALL
        .into_iter()
        .map(|reading| {
            let alpha = || vec![("params.alpha", Entry::Number(reading.caricature().alpha))];
            let tight =
                census::runs(&table(&format!("capture/taylor-{}", reading.word())), &alpha());
            (reading, PANELS[2].runs(&taylor[0], alpha()), tight)
        })
        .collect();
    let texts = [
        resolved::kinds_text(&through_the_passage(&RULED), ["double-double", "the method"], rules),
        resolved::outcomes_text(&against_lsoda, rules),
        resolved::kinds_text(&against_lsoda, ["LSODA", "Taylor 10⁻¹³"], rules),
        resolved::tolerance_text(&tolerances, rules),
    ];
    page_says("docs/resolved.md", resolved::BEGIN, resolved::END, &texts);
}

/// The methods that the rules compare with runs in double-double, and their sweeps.
const RULED: [(&str, &str); 2] =
    [("7(iii), Taylor 10⁻¹³", "resolved/taylor7"), ("7(iii), layered 10⁻¹³", "resolved/layered7")];

/// Fig. 7(iii) by each method beside runs in double-double, whose errors stay small behind a
/// passage.
fn through_the_passage(methods: &[(&'static str, &str)]) -> Vec<Compared> {
    let of = |reading: Reading| {
        let exact = table(&format!("resolved/extended-{}", reading.word()));
        let alpha = move || vec![("params.alpha", Entry::Number(reading.caricature().alpha))];
        methods.iter().map(move |(name, file)| Compared {
            reading,
            panel: CensusPanel { name, ..PANELS[2] },
            reference: census::runs(&exact, &[]),
            runs: PANELS[2].runs(&table(file), alpha()),
        })
    };
    Reading::ALL.into_iter().flat_map(of).collect()
}

fn ranks(all: &[Compared], end: f64) -> Vec<LogRank> {
    let times =
        |runs: &[census::CensusRun]| runs.iter().map(|r| capture::time(r, end)).collect::<Vec<_>>();
    all.iter().map(|c| LogRank::of(&times(&c.runs), &times(&c.reference))).collect()
}

/// The page's words: the Taylor method captures as runs in double-double do, the layered one in the
/// printed reading does not, and LSODA is sooner in both.
#[test]
fn the_layered_method_does_not_follow_the_passage_of_the_printed_reading() {
    let rules = &claims().rules;
    let all = through_the_passage(&RULED);
    assert!(all.iter().zip([100, 100, 60, 60]).all(|(c, n)| c.reference.len() == n));
    assert!(all.iter().all(|c| c.runs.len() == 100));
    let [taylor, layered, others @ ..] = &ranks(&all, rules.end)[..] else { unreachable!() };
    assert!(taylor.p() > rules.significance && layered.p() < 1e-3);
    assert!(others.iter().all(|rank| rank.p() > rules.significance));
    let [ratio, taylor] = [layered, taylor].map(|rank| rank.hazard_ratio(rules.confidence));
    assert!(ratio.interval[1] < 0.05, "{ratio:?}");
    assert!(taylor.interval[0] > 0.8 && taylor.interval[1] < 1.6, "{taylor:?}");
    let page = std::fs::read_to_string(path("docs/resolved.md")).unwrap();
    for rank in ranks(&through_the_passage(&[("", "census/fig7")]), rules.end) {
        let ratio = rank.hazard_ratio(rules.confidence);
        let said =
            format!("{:.2} [{:.2}, {:.2}]", ratio.value, ratio.interval[0], ratio.interval[1]);
        assert!(page.contains(&said), "{said}");
    }
}

/// The page's places where the paper's orbit, printed reading, first crosses y = 0 behind its first
/// passage: they change with the method, its tolerance and the restarts, but in double-double.
#[test]
fn local_errors_decide_where_an_orbit_leaves_the_first_passage() {
    let first = |method: &str, tolerance: &str, interval: &str| {
        let arguments = "run --quiet --reading printed --t-end 101 --section y=0 --method";
        let more = [method, "--rtol", tolerance, "--atol", tolerance, "--restart", interval];
        let output = std::process::Command::new(env!("CARGO_BIN_EXE_twofold"))
            .args(arguments.split(' '))
            .args(more)
            .output()
            .unwrap();
        assert!(output.status.success(), "{method}");
        let table = from_csv(&output.stdout).unwrap().1;
        let row = table.numbers("t").iter().position(|t| *t > 54.5).unwrap();
        table.numbers("x")[row]
    };
    for (method, tolerance, places) in [
        ("taylor", "1e-13", ["0.005", "0.082"]),
        ("taylor", "1e-15", ["0.095", "0.006"]),
        ("layered", "1e-13", ["0.092", "0.092"]),
    ] {
        let found =
            ["20", "100"].map(|interval| format!("{:.3}", first(method, tolerance, interval)));
        assert_eq!(found, places, "{method} {tolerance}");
    }
    for tolerance in ["1e-22", "1e-25", "1e-30"] {
        let found = ["20", "100"].map(|interval| first("taylor-extended", tolerance, interval));
        assert!(found.iter().all(|x| (x - 0.103_314_69).abs() < 2e-8), "{tolerance} {found:?}");
    }
}

/// No start is shared with LSODA or between methods, as the rules have it; fig. 7 and 8 share none
/// either.
#[test]
fn no_two_samples_share_a_start() {
    for extended in ["resolved/extended-printed", "resolved/extended-reconstructed"] {
        share_no_start(&[
            "census/fig7",
            "resolved/taylor7",
            "resolved/taylor8",
            "resolved/layered7",
            extended,
        ]);
    }
}

/// Rows that are quick, computed anew: the same to the last bit.
#[test]
fn committed_rows_come_out_the_same() {
    come_out_the_same(&[
        ("resolved/taylor7", 2),
        ("resolved/taylor8", 2),
        ("resolved/layered7", 2),
    ]);
}

/// The page's statements about whose the outcomes are, and that the two resolving methods do not
/// agree in the printed reading, follow from the runs.
#[test]
fn outcomes_belong_to_whom_the_page_says() {
    use Belongs::{Neither, OtherOdds, System};
    let rules = &claims().rules;
    let found: Vec<Belongs> = resolved::belongs(&compared(&lsoda(), &taylor()), rules)
        .into_iter()
        .map(|(whose, _)| whose)
        .collect();
    let printed = [System, Neither, Neither, Neither, System, System];
    assert_eq!(
        found,
        [printed, [OtherOdds, System, System, System, OtherOdds, OtherOdds]].concat()
    );
    let methods = compared(&taylor(), &tables(&["resolved/layered7"]));
    let ratio = |c: &resolved::Compared| {
        let times = |runs: &[census::CensusRun]| {
            runs.iter().map(|r| capture::time(r, rules.end)).collect::<Vec<_>>()
        };
        LogRank::of(&times(&c.runs), &times(&c.reference)).hazard_ratio(rules.confidence)
    };
    assert!(methods[..3].iter().all(|c| ratio(c).interval[1] < 0.5));
    let [first, second, third] = [3, 4, 5].map(|i| ratio(&methods[i]).interval);
    assert!([first, third].iter().all(|[low, high]| *low < 1.0 && *high > 1.0));
    assert!(second[0] > 1.0);
}
