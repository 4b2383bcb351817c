#!/usr/bin/env bash
# Runs test programs of a build folder and ends with one line: N passed, N failed, N skipped.
#   scripts/run_tests.sh build/release                 # all
#   scripts/run_tests.sh build/asan-ubsan base asset   # some
set -u
build="${1:?usage: scripts/run_tests.sh BUILD_DIR [SUITE ...]}"
shift
cd "$(dirname "$0")/.."

export OMP_WAIT_POLICY=passive   # OpenMP's waiting threads sleep; spinning ones starve the tests beside them
passed=0 failed=0 skipped=0
suites=("$@")
if ((${#suites[@]} == 0)); then mapfile -t suites < "$build/tests.txt"; fi
for suite in "${suites[@]}"; do
  name="test_$suite"
  log="$build/$name.log"
  start=$SECONDS
  "$build/$name" --gtest_color=no >"$log" 2>&1
  status=$?
  p=$(grep -c '^\[       OK \]' "$log")
  f=$(grep -c '^\[  FAILED  \].* ms)$' "$log")
  s=$(grep -c '^\[  SKIPPED \].* ms)$' "$log")
  # A program that is missing, or crashed before it could count its failure, is a failure too.
  if ((status != 0 && f == 0)); then f=1; fi
  passed=$((passed + p)) failed=$((failed + f)) skipped=$((skipped + s))
  printf '%-20s %4d passed %3d failed %3d skipped  %4d s\n' "$name" "$p" "$f" "$s" $((SECONDS - start))
  if ((f > 0)); then tail -n 60 "$log"; fi
  if ((s > 0)); then grep -A1 -E 'Skipped$' "$log" | grep -v -E 'Skipped$|^--' | sort | uniq -c | head -5; fi
done
echo "$passed passed, $failed failed, $skipped skipped"
((failed == 0 && passed > 0))
