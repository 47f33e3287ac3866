//! Surface_Tag: attributes of points, such as texture coordinates and colours, on the vertices of a liquid's surface.
//!
//! A liquid's surface is a new mesh at every frame, so what it looks like has to ride on points that the liquid carries.
//! Interpolation is by moving least squares ([`liquid::tag`]); where surface and points have normals, a vertex takes its
//! values from points of its own side, which a thin sheet needs. FluidSolve's markers are such points; its spray is left out,
//! as it carries nothing but its volume.

use std::sync::Arc;

use engine::prelude::*;
use liquid::tag::{TagSource, TagValues};

use crate::shared::attributes::{
    PARTICLE_KIND, PARTICLE_MARKER, PARTICLE_SPRAY, PARTICLE_TRACER, absent, flat, rows_of,
};

inputs! { INPUTS:
    SURFACE: Input = Input::one("surface", Kind::Mesh, "The mesh that gets the attributes, such as `surface` of \
        FluidSolve or a Fluid_Surface. If the mesh has `N`, a vertex takes values only from points that face the same \
        way.");
    REFERENCE: Input = Input::one("reference", Kind::Points, "The points that have the attributes, such as `particles` of \
        FluidSolve.");
}

choice! {
    /// Which of the reference points count.
    enum ReferencePoints {
        All = "all": "all points except spray",
        Markers = "markers": "markers on the surface, `kind` 0, which carry the attributes of `liquid` and `sources`",
        Tracers = "tracers": "tracers, `kind` 3, which carry the attributes of `tracers`",
    }
}

params! { PARAMS:
    RADIUS: Param<f32> = Param::float("radius", 0.0,
        "Distance within which points count, less the farther away they are. Larger is smoother and slower. 0 uses about \
         twice the spacing of the points.").unit(Unit::Metres).at_least(0.0).soft(0.0, 0.1);
    ATTRIBUTES: Param<Arc<Vec<Name>>> = Param::texts("attributes", &["uvw"],
        "Names of the attributes to transfer, of one, three or four floats each, such as [\"uvw\", \"Cd\"].").fixed();
    POINTS: Param<ReferencePoints> = Param::choice("points", ReferencePoints::All,
        "Which points of FluidSolve's `particles` count. Choose the kind that carries your attributes; points of other \
         kinds have 0 there, or white for `Cd`. \"tracers\" needs points at `tracers` of FluidSolve. Points without \
         `kind` all count.");
}

const TAGGED: Output = Output::like(
    "surface",
    &SURFACE,
    "The mesh with the attributes, and with `Pref`, taken from the points' `Pref`, or from their positions if they have \
    none.",
);

metrics! { METRICS:
    UNTAGGED_VERTICES = Metric::new("untagged_vertices", Unit::None,
        "Vertices with no point within the radius that faces their way; they get the values of the nearest point.")
        .warn_above(0.0, "These vertices have no point of their side within the radius of {tag_radius} m, so they have the \
            values of the nearest point, which may jump from frame to frame; often they lie unseen against a collider. Where \
            it shows, raise `radius`, or give more points there.");
    NO_TRACERS = Metric::new("no_tracers", Unit::None, "1 where `points` asks for tracers and `reference` has none.")
        .warn_above(0.0, "`points` is \"tracers\", but `reference` has none: wire points to `tracers` of FluidSolve, or set `points` to \
            \"markers\". The attributes are 0 meanwhile, or white for `Cd`.");
    TAG_RADIUS = Metric::new("tag_radius", Unit::Metres, "The radius used: `radius`, or if that is 0 the one chosen from \
        the point spacing.");
}

pub(crate) static NODE: Node = Node::new(
    "Surface_Tag",
    1,
    "Transfers attributes such as texture coordinates or colours from points that a liquid carries to the vertices of its \
     surface. Values vary smoothly between the points, and in time as points come and go.",
    Cook::Pure(cook),
)
.inputs(INPUTS)
.params(PARAMS)
.outputs(&[&TAGGED])
.reads(&[&P, &N, &PREF, &PARTICLE_KIND])
.writes(&[&PREF])
.attributes(|params| {
    let names = params.get(ATTRIBUTES);
    [(); 2].map(|()| AttrNames::These(names.to_vec()))
})
.metrics(METRICS);

fn cook(cx: &Cx) -> Result<Outputs> {
    let (mut surface, reference) = (cx.edit(SURFACE), cx.part(REFERENCE));
    let names = cx.get(ATTRIBUTES);
    let columns = names.iter().map(|name| column(name, &surface, reference)).collect::<Result<Vec<&Column>>>()?;
    let counted = counted(reference, cx.get(POINTS));
    let points = picked(&counted, reference.positions());
    let is_without = cx.get(POINTS) == ReferencePoints::Tracers && counted.is_empty();
    cx.publish(NO_TRACERS, f64::from(u8::from(is_without)));
    let normals = reference.get(N).map(|rows| picked(&counted, rows));
    let rest = reference.get(PREF).map_or_else(|| points.clone(), |rows| picked(&counted, rows));
    let picked: Vec<Column> = columns.iter().map(|column| column.gather(&counted)).collect();
    let mut values: Vec<TagValues> = picked.iter().map(|column| values(column)).collect();
    values.push(TagValues { rows: rest.as_flattened(), width: 3 });
    let bytes = values.iter().map(|values| 8.0 * values.width as f64).sum::<f64>() * surface.point_count() as f64;
    cx.reserve(bytes, "take over fewer attributes")?;

    let source = TagSource::new(&points, normals.as_deref());
    let radius = match cx.get(RADIUS) {
        0.0 => source.suitable_radius(),
        radius => f64::from(radius),
    };
    let tagged = source.tag(surface.positions(), surface.get(N), radius, &values);
    let (count, is_empty) = (surface.point_count(), points.is_empty());
    let mut rows = tagged.rows.into_iter();
    for ((name, column), rows) in names.iter().zip(&columns).zip(rows.by_ref()) {
        let width = column.kind().width();
        let rows = if is_empty { absent(name, width).repeat(count) } else { rows };
        if cx.wants_named(name) {
            surface.set_column(Owner::Point, name.clone(), rows_of(width, rows))?;
        }
    }
    if cx.wants(PREF) {
        let rest = rows.next().filter(|_| !is_empty).map(|rows| rows.as_chunks::<3>().0.to_vec());
        let rest = rest.unwrap_or_else(|| surface.positions().to_vec());
        surface.set(PREF, rest)?;
    }
    cx.publish(UNTAGGED_VERTICES, tagged.far as f64);
    cx.publish(TAG_RADIUS, radius);
    Ok(TAGGED.with(surface))
}

/// The column of that name.
///
/// # Errors
/// Where the points have none, or one that cannot be mixed.
fn column<'r>(name: &str, surface: &Component, reference: &'r Component) -> Result<&'r Column> {
    let refused = |fact: String| Error::refused(fact).of(ATTRIBUTES.name()).of_types();
    if name == P.name || name == ORIENT.name {
        let why = if name == P.name {
            "the surface has its own positions"
        } else {
            "rotations cannot be mixed number by number"
        };
        return Err(refused(format!("`attributes` names `{name}`: {why}")).hint("leave it out"));
    }
    if surface.table(Owner::Element).column(name).is_some() {
        let fact = format!("`attributes` names `{name}`, which the faces of `surface` have");
        return Err(refused(fact).hint("two attributes of one name would diverge: give one of them another name"));
    }
    match reference.table(Owner::Point).column(name) {
        Some(column) if column.kind().is_float() => Ok(column),
        _ => {
            let what = match reference.describe(name) {
                Some(found) => format!("which is {found} in `reference`"),
                None => "which `reference` does not have".to_owned(),
            };
            Err(refused(format!("`attributes` names `{name}`, {what}")).hint(point_floats_hint(reference, name)))
        }
    }
}

/// The numbers of the points that count.
fn counted(reference: &Component, which: ReferencePoints) -> Vec<u32> {
    let all = 0..reference.point_count() as u32;
    let Some(kinds) = reference.get(PARTICLE_KIND) else { return all.collect() };
    let counts = |kind: i32| match which {
        ReferencePoints::All => kind != PARTICLE_SPRAY,
        ReferencePoints::Markers => kind == PARTICLE_MARKER,
        ReferencePoints::Tracers => kind == PARTICLE_TRACER,
    };
    all.filter(|n| counts(kinds[*n as usize])).collect()
}

fn picked(counted: &[u32], rows: &[[f32; 3]]) -> Vec<[f32; 3]> {
    counted.iter().map(|n| rows[*n as usize]).collect()
}

fn values(column: &Column) -> TagValues<'_> {
    TagValues { rows: flat(column), width: column.kind().width() }
}

#[cfg(test)]
mod tests;
