//! Features that a scene does not use: pairs of graphs without and with each. The output has the same positions, bit for
//! bit, and the feature costs less than 1 % of the instructions.

use crate::cases::{Case, MOVING};

/// A feature that changes nothing.
pub(crate) struct Neutral {
    pub(crate) without: Case,
    pub(crate) with: Case,
    /// Whether it is known to cost more; the check fails if it does not.
    pub(crate) missed: bool,
}

/// 10,000 curves of 8 CVs on a ball.
const FUR: &str = r#"
    "ball": { "type": "Mesh_Primitive", "params": { "shape": "sphere", "size": [0.4, 0.4, 0.4], "divisions": 12 } },
    "fur": { "type": "Curve_Scatter", "inputs": { "skin": "ball" },
             "params": { "density": 20000, "length": [0.05, 0.09], "cvs": 8, "lean": 0.3 } },"#;

/// Wind over the fur, other in each frame.
const WIND: &str = r#""wind": { "type": "Curve_Wind", "inputs": { "curves": "fur" }, "params": {
    "wind_dir": [1, 0, 0.2], "noise": "none", "global_rotate": { "expr": "0.5 + 0.01*frame" } } },"#;

/// The fur with an attribute.
const PAINTED: &str = r#""painted": { "type": "Attribute_Expr", "inputs": { "geometry": "fur" },
    "params": { "component": "curves", "code": "heat = P.y" } },"#;

/// A block of liquid.
const DROP: &str = r#"
    "block": { "type": "Mesh_Primitive", "params": { "size": [0.3, 0.3, 0.3], "divisions": 1 } },"#;

/// A beam that is held at an end.
const HELD: &str = r#"
    "box": { "type": "Mesh_Primitive", "params": { "size": [1, 0.25, 0.25], "divisions": 5 } },
    "body": { "type": "Tetrahedralize", "inputs": { "surface": "box" } },
    "shape": { "type": "Transform", "inputs": { "geometry": "box" }, "params": { "translate": [0, 1, 0] } },
    "goal": { "type": "Softbody_Goal", "inputs": { "body": "body", "shape": "shape" }, "params": { "frame": 4, "strength": 0 } },
    "end": { "type": "Point_In", "params": { "points": [[-0.5, 0, 0]] } },
    "pins": { "type": "Softbody_Pin", "inputs": { "targets": "end" }, "params": { "radius": 0.2 } },"#;

/// The beam sways, and touches nothing.
const LOOSE: &str = r#""node": { "type": "Softbody", "inputs": { "bodies": ["body"], "pins": ["pins"] },
    "params": { "stiffness": 3e6, "damping": 1e-3, "self_collision": false } },"#;

/// The block falls apart in a box.
const POOL: &str = r#""node": { "type": "FluidSolve", "inputs": { "liquid": ["block"] }, "params": {
    "cell": 0.05, "viscosity": 1, "domain_from": [-0.4, -0.4, -0.4], "domain_to": [0.4, 0.4, 0.4] } },"#;

/// A case on the fur.
const fn on_fur(name: &'static str, nodes: &'static [&'static str], output: &'static str) -> Case {
    Case { name, nodes, before: &["fur", "ball"], output, frames: 6 }
}

/// A case on the block of liquid.
const fn on_liquid(name: &'static str, nodes: &'static [&'static str]) -> Case {
    Case { name, nodes, before: &["block"], output: "node.surface", frames: 10 }
}

/// A case on the beam that is held.
const fn on_beam(name: &'static str, nodes: &'static [&'static str]) -> Case {
    Case { name, nodes, before: &["body", "pins", "goal"], output: "node.tets", frames: 24 }
}

pub(crate) const NEUTRAL: &[Neutral] = &[
    Neutral {
        without: on_fur("no noise", &[FUR, WIND], "wind"),
        with: on_fur(
            "noise of amplitude 0",
            &[
                FUR,
                r#""wind": { "type": "Curve_Wind", "inputs": { "curves": "fur" }, "params": {
                    "wind_dir": [1, 0, 0.2], "noise": "perlin", "octaves": 4, "amplitude": 0,
                    "global_rotate": { "expr": "0.5 + 0.01*frame" } } },"#,
            ],
            "wind",
        ),
        missed: false,
    },
    Neutral {
        without: on_fur("no shielding", &[FUR, WIND], "wind"),
        with: on_fur(
            "shield 0",
            &[
                FUR,
                r#""lee": { "type": "Curve_Wind_Shielding", "inputs": { "curves": "fur", "colliders": ["ball"] },
                            "params": { "wind_dir": [1, 0, 0.2], "shield": 0 } },
                   "wind": { "type": "Curve_Wind", "inputs": { "curves": "lee" }, "params": {
                       "wind_dir": [1, 0, 0.2], "noise": "none", "global_rotate": { "expr": "0.5 + 0.01*frame" } } },"#,
            ],
            "wind",
        ),
        missed: false,
    },
    Neutral {
        without: on_fur("no collision", &[FUR, WIND], "wind"),
        with: on_fur(
            "collision without a collider",
            &[
                FUR,
                WIND,
                r#""out": { "type": "Curve_Wind_Collision", "inputs": { "curves": "wind", "rest": "fur" } },"#,
            ],
            "out",
        ),
        missed: false,
    },
    Neutral {
        without: on_fur("no gusts", &[FUR, MOVING, GUSTS[0], BLOWN], "blown"),
        with: on_fur("gusts that do not reach the fur", &[FUR, MOVING, GUSTS[1], BLOWN], "blown"),
        missed: false,
    },
    Neutral {
        without: on_beam("no goals", &[HELD, LOOSE]),
        with: on_beam(
            "goals of strength 0",
            &[
                HELD,
                r#""node": { "type": "Softbody", "inputs": { "bodies": ["body"], "pins": ["pins"], "goals": ["goal"] },
                                        "params": { "stiffness": 3e6, "damping": 1e-3, "self_collision": false, "reset_to_goals": 0 } },"#,
            ],
        ),
        missed: false,
    },
    Neutral {
        without: on_liquid(
            "viscosity 0, solved after pressure",
            &[
                DROP,
                r#""node": { "type": "FluidSolve", "inputs": { "liquid": ["block"] }, "params": {
                                  "cell": 0.05, "viscosity": 0, "stokes": "off",
                                  "domain_from": [-0.4, -0.4, -0.4], "domain_to": [0.4, 0.4, 0.4] } },"#,
            ],
        ),
        with: on_liquid(
            "viscosity 0, coupled to pressure",
            &[
                DROP,
                r#""node": { "type": "FluidSolve", "inputs": { "liquid": ["block"] }, "params": {
                                  "cell": 0.05, "viscosity": 0, "stokes": "on",
                                  "domain_from": [-0.4, -0.4, -0.4], "domain_to": [0.4, 0.4, 0.4] } },"#,
            ],
        ),
        missed: false,
    },
    Neutral {
        without: on_liquid("a box of 4,096 cells", &[DROP, POOL]),
        with: on_liquid(
            "a box of 40,960 cells, as much liquid",
            &[
                DROP,
                r#""node": { "type": "FluidSolve", "inputs": { "liquid": ["block"] }, "params": {
                                  "cell": 0.05, "viscosity": 1,
                                  "domain_from": [-0.4, -0.4, -0.4], "domain_to": [0.4, 7.6, 0.4] } },"#,
            ],
        ),
        missed: false,
    },
    Neutral {
        without: on_fur("no other nodes", &[FUR, WIND], "wind"),
        with: on_fur(
            "nodes that no output needs",
            &[FUR, WIND, r#""unused": { "type": "Curve_Jiggle", "inputs": { "curves": "wind" } },"#],
            "wind",
        ),
        missed: false,
    },
    Neutral {
        without: on_liquid("one output of a node", &[DROP, POOL]),
        with: on_liquid(
            "an output of a node that nothing needs",
            &[
                DROP,
                POOL,
                r#""other": { "type": "Fluid_Surface", "inputs": { "volume": "node.volume" }, "params": { "resolution": 2 } },"#,
            ],
        ),
        missed: false,
    },
    Neutral {
        without: on_fur("no other attributes", &[FUR, WIND], "wind"),
        with: Case {
            name: "an attribute that no node reads",
            nodes: &[
                FUR,
                PAINTED,
                r#""wind": { "type": "Curve_Wind", "inputs": { "curves": "painted" }, "params": {
                       "wind_dir": [1, 0, 0.2], "noise": "none", "global_rotate": { "expr": "0.5 + 0.01*frame" } } },"#,
            ],
            before: &["painted", "ball"],
            output: "wind",
            frames: 6,
        },
        missed: false,
    },
];

/// What gusts make of the wind.
const BLOWN: &str = r#""blown": { "type": "Curve_Wind", "inputs": { "curves": "gusts" },
    "params": { "wind_dir": [1, 0, 0.2], "noise": "perlin" } },"#;

/// None, and twenty that stay a kilometre upwind.
const GUSTS: [&str; 2] = [
    r#""gusts": { "type": "Curve_Wind_Gusts", "inputs": { "curves": "carried" }, "params": { "num_gusts": 0, "base": 0.4 } },"#,
    r#""gusts": { "type": "Curve_Wind_Gusts", "inputs": { "curves": "carried" }, "params": {
           "num_gusts": 20, "base": 0.4, "distance": 1000, "start_frame_range": [0, 4] } },"#,
];
