use super::*;
use crate::question::question_hash;
use crate::spec::*;
use twofold_system::Caricature;

fn sweep(axes: &[&str], draws: Option<u64>) -> Sweep {
    let section = Observation::Section { coordinate: 1, value: 0.0 };
    let run = crate::cases::run(
        Caricature::with_reinjection(1e-1, 1e-5).into(),
        SwitchSpec::tanh(1e-3),
        60.0,
        section,
    );
    let axes = axes.iter().map(|a| a.parse().unwrap()).collect();
    Sweep::new(run, axes, draws.map(|count| crate::sweep::Draws { count, seed: 1 })).unwrap()
}

fn failed(sweep: &Sweep, number: u64) -> Row {
    let key = question_hash(&sweep.question(number).unwrap());
    Row::failed(number, sweep.settings(number), Some(&key), format!("why {number}\nindeed"))
}

/// Every cell of a row that was found and of one that failed stands in its column.
#[test]
fn rows_say_what_was_found() {
    let sweep = sweep(&["eps=1e-2,1e-3"], None);
    let key = Hash::of(b"a question");
    let outcome = Outcome {
        word: "period-3".into(),
        period: 3,
        captured_at: Some(1.0),
        settled_at: Some(2.0),
        radius: Some(3.0),
        rate: Some(4.0),
        turn: Some(6.0),
        exponent: Some(7.0),
        exponent_error: None,
        crossings: 8,
        end: 9.0,
        steps: 10,
    };
    let mut rows = Rows::of(sweep.clone());
    assert!(rows.is_empty() && rows.get(0).is_none() && !rows.has(0));
    let found = Row::found(0, sweep.settings(0), &key, outcome);
    assert_eq!((found.number(), found.outcome(), found.reason()), (0, "period-3", None));
    assert_eq!(format!("{:015x}", found.key()), key.as_str()[..15]);
    let unasked = Row::failed(1, sweep.settings(1), None, "why 1\u{1b}indeed".into());
    assert_eq!((unasked.reason(), unasked.key()), (Some("why 1 indeed"), 0));
    rows.insert(found.clone()).unwrap();
    rows.insert(failed(&sweep, 1)).unwrap();
    assert!(!rows.is_empty() && rows.len() == 2 && rows.has(1));
    assert_eq!(rows.get(0).unwrap().line(), found.line());
    let table = rows.table();
    for (name, value) in [
        ("eps", 1e-2),
        ("captured_at", 1.0),
        ("settled_at", 2.0),
        ("radius", 3.0),
        ("rate", 4.0),
        ("turn", 6.0),
        ("exponent", 7.0),
        ("end", 9.0),
    ] {
        assert_eq!(table.numbers(name)[0], value, "{name}");
        assert!(name == "eps" || table.numbers(name)[1].is_nan(), "{name}");
    }
    assert!(table.numbers("exponent_error").iter().all(|v| v.is_nan()));
    for (name, values) in
        [("period", [3, 0]), ("crossings", [8, 0]), ("steps", [10, 0]), ("row", [0, 1])]
    {
        assert_eq!(table.integers(name), values, "{name}");
    }
    assert_eq!(table.words("outcome").collect::<Vec<_>>(), ["period-3", "failed"]);
    assert_eq!(table.words("reason").collect::<Vec<_>>(), ["", "why 1 indeed"]);
    assert_eq!(rows.counts(), [("failed".to_owned(), 1), ("period-3".to_owned(), 1)].into());
}

/// Fewer draws keep the first rows, more keep all; and both are the rows of the other sweep.
#[test]
fn rows_of_other_draws_are_kept() {
    let axes = ["shift.x=0..1", "eps=1e-2,1e-3"];
    let mut rows = Rows::of(sweep(&axes, Some(3)));
    (0..6)
        .filter(|n| *n != 2)
        .for_each(|n| rows.insert(failed(&sweep(&axes, Some(3)), n)).unwrap());
    for (draws, kept) in [(1, vec![0, 1]), (2, vec![0, 1, 3]), (5, vec![0, 1, 3, 4, 5])] {
        let other = rows.with_draws(draws).unwrap();
        assert_eq!(other.sweep(), &sweep(&axes, Some(draws)));
        assert_eq!(other.iter().map(|row| row.number()).collect::<Vec<_>>(), kept);
    }
    assert!(Rows::of(sweep(&["eps=1e-2"], None)).with_draws(5).is_none());
}

/// A file whose columns, rows, heading or order of cells were changed is not one of ours.
#[test]
fn a_changed_file_is_refused() {
    let sweep = sweep(&["eps=1e-2,1e-3"], None);
    let mut rows = Rows::of(sweep.clone());
    (0..2).for_each(|n| rows.insert(failed(&sweep, n)).unwrap());
    let file = String::from_utf8(rows.csv()).unwrap();
    assert_eq!(Rows::from_csv(file.as_bytes()).unwrap().csv(), rows.csv());
    let integer = "{\"kind\":\"integer\",\"name\":\"period\"";
    for (from, to, word) in [
        ("captured_at", "captivated", "columns"),
        (integer, &*integer.replace("integer", "number"), "columns"),
        ("why 1", "why 7", "not those that it was written with"),
        ("\n0.001,", "\n0.002,", "not those that it was written with"),
        ("twofold-sweep", "twofold-sweet", "does not say"),
        ("\"version\":3", "\"version\":2", "does not say"),
        (NUMERICS, "another", "not those that it was written with"),
        ("\"rows\":2", "\"rows\":3", "not those that it was written with"),
        ("\"t_end\":60", "\"t_end\":61", "its spec is not the one"),
        (",1\n", ",-1\n", "no number"),
    ] {
        assert!(file.contains(from), "{from}: {file}");
        let error = Rows::from_csv(file.replace(from, to).as_bytes()).unwrap_err().to_string();
        assert!(error.contains(word), "{from} {to}: {error}");
    }
    // A journal's rows are as long as their heading says, and of its kinds.
    let journal = rows.journal();
    let with = |line: &str| Rows::from_journal(&[journal[0].clone(), line.to_owned()]);
    assert_eq!(with(&journal[2]).unwrap().len(), 1);
    for (from, to, word) in [
        (",1]", "]", "another length"),
        (",1]", ",-1]", "no number"),
        (",1]", ",0.5]", "kinds"),
        ("[", "", "not a list"),
    ] {
        assert!(journal[2].contains(from), "{}", journal[2]);
        let error = with(&journal[2].replacen(from, to, 1)).unwrap_err().to_string();
        assert!(error.contains(word), "{from} {to}: {error}");
    }
    assert!(Rows::from_journal(&[]).unwrap_err().to_string().contains("no heading"));
    // Parts of two sweeps.
    let error = rows.merge(Rows::of(self::sweep(&["eps=1e-2"], None))).unwrap_err().to_string();
    assert!(error.contains("different sweeps"), "{error}");
    assert_eq!(rows.journal(), journal);
}

/// A row that does not belong to its number is refused, even if its digest is right.
#[test]
fn rows_are_those_of_their_numbers() {
    let sweep = sweep(&["eps=1e-2,1e-3"], None);
    let mut rows = Rows::of(sweep.clone());
    (0..2).for_each(|n| rows.insert(failed(&sweep, n)).unwrap());
    let journal = rows.journal();
    let key = rows.get(1).unwrap().key().to_string();
    for (from, to, word) in [
        (",1]", ",2]", "not one of the 2 rows"),
        (",1]", ",9223372036854775807]", "not one of the 2 rows"),
        ("[0.001,", "[0.002,", "other values of what is varied"),
        (&*key, "1", "key of another question"),
        (&*key, "0", "key of another question"),
        ("\"failed\"", "\"=cmd|calc\"", "no word of ours"),
        ("\"failed\"", "\"\\u001b[31m\"", "no word of ours"),
        ("\"failed\"", "\"\"", "no word of ours"),
        ("\"failed\"", "\"period-1\"", "has not failed"),
        ("why 1", "why\\u001b[31m", "control characters"),
        ("\"why 1 indeed\"", "\"\"", "has not failed"),
    ] {
        assert!(journal[2].contains(from), "{from}: {}", journal[2]);
        let forged = [journal[0].clone(), journal[1].clone(), journal[2].replacen(from, to, 1)];
        let error = Rows::from_journal(&forged).unwrap_err().to_string();
        assert!(error.contains(word) && !error.contains('\u{1b}'), "{from} {to}: {error}");
    }
    // In a table, too: with a digest of its own.
    let mut forged = rows.clone();
    let line = journal[2].replacen("[0.001,", "[0.002,", 1);
    forged.lines.insert(1, line);
    let error = Rows::from_csv(&forged.csv()).unwrap_err().to_string();
    assert!(error.contains("other values of what is varied"), "{error}");
}

/// Rows of two versions are not mixed, unless one was rechecked by the other: then the whole
/// names both.
#[test]
fn versions_are_kept_side_by_side() {
    let sweep = sweep(&["eps=1e-2,1e-3"], None);
    let mut rows = Rows::of(sweep.clone());
    rows.insert(failed(&sweep, 0)).unwrap();
    let other = rows.journal_heading().replace(NUMERICS, "another");
    let mut whole = Rows::from_journal(&[other, failed(&sweep, 1).line()]).unwrap();
    assert_eq!(whole.numerics().collect::<Vec<_>>(), ["another"]);
    let error = whole.merge(rows.clone()).unwrap_err().to_string();
    assert!(
        error.contains("another version of the numerics") && error.contains(NUMERICS),
        "{error}"
    );
    whole.merge_rechecked(rows.clone()).unwrap();
    assert_eq!((whole.len(), whole.numerics().count()), (2, 2));
    // A version that stands for both stands for each.
    rows.clone().merge(whole.clone()).unwrap();
    let both = [whole.journal(), rows.journal()].concat();
    assert_eq!(Rows::from_journal(&both).unwrap().journal(), whole.journal());
}

/// Every way to have some of four rows in three parts: merged in any grouping and order they
/// are the same rows, and one row with two contents is refused wherever it stands.
#[test]
fn every_small_merge_is_a_union() {
    let run = RunSpec {
        system: Caricature::with_reinjection(1e-1, 1e-5).into(),
        switch: SwitchSpec::tanh(1e-3),
        start: vec![0.2, 0.0, -1.0],
        t_end: 60.0,
        method: MethodSpec::ndsolve_defaults(Method::Dopri5),
        schedule: Default::default(),
        observe: Observation::Section { coordinate: 1, value: 0.0 },
    };
    let sweep = Sweep::new(run, vec!["interval=1,2,3,4".parse().unwrap()], None).unwrap();
    let row = |number: u64, reason: &str| {
        Row::failed(number, sweep.settings(number), None, reason.to_owned())
    };
    let part = |set: u32| {
        let mut rows = Rows::of(sweep.clone());
        (0..4).filter(|i| set >> i & 1 == 1).for_each(|i| rows.insert(row(i, "why")).unwrap());
        rows
    };
    let union = |parts: [u32; 3]| {
        let mut rows = part(parts[0]);
        rows.merge(part(parts[1])).unwrap();
        rows.merge(part(parts[2])).unwrap();
        rows.journal()
    };
    for parts in 0..16_u32.pow(3) {
        let [a, b, c] = [parts & 15, parts >> 4 & 15, parts >> 8];
        let wanted = part(a | b | c).journal();
        assert_eq!(union([a, b, c]), wanted, "{a:b} {b:b} {c:b}");
        let mut later = part(b);
        later.merge(part(c)).unwrap();
        let mut rows = part(a);
        rows.merge(later).unwrap();
        assert_eq!(rows.journal(), wanted, "the other way round: {a:b} {b:b} {c:b}");
        let missing: Vec<u64> = (0..4).filter(|i| (a | b | c) >> i & 1 == 0).collect();
        assert_eq!(rows.missing(Shard::WHOLE).collect::<Vec<_>>(), missing);
        assert_eq!(rows.missing_count(Shard::WHOLE), missing.len() as u64);
    }
    for number in 0..4 {
        let mut rows = part(15);
        let mut other = Rows::of(sweep.clone());
        other.insert(row(number, "another")).unwrap();
        assert_eq!(rows.merge(other), Err(RowsError::Conflict(number)));
        assert_eq!(rows.insert(row(number, "another")), Err(RowsError::Conflict(number)));
        assert_eq!(rows.insert(row(number, "why")), Ok(()));
    }
    // Every shard of every number of shards: each row once.
    for n in 1..=6 {
        let mut all: Vec<u64> = (1..=n).flat_map(|k| Shard { k, n }.rows(&sweep)).collect();
        for shard in (1..=n).map(|k| Shard { k, n }) {
            let rows = part(5).missing(shard).collect::<Vec<_>>();
            assert_eq!(rows, [1, 3].into_iter().filter(|row| shard.has(*row)).collect::<Vec<_>>());
            assert_eq!(part(5).missing_count(shard), rows.len() as u64);
            assert_eq!(shard.count(&sweep), shard.rows(&sweep).count() as u64);
        }
        all.sort_unstable();
        assert_eq!(all, [0, 1, 2, 3], "{n} shards");
    }
}
