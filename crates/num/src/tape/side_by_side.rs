//! A program at many points at once: every instruction once for all lanes of vector registers.
//!
//! Dispatching an instruction takes longer than executing it; here one dispatch serves as many
//! points as there are lanes.

// Loops by number over registers: iterators and closures may stay calls, compiled for the wrong
// instruction set.
#![allow(clippy::needless_range_loop)]

use pulp::Simd;

use super::super::registers::{Aligned, Registers};
use super::program::{Numbers, Own, Program, Results};

/// Numbers in `K` registers.
type Bundle<S, const K: usize> = [<S as Simd>::f64s; K];

/// The program's numbers, others in each lane.
struct OfLanes<'a, S: Simd, const K: usize>(S, &'a [Aligned<Bundle<S, K>>]);

impl<S: Simd, const K: usize> Numbers<Registers<S, K>> for OfLanes<'_, S, K> {
    #[inline(always)]
    fn at(&self, place: usize, _: f64) -> Registers<S, K> {
        Registers::new(self.0, self.1[place].0)
    }
}

/// Results in memory that the caller keeps.
struct Scratch<'a, S: Simd, const K: usize> {
    set: S,
    results: &'a mut [Aligned<Bundle<S, K>>],
    /// The last result and its place. Most instructions use it, and it is available sooner than it
    /// could be stored and loaded.
    last: (Bundle<S, K>, u16),
}

impl<S: Simd, const K: usize> Results<Registers<S, K>> for Scratch<'_, S, K> {
    #[inline(always)]
    fn get(&self, i: u16) -> Registers<S, K> {
        let (last, written) = self.last;
        // The mask changes nothing and spares the way to a panic.
        let mask = self.results.len() - 1;
        let parts = if i == written { last } else { self.results[usize::from(i) & mask].0 };
        Registers::new(self.set, parts)
    }
    #[inline(always)]
    fn set(&mut self, i: u16, value: Registers<S, K>) {
        let (parts, mask) = (value.parts(), self.results.len() - 1);
        self.results[usize::from(i) & mask] = Aligned(parts);
        self.last = (parts, i);
    }
}

impl Program {
    /// Number of register bundles that an evaluation needs for its results: a power of two. The
    /// caller keeps them, since clearing them at each evaluation takes a tenth of an ensemble's
    /// time.
    pub fn scratch_len(&self) -> usize {
        self.registers.max(self.variables).next_power_of_two()
    }

    /// The function's values at `x`: in every lane the bits of [`Program::evaluate`]. `N` is the
    /// number of variables and of values; `scratch` is as long as [`Program::scratch_len`] says,
    /// and what is in it, before and after, means nothing.
    ///
    /// Always inlined, so that it is compiled with the caller's instruction set.
    #[inline(always)]
    pub fn evaluate_in_registers<S: Simd, const K: usize, const N: usize>(
        &self,
        set: S,
        x: [Bundle<S, K>; N],
        scratch: &mut [Aligned<Bundle<S, K>>],
    ) -> [Bundle<S, K>; N] {
        self.evaluate_with(set, x, &Own, scratch)
    }

    /// The same with different numbers in each lane, in the order of [`Program::numbers`]: each
    /// lane has the bits of the program with its numbers.
    #[inline(always)]
    pub fn evaluate_with_numbers<S: Simd, const K: usize, const N: usize>(
        &self,
        set: S,
        x: [Bundle<S, K>; N],
        numbers: &[Aligned<Bundle<S, K>>],
        scratch: &mut [Aligned<Bundle<S, K>>],
    ) -> [Bundle<S, K>; N] {
        assert!(
            numbers.len() == 2 * self.code.len() + N,
            "two numbers an instruction, one a value"
        );
        self.evaluate_with(set, x, &OfLanes(set, numbers), scratch)
    }

    #[inline(always)]
    fn evaluate_with<S: Simd, const K: usize, const N: usize>(
        &self,
        set: S,
        x: [Bundle<S, K>; N],
        numbers: &impl Numbers<Registers<S, K>>,
        results: &mut [Aligned<Bundle<S, K>>],
    ) -> [Bundle<S, K>; N] {
        assert!(
            N == self.variables && N == self.outputs.len(),
            "one number a variable and a value"
        );
        assert!(results.len() == self.scratch_len(), "as much scratch as the program says");
        let mask = results.len() - 1;
        for i in 0..N {
            results[i & mask] = Aligned(x[i]);
        }
        let mut out = [Registers::splat(set, 0.0); N];
        self.run(&mut Scratch { set, results, last: (x[0], u16::MAX) }, numbers, &mut out);
        let mut parts = x;
        for i in 0..N {
            parts[i] = out[i].parts();
        }
        parts
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Arithmetic, Elementary, Tape};
    use pulp::bytemuck::cast_slice;
    use pulp::{Arch, Scalar, WithSimd};

    /// Every kind of instruction, with variables and with numbers on either side.
    fn everything() -> Program {
        everything_with(0.3)
    }

    fn everything_with(number: f64) -> Program {
        Program::new(&Tape::record(2, |v| {
            let (x, y) = (v[0], v[1]);
            let c = crate::tape::Recorded::from_f64(number);
            let a =
                ((x + y) * (x - y) / (x * x + c) - c) * (c - x) + (c / (y * y + c) + x / c).tanh();
            let b = (-x).exp() + (x * x + c).ln() - y.sin() * y.cos() + (y * y + c).sqrt();
            // Pairs of operations that are one instruction, in every order.
            let a = (a * y + x) - (y + a * x) * (x + a)
                + (a * x - b) * (b - a * y)
                + b * (x - a)
                + (x - b) * y;
            let b = b + (a - b) * y + (c - a) * x + y * (c - b) + x * (a + b);
            // With numbers, two of them too, and three operations and more.
            let d = crate::tape::Recorded::from_f64(1.7);
            let a = a
                + (c - b) * y
                + x * (c - a)
                + (a * c + d) * (d - b * c)
                + ((b + c) * d) * ((d - x * c) * y);
            let b =
                b + a * (d - y * c) + (x * x + y * y) * (a * a + b * b + y * y) + (x / d).tanh();
            let (e, g) = (c + (a - c) * x, y + (c - y) * x);
            let b = b + e * ((a + d) + ((a + c) - (a + d)) * g);
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
            let value =
                |lane: usize, i: usize| (lane as f64 - 0.4 * width as f64) * 0.37 + i as f64 * 0.21;
            let lanes = [0, 1].map(|i| (0..width).map(|lane| value(lane, i)).collect::<Vec<_>>());
            let x = lanes.each_ref().map(|lanes| Registers::<S, K>::load(set, lanes).parts());
            // Results of an earlier evaluation must not matter.
            let mut scratch = vec![Aligned([set.splat_f64s(f64::NAN); K]); self.0.scratch_len()];
            let found = self.0.evaluate_in_registers(set, x, &mut scratch);
            for lane in 0..width {
                let mut alone = [0.0; 2];
                self.0.evaluate(&[value(lane, 0), value(lane, 1)], &mut alone);
                for i in 0..2 {
                    assert_eq!(
                        cast_slice::<_, f64>(&found[i])[lane].to_bits(),
                        alone[i].to_bits(),
                        "{lane} {i}"
                    );
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
        Arch::new().dispatch(Compared::<4>(&program));
    }

    /// Programs that differ in a number, one in each lane.
    struct Differing<const K: usize>;

    impl<const K: usize> WithSimd for Differing<K> {
        type Output = ();
        #[inline(always)]
        fn with_simd<S: Simd>(self, set: S) {
            let width = K * S::F64_LANES;
            let programs: Vec<Program> =
                (0..width).map(|lane| everything_with(0.3 + 0.01 * lane as f64)).collect();
            assert!(programs.iter().all(|program| program.is_like(&programs[0])));
            let of_lanes: Vec<Vec<f64>> = programs.iter().map(Program::numbers).collect();
            let numbers: Vec<Aligned<Bundle<S, K>>> = (0..of_lanes[0].len())
                .map(|place| {
                    let lanes: Vec<f64> = of_lanes.iter().map(|numbers| numbers[place]).collect();
                    Aligned(Registers::<S, K>::load(set, &lanes).parts())
                })
                .collect();
            let x = [0.7, -0.2].map(|x| Registers::<S, K>::splat(set, x).parts());
            let mut scratch =
                vec![Aligned([set.splat_f64s(f64::NAN); K]); programs[0].scratch_len()];
            let found = programs[0].evaluate_with_numbers(set, x, &numbers, &mut scratch);
            for lane in 0..width {
                let mut alone = [0.0; 2];
                programs[lane].evaluate(&[0.7, -0.2], &mut alone);
                for i in 0..2 {
                    assert_eq!(
                        cast_slice::<_, f64>(&found[i])[lane].to_bits(),
                        alone[i].to_bits(),
                        "{lane} {i}"
                    );
                }
            }
        }
    }

    #[test]
    fn a_lane_may_have_numbers_of_its_own() {
        Differing::<1>.with_simd(Scalar);
        Differing::<3>.with_simd(Scalar);
        Arch::new().dispatch(Differing::<1>);
        Arch::new().dispatch(Differing::<2>);
        Arch::new().dispatch(Differing::<4>);
    }

    #[test]
    fn a_value_may_be_a_number() {
        let program =
            Program::new(&Tape::record(2, |v| vec![v[1], crate::tape::Recorded::from_f64(2.5)]));
        let mut scratch = [Aligned([f64::NAN]); 2];
        let found = program.evaluate_in_registers(Scalar, [[1.0], [3.0]], &mut scratch);
        assert_eq!(found, [[3.0], [2.5]]);
        assert_eq!(program.numbers(), [0.0, 2.5], "one number a value; no instruction is needed");
        let found = program.evaluate_with_numbers(
            Scalar,
            [[1.0], [3.0]],
            &[[0.0], [4.5]].map(Aligned),
            &mut scratch,
        );
        assert_eq!(found, [[3.0], [4.5]]);
    }

    /// A power of two that holds the variables and the registers: three variables want four, even
    /// if nothing is computed.
    #[test]
    fn scratch_holds_variables_and_registers() {
        let copies = |n: usize| Program::new(&Tape::record(n, |v| v.to_vec()));
        assert_eq!([1, 2, 3, 4, 5].map(|n| copies(n).scratch_len()), [1, 2, 4, 4, 8]);
        // Of the twenty products each is wanted until the end: at least 21 registers at once.
        let many = Program::new(&Tape::record(1, |v| {
            let products: Vec<_> = (1..=20)
                .map(|k| (v[0] * crate::tape::Recorded::from_f64(k as f64)).tanh())
                .collect();
            let (mut up, mut down) = (v[0], v[0]);
            for k in 0..20 {
                (up, down) = (up * products[k], down * products[19 - k]);
            }
            vec![up - down]
        }));
        assert_eq!(many.scratch_len(), 32);
    }

    #[test]
    #[should_panic(expected = "as much scratch as the program says")]
    fn less_room_is_refused() {
        everything().evaluate_in_registers(Scalar, [[1.0], [3.0]], &mut [Aligned([0.0]); 2]);
    }
}
