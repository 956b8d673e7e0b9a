//! The law of the breakdown. Not a figure of the paper: how regularised motion passes the two-fold
//! as the switch steepens, beside what the normal form's constants v+ and v- predict. All
//! predictions are formulas of v+ and v- ([`Predicted`]); none is fitted.

use std::sync::Arc;

use crate::Reading;
use twofold::analyse::passage::{PassageQuestion, Predicted};
use twofold::integrate::{Kick, KickLaw, Schedule};
use twofold::job::spec::SwitchSpec;
use twofold::job::{Answer, AnyQuestion, Leaving, Table, TwoFoldPassage};
use twofold::num::elementary::{exp, exp10, ln, sqrt};
use twofold::num::fit::{line, median};
use twofold::paper::wording::number;
use twofold::paper::{Figure, Picture, Study, View};
use twofold::render::sheet::*;
use twofold::render::style;
use twofold::system::caricature::MinusSign;
use twofold::system::{Caricature, Relaxation, System, Transition};

/// The start of the paper's runs.
const START: [f64; 3] = [0.2, 0.0, -1.0];
/// Growth is measured until the first passage through y = 0 farther out than so many sqrt(eps).
const BEYOND: f64 = 3.0;
/// When disturbances are made, relative to the visit, in units of sqrt(eps).
const OFFSETS: [f64; 1] = [0.0];
/// Size of disturbances made at t = 0: they shrink by sqrt(eps), and must stay above what f64
/// leaves on the way in.
const CARRIED: f64 = 1e-3;
/// The far exit is the first upward passage through x = 0 this far out.
const FAR: f64 = 0.6;
/// Half decades of eps, for growth. Below 1e-7 double-double numbers are too short: rounding at
/// 1e-32 would decide the fourth digit of a response at 1e-8 and all of it at 1e-9.
const GROWTH: [f64; 11] = [1e-2, 3e-3, 1e-3, 3e-4, 1e-4, 3e-5, 1e-5, 3e-6, 1e-6, 3e-7, 1e-7];
/// The printed reading's.
const PRINTED: [f64; 9] = [1e-2, 8e-3, 5e-3, 3e-3, 2e-3, 1e-3, 3e-4, 1e-4, 1e-5];
/// Other transition functions'.
const OTHERS: [f64; 7] = [1e-2, 3e-3, 1e-3, 3e-4, 1e-4, 3e-5, 1e-5];
/// Points per decade of eps, for the far exit.
const PER_DECADE: usize = 10;
/// Decades of eps from 1e-2 down: more than three periods.
const DECADES: f64 = 4.6;
/// Steps of the ladder that hold a jump are divided into so many.
const FINER: usize = 8;
/// Indices of these steps, found by inspection.
const JUMPS: [usize; 3] = [6, 22, 36];
/// Decades for other transition functions.
const DECADES_OTHERS: f64 = 3.0;
/// Other two-folds: 1/mu, whole where the linear theory is resonant. v+ and v- differ by 0.2, so
/// that the canard does not lie in the middle of the layer.
const RATIOS: [f64; 10] = [2.5, 3.0, 3.5, 4.0, 4.5, 5.0, 6.5, 7.0, 7.5, 8.5];
/// The exponents of these are measured between these two.
const BETWEEN: [f64; 2] = [1e-5, 1e-6];
/// They start here, in attracting sliding.
const INSIDE: [f64; 3] = [0.0, 0.3, 0.2];
/// Selection by other means.
const SELECTION: [f64; 5] = [1e-2, 3e-3, 1e-3, 3e-4, 1e-4];
/// Orbits of each.
const ORBITS: usize = 16;
/// Hysteretic orbits start shifted in x by multiples of this: their swings are in another phase.
const SHIFT: f64 = 3e-3;
/// eps'/eps.
const RELAXATION: f64 = 10.0;
/// The paper's time between kicks.
const KICKS: f64 = 0.3;

/// Slope phi'(u) of each transition function where phi is `phi`, in u = h/eps.
fn slope(transition: Transition, phi: f64) -> f64 {
    // The inverse functions, by hand.
    let s = 2.0 * phi - 1.0;
    match transition {
        Transition::Tanh | Transition::PerturbedTanh { .. } => 0.5 * (1.0 - s * s),
        Transition::Arctan => {
            let angle = std::f64::consts::FRAC_PI_2 * s;
            let cos = twofold::num::elementary::cos(angle);
            cos * cos / std::f64::consts::PI
        }
        Transition::Algebraic => 0.5 * (1.0 - s * s) * sqrt(1.0 - s * s),
        Transition::Erf => {
            // erf(u) = s, by Newton's method from 0; s is small.
            let slope = |u: f64| 2.0 / sqrt(std::f64::consts::PI) * exp(-u * u);
            let mut u = 0.0;
            for _ in 0..20 {
                u -= (twofold::num::elementary::erf(u) - s) / slope(u);
            }
            0.5 * slope(u)
        }
    }
}

/// Transition functions, their words and looks, the last lowest: tanh's dots lie on the algebraic
/// one's triangles.
const TRANSITIONS: [(Transition, &str, Colour, MarkerShape, f64); 4] = [
    (Transition::Tanh, "tanh", style::INK, MarkerShape::Dot, 2.0),
    (Transition::Arctan, "arctan", style::BLUE, MarkerShape::Square, 4.0),
    (Transition::Algebraic, "algebraic", style::VERMILLION, MarkerShape::Triangle, 5.0),
    (Transition::Erf, "erf", style::GREEN, MarkerShape::Star, 4.0),
];

/// eps for the far exit.
fn ladder(decades: f64) -> Vec<f64> {
    let count = (decades * PER_DECADE as f64).round() as usize;
    let part = |k: usize| if JUMPS.contains(&k) && k < count { FINER } else { 1 };
    let places =
        (0..=count).flat_map(|k| (0..part(k)).map(move |i| k as f64 + i as f64 / part(k) as f64));
    places.map(|k| exp10(-2.0 - k / PER_DECADE as f64)).collect()
}

fn passage(
    system: impl Into<System>,
    transition: Transition,
    eps: f64,
    followed: PassageQuestion,
) -> AnyQuestion {
    Arc::new(TwoFoldPassage { system: system.into(), transition, eps, followed })
}

/// Growth near the visit, and of what is carried in if asked for.
fn growing(start: [f64; 3], carried: f64, by: f64) -> PassageQuestion {
    PassageQuestion { start, beyond: BEYOND, offsets: OFFSETS.into(), carried, far: 0.0, by }
}

/// The far exit.
fn far() -> PassageQuestion {
    PassageQuestion::far(START, FAR, 80.0)
}

/// v+ and v- with the given 1/mu and v+ - v- = 0.2.
fn constants(ratio: f64) -> (f64, f64) {
    // The eigenvalues are c -+ sqrt(0.01 + 1).
    let c = -sqrt(1.01) * (ratio + 1.0) / (ratio - 1.0);
    (c + 0.1, c - 0.1)
}

fn law_questions() -> Vec<AnyQuestion> {
    let (paper, printed) = (Reading::Reconstructed.caricature(), Reading::Printed.caricature());
    let mut all: Vec<AnyQuestion> = Vec::new();
    all.extend(
        GROWTH.map(|eps| passage(paper, Transition::Tanh, eps, growing(START, CARRIED, 80.0))),
    );
    all.extend(ladder(DECADES).into_iter().map(|eps| passage(paper, Transition::Tanh, eps, far())));
    all.extend(
        PRINTED.map(|eps| passage(printed, Transition::Tanh, eps, growing(START, 0.0, 200.0))),
    );
    for ratio in RATIOS {
        let (v_plus, v_minus) = constants(ratio);
        let first_component_of_minus = MinusSign::Equation4;
        let system =
            Caricature { alpha: 0.0, beta: 0.0, v_plus, v_minus, first_component_of_minus };
        all.extend(
            BETWEEN.map(|eps| passage(system, Transition::Tanh, eps, growing(INSIDE, 0.0, 30.0))),
        );
    }
    all
}

/// One passage, as the figure uses it.
#[derive(Clone, Copy)]
struct Row {
    eps: f64,
    /// z^2/eps at the first passage through x = 0.
    z2: f64,
    /// Whether the surface was left to x < 0.
    minus: bool,
    /// Growth across, along, and of what is carried in.
    growth: [f64; 3],
    /// y and z of the far exit.
    far: [f64; 2],
}

fn row(answer: &Answer) -> Row {
    let (one, growth) = (&answer.tables[0], &answer.tables[1]);
    let first =
        |table: &Table, name: &str| table.numbers(name).first().copied().unwrap_or(f64::NAN);
    let eps = first(one, "eps");
    let z = first(one, "surface_z");
    // Disturbances made at a moment, or carried in: the largest over moments, and over the
    // components in question.
    let largest = |columns: &[&str], carried: bool| {
        let chosen =
            growth.numbers("offset").iter().enumerate().filter(|(_, o)| o.is_infinite() == carried);
        let factors = chosen.flat_map(|(i, _)| columns.iter().map(move |c| growth.numbers(c)[i]));
        let most = factors.fold(f64::NAN, f64::max);
        if most.is_finite() { most } else { f64::NAN }
    };
    Row {
        eps,
        z2: z * z / eps,
        minus: first(one, "left_x") < 0.0,
        growth: [
            largest(&["across"], false),
            largest(&["along_y", "along_z"], false),
            largest(&["across", "along_y", "along_z"], true),
        ],
        far: [first(one, "far_y"), first(one, "far_z")],
    }
}

/// -d ln(growth)/d ln(eps) between neighbours, at the geometric mean of their eps, with z^2/eps
/// there.
fn local_slopes(rows: &[Row], which: usize) -> Vec<(f64, f64, f64)> {
    let pairs = rows.windows(2).map(|w| {
        let slope = ln(w[1].growth[which] / w[0].growth[which]) / ln(w[0].eps / w[1].eps);
        (sqrt(w[0].eps * w[1].eps), slope, 0.5 * (w[0].z2 + w[1].z2))
    });
    pairs.filter(|(_, slope, _)| slope.is_finite()).collect()
}

/// z^2/eps by the formula of its slope, from one point on, towards smaller eps: the midpoint rule
/// in ln(1/eps).
fn grown(law: &Predicted, slope: f64, (from, z2): (f64, f64), to: f64) -> f64 {
    const STEPS: usize = 200;
    let h = ln(from / to) / STEPS as f64;
    (0..STEPS).fold(z2, |z2, _| {
        let middle = z2 + 0.5 * h * law.selection(slope, z2);
        z2 + h * law.selection(slope, middle)
    })
}

/// The factor in eps that brings the far exit back: R = l^2 (z^2/eps at eps/R)/(z^2/eps at eps), by
/// iteration.
fn period(law: &Predicted, slope: f64, at: (f64, f64)) -> f64 {
    let squared = law.turn * law.turn;
    (0..50).fold(squared, |r, _| squared * grown(law, slope, at, at.0 / r) / at.1)
}

/// Jumps of the far exit: the two eps between which |y| grows by more than a quarter at once, as
/// eps falls.
fn jumps(rows: &[Row]) -> Vec<(f64, f64)> {
    let jump = |w: &&[Row]| w[1].far[0].abs() > 1.25 * w[0].far[0].abs();
    rows.windows(2).filter(jump).map(|w| (w[0].eps, w[1].eps)).collect()
}

fn marker(shape: MarkerShape, colour: Colour, size: f64) -> MarkerStyle {
    MarkerStyle { shape, colour, size }
}

fn draw_law(answers: &[Arc<Answer>]) -> Sheet {
    let rows: Vec<Row> = answers.iter().map(|a| row(a)).collect();
    let (growth, rest) = rows.split_at(GROWTH.len());
    let (ladder, rest) = rest.split_at(ladder(DECADES).len());
    let (printed, others) = rest.split_at(PRINTED.len());
    let law = Predicted::of(-1.2, -1.4);
    let tanh = slope(Transition::Tanh, law.phi);
    let (selected, measured, predicted) = selection_panel(ladder, &law, tanh);
    let (nearness, times, change) = nearness_panel(growth, printed, &law);
    let formula = LineStyle::new(style::SOFT_INK, style::CURVE_PT);
    SERIES
        .into_iter()
        .map(|(words, colour, shape)| {
            LegendEntry::new(LegendKey::Marker(marker(shape, colour, 4.0)), words)
        })
        .chain([
            LegendEntry::new(LegendKey::Line(formula.dashed()), "formulas of *v*_{+}, *v*_{−}"),
            LegendEntry::new(LegendKey::Line(formula), "the same with their logarithms"),
        ])
        .fold(Sheet::new(ColumnWidth::Wide, 2, ""), Sheet::legend)
        .panel_aspect(0.75)
        .panel("(a)", "growth of a disturbance", growth_panel(growth, &law))
        .panel("(b)", "its local exponents", slopes_panel(growth, &law, tanh))
        .panel("(c)", "where the surface is left", selected)
        .panel("(d)", "the far exit", far_panel(ladder, &law, tanh))
        .panel("(e)", "other two-folds", exponents_panel(others))
        .panel("(f)", "nearness to the canard", nearness)
        .footer(format!(
            "(a, b) Disturbances made at the visit, or carried in from *t* = 0; growth until the \
             first passage through *y* = 0 beyond {}√*ε*. Predicted powers: −{:.3}, −{:.3}, +0.5.",
            number(BEYOND),
            -law.across(),
            -law.along(),
        ))
        .footer(format!(
            "(c) First passage through *x* = 0. Slope against ln(1/*ε*): measured {measured:.3}, \
             predicted {predicted:.3} here and {:.3} in the limit.",
            law.selection(tanh, f64::INFINITY),
        ))
        .footer(format!(
            "(d) First upward passage through *x* = 0 beyond {}: periodic in ln *ε* up to a slow \
             logarithm. Lines: jumps, predicted from the first one on.",
            number(FAR),
        ))
        .footer(format!(
            "(e) Between *ε* = {} and {}. Dotted: resonances, 1/*μ* a whole number, at which the \
             exponent along rises to about 1/*μ* − 1.",
            number(BETWEEN[0]),
            number(BETWEEN[1]),
        ))
        .footer(format!(
            "(f) *C*: distance from the canard at which an orbit comes in; growth is inverse to \
             it. The printed reading comes in {times:.0} times nearer and crosses it {change}.",
        ))
}

/// Directions of disturbances, with their looks.
const SERIES: [(&str, Colour, MarkerShape); 3] = [
    ("across the layer", style::VERMILLION, MarkerShape::Dot),
    ("along it", style::BLUE, MarkerShape::Square),
    ("carried in", style::GREEN, MarkerShape::Triangle),
];

fn growth_panel(rows: &[Row], law: &Predicted) -> PlanePanel {
    let formula = LineStyle::new(style::SOFT_INK, style::CURVE_PT).dashed();
    let powers = [law.across(), law.along(), law.carried()];
    let mut panel = PlanePanel::new(Axis::log("*ε*", 5e-8, 2e-2), Axis::log("growth", 2e-5, 5e31));
    for (which, ((_, colour, shape), power)) in SERIES.into_iter().zip(powers).enumerate() {
        let points: Vec<[f64; 2]> =
            rows.iter().map(|r| [r.eps, r.growth[which]]).filter(|p| p[1] > 0.0).collect();
        if let Some(&[eps, at]) = points.last() {
            // The power alone, through the last point.
            let ends = [2e-2, 5e-8].map(|e| [e, exp(ln(at) + power * ln(e / eps))]);
            panel = panel.line(ends.into(), formula);
        }
        let look = marker(shape, colour, 4.0);
        panel = panel.markers(points, look);
    }
    panel
}

fn slopes_panel(rows: &[Row], law: &Predicted, tanh: f64) -> PlanePanel {
    let formula = LineStyle::new(style::SOFT_INK, style::CURVE_PT);
    let mut panel = PlanePanel::new(
        Axis::log("*ε*", 5e-8, 2e-2),
        Axis::linear("−d ln growth/d ln *ε*", 2.8, 4.3),
    );
    for (which, ((_, colour, shape), power)) in
        SERIES.into_iter().zip([law.across(), law.along()]).enumerate()
    {
        let found = local_slopes(rows, which);
        let with_logarithm: Vec<[f64; 2]> =
            found.iter().map(|&(eps, _, z2)| [eps, -power - law.correction(tanh, z2)]).collect();
        let look = marker(shape, colour, 4.0);
        panel = panel
            .line(vec![[5e-8, -power], [2e-2, -power]], formula.dashed())
            .line(with_logarithm, formula)
            .markers(found.iter().map(|f| [f.0, f.1]).collect(), look);
    }
    panel
}

/// The eps from which predictions of z^2/eps start.
const ANCHOR: f64 = 1e-3;

fn anchor(ladder: &[Row]) -> (f64, f64) {
    let nearest =
        |a: &&Row, b: &&Row| ln(a.eps / ANCHOR).abs().total_cmp(&ln(b.eps / ANCHOR).abs());
    ladder.iter().min_by(nearest).map_or((ANCHOR, f64::NAN), |r| (r.eps, r.z2))
}

/// Where the surface is left, and the measured and the predicted slope of it.
fn selection_panel(ladder: &[Row], law: &Predicted, tanh: f64) -> (PlanePanel, f64, f64) {
    let at = anchor(ladder);
    let points: Vec<[f64; 2]> = ladder.iter().map(|r| [r.eps, r.z2]).collect();
    let formula = LineStyle::new(style::SOFT_INK, style::CURVE_PT);
    let line_to = |eps: f64| [eps, grown(law, tanh, at, eps)];
    let predicted: Vec<[f64; 2]> = ladder.iter().map(|r| line_to(r.eps)).collect();
    let asymptote = law.selection(tanh, f64::INFINITY);
    let straight: Vec<[f64; 2]> =
        [1e-2, 2e-7].map(|eps: f64| [eps, at.1 + asymptote * ln(at.0 / eps)]).into();
    let dots = marker(MarkerShape::Dot, style::INK, 3.0);
    let y = Axis::covering("*z*^{2}/*ε* at the first exit", points.iter().map(|p| p[1]));
    let mut panel =
        PlanePanel::new(Axis::log("*ε*", 1.5e-7, 1.5e-2), y).line(straight, formula.dashed());
    panel = panel.markers(points.clone(), dots).line(predicted, formula);
    let pairs: Vec<(f64, f64)> = points.iter().map(|p| (-ln(p[0]), p[1])).collect();
    let measured = line(&pairs).map_or(f64::NAN, |l| l.slope);
    (panel, measured, law.selection(tanh, at.1))
}

fn far_panel(ladder: &[Row], law: &Predicted, tanh: f64) -> PlanePanel {
    let formula = LineStyle::new(style::SOFT_INK, style::CURVE_PT);
    let found = jumps(ladder);
    let mut panel = PlanePanel::new(
        Axis::log("*ε*", 1.5e-7, 1.5e-2),
        Axis::linear("*y*, *z* of the far exit", -2.2, 1.6),
    );
    // Branch by branch.
    for (which, words, at) in [(0, "*y*", -1.5), (1, "*z*", 1.15)] {
        let branch_line = LineStyle::new(style::INK, style::CURVE_PT);
        let mut branch: Vec<[f64; 2]> = Vec::new();
        for (i, r) in ladder.iter().enumerate() {
            if i > 0 && found.iter().any(|j| j.1 == r.eps) {
                panel = panel.line(std::mem::take(&mut branch), branch_line);
            }
            branch.push([r.eps, r.far[which]]);
        }
        let look = marker(MarkerShape::Dot, style::INK, 2.6);
        panel = panel
            .line(branch, branch_line)
            .markers(ladder.iter().map(|r| [r.eps, r.far[which]]).collect(), look)
            .note([4e-7, at], words, Anchor::Centre);
    }
    // From the first jump, one predicted period after the other.
    if let Some(&(above, below)) = found.first() {
        let mut eps = sqrt(above * below);
        let mut z2 = ladder.iter().find(|r| r.eps == below).map_or(f64::NAN, |r| r.z2);
        while eps > 2e-7 {
            panel = panel.line(vec![[eps, -2.2], [eps, 1.6]], formula);
            let r = period(law, tanh, (eps, z2));
            z2 = grown(law, tanh, (eps, z2), eps / r);
            eps /= r;
        }
    }
    panel
}

/// Signed distance of the incoming orbit from the canard, up to a constant: d = eps^(1/(2 mu))-less
/// part of the deviation, from the growth that it causes.
fn nearness(row: &Row, law: &Predicted) -> f64 {
    let size = exp(law.across() * ln(row.eps)) / (row.growth[0] * sqrt(row.z2));
    if row.minus { size } else { -size }
}

/// The distances from the canard, how many times nearer the printed reading comes, and where it
/// changes sides.
fn nearness_panel(growth: &[Row], printed: &[Row], law: &Predicted) -> (PlanePanel, f64, String) {
    let relative = |rows: &[Row]| -> (f64, Vec<[f64; 2]>) {
        let limit = rows.last().map_or(f64::NAN, |r| nearness(r, law));
        (limit, rows.iter().map(|r| [r.eps * 1e3, nearness(r, law) / limit]).collect())
    };
    // Up to the printed reading's smallest, so that both are divided by the same kind of limit.
    let smallest = PRINTED[PRINTED.len() - 1];
    // At 1e-2 the reconstructed reading leaves so far out that the inner problem is not the whole
    // story.
    let mine: Vec<Row> =
        growth.iter().filter(|r| r.eps >= smallest && r.eps < 1e-2).copied().collect();
    let (a, reconstructed) = relative(&mine);
    let (b, others) = relative(printed);
    let mut panel = PlanePanel::new(
        Axis::linear("10^{3} *ε*", -0.4, 10.6),
        Axis::linear("*C*(*ε*)/*C*(0)", -0.15, 1.2),
    )
    .line(
        vec![[-0.4, 0.0], [10.6, 0.0]],
        LineStyle::new(style::SOFT_INK, style::FRAME_PT).dotted(),
    );
    let zero = others.windows(2).find(|w| w[0][1] * w[1][1] < 0.0);
    let change = zero.map_or_else(String::new, |w| {
        format!("between *ε* = {:.3} and {:.3}", w[1][0] * 1e-3, w[0][0] * 1e-3)
    });
    for (points, words, at, shape) in [
        (reconstructed, "reconstructed", [3.4, 0.98], MarkerShape::OpenDot),
        (others, "printed", [5.3, 0.48], MarkerShape::Dot),
    ] {
        panel = panel
            .line(points.clone(), LineStyle::new(style::INK, style::CURVE_PT))
            .markers(points, marker(shape, style::INK, 4.0))
            .note(at, words, Anchor::Left);
    }
    (panel, a / b, change)
}

fn exponents_panel(rows: &[Row]) -> PlanePanel {
    let mut panel =
        PlanePanel::new(Axis::linear("1/*μ*", 2.0, 9.6), Axis::linear("exponent", 0.0, 6.4));
    for ratio in RATIOS.into_iter().filter(|r| r.fract() == 0.0) {
        panel = panel.line(
            vec![[ratio, 0.0], [ratio, 6.4]],
            LineStyle::new(style::SOFT_INK, style::FRAME_PT).dotted(),
        );
    }
    let formula = LineStyle::new(style::SOFT_INK, style::CURVE_PT).dashed();
    panel = panel
        .line(vec![[2.0, 1.0], [9.6, 4.8]], formula)
        .line(vec![[2.0, 0.5], [9.6, 4.3]], formula)
        .line(
            vec![[2.0, 1.0], [7.4, 6.4]],
            LineStyle::new(style::SOFT_INK, style::FRAME_PT).dotted(),
        );
    for (which, (_, colour, shape)) in SERIES.into_iter().take(2).enumerate() {
        let exponent = |pair: &[Row]| local_slopes(pair, which).first().map(|s| s.1);
        let points = RATIOS
            .into_iter()
            .zip(rows.chunks(2))
            .filter_map(|(ratio, pair)| Some([ratio, exponent(pair)?]))
            .collect();
        panel = panel.markers(points, marker(shape, colour, 4.0));
    }
    panel
}

/// Questions of the second picture: passages by transition, then leaving by rule.
fn selection_questions() -> Vec<AnyQuestion> {
    let paper = Reading::Reconstructed.caricature();
    let mut all: Vec<AnyQuestion> = Vec::new();
    for (transition, ..) in TRANSITIONS {
        all.extend(OTHERS.map(|eps| passage(paper, transition, eps, growing(START, 0.0, 80.0))));
        all.extend(
            ladder(DECADES_OTHERS).into_iter().map(|eps| passage(paper, transition, eps, far())),
        );
    }
    for rule in RULES {
        all.extend(SELECTION.map(|eps| -> AnyQuestion {
            Arc::new(Leaving {
                system: paper.into(),
                switch: rule.switch(eps),
                runs: (0..ORBITS).map(|k| rule.run(eps, k)).collect(),
                tolerance: 1e-10,
                longest_step: 4.0,
                by: 40.0,
            })
        }));
    }
    all
}

/// Another rule that can decide how an orbit leaves.
#[derive(Clone, Copy, PartialEq)]
enum Rule {
    Literal,
    Single,
    Noise,
}

const RULES: [Rule; 3] = [Rule::Literal, Rule::Single, Rule::Noise];

impl Rule {
    fn look(self) -> (&'static str, Colour, MarkerShape) {
        match self {
            Rule::Literal => ("hysteresis, literal", style::PURPLE, MarkerShape::Dot),
            Rule::Single => ("hysteresis, single", style::PURPLE, MarkerShape::Cross),
            Rule::Noise => ("noise", style::ORANGE, MarkerShape::Dot),
        }
    }

    fn switch(self, eps: f64) -> SwitchSpec {
        let hysteretic = |relaxation| SwitchSpec::Hysteretic {
            eps,
            eps_prime: RELAXATION * eps,
            relaxation,
            phi0: 1.0,
        };
        match self {
            Rule::Literal => hysteretic(Relaxation::Literal),
            Rule::Single => hysteretic(Relaxation::Single),
            Rule::Noise => SwitchSpec::tanh(eps),
        }
    }

    fn run(self, eps: f64, k: usize) -> ([f64; 3], Schedule) {
        match self {
            Rule::Noise => {
                let kick = Kick {
                    every: KICKS,
                    size: eps,
                    law: KickLaw::Sphere,
                    seed: 2013,
                    stream: k as u64,
                };
                (START, Schedule { restart_every: None, kick: Some(kick) })
            }
            _ => ([START[0] + SHIFT * k as f64, START[1], START[2]], Schedule::default()),
        }
    }
}

/// The known ones of points in falling order of eps, without those that would cover others: about
/// ten a decade, and both sides of each jump.
fn apart(mut points: Vec<[f64; 2]>) -> Vec<[f64; 2]> {
    const LEAST_RATIO: f64 = 1.11;
    const JUMP: f64 = 0.5;
    points.retain(|p| p[1].is_finite());
    let mut kept: Vec<[f64; 2]> = Vec::new();
    for (i, p) in points.iter().enumerate() {
        let beside = [i.checked_sub(1), Some(i + 1)].into_iter().flatten();
        let jumps = beside.filter_map(|k| points.get(k)).any(|q| (q[1] - p[1]).abs() > JUMP);
        if jumps || kept.last().is_none_or(|last| last[0] >= LEAST_RATIO * p[0]) {
            kept.push(*p);
        }
    }
    kept
}

fn draw_selection(answers: &[Arc<Answer>]) -> Sheet {
    let law = Predicted::of(-1.2, -1.4);
    let each = OTHERS.len() + ladder(DECADES_OTHERS).len();
    let (passages, leavings) = answers.split_at(each * TRANSITIONS.len());
    let rows: Vec<Vec<Row>> =
        passages.chunks(each).map(|c| c.iter().map(|a| row(a)).collect()).collect();
    let reference = slope(Transition::Tanh, law.phi);
    let stretch: Vec<f64> = TRANSITIONS.iter().map(|t| slope(t.0, law.phi) / reference).collect();

    let compensated = |title: &str, removed: bool| {
        let mut panel = PlanePanel::new(
            Axis::log(if removed { "*ε*/*κ*" } else { "*ε*" }, 3e-6, 4e-2),
            Axis::log(title, if removed { 5.0 } else { 1.0 }, if removed { 100.0 } else { 300.0 }),
        );
        let functions = rows.iter().zip(&stretch).zip(TRANSITIONS).rev();
        for ((rows, &k), (_, _, colour, shape, size)) in functions {
            let k = if removed { k } else { 1.0 };
            let points: Vec<[f64; 2]> = rows[..OTHERS.len()]
                .iter()
                .map(|r| [r.eps / k, r.growth[0] * exp(-law.across() * ln(r.eps / k))])
                .filter(|p| p[1] > 0.0)
                .collect();
            let look = marker(shape, colour, size);
            panel = panel
                .line(points.clone(), LineStyle::new(colour, style::CURVE_PT))
                .markers(points, look);
        }
        panel
    };
    let exits = |removed: bool| {
        let mut panel = PlanePanel::new(
            Axis::log(if removed { "*ε*/*κ*" } else { "*ε*" }, 5e-6, 4e-2),
            Axis::linear("*y* of the far exit", -2.1, -0.5),
        );
        let functions = rows.iter().zip(&stretch).zip(TRANSITIONS).rev();
        for ((rows, &k), (_, _, colour, shape, size)) in functions {
            let k = if removed { k } else { 1.0 };
            let points: Vec<[f64; 2]> =
                rows[OTHERS.len()..].iter().map(|r| [r.eps / k, r.far[0]]).collect();
            let look = marker(shape, colour, 0.7 * size);
            panel = panel.markers(apart(points), look);
        }
        panel
    };

    let mut places = PlanePanel::new(
        Axis::log("*ε*", 6e-5, 1.6e-2),
        Axis::linear("−*z*/√*ε* where it is left", -4.0, 12.5),
    );
    let mut sides = PlanePanel::new(
        Axis::log("*ε*", 6e-5, 1.6e-2),
        Axis::linear("share left to *x* < 0", -0.08, 1.08),
    );
    let smooth: Vec<&Row> = rows[0].iter().filter(|r| SELECTION.contains(&r.eps)).collect();
    let dots = marker(MarkerShape::Dot, style::INK, 4.6);
    let tip: Vec<[f64; 2]> = smooth.iter().map(|r| [r.eps, sqrt(r.z2)]).collect();
    places =
        places.line(tip.clone(), LineStyle::new(style::INK, style::CURVE_PT)).markers(tip, dots);
    let mut legend = vec![LegendEntry::new(LegendKey::Marker(dots), "tanh")];
    let share: Vec<[f64; 2]> =
        smooth.iter().map(|r| [r.eps, if r.minus { 1.0 } else { 0.0 }]).collect();
    // Large, so that crosses do not cover them.
    sides = sides.markers(share, MarkerStyle { size: 6.6, ..dots });
    for (rule, answers) in RULES.into_iter().zip(leavings.chunks(SELECTION.len())) {
        let (words, colour, shape) = rule.look();
        let look = marker(shape, colour, 4.0);
        let (mut middles, mut shares) = (Vec::new(), Vec::new());
        for (answer, eps) in answers.iter().zip(SELECTION) {
            let table = &answer.tables[0];
            let mut depths: Vec<f64> = table
                .numbers("left_z")
                .iter()
                .filter(|z| z.is_finite())
                .map(|z| -z / sqrt(eps))
                .collect();
            if depths.is_empty() {
                continue;
            }
            let (count, middle) = (depths.len() as f64, median(&mut depths));
            // Beside each other, not upon each other.
            let at = eps * exp10(0.05 * (rule as usize as f64 - 1.0));
            let (least, most) = range_of(depths);
            places =
                places.line(vec![[at, least], [at, most]], LineStyle::new(colour, style::CURVE_PT));
            middles.push([at, middle]);
            let minus = table.numbers("left_x").iter().filter(|x| **x < 0.0).count();
            shares.push([at, minus as f64 / count]);
        }
        places = places.markers(middles, look);
        legend.push(LegendEntry::new(LegendKey::Marker(look), words));
        sides = sides.markers(shares, look);
    }
    let factors: Vec<String> =
        TRANSITIONS.iter().zip(&stretch).map(|(t, k)| format!("{} {k:.3}", t.1)).collect();
    let mut without_phases = compensated("growth × (*ε*/*κ*)^{1/2*μ*}", true);
    for (_, words, colour, shape, size) in TRANSITIONS {
        without_phases =
            without_phases.legend(LegendKey::Marker(marker(shape, colour, size)), words);
    }
    legend
        .into_iter()
        .fold(Sheet::new(ColumnWidth::Wide, 2, ""), Sheet::legend)
        .panel_aspect(0.8)
        .panel("(a)", "four transition functions", compensated("growth × *ε*^{1/2*μ*}", false))
        .panel("(b)", "their phases removed", without_phases.legend_at(Corner::UpperLeft))
        .panel("(c)", "the far exit", exits(false))
        .panel("(d)", "their phases removed", exits(true))
        .panel("(e)", "member selected", places)
        .panel("(f)", "side selected", sides)
        .footer(format!(
            "(a–d) Legend in (b); growth across the layer. *κ*: slope of the transition function \
             on the canard divided by tanh’s: {}. The lone square is arctan’s at *ε* = 10^{{−2}}, \
             which first crosses *x* = 0 three times as far out as the others. (c, d) have fewer \
             points at the jumps than the tables.",
            factors.join(", ")
        ))
        .footer(format!(
            "(e, f) Where |*x*| first exceeds 3*ε* after the visit, median and range: eq. (10) \
             with *ε*′ = {}*ε* from {ORBITS} starts shifted by multiples of {} in *x*; noise of \
             length *ε* every {}, {ORBITS} streams. tanh selects one side; literal hysteresis and \
             noise both, nearer to the singularity; the single reading of eq. (10) is smoothing \
             with *ε*′. At *ε* = 10^{{−2}} no hysteretic orbit has a visit and leaves by *t* = \
             40.",
            number(RELAXATION),
            number(SHIFT),
            number(KICKS),
        ))
}

/// The figure's specification.
pub fn figure() -> Figure {
    let picture = |name: &str, title, caption: &str, study| Picture {
        name: name.into(),
        reading: Some(Reading::Reconstructed.into()),
        title,
        caption: caption.into(),
        view: View::Study(study),
        panels: Vec::new(),
        alterations: Vec::new(),
    };
    Figure {
        id: "law".into(),
        title: "The law of the breakdown".into(),
        pictures: vec![
            picture(
                "law",
                "The law of the breakdown".into(),
                "How the smoothed system passes the two-fold as the switch steepens, with \
                    predictions that are formulas of v+ and v- alone. (a) Growth of a \
                 disturbance made at the singularity across and along the layer, and of one \
                 carried in, against ε. (b) Its local exponents. (c) Square of the \
                 distance at which the surface is left, over ε. (d) The far exit: smooth branches \
                 and jumps, periodic in ln ε. (e) Exponents for \
                 other v+ and v-. (f) How near the canard the orbits of both readings come in.",
                Study { questions: law_questions, draw: draw_law },
            ),
            picture(
                "law-selection",
                "What selects the member of the funnel".into(),
                "The law under four transition functions, as computed and with the phase removed: \
                    (a, b) growth of a disturbance across the layer, divided by its \
                 predicted power; (c, d) the far exit. (e, f) Where and to which side the surface \
                 is left under smoothing, hysteresis and noise.",
                Study { questions: selection_questions, draw: draw_selection },
            ),
        ],
    }
}
