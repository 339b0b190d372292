"""PROGRAM COUNT: mutated files of every kind through the commands that read them, reproducible by their seeds.

Each is read, or rejected by one line on stderr of at most 500 characters: without a crash, in at most 20 s of the
processor and 1 GB. COUNT files in all; the share of each kind that is rejected is printed.
"""
import collections
import gzip
import io
import json
import os
import pathlib
import random
import re
import resource
import struct
import subprocess
import sys
import tempfile
import zipfile
import zlib

PROGRAM, COUNT = sys.argv[1], int(sys.argv[2])
FIRST_SEED = int(sys.argv[3]) if len(sys.argv) > 3 else 0
C_ARM = pathlib.Path(__file__).resolve().parents[2] / "viewer/c_arms/mobile-intensifier.json"
MOST_S, MOST_MB, MOST_LINE = 20, 1000, 500
ENDED_S = 300  # of a program that might go on for ever
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

CAMERA_YAML = """%YAML:1.0
---
camera_matrix: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: {K}
RT: !!opencv-matrix
   rows: 3
   cols: 4
   dt: d
   data: {RT}
"""
MOTION = """{"version": 1, "modes": [
  {"name": "breath", "period_s": 4, "phases": [{"phase": 0}, {"phase": 1, "field": "field.nrrd"}]},
  {"name": "heart", "waveform": [[0, 0], [0.8, 1], [1.7, 2]], "phases": [{"phase": 0}, {"phase": 0.35, "field": ["move.tfm"]}]}]}
"""
TRANSFORM = ("#Insight Transform File V1.0\n#Transform 0\nTransform: AffineTransform_double_3_3\n"
             "Parameters: 1 0.02 0 0 0.98 0.01 0.02 0 1.03 1 2 3\nFixedParameters: 1 2 3\n")
FIELD = ("NRRD0004\ntype: float\ndimension: 4\nspace: left-posterior-superior\nsizes: 3 2 3 2\n"
         "space directions: none (200,0,0) (0,120,0) (0,0,200)\nkinds: vector domain domain domain\n"
         "encoding: raw\nendian: little\nspace origin: (-100,-120,-100)\n\n")
OBJ = """# a tube of four corners, closed
mtllib a.mtl
v -4 -4 -40
v 4 -4 -40
v 4 4 -40
v -4 4 -40
v -4 -4 40
v 4 -4 40
v 4 4 40
v -4 4 40
vt 0 0
f 1/1 4/1 3/1 2/1
f 5 6 7 8
f 1 2 6 5
f 2 3 7 6
f 3 4 8 7
f 4 1 5 8
"""
SWC = "# a tree\n1 2 0 0 0 3 -1\n2 2 0 0 10 2.5 1\n3 2 0 0 20 2 2\n4 2 5 0 30 1 3\n5 2 9 0 40 1 4\n6 2 -5 0 30 1 3\n"
LINES = "branch,x_mm,y_mm,z_mm,radius\na,0,0,0,3\na,0,0,10,2\na,5,0,20,2\nb,0,0,0,3\nb,0,0,10,2\nb,-5,0,20,2\n"
MARKUPS = """{"@schema": "v1.0.3", "markups": [{"type": "Curve", "name": "a", "coordinateSystem": "RAS", "coordinateUnits": "mm",
 "controlPoints": [{"position": [0, 0, 0]}, {"position": [0, 0, 9], "positionStatus": "defined"}, {"position": [1, 0, 20]}],
 "measurements": [{"name": "length"}, {"name": "radius", "controlPointValues": [3, 2, 1.5]}]}]}
"""
LINES_VTK = """# vtk DataFile Version 3.0
SPACE=LPS
ASCII
DATASET POLYDATA
POINTS 3 float
0 0 0 0 0 10 8 0 20
LINES 1 4
3 0 1 2
POINT_DATA 3
SCALARS MaximumInscribedSphereRadius float
LOOKUP_TABLE default
3 2 1
"""

# The numbers at which sizes, counts and offsets overflow, and those that are none.
WHOLE = [0, 1, -1, 2, 7, 127, 255, 256, 32767, 65535, 65536, 2**31 - 1, 2**31, 2**32 - 1, 2**32, 2**62, 2**63 - 1]
NUMBERS = [str(number) for number in WHOLE] + ["-0", "0.5", "1e-30", "1e30", "1e308", "-1e308", "1e999", "nan", "inf", "-inf", "", "x"]

SCAN = ["info F", "convert F -o out.nrrd", "project F --size 24x24 -o out.nrrd", "cast F --layers 2 --angles 24 -o out.exr"]
MOVED = ["convert ct.nrrd --motion motion.json --phase breath=1 --phase heart=0.2 -o out.nrrd"]
VESSELS = ["vessels F --triangles 400 -o out"]
REGISTER = "register ct.nrrd xray.dcm --search 0,0 -o out.json"
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
    "Genesis": ("genesis/2.fro", [command.replace("F", "genesis") for command in SCAN]),
    "map that moves": ("moving.exr", ["render F --size 24x24 --phase breath=0.5 -o out.png"]),
    "basis of that": ("moving.basis", ["recast F --opacity bilinear -o out.exr"]),
    "motion": ("motion.json", MOVED), "field": ("field.nrrd", MOVED), "transform": ("move.tfm", MOVED),
    "surface OBJ": ("tube.obj", VESSELS + SURFACE), "centrelines SWC": ("lines.swc", VESSELS),
    "centrelines CSV": ("lines.csv", VESSELS), "markups": ("lines.mrk.json", VESSELS),
    "centrelines VTK": ("lines.vtk", VESSELS), "mask as vessels": ("mask.nrrd", VESSELS),
    "C-arm": ("arm.json", ["render map.exr --c-arm F --size 24x24 -o out.png"]),
    "X-ray": ("xray.dcm", [REGISTER]), "X-ray as PNG": ("xray.png", [REGISTER.replace(".dcm", ".png") + " --camera camera.json"]),
    "camera": ("camera.json", [REGISTER + " --camera F"]), "camera YAML": ("camera.yml", [REGISTER + " --camera F"]),
    "start": ("pose.json", [REGISTER + " --start F"]),
    "mask": ("mask.nrrd", ["segment ct.nrrd --from-mask F --surface tubes -o out"]),
}


def run(words):
    """Status, the longer of its times, its memory, and stderr."""
    process = subprocess.Popen([PROGRAM, *words.split(), "--quiet"], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE,
                               preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_CPU, (ENDED_S, ENDED_S)))
    err = process.stderr.read().decode(errors="replace")
    _, status, usage = os.wait4(process.pid, 0)
    process.stderr.close()
    process.returncode = os.waitstatus_to_exitcode(status)
    return process.returncode, usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1000, err


# Where a slice's image header begins, and the fields that are read of it; of version 3.
GENESIS_HEADER, GENESIS_PIXELS = 2394, 3416
GENESIS_FIELDS = [(GENESIS_HEADER + at, ">f") for at in (26, 50, 54, 126, 130, 134)]


def genesis_slice(location_mm, noise):
    """Of 12 x 10 pixels of 80 to 130 HU."""
    content = bytearray(GENESIS_PIXELS)
    struct.pack_into(">4s5i", content, 0, b"IMGF", GENESIS_PIXELS, 12, 10, 16, 1)
    struct.pack_into(">h", content, 52, 3)
    struct.pack_into(">i", content, 148, GENESIS_HEADER)
    for (at, form), value in zip(GENESIS_FIELDS, (4, 2, 2, location_mm, 20, 30)):
        struct.pack_into(form, content, at, value)
    return bytes(content) + b"".join(struct.pack(">H", noise.randint(1104, 1154)) for _ in range(12 * 10))


def make_motion():
    pathlib.Path("motion.json").write_text(MOTION)
    pathlib.Path("move.tfm").write_text(TRANSFORM)
    noise = random.Random(2)
    vectors = b"".join(struct.pack("<3f", noise.uniform(-9, 9), noise.uniform(-9, 9), noise.uniform(-20, 20)) for _ in range(12))
    pathlib.Path("field.nrrd").write_bytes(FIELD.encode() + vectors)


def make_inputs():
    make_motion()
    for words in ("phantom cylinder --size 12x12x10 -o ct.nrrd", "convert ct.nrrd -o ct.nii", "convert ct.nrrd -o ct.nii.gz",
                  "convert ct.nrrd -o ct.mha", "convert ct.nrrd -o two.mhd", "convert ct.nrrd -o series",
                  "cast ct.nrrd --layers 2 --angles 24 -o map.exr --keep-basis ct.basis",
                  "project ct.nrrd --size 48x48 --cone 1000,1500 -o xray.dcm",
                  "project ct.nrrd --size 48x48 --cone 1000,1500 -o xray.png", "register ct.nrrd xray.dcm --search 0,0 -o pose.json",
                  "cast ct.nrrd --layers 2 --angles 24 --motion motion.json -o moving.exr --keep-basis moving.basis"):
        status, _, _, err = run(words)
        assert status == DONE, f"{words}: {err}"
    pathlib.Path("slice.dcm").write_bytes(pathlib.Path("series/slice-0002.dcm").read_bytes())
    with zipfile.ZipFile("ct.zip", "w", zipfile.ZIP_DEFLATED) as archive:
        for file in sorted(pathlib.Path("series").iterdir()):
            archive.write(file)
    noise, pose = random.Random(1), json.loads(pathlib.Path("pose.json").read_text())["poses"][0]
    camera = {key: pose[key] for key in ("K", "RT")}
    texts = {"camera.json": json.dumps(camera),
             "camera.yml": CAMERA_YAML.format(**{key: sum(rows, []) for key, rows in camera.items()}),
             "tree.json": TREE, "push.csv": SCRIPT, "short.json": INSTRUMENT, "session.json": SESSION, "bone.json": OPACITY,
             "beam.txt": "# keV, photons\n20 0.5\n40 1\n60 2.25\n80 0.1\n",
             "tube.obj": OBJ, "lines.swc": SWC, "lines.csv": LINES, "lines.mrk.json": MARKUPS, "lines.vtk": LINES_VTK,
             "arm.json": re.sub(r'"sources": \{.*?\},', "", C_ARM.read_text(), flags=re.S),
             "line.csv": "x,y,z\n0,0,-30\n1,2,0\n-1.5,2,30\n",
             "catheter.csv": "x,y,z\n0,0,-30\n1,2,-10\n1,2,10\n-1.5,2,30\n",
             "ct.vti": VTI.format(" ".join(str(noise.randint(-1000, 1000)) for _ in range(8 * 6 * 4)))}
    for name, text in texts.items():
        pathlib.Path(name).write_text(text)
    pathlib.Path("genesis").mkdir()
    for slice_ in range(4):
        pathlib.Path(f"genesis/{slice_}.fro").write_bytes(genesis_slice(4.0 * slice_, noise))
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


NUMBER = rb"-?\d+(?:\.\d+)?(?:e[-+]?\d+)?"


def nearby(number, chance):
    """Another one of as many characters."""
    size = len(number)
    value = chance.choice([1.01, 0.99, 1.3, 0.7, 2, 0.5, -1]) * float(number) + chance.choice([0, 0, 0, 1, -1])
    text = next((text for digits in (9, 5, 3, 1) if len(text := f"{value:.{digits}g}") <= size), "9" * size)
    return text.encode().ljust(size)


def with_other_numbers(content, chance, within):
    """One or two of the numbers in the last group of `within` are others: in all places where what it matches is repeated."""
    for _ in range(chance.choice([1, 1, 2])):
        match = chance.choice([match for match in re.finditer(within, content) if re.search(NUMBER, match[2])])
        number = chance.choice(list(re.finditer(NUMBER, match[2])))
        text = match[2][:number.start()] + nearby(number.group(), chance) + match[2][number.end():]
        content = content.replace(match[0], match[1] + text)
    return content


def with_other_attributes(map_file, chance):
    """Of an OpenEXR file, texts of xraycast's."""
    return with_other_numbers(map_file, chance, rb"(xraycast:\w+\0string\0(?s:.{4}))([^\0]*?)(?=xraycast:|\0)")


def with_other_weights(basis, chance):
    """Bytes behind the header, or numbers of it."""
    if chance.random() < 0.3:
        return with_checksums(with_other_numbers(basis, chance, rb"(HEAD(?s:.{8}))([^\0]*)(?=OUTL)"))
    content, begin = bytearray(basis), 24 + int.from_bytes(basis[16:24], "little") + 4 + 12
    for _ in range(chance.choice([1, 4, 30])):
        content[chance.randrange(begin, len(content))] ^= 1 << chance.randrange(8)
    return with_checksums(content)


def with_other_fields(genesis, chance):
    """Fields that a Genesis file's reader looks at, and pixels."""
    content = bytearray(genesis)
    for _ in range(chance.choice([1, 1, 2])):
        at, form = chance.choice([*GENESIS_FIELDS, *[(chance.randrange(3416, len(content) - 1), ">H")] * len(GENESIS_FIELDS)])
        old, = struct.unpack_from(form, content, at)
        new = chance.choice([1.01 * old, 0.99 * old, old + 1, old - 1, 1.5 * old, 0, -old] if form == ">f" else
                            [max(0, old + chance.choice([-1, 1, 2, -300, 300])) & 0x7fff])
        struct.pack_into(form, content, at, new)
    return bytes(content)


def with_other_pixels(png, chance):
    """A PNG whose checksums are right: with other numbers in its header, or other bytes behind it."""
    def chunk(kind, content):
        return struct.pack(">I", len(content)) + kind + content + struct.pack(">I", zlib.crc32(kind + content))

    header = bytearray(png[16:29])
    at, pixels = 33, b""
    while at + 12 <= len(png):
        size, = struct.unpack_from(">I", png, at)
        pixels += png[at + 8:at + 8 + size] * (png[at + 4:at + 8] == b"IDAT")
        at += 12 + size
    rows = bytearray(zlib.decompress(pixels))
    for _ in range(chance.choice([1, 4, 30])):
        rows[chance.randrange(len(rows))] ^= 1 << chance.randrange(8)
    if chance.random() < 0.3:
        header[chance.randrange(len(header))] ^= 1 << chance.randrange(8)
    return png[:8] + chunk(b"IHDR", bytes(header)) + chunk(b"IDAT", zlib.compress(rows)) + chunk(b"IEND", b"")


def in_an_archive(packed, chance, others):
    """One of its files is a mutated one."""
    changed_file = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(packed)) as archive, zipfile.ZipFile(changed_file, "w") as changed:
        one = chance.choice(archive.namelist())
        for member in archive.namelist():
            content = archive.read(member)
            changed.writestr(member, mutated(content, others, chance) if member == one else content)
    return changed_file.getvalue()


def mutated_within(name, whole, others, chance):
    """The same behind packing and checksums, and changes that leave a file one of its kind, which chance alone does not make:
    in three of four files."""
    if chance.random() < 0.25:
        return mutated(whole, others, chance)
    if name == "NIfTI gzipped":
        return gzip.compress(mutated(gzip.decompress(whole), others, chance), mtime=0)
    if name in ("map", "map that moves"):
        return with_other_attributes(whole, chance)
    if name in ("basis", "basis of that"):
        return with_other_weights(whole, chance)
    if name == "Genesis":
        return with_other_fields(whole, chance)
    if name == "X-ray as PNG":
        return with_other_pixels(whole, chance)
    if name == "zip":
        return in_an_archive(whole, chance, others)
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
    statuses, bad = collections.defaultdict(collections.Counter), []
    worst = [(0, ""), (0, ""), (0, "")]
    # Kind by kind, so that few files are of all; those of a second each come less often.
    names = [name for turn in range(6) for name, (_, commands) in KINDS.items() if turn == 0 or VESSELS[0] not in commands]
    for file, commands in KINDS.values():
        status, _, _, err = run(commands[0].replace("F", file))
        assert status == DONE, f"the whole {file} is refused: {err}"
    for seed in range(FIRST_SEED, FIRST_SEED + COUNT):
        chance = random.Random(seed)
        name = names[seed % len(names)]
        file, commands = KINDS[name]
        pathlib.Path(file).write_bytes(mutated_within(name, wholes[name], list(wholes.values()), chance))
        words = re.sub(r"\bF\b", file, chance.choice(commands))
        status, took_s, memory_MB, err = run(words)
        pathlib.Path(file).write_bytes(wholes[name])
        statuses[name][status] += 1
        worst = [max(pair) for pair in zip(worst, ((took_s, words), (memory_MB, words), (len(err), words)))]
        if faults := ", ".join(faults_of(status, took_s, memory_MB, err)):
            bad.append(f"seed {seed}: {words}: {faults}: {err.strip()[:600]}")
            print(bad[-1], flush=True)
    for name, counts in statuses.items():
        print(f"{name}: {counts[BAD_INPUT]} of {counts.total()} rejected, {counts[DONE]} read")
    total = sum((counts for counts in statuses.values()), collections.Counter())
    print(f"{total.total()} files: {total[BAD_INPUT]} rejected, {total[DONE]} read; at most {worst[0][0]:.1f} s "
          f"({worst[0][1]}), {worst[1][0]:.0f} MB ({worst[1][1]}), {worst[2][0]} characters")
    sys.exit(len(bad) > 0)


with tempfile.TemporaryDirectory() as folder:
    os.chdir(folder)
    try:
        main()
    finally:
        os.chdir("/")
