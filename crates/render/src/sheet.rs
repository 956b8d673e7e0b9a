//! A picture as plain data: what is drawn, with no knowledge of models and none of file formats.
//!
//! A [`Sheet`] is a grid of panels at the printed width of a journal column. Every text is rich
//! text (see `rich_text`): `*x*` is italic, `10^{-3}` a superscript, `v_{+}` a subscript.

pub use super::colour::Colour;
use super::style;

/// Printed width of a sheet.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ColumnWidth {
    /// One column, 8.6 cm.
    Single,
    /// 10.2 cm: reduced to a column of 8.5 cm, its smallest letters are 6 points high.
    Wide,
}

/// A whole picture.
#[derive(Clone, Debug)]
pub struct Sheet {
    /// Printed width.
    pub width: ColumnWidth,
    /// Heading, if any.
    pub title: Option<String>,
    /// Second line of the heading, if any.
    pub subtitle: Option<String>,
    /// Number of panels in a row.
    pub columns: usize,
    /// Panels, row by row.
    pub panels: Vec<SheetPanel>,
    /// Height of a panel's drawing area divided by its width, for panels that do not fix it
    /// themselves.
    pub panel_aspect: f64,
    /// Legend shared by all panels, set in one row below them.
    pub legend: Vec<LegendEntry>,
    /// Small print: the parameters. Long lines are wrapped.
    pub footer: Vec<String>,
    /// A visible warning above the panels, such as a shortened run.
    pub banner: Option<String>,
    /// Description of the picture, for readers who cannot see it.
    pub description: String,
    /// Provenance of the picture, as ordered (key, value) pairs; written into each file, not drawn.
    pub provenance: Vec<(String, String)>,
    /// Whether the SVG file says its words a second time as invisible text, which programs can
    /// search and copy. Outlines alone need no font anywhere and are the default; the PDF file
    /// always has its words.
    pub searchable_svg: bool,
}

impl Sheet {
    /// An empty sheet with so many panels in a row.
    pub fn new(width: ColumnWidth, columns: usize, description: impl Into<String>) -> Self {
        Self {
            width,
            title: None,
            subtitle: None,
            columns,
            panels: Vec::new(),
            panel_aspect: 0.8,
            legend: Vec::new(),
            footer: Vec::new(),
            banner: None,
            description: description.into(),
            provenance: Vec::new(),
            searchable_svg: false,
        }
    }

    /// Adds a panel.
    pub fn panel(
        mut self,
        label: impl Into<String>,
        title: impl Into<String>,
        content: impl Into<Content>,
    ) -> Self {
        self.panels.push(SheetPanel {
            label: label.into(),
            title: title.into(),
            notes: Vec::new(),
            content: content.into(),
        });
        self
    }

    /// Adds small print below the title of the last panel.
    pub fn notes(mut self, notes: impl IntoIterator<Item = String>) -> Self {
        if let Some(panel) = self.panels.last_mut() {
            panel.notes.extend(notes);
        }
        self
    }

    /// Sets the heading.
    pub fn title(mut self, title: impl Into<String>) -> Self {
        self.title = Some(title.into());
        self
    }

    /// Sets the second line of the heading.
    pub fn subtitle(mut self, subtitle: impl Into<String>) -> Self {
        self.subtitle = Some(subtitle.into());
        self
    }

    /// Sets the default ratio of height to width of a panel's drawing area.
    pub fn panel_aspect(mut self, aspect: f64) -> Self {
        self.panel_aspect = aspect;
        self
    }

    /// Adds an entry to the shared legend.
    pub fn legend(mut self, entry: LegendEntry) -> Self {
        self.legend.push(entry);
        self
    }

    /// Adds a line of small print.
    pub fn footer(mut self, line: impl Into<String>) -> Self {
        self.footer.push(line.into());
        self
    }

    /// Sets the warning.
    pub fn banner(mut self, warning: impl Into<String>) -> Self {
        self.banner = Some(warning.into());
        self
    }

    /// Adds a pair to the provenance.
    pub fn provenance(mut self, key: impl Into<String>, value: impl Into<String>) -> Self {
        self.provenance.push((key.into(), value.into()));
        self
    }
}

/// One panel of a sheet.
#[derive(Clone, Debug)]
pub struct SheetPanel {
    /// Its name, for example `(i)`.
    pub label: String,
    /// Its subject, set beside the name.
    pub title: String,
    /// Small print below the title, a paragraph each.
    pub notes: Vec<String>,
    /// The drawing.
    pub content: Content,
}

/// Content of a panel.
#[derive(Clone, Debug)]
pub enum Content {
    /// A plane chart.
    Plane(PlanePanel),
    /// A chart in space.
    Space(SpacePanel),
    /// Nothing: an empty place in the grid.
    Blank,
}

impl From<PlanePanel> for Content {
    fn from(panel: PlanePanel) -> Self {
        Self::Plane(panel)
    }
}

impl From<SpacePanel> for Content {
    fn from(panel: SpacePanel) -> Self {
        Self::Space(panel)
    }
}

/// An axis: title, range and kind.
#[derive(Clone, Debug)]
pub struct Axis {
    /// Title in rich text.
    pub title: String,
    /// Value at the lower end.
    pub lower: f64,
    /// Value at the upper end.
    pub upper: f64,
    /// Whether the axis is logarithmic; both ends must then be positive.
    pub logarithmic: bool,
}

impl Axis {
    /// A linear axis. A range of no extent is widened when it is drawn.
    pub fn linear(title: impl Into<String>, lower: f64, upper: f64) -> Self {
        Self { title: title.into(), lower, upper, logarithmic: false }
    }

    /// A logarithmic axis.
    pub fn log(title: impl Into<String>, lower: f64, upper: f64) -> Self {
        Self { title: title.into(), lower, upper, logarithmic: true }
    }

    /// A linear axis that covers all finite `values` with a margin of four per cent.
    pub fn covering(title: impl Into<String>, values: impl IntoIterator<Item = f64>) -> Self {
        let (mut lower, mut upper) = range_of(values);
        // Rounding is no range.
        if upper - lower < 1e-9 * lower.abs().max(upper.abs()) {
            lower += 0.5 * (upper - lower);
            upper = lower;
        }
        let margin = 0.04 * (upper - lower);
        Self::linear(title, lower - margin, upper + margin)
    }

    /// Makes the axis reach these finite values, too, with a margin beyond those outside.
    pub fn reach(&mut self, values: impl IntoIterator<Item = f64>) {
        let shown = |v: &f64| v.is_finite() && (*v > 0.0 || !self.logarithmic);
        let values = values.into_iter().filter(shown).chain([self.lower, self.upper]);
        let (lower, upper) = range_of(values);
        let margin = 0.04 * (upper - lower);
        if lower < self.lower {
            self.lower = if self.logarithmic { lower / 1.6 } else { lower - margin };
        }
        if upper > self.upper {
            self.upper = if self.logarithmic { upper * 1.6 } else { upper + margin };
        }
    }

    /// A logarithmic axis that covers all positive finite `values`, with a margin.
    pub fn log_covering(title: impl Into<String>, values: impl IntoIterator<Item = f64>) -> Self {
        let (lower, upper) = range_of(values.into_iter().filter(|v| *v > 0.0));
        let (lower, upper) = if lower > 0.0 { (lower, upper) } else { (0.1, 1.0) };
        Self::log(title, lower / 1.6, upper * 1.6)
    }
}

/// Smallest and largest finite value; (0, 1) if there is none.
pub fn range_of(values: impl IntoIterator<Item = f64>) -> (f64, f64) {
    let mut range = (f64::INFINITY, f64::NEG_INFINITY);
    for v in values.into_iter().filter(|v| v.is_finite()) {
        range = (range.0.min(v), range.1.max(v));
    }
    if range.0 <= range.1 { range } else { (0.0, 1.0) }
}

/// Dash pattern of a line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Dash {
    /// Unbroken.
    Solid,
    /// Dashes.
    Dashed,
    /// Dots.
    Dotted,
}

/// Look of a line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LineStyle {
    /// Colour.
    pub colour: Colour,
    /// Width in points.
    pub width: f64,
    /// Dash pattern.
    pub dash: Dash,
    /// Opacity in per cent.
    pub opacity: u8,
}

impl LineStyle {
    /// An opaque solid line.
    pub const fn new(colour: Colour, width: f64) -> Self {
        Self { colour, width, dash: Dash::Solid, opacity: 100 }
    }

    /// The same, dashed.
    pub const fn dashed(mut self) -> Self {
        self.dash = Dash::Dashed;
        self
    }

    /// The same, dotted.
    pub const fn dotted(mut self) -> Self {
        self.dash = Dash::Dotted;
        self
    }
}

impl Default for LineStyle {
    fn default() -> Self {
        Self::new(style::INK, style::CURVE_PT)
    }
}

/// Look of a cloud of points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DotStyle {
    /// Colour; where density shading is on, that of the densest places.
    pub colour: Colour,
    /// Diameter in points; if absent it is chosen by how many distinct places the layer occupies.
    pub diameter: Option<f64>,
    /// Whether sparse places are drawn lighter than dense ones.
    pub density: bool,
}

impl DotStyle {
    /// The early half of a section: faint.
    pub const fn early() -> Self {
        Self { colour: style::FAINT, diameter: None, density: false }
    }

    /// The late half of a section: dark, shaded by density.
    pub const fn late() -> Self {
        Self { colour: style::INK, diameter: None, density: true }
    }

    /// Points of one colour.
    pub const fn plain(colour: Colour) -> Self {
        Self { colour, diameter: None, density: false }
    }
}

/// Shape of a marker.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MarkerShape {
    /// Filled disc with a white rim.
    Dot,
    /// Disc filled white.
    OpenDot,
    /// Diagonal cross.
    Cross,
    /// Five-pointed star with a white rim.
    Star,
    /// Filled square.
    Square,
    /// Filled upright triangle.
    Triangle,
}

/// Look of a marker.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MarkerStyle {
    /// Shape.
    pub shape: MarkerShape,
    /// Colour.
    pub colour: Colour,
    /// Diameter in points.
    pub size: f64,
}

impl MarkerStyle {
    /// A marker of the standard size.
    pub const fn new(shape: MarkerShape, colour: Colour) -> Self {
        Self { shape, colour, size: style::MARKER_PT }
    }
}

/// Point of a text that lies at its position.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Anchor {
    /// The text begins to the right of the position.
    Left,
    /// The text is centred on the position.
    Centre,
    /// The text ends to the left of the position.
    Right,
    /// The text is centred above the position.
    Above,
    /// The text is centred below the position.
    Below,
}

/// A text at a place in a panel, with a thin white halo so that it stays readable on top of curves.
#[derive(Clone, Debug)]
pub struct Note<P> {
    /// Position.
    pub at: P,
    /// Rich text.
    pub text: String,
    /// Point of the text that lies at the position.
    pub anchor: Anchor,
    /// Colour.
    pub colour: Colour,
    /// Font size in points.
    pub size: f64,
}

impl<P> Note<P> {
    /// A note of the usual size and colour.
    pub fn new(at: P, text: impl Into<String>, anchor: Anchor) -> Self {
        Self { at, text: text.into(), anchor, colour: style::INK, size: style::LABEL_PT }
    }
}

/// A line of a legend.
#[derive(Clone, Debug, PartialEq)]
pub struct LegendEntry {
    /// Sample.
    pub key: LegendKey,
    /// Rich text.
    pub text: String,
}

impl LegendEntry {
    /// An entry.
    pub fn new(key: LegendKey, text: impl Into<String>) -> Self {
        Self { key, text: text.into() }
    }
}

/// The sample of a legend entry.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LegendKey {
    /// A piece of line.
    Line(LineStyle),
    /// A line with a marker on it.
    LineMarker(LineStyle, MarkerStyle),
    /// A dot.
    Dots(DotStyle),
    /// A marker.
    Marker(MarkerStyle),
    /// A coloured square, with opacity in per cent.
    Area(Colour, u8),
}

/// Corner of a panel's own legend.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Corner {
    /// Upper left.
    UpperLeft,
    /// Upper right.
    UpperRight,
    /// Lower left.
    LowerLeft,
    /// Lower right.
    LowerRight,
}

/// Something drawn in a plane panel; later layers lie on top of earlier ones.
#[derive(Clone, Debug)]
pub enum PlaneLayer {
    /// A cloud of points.
    Dots {
        /// Positions.
        points: Vec<[f64; 2]>,
        /// Look.
        style: DotStyle,
    },
    /// A polyline, with an arrow head at its end if asked for.
    Line {
        /// Vertices.
        points: Vec<[f64; 2]>,
        /// Look.
        style: LineStyle,
        /// Whether it ends in an arrow head.
        arrow: bool,
    },
    /// A filled polygon.
    Area {
        /// Vertices.
        outline: Vec<[f64; 2]>,
        /// Colour.
        colour: Colour,
        /// Opacity in per cent.
        opacity: u8,
    },
    /// Markers.
    Markers {
        /// Positions.
        points: Vec<[f64; 2]>,
        /// Look.
        style: MarkerStyle,
    },
    /// A text.
    Note(Note<[f64; 2]>),
}

impl PlaneLayer {
    /// All positions of the layer.
    pub fn positions(&self) -> &[[f64; 2]] {
        match self {
            Self::Dots { points, .. }
            | Self::Line { points, .. }
            | Self::Markers { points, .. } => points,
            Self::Area { outline, .. } => outline,
            Self::Note(note) => std::slice::from_ref(&note.at),
        }
    }
}

/// A chart in the plane.
#[derive(Clone, Debug)]
pub struct PlanePanel {
    /// Horizontal axis.
    pub x: Axis,
    /// Vertical axis.
    pub y: Axis,
    /// Whether a unit is as long on both axes (linear axes only).
    pub equal: bool,
    /// Whether the axes are drawn.
    pub axes: bool,
    /// Whether the horizontal axis has numbers and a title, and the vertical one: panels that share
    /// an axis say it once.
    pub labelled: [bool; 2],
    /// Whether grid lines are drawn at the major ticks.
    pub grid: bool,
    /// Height divided by width of the drawing area; if absent, the sheet's.
    pub aspect: Option<f64>,
    /// Layers to draw, from bottom to top.
    pub layers: Vec<PlaneLayer>,
    /// Legend inside the panel.
    pub legend: Vec<LegendEntry>,
    /// Corner of that legend.
    pub legend_corner: Corner,
}

impl PlanePanel {
    /// An empty chart.
    pub fn new(x: Axis, y: Axis) -> Self {
        Self {
            x,
            y,
            equal: false,
            axes: true,
            labelled: [true; 2],
            grid: false,
            aspect: None,
            layers: Vec::new(),
            legend: Vec::new(),
            legend_corner: Corner::UpperRight,
        }
    }

    /// A drawing without axes in which a unit is as long in both directions: for sketches.
    pub fn sketch(x: (f64, f64), y: (f64, f64)) -> Self {
        let mut panel = Self::new(Axis::linear("", x.0, x.1), Axis::linear("", y.0, y.1));
        panel.axes = false;
        panel.equal = true;
        panel
    }

    /// Makes a unit as long on both axes.
    pub fn equal(mut self) -> Self {
        self.equal = true;
        self
    }

    /// Says whether the horizontal and the vertical axis have numbers and titles.
    pub fn labelled(mut self, horizontal: bool, vertical: bool) -> Self {
        self.labelled = [horizontal, vertical];
        self
    }

    /// Turns on grid lines.
    pub fn grid(mut self) -> Self {
        self.grid = true;
        self
    }

    /// Adds a cloud of points.
    pub fn dots(mut self, points: Vec<[f64; 2]>, style: DotStyle) -> Self {
        self.layers.push(PlaneLayer::Dots { points, style });
        self
    }

    /// Adds a filled polygon with the standard opacity of regions.
    pub fn area(mut self, outline: Vec<[f64; 2]>, colour: Colour) -> Self {
        self.layers.push(PlaneLayer::Area { outline, colour, opacity: style::SURFACE_OPACITY });
        self
    }

    /// Adds an opaque filled polygon.
    pub fn solid(mut self, outline: Vec<[f64; 2]>, colour: Colour) -> Self {
        self.layers.push(PlaneLayer::Area { outline, colour, opacity: 100 });
        self
    }
}

/// A polygon in space with a colour.
#[derive(Clone, Debug)]
pub struct Patch {
    /// Corners in order (three or more, nearly in one plane).
    pub corners: Vec<[f64; 3]>,
    /// Colour: patches of one colour form one region and are filled without seams.
    pub colour: Colour,
}

/// Something drawn in a space panel.
#[derive(Clone, Debug)]
pub enum SpaceLayer {
    /// A surface made of patches; what lies behind it shows through, faded.
    Surface {
        /// The patches.
        patches: Vec<Patch>,
        /// Opacity in per cent.
        opacity: u8,
    },
    /// A curve, ordered by depth and faded towards the far side.
    Line {
        /// Vertices.
        points: Vec<[f64; 3]>,
        /// Look.
        style: LineStyle,
        /// Whether it ends in an arrow head.
        arrow: bool,
    },
    /// Markers, drawn on top.
    Markers {
        /// Positions.
        points: Vec<[f64; 3]>,
        /// Look.
        style: MarkerStyle,
    },
    /// A text, drawn on top.
    Note(Note<[f64; 3]>),
}

impl SpaceLayer {
    /// All positions of the layer, without the corners of surfaces.
    pub fn positions(&self) -> &[[f64; 3]] {
        match self {
            Self::Surface { .. } => &[],
            Self::Line { points, .. } | Self::Markers { points, .. } => points,
            Self::Note(note) => std::slice::from_ref(&note.at),
        }
    }
}

/// A chart in space, seen in orthographic projection. The first two axes are horizontal, the third
/// points up; all are linear. Curves and surfaces are cut off at the box.
#[derive(Clone, Debug)]
pub struct SpacePanel {
    /// The two horizontal axes and the upright one.
    pub axes: [Axis; 3],
    /// Relative lengths of the box's edges.
    pub proportions: [f64; 3],
    /// Azimuth of the camera in degrees, from the first axis towards the second.
    pub azimuth: f64,
    /// Elevation of the camera in degrees above the horizontal plane.
    pub elevation: f64,
    /// Whether box, grid, ticks and axis titles are drawn.
    pub boxed: bool,
    /// Height divided by width of the drawing area; if absent, what the box needs, at most the
    /// sheet's.
    pub aspect: Option<f64>,
    /// Layers to draw.
    pub layers: Vec<SpaceLayer>,
    /// Legend inside the panel.
    pub legend: Vec<LegendEntry>,
    /// Corner of that legend.
    pub legend_corner: Corner,
}

impl SpacePanel {
    /// An empty box seen from azimuth -60 and elevation 25 degrees.
    pub fn new(first: Axis, second: Axis, up: Axis) -> Self {
        Self {
            axes: [first, second, up],
            proportions: [1.0, 1.0, 0.85],
            azimuth: -60.0,
            elevation: 25.0,
            boxed: true,
            aspect: None,
            layers: Vec::new(),
            legend: Vec::new(),
            legend_corner: Corner::UpperRight,
        }
    }

    /// Sets the camera, in degrees.
    pub fn camera(mut self, azimuth: f64, elevation: f64) -> Self {
        self.azimuth = azimuth;
        self.elevation = elevation;
        self
    }

    /// Sets the relative lengths of the box's edges.
    pub fn proportions(mut self, proportions: [f64; 3]) -> Self {
        self.proportions = proportions;
        self
    }

    /// Leaves out box, grid, ticks and axis titles.
    pub fn unboxed(mut self) -> Self {
        self.boxed = false;
        self
    }

    /// Adds a surface with the standard opacity.
    pub fn surface(mut self, patches: Vec<Patch>) -> Self {
        self.layers.push(SpaceLayer::Surface { patches, opacity: style::SURFACE_OPACITY });
        self
    }
}

/// Builders that panels of either kind have.
macro_rules! layers {
    ($panel:ident, $layer:ident, $dimensions:literal) => {
        impl $panel {
            /// Adds a polyline.
            pub fn line(mut self, points: Vec<[f64; $dimensions]>, style: LineStyle) -> Self {
                self.layers.push($layer::Line { points, style, arrow: false });
                self
            }

            /// Adds a polyline that ends in an arrow head.
            pub fn arrow(mut self, points: Vec<[f64; $dimensions]>, style: LineStyle) -> Self {
                self.layers.push($layer::Line { points, style, arrow: true });
                self
            }

            /// Adds markers.
            pub fn markers(mut self, points: Vec<[f64; $dimensions]>, style: MarkerStyle) -> Self {
                self.layers.push($layer::Markers { points, style });
                self
            }

            /// Adds a text.
            pub fn note(
                mut self,
                at: [f64; $dimensions],
                text: impl Into<String>,
                anchor: Anchor,
            ) -> Self {
                self.layers.push($layer::Note(Note::new(at, text, anchor)));
                self
            }

            /// Adds a legend entry.
            pub fn legend(mut self, key: LegendKey, text: impl Into<String>) -> Self {
                self.legend.push(LegendEntry::new(key, text));
                self
            }

            /// Sets the place of the legend.
            pub fn legend_at(mut self, corner: Corner) -> Self {
                self.legend_corner = corner;
                self
            }
        }
    };
}
layers!(PlanePanel, PlaneLayer, 2);
layers!(SpacePanel, SpaceLayer, 3);

/// The patches of a surface given by a function on a grid of `nu` by `nv` cells over `u` and `v`,
/// coloured by the cell's centre. `point(u, v)` gives the position, `colour(u, v)` the region.
pub fn grid_surface(
    (u0, u1, nu): (f64, f64, usize),
    (v0, v1, nv): (f64, f64, usize),
    point: impl Fn(f64, f64) -> [f64; 3],
    colour: impl Fn(f64, f64) -> Colour,
) -> Vec<Patch> {
    let u = |i: f64| u0 + (u1 - u0) * i / nu as f64;
    let v = |j: f64| v0 + (v1 - v0) * j / nv as f64;
    let mut patches = Vec::with_capacity(nu * nv);
    for i in 0..nu {
        for j in 0..nv {
            let (a, b, c, d) = (u(i as f64), u((i + 1) as f64), v(j as f64), v((j + 1) as f64));
            patches.push(Patch {
                corners: vec![point(a, c), point(b, c), point(b, d), point(a, d)],
                colour: colour(u(i as f64 + 0.5), v(j as f64 + 0.5)),
            });
        }
    }
    patches
}
