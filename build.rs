//! Description of a build for `--version`: commit, compiler, target. Nothing here needs git or a
//! clock; the same sources built by the same compiler get the same words.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    let variable = |name: &str| std::env::var(name).unwrap_or_else(|_| "unknown".into());
    let rustc =
        said(Command::new(variable("RUSTC")).arg("--version")).unwrap_or_else(|| "unknown".into());
    // Cargo's `strip` passes over packages with an optimisation of their own, as this one.
    if variable("PROFILE") == "release" && variable("CARGO_CFG_TARGET_OS") == "linux" {
        println!("cargo::rustc-link-arg-bins=-Wl,--strip-all");
    }
    // Only releases carry their commit: a debug build would be made anew after every one.
    let commit = if variable("PROFILE") == "release" {
        commit()
    } else {
        "not recorded in debug builds".into()
    };
    for (name, value) in [
        ("TWOFOLD_COMMIT", commit),
        ("TWOFOLD_RUSTC", rustc),
        ("TWOFOLD_TARGET", variable("TARGET")),
        ("TWOFOLD_PROFILE", variable("PROFILE")),
    ] {
        println!("cargo::rustc-env={name}={value}");
    }
}

/// The commit that stands in the working tree of this package, or that the package was made from.
fn commit() -> String {
    let here = PathBuf::from(std::env::var_os("CARGO_MANIFEST_DIR").unwrap_or_default());
    // Cargo writes this into every package that it makes.
    if let Ok(packaged) = fs::read_to_string(here.join(".cargo_vcs_info.json")) {
        let hash = packaged.split("\"sha1\": \"").nth(1).and_then(|rest| rest.split('"').next());
        return hash.unwrap_or("unknown").to_owned();
    }
    let git = |arguments: &[&str]| said(Command::new("git").arg("-C").arg(&here).args(arguments));
    // Sources inside some other repository are not of its commit.
    let ours = git(&["rev-parse", "--show-toplevel"]).is_some_and(|top| {
        matches!((Path::new(&top).canonicalize(), here.canonicalize()), (Ok(a),
            Ok(b)) if a == b)
    });
    let Some(hash) = git(&["rev-parse", "HEAD"]).filter(|_| ours) else {
        return "unknown (not built from a git checkout)".into();
    };
    // Every commit and checkout is logged; a change of the sources is one of these.
    for path in ["logs/HEAD", "HEAD"] {
        let watched = git(&["rev-parse", "--git-path", path]).map(|p| here.join(p));
        if let Some(file) = watched.filter(|p| p.exists()) {
            println!("cargo::rerun-if-changed={}", file.display());
        }
    }
    let watched = ["src", "crates", "figures", "papers", "systems", "Cargo.toml", "Cargo.lock"];
    for path in watched {
        println!("cargo::rerun-if-changed={path}");
    }
    let changed = git(&[&["status", "--porcelain", "--"], &watched[..]].concat())
        .is_none_or(|list| !list.is_empty());
    if changed { format!("{hash}, with changes") } else { hash }
}

/// Standard output of a command, if it can be run and succeeds.
fn said(command: &mut Command) -> Option<String> {
    let output = command.output().ok().filter(|o| o.status.success())?;
    Some(String::from_utf8_lossy(&output.stdout).trim().to_owned())
}
