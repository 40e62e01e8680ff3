"""Accessor ``sar`` of xarray's DataArrays: levels, multilook and plots of complex images.

``Image.to_xarray`` registers it. For arrays of other origin, such as the Zarr stores of ``subap``, import this module:

>>> import numpy as np, xarray
>>> import subaperture.xarray
>>> image = xarray.DataArray(np.full((4, 6), 3 + 4j), dims=("y", "x"))
>>> image.sar.multilook(2, 3).sar.db().round(2).values.tolist()
[[13.98, 13.98], [13.98, 13.98]]
"""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray

from subaperture import _display
from subaperture.errors import ArgumentError

__all__ = ["Accessor"]


@xarray.register_dataarray_accessor("sar")  # type: ignore[no-untyped-call, unused-ignore]
class Accessor:
    """Methods ``array.sar.db()`` and others of a DataArray of complex pixels or magnitudes.

    Selected parts (``sel``, ``isel``) and results of arithmetic keep them.
    """

    def __init__(self, array: xarray.DataArray) -> None:
        self._array = array

    def db(self) -> xarray.DataArray:
        """Level of each pixel, ``20 log10 |z|``, dB; -inf for zeros. Coordinates and attributes are kept."""
        level = self._array.copy(data=_display.level_db(self._array.data))
        level.attrs.update(long_name="level", units="dB")
        return level

    def multilook(self, rows: int, columns: int) -> xarray.DataArray:
        """Root of the mean power of boxes of pixels, which reduces speckle.

        Parameters
        ----------
        rows, columns : int
            Pixels of a box. Incomplete boxes at the last row and column are left out.

        Returns
        -------
        xarray.DataArray
            Magnitudes; coordinates are the centres of the boxes.
        """
        row, column = self._dims()
        counts = {row: rows, column: columns}
        for name, count in counts.items():
            if not 1 <= count <= self._array.sizes[name]:
                raise ArgumentError(f"multilook: expected 1 to {self._array.sizes[name]} pixels along {name}, found {count}")
        power = self._array.copy(data=np.abs(self._array.data) ** 2)
        mean: xarray.DataArray = power.coarsen(counts, boundary="trim").mean()  # type: ignore[attr-defined, unused-ignore]
        looks = mean.copy(data=np.sqrt(mean.data))
        looks.attrs.update(self._array.attrs, long_name="multilooked magnitude", looks=[rows, columns])
        return looks

    def plot(self, ax: Any = None, *, dynamic_range_db: float = 60.0, **options: Any) -> Any:
        """Draw the level with Matplotlib, in equal proportions if both coordinates have one unit.

        Parameters
        ----------
        ax, dynamic_range_db, **options
            As for ``Image.plot``.

        Returns
        -------
        matplotlib.axes.Axes
        """
        named = [(name, self._unit(name), self._array[name].values) for name in self._dims()]
        title = str(self._array.attrs.get("title", ""))
        level = _display.level_db(self._array.values)
        return _display.draw(level, (named[0], named[1]), title, ax, dynamic_range_db, options)

    def _dims(self) -> tuple[str, str]:
        names = [str(name) for name in self._array.dims]
        if len(names) != 2:
            raise ArgumentError(f"expected an image of rows x columns, found the dimensions {', '.join(names) or 'none'}: select one image first")
        return names[0], names[1]

    def _unit(self, name: str) -> str:
        return str(self._array[name].attrs.get("units", "1"))
