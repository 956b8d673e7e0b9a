//! A program at many points at once: every instruction once for all lanes of vector registers.
//!
//! Looking up what an instruction does takes longer than doing it; here that is paid once for as many points as there are lanes.

// Loops by number over registers: iterators and closures may stay calls, compiled for the wrong instruction set.
#![allow(clippy::needless_range_loop)]

use pulp::Simd;

use super::super::registers::Registers;
use super::super::scalar::Elementary;
use super::{Code, Output, Program};

/// Numbers in `K` registers.
type Bundle<S, const K: usize> = [<S as Simd>::f64s; K];

impl Program {
    /// The function's values at `x`: in every lane the bits of [`Program::evaluate`]. `N` is the number of variables and of values.
    ///
    /// Always inlined, so that it is compiled with the instructions of whoever calls.
    #[inline(always)]
    pub(crate) fn evaluate_in_registers<S: Simd, const K: usize, const N: usize>(
        &self,
        set: S,
        x: [Bundle<S, K>; N],
    ) -> [Bundle<S, K>; N] {
        assert!(N == self.variables && N == self.outputs.len(), "one number a variable and a value");
        let zero = [set.splat_f64s(0.0); K];
        if self.registers <= Self::FEW && N <= Self::FEW {
            let mut results = [zero; Self::FEW];
            results[..N].copy_from_slice(&x);
            self.run_in_registers(set, x, &mut results)
        } else {
            let mut results = vec![zero; self.registers.max(N).next_power_of_two()];
            results[..N].copy_from_slice(&x);
            self.run_in_registers(set, x, &mut results)
        }
    }

    /// `results` is as long as a power of two that is not below the number of registers.
    #[inline(always)]
    fn run_in_registers<S: Simd, const K: usize, const N: usize>(
        &self,
        set: S,
        x: [Bundle<S, K>; N],
        results: &mut [Bundle<S, K>],
    ) -> [Bundle<S, K>; N] {
        // The mask changes nothing and spares the way to a panic.
        let last = results.len() - 1;
        // Most instructions use the result of the one before: it is at hand sooner than it could be written and read again.
        let (mut value, mut written) = (x[0], u16::MAX);
        for i in &self.code {
            let a = if i.a == written { value } else { results[usize::from(i.a) & last] };
            let b = if i.b == written { value } else { results[usize::from(i.b) & last] };
            let fixed = set.splat_f64s(i.fixed);
            let number = Registers::<S, K>::new(set, a);
            macro_rules! each {
                ($k:ident => $result:expr) => {
                    for $k in 0..K {
                        value[$k] = $result;
                    }
                };
            }
            match i.code {
                Code::Add => each!(k => set.add_f64s(a[k], b[k])),
                Code::Sub => each!(k => set.sub_f64s(a[k], b[k])),
                Code::Mul => each!(k => set.mul_f64s(a[k], b[k])),
                Code::Div => each!(k => set.div_f64s(a[k], b[k])),
                Code::AddFixed => each!(k => set.add_f64s(a[k], fixed)),
                Code::SubFixed => each!(k => set.sub_f64s(a[k], fixed)),
                Code::FixedSub => each!(k => set.sub_f64s(fixed, a[k])),
                Code::MulFixed => each!(k => set.mul_f64s(a[k], fixed)),
                Code::DivFixed => each!(k => set.div_f64s(a[k], fixed)),
                Code::FixedDiv => each!(k => set.div_f64s(fixed, a[k])),
                Code::Neg => value = (-number).parts(),
                Code::Tanh => value = number.tanh().parts(),
                Code::Exp => value = number.exp().parts(),
                Code::Ln => value = number.ln().parts(),
                Code::Sin => value = number.sin().parts(),
                Code::Cos => value = number.cos().parts(),
                Code::Sqrt => value = number.sqrt().parts(),
                Code::Atan => value = number.atan().parts(),
                Code::Erf => value = number.erf().parts(),
                Code::Sign => value = number.sign().parts(),
            }
            results[usize::from(i.to) & last] = value;
            written = i.to;
        }
        let mut out = x;
        for i in 0..N {
            out[i] = match self.outputs[i] {
                Output::Register(at) => results[usize::from(at) & last],
                Output::Fixed(value) => [set.splat_f64s(value); K],
            };
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::num::{Arithmetic, Tape};
    use pulp::bytemuck::cast_slice;
    use pulp::{Arch, Scalar, WithSimd};

    /// Every kind of instruction, with variables and with numbers on either side.
    fn everything() -> Program {
        Program::new(&Tape::record(2, |v| {
            let (x, y) = (v[0], v[1]);
            let c = crate::num::tape::Recorded::from_f64(0.3);
            let a = ((x + y) * (x - y) / (x * x + c) - c) * (c - x) + (c / (y * y + c) + x / c).tanh();
            let b = (-x).exp() + (x * x + c).ln() - y.sin() * y.cos() + (y * y + c).sqrt();
            vec![a + (x - c).atan(), b + y.erf() * (x * y).sign() + c * (x + c)]
        }))
    }

    /// The program on `K` registers of whichever instruction set, against itself on single numbers.
    struct Compared<'a, const K: usize>(&'a Program);

    impl<const K: usize> WithSimd for Compared<'_, K> {
        type Output = ();
        #[inline(always)]
        fn with_simd<S: Simd>(self, set: S) {
            let width = K * S::F64_LANES;
            let value = |lane: usize, i: usize| (lane as f64 - 0.4 * width as f64) * 0.37 + i as f64 * 0.21;
            let lanes = [0, 1].map(|i| (0..width).map(|lane| value(lane, i)).collect::<Vec<_>>());
            let x = lanes.each_ref().map(|lanes| Registers::<S, K>::load(set, lanes).parts());
            let found = self.0.evaluate_in_registers(set, x);
            for lane in 0..width {
                let mut alone = [0.0; 2];
                self.0.evaluate(&[value(lane, 0), value(lane, 1)], &mut alone);
                for i in 0..2 {
                    assert_eq!(cast_slice::<_, f64>(&found[i])[lane].to_bits(), alone[i].to_bits(), "{lane} {i}");
                }
            }
        }
    }

    #[test]
    fn lanes_have_the_bits_of_single_numbers() {
        let program = everything();
        Compared::<1>(&program).with_simd(Scalar);
        Compared::<3>(&program).with_simd(Scalar);
        Arch::new().dispatch(Compared::<1>(&program));
        Arch::new().dispatch(Compared::<2>(&program));
    }

    #[test]
    fn a_value_may_be_a_number() {
        let program = Program::new(&Tape::record(2, |v| vec![v[1], crate::num::tape::Recorded::from_f64(2.5)]));
        let found = program.evaluate_in_registers(Scalar, [[1.0], [3.0]]);
        assert_eq!(found, [[3.0], [2.5]]);
    }
}
