//! Replaces sign(h) by 1 in f+ and by -1 in f-.
//!
//! Friction is often written with `sign(v)` in both fields though h = v is the switching function
//! itself. Taken literally, the jump would stay in the smoothed system, and sliding on it would be
//! steps of no length; and at h = 0 neither field would have its limit. So in f+ the sign of h is
//! 1, and in f- it is -1. An absolute value has no jump, and stays.

use twofold_num::Decimal;
use twofold_num::tape::{Node, Operation, Recorded, Replay, Tape};

/// The tape of h, f+ and f- in which the sign of h, or of a constant times it, is that of the
/// field's own side.
pub(super) fn on_own_sides(tape: Tape) -> Tape {
    let (needed, h, operations) = (tape.needed(), tape.outputs()[0], tape.operations());
    let is_absolute = |node: Node| {
        matches!(operations[node], Operation::Mul(a,
        b) if operations[b] == Operation::Sign(a))
    };
    let absolutes: Vec<Node> =
        (0..operations.len()).filter(|node| needed[*node] && is_absolute(*node)).collect();
    // Uses of a sign outside of absolute values.
    let mut used = vec![false; operations.len()];
    tape.outputs().iter().for_each(|output| used[*output] = true);
    for node in (0..operations.len()).filter(|node| needed[*node] && !is_absolute(*node)) {
        operations[node].arguments().for_each(|a| used[a] = true);
    }
    let sign = |node: Node| match operations[node] {
        Operation::Sign(a) if needed[node] && used[node] => Some((node, multiple(&tape, a, h)?)),
        _ => None,
    };
    let signs: Vec<(Node, f64)> = (0..operations.len()).filter_map(sign).collect();
    if signs.is_empty() {
        return tape;
    }
    let n = tape.variables();
    Tape::record(n, |x| {
        let h = Replay::new(&tape, x).output(0);
        let field = |side: f64, outputs: std::ops::RangeInclusive<usize>| -> Vec<Recorded> {
            let mut replay = Replay::new(&tape, x);
            absolutes.iter().for_each(|node| {
                replay.operation(*node);
            });
            for (node, sign) in &signs {
                replay.set(*node, Recorded::constant(&Decimal::from(side * sign)));
            }
            outputs.map(|i| replay.output(i)).collect()
        };
        let (plus, minus) = (field(1.0, 1..=n), field(-1.0, n + 1..=2 * n));
        std::iter::once(h).chain(plus).chain(minus).collect()
    })
}

/// The sign of the constant that `node` is h times, if it is one.
fn multiple(tape: &Tape, node: Node, h: Node) -> Option<f64> {
    if equal(tape, node, h) {
        return Some(1.0);
    }
    let constant = |node: Node| match tape.operations()[node] {
        Operation::Constant(i) => Some(tape.constants()[i].value().signum()),
        Operation::Neg(a) => match tape.operations()[a] {
            Operation::Constant(i) => Some(-tape.constants()[i].value().signum()),
            _ => None,
        },
        _ => None,
    };
    let of_constant = |operation: Operation| match operation {
        Operation::Neg(a) => Some((a, -1.0)),
        Operation::Mul(a, b) => constant(a).map(|c| (b, c)).or_else(|| Some((a, constant(b)?))),
        Operation::Div(a, b) => Some((a, constant(b)?)),
        _ => None,
    };
    match (tape.operations()[node], tape.operations()[h]) {
        (Operation::Sub(a, b), Operation::Sub(c, d)) if equal(tape, a, d) && equal(tape, b, c) => {
            Some(-1.0)
        }
        (one, other) => {
            if let Some((inner, sign)) = of_constant(one) {
                return Some(sign * multiple(tape, inner, h)?);
            }
            let (inner, sign) = of_constant(other)?;
            Some(sign * multiple(tape, node, inner)?)
        }
    }
}

/// Whether two operations are the same function of the same arguments, as far as little work shows.
fn equal(tape: &Tape, a: Node, b: Node) -> bool {
    same(tape, a, b, &mut 1000)
}

fn same(tape: &Tape, a: Node, b: Node, left: &mut u32) -> bool {
    if a == b || *left == 0 {
        return a == b;
    }
    *left -= 1;
    let (one, other) = (tape.operations()[a], tape.operations()[b]);
    match (one, other) {
        (Operation::Constant(i), Operation::Constant(j)) => {
            tape.constants()[i] == tape.constants()[j]
        }
        (Operation::Parameter(i), Operation::Parameter(j)) => {
            tape.parameters()[i].name == tape.parameters()[j].name
        }
        (Operation::Variable(i), Operation::Variable(j)) => i == j,
        _ => {
            std::mem::discriminant(&one) == std::mem::discriminant(&other)
                && one.arguments().count() > 0
                && one.arguments().zip(other.arguments()).all(|(a, b)| same(tape, a, b, left))
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::{Definition, System};

    fn fields(h: &str, term: &str, v: f64) -> [f64; 2] {
        let text = format!(
            "name = \"case\"\nstates = [\"x\", \"v\"]\nh = {h:?}\nplus = [\"v\", {term:?}]\nminus \
                = [\"v\", {term:?}]\n\
             [parameters]\nbelt = 0.5\n"
        );
        let values = System::new(Definition::from_toml(&text, "case").unwrap()).tape().clone();
        let values = (values.outputs().to_vec(), values.values(&[1.0, v]));
        [values.1[values.0[2]], values.1[values.0[4]]]
    }

    #[test]
    fn the_sign_of_h_is_that_of_the_side() {
        for v in [-2.0, 0.0, 3.0] {
            assert_eq!(fields("v", "x*sign(v)", v), [1.0, -1.0]);
            assert_eq!(fields("v", "x*sign(-v)", v), [-1.0, 1.0]);
            assert_eq!(fields("v", "x*sign(3*v)", v), [1.0, -1.0]);
            assert_eq!(fields("v - belt", "x*sign(v - belt)", v), [1.0, -1.0]);
            assert_eq!(fields("-2*(v - belt)", "x*sign(v - belt)", v), [-1.0, 1.0]);
            assert_eq!(fields("v - belt", "x*sign(belt - v)", v), [-1.0, 1.0]);
        }
        // Other signs, and absolute values, are as they are written.
        assert_eq!(fields("v", "x*sign(v - belt)", 0.25), [-1.0; 2]);
        assert_eq!(fields("v", "x*abs(v)", -2.0), [2.0; 2]);
        assert_eq!(fields("v", "x*abs(v) + sign(v)", -2.0), [3.0, 1.0]);
    }
}
