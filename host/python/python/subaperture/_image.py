"""Image formation, images of files, comparison."""

from __future__ import annotations

import os
import warnings
from typing import Any

import numpy.typing as npt

from subaperture import _native
from subaperture._native import Grid, Image, Plan
from subaperture._recording import Memory, PathLike, Progress, RecordingLike, as_recording
from subaperture.errors import SubapertureWarning

__all__ = ["compare", "focus", "formers", "image_plan", "read_image"]


def request(arguments: dict[str, Any]) -> dict[str, Any]:
    """Arguments of an image for the native module, by name."""
    surface = arguments.get("surface")
    if isinstance(surface, os.PathLike):
        arguments = {**arguments, "surface": f"dem:{os.fspath(surface)}"}
    return {**arguments, "recording": as_recording(arguments["recording"])}


def focus(
    recording: RecordingLike,
    grid: Grid | str | None = None,
    *,
    surface: PathLike | None = None,
    geoid: float | PathLike | None = None,
    troposphere: str | None = None,
    velocity_m_s: npt.ArrayLike | None = None,
    motion: PathLike | npt.ArrayLike | None = None,
    phase_rad: PathLike | npt.ArrayLike | None = None,
    former: str = "auto",
    window: str | None = None,
    slow_window: str | None = None,
    beam: float | str | None = None,
    squint_deg: float | None = None,
    doppler_band_hz: float | None = None,
    doppler_centroid_hz: float | None = None,
    antenna_weights: str = "none",
    memory: Memory | None = None,
    portable: bool = False,
    allow_error: bool = False,
    progress: Progress | None = None,
    **options: Any,
) -> Image:
    """Form an image within an error bound.

    Parameters
    ----------
    recording : Recording, path, list of paths, or reader of sarkit or sarpy
        Phase history; a path is opened by :func:`open`.
    grid : Grid or str, optional
        Pixel grid, such as ``"x=-50:50:0.2,y=-50:50:0.2,z=0"`` (start, stop, step in metres). Default: the recording's extent at half its
        resolution.
    surface : str or path, optional
        Surface of the pixels: ``"plane"``, that of the grid (default); ``"slant"``, the slant plane of the collection (x of the grid is then
        cross-range, y range); ``"hae"`` or ``"hae:120"``, a height above the ellipsoid in metres, by default that of the grid's origin;
        ``"dem:FILE"``, an elevation model (SRTM ``.hgt``, GeoTIFF) or a folder of them. Pixels of the last two are moved vertically from the grid.
    geoid : float or path, optional
        Geoid undulation that is added to the heights of an elevation model: metres, or a file in a format of elevation models. Default: 0.
    troposphere : str, optional
        Tropospheric delay to be removed, relative to the recording's reference point: ``"exponential"`` or ``"exponential:N"``, a profile with a
        refractivity of N parts per million at sea level, 313 by default. Default: ``"none"``.
    velocity_m_s : array of 2 or 3, optional
        Velocity of the targets to be focused, metres per second; pixels are positions at the first pulse. Default: stationary.
    motion : array, n x 4, or path, optional
        Alternative to `velocity_m_s`: times in seconds and positions of the target in metres over the time of all pulses, or a CSV with the columns
        ``time_s,x_m,y_m,z_m``. Only differences of positions count.
    phase_rad : array, pulses, or path, optional
        Phase error of each pulse to be removed, radians, or a file of ``subap autofocus``.
    former : str
        Name of the image former, one of :func:`formers`. ``"auto"`` takes the fastest that keeps the bound.
    window, slow_window : str, optional
        Windows over frequencies and over pulses: ``"none"``, ``"taylor"``, ``"taylor:DB"``, ``"hamming"`` or ``"kaiser:BETA"``. Default:
        Taylor, 35 dB.
    beam : float or str, optional
        Full width of the antenna's azimuth beam, degrees, that selects the pulses of each pixel; ``"auto"`` estimates it,
        ``"none"`` uses all pulses. Default: the beam stated by the recording, or the one that its Doppler spectrum clearly shows.
    squint_deg : float, optional
        Squint of the beam forward of broadside, degrees.
    doppler_band_hz : float, optional
        Processed Doppler bandwidth, hertz, in place of ``beam``.
    doppler_centroid_hz : float, optional
        Doppler centroid of that band, hertz, positive for echoes from forward of broadside. Default: the middle of the beam stated by the recording, or
        the centroid of the Doppler spectrum.
    antenna_weights : str
        ``"matched"`` weights pulses by the antenna patterns of the recording and divides each pixel by the response of a point scatterer, which then
        reads its amplitude anywhere in the beam. ``"none"`` ignores the patterns.
    memory : int or str, optional
        Memory limit for image, samples and scratch, in bytes or as ``"2G"``. Default: half of the machine's memory.
    portable : bool
        Make results bit-identical on all machines; transforms are slower.
    allow_error : bool
        Return an image whose predicted error exceeds the bound, with a warning, instead of raising :class:`BoundError`.
    progress : callable, optional
        Called with the finished fraction, 0 to 1.
    **options
        Options of the former, such as ``error_db=-50``; :func:`formers` lists them.

    Returns
    -------
    Image

    Raises
    ------
    BoundError, UnsuitedError, MemoryLimitError, ArgumentError, ReadError

    Warns
    -----
    SubapertureWarning
        For each sentence of ``Image.warnings``.
    """
    image = _native.focus(request(locals()))
    for warning in image.warnings:
        warnings.warn(warning, SubapertureWarning, stacklevel=2)
    return image


def image_plan(
    recording: RecordingLike,
    grid: Grid | str | None = None,
    *,
    surface: PathLike | None = None,
    geoid: float | PathLike | None = None,
    troposphere: str | None = None,
    former: str = "auto",
    window: str | None = None,
    slow_window: str | None = None,
    beam: float | str | None = None,
    squint_deg: float | None = None,
    doppler_band_hz: float | None = None,
    doppler_centroid_hz: float | None = None,
    antenna_weights: str = "none",
    scratch: Memory | None = None,
    portable: bool = False,
    allow_error: bool = False,
    progress: Progress | None = None,
    **options: Any,
) -> Plan:
    """Plan an image in tiles, which any number of processes can form.

    Parameters
    ----------
    scratch : int or str, optional
        Memory for tables and buffers of one thread, which the plan depends on. Default: 48 MiB.
    recording, grid, surface, geoid, troposphere, former, window, slow_window, beam, squint_deg, doppler_band_hz, doppler_centroid_hz, antenna_weights, portable, allow_error, progress, **options
        As for :func:`focus`. Processes that form the tiles with ``subap focus --plan`` need ``--troposphere`` again: it changes the recording, which a
        plan does not contain.

    Returns
    -------
    Plan
    """
    return _native.plan(request(locals()))


def formers() -> list[dict[str, Any]]:
    """Image formers: name, summary and options of each.

    Examples
    --------
    >>> import subaperture as sar
    >>> [former["name"] for former in sar.formers()]
    ['exact', 'auto', 'bp', 'rdbp', 'ffbp', 'pfa', 'omega-k', 'rda']
    """
    return _native.formers_table()


def read_image(path: str | os.PathLike[str], *, memory: Memory | None = None) -> Image:
    """Read an image into memory.

    Parameters
    ----------
    path : str or path
        Folder of ``subap focus``, complex64 array (``.npy``), SICD, SIDD, GeoTIFF or Zarr, recognised by content.
    memory : int or str, optional
        Memory limit of the pixels, in bytes or as ``"2G"``. Default: half of the machine's memory.

    Returns
    -------
    Image
    """
    return _native.read_image(os.fspath(path), memory=memory)


def compare(image: Image, reference: Image) -> dict[str, Any]:
    """Compare two images: relative RMS error, correlation, scale.

    Parameters
    ----------
    image, reference : Image
        Images on one grid. Images read from files may be on different grids; they are related by their metadata.

    Returns
    -------
    dict
        ``error_db`` is the relative RMS error, phase included, dB; None for equal images.
    """
    return _native.compare_images(image, reference)
