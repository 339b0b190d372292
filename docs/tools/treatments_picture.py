#!/usr/bin/python3
"""usage: treatments_picture.py PROGRAM OUTPUT.jpg

Makes docs/images/treatments.jpg: a stenosis of the thorax phantom's left renal artery before a stent, while that is opened by its
balloon, and after; and the kidney's flow before particles and after. Each row is of one run, or of two with the same steps.
"""
import json
import pathlib
import subprocess
import sys
import tempfile

from PIL import Image

ROOT = pathlib.Path(__file__).resolve().parents[2]
ENTRY = "-89,-54,-357"
VIEW = ["--lao", "0", "--size", "300x300", "--cone", "785,1200", "--isocentre", "35,-10,-70", "--pixel", "0.45"]
# Over a wire and into the ostium, as in examples/steering/left-renal.csv; the stent waits in the guide.
REACH = [(0, 0, 0, 0, 0, 0), (5, 0, 0, 0, 0, 400), (10, 380, 0, 300, 0, 400), (11, 380, 0, 300, 0, 350), (11.5, 345, 0, 300, 0, 315),
         (12, 345, 15, 300, 0, 315), (13, 345, 15, 300, 0, 395), (13.5, 350, 15, 300, 0, 395)]
STENT = [(16, 350, 15, 376, 0, 395), (17, 342, 15, 376, 0, 395), (19, 342, 15, 376, 8, 395), (21, 342, 15, 376, 8, 395), (23, 342, 15, 376, 0, 395),
         (24, 350, 15, 376, 0, 395)]


def run(*words):
    subprocess.run([*map(str, words)], check=True, capture_output=True, text=True)


def withdrawn(rows):
    """Wire and stent out of the guide, so that it can be injected through, and ten seconds on."""
    time_s, guide_mm, turn_deg = rows[-1][:3]
    return rows + [(time_s + 5, guide_mm, turn_deg, 0, 0, 395), (time_s + 10, guide_mm, turn_deg, 0, 0, 0), (time_s + 20, guide_mm, turn_deg, 0, 0, 0)]


def script(path, rows):
    lines = [f"{t},{guide},{turn},{stent},0,{bar},{wire},0" for t, guide, turn, stent, bar, wire in rows]
    path.write_text("\n".join(["time_s,insertion_mm,rotation_deg,insertion_2_mm,rotation_2_deg,inflation_2_bar,insertion_3_mm,rotation_3_deg",
                               *lines]) + "\n")
    return path


def frame(path, at_s):
    """Of a film, the one at a time."""
    film, passed_ms = Image.open(path), 0
    for number in range(film.n_frames):
        film.seek(number)
        passed_ms += film.info["duration"]
        if passed_ms >= 1000 * at_s:
            break
    return film.convert("L")


def main(program, output):
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        guide = json.loads((ROOT / "simulation/instruments/cobra-5f.json").read_text())
        wide = json.loads((ROOT / "simulation/instruments/guide-6f.json").read_text())
        guide.update(name="guide-6f-cobra", radius_mm=wide["radius_mm"], inner_radius_mm=wide["inner_radius_mm"])
        (folder / "guide.json").write_text(json.dumps(guide))
        run(program, "phantom", "thorax", "-o", folder / "thorax.nrrd", "--truth", folder / "truth")
        run(program, "cast", folder / "thorax.nrrd", "--layers", "16", "-o", folder / "body.exr")
        run(program, "edit", folder / "truth", "-o", folder / "stenosed", "--stenosis", "left renal artery,15,8,70")
        instruments = ["--device-model", folder / "guide.json", "--device-model", "stent-6x18", "--device-model", "guidewire-035-angled"]

        def film(name, tree, rows, *more):
            run(program, "simulate", folder / tree, *instruments, "--entry", ENTRY, "--script", script(folder / "s.csv", rows),
                "-o", folder / "log.csv", "--map", folder / "body.exr", "--cine", folder / f"{name}.gif", *VIEW, *more)
            return folder / f"{name}.gif"

        before, after = withdrawn(REACH), withdrawn(REACH + STENT)
        inject = lambda rows, *more: ["--look", "dsa", "--inject", f"{rows[-2][0] + 1},{rows[-2][0] + 3}", "--injection-rate", "3", *more]  # noqa: E731
        stented = [frame(film("before", "stenosed", before, *inject(before)), 2.3), frame(film("opened", "stenosed", REACH + STENT), 21),
                   frame(film("after", "stenosed", after, *inject(after)), 2.3)]
        still = [*before[:-1], (before[-2][0] + 22, *before[-2][1:])]
        at_s = before[-2][0]
        closing = film("closing", "truth", still, "--look", "dsa", "--inject", f"{at_s + 1},{at_s + 19}", "--injection-rate", "1", "--particles", "0.5")
        embolised = [frame(closing, 3), frame(closing, 12), frame(closing, 18.5)]
        sheet = Image.new("L", (3 * 304, 2 * 304), 255)
        for row, pictures in enumerate((stented, embolised)):
            for column, picture in enumerate(pictures):
                sheet.paste(picture, (304 * column + 2, 304 * row + 2))
        sheet.save(output, quality=88)


if __name__ == "__main__":
    main(*sys.argv[1:])
