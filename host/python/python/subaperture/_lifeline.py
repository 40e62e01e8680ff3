"""The command ``subap`` in a process that ends with the process that started it.

The starting process holds the writing end of a pipe that is the standard input of this process. The operating system closes it when that
process ends, even by SIGKILL. Files are written under temporary names, so that no incomplete file remains in place.
"""

from __future__ import annotations

import os
import signal
import sys
import threading

from subaperture._native import command


def _end_with_input() -> None:
    while os.read(0, 4096):
        pass
    os.kill(os.getpid(), getattr(signal, "SIGKILL", signal.SIGTERM))


if __name__ == "__main__":
    threading.Thread(target=_end_with_input, daemon=True).start()
    sys.exit(command(["subap", *sys.argv[1:]]))
