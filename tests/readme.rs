//! README says what the references say.

use std::fs;
use std::path::Path;

use twofold::paper::{figures, readme};
use twofold::record::Manifest;

fn text(path: &str) -> String {
    fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join(path)).unwrap()
}

#[test]
fn golden_table_of_verdicts_is_that_of_the_references() {
    let manifests: Vec<Manifest> =
        figures::all().iter().map(|f| Manifest::parse(figures::reference(f.id).unwrap(), f.id).unwrap()).collect();
    let written = text("README.md");
    let table = readme::table(&manifests);
    assert_eq!(table.lines().filter(|l| l.contains("| agrees |") || l.contains("| differs |")).count(), 11, "{table}");
    let made = readme::with_table(&written, &table).expect("README has a place for the table of verdicts");
    assert!(
        made == written,
        "README's table of verdicts is not that of figures/*/expected.json; run `twofold bless`:\n{table}"
    );
}

#[test]
fn golden_embedded_references_are_the_files() {
    for figure in figures::all() {
        assert_eq!(figures::reference(figure.id), Some(text(&format!("figures/{}/expected.json", figure.id)).as_str()));
    }
}
