//! Tests of whole pictures: where ink lies, that the three formats agree, that bytes repeat, and
//! what is written into the files.

use super::scene::{Item, Position, Scene, UNITS_PER_PIXEL};
use super::sheet::*;
use super::*;

fn dot_panel(points: Vec<[f64; 2]>) -> PlanePanel {
    let red = DotStyle { colour: Colour::rgb(255, 0, 0), diameter: Some(2.0), density: false };
    PlanePanel::new(Axis::linear("*x*", -2.0, 3.0), Axis::linear("*z*", 10.0, 20.0))
        .dots(points, red)
}

fn dot_sheet(points: Vec<[f64; 2]>) -> Sheet {
    Sheet::new(ColumnWidth::Single, 1, "A point.").title("One *x*^{2} & <two>").panel(
        "(i)",
        "point",
        dot_panel(points),
    )
}

fn provenance_sheet() -> Sheet {
    dot_sheet(vec![[0.5, 12.0]])
        .provenance("spec-sha256", "00ff")
        .provenance("reading", "recon & <structed> \"α\" (x) \\ y)")
        .provenance("empty", "")
        .provenance("lines", "one\ntwo\ttab")
}

fn dots(scene: &Scene) -> Vec<Position> {
    let red = Colour::rgb(255, 0, 0);
    scene
        .items
        .iter()
        .filter_map(|i| match i {
            Item::Dots { paint, centres, .. } if paint.colour == red => Some(centres.clone()),
            _ => None,
        })
        .flatten()
        .collect()
}

/// The frame of the (only) plane panel: left, top, right, bottom in units.
fn frame(scene: &Scene) -> [i32; 4] {
    let closed = scene.items.iter().find_map(|i| match i {
        Item::Stroke { lines, .. } => lines.iter().find(|l| l.len() == 5 && l[0] == l[4]),
        _ => None,
    });
    let c = closed.expect("a frame is drawn");
    [c[0].0, c[0].1, c[2].0, c[2].1]
}

#[test]
fn a_point_lands_where_its_coordinates_say() {
    let data = [[-2.0, 10.0], [3.0, 20.0], [0.5, 12.0], [-1.234, 17.7]];
    let scene = layout::draw(&dot_sheet(data.to_vec())).unwrap();
    let [left, top, right, bottom] = frame(&scene);
    let centres = dots(&scene);
    assert_eq!(centres.len(), data.len());
    for p in data {
        let x = f64::from(left) + f64::from(right - left) * (p[0] + 2.0) / 5.0;
        let y = f64::from(bottom) - f64::from(bottom - top) * (p[1] - 10.0) / 10.0;
        let nearest =
            centres.iter().map(|c| (f64::from(c.0) - x).abs().max((f64::from(c.1) - y).abs()));
        // To half a unit, that is a 24th of a pixel.
        assert!(nearest.fold(f64::INFINITY, f64::min) <= 0.5 + 1e-9, "{p:?}");
    }
}

#[test]
fn png_and_svg_put_the_point_at_the_same_place() {
    for x in [0.5, 0.51, 0.523, 0.537] {
        let sheet = dot_sheet(vec![[x, 12.345]]);
        let centre = dots(&layout::draw(&sheet).unwrap())[0];
        let picture = render(&sheet).unwrap();
        let (mut sum, mut sx, mut sy) = (0.0, 0.0, 0.0);
        let width = picture.pixels.width as usize;
        for (i, p) in picture.pixels.rgba.chunks_exact(4).enumerate() {
            // Only the dot is red: there red stays while green goes.
            let weight = f64::from(p[0]) - f64::from(p[1]);
            if weight > 8.0 {
                sum += weight;
                sx += weight * ((i % width) as f64 + 0.5);
                sy += weight * ((i / width) as f64 + 0.5);
            }
        }
        let unit = f64::from(UNITS_PER_PIXEL);
        assert!(
            (sx / sum - f64::from(centre.0) / unit).abs() < 0.02,
            "{} {}",
            sx / sum,
            f64::from(centre.0) / unit
        );
        assert!(
            (sy / sum - f64::from(centre.1) / unit).abs() < 0.02,
            "{} {}",
            sy / sum,
            f64::from(centre.1) / unit
        );
        let text = String::from_utf8(picture.svg).unwrap();
        let document = roxmltree::Document::parse(&text).unwrap();
        let path =
            document.descendants().find(|n| n.attribute("stroke") == Some("#ff0000")).unwrap();
        assert_eq!(path.attribute("d").unwrap(), format!("m{} {}h0", centre.0, centre.1));
    }
}

#[test]
fn the_same_sheet_gives_the_same_bytes() {
    let (a, b) = (render(&full_sheet()).unwrap(), render(&full_sheet()).unwrap());
    assert!(a.png == b.png && a.svg == b.svg && a.pdf == b.pdf && a.pixels == b.pixels);
}

#[test]
fn a_changed_sheet_gives_other_pixels() {
    let (a, b) = (
        render(&dot_sheet(vec![[0.5, 12.0]])).unwrap(),
        render(&dot_sheet(vec![[0.51, 12.0]])).unwrap(),
    );
    assert_ne!(a.pixels, b.pixels);
}

/// Every kind of panel and layer.
fn full_sheet() -> Sheet {
    let wave: Vec<[f64; 2]> =
        (0..400).map(|i| f64::from(i) * 0.01).map(|t| [t, t * (4.0 - t) - 2.0]).collect();
    let helix: Vec<[f64; 3]> = (0..500)
        .map(|i| f64::from(i) * 0.004 - 1.0)
        .map(|t| [t, 4.0 * t * t * t - 3.0 * t, 2.0 * t * t - 1.0])
        .collect();
    let plane = PlanePanel::new(Axis::linear("*x*", 0.0, 4.0), Axis::linear("*y*_{1}", -3.0, 3.0))
        .grid()
        .area(vec![[0.0, 0.0], [2.0, 0.0], [2.0, 5.0]], style::ATTRACTING)
        .line(wave.clone(), LineStyle::default().dashed())
        .arrow(wave, LineStyle::new(style::BLUE, 1.0))
        .markers(vec![[1.0, 1.0]], MarkerStyle::new(MarkerShape::Star, style::MAGENTA))
        .note([1.0, 1.0], "*σ*√*ε*", Anchor::Left)
        .legend(LegendKey::Line(LineStyle::default()), "wave");
    let surface = grid_surface(
        (-1.0, 1.0, 10),
        (-1.0, 1.0, 10),
        |u, v| [u, v, 0.5 * u * v],
        |u, _| {
            if u < 0.0 { style::ATTRACTING } else { style::REPELLING }
        },
    );
    let unit = |title: &str| Axis::linear(title, -1.0, 1.0);
    let space = SpacePanel::new(unit("*x*"), unit("*y*"), unit("*z*"))
        .surface(surface)
        .line(helix, LineStyle::default());
    Sheet::new(ColumnWidth::Wide, 2, "Everything.")
        .title("Title")
        .subtitle("subtitle")
        .banner("SHORTENED")
        .panel("(i)", "plane", plane)
        .panel("(ii)", "space", space)
        .panel(
            "(iii)",
            "sketch",
            PlanePanel::sketch((0.0, 1.0), (0.0, 1.0))
                .solid(vec![[0.0, 0.0], [1.0, 0.0], [0.5, 1.0]], style::GREEN),
        )
        .panel("", "", Content::Blank)
        .legend(LegendEntry::new(LegendKey::Dots(DotStyle::early()), "early"))
        .footer("*α* = 10^{-3}")
        .provenance("figure", "test")
}

#[test]
fn svg_is_well_formed_and_needs_no_font() {
    let text = String::from_utf8(render(&full_sheet()).unwrap().svg).unwrap();
    let document = roxmltree::Document::parse(&text).unwrap();
    let root = document.root_element();
    assert_eq!(root.attribute("role"), Some("img"));
    let child =
        |name: &str| root.children().find(|n| n.has_tag_name(("http://www.w3.org/2000/svg", name)));
    assert_eq!(child("title").and_then(|n| n.text()), Some("Title"));
    assert_eq!(child("desc").and_then(|n| n.text()), Some("Everything."));
    assert!(child("metadata").is_some());
    for node in document.descendants().filter(|n| n.is_element()) {
        assert!(
            !["text", "tspan", "font", "image", "style", "script"]
                .contains(&node.tag_name().name()),
            "{node:?}"
        );
        assert!(node.attribute("font-family").is_none());
    }
}

#[test]
fn sixty_thousand_points_stay_under_two_megabytes() {
    let mut seed = 1u64;
    let mut next = || {
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (seed >> 11) as f64 / (1u64 << 53) as f64
    };
    let points: Vec<[f64; 2]> = (0..60_000).map(|_| [next(), next()]).collect();
    let panel = PlanePanel::new(Axis::linear("*x*", 0.0, 1.0), Axis::linear("*z*", 0.0, 1.0))
        .dots(points, DotStyle::late());
    let picture = render(&Sheet::new(ColumnWidth::Wide, 1, "Noise.").panel("", "", panel)).unwrap();
    assert!(picture.svg.len() < 1_000_000, "{}", picture.svg.len());
    assert!(picture.pdf.len() < 1_000_000, "{}", picture.pdf.len());
}

#[test]
fn the_png_states_its_printed_size_and_decodes_to_the_pixels() {
    for (width, centimetres) in [(ColumnWidth::Single, 8.6), (ColumnWidth::Wide, 10.2)] {
        let mut sheet = full_sheet();
        sheet.width = width;
        let picture = render(&sheet).unwrap();
        let reader = png::Decoder::new(std::io::Cursor::new(&picture.png)).read_info().unwrap();
        let dims = reader.info().pixel_dims.unwrap();
        assert_eq!((dims.xppu, dims.yppu, dims.unit), (23_622, 23_622, png::Unit::Meter));
        let printed = f64::from(reader.info().width) / f64::from(dims.xppu) * 100.0;
        assert!((printed - centimetres).abs() < 0.005, "{printed}");
        assert_eq!(decode_png(&picture.png).unwrap(), picture.pixels);
        assert!(picture.pixels.rgba.chunks_exact(4).all(|p| p[3] == 255));
        assert_eq!(picture.pixels.rgba[..4], [255; 4]);
    }
}

#[test]
fn provenance_comes_back_from_all_three() {
    let sheet = provenance_sheet();
    let picture = render(&sheet).unwrap();
    for (bytes, format) in
        [(&picture.png, Format::Png), (&picture.svg, Format::Svg), (&picture.pdf, Format::Pdf)]
    {
        let found = read_provenance(bytes).unwrap();
        assert_eq!(found.format, format);
        assert_eq!(found.entries, sheet.provenance, "{format:?}");
        assert!(found.intact, "{format:?}");
        assert_eq!(found.get("spec-sha256"), Some("00ff"));
    }
}

#[test]
fn any_changed_byte_breaks_the_seal() {
    let picture = render(&provenance_sheet()).unwrap();
    for file in [&picture.png, &picture.svg, &picture.pdf] {
        // Some hundred places over the whole file, and each of the last few.
        let places = (0..file.len()).step_by(file.len() / 100).chain(file.len() - 8..file.len());
        for at in places {
            let mut changed = file.clone();
            changed[at] ^= 0x15;
            let intact = read_provenance(&changed).is_ok_and(|p| p.intact);
            assert!(!intact, "byte {at} of {}", file.len());
        }
        let mut longer = file.clone();
        longer.push(b'\n');
        assert!(!read_provenance(&longer).is_ok_and(|p| p.intact));
    }
}

#[test]
fn the_pdf_has_no_clock_and_no_identifier() {
    let pdf = render(&full_sheet()).unwrap().pdf;
    let text = String::from_utf8_lossy(&pdf);
    for word in ["/CreationDate", "/ModDate", "/ID", "xmp"] {
        assert!(!text.contains(word), "{word}");
    }
    assert!(text.contains("/Title (Title)"));
}

/// The page's operators, decompressed.
fn operators(pdf: &[u8]) -> String {
    let find = |from: usize, what: &[u8]| {
        from + pdf[from..].windows(what.len()).position(|w| w == what).unwrap()
    };
    let start = find(find(0, b"/FlateDecode"), b"stream\n") + b"stream\n".len();
    let end = find(start, b"endstream");
    let found = miniz_oxide::inflate::decompress_to_vec_zlib(pdf[start..end].trim_ascii_end())
        .expect("deflated");
    String::from_utf8(found).expect("operators are ASCII")
}

#[test]
fn words_of_the_pdf_can_be_found_and_stand_where_their_outlines_do() {
    let sheet = full_sheet();
    let scene = layout::draw(&sheet).unwrap();
    let operators = operators(&render(&sheet).unwrap().pdf);
    let unseen = &operators[operators.find("BT\n3 Tr\n").expect("a text object in mode 3")..];
    // Codes count the characters in their order; reading them back needs no more.
    let mut characters: Vec<char> = scene.texts().flat_map(|w| w.text.chars()).collect();
    characters.sort_unstable();
    characters.dedup();
    assert!(characters.len() < 256);
    let shown: Vec<(String, f64, f64)> = unseen
        .lines()
        .filter(|l| l.ends_with(" Tj"))
        .map(|line| {
            let hex = &line[line.find('<').unwrap() + 1..line.find('>').unwrap()];
            let code = |i: usize| usize::from_str_radix(&hex[2 * i..2 * i + 2], 16).unwrap();
            let text: String = (0..hex.len() / 2).map(|i| characters[code(i) - 1]).collect();
            let numbers: Vec<f64> = line.split(' ').filter_map(|w| w.parse().ok()).collect();
            // Size, stretch in per cent, four entries of the matrix, then x and y; every glyph is
            // half a size wide.
            let length = numbers[0] * 0.5 * text.chars().count() as f64 * numbers[1] / 100.0;
            (text, numbers[6], length)
        })
        .collect();
    let wanted: Vec<_> = scene.texts().collect();
    assert!(wanted.len() > 10, "{}", wanted.len());
    assert_eq!(shown.len(), wanted.len());
    for ((text, x, length), words) in shown.iter().zip(&wanted) {
        assert_eq!(*text, words.text);
        assert_eq!(*x, f64::from(words.from.0), "{text}");
        assert!((length - f64::from(words.length())).abs() < 1.0, "{text}: {length}");
    }
    assert!(wanted.iter().any(|w| w.upwards()) && wanted.iter().any(|w| !w.upwards()));
}

#[test]
fn an_svg_has_its_words_as_text_only_if_asked() {
    let mut sheet = dot_sheet(vec![[0.5, 12.0]]);
    let plain = render(&sheet).unwrap();
    sheet.searchable_svg = true;
    let searchable = render(&sheet).unwrap();
    let read = |bytes: &[u8]| String::from_utf8(bytes.to_vec()).unwrap();
    assert!(!read(&plain.svg).contains("<text"));
    let svg = read(&searchable.svg);
    assert!(svg.contains(">One x^2 &amp; &lt;two&gt;</text>"), "{svg}");
    assert!(svg.contains("rotate(-90 "));
    assert!(svg.contains("fill-opacity=\"0\""));
    assert!(read_provenance(&searchable.svg).is_ok_and(|p| p.intact));
    assert!(plain.png == searchable.png && plain.pdf == searchable.pdf);
}

#[test]
fn two_distinct_late_points_are_seen_among_a_faint_transient() {
    let early: Vec<[f64; 2]> =
        (0..900).map(|i| [f64::from(i % 30) / 30.0, f64::from(i / 30) / 30.0]).collect();
    let late: Vec<[f64; 2]> =
        (0..5000).map(|i| if i % 2 == 0 { [0.3, 0.512] } else { [0.7, 0.49] }).collect();
    let panel = PlanePanel::new(Axis::linear("*x*", 0.0, 1.0), Axis::linear("*z*", 0.0, 1.0))
        .dots(early, DotStyle::early())
        .dots(late, DotStyle::late());
    let scene = layout::draw(&Sheet::new(ColumnWidth::Wide, 3, "").panel("", "", panel)).unwrap();
    let of = |colour: Colour| {
        scene.items.iter().find_map(|i| match i {
            Item::Dots { paint, diameter, centres } if paint.colour == colour => {
                Some((*diameter, centres.len()))
            }
            _ => None,
        })
    };
    let (faint, dark) = (of(style::FAINT).unwrap(), of(style::INK).unwrap());
    assert_eq!((faint.1, dark.1), (900, 2));
    assert!(dark.0 >= 3 * faint.0, "{dark:?} {faint:?}");
}

#[test]
fn positions_that_are_no_numbers_are_left_out_and_counted() {
    let good = render(&dot_sheet(vec![[0.5, 12.0]])).unwrap();
    let mixed = vec![[f64::NAN, 12.0], [0.5, 12.0], [0.5, f64::INFINITY]];
    let picture = render(&dot_sheet(mixed)).unwrap();
    assert_eq!((good.left_out, picture.left_out), (0, 2));
    assert_eq!(good.pixels, picture.pixels);
}

#[test]
fn unusable_axes_and_numbers_are_named() {
    let plane = |x: Axis| {
        Sheet::new(ColumnWidth::Single, 1, "").panel(
            "",
            "",
            PlanePanel::new(x, Axis::linear("", 0.0, 1.0)),
        )
    };
    for axis in [
        Axis::linear("a", 0.0, f64::NAN),
        Axis::log("a", 0.0, 1.0),
        Axis::linear("a", f64::MIN, f64::MAX),
    ] {
        assert!(matches!(render(&plane(axis)), Err(RenderError::Axis { panel: 1, .. })));
    }
    let unit = || Axis::linear("", 0.0, 1.0);
    let space = |p: SpacePanel| Sheet::new(ColumnWidth::Single, 1, "").panel("", "", p);
    let good = || SpacePanel::new(unit(), unit(), unit());
    assert!(render(&space(good())).is_ok());
    assert!(matches!(render(&space(good().camera(0.0, 91.0))), Err(RenderError::Number { .. })));
    assert!(matches!(
        render(&space(good().proportions([1.0, 0.0, 1.0]))),
        Err(RenderError::Number { .. })
    ));
    let tower = (0..40).fold(Sheet::new(ColumnWidth::Wide, 1, ""), |s, _| s.panel("", "", good()));
    assert!(matches!(render(&tower), Err(RenderError::TooLarge)));
    let faulty = Sheet::new(ColumnWidth::Single, 1, "").title("*x");
    assert!(matches!(render(&faulty), Err(RenderError::Text(RichTextError::Italic { .. }))));
}

#[test]
fn empty_and_degenerate_pictures_are_drawn() {
    let unit = |t: &str| Axis::linear(t, 0.0, 1.0);
    let sheets = [
        Sheet::new(ColumnWidth::Single, 1, ""),
        Sheet::new(ColumnWidth::Single, 0, "").panel("", "", PlanePanel::new(unit(""), unit(""))),
        Sheet::new(ColumnWidth::Single, 3, "").panel(
            "",
            "",
            PlanePanel::new(Axis::linear("", 2.0, 2.0), Axis::log("", 3.0, 3.0)),
        ),
        Sheet::new(ColumnWidth::Single, 1, "").panel(
            "",
            "",
            PlanePanel::new(Axis::linear("", 1.0, -1.0), unit(""))
                .dots(vec![[0.0, 0.5]], DotStyle::late()),
        ),
        Sheet::new(ColumnWidth::Single, 1, "").panel(
            "",
            "",
            SpacePanel::new(unit(""), unit(""), unit("")).camera(0.0, 90.0),
        ),
        Sheet::new(ColumnWidth::Single, 1, "").panel(
            "",
            "",
            SpacePanel::new(unit(""), unit(""), unit(""))
                .camera(90.0, 0.0)
                .line(vec![[0.5; 3]; 4], LineStyle::default()),
        ),
    ];
    for (i, sheet) in sheets.iter().enumerate() {
        let picture = render(sheet).unwrap_or_else(|e| panic!("sheet {i}: {e}"));
        assert!(read_provenance(&picture.png).unwrap().intact, "{i}");
    }
}

#[test]
fn what_lies_behind_a_surface_is_drawn_before_it_and_the_rest_after() {
    // A vertical line seen along the second axis, half of it behind a wall.
    let unit = |t: &str| Axis::linear(t, -1.0, 1.0);
    let wall =
        grid_surface((-1.0, 1.0, 4), (-1.0, 1.0, 4), |u, v| [u, 0.0, v], |_, _| style::ATTRACTING);
    let green = |y: f64| (vec![[-0.5, y, 0.0], [0.5, y, 0.0]], LineStyle::new(style::GREEN, 1.0));
    let (near, far) = (green(-0.9), green(0.9));
    let order = |line: (Vec<[f64; 3]>, LineStyle)| {
        let panel = SpacePanel::new(unit(""), unit(""), unit(""))
            .camera(-90.0, 10.0)
            .surface(wall.clone())
            .line(line.0, line.1);
        let scene =
            layout::draw(&Sheet::new(ColumnWidth::Single, 1, "").panel("", "", panel)).unwrap();
        let wall = scene.items.iter().position(
            |i| matches!(i, Item::Fill { paint, .. } if paint.colour == style::ATTRACTING),
        );
        let curve = scene.items.iter().position(|i| match i {
            Item::Stroke { paint, .. } => {
                paint.colour.g > paint.colour.r && paint.colour.g > paint.colour.b
            }
            _ => false,
        });
        curve.unwrap() > wall.unwrap()
    };
    assert!(order(near), "a line in front of a wall is drawn after it");
    assert!(!order(far), "a line behind a wall is drawn before it");
}

#[test]
fn a_line_is_drawn_up_to_the_frame_where_no_vertex_lies_inside() {
    let blue = LineStyle::new(Colour::rgb(0, 0, 255), 1.0);
    let panel = dot_panel(Vec::new()).line(vec![[-12.0, 15.0], [13.0, 15.0]], blue);
    let scene = layout::draw(&Sheet::new(ColumnWidth::Single, 1, "").panel("", "", panel)).unwrap();
    let [left, _, right, _] = frame(&scene);
    let drawn: Vec<Position> = scene
        .items
        .iter()
        .filter_map(|item| match item {
            Item::Stroke { paint, lines, .. } if paint.colour == blue.colour => Some(lines),
            _ => None,
        })
        .flatten()
        .flatten()
        .copied()
        .collect();
    assert_eq!(drawn.iter().map(|p| p.0).collect::<Vec<_>>(), [left, right]);
}

#[test]
fn region_colours_differ_in_greyscale() {
    // Relative luminance (IEC 61966-2-1) of each region as it appears on paper.
    let share = f64::from(style::SURFACE_OPACITY) / 100.0;
    let luminance = |c: Colour| {
        let seen = c.lighten(1.0 - share);
        let linear = |v: u8| {
            let v = f64::from(v) / 255.0;
            if v <= 0.04045 {
                v / 12.92
            } else {
                twofold_num::elementary::pow((v + 0.055) / 1.055, 2.4)
            }
        };
        0.2126 * linear(seen.r) + 0.7152 * linear(seen.g) + 0.0722 * linear(seen.b)
    };
    let [a, r, c] = [style::ATTRACTING, style::REPELLING, style::CROSSING].map(luminance);
    assert!(r - a > 0.15 && c - r > 0.15, "{a} {r} {c}");
}

#[test]
fn density_shading_never_changes_where_points_are() {
    let points: Vec<[f64; 2]> =
        (0..40_000).map(|i| [f64::from(i % 211) / 211.0, f64::from(i / 211) / 190.0]).collect();
    let places = |density: bool| {
        let look = DotStyle { density, ..DotStyle::late() };
        let panel = PlanePanel::new(Axis::linear("", 0.0, 1.0), Axis::linear("", 0.0, 1.0))
            .dots(points.clone(), look);
        let scene =
            layout::draw(&Sheet::new(ColumnWidth::Wide, 1, "").panel("", "", panel)).unwrap();
        let mut all: Vec<Position> = scene
            .items
            .into_iter()
            .filter_map(|i| if let Item::Dots { centres, .. } = i { Some(centres) } else { None })
            .flatten()
            .collect();
        all.sort_unstable();
        all
    };
    assert_eq!(places(true), places(false));
}

#[test]
fn palettes_have_whole_colours() {
    let picture = |palette: usize| {
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, 1, 1);
        encoder.set_color(png::ColorType::Indexed);
        encoder.set_palette(vec![7; palette]);
        encoder.write_header().unwrap().write_image_data(&[0]).unwrap();
        bytes
    };
    for good in [3, 9, 768] {
        assert_eq!(decode_png(&picture(good)).unwrap().rgba, [7, 7, 7, 255], "{good}");
    }
    for bad in [4, 8, 767] {
        let error = decode_png(&picture(bad)).unwrap_err();
        assert!(matches!(error, RenderError::Palette { bytes } if bytes == bad), "{bad}: {error}");
    }
    // These the crate refuses.
    for bad in [1, 769, 771] {
        assert!(
            matches!(decode_png(&picture(bad)).unwrap_err(), RenderError::PngDecoding(_)),
            "{bad}"
        );
    }
}

#[test]
fn a_picture_that_claims_too_much_is_refused_before_memory_is_asked_for() {
    // 46 bytes that claim 100000 x 100000.
    let hex = "89504e470d0a1a0a0000000d49484452000186a0000186a00806000000a8520bc800000001494441547876e684e6";
    let bytes: Vec<u8> = (0..hex.len())
        .step_by(2)
        .map(|i| u8::from_str_radix(&hex[i..i + 2], 16).unwrap())
        .collect();
    assert_eq!(png_size(&bytes), Some((100_000, 100_000)));
    let error = decode_png(&bytes).unwrap_err();
    assert!(matches!(error, RenderError::Claims { width: 100_000, height: 100_000 }), "{error}");
    // Within the limit a claim without data is damage; a file cut anywhere, or grown in any byte,
    // never panics.
    let mut small = bytes.clone();
    small[16..24].copy_from_slice(&[0, 0, 16, 0, 0, 0, 16, 0]);
    assert!(decode_png(&small).is_err());
    for end in 0..bytes.len() {
        assert!(decode_png(&bytes[..end]).is_err());
    }
}

#[test]
fn an_axis_covers_its_values_and_no_rounding() {
    let covers = |values: &[f64]| {
        let axis = Axis::covering("", values.iter().copied());
        (axis.lower, axis.upper)
    };
    let (lower, upper) = covers(&[0.0, 1.0, f64::NAN]);
    assert!((lower + 0.04).abs() < 1e-15 && (upper - 1.04).abs() < 1e-15);
    // A billionth of its size is a range still, roundings of one value are none.
    let (lower, upper) = covers(&[1.0, 1.0 + 2e-9]);
    assert!(lower < 1.0 && upper > 1.0 + 2e-9);
    let (lower, upper) = covers(&[0.1 - 2e-17, 0.1, 0.1 + 2e-17]);
    assert!(lower == upper && (lower - 0.1).abs() < 1e-16);
}
