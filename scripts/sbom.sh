#!/bin/sh
# What is in the program: every crate with version, licence and checksum, as CycloneDX JSON, into target/sbom/twofold.cdx.json. The same sources give the same file, anywhere at any time;
# that it names every crate that the program links on any platform, and none that is not locked, is checked.
#
#   scripts/sbom.sh      (make sbom; needs cargo-cyclonedx: cargo install --locked --version 0.5.9 cargo-cyclonedx)
set -u
out=target/sbom/twofold.cdx.json
# The tool writes one for every program, beside its manifest; the command's is the one at the root.
sweep() { find . ! -path './target/*' \( -name '*_bin.cdx.json' -o -name '*_cdylib.cdx.json' \) -exec rm {} +; }
trap sweep EXIT
mkdir -p target/sbom
# With the variable it makes up no serial number; the time it writes instead says nothing. Sources it names by their folder.
SOURCE_DATE_EPOCH=0 cargo cyclonedx --quiet --format json --spec-version 1.5 --describe binaries --target all || exit 2
sed -e '/^    "timestamp": /d' -e 's|path+file://[^"#]*#|path+file:///twofold#|g' twofold_bin.cdx.json > "$out" || exit 2

bad=0
complain() { echo "$out: $1"; bad=1; }
if grep -q '"timestamp"\|"serialNumber"' "$out" || grep -qF "$PWD" "$out"; then complain "holds a time, a serial number or this folder's path"; fi
# What it should name.
cargo tree --locked --package twofold-dynamics --edges normal --target all --prefix none --format '{p}' | sed -e 's/ (.*//' -e 's/ v/@/' | sort -u | grep -v '^twofold-dynamics@' > target/sbom/linked
[ -s target/sbom/linked ] || complain "cargo tree names nothing"
sed -n 's|^ *"purl": "pkg:cargo/\([^"?]*\)"*,*$|\1|p' "$out" | sort -u > target/sbom/named
sed -n '/^name = /{s/^name = "\(.*\)"$/\1/;N;s/\nversion = "\(.*\)"$/@\1/;p;}' Cargo.lock | sort -u > target/sbom/locked
while read -r crate; do grep -qxF "$crate" target/sbom/named || complain "does not name $crate, which the program links"; done < target/sbom/linked
while read -r crate; do grep -qxF "$crate" target/sbom/locked || complain "names $crate, which is not in Cargo.lock"; done < target/sbom/named
[ "$bad" -ne 0 ] || echo "$out: $(wc -l < target/sbom/named) crates; the program links $(wc -l < target/sbom/linked), all among them"
exit "$bad"
