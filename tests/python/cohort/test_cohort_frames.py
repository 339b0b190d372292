"""Training frames and their labels."""
import json

import numpy as np
import pytest
import xraycast as xc
from xraycast._pictures import project_points
from xraycast.cohort.frames import run_lengths, write_frames
from xraycast.cohort.options import Options

Image = pytest.importorskip("PIL.Image")
SIZE = (96, 80)


class Straight:
    """Vessels as Scan.segment() gives them, of a straight pipe along z through the middle of a box."""

    def __init__(self, box, tmp_path):
        self.mask = np.zeros(box.hu.shape, np.uint8)
        depth, height, width = box.hu.shape
        self.mask[depth // 4:-depth // 4, height // 2 - 2:height // 2 + 2, width // 2 - 2:width // 2 + 2] = 1
        x, y, _ = box.centre_mm
        points = ", ".join(f"[{x}, {y}, {z}, 5]" for z in range(-60, 61, 5))
        (tmp_path / "tree.json").write_text('{"branches": [{"id": 0, "parent": -1, "points": [%s]}]}' % points)
        self.tree = xc.VesselTree.read(tmp_path / "tree.json")


def decoded(annotation):
    height, width = annotation["segmentation"]["size"]
    values = np.arange(len(annotation["segmentation"]["counts"])) % 2
    return np.repeat(values, annotation["segmentation"]["counts"]).reshape(width, height).T


@pytest.fixture(scope="module")
def frames(tmp_path_factory):
    scan = xc.phantom("box", spacing_mm=4)
    folder = tmp_path_factory.mktemp("frames")
    vessels = Straight(scan, folder)

    def make(name, scan_name="a", **options):
        write_frames(scan, folder / name, Options(frames=3, size=SIZE, **options), vessels, scan_name)
        return {file.name: file.read_bytes() for file in (folder / name).iterdir()}
    return make


def test_pictures_and_labels_are_complete(frames):
    files = frames("all", catheter="guidewire-035-j")
    assert sorted(files) == ["0000.png", "0001.png", "0002.png", "coco.json"]
    labels = json.loads(files["coco.json"])
    assert [image["file_name"] for image in labels["images"]] == ["0000.png", "0001.png", "0002.png"]
    assert all((image["width"], image["height"]) == SIZE and 0 < image["contrast_per_mm"] < 0.03 for image in labels["images"])
    assert len({image["lao"] for image in labels["images"]}) == 3
    assert {a["category_id"] for a in labels["annotations"]} == {category["id"] for category in labels["categories"]} == {1, 2}
    for annotation in labels["annotations"]:
        mask = decoded(annotation)
        assert mask.shape == SIZE[::-1] and mask.sum() == annotation["area"]
        left, top, width, height = annotation["bbox"]
        assert mask[top:top + height, left:left + width].sum() == annotation["area"]


def test_labels_lie_on_what_they_label(frames):
    """The pipe's ends, by the cameras' matrices, lie in the vessels' mask, and the tip in the catheter's."""
    labels = json.loads(frames("places", catheter="guidewire-035-j")["coco.json"])
    for annotation in labels["annotations"]:
        image = labels["images"][annotation["image_id"]]
        mask = decoded(annotation)
        if annotation["category_id"] == 2:
            keypoints = np.reshape(annotation["keypoints"], (-1, 3))
            assert len(keypoints) == len(labels["categories"][1]["keypoints"]) == 2  # the tip, and the middle of its coil
            assert annotation["num_keypoints"] == (keypoints[:, 2] > 0).sum() > 0
            for column, row, seen in keypoints:
                assert seen == 0 or mask[round(row), round(column)]
        else:
            K, RT = np.array(image["K"]), np.array(image["RT"])
            for column, row, _ in project_points(np.array([[-2.0, -2.0, z] for z in (-20, 0, 20)]), K, RT):
                assert mask[round(row), round(column)]


def test_frames_are_those_of_the_seed_and_the_scan(frames):
    first = frames("first", catheter="guidewire-035-j")
    assert frames("second", catheter="guidewire-035-j") == first
    assert frames("third", seed=2)["0000.png"] != first["0000.png"]
    assert frames("fourth", scan_name="b")["0000.png"] != first["0000.png"]


def test_given_poses_are_taken_in_turn(frames):
    labels = json.loads(frames("given", poses=((30.0, 10.0), (-20.0, 0.0)))["coco.json"])
    assert np.allclose([(image["lao"], image["cranial"]) for image in labels["images"]], [(30, 10), (-20, 0), (30, 10)])


def test_run_lengths_are_cocos():
    assert run_lengths(np.array([[0, 1], [1, 1]], bool)) == [1, 3]
    assert run_lengths(np.array([[1, 0], [0, 0]], bool)) == [0, 1, 3]
