# A fresh machine needs make and python3 (3.11 or newer); `make help` lists what can be made.
# Extra arguments: make run ARGS="--port 9000", make test ARGS="-k cusum".

PYTHON ?= python3
VENV   := .venv
BIN    := $(VENV)/bin
READY  := $(VENV)/.ready
ARGS   ?=
PAGE   := service/web/static/index.html

# One thread for each process: on small matrices threaded BLAS only costs, and timings scatter.
export OPENBLAS_NUM_THREADS := 1
export OMP_NUM_THREADS := 1
export MKL_NUM_THREADS := 1
export NUMBA_NUM_THREADS := 1
export PIP_DISABLE_PIP_VERSION_CHECK := 1

.DEFAULT_GOAL := help
.PHONY: help run test bench soak lint format docs screenshots lock audit image image-test clean

help: ## list the targets
	@awk -F ':.*## ' '/^[a-z-]+:.*## / {printf "  make %-11s %s\n", $$1, $$2}' $(MAKEFILE_LIST)

run: $(READY) $(PAGE) ## start the demo: a simulated robot on an embedded bus, dashboard in the browser
	@$(BIN)/axiswatch demo $(ARGS)

test: $(READY) $(PAGE) ## everything that CI checks: lint, tests, tests on real SocketCAN devices
	@tools/install-test-packages.sh
	@tools/run-tests.sh $(ARGS)

bench: $(READY) $(PAGE) ## measure: kernel, compile time, daemon, commissioning, the paper's figures (half an hour)
	@$(BIN)/python -m pytest -m bench tests/bench $(ARGS)

soak: $(READY) $(PAGE) ## the long runs with a fresh seed (some hours; ARGS="-k mismatch" chooses)
	@AXISWATCH_SOAK=1 AXISWATCH_SEED=$${AXISWATCH_SEED:-$$($(PYTHON) -c 'import secrets; print(secrets.randbits(32))')} \
	  $(BIN)/python -m pytest -m "soak and not vcan" tests $(ARGS)

lint: $(READY) ## ruff and mypy
	@$(BIN)/ruff check .
	@$(BIN)/ruff format --check .
	@$(BIN)/mypy

format: $(READY) ## let ruff correct what it can
	@$(BIN)/ruff check --fix .
	@$(BIN)/ruff format .

docs: $(READY) ## write the generated part of docs/ (API schema, figures), if docs/build.py is there
	@if [ -f docs/build.py ]; then $(BIN)/python -m docs.build $(ARGS); \
	else echo "docs/build.py is not there: nothing is generated"; fi

screenshots: $(READY) $(PAGE) ## take the pictures of the dashboard in docs/pictures, of the demo (some minutes)
	@$(BIN)/python -m docs.screenshots

lock: $(READY) ## pin again: newest versions that pyproject.toml admits, for every Python and platform
	@tools/lock.sh $(ARGS)

audit: ## known vulnerabilities of the locked packages, where PyPI can be reached
	@tools/audit.sh $(ARGS)

image: ## build the container image with docker or buildah
	@tools/build-image.sh $(ARGS)

image-test: ## build the image with buildah and try it: size, demo on a read-only root (root; some minutes)
	@tools/test-image.sh $(ARGS)

clean: ## remove the environment, caches and builds
	rm -rf $(VENV) service/web/static service/web/dashboard/node_modules .cache .hypothesis .benchmarks .ruff_cache dist build
	find . -name __pycache__ -type d -prune -exec rm -rf {} +

# The environment follows the lock; hashes are checked. Editable: the sources here are what runs.
$(READY): pyproject.toml requirements.lock
	@command -v $(PYTHON) >/dev/null || { echo "$(PYTHON) not found: install Python 3.11 or newer" >&2; exit 1; }
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { \
	  echo "$(PYTHON) is $$($(PYTHON) -V): axiswatch needs 3.11 or newer (make PYTHON=python3.12 ...)" >&2; exit 1; }
	@$(PYTHON) -c 'import ensurepip, venv' 2>/dev/null || { \
	  echo "$(PYTHON) cannot make virtual environments; on Debian: apt-get install python3-venv" >&2; exit 1; }
	@echo "setting up $(VENV) from requirements.lock"
	@$(PYTHON) -m venv $(VENV)
	@$(BIN)/python -m pip install --quiet --no-compile --require-hashes -r requirements.lock
	@[ -e $(PAGE) ] || echo "building the dashboard: some ten seconds"
	@$(BIN)/python -m pip install --quiet --no-deps --no-build-isolation -e .
	@# What pip would do with one processor; else three processes of the first start do it at once.
	@$(BIN)/python -m compileall -qq -j 0 -x '/tests?/' $(VENV)/lib monitor_core service || true
	@touch $@

# The editable install above has built the dashboard; when its sources change, it is built again.
$(PAGE): $(shell git ls-files service/web/dashboard service/reports/templates/tokens.css 2>/dev/null) hatch_build.py docs/openapi.json | $(READY)
	@echo "building the dashboard: some ten seconds"
	@$(BIN)/python hatch_build.py
