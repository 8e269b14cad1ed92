# Every target does its own set-up: python3 >= 3.11, make and a package index are all it needs.
PYTHON ?= python3
VENV   := .venv
BIN    := $(VENV)/bin
RUN    := $(VENV)/.installed-run
STAMP  := $(VENV)/.installed
DOCS   := .venv-docs
PIP    := $(BIN)/python -m pip install --quiet --disable-pip-version-check

.DEFAULT_GOAL := help
.PHONY: help demo test test-fast coverage check bench docs wheel lock clean

help:            ## list the targets
	@grep -hE '^[a-z-]+:.*##' $(MAKEFILE_LIST) | sed 's/:.*##/\t/'

demo: $(RUN)     ## 60 s of a moving office, SLAM against odometry, a map and a film in out/demo/
	@$(BIN)/mobilia demo --overwrite

test: $(STAMP)   ## the whole test suite, on up to four cores; of one package: make test PKG=slam/tracker
	@$(BIN)/python -m pytest --numprocesses auto --maxprocesses 4 --dist loadfile --no-loadscope-reorder \
	  $(if $(PKG),tests/$(PKG))

test-fast: $(STAMP)  ## the quick half of it, a minute on two cores: no film, docs, fuzz, golden, slow; takes PKG too
	@$(BIN)/python -m pytest --numprocesses auto --maxprocesses 4 --dist loadfile --no-loadscope-reorder \
	  -m "not (slow or docs or film or fuzz or golden)" $(if $(PKG),tests/$(PKG))

coverage: $(STAMP)  ## the same suite with a table of the lines that no test runs; takes longer
	@$(BIN)/python -m pytest --numprocesses auto --maxprocesses 4 --dist loadfile --no-loadscope-reorder \
	  --cov --cov-report=term-missing

check: $(STAMP)  ## lint, format, spelling and strict types
	@$(BIN)/ruff check .
	@$(BIN)/ruff format --check .
	@$(BIN)/codespell mobilia slam sim scenes scripts tests docs .ci Makefile pyproject.toml *.md
	@$(BIN)/mypy

bench: $(RUN)    ## speed figures of this machine, as a table
	@$(BIN)/mobilia bench

docs: $(RUN) $(DOCS)/.installed  ## the site, in out/site; fails on a broken link and on anything loaded from elsewhere
	@$(BIN)/python -m scripts.site.replays out/replays
	@NO_MKDOCS_2_WARNING=1 $(DOCS)/bin/python -m mkdocs build --strict  # not --quiet: then it counts no warnings
	@$(DOCS)/bin/python -m scripts.site.check out/site
	@echo "Open out/site/index.html"

wheel: $(STAMP)  ## build dist/*.whl, try it in an empty virtual environment, print sizes
	@$(BIN)/hatchling build -t wheel
	@.ci/wheel $(PYTHON)

# Extras stay in the names: pip, with hashes, takes "coverage[toml]" for another package than "coverage".
lock: $(STAMP)   ## resolve the locks anew (versions and hashes, Python 3.11 to 3.14, no index address)
	@$(PIP) --require-hashes -r requirements-ci.lock  # uv
	@$(BIN)/uv pip compile --universal --python-version 3.11 --group dev --generate-hashes --no-strip-extras \
	  --no-header --no-annotate --upgrade --quiet pyproject.toml -o requirements.lock
	@cp requirements.lock requirements-run.lock  # the same versions, of what running needs
	@$(BIN)/uv pip compile --universal --python-version 3.11 --group build --generate-hashes --no-strip-extras \
	  --no-header --no-annotate --quiet pyproject.toml -o requirements-run.lock
	@$(BIN)/uv pip compile --universal --python-version 3.11 --group docs --generate-hashes --no-strip-extras \
	  --no-header --no-annotate --upgrade --quiet -o requirements-docs.lock
	@$(BIN)/uv pip compile --universal --python-version 3.11 --group ci -c requirements.lock --generate-hashes --no-strip-extras \
	  --no-header --no-annotate --upgrade --quiet -o requirements-ci.lock

clean:           ## remove the virtual environment, caches and outputs
	@rm -rf $(VENV) $(DOCS) out build dist .mypy_cache .ruff_cache .pytest_cache .hypothesis
	@find . -name __pycache__ -type d -prune -exec rm -rf {} +

# Says what is missing of Python itself.
define PYTHON_CHECKED
	@command -v $(PYTHON) >/dev/null 2>&1 || { echo "mobilia needs python3 (3.11 or newer): '$(PYTHON)' was not found. Set PYTHON=/path/to/python3."; exit 1; }
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { echo "mobilia needs Python 3.11 or newer, '$(PYTHON)' is $$($(PYTHON) -V 2>&1). Set PYTHON=/path/to/python3."; exit 1; }
	@$(PYTHON) -c 'import ensurepip, venv' 2>/dev/null || { echo "'$(PYTHON)' has no venv module: install it (Debian and Ubuntu: apt-get install python3-venv)."; exit 1; }
endef

# What running needs comes first and is all that the demo waits for; tests and linters come on top.
$(STAMP): $(RUN) requirements.lock
	@echo "Adding what tests need (once) ..."
	@$(PIP) --require-hashes -r requirements.lock
	@touch $(STAMP)

$(RUN): requirements-run.lock pyproject.toml
	$(PYTHON_CHECKED)
	@echo "Setting up $(VENV) (once) ..."
	@test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	@$(PIP) --require-hashes -r requirements-run.lock
	@$(PIP) --no-deps --no-build-isolation -e .
	@touch $(RUN)

# The site is made from the code as text: its tools need nothing of ours.
$(DOCS)/.installed: requirements-docs.lock
	$(PYTHON_CHECKED)
	@echo "Setting up $(DOCS) (once) ..."
	@test -x $(DOCS)/bin/python || $(PYTHON) -m venv $(DOCS)
	@$(DOCS)/bin/python -m pip install --quiet --disable-pip-version-check --require-hashes -r requirements-docs.lock
	@touch $@
