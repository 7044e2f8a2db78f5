# podusv: two commands matter, `make reproduce` and `make test`. Both set up what they need.

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
PIP := $(BIN)/pip install --quiet --disable-pip-version-check --constraint constraints.txt
PODUSV := $(BIN)/podusv
PRESETS := printed figures corrected

.DEFAULT_GOAL := help
.PHONY: help reproduce test test-all lint types contracts clean

help: ## what can be made
	@grep -E '^[a-z-]+:.*##' $(MAKEFILE_LIST) | sed -E 's/:.*## /\t/' | expand -t 14

reproduce: $(VENV)/run.done ## run the paper's scenarios into results/paper/
	@for preset in $(PRESETS); do \
	    $(PODUSV) run configs/paper/$$preset.yaml --out results/paper/$$preset --force || exit $$?; \
	done
	@$(PODUSV) run configs/paper/printed_from_zero.yaml --out results/paper/printed_from_zero --force; \
	    test $$? -eq 4 || { echo "printed_from_zero was expected to diverge (exit code 4)" >&2; exit 1; }

test: lint types contracts ## lint, types, import contracts, all tests but the slow ones
	@$(BIN)/pytest

test-all: lint types contracts ## as test, with the slow tests
	@$(BIN)/pytest -m "not benchmark"

lint: $(VENV)/dev.done
	@$(BIN)/ruff check .
	@$(BIN)/ruff format --check .

types: $(VENV)/dev.done
	@$(BIN)/mypy

contracts: $(VENV)/dev.done
	@$(BIN)/lint-imports

clean: ## remove the virtual environment and all caches
	rm -rf $(VENV) build *.egg-info .pytest_cache .mypy_cache .ruff_cache .hypothesis .import_linter_cache

$(BIN)/python:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
	    { echo "podusv needs Python 3.11 or newer; say which with: make PYTHON=python3.12 ..." >&2; exit 1; }
	@echo "setting up $(VENV) (once)"
	@$(PYTHON) -m venv $(VENV)

$(VENV)/run.done: $(BIN)/python pyproject.toml constraints.txt
	@$(PIP) --editable .
	@touch $@

$(VENV)/dev.done: $(VENV)/run.done
	@$(PIP) --editable '.[dev]'
	@touch $@
