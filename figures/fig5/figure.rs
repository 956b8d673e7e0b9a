//! Fig. 5: a typical trajectory of the discontinuous system (5).

use twofold::integrate::filippov::{ExitRule, SlidingLaw};
use twofold::integrate::{Schedule, StepCap, Tolerance};
use twofold::job::spec::*;
use twofold::paper::{Camera, Figure, Panel, Reading, View};

/// The figure's specification.
pub fn figure() -> Figure {
    Figure::in_both_readings(
        "fig5",
        "A trajectory of the discontinuous system",
        View::Space { camera: Camera { axes: [1, 2, 0], azimuth: -60.0, elevation: 18.0 } },
        |_| {
            "One trajectory of the discontinuous system (5), by event-driven Filippov integration. Where it slides on x = 0 the \
             line is thick; it enters the two-fold in the attracting region and leaves through the repelling one, where \
             the moment and the side of each exit (open dots) are drawn at random: the equations do not choose them. Below, the passage nearer. Times of exit have mean 3 and the orbit lasts 400 in the printed \
             reading, 0.5 and 80 in the reconstructed one."
                .into()
        },
        |reading| {
            // The printed reading's orbits are ten times larger and slower.
            let (t_end, mean) = match reading {
                Reading::Printed => (400.0, 3.0),
                Reading::Reconstructed => (80.0, 0.5),
            };
            vec![Panel::new(
                "i",
                "",
                RunSpec {
                    system: reading.caricature().into(),
                    switch: SwitchSpec::Filippov {
                        exit: ExitRule::Random {
                            law: SlidingLaw::Exponential { mean },
                            plus_probability: 0.5,
                            seed: 2013,
                            stream: 5,
                        },
                        funnel: None,
                    },
                    start: vec![0.2, 0.0, -1.0],
                    t_end,
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
