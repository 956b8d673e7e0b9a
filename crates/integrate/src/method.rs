//! Methods by name: the one place where a name becomes a stepper.

use serde::{Deserialize, Serialize};

use super::step::{Stepper, Tolerance};
use super::taylor::Precision;
use super::{Dopri5, Guarded, Layered, Lsoda, Radau5, Taylor};
use twofold_num::MultiFloat;

/// Precisions of [`Method::TaylorExtended`], in bits: double-double numbers, then those of
/// [`MultiFloat`].
pub const PRECISIONS: [u16; 2] = [106, 192];

/// An integration method.
///
/// ```
/// use twofold_integrate::Method;
/// assert!(Method::ALL.iter().any(|method| method.name() == "lsoda"));
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Method {
    /// LSODA: Adams and BDF with automatic switching.
    Lsoda,
    /// Dormand-Prince 5(4).
    Dopri5,
    /// Radau IIA of order 5.
    Radau5,
    /// Taylor series that resolve the layer, in f64.
    Taylor,
    /// The same in double-double arithmetic, about 32 digits: the reference. The equation's
    /// constants and the start are the decimal numbers that they are written as: 0.1 is one tenth.
    TaylorExtended,
    /// Taylor series outside the layer and its own variable inside, for smoothed systems that are
    /// polynomials outside.
    Layered,
}

/// A computation over any stepper. It is a trait because a stepper's type depends on the method.
pub trait WithStepper<const N: usize> {
    /// The result.
    type Answer;
    /// Does it.
    fn with<M: Stepper<N>>(self, stepper: M) -> Self::Answer;
}

impl Method {
    /// Every method.
    pub const ALL: [Method; 6] = [
        Method::Lsoda,
        Method::Dopri5,
        Method::Radau5,
        Method::Taylor,
        Method::TaylorExtended,
        Method::Layered,
    ];

    /// The name on the command line, in files and in small print.
    pub fn name(self) -> &'static str {
        match self {
            Method::Lsoda => "lsoda",
            Method::Dopri5 => "dopri5",
            Method::Radau5 => "radau5",
            Method::Taylor => "taylor",
            Method::TaylorExtended => "taylor-extended",
            Method::Layered => "layered",
        }
    }

    /// Makes a stepper of this method and passes it to `user`.
    pub fn with_stepper<U: WithStepper<N>, const N: usize>(
        self,
        tolerance: Tolerance,
        user: U,
    ) -> U::Answer {
        match self {
            Method::Lsoda => user.with(Guarded::new(Lsoda::new(tolerance), tolerance)),
            Method::Dopri5 => user.with(Guarded::new(Dopri5::new(tolerance), tolerance)),
            Method::Radau5 => user.with(Guarded::new(Radau5::new(tolerance), tolerance)),
            Method::Taylor => user.with(Taylor::new(tolerance)),
            Method::TaylorExtended => {
                user.with(Taylor::extended(tolerance).with_decimal_constants())
            }
            Method::Layered => user.with(Layered::new(tolerance)),
        }
    }
}

/// [`Method::TaylorExtended`] with numbers of `bits` bits (the next of [`PRECISIONS`], at most the
/// last) and series of degree `order`, or of the one that the tolerance asks for.
pub fn with_extended<U: WithStepper<N>, const N: usize>(
    bits: u16,
    order: Option<u16>,
    tolerance: Tolerance,
    user: U,
) -> U::Answer {
    fn of_order<const N: usize, S: Precision>(
        stepper: Taylor<N, S>,
        order: Option<u16>,
    ) -> Taylor<N, S> {
        let stepper = stepper.with_decimal_constants();
        match order {
            Some(order) => stepper.with_order(usize::from(order)),
            None => stepper,
        }
    }
    match bits {
        0..=106 => user.with(of_order(Taylor::extended(tolerance), order)),
        _ => user.with(of_order(Taylor::<N, MultiFloat<3>>::multi(tolerance), order)),
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Vector1, Vector2};

    use super::*;
    use crate::{DriveOptions, Ignore, Statistics, drive};
    use nalgebra::SVector;
    use twofold_num::Elementary;
    use twofold_system::VectorField;

    #[test]
    fn names_are_those_of_files() {
        for method in Method::ALL {
            assert_eq!(serde_json::to_string(&method).unwrap(), format!("{:?}", method.name()));
        }
    }

    /// x' = x^2 from 0.7: x = 1/(1/0.7 - t). Not from 1: with such numbers f64 and extended
    /// arithmetic may agree to the last bit.
    struct Growing;
    impl VectorField<1> for Growing {
        fn eval<S: Elementary>(&self, x: &SVector<S, 1>) -> SVector<S, 1> {
            Vector1::new(x[0] * x[0])
        }
    }

    struct ToOneHalf;
    impl WithStepper<1> for ToOneHalf {
        type Answer = (f64, Statistics);
        fn with<M: Stepper<1>>(self, mut stepper: M) -> Self::Answer {
            let end = drive(
                &Growing,
                Vector1::new(0.7),
                &DriveOptions::to(0.9),
                &mut stepper,
                &mut Ignore,
                &(),
            )
            .unwrap();
            (end.x[0], end.statistics)
        }
    }

    #[test]
    fn each_name_is_its_own_method() {
        let tolerance = Tolerance { rtol: 1e-10, atol: 1e-10 };
        let found = Method::ALL.map(|m| m.with_stepper(tolerance, ToOneHalf));
        for (x, s) in &found {
            assert!((x - 0.7 / (1.0 - 0.63)).abs() < 1e-8, "{x} {s:?}");
        }
        for (i, a) in found.iter().enumerate() {
            assert!(
                found[..i].iter().all(|b| a.1 != b.1 || a.0 != b.0),
                "two names do the same work: {found:?}"
            );
        }
    }

    /// x' = -sign(x - 0.5 sin(t)), held from where it comes to the curve, and x' = sign(sin(W t)),
    /// whose jumps are left each time; the time is the second state.
    enum Jumping {
        Held,
        Left,
    }
    const W: f64 = 1e4;
    impl VectorField<2> for Jumping {
        fn eval<S: Elementary>(&self, x: &SVector<S, 2>) -> SVector<S, 2> {
            let slope = match self {
                Jumping::Held => -(x[0] - x[1].sin().scale(0.5)).sign(),
                Jumping::Left => x[1].scale(W).sin().sign(),
            };
            Vector2::new(slope, S::one())
        }
    }

    struct Jump(Jumping, f64);
    impl WithStepper<2> for Jump {
        type Answer = Result<f64, crate::Failure>;
        fn with<M: Stepper<2>>(self, mut stepper: M) -> Self::Answer {
            let options = DriveOptions::to(self.1);
            let start = Vector2::new(0.3, 0.0);
            drive(&self.0, start, &options, &mut stepper, &mut Ignore, &()).map(|end| end.x[0])
        }
    }

    /// Steps across a jump that attracts from both sides get nowhere.
    #[test]
    fn a_motion_that_is_held_at_a_jump_is_refused() {
        let tolerance = Tolerance { rtol: 1e-8, atol: 1e-8 };
        let others = |method: &Method| *method != Method::Layered;
        for method in Method::ALL.into_iter().filter(others) {
            let held = method.with_stepper(tolerance, Jump(Jumping::Held, 3.0));
            let Err(crate::Failure::StaysOnJump { t, what, .. }) = held else {
                panic!("{method:?} {held:?}")
            };
            // 0.3 - t = 0.5 sin(t).
            assert!((t - 0.2003).abs() < 1e-2, "{method:?} {t} {what}");
            let end = 25.0 * std::f64::consts::PI / W;
            let left = method.with_stepper(tolerance, Jump(Jumping::Left, end)).unwrap();
            // Errors of steps over 25 jumps.
            assert!((left - 0.3 - std::f64::consts::PI / W).abs() < 2e-5, "{method:?} {left}");
        }
    }

    struct ToItsName;
    impl WithStepper<1> for ToItsName {
        type Answer = (String, u64);
        fn with<M: Stepper<1>>(self, stepper: M) -> Self::Answer {
            let name = std::any::type_name::<M>();
            (
                name.rsplit(['<', ':']).next().unwrap_or(name).to_owned(),
                stepper.statistics().highest_order,
            )
        }
    }

    #[test]
    fn so_many_bits_are_so_many() {
        let tolerance = Tolerance { rtol: 1e-30, atol: 1e-30 };
        let number = |bits| {
            let name = with_extended(bits, Some(17), tolerance, ToItsName).0;
            let parts = name.trim_end_matches('>').to_owned();
            if parts == "DoubleDouble" { 106 } else { 64 * parts.parse::<u16>().unwrap() }
        };
        assert_eq!(PRECISIONS.map(number), PRECISIONS);
        // The next that there is, at most the last.
        assert_eq!([1, 105, 107, 193, 5000].map(number), [106, 106, 192, 192, 192]);
        for bits in PRECISIONS {
            assert_eq!(with_extended(bits, Some(17), tolerance, ToItsName).1, 17);
            assert_eq!(with_extended(bits, None, tolerance, ToItsName).1, 36);
        }
    }
}
