//! Distributing roots over a skin, for Curve_Scatter and Curve_Interpolate.

use curves::scatter::{Spot, Surface};
use engine::prelude::*;
use numerics::random::Key;

/// At most this many CVs: with `Pref` and `uvw`, 2.4 gigabytes.
const MOST_CVS: f64 = (1_u32 << 26) as f64;

/// How many curves, and where.
pub(crate) struct Planting<'a> {
    /// Curves on a square metre.
    pub(crate) density: f32,
    /// Multiplies the density, one value per point of the skin.
    pub(crate) mask: Option<&'a [f32]>,
    /// CVs of each curve.
    pub(crate) cvs: usize,
    pub(crate) seed: Seed,
}

impl Planting<'_> {
    /// The roots by face, each with its index in the infinite sequence of which a higher density takes a longer prefix.
    ///
    /// # Errors
    /// Where there would be more CVs than memory should hold.
    pub(crate) fn spots(&self, cx: &Cx, skin: &Component) -> Result<Vec<(usize, Spot)>> {
        let whole = skin.triangles();
        let triangles = &whole.corners;
        let share = |corner: u32| self.mask.map_or(1.0, |mask| f64::from(mask[corner as usize]).max(0.0));
        // Triangles where nothing grows are left out, so that a bare plain around a meadow costs nothing.
        let fertile: Vec<u32> = (0..triangles.len() as u32)
            .filter(|triangle| triangles[*triangle as usize].iter().any(|corner| share(*corner) > 0.0))
            .collect();
        let ground: Vec<[u32; 3]> = fertile.iter().map(|triangle| triangles[*triangle as usize]).collect();
        let surface = Surface::new(skin.positions(), &ground);
        let area = surface.area();
        let most_share = ground.as_flattened().iter().map(|corner| share(*corner)).fold(0.0, f64::max);

        let unmasked = f64::from(self.density) * area;
        let places = (unmasked * most_share).round();
        let cvs = self.cvs as f64;
        if places * cvs > MOST_CVS {
            let fact = format!("{places} curves of {cvs} CVs would grow on {area} m², more than {MOST_CVS} CVs");
            return Err(Error::refused(fact).hint("lower `density` or `cvs`, or scale the skin to metres"));
        }
        let spots = surface.spread(places as usize, Key::new(u64::from(self.seed.0)));
        cx.check_cancelled()?;

        let grows = |place: usize, spot: &Spot| {
            let [share] = spot.mix(ground[spot.triangle as usize].map(|corner| [share(corner)]));
            place as f64 + 0.5 < unmasked * share
        };
        let mut spots: Vec<(usize, Spot)> = spots
            .into_iter()
            .enumerate()
            .filter(|(place, spot)| self.mask.is_none() || grows(*place, spot))
            .map(|(place, spot)| (place, Spot { triangle: fertile[spot.triangle as usize], ..spot }))
            .collect();
        spots.sort_unstable_by_key(|(place, spot)| (spot.triangle, *place));
        Ok(spots)
    }
}

/// The skin's mask of that name, where one is named.
///
/// # Errors
/// Where the skin has no such float per point.
pub(crate) fn mask<'s>(name: &str, skin: &'s Component) -> Result<Option<&'s [f32]>> {
    if name.is_empty() {
        return Ok(None);
    }
    if let Some(mask) = skin.table(Owner::Point).get(name) {
        return Ok(Some(mask));
    }
    let what = skin.describe(name).map_or("which `skin` does not have".into(), |found| format!("which is {found}"));
    Err(Error::refused(format!("`mask` is `{name}`, {what}")).hint("expected one float for each vertex"))
}

/// The skin at the scene's first frame.
///
/// # Errors
/// Where its faces have changed since.
pub(crate) fn kept_faces<'c>(rest: &'c Component, now: &Component) -> Result<&'c Component> {
    if super::faces::same_faces(rest, now) {
        return Ok(rest);
    }
    let [now, rest] = [now, rest].map(|mesh| (mesh.element_count(), mesh.point_count()));
    let fact = format!(
        "`skin` has {} faces and {} points, at the scene's first frame {} and {}, or their topology differs",
        now.0, now.1, rest.0, rest.1
    );
    Err(Error::refused(fact).hint("the skin may move, but must keep its faces"))
}

/// Whether both share one array of rows, or neither has any.
pub(crate) fn same_rows(a: &Component, b: &Component, name: &str) -> bool {
    match (a.table(Owner::Point).column(name), b.table(Owner::Point).column(name)) {
        (Some(a), Some(b)) => a.same(b),
        (None, None) => true,
        _ => false,
    }
}

/// The skin's `rows` interpolated at each root, for all CVs of its curve.
pub(crate) fn at_roots<'s>(
    rows: &[[f32; 3]],
    triangles: &[[u32; 3]],
    spots: impl Iterator<Item = &'s Spot>,
    cvs: usize,
) -> Vec<[f32; 3]> {
    let at = |spot: &Spot| {
        let corners = triangles[spot.triangle as usize].map(|corner| rows[corner as usize].map(f64::from));
        spot.mix(corners).map(|x| x as f32)
    };
    spots.flat_map(|spot| std::iter::repeat_n(at(spot), cvs)).collect()
}
