# Tasks of this repository; `make` without a target lists them.

PYTHON ?= python3
BIN := .venv/bin
INSTALLED := .venv/.installed
INSTALLED_DEMO := .venv/.installed-demo
# Machine code beside the kernels, for this processor; `make build` makes it for all that this one can run.
SHIP := $(BIN)/python -m scenarionet_pipelines.compiling
PIP_INSTALL := $(BIN)/python -m pip install --quiet --disable-pip-version-check
# Keep compiled bytecode, which saves tens of seconds a run, even where the environment turns that off.
PYTEST := env -u PYTHONDONTWRITEBYTECODE $(BIN)/python -m pytest --numprocesses logical --maxprocesses 4 --dist loadfile
DUCKDB_TESTS := $(addprefix tests/scenarionet_data/,databases operations query quality maintenance packs remote) \
	tests/scenarionet_pipelines tests/test_docs.py tests/test_doc_examples.py
PLAIN_TESTS := $(addprefix tests/,scenarionet_data/compiled/test_checking.py scenarionet_data/compiled/test_gate.py \
	scenarionet_data/test_loader.py scenarionet_sim/simulation/test_simulation.py)
UNCHECKED_TESTS := $(addprefix tests/,scenarionet_data/codec scenarionet_data/test_loader.py scenarionet_sim/simulation \
	scenarionet_sim/sensors scenarionet_sim/worlds)
LAKE ?= lake
TORCH ?= torch>=2.4,<3
RAW ?= $(if $(SCENARIONET_RAW),$(SCENARIONET_RAW)/$(DATASET),$(if $(filter nuplan,$(DATASET)),$(NUPLAN_DATA_ROOT)))

.DEFAULT_GOAL := help
.PHONY: help install install-locked lock test-plain test-unchecked install-browser demo compile test test-integration test-all test-packaging test-damage bench bench-cameras bench-cluster bench-learn bench-maintenance bench-remote bench-samples bench-sim build check \
	clean convert docs docs-site notebooks pictures mutants test-cuda test-devkits test-interop test-learn test-metadrive test-planners test-ros test-openpilot planners openpilot

help:  ## List the targets.
	@sed -nE 's/^([a-z0-9-]+):.*## (.*)/\1\t\2/p' $(MAKEFILE_LIST) | awk -F '\t' '{printf "make %-16s %s\n", $$1, $$2}'

install: $(INSTALLED)  ## Create .venv with every extra and the development tools (PYTHON=python3.12 selects an interpreter).

$(INSTALLED): pyproject.toml
	$(create_environment)
	$(PIP_INSTALL) -e '.[dev]'
	$(SHIP)
	$(set_hooks)
	@touch $@ $(INSTALLED_DEMO)

install-locked:  ## Create .venv with the versions and hashes of .ci/requirements.lock.
	$(create_environment)
	$(PIP_INSTALL) --require-hashes -r .ci/requirements.lock
	$(PIP_INSTALL) --no-deps --no-build-isolation -e .
	$(SHIP)
	$(set_hooks)
	@touch $(INSTALLED) $(INSTALLED_DEMO)

lock: install  ## Write .ci/requirements.lock: the newest versions that pyproject.toml allows, with hashes.
	$(PIP_INSTALL) uv
	$(BIN)/python -m uv pip compile pyproject.toml --extra dev --universal --python-version 3.11 --upgrade --quiet \
		--generate-hashes --no-emit-index-url --no-emit-find-links --no-header -o .ci/requirements.lock

# Of this clone and all of its worktrees; nothing without git.
set_hooks = @git config core.hooksPath .ci/hooks 2>/dev/null || true

$(INSTALLED_DEMO): pyproject.toml
	$(create_environment)
	$(PIP_INSTALL) --no-compile -e '.[plots]'
	@touch $@

define create_environment
@$(PYTHON) -c 'import sys; sys.version_info >= (3, 11) or sys.exit("%s is Python %d.%d, 3.11 or newer is needed: make install PYTHON=python3.11" % (sys.executable, *sys.version_info[:2]))'
@test -x $(BIN)/python || $(PYTHON) -m venv .venv
endef

install-browser:  ## Install Debian's chromium, for the tests that open pages in a browser.
	@command -v chromium >/dev/null && chromium --version || $(if $(filter 0,$(shell id -u)),,sudo) sh -c \
		'apt-get update -qq && apt-get install -y -qq --no-install-recommends chromium fonts-dejavu-core'

demo: $(if $(wildcard $(INSTALLED)),$(INSTALLED),$(INSTALLED_DEMO))  ## Generate scenarios, query, filter, split, load, draw and export them; downloads no data.
	$(BIN)/python -m scenarionet_pipelines.demo

compile: install  ## Compile all kernels again after editing some, so that first uses are fast.
	$(BIN)/scenarionet maintain compile

test: install  ## Run the tests, about five minutes of processor time (ARGS="-k lake" selects some).
	$(PYTEST) $(ARGS)

test-integration: install  ## Run the tests of whole programs, servers, workers, object stores, Bullet, evaluations and repairs.
	$(PYTEST) -m 'integration and not long and not damage' $(ARGS)

test-all: install  ## Run all tests that need no other environment, including those marked as long.
	SCENARIONET_HYPOTHESIS=thorough $(PYTEST) -m 'not damage and not metadrive and not devkits and not learn and not ros and not planners and not openpilot and not cuda and not interop' $(ARGS)

test-plain: install  ## Run tests of kernels as with versions of numba that were not tested: by its own compiler and cache.
	cache=$$(mktemp -d) && trap 'rm -rf "$$cache"' EXIT && \
	SCENARIONET_PLAIN_NUMBA=1 NUMBA_CACHE_DIR="$$cache" $(BIN)/python -m pytest $(PLAIN_TESTS) $(ARGS)

test-unchecked: install  ## Run tests of kernels without the check of their arguments, as users run them.
	SCENARIONET_CHECK_KERNELS=0 $(BIN)/python -m pytest $(UNCHECKED_TESTS) $(ARGS)

test-packaging: install  ## Build the distributions, install them into empty environments, and use them.
	$(BIN)/python -m pytest -m packaging tests/test_wheel.py $(ARGS)

test-damage: install  ## Read thousands of damaged lakes, about an hour of processor time.
	$(PYTEST) -m damage tests/scenarionet_data/damage $(ARGS)

test-duckdb15: install .duckdb15/.installed  ## Run the tests that query DuckDB with the oldest supported version (1.5).
	PYTHONPATH=.duckdb15 $(PYTEST) -m 'not long and not damage' $(DUCKDB_TESTS) $(ARGS)

.duckdb15/.installed:
	$(PIP_INSTALL) --target .duckdb15 'duckdb~=1.5.0'
	@touch $@

test-ducklake: install .ducklake/.installed  ## Publish a lake as DuckLake, by a DuckDB whose extension is on the package index.
	SCENARIONET_DUCKLAKE=$(CURDIR)/.ducklake $(PYTEST) -m integration tests/scenarionet_data/publishing $(ARGS)

.ducklake/.installed:
	$(PIP_INSTALL) --target .ducklake 'duckdb==1.5.5' 'duckdb-extension-ducklake==1.5.5'
	@touch $@

test-metadrive: install .venv-metadrive/.installed  ## Replay exported pickles in MetaDrive (Python 3.11).
	$(BIN)/python -m pytest -m metadrive tests/metadrive $(ARGS)

test-learn: install .venv-learn/.installed  ## Run the tests that need torch (TORCH=torch==2.13.0 selects a release; ARGS="-m 'learn and long'" the long ones).
	.venv-learn/bin/python -m pytest -m 'learn and not long' $(ARGS)

.venv-learn/.installed: tests/learn/make_environment.sh
	TORCH='$(TORCH)' sh $< $(PYTHON)
	@touch $@

test-ros: install .venv-ros/.installed  ## Run the tests in which processes of ROS 2's wires, DDS and zenoh, drive.
	.venv-ros/bin/python -m pytest -m ros tests/ros $(ARGS)

.venv-ros/.installed: tests/ros/make_environment.sh
	sh $< $(PYTHON)
	@touch $@

openpilot: .venv-openpilot/.installed  ## Make .venv-openpilot, an environment with pycapnp, opendbc and msgq (MSGQ=FOLDER of its source).

test-openpilot: install openpilot  ## Run the tests of openpilot's protocol (OPENPILOT=FOLDER with log.capnp).
	.venv-openpilot/bin/python -m pytest -m openpilot tests/openpilot $(ARGS)

.venv-openpilot/.installed: tests/openpilot/make_environment.sh
	sh $< $(PYTHON)
	@touch $@

planners: .venv-planners/.installed  ## Make .venv-planners, an environment with planners of others, for sim --policy commonroad:reactive.

test-planners: install planners  ## Run the tests in which planners of others drive.
	.venv-planners/bin/python -m pytest -m planners tests/planners $(ARGS)

.venv-planners/.installed: tests/planners/make_environment.sh
	sh $< $(PYTHON)
	@touch $@

test-cuda: install .venv-cuda/.installed  ## Run the tests of cameras on a graphics card, compiled and simulated where there is none.
	.venv-cuda/bin/python -m pytest -m cuda tests/cuda/test_compilation.py $(ARGS)
	NUMBA_ENABLE_CUDASIM=1 .venv-cuda/bin/python -m pytest -m cuda tests/cuda/test_frames.py $(ARGS)

.venv-cuda/.installed: tests/cuda/make_environment.sh
	sh $< $(PYTHON)
	@touch $@

test-interop: install .venv-interop/.installed  ## Open exported files in SUMO, CARLA's client and ASAM's checker.
	$(BIN)/python -m pytest -m interop tests/interop $(ARGS)

.venv-interop/.installed: tests/interop/make_environment.sh
	sh $< $(PYTHON)
	@touch $@

test-devkits: install .venv-devkits/.installed  ## Compare the converters with the official readers (nuScenes, Argoverse 2, zarr, GDAL).
	$(BIN)/python -m pytest -m devkits tests/devkits $(ARGS)

.venv-devkits/.installed: tests/devkits/make_environments.sh
	sh $< $(PYTHON)
	@touch $@

.venv-metadrive/.installed: tests/metadrive/make_environment.sh
	sh $< $(PYTHON)
	@touch $@

mutants: install .venv/.installed-mutants  ## Put 200 small bugs into the core and count those that the tests catch (hours; resumes).
	$(BIN)/python -m tests.mutation $(ARGS)

.venv/.installed-mutants: pyproject.toml
	$(PIP_INSTALL) -e '.[mutants]'
	@touch $@

check: install  ## Check lint, format, types, and the subjects of commits since the last release.
	.ci/hooks/commit-msg
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

bench: install  ## Run all benchmarks and write bench.json.
	$(BIN)/python -m tests.bench $(ARGS)

bench-cameras: install  ## Benchmark cameras.
	$(BIN)/python -m tests.bench --only cameras $(ARGS)

bench-cluster: install  ## Benchmark a local Dask cluster against a process pool.
	$(BIN)/python -m tests.bench --only cluster --only growth $(ARGS)

bench-maintenance: install  ## Benchmark compact, vacuum and fsck.
	$(BIN)/python -m tests.bench --only maintain $(ARGS)

bench-learn: install .venv-learn/.installed  ## Benchmark training, end to end, with torch.
	.venv-learn/bin/python -m tests.bench --only learn $(ARGS)

bench-samples: install  ## Benchmark samples for forecasting, beside trajdata and UniTraj.
	[ -x .venv-trajdata/bin/python ] || tests/trajdata/make_environment.sh
	$(BIN)/python -m tests.bench --only samples $(ARGS)

bench-sim: install  ## Benchmark the simulator.
	[ -x .venv-metadrive/bin/python ] || tests/metadrive/make_environment.sh
	$(BIN)/python -m tests.bench --only sim $(ARGS)

bench-remote: install  ## Benchmark lakes in an object store, with a local S3 server.
	$(BIN)/python -m tests.bench --only remote $(ARGS)

convert: _arguments install  ## Convert recordings: DATASET=waymo [RAW=... LAKE=lake SPLIT= WORKERS= ARGS=].
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

pictures: install  ## Make the films and the pictures of cameras and the browser in the documentation again (needs Chromium).
	$(BIN)/python docs/make_camera_pictures.py
	$(BIN)/python docs/make_block_pictures.py
	$(BIN)/python docs/make_films.py
	$(BIN)/python docs/make_page_pictures.py

notebooks: install .venv-learn/.installed  ## Run the notebooks on generated scenarios and write their pages to docs/notebooks; one needs torch.
	.venv-learn/bin/python -m scenarionet_pipelines.notebooks $(ARGS)

build: install  ## Build the source distribution, and the wheel with machine code for the Python of .venv, in dist/.
	$(SHIP) all
	$(BIN)/python -m build --no-isolation --sdist
	$(BIN)/python -m build --no-isolation --wheel

clean:  ## Remove build outputs, the demo, the site and caches; keep .venv and lakes.
	rm -rf build dist demo site .pytest_cache .mypy_cache .ruff_cache .hypothesis
	find . -name __pycache__ -not -path './.venv/*' -prune -exec rm -rf {} +

comma := ,
