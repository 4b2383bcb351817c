#!/usr/bin/env bash
# Kills small runs of `patina enhance` at random moments, continues them with the same command until they end, and
# compares what they leave with a run that was not killed: the asset and every picture, byte for byte. A run is killed
# eight times at most, since on a busy machine it would never end. Every other run meets, on its way, the folder of a run
# with other options that was killed too. Ends with one line: kills, runs, faults.
#   scripts/kill_campaign.sh build/release/patina 200     # at least 200 kills; the seed of the moments: SEED=1
set -euo pipefail
patina="$(realpath "${1:?usage: scripts/kill_campaign.sh PATINA [KILLS]}")" wanted="${2:-200}"
cd "$(dirname "$0")/.."
RANDOM="${SEED:-1}"
folder="$(mktemp -d)"
trap 'rm -rf "$folder"' EXIT
export OMP_WAIT_POLICY=passive

# run FOLDER STRENGTH: the command, in the background.
run() {
  "$patina" enhance tests/data/cases/obj/plain/box.obj --prompt "rust" --model tests/data/tiny-sd --views 1 --bias 0 \
    --resolution 64 --samples 1 --steps 3 --strength "$2" --fit-iterations 6 --texture-size 64 --turntable 2 \
    --quiet -o "$1/out.glb" &
}

# What must be the same: not times, nor the pages that tell them.
sums() { (cd "$1" && find . -name '*.png' -o -name '*.exr' -o -name '*.webp' -o -name '*.glb' | sort | xargs sha256sum); }

mkdir "$folder/whole"
begin=$(date +%s%N)
run "$folder/whole" 0.6 && wait $!
milliseconds=$((($(date +%s%N) - begin) / 1000000))
sums "$folder/whole" > "$folder/expected"
echo "a whole run takes $milliseconds ms and leaves $(wc -l < "$folder/expected") files that are compared"

# Waits for a random moment of a whole run's time and kills; tells whether the run still went on.
kill_at_random() {
  sleep "$(printf '%d.%03d' $((10#$1 / 1000)) $((10#$1 % 1000)))"
  kill -KILL "$2" 2> /dev/null || true
  ! wait "$2" 2> /dev/null
}

kills=0 runs=0 faults=0
while ((kills < wanted)); do
  work="$folder/run$runs" attempts=0 strength=0
  mkdir "$work"
  until [[ "$strength" == 0.6 ]] && ((ended)); do
    attempts=$((attempts + 1)) strength=0.6 ended=1
    if ((runs % 2 && attempts < 8 && RANDOM % 3 == 0)); then strength=0.9; fi
    run "$work" "$strength"
    if ((attempts > 8)); then
      wait $!
    elif kill_at_random $((RANDOM % (milliseconds * 11 / 10))) $!; then
      kills=$((kills + 1)) ended=0
    fi
  done
  runs=$((runs + 1))
  if ! sums "$work" | grep -v by-hand | diff - "$folder/expected" > "$folder/difference"; then
    faults=$((faults + 1)) && echo "run $runs differs:" && cat "$folder/difference"
  fi
  rm -rf "$work"
done
echo "$kills kills in $runs runs, $faults faults"
((faults == 0))
