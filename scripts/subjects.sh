#!/bin/sh
# Subjects of commits: `area: summary`, at most 72 characters, no full stop at the end. Checks those
# after BASE, when this rule began; `scripts/subjects.sh -` reads subjects from standard input.
set -eu
cd "$(dirname "$0")/.."
BASE=c1b5371abf71dbd34a1339c1043c61c70acb1afd

if [ "${1:-}" = - ]; then
    subjects=$(cat)
elif ! command -v git >/dev/null || ! git cat-file -e "$BASE^{commit}" 2>/dev/null; then
    echo "commit subjects SKIPPED: there is no history back to $BASE (no git, a shallow clone or an archive)"
    exit 0
else
    subjects=$(git log --no-merges --format=%s "$BASE..HEAD")
fi
[ -n "$subjects" ] || exit 0

export LC_ALL=C.UTF-8
bad=$(printf '%s\n' "$subjects" | grep -vE '^[A-Za-z0-9_./-]+(, [A-Za-z0-9_./-]+)*: [^ ].*[^ .]$' || true)
long=$(printf '%s\n' "$subjects" | grep -E '^.{73,}' || true)
[ -z "$bad$long" ] && exit 0
[ -z "$bad" ] || printf 'not `area: summary`: %s\n' "$bad"
[ -z "$long" ] || printf 'more than 72 characters: %s\n' "$long"
exit 1
