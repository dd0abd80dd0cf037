"""Reads the tables of an exported recording with pandas, polars and DuckDB, and compares each value with the recording as the package
mcap reads it. Usage: read_export.py RECORDING FOLDER; prints the number of values that were compared."""

import json
import pathlib
import sys

import duckdb
import pandas
import polars
import pyarrow.parquet
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory


def leaves(value, path=""):
    """Fields of a message with their paths, in the order of its definition, without padding."""
    if hasattr(value, "__slots__"):
        for name in value.__slots__:
            if not (name.startswith("pad") and name[3:].isdigit()):
                yield from leaves(getattr(value, name), f"{path}.{name}" if path else name)
    elif isinstance(value, (list, tuple)) or hasattr(value, "tolist"):
        for index, part in enumerate(value):
            yield from leaves(part, f"{path}[{index}]")
    else:
        yield path, value


def recorded(path):
    """Rows of each topic: tick, time, and fields by path."""
    topics = {}
    with open(path, "rb") as file:
        for _, channel, message, decoded in make_reader(file, decoder_factories=[DecoderFactory()]).iter_decoded_messages():
            row = {"tick": message.sequence, "time_ns": message.log_time, **dict(leaves(decoded))}
            topics.setdefault(channel.topic, []).append(row)
    return topics


def tables(stem):
    """Each reader's name, columns and rows."""
    frame = pandas.read_csv(f"{stem}.csv", keep_default_na=False)
    yield "pandas (CSV)", list(frame.columns), frame.itertuples(index=False, name=None)
    frame = pandas.read_parquet(f"{stem}.parquet")
    yield "pandas", list(frame.columns), frame.itertuples(index=False, name=None)
    frame = polars.read_parquet(f"{stem}.parquet")
    yield "polars", frame.columns, frame.iter_rows()
    found = duckdb.sql(f"SELECT * FROM read_parquet('{stem}.parquet') ORDER BY tick")
    yield "DuckDB", found.columns, found.fetchall()


def main():
    recording, folder = sys.argv[1], pathlib.Path(sys.argv[2])
    compared = 0
    for topic, rows in recorded(recording).items():
        stem = folder / topic.lstrip("/").replace("/", ".")
        for reader, columns, read in tables(stem):
            read = list(read)
            if columns != list(rows[0]) or len(read) != len(rows):
                sys.exit(f"read_export.py: {reader} has {len(read)} rows of {columns} for {topic}, expected {len(rows)} of {list(rows[0])}")
            for found, row in zip(read, rows):
                for column, value, expected in zip(columns, found, row.values()):
                    value = value.item() if hasattr(value, "item") else value
                    if value != expected:
                        sys.exit(f"read_export.py: {reader} has {value!r} for {column} of {topic} at tick {row['tick']}, expected {expected!r}")
                    compared += 1
        metadata = pyarrow.parquet.read_schema(f"{stem}.parquet").metadata
        if topic == "/plant/state" and metadata.get(b"unit of position.z") != b"m":
            sys.exit(f"read_export.py: the unit of position.z is {metadata}")
    print(json.dumps(compared))


main()
