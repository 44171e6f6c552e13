# Everything goes through .venv, which the first target that needs it makes.
#
#   make bench [SUITE=demo]   set up, run a suite, say where its report is
#   make test                 set up, run the tests
#   make check                the tests, and lint, format, types
#   make gate                 run the smoke suite and compare it with the committed baseline

SUITE ?= demo
PYTHON ?= python3
BIN := .venv/bin

.DEFAULT_GOAL := help
.PHONY: help bench test check lint gate clean

help:
	@sed -n 's/^#   //p' Makefile

bench: .venv/installed
	$(BIN)/graycard bench $(SUITE) --out runs/$(SUITE)

test: .venv/installed-test
	$(BIN)/python -m graycard.methods.splat.warm
	$(BIN)/python -m pytest -n auto --cov --cov-report=term-missing:skip-covered --durations=25

check: lint test

lint: .venv/installed-dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/pyright

gate: .venv/installed
	$(BIN)/graycard bench smoke --out runs/smoke
	$(BIN)/graycard gate runs/smoke --baseline benchmarks/baselines/smoke.json

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

.venv/installed-dev: pyproject.toml constraints.txt | .venv/bin/python
	$(BIN)/pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[test,dev]'
	touch $@ .venv/installed .venv/installed-test
