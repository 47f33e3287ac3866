#!/usr/bin/env python3
"""Checks .usda and .usdc files against the json frames of the same cook, with USD's own library.

    usd_check.py [--frames DIR] FILE...      needs usd-core and numpy
    usd_check.py --bpy FILE...               needs bpy: opens each file in Blender

A file NAME.usdc is compared with DIR/NAME.*.json (beside it by default), as `convect cook --format json` writes them;
there a float may also be a string of its eight hexadecimal digits, and `outputs` may list the geometries of a stage with
several outputs, each with its name as `output`. What is checked: the file opens; every validator of
UsdValidation is silent; stage, prims, types, interpolations and sample times are as the layout says; every value comes
back bit for bit (from text a NaN only as a NaN); extents are those that USD computes; nothing is printed to stderr.
Files are shared among a few processes; one that ends early is a fault of all files that it had left. Exit code 0 means
that all of it holds.
"""

import argparse
import ctypes
import json
import os
import re
import subprocess
import sys
import tempfile
import traceback
from pathlib import Path

KINDS = {"curves": "BasisCurves", "mesh": "Mesh", "points": "Points", "tets": "TetMesh"}
TOKENS = {
    "curves": {"type": "linear", "wrap": "nonperiodic"},
    "mesh": {"subdivisionScheme": "none"},
    "points": {},
    "tets": {},
}
TABLES = {"point_attributes": "vertex", "element_attributes": "uniform", "attributes": "constant"}
TYPES = {
    "points": "point3f[]",
    "velocities": "vector3f[]",
    "normals": "normal3f[]",
    "widths": "float[]",
    "ids": "int64[]",
    "extent": "float3[]",
    "curveVertexCounts": "int[]",
    "faceVertexCounts": "int[]",
    "faceVertexIndices": "int[]",
    "tetVertexIndices": "int4[]",
    "surfaceFaceVertexIndices": "int3[]",
    "primvars:displayColor": "color3f[]",
}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--frames", type=Path, help="where the json frames lie")
    parser.add_argument("--bpy", action="store_true", help="open in Blender instead")
    parser.add_argument("--here", action="store_true", help=argparse.SUPPRESS)
    parser.add_argument("files", type=Path, nargs="+", metavar="FILE")
    args = parser.parse_args()
    if args.here:
        return check_here(args)
    # As many processes as processors: to load a library takes longer than to check most files.
    count = min(os.cpu_count() or 1, len(args.files))
    command = [sys.executable, __file__, "--here"] + (["--bpy"] if args.bpy else [])
    command += ["--frames", args.frames] if args.frames else []
    shares = [args.files[place::count] for place in range(count)]
    running = [subprocess.Popen(list(map(str, command + share)), stdout=subprocess.PIPE, text=True) for share in shares]
    found = {}
    for process, share in zip(running, shares):
        lines = process.communicate()[0].splitlines()
        found |= {file: json.loads(line) for file, line in zip(share, lines)}
        for file in share[len(lines):]:
            found[file] = [f"its process ended with {process.returncode}"]
    for file in args.files:
        print(f"{file}: {f'{len(found[file])} faults' if found[file] else 'ok'}")
        print("".join(f"  {fault}\n" for fault in found[file][:20]), end="")
    return any(found.values())


def check_here(args):
    """Checks files one after another and prints the faults of each as a line of JSON."""
    own = os.fdopen(os.dup(1), "w")
    check = open_in_blender if args.bpy else check_file
    for file in args.files:
        # Of the libraries' own, too.
        with tempfile.TemporaryFile() as out, tempfile.TemporaryFile() as err:
            os.dup2(out.fileno(), 1)
            os.dup2(err.fileno(), 2)
            try:
                print("\n".join(check(file, args.frames or file.parent)), flush=True)
            except BaseException:
                traceback.print_exc()
            sys.stderr.flush()
            # What the libraries' own buffers hold.
            ctypes.CDLL(None).fflush(None)
            for stream in (out, err):
                stream.seek(0)
            said, complaints = (stream.read().decode(errors="replace").splitlines() for stream in (out, err))
        faults = [line for line in said if line] + [f"stderr: {line}" for line in complaints]
        if args.bpy:
            faults = [line for line in faults if re.search("warn|error|fault:|traceback|cannot", line, re.I)]
        print(json.dumps(faults), file=own, flush=True)


def open_in_blender(file, folder):
    """Imports the file and evaluates its whole frames; Blender prints what it does not like."""
    import bpy
    import numpy as np

    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.wm.usd_import(filepath=str(file.resolve()))
    graph = bpy.context.evaluated_depsgraph_get()
    faults = []
    for frame in frames_of(file, folder):
        if frame["frame"] != int(frame["frame"]):
            continue
        bpy.context.scene.frame_set(int(frame["frame"]))
        for kind, thing, part in things_of(bpy, frame):
            # An empty component may have no such attribute.
            position = thing.evaluated_get(graph).data.attributes.get("position")
            found = np.zeros(3 * len(position.data) if position else 0, dtype=np.float32)
            if position:
                position.data.foreach_get("vector", found)
            expected = array_of(part.get("points", []), "point3f[]")
            if found.tobytes() != expected.tobytes():
                faults.append(f"fault: {kind} at {frame['frame']} have {short(found)}, expected {short(expected)}")
    return faults


def things_of(bpy, frame):
    """Kind, Blender's object and component of all that a frame holds."""
    names = identifiers([one["output"] for one in frame.get("outputs", [])])
    for name, part in zip(names, frame["outputs"]) if names else [(None, frame)]:
        for kind in ("curves", "mesh", "points"):
            if names:
                # Of equal names all but one get a number. Blender drops what has a single child, so that this is one level
                # higher.
                under = bpy.data.objects.get(name)
                found = [
                    thing
                    for thing in bpy.data.objects
                    if thing.name.split(".")[0] == kind
                    and thing.parent
                    and (thing.parent == under if under else thing.parent.name not in names)
                ]
                thing = found[0] if found else None
                if thing is None and kind in part:
                    print(f"fault: there is no {kind} under {name}")
            else:
                thing = bpy.data.objects.get(kind)
            if thing is not None:
                yield kind, thing, part.get(kind, {})


def identifiers(names):
    """What names of outputs become: identifiers, those that are some already first, the others with numbers if taken."""
    def plain(name):
        return re.sub("^(?=[0-9]|$)", "_", re.sub("[^A-Za-z0-9_]", "_", name))

    taken = {name for name in names if plain(name) == name}
    found = []
    for name in names:
        own, number = plain(name), 2
        while own != name and own in taken:
            own, number = f"{plain(name)}_{number}", number + 1
        taken.add(own)
        found.append(own)
    return found


def frames_of(file, folder):
    """The json frames of a file, in the order of time."""
    frames = [json.loads(path.read_text()) for path in folder.glob(f"{file.stem}.*.json")]
    return sorted(frames, key=lambda frame: frame["frame"])


def check_file(file, folder):
    """Every fault of the file as a line."""
    from pxr import Usd, UsdGeom, UsdValidation

    frames = frames_of(file, folder)
    stage = Usd.Stage.Open(str(file))
    validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
    faults = [
        f"{error.GetName()}: {error.GetMessage()}"
        for error in UsdValidation.ValidationContext(validators).Validate(stage)
    ]
    root = stage.GetDefaultPrim()
    (name,) = identifiers([file.stem])
    outputs = [one["output"] for one in frames[0].get("outputs", [])] if frames else []
    kinds = [kind for kind in KINDS if any(kind in frame for frame in frames)]
    times = [float(frame["frame"]) for frame in frames]
    layer = stage.GetRootLayer()
    facts = {
        "default prim": (root.GetName(), name),
        "root type": (root.GetTypeName(), "Xform"),
        "metersPerUnit": (UsdGeom.GetStageMetersPerUnit(stage), 1.0),
        "upAxis": (UsdGeom.GetStageUpAxis(stage), "Y"),
        "framesPerSecond": (stage.GetFramesPerSecond(), stage.GetTimeCodesPerSecond()),
        "startTimeCode": (layer.startTimeCode if times else 0, times[0] if times else 0),
        "endTimeCode": (layer.endTimeCode if times else 0, times[-1] if times else 0),
        "prims": ([prim.GetName() for prim in root.GetChildren()], identifiers(outputs) or kinds),
    }
    for frame in frames:
        if frame.get("time") and frame["frame"]:
            fps = frame["frame"] / frame["time"]
            facts["timeCodesPerSecond"] = (round(stage.GetTimeCodesPerSecond(), 3), round(fps, 3))
    faults += [f"{fact} is {found}, expected {expected}" for fact, (found, expected) in facts.items() if found != expected]
    lossy_nan = file.suffix == ".usda"
    for prim, parts in zip(root.GetChildren(), zip(*(frame["outputs"] for frame in frames))) if outputs else [(root, frames)]:
        kinds = [kind for kind in KINDS if any(kind in part for part in parts)]
        if outputs:
            own = parts[0]["output"]
            for fact, found, wanted in [
                ("type", prim.GetTypeName(), "Xform"),
                ("name", prim.GetDisplayName() or prim.GetName(), own),
                ("prims", [child.GetName() for child in prim.GetChildren()], kinds),
            ]:
                if found != wanted:
                    faults.append(f"{prim.GetPath()}: {fact} is {found}, expected {wanted}")
        for kind in kinds:
            faults += check_prim(prim.GetChild(kind), kind, [part.get(kind) for part in parts], times, lossy_nan)
    return faults


def check_prim(prim, kind, parts, times, lossy_nan):
    """Every fault of a prim; `parts` are its component in each frame, or None."""
    import numpy as np
    from pxr import UsdGeom

    where = prim.GetPath()
    if prim.GetTypeName() != KINDS[kind]:
        yield f"{where} is a {prim.GetTypeName()}, expected {KINDS[kind]}"
    attributes = {attribute.GetName(): attribute for attribute in prim.GetAuthoredAttributes()}
    for name, value in TOKENS[kind].items():
        if attributes[name].Get() != value:
            yield f"{where}.{name} is {attributes[name].Get()}, expected {value}"
    parts, wanted = with_widths(kind, parts), {}
    for place, part in enumerate(parts):
        for key, values in expected_values(kind, part or {}):
            wanted.setdefault(key, [None] * len(parts))[place] = values
    found = {}
    for name, attribute in attributes.items():
        if name == "primvars:st":
            uvw = attributes["primvars:uvw"]
            for time in times or [0]:
                st, of = attribute.Get(time), uvw.Get(time)
                if (st is None) != (of is None) or st and not same(st, np.ascontiguousarray(np.array(of)[:, :2]), True):
                    yield f"{where}.primvars:st at {time} is not the first two of uvw"
            if attribute.GetTypeName() != "texCoord2f[]":
                yield f"{where}.primvars:st is {attribute.GetTypeName()}, expected texCoord2f[]"
        elif name not in TOKENS[kind]:
            found[source_of(kind, attribute)] = attribute
    derived = {("extent", None)} | ({("surfaceFaceVertexIndices", None)} if kind == "tets" else set())
    missing, surplus = (set(wanted) | derived) - set(found), set(found) - set(wanted) - derived
    if missing or surplus:
        yield f"{where} lacks {sorted(map(str, missing))} and has {sorted(map(str, surplus))} too much"
        return
    for key, attribute in found.items():
        samples = attribute.GetTimeSamples()
        if samples and samples != times:
            yield f"{attribute.GetPath()} has samples at {samples}, expected {times}"
        if key not in derived:
            yield from check_values(attribute, key, wanted[key], parts, times, lossy_nan)
    moving = {bool(found[key].GetTimeSamples()) for key in [("P", "vertex"), ("v", "vertex")] if key in found}
    if len(moving) > 1:
        yield f"{where}: of points and velocities only one is sampled"
    for time, part in zip(times, parts):
        computed = UsdGeom.Boundable.ComputeExtentFromPlugins(UsdGeom.Boundable(prim), time)
        if not same(found["extent", None].Get(time), computed, True):
            yield f"{where}.extent at {time} is {found['extent', None].Get(time)}, expected {computed}"
        if kind == "tets" and part and part["indices"]:
            tets = UsdGeom.TetMesh(prim)
            surface = rotated(found["surfaceFaceVertexIndices", None].Get(time))
            computed = rotated(UsdGeom.TetMesh.ComputeSurfaceFaces(tets, time))
            if surface != computed:
                yield f"{where}: the surface at {time} is {surface}, expected {computed}"


def with_widths(kind, parts):
    """Components with the widths that curves without any get: one for all, or one for each CV if other frames have."""
    if kind != "curves":
        return parts
    some = any("width" in part.get("point_attributes", {}) for part in parts if part)

    def with_width(part):
        if some:
            widths = {"width": [0.001] * len(part["points"])} | part.get("point_attributes", {})
            return part | {"point_attributes": widths}
        return part | {"attributes": part.get("attributes", {}) | {"widths": [0.001]}}

    return [part and with_width(part) for part in parts]


def expected_values(kind, part):
    """(name, interpolation) and values of everything a component has."""
    for array in ("counts", "indices"):
        if array in part:
            yield (array, None), part[array]
    if "points" in part:
        yield ("P", "vertex"), part["points"]
    for table, interpolation in TABLES.items():
        for name, values in part.get(table, {}).items():
            yield (name, interpolation), values


def source_of(kind, attribute):
    """Name and interpolation in the json form of what became this attribute."""
    from pxr import UsdGeom

    schema = {"points": "P", "velocities": "v", "normals": "N", "widths": "width", "ids": "id"}
    counts = {
        "curveVertexCounts": "counts",
        "faceVertexCounts": "counts",
        "faceVertexIndices": "indices",
        "tetVertexIndices": "indices",
    }
    name = attribute.GetName()
    if not name.startswith("primvars:"):
        if name == "widths" and attribute.GetMetadata("interpolation") == "constant":
            return "widths", "constant"
        return (schema[name], "vertex") if name in schema else (counts.get(name, name), None)
    own = attribute.GetDisplayName() or name.removeprefix("primvars:")
    if own == name.removeprefix("primvars:") and kind == "curves" and own == "id":
        raise SystemExit("fault: Blender drops a primvar called id on curves")
    return own, UsdGeom.Primvar(attribute).GetInterpolation()


def check_values(attribute, key, wanted, parts, times, lossy_nan):
    """Every fault of an attribute's type, interpolation and values."""
    from pxr import UsdGeom

    where, (name, interpolation) = attribute.GetPath(), key
    kind = attribute.GetTypeName()
    example = next((values for values in wanted if values), None)
    schema = TYPES.get(attribute.GetName())
    expected = schema or (type_of(name, example) if example else str(kind))
    if kind != expected:
        yield f"{where} is {kind}, expected {expected}"
    is_primvar = attribute.GetName().startswith("primvars:") or attribute.GetName() in ("widths", "normals")
    if is_primvar and attribute.GetMetadata("interpolation") != interpolation:
        yield f"{where} is {attribute.GetMetadata('interpolation')}, expected {interpolation}"
    primvar = UsdGeom.Primvar(attribute)
    if primvar and primvar.IsIndexed():
        yield f"{where} is indexed"
    for time, values, part in zip(times, wanted, parts):
        value = attribute.Get(time)
        if values is None and (part is not None or interpolation == "constant"):
            if value is not None:
                yield f"{where} at {time} is {short(value)}, expected no value"
        elif value is None or not same(value, array_of(values or [], kind), lossy_nan):
            yield f"{where} at {time} is {short(value)}, expected {short(values or [])}"


def type_of(name, values):
    """USD type of a primvar with such values."""
    row = values[0]
    width = len(row) if isinstance(row, list) else 1
    number = row[0] if isinstance(row, list) else row
    if isinstance(number, int):
        return {1: "int[]", 3: "int3[]", 4: "int4[]"}[width]
    if name == "Cd" and width == 3:
        return "color3f[]"
    named = {"Pref": "point3f[]", "P": "point3f[]", "v": "vector3f[]", "N": "normal3f[]", "orient": "quatf[]"}
    return named.get(name) or {1: "float[]", 3: "float3[]", 4: "color4f[]"}[width]


def array_of(values, kind):
    """Json values as numpy sees an array of that USD type."""
    import numpy as np

    if str(kind).startswith("int"):
        return np.array(values, dtype=np.int64 if kind == "int64[]" else np.int32)
    flat = values if not values or not isinstance(values[0], list) else [x for row in values for x in row]
    if flat and isinstance(flat[0], str):
        array = np.array([int(bits, 16) for bits in flat], dtype=np.uint32).view(np.float32)
    else:
        array = np.array(flat, dtype=np.float64).astype(np.float32)
    return array.reshape(len(values), -1) if flat is not values else array


def same(value, expected, any_nan):
    """Whether both have the same type and bits; with `any_nan` one NaN is as good as another."""
    import numpy as np

    value, expected = np.array(value), np.array(expected)
    if value.size == 0 and expected.size == 0:
        return value.dtype == expected.dtype
    if value.dtype != expected.dtype or value.shape != expected.shape:
        return False
    if any_nan and value.dtype == np.float32:
        value, expected = (np.where(np.isnan(x), np.float32(np.nan), x) for x in (value, expected))
    return value.tobytes() == expected.tobytes()


def rotated(faces):
    """Faces as a set, each from its least corner on."""
    def least_first(face):
        face = list(face)
        start = face.index(min(face))
        return tuple(face[start:] + face[:start])

    return {least_first(face) for face in faces}


def short(value):
    text = str(value)
    return text if len(text) < 200 else text[:200] + "…"


if __name__ == "__main__":
    sys.exit(main())
