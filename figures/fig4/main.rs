//! Fig. 4: the mechanism of non-deterministic chaos, computed: a singularity with one way in, and its many ways out that come
//! back.

use twofold::figure::spec::*;
use twofold::figure::{Camera, Figure, Panel, Reading, View, cli};
use twofold::integrate::filippov::ExitRule;
use twofold::integrate::{Schedule, StepCap, Tolerance};

/// The figure's specification.
pub fn figure() -> Figure {
    Figure::in_both_readings(
        "fig4",
        "One point, many futures, all of which return",
        View::Space { camera: Camera { axes: [1, 2, 0], azimuth: -60.0, elevation: 18.0 } },
        |_| {
            "The orbit from (0.2, 0, −1) reaches the two-fold; from there its future is a set. Nine exit times from the repelling \
             region, each to both sides, followed until they come back to the two-fold (or for the time given by the funnel's \
             horizon). All of these pass through one point."
                .into()
        },
        |reading| {
            let (longest, horizon) = match reading {
                Reading::Printed => (6.0, 26.0),
                Reading::Reconstructed => (1.5, 5.0),
            };
            vec![Panel::new(
                "i",
                "",
                RunSpec {
                    system: SystemSpec::Caricature(reading.caricature()),
                    switch: SwitchSpec::Filippov {
                        exit: ExitRule::All,
                        funnel: Some(FunnelSpec { shortest: 0.1, longest, times: 9, horizon, until_two_fold: true }),
                    },
                    start: [0.2, 0.0, -1.0],
                    t_end: 100.0,
                    method: MethodSpec {
                        name: Method::Dopri5,
                        tolerance: Tolerance { rtol: 1e-12, atol: 1e-12 },
                        step_cap: StepCap::None,
                        max_steps: DEFAULT_MAX_STEPS,
                    },
                    schedule: Schedule::default(),
                    observe: Observation::Path { chord: 1e-3 },
                },
            )]
        },
    )
}

/// Makes the figure.
pub fn main() -> std::process::ExitCode {
    cli::main(figure())
}
