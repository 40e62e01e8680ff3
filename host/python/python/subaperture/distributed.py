"""Images, runs and sweeps on many machines, by Dask distributed.

An image is planned in tiles once. Each task forms some of the tiles: a worker runs ``subap focus --plan`` for them in a process of its own, which
reads the pulses, forms the tiles, and writes each to the folder of the image as a whole Zarr chunk, under a temporary name that is renamed at
the end. Tasks are idempotent: a tile that exists is not formed again, and the tiles of lost workers are formed by others. The pixels are
bit-identical to those of one machine. The last task measures the error, and writes the record and the picture.

The folder must have the same path on all workers, such as that of a shared file system, and the recording the same path or URL. From a URL, such
as ``s3://bucket/recording.cphd``, a worker reads by fsspec the ranges of bytes with the pulses of its tiles.

Machines without Dask share the same work by ``subap focus --plan PLAN --tiles I/N``, one process for each part.
"""

from __future__ import annotations

import math
import os
import subprocess
import sys
import uuid
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeVar

from subaperture._command import BOUND_MISSED
from subaperture._image import image_plan
from subaperture._native import Grid, Plan
from subaperture._recording import Memory, PathLike, as_recording
from subaperture._remote import is_url
from subaperture.errors import ArgumentError, CommandError, WriteError

if TYPE_CHECKING:
    from distributed import Client

__all__ = ["Estimate", "estimate", "focus", "map_tasks", "num_tasks", "run_jobs"]

Item = TypeVar("Item")
Result = TypeVar("Result")

#: Name of the file with the plan in the folder of an image.
PLAN = "plan.json"


def _run(words: Sequence[str], threads: int) -> None:
    """Run the command in a process that ends with this one."""
    process = subprocess.Popen(
        [sys.executable, "-m", "subaperture._lifeline", *words, "--threads", str(threads), "--quiet"],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    # Not communicate(), which closes the standard input at once.
    assert process.stdin is not None and process.stdout is not None and process.stderr is not None
    with process.stdin, process.stdout as output, process.stderr as errors:
        output.read()
        message = errors.read().strip()
        status = process.wait()
    if status not in (0, BOUND_MISSED):
        raise CommandError(message or f"exit status {status}", status)


def _tile(paths: Sequence[str], plan: str, out: str, part: str, memory: str, threads: int) -> str:
    """Form one part of the tiles of a plan; the body of a task."""
    _run(["focus", *paths, "--plan", plan, "--tiles", part, "--out", out, "--memory", memory], threads)
    return part


def _client(client: Client | None) -> Client:
    if client is not None:
        return client
    from distributed import Client, LocalCluster, get_client

    try:
        return get_client()
    except ValueError:
        return Client(LocalCluster(threads_per_worker=1))


def focus(
    recording: PathLike | Sequence[PathLike],
    grid: Grid | str | None = None,
    *,
    out: PathLike,
    client: Client | None = None,
    memory: Memory = "1G",
    threads: int = 1,
    task_s: float = 10.0,
    retries: int = 10,
    progress: Callable[[float], Any] | None = None,
    plan: Plan | None = None,
    troposphere: str | None = None,
    **options: Any,
) -> str:
    """Form an image on the workers of a cluster.

    Parameters
    ----------
    recording : path, URL or list of them
        Recording, at the same path or URL on all workers.
    grid : Grid or str, optional
        Pixel grid. Default: that of :func:`subaperture.focus`.
    out : path
        Folder of the image, at the same path on all workers. Tiles of the same plan that it contains are kept.
    client : distributed.Client, optional
        Connection to a cluster. Default: the current client, else a new LocalCluster with a worker per processor.
    memory : int or str
        Memory limit of each task, bytes or a text such as ``"2G"``.
    threads : int
        Threads of each task.
    task_s : float
        Time of a task by the plan's cost model, seconds, on one core. A task forms as many tiles as take this time, at least one.
    retries : int
        Number of times that a failed task is repeated. A lost worker's tasks are repeated by others.
    progress : callable, optional
        Called with the finished fraction of the tasks, 0 to 1.
    plan : Plan, optional
        Plan of the image, as from :func:`subaperture.image_plan` with the same recording. Default: planned here from `grid` and `options`.
    troposphere : str, optional
        As for :func:`subaperture.focus`; also required with a `plan` that was made with it.
    **options
        Arguments of :func:`subaperture.image_plan`, such as ``error_db=-50``.

    Returns
    -------
    str
        The folder, as :func:`subaperture.read_image` and ``subap`` read it.

    Raises
    ------
    CommandError
        The error of a task, after its retries. Finished tiles are kept.
    """
    from distributed import KilledWorker, as_completed

    paths = [os.fspath(path) for path in ([recording] if isinstance(recording, (str, os.PathLike)) else recording)]
    folder = os.path.abspath(os.fspath(out))
    if plan is None:
        plan = image_plan(paths, grid, troposphere=troposphere, **options)
    elif grid is not None or options:
        raise ArgumentError("focus: expected a plan, or a grid and options, found both")
    stored = _store_plan(folder, plan)
    if _is_complete(folder, plan):
        return folder
    cluster = _client(client)
    count = num_tasks(plan, task_s)
    paths = [path if is_url(path) else os.path.abspath(path) for path in paths]
    if troposphere is not None:
        paths += ["--troposphere", troposphere]
    run = uuid.uuid4().hex

    def submitted(number: int, attempt: int) -> Any:
        part = f"{number}/{count}"
        arguments = (paths, stored, folder, part, str(memory), threads)
        return cluster.submit(_tile, *arguments, key=f"subap-{run}-{number}-{attempt}", retries=retries, pure=False)

    running = as_completed([submitted(number, 0) for number in range(1, count + 1)])
    attempts: dict[str, int] = {}
    done = 0
    try:
        for future in running:
            error = future.exception()
            if isinstance(error, KilledWorker) and attempts.get(future.key, 0) < retries:
                # The scheduler gives up a task after a few lost workers.
                number, attempt = (int(part) for part in future.key.split("-")[2:])
                again = submitted(number, attempt + 1)
                attempts[again.key] = attempt + 1
                running.add(again)
                continue
            future.result()
            done += 1
            if progress is not None:
                progress(done / count)
    except BaseException:
        cluster.cancel(list(running.futures))
        raise
    if not os.path.exists(os.path.join(folder, "image.json")):
        # Several tasks ended at once, and none saw the tiles of all others.
        _tile(paths, stored, folder, f"1/{count}", str(memory), threads)
    return folder


def _is_complete(folder: str, plan: Plan) -> bool:
    """Whether the record of the image and all its tiles exist."""
    marks = os.path.join(folder, "image.zarr", "done")
    has_record = os.path.exists(os.path.join(folder, "image.json"))
    return has_record and os.path.isdir(marks) and len(os.listdir(marks)) >= plan.num_tiles


def num_tasks(plan: Plan, task_s: float = 10.0) -> int:
    """Number of tasks of about `task_s` seconds each on one core, at most one for each tile."""
    if not task_s > 0:
        raise ArgumentError(f"task_s: expected seconds above 0, found {task_s}")
    return max(1, min(plan.num_tiles, math.ceil(plan.core_s / task_s)))


def _store_plan(folder: str, plan: Plan) -> str:
    """Write the plan beside the tiles; one with another plan is refused."""
    os.makedirs(folder, exist_ok=True)
    path = os.path.join(folder, PLAN)
    text = plan.text
    if os.path.exists(path):
        with open(path, encoding="utf-8") as file:
            if file.read() != text:
                raise WriteError(f"{path}: expected the same plan, found another: use another folder, or remove this one")
        return path
    partial = f"{path}.{os.getpid()}.tmp"
    with open(partial, "w", encoding="utf-8") as file:
        file.write(text)
    os.replace(partial, path)
    return path


@dataclass(frozen=True)
class Estimate:
    """Forecast of an image on many workers.

    Attributes
    ----------
    workers, tasks : int
        Number of workers and of tasks.
    seconds : float
        Time from the first to the last task: the model's time of all tiles in turns of `workers`, and `overhead_s` for each task.
    core_seconds : float
        Sum of the times of all tasks.
    bytes_read, bytes_written : int
        Samples read by all tasks, and pixels written.
    cost : float or None
        Price of the core hours, in the currency of `price_per_core_hour`.
    """

    workers: int
    tasks: int
    seconds: float
    core_seconds: float
    bytes_read: int
    bytes_written: int
    cost: float | None


def estimate(
    recording: PathLike | Sequence[PathLike] | Any,
    plan: Plan,
    workers: int,
    *,
    memory: Memory = "1G",
    task_s: float = 10.0,
    overhead_s: float = 0.2,
    price_per_core_hour: float | None = None,
) -> Estimate:
    """Forecast tasks, bytes, time and cost of an image, without forming any tile.

    Parameters
    ----------
    recording : Recording or path
        Recording of the plan.
    plan : Plan
        Plan of the image.
    workers : int
        Number of workers of one core each.
    memory : int or str
        Memory limit of each task.
    task_s : float
        Time of a task, as for :func:`focus`.
    overhead_s : float
        Time of a task apart from its tile, seconds: start of the process, opening of the recording, scheduling.
    price_per_core_hour : float, optional
        Price of one core for one hour.

    Returns
    -------
    Estimate
    """
    if workers < 1:
        raise ArgumentError(f"workers: expected a number from 1, found {workers}")
    history = as_recording(recording)
    tasks = num_tasks(plan, task_s)
    pulses = plan.pulses_read(history, list(range(plan.num_tiles)), memory=memory)
    rows, columns = plan.tile_shape
    each = plan.core_s / tasks + overhead_s
    core_seconds = each * tasks
    return Estimate(
        workers=workers,
        tasks=tasks,
        seconds=-(-tasks // workers) * each,
        core_seconds=core_seconds,
        bytes_read=sum(pulses) * history.shape[1] * 8,
        bytes_written=plan.num_tiles * rows * columns * 8,
        cost=None if price_per_core_hour is None else core_seconds / 3600 * price_per_core_hour,
    )


def map_tasks(
    function: Callable[[Item], Result],
    items: Iterable[Item],
    *,
    client: Client | None = None,
    retries: int = 3,
    progress: Callable[[float], Any] | None = None,
) -> list[Result | BaseException]:
    """Call a function for each item on the workers: stacks of recordings, sweeps of a setting, Monte Carlo trials.

    Parameters
    ----------
    function : callable
        Function of one item, whose result fits into memory. It is repeated if a worker is lost, so it must be repeatable.
    items : iterable
        Arguments: paths, values of a setting, seeds.
    client, retries, progress
        As for :func:`focus`.

    Returns
    -------
    list
        Result of each item in their order, or the exception of an item that failed: one failure does not lose the other results.
    """
    from distributed import as_completed

    arguments = list(items)
    cluster = _client(client)
    futures = cluster.map(function, arguments, retries=retries, pure=False)
    places = {future.key: place for place, future in enumerate(futures)}
    results: list[Result | BaseException] = [RuntimeError("not finished")] * len(arguments)
    for done, future in enumerate(as_completed(futures), start=1):
        error = future.exception()
        results[places[future.key]] = future.result() if error is None else error
        if progress is not None:
            progress(done / len(arguments))
    return results


def _job(words: tuple[list[str], int]) -> None:
    arguments, threads = words
    _run(arguments, threads)


def run_jobs(
    job: PathLike,
    table: Sequence[Mapping[str, object]],
    *,
    client: Client | None = None,
    threads: int = 1,
    memory: Memory = "1G",
    retries: int = 3,
    progress: Callable[[float], Any] | None = None,
) -> list[dict[str, Any]]:
    """Run one processing pipeline (``subap run``) for each row of a table.

    Parameters
    ----------
    job : path
        TOML file of the pipeline, at the same path on all workers.
    table : sequence of mappings
        Keys of the job with the values of each row, such as ``{"input.files": "a.cphd", "out": "a"}``. Rows that ran before are not
        repeated, as finished stages are reused.
    client, threads, memory, retries, progress
        As for :func:`focus`.

    Returns
    -------
    list of dict
        One report: each row with ``status`` (``"done"`` or ``"failed"``) and ``error``.
    """
    path = os.path.abspath(os.fspath(job))
    rows = [
        (["run", path, *[word for key, value in row.items() for word in ("--set", f"{key}={_toml(value)}")], "--memory", str(memory)], threads)
        for row in table
    ]
    results = map_tasks(_job, rows, client=client, retries=retries, progress=progress)
    return [
        {**row, "status": "done", "error": None} if result is None else {**row, "status": "failed", "error": str(result)}
        for row, result in zip(table, results, strict=True)
    ]


def _toml(value: object) -> str:
    """Value as TOML writes it."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(_toml(each) for each in value) + "]"
    if isinstance(value, (int, float)):
        return repr(value)
    text = str(value).replace("\\", "\\\\").replace('"', '\\"')
    return f'"{text}"'
