# podusv: two commands matter, `make reproduce` and `make test`. Both set up what they need.

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
PIP := $(BIN)/pip install --quiet --disable-pip-version-check --constraint constraints.txt
STEP := PODUSV=$(BIN)/podusv examples/reproduce/step.sh
# A file to a core; what its tests share is made once.
# Tests start processes, which would each translate podusv's source anew without byte code on disk.
PYTEST := OPENBLAS_NUM_THREADS=1 PYTHONDONTWRITEBYTECODE= $(BIN)/pytest --numprocesses auto --dist loadfile
OURS := podusv podusv_cli tests benchmarks examples docs
# Every dependency of a run at its lower bound; what tests need beside them, as new as may be.
OLDEST := .venv-oldest
LOWEST := sed -n '/^dependencies = \[/,/^\]/s/^ *"\(.*\)>=\([^,"]*\).*/\1==\2/p' pyproject.toml
NEWEST := .venv-newest
# $(call SEPARATE,FOLDER,PINS): the tests in an environment of their own, without constraints.
define SEPARATE
$(PYTHON) -m venv --clear $(1) && \
$(1)/bin/pip install --quiet --disable-pip-version-check --editable . $(2) $(TESTED_WITH) && \
OPENBLAS_NUM_THREADS=1 $(1)/bin/pytest --numprocesses auto --dist loadfile -m "not slow and not benchmark and not browser"
endef
TESTED_WITH := pytest pytest-xdist hypothesis sympy xarray h5netcdf netCDF4 import-linter fmpy optuna casadi gymnasium safetensors rosbags pyulog pymavlink pynmea2
PODS := kept dropped ideal no_anti_windup single
ABLATIONS := ablation ablation_figures ablation_standoff ablation_gains ablation_gains_figures \
    ablation_gains_standoff ablation_pid
TABLES := unknown:unknown_dynamics discrete:discrete_signals limits:period_limits learnt:learnt gains:fixed_gains networks:networks
SEAS := exact sensors sensors_alone current state_3 state_5 state_6 rare untold rare_untold pods delay thruster_failure dead_zone
STUDIES := hull_and_sea unknown_dynamics rivals rivals_earth rivals_cybership2 sea_state_4 sea_state_6 sea_untold learned
SEARCHES := hull network learned
JUDGES := fresh cybership2 otter
LEFEBER := circle line port load damping
FOSSEN := course cybership2 damping load limits beside
ALOS := demo line far windward sensors
SKJETNE := ellipse far limits load
THRUSTERS := thrusters thrusters_weak thrusters_far thrusters_load
COMPARISONS := printed_compare figures_compare figures_compare_standoff corrected_compare
JUDGED := hull_and_sea unknown_dynamics rivals learned
DOUBTED := $(addprefix mu_2017/,$(COMPARISONS)) $(addprefix lefeber_2003/,$(LEFEBER)) $(addprefix fossen_2003/,$(FOSSEN)) \
    $(addprefix fossen_2023/,$(ALOS)) $(addprefix skjetne_2005/,$(SKJETNE))

.DEFAULT_GOAL := help
.PHONY: help quick reproduce claim pod sea doubt sweep tune bench-laws docs test test-long test-papers test-all test-faults test-oldest test-newest kernels dist bench checks lint types contracts clean

help: ## what can be made
	@grep -E '^[a-z-]+:.*##' $(MAKEFILE_LIST) | sed -E 's/:.*## /\t/' | expand -t 14

# Exit code 4: diverged, as it must. Exit code 3: some of the runs diverged; in figures_compare they must.
reproduce: $(VENV)/run.done ## papers, claim by claim, into results/runs/ and results/paper.md
	@echo "$(words printed_from_zero $(COMPARISONS) $(LEFEBER) $(FOSSEN) $(ALOS) $(SKJETNE) $(THRUSTERS)) steps, three to twelve minutes on two cores:"
	@rm -f results/mu_2017.log results/lefeber_2003.log results/fossen_2003.log results/fossen_2023.log results/skjetne_2005.log
	@$(STEP) run mu_2017 printed_from_zero 4
	@for name in $(COMPARISONS); do \
	    $(STEP) compare mu_2017 $$name $$(case $$name in figures_compare) echo 3;; *) echo 0;; esac) || exit 1; \
	done
	@for name in $(LEFEBER); do $(STEP) compare lefeber_2003 $$name 0 || exit 1; done
	@for name in $(FOSSEN); do $(STEP) compare fossen_2003 $$name 0 || exit 1; done
	@for name in $(ALOS); do $(STEP) compare fossen_2023 $$name 0 || exit 1; done
	@for name in $(SKJETNE) $(THRUSTERS); do $(STEP) compare skjetne_2005 $$name 0 || exit 1; done
	@$(BIN)/python examples/reproduce/verdicts.py
	@$(BIN)/python examples/reproduce/papers.py mu_2017/corrected_compare lefeber_2003 fossen_2003 fossen_2023 skjetne_2005
	@$(BIN)/python examples/reproduce/paper_figures.py
	@echo "every table, claim and figure: results/runs/*/*/report.html"
	@echo "what was found: results/README.md, lefeber_2003.md, fossen_2003.md, fossen_2023.md, skjetne_2005.md; the first paper in figures: results/paper.md"

# In F and S the law without its network diverges, as it must: exit code 3.
claim: $(VENV)/run.done ## the paper's central claim: parts off, wrong vessels, sampling
	@echo "$(words $(ABLATIONS) $(TABLES)) steps, about ten minutes on two cores:"
	@rm -f results/mu_2017.log
	@for name in $(ABLATIONS); do \
	    $(STEP) compare mu_2017 $$name $$(case $$name in ablation_figures|ablation_standoff|ablation_gains_figures) echo 3;; *) echo 0;; esac) || exit 1; \
	done
	@for table in $(TABLES); do \
	    echo "  $${table#*:}" && \
	    $(BIN)/python examples/reproduce/claim.py $${table%:*} > results/.table && \
	    mv results/.table results/mu_2017/$${table#*:}.csv || exit 1; \
	done
	@$(BIN)/python examples/reproduce/network_line.py results/mu_2017/networks.csv results/mu_2017/networks.png
	@echo "what was found: results/claim.md"

pod: $(VENV)/run.done ## the laws behind a pod, into results/runs/pod/
	@echo "$(words $(PODS)) steps:"
	@rm -f results/pod.log
	@for name in $(PODS); do $(STEP) compare pod $$name 0 || exit 1; done
	@echo "what was found: docs/pod.md; every table and figure: results/runs/pod/*/report.html"

sea: $(VENV)/run.done ## single runs in a sea and through sensors, into results/runs/sea/
	@echo "$(words $(SEAS)) steps, about five minutes on two cores:"
	@rm -f results/sea.log
	@for name in $(SEAS); do $(STEP) compare sea $$name 0 || exit 1; done
	@$(BIN)/python examples/reproduce/sea.py > results/.table && mv results/.table results/sea/loads.csv
	@echo "what was found: docs/sea.md; every table and figure: results/runs/sea/*/report.html"

doubt: $(VENV)/run.done ## what the verdicts on papers and studies depend on, into results/doubt.csv, half an hour on two cores
	@for name in $(DOUBTED); do \
	    echo "  $$name" && mkdir -p results/.doubt/$${name%/*} && \
	    $(BIN)/podusv doubt configs/$$name.yaml --out results/.doubt/$$name --force -q || exit 1; \
	done
	@for name in $(JUDGED); do \
	    echo "  studies/$$name" && \
	    $(BIN)/podusv doubt configs/studies/$$name.yaml --set sweep.draws=200 --out results/.doubt/studies/$$name -q || exit 1; \
	done
	@$(BIN)/python examples/reproduce/doubts.py $(addprefix results/.doubt/,$(DOUBTED) $(addprefix studies/,$(JUDGED))) > results/.table && \
	    mv results/.table results/doubt.csv
	@echo "what was found: docs/doubt.md; every turn and figure: results/.doubt/*/*/report.html"

bench-laws: $(VENV)/run.done ## all laws over standard tasks, into results/bench/
	@$(BIN)/podusv bench --force --out results/.bench && mkdir -p results/bench && \
	    cp results/.bench/runs.csv results/bench && \
	    cp results/.bench/figures/profiles.png results/bench/figures
	@$(BIN)/podusv bench configs/bench_boats --force --out results/.bench_boats && \
	    cp results/.bench_boats/runs.csv results/bench/boats.csv
	@$(BIN)/podusv bench configs/bench_dp --force --out results/.bench_dp && \
	    cp results/.bench_dp/runs.csv results/bench/dp.csv
	@$(BIN)/python examples/reproduce/bench.py > results/.table && mv results/.table docs/bench.md
	@echo "what was found: docs/bench.md; the page: results/.bench/report.html"

docs: $(VENV)/dev.done ## the documentation as a site, into site/index.html
	@$(BIN)/python -m sphinx --fail-on-warning --keep-going --quiet -c docs -d build/doctrees . site
	@echo "open site/index.html; it needs no network"

# Made beside the committed files, which a study would not write into, and laid over them when it is whole.
sweep: $(VENV)/run.done ## the committed studies at full size, about half an hour on two cores
	@for name in $(STUDIES); do \
	    $(BIN)/podusv sweep run configs/studies/$$name.yaml --out results/.studies/$$name && \
	    mkdir -p results/studies/$$name/figures && \
	    (cd results/.studies/$$name && cp summary.csv pairs.csv sensitivity.csv claims.json ../../studies/$$name && \
	        cp figures/*-iae.png ../../studies/$$name/figures) || exit 1; \
	done
	@$(BIN)/python examples/reproduce/studies.py > results/.table && mv results/.table docs/studies.md
	@echo "what was found: docs/studies.md; every table and figure: results/.studies/*/report.html"

tune: $(VENV)/dev.done ## the committed searches for gains, about half an hour on two cores
	@for name in $(SEARCHES); do \
	    $(BIN)/podusv tune configs/studies/tune_$$name.yaml --out results/.tuning/$$name && \
	    mkdir -p results/tuning/$$name/figures && \
	    (cd results/.tuning/$$name && cp laws.csv searches.csv limits.csv validation.csv gains.csv importance.csv ../../tuning/$$name && \
	        cp figures/effort.png ../../tuning/$$name/figures) || exit 1; \
	done
	@for name in $(JUDGES); do \
	    $(BIN)/python examples/reproduce/judge.py configs/studies/judge_$$name.yaml results/tuning/hull/gains.csv \
	        results/tuning/judged/$$name || exit 1; \
	done
	@$(BIN)/python examples/reproduce/tuning.py > results/.table && mv results/.table docs/tuning.md
	@echo "what was found: docs/tuning.md; every table and figure: results/.tuning/*/report.html"

quick: $(VENV)/dev.done ## the test files nearest to what has changed since main
	@$(BIN)/python tests/quick.py --files $(or $(FILES),25) --numprocesses auto --dist loadfile --no-loadscope-reorder

test: checks ## lint, types, import contracts, all tests but long ones, papers and slow ones
	@$(PYTEST)

test-long: $(VENV)/dev.done ## long tests: whole matrices, long runs, processes and terminals
	@$(PYTEST) -m "long and not slow and not browser"

test-papers: $(VENV)/dev.done ## whole papers are computed again: the committed verdicts come out
	@$(PYTEST) -m "papers and not slow"

test-all: checks ## as test, with the long tests, the papers and the slow tests
	@$(PYTEST) -m "not benchmark"

test-faults: $(VENV)/dev.done ## the fault tests with their full counts
	@PODUSV_FAULTS=full $(PYTEST) -m "not benchmark" tests/faults

test-oldest: ## the tests with every dependency at its lower bound, in $(OLDEST)
	@$(call SEPARATE,$(OLDEST),$$($(LOWEST))) -W ignore::DeprecationWarning

test-newest: ## the tests with the newest versions, in $(NEWEST); make PYTHON=python3.14 test-newest
	@$(call SEPARATE,$(NEWEST),)

kernels: $(VENV)/dev.done ## podusv's own kernels as bitcode, which its wheel has: after a change of kernels
	@$(BIN)/python -m benchmarks.ship_kernels

dist: $(VENV)/dev.done ## sdist and wheel into dist/, checked with twine; all kernels have to be in kernels.xz
	@$(BIN)/python -m benchmarks.ship_kernels --check
	@$(PYTHON) -m venv --clear .venv-dist
	@.venv-dist/bin/pip install --quiet --disable-pip-version-check build twine
	@rm -rf dist && .venv-dist/bin/python -m build --outdir dist .
	@.venv-dist/bin/twine check --strict dist/*

bench: $(VENV)/dev.done ## speed beside hand-written C (needs a C compiler), into benchmarks/results.md
	@$(BIN)/python -m benchmarks.bench
	@$(BIN)/pytest -m benchmark

# mypy takes one core and longer than the two others together.
checks: $(VENV)/dev.done
	@$(MAKE) --no-print-directory --jobs=2 types lint contracts

lint: $(VENV)/dev.done
	@$(BIN)/ruff check $(OURS)
	@$(BIN)/ruff format --check $(OURS) README.md

# Each system has its own cache: what one has, another may lack.
types: $(VENV)/dev.done
	@for system in linux win32 darwin; do $(BIN)/mypy --platform $$system --cache-dir .mypy_cache/$$system || exit 1; done

contracts: $(VENV)/dev.done
	@$(BIN)/lint-imports

clean: ## remove the virtual environment and all caches
	rm -rf $(VENV) build dist site docs/reference docs/schema.json *.egg-info .pytest_cache .mypy_cache .ruff_cache .hypothesis .import_linter_cache

$(BIN)/python:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
	    { echo "podusv needs Python 3.11 or newer; say which with: make PYTHON=python3.12 ..." >&2; exit 1; }
	@echo "setting up $(VENV), once: two or three steps, about a minute in all"
	@$(PYTHON) -m venv $(VENV)

$(VENV)/run.done: $(BIN)/python pyproject.toml constraints.txt
	@echo "  installing podusv and what it needs (numpy, numba, h5py, matplotlib, ...)"
	@$(PIP) --editable .
	@$(BIN)/podusv schema > docs/schema.json # for editors, which complete keys in configs/
	@touch $@

$(VENV)/dev.done: $(VENV)/run.done
	@echo "  installing the development tools (ruff, mypy, pytest, ...)"
	@$(PIP) --editable '.[dev]'
	@touch $@
