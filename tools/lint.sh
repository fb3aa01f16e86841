#!/usr/bin/env bash
# Static checks of the sources: layers, leftovers, Python, formatting, self-contained headers. All checks run, also
# after a failure; the last line names what failed. `make lint` installs what they need first.
set -uo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
jobs=${1:-$(nproc)} passed=0 failed=""

step() {
  local name=$1
  echo "lint: $name"
  shift
  if "$@"; then passed=$((passed + 1)); else failed+="; failed: $name"; fi
}

sources() { git ls-files '*.h' '*.cc'; }

# Compiles, without optimization, every header that is not the first include of its own source.
headers() {
  cmake --preset release -DTERRACE_BUILD_TESTS=ON --log-level=ERROR > /dev/null &&
    cmake --build build/release -j "$jobs" --target self_contained_headers
}

step "layers" tools/check_layers.py
step "layers, the checker itself" tools/check_layers.py --self-test
step "leftovers" tools/check_tree.py
step "leftovers, the checker itself" tools/check_tree.py --self-test
step "Python" bash -c "set -o pipefail; git ls-files '*.py' | xargs -r pyflakes3"
step "formatting (make format corrects it)" bash -c "set -o pipefail; git ls-files '*.h' '*.cc' | xargs -r clang-format-14 --dry-run -Werror"
step "self-contained headers" headers
echo "lint: $passed passed$failed"
[[ -z $failed ]]
