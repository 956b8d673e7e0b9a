//! `twofold inspect` and `twofold check --against DIR`: what the files alone show.

use crate::common;

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Output;

use assert_cmd::Command;
use common::{copy, figures, small_figure, write_references};
use serde_json::Value;
use twofold::cli;
use twofold::job::Executor;
use twofold::render::{decode_png, encode_png};

fn twofold(arguments: &[&str]) -> Output {
    Command::cargo_bin("twofold").unwrap().args(arguments).output().unwrap()
}

fn inspect(file: &Path, expected: &Path) -> (i32, Value) {
    let arguments =
        ["inspect", "--json", "--expected", expected.to_str().unwrap(), file.to_str().unwrap()];
    let output = twofold(&arguments);
    let text = String::from_utf8(output.stdout).unwrap();
    let code = output.status.code().unwrap();
    (
        code,
        serde_json::from_str(&text)
            .unwrap_or_else(|_| Value::String(String::from_utf8(output.stderr).unwrap())),
    )
}

fn picture(name: &str) -> PathBuf {
    figures().join("fig7").join(name)
}

#[test]
fn our_files_are_ours() {
    let folder = tempfile::tempdir().unwrap();
    let record: Value =
        serde_json::from_slice(&fs::read(picture("fig7-printed.json")).unwrap()).unwrap();
    for (ending, format) in [("png", "PNG"), ("svg", "SVG"), ("pdf", "PDF")] {
        let (code, said) = inspect(&picture(&format!("fig7-printed.{ending}")), folder.path());
        assert_eq!((code, &said["ours_and_unchanged"]), (0, &true.into()), "{said}");
        assert_eq!(
            (said["format"].as_str(), said["seal"].as_str()),
            (Some(format), Some("intact"))
        );
        assert_eq!(said["committed"]["state"], "no-manifests");
        assert_eq!(said["sha256"], record["hashes"][ending]);
        let provenance = said["provenance"].as_array().unwrap();
        let value = |key: &str| &provenance.iter().find(|p| p[0] == key).unwrap()[1];
        assert_eq!(value("Spec-SHA256"), &record["hashes"]["spec"]);
        assert_eq!(value("Data-SHA256"), &record["hashes"]["data"]);
        assert_eq!(value("Reading"), "printed");
        assert_eq!(value("Method"), "lsoda");
    }
}

#[test]
fn a_changed_byte_is_noticed_wherever_it_is() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("picture");
    for ending in ["png", "svg", "pdf"] {
        let bytes = fs::read(picture(&format!("fig7-printed.{ending}"))).unwrap();
        for at in [bytes.len() / 3, bytes.len() / 2, bytes.len() - 2] {
            let mut changed = bytes.clone();
            changed[at] ^= 1;
            fs::write(&file, changed).unwrap();
            let (code, said) = inspect(&file, folder.path());
            assert_eq!(code, 1, "{ending} at {at}: {said}");
            assert_ne!(said["seal"], "intact");
        }
    }
}

#[test]
fn the_manifests_know_the_committed_file_from_others() {
    let folder = tempfile::tempdir().unwrap();
    let expected = folder.path().join("expected");
    write_references(figures(), &expected);
    for ending in ["png", "svg", "pdf"] {
        let (code, said) = inspect(&picture(&format!("fig7-reconstructed.{ending}")), &expected);
        assert_eq!((code, &said["committed"]["state"]), (0, &"same".into()), "{said}");
        assert_eq!(said["committed"]["picture"], "fig7-reconstructed");
    }
    // The same name and an unbroken seal, other numbers: made by another program, or forged.
    let other = folder.path().join("other");
    cli::make(&[small_figure(40.0)], &other, &Executor::quiet()).unwrap();
    let (code, said) = inspect(&other.join("fig7/fig7-printed.png"), &expected);
    assert_eq!((code, said["seal"].as_str()), (1, Some("intact")), "{said}");
    assert_eq!(said["committed"]["state"], "different");
    // The same pixels in a file without provenance.
    let bare = folder.path().join("bare.png");
    let pixels = decode_png(&fs::read(picture("fig7-printed.png")).unwrap()).unwrap();
    fs::write(&bare, encode_png(&pixels).unwrap()).unwrap();
    let (code, said) = inspect(&bare, &expected);
    assert_eq!((code, said["seal"].as_str()), (1, Some("absent")), "{said}");
    assert_eq!(said["committed"]["state"], "same-pixels");
    // A name that no manifest lists.
    let mut altered = small_figure(50.0);
    altered.pictures.truncate(1);
    altered.pictures[0].name = "fig7-printed-shortened".into();
    cli::make(&[altered], &other, &Executor::quiet()).unwrap();
    let (code, said) = inspect(&other.join("fig7/fig7-printed-shortened.png"), &expected);
    assert_eq!((code, &said["committed"]["state"]), (0, &"unlisted".into()), "{said}");
}

#[test]
fn other_files_are_not_ours_or_not_pictures() {
    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str, bytes: &[u8]| {
        let path = folder.path().join(name);
        fs::write(&path, bytes).unwrap();
        path
    };
    let (code, said) =
        inspect(&file("a.svg", b"<svg xmlns=\"http://www.w3.org/2000/svg\"/>"), folder.path());
    assert_eq!((code, said["seal"].as_str()), (1, Some("absent")), "{said}");
    for path in [file("a.txt", b"hello"), file("empty.png", b""), folder.path().join("nowhere.png")]
    {
        let (code, said) = inspect(&path, folder.path());
        assert_eq!(code, 2, "{said}");
        assert!(
            said.as_str().unwrap().contains(path.file_name().unwrap().to_str().unwrap()),
            "{said}"
        );
    }
}

#[test]
fn text_for_people_says_the_same_and_steers_no_terminal() {
    let folder = tempfile::tempdir().unwrap();
    let svg = fs::read_to_string(picture("fig7-printed.svg")).unwrap();
    let file = folder.path().join("a.svg");
    fs::write(
        &file,
        svg.replace("<entry key=\"Method\">lsoda", "<entry key=\"Method\">\u{1b}[2Jlsoda"),
    )
    .unwrap();
    let output = twofold(&[
        "inspect",
        file.to_str().unwrap(),
        "--expected",
        folder.path().to_str().unwrap(),
    ]);
    let text = String::from_utf8(output.stdout).unwrap();
    assert_eq!(output.status.code(), Some(1));
    assert!(
        text.contains("Made by twofold, and changed since.") && text.contains("[2Jlsoda"),
        "{text}"
    );
    assert!(!text.contains('\u{1b}'));
}

/// Published pictures of fig. 6, the quickest figure: `change` of each of its readings' pictures.
#[test]
fn published_pictures_are_checked_criterion_by_criterion() {
    let folder = tempfile::tempdir().unwrap();
    let made = folder.path().join("made");
    let output = Command::cargo_bin("twofold")
        .unwrap()
        .args(["figure", "fig6", "--fresh", "--quiet", "--out", made.to_str().unwrap()])
        .output()
        .unwrap();
    assert!(output.status.success());
    let published = folder.path().join("published");
    let name = "fig6-printed.png";
    let original = fs::read(made.join("fig6").join(name)).unwrap();
    let put = |criterion: &str, bytes: &[u8]| {
        fs::create_dir_all(published.join(criterion)).unwrap();
        fs::write(published.join(criterion).join(name), bytes).unwrap();
    };
    let altered = |change: &dyn Fn(usize, usize, &mut [u8])| {
        let mut pixels = decode_png(&original).unwrap();
        let width = pixels.width as usize;
        for (i, p) in pixels.rgba.chunks_exact_mut(4).enumerate() {
            change(i % width, i / width, p);
        }
        encode_png(&pixels).unwrap()
    };
    put("a-file", &original);
    put("b-pixels", &altered(&|_, _, _| {}));
    put(
        "c-few",
        &altered(&|x, y, p| {
            if x == 7 * y {
                p[0] ^= 8
            }
        }),
    );
    put("d-many", &altered(&|x, y, p| p[1] ^= u8::from((x + y) % 2 == 0)));
    // A dot of five by five pixels: nothing in any mean, and a wrong picture.
    let dot = altered(&|x, y, p| {
        if (30..35).contains(&x) && (900..905).contains(&y) {
            p[..3].fill(0)
        }
    });
    put("f-dot", &dot);
    let mut small = decode_png(&original).unwrap();
    small.height -= 1;
    small.rgba.truncate(4 * (small.width * small.height) as usize);
    put("g-size", &encode_png(&small).unwrap());
    put("h-none", b"no picture");
    fs::write(published.join("holiday.png"), &original).unwrap();

    let output = twofold(&["check", "fig6", "--quiet", "--against", published.to_str().unwrap()]);
    let text = String::from_utf8(output.stdout).unwrap();
    assert_eq!(output.status.code(), Some(1), "{text}");
    let line = |start: &str| {
        text.lines()
            .find(|l| l.starts_with(start))
            .unwrap_or_else(|| panic!("no {start} in {text}"))
    };
    for (file, words) in [
        ("a-file", "holds exactly (file"),
        ("b-pixels", "holds exactly in its pixels"),
        ("c-few", "holds within tolerance (changed pixels"),
        ("d-many", "holds within tolerance (RMS"),
        ("f-dot", "DIFFERS: no criterion is met; 25 pixels changed"),
        ("g-size", "DIFFERS: ours and theirs cannot be compared"),
        ("h-none", "DIFFERS: cannot be read"),
        ("holiday.png", "skipped"),
        ("fig6-reconstructed", "not in the folder"),
    ] {
        assert!(line(file).contains(words), "{}", line(file));
    }
    assert!(text.contains("3 of 7 meet no criterion"), "{text}");

    // Only what holds: exit code 0. Nothing of ours: a mistake of usage.
    for bad in ["f-dot", "g-size", "h-none"] {
        fs::remove_dir_all(published.join(bad)).unwrap();
    }
    let output = twofold(&["check", "fig6", "--quiet", "--against", published.to_str().unwrap()]);
    assert_eq!(output.status.code(), Some(0));
    let other = folder.path().join("other");
    copy(&made.join("fig6"), &other);
    let output = twofold(&["check", "fig7", "--quiet", "--against", other.to_str().unwrap()]);
    assert_eq!(output.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&output.stderr).contains("fig7-printed.png"));
}

/// A committed picture under another committed picture's name is not what its name says.
#[test]
fn a_picture_under_the_wrong_name_is_named() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("figures");
    let folder = tempfile::tempdir().unwrap();
    for (name, code, state) in
        [("fig3.png", 0, "same"), ("mine.png", 0, "same"), ("fig1.png", 1, "misnamed")]
    {
        let file = folder.path().join(name);
        fs::copy(root.join("fig3/fig3.png"), &file).unwrap();
        let (found, said) = inspect(&file, &root);
        assert_eq!(
            (found, said["committed"]["state"].as_str()),
            (code, Some(state)),
            "{name}: {said}"
        );
    }
}
