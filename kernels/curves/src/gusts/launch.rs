//! Where gusts start: a rectangle across the wind, upwind of everything.

/// A rectangle perpendicular to the wind.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plane {
    middle: [f64; 3],
    /// From its middle to its side, and to its upper edge.
    half: [[f64; 3]; 2],
}

/// Cosine to the vertical beyond which a wind has no upward side of its own.
const VERTICAL: f64 = 0.999;

impl Plane {
    /// The rectangle `distance` upwind of a box, `area` wide and high; an extent of 0 is the box's own
    /// as seen along the wind. `wind` has length 1. Its first side is level, its second as upright as
    /// can be; under a wind straight up or down they are z and x.
    pub fn new([low, high]: [[f32; 3]; 2], wind: [f64; 3], distance: f64, area: [f64; 2]) -> Self {
        let low = low.map(f64::from);
        let high = high.map(f64::from);
        let centre: [f64; 3] = std::array::from_fn(|k| 0.5 * low[k] + 0.5 * high[k]);
        let half: [f64; 3] = std::array::from_fn(|k| 0.5 * high[k] - 0.5 * low[k]);
        let extent = |way: [f64; 3]| (0..3).map(|k| way[k].abs() * half[k]).sum::<f64>();
        let across = unit(cross(if wind[1].abs() < VERTICAL { [0.0, 1.0, 0.0] } else { [1.0, 0.0, 0.0] }, wind));
        let up = cross(wind, across);
        let back = extent(wind) + distance;
        let side = |way: [f64; 3], wanted: f64| {
            let size = if wanted > 0.0 { 0.5 * wanted } else { extent(way) };
            way.map(|x| x * size)
        };
        Self {
            middle: std::array::from_fn(|k| centre[k] - back * wind[k]),
            half: [side(across, area[0]), side(up, area[1])],
        }
    }

    /// The point at `place`, −1..1 each way.
    pub fn at(&self, place: [f64; 2]) -> [f64; 3] {
        std::array::from_fn(|k| self.middle[k] + place[0] * self.half[0][k] + place[1] * self.half[1][k])
    }
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn unit(v: [f64; 3]) -> [f64; 3] {
    let length = (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]).sqrt();
    v.map(|x| x / length)
}
