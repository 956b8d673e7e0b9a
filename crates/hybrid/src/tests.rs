//! Known results, each by formula or by an independent program.

use crate::motion::Outcome;
use crate::motion::{Exit, Method, Record, follow_to_rest, sensitivity, tangent};
use crate::{Definition, Ending, HybridError, Model, Options, follow};

fn model(text: &str) -> Model {
    Model::new(Definition::from_toml(text, "test.toml").unwrap_or_else(|e| panic!("{e}")))
}

/// The events of a run with their times, and how it ends.
fn run(model: &Model, t_end: f64) -> (Vec<(f64, String)>, Result<Outcome, HybridError>) {
    let mut events = Vec::new();
    let options = Options { t_end, ..Options::default() };
    let outcome = follow(model, &options, &mut |point| {
        events.extend(point.event.map(|e| (point.t, e.to_owned())));
        true
    });
    (events, outcome)
}

fn end(text: &str, t_end: f64) -> Vec<f64> {
    let (_, outcome) = run(&model(text), t_end);
    let outcome = outcome.unwrap_or_else(|e| panic!("{e}\n{text}"));
    assert_eq!(outcome.ending, Ending::Finished, "{text}");
    outcome.x
}

fn near(found: f64, want: f64, within: f64) {
    assert!((found - want).abs() <= within, "{found} is not {want} to {within:e}");
}

fn shipped(name: &str) -> Model {
    let text = twofold_system::library::general(name).unwrap();
    let mut model = model(text);
    for (table, entry) in model.definition().tables().to_vec() {
        model =
            model.with_table(&table, twofold_system::library::table(&entry.file).unwrap()).unwrap();
    }
    model
}

#[test]
fn every_general_system_that_ships_is_read_and_followed() {
    for name in twofold_system::library::general_names() {
        let model = shipped(name);
        assert_eq!(model.definition().name(), name);
        assert!(
            !model.definition().title().is_empty()
                && !model.definition().document().references.is_empty()
        );
        let t_end = match name {
            "buck" => 0.01,
            "cuk-converter" => 0.001,
            _ => 5.0,
        };
        run(&model, t_end).1.unwrap_or_else(|e| panic!("{name}: {e}"));
    }
}

/// Impacts accumulate at sqrt(2 h/g) (1 + r)/(1 - r).
#[test]
fn a_ball_comes_to_rest_when_its_impacts_accumulate() {
    let zeno = (2.0_f64 / 9.81).sqrt() * 1.8 / 0.2;
    let (events, outcome) = run(&shipped("bouncing-ball"), 10.0);
    let outcome = outcome.unwrap();
    let (t, name) = events.last().unwrap();
    assert_eq!((name.as_str(), outcome.ending), ("impact at rest", Ending::Finished));
    near(*t, zeno, 1e-11);
    near(outcome.x[0], 0.0, 1e-15);
    assert_eq!(outcome.x[1], 0.0);
    // Without a word about what comes after: it ends there, with a bound that holds.
    let text = twofold_system::library::general("bouncing-ball")
        .unwrap()
        .replace("after_zeno = \"stick\"\n", "");
    let Ending::Zeno { event, t, error } = run(&model(&text), 10.0).1.unwrap().ending else {
        panic!("no accumulation")
    };
    assert_eq!(event, "impact");
    assert!((t - zeno).abs() <= error && error < 1e-9, "{t} {error}");
}

/// A section that is never met gives no row to ask with.
#[test]
fn a_run_without_rows_says_its_time_and_can_be_ended() {
    let model = model("states = ['x', 'v']\nstart = [1, 0]\nf = ['v', '-x']");
    let section = twofold_system::Expression::parse_general("x - 2", &["x", "v"]).unwrap();
    let options = Options { t_end: 1e6, record: Record::Section(section), ..Options::default() };
    let times = std::cell::RefCell::new(Vec::new());
    let outcome =
        crate::follow_watched(&model, &options, &mut |_| panic!("no row is there"), &|t| {
            times.borrow_mut().push(t);
            t < 100.0
        });
    assert_eq!(outcome.unwrap().ending, Ending::Interrupted);
    let times = times.into_inner();
    assert!(
        times.len() > 10 && times.is_sorted() && (100.0..150.0).contains(times.last().unwrap()),
        "{times:?}"
    );
}

/// Inelastic impacts rest at once; a table that moves lets go where it falls faster than the ball.
#[test]
fn contacts_open_where_the_surface_falls_away() {
    let ball = |r: &str| {
        format!(
            "states = ['x', 'v']\nstart = [1, 0]\nf = ['v', '-1']\n[let]\ntable = \
                '0.5*sin(2*t)'\n[[event]]\nwhen = 'x - table'\ndirection = 'down'\n\
             set = {{ v = 'cos(2*t) - {r}*(v - cos(2*t))' }}\nafter_zeno = 'stick'"
        )
    };
    // At rest the ball moves with the table and leaves where the table's acceleration, -2 sin(2 t),
    // falls below -1: 2 t = pi/6 (mod 2 pi).
    let model = model(&ball("0"));
    let mut rows = Vec::new();
    let options =
        Options { t_end: 5.0, record: Record::Times { every: 0.01 }, ..Options::default() };
    follow(&model, &options, &mut |p| {
        rows.push((p.t, p.x[0], p.x[1], p.event.map(str::to_owned)));
        true
    })
    .unwrap();
    let resting: Vec<f64> = rows
        .iter()
        .filter(|(t, x, v, _)| {
            (x - 0.5 * (2.0 * t).sin()).abs() < 1e-9 && (v - (2.0 * t).cos()).abs() < 1e-9
        })
        .map(|(t, ..)| *t)
        .collect();
    assert!(resting.len() > 20, "{resting:?}");
    // Between two rests the ball flies on the parabola of the moment it left.
    let leave = std::f64::consts::PI + std::f64::consts::PI / 12.0;
    let free = rows.iter().find(|(t, ..)| *t > leave + 0.3).unwrap();
    let s = free.0 - leave;
    near(free.1, 0.25 + 3.0_f64.sqrt() / 2.0 * s - 0.5 * s * s, 1e-9);
}

/// The period is ln((high - cold)/(high - warm))/k + ln((warm - low)/(cold - low))/k = 20 ln 1.5.
#[test]
fn a_thermostat_has_its_period() {
    let (events, _) = run(&shipped("relay-hysteresis"), 100.0);
    let on: Vec<f64> = events.iter().filter(|(_, e)| e == "too cold").map(|(t, _)| *t).collect();
    let period = 20.0 * 1.5_f64.ln();
    near(on[0], period, 1e-9);
    near(on[on.len() - 1] - on[on.len() - 3], period, 1e-9);
}

/// On the line s = 0 the motion is x' = -lambda x, whatever the disturbance.
#[test]
fn sliding_control_decays_as_its_line_says() {
    let model = shipped("sliding-mode-control");
    let mut rows = Vec::new();
    let options =
        Options { t_end: 8.0, record: Record::Times { every: 1.0 }, ..Options::default() };
    follow(&model, &options, &mut |p| {
        rows.push((p.x[0], p.x[1], p.signs.to_owned()));
        true
    })
    .unwrap();
    for pair in rows.windows(2).skip(2) {
        assert_eq!(pair[0].2, "0");
        near(pair[1].0 / pair[0].0, (-1.0_f64).exp(), 1e-9);
        near(pair[1].0 + pair[1].1, 0.0, 1e-14);
    }
}

/// McGeer (1990): just after an impact w^2 = c^2 4 (g/l) sin(alpha) sin(slope)/(1 - c^2), c = cos(2
/// alpha).
#[test]
fn a_rimless_wheel_walks_with_its_speed() {
    let model = shipped("rimless-wheel");
    let (_, outcome) = run(&model, 60.0);
    assert!(outcome.unwrap().events > 50);
    let mut after = 0.0;
    follow(&model, &Options { t_end: 60.0, ..Options::default() }, &mut |p| {
        after = p.event.map_or(after, |_| p.x[1]);
        true
    })
    .unwrap();
    let (alpha, slope) = (std::f64::consts::PI / 8.0, 0.08_f64);
    let c = (2.0 * alpha).cos();
    near(after, (c * c * 4.0 * 9.81 * alpha.sin() * slope.sin() / (1.0 - c * c)).sqrt(), 1e-8);
}

/// The steady amplitude without a wall is 1/sqrt((1 - w^2)^2 + (2 zeta w)^2): a wall a little
/// farther is never met, a little nearer is.
#[test]
fn a_wall_beyond_the_amplitude_is_not_met() {
    let (w, zeta) = (2.8_f64, 0.05_f64);
    let amplitude = 1.0 / ((1.0 - w * w).powi(2) + (2.0 * zeta * w).powi(2)).sqrt();
    let phase = (2.0 * zeta * w).atan2(1.0 - w * w);
    let start =
        format!("start = [{:e}, {:e}]", amplitude * phase.cos(), amplitude * w * phase.sin());
    let text = twofold_system::library::general("impact-oscillator")
        .unwrap()
        .replace("start = [0, 0]", &start);
    let impacts =
        |wall: f64| run(&model(&text).with("wall", wall).unwrap(), 100.0).1.unwrap().events;
    assert_eq!(impacts(amplitude * (1.0 + 1e-7)), 0);
    assert!(impacts(amplitude * (1.0 - 1e-7)) > 0);
}

/// SciPy 1.17.1: DOP853 with rtol 1e-12 from switch to switch by its events.
#[test]
fn numbers_are_scipys() {
    let x = end(
        "states = ['x', 'v']\nstart = [0, 0]\nf = ['v', '-x + 0.5*sin(t) - 0.3*sign(v - 0.1)']",
        5.0,
    );
    near(x[0], 0.01399237, 1e-8);
    near(x[1], -0.5056829, 1e-7);
}

/// (equations, end time, last state)
#[test]
fn switching_functions_mean_what_they_say() {
    let pi = std::f64::consts::PI;
    for (f, t, want) in [
        ("floor(t)", 5.0, 10.0),
        ("mod(t, 2)", 5.0, 4.5),
        ("mod(-t, 2)", 3.0, 3.5),
        ("if(abs(t - 5) < 1e-6, 1e6, 0)", 10.0, 2.0),
        ("if(t > 1 and not (t > 3) or t > 4, 1, 0)", 5.0, 3.0),
        ("max(t, 2, 4 - t)", 5.0, 6.0 + 10.5),
        ("clip(t, 1, 3)", 5.0, 1.0 + 4.0 + 6.0),
        ("heaviside(t - 2) + (t > 3)", 5.0, 5.0),
        ("abs(t - 2)", 5.0, 2.0 + 4.5),
        ("atan2(sin(t), cos(t))", 2.0 * pi, 0.0),
        ("sinh(t) + cosh(t)", 1.0, 1.0_f64.exp() - 1.0),
        ("asin(t) + acos(t)", 1.0, pi / 2.0),
        ("t^1.5 + log10(10^t) + log(exp(t))", 1.0, 0.4 + 0.5 + 0.5),
        ("sign(sin(pi*t))", 5.5, 0.5),
    ] {
        let x = end(&format!("states = ['x']\nstart = [0]\nf = ['{f}']"), t);
        near(x[0], want, 2e-9);
    }
}

/// Pulses and layers far thinner than a step would be: each has its integral.
#[test]
fn what_is_thinner_than_a_step_is_seen() {
    let root_pi = std::f64::consts::PI.sqrt();
    for (f, t, want) in [
        ("1e4*exp(-((t - 5)/1e-4)^2)", 10.0, root_pi),
        ("exp(-(1e3*(t - 3.3))^2)*1e3 + exp(-(1e4*(t - 7.7))^2)*1e4", 10.0, 2.0 * root_pi),
        ("(1 - tanh((t - 5)/1e-5)^2)/1e-5", 10.0, 2.0),
        ("1e-3/((t - 5)^2 + 1e-6)", 10.0, 2.0 * 5000.0_f64.atan()),
        ("tanh((t - 5)*1e6)", 11.0, 1.0),
    ] {
        let x = end(&format!("states = ['x']\nstart = [0]\nf = ['{f}']"), t);
        near(x[0], want, 1e-6);
    }
}

/// Systems in other units move the same way: states by any factor, switching functions by any
/// positive number.
#[test]
fn units_change_nothing() {
    let text = |unit: f64, scale: f64| {
        format!(
            "states = ['x', 'v']\nstart = [{:e}, 0]\nf = ['v', '-x - \
                {unit:e}*0.3*sign({scale:e}*(v - {unit:e}*0.1)) + {unit:e}*sin(2*t)']\n\
             [[event]]\nwhen = '{scale:e}*(x - {unit:e}*1.2)'\ndirection = 'up'\nset = {{ v = \
             '-0.7*v' }}",
            unit * 0.5
        )
    };
    let plain = end(&text(1.0, 1.0), 20.0);
    for unit in [1e-12, 1e-6, 1e6, 1e12] {
        for scale in [1e-12, 1.0, 1e12] {
            let x = end(&text(unit, scale), 20.0);
            near(x[0] / unit, plain[0], 1e-8);
            near(x[1] / unit, plain[1], 1e-8);
        }
    }
}

#[test]
fn what_is_not_decided_is_said_with_the_ways() {
    let text = "states = ['x', 'y']\nstart = [0, 0]\nf = ['sign(x)', '1']";
    let error = run(&model(text), 1.0).1.unwrap_err();
    assert!(
        error.to_string().contains("x = 0") && error.to_string().contains("+ or - or 0"),
        "{error}"
    );
    for (exit, want) in [(Exit::Plus, 1.0), (Exit::Minus, -1.0)] {
        let options = Options { t_end: 1.0, exit, ..Options::default() };
        near(follow(&model(text), &options, &mut |_| true).unwrap().x[0], want, 1e-12);
    }
}

/// Two relays that know nothing of each other, met together: each does what it does alone
/// (twisting, corner, sliding on both).
#[test]
fn surfaces_that_are_met_together_are_decided_together() {
    let x = end("states = ['x', 'y']\nstart = [1, 1]\nf = ['-sign(x)', '-sign(y)']", 3.0);
    assert!(x[0].abs() < 1e-14 && x[1].abs() < 1e-14, "{x:?}");
    let x = end("states = ['x', 'y']\nstart = [1, 1]\nf = ['-2 + sign(x)', '-2 - sign(y)']", 2.0);
    near(x[0], -3.0, 1e-12);
    // Reaches y = 0 after 1/3 at -3, then goes on at -1.
    near(x[1], -(2.0 - 1.0 / 3.0), 1e-12);
    // Sliding on x = 0 meets y = 0 and slides on both.
    let x = end(
        "states = ['x', 'y', 'z']\nstart = [0.5, 2, 0]\nf = ['-sign(x) + 0.5', '-sign(y)', \
            'sign(x) + sign(y)']",
        5.0,
    );
    assert!(x[0].abs() < 1e-14 && x[1].abs() < 1e-14, "{x:?}");
    // z: 2 until x = 0 at t = 1, then 0.5 + 1 until y = 0 at t = 2, then 0.5.
    near(x[2], 2.0 + 1.5 + 1.5, 1e-9);
}

/// A block in a chain sticks or not, whatever its hundred neighbours do; nothing is done for each
/// pair.
#[test]
fn fifty_blocks_on_a_belt() {
    let n = 50;
    let states: Vec<String> =
        (0..n).map(|i| format!("'x{i}'")).chain((0..n).map(|i| format!("'v{i}'"))).collect();
    let start: Vec<String> = (0..n)
        .map(|i| format!("{}", 0.01 * f64::from(i)))
        .chain((0..n).map(|_| "0".into()))
        .collect();
    let mut f: Vec<String> = (0..n).map(|i| format!("'v{i}'")).collect();
    for i in 0..n {
        let left = if i > 0 { format!("x{} - x{i}", i - 1) } else { format!("-x{i}") };
        let right = if i + 1 < n { format!(" + x{} - x{i}", i + 1) } else { String::new() };
        f.push(format!("'{left}{right} - 0.5*sign(v{i} - 0.1) - 0.05*v{i}'"));
    }
    let text = format!(
        "states = [{}]\nstart = [{}]\nf = [{}]",
        states.join(", "),
        start.join(", "),
        f.join(", ")
    );
    let x = end(&text, 2.0);
    // The middle moves with the belt from the time v = 0.1 is reached, at about 0.2.
    near(x[n as usize + 25], 0.1, 1e-12);
    near(x[26] - x[25], 0.01, 1e-9);
}

#[test]
fn events_happen_in_the_files_order_one_after_the_other() {
    let text = "states = ['x', 'y']\nstart = [0, 0]\nf = ['1', '0']\n\
        [[event]]\nname = 'a'\nwhen = 'x - 1'\nset = { x = 'y - 5', y = 'x + 10' }\n\
        [[event]]\nname = 'b'\nwhen = 'x - 1'\nset = { y = 'y + 1' }\n\
        [[event]]\nname = 'c'\nat = [2, 3]\n[[event]]\nname = 'd'\nevery = 1\n[[event]]\nname = \
        'e'\nwhen = 'x > -3'\nstop = true";
    let (events, outcome) = run(&model(text), 9.0);
    let outcome = outcome.unwrap();
    let names: Vec<&str> = events.iter().map(|(_, e)| e.as_str()).collect();
    assert_eq!(names, ["a", "b", "d", "b", "c", "d", "c", "d", "e"]);
    assert_eq!(outcome.ending, Ending::Stopped("e".into()));
    near(outcome.t, 3.0, 1e-12);
    near(outcome.x[0], -3.0, 1e-12);
    // 0 and 1 become -5 and 11 together, then b adds one.
    near(outcome.x[1], 12.0, 1e-12);
}

/// 3 times 0.1 is 0.3 to rounding: it belongs to the run that ends there, and not to the next one.
#[test]
fn multiples_of_a_period_are_counted_to_rounding() {
    let counted = |t_start: f64, t_end: f64, every: &str| {
        let text = format!(
            "states = ['n']\nstart = [0]\nf = ['0']\n[[event]]\n{every}\nset = {{ n = 'n + 1' }}"
        );
        let options = Options { t_start, t_end, ..Options::default() };
        follow(&model(&text), &options, &mut |_| true).unwrap().x[0]
    };
    for end in 1..40 {
        let middle = f64::from(end) / 10.0;
        let parts = [counted(0.0, middle, "every = 0.1"), counted(middle, 4.0, "every = 0.1")];
        assert_eq!(parts, [f64::from(end), f64::from(40 - end)], "{middle}");
    }
    // Two that happen together do so at one time: the second sees what the first has done.
    let both = "every = 0.1\nset = { n = '10*n + 1' }\n[[event]]\nevery = 0.3";
    assert_eq!(counted(0.0, 0.3, both), 112.0);
    // A single time is what it is: this one comes after the end.
    assert_eq!(counted(0.0, 0.3, "at = [0.30000000000000004]"), 0.0);
}

/// An event's expression that is zero at the start triggers the event at its next zero.
#[test]
fn an_event_that_is_zero_at_the_start_waits() {
    let text =
        "states = ['x', 'v']\nstart = [0, 1]\nf = ['v', '-x']\n[[event]]\nwhen = 'x'\nstop = true";
    near(run(&model(text), 9.0).1.unwrap().t, std::f64::consts::PI, 1e-9);
}

#[test]
fn the_end_of_a_domain_is_named() {
    let error =
        run(&model("states = ['x']\nstart = [4]\nf = ['-sqrt(x) - 1']"), 5.0).1.unwrap_err();
    let HybridError::Domain { t, what, .. } = error else { panic!("{error}") };
    near(t, 2.0 * (2.0 - 3.0_f64.ln()), 1e-8);
    assert!(what.contains("square root") && what.contains("-sqrt(x) - 1"), "{what}");
    for (text, said) in [
        ("-x^(1/3) - 1", "an odd root of one is sign(x)*abs(x)^(1/3)"),
        ("log(x) - 9", "the logarithm of"),
    ] {
        let error = run(&model(&format!("states = ['x']\nstart = [4]\nf = ['{text}']")), 50.0)
            .1
            .unwrap_err()
            .to_string();
        assert!(error.contains(said) && error.contains(text), "{error}");
    }
    // A branch that motion never reaches is never computed.
    let x = end("states = ['x']\nstart = [1]\nf = ['if(x > 0, -x, sqrt(x))']", 5.0);
    near(x[0], (-5.0_f64).exp(), 1e-10);
}

#[test]
fn errors_point_into_the_file() {
    for (text, place, message, help) in [
        ("states = ['x']\nf = ['if(x, 1, 2)']", "2:10", "a condition is wanted", "x > 0"),
        ("states = ['x']\nf = ['max(x)']", "2:7", "2 arguments or more; 1 given", ""),
        ("states = ['x']\nf = ['x == 1']", "2:9", "equality", "[[event]]"),
        ("states = ['x']\nf = ['0 < x < 1']", "2:13", "two comparisons", "0 < x and x < 1"),
        ("states = ['x']\nf = ['x', '1']", "2:5", "2 expressions for 1 states", ""),
        ("states = ['x']\nf = ['y']", "2:7", "unknown name `y`", ""),
        ("states = ['t']\nf = ['1']", "1:11", "meaning of its own", ""),
        (
            "states = ['x']\nf = ['1']\n[[event]]\nset = { x = '0' }",
            "3:1",
            "not said when",
            "when, at or every",
        ),
        (
            "states = ['x']\nf = ['1']\n[[event]]\nwhen = 'x'\nset = { y = '0' }",
            "5:13",
            "no state `y`",
            "states are x",
        ),
        (
            "states = ['x']\nf = ['1']\n[[event]]\nwhen = 'x > 1'\ndirection = 'up'",
            "5:13",
            "becomes true",
            "",
        ),
        (
            "states = ['x']\nf = ['1']\n[[event]]\nwhen = 'x'\nmode = 'on'",
            "5:8",
            "no mode `on`",
            "",
        ),
        (
            "states = ['x']\nf = ['1']\n[[event]]\nwhen = 'x'\nafter_zeno = 'stick'",
            "5:14",
            "sets speeds",
            "",
        ),
        ("states = ['x']\nf = [true]", "2:5", "a number is wanted", ""),
        (
            "states = ['x']\nf = ['1']\n[parameters]\ng = { value = 1, aboev = 0 }",
            "4:5",
            "value, above, below",
            "",
        ),
        (
            "states = ['x']\nstart = [1, 2]\nf = ['1']",
            "2:9",
            "2 numbers for 1 states",
            "one for each",
        ),
        (
            "states = ['x']\nf = ['1']\nh = 'x'\nplus = ['1']\nminus = ['1']",
            "3:5",
            "given twice",
            "one of f",
        ),
        (
            "states = ['x']\nf = ['1']\nevnt = 3",
            "3:1",
            "unknown field `evnt`",
            "did you mean `event`?",
        ),
        (
            "states = ['x']\nf = ['wind']\n[tables.wind]\nfile = '../wind.csv'\ntime = 't'\ncolumn \
                = 'v'",
            "4:8",
            "beside the system's",
            "",
        ),
        ("states = ['x']\nf = ['a']\n[let]\na = 'b'\nb = 'a'", "4:5", "depends on itself", ""),
        (
            "states = ['x']\nf = ['clip(x, -1, 1) + clip(x, 2, -2)']",
            "2:24",
            "lower end 2 is above its upper end -2",
            "clip(x, low, high)",
        ),
        ("states = ['x']\nf = ['x - mod(x, 0)']", "2:11", "mod by 0", "other than 0"),
        (
            "states = ['x']\nf = ['1']\n[parameters]\nlow = 1\na = '1/(low - 1)'",
            "5:5",
            "`a` is inf",
            "a finite number",
        ),
        (
            "states = ['x']\nf = ['1']\n[parameters]\na = 'b'\nb = 2",
            "4:6",
            "unknown name `b`",
            "stand before it",
        ),
        (
            "states = ['x']\nf = ['1']\n[parameters]\nT = 1\n[[event]]\nevery = 'T - 1'",
            "6:9",
            "`every` is 0",
            "a time above 0",
        ),
        (
            "states = ['x']\nf = ['1']\n[[event]]\nat = []",
            "4:6",
            "`at` names no time",
            "one time or more",
        ),
        (
            "states = ['x', 'event']\nf = ['1', '0']",
            "1:16",
            "recorded tables have a column `event`",
            "rename the state",
        ),
        (
            "states = ['x']\nf = ['1']\n[[event]]\nat = [2, 1, 1]",
            "4:6",
            "the time 1 stands twice",
            "each time once",
        ),
        ("states = ['x']\nf = ['1']\n[[event]]\nat = '1/0'", "4:6", "`at` is inf", "finite time"),
        (
            "states = ['x']\nf = ['1']\n[parameters]\na = 1\n[let]\nb = 'a - 2'\n[[event]]\nwhen \
                = 'b'",
            "8:8",
            "does not change",
            "at = [1]",
        ),
        (
            "states = ['x']\nf = ['1']\n[[event]]\nname = 'a'\nwhen = 'x'\n[[event]]\nname = \
                'a'\nwhen = 'x - 1'",
            "7:8",
            "given to two events",
            "its own",
        ),
        (
            "states = ['x']\nf = ['1']\n[parameters]\na = 't'",
            "4:5",
            "does not depend on the time",
            "",
        ),
    ] {
        let error = Definition::from_toml(text, "f").expect_err(text);
        let found = format!("{}:{}", error.line, error.column);
        assert!(error.message.contains(message), "{text}\n{error}");
        assert_eq!(found, place, "{text}\n{error}");
        assert!(error.help.clone().unwrap_or_default().contains(help), "{text}\n{error}");
    }
}

/// x' = -sqrt(x) (Torricelli): (1 - t/2)^2, and from t = 2 on zero for ever.
/// By the values of parameters as by numbers in the file, in fields, terms and resets.
#[test]
fn ends_of_a_clip_are_not_exchanged() {
    let clipped = "states = ['x']\nstart = [3]\nf = ['-clip(x, 0, p)']\n[parameters]\np = 1";
    let of = |text: &str, p: f64| run(&model(text).with("p", p).unwrap(), 1.0).1;
    near(of(clipped, 1.0).unwrap().x[0], 2.0, 1e-12);
    let set = "states = ['x']\nstart = [3]\nf = ['1']\n[[event]]\nat = 0.5\n\
        set = { x = 'mod(x, p)' }\n[parameters]\np = 2";
    near(of(set, 2.0).unwrap().x[0], 2.0, 1e-12);
    let constant = "states = ['x']\nstart = [3]\nf = ['clip(0.5, 0, p)']\n[parameters]\np = 1";
    near(of(constant, 1.0).unwrap().x[0], 3.5, 1e-12);
    for (text, p, words) in [
        (clipped, -1.0, "clip(x, 0, p) is 0 here, above its upper end -1"),
        (constant, -1.0, "clip(0.5, 0, p) is 0 here, above its upper end -1"),
        (set, 0.0, "is by 0"),
    ] {
        let error = of(text, p).unwrap_err().to_string();
        assert!(error.contains(words), "{error}");
    }
}

/// The speeds on both sides of the surface vanish together where sliding ends, and the mixture is
/// 0/0 there; and a mixture that cancels to rounding takes no steps.
#[test]
fn sliding_is_followed_to_where_both_speeds_vanish() {
    let vanishing = model("states = ['x', 'y']\nstart = [0, -1]\nf = ['y*sign(x)', '1']");
    let cancelling = model("states = ['x', 'y']\nstart = [0, -1]\nf = ['if(x > 0, y, 2)', '1']");
    let stopped = "states = ['x', 'y']\nstart = [0.3, 0]\nf = ['-sign(x)*max(1 - y, 0)', '1']\n\
        [[event]]\nwhen = 'y - 1'\nstop = true";
    let reset = "states = ['x']\nstart = [0.3]\nf = ['-sign(x)*(1 - t)']\n[[event]]\nat = 1\n\
        set = { x = 'x + 1' }";
    for method in Method::ALL {
        let options = |every, t_end| Options {
            method,
            t_end,
            exit: Exit::Plus,
            record: Record::Times { every },
            ..Options::default()
        };
        let mut rows = Vec::new();
        let outcome = follow(&vanishing, &options(0.1, 3.0), &mut |point| {
            rows.push((point.t, point.x.to_vec()));
            true
        });
        near(outcome.unwrap().x[0], 2.0, 1e-9);
        for (t, x) in rows {
            let y = t - 1.0;
            near(x[0], if y < 0.0 { 0.0 } else { 0.5 * y * y }, 1e-9);
            near(x[1], y, 1e-9);
        }
        let end = |model: &Model, t_end| follow(model, &options(0.1, t_end), &mut |_| true);
        near(end(&cancelling, 1.2).unwrap().x[0], 0.02, 1e-9);
        // Events at that moment come first.
        let stopped = end(&model(stopped), 3.0).unwrap();
        assert!(matches!(stopped.ending, Ending::Stopped(_)) && (stopped.t - 1.0).abs() < 1e-9);
        near(end(&model(reset), 3.0).unwrap().x[0], 3.0, 1e-9);
    }
}

/// A function that jumps exactly to the number that it is compared with is compared with that
/// number, and a whole number that only jumps is its own whole part.
#[test]
fn comparisons_see_what_jumps_to_equality() {
    let third = 1.0 / 3.0;
    for (f, want) in [
        ("if(floor(3*t) >= 1, 1, 0)", 3.0 - third),
        ("if(floor(3*(t - 1)) < 1, 1, 0)", 1.0 + third),
        ("heaviside(floor(3*(t - 1)) - 1)", 2.0 - third),
        ("if(floor(3 - 3*t) <= 1, 1, 0)", 3.0 - third),
        ("if(mod(floor(3*(t - 1)), 3) >= 2, 1, 0)", 1.0),
        ("if(if(t > 1, 1, 0) + if(t > 2, 1, 0) >= 1, 1, 0)", 2.0),
        ("if(sign(t - 1) >= 1, 1, 0)", 2.0),
        ("sign(t - 1)*sign(sign(t - 1) - 1)", 1.0),
        ("mod(floor(2*t), 3)", 0.5 * (0.0 + 1.0 + 2.0 + 0.0 + 1.0 + 2.0)),
        ("floor(floor(3*t)/2)", third * (1.0 + 1.0 + 2.0 + 2.0 + 3.0 + 3.0 + 4.0)),
        // At rest at the bound after the jump, and away from it again.
        ("if(2*floor(t) - floor(2*t) >= 0, 1, 0)", 1.5),
    ] {
        for method in Method::ALL {
            let model = model(&format!("states = ['x']\nstart = [0]\nf = ['{f}']"));
            let options = Options { t_end: 3.0, method, ..Options::default() };
            let outcome = follow(&model, &options, &mut |_| true);
            let x = outcome.unwrap_or_else(|e| panic!("{f}: {e}")).x[0];
            assert!((x - want).abs() < 1e-9, "{f} by {method:?}: {x} for {want}");
        }
    }
    // The steps of a table: 0, 1, 2, 1, or from 1 on.
    let steps = "states = ['x']\nstart = [0]\nf = ['if(u >= 2, 1, 0) + if(u >= 1, 10, 0)']\n\
        [tables.u]\nfile = 'u.csv'\ntime = 't'\ncolumn = 'u'\ninterpolation = 'previous'";
    for (first, want) in [(0, 41.0), (1, 51.0)] {
        let rows = format!("t,u\n0,{first}\n1,1\n2,2\n3,1\n10,1\n");
        let table = model(steps).with_table("u", &rows).unwrap();
        for method in Method::ALL {
            let options = Options { t_end: 5.0, method, ..Options::default() };
            near(follow(&table, &options, &mut |_| true).unwrap().x[0], want, 1e-9);
        }
    }
    for (when, t) in [("floor(x) >= 2", 2.0), ("sign(x - 1) >= 1", 1.0)] {
        let counts = model(&format!(
            "states = ['n', 'x']\nstart = [0, 0]\nf = ['0', '1']\n[[event]]\nwhen = '{when}'\n\
                set = {{ n = 'n + 1' }}"
        ));
        let (events, outcome) = run(&counts, 2.9);
        assert_eq!(outcome.unwrap().x[0], 1.0, "{when}");
        near(events[0].0, t, 1e-9);
    }
}

/// However h is written, plus is where it is positive.
#[test]
fn a_side_is_that_of_h_as_it_is_written() {
    for h in ["-x", "-2*x", "-(x)", "0 - x", "x/(-3)"] {
        let text = format!(
            "states = ['x', 'y']\nstart = [0, -1]\nh = '{h}'\nplus = ['-y', '1']\n\
                minus = ['y', '1']"
        );
        for (exit, want) in [(Exit::Plus, -2.0), (Exit::Minus, 2.0)] {
            let options = Options { t_end: 3.0, exit, ..Options::default() };
            let end = follow(&model(&text), &options, &mut |_| true).unwrap();
            near(end.x[0], want, 1e-9);
        }
    }
}

/// x and z know nothing of each other.
#[test]
fn whole_parts_fall_while_another_surface_is_slid_upon() {
    let apart = "states = ['x', 'z']\nstart = [0, 0.7]\nf = ['floor(-t)', '-max(-0.5, sign(z))']";
    for method in Method::ALL {
        let options = Options { t_end: 4.0, method, max_steps: 1000, ..Options::default() };
        near(follow(&model(apart), &options, &mut |_| true).unwrap().x[0], -10.0, 1e-9);
    }
}

/// An event ends at its mode, and with it the contact; and a body that is struck into the surface
/// that it rests on leaves it by the event's law.
#[test]
fn contacts_end_with_their_mode_and_by_a_blow() {
    let ball = "states = ['x', 'v']\nstart = [1, 0]\n[modes.closed]\nf = ['v', '-1']\n\
        [modes.open]\nf = ['v', '-1']\n[[event]]\nfrom = 'closed'\nwhen = 'x'\n\
        direction = 'down'\nset = { v = '-0.5*v' }\nafter_zeno = 'stick'\n[[event]]\nat = 5\n";
    for method in Method::ALL {
        let end = |change: &str, t_end| {
            let options = Options { t_end, method, ..Options::default() };
            follow(&model(&format!("{ball}{change}")), &options, &mut |_| true).unwrap().x
        };
        near(end("mode = 'open'", 6.0)[0], -0.5, 1e-9);
        near(end("set = { v = -1 }", 5.5)[0], 0.125, 1e-9);
        near(end("set = { v = 1 }", 5.5)[0], 0.375, 1e-9);
    }
}

/// Integrators with limits, and forces that vanish: the speeds on both sides of what is slid upon
/// vanish, and what is met at that moment decides.
#[test]
fn sliding_ends_where_another_function_decides() {
    let limited = "if((i >= 1 and 2*cos(t) > 0) or (i <= -1 and 2*cos(t) < 0), 0, 2*cos(t))";
    let rectified = "if(i > 0, sin(t) - 0.2*i, max(sin(t), 0))";
    // i' = sin(tau) - i/5 from zero.
    let tau = 7.0 - 2.0 * std::f64::consts::PI;
    let charged = (0.2 * tau.sin() - tau.cos() + (-0.2 * tau).exp()) / 1.04;
    let [dopri5, radau5, taylor, lsoda] = Method::ALL;
    // The others refuse it.
    for (f, start, want, followed_by) in [
        ("if(i > 0, t - 1, max(t - 1, 0))", 0.3, 18.0, vec![dopri5, radau5, taylor, lsoda]),
        ("-sign(i)*max(1 - t, 0)", 0.3, 0.0, vec![dopri5, radau5, taylor, lsoda]),
        (limited, 0.3, 1.0, vec![dopri5, radau5, lsoda]),
        (rectified, 0.0, charged, vec![dopri5, lsoda]),
    ] {
        let model = model(&format!("states = ['i']\nstart = [{start}]\nf = ['{f}']"));
        for method in Method::ALL {
            let options = Options { t_end: 7.0, method, ..Options::default() };
            match follow(&model, &options, &mut |_| true) {
                Ok(outcome) => near(outcome.x[0], want, 1e-8),
                Err(error) => assert!(!followed_by.contains(&method), "{f}: {error}"),
            }
        }
    }
}

/// A ball that has come to rest at t = 4.24 is lifted from t = 8 on, by a force that jumps there.
#[test]
fn contacts_open_where_a_force_jumps() {
    let ball = "states = ['x', 'v']\nstart = [1, 0]\nf = ['v', '-1 + FORCE']\n[[event]]\n\
        when = 'x'\ndirection = 'down'\nset = { v = '-0.5*v' }\nafter_zeno = 'stick'";
    for force in ["if(t > 8, 1.5, 0)", "1.5*floor(t/8)", "0.75 + 0.75*sign(t - 8)"] {
        for method in Method::ALL {
            let options = Options { t_end: 10.0, method, ..Options::default() };
            let outcome =
                follow(&model(&ball.replace("FORCE", force)), &options, &mut |_| true).unwrap();
            near(outcome.x[0], 1.0, 1e-9);
            near(outcome.x[1], 1.0, 1e-9);
        }
    }
    // The floor falls away from t = 6 on, faster than the ball.
    let floor = "states = ['x', 'v']\nstart = [1, 0]\nf = ['v', '-1']\n[[event]]\n\
        when = 'x + 0.75*max(t - 6, 0)^2'\ndirection = 'down'\nset = { v = '-1.5*max(t - 6, 0) \
        - 0.5*(v + 1.5*max(t - 6, 0))' }\nafter_zeno = 'stick'";
    for method in Method::ALL {
        let options = Options { t_end: 9.0, method, max_steps: 20_000, ..Options::default() };
        near(follow(&model(floor), &options, &mut |_| true).unwrap().x[0], -4.5, 1e-9);
    }
}

/// A timer that runs out and stops at zero, to rounding, has run out once: an order takes its time.
#[test]
fn a_timer_that_stops_at_zero_runs_out_once() {
    let text = |lead: f64| {
        format!(
            "states = ['q', 'o', 'c', 'n']\nstart = [4, 0, 0, 0]\nf = ['-1.76*(1 + \
                0.59*sin(t))', '0', 'if(o > 0, -1, 0)', '0']\n[[event]]\nname = 'order'\nwhen = \
                'q < 1.1 and o <= 0'\nset = {{ o = '7.75 - q', c = '{lead}' }}\n[[event]]\nname = \
                'deliver'\nwhen = 'c'\ndirection = 'down'\nset = {{ q = 'q + o', o = '0', n = 'n + \
                1' }}"
        )
    };
    for k in 0..20 {
        let model = model(&text(0.3 + 0.0123 * f64::from(k)));
        let mut found = Vec::new();
        for method in Method::ALL {
            let options = Options { t_end: 9.4, method, ..Options::default() };
            let outcome = follow(&model, &options, &mut |_| true).unwrap();
            assert_eq!((outcome.x[1], outcome.x[3]), (0.0, 3.0), "{k} {method:?} {outcome:?}");
            found.push(outcome.x[0]);
        }
        found.iter().for_each(|q| near(*q, found[3], 1e-7));
        let options = Options { t_end: 9.4, ..Options::default() };
        let found = sensitivity::sensitivities(&model, &options, &[]).unwrap();
        near(found.by_start[0][0], 1.0, 1e-6);
    }
}

/// Functions of one zero are seen to depend on each other beside a clock, whose jumps are no part
/// of that, however long the run is; and a clock may end the sliding on them.
#[test]
fn clocks_beside_functions_of_one_zero() {
    let windup = "states = ['x', 'z']\nstart = [0, 0]\nf = ['-x + clip(u, -1, 1)', 'if(abs(u) > 1 \
        and e*u > 0, 0, 3*e)']\n[let]\nr = 'if(mod(t, 10) < 5, 0.7, -0.7)'\ne = 'r - x'\nu = 'e + \
        z'";
    let at = |t_end| {
        let mut found = Vec::new();
        let options =
            Options { t_end, record: Record::Times { every: 20.0 }, ..Options::default() };
        follow(&model(windup), &options, &mut |p| {
            found.push(p.x.to_vec());
            true
        })
        .unwrap();
        found[1].clone()
    };
    for x in [at(20.0), at(2000.0)] {
        near(x[0], -0.6934128969706657, 1e-8);
        near(x[1], -0.692043029609678, 1e-8);
    }
    let clock = "states = ['x', 'y']\nstart = [0, 0]\nf = ['r - if(abs(x) > 0.02, 2, 0)', 'clip(x, \
        -0.02, 0.02)']\n[let]\nr = 'if(mod(t, 10) < 5, 1, -1)'";
    for method in [Method::Dopri5, Method::Radau5, Method::Lsoda] {
        let options = Options { t_end: 10.0, method, ..Options::default() };
        near(follow(&model(clock), &options, &mut |_| true).unwrap().x[0], -14.9, 1e-9);
    }
}

/// A controller that stops its integrator at the limit: sliding on the limit is left without a
/// speed, and a collocation polynomial's own slope there is none.
#[test]
fn sliding_is_left_along_the_limit_of_a_controller() {
    let text = |kp: f64, ki: f64, um: f64, reference: f64| {
        format!(
            "states = ['x', 'y', 'z']\nstart = [0, 0, 0]\nf = ['y', 'clip(u, -{um}, {um}) - y - \
                0.2*x', 'if(abs(u) > {um} and e*u > 0, 0, {ki}*e)']\n[let]\ne = '{reference} - x'\n\
                u = '{kp}*e + z'"
        )
    };
    for [kp, ki, um, reference] in [
        [1.0091501284064197, 2.7072770469927936, 1.0505577989085282, 0.8106713009474],
        [2.031743419048358, 2.9649133748233862, 0.6686689301569766, 0.8036921194258533],
        [1.3, 2.0, 0.8, 0.9],
    ] {
        let model = model(&text(kp, ki, um, reference));
        let [d, r, l] = [Method::Dopri5, Method::Radau5, Method::Lsoda].map(|method| {
            let options = Options { t_end: 25.0, method, ..Options::default() };
            follow(&model, &options, &mut |_| true).unwrap().x
        });
        d.iter().zip(&r).for_each(|(d, r)| near(*d, *r, 1e-7));
        d.iter().zip(&l).for_each(|(d, l)| near(*d, *l, 1e-7));
    }
}

/// A relay behind a lag: z = 0 is crossed ever more often, exp(t) times, and never for the last.
#[test]
fn chatter_that_decays_is_told() {
    let text = "states = ['x', 'z']\nstart = [0.2, 0]\nf = ['-sign(z) + 0.2*sin(t)', \
        '(x - z)/0.3']";
    for method in Method::ALL {
        let options = Options { t_end: 40.0, method, ..Options::default() };
        let error = follow(&model(text), &options, &mut |_| true).unwrap_err().to_string();
        assert!(error.contains("ever faster"), "{method:?} {error}");
    }
}

#[test]
fn a_tank_runs_empty() {
    let follow_by = |text: &str, t_end, method| {
        follow(&model(text), &Options { t_end, method, ..Options::default() }, &mut |_| true)
    };
    for method in Method::ALL {
        for f in ["-sqrt(x)", "-x^0.5", "-sqrt(2*x)/2^0.5"] {
            let text = format!("states = ['x']\nstart = [1]\nf = ['{f}']");
            let outcome = follow_by(&text, 3.0, method).unwrap();
            assert!(outcome.x[0] == 0.0 && outcome.steps < 500, "{method:?} {f} {outcome:?}");
            near(follow_by(&text, 1.5, method).unwrap().x[0], 0.0625, 1e-9);
        }
    }
    let event = "states = ['x', 'y']\nstart = [1, 1]\nf = ['-sqrt(x)', 'sqrt(x) - sqrt(y)']\n\
        [[event]]\nwhen = 'x'\n[[event]]\nwhen = 'y'";
    let (events, outcome) = run(&model(event), 9.0);
    assert_eq!(outcome.unwrap().x, [0.0, 0.0]);
    near(events[0].0, 2.0, 1e-6);
    assert_eq!(events.len(), 2);
    // A state that decays for ever is not put to zero: y' = sqrt(x) sums up to 2.
    let decays = "states = ['x', 'y']\nstart = [1, 0]\nf = ['-x', 'sqrt(x)']";
    near(end(decays, 60.0)[1], 2.0, 1e-8);
    // Nor is what leaves the domain.
    assert!(run(&model("states = ['x']\nstart = [1]\nf = ['-1 - sqrt(x)']"), 3.0).1.is_err());
}

#[test]
fn errors_of_tables_point_into_the_systems_file() {
    let text = "states = ['x']\nstart = [0]\nf = ['w']\n[tables.w]\nfile = 'w.csv'\ntime = \
        't'\ncolumn = 'v'";
    let model = model(text);
    for (data, place, message, help) in [
        ("s,v\n0,1\n1,2", "6:8", "no column `t`; it has s, v", "first line"),
        ("t,u\n0,1\n1,2", "7:10", "no column `v`", "first line"),
        ("t,v,v\n0,1,1\n1,2,9", "5:8", "w.csv: columns 2 and 3 are both called `v`", "its own"),
        ("t,v\n0,1\n1", "5:8", "w.csv, row 2: 1 cells for 2 columns", "rows of finite numbers"),
        ("t,v\n0,1\n1,a", "5:8", "row 2: `a` is not a finite number", "finite numbers"),
        ("t,v\n0,1\n0,2", "5:8", "row 2: the time 0 does not come after", "times increasing"),
        ("t,v\n0,1", "5:8", "at least two rows", "rows of finite numbers"),
    ] {
        let Err(crate::model::ModelError::Table(error)) = model.clone().with_table("w", data)
        else {
            panic!("{data}")
        };
        let error = Definition::about_table(text, "f", "w", &error);
        assert_eq!(format!("{}:{}", error.line, error.column), place, "{error}");
        assert!(error.message.contains(message) && error.to_string().contains(help), "{error}");
    }
}

/// An event that fires more often than there may be steps ends no run after hours.
#[test]
fn an_event_that_fires_too_often_is_refused_at_once() {
    let text = "states = ['x']\nstart = [0]\nf = ['1']\n[[event]]\nevery = 1e-300";
    let error = run(&model(text), 1.0).1.unwrap_err().to_string();
    assert!(error.contains("`every` is 1e-300, 1.0e300 times"), "{error}");
}

/// Equilibria, and pseudo-equilibria with the eigenvalues that a formula gives.
#[test]
fn rests_are_found_with_their_stability() {
    use crate::rests::rests;
    // Two foci and a saddle of a double well.
    let well = model("states = ['x', 'v']\nf = ['v', 'x - x^3 - 0.2*v']");
    let kinds: Vec<String> =
        rests(&well, &[(-2.0, 2.0); 2]).unwrap().iter().map(|r| r.kind()).collect();
    assert_eq!(kinds, ["stable focus", "saddle", "stable focus"]);
    // Sliding on v = 0.2 with x' = 0.2: no rest there, but those of both fields, which are not on
    // their own sides.
    let block = "states = ['x', 'v']\nf = ['v', '-x - sign(v - 0.2)']";
    assert!(rests(&model(block), &[(-3.0, 3.0); 2]).unwrap().iter().all(|r| r.on.is_empty()));
    // On x = 0: fields (1, y - 1) below and (-1, y + 3) above: halves cancel in x, so y' = y + 1,
    // which vanishes at -1 and grows.
    let planar = model("states = ['x', 'y']\nf = ['-sign(x)', 'y + 1 + 2*sign(x)']");
    let found = rests(&planar, &[(-3.0, 3.0); 2]).unwrap();
    assert_eq!(found.len(), 1, "{found:?}");
    near(found[0].x[1], -1.0, 1e-12);
    near(found[0].eigenvalues[0][0], 1.0, 1e-9);
    assert_eq!((found[0].on[0].surface.as_str(), found[0].attracting), ("x", Some(true)));
    near(found[0].on[0].weight, 0.5, 1e-12);
    // A fused focus: both fields are tangent to x = 0 where they cancel.
    let fused = model("states = ['x', 'y']\nf = ['y', '-x - 0.2*sign(x)']");
    // Beyond a surface others are asked than before it: atan2 is smooth where it looks up.
    let angle = model("states = ['x', 'y']\nf = ['atan2(y, x) - 1', '1 - y']");
    let found = rests(&angle, &[(-2.0, 2.0); 2]).unwrap();
    assert_eq!(found.len(), 1, "{found:?}");
    near(found[0].x[0], 1.0 / 1.0_f64.tan(), 1e-9);
    // A function that a parameter makes zero is no surface, and not greater than zero.
    for condition in ["eps*(x - 1) > 0", "k*x > x"] {
        let text = format!(
            "states = ['x', 'y']\nf = ['-x + 0.5*y + 0.1', 'if({condition}, 1, 0.5) - 2*y + \
                0.1']\n[parameters]\neps = 0\nk = 1"
        );
        let found = rests(&model(&text), &[(-3.0, 3.0); 2]).unwrap();
        assert_eq!(found.len(), 1, "{found:?}");
        near(found[0].x[0], 0.25, 1e-9);
        assert_eq!(found[0].kind(), "stable node");
    }
    // A state that the clock moves again and again does not rest; one that it moves once does.
    for (event, kind) in [
        (
            "every = 1\nset = { x = 'x + 1' }",
            "no rest of the whole motion: kick moves it again and again",
        ),
        ("every = 1\nset = { x = '0.5*x' }", "stable node"),
        ("at = 1\nset = { x = 'x + 1' }", "stable node"),
    ] {
        let text = format!("states = ['x']\nf = ['-x']\n[[event]]\nname = 'kick'\n{event}");
        let found = rests(&model(&text), &[(-3.0, 3.0)]).unwrap();
        assert_eq!(found[0].kind(), kind);
    }
    let found = rests(&fused, &[(-3.0, 3.0); 2]).unwrap();
    assert_eq!(found.len(), 1, "{found:?}");
    assert!(found[0].tangent && found[0].eigenvalues.is_empty(), "{found:?}");
    assert!(found[0].x.iter().all(|x| x.abs() < 1e-9), "{found:?}");
    near(found[0].on[0].weight, 0.5, 1e-9);
    assert!(
        rests(&model("states = ['x']\nf = ['sin(t)']"), &[(-1.0, 1.0)])
            .unwrap_err()
            .to_string()
            .contains("time")
    );
}

/// Multipliers and exponents against what formulas say, through crossing, sliding and resets.
#[test]
fn tangent_vectors_pass_switches_by_saltation_matrices() {
    use crate::motion::tangent::{Return, closed_orbit, exponents};
    let section = |text: &str| {
        Record::Section(
            twofold_system::Expression::parse_general(text, &["x", "v", "a", "w", "T"]).unwrap(),
        )
    };
    // The wheel: w^2 after a step is c^2 (w^2 + const), so that the multiplier is c^2, c =
    // cos(pi/4).
    let options = Options {
        start: Some(vec![-0.3, 1.2]),
        record: section("a"),
        t_end: 50.0,
        ..Options::default()
    };
    let orbit =
        closed_orbit(&shipped("rimless-wheel"), &options, &Return::Crossings(1), 0.0).unwrap();
    assert_eq!(orbit.multipliers.len(), 1);
    near(orbit.multipliers[0][0], 0.5, 1e-8);
    // A linear oscillator that loses half of its speed at a wall, driven so that a ball comes back:
    // x'' = -1 with v -> -r v + u. One bounce: v -> r v + u.
    let juggler = model(
        "states = ['x', 'v']\nstart = [0, 1.9]\nf = ['v', '-1']\n[[event]]\nwhen = 'x'\ndirection \
            = 'down'\nset = { v = '1 - 0.5*v' }",
    );
    let options = Options {
        start: Some(vec![1.9, 0.1]),
        record: section("v - 0"),
        t_end: 50.0,
        ..Options::default()
    };
    let orbit = closed_orbit(
        &juggler,
        &Options { record: section("0 - v"), ..options },
        &Return::Crossings(1),
        0.0,
    )
    .unwrap();
    near(orbit.period, 4.0, 1e-9);
    near(orbit.multipliers[0][0], 0.5, 1e-7);
    // x' = -x + a(t) with a relay that crosses: x'' + x' ... the exponent of a linear system with a
    // switch in its input is its own eigenvalue.
    let relay =
        model("states = ['x', 'v']\nstart = [1, 0]\nf = ['v', '-x - 0.2*v + sign(sin(t))']");
    let found =
        exponents(&relay, &Options { t_end: 400.0, ..Options::default() }, 40.0, 2).unwrap();
    near(found.values[0], -0.1, 2e-3);
    near(found.values[0] + found.values[1], -0.2, 1e-6);
    // On the line of a sliding control neighbours approach at lambda; across it sliding takes them
    // away.
    let control = shipped("sliding-mode-control");
    let found =
        exponents(&control, &Options { t_end: 60.0, ..Options::default() }, 3.0, 2).unwrap();
    near(found.values[0], -1.0, 1e-6);
    assert_eq!(found.values[1], f64::NEG_INFINITY);
    // Giaouris, Maity, Banerjee, Pickert & Zahawi (2008), sec. V: -0.8211 +- 0.0708i at 24 V.
    let options = Options { start: Some(vec![12.0222, 0.6065]), ..Options::default() };
    let orbit = closed_orbit(&shipped("buck"), &options, &Return::Period(400e-6), 0.0).unwrap();
    near(orbit.multipliers[0][0], -0.8211, 5e-5);
    near(orbit.multipliers[0][1].abs(), 0.0708, 5e-5);
    // A forced oscillator's multipliers over one period are exp of its eigenvalues times the
    // period.
    let period = 2.0 * std::f64::consts::PI;
    let options = Options { start: Some(vec![0.3, 0.2]), ..Options::default() };
    let orbit = closed_orbit(&relay, &options, &Return::Period(period), 0.0).unwrap();
    let size = (orbit.multipliers[0][0].powi(2) + orbit.multipliers[0][1].powi(2)).sqrt();
    near(size, (-0.1 * period).exp(), 1e-8);
    // Stick-slip: a piece of sliding forgets everything, and the multiplier is 0.
    let block = model(
        "states = ['x', 'v']\nstart = [0, 0]\nf = ['v', '-x + (1 - 0.3*(0.5 - v))*sign(0.5 - \
            v)*1']",
    );
    let options = Options {
        start: Some(vec![0.0, 0.5]),
        record: section("x"),
        t_end: 60.0,
        ..Options::default()
    };
    if let Ok(orbit) = closed_orbit(&block, &options, &Return::Crossings(1), 0.0) {
        near(orbit.multipliers[0][0], 0.0, 1e-9);
    }
}

/// On a superstable orbit nothing of a neighbour is left: 2 x (1 - x) has the derivative 0 at 1/2,
/// and Newton's method for a root; a map that shrinks by 1e-20 has its logarithm.
#[test]
fn superstable_orbits_have_no_exponent() {
    use crate::motion::tangent::exponents;
    let of = |set: &str, start: f64| {
        let text = format!(
            "states = ['x']\nstart = [{start}]\nf = ['0']\n[[event]]\nevery = 1\n\
             set = {{ x = '{set}' }}"
        );
        let options = Options { t_end: 60.0, ..Options::default() };
        exponents(&model(&text), &options, 20.0, 1).unwrap().values[0]
    };
    for start in [0.1, 0.23, 0.31, 0.44, 0.77, 0.9123] {
        assert_eq!(of("2*x*(1 - x)", start), f64::NEG_INFINITY, "{start}");
        for a in [2.0, 0.37, 13.1] {
            assert_eq!(of(&format!("(x + {a}/x)/2"), start), f64::NEG_INFINITY, "{a} {start}");
        }
    }
    near(of("1e-20*x + 0.1", 0.3), -20.0 * 10.0_f64.ln(), 1e-6);
}

/// Sliding in the transient takes nothing away from the attractor, and growth by a power of the
/// time is not told from none.
#[test]
fn exponents_are_those_of_the_attractor() {
    use crate::motion::tangent::exponents;
    let text = "states = ['x', 'y']\nstart = [0.1, 1]\n\
        f = ['if(t < 1, -2*sign(x), -x) + 0.1*y', '-0.5*y']";
    let options = Options { t_end: 30.0, ..Options::default() };
    let found = exponents(&model(text), &options, 5.0, 2).unwrap();
    for (i, want) in [-0.5, -1.0].into_iter().enumerate() {
        assert!((found.values[i] - want).abs() <= found.errors[i], "{found:?}");
        assert!(found.errors[i] < 0.5, "{found:?}");
    }
    // Periods of a pendulum, and of an elastic ball, differ between neighbours.
    let pendulum = "states = ['x', 'y']\nstart = [0, 0]\nf = ['y', '-sin(x)']";
    let ball = "states = ['x', 'y']\nstart = [0, 0]\nf = ['y', '-1']\n[[event]]\nwhen = 'x'\n\
        direction = 'down'\nset = { y = '-y' }";
    for (text, starts, t_end) in [
        (pendulum, [0.1466, 0.5, 1.3, 2.4, 2.9], 1000.0),
        (pendulum, [0.1466, 0.5, 1.3, 2.4, 2.9], 200.0),
        (ball, [0.5, 0.8, 1.1, 1.6, 2.0], 30.0),
        (ball, [0.5, 0.8, 1.1, 1.6, 2.0], 10.0),
    ] {
        for start in starts {
            let options = Options { start: Some(vec![start, 0.0]), t_end, ..Options::default() };
            let found = exponents(&model(text), &options, 0.0, 1).unwrap();
            assert!(found.values[0].abs() <= found.errors[0], "{start} {t_end} {found:?}");
        }
    }
}

/// Growth in any one of many states is followed, and what the first state's own direction hides.
#[test]
fn exponents_see_every_state() {
    use crate::motion::tangent::exponents;
    for (n, growing) in [(14, 13), (14, 0), (13, 12), (20, 5)] {
        let names: Vec<String> = (0..n).map(|i| format!("'x{i}'")).collect();
        let rate = |i: usize| if i == growing { 0.5 } else { -1.0 - 0.1 * i as f64 };
        let field: Vec<String> = (0..n).map(|i| format!("'{:?}*x{i}'", rate(i))).collect();
        let text = format!(
            "states = [{}]\nstart = {:?}\nf = [{}]",
            names.join(", "),
            vec![1.0; n],
            field.join(", ")
        );
        let options = Options { t_end: 40.0, ..Options::default() };
        let found = exponents(&model(&text), &options, 10.0, 12).unwrap();
        near(found.values[0], 0.5, 1e-6);
    }
    // From (1, 0) the direction of the first state is exactly that of the approach.
    let hopf = "states = ['x', 'y']\nstart = [1, 0]\n\
        f = ['0.1*x - 2*y - x*(x^2 + y^2)', '2*x + 0.1*y - y*(x^2 + y^2)']";
    let options = Options { t_end: 200.0, ..Options::default() };
    let found = exponents(&model(hopf), &options, 100.0, 2).unwrap();
    near(found.values[0], 0.0, 1e-4);
    near(found.values[1], -0.2, 1e-4);
}

/// Exponents whatever the units of the states; minus infinity where sliding or a reset takes a
/// direction away, and nowhere else.
#[test]
fn exponents_have_no_units_and_vanish_by_switches_alone() {
    use crate::motion::tangent::exponents;
    let of = |text: &str, t_end: f64, transient: f64, count: usize| {
        let options = Options { t_end, ..Options::default() };
        exponents(&model(text), &options, transient, count).unwrap()
    };
    for unit in [1.0, 1e6, 1e9] {
        let text = format!(
            "states = ['x', 'y']\nstart = [{:e}, 0]\nf = ['0.2*x - {:e}*y - x*r', '{:e}*x + 0.2*y \
                - y*r']\n[let]\nr = '(x/{unit:e})^2 + (y*{unit:e})^2'",
            0.5 * unit,
            unit * unit,
            1.0 / (unit * unit)
        );
        for transient in [0.0, 100.0] {
            let found = of(&text, 600.0, transient, 2);
            let (top, low) = (found.values[0], found.values[1]);
            assert!(top.abs() < 1e-3 + found.errors[0], "{unit:e}: {found:?}");
            assert!((low + 0.4).abs() < 1e-3 + found.errors[1], "{unit:e}: {found:?}");
        }
    }
    let found =
        of("states = ['x', 'y']\nstart = [1, 1]\nf = ['-x', '-3*y + 1e17*x']", 20.0, 1.0, 2);
    near(found.values[0], -1.0, 1e-2);
    near(found.values[1], -3.0, 1e-2);
    let reset = "states = ['x', 'y']\nstart = [1, 1]\nf = ['-x', '-3*y']\n[[event]]\nevery = 1\n\
        set = { y = '1' }";
    assert_eq!(of(reset, 30.0, 3.0, 2).values[1], f64::NEG_INFINITY);
    // The clock (c, s) drives q, whose growth, 0.3/sqrt(pi) - 0.001, leaves neighbours of the clock
    // in its own direction alone.
    let driven = "states = ['c', 's', 'q']\nstart = [1, 0, 1]\nf = ['c*g - s', 'c + s*g', \
        'q*(30*exp(-(c/0.01)^2) - 0.001)']\n[let]\ng = '1 - c^2 - s^2'";
    let found = of(driven, 400.0, 0.0, 3);
    assert!((found.values[0] - 0.168_257).abs() < found.errors[0], "{found:?}");
    assert!(found.values.len() < 3 && found.values.iter().all(|v| v.is_finite()), "{found:?}");
}

/// The converter's orbit as matrix exponentials give it (SciPy's `expm`, Newton's method on the
/// period), and its averages: E + v2 = v1 whatever the ripple, and without ripple v2 = E d/(1 - d),
/// or E d/sqrt(K) where the diode blocks before the period ends (Cuk & Middlebrook 1977).
#[test]
fn a_cuk_converter_has_its_closed_orbits() {
    use crate::motion::tangent::{Return, closed_orbit};
    let text = twofold_system::library::general("cuk-converter").unwrap();
    let averaged = text
        .replace("start = [", "start = [0, 0, ")
        .replace("states = [", "states = [\"a1\", \"a2\",")
        .replace("f = [", "f = [\"v1/period\", \"v2/period\",");
    let always = [
        0.218_389_663_520_619_75,
        20.150_423_570_475_724,
        0.351_820_166_631_876_3,
        7.995_275_864_182_7,
    ];
    let partly = [
        0.002_243_986_613_041_76,
        25.590_378_587_232_767,
        -0.002_243_986_613_041_735_8,
        13.572_417_655_863_98,
    ];
    let sizes = (
        [0.987_751_6, 0.987_751_6, 0.963_024_94, 0.963_024_94],
        [0.997_151_281, 0.997_151_281, 0.995_008_467, 0.0],
    );
    let averages = (
        [19.998_721_264_603_635, 7.998_721_264_603_72],
        [25.580_796_932_456_376, 13.580_796_932_456_662],
    );
    let ideal = (0.4 / 0.6, 0.4 / 0.125_f64.sqrt());
    for (load, orbit, sizes, averages, ideal) in [
        (20.0, always, sizes.0, averages.0, ideal.0),
        (400.0, partly, sizes.1, averages.1, ideal.1),
    ] {
        let model = model(text).with("load", load).unwrap();
        // From a start beside it.
        let start = orbit.iter().map(|x| x * 1.001).collect();
        let options = Options { start: Some(start), ..Options::default() };
        let found = closed_orbit(&model, &options, &Return::Period(20e-6), 0.0).unwrap();
        found.x.iter().zip(orbit).for_each(|(x, want)| near(*x, want, 1e-8));
        let mut of: Vec<f64> =
            found.multipliers.iter().map(|m| (m[0] * m[0] + m[1] * m[1]).sqrt()).collect();
        of.sort_by(|a, b| b.total_cmp(a));
        of.iter().zip(sizes).for_each(|(size, want)| near(*size, want, 1e-6));
        let averaged = Model::new(Definition::from_toml(&averaged, "test.toml").unwrap())
            .with("load", load)
            .unwrap();
        let start = [0.0, 0.0].into_iter().chain(orbit).collect();
        let options = Options { t_end: 20e-6, start: Some(start), ..Options::default() };
        let end = follow(&averaged, &options, &mut |_| true).unwrap().x;
        near(end[0], averages[0], 1e-8);
        near(end[1], averages[1], 1e-8);
        near(12.0 + end[1], end[0], 1e-8);
        near(end[1], 12.0 * ideal, 5e-4 * end[1]);
        end[2..].iter().zip(orbit).for_each(|(x, want)| near(*x, want, 1e-8));
        // Sliding ends where the ramp jumps back, ten times.
        let options =
            Options { t_end: 10.0 * 20e-6, start: Some(orbit.to_vec()), ..Options::default() };
        let end = follow(&model, &options, &mut |_| true).unwrap().x;
        end.iter().zip(orbit).for_each(|(x, want)| near(*x, want, 1e-8));
    }
}

/// Carried tangent vectors agree with neighbours that are followed themselves.
#[test]
fn tangent_vectors_agree_with_finite_differences() {
    use crate::motion::tangent::{Return, closed_orbit};
    let text = "states = ['x', 'v']\nf = ['v', '-x - 0.1*v - 0.4*sign(v - 0.3) + 1.2*cos(1.3*t)']\n\
        [[event]]\nwhen = 'x - 0.9'\ndirection = 'up'\nset = { v = '-0.6*v + 0.1*x' }";
    let period = 2.0 * std::f64::consts::PI / 1.3;
    let model = model(text);
    let start = vec![0.2, 0.1];
    // The derivative of the map over one period, by the first Newton step's matrix: multipliers of
    // a closed orbit need one to exist.
    let Ok(orbit) = closed_orbit(
        &model,
        &Options { start: Some(start), ..Options::default() },
        &Return::Period(period),
        0.0,
    ) else {
        panic!("no orbit")
    };
    let map = |x: Vec<f64>| {
        let options = Options { start: Some(x), t_end: period, ..Options::default() };
        follow(&model, &options, &mut |_| true).unwrap().x
    };
    let h = 1e-6;
    let mut matrix = [0.0; 4];
    for j in 0..2 {
        let (mut up, mut down) = (orbit.x.clone(), orbit.x.clone());
        up[j] += h;
        down[j] -= h;
        let (up, down) = (map(up), map(down));
        for i in 0..2 {
            matrix[i * 2 + j] = (up[i] - down[i]) / (2.0 * h);
        }
    }
    let (trace, determinant) =
        (matrix[0] + matrix[3], matrix[0] * matrix[3] - matrix[1] * matrix[2]);
    let [a, b] = [orbit.multipliers[0], orbit.multipliers[1]];
    near(a[0] + b[0], trace, 1e-5);
    near(a[0] * b[0] - a[1] * b[1], determinant, 1e-5);
}

/// An expression that left zero at one event is not zero at the next: a ball above another meets
/// the floor and the other by turns.
#[test]
fn events_that_follow_each_other_are_told_apart() {
    let text = "states = ['x1', 'v1', 'x2', 'v2']\nstart = [1, 0, 2, 0]\nf = ['v1', '-9.81', 'v2', \
        '-9.81']\n\
        [[event]]\nname = 'floor'\nwhen = 'x1'\ndirection = 'down'\nset = { v1 = '-v1' }\n\
        [[event]]\nname = 'collide'\nwhen = 'x2 - x1'\ndirection = 'down'\nset = { v1 = 'v2', v2 = \
        'v1' }";
    let (events, outcome) = run(&model(text), 20.0);
    let x = outcome.unwrap().x;
    // Energy stays what it was, and the balls keep their order.
    near(0.5 * (x[1] * x[1] + x[3] * x[3]) + 9.81 * (x[0] + x[2]), 9.81 * 3.0, 1e-8);
    assert!(x[0] >= -1e-12 && x[2] >= x[0] - 1e-12 && events.len() > 60, "{x:?} {}", events.len());
}

/// Roots that are written for one side of a switch each: motion comes to the edge and goes on.
#[test]
fn a_domain_may_end_at_a_switch() {
    // A tank runs empty at t = 2 and stays so.
    let x = end("states = ['h']\nstart = [1]\nf = ['-sqrt(max(h, 0))']", 5.0);
    near(x[0], 0.0, 1e-12);
    // |x|^0.5 on both sides: x' = -1.5 sqrt(|x|) sign(x) - 1 from 1 crosses 0 at
    // t = 4/3 (1 - 2/3 ln(5/2)).
    let x = end(
        "states = ['x', 't0']\nstart = [1, 0]\nf = ['-1.5*abs(x)^0.5*sign(x) - 1', 'x > 0']",
        3.0,
    );
    near(x[1], 4.0 / 3.0 * (1.0 - 2.0 / 3.0 * 2.5_f64.ln()), 1e-8);
    // It tends to where 1.5 sqrt(-x) = 1.
    near(
        end("states = ['x']\nstart = [1]\nf = ['-1.5*abs(x)^0.5*sign(x) - 1']", 30.0)[0],
        -4.0 / 9.0,
        1e-8,
    );
}

/// A condition may have a name.
#[test]
fn conditions_have_names() {
    let x = end(
        "states = ['x']\nstart = [0]\nf = ['if(late and not cold, 2, 1) + late']\n[let]\nlate = 't \
            > 1'\ncold = 'early'\nearly = 't < 2'",
        3.0,
    );
    // 1 to t = 1, 2 to t = 2, 3 to t = 3.
    near(x[0], 6.0, 1e-10);
}

/// Stiff modes and stiff sliding by the implicit method: a few steps where an explicit one needs a
/// million.
#[test]
fn stiff_motion_is_followed_by_the_implicit_methods() {
    use crate::motion::Method;
    for (f, t_end, want) in [
        // x follows cos t to 1e-6; y switches where x does, at pi/2.
        (
            "'-1e6*(x - cos(t))', 'sign(x) - y'",
            3.0,
            2.0 * (-(3.0 - std::f64::consts::FRAC_PI_2)).exp() - 1.0 - (-3.0_f64).exp(),
        ),
        // Sliding on x = 0 with a fast state behind it: y -> 1/2 there.
        ("'-sign(x) + y', '-1e6*(y - 0.5)'", 3.0, 0.5),
    ] {
        let model = model(&format!("states = ['x', 'y']\nstart = [1, 0]\nf = [{f}]"));
        for method in [Method::Radau5, Method::Lsoda] {
            let options = Options { t_end, method, ..Options::default() };
            let outcome = follow(&model, &options, &mut |_| true).unwrap();
            near(outcome.x[1], want, 2e-6);
            assert!(outcome.steps < 3000, "{} steps", outcome.steps);
        }
    }
    // Its order and its accuracy on a smooth motion.
    let circle = model("states = ['x', 'v']\nstart = [1, 0]\nf = ['v', '-x']");
    let end = |rtol: f64| {
        let options = Options { t_end: 10.0, rtol, method: Method::Radau5, ..Options::default() };
        (follow(&circle, &options, &mut |_| true).unwrap().x[0] - 10.0_f64.cos()).abs()
    };
    assert!(end(1e-8) < 1e-8 && end(1e-11) < 1e-11, "{} {}", end(1e-8), end(1e-11));
}

/// A flight that ends where it began is a step whose state comes back to zero.
#[test]
fn a_ball_bounces_until_it_rests_by_every_method() {
    use crate::motion::Method;
    let ends = Method::ALL.map(|method| {
        [1e-5, 1e-8, 1e-11].map(|rtol| {
            let options = Options { t_end: 10.0, rtol, method, ..Options::default() };
            let mut last = 0.0;
            let outcome = follow(&shipped("bouncing-ball"), &options, &mut |p| {
                last = if p.event.is_some() { p.t } else { last };
                true
            });
            assert_eq!(outcome.unwrap().ending, Ending::Finished, "{method:?} {rtol}");
            last
        })
    });
    let zeno = (2.0_f64 / 9.81).sqrt() * 1.8 / 0.2;
    for end in ends.as_flattened() {
        near(*end, zeno, 1e-4);
    }
}

/// Dry friction against a relay: each turn loses a third of the last one's speed squared, and after
/// infinitely many the block rests.
#[test]
fn switches_that_accumulate_may_end_in_rest() {
    // From (1, 0): x'' = -1/2 to v = -1 at x = 0, then -x'' = 3/2 ... the turns' times are a
    // geometric series of ratio 1/sqrt(3).
    let text = "states = ['x', 'v']\nstart = [1, 0]\nf = ['v', '-sign(x) - 0.5*sign(v)']";
    let mut rows = Vec::new();
    let options =
        Options { t_end: 12.0, record: Record::Times { every: 1.0 }, ..Options::default() };
    let outcome = follow(&model(text), &options, &mut |p| {
        rows.push((p.t, p.x[0], p.x[1], p.signs.to_owned()));
        true
    })
    .unwrap();
    assert_eq!((outcome.ending, rows.len()), (Ending::Finished, 13));
    // 2 to x = 0 at speed 1; then turns of duration v (2/3 + 2/sqrt(3)) each, v falling by
    // 1/sqrt(3).
    let q = 1.0 / 3.0_f64.sqrt();
    let rest = 2.0 + (2.0 / 3.0 + 2.0 * q) / (1.0 - q);
    assert!(
        rows.iter()
            .all(|(t, x, v, signs)| (*t > rest) == (*x == 0.0 && *v == 0.0 && signs == "00")),
        "{rows:?} {rest}"
    );
}

#[test]
fn a_ball_that_lies_on_the_floor_stays_there() {
    let ball = "states = ['x', 'v']\nstart = [0, 0]\nf = ['v', '-1']\n[[event]]\nwhen = \
        'x'\ndirection = 'down'\nset = { v = '-0.5*v' }\nafter_zeno = 'stick'";
    assert_eq!(end(ball, 5.0), [0.0, 0.0]);
    // Lifted, it leaves.
    near(end(&ball.replace("'-1'", "'t - 1'"), 4.0)[0], 4.5, 1e-9);
}

/// Mixtures that differ are refused, also where the surfaces themselves know nothing of each other.
#[test]
fn mixtures_with_other_velocities_are_refused() {
    for f in [
        "'-sign(x)', '-sign(y)', 'sign(x)*sign(y)'",
        "'-sign(x) - 0.5*sign(x)*sign(y)', '-sign(y) + 0.3*sign(x)*sign(y)', 'sign(x)*sign(y)'",
    ] {
        let text = format!("states = ['x', 'y', 'z']\nstart = [1, 0.8, 0]\nf = [{f}]");
        let error = run(&model(&text), 3.0).1.unwrap_err().to_string();
        assert!(
            error.contains("x = 0")
                && error.contains("y = 0")
                && error.contains("different velocities"),
            "{error}"
        );
    }
}

/// Products of sides act on the surfaces themselves: all mixtures that stay have one velocity.
#[test]
fn mixtures_with_one_velocity_are_followed() {
    for (f, z) in [
        ("'-sign(x)', '-sign(y)*(2 + sign(x))', '1'", 4.0),
        ("'-sign(x) - 0.5*sign(x)*sign(y)', '-sign(y) + 0.3*sign(x)*sign(y)', '0'", 0.0),
        // z' is 1 and twice the speed of x.
        ("'-sign(x)*(2 + sign(y))', '-sign(y)', '1 - 2*sign(x)*(2 + sign(y))'", 4.0 - 2.0),
    ] {
        let text = format!("states = ['x', 'y', 'z']\nstart = [1, 0.7, 0]\nf = [{f}]");
        let x = end(&text, 4.0);
        assert!(x[0].abs() < 1e-12 && x[1].abs() < 1e-12, "{f}: {x:?}");
        near(x[2], z, 1e-9);
    }
}

/// Around a corner whose fields turn, the distance grows by ((1 + a)/(1 - a))^4 with each turn,
/// behind a position and its speed by a factor of sqrt((1 + a)/(1 - a)) each half turn.
#[test]
fn a_corner_that_is_turned_around_holds_or_is_left() {
    let refused = |text: &str| {
        let error = run(&model(text), 3.0).1.unwrap_err();
        assert!(error.to_string().contains("turn away"), "{error}\n{text}");
        let HybridError::Undecided { t, .. } = error else { panic!("{error}") };
        t
    };
    let turning = |a: &str, start: &str| {
        format!(
            "states = ['x', 'y', 'z']\nstart = [{start}]\nf = ['sign(y) + {a}*sign(x)', \
             '-sign(x) + {a}*sign(y)', '1 + 0.5*sign(x)']"
        )
    };
    assert_eq!(refused(&turning("0.2", "0, 0, 0")), 0.0);
    let planar = "states = ['x', 'y']\nstart = [0, 0]\nf = ['sign(y) + sign(x)/5', '-sign(x) + \
        sign(y)/5']";
    assert_eq!(refused(planar), 0.0);
    let position = |a: &str| {
        format!("states = ['x', 'v']\nstart = [0, 0]\nf = ['v', '-sign(x) + {a}*sign(v)']")
    };
    let error = run(&model(&position("0.5")), 3.0).1.unwrap_err();
    assert!(matches!(error, HybridError::Undecided { .. }), "{error}");
    assert_eq!(end(&position("-0.5"), 3.0), [0.0, 0.0]);
    // Turns that grow by nothing need for ever.
    let x = end(&turning("0", "0, 0, 0"), 3.0);
    assert_eq!(x[..2], [0.0, 0.0]);
    near(x[2], 3.0, 1e-14);
    // Infinitely many switches in finite time, and then along the corner.
    let text = turning("-0.2", "0.5, 0.1, 0");
    let x = end(&text, 9.0);
    assert!(x[0].abs() < 1e-12 && x[1].abs() < 1e-12, "{x:?}");
    // The integral of sign(x) is that of what x and y fall by: 1.04 (1, y) = (-0.2 x - y, ...).
    near(x[2], 9.0 + 0.5 * (-0.2 * -0.5 - -0.1) / 1.04, 1e-9);
    // Where growth begins while the motion stays there, it is not decided any more.
    for method in Method::ALL {
        let text = turning("0.2*(z - 1)", "0.1, 0, 0");
        let options = Options { t_end: 3.0, method, ..Options::default() };
        let error = follow(&model(&text), &options, &mut |_| true).unwrap_err();
        let HybridError::Undecided { x, .. } = &error else { panic!("{method:?}: {error}") };
        near(x[2], 1.0, 1e-6);
    }
}

/// A ramp of force tears a block loose at t = f/r, when both its speed and its acceleration are
/// zero.
#[test]
fn a_block_is_torn_loose_by_a_ramp() {
    for (ramp, friction) in
        [(0.5, 1.0), (0.3, 1.0), (0.25, 1.0), (1.0, 1.0), (0.37, 0.9), (0.7, 1.2), (0.013, 0.017)]
    {
        let loose = friction / ramp;
        for method in Method::ALL {
            for (states, f, start) in [
                ("'x', 'v'", format!("'v', '{ramp}*t - {friction}*sign(v)'"), "0, 0"),
                ("'s', 'x', 'v'", format!("'{ramp}', 'v', 's - {friction}*sign(v)'"), "0, 0, 0"),
            ] {
                let text = format!("states = [{states}]\nstart = [{start}]\nf = [{f}]");
                let options = Options { t_end: loose + 1.0, method, ..Options::default() };
                let outcome = follow(&model(&text), &options, &mut |_| true)
                    .unwrap_or_else(|e| panic!("{method:?}: {e}\n{text}"));
                let [.., x, v] = outcome.x.as_slice() else { panic!() };
                near(*v, 0.5 * ramp, 1e-9);
                near(*x, ramp / 6.0, 1e-9);
                assert!(outcome.switches <= 3, "{method:?} {}\n{text}", outcome.switches);
            }
            // Pulled by a spring.
            let text = format!(
                "states = ['x', 'v', 'u']\nstart = [0, 0, 0]\nf = ['v', '{ramp}*(u - x) - \
                 {friction}*sign(v)', '1']"
            );
            let options = Options { t_end: loose + 1.0, method, ..Options::default() };
            let outcome = follow(&model(&text), &options, &mut |_| true)
                .unwrap_or_else(|e| panic!("{method:?}: {e}\n{text}"));
            near(outcome.x[1], 1.0 - f64::cos(f64::sqrt(ramp)), 1e-8);
        }
    }
}

/// Powers and roots of zero, where a motion begins or which it passes.
#[test]
fn powers_and_roots_of_zero_belong_to_the_domain() {
    for (start, f, t_end, want) in [
        ("0, 1", "x^1.5", 1.0, 1.4),
        ("0, 1", "sqrt(x)", 1.0, 1.0 + 2.0 / 3.0),
        ("-1, 1", "sign(x)*abs(x)^(1/3)", 2.0, 1.0),
        ("-1, 1", "sign(x)*sqrt(abs(x))", 2.0, 1.0),
        ("-1, 1", "abs(x)^1.5", 2.0, 1.8),
    ] {
        let text = format!("states = ['x', 'y']\nstart = [{start}]\nf = ['1', '{f}']");
        for method in Method::ALL {
            let options = Options { t_end, method, ..Options::default() };
            let outcome = follow(&model(&text), &options, &mut |_| true)
                .unwrap_or_else(|e| panic!("{method:?}: {e}\n{text}"));
            near(outcome.x[1], want, 1e-8);
        }
    }
}

#[test]
fn two_blocks_are_torn_loose_one_after_the_other() {
    for f in [
        "'-sign(x) + 0.41*s', '-sign(y) + 0.23*s', '1'",
        "'-sign(x) + 0.41*t', '-sign(y) + 0.23*t', '1'",
    ] {
        let text = format!("states = ['x', 'y', 's']\nstart = [0.1, 0.2, 0]\nf = [{f}]");
        for method in Method::ALL {
            let options = Options { t_end: 5.0, method, ..Options::default() };
            let outcome = follow(&model(&text), &options, &mut |_| true)
                .unwrap_or_else(|e| panic!("{method:?}: {e}\n{text}"));
            for (i, rate) in [0.41, 0.23].into_iter().enumerate() {
                let since = 5.0 - 1.0 / rate;
                near(outcome.x[i], 0.5 * rate * since * since, 1e-9);
            }
        }
    }
}

/// The derivative of a reset where the state is zero, small, or small beside what is added.
#[test]
fn resets_have_their_derivatives_near_zero() {
    for (start, set, want) in [
        (0.0, "x + 1", 1.0),
        (1e-300, "x + 1", 1.0),
        (1e-12, "x + 1", 1.0),
        (1e-6, "x + 1e6", 1.0),
        (0.0, "2*x + 1", 2.0),
        (0.0, "exp(3*x)", 3.0),
        (0.5, "x^2 + t", 1.0),
        (0.0, "if(t > 0, x + 1, x)", 1.0),
    ] {
        let text = format!(
            "states = ['x']\nstart = [{start:?}]\nf = ['0']\n[[event]]\nat = 1\nset = {{ x = \
             '{set}' }}"
        );
        let options = Options { t_end: 1.5, ..Options::default() };
        let found = crate::motion::sensitivity::sensitivities(&model(&text), &options, &[])
            .unwrap_or_else(|e| panic!("{e}\n{text}"));
        assert!((found.by_start[0][0] - want).abs() < 1e-8, "{want} {found:?}\n{text}");
    }
}

/// A switching function whose value changes with the side of another one.
#[test]
fn sides_follow_the_sides_that_they_depend_on() {
    for (f, start, t_end, want) in [
        ("-abs(sign(x - 1))", 2.0, 2.0, 0.0),
        ("-sign(x)*abs(sign(x))", 0.5, 5.0, 0.0),
        ("-sign(sign(x))", 1.0, 3.0, 0.0),
        ("-sign(heaviside(x) - 0.5)", 1.0, 3.0, 0.0),
        ("if(if(x > 0, 1, -1) > 0, -1, 1)", 1.0, 3.0, 0.0),
        ("-clip(10*sign(x), -1, 1)", 1.0, 3.0, 0.0),
        ("-sign(floor(x) + 0.5)", 0.7, 3.0, 0.0),
        ("-0.5 - heaviside(if(x > 0, -0.5*x, 1))", 1.0, 4.0, -3.0),
        ("-0.5 - heaviside(if(x > 0, -0.5*x, mod(x, 2)))", 1.0, 4.0, -3.0),
        ("-1 - 0.5*floor(0.5 + 0.3*sign(x))", 1.0, 3.0, -2.0),
    ] {
        for method in Method::ALL {
            let text = format!("states = ['x']\nstart = [{start}]\nf = ['{f}']");
            let options = Options { t_end, method, ..Options::default() };
            let outcome = follow(&model(&text), &options, &mut |_| true)
                .unwrap_or_else(|e| panic!("{method:?}: {e}\n{text}"));
            assert!((outcome.x[0] - want).abs() < 1e-9, "{method:?} {} {text}", outcome.x[0]);
        }
    }
}

/// A switching function that is zero on a whole side of another rests there: its sign is 0, and it
/// is not greater than zero.
#[test]
fn functions_may_be_zero_on_one_side() {
    for (f, start, t_end, want) in [
        ("'-1', 'abs(max(x, 0))'", 1.0, 3.0, 0.5),
        ("'-1', 'if(max(x, 0) > 0, 1, 2)'", 1.0, 3.0, 5.0),
        ("'1', 'if(max(x, 0) > 0, 1, 2)'", -1.0, 3.0, 4.0),
        ("'-1', 'heaviside(max(x, 0))'", 1.0, 3.0, 3.0),
        ("'1', 'heaviside(max(x, 0))'", -1.0, 3.0, 3.0),
        ("'-1', 'sign(max(x, 0))'", 1.0, 3.0, 1.0),
        ("'1', 'sign(max(x, 0))'", -1.0, 3.0, 2.0),
        ("'-1', 'clip(max(1, x + 0.5), 0, 1)'", 1.0, 3.0, 3.0),
        ("'-1', 'sign(abs(x) - x)'", 1.0, 3.0, 2.0),
        ("'1', 'sign(abs(x) - x)'", -1.0, 3.0, 1.0),
        ("'1', 'if(abs(x) - x >= 0, 2, 0)'", -1.0, 3.0, 6.0),
        ("'1', '1 + 0.5*clip(abs(min(x, 0)), -1, 0)'", -1.0, 2.0, 2.0),
        // Fields that a function at rest decides.
        ("'0.5 - heaviside(max(x, 0))', '1'", 1.0, 3.0, 3.0),
        ("'-sign(x)', '1 + abs(max(x, 0))'", 1.0, 3.0, 3.5),
    ] {
        for method in Method::ALL {
            let text = format!("states = ['x', 'y']\nstart = [{start}, 0]\nf = [{f}]");
            let options = Options { t_end, method, ..Options::default() };
            let outcome = follow(&model(&text), &options, &mut |_| true)
                .unwrap_or_else(|e| panic!("{method:?}: {e}\n{text}"));
            assert!((outcome.x[1] - want).abs() < 1e-9, "{method:?} {:?} {text}", outcome.x);
        }
    }
    let one = |f: &str, start: f64, t_end| {
        last(&format!("states = ['x']\nstart = [{start}]\nf = ['{f}']"), t_end)
    };
    // x' = -0.5 - x to x = 0 at ln 3, then -0.5.
    near(one("-0.5 - abs(max(x, 0))", 1.0, 3.0), -0.5 * (3.0 - 3.0_f64.ln()), 1e-9);
    // 0.5 + abs(-1) = 1.5 from x = 0 on, and before, where clip ends at 1.
    near(one("0.5 + clip(abs(min(x - 1, -1)), -1, 1)", -1.0, 1.0), 0.5, 1e-9);
    // A counter that nothing counts.
    let counter =
        |f: &str| last(&format!("states = ['n', 'y']\nstart = [0, 0]\nf = ['0', '{f}']"), 2.0);
    near(counter("1 + sign(n)"), 2.0, 1e-12);
    near(counter("1 + heaviside(n)"), 4.0, 1e-12);
    near(counter("if(n > 0, 1, 0) + if(n >= 0, 2, 0)"), 4.0, 1e-12);
}

/// A switching function that comes to zero and turns back is not passed.
#[test]
fn what_is_touched_is_not_passed() {
    for (f, start, t_end, want) in [
        ("1.5 - floor(2*sin(y))", 1.0, 2.0, 2.0),
        ("1.5 - floor(2*sin(y))", 0.9, 2.0, 1.9),
        ("1.37 - floor(2*sin(y))", 1.1, 2.0, 1.84),
        ("-sign(sin(y) - 1)", 1.0, 2.0, 3.0),
        ("if(sin(y) < 1, 1, -1)", 1.0, 2.0, 3.0),
        ("0.5 - floor(sin(y))", 1.0, 2.0, 2.0),
        ("sign(y^2)", -1.0, 2.0, 1.0),
        ("if(y^2 > 0, 1, -1)", -1.0, 2.0, 1.0),
        ("sign((y - 0.1)^2*(2 - y))", -1.0, 2.0, 1.0),
    ] {
        for method in Method::ALL {
            let text = format!("states = ['y']\nstart = [{start}]\nf = ['{f}']");
            let options = Options { t_end, method, ..Options::default() };
            let outcome = follow(&model(&text), &options, &mut |_| true)
                .unwrap_or_else(|e| panic!("{method:?}: {e}\n{text}"));
            assert!((outcome.x[0] - want).abs() < 1e-7, "{method:?} {} {text}", outcome.x[0]);
        }
    }
}

/// Of three relays: whether they hold each other, or turn each other away.
#[test]
fn three_relays_that_act_on_each_other() {
    let of = |f: &str| {
        let text =
            format!("states = ['x', 'y', 'z', 'w']\nstart = [0.2, 0.3, -0.1, 0]\nf = [{f}, '1']");
        run(&model(&text), 6.0).1
    };
    for f in [
        "'-sign(x) + 0.5*sign(y)', '-sign(y) + 0.5*sign(z)', '-sign(z) - 0.5*sign(x)'",
        "'-sign(x)', '-sign(y) + 3*sign(x)', '-sign(z) + 5*sign(y) - 2*sign(x)'",
    ] {
        let x = of(f).unwrap_or_else(|e| panic!("{e}\n{f}")).x;
        assert!(x[..3].iter().all(|x| x.abs() < 1e-12) && (x[3] - 6.0).abs() < 1e-12, "{x:?}");
    }
    let f = "'-sign(y)', '-sign(z)', '-sign(x)'";
    let text = format!("states = ['x', 'y', 'z', 'w']\nstart = [0, 0, 0, 0]\nf = [{f}, '1']");
    let error = run(&model(&text), 3.0).1.unwrap_err().to_string();
    assert!(error.contains("turn away"), "{error}");
}

/// On two relays with z' = 3/2 + sign(x) sign(y): equal weights give z' = 3/2, and the shortest
/// velocity of the hull is 1/2.
#[test]
fn a_rule_chooses_among_mixtures() {
    use crate::selection::Intersection;
    let text = "states = ['x', 'y', 'z']\nstart = [1, 1, 0]\nf = ['-sign(x)', '-sign(y)', '1.5 + \
        sign(x)*sign(y)']";
    // z' = 5/2 until both are met at t = 1.
    for (intersection, want) in
        [(Intersection::Bilinear, 2.5 + 3.0), (Intersection::HullLeastNorm, 2.5 + 1.0)]
    {
        let options = Options { t_end: 3.0, intersection, ..Options::default() };
        let x = follow(&model(text), &options, &mut |_| true).unwrap().x;
        near(x[2], want, 1e-9);
        assert!(x[0].abs() < 1e-12 && x[1].abs() < 1e-12);
    }
    // Of sets of fields that have no mixture the solution is none (SciPy's linprog: 0.3157259).
    let text = "states = ['x', 'y', 'z']\nstart = [0, 0, 0]\nf = ['0.199 - 2*sign(x) + \
        0.191*sign(y) - 0.026*sign(x)*sign(y)', '0.058 - 0.54*sign(x) - 1.5*sign(y) + \
        0.122*sign(x)*sign(y)', '0.427 + 0.63*sign(x) - 0.46*sign(y) + 0.219*sign(x)*sign(y)']";
    let options =
        Options { t_end: 1.0, intersection: Intersection::HullLeastNorm, ..Options::default() };
    near(follow(&model(text), &options, &mut |_| true).unwrap().x[2], 0.3157259156361267, 1e-9);
    // Without a rule, where all mixtures have one velocity: q' = 1 in all fields.
    let text = "states = ['x', 'y', 'q']\nstart = [0, 0, 0]\n\
        f = ['-sign(x)', '-sign(y) + 0.5*sign(x)*sign(y)', '1']";
    near(run(&model(text), 1.0).1.unwrap().x[2], 1.0, 1e-12);
    // Two of three go on with the rule where the third is left, at q = 1: z' = q - 1.
    let text = "states = ['x', 'y', 'z', 'q']\nstart = [0, 0, 0, 0.2]\n\
        f = ['-sign(x)', '-sign(y)', 'q - sign(z)*(1 + 0.3*sign(x)*sign(y))', '1']";
    let options =
        Options { t_end: 2.0, intersection: Intersection::Bilinear, ..Options::default() };
    near(follow(&model(text), &options, &mut |_| true).unwrap().x[2], 0.72, 1e-9);
    // Coupled: the rule's weights solve the same equations.
    let text = "states = ['x', 'y']\nstart = [1, 1]\nf = ['-sign(x) - 0.5*sign(x)*sign(y)', \
        '-sign(y) + 0.3*sign(x)*sign(y)']";
    let options =
        Options { t_end: 4.0, intersection: Intersection::Bilinear, ..Options::default() };
    let x = follow(&model(text), &options, &mut |_| true).unwrap().x;
    assert!(x[0].abs() < 1e-12 && x[1].abs() < 1e-12, "{x:?}");
}

/// By the hierarchy the faster relay follows the slower one: with x' = -sign(x) + sign(y)/2 and x
/// first, sign(x) is sign(y)/2 on average on either side of y = 0, and z' = sign(x) sign(y) is 1/2;
/// with y' = -sign(y) - sign(x)/4 and y first it is -1/4; with equal rates it is 0.
#[test]
fn the_order_of_switches_decides() {
    use crate::selection::Intersection;
    let named = |names: &[&str]| {
        let all = ["x", "y", "w", "z"];
        let parse = |n: &&str| twofold_system::Expression::parse_general(n, &all).unwrap();
        Intersection::Order(names.iter().map(parse).collect())
    };
    let run = |text: &str, intersection: Intersection, t_end: f64| {
        follow(
            &model(text),
            &Options { t_end, intersection, max_steps: 10_000, ..Options::default() },
            &mut |_| true,
        )
    };
    let text = "states = ['x', 'y', 'z']\nstart = [1, 1, 0]\n\
        f = ['-sign(x) + 0.5*sign(y)', '-sign(y) - 0.25*sign(x)', 'sign(x)*sign(y)']";
    // y is met at t = 0.8 with x = 0.6 and z = 0.8, x from there at the speed -1.125 with z' =
    // -0.25: z(4/3) = 2/3.
    for (rule, speed) in [
        (named(&["x", "y"]), 0.5),
        (named(&["-x", "y > 0"]), 0.5),
        (named(&["y", "x"]), -0.25),
        (Intersection::Bilinear, 0.0),
    ] {
        let x = run(text, rule, 4.0 / 3.0 + 2.0).unwrap().x;
        near(x[2], 2.0 / 3.0 + 2.0 * speed, 1e-9);
        assert!(x[0].abs() < 1e-12 && x[1].abs() < 1e-12);
    }
    // Three: sign(x) = sign(y)/2 and sign(y) = sign(w)/4 on average, or each with the average 0 of
    // the one before it.
    let three = "states = ['x', 'y', 'w', 'z']\nstart = [0, 0, 0, 0]\n\
        f = ['-sign(x) + 0.5*sign(y)', '-sign(y) + 0.25*sign(w)', '-sign(w)', 'sign(x)*sign(y) + \
        sign(y)*sign(w)']";
    near(run(three, named(&["x", "y", "w"]), 1.0).unwrap().x[3], 0.75, 1e-12);
    near(run(three, named(&["w", "y", "x"]), 1.0).unwrap().x[3], 0.0, 1e-12);
    // The slower one is left at t = 2 to y > 0; x is slid upon all the time: z(2) = (1 + 2)/2, z(4)
    // = z(2) + 2, y(4) = 1.
    let leaves = "states = ['x', 'y', 'z']\nstart = [0, 0, 0]\n\
        f = ['-sign(x) + 0.5*sign(y)', '-sign(y) + 0.5*t', 'sign(x) + sign(x)*sign(y)']";
    let x = run(leaves, named(&["x", "y"]), 4.0).unwrap().x;
    near(x[1], 1.0, 1e-9);
    near(x[2], 3.5, 1e-9);
    // From t = 2 on x attracts for no side of y; the other order does not ask that.
    let ends =
        text.replace("0.5*sign(y)", "(0.5 + 0.25*t)*sign(y)").replace("[1, 1, 0]", "[0, 0, 0]");
    let error = run(&ends, named(&["x", "y"]), 4.0).unwrap_err();
    let HybridError::Undecided { t, ref ways, .. } = error else { panic!("{error}") };
    near(t, 2.0, 1e-9);
    assert!(ways.contains("does not attract for each side"), "{ways}");
    near(run(&ends, named(&["y", "x"]), 4.0).unwrap().x[2], -1.0, 1e-9);
    // If all mixtures have one velocity, the order does not matter: these turns have no surface
    // that attracts for both sides of the other.
    let turns =
        "states = ['x', 'y']\nstart = [0, 0]\nf = ['-sign(x) - 2*sign(y)', '2*sign(x) - sign(y)']";
    assert_eq!(run(turns, named(&["x", "y"]), 1.0).unwrap().x, [0.0, 0.0]);
    for (names, said) in
        [(&["x"][..], "does not name y = 0"), (&["x", "z"], "`z` is no"), (&["x", "-x"], "twice")]
    {
        let error = run(text, named(names), 4.0).unwrap_err().to_string();
        assert!(error.contains(said), "{error}");
    }
}

/// Conditions that hold for a short while between two places where nothing shows it.
#[test]
fn conditions_that_hold_briefly_are_met() {
    for (condition, t_end, want) in [
        // |sin(pi t)| < 1e-3: twice asin(1e-3)/pi around each whole number.
        ("sin(pi*t)^2 < 1e-6", 10.5, 21.0 * 1e-3_f64.asin() / std::f64::consts::PI),
        ("cos(40*t) > 0.999999", 3.0, {
            let half = 0.999999_f64.acos() / 40.0;
            half * (1.0 + 2.0 * (3.0 * 40.0 / (2.0 * std::f64::consts::PI)).floor())
        }),
        // Fifteen thousand turns in the run, more than are searched in one step.
        ("cos(1e4*t) > 0.999", 9.5, {
            let turn = 2.0 * std::f64::consts::PI / 1e4;
            let half = 0.999_f64.acos() / 1e4;
            half * (1.0 + 2.0 * (9.5 / turn).floor())
        }),
        ("exp(-((t - 7)/1e-3)^2) > 0.5", 10.0, 2e-3 * 2.0_f64.ln().sqrt()),
        ("1/(1 + (1e4*(t - 3.3))^2) > 0.5", 10.0, 2e-4),
    ] {
        let x = end(&format!("states = ['x']\nstart = [0]\nf = ['if({condition}, 1, 0)']"), t_end);
        near(x[0], want, 1e-9);
    }
}

/// A ball at rest stays so whatever else happens; two balls may rest at once.
#[test]
fn contacts_outlast_other_events() {
    let text = "states = ['x', 'v', 'y', 'w', 'n']\nstart = [1, 0, 2, 0, 0]\nf = ['v', '-1', 'w', \
        '-1', '0']\n\
        [[event]]\nwhen = 'x'\ndirection = 'down'\nset = { v = '-0.5*v' }\nafter_zeno = 'stick'\n\
        [[event]]\nwhen = 'y'\ndirection = 'down'\nset = { w = '-0.5*w' }\nafter_zeno = 'stick'\n\
        [[event]]\nat = [8, 12]\nset = { n = 'n + 1' }\n[[event]]\nat = 14\nset = { v = 1 }";
    let x = end(text, 15.0);
    near(x[0], 0.5, 1e-9);
    assert!(x[2].abs() < 1e-9 && x[3] == 0.0 && x[4] == 2.0, "{x:?}");
}

/// Alur & Henzinger's tanks: the inflow goes to the one that is empty, by turns that shorten
/// without end.
#[test]
fn turns_that_shorten_without_end_are_named() {
    let text = "states = ['a', 'b']\nstart = [1, 1]\n[modes.left]\nf = ['0.75 - 0.5', \
        '-0.5']\n[modes.right]\nf = ['-0.5', '0.75 - 0.5']\n\
        [[event]]\nwhen = 'b'\ndirection = 'down'\nmode = 'right'\n[[event]]\nwhen = \
        'a'\ndirection = 'down'\nmode = 'left'";
    let outcome = run(&model(text), 20.0).1.unwrap();
    // The sum falls by 1/4 a unit of time.
    let Ending::Zeno { t, error, .. } = outcome.ending else { panic!("{outcome:?}") };
    assert!((t - 8.0).abs() <= error && error < 1e-9, "{t} {error}");
}

/// An event that leaves its expression alone is passed like a section.
#[test]
fn crossings_can_be_counted() {
    let text = "states = ['x', 'v', 'n']\nstart = [0.5, 0, 0]\nf = ['v', '-x', '0']\n\
        [[event]]\nwhen = 'x'\ndirection = 'down'\nset = { n = 'n + 1' }";
    assert_eq!(end(text, 20.0)[2], 3.0);
    assert_eq!(end(&text.replace("'down'", "'up'"), 20.0)[2], 3.0);
}

/// The reset leaves the expression at zero, at rest and pressed upwards, in a mode in which the
/// event does not fire.
#[test]
fn an_event_of_the_other_mode_does_not_fire_again() {
    let text = "states = ['x', 'v']\nstart = [-1, 1]\n[modes.a]\nf = ['v', '1']\n[modes.b]\nf = \
        ['v', '1']\n\
        [[event]]\nfrom = 'a'\nwhen = 'x'\ndirection = 'up'\nmode = 'b'\nset = { v = 0 }";
    let met = 3.0_f64.sqrt() - 1.0;
    near(end(text, 3.0)[0], (3.0 - met) * (3.0 - met) / 2.0, 1e-9);
}

#[test]
fn what_an_event_makes_true_happens_at_once() {
    // A counter ends the run; two modes that send motion back to where it came from happen without
    // end.
    let text = "states = ['x', 'n']\nstart = [0, 0]\nf = ['1', '0']\n[[event]]\nevery = 1\nset = { \
        n = 'n + 1' }\n[[event]]\nname = 'three'\nwhen = 'n > 2.5'\nstop = true";
    let outcome = run(&model(text), 9.0).1.unwrap();
    assert_eq!((outcome.ending, outcome.t), (Ending::Stopped("three".into()), 3.0));
    let text = "states = ['x']\nstart = [0]\n[modes.a]\nf = ['1']\n[modes.b]\nf = \
        ['-1']\n[[event]]\nwhen = 'x > 1'\nmode = 'b'\n[[event]]\nwhen = 'x < 1'\nmode = 'a'";
    let Ending::Zeno { t, .. } = run(&model(text), 5.0).1.unwrap().ending else {
        panic!("it goes on")
    };
    near(t, 1.0, 1e-12);
    // A condition's impacts accumulate as an expression's do.
    let text = "states = ['q', 'v']\nstart = [1, 0]\nf = ['v', '-2']\n[[event]]\nwhen = 'q < \
        0'\nset = { v = '-0.5*v', q = 0 }";
    let Ending::Zeno { t, .. } = run(&model(text), 5.0).1.unwrap().ending else {
        panic!("it goes on")
    };
    near(t, 3.0, 1e-9);
    // A reset to zero within rounding is one to zero.
    let text = "states = ['x']\nstart = [0.5]\nf = ['1']\n[[event]]\nwhen = 'x - 1'\nset = { x = \
        'x - 1' }\n[[event]]\nwhen = 'x'\nset = { x = 'x + 1' }";
    near(end(text, 5.2)[0], 0.7, 1e-9);
    let mut times = Vec::new();
    let options =
        Options { t_end: 1.2, record: Record::Times { every: 0.4 }, ..Options::default() };
    follow(&model("states = ['x']\nstart = [0]\nf = ['1']"), &options, &mut |p| {
        times.push(p.t);
        true
    })
    .unwrap();
    assert_eq!(times, [0.0, 0.4, 0.8, 1.2]);
}

/// A relay's orbit through the origin: there the state itself says nothing of how large the orbit
/// is.
#[test]
fn an_orbit_closes_on_a_section_through_the_origin() {
    let relay = model(
        "states = ['x']\nstart = [0]\n[modes.up]\nf = ['1 - x']\n[modes.down]\nf = ['-1 - x']\n\
         [[event]]\nfrom = 'up'\nwhen = 'x - 0.1'\ndirection = 'up'\nmode = 'down'\n\
         [[event]]\nfrom = 'down'\nwhen = 'x + 0.1'\ndirection = 'down'\nmode = 'up'",
    );
    // Rising or falling, the first mode or the other.
    for section in ["x", "0 - x"] {
        let section = crate::motion::Record::Section(
            twofold_system::Expression::parse_general(section, &["x"]).unwrap(),
        );
        let options = Options { record: section, t_end: 50.0, ..Options::default() };
        let found = crate::motion::tangent::closed_orbit(
            &relay,
            &options,
            &crate::motion::tangent::Return::Crossings(1),
            0.0,
        );
        let period = 2.0 * (1.1_f64 / 0.9).ln();
        assert!((found.unwrap().period - period).abs() < 1e-9);
    }
}

/// One state that counts along with others: what is written to it at the end.
fn last(text: &str, t_end: f64) -> f64 {
    *end(text, t_end).last().unwrap()
}

/// An expression that leaves zero without a speed, or with one that only rounding makes, is no
/// event at once: an oscillator let go, a ball laid down, friction and a diode as automata, whose
/// modes begin where force and friction, or both voltages, are equal.
#[test]
fn events_that_are_left_without_a_speed_wait() {
    let osc = "states = ['x', 'v', 'n']\nstart = [1, 0, 0]\nf = ['v', '-x', '0']\n\
        [[event]]\nwhen = 'x - 1'\nset = { n = 'n + 1' }";
    let up = "states = ['x', 'v', 'n']\nstart = [0, 1, 0]\nf = ['v', '-x', '0']\n\
        [[event]]\nwhen = 'v - 1'\ndirection = 'up'\nset = { n = 'n + 1' }";
    let laid = |g: &str| {
        format!(
            "states = ['x', 'v', 'n']\nstart = [0, 0, 0]\nf = ['v', '-{g}', '0']\n\
             [[event]]\nwhen = 'x'\ndirection = 'down'\nset = {{ n = 'n + 1' }}\n\
             [[event]]\nevery = 1\nset = {{ x = '0', v = '0' }}"
        )
    };
    let friction = |force: &str| {
        format!(
            "states = ['v', 'x']\nstart = [0, 0]\n[let]\nF = '{force}*sin(t)'\n\
             [modes.stick]\nf = ['0', '0']\n[modes.fwd]\nf = ['F-1', 'v']\n\
             [modes.back]\nf = ['F+1', 'v']\n\
             [[event]]\nwhen = 'F > 1'\nfrom = 'stick'\nmode = 'fwd'\n\
             [[event]]\nwhen = 'F < -1'\nfrom = 'stick'\nmode = 'back'\n\
             [[event]]\nwhen = 'v'\ndirection = 'down'\nfrom = 'fwd'\nmode = 'stick'\n\
             set = {{ v = '0' }}\n\
             [[event]]\nwhen = 'v'\ndirection = 'up'\nfrom = 'back'\nmode = 'stick'\n\
             set = {{ v = '0' }}"
        )
    };
    let one = "states = ['v', 'x']\nstart = [0, 0]\nf = ['1.2*sin(t) - sign(v)', 'v']";
    let diode = "states = ['i']\nstart = [0]\n[modes.on]\nf = ['(sin(t)-i)/0.5']\n\
        [modes.off]\nf = ['0']\n\
        [[event]]\nwhen = 'i'\ndirection = 'down'\nfrom = 'on'\nmode = 'off'\nset = { i = '0' }\n\
        [[event]]\nwhen = 'sin(t)'\ndirection = 'up'\nfrom = 'off'\nmode = 'on'";
    for method in Method::ALL {
        let last = |text: &str, t_end: f64| *end_of(text, t_end, method).unwrap().last().unwrap();
        assert_eq!(last(osc, 3.0), 0.0, "{method:?}");
        assert_eq!(last(up, 3.0), 0.0, "{method:?}");
        for g in ["0.3", "1", "9.81"] {
            assert_eq!(last(&laid(g), 10.5), 0.0, "{method:?} {g}");
        }
        for force in ["1.2", "1.4", "1.05"] {
            let equation = one.replace("1.2", force);
            near(last(&friction(force), 60.3), last(&equation, 60.3), 1e-9);
        }
        // From s = 0 at 14 pi on: i' = 2 (sin s - i), i = 0.4 (2 sin s - cos s + e^(-2 s)).
        let s = 46.0 - 14.0 * std::f64::consts::PI;
        let current = 0.4 * (2.0 * s.sin() - s.cos() + (-2.0 * s).exp());
        near(last(diode, 46.0), current, 1e-9);
        let condition = diode.replace("'sin(t)'\ndirection = 'up'", "'sin(t) > 0'");
        near(last(&condition, 46.0), current, 1e-9);
    }
}

/// Both speeds of a surface that is slid upon vanish together: an ideal diode that charges a
/// capacitor through a coil, a full bridge in SI units, two queues in series. The values are those
/// of DOP853 in SciPy, mode by mode with events, to a tolerance of 1e-13.
#[test]
fn what_is_slid_upon_is_left_where_its_speeds_vanish() {
    let detector = |rate: &str| {
        format!(
            "states = ['i', 'v']\nstart = [0, 0.5]\nf = ['{rate}', 'i - v/4']\n\
             [let]\nu = 'sin(t) - v'"
        )
    };
    let bridge = "states = ['i', 'v']\nstart = [0, 0]\n\
        f = ['if(i > 0, u, max(u, 0))/L', '(i - v/R)/C']\n\
        [parameters]\nL = 10e-3\nC = 1e-3\nR = 50\n[let]\nu = 'abs(170*sin(100*pi*t)) - v'";
    let queues = |first: &str| {
        format!(
            "states = ['q', 'r']\nstart = [0, 0]\n\
             f = ['if(q > 0, a - 1, max(a - 1, 0))', 'if(r > 0, o - 0.8, max(o - 0.8, 0))']\n\
             [let]\na = '0.7 + 0.6*sin(t)'\no = '{first}'"
        )
    };
    for method in Method::ALL {
        let ends = |text: &str, t_end: f64, want: [f64; 2]| {
            let found = end_of(text, t_end, method).unwrap();
            let size = |want: f64| want.abs().max(1.0);
            found.iter().zip(want).for_each(|(v, want)| near(*v, want, 1e-9 * size(want)));
        };
        for rate in ["if(i > 0, u, max(u, 0))", "if(i > 0 or u > 0, u, 0)", "max(u, if(i>0,u,0))"] {
            ends(&detector(rate), 20.0, [0.2158309611302507, 0.40129034270926073]);
        }
        ends(bridge, 0.08, [0.0, 146.0091874850694]);
        let lengths = [0.08671241432374548, 0.16174672697403275];
        ends(&queues("min(a, 1)"), 20.0, lengths);
        // Taylor series have no mixture that changes from point to point.
        if method != Method::Taylor {
            ends(&queues("if(q > 0, 1, min(a, 1))"), 20.0, lengths);
        }
    }
}

/// A body at rest on a stop is neither above nor below it: comparisons see equality, a sign is 0,
/// from the time 3 sqrt(2), at which its impacts accumulate, on.
#[test]
fn a_body_at_rest_on_a_stop_is_on_it() {
    let ball = |restitution: &str, counted: &str| {
        format!(
            "states = ['y', 'v', 'w']\nstart = [1, 0, 0]\nf = ['v', '-1', '{counted}']\n\
             [[event]]\nwhen = 'y'\ndirection = 'down'\nset = {{ v = '-{restitution}*v' }}\n\
             after_zeno = 'stick'"
        )
    };
    for method in Method::ALL {
        for (restitution, rests) in [("0.5", 3.0 * 2.0_f64.sqrt()), ("0", 2.0_f64.sqrt())] {
            let counted =
                |by: &str| *end_of(&ball(restitution, by), 6.0, method).unwrap().last().unwrap();
            for on in ["if(y <= 0, 1, 0)", "if(not (y > 0), 1, 0)", "heaviside(-y)"] {
                near(counted(on), 6.0 - rests, 1e-11);
            }
            for above in ["if(y > 0, 1, 0)", "sign(y)"] {
                near(counted(above), rests, 1e-11);
            }
            assert_eq!(counted("if(y < 0, 1, 0)"), 0.0, "{method:?}");
        }
    }
    // Friction acts on what slides on the ground alone.
    let thrown = "states = ['y', 'v', 'x', 'u']\nstart = [1, 0, 0, 3]\n\
        f = ['v', '-1', 'u', '-0.3*sign(u)*if(y <= 0, 1, 0)']\n\
        [[event]]\nwhen = 'y'\ndirection = 'down'\nset = { v = '-0.5*v' }\n\
        after_zeno = 'stick'";
    let left = 6.0 - 3.0 * 2.0_f64.sqrt();
    let found = end(thrown, 6.0);
    near(found[3], 3.0 - 0.3 * left, 1e-11);
    near(found[2], 18.0 - 0.15 * left * left, 1e-10);
}

/// While the motion slides somewhere, what is equal is equal: flags, counters, whole parts; and so
/// is what a root leaves at zero.
#[test]
fn equality_holds_beside_sliding() {
    let beside = |condition: &str| {
        format!(
            "states = ['x', 'n', 'y', 'w']\nstart = [1, 1, 3.5, 0]\n\
             f = ['-sign(x)', '0', '0', 'if({condition}, 1, 0)']"
        )
    };
    let ends = beside("n >= 1").replace("-sign(x)", "-sign(x) + t/4");
    let counter = "states = ['x', 'u', 'n']\nstart = [1, 0, 0]\n\
        f = ['-sign(x)', 'if(n >= 2, 1, -0.1)', '0']\n\
        [[event]]\nevery = 1\nset = { n = 'n + 1' }";
    let tank = "states = ['h', 'w']\nstart = [1, 0]\nf = ['-sqrt(h)', 'if(h <= 0, 1, 0)']";
    for method in Method::ALL {
        let last = |text: &str| *end_of(text, 5.0, method).unwrap().last().unwrap();
        for holds in ["n >= 1", "n <= 1", "floor(y) >= 3", "clip(y, -1, 2) >= 2", "sign(y) >= 1"] {
            near(last(&beside(holds)), 5.0, 1e-9);
        }
        for fails in ["n > 1", "n < 1", "floor(y) > 3", "mod(n, 2) < 1"] {
            near(last(&beside(fails)), 0.0, 1e-9);
        }
        near(last(&ends), 5.0, 1e-9);
        near(end_of(counter, 5.5, method).unwrap()[1], 3.3, 1e-9);
        // It runs empty at t = 2. The root of zero has no Taylor series.
        if method != Method::Taylor {
            near(last(tank), 3.0, 1e-6);
        }
    }
}

/// Functions with one zero have sides that belong together: what no side decides does not rest.
#[test]
fn functions_with_one_zero_are_no_two_surfaces() {
    let text = "states = ['x', 'y']\nstart = [0, -0.76]\n\
        f = ['sign(y*(1 + x^2))', '0.2 - sign(y)']";
    let found = run(&model(text), 3.0).1;
    assert!(matches!(found, Err(HybridError::Undecided { .. })), "{found:?}");
}

/// A block on a stop that friction holds, too, does not fall through when friction gives way;
/// speeds that turn between impacts, and events that note the turns, accumulate with the impacts.
#[test]
fn stops_hold_beside_friction_and_other_events() {
    let block = |restitution: &str, force: &str| {
        format!(
            "states = ['x', 'v']\nstart = [0, 0]\nf = ['v', '-0.5 + 0.5*{force} - 0.3*sign(v)']\n\
             [[event]]\nwhen = 'x'\ndirection = 'down'\nset = {{ v = '-{restitution}*v' }}\n\
             after_zeno = 'stick'"
        )
    };
    let ball = |states: &str, start: &str, rest: &str| {
        format!(
            "states = {states}\nstart = {start}\n{rest}\n[[event]]\nname = 'floor'\n\
             when = 'x'\ndirection = 'down'\nset = {{ v = '-0.5*v' }}\nafter_zeno = 'stick'"
        )
    };
    let dragged = "f = ['v', '-1 - 0.3*sign(v)']";
    let way = "f = ['v', '-1', 'abs(v)']";
    let apex = "f = ['v', '-1', '0']\n[[event]]\nwhen = 'v'\ndirection = 'down'\nset = { n = 'x' }";
    let counted = "f = ['v', '-1', '0']\n[[event]]\nwhen = 'x'\ndirection = 'down'\n\
        set = { n = 'n + 1' }";
    for method in Method::ALL {
        for restitution in ["0", "0.3", "0.5"] {
            for force in ["sin(0.3*t)", "sin(t)", "sin(1.7*t)", "sin(3*t)"] {
                let end = end_of(&block(restitution, force), 12.0, method).unwrap();
                assert_eq!(end, [0.0, 0.0], "{method:?} {restitution} {force}");
            }
        }
        for (states, rest) in
            [("['x', 'v']", dragged), ("['x', 'v', 'n']", way), ("['x', 'v', 'n']", apex)]
        {
            for start in ["0.2, 0.1", "1, 0", "0.5, 1", "1, 2"] {
                let start = if states.contains('n') {
                    format!("[{start}, 0]")
                } else {
                    format!("[{start}]")
                };
                let text = ball(states, &start, rest);
                let end = end_of(&text, 12.0, method).unwrap();
                assert!(end[0].abs() < 1e-11 && end[1] == 0.0, "{method:?} {text} {end:?}");
            }
        }
        // Before and after the floor's event in the file.
        let first = ball("['x', 'v', 'n']", "[1, 0, 0]", counted);
        let n = *end_of(&first, 12.0, method).unwrap().last().unwrap();
        assert!(n > 20.0 && end_of(&first, 12.0, method).unwrap()[1] == 0.0, "{method:?} {n}");
    }
}

/// A blow on one body leaves another one that a spring joins to it at rest on its stop, whatever
/// rounding its speed has there; both come to rest.
#[test]
fn bodies_that_a_spring_joins_rest_on_their_stops() {
    let text = "states = ['x', 'v', 'y', 'w']\nstart = [0.15, 0.95, 0, 0.68]\n\
        f = ['v', '-1', 'w', '-1 + 0.31*(x - y)']\n\
        [[event]]\nwhen = 'x + 0.53'\ndirection = 'down'\nset = { v = '-0.7*v' }\n\
        after_zeno = 'stick'\n\
        [[event]]\nwhen = 'y + 0.29'\ndirection = 'down'\nset = { w = '-0.7*w' }\n\
        after_zeno = 'stick'";
    for method in Method::ALL {
        let end = end_of(text, 12.3, method).unwrap();
        for (found, want) in end.iter().zip([-0.53, 0.0, -0.29, 0.0]) {
            near(*found, want, 1e-11);
        }
    }
}

/// Bodies that lie on their stops at the start, on each other, or that an event, a mode or a switch
/// lays or presses there, stay.
#[test]
fn bodies_lie_on_their_stops_however_they_came_there() {
    let stop = |when: &str, set: &str| {
        format!(
            "[[event]]\nwhen = '{when}'\ndirection = 'down'\nset = {{ {set} }}\n\
             after_zeno = 'stick'\n"
        )
    };
    let apart = format!(
        "states = ['x', 'v', 'y', 'w']\nstart = [0, 0, 0, 0]\nf = ['v', '-1', 'w', '-1']\n{}{}",
        stop("x", "v = '-0.5*v'"),
        stop("y", "w = '-0.5*w'")
    );
    let piled = apart.replace("when = 'y'", "when = 'y - x'");
    let ball = |start: &str, force: &str, more: &str| {
        format!(
            "states = ['x', 'v']\nstart = [{start}]\nf = ['v', '{force}']\n{}{more}",
            stop("x", "v = '-0.5*v'")
        )
    };
    let laid = ball("1, 0", "-1", "[[event]]\nat = 1\nset = { x = 0, v = 0 }");
    let grows = ball("0, 0", "-sin(t)^3 - 0.2*t", "");
    let pressed = ball("0, 0", "if(t < 1, 0, -1)", "");
    let let_go = format!(
        "states = ['x', 'v']\nstart = [0, 0]\n[modes.held]\nf = ['v', '0']\n[modes.free]\n\
         f = ['v', '-1']\n{}[[event]]\nat = 1\nfrom = 'held'\nmode = 'free'",
        stop("x", "v = '-0.5*v'")
    );
    for method in Method::ALL {
        for text in [&apart, &piled, &laid, &grows, &pressed, &let_go] {
            let end = end_of(text, 3.0, method).unwrap();
            assert!(end.iter().all(|v| *v == 0.0), "{method:?} {text} {end:?}");
        }
    }
}

/// A clock strikes at the moment at which a pulse takes the surface away that is slid upon.
#[test]
fn a_pulse_and_a_clock_meet_on_a_surface() {
    for every in ["1", "0.8", "0.5", "0.2"] {
        let text = format!(
            "states = ['x', 'k']\nstart = [0.5, 0]\n\
             f = ['if(x < 0.81 or mod(t, 1) < 0.2, 1, -0.5)', '0']\n\
             [[event]]\nevery = {every}\nset = {{ k = 'k + 1' }}"
        );
        for method in Method::ALL {
            // 0.31 to the surface, a pulse of 0.2 a period up to 1.01, down at half the speed.
            near(end_of(&text, 4.5, method).unwrap()[0], 0.86, 1e-12);
        }
    }
}

/// Beyond a level that is reached the field is zero on it.
#[test]
fn a_level_on_which_the_field_vanishes_is_stayed_on() {
    for method in Method::ALL {
        for start in ["-1.7", "-0.1", "-2.3", "-0.9", "-1.3"] {
            let text = format!("states = ['y']\nstart = [{start}]\nf = ['-y - floor(y)']");
            near(end_of(&text, 5.0, method).unwrap()[0], 0.0, 1e-15);
        }
    }
}

/// The bound on the time at which impacts accumulate holds the integration's errors, too: a spring
/// that presses a ball down, v' = -1 - x, whose flights take 2 atan v.
#[test]
fn bounds_of_accumulation_hold_the_errors_of_integration() {
    let text = "states = ['x', 'v']\nstart = [1, 0]\nf = ['v', '-1 - x']\n[[event]]\nname = 'b'\n\
        when = 'x'\ndirection = 'down'\nset = { v = '-0.9*v' }";
    // mpmath, to 40 digits: acos(1/2) + sum of 2 atan(sqrt(3) 0.9^k).
    let right = 26.981973586211045;
    for method in Method::ALL {
        for rtol in [1e-6, 1e-8, 1e-10, 1e-13] {
            let options = Options { t_end: 60.0, method, rtol, ..Options::default() };
            let found = follow(&model(text), &options, &mut |_| true).unwrap();
            let Ending::Zeno { t, error, .. } = found.ending else { panic!("{found:?}") };
            assert!((t - right).abs() <= error, "{method:?} {rtol:e}: {t} {error:e}");
            assert!(error <= 1e4 * rtol, "{method:?} {rtol:e}: {error:e}");
        }
    }
}

/// A condition becomes true, or ceases to be, at the very moment at which a clock strikes: both
/// happen, in the file's order, whatever rounding says. One that is only touched there does not.
#[test]
fn conditions_and_clocks_meet() {
    let true_then = "states = ['x', 'v', 'n']\nstart = [1, -1, 0]\nf = ['v', '2', '0']\n\
        [[event]]\nwhen = 'x > 1'\nset = { n = 'n + 1' }\n\
        [[event]]\nevery = 1\nset = { n = 'n + 1', x = '1 - x' }";
    let false_then = "states = ['x', 'v', 'n']\nstart = [0, -1, 0]\nf = ['v', '2', '0']\n\
        [[event]]\nevery = 1\nset = { n = 'n + 1', v = '-0.5*v' }\n\
        [[event]]\nwhen = 'x < 0'\nset = { n = 'n + 1', v = '-v' }";
    let touched = "states = ['x', 'v', 'n']\nstart = [0, -1, 0]\nf = ['v', 'sin(pi*t)', '0']\n\
        [[event]]\nwhen = 'v < -1'\nset = { n = 'n + 1' }\n\
        [[event]]\nevery = 2\nset = { x = '0' }";
    for method in Method::ALL {
        let last = |text: &str, t_end: f64| *end_of(text, t_end, method).unwrap().last().unwrap();
        // x = 1 - t + t^2 is 1 at t = 1.
        assert_eq!(last(true_then, 1.5), 2.0, "{method:?}");
        // x = t^2 - t is 0 at t = 1, where v = 1 becomes -1/2: x falls at once.
        assert_eq!(last(false_then, 1.2), 2.0, "{method:?}");
        // The errors of the others are larger than their rounding.
        if matches!(method, Method::Dopri5 | Method::Radau5) {
            assert_eq!(last(touched, 9.0), 0.0, "{method:?}");
        }
    }
}

/// A clip meets its end while the motion slides on a level of a curved step, or on a surface that
/// turns: methods with other steps agree on where they come to.
#[test]
fn sliding_goes_on_behind_a_switch_of_something_else() {
    let level = "states = ['x', 'y']\nstart = [1.1, 0.15]\n\
        f = ['0.5*cos(3*t) - 0.7*floor(2*(x^2+y^2-1)) - x', \
             '-x - 1.5*clip(5*(y-0.5*cos(2*t)),-1,1) - 0.2*x*y']";
    let turning = "states = ['x', 'y']\nstart = [-0.8, -0.6]\n\
        f = ['-y + 1.5*clip(5*(x+y-sin(3*t)),-1,1) + 1', \
             '-0.4 - 2*sign(y+x*sin(t)) + 0.5*cos(3*t)']";
    for method in Method::ALL {
        for (text, want) in
            [(level, [0.60245048133, -0.55249675990]), (turning, [-4.07864258807, 2.37751067623])]
        {
            let found = end_of(text, 8.0, method).unwrap();
            near(found[0], want[0], 1e-8);
            near(found[1], want[1], 1e-8);
        }
    }
}

/// No motion slides where the fields have no value.
#[test]
fn nothing_slides_outside_of_a_domain() {
    for f in ["-sign(x) + ln(x - 0.1)", "sign(x) + sqrt(x - 0.1)"] {
        let text = format!("states = ['x']\nstart = [0]\nf = ['{f}']");
        for method in Method::ALL {
            let error = end_of(&text, 3.0, method).unwrap_err();
            assert!(error.contains("leaves the domain"), "{error}");
        }
    }
}

/// Sliding on a moving surface ends where it moves faster than both fields, to second order: at
/// cos t = -a on x = sin t, for x' = -a sign(x - sin t).
#[test]
fn sliding_leaves_a_moving_surface() {
    for method in Method::ALL {
        for (a, rtol) in
            [(0.5, 1e-9), (0.5, 1e-10), (0.5, 1e-12), (0.6, 1e-10), (0.7, 1e-10), (0.9, 1e-10)]
        {
            let text = format!("states = ['x']\nstart = [0]\nf = ['-{a}*sign(x - sin(t))']");
            let options = Options { t_end: 2.8, rtol, method, ..Options::default() };
            let outcome = follow(&model(&text), &options, &mut |_| true).unwrap();
            let leaves = f64::acos(-a);
            near(outcome.x[0], leaves.sin() - a * (2.8 - leaves), 1e-7);
        }
    }
}

/// Dips of a smooth function that are far narrower than a step: pulses, events, sliding between two
/// surfaces.
#[test]
fn narrow_dips_are_not_stepped_over() {
    for w in [1e-3, 1e-4, 1e-5] {
        let pulse = format!(
            "states = ['x', 'y']\nstart = [0, 0]\nf = ['1', 'if((x - pi)^2 < {w:e}^2, 1/{w:e}, 0)']"
        );
        near(last(&pulse, 10.0), 2.0, 1e-7);
        let event = format!(
            "states = ['x', 'n']\nstart = [0, 0]\nf = ['1', '0']\n[[event]]\nwhen = '((x - \
                1)/{w:e})^2 - 1'\nset = {{ n = 'n + 1' }}"
        );
        near(last(&event, 2.0), 2.0, 0.0);
    }
    let times = "states = ['n']\nstart = [0]\nf = ['0']\n[[event]]\nwhen = 'cos(t) - (1 - \
        1e-8)'\nset = { n = 'n + 1' }";
    near(last(times, 20.0), 7.0, 0.0);
    let between = "states = ['x']\nstart = [1]\nf = ['0.25 - sign(x^2 - 1e-8)']";
    near(last(between, 3.0), 1e-4, 1e-12);
    // As wide as a hundred million digits of the time.
    near(
        last("states = ['x']\nstart = [0]\nf = ['if(abs(t - pi) < 1e-9, 1e9, 0)']", 10.0),
        2.0,
        1e-6,
    );
}

#[test]
fn a_division_by_zero_is_not_crossed() {
    let ends = |text: &str, t_end: f64, t: f64, place: &str| match run(&model(text), t_end).1 {
        Err(HybridError::Domain { t: at, what, .. }) => {
            near(at, t, 1e-8);
            assert!(
                what.contains("a division by a number that comes to zero") && what.contains(place),
                "{what}"
            );
        }
        other => panic!("{other:?}\n{text}"),
    };
    // Free fall onto a centre; a quotient that a cube root would carry through; a pole of the
    // tangent.
    let fall = std::f64::consts::PI / 8.0_f64.sqrt();
    ends(
        "states = ['x', 'v']\nstart = [1, 0]\nf = ['v', '-1/x^2']",
        1.2,
        fall,
        "equation of v, `-1/x^2`",
    );
    ends("states = ['x']\nstart = [2]\nf = ['-1/x^2']", 2.8, 8.0 / 3.0, "`-1/x^2`");
    ends("states = ['x']\nstart = [1]\nf = ['-1/x']", 3.0, 0.5, "`-1/x`");
    ends("states = ['x']\nstart = [1]\nf = ['tan(x)']", 0.3, -1.0_f64.sin().ln(), "`tan(x)`");
    // A quotient that is continued through zero is followed.
    near(
        end("states = ['x', 'y']\nstart = [-1, 0]\nf = ['1', 'sin(x)/x']", 2.0)[1],
        2.0 * 0.946_083_070_367_183,
        1e-9,
    );
}

/// An odd root comes to rest at zero: x = (1 - 2 t/3)^1.5.
#[test]
fn an_odd_root_comes_to_rest() {
    let root = "states = ['x']\nstart = [1]\nf = ['-sign(x)*abs(x)^(1/3)']";
    near(last(root, 1.2), 0.2_f64.powf(1.5), 1e-9);
    near(last(root, 3.0), 0.0, 1e-15);
}

/// Floors anywhere, at rest and moving: impacts accumulate, and motion rests on the floor.
#[test]
fn a_ball_rests_on_any_floor() {
    for floor in [-0.7, 0.3, 1.555112, -3.082559, 1e6] {
        let text = format!(
            "states = ['x', 'v']\nstart = ['{floor} + 1', 0]\nf = ['v', '-1']\n[[event]]\nwhen = \
                'x - ({floor})'\ndirection = 'down'\nset = {{ v = '-0.5*v' }}\nafter_zeno = 'stick'"
        );
        let x = end(&text, 10.0);
        near(x[0], floor, 4.0 * f64::EPSILON * floor.abs());
        near(x[1], 0.0, 0.0);
    }
    for speed in [0.1, 0.5, -0.3, 3.0] {
        let text = format!(
            "states = ['x', 'v']\nstart = [1, 0]\nf = ['v', '-1']\n[[event]]\nwhen = 'x - \
                {speed}*t'\ndirection = 'down'\nset = {{ v = '{speed} - 0.5*(v - {speed})' \
                }}\nafter_zeno = 'stick'"
        );
        let x = end(&text, 12.0);
        near(x[0], 12.0 * speed, 1e-10);
        near(x[1], speed, 1e-12);
        // The time at which infinitely many impacts are over, within its bound.
        let stops = text.replace("\nafter_zeno = 'stick'", "");
        let Ending::Zeno { t, error, .. } = run(&model(&stops), 12.0).1.unwrap().ending else {
            panic!("no accumulation")
        };
        let root = (speed * speed + 2.0).sqrt();
        near(t, root - speed + 2.0 * root, error + 1e-8);
        assert!(error < 1e-6);
    }
}

/// Kinks that a motion comes to like exp(-t), or lies on, decide nothing. x = sin t + exp(-g t) has
/// the integral 1/g of |x - sin t|; a rate limiter that has caught up; two agents in consensus.
#[test]
fn kinks_need_no_decision() {
    let all = [Method::Dopri5, Method::Radau5, Method::Lsoda, Method::Taylor];
    for gain in [1.0, 2.0, 5.0, 20.0] {
        let text = format!(
            "states = ['x', 'J']\nstart = [1, 0]\nf = ['cos(t) - {gain}*(x - sin(t))', 'abs(x - \
                sin(t))']"
        );
        for method in all {
            let x = end_of(&text, 60.0, method).unwrap();
            near(x[0], 60.0_f64.sin(), 1e-8);
            near(x[1], 1.0 / gain, 1e-8);
        }
    }
    let limiter = "states = ['x', 'r']\nstart = [0, 0]\nf = ['clip(5*(r - x), -0.2, 0.2)', \
        '0.2*(1 - 0.5*exp(-t))']";
    let agents = "states = ['a', 'b', 'c']\nstart = [0.3, 2, 0]\nf = ['1 + b - a', '1 + a - b', \
        'max(a - b, 0) + max(b - a, 0)']";
    for method in all {
        near(end_of(limiter, 30.0, method).unwrap()[0], 5.86, 1e-7);
        near(end_of(agents, 60.0, method).unwrap()[2], 0.85, 1e-7);
    }
}

/// A quotient by what it is zero with makes a jump of a kink, upon which the motion slides.
#[test]
fn kinks_over_a_zero_are_jumps() {
    for rate in ["-abs(x)/x", "-abs(x)*x^(-1)", "-max(x, -x)/x", "-abs(x)*r", "-r*max(x, -x)"] {
        let text =
            format!("states = ['x', 'y']\nstart = [1, 0]\nf = ['{rate}', '0.5']\n[let]\nr = '1/x'");
        let x = end(&text, 3.0);
        near(x[0], 0.0, 1e-12);
        near(x[1], 1.5, 1e-12);
    }
}

/// A stiff contact between bodies that are far from the origin: the gap of 1e-8 is no rounding, for
/// the force in it is not. Two equal bodies exchange their speeds.
#[test]
fn small_gaps_of_stiff_contacts_count() {
    for method in Method::ALL {
        for (k, speed) in [(1e8, 1e-3), (1e10, 1e-3), (1e10, 1e-2)] {
            let text = format!(
                "states = ['a', 'b', 'u', 'v']\nstart = [1, 1, {speed}, 0]\nf = ['u', 'v', \
                    '-{k:e}*max(a - b, 0)', '{k:e}*max(a - b, 0)']"
            );
            let options = Options { method, t_end: 1.0, ..Options::default() };
            let x = follow(&model(&text), &options, &mut |_| true).unwrap().x;
            near(x[2] / speed, 0.0, 1e-6);
            near(x[3] / speed, 1.0, 1e-6);
        }
    }
}

/// A layer in which a force is proportional, written with `clip`: SciPy's DOP853 at 1e-13.
#[test]
fn a_layer_of_a_switch_is_followed() {
    let text = "states = ['x', 'v']\nstart = [2, 0.5]\nf = ['v', 'u']\n[let]\ns = 'x + \
        v*abs(v)/2'\nu = '-clip(s/0.02, -1, 1)'";
    for method in [Method::Dopri5, Method::Radau5, Method::Lsoda, Method::Taylor] {
        let x = end_of(text, 8.0, method).unwrap();
        near(x[0], -0.0019349682, 1e-9);
        near(x[1], 0.012_128_744, 1e-9);
    }
}

/// A ball on a spring after Hertz, F = k max(-x, 0)^1.5, keeps its energy: at the end v^2/2 + x and
/// the energy of the spring are what they were. So with other powers, and written with `if`.
#[test]
fn powers_of_what_is_cut_at_zero_are_followed() {
    for (force, power) in [
        ("max(-x, 0)^1.5", 1.5),
        ("max(-x, 0)^2.5", 2.5),
        ("if(x < 0, (-x)^1.5, 0)", 1.5),
        ("sqrt(max(-x, 0))", 0.5),
    ] {
        for (x, v) in [(0.44, 0.54), (0.3, -1.0), (1.0, 0.0), (0.07, 0.2)] {
            let energy = |x: f64, v: f64| {
                0.5 * v * v + x + 50.0 / (power + 1.0) * (-x).max(0.0).powf(power + 1.0)
            };
            let text =
                format!("states = ['x', 'v']\nstart = [{x}, {v}]\nf = ['v', '-1 + 50*{force}']");
            for method in [Method::Dopri5, Method::Radau5, Method::Lsoda] {
                let found = end_of(&text, 10.0, method).unwrap_or_else(|e| panic!("{text} {e}"));
                near(energy(found[0], found[1]), energy(x, v), 1e-7);
            }
        }
    }
}

/// An event is of the mode that those before it at its moment leave; what is met, also of that in
/// which it was.
#[test]
fn simultaneous_events_see_the_mode_that_the_others_leave() {
    let fault = "states = ['T']\nstart = [0]\n[modes.on]\nf = ['1']\n[modes.off]\nf = \
        ['-1']\n[modes.fault]\nf = ['0']\n[[event]]\nat = 2\nfrom = 'on'\nmode = \
        'fault'\n[[event]]\nwhen = 'T >= 2'\nfrom = 'on'\nmode = 'off'";
    near(last(fault, 5.0), 2.0, 1e-12);
    let clocks = |first: &str, second: &str| {
        format!(
            "states = ['y']\nstart = [0]\n[modes.a]\nf = ['0']\n[modes.b]\nf = ['0']\n[[event]]\n\
                every = 1\nfrom = 'a'\nmode = 'b'\n[[event]]\nevery = 1\nfrom = '{first}'\nset \
                = {{ y = 'y + 1' }}\n[[event]]\nat = 0.5\nmode = '{second}'"
        )
    };
    assert_eq!(last(&clocks("a", "a"), 1.5), 0.0);
    assert_eq!(last(&clocks("b", "a"), 1.5), 1.0);
}

/// Relays that all act on each other: x_i' = q_i - u_i - S/10 with u_i = sign(x_i) and S their sum.
/// From zero on u_i = q_i - S/10, cut at -1 and 1, and S is the only number that fits; those that
/// are cut leave. From elsewhere each comes to zero by itself, the last ones beside many others.
#[test]
fn many_surfaces_that_act_on_each_other_meet() {
    for k in [7, 12, 24] {
        let q: Vec<f64> = (0..k).map(|i| 1.3 * (1.7 * i as f64 + 1.5).sin()).collect();
        let shares = |s: f64| q.iter().map(move |q| (q - 0.1 * s).clamp(-1.0, 1.0));
        let (mut low, mut high) = (-(k as f64), k as f64);
        for _ in 0..100 {
            let middle = 0.5 * (low + high);
            if shares(middle).sum::<f64>() > middle {
                low = middle;
            } else {
                high = middle;
            }
        }
        let names: Vec<String> = (0..k).map(|i| format!("'x{i}'")).collect();
        let signs: Vec<String> = (0..k).map(|i| format!("sign(x{i})")).collect();
        let rate = |(i, q): (usize, &f64)| format!("'{q} - sign(x{i}) - 0.1*s'");
        let rates: Vec<String> = q.iter().enumerate().map(rate).collect();
        let text = |start: f64| {
            format!(
                "states = [{}]\nstart = [{}]\nf = [{}]\n[let]\ns = '{}'",
                names.join(", "),
                vec![start.to_string(); k].join(", "),
                rates.join(", "),
                signs.join(" + ")
            )
        };
        let still = end(&text(0.0), 2.0);
        for ((x, q), u) in still.iter().zip(&q).zip(shares(low)) {
            near(*x, 2.0 * (q - u - 0.1 * low), 1e-9);
        }
        let later = [9.0, 10.0].map(|t| end(&text(0.1), t));
        for (i, (q, u)) in q.iter().zip(shares(low)).enumerate() {
            near(later[1][i] - later[0][i], q - u - 0.1 * low, 1e-9);
        }
    }
    // Sums that do not attract, and products, are refused as before.
    let names: Vec<String> = (0..7).map(|i| format!("'x{i}'")).collect();
    for rate in [
        "-sign(x0) + 0.5*s",
        "-sign(x0) - 0.1*s*s",
        "-sign(x0) - 0.1*s + 0.1*(sign(x1)*sign(x2) - sign(x3)*sign(x4))",
    ] {
        let rates: Vec<String> =
            (0..7).map(|i| format!("'{}'", rate.replace("x0", &format!("x{i}")))).collect();
        let signs: Vec<String> = (0..7).map(|i| format!("sign(x{i})")).collect();
        let text = format!(
            "states = [{}]\nstart = [0, 0, 0, 0, 0, 0, 0]\nf = [{}]\n[let]\ns = '{}'",
            names.join(", "),
            rates.join(", "),
            signs.join(" + ")
        );
        assert!(matches!(run(&model(&text), 1.0).1, Err(HybridError::Stuck { .. })), "{rate}");
    }
}

/// A root of |sin t|, whose domain ends on either side of each zero of the sine, which lies between
/// two numbers. SciPy's `quad` of sqrt|sin t| exp(t - 7.5).
#[test]
fn roots_of_what_touches_zero_in_time_go_on() {
    let text = "states = ['x']\nstart = [0]\nf = ['sqrt(abs(sin(t))) - x']";
    for method in [Method::Dopri5, Method::Radau5, Method::Lsoda] {
        near(end_of(text, 7.5, method).unwrap()[0], 0.7456573769830949, 1e-8);
    }
}

/// A condition that a reset makes false again is met anew where it becomes true, and so is another
/// event of the same zero.
#[test]
fn conditions_are_met_again_after_resets() {
    let saw = |rate: f64, start: f64| {
        format!(
            "states = ['x']\nstart = [{start}]\nf = ['{rate}']\n[[event]]\nwhen = 'x > 1'\nset = \
                {{ x = '0' }}"
        )
    };
    for (rate, start) in [(1.0, 0.3), (2.0, 0.3), (0.7, 0.0), (3.0, 0.5)] {
        let passed: f64 = start + 9.6 * rate;
        near(last(&saw(rate, start), 9.6), passed - passed.floor(), 1e-12);
    }
    let twins = "states = ['x', 'n', 'm']\nstart = [0, 0, 0]\nf = ['1', '0', '0']\n[[event]]\nwhen \
        = 'x > 1'\nset = { x = 'x - 2', m = 'm + 1' }\n[[event]]\nwhen = 'x - 1'\nset = { n = 'n + \
        1' }";
    assert_eq!(end(twins, 60.5)[1..], [30.0, 30.0]);
    // The surface of a switch stays where it is.
    let slides = "states = ['q', 'n']\nstart = [0, 0]\nf = ['if(q < 1, 1, -1)', \
        '1']\n[[event]]\nwhen = 'n > 2'\nset = { q = 'q + 1', n = '0' }";
    near(end(slides, 10.5)[0], 1.5, 1e-12);
}

/// A section is crossed where its expression comes to zero or jumps over it; while it stays at zero
/// it is not, and where it leaves to the side that it came from it is crossed back.
#[test]
fn a_section_that_is_slid_upon_is_crossed_once_each_way() {
    let quadratic = |p: f64, q: f64| -p / 2.0 + (p * p / 4.0 - q).sqrt();
    // 1 - 1.5 t + t^2/4 = 0 and 1.5 t + t^2/4 = 1: sliding from there until t = 3.
    let (from_above, from_below) = (3.0 - 5.0_f64.sqrt(), quadratic(6.0, -4.0));
    for (f, start, section, want) in [
        ("-sign(x)", 1.0, "x", vec![(1.0, -1.0)]),
        ("-1.5*sign(x) + 0.5*t", 1.0, "x", vec![(from_above, -1.0), (3.0, 1.0)]),
        ("-1.5*sign(x) + 0.5*t", 1.0, "-2*x*(1 + t)", vec![(from_above, 1.0), (3.0, -1.0)]),
        ("-1.5*sign(x) + 0.5*t", -1.0, "x", vec![(from_below, 1.0)]),
        ("1", 0.0, "floor(x) - 2", vec![(2.0, 1.0)]),
        ("-1", 5.5, "floor(x) - 2", vec![(2.5, -1.0)]),
        ("1", 0.0, "sign(x - 2)", vec![(2.0, 1.0)]),
        ("1", 0.0, "(x - 3)*sign(x - 1)", vec![(1.0, -1.0), (3.0, 1.0)]),
        ("-1", 2.0, "max(x, 1) - 1", vec![(1.0, -1.0)]),
    ] {
        for method in Method::ALL {
            let text = format!("states = ['x']\nstart = [{start}]\nf = ['{f}']");
            let record = twofold_system::Expression::parse_general(section, &["x"]).unwrap();
            let options = Options {
                t_end: 5.0,
                method,
                record: Record::Section(record),
                ..Options::default()
            };
            let mut rows = Vec::new();
            follow(&model(&text), &options, &mut |p| {
                rows.push((p.t, p.direction.unwrap()));
                true
            })
            .unwrap();
            let fits = rows.len() == want.len()
                && rows.iter().zip(&want).all(|(a, b)| (a.0 - b.0).abs() < 1e-9 && a.1 == b.1);
            assert!(fits, "{method:?} {section} {rows:?} {want:?} {text}");
        }
    }
}

/// Terms that name the term before twice are evaluated once each: 2^40 times would not end.
#[test]
fn nested_terms_take_no_exponential_time() {
    let nested = |first: &str, next: &dyn Fn(usize) -> String, rest: &str| {
        let terms: String = (0..40).map(|i| format!("a{} = '{}'\n", i + 1, next(i))).collect();
        format!("states = ['x']\nstart = [1.1]\n{rest}\n[let]\na0 = '{first}'\n{terms}")
    };
    // sign(a - 1) + abs(a) = 1 + a for a > 1.
    let numbers = nested("x", &|i| format!("sign(a{i} - 1) + abs(a{i})"), "f = ['a40']");
    near(last(&numbers, 1.0), 41.1 * 1.0_f64.exp() - 40.0, 1e-8);
    // The pieces of a reset, too, which closed orbits ask.
    let reset = nested(
        "x",
        &|i| format!("sign(a{i} - 1) + abs(a{i})"),
        "f = ['0']\n[[event]]\nevery = 1\nset = { x = 'x - a40/8 + 5.1375' }",
    );
    let options = Options { record: Record::Times { every: 1.0 }, ..Options::default() };
    let orbit = tangent::closed_orbit(&model(&reset), &options, &tangent::Return::Period(1.0), 0.0);
    near(orbit.unwrap().multipliers[0][0], 0.875, 1e-12);
    let events = "f = ['if(a40, 1, 2)']\n[[event]]\nwhen = 'a40 and x > 2'\nset = { x = 0.5 }";
    near(last(&nested("x > 0", &|i| format!("a{i} and a{i}"), events), 1.0), 0.6, 1e-12);
}

/// Conditions at equality: a counter is at least 5 when it is 5, and not above.
#[test]
fn counters_are_compared_as_they_are_written() {
    let count = |condition: &str| {
        let text = format!(
            "states = ['q', 'n']\nstart = [0, 0]\nf = ['1', '0']\n[[event]]\nwhen = 'q > 1 and \
                {condition}'\nset = {{ q = 'q - 1', n = 'n + 1' }}"
        );
        last(&text, 20.5)
    };
    for (condition, most) in
        [("n < 5", 5.0), ("n <= 5", 6.0), ("not n >= 5", 5.0), ("5 > n", 5.0), ("not n > 5", 6.0)]
    {
        near(count(condition), most, 0.0);
    }
    near(
        last("states = ['n', 'y']\nstart = [5, 0]\nf = ['0', 'if(n >= 5, 1, 0)']", 1.0),
        1.0,
        1e-15,
    );
    near(last("states = ['n', 'y']\nstart = [5, 0]\nf = ['0', 'if(n > 5, 1, 0)']", 1.0), 0.0, 0.0);
}

/// One surface however it is written: 1.75 is 4/3 + 0.25*5/3, with the mean sign 0.25 of the
/// sliding.
#[test]
fn one_surface_is_one_switching_function() {
    let y = |switch: &str| {
        format!(
            "states = ['x', 'y', 'z']\nstart = [1, 0, 1]\nf = ['0.25 - sign(x)', '{switch}', '1']"
        )
    };
    for switch in [
        "sign(x)",
        "sign(2*x)",
        "sign(x^3)",
        "-sign(-x/3)",
        "if(3*x > 0, 1, -1)",
        "sign(tanh(x))",
        "sign(x*abs(x))",
        "2*heaviside(5*x) - 1",
    ] {
        near(end(&y(switch), 3.0)[1], 1.75, 1e-12);
    }
    let moving =
        "states = ['x', 'y']\nstart = [1, 0]\nf = ['0.25 - sign(x - 0.1*t)', 'sign(10*x - t)']";
    near(end(moving, 3.0)[0], 0.3, 1e-12);
    // Near to each other is not the same, in any units; and what only vanishes there is refused.
    let far = "states = ['x', 'y']\nstart = [-0.999995e12, 0]\nf = ['0', 'sign(1e-12*x + 1) + \
        sign(1.00001e-12*x + 1)']";
    near(last(far, 1.0), 0.0, 0.0);
    near(end(&y("sign(x + 1e-9)"), 3.0)[1], 3.0, 1e-8);
    for switch in ["sign(x*z)", "sign(x + abs(x)/2)"] {
        let error = run(&model(&y(switch)), 3.0).1.unwrap_err();
        assert!(matches!(error, HybridError::Undecided { .. }), "{switch}: {error}");
    }
}

/// Dry friction at rest, a late start at zero, and a table that jumps inside a switching function.
#[test]
fn rounding_is_no_motion() {
    // It holds until sin t = 0.2, and turns where the speed is zero.
    let friction = "states = ['x']\nstart = [0]\nf = ['sin(t) - 0.2*sign(x)']";
    let hold = 0.2_f64.asin();
    near(last(friction, 3.0), hold.cos() - 3.0_f64.cos() - 0.2 * (3.0 - hold), 1e-9);
    for t in [1e3, 1e5] {
        let options = Options { t_start: t, t_end: t + 3.0, ..Options::default() };
        let late = follow(
            &model(&format!("states = ['x']\nstart = [0]\nf = ['t - {t}']")),
            &options,
            &mut |_| true,
        )
        .unwrap();
        near(late.x[0], 4.5, 1e-8);
    }
    let text = |f: &str| {
        format!(
            "states = ['x']\nstart = [0]\nf = ['{f}']\n[tables.u]\nfile = 'u.csv'\ntime = \
                't'\ncolumn = 'y'\ninterpolation = 'previous'"
        )
    };
    for (f, want) in [
        ("max(u, 0.5)", 7.5),
        ("abs(u)", 10.5),
        ("sign(u + x*0)", 0.0),
        ("if(u > 0.5, 1, -1)", 0.0),
    ] {
        let table = model(&text(f)).with_table("u", "t,y\n0,-1\n5,1.1\n10,0\n").unwrap();
        let want = if f == "max(u, 0.5)" { 8.0 } else { want };
        near(run(&table, 10.0).1.unwrap().x[0], want, 1e-12);
    }
}

/// A closed orbit that is not isolated is one all the same.
#[test]
fn a_linear_oscillator_closes_on_any_section() {
    use crate::motion::tangent::{Return, closed_orbit};
    let circle = model("states = ['x', 'v']\nstart = [1, 0]\nf = ['v', '-x']");
    for section in ["x - 0.5", "v - 0.5", "x + v"] {
        let section = twofold_system::Expression::parse_general(section, &["x", "v"]).unwrap();
        let options =
            Options { record: Record::Section(section), t_end: 100.0, ..Options::default() };
        let found = closed_orbit(&circle, &options, &Return::Crossings(1), 0.0).unwrap();
        near(found.period, 2.0 * std::f64::consts::PI, 1e-8);
        near(found.multipliers[0][0], 1.0, 1e-6);
        assert!(found.gap < 1e-8);
    }
}

/// Rests on a kink or at a double root are not named by one side's eigenvalues.
#[test]
fn stability_is_said_where_it_is_decided() {
    let kinds = |text: &str, bounds: &[(f64, f64)]| -> Vec<String> {
        crate::rests::rests(&model(text), bounds).unwrap().iter().map(|r| r.kind()).collect()
    };
    for f in ["-abs(x)", "if(x > 0, -x, 2*x)"] {
        let found = kinds(&format!("states = ['x']\nf = ['{f}']"), &[(-1.0, 1.0)]);
        assert!(
            !found.is_empty() && found.iter().all(|k| k.starts_with("boundary equilibrium")),
            "{f}: {found:?}"
        );
    }
    let double = kinds("states = ['x']\nf = ['x^2']", &[(-10.0, 10.0)]);
    assert!(double.iter().all(|k| k == "not decided by the linearised motion"), "{double:?}");
    assert_eq!(kinds("states = ['x']\nf = ['-0.001*x']", &[(-10.0, 10.0)]), ["stable node"]);
}

/// A rest in a strip that none of the places is in from which it is looked for, in a field and on
/// the edges of strips of other states.
#[test]
fn rests_in_narrow_strips_are_found() {
    let found = |text: &str| crate::rests::rests(&model(text), &[(-10.0, 10.0); 2]).unwrap();
    for width in [0.03, 1e-3, 1e-5] {
        let strip = format!("if(x > 0.1 and x < 0.1 + {width:e}, 0.1 + {width:e}/3 - x, 1)");
        let strips =
            found(&format!("states = ['x', 'y']\nf = ['{strip}', '{}']", strip.replace('x', "y")));
        let at = |x: f64, y: f64| {
            let near = |r: &&crate::rests::Rest| {
                (r.x[0] - 0.1 - x * width).abs() + (r.x[1] - 0.1 - y * width).abs() < 1e-12
            };
            strips.iter().filter(near).count()
        };
        assert_eq!(strips.len(), 4, "{width}: {strips:?}");
        for (x, y) in [(1.0 / 3.0, 1.0 / 3.0), (1.0, 1.0 / 3.0), (1.0 / 3.0, 1.0), (1.0, 1.0)] {
            assert_eq!(at(x, y), 1, "{width} {x} {y}: {strips:?}");
        }
    }
}

/// Linear pieces have one zero each, which is a rest if it lies in its piece: of four saturations
/// in three states (eight switching functions) the same rests are found.
#[test]
fn rests_of_many_linear_pieces_are_found() {
    const N: usize = 3;
    const CLIPS: usize = 4;
    let mut draws = twofold_num::random::RandomStream::new(17, 0);
    for system in 0..12 {
        let mut draw = |count: usize| -> Vec<f64> { (0..count).map(|_| draws.normal()).collect() };
        let (a, b, c, h, d) = (draw(N * N), draw(N), draw(N * CLIPS), draw(CLIPS * N), draw(CLIPS));
        let c: Vec<f64> = c.iter().map(|c| 2.0 * c).collect();
        let sum = |row: &[f64]| {
            let terms: Vec<String> = (0..N).map(|j| format!("({})*x{j}", row[j])).collect();
            terms.join(" + ")
        };
        let f = (0..N).map(|i| {
            let clips = (0..CLIPS).map(|k| {
                let inner = sum(&h[k * N..(k + 1) * N]);
                format!("({})*clip({inner} + ({}), -1, 1)", c[i * CLIPS + k], d[k])
            });
            let linear = [sum(&a[i * N..(i + 1) * N]), format!("({})", b[i])];
            format!("'{}'", linear.into_iter().chain(clips).collect::<Vec<_>>().join(" + "))
        });
        let f: Vec<String> = f.collect();
        let text = format!("states = ['x0', 'x1', 'x2']\nf = [{}]", f.join(", "));
        let found = crate::rests::find(&model(&text), &[(-10.0, 10.0); N]).unwrap();
        assert!(found.limits.is_empty(), "{:?}", found.limits);
        let mut right = Vec::new();
        for piece in 0..3_usize.pow(CLIPS as u32) {
            let state = |k: usize| piece / 3_usize.pow(k as u32) % 3;
            let (mut matrix, mut constant) = (a.clone(), b.clone());
            for i in 0..N {
                for k in 0..CLIPS {
                    let c = c[i * CLIPS + k];
                    match state(k) {
                        0 => constant[i] -= c,
                        1 => constant[i] += c,
                        _ => {
                            constant[i] += c * d[k];
                            (0..N).for_each(|j| matrix[i * N + j] += c * h[k * N + j]);
                        }
                    }
                }
            }
            let minus: Vec<f64> = constant.iter().map(|v| -v).collect();
            let x = twofold_num::linear::solve_any(&matrix, &minus, 0.0).unwrap();
            let value = |k: usize| (0..N).map(|j| h[k * N + j] * x[j]).sum::<f64>() + d[k];
            let own = (0..CLIPS).all(|k| match state(k) {
                0 => value(k) < -1.0,
                1 => value(k) > 1.0,
                _ => value(k).abs() < 1.0,
            });
            if own && x.iter().all(|x| x.abs() < 10.0) {
                right.push(x);
            }
        }
        assert_eq!(found.rests.len(), right.len(), "{system}: {found:?} {right:?}");
        for x in right {
            let is_it = |r: &crate::rests::Rest| (0..N).all(|i| (r.x[i] - x[i]).abs() < 1e-9);
            assert!(found.rests.iter().any(is_it), "{system}: {x:?}");
        }
    }
}

/// A curve of rests is named by what neighbours of all of it do: not by its end, where the
/// equations change, nor by a point where it crosses another one.
#[test]
fn curves_of_rests_have_the_names_of_their_neighbours() {
    const COME: &str = "stable: neighbours come to the set";
    const LEAVE: &str = "stable but for an end, at which neighbours leave the set";
    const CHANGES: &str = "stability changes along the curve";
    const OPEN: &str = "not decided by the linearised motion";
    for (f, right) in [
        ("'max(x - 1, 0)'", &[LEAVE][..]),
        ("'max(-x - 1, 0)'", &[COME]),
        ("'max(-x, 0)', '-y'", &[COME]),
        ("'if(x < 0, 2, 0)', '-y'", &[COME]),
        ("'1 - sign(x)', '-y'", &[COME]),
        ("'clip(x, -1, 1) - x', '-y'", &[COME]),
        ("'max(x - 1, 0)', '-y'", &[LEAVE]),
        ("'max(x - 1, 0)', 'y'", &["unstable: neighbours leave the set"]),
        ("'0', 'x*y'", &[CHANGES, OPEN]),
        ("'x*y', '0'", &[OPEN, CHANGES]),
        ("'x*y', '-x*y'", &[CHANGES, CHANGES]),
        ("'x^2 - y^2', '0'", &[CHANGES, CHANGES]),
    ] {
        let n = f.matches('\'').count() / 2;
        let text = format!("states = [{}]\nf = [{f}]", &"'x', 'y'"[..5 * n - 2]);
        let found = crate::rests::rests(&model(&text), &vec![(-10.0, 10.0); n]).unwrap();
        let kinds: Vec<String> = found.iter().map(|r| r.kind()).collect();
        assert_eq!(kinds, right, "{f}");
        let is_curve = |r: &crate::rests::Rest| r.family.as_ref().is_some_and(|f| f.dimension == 1);
        assert!(found.iter().all(is_curve), "{f}");
    }
}

/// As many as there are, of which 400 starts do not find all.
#[test]
fn many_rests_are_found() {
    let find = |f: &str| {
        let text = format!("states = ['x', 'y']\nf = [{f}]");
        crate::rests::find(&model(&text), &[(-10.0, 10.0); 2]).unwrap()
    };
    for (factor, along) in [(2.0, 13), (5.0, 31)] {
        let found = find(&format!("'sin({factor}*x)', 'sin({factor}*y)'"));
        assert_eq!((found.rests.len(), found.limits.len()), (along * along, 0), "{factor}");
    }
    // Nearer to each other than what a zero of higher order is known to.
    let near_by: Vec<f64> = find("'x^3 - 1e-12*x', 'y'").rests.iter().map(|r| r.x[0]).collect();
    assert_eq!(near_by.len(), 3, "{near_by:?}");
    near_by.iter().zip([-1e-6, 0.0, 1e-6]).for_each(|(x, right)| near(*x, right, 1e-15));
    for f in ["'x^2', 'y'", "'x^2 - 2*x + 1', 'y'", "'x^3 - 3*x^2 + 3*x - 1', 'y'"] {
        assert_eq!(find(f).rests.len(), 1, "{f}");
    }
}

/// Thirteen signs of thirteen states have 8192 combinations: it is said that not all were tried.
#[test]
fn what_was_not_looked_at_is_said() {
    let names: Vec<String> = (0..13).map(|i| format!("'x{i}'")).collect();
    let f: Vec<String> = (0..13).map(|i| format!("'2 + sign(x{i})'")).collect();
    let text = format!("states = [{}]\nf = [{}]", names.join(", "), f.join(", "));
    let found = crate::rests::find(&model(&text), &[(-1.0, 1.0); 13]).unwrap();
    let has = |limit: &crate::rests::Limit| found.limits.contains(limit);
    assert!(has(&crate::rests::Limit::Sides { functions: 13, tried: 4096 }), "{found:?}");
    assert!(has(&crate::rests::Limit::Surfaces { together: 3 }), "{found:?}");
}

/// One focus with eigenvalues 0.2 +- i, whatever the units of its states.
#[test]
fn a_rest_has_no_units() {
    for unit in [1.0, 1e3, 1e9, 1e12, 1e17] {
        let text = format!(
            "states = ['x', 'y']\nf = ['0.2*x - {unit:e}*y*(1 + (x*y)^2)', '{:e}*x + 0.2*y']",
            1.0 / unit
        );
        for within in [[(-5.0, 4.0); 2], [(-unit, 0.9 * unit), (-1.0 / unit, 0.8 / unit)]] {
            let found = crate::rests::rests(&model(&text), &within).unwrap();
            let [rest] = &found[..] else { panic!("{unit:e} {within:?}: {found:?}") };
            assert_eq!(rest.kind(), "unstable focus", "{unit:e} {within:?}: {rest:?}");
            for [re, im] in &rest.eigenvalues {
                near(*re, 0.2, 1e-12);
                near(im.abs(), 1.0, 1e-12);
            }
        }
    }
}

/// A field that jumps where a root's domain ends turns tangent vectors there, too: x' = 1 + (1 -
/// x)^p below 1 and 3 above, from 0, has dx/dx(0) = 3/2.
#[test]
fn tangents_turn_where_a_root_ends() {
    for power in ["0.5", "1.5"] {
        let text = format!("states = ['x']\nf = ['if(x < 1, 1 + (1 - x)^{power}, 3)']");
        let options = Options { t_end: 2.0, start: Some(vec![0.0]), ..Options::default() };
        let found = sensitivity::sensitivities(&model(&text), &options, &[]).unwrap();
        near(found.by_start[0][0], 1.5, 1e-8);
    }
}

/// A contact after Hertz (tapping-mode microscopy) is left in a few steps: areas shrink by
/// exp(-0.02 t) whatever the phase.
#[test]
fn steps_do_not_creep_to_the_end_of_a_root() {
    let start = Some(vec![-0.5690061911627036, 0.01816849959625292]);
    let options = Options { t_end: std::f64::consts::TAU, start, ..Options::default() };
    let text = "states = ['z', 'v']\nf = ['v', '-z - 0.02*v + 0.02*cos(t - 0.5) + F']\n[let]\nd = \
        '0.6 + z'\nF = 'if(d > 0.05, -0.0002/d^2, -0.08 + 0.6*(0.05 - d)^1.5)'";
    let found = sensitivity::sensitivities(&model(text), &options, &[]).unwrap();
    let [a, b] = [&found.by_start[0], &found.by_start[1]];
    near(a[0] * b[1] - a[1] * b[0], (-0.02 * std::f64::consts::TAU).exp(), 1e-7);
    let end = follow(&model(text), &options, &mut |_| true).unwrap();
    assert!(end.steps < 300, "{}", end.steps);
}

/// Super-twisting crosses the end of its root again and again, and comes to rest in finite time.
#[test]
fn super_twisting_comes_to_rest_by_every_method() {
    let text = "states = ['x', 'w']\nstart = [1, 0]\nf = ['-1.5*sqrt(abs(x))*sign(x) + w', \
        '-1.1*sign(x)']";
    for method in [Method::Dopri5, Method::Radau5, Method::Lsoda, Method::Taylor] {
        let options = Options { t_end: 3.0, method, ..Options::default() };
        let end = follow(&model(text), &options, &mut |_| true).unwrap();
        assert!(end.x.iter().all(|x| x.abs() < 1e-7) && end.steps < 20_000, "{method:?}: {end:?}");
    }
}

/// Logic by the greatest of products is that by `or` and by comparisons, and a network written so
/// is followed without a structure for each gene at each gene's switch.
#[test]
fn logic_may_be_written_by_greatest_values() {
    let n = 16;
    let states: Vec<String> = (0..n).map(|i| format!("'g{i}'")).collect();
    let start: Vec<String> =
        (0..n).map(|i| format!("{}", 0.05 + 0.9 * (i * 7 % n) as f64 / 16.0)).collect();
    let network = |of: &dyn Fn(String, String) -> String| {
        let step = |i: usize| format!("heaviside(g{} - 0.5)", i % n);
        let f: Vec<String> = (0..n)
            .map(|i| {
                let both = format!("(1 - {})*{}", step(i + 3), step(i + 7));
                format!("'-g{i} + 1.1*{}'", of(both, step(i + 5)))
            })
            .collect();
        let text = format!(
            "states = [{}]\nstart = [{}]\nf = [{}]",
            states.join(", "),
            start.join(", "),
            f.join(", ")
        );
        let options = Options { t_end: 3.0, ..Options::default() };
        follow(&model(&text), &options, &mut |_| true).unwrap().x
    };
    let right = network(&|a, b| format!("if({a} > 0.5 or {b} > 0.5, 1, 0)"));
    for found in [
        network(&|a, b| format!("max({a}, {b})")),
        network(&|a, b| format!("if({a} > {b}, {a}, {b})")),
        network(&|a, b| format!("(1 - (1 - {a})*(1 - {b}))")),
    ] {
        found.iter().zip(&right).for_each(|(found, right)| near(*found, *right, 1e-8));
    }
}

/// States that begin at zero, as powers of the time, have their exponents, too: those of a cascade
/// are on its diagonal.
#[test]
fn exponents_of_a_cascade_from_zero() {
    for (f, right) in [
        ("'-x + 2*sin(t)', '-0.5*y + x^3', '-0.2*w + y^2'", [-0.2, -0.5, -1.0]),
        ("'-0.1*x + 0.2*sin(t)', '-0.5*y + x^3', '-w + y^4'", [-0.1, -0.5, -1.0]),
    ] {
        let text = format!("states = ['x', 'y', 'w']\nstart = [0, 0, 0]\nf = [{f}]");
        let options = Options { t_end: 300.0, ..Options::default() };
        let found = tangent::exponents(&model(&text), &options, 30.0, 3).unwrap();
        assert_eq!(found.values.len(), 3, "{f}: {found:?}");
        for (value, (error, right)) in found.values.iter().zip(found.errors.iter().zip(right)) {
            assert!((value - right).abs() <= error.max(1e-3), "{f}: {found:?}");
        }
    }
}

/// Populations rest where one of them is zero, on the face of the box: an equilibrium of two that
/// compete, x' = x (r - x - a y), has the eigenvalues -r and s - b r at y = 0.
#[test]
fn populations_rest_on_the_face_of_the_box() {
    let ([r, a], [s, b]) = ([0.76, 1.45], [0.92, 0.35]);
    let text = format!("states = ['x', 'y']\nf = ['x*({r} - x - {a}*y)', 'y*({s} - {b}*x - y)']");
    for within in [(0.0, 3.0), (-0.7, 3.0)] {
        let found = crate::rests::rests(&model(&text), &[within; 2]).unwrap();
        // Together they would need a negative number of the first.
        let right = [
            ([0.0, 0.0], [s, r], "unstable node"),
            ([0.0, s], [r - a * s, -s], "stable node"),
            ([r, 0.0], [s - b * r, -r], "saddle"),
        ];
        assert_eq!(found.len(), 3, "{within:?} {found:?}");
        for (rest, (x, eigenvalues, kind)) in found.iter().zip(right) {
            for i in 0..2 {
                near(rest.x[i], x[i], 1e-12);
                near(rest.eigenvalues[i][0], eigenvalues[i], 1e-9);
            }
            assert_eq!(rest.kind(), kind, "{rest:?}");
        }
    }
}

/// Pseudo-equilibria on a circle on which equal weights of the fields cancel: the sliding field is
/// (1 - x^2)/2, -x y/2.
#[test]
fn rests_on_a_circle_are_found() {
    let h = "x^2 + y^2 - 1";
    let text = format!("states = ['x', 'y']\nf = ['0.5 - x*sign({h})', '-y*sign({h})']");
    for half in [1.5, 2.0, 10.0] {
        let found = crate::rests::rests(&model(&text), &[(-half, half); 2]).unwrap();
        let [left, middle, right] = &found[..] else { panic!("{half}: {found:?}") };
        for (rest, [x, weight, rate]) in [(left, [-1.0, 0.25, 0.5]), (right, [1.0, 0.75, -0.5])] {
            near(rest.x[0], x, 1e-12);
            near(rest.x[1], 0.0, 1e-12);
            near(rest.on[0].weight, weight, 1e-12);
            near(rest.eigenvalues[0][0], rate, 1e-12);
            assert_eq!(rest.on[0].surface, "x^2 + y^2 - 1");
        }
        assert!(middle.on.is_empty() && middle.x == [-0.5, 0.0], "{middle:?}");
    }
}

/// A pseudo-equilibrium at y = 0 of x' = a sign(x), y' = b y + sign(x)/2, by the motion to the
/// surface (a) and along it (b).
#[test]
fn pseudo_equilibria_have_the_names_of_the_field() {
    for (a, b, want) in [
        (-1, -1, "stable pseudo-node"),
        (-1, 1, "pseudo-saddle"),
        (1, -1, "pseudo-saddle"),
        (1, 1, "unstable pseudo-node"),
    ] {
        let text = format!("states = ['x', 'y']\nf = ['({a})*sign(x)', '({b})*y + 0.5*sign(x)']");
        let found = crate::rests::rests(&model(&text), &[(-0.3, 0.4); 2]).unwrap();
        let kinds: Vec<String> = found.iter().map(|r| r.kind()).collect();
        assert_eq!(kinds, [want], "{a} {b}");
    }
}

/// Rests where a whole part becomes another number: x = k, where 1/2 - floor x is half of the time
/// 1/2 and half of it -1/2, or mod(x, 1) - 1/4 three quarters of it -1/4.
#[test]
fn rests_on_whole_parts_are_found() {
    let find = |f: &str, low: f64, high: f64| {
        let text = format!("states = ['x']\nf = ['{f}']");
        crate::rests::rests(&model(&text), &[(low, high)]).unwrap()
    };
    for (low, high) in [(-10.0, 10.0), (-2.0, 2.3), (0.5, 1.5)] {
        let found = find("0.5 - floor(x)", low, high);
        let [rest] = &found[..] else { panic!("{low} {high}: {found:?}") };
        assert_eq!((rest.x[0], rest.kind().as_str()), (1.0, "stable"));
        assert_eq!((rest.on[0].surface.as_str(), rest.on[0].weight), ("x - 1", 0.5));
    }
    let found = find("mod(x, 1) - 0.25", -0.5, 5.0);
    let (on, off): (Vec<_>, Vec<_>) = found.iter().partition(|r| !r.on.is_empty());
    assert_eq!((on.len(), off.len()), (6, 5), "{found:?}");
    for (k, rest) in on.iter().enumerate() {
        near(rest.x[0], k as f64, 1e-15);
        near(rest.on[0].weight, 0.75, 1e-12);
        assert_eq!(rest.attracting, Some(true));
    }
    assert!(off.iter().all(|r| r.kind() == "unstable node" && r.x[0].rem_euclid(1.0) == 0.25));
    // With other surfaces: floor y = 2 and x = 0 at once.
    let text = "states = ['x', 'y']\nf = ['-sign(x)', '1.5 - floor(y)']";
    let found = crate::rests::rests(&model(text), &[(-3.0, 3.0); 2]).unwrap();
    let [corner] = &found[..] else { panic!("{found:?}") };
    assert_eq!((corner.x.as_slice(), corner.kind().as_str()), (&[0.0, 2.0][..], "stable"));
}

/// Of three rests within a thousandth of the box the one in the middle.
#[test]
fn rests_between_rests_are_found() {
    for (middle, far) in [(1.0001, 1.0002), (1.00003, 1.0003)] {
        let text = format!("states = ['x']\nf = ['(x - 1)*(x - {middle})*(x - {far})']");
        let found = crate::rests::rests(&model(&text), &[(0.9, 1.1)]).unwrap();
        let [_, rest, _] = &found[..] else { panic!("{found:?}") };
        near(rest.x[0], middle, 1e-9);
    }
}

/// Rests that fill a curve are one row with its ends; those on several surfaces have the weights of
/// a mixture, or of more dimensions.
#[test]
fn rests_on_curves_and_on_several_surfaces() {
    use crate::rests::rests;
    let find =
        |text: &str, half: f64, n: usize| rests(&model(text), &vec![(-half, half); n]).unwrap();
    // A block within friction: x from -1/2 to 1/2 at v = 0, to which neighbours come; no row for
    // the ends, which are zeros of a field.
    let block = find("states = ['x', 'v']\nf = ['v', '-x - 0.5*sign(v)']", 3.0, 2);
    let [stuck] = &block[..] else { panic!("{} rows", block.len()) };
    let [from, to] = stuck.family.as_ref().unwrap().ends.as_ref().unwrap();
    near(from[0], -0.5, 1e-9);
    near(to[0], 0.5, 1e-9);
    near(stuck.x[1], 0.0, 1e-15);
    assert_eq!(stuck.kind(), "stable: neighbours come to the set");
    // The line x + y = 1, from one side of the box to the other, and the origin.
    let line = find("states = ['x', 'y']\nf = ['-x*(1 - x - y)', '-y*(1 - x - y)']", 3.0, 2);
    let [set] = &line.iter().filter(|r| r.family.is_some()).collect::<Vec<_>>()[..] else {
        panic!("{} rows", line.len())
    };
    let [from, to] = set.family.as_ref().unwrap().ends.as_ref().unwrap();
    near(from[0], -2.0, 1e-9);
    near(to[0], 3.0, 1e-9);
    near(from[0] + from[1], 1.0, 1e-9);
    assert_eq!(set.kind(), "unstable: neighbours leave the set");
    assert_eq!(line.len(), 2);
    // On y = 0 the rate across is x: it repels right of zero and attracts left of it.
    let turning = find("states = ['x', 'y']\nf = ['y', 'x*y']", 3.0, 2);
    assert_eq!(turning[0].kind(), "stability changes along the curve");
    // A plane of rests in x < 0, and an isolated one of the same field behind it is not lost.
    let both = "states = ['x', 'y']\nf = ['max(x, 0) * (x - 1)', 'max(x, 0) * (y - 1)']";
    let found = find(both, 3.0, 2);
    let dimensions: Vec<_> =
        found.iter().map(|r| r.family.as_ref().map_or(0, |f| f.dimension)).collect();
    assert!(dimensions.contains(&2) && dimensions.contains(&0), "{dimensions:?}");
    // A circle of rests closes.
    let ring = find("states = ['x', 'y']\nf = ['x*(1 - x^2 - y^2)', 'y*(1 - x^2 - y^2)']", 3.0, 2);
    let closed = ring.iter().find_map(|r| r.family.clone()).unwrap();
    assert_eq!((closed.dimension, closed.ends, ring.len()), (1, None, 2));
    // A corner of two relays: -s + 0.3 = 0 and -u - 0.2 s = 0, so that s = 0.3 and u = -0.06;
    // weights are (1 + s)/2.
    let corner =
        find("states = ['x', 'y']\nf = ['-sign(x) + 0.3', '-sign(y) - 0.2*sign(x)']", 3.0, 2);
    let [rest] = &corner[..] else { panic!("{} rows", corner.len()) };
    near(rest.on[0].weight, 0.65, 1e-12);
    near(rest.on[1].weight, 0.47, 1e-12);
    assert_eq!((rest.kind().as_str(), rest.attracting), ("stable", Some(true)));
    // Relays that work against each other: det W < 0 repels; of one that turns (W = [1, 4; -4, -2],
    // det > 0) the speeds decide.
    let saddle =
        find("states = ['x', 'y']\nf = ['-sign(x) - 2*sign(y)', '-2*sign(x) - sign(y)']", 3.0, 2);
    assert_eq!(saddle.iter().map(|r| r.kind()).collect::<Vec<_>>(), ["unstable"]);
    let open =
        find("states = ['x', 'y']\nf = ['sign(x) + 4*sign(y)', '-4*sign(x) - 2*sign(y)']", 3.0, 2);
    assert_eq!(open[0].kind(), "not decided by the fields there");
    // The linear law of a passage only turns (W = [0, -1; 1, 0]): what remains decides. Squares
    // about the first corner close; a quarter turn about the others maps a to a/(1 + a).
    for turning in [
        "['-sign(y)', 'sign(x)']",
        "['-sign(y) - x', 'sign(x) - y']",
        "['if(y < 1, 2, 0) - x', 'if(x > 1, 2, 0) - y']",
        "['if(y < 1, 2, 0) - x', 'if(x > 1, 3, 0) - y']",
        "['-2*sign(y) + 0.5 - x', 'sign(x) - 0.5 - y']",
    ] {
        let found = find(&format!("states = ['x', 'y']\nf = {turning}"), 3.0, 2);
        let [corner] = &found[..] else { panic!("{turning}: {} rows", found.len()) };
        assert_eq!(
            (corner.attracting, corner.kind().as_str()),
            (None, "not decided by the fields there"),
            "{turning}"
        );
    }
    // In three relays that turn, s^3 = -d with d > 0 for any speeds: two eigenvalues on the right.
    // With a weak pull the speeds decide; with a strong one W + W^T is negative definite.
    for (pull, attracting) in [("0", Some(false)), ("-0.4", None), ("-1", Some(true))] {
        let f = ["xy", "yz", "zx"].map(|pair| {
            let (own, next) = pair.split_at(1);
            format!("{pull}*sign({own}) - sign({next})")
        });
        let found = find(&format!("states = ['x', 'y', 'z']\nf = {f:?}"), 3.0, 3);
        let corner = found.iter().find(|r| r.on.len() == 3).unwrap();
        assert_eq!(corner.attracting, attracting, "{pull}");
    }
    // A third state along the corner: z' = -z + s/2 - 0.4 u with s = 0.3 z, u = 0.1: z =
    // -0.04/0.85, eigenvalue -0.85.
    let edge = find(
        "states = ['x', 'y', 'z']\nf = ['-sign(x) + 0.3*z', '-sign(y) + 0.1', '-z + 0.5*sign(x) - \
            0.4*sign(y)']",
        3.0,
        3,
    );
    let [rest] = &edge[..] else { panic!("{} rows", edge.len()) };
    near(rest.x[2], -0.04 / 0.85, 1e-12);
    near(rest.eigenvalues[0][0], -0.85, 1e-9);
    // Two blocks that friction holds: a set of two dimensions on both surfaces.
    let blocks = "states = ['x1', 'v1', 'x2', 'v2']\nf = ['v1', '-2*x1 + x2 - 0.5*sign(v1)', 'v2', \
        'x1 - 2*x2 - 0.5*sign(v2)']";
    let held = find(blocks, 3.0, 4);
    // The curves where one of them is about to slide are its edges.
    let sets: Vec<_> =
        held.iter().map(|r| (r.on.len(), r.family.as_ref().map(|f| f.dimension))).collect();
    assert_eq!(sets, [(2, Some(2))]);
    // A thermostat: each mode's rest lies behind the event that leaves it.
    let thermostat = "states = ['T']\n[modes.on]\nf = ['30 - T']\n[modes.off]\nf = ['10 - \
        T']\n[[event]]\nname = 'warm'\nwhen = 'T > 22'\nfrom = 'on'\nmode = 'off'\n[[event]]\nname \
        = 'cold'\nwhen = 'T - 18'\ndirection = 'down'\nfrom = 'off'\nmode = 'on'";
    let behind: Vec<_> = find(thermostat, 40.0, 1).into_iter().map(|r| r.behind.unwrap()).collect();
    assert_eq!(behind, ["warm", "cold"]);
    // In units a million times smaller.
    let small = find("states = ['x', 'v']\nf = ['v', '-x - 0.5e-6*sign(v)']", 3e-6, 2);
    near(small[0].family.as_ref().unwrap().ends.as_ref().unwrap()[1][0], 0.5e-6, 1e-15);
}

/// A pole is no zero, for events, sections and switches, wherever it is met together with others; a
/// quotient has the sign of the product.
#[test]
fn poles_are_no_zeros() {
    let count = |when: &str, t_end: f64| {
        let text = format!(
            "states = ['x', 'n']\nstart = [0.1, 0]\nf = ['1', '0']\n[[event]]\nwhen = \
                '{when}'\ndirection = 'both'\nset = {{ n = 'n + 1' }}"
        );
        last(&text, t_end)
    };
    // tan x = 1 at seven places of (0.1, 20.1).
    for (when, want) in [
        ("tan(x) - 1", 7.0),
        ("1/(x - 3)", 0.0),
        ("1/(x - 3) + 2", 1.0),
        ("1/tan(x)", 6.0),
        ("x/(x - 3) - 5", 1.0),
    ] {
        near(count(when, 20.0), want, 0.0);
    }
    let both = "states = ['x', 'n', 'm']\nstart = [0.1, 0, 0]\nf = ['1', '0', \
        '0']\n[[event]]\nwhen = 'tan(x)'\ndirection = 'up'\nset = { n = 'n + 1' }\n[[event]]\nwhen \
        = '1/tan(x) + 1/(x - 2)'\ndirection = 'both'\nset = { m = 'm + 1' }";
    // sin x is zero at six places, where the other one has its poles.
    near(end(both, 20.0)[1], 6.0, 0.0);
    near(end(both, 20.0)[2], 7.0, 0.0);
    let section = twofold_system::Expression::parse_general("tan(x)", &["x"]).unwrap();
    let options = Options { record: Record::Section(section), t_end: 20.0, ..Options::default() };
    let mut rows = 0;
    follow(&model("states = ['x']\nstart = [0.1]\nf = ['1']"), &options, &mut |_| {
        rows += 1;
        true
    })
    .unwrap();
    assert_eq!(rows, 6);
    for (switch, want) in
        [("sign(1/(x - 1))", 1.0), ("sign(x/(x - 1))", 1.0), ("if(2/(x - 1)^3 > 0, 1, -1)", 1.0)]
    {
        near(
            last(&format!("states = ['x', 'y']\nstart = [0, 0]\nf = ['1', '{switch}']"), 3.0),
            want,
            1e-12,
        );
    }
}

/// Several events of one moment see each other's work, also in derivatives.
#[test]
fn events_of_one_moment_see_each_other() {
    let text = "states = ['x', 'n']\nstart = [0, 0]\nf = ['1', '0']\n[[event]]\nwhen = 'x - \
        1'\nset = { x = '0', n = 'n + 1' }\n[[event]]\nwhen = 'x - 1'\nset = { n = 'n + 10' }";
    near(last(text, 10.5), 110.0, 0.0);
    // Both at t = 1: first doubled, then the square; d((2x)^2)/dx = 8x.
    let timed = "states = ['x']\nstart = [3]\nf = ['0']\n[[event]]\nat = 1\nset = { x = '2*x' \
        }\n[[event]]\nevery = 1\nset = { x = 'x^2' }";
    near(last(timed, 1.5), 36.0, 0.0);
    let options = Options { t_end: 1.5, ..Options::default() };
    let found = crate::motion::sensitivity::sensitivities(&model(timed), &options, &[]).unwrap();
    near(found.by_start[0][0], 24.0, 1e-8);
}

/// A field that runs along the surface which the other one leads to: the time-optimal control of a
/// double integrator (Pontryagin et al. 1962), in any units, and its rest; rests that are reached
/// in finite time; the rest at a corner of max(|x|, |y|).
#[test]
fn motion_along_a_switching_curve_and_into_rest() {
    for (unit, time) in [(1.0, 1.0), (1e-9, 1.0), (1e6, 1e-3)] {
        let (speed, force) = (unit / time, unit / (time * time));
        let text = format!(
            "states = ['x', 'v']\nstart = [{unit:e}, {speed:e}]\nf = ['v', '-{force:e}*sign(x + \
                v*abs(v)/{:e})']",
            2.0 * force
        );
        // From (1, 1) the curve is met at v = -sqrt(3/2), and (0, 0) at t = 1 + 2 sqrt(3/2).
        let left = 1.0 + 6.0_f64.sqrt() - 3.2;
        let x = end(&text, 3.2 * time);
        near(x[0] / unit, 0.5 * left * left, 1e-12);
        near(x[1] / speed, -left, 1e-12);
        let rest = end(&text, 9.0 * time);
        assert!(rest[0].abs() < 1e-12 * unit && rest[1].abs() < 1e-12 * speed, "{rest:?}");
    }
    // Tangent to second order only: it is slid upon from x = 0 on, or left there.
    near(
        last("states = ['x', 'y']\nstart = [-1, 1]\nf = ['1', 'if(y > 0, -1, x^3)']", 2.0),
        0.0,
        1e-15,
    );
    near(
        last("states = ['x', 'y']\nstart = [-1, 1]\nf = ['1', 'if(y > 0, -1, -x^3)']", 2.0),
        -0.25,
        1e-12,
    );
    for text in [
        "states = ['x', 'v']\nstart = [1, 0]\nf = ['v', '-2*sign(v + sqrt(2*abs(x))*sign(x)*0.9)']",
        "states = ['x', 'v']\nstart = [1, 0]\nf = ['-1.5*sqrt(abs(x))*sign(x) + v', \
            '-1.1*sign(x)']",
        "states = ['x', 'v']\nstart = [1, 0.4]\nf = ['-if(abs(x) > abs(v), sign(x), 0)', \
            '-if(abs(x) > abs(v), 0, sign(v))']",
    ] {
        let x = end(text, 5.0);
        assert!(x.iter().all(|v| v.abs() < 1e-12), "{text}: {x:?}");
    }
    // A kick in time is not overslept: from (1, 0) at t = 3 the control is -1 for a unit of time.
    let kicked = "states = ['x', 'v']\nstart = [1, 0]\nf = ['v', '-sign(x + \
        v*abs(v)/2)']\n[[event]]\nat = 3\nset = { x = '1' }";
    near(end(kicked, 4.0)[0], 0.5, 1e-12);
    let counted = kicked.replace("x = '1'", "x = 'x'").replace("at = 3", "every = 0.75");
    assert!(end(&counted, 4.0)[0].abs() < 1e-12);
}

/// A sawtooth of the time from zero, however late.
#[test]
fn a_late_start_is_followed() {
    for t in [1e4, 1e6, 1e8] {
        let options = Options { t_start: t, t_end: t + 3.0, ..Options::default() };
        let found =
            follow(&model("states = ['x']\nstart = [0]\nf = ['mod(t, 1)']"), &options, &mut |_| {
                true
            })
            .unwrap();
        near(found.x[0], 1.5, 1e-15 * t + 1e-9);
        assert!(found.steps < 100);
    }
}

fn taylor(t_end: f64, rtol: f64) -> Options {
    Options { t_end, rtol, method: Method::Taylor, max_steps: 20_000, ..Options::default() }
}

/// All methods follow every shipped system to the same end, with the same switches and events.
#[test]
fn series_and_multistep_agree_with_dormand_and_prince_on_all_that_ships() {
    for name in twofold_system::library::general_names() {
        let model = shipped(name);
        let t_end = match name {
            // Before the ramp jumps, as it does where the run would end.
            "buck" => 0.0099,
            "cuk-converter" => 0.000_99,
            "driven-by-data" => 160.0,
            // Before its impacts accumulate.
            "bouncing-ball" => 3.9,
            _ => 20.0,
        };
        let ends = [Method::Dopri5, Method::Taylor, Method::Lsoda].map(|method| {
            let mut events = Vec::new();
            let options = Options { t_end, method, max_steps: 200_000, ..Options::default() };
            let outcome = follow(&model, &options, &mut |point| {
                events.extend(point.event.map(|e| e.to_owned()));
                true
            });
            (outcome.unwrap_or_else(|e| panic!("{name}: {e}")), events)
        });
        let [(a, happened), others @ ..] = ends;
        let start = model.start().unwrap().unwrap();
        let size = a.x.iter().chain(&start).fold(0.0_f64, |most, x| most.max(x.abs()));
        for (b, others) in &others {
            let told = format!("{name}: {} steps, then {}; {:?} {:?}", a.steps, b.steps, a.x, b.x);
            assert_eq!((a.mode, a.switches, &happened), (b.mode, b.switches, others), "{told}");
            assert!(a.x.iter().zip(&b.x).all(|(a, b)| (a - b).abs() <= 1e-8 * size), "{told}");
        }
    }
}

/// The last digits, through events, sliding, contacts, whole parts and tables.
#[test]
fn series_reach_the_last_digits() {
    let end = |text: &str, t_end: f64| {
        let outcome = follow(&model(text), &taylor(t_end, 1e-15), &mut |_| true)
            .unwrap_or_else(|e| panic!("{text}\n{e}"));
        assert_eq!(outcome.ending, Ending::Finished);
        outcome
    };
    let ball = "states = ['x', 'v']\nstart = [1, 0]\nf = ['v', '-2']\n\
        [[event]]\nwhen = 'x'\ndirection = 'down'\nset = { v = '-0.5*v' }\nafter_zeno = 'stick'";
    // Impacts at 1, 2, 2.5, ...; at 1.75 it is 1/4 - 1/16 high.
    let outcome = end(ball, 1.75);
    near(outcome.x[0], 0.1875, 1e-15);
    near(outcome.x[1], -0.5, 2e-15);
    assert!(outcome.steps < 8, "{}", outcome.steps);
    // It rests from 3 on.
    end(ball, 4.0).x.iter().for_each(|x| near(*x, 0.0, 1e-20));
    // An oscillator against a wall at zero without loss.
    let wall = "states = ['x', 'v']\nstart = [1, 0]\nf = ['v', '-x']\n\
        [[event]]\nwhen = 'x'\ndirection = 'down'\nset = { v = '-v' }";
    let outcome = end(wall, 100.0);
    near(outcome.x[0], 100.0_f64.cos().abs(), 1e-13);
    // A condition that is no sum of states: x^2 passes 1/2 at pi/4.
    let count = "states = ['x', 'v', 'n', 's']\nstart = [1, 0, 0, 0]\nf = ['v', '-x', '0', 'if(x^2 \
        > 1/2, 1, 0)']";
    let outcome = end(count, 10.0 * std::f64::consts::PI);
    near(outcome.x[3], 5.0 * std::f64::consts::PI, 1e-13);
    // Sliding with an exponential on the line, with the disturbance taken away.
    let control = "states = ['x', 'v']\nstart = [1, -1]\nf = ['v', '0.5*sin(3*t) - 2*sign(v + x)']";
    let outcome = end(control, 5.0);
    near(outcome.x[0], (-5.0_f64).exp(), 1e-15);
    // Two relays that see each other, one slid upon in each order.
    let two = "states = ['x', 'y', 'z']\nstart = [0, 0, 0]\nf = ['cos(t) - 2*sign(x) - \
        0.5*sign(y)', 'sin(t) - 3*sign(y) + 0.5*sign(x)', 'cos(t) + x + y']";
    near(end(two, 3.0).x[2], 3.0_f64.sin(), 2e-15);
    // A staircase, and a ramp in time.
    let stairs = "states = ['x', 'y']\nstart = [0, 0]\nf = ['floor(10*t)/10', 'mod(t, 0.3)']";
    let outcome = end(stairs, 3.0);
    near(outcome.x[0], 4.35, 3e-15);
    near(outcome.x[1], 0.45, 3e-15);
    // A block between two walls that lies on one of them while it is pressed there.
    let lies = "states = ['x', 'v']\nstart = [0, 0]\nf = ['v', '-cos(t)']\n\
        [[event]]\nwhen = 'x'\ndirection = 'down'\nset = { v = '-0.5*v' }\nafter_zeno = 'stick'";
    let t = 2.5_f64;
    let from = std::f64::consts::FRAC_PI_2;
    let outcome = end(lies, t);
    near(outcome.x[1], 1.0 - t.sin(), 1e-15);
    near(outcome.x[0], t - from + t.cos(), 1e-15);
    // Stiff, thin and of high powers: what the first terms do not show.
    let pulse = "states = ['x']\nstart = [0]\nf = ['exp(-((t - 5)/0.01)^2)']";
    near(end(pulse, 10.0).x[0], 0.01 * std::f64::consts::PI.sqrt(), 1e-15);
    let power = "states = ['x']\nstart = [0]\nf = ['t^30']";
    near(end(power, 1.0).x[0], 1.0 / 31.0, 1e-16);
    let layer = "states = ['x']\nstart = [0]\nf = ['tanh((t - 5)/1e-3)']";
    near(end(layer, 10.0).x[0], 0.0, 1e-13);
}

/// A root is left from zero by an implicit step; what has no Taylor series for other reasons is
/// refused by name.
#[test]
fn motion_without_a_series_is_refused() {
    let fails = |text: &str, options: Options| {
        follow(&model(text), &options, &mut |_| true).unwrap_err().to_string()
    };
    let root = "states = ['x']\nstart = [0]\nf = ['1 + x^0.5']";
    let x = follow(&model(root), &taylor(1.0, 1e-10), &mut |_| true).unwrap().x[0].sqrt();
    near(2.0 * x - 2.0 * x.ln_1p(), 1.0, 1e-9);
    let rule = "states = ['x', 'y', 'z']\nstart = [0, 0, 0]\nf = ['-sign(x) + 0.5*sign(y)', \
        '-sign(y)', 'sign(x)*sign(y)']";
    let options =
        Options { intersection: crate::selection::Intersection::Bilinear, ..taylor(1.0, 1e-10) };
    let said = fails(rule, options);
    assert!(said.contains("chosen at every point anew") && said.contains("dopri5"), "{said}");
    // Nor is a pole of what is sought crossed, though the motion goes on.
    let said = fails(
        "states = ['x']\nstart = [0.1]\nf = ['1']\n[[event]]\nwhen = 'tan(x) - 1'\nset = { x = 'x' \
            }",
        taylor(3.0, 1e-10),
    );
    assert!(said.contains("pole") && said.contains("t = 1.47"), "{said}");
    // A pole is not crossed.
    let said = fails("states = ['x']\nstart = [1]\nf = ['x^2']", taylor(2.0, 1e-10));
    assert!(said.contains("leaves the domain") && said.contains("grows without bound"), "{said}");
    // A thin tanh in 65 shapes.
    let names: Vec<String> = (0..65).map(|i| format!("'x{i}'")).collect();
    let fields: Vec<String> = (0..65).map(|i| format!("'tanh({i} - x{i})'")).collect();
    let many = format!(
        "states = [{}]\nstart = [{}0]\nf = [{}]",
        names.join(","),
        "0,".repeat(64),
        fields.join(",")
    );
    assert!(fails(&many, taylor(1.0, 1e-10)).contains("more than 64 different tanh"));
}

/// Switches of motion that is simpler than what decides them: steps are as short as the weights of
/// sliding and the events ask.
#[test]
fn series_of_what_is_sought_bound_the_steps() {
    let both = |text: &str, t_end: f64| {
        let run = |method| {
            let options = Options { t_end, method, max_steps: 20_000, ..Options::default() };
            follow(&model(text), &options, &mut |_| true).unwrap_or_else(|e| panic!("{e}\n{text}"))
        };
        let (a, b) = (run(Method::Dopri5), run(Method::Taylor));
        assert_eq!((a.switches, a.events), (b.switches, b.events), "{text} {a:?} {b:?}");
        a.x.iter().zip(&b.x).for_each(|(a, b)| near(*b, *a, 1e-8 * (1.0 + a.abs())));
        b
    };
    // On v = 0.1 the motion is a straight line, until the drive pulls it off; in large units, too.
    for unit in [1.0, 1e12] {
        let text = format!(
            "states = ['x', 'v']\nstart = [{:e}, 0]\nf = ['v', '-x - {unit:e}*0.3*sign(v - \
                {unit:e}*0.1) + {unit:e}*sin(2*t)']\n\
             [[event]]\nwhen = 'x - {unit:e}*1.2'\ndirection = 'up'\nset = {{ v = '-0.7*v' }}",
            0.5 * unit
        );
        both(&text, 20.0);
    }
    // Sliding that ends again and again, each time once.
    both(
        "states = ['x', 'y', 'z']\nstart = [1.912, 1.868, -0.014]\nf = ['-1.85*cos(3*t) - \
            1.71*sign(x) - 0.7*x', '0.186*tanh(2*z) - 0.472*x - 0.7*y', '-0.94*atan(x) - 0.7*z']",
        6.0,
    );
    // Counted waves, a dip that is met for a moment, a curve.
    let text = "states = ['x', 'n', 'm']\nstart = [0, 0, 0]\nf = ['1', '0', '0']\n\
        [[event]]\nwhen = 'sin(50*x)'\ndirection = 'up'\nset = { n = 'n + 1' }\n\
        [[event]]\nwhen = '(x - 5)^2 - 1e-8'\ndirection = 'down'\nset = { m = 't' }";
    let outcome = both(text, 10.0);
    near(outcome.x[1], 79.0, 0.0);
    near(outcome.x[2], 5.0 - 1e-4, 1e-11);
    // A curve of degree 8 with triple zeros where x = 0, at pi/2 + k pi.
    let text = "states = ['x', 'v', 'm']\nstart = [1, 0, 0]\nf = ['v', '-x', '0']\n\
        [[event]]\nwhen = 'x^3*v + 0.2*x^8'\ndirection = 'up'\nset = { m = 'm + t' }";
    let outcome = follow(&model(text), &taylor(30.0, 1e-12), &mut |_| true).unwrap();
    assert_eq!(outcome.events, 10);
    near(outcome.x[2], 50.0 * std::f64::consts::PI, 1e-5);
}

/// An event at a zero of third order fires once: Newton's method ends before it.
#[test]
fn a_flat_zero_is_met_once() {
    // x = cos t passes zero ten times in 30; the event's expression rises there each time.
    let text = "states = ['x', 'v', 'm']\nstart = [1, 0, 0]\nf = ['v', '-x', '0']\n[[event]]\nwhen \
        = 'x^3*v + 0.2*x^8'\ndirection = 'up'\nset = { m = 'm + t' }";
    near(end(text, 30.0)[2], 50.0 * std::f64::consts::PI, 1e-6);
    let cubes = "states = ['x', 'n']\nstart = [-1, 0]\nf = ['1', '0']\n[[event]]\nwhen = '(x + \
        0.5)^5*(x - 0.5)^3'\ndirection = 'both'\nset = { n = 'n + 1' }";
    near(last(cubes, 2.0), 2.0, 0.0);
    // A zero that is only touched is not passed, even if it is zero to the last digit.
    let touched =
        "states = ['x', 'v', 'y']\nstart = [1, 0, 0]\nf = ['v', '-x', 'if(x^2*(2 + v) > 0, 1, 0)']";
    near(end(touched, 20.0)[2], 20.0, 1e-9);
    near(last("states = ['x', 'y']\nstart = [-1, 0]\nf = ['1', 'sign(3*x^2)']", 2.0), 2.0, 1e-12);
}

/// A surface that is slid upon may jump away, by another switch or by a table: the state stays in
/// place, and moves on from there.
#[test]
fn what_is_slid_upon_may_jump_away() {
    let from = |f: &str| format!("states = ['x', 'y']\nstart = [0.3, 0]\nf = ['{f}', '1']");
    for (f, t_end, want) in [
        ("-sign(x - if(t > 3.5, 2, -0.25))", 5.0, 1.25),
        ("-sign(x - if(y > 3.5, 2, -0.25))", 5.0, 1.25),
        ("-sign(x - 2*sign(y - 3.5))", 5.0, -0.5),
        ("-sign(x - heaviside(t - 3.5))", 4.0, 0.5),
        ("-2*sign(x - floor(t))", 2.2, 1.4),
        // It is met again, and slid upon.
        ("-2*sign(x - floor(t))", 2.8, 2.0),
        ("if(abs(x - floor(t)) < 0.2, -3, -2)*sign(x - floor(t))", 2.2, 1.4),
    ] {
        near(end(&from(f), t_end)[0], want, 1e-9);
    }
    // Two surfaces, of which one jumps.
    let two = "states = ['x', 'y', 'z']\nstart = [0.3, 0.2, 0]\nf = ['-sign(x - floor(z))', \
        '-sign(y) + 0.5*sin(t)', '1']";
    let found = end(two, 1.5);
    near(found[0], 0.5, 1e-9);
    near(found[1], 0.0, 1e-9);
    let follows = |f: &str| {
        let data = "t,u\n0,-1\n1,0.5\n2,-0.25\n3.5,2\n5,0\n6,0\n";
        let table =
            "[tables.u]\nfile = 'u.csv'\ntime = 't'\ncolumn = 'u'\ninterpolation = 'previous'";
        let model = model(&format!("states = ['x']\nstart = [0.3]\nf = ['{f}']\n{table}"))
            .with_table("u", data);
        run(&model.unwrap(), 6.0).1.unwrap().x[0]
    };
    near(follows("-sign(x - u)"), 0.25, 1e-9);
    // It slides on u + sin(t)/10 from 2.55 on, leaves it at 3.5 and reaches it no more.
    near(follows("-sign(x - u - 0.1*sin(t))"), -0.25 + 0.1 * 3.5_f64.sin() + 1.5 - 1.0, 1e-9);
}

/// The domain of what decides the field may end, though the field itself goes on: the run ends with
/// the expression. What only events ask, and branches that are not taken, have none.
#[test]
fn the_domain_of_a_switching_function_ends() {
    let ends = |f: &str, start: f64| {
        let text = format!("states = ['x', 'y']\nstart = [{start}, 0]\nf = ['{f}', '1']");
        match run(&model(&text), 3.0).1 {
            Err(HybridError::Domain { t, what, .. }) => (t, what),
            other => panic!("{f}: {other:?}"),
        }
    };
    for (f, start, at, words) in [
        (
            "if(sqrt(x) > 0.5, -1, -2)",
            1.0,
            0.875,
            "square root of a negative number, in the switching function sqrt(x) - 0.5",
        ),
        (
            "-1 - 0.5*tanh(sign(log(x) - 9))",
            1.0,
            1.0 / (1.0 - 0.5 * 1.0_f64.tanh()),
            "logarithm of a number that is not positive",
        ),
        ("if(sqrt(x) > 1, 1, 2)", -1.0, 0.0, "in the switching function sqrt(x) - 1"),
        ("mod(x, 0*t)", 0.0, 0.0, "in the switching function x/(0*t)"),
    ] {
        let (t, what) = ends(f, start);
        near(t, at, 1e-9);
        assert!(what.contains(words), "{what}");
    }
    for (f, start, want) in [
        ("if(x > 0, if(sqrt(x) > 0.5, -1, -2), -0.5)", 1.0, -0.5 * (3.0 - 0.875)),
        ("if(x > 0 and log(x) > -1, -1, -2)", 1.0, -4.0 - (-1.0_f64).exp()),
    ] {
        let text = format!(
            "states = ['x']\nstart = [{start}]\nf = ['{f}']\n[[event]]\nwhen = 'sqrt(x) - 9'\nset \
                = {{ x = 5 }}\n[[event]]\nwhen = 'log(x) > 4'\nset = {{ x = 5 }}"
        );
        near(end(&text, 3.0)[0], want, 1e-9);
    }
}

/// Conditions of a surface's other side are a part of sliding on it, and a condition that ends
/// sliding may be asked on one side only, or nowhere afterwards.
#[test]
fn sliding_sees_the_conditions_of_both_sides() {
    for f in [
        "if(x > 1 and t < 2, -1, 1)",
        "if(x > 1, if(t < 2, -1, 1), 1)",
        "if(x <= 1, 1, if(t >= 2, 1, -1))",
        "if(t < 2, -sign(x - 1), 1)",
        "if(t < 2, if(x > 1, -1, 1), 1)",
        "-sign(x - 1)*(t < 2) + (t >= 2)",
        "if(x > 1, -1, 1) + 2*(x > 1)*(t > 2)",
    ] {
        // It slides on x = 1 from t = 1 to 2.
        near(end(&format!("states = ['x']\nstart = [0]\nf = ['{f}']"), 4.0)[0], 3.0, 1e-12);
        near(end(&format!("states = ['x']\nstart = [0]\nf = ['{f}']"), 1.9)[0], 1.0, 1e-12);
    }
    // And rests where nothing moves it any more.
    near(
        end("states = ['x']\nstart = [0]\nf = ['if(t < 2, -sign(x - 1), 0)']", 4.0)[0],
        1.0,
        1e-12,
    );
    // Half of the time above x = 1, and a quarter from t = 2 on: y is the integral of 4 there.
    let mixed = |start: f64, condition: &str| {
        format!(
            "states = ['x', 'y', 'z']\nstart = [{start}, 0, 0]\n\
             f = ['if(x > 1, if({condition}, -1, -3), 1)', 'if(x > 1, 4, 0)', '1']"
        )
    };
    for condition in ["t < 2", "z < 2", "2 - t > 0", "not z >= 2"] {
        near(end(&mixed(0.0, condition), 4.0)[1], 4.0, 1e-9);
        // The condition changes long before it is asked for the first time.
        near(end(&mixed(-4.0, condition), 7.0)[1], 2.0, 1e-9);
    }
    // y rests on y = 0 until t = 2; then half of the time is above x = 0.
    let two = "states = ['x', 'y']\nstart = [-1, -0.5]\n\
        f = ['-sign(x)', 'if(t < 2, -sign(y), 1 + heaviside(x))']";
    let found = end(two, 3.0);
    near(found[0], 0.0, 1e-12);
    near(found[1], 1.5, 1e-9);
}

fn by_each_method(text: &str, t_end: f64) -> [Outcome; 4] {
    Method::ALL.map(|method| {
        // LSODA makes errors of the size of the tolerance in each of its many steps.
        let rtol = if method == Method::Lsoda { 1e-11 } else { 1e-10 };
        let options = Options { t_end, method, rtol, max_steps: 300_000, ..Options::default() };
        follow(&model(text), &options, &mut |_| true)
            .unwrap_or_else(|e| panic!("{method:?}: {e}\n{text}"))
    })
}

/// A step's error is measured by what a state is, not by what it was long ago or before a reset.
#[test]
fn states_that_become_small_keep_their_digits() {
    // The quadratic neuron, v = tan t between resets.
    for peak in [1e3, 1e5, 1e7, 1e9_f64] {
        let text = format!(
            "states = ['v']\nstart = [0]\nf = ['v^2 + 1']\n[[event]]\nwhen = 'v - {peak}'\n\
                direction = 'up'\nset = {{ v = '-{peak}' }}"
        );
        let period = 2.0 * peak.atan();
        let want = (100.0 - (100.0 / period).round() * period).tan();
        for outcome in by_each_method(&text, 100.0) {
            near(outcome.x[0], want, 3e-8);
        }
    }
    // Prey and predators (Volterra 1926) that fall to 1e-12 of their peaks and recover: the first
    // integral stays.
    let integral = |x: &[f64]| x[0] - x[0].ln() + x[1] - x[1].ln();
    let text = "states = ['x', 'y']\nstart = [30, 1]\nf = ['x*(1 - y)', 'y*(x - 1)']";
    for outcome in by_each_method(text, 100.0) {
        near(integral(&outcome.x), integral(&[30.0, 1.0]), 1e-7);
    }
    // Decay over 40 decades, and growth again.
    let text = "states = ['x', 'y']\nstart = [1, 0]\nf = ['if(t < 100, -x, x)', 'if(t > 190, x, \
        0)']";
    for outcome in by_each_method(text, 200.0) {
        near(outcome.x[0], 1.0, 2e-6);
        near(outcome.x[1], 1.0 - (-10.0_f64).exp(), 2e-6);
    }
    // A reset makes a large state small.
    let text = "states = ['x']\nstart = [1e9]\nf = ['-x']\n[[event]]\nat = [1]\nset = { x = \
        '1e-3' }";
    for outcome in by_each_method(text, 3.0) {
        near(outcome.x[0], 1e-3 * (-2.0_f64).exp(), 1e-11);
    }
}

/// At a rest whose speeds are sums that cancel, or where a state is zero, rounding does not shorten
/// the steps.
#[test]
fn rounding_at_a_rest_takes_no_steps() {
    for (f, dimension) in [
        ("'y', '0.3 - 0.1 - 0.2 - x - y'", 2),
        ("'y', 'z - 1 - x - y', '1 - z'", 3),
        ("'y', 'z', 'w', '0.3 - 0.1 - 0.2 - x - 4*y - 6*z - 4*w'", 4),
        ("'y', '-x - 0.5*y - 0.4*sign(y - 0.2)'", 2),
    ] {
        let states = ["'x'", "'y'", "'z'", "'w'"][..dimension].join(", ");
        let start = ["1", "0", "2", "1"][..dimension].join(", ");
        let text = format!("states = [{states}]\nstart = [{start}]\nf = [{f}]");
        for (outcome, most) in
            by_each_method(&text, 1000.0).iter().zip([10_000, 100_000, 1_000, 10_000])
        {
            assert!(outcome.steps < most, "{} steps: {text}", outcome.steps);
        }
    }
}

/// The end of a run by a method, or its error's words.
fn end_of(text: &str, t_end: f64, method: Method) -> Result<Vec<f64>, String> {
    let options = Options { t_end, method, ..Options::default() };
    follow(&model(text), &options, &mut |_| true).map(|o| o.x).map_err(|e| e.to_string())
}

/// Derivatives of resets whose expressions have kinks and jumps near, name terms, or see the time.
#[test]
fn resets_have_the_derivatives_of_the_side_that_they_are_on() {
    let slope = |start: f64, set: &str, rest: &str| {
        let model = model(&format!(
            "states = ['x']\nstart = [{start}]\nf = ['0']\n{rest}\n[[event]]\nname = 'e'\n\
                at = 0.5\nset = {{ x = '{set}' }}"
        ));
        let options = Options { t_end: 1.0, ..Options::default() };
        crate::motion::sensitivity::sensitivities(&model, &options, &[]).unwrap().by_start[0][0]
    };
    for (start, set, want) in [
        (0.49999, "mod(2*x, 1)", 2.0),
        (0.50001, "min(2*x, 2 - 2*x)", -2.0),
        (0.49999, "if(x < 0.5, 2*x, 2*(1 - x))", 2.0),
        (0.49999, "x + 10*heaviside(x - 0.5)", 1.0),
        (0.5, "atan2(x, 2) + floor(x)*x", 2.0 / 4.25),
    ] {
        near(slope(start, set, ""), want, 1e-12);
    }
    near(slope(0.25, "q + x*t", "[let]\nq = 'x^3'"), 3.0 * 0.0625 + 0.5, 1e-12);
}

#[test]
fn what_only_events_move_rests_if_they_do_not_move_it() {
    // The logistic map, once a unit of time: a fixed point at r = 2.8, a cycle of two at 3.2.
    let rests = |r: f64, t_end: f64| {
        let model = model(&format!(
            "states = ['x']\nstart = [0.3]\nf = ['0']\n[[event]]\nname = 'map'\nevery = 1\n\
                set = {{ x = '{r}*x*(1 - x)' }}"
        ));
        let options = Options { t_end, ..Options::default() };
        let longer = 0.05 * t_end;
        follow_to_rest(&model, &options, &mut |_| true, &|_| true, longer, &|s| 1e-6 * s).unwrap().1
    };
    assert!(!rests(2.8, 5.0) && rests(2.8, 200.0));
    assert!(!rests(3.2, 5.0) && !rests(3.2, 15.5) && !rests(3.2, 200.0));
}

#[test]
fn second_order_sliding_goes_on_under_a_disturbance() {
    // Twisting (Levant 1993): a position and its speed come to zero together and stay there while
    // r1 - r2 exceeds the disturbance; beyond r1 + r2 they are driven off.
    let twisting = |disturbance: &str| {
        format!(
            "states = [\"x\", \"v\", \"z\"]\nstart = [1, 0, 0]\n\
                f = [\"v\", \"-2*sign(x) - sign(v) + {disturbance}\", \"x + v + 1\"]"
        )
    };
    for method in [Method::Dopri5, Method::Radau5, Method::Lsoda] {
        let end = end_of(&twisting("0.3*sin(t)"), 20.0, method).unwrap();
        let later = end_of(&twisting("0.3*sin(t)"), 25.0, method).unwrap();
        assert_eq!((end[0], end[1]), (0.0, 0.0), "{method:?}");
        assert!((later[2] - end[2] - 5.0).abs() < 1e-9, "{method:?} {later:?}");
        // 0.2 t = 3 at t = 15: from there v' = 0.2 t - 3 and v = 0.1 (t - 15)^2.
        let end = end_of(&twisting("0.2*t"), 20.0, method).unwrap();
        assert!((end[1] - 2.5).abs() < 1e-9, "{method:?} {end:?}");
        assert!((end[0] - 12.5 / 3.0).abs() < 1e-9, "{method:?} {end:?}");
    }
    // Both axes at once, each with a disturbance of its own.
    let both = "states = [\"x\", \"v\", \"y\", \"w\"]\nstart = [1, 0, 0.5, 1]\n\
        f = [\"v\", \"-2*sign(x) - sign(v) + 0.3*sin(t)\", \"w\", \
            \"-3*sign(y) - sign(w) + 0.5*cos(t)\"]";
    assert_eq!(end_of(both, 20.0, Method::Dopri5).unwrap(), [0.0; 4]);
    // Turns that grow may begin at any time; where another state follows one of the signs alone,
    // mixtures that stay have different velocities.
    let grows = "states = [\"x\", \"v\", \"z\"]\nstart = [0, 0, 0]\n\
        f = [\"v\", \"-2*sign(x) + sign(v)\", \"1\"]";
    let words = end_of(grows, 1.0, Method::Dopri5).unwrap_err();
    assert!(words.contains("turn away by infinitely many switches"), "{words}");
    let open = "states = [\"x\", \"v\", \"z\"]\nstart = [1, 0, 0]\n\
        f = [\"v\", \"-2*sign(x) - sign(v) + 0.3*sin(t)\", \"sign(x)\"]";
    let words = end_of(open, 10.0, Method::Dopri5).unwrap_err();
    assert!(words.contains("mixtures of the fields have different"), "{words}");
    // A gain that falls to nothing: turns are equal at t = 10, and longer afterwards.
    let fades = "states = [\"x\", \"v\", \"z\"]\nstart = [1, 0, 0]\n\
        f = [\"v\", \"-2*sign(x) - (1 - 0.1*t)*sign(v)\", \"1\"]";
    assert_eq!(end_of(fades, 9.9, Method::Dopri5).unwrap()[..2], [0.0; 2]);
    assert!(end_of(fades, 10.1, Method::Dopri5).unwrap_err().contains("t = 10.0000000"));
}

#[test]
fn surfaces_that_depend_on_each_other_are_slid_upon_under_a_drift() {
    // Agents that move towards each other by signs, with gains (Cortes 2006): they meet, and their
    // mean goes on with the mean of their drifts.
    let agents = |k: f64, l: f64, m: f64, drift: &str| {
        format!(
            "states = [\"a\", \"b\", \"c\"]\nstart = [1, 0, 3]\nf = [\
                \"{k}*sign(b - a) + {l}*sign(c - a) + {drift}\", \
                \"{k}*sign(a - b) + {m}*sign(c - b) + 0.2*sin(t)\", \
                \"{l}*sign(a - c) + {m}*sign(b - c)\"]"
        )
    };
    for method in [Method::Dopri5, Method::Radau5] {
        for gains in [[1.0, 1.0, 1.0], [0.7, 1.3, 0.37]] {
            let [k, l, m] = gains;
            let end = end_of(&agents(k, l, m, "0.3"), 20.0, method).unwrap();
            let mean = (4.0 + 0.3 * 20.0 + 0.2 * (1.0 - 20_f64.cos())) / 3.0;
            assert!(end.iter().all(|x| (x - mean).abs() < 1e-8), "{method:?} {end:?} {mean}");
        }
        // A drift of more than 3 takes one of them away: 0.2 t from t = 15 on.
        let text = agents(1.0, 1.0, 1.0, "0.2*t").replace("0.2*sin(t)", "0");
        let end = end_of(&text, 18.0, method).unwrap();
        let met = 4.0 / 3.0 + 7.5;
        for (x, want) in end.iter().zip([met + 3.9, met + 3.0, met + 3.0]) {
            assert!((x - want).abs() < 1e-8, "{method:?} {end:?}");
        }
    }
}

/// Layers that are clipped beside a switch: on each side of what is slid upon the bounds are met
/// elsewhere, before and while the motion slides. From (1.08, -1.35) on the field of h < 0 leads
/// away, x' = 0.7 - 0.5 x.
#[test]
fn each_side_of_sliding_has_bounds_of_its_own() {
    let clipped = |u: &str, start: &str| {
        format!(
            "states = ['x', 'y']\nstart = {start}\nf = ['-0.5*x + clip({u}, -0.5, 0.7)', '-0.2']"
        )
    };
    let ways = [
        "if(x + 0.8*y < 0, 0.9 - x - 1.1*y, -0.7*x + 0.3*y - 0.9)",
        "if(x + 0.8*y >= 0, -0.7*x + 0.3*y - 0.9, 0.9 - x - 1.1*y)",
        "if(-0.2 > x + 0.8*y - 0.2, 0.9 - x - 1.1*y, -0.7*x + 0.3*y - 0.9)",
    ];
    for (start, t_end, left) in [("[0.8, -1]", 10.0, 1.75), ("[0.5, 1]", 20.0, 11.75)] {
        let want = 1.4 - 0.32 * f64::exp(-0.5 * (t_end - left));
        for u in ways {
            for method in Method::ALL {
                let end = end_of(&clipped(u, start), t_end, method).unwrap();
                assert!((end[0] - want).abs() < 1e-8, "{u} {start} {method:?} {end:?} {want}");
            }
        }
    }
    // Written by bounds of a sign, or by the values of both sides.
    let written = |u: &str| {
        format!(
            "states = ['x', 'y']\nstart = [0.856, 0.002]\n\
             f = ['-0.5*x + {u}', '0.6*y + x - 0.9']\n[let]\nh = '0.45 - x - 0.8*y'"
        )
    };
    let want = end_of(&written("if(h > 0, 0.7, -0.5)"), 3.0, Method::Dopri5).unwrap()[0];
    for method in Method::ALL {
        let end = end_of(&written("clip(sign(h), -0.5, 0.7)"), 3.0, method).unwrap();
        near(end[0], want, 1e-8);
    }
}

/// A condition that is false where the motion starts and true right after becomes true there; one
/// that holds at the start, or never, does not.
#[test]
fn a_condition_may_become_true_at_the_very_start() {
    for (when, v, want) in [
        ("x < 0", -1.0, 1),
        ("x < 0", 1.0, 0),
        ("x <= 0", -1.0, 0),
        ("x <= 0", 1.0, 0),
        ("not (x >= 0)", -1.0, 1),
        ("x < 0 and y > 3", -1.0, 0),
        ("x < 0 and y > 1", -1.0, 1),
        ("t > 0", 1.0, 1),
        ("t >= 0", 1.0, 0),
        ("x - 1 + 1 < 0", -1.0, 1),
    ] {
        for method in Method::ALL {
            let text = format!(
                "states = ['x', 'y', 'n']\nstart = [0, 2, 0]\nf = ['{v}', '0', '0']\n[[event]]\n\
                 when = '{when}'\nset = {{ n = 'n + 1' }}"
            );
            let end = end_of(&text, 1.0, method).unwrap();
            assert_eq!(end[2], f64::from(want), "{when} {v} {method:?}");
        }
    }
    // A ball thrown down at the floor bounces at once: up to 0.32 and back by t = 1.6.
    let ball = "states = ['x', 'v']\nstart = [0, -2]\nf = ['v', '-2']\n[[event]]\nwhen = 'x < 0'\n\
        set = { v = '-0.8*v' }";
    for method in Method::ALL {
        let end = end_of(ball, 2.0, method).unwrap();
        near(end[0], 1.28 * 0.4 - 0.16, 1e-9);
    }
}

/// Servers that attend to the longest queue: of the patterns of signs of x - y, x - z and y - z two
/// have no points, and no mixture has their fields. All queues shrink alike by what is served
/// beyond what arrives.
#[test]
fn sides_that_have_no_points_take_no_part() {
    let three = [
        "'0.2 - if(x > max(y, z), 1, 0)', '0.25 - if(y > max(x, z), 1, 0)', \
            '0.3 - if(z > max(x, y), 1, 0)'",
        "'0.2 - if(x >= max(y, z), 1, 0)', '0.25 - if(y > x and y >= z, 1, 0)', \
            '0.3 - if(z > x and z > y, 1, 0)'",
        "'0.2 - if(x > y and x > z, 1, 0)', \
            '0.25 - (1 - if(x > y and x > z, 1, 0))*if(y > z, 1, 0)', \
            '0.3 - (1 - if(x > y and x > z, 1, 0))*if(y > z, 0, 1)'",
    ];
    let one_after_the_other = [Method::Dopri5, Method::Radau5, Method::Lsoda];
    for method in one_after_the_other {
        for f in three {
            let text = format!("states = ['x', 'y', 'z']\nstart = [3, 2, 1.5]\nf = [{f}]");
            let end = end_of(&text, 9.0, method).unwrap();
            assert!(end.iter().all(|x| (x - 4.25 / 3.0).abs() < 1e-12), "{method:?} {end:?}");
        }
        // From t = 5.75 on the other two take all of the service: z grows by less than they shrink.
        let text = format!("states = ['x', 'y', 'z']\nstart = [3, 2, 1.5]\nf = [{}]", three[0])
            .replace("0.3 -", "0.3 - 0.1*t -");
        let end = end_of(&text, 12.0, method).unwrap();
        let z = |t: f64| 0.3 * t - 0.05 * t * t;
        let met = (6.5 + 0.45 * 5.75 + z(5.75) - 5.75) / 3.0;
        let want = [met - 0.275 * 6.25, met - 0.275 * 6.25, met + z(12.0) - z(5.75)];
        for (x, want) in end.iter().zip(want) {
            assert!((x - want).abs() < 1e-7, "{method:?} {end:?} {want}");
        }
        let four = "states = ['x', 'y', 'z', 'w']\nstart = [3, 2, 1.5, 1]\nf = [\
            '0.2 - if(x > max(max(y, z), w), 1, 0)', '0.15 - if(y > max(max(x, z), w), 1, 0)', \
            '0.1 - if(z > max(max(x, y), w), 1, 0)', '0.22 - if(w > max(max(x, y), z), 1, 0)']";
        let end = end_of(four, 12.0, method).unwrap();
        assert!(end.iter().all(|x| (x - 0.885).abs() < 1e-12), "{method:?} {end:?}");
    }
}

/// Robertson's reactions (1966), which ODEPACK's LSODA is shown by: the sum of the three is kept,
/// the event marks the time of a tenth, and a dose then restarts them.
#[test]
fn stiff_reactions_with_an_event() {
    let text = "states = ['x', 'y', 'z', 'marked']\nstart = [1, 0, 0, 0]\n\
        f = ['-0.04*x + 1e4*y*z', '0.04*x - 1e4*y*z - 3e7*y^2', '3e7*y^2', '0']\n[[event]]\n\
        when = 'z - 0.1'\ndirection = 'up'\nset = { marked = 't' }";
    let by = |text: &str, method: Method, rtol: f64, max_steps: u64| {
        let options = Options { t_end: 40.0, method, rtol, max_steps, ..Options::default() };
        follow(&model(text), &options, &mut |_| true)
    };
    let exact = by(text, Method::Radau5, 1e-12, 50_000).unwrap();
    let found = by(text, Method::Lsoda, 1e-10, 2_000).unwrap();
    for (found, exact) in found.x.iter().zip(&exact.x) {
        near(*found, *exact, 1e-8 * exact);
    }
    near(found.x[..3].iter().sum(), 1.0, 1e-12);
    // The digits that ODEPACK's documentation prints.
    near(found.x[0], 7.158e-1, 5e-5);
    near(found.x[1], 9.185e-6, 1e-9);
    assert!(matches!(
        by(text, Method::Dopri5, 1e-10, 20_000),
        Err(HybridError::Budget { steps: 20_000, .. })
    ));
    // Half of z is taken away at the event.
    let dosed = text.replace("marked = 't'", "marked = 't', z = '0.5*z'");
    let (exact, found) = (
        by(&dosed, Method::Radau5, 1e-12, 50_000).unwrap(),
        by(&dosed, Method::Lsoda, 1e-10, 4_000).unwrap(),
    );
    assert!(exact.events > 1 && exact.events == found.events);
    near(found.x[0], exact.x[0], 1e-8);
}

/// Modes, sticking and slipping, and many switches by the multistep method, whose history ends at
/// each.
#[test]
fn multistep_history_ends_where_the_field_changes() {
    let follow_by = |text: &str, t_end: f64, rtol: f64| {
        let options = Options { t_end, rtol, method: Method::Lsoda, ..Options::default() };
        follow(&model(text), &options, &mut |_| true).unwrap_or_else(|e| panic!("{e}\n{text}"))
    };
    // A mode with hysteresis on a fast relaxation towards 1 and -1; y sees only which it is.
    let text = "states = ['x', 'y']\nstart = [0, 0]\n[modes.up]\nf = ['1 - x', '1']\n\
        [modes.down]\nf = ['-1 - x', '-1']\n[[event]]\nwhen = 'x - 0.5'\ndirection = 'up'\n\
        mode = 'down'\n[[event]]\nwhen = 'x + 0.5'\ndirection = 'down'\nmode = 'up'";
    // ln 2 to the first switch, then ln 3 each: at 20 ln 3 after it y is ln 2 again.
    let t_end = 2.0_f64.ln() + 20.0 * 3.0_f64.ln() - 1e-6;
    let outcome = follow_by(text, t_end, 1e-11);
    assert_eq!(outcome.events, 20);
    near(outcome.x[1], 2.0_f64.ln() - 1e-6, 1e-8);
    // Stick and slip on a moving belt: it sticks until x = 1, and slips about that.
    let belt = "states = ['x', 'v']\nstart = [0, 0.2]\nf = ['v', '-x - sign(v - 0.2)']";
    let outcome = follow_by(belt, 8.0, 1e-11);
    near(outcome.x[0], 1.0 + 0.2 * 3.0_f64.sin(), 1e-9);
    near(outcome.x[1], 0.2 * 3.0_f64.cos(), 1e-9);
    // Ten turns of an oscillator, and twice as many switches of no consequence to it.
    let circle = "states = ['x', 'v', 'n']\nstart = [1, 0, 0]\nf = ['v', '-x', 'sign(x)']";
    let turns = 20.0 * std::f64::consts::PI;
    let outcome = follow_by(circle, turns, 1e-12);
    near(outcome.x[0], 1.0, 1e-8);
    near(outcome.x[2], 0.0, 1e-8);
}

#[test]
fn tangent_vectors_name_the_methods_that_carry_none() {
    let circle = model("states = ['x', 'v']\nstart = [1, 0]\nf = ['v', '-x']");
    for method in [Method::Radau5, Method::Taylor, Method::Lsoda] {
        let options = Options { method, ..Options::default() };
        let error = crate::motion::tangent::exponents(&circle, &options, 1.0, 1);
        let error = error.unwrap_err().to_string();
        assert!(error.contains(&format!("--method {}", method.name())), "{error}");
        assert!(error.contains("carried by dopri5"), "{error}");
    }
}

/// Balls on vibrating tables whose impacts accumulate, at last in flights that rounding hides: they
/// stick until the table falls away, and are never below it.
#[test]
fn contacts_hold_where_flights_end_in_rounding() {
    for (r, a) in [(0.2, 1.2), (0.1, 1.8), (0.3, 1.8), (0.5, 1.8), (0.1, 2.2), (0.0, 1.5)] {
        let text = format!(
            "states = ['x', 'v']\nstart = [2.0, -0.6]\nf = ['v', '-1']\n[[event]]\n\
             when = 'x - {a}*sin(t)'\ndirection = 'down'\n\
             set = {{ v = '-{r}*v + {}*cos(t)' }}\nafter_zeno = 'stick'",
            (1.0 + r) * a
        );
        for method in [Method::Dopri5, Method::Radau5, Method::Taylor] {
            let record = Record::Times { every: 0.37 };
            let options = Options { t_end: 100.0, method, record, ..Options::default() };
            let mut least = f64::INFINITY;
            let outcome = follow(&model(&text), &options, &mut |p| {
                least = least.min(p.x[0] - a * p.t.sin());
                true
            });
            assert!(least > -1e-8, "{r} {a} {method:?}: {least} {outcome:?}");
            assert_eq!(outcome.unwrap().ending, Ending::Finished, "{r} {a} {method:?}");
        }
    }
}

/// A body at a stop is let go at pi/2 by a force that grows from zero: x = 3 cos t + 3 (t - pi/2).
#[test]
fn contacts_open_as_a_cube_leaves_zero() {
    let text = |set: &str| {
        format!(
            "states = ['x', 'v']\nstart = [0.5, 0]\nf = ['v', '-3*cos(t)']\n[[event]]\n\
             when = 'x'\ndirection = 'down'\nset = {{ v = {set} }}\nafter_zeno = 'stick'"
        )
    };
    for set in ["0", "'0*v'"] {
        for method in [Method::Dopri5, Method::Radau5, Method::Taylor] {
            for t_end in [3.0, 30.0] {
                let record = Record::Times { every: 3.0 };
                let options = Options { t_end, method, record, ..Options::default() };
                let mut found = f64::NAN;
                let outcome = follow(&model(&text(set)), &options, &mut |p| {
                    found = if p.t == 3.0 { p.x[0] } else { found };
                    true
                });
                outcome.unwrap_or_else(|e| panic!("{set} {method:?} {t_end}: {e}"));
                let want = 3.0 * 3.0_f64.cos() + 3.0 * (3.0 - std::f64::consts::FRAC_PI_2);
                near(found, want, 1e-8);
            }
        }
    }
}

/// A blow at an event's zero is met at once: by a wall that is touched, and by the third ball of a
/// cradle, there and back.
#[test]
fn what_lies_at_an_events_zero_is_not_struck_through_it() {
    let wall = "states = ['x', 'v']\nstart = [0, 0]\nf = ['v', '0']\n[[event]]\nat = 1\n\
        set = { v = 1 }\n[[event]]\nwhen = 'x'\ndirection = 'up'\nset = { v = '-v' }";
    let cradle = "states = ['a', 'va', 'b', 'vb', 'c', 'vc']\nstart = [-1, 0, 1, 0, 2, 0]\n\
        f = ['va', '-a', 'vb', '-(b - 1)', 'vc', '-(c - 2)']\n[[event]]\nwhen = 'b - a - 1'\n\
        direction = 'down'\nset = { va = 'vb', vb = 'va' }\n[[event]]\nwhen = 'c - b - 1'\n\
        direction = 'down'\nset = { vb = 'vc', vc = 'vb' }";
    for method in [Method::Dopri5, Method::Radau5, Method::Taylor] {
        let x = |text: &str, t_end| end_of(text, t_end, method).unwrap();
        near(x(wall, 3.0)[0], -2.0, 1e-12);
        for (direction, want) in [("", -2.0), ("\ndirection = 'down'", 2.0)] {
            let text = wall.replace("\ndirection = 'up'", direction);
            near(x(&text, 3.0)[0], want, 1e-12);
        }
        let (there, back) = (x(cradle, 3.0), x(cradle, 6.0));
        near(there[2], 1.0, 1e-9);
        near(there[4], 2.0 - 3.0_f64.cos(), 1e-8);
        near(back[0], -6.0_f64.cos(), 1e-8);
        near(back[4], 2.0, 1e-8);
    }
}

/// A state at rest that grows like a high power of the time: the beads before a wave, whose forces
/// are so small that their squares are no numbers, and Bouc and Wen's hysteresis, a root of what is
/// zero. SciPy's DOP853 at 1e-13.
#[test]
fn high_powers_of_time_leave_rest() {
    let chain = |n: usize| {
        let all = |f: &dyn Fn(usize) -> String| (0..n).map(f).collect::<Vec<_>>().join(", ");
        let force = |i: usize| format!("max(x{i} - x{}, 0)^1.5", i + 1);
        let speed = |i: usize| {
            let left = if i > 0 { force(i - 1) } else { "0".into() };
            let right = if i + 1 < n { force(i) } else { "0".into() };
            format!("'{left} - {right}'")
        };
        format!(
            "states = [{}, {}]\nstart = [{}, 1, {}]\nf = [{}, {}]",
            all(&|i| format!("'x{i}'")),
            all(&|i| format!("'v{i}'")),
            all(&|_| "0".into()),
            (1..n).map(|_| "0").collect::<Vec<_>>().join(", "),
            all(&|i| format!("'v{i}'")),
            all(&speed)
        )
    };
    let bouc = "states = ['x', 'v', 'z']\nstart = [0, 0, 0]\nf = ['v', 'sin(t) - 0.1*v - z', \
        'v - 0.5*abs(v)*abs(z)^0.5*z - 0.5*v*abs(z)^1.5']";
    let at = |text: &str, t_end: f64, method: Method| {
        let options = Options { t_end, method, ..Options::default() };
        follow(&model(text), &options, &mut |_| true).unwrap().x
    };
    let x = at(&chain(10), 20.0, Method::Dopri5);
    near(x[0], -0.0511887025, 1e-8);
    near(x[9], 9.1330508803, 1e-8);
    near(x[19], 0.9858658664, 1e-8);
    for method in [Method::Dopri5, Method::Radau5, Method::Lsoda] {
        let x = at(&chain(4), 10.0, method);
        near(x[0], 0.6596614754, 1e-8);
        near(x[3], 6.3419326816, 1e-8);
        near(x[7], 0.9909725727, 1e-8);
        let x = at(bouc, 10.0, method);
        near(x[0], 1.50006331, 1e-7);
        near(x[2], 0.97082131, 1e-7);
    }
}

/// Roots that are left from zero, as of tanks that fill: on the way stages are no numbers, or the
/// motion has no Taylor series. Closed forms, and SciPy's Radau at 1e-12.
#[test]
fn roots_are_left_from_zero_by_every_method() {
    let tanks = "'min(t, 1) - sqrt(max(a, 0))', 'sqrt(max(a, 0)) - sqrt(max(b, 0))'";
    let steady = "'0.5 - sqrt(max(a, 0))', 'sqrt(max(a, 0)) - sqrt(max(b, 0))'";
    let joined = "'0.5 - sign(a - b)*sqrt(abs(a - b))', 'sign(a - b)*sqrt(abs(a - b)) - \
        sqrt(max(b, 0))'";
    let cases: [(&str, &[f64]); 7] = [
        ("'t - sqrt(max(a, 0))'", &[6.25]),
        ("'t - sqrt(abs(a))*sign(a)'", &[6.25]),
        ("'t + sqrt(abs(a))'", &[25.0]),
        (tanks, &[0.9161573345, 0.7513275734]),
        (steady, &[0.2487590840, 0.2430745282]),
        (joined, &[0.4474707841, 0.2177664211]),
        ("'1', 'max(a, 0)^1.5 - abs(b)^2.5'", &[5.0, 2.5958512081]),
    ];
    for method in Method::ALL {
        for (field, ends) in cases {
            let n = ends.len();
            let (states, start) = (["'a'", "'b'"][..n].join(", "), ["0", "0"][..n].join(", "));
            let text = format!("states = [{states}]\nstart = [{start}]\nf = [{field}]");
            let options = Options { t_end: 5.0, method, ..Options::default() };
            let outcome = follow(&model(&text), &options, &mut |_| true);
            let outcome = outcome.unwrap_or_else(|e| panic!("{method:?} {field}: {e}"));
            outcome.x.iter().zip(ends).for_each(|(x, end)| near(*x, *end, 2e-9));
        }
    }
}

/// A pole is no root that implicit steps may leave: no method goes on beyond it.
#[test]
fn no_method_crosses_a_pole() {
    let poles =
        [("x^2", 1.0), ("1 + x^2", 0.0), ("1/(1 - t)", 0.0), ("-1/sqrt(x)", 1.0), ("-1/x", 1.0)];
    for method in Method::ALL {
        for (f, start) in poles {
            let text = format!("states = ['x']\nstart = [{start}]\nf = ['{f}']");
            let options = Options { t_end: 5.0, method, ..Options::default() };
            let said = follow(&model(&text), &options, &mut |_| true).unwrap_err().to_string();
            assert!(said.contains("leaves the domain"), "{method:?} {f}: {said}");
        }
    }
}

/// Falls into a centre, which end in finite time at a speed that grows without bound: steps there
/// are as short as the time's rounding, in which the speed's own growth is no size of it.
#[test]
fn falls_into_a_centre_end() {
    let falls = [
        "['v', '-1/x']",
        "['v', '-1/x^3']",
        "['v', '-3/x^2']",
        "['v', '-1/x + 0.2*cos(t)']",
        "['v', '-1/abs(x)^1.5']",
    ];
    for method in Method::ALL {
        for f in falls {
            for start in ["[1, 0]", "[0.5, 0]", "[0.73, -0.3]", "[2, 0]"] {
                let text = format!("states = ['x', 'v']\nstart = {start}\nf = {f}");
                let said = end_of(&text, 12.0, method).unwrap_err();
                assert!(said.contains("leaves the domain"), "{method:?} {f} {start}: {said}");
            }
        }
        for start in ["[1, 0, 0, 0]", "[0.7, 0, 0, 0]", "[2, 1, 0, 0]", "[3, -2, 0, 0]"] {
            let text = format!(
                "states = ['x', 'y', 'u', 'v']\nstart = {start}\n\
                f = ['u', 'v', '-x/(x^2 + y^2)^1.5', '-y/(x^2 + y^2)^1.5']"
            );
            let said = end_of(&text, 15.0, method).unwrap_err();
            assert!(said.contains("leaves the domain"), "{method:?} {start}: {said}");
        }
    }
}

/// Poles that the motion runs over at a finite speed, where steps end up as short as rounding: of
/// each end of a run, since where steps fall depends on it.
#[test]
fn poles_beside_the_motion_are_not_passed() {
    let poles = [
        "1/(x - 1)",
        "1/abs(x - 1)",
        "1/(x - 1)^2",
        "tan(x)",
        "tan(t)",
        "1/sin(3*x)",
        "x/(x^2 - 1)",
        "1/(t - 1)",
        "1e-6/(x - 1)",
        "1e6/(x*x*x - 1)",
        "if(y > 100, 0, 1/(1 - x))",
    ];
    for method in Method::ALL {
        for f in poles {
            for (start, t_end) in [(0.1, 3.0), (0.1, 2.2), (0.037, 4.7), (-1.0 / 3.0, 2.9)] {
                let text = format!("states = ['x', 'y']\nstart = [{start}, 1]\nf = ['1', '{f}']");
                let said = end_of(&text, t_end, method);
                let refused = said.as_ref().is_err_and(|said| said.contains("leaves the domain"));
                assert!(refused, "{method:?} {f} to {t_end}: {said:?}");
            }
        }
        for f in ["acos(x)", "(1 - x)^0.5", "1 + 0*sqrt(1 - t)"] {
            let text = format!("states = ['x', 'y']\nstart = [0.13, 0]\nf = ['1', '{f}']");
            let said = end_of(&text, 2.0, method).unwrap_err();
            assert!(said.contains("leaves the domain"), "{method:?} {f}: {said}");
        }
        // Continued through a zero of its divisor a quotient has no pole, whatever the scale.
        for (f, want) in [
            ("sin(x - 1)/(x - 1)", 2.465_9),
            ("(x^2 - 1)/(x - 1)", 7.395),
            ("1/(2 + sin(30*x))", 1.674),
            ("1e9*(x - 1)/abs(2*x - 2)", 5.5e8),
        ] {
            let text = format!("states = ['x', 'y']\nstart = [0.1, 0]\nf = ['1', '{f}']");
            let end = end_of(&text, 2.9, method).unwrap_or_else(|e| panic!("{method:?} {f}: {e}"));
            near(end[1], want, 1e-2 * want);
        }
    }
}

/// A layer of regularisation that ends at a kink or an event, far thinner than the steps beside it:
/// closed forms, z = a - K ln((a + K)/K) for both sides of a.
#[test]
fn thin_layers_beside_a_kink_are_seen() {
    for method in Method::ALL {
        for k in [1e-8, 1e-9, 1e-10, 1e-12_f64] {
            let side = |a: f64| a - k * ((a + k) / k).ln();
            for (f, want) in [
                (format!("abs(x)/(abs(x) + {k:e})"), side(0.73) + side(1.0)),
                (format!("max(x, 0)/(max(x, 0) + {k:e})"), side(1.0)),
                (format!("abs(t - 0.73)/({k:e} + abs(0.73 - t))"), side(0.73) + side(1.0)),
            ] {
                let text = format!("states = ['x', 'z']\nstart = [-0.73, 0]\nf = ['1', '{f}']");
                let end = end_of(&text, 1.73, method).unwrap();
                near(end[1], want, 1e-8);
            }
            let event = format!(
                "states = ['x', 'z']\nstart = [-0.73, 0]\nf = ['1', '-x/(-x + {k:e})']\n\
                    [[event]]\nwhen = 'x'\nstop = true"
            );
            let options = Options { t_end: 2.0, method, ..Options::default() };
            let outcome = follow(&model(&event), &options, &mut |_| true).unwrap();
            near(outcome.x[1], side(0.73), 1e-8);
        }
        // Rounding errors of a state that has come to nothing allow no step across a pole.
        let uptake = "states = ['x']\nstart = [1]\nf = ['-x/(x + 1e-6) + 0.4*heaviside(t - 5)']";
        near(end_of(uptake, 5.5, method).unwrap()[0], 2e-6 / 3.0, 1e-11);
        // Attraction by a unit force: quarters of sqrt(2) time units.
        let force = "states = ['x', 'v']\nstart = [1, 0]\nf = ['v', '-x/(abs(x) + 1e-9)']";
        let end = end_of(force, 2.0 * 2.0_f64.sqrt(), method).unwrap();
        near(end[0], -1.0, 1e-6);
    }
}

/// Steep friction: SciPy's DOP853 at 1e-13 with the layer of 1e-12 as a switch.
#[test]
fn friction_of_any_steepness_is_a_switch() {
    for method in Method::ALL {
        for k in ["1e-6", "1e-9", "1e-12"] {
            let text =
                format!("states = ['x', 'v']\nstart = [3, 0]\nf = ['v', '-x - 0.3*tanh(v/{k})']");
            let end = end_of(&text, 9.0, method).unwrap();
            near(end[0], -1.066_695_392_6, 2e-6);
            near(end[1], -0.618_177_727_8, 2e-6);
        }
    }
}

/// Jumps of a bounded function over a pole of its argument, and terms that overflow on the way to
/// nothing: by quadrature.
#[test]
fn poles_and_overflows_inside_bounded_functions_are_followed() {
    for method in Method::ALL {
        for (f, start, t_end, want) in [
            ("tanh(1/(x - 0.3))", 1.0, 3.0, -0.970_945_69),
            ("erf(1/(x - 0.3))", 1.0, 10.0, -2.625_461_21),
            ("tanh(tan(t))", 1.0, 10.0, 0.165_004_60),
            ("1/(1 + exp(-1e6*(x - 0.3)))", 1.0, 3.0, 0.7),
            ("1/(1 + exp(-100*(1 - t)))", 1.0, 10.0, 1.0),
            ("1/(1 + exp(-1000*sin(t)))", 1.0, 10.0, 6.282_492_16),
            ("1/cosh(t)", 1.0, 1000.0, std::f64::consts::FRAC_PI_2),
            ("1/(1 + t^64*t^64)", 1.0, 10.0, 1.000_100_41),
        ] {
            let text = format!("states = ['x', 'z']\nstart = [{start}, 0]\nf = ['-1', '{f}']");
            let end = end_of(&text, t_end, method).unwrap_or_else(|e| panic!("{method:?} {e}"));
            near(end[1], want, 1e-7);
        }
        let lost = "states = ['x', 'z']\nstart = [1, 0]\n\
            f = ['-1', 'sinh(800*(x - 0.3))/cosh(800*(x - 0.3))']";
        assert!(end_of(lost, 3.0, method).unwrap_err().contains("leaves the domain"));
    }
}

/// Switching functions that change their sign at poles, too, and starts beside one: by quadrature.
#[test]
fn switches_over_a_divisor_switch_at_its_zeros() {
    let pi = std::f64::consts::PI;
    for method in Method::ALL {
        for (f, t_end, want) in [
            ("sign(tan(t))", 10.0, 10.0 - 3.0 * pi),
            ("if(tan(t) > 1, 1, 0)", 10.0, 0.75 * pi),
            ("heaviside(1/(t - 1) - 2)", 3.0, 0.5),
            ("heaviside(2 - 1/(t - 1))", 3.0, 2.5),
            ("if(t/(t - 1) > 3, 1, 0)", 3.0, 0.5),
            ("heaviside(r - 2)", 3.0, 0.5),
            ("if(1/(t - 1)^2 > 4, 1, 0)", 3.0, 1.0),
            ("clip(tan(t), -1, 1)", 10.0, 0.175_459_321_0),
        ] {
            let text = format!("states = ['z']\nstart = [0]\nf = ['{f}']\n[let]\nr = '1/(t - 1)'");
            let end = end_of(&text, t_end, method).unwrap_or_else(|e| panic!("{method:?} {e}"));
            near(end[0], want, 1e-8);
        }
        for e in [1e-8, 1e-10, 1e-12_f64] {
            let text = format!("states = ['x']\nstart = [0]\nf = ['1/(x + {e:e})']");
            // (The first step of dopri5 errs where it is the steepest: notes/defects.md.)
            let within = if e < 1e-11 && method == Method::Dopri5 { 1e-4 } else { 1e-7 };
            near(end_of(&text, 2.0, method).unwrap()[0], (e * e + 4.0).sqrt() - e, within);
        }
    }
}

/// Poles are no rests, and zeros of high order are.
#[test]
fn rests_are_zeros_of_any_order_and_no_poles() {
    let rests = |f: &str| -> Vec<f64> {
        let model = model(&format!("states = ['x']\nf = ['{f}']"));
        crate::rests::rests(&model, &[(-4.0, 4.0)]).unwrap().iter().map(|r| r.x[0]).collect()
    };
    let pi = std::f64::consts::PI;
    for (f, want) in [
        ("-tan(x)", &[-pi, 0.0, pi][..]),
        ("ln(abs(x - 0.3))", &[-0.7, 1.3]),
        ("x/(x - 1)", &[0.0]),
        ("1/(x - 1)", &[]),
        ("-(x - 1)^5", &[1.0]),
        ("(x - 0.37)^4", &[0.37]),
        ("(x - 0.37)^3*(x + 1)", &[-1.0, 0.37]),
    ] {
        let found = rests(f);
        assert_eq!(found.len(), want.len(), "{f}: {found:?}");
        found.iter().zip(want).for_each(|(x, want)| near(*x, *want, 1e-9));
    }
}

/// On the axis to the left the angle is pi, in equations as in numbers; what has no sign has none
/// in a reset.
#[test]
fn zero_has_no_side_in_angles_and_resets() {
    for method in Method::ALL {
        for f in ["atan2(0, -1)", "atan2(y, x - 10)", "atan2(0*t, -1)"] {
            let text = format!("states = ['x', 'y']\nstart = [0, 0]\nf = ['{f}', '0']");
            near(end_of(&text, 1.0, method).unwrap()[0], std::f64::consts::PI, 1e-9);
        }
    }
    let reset = "states = ['x', 'y']\nstart = [0, 0]\nf = ['1', '0']\n[[event]]\nat = 0.5\n\
        set = { x = '3 + sign(y)' }";
    near(end(reset, 0.5)[0], 3.0, 0.0);
}

/// Force as a function of place with an edge where it is continuous: SciPy's DOP853 at 1e-13. The
/// motion runs along the edge from outside, where sides and rounding are the same thing.
#[test]
fn edges_of_continuous_conditions_are_kinks() {
    let text = "states = ['x', 'v']\nstart = [2, 0.5]\n\
        f = ['v', 'if(abs(s) < 0.02, -50*s, -sign(s))']\n[let]\ns = 'x + v*abs(v)/2'";
    for method in Method::ALL {
        let end = end_of(text, 8.0, method).unwrap();
        near(end[0], -0.001_934_968_164, 1e-9);
        near(end[1], 0.012_128_743_98, 1e-9);
    }
    // Events are met however continuous the fields are, and a jump that vanishes at one point is
    // one.
    let asked = "states = ['x']\nstart = [0]\nf = ['if(x > 1, 1, x + 1 - x)']\n[[event]]\n\
        when = 'x > 1'\nstop = true";
    let outcome = run(&model(asked), 3.0).1.unwrap();
    near(outcome.t, 1.0, 1e-12);
    let point = "states = ['x', 'y']\nstart = [0.1, -1]\nf = ['if(x > 0, y, -y)', '1']";
    for method in Method::ALL {
        // Sliding on x = 0 from y = -0.9 to 0, where it is left to either side.
        assert!(end_of(point, 3.0, method).unwrap_err().contains("not decided"));
    }
}

/// The longer of three queues are served: comparisons with the greatest of several have the
/// surfaces on which they change, and no others.
#[test]
fn the_longest_queue_is_served() {
    let text = "states = ['x', 'y', 'z']\nstart = [3, 2, 1]\n\
        f = ['0.3 - if(x >= max(y, z), 1, 0)', '0.3 - if(y - max(x, z) > 0, 1, 0)',\n\
        '0.3 - if(0 < z - max(x, y), 1, 0)']";
    for method in Method::ALL {
        // The longest alone falls to 2.3, two together to 1.9 at t = 3.
        for (t, want) in [(1.5, [2.2, 2.2, 1.45]), (2.9, [1.92, 1.92, 1.87])] {
            let end = end_of(text, t, method).unwrap();
            end.iter().zip(want).for_each(|(end, want)| near(*end, want, 1e-9));
        }
    }
    let of = |text: &str| {
        let text =
            format!("states = ['x', 'y', 'z']\nstart = [3, 2, 1]\nf = [\"{text}\", '0', '0']");
        let equation = crate::Equation::new(&model(&text), None).unwrap();
        equation.switching_functions()
    };
    assert_eq!(of("if(x < min(y, z), 1, 2)"), ["y - x", "z - x"]);
    assert_eq!(of("if(max(x, y) > min(1, z), 1, 2)"), ["x - 1", "x - z", "y - 1", "y - z"]);
    assert_eq!(of("max(x, y)"), ["y - x"]);
}

/// Roots that begin or end at a switch written with `if`: weirs, contacts after Hertz. By SciPy's
/// DOP853 at 1e-13, and t = -2 u - ln(1 - 2 u) with u^2 = S - 1/2.
#[test]
fn roots_begin_and_end_at_conditions() {
    let weir =
        |start: f64, force: &str| format!("states = ['S']\nstart = [{start}]\nf = ['{force}']");
    let last = |text: &str, t: f64, method: Method| {
        *end_of(text, t, method)
            .unwrap_or_else(|e| panic!("{method:?}: {e}\n{text}"))
            .last()
            .unwrap()
    };
    let gauge = "states = ['S', 'Q']\nstart = [0, 0]\n\
        f = ['0.5', 'if(S > 0.5, (S - 0.5)^1.5, 0) - Q']";
    let contact = "states = ['v', 'x']\nstart = [0, 0.4159]\n\
        f = ['1 - if(x > 0.5, 50*(x - 0.5)^1.5*(1 + 0.3*v), 0) - 0.1*v', 'v']";
    for method in Method::ALL {
        near(last(gauge, 3.0, method), 0.489_995_53, 1e-8);
        near(last(contact, 3.0, method), 0.517_126_98, 1e-8);
        let falls = "-0.5 - if(S > 0.5, 2*(S - 0.5)^1.5, 0)";
        near(last(&weir(0.7, falls), 3.0, method), -0.823_524_72, 1e-8);
        near(
            last(&weir(0.3298, "0.5 - sqrt(max(S - 0.5, 0))"), 3.0, method),
            0.736_958_505_6,
            1e-9,
        );
        for i in 0..40 {
            let start = 0.01 + 0.0103 * f64::from(i);
            let rises = ["if(S > 0.5, sqrt(S - 0.5), 0)", "sqrt(max(S - 0.5, 0))"];
            let [one, other] =
                rises.map(|flow| last(&weir(start, &format!("0.5 - {flow}")), 3.0, method));
            near(one, other, 1e-9);
        }
    }
    // No switch is at the end of this root's domain.
    for method in Method::ALL {
        let error = end_of(&weir(0.0, "1 + sqrt(1 - S)"), 3.0, method).unwrap_err();
        assert!(error.contains("leaves the domain"), "{method:?}: {error}");
    }
}

/// A condition about what stays equal, up to rounding, is not met again and again.
#[test]
fn conditions_about_what_stays_equal_rest() {
    let text = "states = ['u', 'y']\nstart = [0.5, 0.1]\nf = ['cos(t)', 'cos(t)']\n[[event]]\n\
        when = 'u - y > 0.4'\nset = { u = 'u' }";
    let play = "states = ['u', 'y']\nstart = [0, 0]\n[modes.free]\nf = ['cos(t)', '0']\n\
        [modes.up]\nf = ['cos(t)', 'cos(t)']\n[[event]]\nwhen = 'u - y > 0.4'\n\
        from = 'free'\nmode = 'up'\n[[event]]\nwhen = 'cos(t) < 0'\nfrom = 'up'\nmode = 'free'";
    for method in Method::ALL {
        let end = end_of(text, 3.0, method).unwrap();
        near(end[0], 0.5 + 3.0_f64.sin(), 1e-8);
        // The play's own way is that of u less 0.4, up to u = 1.
        let end = end_of(play, 3.0, method).unwrap();
        near(end[1], 0.6, 1e-8);
    }
}

/// A condition on a surface that is slid upon sees equality, whichever way the equations write it.
#[test]
fn conditions_see_equality_where_motion_slides() {
    let counted = |f: &str, from: f64, when: &str, method: Method| {
        let text = format!(
            "states = ['h', 'n']\nstart = [{from}, 0]\nf = ['{f}', '0']\n[[event]]\n\
             when = '{when}'\nset = {{ n = 'n + 1' }}"
        );
        end_of(&text, 4.0, method).unwrap()[1]
    };
    for method in Method::ALL {
        for f in ["-sign(h - 1)", "sign(1 - h)", "if(h < 1, 1, -1)", "2*heaviside(1 - h) - 1"] {
            for (from, when, want) in [
                (0.0, "h >= 1", 1.0),
                (0.0, "h > 1", 0.0),
                (0.0, "not (h < 1)", 1.0),
                (0.0, "2*h > 2 and t > 0.5", 0.0),
                (2.0, "h <= 1", 1.0),
                (2.0, "h < 1", 0.0),
                (2.0, "1 > h or h < -1", 0.0),
            ] {
                let found = counted(f, from, when, method);
                assert_eq!(found, want, "{method:?}: {f} from {from}, {when}");
            }
        }
        // Sliding ends at t = 3: above the surface from then on.
        let lifted = "-sign(h - 1) + max(t - 2, 0)";
        for (when, want) in [("h > 1", 1.0), ("h >= 1", 1.0), ("h > 1 and t < 2.9", 0.0)] {
            assert_eq!(counted(lifted, 0.0, when, method), want, "{method:?}: {when}");
        }
    }
}

/// Contacts after Hertz: the slope of x^1.5 at 0 is 0. By central differences of runs, and the
/// closed orbit by SciPy's DOP853 at 1e-12.
#[test]
fn tangents_pass_powers_at_zero() {
    for contact in ["20*max(x - 0.3, 0)^1.5", "if(x > 0.3, 20*(x - 0.3)^1.5, 0)"] {
        let text = format!(
            "states = ['x', 'v']\nstart = [0.1, 0]\nf = ['v', '0.5*cos(t) - x - {contact} - 0.2*v']"
        );
        let model = model(&text);
        let options = Options { t_end: 5.0, ..Options::default() };
        let found = crate::motion::sensitivity::sensitivities(&model, &options, &[]).unwrap();
        let want = [[0.229_457, -0.056_699], [0.325_660, 1.522_792]];
        for (i, row) in want.iter().enumerate() {
            for (j, want) in row.iter().enumerate() {
                near(found.by_start[i][j], *want, 1e-5);
            }
        }
    }
}

/// Bodies in contact that let go when the force between them is zero leave the condition of contact
/// to third order: SciPy's DOP853 with events, at 1e-12.
#[test]
fn contacts_let_go_to_third_order() {
    let text = "states = ['a', 'va', 'b', 'vb']\nstart = [0, 0, 0, 0]\n[let]\n\
        both = '(sin(t) - 0.2*va - 0.1*b - 0.3*vb)/2'\nforce = 'sin(t) - 0.2*va + 0.1*b + 0.3*vb'\n\
        [modes.free]\nf = ['va', 'sin(t) - 0.2*va', 'vb', '-0.1*b - 0.3*vb']\n\
        [modes.right]\nf = ['va', 'both', 'vb', 'both']\n\
        [modes.left]\nf = ['va', 'both', 'vb', 'both']\n\
        [[event]]\nwhen = 'a - b > 0.1'\nfrom = 'free'\nmode = 'right'\n\
        set = { va = '(va + vb)/2', vb = '(va + vb)/2' }\n\
        [[event]]\nwhen = 'a - b < -0.1'\nfrom = 'free'\nmode = 'left'\n\
        set = { va = '(va + vb)/2', vb = '(va + vb)/2' }\n\
        [[event]]\nwhen = 'force < 0'\nfrom = 'right'\nmode = 'free'\n\
        [[event]]\nwhen = 'force > 0'\nfrom = 'left'\nmode = 'free'";
    for method in Method::ALL {
        let end = end_of(text, 20.0, method).unwrap();
        for (end, want) in end.iter().zip([-0.59902187, 0.12790569, -0.67490614, -0.33062124]) {
            near(*end, want, 1e-8);
        }
    }
}

/// References and stops that jump with the time: a relay that slides on one, with an event about
/// the same surface, and a body that rests on the other.
#[test]
fn jumps_of_references_and_stops_are_followed() {
    let relay = |speed: f64, u: &str| {
        format!(
            "states = ['x', 'n']\nstart = [0, 0]\nf = ['-{speed}*sign(x - u)', '0']\n[[event]]\n\
             when = 'x < u'\nset = {{ n = 'n + t' }}\n[let]\nu = '{u}'"
        )
    };
    let stop = |start: f64, r: f64, u: &str, du: &str| {
        format!(
            "states = ['x', 'v']\nstart = [{start}, 0]\nf = ['v', '-10']\n[[event]]\n\
             when = 'x - u'\ndirection = 'down'\nset = {{ v = 'du - {r}*(v - du)' }}\n\
             after_zeno = 'stick'\n[let]\nu = '{u}'\ndu = '{du}'"
        )
    };
    for method in Method::ALL {
        let is = |text: &str, t: f64, want: [f64; 2]| {
            let end = end_of(text, t, method).unwrap_or_else(|e| panic!("{method:?}: {e}\n{text}"));
            end.iter().zip(want).for_each(|(end, want)| near(*end, want, 1e-8));
        };
        // The event fires where the reference jumps up: at 3; at 1 and 3; at 1 and 2.
        let steps = "if(t < 1, 0.25, if(t < 2, -0.87, if(t < 3, -0.97, 0.67)))";
        is(&relay(3.0, steps), 3.95, [0.67, 3.0]);
        let steps = "if(t < 1, 0.27, if(t < 2, 0.74, if(t < 3, 0.05, 0.48)))";
        is(&relay(3.0, steps), 3.95, [0.48, 4.0]);
        let steps = "if(t < 1, 0, if(t <= 2, 0.5, if(t < 3, 1, -0.5)))";
        is(&relay(2.0, steps), 3.95, [-0.5, 3.0]);
        // The floor sinks from under the body, which falls onto it again.
        let sinks = stop(1.0, 0.3, "if(t < 2, 0, -0.5*(t - 2))", "if(t < 2, 0, -0.5)");
        is(&sinks, 2.05, [-0.0125, -0.5]);
        is(&sinks, 3.9, [-0.95, -0.5]);
        is(&stop(1.0, 0.3, "if(t < 2, 0, -1)", "0"), 9.0, [-1.0, 0.0]);
        // The speed of this one turns at pi, and throws the body up.
        let turns = stop(0.5, 0.1, "0.1*abs(sin(t))", "0.1*cos(t)*sign(sin(t))");
        is(&turns, 5.0, [0.1 * 5.0_f64.sin().abs(), -0.1 * 5.0_f64.cos()]);
        let pi = std::f64::consts::PI;
        is(&turns, pi + 0.001, [0.000_12 - 5e-6, 0.12 - 0.01]);
    }
}

/// Events whose expressions see what slides, or are slid upon, happen once: where the motion comes,
/// and where it leaves to the side that it came from.
#[test]
fn events_beside_sliding_happen_once() {
    let counted = |f: &str, start: &str, when: &str, t: f64, method: Method| {
        let text = format!(
            "states = ['x', 'v', 'n']\nstart = [{start}, 0]\nf = ['v', '{f}', '0']\n[[event]]\n\
             when = '{when}'\nset = {{ n = 'n + t' }}"
        );
        end_of(&text, t, method).unwrap_or_else(|e| panic!("{method:?}: {e}\n{text}"))[2]
    };
    for method in Method::ALL {
        let is = |f: &str, start: &str, when: &str, t: f64, want: f64| {
            near(counted(f, start, when, t, method), want, 1e-8);
        };
        is("-sign(v - 0.3)", "0, 0.3", "x - v", 2.0, 1.0);
        // v comes to 0 from above and leaves it to below; then to above, at t = 3/2.
        let pi = std::f64::consts::PI;
        let lands = {
            // v = 1.5 (1 - cos t) - t + what it had lost until sin t = 2/3; zero again at:
            let from = (2.0_f64 / 3.0).asin();
            let v = |t: f64| 1.5 * (from.cos() - t.cos()) - (t - from);
            let (mut low, mut high) = (2.0, pi + 0.5);
            for _ in 0..60 {
                let middle = 0.5 * (low + high);
                *(if v(middle) > 0.0 { &mut low } else { &mut high }) = middle;
            }
            low
        };
        is("1.5*sin(t) - sign(v)", "0, 0", "v", 4.0, lands);
        // 0.3 - 1.5 t + t^2/2 = 0.
        let arrives = 1.5 - (1.5_f64 * 1.5 - 0.6).sqrt();
        is("t - 0.5 - sign(v)", "0, 0.3", "v", 3.0, arrives + 1.5);
        let u = "if(t < 1, 0.94, if(t < 2, -0.08, if(t < 3, 0.25, 1.74)))";
        is(&format!("{u} - x - sign(v - 0.5)"), "0, 0.5", "v - 0.5", 5.0, 9.416_261_266);
    }
}

/// Functions of a sign follow it where sliding ends.
#[test]
fn functions_of_signs_follow_where_sliding_ends() {
    for f in [
        "clip(-sign(x), -0.5, 0.7)",
        "min(max(sign(-x), -0.5), 0.7)",
        "max(-0.5, min(0.7, -100*sign(x)))",
        "if(sign(x) >= 0.5, -0.5, 0.7)",
        "min(heaviside(-x), 1.2) - 0.5",
        "if(abs(sign(x) - 1) < 0.5, -0.5, 0.7)",
        "if(x > 0, -0.5, 0.7)",
    ] {
        let text = format!("states = ['x']\nstart = [0.01]\nf = ['{f} + 0.5*t']");
        for method in Method::ALL {
            // From x = 0 at t = 1 on.
            let end = end_of(&text, 4.0, method).unwrap_or_else(|e| panic!("{method:?}: {e}\n{f}"));
            near(end[0], 2.25, 1e-9);
        }
    }
}

/// Tables that jump over an event's zero, or to equality and away from it, are met once each time.
#[test]
fn events_see_the_jumps_of_tables() {
    let table = "[tables.u]\nfile = 'u.csv'\ntime = 't'\ncolumn = 'u'\ninterpolation = 'previous'";
    let counts = |when: &str| {
        format!(
            "states = ['n']\nstart = [0]\nf = ['0']\n[[event]]\nwhen = '{when}'\n\
             set = {{ n = 'n + t' }}\n{table}"
        )
    };
    // The table jumps over the body, which then rises from 0.5 with speed 2.
    let floor = format!(
        "states = ['v', 'x']\nstart = [0, 1]\nf = ['-1', 'v']\n[[event]]\nwhen = 'x - u'\n\
         direction = 'down'\nset = {{ v = '2' }}\n{table}"
    );
    for (text, rows, t_end, want) in [
        (counts("u >= 2"), "0,0\n1,2\n2,0\n3,2\n4,0\n", 4.0, 1.0 + 3.0),
        (counts("u < 2"), "0,2\n1,0\n2,2\n3,0\n4,0\n", 4.0, 1.0 + 3.0),
        (counts("u - 2.5"), "0,3\n1,2\n2,3\n3,1\n4,0\n", 4.0, 1.0 + 2.0 + 3.0),
        (floor, "0,0\n1,0.7\n3,0.7\n", 3.0, 0.5 + 2.0 * 2.0 - 2.0),
    ] {
        let model = model(&text).with_table("u", &format!("t,u\n{rows}")).unwrap();
        for method in Method::ALL {
            let options = Options { t_end, method, ..Options::default() };
            let outcome = follow(&model, &options, &mut |_| true).unwrap();
            assert_eq!(outcome.ending, Ending::Finished, "{method:?}: {text}");
            near(*outcome.x.last().unwrap(), want, 1e-9);
        }
    }
}

/// Functions that vanish at one moment and do not know of each other: two valves, two diodes, two
/// friction elements that unload together. Of valves with inputs in closed form; the others by
/// Radau IIA of SciPy with switches smoothed to 1e-5.
#[test]
fn valves_that_open_at_one_moment_open() {
    let valves = "states = ['p', 'q']\nstart = [1, 1]\n\
        f = ['if(p > 0, t - 2, max(t - 2, 0))', 'if(q > 0, t - 2, max(t - 2, 0))']";
    let inputs = "states = ['p', 'q']\nstart = [0, 0]\n\
        f = ['if(p >= 0.3, min(1 - t, 0), 1 - t)', 'if(q >= 0.2, min(1 - t^2, 0), 1 - t^2)']";
    let diodes = "states = ['i', 'j']\nstart = [0.4, 0.5]\n\
        f = ['if(i > 0, u - 0.1*i, max(u, 0))/0.3', 'if(j > 0, u - 0.2*j, max(u, 0))/0.5']\n\
        [let]\nu = 'sin(t) - 0.5'";
    let elements = "states = ['f', 'g']\nstart = [0, 0]\n\
        f = ['if(f >= 0.3, min(2*v, 0), if(f <= -0.3, max(2*v, 0), 2*v))', \
        'if(g >= 0.5, min(v, 0), if(g <= -0.5, max(v, 0), v))']\n[let]\nv = 'cos(t)'";
    let both = "states = ['x', 'v', 'f', 'g']\nstart = [0, 0.5, 0, 0]\n\
        f = ['v', 'cos(0.7*t) - 0.3*v - f - g', 'if(abs(f) < 0.3 or f*v < 0, 2*v, 0)', \
        'if(abs(g) < 0.5 or g*v < 0, v, 0)']";
    for method in Method::ALL {
        let ends = |text: &str, t_end: f64, want: &[f64], within: f64| {
            let found = end_of(text, t_end, method).unwrap();
            found.iter().zip(want).for_each(|(v, want)| near(*v, *want, within));
        };
        ends(valves, 3.0, &[0.5, 0.5], 1e-9);
        ends(inputs, 2.0, &[-0.2, 0.2 - 4.0 / 3.0], 1e-9);
        ends(diodes, 15.0, &[1.68457, 0.95764], 2e-5);
        ends(elements, 20.0, &[0.3, 0.5], 1e-9);
        ends(both, 20.0, &[1.14561, 0.16726, 0.3, 0.5], 3e-5);
    }
}

/// Valves and clamps that see the speed of a block which friction holds: on one side their speed is
/// zero while it does, and where it begins to move it is so to second order. In closed form; the
/// integrator with a limit mode by mode by DOP853 in SciPy, with events; the controller against
/// windup smoothed to 1e-5.
#[test]
fn clamps_rest_while_friction_holds_a_block() {
    let clamp = "states = ['v', 'i']\nstart = [0, -0.05]\n\
        f = ['t - 0.2*sign(v)', 'if(i - v > 0, 0, 0.5)']";
    let valve = "states = ['x', 'v']\nstart = [0, 0]\n\
        f = ['if(x > 0, t - 1 - v, max(t - 1 - v, 0))', '-0.4*sign(v)']";
    let windup = "states = ['v', 'i', 'u']\nstart = [0, 0, 0]\n\
        f = ['u - 0.2*sign(v)', 'if(1 + i - 1.5*v > 1, 0, 0.5)', '8*(1 - u)']";
    let limited = |limit: &str| {
        format!(
            "states = ['x', 'v']\nstart = [0.5, 0]\nf = ['{limit}', 'x - 0.4*sign(v) - 0.3']\n\
             [let]\nu = '2*sin(t) - 1.5*v'"
        )
    };
    for method in Method::ALL {
        let ends = |text: &str, t_end: f64, want: &[f64], within: f64| {
            let found = end_of(text, t_end, method).unwrap();
            found.iter().zip(want).for_each(|(v, want)| near(*v, *want, within));
        };
        ends(clamp, 0.6, &[0.08, 0.08], 1e-9);
        ends(valve, 2.5, &[1.125, 0.0], 1e-9);
        ends(windup, 10.0, &[7.8777, 4.97072, 1.0], 3e-5);
        for limit in ["if(x > 0, u, max(u, 0))", "max(u, if(x > 0, u, 0))"] {
            ends(&limited(limit), 12.0, &[0.0, 0.348753083], 1e-8);
        }
    }
}

/// An ideal diode that charges a capacitor, with its voltage under a name: what is measured by the
/// size of terms does not see whether they have one.
#[test]
fn names_of_terms_change_nothing() {
    let detector = |rate: &str| {
        format!(
            "states = ['i', 'v']\nstart = [0, 0.5]\nf = ['{rate}', 'i - v/4']\n\
             [let]\nw = 'sin(t)'\nu = 'w - v'"
        )
    };
    for method in Method::ALL {
        for rate in ["max(u, if(i > 0, u, 0))", "max(w - v, if(i > 0, w - v, 0))"] {
            let found = end_of(&detector(rate), 20.0, method).unwrap();
            near(found[0], 0.2158309611302507, 1e-9);
            near(found[1], 0.40129034270926073, 1e-9);
        }
    }
}

/// A body on its stop, with a switch at the very place of the stop: it is let go when the field on
/// the free side pulls, at t = 5 + 10/3, with friction at 5 + 14/3. A rocking block, whose impacts
/// let it pass with 0.3 of its speed, rests between both sides until one of them pulls.
#[test]
fn switches_at_the_place_of_a_stop_let_go_as_the_free_side_does() {
    const RAMP: &str = "if(t > 5, 0.3*(t - 5), 0)";
    let stop = |force: &str, restitution: f64| {
        format!(
            "states = ['x', 'v']\nstart = [0.5, 0]\nf = ['v', '{force} + {RAMP}']\n\
             [[event]]\nwhen = 'x'\ndirection = 'down'\nafter_zeno = 'stick'\n\
             set = {{ v = '-{restitution}*v' }}"
        )
    };
    let block = |force: &str| {
        format!(
            "states = ['x', 'v']\nstart = [0.15, 0]\nf = ['v', '-sign(x) {force}']\n\
             [[event]]\nwhen = 'x'\nafter_zeno = 'stick'\nset = {{ v = '0.3*v' }}"
        )
    };
    let free = |pull: f64, time: f64| [pull * time * time * time / 6.0, pull * time * time / 2.0];
    for method in Method::ALL {
        let ends = |text: &str, t_end: f64, want: [f64; 2]| {
            let found = end_of(text, t_end, method).unwrap_or_else(|e| panic!("{e}\n{text}"));
            found.iter().zip(want).for_each(|(v, want)| near(*v, want, 1e-8));
        };
        for restitution in [0.0, 0.5] {
            for force in [
                "-1",
                "-sign(x)",
                "if(x > 0, -1, 5)",
                "-heaviside(x)",
                "if(x >= 0, -1, 1)",
                "-1 - if(x < 0, 3, 0)",
                "-1 - max(-x, 0)",
            ] {
                ends(&stop(force, restitution), 10.0, free(0.3, 5.0 / 3.0));
            }
        }
        ends(&stop("-1 - 0.4*sign(v)", 0.0), 12.0, free(0.3, 7.0 / 3.0));
        ends(&block("+ if(t > 4, 0.3*(t - 4), 0)"), 8.0, free(0.3, 2.0 / 3.0));
        ends(&block("- 0.1*t"), 15.0, free(-0.1, 5.0));
        ends(&block("- 0.1*(t - 2)"), 15.0, free(-0.1, 3.0));
        ends(&block("+ 0.3*sin(t)"), 9.0, [0.0, 0.0]);
    }
}

/// A body on a vibrating table that is kicked or meets a kink of its field does not sink into it.
/// Its speed is the table's until that falls faster than the body would.
#[test]
fn what_lies_on_a_vibrating_table_stays_above_it() {
    let body = |force: &str, kick: &str| {
        format!(
            "states = ['x', 'v']\nstart = [0.3, 0]\nf = ['v', '{force}']\n\
             [let]\np = '0.15*sin(1.5*t)'\nq = '0.225*cos(1.5*t)'\n\
             [[event]]\nwhen = 'x - p'\ndirection = 'down'\nafter_zeno = 'stick'\n\
             set = {{ v = 'q' }}\n{kick}"
        )
    };
    let kick = "[[event]]\nname = 'kick'\nat = [2]\nset = { v = 'v - 0.4' }";
    for method in Method::ALL {
        for (text, t_end) in [
            (body("-1", kick), 4.0),
            (body("-1 - 0.2*sign(v)", ""), 10.3),
            (body("-1 - 0.2*abs(v)", ""), 10.3),
            (body("-1 - 0.2*max(v, 0)", ""), 10.3),
        ] {
            let found = end_of(&text, t_end, method).unwrap();
            near(found[0], 0.15 * (1.5 * t_end).sin(), 1e-9);
            near(found[1], 0.225 * (1.5 * t_end).cos(), 1e-9);
        }
        // Friction against the table itself; the values are those of an event-driven integration
        // by DOP853 in SciPy.
        let rubbed = body("-1 + 0.3*sin(3*t) - 0.2*sign(v - q)", "")
            .replace("0.15*sin(1.5*t)", "0.9*sin(1.3*t)")
            .replace("0.225*cos(1.5*t)", "1.17*cos(1.3*t)")
            .replace("[0.3, 0]", "[0.5, 0]");
        let found = end_of(&rubbed, 11.0, method).unwrap();
        near(found[0], 0.9424543, 1e-6);
        near(found[1], 0.0562574, 1e-6);
    }
}

/// A block slides to a stop on a plate that lies on its floor: what the floor adds keeps the plate,
/// and the friction between both, from moving. A switch on which the motion slides presses a body
/// into its stop, and lifts it from t = 10/3 on. Taylor series are refused where a contact acts on
/// what is slid upon.
#[test]
fn contacts_and_sliding_are_solved_together() {
    let plate = |block: &str, plate: &str| {
        format!(
            "states = ['x', 'v', 'y', 'w']\nstart = [0, 1, 0, 0]\nf = ['v', '{block}', 'w', \
             '{plate}']\n[[event]]\nwhen = 'y'\ndirection = 'down'\nafter_zeno = 'stick'\n\
             set = {{ w = '-0.5*w' }}"
        )
    };
    let lifted = "states = ['x', 'v', 'y']\nstart = [0, 0, 0]\n\
        f = ['v', '-1 + 3*if(y > 0, 1, -1)', '-sign(y) + 0.1*t']\n\
        [[event]]\nwhen = 'x'\ndirection = 'down'\nafter_zeno = 'stick'\nset = { v = '-0.5*v' }";
    // Speeds of the block that is driven vanish at the root of 1.3 - 0.3 cos t - t/2.
    let newton = |s: f64| s + (1.3 - 0.3 * s.cos() - 0.5 * s) / (0.5 - 0.3 * s.sin());
    let stops = (0..9).fold(3.2, |s, _| newton(s));
    let far = 1.3 * stops - 0.3 * stops.sin() - 0.25 * stops * stops;
    // Against the other block's drag it stops at ln(4)/0.3, and falls back.
    let (turn, back) = (4.0_f64.ln() / 0.3, (1.8 - 4.0_f64.ln()).exp());
    let bent =
        [1.0 / 0.3 - turn / 3.0 + (6.0 - turn) / 3.0 - (back - 1.0) / 0.9, (1.0 - back) / 3.0];
    let time: f64 = 6.0 - 10.0 / 3.0;
    for method in Method::ALL {
        let ends = |text: &str, want: &[f64]| {
            let found = end_of(text, 6.0, method).unwrap();
            found.iter().zip(want).for_each(|(v, want)| near(*v, *want, 1e-8));
        };
        ends(&plate("-0.3", "-1 + 0.5*sign(v - w)"), &[0.6, -0.8, 0.0, 0.0]);
        ends(&plate("-0.3*abs(v - w) - 0.1", "-1"), &[bent[0], bent[1], 0.0, 0.0]);
        ends(lifted, &[0.05 * time.powi(3), 0.15 * time * time, 0.0]);
        for (block, far) in [("-0.5*sign(v - w)", 1.0), ("0.3*sin(t) - 0.5*sign(v - w)", far)] {
            let text = plate(block, "-1 - 0.3*sin(t) + 0.5*sign(v - w)");
            if method == Method::Taylor {
                let error = end_of(&text, 6.0, method).unwrap_err();
                assert!(error.contains("not written as a Taylor series"), "{error}");
            } else {
                ends(&text, &[far, 0.0, 0.0, 0.0]);
            }
        }
    }
}

/// A focus, e^(-5 t) (cos 2 t, sin 2 t), crosses y = 0 every pi/2 down to states whose squares are
/// no numbers, and ends at zero where they underflow themselves.
#[test]
fn a_focus_is_followed_until_its_states_underflow() {
    let focus = model("states = ['x', 'y']\nstart = [1, 0]\nf = ['-5*x - 2*y', '2*x - 5*y']");
    let section = twofold_system::Expression::parse("y", &["x", "y"]).unwrap();
    for method in [Method::Dopri5, Method::Radau5, Method::Lsoda, Method::Taylor] {
        let options = Options {
            t_end: 1000.0,
            method,
            record: Record::Section(section.clone()),
            ..Options::default()
        };
        let mut times = Vec::new();
        let outcome = follow(&focus, &options, &mut |point| {
            times.push(point.t);
            true
        });
        assert_eq!(outcome.unwrap().x, [0.0, 0.0], "{method:?}");
        let quarter = 0.5 * std::f64::consts::PI;
        times.retain(|t| *t > 0.0 && *t < 120.5);
        assert_eq!(times.len(), 76, "{method:?}");
        for (k, t) in times.iter().enumerate() {
            near(*t, quarter * (k + 1) as f64, 1e-7);
        }
    }
}

/// A diode that begins to conduct while the motion slides on its closed side, where there is no
/// mixture of fields any more: derivatives by the start against differences of runs. From i = 0
/// neighbours on the one side stay beside it: no derivative.
#[test]
fn derivatives_go_through_a_diode_that_begins_to_conduct() {
    let text = "states = ['i', 'v']\nstart = [0, 0]\n\
        f = ['if(i > 0, u, max(u, 0))/0.2', '(i - v/5)/0.8']\n[let]\nu = '3*sin(t) - v'";
    let model = model(text);
    let from = |x: f64, y: f64| {
        let options = Options { t_end: 20.0, start: Some(vec![x, y]), ..Options::default() };
        (follow(&model, &options, &mut |_| true).unwrap().x, options)
    };
    for [x, y] in [[0.3, 1.1], [0.1, 2.0], [0.3, 2.0], [0.4, 1.1], [0.5, 1.1], [0.1, 0.2]] {
        let options = from(x, y).1;
        let found = sensitivity::sensitivities(&model, &options, &[]).unwrap().by_start;
        let step = 1e-4;
        let differences = [[step, 0.0], [0.0, step]].map(|[a, b]| {
            let (more, less) = (from(x + a, y + b).0, from(x - a, y - b).0);
            [0, 1].map(|i| (more[i] - less[i]) / (2.0 * step))
        });
        for (i, row) in found.iter().enumerate() {
            row.iter().zip(differences).for_each(|(v, want)| near(*v, want[i], 2e-6));
        }
    }
    let options = Options { t_end: 2.5, start: Some(vec![0.0, 0.5]), ..Options::default() };
    let found = sensitivity::sensitivities(&model, &options, &[]).unwrap().by_start;
    assert!(found[0][0].is_nan() && found[1][0].is_nan() && found[1][1].is_finite(), "{found:?}");
}

/// Friction against the room holds a body in the air when the table on which it lay begins to sink
/// below it, at its highest point.
#[test]
fn friction_may_hold_what_a_table_leaves() {
    let text = "states = ['x', 'v']\nstart = [0.1, 0.3]\nf = ['v', '-0.25 - 0.27*sign(v)']\n\
        [let]\np = '0.252*sin(0.95*t)'\nq = '0.252*0.95*cos(0.95*t)'\n\
        [[event]]\nwhen = 'x - p'\ndirection = 'down'\nafter_zeno = 'stick'\n\
        set = { v = 'q - 0.2*(v - q)' }";
    for method in Method::ALL {
        let found = end_of(text, 5.0, method).unwrap();
        near(found[0], 0.252, 1e-9);
        assert_eq!(found[1], 0.0, "{method:?}");
    }
}

/// Two surfaces met at one moment, of which one is asked only beyond the other.
#[test]
fn surfaces_asked_beyond_one_another_have_no_derivative() {
    let text = "states = ['x', 'y', 'z']\nstart = [-1, -1, 0]\n\
        f = ['1', '1', 'if(x > 0 and y < 0, 10, 0)']";
    let options = Options { t_end: 2.0, ..Options::default() };
    let error = sensitivity::sensitivities(&model(text), &options, &[]).unwrap_err().to_string();
    assert!(error.contains("two surfaces are met at one moment"), "{error}");
    let apart = Options { start: Some(vec![-1.0, -1.25, 0.0]), ..options };
    let found = sensitivity::sensitivities(&model(text), &apart, &[]).unwrap().by_start;
    assert_eq!(found[2], [10.0, -10.0, 1.0]);
}

/// A plate that passes a body on its stop, ever faster, takes it along by friction: the stop holds
/// the body only on the side on which it pushes.
#[test]
fn friction_lifts_a_body_off_its_stop() {
    let text = |rate: f64, start: f64| {
        format!(
            "states = ['x', 'v', 'w']\nstart = [0, 0, {start}]\n\
             f = ['v', '-0.1 - 0.4*sign(v - w)', '{rate}']\n[[event]]\nwhen = 'x'\n\
             direction = 'down'\nafter_zeno = 'stick'\nset = {{ v = '-0.5*v' }}"
        )
    };
    for method in Method::ALL {
        // Slower than friction makes it the body sticks to the plate, else it follows it.
        for (rate, start, speed) in [(0.2, -0.4, 0.2), (0.5, -1.0, 0.3)] {
            let found = end_of(&text(rate, start), 4.0, method).unwrap();
            near(found[0], 2.0 * speed, 1e-8);
            near(found[1], 2.0 * speed, 1e-8);
        }
    }
}

/// A weir, 1 - sqrt(max(h - 1, 0)), that begins and ends to flow: the surface is met with a speed,
/// and the slope behind it is infinite. Of an autonomous equation derivatives are quotients of the
/// field; of a driven one with one state the multiplier is a difference of runs.
#[test]
fn roots_that_begin_at_a_surface_are_crossed_with_their_tangents() {
    let options = Options { t_end: 3.0, ..Options::default() };
    let slope = |inflow: f64, start: f64, root: &str| {
        let text = format!("states = ['h']\nstart = [{start}]\nf = ['{inflow} - {root}']");
        let found = crate::motion::sensitivity::sensitivities(&model(&text), &options, &[]);
        let found = found.unwrap_or_else(|e| panic!("{text}: {e}"));
        (found.x[0], found.by_start[0][0])
    };
    for root in ["sqrt(max(h - 1, 0))", "if(h > 1, sqrt(h - 1), 0)"] {
        let (end, rising) = slope(1.0, 0.5, root);
        near(rising, 1.0 - (end - 1.0).sqrt(), 1e-7);
        let (_, falling) = slope(-1.0, 1.5, root);
        near(falling, 1.0 / (1.0 + 0.5_f64.sqrt()), 1e-7);
    }
    let tank = "states = ['h']\nstart = [0.2]\n\
        f = ['0.3*(1 + cos(2*pi*t/10)) - 0.2*sqrt(max(h - 0.6, 0)) - 0.3*h']";
    near(end_of(tank, 1000.0, Method::Dopri5).unwrap()[0], 0.9946294707, 2e-9);
    use crate::motion::tangent::{Return, closed_orbit};
    let orbit =
        closed_orbit(&model(tank), &Options::default(), &Return::Period(10.0), 0.0).unwrap();
    let after = |by: f64| {
        let start = Some(vec![orbit.x[0] + by]);
        let options = Options { t_end: 10.0, start, rtol: 1e-12, ..Options::default() };
        follow(&model(tank), &options, &mut |_| true).unwrap().x[0]
    };
    near(orbit.multipliers[0][0], (after(1e-5) - after(-1e-5)) / 2e-5, 1e-6);
}

/// Power-rate reaching laws: roots of |s|, whose zero is slid upon. Sliding on v = -2 x, x falls as
/// exp(-2 t). Gains with kinks that all meet where the motion comes to rest.
#[test]
fn roots_of_what_is_slid_upon_are_zero() {
    for law in [
        "-abs(s)^0.5*sign(s) - 3*sign(s)",
        "-2*v - sqrt(abs(s))*sign(s) - 3*sign(s)",
        "-2*v - sqrt(abs(s)) - 3*sign(s)",
        "-2*v - sqrt(max(s, 0)) - 3*sign(s)",
        "-2*v - (abs(s)/3)^0.9 - 3*sign(s)",
        "-2*v - 0.5*exp(-abs(s)^0.5)*sign(s) - 3*sign(s)",
    ] {
        let text = format!(
            "states = ['x', 'v']\nstart = [1, 0]\nf = ['v', '{law}']\n[let]\ns = 'v + 2*x'"
        );
        for method in [Method::Dopri5, Method::Radau5, Method::Lsoda] {
            let [early, late] = [4.0, 6.0].map(|t| end_of(&text, t, method));
            let [early, late] = [early, late].map(|x| x.unwrap_or_else(|e| panic!("{law}: {e}")));
            near(late[0], early[0] * (-4.0_f64).exp(), 1e-9);
            near(late[1], -2.0 * late[0], 1e-12);
        }
    }
    let text = "states = ['x', 'v']\nstart = [1, 0.5]\n\
        f = ['v', '-2*v - sign(v + 2*x)*(1 + abs(x))']";
    for method in Method::ALL {
        let x = end_of(text, 40.0, method).unwrap_or_else(|e| panic!("{method:?}: {e}"));
        assert!(x.iter().all(|v| v.abs() < 1e-11), "{method:?}: {x:?}");
    }
}

/// A state is put onto surfaces that it is on to rounding, not onto those that jump over it: a car
/// brakes to v = 0.4 exp(-5 (t - 4.8)), and accelerates from t = 8 on. (The quotient is there for
/// the domain's end that it has.)
#[test]
fn what_jumps_over_zero_leaves_the_state() {
    let text = "states = ['w', 'v']\nstart = [10, 10]\n\
        f = ['1/(w - 4)', 'max(-5*v, if(mod(t, 20) < 8, -2, 1.5))']";
    for method in Method::ALL {
        near(end_of(text, 10.0, method).unwrap()[1], 3.0 + 0.4 * (-16.0_f64).exp(), 1e-8);
    }
    // A product that is zero by its first factor, where the second one's zero is far.
    let text = "states = ['a', 'b']\nstart = [1, 1]\n\
        f = ['1/(a + 4) - 1/(a + 4) + 1', '-1 + 0*max(0, b*(1.2 + (b - a)/3))']";
    for method in Method::ALL {
        let x = end_of(text, 3.0, method).unwrap();
        near(x[0], 4.0, 1e-9);
        near(x[1], -2.0, 1e-9);
    }
}

/// Exponents that are whole numbers by a parameter: z' = -z^n of negative numbers.
#[test]
fn whole_exponents_may_be_parameters() {
    let end = |field: &str, n: f64, z: f64| {
        let text = format!("states = ['z']\nstart = [{z}]\nf = ['{field}']\n[parameters]\nn = {n}");
        last(&text, 1.0)
    };
    near(end("-z^n", 2.0, -0.5), -1.0, 1e-8);
    near(end("-z^n", 3.0, -0.5), -(6.0_f64.sqrt().recip()), 1e-9);
    near(end("-z^(n - 1)", 2.0, -0.5), -0.5 * (-1.0_f64).exp(), 1e-9);
    near(end("-abs(z)^(n - 1)*z", 1.0, -0.5), -0.5 * (-1.0_f64).exp(), 1e-9);
    near(end("-abs(z)^n*z", 0.0, 0.5), 0.5 * (-1.0_f64).exp(), 1e-9);
}

/// |v - 0.2| as max(r, -r), r named or written out, is one surface with sign(r).
#[test]
fn a_size_by_a_maximum_is_no_new_surface() {
    use crate::motion::tangent::{Return, closed_orbit};
    let period = |r: &str, size: &str| {
        let text = format!(
            "states = ['v', 'x']\nstart = [0, 0]\n\
             f = ['-x - sign({r})*(0.3 + 0.2*exp(-{size}))', 'v']\n[let]\nr = 'v - 0.2'"
        );
        let section = Record::Section(twofold_system::Expression::Name("v".into()));
        let options = Options { record: section, t_end: 100.0, ..Options::default() };
        closed_orbit(&model(&text), &options, &Return::Crossings(1), 0.0).unwrap().period
    };
    let want = period("r", "abs(r)");
    near(want, 6.601640314931418, 1e-8);
    near(period("r", "max(r, -r)"), want, 1e-9);
    near(period("v - 0.2", "max(v - 0.2, -(v - 0.2))"), want, 1e-9);
    near(period("v - 0.2", "max(0.2 - v, v - 0.2)"), want, 1e-9);
}

/// Derivatives by a start on a surface: of one that moves along it at first, also by what gives it
/// a speed; of surfaces that depend on each other none, in words.
#[test]
fn starts_on_surfaces_have_derivatives_of_one_side_only() {
    let options = Options { t_end: 2.0, ..Options::default() };
    let at = |text: &str| crate::motion::sensitivity::sensitivities(&model(text), &options, &[]);
    let found =
        at("states = ['x', 'v']\nstart = [0, 0]\nf = ['v', '0.5 - x - 0.15*sign(x)']").unwrap();
    assert!(found.by_start.iter().flatten().all(|v| v.is_nan()), "{:?}", found.by_start);
    let agents = "states = ['x', 'y', 'z']\nstart = [0, 0, 0]\n\
        f = ['-sign(x - y) - sign(x - z)', '-sign(y - x) - sign(y - z)', \
        '-sign(z - x) - sign(z - y)']";
    let error = at(agents).unwrap_err().to_string();
    assert!(error.contains("surfaces that depend on each other"), "{error}");
}

/// Sticking zones that are a thousandth and a millionth of the box are curves, and points of a
/// curve that was found are no rests of their own.
#[test]
fn curves_of_rests_are_found_at_any_length() {
    use crate::rests::rests;
    for (field, from, to) in [
        ("-200*x - v - if(v > 0, 3, 0)", -0.015, 0.0),
        ("-2000*x - v - 3*sign(v)", -0.0015, 0.0015),
        ("-2e5*x - v - 3*sign(v)", -1.5e-5, 1.5e-5),
    ] {
        let text = format!("states = ['x', 'v']\nf = ['v', '{field}']");
        let found = rests(&model(&text), &[(-10.0, 10.0); 2]).unwrap();
        let [rest] = found.as_slice() else { panic!("{field}: {found:?}") };
        let [a, b] = rest.family.clone().unwrap().ends.unwrap();
        near(a[0], from, 1e-8);
        near(b[0], to, 1e-8);
        assert!(rest.kind().starts_with("stable"), "{}", rest.kind());
    }
    let epidemic = model("states = ['S', 'I']\nf = ['-0.2*S*I', '0.2*S*I - 0.2*I']");
    let found = rests(&epidemic, &[(0.0, 3.0), (0.0, 1.0)]).unwrap();
    let [rest] = found.as_slice() else { panic!("{found:?}") };
    assert!(rest.family.as_ref().unwrap().changes);
}

/// Saturations of switched controls: what only the sides of others move is no surface. A thermostat
/// holds T = 20; sliding on v = -2 x, x falls as exp(-2 t).
#[test]
fn saturations_of_signs_are_no_surfaces() {
    for heat in
        ["clip(2*heaviside(20 - T), 0, 2)", "clip(10*(T < 20), 0, 2)", "abs(1 + sign(20 - T))"]
    {
        let text = format!("states = ['T']\nstart = [15]\nf = ['0.1*(10 - T) + {heat}']");
        for method in Method::ALL {
            near(end_of(&text, 10.0, method).unwrap()[0], 20.0, 1e-12);
        }
    }
    for control in ["clip(sign(s), -1, 1)", "max(-1, 2*heaviside(s) - 1)", "-min(-sign(s), 1)"] {
        let text = format!(
            "states = ['x', 'v']\nstart = [1, 0.5]\nf = ['v', '0.3*sin(t) - 2*v - {control}']\n\
             [let]\ns = 'v + 2*x'"
        );
        for method in Method::ALL {
            let [early, late] = [4.0, 6.0].map(|t| end_of(&text, t, method).unwrap());
            near(late[0], early[0] * (-4.0_f64).exp(), 1e-8);
        }
    }
}

/// Events of another mode are not asked, however near to zero the present mode keeps their
/// expressions: a play, a ball on a vibrating table, and an elastoplastic spring.
#[test]
fn events_of_other_modes_are_not_met() {
    let play = "states = ['y']\nstart = [0]\n[modes.hold]\nf = ['0']\n[modes.up]\n\
        f = ['cos(t)']\n[[event]]\nfrom = 'hold'\nwhen = 'sin(t) - y - 0.4'\n\
        direction = 'up'\nmode = 'up'\n[[event]]\nfrom = 'up'\nwhen = 'cos(t)'\n\
        direction = 'down'\nmode = 'hold'";
    let table = "states = ['x', 'v']\nstart = [0, 1.5]\n[modes.contact]\n\
        f = ['1.5*cos(t)', '-1.5*sin(t)']\n[modes.flight]\nf = ['v', '-1']\n[[event]]\n\
        from = 'flight'\nwhen = 'x - 1.5*sin(t)'\ndirection = 'down'\nmode = 'contact'\n\
        set = { x = '1.5*sin(t)', v = '1.5*cos(t)' }\n[[event]]\nfrom = 'contact'\n\
        when = '1.5*sin(t) > 1'\nmode = 'flight'";
    let spring = "states = ['v', 'F']\nstart = [1, 0]\n[modes.elastic]\n\
        f = ['-sin(t)', 'v']\n[modes.plastic]\nf = ['-sin(t)', '0']\n[[event]]\n\
        from = 'elastic'\nwhen = 'abs(F) - 0.3'\ndirection = 'up'\nmode = 'plastic'\n\
        [[event]]\nfrom = 'plastic'\nwhen = 'v'\nmode = 'elastic'";
    // Flights begin where the table rises with sin(t) = 2/3, at its acceleration of -1.
    let lift = (2.0_f64 / 3.0).asin();
    let height = |s: f64| 1.0 + 1.5 * lift.cos() * s - 0.5 * s * s;
    let turn = 2.0 * std::f64::consts::PI;
    for method in Method::ALL {
        let ends = |text: &str, t_end: f64, place: usize, want: f64| {
            let found = end_of(text, t_end, method).unwrap();
            near(found[place], want, 1e-8);
        };
        ends(play, 2.0, 0, 0.6);
        ends(play, 20.0, 0, 0.6);
        ends(table, 4.0, 0, height(4.0 - lift));
        ends(table, 6.0, 0, 1.5 * 6.0_f64.sin());
        ends(table, 20.0, 0, height(20.0 - 3.0 * turn - lift));
        // From 0.3 down by 1 - sin(t), from -0.3 up by 1 + sin(t).
        ends(spring, 2.5, 1, 2.5_f64.sin() - 0.7);
        ends(spring, 5.0, 1, 5.0_f64.sin() + 0.7);
        ends(spring, 30.0, 1, 30.0_f64.sin() + 0.7);
    }
}

/// Events of the clock turn a mode on in which a level is met that the mode before has left: a
/// current that is switched off at it.
#[test]
fn events_that_were_not_asked_are_met_where_they_are() {
    let text = "states = ['i']\nstart = [0]\n[modes.on]\nf = ['1']\n[modes.off]\nf = ['-1']\n\
        [[event]]\nwhen = 'i - 0.8'\ndirection = 'up'\nfrom = 'on'\nmode = 'off'\n[[event]]\n\
        every = 1\nmode = 'on'";
    for method in Method::ALL {
        let options = Options { t_end: 40.5, method, ..Options::default() };
        let mut met = 0;
        follow(&model(text), &options, &mut |point| {
            if point.event == Some("event 1") {
                near(point.x[0], 0.8, 1e-9);
                met += 1;
            }
            true
        })
        .unwrap();
        // Once a period from the first on; rows of both modes.
        assert!(met >= 40, "{method:?} {met}");
    }
}

/// A block that rocks from corner to corner, by two modes: its impacts accumulate in the middle.
/// Each leaves 0.9 of the speed, and the times of flight are a geometric series.
#[test]
fn impacts_that_change_modes_accumulate() {
    let text = "states = ['th', 'w']\nstart = [0.1, 0]\n[modes.R]\nf = ['w', '-1']\n[modes.L]\n\
        f = ['w', '1']\n[[event]]\nwhen = 'th'\ndirection = 'down'\nfrom = 'R'\nmode = 'L'\n\
        set = { w = '0.9*w' }\n[[event]]\nwhen = 'th'\ndirection = 'up'\nfrom = 'L'\n\
        mode = 'R'\nset = { w = '0.9*w' }";
    let fall = 0.2_f64.sqrt();
    for method in Method::ALL {
        let options = Options { t_end: 20.0, method, ..Options::default() };
        let outcome = follow(&model(text), &options, &mut |_| true).unwrap();
        assert!(matches!(outcome.ending, Ending::Zeno { .. }), "{method:?} {:?}", outcome.ending);
        near(outcome.t, fall + 2.0 * fall * 0.9 / 0.1, 1e-6);
    }
}

/// Newton's cradle: equal pendula that touch hand on their speeds, and as many swing to the other
/// side as were lifted.
#[test]
fn touching_pendula_hand_on_their_speeds() {
    let cradle = |balls: usize, lifted: usize, omega: f64| {
        let list = |item: &dyn Fn(usize) -> String| {
            (0..balls).map(item).collect::<Vec<String>>().join(", ")
        };
        let start = list(&|i| if i < lifted { "-0.5".into() } else { "0".into() });
        let events: String = (1..balls)
            .map(|i| {
                format!(
                    "[[event]]\nwhen = 'x{0} - x{i}'\ndirection = 'up'\n\
                     set = {{ v{0} = 'v{i}', v{i} = 'v{0}' }}\n",
                    i - 1
                )
            })
            .collect();
        format!(
            "states = [{}, {}]\nstart = [{start}, {}]\nf = [{}, {}]\n{events}",
            list(&|i| format!("'x{i}'")),
            list(&|i| format!("'v{i}'")),
            list(&|_| "0".into()),
            list(&|i| format!("'v{i}'")),
            list(&|i| format!("'-{omega}^2*x{i}'")),
        )
    };
    for method in Method::ALL {
        for (balls, lifted, omega) in [(3, 1, 1.0), (3, 2, 1.0), (5, 1, 3.0), (5, 2, 1.0)] {
            for t_end in [5.0, 23.0] {
                let found = end_of(&cradle(balls, lifted, omega), t_end, method)
                    .unwrap_or_else(|e| panic!("{method:?} {balls} {lifted} {omega}: {e}"));
                let place = -0.5 * (omega * t_end).cos();
                let swings = |i: usize| if place < 0.0 { i < lifted } else { i + lifted >= balls };
                for (i, x) in found[..balls].iter().enumerate() {
                    near(*x, if swings(i) { place } else { 0.0 }, 1e-7);
                }
            }
        }
    }
}

/// An event of a clock's moment sees what the clock has done; a condition that is about to become
/// true there, or that a reset makes false, is asked again.
#[test]
fn events_of_one_moment_are_asked_again() {
    let counter = |head: &str, events: &str| {
        format!("states = ['x', 'q', 'n']\n{head}\n{events}\nset = {{ n = 'n + 1' }}")
    };
    let saw = "start = [0, 0, 0]\nf = ['1', '0', '0']\n[[event]]\n";
    let wave = "start = [0, 1, 0]\nf = ['2*q - 1', '0', '0']\n[[event]]\nevery = 1\n\
        set = { q = '1 - q' }\n[[event]]\n";
    for method in Method::ALL {
        let count = |head: &str, events: &str, t: f64| {
            end_of(&counter(head, events), t, method).unwrap_or_else(|e| panic!("{method:?}: {e}"))
                [2]
        };
        // A sawtooth is reset just as it comes to its level; a triangle is turned back there.
        let reset = "every = 1\nset = { x = '0' }\n[[event]]\nwhen = 'x > 1'";
        assert_eq!(count(saw, reset, 20.5), 0.0, "{method:?}");
        assert_eq!(count(wave, "when = 'x > 1'", 10.5), 0.0, "{method:?}");
        assert_eq!(count(wave, "when = 'x < 0'", 10.5), 0.0, "{method:?}");
        // A condition that holds at the border, too, has never been false.
        assert_eq!(count(wave, "when = 'x <= 1'", 10.5), 0.0, "{method:?}");
        // The motion ends at the border.
        let full = "start = [0, 1, 0]\nf = ['q', '0', '0']\n[[event]]\n";
        let stops = "when = 'x >= 1'\nset = { q = '0' }\n[[event]]\nwhen = 'x > 1'";
        assert_eq!(count(full, stops, 9.5), 0.0, "{method:?}");
        let clock = "at = 1\nset = { q = '0' }\n[[event]]\nwhen = 'x > 1'";
        assert_eq!(count(full, clock, 9.5), 0.0, "{method:?}");
        // Made false by one clock and true by the next.
        let two = "when = 'x > 3'\nset = { n = 'n + 1' }\n[[event]]\nevery = 1\nset = { x = '0' }\n\
            [[event]]\nevery = 1\nset = { x = 'x + 5' }";
        let text = format!("states = ['x', 'n']\nstart = [5, 0]\nf = ['0', '0']\n[[event]]\n{two}");
        assert_eq!(end_of(&text, 9.5, method).unwrap()[1], 9.0, "{method:?}");
        // True at the start, false at t = 1 and true right after it.
        let again = "at = 1\nset = { x = '0' }\n[[event]]\nwhen = 'x > 0'";
        assert_eq!(count(saw, again, 5.0), 2.0, "{method:?}");
        let mode = "states = ['x', 'n']\nstart = [0, 0]\n[modes.a]\nf = ['1', '0']\n[modes.b]\n\
            f = ['1', '0']\n[[event]]\nat = 1\nmode = 'b'\nset = { x = '0' }\n[[event]]\n\
            when = 'x > 0'\nfrom = 'b'\nset = { n = 'n + 1' }";
        assert_eq!(end_of(mode, 5.0, method).unwrap()[1], 1.0, "{method:?}");
    }
}

#[test]
fn events_fire_where_their_expression_jumps_onto_zero() {
    for method in Method::ALL {
        let count = |when: &str, t: f64| {
            let text = format!(
                "states = ['x', 'n']\nstart = [0, 0]\nf = ['1', '0']\n[[event]]\nwhen = '{when}'\n\
                 set = {{ n = 'n + 1' }}"
            );
            end_of(&text, t, method).unwrap_or_else(|e| panic!("{method:?} {when}: {e}"))[1]
        };
        assert_eq!(count("mod(x, 1)", 3.2), 3.0, "{method:?}");
        assert_eq!(count("mod(-x, 1)", 3.2), 3.0, "{method:?}");
        assert_eq!(count("mod(t, 1)", 3.2), 3.0, "{method:?}");
        assert_eq!(count("mod(t - 0.0559, 0.1)", 3.02), 30.0, "{method:?}");
        assert_eq!(count("floor(x - 0.5) - n", 3.0), 3.0, "{method:?}");
    }
}

/// A state that has rested at an event's zero comes from no side: it leaves without the event,
/// unless this turns its speed back as an impact does.
#[test]
fn what_rests_at_zero_leaves_it_without_an_event() {
    for method in Method::ALL {
        for (force, direction) in
            [("10*q", "both"), ("-10*q", "both"), ("10*q", "up"), ("-10*q", "down")]
        {
            let text = format!(
                "states = ['x', 'v', 'q', 'n']\nstart = [0, 0, 0, 0]\nf = ['v', '{force}', '0', \
                 '0']\n[[event]]\nat = 1\nset = {{ q = '1' }}\n[[event]]\nwhen = 'x'\n\
                 direction = '{direction}'\nset = {{ n = 'n + 1' }}"
            );
            let x = end_of(&text, 4.0, method).unwrap_or_else(|e| panic!("{method:?}: {e}"));
            near(x[0].abs(), 45.0, 1e-8);
            assert_eq!(x[3], 0.0, "{method:?} {force} {direction}");
        }
    }
}

/// Impacts accumulate at sqrt(2/g) (1 + r)/(1 - r), also by the condition that the ball is below
/// its floor and falls.
#[test]
fn impacts_by_a_condition_accumulate() {
    for method in Method::ALL {
        for r in [0.3_f64, 0.5, 0.8] {
            let text = format!(
                "states = ['x', 'v']\nstart = [1, 0]\nf = ['v', '-9.81']\n[[event]]\n\
                 when = 'x <= 0 and v < 0'\nset = {{ v = '-{r}*v' }}"
            );
            let options = Options { t_end: 60.0, method, ..Options::default() };
            let outcome = follow(&model(&text), &options, &mut |_| true).unwrap();
            let Ending::Zeno { t, error, .. } = outcome.ending else {
                panic!("{method:?}: {:?}", outcome.ending)
            };
            let zeno = (2.0 / 9.81_f64).sqrt() * (1.0 + r) / (1.0 - r);
            assert!((t - zeno).abs() <= error && error < 1e-11, "{method:?}: {t} {zeno} {error:e}");
        }
    }
}

/// The roots of a check valve begin and end at its switches, where rounding may put the state
/// beyond them.
#[test]
fn a_check_valve_opens_and_closes_at_its_roots() {
    let text = "states = ['p', 'r']\nstart = [0.3492, 0.1]\n\
        f = ['(qv - L*sign(p - r)*sqrt(abs(p - r)))/V', 'L*sign(p - r)*sqrt(abs(p - r)) - 0.3*r']\n\
        [parameters]\nA = 1.1349\nw = 2.1635\nk = 1.8779\nV = 0.3895\nL = 0.3808\n\
        [let]\nps = 'A*max(sin(w*t), 0)'\nqv = 'if(ps > p, k*sqrt(ps - p), 0)'";
    let falling = "states = ['p', 'q']\nstart = [0.871, 0.339]\n\
        f = ['if(s > p, 1.914*sqrt(s - p), 0) - l*sqrt(max(p - q, 0))', \
        'l*sqrt(max(p - q, 0)) - 0.753*q']\n[parameters]\nl = 0.818\n[let]\n\
        s = '2 + 0.529*sin(1.784*t)'";
    for method in Method::ALL {
        let x = end_of(falling, 40.0, method).unwrap_or_else(|e| panic!("{method:?}: {e}"));
        near(x[0], 2.178_900_970, 2e-9);
        near(x[1], 1.020_439_977, 2e-9);
        let x = end_of(text, 20.0, method).unwrap_or_else(|e| panic!("{method:?}: {e}"));
        // SciPy's DOP853 at 1e-13 by modes gives eight of these digits.
        near(x[0], 0.470_424_462, 2e-9);
        near(x[1], 0.457_876_915, 2e-9);
    }
}

/// Time-optimal control comes to the origin and stays; what it does not see moves on.
#[test]
fn a_part_of_the_states_comes_to_rest() {
    let fuller = "states = ['x', 'v', 'J']\nstart = [1, 0, 0]\n\
        f = ['v', '-sign(x + 0.4446*v*abs(v))', '1']";
    let optimal = "states = ['x', 'v', 'z']\nstart = [1, 0, 0]\n\
        f = ['v', '-sign(x + 0.5*v*abs(v))', 'x - z']";
    let axes = "states = ['x', 'v', 'y', 'w']\nstart = [1, 0, 3, 0]\n\
        f = ['v', '-sign(x + 0.5*v*abs(v))', 'w', '-sign(y + 0.5*w*abs(w))']";
    for method in Method::ALL {
        let end = |text: &str, t: f64| {
            end_of(text, t, method).unwrap_or_else(|e| panic!("{method:?}: {e}\n{text}"))
        };
        let x = end(fuller, 20.0);
        assert!(x[0].abs() < 1e-12 && x[1].abs() < 1e-12, "{x:?}");
        near(x[2], 20.0, 1e-12);
        // x is 1 - t^2/2 to t = 1 and (2 - t)^2/2 to t = 2.
        let at_two = 1.0 - 2.0 / std::f64::consts::E;
        near(end(optimal, 5.0)[2], at_two * (-3.0_f64).exp(), 1e-9);
        assert!(end(axes, 20.0).iter().all(|x| x.abs() < 1e-12));
    }
}

/// A ball that falls on another one which lies on its floor: their impacts accumulate, and as no
/// rest is defined for them the run ends there.
#[test]
fn impacts_without_a_rest_end_a_run() {
    let text = "states = ['x', 'v', 'y', 'w']\nstart = [0, 0, 1, 0]\nf = ['v', '-9.81', 'w', \
        '-9.81']\n[[event]]\nname = 'floor'\nwhen = 'x'\ndirection = 'down'\n\
        set = { v = '-0.2*v' }\nafter_zeno = 'stick'\n[[event]]\nname = 'pair'\nwhen = 'y - x'\n\
        direction = 'down'\nset = { v = 'w', w = 'v' }";
    // The upper one bounces with the floor's restitution.
    let zeno = (2.0 / 9.81_f64).sqrt() * 1.2 / 0.8;
    for method in Method::ALL {
        let options = Options { t_end: 3.0, method, ..Options::default() };
        let outcome = follow(&model(text), &options, &mut |_| true).unwrap();
        let Ending::Zeno { t, error, event } = outcome.ending else {
            panic!("{method:?}: {:?}", outcome.ending)
        };
        assert!(
            event == "pair" && (t - zeno).abs() <= error && error < 1e-6,
            "{t} {zeno} {error:e}"
        );
    }
}

/// Advice for slips of beginners.
#[test]
fn wrong_kinds_of_values_are_told_what_to_write() {
    let error = |text: &str| Definition::from_toml(text, "f").unwrap_err().to_string();
    let head = "states = ['x', 'v']\nstart = [0, 1]\n";
    let event = |entry: &str| format!("{head}f = ['v', '-x']\n[[event]]\n{entry}");
    for (text, help) in [
        (event("when = 'x = 0'"), "when = \"x\""),
        (event("when = 'x = v'"), "when = \"x - v\""),
        (event("when = 't = 1'"), "at = 1"),
        (event("at = '1, 2'"), "at = [1, 2]"),
        (event("when = 'x'\nmode = 'on'"), "[modes.NAME]"),
        (event("when = 'x'\ndirection = -1"), "\"down\""),
        (event("when = 'x'\nstop = 'yes'"), "true or false"),
        (event("when = 'x'").replace("[[event]]", "[event]"), "[[event]]"),
        (format!("{head}[parameters]\nk = 1\nf = ['v', '-k*x']"), "above the file's first"),
        (format!("{head}f = 'v, -x'"), "an expression for each state"),
        (format!("{head}f = ['v', '-x(t)']"), "without their time: x"),
        ("states = 'x v'\nf = ['v', '-x']".into(), "a list of names"),
        ("states = ['x']\nstart = { x = 0 }\nf = ['1']".into(), "a number for each state"),
    ] {
        let error = error(&text);
        assert!(error.contains("help: ") && error.contains(help), "{error}");
    }
}

/// Derivatives where several surfaces are left, or met by functions that are one where the motion
/// is, at one moment: two stops whose speed turns, a lift that brakes to rest.
#[test]
fn derivatives_of_surfaces_met_together() {
    let stops = "states = ['x', 'v', 'z', 'w']\nstart = [0, 0.5, 0, 0]\n\
        f = ['v', 'sin(0.8*t) - 0.3*x - 0.1*v - 0.8*z - 0.5*w', \
        'if(z >= 0.2, min(v, 0), if(z <= -0.2, max(v, 0), v))', \
        'if(w >= 0.3, min(v, 0), if(w <= -0.3, max(v, 0), v))']";
    let lift = "states = ['x', 'v', 'c', 'dir']\nstart = [0, 0, 0, 1]\n\
        [modes.acc]\nf = ['v', '1.85*dir', '0', '0']\n[modes.cruise]\nf = ['v', '0', '0', '0']\n\
        [modes.brake]\nf = ['v', '-1.85*dir', '0', '0']\n[modes.dwell]\nf = ['0', '0', '1', '0']\n\
        [[event]]\nwhen = 'abs(v) > 1.92'\nfrom = 'acc'\nmode = 'cruise'\n\
        [[event]]\nwhen = 'dir*(18 - x) < v^2/3.7'\nfrom = 'cruise'\nmode = 'brake'\n\
        [[event]]\nwhen = 'dir*v < 0'\nfrom = 'brake'\nmode = 'dwell'\nset = { v = '0', c = '0' }";
    for (text, t_end) in [(stops, 40.0), (lift, 12.0)] {
        let model = model(text);
        let options = Options { t_end, ..Options::default() };
        let found = sensitivity::sensitivities(&model, &options, &[]).unwrap();
        let start = model.start().unwrap().unwrap();
        for j in 0..4 {
            let end = |by: f64| {
                let mut x = start.clone();
                x[j] += by;
                let options = Options { start: Some(x), rtol: 1e-13, ..options.clone() };
                follow(&model, &options, &mut |_| true).unwrap().x
            };
            let (up, down) = (end(1e-6), end(-1e-6));
            for i in 0..4 {
                let want = (up[i] - down[i]) / 2e-6;
                near(found.by_start[i][j], want, 1e-5 * (1.0 + want.abs()));
            }
        }
    }
}

/// An end stop without a rebound, a clamp, and touching bodies that are pushed into each other, by
/// conditions: their events happen infinitely often in no time, and the run ends there.
#[test]
fn events_without_end_in_no_time_end_a_run() {
    let stop = |when: &str, set: &str| {
        format!(
            "states = ['x', 'v']\nstart = [1, 0]\nf = ['v', '-1']\n[[event]]\nwhen = '{when}'\n\
             set = {{ {set} }}"
        )
    };
    let pushed = |when: &str| {
        format!(
            "states = ['x', 'v', 'y', 'w', 'q']\nstart = [0, 0, 1, 0, 0]\n\
             f = ['v', 'q', 'w', '0', '0']\n[[event]]\nat = 1\nset = {{ q = '2' }}\n[[event]]\n\
             {when}\nset = {{ v = 'w', w = 'v' }}"
        )
    };
    let falls = 2.0_f64.sqrt();
    for (text, want) in [
        (stop("x <= 0 and v < 0", "v = '0'"), falls),
        (stop("x < 0 and v < 0", "v = '0'"), falls),
        (stop("x < 0", "x = '0', v = '0'"), falls),
        (stop("x < 0.5", "x = '0.5'"), 1.0),
        (pushed("when = 'x + 1 >= y and v > w'"), 1.0),
        (pushed("when = 'y - x - 1'\ndirection = 'down'"), 1.0),
    ] {
        for method in Method::ALL {
            let options = Options { t_end: 4.0, method, ..Options::default() };
            let outcome = follow(&model(&text), &options, &mut |_| true).unwrap();
            let Ending::Zeno { t, .. } = outcome.ending else {
                panic!("{method:?}: {:?}\n{text}", outcome.ending)
            };
            near(t, want, 1e-9);
        }
    }
}

/// Functions of signs have a value on each side; on two surfaces slid upon at once the mean over
/// the four fields counts, and if that is not decided the motion is refused.
#[test]
fn functions_of_signs_on_two_surfaces_are_mixed() {
    // The weights of the positive sides.
    let (x, y) = (0.5 * 1.25, 0.5 * 1.15);
    for (function, want) in [
        ("abs(sign(x))", 1.0),
        ("max(sign(x), 0)", x),
        ("min(sign(x), 0) + max(sign(y), 0)", x - 1.0 + y),
        ("2*heaviside(x) - clip(sign(y), -0.5, 0.5)", 2.0 * x - (y - 0.5)),
        ("abs(heaviside(x) - 0.5)", 0.5),
        ("if(x > 0, 1, 0) + if(y > 0, 2, 0)", x + 2.0 * y),
    ] {
        let text = format!(
            "states = ['x', 'y', 'z']\nstart = [0, 0, 0]\n\
             f = ['0.5 - 2*sign(x)', '0.3 - 2*sign(y)', '{function}']"
        );
        for method in Method::ALL {
            let end = end_of(&text, 10.0, method).unwrap_or_else(|e| panic!("{method:?}: {e}"));
            near(end[2], 10.0 * want, 1e-9);
        }
        let both = text.replace(function, "max(sign(x), sign(y))");
        assert!(end_of(&both, 10.0, Method::Dopri5).unwrap_err().contains("different velocities"));
    }
    // Beside a control that has come to rest, by whatever function it switches.
    for control in ["-sign(u)", "if(u > 0, -1, 1)", "1 - 2*heaviside(u)"] {
        let text = format!(
            "states = ['x', 'v', 'y', 'z', 'J']\nstart = [1, 0, 0.5, 0, 0]\n\
             f = ['v', '{control}', '0.5 - 2*sign(y)', 'max(sign(y), 0)', 'abs({control})']\n\
             [let]\nu = 'x + 0.5*v*abs(v)'"
        );
        for method in Method::ALL {
            let end = end_of(&text, 10.0, method).unwrap_or_else(|e| panic!("{method:?}: {e}"));
            let landing = 0.5 / 1.5;
            near(end[3], landing + x * (10.0 - landing), 1e-9);
            near(end[4], 10.0, 1e-9);
        }
    }
}

/// Sliding control under a disturbance decays to rounding, where kinks of its gain or of a cost are
/// all zero and change nothing any more.
#[test]
fn kinks_that_change_nothing_do_not_end_sliding() {
    let gain = "states = ['x', 'v']\nstart = [1, 0]\n\
        f = ['v', '0.3*sin(t) - (2*abs(x) + abs(v) + 0.5)*sign(v + 2*x)']";
    let cost = "states = ['x', 'v', 'z']\nstart = [1, 0, 0]\n\
        f = ['v', '0.3*sin(1.7*t) - 2*sign(v + 1.4*x)', 'x^2 + abs(v) - z']";
    for method in Method::ALL {
        for text in [gain, cost] {
            let end = end_of(text, 100.0, method).unwrap_or_else(|e| panic!("{method:?}: {e}"));
            assert!(end.iter().all(|x| x.abs() < 1e-9), "{method:?} {end:?}");
        }
    }
}

/// Bodies that strike each other until their impacts accumulate move on together: by the law of
/// momentum, whatever their restitution, until they are drawn apart.
#[test]
fn two_bodies_stick_to_each_other() {
    // Masses 1 and 2; the force on the second one holds both, and falls from t = 3 on.
    let text = |r: f64, set: &str, start: &str| {
        format!(
            "states = ['x', 'u', 'y', 'v', 'n']\nstart = [{start}, 0]\nf = ['u', '-9.81', 'v', \
             '-9.81 + 1.5*(9.81 - 5*max(t - 3, 0))', '0']\n[[event]]\nname = 'hit'\n\
             when = 'x - y'\ndirection = 'down'\nafter_zeno = 'stick'\n\
             set = {{ {set}u = '(u + 2*v - {r}*2*(u - v))/3', v = '(u + 2*v + {r}*(u - v))/3' }}"
        )
    };
    let (c, since) = (0.2, 9.81 / 5.0);
    let together = |t: f64| 1.0 / 3.0 + c * t - 5.0 * (t - 3.0_f64).max(0.0).powi(3) / 6.0;
    let apart = 3.0 + since;
    let speed = c - 2.5 * since * since;
    for method in Method::ALL {
        for r in [0.2, 0.5] {
            for set in ["", "x = 'y', "] {
                let end = |t: f64| {
                    end_of(&text(r, set, "1, 0, 0, 0.3"), t, method)
                        .unwrap_or_else(|e| panic!("{method:?} {r}: {e}"))
                };
                for t in [2.8, 4.5] {
                    let x = end(t);
                    near(x[0], together(t), 1e-8);
                    near(x[2], x[0], 1e-12);
                    near(x[1], x[3], 1e-12);
                }
                let (x, s) = (end(6.0), 6.0 - apart);
                let fallen = together(apart) + speed * s - 0.5 * 9.81 * s * s;
                near(x[0], fallen, 1e-7);
                near(x[2], fallen - 1.25 * s.powi(3), 1e-7);
            }
        }
        // They lie together from the start.
        near(end_of(&text(0.5, "", "1, 0.2, 1, 0.2"), 2.0, method).unwrap()[0], 1.4, 1e-12);
        // Infinitely many impacts count to no number.
        let counts = end_of(&text(0.5, "n = 'n + 1', ", "1, 0, 0, 0.3"), 4.0, method);
        assert!(counts.as_ref().is_err_and(|e| e.contains("changes n")), "{method:?} {counts:?}");
    }
    // Neighbours do not come to rest at one time.
    let options = Options { t_end: 4.0, ..Options::default() };
    let model = model(&text(0.5, "", "1, 0, 0, 0.3"));
    let found = crate::motion::sensitivity::sensitivities(&model, &options, &[]);
    assert!(found.is_err_and(|e| e.to_string().contains("impacts accumulate")));
}

/// A rope that goes taut holds a pendulum, whose direction turns; its energy is kept from then on.
#[test]
fn a_rope_goes_taut_and_holds() {
    let text = "states = ['x', 'y', 'u', 'v']\nstart = [0.6, 0.1, 0.5, 1]\n\
        f = ['u', 'v', '0', '-9.81']\n[let]\ns = '(x*u + y*v)/(x^2 + y^2)'\n[[event]]\n\
        when = 'x^2 + y^2 - 1'\ndirection = 'up'\nafter_zeno = 'stick'\n\
        set = { u = 'u - 1.3*s*x', v = 'v - 1.3*s*y' }";
    let energy = |x: &[f64]| 0.5 * (x[2] * x[2] + x[3] * x[3]) + 9.81 * x[1];
    for method in Method::ALL {
        let [early, late] = [1.0, 7.0].map(|t| end_of(text, t, method).unwrap());
        near(energy(&late), energy(&early), 1e-7);
        near(late[0] * late[0] + late[1] * late[1], 1.0, 1e-12);
        near(late[0] * late[2] + late[1] * late[3], 0.0, 1e-9);
    }
}

/// A body on another one that lies on its floor: both accumulations end together, and both bodies
/// lie until a force draws them up.
#[test]
fn a_body_comes_to_rest_on_one_that_lies() {
    let text = |r: f64, floor: f64| {
        format!(
            "states = ['x', 'u', 'y', 'v']\nstart = [1, 0, 2, 0]\n\
             f = ['u', '-9.81 + if(t > 8, 40, 0)', 'v', '-9.81']\n[[event]]\nname = 'floor'\n\
             when = 'x'\ndirection = 'down'\nafter_zeno = 'stick'\nset = {{ u = '-{floor}*u' }}\n\
             [[event]]\nname = 'pair'\nwhen = 'y - x - 0.1'\ndirection = 'down'\n\
             after_zeno = 'stick'\n\
             set = {{ u = '(u + 2*v - 2*{r}*(u - v))/3', v = '(u + 2*v + {r}*(u - v))/3' }}"
        )
    };
    for method in [Method::Dopri5, Method::Radau5, Method::Taylor] {
        for (r, floor) in [(0.1, 0.2), (0.5, 0.5), (0.3, 0.7), (0.8, 0.2)] {
            let end = |t: f64| {
                end_of(&text(r, floor), t, method).unwrap_or_else(|e| panic!("{method:?}: {e}"))
            };
            near(end(7.0)[2], 0.1, 1e-12);
            let x = end(9.0);
            near(x[0], 0.5 * (40.0 / 3.0 - 9.81), 1e-9);
            near(x[2], x[0] + 0.1, 1e-12);
        }
    }
}

/// Two rooms whose saturated thermostats hold them from one moment or two on.
#[test]
fn saturated_thermostats_hold_two_rooms() {
    for heat in ["clip(4*heaviside(X), 0, 3)", "min(4*heaviside(X), 3)"] {
        for (start, targets) in [([19, 21], [20.0, 21.0]), ([19, 19], [20.0, 20.0])] {
            let p = [0, 1].map(|i| heat.replace('X', &format!("{} - T{i}", targets[i])));
            let text = format!(
                "states = ['T0', 'T1', 'E']\nstart = [{}, {}, 0]\n\
                 f = ['-0.1*T0 + 0.02*(T1 - T0) + {2}', '-0.1*T1 + 0.02*(T0 - T1) + {3}', \
                 'max({2}, 0)']",
                start[0], start[1], p[0], p[1]
            );
            // The second room is held all along, or as the first one is.
            let (k, gain) = if start[1] == 21 { (0.12, 3.42) } else { (0.1, 3.0) };
            let landing = ((gain / k - 19.0) / (gain / k - 20.0_f64)).ln() / k;
            let held = 2.0 - 0.02 * (targets[1] - 20.0);
            for method in Method::ALL {
                let end = end_of(&text, 10.0, method).unwrap_or_else(|e| panic!("{method:?}: {e}"));
                near(end[2], 3.0 * landing + held * (10.0 - landing), 1e-7);
            }
        }
    }
}

/// A tank runs empty while the motion slides, rests on a stop, or has just been filled again.
#[test]
fn a_tank_runs_empty_beside_what_slides() {
    let text = |tank: &str, cost: &str| {
        format!(
            "states = ['h', 'y', 'J']\nstart = [1, 0.5, 0]\n\
             f = ['{tank}', '0.5 - 2*sign(y)', '{cost}']"
        )
    };
    // The weight of the positive side from y's landing on.
    let (landing, weight) = (0.5 / 1.5, 0.5 * 1.25);
    let slid = landing + weight * (8.0 - landing);
    for method in Method::ALL {
        let end = |text: &str| {
            end_of(text, 8.0, method).unwrap_or_else(|e| panic!("{method:?}: {e}\n{text}"))
        };
        for tank in ["-sqrt(h)", "-sqrt(max(h, 0))", "if(h > 0, -sqrt(h), 0)", "-h^0.5"] {
            let x = end(&text(tank, "max(sign(y), 0)"));
            assert!(x[0] == 0.0 && x[1].abs() < 1e-15, "{method:?} {tank} {x:?}");
            near(x[2], slid, 1e-9);
        }
        // It is full for two units of time.
        let x = end(&text("-sqrt(max(h, 0))", "if(h > 0, 1, 0)"));
        near(x[2], 2.0, 1e-7);
        // It fills again from t = 5 on: 2*(-s - ln(1 - s)) is the time since then, with s its root.
        let x = end(&text("1*if(t > 5, 1, 0) - sqrt(h)", "0"));
        let s = x[0].sqrt();
        near(2.0 * (-s - (1.0 - s).ln()), 3.0, 1e-7);
        // Two diodes that a voltage opens, which is zero with their currents.
        let diodes = "states = ['i', 'j']\nstart = [0, 0]\nf = ['if(i > 0, u - i, max(u, 0))', \
            'if(j > 0, -u - j, max(-u, 0))']\n[let]\nu = 'sin(t)'";
        let x = end_of(diodes, 3.0, method).unwrap();
        near(x[0], 0.5 * (3.0_f64.sin() - 3.0_f64.cos() + (-3.0_f64).exp()), 1e-8);
        let ball = "states = ['h', 'x', 'v']\nstart = [1, 0.1, 0]\nf = ['-sqrt(h)', 'v', \
            '-9.81 + h']\n[[event]]\nwhen = 'x'\ndirection = 'down'\nafter_zeno = 'stick'\n\
            set = { v = '-0.4*v' }";
        let x = end(ball);
        assert!(x[0] == 0.0 && x[1].abs() < 1e-15, "{method:?} {x:?}");
    }
}

/// Costs with kinks where two states meet that are both slid upon: they are zero as long as both
/// are, and the motion leaves them with either.
#[test]
fn kinks_that_follow_from_what_is_slid_upon_rest() {
    let text = |gain: f64, push: &str, cost: &str| {
        format!(
            "states = ['x', 'y', 'J']\nstart = [1, -0.8, 0]\n\
             f = ['-{gain}*sign(x) + {push}*sin(t)', '-1.5*sign(y) + 0.5*cos(t)', '{cost}']"
        )
    };
    let x = |t: f64| 2.0 - 2.0 * t - t.cos();
    let y = |t: f64| -0.8 + 1.5 * t + 0.5 * t.sin();
    let zero = |f: &dyn Fn(f64) -> f64| {
        let (mut low, mut high) = (0.0, 1.0);
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            if f(middle) * f(0.0) > 0.0 { low = middle } else { high = middle }
        }
        low
    };
    let (tx, ty) = (zero(&x), zero(&y));
    let of_x = 2.0 * tx - tx * tx - tx.sin();
    let of_y = -0.8 * ty + 0.75 * ty * ty - 0.5 * ty.cos() + 0.5;
    for method in Method::ALL {
        let end = |text: &str, t: f64| {
            end_of(text, t, method).unwrap_or_else(|e| panic!("{method:?}: {e}\n{text}"))
        };
        for (cost, want) in [
            ("abs(x - y)", of_x - of_y),
            ("max(x - y, 0)", of_x - of_y),
            ("abs(x - y) + abs(3*x + 2*y) - abs(3*x + 2*y)", of_x - of_y),
            ("max(x, y)", of_x),
            ("if(x > y, x, y)", of_x),
            ("min(x, y)", of_y),
        ] {
            near(end(&text(2.0, "1", cost), 20.0)[2], want, 1e-9);
        }
        // x is driven off by a force that grows: by steps of 2e-5 in which speeds are constant.
        let x = end(&text(1.0, "(0.8 + 0.05*t)", "abs(x - y)"), 20.0);
        near(x[0], 0.19531262, 1e-7);
        near(x[2], 3.89889839, 1e-6);
    }
}

/// A quantity that stands still meets nothing: where rounding has 0.3/0.1 just below 3 its whole
/// part is 3, and stays; a counter passes the next ones.
#[test]
fn whole_parts_of_what_stands_still_do_not_change() {
    let still = "states = ['x', 'y']\nstart = [0.3, 0]\nf = ['0', 'floor(x/0.1) - y']";
    let given =
        "states = ['y']\nstart = [0]\nf = ['floor(p/q) - y']\n[parameters]\np = 0.3\nq = 0.1";
    let counter = "states = ['x', 'y']\nstart = [0, 0]\nf = ['0', 'floor(x/0.1)']\n[[event]]\n\
        every = 1\nset = { x = 'x + 0.1' }";
    for method in Method::ALL {
        let end = |text: &str, t_end: f64| {
            let x = end_of(text, t_end, method).unwrap_or_else(|e| panic!("{method:?}: {e}"));
            x[x.len() - 1]
        };
        near(end(still, 2.0), 3.0 * (1.0 - (-2.0_f64).exp()), 1e-8);
        near(end(given, 2.0), 3.0 * (1.0 - (-2.0_f64).exp()), 1e-8);
        // 0.1 + 0.1 + ... is just below 0.8 and 1 in doubles.
        near(end(counter, 10.5), 45.0 + 0.5 * 10.0, 1e-8);
    }
}

/// The greatest of two constants is one of them: a root of it has a value.
#[test]
fn kinks_of_parameters_are_decided_by_their_values() {
    for (f, want) in [
        ("sqrt(max(p - 3*q, 0)) + 1", 1.0),
        ("sqrt(-min(3*q - p, 0)) + 1", 1.0),
        ("sqrt(abs(p - 3*q)) + 1", 1.0 + 5.551_115_123_125_783e-17_f64.sqrt()),
        ("sqrt(clip(p - 3*q, 0, 1)) + clip(p, 0, 0.2)", 0.2),
    ] {
        let text =
            format!("states = ['x']\nstart = [0]\nf = ['{f}']\n[parameters]\np = 0.3\nq = 0.1");
        for method in Method::ALL {
            near(end_of(&text, 1.0, method).unwrap()[0], want, 1e-12);
        }
    }
}

/// Solutions that leave every bound as a logarithm does, in steps that the time's rounding ends.
#[test]
fn no_method_goes_on_behind_a_logarithmic_blow_up() {
    let grows = "a solution that grows without bound";
    for method in Method::ALL {
        for f in ["exp(x)", "exp(2*x)", "exp(x/3)", "x^2*abs(x)", "exp(x)*(2 + sin(t))"] {
            for start in [0.5, 1.0, 1.3, 2.0, 3.0] {
                let text = format!("states = ['x']\nstart = [{start}]\nf = ['{f}']");
                let said = end_of(&text, 20.0, method).unwrap_err();
                assert!(said.contains(grows), "{method:?} {f} from {start}: {said}");
            }
        }
        for f in ["['exp(x)*(1 + y)', 'x']", "['exp(x) - y', '1']"] {
            for start in [0.5, 1.0, 2.0] {
                let text = format!("states = ['x', 'y']\nstart = [{start}, 0]\nf = {f}");
                let said = end_of(&text, 20.0, method).unwrap_err();
                assert!(said.contains("leaves the domain"), "{method:?} {f} from {start}: {said}");
            }
        }
    }
}

/// Motion that rests at a root's zero is moved by the clock again; events and sections of the time
/// are met meanwhile.
#[test]
fn the_clock_is_asked_while_everything_rests() {
    let end = |states: &str, start: &str, f: &str, t_end: f64, method: Method| {
        let text = format!("states = {states}\nstart = {start}\nf = {f}");
        end_of(&text, t_end, method).unwrap_or_else(|e| panic!("{method:?} {f}: {e}"))
    };
    for method in Method::ALL {
        for (f, want) in [
            ("if(t > 1, 0.5, 0) - 2*max(h - 1, 0)^1.5", 1.396_561_051_13),
            ("heaviside(t - 1)/2 - 2*sqrt(max(h - 1, 0))", 1.062_499_994_8),
            ("if(t > 1, -0.5, 0) - 2*max(h - 1, 0)^1.5", -1.0),
        ] {
            near(end("['h']", "[1]", &format!("['{f}']"), 5.0, method)[0], want, 1e-8);
        }
        let pulled = "['x - 2*max(h - 1, 0)^1.5', 'if(t > 1, 0.2, 0)']";
        near(end("['h', 'x']", "[1, 0]", pulled, 5.0, method)[0], 1.495_854_518_6, 1e-8);
        // A body is stopped by a root of its speed, and pushed later.
        let body = "['v', 'if(t > 10, 1, 0) - sign(v)*abs(v)^0.5']";
        near(end("['x', 'v']", "[0, 2]", body, 20.0, method)[0], 10.228_872_579_7, 1e-7);
        // A tank is empty from t = 1.095 on.
        let tank = "states = ['h', 'n']\nstart = [1.2, 0]\nf = ['-2*sqrt(max(h, 0))', '0']\n\
            [[event]]\nwhen = 'sin(t) - 0.5'\nset = { n = 'n + 1' }\n\
            [[event]]\nwhen = 't - 10'\nstop = true";
        let options = Options { t_end: 20.0, method, ..Options::default() };
        let outcome = follow(&model(tank), &options, &mut |_| true).unwrap();
        assert!(outcome.t == 10.0 && outcome.x[1] == 4.0, "{method:?}: {outcome:?}");
        let tank = "states = ['h']\nstart = [1.2]\nf = ['-2*sqrt(max(h, 0))']";
        let section = twofold_system::Expression::parse_general("sin(t) - 0.5", &["h", "t"]);
        let record = Record::Section(section.unwrap());
        let options = Options { t_end: 12.0, method, record, ..Options::default() };
        let mut times = Vec::new();
        let seen = follow(&model(tank), &options, &mut |point| {
            times.push(point.t);
            true
        });
        seen.unwrap();
        let met = [1.0, 5.0, 13.0, 17.0].map(|k| k * std::f64::consts::PI / 6.0);
        assert!(times.len() == 4 && times.iter().zip(met).all(|(t, met)| (t - met).abs() < 1e-9));
    }
}

/// Powers between one and two have no second derivative at rest, and no series where a speed
/// passes zero.
#[test]
fn powers_of_sizes_are_left_from_rest() {
    for method in Method::ALL {
        for (f, want) in [
            ("t - x*abs(x)^0.5", 2.759_255_016_5),
            ("t - x*sqrt(abs(x))", 2.759_255_016_5),
            ("t - sign(x)*abs(x)^1.5", 2.759_255_016_5),
            ("sin(t) - x*abs(x)^0.8", -0.657_762_432_7),
            ("max(t - 1, 0) - x*abs(x)^0.5", 2.320_209_376_8),
        ] {
            let text = format!("states = ['x']\nstart = [0]\nf = ['{f}']");
            near(end_of(&text, 5.0, method).unwrap()[0], want, 1e-8);
        }
        // A swing through rest, against the same in a spelling without powers.
        let swings = |drag: &str| {
            let text = format!("states = ['x', 'v']\nstart = [2, 0]\nf = ['v', '-x - 0.3*{drag}']");
            end_of(&text, 12.0, method).unwrap_or_else(|e| panic!("{method:?} {drag}: {e}"))
        };
        let (powers, roots) = (swings("sign(v)*abs(v)^1.5"), swings("v*sqrt(abs(v))"));
        assert!(powers.iter().zip(roots).all(|(a, b)| (a - b).abs() < 1e-7), "{method:?}");
    }
}

/// Tanks that stand empty and are filled again: at first by as much as their outlets take, so that
/// the stages of implicit steps depend on their own roots.
#[test]
fn empty_tanks_are_filled_by_every_method() {
    let weir = "states = ['h', 'g']\nstart = [0.2, 0]\nf = ['0.3 - if(h > 0.5, 0.5*(h - 0.5), 0)',\
        'if(h > 0.5, 0.5*(h - 0.5), 0) - 0.3*sqrt(max(g, 0))']";
    let tides = "states = ['h']\nstart = [0.2]\nf = ['max(sin(t), 0) - 2*sqrt(max(h, 0))']";
    for method in Method::ALL {
        let end = |text: &str, t_end: f64| {
            end_of(text, t_end, method).unwrap_or_else(|e| panic!("{method:?}: {e}"))
        };
        // h - 0.5 = 0.6 (1 - exp(-(t - 1)/2)) from t = 1 on.
        let x = end(weir, 3.0);
        near(x[0], 0.5 + 0.6 * (1.0 - (-1.0_f64).exp()), 1e-9);
        near(x[1], 0.112_506_888_4, 1e-8);
        near(end(tides, 38.0)[0], 0.011_927_267_3, 1e-8);
    }
}

/// Twisting comes to rest in finite time, at a target other than zero, too, beside which turns that
/// are shorter than rounding tells do not shrink any more.
#[test]
fn twisting_comes_to_rest_at_its_target() {
    for method in Method::ALL {
        for (a, b) in [(2.0, 1.0), (3.0, 2.0), (5.0, 1.0), (10.0, 7.0)] {
            for target in [0.0, 0.3, 2.0, 50.0, -7.0] {
                let text = format!(
                    "states = ['x', 'v']\nstart = [{}, -0.5]\n\
                    f = ['v', '-{a}*sign(x - ({target})) - {b}*sign(v)']",
                    target + 1.0
                );
                let x = end_of(&text, 60.0, method).unwrap_or_else(|e| panic!("{method:?}: {e}"));
                near(x[0], target, 1e-7);
                near(x[1], 0.0, 1e-7);
            }
        }
    }
}

/// Targets that move: twisting reaches a ramp and stays on it; a root whose argument rounding has
/// beyond zero is crossed as one of a state.
#[test]
fn moving_targets_are_reached() {
    for method in [Method::Dopri5, Method::Radau5, Method::Lsoda] {
        for (f, start) in [
            ("['v', '-3*sign(x - 2 - 0.5*t) - 2*sign(v - 0.5)']", "[3, 0]"),
            ("['v', '-5*sign(x - 2 - 0.5*t) - sign(v - 0.5)']", "[1, -0.5]"),
        ] {
            let text = format!("states = ['x', 'v']\nstart = {start}\nf = {f}");
            let x = end_of(&text, 20.0, method).unwrap_or_else(|e| panic!("{method:?}: {e}"));
            near(x[0], 12.0, 1e-8);
            near(x[1], 0.5, 1e-8);
        }
        let of = |e: &str, w: &str, start: [f64; 2]| {
            let text = format!(
                "states = ['x', 'y']\nstart = {start:?}\n\
                f = ['{w} - 2*sign({e})*sqrt(abs({e}))', '-1.5*sign({e})']"
            );
            end_of(&text, 0.8, method).unwrap_or_else(|e| panic!("{method:?}: {e}"))
        };
        // (dopri5 creeps up to this root, and taylor refuses the mixture: notes/defects.md.)
        if method == Method::Dopri5 {
            continue;
        }
        // The same beside the ramp.
        let (ramp, still) = (of("x - 2 - 0.5*t", "y", [3.0, 0.0]), of("x", "y", [1.0, -0.5]));
        near(ramp[0] - 2.0 - 0.4, still[0], 1e-7);
        near(ramp[1] - 0.5, still[1], 1e-7);
    }
}

/// Super-twisting and differentiators (Levant 1993, 2003) slide in second and third order: on a
/// target that moves, under a disturbance, beside states that their sides do not move, and from
/// where they are there already.
#[test]
fn sliding_of_higher_order_is_followed() {
    let (s, c) = 10.0_f64.sin_cos();
    // The equations, the start, the states at t = 10.
    let known = [
        (
            "['x', 'w']",
            "['-1.5*sign(x - 1)*sqrt(abs(x - 1)) + w', '-1.1*sign(x - 1)']",
            "[0.4, 0]",
            vec![1.0, 0.0],
        ),
        (
            "['x', 'w']",
            "['if(x > sin(t), -1.5*sqrt(x - sin(t)), 1.5*sqrt(sin(t) - x)) + w', \
                'if(x > sin(t), -1.1, 1.1)']",
            "[0.4, 0]",
            vec![s, c],
        ),
        (
            "['x', 'w']",
            "['-4*(sqrt(max(x, 0)) - sqrt(max(-x, 0))) + w + 0.3*cos(t)', '-1.1*sign(x)']",
            "[0.4, 0]",
            vec![0.0, -0.3 * c],
        ),
        (
            "['x', 'w']",
            "['-1.5*sign(x)*abs(x)^0.5 + w + 0.3*sin(t)', '-1.1*sign(x)']",
            "[0, 0]",
            vec![0.0, -0.3 * s],
        ),
        (
            "['x', 'y', 'w', 'q']",
            "['-1.5*sqrt(abs(x))*sign(x) + w + 0.3*sin(t) + 0.2*y', \
                '-1.5*sqrt(abs(y))*sign(y) + q + 0.3*cos(t) - 0.2*x', '-1.5*sign(x)', \
                '-1.5*sign(y)']",
            "[1, -1, 0, 0]",
            vec![0.0, 0.0, -0.3 * s, -0.3 * c],
        ),
        (
            "['z', 'u', 'v']",
            "['-2*3^(1/3)*abs(z - sin(t))^(2/3)*sign(z - sin(t)) + u', \
                '-1.5*3^(2/3)*abs(z - sin(t))^(1/3)*sign(z - sin(t)) + v', \
                '-3.3*sign(z - sin(t))']",
            "[0, 0, 0]",
            vec![s, c, -s],
        ),
    ];
    for (states, f, start, want) in known {
        // (Cube roots are refused by the other two at some ends of the run: notes/defects.md.)
        let cube_roots = [Method::Taylor, Method::Lsoda];
        let methods = if want.len() == 3 { &cube_roots[..] } else { &Method::ALL };
        for method in methods.iter().copied() {
            let text = format!("states = {states}\nstart = {start}\nf = {f}");
            let x = end_of(&text, 10.0, method).unwrap_or_else(|e| panic!("{method:?} {f}: {e}"));
            for (found, want) in x.iter().zip(&want) {
                near(*found, *want, 1e-12);
            }
        }
    }
    // An observer moves nothing of what it observes.
    let pendulum = "'x2', '-sin(x1) - 0.1*x2'";
    let alone = format!("states = ['x1', 'x2']\nstart = [1, 0]\nf = [{pendulum}]");
    let observed = format!(
        "states = ['x1', 'x2', 'h1', 'h2']\nstart = [1, 0, 0, 0]\nf = [{pendulum}, \
            'h2 + 1.8*abs(x1 - h1)^0.5*sign(x1 - h1)', \
            '-sin(x1) - 0.1*h2 + 1.65*sign(x1 - h1)']"
    );
    for method in Method::ALL {
        let (x, y) = (end(&alone, 10.0), end_of(&observed, 10.0, method).unwrap());
        for i in 0..2 {
            near(y[i], x[i], 3e-9);
            near(y[i + 2], y[i], 1e-13);
        }
    }
    // The disturbance grows faster than the gain bears at times, and the motion comes back. (taylor
    // refuses to leave: notes/defects.md.)
    let f = "['-1.5*sign(x)*sqrt(abs(x)) + w + 0.4*sin(2*t) + 0.6*sin(t)', '-1.1*sign(x)']";
    for method in [Method::Dopri5, Method::Radau5, Method::Lsoda] {
        let text = format!("states = ['x', 'w']\nstart = [0.4, 0]\nf = {f}");
        let x = end_of(&text, 20.0, method).unwrap();
        near(x[0], 0.0, 1e-12);
        near(x[1], -0.4 * 40.0_f64.sin() - 0.6 * 20.0_f64.sin(), 1e-12);
    }
    // In units of a millionth.
    for method in Method::ALL {
        let f = "['-1.5e-3*sign(x)*sqrt(abs(x)) + w + 3e-7*cos(t)', '-1.1e-6*sign(x)']";
        let text = format!("states = ['x', 'w']\nstart = [4e-7, 0]\nf = {f}");
        near(end_of(&text, 10.0, method).unwrap()[1], -3e-7 * c, 1e-18);
    }
}

/// Neighbours of sliding of higher order have no common linear motion, wherever it begins.
#[test]
fn sliding_of_higher_order_has_no_tangent_vectors() {
    for start in ["[0.4, 0]", "[0, -0.3]"] {
        let text = format!(
            "states = ['x', 'w']\nstart = {start}\n\
            f = ['-1.5*sign(x)*sqrt(abs(x)) + w + 0.3*cos(t)', '-1.1*sign(x)']"
        );
        let options = Options { t_end: 3.0, ..Options::default() };
        let found = crate::motion::sensitivity::sensitivities(&model(&text), &options, &[]);
        let why = found.unwrap_err().to_string();
        assert!(why.contains("slides in higher order"), "{start}: {why}");
    }
}

/// Where the sides do not brake, or push away, turns about a zero are no sliding.
#[test]
fn turns_that_are_not_braked_go_on() {
    let of = |f: &str, t: f64| end(&format!("states = ['x', 'w']\nstart = [1, 0]\nf = {f}"), t);
    // A period of 4 sqrt(2/1.1).
    let x = of("['w', '-1.1*sign(x)']", 40.0 * (2.0 / 1.1_f64).sqrt());
    near(x[0], 1.0, 1e-8);
    assert!(of("['0.2*sign(x)*sqrt(abs(x)) + w', '-1.1*sign(x)']", 20.0)[0].abs() > 1.0);
}

/// A table's step at the very moment of a landing, a crossing or rest: the motion is on the side on
/// which the step leaves it.
#[test]
fn steps_of_tables_at_a_landing_decide() {
    let of = |f: &str, start: &str, more: &str, rows: &str, t: f64, method: Method| {
        let text = format!(
            "states = ['x', 'y']\nstart = {start}\nf = {f}\n[tables.u]\nfile = 'u.csv'\n\
            time = 't'\ncolumn = 'u'\ninterpolation = 'previous'\n{more}"
        );
        let definition = Definition::from_toml(&text, "test").unwrap();
        let model = Model::new(definition).with_table("u", &format!("t,u\n{rows}")).unwrap();
        let options = Options { t_end: t, method, ..Options::default() };
        follow(&model, &options, &mut |_| true).unwrap().x
    };
    for method in Method::ALL {
        let lands = "['-0.9*sign(x - u)', '0']";
        let x = of(lands, "[0.49, 0]", "", "0,-0.5\n1.1,2.5\n9,0\n", 1.35, method);
        near(x[0], -0.275, 1e-12);
        let x = of("['-sign(x - u)', '0']", "[1, 0]", "", "0,0\n1,-1\n9,0\n", 1.5, method);
        near(x[0], -0.5, 1e-12);
        // A crossing: y gathers 0.5 before and 0.1 beyond.
        let crosses = "['-0.5', 'if(x > u, 0.5, 0.1)']";
        let x = of(crosses, "[0, 0]", "", "0,-0.5\n1,-1\n9,0\n", 3.0, method);
        near(x[1], 1.0 + 0.1, 1e-12);
        let rests = "['if(u > x, 1, 0.3)*(u - x)', '0']";
        let x = of(rests, "[0, 0]", "", "0,0\n1,-1\n9,0\n", 3.0, method);
        near(x[0], -(1.0 - (-0.6_f64).exp()), 1e-9);
        // A reset integrator (Clegg 1958) whose event's zero the step leaves.
        let event = "[[event]]\nname = 'r'\nwhen = 'u - x'\nset = { y = '0' }\n";
        let clegg = "['-x + 2*y', 'u - x']";
        let x = of(clegg, "[0, 0]", event, "0,0\n1,1\n9,1\n", 4.0, method);
        near(x[0], 0.687_172_347_2, 1e-8);
    }
}

/// A gap that leaves zero like t^3 is not closed again by the error of a multistep method's
/// beginning.
#[test]
fn what_leaves_zero_to_third_order_is_not_met_at_once() {
    let sphere = "states = ['th', 'om', 'x', 'y', 'vx', 'vy']\nstart = [0.1, 0, 0, 0, 0, 0]\n\
        [parameters]\nR = 1\n\
        [modes.on]\nf = ['om', '9.81*sin(th)', '0', '0', '0', '0']\n\
        [modes.off]\nf = ['0', '0', 'vx', 'vy', '0', '-9.81']\n\
        [[event]]\nname = 'leave'\nwhen = '9.81*cos(th) - R*om^2'\ndirection = 'down'\n\
        from = 'on'\nmode = 'off'\nset = { x = 'R*sin(th)', y = 'R*cos(th)', \
        vx = 'R*om*cos(th)', vy = '-R*om*sin(th)' }\n\
        [[event]]\nname = 'back'\nwhen = 'x^2 + y^2 - R^2'\ndirection = 'down'\n\
        from = 'off'\nset = { vx = '0.5*vx' }\n\
        [[event]]\nname = 'ground'\nwhen = 'y'\nfrom = 'off'\nstop = true\n";
    for method in Method::ALL {
        let model = model(sphere);
        let options = Options { t_end: 3.0, method, ..Options::default() };
        let mut seen = Vec::new();
        let mut observe = |p: &crate::Point| {
            seen.extend(p.event.map(str::to_owned));
            true
        };
        let end = follow(&model, &options, &mut observe).unwrap();
        seen.dedup();
        assert_eq!(seen, ["leave", "ground"], "{method:?}");
        // Energy, and the horizontal speed of the parabola.
        let c = 2.0 / 3.0 * 0.1_f64.cos();
        near(end.x[4], (9.81 * c).sqrt() * c, 1e-8);
    }
}

/// A store that closes at its lowest level keeps it, also where the demand comes to zero at a row
/// of its table: both fields are zero there.
#[test]
fn what_is_slid_upon_is_decided_anew_where_a_table_steps() {
    let of = |f: &str, rows: &str, method: Method| {
        let text = format!(
            "states = ['g']\nstart = [0.5]\nf = [\"{f}\"]\n[tables.w]\nfile = 'w.csv'\ntime = \
                't'\ncolumn = 'w'\ninterpolation = 'linear'"
        );
        let model = model(&text).with_table("w", rows).unwrap();
        let options = Options { t_end: 3.0, method, ..Options::default() };
        follow(&model, &options, &mut |_| true).unwrap_or_else(|e| panic!("{method:?} {f}: {e}")).x
    };
    for method in Method::ALL {
        for f in ["-max(w, 0)*if(g > 0.2, 1, 0)", "-w*if(g > 0.2, 1, 0)"] {
            for rows in ["t,w\n0,1\n1,0\n2,0\n3,1\n", "t,w\n0,1\n1,0\n3,1\n"] {
                near(of(f, rows, method)[0], 0.2, 1e-14);
            }
        }
        // It fills again.
        let filled = of("-w*if(g > 0.2, 1, 0)", "t,w\n0,1\n1,0\n2,-1\n3,-1\n", method);
        near(filled[0], 1.7, 1e-9);
    }
}

/// Anti-windup that compares the limited signal, which stays at its limit, is the one that compares
/// the signal itself.
#[test]
fn a_limited_signal_is_compared_with_its_limits() {
    let of = |condition: &str, method: Method| {
        let text = format!(
            "states = ['v', 'e']\nstart = [0.5, 0]\nf = ['1.25*u - 0.1*v', 'if({condition}, des - \
                v, 0)']\n[let]\ndes = '20 + 14.4*sin(0.4*t)'\np = '1.5*(des - v) + 0.2*e'\n\
             u = 'clip(p, -3, 6)'"
        );
        end_of(&text, 15.0, method).unwrap_or_else(|e| panic!("{method:?} {condition}: {e}"))
    };
    for method in Method::ALL {
        let want = of("p < 6 and p > -3", method);
        near(want[0], 12.8239777266, 1e-8);
        for condition in ["u < 6 and u > -3", "not (u >= 6 or u <= -3)", "-3 < u and u - 6 < 0"] {
            assert_eq!(of(condition, method), want, "{method:?} {condition}");
        }
    }
}

/// The same motion at a late time, whose rounding is 1e-12 of the run and more: a diode that begins
/// to conduct, and a slow reaction in seconds since 1970.
#[test]
fn late_times_are_as_good_as_early_ones() {
    let rectifier = model(
        "states = ['i', 'v']\nstart = [0, 0]\n\
        f = ['if(i > 0, u, max(u, 0))/0.01', '(i - v/100)/1e-4']\n\
        [let]\nu = 'abs(10*sin(100*pi*t)) - 1.4 - v - 0.5*i'",
    );
    let now = 1.7e9;
    let slow =
        model("states = ['x']\nstart = [0]\nf = ['(if(t < 1700003600, 0.2, 0.3) - x)/3600']");
    for method in Method::ALL {
        for t_start in [0.0, 10.0, 10000.0] {
            let t_end = t_start + 0.06;
            let options = Options { t_start, t_end, method, ..Options::default() };
            let x = follow(&rectifier, &options, &mut |_| true).unwrap().x;
            near(x[1], 7.509_155_407_4, 3e-8);
        }
        let options = Options { t_start: now, t_end: now + 7200.0, method, ..Options::default() };
        let x = follow(&slow, &options, &mut |_| true).unwrap().x;
        let first = 0.2 * (1.0 - (-1.0_f64).exp());
        near(x[0], 0.3 + (first - 0.3) * (-1.0_f64).exp(), 1e-9);
    }
}

/// A block sticks and slips by modes: the speed at which "halt" looks leaves zero like t^2.
#[test]
fn a_mode_is_not_left_where_it_begins() {
    let text = "states = ['x', 'v']\nstart = [0, 0]\n[modes.stick]\nf = ['0', '0']\n\
        [modes.slip]\nf = ['v', 'pull - x - 0.8*sign(v)']\n[let]\npull = '2.302*sin(0.678*t)'\n\
        [[event]]\nname = 'go'\nwhen = 'abs(pull - x) > 0.8'\nfrom = 'stick'\nmode = 'slip'\n\
        [[event]]\nname = 'halt'\nwhen = 'v'\nfrom = 'slip'\nmode = 'stick'\nset = { v = '0' }\n";
    for method in Method::ALL {
        near(end_of(text, 15.0, method).unwrap()[0], 0.302_674_704_8, 1e-9);
    }
}

/// An empty tank whose inflow rises slowly: behind the root of zero the level is analytic in time,
/// and explicit steps would be far shorter than the time since. Numbers by RK4 in sqrt(h) and
/// ln(t - 1), from the series of what attracts.
#[test]
fn an_empty_tank_is_refilled_slowly() {
    for method in Method::ALL {
        let text = "states = ['h']\nstart = [0]\nf = ['max(t - 1, 0)^2 - 0.9*sqrt(max(h, 0))']";
        let x = end_of(text, 3.0, method).unwrap_or_else(|e| panic!("{method:?}: {e}"));
        near(x[0], 1.7557537225275, 2e-10);
        let text = "states = ['h']\nstart = [0]\nf = ['u - 0.9*sqrt(max(h, 0))']\n[tables.u]\n\
            file = 'u.csv'\ntime = 't'\ncolumn = 'u'\ninterpolation = 'pchip'";
        let model = model(text).with_table("u", "t,u\n0,0\n1,0\n2,2\n").unwrap();
        let options = Options { t_end: 2.0, method, ..Options::default() };
        let end = follow(&model, &options, &mut |_| true);
        near(end.unwrap_or_else(|e| panic!("{method:?}: {e}")).x[0], 0.4937019717704, 1e-10);
    }
}

/// An empty tank that is filled again at a constant rate from a moment at which nothing else
/// decides: its level is c s^2 with 2 c = rate - k sqrt(c).
#[test]
fn an_empty_tank_is_refilled_where_a_table_passes_zero() {
    let table = |n: &str| format!("\n[tables.{n}]\nfile = '{n}.csv'\ntime = 't'\ncolumn = '{n}'\n");
    let text = "states = ['h', 'g']\nstart = [0, 0.5]\n\
        f = ['max(u, 0) - 0.777*sqrt(max(h, 0))', '-w']";
    let model = model(&format!(
        "{text}{}interpolation = 'linear'{}interpolation = 'linear'",
        table("u"),
        table("w")
    ));
    let model = model
        .with_table("u", "t,u\n0,-0.5\n0.25,1\n2.25,0\n4.25,-0.5\n6.25,-0.5\n12,0.5\n")
        .unwrap();
    let model = model.with_table("w", "t,w\n0,0\n6.5,0\n8.5,0.5\n12,0\n").unwrap();
    let root = 0.25 * ((0.777_f64 * 0.777 + 8.0 / 5.75).sqrt() - 0.777);
    for method in Method::ALL {
        let options = Options { t_end: 12.0, method, ..Options::default() };
        let end = follow(&model, &options, &mut |_| true);
        let x = end.unwrap_or_else(|e| panic!("{method:?}: {e}")).x;
        near(x[0], (2.875 * root).powi(2), 1e-10);
    }
}

/// A body that rests on its stop lifts off where a growing force comes to zero, like a cube of the
/// time, and strikes nothing.
#[test]
fn a_body_lifts_off_from_rest_without_a_hit() {
    let event = "\n[[event]]\nname = 'hit'\nwhen = 'x'\ndirection = 'down'\n\
        set = { v = '-0.3*v' }\nafter_zeno = 'stick'";
    let head = "states = ['x', 'v']\nstart = [0, 0]\nf = ['v', ";
    for method in Method::ALL {
        let of = |model: &Model, t_end: f64| {
            let (mut hits, options) = (0, Options { t_end, method, ..Options::default() });
            let end = follow(model, &options, &mut |point| {
                hits += usize::from(point.event.is_some());
                true
            });
            assert_eq!(hits, 0, "{method:?}");
            end.unwrap_or_else(|e| panic!("{method:?}: {e}")).x[0]
        };
        for (a, b, c) in [(0.94, 0.764, 0.481), (1.3, 0.7, 0.2), (2.71, 0.93, 0.05)] {
            // With a force a s, s the time since it is zero.
            let fall = |a: f64, s: f64| {
                let drag: f64 = c * s;
                a / (c * c * c) * (0.5 * drag * drag - drag - (-drag).exp_m1())
            };
            let ramp = model(&format!("{head}'{a}*t - {b} - {c}*v']{event}"));
            near(of(&ramp, 2.0), fall(a, 2.0 - b / a), 1e-9);
            let table = "\n[tables.u]\nfile = 'u.csv'\ntime = 't'\ncolumn = 'u'\n\
                interpolation = 'linear'";
            let rows = format!("t,u\n0,-1\n1,-1\n3,{a}\n");
            let table = model(&format!("{head}'u - {b} - {c}*v']{event}{table}"));
            let rate = 0.5 * (a + 1.0);
            let since = 2.0 - (b + 1.0) / rate;
            near(of(&table.with_table("u", &rows).unwrap(), 3.0), fall(rate, since), 1e-9);
        }
    }
}

/// A first-order reset element, which is reset where the error or its own state changes sign: the
/// condition is a product whose factors are both zero to rounding after each reset.
#[test]
fn a_condition_that_is_a_product_is_met_once() {
    let text = "states = ['y', 'v', 'xr', 'n']\nstart = [0, 0, 0, 0]\n\
        f = ['v', '-0.728*v + 3.947*xr', '-0.632*xr + e', '0']\n[let]\ne = '1 - y'\n\
        [[event]]\nwhen = 'e*xr < 0'\nset = { xr = '0', n = 'n + 1' }";
    let model = model(text);
    for method in Method::ALL {
        let options = Options { t_end: 15.0, method, ..Options::default() };
        let x = follow(&model, &options, &mut |_| true).unwrap().x;
        assert_eq!(x[3], 7.0, "{method:?}");
        // Matrix exponentials between the zeros of the error (SciPy).
        near(x[0], 3.7722495010, 1e-8);
        near(x[2], -2.5841105148, 1e-8);
    }
}

/// An oscillator however small it begins, as far as rounding has digits.
#[test]
fn states_that_begin_small_have_their_digits() {
    let model = model("states = ['x', 'v']\nf = ['v', '-x']");
    for size in [1e-145, 1e-150, 1e-151, 1e-200, 1e-230] {
        for method in Method::ALL {
            let start = Some(vec![size, 0.0]);
            let options = Options { start, t_end: 6.0, method, ..Options::default() };
            let x = follow(&model, &options, &mut |_| true).unwrap().x;
            near(x[0] / size, 6.0_f64.cos(), 1e-8);
            near(x[1] / size, -(6.0_f64.sin()), 1e-8);
        }
    }
}

/// A table of previous values has its last one at its last time: events of that moment see it,
/// and it may jump onto or over the zero of others.
#[test]
fn a_table_of_previous_values_ends_with_its_last_row() {
    let table = "\n[tables.u]\nfile = 'u.csv'\ntime = 't'\ncolumn = 'u'\n\
        interpolation = 'previous'";
    for method in Method::ALL {
        for event in ["at = 2", "when = 'u >= 2'", "when = 'u > 1'", "when = 'u - 2'"] {
            let text = format!(
                "states = ['n', 'm']\nstart = [0, 0]\nf = ['0', '1']\n[[event]]\n{event}\n\
                    set = {{ n = 'n + u' }}{table}"
            );
            let model = model(&text).with_table("u", "t,u\n0,0\n1,1\n2,2\n").unwrap();
            let options = Options { t_end: 2.0, method, ..Options::default() };
            let x = follow(&model, &options, &mut |_| true).unwrap().x;
            assert_eq!(x[0], 2.0, "{event}: {method:?}");
        }
    }
}

#[test]
fn a_state_that_stays_zero_takes_no_rounding_from_a_large_factor() {
    // A flag that an event sets; rounding of T, over the factor, was its whole size.
    let text = "states = ['T', 'q']\nstart = [1, 0]\nf = ['-0.3*T + 1e6*q', '0']\n\
        [[event]]\nat = 10\nset = { q = '3e-7' }";
    for method in Method::ALL {
        let options = Options { t_end: 20.0, method, ..Options::default() };
        let end = follow(&model(text), &options, &mut |_| true).unwrap();
        near(end.x[0], 1.0 + (f64::exp(-3.0) - 1.0) * f64::exp(-3.0), 1e-8);
        assert!(end.steps < 2_000, "{method:?}: {} steps", end.steps);
    }
}
