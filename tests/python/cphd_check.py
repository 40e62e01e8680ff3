"""Checks CPHD files with sarkit. Usage: cphd_check.py LIST

Each line of LIST is FILE, CHANNEL, DUMP and UNDEFINED, separated by tabs. DUMP holds the samples that were given
to the writer, SGN -1 in the FX domain, as little-endian complex64 [vectors, frequencies].

1. Every check of sarkit's cphdcheck runs on the file, the thorough ones too; any failure,
   warnings included, fails. UNDEFINED, mostly empty, names (between commas) elements of the reference
   geometry that the standard's equations leave undefined; sarkit must find these and no others wrong.
2. sarkit reads the channel. FX samples must be the dump to the bit (conjugated for SGN +1). TOA samples
   are transformed here, in double precision and by the standard's definition, and must be
   the dump to float32 rounding.
"""

import sys

try:
    import numpy as np
    import sarkit.cphd
    import sarkit.verification
except ImportError as error:
    sys.exit(f"{error}; install it with: python3 -m pip install 'sarkit[verification]'")


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
