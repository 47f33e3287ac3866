//! Connected pieces of points.

/// For each of `count` points, the lowest point that it is connected to by `links`.
///
/// # Panics
/// If a link has an index out of range.
pub fn pieces(count: usize, links: impl Iterator<Item = [u32; 2]>) -> Vec<u32> {
    fn root(parents: &mut [u32], mut point: u32) -> u32 {
        while parents[point as usize] != point {
            parents[point as usize] = parents[parents[point as usize] as usize];
            point = parents[point as usize];
        }
        point
    }
    let mut parents: Vec<u32> = (0..count as u32).collect();
    for ends in links {
        let [a, b] = ends.map(|end| root(&mut parents, end));
        parents[a.max(b) as usize] = a.min(b);
    }
    (0..count as u32).map(|point| root(&mut parents, point)).collect()
}
