"""Projects a scan by RTK's JosephForwardProjectionImageFilter, on request: the baseline of our projector.

usage: rtk_project.py SCAN

Says "ready" in a line once the scan is there as floats of attenuation, or in a line why not. Then every line
of its input is a view in JSON, in millimetres: where the source and the detector's middle are, the detector's
directions right and down, and width, height and pixel_mm. The answer is a line with the filter's
milliseconds, and the picture's optical depths as 32-bit floats, row by row.
"""

import json
import sys
import time


def attenuation(path):
    """The scan with the paper's opacity applied, in 1/mm."""
    scan = itk.imread(path, itk.F)
    mu = itk.array_view_from_image(scan)
    mu *= 0.02 / 1024
    mu += 0.02
    mu.clip(min=0, out=mu)
    return scan


def projector(scan, view):
    """A filter that is ready to run. RTK spreads it over all cores by itself."""
    image_type = type(scan)
    geometry = RTK.ThreeDCircularProjectionGeometry.New()
    point, vector = itk.Point[itk.D, 3], itk.Vector[itk.D, 3]
    geometry.AddProjection(
        point(view["source"]), point(view["middle"]), vector(view["right"]), vector(view["down"])
    )
    size, pixel_mm = [view["width"], view["height"], 1], view["pixel_mm"]
    detector = RTK.ConstantImageSource[image_type].New(
        Size=size, Spacing=[pixel_mm, pixel_mm, 1.0], Origin=[-pixel_mm * (n - 1) / 2 for n in size]
    )
    detector.Update()
    joseph = RTK.JosephForwardProjectionImageFilter[image_type, image_type].New()
    joseph.SetGeometry(geometry)
    joseph.SetInput(0, detector.GetOutput())
    joseph.SetInput(1, scan)
    return joseph


def answer(request, scan, out):
    joseph = projector(scan, json.loads(request))
    start = time.perf_counter()
    joseph.Update()
    out.write(b"%.6f\n" % (1000 * (time.perf_counter() - start)))
    out.write(itk.array_view_from_image(joseph.GetOutput()).tobytes())
    out.flush()


if __name__ == "__main__":
    answers = sys.stdout.buffer
    try:
        import itk
        from itk import RTK

        resident = attenuation(sys.argv[1])
    except Exception as error:
        answers.write(" ".join(f"{type(error).__name__}: {error}".split()).encode() + b"\n")
        sys.exit(1)
    answers.write(b"ready\n")
    answers.flush()
    for line in sys.stdin:
        answer(line, resident, answers)
