//! Fig. 2: the wheel assembly, smoothed. A reconstruction: see `twofold::system::wheel`.

use twofold::integrate::{Schedule, StepCap, Tolerance};
use twofold::job::spec::*;
use twofold::paper::{Camera, Figure, Panel, Picture, View};
use twofold::system::Wheel;

/// The figure's specification.
pub fn figure() -> Figure {
    Figure {
        id: "fig2".into(),
        title: "The wheel assembly returns to its singularity".into(),
        pictures: vec![Picture {
            name: "fig2".into(),
            reading: None,
            title: "The wheel assembly returns to its singularity".into(),
            caption:
                "Trajectory of the wheel assembly with sign(h) replaced by tanh(h/ε), t = 0 … 60. The surface h = 0, \
                      where wheel and disc stick, is shaded by region; the dot is the two-fold singularity. Our own \
                      reconstruction: the paper refers to another article for the coefficients."
                    .into(),
            view: View::Space { camera: Camera { axes: [0, 2, 1], azimuth: -115.0, elevation: 18.0 } },
            panels: vec![Panel::new(
                "i",
                "",
                RunSpec {
                    system: Wheel::default().into(),
                    switch: SwitchSpec::tanh(1e-3),
                    start: vec![0.69267, 0.0, 0.0],
                    t_end: 60.0,
                    method: MethodSpec {
                        name: Method::Dopri5,
                        tolerance: Tolerance { rtol: 1e-9, atol: 1e-9 },
                        step_cap: StepCap::None,
                        max_steps: DEFAULT_MAX_STEPS,
                        precision: None,
                        order: None,
                    },
                    schedule: Schedule::default(),
                    observe: Observation::Path { chord: 1e-3 },
                },
            )],
            alterations: Vec::new(),
        }],
    }
}
