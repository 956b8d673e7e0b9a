//! Fig. 1: the wheel assembly. A reconstruction: see systems/wheel.toml.

use std::sync::Arc;

use crate::computed::Computed;
use crate::sketch::assembly;
use serde_json::{Map, Value, json};
use twofold::paper::{Figure, Picture, Study, View};
use twofold::system::System;

/// Position of the wheel on its line.
const R: f64 = 0.69267;

/// The figure's specification.
pub fn figure() -> Figure {
    Figure {
        id: "fig1".into(),
        title: "The wheel assembly".into(),
        pictures: vec![Picture {
            name: "fig1".into(),
            reading: None,
            title: "The wheel assembly".into(),
            caption: "The wheel assembly (a) obliquely, (b) from above, to scale: a disc that \
                turns at ω₀; a housing on it that turns at ω; in the housing \
                      a line at distance d from the axle, on which a wheel rolls at an angle γ, \
                      held by a spring and a damper. The \
                      slip h along the wheel's axle is the switching function. Our own \
                      reconstruction."
                .into(),
            view: View::Study(Study {
                questions: || {
                    vec![Arc::new(Computed {
                        kind: "wheel-assembly",
                        question: json!({ "wheel": parameters(), "r": R }),
                        cost: 1.0,
                        compute: || Ok(assembly::tables(&wheel(), R)),
                    })]
                },
                draw: |answers| assembly::draw(&Study::tables(answers)),
            }),
            panels: Vec::new(),
            alterations: Vec::new(),
        }],
    }
}

fn wheel() -> System {
    System::builtin("wheel").expect("it ships")
}

fn parameters() -> Map<String, Value> {
    wheel().parameters().map(|(name, value)| (name.into(), json!(value.value()))).collect()
}
