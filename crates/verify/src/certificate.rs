//! The certificates, one kind a theorem, and what must hold in them.

use std::rc::Rc;

use serde::Deserialize;
use serde::de::DeserializeOwned;

use super::check::{Bounds, Check, decimal, exactly, holds, need, range, tight};
use super::inner::inner_law;
use super::orbit::{Caricature, Crossing, FlowSettings};
use super::rational::{Range, Rational};
use super::recompute::{Known, PLANE, Patch, krawczyk};
use super::strict::without_repeats;
use super::{Refused, Verified};

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Certificate<T> {
    theorem: String,
    statement: String,
    data: T,
}

#[derive(Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
struct Parameters {
    system: String,
    transition: String,
    alpha: String,
    beta: String,
    eps: String,
    v_plus: String,
    v_minus: String,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct CycleCrossing {
    time: Bounds,
    point: [Bounds; 2],
    upward: bool,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Cycle {
    equation: Parameters,
    candidate: [Bounds; 2],
    value_at_midpoint: [Bounds; 2],
    derivative_on_candidate: [[Bounds; 2]; 2],
    preconditioner: [[f64; 2]; 2],
    image: [Bounds; 2],
    point: [Bounds; 2],
    derivative_at_point: [[Bounds; 2]; 2],
    period: Bounds,
    trace: Bounds,
    determinant: Bounds,
    crossings: Vec<CycleCrossing>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Coexistence {
    #[serde(rename = "period one")]
    one: Cycle,
    #[serde(rename = "period three")]
    three: Cycle,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Saddles {
    #[serde(rename = "period three")]
    three: Cycle,
    #[serde(rename = "period four, inverting")]
    inverting: Cycle,
    #[serde(rename = "period four")]
    four: Cycle,
    #[serde(rename = "period five")]
    five: Cycle,
}

#[derive(Clone, Copy, Deserialize)]
#[serde(deny_unknown_fields)]
struct Ball {
    high: f64,
    low: f64,
    radius: f64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct States {
    x: [String; 2],
    y: String,
    z: String,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct OrbitPoint {
    time: Ball,
    x: Ball,
    z: Ball,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Parted {
    upward: bool,
    orbits: [OrbitPoint; 2],
    distance: Bounds,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Sensitivity {
    equation: Parameters,
    states: States,
    crossings: Vec<Parted>,
    growth_until_first_crossing: [[Bounds; 2]; 2],
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct TableRow {
    time: Ball,
    x: Ball,
    z: Ball,
    upward: bool,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct CrossingTable {
    equation: Parameters,
    crossings: Vec<TableRow>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Crossings {
    printed: CrossingTable,
    reconstructed: CrossingTable,
}

impl OrbitPoint {
    fn row(&self, upward: bool) -> TableRow {
        TableRow { time: self.time, x: self.x, z: self.z, upward }
    }
}

/// A parallelogram { centre + u unstable + v stable : u, v in [-1, 1] }.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Parallelogram {
    centre: [f64; 2],
    unstable: [f64; 2],
    stable: [f64; 2],
}

/// The image of a part (a range of u), in the coordinates (u, v) of each set that is to be covered.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ImageOfPart {
    part: [f64; 2],
    seen: Vec<[Bounds; 2]>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct PassageClaim {
    crossing: usize,
    x: Bounds,
    z: Bounds,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Covering {
    from: usize,
    to: Vec<usize>,
    ends: [ImageOfPart; 2],
    pieces: Vec<ImageOfPart>,
    passage: PassageClaim,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Start {
    x: String,
    y: String,
    z: String,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct OrbitFrom {
    start: Start,
    crossings: Vec<TableRow>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Contraction {
    equation: Parameters,
    orbits: [OrbitFrom; 3],
    distances: [Bounds; 2],
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Horseshoe {
    equation: Parameters,
    sets: Vec<Parallelogram>,
    coverings: Vec<Covering>,
}

/// The statements, word for word: a certificate proves these and no others.
const STATEMENTS: [(&str, &str); 8] = [
    (
        "printed-cycle",
        "For alpha = 1e-3, beta = 1e-5, eps = 1e-3 and the tanh transition, the smoothed \
            caricature has exactly one closed orbit that crosses y = 0 upwards in the \
         candidate box and returns to it at its first upward crossing. It attracts.",
    ),
    (
        "coexistence",
        "For alpha = 0.1, beta = 1e-5, eps = 1e-3 and the tanh transition, the smoothed caricature \
            has two different closed orbits that both attract: one crosses \
         y = 0 upwards once a turn, the other three times.",
    ),
    (
        "saddles",
        "For alpha = 0.1, beta = 1e-5, eps = 1e-3 and the tanh transition, the smoothed caricature \
            has four different closed orbits of saddle type, one multiplier of \
         each inside the unit circle and one outside: they cross y = 0 upwards three, four, four \
         and five times a turn.",
    ),
    (
        "sensitivity",
        "For alpha = 0.1, beta = 1e-5, eps = 1e-3 and the tanh transition, the orbits of the \
            smoothed caricature from the two states, which are less than 1e-12 apart \
         at the two-fold singularity, are more than 0.3 apart at their second crossing of y = 0.",
    ),
    (
        "contraction",
        "For alpha = 0.1, beta = 1e-5, eps = 1e-3 and the tanh transition, the orbits of the \
            smoothed caricature from (0.2, 0, -1), (0.21, 0, -1) and (0.2, 0, -0.99) pass \
         the two-fold singularity at their third crossing of y = 0, and the fourth crossings of \
         the second and third are less than 0.0005 from that of the first.",
    ),
    (
        "horseshoe",
        "For alpha = 0.1, beta = 1e-5, eps = 1e-3 and the tanh transition, the return map of the \
            smoothed caricature from a downward crossing of y = 0 to the fourth \
         next has a horseshoe: two loops of covering relations between parallelograms, of 2 and of \
         14 sets, that have one set in common and go on from it to disjoint \
         ones. Each return passes the two-fold singularity, at a crossing with |x| and |z| below \
         1e-4. So for every sequence of the two loops there is an orbit that \
         runs through them in this order, for every periodic sequence a periodic one, and the \
         topological entropy of the return map is more than log(1.12).",
    ),
    (
        "inner-law",
        "In the inner problem of the two-fold with v+ = -1.2, v- = -1.4 and the tanh transition, \
            let p = phi - phi* and q = (1 - phi*) Z - phi* Y, phi* being \
         the value of phi on the canard. Every orbit that comes in along the sliding surface at s \
         = Y + Z = S, beyond a bound S0, with 0 < |p| <= 0.05 and q/p \
         between S - c1/S and S, first leaves |p| <= 0.05 at an s = -x with f x^2/2 - ln(x)/mu = \
         (1/mu - 1) ln S - ln|p| + C, and the derivatives of x by p and \
         by q at s = 0 are exp(K) S^(1/mu - 1)/(|p| x) in absolute value, with C and both K in \
         given intervals that do not depend on the orbit or on S.",
    ),
    (
        "crossings",
        "For beta = 1e-5, eps = 1e-3, the tanh transition and alpha = 1e-3 or 0.1, the first \
            crossings of y = 0 by the orbit of the smoothed caricature from (0.2, 0, \
         -1) are those listed, each within its radius; there are no others between them.",
    ),
];

/// Checks certificates. What it computes for one it keeps for the next.
#[derive(Default)]
pub struct Checker {
    known: Known,
}

impl Checker {
    /// One that looks at all that needs no orbit and then refuses: for those who try readers with a
    /// great many texts.
    pub fn of_reader() -> Self {
        Self { known: Known::of_reader() }
    }

    /// Verifies a certificate.
    ///
    /// # Errors
    /// [`Refused::Unreadable`] if the text is not a certificate of a theorem known here,
    /// [`Refused::Wrong`] with what does not hold.
    pub fn verify(&self, text: &str) -> Result<Verified, Refused> {
        let unreadable = |e: serde_json::Error| Refused::Unreadable(e.to_string());
        without_repeats(text).map_err(unreadable)?;
        let Certificate { theorem, statement, .. } =
            serde_json::from_str::<Certificate<serde::de::IgnoredAny>>(text).map_err(unreadable)?;
        let Some((_, known)) = STATEMENTS.iter().find(|(name, _)| *name == theorem) else {
            return Err(Refused::Unreadable(format!("there is no theorem {theorem:?}")));
        };
        let words = |text: &str| text.split_whitespace().map(str::to_owned).collect::<Vec<_>>();
        let findings = if words(&statement) != words(known) {
            Err("the statement is the one that is checked".to_owned())
        } else {
            match theorem.as_str() {
                "printed-cycle" => printed_cycle(&self.known, &data(text)?),
                "coexistence" => coexistence(&self.known, &data(text)?),
                "inner-law" => inner_law(&self.known, &data(text)?),
                "saddles" => saddles(&self.known, &data(text)?),
                "contraction" => contraction(&self.known, &data(text)?),
                "horseshoe" => horseshoe(&self.known, &data(text)?),
                "sensitivity" => sensitivity(&self.known, &data(text)?),
                _ => crossings(&self.known, &data(text)?),
            }
        };
        match findings {
            Ok(findings) => Ok(Verified { theorem, statement, findings }),
            Err(what) => Err(Refused::Wrong { theorem, what }),
        }
    }
}

/// Verifies one certificate: see [`Checker::verify`].
///
/// # Errors
/// The same.
pub fn verify(text: &str) -> Result<Verified, Refused> {
    Checker::default().verify(text)
}

/// A certificate's data; errors say the line.
fn data<T: DeserializeOwned>(text: &str) -> Result<T, Refused> {
    serde_json::from_str::<Certificate<T>>(text)
        .map(|c| c.data)
        .map_err(|e| Refused::Unreadable(e.to_string()))
}

fn ranges<const N: usize>(bounds: [Bounds; N]) -> Check<[Range; N]> {
    let found: Vec<Range> = bounds.into_iter().map(range).collect::<Check<_>>()?;
    found.try_into().map_err(|_| "the box is complete".to_owned())
}

fn ball(b: &Ball, name: &str) -> Check<Range> {
    need(b.radius > 0.0, format!("{name}: the radius is above 0"))?;
    // A number of two parts: the second is below the last digit of the first.
    need(
        b.low.abs() <= 2.3e-16 * b.high.abs(),
        format!("{name}: the second part of a number is small"),
    )?;
    let (centre, radius) = (&exactly(b.high)? + &exactly(b.low)?, exactly(b.radius)?);
    Ok(Range::point(&centre).widened(&radius))
}

/// The equation, which must be the one that the statement names.
fn equation(p: &Parameters, alpha: &str) -> Check<Caricature> {
    need(
        p.system == "caricature" && p.transition == "tanh",
        "the equation is the caricature with tanh",
    )?;
    let is = |text: &str, want: &str, name: &str| -> Check<Rational> {
        let wanted = decimal(want)?;
        need(decimal(text)? == wanted, format!("{name} = {want}"))?;
        Ok(wanted)
    };
    Ok(Caricature {
        alpha: is(&p.alpha, alpha, "alpha")?,
        beta: is(&p.beta, "1e-5", "beta")?,
        eps: is(&p.eps, "1e-3", "eps")?,
        v_plus: is(&p.v_plus, "-1.2", "v+")?,
        v_minus: is(&p.v_minus, "-1.4", "v-")?,
    })
}

/// Stability that a certificate claims of a closed orbit.
#[derive(Clone, Copy, PartialEq)]
enum CycleStability {
    Attracts,
    Saddle,
}

/// Krawczyk's inclusion and stability.
fn cycle(
    known: &Known,
    c: &Cycle,
    alpha: &str,
    crossings: usize,
    kind: CycleStability,
    name: &str,
) -> Check<(Vec<String>, Rc<Vec<Crossing>>)> {
    let named = |what: &str| format!("{name}: {what}");
    let equation = equation(&c.equation, alpha)?;
    let unit = |i: usize, j: usize| Range::point(&Rational::whole(i64::from(i == j)));
    let candidate = ranges(c.candidate)?;
    // The prover evaluates the map at the midpoint as its f64 arithmetic gives it.
    let middle = |[low, high]: Bounds| exactly((0.5 * low + 0.5 * high).clamp(low, high));
    let centre = [middle(c.candidate[0])?, middle(c.candidate[1])?];
    let value = ranges(c.value_at_midpoint)?;
    let slope = [ranges(c.derivative_on_candidate[0])?, ranges(c.derivative_on_candidate[1])?];
    let y = c.preconditioner.map(|row| row.map(|x| exactly(x).map(|x| Range::point(&x))));
    let [[a, b], [d, e]] = y;
    let y = [[a?, b?], [d?, e?]];
    need(
        &y[0][0].low * &y[1][1].low != &y[0][1].low * &y[1][0].low,
        named("the preconditioner is regular"),
    )?;
    let (image, point) = (ranges(c.image)?, ranges(c.point)?);
    let k = krawczyk(&centre, &value, &slope, &y, &candidate)?;
    for i in 0..2 {
        need(k[i].inside(&candidate[i]), named("Krawczyk's inclusion"))?;
        tight(&image[i], &k[i], &Rational::whole(0), &named("the image"))?;
        need(
            point[i].within(&image[i]) && image[i].inside(&candidate[i]),
            named("the boxes are nested"),
        )?;
    }
    // The preconditioner is near the inverse of D - 1: that is what makes the inclusion sharp. (A
    // saddle's derivative is known less well.)
    let near = match kind {
        CycleStability::Attracts => Rational::tenth_to(2),
        CycleStability::Saddle => decimal("0.05")?,
    };
    for (i, j) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
        let df = |k: usize| &slope[k][j] - &unit(k, j);
        let product = &(&y[i][0] * &df(0)) + &(&y[i][1] * &df(1));
        let off = (&product - &unit(i, j)).magnitude();
        need(off < near, named("the preconditioner is nearly the inverse"))?;
    }
    let d = [ranges(c.derivative_at_point[0])?, ranges(c.derivative_at_point[1])?];
    for i in 0..2 {
        for j in 0..2 {
            need(
                d[i][j].within(&slope[i][j]),
                named("the derivative at the point is one on the candidate"),
            )?;
        }
    }
    let (trace, determinant) =
        (&d[0][0] + &d[1][1], &(&d[0][0] * &d[1][1]) - &(&d[0][1] * &d[1][0]));
    // Rounding errors are relative to these products.
    let products = &(&d[0][0] * &d[1][1]).magnitude() + &(&d[0][1] * &d[1][0]).magnitude();
    let scale = &Rational::whole(4) + &products;
    tight(&range(c.trace)?, &trace, &scale, &named("the trace"))?;
    tight(&range(c.determinant)?, &determinant, &scale, &named("the determinant"))?;
    need(c.crossings.len() == crossings, named(&format!("{crossings} crossings of y = 0 a turn")))?;

    // All of it once more, from the candidate alone.
    let ours = known.closed(&equation, &candidate, &centre, crossings).map_err(|e| named(&e))?;
    for i in 0..2 {
        holds(&value[i], &ours.value[i], &named("value_at_midpoint"))?;
        holds(&point[i], &ours.point[i], &named("point"))?;
        for j in 0..2 {
            holds(&d[i][j], &ours.quotients[j][i], &named("derivative_at_point"))?;
            for mean in [&ours.quotients[j], &ours.edges[j][0], &ours.edges[j][1]] {
                holds(&slope[i][j], &mean[i], &named("derivative_on_candidate"))?;
            }
        }
    }
    for (n, (crossing, ours)) in c.crossings.iter().zip(ours.rows.iter()).enumerate() {
        let at = |what: &str| named(&format!("crossing {}: {what}", n + 1));
        need(
            crossing.upward == ours.upward && crossing.upward == (n % 2 == 1),
            at("directions alternate, the last is upward"),
        )?;
        holds(&range(crossing.time)?, &ours.time, &at("time"))?;
        for (claimed, axis) in ranges(crossing.point)?.iter().zip(PLANE) {
            holds(claimed, &ours.states[axis], &at("point"))?;
            need(
                claimed.width() < Rational::tenth_to(7),
                at("the enclosure is narrower than 1e-7"),
            )?;
        }
        need(
            range(crossing.time)?.width() < Rational::tenth_to(7),
            at("the time is known to 1e-7"),
        )?;
    }
    need(
        c.crossings.last().is_some_and(|last| last.time == c.period),
        named("the period is the time of the last crossing"),
    )?;

    // Stability, from the checker's own derivative.
    let d = &ours.derivative;
    let (trace, determinant) =
        (&d[0][0] + &d[1][1], &(&d[0][0] * &d[1][1]) - &(&d[0][1] * &d[1][0]));
    let one = Range::point(&Rational::whole(1));
    // The characteristic polynomial l^2 - trace l + determinant at 1 and -1.
    let (above, below) = (&(&one + &determinant) - &trace, &(&one + &determinant) + &trace);
    let zero = Rational::whole(0);
    let stability = match kind {
        CycleStability::Attracts => {
            need(determinant.high < one.low, named("the determinant is below 1"))?;
            need(
                above.low > zero && below.low > zero,
                named("the trace is below 1 plus the determinant in absolute value"),
            )?;
            format!(
                "it attracts (1 - det >= {:.3e}, 1 + det - |trace| >= {:.3e})",
                (&one.low - &determinant.high).approximately(),
                above.low.clone().min(below.low.clone()).approximately()
            )
        }
        CycleStability::Saddle => {
            need(
                above.low > zero && below.high < zero || above.high < zero && below.low > zero,
                named("the characteristic polynomial has different signs at 1 and -1"),
            )?;
            format!("it is a saddle (1 + det - trace in {above}, 1 + det + trace in {below})")
        }
    };
    let period = ours.rows.last().map_or(0.0, |r| r.time.low.approximately());
    let said = vec![
        format!(
            "{name}: exactly one fixed point of the return map in the candidate, x = {}, z = {}",
            number(&ours.point[0]),
            number(&ours.point[1])
        ),
        format!("{name}: period {period:.12}, {crossings} crossings of y = 0 a turn; {stability}"),
    ];
    Ok((said, ours.rows))
}

/// The middle of a narrow range, for people.
fn number(r: &Range) -> String {
    format!("{:.15}", (0.5 * (r.low.approximately() + r.high.approximately())))
}

fn printed_cycle(known: &Known, c: &Cycle) -> Check<Vec<String>> {
    for b in ranges(c.candidate)? {
        need(b.width() < Rational::tenth_to(8), "the candidate is narrower than 1e-8")?;
    }
    Ok(cycle(known, c, "1e-3", 2, CycleStability::Attracts, "the cycle")?.0)
}

/// Several closed orbits at alpha = 0.1, which must all be different, with their crossings a turn.
fn cycles(
    known: &Known,
    orbits: &[(&Cycle, usize, &str)],
    kind: CycleStability,
) -> Check<Vec<String>> {
    let (mut said, mut points) = (Vec::new(), Vec::<[Range; 2]>::new());
    for (orbit, crossings, name) in orbits {
        let (findings, rows) = cycle(known, orbit, "0.1", *crossings, kind, name)?;
        said.extend(findings);
        points.extend(rows.iter().filter(|r| r.upward).map(|r| PLANE.map(|i| r.states[i].clone())));
    }
    for (i, a) in points.iter().enumerate() {
        for b in &points[i + 1..] {
            need(
                !(a[0].meets(&b[0]) && a[1].meets(&b[1])),
                "the upward crossings of the orbits are all different",
            )?;
        }
    }
    said.push(format!(
        "the {} upward crossings are all different: {} orbits, and all returns are needed",
        points.len(),
        orbits.len()
    ));
    Ok(said)
}

fn coexistence(known: &Known, c: &Coexistence) -> Check<Vec<String>> {
    cycles(
        known,
        &[(&c.one, 2, "period one"), (&c.three, 6, "period three")],
        CycleStability::Attracts,
    )
}

fn saddles(known: &Known, c: &Saddles) -> Check<Vec<String>> {
    let orbits = [
        (&c.three, 6, "period three"),
        (&c.inverting, 8, "period four, inverting"),
        (&c.four, 8, "period four"),
        (&c.five, 10, "period five"),
    ];
    cycles(known, &orbits, CycleStability::Saddle)
}

/// Compares claimed crossings of the orbit from (x, 0, z) with the checker's own, and returns
/// these.
fn orbit(
    known: &Known,
    equation: &Caricature,
    [x, z]: [&Rational; 2],
    rows: &[&TableRow],
    name: &str,
) -> Check<Rc<Vec<Crossing>>> {
    let at = |n: usize, what: &str| format!("{name}, crossing {}: {what}", n + 1);
    // Claims that can be refused without an orbit come first.
    let mut claimed = Vec::new();
    for (n, row) in rows.iter().enumerate() {
        for (b, axis, what) in
            [(&row.time, None, "time"), (&row.x, Some(0), "x"), (&row.z, Some(2), "z")]
        {
            let b = ball(b, &at(n, what))?;
            need(
                b.width() < Rational::tenth_to(7),
                at(n, &format!("{what}: the enclosure is narrower than 1e-7")),
            )?;
            claimed.push((n, b, axis, what));
        }
    }
    let ours = known.crossings(equation, &Patch::point(x, z), rows.len(), FlowSettings::NARROW)?;
    for (n, (row, ours)) in rows.iter().zip(ours.iter()).enumerate() {
        need(row.upward == ours.upward, at(n, "the direction"))?;
    }
    for (n, claimed, axis, what) in &claimed {
        holds(claimed, axis.map_or(&ours[*n].time, |i: usize| &ours[*n].states[i]), &at(*n, what))?;
    }
    Ok(ours)
}

/// The square of the distance of two crossings.
fn squared_distance(a: &Crossing, b: &Crossing) -> Range {
    let [x, z] = PLANE.map(|i| (&a.states[i] - &b.states[i]).squared());
    &x + &z
}

/// A claimed distance: it holds the checker's, and is no wider than `widest`.
fn distance(claimed: Bounds, squared: &Range, widest: &Rational, name: &str) -> Check<Range> {
    let claimed = range(claimed)?;
    need(!claimed.low.is_negative(), format!("{name}: a distance is not negative"))?;
    holds(&claimed.squared(), squared, &format!("{name} (squared)"))?;
    need(
        claimed.width() < *widest,
        format!("{name}: the enclosure is narrower than {:.0e}", widest.approximately()),
    )?;
    squared.sqrt().ok_or_else(|| format!("{name}: a distance is known"))
}

fn sensitivity(known: &Known, c: &Sensitivity) -> Check<Vec<String>> {
    /// Half the distances in x and z of states whose quotients are the growth: 2^-72 and 2^-66, so
    /// that neither the third derivative nor the radii are seen.
    const APART: [f64; 2] =
        [1.0 / 4_722_366_482_869_645_213_696.0, 1.0 / 73_786_976_294_838_206_464.0];
    let equation = equation(&c.equation, "0.1")?;
    let (a, b, z) = (decimal(&c.states.x[0])?, decimal(&c.states.x[1])?, decimal(&c.states.z)?);
    let apart = (&a - &b).abs();
    need(
        apart > Rational::whole(0) && apart < Rational::tenth_to(12),
        "the states differ by less than 1e-12",
    )?;
    need(decimal(&c.states.y)? == Rational::whole(0), "the states lie on y = 0")?;
    // At the singularity: within a few eps across, and on it along the layer.
    need(z.abs() < Rational::tenth_to(12), "the states lie at the singularity (z)")?;
    need(
        a.abs() < Rational::tenth_to(4) && b.abs() < Rational::tenth_to(4),
        "the states lie at the singularity (x)",
    )?;
    need(c.crossings.len() == 3, "three crossings")?;
    let mut orbits = Vec::new();
    for (k, x) in [&a, &b].into_iter().enumerate() {
        let rows: Vec<TableRow> =
            c.crossings.iter().map(|row| row.orbits[k].row(row.upward)).collect();
        let name = format!("orbit {}", k + 1);
        orbits.push(orbit(known, &equation, [x, &z], &rows.iter().collect::<Vec<_>>(), &name)?);
    }
    let mut said = vec![format!("the states are {:.2e} apart", apart.approximately())];
    for (n, crossing) in c.crossings.iter().enumerate() {
        let squared = squared_distance(&orbits[0][n], &orbits[1][n]);
        let name = format!("the distance of crossings {}", n + 1);
        let ours = distance(crossing.distance, &squared, &Rational::tenth_to(12), &name)?;
        if n == 1 {
            need(ours.low > decimal("0.3")?, "the second crossings are more than 0.3 apart")?;
        }
        said.push(format!("crossings {}: {} apart", n + 1, number(&ours)));
    }
    let quotients = known.derivative(&equation, &[a, z], APART, 1)?;
    for (i, row) in c.growth_until_first_crossing.into_iter().enumerate() {
        for (j, claimed) in ranges(row)?.iter().enumerate() {
            holds(claimed, &quotients[j][i], "growth_until_first_crossing")?;
            need(
                claimed.width() < &claimed.magnitude() * &Rational::tenth_to(4),
                "the growth factors are narrow",
            )?;
        }
    }
    let d = orbits[0][0].set.derivative()[2][0];
    said.push(format!(
        "the derivative of the first crossing's z by x is enclosed: {:.9e} +- {:.0e}",
        d.m, d.r
    ));
    Ok(said)
}

fn crossings(known: &Known, c: &Crossings) -> Check<Vec<String>> {
    let mut said = Vec::new();
    let start = [&decimal("0.2")?, &Rational::whole(-1)];
    for (name, alpha, table, count) in
        [("printed", "1e-3", &c.printed, 24), ("reconstructed", "0.1", &c.reconstructed, 61)]
    {
        let equation = equation(&table.equation, alpha)?;
        need(table.crossings.len() == count, format!("{name}: {count} rows"))?;
        let ours =
            orbit(known, &equation, start, &table.crossings.iter().collect::<Vec<_>>(), name)?;
        let widest = ours
            .iter()
            .flat_map(|r| PLANE.map(|i| r.states[i].width()))
            .fold(Rational::whole(0), Rational::max);
        said.push(format!(
            "{name}: the orbit's first {count} crossings are enclosed anew (widest {:.1e}), each \
                within the radius claimed; no others between",
            widest.approximately()
        ));
    }
    Ok(said)
}

fn contraction(known: &Known, c: &Contraction) -> Check<Vec<String>> {
    let equation = equation(&c.equation, "0.1")?;
    let mut ours = Vec::new();
    for (orbit_from, [x, z]) in
        c.orbits.iter().zip([["0.2", "-1"], ["0.21", "-1"], ["0.2", "-0.99"]])
    {
        let name = format!("the orbit from ({x}, 0, {z})");
        let (x, z) = (decimal(x)?, decimal(z)?);
        let start = [
            decimal(&orbit_from.start.x)?,
            decimal(&orbit_from.start.y)?,
            decimal(&orbit_from.start.z)?,
        ];
        need(start == [x.clone(), Rational::whole(0), z.clone()], format!("{name} starts there"))?;
        need(orbit_from.crossings.len() == 4, format!("{name}: four crossings"))?;
        let rows = orbit(
            known,
            &equation,
            [&x, &z],
            &orbit_from.crossings.iter().collect::<Vec<_>>(),
            &name,
        )?;
        for i in PLANE {
            let near = rows[2].states[i].magnitude() < Rational::tenth_to(4);
            need(near, format!("{name} passes the singularity within 1e-4"))?;
        }
        ours.push(rows);
    }
    let mut said = Vec::new();
    for (k, claimed) in c.distances.iter().enumerate() {
        let squared = squared_distance(&ours[0][3], &ours[k + 1][3]);
        let name = format!("the distance of orbits 1 and {}", k + 2);
        let found = distance(*claimed, &squared, &Rational::tenth_to(12), &name)?;
        need(found.high < decimal("0.0005")?, format!("{name} is below 0.0005"))?;
        said.push(format!("starts 0.01 apart, fourth crossings {} apart", number(&found)));
    }
    Ok(said)
}

/// Position of u: before the set (-1), beyond it (1), or neither (0).
fn side(u: &Range) -> i32 {
    let one = Rational::whole(1);
    i32::from(u.low > one) - i32::from(u.high < -&one)
}

impl Parallelogram {
    /// The part with u in [low, high] and all v.
    fn part(&self, low: f64, high: f64) -> Check<Patch> {
        let middle = 0.5 * low + 0.5 * high;
        let along = |i: usize| {
            Ok::<_, String>(
                &exactly(self.centre[i])? + &(&exactly(self.unstable[i])? * &exactly(middle)?),
            )
        };
        let centre = [along(0)?, along(1)?];
        Ok(Patch {
            centre,
            first: self.unstable,
            second: self.stable,
            radii: [0.5 * high - 0.5 * low, 1.0],
        })
    }

    /// The images of a crossing's set in the coordinates (u, v); of its middle alone unless
    /// `whole`.
    fn see(&self, crossing: &Crossing, whole: bool) -> Check<[Range; 2]> {
        let exact = |x: f64| exactly(x).map(|x| Range::point(&x));
        let [[a, b], [c, d]] = [
            [exact(self.unstable[0])?, exact(self.stable[0])?],
            [exact(self.unstable[1])?, exact(self.stable[1])?],
        ];
        let determinant = &(&a * &d) - &(&b * &c);
        let inverse = determinant.inverse().ok_or("the parallelograms have an area")?;
        let zero = Range::point(&Rational::whole(0));
        let m =
            [[&d * &inverse, &(&zero - &b) * &inverse], [&(&zero - &c) * &inverse, &a * &inverse]];
        let origin = [&exactly(self.centre[0])?, &exactly(self.centre[1])?];
        crossing.set.seen(&m, origin, PLANE, whole).ok_or_else(|| "an image is bounded".to_owned())
    }
}

/// Crossings of y = 0 in a return: four downward ones.
const RETURN: usize = 8;

/// One covering relation (Zgliczynski & Gidea 2004, Definition 2): the ends come to either side of
/// the sets that are covered, no part meets their edges v = -1, 1. Whether the certificate's
/// numbers hold what is found comes first: the parts take longest.
fn covering(
    known: &Known,
    equation: &Caricature,
    sets: &[Parallelogram],
    c: &Covering,
) -> Check<Rational> {
    /// Parts shorter than this are not tried.
    const SHORTEST: f64 = 1.0 / 64.0;
    let from = &sets[c.from];
    let to: Vec<&Parallelogram> = c.to.iter().map(|k| &sets[*k]).collect();
    let image = |low: f64, high: f64| -> Check<Rc<Vec<Crossing>>> {
        let rows =
            known.crossings(equation, &from.part(low, high)?, RETURN, FlowSettings::NARROW)?;
        let alternate = rows.iter().enumerate().all(|(n, r)| r.upward == (n % 2 == 0));
        need(alternate, "directions alternate, the first is upward")?;
        Ok(rows)
    };
    for (end, u) in c.ends.iter().zip([-1.0, 1.0]) {
        need(end.part == [u, u], "the ends are those of the set")?;
    }
    // The pieces leave nothing out.
    let mut before = -1.0;
    for piece in &c.pieces {
        need(piece.part[0] == before && piece.part[1] > before, "the pieces follow on each other")?;
        before = piece.part[1];
    }
    need(before == 1.0, "the pieces make up the set")?;
    let claimed: Vec<(&ImageOfPart, bool)> =
        c.pieces.iter().map(|p| (p, false)).chain(c.ends.iter().map(|e| (e, true))).collect();
    for (image, is_end) in &claimed {
        need(
            image.seen.len() == c.to.len(),
            "an image is seen from every set that is to be covered",
        )?;
        for (seen, k) in image.seen.iter().zip(&c.to) {
            let [u, v] = ranges(*seen)?;
            let fine = side(&u) != 0 || !is_end && v.magnitude() < Rational::whole(1);
            need(fine, format!("the image claimed shows that set {k} is covered"))?;
        }
    }
    let passage = &c.passage;
    need((1..=RETURN).contains(&passage.crossing), "the singularity is passed on the way")?;
    let passes = [range(passage.x)?, range(passage.z)?];
    for claimed in &passes {
        need(claimed.magnitude() < Rational::tenth_to(4), "the passage claimed is within 1e-4")?;
    }

    for (claimed, _) in &claimed {
        for u in claimed.part {
            let rows = image(u, u)?;
            for (seen, to) in claimed.seen.iter().zip(&to) {
                for (claimed, ours) in ranges(*seen)?.iter().zip(to.see(&rows[RETURN - 1], false)?)
                {
                    holds(claimed, &ours, &format!("the image of u = {u}"))?;
                }
            }
        }
    }
    let mut nearest = Rational::whole(0);
    let mut passing = |rows: &[Crossing]| -> Check {
        let crossing = &rows[passage.crossing - 1];
        for (axis, claimed) in PLANE.into_iter().zip(&passes) {
            let size = crossing.states[axis].magnitude();
            need(size < Rational::tenth_to(4), "the singularity is passed within 1e-4")?;
            nearest = nearest.clone().max(size);
            let middle = crossing.set.centre()[axis].range(0.0).ok_or("a crossing is bounded")?;
            holds(claimed, &middle, "the passage")?;
        }
        Ok(())
    };
    let last = |rows: &[Crossing], to: &Parallelogram| -> Check<[Range; 2]> {
        to.see(&rows[RETURN - 1], true)
    };
    let ends = [image(-1.0, -1.0)?, image(1.0, 1.0)?];
    for to in &to {
        let sides = side(&last(&ends[0], to)?[0]) * side(&last(&ends[1], to)?[0]);
        need(sides == -1, "the ends come to either side of the set that is covered")?;
    }
    for rows in &ends {
        passing(rows)?;
    }
    let mut waiting = vec![[-1.0, 1.0]];
    while let Some([low, high]) = waiting.pop() {
        let rows = image(low, high)?;
        let mut away = true;
        for to in &to {
            let [u, v] = last(&rows, to)?;
            away &= v.magnitude() < Rational::whole(1) || side(&u) != 0;
        }
        if away {
            passing(&rows)?;
            continue;
        }
        need(high - low > SHORTEST, "no part leaves the set that is covered sideways")?;
        let middle = 0.5 * (low + high);
        waiting.extend([[middle, high], [low, middle]]);
    }
    Ok(nearest)
}

/// A parallelogram's extent in x and in z.
fn extent(p: &Parallelogram) -> Check<[Range; 2]> {
    let of = |i: usize| {
        let reach = &exactly(p.unstable[i])?.abs() + &exactly(p.stable[i])?.abs();
        Ok::<_, String>(Range::point(&exactly(p.centre[i])?).widened(&reach))
    };
    Ok([of(0)?, of(1)?])
}

fn horseshoe(known: &Known, c: &Horseshoe) -> Check<Vec<String>> {
    /// Sets of the longer loop.
    const LONG: usize = 14;
    let equation = equation(&c.equation, "0.1")?;
    need(
        c.sets.len() == LONG + 1 && c.coverings.len() == c.sets.len(),
        "fifteen sets, each of which covers others",
    )?;
    for set in &c.sets {
        for side in extent(set)? {
            need(
                side.width() < Rational::tenth_to(12),
                "the parallelograms are smaller than 1e-12",
            )?;
        }
    }
    let (one, two) = (extent(&c.sets[1])?, extent(&c.sets[2])?);
    need(
        !(one[0].meets(&two[0]) && one[1].meets(&two[1])),
        "the sets that follow the common one are disjoint",
    )?;
    // 0, 1, 0, ... and 0, 2, 3, ..., 14, 0, ...
    let follows = |i: usize| match i {
        0 => vec![1, 2],
        1 | LONG => vec![0],
        i => vec![i + 1],
    };
    let mut nearest = Rational::whole(0);
    for (i, relation) in c.coverings.iter().enumerate() {
        need(
            relation.from == i && relation.to == follows(i),
            "the sets make two loops through the first",
        )?;
        nearest = nearest.max(
            covering(known, &equation, &c.sets, relation).map_err(|e| format!("set {i}: {e}"))?,
        );
    }
    // lambda^-2 + lambda^-14 falls with lambda: it is above 1 at 1.12, so that the growth rate of
    // chains is beyond 1.12.
    let base = decimal("1.12")?;
    let power = |n: u32| (0..n).fold(Rational::whole(1), |p, _| &p * &base);
    need(
        power(14) < &power(12) + &Rational::whole(1),
        "chains of sets grow by more than 1.12 a return",
    )?;
    Ok(vec![
        format!(
            "{} covering relations, proved anew: loops of 2 and {LONG} sets through the first",
            c.sets.len() + 1
        ),
        "the two sets that can follow the first are disjoint: entropy more than log(1.12) a return"
            .to_owned(),
        format!(
            "every return passes the singularity, within {:.1e} in x and z",
            nearest.approximately()
        ),
    ])
}
