"""Calls of the command ``subap`` in a process of its own."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from typing import Any

from subaperture.errors import CommandError

__all__ = ["command"]

BOUND_MISSED = 3


def command(*arguments: str | os.PathLike[str], threads: int | None = None) -> Any:
    """Run ``subap`` and return its result.

    Parameters
    ----------
    *arguments : str or path
        Arguments as on the command line, without ``--json``, such as ``"export", "image", "--out", "image.tif"``.
    threads : int, optional
        Number of worker threads. Default: one per processor.

    Returns
    -------
    object
        The JSON result of the command: a dictionary, the text of commands that write one, such as ``"simulate", "--example", "walk"``, or
        None.

    Raises
    ------
    CommandError
        With the command's message. An image that exceeds an allowed error bound (exit status 3) is no error.

    Examples
    --------
    >>> import subaperture as sar
    >>> sar.command("reproduce", "--list")["items"][0]["source"]
    'Schone 2020, Table 2.1'
    """
    words = [sys.executable, "-m", "subaperture", *[os.fspath(argument) for argument in arguments], "--json"]
    if threads is not None:
        words += ["--threads", str(threads)]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    if done.returncode not in (0, BOUND_MISSED):
        raise CommandError(done.stderr.strip() or f"exit status {done.returncode}", done.returncode)
    if not done.stdout.strip():
        return None
    try:
        return json.loads(done.stdout)
    except ValueError:
        return done.stdout
