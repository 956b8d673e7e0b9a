//! Series of equations that are compiled in advance.
//!
//! Interpreting a list of recurrences costs a jump for each, about as long as the recurrence
//! itself. One equation is compiled in advance: the smoothed normal form of a two-fold with
//! re-injection (Jeffrey 2013, eqs (4), (5) and (8)):
//!
//! ```text
//! f- + (f+ - f-) phi,  phi = (1 + tanh(x/eps))/2
//! f+ = (-y, 1,  v+) + (0, alpha - beta y, alpha - beta z) |x|^2
//! f- = ( z, v-, 1 ) + (0, alpha - beta y, alpha - beta z) |x|^2
//! ```
//!
//! Its recurrences and plans are lists here: an equation is compared with them, and they are
//! compiled. Other equations are interpreted, with the same bits, since both ways run each
//! recurrence by [`begin`] and each instruction by [`carry_out`].

use super::instruction::{Action, Instruction, Saturated, begin, carry_out};
use super::table::{ROW, Table};
use super::{Recurrence, Series};

/// The numbers of a list's entries, each at the place of the series that the entry is for; zero
/// where there is none.
type Numbers = [f64; ROW];

fn numbers(given: impl Iterator<Item = (Series, f64)>) -> Numbers {
    let mut numbers = [0.0; ROW];
    for (to, number) in given {
        numbers[to % ROW] = number;
    }
    numbers
}

/// The first coefficients of an equation's series, compiled: those of degree 0, and those of degree
/// 1 of the state.
#[derive(Clone, Copy, Debug)]
pub(super) struct Opening {
    numbers: Numbers,
}

/// The further coefficients, compiled: a [`SeriesPlan`](super::plan::SeriesPlan).
#[derive(Clone, Copy, Debug)]
pub(super) struct Compiled {
    shape: Shape,
    numbers: Numbers,
}

impl Compiled {
    /// The compiled form of a plan, if it has one.
    pub fn of(instructions: &[Instruction<f64>], derivatives: &[Series]) -> Option<Self> {
        let shape = Shape::of(instructions, derivatives)?;
        Some(Self {
            shape,
            numbers: numbers(instructions.iter().map(|given| (given.to, given.number()))),
        })
    }

    /// See [`advance`](super::plan::advance).
    #[inline(always)]
    pub fn advance(&self, table: &mut impl Table<f64>) {
        self.shape.advance(&self.numbers, table);
    }
}

/// An entry of a list: its series, and the current number where the list names one.
macro_rules! entry {
    ($kind:ident::$name:ident($($series:literal),* $(; $number:ident)?), $value:expr) => {
        $kind::$name($($series,)* $(entry!($number = $value))?)
    };
    ($number:ident = $value:expr) => {
        $value
    };
}

macro_rules! opening {
    (dimension $dimension:literal outputs $outputs:tt {
        $($name:ident $arguments:tt -> $to:literal,)* }) => {
        impl Opening {
            /// The compiled form of an equation, if it has one.
            pub fn of(
                dimension: usize,
                recurrences: &[Recurrence<f64>],
                outputs: &[Series],
            ) -> Option<Self> {
                let mut given = recurrences.iter();
                let same = dimension == $dimension && outputs == $outputs
                    $(&& given.next().is_some_and(|given| {
                        *given == entry!(Recurrence::$name $arguments, given.number())
                    }))*
                    && given.next().is_none();
                let values = recurrences.iter().map(Recurrence::number);
                same.then(|| Self { numbers: numbers((dimension..).zip(values)) })
            }

            /// See [`start`](super::plan::start).
            #[inline(always)]
            pub fn start(&self, table: &mut impl Table<f64>) -> u64 {
                let mut saturated = Saturated::default();
                $(
                    let recurrence = entry!(Recurrence::$name $arguments, self.numbers[$to]);
                    begin(&recurrence, $to, table, &mut saturated);
                )*
                for (i, output) in $outputs.into_iter().enumerate() {
                    table.set_next(i, table.get(output, 0));
                }
                saturated.bits
            }
        }
    };
}

macro_rules! shapes {
    ($($(#[$doc:meta])* $shape:ident derivatives $derivatives:tt {
        $($name:ident $arguments:tt -> $to:literal,)* })*) => {
        /// A plan but for the numbers in it.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        enum Shape {
            $($(#[$doc])* $shape,)*
        }

        impl Shape {
            fn of(instructions: &[Instruction<f64>], derivatives: &[Series]) -> Option<Self> {
                $({
                    let mut given = instructions.iter();
                    let same = derivatives == $derivatives
                        $(&& given.next().is_some_and(|given| {
                            *given == Instruction { action: entry!(Action::$name $arguments,
                                given.number()), to: $to }
                        }))*
                        && given.next().is_none();
                    if same {
                        return Some(Self::$shape);
                    }
                })*
                None
            }

            #[inline(always)]
            fn advance(self, numbers: &Numbers, table: &mut impl Table<f64>) {
                let next = (table.degree() + 1) as f64;
                match self {
                    $(Self::$shape => {
                        let this = 0.0;
                        $(
                            let instruction = Instruction { action: entry!(Action::$name $arguments,
                                numbers[$to]), to: $to };
                            let this = carry_out(instruction, this, table);
                        )*
                        let _ = this;
                        for (i, derivative) in $derivatives.into_iter().enumerate() {
                            table.set_next(i, table.at(derivative) / next);
                        }
                    })*
                }
            }
        }
    };
}

// Series 0 to 2 are x, y, z; 5 is tanh(x/eps), 8 the transition function phi, 13 the square of the
// distance from the origin, 16 and 19 the pull, 20 to 22 f+, 2, 23 and 24 f-.
opening! {
    dimension 3 outputs [27, 30, 33] {
        Over(0; eps) -> 3,
        Weighted(3) -> 4,
        Tanh(3, 4) -> 5,
        TanhSlope(5, 3) -> 6,
        Shift(5; one) -> 7,
        Scale(7; half) -> 8,
        Mul(0, 0) -> 9,
        Mul(1, 1) -> 10,
        Add(9, 10) -> 11,
        Mul(2, 2) -> 12,
        Add(11, 12) -> 13,
        Scale(1; beta) -> 14,
        Minus(14; alpha) -> 15,
        Mul(15, 13) -> 16,
        Scale(2; beta) -> 17,
        Minus(17; alpha) -> 18,
        Mul(18, 13) -> 19,
        Neg(1) -> 20,
        Shift(16; one) -> 21,
        Shift(19; v_plus) -> 22,
        Shift(16; v_minus) -> 23,
        Shift(19; one) -> 24,
        Sub(20, 2) -> 25,
        Mul(25, 8) -> 26,
        Add(2, 26) -> 27,
        Sub(21, 23) -> 28,
        Mul(28, 8) -> 29,
        Add(23, 29) -> 30,
        Sub(22, 24) -> 31,
        Mul(31, 8) -> 32,
        Add(24, 32) -> 33,
    }
}

shapes! {
    /// Outside the layer, where tanh(x/eps) is +-1.
    TwoFoldOutside derivatives [27, 16, 19] {
        Over(0; eps) -> 3,
        ThreeSquares(0, 1, 2) -> 13,
        NegScale(1; beta) -> 15,
        Mul(15, 13) -> 16,
        NegScale(2; beta) -> 18,
        Mul(18, 13) -> 19,
        NegLess(1, 2) -> 25,
        PlusLiftThis(2, 8) -> 27,
    }

    /// Within the layer.
    TwoFoldInside derivatives [27, 30, 33] {
        Over(0; eps) -> 3,
        TanhThis(4) -> 5,
        ScaleThis(; half) -> 8,
        ThreeSquares(0, 1, 2) -> 13,
        NegScale(1; beta) -> 15,
        Mul(15, 13) -> 16,
        NegScale(2; beta) -> 18,
        Mul(18, 13) -> 19,
        NegLess(1, 2) -> 25,
        PlusMul(2, 25, 8) -> 27,
        PlusLift(16, 28, 8) -> 30,
        PlusLift(19, 31, 8) -> 33,
    }
}

#[cfg(test)]
mod tests {
    use super::super::plain::expanded;
    use super::super::{Constants, Solution};
    use crate::tape::Recorded;
    use crate::{Arithmetic, Elementary, Tape};

    /// Eq. (8) with the fields of eq. (5), the first component of f- being `sign` z.
    fn two_fold(sign: f64, eps: f64) -> Tape {
        let c = Recorded::from_f64;
        Tape::record(3, |x| {
            let phi = ((x[0] / c(eps)).tanh() + c(1.0)) * c(0.5);
            let r2 = x[0].squared() + x[1].squared() + x[2].squared();
            let (dy, dz) = ((c(0.3) - x[1] * c(0.7)) * r2, (c(0.3) - x[2] * c(0.7)) * r2);
            let plus = [-x[1], c(1.0) + dy, c(-1.2) + dz];
            let first = if sign < 0.0 { -x[2] } else { x[2] };
            let minus = [first, c(-1.4) + dy, c(1.0) + dz];
            (0..3).map(|i| minus[i] + (plus[i] - minus[i]) * phi).collect()
        })
    }

    #[test]
    fn the_two_fold_is_compiled_at_every_degree_and_has_the_bits_of_its_recurrences() {
        for degree in 1..=21 {
            for eps in [0.125, 1e-3] {
                let mut solution =
                    Solution::<f64>::new(degree, &two_fold(1.0, eps), Constants::Binary);
                for start in
                    [[0.3, 0.5, -0.7], [1e-3, -0.4, 0.9], [-0.4, 0.0, 1.1], [-2e-4, 0.6, 0.2]]
                {
                    solution.expand(&start);
                    assert!(solution.is_compiled(), "{solution:?}");
                    let wanted = expanded(&solution, &start);
                    for i in 0..3 {
                        assert_eq!(
                            solution.component(i),
                            wanted.component(i),
                            "degree {degree}, eps {eps}, {start:?}"
                        );
                    }
                    let arguments = |s: &Solution<f64>| {
                        format!("{:?}", s.layer_arguments().collect::<Vec<_>>())
                    };
                    assert_eq!(arguments(&solution), arguments(&wanted));
                }
            }
        }
    }

    #[test]
    fn another_equation_is_not_taken_for_it() {
        let mut other = Solution::<f64>::new(9, &two_fold(-1.0, 1e-3), Constants::Binary);
        other.expand(&[0.3, 0.5, -0.7]);
        assert!(other.opening.is_none() && other.plans.iter().all(|plan| plan.compiled.is_none()));
        // A solution that is given another equation forgets.
        let mut solution = Solution::<f64>::new(9, &two_fold(1.0, 1e-3), Constants::Binary);
        solution.expand(&[0.3, 0.5, -0.7]);
        assert!(solution.is_compiled());
        solution.set_tape(&two_fold(-1.0, 1e-3), Constants::Binary);
        solution.expand(&[0.3, 0.5, -0.7]);
        assert!(!solution.is_compiled());
        assert_eq!(solution.component(0), other.component(0));
    }
}
