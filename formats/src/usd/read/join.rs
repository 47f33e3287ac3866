//! Joins the components of several prims into one of each kind.

use std::collections::BTreeMap;

use engine::geometry::{ColumnType, Component, Geometry, Kind, Name, Owner};

use super::parts::repeated;
use crate::Result;

/// All components of a kind as one, in order. An attribute that one of them lacks is filled in with its neutral value,
/// else with 0. What is constant over a prim belongs to its elements, or points, where there are several prims.
pub(super) fn joined(parts: Vec<Component>, notes: &mut Vec<String>) -> Result<Geometry> {
    let mut geometry = Geometry::default();
    for kind in Kind::ALL {
        let mut own: Vec<Component> = parts.iter().filter(|part| part.kind() == kind).cloned().collect();
        if own.len() > 1 {
            own.iter_mut().try_for_each(spread)?;
            fill(&mut own, notes)?;
        }
        // Pair by pair, so that no row is copied more than a few times.
        while own.len() > 1 {
            let pair = |pair: &[Component]| match pair {
                [a, b] => a.concat(b),
                one => Ok(one[0].clone()),
            };
            own = own.chunks(2).map(pair).collect::<Result<_, _>>()?;
        }
        own.pop().into_iter().for_each(|part| geometry.put(part));
    }
    Ok(geometry)
}

/// Gives what is constant over the component to each element or point.
fn spread(part: &mut Component) -> Result<()> {
    let owner = if part.kind() == Kind::Points { Owner::Point } else { Owner::Element };
    let once: Vec<Name> = part.table(Owner::Once).iter().map(|(name, _)| name.clone()).collect();
    for name in once {
        if let Some(column) = part.remove(Owner::Once, &name)
            && part.table(owner).column(&name).is_none()
        {
            let rows = part.table(owner).rows();
            part.set_column(owner, name, repeated(&column, rows))?;
        }
    }
    Ok(())
}

/// Fills in what a component lacks and others have, and removes what has another type than in the first.
fn fill(parts: &mut [Component], notes: &mut Vec<String>) -> Result<()> {
    let mut kinds: BTreeMap<(Owner, Name), ColumnType> = BTreeMap::new();
    for part in parts.iter_mut() {
        let mut others = Vec::new();
        for (owner, name, column) in part.columns() {
            let known = *kinds.entry((owner, name.clone())).or_insert(column.kind());
            if known != column.kind() {
                notes.push(format!(
                    "`{name}` of the {} is {known} in one prim and {} in another, so it is not read there",
                    part.kind(),
                    column.kind()
                ));
                others.push((owner, name.clone()));
            }
        }
        others.into_iter().for_each(|(owner, name)| drop(part.remove(owner, &name)));
    }
    for part in parts {
        for (owner, name) in kinds.keys() {
            if part.table(*owner).column(name).is_none()
                && let Some(neutral) = part.neutral(*owner, name)
            {
                part.set_column(*owner, name.clone(), neutral)?;
            }
        }
    }
    Ok(())
}
