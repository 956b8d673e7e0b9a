//! Digests what numbers depend on, so that an answer stored by one version of the numerics is never
//! taken for another's.

use std::path::Path;

fn main() -> std::io::Result<()> {
    println!("cargo::rerun-if-changed=build.rs");
    println!("cargo::rustc-env=TWOFOLD_NUMERICS={}", numerics()?);
    Ok(())
}

fn numerics() -> std::io::Result<String> {
    let root = Path::new("../..");
    if !root.join("crates/num/src").is_dir() {
        // A published package: its version, and the exact versions that it asks for, name the
        // sources.
        return Ok(format!("version {}", env!("CARGO_PKG_VERSION")));
    }
    let mut sources = twofold_digest::Sources::default();
    for name in [
        "num",
        "system",
        "hybrid",
        "integrate",
        "analyse",
        "instances",
        "instances-switched",
        "instances-tangent",
        "job",
    ] {
        sources.add(root, &format!("crates/{name}/src"), |_| true)?;
    }
    sources.add(root, "systems", |file| file.ends_with(".toml") && file != "systems/Cargo.toml")?;
    sources.add_locked(&root.join("Cargo.lock"), "twofold-job")?;
    Ok(sources.digest())
}
