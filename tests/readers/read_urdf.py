"""Prints what a reader of URDF files finds in one, as JSON. Usage: read_urdf.py FILE"""

import json
import sys

from urdf_parser_py import urdf

KINDS = {urdf.Box: "box", urdf.Cylinder: "cylinder", urdf.Sphere: "sphere"}


def part(element):
    geometry = element.geometry
    kind = KINDS[type(geometry)]
    size = {
        "box": lambda: list(geometry.size),
        "cylinder": lambda: [geometry.radius, geometry.length],
        "sphere": lambda: [geometry.radius],
    }[kind]()
    return {"kind": kind, "size": size, "xyz": list(element.origin.xyz), "rpy": list(element.origin.rpy)}


def main(path):
    with open(path, "rb") as file:
        robot = urdf.URDF.from_xml_string(file.read())
    root = robot.link_map[robot.get_root()]
    inertial = root.inertial
    colours = {material.name: material.color.rgba for material in robot.materials}
    visuals = [
        {"name": visual.name, "colour": colours[visual.material.name], **part(visual)} for visual in root.visuals
    ]
    found = {
        "robot": robot.name,
        "links": [link.name for link in robot.links],
        "root": root.name,
        "mass": inertial.mass,
        "centre": list(inertial.origin.xyz),
        "inertia": [list(row) for row in inertial.inertia.to_matrix()],
        "seen": visuals,
        "touching": [part(collision) for collision in root.collisions],
    }
    json.dump(found, sys.stdout)


main(sys.argv[1])
