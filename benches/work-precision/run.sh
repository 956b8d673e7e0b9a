#!/bin/sh
# Builds the programs of this folder and runs all of them, one after the other, on one core: sh benches/work-precision/run.sh
# Needs g++, Boost's headers, SUNDIALS and python3 (Debian: g++ libboost-dev libsundials-dev python3-venv); SciPy, Numba, heyoka and what
# draws come from PyPI. What cannot be built is missing in the tables, and said.
set -eu
here=$(cd "$(dirname "$0")" && pwd)
build=${CARGO_TARGET_DIR:-$here/../../target}/work-precision
mkdir -p "$build"
build=$(cd "$build" && pwd)
cd "$here"

g++ -O3 -march=native -std=c++17 peers.cpp -o "$build/peers" -lsundials_cvode -lsundials_arkode -lsundials_nvecserial ||
    echo "Boost, SUNDIALS: could not be built" >&2
if [ ! -x "$build/python/bin/python" ]; then
    python3 -m venv "$build/python"
    "$build/python/bin/python" -m pip install --quiet -r requirements.txt
fi
cargo build --release --locked --quiet --manifest-path ../peers/crates/Cargo.toml --target-dir "$build/crates" --bin crates-work-precision &&
    cp "$build/crates/release/crates-work-precision" "$build/crates-work-precision" || echo "the Rust crate: could not be built" >&2
cargo build --release --locked --quiet --manifest-path ../Cargo.toml --target-dir "$build/.." --bin twofold-work-precision
cp "$build/../release/twofold-work-precision" "$build/ours"
"$build/python/bin/python" reference.py "$build/ours"
"$build/python/bin/python" run.py "$build"
