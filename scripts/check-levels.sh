#!/bin/sh
# Builds the program at every level of optimisation, with one pass over everything at the end (fat LTO), for this machine's own processor, and with overflow checks and assertions; checks figures with each.
#
#   scripts/check-levels.sh [LEVEL...]      (make check-levels; LEVEL: 0 1 2 3 s z fat native checked)
#
# RUN: what is run, "check fig1 fig2 fig3 fig4 fig5 fig6" if nothing is said. Each build is removed when it was checked. The results are added to target/levels/report.txt.
set -u
work=${WORK:-$PWD/target/levels}
run=${RUN:-check fig1 fig2 fig3 fig4 fig5 fig6}
[ $# -gt 0 ] || set -- checked native fat s z 0 1 2 3
mkdir -p "$work"
bad=0
for level in "$@"; do
    optimise=$level lto=off units=16 checks=false flags=
    case $level in
        0 | 1 | 2 | 3 | s | z) ;;
        fat) optimise=3 lto=fat units=1 ;;
        native) optimise=3 flags="-C target-cpu=native" ;;
        checked) optimise=1 checks=true ;;
        *) echo "$level: not one of 0, 1, 2, 3, s, z, fat, native, checked"; exit 2 ;;
    esac
    RUSTFLAGS="$flags" CARGO_PROFILE_RELEASE_OPT_LEVEL="$optimise" CARGO_PROFILE_RELEASE_LTO="$lto" CARGO_PROFILE_RELEASE_CODEGEN_UNITS="$units" \
        CARGO_PROFILE_RELEASE_DEBUG_ASSERTIONS="$checks" CARGO_PROFILE_RELEASE_OVERFLOW_CHECKS="$checks" \
        cargo build --release --locked --quiet --jobs "${JOBS:-2}" --bin twofold --target-dir "$work/build" > "$work/$level.build.log" 2>&1 ||
        { echo "level $level: NOT BUILT: see $work/$level.build.log"; bad=1; continue; }
    mv "$work/build/release/twofold" "$work/twofold-$level"
    rm -rf "$work/build"
    begun=$(date +%s)
    # shellcheck disable=SC2086
    "$work/twofold-$level" $run --quiet --threads 1 > "$work/$level.txt" 2> "$work/$level.said"
    found=$?
    took=$(($(date +%s) - begun))
    result="$(grep -c ': same ' "$work/$level.txt") pictures the same"
    [ "$found" -eq 0 ] || { bad=1; result="$result, exit code $found: $(grep -v ': same ' "$work/$level.txt" | head -n 3 | tr '\n' ' ')$(tail -n 1 "$work/$level.said")"; }
    echo "$(date -u +%F) | $(uname -m) | $(rustc --version | cut -d ' ' -f 1,2), level $optimise, lto $lto${flags:+, $flags}, checks $checks | 1 thread | $run | $result | $took s" | tee -a "$work/report.txt"
    rm -f "$work/twofold-$level"
done
exit "$bad"
