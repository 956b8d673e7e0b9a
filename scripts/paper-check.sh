#!/bin/sh
# Checks a paper's folder and writes its report: sh scripts/paper-check.sh DIR
# TWOFOLD names the program; without it the one on PATH is taken, or else one is built from this checkout.
set -u
if [ $# -ne 1 ]; then
    echo "usage: sh scripts/paper-check.sh DIR" >&2
    exit 2
fi
twofold=${TWOFOLD:-}
if [ -z "$twofold" ] && command -v twofold >/dev/null; then
    twofold=twofold
fi
if [ -z "$twofold" ]; then
    here=$(cd "$(dirname "$0")/.." && pwd)
    (cd "$here" && cargo build --locked --quiet --release --bin twofold) || exit 3
    twofold=${CARGO_TARGET_DIR:-$here/target}/release/twofold
fi
# The report is wanted most when something differs.
"$twofold" paper check --quiet -- "$1"
code=$?
"$twofold" paper report --quiet -- "$1" >/dev/null || [ $code -ne 0 ] || code=$?
exit $code
