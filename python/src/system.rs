//! A piecewise-smooth system as a Python object.

use numpy::{PyArray1, PyReadonlyArray1};
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use twofold::hybrid;
use twofold::num::tape::Program;
use twofold::num::{Decimal, decimal::DecimalError};
use twofold::system::diagnostic::nearest;
use twofold::system::{self, library};

use crate::errors;

/// A definition with values for its parameters; `twofold.System` is made of one.
#[pyclass(module = "twofold._native", frozen, eq)]
#[derive(PartialEq)]
pub struct Definition(system::System);

/// h, f+ and f- at a point.
type Fields<'py> = (f64, Bound<'py, PyArray1<f64>>, Bound<'py, PyArray1<f64>>);

/// A general system where one with h, plus and minus is needed.
fn general(name: &str) -> PyErr {
    errors::definition(format!(
        "{name} is a general system, and this call needs one with h, plus and minus: ask follow, \
            orbit, lyapunov, rests, scan, sensitivities or outcomes"
    ))
}

/// The names of the built-in systems.
#[pyfunction]
pub fn builtin_names() -> Vec<&'static str> {
    library::names().collect()
}

#[pymethods]
impl Definition {
    /// Reads TOML; `origin` names the text in errors.
    #[staticmethod]
    fn from_toml(text: &str, origin: &str) -> PyResult<Self> {
        let read = system::Definition::from_toml(text, origin);
        let definition = read.map_err(|e| match hybrid::Definition::from_toml(text, origin) {
            Ok(_) => general(origin),
            Err(_) => errors::diagnostic(&e),
        })?;
        Ok(Self(system::System::new(definition)))
    }

    /// Reads JSON: a canonical form or a whole definition.
    #[staticmethod]
    fn from_json(text: &str, origin: &str) -> PyResult<Self> {
        serde_json::from_str(text)
            .map(Self)
            .map_err(|e| errors::definition(format!("{origin}: {e}")))
    }

    /// The built-in system of this name.
    #[staticmethod]
    fn builtin(name: &str) -> PyResult<Self> {
        system::System::builtin(name).map(Self).ok_or_else(|| {
            if library::general(name).is_some() {
                return general(name);
            }
            let known: Vec<&str> = library::names().collect();
            let help = nearest(name, &known).map_or(String::new(), |near| {
                format!(
                    ", did you mean \
                {near:?}?"
                )
            });
            let known = known.join(", ");
            errors::definition(format!(
                "there is no built-in system {name:?}{help}; built in are {known}; a file's name \
                    ends in .toml or .json"
            ))
        })
    }

    /// The same system with other values of some parameters: numbers, or digits as strings.
    fn with_values(&self, changes: Vec<(String, Bound<'_, PyAny>)>) -> PyResult<Self> {
        let mut values = Vec::new();
        for (name, value) in &changes {
            let value: Decimal = if let Ok(digits) = value.extract::<String>() {
                digits.parse().map_err(|e: DecimalError| {
                    errors::ParameterError::new_err((format!("{name}: {e}"), name.clone()))
                })?
            } else {
                let number = value.extract::<f64>();
                number
                    .map_err(|_| {
                        PyTypeError::new_err(format!(
                            "{name}: give a number, or its digits as a string"
                        ))
                    })?
                    .into()
            };
            values.push((name.as_str(), value));
        }
        self.0.clone().with_all(values).map(Self).map_err(|e| errors::parameter(&e))
    }

    /// The data that determine the system's numbers, and its name.
    fn to_json(&self) -> String {
        serde_json::to_string(&self.0).expect("systems are plain data")
    }

    /// The definition as a file, with the values that it gives.
    fn to_toml(&self) -> String {
        self.0.definition().to_toml()
    }

    /// h, f+ and f- at a point.
    fn evaluate<'py>(
        &self,
        py: Python<'py>,
        x: PyReadonlyArray1<'py, f64>,
    ) -> PyResult<Fields<'py>> {
        let x = x.as_slice()?;
        let n = self.0.dimension();
        if x.len() != n {
            let text = format!("a point of {} numbers; the system has {n} states", x.len());
            return Err(errors::SpecError::new_err((text, "x")));
        }
        if self.0.definition().second().is_some() {
            let text = "a system with two switching surfaces has four fields, not two".to_owned();
            return Err(errors::SpecError::new_err((text, "system")));
        }
        let mut out = vec![0.0; 1 + 2 * n];
        Program::new(self.0.tape()).evaluate(x, &mut out);
        Ok((out[0], PyArray1::from_slice(py, &out[1..=n]), PyArray1::from_slice(py, &out[n + 1..])))
    }

    #[getter]
    fn name(&self) -> &str {
        self.0.name()
    }

    #[getter]
    fn title(&self) -> &str {
        self.0.definition().title()
    }

    #[getter]
    fn about(&self) -> &str {
        self.0.definition().about()
    }

    #[getter]
    fn references(&self) -> Vec<String> {
        self.0.definition().references().to_vec()
    }

    /// Name, meaning and unit of every state.
    #[getter]
    fn states(&self) -> Vec<(String, String, String)> {
        let states = self.0.definition().states().iter();
        states.map(|s| (s.name.clone(), s.about.meaning.clone(), s.about.unit.clone())).collect()
    }

    /// Name, value, digits, meaning and unit of every parameter.
    #[getter]
    fn parameters(&self) -> Vec<(String, f64, String, String, String)> {
        let about = self.0.definition().parameters().iter().map(|p| &p.about);
        let values = self.0.parameters();
        let row = |((name, value), about): ((&str, &Decimal), &system::definition::About)| {
            (
                name.to_owned(),
                value.value(),
                value.to_string(),
                about.meaning.clone(),
                about.unit.clone(),
            )
        };
        values.zip(about).map(row).collect()
    }

    #[getter]
    fn start(&self) -> Option<Vec<f64>> {
        self.0.definition().start().map(<[f64]>::to_vec)
    }

    #[getter]
    fn h(&self) -> String {
        self.0.definition().switching().to_string()
    }

    #[getter]
    fn plus(&self) -> Vec<String> {
        self.0.definition().plus().iter().map(ToString::to_string).collect()
    }

    #[getter]
    fn minus(&self) -> Vec<String> {
        self.0.definition().minus().iter().map(ToString::to_string).collect()
    }
}
