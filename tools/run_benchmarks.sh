#!/usr/bin/env bash
# Builds the benchmarks and runs them: first the table of the engine's targets, then the programs that use Google
# Benchmark (executables named *_bench). Results go to build/bench/results/NAME.json, with the machine, the compiler and
# the commit.
#
#   tools/run_benchmarks.sh [JOBS] [options of terrace_tin_bench, such as --peer 'COMMAND' or --filter 'T1 ']
#   tools/run_benchmarks.sh --docs [JOBS] [options]     also writes the tables into docs/performance.md
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
docs=false
if [[ ${1:-} == --docs ]]; then docs=true; shift; fi
jobs=$(nproc)
if [[ ${1:-} =~ ^[0-9]+$ ]]; then jobs=$1; shift; fi

cmake --preset bench -DTERRACE_BUILD_TESTS=ON --log-level=WARNING
cmake --build build/bench -j "$jobs" --target benchmarks
results=build/bench/results
mkdir -p "$results"
build/bench/tests/bench/terrace_tin_bench --json "$results/tin.json" "$@"
if $docs; then tools/fill_tables.py "$results/tin.json" docs/performance.md; fi

cpu=$(sed -n 's/^model name[[:space:]]*: //p' /proc/cpuinfo | head -n 1)
compiler=$(c++ --version | head -n 1)
commit=$(git describe --always --dirty 2> /dev/null || echo unknown)
for benchmark in build/bench/tests/bench/*_micro_bench; do
  [[ -x $benchmark ]] || continue
  "$benchmark" --benchmark_repetitions=5 --benchmark_report_aggregates_only=true \
    --benchmark_out="$results/$(basename "$benchmark").json" --benchmark_out_format=json \
    --benchmark_context=cpu="$cpu",compiler="$compiler",commit="$commit" < /dev/null
done
