//! A plan: the instructions of one equation for all degrees from 1 on.
//!
//! A recurrence gives all coefficients of a series. From degree 1 on parts of it are trivial:
//! constant summands vanish, sums and products of constants are zero, a product with a constant is
//! a scaling. A [`SeriesPlan`] omits these, and passes numbers from one instruction to the next
//! without storing them. The series of a saturated `tanh` is constant too; there is a plan for each
//! set of saturated `tanh` that occurs.
//!
//! Nothing is reassociated: every coefficient has the bits that its recurrence gives it (if all are
//! finite; an overflow in a series that drops out of the equation, as in (1 + a) - (2 + a), drops
//! out with it).

use std::any::Any;

use super::compiled::Compiled;
use super::instruction::{Action, Instruction, Saturated, begin, carry_out};
use super::table::{ROW, Rows, Table};
use super::{LayerKind, Mark, Recurrence, Series};
use crate::Elementary;

/// The coefficients of degree 0, from those of the state, and those of degree 1 of the state.
/// Returns which tanh are saturated, a bit each.
#[inline(always)]
pub(super) fn start<S: Elementary>(equation: &Equation<S>, table: &mut impl Table<S>) -> u64 {
    let mut saturated = Saturated::default();
    for (i, recurrence) in equation.recurrences.iter().enumerate() {
        begin(recurrence, equation.dimension + i, table, &mut saturated);
    }
    for (i, output) in equation.outputs.iter().enumerate() {
        table.set_next(i, table.get(*output, 0).over(1.0));
    }
    saturated.bits
}

/// Carries the instructions out at one degree.
#[inline(always)]
pub(super) fn advance<S: Elementary, T: Table<S>>(plan: &SeriesPlan<S>, table: &mut T) {
    let mut this = S::zero();
    for &instruction in &plan.instructions {
        this = carry_out(instruction, this, table);
    }
    let next = (table.degree() + 1) as f64;
    for (i, derivative) in plan.derivatives.iter().enumerate() {
        table.set_next(i, table.at(*derivative).over(next));
    }
}

/// Carries a plan out at degree `k`, on more rows than k + 1.
pub(super) fn advance_rows(plan: &SeriesPlan<f64>, rows: &mut [[f64; ROW]], k: usize) {
    macro_rules! by_length {
        ($($rows:literal)*) => {
            match k + 1 {
                $($rows => advance_in::<$rows>(plan, rows),)*
                _ => unreachable!("no rows for degree {k}"),
            }
        };
    }
    by_length!(2 3 4 5 6 7 8 9 10 11 12 13 14 15 16 17 18 19 20 21)
}

#[inline(never)]
fn advance_in<const T: usize>(plan: &SeriesPlan<f64>, rows: &mut [[f64; ROW]]) {
    if let Some((known, [next, ..])) = rows.split_first_chunk_mut::<T>() {
        let mut rows = Rows { known, next };
        match &plan.compiled {
            Some(compiled) => compiled.advance(&mut rows),
            None => advance(plan, &mut rows),
        }
    }
}

/// The kind of a series' coefficients from degree 1 on.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Tail {
    /// Computed.
    Own,
    /// Those of a series that is computed.
    Same(Series),
    /// Positive zero.
    Zero,
}

/// An equation as recurrences, for [`SeriesPlan::new`].
pub(super) struct Equation<'a, S> {
    pub dimension: usize,
    pub recurrences: &'a [Recurrence<S>],
    /// The series of the components' derivatives.
    pub outputs: &'a [Series],
    /// Series that others will read.
    pub layer_arguments: &'a [(LayerKind, Series)],
    pub marks: &'a [Mark],
}

/// See the [module](self).
#[derive(Clone, Debug)]
pub(super) struct SeriesPlan<S> {
    /// Saturated `tanh`, one bit each, in the order of their recurrences.
    pub saturated: u64,
    instructions: Vec<Instruction<S>>,
    /// Series of the components' derivatives.
    derivatives: Vec<Series>,
    /// The same compiled, if that is so.
    pub compiled: Option<Compiled>,
}

impl<S: Elementary> SeriesPlan<S> {
    /// The plan for an equation with these `tanh` saturated.
    pub fn new(equation: &Equation<S>, saturated: u64) -> Self {
        let tails = Tails::new(equation, saturated);
        let mut planner =
            Planner { equation, tails: &tails, instructions: Vec::new(), at_hand: None };
        planner.clear();
        for (i, recurrence) in equation.recurrences.iter().enumerate() {
            let this = equation.dimension + i;
            if tails.uses[this] > 0 {
                match tails.of[this] {
                    Tail::Own => planner.compute(*recurrence, this),
                    Tail::Same(a) => planner.copy(a, this),
                    // Zero from the start.
                    Tail::Zero => {}
                }
            }
        }
        let derivatives: Vec<_> =
            equation.outputs.iter().map(|output| tails.place(*output)).collect();
        let instructions = planner.instructions;
        let compiled = (&instructions as &dyn Any)
            .downcast_ref::<Vec<Instruction<f64>>>()
            .and_then(|instructions| Compiled::of(instructions, &derivatives));
        Self { saturated, instructions, derivatives, compiled }
    }
}

/// Properties of all series that are known in advance.
struct Tails {
    of: Vec<Tail>,
    /// Whether coefficients from degree 1 on are sums that began with zero, which are never
    /// negative zeros.
    sums: Vec<bool>,
    /// By how many the coefficients are read where they belong.
    uses: Vec<usize>,
}

impl Tails {
    fn new<S: Elementary>(equation: &Equation<S>, saturated: u64) -> Self {
        let states = equation.dimension;
        let count = states + equation.recurrences.len();
        let mut tails =
            Self { of: vec![Tail::Own; states], sums: vec![false; states], uses: vec![0; count] };
        let mut tanh = 0;
        for recurrence in equation.recurrences {
            let flat = match recurrence {
                Recurrence::Tanh(..) => {
                    tanh += 1;
                    tanh <= u64::BITS && saturated >> (tanh - 1) & 1 == 1
                }
                _ => false,
            };
            let tail = if flat { Tail::Zero } else { tails.tail(recurrence) };
            let sum = tails.is_sum(recurrence);
            tails.sums.push(sum);
            tails.of.push(tail);
        }
        tails.count(equation);
        tails
    }

    fn is_zero(&self, series: Series) -> bool {
        self.of[series] == Tail::Zero
    }

    /// Series whose coefficients equal those of `series`, from degree 1 on.
    fn place(&self, series: Series) -> Series {
        match self.of[series] {
            Tail::Same(other) => other,
            Tail::Own | Tail::Zero => series,
        }
    }

    /// The tail of a series that has another's.
    fn same(&self, a: Series) -> Tail {
        match self.of[a] {
            Tail::Own => Tail::Same(a),
            known => known,
        }
    }

    fn tail<S: Elementary>(&self, recurrence: &Recurrence<S>) -> Tail {
        match *recurrence {
            Recurrence::Shift(a, _) => return self.same(a),
            Recurrence::Constant(_) | Recurrence::Sign(_) => return Tail::Zero,
            _ => {}
        }
        if !S::EXACT_ZEROS {
            return Tail::Own;
        }
        // Positive and finite.
        let keeps_zero =
            |c: S| c != S::zero() && c * S::zero() == S::zero() && c.sign() == S::one();
        match *recurrence {
            Recurrence::Add(a, b) if self.is_zero(b) && (self.is_zero(a) || self.sums[a]) => {
                self.same(a)
            }
            Recurrence::Add(a, b) if self.is_zero(a) && self.sums[b] => self.same(b),
            Recurrence::Sub(a, b) if self.is_zero(b) => self.same(a),
            Recurrence::Sub(a, b) if self.place(a) == self.place(b) => Tail::Zero,
            Recurrence::Scale(a, c) | Recurrence::Over(a, c)
                if self.is_zero(a) && keeps_zero(c) =>
            {
                Tail::Zero
            }
            Recurrence::Mul(a, b) if self.is_zero(a) && self.is_zero(b) => Tail::Zero,
            Recurrence::Exp(a, _) | Recurrence::Tanh(a, _) if self.is_zero(a) => Tail::Zero,
            _ => Tail::Own,
        }
    }

    fn is_sum<S>(&self, recurrence: &Recurrence<S>) -> bool {
        match *recurrence {
            Recurrence::Mul(..) => true,
            Recurrence::Add(a, b) => self.sums[a] || self.sums[b],
            Recurrence::Shift(a, _) => self.sums[a],
            _ => false,
        }
    }

    /// Finds the series that are read, from the end to the beginning: a series that is not read,
    /// reads none.
    fn count<S: Elementary>(&mut self, equation: &Equation<S>) {
        for output in equation.outputs {
            self.read(self.place(*output));
        }
        for (_, series) in equation.layer_arguments {
            self.read(*series);
        }
        for mark in equation.marks {
            self.read(mark.argument);
        }
        for (i, recurrence) in equation.recurrences.iter().enumerate().rev() {
            let this = equation.dimension + i;
            if self.uses[this] > 0 {
                match self.of[this] {
                    Tail::Own => self.count_arguments(recurrence, this),
                    Tail::Same(a) => self.read(a),
                    Tail::Zero => {}
                }
            }
        }
    }

    fn read(&mut self, series: Series) {
        self.uses[series] += 1;
    }

    /// Only coefficients of the same degree are read wherever they are.
    fn count_arguments<S: Elementary>(&mut self, recurrence: &Recurrence<S>, this: Series) {
        match *recurrence {
            Recurrence::Mul(a, b) if S::EXACT_ZEROS && self.is_zero(a) => self.read(self.place(b)),
            Recurrence::Mul(a, b) if S::EXACT_ZEROS && self.is_zero(b) => self.read(self.place(a)),
            Recurrence::Mul(a, b) => {
                self.read(a);
                self.read(b);
            }
            Recurrence::Div(a, b) => {
                self.read(self.place(a));
                self.read(b);
            }
            Recurrence::Add(a, b) | Recurrence::Sub(a, b) => {
                self.read(self.place(a));
                self.read(self.place(b));
            }
            Recurrence::Neg(a)
            | Recurrence::Minus(a, _)
            | Recurrence::Scale(a, _)
            | Recurrence::Over(a, _)
            | Recurrence::Sqrt(a)
            | Recurrence::Exp(a, _)
            | Recurrence::Tanh(a, _)
            | Recurrence::Sin(a, _) => self.read(self.place(a)),
            Recurrence::Ln(a) | Recurrence::OnePlusSquare(a) => self.read(a),
            Recurrence::Atan(a) | Recurrence::Erf(a, _) => {
                self.read(self.place(a));
                self.read(this - 1);
            }
            // Computed with the one before.
            Recurrence::TanhSlope(..) | Recurrence::Cos(..) => self.read(this - 1),
            Recurrence::Constant(_)
            | Recurrence::Sign(_)
            | Recurrence::Shift(..)
            | Recurrence::Weighted(_) => {}
        }
    }
}

/// Writes the instructions down.
struct Planner<'a, S> {
    equation: &'a Equation<'a, S>,
    tails: &'a Tails,
    instructions: Vec<Instruction<S>>,
    /// The series whose coefficient is the current number.
    at_hand: Option<Series>,
}

impl<S: Elementary> Planner<'_, S> {
    fn put(&mut self, action: Action<S>, to: Series) {
        self.instructions.push(Instruction { action, to });
        self.at_hand = Some(to);
    }

    /// Constant series that are read. Another plan may have written to them.
    fn clear(&mut self) {
        for this in self.equation.dimension..self.tails.of.len() {
            if self.tails.is_zero(this) && self.tails.uses[this] > 0 {
                self.put(Action::Clear, this);
            }
        }
    }

    fn copy(&mut self, a: Series, this: Series) {
        self.put(if self.at_hand == Some(a) { Action::Keep } else { Action::Copy(a) }, this);
    }

    fn compute(&mut self, recurrence: Recurrence<S>, this: Series) {
        let place = |a: Series| self.tails.place(a);
        let at_hand = |a: Series| self.at_hand == Some(self.tails.place(a));
        let zero = |a: Series| S::EXACT_ZEROS && self.tails.is_zero(a);
        let action = match recurrence {
            Recurrence::Neg(a) | Recurrence::Minus(a, _) if at_hand(a) => Action::NegThis,
            Recurrence::Neg(a) | Recurrence::Minus(a, _) => Action::Neg(place(a)),
            Recurrence::Add(a, b) if at_hand(a) => Action::ThisPlus(place(b)),
            Recurrence::Add(a, b) if at_hand(b) => Action::PlusThis(place(a)),
            Recurrence::Add(a, b) => Action::Add(place(a), place(b)),
            Recurrence::Sub(a, b) if at_hand(a) => Action::ThisLess(place(b)),
            Recurrence::Sub(a, b) if at_hand(b) => Action::LessThis(place(a)),
            Recurrence::Sub(a, b) => Action::Sub(place(a), place(b)),
            Recurrence::Scale(a, c) if at_hand(a) => Action::ScaleThis(c),
            Recurrence::Scale(a, c) => Action::Scale(place(a), c),
            Recurrence::Over(a, c) if at_hand(a) => Action::ThisOver(c),
            Recurrence::Over(a, c) => Action::Over(place(a), c),
            Recurrence::Mul(a, b) if zero(a) && at_hand(b) => Action::LiftThis(a),
            Recurrence::Mul(a, b) if zero(b) && at_hand(a) => Action::LiftThis(b),
            Recurrence::Mul(a, b) if zero(a) => Action::Lift(a, place(b)),
            Recurrence::Mul(a, b) if zero(b) => Action::Lift(b, place(a)),
            Recurrence::Mul(a, b) if a == b => Action::Square(a),
            Recurrence::Mul(a, b) => Action::Mul(a, b),
            Recurrence::Div(a, b) => Action::Div(place(a), b),
            Recurrence::Exp(a, weights) => Action::Exp(place(a), weights),
            Recurrence::Ln(a) => Action::Ln(a),
            Recurrence::Sqrt(a) => Action::Sqrt(place(a)),
            Recurrence::Tanh(a, weights) if at_hand(a) => Action::TanhThis(weights),
            Recurrence::Tanh(a, weights) => Action::Tanh(place(a), weights),
            Recurrence::Sin(a, weights) => Action::Sin(place(a), weights),
            Recurrence::OnePlusSquare(a) => Action::Square(a),
            Recurrence::Atan(a) => Action::Atan(place(a)),
            Recurrence::Erf(a, weights) => Action::Erf(place(a), weights),
            // Computed with the tanh or sine before them, or by those who need weights.
            Recurrence::TanhSlope(..) | Recurrence::Cos(..) | Recurrence::Weighted(_) => return,
            Recurrence::Constant(_) | Recurrence::Sign(_) | Recurrence::Shift(..) => {
                unreachable!("what is constant or a copy is not computed")
            }
        };
        let action = self.fused(action);
        self.put(action, this);
    }

    /// Merges the last instruction with this one, if they are a known pair and the last one's
    /// result has no other use; and so on.
    fn fused(&mut self, action: Action<S>) -> Action<S> {
        let (last, to) = match self.instructions.last() {
            Some(last) if self.tails.uses[last.to] == 1 => (last.action, last.to),
            _ => return action,
        };
        let fused = match (last, action) {
            (Action::Scale(a, c), Action::NegThis) => Action::NegScale(a, c),
            (Action::Neg(a), Action::ThisLess(b)) => Action::NegLess(a, b),
            (Action::Scale(b, c), Action::PlusThis(a)) => Action::PlusScale(a, b, c),
            (Action::Scale(b, c), Action::LessThis(a)) => Action::LessScale(a, b, c),
            (Action::Mul(b, c), Action::PlusThis(a)) => Action::PlusMul(a, b, c),
            (Action::Mul(b, c), Action::LessThis(a)) => Action::LessMul(a, b, c),
            (Action::Mul(a, b), Action::ThisPlus(c)) => Action::MulPlus(a, b, c),
            (Action::Mul(a, b), Action::ThisLess(c)) => Action::MulLess(a, b, c),
            (Action::Square(b), Action::PlusThis(a)) => Action::PlusSquare(a, b),
            (Action::Square(a), Action::PlusSquare(x, b)) if x == to => Action::Squares(a, b),
            (Action::Squares(a, b), Action::PlusSquare(x, c)) if x == to => {
                Action::ThreeSquares(a, b, c)
            }
            (Action::Lift(c, b), Action::PlusThis(a)) => Action::PlusLift(a, c, b),
            (Action::LiftThis(c), Action::PlusThis(a)) => Action::PlusLiftThis(a, c),
            _ => return action,
        };
        self.instructions.pop();
        self.fused(fused)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::super::plain::{equation, expanded};
    use super::super::{Constants, Solution};
    use super::*;
    use crate::tape::Recorded;
    use crate::{Arithmetic, DoubleDouble, Dual, FromDecimal, Interval, MultiFloat, Tape};

    const DEGREE: usize = 13;

    /// The coefficients of a solution, zeros with their signs; NaN or infinity as `None`.
    fn shown<S: Elementary + FromDecimal>(
        solution: &Solution<S>,
        dimension: usize,
    ) -> Option<String> {
        let components: Vec<_> = (0..dimension).map(|i| solution.component(i)).collect();
        let text = format!("{components:?} {:?}", solution.layer_arguments().collect::<Vec<_>>());
        (!text.contains("NaN") && !text.contains("inf")).then_some(text)
    }

    /// Whether a plan gives the bits of the plain recurrences, at one start after the other; `None`
    /// if these are not finite.
    fn agrees<S: Elementary + FromDecimal>(tape: &Tape, starts: &[[f64; 3]]) -> Option<()> {
        let mut solution = Solution::<S>::new(DEGREE, tape, Constants::Binary);
        for start in starts {
            let x = start.map(S::from_f64);
            let wanted = shown(&expanded(&solution, &x), 3)?;
            solution.expand(&x);
            assert_eq!(shown(&solution, 3), Some(wanted), "{tape:?} from {start:?}");
        }
        Some(())
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(400))]
        #[test]
        fn a_plan_gives_the_bits_of_the_recurrences(
            operations in prop::collection::vec((0..20_u8, any::<usize>(), any::<usize>(),
                -2.0..2.0_f64), 3..24),
            starts in prop::collection::vec(prop::array::uniform3(-1.0..1.0_f64), 3),
        ) {
            let tape = equation(3, &operations);
            agrees::<f64>(&tape, &starts);
            agrees::<DoubleDouble>(&tape, &starts);
            agrees::<MultiFloat<3>>(&tape, &starts);
            agrees::<Interval>(&tape, &starts[..1]);
            agrees::<Dual<f64, 2>>(&tape, &starts[..1]);
        }
    }

    /// x' = tanh(y/0.01) z + 1, y' = (1 + r) - (z + r), z' = -x, r = x z.
    fn switched() -> Tape {
        Tape::record(3, |x| {
            let (one, r) = (Recorded::one(), x[0] * x[2]);
            vec![
                (x[1] / Recorded::from_f64(0.01)).tanh() * x[2] + one,
                (one + r) - (x[2] + r),
                -x[0],
            ]
        })
    }

    #[test]
    fn every_set_of_saturated_tanh_has_its_plan() {
        let starts = [[0.3, 0.5, 0.7], [0.3, 0.01, 0.7], [0.3, -0.5, 0.7], [0.2, -0.02, 0.7]];
        agrees::<f64>(&switched(), &starts).unwrap();
        let mut solution = Solution::<f64>::new(DEGREE, &switched(), Constants::Binary);
        let mut lengths = |start: &[f64; 3]| {
            solution.expand(start);
            solution
                .plans
                .iter()
                .map(|plan| (plan.saturated, plan.instructions.len()))
                .collect::<Vec<_>>()
        };
        let (outside, both) = (lengths(&starts[0]), lengths(&starts[1]));
        assert_eq!((outside.len(), both.len(), outside[0]), (1, 2, both[0]));
        assert_eq!((both[0].0, both[1].0), (1, 0));
        // No tanh; and a scaling instead of a product.
        assert_eq!(both[1].1 - both[0].1, 1);
        assert_eq!(lengths(&starts[2]), both);
    }

    #[test]
    fn what_is_constant_is_not_computed() {
        // The product, its copies' difference, nothing else.
        let tape = Tape::record(1, |x| {
            let (c, r) = (Recorded::from_f64, x[0].squared());
            vec![((c(3.0) + r) - (c(2.0) + r)) * x[0]]
        });
        let mut solution = Solution::<f64>::new(DEGREE, &tape, Constants::Binary);
        solution.expand(&[0.5]);
        let kept: Vec<_> = solution.plans[0].instructions.iter().map(|i| i.action).collect();
        assert!(matches!(kept[..], [Action::Lift(..)]), "{kept:?}");
    }

    /// One equation for each pair that is done at once.
    #[test]
    fn common_pairs_are_one_instruction_of_the_same_bits() {
        let c = Recorded::from_f64;
        let derivatives: [fn(&[Recorded]) -> Recorded; 12] = [
            |x| -(x[1] * Recorded::from_f64(3.0)),
            |x| -x[1] - x[2],
            |x| x[1] + x[2] * Recorded::from_f64(0.3),
            |x| x[1] - x[2] * Recorded::from_f64(0.3),
            |x| x[1] + x[2] * x[0],
            |x| x[1] - x[2] * x[0],
            |x| x[2] * x[0] + x[1],
            |x| x[2] * x[0] - x[1],
            |x| x[1] + x[2].squared(),
            |x| x[1].squared() + x[2].squared(),
            |x| x[1].squared() + x[2].squared() + x[0].squared(),
            |x| x[1] + x[2].sign() * x[0],
        ];
        for (case, derivative) in derivatives.iter().enumerate() {
            let tape = Tape::record(3, |x| vec![derivative(x), x[0], c(1.0)]);
            let starts = [[0.4, -0.7, 0.9], [-0.3, 0.6, -0.2]];
            agrees::<f64>(&tape, &starts).unwrap();
            agrees::<DoubleDouble>(&tape, &starts).unwrap();
            agrees::<Interval>(&tape, &starts).unwrap();
            let mut solution = Solution::<f64>::new(DEGREE, &tape, Constants::Binary);
            solution.expand(&starts[0]);
            // The constant 1 is cleared; all else is the derivative.
            assert_eq!(solution.plans[0].instructions.len(), 2, "{case}: {:?}", solution.plans[0]);
        }
    }
}
