#!/usr/bin/env python3
"""Checks convect's reader of USD against USD's own library, on files that the latter writes.

    usd_read_check.py READER FOLDER      needs usd-core and numpy

READER is `target/debug/examples/usd_read` (cargo build -p formats --example usd_read). Files are written to FOLDER: each
crate version that usd-core writes, text and archives; every type and interpolation of a primvar, stacks of transforms,
axes and units, samples read between their times, references, clips. Values are compared bit for bit, halves between
samples too; positions and vectors moved by a transform to 1 part in 10⁶ of their size, by a turn between samples, which USD
interpolates in floats, to 2 in 10⁵. Exit code 0 means that all of it agrees.
"""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np

VERSIONS = ["0.4.0", "0.5.0", "0.6.0", "0.7.0", "0.8.0", "0.9.0", "0.10.0", "0.11.0", "0.12.0"]


def main():
    reader, folder = Path(sys.argv[1]), Path(sys.argv[2])
    if len(sys.argv) > 3:
        return write(folder, sys.argv[3])
    folder.mkdir(parents=True, exist_ok=True)
    faults = 0
    # The version is fixed when USD's library is loaded.
    for version in VERSIONS:
        environment = os.environ | {"USD_WRITE_NEW_USDC_FILES_AS_VERSION": version}
        command = [sys.executable, __file__, reader, folder, version]
        done = subprocess.run(list(map(str, command)), env=environment, capture_output=True, text=True)
        if done.returncode:
            print(f"{version} could not be written: {done.stderr[-400:]}")
            faults += 1
    compared = 0
    for file in sorted(folder.glob("stage.*.usd[acz]")):
        count, wrong = compare(reader, file)
        compared += count
        faults += len(wrong)
        print(f"{file.name}: {count} arrays, {len(wrong)} differ")
        print("".join(f"  {line}\n" for line in wrong[:20]), end="")
    print(f"{compared} arrays compared, {faults} faults")
    return bool(faults)


def numbers(rng, shape, dtype):
    """Random numbers, some of them special."""
    if np.issubdtype(dtype, np.integer):
        return rng.integers(-1000, 1000, shape).astype(dtype)
    most = 3 if dtype == np.float16 else 6
    values = rng.normal(size=shape) * 10.0 ** rng.integers(-most, most, shape)
    return values.astype(dtype)


def primvars(prim, counts, rng, times):
    """Primvars of every type and interpolation."""
    from pxr import Sdf, UsdGeom, Vt

    api = UsdGeom.PrimvarsAPI(prim)
    types = {
        "float": (np.float32, 1), "double": (np.float64, 1), "half": (np.float16, 1), "int": (np.int32, 1),
        "int64": (np.int64, 1), "uint": (np.uint32, 1), "uchar": (np.uint8, 1), "bool": (np.bool_, 1),
        "float2": (np.float32, 2), "float3": (np.float32, 3), "float4": (np.float32, 4), "double2": (np.float64, 2),
        "double3": (np.float64, 3), "double4": (np.float64, 4), "half2": (np.float16, 2), "half3": (np.float16, 3),
        "half4": (np.float16, 4), "int3": (np.int32, 3), "int4": (np.int32, 4), "color3f": (np.float32, 3),
        "color4f": (np.float32, 4), "texCoord2f": (np.float32, 2), "vector3f": (np.float32, 3),
    }
    for place, (name, (dtype, width)) in enumerate(types.items()):
        interpolation = ["vertex", "uniform", "constant"][place % 3]
        kind = Sdf.ValueTypeNames.Find(name + "[]")
        primvar = api.CreatePrimvar(f"of_{name}", kind, interpolation)
        rows = counts[interpolation]
        shape = (rows,) if width == 1 else (rows, width)
        for time in times if place % 2 else [None]:
            if dtype in (np.uint32, np.uint8, np.bool_):
                values = rng.integers(0, 2, shape).astype(dtype)
            else:
                values = numbers(rng, shape, dtype)
            array = primvar.GetAttr().GetTypeName().type.pythonClass.FromNumpy(values)
            primvar.Set(array, time) if time is not None else primvar.Set(array)
    few = api.CreatePrimvar("of_table", Sdf.ValueTypeNames.FloatArray, "vertex")
    few.Set(Vt.FloatArray([float(i % 2) + 0.1 for i in range(counts["vertex"])]))
    indexed = api.CreatePrimvar("indexed", Sdf.ValueTypeNames.FloatArray, "vertex")
    indexed.Set(Vt.FloatArray([0.5, -1.5, 7.25]))
    indexed.SetIndices(Vt.IntArray([int(i) for i in rng.integers(0, 3, counts["vertex"])]))


def write(folder, version):
    from pxr import Gf, Sdf, Usd, UsdGeom, UsdUtils, Vt

    rng = np.random.default_rng(VERSIONS.index(version))
    name = version.replace(".", "_")
    path = folder / f"stage.{name}.usdc"
    if path.exists():
        path.unlink()
    stage = Usd.Stage.CreateNew(str(path))
    UsdGeom.SetStageMetersPerUnit(stage, [1.0, 0.01][VERSIONS.index(version) % 2])
    UsdGeom.SetStageUpAxis(stage, ["Y", "Z"][VERSIONS.index(version) // 2 % 2])
    stage.SetTimeCodesPerSecond(30)
    times = [1.0, 2.0, 3.5]

    root = UsdGeom.Xform.Define(stage, "/root")
    stage.SetDefaultPrim(root.GetPrim())
    move = root.AddTranslateOp()
    move.Set(Gf.Vec3d(1, 2, 3), 1)
    move.Set(Gf.Vec3d(2, 4, 9), 4)
    root.AddRotateXYZOp().Set(Gf.Vec3f(10, 20, 30))
    root.AddScaleOp().Set(Gf.Vec3f(1, 2, 3))
    pivot = root.AddTranslateOp(opSuffix="pivot")
    pivot.Set(Gf.Vec3d(0.5, 0, 0))
    root.AddTranslateOp(opSuffix="pivot", isInverseOp=True)

    plain = UsdGeom.Scope.Define(stage, "/plain")

    curves = UsdGeom.BasisCurves.Define(stage, "/root/curves")
    curves.CreateTypeAttr("linear")
    per_curve = rng.integers(1, 9, 40)
    curves.CreateCurveVertexCountsAttr(Vt.IntArray([int(n) for n in per_curve]))
    points = int(per_curve.sum())
    for time in times:
        curves.CreatePointsAttr().Set(Vt.Vec3fArray.FromNumpy(numbers(rng, (points, 3), np.float32)), time)
    curves.CreateVelocitiesAttr().Set(Vt.Vec3fArray.FromNumpy(numbers(rng, (points, 3), np.float32)))
    curves.CreateWidthsAttr(Vt.FloatArray.FromNumpy(np.abs(numbers(rng, points, np.float32))))
    curves.SetWidthsInterpolation("vertex")
    primvars(curves.GetPrim(), {"vertex": points, "uniform": len(per_curve), "constant": 1}, rng, times)
    turn = UsdGeom.Xformable(curves).AddOrientOp()
    turn.Set(Gf.Quatf(1, 0, 0, 0), 1)
    turn.Set(Gf.Quatf(0.5, 0.5, 0.5, 0.5), 5)

    mesh = UsdGeom.Mesh.Define(stage, "/plain/mesh")
    faces = rng.integers(3, 6, 50)
    points = 60
    mesh.CreateFaceVertexCountsAttr(Vt.IntArray([int(n) for n in faces]))
    corners = rng.integers(0, points, int(faces.sum()))
    corners[:points] = range(points)
    mesh.CreateFaceVertexIndicesAttr(Vt.IntArray([int(i) for i in corners]))
    positions = numbers(rng, (points, 3), np.float32)
    mesh.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(positions))
    mesh.CreateNormalsAttr(Vt.Vec3fArray.FromNumpy(numbers(rng, (points, 3), np.float32)))
    primvars(mesh.GetPrim(), {"vertex": points, "uniform": len(faces), "constant": 1}, rng, times)
    smooth = UsdGeom.PrimvarsAPI(mesh).CreatePrimvar("smooth", Sdf.ValueTypeNames.FloatArray, "faceVarying")
    per_point = numbers(rng, points, np.float32)
    smooth.Set(Vt.FloatArray.FromNumpy(per_point[corners]))

    cloud = UsdGeom.Points.Define(stage, "/plain/cloud")
    cloud.CreatePointsAttr()
    for time, rows in zip(times, [20, 20, 30]):
        cloud.GetPointsAttr().Set(Vt.Vec3fArray.FromNumpy(numbers(rng, (rows, 3), np.float32)), time)
        cloud.CreateIdsAttr().Set(Vt.Int64Array([int(i) for i in range(rows)]), time)
    tets = UsdGeom.TetMesh.Define(stage, "/plain/tets")
    tets.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(numbers(rng, (8, 3), np.float32)))
    tets.CreateTetVertexIndicesAttr(Vt.Vec4iArray([Gf.Vec4i(0, 1, 2, 3), Gf.Vec4i(4, 5, 6, 7)]))
    reset = UsdGeom.Points.Define(stage, "/root/reset")
    reset.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(numbers(rng, (5, 3), np.float32)))
    reset.SetResetXformStack(True)
    reset.AddTransformOp().Set(Gf.Matrix4d(0, 1, 0, 0, -1, 0, 0, 0, 0, 0, 2, 0, 5, 6, 7, 1))
    stage.GetRootLayer().Save()

    if version == VERSIONS[-1]:
        stage.GetRootLayer().Export(str(folder / "stage.text.usda"))
        UsdUtils.CreateNewUsdzPackage(str(path), str(folder / "stage.archive.usdz"))
        reference(folder, path)


def reference(folder, path):
    from pxr import Gf, Sdf, Usd, UsdGeom

    for suffix in ["usda", "usdc"]:
        file = folder / f"stage.reference_{suffix}.{suffix}"
        if file.exists():
            file.unlink()
        stage = Usd.Stage.CreateNew(str(file))
        UsdGeom.SetStageMetersPerUnit(stage, 1)
        UsdGeom.SetStageUpAxis(stage, "Y")
        stage.SetTimeCodesPerSecond(60)
        prim = UsdGeom.Xform.Define(stage, "/shot/fur")
        prim.GetPrim().GetReferences().AddReference(f"./{path.name}", "/root", Sdf.LayerOffset(10, 2))
        prim.AddRotateYOp().Set(90)
        prim.GetXformOpOrderAttr().Set(["xformOp:rotateY"])
        over = UsdGeom.Points.Define(stage, "/shot/fur/extra")
        over.CreatePointsAttr([Gf.Vec3f(1, 2, 3)])
        stage.GetRootLayer().Save()


SCHEMAS = {"BasisCurves": "curves", "Mesh": "mesh", "Points": "points", "TetMesh": "tets"}


def compare(reader, file):
    """How many arrays of a file were compared, and what differs."""
    from pxr import Usd, UsdGeom

    stage = Usd.Stage.Open(str(file))
    prims = [prim for prim in stage.Traverse() if prim.GetTypeName() in SCHEMAS]
    times = [0.0, 1.0, 1.25, 2.0, 2.875, 3.5, 9.0, 12.0, 13.3, 20.0]
    count, wrong = 0, []
    for prim in prims:
        command = [reader, file, prim.GetPath(), *times]
        done = subprocess.run(list(map(str, command)), capture_output=True, text=True)
        lines = done.stdout.splitlines()
        if len(lines) != len(times):
            return 0, [f"{prim.GetPath()}: {done.stdout[-300:]}{done.stderr[-300:]}"]
        for time, line in zip(times, lines):
            if line.startswith("error"):
                wrong.append(f"{prim.GetPath()} at {time}: {line}")
                continue
            part = json.loads(line).get(SCHEMAS[prim.GetTypeName()])
            for what, ours, theirs, tolerance in arrays(stage, prim, part, time):
                count += 1
                if not agree(ours, theirs, tolerance):
                    wrong.append(f"{prim.GetPath()}.{what} at {time}: {str(ours)[:160]}, expected {str(theirs)[:160]}")
    return count, wrong


def agree(ours, theirs, tolerance):
    if ours is None:
        return False
    if ours.shape != theirs.shape:
        return False
    if tolerance == 0:
        return ours.astype(theirs.dtype).tobytes() == theirs.tobytes()
    # By row: a component near 0 is the difference of larger ones.
    size = np.abs(theirs).max(axis=-1, keepdims=True) + 1e-30
    return bool((np.abs(ours - theirs) <= tolerance * size).all())


def arrays(stage, prim, part, time):
    """What we read, what USD has, and by how much of a row they may differ: for each array of a prim."""
    from pxr import Gf, UsdGeom

    world = UsdGeom.Xformable(prim).ComputeLocalToWorldTransform(time)
    unit, up = UsdGeom.GetStageMetersPerUnit(stage), UsdGeom.GetStageUpAxis(stage)
    if up == "Z":
        world = world * Gf.Matrix4d(1, 0, 0, 0, 0, 0, -1, 0, 0, 1, 0, 0, 0, 0, 0, 1)
    world = world * Gf.Matrix4d().SetScale(unit)
    matrix = np.array(world)
    still = bool((matrix == np.eye(4)).all())
    # USD interpolates quaternions of floats in floats.
    near = 2e-5 if prim.GetName() == "curves" else 1e-6
    points = np.array(prim.GetAttribute("points").Get(time))
    moved = points if still else points.astype(np.float64) @ matrix[:3, :3] + matrix[3, :3]
    ours = np.array(part["points"], dtype=np.float64).reshape(-1, 3)
    yield "points", (ours.astype(np.float32) if still else ours), moved, 0 if still else near
    for name, key in [("curveVertexCounts", "counts"), ("faceVertexCounts", "counts")]:
        if prim.HasAttribute(name):
            yield name, np.array(part[key]), np.array(prim.GetAttribute(name).Get(time)), 0
    if prim.HasAttribute("faceVertexIndices"):
        theirs = np.array(prim.GetAttribute("faceVertexIndices").Get(time))
        if np.linalg.det(matrix[:3, :3]) > 0:
            yield "faceVertexIndices", np.array(part["indices"]), theirs, 0
    tables = {"vertex": "point_attributes", "uniform": "element_attributes", "constant": "attributes", "faceVarying": "point_attributes"}
    if prim.HasAttribute("ids") and prim.GetAttribute("ids").Get(time) is not None:
        yield "ids", np.array(part["point_attributes"]["id"]), np.array(prim.GetAttribute("ids").Get(time)), 0
    if prim.HasAttribute("velocities") and prim.GetAttribute("velocities").Get(time) is not None:
        theirs = np.array(prim.GetAttribute("velocities").Get(time)).astype(np.float64) @ matrix[:3, :3]
        yield "velocities", np.array(part["point_attributes"]["v"], dtype=np.float64), theirs, near
    for primvar in UsdGeom.PrimvarsAPI(prim).GetPrimvars():
        name = primvar.GetPrimvarName()
        theirs = primvar.ComputeFlattened(time)
        if theirs is None or name == "normals":
            continue
        if name == "smooth":
            theirs = np.array(theirs)
            corners = np.array(prim.GetAttribute("faceVertexIndices").Get())
            first = {}
            for corner, point in enumerate(corners):
                first.setdefault(int(point), corner)
            theirs = theirs[[first[point] for point in range(len(points))]]
        theirs = np.array(theirs)
        if name == "of_vector3f":
            theirs = theirs.astype(np.float64) @ matrix[:3, :3]
        if theirs.dtype == np.float64 or theirs.dtype == np.float16:
            theirs = theirs.astype(np.float32) if name != "of_vector3f" else theirs
        if theirs.ndim == 2 and theirs.shape[1] == 2:
            theirs = np.concatenate([theirs, np.zeros((len(theirs), 1), theirs.dtype)], axis=1)
        found = part[tables[primvar.GetInterpolation()]].get(name)
        dtype = np.float64 if name == "of_vector3f" else theirs.dtype
        ours = None if found is None else np.array(found, dtype=np.float64).astype(dtype).reshape(theirs.shape)
        tolerance = near if name == "of_vector3f" else 0
        yield name, ours, theirs, tolerance


if __name__ == "__main__":
    sys.exit(main())
