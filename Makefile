# make demo   sets everything up, inspects block-a in the virtual cell, prints where report.html is
# make test   sets everything up, runs every check and test
# make bench  times each step of the line and the reference study's method beside it
# make docs   builds the documentation site into site/
# make faults the long fault campaign of the scan
PYTHON ?= python3
BIN := .venv/bin
export OPENBLAS_NUM_THREADS ?= 1
export OMP_NUM_THREADS ?= 2

.PHONY: demo test check bench lock docs clean faults

demo: .venv/.runtime
	$(BIN)/eddyscan demo --out inspections/demo

# The page's tests click as a person would, so they have the machine to themselves.
test: .venv/.dev check
	$(BIN)/pytest -n 2 --dist loadfile -q --ignore tests/web
	$(BIN)/pytest -q tests/web

check: .venv/.dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports

bench: .venv/.runtime
	$(BIN)/python -m benchmarks.line

faults: .venv/.dev
	$(BIN)/python -m benchmarks.faults

.venv/bin/pip:
	$(PYTHON) -m venv .venv

.venv/.runtime: requirements.lock pyproject.toml tools/system-libraries.sh | .venv/bin/pip
	sh tools/system-libraries.sh
	test -e .venv/.dev || $(BIN)/pip install --quiet --require-hashes --only-binary :all: -r requirements.lock
	$(BIN)/pip install --quiet --no-deps --no-build-isolation --editable .
	touch $@

.venv/.dev: requirements-dev.lock pyproject.toml tools/system-libraries.sh | .venv/bin/pip
	sh tools/system-libraries.sh --with-browser
	$(BIN)/pip install --quiet --require-hashes --only-binary :all: -r requirements-dev.lock
	$(BIN)/pip install --quiet --no-deps --no-build-isolation --editable .
	touch $@ .venv/.runtime

docs: .venv/.dev
	$(BIN)/python tools/reference_pages.py docs/reference
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict --quiet

# Pins: names, versions and hashes, no index address. Needs uv on the PATH.
lock:
	uv pip compile --universal --generate-hashes --no-header --no-annotate --python-version 3.11 \
		--group build pyproject.toml -o requirements.lock
	uv pip compile --universal --generate-hashes --no-header --no-annotate --python-version 3.11 \
		--group build --group dev pyproject.toml -c requirements.lock -o requirements-dev.lock

clean:
	rm -rf .venv build dist site src/*.egg-info
