# Each target does everything from a bare clone: environment, installation, work.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
SOURCES := vcam_cli tests scripts
CAMERA ?= still-life
# Modules are compiled when they are first imported: compiling all 8,000 takes 17 s.
INSTALL := $(BIN)/python -m pip install -q --disable-pip-version-check --no-compile

.PHONY: run test test-all lint check bench check-gpu bench-gpu interchange lenses promise stability docs figures fuzz attacks schemas tables thesis lock clean

run: $(VENV)/.runtime  ## simulate the shipped still life: out/still-life/
	$(BIN)/vcam run $(CAMERA)

test: $(VENV)/.dev  ## the tests, but for those that take long
	$(BIN)/python -m pytest -q -n logical --dist worksteal -m "not long" tests

test-all: $(VENV)/.dev  ## all tests
	$(BIN)/python -m pytest -q -n logical --dist worksteal tests

lint: $(VENV)/.dev  ## format, lint, spelling, types
	$(BIN)/ruff format --check $(SOURCES)
	$(BIN)/ruff check $(SOURCES)
	$(BIN)/typos
	$(BIN)/python scripts/plain_words.py
	$(BIN)/mypy --num-workers 2  # a cold cache: 0.6 of the time of one

check: lint test-all  ## format, lint, spelling, types, all tests

bench: $(VENV)/.dev  ## speed, as ratios: to bare transforms and draws, to plain NumPy, by camera, stage and effect
	$(BIN)/python -m tests.bench

check-gpu: $(VENV)/.dev  ## a graphics processor: its numbers, transforms, frames and noise, and its speed
	$(BIN)/python -m tests.gpu

bench-gpu: $(VENV)/.dev  ## its speed, as ratios to bare transforms, draws and copies
	$(BIN)/python -m tests.gpu bench

lenses: $(VENV)/.dev  ## shipped lenses traced: largest differences from another tracer, as a table
	$(BIN)/python -m tests.lenses

interchange: $(VENV)/.dev  ## raw.dng in other people's readers: bits, colors and seconds, as a table
	$(BIN)/python -m tests.interchange

promise: $(VENV)/.dev  ## the plan's promises: cameras named, random, exactly known, and ten before eighteen scenes
	$(BIN)/python -m tests.promise

stability: $(VENV)/.dev  ## hard cases: our error beside that of the textbook form, as a table
	$(BIN)/python -m tests.hard_cases

figures: $(VENV)/.dev  ## figures and tables of README.md and docs/ that change with the engine; an idle machine
	$(BIN)/python scripts/doc_figures.py

fuzz: $(VENV)/.dev  ## twenty thousand camera and study files with something broken in them
	$(BIN)/python -m tests.hostile
	VCAM_FUZZ=40 $(BIN)/python -m pytest -q -n logical tests/hostile/test_random_cameras.py

attacks: $(VENV)/.dev  ## all attacks of tests/hostile, counted in docs/attacks.md
	$(BIN)/python tests/hostile/attacks.py

docs: $(VENV)/.dev  ## the documentation, with gallery and a reference of every key: build/site/index.html
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build -q

schemas: $(VENV)/.dev  ## JSON Schemas of the files a user writes, from the models
	rm -f schemas/*.schema.json
	$(BIN)/vcam schema schemas

tables: $(VENV)/.dev  ## the data tables of the package, from colour-science
	$(BIN)/python scripts/make_tables.py

thesis: $(VENV)/.dev  ## docs/thesis.md, from the runs of its studies; minutes where nothing is kept
	$(BIN)/python scripts/make_thesis.py

lock: $(VENV)/.dev  ## new versions for reproducible installs
	$(BIN)/python -m pip install -q uv
	$(BIN)/uv pip compile -q --universal --python-version 3.11 --no-header --no-emit-index-url \
	    --no-emit-find-links --no-annotate pyproject.toml -o requirements.lock
	$(BIN)/uv pip compile -q --universal --python-version 3.11 --no-header --no-emit-index-url \
	    --no-emit-find-links --no-annotate --extra dev pyproject.toml -o requirements-dev.lock

clean:
	rm -rf $(VENV) out build dist

$(VENV)/bin/python:
	$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "vcam needs Python 3.11 or newer")'
	$(PYTHON) -m venv $(VENV)

$(VENV)/.runtime: $(VENV)/bin/python pyproject.toml requirements.lock
	$(INSTALL) -r requirements.lock
	$(INSTALL) --no-deps -e .
	touch $@

$(VENV)/.dev: $(VENV)/.runtime requirements-dev.lock
	$(INSTALL) -r requirements-dev.lock
	touch $@
