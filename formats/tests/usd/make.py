#!/usr/bin/env python3
"""Wrote the files beside it, with usd-core 26.11: `make.py` for each version of crate files and for text.

A curve and a mesh under a transform, compressed integers and floats, indexed and half primvars, samples.
"""

import os
import subprocess
import sys
from pathlib import Path

FOLDER = Path(__file__).parent
VERSIONS = ["0.4.0", "0.5.0", "0.6.0", "0.7.0", "0.8.0", "0.12.0"]


def write(version):
    from pxr import Gf, Sdf, Usd, UsdGeom, Vt

    stage = Usd.Stage.CreateNew(str(FOLDER / f"crate_{version.replace('.', '_')}.usdc"))
    UsdGeom.SetStageMetersPerUnit(stage, 0.5)
    UsdGeom.SetStageUpAxis(stage, "Z")
    root = UsdGeom.Xform.Define(stage, "/root")
    move = root.AddTranslateOp()
    move.Set(Gf.Vec3d(0, 0, 1), 1)
    move.Set(Gf.Vec3d(0, 0, 3), 2)
    curves = UsdGeom.BasisCurves.Define(stage, "/root/curves")
    curves.CreateTypeAttr("linear")
    curves.CreateCurveVertexCountsAttr(Vt.IntArray([3] * 20))
    points = [Gf.Vec3f(i, i % 3, 0) for i in range(60)]
    curves.CreatePointsAttr(Vt.Vec3fArray(points))
    curves.CreateWidthsAttr(Vt.FloatArray([float(i % 4) for i in range(60)]))
    curves.SetWidthsInterpolation("vertex")
    api = UsdGeom.PrimvarsAPI(curves)
    api.CreatePrimvar("table", Sdf.ValueTypeNames.FloatArray, "vertex").Set(Vt.FloatArray([i % 5 + 0.1 for i in range(60)]))
    api.CreatePrimvar("half", Sdf.ValueTypeNames.Half3Array, "constant").Set(Vt.Vec3hArray([Gf.Vec3h(1, 0.5, -2)]))
    api.CreatePrimvar("long", Sdf.ValueTypeNames.Int64Array, "uniform").Set(Vt.Int64Array([i * i for i in range(20)]))
    indexed = api.CreatePrimvar("indexed", Sdf.ValueTypeNames.DoubleArray, "uniform")
    indexed.Set(Vt.DoubleArray([0.25, -1.5]))
    indexed.SetIndices(Vt.IntArray([i % 2 for i in range(20)]))
    mesh = UsdGeom.Mesh.Define(stage, "/root/mesh")
    mesh.CreateFaceVertexCountsAttr(Vt.IntArray([4] * 16))
    mesh.CreateFaceVertexIndicesAttr(Vt.IntArray([k for i in range(16) for k in (i, i + 1, i + 18, i + 17)]))
    for time in (1, 2):
        mesh.CreatePointsAttr().Set(Vt.Vec3fArray([Gf.Vec3f(i % 17, i // 17, time) for i in range(34)]), time)
    stage.GetRootLayer().Save()
    if version == VERSIONS[-1]:
        stage.GetRootLayer().Export(str(FOLDER / "text.usda"))


if __name__ == "__main__":
    if len(sys.argv) > 1:
        write(sys.argv[1])
    else:
        for version in VERSIONS:
            environment = os.environ | {"USD_WRITE_NEW_USDC_FILES_AS_VERSION": version}
            subprocess.run([sys.executable, __file__, version], env=environment, check=True)
