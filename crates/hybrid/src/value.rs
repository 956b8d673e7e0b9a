//! Values of expressions in numbers.

use twofold_num::{Scalar, elementary};
use twofold_system::Expression;
use twofold_system::expression::{Function, General};

/// The value of an expression with the value of each name; not-a-number where a name has none.
/// Numbers with derivatives have those of the side that their values are on.
pub fn evaluate<S: Scalar>(e: &Expression, name: &dyn Fn(&str) -> Option<S>) -> S {
    let at = |e: &Expression| evaluate(e, name);
    let number = S::from_f64;
    let truth = |holds: bool| number(if holds { 1.0 } else { 0.0 });
    let holds = |e: &Expression| at(e).to_f64() != 0.0;
    match e {
        Expression::Name(n) => name(n).unwrap_or_else(|| number(f64::NAN)),
        Expression::Number(n) => number(n.value()),
        Expression::Pi => S::pi(),
        Expression::Neg(a) => -at(a),
        Expression::Add(a, b) => at(a) + at(b),
        Expression::Sub(a, b) => at(a) - at(b),
        Expression::Mul(a, b) => at(a) * at(b),
        Expression::Div(a, b) => at(a) / at(b),
        Expression::Power(a, n) => at(a).power(*n),
        // Zero has no sign.
        Expression::Call(Function::Sign, a) => match at(a) {
            zero if zero.to_f64() == 0.0 => number(0.0),
            a => a.sign(),
        },
        Expression::Call(f, a) => f.apply(at(a)),
        Expression::RealPower(a, b) => real_power(at(a), at(b)),
        Expression::Greater(a, b) => truth(at(a) > at(b)),
        Expression::And(a, b) => truth(holds(a) && holds(b)),
        Expression::Or(a, b) => truth(holds(a) || holds(b)),
        Expression::Not(a) => truth(!holds(a)),
        Expression::Apply(f, list) => match f {
            General::If => at(&list[if holds(&list[0]) { 1 } else { 2 }]),
            General::Min => {
                let least = list.iter().map(at).reduce(|a, b| if b < a { b } else { a });
                least.unwrap_or_else(|| number(f64::NAN))
            }
            General::Max => {
                let greatest = list.iter().map(at).reduce(|a, b| if b > a { b } else { a });
                greatest.unwrap_or_else(|| number(f64::NAN))
            }
            General::Heaviside => truth(at(&list[0]).to_f64() >= 0.0),
            General::Floor => number(at(&list[0]).to_f64().floor()),
            General::Mod => {
                let (a, b) = (at(&list[0]), at(&list[1]));
                // The quotient may be a whole number by rounding alone.
                match a - b * number((a / b).to_f64().floor()) {
                    beyond if beyond.to_f64() * b.to_f64() < 0.0 => number(0.0),
                    left => left,
                }
            }
            General::Clip => {
                let (x, low, high) = (at(&list[0]), at(&list[1]), at(&list[2]));
                if x < low {
                    low
                } else if x > high {
                    high
                } else {
                    x
                }
            }
            General::Atan2 => {
                let (y, x) = (at(&list[0]), at(&list[1]));
                let (y0, x0) = (y.to_f64(), x.to_f64());
                let value = number(elementary::atan2(y0, x0));
                let square = x0 * x0 + y0 * y0;
                // Zero, with the derivative of the angle.
                let turn = (y.scale(x0) - x.scale(y0)).scale(1.0 / square);
                if square > 0.0 && turn.to_f64() == 0.0 { value + turn } else { value }
            }
            General::Sinh
            | General::Cosh
            | General::Asin
            | General::Acos
            | General::Log10
            | General::Log => smooth(*f, at(&list[0])),
        },
    }
}

/// a^b = exp(b ln a), and 0^b = 0 for positive b.
fn real_power<S: twofold_num::Elementary>(a: S, b: S) -> S {
    (b * a.ln()).exp()
}

/// A smooth function of one number made of those that every number type has. Sinh through tanh
/// keeps its digits near zero.
pub(crate) fn smooth<S: twofold_num::Elementary>(f: General, x: S) -> S {
    let number = S::from_f64;
    let cosh = |x: S| {
        let e = x.exp();
        (e + S::one() / e).scale(0.5)
    };
    match f {
        General::Sinh => x.tanh() * cosh(x),
        General::Cosh => cosh(x),
        General::Asin => (x / ((S::one() - x) * (S::one() + x)).sqrt()).atan(),
        General::Acos => ((S::one() - x) / (S::one() + x)).sqrt().atan().scale(2.0),
        General::Log10 => x.ln() / number(10.0).ln(),
        General::Log => x.ln(),
        _ => number(f64::NAN),
    }
}

/// [`real_power`] of recorded numbers.
pub(crate) fn power<S: twofold_num::Elementary>(a: S, b: S) -> S {
    real_power(a, b)
}
