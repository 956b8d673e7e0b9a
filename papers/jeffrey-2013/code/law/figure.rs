//! The law of the breakdown. Not a figure of the paper: how regularised motion passes the two-fold
//! as the switch steepens, beside what the normal form's constants v+ and v- predict. All
//! predictions are formulas of v+ and v- ([`Predicted`]); none is fitted.

use std::sync::Arc;

use crate::Reading;
use twofold::analyse::passage::{PassageQuestion, Predicted};
use twofold::integrate::{Kick, KickLaw, Schedule};
use twofold::job::spec::SwitchSpec;
use twofold::job::{Answer, AnyQuestion, Leaving, Table, TwoFoldPassage};
use twofold::num::elementary::{exp, exp10, ln, log10, sqrt};
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

/// Transition functions, their words and looks.
const TRANSITIONS: [(Transition, &str, Colour, MarkerShape); 4] = [
    (Transition::Tanh, "tanh", style::INK, MarkerShape::Dot),
    (Transition::Arctan, "arctan", style::BLUE, MarkerShape::Square),
    (Transition::Algebraic, "algebraic", style::VERMILLION, MarkerShape::Triangle),
    (Transition::Erf, "erf", style::GREEN, MarkerShape::Star),
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

/// Three digits and a power of ten.
fn short(value: f64) -> String {
    let power = log10(value).floor();
    format!("{:.2}·10^{{−{}}}", value / exp10(power), -power)
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
    let (slopes, said) = slopes_panel(growth, &law, tanh);
    let (selected, tip) = selection_panel(ladder, &law, tanh);
    let (exits, periods) = far_panel(ladder, &law, tanh);
    let (nearness, explained) = nearness_panel(growth, printed, &law);
    let (exponents, measured) = exponents_panel(others);
    let formula = LineStyle::new(style::SOFT_INK, style::CURVE_PT).dashed();
    Sheet::new(ColumnWidth::Wide, 2, "")
        .panel_aspect(0.8)
        .panel("(a)", "growth of a disturbance", growth_panel(growth, &law))
        .panel("(b)", "its local exponents", slopes)
        .panel("(c)", "where the surface is left", selected)
        .panel("(d)", "the far exit", exits)
        .panel("(e)", "other two-folds", exponents)
        .panel("(f)", "nearness to the canard", nearness)
        .legend(LegendEntry::new(LegendKey::Line(formula), "formulas of *v*_{+}, *v*_{−}"))
        .legend(LegendEntry::new(
            LegendKey::Line(LineStyle::new(style::SOFT_INK, style::CURVE_PT)),
            "the same with their logarithms",
        ))
        .footer(format!(
            "(a, b) Disturbances made at the visit, or carried in from *t* = 0; growth until the \
                first passage through *y* = 0 beyond {}√*ε*; double-double \
             arithmetic. Predicted powers: −{:.3} across, −{:.3} along, +0.5 carried in. {said}",
            number(BEYOND),
            -law.across(),
            -law.along(),
        ))
        .footer(tip)
        .footer(periods)
        .footer(measured)
        .footer(explained)
}

fn growth_panel(rows: &[Row], law: &Predicted) -> PlanePanel {
    let formula = LineStyle::new(style::SOFT_INK, style::CURVE_PT).dashed();
    let series = [
        ("across the layer", style::VERMILLION, MarkerShape::Dot, law.across()),
        ("along it", style::BLUE, MarkerShape::Square, law.along()),
        ("carried in", style::GREEN, MarkerShape::Triangle, law.carried()),
    ];
    let mut panel = PlanePanel::new(Axis::log("*ε*", 5e-8, 2e-2), Axis::log("growth", 1e-6, 1e60));
    for (which, (words, colour, shape, power)) in series.into_iter().enumerate() {
        let points: Vec<[f64; 2]> =
            rows.iter().map(|r| [r.eps, r.growth[which]]).filter(|p| p[1] > 0.0).collect();
        if let Some(&[eps, at]) = points.last() {
            // The power alone, through the last point.
            let ends = [2e-2, 5e-8].map(|e| [e, exp(ln(at) + power * ln(e / eps))]);
            panel = panel.line(ends.into(), formula);
        }
        let look = marker(shape, colour, 4.0);
        panel = panel.markers(points, look).legend(LegendKey::Marker(look), words);
    }
    panel.legend_at(Corner::UpperRight)
}

fn slopes_panel(rows: &[Row], law: &Predicted, tanh: f64) -> (PlanePanel, String) {
    let formula = LineStyle::new(style::SOFT_INK, style::CURVE_PT);
    let mut panel = PlanePanel::new(
        Axis::log("*ε*", 5e-8, 2e-2),
        Axis::linear("−d ln growth/d ln *ε*", 2.8, 4.3),
    );
    let mut said = Vec::new();
    let series = [
        ("across", style::VERMILLION, MarkerShape::Dot, law.across()),
        ("along", style::BLUE, MarkerShape::Square, law.along()),
    ];
    for (which, (words, colour, shape, power)) in series.into_iter().enumerate() {
        let found = local_slopes(rows, which);
        let with_logarithm: Vec<[f64; 2]> =
            found.iter().map(|&(eps, _, z2)| [eps, -power - law.correction(tanh, z2)]).collect();
        let look = marker(shape, colour, 4.0);
        panel = panel
            .line(vec![[5e-8, -power], [2e-2, -power]], formula.dashed())
            .line(with_logarithm.clone(), formula)
            .markers(found.iter().map(|f| [f.0, f.1]).collect(), look)
            .legend(LegendKey::Marker(look), words);
        let off = found.iter().zip(&with_logarithm).filter(|(f, _)| f.0 < 1e-3);
        let worst = off.map(|(f, p)| (f.1 - p[1]).abs()).fold(0.0, f64::max);
        let measured: Vec<String> = found.iter().map(|f| format!("{:.3}", f.1)).collect();
        said.push(format!(
            "Local exponents {words}: {}; off the prediction with its logarithm by at most \
                {worst:.3} below 10^{{−3}}.",
            measured.join(", ")
        ));
    }
    (panel.legend_at(Corner::LowerLeft), said.join(" "))
}

/// The eps from which predictions of z^2/eps start.
const ANCHOR: f64 = 1e-3;

fn anchor(ladder: &[Row]) -> (f64, f64) {
    let nearest =
        |a: &&Row, b: &&Row| ln(a.eps / ANCHOR).abs().total_cmp(&ln(b.eps / ANCHOR).abs());
    ladder.iter().min_by(nearest).map_or((ANCHOR, f64::NAN), |r| (r.eps, r.z2))
}

fn selection_panel(ladder: &[Row], law: &Predicted, tanh: f64) -> (PlanePanel, String) {
    let at = anchor(ladder);
    let points: Vec<[f64; 2]> = ladder.iter().map(|r| [r.eps, r.z2]).collect();
    let formula = LineStyle::new(style::SOFT_INK, style::CURVE_PT);
    let line_to = |eps: f64| [eps, grown(law, tanh, at, eps)];
    let predicted: Vec<[f64; 2]> = ladder.iter().map(|r| line_to(r.eps)).collect();
    let asymptote = law.selection(tanh, f64::INFINITY);
    let straight: Vec<[f64; 2]> =
        [1e-2, 2e-7].map(|eps: f64| [eps, at.1 + asymptote * ln(at.0 / eps)]).into();
    let dots = marker(MarkerShape::Dot, style::VERMILLION, 3.0);
    let y = Axis::covering("*z*^{2}/*ε* at the first exit", points.iter().map(|p| p[1]));
    let mut panel =
        PlanePanel::new(Axis::log("*ε*", 1.5e-7, 1.5e-2), y).line(straight, formula.dashed());
    panel = panel.markers(points.clone(), dots).line(predicted.clone(), formula);
    let pairs: Vec<(f64, f64)> = points.iter().map(|p| (-ln(p[0]), p[1])).collect();
    let measured = line(&pairs).map_or(f64::NAN, |l| l.slope);
    let worst =
        points.iter().zip(&predicted).map(|(a, b)| (a[1] / b[1] - 1.0).abs()).fold(0.0, f64::max);
    let text = format!(
        "(c) First passage through *x* = 0 after the visit. Slope against ln(1/*ε*): measured \
            {measured:.3}, predicted {asymptote:.3} in the limit and \
         {:.3} here; the solid line is the predicted slope integrated from *ε* = 10^{{−3}} and is \
         off by at most {:.1} %.",
        law.selection(tanh, at.1),
        100.0 * worst,
    );
    (panel, text)
}

fn far_panel(ladder: &[Row], law: &Predicted, tanh: f64) -> (PlanePanel, String) {
    let formula = LineStyle::new(style::SOFT_INK, style::CURVE_PT);
    let found = jumps(ladder);
    let mut panel = PlanePanel::new(
        Axis::log("*ε*", 1.5e-7, 1.5e-2),
        Axis::linear("*y*, *z* of the far exit", -2.2, 4.0),
    );
    // Branch by branch.
    for (which, colour) in [(0, style::BLUE), (1, style::VERMILLION)] {
        let mut branch: Vec<[f64; 2]> = Vec::new();
        for (i, r) in ladder.iter().enumerate() {
            if i > 0 && found.iter().any(|j| j.1 == r.eps) {
                panel = panel
                    .line(std::mem::take(&mut branch), LineStyle::new(colour, style::CURVE_PT));
            }
            branch.push([r.eps, r.far[which]]);
        }
        panel = panel.line(branch, LineStyle::new(colour, style::CURVE_PT));
        let look = marker(MarkerShape::Dot, colour, 2.6);
        panel = panel.markers(ladder.iter().map(|r| [r.eps, r.far[which]]).collect(), look);
        panel = panel.legend(LegendKey::Marker(look), if which == 0 { "*y*" } else { "*z*" });
    }
    // From the first jump, one predicted period after the other.
    let mut said = Vec::new();
    if let Some(&(above, below)) = found.first() {
        let mut eps = sqrt(above * below);
        let mut z2 = ladder.iter().find(|r| r.eps == below).map_or(f64::NAN, |r| r.z2);
        while eps > 2e-7 {
            panel = panel.line(vec![[eps, -2.2], [eps, 1.5]], formula);
            let r = period(law, tanh, (eps, z2));
            z2 = grown(law, tanh, (eps, z2), eps / r);
            eps /= r;
            said.push(format!("{r:.1}"));
        }
    }
    let between: Vec<String> = found
        .windows(2)
        .map(|w| format!("{:.1}", sqrt(w[0].0 * w[0].1 / (w[1].0 * w[1].1))))
        .collect();
    let at: Vec<String> =
        found.iter().map(|j| format!("{} and {}", short(j.0), short(j.1))).collect();
    let text = format!(
        "(d) First upward passage through *x* = 0 beyond {}: it depends on *ε* through the \
            fractional part of ln(1/*ε*)/(2 ln *λ*), *λ* = {:.4}, up to a \
         slow logarithm, so that by this formula there is no limit. Measured jumps between {}: \
         factors {} (each to 6 %); predicted from one to the next: {} (vertical lines, from the \
         first \
         jump on), in the limit *λ*^{{2}} = {:.1}.",
        number(FAR),
        law.turn,
        at.join("; "),
        between.join(", "),
        said.join(", "),
        law.turn * law.turn,
    );
    (panel.legend_at(Corner::UpperRight), text)
}

/// Signed distance of the incoming orbit from the canard, up to a constant: d = eps^(1/(2 mu))-less
/// part of the deviation, from the growth that it causes.
fn nearness(row: &Row, law: &Predicted) -> f64 {
    let size = exp(law.across() * ln(row.eps)) / (row.growth[0] * sqrt(row.z2));
    if row.minus { size } else { -size }
}

fn nearness_panel(growth: &[Row], printed: &[Row], law: &Predicted) -> (PlanePanel, String) {
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
        Axis::linear("*C*(*ε*)/*C*(0)", -0.3, 2.2),
    )
    .line(
        vec![[-0.4, 0.0], [10.6, 0.0]],
        LineStyle::new(style::SOFT_INK, style::FRAME_PT).dotted(),
    );
    for (points, words, colour, shape) in [
        (reconstructed, "reconstructed", style::BLUE, MarkerShape::Square),
        (others.clone(), "printed", style::VERMILLION, MarkerShape::Dot),
    ] {
        let look = marker(shape, colour, 4.0);
        panel = panel
            .line(points.clone(), LineStyle::new(colour, style::CURVE_PT))
            .markers(points, look)
            .legend(LegendKey::Marker(look), words);
    }
    let slopes: Vec<String> =
        local_slopes(printed, 0).iter().map(|s| format!("{:.2}", s.1)).collect();
    let zero = others.windows(2).find(|w| w[0][1] * w[1][1] < 0.0);
    let text = format!(
        "(f) The growth is *ε*^{{−1/2*μ*}}/*C*(*ε*) up to the logarithm, *C* the distance from the \
            canard at which an orbit comes in, positive if it leaves to \
         *x* < 0. The printed reading comes in from far away, {:.0} times nearer than the \
         reconstructed one, so near that shifts proportional to *ε* carry it across the \
         canard {}: that is why its local exponents are {}.",
        a / b,
        zero.map_or_else(String::new, |w| format!(
            "between *ε* = {:.3} and {:.3}",
            w[1][0] * 1e-3,
            w[0][0] * 1e-3
        )),
        slopes.join(", "),
    );
    (panel.legend_at(Corner::UpperRight), text)
}

fn exponents_panel(rows: &[Row]) -> (PlanePanel, String) {
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
    let mut said = Vec::new();
    let mut series = [Vec::new(), Vec::new()];
    for (ratio, pair) in RATIOS.into_iter().zip(rows.chunks(2)) {
        let found: Vec<f64> = (0..2)
            .map(|which| local_slopes(pair, which).first().map_or(f64::NAN, |s| s.1))
            .collect();
        for (points, exponent) in series.iter_mut().zip(&found) {
            points.push([ratio, *exponent]);
        }
        said.push(format!("{}: {:.2}, {:.2}", number(ratio), found[0], found[1]));
    }
    for (points, (words, colour, shape)) in series.into_iter().zip([
        ("across", style::VERMILLION, MarkerShape::Dot),
        ("along", style::BLUE, MarkerShape::Square),
    ]) {
        let look = marker(shape, colour, 4.0);
        panel = panel
            .markers(points.into_iter().filter(|p| p[1].is_finite()).collect(), look)
            .legend(LegendKey::Marker(look), words);
    }
    let text = format!(
        "(e) Local exponents between *ε* = {} and {} for other *v*_{{±}} (1/*μ*: across, along): \
            {}. Dotted: resonances, 1/*μ* a whole number. There an incoming orbit is not \
         parted from the canard to first order, and the next order decides: the exponent along \
         rises to about 1/*μ* − 1 (dotted line).",
        number(BETWEEN[0]),
        number(BETWEEN[1]),
        said.join(", ")
    );
    (panel.legend_at(Corner::LowerRight), text)
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
            Rule::Literal => ("hysteresis, literal", style::BLUE, MarkerShape::Square),
            Rule::Single => ("hysteresis, single", style::PURPLE, MarkerShape::Star),
            Rule::Noise => ("noise", style::VERMILLION, MarkerShape::Triangle),
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
        for ((rows, &k), (_, _, colour, shape)) in rows.iter().zip(&stretch).zip(TRANSITIONS) {
            let k = if removed { k } else { 1.0 };
            let points: Vec<[f64; 2]> = rows[..OTHERS.len()]
                .iter()
                .map(|r| [r.eps / k, r.growth[0] * exp(-law.across() * ln(r.eps / k))])
                .filter(|p| p[1] > 0.0)
                .collect();
            let look = marker(shape, colour, 4.0);
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
        for ((rows, &k), (_, _, colour, shape)) in rows.iter().zip(&stretch).zip(TRANSITIONS) {
            let k = if removed { k } else { 1.0 };
            let points: Vec<[f64; 2]> =
                rows[OTHERS.len()..].iter().map(|r| [r.eps / k, r.far[0]]).collect();
            let look = marker(shape, colour, 2.8);
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
        Axis::linear("share that leaves to *x* < 0", -0.08, 1.3),
    );
    let smooth: Vec<&Row> = rows[0].iter().filter(|r| SELECTION.contains(&r.eps)).collect();
    let dots = marker(MarkerShape::Dot, style::INK, 4.0);
    let tip: Vec<[f64; 2]> = smooth.iter().map(|r| [r.eps, sqrt(r.z2)]).collect();
    places =
        places.line(tip.clone(), LineStyle::new(style::INK, style::CURVE_PT)).markers(tip, dots);
    let mut rules = vec![LegendEntry::new(LegendKey::Marker(dots), "smoothing (e, f)")];
    let share: Vec<[f64; 2]> =
        smooth.iter().map(|r| [r.eps, if r.minus { 1.0 } else { 0.0 }]).collect();
    sides = sides.markers(share, dots);
    let mut said = Vec::new();
    for (rule, answers) in RULES.into_iter().zip(leavings.chunks(SELECTION.len())) {
        let (words, colour, shape) = rule.look();
        let look = marker(shape, colour, 4.0);
        let (mut middles, mut shares) = (Vec::new(), Vec::new());
        for (i, (answer, eps)) in answers.iter().zip(SELECTION).enumerate() {
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
            let middle = median(&mut depths);
            // Beside each other, not upon each other.
            let at = eps * exp10(0.05 * (rule as usize as f64 - 1.0));
            let quartile = |q: usize| depths[(q * (depths.len() - 1)) / 4];
            places = places.line(
                vec![[at, quartile(0)], [at, quartile(4)]],
                LineStyle::new(colour, style::CURVE_PT),
            );
            middles.push([at, middle]);
            let minus = table.numbers("left_x").iter().filter(|x| **x < 0.0).count();
            shares.push([at, minus as f64 / depths.len() as f64]);
            if i + 1 == SELECTION.len() || i == 0 {
                said.push(format!(
                    "{words} at {}: {middle:.2} ({:.2} to {:.2})",
                    number(eps),
                    quartile(0),
                    quartile(4)
                ));
            }
        }
        places = places.markers(middles, look);
        rules.push(LegendEntry::new(LegendKey::Marker(look), format!("{words} (e, f)")));
        sides = sides.markers(shares, look);
    }
    let factors: Vec<String> =
        TRANSITIONS.iter().zip(&stretch).map(|(t, k)| format!("{} {k:.3}", t.1)).collect();
    let functions = TRANSITIONS.iter().map(|(_, words, colour, shape)| {
        let look = LegendKey::Marker(marker(*shape, *colour, 4.0));
        LegendEntry::new(look, format!("{words} (a–d)"))
    });
    functions
        .chain(rules)
        .fold(Sheet::new(ColumnWidth::Wide, 2, ""), Sheet::legend)
        .panel_aspect(0.8)
        .panel(
            "(a)",
            "four transition functions",
            compensated(
                "growth across × \
            *ε*^{1/2*μ*}",
                false,
            ),
        )
        .panel(
            "(b)",
            "their phases removed",
            compensated(
                "growth across × \
            (*ε*/*κ*)^{1/2*μ*}",
                true,
            ),
        )
        .panel("(c)", "the far exit", exits(false))
        .panel("(d)", "their phases removed", exits(true))
        .panel("(e)", "member selected", places)
        .panel("(f)", "side selected", sides)
        .footer(format!(
            "(a–d) Linearised about the canard, a transition function enters through its slope \
                there alone: *ε*/*φ*′ takes the place of *ε*. *κ* is *φ*′ on \
             the canard divided by tanh’s: {}. What is left after that is the shape of the \
             function. In (c, d), points that would cover each other are left out about the jumps; \
             the tables have all.",
            factors.join(", ")
        ))
        .footer(format!(
            "(e, f) The same start under other rules: smoothing (first passage through *x* = 0); \
                hysteresis, eq. (10) with *ε*′ = {} *ε* in both readings of it, from {ORBITS} \
             starts shifted by multiples of {} in *x*; tanh smoothing with {ORBITS} streams of \
             kicks of length *ε* after every {}. Where |*x*| first exceeds 3*ε* after the \
             visit: median and range. Smoothing always selects the same side and a member that \
             lies farther out by the root of a logarithm; the literal hysteresis and noise \
             select members at the singularity itself, to both sides; the single reading of eq. \
             (10) is smoothing with *ε*′ in place of *ε*. Median (range) of −*z*/√*ε*: {}.",
            number(RELAXATION),
            number(SHIFT),
            number(KICKS),
            said.join("; ")
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
