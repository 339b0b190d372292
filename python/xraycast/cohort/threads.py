"""How many threads a worker's libraries start, so that its workers together do not exceed a machine's cores."""
import os

VARIABLES = ("XRAYCAST_THREADS", "POCL_MAX_PTHREAD_COUNT", "LP_NUM_THREADS", "OMP_NUM_THREADS")


def limit_threads(count):
    """Limits this process's threads: xraycast's own, PoCL's, OpenMP's, and those of drawing in software. Call it before the
    first of them starts."""
    for name in VARIABLES:
        os.environ[name] = str(count)
