"""Exceptions of the package.

Every error is a :class:`SubapertureError` with a ``code``, a stable word for programs. Messages state what was expected, what was found, where,
and what to do.
"""

from __future__ import annotations

from typing import ClassVar

__all__ = [
    "ArgumentError",
    "BoundError",
    "CommandError",
    "MeasurementError",
    "MemoryLimitError",
    "ReadError",
    "SubapertureError",
    "SubapertureWarning",
    "UnsuitedError",
    "WriteError",
]


class SubapertureError(Exception):
    """Base class of all errors of the package."""

    code: ClassVar[str] = "error"


class ArgumentError(SubapertureError, ValueError):
    """Invalid argument, or arguments that do not fit together."""

    code: ClassVar[str] = "argument"


class ReadError(SubapertureError, OSError):
    """File that cannot be read, or that violates its format."""

    code: ClassVar[str] = "read"


class WriteError(SubapertureError, OSError):
    """File that cannot be written. No incomplete file remains."""

    code: ClassVar[str] = "write"


class MemoryLimitError(SubapertureError, MemoryError):
    """Work that needs more memory than the limit."""

    code: ClassVar[str] = "memory"


class UnsuitedError(SubapertureError):
    """Recording, grid or settings that the method does not support."""

    code: ClassVar[str] = "unsuited"


class BoundError(SubapertureError):
    """Image whose predicted error exceeds the error bound."""

    code: ClassVar[str] = "bound"


class MeasurementError(SubapertureError):
    """Measurement or picture that the image does not permit."""

    code: ClassVar[str] = "measurement"


class CommandError(SubapertureError):
    """Failure of the command ``subap``.

    Attributes
    ----------
    status : int
        Exit status: 1 failed, 2 wrong usage, 130 interrupted.
    """

    code: ClassVar[str] = "command"

    def __init__(self, message: str, status: int) -> None:
        super().__init__(message)
        self.status = status


class SubapertureWarning(UserWarning):
    """Warning about the quality of an image."""
