"""Images of arrays, files and simulations, compared with sums written here."""

import os
import signal
import subprocess
import sys
import threading
import time

import numpy as np
import pytest

import subaperture as sar

C = 299792458.0
GRID = "x=-8:8:0.5,y=-8:8:0.5,z=0"


def arrays(points, pulses=96, frequencies=64):
    """Arguments of phase_history for unit scatterers seen from 1 km."""
    f = 10e9 + 2e6 * np.arange(frequencies)
    a = np.column_stack([np.linspace(-30, 30, pulses), np.full(pulses, -1000.0), np.full(pulses, 300.0)])
    s = sum(np.exp(-4j * np.pi / C * np.linalg.norm(a - p, axis=1)[:, None] * f) for p in np.asarray(points))
    return {"samples": s, "frequency_hz": f, "antenna_m": a, "sign": -1, "reference_path_m": 0.0}


def exact_sum(given, x, y):
    """Image without windows, in float64: the mean over pulses and frequencies of the samples against the phase of each pixel."""
    f, a, s = given["frequency_hz"], given["antenna_m"], given["samples"]
    image = np.zeros((len(y), len(x)), complex)
    for i, row in enumerate(y):
        for j, column in enumerate(x):
            path = 2 * np.linalg.norm(a - [column, row, 0.0], axis=1)
            image[i, j] = np.mean(s * np.exp(2j * np.pi / C * path[:, None] * f))
    return image


def error_db(image, reference):
    return 10 * np.log10(np.sum(np.abs(image - reference) ** 2) / np.sum(np.abs(reference) ** 2))


@pytest.mark.parametrize("former", ["exact", "bp", "rdbp", "ffbp", "auto"])
def test_image_of_arrays_keeps_error_bound(former):
    given = arrays([[0, 0, 0], [3.25, -2.0, 0]])
    recording = sar.phase_history(**given)
    options = {} if former == "exact" else {"error_db": -60}
    image = sar.focus(recording, GRID, former=former, window="none", slow_window="none", **options)
    grid = sar.Grid(GRID)
    reference = exact_sum(given, grid.columns, grid.rows)
    # Samples are rounded to complex64, an error of 2^-24 of each: -140 dB; pixels likewise.
    assert error_db(image.array, reference) < (-120 if former == "exact" else -60)
    assert image.predicted_error_db < -60


def test_array_shares_memory_with_image_and_is_read_only():
    image = sar.focus(sar.phase_history(**arrays([[0, 0, 0]])), GRID)
    array = image.array
    assert array.dtype == np.complex64 and array.shape == (32, 32) == image.shape
    assert np.shares_memory(array, image.array)
    with pytest.raises(ValueError):
        array[0, 0] = 1
    kept = array.copy()
    del image
    assert np.array_equal(array, kept)


def test_strided_and_integer_arrays_are_read():
    given = arrays([[1, 2, 0]])
    reference = sar.phase_history(**given).samples()
    assert np.array_equal(reference, given["samples"].astype(np.complex64))
    strided = dict(given, samples=np.asfortranarray(given["samples"]), sign=np.int8(-1))
    assert np.array_equal(sar.phase_history(**strided).samples(), reference)
    assert np.array_equal(sar.phase_history(**given).samples(10, 12), reference[10:12])


def test_positive_sign_is_converted():
    given = arrays([[1, 2, 0]])
    conjugate = dict(given, samples=given["samples"].conj(), sign=1)
    assert np.array_equal(sar.phase_history(**conjugate).samples(), sar.phase_history(**given).samples())


def test_stated_phase_convention_is_checked_on_request_and_inferred_if_unstated():
    given = arrays([[1, 2, 0], [-3, 1, 0]])
    given["extent_m"] = [-10, 10, -10, 10]
    # Conjugate samples are of sign 1.
    wrong = dict(given, samples=given["samples"].conj())
    assert sar.phase_history(**wrong).warnings == []
    assert sar.phase_history(**given, check=True).warnings == []
    (warning,) = sar.phase_history(**wrong, check=True).warnings
    assert "sharper with sign +1" in warning or "sharper with sign 1" in warning
    inferred = sar.phase_history(**{name: value for name, value in wrong.items() if name != "sign"})
    assert inferred.phase_conventions[0]["sign"] == 1
    with pytest.raises(sar.ReadError, match="sign"):
        noise = np.random.default_rng(1).normal(size=given["samples"].shape)
        sar.phase_history(**dict(given, samples=noise + 0j, sign=None))


def test_errors_have_classes_and_codes():
    given = arrays([[0, 0, 0]])
    recording = sar.phase_history(**given)
    for failing, error, code, words in [
        (lambda: sar.open("missing.cphd"), sar.ReadError, "read", "missing.cphd"),
        (lambda: sar.open(3), sar.ArgumentError, "argument", "expected a path"),
        (lambda: sar.focus(recording, "x=1"), sar.ArgumentError, "argument", "grid"),
        (lambda: sar.focus(recording, GRID, former="rda2"), sar.ArgumentError, "argument", "omega-k"),
        (lambda: sar.focus(recording, GRID, former="bp", sub_cpi=3), sar.ArgumentError, "argument", "bp has no option sub_cpi"),
        (lambda: sar.focus(recording, GRID, window="boxcar"), sar.ArgumentError, "argument", "boxcar"),
        (lambda: sar.focus(recording, GRID, memory="2 lots"), sar.ArgumentError, "argument", "2G"),
        (lambda: sar.focus(recording, "x=-2000:2000:0.1,y=-2000:2000:0.1", memory="16M"), sar.MemoryLimitError, "memory", "memory"),
        (lambda: sar.phase_history(**dict(given, frequency_hz=None)), sar.ReadError, "read", "start_hz"),
        (lambda: sar.phase_history(**dict(given, antenna_m=given["antenna_m"][:3])), sar.ReadError, "read", "antenna_m"),
        (lambda: sar.phase_history(**dict(given, samples=["a"])), sar.ArgumentError, "argument", "samples"),
        (lambda: sar.simulate("table-9"), sar.ArgumentError, "argument", "table-4-1"),
        (lambda: sar.command("focus"), sar.CommandError, "command", "--out"),
    ]:
        with pytest.raises(error) as raised:
            failing()
        assert raised.value.code == code and words in str(raised.value), str(raised.value)
        assert isinstance(raised.value, sar.SubapertureError)


def test_error_bound_that_cannot_be_kept_is_refused_or_warned_of():
    recording = sar.simulate("table-4-1")
    grid = "x=-40:40:1,y=-40:40:1,z=0"
    with pytest.raises(sar.BoundError, match="allow_error=True"):
        sar.focus(recording, grid, former="pfa", error_db=-120)
    image = sar.focus(recording, grid, former="pfa", error_db=-120, allow_error=True)
    assert image.bound_missed


def test_command_and_package_form_the_same_bits(tmp_path):
    scenario = tmp_path / "scene.toml"
    scenario.write_text(SCENE)
    path = tmp_path / "scene.cphd"
    sar.command("simulate", scenario, "-o", path)
    result = sar.command("focus", path, "--grid", GRID, "--out", tmp_path / "image")
    image = sar.focus(path, GRID)
    assert np.array_equal(np.load(tmp_path / "image" / "image.npy"), image.array)
    stored = sar.read_image(tmp_path / "image")
    assert np.array_equal(stored.array, image.array) and stored.grid == image.grid
    assert result["schema"].startswith("subaperture-")
    # The picture and the record are the command's too.
    image.save(tmp_path / "own")
    assert (tmp_path / "own" / "image.png").read_bytes() == (tmp_path / "image" / "image.png").read_bytes()
    assert sar.compare(sar.read_image(tmp_path / "own"), stored)["error_db"] is None


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    """Folder with a recording, and files that correct it."""
    folder = tmp_path_factory.mktemp("scene")
    sar.command("simulate", scenario_in(folder), "-o", folder / "scene.cphd")
    recording = sar.open(folder / "scene.cphd")
    count, _ = recording.shape
    time = recording.time_s
    # Errors of 1 rad, targets that move by metres, antennas displaced by centimetres.
    phase = np.cos(np.linspace(0, 7, count))
    target = np.column_stack([time, 3 * time, time**2, 0 * time])
    track = np.column_stack([time, recording.receiver_m + [[0.05, 0.0, -0.02]]])
    for name, header, rows in [
        ("phase", "pulse,phase_rad", zip(range(count), phase.tolist(), strict=True)),
        ("target", "time_s,x_m,y_m,z_m", target.tolist()),
        ("track", "time_s,x_m,y_m,z_m", track.tolist()),
    ]:
        lines = [header, *(",".join(repr(value) for value in row) for row in rows)]
        (folder / f"{name}.csv").write_text("\n".join(lines) + "\n")
    return folder, phase, target, track


def scenario_in(folder):
    path = folder / "scene.toml"
    path.write_text(SCENE)
    return path


def hill(path):
    """SRTM tile about the scene: 1201 x 1201 big-endian heights, north first, 300 m in the south to 500 m in the north."""
    heights = np.repeat(np.linspace(500, 300, 1201).astype(">i2")[:, None], 1201, axis=1)
    heights.tofile(path)
    return path


@pytest.mark.filterwarnings("ignore::subaperture.SubapertureWarning")
def test_surfaces_and_corrections_are_those_of_the_command(scene, tmp_path):
    folder, phase, target, track = scene
    path = folder / "scene.cphd"
    dem = hill(tmp_path / "N47E008.hgt")
    plain = sar.focus(path, GRID).array
    recording = sar.open(path)
    for number, (words, arguments) in enumerate([
        (["--surface", "slant"], {"surface": "slant"}),
        (["--surface", "hae:405m"], {"surface": "hae:405"}),
        (["--surface", f"dem:{dem}", "--geoid", "7.5"], {"surface": dem, "geoid": 7.5}),
        (["--troposphere", "exponential:290"], {"troposphere": "exponential:290"}),
        (["--velocity", "2,-1"], {"velocity_m_s": [2, -1]}),
        (["--velocity", "2,-1,0.5"], {"velocity_m_s": np.array([2.0, -1.0, 0.5])}),
        (["--motion", folder / "target.csv"], {"motion": folder / "target.csv"}),
        (["--motion", folder / "target.csv"], {"motion": target}),
        (["--phase", folder / "phase.csv"], {"phase_rad": str(folder / "phase.csv")}),
        (
            ["--phase", folder / "phase.csv", "--velocity", "2,-1", "--troposphere", "exponential", "--surface", "hae"],
            {"phase_rad": phase, "velocity_m_s": (2, -1), "troposphere": "exponential", "surface": "hae"},
        ),
    ]):
        out = tmp_path / str(number)
        sar.command("focus", path, "--grid", GRID, *words, "--out", out)
        # The command accepts an error above the default bound.
        array = sar.focus(recording, GRID, allow_error=True, **arguments).array
        assert np.array_equal(np.load(out / "image.npy"), array), words
        assert not np.array_equal(plain, array), words
    # Default grids too.
    sar.command("focus", path, "--surface", "slant", "--out", tmp_path / "default", "--velocity", "2,-1")
    whole = sar.focus(recording, surface="slant", velocity_m_s=[2, -1])
    assert np.array_equal(np.load(tmp_path / "default" / "image.npy"), whole.array)
    for name, given in [("file", folder / "track.csv"), ("array", track)]:
        out = tmp_path / name
        sar.command("focus", path, "--grid", GRID, "--track", folder / "track.csv", "--out", out)
        moved = sar.open_channels(path).on_track(given)[0]
        assert np.array_equal(np.load(out / "image.npy"), sar.focus(moved, GRID).array)


def test_plan_on_a_surface_is_that_of_the_command(scene, tmp_path):
    path = scene[0] / "scene.cphd"
    words = ["--grid", GRID, "--surface", "hae:405", "--troposphere", "exponential", "--error-db", "-60"]
    sar.command("plan", "focus", path, *words, "--out", tmp_path / "plan.json")
    plan = sar.image_plan(path, GRID, surface="hae:405", troposphere="exponential", error_db=-60)
    assert plan.text == (tmp_path / "plan.json").read_text()


def test_wrong_surfaces_and_corrections_are_refused(scene):
    folder, phase, target, _ = scene
    recording = sar.open(folder / "scene.cphd")
    local = sar.phase_history(**arrays([[0, 0, 0]]))
    for given, arguments, error, words in [
        (recording, {"surface": "hill"}, sar.ArgumentError, "dem:FILE"),
        (recording, {"surface": "hae:2e5"}, sar.ArgumentError, "100 km"),
        (recording, {"surface": "hae", "geoid": 3.0}, sar.ArgumentError, "geoid"),
        (recording, {"surface": folder / "none.hgt"}, sar.ReadError, "none.hgt"),
        (local, {"surface": "hae"}, sar.UnsuitedError, "position on the Earth"),
        (local, {"troposphere": "exponential"}, sar.ArgumentError, "position on the Earth"),
        (recording, {"troposphere": "wet"}, sar.ArgumentError, "troposphere"),
        (recording, {"velocity_m_s": [1.0]}, sar.ArgumentError, "velocity_m_s"),
        (recording, {"velocity_m_s": [1, 0], "motion": target}, sar.ArgumentError, "both"),
        (recording, {"motion": target[:, :3]}, sar.ArgumentError, "n x 4"),
        (recording, {"motion": target[::-1]}, sar.ArgumentError, "motion"),
        (recording, {"motion": target[:9]}, sar.UnsuitedError, "pulse"),
        (recording, {"phase_rad": phase[:9]}, sar.ArgumentError, "one entry per pulse"),
        (recording, {"phase_rad": np.full(len(phase), np.nan)}, sar.ArgumentError, "finite"),
        (recording, {"phase_rad": folder / "none.csv"}, sar.ReadError, "none.csv"),
    ]:
        with pytest.raises(error, match=words):
            sar.focus(given, GRID, **arguments)


SCENE = """
seed = 3

[radar]
kind = "ideal"
pulses = 128
pri = "5 ms"
centre = "10 GHz"
bandwidth = "300 MHz"
samples = 192

[platform]
kind = "linear"
position = "0, -3, 2 km"
velocity = "100, 0, 0 m/s"

[scene.origin]
latitude = "47.4 deg"
longitude = "8.5 deg"
height = "400 m"

[[scene.point]]
position = "3, 4, 0 m"
"""


def test_scenario_text_is_simulated_and_measured(tmp_path):
    recording = sar.simulate(SCENE)
    assert recording.shape == (128, 192)
    image = sar.focus(recording, "x=-5:11:0.2,y=-4:12:0.2,z=0")
    point = image.measure()
    assert np.hypot(point["position_m"][0] - 3, point["position_m"][1] - 4) < 0.01
    assert abs(point["level_db"]) < 0.1
    near = image.measure(x=3.2, y=3.8)
    assert near["position_m"] == pytest.approx(point["position_m"], abs=1e-3)
    assert image.statistics()["peak_level_db"] == pytest.approx(20 * np.log10(np.abs(image.array).max()), abs=1e-6)
    recording.save(tmp_path / "scene.cphd")
    assert sar.open(tmp_path / "scene.cphd").shape == recording.shape


def test_progress_rises_to_one_and_may_stop_the_work():
    recording = sar.simulate("table-4-1")
    grid = "x=-40:40:0.1,y=-40:40:0.1,z=0"
    seen = []
    sar.focus(recording, "x=-40:40:0.25,y=-40:40:0.25,z=0", progress=seen.append)
    assert seen == sorted(seen) and seen[-1] == 1.0

    def stop(fraction):
        raise RuntimeError("enough")

    with pytest.raises(RuntimeError, match="enough"):
        sar.focus(recording, grid, former="exact", progress=stop)


def test_ctrl_c_stops_the_work_within_a_second():
    recording = sar.simulate("table-4-1")
    sent = []

    def press():
        sent.append(time.monotonic())
        os.kill(os.getpid(), signal.SIGINT)

    # Python installs no handler where the shell ignores interrupts, as it does for commands in the background.
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    # The exact sum of this image takes many minutes.
    timer = threading.Timer(0.5, press)
    timer.start()
    try:
        with pytest.raises(KeyboardInterrupt):
            sar.focus(recording, "x=-40:40:0.05,y=-40:40:0.05,z=0", former="exact")
    finally:
        signal.signal(signal.SIGINT, before)
    assert time.monotonic() - sent[0] < 5.0


def test_other_threads_run_during_the_work():
    recording = sar.simulate("table-4-1")
    turns = []
    done = threading.Event()

    def count():
        while not done.is_set():
            turns.append(time.monotonic())
            time.sleep(0.001)

    counter = threading.Thread(target=count)
    counter.start()
    begin = time.monotonic()
    sar.focus(recording, "x=-40:40:0.5,y=-40:40:0.5,z=0", former="exact")
    end = time.monotonic()
    done.set()
    counter.join()
    within = [turn for turn in turns if begin < turn < end]
    assert len(within) > 10


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork")
@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_forked_process_is_refused_instead_of_waiting_forever():
    sar.simulate("table-4-1")
    child = os.fork()
    if child == 0:
        try:
            sar.simulate("table-4-1")
        except sar.UnsuitedError as error:
            os._exit(0 if "spawn" in str(error) else 1)
        os._exit(2)
    assert os.waitpid(child, 0)[1] == 0


def test_plan_is_text_and_counts_pulses():
    recording = sar.simulate("table-4-1")
    plan = sar.image_plan(recording, "x=-40:40:0.05,y=-40:40:0.05,z=0", error_db=-50)
    assert sar.Plan(plan.text).text == plan.text
    rows, columns = plan.grid.shape
    tiles = -(-rows // plan.tile_shape[0]) * -(-columns // plan.tile_shape[1])
    assert plan.num_tiles == tiles > 1
    read = plan.pulses_read(recording, list(range(tiles)))
    assert len(read) == tiles and all(count >= recording.shape[0] for count in read)


def test_image_is_drawn_and_labelled():
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("agg")
    image = sar.focus(sar.phase_history(**arrays([[0, 0, 0]])), "x=-8:8:0.5,y=-4:4:0.25,z=0")
    axes = image.plot(dynamic_range_db=40)
    assert axes.get_xlabel() == "x (m)" and axes.get_ylabel() == "y (m)"
    assert axes.images[0].get_extent() == pytest.approx([-8.25, 7.75, -4.125, 3.875])
    assert image._repr_png_().startswith(b"\x89PNG")
    xarray = pytest.importorskip("xarray")
    labelled = image.to_xarray()
    assert isinstance(labelled, xarray.DataArray) and labelled.dims == ("y", "x")
    assert labelled.y.attrs["units"] == "m" and np.array_equal(labelled.y, image.grid.rows)
    assert abs(complex(labelled.sel(x=0, y=0))) == pytest.approx(1, abs=0.01)


def test_accessor_labels_levels_and_multilooks():
    image = sar.focus(sar.phase_history(**arrays([[0, 0, 0], [3, -2, 0]])), GRID)
    array = image.to_xarray()
    level = array.sar.db()
    assert level.attrs["units"] == "dB" and level.attrs["title"] == image.title
    assert array.attrs["units"] == "1"
    assert level.max().item() == pytest.approx(image.statistics()["peak_level_db"], abs=1e-5)
    looks = array.sel(x=slice(-4, 3.5)).sar.multilook(3, 4)
    # Boxes written out: 32 rows give 10 of 3, columns from -4 to 3.5 give 4 of 4.
    pixels = image.array[:30, 8:24].reshape(10, 3, 4, 4)
    assert np.allclose(looks, np.sqrt(np.mean(np.abs(pixels) ** 2, axis=(1, 3))), rtol=1e-6)
    assert looks.x[0] == pytest.approx(-4 + 0.75) and looks.y[0] == pytest.approx(-8 + 0.5)
    assert looks.x.attrs["units"] == "m"
    axes = looks.sar.plot(dynamic_range_db=40)
    assert axes.get_xlabel() == "x (m)" and axes.get_aspect() == 1.0 and axes.get_title() == image.title
    with pytest.raises(sar.ArgumentError, match="along x"):
        array.sar.multilook(1, 33)
    with pytest.raises(sar.ArgumentError, match="rows x columns"):
        array.isel(x=0).sar.multilook(1, 1)


def test_import_needs_no_optional_package():
    words = "import sys, subaperture; print(*{'xarray', 'matplotlib', 'dask'} & {*sys.modules})"
    printed = subprocess.run([sys.executable, "-c", words], capture_output=True, text=True, check=True).stdout
    assert printed.strip() == ""


def test_viewer_serves_the_image():
    import urllib.request

    image = sar.focus(sar.phase_history(**arrays([[0, 0, 0]])), GRID)
    with sar.view(image) as viewer:
        page = urllib.request.urlopen(viewer.url, timeout=20).read()
        assert b"<html" in page.lower() and viewer.url in viewer._repr_html_()
