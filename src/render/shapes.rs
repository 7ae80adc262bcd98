//! Hits of analytic shapes: each computed anew in f64 by its own formula.

use super::block::{Block, F32, F64, Hits, Leave, Points, get, put, wide};
use super::optics;
use super::paint::Palette;
use crate::geom::{LANES, RayHitPacket, ShapePoint, ShapeSet, Sphere};
use crate::scene::{AnyShapes, Object, Scene, Shapes};
use crate::simd::{self, Kernel};
use crate::with_shapes;
use glam::{DVec2, DVec3};

/// What hits of shapes are computed from.
#[repr(align(64))]
#[derive(Debug)]
pub struct ShapeHits {
    o: [F32; 3],
    d: [F32; 3],
    t_near: F32,
    /// Parameter of the hit.
    t: F32,
    geom: [u32; LANES],
    prim: [u32; LANES],
    uv: [DVec2; LANES],
    /// Of the lanes that hit a plain sphere.
    center: [F64; 3],
    radius: F64,
}

impl Default for ShapeHits {
    fn default() -> Self {
        Self {
            o: [[0.0; LANES]; 3],
            d: [[0.0; LANES], [0.0; LANES], [1.0; LANES]],
            t_near: [0.0; LANES],
            t: [0.0; LANES],
            geom: [0; LANES],
            prim: [0; LANES],
            uv: [DVec2::ZERO; LANES],
            center: [[0.0; LANES]; 3],
            radius: [1.0; LANES],
        }
    }
}

impl Hits for ShapeHits {
    #[inline]
    fn set(&mut self, lane: usize, packet: &RayHitPacket, from: usize) {
        let ray = &packet.ray;
        for (to, of) in self.o.iter_mut().zip([&ray.o_x, &ray.o_y, &ray.o_z]) {
            to[lane] = of[from];
        }
        for (to, of) in self.d.iter_mut().zip([&ray.d_x, &ray.d_y, &ray.d_z]) {
            to[lane] = of[from];
        }
        self.t_near[lane] = ray.t_near[from];
        self.t[lane] = ray.t_far[from];
        self.geom[lane] = packet.hit.geom_id[from];
        self.prim[lane] = packet.hit.prim_id[from];
    }

    fn set_all(&mut self, packet: &RayHitPacket) {
        let ray = &packet.ray;
        self.o = [ray.o_x, ray.o_y, ray.o_z];
        self.d = [ray.d_x, ray.d_y, ray.d_z];
        self.t_near = ray.t_near;
        self.t = ray.t_far;
        self.geom = packet.hit.geom_id;
        self.prim = packet.hit.prim_id;
    }

    fn finish(&mut self, len: usize, scene: &Scene, palette: &Palette, block: &mut Block) {
        block.len = len;
        let mut points = Points::EMPTY;
        let balls = self.balls(len, scene, palette);
        if balls.count_ones() >= FEW {
            simd::run(Balls { hits: self, points: &mut points });
        }
        for lane in 0..len {
            let shapes = shapes_of(scene, self.geom[lane]);
            let material = shapes.materials[self.prim[lane] as usize];
            if balls.count_ones() < FEW || balls >> lane & 1 == 0 {
                self.one(lane, shapes, palette.has_texture(material), &mut points);
            }
            block.material[lane] = material;
            block.enclosed[lane] = shapes.set.are_closed();
        }
        block.paint_all(palette);
        // Lanes without a hit repeat the first one: a packet with a NaN in it is slow to trace.
        for lane in len..LANES {
            repeat_first(&mut points, lane);
        }
        simd::run(Leave { points: &points, block });
        for lane in 0..LANES {
            block.enclosed[lane] &= !block.entering[lane];
        }
        palette.add_texels(scene, block, |_, lane| Some(self.uv[lane].as_vec2()));
    }
}

/// Spheres in a block from which on all of it is computed at once.
const FEW: u32 = 3;

impl ShapeHits {
    /// Looks up the plain spheres that need no texture coordinates; their lanes, one bit each.
    fn balls(&mut self, len: usize, scene: &Scene, palette: &Palette) -> u32 {
        let mut lanes = 0;
        for lane in 0..len {
            let shapes = shapes_of(scene, self.geom[lane]);
            if let AnyShapes::Spheres(set) = &shapes.set {
                let sphere = set.get(self.prim[lane]);
                put(&mut self.center, lane, sphere.center().to_array());
                self.radius[lane] = sphere.radius();
                lanes |= u32::from(!palette.has_texture(shapes.materials[self.prim[lane] as usize])) << lane;
            }
        }
        lanes
    }

    /// Computes one hit.
    fn one(&mut self, lane: usize, shapes: &Shapes, uv: bool, points: &mut Points) {
        let (o, d) = (DVec3::from_array(wide(&self.o, lane)), DVec3::from_array(wide(&self.d, lane)));
        let (t_near, t) = (f64::from(self.t_near[lane]), f64::from(self.t[lane]));
        let point = with_shapes!(&shapes.set, set => set.refine_for(self.prim[lane], o, d, t_near, t, uv));
        put_point(points, lane, &point, d);
        self.uv[lane] = point.uv;
    }
}

fn shapes_of(scene: &Scene, geom: u32) -> &Shapes {
    match &scene.objects[geom as usize] {
        Object::Shapes(shapes) => shapes,
        _ => unreachable!("hits of meshes are collected apart"),
    }
}

/// Hits of spheres in all lanes.
struct Balls<'a> {
    hits: &'a ShapeHits,
    points: &'a mut Points,
}

impl Kernel for Balls<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        balls(self.hits, self.points);
    }
}

#[inline(always)]
fn balls(hits: &ShapeHits, to: &mut Points) {
    for lane in 0..LANES {
        let (o, d) = (DVec3::from_array(wide(&hits.o, lane)), DVec3::from_array(wide(&hits.d, lane)));
        let sphere = Sphere::known(DVec3::from_array(get(&hits.center, lane)), hits.radius[lane]);
        let (p, ng) = sphere.refine_straight(o, d, hits.t_near[lane].into(), hits.t[lane].into());
        let side = if d.dot(ng) < 0.0 { 1.0 } else { -1.0 };
        put(&mut to.p, lane, p.to_array());
        put(&mut to.ng, lane, (side * ng).to_array());
        to.side[lane] = side;
    }
    for lane in 0..LANES {
        let back = -optics::unit(DVec3::from_array(wide(&hits.d, lane)));
        (to.to_eye[0][lane], to.to_eye[1][lane], to.to_eye[2][lane]) = (back.x as f32, back.y as f32, back.z as f32);
    }
    to.lifted = to.p;
    to.ns = to.ng;
    to.extent = hits.radius;
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
