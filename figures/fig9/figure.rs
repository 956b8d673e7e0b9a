//! Fig. 9: fig. 7(iii) with hysteresis, and with noise.
//!
//! The caption says (i) hysteresis, (ii)-(iii) noise; the text's "(9(iii)) chaotic ... washed out by noise (9(i-ii))" has the
//! opposite order. The caption is followed.

use twofold::integrate::{Kick, KickLaw, Schedule};
use twofold::job::spec::*;
use twofold::paper::verdict::{Claim, SectionClaim};
use twofold::paper::{Figure, Panel, Repeats, View};
use twofold::system::Relaxation;

use super::audit;

/// The figure's specification.
pub fn figure() -> Figure {
    Figure::in_both_readings(
        "fig9",
        "Hysteresis and noise",
        View::Section { horizontal: 0, vertical: 2 },
        |_| {
            "Poincaré sections y = 0: (i) with hysteresis, eq. (10) read literally, ε′ = 10 ε; (ii), (iii) with a random \
             perturbation of length ε after each 0.3, two runs. Intervals of 100. Above the later half, as the paper shows it; below the early half."
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
                        t_end: 2e5,
                        method: MethodSpec::ndsolve_defaults(Method::Lsoda),
                        schedule: Schedule { restart_every: Some(100.0), kick },
                        observe: Observation::Section { coordinate: 1, value: 0.0 },
                    },
                )
            };
            let noise = |stream| Some(Kick { every: 0.3, size: eps, law: KickLaw::Sphere, seed: 2013, stream });
            vec![
                panel("i", "hysteresis", SwitchSpec::hysteretic(eps, Relaxation::Literal), None)
                    .claimed(Claim::Section(SectionClaim::Chaos))
                    .repeated(Repeats { panel: "9(i)", reading, count: audit::support }),
                panel("ii", "noise, first run", SwitchSpec::tanh(eps), noise(1))
                    .claimed(Claim::Section(SectionClaim::PartlyWashedOut)),
                panel("iii", "noise, second run", SwitchSpec::tanh(eps), noise(2))
                    .claimed(Claim::Section(SectionClaim::PartlyWashedOut)),
            ]
        },
    )
}
