"""Prints the graph of a manifest for Graphviz: processes as boxes, topics on the edges, delayed edges dashed.

Usage: hummingbus check --json MANIFEST | python3 scripts/plot_graph.py | dot -Tsvg -o docs/img/hover-graph.svg
"""

import json
import sys


def main():
    plan = json.load(sys.stdin)
    rate_hz = 1e9 / plan["tick_ns"]
    publisher = {output["topic"]: node["name"] for node in plan["nodes"] for output in node["outputs"]}
    print("strict digraph run {\n  rankdir=LR; node [shape=box, style=rounded, fontname=Helvetica];")
    print("  edge [fontname=Helvetica, fontsize=10];")
    for node in plan["nodes"]:
        print(f'  "{node["name"]}" [label="{node["name"]}\\n{rate_hz / node["period_ticks"]:g} Hz"];')
        for edge in node["inputs"]:
            source = publisher[edge["topic"]]
            topic = plan["topics"][edge["topic"]]["name"]
            if not node["outputs"]:
                # A recorder takes every topic: one thin line per process is enough.
                print(f'  "{source}" -> "{node["name"]}" [color=gray, arrowsize=0.5];')
            elif edge["delay_ticks"]:
                print(f'  "{source}" -> "{node["name"]}" [label="{topic}\\n1 tick later", style=dashed];')
            else:
                print(f'  "{source}" -> "{node["name"]}" [label="{topic}"];')
    print("}")


if __name__ == "__main__":
    main()
