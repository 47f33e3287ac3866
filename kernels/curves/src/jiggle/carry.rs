//! What carries an oscillator along: a share of a rigid motion, applied to its state before each step.

use rayon::prelude::*;

/// A place with axes, in metres: the frame of a face.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frame {
    /// Three unit vectors at right angles, right-handed.
    pub axes: [[f64; 3]; 3],
    /// Where they stand.
    pub origin: [f64; 3],
}

/// A rigid motion x → x + `change`·(x − `about`) + `shift`; without motion it is exactly none.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Carry {
    /// The turn, less the identity; rows.
    pub(super) change: [[f64; 3]; 3],
    pub(super) about: [f64; 3],
    pub(super) shift: [f64; 3],
}

impl Carry {
    /// Stays where it is.
    pub const NONE: Self = Self { change: [[0.0; 3]; 3], about: [0.0; 3], shift: [0.0; 3] };

    /// [`Carry::between`] for each of many frames.
    pub fn all_between(from: &[Frame], to: &[Frame], share: f64) -> Vec<Self> {
        let pairs = from.par_iter().zip(to).with_min_len(512);
        pairs.map(|(from, to)| Self::between(from, to, share)).collect()
    }

    /// A share of the motion that takes `from` to `to`: about the frame's origin, that share of the turn's angle (the
    /// shorter way round) and of the way. 0 is no motion, 1 all of it.
    pub fn between(from: &Frame, to: &Frame, share: f64) -> Self {
        if share == 0.0 || from == to {
            return Self::NONE;
        }
        let shift = std::array::from_fn(|k| share * (to.origin[k] - from.origin[k]));
        let turn: [[f64; 3]; 3] = std::array::from_fn(|row| {
            std::array::from_fn(|column| (0..3).map(|k| to.axes[k][row] * from.axes[k][column]).sum())
        });
        let turn = if share == 1.0 { turn } else { part_of_turn(&turn, share) };
        let change = std::array::from_fn(|row| {
            std::array::from_fn(|column| turn[row][column] - if row == column { 1.0 } else { 0.0 })
        });
        Self { change, about: from.origin, shift }
    }
}

/// The turn about the same axis by a share of the angle.
fn part_of_turn(turn: &[[f64; 3]; 3], share: f64) -> [[f64; 3]; 3] {
    let [x, y, z, w] = quaternion(turn);
    let sine = (x * x + y * y + z * z).sqrt();
    if sine == 0.0 {
        return [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    }
    let (part, cosine) = libm::sincos(share * libm::atan2(sine, w));
    let [x, y, z] = [x, y, z].map(|part_of_axis| part_of_axis * (part / sine));
    let w = cosine;
    [
        [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - z * w), 2.0 * (x * z + y * w)],
        [2.0 * (x * y + z * w), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - x * w)],
        [2.0 * (x * z - y * w), 2.0 * (y * z + x * w), 1.0 - 2.0 * (x * x + y * y)],
    ]
}

/// x, y, z, w of a turn, w ≥ 0; from its largest component, so that none is the root of a difference.
fn quaternion(m: &[[f64; 3]; 3]) -> [f64; 4] {
    let trace = m[0][0] + m[1][1] + m[2][2];
    let q = if trace > 0.0 {
        let w = (trace + 1.0).sqrt();
        [(m[2][1] - m[1][2]) / w, (m[0][2] - m[2][0]) / w, (m[1][0] - m[0][1]) / w, w]
    } else {
        let i = (0..3).fold(0, |most, k| if m[k][k] > m[most][most] { k } else { most });
        let (j, k) = ((i + 1) % 3, (i + 2) % 3);
        let own = (m[i][i] - m[j][j] - m[k][k] + 1.0).max(0.0).sqrt();
        let mut q = [0.0; 4];
        q[i] = own;
        q[j] = (m[j][i] + m[i][j]) / own;
        q[k] = (m[k][i] + m[i][k]) / own;
        q[3] = (m[k][j] - m[j][k]) / own;
        q
    };
    q.map(|x| if q[3] < 0.0 { -0.5 * x } else { 0.5 * x })
}
