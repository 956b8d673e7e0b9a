//! The breakdown of determinism, in digits. Not a figure of the paper; it puts numbers on the
//! paper's claim.
//!
//! Left: how many digits of each passage through y = 0 a method gets right. Right: what the first
//! visit to the singularity makes of a small disturbance, as a function of the stiffness.

use std::sync::Arc;

use crate::reading::{Reading, studied_in_both_readings};
use twofold::analyse::digits::{Contender, DigitsQuestion};
use twofold::analyse::passage::{PassageQuestion, Predicted};
use twofold::analyse::reference::SectionPlane;
use twofold::integrate::StepCap;
use twofold::job::spec::Method;
use twofold::job::table::{Entry, Table};
use twofold::job::{Answer, AnyQuestion, MethodDigits, TwoFoldPassage};
use twofold::num::elementary::{exp10, log10};
use twofold::num::fit::line;
use twofold::paper::wording::number;
use twofold::paper::{Figure, Study};
use twofold::render::sheet::*;
use twofold::render::style;
use twofold::system::{System, Transition};

/// The start of the paper's runs.
const START: [f64; 3] = [0.2, 0.0, -1.0];
/// Crossings of y = 0 are compared.
const SECTION: SectionPlane = SectionPlane { coordinate: 1, value: 0.0 };
/// The stiffness parameter of the left panel.
const EPS: f64 = 1e-3;
/// Crossings are compared up to this time.
const T_END: f64 = 100.0;
/// A passage this close to the singularity is a visit.
const NEAR: f64 = 0.05;
/// Longest step of the compared methods: that of fig. 7 (i).
const MAX_STEP: f64 = 2.0;
/// Most steps of a compared method.
const MAX_STEPS: u64 = 10_000_000;
/// Upper end of the axis of digits: above the seventeen that two equal numbers count for.
const TOP: f64 = 18.0;
/// When disturbances are made, relative to the passage, in units of sqrt(eps).
const OFFSETS: [f64; 3] = [-3.0, 0.0, 3.0];
/// The exit is the first passage through y = 0 beyond so many sqrt(eps).
const BEYOND: f64 = 3.0;
/// Size of disturbances made at t = 0; they are contracted before they grow, so that it need not be
/// tiny.
const AT_START: f64 = 1e-3;
/// The exit of the first visit must come before this time.
const EXIT_BY: f64 = 80.0;
/// Growth of a disturbance made across the layer at the singularity, reconstructed reading,
/// measured by another program with 113 bits or more: (eps, factor).
const OUTSIDE: [(f64, f64); 3] = [(1e-2, 3.36e9), (1e-3, 7.67e12), (1e-4, 5.49e16)];

/// Stiffness parameters of the right panel.
const LADDER: [f64; 7] = [1e-2, 3e-3, 1e-3, 3e-4, 1e-4, 3e-5, 1e-5];

/// The methods of the left panel, with their tolerances and looks.
fn methods() -> [(Method, f64, Colour, MarkerShape); 6] {
    [
        (Method::Taylor, 1e-16, style::INK, MarkerShape::Star),
        (Method::Dopri5, 1e-14, style::GREEN, MarkerShape::Square),
        (Method::Dopri5, 1e-11, style::BLUE, MarkerShape::Square),
        (Method::Dopri5, 1e-8, style::SKY, MarkerShape::Square),
        (Method::Radau5, 1e-8, style::VERMILLION, MarkerShape::Triangle),
        (Method::Lsoda, exp10(-7.97727), style::PURPLE, MarkerShape::Dot),
    ]
}

fn outside(reading: Reading) -> &'static [(f64, f64)] {
    match reading {
        Reading::Printed => &[],
        Reading::Reconstructed => &OUTSIDE,
    }
}

fn digits_question() -> DigitsQuestion {
    DigitsQuestion {
        start: START,
        section: SECTION,
        t_end: T_END,
        near: NEAR,
        methods: methods().map(|(name, tolerance, _, _)| Contender { name, tolerance }).into(),
        step_cap: StepCap::Absolute(MAX_STEP),
        max_steps: MAX_STEPS,
    }
}

fn growth_question() -> PassageQuestion {
    PassageQuestion {
        start: START,
        beyond: BEYOND,
        offsets: OFFSETS.into(),
        carried: AT_START,
        far: 0.0,
        by: EXIT_BY,
    }
}

/// Questions of the figure: the digits first, then the growth for each eps.
fn questions(reading: Reading) -> Vec<AnyQuestion> {
    let system = System::from(reading.caricature());
    let digits = MethodDigits { system: system.clone(), eps: EPS, compared: digits_question() };
    let growth = LADDER.map(|eps| -> AnyQuestion {
        let (system, transition) = (system.clone(), Transition::Tanh);
        Arc::new(TwoFoldPassage { system, transition, eps, followed: growth_question() })
    });
    std::iter::once(Arc::new(digits) as AnyQuestion).chain(growth).collect()
}

fn value(entry: &Entry) -> f64 {
    entry.value()
}

/// Place and direction of a disturbance: one series of the right panel.
struct Series {
    words: &'static str,
    colour: Colour,
    shape: MarkerShape,
    /// (eps, growth), several growths for one eps.
    points: Vec<[f64; 2]>,
}

/// The series of the right panel.
fn series(growth: &[Vec<Entry>]) -> [Series; 3] {
    // A row: eps, moment (minus infinity is the start), growth by component.
    let pick = |at_start: bool, components: &[usize]| {
        let rows = growth.iter().filter(|r| value(&r[1]).is_infinite() == at_start);
        rows.map(|r| {
            [value(&r[0]), components.iter().map(|c| value(&r[2 + c])).fold(0.0, f64::max)]
        })
        .collect()
    };
    [
        Series {
            words: "at the visit, across the layer (*x*)",
            colour: style::VERMILLION,
            shape: MarkerShape::Dot,
            points: pick(false, &[0]),
        },
        Series {
            words: "at the visit, along it (*y*, *z*)",
            colour: style::BLUE,
            shape: MarkerShape::Square,
            points: pick(false, &[1, 2]),
        },
        Series {
            words: "at the start, *t* = 0",
            colour: style::GREEN,
            shape: MarkerShape::Triangle,
            points: pick(true, &[0, 1, 2]),
        },
    ]
}

impl Series {
    /// The largest growth for each eps.
    fn largest(&self) -> Vec<[f64; 2]> {
        let mut largest: Vec<[f64; 2]> = Vec::new();
        for &[eps, factor] in &self.points {
            match largest.last_mut() {
                Some(last) if last[0] == eps => last[1] = last[1].max(factor),
                _ => largest.push([eps, factor]),
            }
        }
        largest
    }

    /// Digits of growth per decade of eps: the slope of log10 of the largest growth over -log10
    /// eps, by least squares.
    fn digits_per_decade(&self) -> f64 {
        let points: Vec<(f64, f64)> =
            self.largest().iter().map(|p| (-log10(p[0]), log10(p[1]))).collect();
        line(&points).map_or(f64::NAN, |l| l.slope)
    }
}

fn draw(reading: Reading, answers: &[Arc<Answer>]) -> Sheet {
    let tables = Study::tables(answers);
    let [rows, visits, passages @ ..] = &tables[..] else {
        unreachable!("the first question has two tables")
    };
    let growth: Vec<Vec<Entry>> =
        passages.iter().filter(|t| t.name == "growth").flat_map(Table::rows).collect();
    let mut digits = PlanePanel::new(
        Axis::linear("*t*", 0.0, T_END),
        Axis::linear("digits that are right", -2.0, TOP),
    );
    for visit in visits.rows() {
        let t = value(&visit[0]);
        digits = digits.line(
            vec![[t, -2.0], [t, TOP]],
            LineStyle::new(style::MAGENTA, style::CURVE_PT).dashed(),
        );
    }
    let mut lines = Vec::new();
    for (method, tolerance, colour, shape) in methods().into_iter().rev() {
        let mine =
            |r: &&Vec<Entry>| r[0] == Entry::from(method.name()) && r[1] == Entry::from(tolerance);
        let points: Vec<[f64; 2]> =
            rows.rows().iter().filter(mine).map(|r| [value(&r[3]), value(&r[5])]).collect();
        let (line, marker) =
            (LineStyle::new(colour, style::FRAME_PT), MarkerStyle { shape, colour, size: 3.2 });
        digits = digits.line(points.clone(), line).markers(points, marker);
        lines.push((
            LegendKey::LineMarker(line, marker),
            format!("{} {}", method.name(), number(tolerance)),
        ));
    }
    for (key, words) in lines.into_iter().rev() {
        digits = digits.legend(key, words);
    }
    let digits = digits
        .legend(LegendKey::Line(LineStyle::new(style::MAGENTA, style::CURVE_PT).dashed()), "visit")
        .legend_at(Corner::UpperRight);

    let series = series(&growth);
    let outside: Vec<[f64; 2]> =
        outside(reading).iter().map(|&(eps, growth)| [eps, growth]).collect();
    let mut amplified = PlanePanel::new(
        Axis::log("*ε*", 6e-6, 1.6e-2),
        Axis::log("growth of a disturbance", 2e-5, 5e25),
    );
    for (level, words, at, anchor) in [
        (1.0, "neither grows nor shrinks", 6.6e-6, Anchor::Left),
        (1e8, "10^{−8} becomes 1", 6.6e-6, Anchor::Left),
        (1e16, "10^{−16} becomes 1", 1.45e-2, Anchor::Right),
    ] {
        amplified = amplified
            .line(
                vec![[6e-6, level], [1.6e-2, level]],
                LineStyle::new(style::SOFT_INK, style::FRAME_PT).dotted(),
            )
            .note([at, level * 5.0], words, anchor);
    }
    let mut legend = Vec::new();
    for s in &series {
        let style = MarkerStyle { shape: s.shape, colour: s.colour, size: 4.0 };
        amplified = amplified
            .line(s.largest(), LineStyle::new(s.colour, style::CURVE_PT))
            .markers(s.points.clone(), style);
        legend.push(LegendEntry::new(LegendKey::Marker(style), s.words));
    }
    let is_compared = !outside.is_empty();
    if is_compared {
        let hollow = MarkerStyle { shape: MarkerShape::OpenDot, colour: style::INK, size: 5.0 };
        amplified = amplified.markers(outside, hollow);
        legend.push(LegendEntry::new(LegendKey::Marker(hollow), "by another program"));
    }
    let sheet = legend
        .into_iter()
        .fold(Sheet::new(ColumnWidth::Wide, 1, ""), Sheet::legend)
        .panel_aspect(0.5)
        .panel("(a)", format!("passages through *y* = 0, *ε* = {}", number(EPS)), digits)
        .panel("(b)", "what the first visit makes of a disturbance", amplified);
    footer(&series, is_compared).into_iter().fold(sheet, Sheet::footer)
}

/// Statements about the tables, in words.
fn footer(series: &[Series; 3], is_compared: bool) -> Vec<String> {
    let slopes =
        series.each_ref().map(|s| format!("{:.2}", s.digits_per_decade()).replace('-', "−"));
    let law = Predicted::of(-1.2, -1.4);
    let program = if is_compared { " The other program has 113 bits or more." } else { "" };
    vec![
        format!(
            "(a) −log_{{10}} of the largest difference in a coordinate between a method’s *n*th \
             passage and that of an orbit in double-double arithmetic (32 digits); below 0, \
             differences larger than 1. Visit: within {} of the singularity. Steps up to {}.",
            number(NEAR),
            number(MAX_STEP)
        ),
        format!(
            "(b) Distance at the first passage through *y* = 0 beyond {}√*ε* over the size of the \
             disturbance, made {}√*ε* before, at and as much after the visit; lines join the \
             largest. Digits a decade of *ε*: {}; in the limit {:.2}, {:.2}, −0.5 (figure \
             law).{program}",
            number(BEYOND),
            number(OFFSETS[2]),
            slopes.join(", "),
            -law.across(),
            -law.along(),
        ),
    ]
}

/// The figure's specification.
pub fn figure() -> Figure {
    studied_in_both_readings(
        "digits",
        "The breakdown of determinism, in digits",
        "(a) Digits of each passage through y = 0 that a method gets right, against time; dashed \
            lines mark visits to the \
                  singularity. (b) Growth of a small disturbance until the exit from the first \
                  visit, against ε, for disturbances made \
                  near the singularity across and along the switching layer and for disturbances \
                  made at the start.",
        [
            Study {
                questions: || questions(Reading::Printed),
                draw: |answers| draw(Reading::Printed, answers),
            },
            Study {
                questions: || questions(Reading::Reconstructed),
                draw: |answers| draw(Reading::Reconstructed, answers),
            },
        ],
    )
}
