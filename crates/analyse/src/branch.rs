//! Closed orbits of any return map, and their continuation in a parameter.
//!
//! A closed orbit is a zero of P(u, p) - u. It is followed through the (u, p) plane by
//! pseudo-arclength (Keller 1977; Seydel 2010, Practical Bifurcation and Stability Analysis, ch.
//! 4), so that folds, where the branch turns back in p, are passed.

mod changes;

use serde::{Deserialize, Serialize};

use changes::{alike, changes, on_circle, turning};

use super::floquet::{Returned, multipliers_of};
use twofold_num::elementary::{ln, sqrt};
use twofold_num::linear::{solve_any, solve_some};

/// A return map P(u, p) of a plane in a system with a parameter.
pub trait ReturnMap {
    /// Number of states.
    fn states(&self) -> usize;
    /// The coordinate of the plane, which stays what it is.
    fn axis(&self) -> usize;
    /// The return from `u` at the parameter's value `p`, with the derivative in u if it is asked
    /// for.
    ///
    /// # Errors
    /// Why there is no return or no derivative.
    fn returned(&self, u: &[f64], p: f64, derivative: bool) -> Result<Returned, Trouble>;
    /// The same, computed less accurately, with the derivative: the difference is at least the
    /// error of [`ReturnMap::returned`]. A map that is computed exactly needs none.
    ///
    /// # Errors
    /// Why there is no return or no derivative.
    fn roughly(&self, u: &[f64], p: f64) -> Result<Returned, Trouble> {
        self.returned(u, p, true)
    }
    /// Whether a point that stays where it is counts as an orbit: of a map, or of the period of a
    /// drive.
    fn has_points(&self) -> bool {
        false
    }
    /// The rest near `u` at the parameter's value `p`, and the eigenvalues there.
    fn rest(&self, _u: &[f64], _p: f64) -> Option<(Vec<f64>, Vec<[f64; 2]>)> {
        None
    }
}

/// Why there is no closed orbit.
#[derive(Clone, Debug, PartialEq)]
pub struct Trouble {
    /// The kind of obstacle.
    pub obstacle: Obstacle,
    /// A message that says what to do.
    pub said: String,
}

/// Why a return map has no closed orbit here.
#[derive(Clone, Debug, PartialEq)]
pub enum Obstacle {
    /// It touches the switching surface.
    Grazing,
    /// It comes to where its future is a set.
    SetValued,
    /// The search comes to a point from which there is no loop, or one that is not told from a
    /// rest.
    Point(Vec<f64>),
    /// The search comes to an orbit that passes the plane in the other direction there.
    Reversed,
    /// Anything else.
    Other,
}

impl From<String> for Trouble {
    fn from(said: String) -> Self {
        Self { obstacle: Obstacle::Other, said }
    }
}

impl From<&str> for Trouble {
    fn from(said: &str) -> Self {
        said.to_owned().into()
    }
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
    /// Diagonal of the box around it.
    pub extent: f64,
    /// Largest error of a multiplier.
    pub multiplier_error: f64,
    /// Error of each multiplier.
    pub errors: Vec<f64>,
    /// Events on the way (crossings of the switching surface, landings, departures), if the system
    /// is discontinuous.
    pub events: usize,
    /// Whether a multiplier is 1 within the error of the return map's derivative: others beside it
    /// may be closed, too.
    pub fills: bool,
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

    /// The stability that the multipliers imply, within their error.
    pub fn stability(&self) -> Stability {
        let (largest, error) = (self.largest_modulus(), self.largest_error());
        let mut told = self.multipliers.iter().zip(&self.errors);
        let isolated = told.all(|(m, error)| distance(*m, [1.0, 0.0]) > *error);
        if largest > 1.0 + error {
            Stability::Unstable
        } else if !isolated {
            Stability::NotIsolated
        } else if largest >= 1.0 - error {
            Stability::Neutral
        } else {
            Stability::Stable
        }
    }

    /// The rate per unit time at which neighbours approach it in the end, negative if they leave;
    /// none where they arrive in finite time (all multipliers zero), or where the largest
    /// multiplier is not told from zero.
    pub fn rate(&self) -> Option<f64> {
        let largest = self.largest_modulus();
        (largest > self.largest_error()).then(|| -ln(largest) / self.period)
    }

    /// The distance by which its point may be off, as a share of its extent: what counts as closed
    /// where Newton's method gets no further, over the distance of the nearest multiplier from 1.
    pub fn off(&self, newton: Newton) -> f64 {
        STALLED * newton.closed / from_one(&self.multipliers)
    }

    /// The error of the largest multiplier.
    fn largest_error(&self) -> f64 {
        self.errors.first().copied().unwrap_or(0.0)
    }
}

/// Stability of a closed orbit by its multipliers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Stability {
    /// All are within the unit circle: neighbours approach.
    Stable,
    /// One is beyond it: some leave.
    Unstable,
    /// One is 1 within its error, and none beyond the circle: other closed orbits are beside it, or
    /// it is at a fold.
    NotIsolated,
    /// One is on the circle within its error: linear terms do not tell.
    Neutral,
}

impl Stability {
    /// The word for it.
    pub fn word(self) -> &'static str {
        match self {
            Stability::Stable => "stable",
            Stability::Unstable => "unstable",
            Stability::NotIsolated => "not-isolated",
            Stability::Neutral => "neutral",
        }
    }
}

/// Options of Newton's method.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Newton {
    /// Largest |P(u) - u| that counts as closed, as a share of the orbit's extent.
    pub closed: f64,
    /// Absolute error of the integration.
    pub atol: f64,
    /// Relative error of the integration.
    pub rtol: f64,
    /// Maximum number of iterations.
    pub iterations: usize,
}

/// Pivots below this share of the largest entry are rounding.
const SINGULAR: f64 = 1e-13;
/// An orbit that misses itself by up to so many times what counts as closed is taken for closed
/// where Newton's method gets no further: what is left is the error of the integration.
const STALLED: f64 = 100.0;

/// Trials to locate a change.
const ITERATIONS: usize = 60;
/// The least error of a multiplier.
const ROUNDING: f64 = 1e-13;
/// Distance of a multiplier from 1 below which Newton's method goes on as long as it helps.
const NEAR_ONE: f64 = 1e-3;
/// Errors of multipliers are looked at behind a last step of at most this share of the orbit.
const SHORT: f64 = 1e-5;
/// A loop of at most so many times the integration's error is not told from a point.
const POINT: f64 = 1e3;
/// Whether Newton's method is done with this residual, having had that one before, `closed` being
/// what counts as closed.
fn settled(residual: f64, before: f64, closed: f64) -> bool {
    residual <= closed || residual <= STALLED * closed && residual >= 0.5 * before
}

impl Newton {
    /// The integration's error at `u`.
    fn error(&self, u: &[f64]) -> f64 {
        self.atol + self.rtol * largest(u)
    }

    /// Largest distance that counts as closed for the return `r` of `u`.
    ///
    /// # Errors
    /// If all of it is a point, and a point is no orbit of the map.
    fn closed(&self, map: &dyn ReturnMap, u: &[f64], r: &Returned) -> Result<f64, Trouble> {
        if r.extent <= POINT * self.error(u) && !map.has_points() {
            let said = "the search comes to a rest: its loop shrinks to a point".to_owned();
            return Err(Trouble { obstacle: Obstacle::Point(u.to_vec()), said });
        }
        Ok((self.closed * r.extent).max(self.error(u)))
    }
}

/// Whether a point misses itself by more than the return's error, as one behind a fold does, where
/// there is no orbit.
fn misses(map: &dyn ReturnMap, u: &[f64], p: f64, r: &Returned, residual: f64) -> bool {
    const ROUNDING: f64 = 1e-12;
    if residual <= ROUNDING * r.extent {
        return false;
    }
    map.roughly(u, p).is_ok_and(|rough| {
        let apart: Vec<f64> = r.point.iter().zip(&rough.point).map(|(a, b)| a - b).collect();
        residual > 2.0 * sized(&apart, r)
    })
}

/// The size of a difference of states, each in units of the loop's size as it has it, times the
/// loop's extent.
fn sized(difference: &[f64], r: &Returned) -> f64 {
    let weighed = difference.iter().zip(&r.sizes).map(|(d, size)| d * (r.extent / size));
    sqrt(weighed.map(|d| d * d).sum())
}

/// The distance from 1 of the multiplier that is nearest to it; at most 1.
fn from_one(multipliers: &[[f64; 2]]) -> f64 {
    multipliers.iter().map(|m| distance(*m, [1.0, 0.0])).fold(1.0, f64::min)
}

fn distance(a: [f64; 2], b: [f64; 2]) -> f64 {
    sqrt((a[0] - b[0]) * (a[0] - b[0]) + (a[1] - b[1]) * (a[1] - b[1]))
}

/// The closed orbit near `guess` at the parameter's value `p`.
///
/// # Errors
/// A message that says what to do.
pub fn closed_orbit(
    map: &dyn ReturnMap,
    guess: &[f64],
    p: f64,
    newton: Newton,
) -> Result<Orbit, Trouble> {
    let axis = map.axis();
    let mut u = guess.to_vec();
    let (mut best, mut before) = (f64::INFINITY, f64::INFINITY);
    for iterations in 0..=newton.iterations {
        let r = map.returned(&u, p, true)?;
        let difference: Vec<f64> = r.point.iter().zip(&u).map(|(a, b)| a - b).collect();
        let residual = sized(&difference, &r);
        let helps = residual > 0.0 && residual < 0.5 * before;
        let closed = settled(residual, before, newton.closed(map, &u, &r)?);
        let ends = closed && !(map.has_points() && helps);
        if ends && !(map.has_points() && misses(map, &u, p, &r, residual)) {
            return orbit(map, u, p, r, residual, iterations);
        }
        before = residual;
        best = best.min(residual);
        let step = match correction(map, &u, &r) {
            Some(step) => step,
            None if closed => return orbit(map, u, p, r, residual, iterations),
            None => {
                return Err("the closed orbit is not isolated here: the return map has the \
                            multiplier 1 (a fold, or a conserved quantity)"
                    .into());
            }
        };
        u.iter_mut()
            .zip(&step)
            .enumerate()
            .filter(|(i, _)| *i != axis)
            .for_each(|(_, (x, s))| *x += s);
    }
    Err(format!(
        "Newton's method found no closed orbit near the start: after {} iterations the orbit \
            misses itself by {best:e} at best; start \
         nearer, let the motion settle for longer, or check the number of returns",
        newton.iterations
    )
    .into())
}

/// Newton's step from `u`, whose return is `r`.
fn correction(map: &dyn ReturnMap, u: &[f64], r: &Returned) -> Option<Vec<f64>> {
    let (n, axis) = (map.states(), map.axis());
    let mut matrix = less_identity(&r.derivative, n);
    matrix[axis * n + axis] = 1.0;
    let right: Vec<f64> = u.iter().zip(&r.point).map(|(u, there)| u - there).collect();
    solve_any(&matrix, &right, SINGULAR * largest(&matrix))
}

fn orbit(
    map: &dyn ReturnMap,
    u: Vec<f64>,
    p: f64,
    r: Returned,
    residual: f64,
    iterations: usize,
) -> Result<Orbit, Trouble> {
    if !r.passes {
        let said = "the orbit that the search comes to passes the plane in the other direction: \
            choose another plane or start";
        return Err(Trouble { obstacle: Obstacle::Reversed, said: said.into() });
    }
    let multipliers = multipliers_of(&r.derivative, map.states(), map.axis());
    let step = correction(map, &u, &r).filter(|step| sized(step, &r) <= SHORT * r.extent);
    let beside: Vec<f64> = match step {
        Some(step) => u.iter().zip(step).map(|(u, step)| u + step).collect(),
        None => u.clone(),
    };
    // The start is the orbit's first passage; the last return is the start again.
    let returns = r.same.len().saturating_sub(1);
    let same = std::iter::once(u.clone()).chain(r.same.into_iter().take(returns)).collect();
    let (errors, fills) =
        multiplier_errors(map, &beside, p, &multipliers, residual / r.extent, r.derivative_error);
    Ok(Orbit {
        parameter: p,
        point: u,
        period: r.time,
        multipliers,
        residual,
        iterations,
        extent: r.extent,
        multiplier_error: errors.iter().copied().fold(0.0, f64::max),
        errors,
        events: r.events,
        fills,
        same,
        opposite: r.opposite,
    })
}

/// The errors of multipliers: by how much those of a less accurate map differ, at the point to
/// which Newton's method would go from the orbit's, and by how much they change over the distance
/// by which the orbit's point is off (the residual over the distance of the nearest multiplier from
/// 1), ten times as fast as they change over the orbit. Where a multiplier is 1 within the first
/// part, the points beside are as good: this is said, too.
fn multiplier_errors(
    map: &dyn ReturnMap,
    u: &[f64],
    p: f64,
    multipliers: &[[f64; 2]],
    residual: f64,
    least: f64,
) -> (Vec<f64>, bool) {
    let Ok(rough) = map.roughly(u, p) else {
        return (vec![f64::INFINITY; multipliers.len()], false);
    };
    let rough = multipliers_of(&rough.derivative, map.states(), map.axis());
    let differences = multipliers.iter().zip(&rough).map(|(a, b)| distance(*a, *b));
    let errors: Vec<f64> = differences.map(|d| d.max(ROUNDING + least)).collect();
    let off = multipliers.iter().map(|m| distance(*m, [1.0, 0.0]));
    let fills = off.clone().zip(&errors).any(|(off, error)| off <= *error);
    let from_one = off.fold(1.0, f64::min);
    let misplaced = if fills { 0.0 } else { (10.0 * residual / from_one).min(1.0) };
    (errors.iter().map(|error| error + misplaced).collect(), fills)
}

fn less_identity(derivative: &[f64], n: usize) -> Vec<f64> {
    derivative.iter().enumerate().map(|(k, d)| if k / n == k % n { d - 1.0 } else { *d }).collect()
}

fn largest(matrix: &[f64]) -> f64 {
    matrix.iter().fold(0.0, |a, b| b.abs().max(a))
}

/// A change of an orbit's stability between two members of a branch.
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
    /// The orbit shrinks to an equilibrium whose eigenvalues are imaginary: a Hopf point, the
    /// branch's end.
    Hopf,
    /// The orbit shrinks to a point that is no Hopf point, as at a boundary equilibrium: the
    /// branch's end.
    Vanishing,
    /// The orbit comes to graze the switching surface: what follows is another return map (di
    /// Bernardo et al. 2008, ch. 6 to 8).
    Grazing,
    /// The orbits on both sides have other events: crossings, landings or departures (di Bernardo
    /// et al. 2008, ch. 7 and 8).
    DiscontinuityInduced,
    /// The orbit comes to where its future is a set.
    SetValued,
}

impl Change {
    /// All kinds.
    pub const ALL: [Change; 9] = [
        Change::PeriodDoubling,
        Change::Fold,
        Change::Branching,
        Change::Torus,
        Change::Hopf,
        Change::Vanishing,
        Change::Grazing,
        Change::DiscontinuityInduced,
        Change::SetValued,
    ];

    /// The word for it.
    pub fn word(self) -> &'static str {
        match self {
            Change::PeriodDoubling => "period-doubling",
            Change::Fold => "fold",
            Change::Branching => "branching",
            Change::Torus => "torus",
            Change::Hopf => "hopf",
            Change::Vanishing => "vanishing",
            Change::Grazing => "grazing",
            Change::DiscontinuityInduced => "discontinuity-induced",
            Change::SetValued => "set-valued",
        }
    }
}

/// A change of stability, where it happens.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Bifurcation {
    /// Kind of the change.
    pub change: Change,
    /// The parameter's value.
    pub parameter: f64,
    /// Half of the interval around it in which the change lies: what is left of the bracket, and
    /// the errors of the integration and of Newton's method.
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
    /// The orbit shrinks to a point: which, the last bifurcation says.
    Vanished,
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

/// Options of continuation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BranchOptions {
    /// The parameter's range: from where the first orbit is to its other end.
    pub from: f64,
    /// The other end.
    pub to: f64,
    /// Maximum step along the branch, as a share of the range (and of the state's size).
    pub longest: f64,
    /// Maximum number of orbits.
    pub most: usize,
    /// The least size of a state that counts: a change of it is a step of length one along the
    /// branch. Zero for loops, whose extent is known.
    pub size: f64,
    /// Newton's method.
    pub newton: Newton,
}

/// Shortest step as a share of the longest.
const SHORTEST: f64 = 1.0 / 16_384.0;
/// Part of it down to which points of maps are followed.
const NARROW: f64 = 1.0 / 256.0;
/// Steps grow after at most so many Newton iterations, and shrink when more than [`MANY`] are
/// needed.
const FEW: usize = 3;
const MANY: usize = 8;
/// A step along which multipliers change by more than this is halved.
const JUMP: f64 = 0.75;
/// The longest step as a share of the orbit's own extent.
const REACH: f64 = 0.4;
/// An orbit of this share of the branch's largest extent has shrunk to a point.
const GONE: f64 = 1e-4;
/// The step of the derivative in the parameter, as a share of its range.
const DELTA: f64 = 1e-6;
/// A small loop that may be off by more than this share of itself is not told from the rest within.
const TOLD: f64 = 0.03;

/// A point of the branch, scaled: the state by its size, the parameter by its range.
#[derive(Clone)]
struct Scales {
    state: f64,
    parameter: f64,
}

/// Follows the branch from the orbit `first` to the ends of `options`; `go_on` receives each orbit
/// and returns whether to continue.
///
/// ```
/// use twofold_analyse::branch::{BranchOptions, Newton, ReturnMap, Trouble, closed_orbit, follow};
/// use twofold_analyse::floquet::Returned;
///
/// /// The return map of r' = r (p - r^2), phi' = 1 in the plane: an orbit of radius sqrt(p).
/// struct Circle;
/// impl ReturnMap for Circle {
///     fn states(&self) -> usize {
///         2
///     }
///     fn axis(&self) -> usize {
///         1
///     }
///     fn returned(&self, u: &[f64], p: f64, _: bool) -> Result<Returned, Trouble> {
///         let turn = 2.0 * std::f64::consts::PI;
///         let decay = (-2.0 * p * turn).exp();
///         let r2 = p * u[0] * u[0] / (u[0] * u[0] + (p - u[0] * u[0]) * decay);
///         let slope = decay * (r2.sqrt() / u[0]).powi(3);
///         Ok(Returned {
///             point: vec![r2.sqrt(), 0.0],
///             time: turn,
///             derivative: vec![slope, 0.0, 0.0, 0.0],
///             same: vec![vec![r2.sqrt(), 0.0]],
///             opposite: Vec::new(),
///             extent: 2.0 * u[0],
///             sizes: vec![2.0 * u[0]; 2],
///             passes: true,
///             derivative_error: 0.0,
///             events: 0,
///         })
///     }
/// }
/// let newton = Newton { closed: 1e-10, atol: 1e-12, rtol: 1e-12, iterations: 20 };
/// let first = closed_orbit(&Circle, &[1.1, 0.0], 1.0, newton).expect("an orbit");
/// let options = BranchOptions { from: 1.0, to: 4.0, longest: 0.1, most: 100, size: 0.0, newton };
/// let branch = follow(&Circle, first, &options, &mut |_| true);
/// let last = branch.orbits.last().expect("at least one");
/// assert!((last.point[0] - last.parameter.sqrt()).abs() < 1e-8);
/// ```
pub fn follow(
    map: &dyn ReturnMap,
    first: Orbit,
    options: &BranchOptions,
    go_on: &mut dyn FnMut(&Orbit) -> bool,
) -> Branch {
    let scales = Scales {
        state: first.extent.max(options.size),
        parameter: (options.to - options.from).abs(),
    };
    let points = map.has_points();
    // Of a flat return a fold is narrow beside the size of the state.
    let shortest = SHORTEST * options.longest * if points { NARROW } else { 1.0 };
    // The last member whose multipliers are told from one on the unit circle.
    let mut told = first.clone();
    let towards = (options.to - options.from).signum();
    let mut branch = Branch { orbits: vec![first], bifurcations: Vec::new(), end: End::Enough };
    let mut step = 0.25 * options.longest;
    // The first direction: along the parameter.
    let mut direction: Option<(Vec<f64>, f64)> = None;
    while branch.orbits.len() < options.most {
        let last = &branch.orbits[branch.orbits.len() - 1];
        let n = last.point.len();
        let (du, dp) = direction.clone().unwrap_or((vec![0.0; n], towards));
        // An orbit that shrinks to a point is not stepped over: behind it the same orbits come
        // again, seen from their other side.
        let way = scales.state * sqrt(du.iter().map(|d| d * d).sum());
        if step * way > REACH * last.extent && !points {
            step = REACH * last.extent / way;
        }
        let guess: Vec<f64> =
            last.point.iter().zip(&du).map(|(u, d)| u + step * scales.state * d).collect();
        let p = last.parameter + step * scales.parameter * dp;
        let beyond = (p - options.to) * towards >= 0.0;
        let behind = (p - options.from) * towards < 0.0;
        let next = if beyond {
            // On the range's end exactly.
            let share = (options.to - last.parameter) / (p - last.parameter);
            let guess: Vec<f64> =
                last.point.iter().zip(&guess).map(|(a, b)| a + share * (b - a)).collect();
            closed_orbit(map, &guess, options.to, options.newton)
        } else {
            arclength(map, &guess, p, (&du, dp), &scales, options.newton)
        };
        let widest = branch.orbits.iter().map(|o| o.extent).fold(0.0, f64::max);
        let shrinks = |next: &Orbit| {
            next.extent <= VANISHING * widest
                && !(last.fills && next.fills && next.extent > GONE * widest)
                && !is_loop(map, next)
        };
        let next = match next {
            Ok(next) if !points && shrinks(&next) => {
                let said = "the orbit shrinks to a point".to_owned();
                Err(Trouble { obstacle: Obstacle::Point(next.point), said })
            }
            // Farther from the guess than the step is long another branch may be.
            Ok(next)
                if points
                    && !beyond
                    && apart(&next.point, &guess, scales.state) > step
                    && 0.5 * step >= shortest =>
            {
                Err("too long a step".into())
            }
            // So near to a border that a less accurate return has other events.
            Ok(next) if points && 2.0 * next.largest_error() > next.largest_modulus().max(1.0) => {
                Err("the multipliers are not known: events are about to change".into())
            }
            Ok(next)
                if !beyond
                    && (next.iterations > MANY
                        || jumps(last, &next)
                        || next.events != last.events)
                    && 0.5 * step >= shortest =>
            {
                Err("too long a step".into())
            }
            other => other,
        };
        let next = match next {
            Ok(next) => next,
            Err(trouble) => {
                step *= 0.5;
                if step < shortest {
                    let border = (points && trouble.obstacle == Obstacle::Other)
                        .then(|| border(map, &branch.orbits, (&du, dp), &scales, shortest))
                        .flatten();
                    let beside = border.as_ref().map_or(&last.point, |border| &border.point);
                    if (border.is_some() || trouble.obstacle == Obstacle::Grazing)
                        && let Some((next, hop)) =
                            behind_grazing(map, last, beside, (&du, dp), &scales, options)
                    {
                        if let Some(Border { change, .. }) = border {
                            // It goes on from the border, to one of its sides, along the parameter.
                            let side = (next.parameter - change.parameter).signum();
                            direction = Some((vec![0.0; n], side));
                            let change =
                                Bifurcation { change: Change::DiscontinuityInduced, ..change };
                            branch.bifurcations.push(change);
                            told = next.clone();
                        } else {
                            note(map, &mut branch, &mut told, &next, &scales, options.newton);
                        }
                        let stop = !go_on(&next);
                        branch.orbits.push(next);
                        step = hop;
                        if stop {
                            branch.end = End::Interrupted;
                            return branch;
                        }
                        continue;
                    }
                    let missed = 4.0 * step * scales.parameter;
                    if let Some(border) = border {
                        branch.bifurcations.push(border.change);
                        branch.end = End::Lost(border.said.into());
                        return branch;
                    }
                    finish(map, &mut branch, trouble, missed, &scales);
                    return branch;
                }
                continue;
            }
        };
        if next.extent <= GONE * widest && !points {
            let (missed, said) = (
                (next.parameter - last.parameter).abs(),
                "the orbit shrinks to a point".to_owned(),
            );
            let trouble = Trouble { obstacle: Obstacle::Point(next.point.clone()), said };
            go_on(&next);
            branch.orbits.push(next);
            finish(map, &mut branch, trouble, missed, &scales);
            return branch;
        }
        let (su, sp) = (
            next.point
                .iter()
                .zip(&last.point)
                .map(|(a, b)| (a - b) / scales.state)
                .collect::<Vec<f64>>(),
            (next.parameter - last.parameter) / scales.parameter,
        );
        let length = sqrt(su.iter().map(|s| s * s).sum::<f64>() + sp * sp);
        note(map, &mut branch, &mut told, &next, &scales, options.newton);
        if length > 0.0 {
            direction = Some((su.iter().map(|s| s / length).collect(), sp / length));
        }
        if next.iterations <= FEW {
            step = (1.5 * step).min(options.longest);
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

/// Notes what changes from the last member `told` to the next one of the branch, if it is told.
fn note(
    map: &dyn ReturnMap,
    branch: &mut Branch,
    told: &mut Orbit,
    next: &Orbit,
    scales: &Scales,
    newton: Newton,
) {
    let last = &branch.orbits[branch.orbits.len() - 1];
    let others = last.events != next.events;
    // One on the unit circle that was not there before is about to pass it, or will not. What
    // others have done is said.
    if !others && on_circle(next) > on_circle(told) && alike(told, next) {
        return;
    }
    let mut found = changes(map, if others { last } else { told }, next, scales, newton);
    if let [.., before, _] = &branch.orbits[..]
        && found.is_empty()
    {
        found.extend(turning(map, [before, last, next], scales, newton));
    }
    branch.bifurcations.extend(found);
    *told = next.clone();
}

/// Whether a small orbit is one, and not the rest within: the rest is a zero of P(u) - u too, and
/// on a branch through a plane on which the rests lie the next one. What the orbit's point may be
/// off by, the residual and the error of the return over the distance of a multiplier from 1, is
/// small beside the orbit. Orbits that fill a surface, with a multiplier 1 each, are not asked.
fn is_loop(map: &dyn ReturnMap, orbit: &Orbit) -> bool {
    let (u, p) = (&orbit.point, orbit.parameter);
    let (Ok(fine), Ok(rough)) = (map.returned(u, p, false), map.roughly(u, p)) else {
        return false;
    };
    let apart: Vec<f64> = fine.point.iter().zip(&rough.point).map(|(a, b)| a - b).collect();
    let error = sized(&apart, &fine);
    orbit.residual + error < TOLD * from_one(&orbit.multipliers) * orbit.extent
}

/// Steps over a grazing are at most so many shortest steps.
const HOP: f64 = 64.0;

/// The branch's next orbit, with the step to it, where the last lies so near to a grazing that its
/// return map has no derivative: one with other events, behind the grazing, that is not farther
/// from the guess than the step is long. None if there the branch ends. Behind the grazing of a map
/// they stay near its border, so that Newton's method begins `beside` it.
fn behind_grazing(
    map: &dyn ReturnMap,
    last: &Orbit,
    beside: &[f64],
    (du, dp): (&[f64], f64),
    scales: &Scales,
    options: &BranchOptions,
) -> Option<(Orbit, f64)> {
    let shortest = SHORTEST * options.longest;
    let hops = std::iter::successors(Some(2.0 * shortest), |s| Some(2.0 * s))
        .take_while(|s| *s <= HOP * shortest);
    for hop in hops {
        let guess: Vec<f64> =
            last.point.iter().zip(du).map(|(u, d)| u + hop * scales.state * d).collect();
        let p = last.parameter + hop * scales.parameter * dp;
        if (p - options.from) * (options.to - p) < 0.0 {
            continue;
        }
        let other = |next: &Orbit| {
            let off = (next.parameter - p) / scales.parameter;
            let apart = apart(&next.point, &guess, scales.state);
            next.events != last.events && sqrt(apart * apart + off * off) <= hop
        };
        let stays = || closed_orbit(map, beside, p, options.newton).ok().filter(other);
        // At a fold without a slope those with other events are on the side that it comes from,
        // and so far behind the border that the motion stays there.
        let turns = || {
            let near = |next: &Orbit| apart(&next.point, &last.point, scales.state) <= HOP * hop;
            let behind = |far: f64| -> Vec<f64> {
                beside.iter().zip(du).map(|(u, d)| u + far * hop * scales.state * d).collect()
            };
            [0.0, 4.0, 16.0].into_iter().find_map(|far| {
                let p = 2.0 * last.parameter - p;
                let back = closed_orbit(map, &behind(far), p, options.newton).ok();
                back.filter(|next| next.events != last.events && near(next))
            })
        };
        let along = arclength(map, &guess, p, (du, dp), scales, options.newton);
        if let Some(next) = along.ok().filter(other).or_else(stays).or_else(turns) {
            return Some((next, hop));
        }
    }
    None
}

/// The derivative of a return map grows by a factor of two where the distance to a grazing falls to
/// a quarter (Nordmark 1991), and hardly where events merely change their order.
const GROWS: f64 = 1.5;

/// A multiplier beyond this, with a border in reach, grows towards a grazing.
const STEEP: f64 = 100.0;

/// A border beyond which the return of a map has other events.
struct Border {
    change: Bifurcation,
    /// A reason to end there.
    said: &'static str,
    /// A point just beyond it.
    point: Vec<f64>,
}

/// The border to which a branch comes: a grazing, if the derivative grows without bound towards it.
fn border(
    map: &dyn ReturnMap,
    orbits: &[Orbit],
    (du, dp): (&[f64], f64),
    scales: &Scales,
    shortest: f64,
) -> Option<Border> {
    let last = &orbits[orbits.len() - 1];
    let point = |way: f64| -> Vec<f64> {
        last.point.iter().zip(du).map(|(u, d)| u + way * scales.state * d).collect()
    };
    let returned = |way: f64| {
        map.returned(&point(way), last.parameter + way * scales.parameter * dp, true).ok()
    };
    let others = |way: f64| returned(way).is_some_and(|r| r.events != last.events);
    let hops = std::iter::successors(Some(2.0 * shortest), |s| Some(2.0 * s));
    let reach = HOP * shortest.max(DELTA);
    let hop = hops.take_while(|hop| *hop <= reach).find(|hop| others(*hop))?;
    let (mut near, mut far) = (0.0, hop);
    for _ in 0..40 {
        let middle = 0.5 * (near + far);
        if others(middle) {
            far = middle;
        } else {
            near = middle;
        }
    }
    let size = |way: f64| returned(way).map(|r| largest(&r.derivative));
    let grows = |side: f64| {
        let (close, off) = (size(far + side * hop), size(far + 4.0 * side * hop));
        close.zip(off).is_some_and(|(close, off)| close > GROWS * off)
    };
    let grazes = "the orbit comes to graze a surface, where its return has no derivative";
    // Where the orbits themselves come to graze the largest multiplier is inverse to the way.
    let before = orbits.iter().rev().find(|o| GROWS * o.largest_modulus() < last.largest_modulus());
    if let Some(before) = before.filter(|_| last.largest_modulus() > STEEP) {
        let (m, n) = (before.largest_modulus(), last.largest_modulus());
        let way = (last.parameter - before.parameter) * m / (n - m);
        let relative = last.largest_error() / n + before.largest_error() / m;
        let uncertainty = way.abs() * (relative + 1.0 / n) * n / (n - m);
        let parameter = last.parameter + way;
        let change = Bifurcation { change: Change::Grazing, parameter, uncertainty };
        return Some(Border { change, said: grazes, point: point(far) });
    }
    let (change, said) = if grows(1.0) || grows(-1.0) {
        (Change::Grazing, grazes)
    } else {
        (
            Change::DiscontinuityInduced,
            "the orbit comes to where its events change, and none that has the others is beyond",
        )
    };
    let parameter = last.parameter + far * scales.parameter * dp;
    let change = Bifurcation { change, parameter, uncertainty: hop * scales.parameter };
    Some(Border { change, said, point: point(far) })
}

/// Ends a branch where it cannot be followed.
fn finish(
    map: &dyn ReturnMap,
    branch: &mut Branch,
    trouble: Trouble,
    missed: f64,
    scales: &Scales,
) {
    let (change, end) = ended(map, &branch.orbits, trouble, missed);
    if let (End::Vanished, Some(last)) = (&end, &change) {
        // Orbits that shrink to a point have a multiplier 1: this is no change of its own.
        let near = |b: &Bifurcation| {
            (b.parameter - last.parameter).abs()
                <= b.uncertainty + last.uncertainty + 1e-6 * scales.parameter
        };
        branch
            .bifurcations
            .retain(|b| !(matches!(b.change, Change::Fold | Change::Branching) && near(b)));
    }
    branch.bifurcations.extend(change);
    branch.end = end;
}

/// An orbit of at most this share of the branch's largest extent is about to vanish, if there is
/// none beyond it.
const VANISHING: f64 = 0.1;

/// Passages of a plane in both directions that are so near to each other, as a share of the orbit,
/// are about to meet.
const TOUCHES: f64 = 0.1;

/// Whether an orbit hardly passes the plane any more.
fn touches_the_plane(orbit: &Orbit) -> bool {
    let near = |back: &Vec<f64>| {
        let square: f64 = back.iter().zip(&orbit.point).map(|(a, b)| (a - b) * (a - b)).sum();
        sqrt(square) < TOUCHES * orbit.extent
    };
    orbit.opposite.iter().any(near)
}

/// The change at which a branch cannot be followed, and its end; the next member was looked for
/// over `missed` of the parameter.
fn ended(
    map: &dyn ReturnMap,
    orbits: &[Orbit],
    trouble: Trouble,
    missed: f64,
) -> (Option<Bifurcation>, End) {
    let last = &orbits[orbits.len() - 1];
    let here =
        |change| Some(Bifurcation { change, parameter: last.parameter, uncertainty: missed });
    let largest = orbits.iter().map(|o| o.extent).fold(0.0, f64::max);
    let small = last.extent <= VANISHING * largest && !map.has_points();
    match trouble.obstacle {
        Obstacle::Grazing => (here(Change::Grazing), End::Lost(trouble.said)),
        Obstacle::SetValued => (here(Change::SetValued), End::Lost(trouble.said)),
        _ if small && !touches_the_plane(last) => {
            (Some(vanishing(map, orbits, missed)), End::Vanished)
        }
        obstacle if small || obstacle == Obstacle::Reversed => {
            let said =
                "the orbit comes to touch the plane and no longer passes it: choose another plane";
            (None, End::Lost(said.into()))
        }
        _ => (None, End::Lost(trouble.said)),
    }
}

/// The bifurcation that ends a branch of shrinking orbits: a Hopf point, if the rest within has a
/// pair of imaginary eigenvalues there, with the frequency of the orbits (Kuznetsov 2004, sec.
/// 3.4).
fn vanishing(map: &dyn ReturnMap, orbits: &[Orbit], missed: f64) -> Bifurcation {
    let last = &orbits[orbits.len() - 1];
    let before = orbits.iter().rev().find(|o| o.extent > 1.5 * last.extent).unwrap_or(last);
    // The extent grows like the root of the parameter's distance at a Hopf point, and in proportion
    // to it where fields are discontinuous: the one end is a little nearer than the other.
    let ratio = last.extent / before.extent;
    let way =
        if ratio < 1.0 { (last.parameter - before.parameter) * ratio / (1.0 - ratio) } else { 0.0 };
    let frequency = std::f64::consts::TAU / last.period;
    let pair = |p: f64| -> Option<[f64; 2]> {
        let (_, eigenvalues) = map.rest(&last.point, p)?;
        let oscillating = eigenvalues.into_iter().filter(|l| l[1] > 0.0);
        oscillating.min_by(|a, b| (a[1] - frequency).abs().total_cmp(&(b[1] - frequency).abs()))
    };
    let reach = 2.0 * way.abs() + missed;
    let hopf = || {
        let (mut a, mut b) = (
            last.parameter,
            last.parameter + if way == 0.0 { missed } else { reach.copysign(way) },
        );
        let (mut ga, mut gb) = (pair(a)?, pair(b)?);
        // The secant method: the real part is smooth in the parameter.
        for _ in 0..ITERATIONS {
            if ga[0] == gb[0] {
                break;
            }
            (a, b) = (b, b - gb[0] * (b - a) / (gb[0] - ga[0]));
            (ga, gb) = (gb, pair(b)?);
            if gb[0].abs() <= 1e-13 * gb[1] {
                break;
            }
        }
        let small = gb[0].abs() <= 1e-9 * gb[1];
        let near = (b - last.parameter).abs() <= 4.0 * reach
            && (gb[1] - frequency).abs() <= 0.1 * frequency;
        let slope = (ga[0] - gb[0]) / (a - b);
        let rounding =
            if slope.is_finite() && slope != 0.0 { 1e-12 * gb[1] / slope.abs() } else { 0.0 };
        let off = if slope.is_finite() && slope != 0.0 {
            gb[0].abs() / slope.abs()
        } else {
            (b - a).abs()
        };
        let uncertainty = off + rounding + 1e-14 * b.abs();
        (small && near).then_some(Bifurcation { change: Change::Hopf, parameter: b, uncertainty })
    };
    hopf().unwrap_or(Bifurcation {
        change: Change::Vanishing,
        parameter: last.parameter + 0.5 * way,
        uncertainty: way.abs() + missed,
    })
}

/// The distance of two states in this unit.
fn apart(a: &[f64], b: &[f64], unit: f64) -> f64 {
    sqrt(a.iter().zip(b).map(|(a, b)| (a - b) / unit).map(|d| d * d).sum())
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
) -> Result<Orbit, Trouble> {
    let (n, axis) = (map.states(), map.axis());
    let (mut u, mut q, mut before) = (guess.to_vec(), p, f64::INFINITY);
    // The iterations after which the orbit was closed.
    let mut needed = None;
    for iterations in 0..=newton.iterations {
        let r = map.returned(&u, q, true)?;
        let difference: Vec<f64> = r.point.iter().zip(&u).map(|(a, b)| a - b).collect();
        let residual = sized(&difference, &r);
        let along: f64 = (0..n).map(|i| du[i] * (u[i] - guess[i]) / scales.state).sum::<f64>()
            + dp * (q - p) / scales.parameter;
        let done = settled(residual, before, newton.closed(map, &u, &r)?) && along.abs() < 1e-6;
        // With a multiplier near 1 a small residual may still be far from an orbit, as all of a
        // map's points behind a fold are: Newton's method goes on as long as it helps.
        let near_one = |m: &[f64; 2]| distance(*m, [1.0, 0.0]) < NEAR_ONE;
        let helps = residual > 0.0 && residual < 0.5 * before;
        let goes_on =
            map.has_points() || done && multipliers_of(&r.derivative, n, axis).iter().any(near_one);
        if done && map.has_points() {
            needed = needed.or(Some(iterations));
        }
        let ends = done && !(helps && goes_on);
        if ends && !(map.has_points() && misses(map, &u, q, &r, residual)) {
            return orbit(map, u, q, r, residual, needed.unwrap_or(iterations));
        }
        before = residual;
        // The derivative in the parameter by differences; its error only slows Newton's method
        // down.
        let delta = DELTA * scales.parameter;
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
        let rounding = SINGULAR * largest(&matrix);
        let step = solve_any(&matrix, &right, rounding)
            .or_else(|| solve_some(&matrix, &right, rounding))
            .ok_or(if map.has_points() {
                "the branch's direction is not determined: branches meet here, or an event passes \
                    the moment at which periods are counted (give another --t-start)"
            } else {
                "branches meet here: the branch's direction is not determined"
            })?;
        u.iter_mut()
            .zip(&step)
            .enumerate()
            .filter(|(i, _)| *i != axis)
            .for_each(|(_, (x, s))| *x += s);
        q += step[n] * scales.parameter;
    }
    Err("Newton's method did not converge along the branch".into())
}

#[cfg(test)]
mod tests;
