"""The console script xraycast-cohort. Exit codes are xraycast's."""
import argparse
import os
import pathlib
import signal
import sys

from .. import _core
from .._errors import DeviceError, Error, InputError
from .options import Options, opacity_of, poses_of, steps_of

FAILED, USAGE, BAD_INPUT, DEVICE_FAILED = 1, 2, 3, 4


class _Stopped(BaseException):
    def __init__(self, number):
        self.number = number


def main(arguments=None):
    given, further = _split(sys.argv[1:] if arguments is None else list(arguments))
    parsed = _parser().parse_args(given)
    parsed.run_arguments = further
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, _stop)
    try:
        return parsed.function(parsed)
    except _Stopped as stopped:
        _say(f"stopped by {signal.Signals(stopped.number).name}; run again to process the remaining scans")
        return 128 + stopped.number
    except InputError as error:
        return _fail(error, BAD_INPUT)
    except DeviceError as error:
        return _fail(error, DEVICE_FAILED)
    except (Error, OSError) as error:
        return _fail(error, FAILED)


def _split(arguments):
    """What stands before and after `--`."""
    if "--" not in arguments:
        return arguments, []
    at = arguments.index("--")
    return arguments[:at], arguments[at + 1:]


def _stop(number, frame):
    for other in (signal.SIGINT, signal.SIGTERM):
        signal.signal(other, lambda number, frame: os._exit(128 + number))  # a second one ends it at once
    raise _Stopped(number)


def _say(text):
    print(f"xraycast-cohort: {text}", file=sys.stderr)


def _fail(error, status):
    _say(" ".join(str(error).split()))
    return status


# ---- subcommands --------------------------------------------------------------------------------------


def _run(parsed):
    try:
        import distributed  # noqa: F401
    except ImportError:
        raise Error(f"dask is not installed: {sys.executable} -m pip install 'dask[distributed]'") from None
    from .cluster import Workers
    from .run import Run, run_cohort
    workers = Workers(scheduler=parsed.scheduler, count=parsed.workers or len(os.sched_getaffinity(0)),
                      threads=parsed.threads, resources=parsed.resources, allowed_failures=parsed.allowed_failures,
                      worker_ttl=parsed.worker_ttl)
    counts = run_cohort(Run(source=parsed.source, out=parsed.output, options=_options_of(parsed), workers=workers,
                            part=parsed.part, retries=parsed.retries, patience_s=parsed.wait, cache=parsed.cache,
                            cache_gb=parsed.cache_gb, tries_bad_again=parsed.again, is_quiet=parsed.quiet))
    return _report_counts(counts, parsed)


def _report_counts(counts, parsed):
    bad = counts.bad + counts.bad_before
    before = f" ({counts.done_before} before)" if counts.done_before else ""
    if bad or not parsed.quiet:
        _say(f"{counts.done + counts.done_before} of {counts.ended} scans done{before}, {bad} bad"
             + (f"; {parsed.output / 'ledger.jsonl'} gives the reasons" if bad else ""))
    return FAILED if bad else 0


def _options_of(parsed):
    steps = steps_of(parsed.steps)
    if parsed.catheter and not {"segment", "frames"} <= set(steps):
        raise InputError("--catheter: needs the vessels; give --steps segment,frames")
    opacity, digest = opacity_of(parsed.opacity)
    return Options(steps=steps, layers=parsed.layers, angles=parsed.angles, opacity=opacity,
                   opacity_digest=digest, frames=parsed.frames, size=parsed.size, seed=parsed.seed,
                   poses=poses_of(parsed.poses) if parsed.poses else (), catheter=parsed.catheter)


def _report(parsed):
    from .report import write_report
    _say(f"wrote {write_report(parsed.output)}")
    return 0


def _slurm(parsed):
    from .slurm import array_job
    sys.stdout.write(array_job(parsed.source, parsed.output, parsed.array, parsed.run_arguments))
    return 0


# ---- arguments ----------------------------------------------------------------------------------------


def _parser():
    parser = argparse.ArgumentParser(prog="xraycast-cohort", description="Process many CT scans on many workers, with dask.")
    parser.add_argument("--version", action="version", version=_core.__version__)
    commands = parser.add_subparsers(required=True, metavar="COMMAND")
    _add_run(commands.add_parser("run", help="process the scans of a cohort that have no outputs yet"))
    _add_report(commands.add_parser("report", help="write a page that sums up a run"))
    _add_slurm(commands.add_parser("slurm", help="print an array job for Slurm"))
    return parser


def _add_source_and_output(parser):
    parser.add_argument("source", metavar="MANIFEST.csv|FOLDER",
                        help="the scans: a CSV file with the column path and optionally name, a folder, or a URL of either")
    _add_output(parser)


def _add_output(parser):
    parser.add_argument("-o", "--output", metavar="OUT", required=True, type=_absolute,
                        help="folder for the outputs and ledger.jsonl; all workers must see it")


def _add_run(parser):
    parser.set_defaults(function=_run)
    _add_source_and_output(parser)
    what = parser.add_argument_group("what to do with each scan")
    what.add_argument("--steps", default="info,cast", help="list of info, cast, segment and frames (default: info,cast)")
    what.add_argument("--layers", type=_whole(1, 256), default=1, help="layers of the body map (default: 1)")
    what.add_argument("--angles", type=_whole(1, 16384), default=360, help="angles of the body map (default: 360)")
    what.add_argument("--opacity", default="paper", help="opacity, by name or JSON file (default: paper)")
    what.add_argument("--frames", type=_whole(1, 100000), default=16, help="training frames per scan (default: 16)")
    what.add_argument("--size", type=_size, default=(512, 512), metavar="WxH", help="size of a frame in pixels (default: 512x512)")
    what.add_argument("--poses", metavar="FILE.csv", help="poses, in the columns lao and cranial, in degrees (default: random poses)")
    what.add_argument("--seed", type=_whole(0, 2**32 - 1), default=1, help="seed of the random numbers (default: 1)")
    what.add_argument("--catheter", default="", metavar="MODEL", help="also simulate this catheter in the vessels, such as cobra-5f")
    where = parser.add_argument_group("where")
    place = where.add_mutually_exclusive_group()
    place.add_argument("--scheduler", default="", metavar="tcp://HOST:PORT", help="dask scheduler whose workers to use")
    place.add_argument("--workers", type=_whole(1, 1024), help="worker processes on this machine (default: one per core)")
    where.add_argument("--threads", type=_whole(1, 1024), default=0, help="threads per worker (default: its share of the cores)")
    where.add_argument("--resources", type=_resources, default={}, metavar="NAME=N,…",
                       help="dask resources that one scan needs, such as GPU=1,MEMORY=8e9")
    where.add_argument("--allowed-failures", type=_whole(0, 1000), default=3,
                       help="workers that may die during a scan before it counts as bad (default: 3; with --scheduler, its own)")
    where.add_argument("--worker-ttl", default="5 minutes", help="silence after which a worker counts as dead (default: 5 minutes; with --scheduler, its own)")
    where.add_argument("--retries", type=_whole(0, 1000), default=1, help="retries after failures that the scan did not cause (default: 1)")
    where.add_argument("--wait", type=_whole(0, 10**6), default=600, metavar="S", help="seconds to wait for a lost scheduler (default: 600)")
    where.add_argument("--cache", default="", help="folder on the worker for scans named by URL")
    where.add_argument("--cache-gb", type=float, default=20, help="size limit of the cache in GB (default: 20)")
    where.add_argument("--part", type=_part, metavar="I/N", help="process only part I of N, counted from 0; other parts may run at the same time")
    parser.add_argument("--again", action="store_true", help="try bad scans again")
    parser.add_argument("-q", "--quiet", action="store_true", help="show no progress")


def _add_report(parser):
    parser.set_defaults(function=_report)
    parser.add_argument("output", metavar="OUT", type=_absolute, help="folder of a run")


def _add_slurm(parser):
    parser.set_defaults(function=_slurm)
    _add_source_and_output(parser)
    parser.add_argument("--array", type=_whole(1, 100000), default=100, metavar="N", help="number of tasks of the array (default: 100)")
    parser.epilog = "Give arguments for `run` after --."


def _absolute(text):
    return pathlib.Path(os.path.abspath(text))


def _whole(least, most):
    def parse(text):
        try:
            value = int(text)
        except ValueError:
            value = least - 1
        if not least <= value <= most:
            raise argparse.ArgumentTypeError(f"{text}: must be {least} to {most}")
        return value
    return parse


def _size(text):
    try:
        width, height = map(int, text.split("x"))
    except ValueError:
        width = height = 0
    if not (8 <= width <= 8192 and 8 <= height <= 8192):
        raise argparse.ArgumentTypeError(f"{text}: must be WIDTHxHEIGHT, 8 to 8192 pixels each")
    return width, height


def _resources(text):
    try:
        pairs = [item.split("=") for item in text.split(",")]
        return {name: float(amount) for name, amount in pairs}
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text}: must be NAME=NUMBER, separated by commas") from None


def _part(text):
    try:
        number, count = map(int, text.split("/"))
    except ValueError:
        number, count = 0, 0
    if not 0 <= number < count:
        raise argparse.ArgumentTypeError(f"{text}: must be I/N with I from 0 to N - 1")
    return number, count
