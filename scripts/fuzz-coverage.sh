#!/bin/sh
# Every reader of foreign bytes (fuzz/targets.rs) against inputs made by libFuzzer, which sees what an input runs through and compares with.
#
#   scripts/fuzz-coverage.sh [SECONDS [READER...]]      (make fuzz-coverage FUZZ_SECONDS=600 FUZZ="spec png")
#
# Needs a C++ compiler; not cargo-fuzz, and not a nightly compiler: no sanitizer is asked for, since nothing here is unsafe. Checks of debug builds are on. The same by
# cargo-fuzz: cargo fuzz run --sanitizer none spec. One reader at a time, one job each.
#
# ONLY=build: build and stop. ONLY=run: the programs that are there. ONLY=corpus: what the last call found, cut down to the MOST (40) that reach most, of at most KEEP (2048) bytes each, into fuzz/corpus.
# Inputs that were found go to target/fuzz-coverage/READER, what a reader did not survive stands beside it, and counts are added to target/fuzz-coverage/report.txt.
set -u
seconds=${1:-60}
[ $# -eq 0 ] || shift
[ $# -gt 0 ] || set -- spec system manifest csv png svg pdf store certificate
work=$PWD/target/fuzz-coverage
only=${ONLY:-}
mkdir -p "$work"

# What cargo-fuzz gives the compiler: counters on every edge, and calls at comparisons. Not to build scripts: hence the target.
flags="--cfg fuzzing -Cpasses=sancov-module -Cllvm-args=-sanitizer-coverage-level=4 -Cllvm-args=-sanitizer-coverage-inline-8bit-counters \
-Cllvm-args=-sanitizer-coverage-pc-table -Cllvm-args=-sanitizer-coverage-trace-compares -Cllvm-args=-simplifycfg-branch-fold-threshold=0"
triple=$(rustc -vV | sed -n 's/^host: //p')
if [ "$only" != run ] && [ "$only" != corpus ]; then
    # shellcheck disable=SC2046
    RUSTFLAGS=$flags cargo build --release --locked --quiet $(printf -- '--bin %s ' "$@") --manifest-path fuzz/Cargo.toml --target "$triple" --target-dir "$work/build" || exit 2
fi
[ "$only" != build ] || exit 0

# No input is longer: what a reader's sound inputs need, and room.
longest() {
    case $1 in
        spec | system | store) echo 16384 ;;
        csv) echo 32768 ;;
        *) echo 65536 ;;
    esac
}

# Processor seconds of everything that this shell waited for, into $used. (A subshell would count its own.)
count() {
    times > "$work/times"
    used=$(awk 'NR == 2 { split($0, t, /[ms ]+/); printf "%d", t[1] * 60 + t[2] + t[3] * 60 + t[4] }' "$work/times")
}

bad=0
for reader in "$@"; do
    program=$work/build/$triple/release/$reader
    found=$work/$reader
    mkdir -p "$found" "$work/seeds-$reader"
    cp "fuzz/corpus/$reader"/* "$work/seeds-$reader" 2> /dev/null
    case $reader in
        system) cp systems/*.toml "$work/seeds-$reader" ;;
        certificate) cp proofs/certificates/*.json "$work/seeds-$reader" ;;
        manifest) for figure in fig2 fig6; do cp "papers/jeffrey-2013/expected/$figure.json" "$work/seeds-$reader/$figure.json"; done ;;
    esac
    if [ "$only" = corpus ]; then
        # Edges alone, not how often each: a handful of inputs instead of thousands. Small ones are tried first.
        mkdir -p "$work/small-$reader" "$work/kept-$reader"
        find "$found" -type f -size "-$((${KEEP:-2048} + 1))c" -exec cp {} "$work/small-$reader" \;
        "$program" -set_cover_merge=1 -use_counters=0 -rss_limit_mb=2048 "$work/kept-$reader" "$work/seeds-$reader" "$work/small-$reader" > "$work/$reader.merged" 2>&1 || bad=1
        mkdir -p "fuzz/corpus/$reader"
        # They were written in the order in which they were chosen: what reaches most comes first. Names are digests.
        ls -tr "$work/kept-$reader" | head -n "${MOST:-40}" | while read -r name; do
            # Sound ones stand there, or somewhere else in the repository, by a name of their own.
            for seed in "$work/seeds-$reader"/*; do cmp -s "$work/kept-$reader/$name" "$seed" && continue 2; done
            cp "$work/kept-$reader/$name" "fuzz/corpus/$reader/found-$(echo "$name" | cut -c 1-12)"
        done
        echo "$reader: $(tail -n 1 "$work/$reader.merged")"
        continue
    fi
    # What of the time was computing: others may have the processor.
    count
    before=$used
    "$program" -max_total_time="$seconds" -max_len="$(longest "$reader")" -timeout=60 -rss_limit_mb=2048 -seed=1 -print_final_stats=1 \
        -artifact_prefix="$work/$reader-" "$found" "$work/seeds-$reader" > "$work/$reader.said" 2>&1
    result=$?
    count
    [ "$result" -eq 0 ] || bad=1
    stat() { sed -n "s/^stat::$1: *//p" "$work/$reader.said"; }
    edges=$(grep -o 'cov: [0-9]*' "$work/$reader.said" | tail -n 1)
    kept=$(grep -o 'corp: [0-9]*' "$work/$reader.said" | tail -n 1)
    echo "$(date -u +%F) | $reader | $seconds s, $((used - before)) of the processor | $(stat number_of_executed_units) inputs | ${edges#cov: } edges | ${kept#corp: } kept | $(stat peak_rss_mb) MB | slowest $(stat slowest_unit_time_sec) s | exit code $result" |
        tee -a "$work/report.txt"
    [ "$result" -eq 0 ] || grep -h -m 3 'panicked at\|ERROR: libFuzzer\|Test unit written' "$work/$reader.said"
done
exit "$bad"
