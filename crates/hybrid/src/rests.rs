//! Rests: states that do not move, in the fields and on switching surfaces.
//!
//! An equilibrium is a zero of a field on its own side of all switching functions. A *pseudo-equilibrium* is a zero of the sliding field: a point of a
//! surface where a mixture of both fields vanishes (Filippov 1988, sec. 17; Kuznetsov, Rinaldi & Gragnani 2003). Newton's method looks for both from many
//! places of a box.

use twofold_num::Dual;
use twofold_num::linear::{eigenvalues, solve_any};

use crate::equation::{Configuration, Equation, EquationError};
use crate::model::Model;

/// Where a rest lies.
#[derive(Clone, Debug, PartialEq)]
pub enum Place {
    /// In a field.
    Field,
    /// On a switching surface, by the switching function's text.
    Surface {
        /// The switching function.
        surface: String,
        /// The weight of the field on its positive side.
        weight: f64,
        /// Whether the surface attracts there.
        attracting: bool,
    },
}

/// A state that does not move.
#[derive(Clone, Debug, PartialEq)]
pub struct Rest {
    /// The state.
    pub x: Vec<f64>,
    /// The mode's number.
    pub mode: usize,
    /// Where it lies.
    pub place: Place,
    /// Eigenvalues of the linearised motion, on a surface along the surface: real and imaginary parts.
    pub eigenvalues: Vec<[f64; 2]>,
    /// By how much an eigenvalue may be off, the state being known to 1e-9 of the box: at a double root none has a sign.
    pub blur: f64,
    /// The switching function that is zero at an equilibrium of a field: the equations change there, and eigenvalues are those of one side.
    pub boundary: Option<String>,
}

impl Rest {
    /// "stable node", "saddle", ... from the eigenvalues; on a surface that repels everything is unstable.
    pub fn kind(&self) -> String {
        let size = self.eigenvalues.iter().map(|e| e[0].abs().max(e[1].abs())).fold(0.0, f64::max);
        let zero = (1e-9 * size).max(self.blur);
        if let Some(surface) = &self.boundary {
            return format!(
                "boundary equilibrium: the equations change on {surface} = 0, and one side does not decide"
            );
        }
        let turns = self.eigenvalues.iter().any(|e| e[1].abs() > zero);
        let (out, into) = (self.eigenvalues.iter().any(|e| e[0] > zero), self.eigenvalues.iter().any(|e| e[0] < -zero));
        let neutral = self.eigenvalues.iter().any(|e| e[0].abs() <= zero);
        let shape = if turns { "focus" } else { "node" };
        let repels = matches!(self.place, Place::Surface { attracting: false, .. });
        match (out, into) {
            _ if self.eigenvalues.is_empty() => if repels { "unstable" } else { "stable" }.into(),
            (true, true) => "saddle".into(),
            (false, _) if neutral => "not decided by the linearised motion".into(),
            (true, false) if neutral => "unstable".into(),
            (true, false) => format!("unstable {shape}"),
            _ if repels => format!("{shape} that attracts along a surface that repels"),
            _ => format!("stable {shape}"),
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

/// Starts of Newton's method.
const STARTS: usize = 400;
const MOST_ITERATIONS: usize = 60;

/// The rests of a system in a box, by the smallest coordinates first.
///
/// # Errors
/// If the equations are not complete or depend on the time, or the box is none.
///
/// ```
/// use twofold_hybrid::{Definition, Model, rests::{Place, rests}};
/// // A cubic's zeros, and sliding to a pseudo-equilibrium where both fields cancel.
/// let cubic = Model::new(Definition::from_toml("states = ['x']\nf = ['x - x^3']", "f")?);
/// let found: Vec<f64> = rests(&cubic, &[(-3.0, 3.0)])?.iter().map(|r| r.x[0]).collect();
/// assert!(found.iter().zip([-1.0, 0.0, 1.0]).all(|(a, b)| (a - b).abs() < 1e-12));
/// let relay = Model::new(Definition::from_toml("states = ['x']\nf = ['0.5 - sign(x)']", "f")?);
/// let rest = &rests(&relay, &[(-1.0, 1.0)])?[0];
/// assert!(matches!(rest.place, Place::Surface { weight, attracting: true, .. } if (weight - 0.75).abs() < 1e-12));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn rests(model: &Model, within: &[(f64, f64)]) -> Result<Vec<Rest>, RestError> {
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
    let search = Search { equation, n, widths: within.iter().map(|(a, b)| b - a).collect() };
    let mut found: Vec<Rest> = Vec::new();
    for mode in 0..model.definition().modes().len() {
        for start in 0..STARTS {
            let x: Vec<f64> = within
                .iter()
                .enumerate()
                .map(|(i, (a, b))| {
                    if start == 0 {
                        0.5 * (a + b)
                    } else {
                        a + (b - a) * radical_inverse(start, PRIMES[i % PRIMES.len()])
                    }
                })
                .collect();
            let config = search.configuration(mode, &x);
            let mut add = |rest: Option<Rest>| {
                let Some(rest) = rest else { return };
                let inside = rest.x.iter().zip(within).all(|(v, (a, b))| (a..=b).contains(&v));
                let known =
                    found.iter().any(|r| r.mode == rest.mode && r.place_is(&rest) && search.near(&r.x, &rest.x));
                if inside && !known {
                    found.push(rest);
                }
            };
            add(search.in_field(&config, &x));
            for guard in search.equation.compiled(&config).active.clone() {
                if !search.equation.guards[guard].whole {
                    add(search.on_surface(&config, guard, &x));
                }
            }
        }
    }
    found.sort_by(|a, b| {
        let by_state = a.x.iter().zip(&b.x).map(|(p, q)| p.total_cmp(q)).find(|o| o.is_ne());
        a.mode.cmp(&b.mode).then(by_state.unwrap_or(std::cmp::Ordering::Equal))
    });
    Ok(found)
}

impl Rest {
    fn place_is(&self, other: &Rest) -> bool {
        match (&self.place, &other.place) {
            (Place::Field, Place::Field) => true,
            (Place::Surface { surface: a, .. }, Place::Surface { surface: b, .. }) => a == b,
            _ => false,
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

struct Search {
    equation: Equation,
    n: usize,
    widths: Vec<f64>,
}

/// A field, its Jacobian row by row, and the value and gradient of a guard.
struct Local {
    field: Vec<f64>,
    jacobian: Vec<f64>,
    value: f64,
    gradient: Vec<f64>,
}

impl Search {
    fn near(&self, a: &[f64], b: &[f64]) -> bool {
        a.iter().zip(b).zip(&self.widths).all(|((a, b), w)| (a - b).abs() <= 1e-7 * w)
    }

    fn configuration(&self, mode: usize, x: &[f64]) -> Configuration {
        let side = |guard: &crate::equation::Guard| {
            let value = self.equation.value(&guard.expression, 0.0, x);
            match guard.whole {
                true => value.floor(),
                false => {
                    if value < 0.0 {
                        -1.0
                    } else {
                        1.0
                    }
                }
            }
        };
        Configuration { mode, sides: self.equation.guards.iter().map(side).collect(), pieces: Vec::new() }
    }

    fn local(&self, config: &Configuration, guard: Option<usize>, x: &[f64]) -> Local {
        let n = self.n;
        let compiled = self.equation.compiled(config);
        let place = guard.and_then(|g| compiled.active.iter().position(|a| *a == g));
        let mut local =
            Local { field: vec![0.0; n], jacobian: vec![0.0; n * n], value: f64::NAN, gradient: vec![0.0; n] };
        let mut v: Vec<Dual<f64, 1>> = x.iter().map(|v| Dual::constant(*v)).collect();
        v.push(Dual::constant(0.0));
        v.extend(config.sides.iter().map(|s| Dual::constant(*s)));
        let (mut f, mut g) = (vec![Dual::constant(0.0); n], vec![Dual::constant(0.0); compiled.outputs]);
        for j in 0..n {
            v[j].partials = [1.0];
            compiled.field.evaluate(&v, &mut f);
            for i in 0..n {
                local.field[i] = f[i].value;
                local.jacobian[i * n + j] = f[i].partials[0];
            }
            if let Some(place) = place {
                compiled.watched.evaluate(&v, &mut g);
                local.value = g[place].value;
                local.gradient[j] = g[place].partials[0];
            }
            v[j].partials = [0.0];
        }
        local
    }

    /// Whether a state's own answers, but for those in `free`, are those of a configuration.
    fn is_its_own(&self, config: &Configuration, x: &[f64], free: Option<usize>) -> bool {
        let own = self.configuration(config.mode, x);
        let compiled = self.equation.compiled(config);
        compiled.active.iter().all(|g| Some(*g) == free || own.sides[*g] == config.sides[*g])
    }

    fn in_field(&self, config: &Configuration, start: &[f64]) -> Option<Rest> {
        let mut x = start.to_vec();
        for _ in 0..MOST_ITERATIONS {
            let local = self.local(config, None, &x);
            let step = solve_any(&local.jacobian, &local.field, 0.0)?;
            x.iter_mut().zip(&step).for_each(|(x, s)| *x -= s);
            let settled = step.iter().zip(&self.widths).all(|(s, w)| s.abs() <= 1e-13 * w)
                || step.iter().zip(&x).all(|(s, x)| s.abs() <= 4.0 * f64::EPSILON * x.abs());
            if !x.iter().all(|v| v.is_finite()) {
                return None;
            }
            if settled {
                if !self.is_its_own(config, &x, None) {
                    return None;
                }
                let jacobian = self.local(config, None, &x).jacobian;
                let eigenvalues = eigenvalues(&jacobian, self.n)?;
                let moved: Vec<f64> = x.iter().zip(&self.widths).map(|(x, w)| x + 1e-9 * w).collect();
                let other = self.local(config, None, &moved).jacobian;
                let blur = jacobian.iter().zip(&other).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
                let boundary = self.boundary(config, &x);
                return Some(Rest { x, mode: config.mode, place: Place::Field, eigenvalues, blur, boundary });
            }
        }
        None
    }

    /// The switching function that is zero at a state, to rounding, and on whose other side the equations are others.
    fn boundary(&self, config: &Configuration, x: &[f64]) -> Option<String> {
        let n = self.n;
        let own = self.local(config, None, x);
        let on = |guard: &usize| {
            let local = self.local(config, Some(*guard), x);
            // The distance that the state is known to.
            let reach: f64 = local.gradient.iter().zip(&self.widths).map(|(g, w)| (g * w).abs()).sum();
            if self.equation.guards[*guard].whole || !(local.value.abs() <= 1e-12 * reach) {
                return false;
            }
            let mut other = config.clone();
            other.sides[*guard] = -config.sides[*guard];
            let there = self.local(&other, None, x);
            (0..n).any(|i| own.field[i] != there.field[i]) || (0..n * n).any(|i| own.jacobian[i] != there.jacobian[i])
        };
        let guard = self.equation.compiled(config).active.iter().copied().find(|g| on(g))?;
        Some(self.equation.guards[guard].expression.to_string())
    }

    /// Newton's method for the state and the weight at once: a mixture of the fields that vanishes, and the switching function that does.
    fn on_surface(&self, config: &Configuration, guard: usize, start: &[f64]) -> Option<Rest> {
        let n = self.n;
        let (mut low, mut high) = (config.clone(), config.clone());
        (low.sides[guard], high.sides[guard]) = (-1.0, 1.0);
        let (mut x, mut weight) = (start.to_vec(), 0.5);
        for _ in 0..MOST_ITERATIONS {
            let (a, b) = (self.local(&low, Some(guard), &x), self.local(&high, Some(guard), &x));
            let m = n + 1;
            let (mut matrix, mut right) = (vec![0.0; m * m], vec![0.0; m]);
            for i in 0..n {
                for j in 0..n {
                    matrix[i * m + j] =
                        a.jacobian[i * n + j] + weight * (b.jacobian[i * n + j] - a.jacobian[i * n + j]);
                }
                matrix[i * m + n] = b.field[i] - a.field[i];
                right[i] = a.field[i] + weight * (b.field[i] - a.field[i]);
                matrix[n * m + i] = a.gradient[i];
            }
            right[n] = a.value;
            let step = solve_any(&matrix, &right, 0.0)?;
            x.iter_mut().zip(&step).for_each(|(x, s)| *x -= s);
            weight -= step[n];
            if !x.iter().all(|v| v.is_finite()) {
                return None;
            }
            let settled = step.iter().zip(&self.widths).all(|(s, w)| s.abs() <= 1e-13 * w) && step[n].abs() <= 1e-12;
            if settled {
                if !(weight > 0.0 && weight < 1.0) || !self.is_its_own(config, &x, Some(guard)) {
                    return None;
                }
                return self.pseudo(&low, &high, guard, x, weight);
            }
        }
        None
    }

    fn pseudo(
        &self,
        low: &Configuration,
        high: &Configuration,
        guard: usize,
        x: Vec<f64>,
        weight: f64,
    ) -> Option<Rest> {
        let n = self.n;
        let (a, b) = (self.local(low, Some(guard), &x), self.local(high, Some(guard), &x));
        let jump: Vec<f64> = a.field.iter().zip(&b.field).map(|(a, b)| b - a).collect();
        let normal: f64 = a.gradient.iter().zip(&jump).map(|(c, b)| c * b).sum();
        if normal == 0.0 {
            return None;
        }
        // Where the mixture vanishes, sliding is linearised by (1 - b c^T/(c^T b)) A: c has the eigenvalue 0, which is none of the surface.
        let mixed: Vec<f64> = a.jacobian.iter().zip(&b.jacobian).map(|(a, b)| a + weight * (b - a)).collect();
        let mut along = vec![0.0; n * n];
        for j in 0..n {
            let pull: f64 = (0..n).map(|i| a.gradient[i] * mixed[i * n + j]).sum();
            for i in 0..n {
                along[i * n + j] = mixed[i * n + j] - jump[i] * pull / normal;
            }
        }
        let mut eigenvalues = eigenvalues(&along, n)?;
        let size = |e: &[f64; 2]| e[0] * e[0] + e[1] * e[1];
        let smallest = (0..n).min_by(|i, j| size(&eigenvalues[*i]).total_cmp(&size(&eigenvalues[*j])))?;
        eigenvalues.remove(smallest);
        let surface = self.equation.guards[guard].expression.to_string();
        let place = Place::Surface { surface, weight, attracting: normal < 0.0 };
        Some(Rest { x, mode: low.mode, place, eigenvalues, blur: 0.0, boundary: None })
    }
}
