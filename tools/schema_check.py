#!/usr/bin/env python3
"""Checks the schema of graph files, which `convect schema` prints, with an implementation of all of JSON Schema.

    schema_check.py CONVECT      needs jsonschema

The schema is a valid one; it accepts every example graph and every param's default; it refuses each example once it has a
key, a type or a param that does not exist. Exit code 0 means that all of it holds.
"""

import copy
import json
import re
import subprocess
import sys
from pathlib import Path

from jsonschema import Draft202012Validator

ROOT = Path(__file__).resolve().parent.parent
STRING = r'("(?:[^"\\]|\\.)*")'


def plain(text):
    """The value of JSON with comments and trailing commas."""
    text = re.sub(STRING + r"|//[^\n]*|/\*.*?\*/", lambda found: found[1] or "", text, flags=re.S)
    return json.loads(re.sub(STRING + r"|,(?=\s*[}\]])", lambda found: found[1] or "", text))


def broken(graph):
    """The graph with one fault each, by what it is."""
    for what in ("an unknown key", "an unknown type", "an unknown param"):
        changed = copy.deepcopy(graph)
        node = next(iter(changed["nodes"].values()))
        if what == "an unknown key":
            changed["node"] = {}
        elif what == "an unknown type":
            node["type"] = "No_Such_Type"
        else:
            node.setdefault("params", {})["no_such_param"] = 1
        yield what, changed


def main():
    schema = json.loads(subprocess.run([sys.argv[1], "schema"], check=True, capture_output=True, text=True).stdout)
    Draft202012Validator.check_schema(schema)
    validator, faults, defaults = Draft202012Validator(schema), [], 0
    graphs = [path for path in sorted(ROOT.glob("graphs/*/*.json")) if path.stem == path.parent.name]
    for path in graphs:
        graph = plain(path.read_text())
        faults += [f"{path.name}: {error.json_path}: {error.message}" for error in validator.iter_errors(graph)]
        faults += [f"{path.name} with {what} is accepted" for what, graph in broken(graph) if validator.is_valid(graph)]
    for name, node in schema["$defs"].items():
        for param, rules in node.get("properties", {}).get("params", {}).get("properties", {}).items():
            if "default" in rules:
                defaults += 1
                alone = Draft202012Validator({"$defs": schema["$defs"], "anyOf": [rules]})
                faults += [f"{name}.{param}: {error.message}" for error in alone.iter_errors(rules["default"])]
    print("".join(f"FAULT {fault}\n" for fault in faults) + f"{len(graphs)} graphs and {defaults} defaults, {len(faults)} faults")
    return bool(faults) or not graphs or not defaults


if __name__ == "__main__":
    sys.exit(main())
