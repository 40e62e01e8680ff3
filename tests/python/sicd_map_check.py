"""Checks by sarkit and GDAL where SICD images of anyone are put on the Earth and on maps. Usage: sicd_map_check.py LIST

Each line of LIST is one of these, separated by tabs:

places JSON   JSON holds a SICD's XML and places: metres along rows and columns, a height above the ellipsoid, and latitude and longitude that were found there.
              sarkit projects the metres to the surface of that height: both have to be within a millimetre of each other.
same MAP MAP  Two maps of one image, read in two ways: amplitudes may differ by a hundredth of the greatest.
peak MAP SICD The map's brightest pixel of those within four samples of where sarkit projects the image's brightest sample, at the height of the scene centre point, has to lie
              within one of it, and to be as bright within 1.5 dB, which lie between samples that are no finer than their band needs.
"""

import json
import pathlib
import sys

try:
    import lxml.etree
    import numpy as np
    import pyproj
    import rasterio
    import sarkit.sicd
    import sarkit.sicd.projection as projection
except ImportError as error:
    sys.exit(f"{error}; install it with: python3 -m pip install -r tests/requirements.txt")

TO_ECF = pyproj.Transformer.from_crs("EPSG:4979", "EPSG:4978", always_xy=True)


def ground(params, along, height):
    """ECF of image places on a surface of constant height. One by one: sarkit 1.8 takes the bistatic delays of several as one."""
    found = []
    for place in np.atleast_2d(along):
        sets = projection.compute_projection_sets(params, place[None])
        one, _, _ = projection.r_rdot_to_constant_hae_surface(params.LOOK, params.SCP, sets, height, bistat_delta_gp_gpp=1e-5)
        found.append(one[0])
    return np.array(found)


def places(path):
    told = json.loads(pathlib.Path(path).read_text())
    params = projection.MetadataParams.from_xml(lxml.etree.ElementTree(lxml.etree.fromstring(told["xml"].encode())))
    worst = 0.0
    for place in told["places"]:
        expected = ground(params, place["along_m"], place["height_m"])[0]
        found = np.array(TO_ECF.transform(place["longitude_deg"], place["latitude_deg"], place["height_m"]))
        worst = max(worst, np.linalg.norm(found - expected))
    print(f"{told['name']}: {len(told['places'])} places at most {worst:.1e} m off")
    return len(told["places"]) > 10 and worst < 1e-3


def same(one, two):
    with rasterio.open(one) as a, rasterio.open(two) as b:
        assert a.crs == b.crs and a.res == b.res, (a.crs, b.crs, a.res, b.res)
        left, top = max(a.bounds.left, b.bounds.left), min(a.bounds.top, b.bounds.top)
        right, bottom = min(a.bounds.right, b.bounds.right), max(a.bounds.bottom, b.bounds.bottom)
        windows = [f.window(left, bottom, right, top).round_offsets().round_lengths() for f in (a, b)]
        p, q = (f.read(1, window=w) for f, w in zip((a, b), windows))
    both = np.isfinite(p) & np.isfinite(q)
    off = np.abs(p - q)[both].max() / np.nanmax(p)
    share = both.sum() / max(np.isfinite(p).sum(), np.isfinite(q).sum())
    print(f"{one}, {two}: {p.shape} pixels, {share:.3f} of them on both, {off:.1e} off")
    return p.shape == q.shape and share > 0.98 and off < 1e-2


def peak(path, sicd):
    with open(sicd, "rb") as file, sarkit.sicd.NitfReader(file) as reader:
        tree = reader.metadata.xmltree
        samples = reader.read_image()
    if samples.dtype.names:
        samples = samples["real"].astype("c8") + 1j * samples["imag"].astype("c8")
    root = tree.getroot()
    number = lambda key: float(root.findtext("{*}" + key.replace("/", "/{*}")))
    at = np.array(np.unravel_index(np.abs(samples).argmax(), samples.shape))
    first = np.array([number("ImageData/FirstRow"), number("ImageData/FirstCol")])
    centre = np.array([number("ImageData/SCPPixel/Row"), number("ImageData/SCPPixel/Col")])
    spacing = np.array([number("Grid/Row/SS"), number("Grid/Col/SS")])
    params = projection.MetadataParams.from_xml(tree)
    height = number("GeoData/SCP/LLH/HAE")
    steps = np.array([[0, 0], [1, 0], [0, 1]]) * spacing
    points = ground(params, (at + first - centre) * spacing + steps, height)
    sides = np.linalg.norm(points[1:] - points[0], axis=1)
    with rasterio.open(path) as file:
        values = file.read(1)
        to = pyproj.Transformer.from_crs(file.crs, "EPSG:4979", always_xy=True)
        rows, columns = np.mgrid[: values.shape[0], : values.shape[1]]
        longitudes, latitudes = to.transform(*file.xy(rows.ravel(), columns.ravel()))
    found = np.stack(TO_ECF.transform(longitudes, latitudes, np.full(len(latitudes), height)), axis=1)
    distances = np.linalg.norm(found - points[0], axis=1)
    near = np.where(distances < 4 * np.linalg.norm(sides), np.nan_to_num(values.ravel()), 0)
    apart = distances[near.argmax()]
    level = 20 * np.log10(near.max() / np.abs(samples).max())
    print(f"{path}: {values.shape} pixels, the brightest {apart:.2f} m from its sample's place, of {sides.round(2)} m, {level:+.2f} dB")
    return apart < np.linalg.norm(sides) and abs(level) < 1.5


good = True
for line in pathlib.Path(sys.argv[1]).read_text(encoding="utf-8").splitlines():
    kind, *paths = line.split("\t")
    good &= bool({"places": places, "same": same, "peak": peak}[kind](*paths))
sys.exit(not good)
