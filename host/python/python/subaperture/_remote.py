"""Files at URLs, read by ranges of bytes with fsspec."""

from __future__ import annotations

import re
from typing import Any

__all__ = ["RemoteFile", "is_url"]

#: Keys of fsspec's file information that change with the content, in order of preference.
VERSIONS = ("ETag", "etag", "generation", "md5Hash", "LastModified", "last_modified", "mtime", "updated")


def is_url(path: str) -> bool:
    """Whether a path is a URL such as ``s3://bucket/file``, not a path on a drive of one letter."""
    return re.match(r"[A-Za-z0-9+.:-]{2,}://", path) is not None


class RemoteFile:
    """File at a URL; called by the native module."""

    def __init__(self, url: str) -> None:
        try:
            from fsspec.core import url_to_fs  # type: ignore[import-untyped, unused-ignore]
        except ImportError as error:
            raise ImportError("reading URLs needs fsspec: pip install fsspec") from error
        self._system: Any
        self._system, self._path = url_to_fs(url)

    def state(self) -> tuple[int, str]:
        """Size in bytes, and a text that changes with the content."""
        self._system.invalidate_cache(self._path)
        about = self._system.info(self._path)
        if about.get("type") == "directory":
            raise IsADirectoryError("expected a file, found a folder")
        size = about.get("size")
        if size is None:
            raise OSError("expected the size of the file, found none in the answer of its server")
        version = next((f"{key} {about[key]}" for key in VERSIONS if about.get(key)), None)
        return int(size), version or str(self._system.ukey(self._path))

    def read(self, offset: int, count: int) -> bytes:
        """Bytes from `offset` on."""
        read = self._system.cat_file(self._path, start=offset, end=offset + count)
        if len(read) != count:
            raise OSError(f"expected {count} bytes from byte {offset}, found {len(read)}: does the server serve ranges?")
        return bytes(read)
