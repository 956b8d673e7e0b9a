//! The law of the passage in the inner problem: what follows from one passage near the canard,
//! again in exact arithmetic (`proofs/inner_law.rs` derives it).

use serde::Deserialize;

use super::check::{Bounds, Check, decimal, holds, need, range, tight};
use super::orbit::Inner;
use super::rational::{Range, Rational};
use super::recompute::Known;
use super::theorem::{InnerLaw as Shown, Problem};

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct InnerLaw {
    problem: Problem,
    least_s: String,
    s0: String,
    x0: String,
    p1: String,
    p2: String,
    cones: [String; 3],
    largest_q: String,
    state_at_zero: [Bounds; 2],
    derivative: [[Bounds; 2]; 2],
    mu_inverse: Bounds,
    f: Bounds,
    exit: Bounds,
    growth: [Bounds; 2],
}

/// An interval whose bounds are rounded outward to a grid far below what matters, so that they stay
/// short.
#[derive(Clone)]
struct X(Range);

impl X {
    fn of(text: &str) -> Check<Self> {
        Ok(Self(Range::point(&decimal(text)?)))
    }
    fn whole(n: i64) -> Self {
        Self(Range::point(&Rational::whole(n)))
    }
    fn plus(&self, o: &Self) -> Self {
        Self((&self.0 + &o.0).rounded())
    }
    fn less(&self, o: &Self) -> Self {
        Self((&self.0 - &o.0).rounded())
    }
    fn times(&self, o: &Self) -> Self {
        Self((&self.0 * &o.0).rounded())
    }
    fn over(&self, o: &Self) -> Check<Self> {
        let inverse = o.0.inverse().ok_or("divisors are not zero")?;
        Ok(Self((&self.0 * &inverse).rounded()))
    }
    fn ln(&self) -> Check<Self> {
        Ok(Self(self.0.ln().ok_or("logarithms are of positive numbers")?))
    }
    fn hull(&self, o: &Self) -> Self {
        Self(self.0.hull(&o.0))
    }
    fn negative(&self) -> Self {
        Self::whole(0).less(self)
    }
    /// Its largest absolute value, as a number.
    fn magnitude(&self) -> Self {
        Self(Range::point(&self.0.magnitude()))
    }
    /// All numbers no larger than its largest absolute value.
    fn symmetric(&self) -> Self {
        let m = self.magnitude();
        m.hull(&m.negative())
    }
    /// Its absolute values.
    fn sizes(&self) -> Self {
        let zero = Rational::whole(0);
        if self.0.high < zero {
            self.negative()
        } else if self.0.low > zero {
            self.clone()
        } else {
            Self::whole(0).hull(&self.magnitude())
        }
    }
    fn at_least(&self, o: &Self) -> bool {
        self.0.low >= o.0.high
    }
}

pub(super) fn inner_law(known: &Known, shown: &Shown, c: &InnerLaw) -> Check<Vec<String>> {
    let (zero, one, two) = (X::whole(0), X::whole(1), X::whole(2));
    let half = one.over(&two)?;
    let wanted = &shown.problem;
    for problem in [&c.problem, wanted] {
        need(problem.transition == "tanh", "the transition is tanh")?;
    }
    let is = |text: &str, want: &str, name: &str| -> Check<X> {
        need(decimal(text)? == decimal(want)?, format!("{name} = {want}"))?;
        X::of(want)
    };
    let v = [
        is(&c.problem.v_plus, &wanted.v_plus, "v+")?,
        is(&c.problem.v_minus, &wanted.v_minus, "v-")?,
    ];
    let (p1, p2) = (
        is(&c.p1, &shown.largest, "the largest |p| coming in")?,
        is(&c.p2, &shown.largest, "the exit's |p|")?,
    );
    let (s0, x0, least) = (X::of(&c.s0)?, X::of(&c.x0)?, X::of(&c.least_s)?);
    let q0 = X::of(&c.largest_q)?;
    let [c1, c2, k] = [X::of(&c.cones[0])?, X::of(&c.cones[1])?, X::of(&c.cones[2])?];
    for x in [&s0, &x0, &q0, &c1, &c2, &k] {
        need(x.0.low > Rational::whole(0), "the certificate's lengths are positive")?;
    }
    need(least.at_least(&s0), "orbits come in before the passage near the canard begins")?;
    // Eigenvalues -w, -l and phi on the canard: the roots of e^2 - (v+ + v-) e + v+ v- - 1, and y/z
    // = e - v-.
    let (mean, apart) = (v[0].plus(&v[1]).times(&half), v[0].less(&v[1]).times(&half));
    let root = X(apart.times(&apart).plus(&one).0.sqrt().ok_or("the eigenvalues are real")?);
    let (w, l) = (mean.negative().less(&root), mean.negative().plus(&root));
    let g = v[0].less(&v[1]);
    let phi = root.plus(&apart).over(&one.plus(&root).plus(&apart))?;
    let inverse_mu = l.over(&w)?;
    let scale = Rational::whole(1);
    tight(&range(c.mu_inverse)?, &inverse_mu.0, &scale, "1/mu")?;
    let slope_at = |off: &X| half.less(&two.times(&off.times(off)));
    let away = |p: &X| phi.less(&half).plus(&p.symmetric()).magnitude();
    let square = |x: &X| x.times(x);
    let (s0s, x0s) = (square(&s0), square(&x0));

    // Coming in.
    let least_1 = slope_at(&away(&p1));
    let (lean_1, lean_2) = (c1.over(&s0s)?, c2.over(&x0s)?);
    let (rest_1, rest_2) = (one.less(&lean_1), one.less(&lean_2));
    for rest in [&rest_1, &rest_2] {
        need(rest.0.low > half.0.high, "the cones are narrow")?;
    }
    need(
        least_1.times(&c1).times(&rest_1).at_least(&l.less(&w).plus(&g.times(&p1))),
        "the cone of incoming orbits is not left",
    )?;
    let tilt = g.times(&p1).over(&w)?;
    need(one.0.low > tilt.0.high, "s falls")?;
    let power = inverse_mu.over(&one.plus(&tilt))?;
    need(power.0.low > one.0.high, "|p| falls like a power")?;
    let lean = c1.over(&two.times(&s0s))?;
    let tilted = tilt.over(&power.less(&one).times(&rest_1))?;
    let excess = tilted.negative().hull(&lean.plus(&tilted).over(&rest_1.times(&one.less(&tilt)))?);
    let entrance = rest_1.ln()?.hull(&zero).less(&inverse_mu.times(&excess));
    let largest = p1
        .ln()?
        .less(&inverse_mu.less(&one).times(&least.ln()?))
        .plus(&inverse_mu.times(&s0.ln()?))
        .plus(&entrance);
    need(
        q0.ln()?.at_least(&X(Range::point(&largest.0.high))),
        "orbits from the least S on pass near enough to the canard",
    )?;

    // Past the singularity: numbers of the flow.
    let at_zero = [X(range(c.state_at_zero[0])?), X(range(c.state_at_zero[1])?)];
    let mut m = Vec::new();
    for row in c.derivative {
        m.push([X(range(row[0])?), X(range(row[1])?)]);
    }
    let ratio = m[0][0].times(&at_zero[0]).plus(&m[0][1].times(&at_zero[1]));
    let sign = ratio.sizes();
    need(sign.0.low > Rational::whole(0), "the side of the exit is known")?;
    let p_out = q0.times(&ratio.magnitude()).symmetric();
    need(p_out.0.high < p2.0.low, "orbits have not left before")?;
    let field = Inner {
        weak: w.0.clone(),
        strong: l.0.clone(),
        phi: phi.0.clone(),
        g: g.0.clone(),
        offset: Rational::whole(0),
    };
    // p/q coming in: 1/E with E between s0 - c1/s0 and s0.
    let incoming = one.over(&s0)?.hull(&one.over(&s0.less(&c1.over(&s0)?))?);
    let (state, derivative) =
        known.passage(&field, &incoming.0, [&s0.0.low, &x0.0.low], &q0.0.low)?;
    for i in 0..2 {
        holds(&at_zero[i].0, &state[i], "state_at_zero")?;
        for j in 0..2 {
            holds(&m[i][j].0, &derivative[i][j], "derivative")?;
        }
    }

    // Going out.
    let columns = [m[1][0].over(&m[0][0])?, m[1][1].over(&m[0][1])?];
    let share = m[0][1].times(&at_zero[1]).over(&ratio)?;
    let slope = columns[0].plus(&columns[1].less(&columns[0]).times(&share));
    let d = slope.negative();
    need(
        d.0.low >= Rational::whole(0) && c2.over(&x0)?.at_least(&d),
        "orbits enter the outgoing cone",
    )?;
    let least_2 = slope_at(&away(&p2));
    let (slow, fast) = (w.less(&g.times(&p2)), w.plus(&g.times(&p2)));
    need(slow.0.low > Rational::whole(0), "s falls")?;
    need(
        least_2.times(&c2).times(&rest_2).at_least(&l.plus(&c2.times(&fast).over(&x0s)?)),
        "the cone of outgoing orbits is not left",
    )?;
    let tilt = g.times(&p2).over(&w)?;
    let f = slope_at(&phi.less(&half)).over(&w)?;
    tight(&range(c.f)?, &f.0, &scale, "f")?;
    let weight = p2.times(&fast).over(&least_2.times(&rest_2))?;
    let steep = two
        .times(&one.less(&two.times(&phi)).magnitude().plus(&p2))
        .times(&w)
        .plus(&f.times(&w).times(&g));
    let bend = steep.over(&w.times(&slow))?.times(&weight).symmetric();
    let twice = two.times(&x0s);
    let tilted = g.times(&weight).over(&w.times(&x0s))?;
    let excess = tilted
        .negative()
        .hull(&c2.over(&twice)?.plus(&tilted).over(&rest_2.times(&one.less(&tilt)))?);
    let last = rest_2.ln()?.symmetric().plus(&zero.hull(&c2.over(&twice.times(&rest_2))?));
    let exit = bend.less(&inverse_mu.times(&excess)).plus(&last);
    let constant = p2
        .ln()?
        .plus(&f.times(&x0s).over(&two)?)
        .less(&inverse_mu.times(&x0.times(&s0).ln()?))
        .less(&sign.ln()?)
        .less(&entrance)
        .less(&exit);
    let scale = Rational::whole(100);
    tight(&range(c.exit)?, &constant.0, &scale, "the exit's constant")?;

    // Disturbances.
    let steepest = least_2.times(&rest_2).times(&rest_2);
    let (h1, g1) = (l.over(&steepest)?, fast.over(&steepest)?);
    let turned = k.over(&x0s)?;
    let shrink = two.times(&k).times(&fast).over(&least_2.times(&rest_2).times(&x0s))?;
    let side = k.less(&one.plus(&turned).times(&h1.plus(&k.times(&g1).over(&x0s)?))).less(&shrink);
    need(
        side.0.low > Rational::whole(0)
            && k.at_least(&shrink)
            && turned.0.high < one.0.low
            && l.at_least(&fast),
        "the cone of disturbances is not left",
    )?;
    let f_out = slope_at(&phi.plus(&p_out).less(&half));
    let speed = f_out.times(&x0.less(&d));
    let (move_x, move_d) = (w.less(&g.times(&p_out)).over(&speed)?, l.over(&speed)?.less(&d));
    let over = one.over(&twice.times(&rest_2))?;
    let spread = k.times(&over).hull(&c2.plus(&k).times(&over).negative());
    let mut said = Vec::new();
    for (j, name) in ["across", "along"].into_iter().enumerate() {
        let y = columns[j].less(&slope).plus(&move_d).over(&move_x)?;
        need(y.0.magnitude() <= turned.0.low, format!("disturbances {name} enter their cone"))?;
        let size = m[0][j].over(&ratio)?.sizes();
        let growth = size
            .times(&move_x)
            .times(&x0)
            .ln()?
            .less(&inverse_mu.times(&s0.ln()?))
            .less(&entrance)
            .plus(&spread);
        tight(&range(c.growth[j])?, &growth.0, &scale, &format!("the constant of growth {name}"))?;
        said.push(format!(
            "growth {name}: (1/mu - 1) ln S - ln|p| - ln x + K, K in {}",
            range(c.growth[j])?
        ));
    }
    said.insert(
        0,
        format!(
            "holds from S = {} on, a distance of {:.2} from the two-fold at eps = {}",
            c.least_s,
            least.0.high.approximately() * decimal(&shown.eps)?.approximately().sqrt(),
            shown.eps
        ),
    );
    said.insert(
        0,
        format!("exit: f x^2/2 - ln(x)/mu = (1/mu - 1) ln S - ln|p| + C, C in {}", range(c.exit)?),
    );
    said.insert(0, format!("the three cones are not left; 1/mu in {}", range(c.mu_inverse)?));
    said.push(
        "the passage from s0 to -x0 is enclosed anew, within the enclosures claimed".to_owned(),
    );
    Ok(said)
}
