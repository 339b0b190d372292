"""The command `xraycast` of a wheel: the program, which lies in the package, takes this process's place."""
import os
import sys

PROGRAM = os.path.join(os.path.dirname(os.path.abspath(__file__)), "bin", "xraycast")


def main():
    try:
        os.execv(PROGRAM, ["xraycast", *sys.argv[1:]])
    except OSError as error:
        sys.exit(f"{PROGRAM}: {error.strerror}; install the package again: pip install --force-reinstall xraycast")
