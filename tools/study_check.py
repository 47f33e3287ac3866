#!/usr/bin/env python3
"""Checks the errors of a study against separate cooks.

    convect study graph.json --knob … --output NAME [--set KEY=VALUE]… --json study.json
    tools/study_check.py graph.json study.json [--set KEY=VALUE]… [--convect PROGRAM]

Cooks the reference of the study and each of its runs with `convect cook --format json`, computes mean, p99 and max of its norm by
itself, and compares them with those that the study stored: no more than 1e-6 apart, relative to the larger, unless both are below
1e-12. `--set` are the study's own. Needs no library. Meshes must be of triangles and quads;
distances between surfaces are found by trying all triangles, so keep scenes small.
"""

import argparse
import json
import math
import struct
import subprocess
import sys
import tempfile
from pathlib import Path

RELATIVE = 1e-6
COMPONENTS = ("curves", "mesh", "points", "tets")


def single(x):
    """The f32 whose shortest decimal form this is."""
    return struct.unpack("f", struct.pack("f", x))[0]


def rows(values):
    return [tuple(map(single, v)) if isinstance(v, list) else (single(v),) for v in values]


def cook(program, graph, output, frames, settings, folder):
    """All frames, and the report, of a cook."""
    command = [program, "cook", graph, "--output", output, "--format", "json", "--quiet", "--out", folder, "--report", f"{folder}/r.txt"]
    command += ["--frames", ",".join(str(frame) for frame in frames)]
    for key, value in settings.items():
        command += ["--set", f"{key}={json.dumps(value)}"]
    subprocess.run(command, check=True)
    stem = Path(folder) / output
    files = sorted(stem.parent.glob(f"{stem.name}.*.json"))
    found = {frame["frame"]: frame for frame in (json.loads(file.read_text()) for file in files)}
    return [found[frame] for frame in frames], json.loads(Path(folder, "r.txt").read_text())


def sub(a, b):
    return tuple(x - y for x, y in zip(a, b))


def dot(a, b):
    return sum(x * y for x, y in zip(a, b))


def length(a):
    return math.sqrt(dot(a, a))


def along(a, b, s):
    return tuple(x + s * (y - x) for x, y in zip(a, b))


def to_segment(p, a, b):
    ab = sub(b, a)
    size = dot(ab, ab)
    s = 0.0 if size == 0.0 else min(1.0, max(0.0, dot(sub(p, a), ab) / size))
    return length(sub(p, along(a, b, s)))


def cross(a, b):
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def to_triangle(p, a, b, c):
    normal = cross(sub(b, a), sub(c, a))
    size = dot(normal, normal)
    if size > 0.0:
        inside = all(dot(cross(sub(t, f), sub(p, f)), normal) >= 0.0 for f, t in ((a, b), (b, c), (c, a)))
        if inside:
            return abs(dot(sub(p, a), normal)) / math.sqrt(size)
    return min(to_segment(p, a, b), to_segment(p, b, c), to_segment(p, c, a))


def polylines(part):
    points, at, lines = rows(part["points"]), 0, []
    for count in part["counts"]:
        lines.append(points[at : at + count])
        at += count
    return lines


def second_to_fourth(corners):
    """Whether the line from the second to the fourth corner of a quad is inside it, seen along the axis that it faces most."""
    normal = [0.0, 0.0, 0.0]
    for k, a in enumerate(corners):
        b = corners[(k + 1) % 4]
        for axis in range(3):
            u, v = (axis + 1) % 3, (axis + 2) % 3
            normal[axis] += (a[u] - b[u]) * (a[v] + b[v])
    axis = max(range(3), key=lambda axis: abs(normal[axis]))
    u, v = (axis + 1) % 3, (axis + 2) % 3
    side = 1 if normal[axis] > 0 else -1

    def turns_left(a, b, c):
        return side * ((b[u] - a[u]) * (c[v] - a[v]) - (b[v] - a[v]) * (c[u] - a[u])) > 0

    a, b, c, d = corners
    return turns_left(d, a, b) and turns_left(b, c, d)


def triangles(name, part, fans=False):
    if name == "mesh":
        found, at, points = [], 0, rows(part["points"])
        for count in part["counts"]:
            face = part["indices"][at : at + count]
            at += count
            if count > 4:
                sys.exit("the mesh has polygons of more than four corners")
            if count == 4:
                # A surface is split from the second to the fourth corner where that lies inside, a volume from the first to
                # the third.
                a, b, c, d = face
                first = fans or not second_to_fourth([points[k] for k in face])
                found += [(a, b, c), (a, c, d)] if first else [(d, a, b), (d, b, c)]
            else:
                found.append(tuple(face))
        return found
    faces = {}
    for a, b, c, d in part["indices"]:
        for face in ((b, c, d), (a, d, c), (a, b, d), (a, c, b)):
            faces.setdefault(tuple(sorted(face)), []).append(face)
    return [same[0] for same in faces.values() if len(same) == 1]


def curves_way(pairs):
    """Distances with half of the lengths of the segments at each point."""
    found = []
    for line, other in pairs:
        for k, p in enumerate(line):
            near = [to_segment(p, a, b) for a, b in zip(other, other[1:])] or [length(sub(p, other[0]))]
            size = sum(length(sub(line[k + step], p)) / 2 for step in (-1, 1) if 0 <= k + step < len(line))
            found.append((min(near), size))
    return found


def surface_way(name, part, other):
    """Distances of all points in use with a third of the area around each."""
    points, own = rows(part["points"]), triangles(name, part)
    area = {}
    for face in own:
        a, b, c = (points[k] for k in face)
        third = length(cross(sub(b, a), sub(c, a))) / 6
        for k in face:
            area[k] = area.get(k, 0.0) + third
    there = rows(other["points"])
    shapes = [tuple(there[k] for k in face) for face in triangles(name, other)]
    return [(min(to_triangle(points[k], *shape) for shape in shapes), area[k]) for k in sorted(area)]


def volume(frame):
    if "mesh" in frame:
        points = rows(frame["mesh"]["points"])
        faces = triangles("mesh", frame["mesh"], fans=True)
        return sum(dot(points[a], cross(points[b], points[c])) for a, b, c in faces) / 6
    points = rows(frame["tets"]["points"])
    each = (tuple(points[k] for k in tet) for tet in frame["tets"]["indices"])
    return sum(dot(sub(b, a), cross(sub(c, a), sub(d, a))) for a, b, c, d in each) / 6


def differences(norm, frame, reference):
    """Numbers with their weights."""
    if norm == "volume":
        return [(abs(volume(frame) - volume(reference)), 1.0)]
    found = []
    for name in COMPONENTS:
        a, b = frame.get(name), reference.get(name)
        if a is None or b is None:
            continue
        if norm == "surface":
            if name == "curves":
                p, q = polylines(a), polylines(b)
                ways = curves_way(zip(p, q)), curves_way(zip(q, p))
            else:
                ways = surface_way(name, a, b), surface_way(name, b, a)
            for way in ways:
                total = sum(size for _, size in way)
                found += [(distance, 0.5 * size / total) for distance, size in way]
            continue
        if norm in ("points", "P"):
            pairs = [(a["points"], b["points"])]
        else:
            tables = ("point_attributes", "element_attributes")
            pairs = [(a[t][norm], b[t][norm]) for t in tables if norm in a.get(t, {})]
        for p, q in pairs:
            if len(p) != len(q):
                sys.exit(f"two results have {len(p)} and {len(q)} rows")
            found += [(length(sub(x, y)), 1.0) for x, y in zip(rows(p), rows(q))]
    return found


def statistics(found):
    found = sorted(found)
    total = sum(weight for _, weight in found)
    summed, p99 = 0.0, found[-1][0]
    for number, weight in found:
        summed += weight
        if summed >= 0.99 * total * (1 - 1e-12):
            p99 = number
            break
    return {"mean": sum(n * w for n, w in found) / total, "p99": p99, "max": found[-1][0]}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("graph")
    parser.add_argument("study")
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE")
    parser.add_argument("--convect", default="convect", metavar="PROGRAM")
    args = parser.parse_args()
    study = json.loads(Path(args.study).read_text())
    fixed = {}
    for pair in args.set:
        key, value = pair.split("=", 1)
        try:
            fixed[key] = json.loads(value)
        except ValueError:
            fixed[key] = value
    norm, frames, output = study["norm"], study["frames"], study["output"]

    def cooked(settings):
        with tempfile.TemporaryDirectory() as folder:
            return cook(args.convect, args.graph, output, frames, {**fixed, **settings}, folder)

    def metric(report):
        node, name = norm.split(".")
        return report["nodes"][node]["metrics"][name]

    reference, its_report = cooked(study["reference"]["settings"])
    worst = 0.0
    for number, run in enumerate(study["runs"]):
        if run["failed"] is not None:
            print(f"run {number} failed: {run['failed']}")
            continue
        found, report = cooked(run["settings"])
        if "." in norm:
            own, theirs = metric(report), metric(its_report)
            each = [(abs(own[frame] - theirs[frame]), 1.0) for frame in own if frame in theirs]
        else:
            each = [pair for both in zip(found, reference) for pair in differences(norm, *both)]
        own = statistics(each)
        for name, value in own.items():
            stated = run["error"][name]
            larger = max(abs(value), abs(stated))
            apart = 0.0 if larger < 1e-12 else abs(value - stated) / larger
            worst = max(worst, apart)
            if apart > RELATIVE:
                sys.exit(f"run {number} {run['settings']}: {name} is {stated} in the study, but {value} here")
        print(f"run {number} {run['settings']}: mean {own['mean']:.6e} p99 {own['p99']:.6e} max {own['max']:.6e} as stated")
    print(f"at most {worst:.1e} apart")


main()
