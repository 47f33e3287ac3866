//! A plane that cuts the picture open: what lies beyond it is left out, and closed surfaces get a flat cut face.
//!
//! Guarantees: a cut face has the colours of the surface around it, without light, so that it cannot be taken for a
//! surface; the same bits for the same triangles. Surfaces that overlap have one face where either is (winding ≠ 0).
//! Limit: an open surface has no inside and gets no face; the face's outline is exact to `GRID` of the scene's half
//! diagonal; a cut of more than `MOST_CROSSINGS` stays open.

use std::str::FromStr;

use crate::scene::Corner;
use crate::vector::mix;
use crate::view::Stage;

/// Lines of the cut face lie on multiples of this, stage units.
const GRID: f32 = 1.0 / 4096.0;
/// Outlines crossed by all lines of a cut face together: bounds its work.
const MOST_CROSSINGS: usize = 4_000_000;

/// A plane across an axis. The side with larger coordinates, which faces the default camera, is left out.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Clip {
    /// 0, 1 or 2: x, y or z.
    pub axis: usize,
    /// Position of the plane, metres.
    pub value: f32,
}

impl Clip {
    /// The closest point on the kept side.
    pub(crate) fn nearest_kept(self, mut p: [f32; 3]) -> [f32; 3] {
        p[self.axis] = p[self.axis].min(self.value);
        p
    }

    /// The plane on the stage.
    pub(crate) fn on(self, stage: &Stage) -> Plane {
        let mut at = [0.0; 3];
        at[self.axis] = self.value;
        Plane { axis: self.axis, at: stage.place(at)[self.axis] }
    }
}

/// Reads `x=0`, `y=-0.2`.
impl FromStr for Clip {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = || format!("`{text}` is not a plane, expected an axis and a position in metres like `x=0`");
        let (axis, value) = text.split_once('=').ok_or_else(wrong)?;
        let axis = ["x", "y", "z"].iter().position(|name| *name == axis.trim()).ok_or_else(wrong)?;
        let value = value.trim().parse::<f32>().ok().filter(|value| value.is_finite()).ok_or_else(wrong)?;
        Ok(Self { axis, value })
    }
}

/// A clip plane in stage units.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Plane {
    axis: usize,
    at: f32,
}

/// A crossing of a triangle and the plane, with the inside to its left; positions are the two other axes.
#[derive(Clone, Copy, Debug)]
struct Cut {
    from: [f32; 2],
    to: [f32; 2],
    colors: [[f32; 3]; 2],
}

impl Plane {
    pub(crate) fn keeps(self, p: [f32; 3]) -> bool {
        p[self.axis] <= self.at
    }

    /// The kept pieces of a line.
    pub(crate) fn pieces(self, line: &[[f32; 3]]) -> Vec<Vec<[f32; 3]>> {
        let mut pieces = vec![Vec::new()];
        for (k, at) in line.iter().enumerate() {
            let is_kept = self.keeps(*at);
            let before = k.checked_sub(1).map(|before| line[before]);
            let crossing = before.filter(|before| self.keeps(*before) != is_kept).map(|before| {
                let t = (self.at - before[self.axis]) / (at[self.axis] - before[self.axis]);
                let mut crossing = mix(before, *at, t.clamp(0.0, 1.0));
                crossing[self.axis] = self.at;
                crossing
            });
            if is_kept && crossing.is_some() {
                pieces.push(Vec::new());
            }
            if let Some(piece) = pieces.last_mut() {
                piece.extend(crossing.into_iter().chain(is_kept.then_some(*at)));
            }
        }
        pieces
    }

    /// The kept part of a surface's triangles, and its cut faces.
    pub(crate) fn cut(self, triangles: Vec<[Corner; 3]>) -> Vec<[Corner; 3]> {
        let mut kept = Vec::with_capacity(triangles.len());
        let mut cuts = Vec::new();
        for triangle in triangles {
            match triangle.map(|corner| self.keeps(corner.at)) {
                [true, true, true] => kept.push(triangle),
                [false, false, false] => {}
                inside => self.divide(&triangle, inside, &mut kept, &mut cuts),
            }
        }
        self.close(&cuts, &mut kept);
        kept
    }

    /// The kept part of a triangle that crosses the plane, one or two triangles.
    fn divide(self, triangle: &[Corner; 3], inside: [bool; 3], kept: &mut Vec<[Corner; 3]>, cuts: &mut Vec<Cut>) {
        let mut corners = Vec::with_capacity(4);
        let (mut leaves, mut enters) = (None, None);
        for k in 0..3 {
            let (a, b) = (triangle[k], triangle[(k + 1) % 3]);
            if inside[k] {
                corners.push(a);
            }
            if inside[k] != inside[(k + 1) % 3] {
                let crossing = self.crossing(&a, &b);
                corners.push(crossing);
                *(if inside[k] { &mut leaves } else { &mut enters }) = Some(crossing);
            }
        }
        kept.extend((2..corners.len()).map(|k| [corners[0], corners[k - 1], corners[k]]));
        if let (Some(leaves), Some(enters)) = (leaves, enters) {
            let flat = |corner: &Corner| {
                [(self.axis + 1) % 3, (self.axis + 2) % 3].map(|axis| (corner.at[axis] / GRID).round() * GRID)
            };
            let colors = [leaves.color, enters.color];
            cuts.push(Cut { from: flat(&leaves), to: flat(&enters), colors });
        }
    }

    /// Where an edge meets the plane: the same bits for both triangles that share it.
    fn crossing(self, a: &Corner, b: &Corner) -> Corner {
        let (a, b) = if self.keeps(a.at) { (a, b) } else { (b, a) };
        let t = ((self.at - a.at[self.axis]) / (b.at[self.axis] - a.at[self.axis])).clamp(0.0, 1.0);
        let mut at = mix(a.at, b.at, t);
        at[self.axis] = self.at;
        Corner { at, normal: mix(a.normal, b.normal, t), color: mix(a.color, b.color, t) }
    }

    /// Adds the cut faces: between neighbouring lines on which outlines begin or end, the trapezoids inside.
    fn close(self, cuts: &[Cut], kept: &mut Vec<[Corner; 3]>) {
        let mut cuts: Vec<Cut> = cuts.iter().copied().filter(|cut| cut.from[1] != cut.to[1]).collect();
        cuts.sort_by(|a, b| a.low().total_cmp(&b.low()));
        let mut lines: Vec<f32> = cuts.iter().flat_map(|cut| [cut.from[1], cut.to[1]]).collect();
        lines.sort_by(f32::total_cmp);
        lines.dedup();
        let (mut next, mut crossed, mut faces) = (0, 0, Vec::new());
        let mut active: Vec<Cut> = Vec::new();
        for line in lines.windows(2) {
            let [low, high] = [line[0], line[1]];
            active.retain(|cut| cut.high() >= high);
            while next < cuts.len() && cuts[next].low() <= low {
                active.push(cuts[next]);
                next += 1;
            }
            crossed += active.len();
            if crossed > MOST_CROSSINGS {
                return;
            }
            let middle = 0.5 * (low + high);
            active.sort_by(|a, b| a.at(middle).0.total_cmp(&b.at(middle).0));
            if active.iter().map(|cut| cut.turn()).sum::<i32>() == 0 {
                self.trapezoids(&active, [low, high], &mut faces);
            }
        }
        kept.extend(faces);
    }

    /// The inside between two lines, from the outlines that cross them from left to right.
    fn trapezoids(self, across: &[Cut], [low, high]: [f32; 2], faces: &mut Vec<[Corner; 3]>) {
        let corner = |cut: &Cut, line: f32| {
            let (u, color) = cut.at(line);
            let mut at = [self.at; 3];
            (at[(self.axis + 1) % 3], at[(self.axis + 2) % 3]) = (u, line);
            Corner { at, normal: Corner::UNLIT, color }
        };
        let (mut winding, mut left) = (0, None);
        for cut in across {
            let before = winding;
            winding += cut.turn();
            match left {
                None if before == 0 => left = Some(cut),
                Some(from) if winding == 0 => {
                    let quad = [corner(from, low), corner(cut, low), corner(cut, high), corner(from, high)];
                    faces.extend([[quad[0], quad[1], quad[2]], [quad[0], quad[2], quad[3]]]);
                    left = None;
                }
                _ => {}
            }
        }
    }
}

impl Cut {
    fn low(&self) -> f32 {
        self.from[1].min(self.to[1])
    }

    fn high(&self) -> f32 {
        self.from[1].max(self.to[1])
    }

    fn turn(&self) -> i32 {
        if self.to[1] > self.from[1] { 1 } else { -1 }
    }

    /// Position and colour on a line that it crosses.
    fn at(&self, line: f32) -> (f32, [f32; 3]) {
        let t = ((line - self.from[1]) / (self.to[1] - self.from[1])).clamp(0.0, 1.0);
        (self.from[0] * (1.0 - t) + self.to[0] * t, mix(self.colors[0], self.colors[1], t))
    }
}

#[cfg(test)]
mod tests;
