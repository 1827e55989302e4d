# Two commands: `make demo` and `make test`. Both create .venv on first use.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
PIP := $(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt

.PHONY: demo test test-lowest lint types imports unit docs site-check bench clean

demo: $(VENV)/installed
	$(BIN)/trdlab gridworld --gamma 0.95 --N 2 --w 2
	$(BIN)/trdlab explain pretrained:Breakout --step 200 --what forecast --episodes 0

test: lint types imports docs site-check unit  # docs first: it runs the lessons side by side

lint: $(VENV)/installed-tests
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

types: $(VENV)/installed-tests
	$(BIN)/mypy

imports: $(VENV)/installed-tests
	$(BIN)/lint-imports

unit: $(VENV)/installed-tests
	OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 $(BIN)/pytest -n 2 -m "not site"  # one thread for each worker

docs: $(VENV)/installed-tests
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict
	@echo 'Open site/index.html in a browser.'

site-check: $(VENV)/installed-tests  # of the pages that `make docs` has built
	$(BIN)/pytest -n 2 tests/site

# With the lowest versions that we declare, and then with the lowest Gymnasium that has Atari games.
# They have wheels for Python 3.11 and 3.12.
test-lowest: $(VENV)-lowest/installed
	$(LOWEST_PIP) gymnasium==1.0.0
	$(LOWEST_TESTS) -k "not atari" tests/gridworld tests/environments tests/rollouts/test_evaluation.py tests/cli/test_gridworld.py \
		tests/cli/test_train.py tests/deep/test_estimator.py tests/deep/test_networks.py tests/training/test_setup.py
	$(LOWEST_PIP) gymnasium==1.1.0
	$(LOWEST_TESTS) tests/atari tests/test_wrappers.py

bench: $(VENV)/installed
	$(BIN)/python benchmarks/startup.py

clean:
	rm -rf $(VENV) $(VENV)-lowest .cache site

$(VENV)/python: constraints.txt
	$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "trdlab needs Python 3.11 or newer; try: make PYTHON=python3.12 $(MAKECMDGOALS)")'
	$(PYTHON) -m venv $(VENV)
	touch $@

$(VENV)/installed: $(VENV)/python pyproject.toml
	$(PIP) -e .
	touch $@

$(VENV)/installed-tests: $(VENV)/installed
	$(PIP) -e '.[test,docs,interop,box2d]'
	touch $@

LOWEST_PIP := $(VENV)-lowest/bin/python -m pip install --quiet --disable-pip-version-check
LOWEST_TESTS := OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 $(VENV)-lowest/bin/pytest -q -n 2 -W default --disable-warnings

$(VENV)-lowest/installed: constraints.txt pyproject.toml .ci/lowest.py
	$(PYTHON) -m venv $(VENV)-lowest
	$(PYTHON) .ci/lowest.py > $(VENV)-lowest/constraints.txt
	$(LOWEST_PIP) -c $(VENV)-lowest/constraints.txt -e . pytest pytest-xdist hypothesis jsonschema
	touch $@
