# Every target sets up what it needs by itself, in .venv/, on a machine with Python 3.11+, pip and make.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/.installed
# A file is one process's; those with slow tests come first (tests/conftest.py), so that no core waits at the end.
PYTEST := $(BIN)/python -m pytest --numprocesses auto --maxprocesses 4 --dist loadfile --no-loadscope-reorder

# Threads of OpenBLAS that wait for a core cost more than they bring: an extraction takes ten times the processor time.
export OPENBLAS_NUM_THREADS := 1

# Options of the command behind a target: make bench ARGS=--short, make attack ARGS='--box rack'.
ARGS ?=

PAGES := README.md SECURITY.md CONTRIBUTING.md CHANGELOG.md docs examples

# The tests start some hundred processes: they shall find compiled modules, whatever the environment says.
unexport PYTHONDONTWRITEBYTECODE

.DEFAULT_GOAL := help
.PHONY: ablation attack bench check check-static clean demo docs draw explore format help nightly pick pictures setup show soak test walk

help: ## list the targets
	@grep -E '^[a-z]+:.*##' $(MAKEFILE_LIST) | sed -E 's/:.*## /\t/' | expand -t 10

# A client for the tests, without the fourteen packages that it asks for: its gripper imports one, which is
# among the `clients` of pyproject.toml.
BARE := airo-robots==2026.10.1
# A client for Node.js, without serial ports; where npm is missing or does not get it, its tests are skipped.
FOR_NODE := modbus-serial@8.0.25
NPM := npm install --loglevel error --no-audit --no-fund --ignore-scripts --omit optional --fetch-retries 0 --fetch-timeout 30000

# pip would compile with one core, and also what few or none of our commands load.
NOT_LOADED := /(tests|OpenGL|dask|debugpy|distributed|fontTools|mypyc?|pip|setuptools|sqlalchemy)/
$(STAMP): pyproject.toml
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install -qq --upgrade pip
	$(BIN)/python -m pip install -qq --no-compile --editable '.[dev]'
	$(BIN)/python -m pip install -qq --no-compile --no-deps $(BARE)
	-if command -v npm >/dev/null; then $(NPM) --prefix $(VENV)/node $(FOR_NODE) >/dev/null; fi
	-$(BIN)/python -m compileall -qq -j 0 -x '$(NOT_LOADED)' $(VENV)/lib
	@touch $@

setup: $(STAMP) ## install everything that the other targets use

demo: $(STAMP) ## the paper's experiment: published controller and ours side by side, into out/demo
	$(BIN)/python examples/demo.py $(ARGS)

ablation: $(STAMP) ## what each piece of the controller brings, into out/ablation (half an hour)
	$(BIN)/python examples/ablation.py $(ARGS)

draw: $(STAMP) ## drawings on the emulated arm: extracted, executed, compared, into out/draw
	$(BIN)/python examples/draw.py $(ARGS)

pick: $(STAMP) ## a block picked up like a hand and like a robot, page and film, into out/pick
	$(BIN)/python examples/08_pick_like_a_hand.py $(ARGS)

show: $(STAMP) ## a box with its window: an arm that signs, then waits for your hands; into out/show
	$(BIN)/python examples/09_show.py $(ARGS)

test: $(STAMP) ## the tests, in one process more than there are cores, at most four
	$(PYTEST) -m "not nightly"

nightly: $(STAMP) ## all tests: the costly ones too, and twenty times as many random cases
	HYPOTHESIS_PROFILE=nightly $(PYTEST) -rs --timeout 1200 -o faulthandler_timeout=1190

explore: $(STAMP) ## the property tests with new random cases (make test draws the same ones every time)
	HYPOTHESIS_PROFILE=explore $(PYTEST) -m hypothesis

attack: $(STAMP) ## attack served boxes of all kinds in every way, into docs/security.md (a quarter of an hour)
	$(BIN)/python tests/attack $(ARGS)
	$(BIN)/python -m docs.generate

check-static: $(STAMP)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mdformat --check $(PAGES)
	$(BIN)/mypy
	$(BIN)/mypy tests/walk

check: check-static ## lint, types, fast tests
	$(PYTEST) -m "not slow and not nightly"

bench: $(STAMP) ## measure speed, lateness, memory, tracking; writes bench/results.json
	$(BIN)/python -m bench $(ARGS)

soak: $(STAMP) ## an hour (or SOAK_MINUTES) under load, with an attack every minute, into out/soak
	$(BIN)/python tests/attack/soak.py

walk: $(STAMP) ## random walks over boxes of all kinds; SEED=5 BOX=X: one walk again; STEPS of all together
	$(BIN)/python tests/walk $(if $(SEED),--seed $(SEED)) $(if $(BOX),--box '$(BOX)') $(if $(STEPS),--steps $(STEPS)) $(ARGS)

format: $(STAMP) ## put the code into its canonical layout
	$(BIN)/ruff format .
	$(BIN)/mdformat $(PAGES)
	$(BIN)/ruff check --fix .

docs: $(STAMP) ## rewrite the generated pages, build the documentation site into out/site
	$(BIN)/python -m docs.generate
	NO_MKDOCS_2_WARNING=1 $(BIN)/python -m mkdocs build --strict --quiet

pictures: $(STAMP) ## draw the pictures of docs/contact.md (needs off-screen OpenGL, e.g. libegl1)
	$(BIN)/python -m docs.make_contact_pictures $(ARGS)

clean: ## remove what the targets made
	rm -rf $(VENV) out build dist *.egg-info .mypy_cache .ruff_cache .pytest_cache .hypothesis
	find . -name __pycache__ -prune -exec rm -rf {} +
