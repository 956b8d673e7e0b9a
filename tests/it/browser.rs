//! The report in a real browser: runs scripts/browser_test.mjs.

use std::path::Path;
use std::process::Command;

// Run only on request (`make browser-test`): a test that finds no Node or no browser has not
// passed.
#[test]
#[ignore = "needs Node and a Chromium: make browser-test"]
fn the_report_works_in_a_browser() {
    let bins = Path::new(env!("CARGO_BIN_EXE_twofold")).parent().unwrap();
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/scripts/browser_test.mjs");
    let output = Command::new("node").arg(script).arg("--require").arg("--bins").arg(bins).output();
    let output = output.unwrap_or_else(|error| panic!("Node cannot be run: {error}"));
    let text = String::from_utf8_lossy(&output.stdout).into_owned()
        + &String::from_utf8_lossy(&output.stderr);
    eprintln!("{text}");
    assert!(output.status.success(), "{text}");
}
