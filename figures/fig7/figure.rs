//! Fig. 7: Poincare sections of the smoothed system, restarted after every interval.

use twofold::integrate::Schedule;
use twofold::job::spec::*;
use twofold::paper::verdict::{Claim, SectionClaim};
use twofold::paper::{Figure, Panel, Repeats, View};

use super::census;

/// The figure's specification.
pub fn figure() -> Figure {
    Figure::in_both_readings(
        "fig7",
        "One system, one start, three iteration schemes",
        View::Section { horizontal: 0, vertical: 2 },
        |_| {
            "Poincaré sections y = 0 of the smoothed system, integrated to t = 200000 in intervals of (i) 20, (ii) 40, \
             (iii) 100 after each of which the integrator starts afresh. Above the later half, as the paper shows it; below the early half."
                .into()
        },
        |reading| {
            let repeats = |panel| Repeats { panel, reading, count: census::support };
            let panel = |label, interval| {
                Panel::new(
                    label,
                    format!("interval {interval}"),
                    RunSpec {
                        system: reading.caricature().into(),
                        switch: SwitchSpec::tanh(1e-3),
                        start: vec![0.2, 0.0, -1.0],
                        t_end: 2e5,
                        method: MethodSpec::ndsolve_defaults(Method::Lsoda),
                        schedule: Schedule { restart_every: Some(interval), kick: None },
                        observe: Observation::Section { coordinate: 1, value: 0.0 },
                    },
                )
            };
            vec![
                panel("i", 20.0).claimed(Claim::Section(SectionClaim::Periodic)).repeated(repeats("7(i)")),
                panel("ii", 40.0).claimed(Claim::Section(SectionClaim::Period(3))).repeated(repeats("7(ii)")),
                panel("iii", 100.0).claimed(Claim::Section(SectionClaim::Chaos)).repeated(repeats("7(iii)")),
            ]
        },
    )
}
