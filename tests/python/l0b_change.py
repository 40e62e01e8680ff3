"""Files in FOLDER that differ from those of l0b_write.py in one property each."""

import shutil
import sys
from pathlib import Path

import h5py
import numpy as np

FOLDER = Path(sys.argv[1])
NAMED, RRSD = "science/LSAR/identification", "science/LSAR/RRSD"
SENT = RRSD + "/swaths/frequencyA/txH"
ORBIT = RRSD + "/lowRateTelemetry/orbit"


def changed(name, change, of="float"):
    path = FOLDER / f"{name}.h5"
    shutil.copy(FOLDER / f"{of}.h5", path)
    with h5py.File(path, "r+") as f:
        change(f)


def put(path, value):
    def change(f):
        units = f[path].attrs.get("units")
        del f[path]
        set = f.create_dataset(path, data=value)
        if units is not None:
            set.attrs["units"] = units

    return change


def write(path, place, value):
    def change(f):
        f[path][place] = value

    return change


def moved(old, new):
    return lambda f: f.move(old, new)


def without_units(f):
    del f[SENT + "/UTCtime"].attrs["units"]


changed("diagnostic", put(NAMED + "/diagnosticModeFlag", np.uint8(2)))
changed("slc", moved(RRSD, "science/LSAR/RSLC"))
changed("legacy", moved(RRSD + "/lowRateTelemetry", RRSD + "/telemetry"))
changed("legendre", put(ORBIT + "/interpMethod", np.bytes_("Legendre")), "coded")
changed("cube", put(SENT + "/rxH/HH", np.zeros((2, 3, 4), "c8")))
changed("untabled", moved(SENT + "/rxH/BFPQLUT", SENT + "/rxH/OTHER"), "coded")
changed("short_table", put(SENT + "/rxH/BFPQLUT", np.zeros(256, "f4")), "coded")
changed("late", write(SENT + "/UTCtime", -1, 90.0))
changed("backwards", write(SENT + "/UTCtime", 7, 39.31))
changed("uneven", write(SENT + "/slantRange", -1, 1e6))
changed("timeless", without_units)
changed("near", write(SENT + "/slantRange", slice(None), 600e3 + np.arange(1000) * 299792458.0 / 48e6))
changed("long_pulse", put(SENT + "/chirpDuration", 50e-6))
changed("calibration", write(SENT + "/calType", slice(None), 1))
changed("sideways", put(NAMED + "/lookDirection", np.bytes_("up")))
changed("infinite", write(SENT + "/rxH/HH", (5, 9), np.inf))
