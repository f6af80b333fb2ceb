# Everything runs in a virtual environment of its own, from pinned versions. Only Python >= 3.11 and make are needed.
PYTHON ?= python3
VENV   ?= .venv
BIN    := $(VENV)/bin
OUT    ?= out
ifeq ($(OS),Windows_NT)
BIN    := $(VENV)/Scripts
endif
RUN    := $(BIN)/python -m
WORKERS ?= 2
PACKAGES := $(patsubst %/pyproject.toml,%,$(wildcard packages/*/pyproject.toml))
ABOVE  := $(filter-out packages/lanewise,$(PACKAGES))
DATA   := $(or $(MCKIBBEN_DATA),../shared/data)

.PHONY: demo plan wheel test slow validation lint docs firmware bench lock clean help

help: ## Say what can be made
	@sed -n 's/^\([a-z]*\):.*## /  make \1\t/p' Makefile | expand -t 20

demo: plan $(VENV)/.run ## Fit laws to measured force maps and reproduce the papers' numbers: a first picture at once, all in minutes
	@mkdir -p $(OUT)
	@printf '\n%s\n' "1. One law on one force map"
	$(RUN) mckibben fit DMSP-20-300 --law hyperelastic_braid --train-below "4 bar" --out $(OUT)/force-map.png
	@printf '%s\n' "Look at $(OUT)/force-map.png while the rest is computed."
	@printf '\n%s\n' "2. The papers, without what needs recordings"
	$(RUN) mckibben reproduce --no-recordings --out $(OUT)/reproduction
	@printf '\n%s\n' "3. Figure 3a and its numbers, from recordings"
	$(RUN) mckibben reproduce --figure 3a --out $(OUT)
	@printf '\n%s\n' "4. Every law on two force maps"
	$(RUN) mckibben fit DMSP-10-250 DMSP-20-300 --train-below "4 bar" --out $(OUT)/force-maps.html --out $(OUT)/force-maps.png
	@printf '%s\n' "" "Done. Look at" \
	  "  $(OUT)/force-map.png                        one law on one force map" \
	  "  $(OUT)/reproduction/reproduction.html       the papers' numbers and figures beside ours; .pdf says the same" \
	  "  $(OUT)/figure-3a.svg                        tension over length, as the simulated machine recorded it" \
	  "  $(OUT)/force-maps.html                      every law, ranked, and how far to trust it" \
	  "All of the papers, recordings and all, in a few minutes more: $(BIN)/mckibben reproduce --out $(OUT)/reproduction"

plan:
	@printf '%s\n' "On two cores this takes about three minutes:" \
	  "  0. the first time, everything is installed into $(VENV)               1 min" \
	  "  1. one law, fitted to a measured force map and drawn                 10 s" \
	  "  2. the papers: the numbers and figures that need no recordings       40 s" \
	  "  3. figure 3a of the paper, recorded on the simulated test machine    20 s" \
	  "  4. every law, fitted to two force maps and ranked                    60 s"

wheel: $(VENV)/.run ## Build wheels and source archives of all packages; call every command from wheels without extras
	$(BIN)/python tests/wheel/check.py

test: lint ## Run the whole suite
	$(RUN) pytest -n $(WORKERS) -m "not slow" tests packages/lanewise/tests
	for package in $(ABOVE); do $(RUN) pytest -n $(WORKERS) -m "not slow" $$package/tests || exit 1; done

slow: $(VENV)/.test ## Run the tests that take minutes
	$(RUN) pytest -n $(WORKERS) -m slow

validation: $(VENV)/.test ## Run all tests on measured data, which must be in the folder MCKIBBEN_DATA or in ../shared/data
	@test -d "$(DATA)" || { echo "No measured data: $(DATA) is no folder; name theirs in MCKIBBEN_DATA"; exit 2; }
	MCKIBBEN_DATA="$(DATA)" $(RUN) pytest -m validation -rA

lint: $(VENV)/.test ## Style, types and the import order
	$(RUN) ruff check --no-cache .
	$(RUN) ruff format --no-cache --check .
	$(RUN) mypy
	$(BIN)/lint-imports --no-logo

bench: $(VENV)/.test ## Measure speeds against C and other programs, a quarter of an hour on an idle machine
	$(BIN)/python benchmarks/suite.py
	$(BIN)/python benchmarks/felt.py --runs 3

docs: $(VENV)/.docs ## Build the documentation; its examples are executed
	$(BIN)/python docs/build.py

firmware: ## Build the firmware for Arduino Uno and STM32F405, and their emulators (the Debian packages: CONTRIBUTING.md)
	@if command -v avr-gcc >/dev/null; then $(MAKE) -C packages/mckibben-hardware/firmware uno emulator; \
	  else echo "No avr-gcc: the Arduino Uno is left out (Debian: gcc-avr avr-libc libsimavr-dev)."; fi
	@if command -v arm-none-eabi-gcc >/dev/null; then $(MAKE) -C packages/mckibben-hardware/firmware stm32f405 emulator-stm32f405; \
	  else echo "No arm-none-eabi-gcc: the STM32F405 is left out (Debian: gcc-arm-none-eabi libnewlib-arm-none-eabi)."; fi

lock: $(VENV)/.test ## Pin the versions anew
	$(RUN) pip install --quiet uv
	for set in run test docs; do $(RUN) uv pip compile --quiet --universal --no-emit-index-url --no-header \
	  --python-version 3.11 requirements/$$set.in -o requirements/$$set.txt || exit 1; done

clean: ## Remove what was made
	rm -rf $(VENV) $(OUT) site dist build

$(VENV)/bin/python $(VENV)/Scripts/python.exe:
	$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "mckibben needs Python 3.11 or newer; say which with make PYTHON=...")'
	$(PYTHON) -m venv $(VENV)

$(VENV)/.run: requirements/run.txt pyproject.toml $(wildcard packages/*/pyproject.toml)
	@$(MAKE) --no-print-directory $(VENV)/bin/python
	$(RUN) pip install --quiet --disable-pip-version-check -r requirements/run.txt
	$(RUN) pip install --quiet --disable-pip-version-check --no-deps --no-build-isolation $(PACKAGES:%=-e %) -e .
	@touch $@

$(VENV)/.test: requirements/test.txt $(VENV)/.run
	$(RUN) pip install --quiet --disable-pip-version-check -r requirements/test.txt
	@touch $@

$(VENV)/.docs: requirements/docs.txt $(VENV)/.run
	$(RUN) pip install --quiet --disable-pip-version-check -r requirements/docs.txt
	@touch $@
