#!/usr/bin/env bash
# Installs everything patina builds and runs with, from Debian 12's own packages. Safe to run again: it
# asks dpkg first and touches the network only when something is missing.
#   scripts/setup.sh            what `make build`, `make demo` and `make check` need
#   scripts/setup.sh --ci       what .ci/run needs as well (clang-format, clang-tidy, Chromium)
#   scripts/setup.sh --bench    the peers of the benchmarks as well (Blender)
#   scripts/setup.sh --fuzz     what make fuzz needs as well (Clang)
#   scripts/setup.sh --blender  what make check-blender needs as well (Blender, and a screen for its pictures)
#   scripts/setup.sh --slurm    what make check-slurm needs as well (a Slurm of one machine)
#   scripts/setup.sh --package  what make package and check-package need as well
set -euo pipefail

packages=(
  g++ cmake ninja-build pkg-config ccache git ca-certificates
  libtorch-dev libopenblas0-pthread   # networks; without OpenBLAS matrix products fall to 5 GFLOP/s
  libembree-dev libtbb-dev            # ray casting, threads
  libopenimageio-dev libwebp-dev zlib1g-dev   # image files, animated turntables, PNG checksums
  libdraco-dev libmeshoptimizer-dev   # compressed glTF
  libutf8proc-dev                     # characters of prompts: classes, lower case, composition
  nlohmann-json3-dev libglm-dev libcli11-dev libtomlplusplus-dev libfmt-dev libxxhash-dev
  libgtest-dev libbenchmark-dev
)
if [[ "${1:-}" == "--ci" ]]; then packages+=(clang-format clang-tidy chromium); fi
if [[ "${1:-}" == "--bench" ]]; then packages+=(blender python3-numpy); fi
if [[ "${1:-}" == "--fuzz" ]]; then packages+=(clang libclang-rt-14-dev); fi
if [[ "${1:-}" == "--blender" ]]; then packages+=(blender python3-numpy xvfb libgl1-mesa-dri); fi
if [[ "${1:-}" == "--slurm" ]]; then packages+=(slurm-wlm munge python3); fi
if [[ "${1:-}" == "--package" ]]; then packages+=(binutils python3 zstd debootstrap); fi

missing=()
for package in "${packages[@]}"; do
  dpkg-query -W -f='${Status}' "$package" 2>/dev/null | grep -q 'install ok installed' || missing+=("$package")
done
if ((${#missing[@]} == 0)); then exit 0; fi

as_root=()
if [[ "$(id -u)" -ne 0 ]]; then
  command -v sudo >/dev/null || {
    echo "setup: missing packages: ${missing[*]}" >&2
    echo "setup: run as root, or install sudo, or ask your administrator for these packages" >&2
    exit 1
  }
  as_root=(sudo)
fi
echo "setup: installing ${missing[*]}"
export DEBIAN_FRONTEND=noninteractive
"${as_root[@]}" apt-get update -qq
"${as_root[@]}" apt-get install -y --no-install-recommends "${missing[@]}"
