use super::*;

const FAR: f32 = 3.0;

/// x + 100 y + 10,000 z at one node in each of the blocks 0, 5 and 9 along x.
fn three_blocks() -> SparseField {
    SparseField::from_blocks([80, 16, 16], FAR, [[9, 1, 0], [0, 0, 0], [5, 0, 1], [0, 0, 0]], |block, out| {
        let [x, y, z] = block.map(|n| (n * BLOCK_EDGE) as f32);
        out[0] = x + 100.0 * y + 10_000.0 * z;
    })
    .unwrap()
}

#[test]
fn blocks_come_in_the_order_of_their_nodes() {
    let field = three_blocks();
    let blocks: Vec<_> = field.blocks().map(|(block, values)| (block, values[0])).collect();
    assert_eq!(blocks, [([0, 0, 0], 0.0), ([9, 1, 0], 872.0), ([5, 0, 1], 80_040.0)]);
    let mut cursor = field.cursor();
    assert_eq!(cursor.get([72, 8, 0]), 872.0);
    assert_eq!(cursor.get([72, 9, 0]), FAR, "in a block, not written");
    assert_eq!(cursor.get([20, 0, 0]), FAR, "in no block");
    assert_eq!(cursor.get([-1, 0, 0]), FAR);
    assert_eq!(cursor.get([80, 0, 0]), FAR);
}

#[test]
fn dense_and_sparse_are_the_same_values_in_boxes_of_any_size() {
    for size in [[0, 3, 3], [1, 1, 1], [8, 8, 8], [9, 7, 17], [3, 20, 1]] {
        let nodes = size.iter().product::<u32>() as usize;
        let dense: Vec<f32> = (0..nodes).map(|n| if n % 3 == 0 { -0.0 } else { n as f32 }).collect();
        let field = SparseField::from_dense(size, FAR, &dense).unwrap();
        let bits = |values: Vec<f32>| values.into_iter().map(f32::to_bits).collect::<Vec<_>>();
        assert_eq!(bits(field.to_dense().unwrap()), bits(dense.clone()), "{size:?}");
        assert_eq!(bits(field.iter_dense().collect()), bits(dense), "{size:?}");
        assert_eq!(field.nodes().count(), nodes, "{size:?}");
    }
}

#[test]
fn memory_follows_the_blocks_and_not_the_box() {
    let field = SparseField::from_blocks([1 << 24; 3], FAR, [[1 << 20; 3]], |_, out| out[511] = -1.0).unwrap();
    assert_eq!(field.arrays().map(|(_, bytes)| bytes), [8, 2048]);
    assert_eq!(field.nodes().find(|(_, value)| *value < 0.0).unwrap().0, [(1 << 23) + 7; 3]);
    let mut dense = vec![FAR; 64 * 64 * 64];
    dense[0] = 1.0;
    dense[64 * 64 * 64 - 1] = 1.0;
    assert_eq!(SparseField::from_dense([64; 3], FAR, &dense).unwrap().block_count(), 2);
}

#[test]
fn a_block_of_background_is_not_stored_nor_what_is_written_outside_the_box() {
    let field = SparseField::from_blocks([9, 8, 8], FAR, [[0, 0, 0], [1, 0, 0]], |block, out| {
        // Of block 1 only the nodes with x = 8 lie in the box.
        if block[0] == 1 {
            out[1..8].fill(5.0);
        }
    });
    assert_eq!(field, SparseField::from_dense([9, 8, 8], FAR, &[FAR; 576]));
    assert_eq!(field.unwrap().block_count(), 0);
}

#[test]
fn a_clone_shares_until_it_is_edited() {
    let field = three_blocks();
    let mut doubled = field.clone();
    assert_eq!(field.arrays(), doubled.arrays());
    doubled.edit(|x| 2.0 * x);
    let ([keys, values], [same_keys, other_values]) = (field.arrays(), doubled.arrays());
    assert!(keys == same_keys && values.0 != other_values.0);
    assert_eq!((field.cursor().get([72, 8, 0]), doubled.cursor().get([72, 8, 0])), (872.0, 1744.0));
    assert_eq!((field.background(), doubled.background()), (FAR, 2.0 * FAR));
    let before = doubled.arrays();
    doubled.edit(|x| x + 1.0);
    assert_eq!(doubled.arrays(), before, "nobody else holds it: edited in place");
    doubled.edit(|_| 1.0);
    assert_eq!(doubled.block_count(), 0);
}

#[test]
fn a_part_has_the_same_values_wherever_it_is_cut() {
    let dense: Vec<f32> = (0..20 * 17 * 9).map(|n| if n % 7 == 0 { FAR } else { n as f32 }).collect();
    let field = SparseField::from_dense([20, 17, 9], FAR, &dense).unwrap();
    for (low, size) in [([0; 3], [20, 17, 9]), ([8, 8, 0], [8, 8, 8]), ([3, 5, 1], [11, 12, 8]), ([19, 0, 0], [1; 3])] {
        let part = field.cropped(low, size).unwrap();
        let mut cursor = field.cursor();
        let expected = (0..size[2])
            .flat_map(|z| (0..size[1]).flat_map(move |y| (0..size[0]).map(move |x| [x, y, z])))
            .map(|node| cursor.get([0, 1, 2].map(|axis| i64::from(low[axis] + node[axis]))))
            .collect::<Vec<_>>();
        assert_eq!(part.to_dense().unwrap(), expected, "{low:?} {size:?}");
        assert_eq!(part, SparseField::from_dense(size, FAR, &expected).unwrap());
    }
    assert_eq!(field.cropped([15, 15, 5], [10, 10, 10]).unwrap().cursor().get([5, 0, 0]), FAR, "beyond the old box");
}

#[test]
fn bounds_are_the_smallest_box() {
    assert_eq!(three_blocks().bounds(|x| x != FAR), Some([[0; 3], [73, 9, 9]]));
    assert_eq!(three_blocks().bounds(|x| x > 500.0), Some([[40, 0, 0], [73, 9, 9]]));
    assert_eq!(three_blocks().bounds(|x| x < 0.0), None);
}

#[test]
fn sampling_is_exact_for_a_linear_field_across_blocks() {
    let value = |[x, y, z]: [f64; 3]| 0.5 * x - 2.0 * y + 0.25 * z + 3.0;
    let size = [10, 10, 10];
    let dense: Vec<f32> = (0..1000).map(|n| value([n % 10, n / 10 % 10, n / 100].map(f64::from)) as f32).collect();
    let field = SparseField::from_dense(size, FAR, &dense).unwrap();
    let mut cursor = field.cursor();
    for point in [[0.0, 0.0, 0.0], [7.5, 7.25, 7.75], [8.0, 1.5, 3.0], [9.0, 9.0, 9.0]] {
        assert_eq!(cursor.sample(point), value(point) as f32, "{point:?}");
    }
    // Halfway between the last node and the background beyond it.
    assert_eq!(cursor.sample([9.5, 0.0, 0.0]), 0.5 * (7.5 + FAR));
    for outside in [[-1.0, 0.0, 0.0], [1e300, 0.0, 0.0], [f64::NAN, 0.0, 0.0], [0.0, 0.0, f64::NEG_INFINITY]] {
        assert_eq!(cursor.sample(outside), FAR, "{outside:?}");
    }
}

#[test]
fn hostile_sizes_are_refused_with_what_they_would_take() {
    let text = |result: Result<SparseField, SparseFieldError>| result.unwrap_err().to_string();
    assert_eq!(
        text(SparseField::from_dense([2048, 1024, 1024], FAR, &[])),
        "2048 × 1024 × 1024 numbers would take 8.0 GiB, expected at most 2147483647 numbers"
    );
    assert_eq!(text(SparseField::from_dense([2, 2, 2], FAR, &[1.0])), "1 values for 8 nodes");
    let none = |size| SparseField::from_blocks(size, FAR, [], |_, _| {});
    assert_eq!(
        text(none([u32::MAX; 3])),
        "4294967295 × 4294967295 × 4294967295 numbers, expected at most 16777216 along an axis"
    );
    let huge = none([1 << 24; 3]).unwrap();
    assert_eq!(
        huge.to_dense().unwrap_err().to_string(),
        "16777216 × 16777216 × 16777216 numbers would take 17592186044416.0 GiB, expected at most 2147483647 numbers"
    );
    assert_eq!(
        text(SparseField::from_blocks([8; 3], FAR, [[0, 1, 0]], |_, _| {})),
        "block [0, 1, 0] is outside the box"
    );
}
