//! Closed shapes seen from the inside: which lights they hide, and which of them hold nothing but themselves.

use crate::geom::{Bounds, Ray, ShapeSet};
use crate::scene::{Light, Object, Scene, Shapes};
use crate::with_shapes;

/// Object and primitive.
type Id = [u32; 2];

/// More primitives than this are not looked at: looking takes the square of what overlaps along one axis.
const MOST_PRIMITIVES: usize = 50_000;
/// Nor more pairs.
const MOST_LOOKS: usize = 20_000_000;

/// How much wider than its box a shape is taken to be, of its size and its distance from the origin: more than a
/// ray is moved off a surface, and a light is looked for behind one.
const MARGIN: f64 = 1e-4;

/// What is known about the insides of a scene's shapes.
///
/// Both facts spare rays without changing anything. A shadow ray that starts inside of a closed shape and
/// ends outside crosses its surface. A ray inside of a convex shape whose box no other one meets can
/// only hit that shape, so that its own formula answers, the one that backends ask.
#[derive(Debug, Default)]
pub struct Enclosures {
    /// Of each light: whether it stands outside of every closed shape.
    outside: Vec<bool>,
    /// Of each object and primitive: whether it is closed and no box of another primitive meets its own.
    solitary: Vec<Vec<bool>>,
}

impl Enclosures {
    /// Those of `scene` for some of its lights; which shapes are solitary matters only where rays get inside. What is
    /// not asked about is taken to be otherwise.
    #[must_use]
    pub fn of(scene: &Scene, lights: &[Light], lights_outside: bool, rays_inside: bool) -> Self {
        let inside =
            |light: &Light| scene.objects.iter().filter_map(closed).flat_map(boxes).any(|b| is_near(&b, light));
        Self {
            outside: lights.iter().map(|light| lights_outside && !inside(light)).collect(),
            solitary: if rays_inside { solitary(scene) } else { Vec::new() },
        }
    }

    /// Whether light `index` stands outside of every closed shape.
    #[inline]
    #[must_use]
    pub fn is_outside(&self, index: usize) -> bool {
        self.outside[index]
    }

    /// Whether shape `id` is closed and touches nothing.
    #[inline]
    #[must_use]
    pub fn is_solitary(&self, [object, prim]: Id) -> bool {
        self.solitary.get(object as usize).is_some_and(|of| of.get(prim as usize).is_some_and(|&s| s))
    }

    /// Where a ray from the inside of a solitary shape leaves it, as a backend would report; `None` if it starts
    /// so close to the surface that the formula does not meet it.
    #[inline]
    #[must_use]
    pub fn exit(scene: &Scene, [object, prim]: Id, ray: &Ray) -> Option<f32> {
        let Object::Shapes(shapes) = &scene.objects[object as usize] else { return None };
        let (o, d) = (ray.o.as_dvec3(), ray.d.as_dvec3());
        let (t_near, t_far) = (f64::from(ray.t_near), f64::from(ray.t_far));
        with_shapes!(&shapes.set, set => set.hit(prim, o, d, t_near, t_far)).map(|t| t as f32)
    }
}

/// The closed shapes of an object that is some.
fn closed(object: &Object) -> Option<&Shapes> {
    match object {
        Object::Shapes(shapes) if shapes.set.are_closed() => Some(shapes),
        _ => None,
    }
}

fn boxes(shapes: &Shapes) -> impl Iterator<Item = Bounds> {
    (0..shapes.set.len()).map(|prim| wider(with_shapes!(&shapes.set, set => set.bounds(prim))))
}

fn solitary(scene: &Scene) -> Vec<Vec<bool>> {
    let mut all = Vec::new();
    for (object, o) in (0..).zip(&scene.objects) {
        match o {
            Object::Shapes(shapes) => all.extend((0..).zip(boxes(shapes)).map(|(prim, b)| ([object, prim], b))),
            _ => all.push(([object, 0], wider(o.bounds()))),
        }
        if all.len() > MOST_PRIMITIVES {
            return Vec::new();
        }
    }
    all.sort_by(|a, b| a.1.lo.x.total_cmp(&b.1.lo.x));
    let mut alone: Vec<Vec<bool>> =
        scene.objects.iter().map(|o| closed(o).map_or(Vec::new(), |s| vec![true; s.set.len() as usize])).collect();
    let mut looked = 0;
    for (i, (id, own)) in all.iter().enumerate() {
        for (other, theirs) in all[i + 1..].iter().take_while(|(_, other)| other.lo.x <= own.hi.x) {
            looked += 1;
            if own.meets(theirs) {
                for [object, prim] in [*id, *other] {
                    alone[object as usize].get_mut(prim as usize).into_iter().for_each(|alone| *alone = false);
                }
            }
        }
        if looked > MOST_LOOKS {
            return Vec::new();
        }
    }
    alone
}

fn wider(b: Bounds) -> Bounds {
    let by = MARGIN * (b.size() + b.lo.abs().max(b.hi.abs())).max_element();
    Bounds { lo: b.lo - by, hi: b.hi + by }
}

fn is_near(b: &Bounds, light: &Light) -> bool {
    b.meets(&Bounds { lo: light.position - light.radius, hi: light.position + light.radius })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::{Plain, Sphere};
    use crate::scene::AnyShapes;
    use glam::{DVec3, Vec3};

    fn balls(at: &[(f64, f64)]) -> Scene {
        let mut set = Plain::default();
        for &(x, radius) in at {
            set.push(Sphere::new(DVec3::new(x, 0.0, 0.0), radius).expect("a size above 0"));
        }
        Scene::of(vec![Object::Shapes(Shapes::bare(AnyShapes::Spheres(set.into())))])
    }

    fn of(scene: &Scene, lights: &[Light]) -> Enclosures {
        Enclosures::of(scene, lights, true, true)
    }

    #[test]
    fn shapes_that_touch_are_not_solitary() {
        let scene = balls(&[(0.0, 1.0), (5.0, 1.0), (6.9, 1.0), (9.0, 1.0), (11.0, 1.0)]);
        let found: Vec<_> = (0..5).map(|prim| of(&scene, &[]).is_solitary([0, prim])).collect();
        assert_eq!(found, [true, false, false, false, false], "the last two touch in a point");
        assert!(!of(&scene, &[]).is_solitary([7, 0]) && !Enclosures::of(&scene, &[], true, false).is_solitary([0, 0]));
    }

    #[test]
    fn one_ball_inside_another_is_not_solitary() {
        let scene = balls(&[(0.0, 3.0), (0.0, 1.0)]);
        assert!(!of(&scene, &[]).is_solitary([0, 0]) && !of(&scene, &[]).is_solitary([0, 1]));
    }

    #[test]
    fn a_light_that_reaches_into_a_shape_is_not_outside() {
        let scene = balls(&[(0.0, 1.0)]);
        let light = |x| Light::constant(DVec3::new(x, 0.0, 0.0), Vec3::ONE);
        let wide = Light { radius: 1.5, ..light(2.0) };
        let lights = [light(0.5), light(1.00001), light(1.1), wide, light(20.0)];
        let found = of(&scene, &lights);
        let outside: Vec<_> = (0..lights.len()).map(|i| found.is_outside(i)).collect();
        assert_eq!(outside, [false, false, true, false, true]);
    }

    #[test]
    fn a_ray_leaves_by_the_far_side() {
        let scene = balls(&[(0.0, 1.0)]);
        let ray = Ray::new(Vec3::new(-0.75, 0.0, 0.0), Vec3::X);
        assert_eq!(Enclosures::exit(&scene, [0, 0], &ray), Some(1.75));
        let outwards = Ray::new(Vec3::new(1.001, 0.0, 0.0), Vec3::X);
        assert_eq!(Enclosures::exit(&scene, [0, 0], &outwards), None);
    }
}
