#!/usr/bin/env bash
# Runs the cells of the experiment in this folder as a job array of SLURM:
#
#     cd FOLDER && mkdir -p logs && sbatch slurm-cells.sh
#
# Timed cells ask for a whole node, counting cells for a core per thread. Cells that are done are not
# run again, so this may be submitted as often as one likes. Where a site allows fewer elements in an
# array, submit parts: sbatch --array=0-999 slurm-cells.sh
#SBATCH --array=0-@LAST@
#SBATCH --ntasks=1
#SBATCH @RESOURCES@
#SBATCH --time=@MINUTES@
#SBATCH --output=logs/%A-%a.out
set -euo pipefail
exec splitplane run-cell "${SLURM_SUBMIT_DIR:-.}" "$SLURM_ARRAY_TASK_ID"
