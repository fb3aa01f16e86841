#!/usr/bin/env bash
# Repeats the paper's experiments on its five elevation models, which must be in the folder TERRACE_TEST_DATA (by
# default ../shared/data). Numbers, plots and pictures go to build/paper.
#
#   tools/run_paper.sh [JOBS]
#   tools/run_paper.sh --docs [JOBS]     also writes them into docs/engine.md and docs/images/engine
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
docs=false
if [[ ${1:-} == --docs ]]; then docs=true; shift; fi

cmake --preset bench -DTERRACE_BUILD_TESTS=ON --log-level=WARNING
cmake --build build/bench -j "${1:-$(nproc)}" --target terrace_paper
build/bench/tests/bench/terrace_paper --out build/paper
tools/plot_paper.py build/paper/paper.json build/paper
if $docs; then
  mkdir -p docs/images/engine
  cp build/paper/*.png build/paper/*.svg docs/images/engine/
  tools/fill_tables.py build/paper/paper.json docs/engine.md
fi
