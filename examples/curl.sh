#!/bin/sh
# What terrace serves, asked for with curl. Files go into a new folder, which the last line names.
#
#     examples/curl.sh [http://HOST:PORT] [DATASET]
set -eu
server=${1:-http://127.0.0.1:8080}
dataset=${2:-$(curl -fsS "$server/datasets" | sed 's/.*"datasets":\[{"name":"\([^"]*\)".*/\1/')}
folder=$(mktemp -d)
show() { echo; echo "\$ curl $*"; }
get() { show "$@"; curl -fsS "$@"; echo; }

get "$server/datasets"
get "$server/$dataset/layer.json"

# A height in the middle of the dataset, and the deepest tile there.
middle=$(curl -fsS "$server/$dataset/tiles.json" | sed 's/.*"bounds":\[\([^]]*\)\].*/\1/' | awk -F, '{ printf "%.6f,%.6f", ($2 + $4) / 2, ($1 + $3) / 2 }')
get "$server/$dataset/heights?locations=$middle&certify=deepest"
tile=$(curl -fsS "$server/$dataset/heights?locations=$middle&certify=deepest" | sed 's/.*"tile":"\([^"]*\)".*/\1/')

# The tile as quantized-mesh with normals, and as glTF. The headers state the error and the time that each step took.
get -D - -o "$folder/tile.terrain" --compressed -H 'Accept: application/vnd.quantized-mesh;extensions=octvertexnormals' "$server/$dataset/$tile.terrain"
get -D - -o "$folder/tile.glb" "$server/$dataset/$tile.glb?compression=none"
# Asked for again with its ETag it is not sent again: 304.
etag=$(curl -fsS -o "$folder/again.terrain" -D - "$server/$dataset/$tile.terrain" | tr -d '\r' | sed -n 's/^etag: //Ip')
get -o "$folder/not_sent" -w '%{http_code}' -H "If-None-Match: $etag" "$server/$dataset/$tile.terrain"

# Heights along a line, 2 degrees or to the middle of the dataset, and the top of the world as an image of heights.
ls -l "$folder"
