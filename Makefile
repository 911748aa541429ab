# Everything runs in .venv; `make help` lists what there is.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
PIP := $(BIN)/python -m pip --disable-pip-version-check --quiet
SCENARIO ?= forest_survey
OUT ?= runs/$(SCENARIO)
RUN_OPTIONS ?= --speed 3
PAGE := src/volery/server/static/index.html
PAGE_SOURCES := web/index.html web/package.json web/tsconfig.json web/vite.config.ts \
	$(shell find web/src web/public -type f)

# Tests start hundreds of processes, each of which would compile the sources again where this is set.
unexport PYTHONDONTWRITEBYTECODE

.DEFAULT_GOAL := help
.PHONY: help dev run serve web page test test-installation test-page-units lint docs bench docs-benchmarks package clean

help: ## list the targets
	@grep -hE '^[a-z-]+:.*##' $(MAKEFILE_LIST) | sed -E 's/:.*## /\t/' | expand -t 18

$(BIN)/python:
	$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "Volery needs Python 3.11 or newer; try: make PYTHON=python3.12 ...")'
	$(PYTHON) -m venv $(VENV) || { echo "cannot make a virtual environment; on Debian: apt-get install python3-venv"; exit 1; }

$(VENV)/.installed: pyproject.toml | $(BIN)/python
	@echo "installing volery into $(VENV) ..."
	$(PIP) install --upgrade pip
	$(PIP) install --editable .
	@touch $@

$(VENV)/.installed-tests: $(VENV)/.installed pyproject.toml
	@echo "installing what the tests need into $(VENV) ..."
	$(PIP) install --editable '.[test,lint]'
	@touch $@

$(VENV)/.installed-bench: $(VENV)/.installed pyproject.toml
	$(PIP) install --editable '.[bench]'
	@touch $@

$(VENV)/.installed-docs: $(VENV)/.installed pyproject.toml
	@echo "installing what the documentation site is built with into $(VENV) ..."
	$(PIP) install --editable '.[docs]'
	@touch $@

web/node_modules/.package-lock.json: web/package.json web/package-lock.json
	@.ci/node_fits
	@echo "installing what the page is built with into web/node_modules ..."
	cd web && npm ci --no-progress --loglevel=error
	@touch $@

$(PAGE): web/node_modules/.package-lock.json $(PAGE_SOURCES)
	@.ci/node_fits
	cd web && npm run --silent build -- --logLevel warn
	@touch $@

web: $(PAGE) ## build the page of the browser into the package (needs Node.js 20.19 and npm)

page: # the page where it can be built; without it everything else works
	@.ci/node_fits && $(MAKE) --no-print-directory web || echo "going on without the page"

dev: $(VENV)/.installed-tests page ## install Volery for development: editable, with test tools and linters

run: $(VENV)/.installed page ## fly the main job on a page that stays until Ctrl-C, leave a log and a report under runs/
	@mkdir -p $(OUT)
	$(BIN)/volery run $(SCENARIO) --record $(OUT)/flight.mcap --overwrite --report $(OUT)/report --page $(RUN_OPTIONS)

serve: $(VENV)/.installed page ## serve the page until Ctrl-C: http://127.0.0.1:8080/
	$(BIN)/volery serve

lint: $(VENV)/.installed-tests ## style, types, layers
	$(BIN)/ruff check src benchmarks tests examples tools
	$(BIN)/ruff format --check src benchmarks tests examples tools
	$(BIN)/mypy
	$(BIN)/lint-imports
	@! find tests -name 'test_*.py' | sed 's,.*/,two test files are called ,' | sort | uniq -d | grep .
	@if .ci/node_fits; then $(MAKE) --no-print-directory web/node_modules/.package-lock.json \
		&& cd web && npm run --silent check; fi

test-installation: $(VENV)/.installed-tests page # whatever the tests need
	@.ci/install_ros1
	@.ci/install_bubblewrap
	@.ci/install_browser

test-page-units:
	@if .ci/node_fits; then cd web && npm test --silent; fi

test: lint test-installation test-page-units ## install what tests need, check everything, run the tests; failed ones once more
	$(BIN)/python -m volery.runtime.warmup
	rm -rf .pytest_cache
	$(BIN)/pytest -n 4 --dist loadfile --no-loadscope-reorder -m 'not slow' tests || { [ $$? -eq 1 ] && .ci/second_run; }

docs: $(VENV)/.installed-docs ## build the documentation site: build/site/index.html
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict --quiet
	@echo "built: build/site/index.html"

bench: $(VENV)/.installed-bench page ## measure this machine and its peers, rewrite docs/benchmarks.md and docs/bridge_latency.md
	@mkdir -p runs
	@.ci/install_open3d
	$(BIN)/volery bench --all --out runs/bench.json
	$(BIN)/volery bench peers --out runs/peers.json
	@.ci/install_browser
	$(BIN)/volery bench page --out runs/page.json
	@$(MAKE) --no-print-directory docs-benchmarks

docs-benchmarks: $(VENV)/.installed ## write docs/benchmarks.md and docs/bridge_latency.md anew from what `make bench` measured
	$(BIN)/python -m volery_benchmarks.document runs/bench.json runs/page.json runs/peers.json > runs/benchmarks.md
	mv runs/benchmarks.md docs/benchmarks.md
	$(BIN)/python -m volery_benchmarks.bridge.latency_page docs runs/bench.json

package: $(VENV)/.installed-tests web ## build wheel and source distribution, with the page, into dist
	$(BIN)/python -m build --outdir dist

clean: ## remove what was built or flown here
	rm -rf $(VENV) dist build runs .pytest_cache .mypy_cache .ruff_cache .hypothesis
	rm -rf web/node_modules src/volery/server/static
