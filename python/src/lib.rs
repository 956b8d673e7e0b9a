//! The native half of the Python package `twofold`: systems, jobs and verdicts of the library,
//! handed to Python.
//!
//! Nothing is computed here. What a call means (defaults, names, shapes) is said in Python
//! (`twofold/`), which hands a run over as the same JSON spec that `twofold run --spec` reads; so
//! both ask the same question and get the same bytes. Numbers go back as the very vectors in which
//! the job recorded them.

mod answers;
mod errors;
mod folder;
// The names of the platform's mathematics that dependencies ask for, defined as our own;
// python/build.rs binds them.
#[cfg(target_os = "linux")]
#[path = "../../src/bin/twofold/mathematics.rs"]
mod mathematics;
mod paper;
mod supervise;
mod system;

/// The native half of `twofold`; use `import twofold`.
#[pyo3::pymodule]
mod _native {
    #[pymodule_export]
    use super::answers::{ask, classify, fates, outcomes, run, sweep, written};
    #[pymodule_export]
    use super::folder::{paper, paper_answer, paper_claims, paper_verdicts};
    #[pymodule_export]
    use super::paper::{panels, verdict_table};
    #[pymodule_export]
    use super::system::{Definition, builtin_names};

    use pyo3::prelude::*;
    use pyo3::types::PyDict;
    use twofold::integrate::{PRECISIONS, Tolerance};
    use twofold::job::question::NUMERICS;
    use twofold::job::spec::{DEFAULT_MAX_STEPS, Method, MethodSpec, finest_extended, in_units_of};

    /// The default absolute tolerance of a run from `start`.
    #[pyfunction]
    fn default_atol(tolerance: f64, start: Vec<f64>) -> f64 {
        in_units_of(Tolerance { rtol: tolerance, atol: tolerance }, &start).atol
    }

    #[pymodule_init]
    fn constants(module: &Bound<'_, PyModule>) -> PyResult<()> {
        module.add("VERSION", env!("CARGO_PKG_VERSION"))?;
        // The digest of the sources that numbers depend on.
        module.add("NUMERICS", NUMERICS)?;
        module.add("DEFAULT_TOLERANCE", MethodSpec::defaults(Method::Dopri5).tolerance.rtol)?;
        // By the bits of taylor-extended's numbers.
        let finest = PyDict::new(module.py());
        PRECISIONS.iter().try_for_each(|bits| finest.set_item(bits, finest_extended(*bits)))?;
        module.add("DEFAULT_TOLERANCES_EXTENDED", finest)?;
        module.add("DEFAULT_MAX_STEPS", DEFAULT_MAX_STEPS)
    }
}
