"""Recordings at URLs, read by ranges from a server of this machine that counts its answers."""

import json
import re
import shutil
import threading
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import h5py
import numpy as np
import pytest

import subaperture as sar
from subaperture import distributed as many

pytest.importorskip("aiohttp")
dask_distributed = pytest.importorskip("distributed")

BLOCK = 4 << 20
GRID = "x=-20:20:0.25,y=-20:20:0.25,z=0"

#: A strip of 240 m along which each point is seen for 35 m.
STRIP = """
[scene]
reference = "0, 1000, 0 m"
x = "-120, 120 m"
y = "997, 1003 m"

[[scene.point]]
position = "0, 1000, 0 m"

[radar]
kind = "ideal"
pulses = 721
pri = "3.3333333 ms"
centre = "10 GHz"
bandwidth = "50 MHz"
samples = 6144

[[radar.transmitter]]
pattern = "gaussian"
boresight = "0, 1, 0"
azimuth = "2 deg"
elevation = "40 deg"

[[radar.receiver]]
pattern = "gaussian"
boresight = "0, 1, 0"
azimuth = "2 deg"
elevation = "40 deg"

[platform]
kind = "linear"
position = "0, 0, 0 m"
velocity = "100, 0, 0 m/s"
at = "middle"
"""


class Files(BaseHTTPRequestHandler):
    """Files of the server's folder; entity tags are their sizes and times."""

    protocol_version = "HTTP/1.1"

    def answer(self, with_content):
        path = self.server.folder / self.path.lstrip("/")
        if not path.is_file():
            self.send_error(404)
            return
        size = path.stat().st_size
        first, last = 0, size - 1
        wanted = re.fullmatch(r"bytes=(\d+)-(\d+)", self.headers.get("Range", ""))
        if wanted and self.server.has_ranges:
            first, last = int(wanted[1]), min(int(wanted[2]), last)
        self.send_response(206 if wanted and self.server.has_ranges else 200)
        self.send_header("ETag", f'"{size}-{path.stat().st_mtime_ns}"')
        self.send_header("Accept-Ranges", "bytes")
        self.send_header("Content-Length", str(last + 1 - first))
        if wanted and self.server.has_ranges:
            self.send_header("Content-Range", f"bytes {first}-{last}/{size}")
        self.end_headers()
        if with_content:
            with path.open("rb") as file:
                file.seek(first)
                content = file.read(last + 1 - first)
            self.server.answers.append((first, len(content)))
            self.wfile.write(content)

    def do_GET(self):
        self.answer(True)

    def do_HEAD(self):
        self.answer(False)

    def log_message(self, *_):
        pass


@pytest.fixture
def server(tmp_path):
    server = ThreadingHTTPServer(("127.0.0.1", 0), Files)
    server.folder, server.answers, server.has_ranges = tmp_path / "served", [], True
    server.folder.mkdir()
    server.url = f"http://127.0.0.1:{server.server_address[1]}"
    thread = threading.Thread(target=server.serve_forever)
    thread.start()
    yield server
    server.shutdown()
    thread.join()
    server.server_close()


def test_image_of_url_has_the_bits_of_the_file(server, tmp_path):
    path = server.folder / "scene.cphd"
    sar.command("simulate", "--preset", "table-4-1", "-o", path)
    url = f"{server.url}/scene.cphd"
    image = sar.focus(url, GRID, error_db=-50)
    assert np.array_equal(image.array, sar.focus(path, GRID, error_db=-50).array)
    size = path.stat().st_size
    # Each byte once, and the file's start when it is recognised.
    assert sum(count for _, count in server.answers) == size + 64

    # The command reads URLs too, and its record has the version instead of a checksum.
    sar.command("focus", url, "--grid", GRID, "--error-db", "-50", "--out", tmp_path / "image")
    assert np.array_equal(sar.read_image(tmp_path / "image").array, image.array)
    recorded = json.loads((tmp_path / "image" / "image.json").read_text())["inputs"]
    assert recorded == [{"path": url, "bytes": size, "version": f'ETag "{size}-{path.stat().st_mtime_ns}"'}]


def test_workers_read_the_pulses_of_their_tiles(server, tmp_path):
    path = server.folder / "strip.cphd"
    (tmp_path / "strip.toml").write_text(STRIP)
    sar.command("simulate", tmp_path / "strip.toml", "-o", path)
    url, size = f"{server.url}/strip.cphd", path.stat().st_size
    assert size > 8 * BLOCK
    plan = sar.image_plan(url, "x=-120:120:0.25,y=999:1001:0.5,z=0", former="bp", error_db=-40)
    (tmp_path / "plan.json").write_text(plan.text)
    read = []
    parts = 8
    for part in range(1, parts + 1):
        server.answers.clear()
        sar.command("focus", url, "--plan", tmp_path / "plan.json", "--tiles", f"{part}/{parts}", "--out", tmp_path / "parts")
        read.append(sum(count for _, count in server.answers))
    assert all(count <= BLOCK for _, count in server.answers)
    # Pulses that see a part of 30 m lie on 100 m of the track of 240 m at most (beam of 70 m at -40 dB). The last task also measures the error.
    assert max(read[:-1]) < 0.55 * size
    sar.command("focus", path, "--plan", tmp_path / "plan.json", "--out", tmp_path / "whole")
    assert np.array_equal(sar.read_image(tmp_path / "parts").array, sar.read_image(tmp_path / "whole").array)


def test_image_of_cluster_from_url_has_the_bits_of_the_file(server, tmp_path):
    path = server.folder / "scene.cphd"
    sar.command("simulate", "--preset", "table-4-1", "-o", path)
    plan = sar.image_plan(path, GRID, error_db=-50)
    with dask_distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster:
        with dask_distributed.Client(cluster) as client:
            folder = many.focus(f"{server.url}/scene.cphd", plan=plan, out=tmp_path / "image", client=client, task_s=1e-9)
    sar.command("focus", path, "--plan", tmp_path / "image" / "plan.json", "--out", tmp_path / "file")
    assert np.array_equal(sar.read_image(folder).array, sar.read_image(tmp_path / "file").array)


def test_arrays_at_url_are_those_of_the_file(server):
    path = server.folder / "arrays.npz"
    rng = np.random.default_rng(2)
    frequency_hz = 10e9 + 1e6 * np.arange(32)
    antenna_m = np.stack([-2000 + 0 * np.arange(24), np.linspace(-20, 20, 24), 300 + 0 * np.arange(24)], axis=1)
    target_m = rng.uniform(-5, 5, 3) * [1, 1, 0]
    path_m = 2 * np.linalg.norm(antenna_m - target_m, axis=1)
    samples = np.exp(-2j * np.pi * frequency_hz * path_m[:, None] / 299792458.0).astype(np.complex64)
    np.savez(path, samples=samples, frequency_hz=frequency_hz, antenna_m=antenna_m, sign=-1, reference_path_m=np.zeros(24))
    ours = sar.open(path).samples()
    assert np.array_equal(ours, sar.open(f"{server.url}/arrays.npz").samples())
    # HDF5 is read by ranges.
    with h5py.File(server.folder / "arrays.h5", "w") as file:
        for name, array in np.load(path).items():
            file[name] = array
    assert np.array_equal(ours, sar.open(f"{server.url}/arrays.h5").samples())


def test_changed_files_and_failing_servers_are_reported(server):
    path = server.folder / "scene.cphd"
    sar.command("simulate", "--preset", "table-4-1", "-o", path)
    url = f"{server.url}/scene.cphd"
    opened = sar.open(url)
    shutil.copy(path, server.folder / "again.cphd")
    shutil.move(server.folder / "again.cphd", path)
    with pytest.raises(sar.errors.ReadError, match="scene.cphd.*version"):
        sar.focus(opened, GRID)
    with pytest.raises(sar.errors.ReadError, match="missing.cphd"):
        sar.open(f"{server.url}/missing.cphd")
    (server.folder / "radar.toml").write_text('name = "radar"')
    with pytest.raises(sar.errors.ReadError, match="local file, found a URL"):
        sar.open(f"{server.url}/radar.toml")
    with pytest.raises(sar.errors.ReadError, match="protocol|Protocol"):
        sar.open("unknown-scheme://host/scene.cphd")
    server.has_ranges = False
    with pytest.raises(sar.errors.ReadError, match="does the server serve ranges"):
        sar.open(url)
