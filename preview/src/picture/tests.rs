use super::*;
use crate::{Clip, Framing, attribute_range, bounds};
use engine::geometry::{Column, Component, Geometry, Grid, Owner, Volume};
use numerics::vector::length;

/// Something of every kind, all within a few metres: a bent sheet, a tuft, balls, tets, a drop.
fn still_life(scale: f32) -> Geometry {
    let at = |x: f32, y: f32, z: f32| [x * scale, y * scale, z * scale];
    let sheet = (0..81).map(|k| {
        let (x, z) = ((k % 9) as f32 * 0.25, (k / 9) as f32 * 0.25);
        at(x, 0.25 * x * z, z)
    });
    let cell = |k: u32| [k, k + 9, k + 10, k + 1];
    let quads: Vec<u32> = (0..72).filter(|k| k % 9 < 8).flat_map(cell).collect();
    let tuft = (0..300).map(|k| at((k / 5) as f32 * 0.03125, 0.5 + (k % 5) as f32 * 0.25, (k % 7) as f32 * 0.0625));
    let balls: Vec<_> = (0..30).map(|k| at(1.0 + (k % 5) as f32 * 0.125, 1.5, (k / 5) as f32 * 0.125)).collect();
    let tet = vec![at(-1.0, 0.0, 0.0), at(-0.5, 0.0, 0.0), at(-1.0, 1.0, 0.0), at(-1.0, 0.0, 0.5)];
    let mut tuft = Component::curves(vec![5; 60], tuft.collect()).unwrap();
    tuft.set_column(Owner::Element, "heat", Column::new((0..60).collect::<Vec<i32>>())).unwrap();
    let mut all = Geometry::from(tuft)
        .with(Component::mesh(vec![4; 64], quads, sheet.collect()).unwrap())
        .with(Component::points(balls))
        .with(Component::tets(vec![[0, 1, 2, 3]], tet).unwrap());
    let grid = Grid { origin: at(0.0, 2.0, 0.0), cell: 0.125 * scale, size: [6; 3] };
    let from_middle = |k: usize| (length([k % 6, k / 6 % 6, k / 36].map(|i| i as f32 - 2.5)) - 2.0) * grid.cell;
    let drop =
        Volume::new(grid, (0..216).map(from_middle).collect(), [0, 1, 2].map(|axis| vec![1.0; grid.faces(axis)]));
    all.put_volume(drop.unwrap());
    all
}

fn small() -> PictureSettings {
    PictureSettings { width: 160, height: 120, names: false, ..PictureSettings::default() }
}

fn picture(geometry: &Geometry, settings: &PictureSettings) -> Image {
    render(&[Layer::new("one", geometry)], settings).unwrap()
}

#[test]
fn any_number_of_threads_gives_the_same_bits() {
    let geometry = still_life(1.0);
    let settings = PictureSettings { color_by: Some("heat".into()), note: Some("still life".into()), ..small() };
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| [picture(&geometry, &small()), picture(&geometry, &settings)])
    };
    let one = on(1);
    assert_eq!(one, on(2));
    assert_eq!(one, on(7));
}

#[test]
fn a_scene_at_any_scale_is_the_same_picture() {
    let there = picture(&still_life(1.0), &small());
    assert_eq!(there, picture(&still_life(1024.0), &small()));
    assert_eq!(there, picture(&still_life(1.0 / 1024.0), &small()));
}

#[test]
fn an_empty_scene_is_the_backdrop() {
    let empty = render(&[], &small()).unwrap();
    assert_eq!(empty, picture(&Geometry::default(), &small()));
    assert_eq!(empty, picture(&Component::points(vec![]).into(), &small()));
    assert!(empty.pixels().iter().flatten().all(|byte| *byte > 140));
}

#[test]
fn an_object_is_visible_in_the_middle_and_its_shadow_beside_it() {
    let geometry = Geometry::from(Component::points(vec![[0.0, 0.5, 0.0]]));
    let settings =
        PictureSettings { point_width: Some(1.0), bounds: Some([[-0.5, 0.0, -0.5], [0.5, 1.0, 0.5]]), ..small() };
    let (empty, ball) = (render(&[], &settings).unwrap(), picture(&geometry, &settings));
    let at = |image: &Image, x: usize, y: usize| image.pixels()[y * 160 + x];
    assert!(at(&ball, 80, 60)[2] > at(&ball, 80, 60)[0]);
    assert_eq!(at(&ball, 2, 2), at(&empty, 2, 2));
    let darker = |x: usize, y: usize| at(&ball, x, y)[1] + 20 < at(&empty, x, y)[1];
    assert!((0..160).any(|x| darker(x, 95)));
    let bare = picture(&geometry, &PictureSettings { ground: false, ..settings });
    assert!((120..160).all(|x| at(&bare, x, 95) == at(&empty, x, 95)));
}

#[test]
fn any_geometry_gives_a_picture() {
    let values = [0.0, 1.0, -1.0, 1e-30, 1e30, -3e38, f32::NAN, f32::INFINITY];
    let points: Vec<[f32; 3]> = (0..512).map(|k| [values[k % 8], values[k / 8 % 8], values[k / 64]]).collect();
    let corners: Vec<u32> = (0..510).chain((0..510).map(|k| k * 37 % 512)).collect();
    let mut curves = Component::curves(vec![4; 128], points.clone()).unwrap();
    curves
        .set_column(Owner::Point, "width", Column::new((0..512).map(|k| values[k % 8]).collect::<Vec<f32>>()))
        .unwrap();
    let geometry = Geometry::from(curves)
        .with(Component::mesh([vec![3; 170], vec![255; 2]].concat(), corners, points.clone()).unwrap())
        .with(Component::tets((0..128).map(|k| [k, k * 2, k * 3, k * 4 % 512]).collect(), points.clone()).unwrap())
        .with(Component::points(points));
    let camera = |text: &str| Some(text.parse().unwrap());
    for settings in [
        small(),
        PictureSettings { bounds: Some([[0.0; 3], [1.0; 3]]), ..small() },
        PictureSettings { bounds: Some([[f32::NAN; 3]; 2]), ..small() },
        PictureSettings {
            bounds: Some([[1.0; 3], [-1.0; 3]]),
            camera: camera("eye=0,0,0 target=1e-20,0,0"),
            ..small()
        },
        PictureSettings {
            bounds: Some([[0.0; 3], [1.0; 3]]),
            camera: camera("eye=1e300,0,0 target=-1e300,0,0"),
            ..small()
        },
        PictureSettings {
            color_by: Some("P".into()),
            curve_width: Some(f32::INFINITY),
            point_width: Some(-1.0),
            ..small()
        },
        PictureSettings { color_by: Some("width".into()), range: Some([f32::NAN, f32::INFINITY]), ..small() },
        PictureSettings { width: 1, height: 1, ..small() },
        PictureSettings { width: 1000, height: 1, ..small() },
    ] {
        picture(&geometry, &settings);
    }
}

#[test]
fn only_labels_change_when_names_and_a_note_are_written() {
    let geometry = still_life(1.0);
    let quiet = picture(&geometry, &small());
    let named = picture(&geometry, &PictureSettings { names: true, ..small() });
    let noted = picture(&geometry, &PictureSettings { note: Some("one".into()), ..small() });
    let changed = |image: &Image| {
        let differ = image.pixels().iter().zip(quiet.pixels()).enumerate().filter(|(_, (a, b))| a != b);
        differ.map(|(k, _)| [k % 160, k / 160]).collect::<Vec<_>>()
    };
    let [name, note] = [changed(&named), changed(&noted)];
    assert!(name.iter().all(|[x, y]| *x < 40 && *y < 20) && !name.is_empty());
    assert_eq!(name.len(), note.len());
}

#[test]
fn a_picture_without_pixels_is_an_error() {
    let error = render(&[], &PictureSettings { width: 0, ..small() }).unwrap_err();
    assert_eq!(error.to_string(), "the picture is 0 × 120 pixels, expected 1 to 268435456 in all");
}

#[test]
fn a_fixed_range_keeps_colors_between_frames() {
    let geometry = still_life(1.0);
    let layers = [Layer::new("one", &geometry)];
    let range = attribute_range(&layers, "heat");
    assert_eq!(range, Some([0.0, 59.0]));
    let by_heat = PictureSettings { color_by: Some("heat".into()), ..small() };
    let own = picture(&geometry, &by_heat);
    assert_eq!(own, picture(&geometry, &PictureSettings { range, ..by_heat.clone() }));
    assert_ne!(own, picture(&geometry, &PictureSettings { range: Some([0.0, 600.0]), ..by_heat.clone() }));
    // The default bounds are those that a caller would give for one frame.
    assert_eq!(own, picture(&geometry, &PictureSettings { bounds: bounds(&layers), ..by_heat }));
}

#[test]
fn an_unknown_attribute_is_grey_without_a_legend() {
    let geometry = still_life(1.0);
    let image = picture(&geometry, &PictureSettings { color_by: Some("cold".into()), ..small() });
    let quiet = picture(&geometry, &PictureSettings { color_by: Some("cold".into()), legend: false, ..small() });
    assert_eq!(image, quiet);
    let color = |pixel: &[u8; 3]| pixel.iter().max().unwrap() - pixel.iter().min().unwrap();
    assert!(image.pixels().iter().all(|pixel| color(pixel) < 30));
}

/// A cube from 0 to 1, counter-clockwise seen from outside, in one colour.
fn cube(color: [f32; 3]) -> Geometry {
    let corners = (0..8).map(|bits| [0, 1, 2].map(|k| (bits >> k & 1) as f32)).collect();
    let quads = vec![0, 4, 6, 2, 1, 3, 7, 5, 0, 1, 5, 4, 2, 6, 7, 3, 0, 2, 3, 1, 4, 5, 7, 6];
    let mut mesh = Component::mesh(vec![4; 6], quads, corners).unwrap();
    mesh.set_column(Owner::Once, "Cd", Column::new(vec![color])).unwrap();
    mesh.into()
}

/// Columns and rows of the picture from the first to the last in which a pixel differs from the backdrop.
fn covered(layers: &[Layer<'_>], settings: &PictureSettings) -> [usize; 2] {
    let bare = PictureSettings { ground: false, ..settings.clone() };
    let (image, empty) = (render(layers, &bare).unwrap(), render(&[], &bare).unwrap());
    let differ = (0..160 * 120).filter(|k| image.pixels()[*k] != empty.pixels()[*k]);
    let [columns, rows]: [Vec<usize>; 2] =
        [differ.clone().map(|k| k % 160).collect(), differ.map(|k| k / 160).collect()];
    [columns, rows].map(|at| at.iter().max().unwrap() + 1 - at.iter().min().unwrap())
}

#[test]
fn a_framed_subject_fills_the_panel_in_width_or_height() {
    for (geometry, widest) in [(still_life(1.0), 1.0), (still_life(1e-3), 1.0), (cube([0.5; 3]), 0.9)] {
        let layers = [Layer::new("one", &geometry)];
        let mut framing = Framing::new(160, 120, None);
        framing.add(&layers);
        let settings = PictureSettings { camera: Some(framing.camera()), bounds: framing.bounds(), ..small() };
        let [columns, rows] = covered(&layers, &settings);
        let most = (columns as f64 / 160.0).max(rows as f64 / 120.0);
        assert!((0.70..widest).contains(&most), "{columns} × {rows}");
    }
}

#[test]
fn a_bright_color_keeps_its_shading_and_hue_in_full_light() {
    let white = picture(&cube([1.0; 3]), &PictureSettings { background: [0; 3], ground: false, ..small() });
    assert!(white.pixels().iter().flatten().all(|byte| *byte < 253));
    let shades = white.pixels().iter().map(|pixel| pixel[1]).filter(|byte| *byte > 60);
    assert!(shades.clone().max() > shades.min().map(|darkest| darkest + 40));
    let orange = picture(&cube([1.0, 0.5, 0.0]), &PictureSettings { background: [0; 3], ground: false, ..small() });
    let lit = orange.pixels().iter().filter(|pixel| pixel[0] > 200);
    assert!(lit.clone().count() > 500 && lit.clone().all(|pixel| pixel[1] < 200 && pixel[2] < 60));
}

#[test]
fn a_cut_cube_shows_a_flat_face_in_its_colour() {
    let settings = PictureSettings { clip: Some(Clip { axis: 0, value: 0.5 }), ..small() };
    let image = picture(&cube([0.2, 0.4, 0.1]), &settings);
    let flat = encode([0.2, 0.4, 0.1]);
    let faces = image.pixels().iter().filter(|pixel| **pixel == flat).count();
    assert!(faces > 1000, "{faces}");
    let whole = picture(&cube([0.2, 0.4, 0.1]), &small());
    assert!(whole.pixels().iter().filter(|pixel| **pixel == flat).count() < 50);
    // Nothing of it is beyond the plane, and curves and points go by their root.
    let beyond = PictureSettings { clip: Some(Clip { axis: 0, value: -1.0 }), ground: false, ..small() };
    assert_eq!(picture(&cube([0.5; 3]), &beyond), render(&[], &beyond).unwrap());
    let balls = Geometry::from(Component::points(vec![[0.25; 3], [0.75; 3]]));
    assert_ne!(picture(&balls, &settings), picture(&balls, &small()));
}

#[test]
fn guides_are_lines_without_shadow() {
    let geometry = cube([0.5; 3]);
    let line = Component::curves(vec![2], vec![[0.0, 1.5, 0.0], [1.0, 1.5, 1.0]]).unwrap();
    let wire = Geometry::from(line);
    let bounds = Some([[0.0; 3], [1.0, 2.0, 1.0]]);
    let settings = PictureSettings { bounds, names: true, ..small() };
    let draw = |layers: &[Layer<'_>]| render(layers, &settings).unwrap();
    let (without, with) =
        (draw(&[Layer::new("c", &geometry)]), draw(&[Layer::new("c", &geometry), Layer::guide("", &wire)]));
    let differ = without.pixels().iter().zip(with.pixels()).filter(|(a, b)| a != b);
    assert!((10..300).contains(&differ.clone().count()));
    assert!(differ.clone().all(|(a, b)| b[0] <= a[0]), "a guide darkens");
}

#[test]
fn a_color_attribute_and_the_wind_are_shown_in_words() {
    let settings = PictureSettings { width: 320, height: 240, names: true, ..small() };
    let geometry = cube([0.5; 3]);
    let captions = caption(&[Layer { color: Some([1.0; 3]), ..Layer::new("box", &geometry) }], &settings);
    let texts: Vec<_> = captions.iter().map(|phrase| (phrase.color, phrase.text.as_str())).collect();
    assert_eq!(texts, [(None, "box"), (None, "coloured by Cd")]);
    let still = picture(&geometry, &settings);
    let windy = picture(&geometry, &PictureSettings { wind: Some([1.0, 0.0, 0.0]), ..settings });
    let changed = still.pixels().iter().zip(windy.pixels()).enumerate().filter(|(_, (a, b))| a != b);
    assert!(changed.clone().count() > 80);
    assert!(changed.map(|(k, _)| [k % 320, k / 320]).all(|[x, y]| x > 240 && y > 170));
}
