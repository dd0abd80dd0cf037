"""Campaigns and identification: many flights, and what measured ones show."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ._program import report

if TYPE_CHECKING:
    import pandas
    import polars


@dataclass(frozen=True)
class Campaign:
    """A campaign that was flown: its report as `hummingbus campaign --json` prints it, and its flights."""

    folder: Path
    report: Mapping[str, Any]
    holds: bool
    """True if the condition `require` holds, and without one."""

    def polars(self) -> polars.DataFrame:
        """A row for each flight: varied values, verdict, figures, first failing condition."""
        import polars

        return polars.read_parquet(self.folder / "flights.parquet")

    def pandas(self) -> pandas.DataFrame:
        """The same; needs `pyarrow`."""
        import pandas

        return pandas.read_parquet(self.folder / "flights.parquet")


def campaign(
    file: str | os.PathLike[str],
    out: str | os.PathLike[str],
    *,
    workers: int | None = None,
    require: str | None = None,
) -> Campaign:
    """Flies the campaign `file` into the folder `out`, or what is left of one that was interrupted there.

    `require` is a condition such as `"pass_rate >= 0.99 at 95 %"`. Raises `hummingbus.Error` with the program's own words, and at Ctrl-C
    `KeyboardInterrupt`: the flights so far stay in `out`.
    """
    words = ["campaign", os.fspath(file), "--out", os.fspath(out), "--json"]
    for option, value in (("--workers", workers), ("--require", require)):
        words += [] if value is None else [option, str(value)]
    # Exit code 1: flown, and the condition does not hold.
    found = report(words, codes=(0, 1))
    return Campaign(Path(out), found, found["requirement_met"] is not False)


def identify(
    flights: str | os.PathLike[str], out: str | os.PathLike[str], *, on_bus: bool = True
) -> Mapping[str, Any]:
    """Finds what the measured flights of the file `flights` show that their declared vehicle lacks.

    Returns the report as `hummingbus identify --json` prints it. The page `report.html` and the new `vehicle.toml` go into the folder
    `out`. `on_bus` flies the declared and the new vehicle. Raises `hummingbus.Error` with the program's own words, and at Ctrl-C
    `KeyboardInterrupt`: the files in `out` have the effects that were found so far.
    """
    words = ["identify", os.fspath(flights), "--out", os.fspath(out), "--json"]
    return report(words if on_bus else [*words, "--no-bus"])
