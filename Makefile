# Everything happens in a virtual environment of its own. A target is made again only if its sources have changed.
PYTHON ?= python3
VENV ?= .venv
BIN := $(VENV)/bin
# A wheel to install instead of the checkout, for example to test it.
WHEEL ?=
# From the package index it takes a tenth of the processor time of pip.
UV = $(BIN)/uv pip install --quiet --python $(BIN)/python
# meson and ninja are found by name.
export PATH := $(abspath $(BIN)):$(PATH)
# Bytecode is kept, or each of the many processes that tests start would compile the package.
unexport PYTHONDONTWRITEBYTECODE

# An editable install rebuilds compiled code when cvtimg is imported; only these need a new install.
RECIPES := pyproject.toml meson.build meson.options cvtimg/meson.build

.PHONY: install demo test oldest lint docs man completions notebooks napari dist bench clean

install: $(VENV)/installed

$(VENV)/builds: pyproject.toml
	$(PYTHON) -m venv $(VENV)
	$(BIN)/pip install --quiet uv
	$(UV) "pip>=23.1" "meson-python>=0.17" "Cython>=3.1" meson ninja
	touch $@

ifdef WHEEL
$(VENV)/installed: $(VENV)/builds $(WHEEL)
	$(UV) --reinstall-package cvtimg $(WHEEL)
	touch $@
else
$(VENV)/installed: $(VENV)/builds $(RECIPES)
	$(UV) -r pyproject.toml
	$(BIN)/pip install --quiet --no-deps --no-build-isolation -Cbuild-dir=build -Csetup-args=-Dsimd=native --editable .
	touch $@
endif

$(VENV)/extra-%: $(VENV)/installed
	$(UV) -r pyproject.toml --extra $*
	touch $@

demo: $(VENV)/extra-plot
	$(BIN)/python sample_images/demo.py out

# The quick tests; TESTS=all runs the slow ones too.
TESTS ?= quick
test: $(VENV)/extra-test$(if $(filter all,$(TESTS)),-slow)
	$(BIN)/pytest -n auto --dist worksteal tests --pyargs cvtimg $(if $(filter all,$(TESTS)),,-m "not slow")

# The quick tests with the oldest versions that pyproject.toml allows. What these depend on is new, and deprecates them.
oldest:
	$(PYTHON) -m venv build/oldest
	build/oldest/bin/pip install --quiet uv
	build/oldest/bin/uv pip install --quiet --python build/oldest/bin/python --resolution lowest-direct ".[test]" "httpx>=0.27" "pyparsing>=3.1,<3.2"
	build/oldest/bin/pytest -n auto --dist worksteal tests -m "not slow" -W ignore::DeprecationWarning -W ignore::FutureWarning

lint: $(VENV)/extra-test $(VENV)/extra-lint
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/mypy sample_images
	$(BIN)/check-jsonschema --builtin-schema vendor.github-workflows .github/workflows/*.yml
	$(BIN)/zizmor --offline --quiet .github

# The site, build/site/index.html. Nothing is fetched, and a warning is an error.
docs: $(VENV)/extra-docs
	$(BIN)/python -m sphinx --fail-on-warning --keep-going --quiet --jobs auto --doctree-dir build/doctrees docs build/site

# A manual page per command.
man: $(VENV)/installed
	$(BIN)/python docs/_extensions/command_line.py build/man

# Completion files for packagers; users run cvtimg --install-completion SHELL.
completions: $(VENV)/installed
	mkdir -p build/completions
	$(BIN)/cvtimg --show-completion bash > build/completions/cvtimg.bash
	$(BIN)/cvtimg --show-completion zsh > build/completions/_cvtimg
	$(BIN)/cvtimg --show-completion fish > build/completions/cvtimg.fish

# A notebook per tutorial.
notebooks:
	$(PYTHON) docs/_extensions/notebooks.py build/notebooks

# The tests of the plugin for napari, which is large.
napari: $(VENV)/installed
	$(BIN)/pip install --quiet --editable "plugins/cvtimg-napari[plot,test]"
	QT_QPA_PLATFORM=offscreen $(BIN)/pytest plugins/cvtimg-napari

# The source archive of the last commit, and wheels of the checkout as it is for any glibc since 2.17: for all processors of
# this machine's kind, and for 64-bit ARM where Debian's cross compiler and emulator can be installed.
dist: $(VENV)/installed $(VENV)/extra-dist
	rm -rf dist build/wheels
	$(BIN)/python -c "import mesonpy; mesonpy.build_sdist('dist')"
	$(BIN)/pip wheel --quiet --no-deps --no-build-isolation -Cbuild-dir=build -Csetup-args=-Dsimd=all --wheel-dir build/wheels .
	PYTHON=$(BIN)/python .ci/arm64 build . build/arm64
	cp build/arm64/*.whl build/wheels 2>/dev/null || true # which has said why not
	$(BIN)/auditwheel repair --wheel-dir dist build/wheels/*.whl
	$(BIN)/twine check --strict dist/*

bench: $(VENV)/extra-bench
	$(BIN)/python benchmarks/quantization.py
	$(BIN)/python benchmarks/whole_process.py
	$(BIN)/python benchmarks/dithering.py
	$(BIN)/python benchmarks/scaling.py
	$(BIN)/python benchmarks/engine.py
	$(BIN)/python benchmarks/segmentation.py
	$(BIN)/python benchmarks/restoration.py
	$(BIN)/python benchmarks/plane.py --parts passes descents exact

clean:
	rm -rf .venv build dist out docs/generated
