"""Prints all values of a STANAG 4607 file as JSON. Usage: stanag4607_check.py FILE

The PyPI package stanag4607 decodes the file: a list of packets with header, segments, and the issues that its validation reports. Names are those of
the package, with the unit in the name; angles are in degrees. "utc" is the time of a dwell from the mission's date (M5 to M7) and the dwell time (D6).
"""

import dataclasses
import fractions
import json
import pathlib
import sys

try:
    import stanag4607
except ImportError as error:
    sys.exit(f"{error}; install it with: python3 -m pip install stanag4607")

VALIDATE = {
    stanag4607.MissionSegment: stanag4607.validate_mission,
    stanag4607.JobDefinitionSegment: stanag4607.validate_job_definition,
    stanag4607.DwellSegment: stanag4607.validate_dwell,
}


def plain(value):
    if isinstance(value, (stanag4607.BinaryAngle, stanag4607.SignedBinaryAngle)):
        return float(value.degrees)
    if isinstance(value, fractions.Fraction):
        return float(value)
    if isinstance(value, bytes):
        return value.decode("ascii")
    if isinstance(value, tuple):
        return [plain(item) for item in value]
    return record(value) if dataclasses.is_dataclass(value) else value


def record(value):
    kind = type(value)
    names = [field.name for field in dataclasses.fields(kind) if field.name not in ("mask", "fields")]
    names += [name for name in dir(kind) if isinstance(getattr(kind, name), property)]
    return {"kind": kind.__name__} | {name: plain(getattr(value, name)) for name in names}


data = pathlib.Path(sys.argv[1]).read_bytes()
limits = stanag4607.DecodeLimits(max_packet_size=max(len(data), 32))
stream = stanag4607.PacketStreamDecoder(limits=limits)
packets = stream.feed(data)
stream.finish()
context = stanag4607.ContextualStreamDecoder(limits=limits)
events = context.feed(data)
context.finish()

printed = []
for index, packet in enumerate(packets):
    issues = [*stanag4607.validate_packet_header(packet.header), *stanag4607.validate_packet_context(packet)]
    segments = []
    for found in (found for found in events if found.packet_index == index):
        value = found.event.value
        issues += VALIDATE[type(value)](value)
        time = found.event_time_utc
        segments.append(record(value) | {"utc": time and time.isoformat(timespec="milliseconds")})
    printed.append({"header": record(packet.header), "issues": [str(issue) for issue in issues], "segments": segments})
print(json.dumps(printed))
