//! Fig. 6: single trajectories, smoothed, hysteretic, and with noise.

use twofold::integrate::{Kick, KickLaw, Schedule};
use twofold::job::spec::*;
use twofold::paper::verdict::Claim;
use twofold::paper::{Camera, Figure, Panel, View};
use twofold::system::Relaxation;

/// The figure's specification.
pub fn figure() -> Figure {
    Figure::in_both_readings(
        "fig6",
        "One trajectory under three relaxations of the model",
        View::Space { camera: Camera { axes: [1, 2, 0], azimuth: -60.0, elevation: 18.0 } },
        |_| {
            "A single trajectory from (0.2, 0, −1) to t = 150: (i) smoothed; (ii) hysteretic, eq. (10) read literally; \
             (iii), (iv) with a random perturbation of length ε after each 0.3, two runs from the same start."
                .into()
        },
        |reading| {
            let eps = 1e-3;
            let panel = |label, title: &str, switch, kick| {
                Panel::new(
                    label,
                    title,
                    RunSpec {
                        system: reading.caricature().into(),
                        switch,
                        start: vec![0.2, 0.0, -1.0],
                        t_end: 150.0,
                        method: MethodSpec::ndsolve_defaults(Method::Lsoda),
                        schedule: Schedule { restart_every: None, kick },
                        observe: Observation::Path { chord: 1e-3 },
                    },
                )
            };
            let noise = |stream| Some(Kick { every: 0.3, size: eps, law: KickLaw::Sphere, seed: 2013, stream });
            vec![
                panel("i", "smoothed", SwitchSpec::tanh(eps), None).claimed(Claim::LessOrganisedThanNext),
                panel("ii", "hysteretic", SwitchSpec::hysteretic(eps, Relaxation::Literal), None),
                panel("iii", "noise, first run", SwitchSpec::tanh(eps), noise(1)).claimed(Claim::DiffersFromNext),
                panel("iv", "noise, second run", SwitchSpec::tanh(eps), noise(2)),
            ]
        },
    )
}
