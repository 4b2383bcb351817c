#!/usr/bin/env bash
# Runs a batch on a real Slurm of one machine that this script starts and ends: small jobs, some of them broken,
# tasks that are killed, and the batch submitted again until every good result is there once. Skipped where
# Debian's slurm-wlm and munge are missing (scripts/setup.sh --slurm installs them) or without root.
#   tests/slurm/check.sh [BUILD_DIR [JOBS]]        build/release and 200 by default
set -euo pipefail
source_dir="$(cd "$(dirname "$0")/../.." && pwd)"
build="$(realpath "${1:-$source_dir/build/release}")"
num_jobs="${2:-200}"
num_broken=10 chunk=10

export PATH="$PATH:/usr/sbin"
for program in munged slurmctld slurmd sbatch setpriv python3; do
  command -v "$program" >/dev/null || { echo "check-slurm: skipped, there is no $program"; exit 0; }
done
[[ "$(id -u)" -eq 0 ]] || { echo "check-slurm: skipped, starting Slurm needs root"; exit 0; }

work="$(mktemp -d)"
fail() { echo "check-slurm: FAILED: $*" >&2; exit 1; }
stop() {
  squeue --noheader --format=%A 2>/dev/null | sort -u | xargs -r scancel --full --signal=KILL 2>/dev/null || true
  for daemon in slurmd slurmctld munged; do
    [[ -f "$work/slurm/$daemon.pid" ]] && kill "$(cat "$work/slurm/$daemon.pid")" 2>/dev/null || true
  done
  sleep 1
  rm -rf "$work"
}
trap stop EXIT

# Slurm: its own ports, folders and key, so that one that runs already is left alone.
mkdir -p "$work/slurm/state" "$work/slurm/spool"
chmod 755 "$work" "$work/slurm"
head -c 128 /dev/urandom >"$work/slurm/munge.key"
chmod 400 "$work/slurm/munge.key"
chown munge "$work/slurm" "$work/slurm/munge.key"
export SLURM_CONF="$work/slurm/slurm.conf"
cat >"$SLURM_CONF" <<CONF
ClusterName=patina
SlurmctldHost=$(hostname)
SlurmUser=root
SlurmctldPort=16817
SlurmdPort=16818
AuthType=auth/munge
AuthInfo=socket=$work/slurm/munge.socket
StateSaveLocation=$work/slurm/state
SlurmdSpoolDir=$work/slurm/spool
SlurmctldPidFile=$work/slurm/slurmctld.pid
SlurmdPidFile=$work/slurm/slurmd.pid
SlurmctldLogFile=$work/slurm/slurmctld.log
SlurmdLogFile=$work/slurm/slurmd.log
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU
JobAcctGatherType=jobacct_gather/none
AccountingStorageType=accounting_storage/none
MpiDefault=none
SchedulerParameters=sched_interval=1
SlurmdParameters=config_overrides
NodeName=$(hostname) CPUs=2 State=UNKNOWN
PartitionName=all Nodes=ALL Default=YES State=UP MaxTime=INFINITE
CONF
setpriv --reuid munge --regid munge --clear-groups munged --socket="$work/slurm/munge.socket" \
  --key-file="$work/slurm/munge.key" --pid-file="$work/slurm/munged.pid" --log-file="$work/slurm/munged.log" \
  --seed-file="$work/slurm/munge.seed" || { echo "check-slurm: skipped, munged does not start here"; exit 0; }
slurmctld && sleep 1 && slurmd || { echo "check-slurm: skipped, Slurm does not start here"; exit 0; }
for ((i = 0; ; ++i)); do
  sinfo --noheader --format=%t 2>/dev/null | grep -q '^idle' && break
  ((i < 30)) || { echo "check-slurm: skipped, Slurm's node does not come up here"; exit 0; }
  sleep 1
done

# The jobs: one small asset with many seeds, and as many broken ones as num_broken.
mkdir "$work/Ann's jobs, 100 %"   # a name in which nothing may be special
cd "$work/Ann's jobs, 100 %"
python3 - "$num_broken" <<'PY'
import base64, json, struct, sys, zlib
def png(size):
    rows = b"".join(b"\0" + b"".join(bytes((90 + 8 * x, 120, 100 + 8 * y)) for x in range(size))
                    for y in range(size))
    chunk = lambda kind, data: struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
    return (b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", size, size, 8, 2, 0, 0, 0)) +
            chunk(b"IDAT", zlib.compress(rows)) + chunk(b"IEND", b""))
corners = [(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]
faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
positions, uvs, indices = b"", b"", b""
for f, face in enumerate(faces):
    for corner, (u, v) in zip(face, ((0, 0), (1, 0), (1, 1), (0, 1))):
        positions += struct.pack("<3f", *corners[corner])
        uvs += struct.pack("<2f", (f % 3 + 0.05 + 0.9 * u) / 3, (f // 3 + 0.05 + 0.9 * v) / 2)
    indices += struct.pack("<6H", *(4 * f + i for i in (0, 1, 2, 0, 2, 3)))
parts = [positions, uvs, indices, png(16)]
views, data = [], b""
for part in parts:
    views.append({"buffer": 0, "byteOffset": len(data), "byteLength": len(part)})
    data += part + b"\0" * (-len(part) % 4)
uri = lambda kind, content: f"data:{kind};base64," + base64.b64encode(content).decode()
gltf = {"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0, "TEXCOORD_0": 1}, "indices": 2, "material": 0}]}],
        "materials": [{"name": "box", "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}],
        "textures": [{"source": 0}], "images": [{"bufferView": 3, "mimeType": "image/png"}],
        "buffers": [{"byteLength": len(data), "uri": uri("application/octet-stream", data)}], "bufferViews": views,
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 24, "type": "VEC3", "min": [-1] * 3, "max": [1] * 3},
                      {"bufferView": 1, "componentType": 5126, "count": 24, "type": "VEC2"},
                      {"bufferView": 2, "componentType": 5123, "count": 36, "type": "SCALAR"}]}
json.dump(gltf, open("box.gltf", "w"))
for i in range(int(sys.argv[1])):
    open(f"broken{i}.gltf", "w").write("{")
PY
good=$((num_jobs - num_broken))
cat >jobs.toml <<TOML
output = "results"
prompts = ["rust"]
[options]
views = 4
resolution = 64
samples = 1
steps = 2
fit-iterations = 1
turntable = 0
[[jobs]]
assets = ["broken*.gltf"]
[[jobs]]
assets = ["box.gltf"]
seeds = [$(seq -s, 1 "$good")]
[slurm]
cpus-per-task = 1
TOML

patina="$build/patina"
submit() { "$patina" batch jobs.toml --slurm --chunk "$chunk"; }
in_queue() { squeue --noheader --format=%i | wc -l; }
wait_for_the_queue() {
  for ((i = 0; $(in_queue) > 0; ++i)); do ((i < 3600)) || fail "the queue is not empty after an hour"; sleep 1; done
}
num_done() { grep -l '"state": "done"' results/*/job.json 2>/dev/null | wc -l; }

submit
said="$(submit 2>&1 || true)"
grep -q "still queued" <<<"$said" || fail "a second array was not refused: $said"
# The tasks of two processors are killed in the middle of their work, twice.
for round in 1 2; do
  for ((i = 0; i < 600; ++i)); do (($(num_done) >= round * good / 8)) && break || sleep 1; done
  running="$(squeue --noheader --array --states=R --format=%i | head -2)"
  [[ -n "$running" ]] || fail "no task runs"
  echo "check-slurm: killing $(echo $running) after $(num_done) jobs"
  scancel --full --signal=KILL $running
done
wait_for_the_queue
echo "check-slurm: the first array left $(num_done) of $good results"
(($(num_done) < good)) || fail "nothing was lost by killing tasks"
find results -name box.gltf -printf '%p %T@\n' | sort >before.txt

submit
wait_for_the_queue
(($(num_done) == good)) || fail "expected $good results, found $(num_done)"
# Once: what was there before was not made again.
find results -name box.gltf -printf '%p %T@\n' | sort >after.txt
done_before="$(comm -12 before.txt after.txt | wc -l)"
(($(wc -l <after.txt) == good)) || fail "$(wc -l <after.txt) results instead of $good"
echo "check-slurm: $done_before results of the first array stayed, $((good - done_before)) came with the second"

set +e
said="$("$patina" batch jobs.toml --collect 2>&1)"
code=$?
set -e
[[ $code -eq 1 ]] || fail "--collect: expected exit code 1 for the broken jobs, found $code"
grep -q "$good done, $num_broken failed" <<<"$said" || fail "--collect said: $said"
grep -q "<b>$good</b> done" results/index.html || fail "the index page does not show $good results"

# One result is what a run alone makes, to the last byte.
"$patina" enhance box.gltf -p rust --seed 7 --views 4 --resolution 64 --samples 1 --steps 2 --fit-iterations 1 \
  --turntable 0 --threads 1 -q -o alone/box.gltf
cmp alone/box.gltf results/box_rust_7/box.gltf || fail "a result differs from that of a run alone"
echo "check-slurm: passed: $good results of $num_jobs jobs, each there once"
