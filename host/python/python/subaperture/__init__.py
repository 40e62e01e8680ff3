"""Radar image formation: from phase history to a focused, measured image.

A recording is opened or simulated, an image is formed within an error bound, measured and saved:

>>> import subaperture as sar
>>> recording = sar.simulate("table-4-1")
>>> image = sar.focus(recording, "x=-8:8:0.25,y=-8:8:0.25,z=0", error_db=-50)
>>> image.array.shape, image.array.dtype
((64, 64), dtype('complex64'))
>>> abs(image.measure()["level_db"]) < 0.1
True

Conventions
-----------
Images are complex64 arrays of rows x columns, rows in ascending y and columns in ascending x. A unit scatterer centred on a pixel and
seen equally by all pulses has the value 1. Positions are float64 metres in the scene frame, x and y in the ground plane, z up. Levels in
dB are ``20 log10`` of magnitudes. A sample of a unit scatterer has the phase ``-2 pi f (path - reference_path) / c``, where the path is the
two-way length from the transmitter to the point to the receiver.

Long work runs on all processors without the interpreter lock. Functions with the argument ``progress`` call it with the finished fraction,
0 to 1, some ten times a second. Ctrl-C stops the work.
"""

from __future__ import annotations

from subaperture._command import command
from subaperture._image import (
    compare,
    focus,
    formers,
    image_plan,
    read_image,
)
from subaperture._motion import (
    MovingTargets,
    autofocus,
    gmti,
    track,
)
from subaperture._native import (
    Autofocus,
    Channels,
    Grid,
    Image,
    Plan,
    Recording,
    Scene,
    Track,
    __version__,
)
from subaperture._recording import (
    open,
    open_channels,
    phase_history,
    phase_history_channels,
    scene,
    simulate,
    simulate_channels,
)
from subaperture._view import Viewer, view
from subaperture.errors import (
    ArgumentError,
    BoundError,
    CommandError,
    MeasurementError,
    MemoryLimitError,
    ReadError,
    SubapertureError,
    SubapertureWarning,
    UnsuitedError,
    WriteError,
)

__all__ = [
    "ArgumentError",
    "Autofocus",
    "BoundError",
    "Channels",
    "CommandError",
    "Grid",
    "Image",
    "MeasurementError",
    "MemoryLimitError",
    "MovingTargets",
    "Plan",
    "ReadError",
    "Recording",
    "Scene",
    "SubapertureError",
    "SubapertureWarning",
    "Track",
    "UnsuitedError",
    "Viewer",
    "WriteError",
    "__version__",
    "autofocus",
    "command",
    "compare",
    "focus",
    "formers",
    "gmti",
    "image_plan",
    "open",
    "open_channels",
    "phase_history",
    "phase_history_channels",
    "read_image",
    "scene",
    "simulate",
    "simulate_channels",
    "track",
    "view",
]
