# Everything goes through .venv, which the first target that needs it makes.
#
#   make bench [SUITE=demo]   set up, run a suite, say where its report is
#   make test [WORKERS=auto]  set up, run the tests but for those marked slow; as many workers as cores
#   make test-all             run every test
#   make test-gpu             run the tests for a GPU: the back end cuda, on gsplat's kernels
#   make coverage             run every test and ask for 90 % coverage
#   make check                lint, format, types, and `make test`
#   make fuzz                 hand hostile files to every reader for an hour; FUZZ_SECONDS says for how long
#   make gate                 run the smoke suite and compare it with the committed baseline
#   make prior                train a network that tells geometry and material, about twenty minutes on one core
#   make weights              fetch the weights of LPIPS, FID and KID, so that their tests run
#   make docs                 write the tables and figures that the docs take from code
#   make pictures             render small scenes and draw the pictures of the docs, some minutes
#   make site                 build the site of all docs: runs/site/index.html
#   make ledger               build the pages of all published runs: runs/ledger/index.html

SUITE ?= demo
FUZZ_SECONDS ?= 3600
PYTHON ?= python3
BIN := .venv/bin

.DEFAULT_GOAL := help
.PHONY: help bench test test-all test-gpu coverage kernels check lint fuzz gate prior weights docs pictures site ledger clean

help:
	@sed -n 's/^#   //p' Makefile

bench: .venv/installed
	$(BIN)/graycard bench $(SUITE) --out runs/$(SUITE)

# Tests that share an expensive fixture run in one worker (tests/conftest.py).
WORKERS ?= auto
PYTEST := $(BIN)/python -m pytest -n $(WORKERS) --dist loadgroup --durations=25

test: kernels
	$(PYTEST) -m "not slow"

test-all: kernels
	$(PYTEST)

# Only files with such tests are read: others want a renderer. `PYTHONPATH=src make test-gpu PYTEST_GPU="python3 -m pytest"`
# takes an environment that has PyTorch for the GPU and gsplat already.
PYTEST_GPU ?= $(BIN)/python -m pytest

test-gpu: $(if $(filter $(BIN)/%,$(PYTEST_GPU)),.venv/installed-test)
	$(PYTEST_GPU) -m gpu --durations=10 $$(grep -rl --include='test_*.py' 'pytest.mark.gpu' tests)

coverage: kernels
	$(PYTEST) --cov --cov-report=term-missing:skip-covered

# Compiled once here, not by every worker at the same time.
kernels: .venv/installed-test
	$(BIN)/graycard doctor --warm

check: lint test

lint: .venv/installed-dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/pyright
	$(BIN)/python -m pytest -q -p no:cacheprovider tests/docs/test_prose.py

# Inputs of failures are kept in runs/fuzz. FUZZ_SEED=2 makes other cases; tests/fuzz/test_fuzz.py has all options.
fuzz: kernels
	FUZZ_SECONDS=$(FUZZ_SECONDS) FUZZ_KEEP=runs/fuzz $(BIN)/python -m pytest -q -s tests/fuzz

# Asked for together, kernels come first: they are compiled once.
gate: .venv/installed $(filter kernels,$(MAKECMDGOALS))
	$(BIN)/graycard bench smoke --out runs/smoke
	$(BIN)/graycard gate runs/smoke --baseline benchmarks/baselines/smoke.json

prior: .venv/installed-test
	$(BIN)/graycard train-prior --out runs/prior --plot runs/prior/curves.svg

weights: .venv/installed
	$(BIN)/graycard weights lpips
	$(BIN)/graycard weights inception

docs: .venv/installed-test
	GRAYCARD_WRITE_DOCS=1 $(BIN)/python -m pytest -q tests/test_architecture.py tests/eval/test_eval_docs.py \
		tests/docs/test_reference.py tests/docs/test_editions.py tests/docs/test_sizes_note.py \
		tests/docs/test_large_scenes_note.py tests/reports/test_history.py tests/reports/test_history_words.py

pictures: .venv/installed-test
	$(BIN)/python tests/helpers/docs_pictures.py runs/pictures

ledger: .venv/installed
	$(BIN)/graycard site reports/published reports/published/second reports/published/large --out runs/ledger

site: .venv/installed-docs
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict
	@echo "site: runs/site/index.html"

clean:
	rm -rf .venv runs build *.egg-info

.venv/bin/python:
	$(PYTHON) -c 'import sys; sys.version_info >= (3, 11) or sys.exit("expected Python 3.11 or newer, got " + sys.version.split()[0] + ": make PYTHON=python3.11 ...")'
	$(PYTHON) -m venv .venv

# A stamp an extra, so that `make bench` does not wait for what only tests need.
.venv/installed: pyproject.toml constraints.txt | .venv/bin/python
	$(BIN)/pip install --quiet --disable-pip-version-check -c constraints.txt -e .
	touch $@

.venv/installed-test: pyproject.toml constraints.txt | .venv/bin/python
	$(BIN)/pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[test]'
	touch $@ .venv/installed

.venv/installed-docs: pyproject.toml constraints.txt | .venv/bin/python
	$(BIN)/pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[docs]'
	touch $@ .venv/installed

.venv/installed-dev: pyproject.toml constraints.txt | .venv/bin/python
	$(BIN)/pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[test,dev,docs]'
	touch $@ .venv/installed .venv/installed-test .venv/installed-docs
