//! Charts in space: orthographic projection, box, surfaces, and curves ordered by depth.
//!
//! Visibility is decided by a depth buffer of the surfaces alone: a curve is cut into the parts in
//! front of every surface and the parts behind one. Drawn are the far faces of the box, the hidden
//! parts, the surfaces (translucent), the visible parts, and on top markers and text. Within each
//! set, curves are drawn from far to near and faded towards the far side.

use plotters::style::text_anchor::{HPos, VPos};

use super::RenderError;
use super::canvas::{Canvas, Chart, Rect, Span, THINNING, TextFormat, text_width};
use super::font::CAP_HEIGHT;
use super::plane;
use super::polyline;
use super::scene::{UNITS_PER_POINT, units};
use super::sheet::{Colour, LineStyle, Patch, SpaceLayer, SpacePanel};
use super::style;
use super::ticks::{self, Tick};
use twofold_num::elementary;

/// A point seen by the camera: right, up, and towards the viewer.
type Seen = [f64; 3];

struct Camera {
    right: [f64; 3],
    up: [f64; 3],
    towards: [f64; 3],
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

impl Camera {
    fn new(azimuth: f64, elevation: f64) -> Self {
        let radians = std::f64::consts::PI / 180.0;
        let (a, e) = (azimuth * radians, elevation * radians);
        let (sa, ca) = (elementary::sin(a), elementary::cos(a));
        let (se, ce) = (elementary::sin(e), elementary::cos(e));
        Self {
            right: [-sa, ca, 0.0],
            up: [-se * ca, -se * sa, ce],
            towards: [ce * ca, ce * sa, se],
        }
    }

    fn see(&self, p: [f64; 3]) -> Seen {
        [dot(p, self.right), dot(p, self.up), dot(p, self.towards)]
    }
}

/// The box: data to coordinates centred on the origin whose extents are the panel's proportions.
struct Bounds {
    spans: [Span; 3],
    size: [f64; 3],
    camera: Camera,
}

impl Bounds {
    fn new(panel: &SpacePanel) -> Self {
        let longest = panel.proportions.iter().copied().fold(0.0, f64::max);
        Self {
            spans: [0, 1, 2].map(|i| plane::span(&panel.axes[i])),
            size: panel.proportions.map(|p| p / longest),
            camera: Camera::new(panel.azimuth, panel.elevation),
        }
    }

    fn lower(&self) -> [f64; 3] {
        self.spans.map(|s| s.lower)
    }

    fn upper(&self) -> [f64; 3] {
        self.spans.map(|s| s.upper)
    }

    fn see(&self, p: [f64; 3]) -> Seen {
        self.camera.see(std::array::from_fn(|i| {
            let s = self.spans[i];
            self.size[i] * ((p[i] - s.lower) / (s.upper - s.lower) - 0.5)
        }))
    }

    /// A corner of the box; each entry says whether the upper end of that axis is meant.
    fn corner(&self, upper: [bool; 3]) -> Seen {
        self.camera.see(std::array::from_fn(|i| self.size[i] * if upper[i] { 0.5 } else { -0.5 }))
    }

    /// Half the box's extent towards the viewer.
    fn depth(&self) -> f64 {
        (0..3).map(|i| 0.5 * self.size[i] * self.camera.towards[i].abs()).sum()
    }
}

/// An edge of the box that carries ticks.
struct TickedEdge {
    axis: usize,
    /// Ends of the other two axes that it lies at (the entry of its own axis is unused).
    at: [bool; 3],
    ticks: Vec<Tick>,
    /// Direction on the sheet (right, down) in which ticks and labels stand off.
    out: [f64; 2],
}

fn corners() -> impl Iterator<Item = [bool; 3]> {
    (0..8).map(|k| [k & 1 > 0, k & 2 > 0, k & 4 > 0])
}

/// The three edges that carry ticks: both horizontal axes along the lower rim nearest the viewer,
/// the upright one at the left.
fn ticked_edges(bounds: &Bounds, scale: f64) -> Vec<TickedEdge> {
    let towards = bounds.camera.towards;
    // Seen from below, the lower rim that is in front of nothing is the far one.
    let below = towards[2] < 0.0;
    let rim = |own: usize, other: usize| {
        let mut at = [false; 3];
        at[other] = (towards[other] > 0.0) != below;
        (own, at)
    };
    let upright = {
        let candidates = [[false, false], [true, false], [true, true], [false, true]];
        let mut best = ([false; 3], f64::INFINITY);
        for c in candidates {
            let at = [c[0], c[1], false];
            let x = bounds.corner(at)[0];
            if x < best.1 - 1e-9 {
                best = (at, x);
            }
        }
        (2, best.0)
    };
    [rim(0, 1), rim(1, 0), upright]
        .into_iter()
        .map(|(axis, at)| {
            let (a, b) = edge_ends(bounds, axis, at);
            let (dx, dy) = (b[0] - a[0], -(b[1] - a[1]));
            let length = (dx * dx + dy * dy).sqrt();
            // Perpendicular to the edge, away from the box's centre; nearly vertical edges get
            // labels beside them.
            let mut out = if length > 1e-9 { [dy / length, -dx / length] } else { [0.0, 1.0] };
            let middle = [0.5 * (a[0] + b[0]), -0.5 * (a[1] + b[1])];
            if out[0] * middle[0] + out[1] * middle[1] < 0.0 {
                out = [-out[0], -out[1]];
            }
            let spacing =
                if axis == 2 { style::TICK_SPACING_Y_PT } else { 1.2 * style::TICK_SPACING_X_PT };
            let wanted = (length * scale / (spacing * f64::from(UNITS_PER_POINT))).max(1.8);
            let s = bounds.spans[axis];
            TickedEdge { axis, at, ticks: ticks::linear(s.lower, s.upper, wanted).major, out }
        })
        .collect()
}

fn edge_ends(bounds: &Bounds, axis: usize, at: [bool; 3]) -> (Seen, Seen) {
    let (mut low, mut high) = (at, at);
    (low[axis], high[axis]) = (false, true);
    (bounds.corner(low), bounds.corner(high))
}

struct Label {
    text: String,
    size: f64,
    rect: Rect,
}

/// Places of all labels around the box, in units relative to the box's centre, at a scale of units
/// per unit length.
fn labels(panel: &SpacePanel, bounds: &Bounds, scale: f64) -> Vec<Label> {
    let mut labels: Vec<Label> = Vec::new();
    let edges = ticked_edges(bounds, scale);
    let mut titles = Vec::new();
    for edge in &edges {
        let (a, b) = edge_ends(bounds, edge.axis, edge.at);
        let s = bounds.spans[edge.axis];
        let mut reach = 0.0f64;
        for t in &edge.ticks {
            let share = (t.value - s.lower) / (s.upper - s.lower);
            let p =
                [a[0] + share * (b[0] - a[0]), -(a[1] + share * (b[1] - a[1]))].map(|v| v * scale);
            let (rect, far) =
                label_rect(p, edge.out, &t.label, style::TICK_PT, style::TICK_LENGTH_PT + 2.0);
            // Two numbers side by side must not read as one.
            let pad = units(3.0);
            let padded = Rect { x: rect.x - pad, w: rect.w + 2 * pad, ..rect };
            if labels.iter().any(|l| l.rect.overlaps(padded)) {
                continue;
            }
            reach = reach.max(far);
            labels.push(Label { text: t.label.clone(), size: style::TICK_PT, rect });
        }
        titles.push((edge, 0.5 * (a[0] + b[0]) * scale, -0.5 * (a[1] + b[1]) * scale, reach));
    }
    for (edge, x, y, reach) in titles {
        let text = &panel.axes[edge.axis].title;
        if !text.is_empty() {
            let beyond = reach / f64::from(UNITS_PER_POINT) + 3.0;
            let (rect, _) = label_rect([x, y], edge.out, text, style::LABEL_PT, beyond);
            labels.push(Label { text: text.clone(), size: style::LABEL_PT, rect });
        }
    }
    labels
}

/// The rectangle of a text that stands off a point by `gap` points in direction `out`, and how far
/// it reaches in that direction.
fn label_rect(p: [f64; 2], out: [f64; 2], text: &str, size: f64, gap: f64) -> (Rect, f64) {
    let (w, h) = (f64::from(text_width(text, size)), f64::from(units(CAP_HEIGHT * size)));
    // The centre lies so far out that the near side of the rectangle touches the gap.
    let half = 0.5 * (w * out[0].abs() + h * out[1].abs());
    let distance = f64::from(units(gap)) + half;
    let (cx, cy) = (p[0] + out[0] * distance, p[1] + out[1] * distance);
    let rect = Rect {
        x: (cx - w / 2.0).round() as i32,
        y: (cy - h / 2.0).round() as i32,
        w: w as i32,
        h: h as i32,
    };
    (rect, distance + half)
}

/// Draws a panel into a rectangle.
pub fn draw(canvas: &Canvas, panel: &SpacePanel, rect: Rect) -> Result<(), RenderError> {
    let bounds = Bounds::new(panel);
    let (scale, centre) = fit(panel, &bounds, rect);
    let origin = [f64::from(centre.0), f64::from(centre.1)];
    // The chart's coordinates are those of the projected box, equally scaled; its rectangle is the
    // panel's.
    let x = Span {
        lower: (f64::from(rect.x) - origin[0]) / scale,
        upper: (f64::from(rect.right()) - origin[0]) / scale,
    };
    let y = Span {
        lower: (origin[1] - f64::from(rect.bottom())) / scale,
        upper: (origin[1] - f64::from(rect.y)) / scale,
    };
    let mut chart = canvas.chart(rect, x, y)?;
    if panel.boxed {
        draw_box(canvas, &mut chart, &bounds, scale)?;
    }
    let buffer = DepthBuffer::new(panel, &bounds, &chart);
    let curves = cut_curves(panel, &bounds, &chart, &buffer, scale);
    draw_curves(&mut chart, &curves, true)?;
    draw_surfaces(&mut chart, panel, &bounds)?;
    draw_curves(&mut chart, &curves, false)?;
    for layer in &panel.layers {
        match layer {
            SpaceLayer::Line { points, style, arrow: true } => {
                let seen: Vec<_> = points
                    .iter()
                    .filter(|p| p.iter().all(|v| v.is_finite()))
                    .map(|p| bounds.see(*p))
                    .map(|s| chart.position(&[s[0], s[1]]))
                    .collect();
                canvas.arrow_head(&seen, style)?;
            }
            SpaceLayer::Markers { points, style } => {
                for p in points.iter().filter(|p| p.iter().all(|v| v.is_finite())) {
                    let s = bounds.see(*p);
                    canvas.marker(chart.position(&[s[0], s[1]]), style)?;
                }
            }
            SpaceLayer::Note(note) if note.at.iter().all(|v| v.is_finite()) => {
                let s = bounds.see(note.at);
                canvas.note(note, chart.position(&[s[0], s[1]]))?;
            }
            _ => {}
        }
    }
    if panel.boxed {
        for label in labels(panel, &bounds, scale) {
            let at = (
                centre.0 + label.rect.x + label.rect.w / 2,
                centre.1 + label.rect.y + label.rect.h / 2,
            );
            canvas.text(
                &label.text,
                at,
                TextFormat::new(label.size).anchor(HPos::Center, VPos::Center),
            )?;
        }
    }
    canvas.legend(&panel.legend, rect, panel.legend_corner)
}

/// Height in units that a panel needs at a width, at most `highest`: that of the box with its
/// labels.
pub fn natural_height(panel: &SpacePanel, width: i32, highest: i32) -> i32 {
    let bounds = Bounds::new(panel);
    let rect = Rect { x: 0, y: 0, w: width, h: highest };
    let e = extent(panel, &bounds, fit(panel, &bounds, rect).0);
    // Rounding of the labels' places may move them by a unit.
    ((e[3] - e[1]).ceil() as i32 + 4).min(highest)
}

/// Left, upper, right and lower end of the box with its labels, or of what is drawn if there is no
/// box, relative to the box's centre, in units.
fn extent(panel: &SpacePanel, bounds: &Bounds, scale: f64) -> [f64; 4] {
    let mut e = [f64::INFINITY, f64::INFINITY, f64::NEG_INFINITY, f64::NEG_INFINITY];
    let mut add = |x: f64, y: f64| e = [e[0].min(x), e[1].min(y), e[2].max(x), e[3].max(y)];
    let mut rects: Vec<Rect> = Vec::new();
    if panel.boxed {
        for s in corners().map(|c| bounds.corner(c)) {
            add(s[0] * scale, -s[1] * scale);
        }
        rects.extend(labels(panel, bounds, scale).into_iter().map(|l| l.rect));
    } else {
        for layer in &panel.layers {
            let corners = match layer {
                SpaceLayer::Surface { patches, .. } => patches.as_slice(),
                _ => &[],
            };
            let corners = corners.iter().flat_map(|patch| &patch.corners);
            for p in layer.positions().iter().chain(corners) {
                let s = bounds.see(*p);
                let place = [s[0] * scale, -s[1] * scale];
                add(place[0], place[1]);
                if let SpaceLayer::Note(note) = layer {
                    rects.push(Canvas::note_rect(note, (place[0] as i32, place[1] as i32)));
                }
            }
        }
    }
    for rect in rects {
        add(f64::from(rect.x), f64::from(rect.y));
        add(f64::from(rect.right()), f64::from(rect.bottom()));
    }
    e
}

/// Scale (units per unit length) and centre at which the box with its labels fills the rectangle.
fn fit(panel: &SpacePanel, bounds: &Bounds, rect: Rect) -> (f64, (i32, i32)) {
    // Labels keep their size while the box grows, so the largest scale is found by bisection.
    let (w, h) = (f64::from(rect.w), f64::from(rect.h));
    let (mut low, mut high) = (1.0, 4.0 * (w + h));
    for _ in 0..24 {
        let middle = 0.5 * (low + high);
        let e = extent(panel, bounds, middle);
        if e[2] - e[0] <= w && e[3] - e[1] <= h {
            low = middle;
        } else {
            high = middle;
        }
    }
    let e = extent(panel, bounds, low);
    let x = f64::from(rect.x) + 0.5 * (w - (e[0] + e[2]));
    let y = f64::from(rect.y) + 0.5 * (h - (e[1] + e[3]));
    (low, (x.round() as i32, y.round() as i32))
}

/// Far faces with their grid, their edges, and the ticks.
fn draw_box(
    canvas: &Canvas,
    chart: &mut Chart,
    bounds: &Bounds,
    scale: f64,
) -> Result<(), RenderError> {
    let far = bounds.camera.towards.map(|t| t <= 0.0);
    let flat = |s: Seen| [s[0], s[1]];
    for (axis, end) in far.into_iter().enumerate() {
        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
        let face: Vec<[f64; 2]> = [(false, false), (true, false), (true, true), (false, true)]
            .iter()
            .map(|(a, b)| {
                let mut c = [end; 3];
                (c[u], c[v]) = (*a, *b);
                flat(bounds.corner(c))
            })
            .collect();
        chart.area(&face, style::PANE, 100)?;
    }
    let edges = ticked_edges(bounds, scale);
    let grid = LineStyle::new(style::GRID, style::GRID_PT);
    for edge in &edges {
        let (axis, s) = (edge.axis, bounds.spans[edge.axis]);
        for t in &edge.ticks {
            // A grid line runs over both far faces that contain this axis's direction.
            let at = |u: f64, v: f64| {
                let mut p = [0.0; 3];
                let (i, j) = ((axis + 1) % 3, (axis + 2) % 3);
                p[axis] = bounds.size[axis] * ((t.value - s.lower) / (s.upper - s.lower) - 0.5);
                p[i] = bounds.size[i] * u;
                p[j] = bounds.size[j] * v;
                flat(bounds.camera.see(p))
            };
            let end = |k: usize| if far[k] { 0.5 } else { -0.5 };
            let (u, v) = (end((axis + 1) % 3), end((axis + 2) % 3));
            chart.thinned_line(&[at(-u, v), at(u, v), at(u, -v)], &grid)?;
        }
    }
    // Edges of the far faces, lightly; those with ticks as an axis.
    let light = LineStyle::new(style::FAINT, style::GRID_PT);
    for axis in 0..3 {
        for (a, b) in [(false, false), (true, false), (true, true), (false, true)] {
            let mut at = [false; 3];
            (at[(axis + 1) % 3], at[(axis + 2) % 3]) = (a, b);
            let on_far = (0..3).filter(|i| *i != axis).any(|i| at[i] == far[i]);
            if on_far {
                let (p, q) = edge_ends(bounds, axis, at);
                chart.thinned_line(&[flat(p), flat(q)], &light)?;
            }
        }
    }
    for edge in &edges {
        let (p, q) = edge_ends(bounds, edge.axis, edge.at);
        chart
            .thinned_line(&[flat(p), flat(q)], &LineStyle::new(style::SOFT_INK, style::FRAME_PT))?;
        let s = bounds.spans[edge.axis];
        for t in &edge.ticks {
            let share = (t.value - s.lower) / (s.upper - s.lower);
            let from =
                chart.position(&[p[0] + share * (q[0] - p[0]), p[1] + share * (q[1] - p[1])]);
            let length = f64::from(units(style::TICK_LENGTH_PT));
            let to = (
                from.0 + (edge.out[0] * length).round() as i32,
                from.1 + (edge.out[1] * length).round() as i32,
            );
            canvas.line(&[from, to], style::SOFT_INK, style::FRAME_PT)?;
        }
    }
    Ok(())
}

/// A patch as the camera sees it, cut off at the box.
fn seen_patch(patch: &Patch, bounds: &Bounds) -> Vec<Seen> {
    polyline::clip_polygon(&patch.corners, bounds.lower(), bounds.upper())
        .into_iter()
        .map(|p| bounds.see(p))
        .collect()
}

/// Surfaces, far regions first. Patches of one colour are filled together, so that no seams show
/// between them.
fn draw_surfaces(
    chart: &mut Chart,
    panel: &SpacePanel,
    bounds: &Bounds,
) -> Result<(), RenderError> {
    for layer in &panel.layers {
        let SpaceLayer::Surface { patches, opacity } = layer else { continue };
        let mut regions: Vec<(Colour, f64, f64, Vec<Vec<Seen>>)> = Vec::new();
        for patch in patches {
            let seen = seen_patch(patch, bounds);
            if seen.len() < 3 {
                continue;
            }
            let depth = seen.iter().map(|s| s[2]).sum::<f64>() / seen.len() as f64;
            match regions.iter_mut().find(|r| r.0 == patch.colour) {
                Some(r) => {
                    r.1 += depth;
                    r.2 += 1.0;
                    r.3.push(seen);
                }
                None => regions.push((patch.colour, depth, 1.0, vec![seen])),
            }
        }
        regions.sort_by(|a, b| (a.1 / a.2).total_cmp(&(b.1 / b.2)));
        for (colour, _, _, polygons) in regions {
            for polygon in polygons {
                let flat: Vec<[f64; 2]> = polygon.iter().map(|s| [s[0], s[1]]).collect();
                chart.area(&flat, colour, *opacity)?;
            }
        }
    }
    Ok(())
}

/// For each cell of a raster over the panel, the depth of the nearest surface.
struct DepthBuffer {
    columns: usize,
    rows: usize,
    origin: [f64; 2],
    nearest: Vec<f32>,
}

/// Side of a raster cell in units: one pixel.
const CELL: f64 = 12.0;

impl DepthBuffer {
    fn new(panel: &SpacePanel, bounds: &Bounds, chart: &Chart) -> Self {
        let rect = chart.rect;
        let columns = (f64::from(rect.w) / CELL).ceil() as usize + 1;
        let rows = (f64::from(rect.h) / CELL).ceil() as usize + 1;
        let any = panel.layers.iter().any(|l| matches!(l, SpaceLayer::Surface { .. }));
        let mut buffer = Self {
            columns,
            rows,
            origin: [f64::from(rect.x), f64::from(rect.y)],
            nearest: vec![f32::NEG_INFINITY; if any { columns * rows } else { 0 }],
        };
        for layer in &panel.layers {
            let SpaceLayer::Surface { patches, .. } = layer else { continue };
            for patch in patches {
                let seen = seen_patch(patch, bounds);
                let corners: Vec<[f64; 3]> = seen
                    .iter()
                    .map(|s| {
                        let p = chart.place(&[s[0], s[1]]);
                        [(p[0] - buffer.origin[0]) / CELL, (p[1] - buffer.origin[1]) / CELL, s[2]]
                    })
                    .collect();
                for k in 1..corners.len().saturating_sub(1) {
                    buffer.triangle(corners[0], corners[k], corners[k + 1]);
                }
            }
        }
        buffer
    }

    fn triangle(&mut self, a: [f64; 3], b: [f64; 3], c: [f64; 3]) {
        let cross = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
        if cross == 0.0 {
            return;
        }
        let low = |i: usize| a[i].min(b[i]).min(c[i]).floor().max(0.0) as usize;
        let high =
            |i: usize, n: usize| (a[i].max(b[i]).max(c[i]).ceil().max(0.0) as usize).min(n - 1);
        for row in low(1)..=high(1, self.rows) {
            for column in low(0)..=high(0, self.columns) {
                let (x, y) = (column as f64 + 0.5, row as f64 + 0.5);
                let wb = ((x - a[0]) * (c[1] - a[1]) - (y - a[1]) * (c[0] - a[0])) / cross;
                let wc = ((b[0] - a[0]) * (y - a[1]) - (b[1] - a[1]) * (x - a[0])) / cross;
                // Slightly widened, so that cells on an edge between two patches are covered.
                if wb < -0.02 || wc < -0.02 || wb + wc > 1.02 {
                    continue;
                }
                let depth = (a[2] + wb * (b[2] - a[2]) + wc * (c[2] - a[2])) as f32;
                let cell = &mut self.nearest[row * self.columns + column];
                *cell = cell.max(depth);
            }
        }
    }

    /// Whether a point at a place on the sheet lies behind a surface; one within `margin` of it
    /// counts as in front.
    fn hides(&self, place: [f64; 2], depth: f64, margin: f64) -> bool {
        if self.nearest.is_empty() {
            return false;
        }
        let column = (place[0] - self.origin[0]) / CELL;
        let row = (place[1] - self.origin[1]) / CELL;
        if column < 0.0 || row < 0.0 || column >= self.columns as f64 || row >= self.rows as f64 {
            return false;
        }
        depth < f64::from(self.nearest[row as usize * self.columns + column as usize]) - margin
    }
}

/// A part of a curve of one look.
struct Piece {
    hidden: bool,
    level: usize,
    layer: usize,
    style: LineStyle,
    points: Vec<[f64; 2]>,
}

fn cut_curves(
    panel: &SpacePanel,
    bounds: &Bounds,
    chart: &Chart,
    buffer: &DepthBuffer,
    scale: f64,
) -> Vec<Piece> {
    let depth = bounds.depth();
    let margin = 0.004 * depth;
    let level_of = |d: f64| {
        let share = (0.5 + 0.5 * d / depth).clamp(0.0, 1.0);
        ((share * style::DEPTH_LEVELS as f64) as usize).min(style::DEPTH_LEVELS - 1)
    };
    // Long straight segments are cut so that each part has one depth class and is either hidden or
    // not.
    let step = 3.0 * CELL / scale;
    let mut pieces = Vec::new();
    for (layer, content) in panel.layers.iter().enumerate() {
        let SpaceLayer::Line { points, style, .. } = content else { continue };
        for part in polyline::clip(points, bounds.lower(), bounds.upper()) {
            let seen: Vec<Seen> = part.iter().map(|p| bounds.see(*p)).collect();
            let mut run: Vec<Seen> = vec![seen[0]];
            let mut class = None;
            let mut finish = |run: &mut Vec<Seen>, class: Option<(bool, usize)>, next: Seen| {
                if let (Some((hidden, level)), true) = (class, run.len() > 1) {
                    let thinned = polyline::thin(run, THINNING, |s| chart.place(&[s[0], s[1]]));
                    let points = thinned.iter().map(|s| [s[0], s[1]]).collect();
                    pieces.push(Piece { hidden, level, layer, style: *style, points });
                }
                *run = vec![next];
            };
            for pair in seen.windows(2) {
                let (a, b) = (pair[0], pair[1]);
                let (dx, dy) = (b[0] - a[0], b[1] - a[1]);
                let parts = (((dx * dx + dy * dy).sqrt() / step).ceil() as usize).clamp(1, 4096);
                for k in 0..parts {
                    let at = |t: f64| -> Seen { std::array::from_fn(|i| a[i] + t * (b[i] - a[i])) };
                    let to = at((k + 1) as f64 / parts as f64);
                    let middle = at((k as f64 + 0.5) / parts as f64);
                    let place = chart.place(&[middle[0], middle[1]]);
                    let here = Some((buffer.hides(place, middle[2], margin), level_of(middle[2])));
                    if class != here && run.len() > 1 {
                        let last = run[run.len() - 1];
                        finish(&mut run, class, last);
                    }
                    class = here;
                    run.push(to);
                }
            }
            let last = seen[seen.len() - 1];
            finish(&mut run, class, last);
        }
    }
    // Far to near; at one depth in the order of the layers.
    pieces.sort_by_key(|p| (p.level, p.layer));
    pieces
}

fn draw_curves(chart: &mut Chart, pieces: &[Piece], hidden: bool) -> Result<(), RenderError> {
    let of = |level: usize| pieces.iter().filter(move |p| p.level == level && p.hidden == hidden);
    for level in 0..style::DEPTH_LEVELS {
        if !hidden {
            // A white margin where a curve passes over one at least two depth classes behind makes
            // clear which is in front. It is drawn before the neighbouring class, so that it does
            // not cut into the curve's own continuation.
            for piece in of(level + 1) {
                // Thin lines have thin margins: many side by side would hide what they lie on.
                let casing = style::CASING_PT * (piece.style.width / style::CURVE_PT).min(1.0);
                let width = piece.style.width + 2.0 * casing;
                chart.thinned_line(&piece.points, &LineStyle::new(style::WHITE, width))?;
            }
        }
        for piece in of(level) {
            let share = 1.0 - (piece.level as f64 + 1.0) / style::DEPTH_LEVELS as f64;
            let mut look = piece.style;
            look.colour = look.colour.lighten(style::DEPTH_FADE * share);
            chart.thinned_line(&piece.points, &look)?;
        }
    }
    Ok(())
}
