"""Reads the flights of a campaign with pandas, polars and DuckDB, and compares each value with the rows. Usage: read_campaign.py FOLDER"""

import csv
import json
import pathlib
import sys

import duckdb
import pandas
import polars


def expected(folder):
    """Columns of the table, in their order, and its rows as they are in plan.csv and rows.jsonl."""
    with open(folder / "plan.csv", encoding="utf-8", newline="") as file:
        varied = next(csv.reader(file))[1:]
    with open(folder / "rows.jsonl", encoding="utf-8") as file:
        header, *rows = map(json.loads, file)
    rows.sort(key=lambda row: row["flight"])
    verdicts, figures = header["verdicts"], header["figures"]
    columns = ["flight", *varied, "run.seed", "passed", "failed", "failed_at_s", "error", *verdicts, *figures, "version"]
    named = [
        [
            row["flight"],
            *row["drawn"],
            # The seed is varied.
            int(row["drawn"][varied.index("seed")]),
            row["passed"],
            row["failed"],
            row["failed_at_s"],
            row["error"],
            # A flight that was not judged has none.
            *(row["verdicts"] or [None] * len(verdicts)),
            *row["figures"],
            header["build"],
        ]
        for row in rows
    ]
    return columns, named


def plain(value):
    """The value without its library's own kinds; missing ones are `None`."""
    value = value.item() if hasattr(value, "item") else value
    return None if value is None or value != value or value is pandas.NA else value


def tables(path):
    frame = pandas.read_parquet(path)
    yield "pandas", list(frame.columns), frame.itertuples(index=False, name=None)
    frame = polars.read_parquet(path)
    yield "polars", frame.columns, frame.iter_rows()
    found = duckdb.sql(f"SELECT * FROM read_parquet('{path}') ORDER BY flight")
    yield "DuckDB", found.columns, found.fetchall()


def main(folder):
    folder = pathlib.Path(folder)
    columns, rows = expected(folder)
    for name, found_columns, found in tables(folder / "flights.parquet"):
        found = [[plain(value) for value in row] for row in found]
        if found_columns != columns:
            sys.exit(f"read_campaign.py: {name} has the columns {found_columns}, expected {columns}")
        for row, expected_row in zip(found, rows, strict=True):
            if row != expected_row:
                sys.exit(f"read_campaign.py: {name} has {row}, expected {expected_row}")
    print(len(rows))


if __name__ == "__main__":
    main(*sys.argv[1:])
