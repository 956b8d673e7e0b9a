#!/bin/sh
# Debian's reprotest: makes figures twice, the second time with everything around them changed that reprotest can change (environment, path, kernel's name, addresses,
# processors, time, user, order of folders' entries, host name, home, locale, search path, time zone, umask), and compares every byte.
#
#   scripts/reprotest.sh [PROGRAM] [FIGURE...]      (make reprotest; figures of a program that is there; "all" are all of them)
#   scripts/reprotest.sh sources [FIGURE...]        (the program is built twice as well, from this commit, in two places; it is compared too;
#                                                     CARGO_PROFILE_RELEASE_OPT_LEVEL=0 builds faster)
#
# Needs root, reprotest, disorderfs, faketime, sudo, fuse and a locale et_EE.UTF-8 (Debian: apt-get install reprotest disorderfs faketime sudo fuse locales;
# localedef -i et_EE -f UTF-8 et_EE.UTF-8). VARIATIONS: as reprotest takes them, "+all" if nothing is said.
set -u
what=${1:-target/release/twofold}
[ $# -gt 0 ] && shift
[ $# -gt 0 ] || set -- fig1 fig2 fig3 fig4 fig5 fig6
figures=$*
[ "$figures" != all ] || figures=
log=${LOG:-$PWD/target/reprotest.log}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
chmod 755 "$work"
mkdir "$work/tree"
# Files that hold how long something took are no part of a figure.
make="figure $figures --fresh --quiet --out figures && find figures -name making.json -delete && mkdir made && mv figures made"
if [ "$what" = sources ]; then
    git archive HEAD | tar -x -C "$work/tree" || exit 2
    mkdir -p "$work/tree/.cargo"
    cargo vendor --locked --quiet "$work/tree/vendor" > /dev/null || exit 2
    printf '[source.crates-io]\nreplace-with = "vendored"\n[source.vendored]\ndirectory = "vendor"\n' > "$work/tree/.cargo/config.toml"
    # The toolchain by its own path, since the home is changed as well.
    tools=$(rustc --print sysroot)
    make="export PATH=$tools/bin:\$PATH && sh scripts/release-build.sh --offline --quiet && target/release/twofold $make && cp target/release/twofold made"
else
    cp "$what" "$work/tree/twofold" || exit 2
    make="./twofold $make"
fi
# Another user and group for the second run. Not for a build, whose toolchain only its owner may read; nor is the time varied there: rustc hangs under faketime.
users="--vary=domain_host.use_sudo=1 --vary=user_group.available+=nobody:nogroup"
[ "$what" != sources ] || users="--vary=domain_host.use_sudo=1 --vary=-user_group --vary=-time"
# reprotest asks sudo for a host, as sudo no longer allows (since CVE-2025-32462); it means this one.
mkdir "$work/bin"
printf '#!/bin/sh\n[ "$1" != -h ] || shift 2\nexec %s "$@"\n' "$(command -v sudo)" > "$work/bin/sudo"
chmod 755 "$work/bin/sudo"
export PATH="$work/bin:$PATH"
begun=$(date +%s)
# shellcheck disable=SC2086
reprotest --verbosity 1 --no-diffoscope --variations="${VARIATIONS:-+all}" $users -c "$make" "$work/tree" 'made' > "$log" 2>&1
found=$?
grep -E 'variation:|variation;|IGNORING|differ|ERROR' "$log"
if [ "$found" -eq 0 ]; then result="every byte the same"; else result="DIFFERENT OR FAILED (exit code $found)"; tail -n 20 "$log"; fi
echo "$(date -u +%F) | reprotest $(dpkg-query -W -f '${Version}' reprotest 2> /dev/null) ${VARIATIONS:-+all} | $([ "$what" = sources ] && echo "program (level ${CARGO_PROFILE_RELEASE_OPT_LEVEL:-3}) and figures" || echo figures) | ${figures:-all} | $result | $(($(date +%s) - begun)) s"
exit "$found"
