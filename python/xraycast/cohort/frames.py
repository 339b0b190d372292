"""Training frames of a scan with their labels: PNG pictures, and coco.json with cameras, vessels and catheter.

The same scan, options and seed give the same frames.
"""
import json
import zlib

import numpy as np

from .. import _core
from .._pictures import grey_range, greys, project_points

CONE_MM = (1000, 1500)  # source to isocentre, source to detector
LAO_DEG, CRANIAL_DEG = 90, 40  # random poses lie within these on either side
MOST_CONTRAST_PER_MM = 0.03  # of optical depth: some 15 mg of iodine per ml at 80 kV
SPEED_MM_PER_MS = 0.1
VESSEL, CATHETER = 1, 2


def write_frames(scan, folder, options, vessels, name):
    """vessels: those of the scan, or None. name: the scan's, from which its random numbers depend."""
    folder.mkdir()
    random = np.random.default_rng([options.seed, zlib.crc32(name.encode())])
    lengths = _vessel_lengths(scan, vessels)
    run = CatheterRun(vessels.tree, options.catheter, options.frames, random) if options.catheter else None
    document = {"info": {"scan": name, "seed": options.seed, "version": _core.__version__},
                "images": [], "annotations": [], "categories": _categories(len(run.shape.markers) if run else 0)}
    for number, (lao, cranial) in enumerate(_poses(options, random)):
        frame = scan.project(lao=lao, cranial=cranial, size=options.size, cone_mm=CONE_MM, opacity=options.opacity)
        picture = Picture(frame, random)
        if lengths:
            picture.add_vessels(lengths)
        if run:
            picture.add_instrument(run.next_shape())
        picture.write(folder / f"{number:04}.png")
        picture.describe(document, number, f"{number:04}.png")
    (folder / "coco.json").write_text(json.dumps(document) + "\n", encoding="utf-8")


def _categories(markers):
    keypoints = ["tip", *(f"marker {number}" for number in range(1, markers + 1))]
    return [{"id": VESSEL, "name": "vessel"}, {"id": CATHETER, "name": "catheter", "keypoints": keypoints, "skeleton": []}]


def _poses(options, random):
    """(lao, cranial) in degrees: those given, in turn, or random ones."""
    if options.poses:
        return [options.poses[i % len(options.poses)] for i in range(options.frames)]
    spread = random.uniform(-1, 1, (options.frames, 2)) * (LAO_DEG, CRANIAL_DEG)
    return [(round(float(lao), 3), round(float(cranial), 3)) for lao, cranial in spread]


def _vessel_lengths(scan, vessels):
    """The mask as a scan whose optical depth is the length in vessels, mm."""
    if vessels is None:
        return None
    hu = np.where(vessels.mask > 0, np.int16(1000), np.int16(-1000))
    return _core.Scan.from_array(hu, scan.spacing_mm, scan.origin_mm)


class CatheterRun:
    """A catheter that is pushed further from frame to frame, and turned."""

    def __init__(self, tree, model, frames, random):
        self._catheter = _core.Catheter(tree, model)
        most_mm = min(self._catheter.max_insertion_mm, longest_way_mm(tree))
        self._insertions_mm = iter(np.sort(random.uniform(0.1, 0.9, frames)) * most_mm)
        self._random = random

    @property
    def shape(self):
        return self._catheter.shape

    def next_shape(self):
        push_mm = next(self._insertions_mm) - self._catheter.state.insertion_mm
        turn_deg = self._random.uniform(-90, 90)
        self._catheter.step(push_mm=max(0.0, push_mm), turn_deg=turn_deg, ms=max(100, int(push_mm / SPEED_MM_PER_MS)))
        return self.shape


def longest_way_mm(tree):
    """From the root to a leaf."""
    ways = {-1: 0.0}
    waiting = [tree.root]
    while waiting:
        branch = tree[number := waiting.pop()]
        ways[number] = ways[branch.parent] + branch.length_mm
        waiting += branch.children
    return max(ways.values())


class Picture:
    """A frame, what is added to it, and the labels of that."""

    def __init__(self, frame, random):
        self._tau = np.array(frame.tau)
        self._frame, self._random = frame, random
        self._K, self._RT = np.array(frame.K), np.array(frame.RT)[:3]
        self._contrast_per_mm = 0.0
        self._labels = []

    def add_vessels(self, lengths):
        """Contrast agent, thin or thick."""
        height, width = self._tau.shape
        through = lengths.project(K=self._K, RT=self._RT, size=(width, height), opacity=_core.Opacity([(-1000, 0), (1000, 1)])).tau
        self._contrast_per_mm = float(self._random.uniform(0, MOST_CONTRAST_PER_MM))
        self._tau += np.float32(self._contrast_per_mm) * through
        # At the edge of the mask half a voxel's length is interpolated.
        self._labels.append((VESSEL, through > 0.5 * min(lengths.spacing_mm), {}))

    def add_instrument(self, instrument):
        depths = self._frame.absorption(instruments=instrument)
        self._tau += depths
        points_mm = np.concatenate([instrument.nodes_mm[-1:], instrument.marker_middles_mm])
        keypoints = [self._keypoint(point_mm) for point_mm in points_mm]
        self._labels.append((CATHETER, depths > 0, {"keypoints": [number for point in keypoints for number in point],
                                                    "num_keypoints": sum(seen > 0 for _, _, seen in keypoints)}))

    def _keypoint(self, point_mm):
        """COCO's: column, row, and 2 where it is in the picture; 0, 0, 0 of what has yet to enter the body."""
        if np.isnan(point_mm).any():
            return [0, 0, 0]
        column, row, _ = project_points(point_mm[None], self._K, self._RT)[0]
        is_seen = 0 <= round(column) < self._tau.shape[1] and 0 <= round(row) < self._tau.shape[0]
        return [round(float(column), 2), round(float(row), 2), 2 if is_seen else 0]

    def write(self, path):
        """Logarithmic, as fluoroscopes show it: grey values fall with the optical depth, over the range that the body has."""
        from PIL import Image
        Image.fromarray(greys(self._tau, grey_range(self._tau))).save(path)

    def describe(self, document, number, file):
        height, width = self._tau.shape
        document["images"].append({
            "id": number, "file_name": file, "width": width, "height": height, "K": self._K.tolist(), "RT": self._RT.tolist(),
            "lao": self._frame.lao, "cranial": self._frame.cranial, "contrast_per_mm": self._contrast_per_mm})
        for category, mask, more in self._labels:
            if mask.any():
                document["annotations"].append({"id": len(document["annotations"]) + 1, "image_id": number, "iscrowd": 0,
                                                "category_id": category, **_mask_labels(mask), **more})


def _mask_labels(mask):
    rows, columns = np.nonzero(mask)
    left, top = int(columns.min()), int(rows.min())
    return {"bbox": [left, top, int(columns.max()) - left + 1, int(rows.max()) - top + 1], "area": int(mask.sum()),
            "segmentation": {"size": list(mask.shape), "counts": run_lengths(mask)}}


def run_lengths(mask):
    """COCO's: lengths of runs of 0 and 1 in turn, down the columns, 0 first."""
    flat = mask.ravel(order="F")
    starts = np.concatenate([[0], np.flatnonzero(flat[1:] != flat[:-1]) + 1, [flat.size]])
    counts = np.diff(starts).tolist()
    return [0, *counts] if flat[0] else counts
