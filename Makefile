# Two commands: `make demo` and `make test`. Both create .venv on first use.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
PIP := $(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt

.PHONY: demo test lint types imports unit docs bench clean

demo: $(VENV)/installed
	$(BIN)/trdlab gridworld --gamma 0.95 --N 2 --w 2

test: lint types imports unit docs

lint: $(VENV)/installed-tests
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

types: $(VENV)/installed-tests
	$(BIN)/mypy

imports: $(VENV)/installed-tests
	$(BIN)/lint-imports

unit: $(VENV)/installed-tests
	OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 $(BIN)/pytest -n 2  # one thread for each worker

docs: $(VENV)/installed-tests
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict
	@echo 'Open site/index.html in a browser.'

bench: $(VENV)/installed
	$(BIN)/python benchmarks/startup.py

clean:
	rm -rf $(VENV) .cache site

$(VENV)/python: constraints.txt
	$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "trdlab needs Python 3.11 or newer; try: make PYTHON=python3.12 $(MAKECMDGOALS)")'
	$(PYTHON) -m venv $(VENV)
	touch $@

$(VENV)/installed: $(VENV)/python pyproject.toml
	$(PIP) -e .
	touch $@

$(VENV)/installed-tests: $(VENV)/installed
	$(PIP) -e '.[test,docs]'
	touch $@
