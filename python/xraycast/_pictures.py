"""Grey values of pictures, and where points are in them."""
import numpy as np

AIR_TAU = 0.5  # beside the body


def grey_range(tau):
    """The optical depths that are white and black: the range that the body has, without metal in it."""
    body = tau[tau > AIR_TAU]
    body = body[body <= metal_from(body)]
    return np.percentile(body, (1, 99.8)) if body.size else (0.0, 1.0)


def metal_from(depths):
    """The optical depth beyond which pixels show metal, infinite without any: as host/xraycast/base/metal_depth.hpp finds it."""
    bins, per_depth, rise = 1024, 20, 30
    counts = np.bincount(np.clip(depths * per_depth, 0, bins - 1).astype(int).ravel(), minlength=bins)
    above = np.append(np.cumsum(counts[::-1])[::-1], np.zeros(rise, int))
    here, higher = above[:bins], above[rise:rise + bins]
    is_rise = (here <= 0.25 * above[0]) & (higher > 0.001 * above[0]) & (higher > 0.45 * here)
    if not is_rise.any():
        return np.inf
    rise = np.argmax(np.where(is_rise, higher / np.maximum(here, 1), 0))
    return np.argmax(above <= above[rise] / 0.5) / per_depth  # `above` never rises


def greys(tau, limits):
    """uint8 that falls with the optical depth, as fluoroscopes show it."""
    low, high = limits
    return np.round(255 * np.clip((high - tau) / max(high - low, 1e-6), 0, 1)).astype(np.uint8)


def project_points(points_mm, K, RT):
    """(points, 3): column, row, depth in mm."""
    camera = points_mm @ RT[:, :3].T + RT[:, 3]
    pixels = camera @ K.T
    return np.column_stack([pixels[:, :2] / pixels[:, 2:], camera[:, 2]])
