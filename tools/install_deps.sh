#!/usr/bin/env bash
# Installs what terrace needs on Debian 12: packages, the Boost 1.81 headers (.deps/boost), and the viewer's npm
# modules. Installs only what is missing, so a second run takes a moment. Run it as root, or as a user who may use sudo.
#
#   tools/install_deps.sh            everything for building and running
#   tools/install_deps.sh --test     also everything for tests, benchmarks, formatting and load tests
#   tools/install_deps.sh --runtime  only what a binary needs that was built elsewhere (docker/Dockerfile)
set -euo pipefail
export LC_ALL=C DEBIAN_FRONTEND=noninteractive
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)

build_packages=(
  g++ cmake ninja-build make git pkg-config ccache ca-certificates gzip python3
  libgdal-dev libproj-dev libgeos-dev gdal-bin nlohmann-json3-dev libspdlog-dev libfmt-dev libexpected-dev libcli11-dev prometheus-cpp-dev
  libssl-dev libdeflate-dev zlib1g-dev libbrotli-dev libzstd-dev libxxhash-dev libhwy-dev libdraco-dev libmeshoptimizer-dev
  libjpeg62-turbo-dev libwebp-dev libprotozero-dev librocksdb-dev libsystemd-dev libhiredis-dev
)
runtime_packages=(
  ca-certificates libgdal32 libproj25 libgeos-c1v5 libspdlog1.10 libfmt9 libprometheus-cpp-core1.0 libssl3 libdeflate0 zlib1g libbrotli1 libzstd1
  libxxhash0 librocksdb7.8 libhwy1 libdraco7 libmeshoptimizer2d libjpeg62-turbo libwebp7 libsystemd0 libhiredis0.14
)
test_packages=(
  build-essential libgtest-dev libgmock-dev libbenchmark-dev libpng-dev chromium python3-jsonschema strace wrk proj-bin
  clang-14 libclang-rt-14-dev lld llvm-14 clang-format-14 clang-tidy-14 nginx-light curl openssl faketime pyflakes3 redis-server
  prometheus python3-yaml python3-numpy
  debhelper help2man lintian mkdocs systemd
)

die() { echo "install_deps: $*" >&2; exit 1; }

with_tests=false runtime_only=false
case "${1:-}" in
  "") ;;
  --test) with_tests=true ;;
  --runtime) runtime_only=true ;;
  -h | --help) sed -n '2,/^set /{s/^# \{0,1\}//;/^set /!p}' "${BASH_SOURCE[0]}"; exit 0 ;;
  *) echo "install_deps: unknown option '$1'; it takes --test, --runtime or nothing" >&2; exit 2 ;;
esac

as_root() {
  if [[ $EUID -eq 0 ]]; then "$@"
  elif command -v sudo > /dev/null; then sudo --preserve-env=DEBIAN_FRONTEND,LC_ALL "$@"
  else die "this needs root and there is no sudo; run as root: $*"
  fi
}

lists_are_fresh=false
refresh_package_lists() {
  $lists_are_fresh && return
  echo "install_deps: apt-get update"
  as_root apt-get -qq update
  lists_are_fresh=true
}

is_installed() { [[ $(dpkg-query -W -f='${db:Status-Status}' "$1" 2> /dev/null) == installed ]]; }

install_packages() {
  local wanted=("${build_packages[@]}") missing=() package
  $with_tests && wanted+=("${test_packages[@]}")
  $runtime_only && wanted=("${runtime_packages[@]}")
  # Node from another source is good enough, and Debian's package would remove it.
  if $runtime_only; then :
  elif ! command -v node > /dev/null || ! command -v npm > /dev/null; then wanted+=(nodejs npm); fi
  # Likewise kubectl.
  if $with_tests && ! command -v kubectl > /dev/null; then wanted+=(kubernetes-client); fi
  for package in "${wanted[@]}"; do is_installed "$package" || missing+=("$package"); done
  if [[ ${#missing[@]} -eq 0 ]]; then return; fi
  command -v apt-get > /dev/null || die "apt-get not found; on other systems install the counterparts of: ${missing[*]}"
  # The tests start their own nginx and Redis, and of Prometheus they take promtool: the services that this installs are
  # not wanted. Those that run already are the user's.
  local service services=() unwanted=()
  $with_tests && [[ -d /run/systemd/system ]] && services=(nginx redis-server prometheus)
  for service in "${services[@]}"; do systemctl is-active --quiet "$service" || unwanted+=("$service"); done
  refresh_package_lists
  echo "install_deps: apt-get install ${missing[*]}"
  as_root apt-get -qq install -y --no-install-recommends "${missing[@]}"
  for service in "${unwanted[@]}"; do
    if systemctl is-active --quiet "$service"; then as_root systemctl disable --quiet --now "$service" || true; fi
  done
}

# Boost 1.81 or later. Debian 12 has 1.81, but its -dev package conflicts with the 1.74 that libgdal-dev depends on: unpack
# its headers beside the system's.
boost_version() { sed -n 's/^#define BOOST_VERSION \([0-9]*\).*/\1/p' "$1/boost/version.hpp" 2> /dev/null || true; }

install_boost() {
  local prefix=$root/.deps/boost version package scratch
  version=$(boost_version "$prefix/usr/include")
  if [[ ${version:-0} -ge 108100 ]]; then return; fi
  version=$(boost_version /usr/include)
  if [[ ${version:-0} -ge 108100 ]]; then return; fi
  refresh_package_lists
  package=$(apt-cache search --names-only '^libboost1\.(8[1-9]|9[0-9])-dev$' | awk '{ print $1 }' | sort -V | head -n 1)
  [[ -n $package ]] || die "no libboost1.81-dev or later in the package lists; put Boost >= 1.81 under $prefix/usr yourself"
  echo "install_deps: unpacking the headers of $package into .deps/boost"
  mkdir -p "$root/.deps"
  scratch=$(mktemp -d -p "$root/.deps")  # on one file system, so that the move is whole or not at all
  trap "rm -rf '$scratch'" EXIT
  (cd "$scratch" && apt-get -qq -o APT::Sandbox::User=root download "$package" && dpkg -x "$package"_*.deb unpacked)
  rm -rf "$prefix"
  chmod 755 "$scratch/unpacked"
  mv "$scratch/unpacked" "$prefix"
  rm -rf "$scratch"
}

# Installs exactly what package-lock.json of the folder says, if it is not there already.
install_node_modules() {
  local folder=$root/$1
  [[ -f $folder/package-lock.json ]] || return 0
  if [[ $folder/node_modules/.package-lock.json -nt $folder/package-lock.json ]]; then return; fi
  echo "install_deps: npm ci in $1"
  (cd "$folder" && npm ci --ignore-scripts --no-audit --no-fund --loglevel=error < /dev/null)
  touch "$folder/node_modules/.package-lock.json"
}

install_packages
if $runtime_only; then exit 0; fi
install_boost
install_node_modules server/viewer
if $with_tests; then
  install_node_modules tests/e2e
  install_node_modules tests/examples
  install_node_modules tests/openapi
  install_node_modules tests/scale
fi
