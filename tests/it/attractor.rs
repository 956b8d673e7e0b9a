//! Verdicts, exponents and multipliers on systems whose answers are known.
#![allow(clippy::disallowed_methods)] // exact solutions are compared to tolerances, not hashed

use nalgebra::{SVector, Vector2, Vector3, Vector4};
use twofold::analyse::attractor::{
    Evidence, Question, SectionPoint, Thresholds, Verdict, classify,
};
use twofold::analyse::floquet::{self, ReturnPlane, closed_orbit};
use twofold::analyse::lyapunov::{self, largest};
use twofold::integrate::{
    Dopri5, DriveOptions, Flow, Ignore, Observer, Step, StepCap, Tolerance, drive, roots,
};
use twofold::num::Elementary;
use twofold::num::random::RandomStream;
use twofold::paper::claim::Claim;
use twofold::system::{Caricature, Hysteretic, Relaxation, Smoothed, Transition, VectorField};

/// Lorenz (1963) at sigma = 10, rho = 28, beta = 8/3.
struct Lorenz;
impl VectorField<3> for Lorenz {
    fn eval<S: Elementary>(&self, s: &SVector<S, 3>) -> SVector<S, 3> {
        let [x, y, z] = [s[0], s[1], s[2]];
        Vector3::new(
            (y - x).scale(10.0),
            x * (S::from_f64(28.0) - z) - y,
            x * y - z.scale(8.0 / 3.0),
        )
    }
}

/// Rossler (1976) at a = b = 0.2 and the given c.
struct Rossler(f64);
impl VectorField<3> for Rossler {
    fn eval<S: Elementary>(&self, s: &SVector<S, 3>) -> SVector<S, 3> {
        let [x, y, z] = [s[0], s[1], s[2]];
        Vector3::new(-y - z, x + y.scale(0.2), S::from_f64(0.2) + z * (x - S::from_f64(self.0)))
    }
}

/// van der Pol (1926) at mu = 1.
struct VanDerPol;
impl VectorField<2> for VanDerPol {
    fn eval<S: Elementary>(&self, s: &SVector<S, 2>) -> SVector<S, 2> {
        Vector2::new(s[1], (S::one() - s[0] * s[0]) * s[1] - s[0])
    }
}

/// Circles around the closed orbit r = 2, z = 0 of unit angular speed: with r the distance from the
/// z axis, r' = -omega z - gamma (r - 2), z' = omega (r - 2) - gamma z. Nested tori for gamma = 0;
/// else every orbit spirals onto the closed one at the rate gamma, turning by 2 pi omega a turn.
struct Torus {
    omega: f64,
    gamma: f64,
}
impl VectorField<3> for Torus {
    fn eval<S: Elementary>(&self, s: &SVector<S, 3>) -> SVector<S, 3> {
        let [x, y, z] = [s[0], s[1], s[2]];
        let r = (x * x + y * y).sqrt();
        let d = r - S::from_f64(2.0);
        let radial = (-(z.scale(self.omega)) - d.scale(self.gamma)) / r;
        Vector3::new(x * radial - y, y * radial + x, d.scale(self.omega) - z.scale(self.gamma))
    }
}

/// Records crossings of x[axis] = value, in the plane of the coordinates `shown`.
struct Section {
    axis: usize,
    value: f64,
    shown: [usize; 2],
    points: Vec<SectionPoint>,
    passages: roots::CrossingFinder,
}

impl<const N: usize> Observer<N> for Section {
    fn step(&mut self, step: &Step<'_, N>) -> Flow {
        for roots::Crossing { theta, .. } in
            self.passages.through_plane(step, self.axis, self.value)
        {
            let x = step.at(theta);
            let upward = step.x1[self.axis] > step.x0[self.axis];
            self.points.push(SectionPoint {
                t: step.time(theta),
                u: self.shown.map(|k| x[k]),
                upward,
            });
        }
        Flow::Continue
    }
}

fn section<const N: usize, F: VectorField<N>>(
    field: &F,
    x0: SVector<f64, N>,
    t_end: f64,
    axis: usize,
    value: f64,
    shown: [usize; 2],
) -> Vec<SectionPoint> {
    section_to(1e-9, field, x0, t_end, axis, value, shown)
}

fn section_to<const N: usize, F: VectorField<N>>(
    tolerance: f64,
    field: &F,
    x0: SVector<f64, N>,
    t_end: f64,
    axis: usize,
    value: f64,
    shown: [usize; 2],
) -> Vec<SectionPoint> {
    let tolerance = Tolerance { rtol: tolerance, atol: tolerance };
    let mut seen = Section {
        axis,
        value,
        shown,
        points: Vec::new(),
        passages: roots::CrossingFinder::default(),
    };
    let mut stepper = Dopri5::new(tolerance);
    let options = DriveOptions { step_cap: StepCap::Absolute(0.5), ..DriveOptions::to(t_end) };
    let end = drive(field, x0, &options, &mut stepper, &mut seen, &()).unwrap();
    assert_eq!(end.t, t_end);
    seen.points
}

fn judge(points: &[SectionPoint]) -> Evidence {
    classify(points, &Question::default(), &Thresholds::default())
}

/// A sequence of plane points as a section crossed upwards once per unit time.
fn sequence(points: impl IntoIterator<Item = [f64; 2]>) -> Vec<SectionPoint> {
    points
        .into_iter()
        .enumerate()
        .map(|(i, u)| SectionPoint { t: i as f64, u, upward: true })
        .collect()
}

fn henon(n: usize) -> Vec<[f64; 2]> {
    let (mut x, mut y) = (0.1, 0.1);
    (0..n)
        .map(|_| {
            (x, y) = (1.0 - 1.4 * x * x + y, 0.3 * x);
            [x, y]
        })
        .collect()
}

fn logistic(mu: f64, n: usize) -> Vec<SectionPoint> {
    let mut x = 0.4;
    let mut next = move || {
        let before = x;
        x = mu * x * (1.0 - x);
        [before, x]
    };
    sequence((0..n).map(|_| next()))
}

#[test]
fn lorenz() {
    let settings =
        lyapunov::LyapunovOptions { transient: 20.0, duration: 2000.0, ..Default::default() };
    let e = largest::<3, 6, _>(&Lorenz, Vector3::new(1.0, 1.0, 20.0), &settings).unwrap();
    // 0.9056 (Sprott 2003, "Chaos and Time-Series Analysis", appendix A).
    assert!(e.standard_error < 0.02, "{e:?}");
    assert!((e.value - 0.9056).abs() < 3.0 * e.standard_error, "{e:?}");
    let points = section(&Lorenz, Vector3::new(1.0, 1.0, 20.0), 1000.0, 2, 27.0, [0, 1]);
    for lyapunov in [None, Some(e)] {
        let found = classify(
            &points,
            &Question { lyapunov, ..Question::default() },
            &Thresholds::default(),
        );
        assert_eq!(found.name, "chaotic", "{found:?}");
    }
}

#[test]
fn rossler() {
    let settings =
        lyapunov::LyapunovOptions { transient: 200.0, duration: 6000.0, ..Default::default() };
    let e = largest::<3, 6, _>(&Rossler(5.7), Vector3::new(1.0, 1.0, 1.0), &settings).unwrap();
    // 0.0714 (Sprott 2003).
    assert!(e.standard_error < 0.004, "{e:?}");
    assert!((e.value - 0.0714).abs() < 3.0 * e.standard_error, "{e:?}");
    let chaotic =
        judge(&section(&Rossler(5.7), Vector3::new(1.0, 1.0, 1.0), 3000.0, 1, 0.0, [0, 2]));
    assert_eq!(chaotic.name, "chaotic", "{chaotic:?}");
    // Before its period doublings: one loop at c = 2.5, two at 3.5 (Rossler's cascade; periods 1
    // and 2).
    for (c, period) in [(2.5, 1), (3.5, 2)] {
        let e = judge(&section(&Rossler(c), Vector3::new(1.0, 1.0, 1.0), 3000.0, 1, 0.0, [0, 2]));
        assert_eq!(
            (e.name.as_str(), e.verdict.cycle().unwrap().period),
            ("periodic", period),
            "c = {c}: {e:?}"
        );
        assert_eq!(e.verdict.cycle().unwrap().points.len(), 2 * period);
    }
}

#[test]
fn henon_section_is_chaotic_with_its_exponent() {
    let e = judge(&sequence(henon(8000)));
    assert!(matches!(e.verdict, Verdict::Chaotic { bands: 1, .. }), "{e:?}");
    // 0.4192 per iteration (Sprott 2003), from the points alone.
    assert!((e.divergence.unwrap().per_return - 0.4192).abs() < 0.045, "{e:?}");
}

#[test]
fn van_der_pol() {
    let e = judge(&section(&VanDerPol, Vector2::new(0.1, 0.0), 300.0, 1, 0.0, [0, 1]));
    let Verdict::Periodic(cycle) = &e.verdict else { panic!("{e:?}") };
    // Period 6.66328686 and amplitude 2.00861986 (Andersen & Geer 1982).
    assert_eq!((cycle.period, cycle.points.len()), (1, 2));
    assert!((cycle.duration - 6.663_286_86).abs() < 1e-6, "{cycle:?}");
    for p in &cycle.points {
        let expected = if p.upward { -2.008_619_86 } else { 2.008_619_86 };
        assert!((p.u[0] - expected).abs() < 1e-6, "{p:?}");
    }
    assert!(cycle.settled_at.unwrap() < 50.0);

    let plane = ReturnPlane { axis: 1, value: 0.0, upward: true };
    let o = closed_orbit::<2, 6, _>(
        &VanDerPol,
        plane,
        1,
        Vector2::new(-2.2, 0.0),
        &floquet::FloquetOptions::default(),
    )
    .unwrap();
    assert!((o.period - 6.663_286_86).abs() < 1e-8, "{o:?}");
    // Liouville: the only non-trivial multiplier is exp(integral of the divergence 1 - x^2 over a
    // turn), here by a third equation beside the orbit.
    struct WithDivergence;
    impl VectorField<3> for WithDivergence {
        fn eval<S: Elementary>(&self, s: &SVector<S, 3>) -> SVector<S, 3> {
            let f = VanDerPol.eval(&Vector2::new(s[0], s[1]));
            Vector3::new(f[0], f[1], S::one() - s[0] * s[0])
        }
    }
    let mut stepper = Dopri5::new(Tolerance { rtol: 1e-12, atol: 1e-12 });
    let x0 = Vector3::new(o.points[0][0], o.points[0][1], 0.0);
    let turn =
        drive(&WithDivergence, x0, &DriveOptions::to(o.period), &mut stepper, &mut Ignore, &())
            .unwrap();
    assert!((o.multipliers[0][0].ln() - turn.x[2]).abs() < 1e-5, "{o:?} {}", turn.x[2]);
}

#[test]
fn torus_is_quasi_periodic() {
    // Omega 0.6180...: as far from a closed curve as it gets.
    let torus = Torus { omega: 0.618_033_988_749_894_9, gamma: 0.0 };
    let e = judge(&section(&torus, Vector3::new(2.7, 0.0, 0.0), 8000.0, 1, 0.0, [0, 2]));
    let Verdict::QuasiPeriodic(cycle) = &e.verdict else { panic!("{e:?}") };
    assert_eq!(cycle.period, 1);
    assert!((cycle.radius - 0.7).abs() < 1e-3, "{cycle:?}");
    // One turn is 2 pi, so the section turns by omega circles; counted in (-1/2, 1/2].
    assert!((cycle.rotation.unwrap() - (torus.omega - 1.0)).abs() < 1e-4, "{cycle:?}");
    assert!(
        cycle.points.iter().all(|p| (p.u[0] - if p.upward { 2.0 } else { -2.0 }).abs() < 5e-3),
        "{cycle:?}"
    );
}

#[test]
fn resonant_torus_is_periodic() {
    let torus = Torus { omega: 0.4, gamma: 0.0 };
    let e = judge(&section(&torus, Vector3::new(2.7, 0.0, 0.0), 8000.0, 1, 0.0, [0, 2]));
    assert!(matches!(&e.verdict, Verdict::Periodic(c) if c.period == 5), "{e:?}");
}

#[test]
fn damped_spiral_has_its_rate() {
    // The reconstructed system's rates (1e-5 to 1e-4 per unit time) over a tenth of its length.
    for gamma in [3e-5, 1e-4] {
        let torus = Torus { omega: 0.3636, gamma };
        let e = judge(&section(&torus, Vector3::new(2.3, 0.0, 0.0), 12_000.0, 1, 0.0, [0, 2]));
        let Verdict::Spiralling(cycle) = &e.verdict else { panic!("{e:?}") };
        assert_eq!(cycle.period, 1);
        let rate = cycle.approach.unwrap();
        assert!((rate.per_time / gamma - 1.0).abs() < 0.02, "{rate:?}");
        assert!(
            (rate.per_time - gamma).abs() < 5.0 * rate.standard_error.max(1e-3 * gamma),
            "{rate:?}"
        );
        assert!(cycle.captured_at < 0.1 * 12_000.0 && cycle.settled_at.is_none(), "{cycle:?}");
    }
    // Faster, the same approach ends in dots.
    let e = judge(&section(
        &Torus { omega: 0.3636, gamma: 3e-3 },
        Vector3::new(2.3, 0.0, 0.0),
        12_000.0,
        1,
        0.0,
        [0, 2],
    ));
    let Verdict::Periodic(cycle) = &e.verdict else { panic!("{e:?}") };
    assert!((cycle.approach.unwrap().per_time / 3e-3 - 1.0).abs() < 0.02, "{cycle:?}");
    // Distance 0.3 exp(-gamma t) falls to the dot's size at this time.
    let expected = (0.3 / (e.thresholds.dot * e.extent)).ln() / 3e-3;
    assert!(
        (cycle.settled_at.unwrap() / expected - 1.0).abs() < 0.03,
        "{cycle:?}, expected {expected}"
    );
}

#[test]
fn closed_orbit_of_the_torus_has_its_multipliers() {
    let torus = Torus { omega: 0.3, gamma: 2e-3 };
    let plane = ReturnPlane { axis: 1, value: 0.0, upward: true };
    let o = closed_orbit::<3, 12, _>(
        &torus,
        plane,
        1,
        Vector3::new(2.1, 0.0, 0.05),
        &floquet::FloquetOptions::default(),
    )
    .unwrap();
    let tau = std::f64::consts::TAU;
    assert!((o.period - tau).abs() < 1e-8 && (o.rate - 2e-3).abs() < 1e-8, "{o:?}");
    let size = (-2e-3 * tau).exp();
    assert!((o.multipliers[0][0] - size * (0.3 * tau).cos()).abs() < 1e-7, "{o:?}");
    assert!((o.multipliers[0][1].abs() - size * (0.3 * tau).sin()).abs() < 1e-7, "{o:?}");
}

#[test]
fn logistic_windows() {
    // Period 3 at 3.83, period 6 after its first doubling at 3.845, period 5 at 3.74 (May 1976);
    // chaos at 3.9.
    for (mu, period) in [(3.83, 3), (3.845, 6), (3.74, 5), (3.2, 2), (2.9, 1)] {
        let e = judge(&logistic(mu, 3000));
        assert!(matches!(&e.verdict, Verdict::Periodic(c) if c.period == period), "{mu}: {e:?}");
    }
    assert!(matches!(judge(&logistic(3.9, 3000)).verdict, Verdict::Chaotic { bands: 1, .. }));
    // Two bands, visited in turn, below 3.6785 (where they merge).
    assert!(matches!(judge(&logistic(3.65, 3000)).verdict, Verdict::Chaotic { bands: 2, .. }));
    // The list goes with the motion: each dot is the image of the one before it.
    let e = judge(&logistic(3.83, 3000));
    let dots: Vec<[f64; 2]> = e.verdict.cycle().unwrap().points.iter().map(|p| p.u).collect();
    for (i, u) in dots.iter().enumerate() {
        assert!((dots[(i + 1) % 3][0] - u[1]).abs() < 1e-6, "{dots:?}");
    }
}

#[test]
fn short_sections() {
    // The window's orbit from 0.4 is a chaotic transient for 95 iterations.
    assert_eq!(judge(&logistic(3.83, 80)).name, "too-few");
    for n in [140, 200, 400] {
        let e = judge(&logistic(3.83, n));
        assert!(matches!(&e.verdict, Verdict::Periodic(c) if c.period == 3), "{n}: {e:?}");
    }
    // 47 points of a ring leave holes; 160 do not.
    for (t_end, expected) in [(300.0, "too-few"), (1000.0, "quasi-periodic")] {
        let torus = Torus { omega: 0.618, gamma: 0.0 };
        let e = judge(&section(&torus, Vector3::new(2.7, 0.0, 0.0), t_end, 1, 0.0, [0, 2]));
        assert_eq!(e.name, expected, "{t_end}: {e:?}");
    }
    // A few dozen points on no curve: no verdict rather than a wrong one.
    assert_eq!(judge(&logistic(3.9, 60)).name, "too-few");
    assert_eq!(judge(&logistic(3.9, 400)).name, "chaotic");
}

#[test]
fn chaos_that_ends_in_a_spiral_has_its_lifetime() {
    // 3000 turns of the Henon map, then a slow spiral that keeps well inside: the switch is at t =
    // 3000.
    let spiral = (0..3000).map(|i| {
        let (r, a) = (0.2 * (-1e-4 * f64::from(i)).exp(), 2.3 * f64::from(i));
        [0.4 + r * a.cos(), 0.1 + 0.5 * r * a.sin()]
    });
    let points = sequence(henon(3000).into_iter().chain(spiral));
    let e = classify(
        &points,
        &Question { shown_from: 2000.0, ..Question::default() },
        &Thresholds::default(),
    );
    let Verdict::Spiralling(cycle) = &e.verdict else { panic!("{e:?}") };
    // Known to within a block of turns.
    assert!(
        cycle.captured_at >= 3000.0 && cycle.captured_at <= 3000.0 + e.thresholds.block as f64,
        "{cycle:?}"
    );
    assert!((cycle.approach.unwrap().per_time / 1e-4 - 1.0).abs() < 0.02, "{cycle:?}");
    assert!(e.mixed);
}

#[test]
fn chaos_that_ends_in_dots_has_its_lifetime() {
    let ending = (0..2000).map(|i| {
        let r = 0.05 * (-0.02 * f64::from(i)).exp();
        [0.4 + r, 0.1 - r]
    });
    let e = judge(&sequence(henon(1500).into_iter().chain(ending)));
    let Verdict::Periodic(cycle) = &e.verdict else { panic!("{e:?}") };
    assert!((cycle.captured_at - 1500.0).abs() <= 2.0, "{cycle:?}");
    assert!((cycle.approach.unwrap().per_time / 0.02 - 1.0).abs() < 0.01, "{cycle:?}");
}

#[test]
fn noise_is_noise() {
    let mut r = RandomStream::new(1, 0);
    let section = sequence((0..3000).map(|_| [r.normal(), r.uniform()]));
    // Of a run without random numbers it is not said.
    for (kicked, name) in [(true, "noisy"), (false, "undecided")] {
        let question = Question { kicked, ..Question::default() };
        let e = classify(&section, &question, &Thresholds::default());
        assert_eq!(e.name, name, "{e:?}");
    }
}

/// Chirikov's (1979) standard map: a sea around islands, where kicks let the orbit leak into the
/// islands.
fn standard(n: usize, start: f64, kick: f64, stream: u64) -> Vec<[f64; 2]> {
    let mut r = RandomStream::new(2, stream);
    let tau = std::f64::consts::TAU;
    let (mut x, mut p): (f64, f64) = (start, 0.3);
    (0..n)
        .map(|_| {
            p = (p + 1.8 / tau * (tau * x).sin()).rem_euclid(1.0);
            x = (x + p + kick * r.normal()).rem_euclid(1.0);
            // Shifted, so that the largest island does not lie across the edge.
            [x, (p + 0.5).rem_euclid(1.0)]
        })
        .collect()
}

#[test]
fn kicked_sections_keep_less_structure_the_harder_the_kicks() {
    let free: Vec<Vec<SectionPoint>> =
        (0..4).map(|k| sequence(standard(30_000, 0.01 + 1e-6 * f64::from(k), 0.0, 0))).collect();
    // Many short runs: in a single one chance decides how long it stays in an island.
    let contrast = |kick: f64| {
        let runs = (0..100_u32)
            .flat_map(|k| standard(100, 0.02 + 1e-4 * f64::from(k), kick, u64::from(k)));
        let kicked = sequence(runs);
        let question = Question { kicked: true, reference: Some(&free), ..Question::default() };
        let Verdict::Noisy { contrast, around: None } =
            classify(&kicked, &question, &Thresholds::default()).verdict
        else {
            panic!("kicks make noise")
        };
        contrast.unwrap()
    };
    let found = [0.0, 0.02, 0.1, 0.3].map(contrast);
    let values = found.map(|c| c.value);
    assert!(values[0] > 0.95 && found[0].free[0] > 0.9, "{found:?}");
    // A program outside this project gives 0.75 to 0.85, 0.05 to 0.23 and 0.02, by the seed.
    assert!(
        (values[1] - 0.8).abs() < 0.15 && (values[2] - 0.14).abs() < 0.2 && values[3].abs() < 0.15,
        "{found:?}"
    );
}

#[test]
fn a_cloud_around_a_cycle_is_recognised() {
    let mut r = RandomStream::new(3, 0);
    let dots = [[1.0, 0.5], [-0.3, 0.8], [0.1, -0.9]];
    let points = sequence((0..3000).map(|i| dots[i % 3].map(|c| c + 0.01 * r.normal())));
    let e = classify(
        &points,
        &Question { kicked: true, ..Question::default() },
        &Thresholds::default(),
    );
    assert!(matches!(&e.verdict, Verdict::Noisy { around: Some(c), .. } if c.period == 3), "{e:?}");
}

#[test]
fn silence_and_scarcity() {
    let points = logistic(3.83, 500);
    let escaped = classify(
        &points,
        &Question { t_end: Some(1000.0), ..Question::default() },
        &Thresholds::default(),
    );
    assert!(matches!(escaped.verdict, Verdict::Escaped { last_crossing: 499.0 }), "{escaped:?}");
    let whole = classify(
        &points,
        &Question { t_end: Some(500.0), ..Question::default() },
        &Thresholds::default(),
    );
    assert_eq!(whole.name, "periodic");
    assert!(matches!(judge(&points[..12]).verdict, Verdict::TooFew { points: 12 }));
    assert!(matches!(judge(&[]).verdict, Verdict::TooFew { points: 0 }));
    let mut broken = points.clone();
    broken[499].u[0] = f64::NAN;
    assert_eq!(judge(&broken).name, "escaped");
}

#[test]
fn a_verdict_does_not_depend_on_units() {
    let scaled = |p: &[SectionPoint], a: f64| -> Vec<SectionPoint> {
        p.iter().map(|q| SectionPoint { t: 3.0 * q.t, u: q.u.map(|c| a * c), ..*q }).collect()
    };
    let torus = section(
        &Torus { omega: 0.3636, gamma: 1e-4 },
        Vector3::new(2.3, 0.0, 0.0),
        8000.0,
        1,
        0.0,
        [0, 2],
    );
    for points in [logistic(3.83, 2000), logistic(3.9, 2000), torus] {
        let plain = judge(&points);
        for a in [1e-6, 1e4] {
            assert_eq!(judge(&scaled(&points, a)).name, plain.name);
        }
    }
}

#[test]
fn no_known_answer_hangs_on_the_last_digit_of_a_threshold() {
    let torus = |gamma| {
        section(
            &Torus { omega: 0.618, gamma },
            Vector3::new(2.3, 0.0, 0.0),
            12_000.0,
            1,
            0.0,
            [0, 2],
        )
    };
    let known = [
        (logistic(3.83, 2000), "periodic"),
        (logistic(3.9, 2000), "chaotic"),
        (sequence(henon(4000)), "chaotic"),
        (torus(0.0), "quasi-periodic"),
        (torus(5e-5), "spiralling"),
    ];
    // Fewer points for the 0-1 test, for speed.
    let quick = Thresholds { zero_one_points: 800, ..Thresholds::default() };
    let serde_json::Value::Object(defaults) = serde_json::to_value(quick).unwrap() else {
        panic!()
    };
    for (name, value) in &defaults {
        for factor in [0.75, 1.33] {
            let mut changed = defaults.clone();
            changed[name] = match value.as_u64() {
                Some(n) => ((n as f64 * factor).round() as u64).max(1).into(),
                None => (value.as_f64().unwrap() * factor).into(),
            };
            let thresholds: Thresholds = serde_json::from_value(changed.into()).unwrap();
            for (points, expected) in &known {
                let e = classify(points, &Question::default(), &thresholds);
                assert_eq!(e.name, *expected, "{name} times {factor}: {e:?}");
            }
        }
    }
}

#[test]
fn evidence_survives_json() {
    for points in [logistic(3.83, 1000), logistic(3.9, 1000)] {
        let e = judge(&points);
        let text = serde_json::to_string(&e).unwrap();
        assert_eq!(serde_json::from_str::<Evidence>(&text).unwrap(), e);
    }
}

#[test]
fn claims_are_scored_by_one_rule() {
    let agrees = |claim: Claim, e: &Evidence| claim.score(e).agrees;
    let three = judge(&logistic(3.83, 1000));
    // Settled before the shown part begins, or not.
    let late = |shown_from| {
        classify(
            &logistic(3.83, 1000),
            &Question { shown_from, ..Question::default() },
            &Thresholds::default(),
        )
    };
    assert!(late(500.0).dots_only && !late(0.0).dots_only);
    assert!(agrees(Claim::Period(3), &late(500.0)));
    assert!(!agrees(Claim::Period(1), &late(500.0)) && !agrees(Claim::Chaos, &late(500.0)));
    assert!(!agrees(Claim::PartlyWashedOut, &three));
    let chaos = judge(&logistic(3.9, 1000));
    assert!(agrees(Claim::Chaos, &chaos) && !agrees(Claim::Period(1), &chaos));
    // Period one in the end, but chaos in the shown part.
    let points = sequence(henon(1500).into_iter().chain(std::iter::repeat_n([0.4, 0.1], 1500)));
    let mixed = classify(
        &points,
        &Question { shown_from: 1000.0, ..Question::default() },
        &Thresholds::default(),
    );
    assert!(
        mixed.mixed && !agrees(Claim::Period(1), &mixed) && !agrees(Claim::Chaos, &mixed),
        "{mixed:?}"
    );
    let shown = classify(
        &points,
        &Question { shown_from: 2000.0, ..Question::default() },
        &Thresholds::default(),
    );
    assert!(agrees(Claim::Period(1), &shown), "{shown:?}");
    // A spiral counts as its period, with the reservation written down.
    let spiral = judge(&section(
        &Torus { omega: 0.3636, gamma: 1e-4 },
        Vector3::new(2.3, 0.0, 0.0),
        12_000.0,
        1,
        0.0,
        [0, 2],
    ));
    let spiral = Evidence { mixed: false, ..spiral };
    let score = Claim::Period(1).score(&spiral);
    assert!(score.agrees && score.because.contains("approaching"), "{score:?}");
}

fn caricature(alpha: f64, beta: f64) -> Smoothed<Caricature> {
    Smoothed {
        system: Caricature::with_reinjection(alpha, beta),
        transition: Transition::Tanh,
        eps: 1e-3,
    }
}

#[test]
fn closed_orbits_of_the_paper() {
    let plane = ReturnPlane { axis: 1, value: 0.0, upward: true };
    let settings = floquet::FloquetOptions::default();
    let find = |alpha: f64, beta: f64, returns: usize, x: f64, z: f64| {
        closed_orbit::<3, 12, _>(
            &caricature(alpha, beta),
            plane,
            returns,
            Vector3::new(x, 0.0, z),
            &settings,
        )
        .unwrap()
    };
    // SCIENCE, sec. 2: the printed reading's one orbit.
    let printed = find(1e-3, 1e-5, 1, 17.0, -0.01);
    assert!(
        (printed.points[0][0] - 17.0573).abs() < 1e-4
            && (printed.points[0][2] + 0.0154).abs() < 1e-4,
        "{printed:?}"
    );
    assert!(
        (printed.opposite[0][0] + 13.3857).abs() < 1e-4
            && (printed.opposite[0][2] + 0.0199).abs() < 1e-4
    );
    assert!((printed.period - 20.25).abs() < 5e-3 && printed.rate > 0.0, "{printed:?}");
    // The two orbits of the reconstructed reading.
    let one = find(1e-1, 1e-5, 1, 0.81, 0.0);
    assert!(
        (one.points[0][0] - 0.81).abs() < 5e-3 && (one.opposite[0][0] + 0.67).abs() < 5e-3,
        "{one:?}"
    );
    let three = find(1e-1, 1e-5, 3, 1.21, 0.0);
    assert_eq!((three.points.len(), three.opposite.len()), (3, 3));
    for (x, z) in [(1.21, 0.0), (0.44, 0.29), (0.44, -0.29)] {
        assert!(
            three.points.iter().any(|p| (p[0] - x).abs() < 5e-3 && (p[2] - z).abs() < 5e-3),
            "{three:?}"
        );
    }
    // Both attract, and slowly: this is why the paper throws away the first 10^5.
    for o in [&one, &three] {
        assert!(o.rate > 1e-5 && o.rate < 1e-4, "{o:?}");
    }
    // The numbers that README quotes, to the digits it quotes.
    let modulus = |o: &floquet::ClosedOrbit| {
        o.multipliers.iter().map(|m| m[0].hypot(m[1])).fold(0.0, f64::max)
    };
    assert!(
        (printed.period - 20.248).abs() < 5e-4 && (modulus(&printed) - 0.969).abs() < 5e-4,
        "{printed:?}"
    );
    assert!(
        (one.rate - 2.6e-5).abs() < 5e-7 && (three.rate - 2.6e-5).abs() < 5e-7,
        "{one:?} {three:?}"
    );
    // The dissipation is beta's: ten times beta, ten times the rate.
    for (returns, x, o) in [(1, 0.81, &one), (3, 1.21, &three)] {
        let strong = find(1e-1, 1e-4, returns, x, 0.0);
        assert!((strong.rate / o.rate - 10.0).abs() < 0.1, "{strong:?} {o:?}");
    }
}

#[test]
fn hysteretic_cycle_contracts_by_its_multiplier() {
    // Four dimensions: the reconstructed reading with a single division settles on two loops within
    // t = 50.
    let field = Hysteretic {
        system: Caricature::with_reinjection(1e-1, 1e-5),
        eps: 1e-3,
        eps_prime: 1e-2,
        relaxation: Relaxation::Single,
    };
    // Each turn passes the singularity, which amplifies the solver's error some 10^6 times: at 1e-9
    // the dots are off by 5e-4.
    let points =
        section_to(1e-12, &field, Vector4::new(0.2, 0.0, -1.0, 1.0), 600.0, 1, 0.0, [0, 2]);
    let e = judge(&points);
    assert!(matches!(&e.verdict, Verdict::Periodic(c) if c.period == 2), "{e:?}");
    let cycle = e.verdict.cycle().unwrap();
    let u = cycle.points.iter().find(|p| p.upward).unwrap().u;
    let plane = ReturnPlane { axis: 1, value: 0.0, upward: true };
    // Away from the layer phi is 1 for x > 0 up to relaxation.
    let guess = Vector4::new(u[0], 0.0, u[1], 1.0);
    let orbit =
        closed_orbit::<4, 20, _>(&field, plane, 2, guess, &floquet::FloquetOptions::default())
            .unwrap();
    assert!((orbit.period - cycle.duration).abs() < 1e-5, "{orbit:?} {cycle:?}");
    let p = &orbit.points[0];
    assert!((p[0] - u[0]).abs() < 1e-5 && (p[2] - u[1]).abs() < 1e-5, "{orbit:?} {cycle:?}");
    // The run comes in by the multiplier a turn: its upward points near this dot, from the third
    // turn on.
    let near: Vec<f64> = points
        .iter()
        .filter(|q| q.upward && (q.u[0] - u[0]).abs() + (q.u[1] - u[1]).abs() < 0.1)
        .map(|q| (q.u[0] - u[0]).hypot(q.u[1] - u[1]))
        .collect();
    let [first, last] = [near[3], near[9]];
    assert!(
        ((last / first).ln() / 6.0 - orbit.multipliers[0][0].ln()).abs() < 0.01,
        "{near:?} {orbit:?}"
    );
}

#[test]
fn spiral_of_the_reconstructed_reading_has_the_orbits_rate() {
    let field = caricature(1e-1, 1e-5);
    let points = section(&field, Vector3::new(0.84, 0.0, 0.0), 12_000.0, 1, 0.0, [0, 2]);
    let e = judge(&points);
    let Verdict::Spiralling(cycle) = &e.verdict else { panic!("{e:?}") };
    assert_eq!(cycle.period, 1);
    let plane = ReturnPlane { axis: 1, value: 0.0, upward: true };
    let settings = floquet::FloquetOptions::default();
    let u = cycle.points[0].u;
    let orbit =
        closed_orbit::<3, 12, _>(&field, plane, 1, Vector3::new(u[0], 0.0, u[1]), &settings)
            .unwrap();
    assert!(
        (cycle.approach.unwrap().per_time / orbit.rate - 1.0).abs() < 0.05,
        "{cycle:?} {orbit:?}"
    );
    let [re, im] = orbit.multipliers[0];
    let angle = im.abs().atan2(re) / std::f64::consts::TAU;
    assert!((cycle.rotation.unwrap().abs() - angle).abs() < 1e-3, "{cycle:?} {orbit:?}");
}

#[test]
fn exponent_of_the_reconstructed_chaos_converges_in_tolerance() {
    let field = caricature(1e-1, 1e-5);
    let [loose, tight] = [1e-9, 1e-11].map(|tol| {
        let tolerance = Tolerance { rtol: tol, atol: tol };
        let settings = lyapunov::LyapunovOptions {
            tolerance,
            max_step: 1.0,
            duration: 3000.0,
            ..Default::default()
        };
        largest::<3, 6, _>(&field, Vector3::new(0.2, 0.0, -1.0), &settings).unwrap()
    });
    let error = (loose.standard_error * loose.standard_error
        + tight.standard_error * tight.standard_error)
        .sqrt();
    assert!((loose.value - tight.value).abs() < 4.0 * error, "{loose:?} {tight:?}");
    assert!(tight.value > 5.0 * tight.standard_error, "{tight:?}");
}

#[test]
fn exponent_on_a_closed_orbit_is_zero() {
    // Along the orbit nothing grows or shrinks on average; across it everything shrinks.
    let settings =
        lyapunov::LyapunovOptions { transient: 500.0, duration: 1000.0, ..Default::default() };
    let e = largest::<2, 4, _>(&VanDerPol, Vector2::new(2.0, 0.0), &settings).unwrap();
    assert!(e.value.abs() < 2e-3, "{e:?}");
}

#[test]
fn evidence_of_next_to_nothing_comes_back_from_its_record() {
    for points in [0, 1] {
        let section = vec![SectionPoint { t: 1.0, u: [0.0; 2], upward: true }; points];
        let evidence = classify(&section, &Question::default(), &Thresholds::default());
        let text = serde_json::to_string(&evidence).unwrap();
        let back: Evidence = serde_json::from_str(&text).unwrap();
        assert_eq!((serde_json::to_string(&back).unwrap(), back.name.as_str()), (text, "too-few"));
    }
}
