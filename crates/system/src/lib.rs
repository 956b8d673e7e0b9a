//! The equations, and no time stepping.
//!
//! Two nouns carry everything. A [`VectorField`] is an ordinary autonomous differential equation x'
//! = f(x). A [`PiecewiseSmooth`] system is two of them and a switching function h: f+ where h > 0,
//! f- where h < 0. It is not a vector field: on h = 0 its motion is defined by Filippov's
//! convention ([`filippov`]) and at a two-fold it is set-valued.
//!
//! Both exist as data of any dimension: a [`Definition`] is read from a file, a [`System`] is a
//! definition with values for its parameters, and a [`Field`] is an equation made from a system by
//! smoothing, hysteresis, time reversal or sliding, with or without tangent vectors. [`library`]
//! holds the built-in ones. Bound to a dimension ([`System::bind`], [`Field::bind`]) they are
//! evaluated over any number type.
//!
//! The paper's own, [`Caricature`], exists as Rust too, with [`Smoothed`] and [`Hysteretic`] on
//! top: a fast path, tested to give the bits of its file. Equations in Rust are generic over
//! [`Elementary`], so that each is written once.
#![forbid(unsafe_code)]
// tests compare with tolerances, not with hashes
#![cfg_attr(test, allow(clippy::disallowed_methods))]

mod batched;
pub mod caricature;
pub mod definition;
pub mod diagnostic;
pub mod document;
pub mod expression;
pub mod field;
pub mod filippov;
pub mod hysteretic;
pub mod instance;
pub mod library;
mod own_side;
pub mod reversed;
pub mod singular;
pub mod smoothed;
pub mod transition;

use std::sync::Arc;

use nalgebra::{SMatrix, SVector};

use twofold_num::tape::Recorded;
use twofold_num::{Aligned, Dual, Elementary, Registers, Simd, Tape};

pub use batched::{BatchedField, ParameterBatch};
pub use caricature::Caricature;
pub use definition::Definition;
pub use diagnostic::Diagnostic;
pub use document::Canonical;
pub use expression::Expression;
pub use field::{BoundField, Field};
pub use hysteretic::{Hysteretic, Relaxation};
pub use instance::{BindError, Bound, ParameterError, System};
pub use reversed::Reversed;
pub use smoothed::{Blended, Smoothed};
pub use transition::Transition;

/// An autonomous ordinary differential equation x' = f(x) in `N` dimensions.
///
/// ```
/// use nalgebra::{SVector, Vector2};
/// use twofold_num::Elementary;
/// use twofold_system::{VectorField, jacobian};
///
/// /// A damped oscillator, x'' = -x - x'/2.
/// struct Oscillator;
/// impl VectorField<2> for Oscillator {
///     fn eval<S: Elementary>(&self, x: &SVector<S, 2>) -> SVector<S, 2> {
///         Vector2::new(x[1], -x[0] - x[1] * S::from_f64(0.5))
///     }
/// }
/// assert_eq!(Oscillator.eval(&Vector2::new(1.0, 2.0)), Vector2::new(2.0, -2.0));
/// assert_eq!(jacobian(&Oscillator, &Vector2::new(1.0, 2.0))[(1, 1)], -0.5);
/// # use twofold_num::Arithmetic;
/// ```
pub trait VectorField<const N: usize>: Sync {
    /// Whether [`VectorField::eval`] interprets a program. A method then calls it through a
    /// pointer, which costs nothing beside the interpreter, and is compiled once for all such
    /// equations.
    #[doc(hidden)]
    const INTERPRETED: bool = false;
    /// The right-hand side f(x).
    fn eval<S: Elementary>(&self, x: &SVector<S, N>) -> SVector<S, N>;
    /// Number of register bundles that [`VectorField::eval_in_registers`] needs for intermediate
    /// results: a power of two, or 0.
    #[doc(hidden)]
    fn scratch_len(&self) -> usize {
        0
    }
    /// The right-hand side at several states side by side, in the registers of an instruction set:
    /// in every lane the bits of [`VectorField::eval`].
    #[doc(hidden)]
    #[inline(always)]
    fn eval_in_registers<S: Simd, const K: usize>(
        &self,
        set: S,
        x: [[S::f64s; K]; N],
        _room: &mut [Aligned<[S::f64s; K]>],
    ) -> [[S::f64s; K]; N] {
        // Loops by number: closures may stay calls, compiled for the wrong instruction set.
        let mut state = SVector::<Registers<S, K>, N>::from_element(Registers::splat(set, 0.0));
        for i in 0..N {
            state[i] = Registers::new(set, x[i]);
        }
        let f = self.eval(&state);
        let mut parts = x;
        for i in 0..N {
            parts[i] = f[i].parts();
        }
        parts
    }
    /// The right-hand side as data. Made by recording [`VectorField::eval`], unless the equation is
    /// data already.
    fn tape(&self) -> Arc<Tape> {
        let record =
            |x: &[Recorded]| self.eval(&SVector::<_, N>::from_column_slice(x)).as_slice().to_vec();
        Arc::new(Tape::record(N, record))
    }
}

/// A system that switches between two smooth vector fields on the surface h = 0 (the paper's eq.
/// 3).
///
/// ```
/// use nalgebra::{SVector, Vector2};
/// use twofold_num::Elementary;
/// use twofold_system::PiecewiseSmooth;
/// use twofold_system::filippov::{Region, region};
///
/// /// x' = -1 where x > 0, x' = 1 where x < 0; y' = 1 on both sides.
/// struct Relay;
/// impl PiecewiseSmooth<2> for Relay {
///     fn switching<S: Elementary>(&self, x: &SVector<S, 2>) -> S {
///         x[0]
///     }
///     fn plus<S: Elementary>(&self, _: &SVector<S, 2>) -> SVector<S, 2> {
///         Vector2::new(-S::one(), S::one())
///     }
///     fn minus<S: Elementary>(&self, _: &SVector<S, 2>) -> SVector<S, 2> {
///         Vector2::new(S::one(), S::one())
///     }
/// }
/// assert_eq!(region(&Relay, &Vector2::new(0.0, 3.0)), Region::Attracting);
/// # use twofold_num::Arithmetic;
/// ```
pub trait PiecewiseSmooth<const N: usize>: Sync {
    /// As [`VectorField::INTERPRETED`].
    #[doc(hidden)]
    const INTERPRETED: bool = false;
    /// The switching function h(x). The surface h = 0 must be regular: grad h not zero on it.
    fn switching<S: Elementary>(&self, x: &SVector<S, N>) -> S;
    /// The vector field f+ that holds where h > 0; smooth and defined on both sides.
    fn plus<S: Elementary>(&self, x: &SVector<S, N>) -> SVector<S, N>;
    /// The vector field f- that holds where h < 0; smooth and defined on both sides.
    fn minus<S: Elementary>(&self, x: &SVector<S, N>) -> SVector<S, N>;
    /// Degrees of the polynomials that h and both fields are, as [`Tape::degree`] counts them;
    /// `None` where they are not known to be polynomials.
    #[doc(hidden)]
    fn degrees(&self) -> Option<[u32; 2]> {
        None
    }
    /// The states' names, which messages use; empty if none were given.
    fn names(&self) -> Vec<String> {
        Vec::new()
    }
}

/// The point x as independent variables for differentiation.
pub fn variables<S: Elementary, const N: usize>(x: &SVector<S, N>) -> SVector<Dual<S, N>, N> {
    SVector::from_fn(|i, _| Dual::variable(x[i], i))
}

/// The Jacobian matrix df_i/dx_j, exact to rounding (forward differentiation of the equation
/// itself).
pub fn jacobian<F: VectorField<N>, const N: usize>(
    field: &F,
    x: &SVector<f64, N>,
) -> SMatrix<f64, N, N> {
    let f = field.eval(&variables(x));
    SMatrix::from_fn(|i, j| f[i].partials[j])
}
