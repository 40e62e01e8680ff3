"""Opens the group of `subap pair` with xarray and computes coherence and phase from its images by a plain sum."""

import sys

import numpy as np
import xarray

pair = xarray.open_zarr(sys.argv[1], consolidated=True, chunks=None)
image, reference = (pair["image"].values[i].astype(np.complex128) for i in (0, 1))
rows, columns = image.shape
half = (1, 2)


def summed(values):
    total = np.zeros_like(values)
    for r in range(-half[0], half[0] + 1):
        for c in range(-half[1], half[1] + 1):
            total += np.roll(values, (r, c), (0, 1))
    return total


inside = (slice(half[0], rows - half[0]), slice(half[1], columns - half[1]))
cross = summed(image * reference.conj())
gamma = cross / np.sqrt(summed(abs(image) ** 2) * summed(abs(reference) ** 2))
coherence, phase, change = (pair[name].values for name in ("coherence", "phase", "change"))
assert coherence.shape == image.shape and coherence.dtype == np.float32
assert np.isnan(coherence).sum() == rows * columns - gamma[inside].size
np.testing.assert_allclose(coherence[inside], abs(gamma[inside]), atol=1e-5)
clear = abs(gamma[inside]) > 0.1
turn = np.exp(1j * (phase[inside] - np.angle(gamma[inside])))[clear]
assert abs(np.angle(turn)).max() < 1e-4
threshold = pair.attrs["pair"]["threshold"]
tested = np.isfinite(change)
assert tested.any() and ((coherence < threshold) == (change == 1))[tested].all()
assert pair["phase"].attrs["units"] == "radian"
