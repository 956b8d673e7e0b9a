# Everything the project does, by name. Needs Rust (rustup reads rust-toolchain.toml) and make; no network at run time.

CARGO   ?= cargo
# Flags of `twofold figure`; --fresh takes nothing from the store and keeps nothing.
FIGURE_FLAGS ?=
PROOFS  := printed-cycle coexistence saddles inner-law sensitivity contraction crossings horseshoe
RUN     := $(CARGO) run --release --locked --quiet

.DEFAULT_GOAL := help
.PHONY: help figures gallery report check bless papers test test-all elementary rigor-test census capture proofs browser-test lint bench bench-peers torture ci clean bench-keep bench-cost

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

# In the debug profile, where an overflow is an error.
test: ## the tests of the whole program: figures and their hashes, commands, files, papers
	@$(CARGO) test --locked --test it

test-all: test ## also the tests of every crate by itself and of the documentation
	@$(CARGO) test --locked --lib --bins --examples
	@$(CARGO) test --locked --doc

rigor-test: ## millions of interval operations against exact integer arithmetic (minutes)
	@$(CARGO) test --release --locked --test it rigor_interval:: -- --ignored

# 2^24 points a function; make elementary SKIP= : tanh and exp at 2^30 points too (half an hour).
SKIP := --skip 2_30
elementary: ## elementary functions against double-double arithmetic, and their frozen bits: 2^24 points each (minutes)
	@$(CARGO) test --release --locked --package twofold-num --lib elementary -- --include-ignored --nocapture $(SKIP)

# The sweeps behind papers/jeffrey-2013/code/census, papers/jeffrey-2013/code/audit and papers/jeffrey-2013/code/basin: 300 starts within 1e-9 of the paper's; fig. 7(iii) by other methods and
# tolerances, and to shorter times with small local errors; alpha and beta over three decades each, and one exponent changed; starts on a plane.
# What is there already is kept if six of its rows come out the same again.
SWEEP := $(RUN) --bin twofold -- sweep --threads $(or $(THREADS),0) --resume --recheck 6
STARTS := --over shift.x=-5e-10..5e-10 --over shift.y=-5e-10..5e-10 --over shift.z=-5e-10..5e-10
READINGS := --over params.alpha=1e-3,0.1
PRINTED := --over params.alpha=1e-3
RECONSTRUCTED := --over params.alpha=0.1
INTERVALS := --over interval=20,40,100
HYSTERETIC := --restart 100 --switch hysteretic
SIGMAS := --restart 100 --over sigma=0.01,0.1,0.13
METHODS := --over method=dopri5,radau5 --t-end 2e5 --restart 100
TOLERANCES := --over tolerance=1e-6,1e-8,1e-10,1e-12 --t-end 2e5 --restart 100 --method dopri5
TIGHT := --t-end 2e5 --restart 100 --method dopri5 --over tolerance=1e-13
TAYLOR := --restart 100 --method taylor --rtol 1e-15 --atol 1e-15
EXTENDED := --restart 100 --method taylor-extended --rtol 1e-20 --atol 1e-20
CELLS := --over params.alpha=1e-3..1:log:7 --over params.beta=1e-6..1e-3:log:7
ALPHA := --over params.alpha=1e-2,1 --over params.beta=1e-5
ALPHAS := --over params.alpha=1e-3,1e-2,0.1,1 --over params.beta=1e-5
BETA := --over params.alpha=1e-3 --over params.beta=1e-6,1e-4,1e-3
C := papers/jeffrey-2013/code/census
A := papers/jeffrey-2013/code/audit
census: ## go on with the census, the audit and the basins (hours; Ctrl-C keeps what is finished, and the next call goes on)
	@$(CARGO) build --release --locked --bin twofold
	@$(SWEEP) --t-end 1e4 --method dopri5 --over start.x=-60..60:25 --over start.y=0 --over start.z=-60..60:25 --out papers/jeffrey-2013/code/basin/printed.csv
	@$(SWEEP) --t-end 1e4 --method dopri5 --reading reconstructed --over start.x=-3..3:25 --over start.y=0 --over start.z=-3..3:25 --out papers/jeffrey-2013/code/basin/reconstructed.csv
	@$(SWEEP) --t-end 2e5 $(READINGS) $(INTERVALS) $(STARTS) --random 300 --out $(C)/fig7.csv
	@$(SWEEP) --t-end 2e5 --system papers/jeffrey-2013/code/control/shifted.toml $(INTERVALS) $(STARTS) --random 30 --out papers/jeffrey-2013/code/control/shifted.csv
	@$(SWEEP) --t-end 2e5 --reading reconstructed --eps 0.1 $(INTERVALS) $(STARTS) --random 30 --out papers/jeffrey-2013/code/control/wide.csv
	@$(SWEEP) --t-end 2e5 $(READINGS) $(SIGMAS) $(STARTS) --random 300 --out $(C)/fig8.csv
	@$(SWEEP) $(PRINTED) $(METHODS) $(STARTS) --random 100 --out $(C)/methods-printed.csv
	@$(SWEEP) $(RECONSTRUCTED) $(METHODS) $(STARTS) --random 24 --out $(C)/methods.csv
	@$(SWEEP) $(PRINTED) $(TOLERANCES) $(STARTS) --random 28 --out $(C)/tolerances-printed.csv
	@$(SWEEP) $(RECONSTRUCTED) $(TOLERANCES) $(STARTS) --random 21 --out $(C)/tolerances.csv
	@$(SWEEP) $(TIGHT) $(PRINTED) $(STARTS) --random 30 --out $(C)/tight-printed.csv
	@$(SWEEP) $(TIGHT) $(RECONSTRUCTED) $(STARTS) --random 12 --out $(C)/tight.csv
	@$(SWEEP) --t-end 5e3 $(PRINTED) --restart 100 $(STARTS) --random 100 --out $(C)/ordinary-printed.csv
	@$(SWEEP) --t-end 2e4 $(RECONSTRUCTED) --restart 100 $(STARTS) --random 100 --out $(C)/ordinary-reconstructed.csv
	@$(SWEEP) --t-end 5e3 $(PRINTED) $(TAYLOR) $(STARTS) --random 100 --out $(C)/taylor-printed.csv
	@$(SWEEP) --t-end 2e4 $(RECONSTRUCTED) $(TAYLOR) $(STARTS) --random 100 --out $(C)/taylor-reconstructed.csv
	@$(SWEEP) --t-end 5e3 $(PRINTED) $(EXTENDED) $(STARTS) --random 12 --out $(C)/extended-printed.csv
	@$(SWEEP) --t-end 2e4 $(RECONSTRUCTED) $(EXTENDED) $(STARTS) --random 6 --out $(C)/extended-reconstructed.csv
	@$(SWEEP) --t-end 2e5 $(ALPHA) $(INTERVALS) $(STARTS) --random 30 --out $(A)/alpha7.csv
	@$(SWEEP) --t-end 2e5 $(ALPHA) $(SIGMAS) $(STARTS) --random 30 --out $(A)/alpha8.csv
	@$(SWEEP) --t-end 2e5 $(BETA) $(INTERVALS) $(STARTS) --random 30 --out $(A)/beta7.csv
	@$(SWEEP) --t-end 2e5 $(BETA) $(SIGMAS) $(STARTS) --random 30 --out $(A)/beta8.csv
	@$(SWEEP) --t-end 2e5 $(ALPHAS) $(HYSTERETIC) $(STARTS) --random 12 --out $(A)/alpha9.csv
	@$(SWEEP) --t-end 2e5 $(BETA) $(HYSTERETIC) $(STARTS) --random 12 --out $(A)/beta9.csv
	@$(SWEEP) --t-end 2e5 --method dopri5 $(CELLS) $(INTERVALS) $(STARTS) --random 6 --out $(A)/fig7.csv
	@$(SWEEP) --t-end 2e5 --method dopri5 $(CELLS) $(SIGMAS) $(STARTS) --random 6 --out $(A)/fig8.csv
	@$(SWEEP) --t-end 2e5 --method dopri5 $(HYSTERETIC) $(CELLS) $(STARTS) --random 2 --out $(A)/fig9.csv

# The sweeps behind papers/jeffrey-2013/code/capture, by the rules that stand there.
K := papers/jeffrey-2013/code/capture
CAPTURE := --t-end 2e5 --restart 100 --random-seed
PANEL30 := --t-end 2e5 --over params.alpha=0.1 --over params.beta=3.16227766016838e-4
capture: ## go on with the study of the times of capture, the map of the parameters by LSODA and the candidates' runs (an hour and a half on one core)
	@$(CARGO) build --release --locked --bin twofold
	@$(SWEEP) $(PANEL30) $(INTERVALS) $(STARTS) --random 30 --out $(K)/best7.csv
	@$(SWEEP) $(PANEL30) $(SIGMAS) $(STARTS) --random 30 --out $(K)/best8.csv
	@$(SWEEP) $(PANEL30) $(HYSTERETIC) $(STARTS) --random 12 --out $(K)/best9.csv
	@$(SWEEP) $(CAPTURE) 2014 --method dopri5 $(PRINTED) $(STARTS) --random 200 --out $(K)/dopri5-printed.csv
	@$(SWEEP) $(CAPTURE) 2015 --method radau5 $(PRINTED) $(STARTS) --random 200 --out $(K)/radau5-printed.csv
	@$(SWEEP) $(CAPTURE) 2016 --method taylor --rtol 1e-15 --atol 1e-15 $(PRINTED) $(STARTS) --random 200 --out $(K)/taylor-printed.csv
	@$(SWEEP) $(CAPTURE) 2014 --method dopri5 $(RECONSTRUCTED) $(STARTS) --random 200 --out $(K)/dopri5-reconstructed.csv
	@$(SWEEP) $(CAPTURE) 2015 --method radau5 $(RECONSTRUCTED) $(STARTS) --random 200 --out $(K)/radau5-reconstructed.csv
	@$(SWEEP) $(CAPTURE) 2016 --method taylor --rtol 1e-15 --atol 1e-15 $(RECONSTRUCTED) $(STARTS) --random 200 --out $(K)/taylor-reconstructed.csv
	@$(SWEEP) --t-end 2e5 $(CELLS) $(INTERVALS) $(STARTS) --random 5 --out $(K)/map7.csv
	@$(SWEEP) --t-end 2e5 $(CELLS) $(SIGMAS) $(STARTS) --random 5 --out $(K)/map8.csv
	@$(RUN) --example visits > $(K)/visits.csv

.PHONY: resolved
D := papers/jeffrey-2013/code/resolved
RESOLVED := --t-end 2e5 $(READINGS) $(STARTS) --random 100 --rtol 1e-13 --atol 1e-13 --random-seed
DIGITS := --t-end 2e5 $(STARTS) --over interval=100 --method taylor-extended --rtol 1e-25 --atol 1e-25 --random-seed 2020
resolved: ## the census by methods that resolve the layer, by the rules in papers/jeffrey-2013/code/resolved (three hours on one core; a stopped call goes on)
	@$(CARGO) build --release --locked --bin twofold
	@$(SWEEP) $(RESOLVED) 2017 --method taylor $(INTERVALS) --out $(D)/taylor7.csv
	@$(SWEEP) $(RESOLVED) 2018 --method taylor $(SIGMAS) --out $(D)/taylor8.csv
	@$(SWEEP) $(RESOLVED) 2019 --method layered $(INTERVALS) --out $(D)/layered7.csv
	@$(SWEEP) $(DIGITS) $(PRINTED) --random 100 --out $(D)/extended-printed.csv
	@$(SWEEP) $(DIGITS) $(RECONSTRUCTED) --random 60 --out $(D)/extended-reconstructed.csv

.PHONY: delay-data
delay-data: ## the data of papers/jeffrey-2013/code/delay: passages, and a hundred runs of each rule to compare (a quarter of an hour; a stopped call goes on)
	@$(CARGO) build --release --locked --quiet --example delay_growth --example delay_runs
	@target/release/examples/delay_growth growth > target/delay-growth.csv && mv target/delay-growth.csv papers/jeffrey-2013/code/delay/growth.csv
	@target/release/examples/delay_growth exits > target/delay-exits.csv && mv target/delay-exits.csv papers/jeffrey-2013/code/delay/exits.csv
	@target/release/examples/delay_runs sections > target/delay-sections.csv && mv target/delay-sections.csv papers/jeffrey-2013/code/delay/sections.csv
	@target/release/examples/delay_runs > target/delay-runs.csv && mv target/delay-runs.csv papers/jeffrey-2013/code/delay/runs.csv

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
	@$(CARGO) test --release --locked --test it verify:: -- --ignored --nocapture > target/forge.log || { cat target/forge.log; exit 1; }
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
	@TWOFOLD_UPDATE=1 $(CARGO) test --locked --quiet --test it -- reference:: paper_format::

schemas: ## papers' folders and the report against their schemas by a full validator (downloads one)
	@sh scripts/schemas.sh

prose: ## spelling (typos; skipped without Python) and subjects of commits; the rules of pages are tests (tests/it/prose.rs)
	@sh scripts/spelling.sh
	@sh scripts/subjects.sh

lint: prose ## formatting, clippy and documentation with warnings denied, spelling, subjects of commits
	@git ls-files '*.rs' | xargs rustfmt --edition 2024 --check
	@$(CARGO) clippy --workspace --exclude twofold-python --locked --all-targets -- -D warnings
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

bench-cost: ## cost against end time, layer and tolerance: benches/cost.csv, cost.md and cost.svg
	@$(CARGO) build --release --locked --quiet --manifest-path benches/peers/ours/Cargo.toml --target-dir target --bin twofold-cost
	@target/release/twofold-cost > benches/cost.csv
	@python3 benches/cost.py

.PHONY: bench-hybrid
HYBRID := target/hybrid-peers
bench-hybrid: ## hybrid systems by us, SciPy, CVODE and nosnoc: error, seconds and lines into benches/hybrid (needs Python 3.11 or newer and PyPI; ten minutes)
	@$(PYTHON) -m venv $(HYBRID)
	@$(HYBRID)/bin/python -m pip install --quiet --disable-pip-version-check -r benches/hybrid/requirements.txt
	@[ -n "$$TWOFOLD" ] || $(CARGO) build --release --locked --bin twofold
	@$(HYBRID)/bin/python benches/hybrid/compare.py $(HYBRID_FLAGS)

bench: ## benchmarks, compared with the last kept ones (make bench-keep)
	@if ls target/criterion/*/*/kept >/dev/null 2>&1; then flags="--baseline kept"; fi; \
	$(CARGO) bench --locked -p twofold-benches --bench steppers -- $$flags && $(CARGO) bench --locked -p twofold-benches --bench render -- $$flags

bench-keep: ## benchmarks, kept as what `make bench` compares with
	@$(CARGO) bench --locked -p twofold-benches --bench steppers -- --save-baseline kept
	@$(CARGO) bench --locked -p twofold-benches --bench render -- --save-baseline kept

.PHONY: rehearse
rehearse: ## a job of a workflow, its own lines, in a fresh clone: make rehearse JOB=ci.yml/package (needs Python with PyYAML; scripts/rehearse.py)
	@python3 scripts/rehearse.py $(JOB) $(MATRIX)

# What is built once needs no notes for the next time; they take more room on the disk than all the rest.
ci: export CARGO_INCREMENTAL = 0
ci: lint test-all ## what CI runs; nothing in it rests on a store
	@$(MAKE) --no-print-directory figures FIGURE_FLAGS=--fresh
	@$(MAKE) --no-print-directory check
	@$(MAKE) --no-print-directory proofs-quick

clean: ## remove everything that was built or computed
	@$(CARGO) clean
