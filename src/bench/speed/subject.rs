//! What is traced.

use super::{Error, Kind, Options};
use crate::bench::leaving;
use crate::bench::setup::plain;
use crate::geom::Sphere;
use crate::math::Random;
use crate::scene::{AnyShapes, CameraDesc, CameraOverrides, MeshFormat, Object, Scene, Shapes, View, example};
use rayon::ThreadPool;
use std::io::BufWriter;
use std::path::{Path, PathBuf};
use std::time::Instant;
use tempfile::NamedTempFile;

/// A scene to be.
#[derive(Clone, Debug)]
pub(super) enum Subject {
    /// A ball of rock with so many triangles, by way of a file.
    Triangles(u64),
    /// So many at random places.
    Spheres(u32),
    /// What a file holds.
    File(PathBuf),
}

/// Something to look at.
#[derive(Debug)]
pub(super) struct Sight {
    pub(super) scene: Scene,
    pub(super) camera: CameraDesc,
    /// For Embree's own spheres, `[x, y, z, radius]` each; empty where there are none.
    #[cfg_attr(not(feature = "embree"), expect(dead_code, reason = "nobody else has spheres of its own"))]
    pub(super) spheres: Vec<[f32; 4]>,
}

/// A file that is read.
pub(super) enum File<'a> {
    Given(&'a Path),
    Temporary(NamedTempFile),
}

impl File<'_> {
    pub(super) fn path(&self) -> &Path {
        match self {
            Self::Given(path) => path,
            Self::Temporary(file) => file.path(),
        }
    }
}

/// All that is asked for, in the order of the report.
pub(super) fn all(options: &Options) -> Vec<Subject> {
    let triangles = options.triangles.iter().map(|&n| Subject::Triangles(n));
    let spheres = options.spheres.iter().map(|&n| Subject::Spheres(n));
    let files = options.files.iter().cloned().map(Subject::File);
    triangles.chain(spheres).chain(files).collect()
}

impl Subject {
    pub(super) fn kind(&self) -> Kind {
        match self {
            Self::Triangles(_) => Kind::Triangles,
            Self::Spheres(_) => Kind::Spheres,
            Self::File(_) => Kind::File,
        }
    }

    pub(super) fn name(&self) -> String {
        match self {
            Self::Triangles(n) => format!("{n} triangles"),
            Self::Spheres(n) => format!("{n} spheres"),
            Self::File(path) => path.display().to_string(),
        }
    }

    /// The same with what it came to: not every number of triangles makes a ball.
    pub(super) fn name_of(&self, scene: &Scene) -> String {
        match self {
            Self::Triangles(_) => format!("{} triangles", scene.stored_triangles()),
            Self::Spheres(_) | Self::File(_) => self.name(),
        }
    }

    /// About how many primitives there are; of a file, by its length.
    pub(super) fn about(&self) -> usize {
        /// Of text, for a triangle.
        const BYTES: u64 = 40;
        match self {
            Self::Triangles(n) => *n as usize,
            Self::Spheres(n) => *n as usize,
            Self::File(path) => std::fs::metadata(path).map_or(0, |meta| (meta.len() / BYTES) as usize),
        }
    }

    /// The file that has it, made if need be; none for what is made in memory.
    pub(super) fn file(&self) -> Result<Option<File<'_>>, Error> {
        match self {
            Self::File(path) => Ok(Some(File::Given(path))),
            Self::Spheres(_) => Ok(None),
            &Self::Triangles(triangles) => {
                let failed = |source| Error::Write { triangles, source };
                let file = tempfile::Builder::new().prefix("tison-").suffix(".obj").tempfile().map_err(failed)?;
                example::write_mesh(triangles, &mut BufWriter::new(&file)).map_err(failed)?;
                Ok(Some(File::Temporary(file)))
            }
        }
    }

    /// What is made in memory.
    pub(super) fn made(&self) -> Result<Sight, Error> {
        let &Self::Spheres(n) = self else { unreachable!("the others have files") };
        let mut random = Random(7);
        // So large that about half of the camera rays hit one.
        let radius = 1.27 / f64::from(n).sqrt();
        let centers: Vec<_> = (0..n).map(|_| random.point()).collect();
        let balls = centers.iter().map(|&c| Sphere::new(c, radius).expect("a size above 0"));
        let scene = Scene::of(vec![Object::Shapes(Shapes::bare(AnyShapes::Spheres(plain(balls))))]);
        let spheres = centers.iter().map(|c| c.extend(radius).as_vec4().to_array()).collect();
        Ok(Sight { spheres, ..lit(scene)? })
    }
}

/// Reads a file on `pool`, and the seconds it takes.
pub(super) fn load(path: &Path, pool: &ThreadPool) -> Result<(Sight, f64), Error> {
    let started = Instant::now();
    let loaded = pool.install(|| leaving::load(path))?;
    let seconds = started.elapsed().as_secs_f64();
    let view = match loaded.cameras.first() {
        Some(named) => Sight { scene: loaded.scene, camera: named.camera, spheres: Vec::new() },
        None if MeshFormat::of(path).is_some() => lit(loaded.scene)?,
        None => Sight { camera: framed(&loaded.scene)?, scene: loaded.scene, spheres: Vec::new() },
    };
    Ok((view, seconds))
}

/// Looked at and lit as a bare mesh is.
fn lit(mut scene: Scene) -> Result<Sight, Error> {
    let camera = framed(&scene)?;
    scene.light_from(&camera);
    Ok(Sight { scene, camera, spheres: Vec::new() })
}

fn framed(scene: &Scene) -> Result<CameraDesc, Error> {
    scene.auto_camera(View::ThreeQuarter, &CameraOverrides::default(), 1.0).map_err(Error::Camera)
}
