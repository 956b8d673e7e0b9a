use super::*;
use twofold_num::random::RandomStream;

fn judge(points: impl IntoIterator<Item = [f64; 2]>, upward: impl Fn(usize) -> bool) -> Evidence {
    let points = points.into_iter().enumerate();
    let section: Vec<_> =
        points.map(|(i, u)| SectionPoint { t: i as f64, u, upward: upward(i) }).collect();
    classify(&section, &Question::default(), &Thresholds::default())
}

#[test]
fn the_extent_is_that_of_all_points_and_the_origin() {
    let of = |points: &[[f64; 2]]| {
        extent(
            &points
                .iter()
                .map(|u| SectionPoint { t: 0.0, u: *u, upward: true })
                .collect::<Vec<_>>(),
        )
    };
    assert_eq!((of(&[]), of(&[[3.0, 4.0]]), of(&[[-3.0, -4.0], [-1.0, -2.0]])), (0.0, 5.0, 5.0));
    assert_eq!(
        of(&[[-1.0, 7.0], [2.0, 3.0], [1.0, 11.0], [0.0, -1.0 - 1e-99]]),
        of(&[[-1.0, -1.0], [2.0, 11.0]])
    );
}

#[test]
fn what_cannot_be_judged_is_not() {
    let up = |_| true;
    let steps = |k: usize| (0..k).map(|i| [1.0, i as f64]);
    // A state without a number, in either component.
    for broken in [[f64::NAN, 1.0], [1.0, f64::NAN], [1.0, f64::INFINITY]] {
        let e = judge(steps(40).chain([broken]), up);
        assert!(matches!(e.verdict, Verdict::Escaped { last_crossing: 40.0 }), "{e:?}");
    }
    // Nineteen points; forty in the origin; forty too far apart to be measured; forty at one
    // moment.
    assert!(matches!(judge(steps(19), up).verdict, Verdict::TooFew { points: 19 }));
    assert!(matches!(judge([[0.0; 2]; 40], up).verdict, Verdict::TooFew { points: 40 }));
    assert!(matches!(
        judge(steps(40).map(|u| u.map(|c| 1e200 * c)), up).verdict,
        Verdict::TooFew { points: 40 }
    ));
    let once: Vec<_> = steps(40).map(|u| SectionPoint { t: 1.0, u, upward: true }).collect();
    let e = classify(&once, &Question::default(), &Thresholds::default());
    assert!(matches!(e.verdict, Verdict::TooFew { points: 40 }) && e.return_time.is_nan(), "{e:?}");
}

#[test]
fn the_direction_with_more_points_is_counted_and_upward_if_in_doubt() {
    // Of 60 dots, so many upwards at (1, 2) and the others downwards at (2, 1): the counted
    // dots come first.
    for (ups, first) in [(40, true), (30, true), (29, false), (20, false)] {
        let points = (0..60).map(|i| if i < ups { [1.0, 2.0] } else { [2.0, 1.0] });
        let e = judge(points, |i| i < ups);
        let cycle = e.verdict.cycle().unwrap();
        assert_eq!(
            (cycle.period, cycle.points.len(), cycle.points[0].upward),
            (1, 2, first),
            "{ups}: {e:?}"
        );
        for p in &cycle.points {
            assert_eq!(p.u, if p.upward { [1.0, 2.0] } else { [2.0, 1.0] });
        }
    }
    // One apart is in doubt.
    let e = judge((0..59).map(|i| [1.0 + f64::from(i % 2), 2.0]), |i| i % 2 == 1);
    assert!(e.verdict.cycle().unwrap().points[0].upward, "{e:?}");
}

#[test]
fn a_run_that_crosses_no_more_has_escaped() {
    // Every two units of time until 80: thirty returns later is 140.
    let section: Vec<_> = (0..41)
        .map(|i| SectionPoint { t: 2.0 * f64::from(i), u: [1.0, 2.0], upward: true })
        .collect();
    for (end, name) in [(139.0, "periodic"), (141.0, "escaped")] {
        let question = Question { t_end: Some(end), ..Question::default() };
        let e = classify(&section, &question, &Thresholds::default());
        assert_eq!((e.name.as_str(), e.return_time), (name, 2.0), "{end}: {e:?}");
    }
}

#[test]
fn a_picture_is_mixed_if_it_shows_what_was_before_the_capture() {
    // One dot from the first crossing on, at t = 0; around it kicks hold the run in a cloud,
    // which is never settled.
    let dot: Vec<_> =
        (0..60).map(|i| SectionPoint { t: f64::from(i), u: [1.0, 2.0], upward: true }).collect();
    for kicked in [false, true] {
        for (shown_from, mixed) in [(-1.0, true), (0.0, false), (10.0, false)] {
            let question = Question { shown_from, kicked, ..Question::default() };
            let e = classify(&dot, &question, &Thresholds::default());
            assert_eq!(e.verdict.cycle().map(|c| c.captured_at), Some(0.0), "{e:?}");
            assert_eq!((e.mixed, e.dots_only), (mixed, !mixed && !kicked), "{shown_from}: {e:?}");
        }
    }
}

#[test]
fn a_capture_has_one_time_however_long_the_run_goes_on() {
    // Irregular for 700 returns, then towards a dot by 3 % a return, unevenly, so that only
    // points and not blocks tell the approach.
    let mut x = 0.4;
    let mut sea = || {
        x = 3.97 * x * (1.0 - x);
        [1.0 + x, 1.0 + x * x]
    };
    let mut points: Vec<[f64; 2]> = (0..700).map(|_| sea()).collect();
    let falls =
        |i: i32| 0.25 * f64::from(1 + i % 2) * twofold_num::elementary::exp(-0.03 * f64::from(i));
    points.extend((0..20_000).map(|i| [1.5 + falls(i), 1.5]));
    // Within a tenth of the extent, 0.28, from 0.5 exp(-0.58) on.
    for n in [1100, 1300, 2000, 3000, 5000, 20_700] {
        let e = judge(points[..n].iter().copied(), |_| true);
        let cycle = e.verdict.cycle().unwrap_or_else(|| panic!("{n}: {e:?}"));
        assert!(e.name == "periodic" && cycle.captured_at == 720.0, "{n}: {cycle:?}");
    }
}

#[test]
fn a_spiral_that_grows_without_end_is_on_no_ring() {
    // Twelve per cent further out a return; a ring of that rotation beside it.
    for (growth, name) in [(0.11, "undecided"), (0.0, "quasi-periodic")] {
        let e = judge(
            (0..400).map(|i| {
                let r = twofold_num::elementary::exp(growth * f64::from(i));
                let a = 2.3 * f64::from(i);
                [r * twofold_num::elementary::cos(a), r * twofold_num::elementary::sin(a)]
            }),
            |_| true,
        );
        assert_eq!(e.name, name, "{e:?}");
    }
}

#[test]
fn irregular_motion_in_the_second_coordinate_alone_is_irregular() {
    let mut x = 0.4;
    let mut next = || {
        x = 3.97 * x * (1.0 - x);
        [0.0, x]
    };
    let e = judge((0..1000).map(|_| next()), |_| true);
    assert!(e.zero_one.unwrap() > 0.9 && e.name == "chaotic", "{e:?}");
}

#[test]
fn of_a_kicked_run_only_what_is_shown_is_compared() {
    // A disc with a hole; in the first half of the run the points are in the hole, in the shown
    // half never.
    let disc = |n: usize, stream: u64| -> Vec<[f64; 2]> {
        let mut r = RandomStream::new(5, stream);
        let mut points = Vec::new();
        while points.len() < n {
            let u = [r.uniform_in(-1.0, 1.0), r.uniform_in(-1.0, 1.0)];
            let square = u[0] * u[0] + u[1] * u[1];
            if (0.16..1.0).contains(&square) {
                points.push(u);
            }
        }
        points
    };
    let section = |points: Vec<[f64; 2]>| -> Vec<SectionPoint> {
        points
            .into_iter()
            .enumerate()
            .map(|(i, u)| SectionPoint { t: i as f64, u, upward: true })
            .collect()
    };
    let free: Vec<_> = (0..3).map(|k| section(disc(20_000, k))).collect();
    let hole = disc(2000, 9).into_iter().map(|u| u.map(|c| 0.3 * c)).collect::<Vec<_>>();
    let run = section([hole, disc(2000, 10)].concat());
    let question = Question {
        kicked: true,
        shown_from: 2000.0,
        reference: Some(&free),
        ..Question::default()
    };
    let found = classify(&run, &question, &Thresholds::default());
    let Verdict::Noisy { contrast: Some(contrast), .. } = found.verdict else {
        panic!("{found:?}")
    };
    assert!(contrast.points == 2000 && contrast.value > 0.95, "{contrast:?}");
}

#[test]
fn a_slow_spiral_is_a_ring_until_its_change_can_be_seen() {
    // Over 3000 turns the distance changes by 3 % and by 26 %; the run began long before.
    for (gamma, name) in [(1e-5, "quasi-periodic"), (1e-4, "spiralling"), (-1e-4, "spiralling")] {
        let section: Vec<_> = (0..3000)
            .map(|i| {
                let (r, a) =
                    (0.2 * twofold_num::elementary::exp(-gamma * f64::from(i)), 2.3 * f64::from(i));
                let u = [
                    0.4 + r * twofold_num::elementary::cos(a),
                    0.1 + 0.5 * r * twofold_num::elementary::sin(a),
                ];
                SectionPoint { t: 1e6 + f64::from(i), u, upward: true }
            })
            .collect();
        let e = classify(&section, &Question::default(), &Thresholds::default());
        let cycle = e.verdict.cycle().unwrap();
        assert_eq!((e.name.as_str(), cycle.period, cycle.captured_at), (name, 1, 1e6), "{e:?}");
        assert!((cycle.approach.unwrap().per_time / gamma - 1.0).abs() < 0.05, "{e:?}");
        // The evidence survives a round trip through JSON.
        let text = serde_json::to_string(&e).unwrap();
        assert_eq!(serde_json::from_str::<Evidence>(&text).unwrap(), e);
        if gamma == 1e-4 {
            // It is followed through fifteen blocks of 200 turns. Where more are asked for it
            // is only regular.
            let of = |fewest_blocks| {
                let thresholds = Thresholds { fewest_blocks, ..Thresholds::default() };
                classify(&section, &Question::default(), &thresholds).name
            };
            assert_eq!([of(15), of(16)], ["spiralling", "quasi-periodic"]);
        }
    }
}

#[test]
fn the_bands_of_chaos_are_those_of_its_second_half() {
    // The logistic map: one band at 3.97, two at 3.6, which are visited in turn.
    let mut x = 0.4;
    let chaos = (0..1200).map(|i| {
        let before = x;
        x = if i < 600 { 3.97 } else { 3.6 } * x * (1.0 - x);
        [before, x]
    });
    let e = judge(chaos, |_| true);
    assert!(matches!(e.verdict, Verdict::Chaotic { bands: 2, .. }), "{e:?}");
}

#[test]
fn what_tells_regular_from_irregular_is_weighed() {
    let exponent = |value: f64| Some(Exponent { value, standard_error: 0.01, duration: 1e3 });
    let verdict = |points: &[[f64; 2]], lyapunov| {
        let section: Vec<_> = points
            .iter()
            .enumerate()
            .map(|(i, u)| SectionPoint { t: i as f64, u: *u, upward: true })
            .collect();
        classify(&section, &Question { lyapunov, ..Question::default() }, &Thresholds::default())
            .name
    };
    let mut x = 0.4;
    let mut irregular = || {
        let before = x;
        x = 3.97 * x * (1.0 - x);
        [before, x]
    };
    let irregular: Vec<[f64; 2]> = (0..600).map(|_| irregular()).collect();
    // On a line there is no ring.
    let regular: Vec<[f64; 2]> =
        (0..600).map(|i| [1.0 + twofold_num::elementary::sin(2.0 * f64::from(i)), 0.0]).collect();
    // An exponent counts from three of its errors on.
    for (points, lyapunov, want) in [
        (&irregular[..], None, "chaotic"),
        (&irregular[..], exponent(0.5), "chaotic"),
        (&irregular[..], exponent(0.031), "chaotic"),
        (&irregular[..], exponent(0.029), "undecided"),
        (&regular[..], None, "quasi-periodic"),
        (&regular[..], exponent(0.0), "quasi-periodic"),
        (&regular[..], exponent(0.5), "quasi-periodic"),
        // Below 200 points neighbours say nothing: one against one.
        (&regular[..150], exponent(0.5), "undecided"),
        (&regular[..150], exponent(0.0), "quasi-periodic"),
        (&irregular[..150], exponent(0.0), "undecided"),
        // Below 100 nothing says anything but the exponent.
        (&irregular[..90], None, "too-few"),
        (&irregular[..90], exponent(0.5), "chaotic"),
    ] {
        assert_eq!(verdict(points, lyapunov), want, "{} {lyapunov:?}", points.len());
    }
}

#[test]
fn a_ring_after_chaos_begins_where_the_chaos_ends() {
    use twofold_num::elementary::{cos, sin};
    let (mut x, mut y) = (0.1, 0.1);
    let chaos: Vec<[f64; 2]> = (0..1000)
        .map(|_| {
            (x, y) = (1.0 - 1.4 * x * x + y, 0.3 * x);
            [x, y]
        })
        .collect();
    let ring =
        (0..3000).map(|i| 2.3 * f64::from(i)).map(|a| [0.4 + 0.2 * cos(a), 0.1 + 0.1 * sin(a)]);
    let e = judge(chaos.into_iter().chain(ring), |_| true);
    let cycle = e.verdict.cycle().unwrap();
    // Known to within a block of turns.
    assert!(e.name == "quasi-periodic" && (1000.0..1200.0).contains(&cycle.captured_at), "{e:?}");
    assert!((cycle.rotation.unwrap() - 2.3 / std::f64::consts::TAU).abs() < 1e-3, "{e:?}");
}
