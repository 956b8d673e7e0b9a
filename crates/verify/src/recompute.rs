//! Recomputation of the certificates' claims from their starting points alone.

use std::cell::RefCell;
use std::collections::HashMap;
use std::rc::Rc;

use super::ball::{Ball, Fixed, Number};
use super::check::{Check, need};
use super::orbit::{Caricature, Crossing, Flow, FlowSettings, Inner, Set};
use super::rational::{Range, Rational};

/// The coordinates on the section y = 0.
pub(super) const PLANE: [usize; 2] = [0, 2];
/// The section's normal.
const Y: usize = 1;
/// No orbit of a theorem takes longer from one crossing to the next.
const LONGEST: f64 = 100.0;
/// Half the width of the box about a closed orbit in which it is enclosed.
const CLOSE: f64 = 1e-17;
/// Half the distances of the orbits whose quotients are a derivative: 2^-43.
const APART: [f64; 2] = [1.0 / 8_796_093_022_208.0; 2];

/// A part of the section: { centre + u first + v second : |u| <= radii[0], |v| <= radii[1] }.
#[derive(Clone, Debug)]
pub(super) struct Patch {
    pub centre: [Rational; 2],
    pub first: [f64; 2],
    pub second: [f64; 2],
    pub radii: [f64; 2],
}

impl Patch {
    pub fn boxed(centre: [Rational; 2], radii: [f64; 2]) -> Self {
        Self { centre, first: [1.0, 0.0], second: [0.0, 1.0], radii }
    }

    pub fn point(x: &Rational, z: &Rational) -> Self {
        Self::boxed([x.clone(), z.clone()], [0.0; 2])
    }

    fn set(&self) -> Check<Set> {
        let [x, z] = self.centre.each_ref().map(|c| Fixed::of(&Range::point(c)));
        if self.first == [1.0, 0.0] && self.second == [0.0, 1.0] {
            return Ok(
                Set::boxed([x, Fixed::zero(), z], [self.radii[0], 0.0, self.radii[1]]).on_plane()
            );
        }
        need(
            x.r == 0.0 && z.r == 0.0,
            "a parallelogram's middle has no more than 192 binary places",
        )?;
        let frame = [
            [self.first[0], 0.0, self.second[0]],
            [0.0, 1.0, 0.0],
            [self.first[1], 0.0, self.second[1]],
        ];
        Ok(Set::new([x, Fixed::zero(), z], frame, [self.radii[0], 0.0, self.radii[1]]).on_plane())
    }
}

/// A closed orbit and what is known of it.
pub(super) struct Closed {
    pub value: [Range; 2],
    pub point: [Range; 2],
    pub derivative: [[Range; 2]; 2],
    /// Quotients of differences at the point, columns first: they tell more digits, without being
    /// bounds.
    pub quotients: [[Range; 2]; 2],
    /// The same along the edges of the candidate, for each column: means of the derivative there.
    pub edges: [[[Range; 2]; 2]; 2],
    pub rows: Rc<Vec<Crossing>>,
}

/// Orbits that were computed, by their starts: a checker that is asked for many certificates
/// computes each once.
#[derive(Default)]
pub(super) struct Known {
    /// No orbits are computed.
    reads_only: bool,
    orbits: RefCell<HashMap<String, Rc<Vec<Crossing>>>>,
    passages: RefCell<HashMap<String, InnerPassage>>,
}

/// (p, q)/q(s0) at s = 0, and the derivative from there to -x0.
pub(super) type InnerPassage = ([Range; 2], [[Range; 2]; 2]);

impl Known {
    /// Nothing, and nothing that takes long will be computed.
    pub fn of_reader() -> Self {
        Self { reads_only: true, ..Self::default() }
    }

    /// Refuses what a reader does not do.
    fn may_compute(&self) -> Check<()> {
        if self.reads_only {
            Err("orbits are enclosed: this checker only reads".into())
        } else {
            Ok(())
        }
    }

    /// The first `count` crossings of y = 0 by all orbits from a patch.
    pub fn crossings(
        &self,
        field: &Caricature,
        patch: &Patch,
        count: usize,
        settings: FlowSettings,
    ) -> Check<Rc<Vec<Crossing>>> {
        let key = format!("{field:?} {patch:?} {settings:?} {count}");
        if let Some(found) = self.orbits.borrow().get(&key) {
            return Ok(found.clone());
        }
        self.may_compute()?;
        let mut flow = Flow::new(field, settings, Y);
        let mut set = patch.set()?;
        let mut rows = Vec::new();
        for n in 1..=count {
            let crossing = flow.next_crossing(&set, LONGEST).ok_or_else(|| {
                let [x, z] = patch.centre.each_ref().map(Rational::approximately);
                format!("crossing {n} from ({x:e}, 0, {z:e}) is enclosed by the checker")
            })?;
            set = crossing.set.clone();
            rows.push(crossing);
        }
        let found = Rc::new(rows);
        self.orbits.borrow_mut().insert(key, found.clone());
        Ok(found)
    }

    /// The state after `count` crossings from a point.
    fn image(&self, field: &Caricature, at: &[Rational; 2], count: usize) -> Check<[Range; 2]> {
        let rows =
            self.crossings(field, &Patch::point(&at[0], &at[1]), count, FlowSettings::NARROW)?;
        let last = rows.last().ok_or("an orbit crosses")?;
        Ok(PLANE.map(|i| last.states[i].clone()))
    }

    /// (P(b) - P(a))/(b - a) for two points that differ in coordinate `j`.
    pub fn quotient(
        &self,
        field: &Caricature,
        [a, b]: [&[Rational; 2]; 2],
        j: usize,
        count: usize,
    ) -> Check<[Range; 2]> {
        let (p, q) = (self.image(field, a, count)?, self.image(field, b, count)?);
        let inverse = (&b[j] - &a[j]).inverse().ok_or("two points differ")?;
        Ok([0, 1].map(|i| (&(&q[i] - &p[i]) * &Range::point(&inverse)).rounded()))
    }

    /// Derivatives of the map by both coordinates as central quotients, columns first.
    pub fn derivative(
        &self,
        field: &Caricature,
        at: &[Rational; 2],
        apart: [f64; 2],
        count: usize,
    ) -> Check<[[Range; 2]; 2]> {
        let column = |j: usize| {
            let by = Rational::exactly(apart[j]).ok_or("the distance is a number")?;
            let (mut a, mut b) = (at.clone(), at.clone());
            (a[j], b[j]) = (&at[j] - &by, &at[j] + &by);
            self.quotient(field, [&a, &b], j, count)
        };
        Ok([column(0)?, column(1)?])
    }

    /// The passage in the inner problem: see [`inner_passage`].
    pub fn passage(
        &self,
        field: &Inner,
        ratio: &Range,
        [s0, x0]: [&Rational; 2],
        largest: &Rational,
    ) -> Check<InnerPassage> {
        let key = format!("{ratio:?} {s0:?} {x0:?} {largest:?}");
        if let Some(found) = self.passages.borrow().get(&key) {
            return Ok(found.clone());
        }
        self.may_compute()?;
        let found = inner_passage(field, ratio, s0, x0, largest)?;
        self.passages.borrow_mut().insert(key, found.clone());
        Ok(found)
    }

    /// The one closed orbit through a box, with `count` crossings a turn, by Krawczyk's inclusion.
    pub fn closed(
        &self,
        field: &Caricature,
        candidate: &[Range; 2],
        centre: &[Rational; 2],
        count: usize,
    ) -> Check<Closed> {
        let radii: [f64; 2] = [0, 1].map(|i| {
            let off = (&candidate[i].high - &centre[i]).max(&centre[i] - &candidate[i].low);
            off.approximately() * (1.0 + 1e-14)
        });
        let value = self.image(field, centre, count)?;
        let derivative =
            |at: &[Rational; 2], radii: [f64; 2], settings: FlowSettings| -> Check<_> {
                let rows =
                    self.crossings(field, &Patch::boxed(at.clone(), radii), count, settings)?;
                let d = rows.last().ok_or("an orbit crosses")?.set.derivative();
                Ok((in_plane(&d)?, rows))
            };
        let (wide, _) = derivative(centre, radii, FlowSettings::WIDE)?;
        let first = krawczyk(centre, &value, &wide, &approximate_inverse(&wide)?, candidate)?;
        for i in 0..2 {
            need(
                first[i].inside(&candidate[i]),
                "an independent Krawczyk operator maps the candidate into itself",
            )?;
        }
        // Newton's method, then the inclusion again in a box as small as the arithmetic allows.
        let y = approximate_inverse(&wide)?;
        let mut at = first.each_ref().map(middle);
        for _ in 0..4 {
            let image = self.image(field, &at, count)?;
            let exact = at.each_ref().map(Range::point);
            at = krawczyk(&at, &image, &wide, &y, &exact)?.each_ref().map(middle);
        }
        let (slope, rows) = derivative(&at, [CLOSE; 2], FlowSettings::NARROW)?;
        let near = at.each_ref().map(|x| {
            Range::point(x).widened(&Rational::exactly(0.99 * CLOSE).unwrap_or(Rational::whole(0)))
        });
        let point = krawczyk(
            &at,
            &self.image(field, &at, count)?,
            &slope,
            &approximate_inverse(&slope)?,
            &near,
        )?;
        for i in 0..2 {
            need(
                point[i].inside(&near[i]) && near[i].inside(&candidate[i]),
                "the closed orbit is enclosed anew",
            )?;
        }
        let quotients = self.derivative(field, &at, APART, count)?;
        let corner = |i: bool, j: bool| {
            let end = |r: &Range, high: bool| if high { r.high.clone() } else { r.low.clone() };
            [end(&candidate[0], i), end(&candidate[1], j)]
        };
        let edge = |j: usize, side: bool| {
            let [a, b] = if j == 0 {
                [corner(false, side), corner(true, side)]
            } else {
                [corner(side, false), corner(side, true)]
            };
            self.quotient(field, [&a, &b], j, count)
        };
        let edges = [[edge(0, false)?, edge(0, true)?], [edge(1, false)?, edge(1, true)?]];
        Ok(Closed { value, point, derivative: slope, quotients, edges, rows })
    }
}

fn middle(r: &Range) -> Rational {
    // Few digits, so that numbers do not grow from step to step.
    let m = &(&r.low + &r.high) * &Rational::dyadic(1.into(), 1);
    Rational::dyadic(m.scaled_down(150), 150)
}

/// The part of a derivative that maps the section to itself.
pub(super) fn in_plane(d: &[[Ball; 3]; 3]) -> Check<[[Range; 2]; 2]> {
    let at = |i: usize, j: usize| d[PLANE[i]][PLANE[j]].range().ok_or("a derivative is bounded");
    Ok([[at(0, 0)?, at(0, 1)?], [at(1, 0)?, at(1, 1)?]])
}

/// c - Y (P(c) - c) + (1 - Y (DP - 1)) (X - c) (Krawczyk 1969).
pub(super) fn krawczyk(
    centre: &[Rational; 2],
    value: &[Range; 2],
    slope: &[[Range; 2]; 2],
    y: &[[Range; 2]; 2],
    candidate: &[Range; 2],
) -> Check<[Range; 2]> {
    let unit = |i: usize, j: usize| Range::point(&Rational::whole(i64::from(i == j)));
    let c = centre.each_ref().map(Range::point);
    let row = |i: usize| {
        let newton = &(&y[i][0] * &(&value[0] - &c[0])) + &(&y[i][1] * &(&value[1] - &c[1]));
        let mut k = &c[i] - &newton;
        for j in 0..2 {
            let df = |k: usize| &slope[k][j] - &unit(k, j);
            let contraction = &unit(i, j) - &(&(&y[i][0] * &df(0)) + &(&y[i][1] * &df(1)));
            k = &k + &(&contraction * &(&candidate[j] - &c[j]));
        }
        k
    };
    Ok([row(0), row(1)])
}

/// Near the inverse of D - 1.
fn approximate_inverse(d: &[[Range; 2]; 2]) -> Check<[[Range; 2]; 2]> {
    let m = |i: usize, j: usize| middle(&d[i][j]).approximately() - f64::from(u8::from(i == j));
    let [a, b, c, e] = [m(0, 0), m(0, 1), m(1, 0), m(1, 1)];
    let determinant = a * e - b * c;
    let point = |x: f64| {
        Rational::exactly(x / determinant).map(|x| Range::point(&x)).ok_or("1 is no multiplier")
    };
    Ok([[point(e)?, point(-b)?], [point(-c)?, point(a)?]])
}

/// The passage in the inner problem: (p, q)/q(s0) at s = 0 for p/q at s0 in `ratio` and |q(s0)| <=
/// largest, and the derivative of (p, q) at s = -x0 by that at s = 0 for all states between the
/// canard and those.
fn inner_passage(
    field: &Inner,
    ratio: &Range,
    s0: &Rational,
    x0: &Rational,
    largest: &Rational,
) -> Check<InnerPassage> {
    /// s.
    const AXIS: usize = 2;
    /// Parts into which the amplitudes are cut: the derivative depends on them in its fifth digit.
    const PARTS: i64 = 16;
    let leg = |from: &Rational, to: &Rational, states: [Range; 2]| -> Check<[[Range; 2]; 2]> {
        let field = Inner { offset: to.clone(), ..field.clone() };
        let start = [&states[0], &states[1], &Range::point(&(from - to))].map(Fixed::of);
        let set = Set::boxed(start, [0.0; 3]);
        let crossing = Flow::new(&field, FlowSettings::NARROW, AXIS).next_crossing(&set, 1e3);
        let d = crossing.ok_or("an independent integration encloses the passage")?.set.derivative();
        let at = |i: usize, j: usize| d[i][j].range().ok_or("a derivative is bounded");
        Ok([[at(0, 0)?, at(0, 1)?], [at(1, 0)?, at(1, 1)?]])
    };
    let (zero, one) = (Rational::whole(0), Range::point(&Rational::whole(1)));
    let unit = Rational::whole(PARTS).inverse().ok_or("there are parts")?;
    // Over { d state : |d| <= largest }.
    let over = |from: &Rational, to: &Rational, state: &[Range; 2]| -> Check<[[Range; 2]; 2]> {
        let part = |k: i64| {
            let whole = Range { low: Rational::whole(k), high: Rational::whole(k + 1) };
            let amplitudes = &whole * &Range::point(&(largest * &unit));
            leg(from, to, [&amplitudes * &state[0], &amplitudes * &state[1]])
        };
        (1 - PARTS..PARTS).try_fold(part(-PARTS)?, |found, k| {
            let d = part(k)?;
            Ok([0, 1].map(|i| [0, 1].map(|j| found[i][j].hull(&d[i][j]))))
        })
    };
    // p = q = 0 is a solution: by the mean value theorem the derivative maps the state, too.
    let m = over(s0, &zero, &[ratio.clone(), one])?;
    let state = [0, 1].map(|i| (&(&m[i][0] * ratio) + &m[i][1]).rounded());
    let derivative = over(&zero, &-x0, &state)?;
    Ok((state, derivative))
}
