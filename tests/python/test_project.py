"""Pictures of a scan: closed forms, matrices, and lists of poses."""
import numpy as np
import pytest
import xraycast as xc

WATER = xc.Opacity([(-1000, 0), (0, 0.02)])  # mu of water 0.02/mm, of air 0


def look_at(source, target):
    """RT of a camera at `source` that looks at `target`, with z of the patient upwards in the picture."""
    forward = np.subtract(target, source) / np.linalg.norm(np.subtract(target, source))
    right = np.cross(forward, (0, 0, 1.0))
    right /= np.linalg.norm(right)
    rotation = np.stack([right, np.cross(forward, right), forward])
    return np.column_stack([rotation, -rotation @ source])


def camera(size, focal):
    return np.array([[focal, 0, (size[0] - 1) / 2], [0, focal, (size[1] - 1) / 2], [0, 0, 1]])


def test_a_parallel_ray_crosses_the_box(box):
    frame = box.project(opacity=WATER, size=(41, 41), pixel_mm=1, centre_mm=(0, 0, 0))
    # 120 mm of water; a float32 sum of some hundred samples.
    assert np.asarray(frame)[20, 20] == pytest.approx(0.02 * 120, rel=1e-5)
    assert frame.transmission[20, 20] == pytest.approx(np.exp(-2.4), rel=1e-4)
    assert box.project(lao=90, opacity=WATER, size=(41, 41), pixel_mm=1).tau[20, 20] == pytest.approx(3.2, rel=1e-5)


def test_matrices_cross_the_box(box):
    size = (65, 49)
    frame = box.project(K=camera(size, 1000), RT=look_at((0, 900, 0), (0, 0, 0)), size=size, opacity=WATER)
    # A ray through pixel (i, j) is longer than the middle one by 1 / cos of its angle.
    j, i = np.mgrid[:49, :65]
    stretch = np.sqrt(1 + ((i - 32) / 1000) ** 2 + ((j - 24) / 1000) ** 2)
    np.testing.assert_allclose(np.asarray(frame), 2.4 * stretch, rtol=2e-5)


@pytest.mark.parametrize("lao, cranial", [(0, 0), (30, 0), (-75, 0), (30, 10), (200, -35), (90, 20)])
def test_matrices_of_a_cone_show_the_same_picture(body, lao, cranial):
    cone = body.project(lao, cranial, (160, 120), (1000, 1500))
    by_matrices = body.project(K=cone.K, RT=cone.RT, size=(160, 120))
    # Both ends of the rays are rounded to 32 bits in voxels; a ray moves by 1e-4 of one.
    assert np.abs(cone.tau - by_matrices.tau).max() < 1e-5 * cone.tau.max()
    assert np.allclose(by_matrices.K, cone.K) and np.allclose(by_matrices.RT, cone.RT)


def test_matrices_that_are_mirrored_or_rolled_show_that(body):
    cone = body.project(20, 0, (81, 61), (1000, 1500))
    upside_down = np.diag([-1.0, -1.0, 1.0]) @ cone.RT
    rolled = body.project(K=cone.K, RT=upside_down, size=(81, 61))
    assert np.abs(rolled.tau - cone.tau[::-1, ::-1]).max() < 1e-5 * cone.tau.max()
    mirrored = body.project(K=cone.K, RT=np.diag([-1.0, 1.0, 1.0]) @ cone.RT, size=(81, 61))
    assert np.abs(mirrored.tau - cone.tau[:, ::-1]).max() < 1e-5 * cone.tau.max()
    on_its_side = np.array([[0, 1.0, 0], [-1, 0, 0], [0, 0, 1]])
    k = np.array(cone.K)
    k[0, 0], k[0, 2], k[1, 2] = k[1, 1], 30, 40
    turned = body.project(K=k, RT=on_its_side @ cone.RT, size=(61, 81))
    # x of the camera runs down the picture, and y against its columns, as in a cone's, whose K mirrors x.
    expected = cone.tau.T[::-1][::-1, :]
    assert np.abs(turned.tau - expected).max() < 1e-4 * cone.tau.max()


def test_a_4_by_4_matrix_is_the_same(body):
    cone = body.project(20, 5, (40, 30), (1000, 1500))
    rt = np.vstack([cone.RT, [0, 0, 0, 1]])
    assert np.array_equal(body.project(K=cone.K, RT=rt, size=(40, 30)).tau,
                          body.project(K=cone.K, RT=cone.RT, size=(40, 30)).tau)


def test_lists_of_poses_are_the_single_pictures(body):
    cones = [body.project(lao, 5, (64, 48), (1000, 1500)) for lao in (0, 30, 60)]
    angles = body.project([0, 30, 60], 5, (64, 48), (1000, 1500), pixel_mm=cones[0].pixel_mm)
    assert np.asarray(angles).shape == (3, 48, 64) and len(angles) == 3
    assert np.array_equal(np.asarray(angles)[0], cones[0].tau) and np.array_equal(angles[0].tau, cones[0].tau)
    matrices = body.project(K=cones[0].K, RT=[cone.RT for cone in cones], size=(64, 48))
    one = body.project(K=cones[0].K, RT=cones[2].RT, size=(64, 48))
    assert np.array_equal(matrices[2].tau, one.tau) and np.array_equal(matrices[-1].tau, one.tau)
    with pytest.raises(IndexError):
        matrices[3]


def test_many_cameras_are_those_one_by_one(body):
    cones = [body.project(lao, 5, (900, 700), (1000, 1500)) for lao in (0, 30, 60, 90, 120)]  # more than are projected at once
    several = body.project(K=[cone.K for cone in cones], RT=[cone.RT for cone in cones], size=(900, 700), gradient=True)
    assert len(several) == 5 and several.gradient.shape == (5, 700, 900, 6)
    for found, cone in zip(several, cones):
        one = body.project(K=cone.K, RT=cone.RT, size=(900, 700), gradient=True)
        assert np.array_equal(found.tau, one.tau) and np.array_equal(found.gradient, one.gradient)


def test_a_call_twice_gives_the_same_picture(body):
    assert np.array_equal(body.project(lao=30).tau, body.project(lao=30).tau)


def test_a_spectrum_projects(body):
    hard, soft = body.project(opacity="spectrum:120"), body.project(opacity="spectrum:80")
    assert 0.5 < hard.tau.max() / soft.tau.max() < 1


RT = look_at((0, 900, 0), (0, 0, 0))
K = camera((20, 20), 100)


@pytest.mark.parametrize("arguments, words", [
    (dict(K=K), "RT"),
    (dict(RT=RT), "K"),
    (dict(K=K, RT=np.vstack([RT, [0, 0, 1, 0]]), size=(20, 20)), "last row"),
    (dict(K=K, RT=RT), "size"),
    (dict(K=np.diag([0, 0, 1.0]), RT=RT, size=(20, 20)), "focal length"),
    (dict(K=np.eye(2), RT=RT, size=(20, 20)), "K: must be a matrix of 3 x 3"),
    (dict(K=np.full((3, 3), np.nan), RT=RT, size=(20, 20)), "K: holds nan"),
    (dict(K=K, RT=np.zeros((3, 4)), size=(20, 20)), "rotation"),
    (dict(K=K, RT=np.eye(3), size=(20, 20)), "RT: must be a matrix of 3 x 4"),
    (dict(K=K, RT=look_at((0, 900, 0), (0, 1800, 0)), size=(20, 20)), "behind the camera"),
    (dict(K=[K, K], RT=[RT, RT, RT], size=(20, 20)), "lists of the same length"),
    (dict(K=K, RT=RT, size=(20, 20), lao=30), "leave out lao"),
    (dict(size=(0, 20)), "size"),
    (dict(size=20), "size"),
    (dict(lao="left"), "lao"),
    (dict(lao=[]), "lao"),
    (dict(lao=[0, 1], cranial=[0, 1, 2]), "lists of the same length"),
    (dict(cone_mm=(1500, 1000)), "cone"),
    (dict(cone_mm=1000), "cone_mm"),
    (dict(pixel_mm=-1), "pixel_mm"),
    (dict(opacity="lead"), "lead"),
    (dict(progress=3), "progress"),
])
def test_arguments_that_make_no_picture_are_rejected(body, arguments, words):
    with pytest.raises(xc.InputError) as error:
        body.project(**arguments)
    assert words in str(error.value) and "\n" not in str(error.value)


def test_frames_are_written(body, tmp_path):
    frame = body.project(lao=30, size=(64, 48))
    frame.write(tmp_path / "frame.exr")
    frame.write(tmp_path / "frame.png", inverted=True)
    assert (tmp_path / "frame.exr").stat().st_size > 64 * 48
    assert frame._repr_png_().startswith(b"\x89PNG")
    assert "LAO 30" in repr(frame) and frame.shape == (48, 64)
    with pytest.raises(xc.InputError, match="by K and RT"):
        body.project(K=K, RT=RT, size=(20, 20)).write(tmp_path / "frame.exr")


def motion(component, amount, centre):
    """4 x 4: a translation along an axis in mm, or a rotation in rad about it through `centre`."""
    matrix = np.eye(4)
    if component < 3:
        matrix[component, 3] = amount
        return matrix
    u, v = (component - 2) % 3, (component - 1) % 3  # from u towards v
    matrix[u, u] = matrix[v, v] = np.cos(amount)
    matrix[v, u], matrix[u, v] = np.sin(amount), -np.sin(amount)
    matrix[:3, 3] = centre - matrix[:3, :3] @ centre
    return matrix


def test_gradients_predict_the_next_picture(body):
    size, cone = (48, 36), (1000, 1500)
    before = body.project(20, 5, size, cone, gradient=True)
    assert before.gradient.shape == (36, 48, 6) and before.gradient.dtype == np.float32
    rt = np.vstack([before.RT, [0, 0, 0, 1]])
    for component in range(6):
        step = 0.05 if component < 3 else 5e-4  # mm, rad
        after = [body.project(K=before.K, RT=rt @ np.linalg.inv(motion(component, amount, body.centre_mm)), size=size)
                 for amount in (step, -step)]
        difference = (after[0].tau - after[1].tau) / (2 * step)
        # Voxels of 4 mm have edges, where differences over 0.1 mm see two slopes.
        error = difference - before.gradient[..., component]
        assert np.linalg.norm(error) < 0.05 * np.linalg.norm(difference)
    lists = body.project([20, 30], 5, size, cone, pixel_mm=before.pixel_mm, gradient=True)
    assert lists.gradient.shape == (2, 36, 48, 6)
    assert np.array_equal(lists[0].gradient, before.gradient) and np.array_equal(lists.gradient[1], lists[1].gradient)
    with pytest.raises(xc.InputError, match="gradient=True"):
        body.project().gradient
