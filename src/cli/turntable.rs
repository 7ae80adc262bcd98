//! Once around the scene.

use glam::{DQuat, DVec3};
use std::f64::consts::TAU;
use std::path::{Path, PathBuf};
use tison::geom::Bounds;
use tison::scene::{CameraDesc, CameraOverrides, Projection};

/// The file of frame `index` (from 0): `a/b.png` gives `a/b-0001.png` for the first.
pub fn frame_path(path: &Path, index: u32) -> PathBuf {
    let mut name = path.file_stem().unwrap_or_default().to_owned();
    name.push(format!("-{:04}", index + 1));
    if let Some(extension) = path.extension() {
        name.push(".");
        name.push(extension);
    }
    path.with_file_name(name)
}

/// The first camera of a turntable: where nothing was said about it, the axis goes through
/// the middle and the eye stands where the scene fits from all sides.
pub fn first(camera: &CameraDesc, given: &CameraOverrides, bounds: Bounds, aspect: f64) -> CameraDesc {
    let mut first = *camera;
    if given.eye.is_some() {
        return first;
    }
    let back = (camera.eye - camera.target).normalize();
    first.target = given.target.unwrap_or_else(|| bounds.center());
    let radius = 0.5 * bounds.size().length() + first.target.distance(bounds.center());
    let distance = match camera.projection {
        // The ball around the scene touches the narrower pair of the frustum's planes.
        Projection::Perspective { fov_deg } => {
            let tan = (0.5 * fov_deg.to_radians()).tan() * aspect.min(1.0);
            radius / tan.atan().sin()
        }
        Projection::Orthographic { .. } => 2.0 * radius,
    };
    first.eye = first.target + back * distance;
    first
}

/// `camera` turned by `index / frames` of a full turn around the axis `up` through its target.
pub fn turned(camera: &CameraDesc, up: DVec3, index: u32, frames: u32) -> CameraDesc {
    let turn = DQuat::from_axis_angle(up.normalize(), TAU * f64::from(index) / f64::from(frames));
    CameraDesc { eye: camera.target + turn * (camera.eye - camera.target), up: turn * camera.up, ..*camera }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn camera(fov_deg: f64) -> CameraDesc {
        CameraDesc {
            eye: DVec3::new(1.0, 2.0, 5.0),
            target: DVec3::ZERO,
            up: DVec3::Y,
            projection: Projection::Perspective { fov_deg },
            aperture: 0.0,
            focus: None,
            aspect: None,
            clip: None,
        }
    }

    #[test]
    fn frames_are_numbered_from_one() {
        assert_eq!(frame_path(Path::new("a/b.c.png"), 0), Path::new("a/b.c-0001.png"));
        assert_eq!(frame_path(Path::new("b.exr"), 12_344), Path::new("b-12345.exr"));
    }

    #[test]
    fn a_quarter_of_a_turn() {
        let camera = CameraDesc { eye: DVec3::new(0.0, 1.0, 2.0), ..camera(40.0) };
        let turned = turned(&camera, DVec3::Y * 7.0, 1, 4);
        assert!(turned.eye.abs_diff_eq(DVec3::new(2.0, 1.0, 0.0), 1e-12), "{}", turned.eye);
        assert!(turned.up.abs_diff_eq(DVec3::Y, 1e-12));
    }

    #[test]
    fn every_corner_is_in_the_picture_from_every_side() {
        let bounds = Bounds { lo: DVec3::new(-3.0, 1.0, 10.0), hi: DVec3::new(5.0, 2.0, 30.0) };
        let aspects = [0.5, 1.0, 16.0 / 9.0];
        for (fov, aspect) in [10.0, 40.0, 120.0].into_iter().flat_map(|f| aspects.map(|a| (f, a))) {
            let first = first(&camera(fov), &CameraOverrides::default(), bounds, aspect);
            for frame in 0..12 {
                let camera = turned(&first, DVec3::Y, frame, 12);
                let [right, up, forward] = camera.basis().unwrap();
                let tan = (0.5 * fov.to_radians()).tan();
                for corner in 0..8 {
                    let pick =
                        |bit: i32, axis: usize| if corner >> bit & 1 == 0 { bounds.lo[axis] } else { bounds.hi[axis] };
                    let p = DVec3::new(pick(0, 0), pick(1, 1), pick(2, 2)) - camera.eye;
                    let z = p.dot(forward);
                    assert!(z > 0.0 && p.dot(up).abs() <= z * tan && p.dot(right).abs() <= z * tan * aspect);
                }
            }
        }
    }

    #[test]
    fn an_eye_that_was_given_is_kept() {
        let given = CameraOverrides { eye: Some(DVec3::X), ..CameraOverrides::default() };
        let bounds = Bounds { lo: DVec3::splat(-9.0), hi: DVec3::splat(9.0) };
        assert_eq!(first(&camera(40.0), &given, bounds, 1.0), camera(40.0));
    }
}
