# make train   set up .venv; train a steering policy, compare it with the fixed controllers, write the report
# make test    set up .venv; run the tests
# make test-lowest  run the tests that are not slow with the lowest versions that pyproject.toml allows
# make check   lint, format, types, import contracts (what CI and pre-commit run before the tests)
# make docs    build the documentation's site into site/; a link that leads nowhere is an error
# make bench   speed of every part on this machine, and how the fly walks beside the literature
# make format  let ruff rewrite what make check complains about
# make clean   remove .venv, .venv-lowest and caches; runs/ and reports/ stay

PYTHON ?= python3
VENV ?= .venv
VENV_LOWEST ?= .venv-lowest
ARGS ?=

BIN := $(VENV)/bin
INSTALLED := $(VENV)/.installed
INSTALLED_DEV := $(VENV)/.installed-dev
# without compiling every module: Python does that itself to the few that are imported
PIP_INSTALL := $(BIN)/python -m pip install --quiet --no-compile --constraint constraints.txt

.PHONY: train test test-lowest check docs bench format clean

train: $(INSTALLED)
	$(BIN)/python train.py experiment=main $(ARGS)

test: $(INSTALLED_DEV)
	$(BIN)/python -m pytest --numprocesses auto --dist worksteal $(ARGS)

# with a torch that is in that environment already, if there is one: see CONTRIBUTING.md
test-lowest:
	$(PYTHON) -m venv $(VENV_LOWEST)
	$(VENV_LOWEST)/bin/python -m pip install --quiet --no-compile \
		--constraint constraints-lowest.txt --editable '.[dev]'
	$(VENV_LOWEST)/bin/python -m pytest -m 'not slow and not network' \
		--numprocesses auto --dist worksteal $(ARGS)

check: $(INSTALLED_DEV)
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/mypy
	$(BIN)/lint-imports

docs: $(INSTALLED_DEV)
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --quiet --strict $(ARGS)

bench: $(INSTALLED)
	$(BIN)/python -m benchmarks.speed $(ARGS)
	$(BIN)/python -m benchmarks.walking

format: $(INSTALLED_DEV)
	$(BIN)/ruff check --fix
	$(BIN)/ruff format

clean:
	rm -rf $(VENV) $(VENV_LOWEST) build dist site .mypy_cache .pytest_cache .ruff_cache .import_linter_cache

$(BIN)/python:
	@$(PYTHON) -c 'import sys; sys.version_info >= (3, 11) or sys.exit("flyrl needs Python 3.11 or newer, but $(PYTHON) is " + sys.version.split()[0] + "; name another: make PYTHON=python3.12")'
	$(PYTHON) -m venv $(VENV)

$(INSTALLED): pyproject.toml constraints.txt | $(BIN)/python
	@echo "Installing flyrl and its dependencies into $(VENV) (once; some minutes)"
	$(PIP_INSTALL) --editable .
	touch $@

$(INSTALLED_DEV): $(INSTALLED)
	$(PIP_INSTALL) --editable '.[dev]'
	touch $@
