use super::changes::{locate, product, sensitivity};
use super::*;

fn once(point: Vec<f64>, derivative: Vec<f64>) -> Returned {
    Returned {
        same: vec![point.clone()],
        point,
        time: 1.0,
        derivative,
        opposite: Vec::new(),
        extent: 1.0,
        sizes: vec![1.0; 2],
        passes: true,
        derivative_error: 0.0,
        events: 0,
    }
}

/// The logistic map x -> p x (1 - x), as if it were a return map of the plane where the second
/// state is zero.
struct Logistic;
impl ReturnMap for Logistic {
    fn states(&self) -> usize {
        2
    }
    fn axis(&self) -> usize {
        1
    }
    fn returned(&self, u: &[f64], p: f64, _: bool) -> Result<Returned, Trouble> {
        let (x, point) = (u[0], vec![p * u[0] * (1.0 - u[0]), 0.0]);
        let derivative = vec![p * (1.0 - 2.0 * x), 0.0, 0.0, 0.0];
        Ok(once(point, derivative))
    }
}

/// x -> x + p - x^2: fixed points +-sqrt(p), which meet in a fold at p = 0.
struct FoldMap;
impl ReturnMap for FoldMap {
    fn states(&self) -> usize {
        2
    }
    fn axis(&self) -> usize {
        1
    }
    fn returned(&self, u: &[f64], p: f64, _: bool) -> Result<Returned, Trouble> {
        let (x, point) = (u[0], vec![u[0] + p - u[0] * u[0], 0.0]);
        let derivative = vec![1.0 - 2.0 * x, 0.0, 0.0, 0.0];
        Ok(once(point, derivative))
    }
}

const NEWTON: Newton = Newton { closed: 1e-12, atol: 0.0, rtol: 0.0, iterations: 20 };

#[test]
fn the_logistic_map_doubles_at_three() {
    let first = closed_orbit(&Logistic, &[0.5, 0.0], 2.0, NEWTON).unwrap();
    let options =
        BranchOptions { from: 2.0, to: 3.5, longest: 0.1, most: 200, size: 0.0, newton: NEWTON };
    let branch = follow(&Logistic, first, &options, &mut |_| true);
    assert_eq!(branch.end, End::Reached);
    let last = branch.orbits.last().unwrap();
    assert!(
        (last.parameter - 3.5).abs() < 1e-12 && (last.point[0] - (1.0 - 1.0 / 3.5)).abs() < 1e-12,
        "{last:?}"
    );
    let [doubling] = &branch.bifurcations[..] else { panic!("{:?}", branch.bifurcations) };
    assert!(
        doubling.change == Change::PeriodDoubling && (doubling.parameter - 3.0).abs() < 1e-7,
        "{doubling:?}"
    );
    for o in &branch.orbits {
        assert_eq!(o.stability() == Stability::Stable, o.parameter < 3.0);
    }
}

#[test]
fn a_fold_is_passed() {
    let first = closed_orbit(&FoldMap, &[1.1, 0.0], 1.0, NEWTON).unwrap();
    let options =
        BranchOptions { from: 1.0, to: -1.0, longest: 0.05, most: 400, size: 0.0, newton: NEWTON };
    let branch = follow(&FoldMap, first, &options, &mut |_| true);
    assert_eq!(branch.end, End::TurnedBack, "{:?}", branch.orbits.len());
    let last = branch.orbits.last().unwrap();
    assert!(
        last.point[0] < -0.9 && (last.point[0] * last.point[0] - last.parameter).abs() < 1e-9,
        "{last:?}"
    );
    let fold = branch.bifurcations.iter().find(|b| b.change == Change::Fold).unwrap();
    assert!(fold.parameter.abs() <= fold.uncertainty + 2e-2, "{fold:?}");
}

#[test]
fn what_does_not_close_is_told() {
    // p above 4 and a start from which the map runs away: no fixed point is near.
    let error = closed_orbit(&FoldMap, &[0.3, 0.0], -1.0, NEWTON).unwrap_err();
    assert!(error.said.contains("start"), "{error:?}");
}

/// Zeros of a function f(x, p), given with its slope in x, as closed orbits; not defined where
/// it is `None`.
struct Zeros<F>(F);
impl<F: Fn(f64, f64) -> Option<[f64; 2]>> ReturnMap for Zeros<F> {
    fn states(&self) -> usize {
        2
    }
    fn axis(&self) -> usize {
        1
    }
    fn returned(&self, u: &[f64], p: f64, _: bool) -> Result<Returned, Trouble> {
        let [f, slope] = (self.0)(u[0], p).ok_or("nothing there")?;
        let point = vec![u[0] + f, 0.0];
        let derivative = vec![1.0 + slope, 0.0, 0.0, 0.0];
        Ok(once(point, derivative))
    }
}

/// An orbit of which only this is known.
fn with(parameter: f64, multipliers: &[[f64; 2]]) -> Orbit {
    Orbit {
        parameter,
        point: vec![0.0; 2],
        period: 2.0,
        multipliers: multipliers.to_vec(),
        residual: 0.0,
        iterations: 0,
        extent: 1.0,
        multiplier_error: 0.0,
        errors: vec![0.0; multipliers.len()],
        events: 0,
        fills: false,
        same: Vec::new(),
        opposite: Vec::new(),
    }
}

#[test]
fn a_rate_is_the_logarithm_of_the_largest_multiplier_over_the_period() {
    let rate = |m: &[[f64; 2]]| with(0.0, m).rate();
    assert!((rate(&[[-0.25, 0.0], [0.1, 0.0]]).unwrap() - std::f64::consts::LN_2).abs() < 1e-15);
    assert!((rate(&[[2.4, 3.2], [2.4, -3.2]]).unwrap() + std::f64::consts::LN_2).abs() < 1e-15);
    // Neighbours that arrive in finite time have none.
    assert_eq!((rate(&[[0.0; 2]; 2]), rate(&[])), (None, None));
    // Nor is one known of a multiplier that may be zero.
    let within = |error| Orbit { errors: vec![error], ..with(0.0, &[[1e-9, 0.0]]) }.rate();
    assert!(within(1e-8).is_none() && within(1e-10).is_some());
    assert_eq!(with(0.0, &[[0.6, 0.7]]).stability(), Stability::Stable);
    assert_eq!(with(0.0, &[[0.6, -0.9]]).stability(), Stability::Unstable);
}

#[test]
fn what_counts_as_closed() {
    let cases = [
        (1e-9, f64::INFINITY, true),
        (1.1e-9, 1.0, false),
        // Stuck, and not far off.
        (1e-7, 1.9e-7, true),
        (1e-7, 2.1e-7, false),
        (1.1e-7, 1.1e-7, false),
    ];
    for (residual, before, want) in cases {
        assert_eq!(settled(residual, before, 1e-9), want, "{residual} {before}");
    }
}

#[test]
fn a_multiplier_that_differs_from_one_by_rounding_is_one() {
    /// Its derivative less one has the rows 1e8 (1, 1) and 1e8 (1, 1) but for the last bit: of
    /// rank one, as far as can be told.
    struct Rounded;
    impl ReturnMap for Rounded {
        fn states(&self) -> usize {
            3
        }
        fn axis(&self) -> usize {
            2
        }
        fn returned(&self, u: &[f64], _: f64, _: bool) -> Result<Returned, Trouble> {
            let point = vec![u[0] + 1.0, u[1] + 2.0, 0.0];
            let derivative = vec![1e8 + 1.0, 1e8, 0.0, 1e8, 1e8 + 1.0 + 1.5e-8, 0.0, 0.0, 0.0, 0.0];
            Ok(once(point, derivative))
        }
    }
    let error = closed_orbit(&Rounded, &[0.0; 3], 0.0, NEWTON).unwrap_err();
    assert!(error.said.contains("multiplier 1"), "{error:?}");
}

#[test]
fn an_orbit_lists_its_start_and_not_its_end() {
    // Twice around by the logistic map: the second of two passages is the start again.
    struct Twice;
    impl ReturnMap for Twice {
        fn states(&self) -> usize {
            2
        }
        fn axis(&self) -> usize {
            1
        }
        fn returned(&self, u: &[f64], p: f64, _: bool) -> Result<Returned, Trouble> {
            let first = Logistic.returned(u, p, true)?;
            let twice = Logistic.returned(&first.point, p, true)?;
            let derivative = vec![first.derivative[0] * twice.derivative[0], 0.0, 0.0, 0.0];
            let same = vec![first.point, twice.point.clone()];
            Ok(Returned { time: 2.0, same, ..once(twice.point, derivative) })
        }
    }
    let p = 3.2;
    let orbit = closed_orbit(&Twice, &[0.5, 0.0], p, NEWTON).unwrap();
    // The cycle of two: x = (p + 1 -+ sqrt((p - 3)(p + 1)))/(2 p), with the multiplier 4 + 2 p
    // - p^2.
    let root = sqrt((p - 3.0) * (p + 1.0));
    let ends = [-root, root].map(|r| (p + 1.0 + r) / (2.0 * p));
    assert_eq!(orbit.same.len(), 2);
    for (got, want) in orbit.same.iter().zip(ends) {
        assert!((got[0] - want).abs() < 1e-11, "{orbit:?}");
    }
    assert!((orbit.multipliers[0][0] - (4.0 + 2.0 * p - p * p)).abs() < 1e-10, "{orbit:?}");
    assert_eq!(orbit.stability(), Stability::Stable);
}

#[test]
fn steps_along_a_straight_branch_are_as_long_as_they_should_be() {
    // x = p, from 1 to 5: of the state's scale 2 and the parameter's 4.
    let line = Zeros(|x: f64, p: f64| Some([0.5 * (p - x), -0.5]));
    let first = Orbit { extent: 2.0, ..closed_orbit(&line, &[1.0, 0.0], 1.0, NEWTON).unwrap() };
    let options =
        BranchOptions { from: 1.0, to: 5.0, longest: 0.1, most: 200, size: 0.0, newton: NEWTON };
    let branch = follow(&line, first, &options, &mut |_| true);
    assert_eq!(branch.end, End::Reached);
    assert!(branch.bifurcations.is_empty());
    let n = branch.orbits.len();
    let mut want = 0.025;
    for (k, pair) in branch.orbits.windows(2).enumerate() {
        let (dx, dp) = (
            (pair[1].point[0] - pair[0].point[0]) / 2.0,
            (pair[1].parameter - pair[0].parameter) / 4.0,
        );
        let length = sqrt(dx * dx + dp * dp);
        match k {
            // The first is a step in the parameter; the orbit is not where it was, and is
            // found.
            0 => assert!((dp - want).abs() < 1e-12 && pair[1].iterations == 1, "{pair:?}"),
            // A step along a straight line needs no iteration.
            _ if k + 2 < n => {
                assert!(
                    (length - want).abs() < 1e-9 && pair[1].iterations == 0,
                    "{k}: {length} {want}"
                )
            }
            _ => assert!(
                length <= 0.1 && pair[1].iterations == 0 && pair[1].parameter == 5.0,
                "{pair:?}"
            ),
        }
        want = (1.5 * want).min(0.1);
    }
    // The way is sqrt 5 long, 0.056 + 0.178 of it in the steps that grow.
    assert_eq!(n, 1 + 4 + 21);
}

#[test]
fn a_circle_of_orbits_is_gone_around_by_quick_newton_iterations() {
    // x^2 + p^2 = 25 from (5, 0) by the fold at p = 5 to (-5, 0).
    let circle = Zeros(|x: f64, p: f64| Some([0.1 * (25.0 - x * x - p * p), -0.2 * x]));
    let first = Orbit { extent: 6.0, ..closed_orbit(&circle, &[4.9, 0.0], 0.0, NEWTON).unwrap() };
    let options =
        BranchOptions { from: 0.0, to: 6.0, longest: 0.05, most: 400, size: 0.0, newton: NEWTON };
    let branch = follow(&circle, first, &options, &mut |_| true);
    assert_eq!(branch.end, End::TurnedBack);
    for (k, pair) in branch.orbits.windows(2).enumerate() {
        let [x, p] = [pair[1].point[0], pair[1].parameter];
        assert!((x * x + p * p - 25.0).abs() < 1e-10, "{pair:?}");
        // Quadratic convergence: the rows of the matrix are those of the equations.
        assert!(pair[1].iterations <= 4, "{k}: {}", pair[1].iterations);
        let (dx, dp) = ((x - pair[0].point[0]) / 6.0, (p - pair[0].parameter) / 6.0);
        assert!(sqrt(dx * dx + dp * dp) < 0.0501, "{pair:?}");
    }
    let last = branch.orbits.last().unwrap();
    assert!(last.parameter < 0.0 && last.parameter > -0.31 && last.point[0] < -4.9, "{last:?}");
    let [fold] = &branch.bifurcations[..] else { panic!("{:?}", branch.bifurcations) };
    assert!(
        fold.change == Change::Fold
            && (fold.parameter - 5.0).abs() < 0.05
            && fold.uncertainty < 0.05,
        "{fold:?}"
    );
}

#[test]
fn a_branch_ends_where_its_orbits_do_or_where_it_is_told() {
    let ray = Zeros(|x: f64, p: f64| (p <= 1.0).then_some([-0.5 * x, -0.5]));
    let options =
        BranchOptions { from: 0.0, to: 4.0, longest: 0.1, most: 100, size: 0.0, newton: NEWTON };
    let first = || closed_orbit(&ray, &[0.0, 0.0], 0.0, NEWTON).unwrap();
    let branch = follow(&ray, first(), &options, &mut |_| true);
    assert_eq!(branch.end, End::Lost("nothing there".into()));
    // As near to the end as two of the shortest steps.
    let left = 1.0 - branch.orbits.last().unwrap().parameter;
    assert!((0.0..2.0 * SHORTEST * 0.1 * 4.0).contains(&left), "{left}");

    let branch = follow(&ray, first(), &BranchOptions { most: 4, ..options }, &mut |_| true);
    assert_eq!((branch.end, branch.orbits.len()), (End::Enough, 4));
    let mut told = 0;
    let mut third = |_: &Orbit| {
        told += 1;
        told < 3
    };
    let branch = follow(&ray, first(), &options, &mut third);
    assert_eq!((branch.end, branch.orbits.len()), (End::Interrupted, 4));
}

#[test]
fn steps_are_short_where_multipliers_change_fast() {
    for steepness in [40.0, 4000.0] {
        let steep = Zeros(|x: f64, p: f64| Some([(steepness * p - 1.0) * x, steepness * p - 1.0]));
        let first = closed_orbit(&steep, &[0.0, 0.0], -1.0, NEWTON).unwrap();
        let options = BranchOptions {
            from: -1.0,
            to: 1.0,
            longest: 0.1,
            most: 200,
            size: 0.0,
            newton: NEWTON,
        };
        let branch = follow(&steep, first, &options, &mut |_| true);
        assert_eq!(branch.end, End::Reached);
        let within = &branch.orbits[..branch.orbits.len() - 1];
        assert!(within.windows(2).all(|pair| !jumps(&pair[0], &pair[1])));
        // The multiplier passes -1 and then 1.
        let [doubling, branching] = &branch.bifurcations[..] else {
            panic!("{:?}", branch.bifurcations)
        };
        assert_eq!(
            (doubling.change, branching.change),
            (Change::PeriodDoubling, Change::Branching)
        );
        assert!((doubling.parameter * steepness + 1.0).abs() < 1e-7, "{doubling:?}");
        let off = (branching.parameter - 1.0 / steepness).abs();
        assert!(
            off <= branching.uncertainty && branching.uncertainty < 0.5 / steepness,
            "{branching:?}"
        );
    }
}

#[test]
fn a_jump_is_three_quarters_of_a_unit_or_of_a_large_multiplier() {
    // (3, 4) has the modulus 5: three quarters are 3.75.
    let cases = [
        ([0.5, 0.0], [-0.2, 0.0], false),
        ([0.5, 0.0], [-0.3, 0.0], true),
        ([0.1, 0.5], [0.1, -0.2], false),
        ([0.1, 0.5], [0.1, -0.3], true),
        ([3.0, 4.0], [6.7, 4.0], false),
        ([3.0, 4.0], [6.8, 4.0], true),
        ([3.0, 4.0], [3.0, 0.3], false),
        ([3.0, 4.0], [3.0, 0.2], true),
        ([3.0, 4.0], [5.6, 6.6], false),
        ([3.0, 4.0], [5.7, 6.7], true),
    ];
    for (m, n, want) in cases {
        assert_eq!(jumps(&with(0.0, &[m]), &with(1.0, &[n])), want, "{m:?} {n:?}");
        // Any of several.
        assert_eq!(jumps(&with(0.0, &[[0.5, 0.0], m]), &with(1.0, &[[0.5, 0.0], n])), want);
    }
}

#[test]
fn changes_lie_between_the_members_that_differ() {
    let scales = Scales { state: 1.0, parameter: 1.0 };
    let of = |m: &[[f64; 2]], n: &[[f64; 2]]| -> Vec<(Change, f64)> {
        // A map that cannot locate the passage of a multiplier through the unit circle.
        let nothing = Zeros(|_: f64, _: f64| None);
        let found = changes(&nothing, &with(3.0, m), &with(8.0, n), &scales, NEWTON);
        assert!(found.iter().all(|b| (b.uncertainty - 2.5).abs() < 1e-12), "{found:?}");
        found.iter().map(|b| (b.change, b.parameter)).collect()
    };
    let one = |change| vec![(change, 5.5)];
    assert_eq!(of(&[[-0.9, 0.0]], &[[-1.1, 0.0]]), one(Change::PeriodDoubling));
    assert_eq!(of(&[[0.9, 0.0]], &[[1.1, 0.0]]), one(Change::Branching));
    let pair = |a: f64, b: f64| [[a, b], [a, -b]];
    assert_eq!(of(&pair(0.1, 0.9), &pair(0.1, 1.1)), one(Change::Torus));
    assert_eq!(of(&pair(0.7, 0.6), &pair(0.8, 0.7)), one(Change::Torus));
    assert_eq!(of(&pair(0.7, -0.6), &pair(0.7, -0.7)), []);
    // A complex pair beyond the circle is neither below -1 nor above 1, and real multipliers
    // make no torus.
    assert_eq!(of(&pair(1.2, 0.1), &pair(-1.2, 0.1)), []);
    assert_eq!(of(&[[0.9, 0.0], [0.5, 0.0]], &[[0.7, 0.0], [0.6, 0.0]]), []);
    let both = of(&[[-0.9, 0.0], [0.9, 0.0]], &[[-1.1, 0.0], [1.1, 0.0]]);
    assert_eq!(
        both.iter().map(|b| b.0).collect::<Vec<_>>(),
        [Change::PeriodDoubling, Change::Branching]
    );
    // Orbits with other events are told, whatever their multipliers.
    let other = Orbit { events: 2, ..with(8.0, &[[-1.1, 0.0]]) };
    let nothing = Zeros(|_: f64, _: f64| None);
    let found = changes(&nothing, &with(3.0, &[[-0.9, 0.0]]), &other, &scales, NEWTON);
    assert_eq!(found.iter().map(|b| b.change).collect::<Vec<_>>(), [Change::DiscontinuityInduced]);
}

/// A return map x -> x + f of loops as large as x, with a rest at 0 of the eigenvalues p +- i.
struct Shrinking;
impl ReturnMap for Shrinking {
    fn states(&self) -> usize {
        2
    }
    fn axis(&self) -> usize {
        1
    }
    fn returned(&self, u: &[f64], p: f64, _: bool) -> Result<Returned, Trouble> {
        let x = u[0];
        let derivative = vec![1.0 + p - 3.0 * x * x, 0.0, 0.0, 0.0];
        let time = std::f64::consts::TAU;
        let point = vec![x + x * (p - x * x), 0.0];
        let (extent, sizes) = (x.abs(), vec![x.abs(); 2]);
        let passes = x > 0.0;
        Ok(Returned { extent, sizes, passes, time, ..once(point, derivative) })
    }
    fn rest(&self, _: &[f64], p: f64) -> Option<(Vec<f64>, Vec<[f64; 2]>)> {
        Some((vec![0.0; 2], vec![[p, 1.0], [p, -1.0]]))
    }
}

#[test]
fn a_branch_ends_where_its_orbits_shrink_to_a_hopf_point() {
    let first = closed_orbit(&Shrinking, &[0.7, 0.0], 0.5, NEWTON).unwrap();
    // With long steps too, which could pass the point and find the same orbits from their other
    // side.
    for (to, longest) in [(-0.5, 0.1), (-3.0, 0.1), (-0.5, 1.0), (-3.0, 5.0)] {
        let options =
            BranchOptions { from: 0.5, to, longest, most: 200, size: 0.0, newton: NEWTON };
        let branch = follow(&Shrinking, first.clone(), &options, &mut |_| true);
        assert_eq!(branch.end, End::Vanished);
        assert!(
            branch.orbits.iter().all(|o| o.parameter > -1e-12 && o.point[0] > 0.0),
            "{branch:?}"
        );
        let [hopf] = &branch.bifurcations[..] else { panic!("{:?}", branch.bifurcations) };
        assert!(
            hopf.change == Change::Hopf && hopf.parameter.abs() <= hopf.uncertainty,
            "{hopf:?}"
        );
        assert!(hopf.uncertainty < 1e-10, "{hopf:?}");
    }
}

/// A fixed point x = p/2 whose loop grazes a surface at p = 1/2: within 1e-6 there is no
/// derivative, and behind it is another event, or nothing.
struct Graze {
    goes_on: bool,
}
impl ReturnMap for Graze {
    fn states(&self) -> usize {
        2
    }
    fn axis(&self) -> usize {
        1
    }
    fn returned(&self, u: &[f64], p: f64, _: bool) -> Result<Returned, Trouble> {
        if (p - 0.5).abs() < 1e-6 || p > 0.5 && !self.goes_on {
            return Err(Trouble { obstacle: Obstacle::Grazing, said: "grazes".into() });
        }
        let (slope, events) = if p < 0.5 { (0.5, 1) } else { (-0.25, 2) };
        let point = vec![0.5 * p + slope * (u[0] - 0.5 * p), 0.0];
        Ok(Returned { events, ..once(point, vec![slope, 0.0, 0.0, 0.0]) })
    }
}

#[test]
fn a_branch_goes_on_behind_a_grazing_if_there_is_more_of_it() {
    for (from, to) in [(0.0, 1.0), (0.1, 0.9), (0.3, 0.500_01), (0.499, 0.6)] {
        let options =
            BranchOptions { from, to, longest: 0.05, most: 200, size: 0.0, newton: NEWTON };
        for goes_on in [true, false] {
            let map = Graze { goes_on };
            let first = closed_orbit(&map, &[0.5 * from, 0.0], from, NEWTON).unwrap();
            let branch = follow(&map, first, &options, &mut |_| true);
            let [change] = &branch.bifurcations[..] else { panic!("{:?}", branch.bifurcations) };
            assert!((change.parameter - 0.5).abs() <= change.uncertainty + 2e-6, "{change:?}");
            let (kind, reached) = (change.change, branch.end == End::Reached);
            let wanted = if goes_on { Change::DiscontinuityInduced } else { Change::Grazing };
            assert_eq!((kind, reached), (wanted, goes_on), "{from} to {to}");
        }
    }
}

/// A map of points whose return has a root beyond u = 1 (Nordmark 1991): on the near side the
/// fixed point is p, on the other one 1 + s^2 with (1 - sign s)^2 = p.
struct Root {
    sign: f64,
}
impl ReturnMap for Root {
    fn states(&self) -> usize {
        2
    }
    fn axis(&self) -> usize {
        1
    }
    fn has_points(&self) -> bool {
        true
    }
    fn returned(&self, u: &[f64], p: f64, _: bool) -> Result<Returned, Trouble> {
        let near = u[0] <= 1.0;
        let (point, slope) = if near {
            (0.5 * u[0] + 0.5 * p, 0.5)
        } else {
            let root = (u[0] - 1.0).sqrt();
            (0.5 * u[0] + 0.5 * p + self.sign * root, 0.5 + self.sign * 0.5 / root)
        };
        let extent = u[0].abs().max(1.0);
        let returned = once(vec![point, 0.0], vec![slope, 0.0, 0.0, 0.0]);
        Ok(Returned { events: usize::from(!near), extent, sizes: vec![extent; 2], ..returned })
    }
}

fn root_branch(sign: f64, start: f64, from: f64, to: f64) -> Branch {
    let (longest, most, size) = (0.05, 400, 1.0);
    let options = BranchOptions { from, to, longest, most, size, newton: NEWTON };
    let first = closed_orbit(&Root { sign }, &[start, 0.0], from, NEWTON).unwrap();
    follow(&Root { sign }, first, &options, &mut |_| true)
}

/// Orbits on both sides: the other one is unstable until s = 1/3.
#[test]
fn a_branch_of_points_goes_through_a_grazing() {
    for (start, from, to) in [(0.5, 0.5, 4.0), (2.0, 4.0, 0.5)] {
        let mut branch = root_branch(-1.0, start, from, to);
        assert_eq!(branch.end, End::Reached);
        branch.bifurcations.sort_by(|a, b| a.parameter.total_cmp(&b.parameter));
        let [grazing, doubling] = &branch.bifurcations[..] else {
            panic!("{:?}", branch.bifurcations)
        };
        assert_eq!(grazing.change, Change::DiscontinuityInduced);
        assert!((grazing.parameter - 1.0).abs() <= grazing.uncertainty, "{grazing:?}");
        assert_eq!(doubling.change, Change::PeriodDoubling);
        let off = (doubling.parameter - 16.0 / 9.0).abs();
        assert!(off <= doubling.uncertainty, "{doubling:?}");
    }
}

/// Both orbits on one side: the branch ends there, or turns back to the other one.
#[test]
fn a_branch_of_points_turns_back_at_a_grazing_or_ends_there() {
    for (start, from) in [(0.5, 0.5), (1.25, 0.25)] {
        let branch = root_branch(1.0, start, from, 2.0);
        let grazes = matches!(&branch.end, End::Lost(why) if why.contains("graze"));
        assert!(grazes || branch.end == End::TurnedBack, "{:?}", branch.end);
        let [change] = &branch.bifurcations[..] else { panic!("{:?}", branch.bifurcations) };
        let known = if grazes { Change::Grazing } else { Change::DiscontinuityInduced };
        assert_eq!(change.change, known);
        assert!((change.parameter - 1.0).abs() <= change.uncertainty, "{change:?}");
        assert!(change.uncertainty < 1e-3, "{change:?}");
    }
}

#[test]
fn a_doubling_is_found_on_a_curved_way_through_minus_one() {
    // The multiplier is -p^9: regula falsi without the Illinois variant's halving would take
    // hundreds of trials.
    let ninth = |p: f64| p * p * p * (p * p * p) * (p * p * p);
    let curved = Zeros(|x: f64, p: f64| Some([(-ninth(p) - 1.0) * x, -ninth(p) - 1.0]));
    let scales = Scales { state: 1.0, parameter: 1.0 };
    let doubling = |a: &Orbit, b: &Orbit| {
        let test = |o: &Orbit| (product(o, -1.0), sensitivity(o));
        let at = locate(&curved, a, b, &scales, NEWTON, &test)?;
        Some(at.transversal(Change::PeriodDoubling))
    };
    let at = |p: f64| closed_orbit(&curved, &[0.0, 0.0], p, NEWTON).unwrap();
    for (a, b) in [(0.5, 3.0), (3.0, 0.5)] {
        let found = doubling(&at(a), &at(b)).unwrap();
        assert!(
            (found.parameter - 1.0).abs() <= found.uncertainty && found.uncertainty < 1e-8,
            "{found:?}"
        );
    }
    // Both on one side: what another multiplier did is not this one's doing.
    assert_eq!(doubling(&at(0.5), &at(0.9)), None);
    assert_eq!(doubling(&at(1.5), &at(1.1)), None);
    // A member that lies on the change itself is where it is.
    let found = doubling(&at(1.0), &at(1.25)).unwrap();
    assert!((found.parameter - 1.0).abs() < 1e-12, "{found:?}");
}
