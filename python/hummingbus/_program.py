"""The program `hummingbus`: where it is, its reports, and values as it takes them."""

from __future__ import annotations

import json
import math
import os
import signal
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from . import _native


BUNDLED = Path(__file__).with_name("bin") / "hummingbus"


def program() -> str:
    """The program that `HUMMINGBUS_PROGRAM` names, that of this wheel, or one in `PATH`."""
    if found := os.environ.get("HUMMINGBUS_PROGRAM"):
        return found
    if BUNDLED.exists():
        return str(BUNDLED)
    for folder in os.get_exec_path():
        found = os.path.join(folder, "hummingbus")
        # The script of this package hands on to the program: it is none.
        if os.access(found, os.X_OK) and not _is_script(found):
            return found
    raise _native.Error("no folder of PATH holds the program `hummingbus`; put it there, or set HUMMINGBUS_PROGRAM")


def main() -> None:
    """The command `hummingbus` of this package: becomes the program."""
    try:
        found = program()
    except _native.Error as error:
        sys.exit(f"error: {error}")
    os.execv(found, [found, *sys.argv[1:]])


def _is_script(path: str) -> bool:
    with open(path, "rb") as file:
        return file.read(2) == b"#!"


def report(words: Sequence[str], codes: Sequence[int] = (0,)) -> Mapping[str, Any]:
    """The JSON that the program prints; other exit codes than `codes` raise its own words.

    Ctrl-C ends the program, which first writes what it has found so far, and raises `KeyboardInterrupt` with its words.
    """
    code, output, said = _call([program(), *words])
    if code not in codes:
        raise _native.Error(said.strip())
    return json.loads(output)


def _call(command: Sequence[str]) -> tuple[int, str, str]:
    """Exit code, output and error output of `command`."""
    pipe = subprocess.PIPE
    # In a session of its own, so that Ctrl-C in a terminal reaches it once, from here: a second one would end it at once.
    process = subprocess.Popen(
        command, stdin=subprocess.DEVNULL, stdout=pipe, stderr=pipe, text=True, start_new_session=True
    )
    try:
        output, said = process.communicate()
        return process.returncode, output, said
    except KeyboardInterrupt:
        process.send_signal(signal.SIGINT)
        _, said = process.communicate()
        raise KeyboardInterrupt(said.strip()) from None
    finally:
        if process.poll() is None:
            process.kill()
            process.wait()


def toml(value: Any) -> str:
    """A value as `--set` takes it."""
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{json.dumps(str(key))} = {toml(item)}" for key, item in value.items()) + " }"
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(map(toml, value)) + "]"
    if hasattr(value, "tolist"):
        return toml(value.tolist())
    if isinstance(value, float) and not math.isfinite(value):
        return "nan" if math.isnan(value) else "inf" if value > 0 else "-inf"
    if value is None:
        raise TypeError("a manifest has no value `None`; leave the key out")
    return json.dumps(value, ensure_ascii=False)
