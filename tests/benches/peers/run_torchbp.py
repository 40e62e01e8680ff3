"""One measurement of torchbp on the files of a case, by what it publishes: python run_torchbp.py FOLDER METHOD CASE BENCH.

FOLDER is as tests/src/bin/bench/recording.rs has it. Prints what tests/src/bin/bench/measure.rs prints, as JSON.

torchbp takes range profiles, oversampled twofold here, whose making is told apart and not counted. Its frame: x away from the track, y along
it; for polar grids the aperture's middle is above the origin, for others the scene's middle is the origin, where float32 is finest. Images on polar grids have as many pixels, as far apart, over the same scene, and are judged at their
own pixels, by the same float64 sum (BENCH sum). What it does is divided by the sum of weights alone.
"""

import json
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

LIGHT_M_S = 299_792_458.0
OVERSAMPLING = 2
ENOUGH_S = 1.0
MOST_TURNS = 5
JUDGED = 256


def profiles(folder, about, antennas, first_m, bin_m):
    """Range profiles with the carrier of the middle frequency taken off, their first bin at `first_m`."""
    samples = np.load(folder / "samples.npy", mmap_mode="r")
    fast = np.load(folder / "weights-fast.npy")
    slow = np.load(folder / "weights-slow.npy")
    pulses, count = samples.shape
    length = OVERSAMPLING * count
    steps = np.arange(count) - count // 2
    centre_hz = about["start_hz"] + count // 2 * about["step_hz"]
    paths_m = 2 * np.linalg.norm(antennas, axis=1)
    made = np.empty((pulses, length), np.complex64)
    for first in range(0, pulses, 256):
        run = slice(first, min(first + 256, pulses))
        delays_s = (2 * first_m - paths_m[run, None]) / LIGHT_M_S
        cycles = steps * about["step_hz"] * delays_s - centre_hz * paths_m[run, None] / LIGHT_M_S
        turned = samples[run] * fast * slow[run, None] * np.exp(2j * np.pi * (cycles - np.round(cycles)))
        spectrum = np.zeros((turned.shape[0], length), np.complex128)
        spectrum[:, steps % length] = turned
        made[run] = np.fft.ifft(spectrum, axis=1) * length
    return torch.from_numpy(made), centre_hz, fast.sum() * slow.sum()


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


def within_scene(points_m, half_m):
    return np.all(np.abs(points_m) < half_m, axis=-1)


def polar_judged(grid, half_m, origin_m, within, case, bench, keep):
    """Some pixels of a polar grid of those within the scene: row, column, what it should be, how many it stands for."""
    if not keep.is_file():
        random = np.random.default_rng(1)
        picked = random.choice(np.flatnonzero(within), size=JUDGED, replace=False)
        rows, columns = np.unravel_index(picked, within.shape)
        with tempfile.TemporaryDirectory() as made:
            there, values = Path(made, "points.npy"), Path(made, "values.npy")
            np.save(there, polar_points(grid, origin_m, rows, columns))
            subprocess.run([bench, "sum", case, there, values], check=True)
            sums = np.load(values)
        stands_for = np.full(JUDGED, np.count_nonzero(within) / JUDGED)
        lines = np.column_stack([rows, columns, sums, stands_for])
        new = keep.with_name(f"{keep.stem}-{os.getpid()}.npy")
        np.save(new, lines)
        new.replace(keep)
    return np.load(keep)


def peak_bytes():
    for line in Path("/proc/self/status").read_text().splitlines():
        if line.startswith("VmHWM:"):
            return 1024 * int(line.split()[1])
    return 0


def main():
    folder, method, case, bench = Path(sys.argv[1]), *sys.argv[2:5]
    torch.set_num_threads(int(os.environ.get("OMP_NUM_THREADS", "1")))
    about = json.loads((folder / "case.json").read_text())
    antennas = np.load(folder / "antennas.npy")
    side, pixel_m = about["side"], about["pixel_m"]
    half_m = side * pixel_m / 2
    origin_m = antennas.mean(axis=0)
    away_m = -origin_m[1]
    count = np.load(folder / "weights-fast.npy").size
    swath_m = LIGHT_M_S / (2 * about["step_hz"])
    first_m = np.linalg.norm(origin_m) - swath_m / 2
    bin_m = swath_m / (OVERSAMPLING * count)

    begun = time.perf_counter()
    data, centre_hz, scale = profiles(folder, about, antennas, first_m, bin_m)
    compression_s = time.perf_counter() - begun
    square = {"x": (-half_m, half_m), "y": (-half_m, half_m), "nx": side, "ny": side}
    polar = polar_grid(away_m, half_m, side)
    ops = torchbp.ops
    on_polar = method in ("polar", "ffbp", "afbp")
    moved = antennas[:, [1, 0, 2]]
    if on_polar:
        moved = moved - [origin_m[1], origin_m[0], 0]
    positions = torch.from_numpy(moved.astype(np.float32))
    start = (data, polar if on_polar else square, centre_hz, bin_m, positions)
    # The best settings found for cases a and b: with fewer stages they are slower, with more no faster; wide guards against 15 dB.
    sub_apertures = 32 if len(antennas) > 2000 else 16
    ways = {
        "cartesian": lambda: ops.backprojection_cart_2d(*start, d0=-first_m),
        "polar": lambda: ops.backprojection_polar_2d(*start, d0=-first_m),
        "ffbp": lambda: ops.ffbp(*start, stages=4, d0=-first_m, alias_fmod=0, guard_max_ratio=0.5),
        "cfbp": lambda: ops.cfbp(*start, stages=4, d0=-first_m),
        "afbp": lambda: ops.afbp(*start, nsub=sub_apertures, d0=-first_m),
    }
    shortest, processor_s, turns, begun = math.inf, 0, 0, time.perf_counter()
    with torch.no_grad():
        while turns < MOST_TURNS and (turns == 0 or time.perf_counter() - begun < ENOUGH_S):
            started, before_s = time.perf_counter(), time.process_time()
            image = ways[method]()
            took_s = time.perf_counter() - started
            if took_s < shortest:
                shortest, processor_s = took_s, time.process_time() - before_s
            turns += 1
    peak = peak_bytes()
    image = image.reshape(side, side).numpy().astype(np.complex128) / scale

    power = np.sum(np.abs(image) ** 2)
    if on_polar:
        keep = folder / "torchbp-polar.npy"
        every = np.meshgrid(np.arange(side), np.arange(side), indexing="ij")
        within = within_scene(polar_points(polar, origin_m, *every), half_m)
        power = np.sum(np.abs(image[within]) ** 2)
        judged = polar_judged(polar, half_m, origin_m, within, case, bench, keep)
    else:
        judged = np.load(folder / f"judged-{side}.npy")
    rows, columns = judged[:, :2].astype(int).T
    expected = judged[:, 2] + 1j * judged[:, 3]
    stands_for = judged[:, 4]
    got = image[rows, columns]
    error = np.sum(stands_for * np.abs(got - expected) ** 2)
    best = np.sum(stands_for * got.conj() * expected) / np.sum(stands_for * np.abs(got) ** 2)
    left = np.sum(stands_for * np.abs(best * got - expected) ** 2)
    print(
        json.dumps(
            {
                "seconds": shortest,
                "processor_s": processor_s,
                "turns": turns,
                "pairs": side * side * len(antennas),
                "error_db": 10 * math.log10(error / power),
                "scaled_db": 10 * math.log10(left / power),
                "peak_bytes": peak,
                "operations": 0,
                "least_bytes": 0,
                "note": f"range profiles apart: {compression_s:.2f} s in NumPy",
            }
        )
    )


main()
