import numpy as np
import pytest
import xraycast as xc


@pytest.fixture(scope="session")
def box():
    """Water of half sizes 80, 60 and 70 mm in air; voxels of 2 mm, centred at the origin."""
    return xc.phantom("box", spacing_mm=2)


@pytest.fixture(scope="session")
def body():
    """A trunk in voxels of 4 mm."""
    return xc.phantom("thorax", spacing_mm=4, noise_hu=0)


@pytest.fixture
def hu():
    """CT numbers without symmetry, (z, y, x)."""
    return np.random.default_rng(1).integers(-1000, 1000, (5, 6, 7), dtype=np.int16)


@pytest.fixture(scope="session")
def angiogram():
    """CT numbers of a tube of contrast agent in a body, in voxels of 1 mm, and where the tube is; both (z, y, x)."""
    _, y, x = np.mgrid[-40:40, -40:40, -40:40]
    tube = np.hypot(x - 12, y) < 5
    return np.where(tube, 350, np.where(np.hypot(x, y) < 36, 0, -1000)).astype(np.int16), tube
