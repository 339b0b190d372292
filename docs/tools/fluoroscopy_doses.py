"""The phantom's spine at three doses: draws docs/images/fluoroscopy-doses.jpg. Needs python3-pil.

    python3 docs/tools/fluoroscopy_doses.py PROGRAM
"""

import pathlib
import subprocess
import sys
import tempfile

import PIL.Image

PICTURE = pathlib.Path(__file__).parents[1] / "images" / "fluoroscopy-doses.jpg"
SIDE, GAP, WHITE = 320, 8, 255
LEFT, TOP = 120, 200  # of the crop in pictures of 714 x 714 pixels: vertebrae with a rib and lung beside them


def main(program):
    sheet = PIL.Image.new("L", (3 * SIDE + 2 * GAP, SIDE), WHITE)
    with tempfile.TemporaryDirectory() as folder:
        scan = pathlib.Path(folder) / "thorax.nrrd"
        subprocess.run([program, "-q", "phantom", "thorax", "-o", scan], check=True)
        for index, dose in enumerate(("low", "normal", "cine")):
            file = pathlib.Path(folder) / f"{dose}.png"
            subprocess.run([program, "-q", "project", scan, "-o", file, "--c-arm", "fixed-single-plane", "--field", "220",
                            "--opacity", "spectrum:80", "--dose", dose], check=True)
            picture = PIL.Image.open(file).convert("L")
            assert picture.size == (714, 714), picture.size
            crop = picture.crop((LEFT, TOP, LEFT + SIDE, TOP + SIDE))
            sheet.paste(crop, (index * (SIDE + GAP), 0))
    sheet.save(PICTURE, quality=88)


if __name__ == "__main__":
    main(sys.argv[1])
