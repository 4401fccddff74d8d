# The first run makes .venv and, where no graphics adapter is found, installs Mesa's software one.
SCENE ?=
PARTS ?=
LUXCORE ?=
MITSUBA ?=
ARGS ?=
WRITE ?=
run = .venv/bin

.PHONY: help demo test guard docs drivers check bench reports soak fuzz accuracy biases live peers kernels wheel clean

help:
	@echo 'make demo               render a few built-in scenes to out/'
	@echo 'make demo SCENE=FILE    and that file to out/'
	@echo 'make test               all checks and tests'
	@echo 'make guard WRITE=1      keep small pictures of everything as they are now, in .guard/'
	@echo 'make guard              are they still, number by number? ARGS=, see tests/guard'
	@echo 'make docs               write docs/api.md and the tables of settings again, and check all links'
	@echo 'make drivers            tests on other Vulkan drivers, validation, Tint; PARTS=, see scripts/drivers.sh'
	@echo 'make check              format, lint, types, imports'
	@echo 'make bench              the benchmark'
	@echo 'make reports            measures all of docs/benchmarks.md, to out/*.json; half an hour or more'
	@echo 'make soak               thousands of pictures: does anything grow? two hours and a half'
	@echo 'make accuracy           errors against a path tracer, to docs/accuracy.md'
	@echo 'make peers              seconds for the same error, beside other renderers, to docs/accuracy.md'
	@echo '                        LUXCORE=, MITSUBA=: interpreters that have them, if not this one'
	@echo 'make biases             each bias of the estimate by itself, to docs/accuracy.md'
	@echo 'make live               errors of live frames and their flicker, to docs/accuracy.md'
	@echo 'make kernels            list again which kernels pictures call, to ispm/kernels/kernels.txt'
	@echo 'make fuzz               load 3,000 damaged files and 580 harmful ones; ARGS=, see tests/fuzz'
	@echo 'make wheel              a wheel with compiled kernels, for Linux x86-64, to dist/'
	@echo 'make clean              remove what was made, .venv too'

demo:
	@scripts/setup.sh core
	$(run)/ispm render cornell-box -o out/cornell-box.png --size 960x540
	$(run)/ispm render caustic-ring -o out/caustic-ring.png --size 640x360 --quiet
	$(run)/ispm render glass-sphere -o out/glass-sphere.png --size 640x360 --quiet
	$(if $(SCENE),$(run)/ispm render '$(SCENE)' -o 'out/$(basename $(notdir $(SCENE))).png')

test: check
	$(run)/pytest -n auto --maxprocesses 8

guard:
	@scripts/setup.sh core
	cd tests && ../$(run)/python -m guard $(if $(WRITE),--write) $(ARGS)

docs:
	@scripts/setup.sh all
	$(run)/python scripts/settings_table.py
	$(run)/python scripts/api_page.py
	$(run)/pytest -q -n 0 tests/contract/test_documents.py

drivers:
	@scripts/setup.sh all
	scripts/drivers.sh $(PARTS)

check:
	@scripts/setup.sh all
	scripts/check.sh

bench:
	@scripts/setup.sh all
	$(run)/ispm bench

reports:
	@scripts/setup.sh all
	mkdir -p out
	$(run)/ispm bench -o out/frame.json
	$(run)/ispm bench --growth -o out/growth.json
	$(run)/ispm bench --talk -o out/talk.json

soak:
	@scripts/setup.sh core
	$(run)/python scripts/soak.py

accuracy:
	@scripts/setup.sh all
	cd tests && ../$(run)/python -m references.accuracy

live:
	@scripts/setup.sh core
	cd tests && ../$(run)/python -m references.live $(ARGS)
	cd tests && ../$(run)/python -m references.rate

peers:
	@scripts/setup.sh all
	cd tests && ../$(run)/python -m references.peers $(if $(LUXCORE),--luxcore $(LUXCORE)) $(if $(MITSUBA),--mitsuba $(MITSUBA))

biases:
	@scripts/setup.sh all
	cd tests && ../$(run)/python -m references.biases

kernels:
	@scripts/setup.sh all
	cd tests && ../$(run)/python -m every_kernel --write

fuzz:
	@scripts/setup.sh all
	cd tests && ../$(run)/python -m fuzz $(ARGS)

wheel:
	@scripts/setup.sh core
	scripts/wheel.sh

clean:
	rm -rf .venv .uv .drivers out dist .mypy_cache .ruff_cache .pytest_cache .hypothesis .import_linter_cache
	find ispm tests -name __pycache__ -prune -exec rm -rf {} +
