//! Shapes that Embree calls back for against Embree's own sphere primitive: the same rays, in the
//! same packets with the same flags, on one thread, ROBUST both, in turn. Then the classes that
//! Embree has no primitive for, alone.
//!
//!     cargo bench --bench spheres -- [--counts N,N,...] [--side PIXELS] [--rounds N] [--only WORD]
//!
//! The shapes lie at random in a cube, so large that about half of the camera rays hit one. How
//! many rays the two disagree about is counted: Embree's own test is in f32.
use embree4_sys as sys;
use glam::{DAffine3, DMat3, DVec3, Vec3};
use std::sync::Arc;
use std::time::Instant;
use tison::embree::{Device, DeviceConfig, PrimSet, Scene, SceneBuilder, SceneOptions};
use tison::geom::{
    Affine, Coherence, Cube, Cylinder, Hit, LANES, PacketBatch, Plain, Ray, RayHitPacket, RayPacket, Shape, ShapeError,
    Sphere,
};
use tison::math::Random;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let args = Args::parse()?;
    let device = Device::new(&DeviceConfig { threads: 1, ..Default::default() })?;
    println!(
        "Embree {}, packets of {}, one thread, medians of {} rounds",
        device.version(),
        device.packet_width(),
        args.rounds
    );
    for &count in &args.counts {
        let centers = places(count);
        let radius = 1.27 / f64::from(count).sqrt();
        compare(&device, &centers, radius, &args)?;
        classes(&device, &centers, radius, &args)?;
    }
    Ok(())
}

struct Args {
    counts: Vec<u32>,
    side: u32,
    rounds: usize,
    /// What the names of the rows to run have in them.
    only: String,
}

impl Args {
    fn parse() -> Result<Self, Box<dyn std::error::Error>> {
        let mut out = Self { counts: vec![1000, 100_000, 1_000_000], side: 1024, rounds: 7, only: String::new() };
        let mut args = std::env::args().skip(1).filter(|a| a != "--bench");
        while let Some(arg) = args.next() {
            let value = args.next().ok_or(format!("{arg} needs a value"))?;
            match arg.as_str() {
                "--counts" => out.counts = value.split(',').map(str::parse).collect::<Result<_, _>>()?,
                "--side" => out.side = value.parse::<u32>()? / 4 * 4,
                "--rounds" => out.rounds = value.parse()?,
                "--only" => out.only = value,
                flag => return Err(format!("unknown flag {flag}").into()),
            }
        }
        Ok(out)
    }
}

/// Ours against Embree's own on every kind of rays.
fn compare(device: &Device, centers: &[DVec3], radius: f64, args: &Args) -> Result<(), Box<dyn std::error::Error>> {
    let ours = build(device, plain(centers, |c| Sphere::new(c, radius))?)?;
    let own = OwnSpheres::build(centers, radius);
    let camera = camera_rays(args.side);
    let (shadow, bounced) = rays_from_hits(&ours, &camera, centers, radius);
    let random = random_rays(camera.len() / 4);
    println!(
        "\n{} spheres   {:>12} {:>12} {:>8} {:>8} {:>10}",
        centers.len(),
        "ours Mray/s",
        "own Mray/s",
        "ratio",
        "hit",
        "disagree"
    );
    let coherent = Coherence::Coherent;
    let nearest = |batch: &mut Nearest| ours.intersect_batch(batch, coherent);
    row("camera", args, &camera, nearest, |b| own.intersect_16(b));
    row("shadow", args, &shadow, |b| ours.occluded_batch(b, coherent), |b| own.occluded_16(b));
    row("bounced, sorted", args, &bounced, nearest, |b| own.intersect_16(b));
    row("bounced, single", args, &bounced, |b| ours.intersect_batch(b, Coherence::Incoherent), |b| own.intersect_1(b));
    row("random, single", args, &random, |b| ours.intersect_batch(b, Coherence::Incoherent), |b| own.intersect_1(b));
    Ok(())
}

/// Camera rays against the classes that are ours alone.
fn classes(device: &Device, centers: &[DVec3], radius: f64, args: &Args) -> Result<(), Box<dyn std::error::Error>> {
    let camera = camera_rays(args.side);
    let alone = |name: &str, scene: Scene| {
        if !name.contains(&args.only) {
            return;
        }
        let mut batch = camera.clone();
        let rates =
            (0..args.rounds).map(|_| rate(&mut batch, &camera, |b| scene.intersect_batch(b, Coherence::Coherent)));
        println!("{name:16} {:13.2} {:>30.3}", median(rates.collect()), share_hit(&batch));
    };
    let half = radius * std::f64::consts::FRAC_PI_4.sqrt();
    alone("cube", build(device, plain(centers, |c| Cube::new(c, DVec3::splat(half)))?)?);
    alone("affine sphere", build(device, placed(centers, Sphere::new(DVec3::ZERO, radius)?)?)?);
    alone("affine cube", build(device, placed(centers, Cube::new(DVec3::ZERO, DVec3::splat(half))?)?)?);
    alone("affine cylinder", build(device, placed(centers, Cylinder::new(half, 2.0 * half, false)?)?)?);
    Ok(())
}

fn row<P: Batch>(
    name: &str,
    args: &Args,
    fresh: &PacketBatch<P>,
    ours: impl Fn(&mut PacketBatch<P>),
    own: impl Fn(&mut PacketBatch<P>),
) {
    if !name.contains(&args.only) {
        return;
    }
    let (mut a, mut b) = (fresh.clone(), fresh.clone());
    let rounds: Vec<_> =
        (0..=args.rounds).map(|_| (rate(&mut a, fresh, &ours), rate(&mut b, fresh, &own))).skip(1).collect();
    let of = |f: fn(&(f64, f64)) -> f64| median(rounds.iter().map(f).collect());
    println!(
        "{name:16} {:13.2} {:12.2} {:8.2} {:8.3} {:10}",
        of(|r| r.0),
        of(|r| r.1),
        of(|r| r.0 / r.1),
        share_hit(&a),
        (0..fresh.len()).filter(|&i| P::hit(&a, i) != P::hit(&b, i)).count()
    );
}

/// Mrays per second of one pass over `fresh`, copied to `batch` before.
fn rate<P: Batch>(batch: &mut PacketBatch<P>, fresh: &PacketBatch<P>, trace: impl Fn(&mut PacketBatch<P>)) -> f64 {
    batch.clone_from(fresh);
    let start = Instant::now();
    trace(batch);
    fresh.len() as f64 / start.elapsed().as_secs_f64() / 1e6
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

type Nearest = PacketBatch<RayHitPacket>;
type Shadows = PacketBatch<RayPacket>;

trait Batch: tison::geom::RayQueue {
    /// Whether ray `i` met something.
    fn hit(batch: &PacketBatch<Self>, i: usize) -> bool;
}

impl Batch for RayHitPacket {
    fn hit(batch: &Nearest, i: usize) -> bool {
        batch.packets()[i / LANES].hit(i % LANES).is_some()
    }
}

impl Batch for RayPacket {
    fn hit(batch: &Shadows, i: usize) -> bool {
        batch.packets()[i / LANES].is_occluded(i % LANES)
    }
}

fn share_hit<P: Batch>(batch: &PacketBatch<P>) -> f64 {
    (0..batch.len()).filter(|&i| P::hit(batch, i)).count() as f64 / batch.len() as f64
}

fn build<S: PrimSet>(device: &Device, set: S) -> Result<Scene, tison::embree::Error> {
    let mut builder = SceneBuilder::new(device, SceneOptions::default())?;
    builder.shapes(Arc::new(set))?;
    builder.commit(None)
}

fn plain<S: Shape>(centers: &[DVec3], make: impl Fn(DVec3) -> Result<S, ShapeError>) -> Result<Plain<S>, ShapeError> {
    let mut set = Plain::default();
    for &c in centers {
        set.push(make(c)?);
    }
    Ok(set)
}

/// Each turned its own way.
fn placed<S: Shape>(centers: &[DVec3], shape: S) -> Result<Affine<S>, ShapeError> {
    let mut set = Affine::default();
    for (i, &c) in centers.iter().enumerate() {
        let turn = DMat3::from_rotation_z(i as f64) * DMat3::from_rotation_x(0.3 * i as f64);
        set.push(shape, DAffine3::from_mat3_translation(turn, c))?;
    }
    Ok(set)
}

fn places(count: u32) -> Vec<DVec3> {
    let mut random = Random(7);
    (0..count).map(|_| random.point()).collect()
}

/// One ray per pixel of a pinhole camera that the cube just fills, in blocks of 4 x 4 pixels.
fn camera_rays(side: u32) -> Nearest {
    let eye = DVec3::new(0.0, 0.0, 4.0);
    let mut batch = Nearest::default();
    for block in 0..side * side / 16 {
        let (left, top) = (block % (side / 4) * 4, block / (side / 4) * 4);
        for lane in 0..16 {
            let at = |pixel: u32| (f64::from(pixel) + 0.5) / f64::from(side) * 2.0 - 1.0;
            let target = DVec3::new(at(left + lane % 4), at(top + lane / 4), 1.0);
            batch.push(&Ray::new(eye.as_vec3(), (target - eye).normalize().as_vec3()));
        }
    }
    batch
}

/// To one light, in the order of the camera rays; and on in a random direction, sorted by its octant and then along
/// a curve through the places where they start.
fn rays_from_hits(scene: &Scene, camera: &Nearest, centers: &[DVec3], radius: f64) -> (Shadows, Nearest) {
    let light = DVec3::new(3.0, 5.0, 4.0);
    let mut random = Random(11);
    let mut traced = camera.clone();
    scene.intersect_batch(&mut traced, Coherence::Coherent);
    let (mut shadows, mut bounced) = (Shadows::default(), Vec::new());
    for i in 0..traced.len() {
        let packet = &traced.packets()[i / LANES];
        let Some(Hit { t, prim_id, .. }) = packet.hit(i % LANES) else { continue };
        let (ray, center) = (packet.ray.get(i % LANES), centers[prim_id as usize]);
        let normal = (ray.o.as_dvec3() + f64::from(t) * ray.d.as_dvec3() - center).normalize();
        let start = center + 1.0001 * radius * normal;
        if normal.dot(light - start) > 0.0 {
            shadows.push(&Ray::segment(start.as_vec3(), (light - start).as_vec3(), 0.999));
        }
        let d = (normal + 0.999 * random.point().normalize()).as_vec3();
        bounced.push((curve(start.as_vec3(), d), Ray::new(start.as_vec3(), d)));
    }
    bounced.sort_by_key(|b| b.0);
    let mut batch = Nearest::default();
    bounced.iter().for_each(|(_, ray)| batch.push(ray));
    (shadows, batch)
}

/// Octant of `d`, then the Morton number of `o` in a grid of 64 cells a side.
fn curve(o: Vec3, d: Vec3) -> u32 {
    let cell = ((o + 1.0) * 32.0).clamp(Vec3::ZERO, Vec3::splat(63.0)).as_uvec3();
    let spread = |n: u32| (0..6).fold(0, |key, bit| key | (n >> bit & 1) << (3 * bit));
    let octant = d.cmplt(Vec3::ZERO).bitmask();
    octant << 18 | spread(cell.x) | spread(cell.y) << 1 | spread(cell.z) << 2
}

fn random_rays(count: usize) -> Nearest {
    let mut random = Random(13);
    let mut batch = Nearest::default();
    for _ in 0..count {
        batch.push(&Ray::new(random.point().as_vec3(), random.point().as_vec3()));
    }
    batch
}

/// Embree's own spheres, made and asked through nothing but the bindings.
struct OwnSpheres {
    device: sys::RTCDevice,
    scene: sys::RTCScene,
}

impl OwnSpheres {
    fn build(centers: &[DVec3], radius: f64) -> Self {
        // SAFETY: a NUL-terminated string.
        let device = unsafe { sys::rtcNewDevice(c"threads=1".as_ptr()) };
        // SAFETY: the device is live.
        let scene = unsafe { sys::rtcNewScene(device) };
        // SAFETY: the scene is live.
        unsafe { sys::rtcSetSceneFlags(scene, sys::RTCSceneFlags::RTC_SCENE_FLAG_ROBUST) };
        // SAFETY: the device is live.
        let geometry = unsafe { sys::rtcNewGeometry(device, sys::RTCGeometryType::RTC_GEOMETRY_TYPE_SPHERE_POINT) };
        let (slot, format) = (sys::RTCBufferType::RTC_BUFFER_TYPE_VERTEX, sys::RTCFormat::RTC_FORMAT_FLOAT4);
        // SAFETY: the geometry is live.
        let data = unsafe { sys::rtcSetNewGeometryBuffer(geometry, slot, 0, format, 16, centers.len()) };
        // SAFETY: the buffer has room for this many items of four floats, and nobody else writes to it.
        let vertices = unsafe { std::slice::from_raw_parts_mut(data.cast::<[f32; 4]>(), centers.len()) };
        for (vertex, center) in vertices.iter_mut().zip(centers) {
            *vertex = center.extend(radius).as_vec4().to_array();
        }
        // SAFETY: the geometry is live.
        unsafe { sys::rtcCommitGeometry(geometry) };
        // SAFETY: both are live; the scene takes a reference of its own.
        unsafe { sys::rtcAttachGeometry(scene, geometry) };
        // SAFETY: gives back ours.
        unsafe { sys::rtcReleaseGeometry(geometry) };
        // SAFETY: the scene is live and nobody else has it.
        unsafe { sys::rtcCommitScene(scene) };
        Self { device, scene }
    }

    fn intersect_16(&self, batch: &mut Nearest) {
        let mut args = INTERSECT;
        for (packet, live) in batch.packets_mut() {
            let packet: *mut RayHitPacket = packet;
            // SAFETY: the scene is committed; mask and packet are 64-byte aligned and laid out as Embree's own (the
            // library asserts that); the packet is ours alone.
            unsafe { sys::rtcIntersect16(VALID[live].0.as_ptr(), self.scene, packet.cast(), &mut args) };
        }
    }

    fn occluded_16(&self, batch: &mut Shadows) {
        let mut args = OCCLUDED;
        for (packet, live) in batch.packets_mut() {
            let packet: *mut RayPacket = packet;
            // SAFETY: as above.
            unsafe { sys::rtcOccluded16(VALID[live].0.as_ptr(), self.scene, packet.cast(), &mut args) };
        }
    }

    fn intersect_1(&self, batch: &mut Nearest) {
        for (packet, live) in batch.packets_mut() {
            for lane in 0..live {
                let hit = self.intersect(&packet.ray.get(lane));
                packet.set_hit(lane, hit.as_ref());
            }
        }
    }

    fn intersect(&self, ray: &Ray) -> Option<Hit> {
        const NONE: u32 = u32::MAX;
        let (o, d) = (ray.o, ray.d);
        let mut query = sys::RTCRayHit {
            ray: sys::RTCRay {
                org_x: o.x,
                org_y: o.y,
                org_z: o.z,
                tnear: ray.t_near,
                dir_x: d.x,
                dir_y: d.y,
                dir_z: d.z,
                time: 0.0,
                tfar: ray.t_far,
                mask: NONE,
                id: 0,
                flags: 0,
            },
            hit: sys::RTCHit {
                Ng_x: 0.0,
                Ng_y: 0.0,
                Ng_z: 0.0,
                u: 0.0,
                v: 0.0,
                primID: NONE,
                geomID: NONE,
                instID: [NONE],
                instPrimID: [NONE],
            },
        };
        // SAFETY: the scene is committed, and the query is ours alone.
        unsafe { sys::rtcIntersect1(self.scene, &mut query, std::ptr::null_mut()) };
        let hit = query.hit;
        (hit.geomID != NONE).then(|| Hit {
            t: query.ray.tfar,
            u: hit.u,
            v: hit.v,
            ng: Vec3::new(hit.Ng_x, hit.Ng_y, hit.Ng_z),
            prim_id: hit.primID,
            geom_id: hit.geomID,
        })
    }
}

impl Drop for OwnSpheres {
    fn drop(&mut self) {
        // SAFETY: gives back the reference `rtcNewScene` gave.
        unsafe { sys::rtcReleaseScene(self.scene) };
        // SAFETY: gives back the reference `rtcNewDevice` gave.
        unsafe { sys::rtcReleaseDevice(self.device) };
    }
}

#[repr(align(64))]
struct Valid([i32; LANES]);

/// Masks for the first `n` lanes.
static VALID: [Valid; LANES + 1] = {
    let mut all = [const { Valid([0; LANES]) }; LANES + 1];
    let mut n = 0;
    while n <= LANES {
        let mut lane = 0;
        while lane < n {
            all[n].0[lane] = -1;
            lane += 1;
        }
        n += 1;
    }
    all
};

const INTERSECT: sys::RTCIntersectArguments = sys::RTCIntersectArguments {
    flags: sys::RTCRayQueryFlags::RTC_RAY_QUERY_FLAG_COHERENT,
    feature_mask: sys::RTCFeatureFlags::RTC_FEATURE_FLAG_ALL,
    context: std::ptr::null_mut(),
    filter: None,
    intersect: None,
};

const OCCLUDED: sys::RTCOccludedArguments = sys::RTCOccludedArguments {
    flags: sys::RTCRayQueryFlags::RTC_RAY_QUERY_FLAG_COHERENT,
    feature_mask: sys::RTCFeatureFlags::RTC_FEATURE_FLAG_ALL,
    context: std::ptr::null_mut(),
    filter: None,
    occluded: None,
};
