//! Distributing roots over a skin, for Curve_Scatter and Curve_Interpolate.

use curves::scatter::ScatterSurface;
use curves::surface::SurfacePoint;
use engine::prelude::*;
use numerics::random::Key;

/// Largest number of CVs: with `Pref` and `uvw` they take 2.4 gigabytes.
const MOST_CVS: f64 = (1_u32 << 26) as f64;

/// Where on the skin few grow.
pub(crate) const MASK: Param<Name> = Param::text(
    "mask",
    "",
    "Name of a point attribute of the skin that multiplies the density: 0 grows nothing, 1 the full density. If empty, there \
     is no mask.",
)
.fixed();

/// How many curves to plant, and where.
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
    /// The roots, ordered by face, each with its index in the infinite sequence of which a higher density takes a
    /// longer prefix.
    ///
    /// # Errors
    /// If there would be more than [`MOST_CVS`] CVs.
    pub(crate) fn roots(&self, cx: &Cx, skin: &Component) -> Result<Vec<(usize, SurfacePoint)>> {
        let whole = skin.triangles();
        let triangles = &whole.corners;
        let share = |corner: u32| self.mask.map_or(1.0, |mask| f64::from(mask[corner as usize]).max(0.0));
        // Triangles where nothing grows are left out, so that a bare plain around a meadow costs nothing.
        let fertile: Vec<u32> = (0..triangles.len() as u32)
            .filter(|triangle| triangles[*triangle as usize].iter().any(|corner| share(*corner) > 0.0))
            .collect();
        let ground: Vec<[u32; 3]> = fertile.iter().map(|triangle| triangles[*triangle as usize]).collect();
        let surface = ScatterSurface::new(skin.positions(), &ground);
        let area = surface.area();
        let most_share = ground.as_flattened().iter().map(|corner| share(*corner)).fold(0.0, f64::max);

        let unmasked = f64::from(self.density) * area;
        let most = (unmasked * most_share).round();
        let cvs = self.cvs as f64;
        if most * cvs > MOST_CVS {
            let [most, area] = [most, area].map(|x| if x < 1e16 { x.to_string() } else { format!("{x:.2e}") });
            let fact = format!("{most} curves of {cvs} CVs would grow on {area} m², more than {MOST_CVS} CVs");
            return Err(Error::refused(fact).hint("lower `density` or `cvs`, or scale the skin to metres"));
        }
        // A root with its index, while they are sorted and turned into shapes, and `P`, `Pref` and `uvw` of each CV.
        const BYTES: [f64; 2] = [192.0, 36.0];
        cx.reserve(most * (BYTES[0] + BYTES[1] * cvs), "lower `density` or `cvs`, or raise --memory")?;
        let roots = surface.spread(most as usize, Key::new(u64::from(self.seed.0)));
        cx.check_cancelled()?;

        let grows = |index: usize, root: &SurfacePoint| {
            let [share] = root.interpolate(ground[root.triangle as usize].map(|corner| [share(corner)]));
            index as f64 + 0.5 < unmasked * share
        };
        let mut roots: Vec<(usize, SurfacePoint)> = roots
            .into_iter()
            .enumerate()
            .filter(|(index, root)| self.mask.is_none() || grows(*index, root))
            .map(|(index, root)| (index, SurfacePoint { triangle: fertile[root.triangle as usize], ..root }))
            .collect();
        roots.sort_unstable_by_key(|(index, root)| (root.triangle, *index));
        Ok(roots)
    }
}

/// The skin's mask of that name; `None` if the name is empty.
///
/// # Errors
/// If the skin has no float attribute of that name on its points.
pub(crate) fn mask<'s>(name: &str, skin: &'s Component) -> Result<Option<&'s [f32]>> {
    if name.is_empty() {
        return Ok(None);
    }
    if let Some(mask) = skin.table(Owner::Point).get(name) {
        return Ok(Some(mask));
    }
    let what = skin.describe(name).map_or("which `skin` does not have".into(), |found| format!("which is {found}"));
    let error = Error::refused(format!("`mask` is `{name}`, {what}")).of("mask").of_types();
    Err(error.hint(point_float_hint(skin, name)))
}

/// The skin at the scene's first frame.
///
/// # Errors
/// If its faces have changed since.
pub(crate) fn kept_faces<'c>(rest: &'c Component, now: &Component) -> Result<&'c Component> {
    if super::faces::same_faces(rest, now) {
        return Ok(rest);
    }
    if super::faces::inside_out(rest, now) {
        return Err(Error::refused(
            "`skin` is mirrored, which turns its faces inside out since the scene's first frame",
        )
        .hint("keep the sign of its animated `scale`, or mirror the output of this node instead"));
    }
    let [now, rest] = [now, rest].map(|mesh| (mesh.element_count(), mesh.point_count()));
    let fact = format!(
        "`skin` has {} faces and {} points, but {} and {} at the scene's first frame, or its topology differs",
        now.0, now.1, rest.0, rest.1
    );
    Err(Error::refused(fact).hint("the skin may move, but must keep its faces"))
}

/// Whether both share the array of a point attribute, or neither has that attribute.
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
    roots: impl Iterator<Item = &'s SurfacePoint>,
    cvs: usize,
) -> Vec<[f32; 3]> {
    let at = |root: &SurfacePoint| {
        let corners = triangles[root.triangle as usize].map(|corner| rows[corner as usize].map(f64::from));
        root.interpolate(corners).map(|x| x as f32)
    };
    roots.flat_map(|root| std::iter::repeat_n(at(root), cvs)).collect()
}

/// Conformance plants curves at any density; on skins a third as wide these are a ninth as many, and as quick.
#[cfg(test)]
pub(crate) fn a_third_as_wide(_: usize, mut geometry: Geometry) -> Geometry {
    for kind in [Kind::Mesh, Kind::Curves] {
        let Some(part) = geometry.part_mut(kind) else { continue };
        for p in part.edit(P).into_iter().flatten() {
            *p = p.map(|x| x / 3.0);
        }
    }
    geometry
}
