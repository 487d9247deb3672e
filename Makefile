# One command each; every target sets up what it needs first and does nothing where nothing changed.
PYTHON ?= python3
BIN := .venv/bin
INSTALLED := .venv/.installed
DEVELOPED := .venv/.developed
CONSTRAINTS := constraints.txt
VIEWER := services/trigpoint_landmarks/viewer
VIEWER_PACKAGES := $(VIEWER)/node_modules/.package-lock.json
VIEWER_BUILT := $(VIEWER)/dist/index.html
WORKERS ?= 2
# What a file's tests share is made once; the files come in their folders' order, the quickest ones, units, last.
BY_FILE := --dist loadfile --no-loadscope-reorder
PYTEST := $(BIN)/pytest $(if $(CI),--forbid-skipped=postgis --forbid-skipped=browser --forbid-skipped=qgis)

.DEFAULT_GOAL := help
.PHONY: help demo viewer viewer-where-possible test test-all check format-check lint types contracts loops format figures schemas readme system-tools clean

help: ## this list
	@grep -hE '^[a-z-]+:.*## ' $(MAKEFILE_LIST) | sed -E 's/^([a-z-]+):.*## /\1\t/' | expand -t 14

demo: $(INSTALLED) ## a simulated campus from raw logs to a georeferenced map, with a report
	$(BIN)/trigpoint demo --out demo
	@echo "report: $(CURDIR)/demo/report.html"

viewer: $(VIEWER_BUILT) ## the page at /viewer/ of the HTTP service, built by npm

test: $(DEVELOPED) system-tools viewer-where-possible ## all tests except the slow ones
	$(PYTEST) --numprocesses $(WORKERS) $(BY_FILE) -m "not slow"

test-all: $(DEVELOPED) system-tools viewer-where-possible ## all tests
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

loops: $(DEVELOPED)
	@PYTHONPATH=tests $(BIN)/python -m compiled_loops

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

viewer-where-possible: system-tools
	@if command -v npm >/dev/null; then $(MAKE) --no-print-directory viewer; \
	else echo "npm is not installed: the viewer is not built, and its tests are skipped" >&2; fi

$(VIEWER_PACKAGES): $(VIEWER)/package.json $(VIEWER)/package-lock.json
	npm --prefix $(VIEWER) ci --no-audit --no-fund
	@touch $@

$(VIEWER_BUILT): $(VIEWER_PACKAGES) $(wildcard $(addprefix $(VIEWER)/,*.html *.ts tsconfig.json src/* src/*/*))
	npm --prefix $(VIEWER) run build

$(INSTALLED): pyproject.toml $(CONSTRAINTS)
	@bash .ci/environment "$(PYTHON)"
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --constraint $(CONSTRAINTS) --editable '.[services]'
	@touch $@

$(DEVELOPED): $(INSTALLED)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --constraint $(CONSTRAINTS) --editable '.[dev]'
	@touch $@

clean: ## what the other targets made
	rm -rf .venv build dist demo $(VIEWER)/dist $(VIEWER)/node_modules .mypy_cache .ruff_cache .pytest_cache .import_linter_cache .hypothesis
