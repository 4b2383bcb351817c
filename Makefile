# The commands of the README. Each installs what it needs (Debian packages, once), configures and builds by itself.
#   make help    this list
#   make build   build/release/patina
#   make demo    build, then the main job on examples/kettle.glb
#   make check   build, then every test; ends with "N passed, N failed, N skipped"
#   make package            an archive, a wheel and a .deb that run without anything installed (docs/packaging.md)
#   make check-package      runs them in empty systems; must be root
#   make check-blender      the tests of the Blender extension, in Blender without a window (docs/blender.md)
#   make blender-extension  build/blender/patina_enhance.zip, which Blender installs
#   make check-slurm SLURM_JOBS=200   a batch on a Slurm of one machine that the test starts; must be root (docs/batch.md)
#   make sanitise     the suites that finish in minutes, under the address and undefined-behaviour sanitisers
#   make fuzz TARGET=gltf MINUTES=5   libFuzzer on one target (docs/reliability.md lists them)
#   make kill-campaign KILLS=200      kills small runs at random moments and compares what they leave
#   make fault-campaign   fails every call of a small run that writes a file, one after the other
#   make bench-noise, bench-attention, bench-inverse, bench-unet   measure, print tables, write build/bench/*.json (docs/performance.md)
#   make gallery      the pictures of docs/gallery.md
#   make train-mini   the programs that make patina-mini: make_dataset and train_mini (mini/docs/training.md)
#   make bench-mini   how good the small model is: build/bench/mini.json and pictures (mini/docs/measuring-mini.md)
#   make format       clang-format on every source file
#   make tidy         clang-tidy on the sources that differ from main
#   make clean        removes build/

JOBS ?= $(shell nproc)
# Without it ccache does not keep what was compiled with a precompiled header.
export CCACHE_SLOPPINESS ?= pch_defines,time_macros
DEMO_DIR := build/demo
DEMO_MODEL ?= models/patina-mini
DEMO_PROMPT ?= a rusty old kettle
# The demo's main command, which leaves its results in folder $(1).
demo_command = build/release/patina enhance examples/kettle.glb --prompt "$(DEMO_PROMPT)" --strength 0.9 \
	  --model $(DEMO_MODEL) -o $(1)/kettle.glb
# Whether `make check` tests the making of patina-mini as well.
MINI ?= OFF
MINI_MODEL ?= models/patina-mini
MINI_SHARDS ?= build/mini_shards
PEER_PYTHON ?= python3
SLURM_JOBS ?= 200
SHARED ?= $(or $(PATINA_SHARED),../shared)

.PHONY: help build package check-package check check-blender check-slurm blender-extension sanitise fuzz kill-campaign fault-campaign demo setup bench-programs bench-noise bench-attention bench-inverse bench-unet bench-mini train-mini gallery clean format tidy

help:
	@sed -n 's/^#   //p' Makefile

setup:
	@scripts/setup.sh

build: setup
	@cmake --preset release -DPATINA_BUILD_TESTS=OFF -DPATINA_BUILD_BENCH=OFF > build.log 2>&1 || { cat build.log; rm -f build.log; exit 1; }; rm -f build.log
	@cmake --build build/release --parallel $(JOBS) --target patina

check: setup
	@cmake --preset release -DPATINA_BUILD_TESTS=ON -DPATINA_BUILD_BENCH=OFF -DPATINA_BUILD_MINI=$(MINI)
	@cmake --build build/release --parallel $(JOBS)
	@scripts/run_tests.sh build/release

package: build
	@scripts/setup.sh --package
	@packaging/bundle.py build/release build/package/tree
	@packaging/archives.py build/package/tree build/package

check-package: package
	@packaging/check.sh build/release build/package

check-blender: build
	@scripts/check_blender.sh

check-slurm: build
	@tests/slurm/check.sh build/release $(SLURM_JOBS)

blender-extension:
	@blender/package.py build/blender/patina_enhance.zip
	@echo "The extension:  $(CURDIR)/build/blender/patina_enhance.zip"

SANITISED := base image asset views masks correspond attention
sanitise: setup
	@cmake --preset asan-ubsan
	@cmake --build build/asan-ubsan --parallel $(JOBS) --target $(addprefix test_,$(SANITISED))
	@scripts/run_tests.sh build/asan-ubsan $(SANITISED)

TARGET ?= gltf
MINUTES ?= 5
fuzz:
	@scripts/setup.sh --fuzz
	@cmake --preset fuzz > /dev/null
	@cmake --build build/fuzz --parallel $(JOBS) --target fuzz_patina
	@mkdir -p build/fuzz/corpus/$(TARGET) build/fuzz/findings
	build/fuzz/fuzz_patina $(TARGET) build/fuzz/corpus/$(TARGET) -max_total_time=$$(($(MINUTES) * 60)) \
	  -max_len=16384 -timeout=20 -rss_limit_mb=4096 -print_final_stats=1 -artifact_prefix=build/fuzz/findings/$(TARGET)-

KILLS ?= 200
kill-campaign: build
	@scripts/kill_campaign.sh build/release/patina $(KILLS)

fault-campaign: setup
	@cmake --preset release -DPATINA_BUILD_TESTS=ON
	@cmake --build build/release --parallel $(JOBS) --target test_faults
	PATINA_FAULTS=all OMP_WAIT_POLICY=passive build/release/test_faults

demo: build
	@mkdir -p $(DEMO_DIR)
	$(call demo_command,$(DEMO_DIR))
	@echo
	@echo "The enhanced kettle:  $(CURDIR)/$(DEMO_DIR)/kettle.glb"
	@echo "The report:           $(CURDIR)/$(DEMO_DIR)/kettle.patina-run/report.html"

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

bench-inverse: setup
	@cmake --preset release -DPATINA_BUILD_BENCH=ON
	@cmake --build build/release --parallel $(JOBS) --target bench_inverse
	build/release/bench_inverse --shared $(SHARED) --out build/bench/inverse.json
	@if $(PEER_PYTHON) -c "import mitsuba" 2> /dev/null; then $(PEER_PYTHON) bench/inverse/mitsuba_peer.py --report build/bench/inverse.json; \
	else echo "No Mitsuba beside this; how to have it:  python3 bench/inverse/mitsuba_peer.py --help"; fi

bench-unet: setup
	@cmake --preset release -DPATINA_BUILD_BENCH=ON
	@cmake --build build/release --parallel $(JOBS) --target bench_unet make_checkpoint
	OMP_WAIT_POLICY=passive build/release/bench_unet --out build/bench/unet.json
	@if $(PEER_PYTHON) -c "import diffusers" 2> /dev/null; then $(PEER_PYTHON) bench/unet/diffusers_peer.py --report build/bench/unet.json; \
	else echo "No diffusers beside this; how to have it:  python3 bench/unet/diffusers_peer.py --help"; fi
	@if $(PEER_PYTHON) -c "import stable_diffusion_cpp" 2> /dev/null; then \
	  $(PEER_PYTHON) bench/unet/stable_diffusion_cpp_peer.py --report build/bench/unet.json --make build/release/make_checkpoint; \
	else echo "No stable-diffusion.cpp beside this; how to have it:  python3 bench/unet/stable_diffusion_cpp_peer.py --help"; fi
	@if nvidia-smi > /dev/null 2>&1; then \
	  cmake --preset cuda -DCMAKE_PREFIX_PATH=$$($(PEER_PYTHON) -c 'import torch; print(torch.utils.cmake_prefix_path)') && \
	  cmake --build build/cuda --parallel $(JOBS) --target bench_grid && \
	  $(PEER_PYTHON) bench/unet/grid_table.py --report build/bench/unet.json; \
	else echo "No GPU here; the table of whole view grids where there is one:  python3 bench/unet/grid_table.py --help"; fi

gallery: setup
	@cmake --preset release -DPATINA_BUILD_BENCH=ON
	@cmake --build build/release --parallel $(JOBS) --target make_gallery
	OMP_WAIT_POLICY=passive build/release/make_gallery --shared $(SHARED)

train-mini: setup
	@cmake --preset release -DPATINA_BUILD_MINI=ON
	@cmake --build build/release --parallel $(JOBS) --target make_dataset train_mini

# The demo is timed in a folder of its own, from nothing. Shards that are not there are made first, in some ten minutes.
bench-mini: DEMO_MODEL = $(MINI_MODEL)
bench-mini: setup
	@cmake --preset release -DPATINA_BUILD_MINI=ON
	@cmake --build build/release --parallel $(JOBS) --target bench_mini patina make_dataset
	@test -e $(MINI_SHARDS)/materials.shard || { \
	  build/release/make_dataset objects --shared $(SHARED) --count 80 build/mini_work && \
	  build/release/make_dataset materials --shared $(SHARED) build/mini_work && \
	  build/release/make_dataset pack build/mini_work $(MINI_SHARDS); }
	OMP_WAIT_POLICY=passive build/release/bench_mini --model $(MINI_MODEL) --shards $(MINI_SHARDS) --shared $(SHARED) \
	  --out build/bench/mini.json \
	  --demo 'rm -rf build/bench/mini/demo && mkdir -p build/bench/mini/demo && $(call demo_command,build/bench/mini/demo)'

format:
	git ls-files '*.cpp' '*.h' '*.inl' '*.cu' '*.cuh' | xargs clang-format -i

tidy:
	@scripts/check_tidy.sh

clean:
	rm -rf build
