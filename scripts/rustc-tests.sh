#!/bin/sh
# Compiles units of tests, and nothing else, with overflow checks and assertions and with little optimisation, which would take the compiler longer than it spares the tests.
#
#   RUSTC_WRAPPER=scripts/rustc-tests.sh cargo test --release
#
# The libraries below them are those of `make figures`.
checked="-C codegen-units=16 -C debug-assertions -C overflow-checks"
case " $* " in
    *" --crate-name twofold_"*" --test "*) ;;
    *" --crate-name it "*" --test "*) ;;
    *) exec "$@" ;;
esac
case " $* " in
    # Their tests compute for minutes.
    *" --crate-name twofold_hybrid "* | *" --crate-name twofold_integrate "*) level=1 ;;
    *) level=0 ;;
esac
# shellcheck disable=SC2086
exec "$@" -C opt-level=$level $checked
