//! What affine transforms do to space: normals, inverses, mirrors.

use super::ShapeError;
use glam::{DAffine3, DMat3};

/// Exact power of two near the largest entry of `m`: with it divided out, no determinant over- or underflows.
fn magnitude(m: &DMat3) -> f64 {
    let largest = m.to_cols_array().into_iter().fold(0.0, |a: f64, x| a.max(x.abs()));
    let exponent = (largest.to_bits() >> 52) as i32 - 1023;
    2f64.powi(exponent.clamp(-1000, 1000))
}

/// Columns of the cofactor matrix.
pub(crate) fn cofactors(m: &DMat3) -> DMat3 {
    let [x, y, z] = [m.x_axis, m.y_axis, m.z_axis];
    DMat3::from_cols(y.cross(z), z.cross(x), x.cross(y))
}

/// Whether `m` mirrors space: it turns right-handed axes into left-handed ones.
pub(crate) fn mirrors(m: &DMat3) -> bool {
    let m = *m * (1.0 / magnitude(m));
    m.x_axis.dot(cofactors(&m).x_axis) < 0.0
}

/// What takes normals where `m` takes points, up to their length: the cofactor matrix with the determinant's sign, which is the
/// inverse transpose up to a positive factor, without a division.
pub(crate) fn normal_matrix(m: &DMat3) -> DMat3 {
    let m = *m * (1.0 / magnitude(m));
    let cof = cofactors(&m);
    let det = m.x_axis.dot(cof.x_axis);
    cof * det.signum()
}

/// Inverse of the linear part of `to_world`.
///
/// # Errors
/// [`ShapeError::TransformNotFinite`]; [`ShapeError::Singular`] when there is no inverse to f64 rounding.
pub fn invert(to_world: &DAffine3) -> Result<DMat3, ShapeError> {
    /// Share of the box's volume that the rounding of the entries alone can make.
    const NOTHING: f64 = 4e-15;
    if !to_world.is_finite() {
        return Err(ShapeError::TransformNotFinite);
    }
    let scale = 1.0 / magnitude(&to_world.matrix3);
    let m = to_world.matrix3 * scale;
    let cof = cofactors(&m);
    let det = m.x_axis.dot(cof.x_axis);
    let volume = det.abs() / (m.x_axis.length() * m.y_axis.length() * m.z_axis.length());
    let inverse = cof.transpose() * (1.0 / det) * scale;
    // A NaN, from an axis of length 0, is no volume either.
    if volume >= NOTHING && inverse.is_finite() {
        Ok(inverse)
    } else {
        Err(ShapeError::Singular { volume: if volume > 0.0 { volume } else { 0.0 } })
    }
}
