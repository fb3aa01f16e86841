#!/bin/sh
# Copies the pages and the libraries that they load into a folder, for use without the Internet. Needs npm, and the
# Internet once.
#
#     examples/offline.sh site && python3 -m http.server --directory site 8000
set -eu
[ $# -eq 1 ] || { echo "offline.sh: name the folder to make, as in: examples/offline.sh site" >&2; exit 2; }
here=$(dirname "$0") folder=$1
cdn=https://cdn.jsdelivr.net/npm
mkdir -p "$folder/npm"
for page in "$here"/*.html; do sed "s#$cdn#/npm#g" "$page" > "$folder/$(basename "$page")"; done
for package in $(grep -oh "$cdn/@\?[^@]*@[0-9.]*" "$here"/*.html | sed "s#$cdn/##" | sort -u); do
  echo "$package"
  mkdir -p "$folder/npm/$package"
  (cd "$folder/npm" && tar -xzf "$(npm pack --silent "$package")" --strip-components=1 -C "$package" && rm ./*.tgz)
done
echo "pages and packages are in $folder; they have to be served, as: python3 -m http.server --directory $folder 8000"
