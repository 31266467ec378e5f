# Two commands are enough: `make train TASK=II` and `make test`. Each sets up its own environment.
PYTHON ?= python3
VENV   := .venv
BIN    := $(VENV)/bin
STAMP  := $(VENV)/.ready-$(shell cat requirements.lock pyproject.toml | cksum | cut -d' ' -f1)

# Programs that JAX has compiled once are kept, as the tests keep theirs.
KEPT   := JAX_COMPILATION_CACHE_DIR=$(CURDIR)/.cache/jax JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS=0

TASK   ?= II
METHOD ?= all
AGENT  ?=
SCENES ?= rooms
SEEDS  ?=
FRAMES ?=
RUN    ?=
ARGS   ?=

.PHONY: help setup train evaluate test smoke lint bench paper notebooks lock clean
help:  ## Show this help.
	@grep -hE '^[a-z]+:.*##' Makefile | sed -E 's/:.*## /\t/' | expand -t 12

$(STAMP):
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "relm-irl-jax needs Python 3.11 or newer; give one with PYTHON=python3.11")'
	@test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	@echo "Installing the locked packages into $(VENV) (once) ..."
	@$(BIN)/python -m pip install -q --disable-pip-version-check --require-hashes -r requirements.lock
	@$(BIN)/python -m pip install -q --disable-pip-version-check --no-deps --no-build-isolation -e .
	@rm -f $(VENV)/.ready-* && touch $@

setup: $(STAMP)  ## Create .venv with the locked packages.

train: $(STAMP)  ## Train and evaluate: TASK=I|II|III METHOD= AGENT=siamese|metric SCENES= SEEDS= FRAMES= RUN= ARGS=.
	@$(BIN)/relm-irl train --task '$(TASK)' --methods '$(METHOD)' --scenes '$(SCENES)' \
	  $(if $(AGENT),--agent '$(AGENT)') $(if $(SEEDS),--seeds '$(SEEDS)') $(if $(FRAMES),--frames '$(FRAMES)') $(if $(RUN),--run '$(RUN)') $(ARGS)

evaluate: $(STAMP)  ## Evaluate a finished run on another task: RUN= TASK=.
	@$(BIN)/relm-irl evaluate '$(RUN)' --task '$(TASK)' $(ARGS)

test: $(STAMP)  ## Run the tests.
	@$(BIN)/python -m pytest $(ARGS)

smoke: $(STAMP)  ## Tiny rooms through every stage and every method.
	@$(BIN)/relm-irl train --config experiments/smoke.toml --task '$(TASK)' $(ARGS)

lint: $(STAMP)  ## Style and types.
	@$(BIN)/ruff check . && $(BIN)/ruff format --check . && $(BIN)/pyrefly check

bench: $(STAMP)  ## Benchmarks: BENCH=agent|scaling|elm|irl|encoder.
	@$(BIN)/relm-irl bench $(BENCH) $(ARGS)

paper: $(STAMP)  ## Every table and figure: PIECE=siamese|metric|metric-open|...|ablation|report VARIANT= QUICK=1 JOBS=.
	@$(KEPT) $(BIN)/python experiments/paper.py $(if $(PIECE),--pieces $(PIECE)) $(if $(VARIANT),--variants $(VARIANT)) $(if $(QUICK),--quick) $(if $(JOBS),--jobs $(JOBS)) $(ARGS)

notebooks: $(STAMP)  ## Run the notebooks of experiments/notebooks.
	@$(KEPT) $(BIN)/python -m pytest --nbmake --nbmake-timeout=300 -n0 -p no:cacheprovider experiments/notebooks

lock:  ## Resolve pyproject.toml into requirements.lock (needs uv).
	uv pip compile pyproject.toml --extra dev --universal --python-version 3.11 --generate-hashes \
	  --no-emit-index-url --no-emit-find-links --no-annotate --custom-compile-command "make lock" -o requirements.lock

clean:  ## Remove the environment and caches, never runs.
	rm -rf $(VENV) .cache .pytest_cache .ruff_cache .hypothesis
