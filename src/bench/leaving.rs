//! Rays that leave a surface: none may meet it again.
//!
//! A convex object stands alone in the light of lamps all around it and mirrors what it sees. Then whatever a
//! shadow ray or a mirrored ray of the renderer meets is where it started from: a false self-hit. The scenes come
//! from files with coordinates in f64, through the loader, and the rays from the renderer itself.

use super::setup::build;
use crate::backend::{self, Backend, BackendKind};
use crate::geom::{Coherence, Hit, PacketBatch, Ray, RayHitPacket, RayPacket, TriangleMesh};
use crate::math::Random;
use crate::render::{self, Control, Job};
use crate::scene::example::{self, Surface};
use crate::scene::{self, CameraDesc, Light, LoadOptions, Loaded, Material, Projection, Reflect};
use glam::{DVec2, DVec3, Vec3};
use std::fmt::Write;
use std::path::Path;
use std::sync::atomic::{AtomicBool, AtomicU32, AtomicU64, Ordering::Relaxed};

/// What stands in the light.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[expect(missing_docs, reason = "the kinds")]
pub enum Body {
    /// Triangles in scene space.
    Mesh,
    /// A mesh in a space of its own, turned and stretched.
    Instance,
    Sphere,
    /// Turned and stretched.
    PlacedSphere,
    Cube,
    /// Turned and stretched.
    PlacedCube,
    /// With lids, turned.
    Cylinder,
    /// Turned.
    Quad,
}

impl Body {
    /// All of them.
    pub const ALL: [Self; 8] = [
        Self::Mesh,
        Self::Instance,
        Self::Sphere,
        Self::PlacedSphere,
        Self::Cube,
        Self::PlacedCube,
        Self::Cylinder,
        Self::Quad,
    ];

    /// Name in tables.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Mesh => "triangles",
            Self::Instance => "instance",
            Self::Sphere => "sphere",
            Self::PlacedSphere => "placed sphere",
            Self::Cube => "cube",
            Self::PlacedCube => "placed cube",
            Self::Cylinder => "cylinder",
            Self::Quad => "quad",
        }
    }

    /// Its lines in a scene file, at `at`, about `size` from the middle to the rim. Meshes are files of that size.
    fn lines(self, size: f64, at: DVec3) -> String {
        let kind = match self {
            Self::Mesh | Self::Instance => "mesh = 'ball.obj'".into(),
            Self::Sphere => format!("shape = 'sphere'\nradius = {size:?}"),
            Self::PlacedSphere => format!("shape = 'sphere'\nradius = {:?}", 0.7 * size),
            Self::Cube => format!("shape = 'cube'\nhalf = [{:?}, {:?}, {:?}]", 0.8 * size, 0.5 * size, 0.7 * size),
            Self::PlacedCube => format!("shape = 'cube'\nhalf = {:?}", 0.5 * size),
            Self::Cylinder => {
                format!("shape = 'cylinder'\nradius = {:?}\nheight = {:?}\ncapped = true", 0.7 * size, 1.3 * size)
            }
            Self::Quad => format!("shape = 'quad'\nhalf = {:?}", 0.7 * size),
        };
        let turned = match self {
            Self::Sphere | Self::Cube | Self::Mesh => "",
            Self::Cylinder | Self::Quad => "{ rotate = [1, 2, 3], degrees = 40 }, ",
            _ => "{ scale = [1, 0.6, 1.3] }, { rotate = [1, 2, 3], degrees = 40 }, ",
        };
        format!("[[object]]\n{kind}\ntransform = [{turned}{{ translate = [{:?}, {:?}, {:?}] }}]\n", at.x, at.y, at.z)
    }
}

/// Where it stands.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Place {
    /// The whole scene is so many sizes away from the origin of its file.
    Moved(f64),
    /// So many sizes away from where the rest of the scene is.
    Apart(f64),
}

/// What was found.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Found {
    /// Shadow rays and mirrored rays.
    pub rays: u64,
    /// Those that met something.
    pub hits: u64,
    /// Camera rays that saw the inner side of a mesh, at an edge by rounding or because the backend lost its front:
    /// what starts there meets the mesh rightly, so that nothing is sent on.
    pub through: u64,
    /// Most that a shadow ray's start was off the surface, in sizes, as seen from the middle; nothing for a quad,
    /// which has its middle in its surface.
    pub moved: f64,
}

/// Why nothing was found out.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
#[expect(missing_docs, reason = "the messages say it")]
pub enum Error {
    #[error("cannot keep the scene to measure with in the folder for temporary files")]
    Folder(#[from] std::io::Error),
    #[error("the scene to measure with cannot be read")]
    Load(#[from] scene::Error),
    #[error("the scene to measure with cannot be built")]
    Build(#[from] backend::Error),
    #[error("the camera to measure with cannot be used: {0}")]
    Camera(String),
}

/// Lamps around the body.
const LAMPS: usize = 24;
/// Pixels along a side of each picture.
const SIDE: u32 = 96;

/// Traces at least `rays` rays that leave `body`, whose size is `size` and which stands at `place`.
///
/// # Errors
/// See [`Error`].
pub fn leave(kind: BackendKind, body: Body, size: f64, place: Place, rays: u64) -> Result<Found, Error> {
    let (mut loaded, at) = loaded(body, size, place)?;
    let frame = loaded.scene.frame;
    let mut random = Random(31);
    let scene = &mut loaded.scene;
    scene.lights = (0..LAMPS)
        .map(|_| Light::constant(frame.to_local(at + 20.0 * size * random.direction()), Vec3::splat(0.03)))
        .collect();
    for m in &mut scene.materials {
        *m = Material { reflect: Reflect::Constant(Vec3::splat(0.5)), ..Material::default() };
    }
    let backend = build(kind, scene)?;
    let mut found = Found::default();
    while found.rays < rays {
        let toward = random.direction();
        let camera = looking(at + 3.0 * size * toward, at, 45.0);
        let eye = camera.prepare(&frame, (SIDE, SIDE)).map_err(Error::Camera)?.ray(0.5, 0.5, DVec2::ZERO).0.as_vec3();
        let counting = Counting {
            inner: backend.as_dyn(),
            eye,
            center: (body != Body::Quad).then(|| frame.to_local(at).as_vec3()),
            rays: AtomicU64::new(0),
            hits: AtomicU64::new(0),
            through: AtomicU64::new(0),
            moved: AtomicU32::new(0),
        };
        render::run_with(scene, &camera, &counting, &job(SIDE), &Control::default()).map_err(Error::Camera)?;
        found.rays += counting.rays.into_inner();
        found.hits += counting.hits.into_inner();
        found.through += counting.through.into_inner();
        let moved = f64::from(f32::from_bits(counting.moved.into_inner())) * frame.world_per_local() / size;
        found.moved = found.moved.max(moved);
    }
    Ok(found)
}

/// A square picture at one sample per pixel that follows one bounce.
#[must_use]
pub fn job(side: u32) -> Job {
    Job { k_max: 1, ..Job::whole((side, side)) }
}

/// A pinhole camera at `eye` that looks at `target`.
#[must_use]
pub fn looking(eye: DVec3, target: DVec3, fov_deg: f64) -> CameraDesc {
    CameraDesc {
        eye,
        target,
        up: (target - eye).any_orthogonal_vector(),
        projection: Projection::Perspective { fov_deg },
        aperture: 0.0,
        focus: None,
        aspect: None,
        clip: None,
    }
}

/// The scene with `body` in it, through a file, and where it is.
fn loaded(body: Body, size: f64, place: Place) -> Result<(Loaded, DVec3), Error> {
    let along = DVec3::new(1.0, -0.6, 0.4);
    let folder = tempfile::tempdir()?;
    let (mut text, at) = match place {
        Place::Moved(sizes) => ("tison = 1\n".to_owned(), sizes * size * along),
        Place::Apart(sizes) => {
            let rest = [DVec3::ZERO, DVec3::X, DVec3::Y].map(|p| Body::Sphere.lines(size, 4.0 * size * p));
            (format!("tison = 1\n{}", rest.concat()), sizes * size * along)
        }
    };
    let ball = example::mesh(320, Surface::Round);
    let bare = body == Body::Mesh && matches!(place, Place::Moved(_));
    std::fs::write(folder.path().join("ball.obj"), obj(&ball, size, if bare { at } else { DVec3::ZERO }))?;
    text += &body.lines(size, at);
    if body == Body::Instance {
        // A mesh that is shown once is moved, not placed: the second one is inside of the first.
        text += &format!(
            "[[object]]\nmesh = 'ball.obj'\ntransform = [{{ scale = 0.1 }}, {{ translate = [{:?}, {:?}, {:?}] }}]\n",
            at.x, at.y, at.z
        );
    }
    std::fs::write(folder.path().join("scene.toml"), text)?;
    Ok((load(&folder.path().join(if bare { "ball.obj" } else { "scene.toml" }))?, at))
}

/// Reads a scene with nothing out of the ordinary.
///
/// # Errors
/// As [`scene::load`].
pub fn load(path: &Path) -> Result<Loaded, scene::Error> {
    let cancel = AtomicBool::new(false);
    let options = LoadOptions::new(&cancel);
    scene::load(path, &options)
}

/// `mesh` times `size`, moved by `at` in f64, with all digits.
#[must_use]
pub fn obj(mesh: &TriangleMesh, size: f64, at: DVec3) -> String {
    let mut text = String::new();
    for i in 0..mesh.vertex_count() as u32 {
        let p = at + size * mesh.point(i).as_dvec3();
        writeln!(text, "v {:?} {:?} {:?}", p.x, p.y, p.z).expect("a string takes everything");
    }
    for [a, b, c] in mesh.faces() {
        writeln!(text, "f {} {} {}", a + 1, b + 1, c + 1).expect("a string takes everything");
    }
    text
}

/// Counts the rays that do not come from the camera, and what they meet.
struct Counting<'a> {
    inner: &'a dyn Backend,
    eye: Vec3,
    center: Option<Vec3>,
    rays: AtomicU64,
    hits: AtomicU64,
    through: AtomicU64,
    /// Bits of a float that is not negative, which order as it does.
    moved: AtomicU32,
}

impl Counting<'_> {
    fn count(&self, ray: &Ray, hit: bool) {
        if ray.o != self.eye {
            self.rays.fetch_add(1, Relaxed);
            self.hits.fetch_add(u64::from(hit), Relaxed);
        }
    }

    /// Looks back from where a ray starts.
    fn look_back(&self, o: Vec3) {
        let Some(d) = self.center.map(|c| c - o) else { return };
        if let Some(hit) = self.inner.intersect(&Ray::new(o, d)) {
            self.moved.fetch_max((hit.t * d.length()).max(0.0).to_bits(), Relaxed);
        }
    }
}

impl Backend for Counting<'_> {
    fn intersect(&self, ray: &Ray) -> Option<Hit> {
        let hit = self.inner.intersect(ray);
        self.count(ray, hit.is_some());
        hit
    }

    fn occluded(&self, ray: &Ray) -> bool {
        let occluded = self.inner.occluded(ray);
        self.count(ray, occluded);
        occluded
    }

    fn intersect_many(&self, rays: &mut PacketBatch<RayHitPacket>, coherence: Coherence) {
        self.inner.intersect_many(rays, coherence);
        for (packet, live) in rays.packets_mut() {
            for lane in 0..live {
                let (ray, hit) = (packet.ray.get(lane), packet.hit(lane));
                self.count(&ray, hit.is_some());
                // Of shapes no normal is reported.
                if hit.is_some_and(|hit| ray.o == self.eye && hit.ng.dot(ray.d) > 0.0) {
                    self.through.fetch_add(1, Relaxed);
                    packet.set_hit(lane, None);
                }
            }
        }
    }

    fn occluded_many(&self, rays: &mut PacketBatch<RayPacket>, coherence: Coherence) {
        let asked: Vec<[bool; crate::geom::LANES]> = rays.packets().iter().map(|p| p.t_far.map(|t| t > 0.0)).collect();
        self.inner.occluded_many(rays, coherence);
        for ((packet, live), asked) in rays.packets_mut().zip(asked) {
            for lane in (0..live).filter(|&lane| asked[lane]) {
                self.count(&packet.get(lane), packet.is_occluded(lane));
            }
            if asked[0] {
                self.look_back(packet.get(0).o);
            }
        }
    }
}
