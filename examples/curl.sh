#!/bin/sh
# Requests what terrace serves with curl. Writes files into a new folder, and lists them at the end.
#
#     examples/curl.sh [http://HOST:PORT] [DATASET]
set -eu
server=${1:-http://127.0.0.1:8080}
datasets=$(curl -fsS "$server/datasets")
dataset=${2:-$(printf '%s' "$datasets" | sed -n 's/^{"datasets":\[{"name":"\([^"]*\)".*/\1/p')}
[ "$dataset" ] || { echo "curl.sh: $server shows no dataset: all are being prepared, or need a token" >&2; exit 1; }
folder=$(mktemp -d)

# Prints the command and runs it.
get() {
  printf '\n$ curl'
  for word in "$@"; do
    case $word in *[!A-Za-z0-9:/._,=-]*) printf " '%s'" "$word" ;; *) printf ' %s' "$word" ;; esac
  done
  echo && curl -fsS "$@" && echo
}

get "$server/datasets"
get "$server/$dataset/layer.json"
get "$server/$dataset/tiles.json"

# The height at the centre of the dataset, and the tile of the deepest level there.
bounds=$(printf '%s' "$datasets" | sed 's/.*"name":"'"$dataset"'"[^}]*"bounds":\[\([^]]*\)\].*/\1/')
middle=$(echo "$bounds" | awk -F, '{ lon = ($1 + $3 + 360 * ($1 > $3)) / 2; printf "%.6f,%.6f", ($2 + $4) / 2, lon - 360 * (lon > 180) }')
get "$server/$dataset/heights?locations=$middle&certify=deepest"
tile=$(curl -fsS "$server/$dataset/heights?locations=$middle&certify=deepest" | sed 's/.*"tile":"\([^"]*\)".*/\1/')

# That tile as quantized-mesh with normals, and as glTF. The headers state its error and the time of each step.
get -D - -o "$folder/tile.terrain" --compressed -H 'Accept: application/vnd.quantized-mesh;extensions=octvertexnormals' "$server/$dataset/$tile.terrain"
get -D - -o "$folder/tile.glb" "$server/$dataset/$tile.glb?compression=none"

# The same tile with the ETag of the first reply: the server answers 304 and does not send it again.
etag=$(curl -fsS -o "$folder/plain.terrain" -D - "$server/$dataset/$tile.terrain" | tr -d '\r' | sed -n 's/^ETag: //p')
get -o "$folder/not_sent" -w '%{http_code}' -H "If-None-Match: $etag" "$server/$dataset/$tile.terrain"

# Heights along a line of 1 km to the north, by POST as a form.
north=$(echo "$middle" | awk -F, '{ printf "%.6f,%.6f", $1 + 0.009, $2 }')
get --data-urlencode "path=$middle|$north" --data-urlencode samples=5 "$server/$dataset/heights"

# One mesh of 0.05 x 0.05 degrees, as Wavefront OBJ.
box=$(echo "$middle" | awk -F, 'function wrap(lon) { return lon + 360 * (lon < -180) - 360 * (lon > 180) }
  { printf "%.6f,%.6f,%.6f,%.6f", wrap($2 - 0.025), $1 - 0.025, wrap($2 + 0.025), $1 + 0.025 }')
get -D - -o "$folder/area.obj" "$server/$dataset/mesh?bbox=$box&error=20&format=obj"

ls -l "$folder"/*
