# Everything one does with this repository. `make` alone lists the targets.

PYTHON ?= python3
BIN := .venv/bin
INSTALLED := .venv/.installed
PYTEST := $(BIN)/python -m pytest --numprocesses logical --maxprocesses 4 --dist loadfile
DUCKDB_TESTS := tests/scenarionet_data/catalog tests/scenarionet_data/maintenance tests/scenarionet_data/remote \
	tests/pipelines tests/test_docs.py tests/test_doc_examples.py
LAKE ?= lake
RAW ?= $(if $(SCENARIONET_RAW),$(SCENARIONET_RAW)/$(DATASET),$(if $(filter nuplan,$(DATASET)),$(NUPLAN_DATA_ROOT)))

.DEFAULT_GOAL := help
.PHONY: help install install-browser demo test test-all bench bench-cluster bench-maintenance bench-remote bench-sim build check \
	clean convert docs docs-site notebooks test-devkits test-metadrive

help:  ## List the targets.
	@sed -nE 's/^([a-z0-9-]+):.*## (.*)/\1\t\2/p' $(MAKEFILE_LIST) | awk -F '\t' '{printf "make %-15s %s\n", $$1, $$2}'

install: $(INSTALLED)  ## Make .venv with everything in it (PYTHON=python3.12 chooses another Python).

$(INSTALLED): pyproject.toml
	@$(PYTHON) -c 'import sys; sys.version_info >= (3, 11) or sys.exit("%s is Python %d.%d, 3.11 or newer is needed: make install PYTHON=python3.11" % (sys.executable, *sys.version_info[:2]))'
	test -x $(BIN)/python || $(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -e '.[dev]'
	@touch $@

install-browser:  ## Debian's chromium, for the tests that look at pages in a browser.
	@command -v chromium >/dev/null && chromium --version || $(if $(filter 0,$(shell id -u)),,sudo) sh -c \
		'apt-get update -qq && apt-get install -y -qq --no-install-recommends chromium fonts-dejavu-core'

demo: install  ## From nothing to a lake, a filter, a split and pickles, without a download.
	$(BIN)/python -m scenarionet_pipelines.demo

test: install  ## The tests, in under three minutes (ARGS="-k lake" chooses some).
	$(PYTEST) $(ARGS)

test-all: install  ## The tests, the long ones too.
	$(PYTEST) -m 'not metadrive and not devkits' $(ARGS)

test-duckdb15: install .duckdb15/.installed  ## The tests that ask DuckDB, on the oldest one supported (1.5).
	PYTHONPATH=.duckdb15 $(PYTEST) $(DUCKDB_TESTS) $(ARGS)

.duckdb15/.installed:
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --target .duckdb15 'duckdb~=1.5.0'
	@touch $@

test-metadrive: install .venv-metadrive/.installed  ## MetaDrive opens and drives what is exported (Python 3.11).
	$(BIN)/python -m pytest -m metadrive tests/metadrive $(ARGS)

test-devkits: install .venv-devkits/.installed  ## The owners' readers (nuScenes, Argoverse 2, zarr, GDAL) read what we read.
	$(BIN)/python -m pytest -m devkits tests/devkits $(ARGS)

.venv-devkits/.installed: tests/devkits/make_environments.sh
	sh $< $(PYTHON)
	@touch $@

.venv-metadrive/.installed: tests/metadrive/make_environment.sh
	sh $< $(PYTHON)
	@touch $@

check: install  ## Lint, format and types.
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

bench: install  ## Measure against the goals; writes bench.json.
	$(BIN)/python -m tests.bench $(ARGS)

bench-cluster: install  ## Measure a Dask cluster on this machine against plain processes.
	$(BIN)/python -m tests.bench --only cluster --only growth $(ARGS)

bench-maintenance: install  ## Measure compact, vacuum and fsck alone.
	$(BIN)/python -m tests.bench --only maintain $(ARGS)

bench-sim: install  ## Measure the simulator alone.
	$(BIN)/python -m tests.bench --only sim $(ARGS)

bench-remote: install  ## Measure lakes in an object store alone, against an S3 server on this machine.
	$(BIN)/python -m tests.bench --only remote $(ARGS)

convert: _arguments install  ## DATASET=waymo [RAW=... LAKE=lake SPLIT= WORKERS= ARGS=]: recordings into a lake.
	$(BIN)/scenarionet convert '$(DATASET)' '$(RAW)' '$(LAKE)' \
		$(if $(SPLIT),--split '$(SPLIT)') $(if $(WORKERS),--workers '$(WORKERS)') $(ARGS)

.PHONY: _arguments
_arguments:
	$(if $(DATASET),,$(error set DATASET, for example `make convert DATASET=waymo RAW=raw/waymo/training`))
	$(if $(RAW),,$(error set RAW=FOLDER, or SCENARIONET_RAW to the folder that holds $(DATASET)/$(if \
		$(filter nuplan,$(DATASET)),$(comma) or NUPLAN_DATA_ROOT)))

docs: install  ## Write the data dictionary from schemas/.
	$(BIN)/python -m scenarionet_data.schema.dictionary

docs-site: install .venv/.installed-docs  ## Build the documentation site into site/; it opens without a network.
	NO_MKDOCS_2_WARNING=1 $(BIN)/python -m mkdocs build --quiet

.venv/.installed-docs: pyproject.toml
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -e '.[docs]'
	@touch $@

notebooks: install  ## Run the notebooks on generated scenarios and write their pages in docs/notebooks.
	$(BIN)/python -m scenarionet_pipelines.notebooks $(ARGS)

build: install  ## Wheel and source distribution in dist/.
	$(BIN)/python -m build --no-isolation

clean:  ## Remove what was built, the demo and caches; .venv and lakes stay.
	rm -rf build dist demo site .pytest_cache .mypy_cache .ruff_cache .hypothesis
	find . -name __pycache__ -not -path './.venv/*' -prune -exec rm -rf {} +

comma := ,
