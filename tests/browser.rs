//! The report in a real browser: runs scripts/browser_test.mjs, which skips itself where there is no browser.

use std::path::Path;
use std::process::Command;

#[test]
fn the_report_works_in_a_browser() {
    let bins = Path::new(env!("CARGO_BIN_EXE_twofold")).parent().unwrap();
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/scripts/browser_test.mjs");
    let output = match Command::new("node").arg(script).arg("--bins").arg(bins).output() {
        Ok(output) => output,
        Err(error) => {
            eprintln!("browser test SKIPPED: Node cannot be run ({error})");
            return;
        }
    };
    let text = String::from_utf8_lossy(&output.stdout).into_owned() + &String::from_utf8_lossy(&output.stderr);
    eprintln!("{text}");
    assert!(output.status.success(), "{text}");
}
