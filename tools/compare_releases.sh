#!/usr/bin/env bash
# Builds the release twice in two folders of different names, and compares the files byte by byte.
#
#   tools/compare_releases.sh
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
for name in first second/with/a/longer/name; do
  "$root/tools/release.sh" --work "$scratch/$name" --out "$scratch/out-${name%%/*}" > /dev/null
done
diff -r "$scratch/out-first" "$scratch/out-second" || { echo "compare_releases: the files above differ" >&2; exit 1; }
cat "$scratch/out-first/SHA256SUMS"
echo "two builds are equal"
