"""Simulate Table 4.1 of Schone 2020, form the image, measure and save it."""

import subaperture as sar

recording = sar.simulate("table-4-1")
image = sar.focus(recording, "x=-45:45:0.25,y=-45:45:0.25,z=0", error_db=-60)
exact = sar.focus(recording, "x=-45:45:0.25,y=-45:45:0.25,z=0", former="bp", error_db=-90)
error_db = sar.compare(image, exact)["error_db"]
point = image.measure(x=0, y=0)
print(f"error {error_db:.1f} dB, bound -60 dB; widths " + ", ".join(f"{cut['width_3db']:.3f} m" for cut in point["cuts"]))
image.save("first-image")
