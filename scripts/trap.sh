#!/bin/sh
# Checks figures with every rounding function of the platform's mathematics replaced by an abort (scripts/trap.c): none may be called while the program computes and
# draws, and every byte must be the committed one. Needs a C compiler and a dynamically linked program (Linux).
#
#   scripts/trap.sh [PROGRAM] [FIGURE...]      (make trap)
set -u
program=${1:-target/release/twofold}
[ $# -gt 0 ] && shift
[ $# -gt 0 ] || set -- fig1 fig2 fig3 fig4 fig5 fig6 law
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
${CC:-cc} -shared -fPIC -O1 -fno-builtin -w -o "$work/trap.so" "$(dirname "$0")/trap.c" || exit 2
# The trap is set: a program that calls the platform's cosine is caught.
printf 'double cos(double); int main(int n, char **v) { (void)v; return cos(n) > 2.0; }\n' > "$work/calls.c"
${CC:-cc} -fno-builtin -w -o "$work/calls" "$work/calls.c" -lm || exit 2
if LD_PRELOAD="$work/trap.so" "$work/calls" 2> "$work/said"; then echo "the trap does not catch"; exit 2; fi
grep -q 'called cos of the platform' "$work/said" || { echo "the trap does not catch"; exit 2; }
LD_PRELOAD="$work/trap.so" "$program" check --quiet "$@"
