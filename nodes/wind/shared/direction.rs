//! Directions as an artist writes them: of any length.

/// `v`, not zero, brought to length 1. Its numbers are brought near 1 first, so that any length will do.
pub(crate) fn unit(v: [f64; 3]) -> [f64; 3] {
    let largest = v.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
    let v = v.map(|x| x / largest);
    let length = (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]).sqrt();
    v.map(|x| x / length)
}
