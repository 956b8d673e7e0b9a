#!/bin/sh
# Kills the program without warning at many random moments of making figures, of a sweep and of the store's writes, then runs it again: no
# half file may ever be visible, no temporary file may stay, and the hashes must be those of an undisturbed run. Then everything else that can go wrong
# around a program: disks that are full or become read-only, limits of file size, handles, memory and threads, several processes in one place, clocks
# that jump, signals. Prints counts; exit code 1 if anything was lost.
#
#   scripts/torture.sh [KILLS] [PROGRAM]      (make torture KILLS=100; ONLY=limits: nothing but runs of too many points)
set -u
kills=${1:-100}
program=${2:-target/release/twofold}
work=$(mktemp -d)
trap 'umount "$work/disk" 2> /dev/null; rm -rf "$work"' EXIT
figures="fig1 fig3 fig5"
bad=0
complain() { echo "LOST: $1"; bad=$((bad + 1)); }

# Limits that take seconds to reach. Each ends with code 3 and a line that says what to do.
limits() {
    for flags in "--chord 1e-300 --t-end 1000 --format json" "--switch filippov --exit all --funnel-times 100000" "--restart 2e-9 --t-end 1 --format json"; do
        rm -f "$work/none.csv"
        "$program" run $flags --quiet --out "$work/none.csv" 2> "$work/said"
        found=$?
        [ "$found" -eq 3 ] && [ "$(wc -l < "$work/said")" -eq 1 ] && [ ! -e "$work/none.csv" ] || complain "run $flags: $found"
        echo "run $flags: $found, $(cut -c 1-100 "$work/said") ..."
    done
}
verdict() { if [ "$bad" -eq 0 ]; then echo "nothing was lost"; else echo "$bad losses"; exit 1; fi; }
if [ "${ONLY:-}" = limits ]; then limits; verdict; exit; fi

# What an undisturbed run makes.
"$program" figure $figures --fresh --quiet --out "$work/reference" || exit 2
begun=$(date +%s%N)
"$program" figure $figures --fresh --quiet --out "$work/timed" || exit 2
length=$((($(date +%s%N) - begun) / 1000000))

# A file is whole if it is, byte for byte, what the undisturbed run made. (making.json holds times.)
whole() {
    for file in $(cd "$1" && find . -type f ! -name '.twofold-*' ! -name making.json); do
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
diff -r -x making.json "$work/reference" "$work/out" > /dev/null || complain "the run after the kills differs"
left=$(find "$work/out" "$work/store" -name '.twofold-*' | wc -l)
# A store's folders are many; those that were not written to again are swept when they are.
[ "$(find "$work/out" -name '.twofold-*' | wc -l)" -eq 0 ] || complain "temporary files stay"
echo "kill -9 while making $figures ($length ms undisturbed): $killed killed, $finished had finished; $litter temporary files were left at the moment of a kill, $left after the next run"

# A sweep keeps its finished rows in a journal, and goes on from there: killed until it is through, it makes the bytes of an undisturbed one.
sweep="sweep --runs 160 --t-end 400 --threads 2 --quiet"
"$program" $sweep --out "$work/whole.csv" || complain "the undisturbed sweep"
begun=$(date +%s%N)
"$program" $sweep --out "$work/whole.csv" || complain "the undisturbed sweep"
length=$((($(date +%s%N) - begun) / 1000000))
killed=0 rounds=0 resumed=0
while [ "$killed" -lt "$kills" ]; do
    rounds=$((rounds + 1))
    rm -f "$work/cut.csv" "$work/cut.csv.journal"
    # At most so many kills a round: each leaves more rows behind, and then it finishes.
    k=0
    while [ "$k" -lt 6 ]; do
        k=$((k + 1))
        next
        "$program" $sweep --resume --out "$work/cut.csv" &
        id=$!
        sleep "$(awk "BEGIN { print $((random / 65536 % (length / 2 + 20))) / 1000 }")"
        kill -KILL "$id" 2>/dev/null && killed=$((killed + 1))
        wait "$id" 2>/dev/null
        [ -e "$work/cut.csv" ] && break
    done
    [ -e "$work/cut.csv.journal" ] && resumed=$((resumed + $(wc -l < "$work/cut.csv.journal") - 1))
    "$program" $sweep --resume --out "$work/cut.csv" || complain "the sweep after the kills of round $rounds"
    cmp -s "$work/cut.csv" "$work/whole.csv" || complain "the sweep of round $rounds differs"
    [ ! -e "$work/cut.csv.journal" ] || complain "the journal of round $rounds stays"
done
echo "kill -9 of a sweep ($length ms undisturbed): $killed killed in $rounds sweeps, $resumed rows were taken from journals, every sweep came to the same bytes"

# The store's writers: several at a time on one store, killed.
k=0 killed=0
while [ "$k" -lt $((kills / 5)) ]; do
    k=$((k + 1))
    next
    ids=
    for i in 1 2 3; do
        "$program" figure fig1 fig5 --store "$work/shared" --quiet --out "$work/many$i" &
        ids="$ids $!"
    done
    sleep "$(awk "BEGIN { print $((random / 65536 % 800)) / 1000 }")"
    for id in $ids; do kill -KILL "$id" 2>/dev/null && killed=$((killed + 1)); done
    wait
    for i in 1 2 3; do [ ! -d "$work/many$i" ] || whole "$work/many$i" "$k of three"; done
    "$program" store --store "$work/shared" > "$work/said" 2>&1 || complain "the store after kill $k: $(cat "$work/said")"
    [ $((k % 4)) -eq 0 ] && rm -rf "$work/shared" "$work"/many?
done
echo "kill -9 of three processes on one store: $killed killed, the store could be read after each"

# Six processes in one folder and one store at a time, five times.
for k in 1 2 3 4 5; do
    rm -rf "$work/one" "$work/shared"
    ids=
    for i in 1 2 3 4 5 6; do
        "$program" figure fig1 fig5 --store "$work/shared" --quiet --out "$work/one" &
        ids="$ids $!"
    done
    for id in $ids; do wait "$id" || complain "one of six processes in one folder"; done
    whole "$work/one" "six at a time"
    [ "$(find "$work/one" "$work/shared" -name '.twofold-*' | wc -l)" -eq 0 ] || complain "six at a time leave temporary files"
done
echo "six processes in one folder with one store, five times: all the same"

# Too small a limit of anything ends with a message (or, of memory, with the allocator's abort), and nothing half is visible.
limited() { # what, highest, step, expected codes
    good=0 refused=0 n=$2
    while [ "$n" -gt 0 ]; do
        rm -rf "$work/small"
        ( ulimit $1 "$n" && exec "$program" figure fig1 --fresh --quiet --threads 2 --out "$work/small" ) > /dev/null 2> "$work/said"
        found=$?
        [ ! -d "$work/small" ] || whole "$work/small" "ulimit $1 $n"
        if [ "$found" -eq 0 ]; then
            good=$((good + 1))
            [ "$(find "$work/small/fig1" -type f | wc -l)" -eq "$(find "$work/reference/fig1" -type f | wc -l)" ] || complain "ulimit $1 $n: files are missing"
        else
            refused=$((refused + 1))
            case " $4 " in *" $found "*) ;; *) complain "ulimit $1 $n ended with $found: $(head -n 1 "$work/said")" ;; esac
            grep -q panicked "$work/said" && complain "ulimit $1 $n panicked"
            [ -z "$(find "$work/small" -name '.twofold-*' 2> /dev/null)" ] || [ "$found" -ge 128 ] || complain "ulimit $1 $n leaves a temporary file"
        fi
        n=$((n - $3))
    done
    echo "ulimit $1 from $2 down by $3: $refused refused, $good came through whole"
}
# Files of at most so many blocks of 512 bytes; open files; kilobytes of memory (127: not even started, 134: the allocator's abort).
limited -f 1200 30 "2"
limited -n 40 1 "2 3 127"
limited -v 400000 8000 "2 3 127 134 139"

# Threads: root has no such limit, so another user tries.
if command -v setpriv > /dev/null && [ "$(id -u)" -eq 0 ]; then
    mkdir -p "$work/free" && chmod 755 "$work" && chmod 777 "$work/free"
    cp "$program" "$work/twofold"
    refused=0 good=0
    for n in 1 2 3 4 5 6 8 12; do
        setpriv --reuid 54321 --regid 54321 --clear-groups sh -c "ulimit -u $n; exec $work/twofold figure fig1 --fresh --quiet --threads 8 --out $work/free/$n" 2> "$work/said"
        found=$?
        grep -q panicked "$work/said" && complain "ulimit -u $n panicked: $(head -n 1 "$work/said")"
        case $found in 0) good=$((good + 1)); whole "$work/free/$n" "ulimit -u $n" ;; 2 | 3) refused=$((refused + 1)) ;; *) complain "ulimit -u $n ended with $found: $(head -n 1 "$work/said")" ;; esac
    done
    echo "ulimit -u from 1 to 12 with --threads 8: $refused refused, $good came through whole"
else
    echo "threads: NOT RUN (needs root and setpriv)"
fi

# A disk that is full at every point of the work, and one that becomes read-only in the middle of it.
mkdir -p "$work/disk"
if mount -t tmpfs -o size=16k none "$work/disk" 2> /dev/null; then
    refused=0 good=0 size=16
    while [ "$size" -le 1600 ]; do
        umount "$work/disk" && mount -t tmpfs -o size=${size}k none "$work/disk"
        "$program" figure fig1 --fresh --quiet --out "$work/disk/out" > /dev/null 2> "$work/said"
        found=$?
        [ ! -d "$work/disk/out" ] || whole "$work/disk/out" "a disk of $size KiB"
        case $found in 0) good=$((good + 1)) ;; 2) refused=$((refused + 1)) ;; *) complain "a disk of $size KiB ended with $found" ;; esac
        [ "$(wc -l < "$work/said")" -le 1 ] || complain "a disk of $size KiB said $(cat "$work/said")"
        [ -z "$(find "$work/disk" -name '.twofold-*')" ] || complain "a disk of $size KiB keeps a temporary file"
        size=$((size + 32))
    done
    echo "a disk of 16 to 1600 KiB: $refused refused, $good came through whole"
    k=0 refused=0 good=0
    while [ "$k" -lt 20 ]; do
        k=$((k + 1))
        next
        umount "$work/disk" && mount -t tmpfs -o size=64m none "$work/disk"
        "$program" figure $figures --fresh --quiet --out "$work/disk/out" > /dev/null 2> "$work/said" &
        id=$!
        sleep "$(awk "BEGIN { print $((random / 65536 % 2000)) / 1000 }")"
        # Busy while a file is open for writing: then a little later.
        while ! mount -o remount,ro "$work/disk" 2> /dev/null; do sleep 0.01; done
        wait "$id"
        case $? in 0) good=$((good + 1)) ;; 2) refused=$((refused + 1)) ;; *) complain "read-only in the middle: $(cat "$work/said")" ;; esac
        [ ! -d "$work/disk/out" ] || whole "$work/disk/out" "read-only in the middle"
    done
    umount "$work/disk"
    echo "a disk that becomes read-only, 20 times: $refused refused, $good had finished"
else
    echo "disks: NOT RUN (needs the right to mount)"
fi

# A clock that is wrong, jumps, or runs a thousand times too fast.
if command -v faketime > /dev/null; then
    for clock in "@2038-01-19 03:14:07" "@1970-01-02 00:00:00" "-30y" "+0 x1000" "+0 x0.001" "+0 i-3600"; do
        rm -rf "$work/out"
        faketime -f "$clock" "$program" figure fig1 fig5 --fresh --quiet --out "$work/out" || complain "the clock $clock"
        whole "$work/out" "the clock $clock"
    done
    echo "clocks that are wrong, jump back an hour at every look, run at 1000 or 1/1000 of the pace: 6 tried, the same bytes"
else
    echo "clocks: NOT RUN (needs faketime)"
fi

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

limits
verdict
