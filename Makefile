# `make help` lists the targets. All are safe to repeat; a second run installs nothing.
PYTHON ?= python3
HOST ?= 127.0.0.1
PORT ?= 8000
DATA ?= .data
UV ?= uv
FOREIGN ?= $(DATA)/openedx

# The version of MuJoCo, where it is not the pinned one: MUJOCO=4.0.0 has an environment and a lock of its own.
MUJOCO ?=
OTHER := $(filter-out 3.14.0,$(MUJOCO))
VENV := .venv$(OTHER:%=-%)
MUJOCO_LOCK := $(OTHER:%=requirements-mujoco-%.lock)
ifneq ($(MUJOCO_LOCK),$(wildcard $(MUJOCO_LOCK)))
$(error There is no $(MUJOCO_LOCK): MUJOCO= may be 3.14.0 or $(patsubst requirements-mujoco-%.lock,%,$(wildcard requirements-mujoco-*.lock)))
endif

BIN := $(VENV)/bin
# How often a test that fails is run again; the summary names it. None but in CI, where nobody can look at the machine.
RERUNS ?= 0
AGAIN := $(if $(filter-out 0,$(RERUNS)),--reruns $(RERUNS))
# Processes share the tests file by file, as these share their server. Four on two cores, since tests also wait; fast
# ones do not, and each process takes ten seconds to import them all.
TOGETHER := --dist loadfile --no-loadscope-reorder
PIP := $(BIN)/python -m pip install --quiet --quiet --disable-pip-version-check
PAGES := docs/measured.md docs/deploy.md

# Each stamp names the state of the locks that was installed. What development needs includes what serving needs.
STATE := $(shell cat requirements.lock requirements-dev.lock $(MUJOCO_LOCK) pyproject.toml | cksum | cut -d' ' -f1)
SERVING := $(VENV)/serving-$(STATE)
DEVELOPING := $(VENV)/developing-$(STATE)

# Python keeps what it has compiled: pytest would otherwise rewrite every test file again in each of its processes.
unexport PYTHONDONTWRITEBYTECODE

.DEFAULT_GOAL := help
.PHONY: help install lti-foreign serve test wasm test-fast test-pythons check verdicts fuzz-content lint vendor client wheel docs \
	release examples lock bench-check \
	measured measured-tables \
	clean jail-package

help: ## this list
	@sed -n 's/^\([a-z-]*\):.*## \(.*\)/  make \1\t\2/p' $(MAKEFILE_LIST) | expand -t 22

install: $(DEVELOPING) jail-package ## the virtual environment, every locked package and bubblewrap

serve: $(SERVING) jail-package ## the lessons at http://127.0.0.1:8000 (PORT=, HOST=, DATA=)
	@exec $(BIN)/grader serve --host $(HOST) --port $(PORT) --data $(DATA)

test: install ## the whole test suite: lint, types, layers, jail, database, browser (MUJOCO=4.0.0)
	@.ci/system-packages chromium-headless-shell:chromium-headless-shell node:nodejs npm:npm nginx:nginx openssl:openssl \
		caddy:caddy zsh:zsh docker-compose:docker-compose pgbouncer:pgbouncer systemd-analyze:systemd pg_dump:postgresql-client
	@$(MAKE) --no-print-directory wasm || echo 'Without the WASM build of MuJoCo the comparison in tests/labs fails.'
	$(BIN)/python -m pytest -n 4 $(TOGETHER) $(AGAIN)

wasm: build/wasm/node_modules ## the official WASM build of MuJoCo, with which tests/labs compares

build/wasm/node_modules: tests/labs/wasm/package-lock.json
	@mkdir -p build/wasm
	@cp tests/labs/wasm/package.json tests/labs/wasm/package-lock.json build/wasm/
	@cd build/wasm && npm ci --silent --ignore-scripts --no-audit --no-fund
	@touch $@

test-fast: $(DEVELOPING) ## the tests without jail, browser, PostgreSQL, Node and lint: a minute
	$(BIN)/python -m pytest -q -n 2 $(TOGETHER) -m fast $(AGAIN)

test-pythons: $(DEVELOPING) ## the fast tests on the other Pythons that are here, and `grader check` on the newest
	@.ci/pythons

check: install ## every answer key re-derived, every reference solution graded
	$(BIN)/grader check

verdicts: install ## every reference solution under sixty draws of the hidden cases (half an hour)
	$(BIN)/grader check --draws 60

fuzz-content: $(DEVELOPING) ## every value of all content replaced: each is refused, or checked to the end (a quarter of an hour)
	$(BIN)/python tests/library/mutations.py

lint: $(DEVELOPING) ## ruff, mypy and the layers alone
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports

vendor: ## the bundles in src/grader/web/static/vendor, made anew with Node.js
	@mkdir -p build/vendor
	@cp deploy/vendor/*.js* deploy/vendor/*.mjs deploy/vendor/.npmrc build/vendor/
	@cd build/vendor && npm ci --silent && node build.mjs ../../src/grader/web/static/vendor

client: ## the wheel of mujoco-grader-client, into build/client
	@rm -rf build/client build/client-parts client/src/*.egg-info
	@build/client-env/bin/python -m pip --version >/dev/null 2>&1 || $(PYTHON) -m venv build/client-env
	@sed -n '/^setuptools==/,/[^\\]$$/p' requirements.lock >build/client-env/needs.txt
	@build/client-env/bin/python -m pip install --quiet --disable-pip-version-check --require-hashes -r build/client-env/needs.txt
	@build/client-env/bin/python -m pip wheel --quiet --disable-pip-version-check --no-deps --no-build-isolation --wheel-dir build/client ./client
	@ls build/client/*.whl

wheel: $(SERVING) ## the wheel of the grader, into dist/
	@rm -rf build/lib build/bdist.* dist/mujoco_grader-*.whl
	@$(BIN)/python -m pip wheel --quiet --disable-pip-version-check --no-deps --no-build-isolation --wheel-dir dist .
	@ls dist/*.whl

docs: $(DEVELOPING) ## the documentation site, in build/site
	@[ -x $(VENV)-docs/bin/sphinx-build ] || $(BIN)/python -m venv $(VENV)-docs
	@$(VENV)-docs/bin/python -m pip install --quiet --quiet --disable-pip-version-check --require-hashes -r requirements-docs.lock
	@PYTHONPATH=$$($(BIN)/python -c 'import sysconfig; print(sysconfig.get_path("purelib"))'):src:deploy \
		$(VENV)-docs/bin/python -m release.site

release: install docs ## everything of a release, built and checked in dist/; nothing is uploaded
	PYTHONPATH=deploy $(BIN)/python -m release

examples: install ## record the examples of /openapi.json anew, from a real server
	$(BIN)/python -m pytest -q tests/api/test_examples.py --record-examples

lock: ## rewrite the locks from pyproject.toml (needs uv: UV=)
	$(COMPILE) --group build --no-deps -o requirements-build.lock
	$(LOCK) --group build --constraint requirements-build.lock -o requirements.lock
	$(LOCK) $(SERVED) --constraint requirements.lock -o requirements-all.lock
	$(LOCK) $(SERVED) --group build --group dev --extra bench --constraint requirements.lock \
		--constraint requirements-all.lock -o requirements-dev.lock
	$(COMPILE) --group docs --constraint requirements-dev.lock -o requirements-docs.lock
	printf '%s==4.0.0\n' mujoco mujoco-core mujoco-studio | $(COMPILE) --no-deps -o requirements-mujoco-4.0.0.lock -
	printf '%s==3.14.0\n' mujoco mujoco-mjx | $(COMPILE) --constraint requirements.lock -o requirements-mjx.lock -

# Whatever else runs on the machine makes code slower, never faster: what is over its budget is measured again.
bench-check: install ## fail where a speed ratio is below its floor or a cost above its budget
	$(BIN)/python -m grader.studies.bench.floors
	$(BIN)/python -m pytest -q -m cost --reruns 2 --reruns-delay 20

measured: install ## measure all over again (half an hour), and rewrite docs/measured.* (MUJOCO=4.0.0: what has no times)
	$(BIN)/python -m grader.studies.bench.published.measured docs $(PAGES) --work $(DATA)/bench$(OTHER:%=-%)

measured-tables: $(DEVELOPING) ## rewrite those figures from the committed results
	$(BIN)/python -m grader.studies.bench.published.measured docs $(PAGES) --tables-only

lti-foreign: $(DEVELOPING) ## launches and scores against Open edX's platform code, in an environment of its own
	@$(FOREIGN)/bin/python -m pip --version >/dev/null 2>&1 || $(PYTHON) -m venv $(FOREIGN)
	@$(FOREIGN)/bin/python -m pip install --quiet --disable-pip-version-check -r tests/platforms/foreign/requirements.txt
	PYTHONPATH=src:tests $(BIN)/python tests/platforms/foreign/run.py $(FOREIGN)/bin/python

clean: ## remove the virtual environment and caches
	rm -rf .venv .venv-* .mypy_cache .ruff_cache .pytest_cache .hypothesis .import_linter_cache

jail-package:
	@.ci/system-packages bwrap:bubblewrap

COMPILE = $(UV) pip compile --quiet --universal --python-version 3.11 --generate-hashes --no-annotate --no-header \
	--no-emit-index-url --no-emit-find-links
LOCK = $(COMPILE) pyproject.toml
# The extras that a server may need; those of benchmarks are for development alone.
SERVED = --extra oidc --extra lti

define install_from
	@$(PYTHON) -c 'import sys; sys.exit("Python 3.11 or newer is needed: make PYTHON=python3.12") if sys.version_info < (3, 11) else 0'
	@$(PYTHON) -c 'import ensurepip' 2>/dev/null || .ci/system-packages -:python3-venv
	@$(BIN)/python -m pip --version >/dev/null 2>&1 || { echo 'Creating the virtual environment $(VENV)'; $(PYTHON) -m venv $(VENV); }
	@echo 'Installing the packages of $(1) into $(VENV)'
	@$(PIP) --require-hashes -r $(1)
	$(if $(OTHER),$(call replace_mujoco))
	@echo 'Installing grader itself into $(VENV)'
	@$(PIP) --no-deps --no-build-isolation -e .
	@rm -f $(VENV)/serving-* $(VENV)/developing-* $(VENV)/installed-*
endef

# MuJoCo 4.0.0 is three packages with one folder: pip must remove what is there before it installs any of them.
define replace_mujoco
	@echo 'Replacing MuJoCo by $(OTHER)'
	@$(BIN)/python -m pip uninstall --quiet --quiet --yes mujoco-grader mujoco mujoco-core mujoco-studio
	@$(PIP) --require-hashes --no-deps -r $(MUJOCO_LOCK)
endef

$(SERVING):
	$(call install_from,requirements.lock)
	@touch $@

$(DEVELOPING):
	$(call install_from,requirements-dev.lock)
	@touch $(SERVING) $@
