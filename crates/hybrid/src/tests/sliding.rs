//! Sliding on one surface: where it begins, ends and jumps away.

use super::{by_each_method, end, end_of, last, model, near, run, shipped};
use crate::motion::{Exit, Method, Record};
use crate::{Definition, Ending, Model, Options, follow};

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

/// x and z know nothing of each other.
#[test]
fn whole_parts_fall_while_another_surface_is_slid_upon() {
    let apart = "states = ['x', 'z']\nstart = [0, 0.7]\nf = ['floor(-t)', '-max(-0.5, sign(z))']";
    for method in Method::ALL {
        let options = Options { t_end: 4.0, method, max_steps: 1000, ..Options::default() };
        near(follow(&model(apart), &options, &mut |_| true).unwrap().x[0], -10.0, 1e-9);
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

/// Motion that comes to a surface at the moment at which both fields are tangent to it, x = (1 -
/// t)^2/2, and stays on it; a diode that is written by one function of both its sides is the one
/// that is written by `if` (its number is that of `late_times_are_as_good_as_early_ones`).
#[test]
fn surfaces_are_met_where_both_fields_vanish() {
    let tangent = "states = ['x']\nstart = [0.5]\nf = ['-sign(x)*abs(1 - t)']";
    let diode = "states = ['i', 'v']\nstart = [0, 0]\n\
        f = ['u*heaviside(max(i, u))/0.01', '(i - v/100)/1e-4']\n\
        [let]\nu = 'abs(10*sin(100*pi*t)) - 1.4 - v - 0.5*i'";
    for method in Method::ALL {
        let x = end_of(tangent, 3.0, method).unwrap_or_else(|e| panic!("{method:?}: {e}"));
        near(x[0], 0.0, 1e-12);
        let x = end_of(diode, 0.06, method).unwrap_or_else(|e| panic!("{method:?}: {e}"));
        near(x[1], 7.509_155_407_4, 3e-8);
    }
}

/// A reference or a clock among the states is what it was, to its last bit where it stands still:
/// conditions elsewhere compare it.
#[test]
fn what_no_side_moves_is_kept_while_motion_slides() {
    let slides = "states = ['x', 'y', 'n', 'w']\nstart = [0.3, 0, 1, 0]\n\
        f = ['-2*sign(x - n*sin(y))', '1', '0', 'if(n >= 1, 1, 0)']";
    // A ball at rest on a table whose size is a state.
    let lies = "states = ['x', 'v', 'n', 'w']\nstart = [1, 0, 0.1, 0]\n\
        f = ['v', '-9.81 + 3*sin(t)', '0', 'if(n >= 0.1, 1, 0)']\n[[event]]\n\
        when = 'x - n*(1 + 0.3*sin(t))'\ndirection = 'down'\nafter_zeno = 'stick'\n\
        set = { v = '0.3*n*cos(t) - 0.5*(v - 0.3*n*cos(t))' }";
    for method in Method::ALL {
        for (text, n, x) in [(slides, 1.0, 5.0_f64.sin()), (lies, 0.1, 0.1 + 0.03 * 5.0_f64.sin())]
        {
            let end = end_of(text, 5.0, method).unwrap();
            assert_eq!(end[2], n, "{method:?}: {text}");
            near(end[3], 5.0, 1e-9);
            near(end[0], x, 1e-9);
        }
    }
    // A counter that alone, beside the clock, decides a whole part.
    let counts = "states = ['x', 'y', 'n']\nstart = [0.43, 0.8, 0]\n\
        f = ['-1.228*x + floor(0.5*mod(t, 2.01) - 0.659*n)', \
        '-0.94*y + abs(1.241*x - 0.901*sin(2.056*t)) + \
        1.508*sign(1.032 - 0.873*x - 1.763*y)', '0']\n[[event]]\n\
        when = 'mod(t, 2.07) - 0.035*sin(0.564*t) >= 0.156978'\nset = { n = 'mod(n + 1, 3)' }\n\
        [[event]]\nwhen = 'sin(0.878*t) + 0.102*n > 0.699'\n\
        set = { n = 'mod(n + 1, 3)', y = '0.5*y + 0.057' }";
    for method in Method::ALL {
        assert_eq!(end_of(counts, 10.0, method).unwrap()[2], 2.0, "{method:?}");
    }
}

/// Sliding ends where the first of the two sides leads away, though their speeds become equal
/// within the same step.
#[test]
fn sliding_ends_before_its_sides_have_one_speed() {
    for method in Method::ALL {
        let x = end_of(
            "states = ['x']\nstart = [0]\nf = ['if(x > 0, 0.3*(t - 1), 0.003)']",
            4.0,
            method,
        );
        near(x.unwrap()[0], 1.35, 1e-9);
        let two = "states = ['x', 'y']\nstart = [0, 0]\n\
            f = ['if(x > 0, -0.003, 1 - t)', 'if(y > 0, 2*sin(0.1*t - 0.17), 0.007)']";
        let x = end_of(two, 4.0, method).unwrap();
        near(x[0], -4.5, 1e-9);
        near(x[1], 20.0 * (1.0 - 0.23_f64.cos()), 1e-9);
    }
}

/// The jumps of floor(x) and mod(x, 1) are one surface, slid upon with 0.35 of its upper side.
#[test]
fn whole_parts_of_one_quotient_are_one_surface() {
    for saw in ["mod(x, 1)", "mod(3*x, 3)/3", "x - floor(x)", "4*mod(0.25*x, 0.25)"] {
        let text =
            format!("states = ['x', 'y']\nstart = [0.3, 0]\nf = ['0.7 - 2*floor(x)', '{saw}']");
        for outcome in by_each_method(&text, 3.0) {
            near(outcome.x[0], 1.0, 1e-12);
            near(outcome.x[1], 1.95, 1e-9);
        }
    }
}
