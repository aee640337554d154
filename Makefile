# The two commands: `make demo` and `make test`. Each sets up what is missing first.
ROBOT ?= biped
SCENARIO ?= demo
PRESET ?= release
# Two compilers at once need about 3 GB.
JOBS ?= $(shell nproc)
PYTHON := .venv/bin/python
STUDIES ?= $(notdir $(basename $(wildcard sim/scenarios/$(ROBOT)/studies/*.yaml)))
CPP = $$(find controller sim rollout tests -name '*.[ch]pp')

.PHONY: help setup peers bench-peers build programs test demo check check-asan check-tsan check-debug lint bench fuzz format lock clean studies

help:
	@echo "make demo    $(ROBOT) in scenario '$(SCENARIO)' over LCM: log, report, plots, verdict (ROBOT=..., SCENARIO=...)"
	@echo "make test    build, and every test"
	@echo "make check   lint, and the tests in debug, under address, undefined-behaviour and thread sanitizers"
	@echo "make bench   the benchmarks; make build; make format; make clean"
	@echo "make fuzz    100,000 random force QPs and as many byte strings, beside DAQP (PROBLEMS=..., BYTES=...)"
	@echo "make studies the studies of the README, which takes about an hour (TRIALS=... of each cell, STUDIES=...)"

setup:
	@setup/setup.sh

# The libraries that tests/peers compares the rigid-body core with.
peers: setup
	@setup/setup.sh peers

build: TARGET = all
programs: TARGET = programs
build programs: setup
	@cmake --preset $(PRESET) > build-$(PRESET).log 2>&1 || { cat build-$(PRESET).log; rm -f build-$(PRESET).log; exit 1; }
	@rm -f build-$(PRESET).log
	@cmake --build --preset $(PRESET) --parallel $(JOBS) --target $(TARGET)

test: build peers
	ctest --preset $(PRESET)
	$(PYTHON) -m pytest

demo: programs
	@.venv/bin/stance run --robot $(ROBOT) --scenario $(SCENARIO) --realtime

check: lint check-debug check-asan check-tsan

lint: setup
	.venv/bin/clang-format --dry-run -Werror $(CPP)
	.venv/bin/ruff check analysis tests
	.venv/bin/ruff format --check analysis tests
	.venv/bin/mypy

check-debug check-asan check-tsan: check-%:
	@$(MAKE) --no-print-directory build PRESET=$*
	ctest --preset $*

bench-peers: setup
	@setup/bench_peers.sh

bench: peers bench-peers
	@$(MAKE) --no-print-directory build
	@cmake --build --preset $(PRESET) --parallel $(JOBS) --target bench_force_qp bench_rigid_body
	build/release/bin/bench_force_qp
	build/release/bin/bench_rigid_body
	$(PYTHON) tests/bench/tick.py

PROBLEMS ?= 100000
BYTES ?= 100000
fuzz: bench-peers
	@cmake --preset $(PRESET) > /dev/null
	@cmake --build --preset $(PRESET) --parallel $(JOBS) --target fuzz_force_qp
	build/$(PRESET)/bin/fuzz_force_qp --problems $(PROBLEMS) --bytes $(BYTES)

# Every study, on seeds that no tuning has seen; the README's table is drawn from what they come to. TRIALS of each cell, else
# the studies' own. What was done is not done again.
SEED ?= 10000
studies: programs
	.venv/bin/stance campaign --robot $(ROBOT) --study $(STUDIES) $(addprefix --trials ,$(TRIALS)) --seed $(SEED) --keep 3 \
	  --output runs/studies --summary docs/studies.json --table README.md

format:
	.venv/bin/clang-format -i $(CPP)
	.venv/bin/ruff format analysis tests

# Resolves setup/*.in anew; needs `uv` and the network.
RESOLVE = uv pip compile --quiet --universal --python-version 3.11 --generate-hashes --no-emit-index-url \
  --no-emit-find-links --no-header --no-annotate
lock:
	$(RESOLVE) setup/python.in -o setup/python.lock
	$(RESOLVE) --constraints setup/python.lock setup/peers.in -o setup/peers.lock
	$(RESOLVE) --no-deps setup/bench.in -o setup/bench.lock

clean:
	rm -rf build runs
