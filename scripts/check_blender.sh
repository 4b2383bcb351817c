#!/usr/bin/env bash
# Packs the extension and runs its tests in Blender without a window. Ends with one line: N passed, N failed,
# N skipped. Where there is no Blender it says so and skips.
#   scripts/check_blender.sh                         # all
#   scripts/check_blender.sh test_export.Shapes ...  # some
set -euo pipefail
cd "$(dirname "$0")/.."
blender="${BLENDER:-blender}"
export OMP_WAIT_POLICY=passive
export PATINA_PROGRAM="${PATINA_PROGRAM:-$PWD/build/release/patina}"

if ! command -v "$blender" > /dev/null; then
  echo "No Blender here; scripts/setup.sh --blender installs it"
  echo "0 passed, 0 failed, 1 skipped"
  exit 0
fi
[[ -x "$PATINA_PROGRAM" ]] || { echo "$PATINA_PROGRAM is missing; make build makes it" >&2; exit 1; }

extension="$PWD/build/blender/patina_enhance.zip"
blender/package.py "$extension"
# Settings of their own, so that the user's Blender stays as it is.
settings="$(mktemp -d)"
trap 'rm -rf "$settings"' EXIT
export BLENDER_USER_CONFIG="$settings/config" BLENDER_USER_SCRIPTS="$settings/scripts"
"$blender" -b --factory-startup --python-exit-code 1 --python blender/tests/run_tests.py -- "$extension" "$@" \
  2>&1 > build/blender/tests.log   # what Blender itself says
