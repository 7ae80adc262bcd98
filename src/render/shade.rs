//! The branches that go on from a hit.

use super::contacts::Contacts;
use super::media::{Media, Medium};
use super::optics::{self, Refraction};
use super::surface::SurfacePoint;
use crate::scene::{AnyShapes, Material, Object, Reflect, Scene};
use glam::{DVec3, Vec3};

/// A ray that goes on from a hit.
#[derive(Clone, Copy, Debug)]
pub struct Branch {
    /// Unit direction.
    pub d: DVec3,
    /// Share of what it brings that the hit passes on.
    pub weight: Vec3,
}

/// What goes on from a hit.
#[derive(Clone, Copy, Debug)]
pub struct Onward {
    /// The mirrored branch, in the medium that the ray came through.
    pub reflected: Option<Branch>,
    /// The branch that passes.
    pub refracted: Option<Branch>,
    /// What that one travels in.
    pub behind: Medium,
}

/// The branches of a hit; `d` is the unit direction of the ray, `medium` what it travelled in.
#[must_use]
pub fn onward(
    scene: &Scene,
    contacts: &Contacts,
    media: &mut Media,
    point: &SurfacePoint,
    medium: Medium,
    d: DVec3,
) -> Onward {
    let material = &scene.materials[point.material];
    let dense = material.refracts() || material.reflect == Reflect::Fresnel;
    // What neither bends nor absorbs fills no space: a sheet with holes, say. A ball or box of
    // it is a bubble in what the ray is in.
    let bubble = medium != Medium::OUTSIDE && is_closed(scene, point.id);
    let fills = material.ior != 1.0 || material.absorption != Vec3::ZERO || bubble;
    if scene.course_rules {
        let (reflected, refracted) = branches(material, point, d, 1.0 / material.ior, optics::refract_as_course);
        return Onward { reflected, refracted, behind: medium };
    }
    let (eta, behind) = if !(dense && fills) {
        (1.0, medium)
    } else {
        let (before, behind) = point.both_sides();
        let also = contacts.crossed(scene, point.id, before, behind);
        let crossing = media.cross(&scene.materials, medium, point.material as u32, point.entering, also.as_ref());
        if crossing.hidden {
            let refracted = Some(Branch { d, weight: Vec3::ONE });
            return Onward { reflected: None, refracted, behind: crossing.behind };
        }
        (crossing.eta, crossing.behind)
    };
    let (reflected, refracted) = branches(material, point, d, eta, optics::refract);
    Onward { reflected, refracted, behind }
}

/// Whether the surface is known to enclose a space.
fn is_closed(scene: &Scene, [object, _]: [u32; 2]) -> bool {
    let Object::Shapes(shapes) = &scene.objects[object as usize] else { return false };
    match shapes.set {
        AnyShapes::Spheres(_) | AnyShapes::PlacedSpheres(_) | AnyShapes::Cubes(_) | AnyShapes::PlacedCubes(_) => true,
        // Open ones are among them.
        AnyShapes::Cylinders(_) | AnyShapes::Quads(_) | AnyShapes::Triangles(_) => false,
    }
}

/// The mirrored and the refracted branch of a hit; `d` is the unit direction of the ray, `eta`
/// the index of refraction before the surface over that behind it, `refract` the law that bends.
///
/// Under total internal reflection what would have been refracted is mirrored.
#[must_use]
fn branches(
    material: &Material,
    point: &SurfacePoint,
    d: DVec3,
    eta: f64,
    refract: impl Fn(DVec3, DVec3, f64) -> Option<Refraction>,
) -> (Option<Branch>, Option<Branch>) {
    // A smooth normal may face away from the ray although the facet does not.
    let n = if point.ns.dot(d) < 0.0 { point.ns } else { point.ng };
    let cos_i = -n.dot(d);
    let refraction =
        if material.refracts() || material.reflect == Reflect::Fresnel { refract(d, n, eta) } else { None };
    let (mut mirrored, mut passed) = match material.reflect {
        Reflect::Constant(weight) => (weight, material.refract),
        Reflect::Metal(color) => (color + (Vec3::ONE - color) * optics::schlick(cos_i) as f32, material.refract),
        // The equations say the same, but for 0 / 0 where the ray grazes.
        Reflect::Fresnel if eta == 1.0 => (Vec3::ZERO, material.refract),
        Reflect::Fresnel => {
            let f = refraction.map_or(1.0, |r| r.reflectance(cos_i, eta)) as f32;
            (Vec3::splat(f), material.refract * (1.0 - f))
        }
    };
    if refraction.is_none() && material.reflect != Reflect::Fresnel {
        mirrored += passed;
    }
    if refraction.is_none() {
        passed = Vec3::ZERO;
    }
    let reflected =
        (mirrored != Vec3::ZERO).then(|| Branch { d: above(optics::reflect(d, n), point.ng, d), weight: mirrored });
    let refracted = refraction.filter(|_| passed != Vec3::ZERO);
    (reflected, refracted.map(|r| Branch { d: below(r.direction, point.ng, d), weight: passed }))
}

/// Least part along the facet's normal of a ray that leaves it.
const LEAST_RISE: f64 = 1e-3;

/// A mirrored direction that an interpolated normal sent below the facet, lifted to just above.
fn above(r: DVec3, ng: DVec3, d: DVec3) -> DVec3 {
    let rise = r.dot(ng);
    // At grazing incidence the true mirrored ray leaves flatter than the limit.
    let least = LEAST_RISE.min(-d.dot(ng));
    if rise >= least { r } else { (r + ng * (least - rise)).normalize() }
}

/// A refracted direction that an interpolated normal kept above the facet, pushed to just below.
fn below(t: DVec3, ng: DVec3, d: DVec3) -> DVec3 {
    let fall = -t.dot(ng);
    let least = LEAST_RISE.min(-d.dot(ng));
    if fall >= least { t } else { (t - ng * (least - fall)).normalize() }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn point(entering: bool) -> SurfacePoint {
        SurfacePoint {
            p: DVec3::ZERO,
            ng: DVec3::Y,
            ns: DVec3::Y,
            to_eye: Vec3::Y,
            extent: 1.0,
            albedo: Vec3::ONE,
            id: [0; 2],
            material: 0,
            entering,
        }
    }

    fn glass(reflect: Reflect) -> Material {
        Material { reflect, refract: Vec3::splat(0.9), ior: 1.5, ..Material::default() }
    }

    #[test]
    fn total_reflection_adds_the_mirrored_ray() {
        let flat = DVec3::new(0.8, -0.6, 0.0);
        let (r, t) = branches(&glass(Reflect::Constant(Vec3::splat(0.1))), &point(false), flat, 1.5, optics::refract);
        assert!(t.is_none());
        assert!((r.expect("mirrored").weight - Vec3::ONE).length() < 1e-6);
        let (r, t) = branches(&glass(Reflect::Fresnel), &point(false), flat, 1.5, optics::refract);
        assert!(t.is_none() && r.expect("mirrored").weight == Vec3::ONE);
    }

    #[test]
    fn fresnel_shares_add_up() {
        let clear = Material { refract: Vec3::ONE, ..glass(Reflect::Fresnel) };
        for (x, y) in [(0.0, 1.0), (0.6, 0.8), (0.96, 0.28)] {
            let (r, t) = branches(&clear, &point(true), DVec3::new(x, -y, 0.0), 1.0 / 1.5, optics::refract);
            let (r, t) = (r.expect("mirrored"), t.expect("refracted"));
            assert!((r.weight + t.weight - Vec3::ONE).length() < 1e-6);
            assert!((r.d - DVec3::new(x, y, 0.0)).length() < 1e-14);
            assert!((t.d.x - x / 1.5).abs() < 1e-14 && t.d.y < 0.0);
        }
    }

    #[test]
    fn equal_indices_mirror_nothing_at_any_angle() {
        let same = Material { ior: 1.0, ..glass(Reflect::Fresnel) };
        for (x, y) in [(0.0, 1.0), (0.8, 0.6), (1.0, 0.0)] {
            let d = DVec3::new(x, -y, 0.0);
            let (r, t) = branches(&same, &point(true), d, 1.0, optics::refract);
            assert!(r.is_none() && t.expect("it passes").weight == same.refract, "{d}");
        }
    }

    #[test]
    fn a_tilted_shading_normal_sends_no_ray_through_the_facet() {
        let tilted = SurfacePoint { ns: DVec3::new(0.6, 0.8, 0.0), ..point(true) };
        let d = DVec3::new(-0.9, -0.1, 0.0).normalize();
        let (r, t) = branches(&glass(Reflect::Constant(Vec3::ONE)), &tilted, d, 1.0 / 1.5, optics::refract);
        assert!(r.expect("mirrored").d.y > 0.0 && t.expect("refracted").d.y < 0.0);
    }
}
