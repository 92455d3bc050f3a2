# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
DEMO ?= demo
RUST_SOURCES := $(shell find crates -name '*.rs' -o -name Cargo.toml) Cargo.toml

.DEFAULT_GOAL := help
.PHONY: help setup demo test lint bench clean

help: ## list what there is to make
	@awk -F':.*## ' '/^[a-z-]+:.*## / {printf "  make %-10s %s\n", $$1, $$2}' $(MAKEFILE_LIST)

$(BIN)/maturin: pyproject.toml
	test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --upgrade pip 'maturin>=1.16,<2'
	touch $@

$(VENV)/.installed: pyproject.toml $(RUST_SOURCES) | $(BIN)/maturin
	VIRTUAL_ENV=$(CURDIR)/$(VENV) $(BIN)/maturin develop --release --quiet --extras dev
	touch $@

setup: $(VENV)/.installed ## make .venv with the package and its tools, from nothing

demo: setup ## make a capture, recover its material, relight it, open demo/report.html
	$(BIN)/swatchwork demo $(DEMO)

test: setup ## every test: the Rust core's, then Python's
	cargo test --release --quiet -p swatchwork-core
	$(BIN)/pytest -q

lint: setup ## formatting, types, floors, stub, clippy: warnings are errors
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/python scripts/ci/check_floors.py
	$(BIN)/python scripts/ci/check_stub.py
	cargo fmt --all --check
	cargo clippy --all-targets --quiet -- -D warnings

bench: setup ## time the kernels (criterion)
	cargo bench -p swatchwork-core

clean: ## remove what was built
	rm -rf $(VENV) target $(DEMO)
