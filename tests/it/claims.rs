//! The paper's sentences, measured: each quantity that papers/jeffrey-2013/sentences.toml names for
//! a sentence is read by the test that it names.
#![allow(clippy::disallowed_methods)] // compared with tolerances, not with hashes

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

use crate::wheel::Wheel;
use nalgebra::{SVector, Vector2, Vector3, Vector4};
use twofold::analyse::divider::Shared;
use twofold::analyse::{Crossing, Direction};
use twofold::integrate::filippov::{
    EventKind, ExitRule, FilippovObserver, FilippovOptions, Mode, ModeEvent, Side, Trajectory, run,
};
use twofold::integrate::{Flow, Step, Tolerance};
use twofold::jeffrey_2013::Reading;
use twofold::jeffrey_2013::study::census::{MotionKind, PANELS, supporting, tally};
use twofold::jeffrey_2013::study::claims::{Quantity, claims};
use twofold::job::recording::Data;
use twofold::job::simulate::simulate;
use twofold::job::spec::*;
use twofold::job::{Executor, PathComparison};
use twofold::num::random::RandomStream;
use twofold::paper::{Figure, figures};
use twofold::record::Manifest;
use twofold::system::filippov::{normal_form_constants, two_fold};
use twofold::system::{
    Caricature, Hysteretic, PiecewiseSmooth, Relaxation, Reversed, Smoothed, Transition,
    VectorField,
};

/// The quantities that a test measures. Every one of them must have been read when it is dropped.
pub struct Reads {
    left: BTreeSet<(&'static str, &'static str)>,
}

impl Reads {
    /// All quantities whose test is `test`, "module::function".
    pub fn by(test: &str) -> Self {
        let named = claims().sentence.iter().flat_map(|s| s.reads.iter().map(move |r| (s, r)));
        let named = named.filter(|(_, r)| r.test == test);
        let left: BTreeSet<_> = named.map(|(s, r)| (s.id.as_str(), r.quantity.as_str())).collect();
        assert!(!left.is_empty(), "sentences.toml names no quantity that {test} measures");
        Self { left }
    }

    /// Holds what was measured against the sentence: it lies where the sentence is true if and only
    /// if sentences.toml says so.
    pub fn read(&mut self, id: &str, quantity: &str, value: f64) {
        let known = self.left.len();
        self.left.retain(|left| *left != (id, quantity));
        assert!(
            self.left.len() + 1 == known,
            "{id}: \"{quantity}\" is another test's, or was read before"
        );
        let sentence = claims().sentence.iter().find(|s| s.id == id).unwrap();
        let Quantity { true_within: [low, high], holds, .. } =
            sentence.reads.iter().find(|r| r.quantity == quantity).unwrap();
        println!("{id}: {quantity}: {value}");
        assert!(value.is_finite(), "{id}: {quantity} is {value}");
        let found = (*low..=*high).contains(&value);
        assert_eq!(found, *holds, "{id}: {quantity} is {value}; true from {low} to {high}");
    }
}

impl Drop for Reads {
    fn drop(&mut self) {
        assert!(std::thread::panicking() || self.left.is_empty(), "not read: {:?}", self.left);
    }
}

/// Every test that a sentence names exists, is run by `make test`, and begins by asking for what it
/// has to read: it cannot pass without.
#[test]
fn every_quantity_is_read_by_the_test_that_claims_toml_names() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/it");
    let main = fs::read_to_string(folder.join("main.rs")).unwrap();
    let named: BTreeSet<&str> =
        claims().sentence.iter().flat_map(|s| &s.reads).map(|r| r.test.as_str()).collect();
    for test in &named {
        let (module, function) =
            test.split_once("::").unwrap_or_else(|| panic!("{test} is no module::function"));
        assert!(main.contains(&format!("mod {module};")), "{test}: there is no such module");
        let text = fs::read_to_string(folder.join(format!("{module}.rs"))).unwrap();
        let (before, body) = text
            .split_once(&format!("\nfn {function}() {{\n"))
            .unwrap_or_else(|| panic!("{test}: there is no such function"));
        let attributes = before.rsplit_once("\n\n").map_or(before, |(_, a)| a);
        assert!(attributes.contains("#[test]"), "{test} is no test");
        assert!(!attributes.contains("#[ignore"), "{test} is not run");
        // One statement, which may be wrapped.
        let first = body.split_inclusive(';').next().unwrap();
        let first = first.split_whitespace().collect::<Vec<_>>().join(" ");
        let first = first.replace("( ", "(").replace(", )", ")");
        assert!(
            first == format!("let mut reads = Reads::by(\"{test}\");"),
            "{test} begins with `{first}`: it must begin with the quantities that it reads"
        );
    }
    // And no quantity is read that is not named.
    let files = fs::read_dir(&folder).unwrap().map(|entry| entry.unwrap().path());
    for file in files.filter(|file| file.extension().is_some_and(|e| e == "rs")) {
        let text = fs::read_to_string(file).unwrap();
        let text = text.split_whitespace().collect::<Vec<_>>().join(" ").replace("by( ", "by(");
        for (_, rest) in
            text.match_indices("= Reads::by(\"").map(|(at, found)| text.split_at(at + found.len()))
        {
            let asked = rest.split('"').next().unwrap();
            assert!(
                asked.contains('{') || named.contains(asked),
                "{asked} is named by no sentence"
            );
        }
    }
}

/// "…, printed" and "…, reconstructed".
fn of(reading: Reading, quantity: &str) -> String {
    format!("{quantity}, {}", reading.word())
}

/// An orbit until it has come to a two-fold so many times.
struct Visits {
    wanted: usize,
    seen: usize,
}

impl FilippovObserver<3> for Visits {
    fn step(&mut self, _: Mode, _: &Step<'_, 3>) -> Flow {
        Flow::Continue
    }

    fn event(&mut self, event: &ModeEvent<3>) -> Flow {
        self.seen += usize::from(matches!(event.kind, EventKind::TwoFoldReached { .. }));
        if self.seen < self.wanted { Flow::Continue } else { Flow::Stop }
    }
}

/// Number of visits of an orbit to the two-fold within t = 300, at most `wanted`; at each it slides
/// for 0.3 and leaves to x > 0.
fn visits<P: PiecewiseSmooth<3> + Clone>(system: &P, start: SVector<f64, 3>, wanted: usize) -> usize
where
    for<'a> twofold::integrate::filippov::SlidingFlow<'a, P, 3>: VectorField<4>,
{
    let settings = FilippovOptions {
        tolerance: Tolerance { rtol: 1e-10, atol: 1e-10 },
        ..FilippovOptions::default()
    };
    let mut seen = Visits { wanted, seen: 0 };
    let exit = ExitRule::AfterTime { time: 0.3, side: Side::Plus };
    let _ = run(system, start, 300.0, &settings, exit, &mut seen).unwrap();
    seen.seen
}

/// A point of the ball of this radius about the origin.
fn in_ball(random: &mut RandomStream, radius: f64) -> SVector<f64, 3> {
    loop {
        let point = SVector::<f64, 3>::from_fn(|_, _| random.uniform_in(-radius, radius));
        if point.norm() <= radius {
            return point;
        }
    }
}

/// Starts of a test of shares.
const STARTS: usize = 24;

fn share(count: usize, of: usize) -> f64 {
    count as f64 / of as f64
}

#[test]
fn one_state_has_several_futures() {
    let mut reads = Reads::by("claims::one_state_has_several_futures");
    let system = Reading::Reconstructed.caricature();
    let after = |side| {
        let rule = ExitRule::AtOnce { side };
        run(
            &system,
            SVector::zeros(),
            1.0,
            &FilippovOptions::default(),
            rule,
            &mut Trajectory::new(1),
        )
        .unwrap()
        .x
    };
    reads.read(
        "1.1",
        "distance after 1 unit of time between two orbits from one state at the singularity",
        (after(Side::Plus) - after(Side::Minus)).norm(),
    );
}

#[test]
fn h_is_the_slip_along_the_axle() {
    let mut reads = Reads::by("claims::h_is_the_slip_along_the_axle");
    let (wheel, mut random) = (Wheel::default(), RandomStream::new(2013, 0));
    let mut worst = 0.0_f64;
    for _ in 0..100 {
        let state = Vector3::new(
            random.uniform_in(0.1, 1.0),
            random.uniform_in(-3.0, 3.0),
            random.uniform_in(-3.0, 3.0),
        );
        // The wheel stands at (r, d) of the housing, which turns over the disc; its velocity over
        // the disc by a difference quotient.
        let place = |t: f64| {
            let (angle, along) = ((state[2] - wheel.omega0) * t, state[0] + state[1] * t);
            let (s, c) = angle.sin_cos();
            Vector2::new(c * along - s * wheel.d, s * along + c * wheel.d)
        };
        let step = 1e-5;
        let velocity = (place(step) - place(-step)) / (2.0 * step);
        let axle = Vector2::new(wheel.gamma.sin(), wheel.gamma.cos());
        worst = worst.max((velocity.dot(&axle) - wheel.switching(&state)).abs());
    }
    reads.read("2.2", "largest distance between h and the slip along the axle", worst);
}

#[test]
fn starts_around_the_origin_reach_it() {
    let mut reads = Reads::by("claims::starts_around_the_origin_reach_it");
    for reading in Reading::ALL {
        let (system, mut random) = (reading.caricature(), RandomStream::new(2013, 1));
        let (mut once, mut twice, mut both) = (0, 0, 0);
        for _ in 0..STARTS {
            let start = in_ball(&mut random, 0.3);
            let found = visits(&system, start, 2);
            once += usize::from(found >= 1);
            twice += usize::from(found >= 2);
            both += usize::from(found >= 1 && visits(&Reversed(system), start, 1) == 1);
        }
        let of = |quantity| of(reading, quantity);
        reads.read(
            "2.4",
            &of("share of starts around the origin that reach it within 300"),
            share(once, STARTS),
        );
        reads.read(
            "4.2",
            &of("share of starts around the origin that slide through it and come back within 300"),
            share(twice, STARTS),
        );
        reads.read(
            "4.3",
            &of("share of starts around the origin that meet it within 300 both ways"),
            share(both, STARTS),
        );
    }
}

#[test]
fn a_whole_volume_reaches_the_singularity() {
    let mut reads = Reads::by("claims::a_whole_volume_reaches_the_singularity");
    for reading in Reading::ALL {
        let (system, mut random) = (reading.caricature(), RandomStream::new(2013, 2));
        // About the paper's start, and backwards about its mirror image in x, y, z.
        let centre = Vector3::new(0.2, 0.0, -1.0);
        let (mut forwards, mut backwards) = (0, 0);
        for _ in 0..STARTS {
            let shift = in_ball(&mut random, 0.01);
            forwards += visits(&system, centre + shift, 1);
            backwards += visits(&Reversed(system), Vector3::new(0.0, -0.1, -0.1) + shift, 1);
        }
        let of = |quantity| of(reading, quantity);
        reads.read(
            "3.5",
            &of("share of starts in a ball of 0.01 that reach the singularity within 300"),
            share(forwards, STARTS),
        );
        reads.read(
            "3.9",
            &of(
                "share of starts in a ball of 0.01 that reach the singularity within 300 backwards",
            ),
            share(backwards, STARTS),
        );
    }
}

#[test]
fn sliding_passes_from_attracting_to_repelling() {
    let mut reads = Reads::by("claims::sliding_passes_from_attracting_to_repelling");
    let normal_form = Caricature::with_reinjection(0.0, 0.0);
    let (mut random, mut passed) = (RandomStream::new(2013, 3), 0);
    for _ in 0..STARTS {
        let start = Vector3::new(0.0, random.uniform_in(0.01, 1.0), random.uniform_in(0.01, 1.0));
        let rule = ExitRule::AfterTime { time: 1e9, side: Side::Plus };
        let mut out = Trajectory::new(1);
        let _ =
            run(&normal_form, start, 20.0, &FilippovOptions::default(), rule, &mut out).unwrap();
        let modes: Vec<Mode> = out.pieces.iter().map(|p| p.mode).collect();
        let reached = out.events.iter().any(|e| matches!(e.kind, EventKind::TwoFoldReached { .. }));
        passed += usize::from(
            reached && modes.starts_with(&[Mode::SlidingAttracting, Mode::SlidingRepelling]),
        );
    }
    reads.read(
        "3.1",
        "share of sliding orbits of the normal form that pass from attracting to repelling sliding",
        share(passed, STARTS),
    );
}

#[test]
fn the_constants_satisfy_the_condition() {
    let mut reads = Reads::by("claims::the_constants_satisfy_the_condition");
    // From the equations as they are, at their two-folds, and not from the parameters.
    let caricature = Reading::Printed.caricature();
    let fold = two_fold(&caricature, &Vector3::new(0.01, 0.01, 0.01)).unwrap();
    let (v, w) = normal_form_constants(&caricature, &fold);
    assert!(v < 0.0 && w < 0.0);
    reads.read("3.2", "v w of the printed numbers", v * w);
    let wheel = Wheel::default();
    let fold = two_fold(&wheel, &Vector3::new(0.69, -0.57, -0.87)).unwrap();
    let (v, w) = normal_form_constants(&wheel, &fold);
    assert!(v < 0.0 && w < 0.0);
    reads.read("3.2", "v w of the reconstructed wheel", v * w);
}

#[test]
fn added_terms_are_of_second_order() {
    let mut reads = Reads::by("claims::added_terms_are_of_second_order");
    let (whole, bare) =
        (Reading::Reconstructed.caricature(), Caricature::with_reinjection(0.0, 0.0));
    let added = |size: f64| {
        let x = Vector3::new(0.3, -0.5, 0.8) * size;
        (whole.plus(&x) - bare.plus(&x)).norm() + (whole.minus(&x) - bare.minus(&x)).norm()
    };
    reads.read("4.1", "order of the added terms at the origin", (added(2e-3) / added(1e-3)).log2());
}

#[test]
fn the_smoothed_field_has_bounded_slopes() {
    let mut reads = Reads::by("claims::the_smoothed_field_has_bounded_slopes");
    let (eps, mut random) = (1e-3, RandomStream::new(2013, 4));
    let smoothed =
        Smoothed { system: Reading::Reconstructed.caricature(), transition: Transition::Tanh, eps };
    let mut steepest = 0.0_f64;
    for k in 0..2000 {
        let x = in_ball(&mut random, 1.0).component_mul(&Vector3::new(3.0 * eps, 1.0, 1.0));
        // Distances from 1e-2 eps to 1e-8 eps: a jump would show as a slope that grows like their
        // inverse.
        let near = x + in_ball(&mut random, 1.0) * eps * 10_f64.powi(-2 - k % 7);
        let slope = (smoothed.eval(&x) - smoothed.eval(&near)).norm() / (x - near).norm();
        steepest = steepest.max(slope);
    }
    reads.read(
        "4.4",
        "largest difference quotient of the smoothed field near the singularity, times eps",
        steepest * eps,
    );
}

#[test]
fn transition_functions_against_eq_9() {
    let mut reads = Reads::by("claims::transition_functions_against_eq_9");
    // The largest distance from 1 beyond 30 eps, for two eps a factor of a hundred apart.
    let distance = |phi: Transition, eps: f64| {
        (0..200)
            .map(|k| 30.0 * eps + 0.01 * f64::from(k))
            .map(|x| (phi.eval(x, eps) - 1.0).abs())
            .fold(0.0, f64::max)
    };
    let power = |phi| (distance(phi, 1e-4) / distance(phi, 1e-6)).log10() / 2.0;
    let perturbed = Transition::PerturbedTanh { sigma: 0.13 };
    // tanh is 1 to rounding there: it falls faster than any power.
    let tanh = if distance(Transition::Tanh, 1e-4) < 1e-15 { 1e9 } else { power(Transition::Tanh) };
    reads.read(
        "4.5",
        "power of eps of tanh's distance from eq. (9) beyond 30 eps, or infinite",
        tanh,
    );
    reads.read(
        "4.5",
        "power of eps of the perturbed function's distance from eq. (9)",
        power(perturbed),
    );
    let eps = 1e-8;
    let sides = (perturbed.eval(0.1, eps) - 1.0).abs().max(perturbed.eval(-0.1, eps).abs());
    reads.read("8.5", "distance of phi from 1 and 0 on the two sides at eps = 1e-8", sides);
    let left = (perturbed.eval(-0.1, eps) + 1.0).abs();
    reads.read("8.5", "distance of phi from sign(x) on the left at eps = 1e-8", left);
}

#[test]
fn phi_is_drawn_to_its_ends() {
    let mut reads = Reads::by("claims::phi_is_drawn_to_its_ends");
    let (eps, eps_prime) = (1e-3, 1e-2);
    let system = Reading::Reconstructed.caricature();
    let field = Hysteretic { system, eps, eps_prime, relaxation: Relaxation::Literal };
    let mut worst = 0.0_f64;
    for phi in [0.0, 0.3, 1.0] {
        for (beyond, end) in [(1.01 * eps_prime, 1.0), (-1.01 * eps_prime, 0.0)] {
            // x + eps (2 phi - 1) lies beyond eps prime on one side or the other.
            let x = beyond - eps * (2.0 * phi - 1.0);
            let rate = field.eval(&Vector4::new(x, 0.1, 0.1, phi))[3];
            worst = worst.max((eps_prime * rate + phi - end).abs());
        }
    }
    reads.read(
        "4.7",
        "distance between where phi is drawn and 0 or 1 beyond eps prime, read literally",
        worst,
    );
}

fn figure(id: &str) -> Figure {
    figures::all().into_iter().find(|f| f.id == id).unwrap()
}

/// The run of a figure's panel in a reading.
fn panel(id: &str, reading: Reading, label: &str) -> RunSpec {
    let picture =
        figure(id).pictures.into_iter().find(|p| p.reading == Some(reading.into())).unwrap();
    picture.panels.into_iter().find(|p| p.label == label).unwrap().run
}

#[test]
fn intervals_against_the_limit_of_steps() {
    let mut reads = Reads::by("claims::intervals_against_the_limit_of_steps");
    let most = |id, label| {
        let run = RunSpec { t_end: 200.0, ..panel(id, Reading::Printed, label) };
        simulate(&run, &()).unwrap().most_steps_in_segment as f64
    };
    reads.read(
        "5.1",
        "most steps in an interval of fig. 7(iii) until t = 200",
        most("fig7", "iii"),
    );
    reads.read("5.1", "most steps in an interval of fig. 9(i) until t = 200", most("fig9", "i"));
}

#[test]
fn visits_by_the_end_of_figure_6() {
    let mut reads = Reads::by("claims::visits_by_the_end_of_figure_6");
    for reading in Reading::ALL {
        let run = panel("fig6", reading, "i");
        let Data::Path(samples) = simulate(&run, &()).unwrap().data else {
            panic!("fig. 6 is made of paths")
        };
        let (mut away, mut visits) = (true, 0);
        for sample in &samples {
            let distance = SVector::from(sample.x).norm();
            if distance > 0.4 {
                away = true;
            } else if distance < 0.1 && away {
                away = false;
                visits += 1;
            }
        }
        reads.read("5.6", &of(reading, "visits by t = 150"), f64::from(visits));
    }
}

#[test]
fn panels_of_figure_6_share_few_places() {
    let mut reads = Reads::by("claims::panels_of_figure_6_share_few_places");
    let executor = Executor::quiet();
    for reading in Reading::ALL {
        let runs = ["i", "ii", "iii", "iv"].map(|label| panel("fig6", reading, label));
        let mut largest = 0.0_f64;
        for (k, a) in runs.iter().enumerate() {
            for b in &runs[k + 1..] {
                let shared: Shared = executor
                    .ask(&PathComparison(a.clone(), b.clone()))
                    .unwrap()
                    .fact("shared")
                    .unwrap();
                largest = largest.max(shared.overlap);
            }
        }
        let shared = executor.ask(&PathComparison(runs[2].clone(), runs[3].clone())).unwrap();
        let shared: Shared = shared.fact("shared").unwrap();
        reads.read(
            "6.1",
            &of(reading, "largest share of places that two panels have in common"),
            largest,
        );
        reads.read(
            "6.3",
            &of(reading, "share of places that 6(iii) and 6(iv) have in common"),
            shared.overlap,
        );
    }
}

/// The verdicts of the references, which the golden tests (fig. 6) and `make check` (fig. 9)
/// compute again.
#[test]
fn committed_verdicts_say_so() {
    let mut reads = Reads::by("claims::committed_verdicts_say_so");
    for (id, figure, labels) in
        [("6.2", "fig6", &["i"][..]), ("9.1", "fig9", &["i"]), ("9.2", "fig9", &["ii", "iii"])]
    {
        let manifest = Manifest::parse(figures::reference(figure).unwrap(), figure).unwrap();
        for reading in Reading::ALL {
            let picture = manifest.picture(&format!("{figure}-{}", reading.word())).unwrap();
            let chosen = picture.panels.iter().filter(|p| labels.contains(&p.label.as_str()));
            let agreeing = chosen.filter(|p| p.verdict.as_ref().unwrap().agrees).count();
            reads.read(id, &of(reading, "panels whose committed verdict agrees"), agreeing as f64);
        }
    }
}

#[test]
fn the_census_counts_outcomes() {
    let mut reads = Reads::by("claims::the_census_counts_outcomes");
    let rules = claims().rules;
    for reading in Reading::ALL {
        let of = |quantity| of(reading, quantity);
        let runs =
            PANELS.map(|panel| twofold::jeffrey_2013::census::runs(panel.name, reading).unwrap());
        let support: Vec<u64> =
            PANELS.iter().zip(&runs).map(|(p, runs)| supporting(p.said, runs, &rules)).collect();
        for (id, hits) in ["7.1", "7.2", "7.3", "8.1", "8.2", "8.3"].into_iter().zip(&support) {
            reads.read(id, &of("runs of the panel with this outcome"), *hits as f64);
        }
        if reading == Reading::Printed {
            let seen = support.iter().filter(|hits| **hits > 0).count();
            let quantity = "panels of figs 7 and 8 of which some printed run shows the outcome";
            reads.read("5.2", quantity, seen as f64);
        }
        let decided = |counts: [u64; 6]| {
            MotionKind::ALL
                .into_iter()
                .zip(counts)
                .filter(|(kind, n)| *kind != MotionKind::Undecided && *n > 0)
                .count()
        };
        let kinds = |runs: &[twofold::jeffrey_2013::study::census::CensusRun]| {
            decided(tally(runs, rules.end))
        };
        for (id, panels) in [("7.4", &runs[..3]), ("8.4", &runs[3..])] {
            let share = |runs: &[twofold::jeffrey_2013::study::census::CensusRun]| {
                tally(runs, rules.end).map(|n| n as f64 / runs.len() as f64)
            };
            let alike: f64 =
                (0..6).map(|k| panels.iter().map(|runs| share(runs)[k]).product::<f64>()).sum();
            let quantity = "probability that three runs, one of each panel, do not all end alike";
            reads.read(id, &of(quantity), 1.0 - alike);
        }
        let most = runs.iter().map(|runs| kinds(runs)).max().unwrap();
        reads.read("5.4", &of("most kinds of outcome within one panel"), most as f64);
        let all = runs.concat();
        let [one, three, _, irregular, ..] = tally(&all, rules.end);
        reads.read(
            "5.5",
            &of("least of the numbers of periodic and of irregular runs"),
            (one + three).min(irregular) as f64,
        );
        let late = all.iter().filter(|r| r.captured_at > rules.shown_from).count();
        reads.read("5.7", &of("runs captured after shown_from"), late as f64);
    }
}

#[test]
fn sharper_methods_part_too() {
    let mut reads = Reads::by("claims::sharper_methods_part_too");
    let end = |name| {
        let tolerance = Tolerance { rtol: 1e-13, atol: 1e-13 };
        let run = panel("fig7", Reading::Reconstructed, "iii");
        let method = MethodSpec { name, tolerance, ..run.method };
        SVector::from(simulate(&RunSpec { t_end: 60.0, method, ..run }, &()).unwrap().x)
    };
    let distance = (end(Method::Dopri5) - end(Method::Lsoda)).norm();
    reads.read(
        "7.5",
        "distance at t = 60 between orbits by two methods at tolerance 1e-13, reconstructed",
        distance,
    );
}

#[test]
fn both_orbits_are_proved() {
    let mut reads = Reads::by("claims::both_orbits_are_proved");
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("proofs/certificates/coexistence.json");
    let certificate: serde_json::Value =
        serde_json::from_str(&fs::read_to_string(path).unwrap()).unwrap();
    // `make proofs-quick` verifies the certificate; what it says of the derivatives of the return
    // maps is judged here.
    let attracts = |orbit: &serde_json::Value| {
        let [[a, b], [c, d]]: [[[f64; 2]; 2]; 2] =
            serde_json::from_value(orbit["derivative_at_point"].clone()).unwrap();
        let corner = |k: usize| {
            let [a, b, c, d] =
                [(a, 0), (b, 1), (c, 2), (d, 3)].map(|(pair, bit)| pair[k >> bit & 1]);
            let (trace, determinant) = (a + d, a * d - b * c);
            // Both multipliers lie in the unit circle (Jury's conditions).
            determinant < 1.0 && trace.abs() < 1.0 + determinant
        };
        (0..16).all(corner)
    };
    let orbits = certificate["data"].as_object().unwrap();
    let attracting = orbits.values().filter(|orbit| attracts(orbit)).count();
    reads.read(
        "6.4",
        "attracting closed orbits proved in the reconstructed reading",
        attracting as f64,
    );
}

/// The late half of every panel of fig. 7 in a reading.
fn late_halves(reading: Reading) -> Vec<Vec<Crossing>> {
    let figure = figures::all().into_iter().find(|f| f.id == "fig7").unwrap();
    let picture = figure.pictures.into_iter().find(|p| p.reading == Some(reading.into())).unwrap();
    picture
        .panels
        .iter()
        .map(|panel| match simulate(&panel.run, &()).unwrap().data {
            Data::Section(crossings) => {
                crossings.into_iter().filter(|c| c.t > 0.5 * panel.run.t_end).collect()
            }
            _ => panic!("fig. 7 is made of sections"),
        })
        .collect()
}

#[test]
fn printed_reading_ends_on_one_periodic_orbit() {
    // y = 0 at (x, z) = (17.0573, -0.0154) up and (-13.3857, -0.0199) down, period 20.25, to three
    // digits of the orbit's size.
    for late in late_halves(Reading::Printed) {
        for c in &late {
            let (x, z) =
                if c.direction == Direction::Up { (17.0573, -0.0154) } else { (-13.3857, -0.0199) };
            assert!((c.x[0] - x).abs() < 1e-2, "{c:?}");
            assert!((c.x[2] - z).abs() < 5e-3, "{c:?}");
        }
        let ups: Vec<f64> =
            late.iter().filter(|c| c.direction == Direction::Up).map(|c| c.t).collect();
        let period = (ups[ups.len() - 1] - ups[0]) / (ups.len() - 1) as f64;
        assert!((period - 20.25).abs() < 5e-3, "{period}");
    }
}

#[test]
fn reconstructed_reading_is_bounded() {
    for late in late_halves(Reading::Reconstructed) {
        assert!(late.len() > 30_000);
        for c in &late {
            assert!(c.x[0].abs() < 1.6 && c.x[2].abs() < 0.9, "{c:?}");
        }
    }
}
