# The commands of the project; the README says what they show. Needs git, make and Python 3.11 with venv.

SHELL := /bin/bash
# Debian's rospy is for Debian's Python, so that one is taken where it is new enough.
PYTHON := $(shell for p in /usr/bin/python3 python3; do $$p -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null && { echo $$p; break; }; done)
VENV := .venv
APARTMENT := $(VENV)/bin/apartment
PART ?= all
N ?= 0
SEED ?= 1

.PHONY: demo test soak bench lint check clean sbom audit system-packages

demo: $(VENV)/demo.stamp
	@$(APARTMENT) demo $(ARGS)

test: $(VENV)/dev.stamp system-packages
	$(if $(ARGS),$(VENV)/bin/python -m pytest $(ARGS),./.ci/tests $(VENV)/bin/python)

soak: $(VENV)/dev.stamp
	@$(VENV)/bin/python -m tests.soak --part $(PART) --turns $(N) --seed $(SEED)

bench: $(VENV)/dev.stamp
	@$(VENV)/bin/python -m tests.bench --part $(PART) $(ARGS)

lint: $(VENV)/dev.stamp
	$(VENV)/bin/ruff format --check .
	$(VENV)/bin/ruff check .
	$(VENV)/bin/mypy

# What runs, with versions, as CycloneDX; and what the package index knows against exactly these versions. From an
# installation of its own, so that no tool of ours is in the list.
sbom: build/product/stamp build/tools/stamp
	build/tools/bin/cyclonedx-py environment build/product --of JSON --output-reproducible -o build/sbom.cdx.json
	@echo build/sbom.cdx.json

audit: build/product/stamp build/tools/stamp
	build/product/bin/python -m pip freeze --exclude smart-apartment > build/product/versions.txt
	build/tools/bin/pip-audit --requirement build/product/versions.txt --no-deps --disable-pip --strict --progress-spinner off

build/product/stamp: pyproject.toml
	$(PYTHON) -m venv build/product
	build/product/bin/python -m pip install --quiet --disable-pip-version-check -e '.[embedded]'
	@touch $@

build/tools/stamp:
	$(PYTHON) -m venv build/tools
	build/tools/bin/python -m pip install --quiet --disable-pip-version-check 'cyclonedx-bom>=5' 'pip-audit>=2.7'
	@touch $@

# With root or sudo the Debian packages that the tests meet are installed; without, those tests say what they miss.
system-packages:
	@./.ci/system-packages

$(VENV)/bin/python:
	@test -n "$(PYTHON)" || { echo "Python 3.11 or newer is missing: apt-get install python3 python3-venv"; exit 1; }
	@$(PYTHON) -c 'import ensurepip, venv' 2>/dev/null || { echo "Python's venv is missing: apt-get install python3-venv"; exit 1; }
	@$(PYTHON) -m venv --system-site-packages $(VENV)

$(VENV)/demo.stamp: pyproject.toml | $(VENV)/bin/python
	@echo "Installing into $(VENV) ..."
	@$(VENV)/bin/python -m pip install --quiet --disable-pip-version-check -e '.[embedded]'
	@touch $@

$(VENV)/dev.stamp: pyproject.toml | $(VENV)/bin/python
	@echo "Installing into $(VENV) ..."
	@$(VENV)/bin/python -m pip install --quiet --disable-pip-version-check -e '.[dev]'
	@touch $@ $(VENV)/demo.stamp

clean:
	rm -rf $(VENV) build *.egg-info .pytest_cache .mypy_cache .ruff_cache .hypothesis
