//! Theorem. The law of the passage, in the inner problem: how far an orbit goes along the repelling
//! side before it leaves the layer, and how much a disturbance made at the singularity grows until
//! then, for *every* orbit that comes in from far enough away.
//!
//! The inner problem (docs/law.md; v+ = -1.2, v- = -1.4, tanh) has no eps: x = eps u, (y, z, t) =
//! sqrt(eps) (Y, Z, T),
//!
//! ```text
//! u' = -Y phi + Z (1 - phi),  Y' = phi + v- (1 - phi),  Z' = v+ phi + 1 - phi,
//! phi = (1 + tanh u)/2.
//! ```
//!
//! Let -w and -L be the weak and the strong eigenvalue of the desingularised sliding flow, mu =
//! w/L, and phi* the value of phi on the canard. In
//!
//! ```text
//! p = phi - phi*,  q = (1 - phi*) Z - phi* Y,  s = Y + Z,  F(p) = 2 (phi* + p) (1 - phi* - p),
//! g = v+ - v- = 0.2
//! ```
//!
//! it is, exactly (dphi/du = 2 phi (1 - phi) for tanh; phi* = (v- + w)/(v- + w - 1), so that (1 -
//! phi*, phi*) is the weak eigenvector),
//!
//! ```text
//! p' = F(p) (q - s p),   q' = -L p,   s' = -w + g p,
//! ```
//!
//! and the canard is p = q = 0. s falls all the time, from the attracting side (s > 0) to the
//! repelling one (s < 0). eps enters by where an orbit comes in: at distance y + z = s sqrt(eps).
//!
//! Statement. Let an orbit come in at s = S >= S0 with 0 < |p| <= p1 and q/p between S - c1/S and S
//! (that is where the sliding surface is). Then it first leaves |p| <= p2 at an s = -x, on a side
//! that is known from that of p, and with f = F(0)/w
//!
//! ```text
//! f x^2/2 - ln(x)/mu = (1/mu - 1) ln S - ln|p(S)| + C,
//! ln|dx/dp(0)|, ln|dx/dq(0)| = (1/mu - 1) ln S - ln|p(S)| - ln x + K,
//! ```
//!
//! dx/dp(0) and dx/dq(0) being the derivatives of the exit by the state where s = 0, and C and K in
//! intervals that do not depend on the orbit, nor on S. With S in proportion to eps^(-1/2) these
//! are the law: x^2 grows linearly in ln(1/eps), a disturbance along the layer by the power -(1/mu
//! - 1)/2 of eps, and one across (whose unit is eps instead of sqrt(eps)) by -1/(2 mu). And two
//!   orbits that come in with different p leave O(1/x) apart: what is carried in shrinks in
//!   proportion to sqrt(eps).
//!
//! Not proved: that the full equation follows the inner problem (terms of relative size eps;
//! matching at s of order eps^(-1/2)).
//!
//! Proof, in three parts. With E = q/p, always E' = -L - F E (E - s).
//!
//! 1. *Coming in*, s >= s0. R = s - E obeys R' = L - w + g p - F R (s - R), so that 0 <= R <= c1/s
//!    holds for good if F c1 (1 - c1/s0^2) >= L - w + g p1 for all |p| <= p1; |p| falls, since p'/p
//!    = -F R. And d ln|q|/d ln s = (1/mu)/((1 - R/s)(1 - g p/w)): integrated, |q(s0)| = |p(S)| S
//!    (s0/S)^(1/mu) times a number near 1, as R/s <= c1/s^2 and |p| falls like a power.
//! 2. *Past the singularity*, from s0 to -x0: (p, q) = d (a, b) with |d| <= d0, d constant.
//!    Validated Taylor steps (crates/rigor/src) for all d at once, and for the derivative by the
//!    state at s = 0, which by the mean value theorem also gives the state, because a = b = 0 is a
//!    solution.
//! 3. *Going out*, x = -s >= x0. D = -E obeys D' = L - F D (x - D), so that 0 <= D <= c2/x holds
//!    for good if F c2 (1 - c2/x0^2) >= L + c2 (w + g p2)/x0^2. Then p'/p = F (x - D) > 0. By F D
//!    (x - D) = L - D', ln(p2/|p(x0)|) is the integral of F x - L/(x - D) + D'/(x - D), which is f
//!    (x^2 - x0^2)/2 - ln(x/x0)/mu but for bounded terms. At equal |p|, disturbances (of x, of D) =
//!    (X, X y) obey X_l = -G (1 - y) X, y_l = -y - (1 - y)(H - G y), where l = ln|p|, G = (w - g
//!    p)/(F (x - D)^2), H = L/(F (x - D)^2); |y| <= k/x^2 holds for good if k - (1 + k/x0^2)(H1 + k
//!    G1/x0^2) - 2 k (w + g p2)/(F (1 - c2/x0^2) x0^2) > 0 with the largest x^2 H, x^2 G. So X x
//!    stays within bounds.

use nalgebra::SVector;
use serde_json::json;
use twofold::num::tape::Recorded;
use twofold::num::{Arithmetic, Elementary, FromDecimal, Interval, Tape};
use twofold::rigor::{AxisPlane, Flow, FlowOptions, Set};
use twofold_proofs::{bounds, digits, refuse, statement, write};

/// s at which the first part ends.
const S0: f64 = 8.0;
/// -s at which the third part begins.
const X0: f64 = 6.0;
/// Largest |p| of incoming orbits.
const P1: f64 = 0.05;
/// |p| at the exit.
const P2: f64 = 0.05;
/// Widths of the cones: c1, c2, k.
const CONES: [f64; 3] = [5.0, 6.0, 10.0];
/// Largest |q| at s0.
const Q0: f64 = 1e-8;
/// Its value in the integration's units, in which no state is much larger than 1 before -x0 (steps
/// are chosen by norms): a power of two.
const UNIT: f64 = 1.0 / 1024.0;
/// Largest e, of the same kind (crossings are enclosed by norms).
const E: f64 = 1.0 / 1_048_576.0;
/// States are as small as 1e-9 at s = 0.
const SETTINGS: FlowOptions = FlowOptions { tolerance: 1e-29, ..FlowOptions::PLAIN };
/// The least S.
const LEAST: f64 = 110.0;

fn decimal(x: f64) -> Interval {
    Interval::from_decimal(&x.into())
}

/// The smoothed two-fold in (a, b, s, e), where (p, q) = (a, b) e Q0/(E UNIT), |e| <= E; e is
/// constant. The square root of 1.01 is half the distance of the eigenvalues.
fn equation() -> Tape {
    Tape::record(4, |v: &[Recorded]| {
        let (a, b, s, e) = (v[0], v[1], v[2], v[3]);
        let c = Recorded::from_f64;
        let root = c(1.01).sqrt();
        let phi = (root + c(0.1)) / (root + c(1.1));
        let p = e * a * c(Q0) * c(1.0 / (E * UNIT));
        let rest = phi + p;
        let f = c(2.0) * rest * (Recorded::one() - rest);
        vec![f * (b - s * a), -(root + c(1.3)) * a, root - c(1.3) + c(0.2) * p, e * c(0.0)]
    })
}

/// Bounds on F and on the speed of s where |p| is small.
struct Near {
    least: Interval,
    slow: Interval,
    fast: Interval,
}

fn main() {
    println!("{}", statement("inner-law"));
    let (one, two) = (Interval::one(), decimal(2.0));
    let (g, root) = (decimal(0.2), decimal(1.01).sqrt());
    let (w, l) = (decimal(1.3) - root, decimal(1.3) + root);
    let phi = (root + decimal(0.1)) / (root + decimal(1.1));
    let inverse_mu = l / w;
    let (s0, x0) = (decimal(S0), decimal(X0));
    let [c1, c2, k] = CONES.map(decimal);
    // F = 1/2 - 2 (phi - 1/2)^2.
    let near = |p: f64| {
        let p = decimal(p);
        let away = (phi - decimal(0.5)) + Interval::symmetric(p.upper());
        let away = Interval::from_f64(away.magnitude());
        Near { least: decimal(0.5) - two * away * away, slow: w - g * p, fast: w + g * p }
    };
    let need = |holds: bool, what: &str| {
        if !holds {
            refuse(what);
        }
    };
    let at_least = |a: Interval, b: Interval| a.lower() >= b.upper();

    // Coming in.
    let (coming, (lean_1, lean_2)) = (near(P1), (c1 / (s0 * s0), c2 / (x0 * x0)));
    need(
        at_least(coming.least * c1 * (one - lean_1), l - w + g * decimal(P1))
            && lean_1.upper() < 0.5,
        "the incoming cone",
    );
    let tilt = g * decimal(P1) / w;
    let power = inverse_mu / (one + tilt);
    need(power.lower() > 1.0 && tilt.upper() < 1.0, "|p| falls like a power");
    // Integrals of R/s and of |g p/w| over ln s.
    let (lean, tilted) = (c1 / (two * s0 * s0), tilt / ((power - one) * (one - lean_1)));
    let excess = (-tilted).hull((lean + tilted) / ((one - lean_1) * (one - tilt)));
    let entrance = (one - lean_1).ln().hull(Interval::zero()) - inverse_mu * excess;
    println!(
        "  coming in: ln|q({S0})| = ln|p(S)| - (1/mu - 1) ln S + (ln {S0})/mu + [{:.4}, {:.4}]",
        entrance.lower(),
        entrance.upper()
    );
    let largest = decimal(P1).ln() - (inverse_mu - one) * decimal(LEAST).ln()
        + inverse_mu * s0.ln()
        + entrance;
    need(
        largest.upper() <= decimal(Q0).ln().lower(),
        "orbits from S0 on are small enough past the singularity",
    );

    // Past the singularity.
    let tape = equation();
    let mut flow = Flow::<Interval, 4>::new(&tape, SETTINGS);
    let axis = 2;
    let (e, unit) = (Interval::symmetric(E), Interval::from_f64(UNIT));
    let a = (unit / s0).hull(unit / (s0 * (one - lean_1)));
    let run = |flow: &mut Flow<Interval, 4>, set: Set<Interval, 4>, value: f64| {
        flow.next_crossing(&set, AxisPlane { axis, value }, 1e3)
            .unwrap_or_else(|e| refuse(&e.to_string()))
            .set
    };
    let start = Set::on_plane(SVector::from([a, unit, s0, e]), axis, S0, false);
    let middle = run(&mut flow, start, 0.0).hull();
    let at_zero = [middle[0], middle[1]];
    println!("  at s = 0: a = {}, b = {}", digits(at_zero[0]), digits(at_zero[1]));
    // All states from the canard to these.
    let [a, b] = at_zero.map(|x| x.hull(Interval::zero()));
    let start = Set::on_plane(SVector::from([a, b, Interval::zero(), e]), axis, 0.0, true);
    let end = run(&mut flow, start, -X0);
    let Some(full) = end.derivative() else { refuse("no derivative") };
    let m = [0, 1].map(|i| [full[(i, 0)], full[(i, 1)]]);
    for row in m {
        println!("  derivative at s = {}: {}  {}", -X0, digits(row[0]), digits(row[1]));
    }
    let ratio = (m[0][0] * at_zero[0] + m[0][1] * at_zero[1]) / unit;
    need(!ratio.contains(0.0), "the side of the exit");
    let p_out = Interval::symmetric((decimal(Q0) * Interval::from_f64(ratio.magnitude())).upper());
    need(p_out.magnitude() < P2, "the orbit has not left before");
    println!("  p({}) = q({S0}) times {}", -X0, digits(ratio));

    // Going out. q/p there: both columns of the derivative have nearly the same, and the state is a
    // combination of them.
    let columns = [m[1][0] / m[0][0], m[1][1] / m[0][1]];
    let share = m[0][1] * at_zero[1] / (unit * ratio);
    let slope = columns[0] + (columns[1] - columns[0]) * share;
    let start_d = -slope;
    let going = near(P2);
    need(
        start_d.lower() >= 0.0 && at_least(c2 / x0, start_d),
        "the orbit enters the outgoing cone",
    );
    need(
        at_least(going.least * c2 * (one - lean_2), l + c2 * going.fast / (x0 * x0))
            && lean_2.upper() < 0.5,
        "the outgoing cone",
    );
    let tilt = g * decimal(P2) / w;
    let f = {
        let off = phi - decimal(0.5);
        (decimal(0.5) - two * off * off) / w
    };
    // Integral of |p| x.
    let weight = decimal(P2) * going.fast / (going.least * (one - lean_2));
    // |F(p)/(w - g p) - f| <= bend |p|.
    let odd = Interval::from_f64((one - two * phi).magnitude());
    let bend = (two * (odd + decimal(P2)) * w + f * w * g) / (w * going.slow) * weight;
    let bend = Interval::symmetric(bend.upper());
    let tilted = g * weight / (w * x0 * x0);
    let excess = (-tilted).hull((c2 / (two * x0 * x0) + tilted) / ((one - lean_2) * (one - tilt)));
    let last = Interval::symmetric((-(one - lean_2).ln()).upper())
        + Interval::zero().hull(c2 / (two * x0 * x0 * (one - lean_2)));
    let exit = bend - inverse_mu * excess + last;
    let size =
        Interval::from_f64(ratio.mignitude()).hull(Interval::from_f64(ratio.magnitude())).ln();
    let c =
        decimal(P2).ln() + f * x0 * x0 / two - inverse_mu * (x0 * s0).ln() - size - entrance - exit;
    println!("  f = {}, 1/mu = {}", digits(f), digits(inverse_mu));
    println!("  C in [{:.4}, {:.4}]", c.lower(), c.upper());

    // Disturbances.
    let (h1, g1) = (
        l / (going.least * (one - lean_2) * (one - lean_2)),
        going.fast / (going.least * (one - lean_2) * (one - lean_2)),
    );
    let shrink = two * k * going.fast / (going.least * (one - lean_2) * x0 * x0);
    let side = k - (one + k / (x0 * x0)) * (h1 + k * g1 / (x0 * x0)) - shrink;
    need(
        side.lower() > 0.0
            && at_least(k, shrink)
            && (k / (x0 * x0)).upper() < 1.0
            && at_least(l, going.fast),
        "the cone of disturbances",
    );
    let f_out = {
        let off = phi + p_out - decimal(0.5);
        decimal(0.5) - two * off * off
    };
    let move_x = (w - g * p_out) / (f_out * (x0 - start_d));
    let move_d = l / (f_out * (x0 - start_d)) - start_d;
    let spread = {
        let over = one / (two * x0 * x0 * (one - lean_2));
        (k * over).hull(-(c2 + k) * over)
    };
    let growth = [0, 1].map(|j| {
        // Of D against that of x, at equal |p|.
        let y = (columns[j] - slope + move_d) / move_x;
        need(y.magnitude() <= (k / (x0 * x0)).lower(), "disturbances enter their cone");
        let size = (m[0][j] / ratio).magnitude();
        let size = Interval::from_f64((m[0][j] / ratio).mignitude()).hull(Interval::from_f64(size));
        (size * move_x * x0).ln() - inverse_mu * s0.ln() - entrance + spread
    });
    println!(
        "  K across in [{:.4}, {:.4}], along in [{:.4}, {:.4}]",
        growth[0].lower(),
        growth[0].upper(),
        growth[1].lower(),
        growth[1].upper()
    );
    println!(
        "PROVED: for all S >= {LEAST}, with side {}",
        if ratio.is_positive() { "kept" } else { "changed" }
    );
    let data = json!({
        "problem": { "v_plus": "-1.2", "v_minus": "-1.4", "transition": "tanh" },
        "least_s": LEAST.to_string(), "s0": S0.to_string(), "x0": X0.to_string(),
            "p1": P1.to_string(), "p2": P2.to_string(),
        "cones": CONES.map(|c| c.to_string()), "largest_q": Q0.to_string(),
        "state_at_zero": at_zero.map(|x| bounds(x / unit)),
            "derivative": m.map(|row| row.map(bounds)),
        "mu_inverse": bounds(inverse_mu), "f": bounds(f), "exit": bounds(c),
            "growth": growth.map(bounds),
    });
    write("inner-law", data);
}
