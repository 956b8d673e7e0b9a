use super::*;

const TAU: f64 = std::f64::consts::TAU;

/// Turns around given centres, the last point having the first.
fn around<'a>(points: &'a [Point], times: &'a [f64], centres: &[Point], block: usize) -> Turns<'a> {
    let (n, period) = (points.len(), centres.len());
    let distances = (0..n).map(|i| distance(&points[i], &centres[(n - 1 - i) % period])).collect();
    Turns {
        points,
        times,
        period,
        centres: centres.to_vec(),
        spreads: vec![0.0; period],
        distances,
        block,
    }
}

/// Turns around the origin at these distances, on a line.
fn at(distances: &[f64]) -> Vec<Point> {
    distances.iter().map(|d| [*d, 0.0]).collect()
}

/// A point of a tilted ellipse, at an angle in circles of the circle that it is the image of.
fn ellipse(c: Point, angle: f64, scale: f64) -> Point {
    let (u, v) = (scale * cos(TAU * angle), scale * sin(TAU * angle));
    [c[0] + 3.0 * u + v, c[1] - 0.5 * u + 0.4 * v]
}

#[test]
fn the_centre_of_a_spiral_is_its_eye() {
    // p -> c + A (p - c), a turn and a half of it, in any unit and at any place.
    for scale in [1e-3, 1.0, 1e3] {
        for c in [[0.0, 0.0], [5.0, -3.0], [-40.0, 7.0]] {
            let mut d = [scale, 0.5 * scale];
            let points: Vec<Point> = (0..14)
                .map(|_| {
                    let here = [c[0] + d[0], c[1] + d[1]];
                    d = [0.9 * d[0] - 0.5 * d[1], 0.3 * d[0] + 0.8 * d[1]];
                    here
                })
                .collect();
            let found = fixed_point(&points);
            assert!(distance(&found, &c) < 1e-9 * (scale + 1e-3), "{scale} {c:?}: {found:?}");
        }
    }
    // Six points have a map; fewer have their mean, whatever a map would say.
    let mut d = [1.0, 0.5];
    let six = [(); 6].map(|()| {
        let here = [5.0 + d[0], d[1] - 3.0];
        d = [-0.5 * d[0] - 0.8 * d[1], 0.8 * d[0] - 0.5 * d[1]];
        here
    });
    assert!(distance(&fixed_point(&six), &[5.0, -3.0]) < 1e-12, "{:?}", fixed_point(&six));
    let mean: Point = std::array::from_fn(|k| six[..5].iter().map(|p| p[k]).sum::<f64>() / 5.0);
    assert!(fixed_point(&six[..5]) == mean && distance(&mean, &[5.0, -3.0]) > 0.1, "{mean:?}");
    assert_eq!(fixed_point(&[[0.0, 1.0], [2.0, 4.0], [4.0, 1.0]]), [2.0, 2.0]);
}

#[test]
fn a_thin_spiral_has_its_mean_for_a_centre() {
    // A hundredth as wide as long is still an ellipse; a ten-thousandth is a line, in any unit,
    // level or tilted by an eighth of a circle.
    for (scale, tilt) in [(1e-3, 0.0), (1.0, 0.0), (1e3, 0.0), (1.0, 0.125)] {
        for (width, eye) in [(1e-2, true), (1e-4, false)] {
            let (s, c) = (sin(TAU * tilt), cos(TAU * tilt));
            let points: Vec<Point> = (0..8)
                .map(|i| TAU * 0.15 * f64::from(i))
                .map(|a| [cos(a), width * sin(a)])
                .map(|[u, v]| [scale * (2.0 + c * u - s * v), scale * (1.0 + s * u + c * v)])
                .collect();
            let mean: Point =
                std::array::from_fn(|k| points.iter().map(|p| p[k]).sum::<f64>() / 8.0);
            let want = if eye { [2.0 * scale, scale] } else { mean };
            assert!(distance(&fixed_point(&points), &want) < 1e-8 * scale, "{scale} {width}");
            assert!(distance(&mean, &[2.0 * scale, scale]) > 1e-2 * scale);
            let whole = around(&points, &[], &[[2.0 * scale, scale]], 8);
            assert_eq!(whole.round(0, 0, 8).is_some(), eye, "{scale} {width}");
        }
    }
}

#[test]
fn a_phase_is_seen_round_and_turns_as_it_does() {
    // Three phases around three centres, each a tenth of a circle ahead of the next; before the
    // last ten turns something else.
    let centres = [[5.0, -3.0], [-20.0, 7.0], [0.0, 9.0]];
    for (rotation, scale) in [(0.3, 1.0), (-0.3, 1e-3), (0.1, 1e3), (-0.45, 1.0)] {
        let points: Vec<Point> = (0..36)
            .map(|i| {
                let phase = (35 - i) % 3;
                let angle = rotation * f64::from(i / 3) + 0.1 * f64::from(phase);
                let junk = if i < 6 { 100.0 } else { 0.0 };
                ellipse(
                    [centres[phase as usize][0] + junk, centres[phase as usize][1]],
                    angle,
                    scale,
                )
            })
            .collect();
        let turns = around(&points, &[], &centres, 10);
        for phase in 0..3 {
            let round = turns.round(phase, 6, 36).unwrap();
            assert_eq!(round.len(), 10);
            // Second moments one: ten points at the distance sqrt(2/10).
            assert!(
                round.iter().all(|q| (q[0] * q[0] + q[1] * q[1] - 0.2).abs() < 1e-10),
                "{round:?}"
            );
        }
        assert!(
            (turns.rotation().unwrap() - rotation).abs() < 1e-10,
            "{rotation}: {:?}",
            turns.rotation()
        );
    }
    // A quarter turn is seen whole: all increments point the same way, whichever it is.
    let quarters: Vec<Point> =
        (0..12).map(|i| ellipse([0.0; 2], 0.25 * f64::from(i), 1.0)).collect();
    let quarter = around(&quarters, &[], &[[0.0; 2]], 12).rotation().unwrap();
    assert!((quarter - 0.25).abs() < 1e-10, "{quarter}");
    // To and fro by quarters is no rotation.
    let swing: Vec<Point> =
        (0..10).map(|i| ellipse([0.0; 2], 0.25 * f64::from(i % 2), 1.0)).collect();
    assert_eq!(around(&swing, &[], &[[0.0; 2]], 10).rotation(), None);
}

#[test]
fn the_largest_gap_is_found_wherever_it_lies() {
    for offset in 0..20 {
        let angles = [0.5, 0.75, 0.6, 0.85, 0.0, 0.25, 0.1, 0.35]
            .map(|a| a + 0.05 * f64::from(offset) + 0.013);
        let points: Vec<Point> = angles.iter().map(|a| ellipse([2.0, 1.0], *a, 1.0)).collect();
        let turns = around(&points, &[], &[[2.0, 1.0]], 4);
        // The last block: 0, 0.1, 0.25, 0.35. With the one before: halves of a circle filled
        // alike.
        for (blocks, gap) in [(1, 0.65), (2, 0.15)] {
            assert!((turns.largest_gap(blocks).unwrap() - gap).abs() < 1e-10, "{offset} {blocks}");
        }
        // A block of two phases is twice as many points; both phases go around alike.
        let twice: Vec<Point> = points.iter().flat_map(|p| [[p[0] + 9.0, p[1]], *p]).collect();
        let turns = around(&twice, &[], &[[2.0, 1.0], [11.0, 1.0]], 4);
        for (blocks, gap) in [(1, 0.65), (2, 0.15)] {
            assert!((turns.largest_gap(blocks).unwrap() - gap).abs() < 1e-10, "{offset} {blocks}");
        }
    }
}

#[test]
fn a_ring_is_as_thick_as_it_is_uneven() {
    let ring = |r: &dyn Fn(i32) -> f64| -> Vec<Point> {
        (0..80)
            .map(|i| (r(i), TAU * 0.075 * f64::from(i)))
            .map(|(r, a)| [1.0 + r * cos(a), r * sin(a)])
            .collect()
    };
    let of = |points: &[Point]| around(points, &[], &[[1.0, 0.0]], 40).ring(40, 80);
    assert!(of(&ring(&|_| 0.3)).thickness < 1e-10);
    // Neighbours differ by twice 0.01 in the logarithm of their distance.
    let uneven = of(&ring(&|i| if i % 2 == 0 { 0.3 * 1.01 } else { 0.3 / 1.01 }));
    assert!(
        (uneven.thickness / (0.01 * std::f64::consts::SQRT_2) - 1.0).abs() < 0.04,
        "{}",
        uneven.thickness
    );
    assert!((uneven.largest - 0.303).abs() < 1e-12);
    // A spiral is smooth: its trend does not count. Its ends are tenths, four points each.
    let spiral = of(&ring(&|i| twofold_num::elementary::exp(-0.01 * f64::from(i))));
    assert!(spiral.thickness < 0.02, "{}", spiral.thickness);
    assert!(
        (spiral.ends[0] + 0.415).abs() < 1e-12 && (spiral.ends[1] + 0.775).abs() < 1e-12,
        "{:?}",
        spiral.ends
    );
    // On a line it is judged by time.
    let line =
        at(&std::array::from_fn::<f64, 40, _>(
            |i| {
                if i % 2 == 0 { 0.3 * 1.01 } else { 0.3 / 1.01 }
            },
        ));
    let three: Vec<Point> = (0..42).map(|i| [[0.3, 0.5, 0.7][i % 3], 0.0]).collect();
    assert!(around(&three, &[], &[[0.0; 2]; 3], 14).ring(0, 42).thickness < 1e-12);
    let flat = around(&line, &[], &[[0.0; 2]], 40).ring(0, 40);
    assert!(
        (flat.thickness / (0.01 * std::f64::consts::SQRT_2) - 1.0).abs() < 0.01,
        "{}",
        flat.thickness
    );
    // The last of three phases on an uneven line, the others on smooth rings: a third of the
    // squares is the line's.
    let mixed: Vec<Point> = (0..42)
        .map(|i| {
            let (turn, a) = (i / 3, TAU * f64::from(i / 3) * 3.0 / 14.0);
            match i % 3 {
                2 => [if turn % 2 == 0 { 0.3 * 1.01 } else { 0.3 / 1.01 }, 0.0],
                phase => [9.0 * f64::from(phase + 1) + 0.3 * cos(a), 0.3 * sin(a)],
            }
        })
        .collect();
    let centres = [[0.0, 0.0], [18.0, 0.0], [9.0, 0.0]];
    let mixed = around(&mixed, &[], &centres, 14).ring(0, 42);
    assert!((mixed.thickness / (0.01 * sqrt(2.0 / 3.0)) - 1.0).abs() < 0.02, "{}", mixed.thickness);
}

#[test]
fn what_is_left_of_a_trend_is_about_zero() {
    // The straight line through 1, 5, 3 by least squares is 2, 3, 4.
    let left = detrended(&[1.0, 5.0, 3.0]);
    assert!(left.iter().zip([-1.0, 2.0, -1.0]).all(|(a, b)| (a - b).abs() < 1e-14), "{left:?}");
    assert_eq!(detrended(&[7.0]), [7.0]);
}

#[test]
fn a_capture_begins_where_the_run_comes_near_and_settles_where_it_stays() {
    let th = Thresholds::default();
    let captured = |distances: &[f64]| {
        around(&at(distances), &[], &[[0.0; 2]], 10)
            .captured(1.0, &th)
            .map(|c| (c.from, c.blocks, c.settled))
    };
    // Far, near for a block, in the dot: the block before joins the dots, the one before that
    // joins nothing.
    let run = |far: usize, near: usize, n: usize| -> Vec<f64> {
        let fall = |i: usize| 0.09 / f64::from(1_u32 << (i - far).min(20));
        (0..n)
            .map(|i| {
                if i < far {
                    0.5
                } else if i < far + near {
                    fall(i)
                } else {
                    1e-3
                }
            })
            .collect()
    };
    assert_eq!(
        captured(&[vec![0.5; 30], vec![0.05; 10], vec![1e-3; 60]].concat()),
        Some((30, 7, Some(40)))
    );
    // An approach within one block, followed point by point.
    assert_eq!(captured(&run(25, 6, 100)), Some((25, 6, Some(31))));
    // Too few in the dot to have settled; a block that joins.
    assert_eq!(captured(&[vec![0.5; 30], vec![1e-3; 4]].concat()), None);
    assert_eq!(captured(&[vec![0.5; 30], vec![1e-3; 5]].concat()).map(|c| c.2), Some(Some(30)));
    // A block of two phases is twice as long.
    let two = at(&[vec![0.5; 37], vec![1e-3; 63]].concat());
    let found = around(&two, &[], &[[0.0; 2]; 2], 10).captured(1.0, &th).unwrap();
    assert_eq!((found.from, found.blocks, found.settled), (37, 3, Some(37)));
    // All along one smooth curve: as many blocks as there are.
    let smooth: Vec<f64> = (0..47).map(|i| 0.5 - 0.001 * f64::from(i)).collect();
    assert_eq!(captured(&smooth), Some((7, 4, None)));
    let rough: Vec<f64> = (0..47).map(|i| if i % 2 == 0 { 0.5 } else { 0.3 }).collect();
    assert_eq!(captured(&rough), None);
}

#[test]
fn a_cloud_reaches_back_as_far_as_it_stays_near() {
    let th = Thresholds::default();
    let mut distances = [0.05; 51];
    (distances[20], distances[30]) = (0.11, 0.1);
    let from = |d: &[f64]| around(&at(d), &[], &[[0.0; 2]], 10).cloud(1.0, &th).map(|c| c.from);
    // Thirty points of a phase are a window; as far out as the linear neighbourhood reaches is
    // still in it.
    assert_eq!((from(&distances), from(&distances[..50])), (Some(21), None));
    assert_eq!(from(&distances[21..]), Some(0));
    let points = at(&distances);
    assert!(around(&points, &[], &[[0.0; 2]; 2], 10).cloud(1.0, &th).is_none());
}

#[test]
fn an_approach_is_fitted_down_to_the_floor() {
    let exp = twofold_num::elementary::exp;
    // exp(-0.2 i) to i = 50; then, in the last half of what is settled, 25 values whose
    // ninetieth percentile is 22e-4.
    let mut distances: Vec<f64> =
        (0..100).map(|i| if i < 50 { exp(-0.2 * f64::from(i)) } else { 0.5 }).collect();
    (0..25).for_each(|k| distances[75 + (7 * k) % 25] = 1e-4 * (k + 1) as f64);
    let times: Vec<f64> = (0..100).map(|i| 10.0 + 3.0 * f64::from(i)).collect();
    let points = at(&distances);
    let captured = Captured { from: 5, blocks: 0, settled: Some(50) };
    let rate = around(&points, &times, &[[0.0; 2]], 10).approach(&captured).unwrap();
    // exp(-0.2 i) > 66e-4 up to i = 25.
    assert!((rate.per_time - 0.2 / 3.0).abs() < 1e-12 && rate.standard_error < 1e-12, "{rate:?}");
    assert_eq!((rate.from, rate.to), (25.0, 85.0));
    // Two phases at different distances: their root mean square, at the time of the turn's
    // middle; no floor.
    let two: Vec<f64> =
        (0..40).map(|i| exp(-0.1 * f64::from(i / 2)) * [3.0, 1.0][i as usize % 2]).collect();
    let points = at(&two);
    let captured = Captured { from: 0, blocks: 0, settled: None };
    let rate = around(&points, &times[..40], &[[0.0; 2]; 2], 10).approach(&captured).unwrap();
    assert!((rate.per_time - 0.1 / 6.0).abs() < 1e-12, "{rate:?}");
    assert_eq!((rate.from, rate.to), (13.0, 10.0 + 3.0 * 39.0));
    // A floor of three times 0.01: exp(-0.2 turn), in either phase, is above it up to turn 17.
    let floored: Vec<f64> =
        (0..100).map(|i| if i < 50 { exp(-0.2 * f64::from(i / 2)) } else { 0.01 }).collect();
    let settled = Captured { from: 0, blocks: 0, settled: Some(50) };
    let rate = around(&at(&floored), &times, &[[0.0; 2]; 2], 10).approach(&settled).unwrap();
    assert!((rate.per_time - 0.2 / 6.0).abs() < 1e-12 && rate.to == 10.0 + 3.0 * 35.0, "{rate:?}");
    // So is that of rounding, about a centre of size 1, though most points are on it.
    let rounded: Vec<f64> = (0..100)
        .map(|i| match i {
            0..40 => exp(-f64::from(i)),
            _ => {
                if i % 12 == 0 {
                    2e-16
                } else {
                    0.0
                }
            }
        })
        .collect();
    let points: Vec<Point> = rounded.iter().map(|d| [1.0 + d, 0.0]).collect();
    let settled = Captured { from: 0, blocks: 0, settled: Some(20) };
    let rate = Turns { distances: rounded, ..around(&points, &times, &[[1.0, 0.0]], 10) }
        .approach(&settled)
        .unwrap();
    assert!((rate.per_time - 1.0 / 3.0).abs() < 1e-12 && rate.to < 10.0 + 3.0 * 36.0, "{rate:?}");
    // A point on the centre ends the fit, and fewer than three turns are none.
    let mut ends = two.clone();
    (ends[6], ends[7]) = (0.0, 0.0);
    let of = |d: &[f64]| around(&at(d), &times[..d.len()], &[[0.0; 2]; 2], 10).approach(&captured);
    assert_eq!(of(&ends).unwrap().to, 10.0 + 3.0 * 5.0);
    assert!(of(&ends[2..]).is_none());
}

#[test]
fn a_turns_radius_and_duration_are_those_of_the_last_block() {
    // Twenty turns of two points, a quarter of a time unit apart in the last ten, a whole one
    // before.
    let times: Vec<f64> =
        (0..40).map(|i| if i < 20 { f64::from(i) } else { 15.0 + 0.25 * f64::from(i) }).collect();
    let distances: Vec<f64> =
        (0..40).map(|i| if i < 20 { 9.0 } else { [1.0, 3.0][i % 2] }).collect();
    let points = at(&distances);
    let of = |block: usize| around(&points, &times, &[[0.0; 2]; 2], block);
    let radius = |block: usize, settled: Option<usize>| {
        of(block).radius(&Captured { from: 0, blocks: 0, settled })
    };
    assert_eq!((of(9).duration(), radius(10, None)), (0.5, 2.0));
    // As many turns as there are: of 40 points, 19.
    assert!((of(20).duration() - (times[39] - times[1]) / 19.0).abs() < 1e-15);
    assert_eq!(radius(20, None), 5.5);
    // The way to where a run settles does not count.
    assert_eq!((radius(20, Some(20)), radius(10, Some(4)), radius(10, Some(39))), (2.0, 2.0, 3.0));
}

#[test]
fn phases_that_move_on_drift() {
    let th = Thresholds::default();
    // The means of the halves differ by the step; half a spread is the limit.
    let step = |by: f64| -> Vec<Point> {
        (0..60).map(|i| if i < 40 { [1.0, 2.0] } else { [1.0, 2.0 + by] }).collect()
    };
    assert!(drifts(&step(0.26), 1, 40, 0.5, &th) && !drifts(&step(0.24), 1, 40, 0.5, &th));
    assert!(drifts(&step(1.3), 1, 40, 2.5, &th) && !drifts(&step(1.2), 1, 40, 2.5, &th));
    // Beyond the window no test applies.
    assert!(!drifts(&step(9.0), 1, 20, 0.5, &th));
    // One of two phases is enough.
    let one: Vec<Point> =
        (0..60).map(|i| if i < 40 || i % 2 == 0 { [1.0, 2.0] } else { [1.3, 2.0] }).collect();
    assert!(drifts(&one, 2, 40, 0.5, &th) && !drifts(&one, 2, 40, 0.7, &th));
}

#[test]
fn the_other_dots_are_those_of_as_many_turns() {
    // Three junk points, then five turns of two.
    let mut points = vec![[90.0, 90.0]; 3];
    (0..5).for_each(|i| points.extend([[1.0, 0.1 * f64::from(i)], [0.0, 5.0]]));
    let (centres, spreads) = other_dots(&points, 2, 5);
    assert!(
        distance(&centres[0], &[0.0, 5.0]) + distance(&centres[1], &[1.0, 0.2]) < 1e-12,
        "{centres:?}"
    );
    assert!(spreads[0] < 1e-12 && (spreads[1] - 0.2).abs() < 1e-12, "{spreads:?}");
    assert_eq!(other_dots(&points, 2, 50).0.len(), 2);
    assert!(other_dots(&points[..1], 2, 5).0.is_empty());
    assert_eq!(smallest_gap(&[[0.0, 0.0], [3.0, 4.0], [3.0, 5.0]]), 1.0);
}

#[test]
fn a_return_time_is_the_mean_gap_of_times_that_grow() {
    assert_eq!(return_time(&[1.0, 2.0, 4.0, 11.5]), 3.5);
    assert!(return_time(&[]).is_nan() && return_time(&[1.0]).is_nan());
    assert!(return_time(&[1.0; 4]).is_nan() && return_time(&[4.0, 3.0, 2.0]).is_nan());
}

/// Period, spreads and block that [`Turns::find`] gives for `points` in order; the last has
/// phase 0.
fn found(points: &[Point], extent: f64) -> (usize, Vec<f64>, usize) {
    let turns = Turns::find(points, &[], extent, &Thresholds::default());
    let n = points.len();
    let from_centres =
        (0..n).map(|i| distance(&points[i], &turns.centres[(n - 1 - i) % turns.period]));
    assert_eq!(turns.distances, from_centres.collect::<Vec<_>>());
    (turns.period, turns.spreads, turns.block)
}

#[test]
fn the_last_part_of_a_run_decides_and_a_block_is_a_tenth_of_its_turns() {
    // The last quarter, of short runs thirty points at least, of long ones six hundred at most.
    // On a ring that turns by the golden ratio, in whose last part the first two fifths are
    // half as far out again as the rest; before it, twice as far.
    for (n, window, block) in [(100, 30, 10), (1000, 250, 100), (4000, 600, 200)] {
        let points: Vec<Point> = (0..n)
            .map(|i| {
                let r = if i < n - window {
                    2.0
                } else if i < n - 3 * window / 5 {
                    1.5
                } else {
                    1.0
                };
                let a = TAU * 0.618_033_988_749_894_9 * i as f64;
                [r * cos(a), r * sin(a)]
            })
            .collect();
        let (period, spreads, blocks) = found(&points, 4.0);
        assert_eq!((period, blocks), (1, block), "{n}");
        assert!((spreads[0] - 1.5).abs() < 0.2, "{n}: {spreads:?}");
    }
}

#[test]
fn dots_are_as_many_as_stay_apart() {
    let dots = |n: usize, places: &[Point]| -> Vec<Point> {
        (0..n).map(|i| places[i % places.len()]).collect()
    };
    let six =
        |near: f64| [[0.0, 0.0], [1.0, 0.0], [1.0, near], [0.0, 1.0], [0.5, 2.0], [-0.5, 1.0]];
    // 120 points of six dots are too few for a window of thirty each, and enough turns all the
    // same; 1000 are enough.
    for (n, block) in [(120, 10), (1000, 16)] {
        // A dot is 0.002 of the extent, and two must fit between two of them: 0.008.
        let (period, spreads, blocks) = found(&dots(n, &six(0.009)), 2.0);
        assert!(
            (period, blocks) == (6, block) && spreads.iter().all(|s| *s < 1e-15),
            "{n}: {period} {spreads:?}"
        );
        assert_eq!(found(&dots(n, &six(0.007)), 2.0).0, 1);
    }
    // Five turns within the last half are needed: of six dots, 60 points.
    assert_eq!((found(&dots(59, &six(0.5)), 2.0).0, found(&dots(60, &six(0.5)), 2.0).0), (1, 6));
    // Two clusters, each to and fro: three radii of the wider one must lie between them.
    for (radius, period) in [(0.32, 2), (0.35, 1)] {
        let points: Vec<Point> = (0..1000)
            .map(|i| {
                [f64::from(i % 2), if i / 2 % 2 == 0 { radius } else { -radius } * f64::from(i % 2)]
            })
            .collect();
        assert_eq!(found(&points, 1.5).0, period, "{radius}");
    }
}

#[test]
fn a_ring_that_creeps_is_no_cycle_and_islands_are() {
    let five = |n: i32, creep: f64, radius: f64| -> Vec<Point> {
        (0..n)
            .map(|i| {
                let (a, b) = (TAU * (0.2 + creep) * f64::from(i), TAU * 0.077 * f64::from(i));
                [cos(a) + radius * cos(b), sin(a) + radius * sin(b)]
            })
            .collect()
    };
    // Next to a resonance each of five phases goes along the ring; around it each turns about
    // its centre.
    assert_eq!(found(&five(4000, 1e-4, 0.0), 3.0).0, 1);
    assert_eq!(found(&five(4000, 0.0, 0.05), 3.0).0, 5);
}
