//! Many independent runs of one system at once, side by side in [`Lanes`], by Dormand-Prince 5(4).
//!
//! Each lane has its own time and step size, takes and refuses steps by itself, and is given the next start when it has reached the
//! end. So a run's result does not depend on its neighbours, on the width, or on the machine: it is bit for bit
//! that of [`Dopri5`](super::Dopri5) alone, because every operation is the same one in the same order (tests/ensemble.rs).
//!
//! The instruction set is chosen when the program runs (crate `pulp`; x86-64 with AVX2 or AVX-512, else what the program was
//! compiled for). It changes how many lanes an instruction takes and nothing else: no operation is fused, none reordered.

use nalgebra::SVector;

use super::dopri5::{control, tableau::*};
use super::starting_step::starting_step;
use super::step::{Failure, Statistics, Tolerance, finite};
use crate::num::elementary::kernels::{Pointwise, rough_exp2, rough_log2};
use crate::num::elementary::sqrt;
use crate::num::{Arithmetic, Lanes};
use crate::system::VectorField;

/// Lanes of [`ensemble()`]: one register of AVX-512, two of AVX2, four of SSE2.
pub const WIDTH: usize = 8;

/// What every run of an ensemble shares.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Local error control.
    pub tolerance: Tolerance,
    /// Each run goes from time 0 to this one.
    pub t_end: f64,
    /// No step is longer.
    pub max_step: f64,
    /// A run that has taken so many steps before the end is given up.
    pub max_steps: u64,
}

/// The end of one run.
#[derive(Clone, Debug, PartialEq)]
pub struct End<const N: usize> {
    /// The state at the end time.
    pub x: SVector<f64, N>,
    /// Work done.
    pub statistics: Statistics,
}

/// The ends of the runs from `starts`, in their order.
///
/// Each is a [`Failure`] where [`Dopri5`](super::Dopri5) would fail; [`Failure::TooManySteps`] where the budget is used up.
pub fn ensemble<F: VectorField<N>, const N: usize>(
    field: &F,
    starts: &[SVector<f64, N>],
    settings: &Settings,
) -> Vec<Result<End<N>, Failure>> {
    struct Job<'a, F, const N: usize>(&'a F, &'a [SVector<f64, N>], &'a Settings);
    impl<F: VectorField<N>, const N: usize> pulp::WithSimd for Job<'_, F, N> {
        type Output = Vec<Result<End<N>, Failure>>;
        #[inline(always)]
        fn with_simd<S: pulp::Simd>(self, _: S) -> Self::Output {
            in_lanes::<F, N, WIDTH>(self.0, self.1, self.2)
        }
    }
    pulp::Arch::new().dispatch(Job(field, starts, settings))
}

/// [`ensemble()`] in `W` lanes with the instructions that the program was compiled for.
#[inline(always)]
pub fn in_lanes<F: VectorField<N>, const N: usize, const W: usize>(
    field: &F,
    starts: &[SVector<f64, N>],
    settings: &Settings,
) -> Vec<Result<End<N>, Failure>> {
    let mut ends: Vec<Option<Result<End<N>, Failure>>> = vec![None; starts.len()];
    let mut waiting = starts.iter().copied().enumerate();
    let mut lanes = State::<N, W>::idle(settings);
    for lane in 0..W {
        lanes.refill(lane, field, settings, &mut waiting, &mut ends);
    }
    while lanes.run.iter().any(Option::is_some) {
        let done = lanes.step(field, settings);
        for (lane, done) in done.into_iter().enumerate() {
            if let (true, Some(run)) = (done, lanes.run[lane]) {
                ends[run] = Some(lanes.end(lane, settings));
                lanes.refill(lane, field, settings, &mut waiting, &mut ends);
            }
        }
    }
    ends.into_iter().flatten().collect()
}

/// All lanes: [`Dopri5`](super::Dopri5)'s fields side by side.
struct State<const N: usize, const W: usize> {
    /// The run in each lane; its other values mean nothing without one.
    run: [Option<usize>; W],
    t: Lanes<W>,
    x: SVector<Lanes<W>, N>,
    fsal: SVector<Lanes<W>, N>,
    h: Lanes<W>,
    last_log: Lanes<W>,
    rejected_before: [bool; W],
    steps: [u64; W],
    rejected: [u64; W],
    evaluations: [u64; W],
    failure: [Option<Failure>; W],
}

impl<const N: usize, const W: usize> State<N, W> {
    fn idle(settings: &Settings) -> Self {
        let zero = SVector::from_element(Lanes([0.0; W]));
        Self {
            run: [None; W],
            t: Lanes([settings.t_end; W]),
            x: zero,
            fsal: zero,
            h: Lanes([0.0; W]),
            last_log: Lanes([control::LEAST_LOG; W]),
            rejected_before: [false; W],
            steps: [0; W],
            rejected: [0; W],
            evaluations: [0; W],
            failure: [const { None }; W],
        }
    }

    /// Puts the next start into `lane`; ends that need no step go straight to `ends`.
    fn refill<F: VectorField<N>>(
        &mut self,
        lane: usize,
        field: &F,
        settings: &Settings,
        waiting: &mut impl Iterator<Item = (usize, SVector<f64, N>)>,
        ends: &mut [Option<Result<End<N>, Failure>>],
    ) {
        self.run[lane] = None;
        self.h.0[lane] = 0.0;
        for (run, x) in waiting {
            let slope = field.eval(&x);
            if !finite(&x) || !finite(&slope) {
                ends[run] = Some(Err(Failure::NotFinite { t: 0.0, state: Failure::state(&x) }));
                continue;
            }
            let Tolerance { rtol, atol } = settings.tolerance;
            let norm = |v: &SVector<f64, N>| {
                let mut sum = 0.0;
                for i in 0..N {
                    let q = v[i] / (atol + rtol * x[i].abs());
                    sum += q * q;
                }
                sqrt(sum / N as f64)
            };
            let longest = settings.max_step.min(settings.t_end);
            let h = starting_step(&x, &slope, norm, 0.2, longest, |y| field.eval(y)).min(settings.max_step);
            self.run[lane] = Some(run);
            self.t.0[lane] = 0.0;
            for i in 0..N {
                self.x[i].0[lane] = x[i];
                self.fsal[i].0[lane] = slope[i];
            }
            self.h.0[lane] = h;
            self.last_log.0[lane] = control::LEAST_LOG;
            self.rejected_before[lane] = false;
            (self.steps[lane], self.rejected[lane], self.evaluations[lane]) = (0, 0, 2);
            return;
        }
    }

    /// How the run in `lane` ended.
    fn end(&mut self, lane: usize, settings: &Settings) -> Result<End<N>, Failure> {
        let x = SVector::from_fn(|i, _| self.x[i].0[lane]);
        if let Some(failure) = self.failure[lane].take() {
            return Err(failure);
        }
        if self.t.0[lane] < settings.t_end {
            return Err(Failure::TooManySteps {
                t: self.t.0[lane],
                limit: settings.max_steps,
                state: Failure::state(&x),
            });
        }
        let statistics = Statistics {
            steps: self.steps[lane],
            rejected: self.rejected[lane],
            evaluations: self.evaluations[lane],
            restarts: 1,
            highest_order: 5,
            ..Statistics::default()
        };
        Ok(End { x, statistics })
    }

    /// One trial step in every lane; says which lanes have come to an end of any kind.
    #[inline(always)]
    fn step<F: VectorField<N>>(&mut self, field: &F, settings: &Settings) -> [bool; W] {
        let (t0, x0, k1) = (self.t, self.x, self.fsal);
        let t_end = Lanes([settings.t_end; W]);
        let remaining = t_end - t0;
        let last: [bool; W] = std::array::from_fn(|l| self.h.0[l] * 1.000_000_1 >= remaining.0[l]);
        let h = Lanes(std::array::from_fn(|l| if last[l] { remaining.0[l] } else { self.h.0[l] }));

        let k2 = field.eval(&advanced(&x0, h, [(&k1, A21)]));
        let k3 = field.eval(&advanced(&x0, h, [(&k1, A31), (&k2, A32)]));
        let k4 = field.eval(&advanced(&x0, h, [(&k1, A41), (&k2, A42), (&k3, A43)]));
        let k5 = field.eval(&advanced(&x0, h, [(&k1, A51), (&k2, A52), (&k3, A53), (&k4, A54)]));
        let k6 = field.eval(&advanced(&x0, h, [(&k1, A61), (&k2, A62), (&k3, A63), (&k4, A64), (&k5, A65)]));
        let increment = combined(h, (&k1, A71), [(&k3, A73), (&k4, A74), (&k5, A75), (&k6, A76)]);
        let x1 = SVector::from_fn(|i, _| x0[i] + increment[i]);
        let k7 = field.eval(&x1);
        let e = combined(h, (&k1, E1), [(&k3, E3), (&k4, E4), (&k5, E5), (&k6, E6), (&k7, E7)]);

        let (rtol, atol) = (Lanes::from_f64(settings.tolerance.rtol), Lanes::from_f64(settings.tolerance.atol));
        let mut square = Lanes([0.0; W]);
        for i in 0..N {
            let q = e[i] / (atol + rtol * x0[i].map2(x1[i], |a, b| a.abs().max(b.abs())));
            square += q * q;
        }
        let square = square / Lanes::from_f64(N as f64);
        // 0 times a finite number is 0; anything else makes a NaN.
        let zero = Lanes([0.0; W]);
        let mut probe = square * zero;
        for i in 0..N {
            probe += x1[i] * zero + k7[i] * zero;
        }

        let log = rough_log2(square.map(|s| s.max(control::LEAST_SQUARE)));
        let accepted: [bool; W] = std::array::from_fn(|l| square.0[l] <= 1.0 && probe.0[l] == 0.0);
        let grown = Lanes::from_f64(control::ALPHA) * log - Lanes::from_f64(control::BETA) * self.last_log;
        let half = Lanes::from_f64(0.5);
        let (after_success, after_failure) = (half * grown, Lanes::from_f64(0.5 * control::ALPHA) * log);
        let exponent: Lanes<W> =
            Lanes(std::array::from_fn(|l| if accepted[l] { after_success.0[l] } else { after_failure.0[l] }));
        let factor = rough_exp2(exponent) / Lanes::from_f64(control::SAFETY);

        let mut done = [false; W];
        for l in 0..W {
            // The rare cases first; idle lanes have h = 0.
            if self.run[l].is_none() {
                continue;
            }
            let state = |x: &SVector<Lanes<W>, N>| x.iter().map(|c| c.0[l]).collect();
            let h = h.0[l];
            if h.abs() <= t0.0[l].abs() * f64::EPSILON || h < f64::MIN_POSITIVE {
                self.failure[l] = Some(Failure::StepUnderflow { t: t0.0[l], h, state: state(&x0) });
                done[l] = true;
                continue;
            }
            self.evaluations[l] += 6;
            if accepted[l] {
                let next = h / factor.0[l].clamp(1.0 / control::GROW, 1.0 / control::SHRINK);
                let next = if self.rejected_before[l] { next.min(h) } else { next };
                self.h.0[l] = next.min(settings.max_step);
                self.last_log.0[l] = log.0[l].max(control::LEAST_LOG);
                self.t.0[l] = if last[l] { settings.t_end } else { t0.0[l] + h };
                self.rejected_before[l] = false;
                self.steps[l] += 1;
                done[l] = last[l] || self.steps[l] >= settings.max_steps;
            } else {
                self.rejected[l] += 1;
                self.rejected_before[l] = true;
                if probe.0[l] == 0.0 {
                    self.h.0[l] = h / factor.0[l].min(1.0 / control::SHRINK);
                } else {
                    self.h.0[l] = h * 0.1;
                    if self.h.0[l] <= t0.0[l].abs() * f64::EPSILON || self.h.0[l] < 1e-300 {
                        self.failure[l] = Some(Failure::NotFinite { t: t0.0[l], state: state(&x0) });
                        done[l] = true;
                    }
                }
            }
        }
        for i in 0..N {
            self.x[i] = Lanes(std::array::from_fn(|l| if accepted[l] { x1[i].0[l] } else { x0[i].0[l] }));
            self.fsal[i] = Lanes(std::array::from_fn(|l| if accepted[l] { k7[i].0[l] } else { k1[i].0[l] }));
        }
        done
    }
}

/// x0 + k_1 (h a_1) + k_2 (h a_2) + ..., from the left.
#[inline(always)]
fn advanced<const N: usize, const W: usize, const M: usize>(
    x0: &SVector<Lanes<W>, N>,
    h: Lanes<W>,
    terms: [(&SVector<Lanes<W>, N>, f64); M],
) -> SVector<Lanes<W>, N> {
    let mut sum = *x0;
    for (k, a) in terms {
        let ha = h * Lanes::from_f64(a);
        for i in 0..N {
            sum[i] += k[i] * ha;
        }
    }
    sum
}

/// k_1 (h a_1) + k_2 (h a_2) + ..., from the left.
#[inline(always)]
fn combined<const N: usize, const W: usize, const M: usize>(
    h: Lanes<W>,
    first: (&SVector<Lanes<W>, N>, f64),
    terms: [(&SVector<Lanes<W>, N>, f64); M],
) -> SVector<Lanes<W>, N> {
    let ha = h * Lanes::from_f64(first.1);
    let start = SVector::from_fn(|i, _| first.0[i] * ha);
    advanced(&start, h, terms)
}
