//! Error control, units, small states and the four methods.

use super::{by_each_method, end, end_of, last, model, near, run, shipped, taylor};
use crate::motion::{Method, Record};
use crate::{Ending, HybridError, Options, follow};

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

/// From zero on a speed that falls at once says nothing of how large the state becomes.
#[test]
fn a_speed_that_falls_at_once_is_no_size() {
    let methods = [Method::Dopri5, Method::Radau5, Method::Taylor];
    let by_time = "states = ['x']\nstart = [0]\nf = ['1/(1e-12 + t)']";
    for method in methods {
        let want = 1e12_f64.ln_1p();
        near(end_of(by_time, 1.0, method).unwrap()[0], want, 1e-8 * want);
    }
    for outcome in by_each_method("states = ['x']\nstart = [0]\nf = ['1/(1e-12 + x)']", 1.0) {
        near(outcome.x[0], 2.0_f64.sqrt() - 1e-12, 1e-8);
    }
    // The layer is 1e-12 wide, and 1 + 1e-12 ln(1e12) is where it leads to.
    let layer = "states = ['x']\nstart = [0]\nf = ['1e12*exp(-1e12*x) + 1']";
    for method in methods {
        near(end_of(layer, 1.0, method).unwrap()[0], 1.0 + 2.763e-11, 1e-10);
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

/// A dead zone that is dragged along comes to its edge like an exponential, and its input steps
/// later: what step the input makes there says nothing about the edge before.
#[test]
fn an_edge_that_is_approached_does_not_see_later_steps() {
    let by_if = "states = ['x']\nstart = [0]\n\
        f = ['24.7*min(u - x + 0.224, 0) + 24.7*max(u - x - 0.224, 0)']\n\
        [let]\nu = 'if(t >= 1.699, 0, -0.85)'";
    let by_table = "states = ['x']\nstart = [0]\n\
        f = ['max(20*(u - x - 0.2), 0) + min(20*(u - x + 0.2), 0)']\n\
        [tables.u]\nfile = 'u.csv'\ntime = 't'\ncolumn = 'u'\ninterpolation = 'previous'";
    for method in Method::ALL {
        let x = end_of(by_if, 8.0, method).unwrap_or_else(|e| panic!("{method:?}: {e}"));
        near(x[0], -0.224, 1e-10);
        let table = model(by_table).with_table("u", "t,u\n0,0\n0.5,-1\n2,0\n7,-1\n8,0\n").unwrap();
        let options = Options { t_end: 8.0, method, ..Options::default() };
        let x =
            follow(&table, &options, &mut |_| true).unwrap_or_else(|e| panic!("{method:?}: {e}")).x;
        near(x[0], -0.8 + 0.6 * (-20.0_f64).exp(), 2e-11);
    }
}

/// Series of what is asked alone, and of what begins like t^5: a ball that a table carries and
/// throws up, whose gap is another mode's event and stays zero (parabolas and a sine); Bouc and
/// Wen's hysteresis from rest (SciPy's DOP853 at 1e-13, from switch to switch).
#[test]
fn series_follow_what_is_sought_alone_and_what_begins_late() {
    let table = "states = ['x', 'v']\nstart = [0, 7.78002]\n[let]\ns = '1.524*sin(5.105*t)'\n\
        u = '7.78002*cos(5.105*t)'\na = '-39.7170021*sin(5.105*t)'\n\
        [modes.contact]\nf = ['u', 'a']\n[modes.flight]\nf = ['v', '-9.81']\n\
        [[event]]\nwhen = 'a + 9.81 < 0'\nfrom = 'contact'\nmode = 'flight'\n\
        [[event]]\nwhen = 'x - s'\ndirection = 'down'\nfrom = 'flight'\nmode = 'contact'\n\
        set = { x = 's', v = 'u' }";
    let wen = "states = ['x', 'v', 'z']\nstart = [0, 0, 0]\n\
        f = ['v', 'sin(t) - x - z', 'v*(1 - 0.5*sign(v*z)*z^2)']";
    for method in Method::ALL {
        let x = end_of(table, 2.123, method).unwrap_or_else(|e| panic!("{method:?}: {e}"));
        near(x[0], -1.505_098_584_920_3, 2e-9);
        near(x[1], -1.221_517_266_365_2, 2e-9);
        let x = end_of(wen, 20.0, method).unwrap_or_else(|e| panic!("{method:?}: {e}"));
        for (x, want) in x.iter().zip([0.76844161, 0.62990974, 0.78152524]) {
            near(*x, want, 2e-8);
        }
    }
}

/// Integrals of errors of other states alone are measured by those: an observer's error that
/// begins at zero, the error of a reference that is followed exactly, a clock beside the time.
#[test]
fn integrals_of_errors_do_not_stop_the_motion() {
    let text =
        |states: &str, start: &str, f: &str| format!("states = {states}\nstart = {start}\nf = {f}");
    let clock = text("['c', 'w']", "[0, 0]", "['1', 'c - t']");
    let driven = text("['x', 'w']", "[0, 0]", "['1 + 0.5*w', 't - x']");
    let observer = "['-x + cos(t)', '-y + cos(t) + 3*(x - y)', 'x - y']";
    let observer = text("['x', 'y', 'w']", "[1, 1, 0]", observer);
    let follows = text("['x', 'w']", "[0, 0]", "['cos(t)', 'sin(t) - x']");
    let x = 0.5 * (6.0_f64.cos() + 6.0_f64.sin() + (-6.0_f64).exp());
    for method in Method::ALL {
        for (text, want) in
            [(&clock, 6.0), (&driven, 6.0), (&observer, x), (&follows, 6.0_f64.sin())]
        {
            let options = Options { t_end: 6.0, method, max_steps: 5_000, ..Options::default() };
            let found = follow(&model(text), &options, &mut |_| true);
            let found = found.unwrap_or_else(|e| panic!("{method:?}: {e}\n{text}")).x;
            near(found[0], want, 1e-8);
            near(*found.last().unwrap(), 0.0, 1e-8);
        }
        // Small differences that are none of errors keep their digits.
        let small = text("['x', 'w']", "[1e-4, 0]", "['0', '1 - cos(x)']");
        let found = end_of(&small, 6.0, method).unwrap()[1];
        near(found, 6.0 * 2.0 * 5e-5_f64.sin().powi(2), 1e-15);
    }
}
