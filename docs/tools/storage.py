"""How close frames are to true projections, over what a map takes on disk and in texture memory.

    python3 docs/tools/storage.py PROGRAM SCAN > table.md

Casts SCAN in more and more layers and in every precision, compares 12 views of each, prints the table of
docs/accuracy.md, and draws docs/images/accuracy-storage.svg.
"""

import json
import math
import pathlib
import subprocess
import sys
import tempfile

LAYERS = {"byte": (1, 2, 5, 8, 16, 24, 32, 64), "half": (2, 8, 24, 64), "float": (2, 8, 24, 64)}
COLOURS = {"byte": "#0b6e4f", "half": "#c1666b", "float": "#2e4057"}
PICTURE = pathlib.Path(__file__).parents[1] / "images" / "accuracy-storage.svg"
MB = 1e6


def run(program, *words):
    return json.loads(subprocess.run([program, "-q", *map(str, words), "--json"], check=True, capture_output=True).stdout)


def measure(program, scan, precision, layers, folder):
    path = folder / f"{precision}-{layers}.exr"
    run(program, "cast", scan, "-o", path, "--layers", layers, "--precision", precision)
    texture = run(program, "render", path, "-o", folder / "frame.png")["texture_B"]
    mean = run(program, "compare", scan, path, "--views", 12)["mean"]
    return {"precision": precision, "layers": layers, "disk": path.stat().st_size / MB, "texture": texture / MB,
            "psnr": mean["psnr_db"], "rmse": mean["rmse"]}


def megabytes(size):
    return f"{size:.{2 if size < 1 else 1}f} MB"


def table(rows):
    yield "| layers | precision | on disk | texture | PSNR | RMSE |"
    yield "|---|---|---|---|---|---|"
    for row in sorted(rows, key=lambda row: (row["texture"], row["layers"])):
        yield (f"| {row['layers']} | {row['precision']} | {megabytes(row['disk'])} | {megabytes(row['texture'])} | "
               f"{row['psnr']:.1f} dB | {100 * row['rmse']:.2f} % |")


class Panel:
    """PSNR over one kind of bytes, on a logarithmic axis from 1/16 to 64 MB."""

    width, height, top = 380, 260, 30

    def __init__(self, left, title, of):
        self.left, self.title, self.of = left, title, of

    def x(self, megabytes):
        return self.left + self.width * (math.log2(megabytes) + 4) / 10

    def y(self, decibels):
        return self.top + self.height * (1 - decibels / 55)

    def lines(self, rows):
        bottom = self.top + self.height
        yield f'<text x="{self.left}" y="{self.top - 12}" font-weight="bold">{self.title}</text>'
        for power in range(-4, 7, 2):
            x = self.x(2**power)
            yield f'<path d="M{x:.1f} {self.top}V{bottom}" stroke="#ddd"/>'
            yield f'<text x="{x:.1f}" y="{bottom + 16}" text-anchor="middle">{2.0**power:g} MB</text>'
        for decibels in range(0, 60, 10):
            yield f'<path d="M{self.left} {self.y(decibels):.1f}h{self.width}" stroke="#ddd"/>'
            yield (f'<text x="{self.left - 6}" y="{self.y(decibels) + 4:.1f}" text-anchor="end">'
                   f'{decibels} dB</text>')
        yield f'<path d="M{self.x(1):.1f} {self.top}V{bottom}" stroke="#888" stroke-dasharray="4 3"/>'
        yield f'<text x="{self.x(1) + 4:.1f}" y="{self.top + 12}" fill="#555">the paper\'s 1 MB</text>'
        for place, (precision, colour) in enumerate(COLOURS.items()):
            points = sorted((self.x(row[self.of]), self.y(row["psnr"])) for row in rows if row["precision"] == precision)
            path = "L".join(f"{x:.1f} {y:.1f}" for x, y in points)
            yield f'<path d="M{path}" fill="none" stroke="{colour}" stroke-width="2"/>'
            for x, y in points:
                yield f'<circle cx="{x:.1f}" cy="{y:.1f}" r="3" fill="{colour}"/>'
            yield (f'<text x="{self.left + self.width - 40}" y="{bottom - 44 + 16 * place}" fill="{colour}">'
                   f'{precision}</text>')


def picture(rows):
    panels = Panel(52, "on disk", "disk"), Panel(500, "in texture memory", "texture")
    yield '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 900 320" font-family="sans-serif" font-size="12">'
    yield '<rect width="900" height="320" fill="white"/>'
    for panel in panels:
        yield from panel.lines(rows)
    yield "</svg>"


def main(program, scan):
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        for precision, counts in LAYERS.items():
            for layers in counts:
                rows.append(measure(program, scan, precision, layers, pathlib.Path(folder)))
                print(rows[-1], file=sys.stderr, flush=True)
    print("\n".join(table(rows)))
    PICTURE.write_text("\n".join(picture(rows)) + "\n")


if __name__ == "__main__":
    main(*sys.argv[1:])
