//! Values of expressions in numbers.

use twofold_num::elementary;
use twofold_system::Expression;
use twofold_system::expression::General;

/// The value of an expression in `f64` with the value of each name; not-a-number where a name has
/// none.
pub fn evaluate(e: &Expression, name: &dyn Fn(&str) -> Option<f64>) -> f64 {
    let at = |e: &Expression| evaluate(e, name);
    let truth = |holds: bool| if holds { 1.0 } else { 0.0 };
    match e {
        Expression::Name(n) => name(n).unwrap_or(f64::NAN),
        Expression::Number(n) => n.value(),
        Expression::Pi => std::f64::consts::PI,
        Expression::Neg(a) => -at(a),
        Expression::Add(a, b) => at(a) + at(b),
        Expression::Sub(a, b) => at(a) - at(b),
        Expression::Mul(a, b) => at(a) * at(b),
        Expression::Div(a, b) => at(a) / at(b),
        Expression::Power(a, n) => twofold_num::Elementary::power(at(a), *n),
        Expression::Call(f, a) => f.apply(at(a)),
        Expression::RealPower(a, b) => real_power(at(a), at(b)),
        Expression::Greater(a, b) => truth(at(a) > at(b)),
        Expression::And(a, b) => truth(at(a) != 0.0 && at(b) != 0.0),
        Expression::Or(a, b) => truth(at(a) != 0.0 || at(b) != 0.0),
        Expression::Not(a) => truth(at(a) == 0.0),
        Expression::Apply(f, list) => match f {
            General::If => at(&list[if at(&list[0]) != 0.0 { 1 } else { 2 }]),
            General::Min => {
                list.iter().map(at).reduce(|a, b| if b < a { b } else { a }).unwrap_or(f64::NAN)
            }
            General::Max => {
                list.iter().map(at).reduce(|a, b| if b > a { b } else { a }).unwrap_or(f64::NAN)
            }
            General::Heaviside => truth(at(&list[0]) >= 0.0),
            General::Floor => at(&list[0]).floor(),
            General::Mod => {
                let (a, b) = (at(&list[0]), at(&list[1]));
                a - b * (a / b).floor()
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
            General::Atan2 => elementary::atan2(at(&list[0]), at(&list[1])),
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
