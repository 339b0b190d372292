"""How many threads a worker's libraries start, so that its workers together do not exceed a machine's cores."""
import os

VARIABLES = ("XRAYCAST_THREADS", "POCL_MAX_PTHREAD_COUNT", "LP_NUM_THREADS", "OMP_NUM_THREADS")


def limit_threads(count):
    """Of this process: xraycast's own, PoCL's, those of drawing in software, and OpenMP's. Before the first of them starts."""
    for name in VARIABLES:
        os.environ[name] = str(count)
