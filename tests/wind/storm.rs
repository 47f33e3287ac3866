//! The whole chain on a moving and deforming skin, checked on written positions: no curve crosses the skin, lengths are
//! kept.
//!
//! Crossings are found by parry's ray casts in f64, which share no code with the kernel.

use std::collections::BTreeMap;

use engine::geometry::{Component, Geometry, V};
use numerics::parallel;
use parry3d_f64::math::Vector;
use parry3d_f64::query::{PointQuery, Ray, RayCast};
use parry3d_f64::shape::{TriMesh, TriMeshFlags};

use crate::cooked::cook_file;

const FRAMES: i64 = 48;

fn vector(p: [f32; 3]) -> Vector {
    Vector::new(f64::from(p[0]), f64::from(p[1]), f64::from(p[2]))
}

pub(crate) fn skin(mesh: &Component) -> TriMesh {
    let points = mesh.positions().iter().map(|p| vector(*p)).collect();
    TriMesh::with_flags(points, mesh.triangles().corners.clone(), TriMeshFlags::ORIENTED).unwrap()
}

/// Segments of a groom that pass through the skin.
pub(crate) fn crossings(curves: &Component, skin: &TriMesh) -> usize {
    let mut count = 0;
    for cvs in curves.runs().ranges() {
        for ends in curves.positions()[cvs].windows(2) {
            let (from, to) = (vector(ends[0]), vector(ends[1]));
            count += usize::from(skin.intersects_local_ray(&Ray::new(from, to - from), 1.0));
        }
    }
    count
}

/// Number of segments with both ends inside the body.
fn inside(curves: &Component, skin: &TriMesh) -> usize {
    let mut count = 0;
    for cvs in curves.runs().ranges() {
        let within: Vec<bool> = curves.positions()[cvs].iter().map(|p| skin.contains_local_point(vector(*p))).collect();
        count += within.windows(2).filter(|ends| ends[0] && ends[1]).count();
    }
    count
}

/// The largest change of a segment's length relative to rest, beyond the rounding of f32 positions, relative to the
/// curve's length.
fn length_error(curves: &Component, rest: &Component) -> f64 {
    let mut worst = 0.0_f64;
    for cvs in curves.runs().ranges() {
        let lengths = |part: &Component| -> Vec<f64> {
            part.positions()[cvs.clone()].windows(2).map(|ends| (vector(ends[1]) - vector(ends[0])).length()).collect()
        };
        let (now, then) = (lengths(curves), lengths(rest));
        let ulp = curves.positions()[cvs.clone()].as_flattened().iter().fold(0.0_f32, |most, x| most.max(x.abs()));
        let rounding = 4.0 * f64::from(ulp) * f64::from(f32::EPSILON);
        let whole: f64 = then.iter().sum();
        for (now, then) in now.iter().zip(&then) {
            worst = worst.max(((now - then).abs() - rounding) / whole);
        }
    }
    worst
}

#[test]
fn fur_in_a_storm_stays_outside_the_skin_and_keeps_its_lengths() {
    let (cooked, metrics) = cook_file("bear_storm", &["fur_out", "skin", "grown", "fur"], FRAMES);
    let part = |output: usize, frame: usize| -> &Geometry { &cooked[output][frame] };
    let unfreed: &BTreeMap<_, f64> = &metrics["fur_out"]["unfreed_segments"];
    let of_frames = parallel::map(0..FRAMES as usize, |_, frame| {
        let body = skin(part(1, frame).mesh().unwrap());
        let [out, grown, fur] = [0, 2, 3].map(|output| part(output, frame).curves().unwrap());
        assert!(out.positions().as_flattened().iter().all(|x| x.is_finite()));
        assert!(out.get(V).is_none());
        let found = crossings(out, &body);
        let unfreed = unfreed.values().nth(frame).unwrap();
        assert!(found as f64 <= *unfreed, "frame {}: {found} crossings, {unfreed} unfreed", frame + 1);
        let at_rest = (frame % 12 == 0).then(|| {
            let [now, then] = [inside(out, &body), inside(grown, &body)];
            assert!(now <= then, "frame {}: {now} segments inside, {then} at rest", frame + 1);
            (crossings(grown, &body), [now, then])
        });
        (found, length_error(out, fur), at_rest)
    });
    let crossed: usize = of_frames.iter().map(|(found, ..)| found).sum();
    let allowed: f64 = unfreed.values().sum();
    let lengths = of_frames.iter().fold(0.0_f64, |most, (_, error, _)| most.max(*error));
    let (mut at_rest, mut buried) = (0, [0, 0]);
    for (crossed, [now, then]) in of_frames.iter().filter_map(|(.., at_rest)| *at_rest) {
        at_rest += crossed;
        buried = [buried[0] + now, buried[1] + then];
    }
    println!(
        "bear_storm: {crossed} crossings in {FRAMES} frames ({allowed} unfreed; {at_rest} at rest in 4 frames), \
         {} segments inside in 4 frames, {} at rest, lengths to {lengths:.1e}",
        buried[0], buried[1]
    );
    assert!(lengths <= 1e-5, "{lengths}");
}
