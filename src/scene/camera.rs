//! Cameras: as a user gives them, in world space.

use crate::geom::{LANES, RayPacket};
use crate::math::Frame;
use crate::simd::{self, Kernel};
use glam::{DVec2, DVec3};

/// A camera as given: world space, f64.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CameraDesc {
    /// Where it is.
    pub eye: DVec3,
    /// What it looks at.
    pub target: DVec3,
    /// Which way is up in the picture; need not be orthogonal to the view.
    pub up: DVec3,
    /// What lines it projects along.
    pub projection: Projection,
    /// Radius of the thin lens in world units; 0 is a pinhole.
    pub aperture: f64,
    /// Distance from the eye to the plane in focus, along the view; the target's unless given.
    pub focus: Option<f64>,
    /// Width over height of the view, where it is not the image's.
    pub aspect: Option<f64>,
    /// A hit nearer or farther than this, in world units along the ray, shows the background.
    pub clip: Option<(f64, f64)>,
}

/// Kinds of projection.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Projection {
    /// All rays meet in the eye; the full vertical angle of view in degrees, in (0, 180).
    Perspective {
        /// Vertical field of view in degrees.
        fov_deg: f64,
    },
    /// All rays are parallel.
    Orthographic {
        /// Height of the view in world units.
        height: f64,
    },
}

/// A camera made ready for one image size, in scene space.
///
/// A ray through the point `(x, y)` of the image, in pixels from the top left, has
/// direction `corner + x * right + y * down` (perspective) or starts there (orthographic).
#[derive(Clone, Copy, Debug)]
pub struct Camera {
    /// Where it is.
    pub eye: DVec3,
    /// Unit vector of the view.
    pub forward: DVec3,
    /// Whether rays are parallel.
    pub parallel: bool,
    /// See above.
    pub corner: DVec3,
    /// Step to the next pixel to the right.
    pub right: DVec3,
    /// Step to the next pixel down.
    pub down: DVec3,
    /// The lens; `None` for a pinhole.
    pub lens: Option<Lens>,
    /// A hit nearer or farther than this along the ray is not seen.
    pub clip: Option<(f64, f64)>,
}

/// A thin lens.
#[derive(Clone, Copy, Debug)]
pub struct Lens {
    /// Radius times the unit vectors across and up.
    pub across: DVec3,
    /// See `across`.
    pub up: DVec3,
    /// Distance to the plane in focus along `forward`.
    pub focus: f64,
}

impl CameraDesc {
    /// Unit vectors right, up and forward.
    ///
    /// # Errors
    /// A sentence, if they cannot be told: the eye in the target, `up` along the view,
    /// or a number that is not finite.
    pub fn basis(&self) -> Result<[DVec3; 3], String> {
        if !(self.eye.is_finite() && self.target.is_finite() && self.up.is_finite()) {
            return Err("the camera's eye, target and up must be finite".into());
        }
        let forward = (self.target - self.eye)
            .try_normalize()
            .ok_or("the camera's eye and target are the same point; move one of them")?;
        let up = self.up.try_normalize().ok_or("the camera's up direction is zero")?;
        let right = forward.cross(up);
        if right.length() < 1e-9 {
            return Err("the camera's up direction is along its view; choose another --up".into());
        }
        let right = right.normalize();
        Ok([right, right.cross(forward), forward])
    }

    /// The camera for an image of `size` pixels in the scene that `frame` leads to.
    ///
    /// # Errors
    /// As [`CameraDesc::basis`]; also a field of view, height, aperture or focus out of range.
    pub fn prepare(&self, frame: &Frame, size: (u32, u32)) -> Result<Camera, String> {
        let [right, up, forward] = self.basis()?;
        let (w, h) = (f64::from(size.0), f64::from(size.1));
        let eye = frame.to_local(self.eye);
        let unit = frame.local_per_world();
        let (parallel, pixel) = match self.projection {
            Projection::Perspective { fov_deg } if fov_deg > 0.0 && fov_deg < 180.0 => {
                (false, 2.0 * (0.5 * fov_deg.to_radians()).tan() / h)
            }
            Projection::Perspective { fov_deg } => {
                return Err(format!("a field of view of {fov_deg} degrees is not between 0 and 180"));
            }
            Projection::Orthographic { height } if height > 0.0 && height.is_finite() => (true, height * unit / h),
            Projection::Orthographic { height } => return Err(format!("a view {height} high shows nothing")),
        };
        let start = if parallel { eye } else { forward };
        let lens = self.lens(unit, right, up, forward)?;
        let (right, down) = (right * pixel * self.stretch(w / h)?, -up * pixel);
        let corner = start - right * (0.5 * w) - down * (0.5 * h);
        let clip = self.clip.map(|(near, far)| (near * unit, far * unit));
        Ok(Camera { eye, forward, parallel, corner, right, down, lens, clip })
    }

    /// How much wider than high a pixel is, for an image whose width is `image` times its height.
    fn stretch(&self, image: f64) -> Result<f64, String> {
        match self.aspect {
            None => Ok(1.0),
            Some(view) if view > 0.0 && view.is_finite() => Ok(view / image),
            Some(view) => Err(format!("an aspect of {view} is no width over height")),
        }
    }

    fn lens(&self, unit: f64, right: DVec3, up: DVec3, forward: DVec3) -> Result<Option<Lens>, String> {
        if !(self.aperture >= 0.0 && self.aperture.is_finite()) {
            return Err(format!("an aperture of {} is no radius of a lens", self.aperture));
        }
        if self.aperture == 0.0 {
            return Ok(None);
        }
        let focus = self.focus.unwrap_or_else(|| (self.target - self.eye).dot(forward));
        if !(focus > 0.0 && focus.is_finite()) {
            return Err(format!("a focus distance of {focus} is not in front of the camera"));
        }
        let radius = self.aperture * unit;
        Ok(Some(Lens { across: right * radius, up: up * radius, focus: focus * unit }))
    }
}

impl Camera {
    /// Origin and direction of the ray through image point `(x, y)` in pixels and the point
    /// `lens` of the unit disc (zero for a pinhole). The direction's part along the view is 1.
    #[inline]
    #[must_use]
    pub fn ray(&self, x: f64, y: f64, lens: DVec2) -> (DVec3, DVec3) {
        let at = self.corner + self.right * x + self.down * y;
        let (o, d) = if self.parallel { (at, self.forward) } else { (self.eye, at) };
        let Some(l) = &self.lens else { return (o, d) };
        let shift = l.across * lens.x + l.up * lens.y;
        (o + shift, d - shift / l.focus)
    }
}

/// [`Camera::ray`] for a packet: image points and points of the unit disc, one per lane.
#[derive(Debug)]
pub struct CameraRays<'a> {
    /// The camera.
    pub camera: &'a Camera,
    /// Image points in pixels: x, y.
    pub at: &'a [[f64; LANES]; 2],
    /// Lens points.
    pub lens: &'a [[f64; LANES]; 2],
    /// Where the rays go.
    pub packet: &'a mut RayPacket,
}

impl CameraRays<'_> {
    /// Computes them.
    pub fn fill(self) {
        if self.camera.lens.is_some() {
            simd::run(Fill::<true>(self));
        } else {
            simd::run(Fill::<false>(self));
        }
    }
}

/// With a lens, or a pinhole.
struct Fill<'a, const LENS: bool>(CameraRays<'a>);

impl<const LENS: bool> Kernel for Fill<'_, LENS> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Self(CameraRays { camera: c, at: image, lens, packet: p }) = self;
        let (across, up, focus) = c.lens.map_or((DVec3::ZERO, DVec3::ZERO, 1.0), |l| (l.across, l.up, l.focus));
        let (mut o, mut d) = ([[0f32; LANES]; 3], [[0f32; LANES]; 3]);
        for k in 0..3 {
            for i in 0..LANES {
                let at = c.corner[k] + c.right[k] * image[0][i] + c.down[k] * image[1][i];
                let (mut from, mut along) = if c.parallel { (at, c.forward[k]) } else { (c.eye[k], at) };
                if LENS {
                    let shift = across[k] * lens[0][i] + up[k] * lens[1][i];
                    (from, along) = (from + shift, along - shift / focus);
                }
                let along = along as f32;
                o[k][i] = from as f32;
                d[k][i] = if along.abs() < f32::MIN_POSITIVE { 0.0 } else { along };
            }
        }
        [p.o_x, p.o_y, p.o_z] = o;
        [p.d_x, p.d_y, p.d_z] = d;
        p.t_near = [0.0; LANES];
        p.t_far = [f32::INFINITY; LANES];
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn desc() -> CameraDesc {
        CameraDesc {
            eye: DVec3::new(1.0, 2.0, 10.0),
            target: DVec3::new(1.0, 2.0, 0.0),
            up: DVec3::new(0.0, 3.0, 1.0),
            projection: Projection::Perspective { fov_deg: 90.0 },
            aperture: 0.0,
            focus: None,
            aspect: None,
            clip: None,
        }
    }

    fn frame() -> Frame {
        Frame { origin: DVec3::new(0.5, 0.5, 0.5), exponent: 2 }
    }

    #[test]
    fn the_picture_is_upright_and_spans_the_field_of_view() {
        let camera = desc().prepare(&frame(), (200, 100)).expect("a good camera");
        let (o, d) = camera.ray(100.0, 50.0, DVec2::ZERO);
        assert_eq!(o, frame().to_local(desc().eye));
        assert!((d - DVec3::NEG_Z).length() < 1e-15);
        let (_, top) = camera.ray(100.0, 0.0, DVec2::ZERO);
        assert!((top - DVec3::new(0.0, 1.0, -1.0)).length() < 1e-14, "{top}");
        let (_, right) = camera.ray(200.0, 50.0, DVec2::ZERO);
        assert!((right - DVec3::new(2.0, 0.0, -1.0)).length() < 1e-14, "{right}");
    }

    #[test]
    fn orthographic_rays_are_parallel_and_span_the_height() {
        let ortho = CameraDesc { projection: Projection::Orthographic { height: 8.0 }, ..desc() };
        let camera = ortho.prepare(&frame(), (200, 100)).expect("a good camera");
        let ((top, d), (bottom, e)) = (camera.ray(100.0, 0.0, DVec2::ZERO), camera.ray(100.0, 100.0, DVec2::ZERO));
        assert_eq!(d, e);
        assert!((top - bottom - DVec3::new(0.0, 2.0, 0.0)).length() < 1e-14, "8 world units are 2 here");
    }

    #[test]
    fn every_lens_ray_meets_in_the_plane_of_focus() {
        let lens = CameraDesc { aperture: 0.3, focus: Some(4.0), ..desc() };
        for projection in [lens.projection, Projection::Orthographic { height: 3.0 }] {
            let camera = CameraDesc { projection, ..lens }.prepare(&frame(), (64, 48)).expect("a good camera");
            let meet = |p: DVec2| {
                let (o, d) = camera.ray(11.0, 33.0, p);
                o + d // 4 world units are 1 here
            };
            for p in [DVec2::X, DVec2::NEG_Y, DVec2::new(0.3, -0.6)] {
                assert!((meet(p) - meet(DVec2::ZERO)).length() < 1e-15);
            }
        }
    }

    #[test]
    fn a_packet_holds_the_rays_one_by_one() {
        let lens = CameraDesc { aperture: 0.3, focus: Some(4.0), ..desc() };
        for d in [desc(), lens, CameraDesc { projection: Projection::Orthographic { height: 3.0 }, ..lens }] {
            let camera = d.prepare(&frame(), (64, 48)).expect("a good camera");
            let at = [std::array::from_fn(|i| i as f64 * 3.7), std::array::from_fn(|i| 40.0 - i as f64 * 2.1)];
            let disc =
                [std::array::from_fn(|i| (i as f64).sin() * 0.7), std::array::from_fn(|i| (i as f64).cos() * 0.7)];
            let mut packet = RayPacket::EMPTY;
            CameraRays { camera: &camera, at: &at, lens: &disc, packet: &mut packet }.fill();
            for i in 0..LANES {
                let (o, d) = camera.ray(at[0][i], at[1][i], DVec2::new(disc[0][i], disc[1][i]));
                let ray = packet.get(i);
                assert_eq!((ray.o, ray.d), (o.as_vec3(), d.as_vec3()));
            }
        }
    }

    #[test]
    fn an_aspect_of_its_own_stretches_the_view() {
        let camera = CameraDesc { aspect: Some(3.0), ..desc() }.prepare(&frame(), (64, 48)).expect("a good camera");
        let (_, left) = camera.ray(0.0, 24.0, DVec2::ZERO);
        let (_, top) = camera.ray(32.0, 0.0, DVec2::ZERO);
        let off = |d: DVec3| (d - camera.forward).length();
        assert!((off(left) - 3.0 * off(top)).abs() < 1e-12);
        assert!(CameraDesc { aspect: Some(0.0), ..desc() }.prepare(&frame(), (64, 48)).is_err());
    }

    #[test]
    fn impossible_cameras_are_refused_in_words() {
        let refused = |d: CameraDesc| d.prepare(&frame(), (4, 4)).expect_err("must be refused");
        assert!(refused(CameraDesc { target: desc().eye, ..desc() }).contains("same point"));
        assert!(refused(CameraDesc { up: DVec3::NEG_Z, ..desc() }).contains("--up"));
        assert!(refused(CameraDesc { up: DVec3::ZERO, ..desc() }).contains("zero"));
        assert!(refused(CameraDesc { eye: DVec3::NAN, ..desc() }).contains("finite"));
        for fov_deg in [0.0, 180.0, f64::NAN] {
            refused(CameraDesc { projection: Projection::Perspective { fov_deg }, ..desc() });
        }
        refused(CameraDesc { projection: Projection::Orthographic { height: -1.0 }, ..desc() });
        refused(CameraDesc { aperture: -1.0, ..desc() });
        refused(CameraDesc { aperture: 1.0, focus: Some(0.0), ..desc() });
    }
}
