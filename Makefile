# One command each; every target sets up what it needs first and does nothing where nothing changed.
PYTHON ?= python3
BIN := .venv/bin
INSTALLED := .venv/.installed
DEVELOPED := .venv/.developed
CONSTRAINTS := constraints.txt
PYTEST := $(BIN)/pytest $(if $(CI),--forbid-skipped=postgis --forbid-skipped=browser)

.DEFAULT_GOAL := help
.PHONY: help demo test test-all check format-check lint types contracts format figures schemas readme system-tools clean

help: ## this list
	@grep -hE '^[a-z-]+:.*## ' $(MAKEFILE_LIST) | sed -E 's/^([a-z-]+):.*## /\1\t/' | expand -t 14

demo: $(INSTALLED) ## a simulated campus from raw logs to a georeferenced map, with a report
	$(BIN)/trigpoint demo --out demo
	@echo "report: $(CURDIR)/demo/report.html"

test: $(DEVELOPED) system-tools ## all tests except the slow ones
	$(PYTEST) -m "not slow"

test-all: $(DEVELOPED) system-tools ## all tests
	$(PYTEST)

check: format-check lint types contracts test ## format, lint, types, import contracts, tests and wheel

format-check: $(DEVELOPED)
	$(BIN)/ruff format --check

lint: $(DEVELOPED)
	$(BIN)/ruff check

types: $(DEVELOPED)
	$(BIN)/mypy

contracts: $(DEVELOPED)
	$(BIN)/lint-imports

format: $(DEVELOPED) ## code and imports put in order
	$(BIN)/ruff check --fix --select I
	$(BIN)/ruff format

figures: $(DEVELOPED) ## every figure measured, one JSON object a line; ONLY=group[,group] for some
	@PYTHONPATH=tests $(BIN)/python -m figures $(if $(ONLY),--only $(ONLY)) --drives ../shared/data

schemas: $(DEVELOPED) ## the Protobuf modules from the .proto files
	$(BIN)/python -m trigpoint_schemas.generate

readme: $(DEVELOPED) ## README's data-flow diagram from the table
	$(BIN)/python -c "from pathlib import Path; from trigpoint.dataflow import text_with_diagram as t; p = Path('README.md'); p.write_text(t(p.read_text()))"

system-tools:
	@bash .ci/system-tools

$(INSTALLED): pyproject.toml $(CONSTRAINTS)
	@bash .ci/environment "$(PYTHON)"
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --constraint $(CONSTRAINTS) --editable '.[services]'
	@touch $@

$(DEVELOPED): $(INSTALLED)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --constraint $(CONSTRAINTS) --editable '.[dev]'
	@touch $@

clean: ## what the other targets made
	rm -rf .venv build dist demo .mypy_cache .ruff_cache .pytest_cache .import_linter_cache .hypothesis
