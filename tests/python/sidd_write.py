"""Writes SIDD files of every version and pixel type with sarkit. Usage: sidd_write.py SIDD FOLDER

SIDD is a file of version 3.0 whose metadata are those of all files. FOLDER gets, for each version and pixel type, NAME.nitf; for grey types also NAME.npy, the greys
as complex64 after any look-up table, and NAME.json: fractional rows and columns, and where sarkit's projection puts them (ECF).
"""

import copy
import json
import pathlib
import sys
import warnings

try:
    import lxml.etree
    import numpy as np
    import sarkit.sidd
    import sarkit.sidd.calculations
except ImportError as error:
    sys.exit(f"{error}; install it with: python3 -m pip install 'sarkit[verification]'")

# sarkit warns where a document does not follow its schema: version 1 lacks optional parts here.
warnings.simplefilter("ignore")
SECURITY = {"security": {"clas": "U"}}


def of_version(tree, version):
    """The document in the namespaces and the order of a version."""
    text = lxml.etree.tostring(tree).decode().replace("urn:SIDD:3.0.0", f"urn:SIDD:{version}")
    if version != "1.0.0":
        return lxml.etree.fromstring(text)
    text = text.replace("urn:SICommon:1.0", "urn:SICommon:0.1").replace("urn:us:gov:ic:ism:13", "urn:us:gov:ic:ism")
    root = lxml.etree.fromstring(text)
    own, common = "{urn:SIDD:1.0.0}", "{urn:SICommon:0.1}"
    display, geo = root.find(own + "Display"), root.find(own + "GeoData")
    for element in list(display)[1:]:
        display.remove(element)
    display_remap = lxml.etree.SubElement(lxml.etree.SubElement(display, own + "RemapInformation"), own + "MonochromeDisplayRemap")
    lxml.etree.SubElement(display_remap, own + "RemapType").text = "PEDF"
    coverage = lxml.etree.Element(own + "GeographicAndTarget")
    area = lxml.etree.SubElement(coverage, own + "GeographicCoverage")
    footprint = lxml.etree.SubElement(area, own + "Footprint", size="4")
    for number, corner in enumerate(geo.find(own + "ImageCorners"), 1):
        vertex = lxml.etree.SubElement(footprint, own + "Vertex", index=str(number))
        for name in ("Lat", "Lon"):
            lxml.etree.SubElement(vertex, common + name).text = corner.findtext(common + name)
    lxml.etree.SubElement(area, own + "GeographicInfo")
    root.replace(geo, coverage)
    measurement = root.find(own + "Measurement")
    measurement.remove(measurement.find(own + "ValidData"))
    return root


def write(tree, version, kind, folder):
    root = of_version(copy.deepcopy(tree), version)
    root.find("{*}Display/{*}PixelType").text = kind.split("-")[0]
    # Without the levels of our own files, so that values are greys.
    for parameter in root.findall(".//{*}ModuleParameter"):
        if parameter.get("name") in ("black_db", "white_db"):
            parameter.set("name", "level")
    shape = tuple(int(root.findtext("{*}Measurement/{*}PixelFootprint/{*}" + k)) for k in ("Row", "Col"))
    dtype = sarkit.sidd.PIXEL_TYPES[kind.split("-")[0]]["dtype"]
    ramp = (np.arange(shape[0] * shape[1]) * 7919 % 65536).reshape(shape)
    table, values = None, None
    if kind == "MONO8LU-8":
        table = (255 - np.arange(256) * 3 % 256).astype(np.uint8)
    elif kind == "MONO8LU-16":
        table = (np.arange(256) * 257 % 65521).astype(np.uint16)
    elif kind == "RGB8LU":
        table = np.zeros(256, sarkit.sidd.PIXEL_TYPES["RGB24I"]["dtype"])
    if kind == "RGB24I":
        pixels = np.zeros(shape, dtype)
        pixels["G"] = ramp % 256
    else:
        pixels = (ramp % (65536 if kind == "MONO16I" else 256)).astype(dtype)
        values = pixels if table is None else table[pixels]
    legends = []
    if kind == "MONO8I":
        legends = [sarkit.sidd.NitfLegendMetadata(attach_row=2, attach_col=3, nrows=5, ncols=9, im_subheader_part=SECURITY)]
    metadata = sarkit.sidd.NitfMetadata(
        file_header_part={"ostaid": "test", **SECURITY},
        images=[
            sarkit.sidd.NitfProductImageMetadata(
                xmltree=root.getroottree(), im_subheader_part=SECURITY, de_subheader_part=SECURITY, legends=legends, lookup_table=table
            )
        ],
    )
    name = f"{kind}-{version}"
    with open(folder / f"{name}.nitf", "wb") as file, sarkit.sidd.NitfWriter(file, metadata) as writer:
        writer.write_image(0, pixels)
        for _ in legends:
            writer.write_legend(0, 0, np.full((5, 9), 200, dtype))
    if kind.startswith("RGB"):
        return
    np.save(folder / f"{name}.npy", values.astype("c8"))
    at = np.array([[0, 0], [shape[0] - 1, 0], [0, shape[1] - 1], [3.25, 7.5]], dtype=float)
    ecf = sarkit.sidd.calculations.pixel_to_ecef(root.getroottree(), at)
    (folder / f"{name}.json").write_text(json.dumps({"pixels": at.tolist(), "ecf": ecf.tolist()}))


def main():
    source, folder = map(pathlib.Path, sys.argv[1:])
    with open(source, "rb") as file, sarkit.sidd.NitfReader(file) as reader:
        tree = reader.metadata.images[0].xmltree.getroot()
    for version in ("1.0.0", "2.0.0", "3.0.0"):
        for kind in ("MONO8I", "MONO16I", "MONO8LU-8", "MONO8LU-16", "RGB24I", "RGB8LU"):
            write(tree, version, kind, folder)


main()
