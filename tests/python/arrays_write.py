"""Writes phase history as NumPy and h5py write arrays. Usage: arrays_write.py FOLDER

The same echoes of three points, by the definition in the schema, float64 throughout, as files of several kinds:

- plain.npz, packed.npz: complex64, every frequency listed, one antenna;
- double.npz: complex128, the conjugate with sign 1, start and step of each pulse, two antennas, one reference a pulse, its path given;
- channels.npz: two receivers side by side;
- plain.h5, packed.h5 (chunked, shuffled, gzip), lzf.h5, big.h5 (big-endian numbers): as plain.npz;
- half.h5, half.npz, integer.h5, integer_big.h5, integer.npz: records of two halves, and of two int16 (10000 of the others' 1).
"""

import pathlib
import sys

try:
    import h5py
    import numpy as np
except ImportError as error:
    sys.exit(f"{error}; install it with: python3 -m pip install numpy h5py")

FOLDER = pathlib.Path(sys.argv[1])
C = 299792458.0
POINTS = [((0.0, 0.0, 0.0), 1.0), ((6.0, -3.5, 0.0), 0.7j), ((-4.0, 5.0, 0.0), -0.4)]

pulses, frequencies = 96, 80
angle = np.linspace(-0.03, 0.03, pulses)
antenna = np.stack([3000 * np.sin(angle), -3000 * np.cos(angle), np.full(pulses, 2000.0)], axis=1)
frequency = 9.6e9 + 4e6 * np.arange(frequencies)


def echoes(transmitter, receiver, reference_path):
    total = np.zeros((pulses, frequencies), complex)
    for place, amplitude in POINTS:
        path = np.linalg.norm(transmitter - place, axis=1) + np.linalg.norm(receiver - place, axis=1)
        total += amplitude * np.exp(-2j * np.pi * np.outer(path - reference_path, frequency) / C)
    return total


to_origin = 2 * np.linalg.norm(antenna, axis=1)
samples = echoes(antenna, antenna, to_origin)
plain = dict(samples=samples.astype("complex64"), frequency_hz=frequency, antenna_m=antenna, sign=-1, reference_m=np.zeros(3))
np.savez(FOLDER / "plain.npz", **plain)
np.savez_compressed(FOLDER / "packed.npz", **plain, _note=np.arange(3))

aside = antenna + [0.0, 0.0, 40.0]
reference = np.tile([1.0, 2.0, 0.0], (pulses, 1))
given = np.linalg.norm(antenna - reference, axis=1) + np.linalg.norm(aside - reference, axis=1)
np.savez(
    FOLDER / "double.npz",
    samples=echoes(antenna, aside, given).conj(),
    sign=1,
    start_hz=np.full(pulses, frequency[0]),
    step_hz=4e6,
    transmitter_m=antenna,
    receiver_m=aside,
    reference_m=reference,
    reference_path_m=given,
    time_s=0.01 * np.arange(pulses),
    origin_deg_m=[47.0, 8.5, 400.0],
    extent_m=[-8.0, 8.0, -7.0, 7.0],
)

second = np.linalg.norm(antenna, axis=1) + np.linalg.norm(aside, axis=1)
np.savez(
    FOLDER / "channels.npz",
    samples=np.stack([samples, echoes(antenna, aside, second)]).astype("complex64"),
    sign=-1,
    reference_m=np.zeros(3),
    frequency_hz=frequency,
    transmitter_m=antenna,
    receiver_m=np.stack([antenna, aside]),
)

def record(kind, scale, names):
    made = np.zeros(samples.shape, dtype=[(name, kind) for name in names])
    for name, part in zip(names, (samples.real, samples.imag)):
        made[name] = (scale * part).round() if scale != 1 else part
    return made


for name, kind, scale, names in [
    ("half", "<f2", 1, ("r", "i")),
    ("integer", "<i2", 1e4, ("re", "im")),
    ("integer_big", ">i2", 1e4, ("real", "imag")),
]:
    own = dict(plain, samples=record(kind, scale, names))
    if kind[0] == "<":
        np.savez(FOLDER / f"{name}.npz", **own)
    with h5py.File(FOLDER / f"{name}.h5", "w") as file:
        for key, array in own.items():
            file[key] = array

packing = {
    "plain": {},
    "packed": dict(chunks=True, shuffle=True, compression="gzip"),
    "lzf": dict(chunks=True, compression="lzf"),
}
for name, options in packing.items():
    with h5py.File(FOLDER / f"{name}.h5", "w") as file:
        for key, array in plain.items():
            file.create_dataset(key, data=array, **(options if np.ndim(array) else {}))
with h5py.File(FOLDER / "big.h5", "w", libver="latest") as file:
    file["samples"] = plain["samples"].astype(">c8")
    file["frequency_hz"] = frequency.astype(">f8")
    file["antenna_m"] = antenna.astype(">f8")
    file["sign"] = np.array(-1, ">f8")
    file["reference_m"] = np.zeros(3, ">f8")
