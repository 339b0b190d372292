"""Calls that make no sense end in one line that says so, and never the process."""
import gc
import inspect
import pickle
import threading
import weakref

import numpy as np
import pytest
import xraycast as xc

nan, inf = float("nan"), float("inf")


@pytest.fixture(scope="module")
def names(tmp_path_factory):
    """What the calls below speak of."""
    box = xc.phantom("box", spacing_mm=8)
    tree = xc.VesselTree([([(0, 0, z, 5) for z in range(0, 301, 5)], -1)])
    recursive = []
    recursive.append(recursive)
    return {
        "np": np, "xc": xc, "nan": nan, "inf": inf, "pickle": pickle, "box": box, "tree": tree, "recursive": recursive,
        "hu": np.zeros((5, 6, 7), np.int16), "S": xc.Scan.from_array, "map_": box.cast(layers=2), "frame": box.project(size=(8, 8)),
        "frames": box.project(lao=[1, 2], size=(8, 8)), "run": xc.Catheter(tree, "cobra-5f"),
        "pair": xc.CoaxialInstruments(tree, ["cobra-5f", "guidewire-035-j"]), "folder": tmp_path_factory.mktemp("misuse"),
        "line": [(0, 0, z) for z in range(4)], "Empty": type("Empty", (xc.VesselTree,), {"__init__": lambda self: None}),
    }


CALLS = {
    "arrays": """S(None, (1, 1, 1))
S("abc", (1, 1, 1))
S(hu.astype(float), (1, 1, 1))
S(hu.astype(complex), (1, 1, 1))
S(hu.astype(bool), (1, 1, 1))
S(np.full((5, 6, 7), nan), (1, 1, 1))
S(np.array([[[object()]]]), (1, 1, 1))
S([[[1], [2, 3]]], (1, 1, 1))
S(hu[0], (1, 1, 1))
S(hu[None], (1, 1, 1))
S(hu[:0], (1, 1, 1))
S(hu, (0, 1, 1))
S(hu, (-1, 1, 1))
S(hu, (nan, 1, 1))
S(hu, (inf, 1, 1))
S(hu, (1e300, 1, 1))
S(hu, (1e-300, 1, 1))
S(hu, (1, 1))
S(hu, "abc")
S(hu, None)
S(hu, (1, 1, 1), (nan, 0, 0))
S(hu, (1, 1, 1), (1e308, 0, 0))
S(hu, (1, 1, 1), direction=np.zeros((3, 3)))
S(hu, (1, 1, 1), direction=np.full((3, 3), nan))""",
    "poses": """box.project(lao=nan)
box.project(lao=inf)
box.project(lao=[])
box.project(lao=[[1, 2]])
box.project(lao="x")
box.project(lao={})
box.project(lao={1})
box.project(lao=recursive)
box.project(lao=[1, 2], cranial=[1, 2, 3])
box.project(lao=np.zeros(10**6 + 1))
box.project(lao=[1, 2] * 10**5, size=(16384, 16384))
box.project(size=(0, 0))
box.project(size=(-1, 5))
box.project(size=(10**30, 10))
box.project(size=(nan, 10))
box.project(size=(10.5, 10))
box.project(size=(1, 2, 3))
box.project(cone_mm=(0, 0))
box.project(cone_mm=(nan, 1))
box.project(cone_mm=(1500, 1000))
box.project(pixel_mm=0)
box.project(pixel_mm=nan)
box.project(centre_mm=(nan, 0, 0))
box.project(K=np.eye(3))
box.project(K=np.full((3, 3), nan), RT=np.eye(4), size=(8, 8))
box.project(K=np.zeros((3, 3)), RT=np.eye(4), size=(8, 8))
box.project(K=np.eye(3), RT=np.zeros((3, 4)), size=(8, 8))
box.project(lao=10**30, K=np.eye(3), RT=np.eye(4), size=(8, 8))
map_.render(lao=nan)
map_.render(size=(10**6, 10**6))
frames[5]
frames[-9]
frames[2**70]""",
    "scenes": """box.project(opacity=None)
box.project(opacity="\\0")
box.project(vessels=box)
box.project(vessels=Empty())
box.project(vessels=tree, contrast_mg_ml=nan)
box.project(vessels=tree, contrast_mg_ml=-1)
box.project(instruments=[1, 2])
box.project(instruments=b"abc")
box.project(instruments=recursive)
box.project(instruments=xc.InstrumentShape(line, 1e9))
box.project(fluoroscope=3)
map_.render(look="x")
xc.InstrumentShape([(nan, 0, 0)] * 4, 1)
xc.InstrumentShape(line[:3], 1)
xc.InstrumentShape(line, nan)
xc.InstrumentShape(line, inf)""",
    "casts": """box.cast(progress=3)
box.cast(progress=int)
box.cast(radius_mm=nan)
box.cast(radii=[nan, 1])
box.cast(radii=[])
box.cast(radii=list(range(10**6)))
box.cast(angles=2**31 - 1)
box.cast(knots_hu=[nan])
box.cast(knots_hu=list(range(1000)))
box.cast(memory_limit_B=0)
box.cast(memory_limit_B=-1)
box.cast(centre_mm=[1])
box.cast(centre_mm=[inf, 1])
box.cast_basis().recast(None)
xc.Opacity([(nan, 0), (1, 1)])
xc.Opacity([(0, -1), (1, 1)])
xc.Opacity([(i, 1) for i in range(1000)])
xc.Opacity([(1, 0), (0, 1)])""",
    "phantoms": """xc.phantom("box", size=(10**6, 10**6, 10**6))
xc.phantom("box", size=(-1, 1, 1))
xc.phantom("box", size=(2**62, 4, 4))
xc.phantom("box", spacing_mm=nan)
xc.phantom("box", spacing_mm=0)
xc.phantom("box", spacing_mm=1e-9)
xc.phantom("box", noise_hu=nan)
xc.phantom("box", seed=2**70)
xc.phantom("bo\\0x")""",
    "files": """xc.open(None)
xc.open(0)
xc.open("a\\0b")
xc.open(b"/none\\xff")
xc.open(["a"])
xc.open(folder)
xc.open("/dev/null")
xc.open("x", offset_hu=nan)
box.write(None)
box.write("/")
box.write(folder / "x")
box.write("/tmp/\\0.nrrd")
frame.write("/nonexistent/x.png")
frame.write(folder / "x.png", gamma=nan)
frame.write(folder / "x.png", gamma=0)
xc.BodyMap.read("/dev/null")
xc.Basis.read("/dev/null")""",
    "trees": """tree[7]
xc.VesselTree(None)
xc.VesselTree([])
xc.VesselTree("abc")
xc.VesselTree(["ab"])
xc.VesselTree(recursive)
xc.VesselTree([([(nan, 0, 0, 1), (0, 0, 1, 1)], -1)])
xc.VesselTree([([(0, 0, 0, -1), (0, 0, 1, 1)], -1)])
xc.VesselTree([([(0, 0, 0, 1), (0, 0, 1, 1)], 1), ([(0, 0, 1, 1), (0, 0, 0, 1)], 0)])
xc.VesselTree([([(0, 0, 0, 1), (0, 0, 1, 1)], 0)])
xc.VesselTree([([(0, 0, 0, 1), (0, 0, 1, 1)], 99)])
xc.VesselTree([([(0, 0, 0, 1), (0, 0, 1, 1)], 2**40)])
xc.VesselTree([([(0, 0, 0, 1), (0, 0, 0, 1)], -1)])
xc.VesselTree([([(1e300, 0, 0, 1), (-1e300, 0, 1, 1)], -1)])
len(Empty())""",
    "instruments": """run.step(push_mm=nan)
run.step(turn_deg=inf)
run.step(ms=0)
run.step(ms=-1)
run.step(ms=2**40)
xc.Catheter(tree, None)
xc.Catheter(tree, "a\\0")
xc.Catheter(tree, "cobra-5f", entry=(nan, 0, 0))
xc.Catheter(tree, "cobra-5f", entry=99)
xc.Catheter(tree, "cobra-5f", entry=-1)
xc.Catheter(tree, "cobra-5f", entry="x")
xc.Catheter(Empty(), "cobra-5f")
xc.CoaxialInstruments(tree, [])
xc.CoaxialInstruments(tree, ["cobra-5f"] * 9)
pair.step(push_mm=[1, 2, 3])
pair.step(push_mm=[nan, 0])
pair.nodes_mm(7)
pair.nodes_mm(-1)
pair.exchange(9, "cobra-5f")""",
    "fluoroscopes": """xc.Fluoroscope(mas=nan)
xc.Fluoroscope(kvp=10**9)
xc.Fluoroscope(pulse_rate=nan)
xc.Fluoroscope(collimate=(nan, 1))
xc.Fluoroscope(collimate=(1, 1, 1, 1))
xc.Fluoroscope(stages=[1, 2])
xc.Fluoroscope(photons=inf)
xc.Fluoroscope(c_arm=3)
xc.Fluoroscope(c_arm="neuro-biplane", field_mm=nan)""",
    "segmentations": """box.segment([(nan, 0, 0)])
box.segment([1, 2])
box.segment([(0, 0, 0)], window_hu=(nan, 1))
box.segment([(0, 0, 0)], window_hu=(5, 1))
box.segment(from_mask=np.zeros((1, 1, 1)))
box.segment(from_mask=np.zeros(box.hu.shape, bool))
box.segment([(0, 0, 0)], triangles=-1)
box.segment([(0, 0, 0)], root_mm=(nan, 0, 0))
box.segment([(0, 0, 0)], explain=3)""",
    "objects": """xc.Scan()
xc.Scan.__new__(xc.Scan).project()
xc.BodyMap.__new__(xc.BodyMap).render()
xc.Catheter.__new__(xc.Catheter).step()
tree.__init__([([(0, 0, 0, 1), (0, 0, 1, 1)], -1)])
run.__init__(tree, "cobra-5f")
xc.BodyMap.render(box)
pickle.dumps(frame)
pickle.dumps(run)
pickle.dumps(xc.Fluoroscope())""",
}


@pytest.mark.filterwarnings("ignore::RuntimeWarning")  # nanobind's, of an object that was not made
@pytest.mark.parametrize("call", [call for calls in CALLS.values() for call in calls.splitlines()])
def test_is_refused_in_one_line(names, call):
    with pytest.raises((xc.Error, TypeError, IndexError)) as error:
        eval(call, names)
    assert str(error.value) and "\n" not in str(error.value) and "incompatible" not in str(error.value)


def test_arrays_of_other_layouts_are_copied():
    hu = np.arange(5 * 6 * 7, dtype=np.int16).reshape(5, 6, 7)
    for array in (hu[::-1], hu.astype(">i2"), np.asfortranarray(hu), hu[:, ::2, ::-3], np.ma.masked_array(hu, hu == 0)):
        assert np.array_equal(xc.Scan.from_array(array, (1, 1, 1)).hu, np.asarray(array))


def test_what_frames_share_lives_as_long_as_they_do(names):
    class Holder:
        pass

    holder = Holder()
    holder.itself, holder.frame, holder.run = holder, names["box"].project(size=(8, 8)), xc.Catheter(names["tree"], "cobra-5f")
    tau, told = holder.frame.tau, weakref.ref(holder)
    expected = tau.copy()
    del holder
    gc.collect()
    assert told() is None and np.array_equal(tau, expected)


def test_threads_share_every_object(names):
    box, map_, run, pair = names["box"], names["map_"], names["run"], names["pair"]
    calls = [lambda: run.step(push_mm=0.1, ms=5), lambda: run.step(turn_deg=1, ms=5), lambda: run.nodes_mm, lambda: run.shape,
             lambda: map_.render(instruments=run, size=(32, 32)), lambda: box.project(instruments=run, size=(32, 32)), lambda: pickle.dumps(map_),
             lambda: pair.step(ms=3), lambda: pair.exchange(1, "guidewire-035-j"), lambda: pair.shapes, lambda: pair.has_free_lumen(0)]
    failures = []

    def repeat(call):
        try:
            for _ in range(10):
                call()
        except Exception as error:
            failures.append(f"{inspect.getsource(call)}: {error!r}")

    threads = [threading.Thread(target=repeat, args=(call,)) for call in calls]
    [thread.start() for thread in threads]
    [thread.join() for thread in threads]
    assert failures == []


def test_a_listener_may_call():
    told = []
    xc.phantom("box", spacing_mm=8, progress=lambda fraction, stage: told.append(xc.phantom("sphere", spacing_mm=16)))
    assert told
