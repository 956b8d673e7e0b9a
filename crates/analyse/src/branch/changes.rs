//! Changes of stability between neighbours on a branch of closed orbits: where the number of
//! multipliers outside the unit circle changes (Seydel 2010, sec. 7.4; Kuznetsov 2004, ch. 5).

use super::{Bifurcation, Change, Newton, Orbit, ReturnMap, Scales, Trouble};
use super::{ITERATIONS, apart, arclength, distance};
use twofold_num::elementary::sqrt;

/// Two that differ are halved so many times, to tell multipliers that leave the circle from others
/// that enter it meanwhile.
const HALVINGS: usize = 10;
/// Where the parameter turns without a fold, a multiplier is as near to 1 as this.
const AT_ONE: f64 = 0.05;
/// A multiplier that meets another one there has an imaginary part from rounding: at most the root
/// of its error, and never less than this.
const DOUBLE: f64 = 1e-7;

fn modulus(m: [f64; 2]) -> f64 {
    sqrt(m[0] * m[0] + m[1] * m[1])
}

/// Number of multipliers that are on the unit circle within their error, as those of conserved
/// quantities are.
pub(super) fn on_circle(o: &Orbit) -> usize {
    told(o).into_iter().filter(|(m, error)| (modulus(*m) - 1.0).abs() <= *error).count()
}

/// A multiplier and its error.
type Told = ([f64; 2], f64);

/// The multipliers, by falling modulus, with their errors.
fn told(o: &Orbit) -> Vec<Told> {
    o.multipliers.iter().copied().zip(o.errors.iter().copied()).collect()
}

/// Those without the `neutral` ones that are nearest to the circle.
fn without(o: &Orbit, neutral: usize) -> Vec<Told> {
    let mut left = told(o);
    for _ in 0..neutral.min(left.len()) {
        let off = |m: &Told| (modulus(m.0) - 1.0).abs();
        let nearest = (0..left.len()).min_by(|i, j| off(&left[*i]).total_cmp(&off(&left[*j])));
        nearest.map(|i| left.remove(i));
    }
    left
}

/// Whether as many multipliers are surely outside of the circle.
pub(super) fn alike(a: &Orbit, b: &Orbit) -> bool {
    outside(&told(a)) == outside(&told(b))
}

/// Number of multipliers beyond the circle and their errors.
fn outside(multipliers: &[Told]) -> usize {
    multipliers.iter().filter(|(m, error)| modulus(*m) > 1.0 + error).count()
}

/// Whether some of `before` leave the circle and as many enter it, if each goes to the nearest one
/// of `after`.
fn exchanges(before: &[Told], after: &[Told]) -> bool {
    let mut left: Vec<[f64; 2]> = after.iter().map(|told| told.0).collect();
    before.iter().any(|(m, _)| {
        let near = (0..left.len())
            .min_by(|i, j| distance(left[*i], *m).total_cmp(&distance(left[*j], *m)));
        near.is_some_and(|i| (modulus(left.remove(i)) > 1.0) != (modulus(*m) > 1.0))
    })
}

/// Changes of stability between neighbours on a branch. Multipliers that are on the circle at both
/// stay out of it.
pub(super) fn changes(
    map: &dyn ReturnMap,
    a: &Orbit,
    b: &Orbit,
    scales: &Scales,
    newton: Newton,
) -> Vec<Bifurcation> {
    if a.events != b.events {
        // Where the parameter turns the border lies beyond both, by what the states are apart.
        let mut change = between(Change::DiscontinuityInduced, a, b);
        let beyond = apart(&a.point, &b.point, scales.state) * scales.parameter;
        change.uncertainty = change.uncertainty.max(beyond);
        return vec![change];
    }
    let neutral = on_circle(a).min(on_circle(b));
    let mut found: Vec<Bifurcation> = Vec::new();
    for new in passages(map, a, b, neutral, scales, newton, HALVINGS) {
        let same = |old: &&mut Bifurcation| {
            let apart = (old.parameter - new.parameter).abs();
            old.change == new.change && apart <= old.uncertainty.max(new.uncertainty)
        };
        match found.iter_mut().find(same) {
            // Several pass at once.
            Some(old) => old.uncertainty = old.uncertainty.max(new.uncertainty),
            None => found.push(new),
        }
    }
    found
}

/// A change somewhere between two members.
fn between(change: Change, a: &Orbit, b: &Orbit) -> Bifurcation {
    Bifurcation {
        change,
        parameter: 0.5 * (a.parameter + b.parameter),
        uncertainty: 0.5 * (a.parameter - b.parameter).abs() + f64::EPSILON * a.parameter.abs(),
    }
}

/// Each passage of a multiplier through the circle; of a pair, one.
fn passages(
    map: &dyn ReturnMap,
    a: &Orbit,
    b: &Orbit,
    neutral: usize,
    scales: &Scales,
    newton: Newton,
    halvings: usize,
) -> Vec<Bifurcation> {
    let (before, after) = (without(a, neutral), without(b, neutral));
    let (fewer, more) = (outside(&before), outside(&after));
    let (fewer, more) = (fewer.min(more), fewer.max(more));
    if fewer == more {
        if halvings == 0 || !exchanges(&before, &after) {
            return Vec::new();
        }
        let Ok(middle) = member(map, a, b, 0.5, scales, newton) else { return Vec::new() };
        let halves = [(a, &middle), (&middle, b)];
        let of = |(a, b)| passages(map, a, b, neutral, scales, newton, halvings - 1);
        return halves.into_iter().flat_map(of).collect();
    }
    let mut found = Vec::new();
    let mut pair = false;
    for k in fewer..more {
        // The other one of a pair.
        if std::mem::take(&mut pair) {
            continue;
        }
        let kth = |o: &Orbit| without(o, neutral).get(k).copied().unwrap_or(([f64::NAN; 2], 0.0));
        let single = neutral == 0 && more == fewer + 1;
        let real = |o: &Orbit| {
            let (m, _) = kth(o);
            (m[1] == 0.0).then_some(if m[0] < 0.0 { -1.0 } else { 1.0 })
        };
        // Of one that passes alone the product is smooth where the others meet.
        let side = real(a).filter(|side| single && real(b) == Some(*side));
        // One that leaves the circle of conserved quantities is beyond its error first.
        let on_it = [a, b].map(kth).iter().any(|(m, error)| (modulus(*m) - 1.0).abs() <= *error);
        let beyond = if on_it { 2.0 * kth(a).1.max(kth(b).1) } else { 0.0 };
        let test: &dyn Fn(&Orbit) -> (f64, f64) = &|o| match side {
            Some(side) if !on_it => (product(o, side), sensitivity(o)),
            _ => (modulus(kth(o).0) - 1.0 - beyond, kth(o).1 + beyond),
        };
        let at = locate(map, a, b, scales, newton, test);
        let near = at.as_ref().map_or(if modulus(kth(a).0) > 1.0 { a } else { b }, |at| &at.orbit);
        let (m, error) = kth(near);
        let imaginary = DOUBLE.max(sqrt(error));
        let change = if m[1].abs() > imaginary {
            pair = true;
            Change::Torus
        } else if m[0] < 0.0 {
            Change::PeriodDoubling
        } else {
            Change::Branching
        };
        found.push(match at {
            None => between(change, a, b),
            Some(at) if at.jumps => between(Change::DiscontinuityInduced, a, b),
            Some(at) if change == Change::Branching => {
                at.fold_or_branching(map, a, b, scales, newton)
            }
            Some(at) => at.transversal(change),
        });
    }
    found
}

/// The branching point at which the parameter turns along three members without a fold: a
/// multiplier reaches 1 and goes back, as where the outer branches of a pitchfork meet (Kuznetsov
/// 2004, sec. 7.4).
pub(super) fn turning(
    map: &dyn ReturnMap,
    [a, middle, b]: [&Orbit; 3],
    scales: &Scales,
    newton: Newton,
) -> Option<Bifurcation> {
    let turns = (middle.parameter - a.parameter) * (b.parameter - middle.parameter) < 0.0;
    let neutral = on_circle(a).min(on_circle(b));
    let beyond = |o: &Orbit| outside(&without(o, neutral));
    let same = beyond(a) == beyond(b);
    if !turns || !same || a.events != middle.events || middle.events != b.events {
        return None;
    }
    let at = |share: f64| member(map, a, b, share, scales, newton).ok();
    // Beside the turn, where Newton's method has a matrix with an inverse.
    let beside = |share: f64, by: f64| {
        let (left, right) = (at(share - by)?.parameter, at(share + by)?.parameter);
        Some((0.5 * (left + right), right - left))
    };
    let (mut low, mut high) = (0.125, 0.875);
    let (first, last) = (beside(low, BESIDE)?.1, beside(high, BESIDE)?.1);
    if first * last >= 0.0 {
        return None;
    }
    while high - low > 1e-3 * BESIDE {
        let share = 0.5 * (low + high);
        if beside(share, BESIDE)?.1 * first > 0.0 {
            low = share;
        } else {
            high = share;
        }
    }
    let share = 0.5 * (low + high);
    let near = at(share - BESIDE)?;
    let from_one = |(m, _): &Told| distance(*m, [1.0, 0.0]);
    without(&near, neutral).iter().map(from_one).find(|off| *off <= AT_ONE)?;
    // The parameter is even in the distance, to rounding: Richardson's extrapolation to none.
    let [one, two, four] = [1.0, 2.0, 4.0].map(|times| beside(share, times * BESIDE));
    let ((one, _), (two, _), (four, _)) = (one?, two?, four?);
    let (fine, rough) = ((4.0 * one - two) / 3.0, (4.0 * two - four) / 3.0);
    let uncertainty = (fine - rough).abs()
        + (near.residual / near.extent + near.multiplier_error) * (one - two).abs()
        + newton.rtol * scales.parameter;
    Some(Bifurcation { change: Change::Branching, parameter: fine, uncertainty })
}

/// The turn of a parameter is looked for from members so far to both sides, as a share of the way.
const BESIDE: f64 = 1.0 / 32.0;

/// The product of all multipliers less `value`: it changes sign where one passes it, and stays
/// smooth where others meet.
pub(super) fn product(o: &Orbit, value: f64) -> f64 {
    let factors = o
        .multipliers
        .iter()
        .map(|m| if m[1] == 0.0 { [m[0] - value, 0.0] } else { [m[0] - value, m[1]] });
    // Complex factors come in pairs, beside each other.
    factors.fold([1.0, 0.0], |p, f| [p[0] * f[0] - p[1] * f[1], p[0] * f[1] + p[1] * f[0]])[0]
}

/// A zero of a test function along a branch, between two members.
pub(super) struct Located {
    /// The member nearest to it.
    orbit: Orbit,
    /// Its share of the way from the one to the other.
    share: f64,
    /// Change of the parameter over that of the test function, over the whole way.
    slope: f64,
    /// The test function's error there.
    error: f64,
    /// Whether the test function has a jump there, and no zero.
    jumps: bool,
}

/// A zero is located to this share of the way between two members.
const NARROW: f64 = 1e-9;
/// A test function that is still so large there, and a hundred times its error, jumps.
const LEAST_JUMP: f64 = 1e-4;

/// Zero of a test function, which gives its error, too, between two members: by regula falsi (the
/// Illinois variant, Dowell & Jarratt 1971) along the chord.
pub(super) fn locate(
    map: &dyn ReturnMap,
    a: &Orbit,
    b: &Orbit,
    scales: &Scales,
    newton: Newton,
    test: &dyn Fn(&Orbit) -> (f64, f64),
) -> Option<Located> {
    let ((mut sa, mut ga), (mut sb, mut gb)) = ((0.0, test(a).0), (1.0, test(b).0));
    let slope = (b.parameter - a.parameter) / (gb - ga);
    if ga.is_nan() || gb.is_nan() || ga * gb > 0.0 || ga == gb {
        return None;
    }
    let mut last_side = 0;
    let mut nearest: Option<(Orbit, f64, f64)> = None;
    for _ in 0..ITERATIONS {
        let share = sb - gb * (sb - sa) / (gb - ga);
        let orbit = member(map, a, b, share, scales, newton).ok()?;
        let (g, error) = test(&orbit);
        let done = g.abs() <= error || (sb - sa).abs() <= NARROW;
        let side = if g * gb > 0.0 { 1 } else { -1 };
        if side > 0 {
            (sb, gb) = (share, g);
            ga *= if last_side > 0 { 0.5 } else { 1.0 };
        } else {
            (sa, ga) = (share, g);
            gb *= if last_side < 0 { 0.5 } else { 1.0 };
        }
        last_side = side;
        if nearest.as_ref().is_none_or(|(_, _, best)| g.abs() < best.abs()) {
            nearest = Some((orbit, share, g));
        }
        if done {
            break;
        }
    }
    let (orbit, share, g) = nearest?;
    let error = g.abs() + test(&orbit).1;
    let jumps = (sb - sa).abs() <= NARROW && g.abs() > LEAST_JUMP.max(100.0 * test(&orbit).1);
    Some(Located { orbit, share, slope, error, jumps })
}

/// By how much a product of multipliers, or a modulus, may be off.
pub(super) fn sensitivity(orbit: &Orbit) -> f64 {
    let others =
        orbit.multipliers.iter().map(|m| 1.0 + sqrt(m[0] * m[0] + m[1] * m[1])).product::<f64>();
    orbit.multiplier_error * others * orbit.multipliers.len() as f64
}

/// The member at a share of the way from `a` to `b`.
fn member(
    map: &dyn ReturnMap,
    a: &Orbit,
    b: &Orbit,
    share: f64,
    scales: &Scales,
    newton: Newton,
) -> Result<Orbit, Trouble> {
    let guess: Vec<f64> = a.point.iter().zip(&b.point).map(|(a, b)| a + share * (b - a)).collect();
    let chord: Vec<f64> =
        a.point.iter().zip(&b.point).map(|(a, b)| (b - a) / scales.state).collect();
    let along = (b.parameter - a.parameter) / scales.parameter;
    let length = sqrt(chord.iter().map(|c| c * c).sum::<f64>() + along * along);
    let chord: Vec<f64> = chord.iter().map(|c| c / length).collect();
    let p = a.parameter + share * (b.parameter - a.parameter);
    arclength(map, &guess, p, (&chord, along / length), scales, newton)
}

impl Located {
    /// A change at which the parameter goes on in proportion to the test function.
    pub(super) fn transversal(self, change: Change) -> Bifurcation {
        let p = self.orbit.parameter;
        // Twice: the slope is that of a chord.
        let uncertainty = 2.0 * self.error * self.slope.abs() + f64::EPSILON * p.abs();
        Bifurcation { change, parameter: p, uncertainty }
    }

    /// A fold if the members on both sides are on one side in the parameter.
    fn fold_or_branching(
        self,
        map: &dyn ReturnMap,
        a: &Orbit,
        b: &Orbit,
        scales: &Scales,
        newton: Newton,
    ) -> Bifurcation {
        let p = self.orbit.parameter;
        let beside =
            |by: f64| member(map, a, b, self.share + by, scales, newton).map(|o| o.parameter - p);
        // Far from here members may be missing: a fold may be narrow beside the way.
        let both = |by: f64| Some((by, beside(-by).ok()?, beside(by).ok()?));
        let Some((by, before, after)) = [0.5, 0.125, 0.03, 0.01].into_iter().find_map(both) else {
            return self.transversal(Change::Branching);
        };
        if before * after <= 0.0 {
            return self.transversal(Change::Branching);
        }
        // The parameter is largest or smallest: what it is off by over that part of the way, in
        // proportion to the square of the share that is left of it; and by how much it moves with
        // the error of the return.
        let size = 0.5 * (before.abs() + after.abs());
        let left = self.error / (2.0 * self.error + self.sway(a, b));
        let delta = 1e-6 * scales.parameter;
        let moved = |q: f64| map.returned(&self.orbit.point, q, false).map(|r| r.point);
        let off =
            match (moved(p + delta), moved(p - delta), map.roughly(&self.orbit.point, p), moved(p))
            {
                (Ok(up), Ok(down), Ok(rough), Ok(fine)) => {
                    let gap = |a: &[f64], b: &[f64]| {
                        sqrt(a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum())
                    };
                    let moves = gap(&up, &down) / (2.0 * delta);
                    (self.orbit.residual
                        + gap(&rough.point, &fine)
                        + newton.error(&self.orbit.point))
                        / moves
                }
                _ => f64::INFINITY,
            };
        let uncertainty = size / (by * by) * left * left + 4.0 * off + 4.0 * f64::EPSILON * p.abs();
        Bifurcation {
            change: Change::Fold,
            parameter: p,
            uncertainty: if off.is_finite() { uncertainty } else { size },
        }
    }

    /// By how much the product of multipliers less 1 changes over half of the way.
    fn sway(&self, a: &Orbit, b: &Orbit) -> f64 {
        0.5 * (product(a, 1.0) - product(b, 1.0)).abs()
    }
}
