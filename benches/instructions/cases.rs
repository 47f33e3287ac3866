//! The graphs whose instructions are counted: one a node, small, fixed, and reading no file.

/// A node to be counted.
pub(crate) struct Case {
    pub(crate) name: &'static str,
    /// The nodes of the graph, as a graph file has them.
    pub(crate) nodes: &'static [&'static str],
    /// What the node reads that does not change with the frame: it is cooked in a run of its own, whose count is taken off.
    pub(crate) before: &'static [&'static str],
    /// The node, or `"node.port"`.
    pub(crate) output: &'static str,
    /// Frames 1…`frames` are cooked.
    pub(crate) frames: i64,
}

/// 2,000 curves of 8 CVs on a ball.
const FUR: &str = r#"
    "ball": { "type": "Mesh_Primitive", "params": { "shape": "sphere", "size": [0.4, 0.4, 0.4], "divisions": 12 } },
    "fur": { "type": "Curve_Scatter", "inputs": { "skin": "ball" },
             "params": { "density": 4000, "length": [0.05, 0.09], "cvs": 8, "lean": 0.3 } },"#;

/// The ball rolls, and the fur with it.
pub(crate) const MOVING: &str = r#"
    "skin": { "type": "Transform", "inputs": { "geometry": "ball" }, "params": {
        "translate": { "keyframes": [[1, [0, 0, 0]], [24, [0.5, 0.2, 0]]] },
        "rotate": { "keyframes": [[1, [0, 0, 0]], [24, [0, 0, -90]]] } } },
    "carried": { "type": "Transform", "inputs": { "geometry": "fur" }, "params": {
        "translate": { "keyframes": [[1, [0, 0, 0]], [24, [0.5, 0.2, 0]]] },
        "rotate": { "keyframes": [[1, [0, 0, 0]], [24, [0, 0, -90]]] } } },"#;

/// A soft beam, and pins that hold one end.
const BEAM: &str = r#"
    "box": { "type": "Mesh_Primitive", "params": { "size": [1, 0.25, 0.25], "divisions": 5 } },
    "body": { "type": "Tetrahedralize", "inputs": { "surface": "box" } },
    "end": { "type": "Point_In", "params": { "points": [[-0.5, 0, 0]] } },
    "pins": { "type": "Softbody_Pin", "inputs": { "targets": "end" }, "params": { "radius": 0.2 } },"#;

/// A lump of dough on the ground, and a pin that rolls over it.
const DOUGH: &str = r#"
    "lump": { "type": "Mesh_Primitive", "params": { "shape": "sphere", "size": [0.2, 0.06, 0.2], "divisions": 6 } },
    "placed": { "type": "Transform", "inputs": { "geometry": "lump" }, "params": { "translate": [0, 0.032, 0] } },
    "body": { "type": "Tetrahedralize", "inputs": { "surface": "placed" } },"#;

const ROLLER: &str = r#"
    "wood": { "type": "Mesh_Primitive", "params": { "shape": "cylinder", "size": [0.06, 0.6, 0.06], "divisions": 8 } },"#;

/// A block of liquid in a box, which collapses.
const BLOCK: &str = r#"
    "block": { "type": "Mesh_Primitive", "params": { "size": [0.4, 0.6, 0.4] } },
    "placed": { "type": "Transform", "inputs": { "geometry": "block" }, "params": { "translate": [0.5, 0.3, 0.5] } },"#;

pub(crate) const CASES: &[Case] = &[
    Case { name: "Curve_Scatter", nodes: &[FUR], before: &["ball"], output: "fur", frames: 1 },
    Case {
        name: "Curve_Attach",
        nodes: &[
            FUR,
            r#""skin": { "type": "Attribute_Expr", "inputs": { "geometry": "ball" },
                         "params": { "component": "mesh", "code": "P.x *= 1 + 0.3*time" } },
               "node": { "type": "Curve_Attach", "inputs": { "curves": "fur", "rest_skin": "ball", "skin": "skin" } }"#,
        ],
        before: &["fur", "ball"],
        output: "node",
        frames: 4,
    },
    Case {
        name: "Curve_Interpolate",
        nodes: &[
            FUR,
            r#""node": { "type": "Curve_Interpolate", "inputs": { "guides": "fur", "skin": "ball" },
                         "params": { "density": 20000, "guides": 4 } }"#,
        ],
        before: &["fur", "ball"],
        output: "node",
        frames: 1,
    },
    Case {
        name: "Lattice_Deform",
        nodes: &[
            FUR,
            r#""node": { "type": "Lattice_Deform", "inputs": { "geometry": "fur" }, "params": {
                   "divisions": [1, 1, 1], "from": [-0.3, -0.3, -0.3], "to": [0.3, 0.3, 0.3],
                   "offsets": { "keyframes": [
                       [1, [[0, 0, 0], [0, 0, 0], [0, 0, 0], [0, 0, 0], [0, 0, 0], [0, 0, 0], [0, 0, 0], [0, 0, 0]]],
                       [9, [[0.1, 0, 0], [0, 0, 0], [0, 0.2, 0], [0, 0, 0], [0, 0, 0], [0, 0, 0.1], [0, 0, 0], [0, 0, 0]]]
                   ] } } }"#,
        ],
        before: &["fur"],
        output: "node",
        frames: 4,
    },
    Case {
        name: "Attribute_Expr",
        nodes: &[
            FUR,
            r#""node": { "type": "Attribute_Expr", "inputs": { "geometry": "fur" },
                         "params": { "code": "P.x += 0.02*3*noise(Pref.x*3 - time, 0, Pref.z*3)" } }"#,
        ],
        before: &["fur"],
        output: "node",
        frames: 4,
    },
    Case {
        name: "Curve_Wind, gradient noise",
        nodes: &[
            FUR,
            r#""node": { "type": "Curve_Wind", "inputs": { "curves": "fur" }, "params": {
                   "wind_dir": [1, 0, 0.2], "global_rotate": 0.5, "frequency": 3, "octaves": 2, "scroll": 1.2,
                   "waviness": 0.5, "ramp_rotate": { "ramp": [[0, 0.4], [1, 1]] } } }"#,
        ],
        before: &["fur"],
        output: "node",
        frames: 8,
    },
    Case {
        name: "Curve_Wind, wavelet noise",
        nodes: &[
            FUR,
            r#""node": { "type": "Curve_Wind", "inputs": { "curves": "fur" }, "params": {
                   "wind_dir": [1, 0, 0.2], "noise": "wavelet", "global_rotate": 0.5, "frequency": 3, "octaves": 2, "scroll": 1.2 } }"#,
        ],
        before: &["fur"],
        output: "node",
        frames: 4,
    },
    Case {
        name: "Curve_Wind_Gusts",
        nodes: &[
            FUR,
            r#""node": { "type": "Curve_Wind_Gusts", "inputs": { "curves": "fur" }, "params": {
                   "wind_dir": [1, 0, 0.2], "num_gusts": 20, "radius_range": [0.1, 0.3], "speed_range": [0.8, 2],
                   "start_frame_range": [-30, 8], "repeat_every": 48, "base": 0.1 } }"#,
        ],
        before: &["fur"],
        output: "node",
        frames: 12,
    },
    Case {
        name: "Curve_Wind_Shielding",
        nodes: &[
            FUR,
            r#""node": { "type": "Curve_Wind_Shielding", "inputs": { "curves": "fur", "colliders": ["ball"] }, "params": {
                   "wind_dir": { "expr": ["cos(0.02*frame)", "0", "sin(0.02*frame)"] }, "smooth": 0.5 } }"#,
        ],
        before: &["fur", "ball"],
        output: "node",
        frames: 2,
    },
    Case {
        name: "Curve_Jiggle",
        nodes: &[
            FUR,
            MOVING,
            r#""node": { "type": "Curve_Jiggle", "inputs": { "curves": "carried" },
                         "params": { "frequency": 3.5, "damping": 0.15 } }"#,
        ],
        before: &["fur", "ball"],
        output: "node",
        frames: 8,
    },
    Case {
        name: "Curve_Jiggle on a skin",
        nodes: &[
            FUR,
            MOVING,
            r#""node": { "type": "Curve_Jiggle", "inputs": { "curves": "carried", "skin": "skin" },
                         "params": { "frequency": 3.5, "damping": 0.15, "inherit_motion": 0.8 } }"#,
        ],
        before: &["fur", "ball"],
        output: "node",
        frames: 8,
    },
    Case {
        name: "Curve_Wind_Collision",
        nodes: &[
            FUR,
            r#""wind": { "type": "Curve_Wind", "inputs": { "curves": "fur" },
                         "params": { "wind_dir": [1, 0, 0.2], "noise": "none", "global_rotate": 0.8 } },
               "skin": { "type": "Attribute_Expr", "inputs": { "geometry": "ball" },
                         "params": { "component": "mesh", "code": "P.y += 0.001*frame" } },
               "node": { "type": "Curve_Wind_Collision", "params": { "loft": 0 },
                         "inputs": { "curves": "wind", "rest": "fur", "colliders": ["skin"] } }"#,
        ],
        before: &["wind", "fur", "ball"],
        output: "node",
        frames: 2,
    },
    Case {
        name: "Curve_Wind_Collision, a still skin",
        nodes: &[
            FUR,
            r#""wind": { "type": "Curve_Wind", "inputs": { "curves": "fur" }, "params": {
                   "wind_dir": { "expr": ["cos(0.1*frame)", "0.2", "sin(0.1*frame)"] }, "noise": "none", "global_rotate": 0.8 } },
               "node": { "type": "Curve_Wind_Collision", "params": { "loft": 0 },
                         "inputs": { "curves": "wind", "rest": "fur", "colliders": ["ball"] } }"#,
        ],
        before: &["fur", "ball"],
        output: "node",
        frames: 8,
    },
    Case { name: "Tetrahedralize", nodes: &[DOUGH], before: &["placed"], output: "body", frames: 1 },
    Case {
        name: "Softbody_Goal",
        nodes: &[
            DOUGH,
            r#""shape": { "type": "Attribute_Expr", "inputs": { "geometry": "body" },
                          "params": { "component": "tets", "code": "P.y *= 0.7" } },
               "node": { "type": "Softbody_Goal", "inputs": { "body": "body", "shape": "shape" }, "params": { "frame": 12 } }"#,
        ],
        before: &["body", "shape"],
        output: "node",
        frames: 1,
    },
    Case {
        name: "Softbody, a beam",
        nodes: &[
            BEAM,
            r#""node": { "type": "Softbody", "inputs": { "bodies": ["body"], "pins": ["pins"] },
                         "params": { "stiffness": 3e6, "damping": 1e-3, "self_collision": false } }"#,
        ],
        before: &["body", "pins"],
        output: "node.tets",
        frames: 6,
    },
    Case {
        name: "Softbody, a pin rolls over a beam",
        nodes: &[
            BEAM,
            ROLLER,
            r#""roller": { "type": "Transform", "inputs": { "geometry": "wood" }, "params": {
                   "translate": { "keyframes": [[1, [-0.1, 0.155, 0]], [7, [0.1, 0.14, 0]]] },
                   "rotate": { "keyframes": [[1, [90, 0, 0]], [7, [90, 0, -200]]] } } },
               "node": { "type": "Softbody", "inputs": { "bodies": ["body"], "pins": ["pins"], "colliders": ["roller"] },
                         "params": { "stiffness": 3e6, "damping": 1e-3, "self_collision": false } }"#,
        ],
        before: &["body", "pins", "wood"],
        output: "node.tets",
        frames: 4,
    },
    Case {
        name: "Softbody, a pin rolls over dough",
        nodes: &[
            DOUGH,
            ROLLER,
            r#""roller": { "type": "Transform", "inputs": { "geometry": "wood" }, "params": {
                   "translate": { "keyframes": [[1, [-0.06, 0.085, 0]], [9, [0.0, 0.078, 0]]] },
                   "rotate": { "keyframes": [[1, [90, 0, 0]], [9, [90, 0, -115]]] } } },
               "node": { "type": "Softbody", "inputs": { "bodies": ["body"], "colliders": ["roller"] },
                         "params": { "stiffness": 3e4, "damping": 0.02, "ground": true, "plastic_yield": 0.05, "plastic_creep": 25 } }"#,
        ],
        before: &["body", "wood"],
        output: "node.tets",
        frames: 5,
    },
    Case {
        name: "FluidSolve, a block of water",
        nodes: &[
            BLOCK,
            r#""node": { "type": "FluidSolve", "inputs": { "liquid": ["placed"] }, "params": {
                   "cell": 0.05, "domain_from": [0, 0, 0], "domain_to": [1, 1, 1], "viscosity": 0 } }"#,
        ],
        before: &["placed"],
        output: "node",
        frames: 10,
    },
    Case {
        name: "FluidSolve, a block of honey",
        nodes: &[
            BLOCK,
            r#""node": { "type": "FluidSolve", "inputs": { "liquid": ["placed"] }, "params": {
                   "cell": 0.05, "domain_from": [0, 0, 0], "domain_to": [1, 1, 1], "viscosity": 10, "density": 1400 } }"#,
        ],
        before: &["placed"],
        output: "node",
        frames: 4,
    },
];
