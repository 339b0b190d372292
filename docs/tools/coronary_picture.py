#!/usr/bin/python3
"""usage: coronary_picture.py PROGRAM OUTPUT.jpg

Makes docs/images/coronary-filling.jpg: contrast agent in the left coronary arteries of the thorax phantom over a heartbeat, subtracted, with the flow
in the anterior descending artery. The package xraycast must be found (PYTHONPATH).
"""
import pathlib
import subprocess
import sys
import tempfile

import numpy as np
import xraycast as xc
from PIL import Image, ImageDraw, ImageFont

ROOT = pathlib.Path(__file__).resolve().parents[2]
INJECTED_S, PULSES_PER_S, BEFORE_S = 7, 15, 0.5
SHOWN = (8, 9, 10, 11, 12, 14, 18, 22)  # frames since the mask
SIZE = 300


def run(*words):
    subprocess.run([*map(str, words)], check=True, capture_output=True, text=True)


def plot_of(flow, branch, times_s, width, height):
    """Of two beats, with a mark at each frame."""
    beat_s, curve = flow.time_s[-1], flow.flow_ml_s[:, branch]
    picture = Image.new("L", (width, height), 255)
    draw, font = ImageDraw.Draw(picture), ImageFont.load_default()
    left, right, top, bottom = 60, width - 20, 20, height - 30
    most = 1.1 * curve.max()
    def at(time_s, ml_s): return (left + (right - left) * time_s / (2 * beat_s), bottom - (bottom - top) * ml_s / most)
    draw.line([at(0, 0), at(2 * beat_s, 0)], fill=160)
    draw.line([at(flow.time_s[i % len(curve)] + beat_s * (i // len(curve)), curve[i % len(curve)]) for i in range(2 * len(curve))], fill=0, width=2)
    for number, time_s in enumerate(times_s):
        x, y = at(time_s, np.interp(time_s % beat_s, flow.time_s, curve))
        draw.ellipse([x - 5, y - 5, x + 5, y + 5], fill=0)
        draw.text((x - 3, y - 18), str(number + 1), fill=0, font=font)
    for ml_s in (0, 1, 2):
        draw.text((30, at(0, ml_s)[1] - 5), str(ml_s), fill=0, font=font)
    draw.text((left, 4), "flow in the anterior descending artery, ml/s, over two beats; the heart ejects at the beginning of each", fill=0, font=font)
    for k in range(2):
        draw.text((at(k * beat_s, 0)[0], bottom + 8), f"{k * beat_s:.2f} s", fill=0, font=font)
    return picture


def main(program, output):
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        run(program, "phantom", "thorax", "-o", folder / "thorax.nrrd", "--coronaries", "--truth", folder / "truth")
        run(program, "cast", folder / "thorax.nrrd", "--layers", "16", "-o", folder / "body.exr")
        (folder / "s.csv").write_text("time_s,insertion_mm,rotation_deg,insertion_2_mm,rotation_2_deg\n0,0,0,0,0\n2,190,300,200,0\n2.8,208,390,211,0\n"
                                      "3.3,208,390,230,0\n10,208,390,230,0\n")
        run(program, "simulate", folder / "truth", "--device-model", ROOT / "examples/steering/left-judkins.json", "--device-model", "microcatheter-27f",
            "--entry", "-124,-6,236", "--script", folder / "s.csv", "-o", folder / "log.csv", "--map", folder / "body.exr", "--cine", folder / "dsa.gif",
            "--look", "dsa", "--inject", f"{INJECTED_S},{INJECTED_S + 2}", "--injection-rate", "1.5", "--lao", "-30", "--cranial", "20",
            "--size", f"{SIZE}x{SIZE}", "--isocentre", "44,-16,112", "--cone", "785,1200", "--pixel", "0.4", "--c-arm", "fixed-single-plane",
            "--dose", "cine", "--pulse-rate", PULSES_PER_S)
        tree = xc.VesselTree.read(folder / "truth")
        branch = next(b for b, each in enumerate(tree.branches) if each.name == "left anterior descending artery")
        flow, film = xc.flow(tree), Image.open(folder / "dsa.gif")
        gap, columns = 4, 4
        sheet = Image.new("L", (columns * (SIZE + gap), 2 * (SIZE + gap) + 220), 255)
        times_s = []
        for k, number in enumerate(SHOWN):
            film.seek(number)
            picture = film.convert("L")
            ImageDraw.Draw(picture).text((6, 6), str(k + 1), fill=0, font=ImageFont.load_default())
            sheet.paste(picture, ((SIZE + gap) * (k % columns) + 2, (SIZE + gap) * (k // columns) + 2))
            times_s.append(INJECTED_S - BEFORE_S + number / PULSES_PER_S)
        beat_s = flow.time_s[-1]
        began_s = times_s[0] - times_s[0] % beat_s
        sheet.paste(plot_of(flow, branch, [time_s - began_s for time_s in times_s], sheet.width, 220), (0, 2 * (SIZE + gap)))
        sheet.save(output, quality=80)


if __name__ == "__main__":
    main(*sys.argv[1:])
