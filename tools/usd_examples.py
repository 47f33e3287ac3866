#!/usr/bin/env python3
"""Cooks some frames of every example graph as USD and opens the files in usd-core, or in Blender.

    usd_examples.py CONVECT [--bpy PYTHON] [--frames 1-2] [--folder DIR]      needs usd-core and numpy; PYTHON has bpy

The check of each file is that of `usd_check.py`, against the json frames of the same cook. Without --bpy files are opened in
usd-core, with it in Blender (bpy 5.2 from PyPI needs Python 3.13), too. What cannot be loaded is skipped, and said. Exit code
0 means that all files are right.
"""

import argparse
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("convect", type=Path)
    parser.add_argument("--bpy", help="a Python with bpy")
    parser.add_argument("--frames", default="1-2")
    parser.add_argument("--folder", type=Path, help="where to cook; kept afterwards")
    args = parser.parse_args()
    began, wrong, files = time.monotonic(), [], []
    with tempfile.TemporaryDirectory() as folder:
        folder = str(args.folder.resolve()) if args.folder else folder
        for graph in sorted(ROOT.glob("graphs/*/*.json")):
            if graph.stem != graph.parent.name:
                continue
            out = Path(folder) / graph.stem
            # The cache lets the second cook take the frames of the first.
            for format in ("usdc", "json"):
                words = [args.convect.resolve(), "cook", graph, "--frames", args.frames, "--format", format, "--out", out]
                words += ["--quiet", "--cache", Path(folder) / "cache"]
                done = subprocess.run(list(map(str, words)), capture_output=True, text=True)
                if done.returncode:
                    wrong.append(f"{graph.stem}: exit {done.returncode}: {done.stderr[-300:]}")
            files += sorted(out.glob("*.usdc"))
        print(f"{len(files)} files cooked in {time.monotonic() - began:.0f} s", flush=True)
        for python, words, module in [(sys.executable, [], "pxr.UsdValidation"), (args.bpy, ["--bpy"], "bpy")]:
            where = "Blender" if words else "usd-core"
            why = unloadable(python, module)
            if why:
                print(f"{where}: skipped, {why}", flush=True)
            else:
                check = [python, ROOT / "tools" / "usd_check.py", *words, *files]
                done = subprocess.run(list(map(str, check)), capture_output=True, text=True)
                said = done.stdout.replace(folder + "/", "")
                right = sum(line.endswith(": ok") for line in said.splitlines())
                if done.returncode or right != len(files):
                    wrong.append("".join(line + "\n" for line in said.splitlines() if not line.endswith(": ok")) + done.stderr)
                print(f"{where}: {right} of {len(files)} files are right, {time.monotonic() - began:.0f} s", flush=True)
    print("\n".join(wrong))
    return bool(wrong)


def unloadable(python, module):
    """Why a Python cannot load a module; nothing if it can."""
    if not python:
        return "no Python is given for it"
    try:
        done = subprocess.run([python, "-c", f"import {module}"], capture_output=True, text=True)
    except OSError as error:
        return f"{python} cannot be run: {error.strerror}"
    lines = done.stderr.strip().splitlines() or [f"exit {done.returncode}"]
    return f"{python} cannot load {module}: {lines[-1]}" if done.returncode else None


if __name__ == "__main__":
    sys.exit(main())
