#!/usr/bin/env bash
# Runs test programs of a build folder, two at a time, and ends with one line: N passed, N failed, N skipped.
#   scripts/run_tests.sh build/release                 # all
#   scripts/run_tests.sh build/asan-ubsan base asset   # some
set -u
build="${1:?usage: scripts/run_tests.sh BUILD_DIR [SUITE ...]}"
shift
cd "$(dirname "$0")/.."

# OpenMP's threads wait for one another many times a network's layer, and on a busy machine each wait is long: two
# suites with a thread each end sooner than with more. They sleep, since spinning ones starve the tests beside them.
export OMP_WAIT_POLICY=passive OMP_NUM_THREADS=${OMP_NUM_THREADS:-1}
at_a_time=2   # while one loads files or starts programs the other computes

# Runs one suite; leaves what is to be said of it in its .summary and its three counts in its .counts.
run_suite() {
  local name="test_$1" log="$build/test_$1.log" start=$SECONDS status p f s
  "$build/$name" --gtest_color=no >"$log" 2>&1
  status=$?
  p=$(grep -c '^\[       OK \]' "$log")
  f=$(grep -c '^\[  FAILED  \].* ms)$' "$log")
  s=$(grep -c '^\[  SKIPPED \].* ms)$' "$log")
  # A program that is missing, or crashed before it could count its failure, is a failure too.
  if ((status != 0 && f == 0)); then f=1; fi
  {
    printf '%-20s %4d passed %3d failed %3d skipped  %4d s\n' "$name" "$p" "$f" "$s" $((SECONDS - start))
    if ((f > 0)); then tail -n 60 "$log"; fi
    if ((s > 0)); then grep -A1 -E 'Skipped$' "$log" | grep -v -E 'Skipped$|^--' | sort | uniq -c | head -5; fi
  } >"$build/$name.summary"
  cat "$build/$name.summary"
  echo "$p $f $s" >"$build/$name.counts"
}

suites=("$@")
# From the last: folders that stand on many others take longest.
if ((${#suites[@]} == 0)); then mapfile -t suites < <(tac "$build/tests.txt"); fi
for suite in "${suites[@]}"; do
  rm -f "$build/test_$suite.counts"
  while (($(jobs -rp | wc -l) >= at_a_time)); do wait -n; done
  run_suite "$suite" &
done
wait

passed=0 failed=0 skipped=0
for suite in "${suites[@]}"; do
  read -r p f s <"$build/test_$suite.counts" || p=0 f=1 s=0
  passed=$((passed + p)) failed=$((failed + f)) skipped=$((skipped + s))
done
echo "$passed passed, $failed failed, $skipped skipped"
((failed == 0 && passed > 0))
