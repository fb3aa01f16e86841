#!/usr/bin/env bash
# Builds the release twice in two folders of different names, and compares the files byte by byte. If the packages differ, it lists
# which of their files do.
#
#   tools/compare_releases.sh [FOLDER]     FOLDER keeps both builds and what they made; without it all is removed
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
if [[ $# -gt 0 ]]; then
  scratch=$(realpath -m "$1")
  mkdir -p "$scratch"
else
  scratch=$(mktemp -d)
  trap 'rm -rf "$scratch"' EXIT
fi
for name in first second/with/a/longer/name; do
  "$root/tools/release.sh" --work "$scratch/$name" --out "$scratch/out-${name%%/*}" > /dev/null
done
if ! diff -rq "$scratch/out-first" "$scratch/out-second"; then
  for name in first second; do
    rm -rf "$scratch/unpacked-$name"
    dpkg-deb -R "$scratch/out-$name"/*.deb "$scratch/unpacked-$name"
  done
  diff -rq --no-dereference "$scratch/unpacked-first" "$scratch/unpacked-second" || true
  echo "compare_releases: the files above differ" >&2
  exit 1
fi
cat "$scratch/out-first/SHA256SUMS"
echo "two builds are equal"
