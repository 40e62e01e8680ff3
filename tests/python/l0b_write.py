"""Write NISAR L0B files of point scatterers, with the orbit, the Earth and the echoes in formulas of this script's own.

l0b_write.py FOLDER writes, each with the points' ECF positions and amplitudes in a .txt of the same name:

coded.h5    right-looking, falling sweep, codes of a look-up table in compressed chunks, calibration pulses, a transmit gap
half.h5     left-looking, rising sweep, half precision, two transmitted polarisations, irregular pulses
float.h5    right-looking, rising sweep, complex64, contiguous

l0b_write.py FOLDER defects writes files in the form of coded.h5 with the noise of receivers instead of echoes:

noise.h5       without defects
unbalanced.h5  Q with a gain of 1.12 and a phase error of 5 degrees, bias, pulses of unused codes
clipped.h5     noise beyond the largest value of the table; clipped.count contains the number of clipped values
"""

import sys
from pathlib import Path

import h5py
import numpy as np

C = 299_792_458.0
RADIUS_M, RATE, EARTH, TILT = 7.07e6, 1.062e-3, 7.292115e-5, 1.71
CENTRE_HZ, RATE_HZ, PULSE_S, SLOPE = 1.25e9, 24e6, 20e-6, 1e12
SAMPLES, PULSES = 1000, 150


def orbit(t):
    """ECF position and velocity: a circle in an inertial frame, seen from the rotating Earth."""
    t = np.asarray(t, float)
    a = RATE * t
    place = RADIUS_M * np.stack([np.cos(a), np.sin(a) * np.cos(TILT), np.sin(a) * np.sin(TILT)], -1)
    speed = RADIUS_M * RATE * np.stack([-np.sin(a), np.cos(a) * np.cos(TILT), np.cos(a) * np.sin(TILT)], -1)
    turn = EARTH * t
    c, s = np.cos(turn), np.sin(turn)

    def turned(v):
        return np.stack([c * v[..., 0] + s * v[..., 1], -s * v[..., 0] + c * v[..., 1], v[..., 2]], -1)

    place = turned(place)
    return place, turned(speed) + EARTH * np.stack([place[..., 1], -place[..., 0], 0 * c], -1)


def ecf(lat, lon, height):
    a, e2 = 6378137.0, (2 - 1 / 298.257223563) / 298.257223563
    n = a / np.sqrt(1 - e2 * np.sin(lat) ** 2)
    flat = (n + height) * np.cos(lat)
    return np.array([flat * np.cos(lon), flat * np.sin(lon), (n * (1 - e2) + height) * np.sin(lat)])


def at(t, slant_m, height, side):
    """Latitude and longitude of the point of this height at zero Doppler, by Newton's method."""
    p, v = orbit(t)
    u = p / np.linalg.norm(p)
    right = np.cross(v, u) / np.linalg.norm(v)
    guess = p * (6.37e6 / np.linalg.norm(p)) + side * 500e3 * right
    x = np.array([np.arcsin(guess[2] / np.linalg.norm(guess)), np.arctan2(guess[1], guess[0])])

    def miss(x):
        d = ecf(*x, height) - p
        return np.array([np.linalg.norm(d) - slant_m, d @ v / np.linalg.norm(v)])

    for _ in range(50):
        m = miss(x)
        j = np.stack([(miss(x + h) - m) / 1e-7 for h in np.eye(2) * 1e-7], -1)
        x = x - np.linalg.solve(j, m)
    assert np.abs(miss(x)).max() < 1e-6
    return x


def echoes(times, ranges_m, slope, points):
    """Samples: the wave that left at t_e, in the pulse whose middle leaves at the pulse's time, mixed with the carrier on arrival."""
    z = np.zeros((len(times), len(ranges_m)), complex)
    for n, sent in enumerate(times):
        received = sent - PULSE_S / 2 + 2 * ranges_m / C
        here = orbit(received)[0]
        for place, amplitude in points:
            back = np.linalg.norm(here - place, axis=-1)
            left = received - 2 * back / C
            for _ in range(4):
                left = received - (back + np.linalg.norm(orbit(left)[0] - place, axis=-1)) / C
            # The difference of nearly equal times of some tens of seconds, from the path instead.
            delay = (back + np.linalg.norm(orbit(left)[0] - place, axis=-1)) / C
            after = 2 * ranges_m / C - PULSE_S / 2 - delay
            sample = np.exp(-2j * np.pi * CENTRE_HZ * delay + 1j * np.pi * slope * after**2)
            z[n] += amplitude * np.where(np.abs(after) <= PULSE_S / 2, sample, 0)
    return z


def codes(z):
    """Table and codes of 8 bits with a block exponent: values (m - 127.5) 2^(e - 6) / 64."""
    table = np.full(1 << 16, np.nan, np.float32)
    e, m = np.meshgrid(np.arange(8), np.arange(256), indexing="ij")
    table[(e << 8 | m).ravel()] = ((m - 127.5) * 2.0 ** (e - 12)).ravel()

    def coded(x):
        unused = np.isnan(x)
        x = np.where(unused, 0.0, x)
        exponent = np.clip(np.ceil(np.log2(np.maximum(np.abs(x), 1e-9) / 127.5)) + 12, 0, 7).astype(int)
        mantissa = np.clip(np.round(x / 2.0 ** (exponent - 12) + 127.5), 0, 255).astype(int)
        return np.where(unused, 0xFFFF, exponent << 8 | mantissa).astype("<u2")

    pairs = np.zeros(z.shape, [("r", "<u2"), ("i", "<u2")])
    pairs["r"], pairs["i"] = coded(z.real), coded(z.imag)
    return table, pairs


def text(group, name, value):
    group.create_dataset(name, data=np.bytes_(value))


def transmitted(group, times, epoch, first_m, slope, kinds, swaths):
    """Contents of a group such as txH."""
    n = len(times)
    group.create_dataset("UTCtime", data=times).attrs["units"] = np.bytes_(f"seconds since {epoch}")
    kind = h5py.enum_dtype({"HPA": 0, "LNA": 1, "BYPASS": 2}, basetype="uint8")
    group.create_dataset("calType", data=kinds.astype("u1"), dtype=kind)
    for name, value in [
        ("centerFrequency", CENTRE_HZ),
        ("chirpDuration", PULSE_S),
        ("chirpSlope", slope),
        ("rangeBandwidth", SLOPE * PULSE_S),
        ("slantRangeSpacing", C / (2 * RATE_HZ)),
        ("numberOfSubSwaths", np.uint8(len(swaths))),
    ]:
        group.create_dataset(name, data=value)
    group.create_dataset("slantRange", data=first_m + np.arange(SAMPLES) * C / (2 * RATE_HZ))
    for i, swath in enumerate(swaths, 1):
        group.create_dataset(f"validSamplesSubSwath{i}", data=np.tile(np.array(swath, "u4"), (n, 1)))


def noise(deviation):
    """Gaussian noise with this standard deviation in I and in Q."""
    return np.random.default_rng(11).normal(size=(PULSES, SAMPLES, 2), scale=deviation).view(complex)[..., 0]


def unbalanced():
    z = noise(0.5)
    error = np.radians(5.0)
    q = 1.12 * (z.imag * np.cos(error) + z.real * np.sin(error))
    z = z.real + 0.15 + 1j * (q - 0.1)
    z[[30, 31, 100]] = np.nan + 1j * np.nan
    return z


def write(path, side, slope, style, samples=None):
    rng = np.random.default_rng(7)
    middle_s, first_m = 40.0, 850e3
    times = middle_s + (np.arange(PULSES) - (PULSES - 1) / 2) * 10e-3
    if style == "half":
        times = times + rng.uniform(-1e-3, 1e-3, PULSES)
    kinds, swaths = np.zeros(PULSES), [[0, SAMPLES]]
    ranges_m = first_m + np.arange(SAMPLES) * C / (2 * RATE_HZ)
    # The middle of the ranges whose echoes are complete.
    complete_m = ranges_m[[0, -1]].mean() - C * PULSE_S / 4
    mark = at(times[[0, -1]].mean(), complete_m, 0.0, side)
    metre = np.array([1 / 6.36e6, 1 / (6.37e6 * np.cos(mark[0]))])
    points = []
    for north, east, height, amplitude in [
        (0, 0, 0, 1.0),
        (700, -900, 80.0, 0.8j),
        (-600, 800, -40.0, -0.6),
    ]:
        points.append((ecf(*(mark + metre * [north, east]), height), amplitude))
    z = echoes(times, ranges_m, slope, points) if samples is None else samples
    if style == "coded":
        # Two pulses were not transmitted. A gap takes 50 of the 480 samples of every echo; the last interval ends after the samples.
        kinds[[0, 71]] = [2, 1]
        z[[0, 71]] = 3.0
        swaths = [[0, 475], [525, 1 << 20]]
    if samples is not None:
        # The gap contains the transmitted pulse.
        z[:, 475:525] = 3.5 - 3.5j
        sent = np.delete(np.delete(z, np.s_[475:525], 1), [0, 71], 0)
        # Half a step below the largest value, which is rounded to it.
        most = 127.0 * 2.0**-5
        count = (np.abs(sent.real) >= most).sum() + (np.abs(sent.imag) >= most).sum()
        path.with_suffix(".count").write_text(f"{count}\n")
    with h5py.File(path, "w") as f:
        root = f.create_group("science/LSAR")
        named = root.create_group("identification")
        named.create_dataset("diagnosticModeFlag", data=np.uint8(0))
        text(named, "lookDirection", "Right" if side > 0 else "left")
        text(named, "missionId", "TEST")
        states = root.create_group("RRSD/lowRateTelemetry/orbit")
        t = np.arange(0, 91, 10.0)
        place, speed = orbit(t)
        # An hour before the pulses' epoch.
        states.create_dataset("time", data=t + 3600).attrs["units"] = np.bytes_("seconds since 2026-01-01 00:00:00")
        states.create_dataset("position", data=place)
        states.create_dataset("velocity", data=speed)
        if style != "float":
            text(states, "interpMethod", "Hermite")
        epoch = "2026-01-01T01:00:00.000000000"
        band = root.create_group("RRSD/swaths/frequencyA")
        for tx in ["H", "V"] if style == "half" else ["H"]:
            sent = band.create_group("tx" + tx)
            transmitted(sent, times, epoch, first_m, slope, kinds, swaths)
            received = sent.create_group("rx" + tx)
            if style == "coded":
                table, pairs = codes(z)
                received.create_dataset("BFPQLUT", data=table)
                received.create_dataset(
                    tx + tx, data=pairs, chunks=(7, 130), compression="gzip", shuffle=True, compression_opts=1
                )
            elif style == "half":
                pairs = np.zeros(z.shape, [("r", "<f2"), ("i", "<f2")])
                own = z if tx == "H" else 2 * z
                pairs["r"], pairs["i"] = own.real, own.imag
                received.create_dataset(tx + tx, data=pairs)
            else:
                received.create_dataset(tx + tx, data=z.astype("c8"))
    lines = [f"{p[0]!r} {p[1]!r} {p[2]!r} {complex(a).real} {complex(a).imag}" for p, a in ((p.tolist(), a) for p, a in points)]
    path.with_suffix(".txt").write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    folder = Path(sys.argv[1])
    if sys.argv[2:] == ["defects"]:
        for name, samples in [("noise", noise(0.5)), ("unbalanced", unbalanced()), ("clipped", noise(1.5))]:
            write(folder / f"{name}.h5", 1, -SLOPE, "coded", samples)
    else:
        write(folder / "coded.h5", 1, -SLOPE, "coded")
        write(folder / "half.h5", -1, SLOPE, "half")
        write(folder / "float.h5", 1, SLOPE, "float")
