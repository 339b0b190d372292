"""The table of grown trees in docs/vessels.md: run as `vessel_grid.py PROGRAM [SEED…]`; prints Markdown.

Trees grow from seeds as VascuSynth's do, with radii from half a voxel to three. Each row is a noise and a blur: what
`segment` reaches, and beside it two oracles. One knows the truth and takes the best of all thresholds on the scan smoothed
by 0, 0.5 or 1 voxel, its largest component. The other knows the paths: it averages the contrast along the true one, seven
voxels to either side, and counts what exceeds the best of 512 straight lines through noise at one place in a thousand.
"""
import json
import pathlib
import subprocess
import sys
import tempfile

import numpy as np
from scipy import ndimage
from scipy.spatial import cKDTree

SIZE, FINE, LUMEN = 100, 3, 255.0
NOISES, BLURS = (5, 11, 25, 50, 75), (0, 0.5, 1)


def grow(seed, ends=216, end_radius=0.5, bend=0.0):
    """The lumen at 3 x 3 x 3 points a voxel [z, y, x], and the branches: (points x, y, z; radius)."""
    random = np.random.RandomState(seed)
    at = [np.array([50.0, 50.0, 4.0]), np.array([50 + random.uniform(-15, 15), 50.0, 30.0])]
    parent = [-1, 0]
    for count in range(1, ends):
        least = 0.45 * SIZE / np.cbrt(count + 1)
        while True:
            end = random.uniform(5, SIZE - 5, 3)
            b, a = np.array(at[1:]), np.array([at[p] for p in parent[1:]])
            t = np.clip(((end - a) * (b - a)).sum(1) / ((b - a) ** 2).sum(1), 0.05, 0.95)
            places = a + t[:, None] * (b - a)
            distance = np.linalg.norm(places - end, axis=1)
            nearest = int(distance.argmin())
            least *= 0.97
            if distance[nearest] >= least:
                break
        new, fork = len(at), nearest + 1
        at.append(places[nearest] + 0.25 * (end - places[nearest]))
        parent.append(parent[fork])
        parent[fork] = new
        at.append(end)
        parent.append(new)
    ends_beyond, inner = np.zeros(len(at), int), set(parent)
    for i in range(len(at)):
        step = i
        while i not in inner and step >= 0:
            ends_beyond[step] += 1
            step = parent[step]
    fine = np.zeros((FINE * SIZE,) * 3, bool)
    branches = []
    for i in range(1, len(at)):
        a, b = at[parent[i]], at[i]
        length = np.linalg.norm(b - a)
        across = np.cross(b - a, random.uniform(-1, 1, 3))
        across *= bend * length / np.linalg.norm(across)
        t = np.linspace(0, 1, int(np.ceil(2 * length)) + 1)
        points = a + t[:, None] * (b - a) + np.sin(np.pi * t)[:, None] * across
        radius = end_radius * np.cbrt(ends_beyond[i])
        branches.append((points, radius))
        for point in points:
            centre, reach = FINE * (point + 0.5) - 0.5, FINE * radius
            low = np.maximum(np.floor(centre - reach).astype(int), 0)
            high = np.minimum(np.ceil(centre + reach).astype(int), FINE * SIZE - 1)
            x, y, z = (np.arange(low[k], high[k] + 1) - centre[k] for k in range(3))
            ball = z[:, None, None] ** 2 + y[None, :, None] ** 2 + x[None, None, :] ** 2 <= reach * reach
            fine[low[2]:high[2] + 1, low[1]:high[1] + 1, low[0]:high[0] + 1] |= ball
    return fine, branches


def means(fine):
    return fine.reshape(SIZE, FINE, SIZE, FINE, SIZE, FINE).mean((1, 3, 5), dtype=np.float32)


class Tree:
    def __init__(self, seed):
        self.seed = seed
        self.fine, self.branches = grow(seed, bend=0.1 * (seed % 2))
        self.share = means(self.fine)
        self.truth = self.share > 1 / 14
        self.points = np.concatenate([points for points, _ in self.branches])
        self.line = np.unique(np.rint(self.points).astype(int), axis=0).astype(float)
        self.volume = float(self.share.sum(dtype=float))

    def scan(self, noise, blur):
        seen = means(ndimage.gaussian_filter(self.fine.astype(np.float32), FINE * blur)) if blur else self.share
        random = np.random.RandomState(1000 + self.seed).standard_normal((SIZE,) * 3)
        return np.rint(np.clip(LUMEN * seen + noise * random, 0, 255)).astype(np.uint8)

    def agreement(self, mask):
        both = (mask & self.truth).sum()
        return both / max(1, mask.sum()), both / self.truth.sum()


def best_threshold(tree, scan):
    best = 0
    for sigma in (0, 0.5, 1):
        values = ndimage.gaussian_filter(scan.astype(np.float32), sigma)
        for threshold in np.geomspace(4, 130, 24):
            mask = values > threshold
            if mask.sum() > 6 * tree.truth.sum():
                continue
            labels, count = ndimage.label(mask, np.ones((3, 3, 3)))
            if count:
                sizes = np.bincount(labels.ravel())
                sizes[0] = 0
                best = max(best, np.mean(tree.agreement(labels == sizes.argmax())))
    return best


def found_by_paths(tree, scan, reach=7, places=1000, lines=512):
    values = scan.astype(np.float32)
    values = ndimage.gaussian_filter(values, 0.5, truncate=3) - ndimage.gaussian_filter(values, 3, truncate=3)
    weights = np.exp(-0.5 * (np.arange(-reach, reach + 1) / 3.5) ** 2)
    weights /= weights.sum()
    sample = lambda points: ndimage.map_coordinates(values, points[..., ::-1].reshape(-1, 3).T, order=1, mode="nearest")
    random = np.random.RandomState(7)
    away = ndimage.distance_transform_edt(~tree.truth)
    dark = np.argwhere(away > 6)
    dark = dark[((dark > 8) & (dark < SIZE - 9)).all(1)][:, ::-1]
    centres = dark[random.choice(len(dark), places)]
    directions = random.standard_normal((lines, 3))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    steps = np.arange(-reach, reach + 1)
    offsets = directions[:, None] * steps[None, :, None]
    best = [(sample(c + offsets).reshape(lines, -1) @ weights).max() for c in centres]
    limit = np.quantile(best, 0.999)
    hits, crossed = [], []
    for points, _ in tree.branches:
        along = np.linspace(0, 1, max(2, len(points) // 2))  # a voxel apart
        path = np.stack([np.interp(along, np.linspace(0, 1, len(points)), points[:, k]) for k in range(3)], 1)
        contrast = sample(path)
        for i in range(len(path)):
            inside = (i + steps >= 0) & (i + steps < len(path))
            strength = (contrast[(i + steps)[inside]] * weights[inside]).sum() / np.sqrt((weights[inside] ** 2).sum())
            hits.append(strength > limit / np.sqrt((weights ** 2).sum()))
            crossed.append(path[i])
    nearest = cKDTree(np.array(crossed)).query(tree.line)[1]
    return np.mean(np.array(hits)[nearest])


def read_nrrd(path):
    header, _, data = path.read_bytes().partition(b"\n\n")
    fields = dict(line.split(": ", 1) for line in header.decode().splitlines() if ": " in line)
    if fields["encoding"] == "gzip":
        import gzip
        data = gzip.decompress(data)
    kind = {"unsigned char": "u1", "float": "<f4"}[fields["type"]]
    return np.frombuffer(data, kind).reshape([int(n) for n in fields["sizes"].split()][::-1])


def measured(program, tree, scan, folder):
    """precision, recall, found, off, false length, volume by radii, by lumen.nrrd"""
    scan.tofile(folder / "scan.raw")
    (folder / "scan.mhd").write_text(
        "ObjectType = Image\nNDims = 3\nBinaryData = True\nBinaryDataByteOrderMSB = False\nDimSize = 100 100 100\n"
        "ElementSpacing = 1 1 1\nElementType = MET_UCHAR\nElementDataFile = scan.raw\n")
    subprocess.run([program, "segment", folder / "scan.mhd", "-o", folder / "vessels", "-q"], check=True,
                   capture_output=True)
    mask = read_nrrd(folder / "vessels" / "mask.nrrd") > 0
    fill = read_nrrd(folder / "vessels" / "lumen.nrrd")
    branches = [np.array([p[:4] for p in branch["points"]])
                for branch in json.loads((folder / "vessels" / "tree.json").read_text())["branches"]]
    points = np.concatenate([b[:, :3] for b in branches])
    true = cKDTree(tree.points)
    volume = wrong = length = 0
    for b in branches:
        steps, a, c = np.linalg.norm(np.diff(b[:, :3], axis=0), axis=1), b[:-1, 3], b[1:, 3]
        volume += (np.pi * steps * (a * a + a * c + c * c) / 3).sum()
        wrong += steps[true.query(b[1:, :3])[0] > 2].sum()
        length += steps.sum()
    return (*tree.agreement(mask), (cKDTree(points).query(tree.line)[0] < 2).mean(),
            cKDTree(tree.line).query(points)[0].mean(), wrong / length, volume / tree.volume,
            fill.sum(dtype=float) / tree.volume)


def main():
    program, seeds = sys.argv[1], [int(s) for s in sys.argv[2:]] or [71, 72, 73]
    trees = [Tree(seed) for seed in seeds]
    print("| blur | noise | precision | recall | mean | best threshold | found | by the paths | off | false length | "
          "volume by radii | by `lumen.nrrd` |\n" + 12 * "|---" + "|")
    for blur in BLURS:
        for noise in NOISES:
            rows = []
            for tree in trees:
                scan = tree.scan(noise, blur)
                with tempfile.TemporaryDirectory() as folder:
                    p, r, *rest = measured(program, tree, scan, pathlib.Path(folder))
                rows.append((p, r, (p + r) / 2, best_threshold(tree, scan), rest[0], found_by_paths(tree, scan), *rest[1:]))
            p, r, mean, threshold, found, paths, off, wrong, radii, fill = np.mean(rows, 0)
            print(f"| {blur} | {noise} | {p:.2f} | {r:.2f} | {mean:.3f} | {threshold:.3f} | {found:.0%} | {paths:.0%} | "
                  f"{off:.2f} | {wrong:.1%} | {radii:.2f} | {fill:.2f} |", flush=True)


if __name__ == "__main__":
    main()
