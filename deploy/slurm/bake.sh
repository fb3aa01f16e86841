#!/bin/bash
# A bake as a job array: 64 shards, and a last job that checks all files and writes the manifest.
#
#   CONFIG=terrace.json DATASET=europe OUT=/scratch/europe deploy/slurm/bake.sh
#
# Slurm starts the script again for each task of the array. A shard that was ended goes on where it was. To hand in some of
# the 64 again, and then the finish (with the variables above):
#
#   SHARDS=64 sbatch --array=5,17 deploy/slurm/bake.sh
#   FINISH=1 sbatch --array=0 deploy/slurm/bake.sh
#SBATCH --job-name=terrace-bake
#SBATCH --array=0-63
#SBATCH --cpus-per-task=8
#SBATCH --mem=12G
#SBATCH --time=12:00:00
#SBATCH --requeue
#SBATCH --signal=B:TERM@60
set -euo pipefail
: "${CONFIG:?the configuration with the dataset}" "${DATASET:?its name}" "${OUT:?where the archive goes: a file system of all nodes}"
terrace=${TERRACE:-terrace}

if [[ -z ${SLURM_ARRAY_TASK_ID:-} ]]; then  # on the login node
  # "ID;CLUSTER" where there are several clusters
  job=$(sbatch --parsable --export=ALL "$0")
  clusters=()
  [[ $job == *";"* ]] && clusters=(--clusters="${job#*;}")
  exec sbatch "${clusters[@]}" --dependency="afterok:${job%%;*}" --array=0 --export=ALL,FINISH=1 "$0"
fi
# A task runs once at a time, so a lock is of a run that was ended on another node.
if [[ -n ${FINISH:-} ]]; then
  rm -f "$OUT/bake.lock"
  exec "$terrace" bake --config "$CONFIG" --dataset "$DATASET" --out "$OUT" --finish
fi
if [[ -n ${SHARDS:-} ]]; then
  shard=$SLURM_ARRAY_TASK_ID count=$SHARDS
else
  shard=$((SLURM_ARRAY_TASK_ID - SLURM_ARRAY_TASK_MIN)) count=$SLURM_ARRAY_TASK_COUNT
fi
rm -f "$OUT/bake-$shard-of-$count.lock"
exec "$terrace" bake --config "$CONFIG" --dataset "$DATASET" --out "$OUT" --threads "${SLURM_CPUS_PER_TASK:-1}" --shard "$shard/$count"
