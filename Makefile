# `make demo` and `make test` do all the set-up themselves, each in its own virtual environment.
PYTHON ?= python3
DEMO_OUT ?= errorscreen-demo
PYTEST_OPTIONS ?=
PIP_INSTALL = -m pip install --quiet --disable-pip-version-check --constraint constraints.txt

.PHONY: demo test lint check docs generated clean

demo: .venv/installed
	.venv/bin/errorscreen demo --out $(DEMO_OUT)

test: lint check

.venv/installed: pyproject.toml constraints.txt
	$(PYTHON) -m venv .venv
	.venv/bin/python $(PIP_INSTALL) --editable ".[cnn]"
	touch $@

.venv-test/installed: pyproject.toml constraints.txt
	$(PYTHON) -m venv .venv-test
	.venv-test/bin/python $(PIP_INSTALL) --editable ".[test,docs]"
	touch $@

lint: .venv-test/installed
	.venv-test/bin/ruff check .
	.venv-test/bin/ruff format --check .
	.venv-test/bin/mypy

check: .venv-test/installed
	.venv-test/bin/pytest --numprocesses auto --dist worksteal $(PYTEST_OPTIONS)

docs: .venv-test/installed
	.venv-test/bin/sphinx-build -W --keep-going --quiet docs docs/_build/html

# the tables of the documentation that follow from the package; the result is committed
generated: .venv-test/installed
	.venv-test/bin/python docs/_tools/pages.py

clean:
	rm -rf .venv .venv-test $(DEMO_OUT) build dist docs/_build docs/_generated docs/gallery docs/api/generated .pytest_cache .mypy_cache .ruff_cache .hypothesis
