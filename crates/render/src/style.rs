//! The look of every picture: sizes, colours, fonts and ticks, in one place.
//!
//! Lengths are in printer's points (1 pt = 1/72 inch) at the printed size of the sheet. Colours are
//! the palette of Okabe and Ito (2008), which stays distinguishable under the common forms of
//! colour blindness; the three region colours also differ in lightness, so that they can be told
//! apart in greyscale.

use super::colour::Colour;

/// Black of text and axes, and of the dark class of points.
pub const INK: Colour = Colour::rgb(0x1a, 0x1a, 0x1a);
/// Grey of secondary text and of the axis frame.
pub const SOFT_INK: Colour = Colour::rgb(0x55, 0x55, 0x55);
/// Faint grey: the early half of a section.
pub const FAINT: Colour = Colour::rgb(0xb4, 0xb4, 0xb4);
/// Grid lines on the far faces of a 3D box.
pub const GRID: Colour = Colour::rgb(0xdc, 0xdc, 0xdc);
/// The far faces themselves.
pub const PANE: Colour = Colour::rgb(0xf7, 0xf7, 0xf8);
/// Paper.
pub const WHITE: Colour = Colour::rgb(0xff, 0xff, 0xff);

/// Okabe-Ito blue.
pub const BLUE: Colour = Colour::rgb(0x00, 0x72, 0xb2);
/// Okabe-Ito vermillion.
pub const VERMILLION: Colour = Colour::rgb(0xd5, 0x5e, 0x00);
/// Okabe-Ito bluish green.
pub const GREEN: Colour = Colour::rgb(0x00, 0x9e, 0x73);
/// Okabe-Ito orange.
pub const ORANGE: Colour = Colour::rgb(0xe6, 0x9f, 0x00);
/// Okabe-Ito sky blue.
pub const SKY: Colour = Colour::rgb(0x56, 0xb4, 0xe9);
/// Okabe-Ito reddish purple.
pub const PURPLE: Colour = Colour::rgb(0xcc, 0x79, 0xa7);
/// A dark magenta that stands out of black curves: marked singularities.
pub const MAGENTA: Colour = Colour::rgb(0xb0, 0x00, 0x70);

/// Series colours in the order in which they should be used.
pub const SERIES: [Colour; 6] = [BLUE, VERMILLION, GREEN, PURPLE, ORANGE, SKY];

/// Region of the switching surface where sliding attracts (relative luminance about 0.25).
pub const ATTRACTING: Colour = Colour::rgb(0x3f, 0x84, 0xc0);
/// Region where sliding repels (relative luminance about 0.48).
pub const REPELLING: Colour = Colour::rgb(0xf3, 0xa4, 0x5c);
/// Region where orbits cross (relative luminance about 0.75).
pub const CROSSING: Colour = Colour::rgb(0xe0, 0xe0, 0xe0);
/// Opacity of shaded regions and surfaces in per cent: what lies behind stays visible, faded.
pub const SURFACE_OPACITY: u8 = 72;

/// Font size of the sheet title.
pub const TITLE_PT: f64 = 10.0;
/// Font size of subtitles, panel titles and axis titles.
pub const LABEL_PT: f64 = 9.0;
/// Font size of tick labels, legends and annotations.
pub const TICK_PT: f64 = 8.0;
/// Font size of the small print at the foot of the sheet.
pub const FOOTER_PT: f64 = 7.2;
/// Font size of the warning banner.
pub const BANNER_PT: f64 = 8.5;
/// Distance of baselines as a multiple of the font size.
pub const LEADING: f64 = 1.25;

/// Axis frame and ticks.
pub const FRAME_PT: f64 = 0.6;
/// Grid lines.
pub const GRID_PT: f64 = 0.4;
/// Default width of a curve.
pub const CURVE_PT: f64 = 0.8;
/// White margin on either side of a curve in space where it passes in front of another.
pub const CASING_PT: f64 = 0.4;
/// White margin around the letters of a note.
pub const HALO_PT: f64 = 0.9;
/// Length of a major tick.
pub const TICK_LENGTH_PT: f64 = 3.0;
/// Length of a minor tick.
pub const MINOR_TICK_LENGTH_PT: f64 = 1.7;
/// Distance between a tick and its label.
pub const TICK_GAP_PT: f64 = 2.5;
/// Distance between two major ticks that the tick placement aims for, horizontally.
pub const TICK_SPACING_X_PT: f64 = 26.0;
/// Distance between two major ticks that the tick placement aims for, vertically.
pub const TICK_SPACING_Y_PT: f64 = 21.0;
/// Margin around the sheet.
pub const MARGIN_PT: f64 = 5.0;
/// Gap between panels.
pub const GUTTER_PT: f64 = 12.0;
/// Diameter of a marker (filled dot, open dot, cross, star).
pub const MARKER_PT: f64 = 5.0;
/// Length of an arrow head.
pub const ARROW_PT: f64 = 5.0;
/// Dashes and gaps of a dashed line.
pub const DASH_PT: (f64, f64) = (3.2, 2.2);
/// Dots and gaps of a dotted line.
pub const DOTTED_PT: (f64, f64) = (0.05, 2.0);

/// Diameter of a point by how many distinguishable places (cells of half a point) its layer
/// occupies: few points are drawn large enough to be found at a glance, many small enough to show
/// structure. Pairs (at most this many places, diameter).
pub const DOT_DIAMETER_PT: [(usize, f64); 6] =
    [(16, 4.2), (80, 2.2), (300, 1.5), (1_500, 1.15), (6_000, 0.8), (usize::MAX, 0.55)];
/// Number of places above which a layer is shaded by density, if it asks for that.
pub const DENSITY_FROM: usize = 1_500;
/// Number of lightness steps of density shading.
pub const DENSITY_LEVELS: usize = 6;
/// Share of white mixed into the least dense points under density shading.
pub const DENSITY_LIGHTEST: f64 = 0.45;
/// Number of depth classes of a 3D curve.
pub const DEPTH_LEVELS: usize = 8;
/// Share of white mixed into the farthest part of a 3D curve.
pub const DEPTH_FADE: f64 = 0.55;
