"""The steps, one function each: (scan, folder, options, made), where made holds the scan's name and the results of earlier steps."""
import json


def info(scan, folder, options, made):
    hu = scan.hu
    facts = {"size": list(hu.shape[::-1]), "spacing_mm": list(scan.spacing_mm), "origin_mm": list(scan.origin_mm),
             "hu": [int(hu.min()), int(hu.max())], "notes": list(scan.notes), "warnings": list(scan.warnings)}
    (folder / "info.json").write_text(json.dumps(facts, indent=1) + "\n", encoding="utf-8")


def cast(scan, folder, options, made):
    body = scan.cast(layers=options.layers, angles=options.angles, opacity=options.opacity)
    body.write(folder / "map.exr")
    (folder / "map.png").write_bytes(body._repr_png_())


def segment(scan, folder, options, made):
    made["vessels"] = vessels = scan.segment()
    vessels.write(folder / "vessels")


def frames(scan, folder, options, made):
    from .frames import write_frames
    write_frames(scan, folder / "frames", options, made.get("vessels"), made["name"])


ALL = {"info": info, "cast": cast, "segment": segment, "frames": frames}
