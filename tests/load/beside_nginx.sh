#!/usr/bin/env bash
# Compares the rate of cached tiles with nginx, which sends the same bytes from a file. Prints a Markdown table.
#
#   tests/load/beside_nginx.sh TERRACE TILE_URL [TURNS] [SECONDS] [CONNECTIONS]     default: 5 turns, 3 seconds, 64 connections
# TERRACE: the process id of the server, or a pattern for `pgrep -f`. TILE_URL: any of its tiles, requested with
# Accept-Encoding: gzip. With TILES=FILE, one path a line, these tiles are requested in turn, because a single tile
# stays in every processor's cache. Start the server with one io thread and `log_level` warn, because nginx runs one
# worker without a log.  Both take turns. Requests a second are those of wrk. Microseconds are the processor time of the
# serving process, which other load on the machine affects less. The table has the minimum and the median of all turns;
# of requests a second, the best and the median.
set -euo pipefail
export LC_ALL=C
[[ $# -ge 2 && $# -le 5 ]] || { sed -n '2,/^set /{s/^# \{0,1\}//;/^set /!p}' "${BASH_SOURCE[0]}" >&2; exit 2; }
pattern=$1 url=$2 turns=${3:-5} seconds=${4:-3} connections=${5:-64}
for tool in nginx wrk curl; do
  command -v "$tool" > /dev/null || { echo "beside_nginx.sh: $tool is not installed: apt-get install nginx-light wrk curl" >&2; exit 1; }
done
if [[ $pattern =~ ^[0-9]+$ ]]; then terrace=$pattern; else terrace=$(pgrep -f "$pattern" | head -n 1); fi
[[ -n $terrace && -d /proc/$terrace ]] || { echo "beside_nginx.sh: no process matches '$pattern'" >&2; exit 1; }

folder=$(mktemp -d)
chmod 755 "$folder"
trap 'kill "$(cat "$folder/pid" 2> /dev/null)" 2> /dev/null || true; rm -rf "$folder"' EXIT
if [[ -n ${TILES:-} ]]; then mapfile -t paths < "$TILES"; else paths=("/${url#*://*/}"); fi
origin=$(sed -E 's#^([a-z]+://[^/]+).*#\1#' <<< "$url")
for i in "${!paths[@]}"; do
  printf 'url = "%s%s"\noutput = "%s/tile%d"\n' "$origin" "${paths[i]}" "$folder" "$i"
done > "$folder/curl"
curl -fsS --no-progress-meter -H 'Accept-Encoding: gzip' --config "$folder/curl"
# wrk sends the same prepared requests to both servers.
cat > "$folder/turns.lua" <<'LUA'
local requests, turn = {}, 0
function init(arguments)
  for path in io.lines(arguments[1]) do requests[#requests + 1] = wrk.format("GET", path) end
end
function request()
  turn = turn % #requests + 1
  return requests[turn]
end
LUA
printf '%s\n' "${paths[@]}" > "$folder/terrace.txt"
for i in "${!paths[@]}"; do echo "/tile$i"; done > "$folder/nginx.txt"
port=$(python3 -c 'import socket; s = socket.socket(); s.bind(("127.0.0.1", 0)); print(s.getsockname()[1])')
cat > "$folder/nginx.conf" <<CONF
worker_processes 1; pid $folder/pid; error_log $folder/error.log;
events { worker_connections 4096; }
http {
  access_log off; sendfile on; tcp_nopush on; tcp_nodelay on; keepalive_requests 1000000000; default_type application/octet-stream;
  open_file_cache max=10000; open_file_cache_valid 1h;
  server { listen 127.0.0.1:$port; root $folder; }
}
CONF
nginx -c "$folder/nginx.conf"
sleep 0.5
worker=$(pgrep -P "$(cat "$folder/pid")" | head -n 1)
# One processor for the server, one for the client: threads that change processors would slow both servers down.
wrk=(wrk)
if [[ $(nproc) -gt 1 ]] && command -v taskset > /dev/null; then
  taskset -a -c -p 0 "$terrace" > /dev/null
  taskset -c -p 0 "$worker" > /dev/null
  wrk=(taskset -c 1 wrk)
fi

python3 - "${wrk[*]}" "$turns" "$seconds" "$connections" "$folder" \
  "terrace $terrace $origin" "nginx $worker http://127.0.0.1:$port" <<'PYTHON'
import os, pathlib, re, statistics, subprocess, sys

wrk = sys.argv[1].split()
turns, seconds, connections = (int(argument) for argument in sys.argv[2:5])
folder = pathlib.Path(sys.argv[5])
sizes = [file.stat().st_size for file in folder.glob("tile*")]
tick = 1e6 / os.sysconf("SC_CLK_TCK")


def processor_us(pid):
    with open(f"/proc/{pid}/stat", encoding="ascii") as file:
        fields = file.read().rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) * tick


runs = {}
for _ in range(turns):
    for contender in sys.argv[6:]:
        name, pid, url = contender.split()
        before = processor_us(pid)
        out = subprocess.run([*wrk, "-t1", f"-c{connections}", f"-d{seconds}s", "--latency", "-H", "Accept-Encoding: gzip",
                              "-s", folder / "turns.lua", url, folder / f"{name}.txt"],
                             capture_output=True, text=True, check=True, stdin=subprocess.DEVNULL).stdout
        used = processor_us(pid) - before
        if "Non-2xx" in out or "Socket errors" in out:
            sys.exit(f"beside_nginx.sh: {url} failed:\n{out}")
        requests = int(re.search(r"(\d+) requests in", out)[1])
        p99, unit = re.search(r"99%\s+([\d.]+)(us|ms|s)", out).groups()
        runs.setdefault(name, []).append((float(re.search(r"Requests/sec:\s+([\d.]+)", out)[1]), used / requests,
                                          float(p99) * {"us": 1e-3, "ms": 1, "s": 1e3}[unit]))

print(f"{len(sizes)} tiles of {statistics.mean(sizes):,.0f} bytes, {connections} connections, {turns} turns of {seconds} s each\n")
print("| | requests/s, best | median | p99 ms, least | median | us of processor a request, least | median |")
print("|---|---|---|---|---|---|---|")
for name, values in runs.items():
    rate, used, p99 = zip(*values)
    print(f"| {name} | {max(rate):,.0f} | {statistics.median(rate):,.0f} | {min(p99):.2f} | {statistics.median(p99):.2f} | "
          f"{min(used):.1f} | {statistics.median(used):.1f} |")
ours, theirs = runs["terrace"], runs["nginx"]
print(f"| ratio | {max(r for r, _, _ in ours) / max(r for r, _, _ in theirs):.2f} | | "
      f"{min(p for _, _, p in ours) / min(p for _, _, p in theirs):.2f} | | "
      f"{min(u for _, u, _ in ours) / min(u for _, u, _ in theirs):.2f} | |")
PYTHON
