#!/usr/bin/env bash
# Collects what the program needs at run time into an empty folder, for an image without the rest of Debian: docker/Dockerfile.
#
#   tools/pack_root.sh FOLDER PROGRAM...     as root, where the packages of tools/install_deps.sh --runtime are installed
#
# Takes the programs, the shared libraries that the loader finds for them, the data of PROJ and GDAL, certificates, users, and of each
# package that a file is from its copyright and its entry for scanners (/var/lib/dpkg/status.d).
set -euo pipefail
export LC_ALL=C
folder=$1
shift
files=() packages=()

# A file below its own name, and the targets of its links.
take() {
  local path=$1 target
  while :; do
    [[ -e $folder$path || -L $folder$path ]] || { mkdir -p "$folder$(dirname "$path")"; cp -a "$path" "$folder$path"; }
    files+=("$path")
    [[ -L $path ]] || return 0
    target=$(readlink "$path")
    [[ $target == /* ]] && path=$target || path=$(realpath -s "$(dirname "$path")/$target")
  done
}

mkdir -p "$folder"/{dev,proc,sys,etc,run,usr/{bin,lib,lib64,sbin},var/{cache,lib/dpkg/status.d}}
install -d -m 1777 "$folder/tmp"
for name in bin lib lib64 sbin; do ln -s "usr/$name" "$folder/$name"; done

for program in "$@"; do
  path=$(command -v "$program") || { echo "pack_root: $program is not installed" >&2; exit 1; }
  take "$path"
  missing=$(ldd "$path" | grep 'not found' || true)
  [[ -z $missing ]] || { echo "pack_root: $path: $missing" >&2; exit 1; }
  while read -r library; do take "$library"; done < <(ldd "$path" | grep -o '/[^ ]*')
done
# Libraries that the C library opens by name: answers of DNS.
for library in /usr/lib/*-linux-gnu/libnss_{dns,files}.so.2; do [[ ! -e $library ]] || take "$library"; done
for data in /usr/share/proj /usr/share/gdal /etc/ssl/certs/ca-certificates.crt; do
  [[ -e $data ]] || { echo "pack_root: $data is missing" >&2; exit 1; }
  mkdir -p "$folder$(dirname "$data")"
  cp -a "$data" "$folder$(dirname "$data")/"
  files+=("$data")
done
for name in passwd group nsswitch.conf os-release debian_version; do cp -aL "/etc/$name" "$folder/etc/$name"; done

# Packages own files below /lib or /usr/lib, which are one folder.
for path in "${files[@]}"; do
  for name in "$path" "/usr$path" "${path#/usr}"; do
    package=$(dpkg-query -S "$name" 2> /dev/null | grep -v '^diversion' | head -n 1 | sed 's/[:,].*//') || true
    [[ -z $package ]] || { packages+=("$package"); break; }
  done
done
for package in $(printf '%s\n' "${packages[@]}" | sort -u) base-files ca-certificates; do
  dpkg-query -s "$package" > "$folder/var/lib/dpkg/status.d/$package"
  [[ ! -e /usr/share/doc/$package/copyright ]] || install -Dm644 "/usr/share/doc/$package/copyright" "$folder/usr/share/doc/$package/copyright"
done
