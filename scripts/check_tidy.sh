#!/usr/bin/env bash
# clang-tidy on sources. Configures build/tidy, without precompiled headers, since clang cannot read GCC's.
#   scripts/check_tidy.sh         those that differ from where this branch left main
#   scripts/check_tidy.sh MOST    the MOST that were changed last, on whatever branch
set -euo pipefail
cd "$(dirname "$0")/.."
sources=('src/*.cpp' 'apps/*.cpp' 'tools/*.cpp' 'bench/*.cpp' 'mini/*.cpp')

changed_since_main() {
  local base
  base=$(git merge-base HEAD origin/main 2>/dev/null || git merge-base HEAD main 2>/dev/null) || {
    echo "clang-tidy: no main to compare with; give the number of sources to check" >&2
    return 1
  }
  git diff --name-only --diff-filter=d "$base" -- "${sources[@]}"
}

changed_last() {
  { git diff --name-only HEAD -- "${sources[@]}"
    git log --no-merges --format= --name-only -- "${sources[@]}"; } |
    awk -v most="$1" 'n < most && !seen[$0]++ && system("test -e \"" $0 "\"") == 0 { print; ++n }'
}

if (($# > 0)); then list=$(changed_last "$1"); else list=$(changed_since_main); fi
mapfile -t files < <(printf '%s' "$list")
echo "clang-tidy: ${#files[@]} sources"
if ((${#files[@]} == 0)); then exit 0; fi
mkdir -p build
cmake --preset release -B build/tidy -DPATINA_PCH=OFF -DPATINA_WERROR=OFF -DPATINA_BUILD_BENCH=ON -DPATINA_BUILD_MINI=ON \
  > build/tidy.log 2>&1 || {
  cat build/tidy.log
  exit 1
}
# LibTorch's headers compile with clang as C++20 only where ivalue.h comes first.
tidy() {
  clang-tidy -p build/tidy --quiet --header-filter='^$' --warnings-as-errors='*' \
    --extra-arg=-Wno-unknown-warning-option "$@"
}
tidy_torch() { tidy --extra-arg=-include --extra-arg=ATen/core/ivalue.h "$@"; }
# A source sees them if it or a header of the folders that stand on LibTorch says so.
tidy_source() {
  if grep -qE '#include .(ATen|c10|torch|patina/nn|patina/diffusion)/' "$1"; then tidy_torch "$1"; else tidy "$1"; fi
}
export -f tidy tidy_torch tidy_source
# What this build does not compile (CUDA) cannot be checked.
for file in "${files[@]}"; do
  if grep -qF "/$file\"" build/tidy/compile_commands.json; then printf '%s\0' "$file"; fi
done | xargs -0 -P "$(nproc)" -n 1 bash -c 'tidy_source "$1"' tidy
