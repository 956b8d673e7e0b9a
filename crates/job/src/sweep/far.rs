//! A region that no orbit of the caricature leaves.
//!
//! With w = |x|^2 the caricature's y and z obey y' >= -m + (alpha - beta y) w and the same for z,
//! where m is the most that the constant parts can take away. On the edge y = c of the quadrant y,
//! z >= c is w >= 2 c^2, so wherever (alpha - beta c) 2 c^2 > m no orbit leaves the quadrant,
//! whatever its x. Inside, x falls where it is positive and rises where it is negative: the orbit
//! slides to the stiff state near (0, alpha/beta, alpha/beta), where an explicit method needs some
//! 10^4 steps per unit of time. A run that enters the quadrant ends in that state; following it
//! further would only look like a hang.

use crate::spec::{RunSpec, SwitchSpec};
use twofold_num::elementary::sqrt;
use twofold_system::Transition;
use twofold_system::caricature::MinusSign;

/// The corner c of the largest quadrant y, z >= c that no orbit of the run's system leaves; `None`
/// if there is none, or the system is another one. Kicks are taken to be too small to throw an
/// orbit out again.
pub(super) fn corner(run: &RunSpec) -> Option<f64> {
    let c = run.system.compiled()?;
    if c.first_component_of_minus != MinusSign::Equation4 || !(c.alpha > 0.0 && c.beta > 0.0) {
        return None;
    }
    // A perturbed transition function exceeds [0, 1] by this much at most.
    let excess = match run.switch {
        SwitchSpec::Smoothed { eps, transition: Transition::PerturbedTanh { sigma } } => {
            sigma.abs() * sqrt(eps)
        }
        _ => 0.0,
    };
    // The smaller of each field's two constants, weighted as badly as the transition allows.
    let worst = |v: f64| (1.0 + excess) * v.min(1.0) - excess * v.max(1.0);
    let most = (-worst(c.v_plus)).max(-worst(c.v_minus)).max(0.0);
    let push = |y: f64| (c.alpha - c.beta * y) * 2.0 * y * y;
    let mut high = 2.0 * c.alpha / (3.0 * c.beta);
    if push(high) <= most {
        return None;
    }
    let mut low = 0.0;
    // The push grows up to there: halving finds the smallest place where it is enough.
    for _ in 0..200 {
        let middle = 0.5 * (low + high);
        if push(middle) > most { high = middle } else { low = middle }
    }
    Some(high)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spec::*;
    use nalgebra::SVector;
    use twofold_integrate::Schedule;
    use twofold_num::random::RandomStream;
    use twofold_system::{Caricature, PiecewiseSmooth};

    fn run(alpha: f64, beta: f64) -> RunSpec {
        RunSpec {
            system: Caricature::with_reinjection(alpha, beta).into(),
            switch: SwitchSpec::tanh(1e-3),
            start: vec![0.2, 0.0, -1.0],
            t_end: 20.0,
            method: MethodSpec::ndsolve_defaults(Method::Dopri5),
            schedule: Schedule::default(),
            observe: Observation::Section { coordinate: 1, value: 0.0 },
        }
    }

    #[test]
    fn no_orbit_leaves_the_quadrant() {
        for (alpha, beta) in [(1e-3, 1e-5), (1e-1, 1e-5), (1e-1, 1e-4)] {
            let corner = corner(&run(alpha, beta)).unwrap();
            assert!(corner < alpha / beta);
            let system = Caricature::with_reinjection(alpha, beta);
            let mut random = RandomStream::new(5, 0);
            for _ in 0..2000 {
                let x = random.uniform_in(-30.0, 30.0);
                let other = corner + random.uniform() * 2.0 * alpha / beta;
                let (at_y, at_z) =
                    (SVector::from([x, corner, other]), SVector::from([x, other, corner]));
                for (at_y, at_z) in [
                    (system.plus(&at_y), system.plus(&at_z)),
                    (system.minus(&at_y), system.minus(&at_z)),
                ] {
                    assert!(at_y[1] >= 0.0 && at_z[2] >= 0.0, "{alpha} {beta} {x} {other}");
                }
                assert!(system.plus(&at_y)[0] < 0.0 && system.minus(&at_y)[0] > 0.0);
            }
        }
    }

    /// The smallest y at which (alpha - beta y) 2 y^2 is what the constants can take away. tanh
    /// weighs them from 0 to 1; perturbed, it exceeds that by e = |sigma| sqrt(eps) = 0.1: of v and
    /// 1 are left at least (1 + e) times the smaller, less e times the larger.
    #[test]
    fn the_corner_is_where_the_push_is_enough() {
        let perturbed = SwitchSpec::Smoothed {
            eps: 0.04,
            transition: Transition::PerturbedTanh { sigma: -0.5 },
        };
        for (switch, v_plus, v_minus, taken) in [
            (SwitchSpec::tanh(0.04), -1.2, -1.4, 1.4),
            (SwitchSpec::tanh(0.04), -1.5, 0.5, 1.5),
            (perturbed, -1.2, -1.4, 1.1 * 1.4 + 0.1),
            (perturbed, 20.0, 0.5, 0.1 * 20.0 - 1.1),
        ] {
            let caricature =
                Caricature { v_plus, v_minus, ..Caricature::with_reinjection(0.1, 1e-3) };
            let corner =
                corner(&RunSpec { system: caricature.into(), switch, ..run(0.1, 1e-3) }).unwrap();
            let push = |y: f64| (0.1 - 1e-3 * y) * 2.0 * y * y;
            assert!((push(corner) - taken).abs() < 1e-12, "{taken}: {} at {corner}", push(corner));
            assert!(corner > 0.0 && corner < 10.0, "the smallest: {corner}");
        }
        // Nothing is taken away: the whole quadrant.
        let caricature =
            Caricature { v_plus: 0.5, v_minus: 2.0, ..Caricature::with_reinjection(0.1, 1e-3) };
        assert!(corner(&RunSpec { system: caricature.into(), ..run(0.1, 1e-3) }).unwrap() < 1e-50);
        for (alpha, beta) in [(0.0, 1e-5), (-0.1, 1e-5), (0.1, 0.0), (0.1, -1e-5)] {
            assert_eq!(corner(&run(alpha, beta)), None, "{alpha} {beta}");
        }
        let printed = MinusSign::PrintedInEquation5;
        let printed = Caricature {
            first_component_of_minus: printed,
            ..Caricature::with_reinjection(0.1, 1e-5)
        };
        assert_eq!(corner(&RunSpec { system: printed.into(), ..run(0.1, 1e-5) }), None);
    }

    #[test]
    fn without_room_there_is_no_far_state() {
        assert_eq!(corner(&run(1e-3, 1e-4)), None);
    }
}
