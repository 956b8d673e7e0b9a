//! The commands that look at any system, as a user runs them.
#![cfg(feature = "cli")]
#![allow(clippy::disallowed_methods)] // compared with tolerances, not with hashes

use std::fs;
use std::path::Path;

use assert_cmd::Command;
use twofold::render::{decode_png, read_provenance};

fn twofold_in(folder: &Path, arguments: &[&str]) -> (i32, Vec<u8>, String) {
    let out = Command::cargo_bin("twofold")
        .unwrap()
        .current_dir(folder)
        .args(arguments)
        .output()
        .unwrap();
    (out.status.code().unwrap(), out.stdout, String::from_utf8(out.stderr).unwrap())
}

/// Runs a command that must succeed, without a word on standard error.
fn good(folder: &Path, arguments: &[&str]) -> Vec<u8> {
    let (code, out, err) = twofold_in(folder, arguments);
    assert_eq!((code, err.as_str()), (0, ""), "{arguments:?}");
    out
}

/// Runs a command that must be refused with words that hold all of `expected`.
fn refused(folder: &Path, arguments: &[&str], code: i32, expected: &[&str]) {
    let (found, out, err) = twofold_in(folder, arguments);
    assert_eq!(found, code, "{arguments:?}: {err}");
    assert!(out.is_empty(), "{arguments:?}");
    for words in expected {
        assert!(err.contains(words), "{arguments:?}: no {words:?} in {err}");
    }
}

#[test]
fn every_kind_of_picture_of_every_switch() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let filippov = ["--switch", "filippov", "--exit", "after-time:0.3:plus", "--t-end", "20"];
    let smoothed = ["--t-end", "20"];
    let hysteretic = ["--switch", "hysteretic", "--t-end", "5"];
    for (s, switch) in [&filippov[..], &smoothed, &hysteretic].iter().enumerate() {
        for (kind, more) in [
            ("series", &["--axes", "z,x"][..]),
            ("plane", &[]),
            ("space", &["--camera", "-40,10"]),
            ("section", &["--section", "y=0"]),
        ] {
            let file = format!("{s}-{kind}.png");
            let all =
                [&["plot", "--quiet", "--kind", kind, "--out", &file][..], switch, more].concat();
            good(at, &all);
            let bytes = fs::read(at.join(&file)).unwrap();
            // A blank picture has one colour.
            let pixels = decode_png(&bytes).unwrap();
            let mut colours: Vec<_> = pixels.rgba.chunks(4).collect();
            colours.sort();
            colours.dedup();
            assert!(colours.len() > 20, "{file}: {} colours", colours.len());
            let provenance = read_provenance(&bytes).unwrap();
            assert!(provenance.intact, "{file}");
            // The same bytes again.
            good(at, &all);
            assert_eq!(fs::read(at.join(&file)).unwrap(), bytes);
        }
    }
}

#[test]
fn formats_by_name_and_recorded_runs() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let run = [
        "--system",
        "stick-slip",
        "--switch",
        "filippov",
        "--exit",
        "at-once:plus",
        "--t-end",
        "12",
        "--chord",
        "1e-3",
    ];
    for (file, magic) in [("a.svg", "<svg"), ("a.PDF", "%PDF")] {
        good(at, &[&["plot", "--quiet", "--out", file][..], &run].concat());
        assert!(fs::read(at.join(file)).unwrap().starts_with(magic.as_bytes()), "{file}");
    }
    let direct =
        good(at, &[&["plot", "--quiet", "--out", "-", "--format", "svg"][..], &run].concat());
    assert_eq!(direct, fs::read(at.join("a.svg")).unwrap());
    for format in ["csv", "json"] {
        let file = format!("run.{format}");
        good(at, &[&["run", "--quiet", "--format", format, "--out", &file][..], &run].concat());
        good(at, &["plot", "--quiet", "--from", &file, "--out", "b.png"]);
        assert!(fs::read(at.join("b.png")).unwrap().starts_with(b"\x89PNG"));
    }
    let text = String::from_utf8(direct).unwrap();
    assert!(text.contains("A block on a moving belt"), "the heading is not in the picture's title");
}

#[test]
fn pictures_that_cannot_be_are_refused_with_reasons() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    fs::write(at.join("other.csv"), "a,b\n1,2\n").unwrap();
    let plot = |more: &[&str], code: i32, expected: &[&str]| {
        refused(at, &[&["plot", "--quiet", "--t-end", "3"][..], more].concat(), code, expected);
    };
    plot(&["--out", "a.jpg"], 2, &[".png, .svg or .pdf"]);
    plot(&["--out", "a.png", "--format", "svg"], 2, &["--format has no effect"]);
    plot(&["--out", "-"], 2, &["--format png"]);
    plot(&["--out", "a.png", "--kind", "section"], 2, &["--section y=0"]);
    plot(&["--out", "a.png", "--kind", "plane", "--section", "y=0"], 2, &["leave out --section"]);
    plot(&["--out", "a.png", "--axes", "x,q"], 2, &["no state \"q\"", "x, y, z"]);
    plot(&["--out", "a.png", "--axes", "x,y,x"], 2, &["is given twice"]);
    plot(&["--out", "a.png", "--kind", "plane", "--axes", "x"], 2, &["two axes", "1 given"]);
    plot(&["--out", "a.png", "--kind", "plane", "--camera", "1,2"], 2, &["--camera has no effect"]);
    plot(&["--out", "a.png", "--camera", "1,200"], 2, &["elevation"]);
    plot(
        &["--out", "a.png", "--system", "stick-slip", "--kind", "space"],
        2,
        &["shows 3 states, and the system has 2"],
    );
    plot(&["--out", "a.png", "--from", "other.csv"], 2, &["--t-end has no effect", "--from"]);
    refused(
        at,
        &["plot", "--from", "other.csv", "--out", "a.png"],
        2,
        &["other.csv", "twofold run"],
    );
    refused(at, &["plot", "--out", "other.csv/a.png"], 2, &["other.csv", "is a file"]);
    let sweep =
        "sweep --quiet --system bouncing-ball --t-end 2 --over params.r=0.5,0.9 --out s.csv";
    good(at, &sweep.split(' ').collect::<Vec<_>>());
    refused(at, &["plot", "--from", "s.csv", "--out", "a.png"], 2, &["s.csv: it is a sweep"]);
    fs::remove_file(at.join("s.csv")).unwrap();
    assert_eq!(fs::read_dir(at).unwrap().count(), 1, "something was written");
}

/// All states of a series are shown, more than there is room for are refused, and a section that is
/// never crossed says so.
#[test]
fn a_picture_shows_everything_or_says_what_is_missing() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let chain = |n: usize| {
        let names: Vec<String> = (0..n).map(|i| format!("\"s{i}\"")).collect();
        let rates: Vec<String> = (0..n).map(|i| format!("\"-s{i}\"")).collect();
        let start = vec!["1"; n].join(", ");
        let text = format!(
            "states = [{}]\nstart = [{start}]\nf = [{}]\n",
            names.join(", "),
            rates.join(", ")
        );
        fs::write(at.join("chain.toml"), text).unwrap();
    };
    let series = ["plot", "--quiet", "--system", "chain.toml", "--kind", "series", "--t-end", "1"];
    let height = |n: usize| {
        chain(n);
        good(at, &[&series[..], &["--out", "a.png"]].concat());
        let png = fs::read(at.join("a.png")).unwrap();
        u32::from_be_bytes(png[20..24].try_into().unwrap())
    };
    assert!(4 * height(12) > 5 * height(8));
    chain(17);
    refused(
        at,
        &[&series[..], &["--out", "a.png"]].concat(),
        2,
        &["at most sixteen panels", "17 states", "axes"],
    );
    let section =
        "plot --quiet --system stick-slip --section x=50 --t-end 3 --searchable --out a.svg";
    good(at, &section.split(' ').collect::<Vec<_>>());
    assert!(fs::read_to_string(at.join("a.svg")).unwrap().contains("no crossing"));
}

/// A table in a file with a picture's name is refused: it would fail only when it is opened.
#[test]
fn numbers_go_into_files_that_are_named_for_them() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let run = ["run", "--quiet", "--system", "stick-slip", "--t-end", "3"];
    for format in ["csv", "json"] {
        let (named, asked) = (format!("named.{format}"), format!("asked-{format}"));
        good(at, &[&run[..], &["--out", &named]].concat());
        good(at, &[&run[..], &["--format", format, "--out", &asked]].concat());
        assert!(fs::read(at.join(named)).unwrap() == fs::read(at.join(asked)).unwrap(), "{format}");
    }
    let written = fs::read_dir(at).unwrap().count();
    let scan = [
        "scan",
        "--quiet",
        "--system",
        "stick-slip",
        "--section",
        "x=0.5",
        "--over",
        "params.belt=0.3,0.4",
    ];
    let sweep = ["sweep", "--quiet", "--t-end", "30", "--runs", "2"];
    let orbit =
        ["orbit", "--quiet", "--system", "stick-slip", "--switch", "filippov", "--section", "v=0"];
    let exponent = ["lyapunov", "--quiet", "--system", "chua", "--t-end", "20"];
    for (call, out, why) in [
        (&run[..], "a.png", "`twofold plot`"),
        (
            &[&run[..], &["--format", "json"]].concat(),
            "a.csv",
            "the name says csv, but json is asked for",
        ),
        (&scan, "a.svg", "`twofold scan --plot`"),
        (&scan, "a.json", "what is written is csv"),
        (&sweep, "a.pdf", "csv or json"),
        (&[&sweep[..], &["--json"]].concat(), "a.parquet", "the name says parquet"),
        (&orbit, "a.parquet", "text or csv or json"),
        (&exponent, "a.csv", "text or json"),
    ] {
        refused(at, &[call, &["--out", out]].concat(), 2, &["--out", out, why]);
    }
    assert_eq!(fs::read_dir(at).unwrap().count(), written, "something was written");
}

/// A second call draws nothing, a third what was changed since; with other questions, or without a
/// store, everything is made.
#[test]
fn what_this_program_has_made_is_reused_until_it_changes() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let figure = |more: &[&str]| {
        let (code, out, err) = twofold_in(
            at,
            &[&["figure", "fig1", "fig3", "--out", "made", "--json"][..], more].concat(),
        );
        assert_eq!(code, 0, "{err}");
        let mut lines: Vec<String> =
            err.lines().filter(|l| l.ends_with(".png")).map(str::to_owned).collect();
        lines.sort();
        (out, lines.join(", "))
    };
    let kept = ["--store", "store"];
    let (records, said) = figure(&kept);
    assert_eq!(said, "wrote made/fig1/fig1.png, wrote made/fig3/fig3.png");
    let how = fs::read(at.join("made/making.json")).unwrap();
    assert_eq!(
        figure(&kept),
        (records.clone(), "unchanged: made/fig1/fig1.png, unchanged: made/fig3/fig3.png".into())
    );
    assert_eq!(fs::read(at.join("made/making.json")).unwrap(), how, "nothing was made");

    let svg = at.join("made/fig3/fig3.svg");
    let whole = fs::read(&svg).unwrap();
    fs::write(&svg, [&whole[..], b" "].concat()).unwrap();
    assert_eq!(
        figure(&kept),
        (records.clone(), "unchanged: made/fig1/fig1.png, wrote made/fig3/fig3.png".into())
    );
    assert_eq!(fs::read(&svg).unwrap(), whole);
    assert_eq!(
        figure(&["--fresh"]),
        (records, "wrote made/fig1/fig1.png, wrote made/fig3/fig3.png".into())
    );
}

#[test]
fn parameters_that_make_no_sense_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    for (name, value) in [("m", "0"), ("j", "-1"), ("v_c", "0")] {
        let set = format!("{name}={value}");
        refused(
            folder.path(),
            &["run", "--system", "wheel", "--set", &set],
            2,
            &["--set", "above 0", name],
        );
    }
}

#[test]
fn a_misspelt_name_is_shown_as_docs_systems_says() {
    let folder = tempfile::tempdir().unwrap();
    good(folder.path(), &["new", "my.toml"]);
    let file = folder.path().join("my.toml");
    let changed = fs::read_to_string(&file).unwrap().replace("pull - friction", "pull - frictoin");
    fs::write(&file, changed).unwrap();
    let (code, _, err) = twofold_in(folder.path(), &["run", "--system", "my.toml"]);
    let page = include_str!("../../docs/systems.md");
    let shown = page.split("```text\n").nth(1).unwrap().split("```").next().unwrap();
    assert_eq!((code, err.as_str()), (2, shown));
}

#[test]
fn a_new_file_is_never_lost() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    good(at, &["new", "a.toml"]);
    fs::write(at.join("a.toml"), "mine").unwrap();
    refused(at, &["new", "a.toml"], 2, &["there already", "--force"]);
    assert_eq!(fs::read_to_string(at.join("a.toml")).unwrap(), "mine");
    good(at, &["new", "a.toml", "--force", "--from", "wheel"]);
    assert_eq!(
        fs::read_to_string(at.join("a.toml")).unwrap(),
        twofold::system::library::text("wheel").unwrap()
    );
    refused(at, &["new", "b.txt"], 2, &[".toml"]);
    refused(at, &["new", "b.toml", "--from", "whel"], 2, &["did you mean wheel?"]);
    refused(at, &["new", "-", "--force"], 2, &["--force has no effect"]);
    let template = good(at, &["new", "-"]);
    let text = String::from_utf8(template).unwrap();
    let definition =
        twofold::system::Definition::from_toml(&text, "template").unwrap_or_else(|e| panic!("{e}"));
    assert!(definition.start().is_some());
}

#[test]
fn orbits_and_exponents_say_what_is_wrong() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let orbit = |more: &[&str], code: i32, expected: &[&str]| {
        refused(at, &[&["orbit", "--quiet"][..], more].concat(), code, expected);
    };
    orbit(&[], 2, &["--section, such as y=0"]);
    orbit(&["--system", "nope.toml", "--period", "3"], 2, &["nope.toml", "No such file"]);
    orbit(&["--section", "y=0", "--t-end", "5"], 2, &["--t-end has no effect", "--settle"]);
    orbit(&["--section", "y=0", "--along", "alpha"], 2, &["no \"=\"", "alpha=0.1..0.2:40"]);
    orbit(&["--section", "y=0", "--along", "alhpa=1..2"], 2, &["alhpa", "did you mean `alpha`?"]);
    orbit(&["--section", "y=0", "--settle", "-1"], 2, &["--settle is -1"]);
    // A motion that comes to rest has an answer; one that goes on and does not pass the plane has
    // none.
    let rest = good(at, &["orbit", "--quiet", "--system", "gene-switch", "--section", "q=5"]);
    assert!(String::from_utf8(rest).unwrap().starts_with("equilibrium"));
    orbit(&["--system", "stick-slip", "--section", "x=50"], 3, &["does not pass the plane"]);
    // The caricature's orbits come to the two-fold: no return map through it.
    let two_fold = [
        "--switch",
        "filippov",
        "--section",
        "x=-0.05",
        "--settle",
        "0",
        "--start",
        "-0.05,0.3,0.3",
    ];
    let (code, _, err) = twofold_in(at, &[&["orbit", "--quiet"][..], &two_fold].concat());
    assert!(code == 3 && (err.contains("many futures") || err.contains("did not return")), "{err}");
    let exponent = |more: &[&str], expected: &[&str]| {
        refused(at, &[&["lyapunov", "--quiet"][..], more].concat(), 2, expected)
    };
    exponent(&["--switch", "filippov", "--exit", "all"], &["--exit \"all\"", "one motion"]);
    exponent(&["--section", "y=0"], &["--section has no effect"]);
    let caricature = ["lyapunov", "--quiet", "--switch", "filippov"];
    refused(at, &caricature, 3, &["slides on x = 0 into a two-fold", "--t-end"]);
    exponent(&["--t-end", "10", "--transient", "10"], &["--transient is 10"]);
    let out = good(
        at,
        &[
            "lyapunov",
            "--quiet",
            "--system",
            "relay-third-order",
            "--t-end",
            "300",
            "--format",
            "json",
        ],
    );
    let json: serde_json::Value = serde_json::from_slice(&out).unwrap();
    // On a closed orbit the largest exponent is that along it, zero.
    let exponent = json["facts"]["exponent"]["value"].as_f64().unwrap();
    assert!(exponent.abs() < 1e-2, "{exponent}");
}

/// One system in both forms: foci that unwind above y = 0 and wind up below (both exponents are the
/// mean of their rates, -0.1), and a block on a belt, whose sticking takes one direction away.
#[test]
fn exponents_of_filippov_motion_are_those_of_the_same_system_with_signs() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let exponents = |name: &str, text: &str, more: &[&str]| -> Vec<[Option<f64>; 2]> {
        fs::write(at.join(name), text).unwrap();
        let run = [
            "lyapunov",
            "--quiet",
            "--system",
            name,
            "--t-end",
            "700",
            "--transient",
            "100",
            "--format",
            "json",
        ];
        let json: serde_json::Value =
            serde_json::from_slice(&good(at, &[&run[..], more].concat())).unwrap();
        let list = json["facts"]["exponents"].as_array().unwrap();
        list.iter().map(|e| ["value", "half_width"].map(|key| e[key].as_f64())).collect()
    };
    let head = "states = ['x', 'y']\nstart = [1, 0.5]\n";
    let foci = "h = 'y'\nplus = ['0.1*x - y', 'x + 0.1*y']\nminus = ['-0.3*x - y', 'x - 0.3*y']\n";
    let foci_signs = "f = ['-y + x*(0.2*sign(y) - 0.1)', 'x + y*(0.2*sign(y) - 0.1)']\n";
    // Friction that falls with the speed, so that the block sticks in each period.
    let belt = "h = 'y - c'\nplus = ['y', '-x - 0.4 + 0.2*(y - c)']\n\
        minus = ['y', '-x + 0.4 + 0.2*(y - c)']\n[parameters]\nc = 1\n";
    let belt_signs = "f = ['y', '-x - 0.4*sign(y - c) + 0.2*(y - c)']\n[parameters]\nc = 0.5\n";
    for (surfaces, signs, set, expected) in
        [(foci, foci_signs, &[][..], Some(-0.1)), (belt, belt_signs, &["--set", "c=0.5"][..], None)]
    {
        let surfaces = exponents(
            "h.toml",
            &format!("{head}{surfaces}"),
            &[&["--switch", "filippov"], set].concat(),
        );
        let signs = exponents("f.toml", &format!("{head}{signs}"), &[]);
        assert_eq!((surfaces.len(), signs.len()), (2, 2));
        for (i, ([one, half], [other, _])) in surfaces.iter().zip(&signs).enumerate() {
            assert_eq!(one.is_some(), other.is_some(), "{i}");
            let (Some(one), Some(half)) = (one, half) else { continue };
            assert!((one - other.unwrap()).abs() < 1e-7, "{one} {other:?}");
            let known = expected.unwrap_or(0.0);
            assert!((one - known).abs() <= half.max(1e-7), "{one} +- {half}: {known}");
        }
        assert_eq!(surfaces[1][0].is_none(), expected.is_none());
    }
}

#[test]
fn streamed_rows_are_those_of_the_whole_and_thin_out() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let filippov = ["--switch", "filippov", "--exit", "random:exponential:0.5"];
    for more in [
        &[][..],
        &["--section", "y=0"],
        &filippov,
        &["--every", "0.01"],
        &[&filippov[..], &["--every", "0.01"]].concat(),
    ] {
        let run = [&["run", "--quiet", "--t-end", "150"][..], more].concat();
        let streamed = good(at, &run);
        good(at, &[&run[..], &["--format", "json", "--out", "whole.json"]].concat());
        let bytes = fs::read(at.join("whole.json")).unwrap();
        let (_, answer) = twofold::job::encode::from_json(&bytes).unwrap();
        let (heading, table) = twofold::job::encode::from_csv(&streamed).unwrap();
        let bits = |t: &twofold::job::Table| twofold::job::encode::bits(std::slice::from_ref(t));
        assert!(bits(&table) == bits(&answer.tables[0]), "{more:?}");
        assert!(heading.about["question"]["t_end"] == 150.0, "{more:?}");
        // To a file the same bytes.
        good(at, &[&run[..], &["--out", "run.csv"]].concat());
        assert_eq!(fs::read(at.join("run.csv")).unwrap(), streamed, "{more:?}");
    }
    let thin =
        good(at, &["run", "--quiet", "--t-end", "20000", "--every", "1000", "--method", "dopri5"]);
    let (_, table) = twofold::job::encode::from_csv(&thin).unwrap();
    assert_eq!(table.numbers("t"), (0..=20).map(|k| f64::from(k) * 1000.0).collect::<Vec<_>>());
    refused(at, &["run", "--every", "1", "--chord", "0.1"], 2, &["--chord has no effect"]);
    refused(at, &["run", "--every", "1", "--section", "y=0"], 2, &["--every has no effect"]);
    refused(at, &["run", "--every", "0"], 2, &["--every is 0"]);
}

/// `make gallery` draws every system that ships.
#[test]
fn the_gallery_is_whole() {
    let script = include_str!("../../scripts/gallery.sh");
    let drawn: Vec<&str> =
        script.lines().filter_map(|l| l.trim().strip_prefix("plot ")?.split(' ').next()).collect();
    for name in twofold::system::library::names().chain(twofold::system::library::general_names()) {
        assert!(drawn.contains(&name), "{name}");
    }
}

#[test]
fn scans_show_what_changes_and_where_starts_end() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    // One passage a period at 20 V, two different ones at 28 V, after the doubling at 24.5 V. The
    // way there is chaotic for some 170 periods.
    let scan = ["scan", "--quiet", "--system", "buck", "--period", "4e-4", "--t-end", "0.24"];
    let out = good(at, &[&scan[..], &["--over", "params.input=20,28", "--plot", "d.svg"]].concat());
    let (_, table) = twofold::job::encode::from_csv(&out).unwrap();
    let values = |input: f64| -> Vec<f64> {
        let rows = table.numbers("params.input").iter().zip(table.numbers("v"));
        rows.filter(|(s, _)| **s == input).map(|(_, v)| *v).collect()
    };
    let spread = |v: &[f64], step: usize| {
        v.windows(step + 1).map(|w| (w[step] - w[0]).abs()).fold(0.0, f64::max)
    };
    let (one, two) = (values(20.0), values(28.0));
    assert!(one.len() > 150 && spread(&one, 1) < 1e-5, "{} {}", one.len(), spread(&one, 1));
    assert!(
        spread(&two, 1) > 1e-2 && spread(&two, 2) < 1e-4,
        "{} {}",
        spread(&two, 1),
        spread(&two, 2)
    );
    assert!(
        fs::read_to_string(at.join("d.svg")).unwrap().contains("Voltage-controlled buck converter")
    );

    fs::write(
        at.join("wells.toml"),
        "states = ['x', 'y']\nstart = [1, 1]\nh = 'x - 9'\nplus = ['x - x^3', '-y']\nminus = ['x - \
            x^3', '-y']",
    )
    .unwrap();
    let map = ["scan", "--quiet", "--system", "wells.toml", "--section", "y=5", "--t-end", "40"];
    let over = [
        "--over",
        "start.x=-1.5..1.5:6",
        "--over",
        "start.y=-1..1:3",
        "--plot",
        "m.png",
        "--threads",
        "1",
    ];
    let out = good(at, &[&map[..], &over].concat());
    let (_, table) = twofold::job::encode::from_csv(&out).unwrap();
    for (x, number) in table.numbers("start.x").iter().zip(table.integers("number")) {
        assert_eq!(*number, if *x < 0.0 { 1 } else { 2 }, "{x}");
    }
    assert!(table.words("ending").all(|w| w == "rest") && table.len() == 18);
    // Threads change no byte.
    let again = good(at, &[&map[..], &over[..6], &["--threads", "3"]].concat());
    assert_eq!(again, out);

    let wrong =
        |more: &[&str], expected: &[&str]| refused(at, &[&map[..], more].concat(), 2, expected);
    wrong(&["--over", "start.x=-1..1:2", "--alike", "0.1"], &["--alike has no effect"]);
    wrong(&["--over", "start.x=-1..1:2", "--show", "y"], &["--show has no effect"]);
    wrong(&["--over", "start.x=-1..1:2", "--plot", "a.txt"], &[".png, .svg or .pdf"]);
    wrong(&["--over", "start.x=-1..1"], &["at random"]);
    wrong(&["--over", "start.q=-1..1:2"], &["start.q"]);
    wrong(&["--over", "eps=1,2", "--over", "start.y=1,2", "--over", "start.x=1,2"], &["3 times"]);
}
