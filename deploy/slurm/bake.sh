#!/bin/sh
# Bakes one archive with an array of jobs, a shard each. From the folder of the configuration:
#
#   job=$(sbatch --parsable --array=0-7 bake.sh terrace.json europe "$SCRATCH/europe")
#   sbatch --dependency=afterok:$job bake.sh terrace.json europe "$SCRATCH/europe"
#
# The second command, without --array, checks all files and writes the manifest. A shard that failed or ran out of time
# goes on when it is submitted again: sbatch --array=3 --export=ALL,SHARDS=8 bake.sh ... Every node must see the folder.
#SBATCH --job-name=terrace-bake
#SBATCH --cpus-per-task=8
#SBATCH --mem=8G
#SBATCH --time=12:00:00
#SBATCH --signal=TERM@60
set -eu
[ $# -eq 3 ] || { echo "usage: bake.sh CONFIG DATASET PLACE" >&2; exit 2; }
what=--finish
if [ -n "${SLURM_ARRAY_TASK_ID:-}" ]; then what="--shard $SLURM_ARRAY_TASK_ID/${SHARDS:-$SLURM_ARRAY_TASK_COUNT}"; fi
# shellcheck disable=SC2086 # two words
exec "${TERRACE:-terrace}" bake --config "$1" --dataset "$2" --out "$3" --threads "${SLURM_CPUS_PER_TASK:-1}" $what
