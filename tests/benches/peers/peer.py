"""Shared by the measurements of other programs: method and settings, time, error and output, as in tests/src/bin/bench/measure.rs."""

import ast
import json
import math
import os
import time
from pathlib import Path

import numpy as np

LIGHT_M_S = 299_792_458.0
ENOUGH_S = 1.0
MOST_TURNS = 5

# Number of threads that the benchmark asks for.
THREADS = int(os.environ.get("OMP_NUM_THREADS", "1"))


def method_and_settings(text):
    """`afbp nsub=32` as a name and keyword arguments."""
    method, *settings = text.split()
    pairs = (setting.split("=", 1) for setting in settings)
    return method, {name: ast.literal_eval(value) for name, value in pairs}


class Case:
    """Files of a case, as in tests/src/bin/bench/recording.rs."""

    def __init__(self, folder):
        self.folder = folder = Path(folder)
        about = json.loads((folder / "case.json").read_text())
        self.start_hz, self.step_hz = about["start_hz"], about["step_hz"]
        self.side, self.pixel_m = about["side"], about["pixel_m"]
        self.half_m = self.side * self.pixel_m / 2
        self.antennas = np.load(folder / "antennas.npy")
        self.samples = np.load(folder / "samples.npy", mmap_mode="r")
        self.fast = np.load(folder / "weights-fast.npy")
        self.slow = np.load(folder / "weights-slow.npy")
        # Image formers that do not normalise return the image times this.
        self.scale = self.fast.sum() * self.slow.sum()

    def judged(self):
        """Judged pixels of the case's grid."""
        return np.load(self.folder / f"judged-{self.side}.npy")


def shortest(form):
    """The last image, and the shortest times of some rounds."""
    best, turns, begun = (math.inf, math.inf), 0, time.perf_counter()
    while turns < MOST_TURNS and (turns == 0 or time.perf_counter() - begun < ENOUGH_S):
        started, before_s = time.perf_counter(), time.process_time()
        image = form()
        took = (time.perf_counter() - started, time.process_time() - before_s)
        best = tuple(map(min, best, took))
        turns += 1
    return image, {"seconds": best[0], "processor_s": best[1], "turns": turns, "peak_bytes": peak_bytes()}


def peak_bytes():
    for line in Path("/proc/self/status").read_text().splitlines():
        if line.startswith("VmHWM:"):
            return 1024 * int(line.split()[1])
    return 0


def report(case, image, times, judged, power, note):
    """Print the measurement: errors at the judged pixels over the power of the image. Bytes: samples read once, pixels written once."""
    if not power > 0:
        raise SystemExit("the image is empty")
    rows, columns = judged[:, :2].astype(int).T
    expected = judged[:, 2] + 1j * judged[:, 3]
    stands_for = judged[:, 4]
    got = image[rows, columns].astype(np.complex128)
    error = np.sum(stands_for * np.abs(got - expected) ** 2)
    best = np.sum(stands_for * got.conj() * expected) / np.sum(stands_for * np.abs(got) ** 2)
    left = np.sum(stands_for * np.abs(best * got - expected) ** 2)
    measured = {
        "pairs": case.side**2 * len(case.antennas),
        "error_db": 10 * math.log10(error / power),
        "scaled_db": 10 * math.log10(left / power),
        "operations": 0,
        "least_bytes": 8 * (case.samples.size + case.side**2),
        "note": note,
    }
    print(json.dumps(times | measured))
