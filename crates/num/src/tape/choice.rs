//! Choice of the operations of a tape that become one instruction of a program.
//!
//! Dispatching an instruction and storing its result takes longer than most operations. So one
//! instruction performs all operations of one of the patterns below, the largest pattern first,
//! from the last operation back to the first (*maximal munch*: Cattell 1980). An operation is
//! merged into another's instruction only if nothing else uses its result; each operation rounds by
//! itself and operands keep their order, so no bit depends on the choice.

use super::{Node, Operation, Tape};

/// Operation of an instruction. `f` and `g` are its numbers: terms without variables, computed
/// beforehand.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Code {
    Add,
    Sub,
    Mul,
    Div,
    AddFixed,
    SubFixed,
    FixedSub,
    MulFixed,
    DivFixed,
    FixedDiv,
    Neg,
    Tanh,
    Exp,
    Ln,
    Sin,
    Cos,
    Sqrt,
    Atan,
    Erf,
    Sign,
    /// a b + c
    ProductPlus,
    /// c + a b
    PlusProduct,
    /// a b - c
    ProductMinus,
    /// c - a b
    MinusProduct,
    /// (a + b) c
    SumTimes,
    /// c (a + b)
    TimesSum,
    /// (a - b) c
    DifferenceTimes,
    /// c (a - b)
    TimesDifference,
    /// (f - a) c
    FixedSubTimes,
    /// c (f - a)
    TimesFixedSub,
    /// a g + f
    ScaledPlus,
    /// f - a g
    MinusScaled,
    /// (a + f) g
    SumScaled,
    /// (f - a g) c
    LineTimes,
    /// c (f - a g)
    TimesLine,
    /// a a + b b
    Squares,
    /// (a a + b b) + c c
    ThreeSquares,
    /// tanh(a / f)
    TanhOfQuotient,
    /// b + (a - b) c: what smoothing makes of two fields.
    Blend,
    /// f + (a - f) c: the same, where one field is a number ...
    BlendFromFixed,
    /// b + (f - b) c: ... or the other.
    BlendToFixed,
    /// (a + g) + ((a + f) - (a + g)) c: the same, where the fields differ by a number.
    BlendOfSums,
}

/// An operation, with those that are done in its instruction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Choice {
    pub code: Code,
    /// a, b, c: the results that are used; as many as the code speaks of, in this order, those in
    /// front.
    pub operands: [Option<Node>; 3],
    /// f, g; 0 where there is none.
    pub numbers: [f64; 2],
    /// The operations that need no instruction of their own.
    inside: [Option<Node>; 4],
}

impl Choice {
    fn new(code: Code, [a, b, c]: [Option<Node>; 3]) -> Self {
        Self { code, operands: [a, b, c], numbers: [0.0; 2], inside: [None; 4] }
    }

    fn one(code: Code, a: Node) -> Self {
        Self::new(code, [Some(a), None, None])
    }

    fn two(code: Code, a: Node, b: Node) -> Self {
        Self::new(code, [Some(a), Some(b), None])
    }

    fn three(code: Code, a: Node, b: Node, c: Node) -> Self {
        Self::new(code, [Some(a), Some(b), Some(c)])
    }

    /// With a and c, and no b.
    fn first_and_third(code: Code, a: Node, c: Node) -> Self {
        Self::new(code, [Some(a), None, Some(c)])
    }

    fn with(self, f: f64, g: f64) -> Self {
        Self { numbers: [f, g], ..self }
    }

    fn around<const M: usize>(mut self, nodes: [Node; M]) -> Self {
        for (place, node) in self.inside.iter_mut().zip(nodes) {
            *place = Some(node);
        }
        self
    }
}

/// For each operation that gets an instruction, which one. `needed` and `fixed` are the tape's.
pub(super) fn choices(tape: &Tape, needed: &[bool], fixed: &[Option<f64>]) -> Vec<Option<Choice>> {
    let operations = &tape.operations;
    let mut uses = vec![0_usize; operations.len()];
    let used = (0..operations.len())
        .filter(|node| needed[*node])
        .flat_map(|node| operations[node].arguments());
    used.chain(tape.outputs.iter().copied()).for_each(|node| uses[node] += 1);
    let terms = Terms { operations, fixed, uses: &uses };
    let mut done = vec![false; operations.len()];
    let mut chosen = vec![None; operations.len()];
    for node in (0..operations.len()).rev() {
        if !needed[node] || fixed[node].is_some() || done[node] {
            continue;
        }
        chosen[node] = terms.choice(node);
        for inside in chosen[node].iter().flat_map(|choice| choice.inside.iter().flatten()) {
            done[*inside] = true;
        }
    }
    chosen
}

/// A tape's operations as patterns see them.
struct Terms<'a> {
    operations: &'a [Operation],
    fixed: &'a [Option<f64>],
    /// By how many operations and values each is used.
    uses: &'a [usize],
}

impl Terms<'_> {
    /// The operation at `node`, if it depends on variables and nothing but one other operation uses
    /// it.
    fn own(&self, node: Node) -> Option<Operation> {
        self.used(node, 1)
    }

    /// The operation at `node`, if it depends on variables and is used so often.
    fn used(&self, node: Node, times: usize) -> Option<Operation> {
        (self.fixed[node].is_none() && self.uses[node] == times).then(|| self.operations[node])
    }

    fn is_fixed(&self, node: Node) -> bool {
        self.fixed[node].is_some()
    }

    /// The term that varies and the number, of two of which one is a number.
    fn varying_and_number(&self, a: Node, b: Node) -> Option<(Node, f64)> {
        match (self.fixed[a], self.fixed[b]) {
            (Some(number), None) => Some((b, number)),
            (None, Some(number)) => Some((a, number)),
            _ => None,
        }
    }

    /// x and y, if `node` is their product and belongs to one other operation; neither is a number.
    fn product(&self, node: Node) -> Option<(Node, Node)> {
        match self.own(node)? {
            Operation::Mul(x, y) if !self.is_fixed(x) && !self.is_fixed(y) => Some((x, y)),
            _ => None,
        }
    }

    /// x, if `node` is its square and belongs to one other operation.
    fn square(&self, node: Node) -> Option<Node> {
        self.product(node).and_then(|(x, y)| (x == y).then_some(x))
    }

    /// x and the number, if `node` is x times a number and belongs to one other operation.
    fn scaled(&self, node: Node) -> Option<(Node, f64)> {
        match self.own(node)? {
            Operation::Mul(x, y) => self.varying_and_number(x, y),
            _ => None,
        }
    }

    /// None for what has no instruction: a variable.
    fn choice(&self, node: Node) -> Option<Choice> {
        Some(match self.operations[node] {
            Operation::Add(a, b) => self.sum(a, b),
            Operation::Sub(a, b) => self.difference(a, b),
            Operation::Mul(a, b) => self.product_of(a, b),
            Operation::Div(a, b) => match (self.fixed[a], self.fixed[b]) {
                (Some(f), _) => Choice::one(Code::FixedDiv, b).with(f, 0.0),
                (_, Some(f)) => Choice::one(Code::DivFixed, a).with(f, 0.0),
                _ => Choice::two(Code::Div, a, b),
            },
            Operation::Tanh(a) => match self.own(a) {
                // x is no number where y is one: the quotient would be one.
                Some(Operation::Div(x, y)) => match self.fixed[y] {
                    Some(f) => Choice::one(Code::TanhOfQuotient, x).with(f, 0.0).around([a]),
                    None => Choice::one(Code::Tanh, a),
                },
                _ => Choice::one(Code::Tanh, a),
            },
            Operation::Neg(a) => Choice::one(Code::Neg, a),
            Operation::Exp(a) => Choice::one(Code::Exp, a),
            Operation::Ln(a) => Choice::one(Code::Ln, a),
            Operation::Sin(a) => Choice::one(Code::Sin, a),
            Operation::Cos(a) => Choice::one(Code::Cos, a),
            Operation::Sqrt(a) => Choice::one(Code::Sqrt, a),
            Operation::Atan(a) => Choice::one(Code::Atan, a),
            Operation::Erf(a) => Choice::one(Code::Erf, a),
            Operation::Sign(a) => Choice::one(Code::Sign, a),
            Operation::Variable(_)
            | Operation::Constant(_)
            | Operation::Parameter(_)
            | Operation::Pi => return None,
        })
    }

    /// a + b.
    fn sum(&self, a: Node, b: Node) -> Choice {
        if let Some(blend) = self.blend(a, b) {
            return blend;
        }
        if let Some((x, f)) = self.varying_and_number(a, b) {
            return match self.scaled(x) {
                Some((y, g)) => Choice::one(Code::ScaledPlus, y).with(f, g).around([x]),
                None => Choice::one(Code::AddFixed, x).with(f, 0.0),
            };
        }
        if let Some(z) = self.square(b) {
            if let Some(Operation::Add(p, q)) = self.own(a)
                && let (Some(x), Some(y)) = (self.square(p), self.square(q))
            {
                return Choice::three(Code::ThreeSquares, x, y, z).around([a, b, p, q]);
            }
            if let Some(y) = self.square(a) {
                return Choice::two(Code::Squares, y, z).around([a, b]);
            }
        }
        match (self.product(b), self.product(a)) {
            (Some((x, y)), _) => Choice::three(Code::PlusProduct, x, y, a).around([b]),
            (_, Some((x, y))) => Choice::three(Code::ProductPlus, x, y, b).around([a]),
            _ => Choice::two(Code::Add, a, b),
        }
    }

    /// base + (x - base) c.
    fn blend(&self, base: Node, product: Node) -> Option<Choice> {
        let (difference, c) = self.product(product)?;
        let Operation::Sub(x, subtracted) = self.own(difference)? else { return None };
        if subtracted != base {
            return None;
        }
        let inside = [product, difference];
        Some(match (self.fixed[x], self.fixed[base]) {
            // A difference of numbers is one itself.
            (_, Some(f)) => {
                Choice::first_and_third(Code::BlendFromFixed, x, c).with(f, 0.0).around(inside)
            }
            (Some(f), None) => Choice::new(Code::BlendToFixed, [None, Some(base), Some(c)])
                .with(f, 0.0)
                .around(inside),
            (None, None) => match (self.plus_number(x, 1), self.plus_number(base, 2)) {
                (Some((y, f)), Some((z, g))) if y == z => {
                    Choice::first_and_third(Code::BlendOfSums, y, c)
                        .with(f, g)
                        .around([product, difference, x, base])
                }
                _ => Choice::three(Code::Blend, x, base, c).around(inside),
            },
        })
    }

    /// The other term and the number, if `node`, which is used so often, is a sum with a number.
    fn plus_number(&self, node: Node, times: usize) -> Option<(Node, f64)> {
        match self.used(node, times)? {
            Operation::Add(a, b) => self.varying_and_number(a, b),
            _ => None,
        }
    }

    /// a - b.
    fn difference(&self, a: Node, b: Node) -> Choice {
        match (self.fixed[a], self.fixed[b]) {
            (Some(f), _) => match self.scaled(b) {
                Some((x, g)) => Choice::one(Code::MinusScaled, x).with(f, g).around([b]),
                None => Choice::one(Code::FixedSub, b).with(f, 0.0),
            },
            (_, Some(f)) => Choice::one(Code::SubFixed, a).with(f, 0.0),
            _ => match (self.product(b), self.product(a)) {
                (Some((x, y)), _) => Choice::three(Code::MinusProduct, x, y, a).around([b]),
                (_, Some((x, y))) => Choice::three(Code::ProductMinus, x, y, b).around([a]),
                _ => Choice::two(Code::Sub, a, b),
            },
        }
    }

    /// a b.
    fn product_of(&self, a: Node, b: Node) -> Choice {
        if let Some((x, g)) = self.varying_and_number(a, b) {
            return match self.plus_number(x, 1) {
                Some((y, f)) => Choice::one(Code::SumScaled, y).with(f, g).around([x]),
                None => Choice::one(Code::MulFixed, x).with(g, 0.0),
            };
        }
        let first = self.factor(
            a,
            b,
            [Code::LineTimes, Code::FixedSubTimes, Code::SumTimes, Code::DifferenceTimes],
        );
        let second = || {
            self.factor(
                b,
                a,
                [Code::TimesLine, Code::TimesFixedSub, Code::TimesSum, Code::TimesDifference],
            )
        };
        first.or_else(second).unwrap_or_else(|| Choice::two(Code::Mul, a, b))
    }

    /// A sum or difference `term` and its product with c. `codes` for: f - a g, f - a, a + b, a -
    /// b.
    fn factor(
        &self,
        term: Node,
        c: Node,
        [line, from_number, sum, difference]: [Code; 4],
    ) -> Option<Choice> {
        Some(match self.own(term)? {
            Operation::Sub(x, y) => match (self.fixed[x], self.fixed[y]) {
                (Some(f), None) => match self.scaled(y) {
                    Some((z, g)) => {
                        Choice::first_and_third(line, z, c).with(f, g).around([term, y])
                    }
                    None => Choice::first_and_third(from_number, y, c).with(f, 0.0).around([term]),
                },
                (None, None) => Choice::three(difference, x, y, c).around([term]),
                _ => return None,
            },
            Operation::Add(x, y) if !self.is_fixed(x) && !self.is_fixed(y) => {
                Choice::three(sum, x, y, c).around([term])
            }
            _ => return None,
        })
    }
}
