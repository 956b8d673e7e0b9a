#!/bin/sh
# Builds the peers that this machine can build and runs our methods beside them, in turn: sh benches/peers/run.sh [REPEATS]
# Needs g++ and Boost's headers (Debian: g++ libboost-dev). What is missing is said, not skipped silently.
set -eu
repeats=${1:-3}
here=$(cd "$(dirname "$0")" && pwd)
build=$here/../../target/peers
mkdir -p "$build"
cd "$here/../.."

if echo '#include <boost/numeric/odeint.hpp>' | g++ -std=c++17 -fsyntax-only -x c++ - 2>/dev/null; then
    g++ -O3 -march=native -std=c++17 "$here/boost_dopri5.cpp" -o "$build/boost_dopri5"
else
    echo "Boost NOT RUN: g++ or boost/numeric/odeint.hpp not found" >&2
    exit 1
fi
cargo build --release --locked --benches --quiet
ours() { cargo bench --locked --quiet --bench units -- "$@"; }

echo "program unit set seconds steps crossings, and the ratio to Boost's time"
for unit in "W1 A" "W1 B" "W2 B"; do
    set -- $unit
    methods="dopri5 lsoda radau5"
    [ "$1" = W2 ] && methods="dopri5 dopri5-lanes-portable dopri5-lanes"
    peer=$("$build/boost_dopri5" "$1" "$2" "$repeats")
    echo "$peer" | awk '{ print $1, $2, $3, $4, $5, $6, "1" }'
    seconds=$(echo "$peer" | awk '{ print $4 }')
    for method in $methods; do
        ours "$1" "$2" "$method" "$repeats" | awk -v s="$seconds" '{ printf "%s %s %s %s %s %s %.2f\n", $1, $2, $3, $4, $5, $6, $4 / s }'
    done
done
