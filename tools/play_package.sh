#!/usr/bin/env bash
# Installs the Debian package in a bare Debian 12, runs it as its unit does, upgrades, removes and purges it, and prints what stays.
#
#   tools/play_package.sh BASE FOLDER DEB     as root
#       BASE: a tar of a debootstrap root with package sources. FOLDER: where it is unpacked, below which all happens; it is emptied.
#
# Port 8080 must be free. systemd does not run there: the command of ExecStart is started as the unit's user.
set -euo pipefail
export LC_ALL=C
base=$(realpath "$1") deb=$(realpath "$3")
mkdir -p "$2"
folder=$(realpath "$2") root=$(realpath "$2")/root server=""
die() { echo "play_package: $*" >&2; exit 1; }
[[ $EUID -eq 0 ]] || die "run it as root"

# shellcheck disable=SC2016  # $0 and $@ are those of the inner shell
# A command in the root, with its own mounts and processes, which end with it.
into() {
  unshare --mount --pid --fork --kill-child bash -c 'mount --make-rprivate / && mount -t proc proc "$0/proc" && mount --rbind /dev "$0/dev" &&
    exec env -i PATH=/usr/sbin:/usr/bin:/sbin:/bin HOME=/root LC_ALL=C.UTF-8 DEBIAN_FRONTEND=noninteractive chroot "$0" "$@"' "$root" "$@" < /dev/null
}
step() { echo "+ $*"; into "$@"; }
# shellcheck disable=SC2016  # a format of dpkg-query
status() { into dpkg-query -W -f '${db:Status-Abbrev}${Version}\n' terrace 2> /dev/null || echo "not installed"; }
snapshot() { (cd "$root" && find . -xdev \( -path ./proc -o -path ./dev -o -path ./sys \) -prune -o -printf '%P\n') | sort; }
end_server() { [[ -z $server ]] || pkill -KILL -P "$server" || true; }
trap end_server EXIT

rm -rf "$root"
mkdir -p "$root"
tar -C "$root" -xf "$base"
echo "bare: $(into dpkg-query -W | wc -l) packages, Debian $(cat "$root/etc/debian_version")"
into apt-get -qq update
into apt-get -qq satisfy -y --no-install-recommends "$(dpkg-deb -f "$deb" Depends)" > "$folder/depends.log" 2>&1 || { tail "$folder/depends.log" >&2; die "Debian does not have what the package depends on"; }
echo "with its dependencies: $(into dpkg-query -W | wc -l) packages"
snapshot > "$folder/before"

version=$(dpkg-deb -f "$deb" Version)
cp "$deb" "$root/tmp/terrace.deb"
dpkg-deb -R "$deb" "$folder/newer"
sed -i "s/^Version: .*/Version: $version+1/" "$folder/newer/DEBIAN/control"
dpkg-deb --root-owner-group -b "$folder/newer" "$root/tmp/newer.deb" > /dev/null
rm -rf "$folder/newer"

step dpkg -i /tmp/terrace.deb
echo "$(status); $(into id terrace)"
unit=$root/lib/systemd/system/terrace.service
user=$(sed -n 's/^User=//p' "$unit")
read -ra command <<< "$(sed -n 's/^ExecStart=//p' "$unit")"
into install -d -o "$user" -g "$user" "/var/cache/$(sed -n 's/^CacheDirectory=//p' "$unit")"
echo "+ ${command[*]}, as $user"
into setpriv --reuid "$user" --regid "$user" --clear-groups env CACHE_DIRECTORY=/var/cache/terrace "${command[@]}" > "$folder/server.log" 2>&1 &
server=$!
for _ in $(seq 60); do
  if curl -sf -o /dev/null http://127.0.0.1:8080/readyz; then break; fi
  sleep 1
done
for path in /readyz / /earth/layer.json /earth/0/0/0.terrain /jacksboro/9/272/359.terrain; do
  curl -sf -o /dev/null -w "  %{http_code} %{size_download} bytes %{content_type} $path\n" "http://127.0.0.1:8080$path" || { cat "$folder/server.log" >&2; die "$path failed"; }
done
kill -TERM "$(pgrep -P "$(pgrep -P "$server")")"  # the child of unshare
code=0
wait "$server" || code=$?
server=""
echo "ends after SIGTERM with $code"
[[ $code -eq 0 ]] || { cat "$folder/server.log" >&2; die "the server ended with $code"; }

sed -i 's/0\.0\.0\.0:8080/127.0.0.1:8081/' "$root/etc/terrace/terrace.json"
step dpkg -i --force-confdef /tmp/newer.deb
grep -q 127.0.0.1:8081 "$root/etc/terrace/terrace.json" || die "the upgrade has replaced a changed configuration"
echo "$(status); the changed configuration has stayed"
into terrace serve --config /etc/terrace/terrace.json --check-config
step dpkg --remove terrace
[[ -e $root/etc/terrace/terrace.json && ! -e $root/usr/bin/terrace ]] || die "after the removal only the configuration and caches may be there"
status
step dpkg --purge terrace
rm -f "$root"/tmp/*.deb
snapshot > "$folder/after"
echo "$(status); paths that the purge leaves (>) or takes from the state before (<):"
diff "$folder/before" "$folder/after" | grep '^[<>]' || echo "  none"
grep -H terrace "$root"/etc/{passwd,group,shadow,gshadow} | sed "s,^$root,  ," || true
