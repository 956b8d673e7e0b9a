#!/bin/sh
# Kills the program without warning at many random moments of making figures, of a sweep and of the store's writes, then runs it again: no
# half file may ever be visible, no temporary file may stay, and the hashes must be those of an undisturbed run. Also what is too
# large for the tests: limits of memory that take seconds to reach. Prints counts; exit code 1 if anything was lost.
#
#   scripts/torture.sh [KILLS] [PROGRAM]      (make torture KILLS=100)
set -u
kills=${1:-100}
program=${2:-target/release/twofold}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
figures="fig1 fig3 fig4 fig5"
bad=0
complain() { echo "LOST: $1"; bad=$((bad + 1)); }

# What an undisturbed run makes.
"$program" figure $figures --fresh --quiet --out "$work/reference" || exit 2
begun=$(date +%s%N)
"$program" figure $figures --fresh --quiet --out "$work/timed" || exit 2
length=$((($(date +%s%N) - begun) / 1000000))

# A file is whole if it is, byte for byte, what the undisturbed run made.
whole() {
    for file in $(cd "$1" && find . -type f ! -name '.twofold-*'); do
        cmp -s "$1/$file" "$work/reference/$file" || complain "$file after kill $2"
    done
}

killed=0 finished=0 litter=0 random=$$
next() { random=$(((random * 1103515245 + 12345) % 2147483648)); }
k=0
while [ "$k" -lt "$kills" ]; do
    k=$((k + 1))
    next
    out=$work/out
    # Every second kill goes on with what the one before left; every third works with a store.
    [ $((k % 2)) -eq 0 ] || rm -rf "$out"
    [ $((k % 3)) -eq 0 ] && store="--store $work/store" || store=--fresh
    "$program" figure $figures $store --quiet --out "$out" &
    id=$!
    sleep "$(awk "BEGIN { print $((random / 65536 % (length + length / 10))) / 1000 }")"
    if kill -KILL "$id" 2>/dev/null; then killed=$((killed + 1)); else finished=$((finished + 1)); fi
    wait "$id" 2>/dev/null
    [ -d "$out" ] || continue
    litter=$((litter + $(find "$out" -name '.twofold-*' | wc -l)))
    whole "$out" "$k"
done
# Run again: everything is there, nothing else is.
"$program" figure $figures --store "$work/store" --quiet --out "$work/out" || complain "the run after the kills failed"
diff -r "$work/reference" "$work/out" > /dev/null || complain "the run after the kills differs"
left=$(find "$work/out" "$work/store" -name '.twofold-*' | wc -l)
# A store's folders are many; those that were not written to again are swept when they are.
[ "$(find "$work/out" -name '.twofold-*' | wc -l)" -eq 0 ] || complain "temporary files stay"
echo "kill -9 while making $figures ($length ms undisturbed): $killed killed, $finished had finished; $litter temporary files were left at the moment of a kill, $left after the next run"

# A sweep writes when it is done: before, its place stays as it is.
killed=0 k=0
echo old > "$work/sweep.csv"
while [ "$k" -lt $((kills / 10)) ]; do
    k=$((k + 1))
    next
    "$program" sweep --runs 200 --t-end 400 --quiet --out "$work/sweep.csv" &
    id=$!
    sleep "$(awk "BEGIN { print $((random / 65536 % 400)) / 1000 }")"
    kill -KILL "$id" 2>/dev/null && killed=$((killed + 1))
    wait "$id" 2>/dev/null
    case $(head -c 3 "$work/sweep.csv") in old | shi) ;; *) complain "the sweep's file after kill $k" ;; esac
done
echo "kill -9 of a sweep: $killed killed"

# SIGINT and SIGTERM: gone within a second.
k=0 worst=0
while [ "$k" -lt $((kills / 5)) ]; do
    k=$((k + 1))
    next
    rm -rf "$work/out"
    [ $((k % 2)) -eq 0 ] && name=INT code=130 || { name=TERM; code=143; }
    "$program" figure fig7 fig9 --fresh --quiet --out "$work/out" 2> "$work/said" &
    id=$!
    sleep "$(awk "BEGIN { print (100 + $((random / 65536 % 1000))) / 1000 }")"
    begun=$(date +%s%N)
    kill -$name "$id"
    wait "$id" 2>/dev/null
    found=$?
    took=$((($(date +%s%N) - begun) / 1000000))
    [ "$took" -le "$worst" ] || worst=$took
    [ "$found" -eq "$code" ] || complain "SIG$name ended with $found"
    [ "$(wc -l < "$work/said")" -eq 1 ] || complain "SIG$name said $(cat "$work/said")"
    [ "$(find "$work/out" -name '.twofold-*' 2> /dev/null | wc -l)" -eq 0 ] || complain "SIG$name left a temporary file"
done
echo "SIGINT and SIGTERM while computing: $k sent, gone after $worst ms at most"

# Limits that take seconds to reach. Each ends with code 3 and a line that says what to do.
for flags in "--chord 1e-300 --t-end 1000" "--switch filippov --exit all --funnel-times 100000" "--restart 2e-9 --t-end 1"; do
    rm -f "$work/none.csv"
    "$program" run $flags --quiet --out "$work/none.csv" 2> "$work/said"
    found=$?
    [ "$found" -eq 3 ] && [ "$(wc -l < "$work/said")" -eq 1 ] && [ ! -e "$work/none.csv" ] || complain "run $flags: $found"
    echo "run $flags: $found, $(cut -c 1-100 "$work/said") ..."
done

[ "$bad" -eq 0 ] && echo "nothing was lost" || { echo "$bad losses"; exit 1; }
