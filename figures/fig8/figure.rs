//! Fig. 8: fig. 7(iii) with a perturbed transition function.

use twofold::integrate::Schedule;
use twofold::job::spec::*;
use twofold::paper::verdict::{Claim, SectionClaim};
use twofold::paper::{Figure, Panel, Repeats, View};

use super::census;
use twofold::system::Transition;

/// The figure's specification.
pub fn figure() -> Figure {
    Figure::in_both_readings(
        "fig8",
        "Three ways to smooth the same switch",
        View::Section { horizontal: 0, vertical: 2 },
        |_| {
            "Poincaré sections y = 0 of the smoothed system with the transition function perturbed by σ√ε exp(−x²), \
             (i) σ = 0.01, (ii) σ = 0.1, (iii) σ = 0.13; intervals of 100. Above the later half, as the paper shows it; below the early half."
                .into()
        },
        |reading| {
            let repeats = |panel| Repeats { panel, reading, count: census::support };
            let panel = |label, sigma| {
                Panel::new(
                    label,
                    format!("*σ* = {sigma}"),
                    RunSpec {
                        system: reading.caricature().into(),
                        switch: SwitchSpec::Smoothed { eps: 1e-3, transition: Transition::PerturbedTanh { sigma } },
                        start: vec![0.2, 0.0, -1.0],
                        t_end: 2e5,
                        method: MethodSpec::ndsolve_defaults(Method::Lsoda),
                        schedule: Schedule { restart_every: Some(100.0), kick: None },
                        observe: Observation::Section { coordinate: 1, value: 0.0 },
                    },
                )
            };
            vec![
                panel("i", 0.01).claimed(Claim::Section(SectionClaim::Chaos)).repeated(repeats("8(i)")),
                panel("ii", 0.1).claimed(Claim::Section(SectionClaim::Periodic)).repeated(repeats("8(ii)")),
                panel("iii", 0.13).claimed(Claim::Section(SectionClaim::Periodic)).repeated(repeats("8(iii)")),
            ]
        },
    )
}
