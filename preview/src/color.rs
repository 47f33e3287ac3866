//! Colour: linear light and bytes, the colour map of attributes, and the colours of a component.
//!
//! Colours are linear light with the primaries of sRGB; a picture's bytes are sRGB. Guarantees: the colour map's
//! lightness rises evenly, so that the order of values is visible in print and with colour blindness. Limit: a colour
//! attribute is taken as linear and clamped to 0…1.

use std::collections::BTreeSet;
use std::sync::LazyLock;

use engine::geometry::{Column, Component, Geometry, Owner};

use crate::Layer;
use crate::shape::level_set;
use crate::vector::mix;
use numerics::vector::{Vec3, length};

/// Attributes that are colours by their name, if they have three or four components; the first that exists is drawn.
const COLOR_NAMES: [&str; 3] = ["Cd", "color", "displayColor"];
/// Colour of values that are not finite: no colour map and no default has it.
const NOT_A_NUMBER: Vec3 = [1.0, 0.0, 0.6];
/// Colour of components that lack the displayed attribute.
const WITHOUT: Vec3 = [0.30, 0.30, 0.31];

/// Viridis (Nathaniel Smith and Stéfan van der Walt, CC0) at tenths, sRGB.
const MAP: [[u8; 3]; 11] = [
    [68, 1, 84],
    [72, 36, 117],
    [65, 68, 135],
    [53, 95, 141],
    [42, 120, 142],
    [33, 145, 140],
    [34, 168, 132],
    [68, 191, 112],
    [122, 209, 81],
    [189, 223, 38],
    [253, 231, 37],
];

/// The colour at `share` (clamped to 0…1) of the range, sRGB: from dark violet through green to yellow, with evenly
/// rising lightness.
pub fn color_map(share: f32) -> [u8; 3] {
    encode(mapped(share))
}

fn mapped(share: f32) -> Vec3 {
    if share.is_nan() {
        return NOT_A_NUMBER;
    }
    let at = share.clamp(0.0, 1.0) * (MAP.len() - 1) as f32;
    let low = (at as usize).min(MAP.len() - 2);
    // Interpolated in sRGB, where steps look even.
    let [a, b] = [low, low + 1].map(|k| MAP[k].map(f32::from));
    mix(a, b, at - low as f32).map(|byte| decode(byte / 255.0))
}

/// Smallest and largest finite value of an attribute over all layers: the length of vectors; for `v` of a volume, the
/// speed of its liquid cells. `None` if no layer has a value.
///
/// For a sequence, take the union over its frames.
pub fn attribute_range(layers: &[Layer<'_>], name: &str) -> Option<[f32; 2]> {
    let mut range = None::<[f32; 2]>;
    let mut take = |value: f32| {
        if value.is_finite() {
            range = Some(range.map_or([value; 2], |[low, high]| [low.min(value), high.max(value)]));
        }
    };
    for layer in layers.iter().filter(|layer| !layer.is_guide) {
        for part in layer.geometry.parts() {
            if let Some(shown) = Shown::find(part, name) {
                (0..shown.column.len()).for_each(|row| take(shown.number(row)));
            }
        }
        if let Some(volume) = layer.geometry.volume().filter(|_| name == SPEED) {
            let (mut sampler, grid) = (volume.sampler(), volume.level_grid());
            for (cell, _) in volume.level_set().nodes().filter(|(_, phi)| *phi <= 0.0) {
                take(level_set::speed(&mut sampler, &grid, cell));
            }
        }
    }
    range
}

/// Valid names for `color_by`, for a message: every attribute of every layer except `P`, in order.
pub fn attribute_names<'a>(layers: &[Layer<'a>]) -> BTreeSet<&'a str> {
    let of = |geometry: &'a Geometry| {
        let columns = geometry.parts().flat_map(|part| part.columns().map(|(_, name, _)| &**name));
        columns.chain(geometry.volume().map(|_| SPEED))
    };
    layers.iter().flat_map(|layer| of(layer.geometry)).filter(|name| *name != "P").collect()
}

/// The only attribute that a volume can show.
pub(crate) const SPEED: &str = "v";

/// The colour of each point or element.
#[derive(Debug)]
pub(crate) enum Paint {
    /// One colour that does not show an attribute, so it is fully lit.
    Plain(Vec3),
    /// One row per point.
    Points(Vec<Vec3>),
    /// One row per element.
    Elements(Vec<Vec3>),
}

impl Paint {
    /// The colours of `part`: from the requested attribute, otherwise a colour attribute, otherwise `plain`.
    pub(crate) fn of(part: &Component, color_by: Option<(&str, [f32; 2])>, plain: Vec3) -> Self {
        let painted = match color_by {
            Some((name, range)) => Shown::find(part, name).map(|shown| {
                let rows = 0..shown.column.len();
                let is_color = COLOR_NAMES.contains(&name);
                let own = |row| color_row(shown.column, row).filter(|_| is_color);
                let color = |row| own(row).unwrap_or_else(|| mapped(share(shown.number(row), range)));
                (shown.owner, rows.map(color).collect::<Vec<_>>())
            }),
            None => own_color(part).and_then(|(_, shown)| {
                let rows = 0..shown.column.len();
                Some((shown.owner, rows.map(|row| color_row(shown.column, row)).collect::<Option<Vec<_>>>()?))
            }),
        };
        match painted {
            Some((Owner::Point, colors)) => Self::Points(colors),
            Some((Owner::Element, colors)) => Self::Elements(colors),
            Some((Owner::Once, colors)) => {
                Self::Points(vec![colors.first().copied().unwrap_or(plain); part.point_count()])
            }
            None => Self::Plain(if color_by.is_some() { WITHOUT } else { plain }),
        }
    }

    /// The colours of a volume's surface, one row per point.
    pub(crate) fn of_speeds(speeds: Option<Vec<f32>>, color_by: Option<(&str, [f32; 2])>, plain: Vec3) -> Self {
        match (speeds, color_by) {
            (Some(speeds), Some((_, range))) => {
                Self::Points(speeds.into_iter().map(|speed| mapped(share(speed, range))).collect())
            }
            (_, Some(_)) => Self::Plain(WITHOUT),
            (_, None) => Self::Plain(plain),
        }
    }

    pub(crate) fn at(&self, point: usize, element: usize) -> Vec3 {
        match self {
            Self::Plain(color) => *color,
            Self::Points(colors) => colors[point],
            Self::Elements(colors) => colors[element],
        }
    }
}

/// Position of `value` in the range, 0…1 inside; 0.5 for a range without extent.
fn share(value: f32, [low, high]: [f32; 2]) -> f32 {
    // In halves, as the difference of two large numbers may overflow.
    let extent = 0.5 * high - 0.5 * low;
    if !value.is_finite() {
        f32::NAN
    } else if extent > 0.0 {
        (0.5 * value - 0.5 * low) / extent
    } else {
        0.5
    }
}

/// An attribute, or one of its components.
struct Shown<'a> {
    owner: Owner,
    column: &'a Column,
    component: Option<usize>,
}

impl<'a> Shown<'a> {
    /// `name` is an attribute, or an attribute and a component like `P.y`.
    fn find(part: &'a Component, name: &str) -> Option<Self> {
        let column = |name: &str| {
            Owner::ALL.into_iter().find_map(|owner| part.table(owner).column(name).map(|column| (owner, column)))
        };
        if let Some((owner, column)) = column(name) {
            return Some(Self { owner, column, component: None });
        }
        let (name, letter) = name.rsplit_once('.')?;
        let component = ["x", "y", "z", "w"].iter().position(|known| *known == letter)?;
        let (owner, column) = column(name)?;
        (component < width(column)).then_some(Self { owner, column, component: Some(component) })
    }

    /// A row as one number: a vector by its length.
    fn number(&self, row: usize) -> f32 {
        match (self.component, self.column) {
            (None, column) => scalar(column, row),
            (Some(k), Column::F3(rows)) => rows[row][k],
            (Some(k), Column::F4(rows)) => rows[row][k],
            (Some(k), Column::I3(rows)) => rows[row][k] as f32,
            (Some(k), Column::I4(rows)) => rows[row][k] as f32,
            (Some(_), column) => scalar(column, row),
        }
    }
}

/// Components of a row that have a letter; 0 for numbers.
fn width(column: &Column) -> usize {
    match column {
        Column::F1(_) | Column::I1(_) => 0,
        Column::F3(_) | Column::I3(_) => 3,
        Column::F4(_) | Column::I4(_) => 4,
    }
}

/// The colour attribute of a component.
fn own_color(part: &Component) -> Option<(&'static str, Shown<'_>)> {
    let is_color = |shown: &Shown<'_>| matches!(shown.column, Column::F3(_) | Column::F4(_));
    COLOR_NAMES.into_iter().find_map(|name| Some((name, Shown::find(part, name).filter(is_color)?)))
}

/// The colour attribute that is drawn of a layer without `color_by`.
pub(crate) fn own_color_name(layer: &Layer<'_>) -> Option<&'static str> {
    layer.geometry.parts().find_map(|part| own_color(part).map(|(name, _)| name))
}

/// Colours of outputs that are drawn together, sRGB: of similar saturation, and different in lightness as well as in hue,
/// so that they stay apart with colour blindness.
const PALETTE: [[u8; 3]; 8] = [
    [221, 158, 72],
    [74, 126, 172],
    [196, 224, 176],
    [150, 68, 82],
    [128, 196, 214],
    [86, 108, 62],
    [236, 196, 204],
    [96, 78, 138],
];

/// The colour of the output at `index` among those drawn together, linear light; they repeat after eight.
pub fn palette(index: usize) -> [f32; 3] {
    PALETTE[index % PALETTE.len()].map(|byte| decode(f32::from(byte) / 255.0))
}

/// A row as one number: a vector by its length.
fn scalar(column: &Column, row: usize) -> f32 {
    let size = |squares: f64| squares.sqrt() as f32;
    match column {
        Column::F1(rows) => rows[row],
        Column::F3(rows) => size(rows[row].iter().map(|x| f64::from(*x) * f64::from(*x)).sum()),
        Column::F4(rows) => size(rows[row].iter().map(|x| f64::from(*x) * f64::from(*x)).sum()),
        Column::I1(rows) => rows[row] as f32,
        Column::I3(rows) => length(rows[row].map(|x| x as f32)),
        Column::I4(rows) => size(rows[row].iter().map(|x| f64::from(*x) * f64::from(*x)).sum()),
    }
}

fn color_row(column: &Column, row: usize) -> Option<Vec3> {
    let cut = |x: f32| if x.is_nan() { 0.0 } else { x.clamp(0.0, 1.0) };
    match column {
        Column::F3(rows) => Some(rows[row].map(cut)),
        Column::F4(rows) => Some([rows[row][0], rows[row][1], rows[row][2]].map(cut)),
        _ => None,
    }
}

/// Linear light of an sRGB value, 0…1 (IEC 61966-2-1).
pub(crate) fn decode(value: f32) -> f32 {
    let value = f64::from(value);
    (if value <= 0.04045 { value / 12.92 } else { libm::pow((value + 0.055) / 1.055, 2.4) }) as f32
}

/// sRGB bytes of linear light, clamped to 0…1.
pub(crate) fn encode(linear: Vec3) -> [u8; 3] {
    /// Number of steps of linear light: the smallest byte step, near black, is 1.2 of them.
    const STEPS: usize = 4096;
    static BYTES: LazyLock<Vec<u8>> = LazyLock::new(|| {
        let byte = |step: usize| {
            let x = step as f64 / STEPS as f64;
            let value = if x <= 0.003_130_8 { 12.92 * x } else { 1.055 * libm::pow(x, 1.0 / 2.4) - 0.055 };
            (value * 255.0 + 0.5) as u8
        };
        (0..=STEPS).map(byte).collect()
    });
    linear.map(|x| BYTES[(x.clamp(0.0, 1.0) * STEPS as f32 + 0.5) as usize])
}

#[cfg(test)]
mod tests {
    use super::*;

    /// CIE lightness, 0…100.
    fn lightness(color: [u8; 3]) -> f64 {
        let [r, g, b] = color.map(|byte| f64::from(decode(f32::from(byte) / 255.0)));
        116.0 * libm::cbrt(0.2126 * r + 0.7152 * g + 0.0722 * b) - 16.0
    }

    #[test]
    fn the_color_map_gets_evenly_lighter() {
        let steps: Vec<f64> = (0..=100).map(|k| lightness(color_map(k as f32 / 100.0))).collect();
        assert!(steps.windows(2).all(|pair| pair[1] > pair[0]), "{steps:?}");
        // Evenly: no tenth of the range has less than half or more than twice the average rise.
        for pair in steps.iter().step_by(10).collect::<Vec<_>>().windows(2) {
            let share = (pair[1] - pair[0]) / (steps[100] - steps[0]) * 10.0;
            assert!((0.5..2.0).contains(&share), "{share}");
        }
    }

    #[test]
    fn bytes_survive_decoding_and_encoding() {
        for byte in 0..=255_u8 {
            let back = encode([decode(f32::from(byte) / 255.0); 3]);
            assert!(back[0].abs_diff(byte) <= 1, "{byte} {back:?}");
        }
        assert_eq!(encode([-1.0, 2.0, f32::NAN]), [0, 255, 0]);
    }

    #[test]
    fn a_range_covers_all_layers_and_skips_non_finite_values() {
        let points = |values: Vec<f32>| {
            let mut part = Component::points(vec![[0.0; 3]; values.len()]);
            part.set_column(Owner::Point, "heat", Column::new(values)).unwrap();
            Geometry::from(part)
        };
        let (a, b) = (points(vec![1.0, f32::NAN]), points(vec![-2.0, 0.0]));
        let layers = [Layer::new("a", &a), Layer::new("b", &b)];
        assert_eq!(attribute_range(&layers, "heat"), Some([-2.0, 1.0]));
        assert_eq!(attribute_range(&layers, "cold"), None);
        assert_eq!(attribute_range(&[Layer::guide("a", &a)], "heat"), None);
        assert_eq!(attribute_names(&layers).into_iter().collect::<Vec<_>>(), ["heat"]);
    }

    #[test]
    fn the_ends_of_the_range_are_the_ends_of_the_map() {
        let mut part = Component::points(vec![[0.0; 3]; 4]);
        part.set_column(
            Owner::Point,
            "v",
            Column::new(vec![[3.0, 4.0, 0.0], [0.0; 3], [f32::NAN; 3], [9e9, 0.0, 0.0]]),
        )
        .unwrap();
        let Paint::Points(colors) = Paint::of(&part, Some(("v", [0.0, 5.0])), [0.5; 3]) else { panic!() };
        assert_eq!(colors[0], mapped(1.0));
        assert_eq!(colors[1], mapped(0.0));
        assert_eq!(colors[2], NOT_A_NUMBER);
        assert_eq!(colors[3], mapped(1.0));
        assert_eq!(share(3.0e38, [-3.4e38, 3.4e38]), (1.5e38_f32 + 1.7e38) / 3.4e38);
    }

    #[test]
    fn a_component_of_a_vector_is_a_number() {
        let part: Geometry = Component::points(vec![[1.0, -2.0, 3.0], [4.0, 5.0, 6.0]]).into();
        let range = |name: &str| attribute_range(&[Layer::new("one", &part)], name);
        assert_eq!(range("P.y"), Some([-2.0, 5.0]));
        assert_eq!((range("P.w"), range("P.q"), range("Q.x")), (None, None, None));
        assert_eq!(range("P"), Some([14.0_f32.sqrt(), 77.0_f32.sqrt()]));
    }

    /// What a person without cones for red (or green, whose confusions are nearly the same) sees of linear light
    /// (Viénot, Brettel and Mollon, "Digital video colourmaps for checking the legibility of displays by dichromats",
    /// 1999).
    fn without_red([r, g, b]: Vec3) -> Vec3 {
        [0.11238 * r + 0.88762 * g, 0.11238 * r + 0.88762 * g, 0.00401 * r - 0.00401 * g + b]
    }

    #[test]
    fn neighbours_in_the_palette_differ_with_and_without_cones_for_red() {
        let seen = |color: Vec3| {
            let bytes = encode(color);
            [lightness(bytes), f64::from(bytes[0]) - f64::from(bytes[1]), f64::from(bytes[1]) - f64::from(bytes[2])]
        };
        for (a, b) in (0..8).flat_map(|a| (a + 1..8).map(move |b| (a, b))) {
            for view in [without_red, |color| color] {
                let [a, b] = [a, b].map(|k| seen(view(palette(k))));
                let apart: f64 = (0..3).map(|k| (a[k] - b[k]).abs()).sum();
                assert!(apart > 20.0, "{a:?} {b:?}");
            }
        }
        assert_eq!(palette(8), palette(0));
    }

    #[test]
    fn a_color_attribute_is_drawn_unchanged() {
        let mut part = Component::points(vec![[0.0; 3]]);
        part.set_column(Owner::Once, "Cd", Column::new(vec![[0.1_f32, 2.0, 0.3]])).unwrap();
        assert_eq!(Paint::of(&part, None, [0.5; 3]).at(0, 0), [0.1, 1.0, 0.3]);
        assert_eq!(Paint::of(&part, Some(("w", [0.0, 1.0])), [0.5; 3]).at(0, 0), WITHOUT);
    }
}
