//! Connected pieces of points.

/// For each of `count` points, the lowest point that it is connected to by `links`.
pub(crate) fn pieces(count: usize, links: impl Iterator<Item = [u32; 2]>) -> Vec<u32> {
    let mut parent: Vec<u32> = (0..count as u32).collect();
    fn root(parent: &mut [u32], mut at: u32) -> u32 {
        while parent[at as usize] != at {
            parent[at as usize] = parent[parent[at as usize] as usize];
            at = parent[at as usize];
        }
        at
    }
    for ends in links {
        let [a, b] = ends.map(|end| root(&mut parent, end));
        parent[a.max(b) as usize] = a.min(b);
    }
    (0..count as u32).map(|point| root(&mut parent, point)).collect()
}
