//! Points, vectors and affine transforms in `f64`.

use nalgebra::{Matrix3, Matrix4, Point3, Vector3};
use thiserror::Error;

/// A place, in the space its name says; millimetres in world space.
pub type Point = Point3<f64>;
/// A direction or a difference of places.
pub type Vector = Vector3<f64>;

/// Why sixteen numbers are not a transform.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum SpaceError {
    /// A number is NaN or infinite.
    #[error("element {index} of the matrix is not finite")]
    NotFinite {
        /// Position in row-major order, from 0.
        index: usize,
    },
    /// The bottom row is not 0 0 0 1.
    #[error("the bottom row of the matrix is not 0 0 0 1")]
    NotAffine,
    /// The matrix flattens space, so it has no inverse.
    #[error("the matrix has no inverse")]
    Singular,
    /// The matrix is not a rotation and a translation.
    #[error("the matrix is not rigid (a rotation and a translation): it departs by {departure:.3e}")]
    NotRigid {
        /// Largest element of `RᵀR − 1`, or 2 for a mirror.
        departure: f64,
    },
}

/// An invertible affine transform, `b_from_a`, with its inverse kept beside it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Affine {
    matrix: Matrix4<f64>,
    inverse: Matrix4<f64>,
}

impl Default for Affine {
    fn default() -> Self {
        Self::identity()
    }
}

impl Affine {
    /// The transform that moves nothing.
    pub fn identity() -> Self {
        Self { matrix: Matrix4::identity(), inverse: Matrix4::identity() }
    }

    /// A shift by `by`.
    pub fn translation(by: Vector) -> Self {
        Self { matrix: Matrix4::new_translation(&by), inverse: Matrix4::new_translation(&-by) }
    }

    /// A turn of `angle_rad` about the line through `centre` along `axis` (need not be unit length),
    /// right-handed. A zero axis turns nothing.
    pub fn rotation_about(centre: Point, axis: Vector, angle_rad: f64) -> Self {
        let Some(unit) = nalgebra::Unit::try_new(axis, 0.0) else {
            return Self::identity();
        };
        let turn = nalgebra::Rotation3::from_axis_angle(&unit, angle_rad);
        let linear = turn.into_inner();
        let shift = centre.coords - linear * centre.coords;
        Self::from_parts_of_known_inverse(linear, linear.transpose(), shift)
    }

    fn from_parts_of_known_inverse(linear: Matrix3<f64>, back: Matrix3<f64>, shift: Vector) -> Self {
        let mut matrix = linear.to_homogeneous();
        matrix.fixed_view_mut::<3, 1>(0, 3).copy_from(&shift);
        let mut inverse = back.to_homogeneous();
        inverse.fixed_view_mut::<3, 1>(0, 3).copy_from(&-(back * shift));
        Self { matrix, inverse }
    }

    /// From the columns that a step along x, y, z makes and the place of the origin.
    ///
    /// # Errors
    /// [`SpaceError::NotFinite`] and [`SpaceError::Singular`].
    pub fn from_columns(x: Vector, y: Vector, z: Vector, origin: Point) -> Result<Self, SpaceError> {
        let linear = Matrix3::from_columns(&[x, y, z]);
        let mut matrix = linear.to_homogeneous();
        matrix.fixed_view_mut::<3, 1>(0, 3).copy_from(&origin.coords);
        Self::from_matrix(matrix)
    }

    /// From sixteen numbers, row by row, as a case file holds them.
    ///
    /// # Errors
    /// All of [`SpaceError`] but [`SpaceError::NotRigid`].
    pub fn from_row_major(numbers: &[f64; 16]) -> Result<Self, SpaceError> {
        Self::from_matrix(Matrix4::from_row_slice(numbers))
    }

    /// From a matrix with bottom row 0 0 0 1.
    ///
    /// # Errors
    /// All of [`SpaceError`] but [`SpaceError::NotRigid`].
    pub fn from_matrix(matrix: Matrix4<f64>) -> Result<Self, SpaceError> {
        if let Some(index) = matrix.transpose().iter().position(|v| !v.is_finite()) {
            return Err(SpaceError::NotFinite { index });
        }
        if matrix.row(3) != Matrix4::<f64>::identity().row(3) {
            return Err(SpaceError::NotAffine);
        }
        let linear: Matrix3<f64> = matrix.fixed_view::<3, 3>(0, 0).into_owned();
        let scale = linear.column_iter().map(|c| c.norm()).product::<f64>();
        if linear.determinant().abs() <= 1e-12 * scale || scale == 0.0 {
            return Err(SpaceError::Singular);
        }
        let back = linear.try_inverse().ok_or(SpaceError::Singular)?;
        let shift: Vector = matrix.fixed_view::<3, 1>(0, 3).into_owned();
        Ok(Self::from_parts_of_known_inverse(linear, back, shift))
    }

    /// Refuses what is not a rotation and a translation, within 1e-6.
    ///
    /// # Errors
    /// [`SpaceError::NotRigid`].
    pub fn require_rigid(self) -> Result<Self, SpaceError> {
        let linear = self.linear();
        let departure = if linear.determinant() < 0.0 {
            2.0
        } else {
            (linear.transpose() * linear - Matrix3::identity()).abs().max()
        };
        if departure > 1e-6 { Err(SpaceError::NotRigid { departure }) } else { Ok(self) }
    }

    /// The sixteen numbers, row by row.
    pub fn to_row_major(&self) -> [f64; 16] {
        let mut numbers = [0.0; 16];
        for (slot, value) in numbers.iter_mut().zip(self.matrix.transpose().iter()) {
            *slot = *value;
        }
        numbers
    }

    /// The 4×4 matrix.
    pub fn matrix(&self) -> &Matrix4<f64> {
        &self.matrix
    }

    /// The upper left 3×3 part: what happens to directions.
    pub fn linear(&self) -> Matrix3<f64> {
        self.matrix.fixed_view::<3, 3>(0, 0).into_owned()
    }

    /// The transform back: `a_from_b`.
    pub fn inverse(&self) -> Self {
        Self { matrix: self.inverse, inverse: self.matrix }
    }

    /// Where a place goes.
    pub fn point(&self, p: &Point) -> Point {
        Point::from(self.linear() * p.coords + self.matrix.fixed_view::<3, 1>(0, 3))
    }

    /// What becomes of a direction (lengths change with the scale).
    pub fn vector(&self, v: &Vector) -> Vector {
        self.linear() * v
    }

    /// What becomes of a surface normal (not normalised).
    pub fn normal(&self, n: &Vector) -> Vector {
        self.inverse.fixed_view::<3, 3>(0, 0).transpose() * n
    }

    /// Lengths of one step along x, y and z: the spacing of a grid whose `world_from_voxel` this is.
    pub fn column_lengths(&self) -> [f64; 3] {
        let linear = self.linear();
        [0, 1, 2].map(|axis| linear.column(axis).norm())
    }
}

impl std::ops::Mul for Affine {
    type Output = Self;
    fn mul(self, right: Self) -> Self {
        Self { matrix: self.matrix * right.matrix, inverse: right.inverse * self.inverse }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_turn_about_a_point_leaves_the_point() {
        let centre = Point::new(3.0, -4.0, 5.0);
        let turn = Affine::rotation_about(centre, Vector::new(1.0, 2.0, 3.0), 0.7);
        assert!((turn.point(&centre) - centre).norm() < 1e-12, "the centre moved");
        assert!(turn.require_rigid().is_ok(), "a rotation is rigid");
        let p = Point::new(1.0, 1.0, 1.0);
        assert!((turn.inverse().point(&turn.point(&p)) - p).norm() < 1e-12, "there and back");
    }

    #[test]
    fn broken_matrices_are_refused() {
        let mut m = Affine::identity().to_row_major();
        m[15] = 2.0;
        assert_eq!(Affine::from_row_major(&m), Err(SpaceError::NotAffine), "bottom row");
        let mut m = Affine::identity().to_row_major();
        m[0] = 0.0;
        assert_eq!(Affine::from_row_major(&m), Err(SpaceError::Singular), "flat");
        let mut m = Affine::identity().to_row_major();
        m[6] = f64::NAN;
        assert_eq!(Affine::from_row_major(&m), Err(SpaceError::NotFinite { index: 6 }), "NaN");
        let mut m = Affine::identity().to_row_major();
        m[0] = -1.0;
        let mirror = Affine::from_row_major(&m).and_then(Affine::require_rigid);
        assert_eq!(mirror, Err(SpaceError::NotRigid { departure: 2.0 }), "mirror");
    }
}
