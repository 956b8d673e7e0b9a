//! The certificates, one kind a theorem, and what must hold in them.

use serde::Deserialize;
use serde_json::Value;

use super::inner::inner_law;
use super::plain::Equation;
use super::rational::{Range, Rational};
use super::{Refused, Verified};

/// A failed check: what should hold.
pub(super) type Check<T = ()> = Result<T, String>;

pub(super) fn need(holds: bool, what: impl Into<String>) -> Check {
    if holds { Ok(()) } else { Err(what.into()) }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Certificate {
    theorem: String,
    statement: String,
    data: Value,
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

pub(super) type Bounds = [f64; 2];

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

#[derive(Deserialize)]
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
struct Passage {
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
    passage: Passage,
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

/// Crossings computed outside this project in 113-bit arithmetic.
const PRINTED: &str = include_str!("../data/crossings-printed.csv");
/// See [`PRINTED`].
const RECONSTRUCTED: &str = include_str!("../data/crossings-reconstructed.csv");

/// The statements, word for word: a certificate proves these and no others.
const STATEMENTS: [(&str, &str); 8] = [
    (
        "printed-cycle",
        "For alpha = 1e-3, beta = 1e-5, eps = 1e-3 and the tanh transition, the smoothed caricature has exactly one closed orbit that crosses y = 0 upwards in the \
         candidate box and returns to it at its first upward crossing. It attracts.",
    ),
    (
        "coexistence",
        "For alpha = 0.1, beta = 1e-5, eps = 1e-3 and the tanh transition, the smoothed caricature has two different closed orbits that both attract: one crosses \
         y = 0 upwards once a turn, the other three times.",
    ),
    (
        "saddles",
        "For alpha = 0.1, beta = 1e-5, eps = 1e-3 and the tanh transition, the smoothed caricature has four different closed orbits of saddle type, one multiplier of \
         each inside the unit circle and one outside: they cross y = 0 upwards three, four, four and five times a turn.",
    ),
    (
        "sensitivity",
        "For alpha = 0.1, beta = 1e-5, eps = 1e-3 and the tanh transition, the orbits of the smoothed caricature from the two states, which are less than 1e-12 apart \
         at the two-fold singularity, are more than 0.3 apart at their second crossing of y = 0.",
    ),
    (
        "contraction",
        "For alpha = 0.1, beta = 1e-5, eps = 1e-3 and the tanh transition, the orbits of the smoothed caricature from (0.2, 0, -1), (0.21, 0, -1) and (0.2, 0, -0.99) pass \
         the two-fold singularity at their third crossing of y = 0, and the fourth crossings of the second and third are less than 0.0005 from that of the first.",
    ),
    (
        "horseshoe",
        "For alpha = 0.1, beta = 1e-5, eps = 1e-3 and the tanh transition, the return map of the smoothed caricature from a downward crossing of y = 0 to the fourth \
         next has a horseshoe: two loops of covering relations between parallelograms, of 2 and of 14 sets, that have one set in common and go on from it to disjoint \
         ones. Each return passes the two-fold singularity, at a crossing with |x| and |z| below 1e-4. So for every sequence of the two loops there is an orbit that \
         runs through them in this order, for every periodic sequence a periodic one, and the topological entropy of the return map is more than log(1.12).",
    ),
    (
        "inner-law",
        "In the inner problem of the two-fold with v+ = -1.2, v- = -1.4 and the tanh transition, let p = phi - phi* and q = (1 - phi*) Z - phi* Y, phi* being \
         the value of phi on the canard. Every orbit that comes in along the sliding surface at s = Y + Z = S, beyond a bound S0, with 0 < |p| <= 0.05 and q/p \
         between S - c1/S and S, first leaves |p| <= 0.05 at an s = -x with f x^2/2 - ln(x)/mu = (1/mu - 1) ln S - ln|p| + C, and the derivatives of x by p and \
         by q at s = 0 are exp(K) S^(1/mu - 1)/(|p| x) in absolute value, with C and both K in given intervals that do not depend on the orbit or on S.",
    ),
    (
        "crossings",
        "For beta = 1e-5, eps = 1e-3, the tanh transition and alpha = 1e-3 or 0.1, the first crossings of y = 0 by the orbit of the smoothed caricature from (0.2, 0, \
         -1) are those listed, each within its radius; there are no others between them.",
    ),
];

/// Verifies a certificate.
///
/// # Errors
/// [`Refused::Unreadable`] if the text is not a certificate of a theorem known here, [`Refused::Wrong`] with what does not hold.
pub fn verify(text: &str) -> Result<Verified, Refused> {
    let unreadable = |e: serde_json::Error| Refused::Unreadable(e.to_string());
    let Certificate { theorem, statement, data } = serde_json::from_str(text).map_err(unreadable)?;
    let Some((_, known)) = STATEMENTS.iter().find(|(name, _)| *name == theorem) else {
        return Err(Refused::Unreadable(format!("there is no theorem {theorem:?}")));
    };
    let words = |text: &str| text.split_whitespace().map(str::to_owned).collect::<Vec<_>>();
    let findings = if words(&statement) != words(known) {
        Err("the statement is the one that is checked".to_owned())
    } else {
        match theorem.as_str() {
            "printed-cycle" => printed_cycle(&serde_json::from_value(data).map_err(unreadable)?),
            "coexistence" => coexistence(&serde_json::from_value(data).map_err(unreadable)?),
            "inner-law" => inner_law(&serde_json::from_value(data).map_err(unreadable)?),
            "saddles" => saddles(&serde_json::from_value(data).map_err(unreadable)?),
            "contraction" => contraction(&serde_json::from_value(data).map_err(unreadable)?),
            "horseshoe" => horseshoe(&serde_json::from_value(data).map_err(unreadable)?),
            "sensitivity" => sensitivity(&serde_json::from_value(data).map_err(unreadable)?),
            _ => crossings(&serde_json::from_value(data).map_err(unreadable)?),
        }
    };
    match findings {
        Ok(findings) => Ok(Verified { theorem, statement, findings }),
        Err(what) => Err(Refused::Wrong { theorem, what }),
    }
}

pub(super) fn exactly(x: f64) -> Check<Rational> {
    Rational::exactly(x).ok_or_else(|| format!("{x} is a number"))
}

pub(super) fn decimal(text: &str) -> Check<Rational> {
    Rational::decimal(text).ok_or_else(|| format!("{text:?} is a decimal number"))
}

pub(super) fn range([low, high]: Bounds) -> Check<Range> {
    let range = Range { low: exactly(low)?, high: exactly(high)? };
    need(range.low <= range.high, format!("the bounds {low:e}, {high:e} are in order"))?;
    Ok(range)
}

fn ranges<const N: usize>(bounds: [Bounds; N]) -> Check<[Range; N]> {
    let found: Vec<Range> = bounds.into_iter().map(range).collect::<Check<_>>()?;
    found.try_into().map_err(|_| "the box is complete".to_owned())
}

fn ball(b: &Ball) -> Check<Range> {
    need(b.radius >= 0.0, "radii are not negative")?;
    // A number of two parts: the second is below the last digit of the first.
    need(b.low.abs() <= 2.3e-16 * b.high.abs(), "the second part of a number is small")?;
    let (centre, radius) = (&exactly(b.high)? + &exactly(b.low)?, exactly(b.radius)?);
    Ok(Range::point(&centre).widened(&radius))
}

/// The equation, which must be the one that the statement names.
fn equation(p: &Parameters, alpha: &str) -> Check<Equation> {
    need(p.system == "caricature" && p.transition == "tanh", "the equation is the caricature with tanh")?;
    let is = |text: &str, want: &str, name: &str| -> Check<f64> {
        need(decimal(text)? == decimal(want)?, format!("{name} = {want}"))?;
        text.parse().map_err(|_| format!("{name} is a number"))
    };
    Ok(Equation {
        alpha: is(&p.alpha, alpha, "alpha")?,
        beta: is(&p.beta, "1e-5", "beta")?,
        eps: is(&p.eps, "1e-3", "eps")?,
        v_plus: is(&p.v_plus, "-1.2", "v+")?,
        v_minus: is(&p.v_minus, "-1.4", "v-")?,
    })
}

/// Whether `claimed` holds `exact`, and is wider by rounding alone: some units in the last place of the numbers that it was made of.
pub(super) fn tight(claimed: &Range, exact: &Range, scale: &Rational, what: &str) -> Check {
    need(exact.within(claimed), format!("{what} holds what its parts give"))?;
    let room = &(scale + &exact.magnitude()) * &Rational::tenth_to(14);
    need(claimed.within(&exact.widened(&room)), format!("{what} is no wider than its parts give"))
}

/// What is claimed of a closed orbit.
#[derive(Clone, Copy, PartialEq)]
enum Kind {
    Attracts,
    Saddle,
}

impl Kind {
    /// Where a plain integrator must find the crossings, in time and in both coordinates. A saddle multiplies what it does wrong by up to 67 a turn.
    fn plain(self) -> f64 {
        match self {
            Self::Attracts => 1e-9,
            Self::Saddle => 1e-7,
        }
    }
}

/// Krawczyk's inclusion and stability.
fn cycle(c: &Cycle, alpha: &str, crossings: usize, kind: Kind, name: &str) -> Check<Vec<String>> {
    let named = |what: &str| format!("{name}: {what}");
    let equation = equation(&c.equation, alpha)?;
    let (one, zero) = (Range::point(&Rational::whole(1)), Range::point(&Rational::whole(0)));
    let unit = |i: usize, j: usize| if i == j { &one } else { &zero };
    let candidate = ranges(c.candidate)?;
    // The prover evaluates the map at the midpoint as its f64 arithmetic gives it.
    let centre: Vec<Range> = c
        .candidate
        .iter()
        .map(|[low, high]| exactly((0.5 * low + 0.5 * high).clamp(*low, *high)).map(|c| Range::point(&c)))
        .collect::<Check<_>>()?;
    let value = ranges(c.value_at_midpoint)?;
    let slope = [ranges(c.derivative_on_candidate[0])?, ranges(c.derivative_on_candidate[1])?];
    let mut y = Vec::new();
    for row in c.preconditioner {
        y.push([Range::point(&exactly(row[0])?), Range::point(&exactly(row[1])?)]);
    }
    need(&y[0][0].low * &y[1][1].low != &y[0][1].low * &y[1][0].low, named("the preconditioner is regular"))?;
    let (image, point) = (ranges(c.image)?, ranges(c.point)?);
    for i in 0..2 {
        let at = |k: usize| &value[k] - &centre[k];
        let df = |k: usize, j: usize| &slope[k][j] - unit(k, j);
        let newton = &centre[i] - &(&(&y[i][0] * &at(0)) + &(&y[i][1] * &at(1)));
        let mut k = newton;
        for j in 0..2 {
            let contraction = unit(i, j) - &(&(&y[i][0] * &df(0, j)) + &(&y[i][1] * &df(1, j)));
            k = &k + &(&contraction * &(&candidate[j] - &centre[j]));
        }
        need(k.inside(&candidate[i]), named("Krawczyk's inclusion"))?;
        tight(&image[i], &k, &Rational::whole(0), &named("the image"))?;
        need(point[i].within(&image[i]) && image[i].inside(&candidate[i]), named("the boxes are nested"))?;
    }
    // The preconditioner is near the inverse of D - 1: that is what makes the inclusion sharp. (A saddle's derivative is known less well.)
    let near = match kind {
        Kind::Attracts => Rational::tenth_to(2),
        Kind::Saddle => decimal("0.05")?,
    };
    for (i, j) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
        let df = |k: usize| &slope[k][j] - unit(k, j);
        let product = &(&y[i][0] * &df(0)) + &(&y[i][1] * &df(1));
        let off = (&product - unit(i, j)).magnitude();
        need(off < near, named("the preconditioner is nearly the inverse"))?;
    }
    let d = [ranges(c.derivative_at_point[0])?, ranges(c.derivative_at_point[1])?];
    for i in 0..2 {
        for j in 0..2 {
            need(d[i][j].within(&slope[i][j]), named("the derivative at the point is one on the candidate"))?;
        }
    }
    let (trace, determinant) = (&d[0][0] + &d[1][1], &(&d[0][0] * &d[1][1]) - &(&d[0][1] * &d[1][0]));
    // What was rounded were these products.
    let products = &(&d[0][0] * &d[1][1]).magnitude() + &(&d[0][1] * &d[1][0]).magnitude();
    let scale = &Rational::whole(4) + &products;
    tight(&range(c.trace)?, &trace, &scale, &named("the trace"))?;
    tight(&range(c.determinant)?, &determinant, &scale, &named("the determinant"))?;
    let one = Range::point(&Rational::whole(1));
    // The characteristic polynomial l^2 - trace l + determinant at 1 and -1.
    let (above, below) = (&(&one + &determinant) - &trace, &(&one + &determinant) + &trace);
    let zero = Rational::whole(0);
    let stability = match kind {
        Kind::Attracts => {
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
        Kind::Saddle => {
            need(
                above.low > zero && below.high < zero || above.high < zero && below.low > zero,
                named("the characteristic polynomial has different signs at 1 and -1"),
            )?;
            format!("it is a saddle (1 + det - trace in {above}, 1 + det + trace in {below})")
        }
    };

    need(c.crossings.len() == crossings, named(&format!("{crossings} crossings of y = 0 a turn")))?;
    let mut before = Rational::whole(0);
    for (n, crossing) in c.crossings.iter().enumerate() {
        let time = range(crossing.time)?;
        need(time.low > before, named("times grow"))?;
        before = time.high;
        need(crossing.upward == (n % 2 == 1), named("directions alternate, the last is upward"))?;
    }
    if let Some(last) = c.crossings.last() {
        need(last.time == c.period, named("the period is the time of the last crossing"))?;
        for (a, b) in ranges(last.point)?.iter().zip(&point) {
            need(a.meets(b), named("the orbit closes"))?;
        }
    }
    let middle = |[low, high]: Bounds| 0.5 * low + 0.5 * high;
    let found = equation.crossings(middle(c.point[0]), middle(c.point[1]), crossings);
    need(found.len() == crossings, named("a plain orbit returns"))?;
    let mut worst = 0.0_f64;
    for (got, want) in found.iter().zip(&c.crossings) {
        for (g, w) in got.iter().zip([want.time, want.point[0], want.point[1]]) {
            let narrow = w[1] - w[0] < kind.plain();
            worst = worst.max((g - middle(w)).abs());
            need(narrow, named("the crossings are narrow"))?;
        }
    }
    need(worst < kind.plain(), named(&format!("a plain orbit has the same crossings ({worst:.1e} off)")))?;
    Ok(vec![
        format!("{name}: Krawczyk's inclusion; exactly one fixed point, in x {}, z {}", point[0], point[1]),
        format!("{name}: {stability}"),
        format!("{name}: a plain integrator finds the same {crossings} crossings, {worst:.0e} off at most"),
    ])
}

fn printed_cycle(c: &Cycle) -> Check<Vec<String>> {
    for b in ranges(c.candidate)? {
        need(b.width() < Rational::tenth_to(8), "the candidate is narrower than 1e-8")?;
    }
    need(range(c.period)?.width() < Rational::tenth_to(9), "the period is known to ten digits")?;
    cycle(c, "1e-3", 2, Kind::Attracts, "the cycle")
}

fn coexistence(c: &Coexistence) -> Check<Vec<String>> {
    let mut said = cycle(&c.one, "0.1", 2, Kind::Attracts, "period one")?;
    said.extend(cycle(&c.three, "0.1", 6, Kind::Attracts, "period three")?);
    let points = all_different(&[&c.one, &c.three])?;
    said.push(format!("the {points} upward crossings are all different: two orbits, and three returns are needed"));
    Ok(said)
}

/// How many upward crossings closed orbits have, if no two are the same.
fn all_different(orbits: &[&Cycle]) -> Check<usize> {
    let mut points = Vec::new();
    for crossing in orbits.iter().flat_map(|c| &c.crossings).filter(|c| c.upward) {
        points.push(ranges(crossing.point)?);
    }
    for (i, a) in points.iter().enumerate() {
        for b in &points[i + 1..] {
            need(!(a[0].meets(&b[0]) && a[1].meets(&b[1])), "the upward crossings of the orbits are all different")?;
        }
    }
    Ok(points.len())
}

fn saddles(c: &Saddles) -> Check<Vec<String>> {
    let mut said = Vec::new();
    let orbits = [
        (&c.three, 6, "period three"),
        (&c.inverting, 8, "period four, inverting"),
        (&c.four, 8, "period four"),
        (&c.five, 10, "period five"),
    ];
    for (orbit, crossings, name) in orbits {
        said.extend(cycle(orbit, "0.1", crossings, Kind::Saddle, name)?);
    }
    let points = all_different(&orbits.map(|o| o.0))?;
    said.push(format!("the {points} upward crossings are all different: four orbits, and all returns are needed"));
    Ok(said)
}

fn sensitivity(c: &Sensitivity) -> Check<Vec<String>> {
    equation(&c.equation, "0.1")?;
    let (a, b) = (decimal(&c.states.x[0])?, decimal(&c.states.x[1])?);
    let apart = (&a - &b).abs();
    need(apart < Rational::tenth_to(12), "the states are less than 1e-12 apart")?;
    need(decimal(&c.states.y)? == Rational::whole(0), "the states lie on y = 0")?;
    // At the singularity: within a few eps across, and on it along the layer.
    need(decimal(&c.states.z)?.abs() < Rational::tenth_to(12), "the states lie at the singularity (z)")?;
    need(a.abs() < Rational::tenth_to(4) && b.abs() < Rational::tenth_to(4), "the states lie at the singularity (x)")?;
    need(c.crossings.len() == 3, "three crossings")?;
    let mut said = Vec::new();
    let mut before = [Rational::whole(0), Rational::whole(0)];
    for (n, crossing) in c.crossings.iter().enumerate() {
        let at = |k: usize| Ok::<_, String>([ball(&crossing.orbits[k].x)?, ball(&crossing.orbits[k].z)?]);
        let (p, q) = (at(0)?, at(1)?);
        need(crossing.upward == (n % 2 == 0), "directions alternate, the first is upward")?;
        for (k, orbit) in crossing.orbits.iter().enumerate() {
            let time = ball(&orbit.time)?;
            need(time.low > before[k], "times grow")?;
            before[k] = time.high;
        }
        let squared = &(&p[0] - &q[0]).squared() + &(&p[1] - &q[1]).squared();
        tight(&range(crossing.distance)?.squared(), &squared, &Rational::whole(1), "the distance")?;
        if n == 1 {
            need(squared.low > decimal("0.09")?, "the second crossings are more than 0.3 apart")?;
        }
        said.push(format!("crossing {}: {} apart", n + 1, range(crossing.distance)?));
    }
    for row in c.growth_until_first_crossing {
        for g in ranges(row)? {
            // No wider than a part in ten thousand.
            need(g.width() < &g.magnitude() * &Rational::tenth_to(4), "the growth factors are narrow")?;
        }
    }
    let largest = range(c.growth_until_first_crossing[1][0])?;
    need(largest.high < -&decimal("7.6e12")?, "the largest growth factor is beyond 7.6e12")?;
    said.insert(0, format!("the states are {:.2e} apart", apart.approximately()));
    Ok(said)
}

/// Compares rows with the first rows of a table computed elsewhere, as many as there are.
fn agree(name: &str, rows: &[TableRow], text: &str) -> Check<String> {
    let wanted: Vec<Vec<&str>> =
        text.lines().filter(|l| !l.starts_with('#') && !l.starts_with("t,")).map(|l| l.split(',').collect()).collect();
    need(rows.len() <= wanted.len(), format!("{name}: {} rows", wanted.len()))?;
    let mut before = Rational::whole(0);
    let mut widest = Rational::whole(0);
    for (n, (row, want)) in rows.iter().zip(&wanted).enumerate() {
        let [t, x, z, direction, uncertainty] = want[..] else {
            return Err(format!("{name}: row {} of the table is complete", n + 1));
        };
        let at = |what: &str| format!("{name}, row {}: {what}", n + 1);
        let slack = decimal(uncertainty)?;
        for (column, got, want) in [("t", &row.time, t), ("x", &row.x, x), ("z", &row.z, z)] {
            let (got, want) = (ball(got)?, decimal(want)?);
            // The table has 16 or 17 digits.
            let room = &slack + &(&want.abs() * &Rational::tenth_to(15));
            need(Range::point(&want).within(&got.widened(&room)), at(&format!("{column} is the table's")))?;
            need(got.width() < Rational::tenth_to(4), at("the enclosure is narrow"))?;
            widest = widest.max(got.width());
        }
        need(row.upward == (direction == "up"), at("the direction is the table's"))?;
        let time = ball(&row.time)?;
        need(time.low > before, at("times grow"))?;
        before = time.high;
    }
    Ok(format!("{name}: {} rows agree with the table; widest enclosure {:.1e}", rows.len(), widest.approximately()))
}

fn crossings(c: &Crossings) -> Check<Vec<String>> {
    let mut said = Vec::new();
    for (name, alpha, table, text, count) in
        [("printed", "1e-3", &c.printed, PRINTED, 24), ("reconstructed", "0.1", &c.reconstructed, RECONSTRUCTED, 61)]
    {
        equation(&table.equation, alpha)?;
        need(table.crossings.len() == count, format!("{name}: {count} rows"))?;
        said.push(agree(name, &table.crossings, text)?);
    }
    Ok(said)
}

/// Where a plain orbit must be that passed the singularity, which multiplies the plain integrator's own errors.
const PLAIN_EXIT: f64 = 1e-4;

fn contraction(c: &Contraction) -> Check<Vec<String>> {
    let equation = equation(&c.equation, "0.1")?;
    let mut ends: Vec<[Range; 2]> = Vec::new();
    let mut worst = 0.0_f64;
    for (orbit, [x, z]) in c.orbits.iter().zip([["0.2", "-1"], ["0.21", "-1"], ["0.2", "-0.99"]]) {
        let at = |what: &str| format!("the orbit from ({x}, 0, {z}): {what}");
        let start = [decimal(&orbit.start.x)?, decimal(&orbit.start.y)?, decimal(&orbit.start.z)?];
        need(start == [decimal(x)?, Rational::whole(0), decimal(z)?], at("starts there"))?;
        need(orbit.crossings.len() == 4, at("four crossings"))?;
        let number = |text: &str| text.parse::<f64>().map_err(|_| at("the start is a number"));
        let plain = equation.crossings(number(x)?, number(z)?, 4);
        need(plain.len() == 4, at("a plain orbit comes back four times"))?;
        let mut before = Rational::whole(0);
        for (n, (row, plain)) in orbit.crossings.iter().zip(&plain).enumerate() {
            let time = ball(&row.time)?;
            need(time.low > before, at("times grow"))?;
            before = time.high;
            need(row.upward == (n % 2 == 1), at("directions alternate, the first is downward"))?;
            for (said, got) in [(&row.time, plain[0]), (&row.x, plain[1]), (&row.z, plain[2])] {
                let (said, got) = (ball(said)?, exactly(got)?);
                need(said.width() < Rational::tenth_to(12), at("the enclosures are narrow"))?;
                worst = worst.max((&said.high - &got).abs().approximately());
            }
        }
        let point = |n: usize| Ok::<_, String>([ball(&orbit.crossings[n].x)?, ball(&orbit.crossings[n].z)?]);
        for side in point(2)? {
            need(side.magnitude() < Rational::tenth_to(4), at("passes the singularity within 1e-4"))?;
        }
        ends.push(point(3)?);
    }
    need(worst < PLAIN_EXIT, format!("plain orbits have the same crossings ({worst:.1e} off)"))?;
    let mut said = Vec::new();
    for (distance, end) in c.distances.iter().zip(&ends[1..]) {
        let squared = &(&end[0] - &ends[0][0]).squared() + &(&end[1] - &ends[0][1]).squared();
        tight(&range(*distance)?.squared(), &squared, &Rational::whole(1), "the distance")?;
        need(squared.high < decimal("2.5e-7")?, "the fourth crossings are less than 0.0005 apart")?;
        said.push(format!("starts 0.01 apart, fourth crossings {} apart", range(*distance)?));
    }
    said.push(format!("plain orbits have the same crossings, {worst:.0e} off at most"));
    Ok(said)
}

/// Where u lies: before the set (-1), beyond it (1), or neither (0).
fn side(u: &Range) -> i32 {
    let one = Rational::whole(1);
    i32::from(u.low > one) - i32::from(u.high < -&one)
}

/// One covering relation (Zgliczynski & Gidea 2004, Definition 2): the ends come to either side, no piece meets the other set's edges v = -1, 1.
fn covers(c: &Covering) -> Check {
    let at = |what: &str| format!("set {}: {what}", c.from);
    for (image, u) in c.ends.iter().zip([-1.0, 1.0]) {
        need(image.part == [u, u], at("the ends are those of the set"))?;
    }
    // The pieces leave nothing out.
    let mut before = -1.0;
    for piece in &c.pieces {
        need(piece.part[0] == before && piece.part[1] > before, at("the pieces follow on each other"))?;
        before = piece.part[1];
    }
    need(before == 1.0, at("the pieces make up the set"))?;
    for image in c.pieces.iter().chain(&c.ends) {
        need(image.seen.len() == c.to.len(), at("an image is seen from every set that is to be covered"))?;
    }
    for (k, to) in c.to.iter().enumerate() {
        let across = |image: &ImageOfPart| -> Check<i32> { Ok(side(&range(image.seen[k][0])?)) };
        let (left, right) = (across(&c.ends[0])?, across(&c.ends[1])?);
        need(left * right == -1, at(&format!("the ends come to either side of set {to}")))?;
        for piece in &c.pieces {
            let within = range(piece.seen[k][1])?.magnitude() < Rational::whole(1);
            need(within || across(piece)? != 0, at(&format!("no piece leaves set {to} sideways")))?;
        }
        // Enclosures of the ends lie in those of the pieces that have them: altered alone, they part.
        for (end, piece) in [(&c.ends[0], c.pieces.first()), (&c.ends[1], c.pieces.last())] {
            for (e, p) in end.seen[k].iter().zip(piece.map(|p| p.seen[k]).unwrap_or_default()) {
                need(range(*e)?.meets(&range(p)?), at("an end's image lies in its piece's"))?;
            }
        }
    }
    Ok(())
}

/// A parallelogram's extent in x and in z.
fn extent(p: &Parallelogram) -> Check<[Range; 2]> {
    let of = |i: usize| {
        let reach = &exactly(p.unstable[i])?.abs() + &exactly(p.stable[i])?.abs();
        Ok::<_, String>(Range::point(&exactly(p.centre[i])?).widened(&reach))
    };
    Ok([of(0)?, of(1)?])
}

/// How near a plain orbit comes to where a set's middle is said to go: what the singularity makes of an error of 1e-16 or so, and of the plain integrator's own.
const PLAIN_PASSAGE: f64 = 5e-7;

fn horseshoe(c: &Horseshoe) -> Check<Vec<String>> {
    /// Sets of the longer loop.
    const LONG: usize = 14;
    let equation = equation(&c.equation, "0.1")?;
    need(c.sets.len() == LONG + 1 && c.coverings.len() == c.sets.len(), "fifteen sets, each of which covers others")?;
    for set in &c.sets {
        let [[a, p], [b, q]] = [0, 1].map(|i| [set.unstable[i], set.stable[i]]);
        let area = &(&exactly(a)? * &exactly(q)?) - &(&exactly(b)? * &exactly(p)?);
        need(area != Rational::whole(0), "the parallelograms have an area")?;
        for side in extent(set)? {
            need(side.width() < Rational::tenth_to(12), "the parallelograms are smaller than 1e-12")?;
        }
    }
    let mut pieces = 0;
    let (mut nearest, mut worst) = (Rational::whole(0), 0.0_f64);
    // 0, 1, 0, ... and 0, 2, 3, ..., 14, 0, ...
    let follows = |i: usize| match i {
        0 => vec![1, 2],
        1 | LONG => vec![0],
        i => vec![i + 1],
    };
    for (i, covering) in c.coverings.iter().enumerate() {
        need(covering.from == i && covering.to == follows(i), "the sets make two loops through the first")?;
        covers(covering)?;
        pieces += covering.pieces.len();
        need(covering.passage.crossing <= 8, "the singularity is passed on the way")?;
        for side in [covering.passage.x, covering.passage.z] {
            let size = range(side)?.magnitude();
            need(size < Rational::tenth_to(4), "the singularity is passed within 1e-4")?;
            nearest = nearest.max(size);
        }
    }
    let (one, two) = (extent(&c.sets[1])?, extent(&c.sets[2])?);
    need(!(one[0].meets(&two[0]) && one[1].meets(&two[1])), "the sets that follow the common one are disjoint")?;
    for (i, covering) in c.coverings.iter().enumerate() {
        let [x, z] = c.sets[i].centre;
        let found = equation.crossings(x, z, 8);
        need(found.len() == 8, "a plain orbit returns")?;
        let passage = found[covering.passage.crossing.saturating_sub(1)];
        let middle = |[low, high]: Bounds| 0.5 * low + 0.5 * high;
        for (got, said) in [(passage[1], covering.passage.x), (passage[2], covering.passage.z)] {
            need((got - middle(said)).abs() < 1e-7, format!("set {i}: a plain orbit passes the singularity there"))?;
        }
        for to in follows(i) {
            let target = c.sets[to].centre;
            worst = worst.max((found[7][1] - target[0]).abs()).max((found[7][2] - target[1]).abs());
        }
    }
    need(worst < PLAIN_PASSAGE, format!("plain orbits from the sets come to the next ones ({worst:.1e} off)"))?;
    // lambda^-2 + lambda^-14 falls with lambda: it is above 1 at 1.12, so that the growth rate of chains is beyond 1.12.
    let base = decimal("1.12")?;
    let power = |n: u32| (0..n).fold(Rational::whole(1), |p, _| &p * &base);
    need(power(14) < &power(12) + &Rational::whole(1), "chains of sets grow by more than 1.12 a return")?;
    Ok(vec![
        format!(
            "{} covering relations, {pieces} pieces: loops of 2 and {LONG} sets through the first",
            c.sets.len() + 1
        ),
        "the two sets that can follow the first are disjoint: entropy more than log(1.12) a return".to_owned(),
        format!("every return passes the singularity, within {:.1e} in x and z", nearest.approximately()),
        format!("plain orbits from the sets' middles come to the next sets within {worst:.0e}"),
    ])
}
