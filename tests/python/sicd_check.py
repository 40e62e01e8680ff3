"""Checks SICD files with sarkit. Usage: sicd_check.py LIST

Each line of LIST is FILE and IMAGE, separated by a tab: a SICD and the folder with image.npy and image.json that it was made of; or, where IMAGE ends in .npy, the
samples that were read of it, which have to be those that sarkit reads, to a float32's rounding where phases are stored as such; or, where IMAGE is -, only the
checks of 1 run.

1. Every check of sarkit's sicdcheck runs on the file; any failure fails, but of sampling by more than 2.2 or less than 1.1, which the image's user chose.
2. sarkit reads the samples. By the XML alone (SCP, unit vectors, spacings) each is at a place, and has to be the sample of image.npy at that place, to the bit.
3. sarkit projects the brightest pixel to the plane of the image's grid: it has to be within 0.1 m of where image.json says that it is.
4. The samples' spectrum, by a DFT with the sign Sgn, is where KCtr and DeltaK1 and DeltaK2 say, and its middle where the radar's frequencies and the line of sight put it.
"""

import json
import pathlib
import sys

try:
    import numpy as np
    import sarkit.sicd
    import sarkit.sicd.projection
    import sarkit.verification
except ImportError as error:
    sys.exit(f"{error}; install it with: python3 -m pip install 'sarkit[verification]'")

C = 299792458.0


def xyz(element):
    return np.array([float(element.findtext("{*}" + axis)) for axis in "XYZ"])


def check(path):
    with open(path, "rb") as file:
        checker = sarkit.verification.SicdConsistency.from_file(file)
        checker.check()
    failures = checker.failures(omit_passed_sub=True)
    print(f"{path}: {len(checker.passes())} checks pass, {len(failures)} fail")
    good = True
    for name, result in failures.items():
        for detail in result["details"]:
            print("   ", detail["severity"], name, detail["details"], detail["message"])
        good &= name.startswith("check_iprbw_to_ss_osr")
    return good


def compare(path, folder):
    record = json.loads((folder / "image.json").read_text())
    image = np.load(folder / "image.npy")
    with open(path, "rb") as file, sarkit.sicd.NitfReader(file) as reader:
        tree = reader.metadata.xmltree
        samples = reader.read_image()
    root = tree.getroot()
    scp = xyz(root.find("{*}GeoData/{*}SCP/{*}ECF"))
    axes = {name: root.find("{*}Grid/{*}" + name) for name in ("Row", "Col")}
    units = {name: xyz(axis.find("{*}UVectECF")) for name, axis in axes.items()}
    number = lambda axis, key: float(axis.findtext("{*}" + key))
    spacing = {name: number(axis, "SS") for name, axis in axes.items()}
    centre = [int(root.findtext("{*}ImageData/{*}SCPPixel/{*}" + k)) for k in ("Row", "Col")]
    rows, columns = np.mgrid[: samples.shape[0], : samples.shape[1]]
    along = {"Row": (rows - centre[0]) * spacing["Row"], "Col": (columns - centre[1]) * spacing["Col"]}
    ecf = scp + sum(along[name][..., None] * units[name] for name in units)
    # The scene's frame, by the record; of a local one by where it was put, which the XML says.
    frame, grid = record["frame"], record["grid"]
    own = {k: np.array(grid[k]) for k in ("origin_m", "x_axis", "y_axis")}
    if frame["kind"] == "earth":
        x, y = np.array(frame["x_axis_ecf"]), np.array(frame["y_axis_ecf"])
        turn = np.stack([x, y, np.cross(x, y)], axis=1)
        at = ecf - np.array(frame["origin_ecf_m"])
        u, v = (at @ (turn @ own[k]) - own["origin_m"] @ own[k] for k in ("x_axis", "y_axis"))
        c, r = ((w - grid[k]["start"]) / grid[k]["step"] for w, k in ((u, "columns"), (v, "rows")))
        off = max(np.abs(r - r.round()).max(), np.abs(c - c.round()).max())
        whole = sorted(zip(r.round().astype(int).ravel(), c.round().astype(int).ravel()))
        good = off < 1e-3 and len(set(whole)) == image.size
        same = image[r.round().astype(int), c.round().astype(int)].astype("<c8").tobytes() == samples.astype("<c8").tobytes()
        print(f"    samples {'equal' if same else 'DIFFER'}, {off:.1e} pixels off their places")
        brightest = np.array(record["brightest"]["position_m"])
        true = np.array(frame["origin_ecf_m"]) + turn @ brightest
        normal = np.cross(units["Row"], units["Col"])
        peak = np.array(np.unravel_index(np.abs(samples).argmax(), samples.shape))
        metres = (peak - centre) * np.array([spacing["Row"], spacing["Col"]])
        params = sarkit.sicd.projection.MetadataParams.from_xml(tree)
        sets = sarkit.sicd.projection.compute_projection_sets(params, metres[None])
        if params.is_bistatic():
            ground, _, _ = sarkit.sicd.projection.r_rdot_to_ground_plane_bi(params.LOOK, scp, sets, scp, normal)
        else:
            ground = sarkit.sicd.projection.r_rdot_to_ground_plane_mono(params.LOOK, sets, scp, normal)
        apart = np.linalg.norm(ground - true)
        print(f"    the brightest pixel is projected {apart:.1e} m off")
        good &= same and apart < 0.1
    else:
        # Turned by quarters: the same samples. A recording that knows no place is a real one, whose power need not lie in the middle of its spectrum.
        same = np.array_equal(np.sort_complex(samples.ravel()), np.sort_complex(image.ravel()))
        print(f"    samples {'equal' if same else 'DIFFER'}, turned")
        return same
    # Spectra along rows and columns, of all lines together.
    antennas = [root.find("{*}SCPCOA/{*}Bistatic/{*}" + name + "/{*}Pos") for name in ("TxPlatform", "RcvPlatform")]
    if antennas[0] is None:
        antennas = [root.find("{*}SCPCOA/{*}ARPPos")]
    # Mean of the lines of sight of both antennas.
    sight = np.mean([(scp - xyz(at)) / np.linalg.norm(scp - xyz(at)) for at in antennas], axis=0)
    band = [float(root.findtext("{*}RadarCollection/{*}TxFrequency/{*}" + k)) for k in ("Min", "Max")]
    for number_of, (name, axis) in enumerate(axes.items()):
        sign, bandwidth = int(axis.findtext("{*}Sgn")), number(axis, "ImpRespBW")
        count = samples.shape[number_of]
        transform = np.fft.fft if sign == -1 else np.fft.ifft
        power = np.sum(np.abs(transform(samples.astype("c16"), axis=number_of)) ** 2, axis=1 - number_of)
        k = np.fft.fftfreq(count, spacing[name])
        low, high = number(axis, "DeltaK1"), number(axis, "DeltaK2")
        within = power[(k >= low - 1.5 / count / spacing[name]) & (k <= high + 1.5 / count / spacing[name])].sum() / power.sum()
        # The middle on a circle, for spectra come around.
        turn = np.angle(np.sum(power * np.exp(2j * np.pi * k * spacing[name]))) / (2 * np.pi * spacing[name])
        expected = sum(band) / C * sight @ units[name]
        off = (number(axis, "KCtr") + turn - expected) * spacing[name]
        off = abs(off - np.round(off)) / spacing[name] / bandwidth
        nearest = abs(number(axis, "KCtr") - expected) * spacing[name]
        print(f"    {name}: {100 * within:.2f} % within DeltaK, the middle {off:.3f} of the bandwidth off, KCtr {nearest:.2f} of 1/SS from it")
        good &= within > 0.97 and off < 0.1 and nearest < 0.6
    return good


def compare_read(path, array):
    with open(path, "rb") as file, sarkit.sicd.NitfReader(file) as reader:
        root = reader.metadata.xmltree.getroot()
        samples = reader.read_image()
    if samples.dtype.names is None:
        expected = samples.astype("c8")
    elif "real" in samples.dtype.names:
        expected = samples["real"].astype("c8") + 1j * samples["imag"].astype("c8")
    else:
        table = root.findall("{*}ImageData/{*}AmpTable/{*}Amplitude")
        amplitude = samples["amp"].astype("f8")
        if table:
            amplitude = np.array([float(a.text) for a in sorted(table, key=lambda a: int(a.get("index")))])[samples["amp"]]
        expected = (amplitude * np.exp(2j * np.pi * samples["phase"] / 256)).astype("c8")
    ours = np.load(array)
    off = np.abs(ours - expected).max() / np.abs(expected).max()
    # Two programs' sines differ by a rounding or two of float32, 6e-8 of an amplitude.
    good = ours.shape == expected.shape and (off == 0 if samples.dtype.names is None else off < 2e-7)
    print(f"{path}: {ours.shape} samples read, {off:.1e} off sarkit's")
    return good


def main():
    good = True
    for line in pathlib.Path(sys.argv[1]).read_text(encoding="utf-8").splitlines():
        path, folder = line.split("\t")
        if folder.endswith(".npy"):
            good &= compare_read(path, folder)
            continue
        good &= check(path)
        if folder == "-":
            continue
        good &= compare(path, pathlib.Path(folder))
    sys.exit(0 if good else "a SICD file failed")


main()
