//! Fur on a body at a time: its skin, its shape at rest there, and blown.

use crate::bodies::Body;
use curves::attach::{SkinBinding, attach_curves};
use curves::scatter::{ScatterSurface, vertex_normals};
use curves::wind_bend::{Bend, BendMode, BendNoise, bend};
use numerics::noise::{Field, NoiseKind};
use numerics::ramp::Ramp;
use numerics::random::Key;
use numerics::tree::TriangleTree;
use numerics::vector::{DVec3, Vec3, rotation, to_f32, to_f64};

/// CVs of a curve.
pub(crate) const CVS: usize = 7;

/// How skin and wind move.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Case {
    /// The wind turns by 1° a frame about a still skin.
    Still,
    /// The skin turns, sways and bends by several degrees a frame besides.
    Moving,
    /// On such a skin, wind with noise that comes in gusts and changes its direction.
    Storm,
}

/// Fur on a body.
pub(crate) struct Groom {
    pub(crate) body: Body,
    pub(crate) starts: Vec<u32>,
    rest: Vec<Vec3>,
    binding: SkinBinding,
    field: Field,
}

/// The groom at a time.
pub(crate) struct Sample {
    pub(crate) tree: TriangleTree,
    pub(crate) normals: Vec<Vec3>,
    pub(crate) rest: Vec<Vec3>,
    pub(crate) goal: Vec<Vec3>,
}

impl Groom {
    /// `count` curves of `CVS` CVs, 6 to 10 cm long, combed backwards, down and towards their tips.
    pub(crate) fn on(body: Body, count: usize) -> Self {
        let normals = vertex_normals(&body.points, &body.triangles);
        let roots = ScatterSurface::new(&body.points, &body.triangles).spread(count, Key::new(1));
        let mut rest = Vec::new();
        for (curve, root) in roots.iter().enumerate() {
            let key = Key::new(2).of(curve as u64);
            let corners = body.triangles[root.triangle as usize];
            let normal = root.interpolate(corners.map(|corner| normals[corner as usize].into()));
            let up = DVec3::from(normal).normalize();
            let random = |k: u64| DVec3::from_fn(|axis, _| key.of(k).of(axis as u64).f64() - 0.5);
            let comb = DVec3::new(-1.0, -0.4, 0.1) + random(0) * 0.6;
            let side = (comb - up * comb.dot(&up)).try_normalize(1e-3).unwrap_or_else(|| up.cross(&DVec3::x()));
            let step = (0.06 + 0.04 * key.of(1).f64()) / (CVS - 1) as f64;
            let lean = 0.35 + 0.25 * key.of(2).f64();
            let mut at = root.position(&body.points, &body.triangles);
            for cv in 0..CVS {
                rest.push(to_f32(at));
                let (sine, cosine) = libm::sincos(lean + 0.09 * cv as f64);
                at += (up * cosine + side * sine) * step;
            }
        }
        let binding = SkinBinding::to_surface(&body.points, &body.triangles, &roots);
        let starts = (0..=roots.len()).map(|curve| (curve * CVS) as u32).collect();
        Self { body, starts, rest, binding, field: Field::new(NoiseKind::Perlin, 2, 0.5, 7) }
    }

    /// The groom at `frame`, which need not be whole.
    pub(crate) fn at(&self, case: Case, frame: f64) -> Sample {
        let points = match case {
            Case::Still => self.body.points.clone(),
            Case::Moving | Case::Storm => self.body.points.iter().map(|p| pose(*p, frame)).collect(),
        };
        let rest = match case {
            Case::Still => self.rest.clone(),
            Case::Moving | Case::Storm => attach_curves(&self.starts, &self.rest, &self.binding.poses(&points)).points,
        };
        let goal = self.blown(case, frame, &rest);
        let normals = curves::collide::normals(&points, &self.body.triangles);
        Sample { tree: TriangleTree::build(&points, &self.body.triangles), normals, rest, goal }
    }

    /// The same groom with one curve alone; on a still skin.
    pub(crate) fn only(&self, curve: usize) -> Self {
        let cvs = self.starts[curve] as usize..self.starts[curve + 1] as usize;
        Self {
            body: self.body.clone(),
            starts: vec![0, cvs.len() as u32],
            rest: self.rest[cvs].to_vec(),
            binding: self.binding.clone(),
            field: self.field.clone(),
        }
    }

    /// Whether a point is judged: not where the plane ends within reach of its curve.
    pub(crate) fn is_judged(&self, p: Vec3) -> bool {
        self.body.points.len() > 4 || (p[0].abs() < 1.3 && p[2].abs() < 1.3)
    }

    fn blown(&self, case: Case, frame: f64, rest: &[Vec3]) -> Vec<Vec3> {
        let storm = case == Case::Storm;
        let time = frame / 24.0;
        let degrees = if storm { 70.0 * libm::sin(2.0 * time) + 40.0 * libm::sin(5.1 * time) } else { frame };
        let (sine, cosine) = libm::sincos(degrees.to_radians());
        let wind = to_f32(DVec3::new(cosine, 0.1, sine).normalize());
        let gust = |p: &Vec3| 0.45 + 0.55 * libm::sin(4.0 * f64::from(p[0]) + 2.0 * f64::from(p[2]) - 9.0 * time);
        let envelope: Vec<f32> = rest.iter().map(|p| gust(p).clamp(0.0, 1.0) as f32).collect();
        let ramp = Ramp::constant(1.0);
        let noise = BendNoise {
            field: &self.field,
            amplitude: 0.7.into(),
            frequency: 2.0,
            waviness: 0.5.into(),
            origin: [-2.0 * time, 0.0, 0.0],
            other: None,
            roots: None,
        };
        let how = Bend {
            wind,
            rotate: 0.5.into(),
            envelope: storm.then_some(&envelope[..]),
            ramp: &ramp,
            mode: BendMode::Paper,
            blend: 1.0.into(),
            noise: storm.then_some(noise),
            gusts: None,
        };
        bend(&self.starts, rest, &how).points
    }
}

/// A point of a moving skin: turned by up to 6° a frame, swayed by up to 3°, and bent sideways along its length.
fn pose(p: Vec3, frame: f64) -> Vec3 {
    let wave = |period: f64, phase: f64| libm::sin(std::f64::consts::TAU * (frame / period + phase));
    let p = to_f64(p);
    let bent = p + DVec3::z() * (0.06 * libm::sin(2.5 * p.x - std::f64::consts::TAU * frame / 15.0));
    let middle = DVec3::new(0.0, 0.8, 0.0);
    let turn = rotation(DVec3::y(), (23.0 * wave(24.0, 0.1)).to_radians());
    let sway = rotation(DVec3::x(), (8.0 * wave(17.0, 0.3)).to_radians());
    to_f32(middle + turn * (sway * (bent - middle)))
}
