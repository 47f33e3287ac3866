//! Where a prim is: its operations in order, composed from the root down.

use super::layer::{Layer, Value};
use super::matrix::Matrix;
use super::stage::{Prim, UsdStage, refused};
use crate::Result;

const INVERT: &str = "!invert!";
const RESET: &str = "!resetXformStack!";

/// From the stage's axes and unit to Y up and metres.
pub(super) fn to_ours(root: &Layer) -> Result<Matrix> {
    let unit = root.value_of(0, "metersPerUnit")?.and_then(|unit| unit.number());
    // What USD takes where a file does not say: centimetres.
    let unit = unit.filter(|unit| unit.is_finite() && *unit > 0.0).unwrap_or(0.01);
    let up = root.value_of(0, "upAxis")?;
    let is_z_up = up.as_ref().and_then(Value::text) == Some("Z");
    let axes = Matrix([[1.0, 0.0, 0.0, 0.0], [0.0, 0.0, -1.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]]);
    let scale = Matrix::scaling([unit; 3]);
    Ok(if is_z_up { axes.then(&scale) } else { scale })
}

impl UsdStage {
    /// Where a prim is at a time, if what is above it is at `above`.
    pub(super) fn placed(&self, prim: &Prim, above: &Matrix, top: &Matrix, time: f64) -> Result<Matrix> {
        let order = match self.sampled(prim, "xformOpOrder", time)?.value()? {
            Some(Value::Texts(order)) if !order.is_empty() => order,
            _ => return Ok(*above),
        };
        let (mut above, mut local) = (above, Matrix::IDENTITY);
        // The last is applied first.
        for operation in order.iter().rev() {
            if &**operation == RESET {
                above = top;
                break;
            }
            let (name, inverts) = match operation.strip_prefix(INVERT) {
                Some(name) => (name, true),
                None => (&**operation, false),
            };
            let Some(value) = self.sampled(prim, name, time)?.value()? else { continue };
            let matrix = operation_matrix(name, &value).ok_or_else(|| {
                let hint = "bake it to a matrix in the program that made it";
                refused(&prim.path, format!("has a transform `{name}` that is not read"), hint)
            })?;
            let matrix = match inverts {
                true => matrix.inverse().ok_or_else(|| {
                    let fact = format!("has a transform `{name}` that is inverted and has no inverse");
                    refused(&prim.path, fact, "remove it, or scale by a number that is not 0")
                })?,
                false => matrix,
            };
            local = local.then(&matrix);
        }
        Ok(local.then(above))
    }
}

/// The matrix of an operation such as `xformOp:rotateXYZ:pivot`.
fn operation_matrix(name: &str, value: &Value) -> Option<Matrix> {
    let kind = name.strip_prefix("xformOp:")?.split(':').next()?;
    let vector = || match value {
        Value::Numbers(numbers) => <[f64; 3]>::try_from(numbers.as_slice()).ok(),
        _ => None,
    };
    Some(match kind {
        "translate" => Matrix::translation(vector()?),
        "translateX" => Matrix::translation([value.number()?, 0.0, 0.0]),
        "translateY" => Matrix::translation([0.0, value.number()?, 0.0]),
        "translateZ" => Matrix::translation([0.0, 0.0, value.number()?]),
        "scale" => Matrix::scaling(vector()?),
        "scaleX" => Matrix::scaling([value.number()?, 1.0, 1.0]),
        "scaleY" => Matrix::scaling([1.0, value.number()?, 1.0]),
        "scaleZ" => Matrix::scaling([1.0, 1.0, value.number()?]),
        "orient" => match value {
            Value::Quaternion(q) => Matrix::orientation(normalized_quaternion(*q)?),
            _ => return None,
        },
        "transform" => match value {
            Value::Numbers(numbers) => Matrix::of_numbers(numbers)?,
            _ => return None,
        },
        _ => {
            let axes = kind.strip_prefix("rotate")?;
            let degrees = if axes.len() == 1 { [value.number()?; 3] } else { vector()? };
            let axis = |letter: u8| letter.checked_sub(b'X').filter(|axis| *axis < 3).map(usize::from);
            let axes = axes.bytes().map(axis).collect::<Option<Vec<usize>>>()?;
            // The first letter is applied first.
            axes.iter().fold(Matrix::IDENTITY, |all, axis| all.then(&Matrix::rotation(*axis, degrees[*axis])))
        }
    })
}

fn normalized_quaternion(q: [f64; 4]) -> Option<[f64; 4]> {
    let length = q.iter().fold(0.0, |sum, x| sum + x * x).sqrt();
    (length > 0.0).then(|| q.map(|x| x / length))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn moved(name: &str, value: Value, point: [f64; 3]) -> [f64; 3] {
        operation_matrix(name, &value).unwrap().point(point).map(|x| (x * 1e6).round() / 1e6)
    }

    #[test]
    fn each_operation_moves_a_point_as_computed_by_hand() {
        let numbers = |numbers: &[f64]| Value::Numbers(numbers.to_vec());
        let p = [1.0, 2.0, 3.0];
        assert_eq!(moved("xformOp:translate:pivot", numbers(&[10.0, 0.0, 0.0]), p), [11.0, 2.0, 3.0]);
        assert_eq!(moved("xformOp:scale", numbers(&[2.0, 3.0, 4.0]), p), [2.0, 6.0, 12.0]);
        assert_eq!(moved("xformOp:rotateZ", Value::Double(90.0), p), [-2.0, 1.0, 3.0]);
        // About X to (1, −3, 2), then about Z to (3, 1, 2).
        assert_eq!(moved("xformOp:rotateXYZ", numbers(&[90.0, 0.0, 90.0]), p), [3.0, 1.0, 2.0]);
        // About Z to (−2, 1, 3), then about X to (−2, −3, 1).
        assert_eq!(moved("xformOp:rotateZYX", numbers(&[90.0, 0.0, 90.0]), p), [-2.0, -3.0, 1.0]);
        assert_eq!(moved("xformOp:orient", Value::Quaternion([0.0, 0.0, 5.0, 5.0]), p), [-2.0, 1.0, 3.0]);
        let matrix = [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 5.0, 6.0, 7.0, 1.0];
        assert_eq!(moved("xformOp:transform", numbers(&matrix), p), [6.0, 8.0, 10.0]);
        assert_eq!(operation_matrix("xformOp:rotateQ", &Value::Double(1.0)), None);
        assert_eq!(operation_matrix("xformOp:orient", &Value::Quaternion([0.0; 4])), None);
    }
}
