# The commands of the README. Each installs what it needs (Debian packages, once), configures and builds by itself.
#   make build   build/release/patina
#   make demo    build, then the main job on examples/kettle.glb
#   make check   build, then every test; ends with "N passed, N failed, N skipped"
#   make bench-noise, make bench-attention   measure, print tables, write build/bench/*.json (docs/performance.md)

JOBS ?= $(shell nproc)
DEMO_DIR := build/demo
DEMO_MODEL ?= tests/data/tiny-sd
DEMO_PROMPT ?= a rusty old kettle

.PHONY: build check demo setup bench-programs bench-noise bench-attention clean format tidy

setup:
	@scripts/setup.sh

build: setup
	@cmake --preset release -DPATINA_BUILD_TESTS=OFF -DPATINA_BUILD_BENCH=OFF > build.log 2>&1 || { cat build.log; rm -f build.log; exit 1; }; rm -f build.log
	@cmake --build build/release --parallel $(JOBS) --target patina golden_check

check: setup
	@cmake --preset release -DPATINA_BUILD_TESTS=ON -DPATINA_BUILD_BENCH=OFF
	@cmake --build build/release --parallel $(JOBS)
	@scripts/run_tests.sh build/release

demo: build
	@mkdir -p $(DEMO_DIR)
	build/release/patina enhance examples/kettle.glb --prompt "$(DEMO_PROMPT)" --model $(DEMO_MODEL) \
	  --views 9 --resolution 256 --steps 20 --strength 0.5 --bias 1.2 -o $(DEMO_DIR)/kettle.glb
	@echo
	@echo "The enhanced kettle:  $(CURDIR)/$(DEMO_DIR)/kettle.glb"
	@echo "The report:           $(CURDIR)/$(DEMO_DIR)/kettle.patina-run/report.html"
	@if [ "$(DEMO_MODEL)" = tests/data/tiny-sd ]; then \
	  echo "The model of this demo has random weights: it shows the whole way, not rust. For rust, give a Stable Diffusion 1.5"; \
	  echo "folder with ControlNets:  make demo DEMO_MODEL=/path/to/model"; fi

bench-programs: setup
	@cmake --preset release -DPATINA_BUILD_BENCH=ON
	@cmake --build build/release --parallel $(JOBS)

bench-noise: setup
	@cmake --preset release -DPATINA_BUILD_BENCH=ON
	@cmake --build build/release --parallel $(JOBS) --target bench_noise
	build/release/bench_noise --out build/bench/noise.json

# On the GPU too where there is one, with a Python whose torch sees it.
bench-attention: setup
	@cmake --preset release -DPATINA_BUILD_BENCH=ON
	@cmake --build build/release --parallel $(JOBS) --target bench_attention
	OMP_WAIT_POLICY=passive build/release/bench_attention build/bench/attention.json
	@if nvidia-smi > /dev/null 2>&1; then python3 bench/bench_attention_cuda.py --report build/bench/attention.json; \
	else echo "No GPU here; where there is one:  python3 bench/bench_attention_cuda.py"; fi

format:
	git ls-files '*.cpp' '*.h' | xargs clang-format -i

tidy:
	git ls-files 'src/*.cpp' 'apps/*.cpp' | xargs -P $(JOBS) -n 1 clang-tidy -p build/release --quiet

clean:
	rm -rf build
