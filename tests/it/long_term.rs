//! Long-term behaviour with known answers: every interval that is printed is to cover, and words
//! follow from significance.
#![cfg(feature = "cli")]
#![allow(clippy::disallowed_methods)] // compared with printed intervals, not with hashes

use std::f64::consts::PI;
use std::fs;

use assert_cmd::Command;
use regex::Regex;

/// Output of `twofold` for a system with these equations on both sides of h = 0.
fn printed(states: &str, h: &str, fields: [&str; 2], parameters: &str, command: &str) -> String {
    let folder = tempfile::tempdir().unwrap();
    let list = |text: &str| {
        text.split(',').map(|s| format!("'{}'", s.trim())).collect::<Vec<_>>().join(", ")
    };
    let [plus, minus] = fields.map(list);
    let start = vec!["0"; states.split(',').count()].join(", ");
    let text = format!(
        "name = 'known'\nstates = [{}]\nstart = [{start}]\nh = '{h}'\nplus = [{plus}]\nminus = \
            [{minus}]\n\
         [parameters]\n{parameters}\n",
        list(states)
    );
    fs::write(folder.path().join("known.toml"), text).unwrap();
    let mut words: Vec<&str> = command.split(' ').collect();
    words.extend(["--system", "known.toml", "--quiet"]);
    let out = Command::cargo_bin("twofold")
        .unwrap()
        .current_dir(folder.path())
        .args(&words)
        .output()
        .unwrap();
    let err = String::from_utf8_lossy(&out.stderr);
    assert!(out.status.success(), "{command}: {err}");
    String::from_utf8(out.stdout).unwrap()
}

/// A value and its printed error, the first two groups of a pattern.
fn interval(pattern: &str, text: &str) -> [f64; 2] {
    let found = Regex::new(pattern)
        .unwrap()
        .captures(text)
        .unwrap_or_else(|| panic!("{pattern} in {text}"));
    [1, 2].map(|k| found[k].parse().unwrap())
}

const MULTIPLIER: &str = r"multipliers +(\S+?),? .*each \+- (\S+)";
const EXPONENT: &str = r"(\S+) \+- (\S+) per unit time";

/// A system: its equations, the command, where the interval stands, what it is to cover, and its
/// largest half.
struct Known {
    name: String,
    text: String,
    pattern: String,
    value: f64,
    largest: f64,
}

fn smooth(states: &str, field: &str, parameters: &str, command: &str) -> String {
    let h = format!("{} + 1e9", states.split(',').next().unwrap());
    printed(states, &h, [field; 2], parameters, command)
}

fn known() -> Vec<Known> {
    let mut all = Vec::new();
    let mut add = |name: String, text: String, pattern: &str, value: f64, largest: f64| {
        all.push(Known { name, text, pattern: pattern.into(), value, largest });
    };
    // r' = a r (1 - r^2/size^2) about (centre, 0), turning at the rate w: the multiplier is exp(-4
    // pi a/w).
    for (a, size, centre, w) in [
        (0.05, 1.0, 0.0, 1.0),
        (0.5, 1.0, 0.0, 1.0),
        (0.02, 1e-6, 0.0, 3.0),
        (0.1, 1e4, 0.0, 0.5),
        (-0.03, 1.0, 0.0, 1.0),
        (0.1, 1.0, 5.0, 2.0),
        (1e-5, 1.0, 0.0, 1.0),
    ] {
        let field = format!("(x - {centre})*g - {w}*y, y*g + {w}*(x - {centre})")
            .replace('g', &format!("({a}*(1 - ((x - {centre})^2 + y^2)/{size:?}^2))"));
        let command =
            format!("orbit --section y=0 --settle 0 --start {:?},0", centre + 1.02 * size);
        let value = (-4.0 * PI * a / w).exp();
        let text = smooth("x, y", &field, "", &command);
        add(format!("circle {a} {size} {centre} {w}"), text, MULTIPLIER, value, 1e-5);
    }
    let orbit = "orbit --settle 0 --start 1,0 --section y=0 --downward";
    add("centre".into(), smooth("x, y", "y, -x", "", orbit), MULTIPLIER, 1.0, 1e-6);
    add("cubic centre".into(), smooth("x, y", "y, -x^3", "", orbit), MULTIPLIER, 1.0, 1e-6);
    let bounce = printed("x, y", "x", ["y, -1", "y, 1"], "", &format!("{orbit} --switch filippov"));
    add("bounce".into(), bounce, MULTIPLIER, 1.0, 1e-6);
    // Two different heights, and no loss.
    let uneven = printed("x, y", "x", ["y, -3", "y, 1"], "", &format!("{orbit} --switch filippov"));
    add("uneven bounce".into(), uneven, MULTIPLIER, 1.0, 1e-6);

    // r' = r (mu + (r/size)^2 - (r/size)^4): orbits fold at mu = -1/4 and vanish in a Hopf point at
    // mu = 0.
    for size in [1.0, 1e-3] {
        let field = "x*g - y, y*g + x"
            .replace('g', &"(mu + q - q^2)".replace('q', &format!("((x^2 + y^2)/{size:?}^2)")));
        let command = format!(
            "orbit --section y=0 --settle 0 --start {:?},0 --along mu=0.1..-0.4:10",
            1.05 * size
        );
        let text = smooth("x, y", &field, "mu = 0.1", &command);
        add(format!("fold {size}"), text.clone(), r"fold +at mu = (\S+) \+- (\S+)", -0.25, 1e-6);
        assert!(!text.contains("branching") && !text.contains("doubling"), "{text}");
        add(format!("fold then hopf {size}"), text, r"hopf +at mu = (\S+) \+- (\S+)", 0.0, 1e-6);
    }
    let field = "x*g - y, y*g + x".replace('g', "(mu - 0.3 - (x^2 + y^2)*1e4)");
    let command = "orbit --section y=0 --settle 0 --start 0.004,0 --along mu=0.5..0.1:10";
    add(
        "hopf".into(),
        smooth("x, y", &field, "mu = 0.5", command),
        r"hopf +at mu = (\S+) \+- (\S+)",
        0.3,
        1e-6,
    );
    // Beside the unit circle, d = r^2 - 1 and z obey a linear equation that turns by half a turn,
    // or by 0.3/(2 pi).
    let ring = |d: &str, z: &str| {
        let of = |text: &str| text.replace('d', "(x^2 + y^2 - 1)");
        format!("x*({0})/(2*(x^2 + y^2)) - y, y*({0})/(2*(x^2 + y^2)) + x, {1}", of(d), of(z))
    };
    let command = "orbit --section y=0 --settle 0 --start 1.01,0,0.01 --along mu=-0.07..0.05:10";
    let at = |word: &str| format!(r"{word} +at mu = (\S+) \+- (\S+)");
    let (c, s) = ("x/sqrt(x^2 + y^2)", "y/sqrt(x^2 + y^2)");
    let half = ring(
        &format!("(mu - 1)/2*d + (mu + 1)/2*({c}*d + {s}*z) - z/2"),
        &format!("(mu - 1)/2*z + (mu + 1)/2*({s}*d - {c}*z) + d/2"),
    );
    let text = smooth("x, y, z", &half, "mu = 0", command);
    add("period doubling".into(), text, &at("period-doubling"), 0.0, 1e-4);
    let torus = ring("mu*d - 0.3*z", "0.3*d + mu*z");
    add("torus".into(), smooth("x, y, z", &torus, "mu = 0", command), &at("torus"), 0.0, 1e-4);
    let fork = ring("-d", "mu*z - z^3");
    add(
        "pitchfork".into(),
        smooth("x, y, z", &fork, "mu = 0", command),
        &at("branching"),
        0.0,
        2e-2,
    );

    let exponent = |field: &str, start: &str, t: f64| {
        smooth("x, y", field, "", &format!("lyapunov --t-end {t} --start {start}"))
    };
    for (name, field, start, value) in [
        ("spiral", "-0.05*x - y, x - 0.05*y", "1,0", -0.05),
        ("slow spiral", "-0.01*x - 2*y, 2*x - 0.01*y", "1,0", -0.01),
        ("node", "-0.3*x, -y", "1,1", -0.3),
        ("saddle", "0.02*x, -y", "1,1", 0.02),
        ("centre", "y, -x", "1,0", 0.0),
        ("fast centre", "7*y, -7*x", "1e-4,0", 0.0),
        ("shear", "y, 0", "1,1", 0.0),
        ("pendulum", "y, -sin(x)", "1,0", 0.0),
        ("circle", "x*(1 - x^2 - y^2)/2 - y, y*(1 - x^2 - y^2)/2 + x", "1,0", 0.0),
    ] {
        let text = exponent(field, start, 400.0);
        if value == 0.0 {
            assert!(text.contains("not distinguishable from zero"), "{name}: {text}");
        }
        add(format!("exponent of a {name}"), text, EXPONENT, value, 2e-2);
    }
    all
}

/// Exponents of Filippov motion: at least 95 of 100 intervals cover what is known.
#[test]
fn intervals_of_exponents_through_switches_cover() {
    let mut missed = Vec::new();
    let mut tried = 0;
    let mut check = |name: String, h: &str, fields: [&str; 2], t: f64, expected: f64| {
        let command = format!("lyapunov --switch filippov --start 1,0.5 --t-end {t}");
        let [value, half] = interval(EXPONENT, &printed("x, y", h, fields, "", &command));
        // The growth of regular motion stays near its line, so half-widths fall like 1/t; the
        // widest seen was 5.8/t.
        assert!(half < 10.0 / t, "{name}: {value} +- {half} is too wide");
        tried += 1;
        if (value - expected).abs() > half + 5e-7 {
            missed.push(format!("{name} until {t}: {value} +- {half}, not {expected}"));
        }
    };
    for t in [150.0, 222.0, 300.0, 431.0] {
        // Foci whose rates change on y = 0: the mean of the two.
        for (a, b) in
            [(0.1, -0.3), (0.02, 0.04), (-0.01, -0.2), (0.3, -0.3), (0.05, -0.06), (-0.15, 0.1)]
        {
            let fields = [a, b].map(|r: f64| format!("{r}*x - y, x + {r}*y"));
            check(format!("foci {a} {b}"), "y", [&fields[0], &fields[1]], t, 0.5 * (a + b));
        }
        check("shear".into(), "x + 1e9", ["y, 0"; 2], t, 0.0);
        check("bounce".into(), "x", ["y, -1", "y, 1"], t, 0.0);
        check("stick-slip".into(), "y - 0.5", ["y, -x - 0.4", "y, -x + 0.4"], t, 0.0);
        check("sliding node".into(), "x", ["-1, -0.2*y", "1, -0.2*y"], t, -0.2);
    }
    assert!(tried >= 40 && missed.len() * 20 <= tried, "{tried} {missed:#?}");
}

/// 95 % intervals and error bounds: at least so many of all are to cover.
#[test]
fn printed_intervals_cover_what_is_known() {
    let all = known();
    assert!(all.len() >= 20);
    let mut missed = Vec::new();
    for k in &all {
        let [value, error] = interval(&k.pattern, &k.text);
        assert!(error <= k.largest, "{}: {value} +- {error} is too wide", k.name);
        // The value is printed to nine digits after the point.
        if (value - k.value).abs() > error + 5e-10 {
            missed.push(format!("{}: {value} +- {error}, not {}", k.name, k.value));
        }
    }
    assert!(missed.len() * 20 <= all.len(), "{missed:#?}");
    for neutral in all.iter().filter(|k| k.value == 1.0) {
        assert!(neutral.text.contains("not isolated"), "{}: {}", neutral.name, neutral.text);
    }
    let slow = all.iter().find(|k| k.name.starts_with("circle 0.00001")).unwrap();
    assert!(slow.text.contains("attracts"), "{}", slow.text);
}

/// Rests, of fields and of sliding, in units large and small: named with their eigenvalues, and no
/// closed orbits.
#[test]
fn a_rest_is_named_and_is_no_closed_orbit() {
    for unit in [1.0, 1e-6, 1e5] {
        let start = format!("{:?},{:?}", 1.2 * unit, 0.3 * unit);
        for (h, fields, switch, word, state, rate) in [
            ("x + 1e9", ["-0.07*x - 3*y, 3*x - 0.07*y"; 2], "", "equilibrium", "x = 0", 0.07),
            // Slides along x = 0 to y = 2 units at the rate 0.4.
            (
                "x",
                ["-UNIT, 0.4*(2*UNIT - y)", "UNIT, 0.4*(2*UNIT - y)"],
                " --switch filippov",
                "pseudo-equilibrium",
                "x = 0",
                0.4,
            ),
        ] {
            let fields = fields.map(|f| f.replace("UNIT", &format!("{unit:?}")));
            let plane = if word == "equilibrium" { "x=0".into() } else { format!("y={:?}", unit) };
            let command = format!("orbit --section {plane} --start {start}{switch}");
            let text = printed("x, y", h, [&fields[0], &fields[1]], "", &command);
            assert!(text.starts_with(word) && text.contains(state), "{unit}: {text}");
            let [_, found] =
                interval(r"(?s)eigenvalues +(-?\S+?),?\s.*attracts, by (\S+) per", &text);
            assert!((found - rate).abs() < 1e-6, "{unit}: {text}");
            assert!(!text.contains("closed orbit  "), "{text}");
        }
    }
}
