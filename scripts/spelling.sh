#!/bin/sh
# Spelling of everything that git tracks, by typos (typos.toml), in an environment of its own under
# target/. Without Python, or without network the first time, it says that it was skipped.
set -eu
cd "$(dirname "$0")/.."
VERSION=1.52.0
venv=target/spelling

if [ "$("$venv/bin/typos" --version 2>/dev/null)" != "typos-cli $VERSION" ]; then
    rm -rf "$venv"
    if ! { "${PYTHON:-python3}" -m venv "$venv" &&
        "$venv/bin/python" -m pip install --quiet --disable-pip-version-check --retries 1 --timeout 10 "typos==$VERSION"; } \
        >/dev/null 2>&1; then
        rm -rf "$venv"
        echo "spelling SKIPPED: typos $VERSION could not be installed (it needs Python 3 with venv, and PyPI once)"
        exit 0
    fi
fi
exec "$venv/bin/typos" --format brief
