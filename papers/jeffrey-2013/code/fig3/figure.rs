//! Fig. 3: the two-fold (Teixeira) singularity of the normal form (4).

use std::sync::Arc;

use crate::computed::Computed;
use crate::sketch::portrait;
use serde_json::json;
use twofold::paper::{Figure, Picture, Study, View};

/// The constants v, w < 0 with vw > 1: the paper's v+ and v-.
const V: f64 = -1.2;
/// See [`V`].
const W: f64 = -1.4;

/// The figure's specification.
pub fn figure() -> Figure {
    Figure {
        id: "fig3".into(),
        title: "The two-fold singularity".into(),
        pictures: vec![Picture {
            name: "fig3".into(),
            reading: None,
            title: "The two-fold singularity".into(),
            caption: "The surface x = 0 of the normal form (4) about its two-fold. Orbits cross \
                where both fields point to the same \
                      side; where they oppose, orbits slide: into the singularity where sliding \
                      attracts, out of it where \
                      sliding repels."
                .into(),
            view: View::Study(Study {
                questions: || {
                    vec![Arc::new(Computed {
                        kind: "two-fold-portrait",
                        question: json!({ "normal-form": { "v": V, "w": W } }),
                        cost: 10.0,
                        compute: || portrait::tables(V, W),
                    })]
                },
                draw: |answers| portrait::draw(&Study::tables(answers), V, W),
            }),
            panels: Vec::new(),
            alterations: Vec::new(),
        }],
    }
}
