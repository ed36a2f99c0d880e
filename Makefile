# Every target sets up what it needs in .venv first. `make` without a target lists them.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
JOB := jobs/kitchen-small.toml
OUT := out/kitchen-small
# One process per core; neighbours share a process and its fixtures
PYTEST := $(BIN)/python -m pytest -n auto --dist worksteal
# Formats and checks the page's JavaScript, as deno.json says
DENO := DENO_NO_UPDATE_CHECK=1 $(BIN)/deno

.DEFAULT_GOAL := help
.PHONY: help install render test golden test-avx2 wheel test-wheel test-all smoke format check docs site bench bench-scaling bench-truth bench-flicker bench-lights bench-report bench-first bench-view bench-live size fuzz-readers clean

help: ## List the targets
	@grep -E '^[a-z0-9-]+:.*##' $(MAKEFILE_LIST) | sed -E 's/:.*## /\t/' | expand -t 12

PIP := $(BIN)/python -m pip install --quiet --disable-pip-version-check

# Makes the environment that all others add to
define environment
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
		{ echo "framearray needs Python 3.11 or newer: run make PYTHON=python3.12, for example"; exit 1; }
	$(PYTHON) -m venv $(VENV)
endef

$(VENV)/installed: pyproject.toml
	$(environment)
	$(PIP) --editable '.[movie]'
	@touch $@

# Many libraries: uv installs them in half the time, pip where there is no uv
$(VENV)/installed-dev: pyproject.toml
	$(environment)
	$(PIP) uv && $(BIN)/uv pip install --quiet --python $(BIN)/python --editable '.[movie,dev,docs]' || \
		$(PIP) --editable '.[movie,dev,docs]'
	@touch $(VENV)/installed $@

$(VENV)/installed-bench: $(VENV)/installed
	$(PIP) --editable '.[movie,bench,report]'
	-$(PIP) --editable '.[peers]'
	@touch $@

install: $(VENV)/installed ## Set up the program in .venv

render: $(VENV)/installed ## Render a small kitchen and assemble a movie
	$(BIN)/framearray render $(JOB)
	$(BIN)/framearray assemble $(OUT) jobs/first-movie.toml --output $(OUT)/first-movie.mp4 --force
	@echo "pictures: $(OUT)   movie: $(OUT)/first-movie.mp4"

test: $(VENV)/installed-dev ## Run the tests
	$(PYTEST)

# Limit Embree by its own setting, numba by the processor it compiles for
test-avx2: $(VENV)/installed-dev ## Run the tests with no instructions beyond AVX2
	FRAMEARRAY_EMBREE=isa=avx2 NUMBA_CPU_NAME=x86-64-v3 $(PYTEST)

golden: $(VENV)/installed-dev ## Write the wording of all commands in tests/cli/golden/ anew
	$(BIN)/python -m pytest tests/cli/test_golden.py --golden

wheel: $(VENV)/installed-dev ## Build a wheel with machine code for this Python; LEVELS="x86-64-v3" for one level only
	PYTHONPATH=tests $(BIN)/python -m distribution.ready $(LEVELS)

test-wheel: $(VENV)/installed-dev ## Build wheel and source distribution, install the wheel elsewhere, and use it
	PYTHONPATH=tests $(BIN)/python -m distribution

test-all: $(VENV)/installed-dev ## Run all tests, the slow ones and random examples too
	$(PYTEST) -m 'not bench' --hypothesis-profile search

test-bounds: $(VENV)/installed-dev ## Run the tests with the lowest and the newest libraries; BOUNDS="--python 3.13" adds a Python
	$(PIP) uv
	PYTHONPATH=tests $(BIN)/python -m bounds $(BOUNDS)

smoke: $(VENV)/installed ## Render the smallest job
	$(BIN)/framearray render jobs/smoke.toml
	$(BIN)/framearray assemble out/smoke jobs/first-movie.toml --output out/smoke/first-movie.mp4 --force

format: $(VENV)/installed-dev ## Format the code
	$(BIN)/ruff format .
	$(BIN)/ruff check --fix .
	@if [ -x $(BIN)/deno ]; then $(DENO) fmt; fi

check: $(VENV)/installed-dev site ## Check format, style, types and the links of docs/
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/mypy --platform win32
	$(BIN)/mypy --platform darwin
	$(BIN)/mypy contrib/blender/framearray_export.py
	@if [ -x $(BIN)/deno ]; then $(DENO) fmt --check && $(DENO) lint && \
		$(DENO) check framearray_cli/tools/view/page/*.js; \
	else echo "the page's JavaScript is not checked: there is no deno for this platform"; fi

docs: $(VENV)/installed-dev ## Write the generated pages of docs/
	PYTHONPATH=tests $(BIN)/python -m pages.jobfile docs/reference/
	PYTHONPATH=tests $(BIN)/python -m pages.commands docs/reference/

site: $(VENV)/installed-dev ## Build the site of docs/ into site/, strict about links
	$(BIN)/zensical build --strict

bench: $(VENV)/installed-bench ## Measure the cost per image, and write docs/quality/speed.csv
	PYTHONPATH=tests $(BIN)/python -m bench $(BENCH)

bench-scaling: $(VENV)/installed-bench ## Measure time against the size of a job, for docs/quality/speed.csv
	PYTHONPATH=tests $(BIN)/python -m bench scaling $(BENCH)

bench-truth: $(VENV)/installed-bench ## Measure images against path-traced ones, and write docs/quality/truth.csv
	PYTHONPATH=tests $(BIN)/python -m bench truth $(BENCH)

bench-flicker: $(VENV)/installed-bench ## Measure how errors change along the paths of light and camera, and write docs/quality/flicker.csv
	PYTHONPATH=tests $(BIN)/python -m bench flicker $(BENCH)

bench-lights: $(VENV)/installed-bench ## Measure lights with a size, a cone, a profile or a map, and write docs/quality/lights.csv
	PYTHONPATH=tests $(BIN)/python -m bench lights $(BENCH)

bench-gloss: $(VENV)/installed-bench ## Measure glossy scenes against path-traced ones, and write docs/quality/gloss.csv
	PYTHONPATH=tests $(BIN)/python -m bench gloss $(BENCH)

bench-report: $(VENV)/installed-bench ## Measure speed against error of the three jobs, and write docs/quality/report-*.csv
	PYTHONPATH=tests $(BIN)/python -m bench report $(BENCH)

bench-first: $(VENV)/installed-dev ## Measure the way to the first picture, from an empty home
	PYTHONPATH=tests $(BIN)/python -m bench first $(BENCH)

bench-view: $(VENV)/installed-bench ## Measure the page of `framearray view` in Chromium
	PYTHONPATH=tests $(BIN)/python -m bench view $(BENCH)

bench-live: $(VENV)/installed-bench ## Measure `render --view`, and the server of the page under load and attack
	PYTHONPATH=tests $(BIN)/python -m bench live $(BENCH)
	PYTHONPATH=tests $(BIN)/python -m bench attack

size: $(VENV)/installed-dev ## Print the size of the program: lines, modules, functions, parameters, phrases
	PYTHONPATH=tests $(BIN)/python -m bench.size

fuzz-readers: $(VENV)/installed-dev ## Feed files to all readers, led by coverage, for an hour (Linux)
	$(PIP) --editable '.[fuzz]'
	PYTHONPATH=tests $(BIN)/python -m fuzz.covered $(FUZZ)

clean: ## Remove all builds and renders
	rm -rf $(VENV) out build dist site .cache .pytest_cache .mypy_cache .ruff_cache
