"""Checks CPHD files with sarkit. Usage: cphd_check.py LIST

Each line of LIST is FILE, CHANNEL, DUMP and UNDEFINED, separated by tabs. DUMP holds the samples that were given
to the writer, SGN -1 in the FX domain, as little-endian complex64 [vectors, frequencies].

1. Every check of sarkit's cphdcheck runs on the file, the thorough ones too; any failure,
   warnings included, fails. UNDEFINED, mostly empty, names (between commas) elements of the reference
   geometry that the standard's equations leave undefined; sarkit must find these and no others wrong. A
   GroundRange or SlopeAngle that sarkit finds wrong is judged here: see ground_ranges and slope_angles_are_right.
2. sarkit reads the channel. FX samples must be the dump to the bit (conjugated for SGN +1). TOA samples
   are transformed here, in double precision and by the standard's definition, and must be
   the dump to float32 rounding.
"""

import copy
import sys

try:
    import numpy as np
    import sarkit.cphd
    import sarkit.verification
except ImportError as error:
    sys.exit(f"{error}; install it with: python3 -m pip install 'sarkit[verification]'")


def ground_ranges(root):
    """Every GroundRange of a reference geometry: stated, true, and by how much sarkit may miss it.

    The standard's R arccos(u . v) is ill-conditioned for two nearly equal directions. With the unit roundoff
    e = 2**-53, each component of a unit vector is wrong by at most 4 e of itself (three squares, two sums, a
    root and a quotient), their product of directions by 3 e more: 11 e in all, 12 e with the arc cosine's
    own rounding. d arccos(x) = dx / sin(angle), so the range is wrong by up to R 12 e / sin(range / R), and how much
    of that a machine shows depends on how its numpy sums. The true value is taken from the arc
    tangent of |(p - s) x s| over p . s, which is good to a few e / (1e-6 range / R) or better: p - s has
    no rounding to speak of.
    """
    geometry = root.find("{*}ReferenceGeometry")
    xyz = lambda at: np.array([float(at.findtext("{*}" + axis)) for axis in "XYZ"])
    srp = xyz(geometry.find("{*}SRP/{*}ECF"))
    radius = np.linalg.norm(srp)
    for stated in geometry.findall(".//{*}GroundRange"):
        platform = stated.getparent()
        place = platform.find("{*}ARPPos")
        position = xyz(platform.find("{*}Pos") if place is None else place)
        across = np.linalg.norm(np.cross(position - srp, srp))
        angle = np.arctan2(across, np.dot(position, srp))
        yield float(stated.text), radius * angle, radius * 12 * 2.0**-53 / np.sin(angle)


def ground_ranges_are_right(checker):
    stated = list(ground_ranges(checker.cphdroot))
    own = copy.deepcopy(checker.cphdroot)
    channel = own.findtext("{*}Channel/{*}RefChId")
    own.replace(
        own.find("{*}ReferenceGeometry"),
        sarkit.cphd.compute_reference_geometry(own.getroottree(), checker.pvps[channel]),
    )
    good = len(stated) > 0
    for (value, true, may_miss), (sarkit_s, _, _) in zip(stated, ground_ranges(own), strict=True):
        good &= abs(value - true) <= 1e-9 * true and abs(sarkit_s - true) <= may_miss
        print(f"    GroundRange {value:.9f} m, true {true:.9f}, sarkit's {sarkit_s:.9f}, which may miss {may_miss:.1e}")
    return good


def slope_angles_are_right(checker):
    """Whether each SlopeAngle is that of two planes that are one, where sarkit's is not a number.

    The standard's is the arc cosine of a product of two unit vectors. Of one direction and a rounding that is above 1,
    and whether it is depends on the last bits of positions. It is so by 12 e at most (see ground_ranges), so that the
    true cosine is 1 - 12 e or more, and the angle sqrt(24 e) or less.
    """
    own = sarkit.cphd.compute_reference_geometry(
        checker.cphdroot.getroottree(), checker.pvps[checker.cphdroot.findtext("{*}Channel/{*}RefChId")]
    )
    stated = checker.cphdroot.findall("{*}ReferenceGeometry//{*}SlopeAngle")
    most = np.rad2deg(np.sqrt(24 * 2.0**-53))
    each = zip(stated, own.findall(".//{*}SlopeAngle"), strict=True)
    return len(stated) > 0 and all(np.isnan(float(theirs.text)) and abs(float(ours.text)) <= most for ours, theirs in each)


def check(path, undefined):
    with open(path, "rb") as file:
        checker = sarkit.verification.CphdConsistency.from_file(file, thorough=True)
        checker.check()
    failures = checker.failures(omit_passed_sub=True)
    print(f"{path}: {len(checker.passes())} checks pass, {len(failures)} fail")
    wrong = set()
    for name, result in failures.items():
        for detail in result["details"]:
            subject = detail["details"].split()[0]
            if name == "check_refgeom" and subject == "GroundRange" and ground_ranges_are_right(checker):
                continue
            if name == "check_refgeom" and subject == "SlopeAngle" and subject not in undefined and slope_angles_are_right(checker):
                continue
            wrong.add(subject if name == "check_refgeom" else name)
            if subject not in undefined:
                print("   ", detail["severity"], name, detail["details"], detail["message"])
    return wrong == undefined


def compare(path, channel, dump):
    with open(path, "rb") as file, sarkit.cphd.Reader(file) as reader:
        tree = reader.metadata.xmltree
        signal, pvp = reader.read_channel(channel)
    sgn = int(tree.findtext("{*}Global/{*}SGN"))
    expected = np.fromfile(dump, "<c8").reshape(len(pvp), -1)
    if tree.findtext("{*}Global/{*}DomainType") == "FX":
        if sgn == 1:
            expected = expected.conj()
        same = signal.astype("<c8").tobytes() == expected.astype("<c8").tobytes()
        print(f"{path} {channel}: FX samples {'equal' if same else 'DIFFER'}")
        return same
    num_samples, count = signal.shape[1], expected.shape[1]
    error = norm = 0.0
    for s, v, x in zip(signal.astype("c16"), pvp, expected.astype("c16")):
        toa = v["SC0"] + np.arange(num_samples) * v["SCSS"]
        m = np.arange(count) - count // 2
        offset = m / (num_samples * v["SCSS"])  # fx - fx_C
        kernel = np.exp(sgn * 2j * np.pi * np.outer(offset, toa))
        fx = (kernel @ s) * count / num_samples
        if sgn == 1:
            fx = fx.conj()
        error += np.sum(np.abs(fx - x) ** 2)
        norm += np.sum(np.abs(x) ** 2)
    relative = np.sqrt(error / norm)
    # Each stored sample is rounded by at most 2**-24 of itself: see the round trip's test.
    print(f"{path} {channel}: TOA samples, relative error {relative:.2e}")
    return relative < 2**-24


def main():
    with open(sys.argv[1], encoding="utf-8") as lines:
        jobs = [line.rstrip("\n").split("\t") for line in lines]
    good = True
    for path, undefined in {job[0]: job[3] for job in jobs}.items():
        good &= check(path, set(filter(None, undefined.split(","))))
    for job in jobs:
        good &= compare(*job[:3])
    sys.exit(0 if good else "a CPHD file failed")


main()
