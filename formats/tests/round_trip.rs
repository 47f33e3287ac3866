//! What a format can hold is read back bit for bit, for random geometry.

#![allow(clippy::unwrap_used, reason = "a missing value fails the test")]

use engine::geometry::{Column, Component, Geometry, Grid, Item, Kind, Owner, Volume, WIDTH, fixed_type};
use formats::usd::{DEFAULT_WIDTH, Flavour, NoAssets, UsdStage, UsdWriter};
use formats::{Format, FrameStamp, read, write};
use proptest::collection::vec;
use proptest::option;
use proptest::prelude::*;

/// Any finite f32, extremes and both zeros included.
fn number() -> impl Strategy<Value = f32> {
    prop_oneof![
        any::<u32>().prop_map(f32::from_bits).prop_filter("finite", |x| x.is_finite()),
        -10.0..10.0_f32,
        Just(-0.0),
    ]
}

fn numbers<const N: usize>(rows: usize) -> impl Strategy<Value = Vec<[f32; N]>> {
    vec(proptest::array::uniform::<_, N>(number()), rows)
}

fn column(rows: usize) -> impl Strategy<Value = Column> {
    prop_oneof![
        vec(number(), rows).prop_map(Column::new),
        numbers::<3>(rows).prop_map(Column::new),
        numbers::<4>(rows).prop_map(Column::new),
        vec(any::<i32>(), rows).prop_map(Column::new),
        vec(any::<[i32; 3]>(), rows).prop_map(Column::new),
        vec(any::<[i32; 4]>(), rows).prop_map(Column::new),
    ]
}

/// Names with a meaning in a format, names that need escapes, and plain ones.
fn name() -> impl Strategy<Value = String> {
    const KNOWN: [&str; 20] = [
        "mask",
        "st",
        "displayColor",
        "normals",
        "Cd",
        "N",
        "uvw",
        "v",
        "id",
        "width",
        "x",
        "red",
        "vertex_indices",
        "count",
        "s",
        "t",
        "a b",
        "w.0",
        "%",
        "größe",
    ];
    prop_oneof![proptest::sample::select(KNOWN.as_slice()).prop_map(str::to_owned), "[a-z_.%\" ]{0,4}"]
}

/// Sets random attributes whose type is allowed.
fn with_attributes(component: Component) -> impl Strategy<Value = Component> {
    let counts = [component.point_count(), component.element_count(), 1];
    let tables = counts.map(|rows| vec((name(), column(rows)), 0..4));
    tables.prop_map(move |tables| {
        let mut component = component.clone();
        for (owner, table) in Owner::ALL.into_iter().zip(tables) {
            for (name, column) in table {
                let column = match fixed_type(&name) {
                    Some(kind) => Column::zeros(kind, column.len()),
                    None => column,
                };
                if name != "P" && !(component.kind() == Kind::Points && owner == Owner::Element) {
                    component.set_column(owner, name, column).unwrap();
                }
            }
        }
        component
    })
}

fn curves() -> impl Strategy<Value = Component> {
    vec(1..5_u32, 1..6)
        .prop_flat_map(|counts| {
            let points = counts.iter().sum::<u32>() as usize;
            numbers::<3>(points).prop_map(move |positions| Component::curves(counts.clone(), positions).unwrap())
        })
        .prop_flat_map(with_attributes)
}

fn mesh() -> impl Strategy<Value = Component> {
    (1..9_usize, vec(3..6_u32, 1..5))
        .prop_flat_map(|(points, counts)| {
            let corners = vec(0..points as u32, counts.iter().sum::<u32>() as usize);
            (Just(counts), corners, numbers::<3>(points))
        })
        .prop_map(|(counts, corners, positions)| Component::mesh(counts, corners, positions).unwrap())
        .prop_flat_map(with_attributes)
}

fn points() -> impl Strategy<Value = Component> {
    (1..9_usize).prop_flat_map(numbers::<3>).prop_map(Component::points).prop_flat_map(with_attributes)
}

fn tets() -> impl Strategy<Value = Component> {
    (1..9_usize)
        .prop_flat_map(|points| (vec(proptest::array::uniform4(0..points as u32), 0..4), numbers::<3>(points)))
        .prop_map(|(tets, positions)| Component::tets(tets, positions).unwrap())
        .prop_flat_map(with_attributes)
}

/// A volume with separate grids for level set and velocity, and any background.
fn volume() -> impl Strategy<Value = Volume> {
    let grid = || {
        (proptest::array::uniform3(number()), 1e-6..1e6_f32, proptest::array::uniform3(0..4_u32))
            .prop_map(|(origin, cell, size)| Grid { origin, cell, size })
    };
    (grid(), option::of(grid()), 1e-6..1e6_f32).prop_flat_map(|(level, velocity, background)| {
        let velocity = velocity.unwrap_or(level);
        let faces = [0, 1, 2].map(|axis| vec(number(), velocity.faces(axis)));
        let made = (vec(number(), level.cells()), faces);
        made.prop_map(move |(level_set, faces)| {
            let faces = faces.each_ref().map(Vec::as_slice);
            Volume::from_dense(level, &level_set, background, velocity, faces).unwrap()
        })
    })
}

/// Up to three components, at least one.
fn geometry() -> impl Strategy<Value = Geometry> {
    (option::of(curves()), option::of(mesh()), option::of(points())).prop_map(|(curves, mesh, points)| {
        [curves, mesh, points].into_iter().flatten().fold(Geometry::default(), Geometry::with)
    })
}

fn everything() -> impl Strategy<Value = Geometry> {
    (geometry(), option::of(tets()), option::of(volume())).prop_map(|(mut geometry, tets, volume)| {
        tets.into_iter().for_each(|tets| geometry.put(tets));
        volume.into_iter().for_each(|volume| geometry.put_volume(volume));
        geometry
    })
}

/// A component without the attributes that `keep` is false for.
fn trimmed(component: &Component, keep: impl Fn(Owner, &str, &Column) -> bool) -> Component {
    let mut trimmed = component.clone();
    for (owner, name, column) in component.columns() {
        if !keep(owner, name, column) {
            trimmed.remove(owner, name);
        }
    }
    trimmed
}

fn trimmed_geometry(geometry: &Geometry, keep: impl Fn(Owner, &str, &Column) -> bool) -> Geometry {
    geometry.parts().map(|part| trimmed(part, &keep)).fold(Geometry::default(), Geometry::with)
}

fn comes_back(format: Format, geometry: &Geometry) -> Result<(), TestCaseError> {
    let mut bytes = Vec::new();
    write(format, geometry, &FrameStamp { frame: 1.25, seconds: 0.1 }, &mut bytes).unwrap();
    let found = read(format, &bytes).map_err(|error| TestCaseError::fail(error.to_string()))?;
    // `==` treats 0 and -0 as equal; their bits differ.
    for (found, expected) in found.parts().zip(geometry.parts()) {
        for ((_, _, found), (_, name, expected)) in found.columns().zip(expected.columns()) {
            prop_assert_eq!(found.to_bytes(), expected.to_bytes(), "{}", name);
        }
    }
    prop_assert_eq!(&found, geometry);
    let mut again = Vec::new();
    write(format, &found, &FrameStamp { frame: 1.25, seconds: 0.1 }, &mut again).unwrap();
    prop_assert_eq!(again, bytes, "the same geometry gives the same bytes");
    Ok(())
}

fn is_f3(column: &Column) -> bool {
    column.kind() == <[f32; 3]>::TYPE
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn json_holds_everything(geometry in everything()) {
        // The type of an empty column is not written.
        let keep = |_: Owner, _: &str, column: &Column| !column.is_empty();
        let mut trimmed = trimmed_geometry(&geometry, keep);
        if let Some(volume) = geometry.volume() {
            trimmed.put_volume(volume.clone());
        }
        comes_back(Format::Json, &trimmed)?;
    }

    #[test]
    fn ply_holds_one_component_except_attributes_of_the_whole(
        component in prop_oneof![curves(), mesh(), points()]
    ) {
        let keep = |owner: Owner, _: &str, _: &Column| owner != Owner::Once;
        comes_back(Format::Ply, &trimmed(&component, keep).into())?;
    }

    #[test]
    fn ply_holds_several_components_and_their_common_point_attributes(geometry in geometry()) {
        let parts: Vec<Component> = geometry.parts().cloned().collect();
        let everywhere = |name: &str, column: &Column| parts.iter().all(|part| {
            part.table(Owner::Point).column(name).is_some_and(|other| other.kind() == column.kind())
        });
        let keep = |owner: Owner, name: &str, column: &Column| match owner {
            Owner::Point => everywhere(name, column),
            Owner::Element => true,
            Owner::Once => false,
        };
        comes_back(Format::Ply, &trimmed_geometry(&geometry, keep))?;
    }

    #[test]
    fn obj_holds_one_component_with_normals_textures_and_colours(
        component in prop_oneof![curves(), mesh(), points()]
    ) {
        let keep = |owner: Owner, name: &str, column: &Column| {
            owner == Owner::Point && ["P", "N", "uvw", "Cd"].contains(&name) && is_f3(column)
        };
        comes_back(Format::Obj, &trimmed(&component, keep).into())?;
    }

    #[test]
    fn obj_holds_several_components(curves in curves(), points in points(), count in 3..6_u32) {
        let keep = |owner: Owner, name: &str, column: &Column| {
            owner == Owner::Point && ["P", "Cd"].contains(&name) && is_f3(column)
        };
        let corners = (0..count).collect();
        let mesh = Component::mesh(vec![count], corners, vec![[1.0, -0.0, 0.5]; count as usize]).unwrap();
        let geometry = Geometry::default().with(trimmed(&curves, keep)).with(mesh).with(trimmed(&points, keep));
        comes_back(Format::Obj, &geometry)?;
    }
}

#[test]
fn a_mesh_without_a_face_is_a_mesh_in_ply_and_points_in_obj() {
    let geometry: Geometry = Component::mesh(Vec::new(), Vec::new(), vec![[1.0; 3]]).unwrap().into();
    let back = |format| {
        let mut bytes = Vec::new();
        write(format, &geometry, &FrameStamp { frame: 1.0, seconds: 0.0 }, &mut bytes).unwrap();
        read(format, &bytes).unwrap()
    };
    assert_eq!(back(Format::Ply), geometry);
    assert_eq!(back(Format::Obj), Component::points(vec![[1.0; 3]]).into());
}

#[test]
fn components_that_a_format_cannot_hold_are_refused() {
    let tets: Geometry = Component::tets(Vec::new(), Vec::new()).unwrap().into();
    let fault = |format, geometry: &Geometry| {
        write(format, geometry, &FrameStamp { frame: 1.0, seconds: 0.0 }, &mut Vec::new()).unwrap_err()
    };
    assert_eq!(fault(Format::Obj, &tets).to_string(), "obj cannot hold tets");
    assert_eq!(fault(Format::Ply, &tets).hint().unwrap(), "formats that can: usdc, usda, json");
    let message = "usdc keeps all frames in one file, expected a format with one file per frame";
    assert_eq!(fault(Format::Usdc, &Geometry::default()).to_string(), message);
    let nan: Geometry = Component::points(vec![[f32::NAN, 0.0, 0.0]]).into();
    for format in [Format::Obj, Format::Ply, Format::Json] {
        assert_eq!(fault(format, &nan).to_string(), "`P` of points is not finite in row 0");
    }
}

/// USD on disk and back, at each of two frames; curves get widths, as the file has them.
fn comes_back_from_usd(flavour: Flavour, geometry: &Geometry) -> Result<(), TestCaseError> {
    let mut geometry = geometry.clone();
    if let Some(curves) = geometry.part_mut(Kind::Curves)
        && curves.get(WIDTH).is_none()
    {
        let rows = vec![DEFAULT_WIDTH; curves.point_count()];
        curves.set(WIDTH, rows).unwrap();
    }
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.usd");
    let mut writer = UsdWriter::create(&path, flavour, "a", 24.0, [0.0; 3]).unwrap();
    writer.frame(1.0, &geometry).unwrap();
    writer.frame(2.0, &geometry).unwrap();
    writer.finish().unwrap();
    let stage = UsdStage::open(std::fs::read(&path).unwrap().into(), NoAssets);
    let stage = stage.map_err(|error| TestCaseError::fail(error.to_string()))?;
    prop_assert!(!stage.moves("").unwrap());
    for time in [1.0, 1.5, 2.0] {
        let found = stage.read("/a", time, &|_| true).map_err(|error| TestCaseError::fail(error.to_string()))?;
        prop_assert_eq!(&found.notes, &Vec::<String>::new());
        for (found, expected) in found.geometry.parts().zip(geometry.parts()) {
            for ((_, _, found), (_, name, expected)) in found.columns().zip(expected.columns()) {
                prop_assert_eq!(found.to_bytes(), expected.to_bytes(), "{}", name);
            }
        }
        prop_assert_eq!(&found.geometry, &geometry);
    }
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn usd_holds_everything_but_volumes(geometry in everything(), is_text in any::<bool>()) {
        // Without a row, an attribute is its name alone.
        let keep = |_: Owner, _: &str, column: &Column| !column.is_empty();
        let flavour = if is_text { Flavour::Usda } else { Flavour::Usdc };
        comes_back_from_usd(flavour, &trimmed_geometry(&geometry, keep))?;
    }
}
