"""Grey values of pictures, and where points are in them."""
import numpy as np

AIR_TAU = 0.5  # beside the body


def grey_range(tau):
    """The optical depths that are white and black: the range that the body has."""
    body = tau[tau > AIR_TAU]
    return np.percentile(body, (1, 99.8)) if body.size else (0.0, 1.0)


def greys(tau, limits):
    """uint8 that falls with the optical depth, as fluoroscopes show it."""
    low, high = limits
    return np.round(255 * np.clip((high - tau) / max(high - low, 1e-6), 0, 1)).astype(np.uint8)


def project_points(points_mm, K, RT):
    """(points, 3): column, row, depth in mm."""
    camera = points_mm @ RT[:, :3].T + RT[:, 3]
    pixels = camera @ K.T
    return np.column_stack([pixels[:, :2] / pixels[:, 2:], camera[:, 2]])
