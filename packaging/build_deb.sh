#!/usr/bin/env bash
# Packs a release build as a Debian package: build/deb/terrace_VERSION_ARCH.deb.
#
#   packaging/build_deb.sh [BUILD [OUT]]     BUILD: the folder of `make build`, by default build/release;
#                                            OUT: where the package goes, by default build/deb
#
# DEBFULLNAME and DEBEMAIL name the maintainer. Needs debhelper and help2man (tools/install_deps.sh --test). Two runs over one build give the same bytes: the time
# stamps are those of the last commit.
set -euo pipefail
export LC_ALL=C.UTF-8
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
BUILD=$(realpath "${1:-$root/build/release}") SOURCE=$root
export BUILD SOURCE
terrace=$BUILD/server/cli/terrace
[[ -x $terrace ]] || { echo "build_deb: $terrace is missing; run make build" >&2; exit 1; }
version=$("$terrace" --version | grep -oE '[0-9]+\.[0-9]+\.[0-9]+')
SOURCE_DATE_EPOCH=${SOURCE_DATE_EPOCH:-$(git -C "$root" log -1 --format=%ct)}
export SOURCE_DATE_EPOCH

maintainer="${DEBFULLNAME:-The terrace authors} <${DEBEMAIL:-terrace@lists.example.org}>"

out=$(realpath -m "${2:-$root/build/deb}")
rm -rf "$out"/terrace "$out"/terrace_* "$out"/build.log
mkdir -p "$out/terrace/man"
cp -r "$root/packaging/debian" "$out/terrace/debian"
cd "$out/terrace"

sed -i "s/^Maintainer:.*/Maintainer: $maintainer/" debian/control
cat > debian/changelog << END
terrace ($version) bookworm; urgency=medium

  * See CHANGELOG.md of the source.

 -- $maintainer  $(date -R -u -d "@$SOURCE_DATE_EPOCH")
END
sed -e 's,/usr/local/bin/,/usr/bin/,; s/^DynamicUser=yes/User=terrace/; /^# Copy to/d; /^# With terrace.socket/d' \
  "$root/config/systemd/terrace.service" > debian/terrace.service
sed -e 's/^# Copy both.*/# The package enables both./' -e 's/ Copy both to [^:]*: systemctl enable --now terrace.socket terrace.service//' \
  "$root/config/systemd/terrace.socket" > debian/terrace.socket

# Manual pages, from the help texts of the program itself. help2man divides the command at blanks, so the folder of the
# program is in PATH.
export PATH=$BUILD/server/cli:$PATH
manual() {
  local name=$1 what=$2
  shift 2
  help2man --no-info --section=1 --version-string="$version" --source="terrace $version" --manual="terrace" --name="$what" \
    --output="man/$name.1" "$*"
  # The name of a page has no blank.
  sed -i "s/^terrace ${name#terrace-} \\\\- /$name \\\\- /; s/^[.]TH TERRACE/.TH ${name^^}/" "man/$name.1"
}
manual terrace "level-of-detail terrain tile server" terrace
terrace --help | sed -n '/^Commands:/,/^$/s/^  \([a-z]*\)  *\(.*\)/\1 \2/p' | while read -r command what; do
  manual "terrace-$command" "${what,}" terrace "$command"
done

dpkg-buildpackage --build=binary --no-sign --unsigned-changes > "$out/build.log" 2>&1 || { tail -n 30 "$out/build.log" >&2; exit 1; }
rm -rf "$out/terrace"
ls "$out"/*.deb
