"""One measurement of FastSAR on the files of a case: python run_fastsar.py FOLDER METHOD CASE BENCH.

METHOD is `ffbp` (ImageFormer) or `exact` (ExactFormer) with keyword arguments of that class. FastSAR takes phase histories, referred to the
scene's middle, and forms the case's grid, so that the case's judged pixels apply. The time is that of a call of a former made in advance;
its plan and the windows are excluded.
"""

import sys
import time

import fastsar
import numpy as np

from peer import Case, method_and_settings, report, shortest

FORMERS = {"ffbp": fastsar.ImageFormer, "exact": fastsar.ExactFormer}


def main():
    case = Case(sys.argv[1])
    method, settings = method_and_settings(sys.argv[2])
    weighted = (case.samples * (case.slow[:, None] * case.fast).astype(np.float32)).astype(np.complex64)
    side, pixel_m = case.side, case.pixel_m
    begun = time.perf_counter()
    former = FORMERS[method](
        case.antennas,
        case.start_hz,
        case.step_hz,
        weighted.shape[1],
        *(side, side, pixel_m, pixel_m),
        backend="cpu",
        window=False,
        **settings,
    )
    planned_s = time.perf_counter() - begun
    image, times = shortest(lambda: former(weighted))
    # Its first axis is x.
    image = image.T / case.scale
    power = np.sum(np.abs(image) ** 2, dtype=np.float64)
    report(case, image, times, case.judged(), power, f"plan apart: {planned_s:.2f} s")


main()
