#!/usr/bin/env bash
# Runs the studies of docs/error_and_time.md: graphs/SCENE/study.json and docs/studies/SCENE.svg for each scene that has a param
# that trades accuracy for time. Names of scenes run these alone. Takes CONVECT for the program, or the release build; REPEATS for the
# number of cooks of each setting, of which more help on a busy machine.
set -euo pipefail
cd "$(dirname "$0")/.."
convect=${CONVECT:-target/release/convect}
out=$(mktemp -d)
trap 'rm -rf "$out"' EXIT
chosen=" $* "
study() {
    local scene=$1
    shift
    [ "$chosen" = "  " ] || [[ $chosen == *" $scene "* ]] || return 0
    printf '\n== %s\n' "$scene"
    "$convect" study "graphs/$scene/$scene.json" "$@" ${REPEATS:+--repeats "$REPEATS"} --fresh --quiet --out "$out/$scene" --json "graphs/$scene/study.json"
    mkdir -p docs/studies
    cp "$out/$scene"/*.svg "docs/studies/$scene.svg"
}
cvs=3,5,9,17,33

# How finely curves are cut.
study attribute_expr --knob grass.cvs=$cvs --norm surface
study attribute_transfer --knob fur.cvs=$cvs --norm surface --frames 1-12x4
study curve_attach --knob hair.cvs=$cvs --norm surface --frames 1-24x4
study curve_deform --knob guides.cvs=$cvs --norm surface --frames 1-24x8
study curve_interpolate --knob fur.cvs=$cvs --norm surface --frames 1-24x8
study curve_resample --knob grass.cvs=$cvs --norm surface
study curve_scatter --output hair --knob hair.cvs=$cvs --norm surface
study curve_trim --knob fur.cvs=$cvs --norm surface --frames 1-24x8
study curve_wind_shielding --knob fur.cvs=$cvs --norm surface --frames 1-24x8
study grass --set blades.density=400 --knob blades.cvs=$cvs --norm surface --frames 1-48x8
study grass_gusts --set blades.density=400 --knob blades.cvs=$cvs --norm surface --frames 1-48x8
study guides --output bear --set hairs.density=2500 --knob hairs.cvs=$cvs --norm surface --frames 12
study gust_control --output lawn --knob blades.cvs=$cvs --norm surface --frames 1-36x6
study merge --knob long.cvs=$cvs --norm surface

# Wind: steps of collision, tolerance of the swing.
study bear_storm --set fur_out.coherence=0 --knob fur_out.rotation_steps=2,4,8,16,32,64 --frames 1-17x8
study curve_jiggle --knob jiggle.tolerance=1e-1,1e-2,1e-3,1e-4,1e-5
study curve_wind_collision --output scene --knob bent.rotation_steps=2,4,8,16,32,64 --frames 1-24x4
study fig1 --output c --knob lee_collided.rotation_steps=2,4,8,16,32,64 --frames 1-24x8
study fig2 --knob collided.rotation_steps=2,4,8,16,32,64 --frames 1-24x8

# Soft bodies: substeps, and how finely bodies are cut. Coarser bodies than the scenes' own.
study dough_pound --output inside --set block.divisions=8 --knob inside.substeps=1,2,4,8 --frames 8-24x8
study dough_rolling --output dough --set block.divisions=8 --set fine_block.divisions=16 --knob dough.substeps=1,2,4,8 --frames 8-24x8
study egg_crack --output egg --set outside.divisions=8 --set cavity.divisions=5 --set ball.divisions=5 --knob egg.substeps=1,2,4,8 --frames 8-16x8
study softbody_cage --output fall --set figure.spacing=0.08 --set open.spacing=0.08 --knob fall.substeps=1,2,4,8 --frames 4-16x4
study softbody_goal --output bun --knob body.spacing=0.04,0.03,0.02,0.015 --norm surface --frames 1-48x12
study tetrahedralize --output dough --knob dough.spacing=0.03,0.021,0.015,0.0105,0.0075 --norm volume

# Liquids: cells, and how far liquid moves in a substep.
study dam_break --output water --knob water.cell=0.113,0.08,0.057,0.04 --norm surface --frames 6-18x6
study sauce_pour --knob sauce.cell=0.05,0.036,0.025,0.018 --norm surface --frames 12-48x12
