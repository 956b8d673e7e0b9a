//! The solver lottery: fig. 7 under three methods. Not a figure of the paper; the question that the
//! paper raises.
//!
//! Each column is one of fig. 7's panels, each row a method. Same equations, same start, same
//! tolerance.

use crate::reading::in_both_readings;
use twofold::integrate::Schedule;
use twofold::job::spec::*;
use twofold::paper::verdict::{Claim, SectionClaim};
use twofold::paper::{Figure, FigurePanel, View};

/// The figure's specification.
pub fn figure() -> Figure {
    in_both_readings(
        "lottery",
        "The solver lottery: fig. 7 under three methods",
        View::LateSection { horizontal: 0, vertical: 2 },
        |_| {
            "Poincaré sections y = 0 of the smoothed system to t = 200000, one row per integration \
                method, one column per \
             restart interval (20, 40, 100), all at the same tolerance. The later half, as the \
             paper shows it."
                .into()
        },
        |reading| {
            let mut panels = Vec::new();
            for (row, method) in
                ["a", "b", "c"].into_iter().zip([Method::Lsoda, Method::Dopri5, Method::Radau5])
            {
                for (column, interval, claim) in [
                    ("i", 20.0, SectionClaim::Periodic),
                    ("ii", 40.0, SectionClaim::Period(3)),
                    ("iii", 100.0, SectionClaim::Chaos),
                ] {
                    let run = RunSpec {
                        system: reading.caricature().into(),
                        switch: SwitchSpec::tanh(1e-3),
                        start: vec![0.2, 0.0, -1.0],
                        t_end: 2e5,
                        method: MethodSpec::ndsolve_defaults(method),
                        schedule: Schedule { restart_every: Some(interval), kick: None },
                        observe: Observation::Section { coordinate: 1, value: 0.0 },
                    };
                    let label = format!("{row}-{column}");
                    let title = format!("{}, {interval}", method.name());
                    let mut panel =
                        FigurePanel::new(&label, title, run).claimed(Claim::Section(claim));
                    panel.claimant = format!("paper, fig. 7({column})");
                    panels.push(panel);
                }
            }
            panels
        },
    )
}
