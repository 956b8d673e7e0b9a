//! Known results, each by formula or by an independent program, by subject.

mod domains;
mod events;
mod impacts;
mod reading;
mod rests;
mod several;
mod sliding;
mod steps;
mod tangents;

use crate::motion::{Method, Outcome};
use crate::{Definition, Ending, HybridError, Model, Options, follow};

fn model(text: &str) -> Model {
    Model::new(Definition::from_toml(text, "test.toml").unwrap_or_else(|e| panic!("{e}")))
}

/// The events of a run with their times, and how it ends.
fn run(model: &Model, t_end: f64) -> (Vec<(f64, String)>, Result<Outcome, HybridError>) {
    let mut events = Vec::new();
    let options = Options { t_end, ..Options::default() };
    let outcome = follow(model, &options, &mut |point| {
        events.extend(point.event.map(|e| (point.t, e.to_owned())));
        true
    });
    (events, outcome)
}

fn end(text: &str, t_end: f64) -> Vec<f64> {
    let (_, outcome) = run(&model(text), t_end);
    let outcome = outcome.unwrap_or_else(|e| panic!("{e}\n{text}"));
    assert_eq!(outcome.ending, Ending::Finished, "{text}");
    outcome.x
}

fn near(found: f64, want: f64, within: f64) {
    assert!((found - want).abs() <= within, "{found} is not {want} to {within:e}");
}

fn shipped(name: &str) -> Model {
    let text = twofold_system::library::general(name).unwrap();
    let mut model = model(text);
    for (table, entry) in model.definition().tables().to_vec() {
        model =
            model.with_table(&table, twofold_system::library::table(&entry.file).unwrap()).unwrap();
    }
    model
}

/// One state that counts along with others: what is written to it at the end.
fn last(text: &str, t_end: f64) -> f64 {
    *end(text, t_end).last().unwrap()
}

fn taylor(t_end: f64, rtol: f64) -> Options {
    Options { t_end, rtol, method: Method::Taylor, max_steps: 20_000, ..Options::default() }
}

fn by_each_method(text: &str, t_end: f64) -> [Outcome; 4] {
    Method::ALL.map(|method| {
        // LSODA makes errors of the size of the tolerance in each of its many steps.
        let rtol = if method == Method::Lsoda { 1e-11 } else { 1e-10 };
        let options = Options { t_end, method, rtol, max_steps: 300_000, ..Options::default() };
        follow(&model(text), &options, &mut |_| true)
            .unwrap_or_else(|e| panic!("{method:?}: {e}\n{text}"))
    })
}

/// The end of a run by a method, or its error's words.
fn end_of(text: &str, t_end: f64, method: Method) -> Result<Vec<f64>, String> {
    let options = Options { t_end, method, ..Options::default() };
    follow(&model(text), &options, &mut |_| true).map(|o| o.x).map_err(|e| e.to_string())
}
