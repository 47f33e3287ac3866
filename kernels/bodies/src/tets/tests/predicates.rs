//! Predicates against arbitrary-precision integers.

use super::super::grid::{GridPoint, SIDE};
use super::super::predicates::{in_sphere, orient};
use super::{at, random};
use numerics::random::Key;
use numerics::vector::DVec3;

/// An arbitrary-precision integer: sign, and digits of 32 bits, lowest first.
#[derive(Clone, Debug, PartialEq)]
struct Big(bool, Vec<u32>);

impl Big {
    fn of(x: i64) -> Self {
        Self(x < 0, vec![x.unsigned_abs() as u32, (x.unsigned_abs() >> 32) as u32]).trimmed()
    }

    fn trimmed(mut self) -> Self {
        while self.1.last() == Some(&0) {
            self.1.pop();
        }
        self.0 &= !self.1.is_empty();
        self
    }

    fn sign(&self) -> i32 {
        if self.1.is_empty() { 0 } else { 1 - 2 * i32::from(self.0) }
    }

    fn times(&self, other: &Self) -> Self {
        let mut digits = vec![0_u32; self.1.len() + other.1.len()];
        for (i, a) in self.1.iter().enumerate() {
            let mut carry = 0_u64;
            for j in 0..other.1.len() + usize::from(i < self.1.len()) {
                let Some(digit) = digits.get_mut(i + j) else { break };
                let b = other.1.get(j).copied().unwrap_or(0);
                let sum = u64::from(*digit) + u64::from(*a) * u64::from(b) + carry;
                *digit = sum as u32;
                carry = sum >> 32;
            }
        }
        Self(self.0 != other.0, digits).trimmed()
    }

    fn plus(&self, other: &Self) -> Self {
        let digit = |number: &Self, k: usize| i64::from(number.1.get(k).copied().unwrap_or(0));
        let sign = |number: &Self| if number.0 { -1 } else { 1 };
        // Adds signed digits, then carries; negates first if the result is negative.
        let carried = |turn: i64| {
            let (mut carry, mut digits) = (0_i64, Vec::new());
            for k in 0..=self.1.len().max(other.1.len()) {
                let sum = turn * (sign(self) * digit(self, k) + sign(other) * digit(other, k)) + carry;
                digits.push(sum as u32);
                carry = sum >> 32;
            }
            (carry, digits)
        };
        match carried(1) {
            (0, digits) => Self(false, digits).trimmed(),
            _ => Self(true, carried(-1).1).trimmed(),
        }
    }

    /// Determinant of a square matrix, expanded along the first row.
    fn determinant(rows: &[Vec<Self>]) -> Self {
        let Some((first, rest)) = rows.split_first() else { return Self::of(1) };
        let mut sum = Self::of(0);
        for (column, number) in first.iter().enumerate() {
            let without = |row: &Vec<Self>| [&row[..column], &row[column + 1..]].concat();
            let minor = Self::determinant(&rest.iter().map(without).collect::<Vec<_>>());
            sum = sum.plus(&number.times(&minor).times(&Self::of(1 - 2 * (column as i64 % 2))));
        }
        sum
    }
}

/// Sign of the determinant with rows (x, y, z, 1), positive for positive tets.
fn true_side(grid_points: &[GridPoint; 4]) -> i32 {
    let row = |p: &GridPoint| [p[0], p[1], p[2], 1].map(|x| Big::of(i64::from(x))).to_vec();
    -Big::determinant(&grid_points.iter().map(row).collect::<Vec<_>>()).sign()
}

/// Sign of the determinant with rows (x, y, z, x² + y² + z², 1).
fn true_sphere(grid_points: &[GridPoint; 5]) -> i32 {
    let row = |p: &GridPoint| {
        let [x, y, z] = p.map(i64::from);
        let square: i64 = [x, y, z].iter().map(|x| x * x).sum();
        [x, y, z, square, 1].map(Big::of).to_vec()
    };
    -Big::determinant(&grid_points.iter().map(row).collect::<Vec<_>>()).sign()
}

fn sign(x: f64) -> i32 {
    i32::from(x > 0.0) - i32::from(x < 0.0)
}

fn agree(grid_points: [GridPoint; 5]) {
    let [a, b, c, d, e] = grid_points.map(at);
    let [p, q, r, s, _] = grid_points;
    assert_eq!(sign(orient(&a, &b, &c, &d)), true_side(&[p, q, r, s]), "{grid_points:?}");
    assert_eq!(sign(in_sphere(&a, &b, &c, &d, &e)), true_sphere(&grid_points), "{grid_points:?}");
}

#[test]
fn the_oracle_computes_correctly() {
    let big = Big::of(i64::MAX).times(&Big::of(i64::MIN)).plus(&Big::of(7));
    let small = i128::from(i64::MAX) * i128::from(i64::MIN) + 7;
    let digits = (0..4).map(|k| (small.unsigned_abs() >> (32 * k)) as u32).collect();
    assert_eq!(big, Big(true, digits).trimmed());
    assert_eq!(Big::of(5).plus(&Big::of(-5)).sign(), 0);
    // 2·(3 − 2) + (1 − 3) by hand.
    let rows = [[2, 0, 1], [1, 3, 2], [1, 1, 1]].map(|row| row.map(Big::of).to_vec());
    assert_eq!(Big::determinant(&rows), Big::of(0));
}

#[test]
fn a_corner_tet_is_positive_and_its_circumsphere_passes_through_the_cube() {
    let [o, x, y, z] = [DVec3::zeros(), DVec3::x() * 2.0, DVec3::y() * 2.0, DVec3::z() * 2.0];
    assert_eq!(orient(&o, &x, &y, &z), 8.0);
    assert!(in_sphere(&o, &x, &y, &z, &DVec3::repeat(1.0)) > 0.0);
    assert_eq!(in_sphere(&o, &x, &y, &z, &DVec3::repeat(2.0)), 0.0);
    assert!(in_sphere(&o, &x, &y, &z, &DVec3::new(3.0, 2.0, 2.0)) < 0.0);
}

#[test]
fn random_points_of_all_sizes_agree_with_the_oracle() {
    for bits in [2, 4, 8, 13, 18, 22, 24] {
        for grid_points in random(5 * 400, 1 << bits, bits).chunks_exact(5) {
            agree(grid_points.try_into().unwrap());
        }
    }
}

#[test]
fn nearly_coplanar_and_cospherical_points_agree_with_the_oracle() {
    // Points on a plane or a sphere, rounded and moved by at most one step: the cases that the rounding bounds are
    // for.
    let key = Key::new(5);
    for k in 0..3000 {
        let draw = |n: u64| key.of(k).of(n).f64();
        let scale = [f64::from(SIDE), 1e5, 300.0][(k % 3) as usize];
        let on_sphere = |n: u64| {
            let p = DVec3::from([0, 1, 2].map(|axis| draw(10 * n + axis) - 0.5));
            let length = p.norm().max(1e-3);
            p.map(|x| (scale * (0.5 + 0.49 * x / length)) as i32).into()
        };
        let on_plane = |n: u64| {
            let (u, v) = (draw(10 * n), draw(10 * n + 1));
            [u, v, 0.3 * u + 0.6 * v].map(|x| (scale * x) as i32)
        };
        agree([0, 1, 2, 3, 4].map(on_sphere));
        agree([0, 1, 2, 3, 4].map(on_plane));
    }
}

#[test]
fn the_largest_coordinates_do_not_overflow() {
    let corners: Vec<GridPoint> = (0..8).map(|k| [k & 1, k >> 1 & 1, k >> 2].map(|bit| bit * SIDE)).collect();
    // Every third of the 8⁵ choices: each corner at each place, beside each other one.
    for k in (0..8_usize.pow(5)).step_by(3) {
        agree(std::array::from_fn(|n| corners[k / 8_usize.pow(n as u32) % 8]));
    }
}
