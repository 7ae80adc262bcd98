//! Analytic shapes, sorted into sets of one class each.

use crate::geom::{Affine, Bounds, Cube, Cylinder, ExactTriangle, Plain, Quad, Shape, ShapeError, Sphere, invert};
use crate::scene::desc::ShapeDesc;
use crate::scene::{AnyShapes, Shapes};
use glam::{DAffine3, DVec2, DVec3};
use std::sync::Arc;

/// A shape in its own space.
#[derive(Clone, Copy, Debug, PartialEq)]
#[expect(missing_docs, reason = "the classes")]
pub enum OneShape {
    Sphere(Sphere),
    Cube(Cube),
    Cylinder(Cylinder),
    Quad(Quad),
    Triangle(ExactTriangle),
}

impl OneShape {
    /// The shape that `desc` describes; none for a mesh.
    pub(super) fn of(desc: &ShapeDesc) -> Result<Option<Self>, ShapeError> {
        Ok(Some(match *desc {
            ShapeDesc::Sphere { center, radius } => Self::Sphere(Sphere::new(center, radius)?),
            ShapeDesc::Cube { half } => Self::Cube(Cube::new(DVec3::ZERO, half)?),
            ShapeDesc::Cylinder { radius, height, capped } => Self::Cylinder(Cylinder::new(radius, height, capped)?),
            ShapeDesc::Quad { half } => Self::Quad(Quad::new(DVec2::splat(half))?),
            ShapeDesc::Mesh { .. } => return Ok(None),
        }))
    }

    /// Its box when `to` places it.
    #[must_use]
    pub fn bounds(&self, to: &DAffine3) -> Bounds {
        match self {
            Self::Sphere(s) => s.bounds(to),
            Self::Cube(s) => s.bounds(to),
            Self::Cylinder(s) => s.bounds(to),
            Self::Quad(s) => s.bounds(to),
            Self::Triangle(s) => s.bounds(to),
        }
    }
}

/// Which set a shape went to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Class {
    Spheres,
    Cubes,
    PlacedSpheres,
    PlacedCubes,
    Cylinders,
    Quads,
    Triangles,
}

/// A set for each class, and the materials of the shapes in it.
#[derive(Debug, Default)]
pub struct Sets {
    spheres: (Plain<Sphere>, Vec<u32>),
    cubes: (Plain<Cube>, Vec<u32>),
    placed_spheres: (Affine<Sphere>, Vec<u32>),
    placed_cubes: (Affine<Cube>, Vec<u32>),
    cylinders: (Affine<Cylinder>, Vec<u32>),
    quads: (Affine<Quad>, Vec<u32>),
    triangles: (Plain<ExactTriangle>, Vec<u32>),
}

impl Sets {
    /// Adds a shape as `to_scene` places it: without a transform of its own where that makes the
    /// same kind of shape of it, and the same texture.
    pub fn add(&mut self, shape: OneShape, to_scene: &DAffine3, material: u32) -> Result<Class, ShapeError> {
        let class = match shape {
            OneShape::Sphere(sphere) => match sphere.under(to_scene) {
                Some(plain) => {
                    self.spheres.0.push(plain);
                    Class::Spheres
                }
                None => {
                    let (centered, to_scene) = centered(&sphere, to_scene)?;
                    self.placed_spheres.0.push(centered, to_scene)?;
                    Class::PlacedSpheres
                }
            },
            OneShape::Cube(cube) => match cube.under(to_scene) {
                Some(plain) => {
                    self.cubes.0.push(plain);
                    Class::Cubes
                }
                None => {
                    let translation = to_scene.transform_point3(cube.center());
                    let centered = Cube::new(DVec3::ZERO, cube.half())?;
                    self.placed_cubes.0.push(centered, DAffine3 { translation, ..*to_scene })?;
                    Class::PlacedCubes
                }
            },
            OneShape::Cylinder(cylinder) => {
                self.cylinders.0.push(cylinder, *to_scene)?;
                Class::Cylinders
            }
            OneShape::Quad(quad) => {
                self.quads.0.push(quad, *to_scene)?;
                Class::Quads
            }
            OneShape::Triangle(triangle) => {
                invert(to_scene)?;
                self.triangles.0.push(triangle.under(to_scene));
                Class::Triangles
            }
        };
        self.materials(class).push(material);
        Ok(class)
    }

    fn materials(&mut self, class: Class) -> &mut Vec<u32> {
        match class {
            Class::Spheres => &mut self.spheres.1,
            Class::Cubes => &mut self.cubes.1,
            Class::PlacedSpheres => &mut self.placed_spheres.1,
            Class::PlacedCubes => &mut self.placed_cubes.1,
            Class::Cylinders => &mut self.cylinders.1,
            Class::Quads => &mut self.quads.1,
            Class::Triangles => &mut self.triangles.1,
        }
    }

    /// Takes the set of a class out.
    pub fn take(&mut self, class: Class) -> Shapes {
        fn taken<S: Default>(of: &mut (S, Vec<u32>), any: impl Fn(Arc<S>) -> AnyShapes) -> Shapes {
            let (set, mut materials) = std::mem::take(of);
            materials.shrink_to_fit();
            Shapes { set: any(Arc::new(set)), materials }
        }
        match class {
            Class::Spheres => taken(&mut self.spheres, AnyShapes::Spheres),
            Class::Cubes => taken(&mut self.cubes, AnyShapes::Cubes),
            Class::PlacedSpheres => taken(&mut self.placed_spheres, AnyShapes::PlacedSpheres),
            Class::PlacedCubes => taken(&mut self.placed_cubes, AnyShapes::PlacedCubes),
            Class::Cylinders => taken(&mut self.cylinders, AnyShapes::Cylinders),
            Class::Quads => taken(&mut self.quads, AnyShapes::Quads),
            Class::Triangles => taken(&mut self.triangles, AnyShapes::Triangles),
        }
    }
}

/// The sphere around the origin of its own space: a centre far from there would cost its rays digits.
fn centered(sphere: &Sphere, to_scene: &DAffine3) -> Result<(Sphere, DAffine3), ShapeError> {
    let translation = to_scene.transform_point3(sphere.center());
    Ok((Sphere::new(DVec3::ZERO, sphere.radius())?, DAffine3 { translation, ..*to_scene }))
}
