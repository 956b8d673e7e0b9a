//! Golden tests: the committed hashes, recomputed. The figures that take a second are checked here,
//! in whatever profile the tests run (they were blessed in release); `make check` recomputes all of
//! them.

use std::fs;
use std::path::Path;

use twofold::cli::in_pool;
use twofold::job::Executor;
use twofold::paper::figures;
use twofold::paper::pipeline::{compute, compute_with_tables, questions};
use twofold::paper::{Alterations, Figure};
use twofold::record::{Hash, Manifest};

fn manifest(figure: &Figure) -> Manifest {
    let path =
        figures::reference_file(&Path::new(env!("CARGO_MANIFEST_DIR")).join("figures"), &figure.id);
    let text = fs::read_to_string(&path)
        .unwrap_or_else(|e| panic!("{}: {e}; make one with bless", path.display()));
    Manifest::parse(&text, &figure.id).unwrap()
}

/// The figures that are cheap enough for every test run.
fn quick() -> impl Iterator<Item = Figure> {
    figures::all().into_iter().filter(|f| QUICK.contains(&&*f.id))
}

const QUICK: [&str; 7] = ["fig1", "fig2", "fig3", "fig4", "fig5", "fig6", "workprecision"];

#[test]
fn golden_quick_figures_have_the_committed_hashes() {
    let executor = Executor::quiet();
    for figure in quick() {
        let expected = manifest(&figure);
        assert_eq!(expected.pictures.len(), figure.pictures.len(), "{}", figure.id);
        for picture in &figure.pictures {
            let actual = compute(picture, &executor).unwrap().record.hashes;
            let difference = expected.picture(&picture.name).unwrap().first_difference(&actual);
            assert_eq!(difference, None, "{} differs", picture.name);
        }
    }
}

/// The long figures, shortened to t = 300: a digest of what is asked, found and drawn. A picture
/// that changes on purpose gets its new line here; the test prints it.
const SHORTENED: [(&str, &str); 6] = [
    ("fig7-printed-shortened", "a578dc8b09b0790e1699d8e36980c7382b32585d871f71dc45fe7ff106f11072"),
    (
        "fig7-reconstructed-shortened",
        "4bdb254454c5181db2e46106b794a5e66a6b7349d555e496ac9a2783628aa823",
    ),
    ("fig8-printed-shortened", "52f182f65953bfedf4350e9f42d341c789687888463faf0bfa5b1d94721c96e4"),
    (
        "fig8-reconstructed-shortened",
        "3726e980509cf145a323e2c67c1ae38bac0671518734254b6aec7b1e320d1ff0",
    ),
    ("fig9-printed-shortened", "a00c3455b94fdc1f0be4f1b51cb085ea41a54a9d5a27c38ded500acf6e90d5e3"),
    (
        "fig9-reconstructed-shortened",
        "8e10278280b9fd29d5a33e2063b556bb7650dc6d46ddc517af05b60798f07b41",
    ),
];

#[test]
fn golden_shortened_figures_have_the_committed_hashes() {
    let executor = Executor::quiet();
    let mut found = Vec::new();
    for figure in figures::all().iter().filter(|f| ["fig7", "fig8", "fig9"].contains(&&*f.id)) {
        for picture in &figure.pictures {
            let mut picture = picture.clone();
            picture.alter(&Alterations { t_end: Some(300.0), ..Alterations::default() });
            let hashes = compute(&picture, &executor).unwrap().record.hashes;
            let all = [
                &hashes.spec,
                &hashes.data,
                &hashes.verdict,
                &hashes.pixels,
                &hashes.svg,
                &hashes.pdf,
            ];
            let joined: Vec<&str> = all.iter().map(|h| h.as_str()).collect();
            found.push((hashes.name, Hash::of(joined.join(" ").as_bytes())));
        }
    }
    for (name, hash) in &found {
        println!("    (\"{name}\", \"{}\"),", hash.as_str());
    }
    let found: Vec<(&str, &str)> =
        found.iter().map(|(name, hash)| (name.as_str(), hash.as_str())).collect();
    assert_eq!(found, SHORTENED);
}

#[test]
fn golden_every_figure_has_a_reference_and_its_picture() {
    for figure in figures::all() {
        let expected = manifest(&figure);
        for picture in &figure.pictures {
            let entry = expected
                .picture(&picture.name)
                .unwrap_or_else(|| panic!("{} is not blessed", picture.name));
            let file = Path::new(env!("CARGO_MANIFEST_DIR"))
                .join("figures")
                .join(&*figure.id)
                .join(format!("{}.png", picture.name));
            assert_eq!(
                Hash::of(&fs::read(file).unwrap()),
                entry.png,
                "the committed {}.png is another one",
                picture.name
            );
        }
    }
}

/// A figure with its long runs shortened, so that every kind of panel is computed by these tests.
fn short(figure: &Figure) -> Figure {
    let mut figure = figure.clone();
    for picture in figure.pictures.iter_mut().filter(|p| p.panels.iter().any(|q| q.run.t_end > 1e3))
    {
        picture.alter(&Alterations { t_end: Some(40.0), ..Alterations::default() });
    }
    figure
}

/// Every answer that the shortened figures ask for, and of one figure all that is made of them:
/// drawing is done on one thread.
fn all_hashes(threads: usize) -> Vec<String> {
    in_pool(threads, || {
        let figures: Vec<Figure> = figures::all().iter().map(short).collect();
        let asked = questions(figures.iter().flat_map(|f| &f.pictures));
        let executor = Executor::quiet();
        executor.gather(&asked);
        let answers = asked.iter().map(|q| executor.ask(&**q).unwrap().hash().as_str().to_owned());
        let drawn = figures.iter().filter(|f| f.id == "fig8").flat_map(|f| &f.pictures).map(|p| {
            let mut tables = Vec::new();
            let computed = compute_with_tables(p, &executor, &mut |name, bytes| {
                tables.push((name.to_owned(), Hash::of(bytes)));
                Ok(())
            });
            format!("{:?} {tables:?}", computed.unwrap().record.hashes)
        });
        answers.chain(drawn).collect()
    })
    .unwrap()
}

#[test]
fn bytes_do_not_depend_on_the_number_of_threads() {
    let one = all_hashes(1);
    assert_eq!(one, all_hashes(3));
    assert!(one.len() >= 50, "{}", one.len());
}

#[test]
fn a_changed_question_changes_every_layer_it_should() {
    let figure = figures::all().into_iter().find(|f| f.id == "fig6").unwrap();
    let base = &short(&figure).pictures[0];
    let mut other = base.clone();
    other.panels[0].run.start[0] += 1e-6;
    let hashes = |p| compute(p, &Executor::quiet()).unwrap().record.hashes;
    let (a, b) = (hashes(base), hashes(&other));
    let difference = a.first_difference(&b).unwrap();
    assert_eq!(difference.layer, twofold::record::Layer::Spec);
    assert_eq!(difference.panels, ["i"]);
    assert!(
        a.data != b.data
            && a.pixels != b.pixels
            && a.png != b.png
            && a.svg != b.svg
            && a.pdf != b.pdf
    );
}

#[test]
fn specs_survive_json() {
    for picture in figures::all().iter().flat_map(|f| &f.pictures) {
        for panel in &picture.panels {
            let text = serde_json::to_string(&panel.run).unwrap();
            let back: twofold::job::spec::RunSpec = serde_json::from_str(&text).unwrap();
            assert_eq!(back, panel.run, "{} ({})", picture.name, panel.label);
            panel.run.validate().unwrap();
        }
    }
}
