//! CONTRIBUTING's worked examples are built and run, and do what they say.

#[allow(dead_code)]
#[path = "../../examples/hybrid_from_text.rs"]
mod hybrid_from_text;
#[allow(dead_code)]
#[path = "../../examples/own_figure.rs"]
mod own_figure;
#[allow(dead_code)]
#[path = "../../examples/own_method.rs"]
mod own_method;
#[allow(dead_code)]
#[path = "../../examples/own_system.rs"]
mod own_system;
#[allow(dead_code)]
#[path = "../../papers/jeffrey-2013/examples/returns.rs"]
mod returns;
#[allow(dead_code)]
#[path = "../../papers/jeffrey-2013/examples/visits.rs"]
pub mod visits;

use twofold::integrate::filippov::EventKind;
use twofold::job::Executor;
use twofold::num::elementary::{cos, sin};

#[test]
fn own_system_slides_on_its_surface() {
    let events = own_system::follow().unwrap();
    // It lands on prey = 1 and slides there: too many predators to let the prey grow, too few prey
    // to be hunted.
    assert!(matches!(events[0].kind, EventKind::Landing { .. }), "{events:?}");
    assert!(events.iter().all(|e| (e.state[0] - 1.0).abs() < 1e-9), "{events:?}");
}

#[test]
fn a_block_of_text_sticks_until_the_push_exceeds_friction() {
    let story = hybrid_from_text::follow_block(30.0).unwrap();
    // sin t = 1/2.
    let free = story.free.unwrap();
    assert!((free - std::f64::consts::FRAC_PI_6).abs() < 1e-2, "{free}");
    assert_eq!(story.bounces[0].1, "right wall");
    // From rest at pi/6, x = cos(pi/6) s - sin t + 1/2 - s^2/4 after a time s.
    let (t, start) = (story.bounces[0].0, std::f64::consts::FRAC_PI_6);
    let s = t - start;
    let x = cos(start) * s - sin(t) + 0.5 - 0.25 * s * s;
    assert!((x - 0.4).abs() < 1e-8, "{x}");
}

#[test]
fn own_method_agrees_with_dormand_prince() {
    let passages = own_method::compare().unwrap();
    // A pendulum released at 1 radian swings with period 4 K(sin(1/2)) = 6.6996: nine passages in
    // 30.
    assert_eq!(passages.len(), 9);
    assert!((passages[2][0] - passages[0][0] - 6.699_6).abs() < 1e-3, "{passages:?}");
    assert!(passages.iter().all(|[ours, theirs]| (ours - theirs).abs() < 1e-6), "{passages:?}");
}

#[test]
fn own_figure_is_written_whole() {
    let folder = tempfile::tempdir().unwrap();
    let records =
        twofold::cli::make(&[own_figure::figure()], folder.path(), &Executor::quiet()).unwrap();
    assert_eq!(records.len(), 1);
    for file in ["own.png", "own.svg", "own.pdf", "own.json", "own-a.csv", "own-b.csv"] {
        assert!(folder.path().join("own").join(file).metadata().unwrap().len() > 500, "{file}");
    }
}

#[test]
fn few_orbits_come_back_from_far_away_in_the_reconstructed_reading() {
    let back = |box_size| {
        returns::back(&twofold::system::Caricature::with_reinjection(1e-1, 1e-5), box_size, 12)
            .unwrap()
    };
    // The shares of 400 are 0.995 and 0.17: twelve starts have these by chance only once in 10^5
    // and 10^4.
    assert!(back(0.3) >= 10, "{}", back(0.3));
    assert!(back(3.0) <= 7, "{}", back(3.0));
}
