//! Sample geometry: small components of every kind, in several forms, with additional attributes.
//!
//! All samples of one kind and form have the same topology, whatever their seed, so that components that a node
//! compares point by point (a rest pose, a moving skin) match.

mod volume;

use numerics::random::Key;
use numerics::vector;

use engine::geometry::{Column, ColumnType, Component, Geometry, Kind, Owner, fixed_type};
use engine::node::{AttrDecl, Needs};
use volume::volume;

/// The number and the arrangement of points.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Form {
    /// A few curves of 1 to 9 CVs, some with doubled CVs or without length, a closed mesh, a dozen points, some of them
    /// coincident, a few tets.
    Small,
    /// Other counts; the mesh is open.
    Other,
    /// Enough for several threads.
    Large,
    /// Empty components.
    Empty,
    /// Coordinates near the largest f32.
    Huge,
    /// Coordinates that are denormal.
    Tiny,
    /// All points at one position.
    Heap,
    /// Small, far from the origin.
    Far,
    /// Only curves without length and coincident points, and a flat face or tet among the others.
    Degenerate,
}

impl Form {
    /// Degenerate and extreme forms, which occur nevertheless.
    pub(crate) const EXTREMES: [Self; 6] =
        [Self::Empty, Self::Huge, Self::Tiny, Self::Heap, Self::Far, Self::Degenerate];

    /// Whether squares of coordinates overflow.
    pub(crate) fn may_overflow(self) -> bool {
        self == Self::Huge
    }

    fn place(self, [x, y, z]: [f32; 3], at: Key) -> [f32; 3] {
        match self {
            Self::Huge => [x, y, z].map(|x| x * 1e30),
            Self::Tiny => [x, y, z].map(|x| x * 1e-41),
            Self::Heap => [0.25, 0.5, at.of(7).f32() * 0.0],
            Self::Far => [x + 1e6, y - 3e6, z],
            _ => [x, y, z],
        }
    }
}

/// Which attributes besides `P` a sample has.
#[derive(Clone, Copy)]
pub(crate) struct Dress<'a> {
    /// Attributes that the node reads, with random values; their seed.
    pub(crate) declared: Option<u64>,
    /// Attributes that it does not read, with random values; their seed.
    pub(crate) others: Option<u64>,
    /// What the node reads.
    pub(crate) reads: &'a [(String, Owner, ColumnType)],
}

/// The components of a wire into an input; `any` chooses them if the input takes any.
pub(crate) fn kinds(needs: Needs, any: usize) -> Vec<Kind> {
    match needs {
        Needs::Kind(kind) => vec![kind],
        Needs::Any => match any % 6 {
            0 => vec![Kind::Curves, Kind::Mesh, Kind::Points, Kind::Tets],
            1 => vec![Kind::Curves],
            2 => vec![Kind::Mesh],
            3 => vec![Kind::Points],
            4 => vec![Kind::Tets],
            _ => vec![Kind::Volume, Kind::Points],
        },
    }
}

/// A geometry with components of `kinds`. `seed` only moves points.
pub(crate) fn geometry(kinds: &[Kind], form: Form, seed: u64, dress: Dress) -> Geometry {
    let mut geometry = Geometry::default();
    for kind in kinds {
        match kind {
            Kind::Volume => geometry.put_volume(volume(form, seed)),
            kind => {
                let mut part = component(*kind, form, Key::new(seed).of(*kind as u64));
                dressed(&mut part, form, dress);
                geometry.put(part);
            }
        }
    }
    geometry
}

/// The attributes of samples besides those a node reads: common ones, and some of every type.
pub(crate) fn usual() -> Vec<(String, Owner, ColumnType)> {
    use ColumnType as T;
    use Owner as O;
    let rows = [
        ("v", O::Point, T::F3),
        ("envelope", O::Point, T::F1),
        ("width", O::Point, T::F1),
        ("uvw", O::Point, T::F3),
        ("Pref", O::Point, T::F3),
        ("thickness", O::Point, T::F1),
        ("N", O::Point, T::F3),
        ("orient", O::Point, T::F4),
        ("id", O::Point, T::I1),
        ("shielded", O::Element, T::F1),
        ("curve_id", O::Element, T::I1),
        ("sample_mask", O::Point, T::F1),
        ("sample_ints", O::Point, T::I3),
        ("sample_group", O::Element, T::I1),
        ("sample_shade", O::Element, T::F4),
        ("sample_once", O::Once, T::F1),
    ];
    rows.map(|(name, owner, kind)| (name.to_owned(), owner, kind)).to_vec()
}

/// The point attribute, a float, that the suite names as mask.
pub(crate) const MASK: &str = "sample_mask";

/// Name, owner and type of declared attributes.
pub(crate) fn described(attributes: &[&dyn AttrDecl]) -> Vec<(String, Owner, ColumnType)> {
    let described = |attribute: &&dyn AttrDecl| {
        let (name, owner, kind) = attribute.spec();
        (name.to_owned(), owner, kind)
    };
    attributes.iter().map(described).collect()
}

fn dressed(part: &mut Component, form: Form, dress: Dress) {
    let is_read = |name: &str| dress.reads.iter().any(|(read, _, _)| read == name);
    let usual = usual();
    let read = dress.reads.iter().filter_map(|attribute| Some((attribute, dress.declared?)));
    let others = usual.iter().filter(|(name, _, _)| !is_read(name));
    let others = others.filter_map(|attribute| Some((attribute, dress.others?)));
    for ((name, owner, kind), seed) in read.chain(others) {
        if name == "P" || fixed_type(name).is_some_and(|fixed| fixed != *kind) {
            continue;
        }
        let rows = part.table(*owner).rows();
        let column = match name.as_str() {
            "Pref" => rest(part, form, Key::new(seed)),
            _ => column(*kind, rows, Key::new(seed).of(hash(name))),
        };
        part.set_column(*owner, name.as_str(), column).expect("as many rows as the table, of the type the name has");
    }
}

/// A hash of a name.
fn hash(name: &str) -> u64 {
    name.bytes().fold(0, |hash: u64, byte| hash.wrapping_mul(257).wrapping_add(u64::from(byte)))
}

/// A rest pose: the points of another sample of that form, moved slightly. It does not depend on the points of `part`,
/// so that the two can change independently.
fn rest(part: &Component, form: Form, at: Key) -> Column {
    let moved = |(row, p): (usize, &[f32; 3])| p.map(|x| x + 0.01 * at.of(row as u64).f32());
    let other = component(part.kind(), form, Key::new(5));
    Column::new(other.positions().iter().enumerate().map(moved).collect::<Vec<_>>())
}

/// Random rows: floats from 0 to 1, whole numbers from 0 to 3; rows of four floats are rotations.
fn column(kind: ColumnType, rows: usize, at: Key) -> Column {
    let float = |row: usize, k: usize| at.of((row * 4 + k) as u64).f32();
    let int = |row: usize, k: usize| (at.of((row * 4 + k) as u64).u32() % 4) as i32;
    match kind {
        ColumnType::F1 => Column::new((0..rows).map(|row| float(row, 0)).collect()),
        ColumnType::F3 => {
            Column::new((0..rows).map(|row| std::array::from_fn(|k| float(row, k))).collect::<Vec<[f32; 3]>>())
        }
        ColumnType::F4 => Column::new((0..rows).map(|row| rotation(std::array::from_fn(|k| float(row, k)))).collect()),
        ColumnType::I1 => Column::new((0..rows).map(|row| int(row, 0)).collect()),
        ColumnType::I3 => {
            Column::new((0..rows).map(|row| std::array::from_fn(|k| int(row, k))).collect::<Vec<[i32; 3]>>())
        }
        ColumnType::I4 => {
            Column::new((0..rows).map(|row| std::array::from_fn(|k| int(row, k))).collect::<Vec<[i32; 4]>>())
        }
    }
}

fn rotation(numbers: [f32; 4]) -> [f32; 4] {
    let numbers = numbers.map(|x| x - 0.5);
    let length = numbers.iter().map(|x| x * x).sum::<f32>().sqrt();
    if length > 0.0 { numbers.map(|x| x / length) } else { [0.0, 0.0, 0.0, 1.0] }
}

fn component(kind: Kind, form: Form, at: Key) -> Component {
    match kind {
        Kind::Curves => curves(form, at),
        Kind::Mesh => mesh(form, at),
        Kind::Tets => tets(form, at),
        Kind::Points | Kind::Volume => points(form, at),
    }
}

/// Random offsets of up to 2 mm, so that nothing is regular by accident.
fn jitter(at: Key, row: usize) -> [f32; 3] {
    std::array::from_fn(|k| at.of((row * 3 + k) as u64).between([-0.002, 0.002]))
}

fn settled(form: Form, at: Key, mut positions: Vec<[f32; 3]>) -> Vec<[f32; 3]> {
    for (row, p) in positions.iter_mut().enumerate() {
        *p = form.place(vector::add(*p, jitter(at, row)), at.of(row as u64));
    }
    positions
}

/// Which CVs of a curve coincide.
#[derive(Clone, Copy)]
enum Doubled {
    No,
    Root,
    Middle,
    Tip,
    All,
}

impl Doubled {
    /// Makes CVs of one curve coincide.
    fn apply(self, cvs: &mut [[f32; 3]]) {
        let last = cvs.len() - 1;
        match self {
            Self::No => {}
            Self::Root => cvs[1] = cvs[0],
            Self::Middle => cvs[last / 2] = cvs[last / 2 + 1],
            Self::Tip => cvs[last] = cvs[last - 1],
            Self::All => cvs.fill(cvs[0]),
        }
    }
}

/// Fur of some 5 cm on the sample mesh: roots at its upper side, some curves of one and two CVs, some with doubled CVs.
/// Each seed leans its curves in other directions, some into the mesh.
fn curves(form: Form, at: Key) -> Component {
    use Doubled::{All, Middle, No, Root, Tip};
    let curves: Vec<(u32, Doubled)> = match form {
        Form::Empty => Vec::new(),
        Form::Other => vec![(3, No), (7, No), (1, No)],
        Form::Large => (0..400).map(|k| ([5, 8, 2, 5, 1, 12][k % 6], No)).collect(),
        Form::Degenerate => vec![(2, All), (1, No), (4, All), (3, All)],
        _ => vec![(5, No), (1, No), (2, No), (9, Middle), (4, All), (5, Root), (2, All), (3, Tip), (4, No), (5, No)],
    };
    let counts: Vec<u32> = curves.iter().map(|(count, _)| *count).collect();
    let mut positions = Vec::new();
    for (curve, count) in counts.iter().enumerate() {
        let angle = [(1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0), (0.6, 0.8)][curve % 5];
        let root = [0.06 * angle.0, 0.09 + 0.0001 * (curve / 5) as f32, 0.06 * angle.1];
        let step = 0.05 / (*count).max(2) as f32;
        let lean: [f32; 2] = [0, 1].map(|axis| 2.0 * at.of(9).of(curve as u64).of(axis).f32() - 1.0);
        let along = [lean[0], 0.4 - 0.5 * lean[1], 0.2 + lean[1]].map(|x| step * x);
        let cv = |cv: u32| std::array::from_fn::<f32, 3, _>(|axis| root[axis] + along[axis] * cv as f32);
        positions.extend((0..*count).map(cv));
    }
    let mut positions = settled(form, at, positions);
    let mut rest = &mut positions[..];
    for (count, doubled) in curves {
        let (cvs, after) = rest.split_at_mut(count as usize);
        doubled.apply(cvs);
        rest = after;
    }
    Component::curves(counts, positions).expect("counts that add up")
}

/// A ball of 10 cm radius made of quads and triangles, or an open sheet.
fn mesh(form: Form, at: Key) -> Component {
    let (counts, corners, positions) = match form {
        Form::Empty => (Vec::new(), Vec::new(), Vec::new()),
        Form::Other => sheet(5),
        Form::Large => ball(24, 16),
        _ => ball(8, 5),
    };
    let mut positions = settled(form, at, positions);
    if form == Form::Degenerate {
        // A triangle at the pole without area, a quad beside it with a doubled corner.
        positions[1] = positions[0];
        positions[2] = positions[0];
    }
    Component::mesh(counts, corners, positions).expect("corners in range")
}

type Faces = (Vec<u32>, Vec<u32>, Vec<[f32; 3]>);

/// `around` meridians and `rings` rings of quads between two poles. Rational points on the sphere: no trigonometry.
fn ball(around: u32, rings: u32) -> Faces {
    const RADIUS: f32 = 0.1;
    // (1 − t²)/(1 + t²), 2t/(1 + t²) runs around a quarter for t from 0 to 1.
    let circle = |share: f32| {
        let (quarter, t) = ((share * 4.0).floor(), (share * 4.0).fract());
        let (c, s) = ((1.0 - t * t) / (1.0 + t * t), 2.0 * t / (1.0 + t * t));
        match quarter as i32 % 4 {
            0 => (c, s),
            1 => (-s, c),
            2 => (-c, -s),
            _ => (s, -c),
        }
    };
    let mut positions = vec![[0.0, -RADIUS, 0.0]];
    for ring in 1..=rings {
        let (up, out) = circle(ring as f32 / (rings + 1) as f32 / 2.0);
        for k in 0..around {
            let (c, s) = circle(k as f32 / around as f32);
            positions.push([RADIUS * out * c, -RADIUS * up, RADIUS * out * s]);
        }
    }
    positions.push([0.0, RADIUS, 0.0]);
    let row = |ring: u32, k: u32| 1 + (ring - 1) * around + k % around;
    let last = positions.len() as u32 - 1;
    let (mut counts, mut corners) = (Vec::new(), Vec::new());
    let mut face = |points: &[u32]| {
        counts.push(points.len() as u32);
        corners.extend(points);
    };
    for k in 0..around {
        face(&[0, row(1, k), row(1, k + 1)]);
        for ring in 1..rings {
            face(&[row(ring, k), row(ring + 1, k), row(ring + 1, k + 1), row(ring, k + 1)]);
        }
        face(&[row(rings, k), last, row(rings, k + 1)]);
    }
    (counts, corners, positions)
}

/// An open square of `n` × `n` quads, 20 cm wide.
fn sheet(n: u32) -> Faces {
    let positions = (0..=n).flat_map(|z| (0..=n).map(move |x| (x, z)));
    let positions = positions.map(|(x, z)| [0.2 * x as f32 / n as f32 - 0.1, 0.0, 0.2 * z as f32 / n as f32 - 0.1]);
    let cells = (0..n).flat_map(|z| (0..n).map(move |x| x + z * (n + 1)));
    let corners: Vec<u32> = cells.flat_map(|a| [a, a + n + 1, a + n + 2, a + 1]).collect();
    (vec![4; (n * n) as usize], corners, positions.collect())
}

fn points(form: Form, at: Key) -> Component {
    let count = match form {
        Form::Empty => 0,
        Form::Other => 5,
        Form::Large => 2000,
        _ => 12,
    };
    let spread = Key::new(11);
    let position = |row: usize| std::array::from_fn(|k| spread.of((row * 3 + k) as u64).between([-0.08, 0.08]));
    let mut positions = settled(form, at, (0..count).map(position).collect());
    let first = positions.first().copied().unwrap_or_default();
    match form {
        Form::Degenerate => positions.fill(first),
        Form::Small => positions[9..].fill(first),
        _ => {}
    }
    Component::points(positions)
}

/// Cubes of six tets each, side by side, 5 cm wide.
fn tets(form: Form, at: Key) -> Component {
    let cubes = match form {
        Form::Empty => 0,
        Form::Other => 1,
        Form::Large => 60,
        _ => 2,
    };
    let (mut tets, mut positions) = (Vec::new(), Vec::new());
    for cube in 0..cubes {
        let base = positions.len() as u32;
        let corner = |k: u32, axis: u32| (k >> axis & 1) as f32;
        positions.extend(
            (0..8).map(|k| [0.05 * corner(k, 0) + 0.06 * cube as f32, 0.05 * corner(k, 1), 0.05 * corner(k, 2)]),
        );
        // From corner 0 to corner 7 along the axes in each of their six orders; odd orders have the opposite
        // orientation.
        let orders = [[0, 1, 2], [1, 2, 0], [2, 0, 1], [0, 2, 1], [2, 1, 0], [1, 0, 2]];
        for (place, order) in orders.iter().enumerate() {
            let [a, b] = [1 << order[0], (1 << order[0]) | (1 << order[1])];
            let [a, b] = if place < 3 { [a, b] } else { [b, a] };
            tets.push([base, base + a, base + b, base + 7]);
        }
    }
    let mut positions = settled(form, at, positions);
    if form == Form::Degenerate {
        positions[1] = positions[0];
    }
    Component::tets(tets, positions).expect("corners in range")
}

#[cfg(test)]
mod tests {
    use super::*;

    const NAKED: Dress = Dress { declared: None, others: None, reads: &[] };

    #[test]
    fn samples_of_one_form_have_one_topology_whatever_their_seed() {
        let forms = [&[Form::Small, Form::Other, Form::Large][..], &Form::EXTREMES].concat();
        for form in forms {
            let [a, b] = [1, 2].map(|seed| geometry(&Kind::ALL, form, seed, NAKED));
            for (a, b) in a.parts().zip(b.parts()) {
                assert_eq!(a.topology(), b.topology(), "{form:?} {}", a.kind());
                let same = a.positions() == b.positions();
                assert_eq!(same, matches!(form, Form::Empty | Form::Heap), "{form:?} {}", a.kind());
            }
        }
    }

    #[test]
    fn the_ball_is_closed_and_faces_outwards() {
        let mesh = component(Kind::Mesh, Form::Small, Key::new(0));
        let faces = mesh.faces().expect("a mesh");
        let mut edges = std::collections::BTreeMap::new();
        for face in faces.iter() {
            for (k, a) in face.iter().enumerate() {
                *edges.entry((*a, face[(k + 1) % face.len()])).or_insert(0) += 1;
            }
            let [a, b, c] = [0, 1, 2].map(|k| mesh.positions()[face[k] as usize]);
            let normal = vector::cross(vector::sub(b, a), vector::sub(c, a));
            assert!(vector::dot(normal, a) > 0.0, "face {face:?}");
        }
        assert!(edges.iter().all(|((a, b), count)| *count == 1 && edges.contains_key(&(*b, *a))));
    }

    #[test]
    fn tets_are_positively_oriented() {
        let part = component(Kind::Tets, Form::Other, Key::new(3));
        for tet in part.tet_corners() {
            let [a, b, c, d] = tet.map(|k| vector::to_f64(part.positions()[k as usize]));
            assert!((b - a).cross(&(c - a)).dot(&(d - a)) > 0.0, "{tet:?}");
        }
    }
}
