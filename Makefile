# Two targets are all that a newcomer needs, and each builds .venv by itself:
#   make demo   a heading from the shipped recording, report in out/ (small install, no PyTorch)
#   make test   all extras, then the tests (`make fast`: the quick ones; `make long`: the hours before a release)
# Another interpreter: make demo PYTHON=python3.12

PYTHON ?= python3
BIN := .venv/bin
PIP := $(BIN)/python -m pip install --quiet --disable-pip-version-check --constraint constraints.txt
EXTRAS := report,learned,train,io,r,live,scale,dev
comma := ,
DEMO := examples/data/demo.npz
# The limit of the small install, in MB (`make demo` on its own, before `make test`).
DEMO_SIZE_LIMIT := 450

.DELETE_ON_ERROR:
.PHONY: browser demo test fast long check examples docs outputs pictures notebooks readme demo-recording size release-check oldest audit constraints lock sbom clean

demo: .venv/.demo
	@mkdir -p out
	$(BIN)/gyronorth heading $(DEMO) --sensor sdc500 --plot out/demo.png --report out/demo.html
	@echo "The report is in out/demo.html"

# The tests start some 200 processes. Each would compile its libraries again where Python may not keep what it compiles.
# A file stays with one worker: what its fixtures make and what it alone imports is made once.
PYTEST := env -u PYTHONDONTWRITEBYTECODE $(BIN)/python -m pytest -n 2 --dist loadfile

test: .venv/.all
	$(PYTEST)

# What the two-minute loop of development runs.
fast: .venv/.all
	$(PYTEST) -m "not slow"

# Statistics of many runs, soaks and trainings: before every release, and by whoever touches what they judge.
# Its results go to the page on testing, also those of a part (`make long TESTS=tests/readers`).
long: .venv/.all
	$(PYTEST) -m long --junitxml out/long.xml $(TESTS); code=$$?; $(BIN)/python docs/long_runs.py out/long.xml; exit $$code

# Chromium from Debian, for the tests of the live page; without it they are skipped, but fail in CI.
browser:
	@command -v chromium > /dev/null || { apt-get update -qq && \
	DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends chromium > /dev/null; }
	@chromium --version

# The hooks of .pre-commit-config.yaml on every file: the same list at a commit and in CI.
check: .venv/.all
	$(BIN)/pre-commit run --all-files --show-diff-on-failure

examples: .venv/.all
	@mkdir -p out
	@for example in examples/[0-9]*.py; do echo "--- $$example"; $(BIN)/python $$example || exit 1; done

docs: .venv/.all
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict --quiet

# What the commands on the pages print, and the pictures of the pages.
outputs: .venv/.all
	$(BIN)/python docs/make_outputs.py

pictures: .venv/.all
	$(BIN)/python docs/make_pictures.py

# The notebooks of examples/, from the scripts beside them, with what they print and draw.
notebooks: .venv/.all
	$(BIN)/python docs/make_notebooks.py

# The table, the picture and the demo's answer in README.md, from their seeds.
readme: .venv/.all
	$(BIN)/python docs/make_readme.py

demo-recording: .venv/.demo
	$(BIN)/gyronorth simulate --sensor sdc500 --latitude 32.11 --heading 40 --roll 1.5 --pitch -0.8 \
		--duration 100 --rate 50 --seed 1 -o $(DEMO) --force

# Meaningful after `make demo` alone: once the test extras are in, there is nothing to check.
size:
	@if [ -e .venv/.all ]; then echo "size: skipped, all extras are installed"; else \
	size=$$(du -sm .venv | cut -f1); echo "size of .venv: $$size MB, limit $(DEMO_SIZE_LIMIT) MB"; \
	[ "$$size" -le $(DEMO_SIZE_LIMIT) ]; fi

# What a release needs: built twice with one result, checked, installed in fresh environments of every Python here.
release-check: .venv/.all
	$(BIN)/python packaging/release_check.py

# The fast tests with the lower bounds of pyproject.toml, in an environment of their own, beside the oracles that run on them.
# Old packages warn of newer Pythons; tests that repeat a seed's figures run only with the pinned numpy. Left out is what
# needs PyTorch or the page, and what compares with the pinned packages: what they load, and schemas that they generate.
OLDEST := numpy==1.26.0 scipy==1.15.0 typer==0.17.5 rich==13.7.0 pydantic==2.7.0 matplotlib==3.8.0 jinja2==3.1.0 h5py==3.11.0 pyarrow==17.0.0 rosbags==0.11.0 mcap==1.6.0 openpyxl==3.1.0 zstandard==0.22.0 onnxruntime==1.18.0 pymseed==1.0.0 rdata==1.0
ORACLES := allantools ahrs python-ins
WITH_TORCH := tests/live tests/learn tests/frames tests/docs tests/test_docs.py tests/studies/test_networks.py tests/studies/test_paper.py
WITH_PINS := tests/cli/test_conversion.py::test_a_heading_loads_neither_models_nor_formats_it_does_not_need \
	tests/test_arrays.py::test_a_short_heading_loads_no_more_than_it_needs \
	tests/test_schemas.py::test_the_files_are_those_of_the_types tests/test_imports.py::test_imports_go_one_way
oldest:
	rm -rf out/oldest && mkdir -p out && python3.11 -m venv out/oldest
	out/oldest/bin/pip install -q $(OLDEST) -e ".[report,io,learned,r]" $(ORACLES) hatchling pytest pytest-xdist pytest-benchmark hypothesis jsonschema pynmeagps pyyaml
	out/oldest/bin/python -m pytest -q -n 2 -m "not slow and not long" -o filterwarnings=default \
		$(WITH_TORCH:%=--ignore=%) $(WITH_PINS:%=--deselect=%)

# Known vulnerabilities of the pinned packages. Needs a vulnerability service on the network, so CI does not run it.
audit: .venv/.all
	$(BIN)/pip-audit --strict --requirement constraints.txt --no-deps --disable-pip

# New pins: everything resolved afresh in a throw-away environment.
constraints:
	rm -rf out/constraints-venv && mkdir -p out && $(PYTHON) -m venv out/constraints-venv
	out/constraints-venv/bin/pip install --quiet hatchling editables "torch==2.13.0" ".[$(EXTRAS)]"
	(sed '/^#/!d' constraints.txt; out/constraints-venv/bin/pip freeze --exclude gyronorth | sed 's/+cpu$$//') > out/constraints.txt
	mv out/constraints.txt constraints.txt && rm -rf out/constraints-venv

# The same pins with the checksum of every file, for `pip install --require-hashes -r requirements.lock`.
USERS := $(filter-out dev,$(subst $(comma), ,$(EXTRAS)))
lock:
	rm -rf out/lock-venv && mkdir -p out && $(PYTHON) -m venv out/lock-venv
	out/lock-venv/bin/pip install --quiet "uv==0.13.9"
	out/lock-venv/bin/uv pip compile --quiet --universal --generate-hashes --no-annotate --no-header \
		--python-version 3.11.5 --constraint constraints.txt $(USERS:%=--extra %) pyproject.toml -o out/requirements.lock
	(sed '/^#/!d' requirements.lock; cat out/requirements.lock) > out/lock && mv out/lock requirements.lock
	rm -rf out/lock-venv out/requirements.lock

# What the program brings along, as CycloneDX: every package of requirements.lock with its checksums.
sbom:
	rm -rf out/sbom-venv && mkdir -p out && $(PYTHON) -m venv out/sbom-venv
	out/sbom-venv/bin/pip install --quiet "cyclonedx-bom==7.5.0"
	out/sbom-venv/bin/cyclonedx-py requirements --pyproject pyproject.toml --output-reproducible -o out/sbom.json requirements.lock
	rm -rf out/sbom-venv
	@echo "The list is in out/sbom.json"

.venv/bin/python:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "Python 3.11 or newer is needed; give one with PYTHON=..., found " + sys.version)'
	$(PYTHON) -m venv .venv

# --no-compile: Python compiles what it imports; compiling everything costs 96 MB of the small install.
.venv/.demo: pyproject.toml constraints.txt | .venv/bin/python
	$(PIP) --no-compile hatchling editables
	$(PIP) --no-compile --no-build-isolation --editable ".[report,learned]"
	@touch $@

.venv/.all: .venv/.demo
	$(PIP) --no-build-isolation --editable ".[$(EXTRAS)]"
	$(BIN)/python -m compileall -q -j 0 $$($(BIN)/python -c 'import sysconfig; print(sysconfig.get_path("purelib"))') > /dev/null || true
	@touch $@

clean:
	rm -rf .venv out site dist build
