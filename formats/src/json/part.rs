//! What a component's object says, and whether it fits together.

use engine::geometry::{Component, Geometry, Grid, Kind, Name, Owner, P, Volume, fixed_type};

use super::numbers::Numbers;
use crate::text::counted;

/// An attribute before its type is settled.
pub(super) type NamedNumbers = (Name, Numbers);

/// The arrays of a volume, in the order of [`Part::fields`].
pub(super) const FIELDS: [&str; 4] = ["level_set", "velocity_x", "velocity_y", "velocity_z"];

/// The values of a component's keys.
#[derive(Default)]
pub(super) struct Part {
    pub(super) counts: Option<Vec<u32>>,
    pub(super) corners: Option<Vec<u32>>,
    pub(super) tets: Option<Vec<[u32; 4]>>,
    pub(super) points: Option<Numbers>,
    /// In the order of [`Owner::ALL`].
    pub(super) tables: [Vec<NamedNumbers>; 3],
    pub(super) origin: Option<Numbers>,
    pub(super) cell: Option<f32>,
    pub(super) size: Option<[u32; 3]>,
    pub(super) fields: [Option<Numbers>; 4],
}

impl Part {
    /// Makes these the component of that kind.
    ///
    /// # Errors
    /// Where a key is missing or the values do not fit together.
    pub(super) fn put_into(self, geometry: &mut Geometry, kind: Kind) -> Result<(), String> {
        match kind {
            Kind::Volume => geometry.put_volume(self.volume()?),
            _ => geometry.put(self.component(kind)?),
        }
        Ok(())
    }

    fn component(self, kind: Kind) -> Result<Component, String> {
        let positions = there(self.points, "points")?.triples().map_err(|fact| format!("`points`: {fact}"))?;
        let made = match kind {
            Kind::Curves => Component::curves(there(self.counts, "counts")?, positions),
            Kind::Mesh => Component::mesh(there(self.counts, "counts")?, there(self.corners, "indices")?, positions),
            Kind::Tets => Component::tets(there(self.tets, "indices")?, positions),
            Kind::Points | Kind::Volume => Ok(Component::points(positions)),
        };
        let mut component = made.map_err(|error| error.to_string())?;
        for (owner, table) in Owner::ALL.into_iter().zip(self.tables) {
            for (name, numbers) in table {
                if owner == Owner::Point && &*name == P.name {
                    return Err("`P` is an attribute, expected the positions in `points`".into());
                }
                let column = numbers.column(fixed_type(&name));
                component.set_column(owner, name, column).map_err(|error| error.to_string())?;
            }
        }
        Ok(component)
    }

    fn volume(self) -> Result<Volume, String> {
        let origin = there(self.origin, "origin")?.singles()?;
        let origin = <[f32; 3]>::try_from(origin)
            .map_err(|origin| format!("`origin` has {}, expected 3", counted(origin.len(), "number")))?;
        let cell = there(self.cell, "cell")?;
        if cell <= 0.0 {
            return Err(format!("`cell` is {cell}, expected more than 0"));
        }
        let size = there(self.size, "size")?;
        // One more than the cells along each axis is more than any array can have, long before it overflows.
        if size.iter().try_fold(1_u64, |cells, n| cells.checked_mul(u64::from(*n) + 1)).is_none_or(|n| n > 1 << 48) {
            return Err(format!("`size` is {size:?}, more cells than a file can hold"));
        }
        let mut arrays = [const { Vec::new() }; 4];
        for ((array, name), numbers) in arrays.iter_mut().zip(FIELDS).zip(self.fields) {
            *array = there(numbers, name)?.singles().map_err(|fact| format!("`{name}`: {fact}"))?;
        }
        let [level_set, x, y, z] = arrays;
        let grid = Grid { origin, cell, size };
        let mut volume = Volume::new(grid, level_set, [x, y, z]).map_err(|error| error.to_string())?;
        let [.., once] = self.tables;
        for (name, numbers) in once {
            let column = numbers.column(fixed_type(&name));
            volume.once_mut().set(name, column).map_err(|error| error.to_string())?;
        }
        Ok(volume)
    }
}

fn there<T>(value: Option<T>, key: &str) -> Result<T, String> {
    value.ok_or_else(|| format!("`{key}` is missing"))
}
