# One-word targets; each makes what it needs. PYTHON may name another interpreter (3.11 or newer).
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
# a file's tests run in one process, so that few kernels are compiled twice; files in the order of tests/conftest.py
PYTEST := $(BIN)/python -m pytest -n auto --dist loadfile --no-loadscope-reorder --durations 25 --durations-min 5

# tests start many processes, which would compile all sources each time
unexport PYTHONDONTWRITEBYTECODE

.PHONY: demo test quick test-for test-all coverage check evidence bench stress mutate kit-score records wheel docs clean

demo: $(VENV)/run.stamp
	$(BIN)/refgi compare cornell_box --methods sii,multires,val,hssil --out out/
	@echo "open out/index.html; then try: $(BIN)/refgi render docs/examples/room.json --method sii --out out/"

test: $(VENV)/dev.stamp
	$(PYTEST)

quick: $(VENV)/dev.stamp
	$(PYTEST) -m quick

test-for: $(VENV)/dev.stamp
	$(PYTEST) $$($(BIN)/python -m benchmarks.mutate.selection $(FILE))

test-all: $(VENV)/dev.stamp
	$(PYTEST) --all
	NUMBA_BOUNDSCHECK=1 $(PYTEST) tests/rsm tests/lights tests/pairs tests/splat tests/cluster tests/sssil
	NUMBA_NUM_THREADS=1 $(PYTEST) tests/rsm tests/lights tests/pairs tests/splat tests/cluster tests/sssil tests/truth

coverage: $(VENV)/dev.stamp
	$(PYTEST) --cov=refgi --cov-report=term

check: $(VENV)/dev.stamp
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/lint-imports
	$(BIN)/numpydoc lint $$(git ls-files 'refgi/*.py' ':!refgi/cli')
	$(BIN)/sphinx-build -W --keep-going -q -b html docs docs/_build/html
	$(BIN)/python -m benchmarks records

evidence: $(VENV)/dev.stamp
	$(PYTEST) tests -m feature --all --evidence -q

bench: $(VENV)/dev.stamp
	$(BIN)/python -m benchmarks --out out/bench

stress: $(VENV)/dev.stamp
	$(BIN)/python -m benchmarks stability --out out/stability --page docs/precision.md

mutate: $(VENV)/dev.stamp
	$(BIN)/python -m benchmarks mutate --out out/mutate

kit-score: $(VENV)/dev.stamp
	$(BIN)/python -m benchmarks kit-score --out out/kit-score

records: $(VENV)/dev.stamp
	$(BIN)/python -m benchmarks records --make

wheel: $(VENV)/dev.stamp
	trap 'rm -rf refgi/jit/brought' EXIT; $(BIN)/python -m refgi.jit.ahead && $(BIN)/pip wheel --no-deps -w dist .

docs: $(VENV)/dev.stamp docs/extra
	$(BIN)/sphinx-build -W --keep-going -b html docs docs/_build/html
	@echo "open docs/_build/html/index.html"

docs/extra: | $(VENV)/dev.stamp
	$(BIN)/python docs/gallery_page.py --pages

clean:
	rm -rf $(VENV) out docs/_build docs/extra

$(VENV)/bin/python:
	$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "refgi needs Python 3.11 or newer")'
	$(PYTHON) -m venv $(VENV)

$(VENV)/run.stamp: $(VENV)/bin/python pyproject.toml
	$(BIN)/pip install --quiet -e '.[flip]'
	touch $@

$(VENV)/dev.stamp: $(VENV)/bin/python pyproject.toml
	$(BIN)/pip install --quiet -e '.[dev]'
	touch $@ $(VENV)/run.stamp
