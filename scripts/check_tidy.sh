#!/usr/bin/env bash
# clang-tidy on the sources that differ from where this branch left main. Configures build/tidy, without precompiled
# headers, since clang cannot read GCC's.
#   scripts/check_tidy.sh [MOST]   nothing is checked where more than MOST files differ
set -euo pipefail
cd "$(dirname "$0")/.."
most="${1:-10000}"
base=$(git merge-base HEAD origin/main 2>/dev/null || git merge-base HEAD main 2>/dev/null) || {
  echo "clang-tidy: no main to compare with; nothing checked"
  exit 0
}
mapfile -t files < <(git diff --name-only --diff-filter=d "$base" -- 'src/*.cpp' 'apps/*.cpp' 'tools/*.cpp' 'bench/*.cpp' 'mini/*.cpp')
echo "clang-tidy: ${#files[@]} changed files"
if ((${#files[@]} == 0)); then exit 0; fi
if ((${#files[@]} > most)); then
  echo "clang-tidy: more than $most files differ, which would take too long; nothing checked (make tidy checks them)"
  exit 0
fi
mkdir -p build
cmake --preset release -B build/tidy -DPATINA_PCH=OFF -DPATINA_WERROR=OFF -DPATINA_BUILD_MINI=ON > build/tidy.log 2>&1 || {
  cat build/tidy.log
  exit 1
}
printf '%s\0' "${files[@]}" | xargs -0 -P "$(nproc)" -n 1 clang-tidy -p build/tidy --quiet --header-filter='^$' \
  --warnings-as-errors='*' --extra-arg=-Wno-unknown-warning-option
