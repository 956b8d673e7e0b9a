//! The certificates, one kind a theorem, and what must hold in them.

use serde::Deserialize;
use serde_json::Value;

use super::plain::Equation;
use super::rational::{Range, Rational};
use super::{Refused, Verified};

/// A failed check: what should hold.
type Check<T = ()> = Result<T, String>;

fn need(holds: bool, what: impl Into<String>) -> Check {
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

type Bounds = [f64; 2];

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

/// Crossings computed outside this project in 113-bit arithmetic.
const PRINTED: &str = include_str!("../../tests/data/crossings-printed.csv");
/// See [`PRINTED`].
const RECONSTRUCTED: &str = include_str!("../../tests/data/crossings-reconstructed.csv");

/// The statements, word for word: a certificate proves these and no others.
const STATEMENTS: [(&str, &str); 4] = [
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
        "sensitivity",
        "For alpha = 0.1, beta = 1e-5, eps = 1e-3 and the tanh transition, the orbits of the smoothed caricature from the two states, which are less than 1e-12 apart \
         at the two-fold singularity, are more than 0.3 apart at their second crossing of y = 0.",
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
            "sensitivity" => sensitivity(&serde_json::from_value(data).map_err(unreadable)?),
            _ => crossings(&serde_json::from_value(data).map_err(unreadable)?),
        }
    };
    match findings {
        Ok(findings) => Ok(Verified { theorem, statement, findings }),
        Err(what) => Err(Refused::Wrong { theorem, what }),
    }
}

fn exactly(x: f64) -> Check<Rational> {
    Rational::exactly(x).ok_or_else(|| format!("{x} is a number"))
}

fn decimal(text: &str) -> Check<Rational> {
    Rational::decimal(text).ok_or_else(|| format!("{text:?} is a decimal number"))
}

fn range([low, high]: Bounds) -> Check<Range> {
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
fn tight(claimed: &Range, exact: &Range, scale: &Rational, what: &str) -> Check {
    need(exact.within(claimed), format!("{what} holds what its parts give"))?;
    let room = &(scale + &exact.magnitude()) * &Rational::tenth_to(14);
    need(claimed.within(&exact.widened(&room)), format!("{what} is no wider than its parts give"))
}

/// Where a plain integrator must find the crossings, in time and in both coordinates.
const PLAIN: f64 = 2e-6;

/// Krawczyk's inclusion and stability.
fn cycle(c: &Cycle, alpha: &str, crossings: usize, name: &str) -> Check<Vec<String>> {
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
    // The preconditioner is near the inverse of D - 1: that is what makes the inclusion sharp.
    for i in 0..2 {
        for j in 0..2 {
            let df = |k: usize| &slope[k][j] - unit(k, j);
            let product = &(&y[i][0] * &df(0)) + &(&y[i][1] * &df(1));
            let off = (&product - unit(i, j)).magnitude();
            need(off < Rational::tenth_to(2), named("the preconditioner is nearly the inverse"))?;
        }
    }
    let d = [ranges(c.derivative_at_point[0])?, ranges(c.derivative_at_point[1])?];
    for i in 0..2 {
        for j in 0..2 {
            need(d[i][j].within(&slope[i][j]), named("the derivative at the point is one on the candidate"))?;
        }
    }
    let (trace, determinant) = (&d[0][0] + &d[1][1], &(&d[0][0] * &d[1][1]) - &(&d[0][1] * &d[1][0]));
    let scale = Rational::whole(4);
    tight(&range(c.trace)?, &trace, &scale, &named("the trace"))?;
    tight(&range(c.determinant)?, &determinant, &scale, &named("the determinant"))?;
    let one = Rational::whole(1);
    need(determinant.high < one, named("the determinant is below 1"))?;
    let sum = &one + &determinant.low;
    need(
        &sum + &trace.low > Rational::whole(0) && &sum - &trace.high > Rational::whole(0),
        named("the trace is below 1 plus the determinant in absolute value"),
    )?;

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
            let narrow = w[1] - w[0] < PLAIN;
            worst = worst.max((g - middle(w)).abs());
            need(narrow, named("the crossings are narrow"))?;
        }
    }
    need(worst < PLAIN, named(&format!("a plain orbit has the same crossings ({worst:.1e} off)")))?;
    Ok(vec![
        format!("{name}: Krawczyk's inclusion; exactly one fixed point, in x {}, z {}", point[0], point[1]),
        format!(
            "{name}: it attracts (1 - det >= {:.3e}, 1 + det - |trace| >= {:.3e})",
            (&one - &determinant.high).approximately(),
            (&sum - &trace.magnitude()).approximately()
        ),
        format!("{name}: a plain integrator finds the same {crossings} crossings, {worst:.0e} off at most"),
    ])
}

fn printed_cycle(c: &Cycle) -> Check<Vec<String>> {
    for b in ranges(c.candidate)? {
        need(b.width() < Rational::tenth_to(8), "the candidate is narrower than 1e-8")?;
    }
    need(range(c.period)?.width() < Rational::tenth_to(9), "the period is known to ten digits")?;
    cycle(c, "1e-3", 2, "the cycle")
}

fn coexistence(c: &Coexistence) -> Check<Vec<String>> {
    let mut said = cycle(&c.one, "0.1", 2, "period one")?;
    said.extend(cycle(&c.three, "0.1", 6, "period three")?);
    let mut points = Vec::new();
    for crossing in c.one.crossings.iter().chain(&c.three.crossings).filter(|c| c.upward) {
        points.push(ranges(crossing.point)?);
    }
    for (i, a) in points.iter().enumerate() {
        for b in &points[i + 1..] {
            need(
                !(a[0].meets(&b[0]) && a[1].meets(&b[1])),
                "the upward crossings of the two orbits are all different",
            )?;
        }
    }
    said.push(format!(
        "the {} upward crossings are all different: two orbits, and three returns are needed",
        points.len()
    ));
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
    let largest = range(c.growth_until_first_crossing[0][0])?;
    need(largest.high < -&decimal("7.6e12")?, "the largest growth factor is beyond 7.6e12")?;
    said.insert(0, format!("the states are {:.2e} apart", apart.approximately()));
    Ok(said)
}

fn crossings(c: &Crossings) -> Check<Vec<String>> {
    let mut said = Vec::new();
    for (name, alpha, table, text) in
        [("printed", "1e-3", &c.printed, PRINTED), ("reconstructed", "0.1", &c.reconstructed, RECONSTRUCTED)]
    {
        equation(&table.equation, alpha)?;
        let wanted: Vec<Vec<&str>> = text
            .lines()
            .filter(|l| !l.starts_with('#') && !l.starts_with("t,"))
            .map(|l| l.split(',').collect())
            .collect();
        need(table.crossings.len() == wanted.len(), format!("{name}: {} rows", wanted.len()))?;
        let mut before = Rational::whole(0);
        let mut widest = Rational::whole(0);
        for (n, (row, want)) in table.crossings.iter().zip(&wanted).enumerate() {
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
        said.push(format!(
            "{name}: {} rows agree with the table; widest enclosure {:.1e}",
            wanted.len(),
            widest.approximately()
        ));
    }
    Ok(said)
}
