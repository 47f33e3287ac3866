//! Winding numbers of any triangles, closed or not, around any point: the solid angle they subtend ÷ 4π (generalised
//! winding numbers, Jacobson et al. 2013). 1 inside a closed surface and 0 outside; in between near a hole, as if it
//! were closed by a smooth sheet on which the number is ½.
//!
//! Distant triangles count as one dipole (Barill et al. 2018, first order), which is exact to about 0.01. Sums have a
//! fixed order.

use numerics::vector::{DVec3, Vec3, to_f64};
use std::f64::consts::PI;

/// A group of triangles counts as a dipole from this many times its radius.
const FAR: f64 = 3.0;

/// Most triangles in a leaf.
const LEAF: usize = 8;

/// Triangles in a hierarchy of dipoles.
pub(crate) struct SolidAngles {
    /// Corners, in the order of the leaves.
    triangles: Vec<[DVec3; 3]>,
    /// Nodes in depth-first order.
    nodes: Vec<Dipole>,
}

/// A node of the hierarchy.
struct Dipole {
    /// Mean of the centroids, weighted by area.
    centre: DVec3,
    /// Distance of the farthest corner from it.
    radius: f64,
    /// Sum of the areas times the normals.
    moment: DVec3,
    first: u32,
    last: u32,
    /// The node after its descendants.
    skip: u32,
}

impl SolidAngles {
    /// Of `triangles` over `points`.
    pub(crate) fn new(points: &[Vec3], triangles: &[[u32; 3]]) -> Self {
        let corners = |triangle: &[u32; 3]| triangle.map(|corner| to_f64(points[corner as usize]));
        let mut new = Self { triangles: triangles.iter().map(corners).collect(), nodes: Vec::new() };
        if !triangles.is_empty() {
            new.node(0, triangles.len());
        }
        new
    }

    /// Adds the node of a range of triangles, and its descendants.
    fn node(&mut self, first: usize, last: usize) {
        let own = &self.triangles[first..last];
        let (mut centre, mut weight, mut moment) = (DVec3::zeros(), 0.0, DVec3::zeros());
        let (mut low, mut high) = (DVec3::repeat(f64::INFINITY), DVec3::repeat(f64::NEG_INFINITY));
        for [a, b, c] in own {
            let normal = (b - a).cross(&(c - a)) * 0.5;
            let (area, middle) = (normal.norm(), (a + b + c) / 3.0);
            centre += middle * area;
            weight += area;
            moment += normal;
            (low, high) = (low.inf(&middle), high.sup(&middle));
        }
        let centre = if weight > 0.0 { centre / weight } else { (low + high) * 0.5 };
        let radius = own.iter().flatten().map(|corner| (corner - centre).norm()).fold(0.0, f64::max);
        let index = self.nodes.len();
        self.nodes.push(Dipole { centre, radius, moment, first: first as u32, last: last as u32, skip: 0 });
        let axis = (high - low).imax();
        if last - first > LEAF {
            let middle = (last - first) / 2;
            let key = |[a, b, c]: &[DVec3; 3]| a[axis] + b[axis] + c[axis];
            self.triangles[first..last].sort_by(|a, b| key(a).total_cmp(&key(b)));
            self.node(first, first + middle);
            self.node(first + middle, last);
        }
        self.nodes[index].skip = self.nodes.len() as u32;
    }

    /// The winding number around a point.
    pub(crate) fn winding(&self, p: DVec3) -> f64 {
        let (mut sum, mut at) = (0.0, 0);
        while let Some(node) = self.nodes.get(at) {
            let to = node.centre - p;
            let squared = to.norm_squared();
            if squared > FAR * FAR * node.radius * node.radius && squared > 0.0 {
                sum += node.moment.dot(&to) / (squared * squared.sqrt());
                at = node.skip as usize;
            } else if at + 1 == node.skip as usize {
                let own = &self.triangles[node.first as usize..node.last as usize];
                sum += own.iter().map(|triangle| solid_angle(triangle, p)).sum::<f64>();
                at += 1;
            } else {
                at += 1;
            }
        }
        sum / (4.0 * PI)
    }
}

/// The solid angle of a triangle seen from a point, positive from behind (van Oosterom & Strackee 1983).
fn solid_angle(triangle: &[DVec3; 3], p: DVec3) -> f64 {
    let [a, b, c] = triangle.map(|corner| corner - p);
    let [la, lb, lc] = [a, b, c].map(|v| v.norm());
    let over = a.dot(&b.cross(&c));
    let under = la * lb * lc + a.dot(&b) * lc + b.dot(&c) * la + c.dot(&a) * lb;
    if over == 0.0 { 0.0 } else { 2.0 * libm::atan2(over, under) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use numerics::shapes;

    fn of(shape: &shapes::Polygons) -> SolidAngles {
        let points: Vec<Vec3> = shape.points.iter().map(|p| p.map(|x| x as f32)).collect();
        SolidAngles::new(&points, &shape.triangles())
    }

    #[test]
    fn an_octant_is_an_eighth_of_the_sphere() {
        let triangle = [DVec3::x(), DVec3::y(), DVec3::z()];
        assert!((solid_angle(&triangle, DVec3::zeros()) - 0.5 * PI).abs() < 1e-15);
        assert_eq!(solid_angle(&triangle, DVec3::new(0.5, 0.5, 0.0)), 0.0, "on a side it is not defined: 0");
    }

    #[test]
    fn a_closed_surface_has_1_inside_and_0_outside() {
        let ball = of(&shapes::sphere([2.0; 3], 12));
        for (radius, expected) in [(0.0, 1.0), (0.5, 1.0), (0.97, 1.0), (1.03, 0.0), (1.5, 0.0), (40.0, 0.0)] {
            for direction in
                [DVec3::x(), DVec3::new(0.3, -0.5, 0.7).normalize(), DVec3::new(-1.0, 0.1, 0.0).normalize()]
            {
                let found = ball.winding(direction * radius);
                assert!((found - expected).abs() < 0.02, "{found} at {radius}");
            }
        }
    }

    #[test]
    fn half_a_sphere_has_a_half_at_its_centre() {
        let mut ball = shapes::icosphere(1.0, 4);
        let below =
            |k: usize| ball.corners[3 * k..3 * k + 3].iter().all(|corner| ball.points[*corner as usize][1] <= 1e-9);
        let kept: Vec<u32> = (0..ball.counts.len())
            .filter(|k| below(*k))
            .flat_map(|k| ball.corners[3 * k..3 * k + 3].to_vec())
            .collect();
        ball.counts.truncate(kept.len() / 3);
        ball.corners = kept;
        let bowl = of(&ball);
        assert!((bowl.winding(DVec3::zeros()) - 0.5).abs() < 0.02, "{}", bowl.winding(DVec3::zeros()));
        assert!(bowl.winding(DVec3::new(0.0, -0.5, 0.0)) > 0.7 && bowl.winding(DVec3::new(0.0, 0.5, 0.0)) < 0.3);
    }

    #[test]
    fn crossing_surfaces_add_up() {
        let ball = shapes::sphere([2.0; 3], 8);
        let mut both = ball.clone();
        both.points.extend(ball.points.iter().map(|p| [p[0] + 1.0, p[1], p[2]]));
        both.counts.extend(&ball.counts);
        both.corners.extend(ball.corners.iter().map(|corner| corner + ball.points.len() as u32));
        let both = of(&both);
        for (x, expected) in [(-0.5, 1.0), (0.5, 2.0), (1.5, 1.0), (2.5, 0.0)] {
            let found = both.winding(DVec3::new(x, 0.05, 0.02));
            assert!((found - expected).abs() < 0.03, "{found} at {x}");
        }
    }
}
