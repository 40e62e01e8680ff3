"""Checks maps with GDAL (rasterio) and rio-cogeo. Usage: maps_check.py FOLDER

FOLDER has db.tif, amplitude.tif, complex.tif and amplitude-geographic.tif of one image, map.kmz of it in one picture, tiles.kmz of one in tiles,
picture.png with its world file, and expected.json:

- origin: latitude, longitude (degrees) and height of the scene's origin, as its scenario has it, x east and y north of it;
- point_m: where the scenario has its brightest point;
- level_db: the greatest level of the image's pixels.

Nothing of Subaperture is called. Places are projected by PROJ.
"""

import json
import math
import pathlib
import sys
import warnings
import xml.etree.ElementTree as ET
import zipfile

try:
    import numpy as np
    import pyproj
    import rasterio
    import rio_cogeo.cogeo
    from rasterio.io import MemoryFile
    from rasterio.warp import transform

    # Pictures in an archive say nowhere where they are: its documents do.
    warnings.simplefilter("ignore", rasterio.errors.NotGeoreferencedWarning)
except ImportError as error:
    sys.exit(f"{error}; install it with: python3 -m pip install rio-cogeo")

KML = "{http://www.opengis.net/kml/2.2}"
FOLDER = pathlib.Path(sys.argv[1])
FAULTS = []


def check(holds, what):
    print("ok  " if holds else "BAD ", what)
    if not holds:
        FAULTS.append(what)


def on_the_earth(origin, position_m):
    """Latitude and longitude of a place east, north and up of an origin."""
    to_ecf = pyproj.Transformer.from_crs("EPSG:4979", "EPSG:4978", always_xy=True)
    lat, lon = math.radians(origin["latitude_deg"]), math.radians(origin["longitude_deg"])
    axes = np.array([
        [-math.sin(lon), math.cos(lon), 0],
        [-math.sin(lat) * math.cos(lon), -math.sin(lat) * math.sin(lon), math.cos(lat)],
        [math.cos(lat) * math.cos(lon), math.cos(lat) * math.sin(lon), math.sin(lat)],
    ])
    centre = to_ecf.transform(origin["longitude_deg"], origin["latitude_deg"], origin["height_m"])
    longitude, latitude, _ = to_ecf.transform(*(centre + np.array(position_m) @ axes), direction="INVERSE")
    return {"latitude_deg": latitude, "longitude_deg": longitude}


def at(dataset, place):
    """Row and column, with fractions, of a place: 0.5 is the middle of the first pixel."""
    [x], [y] = transform("EPSG:4326", dataset.crs, [place["longitude_deg"]], [place["latitude_deg"]])
    column, row = ~dataset.transform * (x, y)
    return row, column


def peak(values):
    """Where the peak of the power is: the vertex of a parabola through the greatest and its neighbours, as edges of pixels count."""
    power = np.nan_to_num(np.abs(values).astype(float) ** 2)
    row, column = np.unravel_index(np.argmax(power), power.shape)

    def vertex(a, b, c):
        return 0.5 * (a - c) / (a - 2 * b + c)

    down = vertex(*power[row - 1 : row + 2, column])
    along = vertex(*power[row, column - 1 : column + 2])
    return row + 0.5 + down, column + 0.5 + along


def tiff(name, expected):
    path = FOLDER / name
    valid, errors, doubts = rio_cogeo.cogeo.cog_validate(path, strict=True, quiet=True)
    check(valid and not errors and not doubts, f"{name}: rio-cogeo finds it valid {errors} {doubts}")
    with rasterio.open(path) as dataset:
        check(dataset.crs.to_epsg() == expected, f"{name}: EPSG:{dataset.crs.to_epsg()}")
        bands, tags = dataset.read(), dataset.tags(ns="IMAGE_STRUCTURE")
        check(tags.get("LAYOUT") == "COG" and tags.get("COMPRESSION") == "DEFLATE", f"{name}: {tags}")
        return dataset.profile, bands, dataset.transform


def overviews(name, power_of):
    """Each overview against the mean power of what lies below it, of its own pixels."""
    path = FOLDER / name
    with rasterio.open(path) as dataset:
        count = len(dataset.overviews(1))
        finer = power_of(dataset.read(1))
    check(count > 0, f"{name}: {count} overviews")
    for level in range(count):
        with rasterio.open(path, OVERVIEW_LEVEL=level) as dataset:
            own = power_of(dataset.read(1))
        rows, columns = own.shape
        padded = np.full((2 * rows, 2 * columns), np.nan)
        padded[: finer.shape[0], : finer.shape[1]] = finer
        quarters = padded.reshape(rows, 2, columns, 2)
        seen = np.isfinite(quarters)
        sums = np.where(seen, quarters, 0).sum(axis=(1, 3))
        counts = seen.sum(axis=(1, 3))
        check(np.array_equal(counts > 0, np.isfinite(own)), f"{name}, overview {level}: it is where the map is")
        mean = sums[counts > 0] / counts[counts > 0]
        worst = np.max(np.abs(own[counts > 0] / mean - 1))
        # Float32 amplitudes, squared here: some 2e-7.
        check(worst < 1e-6, f"{name}, overview {level}: power is the mean, to {worst:.1e}")
        finer = own


def maps(point, level_db):
    _, [amplitude], where = tiff("amplitude.tif", 32631)
    with rasterio.open(FOLDER / "amplitude.tif") as dataset:
        row, column = at(dataset, point)
        value = next(dataset.sample([dataset.transform * (column, row)]))[0]
    got = peak(amplitude)
    # A parabola through three samples at about half the resolution is off by less than 0.1 of a pixel.
    check(math.dist(got, (row, column)) < 0.1, f"amplitude.tif: the peak is at {got}, the point at {(row, column)}")
    # Sampled at its pixel, half a pixel from the peak at the most: 3 dB.
    best = 20 * math.log10(np.nanmax(amplitude))
    check(20 * math.log10(value) > best - 3, f"amplitude.tif at the point: {20 * math.log10(value):.2f} dB of {best:.2f} dB")
    # Between pixels at half the resolution lie 1.5 dB.
    check(abs(best - level_db) < 1.5, f"amplitude.tif: the peak is {best:.2f} dB, the image's brightest pixel {level_db:.2f} dB")

    _, [re, im], _ = tiff("complex.tif", 32631)
    same = np.isfinite(amplitude)
    check(np.array_equal(same, np.isfinite(re)), "complex.tif has values where amplitude.tif has")
    worst = np.max(np.abs(np.hypot(re, im)[same] - amplitude[same])) / np.nanmax(amplitude)
    check(worst < 1e-6, f"complex.tif: magnitudes are the amplitudes, to {worst:.1e}")

    profile, [db], _ = tiff("db.tif", 32631)
    with rasterio.open(FOLDER / "db.tif") as dataset:
        scale, offset, unit = dataset.scales[0], dataset.offsets[0], dataset.units[0]
    check(unit == "dB" and profile["nodata"] == 0 and np.array_equal(db > 0, same), "db.tif: decibels, and 0 elsewhere")
    expected = 20 * np.log10(np.maximum(amplitude[same], 1e-30))
    got = db[same] * scale + offset
    clipped = np.clip(expected, 1 * scale + offset, 255 * scale + offset)
    check(np.max(np.abs(got - clipped)) < 0.51 * scale, f"db.tif: levels to half a step of {scale:.3f} dB")

    _, [geographic], _ = tiff("amplitude-geographic.tif", 4326)
    with rasterio.open(FOLDER / "amplitude-geographic.tif") as dataset:
        place = at(dataset, point)
    got = peak(geographic)
    check(math.dist(got, place) < 0.1, f"amplitude-geographic.tif: the peak is at {got}, the point at {place}")

    item = json.loads((FOLDER / "amplitude.json").read_text())
    west, south, east, north = item["bbox"]
    check(west < point["longitude_deg"] < east and south < point["latitude_deg"] < north, "amplitude.json: the box has the point")
    check(item["properties"]["proj:transform"] == list(where)[:6], "amplitude.json: GDAL's transform")


def box(element):
    return {side: float(element.findtext(KML + side)) for side in ("north", "south", "east", "west")}


def in_overlay(edges, shape, place):
    """Row and column of a place in a picture that is stretched over a box."""
    down = (edges["north"] - place["latitude_deg"]) / (edges["north"] - edges["south"])
    along = (place["longitude_deg"] - edges["west"]) / (edges["east"] - edges["west"])
    return down * shape[0], along * shape[1]


def picture(archive, name):
    with MemoryFile(archive.read(name)) as memory, memory.open() as dataset:
        return dataset.read()


def overlays(point):
    with zipfile.ZipFile(FOLDER / "map.kmz") as archive:
        check(archive.namelist()[0] == "doc.kml", "map.kmz begins with doc.kml")
        root = ET.fromstring(archive.read("doc.kml"))
        [overlay] = root.iter(KML + "GroundOverlay")
        grey, alpha = picture(archive, overlay.findtext(f"{KML}Icon/{KML}href"))
        edges = box(overlay.find(KML + "LatLonBox"))
        with rasterio.open(FOLDER / "amplitude-geographic.tif") as dataset:
            bounds, seen = dataset.bounds, np.isfinite(dataset.read(1))
        pixel = (edges["north"] - edges["south"]) / grey.shape[0]
        off = max(abs(getattr(bounds, {"north": "top", "south": "bottom", "east": "right", "west": "left"}[side]) - edges[side]) for side in edges)
        check(off < 1e-6 * pixel, f"map.kmz: edges are the map's, to {off / pixel:.1e} of a pixel")
        check(np.array_equal(alpha == 255, seen), "map.kmz is opaque where the image is")
        row, column = map(int, in_overlay(edges, grey.shape, point))
        around = grey[row - 1 : row + 2, column - 1 : column + 2]
        check(around.max() == grey.max(), f"map.kmz: the point's pixel {row}, {column} is the brightest, but for one")

    with zipfile.ZipFile(FOLDER / "tiles.kmz") as archive:
        names, links, finest = set(archive.namelist()), [], {}

        def walk(name, outer, depth):
            root = ET.fromstring(archive.read(name))
            edges = outer
            for overlay in root.iter(KML + "GroundOverlay"):
                edges = box(overlay.find(KML + "LatLonBox"))
                href = overlay.findtext(f"{KML}Icon/{KML}href")
                names.discard(href)
                grey, alpha = picture(archive, href)
                finest[href] = (depth, edges, grey)
            names.discard(name)
            for link in root.iter(KML + "NetworkLink"):
                region = box(link.find(f"{KML}Region/{KML}LatLonAltBox"))
                links.append(region)
                walk(link.findtext(f"{KML}Link/{KML}href"), edges, depth + 1)
                inner = finest_of(link.findtext(f"{KML}Link/{KML}href"))
                check(region == inner, f"tiles.kmz: the region of {link.findtext(KML + 'name')} is its overlay's")

        def finest_of(href):
            return finest[href.removesuffix(".kml") + ".png"][1]

        walk("doc.kml", None, 0)
        check(not names, f"tiles.kmz: everything is linked {names}")
        depth = max(level for level, _, _ in finest.values())
        tiles = [tile for tile in finest.values() if tile[0] == depth]
        inside = [
            (edges, grey) for _, edges, grey in tiles
            if edges["south"] < point["latitude_deg"] < edges["north"] and edges["west"] < point["longitude_deg"] < edges["east"]
        ]
        check(len(inside) == 1 and depth > 1, f"tiles.kmz: {len(tiles)} tiles at depth {depth}, one has the point")
        [(edges, grey)] = inside
        row, column = map(int, in_overlay(edges, grey.shape, point))
        around = grey[max(row - 1, 0) : row + 2, max(column - 1, 0) : column + 2]
        brightest = max(grey.max() for _, _, grey in tiles)
        check(around.max() == brightest, "tiles.kmz: the point is the brightest pixel of all")


def world_file(point):
    with rasterio.open(FOLDER / "picture.png") as dataset:
        grey, where = dataset.read(1), dataset.transform
    with rasterio.open(FOLDER / "amplitude.tif") as dataset:
        same = np.allclose(where, dataset.transform, rtol=0, atol=1e-6)
        row, column = map(int, at(dataset, point))
    check(same, "picture.pgw says what the GeoTIFF says")
    check(grey[row - 1 : row + 2, column - 1 : column + 2].max() == grey.max(), "picture.png: the point is the brightest")
    system = rasterio.crs.CRS.from_wkt((FOLDER / "picture.prj").read_text())
    check(system.to_epsg(confidence_threshold=20) == 32631, f"picture.prj: EPSG:{system.to_epsg(confidence_threshold=20)}")


expected = json.loads((FOLDER / "expected.json").read_text())
POINT = on_the_earth(expected["origin"], expected["point_m"])
maps(POINT, expected["level_db"])
overviews("overviews.tif", lambda amplitude: amplitude.astype(float) ** 2)
overlays(POINT)
world_file(POINT)
sys.exit(f"{len(FAULTS)} checks fail" if FAULTS else 0)
