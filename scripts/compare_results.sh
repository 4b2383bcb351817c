#!/usr/bin/env bash
# Runs two programs on the same three assets with one seed and compares the edited views and the textures
# byte for byte. Says which differ; exits with 1 if any does.
#   scripts/compare_results.sh OLD_PATINA NEW_PATINA [FOLDER]
# FOLDER keeps the results; without it they are removed. Shared assets: $PATINA_SHARED, else ../shared.
set -euo pipefail
old="$(realpath "${1:?usage: scripts/compare_results.sh OLD_PATINA NEW_PATINA [FOLDER]}")"
new="$(realpath "${2:?usage: scripts/compare_results.sh OLD_PATINA NEW_PATINA [FOLDER]}")"
folder="${3:-}"
cd "$(dirname "$0")/.."
if [[ -z "$folder" ]]; then
  folder="$(mktemp -d)"
  trap 'rm -rf "$folder"' EXIT
fi
shared="${PATINA_SHARED:-../shared}"

# Small enough for three minutes a program on two cores, and every part is real: control images, noise,
# correspondences, guidance, the bias, and a fit with several light caches.
options=(--prompt "rusty old metal" --strength 0.5 --steps 8 --views 4 --resolution 128 --samples 16
         --max-depth 4 --fit-iterations 12 --texture-size 256 --fit base_color,roughness,normal,metallic
         --turntable 0 --dtype f32 --seed 7 --model models/patina-mini --quiet)
assets=(examples/kettle.glb "$shared/assets/WaterBottle/WaterBottle.gltf" "$shared/assets/Spot/spot_triangulated.obj")

run() {  # run NAME PROGRAM
  local asset name
  for asset in "${assets[@]}"; do
    name="$(basename "${asset%.*}")"
    mkdir -p "$folder/$1/$name"
    local extension=glb
    [[ "$asset" == *.obj ]] && extension=obj
    OMP_WAIT_POLICY=passive "$2" enhance "$asset" "${options[@]}" --run "$folder/$1/$name" \
      -o "$folder/$1/$name.$extension"
  done
}

for asset in "${assets[@]}"; do
  [[ -f "$asset" ]] || { echo "compare_results: $asset is missing; set PATINA_SHARED" >&2; exit 2; }
done
start=$SECONDS
run old "$old"
echo "old program: $((SECONDS - start)) s"
start=$SECONDS
run new "$new"
echo "new program: $((SECONDS - start)) s"

differing=0 compared=0
while read -r file; do
  compared=$((compared + 1))
  if ! cmp -s "$folder/old/$file" "$folder/new/$file"; then
    echo "differs: $file"
    differing=$((differing + 1))
  fi
done < <(cd "$folder" && { (cd old && find . \( -path '*/detail/*.png' -o -path '*/textures/*.png' \))
                            (cd new && find . \( -path '*/detail/*.png' -o -path '*/textures/*.png' \)); } | sort -u)
if ((compared == 0)); then
  echo "compare_results: nothing was written" >&2
  exit 2
fi
echo "$compared pictures compared, $differing differ"
((differing == 0))
