# Everything the project does, by name. Needs Rust (rustup reads rust-toolchain.toml) and make; no network at run time.

CARGO   ?= cargo
# Flags of `twofold figure`; --fresh takes nothing from the store and keeps nothing.
FIGURE_FLAGS ?=
PROOFS  := printed-cycle coexistence saddles inner-law sensitivity contraction crossings horseshoe
RUN     := $(CARGO) run --release --locked --quiet

.DEFAULT_GOAL := help
.PHONY: help figures gallery report check bless papers test test-all elementary rigor-test proofs browser-test lint bench bench-peers torture ci clean bench-keep bench-cost

help: ## this list
	@awk -F':.*## ' '/^[a-z-]+:.*## / { printf "make %-12s %s\n", $$1, $$2 }' $(MAKEFILE_LIST)

figures: ## compute every figure at full length into target/figures
	@$(CARGO) build --release --locked --bins
	@$(RUN) --bin twofold -- figure $(FIGURE_FLAGS)
	@$(RUN) --bin twofold -- report

gallery: ## a picture of every system that ships into target/gallery
	@$(CARGO) build --release --locked --bin twofold
	@scripts/gallery.sh target/release/twofold target/gallery

report: ## one page about what stands in target/figures: target/figures/index.html
	@$(RUN) --bin twofold -- report

check: ## recompute and compare with papers/jeffrey-2013/expected; exit 1 on a difference
	@$(RUN) --bin twofold -- check

bless: ## make today's figures the reference: make bless REASON="why"
	@$(RUN) --bin twofold -- bless --reason "$(REASON)"

papers: ## make and check every paper under papers/
	@for p in papers/*/paper.toml; do \
		$(RUN) --bin twofold -- paper report --quiet "$$(dirname "$$p")" && $(RUN) --bin twofold -- paper check --quiet "$$(dirname "$$p")" || exit 1; \
	done

# With the programs and libraries of `make figures`; scripts/rustc-tests.sh compiles the tests themselves.
CHECKED := RUSTC_WRAPPER="$(CURDIR)/scripts/rustc-tests.sh" $(CARGO) test --release --locked
test: ## the tests of the whole program: figures and their hashes, commands, files, papers; some of them: make test TESTS=papers::
	@$(CHECKED) --test it -- $(TESTS)

test-all: test ## also the tests of every crate by itself and of the documentation
	@$(CHECKED) --lib --bins
	@$(CARGO) test --release --locked --doc

# Tests that compute for minutes are compiled as all else is; the flag makes them units of their own, since cargo does not see the script above.
OPTIMISED = $(CARGO) rustc --profile bench --locked --message-format json-render-diagnostics $(1) -- -C opt-level=3 | sed -n 's|.*"executable":"\([^"]*/deps/[^"]*\)".*|\1|p'
rigor-test: ## millions of interval operations against exact integer arithmetic (minutes)
	@it=$$($(call OPTIMISED,--test it)); "$$it" rigor_interval:: --ignored

# 2^24 points a function; make elementary SKIP= : tanh and exp at 2^30 points too (half an hour).
SKIP := --skip 2_30
elementary: ## elementary functions against double-double arithmetic, and their frozen bits: 2^24 points each (minutes)
	@tests=$$($(call OPTIMISED,--package twofold-num --lib)); "$$tests" elementary --include-ignored --nocapture $(SKIP)

include papers/jeffrey-2013/sweeps.mk

.PHONY: returns
returns: ## how many orbits that leave the repelling sliding region come back to the two-fold (minutes)
	@$(CARGO) run --release --locked --quiet --example returns

proofs: ## prove the theorems anew (proofs/README.md), write their certificates and check those (minutes)
	@set -e; for p in $(PROOFS); do $(RUN) --package twofold-proofs --bin $$p; done
	@$(RUN) --bin twofold -- verify proofs/certificates/*.json

.PHONY: second-opinion proofs-quick
second-opinion: ## the first theorem proved by CAPD, another group's library: make second-opinion CAPD=/path/to/its/clone (needs a C++ compiler, cmake)
	@CAPD="$(CAPD)" sh proofs/capd/run.sh

.PHONY: forge
forge: ## forge every number of every certificate, alone and in groups, and write proofs/forgeries.md (some twenty minutes)
	@it=$$($(call OPTIMISED,--test it)); "$$it" verify:: --ignored --nocapture > target/forge.log || { cat target/forge.log; exit 1; }
	@{ printf '# Forged certificates\n\nWritten by `make forge` (tests/it/verify.rs), %s. Numbers of forgeries; every one that is certainly false is refused.\n\n' "$$(date +%Y-%m-%d)"; \
	grep '^|' target/forge.log; } > proofs/forgeries.md

# The theorems that take seconds each; the others are checked by their certificates alone.
QUICK := printed-cycle inner-law saddles
proofs-quick: ## prove the quick theorems anew, byte for byte as committed, and verify every certificate (a minute)
	@# One build for both packages: the library as `make figures` has it.
	@$(CARGO) build --release --locked --quiet --package twofold-dynamics --package twofold-proofs --bins
	@set -e; for p in $(QUICK); do cp proofs/certificates/$$p.json target/$$p.json; target/release/$$p; \
	cmp target/$$p.json proofs/certificates/$$p.json; done
	@target/release/twofold verify proofs/certificates/*.json

browser-test: ## the report in a headless Chromium, if there is one (needs Node)
	@$(CARGO) build --release --locked --bins
	@if command -v node >/dev/null; then node scripts/browser_test.mjs $(BROWSER_TEST); else echo "browser test SKIPPED: no Node found"; fi

.PHONY: report-test
REPORT_TEST := target/report-test
report-test: ## the same with axe-core's and html-validate's rules (needs Node with npm, a Chromium, and poppler-utils for the printed page)
	@$(CARGO) build --release --locked --bin twofold
	@mkdir -p $(REPORT_TEST) && cp scripts/report-test/package.json scripts/report-test/package-lock.json $(REPORT_TEST)
	@cd $(REPORT_TEST) && npm ci --ignore-scripts --no-audit --no-fund --silent
	@node scripts/browser_test.mjs --require --modules $(REPORT_TEST)/node_modules $(BROWSER_TEST)

# A sweep on a cluster that this target starts itself, on this machine (cluster/, docs/sweeps.md).
.PHONY: sweep-hq
sweep-hq: ## a sweep on HyperQueue; tasks are killed at random, then the whole cluster: the same bytes as one process (needs Python 3.9 or newer and PyPI)
	@$(PYTHON) -m venv target/hq/venv
	@target/hq/venv/bin/python -m pip install --quiet --disable-pip-version-check -r cluster/requirements-hq.txt
	@$(CARGO) build --release --locked --bin twofold
	@target/hq/venv/bin/python cluster/test_hq.py target/release/twofold target/hq/test

.PHONY: python-test deny
PYTHON  ?= python3
VENV    := target/python
python-test: ## the Python package, installed into an environment of its own and tested (needs Python 3.9 or newer and PyPI)
	@$(PYTHON) -m venv $(VENV)
	@$(VENV)/bin/python -m pip install --quiet --disable-pip-version-check './python[test]'
	@$(CARGO) build --release --locked --bin twofold
	@TWOFOLD_PROGRAM=$(CURDIR)/target/release/twofold $(VENV)/bin/python -m pytest python $(PYTEST_FLAGS)

.PHONY: wheel package
wheel: ## the Python package as a wheel for this machine, into target/wheels (needs Python and PyPI)
	@$(PYTHON) -m venv $(VENV)
	@$(VENV)/bin/python -m pip install --quiet --disable-pip-version-check 'maturin>=1.9.4,<2'
	@$(VENV)/bin/maturin build --release --locked --quiet --manifest-path python/Cargo.toml --out target/wheels

package: ## the crate, packed, unpacked and built as the registry would have it; nothing is published
	@$(CARGO) publish --dry-run --workspace --locked

deny: ## licences, duplicates, sources and known defects of every dependency (needs cargo-deny: cargo install --locked cargo-deny)
	@$(CARGO) deny --workspace check

.PHONY: fonts
fonts: ## crates/render/fonts/glyphs.bin from the fonts' files
	@$(CARGO) run --locked --quiet --manifest-path tools/fonts/Cargo.toml --target-dir target/tools

.PHONY: sbom
sbom: ## what the program links, with versions, licences and checksums (CycloneDX), into target/sbom (needs cargo-cyclonedx; scripts/sbom.sh)
	@sh scripts/sbom.sh

.PHONY: prose reference schemas
reference: ## write the generated pages of docs/ anew: flags, columns, keys, exit codes, messages
	@TWOFOLD_UPDATE=1 $(MAKE) --no-print-directory test TESTS="reference:: paper_format::"

schemas: ## papers' folders and the report against their schemas by a full validator (downloads one)
	@sh scripts/schemas.sh

prose: ## spelling (typos; skipped without Python) and subjects of commits; the rules of pages are tests (tests/it/prose.rs)
	@sh scripts/spelling.sh
	@sh scripts/subjects.sh

lint: prose ## formatting, clippy and documentation with warnings denied, spelling, subjects of commits
	@git ls-files '*.rs' | xargs rustfmt --edition 2024 --check
	@$(CARGO) clippy --workspace --exclude twofold-python --locked --all-targets -- -D warnings
	@$(CARGO) clippy --manifest-path benches/Cargo.toml --target-dir target --locked --all-targets -- -D warnings
	@RUSTDOCFLAGS="-D warnings" $(CARGO) doc --workspace --exclude twofold-python --locked --no-deps --quiet

torture: ## kill the program at random moments and look for losses: make torture KILLS=100
	@$(CARGO) build --release --locked --bin twofold
	@scripts/torture.sh $(or $(KILLS),100)

.PHONY: mutants
mutants: ## mutation testing of .cargo/mutants.toml's files; not as root (needs cargo-mutants: cargo install --locked cargo-mutants; hours)
	@$(CARGO) mutants --output target $(MUTANTS_FLAGS)

.PHONY: fuzz
fuzz: ## every reader of foreign bytes against inputs made by chance: make fuzz FUZZ_SECONDS=600 FUZZ="spec png"
	@FUZZ_SECONDS=$(or $(FUZZ_SECONDS),60) FUZZ="$(FUZZ)" $(CARGO) test --locked --quiet --test it fuzz::every_reader -- --nocapture

.PHONY: fuzz-coverage
fuzz-coverage: ## the same readers against libFuzzer, which sees coverage: make fuzz-coverage FUZZ_SECONDS=600 FUZZ="spec png" (needs a C++ compiler)
	@sh scripts/fuzz-coverage.sh $(or $(FUZZ_SECONDS),60) $(FUZZ)

.PHONY: symbols
# Every program of the workspace and the Python module, as cargo leaves them; and other files: make symbols PROGRAMS="path ..."
symbols: ## no program and no module asks the platform for mathematics: all of them are built and their ELF files read (Linux)
	@$(CARGO) build --release --locked --workspace
	@found=$$(find target/release -maxdepth 1 -type f \( -executable -o -name 'lib_native.so' \) ! -name '.*'); \
	TWOFOLD_PROGRAMS="$$found $(PROGRAMS)" $(CARGO) test --locked --quiet --test it binary:: -- --ignored --nocapture

.PHONY: check-arch check-levels reprotest
check-arch: ## the same bytes on arm64, s390x, i686, riscv64 and wasm, emulated (and on windows, by wine, if named): make check-arch TARGETS="s390x" (Debian; scripts/check-arch.sh says what it needs)
	@sh scripts/check-arch.sh $(TARGETS)

check-levels: ## the same bytes at every level of optimisation, with fat LTO, and for this processor: make check-levels LEVELS="s z"
	@sh scripts/check-levels.sh $(LEVELS)

reprotest: ## figures made twice with everything around them changed; WHAT=sources builds the program twice too (Debian, as root; scripts/reprotest.sh)
	@[ "$(WHAT)" = sources ] || $(CARGO) build --release --locked --bin twofold
	@sh scripts/reprotest.sh $(or $(WHAT),target/release/twofold) $(FIGURES)

.PHONY: trap
trap: ## check figures with every rounding function of the platform's mathematics replaced by an abort (Linux, needs a C compiler)
	@$(CARGO) build --release --locked --bin twofold
	@sh scripts/trap.sh target/release/twofold $(FIGURES)

bench-peers: ## W1 and W2 of benches/README.md by the peers and by us, in turn: table, ratios, picture (needs g++, Boost, SUNDIALS, python3)
	@sh benches/peers/run.sh

.PHONY: bench-work-precision
bench-work-precision: ## error against time on six problems, by us and by the peers: benches/work-precision (needs g++, Boost, SUNDIALS, python3 and PyPI; twenty minutes)
	@sh benches/work-precision/run.sh

bench-cost: ## cost against end time, layer and tolerance: benches/cost.csv, cost.md and cost.svg
	@$(CARGO) build --release --locked --quiet --manifest-path benches/Cargo.toml --target-dir target --bin twofold-cost
	@target/release/twofold-cost > benches/cost.csv
	@python3 benches/cost.py

.PHONY: bench-hybrid
HYBRID := target/hybrid-peers
bench-hybrid: ## hybrid systems by us, SciPy, CVODE and nosnoc: error, seconds and lines into benches/hybrid (needs Python 3.11 or newer and PyPI; ten minutes)
	@$(PYTHON) -m venv $(HYBRID)
	@$(HYBRID)/bin/python -m pip install --quiet --disable-pip-version-check -r benches/hybrid/requirements.txt
	@[ -n "$$TWOFOLD" ] || $(CARGO) build --release --locked --bin twofold
	@$(HYBRID)/bin/python benches/hybrid/compare.py $(HYBRID_FLAGS)

BENCH = $(CARGO) bench --locked --manifest-path benches/Cargo.toml --target-dir target

bench: ## benchmarks, compared with the last kept ones (make bench-keep)
	@if ls target/criterion/*/*/kept >/dev/null 2>&1; then flags="--baseline kept"; fi; \
	$(BENCH) --bench steppers -- $$flags && $(BENCH) --bench render -- $$flags

bench-keep: ## benchmarks, kept as what `make bench` compares with
	@$(BENCH) --bench steppers -- --save-baseline kept
	@$(BENCH) --bench render -- --save-baseline kept

.PHONY: rehearse
rehearse: ## a job of a workflow, its own lines, in a fresh clone: make rehearse JOB=ci.yml/package (needs Python with PyYAML; scripts/rehearse.py)
	@python3 scripts/rehearse.py $(JOB) $(MATRIX)

# What is built once needs no notes for the next time; they take more room on the disk than all the rest.
ci: export CARGO_INCREMENTAL = 0
ci: lint test-all ## what CI runs; nothing in it rests on a store
	@$(MAKE) --no-print-directory figures FIGURE_FLAGS=--fresh
	@# Every layer of every picture against the reference, as `make check` does, which would compute all of them a second time.
	@$(RUN) --bin twofold -- report | grep '^\([1-9][0-9]*\) of \1 pictures match the reference$$'
	@$(MAKE) --no-print-directory proofs-quick

clean: ## remove everything that was built or computed
	@$(CARGO) clean
