//! Layout of a sheet: heading, warning, panels, legend, small print.

use plotters::style::text_anchor::{HPos, VPos};

use super::RenderError;
use super::backend::SceneBackend;
use super::canvas::{Canvas, Rect, TextFormat};
use super::font::{CAP_HEIGHT, FontFace};
use super::plane::{self, Insets};
use super::rich_text;
use super::scene::{DPI, Scene, UNITS_PER_PIXEL, UNITS_PER_POINT, units};
use super::sheet::{Colour, ColumnWidth, Content, LegendEntry, Sheet, SheetPanel};
use super::space;
use super::style;

/// Width of a sheet in pixels.
pub fn width_px(width: ColumnWidth) -> u32 {
    let millimetres = match width {
        ColumnWidth::Single => 86,
        ColumnWidth::Wide => 102,
    };
    (millimetres * DPI * 10 + 127) / 254
}

struct SheetLayout {
    canvas_height: i32,
    heading: Vec<(String, f64, bool, i32)>,
    banner: Option<(Vec<String>, Rect)>,
    /// For each panel, its drawing area and the baseline of its title.
    panels: Vec<(Rect, i32)>,
    legend: Vec<(Vec<LegendEntry>, i32)>,
    footer: Vec<(String, i32)>,
}

impl SheetLayout {
    fn height_px(&self) -> u32 {
        (self.canvas_height as u32).div_ceil(UNITS_PER_PIXEL as u32)
    }
}

fn width_units(sheet: &Sheet) -> i32 {
    width_px(sheet.width) as i32 * UNITS_PER_PIXEL
}

/// The height of a sheet's picture.
pub fn height_px(sheet: &Sheet) -> u32 {
    plan(sheet, width_units(sheet)).height_px()
}

/// Draws a sheet.
pub fn draw(sheet: &Sheet) -> Result<Scene, RenderError> {
    let width = width_units(sheet);
    let plan = plan(sheet, width);
    let mut scene = Scene::new(width_px(sheet.width), plan.height_px());
    let canvas = Canvas::new(SceneBackend::new(&mut scene));
    let margin = units(style::MARGIN_PT);
    for (text, size, bold, baseline) in &plan.heading {
        let how = TextFormat::new(*size).anchor(HPos::Center, VPos::Bottom);
        canvas.text(text, (width / 2, *baseline), if *bold { how.bold() } else { how })?;
    }
    if let Some((lines, rect)) = &plan.banner {
        canvas.fill(*rect, style::VERMILLION, 100)?;
        for (i, line) in lines.iter().enumerate() {
            let leading = units(style::BANNER_PT * style::LEADING);
            let middle =
                rect.y + rect.h / 2 + leading * i as i32 - leading * (lines.len() as i32 - 1) / 2;
            let how = TextFormat::new(style::BANNER_PT)
                .bold()
                .colour(style::WHITE)
                .anchor(HPos::Center, VPos::Center);
            canvas.text(line, (width / 2, middle), how)?;
        }
    }
    for (panel, (rect, baseline)) in sheet.panels.iter().zip(&plan.panels) {
        let label_how = TextFormat::new(style::LABEL_PT).bold();
        canvas.text(&panel.label, (rect.x, *baseline), label_how)?;
        for line in panel_heading(panel, rect.w) {
            let how = TextFormat::new(line.size).colour(line.colour);
            canvas.text(&line.text, (rect.x + line.indent, baseline + line.below), how)?;
        }
        match &panel.content {
            Content::Plane(p) => plane::draw(&canvas, p, *rect)?,
            Content::Space(p) => space::draw(&canvas, p, *rect)?,
            Content::Blank => {}
        }
    }
    for (row, middle) in &plan.legend {
        canvas.legend_row(row, margin, width - 2 * margin, *middle)?;
    }
    for (line, baseline) in &plan.footer {
        canvas.text(
            line,
            (margin, *baseline),
            TextFormat::new(style::FOOTER_PT).colour(style::SOFT_INK),
        )?;
    }
    drop(canvas);
    Ok(scene)
}

fn plan(sheet: &Sheet, width: i32) -> SheetLayout {
    let margin = units(style::MARGIN_PT);
    let inner = width - 2 * margin;
    let mut y = margin;
    let mut heading = Vec::new();
    for (text, size, bold) in
        [(&sheet.title, style::TITLE_PT, true), (&sheet.subtitle, style::LABEL_PT, false)]
    {
        let Some(text) = text else { continue };
        let face = if bold { FontFace::Bold } else { FontFace::Regular };
        for line in rich_text::wrap(text, face, size, f64::from(inner) / f64::from(UNITS_PER_POINT))
        {
            heading.push((line, size, bold, y + units(size * 0.8)));
            y += units(size * style::LEADING);
        }
    }
    if !heading.is_empty() {
        y += units(3.0);
    }
    let banner = sheet.banner.as_ref().map(|text| {
        let limit = f64::from(inner - units(8.0)) / f64::from(UNITS_PER_POINT);
        let lines = rich_text::wrap(text, FontFace::Bold, style::BANNER_PT, limit);
        let h = units(style::BANNER_PT * style::LEADING) * lines.len() as i32 + units(4.0);
        let rect = Rect { x: margin, y, w: inner, h };
        y += h + units(5.0);
        (lines, rect)
    });
    let panels = plan_panels(sheet, inner, margin, &mut y);
    let mut legend = Vec::new();
    if !sheet.legend.is_empty() {
        y += units(4.0);
        let leading = units(style::TICK_PT * 1.4);
        for row in Canvas::legend_rows(&sheet.legend, inner) {
            legend.push((row, y + leading / 2));
            y += leading;
        }
    }
    let mut footer = Vec::new();
    if !sheet.footer.is_empty() {
        y += units(4.0);
        let limit = f64::from(inner) / f64::from(UNITS_PER_POINT);
        for line in sheet
            .footer
            .iter()
            .flat_map(|l| rich_text::wrap(l, FontFace::Regular, style::FOOTER_PT, limit))
        {
            footer.push((line, y + units(style::FOOTER_PT * 0.8)));
            y += units(style::FOOTER_PT * style::LEADING);
        }
    }
    SheetLayout { canvas_height: y + margin, heading, banner, panels, legend, footer }
}

/// A line of a panel's heading.
struct HeadingLine {
    text: String,
    size: f64,
    colour: Colour,
    /// Distance from the panel's left edge.
    indent: i32,
    /// Distance below the first baseline.
    below: i32,
}

/// The title of a panel beside its label and the notes below, broken at the panel's width.
fn panel_heading(panel: &SheetPanel, width: i32) -> Vec<HeadingLine> {
    let points = |units: i32| f64::from(units) / f64::from(UNITS_PER_POINT);
    let label = rich_text::width(&panel.label, FontFace::Bold, style::LABEL_PT);
    let indent = if panel.label.is_empty() { 0 } else { units(label + 4.0) };
    let mut lines: Vec<HeadingLine> = Vec::new();
    let parts = std::iter::once((&panel.title, style::LABEL_PT, style::INK, indent))
        .chain(panel.notes.iter().map(|note| (note, style::FOOTER_PT, style::SOFT_INK, 0)));
    for (text, size, colour, indent) in parts.filter(|part| !part.0.is_empty()) {
        for text in rich_text::wrap(text, FontFace::Regular, size, points(width - indent)) {
            let below = match lines.last() {
                Some(last) => last.below + units(size * style::LEADING),
                // Notes without a title stand below the label.
                None if indent == 0 && !panel.label.is_empty() => units(size * style::LEADING),
                None => 0,
            };
            lines.push(HeadingLine { text, size, colour, indent, below });
        }
    }
    lines
}

fn title_height(panel: &SheetPanel, width: i32) -> i32 {
    let last = panel_heading(panel, width).last().map(|line| line.below);
    let below = if panel.label.is_empty() { last } else { last.or(Some(0)) };
    below.map_or(0, |below| below + units(CAP_HEIGHT * style::LABEL_PT + 4.5))
}

fn content_insets(panel: &SheetPanel, w: i32, h: i32) -> Insets {
    match &panel.content {
        Content::Plane(p) => plane::insets(p, w, h),
        Content::Space(_) | Content::Blank => Insets::default(),
    }
}

/// Height of a panel's drawing area at a width.
fn height(panel: &SheetPanel, sheet: &Sheet, w: i32) -> i32 {
    let at = |aspect: f64| (f64::from(w) * aspect).round() as i32;
    match &panel.content {
        Content::Plane(p) => at(plane::natural_aspect(p).unwrap_or(sheet.panel_aspect)),
        Content::Space(p) => match p.aspect {
            Some(aspect) => at(aspect),
            // A box is given no more height than it can use.
            None => space::natural_height(p, w, at(sheet.panel_aspect)),
        },
        Content::Blank => 0,
    }
}

/// The smallest width of a drawing area.
const SMALLEST_PT: f64 = 20.0;

/// The width of a drawing area, and the room that each column of panels needs beside it.
#[derive(Default)]
struct Widths {
    w: i32,
    left: Vec<i32>,
    right: Vec<i32>,
}

/// The widths of so many panels in a row, if there is room for them.
fn widths(sheet: &Sheet, inner: i32, columns: usize) -> Option<Widths> {
    let gutter = units(style::GUTTER_PT);
    let rows: Vec<&[SheetPanel]> = sheet.panels.chunks(columns).collect();
    // Tick labels depend on the size of the drawing area and that on the room for tick labels: two
    // rounds settle it.
    let mut w = (inner - gutter * (columns as i32 - 1)) / columns as i32 - units(28.0);
    let mut left = vec![0; columns];
    let mut right = vec![0; columns];
    for _ in 0..2 {
        left.fill(0);
        right.fill(0);
        for row in &rows {
            for (c, panel) in row.iter().enumerate() {
                let i = content_insets(panel, w, height(panel, sheet, w));
                left[c] = left[c].max(i.left);
                right[c] = right[c].max(i.right);
            }
        }
        let taken: i32 = left.iter().chain(&right).sum();
        w = (inner - gutter * (columns as i32 - 1) - taken) / columns as i32;
        if w < units(SMALLEST_PT) && columns > 1 {
            return None;
        }
        w = w.max(units(SMALLEST_PT));
    }
    Some(Widths { w, left, right })
}

fn plan_panels(sheet: &Sheet, inner: i32, margin: i32, y: &mut i32) -> Vec<(Rect, i32)> {
    let panels = sheet.panels.len().max(1);
    let most = sheet.columns.clamp(1, panels);
    let fit = (1..=most).rev().find(|columns| widths(sheet, inner, *columns).is_some());
    // Panels for which there is no room stand in further rows, as many in each.
    let columns = match fit {
        Some(fit) if fit < most => panels.div_ceil(panels.div_ceil(fit)),
        _ => most,
    };
    let Widths { w, left, right } = widths(sheet, inner, columns).unwrap_or_default();
    let gutter = units(style::GUTTER_PT);
    let rows: Vec<&[SheetPanel]> = sheet.panels.chunks(columns).collect();
    let mut places = Vec::new();
    for (r, row) in rows.iter().enumerate() {
        let h = row.iter().map(|p| height(p, sheet, w)).max().unwrap_or(0);
        let inset = |f: fn(Insets) -> i32| {
            row.iter().map(|p| f(content_insets(p, w, h))).max().unwrap_or(0)
        };
        let title = row.iter().map(|p| title_height(p, w)).max().unwrap_or(0);
        if r > 0 {
            *y += units(7.0);
        }
        let baseline = *y + units(CAP_HEIGHT * style::LABEL_PT);
        *y += title + if title > 0 { 0 } else { inset(|i| i.top) };
        let mut x = margin;
        for c in 0..row.len() {
            x += left[c];
            places.push((Rect { x, y: *y, w, h }, baseline));
            x += w + right[c] + gutter;
        }
        *y += h + inset(|i| i.bottom);
    }
    places
}

/// Every text of a sheet, so that faulty markup is found before anything is drawn.
pub fn check_texts(sheet: &Sheet) -> Result<(), RenderError> {
    let mut texts: Vec<&str> = Vec::new();
    texts.extend(
        sheet
            .title
            .iter()
            .chain(&sheet.subtitle)
            .chain(&sheet.banner)
            .chain(&sheet.footer)
            .map(String::as_str),
    );
    texts.extend(sheet.legend.iter().map(|e| e.text.as_str()));
    for panel in &sheet.panels {
        texts.extend([panel.label.as_str(), panel.title.as_str()]);
        texts.extend(panel.notes.iter().map(String::as_str));
        match &panel.content {
            Content::Plane(p) => {
                texts.extend([p.x.title.as_str(), p.y.title.as_str()]);
                texts.extend(p.legend.iter().map(|e| e.text.as_str()));
                texts.extend(p.layers.iter().filter_map(|l| match l {
                    super::sheet::PlaneLayer::Note(n) => Some(n.text.as_str()),
                    _ => None,
                }));
            }
            Content::Space(p) => {
                texts.extend(p.axes.iter().map(|a| a.title.as_str()));
                texts.extend(p.legend.iter().map(|e| e.text.as_str()));
                texts.extend(p.layers.iter().filter_map(|l| match l {
                    super::sheet::SpaceLayer::Note(n) => Some(n.text.as_str()),
                    _ => None,
                }));
            }
            Content::Blank => {}
        }
    }
    for text in texts {
        rich_text::set(text, FontFace::Regular)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sheet::{Axis, ColumnWidth, PlanePanel};

    #[test]
    fn panels_without_room_in_a_row_stand_below() {
        let rows = |columns: usize, value: f64| {
            let mut sheet = Sheet::new(ColumnWidth::Wide, columns, "");
            for _ in 0..6 {
                let axis = || Axis::linear("*x*", -value, value);
                sheet = sheet.panel("", "", PlanePanel::new(axis(), axis()));
            }
            let (inner, margin) = (units(270.0), units(6.0));
            let places = plan_panels(&sheet, inner, margin, &mut 0);
            assert!(places.iter().all(|(r, _)| r.x >= margin && r.x + r.w <= margin + inner));
            let mut rows: Vec<i32> = places.iter().map(|(r, _)| r.y).collect();
            rows.dedup();
            rows.len()
        };
        assert_eq!((rows(6, 0.025), rows(3, 0.025), rows(2, 0.025)), (2, 2, 3));
    }
}
