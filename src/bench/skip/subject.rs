//! Scenes that have something to leave out, one for each skip.

use crate::film::Aov;
use crate::render::{Job, Stop};
use crate::scene::{self, LoadOptions, Loaded, Skip, Skips};
use image::RgbImage;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

/// How much of everything there is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scale {
    /// For tests: a small picture.
    Small,
    /// So much that times can be told.
    Full,
}

/// Something to render with and without a skip.
#[derive(Clone, Debug)]
pub struct Subject {
    /// What people call it.
    pub name: String,
    /// What is asked for; all skips on.
    pub job: Job,
    source: Source,
}

#[derive(Clone, Debug)]
enum Source {
    /// Of a scene file that lies in the folder of [`Assets`].
    Text(String),
    File(PathBuf),
}

/// Files that the scenes name, in a folder that is removed at the end.
#[derive(Debug)]
pub struct Assets {
    folder: tempfile::TempDir,
}

const CAMERA: &str = "[camera.main]\neye = [0, 1.5, 5]\ntarget = [0, 0.6, 0]\nfov = 40\n";
const FAR_CAMERA: &str = "[camera.main]\neye = [0, 6, 16]\ntarget = [0, 0.6, 0]\nfov = 40\n";
const RENDER: &str = "[render]\nbackground = [0.2, 0.3, 0.5]\nambient = 0.1\n";
const LIGHTS: &str = "[light.key]\nposition = [3, 5, 4]\nfalloff = 'none'\n\
                      [light.soft]\nposition = [-3, 4, 2]\nradius = 0.5\nfalloff = 'none'\ncolor = 0.5\n";
const DARK: &str = "[light.dark]\nposition = [0, 5, 5]\ncolor = 0\nradius = 0.3\n";
const MATERIALS: &str = "[material]\ndull = { color = [0.8, 0.6, 0.3], specular = 0 }\n\
                         shiny = { color = [0.3, 0.6, 0.8], specular = 0.6, shininess = 40 }\n";
const BLACK: &str = "black = { diffuse = 0, specular = 0 }\n";
const MIRROR: &str = "mirror = { color = 0.4, reflect = 0.7 }\n";
const AIR: &str = "air = { color = 0.5, reflect = 'fresnel', ior = 1 }\n";
const GLASS: &str =
    "glass = { color = 0.1, specular = 0.5, shininess = 60, reflect = 0.1, refract = 0.9, ior = 1.5 }\n";
const IMAGES: &str = "used = { texture = 'used.png' }\nspare = { texture = 'spare.png' }\n";
const FLOOR: &str = "[[object]]\nshape = 'cube'\nhalf = [4, 0.1, 4]\nmaterial = 'dull'\n\
                     transform = [{ translate = [0, -0.1, 0] }]\n";

const PLATE: &str = "[[object]]\nshape = 'cube'\nhalf = [3, 0.01, 3]\nmaterial = 'mirror'\n";

fn ball(material: &str, x: f64) -> String {
    format!("[[object]]\nshape = 'sphere'\ncenter = [{x}, 0.7, 0]\nradius = 0.7\nmaterial = '{material}'\n")
}

fn gem(material: &str) -> String {
    format!("[[object]]\nmesh = 'gem.obj'\nmaterial = '{material}'\ntransform = [{{ translate = [0, 1, 0] }}]\n")
}

impl Subject {
    /// A scene in which `skip` has something to leave out.
    #[must_use]
    pub fn of(skip: Skip, scale: Scale) -> Self {
        let (size, spp) = if scale == Scale::Small { ((72, 48), 4) } else { ((480, 320), 16) };
        let job = Job { spp, ..Job::whole(size) };
        let few = Job { spp: 1, ..job.clone() };
        let with = |extra: &str, objects: &[String]| {
            format!("{RENDER}{CAMERA}{LIGHTS}{MATERIALS}{extra}{}{FLOOR}", objects.concat())
        };
        let balls = || with("", &[ball("shiny", -0.8), ball("dull", 0.8)]);
        let gem_alone = || format!("{RENDER}{CAMERA}{LIGHTS}{MATERIALS}{}", gem("shiny"));
        let (name, text, job) = match skip {
            Skip::UnusedAssets => ("a spare image", with(IMAGES, &[ball("dull", -1.5), gem("used")]), few),
            Skip::Uv => ("a gem without an image", gem_alone(), few),
            Skip::Normals => ("a gem of facets", gem_alone(), job),
            Skip::Lens => ("two balls", balls(), job),
            Skip::Jitter => ("two balls, 1 spp", balls(), few),
            Skip::DarkLights => ("a dark light", balls().replace(MATERIALS, &format!("{DARK}{MATERIALS}")), job),
            Skip::ShadowRays => ("a black ball", with(BLACK, &[ball("shiny", -0.8), ball("black", 0.8)]), job),
            Skip::Enclosed | Skip::Inside => {
                let balls = with(GLASS, &[ball("glass", -0.8), ball("glass", 0.8)]);
                // Off the floor: they touch nothing.
                ("two glass balls", balls.replace(", 0.7, 0]", ", 0.9, 0]"), job)
            }
            Skip::FaintLights => (
                "two mirrors on a third",
                with(MIRROR, &[ball("mirror", -0.75), ball("mirror", 0.75), PLATE.into()]),
                Job { min_weight: 0.1, ..job },
            ),
            Skip::AnyHit => ("a ball and a gem", with("", &[ball("shiny", -1.5), gem("shiny")]), job),
            Skip::Powf => ("a dull ball", with("", &[ball("dull", 0.0)]), job),
            Skip::Secondary => ("two balls", balls(), job),
            Skip::WeightCut => (
                "two mirrors on a third",
                with(MIRROR, &[ball("mirror", -0.75), ball("mirror", 0.75), PLATE.into()]),
                Job { min_weight: 0.4, k_max: 60, ..job },
            ),
            Skip::Bounds => ("a gem far away", gem_alone().replace(CAMERA, FAR_CAMERA), job),
            Skip::Aovs => ("a ball and a gem", with("", &[ball("shiny", -1.5), gem("shiny")]), job),
            Skip::Converged => {
                let stop = Stop::Noise(0.02);
                ("two balls, adaptive", balls(), Job { spp: 8 * spp.max(8), stop, estimate: true, ..job })
            }
            Skip::Geometry => ("a gem", gem_alone(), job),
            Skip::BuildQuality => (
                "a gem, 1 spp",
                gem_alone(),
                Job { aovs: vec![Aov::Id, Aov::Depth], size: (size.0 / 3, size.1 / 3), ..few },
            ),
            Skip::Fresnel => ("a ball of air", with(AIR, &[ball("air", 0.0)]), job),
        };
        let job = Job { crop: Job::whole(job.size).crop, ..job };
        Self { name: name.into(), job, source: Source::Text(format!("tison = 1\n{text}")) }
    }

    /// A scene file, for `job`.
    #[must_use]
    pub fn file(path: &Path, job: Job) -> Self {
        Self { name: path.display().to_string(), job, source: Source::File(path.to_owned()) }
    }

    /// Reads it.
    ///
    /// # Errors
    /// As [`scene::load`].
    pub fn load(&self, assets: &Assets, skips: Skips) -> Result<Loaded, scene::Error> {
        let cancel = AtomicBool::new(false);
        let options = LoadOptions { skips, ..LoadOptions::new(&cancel) };
        match &self.source {
            Source::Text(text) => scene::load_text(&assets.folder.path().join("scene.toml"), text, &options),
            Source::File(path) => scene::load(path, &options),
        }
    }
}

impl Assets {
    /// Writes them.
    ///
    /// # Errors
    /// If they cannot be written.
    pub fn new(scale: Scale) -> std::io::Result<Self> {
        let (parts, pixels) = if scale == Scale::Small { (6, 8) } else { (120, 2048) };
        let folder = tempfile::tempdir()?;
        std::fs::write(folder.path().join("gem.obj"), gem_file(parts))?;
        let shade = |x: u32, y: u32| image::Rgb([(x * 7 % 256) as u8, (y * 5 % 256) as u8, ((x ^ y) % 256) as u8]);
        // The one that is shown is small: it is read at the same time.
        for (name, pixels) in [("used.png", 8), ("spare.png", pixels)] {
            let image = RgbImage::from_fn(pixels, pixels, shade);
            image.save(folder.path().join(name)).map_err(std::io::Error::other)?;
        }
        Ok(Self { folder })
    }
}

/// An octahedron without normals, each side cut into `parts` squared triangles, as OBJ.
fn gem_file(parts: u32) -> String {
    let (mut text, mut before) = (String::new(), 1);
    for side in 0..8u32 {
        let [x, y, z] = [0, 1, 2].map(|k| if side >> k & 1 == 0 { -1.0 } else { 1.0 });
        // Row i has parts + 1 - i points.
        let row = |i: u32| before + i * (parts + 1) - i * i.saturating_sub(1) / 2;
        for i in 0..=parts {
            for j in 0..=parts - i {
                let (a, b) = (f64::from(i) / f64::from(parts), f64::from(j) / f64::from(parts));
                text += &format!("v {} {} {}\nvt {a} {b}\n", x * (1.0 - a - b), y * a, z * b);
            }
        }
        let mut face = |a: u32, b: u32, c: u32| {
            let [a, b, c] = if x * y * z > 0.0 { [a, b, c] } else { [a, c, b] };
            text += &format!("f {a}/{a} {b}/{b} {c}/{c}\n");
        };
        for i in 0..parts {
            for j in 0..parts - i {
                face(row(i) + j, row(i + 1) + j, row(i) + j + 1);
                if i + j + 2 <= parts {
                    face(row(i + 1) + j, row(i + 1) + j + 1, row(i) + j + 1);
                }
            }
        }
        before += (parts + 1) * (parts + 2) / 2;
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_gem_is_closed_and_wound_outwards() {
        let assets = Assets::new(Scale::Small).expect("a folder");
        let loaded = Subject::of(Skip::Geometry, Scale::Small).load(&assets, Skips::ALL).expect("a good scene");
        let mesh = loaded.scene.objects[0].mesh().expect("it is one");
        let triangles = &mesh.data.triangles;
        assert_eq!(triangles.face_count(), 8 * 36);
        let mut volume = 0.0;
        for face in triangles.faces() {
            let [a, b, c] = face.map(|i| triangles.point(i).as_dvec3());
            volume += a.dot(b.cross(c)) / 6.0;
        }
        let unit = loaded.scene.frame.world_per_local();
        assert!((volume * unit.powi(3) - 4.0 / 3.0).abs() < 1e-5, "{volume}");
    }
}
