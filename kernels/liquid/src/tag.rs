//! Values of scattered points, such as texture coordinates, at the points of a surface.
//!
//! Moving least squares: the linear function that fits the values around a place best, with the weight (1 − r²/R²)² ·
//! (n·N)², where r is the distance, R the radius and n·N the cosine between both normals, 0 beyond 90°. A linear function
//! is reproduced, even beside the rim of the points; a sheet thinner than R takes the values of its own side.
//!
//! Promise: a value changes continuously where points move, come and go, as all that it is made of has a weight that falls
//! to 0 at R: where few points are near, a constant ridge turns the fit into their weighted mean, and the fit stays within
//! two standard deviations of that mean. Values are never outside the range of all points'. The bits are the same on any
//! number of threads.

use numerics::parallel;
use numerics::point_tree::{FoundPoint, PointTree};
use numerics::vector::{DMat3, DVec3, Vec3, dot, to_f64, unit};

/// The point whose distance from another is the radius that suits the spacing: a disk of two spacings has so many.
const NEIGHBOURS: usize = 12;
/// Points whose spacing is measured, at most.
const MEASURED: usize = 2048;
/// Square of the distance, in radii, below which the scatter of the points along an axis does not determine a slope.
const RIDGE: f64 = 1e-3;
/// How far a fit may be from the weighted mean, in standard deviations. A linear function beside a straight rim is 1.5 off.
const DEVIATIONS: f64 = 2.0;
/// Places that one thread goes through at a time.
const CHUNK: usize = 256;

/// Points that values are taken from.
#[derive(Debug)]
pub struct TagSource<'a> {
    tree: PointTree,
    points: &'a [Vec3],
    /// Unit normals; 0 where a point belongs to all sides.
    normals: Vec<Vec3>,
}

/// One attribute of the points: `width` numbers each.
#[derive(Clone, Copy, Debug)]
pub struct TagValues<'a> {
    /// The numbers, point by point.
    pub rows: &'a [f32],
    /// Numbers of a point.
    pub width: usize,
}

/// Values at the places asked for.
#[derive(Clone, Debug, PartialEq)]
pub struct TaggedPlaces {
    /// For each attribute its numbers, place by place; 0 where there are no points at all.
    pub rows: Vec<Vec<f32>>,
    /// Places with no point of their side within the radius, which have the values of the nearest.
    pub far: usize,
}

/// A point that contributes to a place.
#[derive(Clone, Copy)]
struct Contribution {
    number: u32,
    /// Share in the weighted mean.
    weight: f64,
    /// Share in the fit.
    fit: f64,
}

impl<'a> TagSource<'a> {
    /// Finite points, with normals of any length if they have sides; a normal of 0 belongs to all sides.
    pub fn new(points: &'a [Vec3], normals: Option<&[Vec3]>) -> Self {
        let normals = normals.map_or_else(Vec::new, |normals| normals.iter().map(|n| side(*n)).collect());
        Self { tree: PointTree::new(points), points, normals }
    }

    /// A radius that suits the spacing of the points: the median distance to the twelfth nearest other, about two spacings
    /// of points on a surface. 0 where most of them coincide, or there is only one.
    pub fn suitable_radius(&self) -> f64 {
        let (count, others) = (self.points.len(), NEIGHBOURS.min(self.points.len().saturating_sub(1)));
        let measured = count.min(MEASURED);
        let distance = |near: &mut Vec<FoundPoint>, n: usize| {
            self.tree.nearest(self.points[n * count / measured], others + 1, near);
            near.last().map_or(0.0, |last| last.square.sqrt())
        };
        let mut distances = parallel::tabulate_with(measured, CHUNK, Vec::new, distance);
        distances.sort_unstable_by(f64::total_cmp);
        distances.get(measured / 2).copied().unwrap_or(0.0)
    }

    /// The values at places, whose normals have any length. `radius`: beyond it points do not count.
    pub fn tag(
        &self,
        places: &[Vec3],
        normals: Option<&[Vec3]>,
        radius: f64,
        attributes: &[TagValues<'_>],
    ) -> TaggedPlaces {
        let ranges: Vec<Vec<[f32; 2]>> = attributes.iter().map(ranges).collect();
        let width = attributes.iter().map(|attribute| attribute.width).sum::<usize>();
        let chunks = parallel::map(places.chunks(CHUNK), |n, places| {
            let (mut near, mut used) = (Vec::new(), Vec::new());
            let (mut rows, mut far) = (Vec::with_capacity(width * places.len()), 0);
            for (k, place) in places.iter().enumerate() {
                let facing = normals.map_or([0.0; 3], |normals| side(normals[n * CHUNK + k]));
                if !self.contributions(*place, facing, radius, &mut used) {
                    far += 1;
                    used.extend(self.nearest(*place, facing, &mut near));
                }
                for (attribute, ranges) in attributes.iter().zip(&ranges) {
                    rows.extend((0..attribute.width).map(|lane| attribute.at(&used, lane, ranges)));
                }
            }
            (rows, far)
        });
        let mut first = 0;
        let rows = attributes.iter().map(|attribute| {
            let own = first..first + attribute.width;
            first = own.end;
            let of_place = |row: &'_ [f32]| row[own.clone()].to_vec();
            chunks.iter().flat_map(|(rows, _)| rows.chunks_exact(width.max(1)).flat_map(of_place)).collect()
        });
        TaggedPlaces { rows: rows.collect(), far: chunks.iter().map(|(_, far)| far).sum() }
    }

    /// The points that contribute to a place; whether there are any.
    fn contributions(&self, place: Vec3, normal: Vec3, radius: f64, used: &mut Vec<Contribution>) -> bool {
        used.clear();
        if radius <= 0.0 {
            return false;
        }
        self.tree.within(place, radius, |found| {
            let near = 1.0 - found.square / (radius * radius);
            let facing = f64::from(self.facing(found.number, normal));
            let weight = near * near * facing * facing;
            if weight > 0.0 {
                used.push(Contribution { number: found.number, weight, fit: 0.0 });
            }
        });
        let sum = used.iter().fold(0.0, |sum, point| sum + point.weight);
        if sum <= 0.0 {
            used.clear();
            return false;
        }
        used.iter_mut().for_each(|point| point.weight /= sum);
        let off = |point: &Contribution| (to_f64(self.points[point.number as usize]) - to_f64(place)) / radius;
        let centre = used.iter().fold(DVec3::zeros(), |centre, point| centre + off(point) * point.weight);
        let mut scatter = DMat3::identity() * RIDGE;
        for point in used.iter() {
            let from_centre = off(point) - centre;
            scatter += from_centre * from_centre.transpose() * point.weight;
        }
        let slope = scatter.try_inverse().map_or(DVec3::zeros(), |inverse| inverse * centre);
        for point in used.iter_mut() {
            let share = 1.0 - (off(point) - centre).dot(&slope);
            point.fit = point.weight * share;
        }
        true
    }

    /// The nearest point of a side, if it is among the twelve nearest; else the nearest of all.
    fn nearest(&self, place: Vec3, normal: Vec3, near: &mut Vec<FoundPoint>) -> Option<Contribution> {
        self.tree.nearest(place, if normal == [0.0; 3] { 1 } else { NEIGHBOURS }, near);
        let of_side = near.iter().find(|found| self.facing(found.number, normal) > 0.0);
        let found = of_side.or(near.first())?;
        Some(Contribution { number: found.number, weight: 1.0, fit: 1.0 })
    }

    /// The cosine between a normal and that of a point, at least 0; 1 where one of them has none.
    fn facing(&self, number: u32, normal: Vec3) -> f32 {
        match self.normals.get(number as usize) {
            Some(own) if *own != [0.0; 3] && normal != [0.0; 3] => dot(*own, normal).clamp(0.0, 1.0),
            _ => 1.0,
        }
    }
}

impl TagValues<'_> {
    fn value(&self, number: u32, lane: usize) -> f64 {
        f64::from(self.rows[number as usize * self.width + lane])
    }

    /// One of its numbers at a place.
    fn at(&self, used: &[Contribution], lane: usize, ranges: &[[f32; 2]]) -> f32 {
        let values = || used.iter().map(|point| (self.value(point.number, lane), point));
        if let [only] = used {
            return self.value(only.number, lane) as f32;
        }
        let mean = values().fold(0.0, |sum, (value, point)| sum + point.weight * value);
        let fit = values().fold(0.0, |sum, (value, point)| sum + point.fit * value);
        let square = values().fold(0.0, |sum, (value, point)| sum + point.weight * (value - mean) * (value - mean));
        let off = DEVIATIONS * square.sqrt();
        let [least, most] = ranges[lane];
        ((mean + (fit - mean).clamp(-off, off)) as f32).clamp(least, most)
    }
}

/// The least and the largest of each number of an attribute; 0 to 0 where there are no points.
fn ranges(attribute: &TagValues<'_>) -> Vec<[f32; 2]> {
    let mut rows = attribute.rows.chunks_exact(attribute.width.max(1));
    let Some(first) = rows.next() else { return vec![[0.0; 2]; attribute.width] };
    let mut ranges: Vec<[f32; 2]> = first.iter().map(|x| [*x; 2]).collect();
    for row in rows {
        for (range, x) in ranges.iter_mut().zip(row) {
            *range = [range[0].min(*x), range[1].max(*x)];
        }
    }
    ranges
}

/// The direction of a normal; 0 where it has none.
fn side(normal: Vec3) -> Vec3 {
    unit(normal).unwrap_or([0.0; 3])
}

#[cfg(test)]
mod tests;
