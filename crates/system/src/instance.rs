//! A system with values for its parameters, ready to be evaluated.

use std::fmt;
use std::sync::Arc;

use nalgebra::SVector;
use serde::{Deserialize, Deserializer, Serialize, Serializer, de};

use super::definition::ParameterDefinition;
use super::diagnostic::nearest;
use super::document::Canonical;
use super::{Caricature, Definition, PiecewiseSmooth, caricature::MinusSign, library};
use twofold_num::tape::{Program, Tape};
use twofold_num::{Decimal, Elementary};

/// A piecewise-smooth system as data: a [`Definition`] and values for its parameters.
///
/// ```
/// use nalgebra::Vector2;
/// use twofold_system::{Definition, PiecewiseSmooth, System};
/// let text = r#"
///     states = ["x", "v"]
///     h = "v - belt"
///     plus = ["v", "-x - friction"]
///     minus = ["v", "-x + friction"]
///     [parameters]
///     belt = 0.3
///     friction = 1
/// "#;
/// let system = System::new(Definition::from_toml(text, "block.toml")?).with("friction", 0.5)?;
/// // Evaluated over any number type; the dimension is checked here, once.
/// let block = system.bind::<2>()?;
/// assert_eq!(block.switching(&Vector2::new(0.0, 1.3)), 1.0);
/// assert_eq!(block.plus(&Vector2::new(0.25, 1.3)), Vector2::new(1.3, -0.75));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// As JSON, a system is its [canonical form](System::canonical) and its name; read back, a built-in
/// one has its texts again.
#[derive(Clone)]
pub struct System {
    definition: Arc<Definition>,
    /// The parameters' values, in the definition's order.
    values: Vec<Decimal>,
    functions: Arc<Functions>,
}

/// The equations ready for evaluation.
struct Functions {
    /// h, f+, f-.
    tape: Tape,
    switching: Program,
    plus: Program,
    minus: Program,
    /// [`PiecewiseSmooth::degrees`].
    degrees: Option<[u32; 2]>,
}

/// A wrong parameter.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ParameterError {
    /// The system has no parameter of this name.
    #[error("the system has no parameter `{name}`: {help}")]
    Unknown {
        /// The name.
        name: String,
        /// Advice.
        help: String,
    },
    /// The value is outside what the definition allows.
    #[error("{name} is {value}: give a value {rule}{meaning}")]
    OutOfBounds {
        /// The name.
        name: String,
        /// The value.
        value: String,
        /// The allowed range.
        rule: String,
        /// The parameter's meaning, in brackets, if it has one.
        meaning: String,
    },
    /// The value is infinite or not a number.
    #[error("{name} is {value}: a parameter is a finite number")]
    NotFinite {
        /// The name.
        name: String,
        /// The value.
        value: String,
    },
}

/// A system or equation used as what it is not.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum BindError {
    /// In another dimension than its own.
    #[error("this equation has {states} states; it was asked for in dimension {asked}")]
    Dimension {
        /// The equation's number of states.
        states: usize,
        /// The dimension asked for.
        asked: usize,
    },
    /// As a system with one switching surface.
    #[error(
        "this system has two switching surfaces, and this is computed for one; smooth the \
            switches, or leave the table [second] out"
    )]
    TwoSurfaces,
}

impl System {
    /// The system with the values that its definition gives.
    pub fn new(definition: Definition) -> Self {
        let values = definition.parameters().iter().map(|p| p.value.clone()).collect();
        Self::made(Arc::new(definition), values)
    }

    fn made(definition: Arc<Definition>, values: Vec<Decimal>) -> Self {
        let names = definition.states().iter().map(|s| s.name.clone());
        let tape = definition.tape(&values).with_names(names);
        let n = definition.dimension();
        let h = tape.select([0]);
        let functions = Functions {
            degrees: h.degree().zip(tape.select(1..=2 * n).degree()).map(<[u32; 2]>::from),
            switching: Program::new(&h),
            plus: Program::new(&tape.select(1..=n)),
            minus: Program::new(&tape.select(n + 1..=2 * n)),
            tape,
        };
        Self { definition, values, functions: Arc::new(functions) }
    }

    /// The built-in system of this name (see [`library`]).
    ///
    /// ```
    /// use twofold_system::System;
    /// let chua = System::builtin("chua").expect("it ships").with("alpha", 8.8)?;
    /// assert_eq!(chua.coordinates(), ["x", "y", "z"]);
    /// assert!(System::builtin("cua").is_none());
    /// # Ok::<(), twofold_system::ParameterError>(())
    /// ```
    pub fn builtin(name: &str) -> Option<Self> {
        library::definition(name).cloned().map(Self::new)
    }

    /// The same system with another value of a parameter.
    ///
    /// # Errors
    /// If there is no such parameter, or the value is not finite.
    pub fn with(self, parameter: &str, value: impl Into<Decimal>) -> Result<Self, ParameterError> {
        self.with_all([(parameter, value.into())])
    }

    /// The same system with other values of some parameters.
    ///
    /// # Errors
    /// If there is no such parameter, or a value is not finite.
    pub fn with_all<'a>(
        self,
        changes: impl IntoIterator<Item = (&'a str, Decimal)>,
    ) -> Result<Self, ParameterError> {
        let mut values = self.values;
        for (name, value) in changes {
            let Some(i) = self.definition.parameters().iter().position(|p| p.name == name) else {
                let names: Vec<&str> =
                    self.definition.parameters().iter().map(|p| p.name.as_str()).collect();
                let help = match nearest(name, &names) {
                    Some(near) => format!("did you mean `{near}`?"),
                    None if names.is_empty() => "it has none at all".into(),
                    None => format!("it has {}", names.join(", ")),
                };
                return Err(ParameterError::Unknown { name: name.into(), help });
            };
            checked(&self.definition.parameters()[i], &value)?;
            values[i] = value;
        }
        Ok(Self::made(self.definition, values))
    }

    /// Whether every parameter has a value that the definition allows: those given in Rust are not
    /// looked at before.
    ///
    /// # Errors
    /// The first that is not finite, or out of its bounds.
    pub fn check(&self) -> Result<(), ParameterError> {
        self.definition
            .parameters()
            .iter()
            .zip(&self.values)
            .try_for_each(|(p, value)| checked(p, value))
    }

    /// The same system with these values, in the definition's order, whatever they are.
    pub(super) fn with_raw_values(self, values: Vec<Decimal>) -> Self {
        Self::made(self.definition, values)
    }

    /// The definition of the system, without its parameters' values.
    pub fn definition(&self) -> &Definition {
        &self.definition
    }

    /// The system's name; empty if it has none.
    pub fn name(&self) -> &str {
        self.definition.name()
    }

    /// Number of states.
    pub fn dimension(&self) -> usize {
        self.definition.dimension()
    }

    /// The states' names.
    pub fn coordinates(&self) -> Vec<&str> {
        self.definition.states().iter().map(|s| s.name.as_str()).collect()
    }

    /// A parameter's value.
    pub fn parameter(&self, name: &str) -> Option<f64> {
        self.parameters().find(|(n, _)| *n == name).map(|(_, v)| v.value())
    }

    /// The parameters' names and values.
    pub fn parameters(&self) -> impl Iterator<Item = (&str, &Decimal)> {
        self.definition.parameters().iter().map(|p| p.name.as_str()).zip(&self.values)
    }

    /// The equations as operations: h, then f+, then f-; of a system with two surfaces then the
    /// same three of the second.
    pub fn tape(&self) -> &Tape {
        &self.functions.tape
    }

    /// The data that determine the system's numbers, and nothing else: they are hashed.
    pub fn canonical(&self) -> Canonical {
        self.definition.canonical(&self.values)
    }

    /// The same system with time running backwards.
    pub fn reversed(&self) -> Self {
        Self::made(Arc::new(self.definition.reversed()), self.values.clone())
    }

    /// The system as a [`PiecewiseSmooth`] one in `N` dimensions.
    ///
    /// # Errors
    /// If the system has not `N` states, or two switching surfaces.
    pub fn bind<const N: usize>(&self) -> Result<Bound<N>, BindError> {
        if self.definition.second().is_some() {
            Err(BindError::TwoSurfaces)
        } else if self.dimension() == N {
            Ok(Bound { functions: self.functions.clone() })
        } else {
            Err(BindError::Dimension { states: self.dimension(), asked: N })
        }
    }

    /// A system with two switching surfaces near one of them: for the first and the second surface,
    /// where the other's function is positive and where it is negative. None for a system with one
    /// surface.
    pub fn faces(&self) -> Option<[[System; 2]; 2]> {
        let face = |surface, below| {
            Some(Self::made(Arc::new(self.definition.face(surface, below)?), self.values.clone()))
        };
        Some([[face(0, false)?, face(0, true)?], [face(1, false)?, face(1, true)?]])
    }

    /// The paper's equation in Rust, if the system has the same operations: a fast path, tested to
    /// give the same bits.
    pub fn compiled(&self) -> Option<Caricature> {
        let builtin = library::definitions().iter().find(|d| d.same_equations(&self.definition))?;
        let first_component_of_minus = match builtin.name() {
            "caricature" => MinusSign::Equation4,
            "caricature-as-printed" => MinusSign::PrintedInEquation5,
            _ => return None,
        };
        Some(Caricature {
            alpha: self.parameter("alpha")?,
            beta: self.parameter("beta")?,
            v_plus: self.parameter("v_plus")?,
            v_minus: self.parameter("v_minus")?,
            first_component_of_minus,
        })
    }
}

/// Whether a parameter may have this value.
fn checked(parameter: &ParameterDefinition, value: &Decimal) -> Result<(), ParameterError> {
    let (name, number) = (parameter.name.clone(), value.value());
    if !number.is_finite() {
        return Err(ParameterError::NotFinite { name, value: number.to_string() });
    }
    let meaning = &parameter.about.meaning;
    let meaning = if meaning.is_empty() { String::new() } else { format!(" ({meaning})") };
    match parameter.bounds.refuse(number) {
        None => Ok(()),
        Some(rule) => {
            Err(ParameterError::OutOfBounds { name, value: number.to_string(), rule, meaning })
        }
    }
}

impl From<Caricature> for System {
    fn from(c: Caricature) -> Self {
        let name = match c.first_component_of_minus {
            MinusSign::Equation4 => "caricature",
            MinusSign::PrintedInEquation5 => "caricature-as-printed",
        };
        let values =
            [("alpha", c.alpha), ("beta", c.beta), ("v_plus", c.v_plus), ("v_minus", c.v_minus)];
        library::with_values(name, &values)
    }
}

impl fmt::Debug for System {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("System")
            .field("name", &self.name())
            .field("canonical", &self.canonical())
            .finish()
    }
}

impl PartialEq for System {
    /// Same name, equations and values, whatever texts and order they stand in: what is left of a
    /// system in JSON is equal to it.
    fn eq(&self, other: &Self) -> bool {
        if Arc::ptr_eq(&self.definition, &other.definition) {
            return self.values == other.values;
        }
        let values = |system: &Self, name: &str| {
            system.parameters().find(|(n, _)| *n == name).map(|(_, v)| v.clone())
        };
        self.name() == other.name()
            && self.definition.same_equations(&other.definition)
            && self.parameters().all(|(name, value)| values(other, name).as_ref() == Some(value))
    }
}

/// A system's canonical form with its name.
#[derive(Serialize)]
struct Named {
    #[serde(skip_serializing_if = "String::is_empty")]
    name: String,
    #[serde(flatten)]
    canonical: Canonical,
}

impl Serialize for System {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        Named { name: self.name().into(), canonical: self.canonical() }.serialize(serializer)
    }
}

impl<'de> Deserialize<'de> for System {
    /// Reads a canonical form, or a whole definition.
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let definition = Definition::deserialize(deserializer)?;
        let builtin =
            library::definition(definition.name()).filter(|b| b.same_equations(&definition));
        let Some(builtin) = builtin else { return Ok(Self::new(definition)) };
        let values = definition.parameters().iter().map(|p| (p.name.as_str(), p.value.clone()));
        Self::new(builtin.clone()).with_all(values).map_err(de::Error::custom)
    }
}

/// A [`System`] in `N` dimensions. A clone shares the equations.
#[derive(Clone)]
pub struct Bound<const N: usize> {
    functions: Arc<Functions>,
}

impl<const N: usize> fmt::Debug for Bound<N> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Bound").field("tape", &self.functions.tape).finish()
    }
}

/// A program's values as a vector.
#[inline]
pub(super) fn run<S: Elementary, const N: usize, const M: usize>(
    program: &Program,
    x: &SVector<S, N>,
) -> SVector<S, M> {
    let mut out = SVector::<S, M>::from_element(S::zero());
    program.evaluate(x.as_slice(), out.as_mut_slice());
    out
}

impl<const N: usize> PiecewiseSmooth<N> for Bound<N> {
    const INTERPRETED: bool = true;
    #[inline]
    fn switching<S: Elementary>(&self, x: &SVector<S, N>) -> S {
        run::<S, N, 1>(&self.functions.switching, x)[0]
    }
    #[inline]
    fn plus<S: Elementary>(&self, x: &SVector<S, N>) -> SVector<S, N> {
        run(&self.functions.plus, x)
    }
    #[inline]
    fn minus<S: Elementary>(&self, x: &SVector<S, N>) -> SVector<S, N> {
        run(&self.functions.minus, x)
    }
    fn degrees(&self) -> Option<[u32; 2]> {
        self.functions.degrees
    }
    fn names(&self) -> Vec<String> {
        (0..N).map(|i| self.functions.tape.name(i)).collect()
    }
}
