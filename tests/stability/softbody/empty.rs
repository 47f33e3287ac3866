//! Empty and degenerate bodies and colliders.

use super::*;

fn mesh(points: &[[f32; 3]], triangles: &[[u32; 3]]) -> Geometry {
    Component::mesh(vec![3; triangles.len()], triangles.concat(), points.to_vec()).unwrap().into()
}

pub(super) fn empty_and_degenerate_colliders_do_not_disturb_the_others() {
    let against = |points: &[[f32; 3]], triangles: &[[u32; 3]]| {
        let mesh = mesh(points, triangles);
        grounded(cube(0.02)).collider(move |_| mesh.clone())
    };
    let flat = [[-1.0, 0.03, 0.0], [0.0, 0.03, 0.0], [1.0, 0.03, 0.0]];
    let cooked = hold(
        "15",
        [
            ("no collider", grounded(cube(0.02))),
            ("an empty collider", against(&[], &[])),
            ("a collider of points alone", against(&flat, &[])),
            ("#17: a collider of a triangle without area", against(&flat, &[[0, 1, 2]])),
            (
                "#17: a collider of a triangle that is a point",
                against(&[[0.05, 0.05, 0.05]; 3], &[[0, 1, 2], [0, 0, 0]]),
            ),
            (
                "#16: a collider of a triangle",
                against(&[[-1.0, 0.01, -1.0], [0.0, 0.01, 1.0], [1.0, 0.01, -1.0]], &[[0, 1, 2]]),
            ),
        ],
    );
    for k in [1, 2] {
        assert!(cooked[k].last() == cooked[0].last(), "{k}");
    }
}

pub(super) fn empty_bodies_give_empty_results_or_are_refused() {
    let nothing = || Component::tets(vec![], vec![]).unwrap();
    let cooked = hold(
        "10",
        [
            ("an empty body", grounded(nothing())),
            ("an empty body and one beside it", grounded(nothing()).and(cube(0.02))),
        ],
    );
    assert_eq!(cooked[0].tets[1].as_ref().unwrap().tets().unwrap().point_count(), 0);
    let flat = changed(&cube(0.0), |_, [x, _, z]| [x, 0.0, z]);
    let one = |p: [f32; 3]| Component::tets(vec![[0, 1, 2, 3]], vec![p; 4]).unwrap();
    refused(
        "34",
        [
            (
                "points without a tet",
                Scene::of(Component::tets(vec![], vec![[0.0; 3]; 3]).unwrap()),
                "the body has no mass",
            ),
            ("a flat body", Scene::of(flat), "the body has no mass"),
            ("a tet that is a point", Scene::of(one([0.1; 3])), "the body has no mass"),
            (
                "a tet of one point",
                Scene::of(Component::tets(vec![[0; 4]], vec![[0.0; 3]]).unwrap()),
                "joins particles [0, 0, 0, 0]",
            ),
        ],
    );
    let none = grounded(cube(0.02)).cook([], 2);
    assert!(none.tets.is_empty() && none.errors.is_empty(), "no frames are no work");
}
