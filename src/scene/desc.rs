//! A scene as a file says it: names, paths and places in the file still on it, nothing read
//! that it names. Every scene format ends here; `freeze` goes on.

use super::CameraDesc;
use crate::math::{Filter, Sampler};
use glam::{DMat4, DVec3};
use std::path::PathBuf;

/// Everything one scene file says.
#[derive(Clone, Debug, Default)]
pub struct SceneDesc {
    /// Image and quality.
    pub render: RenderDesc,
    /// Cameras in the order of the file; the first is the default.
    pub cameras: Vec<NamedCamera>,
    /// Lights in the order of the file.
    pub lights: Vec<LightDesc>,
    /// Materials in the order of the file.
    pub materials: Vec<MaterialDesc>,
    /// Objects in the order of the file.
    pub objects: Vec<ObjectDesc>,
    /// The file read, then those that it includes: what [`Place::file`] counts.
    pub files: Vec<PathBuf>,
}

/// A place in a text file: index of the file in [`SceneDesc::files`]; line and column counted
/// from 1, columns in characters.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[expect(missing_docs, reason = "said above")]
pub struct Place {
    pub file: u32,
    pub line: u32,
    pub column: u32,
}

/// What the file says about the picture; `None` where it is silent.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RenderDesc {
    /// Width and height in pixels.
    pub size: Option<(u32, u32)>,
    /// Samples per pixel.
    pub samples: Option<u32>,
    /// Most reflections and refractions in a row.
    pub recursion: Option<u32>,
    /// Branches below this weight are dropped.
    pub min_weight: Option<f32>,
    /// Chooses the samples.
    pub seed: Option<u32>,
    /// What is seen where nothing is hit, linear RGB; black unless given.
    pub background: Option<[f64; 3]>,
    /// Ambient light, linear RGB; none unless given.
    pub ambient: Option<[f64; 3]>,
    /// Each camera ray passes within this many pixels of its pixel's centre, in x and y; half a
    /// pixel (the whole pixel) unless given. Makes the filter a box.
    pub jitter_radius: Option<f64>,
    /// How samples of a pixel are spread and weighed; [`Filter::Box`] if `jitter_radius` is given too.
    pub filter: Option<Filter>,
    /// How samples are drawn.
    pub sampler: Option<Sampler>,
    /// How lens points are drawn.
    pub lens_sampler: Option<LensSampler>,
    /// The rules of the course scenes: highlight towards the camera's position at every depth,
    /// one index of refraction at every surface, output stretched to the range of the image; bytes
    /// of images are linear, and meshes count v downwards.
    pub course_rules: bool,
}

/// How points of the lens are drawn.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum LensSampler {
    /// Shirley and Chiu's concentric map over Sobol points.
    #[default]
    Concentric,
    /// Radius `sqrt(u)`, uniform angle.
    Polar,
    /// Points of the square that fall outside the disc are drawn again.
    Rejection,
    /// Radius `u`, uniform angle: too many points in the middle, so the picture is biased. Kept
    /// because the 2011 report used it.
    PolarUniformRadius,
}

impl LensSampler {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::Concentric, Self::Polar, Self::Rejection, Self::PolarUniformRadius];

    /// The name in scene files and on the command line.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Concentric => "concentric",
            Self::Polar => "polar",
            Self::Rejection => "rejection",
            Self::PolarUniformRadius => "polar-uniform-radius",
        }
    }
}

/// A camera and its name.
#[derive(Clone, Debug, PartialEq)]
pub struct NamedCamera {
    /// Its name.
    pub name: String,
    /// The camera in world space.
    pub camera: CameraDesc,
}

/// A light as written.
#[derive(Clone, Debug, PartialEq)]
pub struct LightDesc {
    /// Its name.
    pub name: String,
    /// Where it is, world space.
    pub position: DVec3,
    /// Linear RGB, already multiplied by its power.
    pub color: [f64; 3],
    /// Radius of its ball; 0 is a point with hard shadows.
    pub radius: f64,
    /// How it weakens with distance.
    pub falloff: Falloff,
}

/// How a light weakens with distance.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Falloff {
    /// With the square, distance in world units.
    #[default]
    InverseSquare,
    /// Not at all.
    None,
}

/// A material as written, all weights linear.
#[derive(Clone, Debug, PartialEq)]
pub struct MaterialDesc {
    /// Its name.
    pub name: String,
    /// Base colour; multiplies the texture where both are given.
    pub color: [f64; 3],
    /// Image file that gives the base colour.
    pub texture: Option<TextureDesc>,
    /// Share or colour of ambient light.
    pub ambient: Weight,
    /// Share or colour of diffuse light.
    pub diffuse: Weight,
    /// Share or colour of the highlight.
    pub specular: Weight,
    /// Blinn-Phong exponent.
    pub shininess: f64,
    /// 0: the highlight takes the light's colour; 1: the surface's.
    pub metallic: f64,
    /// Added whatever the light.
    pub emission: [f64; 3],
    /// Weight of the mirrored ray.
    pub reflect: ReflectDesc,
    /// Weight of the refracted ray.
    pub refract: [f64; 3],
    /// Index of refraction.
    pub ior: f64,
    /// Absorption per world unit inside, by channel (Beer-Lambert).
    pub absorption: [f64; 3],
    /// Where its definition starts.
    pub place: Place,
}

impl Default for MaterialDesc {
    fn default() -> Self {
        Self {
            name: String::new(),
            color: [0.75; 3],
            texture: None,
            ambient: Weight::Share(1.0),
            diffuse: Weight::Share(1.0),
            specular: Weight::Share(0.0),
            shininess: 40.0,
            metallic: 0.0,
            emission: [0.0; 3],
            reflect: ReflectDesc::Constant([0.0; 3]),
            refract: [0.0; 3],
            ior: 1.5,
            absorption: [0.0; 3],
            place: Place::default(),
        }
    }
}

/// A number multiplies the base colour; a colour stands by itself.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Weight {
    /// Share of the base colour. For `specular`, of white (plastic) or the base colour (metal).
    Share(f64),
    /// A colour of its own.
    Color([f64; 3]),
}

/// Weight of the mirrored ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ReflectDesc {
    /// The same at every angle.
    Constant([f64; 3]),
    /// Fresnel's equations for `ior`.
    Fresnel,
}

/// An image used as a surface colour.
#[derive(Clone, Debug, PartialEq)]
pub struct TextureDesc {
    /// The file as written; where an included file names it, below that file's folder.
    pub path: PathBuf,
    /// Nearest texel instead of bilinear.
    pub nearest: bool,
    /// Where it is named.
    pub place: Place,
}

/// A thing in the scene.
#[derive(Clone, Debug, PartialEq)]
pub struct ObjectDesc {
    /// Its name, for messages.
    pub name: String,
    /// What it is.
    pub shape: ShapeDesc,
    /// Name of its material; `None`: the default grey, or a mesh's own.
    pub material: Option<String>,
    /// From its own space to the world, first step first.
    pub transform: Vec<TransformStep>,
    /// Where its definition starts.
    pub place: Place,
}

/// What an object is, in its own space.
#[derive(Clone, Debug, PartialEq)]
pub enum ShapeDesc {
    /// A ball.
    #[expect(missing_docs, reason = "said by their names")]
    Sphere { center: DVec3, radius: f64 },
    /// An axis-aligned box around the origin.
    #[expect(missing_docs, reason = "said by their names")]
    Cube { half: DVec3 },
    /// A cylinder around the z axis, `|z| <= height/2`. With (nx, ny) the normal on the viewed
    /// side, `u = fract(atan2(ny, nx) / 2π)` and `v = 1/2 - z / height`.
    #[expect(missing_docs, reason = "said by their names")]
    Cylinder { radius: f64, height: f64, capped: bool },
    /// The square `|x|, |y| <= half` in the plane z = 0.
    #[expect(missing_docs, reason = "said by their names")]
    Quad { half: f64 },
    /// Triangles in a file.
    Mesh {
        /// The file as written; where an included file names it, below that file's folder.
        path: PathBuf,
        /// Compute normals within this crease angle (degrees) where the file has none.
        smooth: Option<f64>,
        /// Where the file is named.
        place: Place,
    },
}

/// One step of a transform.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum TransformStep {
    /// Any affine matrix, points as columns: `p' = M p`.
    Matrix(DMat4),
    /// Moves the object's box to the origin and scales its longest side to this length.
    Fit(f64),
}
