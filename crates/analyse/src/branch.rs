//! Closed orbits of any return map, and their continuation in a parameter.
//!
//! A closed orbit is a zero of P(u, p) - u. It is followed through the (u, p) plane by pseudo-arclength (Keller 1977; Seydel 2010,
//! Practical Bifurcation and Stability Analysis, ch. 4), so that folds, where the branch turns back in p, are passed.

use serde::{Deserialize, Serialize};

use super::floquet::{Returned, multipliers_of};
use twofold_num::elementary::{ln, sqrt};
use twofold_num::linear::solve_any;

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

    /// Zeros of a function f(x, p), given with its slope in x, as closed orbits; not defined where it is `None`.
    struct Zeros<F>(F);
    impl<F: Fn(f64, f64) -> Option<[f64; 2]>> ReturnMap for Zeros<F> {
        fn states(&self) -> usize {
            2
        }
        fn axis(&self) -> usize {
            1
        }
        fn returned(&self, u: &[f64], p: f64, _: bool) -> Result<Returned, String> {
            let [f, slope] = (self.0)(u[0], p).ok_or("nothing there")?;
            let point = vec![u[0] + f, 0.0];
            let derivative = vec![1.0 + slope, 0.0, 0.0, 0.0];
            Ok(Returned { point: point.clone(), time: 1.0, derivative, same: vec![point], opposite: Vec::new() })
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
        assert!(with(0.0, &[[0.6, 0.7]]).attracts() && !with(0.0, &[[0.6, -0.9]]).attracts());
    }

    #[test]
    fn what_counts_as_closed() {
        let newton = Newton { closed: 1e-9, iterations: 20 };
        let cases = [
            (1e-9, f64::INFINITY, true),
            (1.1e-9, 1.0, false),
            // Stuck, and not far off.
            (1e-7, 1.9e-7, true),
            (1e-7, 2.1e-7, false),
            (1.1e-7, 1.1e-7, false),
        ];
        for (residual, before, want) in cases {
            assert_eq!(settled(residual, before, newton), want, "{residual} {before}");
        }
    }

    #[test]
    fn a_multiplier_that_differs_from_one_by_rounding_is_one() {
        /// Its derivative less one has the rows 1e8 (1, 1) and 1e8 (1, 1) but for the last bit: of rank one, as far as can be told.
        struct Rounded;
        impl ReturnMap for Rounded {
            fn states(&self) -> usize {
                3
            }
            fn axis(&self) -> usize {
                2
            }
            fn returned(&self, u: &[f64], _: f64, _: bool) -> Result<Returned, String> {
                let point = vec![u[0] + 1.0, u[1] + 2.0, 0.0];
                let derivative = vec![1e8 + 1.0, 1e8, 0.0, 1e8, 1e8 + 1.0 + 1.5e-8, 0.0, 0.0, 0.0, 0.0];
                Ok(Returned { point, time: 1.0, derivative, same: Vec::new(), opposite: Vec::new() })
            }
        }
        let error = closed_orbit(&Rounded, &[0.0; 3], 0.0, NEWTON).unwrap_err();
        assert!(error.contains("multiplier 1"), "{error}");
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
            fn returned(&self, u: &[f64], p: f64, _: bool) -> Result<Returned, String> {
                let once = Logistic.returned(u, p, true)?;
                let twice = Logistic.returned(&once.point, p, true)?;
                let derivative = vec![once.derivative[0] * twice.derivative[0], 0.0, 0.0, 0.0];
                let same = vec![once.point, twice.point.clone()];
                Ok(Returned { point: twice.point, time: 2.0, derivative, same, opposite: Vec::new() })
            }
        }
        let p = 3.2;
        let orbit = closed_orbit(&Twice, &[0.5, 0.0], p, NEWTON).unwrap();
        // The cycle of two: x = (p + 1 -+ sqrt((p - 3)(p + 1)))/(2 p), with the multiplier 4 + 2 p - p^2.
        let root = sqrt((p - 3.0) * (p + 1.0));
        let ends = [-root, root].map(|r| (p + 1.0 + r) / (2.0 * p));
        assert_eq!(orbit.same.len(), 2);
        for (got, want) in orbit.same.iter().zip(ends) {
            assert!((got[0] - want).abs() < 1e-11, "{orbit:?}");
        }
        assert!((orbit.multipliers[0][0] - (4.0 + 2.0 * p - p * p)).abs() < 1e-10 && orbit.attracts(), "{orbit:?}");
    }

    #[test]
    fn steps_along_a_straight_branch_are_as_long_as_they_should_be() {
        // x = p, from 1 to 5: of the state's scale 2 and the parameter's 4.
        let line = Zeros(|x: f64, p: f64| Some([0.5 * (p - x), -0.5]));
        let first = closed_orbit(&line, &[1.0, 0.0], 1.0, NEWTON).unwrap();
        let course = Course { from: 1.0, to: 5.0, longest: 0.1, most: 200, newton: NEWTON };
        let branch = follow(&line, first, &course, &mut |_| true);
        assert_eq!(branch.end, End::Reached);
        assert!(branch.bifurcations.is_empty());
        let n = branch.orbits.len();
        let mut want = 0.025;
        for (k, pair) in branch.orbits.windows(2).enumerate() {
            let (dx, dp) = ((pair[1].point[0] - pair[0].point[0]) / 2.0, (pair[1].parameter - pair[0].parameter) / 4.0);
            let length = sqrt(dx * dx + dp * dp);
            match k {
                // The first is a step in the parameter; the orbit is not where it was, and is found.
                0 => assert!((dp - want).abs() < 1e-12 && pair[1].iterations == 1, "{pair:?}"),
                // What follows a straight line needs no search.
                _ if k + 2 < n => {
                    assert!((length - want).abs() < 1e-9 && pair[1].iterations == 0, "{k}: {length} {want}")
                }
                _ => assert!(length <= 0.1 && pair[1].iterations == 0 && pair[1].parameter == 5.0, "{pair:?}"),
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
        let first = closed_orbit(&circle, &[4.9, 0.0], 0.0, NEWTON).unwrap();
        let course = Course { from: 0.0, to: 6.0, longest: 0.05, most: 400, newton: NEWTON };
        let branch = follow(&circle, first, &course, &mut |_| true);
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
            fold.change == Change::Fold && (fold.parameter - 5.0).abs() < 0.05 && fold.uncertainty < 0.05,
            "{fold:?}"
        );
    }

    #[test]
    fn a_branch_ends_where_its_orbits_do_or_where_it_is_told() {
        let ray = Zeros(|x: f64, p: f64| (p <= 1.0).then_some([-0.5 * x, -0.5]));
        let course = Course { from: 0.0, to: 4.0, longest: 0.1, most: 100, newton: NEWTON };
        let first = || closed_orbit(&ray, &[0.0, 0.0], 0.0, NEWTON).unwrap();
        let branch = follow(&ray, first(), &course, &mut |_| true);
        assert_eq!(branch.end, End::Lost("nothing there".into()));
        // As near to the end as two of the shortest steps.
        let left = 1.0 - branch.orbits.last().unwrap().parameter;
        assert!((0.0..2.0 * SHORTEST * 0.1 * 4.0).contains(&left), "{left}");

        let branch = follow(&ray, first(), &Course { most: 4, ..course }, &mut |_| true);
        assert_eq!((branch.end, branch.orbits.len()), (End::Enough, 4));
        let mut told = 0;
        let mut third = |_: &Orbit| {
            told += 1;
            told < 3
        };
        let branch = follow(&ray, first(), &course, &mut third);
        assert_eq!((branch.end, branch.orbits.len()), (End::Interrupted, 4));
    }

    #[test]
    fn steps_are_short_where_multipliers_change_fast() {
        for steepness in [40.0, 4000.0] {
            let steep = Zeros(|x: f64, p: f64| Some([(steepness * p - 1.0) * x, steepness * p - 1.0]));
            let first = closed_orbit(&steep, &[0.0, 0.0], -1.0, NEWTON).unwrap();
            let course = Course { from: -1.0, to: 1.0, longest: 0.1, most: 200, newton: NEWTON };
            let branch = follow(&steep, first, &course, &mut |_| true);
            assert_eq!(branch.end, End::Reached);
            let within = &branch.orbits[..branch.orbits.len() - 1];
            assert!(within.windows(2).all(|pair| !jumps(&pair[0], &pair[1])));
            // The multiplier passes -1 and then 1.
            let [doubling, branching] = &branch.bifurcations[..] else { panic!("{:?}", branch.bifurcations) };
            assert_eq!((doubling.change, branching.change), (Change::PeriodDoubling, Change::Branching));
            assert!((doubling.parameter * steepness + 1.0).abs() < 1e-7, "{doubling:?}");
            let off = (branching.parameter - 1.0 / steepness).abs();
            assert!(off <= branching.uncertainty && branching.uncertainty < 0.5 / steepness, "{branching:?}");
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
        let of = |m: &[[f64; 2]], n: &[[f64; 2]], folded| -> Vec<(Change, f64, f64)> {
            // Where the map cannot tell where a multiplier passes -1, doublings too.
            let nothing = Zeros(|_: f64, _: f64| None);
            let found = changes(&nothing, &with(3.0, m), &with(8.0, n), folded, NEWTON);
            found.iter().map(|b| (b.change, b.parameter, b.uncertainty)).collect()
        };
        let one = |change| vec![(change, 5.5, 2.5)];
        assert_eq!(of(&[[-0.9, 0.0]], &[[-1.1, 0.0]], false), one(Change::PeriodDoubling));
        assert_eq!(of(&[[0.9, 0.0]], &[[1.1, 0.0]], false), one(Change::Branching));
        assert_eq!(of(&[[0.9, 0.0]], &[[1.1, 0.0]], true), one(Change::Fold));
        let pair = |a: f64, b: f64| [[a, b], [a, -b]];
        assert_eq!(of(&pair(0.1, 0.9), &pair(0.1, 1.1), false), one(Change::Torus));
        assert_eq!(of(&pair(0.7, 0.6), &pair(0.8, 0.7), false), one(Change::Torus));
        assert_eq!(of(&pair(0.7, -0.6), &pair(0.7, -0.7), false), []);
        // A complex pair beyond the circle is neither below -1 nor above 1, and real multipliers make no torus.
        assert_eq!(of(&pair(1.2, 0.1), &pair(-1.2, 0.1), false), []);
        assert_eq!(of(&[[0.9, 0.0], [0.5, 0.0]], &[[0.7, 0.0], [0.6, 0.0]], false), []);
        let both = of(&[[-0.9, 0.0], [0.9, 0.0]], &[[-1.1, 0.0], [1.1, 0.0]], false);
        assert_eq!(both.iter().map(|b| b.0).collect::<Vec<_>>(), [Change::PeriodDoubling, Change::Branching]);
    }

    #[test]
    fn a_doubling_is_found_on_a_curved_way_through_minus_one() {
        // The multiplier is -p^9: regula falsi without the Illinois variant's halving would take hundreds of trials.
        let ninth = |p: f64| p * p * p * (p * p * p) * (p * p * p);
        let curved = Zeros(|x: f64, p: f64| Some([(-ninth(p) - 1.0) * x, -ninth(p) - 1.0]));
        let at = |p: f64| closed_orbit(&curved, &[0.0, 0.0], p, NEWTON).unwrap();
        for (a, b) in [(0.5, 3.0), (3.0, 0.5)] {
            let found = doubling(&curved, &at(a), &at(b), NEWTON).unwrap();
            assert_eq!(found.change, Change::PeriodDoubling);
            // The multiplier is at the circle to 1e-7 and its slope there is 9.
            assert!((found.parameter - 1.0).abs() < 1.2e-8 && found.uncertainty < 1.2e-8, "{found:?}");
        }
        // Both on one side: what another multiplier did is not this one's doing.
        assert_eq!(doubling(&curved, &at(0.5), &at(0.9), NEWTON), None);
        assert_eq!(doubling(&curved, &at(1.5), &at(1.1), NEWTON), None);
        // A member that lies on the change itself is where it is.
        let found = doubling(&curved, &at(1.0), &at(1.25), NEWTON).unwrap();
        assert!((found.parameter - 1.0).abs() < 1e-12, "{found:?}");
    }
}
