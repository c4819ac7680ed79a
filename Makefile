# Everything runs in a virtual environment under .venv, made on first use. PYTHON picks the interpreter:
# 3.11 brings Blender 4.5 LTS as the module bpy, 3.13 brings 5.2 LTS.
find_python = $(firstword $(foreach p,$(1),$(shell $(p) -c 'print("$(p)")' 2>/dev/null)))
PYTHON_311 := $(call find_python,python3.11 $(wildcard $(HOME)/.pyenv/versions/3.11.*/bin/python))
PYTHON_313 := $(call find_python,python3.13 $(wildcard $(HOME)/.pyenv/versions/3.13.*/bin/python))
PYTHON ?= $(firstword $(PYTHON_311) $(PYTHON_313) python3)

VERSION = $(shell $(PYTHON) -c 'import sys; print("%d.%d" % sys.version_info[:2])')
VENV = .venv/$(VERSION)
RUN = $(VENV)/bin/python

# Blender's own tool for extensions, which needs no Blender.
EXTENSION_TOOL = $(RUN) $(VENV)/lib/python*/site-packages/bpy/*/scripts/addons_core/bl_pkg/cli/blender_ext.py

# By the hashes of their files: what an index or a mirror serves otherwise is not installed.
INSTALL = $(RUN) -m pip install --quiet --disable-pip-version-check --require-hashes

.PHONY: demo pictures extension test test-all stress bench evidence lint lock three clean

demo: $(VENV)/runs
	$(RUN) scripts/demo.py --out out/demo

# Every picture of README and docs; those of Blender's window by the command that FMQM_SCREENSHOT names.
pictures: $(VENV)/runs
	$(RUN) scripts/pictures.py

# dist/fmqm-<version>.zip, to drop into Blender's window.
extension: $(VENV)/runs
	mkdir -p dist
	$(EXTENSION_TOOL) build --source-dir . --output-dir dist
	$(EXTENSION_TOOL) validate dist/fmqm-$$(sed -n 's/^version = "\(.*\)"/\1/p' blender_manifest.toml).zip

# The files go to as many processes as there are cores. ARGS="-n 0 -m program": one after the other.
test: $(VENV)/tests
	$(RUN) -m pytest -n auto --dist loadfile $(ARGS)

# Both Blender versions, as far as their Pythons are there; what takes long and depends on neither, once.
test-all:
	@test -n "$(PYTHON_311)$(PYTHON_313)" || { echo "neither Python 3.11 nor 3.13 found"; exit 1; }
	@if [ -n "$(PYTHON_311)" ]; then $(MAKE) test PYTHON=$(PYTHON_311); else echo "no Python 3.11: Blender 4.5 not tested"; fi
	@if [ -n "$(PYTHON_313)" ]; then $(MAKE) test PYTHON=$(PYTHON_313) $(if $(PYTHON_311),ARGS='-m "not once"'); else echo "no Python 3.13: Blender 5.2 not tested"; fi

# Minutes: hostile files under limits of memory and time, then runs that are killed at random and resumed. A part of it
# is in `make test`.
stress: $(VENV)/tests
	$(RUN) -m tests.stress.corpus
	$(RUN) -m tests.stress.kills $(or $(ROUNDS),50) $(SEED)

bench: $(VENV)/runs
	$(RUN) scripts/bench.py $(ARGS)

# docs/evidence.md and its plots, in at most an hour on two cores; goes on where it was stopped. FMQM_MODELS names the
# folder of the models that others made. ARGS=--smoke: a small one, which only shows that it runs.
evidence: $(VENV)/tests
	$(RUN) scripts/evidence.py $(ARGS)

lint: $(VENV)/tests
	$(VENV)/bin/ruff check .
	$(VENV)/bin/ruff format --check .
	$(VENV)/bin/mypy

$(VENV)/runs: requirements.txt
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info[:2] not in ((3, 11), (3, 13)))' || \
	  { echo "Python $(VERSION) has no bpy; make PYTHON=... with a Python 3.11 or 3.13 (with venv)"; exit 1; }
	test -x $(RUN) || $(PYTHON) -m venv $(VENV)
	$(INSTALL) -r requirements.txt
	@touch $@

$(VENV)/tests: requirements-dev.txt $(VENV)/runs
	$(INSTALL) -r requirements-dev.txt
	@touch $@

# requirements*.txt anew from requirements*.in, for both Pythons and every system; needs uv. The largest comes first and
# binds the others, so that all three agree. ARGS=--upgrade takes newer versions of what the .in files do not pin.
LOCK = uv pip compile --quiet --universal --python-version 3.11 --generate-hashes --no-header --no-annotate
lock:
	$(LOCK) $(ARGS) requirements-dev.in -o requirements-dev.txt
	$(LOCK) -c requirements-dev.txt requirements-cluster.in -o requirements-cluster.txt
	$(LOCK) -c requirements-dev.txt requirements.in -o requirements.txt

# three.js for the report's viewer, anew from its npm package at the version that scripts/three has locked; needs node.
three:
	npm --prefix scripts/three ci --ignore-scripts --silent
	npm --prefix scripts/three run --silent build -- --outfile=$(CURDIR)/fmqm_addon/report/html/viewer/three.js
	cd scripts/three && { node -p '"three.js " + require("./node_modules/three/package.json").version + "\n"'; cat node_modules/three/LICENSE; } \
	  > $(CURDIR)/fmqm_addon/report/html/viewer/three.LICENSE.txt

clean:
	rm -rf .venv out dist .pytest_cache .mypy_cache .ruff_cache .hypothesis
