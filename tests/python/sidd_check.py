"""Checks SIDD files with sarkit. Usage: sidd_check.py FILE IMAGE [FILE IMAGE ...]

FILE is a SIDD of which IMAGE, a folder with image.npy and image.json, is the image.

1. Every check of sarkit's siddcheck runs on the file; any failure fails.
2. sarkit reads the pixels. Its projection takes each corner and the brightest pixel to ECF; the frame of image.json takes them back to the image, where
   magnitudes have to be those that the greys say, to half a grey, between the levels that the XML states, and cut off at them.
"""

import json
import pathlib
import sys

try:
    import numpy as np
    import sarkit.sidd
    import sarkit.sidd.calculations
    import sarkit.verification
except ImportError as error:
    sys.exit(f"{error}; install it with: python3 -m pip install 'sarkit[verification]'")


def check(path):
    with open(path, "rb") as file:
        checker = sarkit.verification.SiddConsistency.from_file(file)
        checker.check()
    failures = checker.failures(omit_passed_sub=True)
    print(f"{path}: {len(checker.passes())} checks pass, {len(failures)} fail")
    for name, result in failures.items():
        for detail in result["details"]:
            print("   ", detail["severity"], name, detail["details"], detail["message"])
    return not failures


def compare(path, folder):
    record = json.loads((folder / "image.json").read_text())
    image = np.load(folder / "image.npy")
    with open(path, "rb") as file, sarkit.sidd.NitfReader(file) as reader:
        tree = reader.metadata.images[0].xmltree
        greys = reader.read_image(0)
    rows, columns = np.mgrid[: greys.shape[0], : greys.shape[1]]
    pixels = np.stack([rows.ravel(), columns.ravel()], axis=1).astype(float)
    ecf = sarkit.sidd.calculations.pixel_to_ecef(tree, pixels)
    frame, grid = record["frame"], record["grid"]
    own = {k: np.array(grid[k]) for k in ("origin_m", "x_axis", "y_axis")}
    x, y = np.array(frame["x_axis_ecf"]), np.array(frame["y_axis_ecf"])
    turn = np.stack([x, y, np.cross(x, y)], axis=1)
    at = ecf - np.array(frame["origin_ecf_m"])
    u, v = (at @ (turn @ own[k]) - own["origin_m"] @ own[k] for k in ("x_axis", "y_axis"))
    c, r = ((w - grid[k]["start"]) / grid[k]["step"] for w, k in ((u, "columns"), (v, "rows")))
    off = max(np.abs(r - r.round()).max(), np.abs(c - c.round()).max())
    db = 20 * np.log10(np.abs(image[r.round().astype(int), c.round().astype(int)]) + 1e-300)
    stated = {e.get("name"): e.text for e in tree.iter("{*}ModuleParameter")}
    black, white = float(stated["black_db"]), float(stated["white_db"])
    wanted = 255 * np.clip((db - black) / (white - black), 0, 1)
    # Levels are stated in hundredths of a decibel.
    most = 0.5 + 255 * 0.01 / (white - black)
    worst = np.abs(wanted - greys.ravel()).max()
    print(f"    {off:.1e} pixels off their places, greys off by {worst:.3f} at most, {greys.min()} to {greys.max()}")
    return off < 1e-3 and worst <= most and len(np.unique(greys)) > 50


good = True
for path, folder in zip(sys.argv[1::2], sys.argv[2::2]):
    good &= check(path)
    good &= compare(path, pathlib.Path(folder))
sys.exit(not good)
