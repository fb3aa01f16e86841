#!/usr/bin/env bash
# Builds the files of a release from one commit, in a copy of it: the source, the Debian package, the recipe of the image, the bill of
# materials and the sums.
#
#   tools/release.sh [--commit COMMIT] [--out FOLDER] [--work FOLDER] [--rehearsal]
#
# COMMIT is HEAD by default, FOLDER build/release-files. --work keeps the copy and its build there. Two runs of one commit on one
# Debian 12 give the same bytes, wherever they work: time stamps are those of the commit, and the compiler replaces the folder's
# name. --rehearsal takes objects from ccache, so it is fast, but its program contains the names of folders. Needs
# tools/install_deps.sh --test.
set -euo pipefail
umask 022
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
commit=HEAD out=$root/build/release-files work="" launcher=(-DTERRACE_CCACHE=) rehearsal=false
die() { echo "release: $*" >&2; exit 1; }
while [[ $# -gt 0 ]]; do
  case $1 in
    --commit) commit=$2; shift 2 ;;
    --out) out=$(realpath -m "$2"); shift 2 ;;
    --work) work=$(realpath -m "$2"); shift 2 ;;
    --rehearsal) launcher=() rehearsal=true; shift ;;
    *) echo "release: unknown option '$1'; it takes --commit, --out, --work and --rehearsal" >&2; exit 2 ;;
  esac
done
[[ -d $root/.deps/boost && -f $root/server/viewer/node_modules/cesium/Build/Cesium/index.js ]] || die ".deps or the viewer's modules are missing; run tools/install_deps.sh"
[[ -n $(git -C "$root" status --porcelain --untracked-files=no) && $commit == HEAD ]] && echo "release: changes that are not committed are not in the release" >&2

git -C "$root" show "$commit:server/viewer/package-lock.json" | cmp -s - "$root/server/viewer/package-lock.json" ||
  die "the viewer's modules are not those of $commit: its server/viewer/package-lock.json differs; check the commit out and run tools/install_deps.sh"
version=$(git -C "$root" show "$commit:CMakeLists.txt" | sed -n 's/^project(terrace VERSION \([0-9.]*\).*/\1/p')
[[ -n $version ]] || die "CMakeLists.txt of $commit states no version"
git -C "$root" show "$commit:CHANGELOG.md" | grep -q "^## \[$version\]" || die "CHANGELOG.md of $commit has no section [$version]"
if [[ -z $work ]]; then
  work=$(mktemp -d)
  trap 'rm -rf "$work"' EXIT
fi
mkdir -p "$work" "$out"
find "$out" -maxdepth 1 -type f \( -name 'terrace[-_]*' -o -name 'SHA256SUMS*' \) -delete  # of an earlier run

# The time stamps of git archive are those of the commit.
git -C "$root" archive --format=tar --prefix="terrace-$version/" "$commit" | gzip -9n > "$out/terrace-$version.tar.gz"
tree=$work/terrace-$version
rm -rf "$tree"
tar -xzf "$out/terrace-$version.tar.gz" -C "$work"
# What tools/install_deps.sh unpacks, which the commit pins.
for folder in .deps server/viewer/node_modules; do
  # Hard links, if both are on one file system; a failure leaves empty folders.
  cp -al "$root/$folder" "$tree/$folder" 2> /dev/null || { rm -rf "${tree:?}/$folder"; cp -a "$root/$folder" "$tree/$folder"; }
done

flags=("'-ffile-prefix-map=$tree=.'" -Werror=date-time)
$rehearsal && flags=()
cmake -S "$tree" --preset release -DTERRACE_BUILD_TESTS=OFF "${launcher[@]}" --log-level=WARNING \
  -DCMAKE_CXX_FLAGS="${flags[*]}" > "$work/configure.log"
cmake --build "$tree/build/release" -j "${JOBS:-$(nproc)}" > "$work/build.log" || { tail -n 30 "$work/build.log" >&2; exit 1; }
# After the build: ccache would take them for part of what it compiles, and they do not change objects.
SOURCE_DATE_EPOCH=$(git -C "$root" log -1 --format=%ct "$commit")
export SOURCE_DATE_EPOCH LC_ALL=C.UTF-8 TZ=UTC
stated=$("$tree/build/release/server/cli/terrace" --version)
[[ $stated == "terrace $version" ]] || die "the program says '$stated', CMakeLists.txt says $version"
"$tree/packaging/build_deb.sh" "$tree/build/release" "$work/deb" > /dev/null
deb=$(basename "$work"/deb/*.deb)
cp "$work/deb/$deb" "$out/"

cp "$tree/docker/Dockerfile" "$out/terrace-$version.Dockerfile"
"$tree/tools/write_sbom.py" "$out/$deb" "$out/terrace-$version.cdx.json" > /dev/null
(cd "$out" && find . -maxdepth 1 -type f -name 'terrace[-_]*' -printf '%f\0' | sort -z | xargs -0 sha256sum -- > SHA256SUMS.part && mv SHA256SUMS.part SHA256SUMS)
(cd "$out" && cat SHA256SUMS)
