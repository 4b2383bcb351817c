#!/usr/bin/env bash
# Names every source file that clang-format would change; `make format` mends them.
set -euo pipefail
cd "$(dirname "$0")/.."
git ls-files '*.cpp' '*.h' '*.inl' '*.cu' '*.cuh' | xargs clang-format --dry-run --Werror
