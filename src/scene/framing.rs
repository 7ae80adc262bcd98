//! A camera and lights for a mesh that brings none.

use super::{CameraDesc, Light, Projection, Scene};
use crate::geom::{BAD_FACE, Bounds, ShapeSet, TriangleMesh};
use crate::with_shapes;
use glam::{DVec2, DVec3, Vec3};
use rayon::prelude::*;

/// Named directions to look from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[expect(missing_docs, reason = "the names")]
pub enum View {
    #[default]
    ThreeQuarter,
    Front,
    Back,
    Left,
    Right,
    Top,
    Bottom,
}

/// What a user said about the camera; the rest is chosen.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CameraOverrides {
    /// Where it is.
    pub eye: Option<DVec3>,
    /// What it looks at.
    pub target: Option<DVec3>,
    /// Which way is up; +y unless given.
    pub up: Option<DVec3>,
    /// Projection; perspective with 40° unless given.
    pub projection: Option<Projection>,
    /// Lens radius in world units.
    pub aperture: Option<f64>,
    /// Distance to the plane in focus in world units.
    pub focus: Option<f64>,
}

/// Share of the picture's width and height that stays free around a framed mesh.
const MARGIN: f64 = 0.06;
/// Vertical field of view where none is given.
const FOV_DEG: f64 = 40.0;

impl View {
    /// All of them with their names.
    pub const ALL: [(&'static str, Self); 7] = [
        ("three-quarter", Self::ThreeQuarter),
        ("front", Self::Front),
        ("back", Self::Back),
        ("left", Self::Left),
        ("right", Self::Right),
        ("top", Self::Top),
        ("bottom", Self::Bottom),
    ];

    /// Unit vector from the mesh to the camera, given which way is up.
    fn direction(self, up: DVec3) -> DVec3 {
        // "Front" looks along -z unless up is along z: then along +y, as CAD programs do.
        let front = if up.z.abs() > 0.9 { DVec3::NEG_Y } else { DVec3::Z };
        let front = (front - up * front.dot(up)).try_normalize().unwrap_or_else(|| up.any_orthonormal_vector());
        let right = up.cross(front);
        match self {
            Self::ThreeQuarter => (front + 0.6 * right + 0.5 * up).normalize(),
            Self::Front => front,
            Self::Back => -front,
            Self::Left => -right,
            Self::Right => right,
            Self::Top => up,
            Self::Bottom => -up,
        }
    }
}

impl Scene {
    /// A camera that looks from `view` and shows the whole scene, as close as the picture's
    /// `aspect` (width / height) allows; what `overrides` gives is kept.
    ///
    /// # Errors
    /// A sentence, if what was given makes no camera.
    pub fn auto_camera(&self, view: View, overrides: &CameraOverrides, aspect: f64) -> Result<CameraDesc, String> {
        let up = overrides.up.unwrap_or(DVec3::Y);
        let unit_up = up.try_normalize().ok_or("the camera's up direction is zero")?;
        let back = view.direction(unit_up);
        // Straight from above or below, the picture's top is the scene's back.
        let level =
            if back.cross(unit_up).length() > 1e-6 { up } else { -View::Front.direction(unit_up) * back.dot(unit_up) };
        let center = self.bounds().center();
        let mut desc = CameraDesc {
            eye: center + back,
            target: center,
            up: level,
            projection: overrides.projection.unwrap_or(Projection::Perspective { fov_deg: FOV_DEG }),
            aperture: overrides.aperture.unwrap_or(0.0),
            focus: overrides.focus,
            aspect: None,
            clip: None,
        };
        match overrides.eye {
            Some(eye) => (desc.eye, desc.up) = (eye, up),
            None => desc.eye = self.fitted_eye(&desc, aspect)?,
        }
        match overrides.target {
            Some(target) => (desc.target, desc.up) = (target, up),
            // Keep looking the chosen way, at the depth of the middle.
            None if overrides.eye.is_none() => {
                desc.target = desc.eye - back * (desc.eye - center).dot(back);
            }
            None => {}
        }
        desc.prepare(&self.frame, (100, 100))?;
        Ok(desc)
    }

    /// The nearest eye from which everything lies inside the frustum.
    ///
    /// With the eye at `(ex, ey, ez)` in the camera's axes (z towards the viewer), a point is
    /// inside the right plane iff `x + k z <= ex + k ez`, and likewise for the other three.
    /// So the largest `±x + k z` and `±y + k z` over all points are all that matters.
    fn fitted_eye(&self, desc: &CameraDesc, aspect: f64) -> Result<DVec3, String> {
        let [right, up, forward] = desc.basis()?;
        let axes = |p: DVec3| DVec3::new(p.dot(right), p.dot(up), -p.dot(forward));
        let shrink = 1.0 - 2.0 * MARGIN;
        let tan = match desc.projection {
            Projection::Perspective { fov_deg } => (0.5 * fov_deg.to_radians()).tan() * shrink,
            Projection::Orthographic { .. } => 0.0,
        };
        let k = DVec2::new(tan * aspect, tan);
        let reach = self.reach(axes, k);
        if !reach.top.is_finite() {
            return Err("there is nothing to look at".into());
        }
        let middle = 0.5 * (reach.plus - reach.minus);
        let distance = if tan > 0.0 {
            let z = 0.5 * (reach.plus + reach.minus) / k;
            // At least a little before the nearest point, also for a flat mesh seen edge-on.
            z.max_element().max(reach.top + 1e-3 * (reach.plus + reach.minus).max_element())
        } else {
            reach.top + (reach.plus + reach.minus).max_element()
        };
        let local = right * middle.x + up * middle.y - forward * distance;
        Ok(self.frame.to_world(local))
    }

    /// Extremes over the corners of every triangle that can be hit, in camera axes.
    fn reach(&self, axes: impl Fn(DVec3) -> DVec3 + Sync, k: DVec2) -> Reach {
        let of_box = |r: Reach, b: Bounds| {
            let corner = |i: i32| DVec3::select(glam::BVec3::new(i & 1 > 0, i & 2 > 0, i & 4 > 0), b.hi, b.lo);
            (0..8).fold(r, |r, i| r.with(axes(corner(i)), k))
        };
        let of_object = |o: &super::Object| match o {
            super::Object::Mesh(m) => Reach::of_mesh(&m.data.triangles, k, &axes),
            super::Object::Instance(i) => {
                Reach::of_mesh(&i.mesh.data.triangles, k, |p| axes(i.to_scene.transform_point3(p)))
            }
            super::Object::Shapes(s) => {
                with_shapes!(&s.set, set => (0..set.len()).map(|i| set.bounds(i)).fold(Reach::NONE, of_box))
            }
        };
        self.objects.iter().map(of_object).fold(Reach::NONE, Reach::union)
    }

    /// Gives a scene without lights a key light over the viewer's left shoulder, a weaker fill
    /// from the right, and ambient light. From inside the scene's box both stand near the eye,
    /// since the walls would swallow the light of any that stands outside.
    pub fn light_from(&mut self, camera: &CameraDesc) {
        let Ok([right, up, forward]) = camera.basis() else { return };
        let bounds = self.local_bounds();
        let (center, radius) = (bounds.center(), 0.5 * bounds.size().length());
        let eye = self.frame.to_local(camera.eye);
        let inside = eye.cmpgt(bounds.lo).all() && eye.cmplt(bounds.hi).all();
        let place = |x: f64, y: f64, z: f64| {
            let direction = (right * x + up * y - forward * z).normalize();
            if inside { eye + direction * (0.05 * radius) } else { center + direction * (6.0 * radius) }
        };
        self.lights = vec![
            Light::constant(place(-0.6, 0.9, 0.8), Vec3::new(0.82, 0.80, 0.76)),
            Light::constant(place(0.9, 0.25, 0.7), Vec3::new(0.20, 0.22, 0.26)),
        ];
        self.ambient = Vec3::new(0.10, 0.105, 0.115);
    }
}

/// Largest `x + kx z`, `y + ky z` (plus), `-x + kx z`, `-y + ky z` (minus) and `z` (top).
#[derive(Clone, Copy, Debug, PartialEq)]
struct Reach {
    plus: DVec2,
    minus: DVec2,
    top: f64,
}

/// Vertices or triangles in one unit of work.
const CHUNK: usize = 1 << 14;

impl Reach {
    const NONE: Self = Self { plus: DVec2::NEG_INFINITY, minus: DVec2::NEG_INFINITY, top: f64::NEG_INFINITY };

    /// That of the corners of every triangle of `mesh` that can be hit, in camera `axes`.
    ///
    /// A mesh has far fewer vertices than corners, and they lie in a row; only if it turns out that an extreme one
    /// belongs to no triangle, all corners are gone through.
    fn of_mesh(mesh: &TriangleMesh, k: DVec2, axes: impl Fn(DVec3) -> DVec3 + Sync) -> Self {
        let place = |i: u32| Self::NONE.with(axes(mesh.point(i).as_dvec3()), k);
        let all = (0..mesh.vertex_count() as u32).into_par_iter().with_min_len(CHUNK);
        let found = all.clone().map(place).reduce(|| Self::NONE, Self::union);
        let attained = |i: u32| Self::attained(place(i), found);
        // A bit for each extreme that some triangle reaches; vertices that reach one are few.
        let extreme: Vec<(u32, u32)> = all.map(|i| (i, attained(i))).filter(|&(_, bits)| bits != 0).collect();
        let of_face = |face: &[u32; 3]| {
            let of_corner = |&i: &u32| extreme.iter().filter(|&&(e, _)| e == i).fold(0, |bits, &(_, more)| bits | more);
            face.iter().map(of_corner).fold(0, |a, b| a | b)
        };
        let few = extreme.len() <= 16;
        let faces = || mesh.faces().par_iter().with_min_len(CHUNK);
        if few && faces().map(of_face).reduce(|| 0, |a, b| a | b) == Self::ALL {
            return found;
        }
        let good = faces().filter(|&&face| face != BAD_FACE);
        good.map(|face| face.iter().map(|&i| place(i)).fold(Self::NONE, Self::union)).reduce(|| Self::NONE, Self::union)
    }

    /// A bit for each of its numbers.
    const ALL: u32 = 0b1_1111;

    /// Which numbers of `whole` this one has.
    fn attained(self, whole: Self) -> u32 {
        let equal = [
            self.plus.x == whole.plus.x,
            self.plus.y == whole.plus.y,
            self.minus.x == whole.minus.x,
            self.minus.y == whole.minus.y,
            self.top == whole.top,
        ];
        equal.iter().fold(0, |bits, &one| bits << 1 | u32::from(one))
    }

    #[inline]
    fn with(self, p: DVec3, k: DVec2) -> Self {
        let (xy, depth) = (p.truncate(), k * p.z);
        self.union(Self { plus: xy + depth, minus: depth - xy, top: p.z })
    }

    #[inline]
    fn union(self, o: Self) -> Self {
        Self { plus: self.plus.max(o.plus), minus: self.minus.max(o.minus), top: self.top.max(o.top) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Frame;
    use crate::scene::{Mesh, Object};
    use std::sync::Arc;

    /// A crooked tetrahedron, and a vertex far off that no face uses.
    fn scene() -> Scene {
        let points = vec![0.1, 0.0, 0.2, 1.0, 0.1, 0.0, 0.0, 0.5, 0.1, 0.3, 0.2, 0.9, 50.0, 50.0, 50.0];
        let faces = vec![[0, 1, 2], [0, 1, 3], [1, 2, 3], [0, 2, 3]];
        let triangles = Arc::new(TriangleMesh::new(points, faces));
        Scene {
            frame: Frame { origin: DVec3::new(1000.0, -3.0, 7.0), exponent: 3 },
            ..Scene::of(vec![Object::Mesh(Mesh::bare(triangles))])
        }
    }

    #[test]
    fn extremes_are_those_of_corners() {
        let k = DVec2::new(0.3, 0.2);
        let of_corners = |mesh: &TriangleMesh| {
            let corners = mesh.faces().iter().filter(|&&face| face != BAD_FACE).flatten();
            corners.fold(Reach::NONE, |r, &i| r.with(mesh.point(i).as_dvec3(), k))
        };
        let Object::Mesh(unused) = &scene().objects[0] else { unreachable!("it is a mesh") };
        // Vertex 2 belongs to a face that cannot be hit only; then to one that can.
        let points = vec![0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 9.0, 9.0, 9.0, 0.0, 1.0, -1.0];
        let bad = TriangleMesh::new(points.clone(), vec![[0, 1, 3], [2, 2, 1]]);
        let good = TriangleMesh::new(points, vec![[0, 1, 3], [2, 3, 1]]);
        // Half of its corners are extreme.
        let square = (0..200).flat_map(|i| [f32::from(i % 2 == 0), f32::from(i % 4 < 2), 0.0]).collect();
        let square = TriangleMesh::new(square, (0..197).map(|i| [i, i + 1, i + 2]).collect());
        for mesh in [&unused.data.triangles, &bad, &good, &square, &TriangleMesh::new(vec![], vec![])] {
            assert_eq!(Reach::of_mesh(mesh, k, |p| p), of_corners(mesh));
        }
        assert_ne!(of_corners(&bad), of_corners(&good));
    }

    /// Image coordinates in [0, 1] of every used vertex.
    fn seen(scene: &Scene, desc: &CameraDesc, size: (u32, u32)) -> Vec<DVec2> {
        let camera = desc.prepare(&scene.frame, size).expect("a good camera");
        let corners = (0..4).map(|i| scene.objects[0].mesh().expect("a mesh").data.triangles.point(i).as_dvec3());
        corners
            .map(|p| {
                let rel = if camera.parallel { p } else { (p - camera.eye) / (p - camera.eye).dot(camera.forward) };
                let rel = rel - camera.corner;
                DVec2::new(rel.dot(camera.right), rel.dot(camera.down))
                    / DVec2::new(camera.right.length_squared(), camera.down.length_squared())
                    / DVec2::new(f64::from(size.0), f64::from(size.1))
            })
            .collect()
    }

    #[test]
    fn every_view_shows_everything_as_large_as_fits() {
        let scene = scene();
        for (name, view) in View::ALL {
            for (size, fov_deg) in [((200, 100), 40.0), ((100, 300), 75.0), ((64, 64), 8.0)] {
                let overrides =
                    CameraOverrides { projection: Some(Projection::Perspective { fov_deg }), ..Default::default() };
                let aspect = f64::from(size.0) / f64::from(size.1);
                let desc = scene.auto_camera(view, &overrides, aspect).expect("a camera");
                let seen = seen(&scene, &desc, size);
                let lo = seen.iter().fold(DVec2::INFINITY, |a, &p| a.min(p));
                let hi = seen.iter().fold(DVec2::NEG_INFINITY, |a, &p| a.max(p));
                assert!(lo.min_element() > 0.0 && hi.max_element() < 1.0, "{name} {size:?}: {lo} {hi}");
                assert!((hi - lo).max_element() > 0.8, "{name} {size:?}: only {}", hi - lo);
                assert!((0.5 * (hi + lo) - 0.5).length() < 0.5, "{name} {size:?}");
            }
        }
    }

    #[test]
    fn what_the_user_says_is_kept() {
        let scene = scene();
        let eye = DVec3::new(1001.0, 4.0, 30.0);
        let over = CameraOverrides { eye: Some(eye), aperture: Some(0.5), focus: Some(3.0), ..Default::default() };
        let desc = scene.auto_camera(View::Front, &over, 1.0).expect("a camera");
        assert_eq!((desc.eye, desc.aperture, desc.focus), (eye, 0.5, Some(3.0)));
        assert_eq!(desc.target, scene.bounds().center());
        let over = CameraOverrides { eye: Some(eye), target: Some(eye), ..Default::default() };
        assert!(scene.auto_camera(View::Front, &over, 1.0).is_err());
    }

    #[test]
    fn an_eye_inside_is_lit_from_inside() {
        let mut scene = scene();
        let inside = scene.bounds().center();
        let over = CameraOverrides { eye: Some(inside), target: Some(inside + DVec3::X), ..Default::default() };
        let desc = scene.auto_camera(View::Front, &over, 1.0).expect("a camera");
        scene.light_from(&desc);
        let b = scene.local_bounds();
        assert!(scene.lights.iter().all(|l| l.position.cmpgt(b.lo).all() && l.position.cmplt(b.hi).all()));
        let desc = scene.auto_camera(View::Front, &CameraOverrides::default(), 1.0).expect("a camera");
        scene.light_from(&desc);
        assert!(scene.lights.iter().all(|l| !(l.position.cmpgt(b.lo).all() && l.position.cmplt(b.hi).all())));
    }
}
