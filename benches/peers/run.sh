#!/bin/sh
# Builds the peers that this machine can build and runs our methods beside them, in turn: sh benches/peers/run.sh [ROUNDS]
# Needs g++, Boost's headers, SUNDIALS and python3 (Debian: g++ libboost-dev libsundials-dev python3-venv); SciPy, Numba and heyoka come from PyPI.
# What is missing is said in the table, not skipped silently.
set -eu
here=$(cd "$(dirname "$0")" && pwd)
build=${CARGO_TARGET_DIR:-$here/../../target}/peers
mkdir -p "$build"
build=$(cd "$build" && pwd)
cd "$here"

g++ -O3 -march=native -std=c++17 boost_dopri5.cpp -o "$build/boost_dopri5" || echo "Boost: could not be built" >&2
g++ -O3 -march=native -std=c++17 cvode_adams.cpp -o "$build/cvode_adams" \
    -lsundials_cvode -lsundials_nvecserial -lsundials_sunnonlinsolfixedpoint || echo "CVODE: could not be built" >&2
g++ -O3 -march=native -std=gnu++17 quad_taylor.cpp -o "$build/quad_taylor" -lquadmath || echo "__float128: could not be built" >&2
if [ ! -x "$build/python/bin/python" ]; then
    python3 -m venv "$build/python"
    "$build/python/bin/python" -m pip install --quiet -r requirements.txt || echo "SciPy, heyoka: could not be installed" >&2
fi
cargo build --release --locked --quiet --manifest-path crates/Cargo.toml --target-dir "$build/crates" &&
    cp "$build/crates/release/crates-units" "$build/crates-units" || echo "the Rust crate: could not be built" >&2
cargo build --release --locked --quiet --manifest-path ../Cargo.toml --target-dir "$build/.." --bin twofold-units
cp "$build/../release/twofold-units" "$build/units"
python3 run.py "$build" "${1:-3}"
