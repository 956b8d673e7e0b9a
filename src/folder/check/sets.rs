//! Points of sections as sets: periods, and how far apart two of them are.

use crate::job::{Answer, Table};
use crate::num::elementary::pow;

/// Distances in a section are compared with its extent.
pub(super) const REPEATS: f64 = 1e-6;
/// The longest period that is looked for.
pub(super) const LONGEST: usize = 64;

/// The later half of a section's crossings, by rows, and their direction: `direction`, or that of
/// the first of all if the section knows it.
pub(super) fn section<'a>(
    answer: &'a Answer,
    direction: Option<&'a str>,
) -> Result<(Vec<Vec<f64>>, Option<&'a str>), String> {
    let table = answer
        .table("section")
        .ok_or("the run has no section; give section, such as section = \"y=0\"")?;
    let wanted = direction.or(table.words("direction").next());
    Ok((later_half(answer, &|word| word == wanted)?, wanted))
}

/// The later half of a section's crossings in directions that are `wanted`, by rows.
pub(super) fn later_half(
    answer: &Answer,
    wanted: &dyn Fn(Option<&str>) -> bool,
) -> Result<Vec<Vec<f64>>, String> {
    let table = answer
        .table("section")
        .ok_or("the run has no section; give section, such as section = \"y=0\"")?;
    let t = table.numbers("t");
    let (Some(first), Some(last)) = (t.first(), t.last()) else {
        return Err("the section was never crossed".into());
    };
    let half = 0.5 * (first + last);
    let columns: Vec<&[f64]> = states(table);
    let directions: Vec<&str> = table.words("direction").collect();
    let rows = (0..t.len()).filter(|i| t[*i] > half && wanted(directions.get(*i).copied()));
    let found: Vec<Vec<f64>> = rows.map(|i| columns.iter().map(|c| c[i]).collect()).collect();
    if found.is_empty() {
        return Err("the section was never crossed in the later half".into());
    }
    Ok(found)
}

pub(super) fn states(table: &Table) -> Vec<&[f64]> {
    let names = table.columns.iter().map(|c| c.name.as_str()).filter(|n| *n != "t");
    names.map(|n| table.numbers(n)).filter(|v| v.len() == table.len()).collect()
}

/// Points that lie within this part of their size are one, to the errors of a run.
const ONE_POINT: f64 = 1e-6;

/// A state that moves over less than this part of the largest extent is measured by its own.
const LITTLE: f64 = 0.05;

/// Such a state repeats itself if it comes back to within this part of its extent.
const LITTLE_REPEATS: f64 = 1e-3;

/// The same to rounding.
const ROUNDING: f64 = 1e-9;

/// Extents of points.
struct Extents {
    /// Along each state.
    spans: Vec<f64>,
    /// The largest of them.
    span: f64,
    /// The largest size of a state.
    size: f64,
}

impl Extents {
    fn of(points: &[Vec<f64>]) -> Self {
        let along = |i: usize| {
            points
                .iter()
                .fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), p| (a.min(p[i]), b.max(p[i])))
        };
        let ranges: Vec<(f64, f64)> = (0..points[0].len()).map(along).collect();
        let spans: Vec<f64> = ranges.iter().map(|(low, high)| high - low).collect();
        let span = spans.iter().copied().fold(0.0, f64::max);
        let size = ranges.iter().fold(0.0, |most, (a, b)| f64::max(most, a.abs().max(b.abs())));
        Self { spans, span, size }
    }

    /// Units of the states: 1, but of one that moves little beside the largest, and by more than
    /// errors, `small` of its extent.
    fn units(&self, small: impl Fn(f64) -> f64) -> Vec<f64> {
        let unit = |span: &f64| if self.moves_little(*span) { small(*span) } else { 1.0 };
        self.spans.iter().map(unit).collect()
    }

    fn moves_little(&self, span: f64) -> bool {
        span > ONE_POINT * self.size && span < LITTLE * self.span
    }
}

fn distance(a: &[f64], b: &[f64], units: &[f64]) -> f64 {
    a.iter().zip(b).zip(units).fold(0.0, |most, ((a, b), unit)| most.max((a - b).abs() / unit))
}

/// After how many points a section repeats itself, if it does.
pub(super) fn period(points: &[Vec<f64>], within: f64) -> Option<usize> {
    let extents = Extents::of(points);
    let Extents { span, size, .. } = extents;
    let units = extents.units(|own| (LITTLE_REPEATS * own / (within * span)).min(1.0));
    // At least three times around.
    let repeats = |near: f64| {
        (1..=LONGEST.min(points.len() / 3))
            .find(|n| points.iter().zip(&points[*n..]).all(|(a, b)| distance(a, b, &units) <= near))
    };
    if span <= ROUNDING * size {
        return repeats(within * size);
    }
    // A small orbit that is resolved has its period; of a run's errors alone none repeats.
    repeats(within * span).or_else(|| repeats(within * size).filter(|_| span <= ONE_POINT * size))
}

/// A shorter period than was found, or one where none was, of points that are the same but for
/// errors that a run at this tolerance can have: its steps may settle to a cycle of their own, or
/// to none.
pub(super) fn blurred(
    points: &[Vec<f64>],
    within: f64,
    rtol: f64,
    found: Option<usize>,
) -> Option<usize> {
    let extents = Extents::of(points);
    let near: Vec<f64> = (0..points[0].len())
        .map(|i| {
            let moves_little = extents.moves_little(extents.spans[i]);
            let own = points.iter().fold(0.0, |most: f64, p| most.max(p[i].abs()));
            let size = if moves_little { own } else { extents.size };
            let fine = if moves_little { LITTLE_REPEATS * extents.spans[i] } else { f64::INFINITY };
            fine.min(within * extents.span).max(BLUR * rtol * size)
        })
        .collect();
    let same =
        |a: &[f64], b: &[f64]| a.iter().zip(b).zip(&near).all(|((a, b), n)| (a - b).abs() <= *n);
    let longest = found.map_or(LONGEST.min(points.len() / 3), |n| n - 1);
    (1..=longest).find(|n| points.iter().zip(&points[*n..]).all(|(a, b)| same(a, b)))
}

/// Errors of a run on a closed orbit, in units of its relative tolerance: of van der Pol's, by
/// three methods at 1e-3 to 1e-8, they are up to 11.
const BLUR: f64 = 100.0;

/// The period of an orbit that points still approach: each comes nearer to the one a period before,
/// quarter by quarter of the section, as evenly as a geometric series (a power of the time slows
/// down); what is then left of the way is short beside the distances of the orbit's own points.
pub(super) fn approached(points: &[Vec<f64>]) -> Option<usize> {
    const QUARTER: f64 = 0.7;
    const EVENLY: f64 = 0.8;
    const SHORT: f64 = 0.25;
    let extents = Extents::of(points);
    let units = extents.units(|own| own / extents.span);
    (1..=LONGEST.min(points.len() / 8)).find(|&n| {
        let moved: Vec<f64> =
            points.iter().zip(&points[n..]).map(|(a, b)| distance(a, b, &units)).collect();
        let length = moved.len() / 4;
        let [a, b, c, d] = [0, 1, 2, 3]
            .map(|k| moved[k * length..(k + 1) * length].iter().fold(0.0, |m: f64, x| m.max(*x)));
        let evenly =
            b < QUARTER * a && c < QUARTER * b && d < QUARTER * c && d / c < pow(c / b, EVENLY);
        let last = &points[points.len() - n..];
        let apart = (0..n)
            .flat_map(|i| (0..i).map(move |k| (i, k)))
            .map(|(i, k)| distance(&last[i], &last[k], &units))
            .fold(f64::INFINITY, f64::min);
        let left = d / (1.0 - pow(d / c, n as f64 / length as f64));
        evenly && left < SHORT * apart
    })
}

/// Whether crossings in the two directions come together, as they do on the way to a rest.
pub(super) fn narrows(answer: &Answer, points: &[Vec<f64>], direction: Option<&str>) -> bool {
    let mut words = answer.table("section").into_iter().flat_map(|table| table.words("direction"));
    let other = words.find(|word| Some(*word) != direction);
    other.and_then(|other| section(answer, Some(other)).ok()).is_some_and(|(back, _)| {
        let units = vec![1.0; points[0].len()];
        let [first, last] =
            [(&points[0], &back[0]), (&points[points.len() - 1], &back[back.len() - 1])]
                .map(|(a, b)| distance(a, b, &units));
        last < 0.7 * first
    })
}

/// Hausdorff's distance of two sets of points, relative to their extent: that of the crossings in
/// `both_ways`, since those in one direction may be one point, with a run's errors for an extent.
pub(super) fn apart(sets: [&[Vec<f64>]; 2], both_ways: [&[Vec<f64>]; 2]) -> Result<f64, String> {
    let n = sets[0][0].len();
    if sets[1][0].len() != n {
        return Err("the two sections have other states".into());
    }
    let extents = both_ways.map(Extents::of);
    let most = |of: &dyn Fn(&Extents) -> f64| extents.iter().map(of).fold(0.0, f64::max);
    let size = most(&|e| e.size).max(f64::MIN_POSITIVE);
    let span = most(&|e| e.span);
    let moves = span > ERRORS * size;
    let whole = if moves { span } else { size };
    // A state that moves little beside the others, and goes on to, is measured by its own extent;
    // one that does not move, by its size.
    let own = |i: usize| {
        let span = most(&|e| e.spans[i]);
        let size_of = |p: &Vec<f64>| p[i].abs();
        let all = both_ways.iter().flat_map(|points| points.iter().map(size_of));
        if moves && span > ONE_POINT * size { span } else { all.fold(0.0, f64::max) }
    };
    let goes_on = |i: usize| {
        both_ways.iter().all(|points| {
            let (early, late) = points.split_at(points.len() / 2);
            early.is_empty() || Extents::of(late).spans[i] >= STEADY * Extents::of(early).spans[i]
        })
    };
    let unit = |i: usize| {
        let own = own(i);
        let counts = own > ONE_POINT * size && own < LITTLE * whole && goes_on(i);
        if counts { own } else { whole }
    };
    let units: Vec<f64> = (0..n).map(unit).collect();
    let [a, b] = sets.map(|points| {
        let step = points.len().div_ceil(MOST_COMPARED);
        points.iter().step_by(step).collect::<Vec<_>>()
    });
    let one_way = |from: &[&Vec<f64>], to: &[&Vec<f64>]| {
        from.iter()
            .map(|p| to.iter().map(|q| distance(p, q, &units)).fold(f64::INFINITY, f64::min))
            .fold(0.0, f64::max)
    };
    Ok(one_way(&a, &b).max(one_way(&b, &a)))
}

/// Sets that lie within this part of their size have none but errors of a run for an extent.
const ERRORS: f64 = 1e-4;

/// A state's extent that shrinks by more is on its way to something else.
const STEADY: f64 = 0.8;

/// Points of a section that are compared with another one's.
const MOST_COMPARED: usize = 2000;
