//! Plane charts: axes, ticks and layers.

use plotters::style::text_anchor::{HPos, VPos};

use super::RenderError;
use super::canvas::{Canvas, Chart, Rect, Span, TextFormat, text_width};
use super::font::CAP_HEIGHT;
use super::scene::{Position, UNITS_PER_POINT, units};
use super::sheet::{Axis, PlaneLayer, PlanePanel};
use super::style;
use super::ticks::{self, Tick, Ticks};
use twofold_num::elementary;

/// Space that a panel needs around its drawing area, in units.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Insets {
    /// On the left.
    pub left: i32,
    /// On the right.
    pub right: i32,
    /// Above.
    pub top: i32,
    /// Below.
    pub bottom: i32,
}

/// Depth of letters below the baseline of an axis title, in points.
const DESCENT_PT: f64 = 2.2;

/// The value on which an axis is linear: the value itself, or its decimal logarithm.
fn scaled(axis: &Axis, value: f64) -> f64 {
    if !axis.logarithmic {
        value
    } else if value > 0.0 {
        elementary::log10(value)
    } else {
        f64::NAN
    }
}

/// The range of an axis in scaled values; one of no extent is widened.
pub fn span(axis: &Axis) -> Span {
    let (a, b) = (scaled(axis, axis.lower), scaled(axis, axis.upper));
    let (lower, upper) = (a.min(b), a.max(b));
    if upper > lower {
        return Span { lower, upper };
    }
    let half = if axis.logarithmic { 0.5 } else { (0.05 * lower.abs()).max(0.5) };
    Span { lower: lower - half, upper: lower + half }
}

fn ticks_of(axis: &Axis, span: Span, length: i32, spacing: f64) -> Ticks {
    let wanted = (f64::from(length) / (spacing * f64::from(UNITS_PER_POINT))).max(2.0);
    if axis.logarithmic {
        return ticks::logarithmic(
            elementary::exp10(span.lower),
            elementary::exp10(span.upper),
            wanted,
        );
    }
    let ticks = ticks::linear(span.lower, span.upper, wanted);
    // One labelled tick is no scale.
    if ticks.major.len() < 2 { ticks::linear(span.lower, span.upper, 2.0 * wanted) } else { ticks }
}

/// The format of an axis' title, smaller if there is not so much room.
fn title_format(title: &str, room: i32) -> TextFormat {
    let width = text_width(title, style::LABEL_PT);
    let share = f64::from(room) / f64::from(width.max(1));
    TextFormat::new(style::LABEL_PT * share.min(1.0)).anchor(HPos::Center, VPos::Bottom)
}

/// Ticks of a horizontal axis, fewer if their labels would touch.
fn x_ticks(axis: &Axis, span: Span, length: i32) -> Ticks {
    let mut spacing = style::TICK_SPACING_X_PT;
    for _ in 0..4 {
        let ticks = ticks_of(axis, span, length, spacing);
        let place =
            |v: f64| (scaled(axis, v) - span.lower) / (span.upper - span.lower) * f64::from(length);
        let crowded = ticks.major.windows(2).any(|w| {
            let room = place(w[1].value) - place(w[0].value);
            let half =
                text_width(&w[0].label, style::TICK_PT) + text_width(&w[1].label, style::TICK_PT);
            room < f64::from(half) / 2.0 + f64::from(units(5.0))
        });
        if !crowded {
            return ticks;
        }
        spacing *= 1.5;
    }
    // The fewest labels still touch: every second one.
    let mut ticks = ticks_of(axis, span, length, spacing);
    let (kept, dropped): (Vec<_>, Vec<_>) =
        ticks.major.into_iter().enumerate().partition(|(i, _)| i % 2 == 0);
    ticks.major = kept.into_iter().map(|(_, tick)| tick).collect();
    ticks.minor.extend(dropped.into_iter().map(|(_, tick)| tick.value));
    ticks
}

/// Ticks of a vertical axis: of labels that would touch every second one, or the two at the ends.
fn y_ticks(axis: &Axis, span: Span, length: i32) -> Ticks {
    let all = ticks_of(axis, span, length, style::TICK_SPACING_Y_PT);
    let place = |tick: &Tick| {
        (scaled(axis, tick.value) - span.lower) / (span.upper - span.lower) * f64::from(length)
    };
    let crowded = |ticks: &[Tick]| {
        let touch = |w: &[Tick]| place(&w[1]) - place(&w[0]) < f64::from(units(style::TICK_PT));
        ticks.windows(2).any(touch)
    };
    let last = all.major.len().saturating_sub(1);
    for step in [1, 2, last.max(1)] {
        let (kept, dropped): (Vec<_>, Vec<_>) =
            all.major.iter().cloned().enumerate().partition(|(i, _)| i % step == 0);
        let major: Vec<Tick> = kept.into_iter().map(|(_, tick)| tick).collect();
        if !crowded(&major) {
            let minor = dropped.into_iter().map(|(_, tick)| tick.value);
            return Ticks { major, minor: all.minor.iter().copied().chain(minor).collect() };
        }
    }
    all
}

/// Ranges of a panel over a drawing area of this size: with equal axes the shorter range is widened
/// about its centre.
fn spans(panel: &PlanePanel, w: i32, h: i32) -> (Span, Span) {
    let (mut x, mut y) = (span(&panel.x), span(&panel.y));
    if panel.equal {
        let (per_x, per_y) =
            ((x.upper - x.lower) / f64::from(w), (y.upper - y.lower) / f64::from(h));
        let widen = |s: Span, length: i32, per: f64| {
            let (middle, half) = (0.5 * (s.lower + s.upper), 0.5 * per * f64::from(length));
            Span { lower: middle - half, upper: middle + half }
        };
        if per_x < per_y {
            x = widen(x, w, per_y);
        } else {
            y = widen(y, h, per_x);
        }
    }
    (x, y)
}

/// Height divided by width that suits a panel by itself: that of its ranges if a unit is equally
/// long on both axes.
pub fn natural_aspect(panel: &PlanePanel) -> Option<f64> {
    panel.aspect.or_else(|| {
        let (x, y) = (span(&panel.x), span(&panel.y));
        panel.equal.then(|| ((y.upper - y.lower) / (x.upper - x.lower)).clamp(0.35, 1.6))
    })
}

/// Space needed around a drawing area of this size.
pub fn insets(panel: &PlanePanel, w: i32, h: i32) -> Insets {
    if !panel.axes {
        return Insets::default();
    }
    let (x, y) = spans(panel, w, h);
    let [across, up] = panel.labelled;
    let widest = y_ticks(&panel.y, y, h)
        .major
        .iter()
        .map(|t| text_width(&t.label, style::TICK_PT))
        .max()
        .unwrap_or(0);
    let y_title = if panel.y.title.is_empty() { 0 } else { units(style::LABEL_PT * 1.1) };
    let x_title = if panel.x.title.is_empty() {
        0
    } else {
        units(3.5 + CAP_HEIGHT * style::LABEL_PT + DESCENT_PT)
    };
    // The last label of the horizontal axis may stand out by half its width.
    let ticks = x_ticks(&panel.x, x, w);
    let right = ticks.major.last().map_or(0, |t| {
        let place = (scaled(&panel.x, t.value) - x.lower) / (x.upper - x.lower) * f64::from(w);
        (place.round() as i32 + text_width(&t.label, style::TICK_PT) / 2 - w).max(0)
    });
    Insets {
        left: if up { widest + units(style::TICK_GAP_PT) + y_title } else { 0 } + units(1.0),
        right: if across { right.max(units(1.0)) } else { units(1.0) },
        top: units(3.0),
        bottom: if across {
            units(style::TICK_GAP_PT + 0.8 + CAP_HEIGHT * style::TICK_PT + 1.0) + x_title
        } else {
            units(1.0)
        },
    }
}

/// Draws a panel into its drawing area.
pub fn draw(canvas: &Canvas, panel: &PlanePanel, rect: Rect) -> Result<(), RenderError> {
    let (x, y) = spans(panel, rect.w, rect.h);
    let mut chart = canvas.chart(rect, x, y)?;
    let (xt, yt) = (x_ticks(&panel.x, x, rect.w), y_ticks(&panel.y, y, rect.h));
    if panel.grid && panel.axes {
        for t in &xt.major {
            let px = chart.position(&[scaled(&panel.x, t.value), y.lower]).0;
            canvas.line(&[(px, rect.y), (px, rect.bottom())], style::GRID, style::GRID_PT)?;
        }
        for t in &yt.major {
            let py = chart.position(&[x.lower, scaled(&panel.y, t.value)]).1;
            canvas.line(&[(rect.x, py), (rect.right(), py)], style::GRID, style::GRID_PT)?;
        }
    }
    for layer in &panel.layers {
        draw_layer(canvas, &mut chart, panel, layer)?;
    }
    if panel.axes {
        draw_axes(canvas, &chart, panel, (&xt, &yt), (x, y))?;
    }
    canvas.legend(&panel.legend, rect, panel.legend_corner)
}

fn draw_layer(
    canvas: &Canvas,
    chart: &mut Chart,
    panel: &PlanePanel,
    layer: &PlaneLayer,
) -> Result<(), RenderError> {
    let convert = |p: &[f64; 2]| [scaled(&panel.x, p[0]), scaled(&panel.y, p[1])];
    match layer {
        PlaneLayer::Dots { points, style } => {
            let points: Vec<[f64; 2]> = points.iter().map(convert).collect();
            chart.dots(&points, style)
        }
        PlaneLayer::Line { points, style, arrow } => {
            let points: Vec<[f64; 2]> = points.iter().map(convert).collect();
            let parts = chart.line(&points, style)?;
            match parts.last() {
                // A line cut off by the edge of the chart has lost its end and gets no head.
                Some(part) if *arrow && points.last().is_some_and(|p| chart.contains(p)) => {
                    canvas.arrow_head(part, style)
                }
                _ => Ok(()),
            }
        }
        PlaneLayer::Area { outline, colour, opacity } => {
            let outline: Vec<[f64; 2]> = outline.iter().map(convert).collect();
            chart.area(&outline, *colour, *opacity)
        }
        PlaneLayer::Markers { points, style } => {
            for p in points.iter().map(convert).filter(|p| chart.contains(p)) {
                canvas.marker(chart.position(&p), style)?;
            }
            Ok(())
        }
        PlaneLayer::Note(note) => {
            let at = convert(&note.at);
            if at.iter().all(|v| v.is_finite()) {
                canvas.note(note, chart.position(&at))
            } else {
                Ok(())
            }
        }
    }
}

fn draw_axes(
    canvas: &Canvas,
    chart: &Chart,
    panel: &PlanePanel,
    (xt, yt): (&Ticks, &Ticks),
    (x, y): (Span, Span),
) -> Result<(), RenderError> {
    let rect = chart.rect;
    let (major, minor) = (units(style::TICK_LENGTH_PT), units(style::MINOR_TICK_LENGTH_PT));
    let tick = |a: Position, b: Position| canvas.line(&[a, b], style::SOFT_INK, style::FRAME_PT);
    let values = |t: &Ticks| -> Vec<(f64, i32)> {
        t.major
            .iter()
            .map(|t| (t.value, major))
            .chain(t.minor.iter().map(|v| (*v, minor)))
            .collect()
    };
    for (v, length) in values(xt) {
        let px = chart.position(&[scaled(&panel.x, v), y.lower]).0;
        tick((px, rect.bottom()), (px, rect.bottom() - length))?;
        tick((px, rect.y), (px, rect.y + length))?;
    }
    for (v, length) in values(yt) {
        let py = chart.position(&[x.lower, scaled(&panel.y, v)]).1;
        tick((rect.x, py), (rect.x + length, py))?;
        tick((rect.right(), py), (rect.right() - length, py))?;
    }
    let corners = [
        (rect.x, rect.y),
        (rect.right(), rect.y),
        (rect.right(), rect.bottom()),
        (rect.x, rect.bottom()),
        (rect.x, rect.y),
    ];
    canvas.line(&corners, style::SOFT_INK, style::FRAME_PT)?;
    let gap = units(style::TICK_GAP_PT);
    let [across, up] = panel.labelled;
    for t in xt.major.iter().filter(|_| across) {
        let px = chart.position(&[scaled(&panel.x, t.value), y.lower]).0;
        let how = TextFormat::new(style::TICK_PT).anchor(HPos::Center, VPos::Top);
        canvas.text(&t.label, (px, rect.bottom() + gap + units(0.8)), how)?;
    }
    for t in yt.major.iter().filter(|_| up) {
        let py = chart.position(&[x.lower, scaled(&panel.y, t.value)]).1;
        canvas.text(
            &t.label,
            (rect.x - gap, py),
            TextFormat::new(style::TICK_PT).anchor(HPos::Right, VPos::Center),
        )?;
    }
    let room = insets(panel, rect.w, rect.h);
    let base = rect.bottom() + room.bottom - units(DESCENT_PT);
    if across {
        let wide = rect.w + 2 * (room.right + units(style::MARGIN_PT));
        let how = title_format(&panel.x.title, wide);
        canvas.text(&panel.x.title, (rect.x + rect.w / 2, base), how)?;
    }
    if !up {
        return Ok(());
    }
    let left = rect.x - room.left + units(CAP_HEIGHT * style::LABEL_PT);
    let high = rect.h + 2 * (room.top.min(room.bottom) + units(style::MARGIN_PT));
    let how = title_format(&panel.y.title, high).upwards();
    canvas.text(&panel.y.title, (left, rect.y + rect.h / 2), how)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_short_axis_has_two_labels_and_a_long_title_fits() {
        let axis = Axis::linear("", 0.3, 1.9);
        assert!(y_ticks(&axis, span(&axis), units(25.0)).major.len() >= 2);
        // Five would touch on an axis that is three letters high.
        let axis = Axis::linear("", -0.42, 0.42);
        let few = y_ticks(&axis, span(&axis), units(3.0 * style::TICK_PT));
        let labels: Vec<&str> = few.major.iter().map(|tick| tick.label.as_str()).collect();
        assert!((2..=3).contains(&labels.len()), "{labels:?}");
        let (title, room) = ("the height above the table (mm)", units(40.0));
        let small = title_format(title, room).size;
        assert!(small < style::LABEL_PT && (text_width(title, small) - room).abs() <= 1);
        assert_eq!(title_format("*x*", room).size, style::LABEL_PT);
    }
}
