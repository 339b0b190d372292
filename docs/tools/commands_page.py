#!/usr/bin/env python3
"""Writes docs/commands.md from the program's own --help.

    docs/tools/commands_page.py build/release/cli/xraycast > docs/commands.md

`--check` fails when docs/commands.md says something else than the program.
"""
import argparse
import pathlib
import re
import subprocess
import sys

PAGE = pathlib.Path(__file__).resolve().parents[1] / "commands.md"
HEAD = """# Commands

`xraycast SUBCOMMAND`, as its own `--help` describes it. This page is made from the program by `./dev docs`.
"""


def help_of(program, *subcommand):
    return subprocess.run([program, *subcommand, "--help"], check=True, capture_output=True, text=True).stdout.strip()


def page(program):
    main = help_of(program)
    subcommands = re.findall(r"^  ([a-z]+) ", main.partition("Subcommands:")[2], re.MULTILINE)
    sections = [f"```\n{main}\n```"] + [f"## {name}\n\n```\n{help_of(program, name)}\n```" for name in subcommands]
    return HEAD + "\n" + "\n\n".join(sections) + "\n"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program")
    parser.add_argument("--check", action="store_true")
    arguments = parser.parse_args()
    text = page(arguments.program)
    if not arguments.check:
        print(text, end="")
        return 0
    if text != PAGE.read_text():
        print("docs/commands.md does not say what --help says; run ./dev docs", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
