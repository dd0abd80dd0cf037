"""Runs of manifests by the program `hummingbus`: launched, steered, awaited."""

from __future__ import annotations

import glob
import json
import os
import subprocess
import tempfile
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from . import _native
from ._program import program, report, toml
from ._recordings import Recording


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
                raise _native.Error(f"the run has not begun within 30 s: there is no {pattern}; is {program()} the program itself?")
            time.sleep(0.005)
        raise _native.Error("the run has ended: " + self._texts()[1].strip())

    def status(self) -> Mapping[str, Any]:
        """Returns the progress of the run."""
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

    def swap(
        self,
        process: str,
        backup: Mapping[str, Any] | str | os.PathLike[str] = "",
        *,
        shadow_ticks: int | None = None,
        at_tick: int | None = None,
    ) -> Mapping[str, Any]:
        """Replaces `process` by a backup, which goes on from its state where both have the same.

        `backup` is what the backup has otherwise: the keys of a process in a manifest, as a mapping, a TOML text or a TOML file. It
        computes `shadow_ticks` beside the process, and its outputs count from `at_tick` on, or as soon as possible.
        """
        # Its processes join first; before that nothing can be replaced.
        while self.status()["state"] == "starting":
            time.sleep(0.005)
        # Each key on a line of its own: a file may not be one inline table.
        if isinstance(backup, Mapping):
            text = "".join(f"{json.dumps(key)} = {toml(value)}\n" for key, value in backup.items())
        else:
            text = os.fspath(backup)
        words = [process, "--with", text]
        for option, value in (("--shadow-ticks", shadow_ticks), ("--at-tick", at_tick)):
            words += [] if value is None else [option, str(value)]
        return self._answer("swap", *words)

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
        return self._answer("ctl", *words)

    def _answer(self, command: str, *words: str) -> Mapping[str, Any]:
        return report([command, "--run", self.id, "--json", *words])


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
    command = [program(), "run", os.fspath(manifest), "--json"]
    command += ["--record", "none" if record is None else os.fspath(record)]
    for key, value in (set or {}).items():
        command += ["--set", f"{key}={toml(value)}"]
    if pace is not None:
        command += ["--pace", str(pace)]
    command += arguments
    return Run(command)


def fly(manifest: str | os.PathLike[str], **options: Any) -> Outcome:
    """Flies `manifest` to its end: `start` and `wait`."""
    with start(manifest, **options) as run:
        return run.wait()
