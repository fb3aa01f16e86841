# The few commands a contributor needs. CMake does the work; `make help` lists them.
JOBS ?= $(shell nproc)
CONFIG ?= config/samples/samples.json
# Address of `make run`, HOST:PORT; empty: the one in CONFIG.
LISTEN ?=
# Options of `make bench` and `make bench-serve`, for instance BENCH="--peer 'COMMAND' --filter 'T1 '": see docs/performance.md.
BENCH ?=

# Where `make install` puts the server and the library, below DESTDIR.
PREFIX ?= /usr/local

SOURCES = git ls-files '*.h' '*.cc'
TERRACE = build/release/server/cli/terrace

.DEFAULT_GOAL := help
.PHONY: help deps test-deps build run test sanitize coverage reliability reliability-long bench bench-serve paper deb install release docs site format lint tidy clean

help:  ## list these targets
	@awk -F ':.*## ' '/^[a-z-]+:.*## / { printf "  make %-16s %s\n", $$1, $$2 }' $(MAKEFILE_LIST)

deps:  ## install what building needs (Debian 12; root or sudo)
	@tools/install_deps.sh

test-deps:  ## install also what the tests need
	@tools/install_deps.sh --test

build: deps  ## build the server into build/release
	cmake --preset release -DTERRACE_BUILD_TESTS=OFF --log-level=WARNING
	cmake --build build/release -j $(JOBS)

run: build  ## build, and serve the sample data (LISTEN=HOST:PORT, CONFIG=FILE)
	@echo "Open the address below in a browser. Ctrl-C ends the server."
	@exec $(TERRACE) serve --config $(CONFIG) $(if $(LISTEN),--listen $(LISTEN))

test: test-deps  ## build and run every test
	@tools/run_tests.py release --jobs $(JOBS)

sanitize: test-deps  ## run the unit tests under ASan + UBSan, and those with threads under TSan
	@tools/run_tests.py asan tsan --jobs $(JOBS)

coverage: test-deps  ## build with counters, run the tests, print which lines of each module they run
	@tools/run_coverage.py --missed --jobs $(JOBS)

reliability: test-deps  ## test on the real binary what docs/reliability.md promises about clients; a few minutes
	cmake --preset release -DTERRACE_BUILD_TESTS=ON --log-level=WARNING
	cmake --build build/release -j $(JOBS) --target terrace reliability_tests
	@tests/reliability/run.py

reliability-long: test-deps  ## the same, each row as often as its target says
	cmake --preset release -DTERRACE_BUILD_TESTS=ON --log-level=WARNING
	cmake --build build/release -j $(JOBS) --target terrace reliability_tests
	@tests/reliability/run.py --long

bench: test-deps  ## build and run the benchmarks; JSON results in build/bench/results
	@tools/run_benchmarks.sh $(JOBS) $(BENCH)

bench-serve: build  ## time of tiles by level and stage, data from ../shared/data; BENCH="BEFORE/terrace": compare with another build
	@tests/load/bench_serve.py $(BENCH) $(TERRACE)

paper: test-deps  ## repeat the experiments of the paper (docs/engine.md) into build/paper
	@tools/run_paper.sh $(JOBS)

deb: build test-deps  ## build the Debian package into build/deb
	@packaging/build_deb.sh

release: test-deps  ## build source, Debian package, image recipe, bill of materials and sums into build/release-files
	@JOBS=$(JOBS) tools/release.sh

install: build  ## install the server and the tiler library (PREFIX=/usr/local, DESTDIR=)
	DESTDIR=$(DESTDIR) cmake --install build/release --prefix $(PREFIX) --strip > /dev/null
	DESTDIR=$(DESTDIR) cmake --install build/release --prefix $(PREFIX) --component development > /dev/null

docs: deps  ## write config.schema.json and the tables of docs/configuration.md from the options
	cmake --preset release -DTERRACE_BUILD_TESTS=OFF --log-level=WARNING
	cmake --build build/release -j $(JOBS) --target write_option_docs
	build/release/config/write_option_docs .

site: test-deps  ## build the documentation as a site into build/site
	@mkdocs build --quiet && echo "build/site/index.html"

format:  ## format the C++ sources
	$(SOURCES) | xargs clang-format-14 -i

lint: test-deps  ## check layers, leftovers, formatting, self-contained headers
	@tools/lint.sh $(JOBS)

tidy: test-deps  ## run clang-tidy over the product
	@tools/tidy.sh $(JOBS)

clean:  ## remove everything that was built
	rm -rf build
