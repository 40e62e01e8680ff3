"""Form an image from arrays: the phase history of a radar without a file format."""

import numpy as np

import subaperture as sar

C = 299792458.0
frequencies = 9.8e9 + 2e6 * np.arange(200)
antenna = np.column_stack([np.linspace(-50, 50, 256), np.full(256, -1000.0), np.full(256, 300.0)])
echoes = np.zeros((256, 200), complex)
for target in [(0.0, 0.0, 0.0), (5.0, -3.0, 0.0)]:
    path = 2 * np.linalg.norm(antenna - target, axis=1)
    echoes += np.exp(-2j * np.pi * frequencies * path[:, None] / C)

recording = sar.phase_history(echoes, frequency_hz=frequencies, antenna_m=antenna, sign=-1, reference_path_m=0.0)
image = sar.focus(recording, "x=-10:10:0.1,y=-10:10:0.2,z=0")
print(image, image.measure()["position_m"])
