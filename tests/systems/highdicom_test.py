"""PROGRAM HIGHDICOM_PYTHON: a series that highdicom made one file of frames equals the series, voxel for voxel.

HIGHDICOM_PYTHON is an interpreter that has highdicom, as `./dev test-systems` makes it. Exits with 77 without one.
"""
import pathlib
import subprocess
import sys
import tempfile

CONVERT = """
import pathlib, random, sys
import highdicom, pydicom
folder, target = map(pathlib.Path, sys.argv[1:])
slices = [pydicom.dcmread(file) for file in sorted(folder.iterdir())]
random.Random(4).shuffle(slices)
for data in slices:
    data.StudyDate, data.StudyTime, data.StudyID = "20260101", "120000", "1"
    data.AccessionNumber, data.PatientBirthDate, data.PatientSex = "", "", ""
    data.Manufacturer = data.Manufacturer or "none"
enhanced = highdicom.legacy.LegacyConvertedEnhancedCTImage(
    slices, series_instance_uid=highdicom.UID(), series_number=2, sop_instance_uid=highdicom.UID(), instance_number=1)
enhanced.save_as(target)
"""


def main():
    program, python = sys.argv[1:3]
    has_highdicom = pathlib.Path(python).exists() and subprocess.run(
        [python, "-c", "import highdicom"], capture_output=True).returncode == 0
    if not has_highdicom:
        print(f"skipped: {python} has no highdicom; run ./dev test-systems")
        return 77
    with tempfile.TemporaryDirectory(prefix="highdicom-") as name:
        folder = pathlib.Path(name)

        def run(*words):
            subprocess.run([program, *map(str, words), "-q"], check=True, timeout=300)

        def content(scan):
            run("convert", scan, "-o", folder / "content.nrrd")
            return (folder / "content.nrrd").read_bytes()

        run("phantom", "head", "--spacing", "3", "-o", folder / "phantom.nrrd")
        run("convert", folder / "phantom.nrrd", "-o", folder / "series")
        subprocess.run([python, "-c", CONVERT, str(folder / "series"), str(folder / "enhanced.dcm")], check=True,
                       timeout=300)
        if content(folder / "series") != content(folder / "enhanced.dcm"):
            print("the frames differ from the slices")
            return 1
    return 0


sys.exit(main())
