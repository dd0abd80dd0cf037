"""Reads dataflash logs with pymavlink and compares each sample with what the crate flights read of it.

Usage: compare_dataflash.py LOG_CHANNELS VEHICLE LOG ...

LOG_CHANNELS is the program of the example `log_channels`, VEHICLE a vehicle file with four rotors. Prints a line a log and
ends with 1 if a sample of ours differs from pymavlink's, if one of theirs is missing without a note, or if nothing was compared.
"""

import json
import math
import os
import subprocess
import sys
import tempfile

from pymavlink import DFReader

CHANNELS = """
[channels]
attitude = { topic = "ATT" }
"""
IMU = """
angular_velocity = { topic = "IMU" }
specific_force = { topic = "IMU" }
"""
# Ours scales in f64 what pymavlink scales in f64: the rounding of a few operations.
CLOSE = 1e-9


def quaternion(roll, pitch, yaw):
    """Body FLU to world ENU, w x y z, of Euler angles (Z-Y-X, rad) of body FRD to world NED."""
    cr, sr, cp, sp = math.cos(roll / 2), math.sin(roll / 2), math.cos(pitch / 2), math.sin(pitch / 2)
    cy, sy = math.cos(yaw / 2), math.sin(yaw / 2)
    ned = (
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    )
    half = math.sqrt(0.5)
    return product(product((0.0, half, half, 0.0), ned), (0.0, 1.0, 0.0, 0.0))


def product(a, b):
    (w, x, y, z), (p, q, r, s) = a, b
    return (
        w * p - x * q - y * r - z * s,
        w * q + x * p + y * s - z * r,
        w * r - x * s + y * p + z * q,
        w * s + x * r - y * q + z * p,
    )


def distance(a, b):
    return max(abs(x - y) for x, y in zip(a, b))


def turned(a, b):
    """Quaternions with either sign are one attitude."""
    return min(distance(a, b), distance(a, [-x for x in b]))


def first_imu(message):
    return getattr(message, "I", 0) == 0


def flu(message, names):
    x, y, z = (getattr(message, name) for name in names)
    return (x, -y, -z)


def expected(path):
    """Samples by channel as {time of the log in s: value}; a time that is there twice has the value `None`."""
    found = {"attitude": {}, "angular_velocity": {}, "specific_force": {}}
    kinds = set()
    log = DFReader.DFReader_binary(path, zero_time_base=False)
    while (message := log.recv_msg()) is not None:
        kind = message.get_type()
        kinds.add(kind)
        if kind not in ("ATT", "IMU") or kind == "IMU" and not first_imu(message):
            continue
        time = message.TimeUS * 1e-6 if hasattr(message, "TimeUS") else message.TimeMS * 1e-3
        if kind == "ATT":
            angles = (math.radians(getattr(message, name)) for name in ("Roll", "Pitch", "Yaw"))
            put(found["attitude"], time, quaternion(*angles))
        else:
            put(found["angular_velocity"], time, flu(message, ("GyrX", "GyrY", "GyrZ")))
            put(found["specific_force"], time, flu(message, ("AccX", "AccY", "AccZ")))
    return found, kinds


def put(samples, time, value):
    key = round(time * 1e6)
    samples[key] = None if key in samples else value


def ours(program, vehicle, path, has_imu):
    with tempfile.TemporaryDirectory() as folder:
        flights = os.path.join(folder, "flights.toml")
        with open(flights, "w", encoding="utf-8") as file:
            file.write(f'vehicle = "{os.path.abspath(vehicle)}"\n{CHANNELS}{IMU if has_imu else ""}')
            file.write(f'[[flight]]\nfile = "{os.path.abspath(path)}"\nrole = "fit"\nformat = "dataflash"\n')
        printed = subprocess.run([program, flights], capture_output=True, check=True, text=True)
        return json.loads(printed.stdout)


def compare(program, vehicle, path):
    """Number of samples compared, and the differences in words."""
    theirs, kinds = expected(path)
    if "ATT" not in kinds:
        return 0, []
    read = ours(program, vehicle, path, bool(theirs["angular_velocity"]))
    if "error" in read:
        return 0, [f"refused: {read['error'].splitlines()[0]}"]
    flight, compared, wrong = read["flights"][0], 0, []
    # Ours counts from the first sample of all channels.
    begin_us = min(min(samples) for samples in theirs.values() if samples)
    begin_us -= round(1e6 * min(flight[name]["time_s"][0] for name in theirs if flight[name]["time_s"]))
    for name, samples in theirs.items():
        channel = flight[name]
        is_close = turned if name == "attitude" else distance
        for time, value in zip(channel["time_s"], channel["values"]):
            sample = samples.get(begin_us + round(time * 1e6), "absent")
            if sample is None:
                continue
            if sample == "absent" or is_close(value, sample) > CLOSE * (1 + max(map(abs, value))):
                wrong.append(f"{name} at {time:.6f} s: {value}, pymavlink has {sample}")
            compared += 1
        missing = len(samples) - len(channel["time_s"])
        if missing > 0 and not flight["notes"]:
            wrong.append(f"{name}: {missing} of {len(samples)} samples are missing, and no note says why")
        print(f"  {name}: {len(channel['time_s'])} of {len(samples)}", file=sys.stderr)
    return compared, wrong


def main(program, vehicle, *logs):
    total, failed = 0, 0
    for path in logs:
        try:
            compared, wrong = compare(program, vehicle, path)
        except (ValueError, IndexError, TypeError) as error:
            compared, wrong = 0, []
            print(f"{path}: pymavlink does not read it: {error}")
        total += compared
        failed += bool(wrong)
        print(f"{path}: {compared} samples agree" if not wrong else f"{path}: {len(wrong)} differences; {wrong[0]}")
    print(f"{total} samples of {len(logs)} logs, {failed} logs with differences")
    return failed > 0 or total == 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
