# Everything the project does, by name. Needs Rust (rustup reads rust-toolchain.toml) and make; no network at run time.

CARGO   ?= cargo
# Flags of `twofold figure`; --fresh takes nothing from the store and keeps nothing.
FIGURE_FLAGS ?=
PROOFS  := printed-cycle coexistence sensitivity crossings
RUN     := $(CARGO) run --release --locked --quiet

.DEFAULT_GOAL := help
.PHONY: help figures gallery report check bless test elementary rigor-test proofs browser-test lint bench bench-peers torture ci clean

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

check: ## recompute and compare with figures/figN/expected.json; exit 1 on a difference
	@$(RUN) --bin twofold -- check

bless: ## make today's figures the reference: make bless REASON="why"
	@$(RUN) --bin twofold -- bless --reason "$(REASON)"

test: ## all tests, in the debug profile
	@$(CARGO) test --locked

rigor-test: ## millions of interval operations against exact integer arithmetic (minutes)
	@$(CARGO) test --release --locked --test rigor_interval -- --ignored

elementary: ## tanh and exp against double-double arithmetic: 2^24 and 2^30 points each (half an hour)
	@$(CARGO) test --release --locked --lib num::elementary -- --include-ignored --nocapture

proofs: ## prove the theorems anew (proofs/README.md), write their certificates and check those (minutes)
	@set -e; for p in $(PROOFS); do $(RUN) --package twofold-proofs --bin $$p; done
	@python3 proofs/check.py

browser-test: ## the report in a headless Chromium, if there is one (needs Node)
	@$(CARGO) build --release --locked --bins
	@if command -v node >/dev/null; then node scripts/browser_test.mjs $(BROWSER_TEST); else echo "browser test SKIPPED: no Node found"; fi

lint: ## formatting, clippy and documentation, warnings denied
	@$(CARGO) fmt --check
	@$(CARGO) clippy --workspace --locked --all-targets -- -D warnings
	@RUSTDOCFLAGS="-D warnings" $(CARGO) doc --locked --no-deps --quiet

torture: ## kill the program at random moments and look for losses: make torture KILLS=100
	@$(CARGO) build --release --locked --bin twofold
	@scripts/torture.sh $(or $(KILLS),100)

bench-peers: ## the units of work of benches/README.md by Boost.odeint and by us, in turn, with ratios (needs g++ and Boost's headers)
	@sh benches/peers/run.sh

bench: ## benchmarks
	@$(CARGO) bench --locked

ci: lint test ## what CI runs; nothing in it rests on a store
	@$(MAKE) --no-print-directory figures FIGURE_FLAGS=--fresh
	@$(MAKE) --no-print-directory check

clean: ## remove everything that was built or computed
	@$(CARGO) clean
