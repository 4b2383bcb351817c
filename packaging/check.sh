#!/usr/bin/env bash
# Runs the three packages where nothing of patina's is installed: in an empty root filesystem with nothing but glibc, and
# in fresh Debian 12, Debian 13 and Ubuntu 24.04, as an ordinary user without HOME. A small run of the whole
# pipeline must give the same bytes as the program of the build folder. Must be started by root, for chroot.
#   packaging/check.sh BUILD PACKAGES [SYSTEM...]     SYSTEM: bare bookworm trixie noble; without any: all of them
# The systems come from their mirrors once and stay in build/roots. One whose mirror is not reached is skipped.
set -euo pipefail
cd "$(dirname "$0")/.."
build="$(realpath "${1:?usage: packaging/check.sh BUILD PACKAGES [SYSTEM...]}")"
packages="$(realpath "${2:?usage: packaging/check.sh BUILD PACKAGES [SYSTEM...]}")"
shift 2
systems=("$@")
((${#systems[@]})) || systems=(bare bookworm trixie noble)
((EUID == 0)) || { echo "check-package: must be root, to change into the empty systems (chroot)" >&2; exit 2; }
roots="$PWD/build/roots"
mkdir -p "$roots"

archive="$(ls "$packages"/patina-*-linux-x86_64.tar.zst)" wheel="$(ls "$packages"/patina3d-*.whl)"
deb="$(ls "$packages"/patina_*_amd64.deb)"
version="$("$build/patina" --version)"
passed=0 failed=0 skipped=0

# Small enough for a minute on two slow cores; it renders, edits, fits, exports and reports. One place has a space.
options=(--prompt "a rusty old kettle" --strength 0.9 --views 4 --resolution 128 --steps 4 --samples 8 --max-depth 3
         --fit-iterations 8 --texture-size 256 --turntable 2 --quiet)
places='(config|metrics|stages)\.json|report\.html'   # hold paths and times

expected="$(mktemp -d)"
work=""
trap 'rm -rf "$expected" ${work:+"$work"}' EXIT

# inside USER COMMAND...: runs a command in $work as that user, with a /proc of its own and an empty environment.
inside() {
  local user="$1"
  shift
  unshare --mount --pid --fork bash -c 'root="$1" user="$2"; shift 2
    mount -t proc proc "$root/proc"
    exec chroot --userspec="$user" "$root" /usr/bin/env -i PATH=/usr/bin:/bin:/usr/sbin:/sbin LC_ALL=C.UTF-8 "$@"' \
    inside "$work" "$user" "$@"
}

# try NAME PROGRAM: version, doctor and the run, as an ordinary user who owns nothing but /home/artist.
try() {
  local name="$1" program="$2" home="$work/home/artist"
  rm -rf "$home" && mkdir -p "$home" && cp examples/kettle.glb "$home" && chown -R 1000:1000 "$home"
  if [[ "$(inside 1000:1000 "$program" --version)" == "$version" ]] &&
     inside 1000:1000 "$program" doctor > "$home/doctor.txt" &&
     inside 1000:1000 OMP_WAIT_POLICY=passive "$program" enhance /home/artist/kettle.glb "${options[@]}" \
       -o /home/artist/rusty.glb && same_bytes "$home"; then
    echo "ok      $name"
    passed=$((passed + 1))
  else
    echo "FAILED  $name"
    cat "$home/doctor.txt" 2> /dev/null || true
    failed=$((failed + 1))
  fi
}

same_bytes() {
  local differing
  differing="$(diff -rq "$expected" "$1" | grep -vE "$places|kettle.glb$|doctor.txt" || true)"
  [[ -z "$differing" ]] || { head -n 3 <<< "$differing"; wc -l <<< "$differing"; return 1; }
  cmp "$expected/rusty.glb" "$1/rusty.glb"
}

# bare: the loader and glibc of this machine, /usr/bin/env to start with, and no other file.
make_bare() {
  mkdir -p "$1"/{lib64,lib/x86_64-linux-gnu,usr/bin,proc,tmp,dev,home}
  local name
  for name in libc libm libdl libpthread librt; do
    cp -L "$(ldconfig -p | sed -n "s,.*x86-64.* => \(.*/$name\.so\.[0-9]*\)$,\1,p" | head -n 1)" "$1/lib/x86_64-linux-gnu/"
  done
  cp -L /lib64/ld-linux-x86-64.so.2 "$1/lib64/"
  cp /usr/bin/env "$1/usr/bin/"
  chmod 1777 "$1/tmp"
}

# system NAME FOLDER: a copy of a fresh system. Fails where the mirror is not reached.
system() {
  local mirror=http://deb.debian.org/debian script=() others=()
  [[ "$1" == bare ]] && { make_bare "$2"; return; }
  if [[ "$1" == noble ]]; then
    mirror=http://archive.ubuntu.com/ubuntu script=(/usr/share/debootstrap/scripts/gutsy)
    others=(--components=main,universe --no-check-gpg)   # Debian has no package of Ubuntu's keys
  fi
  if [[ ! -e "$roots/$1/.complete" ]]; then
    rm -rf "${roots:?}/$1"
    debootstrap --variant=minbase --include=python3-venv "${others[@]}" "$1" "$roots/$1" "$mirror" "${script[@]}" \
      > "$roots/$1.log" 2>&1 || return 1
    touch "$roots/$1/.complete"
  fi
  cp -a "$roots/$1" "$2"
}

# The archive lies where its builder never thought of, the wheel in an environment of the user, the .deb in /usr.
check_in() {
  work="$roots/work-$1"
  rm -rf "$work"
  if ! system "$1" "$work"; then
    echo "skipped $1: debootstrap failed, see $roots/$1.log"
    skipped=$((skipped + 1))
    return
  fi
  local place="$work/opt/a place"
  mkdir -p "$place"
  tar -C "$place" --zstd -xf "$archive"
  mv "$place"/patina-* "$place/pâtina"
  try "$1: archive" "/opt/a place/pâtina/bin/patina"
  # Without its model it must say so, and where it looked.
  rm -r "$place/pâtina/share"
  if inside 1000:1000 "/opt/a place/pâtina/bin/patina" doctor > "$work/tmp/doctor.txt" 2> /dev/null ||
     ! grep -q "model: patina-mini is neither in /opt/a place/pâtina/share" "$work/tmp/doctor.txt"; then
    echo "FAILED  $1: doctor without the model"
    cat "$work/tmp/doctor.txt"
    failed=$((failed + 1))
  fi
  rm -rf "$place"
  if [[ "$1" != bare ]]; then
    cp "$wheel" "$deb" "$work/tmp/"
    install -d -o 1000 -g 1000 "$work/opt/artist"
    inside 1000:1000 python3 -m venv /opt/artist/env
    inside 1000:1000 /opt/artist/env/bin/pip install --quiet --disable-pip-version-check --no-cache-dir \
      --no-index "/tmp/$(basename "$wheel")"
    try "$1: wheel" /opt/artist/env/bin/patina
    inside 1000:1000 /opt/artist/env/bin/pip uninstall --quiet --yes patina3d
    if [[ -n "$(find "$work/opt/artist/env" -path '*patina*' -type f)" ]]; then
      echo "FAILED  $1: pip uninstall leaves files"
      failed=$((failed + 1))
    fi
    inside 0:0 dpkg --install "/tmp/$(basename "$deb")" > /dev/null
    try "$1: deb" patina
  fi
  rm -rf "$work"
  work=""
}

OMP_WAIT_POLICY=passive "$build/patina" enhance examples/kettle.glb "${options[@]}" -o "$expected/rusty.glb"
for name in "${systems[@]}"; do check_in "$name"; done
echo "$passed passed, $failed failed, $skipped skipped"
((failed == 0 && passed > 0))
