//! Events, conditions, clocks and modes.

use super::{by_each_method, end, end_of, last, model, near, run, shipped};
use crate::motion::{Method, Record, follow_to_rest, sensitivity};
use crate::{Ending, Options, follow};

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

/// The period is ln((high - cold)/(high - warm))/k + ln((warm - low)/(cold - low))/k = 20 ln 1.5.
#[test]
fn a_thermostat_has_its_period() {
    let (events, _) = run(&shipped("relay-hysteresis"), 100.0);
    let on: Vec<f64> = events.iter().filter(|(_, e)| e == "too cold").map(|(t, _)| *t).collect();
    let period = 20.0 * 1.5_f64.ln();
    near(on[0], period, 1e-9);
    near(on[on.len() - 1] - on[on.len() - 3], period, 1e-9);
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

/// An event that fires more often than there may be steps ends no run after hours.
#[test]
fn an_event_that_fires_too_often_is_refused_at_once() {
    let text = "states = ['x']\nstart = [0]\nf = ['1']\n[[event]]\nevery = 1e-300";
    let error = run(&model(text), 1.0).1.unwrap_err().to_string();
    assert!(error.contains("`every` is 1e-300, 1.0e300 times"), "{error}");
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

/// Where the sides do not brake, or push away, turns about a zero are no sliding.
#[test]
fn turns_that_are_not_braked_go_on() {
    let of = |f: &str, t: f64| end(&format!("states = ['x', 'w']\nstart = [1, 0]\nf = {f}"), t);
    // A period of 4 sqrt(2/1.1).
    let x = of("['w', '-1.1*sign(x)']", 40.0 * (2.0 / 1.1_f64).sqrt());
    near(x[0], 1.0, 1e-8);
    assert!(of("['0.2*sign(x)*sqrt(abs(x)) + w', '-1.1*sign(x)']", 20.0)[0].abs() > 1.0);
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

/// x = (t - 1)^3/3 from the start of a mode at t = 1, which rounding may put a little before: the
/// second derivative there is rounding. x^3 v of x = t^3/6 leaves zero like t^11.
#[test]
fn rounding_does_not_decide_where_higher_orders_do() {
    let cube = "states = ['x', 'n']\nstart = [-1, 0]\n[modes.a]\nf = ['1', '0']\n[modes.b]\n\
        f = ['(t - 1)^2', '0']\n[[event]]\nwhen = 'x'\nfrom = 'a'\nmode = 'b'\n\
        [[event]]\nwhen = 'x'\nfrom = 'b'\nset = { n = 'n + 1' }";
    let product = "states = ['x', 'v', 'n']\nstart = [0, 0, 0]\nf = ['v', 't', '0']\n\
        [[event]]\nwhen = 'x^3*v'\nset = { n = 'n + 1' }";
    for method in Method::ALL {
        let x = end_of(cube, 3.0, method).unwrap_or_else(|e| panic!("{method:?}: {e}"));
        near(x[0], 8.0 / 3.0, 1e-9);
        assert_eq!(x[1], 0.0, "{method:?}");
        let x = end_of(product, 10.0, method).unwrap_or_else(|e| panic!("{method:?}: {e}"));
        near(x[0], 1000.0 / 6.0, 1e-7);
        assert_eq!(x[2], 0.0, "{method:?}");
    }
}

/// A loop whose rail is left, and met again by a condition that leaves zero to third order: the
/// flights are parabolas, and between them the pendulum's (SciPy's DOP853 at 1e-13).
#[test]
fn a_condition_that_leaves_zero_to_third_order_is_not_met_at_once() {
    let text = |speed: f64, friction: f64| {
        format!(
            "states = ['th', 'om', 'x', 'y', 'vx', 'vy']\nstart = [0, {speed}, 0, 0, 0, 0]\n\
            [modes.on]\nf = ['om', '-9.81*sin(th) - {friction}*om', '0', '0', '0', '0']\n\
            [modes.fly]\nf = ['0', '0', 'vx', 'vy', '0', '-9.81']\n\
            [[event]]\nwhen = 'om^2 + 9.81*cos(th)'\ndirection = 'down'\nfrom = 'on'\n\
            mode = 'fly'\nset = {{ x = 'sin(th)', y = '-cos(th)', vx = 'om*cos(th)', \
            vy = 'om*sin(th)' }}\n\
            [[event]]\nwhen = 'x^2 + y^2 > 1'\nfrom = 'fly'\nmode = 'on'\n\
            set = {{ th = 'atan2(x, -y)', om = '0.9*(vx*(-y) + vy*x)' }}"
        )
    };
    for (speed, friction, want) in [
        (4.715, 0.0, [-1.2968865, -2.33405868]),
        (4.619, 0.156, [-1.16783838, 0.09786029]),
        (4.809, 0.0, [-1.26391883, -2.46058763]),
        (6.143, 0.18, [-0.22048716, 0.52770361]),
    ] {
        for method in Method::ALL {
            let x = end_of(&text(speed, friction), 4.0, method)
                .unwrap_or_else(|e| panic!("{method:?} {speed}: {e}"));
            near(x[0], want[0], 2e-8);
            near(x[1], want[1], 2e-8);
        }
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

/// The rows' jumps are at multiples of 0.379, each once, on whichever side rounding puts them.
#[test]
fn a_condition_with_a_whole_part_is_met_once_at_its_jump() {
    for extra in ["and x > -50", "and y < 5"] {
        let text = format!(
            "states = ['x', 'y', 'n']\nstart = [0.3, 0, 0]\nf = ['1.5 - x', '1 - y', '0']\n\
                [[event]]\nwhen = 'mod(t, 0.379) < 0.266 {extra}'\n\
                set = {{ x = '0.5*x + 1', y = '0', n = 'n + 1' }}"
        );
        for outcome in by_each_method(&text, 20.01) {
            near(*outcome.x.last().unwrap(), 52.0, 0.0);
        }
    }
}

/// Each becomes true when its first half does: the reset does not move that.
#[test]
fn a_reset_of_one_half_of_a_condition_does_not_make_it_true_again() {
    let counts = [
        ("t > 1.3 and y < 5", 1.0),
        ("x < 0.4 and y < 5", 1.0),
        ("x < 0.4 or y > 5", 1.0),
        ("sin(3*t) > 0.5 and y < 5", 4.0),
        ("abs(mod(t, 0.5) - 0.413) < 0.1 and y < 5", 16.0),
        ("mod(floor(s/0.7), 2) > 0.5 and y < 5", 6.0),
    ];
    for (when, count) in counts {
        let text = format!(
            "states = ['x', 'y', 's', 'n']\nstart = [1, 0.3, 0, 0]\nf = ['-x', '1.5 - y', '1', \
                '0']\n[[event]]\nwhen = '{when}'\nset = {{ y = '0.5*y + 0.3', n = 'n + 1' }}"
        );
        for outcome in by_each_method(&text, 8.0) {
            assert_eq!(outcome.ending, Ending::Finished, "{when}");
            near(*outcome.x.last().unwrap(), count, 0.0);
        }
    }
}

/// The whole part of a whole part moves with that alone, also at the very start.
#[test]
fn square_waves_by_whole_parts_begin_at_a_jump() {
    let counts = [
        ("mod(floor(-t/0.7), 2) > 0.5", 5.0),
        ("not (mod(s, 0.5) >= 0.25) and mod(floor(t/1.6), 2) > 0.5", 7.0),
    ];
    for (when, count) in counts {
        let text = format!(
            "states = ['y', 's', 'n']\nstart = [0.3, 0, 0]\nf = ['1.5 - y', '1', '0']\n\
                [[event]]\nwhen = '{when}'\nset = {{ y = '0.5*y + 0.3', n = 'n + 1' }}"
        );
        for outcome in by_each_method(&text, 7.9) {
            near(*outcome.x.last().unwrap(), count, 0.0);
        }
    }
}

/// A condition that holds where its mode begins has not become true, also if the event that begins
/// the mode sets the state; one of both modes has.
#[test]
fn what_holds_where_its_mode_begins_is_no_event() {
    for (from, want) in [("from = 'b'\n", 0.0), ("", 1.0)] {
        let text = format!(
            "states = ['x', 'n']\nstart = [0, 0]\n[modes.a]\nf = ['1', '0']\n[modes.b]\nf = \
                ['1', '0']\n[[event]]\nwhen = 'x - 1'\nfrom = 'a'\nmode = 'b'\nset = {{ x = '2' \
                }}\n[[event]]\nwhen = 'x > 1.5'\n{from}set = {{ n = 'n + 1' }}"
        );
        for outcome in by_each_method(&text, 2.0) {
            assert_eq!(outcome.x[1], want, "{from}");
        }
    }
}

/// Bounds that are functions of numbers and parameters: false until x = 5 at t = 3, beside any
/// other switching function.
#[test]
fn conditions_see_what_parameters_decide() {
    let conditions = [
        "x >= abs(q)",
        "-max(q, -9) <= x",
        "not (x < clip(p, 0, 9))",
        "x >= min(p, 9) and x >= max(q, 2)",
    ];
    for (condition, f) in conditions.iter().flat_map(|c| [(c, "sign(x + 9)"), (c, "1.5 - abs(s)")])
    {
        let text = format!(
            "states = ['x', 's', 'n']\nstart = [1, 0.5, 0]\nf = ['{f}', '0', '0']\n\
            [parameters]\np = 5\nq = -5\n[[event]]\nat = 0.5\nset = {{ x = 'x + 1' }}\n\
            [[event]]\nwhen = '{condition}'\nset = {{ n = 'n + t' }}"
        );
        for outcome in by_each_method(&text, 4.0) {
            near(outcome.x[2], 3.0, 1e-9);
        }
    }
}
