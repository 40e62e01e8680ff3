"""Checks points of maps of a strip with GDAL (rasterio). Usage: strip_check.py POINTS GHOST EXPECTED

POINTS and GHOST are GeoTIFFs of amplitudes. EXPECTED is JSON:

- points_ecf_m: positions of points on the ground, Earth-centred Earth-fixed, and pixel_m, the spacing of the image's pixels; each has to be within a tenth of it
  of a local maximum;
- target_ecf_m, ghost_ecf_m: a point and its azimuth ambiguity, the largest amplitude within 100 m of which has to be 35 dB lower.

Nothing of Subaperture is called. Positions are projected by PROJ.
"""

import json
import math
import sys

try:
    import numpy as np
    import pyproj
    import rasterio
except ImportError as error:
    sys.exit(f"{error}; install it with: python3 -m pip install rio-cogeo")

EXPECTED = json.load(open(sys.argv[3], encoding="utf-8"))
FAULTS = 0


class Map:
    """Amplitudes and their positions."""

    def __init__(self, path):
        with rasterio.open(path) as dataset:
            self.levels = dataset.read(1).astype(float)
            self.project = pyproj.Transformer.from_crs("EPSG:4978", dataset.crs, always_xy=True)
            self.inverse = ~dataset.transform
            self.step_m = abs(dataset.transform.a)

    def place(self, ecf_m):
        """Column and row of a position; whole numbers are the middles of pixels."""
        x, y, *_ = self.project.transform(*ecf_m)
        column, row = self.inverse * (x, y)
        return column - 0.5, row - 0.5

    def around(self, ecf_m, half_m):
        """Amplitudes within `half_m` of a position, and the column and row of the first."""
        column, row = (round(value) for value in self.place(ecf_m))
        half = math.ceil(half_m / self.step_m)
        inside = half <= column < self.levels.shape[1] - half and half <= row < self.levels.shape[0] - half
        assert inside, f"{ecf_m} lies outside the map"
        part = self.levels[row - half : row + half + 1, column - half : column + half + 1]
        return part, column - half, row - half


def peak(part):
    """Column and row of the maximum of a paraboloid through the largest value and its neighbours."""
    row, column = np.unravel_index(np.argmax(part[1:-1, 1:-1]), part[1:-1, 1:-1].shape)
    (nw, n, ne), (w, c, e), (sw, s, se) = np.log(part[row : row + 3, column : column + 3])
    gx, gy = (e - w) / 2, (s - n) / 2
    xx, yy, xy = e - 2 * c + w, s - 2 * c + n, (se - sw - ne + nw) / 4
    det = xx * yy - xy * xy
    return column + 1 + (xy * gy - yy * gx) / det, row + 1 + (xy * gx - xx * gy) / det


POINTS, GHOST = (Map(path) for path in sys.argv[1:3])
for point in EXPECTED["points_ecf_m"]:
    part, first_column, first_row = POINTS.around(point, 30)
    x, y = peak(part)
    column, row = POINTS.place(point)
    off_m = math.hypot(first_column + x - column, first_row + y - row) * POINTS.step_m
    good = off_m < 0.1 * EXPECTED["pixel_m"]
    FAULTS += not good
    print("ok  " if good else "BAD ", f"point is {off_m:.3f} m off, {20 * math.log10(part.max()):.1f} dB")

target = POINTS.around(EXPECTED["target_ecf_m"], 30)[0].max()
ghost = GHOST.around(EXPECTED["ghost_ecf_m"], 100)[0].max()
level_db = 20 * math.log10(ghost / target)
good = level_db < -35
FAULTS += not good
print("ok  " if good else "BAD ", f"ghost is {level_db:.1f} dB")
sys.exit(1 if FAULTS else 0)
