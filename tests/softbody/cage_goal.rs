//! A caged body that a goal bends.

use crate::cooked::cook;
use crate::measure::{distance, points};

/// A loaf of 0.3 m, bent like a banana by frame 24 and held.
const NODES: &str = r#"
    "loaf": { "type": "Mesh_Primitive", "params": { "shape": "sphere", "size": [0.3, 0.2, 0.3], "divisions": 10 } },
    "placed": { "type": "Transform", "inputs": { "geometry": "loaf" }, "params": { "translate": [0, 0.35, 0] } },
    "body": { "type": "Tetrahedralize", "inputs": { "surface": "placed" }, "params": { "method": "cage", "spacing": 0.05 } },
    "shape": { "type": "Attribute_Expr", "inputs": { "geometry": "body" }, "params": { "component": "mesh",
               "code": "P.x = P.x*1.3; P.y = P.y + 2*P.x*P.x - 0.05; P.z = P.z*0.7" } },
    "goal": { "type": "Softbody_Goal", "inputs": { "body": "body", "shape": "shape" },
              "params": { "frame": 24, "strength": 2e4, "hold": 12 } },
    "sim": { "type": "Softbody", "inputs": { "bodies": ["body"], "goals": ["goal"] },
             "params": { "goal_on": "all", "stiffness": 5e3 } }"#;

#[test]
fn the_mesh_that_rides_along_takes_the_shape_of_its_goal() {
    let frames = cook(NODES, &["sim.surface", "placed", "shape"], 30);
    let mesh = |geometry: &engine::geometry::Geometry| {
        geometry.mesh().unwrap().positions().iter().map(|p| p.map(f64::from)).collect::<Vec<_>>()
    };
    let (shape, rest) = (mesh(&frames[2][0]), points(&frames[1][0]));
    let off = |at: &[[f64; 3]]| at.iter().zip(&shape).map(|(a, b)| distance(a, b)).fold(0.0, f64::max);
    let (before, after) = (off(&rest), off(&points(&frames[0][29])));
    println!("caged loaf of 0.3 m: farthest from its goal at first {before:.4}, held by it {after:.4} m");
    assert!(before > 0.05 && after < 3e-3, "{before} {after}");
}
