//! Errors as Python knows them: the classes of `twofold.errors`, which say what each means.

use pyo3::PyErr;
use pyo3::exceptions::PyKeyboardInterrupt;
use twofold::job::JobError;
use twofold::job::spec::SpecError as WrongSpec;
use twofold::system::{Diagnostic, ParameterError as WrongParameter};

pyo3::import_exception!(twofold.errors, ComputationError);
pyo3::import_exception!(twofold.errors, DefinitionError);
pyo3::import_exception!(twofold.errors, InternalError);
pyo3::import_exception!(twofold.errors, ParameterError);
pyo3::import_exception!(twofold.errors, SpecError);

/// A definition that is wrong at a known place.
pub fn diagnostic(problem: &Diagnostic) -> PyErr {
    let Diagnostic { message, origin, line, column, help, .. } = problem.clone();
    DefinitionError::new_err((problem.to_string(), message, origin, line, column, help))
}

/// A definition that is wrong at no place that could be shown.
pub fn definition(text: String) -> PyErr {
    DefinitionError::new_err((text,))
}

/// A parameter that is wrong.
pub fn parameter(problem: &WrongParameter) -> PyErr {
    let name = match problem {
        WrongParameter::Unknown { name, .. }
        | WrongParameter::OutOfBounds { name, .. }
        | WrongParameter::NotFinite { name, .. } => name.clone(),
    };
    ParameterError::new_err((problem.to_string(), name))
}

/// A spec that is wrong: the field by the name that it has in Python.
pub fn spec(problem: &WrongSpec) -> PyErr {
    let field = problem.field.replace('-', "_");
    let rule = problem.rule.replace("--section", "the section");
    SpecError::new_err((format!("{field} is {}: {rule}", problem.value), field))
}

/// A job that has no answer.
pub fn job(problem: &JobError) -> PyErr {
    match problem {
        JobError::Spec(wrong) => spec(wrong),
        JobError::Dimension(wrong) => SpecError::new_err((wrong.to_string(), "system")),
        JobError::Interrupted => PyKeyboardInterrupt::new_err(()),
        other if other.is_bad_question() => SpecError::new_err((other.to_string(), "question")),
        other => ComputationError::new_err((other.to_string(),)),
    }
}
