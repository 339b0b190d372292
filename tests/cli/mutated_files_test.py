"""PROGRAM COUNT: mutated files of every kind through the commands that read them, reproducible by their seeds.

Each is read, or rejected by one line on stderr of at most 500 characters: without a crash, in at most 20 s of the
processor and 1 GB. COUNT files in all; the share of each kind that is rejected is printed.
"""
import collections
import gzip
import io
import os
import pathlib
import random
import re
import struct
import subprocess
import sys
import tempfile
import zipfile
import zlib

PROGRAM, COUNT = sys.argv[1], int(sys.argv[2])
FIRST_SEED = int(sys.argv[3]) if len(sys.argv) > 3 else 0
MOST_S, MOST_MB, MOST_LINE = 20, 1000, 500
DONE, BAD_INPUT = 0, 3

TREE = '{"branches": [{"id": 0, "parent": -1, "points": [[0, 0, -40, 4], [0, 1, 0, 4], [0, 0, 40, 4]]}]}'
SCRIPT = "time_s,insertion_mm,rotation_deg\n0,0,0\n0.02,2,30\n0.04,4,60\n"
INSTRUMENT = ('{"name": "short", "radius_mm": 0.6, "density_g_cm3": 1.2, "axial_stiffness_N": 200, "static_friction": 0.1, '
              '"kinetic_friction": 0.08, "sections": [{"length_mm": 20, "bending_stiffness_Nmm2": [20, 90], '
              '"torsional_stiffness_Nmm2": 30, "curvature_per_mm": 0.05}, {"length_mm": 300, '
              '"flexural_modulus_GPa": 0.7, "torsional_stiffness_Nmm2": 300}]}')
SESSION = ('{"xraycast_session": 1, "files": {"map": "map.exr"}, "contrast_mg_ml": 50.0, "simulation": {"nodes_mm": [[1, 2, 3], '
           '[2, 3, 5], [2, 3, 9], [4.25, 5, 16]], "radius_mm": 0.825, "road_map": false}, "camera": {"angle_deg": 10, '
           '"tilt_deg": 0, "table_mm": 0, "zoom": 1.5, "cone_mm": [900, 1200]}, "style": {"look": "fluoro", "compositing": "path", '
           '"continuous": true, "full_contrast": false, "strengths": [1, 0.5]}}')
OPACITY = '{"name": "bone", "unit": "1/mm", "knots": [[-1000, 0], [150, 0], [1000, 0.06]]}'
VTI = """<VTKFile type="ImageData" byte_order="LittleEndian" header_type="UInt32">
<ImageData WholeExtent="0 7 0 5 0 3" Origin="-8 -9 3" Spacing="1 1.5 2">
<Piece Extent="0 7 0 5 0 3"><PointData Scalars="ct"><DataArray type="Int16" Name="ct" format="ascii">{}</DataArray>
</PointData></Piece></ImageData></VTKFile>"""

# The numbers at which sizes, counts and offsets overflow, and those that are none.
WHOLE = [0, 1, -1, 2, 7, 127, 255, 256, 32767, 65535, 65536, 2**31 - 1, 2**31, 2**32 - 1, 2**32, 2**62, 2**63 - 1]
NUMBERS = [str(number) for number in WHOLE] + ["-0", "0.5", "1e-30", "1e30", "1e308", "-1e308", "1e999", "nan", "inf", "-inf", "", "x"]

SCAN = ["info F", "convert F -o out.nrrd", "project F --size 24x24 -o out.nrrd", "cast F --layers 2 --angles 24 -o out.exr"]
MAP = ["render F --size 24x24 -o out.png", "export F -o out.html"]
SURFACE = ["render map.exr --size 24x24 --look surface --vessels F -o out.png"]
TREES = ["simulate F --device-model short.json --script push.csv -o out.csv"]
# The file that is mutated, and the commands that read it.
KINDS = {
    "NRRD": ("ct.nrrd", SCAN), "NIfTI": ("ct.nii", SCAN), "NIfTI gzipped": ("ct.nii.gz", SCAN), "MetaImage": ("ct.mha", SCAN),
    "MetaImage header": ("two.mhd", SCAN), "VTK ImageData": ("ct.vti", SCAN), "DICOM": ("slice.dcm", SCAN),
    "DICOM series": ("series/slice-0003.dcm", [command.replace("F", "series") for command in SCAN]), "zip": ("ct.zip", SCAN),
    "map": ("map.exr", MAP), "basis": ("ct.basis", ["recast F --opacity bilinear -o out.exr"]),
    "tree JSON": ("tree.json", TREES), "tree VTP": ("tree.vtp", TREES), "surface VTP": ("surface.vtp", SURFACE),
    "surface STL": ("surface.stl", SURFACE),
    "script": ("push.csv", ["simulate tree.json --device-model short.json --script F -o out.csv"]),
    "instrument": ("short.json", ["simulate tree.json --device-model F --script push.csv -o out.csv"]),
    "session": ("session.json", ["render --session F --size 24x24 -o out.png", "export --session F -o out.html"]),
    "opacity": ("bone.json", ["cast ct.nrrd --opacity F --angles 24 -o out.exr"]),
    "spectrum": ("beam.txt", ["cast ct.nrrd --opacity spectrum:F --angles 24 -o out.exr"]),
    "centre line": ("line.csv", ["cast ct.nrrd --centre-line F --angles 24 -o out.exr"]),
    "catheter": ("catheter.csv", ["render map.exr --size 24x24 --catheter F -o out.png"]),
    "mask": ("mask.nrrd", ["segment ct.nrrd --from-mask F --surface tubes -o out"]),
}


def run(words):
    """Status, the longer of its times, its memory, and stderr."""
    process = subprocess.Popen([PROGRAM, *words.split(), "--quiet"], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
    err = process.stderr.read().decode(errors="replace")
    _, status, usage = os.wait4(process.pid, 0)
    process.stderr.close()
    process.returncode = os.waitstatus_to_exitcode(status)
    return process.returncode, usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1000, err


def make_inputs():
    for words in ("phantom cylinder --size 12x12x10 -o ct.nrrd", "convert ct.nrrd -o ct.nii", "convert ct.nrrd -o ct.nii.gz",
                  "convert ct.nrrd -o ct.mha", "convert ct.nrrd -o two.mhd", "convert ct.nrrd -o series",
                  "cast ct.nrrd --layers 2 --angles 24 -o map.exr --keep-basis ct.basis"):
        status, _, _, err = run(words)
        assert status == DONE, f"{words}: {err}"
    pathlib.Path("slice.dcm").write_bytes(pathlib.Path("series/slice-0002.dcm").read_bytes())
    with zipfile.ZipFile("ct.zip", "w", zipfile.ZIP_DEFLATED) as archive:
        for file in sorted(pathlib.Path("series").iterdir()):
            archive.write(file)
    noise = random.Random(1)
    texts = {"tree.json": TREE, "push.csv": SCRIPT, "short.json": INSTRUMENT, "session.json": SESSION, "bone.json": OPACITY,
             "beam.txt": "# keV, photons\n20 0.5\n40 1\n60 2.25\n80 0.1\n",
             "line.csv": "x,y,z\n0,0,-30\n1,2,0\n-1.5,2,30\n",
             "catheter.csv": "x,y,z\n0,0,-30\n1,2,-10\n1,2,10\n-1.5,2,30\n",
             "ct.vti": VTI.format(" ".join(str(noise.randint(-1000, 1000)) for _ in range(8 * 6 * 4)))}
    for name, text in texts.items():
        pathlib.Path(name).write_text(text)
    header, voxels = pathlib.Path("ct.nrrd").read_bytes().split(b"\n\n", 1)
    mask = bytearray(12 * 12 * 10)
    for z in range(1, 9):
        for x, y in ((5, 5), (5, 6), (6, 5), (6, 6)):
            mask[x + 12 * (y + 12 * z)] = 1
    assert len(voxels) == 2 * len(mask)
    pathlib.Path("mask.nrrd").write_bytes(header.replace(b"type: short", b"type: unsigned char") + b"\n\n" + mask)
    status, _, _, err = run("segment ct.nrrd --from-mask mask.nrrd --surface tubes -o vessels")
    assert status == DONE, err
    for name in ("tree.vtp", "surface.vtp", "surface.stl"):
        pathlib.Path(name).write_bytes(pathlib.Path("vessels", name).read_bytes())


def change_number(content, chance):
    """One of a text's, by a number beyond all bounds or by one nearby."""
    numbers = list(re.finditer(rb"[-+]?\d+\.?\d*(?:e[-+]?\d+)?", content[:4000]))
    if not numbers:
        return
    number = chance.choice(numbers)
    value = float(number.group())
    near = chance.choice([value + 1, value - 1, 2 * value, value / 2, 1.01 * value, -value, 0])
    text = chance.choice(NUMBERS) if chance.random() < 0.4 else f"{near:g}"
    content[number.start():number.end()] = text.encode()


def change_field(content, at, chance):
    """Bytes that may be a number of a binary header."""
    form = chance.choice(["<h", "<i", "<q", ">i", "<f", "<d"])
    if form[1] in "fd":
        packed = struct.pack(form, chance.choice(WHOLE[:11] + [0.5, float("nan"), float("inf"), 1e30]))
    else:
        size = struct.calcsize(form)
        packed = (chance.choice(WHOLE) % 2 ** (8 * size)).to_bytes(size, "big" if form[0] == ">" else "little")
    content[at:at + len(packed)] = packed


def mutated(whole, others, chance):
    """One change, or a few; half of them where a header is."""
    content = bytearray(whole)
    is_text = whole.isascii()
    for _ in range(chance.choice([1, 1, 1, 2, 3])):
        reach = len(content) if chance.random() < 0.5 else min(len(content), 400)
        at = chance.randrange(max(1, reach))
        kind = chance.choice(["number"] * 6 + ["bit", "cut", "remove", "repeat", "head"] if is_text else
                             ["number"] * 2 + ["bit"] * 4 + ["field"] * 3 + ["cut", "remove", "repeat", "head"])
        if kind == "bit" and content:
            content[min(at, len(content) - 1)] ^= 1 << chance.randrange(8)
        elif kind == "cut":
            del content[at + chance.choice([0, 1, 100]):]
        elif kind == "remove":
            del content[at:at + chance.choice([1, 2, 4, 8, 30, 300])]
        elif kind == "repeat":
            content[at:at] = content[at:at + chance.choice([1, 4, 16, 200])] * chance.choice([1, 2, 50])
        elif kind == "field":
            change_field(content, at, chance)
        elif kind == "number":
            change_number(content, chance)
        elif kind == "head":
            head = chance.choice([8, 64, 352, 512])
            content[:head] = chance.choice(others)[:head]
    return bytes(content)


def with_checksums(basis):
    """Chunks of a tag of four bytes, a size of eight, so many bytes, and a CRC-32 of all that."""
    content, at = bytearray(basis), 12
    while at + 16 <= len(content):
        end = at + 12 + int.from_bytes(content[at + 4:at + 12], "little")
        if end + 4 > len(content):
            break
        content[end:end + 4] = zlib.crc32(content[at:end]).to_bytes(4, "little")
        at = end + 4
    return bytes(content)


def mutated_within(name, whole, others, chance):
    """The same behind packing and checksums, which chance alone does not meet: in three of four files."""
    if chance.random() < 0.25:
        return mutated(whole, others, chance)
    if name == "NIfTI gzipped":
        return gzip.compress(mutated(gzip.decompress(whole), others, chance), mtime=0)
    if name == "basis":
        return with_checksums(mutated(whole, others, chance))
    if name == "zip":
        packed = io.BytesIO()
        with zipfile.ZipFile(io.BytesIO(whole)) as archive, zipfile.ZipFile(packed, "w") as changed:
            one = chance.choice(archive.namelist())
            for member in archive.namelist():
                content = archive.read(member)
                changed.writestr(member, mutated(content, others, chance) if member == one else content)
        return packed.getvalue()
    return mutated(whole, others, chance)


def faults_of(status, took_s, memory_MB, err):
    if status not in (DONE, BAD_INPUT):
        yield f"status {status}"
    if status == BAD_INPUT and (err.count("\n") != 1 or not err.endswith("\n")):
        yield "not one line"
    if len(err) > MOST_LINE:
        yield f"{len(err)} characters"
    if took_s > MOST_S:
        yield f"{took_s:.0f} s"
    if memory_MB > MOST_MB:
        yield f"{memory_MB:.0f} MB"


def main():
    make_inputs()
    wholes = {name: pathlib.Path(file).read_bytes() for name, (file, _) in KINDS.items()}
    assert all(len(whole) < 1_000_000 for whole in wholes.values())
    statuses, worst, bad = collections.defaultdict(collections.Counter), [0, 0, 0], []
    for file, commands in KINDS.values():
        status, _, _, err = run(commands[0].replace("F", file))
        assert status == DONE, f"the whole {file} is refused: {err}"
    for seed in range(FIRST_SEED, FIRST_SEED + COUNT):
        chance = random.Random(seed)
        name = list(KINDS)[seed % len(KINDS)]
        file, commands = KINDS[name]
        pathlib.Path(file).write_bytes(mutated_within(name, wholes[name], list(wholes.values()), chance))
        words = re.sub(r"\bF\b", file, chance.choice(commands))
        status, took_s, memory_MB, err = run(words)
        pathlib.Path(file).write_bytes(wholes[name])
        statuses[name][status] += 1
        worst = [max(pair) for pair in zip(worst, (took_s, memory_MB, len(err)))]
        if faults := ", ".join(faults_of(status, took_s, memory_MB, err)):
            bad.append(f"seed {seed}: {words}: {faults}: {err.strip()[:600]}")
            print(bad[-1], flush=True)
    for name, counts in statuses.items():
        print(f"{name}: {counts[BAD_INPUT]} of {counts.total()} rejected, {counts[DONE]} read")
    total = sum((counts for counts in statuses.values()), collections.Counter())
    print(f"{total.total()} files: {total[BAD_INPUT]} rejected, {total[DONE]} read; at most {worst[0]:.1f} s, {worst[1]:.0f} MB, "
          f"{worst[2]} characters")
    sys.exit(len(bad) > 0)


with tempfile.TemporaryDirectory() as folder:
    os.chdir(folder)
    try:
        main()
    finally:
        os.chdir("/")
