"""Images on several worker processes of this machine: bits, lost workers, damaged work."""

import os
import random
import signal
import threading
import time

import numpy as np
import pytest

import subaperture as sar
from subaperture import distributed as many

dask_distributed = pytest.importorskip("distributed")

GRID = "x=-40:40:0.05,y=-40:40:0.05,z=0"


@pytest.fixture(scope="module")
def cluster():
    with dask_distributed.LocalCluster(n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None) as cluster:
        yield cluster


@pytest.fixture(scope="module")
def client(cluster):
    with dask_distributed.Client(cluster) as client:
        yield client


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    path = tmp_path_factory.mktemp("scene") / "scene.cphd"
    sar.command("simulate", "--preset", "table-4-1", "-o", path)
    return path


@pytest.fixture(scope="module")
def plan(recording):
    return sar.image_plan(recording, GRID, error_db=-50)


def at_once(recording, plan, folder):
    """Image of one process by the same plan."""
    path = folder / "plan.json"
    path.write_text(plan.text)
    sar.command("focus", recording, "--plan", path, "--out", folder / "one")
    return sar.read_image(folder / "one").array


def test_image_of_workers_has_the_bits_of_one_process(client, recording, plan, tmp_path):
    seen = []
    folder = many.focus(recording, plan=plan, out=tmp_path / "image", client=client, task_s=1e-9, progress=seen.append)
    assert np.array_equal(sar.read_image(folder).array, at_once(recording, plan, tmp_path))
    assert seen[-1] == 1.0 and len(seen) == plan.num_tiles > 4
    # Finished tiles are kept.
    marks = {path: path.stat().st_mtime_ns for path in (tmp_path / "image" / "image.zarr" / "done").iterdir()}
    many.focus(recording, plan=plan, out=tmp_path / "image", client=client)
    assert marks == {path: path.stat().st_mtime_ns for path in marks}


def test_killed_workers_lose_nothing(cluster, client, recording, plan, tmp_path):
    killed = []
    done = threading.Event()

    def kill():
        choice = random.Random(5)
        while not done.is_set() and len(killed) < 4:
            time.sleep(0.4)
            alive = [worker.process.pid for worker in cluster.workers.values() if worker.process is not None and worker.process.pid]
            if alive:
                killed.append(choice.choice(alive))
                os.kill(killed[-1], signal.SIGKILL)

    killer = threading.Thread(target=kill)
    killer.start()
    try:
        folder = many.focus(recording, plan=plan, out=tmp_path / "image", client=client, task_s=1e-9)
    finally:
        done.set()
        killer.join()
    assert killed
    assert np.array_equal(sar.read_image(folder).array, at_once(recording, plan, tmp_path))


def test_errors_of_tasks_are_raised_and_other_plans_are_refused(client, recording, plan, tmp_path):
    with pytest.raises(sar.CommandError, match="gone.cphd"):
        many.focus(tmp_path / "gone.cphd", plan=plan, out=tmp_path / "image", client=client, retries=0)
    other = sar.image_plan(recording, GRID, error_db=-40)
    with pytest.raises(sar.WriteError, match="another"):
        many.focus(recording, plan=other, out=tmp_path / "image", client=client)
    with pytest.raises(sar.ArgumentError, match="both"):
        many.focus(recording, GRID, plan=plan, out=tmp_path / "image", client=client)


def test_estimate_counts_tasks_bytes_and_time(recording, plan):
    history = sar.open(recording)
    one = many.estimate(history, plan, 1, overhead_s=0.0, price_per_core_hour=3600.0)
    hundred = many.estimate(history, plan, 100, task_s=1e-9, overhead_s=0.5)
    assert one.tasks == 1 and one.seconds == pytest.approx(plan.core_s) and one.cost == pytest.approx(plan.core_s)
    assert hundred.tasks == plan.num_tiles and hundred.seconds == pytest.approx(plan.core_s / plan.num_tiles + 0.5)
    # Every pulse is read at least once for each tile.
    assert one.bytes_read >= plan.num_tiles * 8 * history.shape[0] * history.shape[1]
    rows, columns = plan.tile_shape
    assert one.bytes_written == plan.num_tiles * rows * columns * 8


def test_failed_items_do_not_lose_other_results(client):
    results = many.map_tasks(reciprocal, [1, 2, 0, 4], client=client, retries=0)
    assert results[:2] + results[3:] == [1.0, 0.5, 0.25]
    assert isinstance(results[2], ZeroDivisionError)


def reciprocal(value):
    return 1 / value


def test_table_of_jobs_is_run_and_reported(client, recording, tmp_path):
    job = tmp_path / "job.toml"
    job.write_text(f'out = "unused"\n\n[input]\nfiles = "{recording}"\n\n[grid]\npixels = "x=-8:8:0.5,y=-8:8:0.5,z=0"\n')
    table = [
        {"out": str(tmp_path / "a")},
        {"out": str(tmp_path / "b"), "former.error": "-40 dB"},
        {"out": str(tmp_path / "c"), "input.files": str(tmp_path / "gone.cphd")},
    ]
    report = many.run_jobs(job, table, client=client, retries=0)
    assert [row["status"] for row in report] == ["done", "done", "failed"], report
    assert "gone.cphd" in report[2]["error"]
    # A second run reuses finished stages.
    written = {path: path.stat().st_mtime_ns for path in (tmp_path / "a" / "image.zarr" / "done").iterdir()}
    assert written
    assert many.run_jobs(job, table[:1], client=client)[0]["status"] == "done"
    assert written == {path: path.stat().st_mtime_ns for path in written}
