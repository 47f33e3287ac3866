//! From a node's result to what an output asks for: attributes picked, velocities added.

use std::sync::Arc;

use crate::error::{Error, Result};
use crate::geometry::{CURVE_ID, Component, Geometry, ID, Name, Owner, P, V};
use crate::graph::GraphOutput;

/// The results that velocities are differences of.
pub(super) struct Around {
    /// Before and after.
    pub(super) results: [Arc<Geometry>; 2],
    /// Seconds between them.
    pub(super) seconds: f64,
    /// They come from a solver: a whole frame away, and what has velocities has the solver's.
    pub(super) of_solver: bool,
}

/// What an output delivers of `geometry`.
pub(super) fn finish(output: &GraphOutput, geometry: &Geometry, around: Option<&Around>) -> Result<Geometry> {
    let mut result = geometry.clone();
    if let Some(around) = around {
        add_velocity(&mut result, around)?;
    }
    let kinds: Vec<_> = result.parts().map(|part| part.kind()).collect();
    for kind in kinds {
        let Some(part) = result.part_mut(kind) else { continue };
        let unwanted: Vec<(Owner, Name)> = part
            .columns()
            .filter(|(_, name, _)| !wanted(output, name))
            .map(|(owner, name, _)| (owner, name.clone()))
            .collect();
        for (owner, name) in unwanted {
            part.remove(owner, &name);
        }
    }
    Ok(result)
}

fn wanted(output: &GraphOutput, name: &Name) -> bool {
    match &output.attributes {
        _ if **name == *P.name => true,
        _ if **name == *V.name && output.v => true,
        Some(names) => names.contains(name),
        None => true,
    }
}

fn add_velocity(result: &mut Geometry, around: &Around) -> Result<()> {
    let [before, after] = &around.results;
    let away = if around.of_solver { "a frame" } else { "half a frame" };
    let kinds: Vec<_> = result.parts().map(|part| part.kind()).collect();
    for kind in kinds {
        let Some(part) = result.part_mut(kind).filter(|part| !around.of_solver || part.get(V).is_none()) else {
            continue;
        };
        let (before, after) = match (before.part(kind), after.part(kind)) {
            (Some(before), Some(after)) if stays(before, part) && stays(part, after) => (before, after),
            (before, after) => {
                let counts = [before, after].map(|part| part.map_or(0, |part| part.point_count()));
                let now = part.point_count();
                let fact = match counts {
                    [a, b] if a == now && b == now => format!("its {kind}: other points or faces {away} away"),
                    [a, b] => format!("its {kind}: {a} points {away} before, {now} now and {b} after"),
                };
                return Err(Error::refused(fact)
                    .hint("velocities need the same points at neighbouring frames; remove `v` from the output"));
            }
        };
        let (a, b) = (before.positions(), after.positions());
        let rate = 1.0 / around.seconds;
        let v =
            a.iter().zip(b).map(|(a, b)| std::array::from_fn(|k| ((f64::from(b[k]) - f64::from(a[k])) * rate) as f32));
        part.set(V, v.collect())?;
    }
    Ok(())
}

/// Whether points of `a` go on in `b`: as many, joined alike, and the same where they say who they are.
pub(super) fn stays(a: &Component, b: &Component) -> bool {
    let joined_alike = a.topology().same(b.topology()) || a.topology() == b.topology();
    let known = [(ID.owner, ID.name), (CURVE_ID.owner, CURVE_ID.name)];
    let same_ids = |(owner, name): (Owner, &str)| match (a.table(owner).column(name), b.table(owner).column(name)) {
        (Some(a), Some(b)) => a.same(b) || a == b,
        (a, b) => a.is_none() && b.is_none(),
    };
    a.point_count() == b.point_count() && joined_alike && known.into_iter().all(same_ids)
}
