//! Closed orbits of any return map, and their continuation in a parameter.
//!
//! A closed orbit is a zero of P(u, p) - u. It is followed through the (u, p) plane by pseudo-arclength (Keller 1977; Seydel 2010,
//! Practical Bifurcation and Stability Analysis, ch. 4), so that folds, where the branch turns back in p, are passed.

use serde::{Deserialize, Serialize};

use super::floquet::{Returned, multipliers_of};
use crate::num::elementary::{ln, sqrt};
use crate::num::linear::solve_any;

/// A return map P(u, p) of a plane in a system with a parameter.
pub trait ReturnMap {
    /// Number of states.
    fn states(&self) -> usize;
    /// The coordinate of the plane, which stays what it is.
    fn axis(&self) -> usize;
    /// The return from `u` at the parameter's value `p`, with the derivative in u if it is asked for.
    ///
    /// # Errors
    /// In words: why there is no return or no derivative.
    fn returned(&self, u: &[f64], p: f64, derivative: bool) -> Result<Returned, String>;
}

/// A closed orbit with its stability.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Orbit {
    /// The parameter's value.
    pub parameter: f64,
    /// The orbit's point on the plane.
    pub point: Vec<f64>,
    /// Its period.
    pub period: f64,
    /// Floquet multipliers (real, imaginary) without the trivial one, by falling modulus.
    pub multipliers: Vec<[f64; 2]>,
    /// |P(u) - u| at the end.
    pub residual: f64,
    /// Newton iterations made.
    pub iterations: usize,
    /// Its passages through the plane in the counted direction, the point first.
    pub same: Vec<Vec<f64>>,
    /// Its passages in the other direction.
    pub opposite: Vec<Vec<f64>>,
}

impl Orbit {
    /// The largest modulus of a multiplier; 0 if there are none.
    pub fn largest_modulus(&self) -> f64 {
        self.multipliers.first().map_or(0.0, |m| sqrt(m[0] * m[0] + m[1] * m[1]))
    }

    /// Whether neighbours approach it.
    pub fn attracts(&self) -> bool {
        self.largest_modulus() < 1.0
    }

    /// The rate per unit time at which neighbours approach it in the end, negative if they leave; none where they arrive in finite time
    /// (all multipliers zero).
    pub fn rate(&self) -> Option<f64> {
        let largest = self.largest_modulus();
        (largest > 0.0).then(|| -ln(largest) / self.period)
    }
}

/// Newton's method: when it is done and when it gives up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Newton {
    /// Largest |P(u) - u| that counts as closed.
    pub closed: f64,
    /// Most iterations.
    pub iterations: usize,
}

/// Pivots below this share of the largest entry are rounding.
const SINGULAR: f64 = 1e-13;
/// An orbit that misses itself by up to so many times what counts as closed is taken for closed where Newton's method gets no further: what is
/// left is the error of the integration.
const STALLED: f64 = 100.0;

/// Whether Newton's method is done with this residual, having had that one before.
fn settled(residual: f64, before: f64, newton: Newton) -> bool {
    residual <= newton.closed || residual <= STALLED * newton.closed && residual >= 0.5 * before
}

/// The closed orbit near `guess` at the parameter's value `p`.
///
/// # Errors
/// In words, with what to do.
pub fn closed_orbit(map: &dyn ReturnMap, guess: &[f64], p: f64, newton: Newton) -> Result<Orbit, String> {
    let (n, axis) = (map.states(), map.axis());
    let mut u = guess.to_vec();
    let (mut best, mut before) = (f64::INFINITY, f64::INFINITY);
    for iterations in 0..=newton.iterations {
        let r = map.returned(&u, p, true)?;
        let difference: Vec<f64> = r.point.iter().zip(&u).map(|(a, b)| a - b).collect();
        let residual = sqrt(difference.iter().map(|d| d * d).sum());
        if settled(residual, before, newton) {
            return Ok(orbit(map, u, p, r, residual, iterations));
        }
        before = residual;
        best = best.min(residual);
        let mut matrix = less_identity(&r.derivative, n);
        matrix[axis * n + axis] = 1.0;
        let right: Vec<f64> = difference.iter().map(|d| -d).collect();
        let step = solve_any(&matrix, &right, SINGULAR * largest(&matrix)).ok_or(
            "the closed orbit is not isolated here: the return map has the multiplier 1 (a fold, or a conserved quantity)",
        )?;
        u.iter_mut().zip(&step).enumerate().filter(|(i, _)| *i != axis).for_each(|(_, (x, s))| *x += s);
    }
    Err(format!(
        "Newton's method found no closed orbit near the start: after {} iterations the orbit misses itself by {best:e} at best; start \
         nearer, let the motion settle for longer, or check the number of returns",
        newton.iterations
    ))
}

fn orbit(map: &dyn ReturnMap, u: Vec<f64>, p: f64, r: Returned, residual: f64, iterations: usize) -> Orbit {
    let multipliers = multipliers_of(&r.derivative, map.states(), map.axis());
    // The start is the orbit's first passage; the last return is the start again.
    let returns = r.same.len().saturating_sub(1);
    let same = std::iter::once(u.clone()).chain(r.same.into_iter().take(returns)).collect();
    Orbit { parameter: p, point: u, period: r.time, multipliers, residual, iterations, same, opposite: r.opposite }
}

fn less_identity(derivative: &[f64], n: usize) -> Vec<f64> {
    derivative.iter().enumerate().map(|(k, d)| if k / n == k % n { d - 1.0 } else { *d }).collect()
}

fn largest(matrix: &[f64]) -> f64 {
    matrix.iter().fold(0.0, |a, b| b.abs().max(a))
}

/// What happens to an orbit's stability between two members of a branch.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Change {
    /// A multiplier passes -1.
    PeriodDoubling,
    /// A multiplier passes 1, where the branch turns back: a fold (saddle-node).
    Fold,
    /// A multiplier passes 1 and the branch goes on: another branch meets it.
    Branching,
    /// A pair of complex multipliers leaves or enters the unit circle: a torus (Neimark-Sacker).
    Torus,
}

impl Change {
    /// The word for it.
    pub fn word(self) -> &'static str {
        match self {
            Change::PeriodDoubling => "period-doubling",
            Change::Fold => "fold",
            Change::Branching => "branching",
            Change::Torus => "torus",
        }
    }
}

/// A change of stability, where it happens.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Bifurcation {
    /// Which.
    pub change: Change,
    /// The parameter's value: where the multiplier is on the unit circle to Newton's accuracy, or between the two members.
    pub parameter: f64,
    /// Half of what is not known of it.
    pub uncertainty: f64,
}

/// Why a branch ends.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", tag = "end", content = "why")]
pub enum End {
    /// The range's other end was reached.
    Reached,
    /// The branch turned back and left the range where it had come in.
    TurnedBack,
    /// As many orbits as asked for.
    Enough,
    /// It cannot be followed: why.
    Lost(String),
    /// Asked to stop.
    Interrupted,
}

/// A branch of closed orbits.
#[derive(Clone, Debug, PartialEq)]
pub struct Branch {
    /// Its members, in order.
    pub orbits: Vec<Orbit>,
    /// Changes of stability along it.
    pub bifurcations: Vec<Bifurcation>,
    /// Why it ends.
    pub end: End,
}

/// How a branch is followed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Course {
    /// The parameter's range: from where the first orbit is to its other end.
    pub from: f64,
    /// The other end.
    pub to: f64,
    /// Longest step along the branch, as a share of the range (and of the state's size).
    pub longest: f64,
    /// Most orbits.
    pub most: usize,
    /// Newton's method.
    pub newton: Newton,
}

/// Shortest step as a share of the longest.
const SHORTEST: f64 = 1.0 / 16_384.0;
/// Steps grow after at most so many Newton iterations, and shrink when more than [`MANY`] are needed.
const FEW: usize = 3;
const MANY: usize = 8;
/// A step along which multipliers change by more than this is halved.
const JUMP: f64 = 0.75;

/// A point of the branch, scaled: the state by its size, the parameter by its range.
#[derive(Clone)]
struct Scales {
    state: f64,
    parameter: f64,
}

/// The branch from the orbit `first` on, as far as `course` says; `go_on` is told each orbit and may stop it.
pub fn follow(map: &dyn ReturnMap, first: Orbit, course: &Course, go_on: &mut dyn FnMut(&Orbit) -> bool) -> Branch {
    let scales = Scales {
        state: 1.0 + first.point.iter().fold(0.0_f64, |a, b| a.max(b.abs())),
        parameter: (course.to - course.from).abs(),
    };
    let towards = (course.to - course.from).signum();
    let mut branch = Branch { orbits: vec![first], bifurcations: Vec::new(), end: End::Enough };
    let mut step = 0.25 * course.longest;
    // The first direction: along the parameter.
    let mut direction: Option<(Vec<f64>, f64)> = None;
    while branch.orbits.len() < course.most {
        let last = &branch.orbits[branch.orbits.len() - 1];
        let n = last.point.len();
        let (du, dp) = direction.clone().unwrap_or((vec![0.0; n], towards));
        let guess: Vec<f64> = last.point.iter().zip(&du).map(|(u, d)| u + step * scales.state * d).collect();
        let p = last.parameter + step * scales.parameter * dp;
        let beyond = (p - course.to) * towards >= 0.0;
        let behind = (p - course.from) * towards < 0.0;
        let next = if beyond {
            // On the range's end exactly.
            let share = (course.to - last.parameter) / (p - last.parameter);
            let guess: Vec<f64> = last.point.iter().zip(&guess).map(|(a, b)| a + share * (b - a)).collect();
            closed_orbit(map, &guess, course.to, course.newton)
        } else {
            arclength(map, &guess, p, (&du, dp), &scales, course.newton)
        };
        let next = match next {
            Ok(next)
                if !beyond
                    && (next.iterations > MANY || jumps(last, &next))
                    && 0.5 * step >= SHORTEST * course.longest =>
            {
                Err("too long a step".to_owned())
            }
            other => other,
        };
        let next = match next {
            Ok(next) => next,
            Err(why) => {
                step *= 0.5;
                if step < SHORTEST * course.longest {
                    branch.end = End::Lost(why);
                    return branch;
                }
                continue;
            }
        };
        let (su, sp) = (
            next.point.iter().zip(&last.point).map(|(a, b)| (a - b) / scales.state).collect::<Vec<f64>>(),
            (next.parameter - last.parameter) / scales.parameter,
        );
        let length = sqrt(su.iter().map(|s| s * s).sum::<f64>() + sp * sp);
        let folded = direction.as_ref().is_some_and(|(_, dp)| dp * sp < 0.0);
        branch.bifurcations.extend(changes(map, last, &next, folded, course.newton));
        if length > 0.0 {
            direction = Some((su.iter().map(|s| s / length).collect(), sp / length));
        }
        if next.iterations <= FEW {
            step = (1.5 * step).min(course.longest);
        }
        let stop = !go_on(&next);
        branch.orbits.push(next);
        if beyond || behind || stop {
            branch.end = match (beyond, stop) {
                (true, _) => End::Reached,
                (_, true) => End::Interrupted,
                _ => End::TurnedBack,
            };
            return branch;
        }
    }
    branch
}

/// Whether multipliers differ so much that changes between these orbits might be missed.
fn jumps(a: &Orbit, b: &Orbit) -> bool {
    let pairs = a.multipliers.iter().zip(&b.multipliers);
    // Strongly repelling orbits change much without changing kind.
    pairs.into_iter().any(|(m, n)| {
        let size = sqrt(m[0] * m[0] + m[1] * m[1]).max(1.0);
        sqrt((m[0] - n[0]) * (m[0] - n[0]) + (m[1] - n[1]) * (m[1] - n[1])) > JUMP * size
    })
}

/// Newton's method for (P(u, p) - u, distance along the direction) = 0.
fn arclength(
    map: &dyn ReturnMap,
    guess: &[f64],
    p: f64,
    (du, dp): (&[f64], f64),
    scales: &Scales,
    newton: Newton,
) -> Result<Orbit, String> {
    let (n, axis) = (map.states(), map.axis());
    let (mut u, mut q, mut before) = (guess.to_vec(), p, f64::INFINITY);
    for iterations in 0..=newton.iterations {
        let r = map.returned(&u, q, true)?;
        let difference: Vec<f64> = r.point.iter().zip(&u).map(|(a, b)| a - b).collect();
        let residual = sqrt(difference.iter().map(|d| d * d).sum());
        let along: f64 =
            (0..n).map(|i| du[i] * (u[i] - guess[i]) / scales.state).sum::<f64>() + dp * (q - p) / scales.parameter;
        if settled(residual, before, newton) && along.abs() < 1e-6 {
            return Ok(orbit(map, u, q, r, residual, iterations));
        }
        before = residual;
        // The derivative in the parameter by differences; its error only slows Newton's method down.
        let delta = 1e-6 * scales.parameter;
        let (up, down) = (map.returned(&u, q + delta, false)?, map.returned(&u, q - delta, false)?);
        let size = n + 1;
        let mut matrix = vec![0.0; size * size];
        let inner = less_identity(&r.derivative, n);
        for i in 0..n {
            for j in 0..n {
                matrix[i * size + j] = inner[i * n + j];
            }
            matrix[i * size + n] = (up.point[i] - down.point[i]) / (2.0 * delta) * scales.parameter;
            matrix[n * size + i] = du[i] / scales.state;
        }
        (0..size).for_each(|j| matrix[axis * size + j] = 0.0);
        matrix[axis * size + axis] = 1.0;
        matrix[n * size + n] = dp;
        let mut right: Vec<f64> = difference.iter().map(|d| -d).collect();
        right.push(-along);
        let step = solve_any(&matrix, &right, SINGULAR * largest(&matrix))
            .ok_or("branches meet here: the branch's direction is not determined")?;
        u.iter_mut().zip(&step).enumerate().filter(|(i, _)| *i != axis).for_each(|(_, (x, s))| *x += s);
        q += step[n] * scales.parameter;
    }
    Err("Newton's method did not converge along the branch".into())
}

/// Changes of stability between neighbours on a branch.
fn changes(map: &dyn ReturnMap, a: &Orbit, b: &Orbit, folded: bool, newton: Newton) -> Vec<Bifurcation> {
    let count = |o: &Orbit, test: &dyn Fn(&[f64; 2]) -> bool| o.multipliers.iter().filter(|m| test(m)).count();
    let below: &dyn Fn(&[f64; 2]) -> bool = &|m| m[1] == 0.0 && m[0] < -1.0;
    let above: &dyn Fn(&[f64; 2]) -> bool = &|m| m[1] == 0.0 && m[0] > 1.0;
    let outside: &dyn Fn(&[f64; 2]) -> bool = &|m| m[1] != 0.0 && m[0] * m[0] + m[1] * m[1] > 1.0;
    let mut found = Vec::new();
    let between = |change| Bifurcation {
        change,
        parameter: 0.5 * (a.parameter + b.parameter),
        uncertainty: 0.5 * (a.parameter - b.parameter).abs(),
    };
    if count(a, below) != count(b, below) {
        found.push(doubling(map, a, b, newton).unwrap_or_else(|| between(Change::PeriodDoubling)));
    }
    if folded {
        found.push(between(Change::Fold));
    } else if count(a, above) != count(b, above) {
        found.push(between(Change::Branching));
    }
    if count(a, outside) != count(b, outside) {
        found.push(between(Change::Torus));
    }
    found
}

/// Where the real multiplier nearest to -1 passes it: by regula falsi (the Illinois variant, Dowell & Jarratt 1971).
fn doubling(map: &dyn ReturnMap, a: &Orbit, b: &Orbit, newton: Newton) -> Option<Bifurcation> {
    let test = |o: &Orbit| {
        let real = o.multipliers.iter().filter(|m| m[1] == 0.0).map(|m| m[0] + 1.0);
        real.min_by(|x, y| x.abs().total_cmp(&y.abs()))
    };
    let ((mut pa, mut ga), (mut pb, mut gb)) = ((a.parameter, test(a)?), (b.parameter, test(b)?));
    if ga * gb > 0.0 || pa == pb {
        return None;
    }
    let (mut point, mut last_side) = (b.point.clone(), 0);
    for _ in 0..40 {
        let p = pb - gb * (pb - pa) / (gb - ga);
        let orbit = closed_orbit(map, &point, p, newton).ok()?;
        let g = test(&orbit)?;
        point = orbit.point;
        let width = (pb - pa).abs();
        if g.abs() < 1e-7 || width < 1e-9 * (1.0 + p.abs()) {
            // How far p is from the zero, by the slope between the ends.
            let off = (g * (pb - pa) / (gb - ga)).abs();
            return Some(Bifurcation { change: Change::PeriodDoubling, parameter: p, uncertainty: off.min(width) });
        }
        let side = if g * gb > 0.0 { 1 } else { -1 };
        if side > 0 {
            (pb, gb) = (p, g);
            ga *= if last_side > 0 { 0.5 } else { 1.0 };
        } else {
            (pa, ga) = (p, g);
            gb *= if last_side < 0 { 0.5 } else { 1.0 };
        }
        last_side = side;
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The logistic map x -> p x (1 - x), as if it were a return map of the plane where the second state is zero.
    struct Logistic;
    impl ReturnMap for Logistic {
        fn states(&self) -> usize {
            2
        }
        fn axis(&self) -> usize {
            1
        }
        fn returned(&self, u: &[f64], p: f64, _: bool) -> Result<Returned, String> {
            let (x, point) = (u[0], vec![p * u[0] * (1.0 - u[0]), 0.0]);
            let derivative = vec![p * (1.0 - 2.0 * x), 0.0, 0.0, 0.0];
            Ok(Returned { point: point.clone(), time: 1.0, derivative, same: vec![point], opposite: Vec::new() })
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
        fn returned(&self, u: &[f64], p: f64, _: bool) -> Result<Returned, String> {
            let (x, point) = (u[0], vec![u[0] + p - u[0] * u[0], 0.0]);
            let derivative = vec![1.0 - 2.0 * x, 0.0, 0.0, 0.0];
            Ok(Returned { point: point.clone(), time: 1.0, derivative, same: vec![point], opposite: Vec::new() })
        }
    }

    const NEWTON: Newton = Newton { closed: 1e-12, iterations: 20 };

    #[test]
    fn the_logistic_map_doubles_at_three() {
        let first = closed_orbit(&Logistic, &[0.5, 0.0], 2.0, NEWTON).unwrap();
        let course = Course { from: 2.0, to: 3.5, longest: 0.1, most: 200, newton: NEWTON };
        let branch = follow(&Logistic, first, &course, &mut |_| true);
        assert_eq!(branch.end, End::Reached);
        let last = branch.orbits.last().unwrap();
        assert!((last.parameter - 3.5).abs() < 1e-12 && (last.point[0] - (1.0 - 1.0 / 3.5)).abs() < 1e-12, "{last:?}");
        let [doubling] = &branch.bifurcations[..] else { panic!("{:?}", branch.bifurcations) };
        assert!(doubling.change == Change::PeriodDoubling && (doubling.parameter - 3.0).abs() < 1e-7, "{doubling:?}");
        for o in &branch.orbits {
            assert_eq!(o.attracts(), o.parameter < 3.0);
        }
    }

    #[test]
    fn a_fold_is_passed() {
        let first = closed_orbit(&FoldMap, &[1.1, 0.0], 1.0, NEWTON).unwrap();
        let course = Course { from: 1.0, to: -1.0, longest: 0.05, most: 400, newton: NEWTON };
        let branch = follow(&FoldMap, first, &course, &mut |_| true);
        assert_eq!(branch.end, End::TurnedBack, "{:?}", branch.orbits.len());
        let last = branch.orbits.last().unwrap();
        assert!(last.point[0] < -0.9 && (last.point[0] * last.point[0] - last.parameter).abs() < 1e-9, "{last:?}");
        let fold = branch.bifurcations.iter().find(|b| b.change == Change::Fold).unwrap();
        assert!(fold.parameter.abs() <= fold.uncertainty + 2e-2, "{fold:?}");
    }

    #[test]
    fn what_does_not_close_is_told() {
        // p above 4 and a start from which the map runs away: no fixed point is near.
        let error = closed_orbit(&FoldMap, &[0.3, 0.0], -1.0, NEWTON).unwrap_err();
        assert!(error.contains("start"), "{error}");
    }
}
