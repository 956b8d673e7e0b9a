//! Fig. 4: the mechanism of non-deterministic chaos, computed: a singularity with one way in, and
//! its many ways out that come back.

use crate::reading::{Reading, in_both_readings};
use twofold::integrate::filippov::ExitRule;
use twofold::integrate::{Schedule, StepCap, Tolerance};
use twofold::job::spec::*;
use twofold::paper::{Camera, Figure, FigurePanel, View};

/// The figure's specification.
pub fn figure() -> Figure {
    in_both_readings(
        "fig4",
        "One way in, many ways out, and back",
        View::Space { camera: Camera { axes: [1, 2, 0], azimuth: -120.0, elevation: 18.0 } },
        |_| {
            "The orbit from (0.2, 0, −1) reaches the two-fold; from there its future is a set. \
                Five exit times from the repelling \
             region, each to both sides, followed until they come back to the two-fold. \
             All these orbits pass through one point, so that a trajectory leads from any of their \
             points to any other: thick, one from A to B. \
             Below, the passage enlarged. Orbits of the printed reading are larger and slower, so \
             exits are \
             spread up to 2 and orbits followed for 60 there, up to 0.8 and for 16 in the \
             reconstructed one."
                .into()
        },
        |reading| {
            let (longest, horizon, back) = match reading {
                Reading::Printed => (2.0, 60.0, 35),
                Reading::Reconstructed => (0.8, 16.0, 40),
            };
            vec![FigurePanel::new(
                "i",
                format!("{back} of 40 futures come back within 300 units of time; 10 are drawn"),
                RunSpec {
                    system: reading.caricature().into(),
                    switch: SwitchSpec::Filippov {
                        exit: ExitRule::All,
                        funnel: Some(FunnelSpec {
                            shortest: 0.1,
                            longest,
                            times: 5,
                            horizon,
                            until_two_fold: true,
                        }),
                    },
                    start: vec![0.2, 0.0, -1.0],
                    t_end: 100.0,
                    method: MethodSpec {
                        name: Method::Dopri5,
                        tolerance: Tolerance { rtol: 1e-12, atol: 1e-12 },
                        step_cap: StepCap::None,
                        max_steps: DEFAULT_MAX_STEPS,
                        precision: None,
                        order: None,
                    },
                    schedule: Schedule::default(),
                    observe: Observation::Path { chord: 1e-3 },
                },
            )]
        },
    )
}
