"""Checks licences and sources of all dependencies against deny.toml, without building anything.

cargo-deny checks the same and known vulnerabilities too, but takes minutes to build: see scripts/test.
Usage: python3 scripts/check_dependencies.py
"""

import json
import re
import subprocess
import sys
import tomllib

CRATES_IO = "registry+https://github.com/rust-lang/crates.io-index"


def is_allowed(expression, allowed):
    """Whether an SPDX expression of OR, AND, WITH and brackets can be met by the allowed licences."""
    words = re.findall(r"\(|\)|[^\s()]+", expression.replace("/", " OR "))
    # An exception only ever adds a permission.
    plain = [word for i, word in enumerate(words) if word != "WITH" and (i == 0 or words[i - 1] != "WITH")]
    known = {"OR": "or", "AND": "and", "(": "(", ")": ")"}
    return eval(" ".join(known.get(word, str(word in allowed)) for word in plain))  # only brackets and booleans


def main():
    with open("deny.toml", "rb") as file:
        licenses = tomllib.load(file)["licenses"]
    allowed = set(licenses["allow"])
    exceptions = {item["crate"]: set(item["allow"]) for item in licenses.get("exceptions", [])}
    command = ["cargo", "metadata", "--format-version", "1", "--locked", "--filter-platform", "x86_64-unknown-linux-gnu"]
    metadata = json.loads(subprocess.run(command, check=True, capture_output=True).stdout)
    used = {node["id"] for node in metadata["resolve"]["nodes"]}
    packages = [package for package in metadata["packages"] if package["id"] in used]
    wrong = []
    for package in packages:
        name = f"{package['name']} {package['version']}"
        of_package = allowed | exceptions.get(package["name"], set())
        if not is_allowed(package["license"] or "none", of_package):
            wrong.append(f"{name}: licence {package['license']}, allowed are {', '.join(sorted(allowed))}")
        if package["source"] not in (None, CRATES_IO):
            wrong.append(f"{name}: source {package['source']}, expected crates.io")
    print("\n".join(wrong) or f"{len(packages)} packages: licences and sources are allowed")
    sys.exit(bool(wrong))


main()
