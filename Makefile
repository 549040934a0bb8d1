# `make help` lists the targets. Everything is installed into .venv, nothing outside.

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
INSTALLED := $(VENV)/.lightproof-installed
DOCS_INSTALLED := $(VENV)/.lightproof-docs-installed
OUT := reports/out

# Set in many containers; here some hundred processes would compile 400 files each.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: help kernels wheel demo studies docs test test-all lint clean
.DEFAULT_GOAL := help

help: ## list these targets
	@echo 'lightproof: a ray tracer whose every image comes with its proof'
	@sed -n 's/^\([a-z-]*\):.*## /  make \1\t/p' Makefile | expand -t 27

kernels: $(INSTALLED) ## compile all kernels once, with all processors
	@$(BIN)/python -m renderer --compile

wheel: $(INSTALLED) ## build a wheel with compiled kernels for x86-64-v3 and -v4 (long)
	@$(BIN)/python build_wheel.py dist

demo: kernels ## render every scene in both renderers, draw the pages
	@$(BIN)/python -m reports scenes --out $(OUT)

studies: kernels ## measure every study (a night), draw the pages; goes on where it was
	@$(BIN)/python -m reports all --out $(OUT)

test: kernels ## the regression suite
	@$(BIN)/python -m pytest -n 2 --dist worksteal -m 'not slow'

test-all: kernels ## the suite with the longer comparisons
	@$(BIN)/python -m pytest -n 2 --dist worksteal

lint: $(INSTALLED) ## style, format, types, the import contract
	@$(BIN)/ruff check .
	@$(BIN)/ruff format --check .
	@$(BIN)/mypy
	@$(BIN)/lint-imports

docs: $(DOCS_INSTALLED) ## refresh what pages take from the code, build the site build/site
	@$(BIN)/python docs/lecture_lines.py
	@$(BIN)/python docs/draw_architecture.py
	@$(BIN)/python docs/draw_speed.py
	@$(BIN)/python docs/write_pages.py
	@$(BIN)/sphinx-build -c docs/site -b html -E -n -W --keep-going -q docs build/site
	@$(BIN)/python docs/browser/assemble.py build/site/browser $(if $(PYODIDE),--pyodide $(PYODIDE))
	@echo 'The site: build/site/index.html'

clean: ## remove what was made, except .venv and the caches in your home
	rm -rf $(OUT) build *.egg-info .pytest_cache .ruff_cache .mypy_cache \
	  .import_linter_cache .hypothesis
	find . -name __pycache__ -not -path './$(VENV)/*' -prune -exec rm -rf {} +

# The stamp is older than these two files when, and only when, an install is due.
$(INSTALLED): pyproject.toml constraints.txt
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { \
	  echo "lightproof needs Python 3.11 or newer, and $(PYTHON) is" \
	    "$$($(PYTHON) --version 2>&1). Name another: make PYTHON=python3.12 ..." >&2; \
	  exit 1; }
	@test -x $(BIN)/python || { echo 'Creating $(VENV)'; $(PYTHON) -m venv $(VENV); }
	@echo 'Installing lightproof and what it needs into $(VENV)'
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check \
	  --editable '.[harness,cluster,convert,dev]' --constraint constraints.txt
	@touch $@

# What builds the site; no other target needs it.
$(DOCS_INSTALLED): $(INSTALLED)
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check \
	  --editable '.[docs]' --constraint constraints.txt
	@touch $@
