"""Interactive viewer of images in a web browser or a notebook."""

from __future__ import annotations

import atexit
import json
import os
import subprocess
import sys
import tempfile
from typing import Any

from subaperture._native import Image
from subaperture.errors import CommandError

__all__ = ["Viewer", "view"]


class Viewer:
    """Running viewer. A notebook shows its page.

    Attributes
    ----------
    url : str
        Address of the page, with a secret. It is served to this machine only.
    """

    def __init__(self, process: subprocess.Popen[str], url: str, folder: tempfile.TemporaryDirectory[str] | None) -> None:
        self._process = process
        self._folder = folder
        self.url = url
        atexit.register(self.close)

    def close(self) -> None:
        """Stop the viewer."""
        self._process.terminate()
        self._process.wait()
        if self._process.stdout is not None:
            self._process.stdout.close()
        if self._folder is not None:
            self._folder.cleanup()
        atexit.unregister(self.close)

    def __enter__(self) -> Viewer:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _repr_html_(self) -> str:
        return f'<iframe src="{self.url}" width="100%" height="600"></iframe>'

    def __repr__(self) -> str:
        return f"<Viewer at {self.url}>"


def view(*images: Image | str | os.PathLike[str]) -> Viewer:
    """Start the viewer of the command ``subap view``.

    Parameters
    ----------
    *images : Image or path
        Images from :func:`focus`, which are saved to a temporary folder, or paths of images.

    Returns
    -------
    Viewer
        Close it, or use it in a ``with`` statement. It ends with the Python process.
    """
    folder = tempfile.TemporaryDirectory() if any(isinstance(image, Image) for image in images) else None
    paths: list[str] = []
    for number, image in enumerate(images, start=1):
        if isinstance(image, Image):
            assert folder is not None
            path = os.path.join(folder.name, f"image-{number}")
            image.save(path)
            paths.append(path)
        else:
            paths.append(os.fspath(image))
    words = [sys.executable, "-m", "subaperture", "view", "--json", *paths]
    errors = tempfile.TemporaryFile("w+")
    process = subprocess.Popen(words, stdout=subprocess.PIPE, stderr=errors, text=True)
    assert process.stdout is not None
    text = ""
    for line in process.stdout:
        text += line
        try:
            found: Any = json.loads(text)
        except ValueError:
            continue
        if "url" in found:
            return Viewer(process, found["url"], folder)
    status = process.wait()
    errors.seek(0)
    message = errors.read().strip()
    if folder is not None:
        folder.cleanup()
    raise CommandError(message or f"exit status {status}", status)
