"""An array job for Slurm whose tasks are parts of one run."""
import os
import shlex
import sys

from .._errors import InputError
from .manifest import is_url, read_cohort

SCRIPT = """#!/bin/bash
#SBATCH --job-name=xraycast-cohort
#SBATCH --array=0-{last}
#SBATCH --cpus-per-task=4
#SBATCH --mem=16G
#SBATCH --time=24:00:00
#SBATCH --output={out}/slurm-%A-%a.log
#SBATCH --signal=B:TERM@60
# {scans} scans in {parts} parts. Submit it again to process the remaining scans. Options of sbatch override those above.
trap 'kill -TERM "$run" 2>/dev/null' TERM
{command} --part "$SLURM_ARRAY_TASK_ID/{parts}" --workers 1 --threads "${{SLURM_CPUS_PER_TASK:-1}}" &
run=$!
wait "$run"; status=$?
# The signal ends the first wait; the run ends a little later.
if [ "$status" -gt 128 ]; then wait "$run"; status=$?; fi
exit "$status"
"""


def array_job(source, out, parts, run_arguments):
    """The script, for sbatch. Raises InputError."""
    if "\n" in str(out):
        raise InputError(f"-o {str(out)!r}: a job's comments hold no line break; give another folder")
    scans = len(read_cohort(source))
    parts = min(parts, scans)
    os.makedirs(out, exist_ok=True)  # Slurm writes its logs there before the first task runs
    path = source if is_url(source) else os.path.abspath(source)
    command = [sys.executable, "-m", "xraycast.cohort", "run", path, "-o", str(out), "-q", *run_arguments]
    return SCRIPT.format(last=parts - 1, parts=parts, scans=scans, out=out, command=shlex.join(command))
