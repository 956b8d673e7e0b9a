//! A tape made ready to be evaluated millions of times.

use super::choice::{Choice, Code, choices};
use super::{Decimal, Elementary, Node, Operation, Tape};

/// One instruction, nothing to look up.
#[derive(Clone, Copy, Debug)]
pub(super) struct Instruction {
    pub code: Code,
    pub to: u16,
    pub a: u16,
    pub b: u16,
    pub c: u16,
    pub f: f64,
    pub g: f64,
}

/// Place of a value of the function.
#[derive(Clone, Copy, Debug)]
pub(super) enum Output {
    Register(u16),
    Fixed(f64),
}

/// A tape made ready for evaluation: dead operations dropped, terms without variables computed in
/// `f64`, intermediate results in a few registers that are used again.
///
/// Nothing is allocated in an evaluation if [`Program::registers`] are at most
/// [`Program::ON_STACK`], which systems of ordinary size stay far below.
#[derive(Clone, Debug)]
pub struct Program {
    pub(super) variables: usize,
    pub(super) code: Vec<Instruction>,
    pub(super) outputs: Vec<Output>,
    pub(super) registers: usize,
}

impl Program {
    /// Registers that an evaluation keeps on the stack.
    pub const ON_STACK: usize = 32;
    /// As many as most systems need: fewer are sooner cleared.
    const FEW: usize = 16;
    /// Most registers of a program.
    const MOST: usize = 1 << 16;

    /// Makes `tape` ready.
    ///
    /// # Panics
    /// If more than 65,536 intermediate results are alive at once.
    pub fn new(tape: &Tape) -> Self {
        let (needed, fixed) = (tape.needed(), tape.fixed(Decimal::value));
        let chosen = choices(tape, &needed, &fixed);
        let operands = |choice: &Choice| choice.operands.into_iter().flatten();
        let mut last_use = vec![0; tape.operations.len()];
        for (node, choice) in chosen.iter().enumerate() {
            choice.iter().flat_map(operands).for_each(|operand| last_use[operand] = node);
        }
        for output in &tape.outputs {
            last_use[*output] = usize::MAX;
        }
        let mut registers = tape.variables;
        let mut free: Vec<u16> =
            (0..tape.variables).filter(|i| !needed[*i]).map(|i| i as u16).collect();
        let mut register: Vec<u16> = vec![0; tape.operations.len()];
        for (node, operation) in tape.operations.iter().enumerate() {
            if let Operation::Variable(i) = operation {
                register[node] = *i as u16;
            }
        }
        let mut code = Vec::new();
        for (node, choice) in chosen.iter().enumerate() {
            let Some(choice) = choice else { continue };
            let [a, b, c] = choice.operands.map(|operand| operand.map_or(0, |node| register[node]));
            let mut done: Vec<Node> =
                operands(choice).filter(|operand| last_use[*operand] == node).collect();
            done.sort_unstable();
            done.dedup();
            free.extend(done.iter().map(|operand| register[*operand]));
            let to = free.pop().unwrap_or_else(|| {
                registers += 1;
                assert!(registers <= Self::MOST, "too many intermediate results");
                (registers - 1) as u16
            });
            register[node] = to;
            let [f, g] = choice.numbers;
            code.push(Instruction { code: choice.code, to, a, b, c, f, g });
        }
        let outputs = tape.outputs.iter().map(|node| match fixed[*node] {
            Some(value) => Output::Fixed(value),
            None => Output::Register(register[*node]),
        });
        Self { variables: tape.variables, outputs: outputs.collect(), code, registers }
    }

    /// Registers needed.
    pub fn registers(&self) -> usize {
        self.registers
    }

    /// Instructions run in an evaluation.
    pub fn instructions(&self) -> usize {
        self.code.len()
    }

    /// Whether the two programs differ only in their numbers.
    pub fn is_like(&self, other: &Self) -> bool {
        let operation = |i: &Instruction| (i.code, i.to, i.a, i.b, i.c);
        let place = |output: &Output| match output {
            Output::Register(at) => Some(*at),
            Output::Fixed(_) => None,
        };
        (self.variables, self.registers) == (other.variables, other.registers)
            && self.code.iter().map(operation).eq(other.code.iter().map(operation))
            && self.outputs.iter().map(place).eq(other.outputs.iter().map(place))
    }

    /// The program's numbers: two for each instruction, then one for each value; 0 where there is
    /// none.
    pub fn numbers(&self) -> Vec<f64> {
        let of_value = |output: &Output| match output {
            Output::Register(_) => 0.0,
            Output::Fixed(value) => *value,
        };
        self.code.iter().flat_map(|i| [i.f, i.g]).chain(self.outputs.iter().map(of_value)).collect()
    }

    /// Writes the function's values at `x` into `out`.
    ///
    /// # Panics
    /// If `x` or `out` do not have the function's numbers of variables and values.
    #[inline]
    pub fn evaluate<S: Elementary>(&self, x: &[S], out: &mut [S]) {
        assert!(
            x.len() == self.variables && out.len() == self.outputs.len(),
            "one number a variable and a value"
        );
        if self.code.is_empty() {
            // Coordinates and numbers: no register is to be cleared for them.
            for (out, from) in out.iter_mut().zip(&self.outputs) {
                *out = match *from {
                    Output::Register(at) => x[usize::from(at)],
                    Output::Fixed(value) => S::from_f64(value),
                };
            }
            return;
        }
        // Wider numbers than `f64` take so long that how a register is found does not matter: one
        // loop is compiled for them, not three.
        if self.registers <= Self::FEW {
            let mut registers = [S::zero(); Self::FEW];
            registers[..x.len()].copy_from_slice(x);
            if const { wide::<S>() } {
                self.run_alone(registers.as_mut_slice(), out)
            } else {
                self.run_alone(&mut registers, out)
            }
        } else if self.registers <= Self::ON_STACK {
            let mut registers = [S::zero(); Self::ON_STACK];
            registers[..x.len()].copy_from_slice(x);
            if const { wide::<S>() } {
                self.run_alone(registers.as_mut_slice(), out)
            } else {
                self.run_alone(&mut registers, out)
            }
        } else {
            let mut registers = vec![S::zero(); self.registers];
            registers[..x.len()].copy_from_slice(x);
            self.run_alone(registers.as_mut_slice(), out);
        }
    }

    /// The same with the program's own numbers. Copies of it in its callers made the command's file
    /// 2 MB larger and no run shorter.
    #[inline(never)]
    fn run_alone<S: Elementary, R: Results<S> + ?Sized>(&self, r: &mut R, out: &mut [S]) {
        self.run(r, &Own, out);
    }

    /// Carries the program out on results `r` that begin with the variables. Always inlined, so
    /// that it is compiled with the caller's instruction set.
    #[inline(always)]
    pub(super) fn run<S: Elementary, R: Results<S> + ?Sized>(
        &self,
        r: &mut R,
        numbers: &impl Numbers<S>,
        out: &mut [S],
    ) {
        for (place, i) in self.code.iter().enumerate() {
            let a = r.get(i.a);
            // Made where they are used, most instructions have none.
            macro_rules! f {
                () => {
                    numbers.at(2 * place, i.f)
                };
            }
            macro_rules! times_g {
                ($a:expr) => {
                    numbers.times($a, 2 * place + 1, i.g)
                };
            }
            let value = match i.code {
                Code::Add => a + r.get(i.b),
                Code::Sub => a - r.get(i.b),
                Code::Mul => a * r.get(i.b),
                Code::Div => a / r.get(i.b),
                Code::AddFixed => a + f!(),
                Code::SubFixed => a - f!(),
                Code::FixedSub => f!() - a,
                Code::MulFixed => numbers.times(a, 2 * place, i.f),
                Code::DivFixed => a / f!(),
                Code::FixedDiv => f!() / a,
                Code::Neg => -a,
                Code::Tanh => a.tanh(),
                Code::Exp => a.exp(),
                Code::Ln => a.ln(),
                Code::Sin => a.sin(),
                Code::Cos => a.cos(),
                Code::Sqrt => a.sqrt(),
                Code::Atan => a.atan(),
                Code::Erf => a.erf(),
                Code::Sign => a.sign(),
                Code::ProductPlus => a * r.get(i.b) + r.get(i.c),
                Code::PlusProduct => r.get(i.c) + a * r.get(i.b),
                Code::ProductMinus => a * r.get(i.b) - r.get(i.c),
                Code::MinusProduct => r.get(i.c) - a * r.get(i.b),
                Code::SumTimes => (a + r.get(i.b)) * r.get(i.c),
                Code::TimesSum => r.get(i.c) * (a + r.get(i.b)),
                Code::DifferenceTimes => (a - r.get(i.b)) * r.get(i.c),
                Code::TimesDifference => r.get(i.c) * (a - r.get(i.b)),
                Code::FixedSubTimes => (f!() - a) * r.get(i.c),
                Code::TimesFixedSub => r.get(i.c) * (f!() - a),
                Code::ScaledPlus => times_g!(a) + f!(),
                Code::MinusScaled => f!() - times_g!(a),
                Code::SumScaled => times_g!(a + f!()),
                Code::LineTimes => (f!() - times_g!(a)) * r.get(i.c),
                Code::TimesLine => r.get(i.c) * (f!() - times_g!(a)),
                Code::Squares => {
                    let b = r.get(i.b);
                    a * a + b * b
                }
                Code::ThreeSquares => {
                    let (b, c) = (r.get(i.b), r.get(i.c));
                    a * a + b * b + c * c
                }
                Code::TanhOfQuotient => (a / f!()).tanh(),
                Code::Blend => {
                    let b = r.get(i.b);
                    b + (a - b) * r.get(i.c)
                }
                Code::BlendFromFixed => f!() + (a - f!()) * r.get(i.c),
                Code::BlendToFixed => {
                    let b = r.get(i.b);
                    b + (f!() - b) * r.get(i.c)
                }
                Code::BlendOfSums => {
                    let base = a + numbers.at(2 * place + 1, i.g);
                    base + ((a + f!()) - base) * r.get(i.c)
                }
            };
            r.set(i.to, value);
        }
        for (i, from) in self.outputs.iter().enumerate() {
            out[i] = match *from {
                Output::Register(at) => r.get(at),
                Output::Fixed(value) => numbers.at(2 * self.code.len() + i, value),
            };
        }
    }
}

/// Whether a number takes so long that how a register is found does not matter.
const fn wide<S>() -> bool {
    size_of::<S>() > size_of::<f64>()
}

/// Source of a program's numbers.
pub(super) trait Numbers<S: Elementary> {
    /// The number in this place, which in the program itself is `own`.
    fn at(&self, place: usize, own: f64) -> S;
    /// The product of `a` with it.
    #[inline(always)]
    fn times(&self, a: S, place: usize, own: f64) -> S {
        a * self.at(place, own)
    }
}

/// The program's own.
pub(super) struct Own;

impl<S: Elementary> Numbers<S> for Own {
    #[inline(always)]
    fn at(&self, _: usize, own: f64) -> S {
        S::from_f64(own)
    }
    #[inline(always)]
    fn times(&self, a: S, _: usize, own: f64) -> S {
        a.scale(own)
    }
}

/// Intermediate results.
pub(super) trait Results<S> {
    fn get(&self, i: u16) -> S;
    fn set(&mut self, i: u16, value: S);
}

impl<S: Copy, const M: usize> Results<S> for [S; M] {
    // The remainder changes nothing, since the program's registers are at most M, a power of two,
    // and spares the way to a panic.
    #[inline(always)]
    fn get(&self, i: u16) -> S {
        self[usize::from(i) % M]
    }
    #[inline(always)]
    fn set(&mut self, i: u16, value: S) {
        self[usize::from(i) % M] = value;
    }
}

impl<S: Copy> Results<S> for [S] {
    #[inline(always)]
    fn get(&self, i: u16) -> S {
        self[usize::from(i)]
    }
    #[inline(always)]
    fn set(&mut self, i: u16, value: S) {
        self[usize::from(i)] = value;
    }
}

#[cfg(test)]
mod tests {
    use super::super::Recorded;
    use super::*;
    use crate::{Arithmetic, DoubleDouble};
    use proptest::prelude::*;

    /// Expressions that become one instruction each, in every order of their operands.
    fn one_instruction<S: Elementary>(a: S, b: S, c: S) -> Vec<S> {
        let (k, m) = (S::from_f64(0.3), S::from_f64(1.7));
        vec![
            a * b + c,
            c + a * b,
            a * b - c,
            c - a * b,
            (a + b) * c,
            c * (a + b),
            (a - b) * c,
            c * (a - b),
            (k - a) * c,
            c * (k - a),
            a * k + m,
            m + k * a,
            m - a * k,
            (a + k) * m,
            m * (k + a),
            (m - a * k) * c,
            c * (m - k * a),
            a * a + b * b,
            a * a + b * b + c * c,
            (a / k).tanh(),
            b + (a - b) * c,
            k + (a - k) * c,
            b + (k - b) * c,
            (a + m) + ((a + k) - (a + m)) * c,
            (m + a) + ((k + a) - (m + a)) * c,
        ]
    }

    /// Expressions that resemble these and need several: a result used twice, by itself, wanted as
    /// a value, with another in between, or with a number in the wrong place.
    fn several<S: Elementary>(a: S, b: S, c: S) -> Vec<S> {
        let (k, m) = (S::from_f64(0.3), S::from_f64(1.7));
        let (p, d, e, s) = (a * b, a - b, (a - c) * b, c * c);
        let (x, y) = (b + k, b + m);
        vec![
            p + c,
            p - b,
            (c - a) * (c - a),
            d,
            d * c,
            a + (a - b) * c,
            c + (a - b) * c,
            (b - c) * a + e,
            s + a * a,
            s + b,
            a * a + (b * b + p * p),
            y + (x - y) * c,
            x * a,
            b * k - m,
            (a * k - m) * c,
            (k / a).tanh() + (a / b).tanh(),
            (a + k) + ((b + m) - (a + k)) * c,
            m + (a - k) * c,
            a + (b - a) * k,
        ]
    }

    fn bits(values: &[f64]) -> Vec<u64> {
        values.iter().map(|value| value.to_bits()).collect()
    }

    fn values<S: Elementary>(program: &Program, x: &[S]) -> Vec<S> {
        let mut out = vec![S::zero(); program.outputs.len()];
        program.evaluate(x, &mut out);
        out
    }

    #[test]
    fn what_is_one_instruction_rounds_as_its_operations() {
        let x = [0.7, -1.3, 2.9];
        for (i, want) in one_instruction(x[0], x[1], x[2]).into_iter().enumerate() {
            let program =
                Program::new(&Tape::record(3, |v| vec![one_instruction(v[0], v[1], v[2])[i]]));
            assert_eq!(program.instructions(), 1, "{i}");
            assert_eq!(bits(&values(&program, &x)), bits(&[want]), "{i}");
        }
        for (i, want) in several(x[0], x[1], x[2]).into_iter().enumerate() {
            let program = Program::new(&Tape::record(3, |v| vec![several(v[0], v[1], v[2])[i]]));
            assert_eq!(bits(&values(&program, &x)), bits(&[want]), "{i}");
        }
        let all = |v: &[Recorded]| {
            [one_instruction(v[0], v[1], v[2]), several(v[0], v[1], v[2])].concat()
        };
        let program = Program::new(&Tape::record(3, all));
        let want = [one_instruction(x[0], x[1], x[2]), several(x[0], x[1], x[2])].concat();
        assert_eq!(bits(&values(&program, &x)), bits(&want));
        // Numbers with two halves keep the order of operands too.
        let x = x.map(|x| DoubleDouble::new(x, 1e-18));
        assert_eq!(
            values(&program, &x),
            [one_instruction(x[0], x[1], x[2]), several(x[0], x[1], x[2])].concat()
        );
    }

    /// An equation by chance: each operation on some of the last results, so that they come in
    /// chains.
    fn by_chance(v: &[Recorded], steps: &[(u8, usize, usize, usize)]) -> Vec<Recorded> {
        let mut made: Vec<Recorded> = [0.3, -1.7, 0.0].map(Recorded::from_f64).to_vec();
        made.extend(v);
        for (operation, a, b, c) in steps {
            let at = |i: &usize| made[made.len() - 1 - i % made.len()];
            let (a, b, c) = (at(a), at(b), at(c));
            made.push(match operation {
                0..=3 => a + b,
                4..=6 => a - b,
                7..=10 => a * b,
                11 => a / b,
                12 => (a / b).tanh(),
                13 => -a,
                14 => a * a + b * b,
                _ => a + (b - a) * c,
            });
        }
        made.split_off(made.len() - 3)
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(2000))]
        #[test]
        fn any_equation_has_the_bits_of_its_operations(
            steps in prop::collection::vec((0..16_u8, 0..6_usize, 0..6_usize, 0..6_usize), 1..40),
            x in prop::array::uniform3(-2.0..2.0_f64),
        ) {
            let tape = Tape::record(3, |v| by_chance(v, &steps));
            let found = values(&Program::new(&tape), &x);
            for (found, want) in found.iter().zip(tape.evaluate_decimal(&x)) {
                prop_assert!(found.to_bits() == want.to_bits() || found.is_nan() && want.is_nan(),
                    "{} {}", found, want);
            }
        }
    }
}
