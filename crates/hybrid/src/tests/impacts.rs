//! Impacts, contacts, stops and bodies that rest on each other.

use super::{end, end_of, model, near, run, shipped};
use crate::motion::{Method, Record};
use crate::{Ending, Model, Options, follow};

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

#[test]
fn a_ball_that_lies_on_the_floor_stays_there() {
    let ball = "states = ['x', 'v']\nstart = [0, 0]\nf = ['v', '-1']\n[[event]]\nwhen = \
        'x'\ndirection = 'down'\nset = { v = '-0.5*v' }\nafter_zeno = 'stick'";
    assert_eq!(end(ball, 5.0), [0.0, 0.0]);
    // Lifted, it leaves.
    near(end(&ball.replace("'-1'", "'t - 1'"), 4.0)[0], 4.5, 1e-9);
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
