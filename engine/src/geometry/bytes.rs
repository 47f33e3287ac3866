//! Lossless serialisation of a geometry, for the disk cache and solver checkpoints.

use std::sync::Arc;

use serde::de::Error as _;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use numerics::sparse_field::{BLOCK_NODES, SparseField};

use super::{Column, ColumnType, Component, Faces, Geometry, Grid, Kind, Owner, Runs, Table, Topology, Volume};

impl Geometry {
    /// The whole geometry as bytes.
    pub fn to_bytes(&self) -> Vec<u8> {
        let mut out = Vec::new();
        encode_geometry(&mut out, self);
        out
    }

    /// The inverse of [`Geometry::to_bytes`]; `None` for invalid bytes.
    pub fn from_bytes(bytes: &[u8]) -> Option<Self> {
        Reader(bytes).geometry()
    }
}

impl Serialize for Geometry {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.to_bytes().serialize(serializer)
    }
}

impl<'de> Deserialize<'de> for Geometry {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let bytes = Vec::<u8>::deserialize(deserializer)?;
        Self::from_bytes(&bytes).ok_or_else(|| D::Error::custom("the bytes are not a geometry"))
    }
}

fn encode_geometry(out: &mut Vec<u8>, geometry: &Geometry) {
    let put = |out: &mut Vec<u8>, bytes: &[u8]| {
        out.extend((bytes.len() as u64).to_le_bytes());
        out.extend(bytes);
    };
    let words = |words: &[u32]| words.iter().flat_map(|word| word.to_le_bytes()).collect::<Vec<_>>();
    for part in geometry.parts() {
        out.push(part.kind() as u8);
        match part.topology() {
            Topology::Curves(runs) => put(out, &words(runs.starts())),
            Topology::Mesh(faces) => {
                put(out, &words(faces.runs.starts()));
                put(out, &words(&faces.corners));
            }
            Topology::Points => {}
            Topology::Tets(tets) => put(out, &words(tets.as_flattened())),
        }
        for owner in Owner::ALL {
            encode_table(out, part.table(owner));
        }
    }
    if let Some(volume) = geometry.volume() {
        out.push(Kind::Volume as u8);
        for grid in [volume.level_grid(), volume.velocity_grid()] {
            out.extend(grid.origin.iter().chain([&grid.cell]).flat_map(|x| x.to_le_bytes()));
            out.extend(grid.size.iter().flat_map(|n| n.to_le_bytes()));
        }
        for (_, field) in volume.fields() {
            out.extend(field.background().to_le_bytes());
            let blocks: Vec<u32> = field.blocks().flat_map(|(block, _)| block).collect();
            put(out, &words(&blocks));
            put(out, &field.values().iter().flat_map(|x| x.to_le_bytes()).collect::<Vec<_>>());
        }
        encode_table(out, volume.once());
    }
}

fn encode_table(out: &mut Vec<u8>, table: &Table) {
    out.extend((table.rows() as u64).to_le_bytes());
    out.extend((table.iter().count() as u64).to_le_bytes());
    for (name, column) in table.iter() {
        for bytes in [name.as_bytes(), &[column.kind() as u8], &column.to_bytes()] {
            out.extend((bytes.len() as u64).to_le_bytes());
            out.extend(bytes);
        }
    }
}

/// The bytes not read yet; a read returns `None` if they end too early.
pub(crate) struct Reader<'a>(pub(crate) &'a [u8]);

impl<'a> Reader<'a> {
    pub(crate) fn take(&mut self, n: usize) -> Option<&'a [u8]> {
        let (head, rest) = self.0.split_at_checked(n)?;
        self.0 = rest;
        Some(head)
    }

    pub(crate) fn count(&mut self) -> Option<usize> {
        Some(u64::from_le_bytes(self.take(8)?.try_into().ok()?) as usize)
    }

    pub(crate) fn piece(&mut self) -> Option<&'a [u8]> {
        let n = self.count()?;
        self.take(n)
    }

    fn words(&mut self) -> Option<Vec<u32>> {
        Some(self.piece()?.as_chunks::<4>().0.iter().map(|word| u32::from_le_bytes(*word)).collect())
    }

    fn word(&mut self) -> Option<u32> {
        Some(u32::from_le_bytes(self.take(4)?.try_into().ok()?))
    }

    fn grid(&mut self) -> Option<Grid> {
        let [x, y, z, cell] = [self.word()?, self.word()?, self.word()?, self.word()?].map(f32::from_bits);
        Some(Grid { origin: [x, y, z], cell, size: [self.word()?, self.word()?, self.word()?] })
    }

    fn field(&mut self, size: [u32; 3]) -> Option<SparseField> {
        let background = f32::from_bits(self.word()?);
        let (blocks, values) = (self.words()?, self.words()?);
        let (blocks, values) = (blocks.as_chunks::<3>().0, values.as_chunks::<BLOCK_NODES>().0);
        if blocks.len() != values.len() || !blocks.is_sorted_by_key(|[x, y, z]| [*z, *y, *x]) {
            return None;
        }
        let find = |[x, y, z]: [u32; 3]| blocks.binary_search_by_key(&[z, y, x], |[x, y, z]| [*z, *y, *x]);
        let field = SparseField::from_blocks(size, background, blocks.iter().copied(), |block, out| {
            if let Ok(at) = find(block) {
                *out = values[at].map(f32::from_bits);
            }
        });
        field.ok().filter(|field| field.block_count() == blocks.len())
    }

    fn runs(&mut self) -> Option<Runs> {
        let starts = self.words()?;
        Runs::from_counts(starts.windows(2).map(|pair| pair[1].wrapping_sub(pair[0]))).ok()
    }

    fn table(&mut self) -> Option<Table> {
        const TYPES: [ColumnType; 6] =
            [ColumnType::F1, ColumnType::F3, ColumnType::F4, ColumnType::I1, ColumnType::I3, ColumnType::I4];
        let mut table = Table::new(self.count()?);
        for _ in 0..self.count()? {
            let name = std::str::from_utf8(self.piece()?).ok()?;
            let kind = TYPES.into_iter().find(|kind| Some(&[*kind as u8][..]) == self.0.get(8..9))?;
            self.piece()?;
            table.set(name, Column::from_bytes(kind, self.piece()?)?).ok()?;
        }
        Some(table)
    }

    fn geometry(&mut self) -> Option<Geometry> {
        let mut geometry = Geometry::default();
        while let Some(kind) = self.take(1) {
            let topology = match kind[0] {
                k if k == Kind::Curves as u8 => Topology::Curves(Arc::new(self.runs()?)),
                k if k == Kind::Mesh as u8 => {
                    let runs = self.runs()?;
                    Topology::Mesh(Arc::new(Faces { runs, corners: self.words()? }))
                }
                k if k == Kind::Points as u8 => Topology::Points,
                k if k == Kind::Tets as u8 => Topology::Tets(Arc::new(self.words()?.as_chunks::<4>().0.to_vec())),
                k if k == Kind::Volume as u8 => {
                    let (level_grid, velocity_grid) = (self.grid()?, self.grid()?);
                    let level_set = self.field(level_grid.size)?;
                    let mut face = |axis| self.field(velocity_grid.faces_size(axis));
                    let velocity = [face(0)?, face(1)?, face(2)?];
                    let mut volume = Volume::from_fields(level_grid, level_set, velocity_grid, velocity).ok()?;
                    *volume.once_mut() = self.table()?;
                    geometry.put_volume(volume);
                    continue;
                }
                _ => return None,
            };
            let tables = [self.table()?, self.table()?, self.table()?];
            geometry.put(Component::from_tables(topology, tables).ok()?);
        }
        Some(geometry)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn geometry_round_trips_and_damaged_bytes_are_refused() {
        let mesh = Component::mesh(vec![3], vec![0, 1, 2], vec![[0.5; 3], [1.0; 3], [-0.0, 2.0, f32::MIN]]).unwrap();
        let tets = Component::tets(vec![[0, 1, 2, 3]], vec![[1.0; 3]; 4]).unwrap();
        let geometry = Geometry::from(mesh).with(tets);
        let bytes = geometry.to_bytes();
        assert_eq!(Geometry::from_bytes(&bytes), Some(geometry));
        assert_eq!(Geometry::from_bytes(&bytes[..bytes.len() - 1]), None);
        assert_eq!(Geometry::from_bytes(&[99]), None);
    }
}
