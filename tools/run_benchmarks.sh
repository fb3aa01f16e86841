#!/usr/bin/env bash
# Builds every benchmark (executables named *_bench) and runs them one after the other.
# Results go to build/bench/results/NAME.json, with the machine, the compiler and the commit.
#
#   tools/run_benchmarks.sh [JOBS] [Google Benchmark's options...]
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
jobs=${1:-$(nproc)}
shift || true

cmake --preset bench -DTERRACE_BUILD_TESTS=ON --log-level=WARNING
cmake --build build/bench -j "$jobs"
mapfile -t benchmarks < <(find build/bench -name '*_bench' -type f -perm -u+x | sort)
[[ ${#benchmarks[@]} -gt 0 ]] || { echo "run_benchmarks: no executable named *_bench under build/bench" >&2; exit 1; }

results=build/bench/results
mkdir -p "$results"
cpu=$(sed -n 's/^model name[[:space:]]*: //p' /proc/cpuinfo | head -n 1)
compiler=$(c++ --version | head -n 1)
commit=$(git describe --always --dirty 2> /dev/null || echo unknown)
for benchmark in "${benchmarks[@]}"; do
  "$benchmark" --benchmark_repetitions=5 --benchmark_report_aggregates_only=true \
    --benchmark_out="$results/$(basename "$benchmark").json" --benchmark_out_format=json \
    --benchmark_context=cpu="$cpu",compiler="$compiler",commit="$commit" "$@" < /dev/null
done
