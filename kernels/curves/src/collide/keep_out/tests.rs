//! Curves kept out of a floor.

use super::*;
use crate::collide::normals;
use numerics::random::Key;

/// A skin with what kernels need of it.
struct Mesh {
    points: Vec<Vec3>,
    triangles: Vec<[u32; 3]>,
    normals: Vec<Vec3>,
    tree: TriangleTree,
}

impl Mesh {
    fn of(points: Vec<Vec3>, triangles: Vec<[u32; 3]>) -> Self {
        let (normals, tree) = (normals(&points, &triangles), TriangleTree::build(&points, &triangles));
        Self { points, triangles, normals, tree }
    }

    /// A square of 2 m in the plane y = 0, facing up.
    fn floor() -> Self {
        let points = vec![[-1.0, 0.0, -1.0], [-1.0, 0.0, 1.0], [1.0, 0.0, 1.0], [1.0, 0.0, -1.0]];
        Self::of(points, vec![[0, 1, 2], [0, 2, 3]])
    }

    fn skin(&self) -> SkinSurface<'_> {
        SkinSurface { tree: &self.tree, triangles: &self.triangles, normals: &self.normals }
    }
}

const CVS: u32 = 5;
const STEP: f32 = 0.02;

/// Upright hairs on the floor, and the same turned about z by up to ±2 rad: about a quarter of them into it.
fn hairs(count: u64) -> (Vec<u32>, Vec<Vec3>, Vec<Vec3>) {
    let starts = (0..=count as u32).map(|hair| CVS * hair).collect();
    let (mut rest, mut goal) = (Vec::new(), Vec::new());
    for hair in 0..count {
        let at = |k: u64| Key::new(3).of(hair).of(k).f32();
        let root = [at(0) - 0.5, 0.0, at(1) - 0.5];
        let (sine, cosine) = libm::sincosf(4.0 * at(2) - 2.0);
        for k in 0..CVS {
            let r = STEP * k as f32;
            rest.push([root[0], r, root[2]]);
            goal.push([root[0] - r * sine, r * cosine, root[2]]);
        }
    }
    (starts, rest, goal)
}

fn kept(mesh: &Mesh, starts: &[u32], rest: &[Vec3], goal: &[Vec3], clearance: &Clearance) -> (Vec<Vec3>, KeptOut) {
    let mut points = goal.to_vec();
    let how = KeepOut { skin: mesh.skin(), rest, poses: None, gap: 1e-4, clearance };
    how.prepare(starts);
    let kept = keep_out(starts, &mut points, &how, &[]);
    (points, kept)
}

#[test]
fn hairs_blown_into_the_floor_end_on_it_and_the_others_keep_their_bits() {
    let (starts, rest, goal) = hairs(600);
    let mesh = Mesh::floor();
    let (points, kept) = kept(&mesh, &starts, &rest, &goal, &Clearance::of(600));
    let mut into = 0;
    for (hair, now) in points.chunks(CVS as usize).enumerate() {
        let goal = &goal[hair * CVS as usize..][..CVS as usize];
        if goal[4][1] >= 0.0 {
            assert_eq!(now, goal, "hair {hair}");
            continue;
        }
        into += 1;
        assert!(now.iter().all(|cv| cv[1] >= -1e-7), "hair {hair}: {now:?}");
        // From its goal the hair turns towards rest, by at most 2 rad, until it is free by less than 1/128 of that.
        let lowest = now[1..].iter().map(|cv| cv[1]).fold(1.0, f32::min);
        assert!(lowest < 0.08 * 2.0 / 128.0, "hair {hair} does not reach the floor: {now:?}");
        for ends in now.windows(2) {
            let length = (to_f64(ends[1]) - to_f64(ends[0])).norm();
            assert!((length - f64::from(STEP)).abs() < 1e-7);
        }
    }
    assert_eq!((kept.kept_out, kept.started_inside, kept.crossings_left), (into, 0, 0));
    assert!(into > 100 && kept.length_error < 1e-5, "{into} {}", kept.length_error);
}

/// The second use has half-spaces, the first has none.
#[test]
fn half_spaces_change_no_bit() {
    let (starts, rest, goal) = hairs(600);
    let mesh = Mesh::floor();
    let clearance = Clearance::of(600);
    let first = kept(&mesh, &starts, &rest, &goal, &clearance);
    assert_eq!(clearance.half_spaces.known().count(), 0);
    let second = kept(&mesh, &starts, &rest, &goal, &clearance);
    let known: Vec<HalfSpace> = clearance.half_spaces.known().copied().collect();
    let of = |hair: usize| hair * CVS as usize..(hair + 1) * CVS as usize;
    let free = |hair: usize| known[hair].clears_curve(&to_f64(rest[of(hair).start]), &goal[of(hair)], 5e-4);
    assert!((0..600).filter(|hair| free(*hair)).count() > 300, "most hairs are free without a query");
    // Sixteen at a time, of fewer CVs on every third.
    let shorter = |hair: usize| if hair.is_multiple_of(3) { 3 } else { CVS as usize };
    let (mut fewer, mut few_rest, mut few_goal) = (vec![0], Vec::new(), Vec::new());
    for hair in 0..600 {
        let cvs = of(hair).start..of(hair).start + shorter(hair);
        few_rest.extend_from_slice(&rest[cvs.clone()]);
        few_goal.extend_from_slice(&goal[cvs]);
        fewer.push(few_goal.len() as u32);
    }
    let how = KeepOut { skin: mesh.skin(), rest: &few_rest, poses: None, gap: 1e-4, clearance: &clearance };
    for path in Path::all() {
        let mut segments = Vec::new();
        find_segments(path, 0..600, &fewer, &few_goal, &how, &mut segments);
        let mut differ = 0;
        for hair in 0..600 {
            let cvs = of(hair).start..of(hair).start + shorter(hair);
            let expected = known[hair].clears_curve(&to_f64(rest[cvs.start]), &goal[cvs], 5e-4);
            assert!(expected || segments[hair] != 0, "hair {hair}");
            differ += usize::from(expected != (segments[hair] == 0));
        }
        assert!(differ <= 2, "{differ} hairs are left to the exact test by rounding alone");
    }
    assert_eq!(first, second);
    for path in Path::all() {
        let mut points = goal.clone();
        let how = KeepOut { skin: mesh.skin(), rest: &rest, poses: None, gap: 1e-4, clearance: &clearance };
        assert_eq!((keep_out_on(path, &starts, &mut points, &how, &[]), points), (second.1, second.0.clone()));
        // Told which segments may enter: of hairs whose tips are bent up a part of them.
        let mut bent = goal.clone();
        bent.chunks_mut(CVS as usize).for_each(|cvs| cvs[3..].iter_mut().for_each(|cv| cv[1] = cv[1].abs()));
        for goal in [&goal, &bent] {
            let mut segments = Vec::new();
            find_segments(path, 0..600, &starts, goal, &how, &mut segments);
            let some = segments.iter().filter(|bits| (1..4).contains(&bits.count_ones())).count();
            assert!((some > 100) == (goal == &bent), "{some}");
            let [told, all] = [segments, vec![u32::MAX; 600]].map(|segments| {
                let mut points = goal.clone();
                (keep_out_on(path, &starts, &mut points, &how, &segments), points)
            });
            assert_eq!(told, all);
            assert!(told.0.kept_out > 100);
        }
    }
}

/// A hair that is lowered through the floor a little at a time does not jump as it touches it.
#[test]
fn a_hair_that_touches_the_skin_does_not_jump() {
    let mesh = Mesh::floor();
    let rest: Vec<Vec3> = (0..CVS).map(|k| [0.0, STEP * k as f32, 0.0]).collect();
    let tip = |step: u32| {
        let (sine, cosine) = libm::sincosf(1.4 + 0.005 * step as f32);
        let goal: Vec<Vec3> = (0..CVS).map(|k| STEP * k as f32).map(|r| [r * sine, r * cosine, 0.0]).collect();
        to_f64(kept(&mesh, &[0, CVS], &rest, &goal, &Clearance::of(1)).0[4])
    };
    // 0.4 mm a step where the hair is free.
    let largest = (0..80).map(|step| (tip(step + 1) - tip(step)).norm()).fold(0.0, f64::max);
    assert!(largest < 2e-3, "{largest}");
    assert!(tip(80).y > 0.0 && tip(80).y < 2e-3);
}

/// Frames that use half-spaces at the same time find them together, with the bits of one that is alone.
#[test]
fn frames_share_half_spaces() {
    let (starts, rest, goal) = hairs(600);
    let mesh = Mesh::floor();
    let alone = kept(&mesh, &starts, &rest, &goal, &Clearance::of(600));
    let clearance = Clearance::of(600);
    std::thread::scope(|scope| {
        for _ in 0..4 {
            scope.spawn(|| assert_eq!(kept(&mesh, &starts, &rest, &goal, &clearance), alone));
        }
    });
    assert_eq!(clearance.half_spaces.known().count(), 600);
}

/// One that dips into the floor at rest is turned out of it, and counted.
#[test]
fn hairs_that_cross_the_skin_at_rest_are_turned_out() {
    let mesh = Mesh::floor();
    let rest = vec![[0.0, 0.01, 0.0], [0.0, 0.05, 0.0], [0.02, -0.01, 0.0], [0.3, 0.1, 0.0], [0.3, 0.2, 0.0]];
    let goal = vec![[0.0, 0.01, 0.0], [0.0, 0.05, 0.0], [0.04, -0.003_245_553, 0.0], [0.3, 0.1, 0.0], [0.3, 0.0, 0.0]];
    let (points, kept) = kept(&mesh, &[0, 3, 5], &rest, &goal, &Clearance::of(2));
    assert_eq!(points[..2], goal[..2]);
    assert!(points[2][1] > 0.0 && points[4][1] > 0.0 && points[4][1] < 2e-3, "{points:?}");
    assert_eq!((kept.kept_out, kept.started_inside, kept.crossings_left), (2, 1, 0));
    assert!(kept.length_error < 1e-5);
}

/// A root below the floor is lifted a gap above it, and its hair then lies on it.
#[test]
fn hairs_with_their_roots_in_the_skin_are_lifted() {
    let mesh = Mesh::floor();
    let rest: Vec<Vec3> = (0..CVS).map(|k| [0.0, STEP * k as f32 - 0.003, 0.0]).collect();
    let goal: Vec<Vec3> = (0..CVS).map(|k| [STEP * k as f32, -0.001 * k as f32 - 0.003, 0.0]).collect();
    let (points, found) = kept(&mesh, &[0, CVS], &rest, &goal, &Clearance::of(1));
    // All of the hair is below the floor, and crosses nothing.
    assert_eq!((points, found), (goal, KeptOut::default()));
    let goal: Vec<Vec3> = (0..CVS).map(|k| [STEP * k as f32, 0.001 * k as f32 - 0.003, 0.0]).collect();
    let (points, found) = kept(&mesh, &[0, CVS], &rest, &goal, &Clearance::of(1));
    assert!((points[0][1] - 1e-4).abs() < 1e-6 && points[0][0] == 0.0, "{points:?}");
    assert!(points[1..].iter().all(|cv| cv[1] > 0.0 && cv[1] < 6e-3), "{points:?}");
    assert_eq!((found.kept_out, found.started_inside, found.crossings_left), (1, 0, 0));
    assert!(found.length_error < 1e-5);
}

/// On a skin that moved, rest shapes are those that moved with it.
#[test]
fn poses_carry_rest_shapes() {
    let (starts, rest, goal) = hairs(200);
    let (mesh, still) = (Mesh::floor(), Clearance::of(200));
    let expected = kept(&mesh, &starts, &rest, &goal, &still);
    let shift = DVec3::new(0.0, 8.0, 0.0);
    let moved = |points: &[Vec3]| points.iter().map(|p| to_f32(to_f64(*p) + shift)).collect::<Vec<_>>();
    let above = Mesh::of(moved(&mesh.points), mesh.triangles.clone());
    let pose = RootPose { translation: shift, rotation: numerics::vector::DQuat::identity(), lost: false };
    let poses = vec![pose; 200];
    let clearance = Clearance::of(200);
    for _ in 0..2 {
        let mut points = moved(&goal);
        let how = KeepOut { skin: above.skin(), rest: &rest, poses: Some(&poses), gap: 1e-4, clearance: &clearance };
        how.prepare(&starts);
        let kept = keep_out(&starts, &mut points, &how, &[]);
        assert_eq!(kept.kept_out, expected.1.kept_out);
        let off = points.iter().zip(&expected.0).map(|(a, b)| (to_f64(*a) - shift - to_f64(*b)).amax());
        // Rounding may decide whether the last half is free: 0.08 m × 2 rad ÷ 128.
        assert!(off.fold(0.0, f64::max) < 3e-3);
    }
}
