//! A general system with values for its parameters and data for its tables.

use std::collections::BTreeMap;
use std::sync::Arc;

use serde_json::{Value, json};
use twofold_system::Expression;
use twofold_system::diagnostic::nearest;
use twofold_system::document::Ordered;

use crate::data::{BadTable, Table};
use crate::definition::{Definition, Document};
use crate::value::evaluate;

/// A general system, ready to be followed once its tables have their data.
#[derive(Clone, Debug, PartialEq)]
pub struct Model {
    definition: Arc<Definition>,
    given: BTreeMap<String, f64>,
    tables: BTreeMap<String, Table>,
}

/// A wrong value of a parameter, or data that are missing.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ModelError {
    /// There is no such parameter.
    #[error("the system has no parameter `{0}`: {1}")]
    Unknown(String, String),
    /// A parameter out of its bounds, or no finite number.
    #[error("`{0}` is {1}: give a value {2}")]
    Value(String, f64, String),
    /// A table without data.
    #[error("the table `{0}` has no data")]
    NoData(String),
    /// A table that is wrong.
    #[error(transparent)]
    Table(#[from] BadTable),
}

impl Model {
    /// The system with the values that its definition gives.
    pub fn new(definition: Definition) -> Self {
        Self { definition: Arc::new(definition), given: BTreeMap::new(), tables: BTreeMap::new() }
    }

    /// The same system with another value of a parameter.
    ///
    /// # Errors
    /// If there is no such parameter.
    pub fn with(mut self, name: &str, value: f64) -> Result<Self, ModelError> {
        let known: Vec<&str> = self.definition.parameters.iter().map(|p| p.name.as_str()).collect();
        if !known.contains(&name) {
            let help = match nearest(name, &known) {
                Some(near) => format!("did you mean `{near}`?"),
                None if known.is_empty() => "it has none at all".into(),
                None => format!("it has {}", known.join(", ")),
            };
            return Err(ModelError::Unknown(name.into(), help));
        }
        self.given.insert(name.into(), value);
        Ok(self)
    }

    /// The same system with data for a table, the text of its CSV file.
    ///
    /// # Errors
    /// If there is no such table, or its data are wrong.
    pub fn with_table(mut self, name: &str, csv: &str) -> Result<Self, ModelError> {
        let entry = self.definition.tables.iter().find(|(n, _)| n == name);
        let Some((_, entry)) = entry else { return Err(ModelError::NoData(name.into())) };
        self.tables.insert(name.into(), Table::read(entry, csv)?);
        Ok(self)
    }

    /// Whether a parameter has a value that is not its definition's.
    pub(crate) fn is_given(&self, name: &str) -> bool {
        self.given.contains_key(name)
    }

    /// Another definition with the same data for its tables, or what is wrong with it.
    pub(crate) fn redefined(&self, document: Document) -> Result<Self, String> {
        let definition =
            Arc::new(Definition::from_document(document).map_err(|problem| problem.message)?);
        Ok(Self { definition, given: BTreeMap::new(), tables: self.tables.clone() })
    }

    /// The system's definition.
    pub fn definition(&self) -> &Definition {
        &self.definition
    }

    /// The names of the states.
    pub fn coordinates(&self) -> Vec<&str> {
        self.definition.states.iter().map(|s| s.name.as_str()).collect()
    }

    /// The tables' data, in the definition's order.
    ///
    /// # Errors
    /// If one has none.
    pub fn tables(&self) -> Result<Vec<(&str, &Table)>, ModelError> {
        let find = |(name, _): &'_ (String, _)| {
            let found = self.tables.get_key_value(name).map(|(n, t)| (n.as_str(), t));
            found.ok_or_else(|| ModelError::NoData(name.clone()))
        };
        self.definition.tables.iter().map(find).collect()
    }

    /// The parameters' values.
    ///
    /// # Errors
    /// If one is out of its bounds or no finite number.
    pub fn values(&self) -> Result<BTreeMap<String, f64>, ModelError> {
        let mut values: BTreeMap<String, f64> = BTreeMap::new();
        for p in &self.definition.parameters {
            let value = match self.given.get(&p.name) {
                Some(value) => *value,
                None => evaluate(&p.value, &|name| values.get(name).copied()),
            };
            let refuse = |rule: String| Err(ModelError::Value(p.name.clone(), value, rule));
            match p.bounds {
                _ if !value.is_finite() => return refuse("that is a finite number".into()),
                (Some(above), _) if value <= above => return refuse(format!("above {above}")),
                (_, Some(below)) if value >= below => return refuse(format!("below {below}")),
                _ => values.insert(p.name.clone(), value),
            };
        }
        Ok(values)
    }

    /// The state where runs begin, if the file gives one.
    ///
    /// # Errors
    /// As [`Model::values`].
    pub fn start(&self) -> Result<Option<Vec<f64>>, ModelError> {
        let values = self.values()?;
        let number = |e: &Expression| evaluate(e, &|name| values.get(name).copied());
        Ok(self.definition.start.as_ref().map(|start| start.iter().map(number).collect()))
    }

    /// Whether its equations have switching functions.
    pub fn has_switches(&self) -> bool {
        crate::definition::has_switches(&self.definition)
    }

    /// Whether its fields depend on the time, by themselves or through a table.
    pub fn depends_on_time(&self) -> bool {
        crate::Equation::new(self, None).is_ok_and(|equation| equation.depends_on_time())
    }

    /// Whether anything depends on the time, events of the clock included.
    pub fn is_driven(&self) -> bool {
        crate::Equation::new(self, None).is_ok_and(|equation| equation.is_driven())
    }

    /// The data that determine the system's numbers: the file's content with these values, the
    /// tables' points, and the order of names where it is not alphabetical, since motion begins in
    /// the first mode.
    pub fn json(&self) -> Value {
        let d = &self.definition.document;
        let mut document = serde_json::to_value(d).unwrap_or_default();
        for (name, value) in &self.given {
            document["parameters"][name] = json!(value);
        }
        for (name, table) in &self.tables {
            document["tables"][name]["data"] = json!(table);
        }
        let orders = [
            ("parameters", names(&d.parameters)),
            ("let", names(&d.terms)),
            ("modes", names(&d.modes)),
            ("tables", names(&d.tables)),
        ];
        for (list, names) in orders.iter().filter(|(_, names)| !names.is_sorted()) {
            document["order"][*list] = json!(names);
        }
        document
    }

    /// The system that [`Model::json`] has written.
    ///
    /// # Errors
    /// If it is none.
    pub fn from_json(mut document: Value) -> Result<Self, String> {
        let mut tables = BTreeMap::new();
        for (name, entry) in document["tables"].as_object_mut().into_iter().flatten() {
            let data = entry.as_object_mut().and_then(|entry| entry.remove("data"));
            tables.insert(
                name.clone(),
                serde_json::from_value(data.unwrap_or_default()).map_err(|e| e.to_string())?,
            );
        }
        let order = document.as_object_mut().and_then(|d| d.remove("order")).unwrap_or_default();
        let mut document: Document = serde_json::from_value(document).map_err(|e| e.to_string())?;
        put_in_order(&mut document.parameters, &order["parameters"]);
        put_in_order(&mut document.terms, &order["let"]);
        put_in_order(&mut document.modes, &order["modes"]);
        put_in_order(&mut document.tables, &order["tables"]);
        let definition = Definition::from_document(document).map_err(|problem| problem.message)?;
        Ok(Self { tables, ..Self::new(definition) })
    }
}

fn names<V>(entries: &Ordered<V>) -> Vec<&str> {
    entries.0.iter().map(|(name, _)| name.as_str()).collect()
}

/// The entries in the order of the list of their names, if there is one.
fn put_in_order<V>(entries: &mut Ordered<V>, names: &Value) {
    let place = |name: &str| names.as_array()?.iter().position(|n| n == name);
    entries.0.sort_by(|(a, _), (b, _)| place(a).cmp(&place(b)).then_with(|| a.cmp(b)));
}
