# make lsfd     back-analyse the Lower San Fernando dam: S_r, how sure, and what the other methods say
# make test     the fast tests, under 4 minutes on two processor cores
# make test-all the rest: the slow tests, and the property tests with more examples
# make test-numerics  the statistics once more, as other processors compute them, in random order
# make verify   the whole verification suite, with its pictures
# make docs     the documentation as a site with search: results/site/html/index.html
# make lint     the linters
# make clean    remove what tests and linters have left (neither results/ nor .venv)
#
# Each of them first makes .venv where it is missing, and brings it up to date where pyproject.toml
# or constraints.txt have changed, by uv where the machine has it, in half the time, else by pip
# alone. Another Python: make PYTHON=python3.12 test. Another place for the environment: make
# VENV=/somewhere/else test. Without uv all the same: make UV= test.

VENV ?= .venv
PYTHON ?= $(firstword $(foreach name,python3.11 python3.12 python3.13 python3,$(shell command -v $(name))))
EXTRAS := all,dev,docs
UV ?= $(shell command -v uv)
READY := $(VENV)/.flowslide-installed
# What `make lsfd` needs, in half the time, where not everything is there yet.
LSFD_EXTRAS := video,workflow
LSFD_READY := $(VENV)/.flowslide-installed-for-lsfd
# Compiled files are kept in the environment, also where Python is told to write none: a command is
# several processes, and each would compile all that it imports.
IN_VENV := PATH="$(abspath $(VENV))/bin:$$PATH" PYTHONDONTWRITEBYTECODE= \
  PYTHONPYCACHEPREFIX="$(abspath $(VENV))/pycache"

# What is never imported need not be compiled; Python compiles the rest when it is.
PIP = PYTHONWARNINGS=ignore "$(VENV)/bin/python" -m pip install --no-compile --disable-pip-version-check -c constraints.txt

# Counts the packages that pip names: each on a terminal, every twentieth in a log.
COUNT := /^(Collecting|Processing)/ { k++ } \
  /^(Collecting|Processing)/ && shown { printf "\r\033[K  package %d of about %d: %s", k, all, $$2; fflush() } \
  /^(Collecting|Processing)/ && !shown && k % 20 == 0 { printf "  package %d of about %d\n", k, all; fflush() } \
  /^Installing/ { printf "%s  unpacking %d packages\n", shown ? "\r\033[K" : "", k; fflush() }

# The pip that comes with a Python may be old, and takes twice the time.
BY_PIP = @$(PIP) --quiet pip setuptools && \
  { $(PIP) --progress-bar off --no-build-isolation --editable ".[$(EXTRAS)]" && touch "$@"; } | \
  awk -v shown="$$(test -t 2 && echo yes)" -v all="$(PACKAGES)" '$(COUNT)'

# torch by pip all the same: with CUDA or without is what pip is set up for on a machine.
BY_UV = @$(if $(findstring all,$(EXTRAS)),$(PIP) --quiet torch &&) \
  "$(UV)" pip install --quiet --python "$(VENV)/bin/python" -c constraints.txt setuptools && \
  "$(UV)" pip install $$(test -t 2 || echo --quiet) --python "$(VENV)/bin/python" \
    -c constraints.txt --no-build-isolation --editable ".[$(EXTRAS)]" && touch "$@"

# A worker has a core: what BLAS would start beside it, before the worker knows, only spins.
PYTEST = $(IN_VENV) OPENBLAS_NUM_THREADS=1 python -m pytest -n 2 --dist loadfile

.PHONY: lsfd test test-numerics test-all verify docs lint format install clean
.DELETE_ON_ERROR:

lsfd: $(firstword $(wildcard $(READY)) $(LSFD_READY))
	@echo "Back-analysis of the Lower San Fernando dam, about two minutes; log: results/logs/invert_lower_san_fernando.log"
	@$(IN_VENV) PYTHONPATH="rules/logging$${PYTHONPATH:+:$$PYTHONPATH}" snakemake --logger flowslide -- answer_lsfd
	@cat results/lower_san_fernando/inversion/summary.txt

test: $(READY)
	CPU_BUDGET_S=3 $(PYTEST) -rfEs

test-numerics: $(READY)
	$(IN_VENV) python -m tests.processors

# What `make test` has just run with few examples is run again with many, and nothing else twice.
# The longest files begin first (tests/conftest.py). SELECT="slow and not long": what pytest selects.
test-all: SELECT ?= slow or property
test-all: $(READY)
	HYPOTHESIS_PROFILE=large $(PYTEST) --no-loadscope-reorder -rfEsR --durations 30 -m "$(SELECT)"

verify: $(READY)
	$(IN_VENV) python -m benchmarks.verification

docs: $(READY)
	$(IN_VENV) python docs/build.py

lint: $(READY)
	$(IN_VENV) ruff check .
	$(IN_VENV) ruff format --check .
	$(IN_VENV) mypy --cache-dir results/mypy
	$(IN_VENV) snakefmt --check Snakefile rules

format: $(READY)
	$(IN_VENV) ruff format .
	$(IN_VENV) snakefmt Snakefile rules

install: $(READY)

$(READY): PACKAGES := 147
$(LSFD_READY): PACKAGES := 80
$(LSFD_READY): EXTRAS := $(LSFD_EXTRAS)
$(READY) $(LSFD_READY): pyproject.toml constraints.txt
	@test -n "$(PYTHON)" || { echo "error: no Python found: install Python 3.11, or give PYTHON=..."; exit 2; }
	@"$(PYTHON)" -c 'import sys; sys.exit(not (3, 11) <= sys.version_info[:2] < (3, 14))' || \
	  { echo "error: PYTHON=$(PYTHON): Python 3.11, 3.12 or 3.13 is needed"; exit 2; }
	@test -x "$(VENV)/bin/python" || { echo "making $(VENV)"; "$(PYTHON)" -m venv "$(VENV)"; }
	@echo "installing into $(VENV) (a minute or two the first time)"
	$(if $(UV),$(BY_UV),$(BY_PIP))
	@test "$@" -nt constraints.txt -a "$@" -nt pyproject.toml

# Where a Python is asked for, an environment of another one is not taken for it.
ifneq ($(origin PYTHON),file)
.PHONY: asked-python
$(READY) $(LSFD_READY): | asked-python
asked-python:
	@test ! -x "$(VENV)/bin/python" || { \
	  there=$$("$(VENV)/bin/python" --version); asked=$$("$(PYTHON)" --version); \
	  test "$${there%.*}" = "$${asked%.*}" || \
	  { echo "error: PYTHON=$(PYTHON): $(VENV) has $$there; remove it, or give another VENV=..."; exit 2; }; }
endif

clean:
	rm -rf results/test .pytest_cache .ruff_cache .hypothesis build flowslide.egg-info
	find . -name __pycache__ -type d -not -path "./$(VENV)/*" -prune -exec rm -rf {} +
