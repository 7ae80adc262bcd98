//! The box around the scene: camera rays that pass it need not be traced.

use crate::backend::Backend;
use crate::geom::{Bounds, Coherence, INVALID_ID, LANES, PacketBatch, RayHitPacket, RayPacket};
use crate::scene::{Camera, Scene};
use crate::simd::{self, Kernel};

/// A box in f32 around all that a camera ray can hit.
#[derive(Clone, Copy, Debug)]
pub struct Reach {
    lo: [f32; 3],
    hi: [f32; 3],
}

/// What the box is larger by, in units of the scene's size and of how far away rays start: a backend that works in f32 may
/// take a ray for a hit that passes at a few half ulps (6e-8) of that.
const WIDER: f64 = 1e-5;

/// Where a ray leaves the box, rounded up: three operations, each within half an ulp, on either side.
const LATER: f32 = 1.0 + 8.0 * f32::EPSILON;

impl Reach {
    /// The box for the rays of `camera`, for an image of `size` pixels. `None` if there is nothing to hit, or if the camera
    /// is in the box: none of its rays passes.
    #[must_use]
    pub fn of(scene: &Scene, camera: &Camera, size: (u32, u32)) -> Option<Self> {
        let bounds = scene.local_bounds();
        let inside = !camera.parallel && camera.eye.clamp(bounds.lo, bounds.hi) == camera.eye;
        (!bounds.is_empty() && !inside).then(|| Self::around(bounds, farthest(camera, size)))
    }

    /// The box for rays that start up to `far` from the origin.
    fn around(bounds: Bounds, far: f64) -> Self {
        let reach = bounds.size().max_element() + bounds.lo.abs().max(bounds.hi.abs()).max_element() + far;
        let (lo, hi) = (bounds.lo - WIDER * reach, bounds.hi + WIDER * reach);
        Self { lo: lo.as_vec3().to_array(), hi: hi.as_vec3().to_array() }
    }

    /// As [`Backend::intersect_many`] for the packets that may hit anything, and misses for the others, of which it
    /// tells the number.
    pub fn intersect_many<B: Backend>(
        &self,
        backend: &B,
        rays: &mut PacketBatch<RayHitPacket>,
        coherence: Coherence,
    ) -> u64 {
        let inside = |packet: &RayHitPacket, live| simd::run(Inside { reach: self, rays: &packet.ray, live });
        let all = rays.packets().len();
        let passing = rays.packets_mut().filter(|(packet, live)| !inside(packet, *live)).count();
        if passing == 0 {
            backend.intersect_many(rays, coherence);
            return 0;
        }
        if passing == all {
            rays.packets_mut().for_each(|(packet, _)| packet.hit.geom_id = [INVALID_ID; LANES]);
            return all as u64;
        }
        let mut asked = PacketBatch::default();
        let mut places = Vec::with_capacity(all - passing);
        for (place, (packet, live)) in rays.packets_mut().enumerate() {
            if inside(packet, live) {
                places.push(place);
                *asked.push_packet() = packet.clone();
                asked.resize(asked.len() - (LANES - live));
            } else {
                packet.hit.geom_id = [INVALID_ID; LANES];
            }
        }
        backend.intersect_many(&mut asked, coherence);
        let mut answers = places.iter().zip(asked.packets()).peekable();
        for (place, (packet, _)) in rays.packets_mut().enumerate() {
            if let Some((_, answer)) = answers.next_if(|(to, _)| **to == place) {
                packet.clone_from(answer);
            }
        }
        passing as u64
    }
}

/// Most that a camera ray's start is away from the origin.
fn farthest(camera: &Camera, (width, height): (u32, u32)) -> f64 {
    let lens = camera.lens.map_or(0.0, |l| l.across.length() + l.up.length());
    // A filter reaches a few pixels over the edge.
    let (right, down) = (camera.right * (f64::from(width) + 8.0), camera.down * (f64::from(height) + 8.0));
    let starts = if camera.parallel { camera.corner.length() + right.length() + down.length() } else { 0.0 };
    camera.eye.length().max(starts) + lens
}

/// Whether any ray of a packet may meet a box.
struct Inside<'a> {
    reach: &'a Reach,
    rays: &'a RayPacket,
    /// Lanes that hold a ray, the first ones.
    live: usize,
}

impl Kernel for Inside<'_> {
    type Output = bool;

    /// The slab test.
    #[inline(always)]
    fn run(self) -> bool {
        let Self { reach, rays, live } = self;
        let (mut enter, mut leave) = ([0f32; LANES], [f32::INFINITY; LANES]);
        for (k, (o, d)) in
            [(&rays.o_x, &rays.d_x), (&rays.o_y, &rays.d_y), (&rays.o_z, &rays.d_z)].into_iter().enumerate()
        {
            let (lo, hi) = (reach.lo[k], reach.hi[k]);
            for i in 0..LANES {
                let inv = 1.0 / d[i];
                let (a, b) = ((lo - o[i]) * inv, (hi - o[i]) * inv);
                // A NaN, of a ray in the plane of a side, leaves what there is.
                enter[i] = if a.min(b) > enter[i] { a.min(b) } else { enter[i] };
                leave[i] = if a.max(b) < leave[i] { a.max(b) } else { leave[i] };
            }
        }
        (0..LANES).fold(false, |any, i| any | ((i < live) & (enter[i] <= leave[i] * LATER)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::Ray;
    use crate::math::Random;
    use glam::{DVec3, Vec3};

    fn packet(rays: &[Ray]) -> RayHitPacket {
        let mut packet = RayHitPacket::EMPTY;
        (0..LANES).for_each(|lane| packet.ray.set(lane, &rays[lane % rays.len()]));
        packet
    }

    fn inside(reach: &Reach, ray: Ray) -> bool {
        simd::run(Inside { reach, rays: &packet(&[ray]).ray, live: LANES })
    }

    const UNIT: Bounds = Bounds { lo: DVec3::NEG_ONE, hi: DVec3::ONE };

    #[test]
    fn no_ray_at_the_box_passes_it() {
        let mut random = Random(5);
        for far in [0.0, 1.5, 10.0, 1e4, 1e7] {
            let reach = Reach::around(UNIT, far);
            for _ in 0..10_000 {
                let o = far * random.direction();
                let at = random.point();
                // Of the sides and edges too.
                let at = if random.point().x < 0.0 { at } else { at.signum() * at.abs().round() };
                let d = at - o.as_vec3().as_dvec3();
                assert!(inside(&reach, Ray::new(o.as_vec3(), d.as_vec3())), "from {o} to {at}");
            }
        }
    }

    #[test]
    fn who_is_inside_does_not_ask() {
        let mut scene = Scene::of(Vec::new());
        let camera = |eye: DVec3| {
            let target = DVec3::new(0.1, 0.2, 0.3);
            let projection = crate::scene::Projection::Perspective { fov_deg: 40.0 };
            let (up, aperture) = (DVec3::Y, 0.0);
            let desc = crate::scene::CameraDesc {
                eye,
                target,
                up,
                projection,
                aperture,
                focus: None,
                aspect: None,
                clip: None,
            };
            desc.prepare(&crate::math::Frame::IDENTITY, (40, 30)).expect("a good camera")
        };
        assert!(Reach::of(&scene, &camera(DVec3::ZERO), (40, 30)).is_none(), "nothing to hit");
        let triangle = [Vec3::NEG_ONE, Vec3::ONE, Vec3::new(1.0, -1.0, 0.0)];
        let mesh = crate::geom::TriangleMesh::new(triangle.iter().flat_map(Vec3::to_array).collect(), vec![[0, 1, 2]]);
        scene.objects.push(crate::scene::Object::Mesh(crate::scene::Mesh::bare(mesh)));
        assert!(Reach::of(&scene, &camera(DVec3::ZERO), (40, 30)).is_none());
        assert!(Reach::of(&scene, &camera(DVec3::new(0.0, 0.0, 1.5)), (40, 30)).is_some());
    }

    #[test]
    fn rays_that_pass_it_do() {
        let reach = Reach::around(UNIT, 5.0);
        let from = Vec3::new(0.0, 0.0, 5.0);
        assert!(inside(&reach, Ray::new(from, Vec3::NEG_Z)));
        assert!(!inside(&reach, Ray::new(from, Vec3::Z)), "behind");
        assert!(!inside(&reach, Ray::new(from, Vec3::new(0.0, 1.01, -4.0))));
        assert!(inside(&reach, Ray::new(from, Vec3::new(0.0, 0.99, -4.0))));
        assert!(!inside(&reach, Ray::new(Vec3::new(1.1, 0.0, 5.0), Vec3::NEG_Z)), "along a side");
        assert!(inside(&reach, Ray::new(Vec3::new(1.0, 1.0, 5.0), Vec3::NEG_Z)), "along an edge");
        assert!(inside(&reach, Ray::new(Vec3::ZERO, Vec3::X)), "from inside");
    }

    /// Answers for every packet by its first ray, and counts them.
    struct Asked(std::sync::atomic::AtomicUsize);

    impl Backend for Asked {
        fn intersect(&self, ray: &Ray) -> Option<crate::geom::Hit> {
            self.0.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
            let (prim_id, ng) = (ray.o.x.to_bits(), Vec3::Z);
            Some(crate::geom::Hit { t: 1.0, u: 0.0, v: 0.0, ng, prim_id, geom_id: 0 })
        }

        fn occluded(&self, _: &Ray) -> bool {
            false
        }
    }

    #[test]
    fn each_packet_gets_its_own_answer() {
        let reach = Reach::around(UNIT, 5.0);
        let ray = |i: usize, towards: bool| {
            Ray::new(Vec3::new(1e-3 * i as f32, 0.0, 5.0), if towards { Vec3::NEG_Z } else { Vec3::Z })
        };
        for pattern in [[true; 3], [false; 3], [true, false, true], [false, true, false], [false, false, true]] {
            let mut batch = PacketBatch::<RayHitPacket>::default();
            (0..37).for_each(|i| batch.push(&ray(i, pattern[i / LANES])));
            let backend = Asked(Default::default());
            let passing = reach.intersect_many(&backend, &mut batch, Coherence::Coherent);
            assert_eq!(passing, pattern.iter().filter(|&&towards| !towards).count() as u64);
            let sent = (0..37).filter(|i| pattern[i / LANES]).count();
            assert_eq!(backend.0.into_inner(), sent);
            assert_eq!(batch.len(), 37);
            for i in 0..37 {
                let hit = batch.packets()[i / LANES].hit(i % LANES);
                assert_eq!(hit.map(|h| h.prim_id), pattern[i / LANES].then(|| ray(i, true).o.x.to_bits()), "ray {i}");
            }
        }
    }
}
