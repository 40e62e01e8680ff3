"""Write collections in the layout of AFRL's Gotcha GMTI challenge, simulated with formulas of this script's own.

gotcha_gmti_write.py FOLDER writes files of the prefix `simulated`, and truth.json with scatterers in metres and amplitudes:

one     one scatterer, three channels; the phase is compensated to ranges from the origin, displaced by range bins
moved   one scatterer, one channel; the phase is compensated to ranges from another point
scene   clutter and a mover, three channels with errors of gain and phase

The phase of a scatterer at `p` in a sample of frequency `f` is -2 pi f (|a - p| + |r - p| - 2 R0) / c, transmitter `a`, receiver `r`.
"""

import json
import struct
import sys
from pathlib import Path

import numpy as np

C = 299_792_458.0
SAMPLES, ORIGINAL = 384, 5400
SAMPLING_HZ, CHIRP_HZ_S = 2.5e7, 2.96e12
RADIUS_M, HEIGHT_M, SPEED_M_S, PRF_HZ = 1700.0, 1200.0, 60.0, 600.0
OFFSETS_M = [0.0, -0.6, -1.2]
POINT_M, POINT = [6.3, -4.1, 1.5], 0.8 - 0.6j


def element(kind, data):
    return struct.pack("<II", kind, len(data)) + data + bytes(-len(data) % 8)


def matrix(name, value):
    """A matrix of doubles or, of a dictionary, a structure (MathWorks, MAT-File Format, chapter 1)."""
    structure = isinstance(value, dict)
    shape = (1, 1) if structure else np.atleast_2d(value).shape
    body = element(6, struct.pack("<II", 2 if structure else 6, 0))
    body += element(5, struct.pack("<ii", *shape)) + element(1, name.encode())
    if structure:
        body += struct.pack("<HHi", 5, 4, 32)
        body += element(1, b"".join(key.encode().ljust(32, b"\0") for key in value))
        body += b"".join(matrix("", part) for part in value.values())
    else:
        body += element(9, np.asarray(value, "<f8").tobytes("F"))
    return element(14, body)


def save(path, name, value):
    header = b"MATLAB 5.0 MAT-file, written by gotcha_gmti_write.py".ljust(124) + struct.pack("<H", 0x0100) + b"IM"
    path.write_bytes(header + matrix(name, value))


def track(count):
    """Positions and directions of flight on a circle, in the middle of which the antenna is south of the scene."""
    angle = SPEED_M_S / RADIUS_M * (np.arange(count) - (count - 1) / 2) / PRF_HZ - np.pi / 2
    zero = 0 * angle
    place = np.stack([RADIUS_M * np.cos(angle), RADIUS_M * np.sin(angle), zero + HEIGHT_M], -1)
    return place, np.stack([-np.sin(angle), np.cos(angle), zero], -1)


def distance(a, b):
    return np.sqrt(((a - b) ** 2).sum(-1))


class Collection:
    """Geometry and frequencies of a collection, and its parameters as stored."""

    def __init__(self, name, count, reference=(0, 0, 0), bins=True):
        n = np.arange(count)
        self.name, self.count = name, count
        self.place, self.along = track(count)
        original_hz = CHIRP_HZ_S / SAMPLING_HZ
        # The frequency of the reference radius drifts; whole samples of it are removed by a circular shift.
        self.radius_hz = 9.6e9 + 3e5 * np.sin(0.05 * n)
        self.shift = np.floor((self.radius_hz - 9.28e9) / original_hz)
        self.error = -0.37
        self.start_hz = self.radius_hz - self.shift * original_hz + (self.error + 1) * original_hz
        self.step_hz = original_hz * ORIGINAL / SAMPLES
        self.bins = np.round(9 + 4 * np.cos(0.03 * n)) if bins else 0.0 * n
        self.range_m = distance(self.place, np.array(reference))
        self.reference_m = self.range_m + self.bins * C / (2 * ORIGINAL * original_hz)

    def echoes(self, channel, places, amplitudes):
        """Samples of a channel; `places` [scatterer, 3] or [pulse, scatterer, 3]."""
        receiver = self.place + OFFSETS_M[channel] * self.along
        places = np.broadcast_to(places, (self.count, *np.shape(places)[-2:]))
        out = np.empty((self.count, SAMPLES), complex)
        coarse, fine = 16 * np.arange(SAMPLES // 16), np.arange(16)
        for n in range(self.count):
            path = distance(self.place[n], places[n]) + distance(receiver[n], places[n])
            turns = (path - 2 * self.reference_m[n]) / C

            def turned(k, start):
                cycles = np.outer(start + k * self.step_hz, turns)
                return np.exp(-2j * np.pi * (cycles % 1))

            out[n] = ((turned(coarse, self.start_hz[n]) * amplitudes) @ turned(fine, 0).T).ravel()
        return out

    def save(self, folder, channels):
        for number, samples in channels.items():
            path = folder / f"simulated_chan{number}_{self.name}_PH"
            parts = np.stack([samples.real, samples.imag], -1)
            path.write_bytes(parts.astype(">f4").tobytes())
            auxiliary = {
                "fc": 9.6e9,
                "PRF": PRF_HZ,
                "readPrm": {"numSamples": SAMPLES, "Fsamp": SAMPLING_HZ, "deltaRbin": self.bins},
                "circshiftFloorPHradius": self.shift,
                "PHradius_sampleError": self.error,
            }
            save(folder / f"{path.name}_auxSaveData.mat", "aux_SPIE", auxiliary)
        positions = {
            "APCpos": self.place.T,
            "APCMag": self.range_m,
            "Gamma": np.full(self.count, CHIRP_HZ_S),
            "PHradius": self.radius_hz,
        }
        save(folder / f"simulated_{self.name}_PAUX.mat", "paux", positions)


def scene(folder):
    """Clutter of random places, a mover of constant velocity, noise; returns the mover."""
    count = 360
    random = np.random.default_rng(7)
    collection = Collection("scene", count)
    clutter = random.uniform([-24, -16, 0], [24, 16, 0], (800, 3))
    level = random.normal(size=(800, 2)) @ [1, 1j] / np.sqrt(2)
    time = (np.arange(count) - (count - 1) / 2) / PRF_HZ
    start, velocity = np.array([-5.0, 3.0, 0.0]), np.array([0.0, -0.5, 0.0])
    mover = start + time[:, None, None] * velocity
    middle = collection.place[count // 2 - 1 : count // 2 + 1].mean(0)
    sight = (middle - start) / distance(middle, start)
    channels = {}
    for channel, error in enumerate([1, 0.9 * np.exp(0.8j), 1.1 * np.exp(-1.3j)]):
        samples = collection.echoes(channel, clutter, level) + collection.echoes(channel, mover, [0.5])
        noise = random.normal(size=(count, SAMPLES, 2)) @ [1, 1j]
        channels[channel + 1] = error * (samples + noise)
    collection.save(folder, channels)
    return {"position_m": start.tolist(), "radial_velocity_m_s": float(velocity @ sight)}


def main():
    folder = Path(sys.argv[1])
    places, amplitudes = np.array([POINT_M]), np.array([POINT])
    one = Collection("one", 64)
    one.save(folder, {c + 1: one.echoes(c, places, amplitudes) for c in range(3)})
    moved = Collection("moved", 64, reference=(3.0, -2.0, 0.5), bins=False)
    moved.save(folder, {1: moved.echoes(0, places, amplitudes)})
    truth = {
        "point_m": POINT_M,
        "amplitude": [POINT.real, POINT.imag],
        "start_hz": one.start_hz.tolist(),
        "step_hz": one.step_hz,
        "prf_hz": PRF_HZ,
        "offsets_m": OFFSETS_M,
        "mover": scene(folder),
    }
    (folder / "truth.json").write_text(json.dumps(truth))


main()
