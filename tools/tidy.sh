#!/usr/bin/env bash
# Runs clang-tidy over the product, on the unity sources of the sanitizer build: each header is parsed once for
# all sources of a folder.
#
#   tools/tidy.sh [JOBS]
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
cmake --preset asan -DTERRACE_BUILD_TESTS=ON --log-level=ERROR > /dev/null
python3 - <<'PYTHON' | xargs -r -d '\n' -P "${1:-$(nproc)}" -n 1 clang-tidy-14 -p build/asan --quiet 2> /dev/null
import json
files = {entry["file"] for entry in json.load(open("build/asan/compile_commands.json"))}
print(*sorted(name for name in files if "/tests/" not in name), sep="\n")
PYTHON
