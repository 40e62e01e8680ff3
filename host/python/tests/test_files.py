"""Files shared with other programs, and memory."""

import subprocess
import sys

import numpy as np
import pytest

import subaperture as sar


@pytest.fixture(scope="module")
def cphd(tmp_path_factory):
    path = tmp_path_factory.mktemp("files") / "scene.cphd"
    sar.command("simulate", "--preset", "table-4-1", "-o", path)
    return path


def test_cphd_is_that_of_sarkit(cphd):
    sarkit_cphd = pytest.importorskip("sarkit.cphd")
    recording = sar.open(cphd)
    with open(cphd, "rb") as file, sarkit_cphd.Reader(file) as reader:
        name = reader.metadata.xmltree.findtext(".//{*}Data/{*}Channel/{*}Identifier")
        signal, pvps = reader.read_channel(name)
        # The reader itself is accepted.
        assert np.array_equal(sar.open(reader).samples(), recording.samples())
    assert np.array_equal(signal, recording.samples())
    assert np.array_equal(pvps["SC0"], recording.start_hz) and np.array_equal(pvps["SCSS"], recording.step_hz)
    # Positions are in the scene frame here and in ECF there: distances are the same. ECF metres in float64 are exact to 1e-9 m.
    for own, theirs in [(recording.transmitter_m, pvps["TxPos"]), (recording.receiver_m, pvps["RcvPos"])]:
        lengths = [np.linalg.norm(positions - positions[0], axis=1) for positions in (own, theirs)]
        assert np.allclose(*lengths, rtol=0, atol=1e-8)
    path = np.linalg.norm(pvps["TxPos"] - pvps["SRPPos"], axis=1) + np.linalg.norm(pvps["RcvPos"] - pvps["SRPPos"], axis=1)
    assert np.allclose(recording.reference_path_m, path, rtol=0, atol=1e-8)
    times = (pvps["TxTime"] + pvps["RcvTime"]) / 2
    assert np.allclose(np.diff(recording.time_s), np.diff(times), rtol=0, atol=1e-9)


def test_arrays_of_another_program_make_the_same_image(cphd):
    recording = sar.open(cphd)
    again = sar.phase_history(
        recording.samples(),
        start_hz=recording.start_hz,
        step_hz=recording.step_hz,
        transmitter_m=recording.transmitter_m,
        receiver_m=recording.receiver_m,
        reference_path_m=recording.reference_path_m,
        recorded_path_m=recording.recorded_path_m,
        sign=-1,
        time_s=recording.time_s,
    )
    grid = "x=-20:20:0.5,y=-20:20:0.5,z=0"
    assert np.array_equal(sar.focus(again, grid).array, sar.focus(recording, grid).array)


def test_pixels_outside_the_recorded_paths_are_zero():
    frequency_hz = 10e9 + 1e6 * np.arange(128)
    antenna_m = np.column_stack([np.linspace(-40, 40, 128), np.full(128, -1000.0), np.zeros(128)])
    path_m = 2 * np.linalg.norm(antenna_m, axis=1)
    samples = np.exp(-2j * np.pi * frequency_hz * path_m[:, None] / 299792458.0)
    arrays = {"frequency_hz": frequency_hz, "antenna_m": antenna_m, "sign": -1, "reference_path_m": 0.0}
    raw = sar.phase_history(samples, **arrays)
    assert raw.recorded_path_m is None
    recording = sar.phase_history(samples, recorded_path_m=[1990.0, 2006.0], **arrays)
    assert recording.recorded_path_m.shape == (128, 2)
    image = sar.focus(recording, "x=-8:8:0.25,y=-8:8:0.5,z=0")
    x_m, y_m = np.meshgrid(-8 + 0.25 * np.arange(64), -8 + 0.5 * np.arange(32))
    paths_m = 2 * np.hypot(x_m[..., None] - antenna_m[:, 0], y_m[..., None] + 1000.0)
    covered = ((1990.0 <= paths_m) & (paths_m <= 2006.0)).all(axis=-1)
    assert 0 < covered.sum() < covered.size and np.array_equal(image.array != 0, covered)
    assert any(f"{(~covered).sum()} of 2048 pixels lie outside" in warning for warning in image.warnings)
    with pytest.raises(sar.UnsuitedError, match="no pixel lies within the recorded delays"):
        sar.focus(recording, "x=-8:8:0.25,y=30:38:0.5,z=0")


def test_sicd_and_stack_are_read(cphd, tmp_path):
    sar.command("focus", cphd, "--grid", "x=-20:20:0.5,y=-20:20:0.5,z=0", "--out", tmp_path / "image")
    image = sar.read_image(tmp_path / "image")
    sar.command("export", tmp_path / "image", "--out", tmp_path / "image.nitf", "--format", "sicd")
    sicd = sar.read_image(tmp_path / "image.nitf")
    assert sorted(sicd.shape) == sorted(image.shape) and sicd.record is None
    assert np.isclose(np.abs(sicd.array).max(), np.abs(image.array).max())
    np.save(tmp_path / "large.npy", np.zeros((600, 600), np.complex64))
    with pytest.raises(sar.MemoryLimitError, match="raise memory"):
        sar.read_image(tmp_path / "large.npy", memory="1M")


PEAK = """
import re, sys
import subaperture as sar

def kibibytes(name):
    return int(re.search(name + r":\\s*(\\d+) kB", open("/proc/self/status").read()).group(1))

recording = sar.open(sys.argv[1])
before = kibibytes("VmRSS")
image = sar.focus(recording, "x=-40:40:0.02,y=-40:40:0.02,z=0", memory="320M")
array = image.array
print((kibibytes("VmHWM") - before) * 1024, array.nbytes)
"""


@pytest.mark.skipif(sys.platform != "linux", reason="peak memory is that of /proc")
def test_memory_limit_holds_for_image_and_array(cphd):
    done = subprocess.run([sys.executable, "-c", PEAK, cphd], capture_output=True, text=True, check=True)
    used, pixels = map(int, done.stdout.split())
    assert pixels == 8 * 4000 * 4000
    # The image is held once; stacks of threads and the allocator are the process's own.
    assert pixels <= used < 320 * 2**20 + 32 * 2**20
