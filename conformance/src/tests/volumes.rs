//! A volume has two grids: a node that takes them for one is found.

use super::*;
use engine::geometry::{Grid, Volume};
use numerics::vector;

const VOLUME: Input = Input::one("volume", Kind::Volume, "Liquid to put points in.");
const DROPS: Output = Output::new("drops", &[Kind::Points], "A point in each cell of liquid.");
const MOVED: Output = Output::like("volume", &VOLUME, "The liquid, moved.");

/// A node that puts a point in each cell of liquid and moves it by `amount` seconds of its velocity.
const fn drops(cook: fn(&Cx) -> Result<Outputs>) -> Node {
    Node::new("Drops", 1, "Points in liquid.", Cook::Pure(cook))
        .inputs(&[&VOLUME])
        .params(&[&AMOUNT])
        .outputs(&[&DROPS])
        .writes(&[&P])
        .changes_topology()
}

fn moved(cx: &Cx, mut velocity: impl FnMut([u32; 3], [f32; 3]) -> [f32; 3]) -> Result<Outputs> {
    let Some(volume) = cx.input(VOLUME).volume() else {
        return Ok(DROPS.with(Geometry::from(Component::points(Vec::new()))));
    };
    let Grid { origin, cell, .. } = volume.level_grid();
    let liquid = volume.level_set().nodes().filter(|(_, phi)| *phi < 0.0);
    let points = liquid.map(|(node, _)| {
        let at = vector::add(origin, node.map(|i| (i as f32 + 0.5) * cell));
        vector::add(at, vector::scale(velocity(node, at), cx.get(AMOUNT)))
    });
    Ok(DROPS.with(Geometry::from(Component::points(points.collect()))))
}

#[test]
fn a_node_that_samples_both_grids_by_position_passes() {
    let node = drops(|cx| {
        let mut sampler = cx.input(VOLUME).volume().map(Volume::sampler);
        moved(cx, |_, at| sampler.as_mut().map_or([0.0; 3], |sampler| sampler.velocity(at)))
    });
    assert_eq!(findings_of(node), [""; 0]);
}

#[test]
fn a_node_that_reads_velocities_by_the_index_of_a_cell_is_found() {
    let node = drops(|cx| {
        let volume = cx.input(VOLUME).volume();
        let size = volume.map_or([0; 3], |volume| volume.level_grid().size.map(|n| n as usize));
        let dense =
            volume.map(|volume| volume.velocity().each_ref().map(|field| field.iter_dense().collect::<Vec<_>>()));
        moved(cx, |[i, j, k], _| {
            let index = i as usize + size[0] * (j as usize + size[1] * k as usize);
            dense.as_ref().map_or([0.0; 3], |velocity| [0, 1, 2].map(|axis| velocity[axis][index]))
        })
    });
    finds(node, "it panics: it failed unexpectedly: index out of bounds");
}

#[test]
fn a_node_that_writes_both_fields_on_one_grid_is_found() {
    let node = Node::new(
        "Raise",
        1,
        "Moves liquid up.",
        Cook::Pure(|cx| {
            let mut out = cx.input(VOLUME).clone();
            if let Some(volume) = cx.input(VOLUME).volume() {
                let Grid { origin: [x, y, z], cell, size } = volume.level_grid();
                let grid = Grid { origin: [x, y + cx.get(AMOUNT), z], cell, size };
                out.put_volume(Volume::from_fields(grid, volume.level_set().clone(), grid, volume.velocity().clone())?);
            }
            Ok(MOVED.with(out))
        }),
    );
    finds(node.inputs(&[&VOLUME]).params(&[&AMOUNT]).outputs(&[&MOVED]), "velocity_x");
}
