# `make demo` and `make test` are the two commands; each sets up the locked environment in .venv first.
PYTHON ?= python3.11
VENV := .venv
BIN := $(VENV)/bin
READY := $(VENV)/.ready
UV := uv==0.13.9   # installs the locked packages in a third of pip's time
BLIND_SEED ?= 1

# The tests start hundreds of processes; without byte code each would compile every library anew.
export PYTHONDONTWRITEBYTECODE :=

.PHONY: help demo test test-all check style types compiled collected site format lock audit dist wheel-test clean blind bench

help:            ## this list
	@grep -E '^[a-z-]+:.*##' $(MAKEFILE_LIST) | sed 's/:.*##/\t/'

$(READY): requirements/dev.txt pyproject.toml
	@command -v $(PYTHON) >/dev/null || { echo "make: $(PYTHON) not found; install Python 3.11 or call make PYTHON=/path/to/python3.11" >&2; exit 1; }
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check $(UV)
	$(BIN)/uv pip install --quiet --python $(BIN)/python --require-hashes -r requirements/dev.txt
	$(BIN)/uv pip install --quiet --python $(BIN)/python --no-deps -e .
	@touch $@

demo: $(READY)   ## build the unit, drive it over the paper's road and onto snow and wet, write out/demo
	$(BIN)/python build_fmu.py --out dist
	$(BIN)/trpac run scenarios/paper_simulation.yaml --fmu dist/TrpacEstimator.fmu --out out/demo \
	  --compare-camera scenarios/cruise_onto_snow.yaml --compare-camera scenarios/cruise_onto_wet.yaml

COMPILING := tests/sim2real/test_gap_observer.py::test_a_log_without_measurements_is_the_plain_simulation_from_rest \
  tests/benchmarks/test_withheld_plant.py::test_neutral_effect_is_the_nominal_car \
  tests/sim2real/test_gap_report.py::TestRating::test_the_same_curve_is_rated_one

# Three workers for two cores: some tests wait for processes, rigs and clusters. One thread each: the threads of one's
# matrix products would wait for the other's. The seed is for random inputs; pytest by itself draws others every time.
test: CHOSEN := -m "not long"
test:            ## lint, types and the test suite
test-all:        ## the same with the tests that take long (twice the time)
test test-all: export OPENBLAS_NUM_THREADS = 1
test test-all: $(READY) style
	@$(MAKE) --no-print-directory -j 3 types compiled collected site TRPAC_SITE_NOTEBOOKS=false  # the tests run them
	$(BIN)/python -m pytest -n 3 --dist loadfile --hypothesis-seed 0 $(CHOSEN)

check: style types  ## lint and types

style: $(READY)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

types: $(READY)
	$(BIN)/mypy

compiled: $(READY)
	@echo "compiling the two plants, one per worker"  # else each worker would compile both
	@$(BIN)/python -m pytest -q -n 2 --dist loadfile $(COMPILING)

collected: $(READY)
	@$(BIN)/python -m pytest -q --collect-only >/dev/null || true  # else each worker would rewrite all assertions; what is wrong the suite tells

# Notebooks start in an empty folder, lest their files lie among the documents, and are run anew.
site: NOTEBOOK_START := $(CURDIR)/out/notebook_start
site: $(READY)   ## the site into out/site, its notebooks run, its links checked
	@echo "building the site"
	@rm -rf .cache/mkdocs-jupyter $(NOTEBOOK_START); mkdir -p $(NOTEBOOK_START)/profile_default/startup
	@echo 'import os, tempfile; os.chdir(tempfile.mkdtemp(prefix="trpac_notebook_"))' > $(NOTEBOOK_START)/profile_default/startup/folder.py
	@IPYTHONDIR=$(NOTEBOOK_START) NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict >out/site.log 2>&1 || { cat out/site.log; exit 1; }

format: $(READY) ## rewrite the sources in the house format
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

lock: $(READY)   ## resolve the dependencies anew
	$(BIN)/uv pip compile --quiet --universal --python-version 3.11 --generate-hashes --no-header --no-annotate \
	  --no-emit-index-url --no-emit-find-links \
	  --extra all --extra conformance --extra dev pyproject.toml -o requirements/dev.txt

# The wheel in a fresh environment of each of these, in an empty folder; CI does it for one.
PYTHONS ?= python3.11 python3.12 python3.13

dist: $(READY)   ## the source archive, and from it the wheel, into dist
	rm -rf build dist/*.whl dist/*.tar.gz
	$(BIN)/python -m build --outdir dist . >/dev/null
	rm -rf build

wheel-test: dist ## install the wheel into fresh environments, run the README's Python and the commands there
	@set -e; for python in $(PYTHONS); do \
	  place=$$(mktemp -d); echo "$$python in $$place"; \
	  $$python -m venv $$place/env; \
	  $(BIN)/uv pip install --quiet --python $$place/env/bin/python "$$(ls dist/*.whl)[all]"; \
	  mkdir $$place/empty; \
	  (cd $$place/empty && env -u PYTHONPATH $$place/env/bin/python $(CURDIR)/tests/support/wheel_check.py $(CURDIR)/README.md); \
	  rm -rf $$place; \
	done

audit:           ## published faults of the locked packages (needs pip-audit on PATH, and the network)
	pip-audit --strict --disable-pip --require-hashes -r requirements/dev.txt

blind: $(READY)  ## the diagnosis on withheld cases, all thresholds (long; BLIND_SEED=n for other cases)
	$(BIN)/python -m benchmarks.gap.withheld run --out out/blind-$(BLIND_SEED) --cases full --seed $(BLIND_SEED) --jobs 2
	$(BIN)/python -m benchmarks.gap.withheld score --out out/blind-$(BLIND_SEED)

bench: $(READY)  ## step times of estimator and plant, added to out/speed.jsonl (on an idle machine)
	$(BIN)/python -m benchmarks.speed

clean:           ## remove what was built and measured
	rm -rf out dist build
