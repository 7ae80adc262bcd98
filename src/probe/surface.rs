//! What a backend hit, anew in f64 for the ray as it is.

use super::Answer;
use crate::geom::{Hit64, Ray64, ShapeSet, triangle};
use crate::scene::{Instance, Mesh, Object, Scene};
use crate::with_shapes;
use glam::{DVec2, DVec3, Vec2, Vec3};

/// The point of a surface that a ray meets, in scene space.
#[derive(Clone, Copy, Debug)]
pub struct Surface {
    /// Parameter of the scene-space ray.
    pub t: f64,
    /// How far from the ray it is: more than rounding where a backend was wrong.
    pub off: f64,
    p: DVec3,
    n: DVec3,
    ng: DVec3,
    uv: DVec2,
    texcoord: Option<DVec2>,
    entering: bool,
}

impl Surface {
    /// Where `ray` meets what was hit. Beyond `before` its shape is not met until there.
    pub fn of(scene: &Scene, ray: &Ray64, hit: &Hit64, before: f64) -> Self {
        match &scene.objects[hit.geom_id as usize] {
            Object::Shapes(shapes) => {
                let at = with_shapes!(&shapes.set, set => set.refine(hit.prim_id, ray.o, ray.d, before, hit.t));
                let n = facing(at.ng, ray.d);
                let entering = at.entering(ray.d);
                Self { t: at.t, off: 0.0, p: at.p, n, ng: at.ng, uv: at.uv, texcoord: None, entering }
            }
            Object::Mesh(mesh) => Self::of_triangle(scene, mesh, None, ray, hit),
            Object::Instance(instance) => Self::of_triangle(scene, &instance.mesh, Some(instance), ray, hit),
        }
    }

    fn of_triangle(scene: &Scene, mesh: &Mesh, placed: Option<&Instance>, ray: &Ray64, hit: &Hit64) -> Self {
        let corners = mesh.data.triangles.exact_triangle(hit.prim_id);
        let corners = placed.map_or(corners, |i| corners.map(|p| i.to_scene.transform_point3(p)));
        let at = triangle::refine_exact(ray.o, ray.d, corners, (hit.u, hit.v));
        let weights = [1.0 - at.u - at.v, at.u, at.v];
        // Where a placement mirrors space, the moved corners run the other way around.
        let outer = if mesh.mirrored { -at.ng } else { at.ng };
        let ng = unit(outer);
        Self {
            t: at.t,
            off: (at.p - (ray.o + at.t * ray.d)).length(),
            p: at.p,
            n: shading_normal(mesh, placed, hit.prim_id, weights, facing(ng, ray.d), ng),
            ng,
            uv: DVec2::new(at.u, at.v),
            texcoord: mesh.data.uvs_of(hit.prim_id).map(|uvs| texcoord(uvs, weights, scene.course_rules)),
            entering: ray.d.dot(ng) < 0.0,
        }
    }

    /// In world space, with `t` as the given ray counts.
    pub fn answer(&self, scene: &Scene, hit: &Hit64, t: f64) -> Answer {
        let Self { n, ng, uv, texcoord, entering, .. } = *self;
        let p = scene.frame.to_world(self.p);
        Answer { t, p, n, ng, uv, texcoord, object: hit.geom_id, prim: hit.prim_id, entering }
    }
}

/// `v` with length 1, however short or long it is.
fn unit(v: DVec3) -> DVec3 {
    (v / v.abs().max_element()).normalize_or(DVec3::Z)
}

fn facing(n: DVec3, d: DVec3) -> DVec3 {
    if d.dot(n) > 0.0 { -n } else { n }
}

/// The normal between those of the corners, on the side of the facet's own; that one where there are none.
fn shading_normal(
    mesh: &Mesh,
    placed: Option<&Instance>,
    prim: u32,
    weights: [f64; 3],
    front: DVec3,
    outer: DVec3,
) -> DVec3 {
    let data = &mesh.data;
    let of_corners = data.normals.as_ref().and_then(|n| n.three(n.of(data.triangles.faces(), prim as usize)));
    let Some(normals) = of_corners else { return front };
    let normals = normals
        .map(|n| Vec3::from_array(n).as_dvec3())
        .map(|n| placed.map_or(n, |i| (i.normal_to_scene * n).normalize_or_zero()));
    let side = front.dot(outer).signum();
    let sum = side * (0..3).map(|k| weights[k] * normals[k]).sum::<DVec3>();
    // Normals that cancel say nothing.
    let usable = sum.length() > 1e-6;
    let sum = if sum.dot(front) < 0.0 { -sum } else { sum };
    if usable { sum.normalize() } else { front }
}

/// v upwards as in the file, where scenes have it downwards.
fn texcoord(uvs: [Vec2; 3], weights: [f64; 3], downwards: bool) -> DVec2 {
    let uv = (0..3).map(|k| weights[k] * uvs[k].as_dvec2()).sum::<DVec2>();
    if downwards { uv } else { DVec2::new(uv.x, 1.0 - uv.y) }
}
