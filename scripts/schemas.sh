#!/bin/sh
# Papers' folders and the report, if it is made, against their schemas by a full validator
# (check-jsonschema), in an environment of its own under target/. The tests hold them against the
# same files with the keywords that the schemas use (tests/it/common/schema.rs).
set -eu
cd "$(dirname "$0")/.."
VERSION=0.39.0
venv=target/schemas

if [ ! -x "$venv/bin/check-jsonschema" ]; then
    "${PYTHON:-python3}" -m venv "$venv"
    "$venv/bin/python" -m pip install --quiet --disable-pip-version-check "check-jsonschema==$VERSION"
fi
holds() {
    schema=$1
    shift
    "$venv/bin/check-jsonschema" --schemafile "schemas/$schema.schema.json" "$@"
}
for kind in paper measures claims; do
    holds "paper/$kind" $(ls src/folder/template/$kind.toml papers/*/$kind.toml 2>/dev/null)
done
holds paper/figure src/folder/template/figures/*.toml papers/*/figures/*.toml
if [ -f target/figures/report.json ]; then
    holds report target/figures/report.json
fi
