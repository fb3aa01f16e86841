#!/usr/bin/env bash
# Everything that judges the sources without running them. Ends with status 1 if anything is wrong, after all checks ran.
set -uo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
status=0
step() { echo "lint: $1"; shift; "$@" || status=1; }

step "order of the rooms" tools/check_layers.py
step "leftovers" tools/check_tree.py
step "Python" bash -c "git ls-files '*.py' | xargs pyflakes3"
step "formatting (make format mends it)" bash -c "git ls-files '*.h' '*.cc' | xargs clang-format-14 --dry-run -Werror"
if [[ -f build/release/compile_commands.json ]]; then
  step "self-contained headers" cmake --build build/release --target self_contained_headers
  if command -v clang-tidy-14 > /dev/null; then
    step "clang-tidy" bash -c "git ls-files 'engine/*.cc' 'proto/*.cc' 'config/*.cc' 'server/*.cc' |
      xargs -P \"\$(nproc)\" -n 1 clang-tidy-14 -p build/release --quiet"
  else
    echo "lint: clang-tidy-14 is not installed, its checks are left out"
  fi
else
  echo "lint: build/release is not configured, headers and clang-tidy are left out; make test configures it"
fi
exit $status
