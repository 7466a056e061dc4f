# Everything starts from nothing but make and Python 3.11: the first target that needs the package installs it.

PYTHON ?= $(shell command -v python3.11 || command -v python3)
VENV ?= .venv
EXPERIMENTS = $(basename $(notdir $(wildcard experiments/*.yaml)))

#: Where programs of an environment are, on Windows elsewhere.
BIN = $(VENV)/$(if $(filter Windows_NT,$(OS)),Scripts,bin)
SPI = $(BIN)/spi
INSTALLED = $(VENV)/.installed
INSTALLED_TEST = $(VENV)/.installed-test
# Without compiling all of the packages, of which most modules are never imported: that takes longer than to unpack them.
PIP = $(BIN)/python -m pip --disable-pip-version-check install --quiet --no-compile --constraint constraints.txt

GALLERY ?= results/gallery
#: Seconds: an experiment that takes longer is drawn in its profile quick; empty: none.
LONGEST ?=

.DEFAULT_GOAL = help
.DELETE_ON_ERROR:
#: The tests of one room, as in `make test ROOM=specs`; of all where it is empty.
ROOM ?=
TESTS = $(ROOM:%=tests/%)

.PHONY: help install demo test test-all test-core test-uncompiled test-bounds test-oldest test-next lint check docs wheel figures paper gallery bench bench-peers clean $(EXPERIMENTS)

help: ## list the targets
	@awk -F ':.*## ' '/^[a-z-]+:.*## / { printf "  %-26s %s\n", $$1, $$2 }' Makefile
	@echo "experiments (run one and plot it):"
	@awk '/^title:/ { n = split(FILENAME, path, "/"); sub(/[.]yaml$$/, "", path[n]); sub(/^title: */, ""); gsub(/["]/, ""); \
	  printf "  %-26s %s\n", path[n], $$0 }' /dev/null $(wildcard experiments/*.yaml)

# A stamp is newer than what it was made from, so a second call costs nothing.  The package is installed in editable
# form: an edit in spi/ needs no new installation.
$(INSTALLED): pyproject.toml constraints.txt
	@echo "setting up $(VENV)" >&2
	@"$(PYTHON)" -c 'import sys; sys.exit("Python 3.11 or newer is needed; say make PYTHON=...") if sys.version_info < (3, 11) else None'
	"$(PYTHON)" -m venv --clear $(VENV)
	$(PIP) --editable .
	@touch $@

$(INSTALLED_TEST): $(INSTALLED)
	$(PIP) --editable '.[test]'
	@touch $@

install: $(INSTALLED) ## set up the virtual environment VENV (.venv)

demo: rigid_body_strong ## set up, run the rigid-body experiment and draw its figure

test: $(INSTALLED_TEST) ## set up and run the tests (less than 6 minutes on two cores); ROOM=specs: those of one room
	$(BIN)/python -m pytest -n 2 --dist worksteal $(TESTS)

test-all: $(INSTALLED_TEST) ## the same with all that is slow: fuzzing, products, builds, every experiment
	$(BIN)/python -m pytest -n 2 --dist worksteal -m "" $(TESTS)

#: Plug-ins that are left out by test-core, with those that need them; all where it is empty.
WITHOUT ?=
test-core: $(INSTALLED_TEST) ## the tests of the core, in a copy without plug-ins; WITHOUT=report: without some
	$(BIN)/python tests/without_plugins.py $(WITHOUT)

test-uncompiled: $(INSTALLED_TEST) ## the same tests without the compiler: slow code, small samples
	NUMBA_DISABLE_JIT=1 $(BIN)/python -m pytest $(TESTS)

# Kernels that check bounds lie in folders of their own in the cache.
BOUNDS = tests/numerics tests/ensemble tests/models tests/schemes
test-bounds: $(INSTALLED_TEST) ## the tests of kernels (or ROOM), which then raise an error where a place is not in its array
	NUMBA_BOUNDSCHECK=1 $(BIN)/python -m pytest -n 2 --dist worksteal $(or $(TESTS),$(BOUNDS))

# Deprecations are the business of versions that are current.
OLDEST = .venv-oldest
test-oldest: ## the same tests (or ROOM) with the oldest versions that pyproject.toml allows, in an environment of their own
	"$(PYTHON)" -m venv --clear $(OLDEST)
	$(OLDEST)/bin/python tests/bounds.py oldest > $(OLDEST)/constraints.txt
	$(OLDEST)/bin/python -m pip install --quiet --no-compile --constraint $(OLDEST)/constraints.txt --editable '.[test]'
	$(OLDEST)/bin/python -m pytest -n 2 --dist worksteal -W ignore::DeprecationWarning $(TESTS)

# The package comes without its requirements, which may bound some of these.
NEXT = .venv-next
test-next: ## the same tests (or ROOM) with the newest versions of the index, past the bounds of pyproject.toml
	"$(PYTHON)" -m venv --clear $(NEXT)
	$(NEXT)/bin/python tests/bounds.py next > $(NEXT)/requirements.txt
	$(NEXT)/bin/python -m pip install --quiet --no-compile --requirement $(NEXT)/requirements.txt
	$(NEXT)/bin/python -m pip install --quiet --no-deps --no-build-isolation --editable .
	$(NEXT)/bin/python -m pip list
	$(NEXT)/bin/python -m pytest -n 2 --dist worksteal $(TESTS)

lint: $(INSTALLED_TEST) ## linter, format and types
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/mypy

check: lint ## lint, and validate every experiment
	$(SPI) check experiments/*.yaml

docs: $(INSTALLED_TEST) ## the documentation as a site, in site/; its reference pages are written from the code
	$(BIN)/python docs/generate/reference.py
	$(BIN)/python -m mkdocs build --quiet

wheel: $(INSTALLED_TEST) ## the source archive and the wheel, in dist/
	$(BIN)/python -m build

figures: $(EXPERIMENTS) ## run and plot every experiment

paper: $(INSTALLED) ## run and plot all 17 figures of the paper, in results/paper (40 minutes on two cores)
	$(SPI) run --group paper --out results/paper
	$(SPI) plot --results results/paper

gallery: $(INSTALLED) ## run every experiment into GALLERY (80 minutes on two cores) and draw all pictures of docs/; goes on where it stopped
	$(BIN)/python docs/generate/gallery.py $(GALLERY) $(if $(LONGEST),--longest $(LONGEST))

$(EXPERIMENTS): %: experiments/%.yaml $(INSTALLED)
	$(SPI) run $<
	$(SPI) plot $<

bench: $(INSTALLED) ## the table of steps of spi run, against a naive loop (5 minutes)
	$(BIN)/python benchmarks/steps.py

bench-peers: $(INSTALLED) ## time at equal error against diffrax and torchsde, where they are installed
	$(BIN)/python benchmarks/peers.py

clean: ## remove results, caches and the virtual environment
	rm -rf $(filter-out results/README.md,$(wildcard results/*)) site .venv $(OLDEST) $(NEXT) build dist *.egg-info .pytest_cache .ruff_cache .hypothesis
	find spi tests benchmarks -name __pycache__ -type d -prune -exec rm -rf {} +
