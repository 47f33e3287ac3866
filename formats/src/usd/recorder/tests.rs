//! Which values become defaults, samples, empty arrays or blocks, and what is refused.

use std::sync::Arc;

use engine::geometry::{Grid, ID, N, Owner, P, V, Volume, WIDTH};

use super::*;
use crate::usd::stage::UsdType;

/// An encoder that stores nothing: a handle is the number of its array. Returns the stage as lines.
#[derive(Default)]
struct Listing {
    rows: Vec<usize>,
    fails: bool,
}

impl Encoder<Vec<String>> for Listing {
    fn store(&mut self, _: UsdType, rows: &Column) -> io::Result<Handle> {
        if self.fails {
            return Err(io::ErrorKind::StorageFull.into());
        }
        self.rows.push(rows.len());
        Ok(Handle(self.rows.len() as u64 - 1))
    }

    /// `prim.attribute: rows of the default`, or `= rows at each time`, a block as `-`.
    fn finish(self: Box<Self>, stage: &Stage) -> io::Result<Vec<String>> {
        let rows = |handle: &Handle| match *handle {
            Handle::BLOCK => "-".to_owned(),
            Handle(number) => self.rows[number as usize].to_string(),
        };
        let line = |prim: &Prim, attribute: &Attribute| {
            let values = match &attribute.values {
                Values::Default(handle) => format!(": {}", rows(handle)),
                Values::Samples(handles) => {
                    format!(" = {}", handles.iter().map(rows).collect::<Vec<_>>().join(" "))
                }
            };
            let display_name = attribute.display_name.as_ref().map(|name| format!(" ({name})")).unwrap_or_default();
            format!("{}.{}{display_name}{values}", prim.name, attribute.name)
        };
        let lines = stage
            .groups
            .iter()
            .flat_map(|group| &group.prims)
            .flat_map(|prim| prim.attributes.iter().map(move |a| line(prim, a)));
        Ok(lines.collect())
    }
}

fn recorder() -> Recorder<Vec<String>> {
    Recorder::new(
        Box::new(Listing::default()),
        Header { name: "fur".into(), fps: 24.0, origin: [0.0; 3], members: Vec::new() },
    )
}

fn recorded(frames: &[Geometry]) -> (Vec<String>, Counts) {
    let mut recorder = recorder();
    for (time, geometry) in (1_u32..).zip(frames) {
        recorder.frame(time.into(), &[geometry]).unwrap();
    }
    recorder.finish().unwrap()
}

fn curve(x: f32) -> Component {
    Component::curves(vec![2], vec![[0.0; 3], [x, 1.0, 0.0]]).unwrap()
}

#[test]
fn unchanged_values_are_stored_once_without_samples() {
    let (lines, counts) = recorded(&[curve(0.0).into(), curve(0.0).into(), curve(0.0).into()]);
    assert_eq!(lines, ["curves.curveVertexCounts: 1", "curves.extent: 2", "curves.points: 2", "curves.widths: 1"]);
    assert_eq!(counts, Counts { frames: 3, stored: 4, shared: 6 });
    let (lines, counts) = recorded(&[curve(0.0).into(), curve(0.0).into(), curve(-0.0).into()]);
    assert_eq!(lines[0], "curves.curveVertexCounts: 1");
    assert_eq!(lines[2], "curves.points = 2 2 2", "a sign is a change, and then every frame has a sample");
    assert_eq!(counts.stored, 5, "the extent of 0 and of -0 is the same");
}

#[test]
fn a_frame_without_the_component_has_no_rows_and_one_without_the_attribute_no_value() {
    let mut full = curve(0.0);
    full.set(WIDTH, vec![0.1; 2]).unwrap();
    full.set_column(Owner::Element, "shielded", Column::new(vec![0.5_f32])).unwrap();
    full.set_column(Owner::Once, "mass", Column::new(vec![0.5_f32])).unwrap();
    let none = Geometry::default;
    let (lines, _) = recorded(&[none(), curve(0.0).into(), full.into(), none()]);
    assert_eq!(
        lines,
        [
            "curves.curveVertexCounts = 0 1 1 0",
            "curves.extent = 2 2 2 2",
            "curves.points = 0 2 2 0",
            "curves.widths = 0 2 2 0",
            "curves.primvars:shielded = 0 - 1 0",
            "curves.primvars:mass = - - 1 -",
        ]
    );
}

#[test]
fn curves_without_widths_get_one_for_all_or_one_for_each_cv_where_other_frames_have_them() {
    let with = |widths: bool, cvs: u32| {
        let mut part = Component::curves(vec![cvs], vec![[0.0; 3]; cvs as usize]).unwrap();
        if widths {
            part.set(WIDTH, vec![0.1; cvs as usize]).unwrap();
        }
        Geometry::from(part)
    };
    let widths = |frames: &[Geometry]| {
        let lines = recorded(frames).0;
        lines.into_iter().filter(|line| line.contains("widths")).collect::<Vec<_>>()
    };
    assert_eq!(widths(&[with(false, 2), Geometry::default(), with(false, 3)]), ["curves.widths: 1"]);
    assert_eq!(widths(&[with(true, 2), with(false, 2), with(false, 3)]), ["curves.widths = 2 2 3"]);
    assert_eq!(widths(&[with(false, 2), Geometry::default(), with(true, 3)]), ["curves.widths = 2 0 3"]);
    assert_eq!(widths(&[Component::points(vec![[0.0; 3]]).into()]), [""; 0]);
}

#[test]
fn velocities_have_the_same_samples_as_points() {
    let with_v = |x: f32, v: f32| {
        let mut part = curve(x);
        part.set(V, vec![[v, 0.0, 0.0]; 2]).unwrap();
        Geometry::from(part)
    };
    let of = |frames: [Geometry; 2]| recorded(&frames).0[2..4].join(", ");
    assert_eq!(of([with_v(0.0, 1.0), with_v(1.0, 1.0)]), "curves.points = 2 2, curves.velocities = 2 2");
    assert_eq!(of([with_v(0.0, 1.0), with_v(0.0, 2.0)]), "curves.points = 2 2, curves.velocities = 2 2");
    assert_eq!(of([with_v(0.0, 1.0), with_v(0.0, 1.0)]), "curves.points: 2, curves.velocities: 2");
}

#[test]
fn topology_that_changes_is_sampled() {
    let line = |cvs: u32| Geometry::from(Component::curves(vec![cvs], vec![[0.0; 3]; cvs as usize]).unwrap());
    let (lines, _) = recorded(&[line(2), line(3), line(3)]);
    assert_eq!(lines[0], "curves.curveVertexCounts = 1 1 1");
    assert_eq!(lines[2], "curves.points = 2 3 3");
}

#[test]
fn names_become_distinct_identifiers_and_are_kept_as_display_names() {
    let mut part = curve(0.0);
    part.set(ID, vec![1, 2]).unwrap();
    part.set(N, vec![[0.0; 3]; 2]).unwrap();
    for owner in [Owner::Point, Owner::Element] {
        let rows = part.table(owner).rows();
        part.set_column(owner, "a-b", Column::zeros(ColumnType::F1, rows)).unwrap();
    }
    let (lines, _) = recorded(&[part.into()]);
    let expected = [
        "curves.normals: 2",
        "curves.points: 2",
        "curves.primvars:a_b (a-b): 2",
        "curves.primvars:curve_id (id): 2",
        "curves.primvars:a_b_2 (a-b): 1",
        "curves.widths: 1",
    ];
    assert_eq!(lines[2..], expected);
}

#[test]
fn a_refused_frame_gives_a_reason_and_changes_nothing() {
    let mut recorder = recorder();
    let mut refused = |time: f64, geometry: Geometry| recorder.frame(time, &[&geometry]).unwrap_err().to_string();
    assert_eq!(refused(f64::NAN, curve(0.0).into()), "the frame number is NaN, expected a finite number");
    let grid = Grid { origin: [0.0; 3], cell: 0.1, size: [0; 3] };
    let volume = Volume::new(grid, vec![], [vec![], vec![], vec![]]).unwrap();
    let mut with_volume = Geometry::from(curve(0.0));
    with_volume.put_volume(Arc::new(volume));
    assert_eq!(refused(1.0, with_volume), "frame 1 has a `volume`, which usda and usdc cannot hold; json can");
    let mut part = curve(0.0);
    part.set_column(Owner::Point, "mask", Column::zeros(ColumnType::F1, 2)).unwrap();
    recorder.frame(1.0, &[&part.clone().into()]).unwrap();
    let mut refused = |time: f64, geometry: Geometry| recorder.frame(time, &[&geometry]).unwrap_err().to_string();
    assert_eq!(refused(1.0, part.clone().into()), "frame 1 follows frame 1, expected frames in ascending order");
    part.set_column(Owner::Point, "mask", Column::zeros(ColumnType::F3, 2)).unwrap();
    assert_eq!(
        refused(2.5, part.into()),
        "`mask` of `curves` is float3 at frame 2.5 and was float before; a USD attribute has one type in all frames"
    );
    recorder.frame(2.0, &[&curve(0.0).into()]).unwrap();
    assert_eq!(recorder.finish().unwrap().0[3], "curves.primvars:mask = 2 -");
}

#[test]
fn after_a_failed_write_every_call_fails() {
    let header = Header { name: "fur".into(), fps: 24.0, origin: [0.0; 3], members: Vec::new() };
    let mut recorder = Recorder::new(Box::new(Listing { rows: vec![], fails: true }), header);
    assert!(matches!(recorder.frame(1.0, &[&curve(0.0).into()]), Err(Fault::Write(_))));
    assert!(recorder.frame(2.0, &[&Geometry::default()]).is_err());
    assert_eq!(recorder.finish().unwrap_err().to_string(), "an earlier frame could not be written");
}

#[test]
fn every_array_is_held_by_the_recorder_only_until_the_next_frame() {
    let mut recorder = recorder();
    let first = curve(0.0);
    let positions = || first.table(Owner::Point).column(P.name).unwrap();
    let Column::F3(array) = positions() else { panic!("positions are float3") };
    recorder.frame(1.0, &[&first.clone().into()]).unwrap();
    assert!(Arc::strong_count(array) > 1);
    recorder.frame(2.0, &[&curve(1.0).into()]).unwrap();
    assert_eq!(Arc::strong_count(array), 1);
}
