"""One measurement of torchbp on the files of a case: python run_torchbp.py FOLDER METHOD CASE BENCH.

METHOD is a function of `torchbp.ops` in short (`FUNCTIONS`) with its keyword arguments, and `oversampling` of the range profiles, 2 unless
given. The time excludes the range profiles, which torchbp takes as input. Frame: x away from the track, y along it. The origin of polar
grids is below the aperture's middle; that of Cartesian grids is the scene's middle, where float32 is finest. Images on polar grids have as
many pixels, as far apart, over the same scene; they are judged at pixels of their own, by the same float64 sum (BENCH sum).
"""

import math
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import torch
import torchbp

from peer import LIGHT_M_S, THREADS, Case, method_and_settings, report, shortest

JUDGED = 256

FUNCTIONS = {
    "cartesian": torchbp.ops.backprojection_cart_2d,
    "polar": torchbp.ops.backprojection_polar_2d,
    "ffbp": torchbp.ops.ffbp,
    "cfbp": torchbp.ops.cfbp,
    "afbp": torchbp.ops.afbp,
}
ON_POLAR = ("polar", "ffbp", "afbp")


def profiles(case, first_m, length):
    """Range profiles of `length` bins without the carrier of the middle frequency, their first bin at `first_m`; that frequency."""
    pulses, count = case.samples.shape
    steps = np.arange(count) - count // 2
    centre_hz = case.start_hz + count // 2 * case.step_hz
    paths_m = 2 * np.linalg.norm(case.antennas, axis=1)
    made = np.empty((pulses, length), np.complex64)
    for first in range(0, pulses, 256):
        run = slice(first, min(first + 256, pulses))
        delays_s = (2 * first_m - paths_m[run, None]) / LIGHT_M_S
        cycles = steps * case.step_hz * delays_s - centre_hz * paths_m[run, None] / LIGHT_M_S
        turned = case.samples[run] * case.fast * case.slow[run, None] * np.exp(2j * np.pi * (cycles - np.round(cycles)))
        spectrum = np.zeros((turned.shape[0], length), np.complex128)
        spectrum[:, steps % length] = turned
        made[run] = np.fft.ifft(spectrum, axis=1) * length
    return torch.from_numpy(made), centre_hz


def polar_grid(away_m, half_m, side):
    """Over a square of half side `half_m`, `away_m` away: ranges on the ground and sines of angles."""
    near_m, far_m = away_m - half_m, math.hypot(away_m + half_m, half_m)
    sine = half_m / math.hypot(near_m, half_m)
    return {"r": (near_m, far_m), "theta": (-sine, sine), "nr": side, "ntheta": side}


def polar_points(grid, origin_m, rows, columns):
    """Pixels of a polar grid in the case's frame, whose x is along the track."""
    (r_0, r_1), (t_0, t_1) = grid["r"], grid["theta"]
    ranges = r_0 + (r_1 - r_0) / grid["nr"] * rows
    sines = t_0 + (t_1 - t_0) / grid["ntheta"] * columns
    return np.stack([ranges * sines + origin_m[0], ranges * np.sqrt(1 - sines**2) + origin_m[1], 0 * ranges], axis=-1)


def polar_within(grid, half_m, origin_m):
    """Whether pixels of a polar grid lie in the scene."""
    columns = np.arange(grid["ntheta"])
    lines = (polar_points(grid, origin_m, np.full_like(columns, row), columns) for row in range(grid["nr"]))
    return np.array([np.all(np.abs(points_m) < half_m, axis=-1) for points_m in lines])


def polar_judged(grid, origin_m, within, name, bench, keep):
    """Some pixels of a polar grid in the scene: row, column, value by the float64 sum, number of pixels that it represents."""
    if not keep.is_file():
        random = np.random.default_rng(1)
        picked = random.choice(np.flatnonzero(within), size=JUDGED, replace=False)
        rows, columns = np.unravel_index(picked, within.shape)
        with tempfile.TemporaryDirectory() as made:
            points, values = Path(made, "points.npy"), Path(made, "values.npy")
            np.save(points, polar_points(grid, origin_m, rows, columns))
            subprocess.run([bench, "sum", name, points, values], check=True)
            sums = np.load(values)
        stands_for = np.full(JUDGED, np.count_nonzero(within) / JUDGED)
        lines = np.column_stack([rows, columns, sums, stands_for])
        new = keep.with_name(f"{keep.stem}-{os.getpid()}.npy")
        np.save(new, lines)
        new.replace(keep)
    return np.load(keep)


def main():
    case = Case(sys.argv[1])
    name, bench = sys.argv[3:5]
    method, settings = method_and_settings(sys.argv[2])
    torch.set_num_threads(THREADS)
    side, half_m = case.side, case.half_m
    origin_m = case.antennas.mean(axis=0)
    count = case.fast.size
    length = settings.pop("oversampling", 2) * count
    swath_m = LIGHT_M_S / (2 * case.step_hz)
    first_m = np.linalg.norm(origin_m) - swath_m / 2

    begun = time.perf_counter()
    data, centre_hz = profiles(case, first_m, length)
    compression_s = time.perf_counter() - begun
    moved = case.antennas[:, [1, 0, 2]]
    grid = {"x": (-half_m, half_m), "y": (-half_m, half_m), "nx": side, "ny": side}
    if method in ON_POLAR:
        moved = moved - [origin_m[1], origin_m[0], 0]
        grid = polar_grid(-origin_m[1], half_m, side)
    positions = torch.from_numpy(moved.astype(np.float32))
    with torch.no_grad():
        image, times = shortest(
            lambda: FUNCTIONS[method](data, grid, centre_hz, swath_m / length, positions, d0=-first_m, **settings)
        )
    image = image.reshape(side, side).numpy() / np.float32(case.scale)

    scene, judged = image, None
    if method in ON_POLAR:
        within = polar_within(grid, half_m, origin_m)
        scene = image[within]
        judged = polar_judged(grid, origin_m, within, name, bench, case.folder / "torchbp-polar.npy")
    power = np.sum(np.abs(scene) ** 2, dtype=np.float64)
    note = f"range profiles apart: {compression_s:.2f} s in NumPy"
    report(case, image, times, case.judged() if judged is None else judged, power, note)


main()
