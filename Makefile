# `make help` lists the targets. All are safe to repeat; a second run installs nothing.
PYTHON ?= python3
HOST ?= 127.0.0.1
PORT ?= 8000
DATA ?= .data

BIN := .venv/bin
INSTALLED := .venv/installed-$(shell cat requirements.lock pyproject.toml | cksum | cut -d' ' -f1)

.DEFAULT_GOAL := help
.PHONY: help install serve test check lint lock bench-check measured measured-tables clean

help: ## this list
	@sed -n 's/^\([a-z-]*\):.*## \(.*\)/  make \1\t\2/p' $(MAKEFILE_LIST) | expand -t 22

install: $(INSTALLED) ## the virtual environment, the locked packages and bubblewrap
	@.ci/system-packages bwrap:bubblewrap

$(INSTALLED): requirements.lock pyproject.toml
	@$(PYTHON) -c 'import sys; sys.exit("Python 3.11 or newer is needed: make PYTHON=python3.12") if sys.version_info < (3, 11) else 0'
	@$(PYTHON) -c 'import ensurepip' 2>/dev/null || .ci/system-packages -:python3-venv
	@test -x $(BIN)/python || $(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --require-hashes -r requirements.lock
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps --no-build-isolation -e .
	@rm -f .venv/installed-*
	@touch $@

serve: install ## the lesson at http://127.0.0.1:8000 (PORT=, HOST=, DATA=)
	@exec $(BIN)/grader serve --host $(HOST) --port $(PORT) --data $(DATA)

test: install ## the whole test suite: lint, types, layers, jail, database, browser
	@.ci/system-packages chromium:chromium node:nodejs
	$(BIN)/python -m pytest

check: install ## every answer key re-derived, every reference solution graded
	$(BIN)/grader check

lint: install ## ruff and mypy alone
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

lock: install ## rewrite requirements.lock from pyproject.toml (needs uv)
	uv pip compile --quiet --universal --python-version 3.11 --generate-hashes --no-annotate --no-header \
	  --no-emit-index-url --no-emit-find-links --group dev --group build pyproject.toml -o requirements.lock

bench-check: install ## fail where a speed ratio falls below its floor
	$(BIN)/python -m grader.bench.floors

measured: install ## measure all over again (half an hour), and rewrite the figures of README.md and docs/measured.md
	$(BIN)/python -m grader.bench.measured docs README.md docs/measured.md --work $(DATA)/bench

measured-tables: install ## rewrite those figures from the committed results
	$(BIN)/python -m grader.bench.measured docs README.md docs/measured.md --tables-only

clean: ## remove the virtual environment and caches
	rm -rf .venv .mypy_cache .ruff_cache .pytest_cache .hypothesis .import_linter_cache
