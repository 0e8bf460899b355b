# Everything happens in a virtual environment of its own. A target is made again only when what it is made of changed.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
# meson and ninja are found by name.
export PATH := $(CURDIR)/$(BIN):$(PATH)

SOURCES := pyproject.toml meson.build cvtimg/meson.build $(wildcard cvtimg/*.py cvtimg/*.pyi cvtimg/*.pyx cvtimg/*.h cvtimg/*/*.py)

.PHONY: install demo test lint bench clean

install: $(VENV)/installed

$(VENV)/builds: pyproject.toml
	$(PYTHON) -m venv $(VENV)
	$(BIN)/pip install --quiet --upgrade pip
	$(BIN)/pip install --quiet "meson-python>=0.17" "Cython>=3.1" meson ninja
	touch $@

# Built in build/, so that only what changed is compiled again.
$(VENV)/installed: $(VENV)/builds $(SOURCES)
	$(BIN)/pip install --quiet --no-build-isolation -Cbuild-dir=build .
	touch $@

$(VENV)/extra-%: $(VENV)/installed
	$(BIN)/pip install --quiet --no-build-isolation -Cbuild-dir=build ".[$*]"
	touch $@

demo: $(VENV)/installed
	$(BIN)/python sample_images/demo.py out

test: $(VENV)/extra-test
	$(BIN)/pytest
	$(BIN)/pytest --doctest-modules --pyargs cvtimg

lint: $(VENV)/extra-test $(VENV)/extra-lint
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/mypy sample_images

bench: $(VENV)/extra-bench
	$(BIN)/python benchmarks/quantization.py
	$(BIN)/python benchmarks/whole_process.py
	$(BIN)/python benchmarks/dithering.py
	$(BIN)/python benchmarks/kernels.py
	$(BIN)/python benchmarks/engine.py
	$(BIN)/python benchmarks/segmentation.py
	$(BIN)/python benchmarks/restoration.py

clean:
	rm -rf $(VENV) build dist out
