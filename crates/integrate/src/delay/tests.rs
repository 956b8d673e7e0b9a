use nalgebra::{SVector, Vector1, Vector2, Vector3};

use super::*;
use crate::{
    DriveOptions, Flow, Kick, KickLaw, Observer, Schedule, StepCap, Stepper, Summary, drive,
};
use twofold_system::{Bound, Caricature, Definition};

/// Takes every step's end, and the passages through x\[coordinate\] = 0 with their senses.
struct Seen<const N: usize> {
    coordinate: usize,
    passages: CrossingFinder,
    crossings: Vec<(f64, SVector<f64, N>, bool)>,
    ends: Vec<(f64, SVector<f64, N>)>,
}

impl<const N: usize> Observer<N> for Seen<N> {
    fn step(&mut self, step: &Step<'_, N>) -> Flow {
        let last = self.ends.last().map_or(0.0, |(t, _)| *t);
        assert_eq!(last, step.t0, "steps follow each other");
        for p in self.passages.through_plane(step, self.coordinate, 0.0) {
            self.crossings.push((step.time(p.theta), step.at(p.theta), p.upward));
        }
        self.ends.push((step.t1, step.x1));
        Flow::Continue
    }
}

struct Recording<const N: usize> {
    options: DriveOptions,
    coordinate: usize,
    x0: SVector<f64, N>,
}

impl<const N: usize> WithStepper<N> for Recording<N> {
    type Answer = (Seen<N>, Summary<N>);
    fn with<M: Stepper<N>>(self, mut stepper: M) -> Self::Answer {
        let mut seen = Seen {
            coordinate: self.coordinate,
            passages: CrossingFinder::default(),
            crossings: Vec::new(),
            ends: Vec::new(),
        };
        let end = drive(&Own, self.x0, &self.options, &mut stepper, &mut seen, &()).unwrap();
        assert_eq!(end.statistics.steps, seen.ends.len() as u64);
        (seen, end)
    }
}

fn system(text: &str) -> System {
    System::new(Definition::from_toml(text, "").unwrap_or_else(|e| panic!("{e}")))
}

fn tolerance(size: f64) -> Tolerance {
    Tolerance { rtol: size, atol: size }
}

#[derive(Clone, Copy)]
struct How {
    delay: f64,
    smooth: Option<(Transition, f64)>,
    history: History,
    /// Of a relay.
    band: Option<(f64, Inside)>,
    method: Method,
    tolerance: f64,
    options: DriveOptions,
    coordinate: usize,
}

impl How {
    fn sharp(delay: f64, t_end: f64) -> Self {
        Self {
            delay,
            smooth: None,
            history: History::Constant,
            band: None,
            method: Method::Dopri5,
            tolerance: 1e-10,
            options: DriveOptions::to(t_end),
            coordinate: 0,
        }
    }
    fn relay(band: f64, t_end: f64) -> Self {
        Self { band: Some((band, Inside::Sign)), ..Self::sharp(0.0, t_end) }
    }
    fn run<const N: usize>(
        &self,
        data: &System,
        x0: [f64; N],
    ) -> Result<(Seen<N>, Summary<N>), DelayError> {
        let (bound, x0): (Bound<N>, _) = (data.bind().unwrap(), SVector::from(x0));
        let sides = Sides::new(&bound, data);
        let switch = match self.band {
            Some((band, inside)) => LateSwitch::Relay { band, inside },
            None => LateSwitch::Delayed {
                delay: self.delay,
                smooth: self.smooth,
                history: self.history,
            },
        };
        let delayed = Delayed { sides, switch, x0 };
        let run = Recording { options: self.options, coordinate: self.coordinate, x0 };
        delayed.with_stepper(self.method, None, tolerance(self.tolerance), run)
    }
}

/// x' = -fall while x(t - delay) > 0, rise otherwise.
fn relay(fall: f64, rise: f64) -> System {
    system(&format!("states = ['x']\nh = 'x'\nplus = ['-{fall}']\nminus = ['{rise}']"))
}

const SHARP: [(Method, f64); 3] =
    [(Method::Dopri5, 1e-10), (Method::Taylor, 1e-14), (Method::TaylorExtended, 1e-30)];

/// A relay with a delay of 1: from 0.3 it falls to -1 and swings between -1 and 1 with period 4.
#[test]
fn a_relay_swings_with_four_delays() {
    let wave =
        |t: f64| if t < 1.3 { 0.3 - t } else { 1.0 - ((t - 1.3).rem_euclid(4.0) - 2.0).abs() };
    for (method, tolerance) in SHARP {
        let how = How { method, tolerance, ..How::sharp(1.0, 21.0) };
        let (seen, end) = how.run(&relay(1.0, 1.0), [0.3]).unwrap();
        for (t, x) in &seen.ends {
            assert!((x[0] - wave(*t)).abs() < 1e-13, "{method:?}: {x} at {t}, not {}", wave(*t));
        }
        assert_eq!(seen.crossings.len(), 11);
        for (k, (t, _, upward)) in seen.crossings.iter().enumerate() {
            assert!(
                (t - 0.3 - 2.0 * k as f64).abs() < 1e-13 && *upward == (k % 2 == 1),
                "{method:?}: {t}"
            );
        }
        assert_eq!(end.t, 21.0);
    }
}

/// A relay with memory swings between the edges of its band with the period 2 band (1/fall +
/// 1/rise).
#[test]
fn a_relay_with_memory_swings_between_its_edges() {
    let (fall, rise, band) = (0.7, 1.9, 0.25);
    let period = 2.0 * band * (1.0 / fall + 1.0 / rise);
    for (method, tolerance) in SHARP {
        let how = How { method, tolerance, ..How::relay(band, 12.0) };
        let (seen, end) = how.run(&relay(fall, rise), [0.1]).unwrap();
        // Down from 0.1 with f+; then up for so much of each period.
        let first = (0.1 + band) / fall;
        let wave = |t: f64| {
            let phase = (t - first).rem_euclid(period);
            let up = 2.0 * band / rise;
            if t < first {
                0.1 - fall * t
            } else if phase < up {
                rise * phase - band
            } else {
                band - fall * (phase - up)
            }
        };
        for (t, x) in &seen.ends {
            assert!((x[0] - wave(*t)).abs() < 1e-13, "{method:?}: {x} at {t}, not {}", wave(*t));
        }
        let up: Vec<f64> = seen.crossings.iter().filter(|c| c.2).map(|c| c.0).collect();
        assert!(
            up.len() > 10 && up.windows(2).all(|u| (u[1] - u[0] - period).abs() < 1e-13),
            "{method:?}: {up:?}"
        );
        assert_eq!(end.t, 12.0);
    }
}

/// Curved flight between switches: x'' = -x under a relay, whose turns are arcs about (-1, 0) and
/// (1, 0). By a surface that is no coordinate, too.
#[test]
fn arcs_between_switches_are_right() {
    let [plane, scaled] = ["x", "x*2 + x"].map(|h| {
        system(&format!(
            "states = ['x', 'v']\nh = '{h}'\nplus = ['v', '-1 - x']\nminus = ['v', '1 - x']"
        ))
    });
    let band = 0.3_f64;
    // From (1, 0): about (-1, 0) with radius 2 until x = -band, then about (1, 0).
    let first = ((1.0 - band) / 2.0).acos();
    let v = -2.0 * first.sin();
    let radius = ((1.0 + band).powi(2) + v * v).sqrt();
    let angle = (-v).atan2(-(1.0 + band));
    // v = -radius sin(angle + t): x grows again and meets +band.
    let second = (2.0 * std::f64::consts::PI - (-(1.0 - band) / radius).acos()) - angle;
    let after = 0.2;
    let v2 = -radius * (angle + second).sin();
    let r2 = ((1.0 + band).powi(2) + v2 * v2).sqrt();
    let a2 = (-v2).atan2(1.0 + band);
    let expected = [-1.0 + r2 * (a2 + after).cos(), -r2 * (a2 + after).sin()];
    for (method, tolerance) in SHARP {
        for (data, band) in [(&plane, band), (&scaled, 3.0 * band)] {
            let how = How { method, tolerance, ..How::relay(band, first + second + after) };
            let end = how.run(data, [1.0, 0.0]).unwrap().1.x;
            let allowed = if method == Method::Dopri5 { 1e-9 } else { 1e-13 };
            assert!(
                (end[0] - expected[0]).abs() < allowed && (end[1] - expected[1]).abs() < allowed,
                "{method:?} {end} {expected:?}"
            );
        }
    }
}

/// Inside the band the choice decides, outside the sign of h; an edge belongs to the band.
#[test]
fn a_relay_begins_as_it_is_told_inside_its_band() {
    for (x0, inside, plus) in [
        (0.1, Inside::Sign, true),
        (-0.1, Inside::Sign, false),
        (0.0, Inside::Sign, false),
        (-0.1, Inside::Plus, true),
        (0.1, Inside::Minus, false),
        (0.25, Inside::Minus, false),
        (-0.25, Inside::Plus, true),
        (0.26, Inside::Minus, true),
        (-0.26, Inside::Plus, false),
    ] {
        let how = How { band: Some((0.25, inside)), ..How::relay(0.25, 1e-3) };
        let end = how.run(&relay(1.0, 1.0), [x0]).unwrap().1.x[0];
        // On an edge that is left at once the switch comes before any step.
        let at_once = x0.abs() == 0.25 && inside != Inside::Sign;
        let falls = plus != at_once;
        assert!(
            (end - x0 - if falls { -1e-3 } else { 1e-3 }).abs() < 1e-15,
            "{x0} {inside:?}: {end}"
        );
    }
}

/// A kick beyond the far edge is a switch at once; one within the band is none; a restart does
/// nothing.
#[test]
fn a_kick_beyond_the_band_switches_a_relay() {
    let kick = |size: f64, seed| Kick { every: 1.0, size, law: KickLaw::Sphere, seed, stream: 0 };
    let options = |schedule| DriveOptions { schedule, kicked_states: 1, ..DriveOptions::to(1.5) };
    let run = |schedule| {
        How { options: options(schedule), ..How::relay(0.5, 1.5) }
            .run(&relay(1.0, 1.0), [1.2])
            .unwrap()
            .1
            .x[0]
    };
    let kicked = |size| {
        (0..10).map(move |seed| run(Schedule { restart_every: None, kick: Some(kick(size, seed)) }))
    };
    assert!((run(Schedule { restart_every: Some(0.4), kick: None }) + 0.3).abs() < 1e-14);
    // From 0.2 to 2.2 and on down, or to -1.8 and up.
    let far: Vec<f64> = kicked(2.0).collect();
    assert!(
        far.iter().all(|x| (x - 1.7).abs() < 1e-14 || (x + 1.3).abs() < 1e-14)
            && far.iter().any(|x| *x < 0.0),
        "{far:?}"
    );
    // From 0.2 to 0.6 or to -0.2: f+ goes on.
    let near: Vec<f64> = kicked(0.4).collect();
    let goes_on = |x: &f64| (x - 0.1).abs() < 1e-14 || (x + 0.3).abs() < 1e-14;
    assert!(near.iter().all(goes_on), "{near:?}");
}

/// The chatter of sliding: x overshoots by what each field does in one delay, and one period is
/// delay (2 + fall/rise + rise/fall).
#[test]
fn chatter_has_its_period_and_its_overshoot() {
    let (fall, rise, delay) = (0.7, 1.9, 1e-3);
    let (seen, _) = How::sharp(delay, 0.1).run(&relay(fall, rise), [0.0]).unwrap();
    let up: Vec<f64> = seen.crossings.iter().filter(|c| c.2 && c.0 > 0.01).map(|c| c.0).collect();
    assert!(up.len() > 15);
    let period = delay * (2.0 + fall / rise + rise / fall);
    for pair in up.windows(2) {
        assert!((pair[1] - pair[0] - period).abs() < 1e-14, "{pair:?} {period}");
    }
    let x = seen.ends.iter().filter(|(t, _)| *t > 0.01).map(|(_, x)| x[0]);
    let (low, high) = x.fold((0.0_f64, 0.0_f64), |(low, high), x| (low.min(x), high.max(x)));
    assert!(
        (high - rise * delay).abs() < 1e-15 && (low + fall * delay).abs() < 1e-15,
        "{low} {high}"
    );
}

/// A switch that turns seven times within one delay: h = cos(2 pi t) decides of x' = +-1 three and
/// a half units of time later.
#[test]
fn passages_wait_in_line() {
    let pi = std::f64::consts::PI;
    let data = system(&format!(
        "states = ['c', 's', 'x']\nh = 'c'\nplus = ['-w*s', 'w*c', '1']\nminus = ['-w*s', 'w*c', \
            '-1']\n\
         [parameters]\nw = {}",
        2.0 * pi
    ));
    let wanted = |t: f64| {
        // Before the delay has passed h is 1; then the integral of the sign of cos(2 pi s).
        let s = t - 3.5;
        let whole = (4.0 * s.max(0.0)).floor();
        let sign =
            |quarter: f64| if matches!(quarter.rem_euclid(4.0) as u8, 0 | 3) { 1.0 } else { -1.0 };
        let quarters: f64 = (0..whole as u32).map(|k| 0.25 * sign(f64::from(k))).sum();
        t.min(3.5) + quarters + sign(whole) * (s.max(0.0) - 0.25 * whole)
    };
    for (method, tolerance) in SHARP {
        let how = How { method, tolerance, ..How::sharp(3.5, 9.0) };
        let (seen, _) = how.run(&data, [1.0, 0.0, 0.0]).unwrap();
        let worst = seen.ends.iter().fold(0.0_f64, |a, (t, x)| a.max((x[2] - wanted(*t)).abs()));
        assert!(worst < 1e-8, "{method:?}: {worst}");
    }
}

/// A passage at the very time of a switch, on whichever side of it rounding puts it: h = sin(f u)
/// passes 0 every pi/f, and the delay is an odd multiple of that. What w' = +-1 makes of it is the
/// integral of the sign of h one delay earlier.
#[test]
fn a_passage_at_the_time_of_a_switch_is_seen() {
    let pi = std::f64::consts::PI;
    let triangle = |y: f64| y.cos().acos();
    for (f, u0, t_end) in [
        (1.0, 0.1, 77.7),
        (1.0, 0.1, 50.5),
        (2.0, 0.5, 50.5),
        (3.0, 0.5 / 3.0, 77.7),
        (7.0, 1.0 / 7.0, 77.7),
    ] {
        let data = system(&format!(
            "states = ['u', 'w']\nh = 'sin({f}*u)'\nplus = ['1', '1']\nminus = ['1', '-1']"
        ));
        for odd in [1.0, 3.0] {
            let delay = odd * pi / f;
            let expected = delay + (triangle(f * (u0 + t_end - delay)) - triangle(f * u0)) / f;
            for (method, tolerance) in
                SHARP.into_iter().chain([(Method::Dopri5, 1e-7), (Method::TaylorExtended, 1e-13)])
            {
                let how = How { method, tolerance, ..How::sharp(delay, t_end) };
                let w = how.run(&data, [u0, 0.0]).unwrap().1.x[1];
                assert!(
                    (w - expected).abs() < 1e-6,
                    "{f} {odd} {method:?} {tolerance}: {w}, not {expected}"
                );
            }
        }
    }
}

/// Below the spacing of the times a switch is lost, and with it the orbit: such a delay is refused,
/// and one above it swings as it should.
#[test]
fn a_delay_that_times_cannot_tell_apart_is_refused() {
    let run = |delay: f64, smooth| {
        let (data, x0) = (relay(1.0, 1.0), Vector1::new(0.5));
        let bound: Bound<1> = data.bind().unwrap();
        let switch = LateSwitch::Delayed { delay, smooth, history: History::Constant };
        let delayed = Delayed { sides: Sides::new(&bound, &data), switch, x0 };
        delayed
            .with_stepper(
                Method::Dopri5,
                None,
                tolerance(1e-10),
                Far { x0, t_end: 0.5 + 1e3 * delay },
            )
            .unwrap()
    };
    for smooth in [None, Some((Transition::Tanh, 1e-2))] {
        for delay in [1e-17, 1e-16, 1e-15, 1e-14] {
            let found = run(delay, smooth);
            assert!(
                matches!(found, Err(Failure::StepUnderflow { h, .. }) if h == delay),
                "{delay} {found:?}"
            );
        }
    }
    for delay in [2e-13, 1e-11, 1e-8] {
        let far = run(delay, None).unwrap();
        assert!((far / delay - 1.0).abs() < 3e-3, "{delay}: {far}");
    }
}

/// Largest distance of an orbit from the surface after t = 0.5, at ends of steps.
struct Far {
    x0: SVector<f64, 1>,
    t_end: f64,
}

impl WithStepper<1> for Far {
    type Answer = Result<f64, Failure>;
    fn with<M: Stepper<1>>(self, mut stepper: M) -> Self::Answer {
        struct Farthest(f64);
        impl Observer<1> for Farthest {
            fn step(&mut self, step: &Step<'_, 1>) -> Flow {
                if step.t0 > 0.5 {
                    self.0 = self.0.max(step.x1[0].abs());
                }
                Flow::Continue
            }
        }
        let mut farthest = Farthest(0.0);
        drive(&Own, self.x0, &DriveOptions::to(self.t_end), &mut stepper, &mut farthest, &())
            .map(|_| farthest.0)
    }
}

/// The start's own zero: on the surface the switch is f-'s, and an orbit that leaves to the other
/// side has passed it at once.
#[test]
fn a_start_on_the_surface_counts_as_not_above() {
    let (seen, end) = How::sharp(0.5, 0.75).run(&relay(1.0, 1.0), [0.0]).unwrap();
    assert!(seen.ends.iter().any(|(t, x)| *t == 0.5 && (x[0] - 0.5).abs() < 1e-15));
    assert!((end.x[0] - 0.25).abs() < 1e-15);
    let (_, end) = How::sharp(0.5, 0.75).run(&relay(1.0, -1.0), [0.0]).unwrap();
    assert!((end.x[0] + 0.75).abs() < 1e-15);
}

#[test]
fn a_kick_moves_the_switch_one_delay_later_and_a_restart_does_nothing() {
    let kick = |size: f64| Kick { every: 1.0, size, law: KickLaw::Sphere, seed: 3, stream: 0 };
    let options = |schedule| DriveOptions { schedule, kicked_states: 1, ..DriveOptions::to(1.75) };
    let run = |schedule| {
        How { options: options(schedule), ..How::sharp(0.5, 1.75) }
            .run(&relay(1.0, 1.0), [2.0])
            .unwrap()
    };
    let (_, plain) = run(Schedule::default());
    assert!((plain.x[0] - 0.25).abs() < 1e-14);
    let (_, restarted) = run(Schedule { restart_every: Some(0.6), kick: None });
    assert!((restarted.x[0] - 0.25).abs() < 1e-14);
    // From 1 to 1 +- 3; below zero the switch turns at 1.5 and the last quarter is gone upwards.
    let (_, kicked) = run(Schedule { restart_every: None, kick: Some(kick(3.0)) });
    let ends = [1.0 + 3.0 - 0.75, 1.0 - 3.0 - 0.5 + 0.25];
    assert!(ends.iter().any(|end| (kicked.x[0] - end).abs() < 1e-14), "{}", kicked.x);
    let seeds = (0..20).map(|seed| {
        run(Schedule { restart_every: None, kick: Some(Kick { seed, ..kick(3.0) }) }).1.x[0]
    });
    let below: Vec<f64> = seeds.filter(|x| *x < 0.0).collect();
    assert!(!below.is_empty() && below.iter().all(|x| (x - ends[1]).abs() < 1e-14), "{below:?}");
}

/// From f- = 2 to f+ = 1 at 0: the orbit was at the surface 0.05 before the start.
#[test]
fn a_history_on_the_flow_has_its_switches() {
    let through = system("states = ['x']\nh = 'x'\nplus = ['1']\nminus = ['2']");
    for (method, tolerance) in SHARP {
        let how = How { method, tolerance, history: History::Flow, ..How::sharp(0.1, 1.0) };
        let (seen, end) = how.run(&through, [0.05]).unwrap();
        assert!(
            seen.ends.iter().any(|(t, _)| (t - 0.05).abs() < 1e-15)
                && (end.x[0] - 1.1).abs() < 1e-14,
            "{method:?}: {}",
            end.x
        );
        // Never at the surface.
        let (_, far) = how.run(&through, [0.2]).unwrap();
        assert!((far.x[0] - 1.2).abs() < 1e-14);
        // It comes from a surface that pushes away on both sides: from which?
        let away = system("states = ['x']\nh = 'x'\nplus = ['1']\nminus = ['-1']");
        for x0 in [0.05, 0.0] {
            let Err(DelayError::NoHistory { t, .. }) = how.run(&away, [x0]) else { panic!("{x0}") };
            assert!((t + x0).abs() < 1e-12, "{t}");
        }
    }
    // Smoothed widely enough the orbit without delay goes through the layer: x' = 2 - phi, once
    // more from the start.
    let layer = Some((Transition::Tanh, 0.01));
    let how =
        How { smooth: layer, history: History::Flow, tolerance: 1e-12, ..How::sharp(0.1, 0.3) };
    let (_, end) = how.run(&through, [0.05]).unwrap();
    // By the midpoint rule: backwards, then x(0.1) = 0.05 + integral of 2 - phi(x(s - 0.1)).
    let phi = |x: f64| 0.5 * (1.0 + (x / 0.01).tanh());
    let mut past = vec![0.05];
    let n = 20_000;
    let h = 0.1 / f64::from(n);
    for _ in 0..n {
        let x: f64 = past[past.len() - 1];
        let middle = x - 0.5 * h * (2.0 - phi(x));
        past.push(x - h * (2.0 - phi(middle)));
    }
    let first = 0.05 + past.windows(2).map(|w| h * (2.0 - phi(0.5 * (w[0] + w[1])))).sum::<f64>();
    // The rest is far above the layer: x' = 1.
    assert!((end.x[0] - (first + 0.2)).abs() < 1e-6, "{} {first}", end.x);
}

/// x' = -x(t - 1) from the constant 1: on [k - 1, k] a polynomial of degree k (Bellman 1961): sum
/// over j of (-1)^j (t - j + 1)^j / j!, j <= k. As a switch: phi = (1 + x/9)/2 where h = x/sqrt(81
/// - x^2) and phi(h) is the algebraic transition of width 1, f+- = -+9. A switch at rest inside its
///   layer, r^2 = 1 and x = 0: what rounding makes of h there ends no steps. A step takes some part
///   of a delay.
#[test]
fn a_switch_at_rest_ends_no_steps() {
    let ring = system(
        "states = ['p', 'q']\nh = 'p*p + q*q - 1'\nplus = ['-0.4*p - q', 'p - 0.4*q']\nminus = \
            ['0.3*p - q', 'p + 0.3*q']",
    );
    let line = system("states = ['p', 'q']\nh = 'p'\nplus = ['-1', '1']\nminus = ['1', '1']");
    for (data, x0, coordinate) in [(&ring, [1.2, 0.0], 1), (&line, [0.3, 0.0], 0)] {
        for (method, tolerance) in
            [(Method::Dopri5, 1e-8), (Method::Dopri5, 1e-11), (Method::Radau5, 1e-10)]
        {
            let smooth = Some((Transition::Tanh, 0.05));
            let how = How { smooth, method, tolerance, coordinate, ..How::sharp(0.05, 12.0) };
            let (seen, end) = how.run(data, x0).unwrap();
            assert!(seen.ends.len() < 6_000, "{method:?} {tolerance}: {} steps", seen.ends.len());
            // At rest 0.3 (1 - phi) = 0.4 phi on the ring, and phi = 1 - phi on the line.
            let h = if coordinate == 1 {
                end.x[0] * end.x[0] + end.x[1] * end.x[1] - 1.0
            } else {
                end.x[0]
            };
            let phi = 0.5 * (1.0 + (h / 0.05).tanh());
            let rest = if coordinate == 1 { 3.0 / 7.0 } else { 0.5 };
            assert!((phi - rest).abs() < 1e-4, "{method:?} {tolerance}: {phi}");
        }
    }
}

fn linear() -> System {
    system("states = ['x']\nh = 'x/sqrt(81 - x*x)'\nplus = ['-9']\nminus = ['9']")
}

fn bellman(t: f64) -> f64 {
    let (mut sum, mut factorial) = (1.0, 1.0);
    for j in 1..40 {
        let base = t - f64::from(j) + 1.0;
        if base <= 0.0 {
            break;
        }
        factorial *= f64::from(j);
        sum += (0..j).fold(1.0, |power, _| power * -base) / factorial;
    }
    sum
}

const SMOOTH: How = How {
    delay: 1.0,
    smooth: Some((Transition::Algebraic, 1.0)),
    history: History::Constant,
    band: None,
    method: Method::Dopri5,
    tolerance: 1e-10,
    options: DriveOptions {
        t_end: 12.0,
        schedule: Schedule { restart_every: None, kick: None },
        step_cap: StepCap::None,
        max_steps: u64::MAX,
        kicked_states: 1,
    },
    coordinate: 0,
};

#[test]
fn a_linear_delay_equation_is_its_polynomials() {
    for (method, tolerance, allowed) in
        [(Method::Dopri5, 1e-10, 1e-9), (Method::Radau5, 1e-10, 1e-8), (Method::Dopri5, 1e-6, 1e-5)]
    {
        let (seen, end) = How { method, tolerance, ..SMOOTH }.run(&linear(), [1.0]).unwrap();
        let worst = seen.ends.iter().fold(0.0_f64, |a, (t, x)| a.max((x[0] - bellman(*t)).abs()));
        assert!(worst < allowed, "{method:?} {tolerance}: {worst}");
        assert_eq!(end.t, 12.0);
        // The jumps that arrive end steps.
        for k in 1..=5 {
            assert!(seen.ends.iter().any(|(t, _)| *t == f64::from(k)), "{k}");
        }
    }
}

/// With equal steps: the error falls with their fifth power, at the ends as between.
#[test]
fn the_smooth_rule_keeps_the_methods_order() {
    let oscillating =
        system("states = ['x', 'v']\nh = 'x'\nplus = ['v', '-1 - x']\nminus = ['v', '1 - x']");
    let end = |method: Method, steps: u32, tolerance: f64| {
        let cap = 0.7 / f64::from(steps);
        let options = DriveOptions {
            step_cap: StepCap::Absolute(cap),
            kicked_states: 2,
            ..DriveOptions::to(7.0)
        };
        let how = How {
            delay: 0.7,
            smooth: Some((Transition::Tanh, 1.0)),
            method,
            tolerance,
            options,
            ..SMOOTH
        };
        how.run(&oscillating, [0.9, 0.2]).unwrap().1.x
    };
    let exact = end(Method::Dopri5, 64, 1e-13);
    for (method, order) in [(Method::Dopri5, 5.0), (Method::Radau5, 4.0)] {
        let errors = [4, 8, 16].map(|n| (end(method, n, 1e3) - exact).amax());
        let orders = [0, 1].map(|i| (errors[i] / errors[i + 1]).log2());
        assert!(
            orders.iter().all(|found| *found > order - 0.5),
            "{method:?}: {errors:?} {orders:?}"
        );
    }
}

/// Steps are remembered for one delay and a half at most.
#[test]
fn the_past_is_one_delay() {
    let mut past = past::Past::constant(Vector1::new(0.0));
    let bound: Bound<1> = linear().bind().unwrap();
    let mut dopri5 = Dopri5::new(tolerance(1e-8));
    let field = twofold_system::Blended { system: &bound, phi: 0.0 };
    dopri5.restart(&field, 0.0, Vector1::new(0.0), 100.0, 0.1).unwrap();
    let mut t = 0.0;
    while t < 50.0 {
        let step = dopri5.step(&field).unwrap();
        t = step.t1;
        past.put(&step, t - 1.5);
        assert!(past.len() <= 18);
        let look = |t: f64| past.at(t, past::Look::After, 1e-12)[0];
        assert!((look(t - 0.73) - 9.0 * (t - 0.73).max(0.0)).abs() < 1e-9);
    }
}

const START: [f64; 3] = [0.2, 0.0, -1.0];

/// The first rows of references in 113-bit arithmetic by an independent program:
/// `tests/data/delay-sharp.csv` has all of them.
#[test]
fn the_caricature_follows_an_independent_program() {
    let rows = [
        (1.170_311_546_805_946, -0.720_921_494_588_762_4),
        (4.706_130_432_412_76, 1.542_515_130_537_061_6),
    ];
    let data = System::from(Caricature::with_reinjection(1e-1, 1e-5));
    for (method, tolerance) in SHARP {
        let how = How { method, tolerance, coordinate: 1, ..How::sharp(1e-3, 5.0) };
        let (seen, _) = how.run(&data, START).unwrap();
        let found: Vec<_> = seen.crossings.iter().map(|c| (c.0, c.1[0])).collect();
        assert_eq!(found.len(), 2);
        for (a, b) in found.iter().zip(rows) {
            let allowed = if method == Method::Dopri5 { 1e-8 } else { 1e-13 };
            assert!(
                (a.0 - b.0).abs() < allowed && (a.1 - b.1).abs() < allowed,
                "{method:?}: {a:?} {b:?}"
            );
        }
    }
}

#[test]
fn without_delay_the_rules_are_those_without_it() {
    let data = System::from(Caricature::with_reinjection(1e-1, 1e-5));
    let at = |how: How| how.run(&data, START).unwrap().1.x;
    // Filippov's sliding motion at t = 3 is what is left of the chatter's mean: the distance falls
    // with the delay.
    let sharp = |delay| at(How { tolerance: 1e-9, ..How::sharp(delay, 3.0) });
    let [a, b, c] = [4e-2, 2e-2, 1e-2].map(sharp);
    let ratio = (a - b).norm() / (b - c).norm();
    assert!((b - c).norm() < 0.05 && ratio > 1.3, "{ratio} {a} {b} {c}");
    // The smooth rule with a delay far below eps is smoothing.
    let layer = Some((Transition::Tanh, 0.05));
    let smooth = |delay| at(How { smooth: layer, tolerance: 1e-9, ..How::sharp(delay, 3.0) });
    let field = twofold_system::Smoothed {
        system: Caricature::with_reinjection(1e-1, 1e-5),
        transition: Transition::Tanh,
        eps: 0.05,
    };
    let mut dopri5 = Dopri5::new(tolerance(1e-11));
    let limit =
        drive(&field, START.into(), &DriveOptions::to(3.0), &mut dopri5, &mut crate::Ignore, &())
            .unwrap()
            .x;
    let errors = [4e-3, 2e-3, 1e-3].map(|delay| (smooth(delay) - limit).norm());
    assert!(
        errors[2] < 0.01 && errors.windows(2).all(|e| (e[0] / e[1] - 2.0).abs() < 0.5),
        "{errors:?}"
    );
}

#[test]
fn methods_that_cannot_say_what_can() {
    for (smooth, able) in [(None, &SHARP_METHODS[..]), (SMOOTH.smooth, &SMOOTH_METHODS[..])] {
        for method in Method::ALL {
            let found = How { smooth, method, tolerance: 1e-6, ..SMOOTH }.run(&linear(), [1.0]);
            match found {
                Ok(_) => assert!(able.contains(&method)),
                Err(error) => {
                    let said = error.to_string();
                    assert!(!able.contains(&method) && said.contains(method.name()), "{said}");
                    assert!(able.iter().all(|m| said.contains(m.name())), "{said}");
                }
            }
        }
    }
}

/// Follows an orbit with a disturbance to a time.
struct To(f64);

impl<const M: usize> WithTangent<M> for To {
    type Answer = SVector<f64, M>;
    fn with<S: TangentStepper<M>>(self, mut stepper: S) -> Self::Answer {
        let (_, start) = stepper.reached();
        stepper.restart(&Own, 0.0, start, self.0, f64::INFINITY).unwrap();
        while stepper.reached().0 < self.0 {
            stepper.step(&Own).unwrap();
        }
        assert!(stepper.length() > 0.0);
        stepper.reached().1
    }
}

fn switches() -> [LateSwitch; 4] {
    let delayed = |smooth, history| LateSwitch::Delayed { delay: 0.05, smooth, history };
    [
        delayed(None, History::Constant),
        delayed(Some((Transition::Tanh, 0.01)), History::Constant),
        delayed(Some((Transition::Algebraic, 0.2)), History::Constant),
        LateSwitch::Relay { band: 0.02, inside: Inside::Sign },
    ]
}

/// A disturbance carried along is what neighbouring orbits are apart: through chatter, by every
/// rule, from three directions.
#[test]
fn disturbances_are_those_of_neighbouring_orbits() {
    let system = Caricature::with_reinjection(1e-1, 1e-5);
    let data = System::from(system);
    let (x0, size, until) = (Vector3::new(0.01, 0.4, 0.5), 1e-6, 0.5);
    for switch in switches() {
        let end = |x0: SVector<f64, 3>| {
            let delayed = Delayed { sides: Sides::new(&system, &data), switch, x0 };
            let run = Recording { options: DriveOptions::to(until), coordinate: 0, x0 };
            let (seen, end) =
                delayed.with_stepper(Method::Dopri5, None, tolerance(1e-13), run).unwrap();
            let in_layer = matches!(
                switch,
                LateSwitch::Delayed { smooth: Some((Transition::Algebraic, _)), .. }
            );
            assert!(in_layer || seen.crossings.len() > 3, "{switch:?}: {}", seen.crossings.len());
            end.x
        };
        for i in 0..3 {
            let direction = SVector::<f64, 3>::ith(i, 1.0);
            let varied = Varied(&system);
            let start =
                SVector::<f64, 6>::from_fn(|k, _| if k < 3 { x0[k] } else { direction[k - 3] });
            let delayed = Delayed { sides: Sides::varied(&varied, &data), switch, x0: start };
            let found = delayed.with_tangent(tolerance(1e-12), To(until)).unwrap();
            let (a, b) = (end(x0 + direction * size), end(x0 - direction * size));
            for k in 0..3 {
                let apart = (a[k] - b[k]) / (2.0 * size);
                let allowed = 1e-5 * (1.0 + apart.abs());
                assert!(
                    (found[3 + k] - apart).abs() < allowed,
                    "{switch:?} {i} {k}: {} {apart}",
                    found[3 + k]
                );
            }
        }
    }
}

/// x' = -sign(x(t - 1)) on its second orbit, of period 4/5, on which three switches are always on
/// their way. A zero t(n) and the switch that the zero before the last but one causes make the next
/// zero: t(n + 1) = 2 (t(n - 2) + 1) - t(n), so that disturbances of the zeros obey d(n + 1) = 2
/// d(n - 2) - d(n): multipliers 1 and -1 +- i.
#[test]
fn disturbances_of_rapid_oscillations_grow_by_the_root_of_two() {
    let data = relay(1.0, 1.0);
    let bound: Bound<1> = data.bind().unwrap();
    let varied = Varied(&bound);
    let switch = LateSwitch::Delayed { delay: 1.0, smooth: None, history: History::Constant };
    let delayed =
        Delayed { sides: Sides::varied(&varied, &data), switch, x0: Vector2::new(0.0, 1.0) };
    let queue = [(0.2, true), (0.6, false), (1.0, true)];
    let mut stepper = delayed
        .sharp_dopri5(tolerance(1e-12))
        .unwrap()
        .carrying(&varied)
        .with_queue(false, true, &queue);
    stepper.restart(&Own, 0.0, Vector2::new(0.0, 1.0), 100.0, f64::INFINITY).unwrap();
    let mut zeros = vec![0.0, 0.0, 0.0, 1.0];
    let mut finder = CrossingFinder::starting(true);
    while zeros.len() < 34 {
        let step = stepper.step(&Own).unwrap();
        let (t0, found) = (step.t0, finder.through_plane(&step, 0, 0.0));
        for crossing in found {
            let n = zeros.len() - 3;
            assert!((step.time(crossing.theta) - 0.4 * n as f64).abs() < 1e-9, "{t0}");
            // The speed is 1: a later zero is a higher orbit while it falls.
            let later = step.at(crossing.theta)[1] * if crossing.upward { -1.0 } else { 1.0 };
            let due = zeros[zeros.len() - 1];
            assert!((later - due).abs() < 1e-9 * f64::abs(due).max(1.0), "{n}: {later} {due}");
            zeros.push(2.0 * zeros[zeros.len() - 3] - due);
        }
    }
    // Eight zeros, three turns of the pair: 2^4, beside what stays.
    assert!((zeros[33] / zeros[25] - 16.0).abs() < 0.1, "{zeros:?}");
}

/// A pulse of width 1e-4 in the fields, or in the switching function, is not jumped over.
#[test]
fn thin_pulses_are_seen() {
    let bell = "exp(-((s - 37.123)/1e-4)^2)";
    let made = |h: &str, plus: &str, minus: &str| {
        system(&format!(
            "states = ['q', 's']\nh = '{h}'\nplus = ['{plus}', '1']\nminus = ['{minus}', '1']"
        ))
    };
    let forced = made("q + 100", &format!("1e4*{bell}"), &format!("1e4*{bell}"));
    let switched = made(&format!("{bell} - 0.5"), "1e4", "0");
    let layer = Some((Transition::Tanh, 1e-3));
    let area = std::f64::consts::PI.sqrt();
    // Where the bell is above a half; by the relay from 0.6 on until it is 0.4.
    let [width, relays] = [[0.5_f64, 0.5], [0.6, 0.4]].map(|[on, off]| {
        twofold_num::elementary::sqrt(-twofold_num::elementary::ln(on))
            + twofold_num::elementary::sqrt(-twofold_num::elementary::ln(off))
    });
    for method in [Method::Dopri5, Method::Taylor] {
        let (late, relay) = (How::sharp(0.1, 80.0), How::relay(0.1, 80.0));
        for (how, wanted) in [(late, width), (relay, relays)] {
            for (data, q) in [(&forced, area), (&switched, wanted)] {
                let (_, end) = How { method, ..how }.run(data, [0.0, 0.0]).unwrap();
                assert!((end.x[0] - q).abs() < 1e-6, "{method:?}: {} {q}", end.x[0]);
            }
        }
    }
    for method in [Method::Dopri5, Method::Radau5] {
        let how = How { method, smooth: layer, ..How::sharp(0.1, 80.0) };
        for (data, q) in [(&forced, area), (&switched, width)] {
            let (_, end) = how.run(data, [0.0, 0.0]).unwrap();
            assert!((end.x[0] - q).abs() < 1e-4, "{method:?}: {} {q}", end.x[0]);
        }
    }
    // Switching functions of other forms, passed by s from -1 to 1 without a step there. Above
    // zero each is while a step function is within 0.5 of its middle.
    let width = 2e-4 * 0.5_f64.sqrt().atanh();
    let flat = "0.5 - tanh((s - 1.2345)/1e-4)^2";
    let made = |h: &str| made(h, "1e4", "0");
    for how in [How::sharp(0.1, 3.0), How::relay(1e-10, 3.0), How::relay(0.01, 3.0)] {
        let band = how.band.map_or(0.0, |(band, _)| band);
        let half = |at: f64| 1e-4 * (0.5_f64 + at).sqrt().atanh();
        let q = if band > 0.0 { 1e4 * (half(-band) + half(band)) } else { 1e4 * width };
        let (_, end) = how.run(&made(flat), [0.0, 0.0]).unwrap();
        assert!((end.x[0] - q).abs() < 1e-6, "{band}: {} {q}", end.x[0]);
    }
    // In a layer wider than the switching function: the integral of phi, by Simpson's rule.
    for (h, f) in [
        (flat, (|u: f64| 0.5 - u.tanh().powi(2)) as fn(f64) -> f64),
        ("exp(-((s - 1.2345)/1e-4)^2) - 0.5", |u| (-u * u).exp() - 0.5),
        // Without a zero, on one side or the other.
        ("exp(-((s - 1.2345)/1e-4)^2) + 0.1", |u| (-u * u).exp() + 0.1),
        ("exp(-((s - 1.2345)/1e-4)^2) - 1.1", |u| (-u * u).exp() - 1.1),
    ] {
        let phi = |u: f64| 0.5 * (1.0 + (f(u) / 0.1).tanh());
        let rest = phi(1e3);
        let weight = |k: i32| [2.0, 4.0][k as usize % 2];
        let pulse: f64 =
            (-8000..8000).map(|k: i32| weight(k.abs()) * (phi(f64::from(k) * 1e-3) - rest)).sum();
        let q = 1e4 * 3.0 * rest + pulse * 1e-3 / 3.0;
        for method in [Method::Dopri5, Method::Radau5] {
            let smooth = Some((Transition::Tanh, 0.1));
            let how = How { method, smooth, ..How::sharp(0.1, 3.0) };
            let (_, end) = how.run(&made(h), [0.0, 0.0]).unwrap();
            assert!((end.x[0] - q).abs() < 1e-4, "{h} {method:?}: {} {q}", end.x[0]);
        }
    }
}

/// Windows of cos(w u) > c that last 4e-3 and less: each is passed, by every method.
#[test]
fn narrow_windows_of_a_wave_are_passed() {
    let pi = std::f64::consts::PI;
    for (w, c, t_end) in [(3.0, 0.999_999_9, 300.0), (3.0, 0.99999, 300.0), (0.3, 0.99999, 1000.0)]
    {
        let data = system(&format!(
            "states = ['u', 'n']\nh = 'cos({w}*u) - {c}'\nplus = ['1', '1']\nminus = ['1', '0']"
        ));
        let half = 2.0 * (0.5_f64 * (1.0 - c)).sqrt().asin() / w;
        let windows = (w * t_end / (2.0 * pi)).floor();
        assert!(w * t_end - 2.0 * pi * windows > w * half);
        let wanted = half * (1.0 + 2.0 * windows);
        for (method, tolerance) in SHARP {
            for how in [How::sharp(1e-6, t_end), How::relay(1e-12, t_end)] {
                // The first ends late; those after it begin late, too.
                let late = how.delay;
                let (_, end) = How { method, tolerance, ..how }.run(&data, [0.0, 0.0]).unwrap();
                let n = end.x[1];
                assert!((n - wanted - late).abs() < 1e-6, "{method:?} {w} {c}: {n} {wanted}");
            }
        }
    }
}

/// The failure of a run.
struct Failing(SVector<f64, 2>);

impl WithStepper<2> for Failing {
    type Answer = Failure;
    fn with<M: Stepper<2>>(self, mut stepper: M) -> Failure {
        let to = DriveOptions::to(3.0);
        drive(&Own, self.0, &to, &mut stepper, &mut crate::Ignore, &()).unwrap_err()
    }
}

/// A sign in the fields that attracts is refused under the smooth rule, too. Steps would have no
/// end there.
#[test]
fn a_jump_that_attracts_is_refused_by_the_smooth_rule() {
    let fields = "plus = ['-1', '-sign(y - 1)']\nminus = ['1', '-sign(y - 1)']";
    let data = system(&format!("states = ['x', 'y']\nh = 'x - 1'\n{fields}"));
    let bound: Bound<2> = data.bind().unwrap();
    let smooth = Some((Transition::Tanh, 0.05));
    let switch = LateSwitch::Delayed { delay: 0.1, smooth, history: History::Constant };
    for method in SMOOTH_METHODS {
        let x0 = Vector2::new(1.5, 0.0);
        let delayed = Delayed { sides: Sides::new(&bound, &data), switch, x0 };
        let failure = delayed.with_stepper(method, None, tolerance(1e-9), Failing(x0)).unwrap();
        let Failure::StaysOnJump { t, state, .. } = failure else { panic!("{failure}") };
        assert!((t - 1.0).abs() < 1e-3 && (state[1] - 1.0).abs() < 1e-3, "{t} {state:?}");
    }
}
