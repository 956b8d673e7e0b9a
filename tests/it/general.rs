//! General systems (f, events, modes, tables) as a user follows and draws them.
#![cfg(feature = "cli")]
#![allow(clippy::disallowed_methods)] // compared with tolerances, not with hashes

use std::fs;
use std::path::Path;

use assert_cmd::Command;
use serde_json::Value;
use twofold::job::Table;
use twofold::job::encode::from_csv;
use twofold::render::{decode_png, read_provenance};
use twofold::system::library;

fn twofold_in(folder: &Path, arguments: &[&str]) -> (i32, Vec<u8>, String) {
    let out = Command::cargo_bin("twofold")
        .unwrap()
        .current_dir(folder)
        .args(arguments)
        .output()
        .unwrap();
    (out.status.code().unwrap(), out.stdout, String::from_utf8(out.stderr).unwrap())
}

/// Runs a command that must succeed without a word on standard error.
fn good(folder: &Path, arguments: &[&str]) -> Vec<u8> {
    let (code, out, err) = twofold_in(folder, arguments);
    assert_eq!((code, err.as_str()), (0, ""), "{arguments:?}");
    out
}

fn refused(folder: &Path, arguments: &[&str], code: i32, expected: &[&str]) {
    let (found, out, err) = twofold_in(folder, arguments);
    assert_eq!(found, code, "{arguments:?}: {err}");
    assert!(out.is_empty(), "{arguments:?}");
    for words in expected {
        assert!(err.contains(words), "{arguments:?}: no {words:?} in {err}");
    }
}

/// The table of `twofold run` with these arguments.
fn run(folder: &Path, arguments: &[&str]) -> Table {
    let bytes = good(folder, &[&["run", "--quiet"], arguments].concat());
    from_csv(&bytes).unwrap().1
}

fn names(table: &Table) -> Vec<&str> {
    table.columns.iter().map(|c| c.name.as_str()).collect()
}

fn json(folder: &Path, arguments: &[&str]) -> (Value, String) {
    let (code, out, err) =
        twofold_in(folder, &[&["run", "--quiet", "--format", "json"], arguments].concat());
    assert_eq!(code, 0, "{arguments:?}: {err}");
    (serde_json::from_slice(&out).unwrap(), err)
}

fn near(found: f64, want: f64, within: f64) {
    assert!((found - want).abs() <= within, "{found} is not {want} to {within:e}");
}

/// (system, end time, columns)
const SHIPPED: [(&str, &str, &[&str]); 9] = [
    ("bouncing-ball", "2", &["t", "x", "v", "event"]),
    ("impact-oscillator", "2", &["t", "x", "v", "event"]),
    ("relay-hysteresis", "20", &["t", "T", "mode", "event"]),
    ("three-blocks", "2", &["t", "x1", "x2", "x3", "v1", "v2", "v3", "signs"]),
    ("sliding-mode-control", "2", &["t", "x", "v", "signs"]),
    ("buck", "0.002", &["t", "v", "i", "signs"]),
    ("cuk-converter", "0.0002", &["t", "i1", "v1", "i2", "v2", "signs"]),
    ("rimless-wheel", "2", &["t", "a", "w", "event"]),
    ("driven-by-data", "50", &["t", "height", "signs"]),
];

#[test]
fn every_general_system_that_ships_is_run_and_drawn() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    assert!(library::general_names().eq(SHIPPED.map(|(name, ..)| name)));
    for (name, t_end, columns) in SHIPPED {
        let common = ["--system", name, "--t-end", t_end];
        let table = run(at, &common);
        assert_eq!(names(&table), columns, "{name}");
        let t = table.numbers("t");
        assert!(t[0] == 0.0 && t[t.len() - 1] == t_end.parse::<f64>().unwrap(), "{name}");
        assert!(t.windows(2).all(|w| w[0] <= w[1]), "{name}");
        // Twice the same bytes, streamed or as a whole.
        let again = good(at, &[&["run", "--quiet"], &common[..]].concat());
        assert_eq!(good(at, &[&["run", "--quiet"], &common[..]].concat()), again, "{name}");
        good(at, &[&["run", "--quiet", "--out", "a.json"], &common[..]].concat());
        let (_, whole) =
            twofold::job::encode::from_json(&fs::read(at.join("a.json")).unwrap()).unwrap();
        let bits = |t: &Table| twofold::job::encode::bits(std::slice::from_ref(t));
        assert!(bits(&whole.tables[0]) == bits(&table), "{name}");
        good(at, &[&["plot", "--quiet", "--out", "a.png"], &common[..]].concat());
        let bytes = fs::read(at.join("a.png")).unwrap();
        let mut colours: Vec<[u8; 4]> =
            decode_png(&bytes).unwrap().rgba.chunks(4).map(|c| c.try_into().unwrap()).collect();
        colours.sort_unstable();
        colours.dedup();
        assert!(colours.len() > 20 && read_provenance(&bytes).unwrap().intact, "{name}");
    }
}

#[test]
fn switches_and_events_are_where_formulas_have_them() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    // A fall from 1: the first impact at sqrt(2/g), where v = -r v.
    let ball = run(
        at,
        &["--system", "bouncing-ball", "--set", "r=0.5", "--t-end", "1", "--every", "0.25"],
    );
    let (t, v) = (ball.numbers("t"), ball.numbers("v"));
    assert_eq!(
        ball.words("event").collect::<Vec<_>>(),
        ["", "", "impact", "impact", "", "", "impact", "impact", ""]
    );
    near(t[2], (2.0_f64 / 9.81).sqrt(), 1e-12);
    near(v[3], -0.5 * v[2], 1e-15);
    // Started elsewhere, the time begins elsewhere, too.
    let ball = run(
        at,
        &[
            "--system",
            "bouncing-ball",
            "--start",
            "2,0",
            "--t-start",
            "10",
            "--t-end",
            "11",
            "--every",
            "0.5",
        ],
    );
    let t = ball.numbers("t");
    assert_eq!(t[0], 10.0);
    near(t[2], 10.0 + (4.0_f64 / 9.81).sqrt(), 1e-12);
    // A section by any expression: x - v = 0.1.
    let ball = run(at, &["--system", "bouncing-ball", "--t-end", "3", "--section", "x - v = 0.1"]);
    assert_eq!(names(&ball), ["t", "x", "v", "direction"]);
    assert!(ball.len() >= 5);
    for (x, v) in ball.numbers("x").iter().zip(ball.numbers("v")) {
        near(x - v, 0.1, 1e-12);
    }
    // On its line the controlled state decays by e each unit of time.
    let control = run(at, &["--system", "sliding-mode-control", "--t-end", "4", "--every", "1"]);
    let x = control.numbers("x");
    near(x[4] / x[3], (-1.0_f64).exp(), 1e-9);
    assert_eq!(control.words("signs").last(), Some("0"));
    // Modes: the heater is off from 22 degrees on.
    let room = run(at, &["--system", "relay-hysteresis", "--t-end", "20"]);
    let rows = room.words("mode").zip(room.words("event")).collect::<Vec<_>>();
    assert!(
        rows.windows(2).any(|w| w[0] == ("on", "warm enough") && w[1] == ("off", "warm enough")),
        "{rows:?}"
    );
}

/// A tank's steady heights: inflow = outlet h^(1/2), and above the rim also spill (h - rim).
/// Two relays, the faster of which follows the other: z' is 0.5 or -0.25 by the order.
#[test]
fn the_order_of_two_relays_is_taken_and_recorded() {
    let folder = tempfile::tempdir().unwrap();
    let text = "states = ['x', 'y', 'z']\nstart = [0, 0, 0]\n\
        f = ['-sign(x) + 0.5*sign(y)', '-sign(y) - 0.25*sign(x)', 'sign(x)*sign(y)']";
    fs::write(folder.path().join("relays.toml"), text).unwrap();
    for (order, z) in [("x,y", 1.0), ("y,x", -0.5)] {
        let rule = format!("order:{order}");
        let arguments = ["--system", "relays.toml", "--t-end", "2", "--intersection", &rule];
        let table = run(folder.path(), &arguments);
        near(*table.numbers("z").last().unwrap(), z, 1e-12);
        let (data, _) = json(folder.path(), &arguments);
        let named: Vec<&str> = order.split(',').collect();
        assert_eq!(data["about"]["question"]["intersection"]["order"], serde_json::json!(named));
    }
    for (rule, said) in [
        ("order:x", "does not name y = 0"),
        ("order:x,q", "unknown name `q`"),
        ("order:x,z", "`z` is no switching function; give those that may meet, of x, y"),
        ("order:min(x,y", "a bracket is not closed"),
        ("fastest", "give bilinear, hull-least-norm, or order:"),
    ] {
        let code = if rule == "order:x" { 3 } else { 2 };
        refused(
            folder.path(),
            &[
                "run",
                "--quiet",
                "--system",
                "relays.toml",
                "--t-end",
                "2",
                "--out",
                "r.csv",
                "--intersection",
                rule,
            ],
            code,
            &[said],
        );
    }
}

#[test]
fn a_tank_follows_its_table_to_the_steady_heights() {
    let folder = tempfile::tempdir().unwrap();
    let tank =
        run(folder.path(), &["--system", "driven-by-data", "--t-end", "160", "--every", "10"]);
    let (t, h) = (tank.numbers("t"), tank.numbers("height"));
    let at = |time: f64| h[t.iter().position(|t| *t == time).unwrap()];
    near(at(40.0), 0.16, 1e-6);
    near(0.5 * at(60.0).sqrt() + 5.0 * (at(60.0) - 1.5), 0.9, 1e-9);
    near(at(160.0), 0.64, 1e-9);
}

/// Blocks stick as long as no spring's pull is larger than friction, 1; the first to slip does so
/// where its pull is 1.
#[test]
fn three_blocks_stick_until_one_is_pulled_off() {
    let folder = tempfile::tempdir().unwrap();
    let table =
        run(folder.path(), &["--system", "three-blocks", "--t-end", "12", "--every", "0.01"]);
    let column = |name: &str| table.numbers(name);
    let (x, v) = (["x1", "x2", "x3"].map(column), ["v1", "v2", "v3"].map(column));
    let signs: Vec<&str> = table.words("signs").collect();
    let pull = |k: usize| {
        let [a, b, c] = [x[0][k], x[1][k], x[2][k]];
        [-a + 1.2 * (b - a), -b + 1.2 * (a - b) + 1.2 * (c - b), -c + 1.2 * (b - c)].map(f64::abs)
    };
    let stuck: Vec<usize> = (0..signs.len()).filter(|k| signs[*k] == "000").collect();
    assert!(stuck.len() > 100, "{}", stuck.len());
    for k in &stuck {
        assert!((0..3).all(|i| (v[i][*k] - 0.2).abs() < 1e-12), "{k}");
        assert!(pull(*k).iter().all(|p| *p <= 1.0 + 1e-9), "{k}: {:?}", pull(*k));
    }
    // Rows are 0.01 apart, in which a pull changes by at most 0.002.
    let last = *stuck.iter().find(|k| signs.get(*k + 1).is_some_and(|s| *s != "000")).unwrap();
    let most = pull(last).into_iter().fold(0.0, f64::max);
    assert!(most > 1.0 - 0.0021, "{most}");
}

/// Fossas & Olivar (1996): at 24 V, below the doubling at 24.516 V, the orbit has the ramp's
/// period.
#[test]
fn a_buck_converter_takes_its_ramps_period() {
    let folder = tempfile::tempdir().unwrap();
    let buck = run(folder.path(), &["--system", "buck", "--t-end", "0.2", "--every", "0.0004"]);
    let v = buck.numbers("v");
    near(v[v.len() - 1], v[v.len() - 2], 1e-9);
}

#[test]
fn facts_say_how_a_run_ends() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let ball = library::general("bouncing-ball").unwrap();
    fs::write(at.join("ball.toml"), ball.replace("after_zeno = \"stick\"", "")).unwrap();
    let (answer, said) = json(at, &["--system", "ball.toml", "--t-end", "6"]);
    let zeno = &answer["facts"]["zeno"];
    let want = (2.0_f64 / 9.81).sqrt() * 1.8 / 0.2;
    near(zeno["t"].as_f64().unwrap(), want, zeno["error"].as_f64().unwrap() + 1e-11);
    assert_eq!((zeno["event"].as_str(), answer["stop"].as_str()), (Some("impact"), Some("found")));
    assert!(said.contains("infinitely often") && said.contains("after_zeno"), "{said}");
    // With after_zeno = "stick" it rests, and the run comes to its end.
    let (answer, said) = json(at, &["--system", "bouncing-ball", "--t-end", "6"]);
    assert_eq!((&answer["facts"]["t"], said.as_str()), (&6.0.into(), ""));
    assert!(answer["facts"]["zeno"].is_null());
    fs::write(at.join("stop.toml"), ball.replace("set = {", "stop = true\nset = {")).unwrap();
    let (answer, said) = json(at, &["--system", "stop.toml", "--t-end", "6"]);
    assert_eq!(answer["facts"]["stopped_by"], "impact");
    assert!(said.contains("impact ends the run at t = 0.45152364098"), "{said}");
    // Two tanks between which one inflow switches: no state is set, so that nothing can rest on a
    // surface.
    let tanks = "states = ['a', 'b']\nstart = [1, 1]\n[modes.left]\nf = ['1.5 - 1', \
        '-1']\n[modes.right]\nf = ['-1', '1.5 - 1']\n\
        [[event]]\nname = 'to b'\nwhen = 'b'\ndirection = 'down'\nfrom = 'left'\nmode = 'right'\n\
        [[event]]\nname = 'to a'\nwhen = 'a'\ndirection = 'down'\nfrom = 'right'\nmode = 'left'";
    fs::write(at.join("tanks.toml"), tanks).unwrap();
    let (answer, said) = json(at, &["--system", "tanks.toml", "--t-end", "9"]);
    near(answer["facts"]["zeno"]["t"].as_f64().unwrap(), 4.0, 1e-9);
    assert!(said.contains("infinitely often") && !said.contains("after_zeno"), "{said}");
}

/// On the circle x = cos t, v = -sin t: the section is crossed downwards at pi/3 and upwards at 5
/// pi/3.
#[test]
fn sections_say_their_direction_and_answers_their_switching_functions() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let text =
        "states = ['x', 'v']\nstart = [1, 0]\nf = ['v', '-x - 0*sign(v - 3) + 0*floor(x/9)']";
    fs::write(at.join("circle.toml"), text).unwrap();
    let arguments = ["--system", "circle.toml", "--t-end", "6", "--section", "x = max(v, 0.5)"];
    let crossings = run(at, &arguments);
    assert_eq!(names(&crossings), ["t", "x", "v", "signs", "direction"]);
    assert_eq!(crossings.words("direction").collect::<Vec<_>>(), ["down", "up"]);
    near(crossings.numbers("t")[0], std::f64::consts::FRAC_PI_3, 1e-9);
    let (answer, _) = json(at, &arguments);
    let functions = answer["facts"]["signs"].as_array().unwrap();
    assert_eq!(functions, &["v - 3", "floor(x/9)", "0.5 - v"]);
    let signs = crossings.words("signs").next().unwrap();
    assert_eq!((signs, signs.len()), ("-#+", functions.len()));
}

/// By Taylor series: the same motion, to more digits.
/// One system as an equation and as two fields: its rows on the surface that it slides upon are
/// the same, one where it comes to the surface.
#[test]
fn a_section_on_the_surface_has_one_rule() {
    let folder = tempfile::tempdir().unwrap();
    let states = "states = [\"x\", \"y\"]\nstart = [1, 0]\n";
    for (amplitude, rows) in [(0.5, 1), (1.5, 6)] {
        let wave = format!("{amplitude}*sin(y)");
        fs::write(
            folder.path().join("general.toml"),
            format!("{states}f = [\"-sign(x) + {wave}\", \"1\"]\n"),
        )
        .unwrap();
        fs::write(
            folder.path().join("sides.toml"),
            format!(
                "name = \"sides\"\n{states}h = \"x\"\nminus = [\"1 + {wave}\", \"1\"]\n\
                    plus = [\"-1 + {wave}\", \"1\"]\n"
            ),
        )
        .unwrap();
        let to = ["--t-end", "20", "--section", "x=0", "--system"];
        let one = run(folder.path(), &[&to[..], &["general.toml"]].concat());
        let two = run(folder.path(), &[&to[..], &["sides.toml", "--switch", "filippov"]].concat());
        assert_eq!(one.len(), rows);
        assert!(one.words("direction").eq(two.words("direction")));
        for (a, b) in one.numbers("t").iter().zip(two.numbers("t")) {
            near(*a, *b, 1e-6); // of other tolerances
        }
    }
}

#[test]
fn a_run_by_series_has_the_last_digits() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let arguments =
        ["--system", "bouncing-ball", "--method", "taylor", "--rtol", "1e-15", "--t-end", "3"];
    let (answer, _) = json(at, &arguments);
    assert_eq!(answer["about"]["question"]["method"]["name"], "taylor");
    let impacts: Vec<f64> = {
        let table = run(at, &arguments);
        let times =
            table.numbers("t").iter().zip(table.words("event")).filter(|(_, e)| *e == "impact");
        times.map(|(t, _)| *t).step_by(2).collect()
    };
    // The flights last 2 r^k sqrt(2/g).
    let (mut t, mut flight) = (0.0, (2.0_f64 / 9.81).sqrt());
    for (k, impact) in impacts.iter().enumerate() {
        t += flight;
        flight *= if k == 0 { 1.6 } else { 0.8 };
        near(*impact, t, 1e-14);
    }
    assert!(impacts.len() > 4, "{impacts:?}");
    for (name, t_end, _) in SHIPPED {
        let drawn = [
            "plot", "--quiet", "--method", "taylor", "--out", "a.png", "--system", name, "--t-end",
            t_end,
        ];
        good(at, &drawn);
    }
}

const GUST: &str = "name = 'gust'\nstates = ['x']\nstart = [0]\nf = ['wind - \
    x']\n[tables.wind]\nfile = 'wind.csv'\ntime = 't'\ncolumn = 'speed'\n";

#[test]
fn a_table_stands_beside_its_system() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    fs::create_dir(at.join("sub")).unwrap();
    fs::write(at.join("sub/gust.toml"), GUST).unwrap();
    refused(at, &["run", "--system", "sub/gust.toml"], 2, &["wind.csv"]);
    fs::write(at.join("sub/wind.csv"), "# measured\nt,speed\n0,0\n1,1\n5,1\n").unwrap();
    // x' = t - x until 1, then 1 - x.
    let table = run(at, &["--system", "sub/gust.toml", "--t-end", "4", "--every", "1"]);
    let x = table.numbers("x");
    near(x[1], (-1.0_f64).exp(), 1e-10);
    near(x[4], 1.0 - (1.0 - (-1.0_f64).exp()) * (-3.0_f64).exp(), 1e-10);
    let beyond = ["run", "--system", "sub/gust.toml", "--t-end", "9"];
    refused(at, &beyond, 2, &["table `wind` (wind.csv)", "from t = 0 to 5", "--t-end"]);
    for (text, expected) in [
        ("t,sped\n0,0\n1,1\n", "no column `speed`"),
        ("t,speed\n0,0\n0,1\n", "row 2: the time 0 does not come after"),
        ("t,speed\n0,0\n1,fast\n", "row 2: `fast` is not a finite number"),
        ("t,speed\n0,0\n", "at least two rows"),
    ] {
        fs::write(at.join("sub/wind.csv"), text).unwrap();
        refused(
            at,
            &["run", "--system", "sub/gust.toml", "--t-end", "1"],
            2,
            &["sub/gust.toml", "wind.csv", expected],
        );
    }
}

#[test]
fn wrong_files_and_flags_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    for (file, text, expected) in [
        (
            "a.toml",
            "states = ['x', 'v']\nf = ['v', 'if(x, 1, 2)']",
            &["--> a.toml:2:15", "^", "a condition is wanted here", "x > 0"][..],
        ),
        (
            "b.toml",
            "states = ['x']\nf = ['maxx(x, 0)']",
            &["--> b.toml:2:7", "did you mean `max`?"],
        ),
        (
            "c.toml",
            "states = ['x']\nf = ['1']\n[[event]]\nwhen = 'x'\nmode = 'on'",
            &["c.toml:5:8", "no mode `on`"],
        ),
        ("d.json", r#"{"states": ["x"], "f": ["y"]}"#, &["d.json, f.1", "unknown name `y`"]),
        ("e.toml", "states = ['x']\nf = ['1']", &["--start: a number for each of x"]),
    ] {
        fs::write(at.join(file), text).unwrap();
        refused(at, &["run", "--quiet", "--system", file], 2, expected);
    }
    let ball = |more: &[&str], code: i32, expected: &[&str]| {
        refused(
            at,
            &[&["run", "--quiet", "--system", "bouncing-ball"], more].concat(),
            code,
            expected,
        );
    };
    for (flag, value) in
        [("--switch", "filippov"), ("--eps", "0.1"), ("--delay", "1"), ("--seed", "3")]
    {
        ball(&[flag, value], 2, &[&format!("{flag} has no effect here")]);
    }
    ball(&["--print-spec"], 2, &["--print-spec has no effect"]);
    ball(
        &["--method", "taylor-extended"],
        2,
        &["dopri5", "taylor for many digits", "double precision"],
    );
    ball(&["--method", "layered"], 2, &["dopri5", "smoothed"]);
    let exponents =
        ["lyapunov", "--quiet", "--system", "sliding-mode-control", "--method", "taylor"];
    refused(at, &exponents, 2, &["carried by dopri5; leave --method taylor out"]);
    ball(&["--exit", "all"], 2, &["at-once:plus or at-once:minus"]);
    ball(&["--set", "q=1"], 2, &["no parameter `q`", "g, r"]);
    ball(&["--set", "r=1"], 2, &["--set \"r=1\": `r` is 1", "below 1"]);
    ball(&["--start", "1"], 2, &["--start: 1 given, 2 wanted"]);
    ball(&["--section", "x - w = 0"], 2, &["unknown name `w`"]);
    ball(&["--section", "x > v = 0"], 2, &["a condition is no number"]);
    ball(&["--section", "x = 0", "--every", "1"], 2, &["--every has no effect"]);
    ball(&["--t-start", "5", "--t-end", "1"], 2, &["--t-end, --t-start"]);
    let along = [
        "orbit",
        "--along",
        "q=0.5..0.6",
        "--quiet",
        "--system",
        "rimless-wheel",
        "--section",
        "a=0",
    ];
    refused(at, &along, 2, &["--along \"q=0.5..0.6\": the system has no parameter q; it has"]);
    for (axis, words) in [
        (
            "eps=1,2",
            "eps belongs to systems with h, plus and minus in up to four states; of a general",
        ),
        ("params.q=1,2", "no parameter `q`"),
        ("start.z=1,2", "no state z; it has x, v"),
    ] {
        refused(
            at,
            &["sweep", "--quiet", "--system", "bouncing-ball", "--over", axis],
            2,
            &[words],
        );
    }
    let sweep = ["sweep", "--quiet", "--system", "bouncing-ball"];
    refused(
        at,
        &[&sweep[..], &["--every", "1"]].concat(),
        2,
        &["--every has no effect", "no paths are recorded"],
    );
    refused(at, &[&sweep[..], &["--period", "-1"]].concat(), 2, &["--period is -1"]);
    refused(at, &["sweep", "--quiet", "--period", "1"], 2, &["--period has no effect"]);
    refused(
        at,
        &["run", "--system", "bouncing-bal"],
        2,
        &["did you mean bouncing-ball?", "driven-by-data"],
    );
    // A number that every orbit or run has of its own is not also given for all.
    let slip = ["--system", "stick-slip", "--section", "v=0", "--quiet"];
    let along = ["orbit", "--along", "belt=0.3..0.2", "--set", "belt=0.5"];
    refused(at, &[&along[..], &slip].concat(), 2, &["--set has no effect", "orbit its belt"]);
    let eps = ["orbit", "--along", "eps=1e-2..1e-3", "--eps", "1e-2"];
    refused(at, &[&eps[..], &slip].concat(), 2, &["--eps has no effect", "orbit its eps"]);
    let over = ["scan", "--over", "params.belt=0.3,0.2", "--set", "belt=0.5", "--t-end", "9"];
    refused(at, &[&over[..], &slip].concat(), 2, &["--set has no effect", "params.belt"]);
    let wheel = ["orbit", "--system", "rimless-wheel", "--section", "a=0", "--quiet"];
    let along = ["--along", "slope=0.1..0.2", "--set", "slope=0.1"];
    refused(at, &[&wheel[..], &along].concat(), 2, &["--set has no effect", "orbit its slope"]);
    // One state meets no section.
    fs::write(
        at.join("one.toml"),
        "states = ['x']\nstart = [1]\nh = 'x'\nplus = ['-1']\nminus = ['1']",
    )
    .unwrap();
    let one = ["sweep", "--system", "one.toml", "--over", "start.x=1,2", "--section", "x=0"];
    refused(at, &one, 2, &["two states or more"]);
    // A system with one switch still says what it lacks, and who has it.
    fs::write(at.join("f.toml"), "states = ['x']\nh = 'x'\nplus = ['max(x, 1)']\nminus = ['1']")
        .unwrap();
    refused(
        at,
        &["run", "--system", "f.toml"],
        2,
        &["f.toml:3:10", "(a + b + abs(a - b))/2", "f = [...] has max"],
    );
}

/// Falls from heights that parameters give, to the ground at 0: sqrt(2 h/g) each, however the rows
/// are computed.
#[test]
fn a_sweep_has_a_row_a_run() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let drop = "name = 'drop'\nstates = ['x', 'v']\nstart = ['2*half', 0]\n[parameters]\nhalf = \
        1\ng = { value = 10, above = 0 }\n\
        [modes.up]\nf = ['v', '-g']\n[modes.down]\nf = ['v', '-g']\n\
        [[event]]\nname = 'sinks'\nfrom = 'up'\nwhen = 'v + 1'\ndirection = 'down'\nmode = 'down'\n\
        [[event]]\nname = 'lands'\nwhen = 'x'\ndirection = 'down'\nstop = true";
    fs::write(at.join("drop.toml"), drop).unwrap();
    let sweep = |more: &[&str]| {
        let over = [
            "sweep",
            "--quiet",
            "--system",
            "drop.toml",
            "--over",
            "params.half=0.5,2",
            "--over",
            "params.g=5,-1,20",
        ];
        let (found, _, err) = twofold_in(at, &[&over[..], more].concat());
        assert_eq!(found, 3, "{err}");
    };
    sweep(&["--t-end", "3", "--out", "whole.csv"]);
    let whole = fs::read(at.join("whole.csv")).unwrap();
    let table = from_csv(&whole).unwrap().1;
    let words = |name: &str| table.words(name).map(str::to_owned).collect::<Vec<_>>();
    assert_eq!(words("outcome"), ["stopped", "failed", "stopped", "stopped", "failed", "stopped"]);
    assert_eq!(words("event")[..3], ["lands", "", "lands"]);
    assert_eq!(words("mode")[..3], ["down", "", "down"]);
    assert!(words("reason")[1].contains("above 0"), "{:?}", words("reason"));
    assert_eq!(table.integers("events"), [2, 0, 2, 2, 0, 2]);
    for (row, (half, g)) in
        [(0.5, 5.0), (0.5, -1.0), (0.5, 20.0), (2.0, 5.0), (2.0, -1.0), (2.0, 20.0_f64)]
            .iter()
            .enumerate()
    {
        if *g > 0.0 {
            near(table.numbers("end")[row], (4.0 * half / g).sqrt(), 1e-9);
            near(table.numbers("end.v")[row], -(4.0 * half * g).sqrt(), 1e-8);
        }
    }
    // In parts, through a journal, and again.
    for (shard, file) in [("1/2", "a.csv"), ("2/2", "b.csv")] {
        sweep(&["--t-end", "3", "--shard", shard, "--out", file]);
    }
    let (code, _, err) =
        twofold_in(at, &["sweep", "merge", "a.csv", "b.csv", "--quiet", "--out", "merged.csv"]);
    assert_eq!(code, 3, "{err}");
    assert_eq!(fs::read(at.join("merged.csv")).unwrap(), whole);
    sweep(&["--t-end", "3", "--resume", "--out", "a.csv"]);
    assert_eq!(fs::read(at.join("a.csv")).unwrap(), whole);
    let (code, _, err) = twofold_in(at, &["audit", "whole.csv", "--rows", "6"]);
    assert_eq!(code, 0, "{err}");
}

/// Outcomes with --section and with --period: events are no multiples of the period.
#[test]
fn a_sweep_says_what_runs_settle_on() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let text = "states = ['x']\nstart = [0.3]\nf = ['1']\n[parameters]\ntop = 1\n[[event]]\nwhen = \
        'x - top'\nset = { x = 0 }";
    fs::write(at.join("saw.toml"), text).unwrap();
    fs::write(
        at.join("well.toml"),
        "states = ['x', 'v']\nstart = [1, 0]\nf = ['v', 'p*x - x^3 - v']\n[parameters]\np = 1",
    )
    .unwrap();
    let saw = ["--system", "saw.toml", "--t-end", "300", "--over", "params.top=1,1.5"];
    let (found, seen) = outcomes(at, &[&saw[..], &["--period", "0.5"]].concat());
    assert_eq!((found, seen), (vec!["period-2".into(), "period-3".into()], vec![601, 601]));
    let (found, seen) = outcomes(at, &[&saw[..], &["--section", "x=0.5"]].concat());
    assert_eq!((found, seen), (vec!["period-1".into(), "period-1".into()], vec![300, 200]));
    assert_eq!(outcomes(at, &saw).0, ["moving", "moving"]);
    assert_eq!(
        outcomes(at, &["--system", "well.toml", "--t-end", "100", "--over", "params.p=1,4"]).0,
        ["rest", "rest"]
    );
    // Growth without end is no attractor, and has crossings enough.
    fs::write(
        at.join("unstable.toml"),
        "states = ['x', 'y']\nstart = [1, 0]\nf = ['0.02*x - y', 'x + 0.02*y']",
    )
    .unwrap();
    for end in ["300", "600"] {
        let grows = ["--system", "unstable.toml", "--t-end", end, "--section", "y=0"];
        let found = outcomes(at, &[&grows[..], &["--over", "start.x=0.5,1"]].concat());
        assert_eq!(found.0, ["undecided", "undecided"], "{end}");
    }
    let scan = [
        "scan",
        "--quiet",
        "--system",
        "saw.toml",
        "--t-end",
        "300",
        "--period",
        "0.5",
        "--over",
        "params.top=1",
    ];
    let table = from_csv(&good(at, &scan)).unwrap().1;
    assert!(table.numbers("x").iter().all(|x| (x - 0.3).abs() < 1e-9 || (x - 0.8).abs() < 1e-9));
}

/// Runs are looked at by multiples of --period and go on to --t-end, where an event may stop them.
#[test]
fn runs_seen_every_period_go_on_to_their_end() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let text = "states = ['x', 'n']\nstart = [1, 0]\nf = ['-x + a*cos(2*pi*t)', '0']\n\
        parameters = { a = 1 }\n[[event]]\nname = 'late'\nat = 50.8\nset = { n = '1' }\n\
        stop = true";
    fs::write(at.join("late.toml"), text).unwrap();
    let late = ["--system", "late.toml", "--period", "1", "--over", "params.a=1"];
    let sweep = [&["sweep", "--quiet", "--t-end", "50.9"][..], &late].concat();
    let table = from_csv(&good(at, &sweep)).unwrap().1;
    assert_eq!(table.words("outcome").next(), Some("stopped"));
    assert_eq!((table.numbers("end"), table.numbers("end.n")), (&[50.8][..], &[1.0][..]));
    let scan = ["--t-start", "0.5", "--t-end", "4.2"];
    let times =
        |more: &[&str]| scanned(at, &[&late[..], &scan, more].concat()).numbers("t").to_vec();
    assert_eq!(times(&[]), [3.0, 4.0]);
    assert_eq!(times(&["--follow", "up"]), [3.0, 4.0]);
    // A followed state is handed on a whole number of periods after the start.
    let both = |end: &str| {
        let over = ["--over", "params.a=1,2", "--t-start", "0.5", "--t-end", end];
        let base = ["--system", "late.toml", "--period", "1", "--follow", "up"];
        scanned(at, &[&base[..], &over].concat()).numbers("x")[..].to_vec()
    };
    let (whole, more) = (both("4.5"), both("4.6"));
    assert_eq!(whole.len(), more.len());
    for (x, y) in whole.iter().zip(&more) {
        near(*x, *y, 1e-9);
    }
}

/// Periods of the logistic map and of the converter that ships, wherever the origin of a state
/// lies: what is the same is measured by the swing.
#[test]
fn periods_do_not_depend_on_the_origin() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    fs::write(
        at.join("map.toml"),
        "states = ['x']\nstart = [0.3]\nf = ['0']\n[parameters]\nr = 3\nc = 0\n[[event]]\nevery = \
            1\nset = { x = 'c + r*(x - c)*(1 - (x - c))' }",
    )
    .unwrap();
    for (c, start) in [("0", "0.3"), ("1e4", "10000.3")] {
        let set = format!("c={c}");
        let map = ["--system", "map.toml", "--period", "1", "--t-end", "3000", "--set", &set];
        let over = ["--start", start, "--over", "params.r=2.8,3.2,3.5,3.55,3.565,3.845,3.57,3.9"];
        let expected = ["rest", "period-2", "period-4", "period-8", "period-16", "period-6"];
        // At 3.57 chaos in so narrow bands is not told from a long period.
        assert_eq!(
            outcomes(at, &[&map[..], &over].concat()).0,
            [&expected[..], &["undecided", "irregular"]].concat(),
            "{c}"
        );
    }
    // Doubled at 24.5166 V.
    let buck = ["--system", "buck", "--period", "400e-6", "--t-end", "1"];
    let found = outcomes(at, &[&buck[..], &["--over", "params.input=24,24.6,25"]].concat());
    assert_eq!(found.0, ["period-1", "period-2", "period-2"]);
}

/// A boost converter under control of its current, whose attractor is nearly a curve: exponents of
/// an exact map are 652, 1197 and 1979 a second.
#[test]
fn chaos_on_what_is_nearly_a_curve_is_told_by_its_exponent() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    fs::write(
        at.join("boost.toml"),
        "states = ['i', 'v']\nstart = [0.2, 16]\n[parameters]\nVin = 10\nL = 2e-3\nC = 100e-6\n\
         R = 20\nT = 100e-6\nIr = 1.5\n[modes.on]\nf = ['Vin/L', '-v/(R*C)']\n\
         [modes.off]\nf = ['(Vin - v)/L', '(i - v/R)/C']\n[[event]]\nwhen = 'i - Ir'\n\
         direction = 'up'\nfrom = 'on'\nmode = 'off'\n[[event]]\nevery = 'T'\nmode = 'on'",
    )
    .unwrap();
    let boost = ["--system", "boost.toml", "--period", "1e-4", "--t-end", "0.2"];
    let found = outcomes(at, &[&boost[..], &["--over", "params.Ir=2.4,2.6,3"]].concat());
    assert_eq!(found.0, ["irregular", "irregular", "irregular"]);
}

/// Orbits of a pendulum fill the plane: that through the start is found, to the separatrix, with
/// its period 4 K(k), k = v/2, by the arithmetic-geometric mean.
#[test]
fn an_orbit_that_is_not_isolated_is_the_nearest() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    fs::write(at.join("pendulum.toml"), "states = ['a', 'v']\nf = ['v', '-sin(a)']").unwrap();
    for v in [0.1, 1.0, 1.9, 1.99, 1.9999] {
        let start = format!("0,{v}");
        let orbit = ["orbit", "--system", "pendulum.toml", "--start", &start, "--section", "a=0"];
        let said = String::from_utf8(good(at, &[&orbit[..], &["--quiet"]].concat())).unwrap();
        let (mut a, mut b) = (1.0_f64, (1.0 - v * v / 4.0_f64).sqrt());
        while (a - b).abs() > 1e-14 {
            (a, b) = (0.5 * (a + b), (a * b).sqrt());
        }
        let of = |label: &str| said.lines().find_map(|l| l.strip_prefix(label)).unwrap().trim();
        let (found, exact) = (of("period").parse::<f64>().unwrap(), std::f64::consts::TAU / a);
        assert!((found / exact - 1.0).abs() < 1e-5, "{v}: {found} for {exact}");
        assert!(of("stability").starts_with("neutral"), "{v}: {said}");
    }
}

/// The outcomes and crossings of a sweep's rows.
fn outcomes(folder: &Path, flags: &[&str]) -> (Vec<String>, Vec<i64>) {
    let table = from_csv(&good(folder, &[&["sweep", "--quiet"], flags].concat())).unwrap().1;
    let words = table.words("outcome").map(str::to_owned).collect();
    (words, table.integers("crossings").to_vec())
}

/// Motion that is not decided, and the end of a domain: exit code 3, and the rows so far.
#[test]
fn runs_that_fail_keep_their_rows() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    fs::write(
        at.join("later.toml"),
        "states = ['x', 'y']\nstart = [0, -1]\nf = ['y*sign(x)', '1']",
    )
    .unwrap();
    fs::write(at.join("root.toml"), "states = ['x']\nstart = [4]\nf = ['-sqrt(x) - 1']").unwrap();
    fs::write(at.join("circle.toml"), "states = ['x', 'y']\nstart = [1, 0]\nf = ['y', '-x']")
        .unwrap();
    let leaves = 2.0 * (2.0 - 3.0_f64.ln());
    for (file, words, until) in [
        ("later.toml", &["not decided at t = 1", "x = 0", "--exit at-once:plus"][..], 1.0),
        (
            "root.toml",
            &["square root of a negative number", "`-sqrt(x) - 1`", "t = 1.8027"],
            leaves,
        ),
        ("circle.toml", &["1000 steps were made", "--max-steps"], 1e6),
    ] {
        let run = [
            "run",
            "--quiet",
            "--system",
            file,
            "--t-end",
            "1e6",
            "--every",
            "0.25",
            "--max-steps",
            "1000",
            "--out",
            "a.csv",
        ];
        refused(at, &run, 3, &[words, &["a.csv.part"]].concat());
        assert!(!at.join("a.csv").exists());
        let bytes = fs::read(at.join("a.csv.part")).unwrap();
        let table = from_csv(&bytes).unwrap().1;
        let t = table.numbers("t");
        assert!(t[0] == 0.0 && t[t.len() - 1] <= until + 1e-9 && t.len() >= 4, "{file}: {t:?}");
        assert!(String::from_utf8(bytes).unwrap().ends_with("# stop: failed\n"), "{file}");
    }
    // A side by name: x' = y from t = 1 on.
    let table = run(
        at,
        &["--system", "later.toml", "--t-end", "3", "--every", "1", "--exit", "at-once:plus"],
    );
    near(table.numbers("x")[3], 2.0, 1e-9);
}

/// A closed pipe is no error.
#[test]
fn a_reader_may_go_away() {
    for system in ["bouncing-ball", "stick-slip"] {
        let mut child = std::process::Command::new(env!("CARGO_BIN_EXE_twofold"))
            .args(["run", "--quiet", "--t-end", "3", "--system", system])
            .stdout(std::process::Stdio::piped())
            .stderr(std::process::Stdio::piped())
            .spawn()
            .unwrap();
        drop(child.stdout.take());
        let output = child.wait_with_output().unwrap();
        assert!(output.status.success() && output.stderr.is_empty(), "{system}: {output:?}");
    }
}

#[test]
fn pictures_in_every_format() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let ball = ["--system", "bouncing-ball", "--t-end", "5"];
    for (file, magic, more) in [
        ("a.svg", "<svg", &["--kind", "series", "--searchable"][..]),
        ("a.pdf", "%PDF", &[]),
        ("b.svg", "<svg", &["--section", "v = 0", "--searchable"]),
    ] {
        let all = [&["plot", "--quiet", "--out", file][..], &ball, more].concat();
        good(at, &all);
        let bytes = fs::read(at.join(file)).unwrap();
        assert!(bytes.starts_with(magic.as_bytes()), "{file}");
        good(at, &all);
        assert_eq!(fs::read(at.join(file)).unwrap(), bytes, "{file}");
    }
    let text = fs::read_to_string(at.join("a.svg")).unwrap();
    assert!(text.contains("A ball that bounces until it rests"));
    assert!(text.contains("g = 9.81, r = 0.8, t = 0 … 5, event-driven, dopri5"));
    good(at, &[&["run", "--quiet", "--out", "run.csv"][..], &ball].concat());
    let from = ["plot", "--from", "run.csv", "--out", "c.png"];
    refused(at, &from, 2, &["run.csv", "twofold plot --system bouncing-ball"]);
    refused(
        at,
        &["plot", "--system", "bouncing-ball", "--kind", "space", "--out", "c.png"],
        2,
        &["2"],
    );
}

#[test]
fn new_begins_with_a_general_system() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let list = String::from_utf8(good(at, &["new", "--list"])).unwrap();
    for name in library::general_names() {
        assert!(list.lines().any(|l| l.starts_with(&format!("{name} "))), "{name}: {list}");
    }
    assert!(list.contains("A ball that bounces until it rests (x, v)"));
    good(at, &["new", "my.toml", "--from", "bouncing-ball"]);
    assert_eq!(
        fs::read_to_string(at.join("my.toml")).unwrap(),
        library::general("bouncing-ball").unwrap()
    );
    good(at, &["run", "--quiet", "--system", "my.toml", "--t-end", "1"]);
    // A table comes with its system, and replaces nothing unasked.
    fs::create_dir(at.join("sub")).unwrap();
    let said =
        String::from_utf8(good(at, &["new", "sub/tank.toml", "--from", "driven-by-data"])).unwrap();
    assert!(said.contains("tank.toml and sub"), "{said}");
    let table = || fs::read_to_string(at.join("sub/inflow.csv")).unwrap();
    assert_eq!(table(), library::table("inflow.csv").unwrap());
    good(at, &["run", "--quiet", "--system", "sub/tank.toml", "--t-end", "1"]);
    fs::write(at.join("sub/inflow.csv"), "mine").unwrap();
    let again = ["new", "sub/other.toml", "--from", "driven-by-data"];
    refused(at, &again, 2, &["inflow.csv is there already; choose another folder", "--force"]);
    assert!(table() == "mine" && !at.join("sub/other.toml").exists());
    good(at, &[&again[..], &["--force"]].concat());
    assert!(table() != "mine");
    refused(
        at,
        &["new", "-", "--from", "driven-by-data"],
        2,
        &["inflow.csv", "give a file's name"],
    );
    refused(at, &["new", "a.toml", "--from", "bouncing-bal"], 2, &["did you mean bouncing-ball?"]);
}

/// Systems and specs that a command does not take: advice names another that it does.
#[test]
fn advice_about_another_kind_of_file_can_be_followed() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let text = library::text("two-blocks").unwrap();
    fs::write(at.join("blocks.toml"), text).unwrap();
    let json = serde_json::to_string(&text.parse::<toml::Table>().unwrap()).unwrap();
    fs::write(at.join("blocks.json"), json).unwrap();
    for system in ["two-blocks", "blocks.toml", "blocks.json"] {
        let rests = ["rests", "--system", system];
        refused(at, &rests, 2, &["it has two switching surfaces (h and [second])"]);
    }
    fs::write(at.join("spec.json"), "{}").unwrap();
    let spec = ["run", "--spec", "spec.json"];
    refused(at, &spec, 2, &["make one with `twofold run ... --print-spec`", "`twofold figure FIG"]);
}

const FOLDS: &str = "states = ['x']\nstart = [-1]\nf = ['p + x - x^3']\n[parameters]\np = 0\n";

/// The table of `twofold scan` with these arguments.
fn scanned(folder: &Path, arguments: &[&str]) -> Table {
    from_csv(&good(folder, &[&["scan", "--quiet"], arguments].concat())).unwrap().1
}

/// A decay that is kicked by 1 at every whole time, looked at then: after the kick, as `orbit`
/// does, x = 1/(1 - 1/e).
#[test]
fn scans_and_orbits_see_the_state_after_a_kick() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let kicked = "states = ['x']\nf = ['-k*x']\nstart = [0]\n[parameters]\nk = 1\n[[event]]\n\
        every = 1\nset = { x = 'x + 1' }";
    fs::write(at.join("kicked.toml"), kicked).unwrap();
    let after = 1.0 / (1.0 - (-1.0_f64).exp());
    let system = ["--system", "kicked.toml", "--period", "1"];
    let scan = ["--t-end", "80", "--over", "params.k=1"];
    let seen = scanned(at, &[&system[..], &scan].concat());
    assert!(seen.len() > 30);
    for x in seen.numbers("x") {
        assert!((x - after).abs() < 1e-9, "{x} {after}");
    }
    let orbit =
        String::from_utf8(good(at, &[&["orbit", "--quiet"], &system[..]].concat())).unwrap();
    assert!(orbit.contains("x = 1.58197670"), "{orbit}");
}

/// An attractor is followed past the place where another begins: two folds at p = -+2/sqrt(27), and
/// both branches between them.
#[test]
fn scans_follow_attractors_up_and_down() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    fs::write(at.join("folds.toml"), FOLDS).unwrap();
    let base = [
        "--system",
        "folds.toml",
        "--over",
        "params.p=-0.6..0.6:25",
        "--period",
        "1",
        "--t-end",
        "60",
    ];
    let both = scanned(at, &[&base[..], &["--follow", "both", "--plot", "f.svg"]].concat());
    assert_eq!(names(&both), ["params.p", "follow", "t", "x"]);
    let ways: Vec<String> = both.words("follow").map(str::to_owned).collect();
    let fold = 2.0 / 27.0_f64.sqrt();
    let mut seen = [0, 0];
    for row in 0..both.len() {
        let (p, x) = (both.numbers("params.p")[row], both.numbers("x")[row]);
        let above = if ways[row] == "up" { p > fold } else { p > -fold };
        assert_eq!(x > 0.0, above, "{} at p = {p}: {x}", ways[row]);
        near(p + x - x.powi(3), 0.0, 1e-6);
        seen[usize::from(ways[row] == "up")] += 1;
    }
    assert!(seen.iter().all(|n| *n > 25 * 20), "{seen:?}");
    assert!(fs::read_to_string(at.join("f.svg")).unwrap().starts_with("<svg"));
    // Without it every run begins at the file's start, and the rows do not depend on the threads.
    let one = scanned(at, &base);
    assert_eq!(names(&one), ["params.p", "t", "x"]);
    assert!(
        one.numbers("params.p")
            .iter()
            .zip(one.numbers("x"))
            .all(|(p, x)| (*x > 0.0) == (*p > fold))
    );
    for follow in ["up", "down", "both"] {
        let flags =
            |n| [&["scan", "--quiet", "--threads", n, "--follow", follow][..], &base].concat();
        assert_eq!(good(at, &flags("1")), good(at, &flags("2")));
    }
    // Systems with h, plus and minus are followed by their crossings.
    let slip = [
        "--system",
        "stick-slip",
        "--section",
        "x=0.5",
        "--over",
        "params.belt=0.3,0.4",
        "--t-end",
        "20",
    ];
    let up = scanned(at, &[&slip[..], &["--follow", "up"]].concat());
    assert_eq!(names(&up), ["params.belt", "follow", "t", "x", "v"]);
    let sliding = scanned(at, &[&slip[..], &["--follow", "down", "--switch", "filippov"]].concat());
    assert_eq!(sliding.numbers("params.belt").first(), Some(&0.4));
    // The state of a switch with a memory beside the coordinates is not handed on.
    let memory =
        [&["scan", "--quiet", "--follow", "up", "--switch", "hysteretic"][..], &slip].concat();
    refused(at, &memory, 2, &["of a switch with a memory"]);
    for (more, says) in [
        (&["--follow", "up", "--section", "x=0"][..], "--period has no effect"),
        (&["--over", "start.x=0,1", "--follow", "up"], "give --over once"),
        (&["--every", "1"], "--every has no effect"),
    ] {
        refused(at, &[&["scan", "--quiet"][..], &base, more].concat(), 2, &[says]);
    }
    let scan = ["scan", "--quiet", "--system", "folds.toml"];
    for (more, says) in [
        (
            &["--over", "start.x=0,1", "--follow", "up", "--period", "1"][..],
            "begins where the run before ended",
        ),
        (&["--over", "params.p=0,1"], "give --period (any, of equations"),
        (&["--over", "params.q=0,1", "--period", "1"], "no parameter `q`"),
        (
            &["--over", "eps=0.1,0.2", "--period", "1"],
            "eps belongs to systems with h, plus and minus",
        ),
        (&["--over", "params.p=0..1", "--period", "1"], "drawn at random"),
        (&["--over", "params.p=0,1", "--period", "0"], "--period is 0"),
    ] {
        refused(at, &[&scan[..], more].concat(), 2, &[says]);
    }
}

/// The buck converter's first period doubling lies between 24 and 25 V (Deane & Hamill 1990).
#[test]
fn a_scan_shows_a_period_doubling() {
    let folder = tempfile::tempdir().unwrap();
    let scan =
        ["--system", "buck", "--period", "4e-4", "--t-end", "0.12", "--over", "params.input=24,25"];
    let table = scanned(folder.path(), &scan);
    let points = |input: f64| -> Vec<f64> {
        let mut found: Vec<f64> = (0..table.len())
            .filter(|r| table.numbers("params.input")[*r] == input)
            .map(|r| table.numbers("v")[r])
            .collect();
        found.sort_by(f64::total_cmp);
        found.dedup_by(|a, b| (*a - *b).abs() < 1e-4);
        found
    };
    assert_eq!((points(24.0).len(), points(25.0).len()), (1, 2));
}

/// At a section by its only state a system has one point, and a picture would show rounding.
#[test]
fn a_scan_of_one_state_is_no_section_of_it() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    fs::write(
        at.join("relay.toml"),
        "states = ['x']\nstart = [1]\nh = 'x'\nplus = ['-1']\nminus = ['p']\n\
        [parameters]\np = 1",
    )
    .unwrap();
    fs::write(
        at.join("driven.toml"),
        "states = ['x']\nstart = [0]\nf = ['sin(t) - p*x']\n\
        [parameters]\np = 1",
    )
    .unwrap();
    for (system, section, over) in [
        ("relay-hysteresis", "T=20", "params.k=0.1,0.2"),
        ("relay-hysteresis", "(T - cold)*(T - warm) = 0", "params.k=0.1,0.2"),
        ("relay.toml", "x=0", "params.p=1,2"),
        ("driven.toml", "x=0", "params.p=1,2"),
    ] {
        let scan = ["scan", "--system", system, "--section", section, "--over", over];
        refused(at, &scan, 2, &["it has one value", "give --period", "twofold orbit --along"]);
    }
    let driven = ["--system", "driven.toml", "--section", "sin(t)=0", "--t-end", "50"];
    let table = scanned(at, &[&driven[..], &["--over", "params.p=1,2"]].concat());
    // x = (p sin t - cos t)/(1 + p^2) in the end, seen at t = 0 and pi.
    for (p, x) in table.numbers("params.p").iter().zip(table.numbers("x")) {
        near(x.abs(), 1.0 / (1.0 + p * p), 1e-8);
    }
    assert!(table.len() >= 4);
}

/// Over two settings: a map of what general systems end on.
#[test]
fn scans_of_general_systems_map_endings() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    fs::write(
        at.join("wells.toml"),
        "states = ['x', 'v']\nstart = [0, 0]\nf = ['v', 'x - x^3 - 0.3*v']\n[[event]]\nname = \
            'edge'\nwhen = 'x - 3'\nstop = true",
    )
    .unwrap();
    let map = ["--system", "wells.toml", "--section", "v=0", "--t-end", "120"];
    let over = ["--over", "start.x=-2..2:5", "--over", "start.v=0,8", "--plot", "m.png"];
    let table = scanned(at, &[&map[..], &over].concat());
    assert_eq!(names(&table), ["start.x", "start.v", "ending", "number", "reason"]);
    let words: Vec<&str> = table.words("ending").collect();
    // Two wells and the saddle between them; one start runs over the edge.
    assert_eq!(words[4], "rest", "at the saddle");
    assert!(words.contains(&"stopped by edge"), "{words:?}");
    let mut rests: Vec<i64> = (0..table.len())
        .filter(|r| words[*r] == "rest")
        .map(|r| table.column("number").unwrap().get(r).value() as i64)
        .collect();
    rests.sort_unstable();
    rests.dedup();
    assert_eq!(rests.len(), 3, "{words:?}");
    // A driven one: closed orbits.
    let driven =
        ["--system", "impact-oscillator", "--period", "2.243994752564138", "--t-end", "400"];
    let over = ["--over", "start.x=-0.1,0.1", "--over", "start.v=0,0.1"];
    let table = scanned(at, &[&driven[..], &over].concat());
    assert!(
        table.words("ending").all(|w| w.starts_with("period-") || w == "irregular"),
        "{:?}",
        table.words("ending").collect::<Vec<_>>()
    );
}

/// Derivatives of a run's end, from the command.
#[test]
fn sensitivities_of_a_run() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    fs::write(
        at.join("decay.toml"),
        "states = ['x']\nstart = [1]\nf = ['-k*x']\n[parameters]\nk = 2",
    )
    .unwrap();
    let base = ["sensitivities", "--quiet", "--system", "decay.toml", "--t-end", "1"];
    let table = from_csv(&good(at, &[&base[..], &["--format", "csv"]].concat())).unwrap().1;
    assert_eq!(names(&table), ["state", "value", "start.x", "params.k"]);
    let e = (-2.0_f64).exp();
    for (name, want) in [("value", e), ("start.x", e), ("params.k", -e)] {
        near(table.numbers(name)[0], want, 1e-9);
    }
    let text = String::from_utf8(good(at, &base)).unwrap();
    assert!(text.starts_with("at t = 1\n") && text.contains("params.k"), "{text}");
    refused(at, &[&base[..], &["--by", "q"]].concat(), 2, &["no parameter `q`; the system has k"]);
    refused(at, &[&base[..], &["--section", "x=0.5"]].concat(), 2, &["--section has no effect"]);
    refused(at, &["sensitivities", "--t-end", "5"], 2, &["give --switch filippov"]);
    // Sliding takes away what is normal to the surface.
    let slip = [
        "sensitivities",
        "--system",
        "stick-slip",
        "--switch",
        "filippov",
        "--start",
        "0.5,0.3",
        "--t-end",
        "1",
    ];
    let table =
        from_csv(&good(at, &[&slip[..], &["--format", "csv", "--by", "belt"]].concat())).unwrap().1;
    let v = table.words("state").position(|s| s == "v").unwrap();
    near(table.numbers("start.v")[v], 0.0, 1e-12);
    near(table.numbers("params.belt")[v], 1.0, 1e-9);
}

/// A picture says how its run ended, a branch that is written to a file where it bifurcates, a rest
/// at which the fields are tangent that it has no linear motion.
#[test]
fn pictures_branches_and_rests_say_what_they_found() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let ball = "states = ['x', 'v']\nstart = [1, 0]\nf = ['v', '-9.81']\n[[event]]\nname = \
        'impact'\nwhen = 'x'\ndirection = 'down'\nset = { v = '-0.8*v' }";
    fs::write(at.join("ball.toml"), ball).unwrap();
    let (code, _, err) =
        twofold_in(at, &["plot", "--quiet", "--system", "ball.toml", "--out", "ball.svg"]);
    assert!(
        code == 0 && err.contains("impact happens infinitely often before t = 4.0637"),
        "{err}"
    );
    let (code, _, err) = twofold_in(
        at,
        &[
            "orbit",
            "--system",
            "buck",
            "--period",
            "400e-6",
            "--settle",
            "0.05",
            "--along",
            "input=24.4..24.6:4",
            "--out",
            "branch.csv",
        ],
    );
    assert!(code == 0 && err.contains("period-doubling: at input = 24.516"), "{err}");
    fs::write(at.join("fused.toml"), "states = ['x', 'y']\nf = ['y', '-x - 0.2*sign(x)']").unwrap();
    let within = ["--within", "x=-3..3", "--within", "y=-3..3"];
    let rests = good(at, &[&["rests", "--system", "fused.toml"][..], &within].concat());
    let rests = String::from_utf8(rests).unwrap();
    assert!(rests.contains("to which the fields are tangent: x = 0, y = 0"), "{rests}");
    assert_eq!(rests.lines().count(), 1, "{rests}");
    refused(at, &["rests", "--system", "none.toml"], 2, &["cannot read none.toml"]);
    let turned = ["rests", "--system", "fused.toml", "--within", "x=3..-3"];
    refused(at, &turned, 2, &["the lower bound comes first"]);
}

/// x' = y and y' pushed back to y = 0, beside eighteen decays: Filippov's motion slides from
/// y(t) = 0 on, the smoothed one lies where the mixture is at rest, y = eps atanh(2 phi - 1).
#[test]
fn systems_of_many_states_are_general_ones() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let states: Vec<String> =
        ["x".into(), "y".into()].into_iter().chain((1..=18).map(|k| format!("a{k}"))).collect();
    let field = |y: &str| {
        let decays = (1..=18).map(|k| format!("-{k}*a{k}"));
        ["y".to_owned(), y.to_owned()].into_iter().chain(decays).collect::<Vec<_>>()
    };
    let start = [vec![0.3, 0.2], vec![1.0; 18]].concat();
    let text = format!(
        "states = {states:?}\nstart = {start:?}\nh = 'y'\nplus = {:?}\nminus = {:?}\n",
        field("-x - 1"),
        field("1 - x")
    );
    fs::write(at.join("many.toml"), text).unwrap();
    let base = ["--system", "many.toml", "--t-end", "2", "--every", "1"];
    let slid = run(at, &[&base[..], &["--switch", "filippov"]].concat());
    assert_eq!(slid.words("signs").collect::<Vec<_>>(), ["+", "0", "0"]);
    let smoothed = run(at, &[&base[..], &["--eps", "0.01"]].concat());
    for table in [&slid, &smoothed] {
        for k in 1..=18 {
            let found = table.numbers(&format!("a{k}"));
            near(found[1], (-f64::from(k)).exp(), 1e-9);
        }
    }
    near(slid.numbers("y")[2], 0.0, 1e-12);
    // phi = (1 - x)/2 where y' is 0; y' = -2 phi + 1 - x drifts by x' = y, a thousandth of that.
    let x = smoothed.numbers("x")[2];
    near(smoothed.numbers("y")[2], 0.01 * (-x).atanh(), 1e-4);
    // The width is a parameter.
    let by_eps = ["sensitivities", "--quiet", "--by", "eps", "--eps", "0.01"];
    let table = from_csv(&good(at, &[&by_eps[..], &base[..4], &["--format", "csv"]].concat()));
    assert!(names(&table.unwrap().1).contains(&"params.eps"));
    let of = ["--system", "many.toml"];
    for (flags, expected) in [
        (&["--switch", "relay", "--band", "0.1"][..], "only systems of up to four states"),
        (&["--switch", "filippov", "--eps", "0.1"], "--eps has no effect"),
        (&["--kick-every", "1"], "belongs to systems of up to four states, and this one has more"),
        (&["--exit", "at-once:plus"], "belongs to the discontinuous system"),
        (&["--eps", "nan"], "--eps is NaN: give a finite number above zero"),
        (&["--method", "layered"], "general systems are followed by dopri5"),
    ] {
        refused(at, &[&["run"][..], &of, flags].concat(), 2, &[expected]);
    }
    // Judged by the crossings of the second state's zero.
    let sweep = ["sweep", "--quiet", "--over", "params.eps=0.1", "--t-end", "9", "--out", "s.csv"];
    good(at, &[&sweep[..], &of].concat());
    let text = fs::read_to_string(at.join("s.csv")).unwrap();
    assert!(!text.contains("moving"), "{text}");
    let over = ["scan", "--eps", "0.1", "--over", "params.eps=0.1,0.2", "--section", "y=0"];
    refused(at, &[&over[..], &of].concat(), 2, &["params.eps"]);
    let named = "states = ['a', 'b', 'c', 'd', 'min']\nh = 'a'\nplus = ['1', '1', '1', '1', '1']\n\
        minus = ['1', '1', '1', '1', '1']\nstart = [1, 1, 1, 1, 1]\n";
    fs::write(at.join("named.toml"), named).unwrap();
    let of = ["run", "--system", "named.toml"];
    refused(at, &of, 2, &["`min` has a meaning of its own", "of more than 4 states"]);
}
