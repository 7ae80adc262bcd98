//! A scene of one shape and nothing else.

use super::place;
use super::shapes::{OneShape, Sets};
use crate::geom::{ShapeError, invert};
use crate::math::Frame;
use crate::scene::{Object, Scene};
use glam::DAffine3;

impl Scene {
    /// `shape` as `to_world` places it, in a frame of its own: of the default material, without light.
    ///
    /// # Errors
    /// [`ShapeError`], if the transform cannot be undone or takes the shape further than numbers reach.
    pub fn of_one(shape: OneShape, to_world: &DAffine3) -> Result<Self, ShapeError> {
        invert(to_world)?;
        let bounds = shape.bounds(to_world);
        if !(bounds.lo.is_finite() && bounds.hi.is_finite()) {
            return Err(ShapeError::TooFar);
        }
        let half = 0.5 * bounds.size().max_element();
        let thing = (bounds.center(), half.max(f64::MIN_POSITIVE));
        let frame = Frame::around(&[thing], (bounds.lo, bounds.hi));
        let mut sets = Sets::default();
        let class = sets.add(shape, &place::to_scene(&frame, to_world), 0)?;
        Ok(Self { frame, ..Self::of(vec![Object::Shapes(sets.take(class))]) })
    }
}
