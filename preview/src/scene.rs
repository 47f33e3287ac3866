//! The drawn scene: the layers' components as triangles, strands and balls on the stage, coloured but not yet lit.
//!
//! Guarantees: contains every component of every layer, in the order of the layers, then mesh, tets, volume, curves,
//! points. Limit: non-finite triangles and CVs are left out individually.

use engine::geometry::{Component, Geometry, Kind, Owner, Topology, Volume, WIDTH};

use crate::camera::BoundingBox;
use crate::clip::{Clip, Plane};
use crate::color::{Paint, SPEED};
use crate::shape::{boundary, level_set, smooth};
use crate::vector::finite;
use crate::view::Stage;
use crate::{Layer, PictureSettings};
use numerics::parallel;
use numerics::vector::{Vec3, scale, sub, unit};

/// A corner of a triangle, with the normal there.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Corner {
    pub(crate) at: Vec3,
    pub(crate) normal: Vec3,
    pub(crate) color: Vec3,
}

impl Corner {
    /// The normal of a cut face, which is drawn in its colour without light.
    pub(crate) const UNLIT: Vec3 = [0.0; 3];
}

/// A CV of a strand.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Knot {
    pub(crate) at: Vec3,
    /// Unit, root to tip.
    pub(crate) tangent: Vec3,
    pub(crate) radius: f32,
    pub(crate) color: Vec3,
}

/// Consecutive knots, two or more.
#[derive(Clone, Debug)]
pub(crate) struct Strand {
    pub(crate) knots: std::ops::Range<usize>,
    pub(crate) seed: u32,
}

/// A ball.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Dot {
    pub(crate) at: Vec3,
    pub(crate) radius: f32,
    pub(crate) color: Vec3,
    /// Fraction of the key light that reaches it.
    pub(crate) lit: f32,
    pub(crate) seed: u32,
}

/// Everything that is drawn.
#[derive(Debug, Default)]
pub(crate) struct Scene {
    pub(crate) triangles: Vec<[Corner; 3]>,
    pub(crate) knots: Vec<Knot>,
    pub(crate) strands: Vec<Strand>,
    pub(crate) dots: Vec<Dot>,
    /// The plane that cuts what is being added.
    pub(crate) cut: Option<Plane>,
}

/// Default colours, linear light: clay, dark skin if curves may grow on it, putty, honey, brown hair, water.
const MESH: Vec3 = [0.50, 0.45, 0.39];
const SKIN: Vec3 = [0.21, 0.135, 0.09];
const TETS: Vec3 = [0.62, 0.46, 0.28];
const VOLUME: Vec3 = [0.58, 0.24, 0.035];
const CURVES: Vec3 = [0.50, 0.26, 0.105];
const POINTS: Vec3 = [0.12, 0.32, 0.60];
/// Colour of guides, and their width relative to half the scene's diagonal: a line about a pixel wide.
pub(crate) const GUIDE: Vec3 = [0.03, 0.055, 0.10];
const GUIDE_WIDTH: f32 = 0.0045;
/// Points of a guide above which its lines get thinner, and the least fraction of their width.
const GUIDE_SEGMENTS: f32 = 2000.0;
const LEAST_GUIDE: f32 = 0.15;
/// Brightness of a mesh relative to the curves of the same output.
const UNDER_CURVES: f32 = 0.45;

/// Default width of a curve, relative to half the scene's diagonal: hair on an animal that fills the picture.
const CURVE_WIDTH: f32 = 0.0035;
/// Width of such a curve at its tip, relative to its width at the root.
const TIP: f32 = 0.3;
/// Default diameter of a point, relative to the mean spacing of that many points in half the scene's diagonal, and its
/// limits, so that single points are not too large and a million points are still visible.
const POINT_WIDTH: f32 = 1.1;
const POINT_WIDTHS: [f32; 2] = [0.004, 0.06];
/// Light at the root of a strand relative to that at its tip, since neighbours shade the root.
const ROOT: f32 = 0.5;
/// Largest random difference in colour between strands.
const STRAND_TINT: f32 = 0.22;

/// Bytes that [`render`](crate::render) takes for a point of curves, a corner of a mesh, a tet and a point, measured.
const CURVE_POINT: usize = 256;
const MESH_CORNER: usize = 256;
const TET: usize = 128;
const POINT: usize = 192;
/// And for a byte of a volume, whose surface is found.
const VOLUME_BYTE: usize = 4;

/// About how many bytes a picture of the layers takes besides them.
pub fn memory(layers: &[Layer<'_>]) -> usize {
    let part_bytes = |part: &Component| match part.topology() {
        Topology::Curves(_) => part.point_count().saturating_mul(CURVE_POINT),
        Topology::Mesh(faces) => faces.corners.len().saturating_mul(MESH_CORNER),
        Topology::Tets(_) => part.tet_corners().len().saturating_mul(TET),
        _ => part.point_count().saturating_mul(POINT),
    };
    let layer_bytes = |layer: &Layer<'_>| {
        let volume = layer.geometry.volume().map_or(0, |volume| {
            volume.fields().into_iter().flat_map(|(_, field)| field.arrays()).map(|(_, bytes)| bytes).sum::<usize>()
        });
        layer.geometry.parts().map(part_bytes).fold(volume.saturating_mul(VOLUME_BYTE), usize::saturating_add)
    };
    layers.iter().map(layer_bytes).fold(0, usize::saturating_add)
}

/// Number of triangles in a task, and of points.
const TASK: usize = 1024;
const POINT_TASK: usize = 4096;

/// Smallest and largest coordinates of everything that is drawn, metres; `None` for an empty scene.
///
/// With the union over all frames and outputs as [`PictureSettings::bounds`], every picture is framed in the same way.
pub fn bounds(layers: &[Layer<'_>]) -> Option<BoundingBox> {
    let mut bounds = None::<BoundingBox>;
    for layer in layers.iter().filter(|layer| !layer.is_guide) {
        each_point(layer.geometry, |p| bounds = union(bounds, Some([p; 2])));
    }
    bounds
}

/// Calls `take` with every finite point of a geometry; for a volume, with the corners of its liquid cells.
pub(crate) fn each_point(geometry: &Geometry, mut take: impl FnMut([f32; 3])) {
    for part in geometry.parts() {
        part.positions().iter().filter(|p| finite(**p)).for_each(|p| take(*p));
    }
    let Some(volume) = geometry.volume() else { return };
    let grid = volume.level_grid();
    for (low, _) in volume.level_set().nodes().filter(|(_, phi)| *phi < 0.0) {
        for corner in 0..8_u32 {
            let at: [f32; 3] =
                std::array::from_fn(|k| grid.origin[k] + grid.cell * (low[k] + (corner >> k & 1)) as f32);
            if finite(at) {
                take(at);
            }
        }
    }
}

/// The smallest box around both.
pub fn union(a: Option<BoundingBox>, b: Option<BoundingBox>) -> Option<BoundingBox> {
    match (a, b) {
        (Some([a, b]), Some([c, d])) => Some([[0, 1, 2].map(|k| a[k].min(c[k])), [0, 1, 2].map(|k| b[k].max(d[k]))]),
        (one, other) => one.or(other),
    }
}

impl Scene {
    /// The layers' components on the stage.
    pub(crate) fn of(layers: &[Layer<'_>], settings: &PictureSettings, range: [f32; 2], stage: &Stage) -> Self {
        let color_by = settings.color_by.as_deref().map(|name| (name, range));
        let mut scene = Self { cut: settings.clip.map(|clip| clip.on(stage)), ..Self::default() };
        let drawn = || layers.iter().filter(|layer| !layer.is_guide);
        let mesh_color = if drawn().any(|layer| layer.geometry.curves().is_some()) { SKIN } else { MESH };
        for layer in drawn() {
            let plain = |default: Vec3| layer.color.unwrap_or(default);
            let paint = |part: &Component, default| Paint::of(part, color_by, plain(default));
            if let Some(part) = layer.geometry.mesh() {
                // Under curves of the same colour a mesh would not be seen.
                let under = if layer.geometry.curves().is_some() { UNDER_CURVES } else { 1.0 };
                let color = layer.color.map_or(mesh_color, |color| scale(color, under));
                scene.mesh(part, &Paint::of(part, color_by, color), stage);
            }
            if let Some(part) = layer.geometry.tets() {
                let (skin, tets): (Vec<_>, Vec<_>) = boundary::boundary(part.tet_corners()).into_iter().unzip();
                scene.surface(&place(part.positions(), stage), &skin, &tets, &paint(part, TETS));
            }
            if let Some(volume) = layer.geometry.volume() {
                scene.volume(volume, color_by, plain(VOLUME), stage);
            }
            if let Some(part) = layer.geometry.curves() {
                scene.curves(part, &paint(part, CURVES), settings.curve_width, stage);
            }
            if let Some(part) = layer.geometry.part(Kind::Points) {
                scene.points(part, &paint(part, POINTS), settings.point_width, stage);
            }
        }
        scene.cut = None;
        scene
    }

    /// Adds the layers that are guides, as lines without light. After lighting, so that they cast no shadows.
    pub(crate) fn add_guides(&mut self, layers: &[Layer<'_>], clip: Option<Clip>, stage: &Stage) {
        let cut = clip.map(|clip| clip.on(stage));
        for layer in layers.iter().filter(|layer| layer.is_guide) {
            let Some(part) = layer.geometry.curves() else { continue };
            // Many lines are thinner, so that what is behind them stays visible.
            let crowd = (GUIDE_SEGMENTS / part.point_count().max(1) as f32).clamp(LEAST_GUIDE, 1.0);
            let knot = |at: Vec3| Knot {
                at,
                tangent: [0.0, 1.0, 0.0],
                radius: 0.5 * GUIDE_WIDTH * crowd,
                color: layer.color.unwrap_or(GUIDE),
            };
            let points = place(part.positions(), stage);
            for range in part.runs().ranges() {
                for line in
                    cut.map_or_else(|| vec![points[range.clone()].to_vec()], |cut| cut.pieces(&points[range.clone()]))
                {
                    let (seed, start) = (scramble(self.strands.len() as u32), self.knots.len());
                    if line.len() > 1 {
                        self.knots.extend(line.into_iter().map(knot));
                        self.strands.push(Strand { knots: start..self.knots.len(), seed });
                    }
                }
            }
        }
    }

    fn mesh(&mut self, part: &Component, paint: &Paint, stage: &Stage) {
        let triangles = part.triangles();
        self.surface(&place(part.positions(), stage), &triangles.corners, &triangles.faces, paint);
    }

    fn volume(&mut self, volume: &Volume, color_by: Option<(&str, [f32; 2])>, plain: Vec3, stage: &Stage) {
        let surface = level_set::zero_level(volume);
        let by_speed = color_by.is_some_and(|(name, _)| name == SPEED);
        let speeds = by_speed.then(|| {
            let (mut sampler, grid) = (volume.sampler(), volume.level_grid());
            surface.cells.iter().map(|cell| level_set::speed(&mut sampler, &grid, *cell)).collect()
        });
        let triangles: Vec<_> = surface.quads.iter().flat_map(|[a, b, c, d]| [[*a, *b, *c], [*a, *c, *d]]).collect();
        let paint = Paint::of_speeds(speeds, color_by, plain);
        self.surface(&place(&surface.points, stage), &triangles, &vec![0; triangles.len()], &paint);
    }

    fn surface(&mut self, points: &[Vec3], triangles: &[[u32; 3]], elements: &[u32], paint: &Paint) {
        let normals = smooth::corner_normals(points, triangles);
        let drawn = |row: usize| {
            let corner = |k: usize| {
                let point = triangles[row][k] as usize;
                Corner { at: points[point], normal: normals[row][k], color: paint.at(point, elements[row] as usize) }
            };
            let triangle = [corner(0), corner(1), corner(2)];
            triangle.iter().all(|corner| finite(corner.at)).then_some(triangle)
        };
        let tasks = (0..triangles.len()).step_by(TASK).map(|first| first..triangles.len().min(first + TASK));
        let drawn = parallel::map(tasks, |_, rows| rows.filter_map(drawn).collect::<Vec<_>>());
        match self.cut {
            None => drawn.iter().for_each(|triangles| self.triangles.extend_from_slice(triangles)),
            Some(plane) => self.triangles.extend(plane.cut(drawn.concat())),
        }
    }

    /// Whether a curve with this root, or a point, is on the kept side of the cut.
    fn keeps(&self, at: Vec3) -> bool {
        self.cut.is_none_or(|plane| plane.keeps(at))
    }

    fn curves(&mut self, part: &Component, paint: &Paint, width: Option<f32>, stage: &Stage) {
        let widths = Widths::of(part, width, stage, CURVE_WIDTH);
        let points = place(part.positions(), stage);
        let is_plain = matches!(paint, Paint::Plain(_));
        for (curve, range) in part.runs().ranges().enumerate() {
            if points.get(range.start).is_none_or(|root| !self.keeps(*root)) {
                continue;
            }
            let seed = scramble(self.strands.len() as u32);
            let tint = if is_plain { 1.0 + STRAND_TINT * (fraction(seed) - 0.5) } else { 1.0 };
            let first = range.start;
            let last = range.len().max(2) as f32 - 1.0;
            let knot = |point: usize| {
                let along = (point - first) as f32 / last;
                let taper = if widths.is_default { 1.0 + (TIP - 1.0) * along } else { 1.0 };
                let shade = if is_plain { tint * (ROOT + (1.0 - ROOT) * along) } else { 1.0 };
                let ends = [point.max(first + 1) - 1, (point + 1).min(range.end - 1)];
                let chord = sub(points[ends[1]], points[ends[0]]);
                Knot {
                    at: points[point],
                    tangent: unit(chord).unwrap_or([0.0, 1.0, 0.0]),
                    radius: 0.5 * taper * widths.at(point, curve),
                    color: scale(paint.at(point, curve), shade),
                }
            };
            if range.len() == 1 {
                let Knot { at, radius, color, .. } = knot(first);
                self.dot(at, radius, color);
                continue;
            }
            let start = self.knots.len();
            self.knots.extend(range.clone().map(knot));
            self.strands.push(Strand { knots: start..self.knots.len(), seed });
        }
    }

    fn points(&mut self, part: &Component, paint: &Paint, width: Option<f32>, stage: &Stage) {
        let [least, most] = POINT_WIDTHS;
        let apart = libm::cbrtf(part.point_count().max(1) as f32);
        let widths = Widths::of(part, width, stage, (POINT_WIDTH / apart).clamp(least, most));
        for (point, at) in place(part.positions(), stage).into_iter().enumerate() {
            self.dot(at, 0.5 * widths.at(point, 0), paint.at(point, 0));
        }
    }

    fn dot(&mut self, at: Vec3, radius: f32, color: Vec3) {
        if finite(at) && self.keeps(at) {
            let seed = scramble(!(self.dots.len() as u32));
            self.dots.push(Dot { at, radius, color, lit: 1.0, seed });
        }
    }
}

/// Widths on the stage: the requested one, otherwise the attribute, otherwise a default.
struct Widths<'a> {
    asked: Option<f32>,
    rows: Option<(Owner, &'a [f32])>,
    default: f32,
    is_default: bool,
    stage: Stage,
}

impl<'a> Widths<'a> {
    fn of(part: &'a Component, asked: Option<f32>, stage: &Stage, default: f32) -> Self {
        let rows = Owner::ALL.into_iter().find_map(|owner| Some((owner, part.table(owner).get(WIDTH.name)?)));
        let asked = asked.map(|width| stage.length(width));
        Self { asked, rows, default, is_default: asked.is_none() && rows.is_none(), stage: *stage }
    }

    fn at(&self, point: usize, element: usize) -> f32 {
        match (self.asked, self.rows) {
            (Some(width), _) => width,
            (None, Some((Owner::Point, rows))) => self.stage.length(rows[point]),
            (None, Some((Owner::Element, rows))) => self.stage.length(rows[element]),
            (None, Some((Owner::Once, rows))) => self.stage.length(rows[0]),
            (None, None) => self.default,
        }
    }
}

fn place(points: &[Vec3], stage: &Stage) -> Vec<Vec3> {
    let mut placed = vec![[0.0; 3]; points.len()];
    parallel::fill(&mut placed, POINT_TASK, |point| stage.place(points[point]));
    placed
}

/// A hash of the bits (Wellons' lowbias32).
pub(crate) fn scramble(x: u32) -> u32 {
    let x = (x ^ x >> 16).wrapping_mul(0x7feb_352d);
    let x = (x ^ x >> 15).wrapping_mul(0x846c_a68b);
    x ^ x >> 16
}

/// 0…1 from bits.
fn fraction(bits: u32) -> f32 {
    (bits >> 8) as f32 / (1 << 24) as f32
}

#[cfg(test)]
mod tests {
    use super::*;
    use engine::geometry::{Geometry, Grid};

    fn scene(geometry: &Geometry) -> Scene {
        let stage = Stage::of([[-1.0; 3], [1.0; 3]]);
        Scene::of(&[Layer::new("one", geometry)], &PictureSettings::default(), [0.0, 1.0], &stage)
    }

    #[test]
    fn every_kind_of_component_is_drawn() {
        let corners = vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let grid = Grid { origin: [0.0; 3], cell: 0.5, size: [1; 3] };
        let mut geometry = Geometry::from(Component::curves(vec![3, 1], corners.clone()).unwrap())
            .with(Component::mesh(vec![4], vec![0, 1, 2, 3], corners.clone()).unwrap())
            .with(Component::points(corners.clone()))
            .with(Component::tets(vec![[0, 1, 2, 3]], corners).unwrap());
        geometry.put_volume(Volume::new(grid, vec![-0.1], [vec![0.0; 2], vec![0.0; 2], vec![0.0; 2]]).unwrap());
        let scene = scene(&geometry);
        assert_eq!(scene.triangles.len(), 2 + 4 + 12);
        assert_eq!((scene.strands.len(), scene.knots.len()), (1, 3));
        assert_eq!(scene.dots.len(), 1 + 4);
    }

    #[test]
    fn only_non_finite_elements_are_left_out() {
        let at = vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [f32::NAN, 0.0, 0.0]];
        let mesh: Geometry = Component::mesh(vec![3, 3], vec![0, 1, 2, 1, 2, 3], at.clone()).unwrap().into();
        assert_eq!(scene(&mesh).triangles.len(), 1);
        let points: Geometry = Component::points(at).into();
        assert_eq!(scene(&points).dots.len(), 3);
        assert_eq!(bounds(&[Layer::new("one", &points)]), Some([[0.0; 3], [1.0, 1.0, 0.0]]));
    }

    #[test]
    fn bounds_of_a_volume_are_those_of_its_liquid() {
        let grid = Grid { origin: [0.0; 3], cell: 0.5, size: [2, 1, 1] };
        let mut geometry = Geometry::default();
        geometry.put_volume(Volume::new(grid, vec![0.1, -0.1], [vec![0.0; 3], vec![0.0; 4], vec![0.0; 4]]).unwrap());
        assert_eq!(bounds(&[Layer::new("one", &geometry)]), Some([[0.5, 0.0, 0.0], [1.0, 0.5, 0.5]]));
        assert_eq!(bounds(&[]), None);
    }

    #[test]
    fn a_width_is_the_requested_one_or_the_attribute_or_the_default() {
        let mut part = Component::curves(vec![2], vec![[0.0; 3], [0.0, 1.0, 0.0]]).unwrap();
        let stage = Stage::of([[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0]]);
        assert_eq!(Widths::of(&part, None, &stage, 0.25).at(0, 0), 0.25);
        part.set(WIDTH, vec![0.5, f32::NAN]).unwrap();
        assert_eq!(Widths::of(&part, None, &stage, 0.25).at(0, 0), 0.5);
        assert_eq!(Widths::of(&part, None, &stage, 0.25).at(1, 0), 0.0);
        assert_eq!(Widths::of(&part, Some(0.75), &stage, 0.25).at(1, 0), 0.75);
    }
}
