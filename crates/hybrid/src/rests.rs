//! Rests: states that do not move, in the fields and on switching surfaces.
//!
//! An equilibrium is a zero of a field on its own side of all switching functions. A
//! *pseudo-equilibrium* is a zero of the sliding field: a point of one surface, or of several at
//! once, where a mixture of the fields around it vanishes (Filippov 1988, sec. 17; Kuznetsov,
//! Rinaldi & Gragnani 2003). On several surfaces the weights are products, one factor a surface
//! (Alexander & Seidman 1998). Newton's method looks for both from many places of a box. It takes
//! the least step where the equations leave a direction open; rests that fill a curve, such as a
//! block that sticks within friction, are followed to both ends.

mod sides;

use twofold_num::elementary::sqrt;
use twofold_num::linear::{eigenvalues, solve_any};
use twofold_num::{Arithmetic, Dual};
use twofold_system::Expression;

use crate::definition::{Direction, Event, When};
use crate::equation::{Configuration, Equation, EquationError};
use crate::model::Model;
use crate::motion::determinant_of_negative;
use crate::motion::tangent::apart;
use crate::range::Range;
use sides::Linear;

/// A switching surface on which a rest lies.
#[derive(Clone, Debug, PartialEq)]
pub struct On {
    /// The switching function's text.
    pub surface: String,
    /// The weight of the fields on its positive side.
    pub weight: f64,
}

/// Rests that are not isolated.
#[derive(Clone, Debug, PartialEq)]
pub struct Family {
    /// The dimension of the set of rests.
    pub dimension: usize,
    /// The two ends of a curve, in the box; nothing if it closes or its dimension is not 1.
    pub ends: Option<[Vec<f64>; 2]>,
    /// Whether stability is another in different parts of a curve.
    pub changes: bool,
    /// Whether motion that begins beyond an end goes on along the curve's direction, away from it.
    pub leaves: bool,
    /// Points of the curve, in order.
    points: Vec<Vec<f64>>,
}

/// A state that does not move.
#[derive(Clone, Debug, PartialEq)]
pub struct Rest {
    /// The state; of a curve one in the middle, of a set of more dimensions any.
    pub x: Vec<f64>,
    /// The mode's number.
    pub mode: usize,
    /// The switching surfaces on which it lies; none in a field.
    pub on: Vec<On>,
    /// Whether motion near by comes to all of these surfaces, however fast each of them switches;
    /// nothing where that decides, or where the fields there leave it open.
    pub attracting: Option<bool>,
    /// Whether the fields are tangent to a surface there, as at a two-fold or a fused focus: the
    /// motion along it is not determined near the rest, and has no eigenvalues.
    pub tangent: bool,
    /// The set of rests to which it belongs, if it is not isolated.
    pub family: Option<Family>,
    /// Eigenvalues of the linearised motion, on surfaces along them: real and imaginary parts, by
    /// falling real part.
    pub eigenvalues: Vec<[f64; 2]>,
    /// By how much an eigenvalue may be off, the state being known to 1e-9 of the box: at a double
    /// root none has a sign.
    pub blur: f64,
    /// A further switching function that is zero there: the equations change, and eigenvalues are
    /// those of one side.
    pub boundary: Option<String>,
    /// An event behind whose surface it lies: motion that comes from the other side is changed
    /// before. Only a start behind it comes to the rest.
    pub behind: Option<String>,
    /// An event of the clock (`every`) that moves it: the field vanishes there, but nothing stays.
    pub moved: Option<String>,
}

impl Rest {
    /// "stable node", "saddle", ... from the eigenvalues; of a pseudo-equilibrium with those of the
    /// motion to its surface, "stable pseudo-node" or, where one of them leads to it and the other
    /// away, "pseudo-saddle" (Kuznetsov, Rinaldi & Gragnani 2003). Of a curve of rests
    /// what they are all along it, of a larger set what this one is.
    pub fn kind(&self) -> String {
        if let Some(event) = &self.moved {
            return format!("no rest of the whole motion: {event} moves it again and again");
        }
        if self.family.as_ref().is_some_and(|f| f.changes) {
            return "stability changes along the curve".into();
        }
        if self.tangent {
            return "not decided by the linearised motion: the fields are tangent there".into();
        }
        if let Some(surface) = &self.boundary {
            return format!(
                "boundary equilibrium: the equations change on {surface} = 0, and one side does \
                    not decide"
            );
        }
        // Along a set of rests nothing moves: as many eigenvalues are zero.
        let along = self.family.as_ref().map_or(0, |f| f.dimension);
        let modulus = |e: &[f64; 2]| e[0] * e[0] + e[1] * e[1];
        let mut values = self.eigenvalues.clone();
        values.sort_by(|a, b| modulus(a).total_cmp(&modulus(b)));
        let values = &values[along.min(values.len())..];
        let size = values.iter().map(|e| e[0].abs().max(e[1].abs())).fold(0.0, f64::max);
        let zero = (1e-9 * size).max(self.blur);
        let turns = values.iter().any(|e| e[1].abs() > zero);
        let (out, into) = (values.iter().any(|e| e[0] > zero), values.iter().any(|e| e[0] < -zero));
        let neutral = values.iter().any(|e| e[0].abs() <= zero);
        let shape = if turns { "focus" } else { "node" };
        let [attracts, repels, open] =
            [Some(true), Some(false), None].map(|a| !self.on.is_empty() && self.attracting == a);
        let pseudo = if self.on.is_empty() { "" } else { "pseudo-" };
        match (out, into) {
            _ if along > 0 => match (out, neutral || open) {
                _ if repels => "unstable: neighbours leave the set",
                (true, _) => "unstable: neighbours leave the set",
                (false, true) => "not decided by the linearised motion",
                _ if self.family.as_ref().is_some_and(|f| f.leaves) => {
                    "stable but for an end, at which neighbours leave the set"
                }
                (false, false) => "stable: neighbours come to the set",
            }
            .into(),
            (true, _) if open => "unstable".into(),
            _ if open => "not decided by the fields there".into(),
            _ if values.is_empty() => if repels { "unstable" } else { "stable" }.into(),
            (true, true) => format!("{pseudo}saddle"),
            (false, _) if neutral => "not decided by the linearised motion".into(),
            (true, false) if attracts => "pseudo-saddle".into(),
            (true, false) if neutral => "unstable".into(),
            (true, false) => format!("unstable {pseudo}{shape}"),
            _ if repels => "pseudo-saddle".into(),
            _ => format!("stable {pseudo}{shape}"),
        }
    }
}

/// Rests, and what was not looked at.
#[derive(Clone, Debug, PartialEq)]
pub struct Found {
    /// The rests, by the smallest coordinates first.
    pub rests: Vec<Rest>,
    /// Limits that the search met: there may be more rests.
    pub limits: Vec<Limit>,
}

/// A limit that a search for rests met.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Limit {
    /// Starts led to new rests to the end.
    Starts {
        /// Number of starts.
        count: usize,
    },
    /// Not all combinations of sides were tried.
    Sides {
        /// Number of switching functions.
        functions: usize,
        /// Number of combinations.
        tried: usize,
    },
    /// Not all sets of so many surfaces, or of more, were looked at.
    Surfaces {
        /// Number of surfaces in a set.
        together: usize,
    },
    /// Not all surfaces of a whole part were looked at.
    Levels {
        /// The expression whose whole part is asked for.
        of: String,
    },
}

impl std::fmt::Display for Limit {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Starts { count } => write!(
                f,
                "new rests were found up to the last of {count} starts: there may be more"
            ),
            Self::Sides { functions, tried } => write!(
                f,
                "{tried} combinations of the sides of {functions} switching functions were tried, \
                    but the box has more: there may be more rests"
            ),
            Self::Surfaces { together } => write!(
                f,
                "not all points of {together} or more switching surfaces at once were looked at"
            ),
            Self::Levels { of } => write!(
                f,
                "of the whole part of {of} the {MOST_LEVELS} switching surfaces in the middle of \
                    the box were looked at"
            ),
        }
    }
}

/// Why no rests are looked for.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum RestError {
    /// The equations are not complete.
    #[error(transparent)]
    Equation(#[from] EquationError),
    /// The equations depend on the time.
    #[error("the equations depend on the time, and nothing rests: follow a run (twofold run)")]
    Driven,
    /// A box that is none.
    #[error("{0}")]
    Box(String),
}

/// Part of the box's width by which a state on its face may seem to be outside.
const ON_A_FACE: f64 = 1e-12;
/// Part of the box's width to which a state is taken to be known where its stability is judged.
const KNOWN_TO: f64 = 1e-9;
/// Zeros of a field nearer to each other, in widths of the box, may be one of higher order.
const INDISTINCT: f64 = 1e-4;
/// Starts of Newton's method in a field and on each surface.
const STARTS: usize = 400;
/// There are more until this many times as many as led to the last new rest.
const WITHOUT_NEWS: usize = 4;
/// At most.
const MOST_STARTS: usize = 40_000;
/// Sets of several surfaces share as many; each has so many at least.
const LEAST_STARTS: usize = 20;
/// Starts with each set of answers that no other start has.
const FEW_STARTS: usize = 4;
/// Sets of answers that are tried in a field, and together on all sets of surfaces of one size.
const MOST_ANSWERS: usize = 4096;
/// On each set of surfaces so many at least: all of six functions.
const LEAST_ANSWERS: usize = 64;
const MOST_ITERATIONS: usize = 60;
/// Where steps still become shorter, as they do at a zero of higher order.
const MANY_ITERATIONS: usize = 400;
/// Surfaces on which a rest can lie at once.
const MOST_TOGETHER: usize = 4;
/// Larger sets of surfaces are not looked at if there are more of one size than this.
const MOST_SETS: usize = 256;
/// Sets of surfaces that are listed before those without a common point are left out.
const MOST_LISTED: usize = 4096;
/// Surfaces of one whole part, those nearest to the middle of its values in the box.
const MOST_LEVELS: usize = 128;
/// Places between two rests from which a third is looked for, in shares of the way.
const BETWEEN: [f64; 3] = [0.5, 0.25, 0.75];
/// Between more rests than these none are looked for.
const MOST_PAIRED: usize = 24;

/// The rests of a system in a box, by the smallest coordinates first.
///
/// # Errors
/// If the equations are not complete or depend on the time, or the box is none.
///
/// ```
/// use twofold_hybrid::{Definition, Model, rests::rests};
/// // A cubic's zeros, and sliding to a pseudo-equilibrium where both fields cancel.
/// let cubic = Model::new(Definition::from_toml("states = ['x']\nf = ['x - x^3']", "f")?);
/// let found: Vec<f64> = rests(&cubic, &[(-3.0, 3.0)])?.iter().map(|r| r.x[0]).collect();
/// assert!(found.iter().zip([-1.0, 0.0, 1.0]).all(|(a, b)| (a - b).abs() < 1e-12));
/// let relay = Model::new(Definition::from_toml("states = ['x']\nf = ['0.5 - sign(x)']", "f")?);
/// let rest = &rests(&relay, &[(-1.0, 1.0)])?[0];
/// assert!(rest.attracting == Some(true) && (rest.on[0].weight - 0.75).abs() < 1e-12);
/// // A block that dry friction holds: x from -1/2 to 1/2.
/// let text = "states = ['x', 'v']\nf = ['v', '-x - 0.5*sign(v)']";
/// let block = Model::new(Definition::from_toml(text, "f")?);
/// let stuck = rests(&block, &[(-3.0, 3.0), (-1.0, 1.0)])?[0].family.clone().unwrap();
/// let [from, to] = stuck.ends.unwrap();
/// assert!((from[0] + 0.5).abs() < 1e-9 && (to[0] - 0.5).abs() < 1e-9);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn rests(model: &Model, within: &[(f64, f64)]) -> Result<Vec<Rest>, RestError> {
    Ok(find(model, within)?.rests)
}

/// The rests of a system in a box, and what was not looked at.
///
/// # Errors
/// As [`rests`].
///
/// ```
/// use twofold_hybrid::{Definition, Model, rests::find};
/// let model = Model::new(Definition::from_toml("states = ['x']\nf = ['x - x^3']", "f")?);
/// let found = find(&model, &[(-3.0, 3.0)])?;
/// assert!(found.rests.len() == 3 && found.limits.is_empty());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn find(model: &Model, within: &[(f64, f64)]) -> Result<Found, RestError> {
    let equation = Equation::new(model, None)?;
    let n = equation.dimension();
    if within.len() != n || !within.iter().all(|(a, b)| a.is_finite() && b.is_finite() && a < b) {
        return Err(RestError::Box(format!(
            "the box is {within:?}: give a lower and a greater upper bound for each of {n} states"
        )));
    }
    if equation.depends_on_time() {
        return Err(RestError::Driven);
    }
    let widths = within.iter().map(|(a, b)| b - a).collect();
    let mut search =
        Search { equation, n, widths, within, constant: Vec::new(), linear: Vec::new() };
    let places: Vec<Vec<f64>> = (0..STARTS).map(|start| search.place(start)).collect();
    let value = |e: &Expression, x: &Vec<f64>| search.equation.value(e, 0.0, x);
    let guards = search.equation.guards.iter().map(|guard| &guard.expression);
    search.constant =
        guards.map(|e| places.iter().all(|x| value(e, x) == value(e, &places[0]))).collect();
    let bound = |guard: &crate::equation::Guard| {
        if guard.whole { None } else { Linear::of(&search.equation, &guard.expression, within) }
    };
    search.linear = search.equation.guards.iter().map(bound).collect();
    let mut found: Vec<Rest> = Vec::new();
    let mut limits: Vec<Limit> = Vec::new();
    // One of each kind is said, the first.
    let mut meet = |limit: Limit| {
        let kind = std::mem::discriminant(&limit);
        if limits.iter().all(|known| std::mem::discriminant(known) != kind) {
            limits.push(limit);
        }
    };
    for mode in 0..model.definition().modes().len() {
        let configs: Vec<Configuration> =
            places.iter().map(|x| search.configuration(mode, x)).collect();
        let surfaces = search.surfaces(&configs, &mut meet);
        // The equations are continuous on a kink: no mixture of the fields beside it is another.
        let jumps: Vec<Surface> =
            surfaces.iter().filter(|s| !search.equation.guards[s.guard].kink).copied().collect();
        for together in 0..=MOST_TOGETHER.min(search.n) {
            let mut sets = search.sets(&jumps, together);
            if sets.len() > MOST_SETS && together > 1 {
                meet(Limit::Surfaces { together });
                let single: Vec<Surface> =
                    jumps.iter().filter(|s| s.level.is_none()).copied().collect();
                sets = search.sets(&single, together);
                if sets.len() > MOST_SETS {
                    break;
                }
            }
            let starts = match together {
                0 => STARTS,
                1 if sets.len() <= MOST_SETS => {
                    (STARTS / search.most_levels(&surfaces)).max(LEAST_STARTS)
                }
                _ => (STARTS / sets.len().max(1)).max(LEAST_STARTS),
            };
            let most_answers = (MOST_ANSWERS / sets.len().max(1)).max(LEAST_ANSWERS);
            for on in &sets {
                let (mut number, mut last_new) = (0, 0);
                while number < starts.max(WITHOUT_NEWS * last_new) {
                    if number == MOST_STARTS {
                        meet(Limit::Starts { count: MOST_STARTS });
                        break;
                    }
                    let known = found.len();
                    match (places.get(number), configs.get(number)) {
                        (Some(x), Some(config)) => search.add(config, on, x, number, &mut found),
                        _ => {
                            let x = search.place(number);
                            let config = search.configuration(mode, &x);
                            search.add(&config, on, &x, number, &mut found);
                        }
                    }
                    number += 1;
                    if found.len() > known {
                        last_new = number;
                    }
                }
                let met = &configs[..starts.min(configs.len())];
                let answers = search.unmet(met, &places, &surfaces, (on, most_answers), &mut meet);
                for (number, (x, config)) in answers.into_iter().enumerate() {
                    search.add(&config, on, &x, number % (FEW_STARTS + 1), &mut found);
                }
                search.add_between(mode, on, &mut found);
            }
        }
    }
    // The edge of a set of rests is a zero of a field, or of a mixture on fewer surfaces, too.
    let families: Vec<Rest> = found.iter().filter(|r| r.family.is_some()).cloned().collect();
    found.retain(|r| {
        // A start may have come to a point of a curve before that was found.
        let is_point_of =
            |f: &Rest| f.mode == r.mode && same_surfaces(f, r) && search.passes(f, &r.x);
        if r.family.is_none() && families.iter().any(is_point_of) {
            return false;
        }
        let Some(boundary) = &r.boundary else { return true };
        let is_edge_of = |f: &Rest| {
            let on = |surface: &String| f.on.iter().any(|on| on.surface == *surface);
            let may_be = f.mode == r.mode && on(boundary) && r.on.iter().all(|r| on(&r.surface));
            may_be
                && f.family
                    .as_ref()
                    .is_some_and(|family| family.dimension > 1 || search.passes(f, &r.x))
        };
        !families.iter().any(is_edge_of)
    });
    found.sort_by(|a, b| {
        let by_state = a.x.iter().zip(&b.x).map(|(p, q)| p.total_cmp(q)).find(|o| o.is_ne());
        a.mode.cmp(&b.mode).then(by_state.unwrap_or(std::cmp::Ordering::Equal))
    });
    Ok(Found { rests: found, limits })
}

/// Where a switching function switches: at zero, or where its whole part becomes a number.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Surface {
    guard: usize,
    level: Option<f64>,
}

impl Surface {
    /// The switching function's answers below and above.
    fn sides(&self) -> [f64; 2] {
        self.level.map_or([-1.0, 1.0], |level| [level - 1.0, level])
    }

    fn is_of(surfaces: &[Self], guard: usize) -> bool {
        surfaces.iter().any(|s| s.guard == guard)
    }
}

/// Sets of `size` surfaces, each of another function.
fn distinct(of: &[Surface], size: usize) -> Vec<Vec<Surface>> {
    let Some((first, rest)) = of.split_first().filter(|_| size > 0) else {
        return if size == 0 { vec![Vec::new()] } else { Vec::new() };
    };
    let others: Vec<Surface> = rest.iter().filter(|s| s.guard != first.guard).copied().collect();
    let with = distinct(&others, size - 1).into_iter().map(|mut s| {
        s.insert(0, *first);
        s
    });
    with.chain(distinct(rest, size)).take(MOST_LISTED).collect()
}

/// Subsets of `size`.
fn subsets<T: Clone>(of: &[T], size: usize) -> Vec<Vec<T>> {
    match (size, of.split_first()) {
        (0, _) => vec![Vec::new()],
        (_, None) => Vec::new(),
        (_, Some((first, rest))) => {
            let with = subsets(rest, size - 1).into_iter().map(|mut s| {
                s.insert(0, first.clone());
                s
            });
            with.chain(subsets(rest, size)).collect()
        }
    }
}

const PRIMES: [usize; 12] = [2, 3, 5, 7, 11, 13, 17, 19, 23, 29, 31, 37];

/// Halton's sequence (1960): digits of `i` in base `base`, mirrored at the point.
fn radical_inverse(mut i: usize, base: usize) -> f64 {
    let (mut value, mut digit) = (0.0, 1.0 / base as f64);
    while i > 0 {
        value += (i % base) as f64 * digit;
        i /= base;
        digit /= base as f64;
    }
    value
}

struct Search<'a> {
    equation: Equation,
    n: usize,
    widths: Vec<f64>,
    within: &'a [(f64, f64)],
    /// Guards that have one value in the whole box, as those that a parameter makes zero: they are
    /// no surfaces.
    constant: Vec<bool>,
    /// A bound of each guard in the box.
    linear: Vec<Option<Linear>>,
}

/// A field with its Jacobian, row by row.
struct Local {
    field: Vec<f64>,
    jacobian: Vec<f64>,
}

/// The mixture of the fields around some surfaces, by weights: its value, its derivatives by the
/// states and by the weights (row by row), and the surfaces' functions and gradients.
struct Mixture {
    local: Local,
    by_weight: Vec<f64>,
    values: Vec<f64>,
    gradients: Vec<f64>,
    /// The largest size of each component in any of the fields.
    sizes: Vec<f64>,
}

/// A zero: the state, the weights, and the directions in which the equations do not fix them (the
/// state's part a unit vector in widths of the box).
struct Zero {
    x: Vec<f64>,
    weights: Vec<f64>,
    open: Vec<Vec<f64>>,
}

/// Rows that depend on the others to this share are taken for dependent, if a walk along the open
/// direction finds further zeros.
const DEPENDENT: f64 = 1e-8;
/// The same where no such walk does.
const ROUNDING: f64 = 1e-15;
/// Change of the state, in widths of the box, with a weight that goes from 0 to 1: rests on less
/// are one.
const SHORTEST: f64 = 1e-6;
/// Length of that walk in widths of the box, and of a step along a curve of rests.
const WALK: f64 = 1e-4;
const STRIDE: f64 = 0.02;
/// Points of a curve that are nearer to its end, in widths of the box, are that end.
const NEAR_AN_END: f64 = 1e-7;
/// A curve of rests is given up after so many steps to each side.
const MOST_STRIDES: usize = 2000;

impl Search<'_> {
    fn near(&self, a: &[f64], b: &[f64]) -> bool {
        a.iter().zip(b).zip(&self.widths).all(|((a, b), w)| (a - b).abs() <= 1e-7 * w)
    }

    /// Whether a state is in the box, or beyond its face by no more than rounding: populations and
    /// amounts rest on the face zero.
    fn is_inside(&self, x: &[f64]) -> bool {
        let is_in = |(v, ((a, b), w)): (&f64, (&(f64, f64), &f64))| {
            (a - ON_A_FACE * w..=b + ON_A_FACE * w).contains(v)
        };
        x.iter().zip(self.within.iter().zip(&self.widths)).all(is_in)
    }

    /// A place of the box to start from: the middle, then Halton's points.
    fn place(&self, start: usize) -> Vec<f64> {
        let share = |i: usize| {
            if start == 0 { 0.5 } else { radical_inverse(start, PRIMES[i % PRIMES.len()]) }
        };
        self.within.iter().enumerate().map(|(i, (a, b))| a + (b - a) * share(i)).collect()
    }

    /// The surfaces that equations with these answers ask.
    fn surfaces(&self, configs: &[Configuration], meet: &mut dyn FnMut(Limit)) -> Vec<Surface> {
        let guards = &self.equation.guards;
        let mut ends = vec![None; guards.len()];
        for config in configs {
            let active = &self.equation.compiled(config).active;
            for guard in active.iter().filter(|guard| !self.constant[**guard]) {
                let side = config.sides[*guard];
                let (low, high) = ends[*guard].unwrap_or((side, side));
                ends[*guard] = Some((side.min(low), side.max(high)));
            }
        }
        let mut of = |(guard, ends): (usize, Option<(f64, f64)>)| -> Vec<Surface> {
            match ends {
                None => Vec::new(),
                Some(_) if !guards[guard].whole => vec![Surface { guard, level: None }],
                Some((low, high)) => {
                    // Surfaces at the box's edges may have no place behind them.
                    let spare = (0.5 * (high + 2.0 - low - MOST_LEVELS as f64)).max(0.0).floor();
                    if spare > 0.0 {
                        meet(Limit::Levels { of: guards[guard].expression.to_string() });
                    }
                    let first = low + spare;
                    let count = (high + 2.0 - low - 2.0 * spare).min(MOST_LEVELS as f64) as usize;
                    let levels = (0..count).map(|k| Some(first + k as f64));
                    levels.map(|level| Surface { guard, level }).collect()
                }
            }
        };
        ends.into_iter().enumerate().flat_map(&mut of).collect()
    }

    /// The bounds of surfaces in the box.
    fn linear(&self, on: &[Surface]) -> Vec<Option<Linear>> {
        let bound = |s: &Surface| self.linear[s.guard].clone().filter(|_| s.level.is_none());
        on.iter().map(bound).collect()
    }

    /// Sets of so many surfaces that may have a common point in the box.
    fn sets(&self, of: &[Surface], together: usize) -> Vec<Vec<Surface>> {
        let mut sets = distinct(of, together);
        sets.retain(|on| sides::meet(&self.linear(on), self.within));
        sets
    }

    /// Answers of the functions that switch at zero, but for those in `on`, that few places have
    /// met: the part of the box that they hold in may be small. Each with places to start from.
    fn unmet(
        &self,
        met: &[Configuration],
        places: &[Vec<f64>],
        surfaces: &[Surface],
        (on, most): (&[Surface], usize),
        meet: &mut dyn FnMut(Limit),
    ) -> Vec<(Vec<f64>, Configuration)> {
        let guards: Vec<usize> = surfaces
            .iter()
            .filter(|s| s.level.is_none() && !on.contains(s))
            .map(|s| s.guard)
            .collect();
        let Some(mode) = met.first().map(|config| config.mode) else { return Vec::new() };
        if guards.is_empty() {
            return Vec::new();
        }
        let functions: Vec<Option<Linear>> =
            guards.iter().map(|guard| self.linear[*guard].clone()).collect();
        let patterns = sides::patterns(&functions, &self.linear(on), self.within, most);
        if patterns.more {
            meet(Limit::Sides { functions: guards.len(), tried: most });
        }
        let mut starts = Vec::new();
        for (sides, place) in patterns.found {
            let answered = |config: &Configuration| {
                let mut config = config.clone();
                guards.iter().zip(&sides).for_each(|(guard, side)| config.sides[*guard] = *side);
                config
            };
            if met.iter().filter(|config| answered(config) == **config).count() < FEW_STARTS {
                let config = answered(&self.configuration(mode, &place));
                starts.push((place, config));
                let others = places.iter().zip(met).take(FEW_STARTS);
                starts.extend(others.map(|(x, config)| (x.clone(), answered(config))));
            }
        }
        starts
    }

    /// The number of surfaces of the switching function that has most.
    fn most_levels(&self, surfaces: &[Surface]) -> usize {
        let of = |guard: usize| surfaces.iter().filter(|s| s.guard == guard).count();
        (0..self.equation.guards.len()).map(of).max().unwrap_or(0).max(1)
    }

    /// A surface's function as it is shown: zero there.
    fn name(&self, surface: &Surface) -> String {
        let expression = self.equation.guards[surface.guard].expression.to_string();
        match surface.level {
            Some(level) if level > 0.0 => format!("{expression} - {level}"),
            Some(level) if level < 0.0 => format!("{expression} + {}", -level),
            _ => expression,
        }
    }

    /// Looks between all pairs of isolated rests on some surfaces: of three beside each other few
    /// starts lead to the one in the middle.
    fn add_between(&self, mode: usize, on: &[Surface], found: &mut Vec<Rest>) {
        let names: Vec<String> = on.iter().map(|s| self.name(s)).collect();
        let isolated = |r: &&Rest| {
            r.family.is_none() && r.mode == mode && r.on.iter().map(|on| &on.surface).eq(&names)
        };
        let mut looked = 0;
        loop {
            let known: Vec<Vec<f64>> = found.iter().filter(isolated).map(|r| r.x.clone()).collect();
            if known.len() == looked || known.len() > MOST_PAIRED {
                return;
            }
            for (i, a) in known.iter().enumerate().skip(looked) {
                for b in &known[..i] {
                    for (number, share) in BETWEEN.into_iter().enumerate() {
                        let place: Vec<f64> =
                            a.iter().zip(b).map(|(a, b)| a + share * (b - a)).collect();
                        let config = self.configuration(mode, &place);
                        self.add(&config, on, &place, number, found);
                    }
                }
            }
            looked = known.len();
        }
    }

    /// Adds the rest that Newton's method comes to, if it is one and new. It begins with equal
    /// weights; where the equations do not fix their next step there, as where opposite fields
    /// cancel, with others, one for each start.
    fn add(
        &self,
        config: &Configuration,
        on: &[Surface],
        start: &[f64],
        number: usize,
        found: &mut Vec<Rest>,
    ) {
        let middle = vec![0.5; on.len()];
        let other = |i: usize| radical_inverse(number + 1, PRIMES[(self.n + i) % PRIMES.len()]);
        let settled = self.settle(config, on, start, &middle, DEPENDENT).or_else(|| {
            let weights: Vec<f64> = (0..on.len()).map(other).collect();
            if on.is_empty() { None } else { self.settle(config, on, start, &weights, DEPENDENT) }
        });
        let Some(mut zero) = settled else { return };
        if !self.is_valid(config, on, &zero) || self.is_known(config, on, &zero.x, 0, found) {
            return;
        }
        let continues = |zero: &Zero, direction: &[f64]| {
            [WALK, -WALK].iter().any(|by| {
                let (aim, weights) = self.moved(zero, direction, *by);
                let there = self.settle(config, on, &aim, &weights, DEPENDENT);
                there.is_some_and(|there| self.distance(&there.x, &aim) <= 0.1 * WALK)
            })
        };
        let (along, spurious): (Vec<_>, Vec<_>) =
            zero.open.clone().into_iter().partition(|d| continues(&zero, d));
        let dimension = along.len();
        // Curves that cross are no set of more dimensions: between two of them there are no rests.
        let fills = |zero: &Zero| {
            let pairs = (0..dimension).flat_map(|i| (0..i).map(move |j| (i, j)));
            pairs.into_iter().all(|(i, j)| {
                let half = std::f64::consts::FRAC_1_SQRT_2;
                let between = along[i].iter().zip(&along[j]);
                continues(zero, &between.map(|(a, b)| half * (a + b)).collect::<Vec<_>>())
            })
        };
        if dimension > 1 && !fills(&zero) {
            let branches = along.iter().flat_map(|d| [(d, WALK), (d, -WALK)]);
            for (direction, by) in branches {
                let (aim, weights) = self.moved(&zero, direction, by);
                let beside = self.settle(config, on, &aim, &weights, DEPENDENT).filter(|beside| {
                    beside.open.len() == 1
                        && self.distance(&beside.x, &aim) <= 0.1 * WALK
                        && self.is_valid(config, on, beside)
                });
                if let Some(beside) = beside
                    && !self.is_known(config, on, &beside.x, 1, found)
                {
                    found.extend(self.family(config, on, beside, 1));
                }
            }
            return;
        }
        let rest = if dimension > 0 {
            zero.open = along;
            self.family(config, on, zero, dimension)
        } else if spurious.is_empty() {
            self.rest(config, on, zero)
        } else {
            let isolated = self.settle(config, on, &zero.x, &zero.weights, ROUNDING);
            isolated.filter(|z| self.is_valid(config, on, z)).and_then(|z| self.rest(config, on, z))
        };
        if let Some(rest) = rest
            && !self.is_known(config, on, &rest.x, dimension, found)
        {
            found.push(rest);
        }
    }

    /// Whether a zero of a mixture is a rest: in the box, on its own side of all other surfaces,
    /// with weights of a mixture.
    fn is_valid(&self, config: &Configuration, on: &[Surface], zero: &Zero) -> bool {
        let mixes = zero.weights.iter().all(|w| *w > 0.0 && *w < 1.0);
        mixes && self.is_inside(&zero.x) && self.is_its_own(config, &zero.x, on)
    }

    /// Whether a rest is listed, or the set to which it belongs. Sets of more dimensions than one
    /// are not told apart: one is listed for each set of surfaces.
    fn is_known(
        &self,
        config: &Configuration,
        on: &[Surface],
        x: &[f64],
        dimension: usize,
        found: &[Rest],
    ) -> bool {
        let names: Vec<String> = on.iter().map(|s| self.name(s)).collect();
        found.iter().any(|r| {
            let same = r.mode == config.mode && r.on.iter().map(|on| &on.surface).eq(names.iter());
            same && match &r.family {
                Some(family) if family.dimension > 1 => dimension > 1,
                Some(_) => self.passes(r, x),
                None => {
                    if on.is_empty() && dimension == 0 {
                        self.distance(&r.x, x) <= INDISTINCT && !self.are_parted(config, &r.x, x)
                    } else {
                        self.near(&r.x, x)
                    }
                }
            }
        })
    }

    /// Whether a field is larger between two zeros that are near to each other than at both, beyond
    /// rounding: at one zero of higher order, to which Newton's method came twice, it is not.
    fn are_parted(&self, config: &Configuration, a: &[f64], b: &[f64]) -> bool {
        const SAME: f64 = 1e-12;
        if self.distance(a, b) <= SAME {
            return false;
        }
        let size = |x: &[f64]| self.local(config, x).field;
        let (at_a, at_b) = (size(a), size(b));
        let compiled = self.equation.compiled(config);
        BETWEEN.iter().any(|share| {
            let x: Vec<f64> = a.iter().zip(b).map(|(a, b)| a + share * (b - a)).collect();
            let mut variables: Vec<Range> = x.iter().map(|x| Range::new(*x, 0.0)).collect();
            variables.push(Range::from_f64(0.0));
            variables.extend(config.sides.iter().map(|side| Range::from_f64(*side)));
            let mut field = vec![Range::default(); self.n];
            compiled.field.evaluate(&variables, &mut field);
            (0..self.n).any(|i| {
                let value = field[i].middle();
                let ends = at_a[i].abs().max(at_b[i].abs());
                value.abs() > 100.0 * ends && field[i].is_beyond(0.0, value.signum())
            })
        })
    }

    /// Whether a curve of rests passes a state, to within a thousandth of the box.
    fn passes(&self, rest: &Rest, x: &[f64]) -> bool {
        let Some(family) = &rest.family else { return false };
        family.points.windows(2).any(|ends| {
            let [a, b] = [&ends[0], &ends[1]].map(|p| self.scaled(p, x));
            let along: Vec<f64> = b.iter().zip(&a).map(|(b, a)| b - a).collect();
            let square: f64 = dot(&along, &along);
            let share =
                if square > 0.0 { (-dot(&a, &along) / square).clamp(0.0, 1.0) } else { 0.0 };
            a.iter().zip(&along).map(|(a, d)| (a + share * d) * (a + share * d)).sum::<f64>()
                <= 1e-6
        })
    }

    /// a - b in widths of the box.
    fn scaled(&self, a: &[f64], b: &[f64]) -> Vec<f64> {
        a.iter().zip(b).zip(&self.widths).map(|((a, b), w)| (a - b) / w).collect()
    }

    fn distance(&self, a: &[f64], b: &[f64]) -> f64 {
        let apart = self.scaled(a, b);
        sqrt(dot(&apart, &apart))
    }

    /// The state and the weights at a distance along a direction.
    fn moved(&self, zero: &Zero, direction: &[f64], by: f64) -> (Vec<f64>, Vec<f64>) {
        let (states, weights) = direction.split_at(self.n);
        let x =
            zero.x.iter().zip(states).zip(&self.widths).map(|((x, d), w)| x + by * d * w).collect();
        (x, zero.weights.iter().zip(weights).map(|(w, d)| w + by * d).collect())
    }

    fn configuration(&self, mode: usize, x: &[f64]) -> Configuration {
        let side = |(number, guard): (usize, &crate::equation::Guard)| {
            let value = self.equation.value(&guard.expression, 0.0, x);
            match guard.whole {
                true => value.floor(),
                false => {
                    // A function that jumps with others alone stays equal between their jumps.
                    if value == 0.0 && (self.constant[number] || guard.fixed) {
                        0.0
                    } else if value < 0.0 {
                        -1.0
                    } else {
                        1.0
                    }
                }
            }
        };
        Configuration {
            mode,
            sides: self.equation.guards.iter().enumerate().map(side).collect(),
            pieces: Vec::new(),
            slid: Vec::new(),
            still: Vec::new(),
            higher: Vec::new(),
        }
    }

    fn local(&self, config: &Configuration, x: &[f64]) -> Local {
        self.with_guards(config, &[], x).0
    }

    /// A field and its Jacobian, with values and gradients of guards that it asks (NaN of others).
    fn with_guards(
        &self,
        config: &Configuration,
        guards: &[usize],
        x: &[f64],
    ) -> (Local, Vec<f64>, Vec<f64>) {
        let n = self.n;
        let compiled = self.equation.compiled(config);
        let mut local = Local { field: vec![0.0; n], jacobian: vec![0.0; n * n] };
        let (mut values, mut gradients) =
            (vec![f64::NAN; guards.len()], vec![f64::NAN; guards.len() * n]);
        let mut v: Vec<Dual<f64, 1>> = x.iter().map(|v| Dual::constant(*v)).collect();
        v.push(Dual::constant(0.0));
        v.extend(config.sides.iter().map(|s| Dual::constant(*s)));
        let (mut f, mut g) =
            (vec![Dual::constant(0.0); n], vec![Dual::constant(0.0); compiled.outputs]);
        for j in 0..n {
            v[j].partials = [1.0];
            compiled.field.evaluate(&v, &mut f);
            for i in 0..n {
                local.field[i] = f[i].value;
                local.jacobian[i * n + j] = f[i].partials[0];
            }
            if !guards.is_empty() {
                compiled.watched.evaluate(&v, &mut g);
            }
            for (k, guard) in guards.iter().enumerate() {
                if let Some(place) = compiled.active.iter().position(|a| a == guard) {
                    values[k] = g[place].value;
                    gradients[k * n + j] = g[place].partials[0];
                }
            }
            v[j].partials = [0.0];
        }
        (local, values, gradients)
    }

    /// Whether a state's own answers, but for those in `free`, are those of a configuration.
    fn is_its_own(&self, config: &Configuration, x: &[f64], free: &[Surface]) -> bool {
        let own = self.configuration(config.mode, x);
        let is_free = |g: usize| Surface::is_of(free, g);
        // On one side of a free function others may be asked than on the other one.
        let mut corner = config.clone();
        (0..1_usize << free.len()).all(|bits| {
            for (i, surface) in free.iter().enumerate() {
                corner.sides[surface.guard] = surface.sides()[bits >> i & 1];
            }
            let compiled = self.equation.compiled(&corner);
            compiled.active.iter().all(|g| is_free(*g) || own.sides[*g] == config.sides[*g])
        })
    }

    /// The mixture on the surfaces `on`, by weights of their positive sides.
    fn mixture(
        &self,
        config: &Configuration,
        on: &[Surface],
        x: &[f64],
        weights: &[f64],
    ) -> Mixture {
        let (n, k) = (self.n, on.len());
        let mut mixture = Mixture {
            local: Local { field: vec![0.0; n], jacobian: vec![0.0; n * n] },
            by_weight: vec![0.0; n * k],
            values: vec![f64::NAN; k],
            gradients: vec![f64::NAN; k * n],
            sizes: vec![0.0; n],
        };
        let mut corner = config.clone();
        let guards: Vec<usize> = on.iter().map(|s| s.guard).collect();
        for bits in 0..1_usize << k {
            let is_above = |i: usize| bits >> i & 1 == 1;
            for (i, surface) in on.iter().enumerate() {
                corner.sides[surface.guard] = surface.sides()[usize::from(is_above(i))];
            }
            let (local, values, gradients) = self.with_guards(&corner, &guards, x);
            for i in 0..k {
                // A guard may be asked on one side of another one only.
                if mixture.values[i].is_nan() {
                    mixture.values[i] = values[i] - on[i].level.unwrap_or(0.0);
                    mixture.gradients[i * n..][..n].copy_from_slice(&gradients[i * n..][..n]);
                }
            }
            let factor = |i: usize| if is_above(i) { weights[i] } else { 1.0 - weights[i] };
            let product: f64 = (0..k).map(factor).product();
            for (sum, v) in mixture.local.field.iter_mut().zip(&local.field) {
                *sum += product * v;
            }
            for (sum, v) in mixture.local.jacobian.iter_mut().zip(&local.jacobian) {
                *sum += product * v;
            }
            for j in 0..k {
                let others: f64 = (0..k).filter(|i| *i != j).map(factor).product();
                let slope = if is_above(j) { others } else { -others };
                for i in 0..n {
                    mixture.by_weight[i * k + j] += slope * local.field[i];
                }
            }
            for (size, v) in mixture.sizes.iter_mut().zip(&local.field) {
                *size = size.max(v.abs());
            }
        }
        mixture
    }

    /// Newton's method for a state and weights at which a mixture vanishes and the state lies on
    /// its surfaces; the least step where the equations depend on each other.
    fn settle(
        &self,
        config: &Configuration,
        on: &[Surface],
        start: &[f64],
        weights: &[f64],
        dependent: f64,
    ) -> Option<Zero> {
        let (n, k) = (self.n, on.len());
        let (mut x, mut weights) = (start.to_vec(), weights.to_vec());
        let mut last = f64::INFINITY;
        for iteration in 0..MANY_ITERATIONS {
            let m = self.mixture(config, on, &x, &weights);
            // Unknowns in widths of the box, equations in units of their own gradients.
            let field = (0..n).map(|i| {
                let row = (0..n).map(|j| m.local.jacobian[i * n + j] * self.widths[j]);
                let row: Vec<f64> = row.chain(m.by_weight[i * k..][..k].iter().copied()).collect();
                (row, m.local.field[i], m.sizes[i])
            });
            let surfaces = (0..k).map(|i| {
                let row = (0..n).map(|j| m.gradients[i * n + j] * self.widths[j]);
                (row.chain((0..k).map(|_| 0.0)).collect(), m.values[i], 0.0)
            });
            let step = least_step(field.chain(surfaces).collect(), dependent)?;
            x.iter_mut().zip(&step.by).zip(&self.widths).for_each(|((x, s), w)| *x -= s * w);
            weights.iter_mut().zip(&step.by[n..]).for_each(|(w, s)| *w -= s);
            if !x.iter().chain(&weights).all(|v| v.is_finite()) {
                return None;
            }
            let close = |(s, (x, w)): (&f64, (&f64, &f64))| {
                s.abs() <= 1e-13 || s.abs() * w <= 4.0 * f64::EPSILON * x.abs()
            };
            let settled = step.by.iter().zip(x.iter().zip(&self.widths)).all(close);
            if settled && step.by[n..].iter().all(|s| s.abs() <= 1e-12) {
                let open = step.open(n);
                let is_zero = step.left_over <= 1e-9 && !(k == 0 && self.is_pole(config, &x));
                return is_zero.then_some(Zero { x, weights, open });
            }
            // A zero of order m is come to by (1 - 1/m) a step.
            let size = step.by.iter().fold(0.0_f64, |most, s| most.max(s.abs()));
            if iteration >= MOST_ITERATIONS && !(size < 1e-2 && size < 0.97 * last) {
                return None;
            }
            last = size;
        }
        None
    }

    /// Whether a component of a field is larger at a state than beside it: Newton's method comes to
    /// poles, too, by steps that halve.
    fn is_pole(&self, config: &Configuration, x: &[f64]) -> bool {
        const BESIDE: f64 = 1e-6;
        let here = self.local(config, x).field;
        let beside = [BESIDE, -BESIDE].map(|by| {
            let moved: Vec<f64> = x.iter().zip(&self.widths).map(|(x, w)| x + by * w).collect();
            self.local(config, &moved)
        });
        (0..self.n).any(|i| {
            let varies = |b: &Local| -> f64 {
                (0..self.n).map(|j| (b.jacobian[i * self.n + j] * self.widths[j]).abs()).sum()
            };
            // Where one side has no value the other one tells.
            let defined = || beside.iter().filter(|b| b.field[i].is_finite());
            let largest = defined().map(|b| b.field[i].abs()).fold(0.0, f64::max);
            let rate = defined().map(varies).fold(0.0, f64::max);
            here[i].abs() > 1.5 * largest && here[i].abs() > KNOWN_TO * rate
        })
    }

    /// The switching function, none of those in `on`, that is zero at a state, to rounding, and on
    /// whose other side the equations are others.
    fn boundary(&self, config: &Configuration, on: &[Surface], x: &[f64]) -> Option<String> {
        let n = self.n;
        let own = self.local(config, x);
        let is_on = |guard: &usize| {
            let (_, values, gradients) = self.with_guards(config, &[*guard], x);
            // The distance that the state is known to.
            let reach: f64 = gradients.iter().zip(&self.widths).map(|(g, w)| (g * w).abs()).sum();
            if Surface::is_of(on, *guard)
                || self.equation.guards[*guard].whole
                || !(values[0].abs() <= 1e-12 * reach)
            {
                return false;
            }
            let mut other = config.clone();
            other.sides[*guard] = -config.sides[*guard];
            let there = self.local(&other, x);
            (0..n).any(|i| own.field[i] != there.field[i])
                || (0..n * n).any(|i| own.jacobian[i] != there.jacobian[i])
        };
        let guard = self.equation.compiled(config).active.iter().copied().find(|g| is_on(g))?;
        Some(self.equation.guards[guard].expression.to_string())
    }

    /// The first event of a mode whose condition holds at a state, or whose expression has passed
    /// zero there.
    fn behind(&self, mode: usize, x: &[f64]) -> Option<String> {
        let config = self.configuration(mode, x);
        let passed = |when: &When| match when {
            When::Becomes(condition) => self.equation.holds(condition, &config),
            When::Zero(e, Direction::Up) => self.equation.value(e, 0.0, x) > 0.0,
            When::Zero(e, Direction::Down) => self.equation.value(e, 0.0, x) < 0.0,
            _ => false,
        };
        let events = self.equation.definition.events().iter();
        let changes = |e: &&Event| e.stop || !e.set.is_empty() || e.mode.is_some_and(|m| m != mode);
        let mut here = events.filter(|e| e.from.is_none_or(|m| m == mode)).filter(changes);
        here.find(|e| passed(&e.when)).map(|e| e.name.clone())
    }

    /// The first event of the clock in a mode that changes a state, or the mode.
    fn clock_moves(&self, mode: usize, x: &[f64]) -> Option<String> {
        let moves = |e: &&Event| {
            let sets = |(i, to): &(usize, Expression)| {
                (self.equation.value(to, 0.0, x) - x[*i]).abs() > 1e-9 * self.widths[*i]
            };
            matches!(e.when, When::Every(_))
                && e.from.is_none_or(|from| from == mode)
                && (e.mode.is_some_and(|to| to != mode) || e.set.iter().any(sets))
        };
        self.equation.definition.events().iter().find(moves).map(|e| e.name.clone())
    }

    /// An isolated rest, with the linearised motion along its surfaces.
    fn rest(&self, config: &Configuration, on: &[Surface], zero: Zero) -> Option<Rest> {
        let (n, k) = (self.n, on.len());
        let Zero { x, weights, .. } = zero;
        let m = self.mixture(config, on, &x, &weights);
        // Change of the switching functions' rates with the weights.
        let mut normal = vec![0.0; k * k];
        for i in 0..k {
            for j in 0..k {
                normal[i * k + j] =
                    (0..n).map(|l| m.gradients[i * n + l] * m.by_weight[l * k + j]).sum();
            }
        }
        let tangent = self.is_tangent(&m, &normal, k);
        // Where each field vanishes by itself it is a boundary equilibrium of each.
        let varies = |l: usize| -> f64 {
            (0..n).map(|j| (m.local.jacobian[l * n + j] * self.widths[j]).abs()).sum()
        };
        if tangent && (0..n).all(|l| m.sizes[l] <= 1e-9 * varies(l)) {
            return None;
        }
        // If the mixture vanishes, sliding is linearised by (1 - B (C B)^-1 C) A: the rows of C
        // have the eigenvalue 0, which does not belong to motion along the surfaces.
        let mut along = m.local.jacobian.clone();
        for j in 0..if k > 0 && !tangent { n } else { 0 } {
            let pull = |i: usize| {
                (0..n).map(|l| m.gradients[i * n + l] * m.local.jacobian[l * n + j]).sum::<f64>()
            };
            let shift = solve_any(&normal, &(0..k).map(pull).collect::<Vec<_>>(), 0.0)?;
            for i in 0..n {
                let kept: f64 = (0..k).map(|l| m.by_weight[i * k + l] * shift[l]).sum();
                along[i * n + j] -= kept;
            }
        }
        let mut eigenvalues = if tangent { Vec::new() } else { eigenvalues(&along, n)? };
        let modulus = |e: &[f64; 2]| e[0] * e[0] + e[1] * e[1];
        for _ in 0..if tangent { 0 } else { k } {
            let smallest = (0..eigenvalues.len())
                .min_by(|i, j| modulus(&eigenvalues[*i]).total_cmp(&modulus(&eigenvalues[*j])))?;
            eigenvalues.remove(smallest);
        }
        eigenvalues.sort_by(|a, b| b[0].total_cmp(&a[0]).then(b[1].total_cmp(&a[1])));
        let blur = if k == 0 { self.blur(config, &x, &eigenvalues) } else { 0.0 };
        let boundary = self.boundary(config, on, &x);
        let on = on.iter().zip(&weights);
        let on = on.map(|(s, w)| On { surface: self.name(s), weight: *w }).collect();
        let attracting = if k > 0 && !tangent { attracts(&normal, k) } else { None };
        let behind = self.behind(config.mode, &x);
        let moved = self.clock_moves(config.mode, &x);
        Some(Rest {
            x,
            mode: config.mode,
            on,
            attracting,
            tangent,
            family: None,
            eigenvalues,
            blur,
            boundary,
            behind,
            moved,
        })
    }

    /// By how much the eigenvalues of a field's rest change within what the state is known to. (How
    /// much entries of its Jacobian change says less: states have units.)
    fn blur(&self, config: &Configuration, x: &[f64], own: &[[f64; 2]]) -> f64 {
        // Together, and every second one the other way: what two states change may cancel.
        let shifted = [1.0, -1.0].map(|second| {
            let shift =
                |(i, w): (usize, &f64)| KNOWN_TO * w * if i % 2 == 0 { 1.0 } else { second };
            let moved = self.widths.iter().enumerate().map(shift).zip(x).map(|(d, x)| x + d);
            let there = self.local(config, &moved.collect::<Vec<_>>()).jacobian;
            let there = eigenvalues(&there, self.n).unwrap_or_default();
            let nearest = |e| there.iter().map(|other| apart(e, other)).reduce(f64::min);
            own.iter().filter_map(nearest).fold(0.0, f64::max)
        });
        shifted[0].max(shifted[1])
    }

    /// Whether all fields around a rest on `k` surfaces are tangent to one of them, to rounding:
    /// its function's rate changes with the weights far less than in the box.
    fn is_tangent(&self, m: &Mixture, normal: &[f64], k: usize) -> bool {
        let n = self.n;
        (0..k).any(|i| {
            let size = |l: usize| {
                let varies: f64 =
                    (0..n).map(|j| (m.local.jacobian[l * n + j] * self.widths[j]).abs()).sum();
                m.gradients[i * n + l].abs() * (m.sizes[l] + varies)
            };
            let most = 1e-9 * (0..n).map(size).sum::<f64>();
            normal[i * k..(i + 1) * k].iter().all(|change| change.abs() <= most)
        })
    }

    /// A rest that is not isolated; a curve of them is followed to its ends.
    fn family(
        &self,
        config: &Configuration,
        on: &[Surface],
        zero: Zero,
        dimension: usize,
    ) -> Option<Rest> {
        if dimension > 1 {
            let mut rest = self.rest(config, on, zero)?;
            rest.family = Some(Family {
                dimension,
                ends: None,
                changes: false,
                leaves: false,
                points: Vec::new(),
            });
            return Some(rest);
        }
        let first = zero.open.first()?.clone();
        let mut points = vec![zero.x.clone()];
        let mut closed = false;
        for sign in [1.0, -1.0] {
            if closed {
                break;
            }
            let mut here = Zero {
                x: zero.x.clone(),
                weights: zero.weights.clone(),
                open: vec![first.clone()],
            };
            let mut heading: Vec<f64> = first.iter().map(|d| sign * d).collect();
            let mut side = Vec::new();
            for _ in 0..MOST_STRIDES {
                let ahead = |by: f64| {
                    let (aim, weights) = self.moved(&here, &heading, by);
                    let there = self.settle(config, on, &aim, &weights, DEPENDENT)?;
                    let follows = self.distance(&there.x, &aim) <= 0.5 * by
                        && self.is_valid(config, on, &there);
                    (follows && !there.open.is_empty()).then_some(there)
                };
                let Some(next) = ahead(STRIDE) else {
                    // The end: the last place from which the rest is still one.
                    let (mut good, mut bad) = (0.0, STRIDE);
                    for _ in 0..60 {
                        let middle = 0.5 * (good + bad);
                        if ahead(middle).is_some() { good = middle } else { bad = middle }
                    }
                    side.extend(ahead(good).map(|z| z.x));
                    break;
                };
                let direction = next.open.first()?;
                let turn = if dot(direction, &heading) < 0.0 { -1.0 } else { 1.0 };
                heading = direction.iter().map(|d| turn * d).collect();
                side.push(next.x.clone());
                closed = side.len() > 2 && self.distance(&next.x, &zero.x) < 0.6 * STRIDE;
                here = next;
                if closed {
                    break;
                }
            }
            points.reverse();
            points.extend(side);
        }
        let middle = points[points.len() / 2].clone();
        let ends = (!closed).then(|| [points[points.len() - 1].clone(), points[0].clone()]);
        let ends = ends.map(|[a, b]| {
            if a.iter().zip(&b).find(|(a, b)| a != b).is_some_and(|(a, b)| a > b) {
                [b, a]
            } else {
                [a, b]
            }
        });
        // At an end the equations change, and a stride may come to it.
        let is_inner =
            |x: &&Vec<f64>| ends.iter().flatten().all(|end| self.distance(x, end) > NEAR_AN_END);
        let inner: Vec<&Vec<f64>> = points.iter().filter(is_inner).collect();
        let leaves = !closed && self.leaves_at_an_end(config.mode, &points);
        let family = Family { dimension, ends, changes: false, leaves: false, points: Vec::new() };
        let at = |x: &Vec<f64>| {
            let there = self.settle(config, on, x, &zero.weights, DEPENDENT)?;
            Some(Rest { family: Some(family.clone()), ..self.rest(config, on, there)? })
        };
        let mut rest = at(&middle)?;
        let kind = rest.kind();
        let changes = inner.into_iter().filter_map(&at).any(|other| other.kind() != kind);
        rest.family = Some(Family { changes, leaves, points, ..family });
        Some(rest)
    }

    /// Whether the field beyond an end of a curve of rests, where that is in the box, points along
    /// the curve and away from it.
    fn leaves_at_an_end(&self, mode: usize, points: &[Vec<f64>]) -> bool {
        const STRAIGHT: f64 = 1e-6;
        let leaves = |points: &[&Vec<f64>]| {
            let (end, others) = points.split_last()?;
            let before = others.iter().rfind(|x| self.distance(x, end) > NEAR_AN_END)?;
            let way = self.scaled(end, before);
            let length = sqrt(dot(&way, &way));
            let way: Vec<f64> = way.iter().map(|v| v / length).collect();
            let beyond = end.iter().zip(&way).zip(&self.widths);
            let beyond: Vec<f64> = beyond.map(|((x, d), w)| x + WALK * d * w).collect();
            let field = self.local(&self.configuration(mode, &beyond), &beyond).field;
            let field: Vec<f64> = field.iter().zip(&self.widths).map(|(f, w)| f / w).collect();
            let (out, size) = (dot(&field, &way), sqrt(dot(&field, &field)));
            Some(self.is_inside(&beyond) && out > 0.0 && out >= (1.0 - STRAIGHT) * size)
        };
        let forth: Vec<&Vec<f64>> = points.iter().collect();
        let back: Vec<&Vec<f64>> = points.iter().rev().collect();
        [leaves(&forth), leaves(&back)].contains(&Some(true))
    }
}

fn same_surfaces(a: &Rest, b: &Rest) -> bool {
    a.on.iter().map(|on| &on.surface).eq(b.on.iter().map(|on| &on.surface))
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// The least step that solves linear equations.
struct Step {
    by: Vec<f64>,
    /// Unit vectors that span the equations' rows.
    span: Vec<Vec<f64>>,
    /// By how much the equations that depend on others are not satisfied.
    left_over: f64,
}

impl Step {
    /// Directions along which no equation changes, orthogonal, with a unit vector as their first
    /// `n` components.
    fn open(&self, n: usize) -> Vec<Vec<f64>> {
        let (mut span, mut open) = (self.span.clone(), Vec::new());
        let all = self.by.len();
        while span.len() < all {
            // The unit vector that is farthest from what is spanned.
            let left = |i: usize| 1.0 - span.iter().map(|q| q[i] * q[i]).sum::<f64>();
            let Some(i) = (0..all).max_by(|i, j| left(*i).total_cmp(&left(*j))) else { break };
            let mut v: Vec<f64> = (0..all).map(|j| if i == j { 1.0 } else { 0.0 }).collect();
            for _ in 0..2 {
                for q in &span {
                    let share = dot(&v, q);
                    v.iter_mut().zip(q).for_each(|(v, q)| *v -= share * q);
                }
            }
            let size = sqrt(dot(&v, &v));
            v.iter_mut().for_each(|v| *v /= size);
            let states = v[..n].to_vec();
            let states = sqrt(dot(&states, &states));
            // Sticking zones may be that short; what moves weights alone is no set of rests.
            if states > SHORTEST {
                open.push(v.iter().map(|v| v / states).collect());
            }
            span.push(v);
        }
        open
    }
}

/// The least solution of equations (row, right-hand side, size that rounding is measured by). Rows
/// that only look alike because the unknowns have very different units are independent: that has
/// no units.
fn least_step(rows: Vec<(Vec<f64>, f64, f64)>, dependent: f64) -> Option<Step> {
    let all = rows.first()?.0.len();
    let step = orthogonal_step(rows.clone(), dependent)?;
    if step.span.len() == all || rows.len() < all {
        return Some(step);
    }
    // Rows and columns in turn by their largest entries.
    let mut balanced = rows;
    let mut units = vec![1.0; all];
    for _ in 0..BALANCINGS {
        for (row, right, size) in &mut balanced {
            let most = row.iter().fold(0.0_f64, |most, v| most.max(v.abs()));
            if most > 0.0 {
                row.iter_mut().chain([right, size]).for_each(|v| *v /= most);
            }
        }
        for (j, unit) in units.iter_mut().enumerate() {
            let most = balanced.iter().fold(0.0_f64, |most, (row, ..)| most.max(row[j].abs()));
            if most > 0.0 {
                balanced.iter_mut().for_each(|(row, ..)| row[j] /= most);
                *unit /= most;
            }
        }
    }
    match orthogonal_step(balanced, dependent) {
        Some(other) if other.span.len() == all => {
            let by = other.by.iter().zip(&units).map(|(s, unit)| s * unit).collect();
            Some(Step { by, ..other })
        }
        _ => Some(step),
    }
}

/// Times that rows and columns are balanced.
const BALANCINGS: usize = 3;

/// The least step in the unknowns' units: rows are made orthogonal, the most independent first.
fn orthogonal_step(mut rows: Vec<(Vec<f64>, f64, f64)>, dependent: f64) -> Option<Step> {
    let all = rows.first()?.0.len();
    let mut step = Step { by: vec![0.0; all], span: Vec::new(), left_over: 0.0 };
    for (row, right, size) in &mut rows {
        let norm = sqrt(dot(row, row));
        if norm > 0.0 {
            row.iter_mut().for_each(|v| *v /= norm);
            *right /= norm;
        } else if right.abs() > 1e-12 * *size {
            return None;
        } else {
            *right = 0.0;
        }
    }
    while !rows.is_empty() {
        let size = |i: &usize| dot(&rows[*i].0, &rows[*i].0);
        let farthest = (0..rows.len()).max_by(|i, j| size(i).total_cmp(&size(j)))?;
        let (mut row, mut right, _) = rows.swap_remove(farthest);
        let norm = sqrt(dot(&row, &row));
        if norm.is_nan() {
            return None;
        }
        if norm <= dependent {
            step.left_over = rows.iter().map(|r| r.1.abs()).fold(right.abs(), f64::max);
            break;
        }
        row.iter_mut().for_each(|v| *v /= norm);
        right /= norm;
        for (other, value, _) in &mut rows {
            let share = dot(other, &row);
            other.iter_mut().zip(&row).for_each(|(v, q)| *v -= share * q);
            *value -= share * right;
        }
        step.by.iter_mut().zip(&row).for_each(|(s, q)| *s += right * q);
        step.span.push(row);
    }
    Some(step)
}

/// Principal minors of a matrix whose rows have entries of at most 1 are zero up to this.
const MINOR_ROUNDING: f64 = 1e-12;

/// Whether w' = D W w comes to zero for every diagonal matrix D > 0: `Some` if it does for all, or
/// for none. Nothing where D decides, or where w turns without growing or falling, so that only
/// terms of higher order decide.
fn attracts(w: &[f64], k: usize) -> Option<bool> {
    // To scale a row is to choose another D: each gets entries of at most 1.
    let size = |i: usize| w[i * k..(i + 1) * k].iter().fold(0.0_f64, |most, v| most.max(v.abs()));
    let sizes: Vec<f64> = (0..k).map(size).collect();
    let minor = |rows: &Vec<usize>| {
        let entry = |(i, j): (&usize, &usize)| w[i * k + j] / sizes[*i];
        let pairs = rows.iter().flat_map(|i| rows.iter().map(move |j| (i, j)));
        let value = determinant_of_negative(pairs.map(entry).collect(), rows.len());
        if value.abs() <= MINOR_ROUNDING { 0.0 } else { value }
    };
    // The coefficients of the characteristic polynomial, by falling powers: each is a sum of minors
    // times entries of D. One that is below zero for every D leaves an eigenvalue above zero.
    let all: Vec<usize> = (0..k).collect();
    let minors: Vec<Vec<f64>> =
        (1..=k).map(|order| subsets(&all, order).iter().map(minor).collect()).collect();
    let never_above = |minors: &Vec<f64>| minors.iter().all(|m| *m <= 0.0);
    let all_zero = |minors: &Vec<f64>| minors.iter().all(|m| *m == 0.0);
    if minors.iter().any(|m| never_above(m) && !all_zero(m)) {
        return Some(false);
    }
    // s^3 + a s^2 + c and s^3 + b s + c with c > 0 have zeros on the right (Hurwitz: a b > c).
    if k == 3 && !all_zero(&minors[2]) && minors[..2].iter().any(all_zero) {
        return Some(false);
    }
    if k <= 2 {
        let above = |minors: &Vec<f64>| minors.iter().all(|m| *m >= 0.0) && !all_zero(minors);
        return minors.iter().all(above).then_some(true);
    }
    // W + W^T is negative definite: so is that of D^1/2 W D^1/2, which has the eigenvalues of D W.
    let symmetric: Vec<f64> = (0..k * k).map(|p| 0.5 * (w[p] + w[p % k * k + p / k])).collect();
    let leading = |m: usize| {
        let part = (0..m).flat_map(|i| (0..m).map(move |j| (i, j)));
        determinant_of_negative(part.map(|(i, j)| symmetric[i * k + j]).collect(), m)
    };
    (1..=k).all(|m| leading(m) > 0.0).then_some(true)
}
