# `make help` lists the targets. Everything is installed into .venv, nothing outside.

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
INSTALLED := $(VENV)/.lightproof-installed
OUT := reports/out

# Set in many containers; here some hundred processes would compile 400 files each.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: help kernels wheel demo proof proof-full limits resilience scaling test test-all lint \
  format bench bench-accelerators charts needs soak keep history clean
.DEFAULT_GOAL := help

help: ## list these targets
	@echo 'lightproof: a ray tracer whose every image comes with its proof'
	@sed -n 's/^\([a-z-]*\):.*## /  make \1\t/p' Makefile | expand -t 27

kernels: $(INSTALLED) ## compile all kernels once, with all processors
	@$(BIN)/python -m renderer --compile

wheel: $(INSTALLED) ## build a wheel with compiled kernels for x86-64-v3 and -v4 (long)
	@$(BIN)/python build_wheel.py dist

demo: kernels ## render every scene in both renderers, write the HTML page
	@$(BIN)/python -m reports --no-accelerators --no-proof --out $(OUT)

proof: $(INSTALLED) ## replay and test every scene, write what it proves as a page
	@$(BIN)/python -m reports.proof --out $(OUT)

proof-full: $(INSTALLED) ## the same with the mutation matrix and false alarms (long)
	@$(BIN)/python -m reports.proof --mutations --false-alarms --out $(OUT)

limits: $(INSTALLED) ## measure where methods fail, both sides, write the page
	@$(BIN)/python -m reports.limits --out $(OUT)

resilience: $(INSTALLED) ## kill a render, resume it on a cluster, compare the files
	@$(BIN)/python -m reports.resilience

test: kernels ## the regression suite
	@$(BIN)/python -m pytest -n 2 --dist worksteal -m 'not slow'

test-all: kernels ## the suite with the longer comparisons
	@$(BIN)/python -m pytest -n 2 --dist worksteal

lint: $(INSTALLED) ## style, format, types, the import contract
	@$(BIN)/ruff check .
	@$(BIN)/ruff format --check .
	@$(BIN)/mypy
	@$(BIN)/lint-imports

format: $(INSTALLED) ## let ruff mend what it can; lines and picture of the docs
	@$(BIN)/ruff check --fix .
	@$(BIN)/ruff format .
	@$(BIN)/python docs/lecture_lines.py
	@$(BIN)/python docs/draw_architecture.py

bench: $(INSTALLED) ## measure speed against Mitsuba, in turn, on two scenes
	@$(BIN)/python -m reports.benchmark --out $(OUT)
	@$(BIN)/python -m reports.benchmark --scene rough-materials --no-cold \
	  --out $(OUT)/materials

bench-accelerators: $(INSTALLED) ## measure every accelerator, with Embree beside them (long)
	@$(BIN)/python -m reports.accelerators --full --out $(OUT)

charts: $(INSTALLED) ## measure seconds against error of all contenders, write the page
	@$(BIN)/python -m reports.speed_accuracy --out $(OUT)

scaling: $(INSTALLED) ## measure clusters against threads, simulate up to 1000 workers
	@$(BIN)/python -m reports.scaling --out $(OUT)

needs: $(INSTALLED) ## measure what each scene needs, write needs.html (long)
	@$(BIN)/python -m reports.needs all --out $(OUT)

soak: $(INSTALLED) ## look for what is rare, an hour a trial; goes on from run to run
	@$(BIN)/python -m reports.soak --out $(OUT)

keep: $(INSTALLED) ## copy what was measured whole to reports/measured, to be committed
	@$(BIN)/python -m reports.history --keep --out $(OUT)

history: $(INSTALLED) ## draw how the records in reports/measured changed over commits
	@$(BIN)/python -m reports.history --out $(OUT)

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
	  --editable '.[harness,cluster,dev]' --constraint constraints.txt
	@touch $@
