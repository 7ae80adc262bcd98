//! From a reported hit to a point that can be shaded.

use crate::geom::{Hit, offset_origin, triangle};
use crate::scene::{Object, Scene};
use glam::{DVec3, Vec3};

/// Everything shading asks about a hit, f64 where a decision hangs on it.
#[derive(Clone, Copy, Debug)]
pub struct SurfacePoint {
    /// The point, scene space.
    pub p: DVec3,
    /// Unit geometric normal, turned to the side the ray came from.
    pub ng: DVec3,
    /// Unit shading normal on the same side.
    pub ns: DVec3,
    /// Unit vector back along the ray.
    pub to_eye: Vec3,
    /// Where rays start that leave on the ray's side; over a smooth surface lifted out of
    /// the facet's shadow.
    pub front: Vec3,
    /// Size of the primitive, for offsets.
    pub extent: f64,
    /// Index of the material.
    pub material: u32,
    /// Whether the ray met the side that the winding calls outer.
    pub entering: bool,
    /// Ray parameter.
    pub t: f64,
}

impl SurfacePoint {
    /// Widens `hit` of the ray `o + t d`.
    #[inline]
    #[must_use]
    pub fn new(scene: &Scene, o: Vec3, d: Vec3, hit: &Hit) -> Self {
        let object = &scene.objects[hit.geom_id as usize];
        let corners = object.mesh.triangle(hit.prim_id);
        let r = triangle::refine(o, d, corners, (hit.u, hit.v));
        let outer = r.ng.normalize();
        let entering = outer.dot(d.as_dvec3()) < 0.0;
        let ng = if entering { outer } else { -outer };
        let mut point = Self {
            p: r.p,
            ng,
            ns: ng,
            to_eye: -d.normalize(),
            front: Vec3::ZERO,
            extent: r.extent,
            material: object.material(hit.prim_id) as u32,
            entering,
            t: r.t,
        };
        let lifted = point.interpolate(object, hit.prim_id, corners, &r);
        point.front = offset_origin(lifted, ng, r.extent);
        point
    }

    /// Takes the shading normal from the corners where they have one. Returns the point from
    /// which the surface that the normals pretend would cast its shadows: the facet's own
    /// point lifted onto the corners' tangent planes where those lie outside.
    ///
    /// Source: J. Hanika, "Hacking the Shadow Terminator", Ray Tracing Gems II, ch. 4.
    #[inline]
    fn interpolate(&mut self, object: &Object, prim: u32, corners: [Vec3; 3], r: &triangle::Refined) -> DVec3 {
        let Some(normals) = object.corner_normals(prim) else {
            return self.p;
        };
        let weights = [1.0 - r.u - r.v, r.u, r.v];
        let side = if self.entering { 1.0 } else { -1.0 };
        let n: [DVec3; 3] = normals.map(|n| n.as_dvec3() * side);
        let sum = n[0] * weights[0] + n[1] * weights[1] + n[2] * weights[2];
        let length = sum.length();
        // Normals that cancel say nothing.
        if !(length > 1e-6) {
            return self.p;
        }
        let ns = sum / length;
        let facing = ns.dot(self.ng) >= 0.0;
        self.ns = if facing { ns } else { -ns };
        if !facing {
            return self.p;
        }
        let lift = |i: usize| {
            let below = (self.p - corners[i].as_dvec3()).dot(n[i]).min(0.0);
            n[i] * (weights[i] * below)
        };
        self.p - (lift(0) + lift(1) + lift(2))
    }

    /// Where a ray starts that leaves along `w` on its side of the facet.
    #[inline]
    #[must_use]
    pub fn origin_towards(&self, w: DVec3) -> Vec3 {
        let side = if w.dot(self.ng) >= 0.0 { self.ng } else { -self.ng };
        offset_origin(self.p, side, self.extent)
    }
}
