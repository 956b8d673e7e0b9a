//! Several switching surfaces at once, and sliding of higher order.

use super::{by_each_method, end, end_of, model, near, run};
use crate::motion::{Exit, Method, Record};
use crate::{Ending, HybridError, Options, follow};

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

/// Functions of a sign that are zero with it at the start, and jump from zero as it does: y = t and
/// z = -t have one sign each from then on.
#[test]
fn functions_that_jump_from_zero_at_the_start_stay_on_their_side() {
    for (f, want) in [
        ("max(1 - heaviside(z), y)", 0.5),
        ("abs(2*heaviside(z) - 2 + y)", 0.875),
        ("if(1 - heaviside(z) > y, 1, 0)", 0.5),
        ("min(heaviside(z), -y)", -0.125),
        ("clip(2*sign(z) + y + 3, 1, 2)", 0.5 + 0.125),
    ] {
        let text = format!("states = ['x', 'y', 'z']\nstart = [0, 0, 0]\nf = ['{f}', '1', '-1']");
        for outcome in by_each_method(&text, 0.5) {
            near(outcome.x[0], want, 1e-9);
        }
    }
}
