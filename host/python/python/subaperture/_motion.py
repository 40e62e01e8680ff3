"""Autofocus, tracks, moving targets."""

from __future__ import annotations

import dataclasses
from typing import Any

from subaperture import _native
from subaperture._image import request
from subaperture._native import Autofocus, Channels, Grid, Track
from subaperture._recording import Memory, Progress, RecordingLike, open_channels

__all__ = ["MovingTargets", "autofocus", "gmti", "track"]


def autofocus(
    recording: RecordingLike,
    grid: Grid | str | None = None,
    *,
    method: str = "pga",
    rounds: int | None = None,
    keep_unjudged: bool = False,
    former: str = "auto",
    window: str | None = None,
    slow_window: str | None = None,
    memory: Memory | None = None,
    progress: Progress | None = None,
    **options: Any,
) -> Autofocus:
    """Estimate phase errors or the track by autofocus, judged on held-out data.

    Parameters
    ----------
    recording : Recording or path
        Recording of one channel.
    grid : Grid or str, optional
        Grid of the images. Default: that of :func:`focus`.
    method : str
        ``"pga"`` (phase gradient), ``"mpga-image"`` (modified phase gradient: displacements), ``"sharpness"`` or ``"map-drift"``.
    rounds : int, optional
        Largest number of rounds.
    keep_unjudged : bool
        Keep a correction that no held-out data can judge.
    former, window, slow_window, memory, progress, **options
        As for :func:`focus`.

    Returns
    -------
    Autofocus
    """
    return _native.autofocus(request(locals()), method=method, rounds=rounds, keep_unjudged=keep_unjudged)


def _channels(channels: Channels | RecordingLike) -> Channels:
    return channels if isinstance(channels, Channels) else open_channels(channels)


def track(
    channels: Channels | RecordingLike,
    *,
    range_m: tuple[float, float] | None = None,
    targets: int | None = None,
    min_snr_db: float | None = None,
    progress: Progress | None = None,
) -> Track:
    """Estimate the radar's track from its own echoes (MPGA).

    Parameters
    ----------
    channels : Channels or path
        Channels of several receivers.
    range_m : pair of float, optional
        Range interval of the targets, metres. Default: all.
    targets : int, optional
        Largest number of targets.
    min_snr_db : float, optional
        Smallest signal-to-noise ratio of a target, dB.
    progress : callable, optional
        Called with the finished fraction, 0 to 1.

    Returns
    -------
    Track

    Raises
    ------
    UnsuitedError
        Also if residuals contradict the track.
    """
    return _native.track(_channels(channels), range_m=range_m, targets=targets, min_snr_db=min_snr_db, progress=progress)


@dataclasses.dataclass(frozen=True)
class MovingTargets:
    """Moving targets of a recording.

    Attributes
    ----------
    geojson : dict
        GeoJSON feature collection, the strongest target first. Properties contain the radial velocity (``radial_velocity_m_s``, positive when
        approaching), signal-to-noise ratio, position and their standard deviations.
    grid : Grid
        Grid of the images in which the targets were detected.
    """

    geojson: dict[str, Any]
    grid: Grid

    @property
    def targets(self) -> list[dict[str, Any]]:
        """Properties of each target."""
        return [feature["properties"] for feature in self.geojson["features"]]

    def __len__(self) -> int:
        return len(self.geojson["features"])


def gmti(
    channels: Channels | RecordingLike,
    grid: Grid | str | None = None,
    *,
    false_alarms: float | None = None,
    sub_cpis: int | None = None,
    max_speed_m_s: float | None = None,
    window: str | None = None,
    slow_window: str | None = None,
    memory: Memory | None = None,
    progress: Progress | None = None,
) -> MovingTargets:
    """Detect moving targets in several channels (GMTI).

    Parameters
    ----------
    channels : Channels or path
        Channels of receivers apart along the track.
    grid : Grid or str, optional
        Grid of the images. Default: that of :func:`focus`.
    false_alarms : float, optional
        Probability of false alarm of a cell. Default: 1e-6.
    sub_cpis : int, optional
        Number of sub-CPIs whose maps are integrated, for targets of any velocity. Default: detection in the images.
    max_speed_m_s : float, optional
        Largest speed searched with `sub_cpis`, metres per second.
    window, slow_window, memory, progress
        As for :func:`focus`.

    Returns
    -------
    MovingTargets
    """
    several = _channels(channels)
    arguments = {"recording": several[0], **locals()}
    geojson, used = _native.gmti(several, arguments, false_alarms=false_alarms, sub_cpis=sub_cpis, max_speed_m_s=max_speed_m_s)
    return MovingTargets(geojson, used)
