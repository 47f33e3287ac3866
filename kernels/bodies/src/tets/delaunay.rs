//! Delaunay tetrahedralisation of grid points by incremental insertion (Bowyer 1981, Watson 1981).
//!
//! With exact predicates every tet is positive, no point lies strictly inside the circumsphere of a tet, and the tets
//! fill the convex hull. The same points in the same order give the same tets; where more than four points are
//! cospherical, the fixed insertion order selects one of the possible tetrahedralisations. Limits: single-threaded;
//! fewer than 2³⁰ tets.
//!
//! The exterior is covered by ghost tets: one for each hull face, with [`GHOST`] as its fourth corner. A new point
//! removes all tets with the point strictly inside their circumsphere (for a ghost: strictly beyond its face, or
//! coplanar with it and inside its circumcircle). They form a connected cavity, whose boundary is visible from the
//! point; as spheres are open, no boundary face is coplanar with it, so connecting them to the point gives positive
//! tets.

use super::boundary::FACES;
use super::grid::GridPoint;
use super::insertion_order::insertion_order;
use super::predicates::{At, in_sphere, orient};

/// Result of [`delaunay`].
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Delaunay {
    /// Point indices of each tet, with (b−a)×(c−a)·(d−a) > 0. Empty if all points are coplanar.
    pub tets: Vec<[u32; 4]>,
    /// The neighbour opposite to each corner of each tet; [`NONE`] beyond the hull.
    pub across: Vec<[u32; 4]>,
    /// Duplicate points: the index of each and of the earlier point at the same position. No tet uses them.
    pub doubled: Vec<[u32; 2]>,
}

/// No tet.
pub const NONE: u32 = u32::MAX;

/// Tetrahedralises `points`, with coordinates from 0 to [`super::grid::SIDE`].
pub fn delaunay(points: &[GridPoint]) -> Delaunay {
    let mut order = insertion_order(points);
    let Some(first) = first_tet(points, &order) else { return Delaunay::default() };
    // The corners of the first tet are inserted before everything else.
    for (k, point) in first.into_iter().enumerate() {
        let found = order.iter().position(|index| *index == point).expect("the corners are places");
        order[k..=found].rotate_right(1);
    }
    let mut complex = Complex::of(points, &order);
    let mut doubled = Vec::new();
    for vertex in 5..=order.len() as u32 {
        if let Some(earlier) = complex.insert(vertex) {
            doubled.push([order[vertex as usize - 1], order[earlier as usize - 1]]);
        }
    }
    complex.finish(&order, doubled)
}

/// The first four points in `order` that form a tet, positively oriented.
fn first_tet(points: &[GridPoint], order: &[u32]) -> Option<[u32; 4]> {
    let at = |index: &u32| At::from(points[*index as usize].map(f64::from));
    let mut rest = order.iter();
    let a = rest.next()?;
    let b = rest.find(|b| at(b) != at(a))?;
    // Collinear with a and b: all 2 × 2 minors are exactly 0.
    let on_line = |c: &u32| {
        let (u, v) = (at(b) - at(a), at(c) - at(a));
        [(0, 1), (1, 2), (2, 0)].iter().all(|(i, j)| u[*i] * v[*j] == u[*j] * v[*i])
    };
    let c = rest.find(|c| !on_line(c))?;
    let d = rest.find(|d| orient(&at(a), &at(b), &at(c), &at(d)) != 0.0)?;
    let positive = orient(&at(a), &at(b), &at(c), &at(d)) > 0.0;
    Some(if positive { [*a, *b, *c, *d] } else { [*a, *c, *b, *d] })
}

/// The vertex at infinity; points are vertices from 1 on, in insertion order.
const GHOST: u32 = 0;

/// Corner of a removed tet.
const DEAD: u32 = u32::MAX;

/// A face of a tet: four times the tet, plus the opposite corner.
type Face = u32;

/// The new tets of a cavity with more vertices than this are linked by sorting its edges.
const MOST_LOCAL: usize = 64;

/// A boundary face of the cavity: the new tet on it, the new point's corner there, and the face on the other side.
struct Rim {
    corners: [u32; 4],
    corner: u32,
    beyond: Face,
}

struct Complex {
    at: Vec<At>,
    corners: Vec<[u32; 4]>,
    across: Vec<[Face; 4]>,
    /// For each tet `stamp` if the current point removes it, `stamp` + 1 if it does not, a smaller number if that is
    /// not known yet.
    seen: Vec<u32>,
    stamp: u32,
    /// Slots of removed tets, for reuse.
    free: Vec<u32>,
    /// Start of the next walk: a recently created tet.
    last: u32,
    cavity: Vec<u32>,
    rim: Vec<Rim>,
    /// For each vertex the last cavity in which it got a local number, and that number.
    local: Vec<[u32; 2]>,
    /// For local vertices u and v, the face of a new tet at the cavity's boundary edge from u to v.
    table: Vec<Face>,
    edges: Vec<(u64, Face)>,
}

impl Complex {
    /// The tet of the first four points, and its four ghosts.
    fn of(points: &[GridPoint], order: &[u32]) -> Self {
        let mut at = vec![At::zeros()];
        at.extend(order.iter().map(|index| At::from(points[*index as usize].map(f64::from))));
        let vertices = at.len();
        let mut complex = Self {
            at,
            corners: Vec::with_capacity(7 * vertices),
            across: Vec::with_capacity(7 * vertices),
            seen: Vec::with_capacity(7 * vertices),
            stamp: 0,
            free: Vec::new(),
            last: 0,
            cavity: Vec::new(),
            rim: Vec::new(),
            local: vec![[0; 2]; vertices],
            table: vec![0; MOST_LOCAL * MOST_LOCAL],
            edges: Vec::new(),
        };
        let first = [1, 2, 3, 4];
        complex.push(first);
        // Ghost k is opposite to corner k: the corner becomes the ghost vertex, and two others are swapped.
        for k in 0..4 {
            let mut ghost = first;
            ghost[k] = GHOST;
            ghost.swap(FACES[k][0], FACES[k][1]);
            complex.push(ghost);
        }
        for tet in 0..5 {
            for corner in 0..4 {
                let face = complex.face(tet, corner);
                complex.across[tet][corner] = (0..20)
                    .find(|other| {
                        *other as usize / 4 != tet && complex.face(*other as usize / 4, *other as usize % 4) == face
                    })
                    .expect("five tets around four vertices and infinity close up");
            }
        }
        complex
    }

    fn push(&mut self, corners: [u32; 4]) -> u32 {
        self.corners.push(corners);
        self.across.push([0; 4]);
        self.seen.push(0);
        self.corners.len() as u32 - 1
    }

    /// The vertices of a face, sorted.
    fn face(&self, tet: usize, corner: usize) -> [u32; 3] {
        let mut face = FACES[corner].map(|other| self.corners[tet][other]);
        face.sort_unstable();
        face
    }

    #[inline(always)]
    fn of_vertices(&self, [a, b, c, d]: [u32; 4]) -> [&At; 4] {
        [a, b, c, d].map(|vertex| &self.at[vertex as usize])
    }

    /// Whether the point `p` removes a tet.
    #[inline(always)]
    fn conflicts(&self, tet: u32, p: &At) -> bool {
        let corners = self.corners[tet as usize];
        let Some(ghost) = corners.iter().position(|vertex| *vertex == GHOST) else {
            let [a, b, c, d] = self.of_vertices(corners);
            return in_sphere(a, b, c, d, p) > 0.0;
        };
        let beyond = side(self.of_vertices(corners), ghost, p);
        if beyond != 0.0 {
            return beyond > 0.0;
        }
        // In the plane of the face, the circumsphere of the tet behind it intersects in the circumcircle.
        let behind = self.corners[(self.across[tet as usize][ghost] / 4) as usize];
        let [a, b, c, d] = self.of_vertices(behind);
        in_sphere(a, b, c, d, p) > 0.0
    }

    /// The tet that contains `p` in its interior or boundary, or a ghost whose face `p` is strictly beyond. Walks
    /// through faces that separate the tet from `p`, which terminates in a Delaunay tetrahedralisation (Edelsbrunner
    /// 1990).
    fn locate(&self, p: &At) -> u32 {
        let mut tet = self.last;
        if let Some(ghost) = self.corners[tet as usize].iter().position(|vertex| *vertex == GHOST) {
            tet = self.across[tet as usize][ghost] / 4;
        }
        let mut entered = 4;
        loop {
            let corners = self.corners[tet as usize];
            let points = self.of_vertices(corners);
            let through = (0..4).find(|corner| *corner != entered && side(points, *corner, p) < 0.0);
            let Some(corner) = through else { return tet };
            let face = self.across[tet as usize][corner];
            (tet, entered) = (face / 4, face as usize % 4);
            if self.corners[tet as usize].contains(&GHOST) {
                return tet;
            }
        }
    }

    /// Inserts a vertex, or returns the vertex that is already at its position.
    fn insert(&mut self, vertex: u32) -> Option<u32> {
        let p = self.at[vertex as usize];
        let start = self.locate(&p);
        let on = |corner: &&u32| **corner != GHOST && self.at[**corner as usize] == p;
        if let Some(earlier) = self.corners[start as usize].iter().find(on) {
            return Some(*earlier);
        }
        self.dig(start, vertex, &p);
        self.fill();
        None
    }

    /// Finds the cavity of `vertex` at `p`, and its boundary.
    fn dig(&mut self, start: u32, vertex: u32, p: &At) {
        self.stamp += 2;
        self.cavity.clear();
        self.rim.clear();
        self.cavity.push(start);
        self.seen[start as usize] = self.stamp;
        let mut next = 0;
        while let Some(&tet) = self.cavity.get(next) {
            next += 1;
            for corner in 0..4 {
                let beyond = self.across[tet as usize][corner];
                let other = beyond / 4;
                if self.seen[other as usize] == self.stamp {
                    continue;
                }
                if self.seen[other as usize] < self.stamp && self.conflicts(other, p) {
                    self.seen[other as usize] = self.stamp;
                    self.cavity.push(other);
                    continue;
                }
                self.seen[other as usize] = self.stamp + 1;
                let mut corners = self.corners[tet as usize];
                corners[corner] = vertex;
                self.rim.push(Rim { corners, corner: corner as u32, beyond });
            }
        }
    }

    /// Connects the cavity's boundary to the new point, reusing removed slots.
    fn fill(&mut self) {
        let rim = std::mem::take(&mut self.rim);
        let before = self.free.len();
        self.free.append(&mut self.cavity);
        let small = self.number(&rim);
        self.edges.clear();
        for Rim { corners, corner, beyond } in &rim {
            let tet = match self.free.pop() {
                Some(tet) => {
                    self.corners[tet as usize] = *corners;
                    tet
                }
                None => self.push(*corners),
            };
            self.cavity.push(tet);
            self.across[tet as usize][*corner as usize] = *beyond;
            self.across[(beyond / 4) as usize][(beyond % 4) as usize] = 4 * tet + corner;
            for [from, to, across] in edges(*corner as usize) {
                let face = 4 * tet + across as u32;
                let [from, to] = [from, to].map(|corner| self.local[corners[corner] as usize][1] as usize);
                if small {
                    self.table[from * MOST_LOCAL + to] = face;
                } else {
                    self.edges.push(((from as u64) << 32 | to as u64, face));
                }
            }
        }
        self.edges.sort_unstable();
        for (Rim { corners, corner, .. }, tet) in rim.iter().zip(&self.cavity) {
            for [from, to, across] in edges(*corner as usize) {
                let [from, to] = [from, to].map(|corner| self.local[corners[corner] as usize][1] as usize);
                // The cavity's boundary is closed: the other face at this edge runs from `to` to `from`.
                self.across[*tet as usize][across] = if small {
                    self.table[to * MOST_LOCAL + from]
                } else {
                    let key = (to as u64) << 32 | from as u64;
                    self.edges[self.edges.partition_point(|(edge, _)| *edge < key)].1
                };
            }
        }
        self.last = *self.cavity.last().expect("a place takes out a tet, so there is a rim");
        for tet in self.free.iter().skip(before) {
            self.corners[*tet as usize] = [DEAD; 4];
        }
        self.rim = rim;
    }

    /// Numbers the vertices of the cavity's boundary; returns whether they are few.
    fn number(&mut self, rim: &[Rim]) -> bool {
        let mut count = 0;
        for Rim { corners, corner, .. } in rim {
            for other in FACES[*corner as usize] {
                let local = &mut self.local[corners[other] as usize];
                if local[0] != self.stamp {
                    *local = [self.stamp, count];
                    count += 1;
                }
            }
        }
        count as usize <= MOST_LOCAL
    }

    /// The tets without ghosts, with the indices of the input points.
    fn finish(self, order: &[u32], doubled: Vec<[u32; 2]>) -> Delaunay {
        let lives = |corners: &[u32; 4]| corners[0] != DEAD && !corners.contains(&GHOST);
        let mut named = vec![NONE; self.corners.len()];
        let mut count = 0;
        for (name, _) in named.iter_mut().zip(&self.corners).filter(|(_, corners)| lives(corners)) {
            *name = count;
            count += 1;
        }
        let mut result =
            Delaunay { tets: Vec::with_capacity(count as usize), across: Vec::with_capacity(count as usize), doubled };
        for (corners, across) in self.corners.iter().zip(&self.across).filter(|(corners, _)| lives(corners)) {
            result.tets.push(corners.map(|vertex| order[vertex as usize - 1]));
            result.across.push(across.map(|face| named[(face / 4) as usize]));
        }
        result
    }
}

/// Orientation of a tet with one corner replaced by `p`.
#[inline(always)]
fn side<'a>(mut tet: [&'a At; 4], corner: usize, p: &'a At) -> f64 {
    tet[corner] = p;
    orient(tet[0], tet[1], tet[2], tet[3])
}

/// The edges of the face opposite to a corner: both ends and the third corner, which is opposite to the new tets'
/// faces at the edge.
#[inline(always)]
fn edges(corner: usize) -> [[usize; 3]; 3] {
    let [a, b, c] = FACES[corner];
    [[a, b, c], [b, c, a], [c, a, b]]
}
