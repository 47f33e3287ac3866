//! `group`: a node that acts on part of the curves.
//!
//! The rule for all nodes of the family: an attribute of curves or CVs, whole numbers or floats, whose rows of 0 are outside.
//! What is outside keeps its bits. Nodes that move curves do so by their CVs in the group alone: a curve turns or swings
//! only from its first such CV on, as lengths are kept.

use engine::expr::suggest::nearest;
use engine::geometry::ColumnType;
use engine::prelude::*;
use numerics::masked::Masked;

/// The param of every node that has groups.
pub(crate) const fn param() -> Param<Name> {
    Param::text(
        "group",
        "",
        "Name of an attribute of curves or CVs, whole numbers or floats: where it is 0 this node changes nothing. If empty, \
         it acts on all curves.",
    )
    .fixed()
}

/// The metric of every node that has groups: whether there is one with nothing in it, which [`is_empty`] gives.
pub(crate) const EMPTY: Metric =
    Metric::new("empty_group", Unit::None, "1 if the attribute that `group` names is 0 everywhere.").warn_always_above(
        0.0,
        "The attribute that `group` names is 0 everywhere, so this node changes nothing. Look at where it is made.",
    );

/// The value of [`EMPTY`].
pub(crate) fn is_empty(group: Option<&Group>) -> f64 {
    let is_empty = group.is_some_and(|group| !group.factors.is_empty() && group.factors.iter().all(|one| *one == 0.0));
    f64::from(u8::from(is_empty))
}

/// The attributes that a node reads because params name them, and writes: for [`Node::attributes`].
pub(crate) fn attributes(params: &Params, names: &[Param<Name>]) -> [AttrNames; 2] {
    let named = names.iter().map(|param| params.get(*param)).filter(|name| !name.is_empty());
    [AttrNames::These(named.collect()), AttrNames::These(Vec::new())]
}

/// The part of some curves that a node acts on.
#[derive(Debug, PartialEq)]
pub(crate) struct Group {
    /// For each CV 1 if it is in the group, else 0.
    factors: Vec<f32>,
}

impl Group {
    /// The group of that name; `None` if the name is empty, so that it is all curves.
    ///
    /// # Errors
    /// If the curves have no such attribute of whole numbers or floats.
    pub(crate) fn of(name: &str, curves: &Component) -> Result<Option<Self>> {
        if name.is_empty() {
            return Ok(None);
        }
        let inside = |owner: Owner| {
            let table = curves.table(owner);
            let whole = || table.get::<i32>(name).map(|rows| rows.iter().map(|row| *row != 0).collect::<Vec<_>>());
            table.get::<f32>(name).map(|rows| rows.iter().map(|row| *row != 0.0).collect()).or_else(whole)
        };
        let factor = |inside: bool| if inside { 1.0 } else { 0.0 };
        if let Some(cvs) = inside(Owner::Point) {
            return Ok(Some(Self { factors: cvs.into_iter().map(factor).collect() }));
        }
        if let Some(chosen) = inside(Owner::Element) {
            let cvs = curves.runs().counts().zip(chosen);
            let cvs = cvs.flat_map(|(count, inside)| std::iter::repeat_n(factor(inside), count as usize));
            return Ok(Some(Self { factors: cvs.collect() }));
        }
        let what =
            curves.describe(name).map_or("which the curves do not have".into(), |found| format!("which is {found}"));
        let fits = |(owner, _, column): &(Owner, &Name, &Column)| {
            *owner != Owner::Once && matches!(column.kind(), ColumnType::F1 | ColumnType::I1)
        };
        let hint = match nearest(name, curves.columns().filter(fits).map(|(_, name, _)| &**name)) {
            Some(near) => format!("did you mean `{near}`?"),
            None => "expected an attribute of one number for each curve or CV".to_owned(),
        };
        Err(Error::refused(format!("`group` is `{name}`, {what}")).hint(hint).of("group").of_types())
    }

    /// Whether a CV is in the group.
    pub(crate) fn has(&self, cv: usize) -> bool {
        self.factors[cv] != 0.0
    }

    /// The CVs in the group, in order.
    pub(crate) fn cvs(&self) -> impl Iterator<Item = usize> {
        (0..self.factors.len()).filter(|cv| self.has(*cv))
    }

    /// The curves with a CV in the group, in order.
    pub(crate) fn curves(&self, runs: &Runs) -> Vec<u32> {
        let ranges = runs.ranges().zip(0..);
        ranges.filter_map(|(mut cvs, curve)| cvs.any(|cv| self.has(cv)).then_some(curve)).collect()
    }

    /// The factors of a masked number, 0 outside the group.
    pub(crate) fn factors(&self, of: Masked<'_, f32>) -> Vec<f32> {
        (0..self.factors.len()).map(|cv| if self.has(cv) { of.factor(cv) } else { 0.0 }).collect()
    }
}

/// The number masked by `factors`, those that a group leaves, or else by its own mask.
pub(crate) fn masked<'m>(number: Masked<'m, f32>, factors: Option<&'m [f32]>) -> Masked<'m, f32> {
    Masked { value: number.value, mask: factors.or(number.mask) }
}

/// Some of the curves of a component, with all their attributes.
///
/// # Errors
/// None that a user causes.
pub(crate) fn taken(curves: &Component, chosen: &[u32]) -> Result<Component> {
    let runs = curves.runs();
    let cvs: Vec<u32> = chosen.iter().flat_map(|curve| runs.range(*curve as usize)).map(|cv| cv as u32).collect();
    let counts = chosen.iter().map(|curve| runs.range(*curve as usize).len() as u32).collect();
    let points = cvs.iter().map(|cv| curves.positions()[*cv as usize]).collect();
    let mut out = Component::curves(counts, points)?;
    for (owner, name, column) in curves.columns().filter(|(_, name, _)| ***name != *P.name) {
        let column = match owner {
            Owner::Point => column.gather(&cvs),
            Owner::Element => column.gather(chosen),
            Owner::Once => column.clone(),
        };
        out.set_column(owner, name.clone(), column)?;
    }
    Ok(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn curves() -> Component {
        let mut curves = Component::curves(vec![2, 1, 3], (0..6_u8).map(|k| [f32::from(k); 3]).collect()).unwrap();
        curves.set(Attr::<i32>::element("front"), vec![0, 5, -1]).unwrap();
        curves.set(Attr::<f32>::point("tips"), vec![0.0, 0.5, 0.0, 0.0, 0.0, 1.0]).unwrap();
        curves.set(Attr::<[f32; 3]>::point("colour"), vec![[0.5; 3]; 6]).unwrap();
        curves
    }

    #[test]
    fn rows_of_0_are_outside() {
        let curves = curves();
        let group = |name: &str| Group::of(name, &curves).unwrap().unwrap();
        let cvs = |name: &str| group(name).cvs().collect::<Vec<_>>();
        assert_eq!((cvs("front"), group("front").curves(curves.runs())), (vec![2, 3, 4, 5], vec![1, 2]));
        assert_eq!((cvs("tips"), group("tips").curves(curves.runs())), (vec![1, 5], vec![0, 2]));
        assert_eq!(Group::of("", &curves).unwrap(), None);
        let mask = [0.5, 0.25, 1.0, 1.0, 1.0, 2.0];
        let half = Masked { value: 0.5, mask: Some(&mask[..]) };
        assert_eq!(group("tips").factors(half), [0.0, 0.25, 0.0, 0.0, 0.0, 2.0]);
        let factors = group("tips").factors(half);
        assert_eq!((masked(half, Some(&factors)).at(5), masked(half, None).at(2)), (1.0, 0.5));
    }

    #[test]
    fn missing_attributes_and_vectors_are_refused() {
        let error = |name: &str| Group::of(name, &curves()).unwrap_err();
        assert_eq!(
            error("frunt").to_string(),
            "`group` is `frunt`, which the curves do not have; did you mean `front`?"
        );
        assert_eq!(error("colour").fact, "`group` is `colour`, which is one float3 for each CV");
    }

    #[test]
    fn taken_curves_keep_their_attributes() {
        let part = taken(&curves(), &[2, 0]).unwrap();
        assert_eq!(part.positions(), [[3.0; 3], [4.0; 3], [5.0; 3], [0.0; 3], [1.0; 3]]);
        assert_eq!(part.get(Attr::<i32>::element("front")), Some(&[-1, 0][..]));
        assert_eq!(part.get(Attr::<f32>::point("tips")), Some(&[0.0, 0.0, 1.0, 0.0, 0.5][..]));
    }
}
