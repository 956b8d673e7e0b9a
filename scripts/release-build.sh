#!/bin/sh
# The program as it is released: every dependency as locked, and no path of this machine in it, so that the same compiler makes the same bytes in any folder (docs/reproducibility.md).
#
#   scripts/release-build.sh [ARGUMENT OF CARGO...]      (.github/workflows/release.yml, scripts/reprotest.sh)
#
# Crates are fetched into target/cargo-home, so that one prefix stands for all.
set -u
# On Windows the compiler knows this folder by another name than the shell.
here=$(pwd -W 2> /dev/null || pwd)
export CARGO_HOME="$here/target/cargo-home" RUSTFLAGS="--remap-path-prefix=$here=/twofold"
exec cargo build --release --locked --bin twofold "$@"
