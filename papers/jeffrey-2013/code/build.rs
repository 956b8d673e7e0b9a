//! Digests the figures' code and data, on which the answers depend that a figure computes by itself
//! (computed.rs).

use std::path::Path;

fn main() -> std::io::Result<()> {
    println!("cargo::rerun-if-changed=build.rs");
    println!("cargo::rustc-env=TWOFOLD_FIGURES={}", figures()?);
    Ok(())
}

fn figures() -> std::io::Result<String> {
    let root = Path::new("../../..");
    if !root.join("papers/jeffrey-2013").is_dir() {
        // A published package: its version names the sources.
        return Ok(format!("version {}", env!("CARGO_PKG_VERSION")));
    }
    let mut sources = twofold_digest::Sources::default();
    // Pages and comparisons are made of answers; hashes are what answers are compared with.
    const CODE: &str = "papers/jeffrey-2013/code";
    let report = format!("{CODE}/report/");
    let above = [&report, "crates/paper/src/compare/", "crates/paper/src/html.rs"];
    let above = |file: &str| above.iter().any(|a| file.starts_with(a));
    sources.add(root, "crates/paper/src", |file| !above(file))?;
    let inputs = [".rs", ".csv", ".toml"];
    sources.add(root, CODE, |file| {
        let is = |ends: &[&str]| ends.iter().any(|e| file.ends_with(e));
        is(&inputs) && !is(&["/build.rs"]) && !above(file)
    })?;
    // Rules and readings of the paper; what its figures ask is in their questions.
    sources.add(root, "papers/jeffrey-2013", |file| {
        ["paper.toml", "sentences.toml"].iter().any(|own| file.ends_with(own))
    })?;
    Ok(sources.digest())
}
