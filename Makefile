# Needs python3 (3.11 or newer) and make; everything else goes into .venv here.
# With a C compiler and Python's headers, runs are compiled; without, they are slow.
PYTHON ?= python3
BIN := .venv/bin
unexport PYTHONDONTWRITEBYTECODE  # the tests start hundreds of processes, which would compile each module anew

# pip would compile each module of each package; Python compiles those that it imports, when it does
PIP := $(BIN)/python -m pip install --quiet --disable-pip-version-check --no-compile
# what an extra needs, and the package: an installation of the package itself would build the kernel again
NEEDS := $(BIN)/python -c 'import sys, tomllib; p = tomllib.load(open("pyproject.toml", "rb"))["project"]; print(*p["dependencies"], *p["optional-dependencies"][sys.argv[1]], sep="\n")'

SOURCES := setup.py $(wildcard hapticclay/formulas/*.p* hapticclay/kernel/*.p*)
KERNEL := hapticclay/native/built.py

.PHONY: demo test sanitize coverage check docs pages linkcheck bench build release clean
.DELETE_ON_ERROR:

.venv/run.done: pyproject.toml
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "hapticclay needs Python 3.11 or newer, this is %s" % sys.version.split()[0])'
	$(PYTHON) -m venv .venv
	$(PIP) -e .
	@touch $@

# what the installation compiled, again if its sources are newer
$(KERNEL): $(SOURCES) | .venv/run.done
	@[ -z "$$(find $(SOURCES) -newer $@ 2>&1)" ] || $(PIP) --no-deps -e .
	@touch $@

.venv/dev.done: .venv/run.done
	$(NEEDS) dev >.venv/dev.txt
	$(PIP) -r .venv/dev.txt
	@touch $@

demo: $(KERNEL)  ## set up, run the constant cut, reproduce the paper, say where plots and report are
	$(BIN)/hapticclay run constant
	$(BIN)/hapticclay reproduce --quick
	@echo "plots: $(CURDIR)/out/run/constant/velocity.png $(CURDIR)/out/run/constant/force.png"

test: .venv/dev.done $(KERNEL)  ## set up and run all tests, on all cores
	$(BIN)/python -m pytest --durations=20

sanitize: .venv/dev.done  ## the kernel's tests of bits, compiled to find wrong addresses and undefined behaviour
	.ci/sanitize $(BIN)/python

coverage: .venv/dev.done $(KERNEL)  ## the same but what tracing disturbs, and which lines they reach: out/coverage/index.html
	$(BIN)/python -m pytest -m "not perf and not untraced" --cov --cov-report=term --cov-report=html:out/coverage --cov-report=xml:out/coverage/coverage.xml

check: .venv/dev.done  ## lint, types, layers
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/pyright
	$(BIN)/lint-imports --no-cache

.venv/docs.done: .venv/dev.done
	$(NEEDS) docs >.venv/docs.txt
	$(PIP) -r .venv/docs.txt
	@touch $@

docs: .venv/docs.done $(KERNEL)  ## the site, examples run, warnings are errors: out/docs/index.html
	$(BIN)/python -m sphinx -E -W --keep-going -q docs out/docs

pages: .venv/docs.done $(KERNEL)  ## the same without the pictures of the examples, which the tests run
	$(BIN)/python -m sphinx -E -W --keep-going -q -D plot_gallery=0 docs out/pages

linkcheck: .venv/docs.done  ## follow the links of the site to other sites
	$(BIN)/python -m sphinx -W --keep-going -q -b linkcheck docs out/linkcheck

bench: .venv/dev.done $(KERNEL)  ## error against run time, stiff and extreme scenes, throughput: one page in out/bench
	$(BIN)/hapticclay bench --quick

build: .venv/dev.done  ## wheel and sdist into dist/
	$(BIN)/python -m build --quiet

release: .venv/dev.done $(KERNEL)  ## the same, if the published benchmarks were measured on this code
	$(BIN)/hapticclay bench --check --out docs/bench
	$(MAKE) build

clean:
	rm -rf .venv out dist build hapticclay/native docs/gallery
