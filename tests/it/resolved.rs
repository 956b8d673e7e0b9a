//! The census by methods that resolve the layer: docs/resolved.md says what figures/resolved says.
//! `TWOFOLD_UPDATE=1 cargo test --test it resolved::` writes the texts anew.

use twofold::job::table::{Entry, Table};
use twofold::paper::census::{CensusPanel, PANELS};
use twofold::paper::claims::claims;
use twofold::paper::effects::LogRank;
use twofold::paper::resolved::{self, Belongs, Compared, compared};
use twofold::paper::{Reading, capture, census};

use crate::capture::{come_out_the_same, page_says, share_no_start, table};

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
        resolved::kinds_text(&through_the_passage(), ["double-double", "the method"], rules),
        resolved::outcomes_text(&against_lsoda, rules),
        resolved::kinds_text(&against_lsoda, ["LSODA", "Taylor 10⁻¹³"], rules),
        resolved::tolerance_text(&tolerances, rules),
    ];
    page_says("docs/resolved.md", resolved::BEGIN, resolved::END, &texts);
}

/// Fig. 7(iii) by each method beside runs in double-double, whose errors stay small behind a
/// passage.
fn through_the_passage() -> Vec<Compared> {
    let methods = [
        ("7(iii), Taylor 10⁻¹³", "resolved/taylor7"),
        ("7(iii), layered 10⁻¹³", "resolved/layered7"),
        ("7(iii), LSODA", "census/fig7"),
    ];
    let of = |reading: Reading| {
        let exact = table(&format!("resolved/extended-{}", reading.word()));
        let alpha = move || vec![("params.alpha", Entry::Number(reading.caricature().alpha))];
        methods.map(move |(name, file)| Compared {
            reading,
            panel: CensusPanel { name, ..PANELS[2] },
            reference: census::runs(&exact, &[]),
            runs: PANELS[2].runs(&table(file), alpha()),
        })
    };
    Reading::ALL.into_iter().flat_map(of).collect()
}

/// The page's words about the two methods that were called resolving: the Taylor method captures as
/// runs in double-double do, the layered one does not.
#[test]
fn the_layered_method_does_not_follow_the_passage_of_the_printed_reading() {
    let rules = &claims().rules;
    let all = through_the_passage();
    assert!(all.iter().zip([100, 100, 100, 60, 60, 60]).all(|(c, n)| c.reference.len() == n));
    let ranks = [0, 1, 3, 4].map(|i| &all[i]).map(|c| {
        let times = |runs: &[census::CensusRun]| {
            runs.iter().map(|r| capture::time(r, rules.end)).collect::<Vec<_>>()
        };
        LogRank::of(&times(&c.runs), &times(&c.reference))
    });
    let [taylor, layered, others @ ..] = ranks;
    assert!(taylor.p() > rules.significance && layered.p() < 1e-3);
    assert!(others.iter().all(|rank| rank.p() > rules.significance));
    let [ratio, taylor] = [layered, taylor].map(|rank| rank.hazard_ratio(rules.confidence));
    assert!(ratio.interval[1] < 0.05, "{ratio:?}");
    assert!(taylor.interval[0] > 0.8 && taylor.interval[1] < 1.6, "{taylor:?}");
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
