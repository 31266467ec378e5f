# Two commands are enough: `make train TASK=II` and `make test`. Each sets up its own environment. `make help` lists the rest:
# what follows ## is what it says, with the variables that a target uses in brackets.
PYTHON ?= python3
VENV   := .venv
BIN    := $(VENV)/bin
DOCS   := $(VENV)-docs
STAMP  := $(VENV)/.ready-$(shell cat requirements.lock pyproject.toml | cksum | cut -d' ' -f1)

DOCS_STAMP := $(DOCS)/.ready-$(shell cksum < requirements-docs.lock | cut -d' ' -f1)

# Compiled programs are kept, in the folder in which the tests keep theirs.
KEPT   := JAX_COMPILATION_CACHE_DIR='$(CURDIR)/.cache/jax' JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS=0 \
          JAX_PERSISTENT_CACHE_MIN_ENTRY_SIZE_BYTES=-1
# Programs are optimised as for users; tests that train little save compiling time instead (tests/conftest.py).
FAST   := JAX_DISABLE_MOST_OPTIMIZATIONS=0

# A variable that is not given leaves the value of the configuration.
TASK    ?=  ## I, II or III: the task that is evaluated; II by default.
METHOD  ?=  ## all, or some of random, bc, rl, constant, irl, elm-irl, relm-irl, as in METHOD="rl irl".
AGENT   ?=  ## siamese, metric, map, recurrent or savn; by default all: siamese, and metric and map beside it.
SCENES  ?=  ## rooms for the built-in ones, or a folder of scene files.
SEEDS   ?=  ## Number of seeds.
FRAMES  ?=  ## Training frames for each method and seed: 5000000, 5e6, 5M or 600k.
RUN     ?=  ## Folder of the run, or of what bench and paper write.
BENCH   ?=  ## Some of commands, peers, trainings, gym, agent, scaling, elm, irl, encoder; all by default.
PIECE   ?=  ## Pieces of the paper: siamese, metric, ablation, report, ...; all by default.
VARIANT ?=  ## Variants of the pieces that have some; all by default.
QUICK   ?=  ## 1 for tiny rooms, few frames and seeds: whether everything runs, not what it finds.
JOBS    ?=  ## Runs of a study at a time; 1 by default.
ARGS    ?=  ## More options of the command, as in ARGS="--siamese.width 256"; for tests, of pytest.

.PHONY: help setup train evaluate report play test lowest slow chaos fuzz smoke lint bench paper tables weights notebook notebooks docs lock clean

# A variable on the command line that no target of it uses is refused. (help and refusals: .ci/makefile.py)
GIVEN   := $(sort $(foreach name,$(.VARIABLES),$(if $(filter command,$(origin $(name))),$(name))))
REFUSAL := $(if $(GIVEN),$(shell $(PYTHON) -IS .ci/makefile.py '$(or $(MAKECMDGOALS),help)' '$(GIVEN)'))
$(if $(REFUSAL),$(error $(REFUSAL)))

comma  := ,
several = $(subst $(comma), ,$($(1)))
option  = $(if $($(2)),--$(1) '$($(2))')
options = $(if $($(2)),--$(1) $(call several,$(2)))
needed  = $(or $($(1)),$(error make $@ needs $(1)=folder))
TRAIN   = $(call option,task,TASK) $(call options,methods,METHOD) $(call option,agent,AGENT) $(call option,scenes,SCENES) \
          $(call option,seeds,SEEDS) $(call option,frames,FRAMES) $(call option,run,RUN) $(ARGS)

help:  ## Show this help.
	@$(PYTHON) -IS .ci/makefile.py

$(STAMP):
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "relm-irl-jax needs Python 3.11 or newer; give one with PYTHON=python3.11")'
	@$(BIN)/python -c 'import pip' 2>/dev/null || $(PYTHON) -m venv $(VENV)
	@echo "Installing the locked packages into $(VENV) (once) ..."
	@$(BIN)/python -m pip install -q --disable-pip-version-check --require-hashes -r requirements.lock
	@$(BIN)/python -m pip install -q --disable-pip-version-check --no-deps --no-build-isolation -e .
	@rm -f $(VENV)/.ready-* && touch $@

setup: $(STAMP)  ## Create .venv with the locked packages.

train: $(STAMP)  ## Train agents and evaluate them on a task. [TASK METHOD AGENT SCENES SEEDS FRAMES RUN ARGS]
	@$(BIN)/relm-irl train $(TRAIN)

evaluate: $(STAMP)  ## Evaluate the agents of a run on a task. [RUN TASK ARGS]
	@$(BIN)/relm-irl evaluate '$(call needed,RUN)' $(call option,task,TASK) $(ARGS)

report: $(STAMP)  ## Write the report of a run again. [RUN ARGS]
	@$(BIN)/relm-irl report '$(call needed,RUN)' $(ARGS)

play: $(STAMP)  ## Watch an agent of a run; without RUN, walk yourself by keyboard. [RUN METHOD TASK ARGS]
	@$(BIN)/relm-irl play $(if $(RUN),'$(RUN)') $(call option,method,METHOD) $(call option,task,TASK) $(ARGS)

test: $(STAMP)  ## Run the tests, but for the slow ones. [ARGS]
	@$(BIN)/python -m pytest $(ARGS)

lowest:  ## Run the tests with the lowest versions that pyproject.toml allows (needs uv). [ARGS]
	@uv venv -q --clear --python $(PYTHON) $(VENV)-lowest
	@uv pip install -q --python $(VENV)-lowest --resolution lowest-direct -e '.[dev]'
	@$(VENV)-lowest/bin/python -m pytest $(ARGS)

slow: $(STAMP)  ## Run the slow tests: whole trainings. [ARGS]
	@$(FAST) $(BIN)/python -m pytest -m slow $(ARGS) || test $$? = 5  # pytest says 5 where no test is slow

chaos: $(STAMP)  ## End a run at many moments, continue it, and compare the results. [ARGS]
	@$(FAST) $(BIN)/python tests/chaos.py $(ARGS)

fuzz: $(STAMP)  ## Read thousands of damaged and absurd inputs. [ARGS]
	@$(BIN)/python tests/fuzz.py $(ARGS)

smoke: $(STAMP)  ## Train on tiny rooms, through every stage and method. [TASK METHOD AGENT SCENES SEEDS FRAMES RUN ARGS]
	@$(KEPT) $(BIN)/relm-irl train --config experiments/smoke.toml $(TRAIN)

lint: $(STAMP)  ## Check style and types.
	@$(BIN)/ruff check . && $(BIN)/ruff format --check . && $(BIN)/pyrefly check

bench: $(STAMP)  ## Measure speed on this machine. [BENCH RUN ARGS]
	@for name in $(or $(call several,BENCH),commands peers trainings gym agent scaling elm irl encoder); do \
	  $(BIN)/relm-irl bench $$name $(call option,out,RUN) $(ARGS) || exit; done

paper: $(STAMP)  ## Make every table and figure of the paper. [PIECE VARIANT QUICK JOBS RUN ARGS]
	@$(KEPT) $(BIN)/python experiments/paper.py $(call options,pieces,PIECE) $(call options,variants,VARIANT) \
	  $(if $(filter-out 0 no false,$(QUICK)),--quick) $(call option,out,RUN) $(call option,jobs,JOBS) $(ARGS)

tables: $(STAMP)  ## Write the tables of the documentation from docs/tables; with RUN, copy those of a study there first. [RUN]
	@$(BIN)/python experiments/docs_tables.py $(if $(RUN),'$(RUN)')

weights: $(STAMP)  ## Train the mapping agent's weights that come with the package. [ARGS]
	@$(BIN)/python experiments/map_weights.py $(ARGS)

notebooks: $(STAMP)  ## Run the notebooks of experiments/notebooks; ARGS=--overwrite saves their outputs. [ARGS]
	@$(KEPT) PYTHONWARNINGS='ignore:IProgress not found' $(BIN)/python -m pytest --nbmake --nbmake-timeout=300 -p no:cacheprovider $(ARGS) experiments/notebooks

notebook: $(STAMP)  ## Open the notebooks in Jupyter, which is installed into .venv if it is missing.
	@$(BIN)/python -c 'import jupyterlab' 2>/dev/null || $(BIN)/python -m pip install -q --disable-pip-version-check 'jupyterlab>=4,<5'
	@$(BIN)/python -m jupyterlab experiments/notebooks

$(DOCS_STAMP):
	@$(DOCS)/bin/python -c 'import pip' 2>/dev/null || $(PYTHON) -m venv $(DOCS)
	@$(DOCS)/bin/python -m pip install -q --disable-pip-version-check --require-hashes -r requirements-docs.lock
	@rm -f $(DOCS)/.ready-* && touch $@

docs: $(DOCS_STAMP)  ## Build the documentation site, site/index.html. [ARGS]
	@NO_MKDOCS_2_WARNING=1 $(DOCS)/bin/python -m mkdocs build --strict --clean $(ARGS)
	@echo "Documentation: site/index.html"

LOCK := --universal --python-version 3.11 --generate-hashes --no-emit-index-url --no-emit-find-links --no-annotate \
        --custom-compile-command "make lock"

lock:  ## Resolve pyproject.toml into requirements.lock and requirements-docs.lock (needs uv).
	uv pip compile pyproject.toml --extra dev $(LOCK) -o requirements.lock
	uv pip compile --group docs $(LOCK) -o requirements-docs.lock

clean:  ## Remove the environment and caches, never runs.
	rm -rf $(VENV) $(VENV)-lowest $(DOCS) site .cache .pytest_cache .ruff_cache .hypothesis
