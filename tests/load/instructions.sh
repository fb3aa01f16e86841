#!/usr/bin/env bash
# Counts the instructions of a cached tile outside the kernel with valgrind. The count does not depend on other load.
#
#   tests/load/instructions.sh BINARY CONFIG PATH [REQUESTS]     PATH: of any tile; default: 3000 requests
# Prints instructions a request. Leaves the profile in ./callgrind.out.* for callgrind_annotate.
set -euo pipefail
export LC_ALL=C
[[ $# -ge 3 && $# -le 4 ]] || { sed -n '2,/^set /{s/^# \{0,1\}//;/^set /!p}' "${BASH_SOURCE[0]}" >&2; exit 2; }
binary=$1 config=$2 path=$3 requests=${4:-3000}
command -v valgrind > /dev/null || { echo "instructions.sh: valgrind is not installed: apt-get install valgrind" >&2; exit 1; }
port=$(python3 -c 'import socket; s = socket.socket(); s.bind(("127.0.0.1", 0)); print(s.getsockname()[1])')
rm -f callgrind.out callgrind.out.[0-9]*
valgrind --tool=callgrind --callgrind-out-file=callgrind.out --instr-atstart=no \
  "$binary" serve --config "$config" --listen "127.0.0.1:$port" --io-threads 1 --log-level warn --access-log off > /dev/null 2>&1 &
server=$!
trap 'kill "$server" 2> /dev/null || true; wait "$server" 2> /dev/null || true' EXIT
for _ in $(seq 300); do curl -fsS "http://127.0.0.1:$port/livez" > /dev/null 2>&1 && break; sleep 0.2; done

ask() {
  python3 - "$port" "$path" "$1" <<'PYTHON'
import http.client, sys
connection = http.client.HTTPConnection("127.0.0.1", int(sys.argv[1]), timeout=60)
for _ in range(int(sys.argv[3])):
    connection.request("GET", sys.argv[2], headers={"Accept-Encoding": "gzip"})
    reply = connection.getresponse()
    reply.read()
    assert reply.status == 200, reply.status
PYTHON
}

ask 300
callgrind_control -i on "$server" > /dev/null
ask "$requests"
callgrind_control -i off "$server" > /dev/null
callgrind_control -d "$server" > /dev/null
callgrind_annotate callgrind.out.1 2> /dev/null | awk -v n="$requests" '/PROGRAM TOTALS/ { gsub(",", ""); printf "%d instructions a request\n", $1 / n }'
