"""Writes SICD files of later versions with sarkit. Usage: sicd_write.py SICD FOLDER

FOLDER gets NAME.nitf for each version and pixel type, with the metadata of SICD and samples that fill the range of the type.
"""

import pathlib
import sys

try:
    import lxml.etree
    import numpy as np
    import sarkit.sicd
except ImportError as error:
    sys.exit(f"{error}; install it with: python3 -m pip install 'sarkit[verification]'")

SECURITY = {"security": {"clas": "U"}}


def main():
    source, folder = map(pathlib.Path, sys.argv[1:])
    with open(source, "rb") as file, sarkit.sicd.NitfReader(file) as reader:
        text = lxml.etree.tostring(reader.metadata.xmltree).decode()
        samples = reader.read_image()
    own = lxml.etree.QName(lxml.etree.fromstring(text)).namespace
    for namespace, kind in (
        ("urn:SICD:1.4.0", "RE16I_IM16I"),
        ("urn:SICD:1.5", "RE32F_IM32F"),
        ("urn:SICD:1.5", "RE16I_IM16I"),
        ("urn:SICD:1.5", "AMP8I_PHS8I"),
    ):
        root = lxml.etree.fromstring(text.replace(own, namespace))
        root.find("{*}ImageData/{*}PixelType").text = kind
        dtype = sarkit.sicd.PIXEL_TYPES[kind]["dtype"]
        scaled = samples / np.abs(samples).max()
        if dtype.names is None:
            pixels = samples
        else:
            pixels = np.zeros(samples.shape, dtype)
            if "real" in dtype.names:
                pixels["real"], pixels["imag"] = scaled.real * 32767, scaled.imag * 32767
            else:
                pixels["amp"], pixels["phase"] = np.abs(scaled) * 255, np.angle(scaled) / (2 * np.pi) * 256 % 256
        metadata = sarkit.sicd.NitfMetadata(
            xmltree=root.getroottree(),
            file_header_part={"ostaid": "test", **SECURITY},
            im_subheader_part={"isorce": "test", **SECURITY},
            de_subheader_part=SECURITY,
        )
        name = f"{namespace.split(':')[2]}-{kind}.nitf"
        with open(folder / name, "wb") as file, sarkit.sicd.NitfWriter(file, metadata) as writer:
            writer.write_image(pixels)


main()
