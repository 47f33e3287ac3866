//! A small catalogue for tests: sources, a chain, and a node with a param of every shape. None of them can be cooked.

use std::sync::Arc;

use crate::geometry::{Attr, Column, Kind, Name, V};
use crate::graph::Catalogue;
use crate::node::{Cook, Cx, FrameCx, Input, Many, Node, Opt, Output, Outputs};
use crate::param::{Code, Maskable, Param, Seed, Span, Turn, Unit};
use crate::{Error, Result, choice, files::File, inputs, params};
use numerics::ramp::Ramp;

pub(super) const CATALOGUE: Catalogue = Catalogue(&[
    &[&CURVE_IN, &MESH_IN, &MERGE, &SCATTER],
    &[&CURVE_WIND, &CURVE_WIND_COLLISION],
    &[&SOFTBODY, &EVERY_SHAPE],
]);

fn pure(_: &Cx) -> Result<Outputs> {
    Err(Error::refused("this node can only be loaded"))
}

fn frame(_: &FrameCx) -> Result<Outputs> {
    Err(Error::refused("this node can only be loaded"))
}

const FRAME: Cook = Cook::Frame { cook: frame, reads_clock: |_| true };

choice! {
    /// Noises.
    pub(super) enum Noise {
        None = "none": "no noise",
        Perlin = "perlin": "gradient noise",
        Wavelet = "wavelet": "noise of one band",
    }
}

params! { READER:
    FILE: Param<Option<File>> = Param::file("file", "The file.");
    POINTS: Param<Arc<Vec<[f32; 3]>>> = Param::inline("points", "Points.");
    COUNTS: Param<Arc<Vec<i32>>> = Param::inline("counts", "Points of each curve.");
    ATTRIBUTES: Param<Arc<Vec<(Name, Column)>>> = Param::inline("attributes", "Attributes of the points.");
    SCALE: Param<f32> = Param::float("scale", 1.0, "Metres per unit.").above(0.0);
    AT: Param<i64> = Param::int("frame", 0, "Which frame of the files.").unit(Unit::Frame).default_current_frame();
}

const CURVES_OUT: Output = Output::new("curves", &[Kind::Curves], "The curves.");
static CURVE_IN: Node =
    Node::new("Curve_In", 1, "Reads curves.", Cook::Pure(pure)).params(READER).outputs(&[&CURVES_OUT]);

const MESH_OUT: Output = Output::new("mesh", &[Kind::Mesh], "The mesh.");
static MESH_IN: Node = Node::new("Mesh_In", 1, "Reads a mesh.", Cook::Pure(pure)).params(READER).outputs(&[&MESH_OUT]);

inputs! { MERGED: GEOMETRY: Input<Many> = Input::any_many("geometry", "Geometry to merge."); }
const UNION: Output = Output::union("geometry", &GEOMETRY, "The merged geometry.");
static MERGE: Node = Node::new("Merge", 1, "Merges geometry.", Cook::Pure(pure)).inputs(MERGED).outputs(&[&UNION]);

inputs! { SCATTERED: SKIN: Input = Input::one("skin", Kind::Mesh, "The mesh to scatter on."); }
params! { SCATTERING: COUNT: Param<i64> = Param::int("count", 100, "How many points.").at_least(0.0); }
const POINTS_OUT: Output = Output::new("points", &[Kind::Points], "The points.");
static SCATTER: Node = Node::new("Scatter", 1, "Scatters points.", Cook::Pure(pure))
    .inputs(SCATTERED)
    .params(SCATTERING)
    .outputs(&[&POINTS_OUT])
    .changes_topology();

inputs! { BENT: CURVES: Input = Input::one("curves", Kind::Curves, "Curves to bend."); }
params! { WIND:
    WIND_DIR: Param<[f64; 3]> = Param::direction("wind_dir", [1.0, 0.0, 0.0], "Where the wind blows to.");
    NOISE: Param<Noise> = Param::choice("noise", Noise::Perlin, "Which noise.");
    AMPLITUDE: Param<f32> = Param::float("amplitude", 0.5, "How strong the noise is.").at_least(0.0);
    FREQUENCY: Param<f32> = Param::float("frequency", 2.0, "How fine the noise is.").above(0.0).unit(Unit::PerMetre);
    OCTAVES: Param<i64> = Param::int("octaves", 2, "How many layers of noise.").within(1.0, 16.0);
    GLOBAL_ROTATE: Param<Maskable> = Param::maskable("global_rotate", 0.5, "How far curves are rotated.");
    RAMP_ROTATE: Param<Arc<Ramp>> = Param::ramp("ramp_rotate", &[[0.0, 1.0]], "How far, along the curve, from root to tip.");
    BLEND: Param<Maskable> = Param::maskable("blend", 1.0, "How much of the wind.").within(0.0, 1.0);
    SEED: Param<Seed> = Param::seed("Seed of the noise.");
}
const BENT_OUT: Output = Output::like("curves", &CURVES, "Bent curves.");
static CURVE_WIND: Node =
    Node::new("Curve_Wind", 1, "Bends curves.", FRAME).inputs(BENT).params(WIND).outputs(&[&BENT_OUT]);

inputs! { COLLIDED:
    WINDED: Input = Input::one("curves", Kind::Curves, "Curves to push out of the colliders.");
    REST: Input = Input::one("rest", Kind::Curves, "The same curves without wind.");
    COLLIDERS: Input<Many> = Input::many("colliders", Kind::Mesh, "The colliders.");
    GROWN: Input<Opt> = Input::optional("skin", Kind::Mesh, "The skin that the curves grow on.");
}
const FREE_OUT: Output = Output::like("curves", &WINDED, "Curves outside the colliders.");
static CURVE_WIND_COLLISION: Node =
    Node::new("Curve_Wind_Collision", 1, "Pushes curves out of colliders.", Cook::Pure(pure))
        .inputs(COLLIDED)
        .outputs(&[&FREE_OUT]);

inputs! { BODIES: BODY: Input<Many> = Input::many("bodies", Kind::Mesh, "The soft bodies."); }
params! { SOFT:
    START: Param<i64> = Param::int("start_frame", 1, "The first frame.").unit(Unit::Frame).fixed().default_scene_start();
    FROM: Param<f64> = Param::double("from", 0.0, "The start time.").unit(Unit::Frame).default_scene_start();
    VELOCITY: Param<[f32; 3]> = Param::vec3("initial_velocity", [0.0; 3], "The velocity at the start.").unit(Unit::MetresPerSecond);
}
const SURFACE_OUT: Output = Output::new("surface", &[Kind::Mesh], "The surface.");
const TETS_OUT: Output = Output::new("tets", &[Kind::Tets], "The tets of the inside.");
const WRITTEN: Attr<[f32; 3]> = V;
static SOFTBODY: Node = Node::new("Softbody", 1, "Simulates soft bodies.", FRAME)
    .inputs(BODIES)
    .params(SOFT)
    .outputs(&[&SURFACE_OUT, &TETS_OUT])
    .writes(&[&WRITTEN])
    .changes_topology();

params! { SHAPES:
    FLOAT: Param<f32> = Param::float("float", 0.1, "A number.").soft(0.0, 1.0);
    DOUBLE: Param<f64> = Param::double("double", 0.1, "A number.");
    FIXED: Param<f32> = Param::float("fixed", 0.0, "A number that cannot be animated.").fixed();
    INT: Param<i64> = Param::int("int", 3, "A whole number.");
    BOOL: Param<bool> = Param::bool("bool", true, "A boolean.");
    VEC2: Param<[f32; 2]> = Param::vec2("vec2", [0.0; 2], "Two numbers.").at_least(0.0);
    VEC3: Param<[f32; 3]> = Param::vec3("vec3", [0.0; 3], "Three numbers.").unit(Unit::Metres);
    INT3: Param<[i64; 3]> = Param::int3("int3", [2; 3], "Three whole numbers.").at_least(1.0);
    SPAN: Param<Span> = Param::span("span", [0.3, 0.6], "A range.").at_least(0.0).unit(Unit::Metres);
    ROTATE: Param<Turn> = Param::rotation("rotate", "A rotation.");
    CHOICE: Param<Noise> = Param::choice("choice", Noise::None, "A word.");
    FALLOFF: Param<Arc<Ramp>> = Param::smooth_ramp("falloff", &[[0.0, 1.0], [1.0, 0.0]], "A ramp.");
    TEXT: Param<Name> = Param::text("text", "", "A string.");
    TEXTS: Param<Arc<Vec<Name>>> = Param::texts("texts", &["uvw"], "Strings.");
    OFFSETS: Param<Arc<Vec<[f32; 3]>>> = Param::inline("offsets", "Vectors.");
    TETS: Param<Arc<Vec<[u32; 4]>>> = Param::inline("tets", "Tets.");
    COLUMNS: Param<Arc<Vec<(Name, Column)>>> = Param::inline("columns", "Attributes.");
    MASKED: Param<Maskable> = Param::maskable("masked", 1.0, "A masked number.");
    CODE: Param<Code> = Param::code("code", "Assignments.");
    CHANCE: Param<Seed> = Param::seed("A seed.");
}
static EVERY_SHAPE: Node =
    Node::new("Every_Shape", 1, "Has a param of every shape.", Cook::Pure(pure)).params(SHAPES).outputs(&[&MESH_OUT]);
