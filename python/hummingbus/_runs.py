"""Runs of manifests by the program `hummingbus`: launched, steered, awaited."""

from __future__ import annotations

import glob
import json
import math
import os
import shutil
import subprocess
import tempfile
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from . import _native
from ._recordings import Recording



def _program() -> str:
    found = os.environ.get("HUMMINGBUS_PROGRAM") or shutil.which("hummingbus")
    if not found:
        raise _native.Error("no folder of PATH holds the program `hummingbus`; put it there, or set HUMMINGBUS_PROGRAM")
    return found


@dataclass(frozen=True)
class Outcome:
    """The end of a run: whether it passed, and its summary as `hummingbus run --json` prints it."""

    passed: bool
    summary: Mapping[str, Any]

    @property
    def conditions(self) -> list[Mapping[str, Any]]:
        """The pass conditions with what was measured."""
        return list(self.summary["pass"])

    @property
    def recording(self) -> Recording:
        """The recording of the run."""
        path = self.summary["recording"]
        if path is None:
            raise _native.Error("the run was not recorded")
        return Recording(path)


class Run:
    """A run under way. Leaving a `with` block stops it."""

    def __init__(self, command: Sequence[str]):
        # Files, since a pipe that nobody reads would hold up the run.
        self._output, self._said = tempfile.TemporaryFile("w+"), tempfile.TemporaryFile("w+")
        self._process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=self._output, stderr=self._said, text=True)
        self._outcome: Outcome | None = None

    @property
    def id(self) -> str:
        """Name of the run, as `hummingbus top` has it."""
        pattern = f"/dev/shm/hb_{self._process.pid:x}-*_run"
        patience_s = time.monotonic() + 30.0
        while self._process.poll() is None:
            if found := glob.glob(pattern):
                return os.path.basename(max(found, key=os.path.getmtime))[len("hb_") : -len("_run")]
            if time.monotonic() > patience_s:
                raise _native.Error(f"the run has not begun within 30 s: there is no {pattern}; is {_program()} the program itself?")
            time.sleep(0.005)
        raise _native.Error("the run has ended: " + self._texts()[1].strip())

    def status(self) -> Mapping[str, Any]:
        """How far the run has come."""
        return self._ask("status")

    def pause(self) -> Mapping[str, Any]:
        """Holds the run at the next tick boundary."""
        return self._ask("pause")

    def step(self, ticks: int = 1) -> Mapping[str, Any]:
        """Runs exactly so many ticks, and waits until the run is held again."""
        return self._ask("step", str(ticks))

    def resume(self) -> Mapping[str, Any]:
        """Lets a held run go on."""
        return self._ask("resume")

    def pace(self, pace: float | str) -> Mapping[str, Any]:
        """Changes the pace: `free`, `realtime`, or simulated seconds a second."""
        return self._ask("pace", str(pace))

    def checkpoint(self, path: str | os.PathLike[str]) -> Mapping[str, Any]:
        """Writes a checkpoint, from which another run goes on."""
        return self._ask("checkpoint", os.fspath(path))

    def stop(self) -> Outcome:
        """Ends the run at the next tick boundary."""
        self._ask("stop")
        return self.wait()

    def wait(self, timeout_s: float | None = None) -> Outcome:
        """Waits for the end.

        Raises `hummingbus.Error` with the run's own words where it did not come to its end, and `subprocess.TimeoutExpired`.
        """
        if self._outcome is None:
            self._process.wait(timeout_s)
            output, said = self._texts()
            if self._process.returncode not in (0, 1) or not output.strip():
                raise _native.Error(said.strip())
            self._outcome = Outcome(self._process.returncode == 0, json.loads(output))
        return self._outcome

    def __enter__(self) -> Run:
        return self

    def __exit__(self, *_: Any) -> None:
        if self._process.poll() is None:
            self._process.terminate()
            self._process.wait()

    def _texts(self) -> tuple[str, str]:
        """Standard output and standard error so far."""
        for file in (self._output, self._said):
            file.seek(0)
        return self._output.read(), self._said.read()

    def _ask(self, *words: str) -> Mapping[str, Any]:
        command = [_program(), "ctl", "--run", self.id, "--json", *words]
        ended = subprocess.run(command, capture_output=True, text=True)
        if ended.returncode != 0:
            raise _native.Error(ended.stderr.strip())
        return json.loads(ended.stdout)


def start(
    manifest: str | os.PathLike[str],
    *,
    record: str | os.PathLike[str] | None = None,
    set: Mapping[str, Any] | None = None,
    pace: float | str | None = None,
    arguments: Sequence[str] = (),
) -> Run:
    """Starts a run of `manifest`. `record` is where its recording goes; without it there is none. `set` overrides keys, such as
    `{"run.duration_s": 2.0}`; `arguments` are more of `hummingbus run`.
    """
    command = [_program(), "run", os.fspath(manifest), "--json"]
    command += ["--record", "none" if record is None else os.fspath(record)]
    for key, value in (set or {}).items():
        command += ["--set", f"{key}={_toml(value)}"]
    if pace is not None:
        command += ["--pace", str(pace)]
    command += arguments
    return Run(command)


def fly(manifest: str | os.PathLike[str], **options: Any) -> Outcome:
    """Flies `manifest` to its end: `start` and `wait`."""
    with start(manifest, **options) as run:
        return run.wait()


def _toml(value: Any) -> str:
    """A value as `--set` takes it."""
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{json.dumps(str(key))} = {_toml(item)}" for key, item in value.items()) + " }"
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(map(_toml, value)) + "]"
    if hasattr(value, "tolist"):
        return _toml(value.tolist())
    if isinstance(value, float) and not math.isfinite(value):
        return "nan" if math.isnan(value) else "inf" if value > 0 else "-inf"
    if value is None:
        raise TypeError("a manifest has no value `None`; leave the key out")
    return json.dumps(value, ensure_ascii=False)
