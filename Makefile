# `make demo` sets up and runs the main job; `make test` sets up and passes the tests. Nothing else is needed first.
PYTHON ?= python3
PIP_ARGS ?=
export PYTHON PIP_ARGS
BIN := .venv/bin
# Where tools/sumo_libraries.sh unpacked libraries for a user who is not root.
LIBRARIES = $(shell find .venv/system-libraries -name '*.so*' -printf '$(CURDIR)/%h\n' 2>/dev/null | sort -u | paste -sd:)
RUN = LD_LIBRARY_PATH="$(LIBRARIES)$${LD_LIBRARY_PATH:+:$$LD_LIBRARY_PATH}"

.PHONY: help demo test test-all lint types imports unit wheel bench notebooks clean

help:
	@echo "make demo      set up, generate, read, label, merge, train, evaluate; prints the path of the report"
	@echo "make test      set up, lint, types, import rules, tests, wheel"
	@echo "make test-all  make test, and the slow tests and notebooks"
	@echo "make bench     the benchmarks with their targets beside"

demo:
	@tools/install.sh all
	@$(RUN) $(BIN)/python tools/demo.py

test: install-dev lint types imports unit wheel

.PHONY: install-dev
install-dev:
	@tools/install.sh dev

lint:
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

types:
	$(BIN)/mypy

imports:
	$(BIN)/lint-imports

unit:
	$(RUN) $(BIN)/python -m pytest -q -n 2 -m "not slow"

wheel:
	$(RUN) tools/check_wheel.sh

test-all: test
	$(RUN) $(BIN)/python -m pytest -q -m slow
	$(MAKE) notebooks

notebooks:
	$(RUN) tools/check_notebooks.sh

bench:
	@tools/install.sh dev
	$(RUN) $(BIN)/python -m benchmarks

clean:
	rm -rf build dist .mypy_cache .ruff_cache .pytest_cache .hypothesis
