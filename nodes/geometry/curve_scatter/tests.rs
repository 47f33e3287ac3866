//! Properties of scattered curves.

use super::*;
use crate::shared::planting::a_third_as_wide;
use conformance::{Bench, BenchResult, bench, conformance};
use numerics::vector::{self, DVec3, to_f64};

/// A square in x and z around the origin, `size` wide, facing up.
fn square(size: f32) -> Component {
    let h = 0.5 * size;
    Component::mesh(vec![4], vec![0, 1, 2, 3], vec![[-h, 0.0, -h], [-h, 0.0, h], [h, 0.0, h], [h, 0.0, -h]]).unwrap()
}

fn meadow(skin: Component) -> Bench {
    bench(&NODE).input(SKIN, skin)
}

fn roots(out: &BenchResult) -> Vec<[f32; 3]> {
    out.curves().runs().ranges().map(|cvs| out.curves().positions()[cvs.start]).collect()
}

fn ids(out: &BenchResult) -> &[i32] {
    out.curves().get(CURVE_ID).unwrap()
}

fn distance(a: [f32; 3], b: [f32; 3]) -> f64 {
    to_f64(vector::sub(b, a)).norm()
}

#[test]
fn the_number_of_curves_is_density_times_area() {
    for (size, density, expected) in [(2.0, 100.0, 400), (0.1, 1e4, 100), (1.0, 0.4, 0), (1.0, 0.6, 1), (1.0, 0.0, 0)] {
        let out = meadow(square(size)).set(DENSITY, density).cook();
        assert_eq!(out.curves().element_count(), expected);
        assert_eq!(out.metrics["curves"], expected as f64);
        assert!(out.curves().runs().counts().all(|count| count == 5));
    }
}

#[test]
fn a_width_is_written_for_every_cv_and_changes_nothing_else() {
    let [none, wide] = [0.0, 0.004].map(|width| meadow(square(1.0)).set(WIDTH_PARAM, width).cook());
    assert_eq!(none.curves().get(WIDTH), None);
    assert_eq!(wide.curves().get(WIDTH), Some(&vec![0.004; 5000][..]));
    assert_eq!(wide.curves().positions(), none.curves().positions());
}

#[test]
fn without_lean_curves_are_perpendicular_to_the_skin() {
    let out = meadow(square(1.0))
        .set(DENSITY, 50.0)
        .set(LEAN, 0.0)
        .set(LENGTH, Span { low: 0.5, high: 0.5 })
        .set(CVS, 3)
        .cook();
    for cvs in out.curves().runs().ranges() {
        let cvs = &out.curves().positions()[cvs];
        let [x, y, z] = cvs[0];
        assert!(x.abs() <= 0.5 && y == 0.0 && z.abs() <= 0.5);
        assert_eq!(cvs[1..], [[x, 0.25, z], [x, 0.5, z]]);
    }
}

#[test]
fn curves_are_straight_with_length_and_lean_in_range() {
    let out = meadow(square(1.0)).set(LENGTH, Span { low: 0.2, high: 0.4 }).set(LEAN, 0.5).set(CVS, 4).cook();
    let (mut least, mut most, mut flattest) = (f64::MAX, 0.0_f64, f64::MAX);
    for cvs in out.curves().runs().ranges() {
        let cvs = &out.curves().positions()[cvs];
        let whole = distance(cvs[0], cvs[3]);
        for pair in cvs.windows(2) {
            assert!((distance(pair[0], pair[1]) - whole / 3.0).abs() < 1e-6);
        }
        (least, most) = (least.min(whole), most.max(whole));
        flattest = flattest.min(f64::from(cvs[3][1]) / whole);
    }
    // A thousand draws come close to both ends of the range and never leave it; half a right angle has cosine 0.7071.
    assert!(least > 0.2 - 1e-6 && least < 0.202 && most < 0.4 + 1e-6 && most > 0.398, "{least} {most}");
    assert!(flattest > std::f64::consts::FRAC_1_SQRT_2 - 1e-6 && flattest < 0.712, "{flattest}");
}

#[test]
fn roots_lie_on_the_skin_and_apart_from_each_other() {
    let sphere = numerics::shapes::sphere([2.0; 3], 12);
    let points = sphere.points.iter().map(|p| p.map(|x| x as f32)).collect();
    let skin = Component::mesh(sphere.counts, sphere.corners, points).unwrap();
    let out = meadow(skin.clone()).set(DENSITY, 100.0).cook();
    let cut = skin.triangles();
    let triangles = &cut.corners;
    let at = |corner: u32| to_f64(skin.positions()[corner as usize]);
    for root in roots(&out) {
        // Smallest distance from the planes of the triangles that the root projects into.
        let off =
            triangles.iter().filter_map(|corners| height(to_f64(root), corners.map(at))).fold(f64::INFINITY, f64::min);
        assert!(off < 1e-7, "{root:?} is {off} off");
    }
    let roots = roots(&out);
    let nearest =
        |i: usize| (0..roots.len()).filter(|j| *j != i).map(|j| distance(roots[i], roots[j])).fold(f64::MAX, f64::min);
    let least = (0..roots.len()).map(nearest).fold(f64::MAX, f64::min);
    // A hundred in rows on a square metre are 0.1 apart; of 1,200 random ones the closest two would be 1.4e-3 apart.
    assert!(least > 0.045, "{least}");
}

/// Distance to the triangle's plane, if the projection is inside the triangle or just beside it.
fn height(p: DVec3, [a, b, c]: [DVec3; 3]) -> Option<f64> {
    let normal = (b - a).cross(&(c - a));
    let inside = [(a, b), (b, c), (c, a)]
        .iter()
        .all(|(from, to)| (to - from).cross(&(p - from)).dot(&normal) > -1e-6 * normal.norm_squared());
    inside.then(|| ((p - a).dot(&normal) / normal.norm()).abs())
}

#[test]
fn a_higher_density_keeps_every_curve() {
    let grown = |density| {
        let out = meadow(square(1.0)).set(DENSITY, density).cook();
        let mut grown: Vec<(i32, [f32; 3])> = ids(&out).iter().copied().zip(roots(&out)).collect();
        grown.sort_by_key(|(id, _)| *id);
        grown
    };
    let (fewer, more) = (grown(300.0), grown(330.0));
    assert_eq!(more[..300], fewer);
}

#[test]
fn a_mask_scales_the_density() {
    // 0 along x = −0.5, 1 along x = 0.5: half of the curves, three quarters of them on the right.
    let mut skin = square(1.0);
    skin.set(Attr::<f32>::point("lawn"), vec![0.0, 0.0, 1.0, 1.0]).unwrap();
    let out = meadow(skin.clone()).set(DENSITY, 4000.0).set(MASK, "lawn".into()).cook();
    let all = out.curves().element_count();
    let right = roots(&out).iter().filter(|root| root[0] > 0.0).count();
    assert!(all.abs_diff(2000) < 60, "{all}");
    assert!(right.abs_diff(1500) < 50, "{right}");
    // A mask above 1 adds curves: 2 everywhere equals twice the density.
    skin.set(Attr::<f32>::point("lawn"), vec![2.0; 4]).unwrap();
    let doubled = meadow(skin.clone()).set(DENSITY, 500.0).set(MASK, "lawn".into()).cook();
    let plain = meadow(skin.clone()).set(DENSITY, 1000.0).cook();
    assert_eq!(doubled.curves().positions(), plain.curves().positions());
    // Masks of 0 and below grow nothing.
    skin.set(Attr::<f32>::point("lawn"), vec![0.0, -1.0, 0.0, -5.0]).unwrap();
    assert_eq!(meadow(skin).set(MASK, "lawn".into()).cook().curves().element_count(), 0);
}

#[test]
fn a_missing_or_non_float_mask_is_refused() {
    let error = meadow(square(1.0)).set(MASK, "lawn".into()).try_cook().unwrap_err();
    assert_eq!(error.to_string(), "`mask` is `lawn`, which `skin` does not have; expected one float for each vertex");
    let mut skin = square(1.0);
    skin.set(Attr::<f32>::point("lawns"), vec![1.0; 4]).unwrap();
    let error = meadow(skin).set(MASK, "lawn".into()).try_cook().unwrap_err();
    assert_eq!(error.hint.as_deref(), Some("did you mean `lawns`?"));
    let error = meadow(square(1.0)).set(MASK, "P".into()).try_cook().unwrap_err();
    assert_eq!(error.fact, "`mask` is `P`, which is one float3 for each vertex");
}

/// The square, rotated by a quarter turn about z in each frame and lifted.
fn turned(frame: i64) -> Component {
    let mut skin = square(1.0);
    for p in skin.edit(P).unwrap() {
        for _ in 1..frame {
            *p = [-p[1], p[0], p[2]];
        }
        p[2] += frame as f32 - 1.0;
    }
    skin
}

#[test]
fn curves_stay_on_a_moving_skin() {
    let skin = bench(&NODE).moving(SKIN, |frame| turned(frame.floor_number()).into()).set(DENSITY, 40.0);
    let still = skin.clone().at(1.0).cook();
    let moved = skin.at(2.0).cook();
    assert_eq!(ids(&still), ids(&moved));
    for (a, b) in still.curves().positions().iter().zip(moved.curves().positions()) {
        let expected = [-a[1], a[0], a[2] + 1.0];
        assert!((0..3).all(|k| (b[k] - expected[k]).abs() < 1e-6), "{b:?} is not {expected:?}");
    }
    assert_eq!(moved.curves().get(PREF), Some(still.curves().positions()));
}

#[test]
fn a_stretched_skin_keeps_its_curves() {
    let skin = bench(&NODE).moving(SKIN, |frame| square(frame.number() as f32).into()).set(DENSITY, 40.0);
    let counts: Vec<usize> = skin.frames([1, 2, 7]).iter().map(|out| out.curves().element_count()).collect();
    assert_eq!(counts, [40; 3]);
}

#[test]
fn a_still_skin_shares_rest_positions_with_positions() {
    let out = meadow(square(1.0)).cook();
    let column = |name: &str| out.curves().table(Owner::Point).column(name).unwrap();
    assert!(column("Pref").same(column("P")));
}

#[test]
fn a_skin_whose_faces_change_is_refused() {
    let skin = bench(&NODE).moving(SKIN, |frame| {
        let triangle = Component::mesh(vec![3], vec![0, 1, 2], square(1.0).positions().to_vec()).unwrap();
        if frame.floor_number() == 1 { square(1.0).into() } else { triangle.into() }
    });
    let error = skin.at(2.0).try_cook().unwrap_err();
    assert!(error.fact.starts_with("`skin` has 1 faces and 4 points"), "{error}");
}

#[test]
fn curves_take_texture_coordinates_and_normals_from_the_skin() {
    let mut skin = square(1.0);
    let uvw = skin.positions().iter().map(|p| [p[0] + 0.5, p[2] + 0.5, 0.0]).collect();
    skin.set(UVW, uvw).unwrap();
    skin.set(N, vec![[1.0, 0.0, 0.0]; 4]).unwrap();
    let out = meadow(skin).set(DENSITY, 30.0).set(LEAN, 0.0).set(CVS, 2).cook();
    for (cvs, uvw) in out.curves().positions().chunks(2).zip(out.curves().get(UVW).unwrap().chunks(2)) {
        assert!((uvw[0][0] - cvs[0][0] - 0.5).abs() < 1e-6 && (uvw[0][1] - cvs[0][2] - 0.5).abs() < 1e-6);
        assert_eq!(uvw[0], uvw[1]);
        assert!(cvs[1][0] > cvs[0][0] && cvs[1][1] == cvs[0][1]);
    }
}

#[test]
fn the_seed_changes_curves_and_the_number_of_threads_does_not() {
    let grown = |seed, threads| meadow(square(1.0)).set(SEED, Seed(seed)).threads(threads).cook();
    assert_eq!(grown(1, 1).geometry, grown(1, 7).geometry);
    assert_ne!(grown(1, 2).geometry, grown(2, 2).geometry);
}

#[test]
fn a_skin_without_area_grows_nothing() {
    let empty = Component::mesh(vec![], vec![], vec![]).unwrap();
    let line = Component::mesh(vec![3], vec![0, 1, 2], vec![[0.0; 3], [1.0; 3], [2.0; 3]]).unwrap();
    for skin in [empty, line] {
        let out = meadow(skin).cook();
        assert_eq!((out.curves().element_count(), out.curves().point_count()), (0, 0));
    }
}

#[test]
fn a_scaled_scene_grows_scaled_curves() {
    let grown = |scale: f32| {
        let length = Span { low: 0.05 * scale, high: 0.1 * scale };
        meadow(square(scale)).set(DENSITY, 1000.0 / (scale * scale)).set(LENGTH, length).cook()
    };
    let expected = grown(1.0);
    for scale in [2_f32.recip() / 524_288.0, 1_048_576.0] {
        let scaled: Vec<[f32; 3]> = expected.curves().positions().iter().map(|p| p.map(|x| x * scale)).collect();
        assert!(grown(scale).curves().positions() == scaled, "{scale}");
    }
}

#[test]
fn any_number_of_cvs_and_any_length_give_finite_curves() {
    let curve = |cvs, length| {
        meadow(square(0.1)).set(DENSITY, 200.0).set(CVS, cvs).set(LENGTH, Span { low: 0.0, high: length }).cook()
    };
    for (cvs, length) in [(2, 0.0), (10_000, 1.0), (3, 1e30)] {
        assert_eq!(curve(cvs, length).curves().point_count(), 2 * cvs as usize);
    }
}

#[test]
fn more_cvs_than_memory_should_hold_are_refused() {
    let error = meadow(square(1e6)).try_cook().unwrap_err();
    assert_eq!(error.fact, "1000000000000000 curves of 5 CVs would grow on 1000000000000 m², more than 67108864 CVs");
    // A mask that is 0 except on a small part makes the same plain fit: only faces under the mask count.
    let far = 1e6;
    let points =
        vec![[0.0, 0.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [far, 0.0, 0.0], [far, 0.0, far], [0.0, 0.0, far]];
    let mut plain = Component::mesh(vec![3, 3], vec![0, 1, 2, 3, 5, 4], points).unwrap();
    plain.set(Attr::<f32>::point("lawn"), vec![1.0, 1.0, 1.0, 0.0, 0.0, 0.0]).unwrap();
    assert_eq!(meadow(plain).set(MASK, "lawn".into()).cook().curves().element_count(), 500);
}

#[test]
fn it_conforms() {
    conformance(&NODE).with(|bench| bench.changed(SKIN, a_third_as_wide)).run();
}

#[test]
fn a_skin_that_is_mirrored_in_motion_is_refused_as_such() {
    let skin = |frame: Frame| {
        let corners = if frame.number() < 3.0 { vec![0, 1, 2, 3] } else { vec![0, 3, 2, 1] };
        Component::mesh(vec![4], corners, square(1.0).positions().to_vec()).unwrap().into()
    };
    let error = bench(&NODE).moving(SKIN, skin).at(3.0).try_cook().unwrap_err();
    assert_eq!(error.fact, "`skin` is mirrored, which turns its faces inside out since the scene's first frame");
}
