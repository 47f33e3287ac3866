use numerics::vector::length;

use super::*;
use crate::geometry::Geometry;

const UNIT: Grid = Grid { origin: [0.0; 3], cell: 1.0, size: [1; 3] };

/// A falling ball of radius 5 in the centre of 64³ cells of 1 m, band 3; velocity on cells of 2 m.
fn drop() -> Volume {
    let level_grid = Grid { origin: [-32.0; 3], cell: 1.0, size: [64; 3] };
    let velocity_grid = Grid { origin: [-32.0; 3], cell: 2.0, size: [32; 3] };
    let distance = |node: [u32; 3]| length(node.map(|i| i as f32 - 31.5)) - 5.0;
    let every = |size: [u32; 3]| {
        let blocks = size.map(|n| n.div_ceil(8));
        (0..blocks[2]).flat_map(move |z| (0..blocks[1]).flat_map(move |y| (0..blocks[0]).map(move |x| [x, y, z])))
    };
    let level_set = SparseField::from_blocks([64; 3], 3.0, every([64; 3]), |block, out| {
        for (at, value) in (0..).zip(out) {
            let within = [at % 8, at / 8 % 8, at / 64];
            *value = distance([0, 1, 2].map(|k| block[k] * 8 + within[k])).min(3.0);
        }
    });
    let still = |axis| SparseField::from_blocks(velocity_grid.faces_size(axis), 0.0, [], |_, _| {}).unwrap();
    let falling = velocity_grid.faces_size(1);
    let falling = SparseField::from_blocks(falling, 0.0, every(falling), |_, out| out.fill(-2.0)).unwrap();
    Volume::from_fields(level_grid, level_set.unwrap(), velocity_grid, [still(0), falling, still(2)]).unwrap()
}

#[test]
fn arrays_fit_their_grid() {
    let grid = Grid { origin: [0.0; 3], cell: 0.1, size: [2, 1, 1] };
    assert!(Volume::new(grid, vec![0.0; 2], [vec![0.0; 3], vec![0.0; 4], vec![0.0; 4]]).is_ok());
    let error = Volume::new(grid, vec![0.0; 2], [vec![0.0; 2], vec![0.0; 4], vec![0.0; 4]]).unwrap_err();
    assert_eq!(error.to_string(), "`velocity_x` has 2 rows, expected 3");
}

#[test]
fn invalid_grids_are_refused_with_the_reason() {
    let none = || [(); 3].map(|()| Vec::new());
    let refused = |grid: Grid| Volume::new(grid, Vec::new(), none()).unwrap_err().to_string();
    assert_eq!(
        refused(Grid { size: [2048, 1024, 1024], ..UNIT }),
        "`level_set`: 2048 × 1024 × 1024 numbers would take 8.0 GiB, expected at most 2147483647 numbers"
    );
    assert!(refused(Grid { size: [u32::MAX; 3], ..UNIT }).contains("numbers would take"));
    assert_eq!(
        refused(Grid { size: [u32::MAX, 0, 0], ..UNIT }),
        "`level_set`: 4294967295 × 0 × 0 numbers, expected at most 16777216 along an axis"
    );
    for cell in [0.0, -1.0, f32::NAN, f32::INFINITY] {
        let text = refused(Grid { cell, size: [0; 3], ..UNIT });
        assert!(text.ends_with("expected finite numbers and a cell size above 0"), "{text}");
    }
    assert!(refused(Grid { origin: [0.0, f32::NAN, 0.0], size: [0; 3], ..UNIT }).starts_with("the grid has cells of"));
}

#[test]
fn fields_fit_their_grids_and_have_the_background_of_their_kind() {
    let field = |size, background| SparseField::from_blocks(size, background, [], |_, _| {}).unwrap();
    let faces = || [0, 1, 2].map(|axis| field(UNIT.faces_size(axis), 0.0));
    let text = |level_set, velocity| Volume::from_fields(UNIT, level_set, UNIT, velocity).unwrap_err().to_string();
    assert!(Volume::from_fields(UNIT, field([1; 3], 1.0), UNIT, faces()).is_ok());
    let size = "`level_set` has [2, 1, 1] numbers along x, y and z, expected [1, 1, 1]";
    assert_eq!(text(field([2, 1, 1], 1.0), faces()), size);
    for background in [0.0, -1.0, f32::NAN, f32::INFINITY] {
        assert!(text(field([1; 3], background), faces()).ends_with("expected a distance above 0"), "{background}");
    }
    let moving = [0, 1, 2].map(|axis| field(UNIT.faces_size(axis), 0.5));
    assert_eq!(text(field([1; 3], 1.0), moving), "the background of `velocity_x` is 0.5, expected 0");
}

#[test]
fn memory_is_proportional_to_the_liquid() {
    let bytes = |volume: Volume| {
        let mut geometry = Geometry::default();
        geometry.put_volume(volume);
        geometry.bytes()
    };
    // A ball of 16 cells across with its band touches 4 blocks along each axis at most; velocity 5.
    let cropped = bytes(drop().cropped(3.0, 4.0).unwrap());
    assert!(cropped < (4 * 4 * 4 + 3 * 3 * 3) * 2100, "{cropped}");
    assert!(drop().level_set().block_count() <= 4 * 4 * 4);
}

#[test]
fn a_scaled_volume_shares_its_block_index_and_a_clone_everything() {
    let volume = drop();
    let scaled = volume.with_lengths(|x| 0.5 * x);
    let [blocks, values] = volume.level_set().arrays();
    assert_eq!(volume.clone().level_set().arrays(), [blocks, values]);
    assert_eq!(scaled.level_set().arrays()[0], blocks);
    assert_ne!(scaled.level_set().arrays()[1].0, values.0);
    assert_eq!((scaled.level_set().background(), scaled.velocity()[1].background()), (1.5, 0.0));
}

#[test]
fn cropping_keeps_the_liquid_and_its_band_and_every_sample_there() {
    let volume = drop();
    let mut cropped = volume.cropped(2.0, 3.0).unwrap();
    // φ < 2 within 7 m of the middle, whose nearest cell centres are half a metre off: cells 25 to 38.
    assert_eq!(cropped.level_grid(), Grid { origin: [-7.0; 3], cell: 1.0, size: [14; 3] });
    // Liquid in cells 27 to 36, −5 m to 5 m; by 3 m more: −8 m to 8 m, cells 12 to 19 of 2 m.
    assert_eq!(cropped.velocity_grid(), Grid { origin: [-8.0; 3], cell: 2.0, size: [8; 3] });
    let (mut whole, mut part) = (volume.sampler(), cropped.sampler());
    for point in [[0.0; 3], [4.3, -1.0, 2.2], [-6.0, 0.5, 0.25]] {
        assert_eq!(whole.level_set(point), part.level_set(point));
        assert_eq!(whole.velocity(point), [0.0, -2.0, 0.0]);
        assert_eq!(part.velocity(point), [0.0, -2.0, 0.0]);
    }
    assert_eq!((part.level_set([20.0, 0.0, 0.0]), part.velocity([20.0, 0.0, 0.0])), (3.0, [0.0; 3]));
    cropped.once_mut().set("mass", crate::geometry::Column::new(vec![1.0_f32])).unwrap();
    let again = cropped.cropped(2.0, 3.0).unwrap();
    assert_eq!(again, cropped, "nothing is left to crop");
}

#[test]
fn a_volume_without_liquid_crops_to_nothing() {
    let air = Volume::new(Grid { size: [2; 3], ..UNIT }, vec![1.0; 8], [(); 3].map(|()| vec![1.0; 12])).unwrap();
    let cropped = air.cropped(1.0, 1.0).unwrap();
    assert_eq!((cropped.level_grid().size, cropped.velocity_grid().size), ([0; 3], [0; 3]));
    assert_eq!((cropped.sampler().level_set([0.0; 3]), cropped.sampler().velocity([0.0; 3])), (1.0, [0.0; 3]));
}

#[test]
fn velocity_is_read_between_its_own_faces() {
    // u = x on faces x = 0, 1, 2 at y = z = ½; v = 10 y.
    let grid = Grid { origin: [0.0; 3], cell: 1.0, size: [2, 1, 1] };
    let volume = Volume::new(grid, vec![-1.0; 2], [vec![0.0, 1.0, 2.0], vec![0.0, 0.0, 10.0, 10.0], vec![0.0; 4]]);
    let volume = volume.unwrap();
    assert_eq!(volume.sampler().velocity([1.25, 0.5, 0.5]), [1.25, 5.0, 0.0]);
    assert_eq!(volume.sampler().level_set([1.0, 0.5, 0.5]), -1.0);
}
