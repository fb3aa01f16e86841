#!/usr/bin/env bash
# Measures a running server under the load of viewers, cold and warm, and prints a Markdown table.
#
#   tests/load/run.sh http://HOST:PORT/DATASET [SECONDS] [CONNECTIONS]     default: 20 seconds, 32 connections
# cold: every tile of the walk once. Start a new server, otherwise it has built some tiles already; the column "built"
# shows the number. warm: the whole walk, with popular tiles more often, by wrk, for SECONDS. WALK_OPTIONS are passed to
# walk.py. TILES=FILE, as terrace fly --urls FILE writes it, is requested instead of a walk. With PID=... of the server the
# table has its processor time a request. Client and server share a machine unless you separate them.
set -euo pipefail
export LC_ALL=C
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
[[ $# -ge 1 && $# -le 3 ]] || { sed -n '2,/^set /{s/^# \{0,1\}//;/^set /!p}' "${BASH_SOURCE[0]}" >&2; exit 2; }
dataset=${1%/}
seconds=${2:-20}
connections=${3:-32}
command -v wrk > /dev/null || { echo "run.sh: wrk is not installed; tools/install_deps.sh --test installs it" >&2; exit 1; }

WALK=$(mktemp)
export WALK
trap 'rm -f "$WALK"' EXIT
read -ra walk_options <<< "${WALK_OPTIONS:-}"
if [[ -n ${TILES:-} ]]; then cp "$TILES" "$WALK"; else "$here/walk.py" "$dataset" "${walk_options[@]}" > "$WALK"; fi
echo "$(wc -l < "$WALK") requests for $(sort -u "$WALK" | wc -l) tiles, $connections connections, $seconds s" >&2

# Milliseconds of processor time that the server has used; 0 if PID is not set.
used_ms() {
  if [[ -z ${PID:-} ]]; then echo 0; return; fi
  python3 -c 'import os, sys
fields = open(f"/proc/{sys.argv[1]}/stat").read().rsplit(")", 1)[1].split()
print((int(fields[11]) + int(fields[12])) * 1000 // os.sysconf("SC_CLK_TCK"))' "$PID"
}

builds() {
  python3 - "$dataset" <<'PYTHON'
import sys, urllib.parse, urllib.request
with urllib.request.urlopen(urllib.parse.urljoin(sys.argv[1], "/metrics"), timeout=30) as reply:
    lines = reply.read().decode().splitlines()
print(int(sum(float(line.split()[-1]) for line in lines if line.startswith("terrace_tile_builds_total{"))))
PYTHON
}

row() {  # NAME JSON TILES_BUILT CPU_MS
  python3 - "$@" <<'PYTHON'
import json, sys
name, figures, built, used_ms = sys.argv[1], json.loads(sys.argv[2]), int(sys.argv[3]), int(sys.argv[4])
seconds, requests = figures["seconds"], max(figures["requests"], 1)
print(f"| {name} | {figures['requests']:,} | {built:,} | {figures['requests'] / seconds:,.0f} | {figures['p50_ms']:.2f} | "
      f"{figures['p99_ms']:.2f} | {figures['bytes'] / seconds / 1e6:.1f} | {figures['bytes'] / requests / 1e3:.1f} | {used_ms / requests:.3f} | {figures['errors']} |")
PYTHON
}

echo "| cache | requests | built | requests/s | p50 ms | p99 ms | MB/s | KB each | CPU ms each | errors |"
echo "|---|---|---|---|---|---|---|---|---|---|"
before=$(builds) used=$(used_ms)
figures=$("$here/once.py" "$dataset" "$WALK" "$connections")
after=$(builds)
row cold "$figures" $((after - before)) $(($(used_ms) - used))
used=$(used_ms)
figures=$(wrk -t 2 -c "$connections" -d "$seconds" --timeout 30s -s "$here/replay.lua" "$dataset" < /dev/null | grep '^{')
row warm "$figures" $(($(builds) - after)) $(($(used_ms) - used))
