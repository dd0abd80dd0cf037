"""Lines of the table of docs/scenarios.md from the summaries that scripts/scenarios keeps."""

import json
import sys


def number(value):
    # JSON has no NaN: what is not a number comes as null.
    return "not a number" if value is None else f"{value:.4g}"


def shown(verdict):
    values = " … ".join(number(value) for value in verdict["values"])
    return values if verdict["passed"] else f"**{values or 'nothing'}**"


def limits(verdict):
    sides = (("≥", verdict["min"]), ("≤", verdict["max"]))
    parts = [f"{sign} {number(limit)}" for sign, limit in sides if limit is not None] or ["none, in"]
    return f"{', '.join(parts)} {verdict['unit']}"


def main(name, folder, seeds):
    flights = []
    for seed in seeds.split():
        with open(f"{folder}/{name}-{seed}.json", encoding="utf-8") as summary:
            told = json.load(summary)
            flights.append(told["pass"] + told["measures"])
    for verdicts in zip(*flights, strict=True):
        columns = [name, verdicts[0]["name"], *map(shown, verdicts), limits(verdicts[0])]
        print(f"| {' | '.join(columns)} |")


main(*sys.argv[1:])
