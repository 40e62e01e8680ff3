"""Recordings from files, arrays and simulations."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from typing import Any, TypeAlias

from subaperture import _native
from subaperture._native import Channels, Recording, Scene
from subaperture.errors import ArgumentError

__all__ = [
    "RecordingLike",
    "as_recording",
    "open",
    "open_channels",
    "phase_history",
    "phase_history_channels",
    "scene",
    "simulate",
    "simulate_channels",
]

PathLike: TypeAlias = "str | os.PathLike[str]"
RecordingLike: TypeAlias = "Recording | PathLike | Sequence[PathLike] | Any"
Memory: TypeAlias = "int | str"
Progress: TypeAlias = "Callable[[float], Any]"


def _pairs(settings: Mapping[str, object] | None) -> list[tuple[str, str]]:
    return [(key, str(value)) for key, value in (settings or {}).items()]


def _path(source: Any) -> str:
    """Path of a file: a path, or a reader of sarkit or sarpy, which holds the open file or its name."""
    if isinstance(source, (str, os.PathLike)):
        return os.fspath(source)
    for name in ("file_name", "_file_object", "_file_handle"):
        held = getattr(source, name, None)
        held = getattr(held, "name", held)
        if isinstance(held, str):
            return held
    raise ArgumentError(f"expected a path, or a CPHD reader of sarkit or sarpy, found {type(source).__name__}")


def open(
    path: RecordingLike,
    *,
    channel: str | None = None,
    settings: Mapping[str, object] | None = None,
    memory: Memory | None = None,
) -> Recording:
    """Open a recording, or several as one aperture.

    Parameters
    ----------
    path : path, URL, list of them, or reader of sarkit or sarpy
        CPHD 1.x, CRSD 1.0, NISAR L0B, GOTCHA (MATLAB 5), arrays (``.npz``, HDF5), or a description of raw samples (``.toml``), recognised by content.
        Several files make one aperture, ordered by time or, without times, by angle. URLs such as ``s3://bucket/recording.cphd`` are opened by
        fsspec: CPHD, CRSD and HDF5 are read by ranges of bytes, in blocks of 4 MiB, and 8 blocks are kept; GOTCHA and ``.npz`` are read whole.
    channel : str, optional
        Channel by its name, or its number from 1. Default: the reference channel of a CPHD or CRSD, the first channel of L0B and arrays, all channels
        of a description in order of time.
    settings : mapping, optional
        Keys of a description of raw samples with values that override them, such as ``{"radar.first_pulse": "9.2 s"}``.
    memory : int or str, optional
        Memory limit in bytes, or a text such as ``"2G"``. Default: half of the machine's memory.

    Returns
    -------
    Recording

    Raises
    ------
    ReadError
        For a damaged file, an unknown format, or samples whose phase convention is neither stated nor clear.
    ArgumentError
        For an unknown channel or setting, or files that do not make one aperture.
    MemoryLimitError
    """
    several = path if isinstance(path, Sequence) and not isinstance(path, str) else [path]
    paths = [_path(each) for each in several]
    return _native.open_recording(paths, channel=channel, settings=_pairs(settings), memory=memory)


def open_channels(
    path: RecordingLike,
    *,
    names: Sequence[str] | None = None,
    settings: Mapping[str, object] | None = None,
    memory: Memory | None = None,
) -> Channels:
    """Open the channels of a recording: receivers, transmitters or polarisations that share their pulses.

    Parameters
    ----------
    path : path, or reader of sarkit or sarpy
        As for :func:`open`.
    names : sequence of str, optional
        Names of the channels. Default: all.
    settings, memory
        As for :func:`open`.

    Returns
    -------
    Channels
    """
    wanted = None if names is None else list(names)
    return _native.open_channels(_path(path), names=wanted, settings=_pairs(settings), memory=memory)


def as_recording(recording: RecordingLike) -> Recording:
    """The recording, or the one opened from a path."""
    return recording if isinstance(recording, Recording) else open(recording)


def phase_history(
    samples: Any,
    *,
    frequency_hz: Any = None,
    start_hz: Any = None,
    step_hz: Any = None,
    antenna_m: Any = None,
    transmitter_m: Any = None,
    receiver_m: Any = None,
    sign: int | None = None,
    reference_path_m: Any = None,
    reference_m: Any = None,
    recorded_path_m: Any = None,
    time_s: Any = None,
    origin_deg_m: Any = None,
    extent_m: Any = None,
    check: bool = False,
    name: str = "arrays",
    memory: Memory | None = None,
) -> Recording:
    """Recording from arrays.

    A unit scatterer at ``p`` has the sample ``exp(sign 2j pi f (path - reference_path_m[n]) / c)`` with
    ``path = |p - transmitter_m[n]| + |p - receiver_m[n]|``.

    Small images infer a sign or reference path that is not stated. If both are stated, no image is formed.

    Parameters
    ----------
    samples : array of complex, pulses x frequencies
        Echo of each pulse at each frequency, with its phase: not range profiles or magnitudes.
    frequency_hz : array, frequencies
        Frequencies in hertz, equally spaced and ascending.
    start_hz, step_hz : float, or array of pulses
        Alternative to `frequency_hz`: first frequency and step, hertz.
    antenna_m : array, pulses x 3
        Antenna positions in metres, if one antenna transmits and receives.
    transmitter_m, receiver_m : array, pulses x 3
        Alternative to `antenna_m`: positions of both antennas, metres.
    sign : -1 or 1, optional
        Sign of the phase. Default: inferred from the sharpness of a small image, or refused.
    reference_path_m : float, or array of pulses, optional
        Two-way path that the phase is compensated to, metres; 0 for raw echoes. Default: inferred or refused, as for `sign`.
    reference_m : array, 3 or pulses x 3, optional
        Alternative to `reference_path_m`: point that the phase is compensated to, metres.
    recorded_path_m : array of 2, or pulses x 2, optional
        Shortest and longest two-way path of the echoes that the samples contain completely, metres. Pixels outside are zero. Default: the
        unambiguous interval ``c / step_hz`` about `reference_path_m`; for raw echoes every pixel is formed.
    time_s : array, pulses, optional
        Time of each pulse, seconds, not descending.
    origin_deg_m : array of 3, optional
        Latitude, longitude (degrees) and height above the WGS 84 ellipsoid (metres) of the origin; x is then east, y north, z up.
    extent_m : array of 4, optional
        Area to be imaged: minimum and maximum x, minimum and maximum y, metres. Images that infer or check the phase convention lie within it.
    check : bool
        Compare a stated phase convention with others by small images, which takes seconds; ``Recording.warnings`` names a clearly sharper one. A
        constant error of the reference path moves the image in range and keeps it sharp: the check cannot find it.
    name : str
        Name of the recording.
    memory : int or str, optional
        As for :func:`open`.

    Returns
    -------
    Recording

    Raises
    ------
    ReadError
        Names the array that is missing or wrong, also where the phase convention is neither stated nor clear.

    Examples
    --------
    One scatterer at the origin, seen from 1 km:

    >>> import numpy as np, subaperture as sar
    >>> f = 10e9 + 1e6 * np.arange(128)
    >>> a = np.column_stack([np.linspace(-40, 40, 128), np.full(128, -1000.0), np.zeros(128)])
    >>> path = 2 * np.linalg.norm(a, axis=1)
    >>> s = np.exp(-2j * np.pi * f * path[:, None] / 299792458.0)
    >>> recording = sar.phase_history(s, frequency_hz=f, antenna_m=a, sign=-1, reference_path_m=0.0)
    >>> sar.focus(recording, "x=-8:8:0.25,y=-8:8:0.5,z=0").shape
    (32, 64)
    """
    arrays = dict(locals())
    del arrays["check"], arrays["name"], arrays["memory"]
    channels = _native.phase_history(name, arrays, check=check, memory=memory)
    if len(channels) != 1:
        raise ArgumentError(
            f"samples: expected pulses x frequencies, found {len(channels)} channels; use phase_history_channels for channels x pulses x frequencies"
        )
    return channels[0]


def phase_history_channels(
    samples: Any, *, check: bool = False, name: str = "arrays", memory: Memory | None = None, **arrays: Any
) -> Channels:
    """Channels from arrays.

    Parameters
    ----------
    samples : array of complex, channels x pulses x frequencies
        Samples of each channel, as for :func:`phase_history`.
    **arrays
        Arguments of :func:`phase_history`. `transmitter_m` and `receiver_m` may have the shape channels x pulses x 3, `reference_path_m` the
        shape channels x pulses.
    check, name, memory
        As for :func:`phase_history`.

    Returns
    -------
    Channels
    """
    return _native.phase_history(name, {"samples": samples, **arrays}, check=check, memory=memory)


def simulate_channels(
    scenario: PathLike,
    *,
    settings: Mapping[str, object] | None = None,
    seed: int | None = None,
    memory: Memory | None = None,
    progress: Progress | None = None,
) -> Channels:
    """Simulate a scenario with every pair of transmitter and receiver.

    Parameters
    ----------
    scenario : str or path
        Name of a preset (``"table-2-1"`` or ``"table-4-1"`` of Schone 2020) or of an example (such as ``"spotlight"`` or ``"gmti"``), path of a
        scenario (``.toml``), or the text of one. ``subap simulate --keys`` prints all keys of a scenario.
    settings : mapping, optional
        Keys with values that override them, such as ``{"radar.pri": "2 ms"}``. Not for presets.
    seed : int, optional
        Seed of all random effects.
    memory : int or str, optional
        As for :func:`open`.
    progress : callable, optional
        Called with the finished fraction, 0 to 1.

    Returns
    -------
    Channels
        Samples in memory.

    Raises
    ------
    ArgumentError
        Contains every fault of a scenario, with line and key.
    """
    return _native.simulate(_source(scenario, settings, seed, memory), progress=progress)


def _source(scenario: PathLike, settings: Mapping[str, object] | None, seed: int | None, memory: Memory | None) -> dict[str, Any]:
    """Scenario for the native module."""
    text = os.fspath(scenario)
    kind = "path" if text.endswith(".toml") else "scenario" if "=" in text else "name"
    return {kind: text, "settings": _pairs(settings) if settings else None, "seed": seed, "memory": memory}


def scene(
    scenario: PathLike,
    *,
    settings: Mapping[str, object] | None = None,
    seed: int | None = None,
    memory: Memory | None = None,
) -> Scene:
    """Scene of a simulation: the true positions, amplitudes and motions of its targets.

    Parameters
    ----------
    scenario, settings, seed, memory
        As for :func:`simulate`. The same arguments give the scene of that recording.

    Returns
    -------
    Scene
        Clutter with internal motion (key ``velocity_spread``) is left out.

    Examples
    --------
    >>> import subaperture as sar
    >>> scene = sar.scene("table-4-1")
    >>> scene.point_m.shape, set(abs(scene.point_amplitude).tolist())
    ((41, 3), {1.0})
    """
    return _native.scene(_source(scenario, settings, seed, memory))


def simulate(
    scenario: PathLike,
    *,
    settings: Mapping[str, object] | None = None,
    seed: int | None = None,
    memory: Memory | None = None,
    progress: Progress | None = None,
) -> Recording:
    """Simulate a scenario with one transmitter and one receiver.

    Parameters
    ----------
    scenario, settings, seed, memory, progress
        As for :func:`simulate_channels`.

    Returns
    -------
    Recording
        Samples in memory.

    Raises
    ------
    ArgumentError
        Also for several channels: use :func:`simulate_channels`.

    Examples
    --------
    >>> import subaperture as sar
    >>> sar.simulate("table-4-1")
    <Recording 'table-4-1': 1040 pulses x 256 samples>
    """
    channels = simulate_channels(scenario, settings=settings, seed=seed, memory=memory, progress=progress)
    if len(channels) != 1:
        raise ArgumentError(f"expected a scenario of one channel, found {len(channels)}: use simulate_channels")
    return channels[0]
