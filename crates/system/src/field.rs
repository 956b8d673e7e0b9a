//! Ordinary differential equations as data, and how they are made from piecewise-smooth systems.
//!
//! Each transform writes a new tape from an old one: in any dimension, with parameters kept by
//! name, with exactly the operations of the compiled equation that it stands for.

use std::fmt;
use std::sync::Arc;

use nalgebra::SVector;

use super::instance::{BindError, run};
use super::{Relaxation, System, Transition, VectorField};
use twofold_num::tape::{Program, Recorded, Replay, Tape};
use twofold_num::{Aligned, Arithmetic, Elementary, Simd};

/// An autonomous ordinary differential equation x' = f(x) as data.
///
/// ```
/// use nalgebra::Vector3;
/// use twofold_system::{Field, System, Transition, VectorField, jacobian};
/// let caricature = System::builtin("caricature").expect("built in");
/// let smoothed = Field::smoothed(&caricature, Transition::Tanh, 1e-3);
/// let f = smoothed.bind::<3>()?;
/// assert_eq!(f.eval(&Vector3::new(1.0, 0.5, 0.0))[0], -0.5); // far from the layer: f+
/// // Orbit and two tangent vectors together, in nine dimensions:
/// let tangent = smoothed.variational(2);
/// assert_eq!((tangent.dimension(), tangent.names()[3].as_str()), (9, "d1_x"));
/// # Ok::<(), twofold_system::BindError>(())
/// ```
#[derive(Clone)]
pub struct Field {
    names: Vec<String>,
    tape: Arc<Tape>,
    program: Arc<Program>,
    /// Made from a system with two surfaces, by a transform that knows one: it is not evaluated.
    of_one_surface: bool,
}

impl fmt::Debug for Field {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Field").field("names", &self.names).field("tape", &self.tape).finish()
    }
}

impl PartialEq for Field {
    fn eq(&self, other: &Self) -> bool {
        self.names == other.names && self.tape == other.tape
    }
}

/// One of a system's two smooth fields.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Half {
    Plus,
    Minus,
}

/// A system's functions at a point of another recording, each component written when it is asked
/// for.
struct Parts<'a> {
    replay: Replay<'a>,
    dimension: usize,
}

impl<'a> Parts<'a> {
    fn new(system: &'a System, x: &[Recorded]) -> Self {
        Self { replay: Replay::new(system.tape(), x), dimension: x.len() }
    }

    fn switching(&mut self) -> Recorded {
        self.replay.output(0)
    }

    fn half(&mut self, half: Half) -> Vec<Recorded> {
        let first = 1 + if half == Half::Plus { 0 } else { self.dimension };
        self.components(first)
    }

    fn components(&mut self, first: usize) -> Vec<Recorded> {
        (first..first + self.dimension).map(|i| self.replay.output(i)).collect()
    }

    /// f- + (f+ - f-) phi, eq. (8).
    fn blend(&mut self, phi: Recorded) -> Vec<Recorded> {
        let plus = self.half(Half::Plus);
        let minus = self.half(Half::Minus);
        blended(minus, plus, phi)
    }

    /// The same where the second switching function is negative.
    fn blend_below(&mut self, phi: Recorded) -> Vec<Recorded> {
        let n = self.dimension;
        let plus = self.components(2 * n + 2);
        let minus = self.components(3 * n + 2);
        blended(minus, plus, phi)
    }

    /// The second switching function.
    fn second_switching(&mut self) -> Recorded {
        self.replay.output(2 * self.dimension + 1)
    }
}

fn blended(minus: Vec<Recorded>, plus: Vec<Recorded>, phi: Recorded) -> Vec<Recorded> {
    minus.into_iter().zip(plus).map(|(m, p)| m + (p - m) * phi).collect()
}

impl Field {
    fn made(names: Vec<String>, tape: Tape) -> Self {
        let tape = tape.with_names(names.iter().cloned());
        Self {
            names,
            program: Arc::new(Program::new(&tape)),
            tape: Arc::new(tape),
            of_one_surface: false,
        }
    }

    /// A transform that knows one surface, of this system.
    fn one_surface(system: &System, names: Vec<String>, tape: Tape) -> Self {
        Self { of_one_surface: system.definition().second().is_some(), ..Self::made(names, tape) }
    }

    fn names_of(system: &System) -> Vec<String> {
        system.coordinates().into_iter().map(Into::into).collect()
    }

    /// The smoothed system, eq. (8): x' = f- + (f+ - f-) phi(h, eps). Two switches are smoothed one
    /// inside the other, each by its own function: the weights of the four fields are the products
    /// of phi and 1 - phi.
    pub fn smoothed(system: &System, transition: Transition, eps: f64) -> Self {
        let tape = Tape::record(system.dimension(), |x| {
            let mut parts = Parts::new(system, x);
            let eps = Recorded::parameter("eps", &eps.into());
            let phi = transition.record(parts.switching(), eps);
            let above = parts.blend(phi);
            if system.definition().second().is_none() {
                return above;
            }
            let below = parts.blend_below(phi);
            let phi = transition.record(parts.second_switching(), eps);
            blended(below, above, phi)
        });
        Self::made(Self::names_of(system), tape)
    }

    /// The hysteretic system, eqs (8) and (10), with phi as last state.
    pub fn hysteretic(system: &System, eps: f64, eps_prime: f64, relaxation: Relaxation) -> Self {
        let n = system.dimension();
        let tape = Tape::record(n + 1, |state| {
            let mut parts = Parts::new(system, &state[..n]);
            let phi = state[n];
            let mut motion = parts.blend(phi);
            let eps = Recorded::parameter("eps", &eps.into());
            let eps_prime = Recorded::parameter("eps_prime", &eps_prime.into());
            motion.push(relaxation.record(parts.switching(), phi, eps, eps_prime));
            motion
        });
        let mut names = Self::names_of(system);
        names.push(free_name("phi", &names));
        Self::one_surface(system, names, tape)
    }

    /// f+, continued smoothly across the surface.
    pub fn plus(system: &System) -> Self {
        Self::half(system, Half::Plus)
    }

    /// f-, continued smoothly across the surface.
    pub fn minus(system: &System) -> Self {
        Self::half(system, Half::Minus)
    }

    fn half(system: &System, half: Half) -> Self {
        let tape = Tape::record(system.dimension(), |x| Parts::new(system, x).half(half));
        Self::one_surface(system, Self::names_of(system), tape)
    }

    /// The desingularised sliding flow with physical time as last state, (x, t)' = (L-h f+ - L+h
    /// f-, L-h - L+h): smooth everywhere, zero at a two-fold. Time runs forward in the attracting
    /// region and backward in the repelling one.
    pub fn sliding(system: &System) -> Self {
        let n = system.dimension();
        let tape = Tape::record(n + 1, |state| {
            let x = &state[..n];
            let switching = system.tape().select([0]);
            let mut h = Replay::new(&switching, x);
            let gradient: Vec<Option<Recorded>> = (0..n)
                .map(|i| {
                    let direction: Vec<_> = (0..n).map(|j| (i == j).then(Recorded::one)).collect();
                    h.derivatives(&direction)[0]
                })
                .collect();
            let mut parts = Parts::new(system, x);
            let (plus, minus) = (parts.half(Half::Plus), parts.half(Half::Minus));
            let along = |f: &[Recorded]| {
                let mut sum: Option<Recorded> = None;
                for (g, f) in gradient.iter().zip(f) {
                    if let Some(g) = g {
                        let term = *g * *f;
                        sum = Some(sum.map_or(term, |s| s + term));
                    }
                }
                sum.unwrap_or(Recorded::zero())
            };
            let (p, q) = (along(&plus), along(&minus));
            let mut flow: Vec<Recorded> =
                plus.iter().zip(&minus).map(|(a, b)| q * *a - p * *b).collect();
            flow.push(q - p);
            flow
        });
        let mut names = Self::names_of(system);
        names.push(free_name("t", &names));
        Self::one_surface(system, names, tape)
    }

    /// The same equation with time running backwards.
    pub fn reversed(&self) -> Self {
        let tape = Tape::record(self.dimension(), |x| {
            let mut field = Replay::new(&self.tape, x);
            (0..self.dimension()).map(|i| -field.output(i)).collect()
        });
        Self { of_one_surface: self.of_one_surface, ..Self::made(self.names.clone(), tape) }
    }

    /// The equation together with its variational equation, (x, V)' = (f(x), Df(x) V), for
    /// `vectors` tangent vectors that stand after x one after another.
    pub fn variational(&self, vectors: usize) -> Self {
        let n = self.dimension();
        let tape = Tape::record(n * (vectors + 1), |state| {
            let mut field = Replay::new(&self.tape, &state[..n]);
            let mut all: Vec<Recorded> = (0..n).map(|i| field.output(i)).collect();
            for v in state[n..].chunks(n) {
                let direction: Vec<Option<Recorded>> = v.iter().copied().map(Some).collect();
                all.extend(
                    field
                        .derivatives(&direction)
                        .into_iter()
                        .map(|d| d.unwrap_or(Recorded::zero())),
                );
            }
            all
        });
        let tangent = |j: usize| self.names.iter().map(move |name| format!("d{j}_{name}"));
        let names = self.names.iter().cloned().chain((1..=vectors).flat_map(tangent)).collect();
        Self { of_one_surface: self.of_one_surface, ..Self::made(names, tape) }
    }

    /// Any compiled equation as data.
    pub fn record<F: VectorField<N>, const N: usize>(names: [&str; N], field: &F) -> Self {
        Self::made(names.map(Into::into).to_vec(), Tape::clone(&field.tape()))
    }

    /// Whether the two equations differ in numbers alone: in the values of parameters, in the width
    /// of a layer.
    pub fn is_like(&self, other: &Self) -> bool {
        self.of_one_surface == other.of_one_surface && self.program.is_like(&other.program)
    }

    /// Number of states.
    pub fn dimension(&self) -> usize {
        self.tape.variables()
    }

    /// Names of the states.
    pub fn names(&self) -> &[String] {
        &self.names
    }

    /// The right-hand side as operations.
    pub fn tape(&self) -> &Arc<Tape> {
        &self.tape
    }

    /// Writes f(x) into `out`.
    ///
    /// # Panics
    /// If `x` or `out` do not have the equation's dimension.
    pub fn evaluate<S: Elementary>(&self, x: &[S], out: &mut [S]) {
        self.program.evaluate(x, out);
    }

    /// The equation as a [`VectorField`] in `N` dimensions.
    ///
    /// # Errors
    /// If the equation has not `N` states, or was made by a transform for one switching surface
    /// from a system with two.
    pub fn bind<const N: usize>(&self) -> Result<BoundField<N>, BindError> {
        if self.of_one_surface {
            return Err(BindError::TwoSurfaces);
        }
        if self.dimension() == N {
            Ok(BoundField { tape: self.tape.clone(), program: self.program.clone() })
        } else {
            Err(BindError::Dimension { states: self.dimension(), asked: N })
        }
    }
}

/// `name`, with underscores if it is taken.
fn free_name(name: &str, taken: &[String]) -> String {
    let mut name = name.to_string();
    while taken.contains(&name) {
        name.push('_');
    }
    name
}

/// A [`Field`] in `N` dimensions. A clone shares the equations.
#[derive(Clone, Debug)]
pub struct BoundField<const N: usize> {
    tape: Arc<Tape>,
    program: Arc<Program>,
}

impl<const N: usize> BoundField<N> {
    pub(super) fn program(&self) -> &Program {
        &self.program
    }
}

impl<const N: usize> VectorField<N> for BoundField<N> {
    const INTERPRETED: bool = true;
    #[inline]
    fn eval<S: Elementary>(&self, x: &SVector<S, N>) -> SVector<S, N> {
        run(&self.program, x)
    }
    fn scratch_len(&self) -> usize {
        self.program.scratch_len()
    }
    #[inline(always)]
    fn eval_in_registers<S: Simd, const K: usize>(
        &self,
        set: S,
        x: [[S::f64s; K]; N],
        scratch: &mut [Aligned<[S::f64s; K]>],
    ) -> [[S::f64s; K]; N] {
        self.program.evaluate_in_registers(set, x, scratch)
    }
    fn tape(&self) -> Arc<Tape> {
        self.tape.clone()
    }
}
