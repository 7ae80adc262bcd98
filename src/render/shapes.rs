//! Hits of analytic shapes: each computed anew in f64 by its own formula.

use super::block::{Block, Hits, Leave, Points, put};
use super::paint::Palette;
use crate::geom::{LANES, Ray, RayHitPacket, ShapePoint, ShapeSet};
use crate::scene::{Object, Scene};
use crate::{simd, with_shapes};
use glam::{DVec2, DVec3, Vec3};

/// What hits of shapes are computed from.
#[derive(Debug)]
pub struct ShapeHits {
    /// With `t_far` at the hit.
    rays: [Ray; LANES],
    geom: [u32; LANES],
    prim: [u32; LANES],
    uv: [DVec2; LANES],
}

impl Default for ShapeHits {
    fn default() -> Self {
        let ray = Ray::new(Vec3::ZERO, Vec3::Z);
        Self { rays: [ray; LANES], geom: [0; LANES], prim: [0; LANES], uv: [DVec2::ZERO; LANES] }
    }
}

impl Hits for ShapeHits {
    #[inline]
    fn set(&mut self, lane: usize, packet: &RayHitPacket, from: usize) {
        self.rays[lane] = packet.ray.get(from);
        self.geom[lane] = packet.hit.geom_id[from];
        self.prim[lane] = packet.hit.prim_id[from];
    }

    fn set_all(&mut self, packet: &RayHitPacket) {
        for lane in 0..LANES {
            self.set(lane, packet, lane);
        }
    }

    fn finish(&mut self, len: usize, scene: &Scene, palette: &Palette, block: &mut Block) {
        block.len = len;
        let mut points = Points::EMPTY;
        for lane in 0..len {
            let Object::Shapes(shapes) = &scene.objects[self.geom[lane] as usize] else {
                unreachable!("hits of meshes are collected apart")
            };
            let (ray, prim) = (&self.rays[lane], self.prim[lane]);
            let material = shapes.materials[prim as usize];
            let uv = palette.has_texture(material);
            let (o, d) = (ray.o.as_dvec3(), ray.d.as_dvec3());
            let (t_near, t) = (f64::from(ray.t_near), f64::from(ray.t_far));
            let point = with_shapes!(&shapes.set, set => set.refine_for(prim, o, d, t_near, t, uv));
            put_point(&mut points, lane, &point, d);
            self.uv[lane] = point.uv;
            block.material[lane] = material;
        }
        block.paint_all(palette);
        // Lanes without a hit repeat the first one: a packet with a NaN in it is slow to trace.
        for lane in len..LANES {
            repeat_first(&mut points, lane);
        }
        simd::run(Leave { points: &points, block });
        palette.add_texels(scene, block, |_, lane| Some(self.uv[lane].as_vec2()));
    }
}

fn put_point(to: &mut Points, lane: usize, point: &ShapePoint, d: DVec3) {
    let side = if point.entering(d) { 1.0 } else { -1.0 };
    let ng = (side * point.ng).to_array();
    put(&mut to.p, lane, point.p.to_array());
    put(&mut to.lifted, lane, point.p.to_array());
    put(&mut to.ng, lane, ng);
    put(&mut to.ns, lane, ng);
    to.extent[lane] = point.extent;
    to.side[lane] = side;
    let back = -d.normalize();
    for k in 0..3 {
        to.to_eye[k][lane] = back[k] as f32;
    }
}

fn repeat_first(points: &mut Points, lane: usize) {
    for k in 0..3 {
        points.p[k][lane] = points.p[k][0];
        points.lifted[k][lane] = points.lifted[k][0];
        points.ng[k][lane] = points.ng[k][0];
        points.ns[k][lane] = points.ns[k][0];
        points.to_eye[k][lane] = points.to_eye[k][0];
    }
    points.extent[lane] = points.extent[0];
    points.side[lane] = points.side[0];
}
