"""Catheters in pictures, and their grey values."""
import numpy as np

CATHETER_RADIUS_MM, CATHETER_PER_MM = 0.83, 0.15  # 5 F; the walls are made to be seen
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


def catheter_thickness(nodes_mm, K, RT, shape):
    """The length of each pixel's ray in the catheter, mm, as if it were straight across; its ends are round. Narrower than
    pixels, it is drawn wider and as much thinner."""
    thickness = np.zeros(shape, np.float32)
    nodes = project_points(nodes_mm, K, RT)
    for start, end in zip(nodes[:-1], nodes[1:]):
        mm_per_pixel = (start[2] + end[2]) / 2 / abs(K[0, 0])  # negative where K mirrors
        radius_mm = max(CATHETER_RADIUS_MM, mm_per_pixel)
        reach = radius_mm / mm_per_pixel + 1
        left, top = np.maximum(np.floor(np.minimum(start, end)[:2] - reach), 0).astype(int)
        right, bottom = np.minimum(np.ceil(np.maximum(start, end)[:2] + reach) + 1, shape[::-1]).astype(int)
        if left >= right or top >= bottom:
            continue
        y, x = np.mgrid[top:bottom, left:right]
        along = end[:2] - start[:2]
        share = np.clip(((x - start[0]) * along[0] + (y - start[1]) * along[1]) / max(along @ along, 1e-9), 0, 1)
        distance = np.hypot(x - start[0] - share * along[0], y - start[1] - share * along[1]) * mm_per_pixel
        chord = 2 * np.sqrt(np.maximum(radius_mm**2 - distance**2, 0)) * (CATHETER_RADIUS_MM / radius_mm) ** 2
        window = thickness[top:bottom, left:right]
        np.maximum(window, chord, out=window)
    return thickness
