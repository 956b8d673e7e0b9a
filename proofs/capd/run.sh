#!/bin/sh
# The second opinion (proofs/README.md): compiles printed_cycle.cpp against CAPD and runs it.
#   CAPD=/path/to/CAPD sh proofs/capd/run.sh
# CAPD is a clone of https://github.com/CAPDGroup/CAPD; it is built into target/capd unless it has a folder build/ with the library.
# Needs a C++17 compiler, and cmake and make if CAPD is to be built (the library alone: ten minutes of one core).
set -eu
here=$(cd "$(dirname "$0")" && pwd)
out=$here/../../target/capd
if [ -z "${CAPD:-}" ] || [ ! -f "$CAPD/CAPDVersion.txt" ]; then
    echo "second opinion NOT RUN: no CAPD at '${CAPD:-}'." >&2
    echo "Clone it (git clone https://github.com/CAPDGroup/CAPD) and say: make second-opinion CAPD=/path/to/CAPD" >&2
    exit 1
fi
for tool in "${CXX:-c++}" sed; do
    command -v "$tool" >/dev/null || { echo "second opinion NOT RUN: $tool is needed" >&2; exit 1; }
done
mkdir -p "$out"
settings=$CAPD/build/bin/capd.pc
if [ ! -f "$settings" ] || [ ! -f "$CAPD/build/libcapd.a" ]; then
    settings=$out/bin/capd.pc
    if [ ! -f "$out/libcapd.a" ]; then
        for tool in cmake make; do
            command -v "$tool" >/dev/null || { echo "second opinion NOT RUN: $tool is needed to build CAPD" >&2; exit 1; }
        done
        echo "building CAPD in target/capd"
        cmake -S "$CAPD" -B "$out" -DCMAKE_BUILD_TYPE=Release >"$out/cmake.log"
        cmake --build "$out" --parallel "${JOBS:-2}" >"$out/build.log"
    fi
fi
flags() { sed -n "s/^$1: *//p" "$settings"; }
# shellcheck disable=SC2046 # the flags are several words
"${CXX:-c++}" "$here/printed_cycle.cpp" $(flags Cflags) $(flags Libs) -o "$out/printed_cycle"
echo "CAPD $(sed -n 's/^Version: *//p' "$settings"), $("${CXX:-c++}" --version | head -n 1)"
"$out/printed_cycle"
data=$here/../../papers/jeffrey-2013/reference
# Up to where the orbits begin to slide (an exp that overflows ends filib's programs).
"$out/printed_cycle" crossings "$data/crossings-printed.csv" 1e-3 4
"$out/printed_cycle" crossings "$data/crossings-reconstructed.csv" 0.1 2
