# SPDX-License-Identifier: MIT
.DEFAULT_GOAL := help
.PHONY: always help setup kernels run up workbench test lint pictures site wheel sdist release version build bench stress soak clean pins
SHELL := /bin/bash
# A make that a test starts has its own jobs.
unexport MAKEFLAGS MFLAGS

PY := .venv/bin/python
# Each target installs what it needs and no more: `make run` has no use for what only tests import.
FOR_RUN := .venv/.pins-run
READY := .venv/.pins-all
# A ROS installation that .venv was made beside, and whose setup.bash wasn't sourced here.
ROS := if [ -z "$$AMENT_PREFIX_PATH" ] && [ -f .venv/.ros ]; then source "$$(cat .venv/.ros)"; fi;
# What the node says to others stays on this machine, unless the user has chosen otherwise.
run up workbench pictures: export ROS_AUTOMATIC_DISCOVERY_RANGE ?= LOCALHOST

help: ## this list
	@grep -hE '^[a-z]+:.*## ' $(MAKEFILE_LIST) | sed -E 's/^([a-z]+):.*## /\1\t/' | expand -t 12

setup: $(READY) ## .venv with all that run, up, test and lint need

# Asked at every target: a clone may have been moved, or its Python have gone, since .venv was made.
.venv/.pins-%: always
	@command -v python3 >/dev/null || { echo "make setup: python3 is missing; install it with: sudo apt install python3 python3-venv" >&2; exit 1; }
	@python3 requirements/make_venv.py $*

kernels: setup ## build the kernels for this machine and for WebAssembly, and page/src/kernels.ts
	@$(PY) requirements/wasm_tools.py linker
	@mkdir -p page/src
	@$(PY) -m rigid_proto_ros.kernels native wasm --typescript page/src/kernels.ts

run: $(FOR_RUN) ## simulate a bundled body, or MESH=path/to.obj, for 10 s; leaves out/session.mcap (recording) and out/session.rrd (view)
	@$(ROS) .venv/bin/rigid_proto demo $(if $(MESH),--mesh "$(MESH)")

# 130 is how the two below end after Ctrl-C: for them no error, of which make would report.
# The page is built once; without Node, or offline, `up` goes on without it and says so.
up: $(FOR_RUN) ## node with Rerun's view and its page; stays until Ctrl-C
	@[ ! -x $(PY) ] || $(PY) requirements/wasm_tools.py linker node
	@$(ROS) .venv/bin/rigid_proto up $(if $(MESH),--mesh "$(MESH)") || [ $$? = 130 ]

workbench: $(FOR_RUN) ## the page, in which the body flies by itself; stays until Ctrl-C
	@[ ! -x $(PY) ] || $(PY) requirements/wasm_tools.py linker node
	@$(ROS) .venv/bin/rigid_proto workbench $(if $(MESH),--mesh "$(MESH)") || [ $$? = 130 ]

# A wait that has run out says that the machine was busy or that a process wasn't discovered, and nothing about values: such a
# test, and no other, is tried once more, and the report says which.
AGAIN := --reruns 1 --only-rerun "no .* within [0-9.]+ s" -rRs

# Hundreds of processes are started: none of them should read our source anew.
test: export PYTHONDONTWRITEBYTECODE :=
test: setup ## the whole suite; real meshes are found through RIGID_PROTO_MESHES
	@$(PY) requirements/wasm_tools.py linker node
	@$(PY) -m rigid_proto_ros.page >/dev/null || echo "the page isn't built; tests that need it skip" >&2
	$(ROS) $(PY) -m pytest -n 4 --dist loadfile --no-loadscope-reorder $(AGAIN) -m "not stress and not bench and not soak" $(ARGS)

lint: setup ## ruff and mypy
	$(PY) -m ruff check .
	$(PY) -m ruff format --check .
	$(PY) -m mypy

pictures: setup run ## draw the pictures of README and lessons anew (needs mesa-vulkan-drivers and chromium)
	.venv/bin/rigid_proto snapshot out/session.mcap --at 4.05 -o docs/flight.png
	$(PY) tools/lesson_pictures.py
	PYTHONPATH=test:test/page $(PY) tools/page_pictures.py docs
	PYTHONPATH=test:test/page $(PY) tools/toy_picture.py docs/flight.webp

site: setup ## site/: the page with a start page and one address a lesson, for any static host
	@$(PY) requirements/wasm_tools.py linker node
	@$(PY) tools/static_site.py site

wheel: setup ## dist/: a wheel with the kernels of this machine's architecture
	@rm -rf rigid_proto_ros/kernels/lib rigid_proto_ros/page/lib
	@$(PY) requirements/wasm_tools.py linker node
	@$(PY) -m rigid_proto_ros.kernels wheel
	@$(PY) -m rigid_proto_ros.page wheel
	$(PY) -m pip --disable-pip-version-check wheel --quiet --no-deps --no-build-isolation -w dist .

sdist: setup ## dist/: the sources as one file, from which pip builds
	@mkdir -p dist && $(PY) setup.py --quiet sdist --dist-dir dist

# A tag names what is in it: the version that package.xml has, and nothing uncommitted.
release: setup ## dist/: wheel, sdist and the site of the tag that is checked out
	@[ "$$(git describe --exact-match --tags HEAD 2>/dev/null)" = "v$$($(MAKE) -s version)" ] || { echo "make release: HEAD isn't tagged v$$($(MAKE) -s version), the version in package.xml; check that tag out, or set the version and tag it" >&2; exit 1; }
	@[ -z "$$(git status --porcelain)" ] || { echo "make release: there are uncommitted changes: $$(git status --porcelain | head -3)" >&2; exit 1; }
	@$(MAKE) -s wheel sdist site
	@tar -czf "dist/rigid_proto_ros-$$($(MAKE) -s version)-site.tar.gz" site

version: ## the version, which stands in package.xml
	@sed -n 's|.*<version>\(.*\)</version>.*|\1|p' package.xml

build: setup ## colcon build into build/, install/ and log/; then: source install/setup.bash
	$(ROS) $(PY) -m colcon build --packages-select rigid_proto_ros

bench: .venv-bench/.pins ## comparison with other tools; CSV with date, commit, CPU and versions
	@.venv-bench/bin/python requirements/wasm_tools.py node
	@for file in $$(grep -l '^if __name__ == "__main__"' benchmarks/*.py | grep -vE 'references|soak|clients'); do echo "$$file"; .venv-bench/bin/python "$$file" || exit 1; done

.venv-bench/.pins: benchmarks/requirements.txt $(wildcard requirements/*) | $(READY)
	.venv/bin/python -m venv .venv-bench
	.venv-bench/bin/python -m pip --disable-pip-version-check install --quiet --require-hashes -r requirements/run.txt -r requirements/ros.txt -r requirements/all.txt -r benchmarks/requirements.txt
	.venv-bench/bin/python -m pip --disable-pip-version-check install --quiet --no-build-isolation --no-deps -e .
	@touch $@

soak: setup ## an hour of random commands and changes, while subscribers and viewers come and go, and 10 minutes of a page's hands; MINUTES=5 for the short form
	$(ROS) $(PY) benchmarks/soak.py --minutes $(or $(MINUTES),60)
	$(ROS) MINUTES=$(or $(MINUTES),10) $(PY) -m pytest -m soak -s

stress: setup ## long and hostile tests, those of random examples with new ones, and the same bits elsewhere
	$(ROS) RIGID_PROTO_EXAMPLES=new $(PY) -m pytest -m "stress or hypothesis" $(ARGS) || [ $$? = 5 ] # 5: none of them is chosen
	$(if $(ARGS),,$(PY) tools/bits_elsewhere.py)

clean: ## everything that was made here, the environments included
	rm -rf .venv .venv-bench build install log out dist site rigid_proto_ros/kernels/lib rigid_proto_ros/page/lib page/node_modules benchmarks/engines/node_modules *.egg-info .pytest_cache .ruff_cache .mypy_cache .hypothesis .coverage
	find . -name __pycache__ -type d -prune -exec rm -rf {} +

# Each list leaves out what the lists before it have; a version's files are known by their hashes.
LOCK = .venv/bin/uv pip compile --quiet --upgrade --universal --python-version 3.11 --generate-hashes --no-annotate --no-header --no-emit-package pip
without = -c requirements/$(1).txt $$(sed -nE 's/^([^ ;]+)==.*/--no-emit-package \1/p' requirements/$(1).txt)
pins: setup ## for developers: newest versions into requirements/*.txt
	$(LOCK) requirements/run.in -o requirements/run.txt
	$(LOCK) requirements/ros.in $(call without,run) -o requirements/ros.txt
	$(LOCK) requirements/all.in $(call without,run) $(call without,ros) -o requirements/all.txt
	$(LOCK) requirements/numpy1.in --no-emit-package numpy -o requirements/numpy1.txt
	$(LOCK) requirements/wasm.in -o requirements/wasm.txt
	$(LOCK) benchmarks/requirements.in $(call without,run) $(call without,ros) $(call without,all) -o benchmarks/requirements.txt
	sed -i '1i # Exact pins, made by `make pins`.' requirements/*.txt benchmarks/requirements.txt
