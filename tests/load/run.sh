#!/usr/bin/env bash
# Measures a running server as its viewers load it, cold and warm, and prints a Markdown table.
#
#   tests/load/run.sh http://HOST:PORT/DATASET [SECONDS] [CONNECTIONS]     default: 20 seconds, 32 connections
#
# Start the server afresh: the first row is only cold if nothing has been built yet. The second row sends the same requests
# again. "built" counts tiles meshed in that time, from /metrics. Client and server share a machine unless you separate them.
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
"$here/walk.py" "$dataset" > "$WALK"
echo "$(wc -l < "$WALK") requests for $(sort -u "$WALK" | wc -l) tiles, $connections connections, $seconds s each" >&2

builds() {
  python3 - "$dataset" <<'PYTHON'
import sys, urllib.parse, urllib.request
with urllib.request.urlopen(urllib.parse.urljoin(sys.argv[1], "/metrics"), timeout=30) as reply:
    lines = reply.read().decode().splitlines()
print(int(sum(float(line.split()[-1]) for line in lines if line.startswith("terrace_tile_builds_total{"))))
PYTHON
}

echo "| cache | requests/s | tiles built/s | p50 ms | p99 ms | MB/s | KB a tile | errors |"
echo "|---|---|---|---|---|---|---|---|"
for state in cold warm; do
  before=$(builds)
  figures=$(wrk -t 2 -c "$connections" -d "$seconds" --timeout 30s -s "$here/replay.lua" "$dataset" < /dev/null | grep '^{')
  python3 - "$state" "$figures" "$(($(builds) - before))" <<'PYTHON'
import json, sys
state, figures, built = sys.argv[1], json.loads(sys.argv[2]), int(sys.argv[3])
seconds, requests = figures["seconds"], max(figures["requests"], 1)
print(f"| {state} | {figures['requests'] / seconds:,.0f} | {built / seconds:,.1f} | {figures['p50_ms']:.2f} | "
      f"{figures['p99_ms']:.2f} | {figures['bytes'] / seconds / 1e6:.1f} | {figures['bytes'] / requests / 1e3:.1f} | "
      f"{figures['status_errors'] + figures['socket_errors']} |")
PYTHON
done
