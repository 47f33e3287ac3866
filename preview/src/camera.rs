//! The camera: position, target and angle; written and read as text, or fitted to bounds.
//!
//! Guarantees: [`Camera::fit`] shows the whole box, touching the margin on two opposite sides, and depends only on the
//! box and the picture's aspect, so a sequence with one box has one camera. Limit: no lens shift, no roll except by
//! `up`.

use std::fmt;
use std::str::FromStr;

use numerics::vector::{DVec3, direction, to_f64};

/// Default vertical angle of view, degrees: narrow enough to show little distortion.
pub(crate) const FOV: f64 = 30.0;
/// Margin of [`Camera::fit`] around the box, as a fraction of half the picture.
const MARGIN: f64 = 0.08;
/// Direction from the target to the eye in [`Camera::fit`]: a three-quarter view from the front right, slightly from
/// above.
pub(crate) const THREE_QUARTER: [f64; 3] = [0.52, 0.30, 0.80];

/// Smallest and largest coordinates, metres.
pub type BoundingBox = [[f32; 3]; 2];

/// A camera. Lengths in metres, Y up, right-handed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    eye: DVec3,
    target: DVec3,
    up: DVec3,
    fov: f64,
}

/// Why a camera is invalid.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum CameraError {
    /// A word that is not `name=value`, or an unknown name.
    #[error("`{0}` is not a camera setting, expected `eye=x,y,z`, `target=x,y,z`, `up=x,y,z` or `fov=degrees`")]
    Part(String),
    /// A part that is given twice.
    #[error("`{0}` is given twice, expected once")]
    Twice(&'static str),
    /// A required part that is missing.
    #[error("`{0}` is missing, expected a camera like `eye=1,2,3 target=0,0,0 fov=35`")]
    Missing(&'static str),
    /// An invalid value.
    #[error("`{name}` is `{value}`, expected {expected}")]
    Value {
        /// Name of the setting.
        name: &'static str,
        /// The given value.
        value: String,
        /// A description of valid values.
        expected: &'static str,
    },
    /// No viewing direction.
    #[error("`eye` and `target` are both {0:?}, which gives no direction to look in")]
    NoDirection([f64; 3]),
}

impl Camera {
    /// A camera at `eye` that looks at `target`; `up` points up in the picture; `fov` is the vertical angle in degrees.
    ///
    /// If `up` is parallel to the view (a view from straight above), Z or else X takes its place.
    ///
    /// # Errors
    /// If a number is not finite, `up` is zero, `fov` is not in 1…170, or `eye` is `target`.
    pub fn new(eye: [f64; 3], target: [f64; 3], up: [f64; 3], fov: f64) -> Result<Self, CameraError> {
        for (name, value) in [("eye", eye), ("target", target)] {
            if value.iter().any(|x| !x.is_finite()) {
                let expected = "three finite numbers like `1,2,3`";
                return Err(CameraError::Value { name, value: commas(value), expected });
            }
        }
        let [eye_at, target_at, up_along] = [eye, target, up].map(DVec3::from);
        if direction(up_along).is_none() {
            return Err(CameraError::Value { name: "up", value: commas(up), expected: "a direction like `0,1,0`" });
        }
        if !(1.0..=170.0).contains(&fov) {
            let expected = "an angle between 1 and 170 degrees";
            return Err(CameraError::Value { name: "fov", value: fov.to_string(), expected });
        }
        if direction(target_at - eye_at).is_none() {
            return Err(CameraError::NoDirection(eye));
        }
        Ok(Self { eye: eye_at, target: target_at, up: up_along, fov })
    }

    /// The three-quarter view that shows all of `bounds` in a picture with this `aspect` (width ÷ height).
    ///
    /// With the union over all frames and outputs, all pictures have one camera. A box without extent is seen from the
    /// distance of a box of 1 m; bounds that are not finite count as the unit box.
    pub fn fit(bounds: BoundingBox, aspect: f64) -> Self {
        let [low, high] = proper(bounds);
        let aspect = if aspect.is_finite() && aspect > 0.0 { aspect } else { 1.0 };
        let back = direction(THREE_QUARTER.into()).unwrap_or(DVec3::z());
        let centre = (low + high) * 0.5;
        let up = DVec3::y();
        let frame = axes(-back, up);
        let tan_y = half_tangent(FOV) * (1.0 - MARGIN);
        let tan_x = tan_y * aspect;

        // A corner (x, y, z) of the box, z along the view, is inside if |x − eye_x| ≤ (z − eye_z)·tan. The largest
        // x − z·tan and −x − z·tan over the corners therefore bound the eye from both sides.
        let mut most = [f64::NEG_INFINITY; 4];
        for corner in corners([low, high]) {
            let [x, y, z] = frame.map(|axis| axis.dot(&(corner - centre)));
            let sides = [x - z * tan_x, -x - z * tan_x, y - z * tan_y, -y - z * tan_y];
            most = std::array::from_fn(|k| most[k].max(sides[k]));
        }
        let [right, left, top, bottom] = most;
        let z = (-(right + left) / (2.0 * tan_x)).min(-(top + bottom) / (2.0 * tan_y));
        let eye_at = [(right - left) / 2.0, (top - bottom) / 2.0, z];
        let eye = (0..3).fold(centre, |at, k| at + frame[k] * eye_at[k]);
        let target = eye + frame[2] * -z;
        Self { eye, target, up, fov: FOV }
    }

    /// The eye, metres.
    pub fn eye(&self) -> [f64; 3] {
        self.eye.into()
    }

    /// The target, metres.
    pub fn target(&self) -> [f64; 3] {
        self.target.into()
    }

    /// Vertical angle of view, degrees.
    pub fn fov(&self) -> f64 {
        self.fov
    }

    /// Right, up and forward: unit vectors, perpendicular to each other.
    pub(crate) fn axes(&self) -> [DVec3; 3] {
        axes(self.target - self.eye, self.up)
    }

    /// Half the picture's height at distance 1.
    pub(crate) fn half_tangent(&self) -> f64 {
        half_tangent(self.fov)
    }
}

/// Reads `eye=1,2,3 target=0,0,0 up=0,1,0 fov=35`; `up` and `fov` may be left out.
impl FromStr for Camera {
    type Err = CameraError;

    fn from_str(text: &str) -> Result<Self, CameraError> {
        let (mut eye, mut target, mut up, mut fov) = (None, None, None, None);
        for word in text.split_whitespace() {
            let Some((name, value)) = word.split_once('=') else { return Err(CameraError::Part(word.into())) };
            match name {
                "eye" => once("eye", &mut eye, vector("eye", value)?)?,
                "target" => once("target", &mut target, vector("target", value)?)?,
                "up" => once("up", &mut up, vector("up", value)?)?,
                "fov" => once("fov", &mut fov, number("fov", value)?)?,
                _ => return Err(CameraError::Part(word.into())),
            }
        }
        let eye = eye.ok_or(CameraError::Missing("eye"))?;
        let target = target.ok_or(CameraError::Missing("target"))?;
        Self::new(eye, target, up.unwrap_or([0.0, 1.0, 0.0]), fov.unwrap_or(FOV))
    }
}

/// The text from which this camera can be read back.
impl fmt::Display for Camera {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [eye, target, up] = [self.eye, self.target, self.up].map(|v| commas(v.into()));
        write!(f, "eye={eye} target={target} up={up} fov={}", self.fov)
    }
}

/// Right, up and forward of a view along `forward`.
pub(crate) fn axes(forward: DVec3, up: DVec3) -> [DVec3; 3] {
    /// Sine of the angle to the view below which `up` does not define the picture's up.
    const ALONG: f64 = 1e-6;
    let forward = direction(forward).unwrap_or(-DVec3::z());
    let square = |up: DVec3| direction(up).map(|up| forward.cross(&up)).filter(|right| right.norm() > ALONG);
    let right = square(up).or_else(|| square(-DVec3::z())).or_else(|| square(DVec3::x()));
    let right = right.and_then(direction).unwrap_or(DVec3::x());
    [right, right.cross(&forward), forward]
}

pub(crate) fn half_tangent(degrees: f64) -> f64 {
    libm::tan(degrees.to_radians() / 2.0)
}

/// `bounds` in f64, finite and with an extent.
pub(crate) fn proper(bounds: BoundingBox) -> [DVec3; 2] {
    let [low, high] = bounds.map(to_f64);
    if low.iter().chain(&high).any(|x| !x.is_finite()) {
        return [-0.5, 0.5].map(DVec3::repeat);
    }
    let size = (high - low).norm();
    let far = low.iter().chain(&high).fold(0.0_f64, |most, x| most.max(x.abs()));
    // An extent below the spacing of f32 at that distance cannot be seen.
    let smallest = far * f64::from(f32::EPSILON);
    if size > smallest { [low, high] } else { [low.add_scalar(-0.5), high.add_scalar(0.5)] }
}

fn corners([low, high]: [DVec3; 2]) -> impl Iterator<Item = DVec3> {
    (0..8).map(move |bits| DVec3::from_fn(|k, _| if bits >> k & 1 == 0 { low[k] } else { high[k] }))
}

fn commas(v: [f64; 3]) -> String {
    format!("{},{},{}", v[0], v[1], v[2])
}

fn once<T>(name: &'static str, slot: &mut Option<T>, value: T) -> Result<(), CameraError> {
    match slot.replace(value) {
        Some(_) => Err(CameraError::Twice(name)),
        None => Ok(()),
    }
}

fn number(name: &'static str, text: &str) -> Result<f64, CameraError> {
    text.parse().map_err(|_| CameraError::Value { name, value: text.into(), expected: "a number" })
}

fn vector(name: &'static str, text: &str) -> Result<[f64; 3], CameraError> {
    let error = || CameraError::Value { name, value: text.into(), expected: "three finite numbers like `1,2,3`" };
    let numbers: Vec<f64> = text.split(',').map(str::parse).collect::<Result<_, _>>().map_err(|_| error())?;
    numbers.try_into().map_err(|_| error())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn error(text: &str) -> String {
        text.parse::<Camera>().unwrap_err().to_string()
    }

    #[test]
    fn a_written_camera_reads_back() {
        let camera: Camera = "eye=1,2.5,3 target=0,-1e-3,0 fov=35".parse().unwrap();
        assert_eq!(camera.eye(), [1.0, 2.5, 3.0]);
        assert_eq!(camera.fov(), 35.0);
        assert_eq!(camera.to_string().parse::<Camera>().unwrap(), camera);
    }

    #[test]
    fn invalid_cameras_are_refused_with_the_reason() {
        assert_eq!(error("eye=1,2 target=0,0,0"), "`eye` is `1,2`, expected three finite numbers like `1,2,3`");
        assert_eq!(error("eye=1,2,x target=0,0,0"), "`eye` is `1,2,x`, expected three finite numbers like `1,2,3`");
        assert_eq!(error("eye=1,2,3"), "`target` is missing, expected a camera like `eye=1,2,3 target=0,0,0 fov=35`");
        assert_eq!(error("eye=0,0,1 eye=0,0,2 target=0,0,0"), "`eye` is given twice, expected once");
        assert_eq!(
            error("zoom=2"),
            "`zoom=2` is not a camera setting, expected `eye=x,y,z`, `target=x,y,z`, `up=x,y,z` or `fov=degrees`"
        );
        assert_eq!(error("eye=0,0,1 target=0,0,0 fov=0"), "`fov` is `0`, expected an angle between 1 and 170 degrees");
        assert_eq!(error("eye=0,0,1 target=0,0,0 fov=wide"), "`fov` is `wide`, expected a number");
        assert_eq!(error("eye=0,0,1 target=0,0,0 up=0,0,0"), "`up` is `0,0,0`, expected a direction like `0,1,0`");
        assert_eq!(
            error("eye=0,0,1 target=0,0,1"),
            "`eye` and `target` are both [0.0, 0.0, 1.0], which gives no direction to look in"
        );
        assert_eq!(error("eye=inf,0,1 target=0,0,1"), "`eye` is `inf,0,1`, expected three finite numbers like `1,2,3`");
    }

    #[test]
    fn a_fitted_camera_shows_the_bounds_and_touches_the_margin() {
        for bounds in [
            [[-0.4, 0.0, -0.3], [0.4, 1.0, 0.3]],
            [[0.0, 0.0, 0.0], [10.0, 0.0, 10.0]],
            [[1000.0, 5.0, 0.0], [1000.1, 9.0, 0.1]],
            [[-1e-4; 3], [1e-4; 3]],
        ] {
            for aspect in [0.5, 1.0, 16.0 / 9.0] {
                let camera = Camera::fit(bounds, aspect);
                let frame = camera.axes();
                let tan = camera.half_tangent();
                let mut most = 0.0_f64;
                for corner in corners(proper(bounds)) {
                    let [x, y, z] = frame.map(|axis| axis.dot(&(corner - camera.eye)));
                    assert!(z > 0.0);
                    most = most.max((x / (z * tan * aspect)).abs()).max((y / (z * tan)).abs());
                }
                assert!((most - (1.0 - MARGIN)).abs() < 1e-6, "{most} for {bounds:?} at {aspect}");
            }
        }
    }

    #[test]
    fn empty_and_non_finite_bounds_give_a_camera() {
        let point = Camera::fit([[3.0; 3]; 2], 1.0);
        let unit_box = Camera::fit([[2.5; 3], [3.5; 3]], 1.0);
        assert_eq!(point, unit_box);
        assert_eq!(Camera::fit([[f32::NAN; 3]; 2], 1.0), Camera::fit([[-0.5; 3], [0.5; 3]], 1.0));
    }

    #[test]
    fn a_view_from_straight_above_has_an_up_direction() {
        let camera: Camera = "eye=0,5,0 target=0,0,0".parse().unwrap();
        let [right, up, forward] = camera.axes();
        assert_eq!(forward, -DVec3::y());
        assert_eq!((right, up), (DVec3::x(), -DVec3::z()));
    }
}
