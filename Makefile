# `make trial` and `make test` need python3 (3.10 to 3.13) with venv, and PyPI; no ROS. Where a ROS 2 is sourced
# (ROS_DISTRO is set), its rclpy is used instead of the wheels from PyPI.
PYTHON ?= python3
ifdef ROS_DISTRO
VENV := .venv-$(ROS_DISTRO)
VENV_FLAGS := --system-site-packages
EXTRAS := figures,speed,record,live,sweep,test,lint
# The system's versions stay.
CONSTRAINTS :=
else
VENV := .venv
EXTRAS := ros,figures,speed,camera,apriltag,record,live,sweep,test,lint
CONSTRAINTS := --constraint constraints.txt
# The wheels' loader marks its environment; another environment's mark must not reach ours.
unexport _ROS_WHEELS_BOOTSTRAP_COMPLETE
endif
BIN := $(VENV)/bin
READY := $(VENV)/.ready

.PHONY: help trial test fuzz lint format bench docs dist clean
help:
	@echo 'make trial   run the paper'"'"'s trial in simulation and draw it (into trials/)'
	@echo 'make test    run every test'
	@echo 'make fuzz    damaged files before every reader, 100,000 (an hour)'
	@echo 'make lint    ruff and mypy --strict'
	@echo 'make format  ruff format'
	@echo 'make bench   print the tables of speed (minutes)'
	@echo 'make docs    the documentation as a site, into build/docs'
	@echo 'make dist    wheel and source distribution, into dist'
	@echo 'make clean   remove what was made here; trials stay'

trial: $(READY)
	@$(BIN)/dcdrw trial $(ARGS)

# Cores side by side; then what starts processes of its own and minds the clock: three at once, for they mostly wait.
test: $(READY)
ifdef ARGS
	@$(BIN)/python -m pytest $(ARGS)
else
	@$(BIN)/python -m pytest --numprocesses 2 --dist worksteal -m 'not processes'
	@$(BIN)/python -m pytest --numprocesses 3 --dist load --maxschedchunk 1 -m processes
endif

fuzz: $(READY)
	@$(BIN)/python -m tests.fuzz $(ARGS)

lint: $(READY)
	@$(BIN)/ruff check .
	@$(BIN)/ruff format --check --quiet . || { echo 'some files are not formatted: make format'; exit 1; }
	@$(BIN)/mypy

format: $(READY)
	@$(BIN)/ruff check --fix .
	@$(BIN)/ruff format .

bench: $(READY)
	@for table in benchmarks/*.py; do echo; echo "$$table"; $(BIN)/python $$table || exit; done

# A warning is an error: a broken link, a docstring that is not read as it is meant.
docs: $(VENV)/.docs
	@rm -rf docs/generated build/docs
	@$(BIN)/python -m sphinx --builder html --fail-on-warning --keep-going --quiet --jobs auto docs build/docs
	@echo 'build/docs/index.html'

dist: $(VENV)/.dist
	@rm -rf build/lib dist
	@$(BIN)/python -m build --outdir dist .

$(VENV)/.docs $(VENV)/.dist: $(READY)
	@echo 'Installing what make $(subst .,,$(@F)) needs (once) ...'
	@$(BIN)/python -m pip install --disable-pip-version-check -e '.[$(subst .,,$(@F))]'
	@touch $@

$(READY): setup.cfg setup.py constraints.txt
	@$(PYTHON) -c 'import sys; v = sys.version_info[:2]; (3, 10) <= v <= (3, 13) or sys.exit(f"python3 is {v[0]}.{v[1]}; rclpy needs 3.10 to 3.13: make PYTHON=python3.12 ...")'
	@echo 'Setting up $(VENV) (once): numpy, scipy and what these need: $(EXTRAS) ...'
	@$(PYTHON) -m venv $(VENV_FLAGS) $(VENV)
	@$(BIN)/python -m pip install --disable-pip-version-check $(CONSTRAINTS) -e '.[$(EXTRAS)]'
	@touch $@

clean:
	rm -rf .venv .venv-* build dist docs/generated install log *.egg-info .mypy_cache .pytest_cache .ruff_cache .hypothesis
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
