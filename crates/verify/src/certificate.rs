//! The certificates, one kind a theorem, and what must hold in them.

use std::collections::BTreeMap;
use std::rc::Rc;

use serde::Deserialize;
use serde::de::{DeserializeOwned, IgnoredAny};

use super::check::{Bounds, Check, decimal, exactly, holds, need, range, tight};
use super::inner::inner_law;
use super::orbit::{Caricature, Crossing, FlowSettings};
use super::rational::{Range, Rational};
use super::recompute::{Known, PLANE, Patch, krawczyk};
use super::strict::without_repeats;
use super::theorem::{
    Contraction as ContractionShown, Cycle as CycleShown, Cycles, Horseshoe as HorseshoeShown,
    Parameters, Sensitivity as SensitivityShown, Shows, Stability, Tables, Theorem,
};
use super::{Refused, Verified};

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Certificate<T> {
    theorem: String,
    statement: String,
    data: T,
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
    orbits: Vec<OrbitFrom>,
    distances: Vec<Bounds>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Horseshoe {
    equation: Parameters,
    sets: Vec<Parallelogram>,
    coverings: Vec<Covering>,
}

/// Checks certificates. What it computes for one it keeps for the next.
pub struct Checker {
    theorems: Vec<Theorem>,
    known: Known,
}

impl Checker {
    /// One that knows these theorems.
    pub fn new(theorems: Vec<Theorem>) -> Self {
        Self { theorems, known: Known::default() }
    }

    /// One that looks at all that needs no orbit and then refuses: for those who try readers with a
    /// great many texts.
    pub fn of_reader(theorems: Vec<Theorem>) -> Self {
        Self { theorems, known: Known::of_reader() }
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
            serde_json::from_str::<Certificate<IgnoredAny>>(text).map_err(unreadable)?;
        let Some(of) = self.theorems.iter().find(|t| t.name == theorem) else {
            return Err(Refused::Unreadable(format!("there is no theorem {theorem:?}")));
        };
        let words = |text: &str| text.split_whitespace().map(str::to_owned).collect::<Vec<_>>();
        let known = &self.known;
        let findings = if words(&statement) != words(&of.statement) {
            Err("the statement is the one that is checked".to_owned())
        } else {
            match &of.shows {
                Shows::Cycle(shown) => one_cycle(known, shown, &data(text)?),
                Shows::Cycles(shown) => {
                    cycles(known, shown, &parts(text, shown.orbits.iter().map(|o| &*o.0))?)
                }
                Shows::InnerLaw(shown) => inner_law(known, shown, &data(text)?),
                Shows::Contraction(shown) => contraction(known, shown, &data(text)?),
                Shows::Horseshoe(shown) => horseshoe(known, shown, &data(text)?),
                Shows::Sensitivity(shown) => sensitivity(known, shown, &data(text)?),
                Shows::Tables(shown) => {
                    tables(known, shown, &parts(text, shown.tables.iter().map(|t| &*t.name))?)
                }
            }
        };
        match findings {
            Ok(findings) => Ok(Verified { theorem, statement, findings }),
            Err(what) => Err(Refused::Wrong { theorem, what }),
        }
    }
}

/// A certificate's data; errors say the line.
fn data<T: DeserializeOwned>(text: &str) -> Result<T, Refused> {
    serde_json::from_str::<Certificate<T>>(text)
        .map(|c| c.data)
        .map_err(|e| Refused::Unreadable(e.to_string()))
}

/// A certificate's data in parts, which have the names that the theorem gives them.
fn parts<'a, T: DeserializeOwned>(
    text: &str,
    names: impl Iterator<Item = &'a str>,
) -> Result<BTreeMap<String, T>, Refused> {
    let mut given = data::<BTreeMap<String, IgnoredAny>>(text)?;
    for name in names {
        if given.remove(name).is_none() {
            return Err(Refused::Unreadable(format!("missing field `{name}` in data")));
        }
    }
    match given.keys().next() {
        Some(name) => Err(Refused::Unreadable(format!("unknown field `{name}` in data"))),
        None => data(text),
    }
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

/// The equation, which must be the theorem's.
fn equation(given: &Parameters, wanted: &Parameters) -> Check<Caricature> {
    for p in [given, wanted] {
        need(
            p.system == "caricature" && p.transition == "tanh",
            "the equation is the caricature with tanh",
        )?;
    }
    let is = |given: &str, want: &str, name: &str| -> Check<Rational> {
        let wanted = decimal(want)?;
        need(decimal(given)? == wanted, format!("{name} = {want}"))?;
        Ok(wanted)
    };
    Ok(Caricature {
        alpha: is(&given.alpha, &wanted.alpha, "alpha")?,
        beta: is(&given.beta, &wanted.beta, "beta")?,
        eps: is(&given.eps, &wanted.eps, "eps")?,
        v_plus: is(&given.v_plus, &wanted.v_plus, "v+")?,
        v_minus: is(&given.v_minus, &wanted.v_minus, "v-")?,
    })
}

/// Krawczyk's inclusion and stability.
fn cycle(
    known: &Known,
    c: &Cycle,
    wanted: &Parameters,
    crossings: usize,
    kind: Stability,
    name: &str,
) -> Check<(Vec<String>, Rc<Vec<Crossing>>)> {
    let named = |what: &str| format!("{name}: {what}");
    let equation = equation(&c.equation, wanted)?;
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
        Stability::Attracts => Rational::tenth_to(2),
        Stability::Saddle => &Rational::whole(5) * &Rational::tenth_to(2),
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
        Stability::Attracts => {
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
        Stability::Saddle => {
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

fn one_cycle(known: &Known, shown: &CycleShown, c: &Cycle) -> Check<Vec<String>> {
    let widest = decimal(&shown.narrower)?;
    for b in ranges(c.candidate)? {
        let what = format!("the candidate is narrower than {}", shown.narrower);
        need(b.width() < widest, what)?;
    }
    Ok(cycle(known, c, &shown.equation, shown.crossings, shown.stability, "the cycle")?.0)
}

/// Several closed orbits, which must all be different.
fn cycles(known: &Known, shown: &Cycles, c: &BTreeMap<String, Cycle>) -> Check<Vec<String>> {
    let (mut said, mut points) = (Vec::new(), Vec::<[Range; 2]>::new());
    for (name, crossings) in &shown.orbits {
        let (findings, rows) =
            cycle(known, &c[name], &shown.equation, *crossings, shown.stability, name)?;
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
        shown.orbits.len()
    ));
    Ok(said)
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

fn sensitivity(known: &Known, shown: &SensitivityShown, c: &Sensitivity) -> Check<Vec<String>> {
    /// Half the distances in x and z of states whose quotients are the growth: 2^-72 and 2^-66, so
    /// that neither the third derivative nor the radii are seen.
    const APART: [f64; 2] =
        [1.0 / 4_722_366_482_869_645_213_696.0, 1.0 / 73_786_976_294_838_206_464.0];
    let equation = equation(&c.equation, &shown.equation)?;
    let (a, b, z) = (decimal(&c.states.x[0])?, decimal(&c.states.x[1])?, decimal(&c.states.z)?);
    let apart = (&a - &b).abs();
    need(
        apart > Rational::whole(0) && apart < decimal(&shown.apart)?,
        format!("the states differ by less than {}", shown.apart),
    )?;
    need(decimal(&c.states.y)? == Rational::whole(0), "the states lie on y = 0")?;
    // At the singularity: within a few eps across, and on it along the layer.
    need(z.abs() < Rational::tenth_to(12), "the states lie at the singularity (z)")?;
    need(
        a.abs() < decimal(&shown.near)? && b.abs() < decimal(&shown.near)?,
        "the states lie at the singularity (x)",
    )?;
    need(c.crossings.len() == shown.crossings, format!("{} crossings", shown.crossings))?;
    need((1..=shown.crossings).contains(&shown.at), "the crossing is one of them")?;
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
        if n + 1 == shown.at {
            let what = format!("crossings {} are more than {} apart", shown.at, shown.farther);
            need(ours.low > decimal(&shown.farther)?, what)?;
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

/// Tables of an orbit's first crossings.
fn tables(
    known: &Known,
    shown: &Tables,
    c: &BTreeMap<String, CrossingTable>,
) -> Check<Vec<String>> {
    let mut said = Vec::new();
    let [x, z] = [decimal(&shown.start[0])?, decimal(&shown.start[1])?];
    for of in &shown.tables {
        let (name, table, count) = (of.name.as_str(), &c[&of.name], of.rows);
        let equation = equation(&table.equation, &of.equation)?;
        need(table.crossings.len() == count, format!("{name}: {count} rows"))?;
        let ours =
            orbit(known, &equation, [&x, &z], &table.crossings.iter().collect::<Vec<_>>(), name)?;
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

fn contraction(known: &Known, shown: &ContractionShown, c: &Contraction) -> Check<Vec<String>> {
    let equation = equation(&c.equation, &shown.equation)?;
    need(
        c.orbits.len() == shown.starts.len() && c.distances.len() + 1 == c.orbits.len(),
        format!("{} orbits, and the distances of all others from the first", shown.starts.len()),
    )?;
    need((1..=shown.crossings).contains(&shown.passes), "the singularity is passed on the way")?;
    let mut ours = Vec::new();
    for (orbit_from, [x, z]) in c.orbits.iter().zip(&shown.starts) {
        let name = format!("the orbit from ({x}, 0, {z})");
        let (x, z) = (decimal(x)?, decimal(z)?);
        let start = [
            decimal(&orbit_from.start.x)?,
            decimal(&orbit_from.start.y)?,
            decimal(&orbit_from.start.z)?,
        ];
        need(start == [x.clone(), Rational::whole(0), z.clone()], format!("{name} starts there"))?;
        let count = shown.crossings;
        need(orbit_from.crossings.len() == count, format!("{name}: {count} crossings"))?;
        let rows = orbit(
            known,
            &equation,
            [&x, &z],
            &orbit_from.crossings.iter().collect::<Vec<_>>(),
            &name,
        )?;
        for i in PLANE {
            let near = rows[shown.passes - 1].states[i].magnitude() < decimal(&shown.near)?;
            need(near, format!("{name} passes the singularity within {}", shown.near))?;
        }
        ours.push(rows);
    }
    let mut said = Vec::new();
    for (k, claimed) in c.distances.iter().enumerate() {
        let last = shown.crossings - 1;
        let squared = squared_distance(&ours[0][last], &ours[k + 1][last]);
        let name = format!("the distance of orbits 1 and {}", k + 2);
        let found = distance(*claimed, &squared, &Rational::tenth_to(12), &name)?;
        let what = format!("{name} is below {}", shown.nearer);
        need(found.high < decimal(&shown.nearer)?, what)?;
        let [a, b] = [&shown.starts[0], &shown.starts[k + 1]];
        said.push(format!(
            "starts ({}, 0, {}) and ({}, 0, {}), crossings {} {} apart",
            a[0],
            a[1],
            b[0],
            b[1],
            shown.crossings,
            number(&found)
        ));
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

/// One covering relation (Zgliczynski & Gidea 2004, Definition 2): the ends come to either side of
/// the sets that are covered, no part meets their edges v = -1, 1. Whether the certificate's
/// numbers hold what is found comes first: the parts take longest.
fn covering(
    known: &Known,
    shown: &HorseshoeShown,
    equation: &Caricature,
    sets: &[Parallelogram],
    c: &Covering,
) -> Check<Rational> {
    let (turn, within) = (shown.crossings, decimal(&shown.near)?);
    /// Parts shorter than this are not tried.
    const SHORTEST: f64 = 1.0 / 64.0;
    let from = &sets[c.from];
    let to: Vec<&Parallelogram> = c.to.iter().map(|k| &sets[*k]).collect();
    let image = |low: f64, high: f64| -> Check<Rc<Vec<Crossing>>> {
        let rows = known.crossings(equation, &from.part(low, high)?, turn, FlowSettings::NARROW)?;
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
    need((1..=turn).contains(&passage.crossing), "the singularity is passed on the way")?;
    let passes = [range(passage.x)?, range(passage.z)?];
    for claimed in &passes {
        let what = format!("the passage claimed is within {}", shown.near);
        need(claimed.magnitude() < within, what)?;
    }

    for (claimed, _) in &claimed {
        for u in claimed.part {
            let rows = image(u, u)?;
            for (seen, to) in claimed.seen.iter().zip(&to) {
                for (claimed, ours) in ranges(*seen)?.iter().zip(to.see(&rows[turn - 1], false)?) {
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
            need(size < within, format!("the singularity is passed within {}", shown.near))?;
            nearest = nearest.clone().max(size);
            let middle = crossing.set.centre()[axis].range(0.0).ok_or("a crossing is bounded")?;
            holds(claimed, &middle, "the passage")?;
        }
        Ok(())
    };
    let last = |rows: &[Crossing], to: &Parallelogram| -> Check<[Range; 2]> {
        to.see(&rows[turn - 1], true)
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

fn horseshoe(known: &Known, shown: &HorseshoeShown, c: &Horseshoe) -> Check<Vec<String>> {
    let long = shown.long_loop;
    let equation = equation(&c.equation, &shown.equation)?;
    // Shorter, the two sets that follow the common one could be one.
    need(long > 2 && shown.crossings > 0, "two loops of returns")?;
    need(
        c.sets.len() == long + 1 && c.coverings.len() == c.sets.len(),
        format!("{} sets, each of which covers others", long + 1),
    )?;
    let widest = decimal(&shown.smaller)?;
    for set in &c.sets {
        for side in extent(set)? {
            need(
                side.width() < widest,
                format!("the parallelograms are smaller than {}", shown.smaller),
            )?;
        }
    }
    let (one, two) = (extent(&c.sets[1])?, extent(&c.sets[2])?);
    need(
        !(one[0].meets(&two[0]) && one[1].meets(&two[1])),
        "the sets that follow the common one are disjoint",
    )?;
    // 0, 1, 0, ... and 0, 2, 3, ..., long, 0, ...
    let follows = |i: usize| match i {
        0 => vec![1, 2],
        1 => vec![0],
        i if i == long => vec![0],
        i => vec![i + 1],
    };
    let mut nearest = Rational::whole(0);
    for (i, relation) in c.coverings.iter().enumerate() {
        need(
            relation.from == i && relation.to == follows(i),
            "the sets make two loops through the first",
        )?;
        nearest = nearest.max(
            covering(known, shown, &equation, &c.sets, relation)
                .map_err(|e| format!("set {i}: {e}"))?,
        );
    }
    // lambda^-2 + lambda^-long falls with lambda: if it is above 1 at the growth that is claimed,
    // the growth rate of chains is beyond it.
    let base = decimal(&shown.growth)?;
    let power = |n: usize| (0..n).fold(Rational::whole(1), |p, _| &p * &base);
    need(
        base > Rational::whole(1) && power(long) < &power(long - 2) + &Rational::whole(1),
        format!("chains of sets grow by more than {} a return", shown.growth),
    )?;
    Ok(vec![
        format!(
            "{} covering relations, proved anew: loops of 2 and {long} sets through the first",
            c.sets.len() + 1
        ),
        format!(
            "the two sets that can follow the first are disjoint: entropy more than log({}) a \
                return",
            shown.growth
        ),
        format!(
            "every return passes the singularity, within {:.1e} in x and z",
            nearest.approximately()
        ),
    ])
}
