//! Checks of made-up answers.

use super::read::{Onset, onset, periods, share};
use super::*;

fn circle(count: usize, turn: f64) -> Vec<Vec<f64>> {
    (0..count).map(|i| vec![(turn * i as f64).cos(), (turn * i as f64).sin()]).collect()
}

#[test]
fn a_period_is_the_shortest_one_and_needs_three_turns() {
    let third = std::f64::consts::TAU / 3.0;
    assert_eq!(period(&circle(300, third), 1e-6), Some(3));
    assert_eq!(period(&circle(8, third), 1e-6), None);
    assert_eq!(period(&circle(300, 1.0), 1e-6), None);
    assert_eq!(period(&vec![vec![2.0, 3.0]; 9], 1e-6), Some(1));
}

/// Nine crossings of a period of two, of which the later half is looked at.
#[test]
fn a_section_that_is_too_short_for_a_period_is_not_judged() {
    let columns = ["t", "x"].map(crate::job::Column::numbers);
    let mut table = Table::new("section", columns);
    for i in 0..9 {
        let cells = [f64::from(i), f64::from(i % 2)];
        table.push(Vec::from(cells.map(crate::job::Entry::Number)));
    }
    let answer = [Arc::new(Answer::of_tables(vec![table]))];
    let judged = |is| Check::Period { is, within: 1e-6 }.of(&answer, 1e-9);
    assert_eq!(judged(1), Ok((false, "no period up to 1".into())));
    assert!(judged(2).unwrap_err().contains("4 times in the later half"));
}

/// A multiplier of -0.92 a turn around four points; of -0.95 around one; what comes to a torus.
#[test]
fn an_orbit_that_is_still_approached_has_its_period() {
    let four = [1.0, -2.0, 3.0, -5.0];
    let way = |places: &[f64], q: f64, turns: usize| -> Vec<Vec<f64>> {
        let n = places.len();
        let at = |i: usize| places[i % n] * (1.0 + 0.1 * q.powi((i / n) as i32));
        (0..n * turns).map(|i| vec![at(i), 1.0]).collect()
    };
    for (points, want) in [(way(&four, -0.92, 60), 4), (way(&[1.0], -0.95, 120), 1)] {
        assert_eq!((period(&points, 1e-6), approached(&points)), (None, Some(want)));
    }
    // Too little of the way is seen, or it leads to a ring of its own.
    assert_eq!(approached(&way(&four, -0.92, 12)), None);
    assert_eq!(approached(&way(&four, -0.999, 100)), None);
    assert_eq!(approached(&circle(500, 1.0)), None);
    let slow: Vec<Vec<f64>> = (100..300).map(|i| vec![100.0 / f64::from(i), 1.0]).collect();
    assert_eq!(approached(&slow), None);
    let ring: Vec<Vec<f64>> = (0..500)
        .map(|i| vec![0.98_f64.powi(i) + 0.05 * f64::from(i).cos(), f64::from(i).sin() * 0.05])
        .collect();
    assert_eq!(approached(&ring), None);
}

/// Crossings up and down of a focus at 0, and of an orbit of radius 1 with the same approach.
#[test]
fn a_rest_that_is_approached_has_no_period() {
    for (radius, found) in [(0.0, "no period up to 64"), (1.0, "period 1, still approached")] {
        let columns = [crate::job::Column::numbers("t"), crate::job::Column::numbers("x")];
        let direction = crate::job::Column::words("direction");
        let mut table = Table::new("section", columns.into_iter().chain([direction]));
        for i in 0..800 {
            let x = radius + 0.99_f64.powi(i);
            let word = ["up", "down"][i as usize % 2];
            table.push([
                crate::job::Entry::Number(f64::from(i)),
                crate::job::Entry::Number(if i % 2 == 0 { x } else { -x }),
                crate::job::Entry::Word(word.into()),
            ]);
        }
        let answer = [Arc::new(Answer::of_tables(vec![table]))];
        let judged = Check::Period { is: 1, within: 1e-6 }.of(&answer, 0.0).unwrap();
        assert_eq!(judged, (radius > 0.0, found.into()));
    }
}

#[test]
fn sets_are_as_far_apart_as_their_farthest_points() {
    let (a, b) = (circle(2000, 1.0), circle(1500, 0.7));
    let apart = |a: &[Vec<f64>], b: &[Vec<f64>]| apart([a, b], [a, b]).unwrap();
    assert!(apart(&a, &b) < 0.02);
    let moved: Vec<Vec<f64>> = b.iter().map(|p| vec![p[0] + 1.0, p[1]]).collect();
    assert!((apart(&a, &moved) - 0.5).abs() < 0.02);
}

/// A state that moves little beside another one counts as much; one that moves by errors not.
#[test]
fn each_state_is_measured_by_its_own_extent() {
    let points = |z: &dyn Fn(f64) -> f64| -> Vec<Vec<f64>> {
        (0..64).map(|i| vec![1000.0 * f64::from(i % 2), z(f64::from(i))]).collect()
    };
    let apart = |a: &[Vec<f64>], b: &[Vec<f64>]| apart([a, b], [a, b]).unwrap();
    assert_eq!(apart(&points(&|_| 1.0), &points(&|_| 2.0)), 0.5);
    let noisy = |i: f64| 1.0 + 1e-4 * (i * i).sin();
    assert!(apart(&points(&|_| 1.0), &points(&noisy)) < 1e-3);
    // A state that shrinks is on its way, and its extent no measure.
    let on_its_way = |way: f64| points(&|i| way * (-0.05 * i).exp() * i.cos());
    assert!(apart(&on_its_way(10.0), &on_its_way(4.0)) < 0.01);
    assert_eq!(period(&points(&|_| 1.0), 1e-6), Some(2));
    assert_eq!(period(&points(&noisy), 1e-6), Some(2));
    assert_eq!(period(&points(&|i| 0.01 * (i % 4.0)), 1e-3), Some(4));
    assert_eq!(period(&points(&|i| 0.01 * (i % 4.0) + 1e-6 * (i * i).sin()), 1e-3), Some(4));
}

#[test]
fn numbers_are_read_by_path_and_by_column() {
    let mut table = Table::new("branch", vec![crate::job::Column::numbers("p")]);
    for v in [3.0, 1.0, 2.0] {
        table.push(vec![crate::job::Entry::Number(v)]);
    }
    let answer = Answer::of_tables(vec![table]).with_fact("multipliers", &[[3.0, 4.0], [0.5, 0.0]]);
    let fact = |path: &str, modulus| Read::Fact { path: path.into(), modulus }.of(&answer);
    assert_eq!(fact("multipliers/1/0", false), Ok(0.5));
    assert_eq!(fact("multipliers/0", true), Ok(5.0));
    assert!(fact("multiplier", false).unwrap_err().contains("it has multipliers"));
    assert!(fact("multipliers/7/0", false).unwrap_err().contains("no \"7\""));
    let column = |take| {
        Read::Column { table: None, column: "p".into(), take, word: None }.of(&answer).unwrap()
    };
    let found =
        [Take::Last, Take::First, Take::Max, Take::Min, Take::Mean, Take::Span, Take::Count]
            .map(column);
    assert_eq!(found, [2.0, 3.0, 3.0, 1.0, 2.0, 2.0, 3.0]);
}

/// A bouncing ball to t = 4, whose mean height 0.233163 follows from its parabolas; its rows of
/// events crowd where it comes to rest.
#[test]
fn a_mean_is_one_over_time_and_a_count_has_no_rows_of_events() {
    use crate::hybrid::motion::Record;
    use crate::hybrid::{Definition, Model, Options};
    use crate::job::general::GeneralRun;
    let text = "states = ['x', 'v']\nstart = [1, 0]\nf = ['v', '-9.81']\n[[event]]\n\
        when = 'x'\ndirection = 'down'\nset = { v = '-0.8*v' }\nafter_zeno = 'stick'";
    let model = Model::new(Definition::from_toml(text, "ball").unwrap());
    let found = |record: Record, take, equals: f64, within: f64| {
        let options = Options { t_end: 4.0, record, ..Options::default() };
        let run: AnyQuestion = Arc::new(GeneralRun { model: model.clone(), options });
        let (answer, run) = (Executor::quiet().ask(&*run).unwrap(), [run]);
        let column = "x".to_owned();
        let read = Read::Column { table: None, column, take, word: None };
        let check = Check::Value { read, equals, within };
        check.of(&check.rows_of(&run, &[answer]), 0.0).unwrap()
    };
    let times = || Record::Times { every: 0.01 };
    // The trapezoidal rule errs by 9.81*0.01^2/12 = 8.2e-5, or by two thirds of the chord.
    for record in [times(), Record::Path { chord: 1e-4 }] {
        let mean = found(record, Take::Mean, 0.233163, 1e-4);
        assert!(mean.0, "{}", mean.1);
    }
    let count = found(times(), Take::Count, 401.0, 0.0);
    assert!(count.0, "{}", count.1);
    // The last impact stays the lowest point, and a path has the rows that it has.
    let lowest = found(times(), Take::Min, 0.0, 1e-12);
    assert!(lowest.0, "{}", lowest.1);
    let path = found(Record::Path { chord: 1e-3 }, Take::Count, 401.0, 0.0);
    assert!(!path.0, "{}", path.1);
}

#[test]
fn blank_cells_are_no_numbers() {
    let read = |cells: &[f64], take| {
        let mut table = Table::new("path", vec![crate::job::Column::numbers("p")]);
        cells.iter().for_each(|v| table.push(vec![crate::job::Entry::Number(*v)]));
        Read::Column { table: None, column: "p".into(), take, word: None }
            .of(&Answer::of_tables(vec![table]))
    };
    for take in [Take::Last, Take::First, Take::Max, Take::Min, Take::Mean, Take::Span] {
        assert!(read(&[f64::NAN; 2], take).unwrap_err().contains("blank in every row"));
    }
    assert_eq!(read(&[1.0, f64::NAN, 3.0], Take::Mean), Ok(2.0));
    assert_eq!(read(&[1.0, f64::NAN, 3.0], Take::Last), Ok(3.0));
    assert!(read(&[1.0, f64::NAN], Take::Last).unwrap_err().contains("blank in that row"));
}

fn rows(outcomes: &[(f64, &str)]) -> Table {
    let columns = [crate::job::Column::numbers("p"), crate::job::Column::words("outcome")];
    let mut table = Table::new("sweep", columns);
    for (p, outcome) in outcomes {
        let word = crate::job::Entry::Word((*outcome).into());
        table.push([crate::job::Entry::Number(*p), word]);
    }
    table
}

/// The outcome changes between two rows that have one; what is open between them leaves open
/// where.
#[test]
fn an_onset_lies_between_rows_that_are_decided() {
    let [one, two, open] = ["period-1", "period-2", "undecided"];
    let of = |outcomes: &[(f64, &str)]| onset(&rows(outcomes), "p", two, 0.0);
    assert_eq!(of(&[(1.0, one), (2.0, two), (3.0, one)]), Ok(Onset::Between(1.0, 2.0)));
    let widened = of(&[(4.0, one), (3.0, open), (2.0, "failed"), (1.0, two)]);
    assert_eq!(widened, Ok(Onset::Between(4.0, 1.0)));
    assert_eq!(of(&[(1.0, one), (2.0, "rest")]), Ok(Onset::Never(1.0, 2.0)));
    for (outcomes, why) in [
        (&[(1.0, open), (2.0, two)][..], "no outcome before it"),
        (&[(1.0, one), (2.0, open)], "some are open"),
        (&[(1.0, one), (3.0, one), (2.0, two)], "do not go one way"),
        (&[(1.0, one), (1.0, two)], "do not go one way"),
        (&[], "has no rows"),
    ] {
        let found = of(outcomes).unwrap_err();
        assert!(found.contains(why), "{found}");
    }
    // A claim differs if it never begins in rows that reach far enough, and on those alone.
    let (table, word) = (None, Some(two.to_owned()));
    let read = Read::Column { table, column: "p".into(), take: Take::Onset, word };
    let answer = [Arc::new(Answer::of_tables(vec![rows(&[(1.0, one), (2.0, one)])]))];
    let judged =
        |equals| Check::Value { read: read.clone(), equals, within: 0.25 }.of(&answer, 0.0);
    assert_eq!(judged(1.5).map(|(agrees, _)| agrees), Ok(false));
    assert!(judged(1.9).unwrap_err().contains("do not reach so far"));
    let order = Check::Order { read, less: false, than: Some(1.5), other: None };
    assert!(order.of(&answer, 0.0).unwrap_err().contains("does not begin"));
}

/// Wilson's interval of 9 of 10 is 0.596 to 0.982; rows that are open may be of either kind.
#[test]
fn a_share_has_an_interval_that_open_rows_widen() {
    let of = |hits: usize, open: usize| {
        let words = |i| {
            if i < hits {
                "rest"
            } else if i < hits + open {
                "failed"
            } else {
                "far"
            }
        };
        let outcomes: Vec<(f64, &str)> = (0..10).map(|i| (i as f64, words(i))).collect();
        share(&rows(&outcomes), "outcome", "rest").unwrap()
    };
    let Measured { value, half, how } = of(9, 0);
    assert_eq!((value, how.as_str()), (0.9, "9 of 10 rows are rest: "));
    assert!((half - (0.9 - 0.59585)).abs() < 1e-4, "{half}");
    let Measured { value, half, how } = of(4, 2);
    assert_eq!((value, how.as_str()), (0.4, "4 of 10 rows are rest (2 are open): "));
    assert!((half - (wilson(6, 10, 0.95)[1] - 0.4)).abs() < 1e-12, "{half}");
}

/// Two points in turn, one, and none that come back; a value that was not crossed has no row.
#[test]
fn an_orbit_diagram_has_a_period_at_each_value() {
    let columns = ["params.p", "t", "x"].map(crate::job::Column::numbers);
    let mut table = Table::new("passages", columns);
    let x = |p: i32, i: i32| match p {
        1 => 0.5,
        2 => f64::from(i % 2),
        _ => f64::from(i * i % 97),
    };
    for (p, i) in [1, 2, 4].into_iter().flat_map(|p| (0..30).map(move |i| (p, i))) {
        let cells = [f64::from(p), f64::from(i), x(p, i)];
        table.push(cells.map(crate::job::Entry::Number));
    }
    let values = table.numbers("params.p").to_vec();
    assert_eq!(periods(&table, &values, 1e-9), [(1.0, Some(1)), (2.0, Some(2)), (4.0, None)]);
    assert_eq!(onset(&table, "params.p", "period-2", 1e-9), Ok(Onset::Between(1.0, 2.0)));
}

/// Steps that settle to a cycle of three turns, or to none, on an orbit of one: van der Pol's
/// at rtol 1e-3 to 1e-8 (mu = 1, 3, 8) by dopri5, lsoda and radau5 have such errors.
#[test]
fn errors_of_a_run_have_no_period() {
    let section = |x: &dyn Fn(i32) -> f64| {
        let columns = ["t", "x", "v"].map(crate::job::Column::numbers);
        let mut table = Table::new("section", columns);
        for i in 0..60 {
            table.push([f64::from(i), x(i), 0.0].map(crate::job::Entry::Number));
        }
        [Arc::new(Answer::of_tables(vec![table]))]
    };
    let judged =
        |answer: &[Arc<Answer>; 1], is, rtol| Check::Period { is, within: 1e-6 }.of(answer, rtol);
    let locked = section(&|i| 2.0086 + 2e-5 * f64::from(i % 3));
    let unsettled = section(&|i| 2.0086 + 1e-5 * f64::from(i * i).sin());
    for answer in [&locked, &unsettled] {
        for is in [1, 3] {
            let why = judged(answer, is, 1e-4).unwrap_err();
            assert!(why.contains("period 1 but") && why.contains("rtol 1e-4"), "{why}");
        }
    }
    assert_eq!(judged(&locked, 3, 1e-9), Ok((true, "period 3".into())));
    assert!(judged(&unsettled, 1, 1e-9).unwrap().1.starts_with("no period"));
    // Points that are farther apart than errors are an orbit's.
    let apart = section(&|i| 2.0 + 0.5 * f64::from(i % 3));
    assert_eq!(judged(&apart, 3, 1e-4), Ok((true, "period 3".into())));
    let still = section(&|i| 2.0 + 1e-15 * f64::from(i % 2));
    assert_eq!(judged(&still, 1, 1e-3), Ok((true, "period 1".into())));
    let mut table = locked[0].tables[0].clone();
    table.name = "passages".into();
    assert_eq!(periods(&table, &[0.0; 60], 1e-4), [(0.0, None)]);
    assert_eq!(periods(&table, &[0.0; 60], 1e-9), [(0.0, Some(3))]);
}

/// Crossings that differ by the errors of a run are one point.
#[test]
fn errors_of_a_run_are_no_extent() {
    let points = |noise: &dyn Fn(f64) -> f64| -> Vec<Vec<f64>> {
        (0..30).map(|i| vec![1.0, 0.3 + noise(f64::from(i))]).collect()
    };
    let errors = points(&|i| 1e-8 * (i * i).sin());
    assert_eq!(period(&errors, 1e-3), Some(1));
    let others = points(&|i| 1e-8 * (3.0 * i * i).cos());
    assert!(apart([&errors, &others], [&errors, &others]).unwrap() < 1e-6);
    // Also of a run with larger ones, and beside the crossings on the way back.
    let [a, b] = [1.0, 3.0].map(|k| points(&|i| 1e-5 * (k * i * i).sin()));
    assert!(apart([&a, &b], [&a, &b]).unwrap() < 1e-3);
    let both = |points: &[Vec<f64>]| [points, &[vec![-1.0, -0.3]]].concat();
    let [a, b] = [1.0, 3.0].map(|k| points(&|i| 1e-3 * (k * i * i).sin()));
    assert!(apart([&a, &b], [&both(&a), &both(&b)]).unwrap() < 0.01);
    // Rounding that repeats is none, a small orbit that repeats is one.
    assert_eq!(period(&points(&|i| 1e-16 * (i % 2.0)), 1e-3), Some(1));
    assert_eq!(period(&points(&|i| 1e-7 * (i % 2.0)), 1e-3), Some(2));
    assert_eq!(period(&points(&|i| 1e-5 * (i * i).sin()), 1e-3), None);
}

/// 0.902 beside 0.909, each +- 0.05, and an exponent that is 0 within its interval.
#[test]
fn intervals_that_overlap_decide_nothing() {
    let of = |value: f64| {
        let rate = |value, half_width| MeanRate { value: Some(value), half_width };
        let rates = [rate(value, 0.052), rate(5e-6, 0.01)];
        Arc::new(Answer::of_tables(Vec::new()).with_fact("exponents", &rates))
    };
    let read = |i: usize| Read::Fact { path: format!("exponents/{i}/value"), modulus: false };
    let judged = |check: Check, other: f64| check.of(&[of(0.902), of(other)], 0.0);
    let order = |i, less, than, other| Check::Order { read: read(i), less, than, other };
    for less in [true, false] {
        let found = judged(order(0, less, None, Some(read(0))), 0.909).unwrap_err();
        assert!(found.starts_with("0.902 ± 0.052 beside 0.909 ± 0.052: the int"), "{found}");
        assert!(judged(order(1, less, Some(0.0), None), 0.909).is_err());
        let found = judged(order(0, less, Some(0.5), None), 0.909);
        assert_eq!(found, Ok((!less, "0.902 ± 0.052, greater than 0.5".into())));
        assert_eq!(judged(order(0, less, None, Some(read(0))), 1.1).unwrap().0, less);
    }
    let value = |equals, within| Check::Value { read: read(0), equals, within };
    assert!(judged(value(0.9056, 0.001), 0.9).is_err());
    assert!(judged(value(0.9056, 0.1), 0.9).unwrap().0);
    assert!(!judged(value(0.7, 0.1), 0.9).unwrap().0);
    let ratio = |i, equals| Check::Ratio { read: read(0), other: read(i), equals, within: 0.2 };
    assert!(judged(ratio(1, 1.0), 0.9).is_err() && judged(ratio(0, 1.2), 0.9).is_err());
    assert!(judged(ratio(0, 1.0), 0.9).unwrap().0 && !judged(ratio(0, 2.0), 0.9).unwrap().0);
}

#[test]
fn an_exponent_whose_interval_holds_zero_is_no_verdict() {
    let judged = |value: f64, half_width| {
        let rates = [MeanRate { value: Some(value), half_width }];
        let answer = Answer::of_tables(Vec::new()).with_fact("exponents", &rates);
        Check::Chaos.of(&[Arc::new(answer)], 0.0).map(|(agrees, _)| agrees)
    };
    assert_eq!((judged(0.5, 0.1), judged(-0.5, 0.1)), (Ok(true), Ok(false)));
    for value in [0.0031, -0.0031, 0.0] {
        let why = judged(value, 0.3).unwrap_err();
        assert!(why.contains("the interval does not decide it"), "{why}");
    }
    assert!(judged(0.1, 0.1).is_err());
}

/// `take = "modulus"` of a complex number and of the one that it is compared with.
#[test]
fn a_modulus_is_taken_of_both_numbers() {
    let answer = |pair: [f64; 2]| {
        Arc::new(
            Answer::of_tables(Vec::new()).with_fact("multipliers", &[pair, pair.map(|x| 2.0 * x)]),
        )
    };
    let read = Read::Fact { path: "multipliers/0".into(), modulus: true };
    let other = read.of_the_other(Some("multipliers/1"));
    let check = Check::Ratio { read: read.clone(), other, equals: 0.25, within: 1e-12 };
    let answers = [answer([3.0, 4.0]), answer([6.0, 8.0])];
    assert_eq!(check.of(&answers, 0.0).map(|(agrees, _)| agrees), Ok(true));
    assert_eq!(read.of_the_other(None), read);
}

#[test]
fn the_largest_exponent_alone_is_read_too() {
    let alone = Answer::of_tables(Vec::new())
        .with_fact("exponent", &serde_json::json!({ "value": 0.3, "duration": 9.0 }))
        .with_fact("half_width", &0.1);
    assert_eq!(largest_exponent(&alone), Ok((0.3, 0.1)));
    let none = Answer::of_tables(Vec::new()).with_fact("exponent", &"none");
    assert!(largest_exponent(&none).is_err());
}
