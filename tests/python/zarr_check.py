"""Opens a stack by zarr and xarray, as their users do, and compares it with the products that it is of.

    zarr_check.py STACK.zarr PRODUCT...
"""

import json
import pathlib
import sys
import warnings

import numpy as np
import xarray
import zarr

warnings.simplefilter("error")  # one about metadata that have to be searched for, too


def product(folder):
    record = json.loads((folder / "image.json").read_text())
    if (folder / "image.npy").exists():
        return record, np.load(folder / "image.npy")
    return record, zarr.open_array(folder / "image.zarr", mode="r")[:]


def main():
    path, *folders = map(pathlib.Path, sys.argv[1:])
    products = [product(folder) for folder in folders]
    with xarray.open_zarr(path, chunks=None) as stack:
        image = stack["image"]
        assert image.dims == ("stack", "y", "x") and image.dtype == np.complex64, image
        assert image.shape == (len(products), *products[0][1].shape), image.shape
        for n, (record, pixels) in enumerate(products):
            assert np.array_equal(image[n].values.view("u4"), pixels.view("u4")), f"image {n} differs"
            assert stack.attrs["sources"][n]["inputs"] == record["inputs"]
        grid = products[0][0]["grid"]
        for name, axis in (("y", grid["rows"]), ("x", grid["columns"])):
            wanted = axis["start"] + axis["step"] * np.arange(axis["count"])
            assert np.allclose(stack[name].values, wanted, rtol=0, atol=1e-9), name
            assert stack[name].attrs["units"] == "m"
        starts = [record["antennas"].get("start_ns") for record, _ in products]
        if None in starts:
            assert "time" not in stack
        else:
            # xarray reads the units and makes dates of them.
            assert np.array_equal(stack["time"].values, np.array(starts, "datetime64[ns]")), stack["time"]
        # Each value by its place, as a user asks for it.
        peak = np.unravel_index(np.abs(products[0][1]).argmax(), products[0][1].shape)
        at = image.isel(stack=0).sel(y=float(stack["y"][peak[0]]), x=float(stack["x"][peak[1]])).item()
        assert at == products[0][1][peak]
        places = stack.attrs["geospatial_lat_min"], stack.attrs["geospatial_lat_max"]
        corners = np.array(stack.attrs["corners_lat_lon_height"])
        assert places[0] == corners[:, 0].min() and places[1] == corners[:, 0].max()
    group = zarr.open_group(path, mode="r")
    assert set(group) == {"image", "y", "x", "stack"} | ({"time"} if None not in starts else set()), set(group)
    print(f"{path.name}: {image.shape} by xarray {xarray.__version__} and zarr {zarr.__version__}, chunks {group['image'].chunks}")


main()
