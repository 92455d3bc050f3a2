# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
DEMO ?= demo
FUZZ ?= 10000
DATA ?= ../shared/data
CAPTURES ?= ../shared/captures
FIGURES := target/validation
BENCH := target/bench
VIEWER := python/swatchwork/viewer
VIEWER_SOURCES := $(VIEWER)/web/package.json $(VIEWER)/web/package-lock.json $(VIEWER)/web/build.mjs $(wildcard $(VIEWER)/web/src/*)
RUST_SOURCES := Cargo.toml Cargo.lock $(shell find crates -name target -prune -o \( -name '*.rs' -o -name Cargo.toml \) -print)
# Recipes run with the environment's tools first; an activated or conda environment must not win over it.
VENV_ENV := env -u CONDA_PREFIX VIRTUAL_ENV="$(CURDIR)/$(VENV)"

.DEFAULT_GOAL := help
.PHONY: help setup demo test lint format bench validate faults fuzz reproduce picture tutorials gltf-validator clean

help: ## list what there is to make
	@awk -F':.*## ' '/^[a-z-]+:.*## / {printf "  make %-14s %s\n", $$1, $$2}' $(MAKEFILE_LIST)

setup: $(VENV)/.installed $(VIEWER)/bundle/viewer.js ## make .venv with the package and its tools, from nothing

# The stamps: .tools is newer than what it was made from, .installed than the Rust it was built from.
$(VENV)/.tools: pyproject.toml
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' \
	  || { echo "Python 3.11 or newer is needed; say which: make setup PYTHON=python3.12"; exit 1; }
	@command -v cargo >/dev/null || { echo "Rust is needed: cargo was not found (https://rustup.rs)"; exit 1; }
	@test -x $(BIN)/python || scripts/quiet "setup: making $(VENV)" $(PYTHON) -m venv $(VENV)
	@scripts/quiet "setup: installing the build tool" $(BIN)/python -m pip install --disable-pip-version-check 'maturin>=1.16,<2'
	@touch $@

$(VENV)/.installed: pyproject.toml $(RUST_SOURCES) $(VENV)/.tools
	@scripts/quiet "setup: compiling the core, installing the package (1 to 3 minutes at first)" \
	  $(VENV_ENV) $(BIN)/maturin develop --release --extras dev
	@touch $@

$(VIEWER)/bundle/viewer.js: $(VIEWER_SOURCES) $(VENV)/.installed
	@scripts/quiet "setup: bundling the viewer" $(BIN)/python scripts/packaging/build_viewer.py
	@touch $@

demo: setup ## make a capture, recover its material, relight it, open demo/report.html
	@$(BIN)/swatchwork demo $(DEMO)

test: setup ## every test: the Rust core's, then Python's
	@scripts/quiet "test: building the core's tests" cargo test --release --quiet -p swatchwork-core --no-run
	cargo test --release --quiet -p swatchwork-core
	$(BIN)/pytest -q

lint: setup ## formatting, types, floors, stub, wheel, clippy: warnings are errors
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/python scripts/ci/check_floors.py
	$(BIN)/python scripts/ci/check_stub.py
	$(BIN)/python scripts/ci/check_wheel.py
	cargo fmt --all --check
	@scripts/quiet "lint: clippy" cargo clippy --workspace --all-targets --quiet -- -D warnings

format: setup ## format Python and Rust in place
	$(BIN)/ruff check --fix-only --quiet .
	$(BIN)/ruff format --quiet .
	cargo fmt --all

# Finished parts are kept in $(BENCH); `rm` a file there to repeat it, `rm -r $(BENCH)` to begin anew.
bench: setup ## measure speed, memory and error (hours); write docs/benchmarks.md
	@mkdir -p $(BENCH)
	@test -e $(BENCH)/kernels || { scripts/quiet "bench: the kernels" cargo bench -p swatchwork-core && touch $(BENCH)/kernels; }
	$(BIN)/python scripts/bench/table1.py --json $(BENCH)/table1.json
	$(BIN)/python scripts/bench/stages.py --json $(BENCH)/stages.json
	$(BIN)/python scripts/bench/scaling.py --json $(BENCH)/scaling.json
	$(BIN)/python scripts/bench/streaming.py --captures $(CAPTURES) --json $(BENCH)/streaming.json
	$(BIN)/python scripts/bench/beside_peer.py --captures $(CAPTURES) --json $(BENCH)/peer.json
	$(BIN)/python scripts/bench/beside_commit.py 78770a3 --json $(BENCH)/beside_commit.json
	$(BIN)/python scripts/bench/resume.py --json $(BENCH)/resume.json
	$(BIN)/python scripts/bench/page.py --figures $(BENCH) --page docs/benchmarks.md

# Finished capture runs are kept in $(FIGURES)/runs; `rm -r $(FIGURES)` to begin anew.
validate: setup ## measure exactness, blends, captures, photographs (hours); write docs/validation.md
	$(BIN)/python scripts/measure/forward_model.py --data $(DATA)/envmaps/latlong --cache $(FIGURES)/forward --json $(FIGURES)/forward_model.json
	$(BIN)/python scripts/measure/exactness.py --captures $(CAPTURES) --json $(FIGURES)/exactness.json
	$(BIN)/python scripts/measure/two_of_four.py --data $(DATA) --json $(FIGURES)/two_of_four.json
	$(BIN)/python scripts/measure/two_of_four.py --data $(DATA) --search-order paper --seeds 1 --only 0 3 --json $(FIGURES)/two_of_four-paper-order.json
	$(BIN)/python scripts/measure/robust.py --data $(DATA) --json $(FIGURES)/robust.json
	$(BIN)/python scripts/measure/shadows.py --captures $(CAPTURES) --json $(FIGURES)/shadows.json
	$(BIN)/python scripts/measure/captures.py --captures $(CAPTURES) --json $(FIGURES)/captures.json
	$(BIN)/python scripts/measure/planning.py --json $(FIGURES)/planning.json
	$(BIN)/python scripts/measure/confidence.py --data $(DATA) --captures $(CAPTURES) --json $(FIGURES)/confidence.json
	$(BIN)/python scripts/measure/frames.py --captures $(CAPTURES) --json $(FIGURES)/frames.json
	$(BIN)/python scripts/measure/silhouettes.py --captures $(CAPTURES) --json $(FIGURES)/silhouettes.json
	$(BIN)/python scripts/measure/photographs.py --data $(DATA) --ablations --cameras jpeg linear16 --picture docs/photographs.jpg --json $(FIGURES)/photographs.json
	$(BIN)/python scripts/measure/viewer.py --captures $(CAPTURES) --json $(FIGURES)/viewer.json
	$(BIN)/python scripts/measure/exports.py --captures $(CAPTURES) --json $(FIGURES)/exports.json
	$(BIN)/python scripts/measure/page.py --figures $(FIGURES) --page docs/validation.md

# Finished faults are kept in target/faults, by a digest of the code; `rm -r` it to begin anew.
faults: setup ## kill, stop, fill the disk, damage checkpoints (an hour); write docs/reliability.md
	$(BIN)/python scripts/faults/run.py --json target/faults/faults.json --page docs/reliability.md

# Results are kept in target/fuzz; a run that was stopped goes on. A finding fails it.
fuzz: setup ## read FUZZ (10000) spoilt captures (half an hour); write docs/reliability.md
	$(BIN)/python scripts/fuzz/run.py --count $(FUZZ); found=$$?; \
	  $(BIN)/python scripts/fuzz/page.py --count $(FUZZ) && exit $$found

# Finished parts are kept in target/reproduction; `rm -r` it to begin anew.
reproduce: setup ## run the paper's experiments (hours); write docs/reproduction.md
	$(BIN)/swatchwork reproduce all --data $(DATA) --captures $(CAPTURES) -o target/reproduction
	cp target/reproduction/reproduction.md docs/reproduction.md
	rm -rf docs/pictures && cp -r target/reproduction/pictures docs/pictures

gltf-validator: $(VENV)/.installed ## install the Khronos glTF validator (npm) into target/, for the tests that use it
	$(BIN)/python scripts/packaging/gltf_validator.py

picture: setup ## make the README's picture, docs/picture.png, from the demo
	$(BIN)/swatchwork demo $(DEMO) --picture docs/picture.png

# The tutorials' README says what is rewritten. Chromium, where there is one, takes the pictures of pages.
tutorials: setup ## run every block of docs/tutorials; write its output and pictures anew
	$(BIN)/python scripts/tutorials/run.py

clean: ## remove what was built
	rm -rf $(VENV) target $(DEMO) $(VIEWER)/bundle $(VIEWER)/web/node_modules
