#!/usr/bin/env python3
"""Draws the rooms of the sources and which includes which, as a Graphviz graph on stdout.

    docs/tools/rooms_picture.py | dot -Tsvg > docs/images/rooms.svg

An arrow means "includes headers of". Arrows that follow from others are left out (the transitive reduction).
`--check FILE.svg` fails when a picture shows other arrows than the includes.
"""
import argparse
import html
import pathlib
import re
import sys

ROOT = pathlib.Path(__file__).resolve().parents[2]
COLOURS = {"kernels": "#d9d9d9", "host": "#cfe2f3", "segmentation": "#fce5cd", "simulation": "#d9ead3",
           "viewer": "#ead1dc", "python": "#d0e0e3", "cli": "#fff2cc"}


def read_rooms():
    lines = (ROOT / "rooms.txt").read_text().splitlines()
    return [line.split(":")[0] for line in lines if line and not line.startswith("#")]


def name_of(room):
    return pathlib.PurePath(room).name


def includes_of(room):
    """The other rooms whose headers a room includes."""
    found = set()
    for file in sorted((ROOT / room).iterdir()):
        if file.suffix in (".cpp", ".hpp"):
            found |= set(re.findall(r'^#include "(?:xraycast/)?([a-z_]+)/', file.read_text(), re.MULTILINE))
    return found - {name_of(room)}


def reduced(edges):
    """Without the arrows that follow from others."""
    reachable = {}

    def reach(room):
        if room not in reachable:
            reachable[room] = set().union(*({below} | reach(below) for below in edges.get(room, ()))) if edges.get(room) else set()
        return reachable[room]

    return {room: {below for below in belows if not any(below in reach(other) for other in belows if other != below)}
            for room, belows in edges.items()}


def arrows():
    rooms = read_rooms()
    names = {name_of(room) for room in rooms}
    edges = reduced({name_of(room): includes_of(room) & names for room in rooms})
    return {(above, below) for above, belows in edges.items() for below in belows}


def graph():
    lines = ["digraph rooms {", '  rankdir=TB; node [shape=box style="filled,rounded" fontname="sans-serif"];']
    for room in read_rooms():
        library = room.split("/")[0]
        lines.append(f'  {name_of(room)} [fillcolor="{COLOURS[library]}" tooltip="{room}"];')
    lines += [f"  {above} -> {below};" for above, below in sorted(arrows())]
    return "\n".join(lines + ["}"])


def drawn_arrows(svg):
    titles = re.findall(r"<title>([^<]*)</title>", pathlib.Path(svg).read_text())
    return {tuple(html.unescape(t).split("->")) for t in titles if "->" in html.unescape(t)}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--check", metavar="FILE.svg")
    arguments = parser.parse_args()
    if not arguments.check:
        print(graph())
        return 0
    difference = drawn_arrows(arguments.check) ^ arrows()
    if difference:
        print(f"{arguments.check} does not show the includes; run ./dev docs: {sorted(difference)}", file=sys.stderr)
    return 1 if difference else 0


if __name__ == "__main__":
    sys.exit(main())
