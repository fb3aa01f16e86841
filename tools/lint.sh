#!/usr/bin/env bash
# Everything that judges the sources without running them: layers, leftovers, Python, formatting, self-contained headers, clang-tidy.
# All checks run, whatever fails; the last line says how many did. `make lint` installs what they need first.
set -uo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
jobs=${1:-$(nproc)} passed=0 failed=0

step() {
  echo "lint: $1"
  shift
  if "$@"; then passed=$((passed + 1)); else failed=$((failed + 1)); fi
}

sources() { git ls-files '*.h' '*.cc'; }

# Compiles, without optimization, every header that is not the first include of its own source.
headers() {
  cmake --preset release -DTERRACE_BUILD_TESTS=ON --log-level=ERROR > /dev/null &&
    cmake --build build/release -j "$jobs" --target self_contained_headers
}

# Reads the unity sources of the sanitizer build: each header is parsed once for eight sources, which takes a fifth of the time.
tidy() {
  cmake --preset asan -DTERRACE_BUILD_TESTS=ON --log-level=ERROR > /dev/null || return
  python3 - <<'PYTHON' | xargs -r -d '\n' -P "$jobs" -n 1 clang-tidy-14 -p build/asan --quiet 2> /dev/null
import json
files = {entry["file"] for entry in json.load(open("build/asan/compile_commands.json"))}
print(*sorted(name for name in files if "/tests/" not in name), sep="\n")
PYTHON
}

step "layers" tools/check_layers.py
step "layers, the checker itself" tools/check_layers.py --self-test
step "leftovers" tools/check_tree.py
step "leftovers, the checker itself" tools/check_tree.py --self-test
step "Python" bash -c "git ls-files '*.py' | xargs pyflakes3"
step "formatting (make format corrects it)" bash -c "git ls-files '*.h' '*.cc' | xargs clang-format-14 --dry-run -Werror"
step "self-contained headers" headers
step "clang-tidy" tidy
echo "lint: $passed passed, $failed failed"
exit $((failed > 0))
