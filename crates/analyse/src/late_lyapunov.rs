//! The largest Lyapunov exponent where the switch depends on the past.
//!
//! As [`lyapunov`](super::lyapunov), with the disturbed state of [`TangentStepper`]: a tangent
//! vector together with its effect on pending switches, or with its history. Growth rates do not
//! depend on the norm, as long as it covers all of that state.

use nalgebra::SVector;

use super::lyapunov::{Disturbed, Estimate, LyapunovOptions, averaged, begin};
use twofold_integrate::delay::{
    Carry, DelayError, Delayed, LateSwitch, Own, Sides, TangentStepper, Varied, WithTangent,
};
use twofold_integrate::{Failure, Method, Monitor};
use twofold_system::{PiecewiseSmooth, System};

/// The largest exponent of the orbit of `x0` under `switch`, `M` being 2 `N`; `data` describes the
/// system. Without kicks, or with those of the settings, to all states.
///
/// # Errors
/// If the orbit cannot be followed.
pub fn late_estimate<P, const N: usize, const M: usize>(
    system: &P,
    data: &System,
    switch: LateSwitch,
    x0: SVector<f64, N>,
    settings: &LyapunovOptions,
    monitor: &dyn Monitor,
) -> Result<Estimate, Failure>
where
    for<'a> Varied<'a, P>: PiecewiseSmooth<M> + Carry<M> + Clone,
{
    const { assert!(M == 2 * N) };
    let varied = Varied(system);
    let delayed = Delayed { sides: Sides::varied(&varied, data), switch, x0: begin(&x0) };
    let refused = |error: DelayError| Failure::NotApplicable {
        method: Method::Dopri5.name(),
        why: error.to_string(),
    };
    delayed.with_tangent(settings.tolerance, Waiting { settings, monitor }).map_err(refused)?
}

/// An estimate as a computation over any stepper.
struct Waiting<'a> {
    settings: &'a LyapunovOptions,
    monitor: &'a dyn Monitor,
}

impl<const M: usize> WithTangent<M> for Waiting<'_> {
    type Answer = Result<Estimate, Failure>;
    fn with<S: TangentStepper<M>>(self, stepper: S) -> Self::Answer {
        let mut orbit = Late { stepper, displaced: None };
        averaged(&mut orbit, M / 2, self.settings, self.monitor)
    }
}

struct Late<S, const M: usize> {
    stepper: S,
    /// State and tangent vector from which the next step begins, if they were replaced.
    displaced: Option<SVector<f64, M>>,
}

impl<S: TangentStepper<M>, const M: usize> Disturbed<M> for Late<S, M> {
    fn begin(&mut self, stop: f64, max_step: f64) -> Result<(), Failure> {
        let (t, state) = self.stepper.reached();
        let state = self.displaced.take().unwrap_or(state);
        self.stepper.restart(&Own, t, state, stop, max_step)
    }
    fn step(&mut self) -> Result<(), Failure> {
        self.stepper.step(&Own).map(|_| ())
    }
    fn reached(&self) -> (f64, SVector<f64, M>) {
        let (t, state) = self.stepper.reached();
        (t, self.displaced.unwrap_or(state))
    }
    fn displace(&mut self, state: SVector<f64, M>) {
        self.displaced = Some(state);
    }
    fn length(&self) -> f64 {
        self.stepper.length()
    }
    fn shorten(&mut self, by: f64) {
        self.stepper.shorten(by);
    }
    fn steps(&self) -> u64 {
        self.stepper.statistics().steps
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;
    use twofold_integrate::delay::{History, Inside};
    use twofold_integrate::{Kick, KickLaw, Tolerance};
    use twofold_system::{Bound, Definition, Transition};

    fn estimate<const N: usize, const M: usize>(
        text: &str,
        switch: LateSwitch,
        x0: [f64; N],
        settings: &LyapunovOptions,
    ) -> Result<Estimate, Failure>
    where
        for<'a> Varied<'a, Bound<N>>: PiecewiseSmooth<M> + Carry<M> + Clone,
    {
        let data = System::new(Definition::from_toml(text, "").unwrap());
        late_estimate(&data.bind().unwrap(), &data, switch, x0.into(), settings, &())
    }

    fn settings(duration: f64) -> LyapunovOptions {
        let tolerance = Tolerance { rtol: 1e-10, atol: 1e-10 };
        LyapunovOptions { tolerance, transient: 30.0, duration, ..LyapunovOptions::default() }
    }

    /// x' = -c x(t - 1), as a switch that is linear in x for |x| < 9: the exponent is the real part
    /// of Lambert's W(-c), below zero for c < pi/2. Blocks are of whole turns of the pair, in which
    /// what turns has no part.
    #[test]
    fn a_linear_delay_equation_has_lamberts_exponent() {
        let smooth = Some((Transition::Algebraic, 1.0));
        let switch = LateSwitch::Delayed { delay: 1.0, smooth, history: History::Constant };
        for (c, real, imaginary) in [
            (1.0, -0.318_131_505_204_764, 1.337_235_701_430_69),
            (1.2, -0.190_462_989_057_677, 1.439_223_535_205_85),
            (2.0, 0.172_816_002_84, 1.673_686_413_740_84),
        ] {
            let text = format!(
                "states = ['x']\nh = 'x/sqrt(81 - x*x)'\nplus = ['-9*{c}']\nminus = ['9*{c}']"
            );
            let found =
                estimate::<1, 2>(&text, switch, [0.0], &settings(64.0 * PI / imaginary)).unwrap();
            let value = found.exponent.value;
            assert!((value - real).abs() < 1e-6, "{c}: {value} {real}");
            assert!((value - real).abs() < found.half_width, "{c}: {found:?}");
        }
    }

    const RELAY: &str =
        "states = ['x', 'y']\nh = 'x'\nplus = ['-1', '0.3*y']\nminus = ['1', '0.1*y']";

    /// A relay with delay, x' = -sign(x(t - 1)), swings with period 4 from any history: what is
    /// disturbed is its phase, whose exponent is 0; all else is forgotten at once. Beside it y
    /// grows by 0.3 in one half of the time and by 0.1 in the other. The same with a memory.
    #[test]
    fn a_relays_phase_neither_grows_nor_falls() {
        let late = LateSwitch::Delayed { delay: 1.0, smooth: None, history: History::Constant };
        let relay = LateSwitch::Relay { band: 1.0, inside: Inside::Sign };
        for switch in [late, relay] {
            let alone = "states = ['x']\nh = 'x'\nplus = ['-1']\nminus = ['1']";
            let found = estimate::<1, 2>(alone, switch, [0.3], &settings(256.0)).unwrap();
            assert!(
                found.exponent.value.abs() < 1e-9 && found.half_width < 1e-3,
                "{switch:?} {found:?}"
            );
            let found = estimate::<2, 4>(RELAY, switch, [0.3, 0.0], &settings(256.0)).unwrap();
            assert!((found.exponent.value - 0.2).abs() < 1e-6, "{switch:?} {found:?}");
        }
    }

    /// Kicks move the orbit and leave the disturbance alone: of a linear equation they change no
    /// exponent, and they do change the share of time on each side.
    #[test]
    fn kicks_move_the_orbit_alone() {
        let kick = Kick { every: 3.0, size: 0.5, law: KickLaw::Sphere, seed: 3, stream: 0 };
        let options = LyapunovOptions { kick: Some(kick), ..settings(256.0) };
        let smooth = Some((Transition::Algebraic, 1.0));
        let switch = LateSwitch::Delayed { delay: 1.0, smooth, history: History::Constant };
        let text = "states = ['x']\nh = 'x/sqrt(81 - x*x)'\nplus = ['-9']\nminus = ['9']";
        let found = estimate::<1, 2>(text, switch, [0.0], &options).unwrap();
        assert!((found.exponent.value + 0.318_131_5).abs() < 3e-3, "{found:?}");
        let relay = LateSwitch::Relay { band: 1.0, inside: Inside::Sign };
        let apart = [options, settings(256.0)]
            .map(|o| estimate::<2, 4>(RELAY, relay, [0.3, 0.0], &o).unwrap().exponent.value);
        assert!((apart[0] - apart[1]).abs() > 1e-4 && (apart[0] - 0.2).abs() < 0.05, "{apart:?}");
    }

    /// x' = 2 x - sign(x(t - 1)) leaves for good.
    #[test]
    fn what_leaves_has_no_exponent() {
        let text = "states = ['x']\nh = 'x'\nplus = ['2*x - 1']\nminus = ['2*x + 1']";
        let switch = LateSwitch::Delayed { delay: 1.0, smooth: None, history: History::Constant };
        assert!(estimate::<1, 2>(text, switch, [0.3], &settings(1e4)).is_err());
    }
}
