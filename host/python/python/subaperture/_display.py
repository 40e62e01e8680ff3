"""Plots and labelled arrays of images."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

if TYPE_CHECKING:
    import xarray

    from subaperture._native import Image

__all__ = ["axes", "draw", "level_db", "plot", "to_xarray"]

#: Name, unit and values of an axis.
Axis: TypeAlias = "tuple[str, str, Any]"


def level_db(array: Any) -> Any:
    """Level of complex values, ``20 log10 |z|``, dB; -inf for zeros."""
    with np.errstate(divide="ignore"):
        return 20.0 * np.log10(np.abs(array))


def axes(image: Image) -> tuple[Axis, Axis]:
    """Name, unit and values of rows and of columns."""
    grid = image.grid
    if grid is None:
        rows, columns = image.shape
        return ("row", "1", np.arange(rows)), ("column", "1", np.arange(columns))
    if grid.is_cartesian:
        return ("y", "m", grid.rows), ("x", "m", grid.columns)
    return ("range", "m", grid.rows), ("angle", "rad", grid.columns)


def plot(image: Image, ax: Any = None, *, dynamic_range_db: float = 60.0, **options: Any) -> Any:
    """Draw the level of an image with Matplotlib; the body of ``Image.plot``."""
    return draw(level_db(image.array), axes(image), image.title, ax, dynamic_range_db, options)


def draw(level: Any, named: tuple[Axis, Axis], title: str, ax: Any, dynamic_range_db: float, options: dict[str, Any]) -> Any:
    """Draw levels in dB over named rows and columns."""
    import matplotlib.pyplot as plt

    if ax is None:
        ax = plt.gca()
    (row, row_unit, rows), (column, column_unit, columns) = named
    top = float(np.max(level, initial=-np.inf, where=np.isfinite(level)))
    options = {"cmap": "gray", "vmin": top - dynamic_range_db, "vmax": top, **options}
    half = [0.5 * abs(float(axis[1] - axis[0])) if len(axis) > 1 else 0.5 for axis in (columns, rows)]
    extent = (columns[0] - half[0], columns[-1] + half[0], rows[0] - half[1], rows[-1] + half[1])
    aspect = "equal" if column_unit == row_unit else "auto"
    drawn = ax.imshow(level, origin="lower", extent=extent, aspect=aspect, **options)
    ax.set_xlabel(f"{column} ({column_unit})" if column_unit != "1" else column)
    ax.set_ylabel(f"{row} ({row_unit})" if row_unit != "1" else row)
    ax.set_title(title)
    ax.figure.colorbar(drawn, ax=ax, label="level (dB)")
    return ax


def to_xarray(image: Image) -> xarray.DataArray:
    """Image as a DataArray with coordinates, units and attributes; the body of ``Image.to_xarray``."""
    import xarray

    import subaperture.xarray  # noqa: F401 (registers the accessor)

    named = axes(image)
    coords = {name: (name, values, {"units": unit}) for name, unit, values in named}
    attributes: dict[str, Any] = {"long_name": "complex image", "units": "1", "title": image.title}
    if image.origin_deg_m is not None:
        attributes["origin_latitude_deg"], attributes["origin_longitude_deg"], attributes["origin_height_m"] = image.origin_deg_m
    if image.predicted_error_db is not None:
        attributes["predicted_error_db"] = image.predicted_error_db
    return xarray.DataArray(image.array, dims=[name for name, _, _ in named], coords=coords, name="image", attrs=attributes)
