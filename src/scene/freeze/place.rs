//! Where things are: from their own space to the world, and on to the scene's.

use crate::geom::Bounds;
use crate::math::Frame;
use crate::scene::desc::TransformStep;
use glam::DAffine3;

/// From the space that `from` leads out of to the world, by `steps`. `bounds` tells the box of the
/// thing when it is placed so far.
pub fn to_world(steps: &[TransformStep], from: DAffine3, bounds: impl Fn(&DAffine3) -> Bounds) -> DAffine3 {
    steps.iter().fold(from, |so_far, step| match *step {
        TransformStep::Matrix(m) => DAffine3::from_mat4(m) * so_far,
        TransformStep::Fit(length) => fit(&so_far, &bounds(&so_far), length),
    })
}

/// Moves the middle of the box to the origin, and scales its longest side to `length`.
fn fit(so_far: &DAffine3, bounds: &Bounds, length: f64) -> DAffine3 {
    let scale = length / bounds.size().max_element();
    DAffine3 { matrix3: so_far.matrix3 * scale, translation: (so_far.translation - bounds.center()) * scale }
}

/// From a mesh's stored coordinates to those of its file.
pub fn from_file(frame: &Frame) -> DAffine3 {
    let unit = frame.world_per_local();
    DAffine3::from_scale_rotation_translation(glam::DVec3::splat(unit), glam::DQuat::IDENTITY, frame.origin)
}

/// What leads to the world, led on to scene space.
pub fn to_scene(frame: &Frame, to_world: &DAffine3) -> DAffine3 {
    DAffine3 { matrix3: to_world.matrix3 * frame.local_per_world(), translation: frame.to_local(to_world.translation) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{DMat4, DVec3};

    fn unit_box(to: &DAffine3) -> Bounds {
        Bounds { lo: -DVec3::ONE, hi: DVec3::ONE }.under(to)
    }

    #[test]
    fn steps_are_taken_in_order_and_fit_sees_those_before_it() {
        let scale = TransformStep::Matrix(DMat4::from_scale(DVec3::new(1.0, 3.0, 0.5)));
        let shift = TransformStep::Matrix(DMat4::from_translation(DVec3::new(10.0, 0.0, 0.0)));
        let placed = |steps: &[TransformStep]| unit_box(&to_world(steps, DAffine3::IDENTITY, unit_box));
        let half = DVec3::new(1.0, 3.0, 0.5);
        let at = |center: DVec3, half: DVec3| Bounds { lo: center - half, hi: center + half };
        assert_eq!(placed(&[]), at(DVec3::ZERO, DVec3::ONE));
        assert_eq!(placed(&[scale, shift]), at(DVec3::X * 10.0, half));
        assert_eq!(placed(&[shift, scale, TransformStep::Fit(12.0)]), at(DVec3::ZERO, 2.0 * half));
        assert_eq!(placed(&[TransformStep::Fit(12.0), scale, shift]), at(DVec3::X * 10.0, 6.0 * half));
    }

    #[test]
    fn frames_lead_in_and_out() {
        let file = Frame { origin: DVec3::new(1e6, -2.0, 0.5), exponent: 5 };
        let p = DVec3::new(0.5, -0.25, 1.0);
        assert_eq!(from_file(&file).transform_point3(p), file.to_world(p));
        let scene = Frame { origin: DVec3::new(1e6, 0.0, 0.0), exponent: -3 };
        let led = to_scene(&scene, &from_file(&file));
        assert_eq!(led.transform_point3(p), scene.to_local(file.to_world(p)));
        // The same frame twice is no change at all: a mesh by itself keeps its bits.
        assert_eq!(to_scene(&file, &from_file(&file)), DAffine3::IDENTITY);
    }
}
