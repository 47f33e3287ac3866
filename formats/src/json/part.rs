//! The values of a component's object, and their consistency checks.

use engine::geometry::{Component, Geometry, Grid, Kind, Name, Owner, P, VOLUME_FIELDS, Volume, fixed_type};

use super::numbers::Numbers;
use crate::text::counted;

/// An attribute before its type is determined.
pub(super) type NamedNumbers = (Name, Numbers);

/// The values of a component's keys.
#[derive(Default)]
pub(super) struct Part {
    pub(super) counts: Option<Vec<u32>>,
    pub(super) corners: Option<Vec<u32>>,
    pub(super) tets: Option<Vec<[u32; 4]>>,
    pub(super) points: Option<Numbers>,
    /// In the order of [`Owner::ALL`].
    pub(super) tables: [Vec<NamedNumbers>; 3],
    /// The grid of a volume's level set.
    pub(super) grid: GridKeys,
    /// The grid of its velocity, if it has another.
    pub(super) velocity_grid: GridKeys,
    pub(super) background: Option<f32>,
    /// In the order of [`VOLUME_FIELDS`].
    pub(super) fields: [Option<Numbers>; 4],
}

/// The values of a grid's keys.
#[derive(Default)]
pub(super) struct GridKeys {
    pub(super) origin: Option<Numbers>,
    pub(super) cell: Option<f32>,
    pub(super) size: Option<[u32; 3]>,
}

impl GridKeys {
    /// The grid, with missing values from `other`.
    ///
    /// # Errors
    /// If a key is missing and there is no other grid, or a value is not allowed. `prefix` precedes each key.
    fn grid(self, prefix: &str, other: Option<Grid>) -> Result<Grid, String> {
        let key = |key: &str| format!("{prefix}{key}");
        let origin = match (self.origin, other) {
            (None, Some(other)) => other.origin,
            (origin, _) => {
                let origin = required(origin, &key("origin"))?.singles()?;
                let count = counted(origin.len(), "number");
                origin.try_into().map_err(|_| format!("`{}` has {count}, expected 3", key("origin")))?
            }
        };
        let cell = required(self.cell.or(other.map(|other| other.cell)), &key("cell"))?;
        if cell <= 0.0 {
            return Err(format!("`{}` is {cell}, expected more than 0", key("cell")));
        }
        let size = required(self.size.or(other.map(|other| other.size)), &key("size"))?;
        Ok(Grid { origin, cell, size })
    }
}

impl Part {
    /// Builds the component and adds it to `geometry`.
    ///
    /// # Errors
    /// If a key is missing or the values are inconsistent.
    pub(super) fn put_into(self, geometry: &mut Geometry, kind: Kind) -> Result<(), String> {
        match kind {
            Kind::Volume => geometry.put_volume(self.volume()?),
            _ => geometry.put(self.component(kind)?),
        }
        Ok(())
    }

    fn component(self, kind: Kind) -> Result<Component, String> {
        let positions = required(self.points, "points")?.triples().map_err(|fact| format!("`points`: {fact}"))?;
        let built = match kind {
            Kind::Curves => Component::curves(required(self.counts, "counts")?, positions),
            Kind::Mesh => {
                Component::mesh(required(self.counts, "counts")?, required(self.corners, "indices")?, positions)
            }
            Kind::Tets => Component::tets(required(self.tets, "indices")?, positions),
            Kind::Points | Kind::Volume => Ok(Component::points(positions)),
        };
        let mut component = built.map_err(|error| error.to_string())?;
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
        let grid = self.grid.grid("", None)?;
        let velocity_grid = self.velocity_grid.grid("velocity_", Some(grid))?;
        let mut arrays = [const { Vec::new() }; 4];
        for ((array, name), numbers) in arrays.iter_mut().zip(VOLUME_FIELDS).zip(self.fields) {
            *array = required(numbers, name)?.singles().map_err(|fact| format!("`{name}`: {fact}"))?;
        }
        let [level_set, velocity @ ..] = arrays.each_ref().map(Vec::as_slice);
        let default = || Volume::default_background(&grid, level_set.iter().copied());
        let background = self.background.unwrap_or_else(default);
        let volume = Volume::from_dense(grid, level_set, background, velocity_grid, velocity);
        let mut volume = volume.map_err(|error| error.to_string())?;
        let [.., once] = self.tables;
        for (name, numbers) in once {
            let column = numbers.column(fixed_type(&name));
            volume.once_mut().set(name, column).map_err(|error| error.to_string())?;
        }
        Ok(volume)
    }
}

fn required<T>(value: Option<T>, key: &str) -> Result<T, String> {
    value.ok_or_else(|| format!("`{key}` is missing"))
}
