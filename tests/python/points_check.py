"""Checks by sarkit where reflectors appear in SICD files. Usage: points_check.py LIST

Each line of LIST is either a CPHD, every check of sarkit's cphdcheck of which has to pass; or FILE, X, Y, Z and HEIGHT, separated by tabs: a SICD, and where in
Earth-centred Earth-fixed coordinates a reflector stood, and how high above the ellipsoid.

1. sarkit projects the reflector into the image, by the XML alone: it has to be within 0.1 m of the brightest place of the image, found between samples.
2. sarkit projects that place to the surface of the reflector's height above the ellipsoid: it has to be within 0.1 m of the reflector.
"""

import pathlib
import sys

try:
    import numpy as np
    import sarkit.sicd
    import sarkit.sicd.projection as projection
    import sarkit.verification
except ImportError as error:
    sys.exit(f"{error}; install it with: python3 -m pip install 'sarkit[verification]'")

FINER = 32
HALF = 24


def finer(samples, axis):
    """Samples FINER times as close, of a band that may lie anywhere among its aliases."""
    count = samples.shape[axis]
    spectrum = np.fft.fft(samples, axis=axis)
    power = np.sum(np.abs(spectrum) ** 2, axis=1 - axis)
    turn = np.angle(np.sum(power * np.exp(2j * np.pi * np.arange(count) / count)))
    shift = count // 2 - int(round(turn / (2 * np.pi) * count))
    spectrum = np.roll(spectrum, shift, axis=axis)
    more = [(0, 0), (0, 0)]
    more[axis] = (0, (FINER - 1) * count)
    return np.fft.ifft(np.pad(spectrum, more), axis=axis)


def check_cphd(path):
    with open(path, "rb") as file:
        checker = sarkit.verification.CphdConsistency.from_file(file)
        checker.check()
    failures = checker.failures(omit_passed_sub=True)
    print(f"{path}: {len(checker.passes())} checks pass, {len(failures)} fail")
    for name, result in failures.items():
        for detail in result["details"]:
            print("   ", detail["severity"], name, detail["details"], detail["message"])
    return not failures


def check(path, point, height):
    with open(path, "rb") as file, sarkit.sicd.NitfReader(file) as reader:
        tree = reader.metadata.xmltree
        samples = reader.read_image()
    root = tree.getroot()
    number = lambda key: float(root.findtext("{*}" + key.replace("/", "/{*}")))
    spacing = np.array([number("Grid/Row/SS"), number("Grid/Col/SS")])
    centre = np.array([number("ImageData/SCPPixel/Row"), number("ImageData/SCPPixel/Col")])
    peak = np.array(np.unravel_index(np.abs(samples).argmax(), samples.shape))
    first = np.maximum(peak - HALF, 0)
    chip = samples[first[0] : peak[0] + HALF, first[1] : peak[1] + HALF].astype("c16")
    fine = np.abs(finer(finer(chip, 0), 1))
    place = first + np.array(np.unravel_index(fine.argmax(), fine.shape)) / FINER
    metres = (place - centre) * spacing
    params = projection.MetadataParams.from_xml(tree)
    expected, _, found = projection.scene_to_image(params, np.array(point))
    apart = np.linalg.norm(expected - metres)
    sets = projection.compute_projection_sets(params, metres[None])
    ground, _, _ = projection.r_rdot_to_constant_hae_surface(params.LOOK, params.SCP, sets, height)
    off = np.linalg.norm(ground - point)
    print(f"{path}: the reflector is {apart:.3f} m from where it is projected, and projected back {off:.3f} m off")
    return bool(found) and apart < 0.1 and off < 0.1


def main():
    good = True
    for line in pathlib.Path(sys.argv[1]).read_text(encoding="utf-8").splitlines():
        path, *numbers = line.split("\t")
        if not numbers:
            good &= check_cphd(path)
            continue
        *point, height = map(float, numbers)
        good &= check(path, point, height)
    sys.exit(0 if good else 1)


main()
