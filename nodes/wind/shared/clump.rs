//! `clump`: curves that wind, gusts and jiggle move together.
//!
//! The rule for all nodes of the family: what a curve of a clump would get at its own root it gets at the mean root of its
//! clump, by the share `clump_blend`. Curves keep their own shapes and lengths.

use curves::attach::RootPositions;
use curves::clumps::Clumps;
use engine::expr::suggest::nearest;
use engine::geometry::ColumnType;
use engine::prelude::*;
use std::sync::Arc;

/// Params of every node that has clumps.
pub(crate) const NAME: Param<Name> = Param::text(
    "clump",
    "",
    "Name of a curve attribute with whole-number values (integer or float): curves with the same number move together, \
     curves with a number below 0 alone. If empty, `clump_radius` may find clumps.",
)
.fixed();

/// See [`NAME`].
pub(crate) const RADIUS: Param<f32> = Param::float(
    "clump_radius",
    0.0,
    "Distance between roots within which curves move together, if `clump` is empty. Clumps are found at the scene's \
     first frame and are about this far apart. 0 makes none.",
)
.unit(Unit::Metres)
.at_least(0.0)
.soft(0.0, 0.1)
.when(|params| params.get(NAME).is_empty());

/// See [`NAME`].
pub(crate) const BLEND: Param<Maskable> = Param::maskable(
    "clump_blend",
    1.0,
    "How much curves move with their clump: at 0 each moves on its own, at 1 those of a clump move as one.",
)
.within(0.0, 1.0)
.when(is_asked);

/// Whether curves may be in clumps.
pub(crate) fn is_asked(params: &Params) -> bool {
    !params.get(NAME).is_empty() || params.get(RADIUS) > 0.0
}

/// Whether any curve moves with its clump.
pub(crate) fn acts(params: &Params) -> bool {
    is_asked(params) && params.get(BLEND).value > 0.0
}

/// Whether clumps are found from the curves of the scene's first frame.
pub(crate) fn reads_start(params: &Params) -> bool {
    acts(params) && params.get(NAME).is_empty()
}

/// The clumps of some curves, which at the scene's first frame were `start`; `None` if all move alone.
///
/// # Errors
/// If the curves have no such attribute, or are not those of the first frame.
pub(crate) fn of(params: &Params, curves: &Component, start: Option<&Component>) -> Result<Option<Arc<Clumps>>> {
    if !acts(params) {
        return Ok(None);
    }
    let name = params.get(NAME);
    let clumps = if name.is_empty() {
        let Some(start) = start else { return Ok(None) };
        if start.element_count() != curves.element_count() {
            let fact = "`clump_radius` finds clumps at the scene's first frame, which has other curves";
            return Err(Error::refused(fact).hint("give the curves an attribute of clumps and name it in `clump`"));
        }
        let radius = params.get(RADIUS);
        start.kept(Found(radius.to_bits()), || Ok(Clumps::within(roots(start).as_slice(), radius)))?
    } else {
        let table = curves.table(Owner::Element);
        Arc::new(match (table.get::<i32>(&name), table.get::<f32>(&name)) {
            (Some(ids), _) => Clumps::of_ids(ids),
            (None, Some(numbers)) => Clumps::of_ids(&whole(&name, numbers)?),
            (None, None) => return Err(refused(&name, curves)),
        })
    };
    Ok(Some(clumps).filter(|clumps| !clumps.is_empty()))
}

/// The root of each curve.
pub(crate) fn roots(curves: &Component) -> RootPositions {
    RootPositions::of(curves.runs().starts(), curves.positions())
}

/// Floats without fractions as integers; Attribute_Expr makes such.
fn whole(name: &str, numbers: &[f32]) -> Result<Vec<i32>> {
    // Above this not every whole number is a float.
    const LARGEST: f32 = 16_777_216.0;
    let mut ids = Vec::with_capacity(numbers.len());
    for (curve, number) in numbers.iter().enumerate() {
        if number.fract() != 0.0 || number.abs() > LARGEST {
            let fact = format!("`clump` is `{name}`, which is {number} for curve {curve}, not a whole number");
            let hint = "round it, such as with `floor` in Attribute_Expr; numbers up to 16777216 are held exactly";
            return Err(Error::refused(fact).hint(hint).of("clump"));
        }
        ids.push(*number as i32);
    }
    Ok(ids)
}

fn refused(name: &str, curves: &Component) -> Error {
    let what = curves.describe(name).map_or("which the curves do not have".into(), |found| format!("which is {found}"));
    let fits = |(owner, _, column): &(Owner, &Name, &Column)| {
        *owner == Owner::Element && matches!(column.kind(), ColumnType::I1 | ColumnType::F1)
    };
    let hint = match nearest(name, curves.columns().filter(fits).map(|(_, name, _)| &**name)) {
        Some(near) => format!("did you mean `{near}`?"),
        None => "expected an attribute of one whole number for each curve".to_owned(),
    };
    Error::refused(format!("`clump` is `{name}`, {what}")).hint(hint).of("clump").of_types()
}

/// Key of the clumps found with a radius, as bits.
#[derive(PartialEq)]
struct Found(u32);

#[cfg(test)]
mod tests {
    use super::*;

    fn curves(numbers: [f32; 3]) -> Component {
        let mut curves = Component::curves(vec![1; 3], vec![[0.0; 3]; 3]).unwrap();
        curves.set(Attr::<f32>::element("tuft"), numbers.to_vec()).unwrap();
        curves.set(Attr::<[f32; 3]>::element("colour"), vec![[0.0; 3]; 3]).unwrap();
        curves
    }

    #[test]
    fn floats_without_fractions_are_whole_numbers() {
        assert_eq!(whole("tuft", &[2.0, -1.0, 16_777_216.0]).unwrap(), [2, -1, 16_777_216]);
        for odd in [0.5, f32::NAN, f32::INFINITY, 16_777_218.0] {
            let error = whole("tuft", &[2.0, odd]).unwrap_err();
            assert!(error.fact.contains(&format!("is {odd} for curve 1")), "{error}");
        }
    }

    #[test]
    fn only_one_number_a_curve_names_clumps() {
        let error = refused("tufft", &curves([0.0; 3])).to_string();
        assert_eq!(error, "`clump` is `tufft`, which the curves do not have; did you mean `tuft`?");
        let error = refused("colour", &curves([0.0; 3])).to_string();
        assert!(error.contains("expected an attribute of one whole number for each curve"), "{error}");
    }
}
