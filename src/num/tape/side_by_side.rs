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
            let mut results = vec![zero; self.registers.next_power_of_two().max(N)];
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
        for i in &self.code {
            let a = results[usize::from(i.a) & last];
            let b = results[usize::from(i.b) & last];
            let fixed = set.splat_f64s(i.fixed);
            let mut value = a;
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
