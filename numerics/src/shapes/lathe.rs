//! Solids of revolution: a profile rotated about the y axis.
//!
//! Outside is on the right of a profile. Poles are single points with triangles around them; all other faces are quads. Promise and limit: see [`super`].

use super::{Polygons, coordinate};

/// One point of a profile: its distances from the axis along x and z, and its height.
#[derive(Clone, Copy)]
struct Row {
    x: f64,
    y: f64,
    z: f64,
}

/// How a profile ends.
#[derive(Clone, Copy, PartialEq)]
enum Ends {
    /// On the axis: the first and the last row are single points.
    Poles,
    /// Closed: the last row is joined to the first.
    Loop,
}

/// An ellipsoid; `n` quads from a pole to the equator.
pub fn sphere(size: [f64; 3], n: usize) -> Polygons {
    let [a, b, c] = halves(size);
    let quarter = quarter(n);
    let lower = quarter.iter().map(|[cos, sin]| Row { x: a * sin, y: 0.0 - b * cos, z: c * sin });
    let upper = quarter.iter().rev().skip(1).map(|[cos, sin]| Row { x: a * sin, y: b * cos, z: c * sin });
    turned(&lower.chain(upper).collect::<Vec<_>>(), Ends::Poles, n)
}

/// An upright cylinder; `n` rings of quads up its side and across each lid.
pub fn cylinder(size: [f64; 3], n: usize) -> Polygons {
    let [a, b, c] = halves(size);
    let share = |k: usize| k as f64 / n as f64;
    let mut rows: Vec<Row> = (0..n).map(|k| Row { x: a * share(k), y: 0.0 - b, z: c * share(k) }).collect();
    rows.extend((0..=n).map(|k| Row { x: a, y: coordinate(size[1], k, n), z: c }));
    rows.extend((0..n).rev().map(|k| Row { x: a * share(k), y: b, z: c * share(k) }));
    turned(&rows, Ends::Poles, n)
}

/// An upright cylinder between two domes. A dome is as high as the narrower half width, at most half the height; where
/// nothing is left between them, this is a [`sphere`].
pub fn capsule(size: [f64; 3], n: usize) -> Polygons {
    let [a, b, c] = halves(size);
    let dome = a.min(b).min(c);
    let straight = b - dome;
    if straight <= 0.0 {
        return sphere(size, n);
    }
    let quarter = quarter(n);
    // The outermost rows are exactly at `b`: `straight + dome` may round.
    let height = |cos: f64| if cos == 1.0 { b } else { straight + dome * cos };
    let lower = quarter.iter().map(|[cos, sin]| Row { x: a * sin, y: 0.0 - height(*cos), z: c * sin });
    let side = (1..n).map(|k| Row { x: a, y: coordinate(2.0 * straight, k, n), z: c });
    let upper = quarter.iter().rev().map(|[cos, sin]| Row { x: a * sin, y: height(*cos), z: c * sin });
    turned(&lower.chain(side).chain(upper).collect::<Vec<_>>(), Ends::Poles, n)
}

/// A ring lying flat. Its tube is round while the height is at most a third of the narrower width, else an upright oval
/// a third of it wide; ⌈n/2⌉ quads go a quarter round the tube.
pub fn torus(size: [f64; 3], n: usize) -> Polygons {
    let [a, b, c] = halves(size);
    let wide = b.min(a.min(c) / 3.0);
    let rows = around(n.div_ceil(2)).map(|[cos, sin]| {
        // Written from the outside inwards, so that the outermost row is at `a` and `c` exactly.
        let inwards = wide * (1.0 - cos);
        Row { x: a - inwards, y: b * sin, z: c - inwards }
    });
    turned(&rows.collect::<Vec<_>>(), Ends::Loop, n)
}

/// The lower half of a hollow ellipsoid as high as `size[1]`, open at the top: outside, a flat rim `thickness` wide, and
/// inside. `None` where `thickness` leaves no hollow, or is not positive.
pub fn bowl(size: [f64; 3], thickness: f64, n: usize) -> Option<Polygons> {
    let [a, top, c] = halves(size);
    let depth = size[1];
    if !(thickness > 0.0 && thickness < a.min(c).min(depth)) {
        return None;
    }
    let quarter = quarter(n);
    let shell = |less: f64| {
        let row = move |[cos, sin]: &[f64; 2]| Row {
            x: (a - less) * sin,
            y: if *cos == 1.0 { less - top } else { top - (depth - less) * cos },
            z: (c - less) * sin,
        };
        quarter.iter().map(row)
    };
    let rows: Vec<Row> = shell(0.0).chain(shell(thickness).rev()).collect();
    Some(turned(&rows, Ends::Poles, n))
}

/// A profile once round the axis, `n` quads a quarter.
fn turned(profile: &[Row], ends: Ends, n: usize) -> Polygons {
    let mut polygons = Polygons::default();
    let round: Vec<[f64; 2]> = around(n).collect();
    let last = profile.len() - 1;
    let rings: Vec<Vec<usize>> = profile
        .iter()
        .enumerate()
        .map(|(k, row)| {
            let first = polygons.points.len();
            if ends == Ends::Poles && (k == 0 || k == last) {
                polygons.points.push([0.0, row.y, 0.0]);
                return vec![first];
            }
            // Counter-clockwise from above: from +x towards −z.
            polygons.points.extend(round.iter().map(|[cos, sin]| [row.x * cos, row.y, 0.0 - row.z * sin]));
            (first..polygons.points.len()).collect()
        })
        .collect();

    let bands = if ends == Ends::Loop { profile.len() } else { last };
    for band in 0..bands {
        let (low, high) = (&rings[band], &rings[(band + 1) % profile.len()]);
        for k in 0..round.len() {
            let next = (k + 1) % round.len();
            match (low.len(), high.len()) {
                (1, _) => polygons.face([low[0], high[next], high[k]]),
                (_, 1) => polygons.face([low[k], low[next], high[0]]),
                _ => polygons.face([low[k], low[next], high[next], high[k]]),
            }
        }
    }
    polygons
}

fn halves(size: [f64; 3]) -> [f64; 3] {
    size.map(|x| 0.5 * x)
}

/// Cosine and sine from 0 to a quarter turn in `n` steps, exact at both ends, and each the reverse of the other.
fn quarter(n: usize) -> Vec<[f64; 2]> {
    let sine = |k: usize| match k {
        0 => 0.0,
        k if k == n => 1.0,
        k => libm::sin(std::f64::consts::FRAC_PI_2 * k as f64 / n as f64),
    };
    (0..=n).map(|k| [sine(n - k), sine(k)]).collect()
}

/// Cosine and sine of a full turn, `n` steps a quarter, without the end, which equals the start.
fn around(n: usize) -> impl Iterator<Item = [f64; 2]> {
    let quarter = quarter(n);
    (0..4 * n).map(move |step| {
        let [cos, sin] = quarter[step % n];
        // Negation is written `0.0 - x`, which is 0 rather than −0 where x is 0.
        match step / n {
            0 => [cos, sin],
            1 => [0.0 - sin, cos],
            2 => [0.0 - cos, 0.0 - sin],
            _ => [sin, 0.0 - cos],
        }
    })
}
