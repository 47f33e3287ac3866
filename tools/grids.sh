#!/usr/bin/env bash
# Cooks every setting of the grids on which the search of `convect study --tolerance` is tested, and stores errors and CPU times in
# tests/study_grids/SCENE.json: dough_rolling, sauce_pour and bear_storm, frames 1-24, cells from 4h to h with the reference at h/1.4;
# and four scenes that the search was not made on. Names of scenes cook these alone. Takes CONVECT for the program, or the release
# build; half an hour on two cores. What the search makes of them: cargo test --lib study::replay -- --nocapture
set -euo pipefail
cd "$(dirname "$0")/.."
convect=${CONVECT:-target/release/convect}
out=${GRIDS:-$(mktemp -d)}
chosen=" $* "
grid() {
    local scene=$1 output=$2
    shift 2
    [ "$chosen" = "  " ] || [[ $chosen == *" $scene "* ]] || return 0
    local graph=graphs/$scene/$scene.json
    [ -f "$out/$scene.json" ] || "$convect" study "$graph" --output "$output" "$@" --frames 1-24 --threads 1 --repeats 2 --quiet --fresh \
        --out "$out/$scene" --json "$out/$scene.json"
    # The reference is cooked once more, for its time.
    local set=()
    while read -r key value; do set+=(--set "$key=$value"); done < <(python3 -c '
import json, sys
for key, value in json.load(open(sys.argv[1]))["reference"]["settings"].items(): print(key, json.dumps(value))' "$out/$scene.json")
    while [ $# -gt 0 ]; do
        [ "$1" = --set ] && set=("$1" "$2" "${set[@]}")
        shift
    done
    "$convect" cook "$graph" --output "$output" "${set[@]}" --frames 1-24 --threads 1 --no-write --quiet --report "$out/$scene.report.json"
    python3 - "$out/$scene.json" "$out/$scene.report.json" "tests/study_grids/$scene.json" <<'PYTHON'
import json, sys
study, report = json.load(open(sys.argv[1])), json.load(open(sys.argv[2]))
knobs = [[key, []] for key in study["knobs"]]
for run in study["runs"]:
    for key, values in knobs:
        if run["settings"][key] not in values: values.append(run["settings"][key])
frames = len(study["frames"])
def line(run):
    places = [values.index(run["settings"][key]) for key, values in knobs]
    return json.dumps(places + [run["error"]["mean"], round(run["cpu_ms"], 3)])
head = {"grid": 1, "graph": study["graph"], "frames": frames, "norm": study["norm"], "floor": study["floor"]["mean"],
        "reference_cpu_ms": round(report["total"]["cpu_ms"] / frames, 3), "knobs": knobs}
text = json.dumps(head)[:-1] + ', "runs": [\n' + ",\n".join(line(run) for run in study["runs"] if run["failed"] is None) + "\n]}\n"
open(sys.argv[3], "w").write(text)
PYTHON
}
# The tets are as large as the faces of `lump`.
grid dough_rolling dough --norm surface --knob block.divisions=3,4,6,8,12 --knob dough.substeps=1,2,4,8 \
    --knob dough.tolerance=1e-2,1e-3,1e-4
grid sauce_pour dish --norm surface --knob sauce.cell=0.036,0.02546,0.018,0.01273,0.009 --knob sauce.cfl=4,2,1,0.5 \
    --knob sauce.tolerance=1e-2,1e-3,1e-4
grid bear_storm bear --set fur_out.coherence=0 --knob fur_out.rotation_steps=2,4,8,16,32,64 --knob swing.tolerance=1e-1,1e-2,1e-3,1e-4
# Scenes that the search was not made on.
grid curve_jiggle ball --norm surface --knob fur.cvs=3,5,9,17,33 --knob jiggle.tolerance=1e-1,1e-2,1e-3,1e-4
grid curve_wind_collision scene --norm surface --knob bent.rotation_steps=2,4,8,16,32,64 --knob blades.cvs=3,5,9,17
grid dam_break water --norm surface --knob water.cell=0.113,0.08,0.0566,0.04,0.0283 --knob water.cfl=4,2,1,0.5
grid softbody_cage fall --norm surface --knob figure.spacing=0.08,0.0566,0.04,0.0283 --knob fall.substeps=1,2,4,8
