//! The materials in use, and what they come to.

use crate::scene::desc::{MaterialDesc, ReflectDesc, SceneDesc, ShapeDesc, Weight};
use crate::scene::{Material, Reflect, Textured};
use glam::{DVec3, Vec3};
use std::collections::HashMap;

/// What objects are made of.
#[derive(Debug)]
pub struct Palette {
    /// Materials by their number in the scene, in the order of first use: those of the file by their
    /// number there, `None` for the default grey.
    pub entries: Vec<Option<usize>>,
    /// Number in the scene of each object's material; [`OWN`](Self::OWN) for a mesh in those of its file.
    pub of_object: Vec<u32>,
}

impl Palette {
    /// A mesh brings its own materials.
    pub const OWN: u32 = u32::MAX;

    /// The materials that the objects of `desc` name.
    pub fn of(desc: &SceneDesc) -> Self {
        let by_name: HashMap<&str, usize> = desc.materials.iter().zip(0..).map(|(m, i)| (m.name.as_str(), i)).collect();
        // The last is the default grey.
        let mut numbers = vec![Self::OWN; desc.materials.len() + 1];
        let mut entries = Vec::new();
        let mut number = |entry: Option<usize>| {
            let slot = &mut numbers[entry.unwrap_or(desc.materials.len())];
            if *slot == Self::OWN {
                *slot = entries.len() as u32;
                entries.push(entry);
            }
            *slot
        };
        let of_object = desc.objects.iter().map(|o| match &o.material {
            Some(name) => number(by_name.get(name.as_str()).copied()),
            None if matches!(o.shape, ShapeDesc::Mesh { .. }) => Self::OWN,
            None => number(None),
        });
        let of_object = of_object.collect();
        Self { entries, of_object }
    }
}

/// Whether the image of `desc` shows anywhere.
pub fn samples(desc: &MaterialDesc) -> bool {
    desc.texture.is_some() && Split::of(desc).texel().iter().any(|&part| part != DVec3::ZERO)
}

/// The material that `desc` describes. `image` is the number of its image, if that shows;
/// `world_per_local` the length of a scene unit.
pub fn material(desc: &MaterialDesc, image: Option<u32>, world_per_local: f64) -> Material {
    let split = Split::of(desc);
    let [ambient, diffuse, specular] = split.texel().map(rgb);
    Material {
        name: desc.name.clone(),
        ambient: rgb(split.ambient.0),
        diffuse: rgb(split.diffuse.0),
        specular: rgb(split.specular.0),
        shininess: desc.shininess.clamp(0.0, 1e6) as f32,
        emission: rgb(desc.emission.into()),
        reflect: match desc.reflect {
            ReflectDesc::Constant(weight) => Reflect::Constant(rgb(weight.into())),
            ReflectDesc::Fresnel => Reflect::Fresnel,
        },
        refract: rgb(desc.refract.into()),
        ior: desc.ior,
        absorption: rgb(DVec3::from(desc.absorption) * world_per_local),
        texture: image.map(|image| Textured { image, ambient, diffuse, specular, emission: Vec3::ZERO }),
    }
}

/// Colours as they are, and what multiplies the texel.
struct Split {
    ambient: (DVec3, DVec3),
    diffuse: (DVec3, DVec3),
    specular: (DVec3, DVec3),
}

impl Split {
    fn of(desc: &MaterialDesc) -> Self {
        let color = DVec3::from(desc.color);
        let base = |share: f64| match desc.texture {
            Some(_) => (DVec3::ZERO, share * color),
            None => (share * color, DVec3::ZERO),
        };
        let of = |weight| match weight {
            Weight::Share(share) => base(share),
            Weight::Color(own) => (own.into(), DVec3::ZERO),
        };
        let specular = match desc.specular {
            Weight::Share(share) => {
                let (plain, texel) = base(share * desc.metallic);
                (plain + share * (1.0 - desc.metallic), texel)
            }
            own => of(own),
        };
        Self { ambient: of(desc.ambient), diffuse: of(desc.diffuse), specular }
    }

    fn texel(&self) -> [DVec3; 3] {
        [self.ambient.1, self.diffuse.1, self.specular.1]
    }
}

/// To f32, finite whatever it was.
pub fn rgb(color: DVec3) -> Vec3 {
    const MOST: f64 = f32::MAX as f64;
    color.clamp(DVec3::splat(-MOST), DVec3::splat(MOST)).as_vec3()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::desc::{ObjectDesc, Place, TextureDesc};

    fn textured() -> MaterialDesc {
        let texture = Some(TextureDesc { path: "a.png".into(), nearest: false, place: Place::default() });
        MaterialDesc { color: [0.5, 1.0, 0.25], texture, ..MaterialDesc::default() }
    }

    #[test]
    fn shares_take_the_colour_and_colours_stand_alone() {
        let color = Vec3::new(0.5, 1.0, 0.25);
        let weights = MaterialDesc {
            ambient: Weight::Share(0.5),
            diffuse: Weight::Color([0.1, 0.2, 0.3]),
            specular: Weight::Share(0.5),
            metallic: 0.25,
            ..textured()
        };
        let with = material(&weights, Some(2), 1.0);
        let own = Vec3::new(0.1, 0.2, 0.3);
        assert_eq!((with.ambient, with.diffuse, with.specular), (Vec3::ZERO, own, Vec3::splat(0.375)));
        let texture = with.texture.expect("it has one");
        assert_eq!((texture.image, texture.ambient, texture.diffuse), (2, 0.5 * color, Vec3::ZERO));
        assert_eq!(texture.specular, 0.125 * color);
        // A white image changes nothing.
        let without = material(&MaterialDesc { texture: None, ..weights }, None, 1.0);
        assert_eq!((without.ambient, without.diffuse), (0.5 * color, own));
        assert_eq!(without.specular, 0.375 + 0.125 * color);
        let specular = Weight::Color([0.4; 3]);
        let alone = material(&MaterialDesc { specular, metallic: 1.0, ..textured() }, Some(0), 1.0);
        assert_eq!((alone.specular, alone.texture.map(|t| t.specular)), (Vec3::splat(0.4), Some(Vec3::ZERO)));
    }

    #[test]
    fn an_image_that_no_weight_takes_does_not_show() {
        let of = |ambient, diffuse, metallic| MaterialDesc { ambient, diffuse, metallic, ..textured() };
        let (none, own) = (Weight::Share(0.0), Weight::Color([1.0; 3]));
        assert!(samples(&of(none, Weight::Share(0.1), 0.0)) && samples(&of(Weight::Share(0.1), own, 0.0)));
        assert!(!samples(&of(none, own, 1.0)));
        assert!(!samples(&MaterialDesc::default()));
        assert!(samples(&MaterialDesc { specular: Weight::Share(1.0), ..of(none, none, 1.0) }));
        assert!(!samples(&MaterialDesc { specular: Weight::Share(1.0), ..of(none, none, 0.0) }));
    }

    #[test]
    fn units_and_extremes() {
        let desc = MaterialDesc {
            absorption: [0.5, 0.0, 2.0],
            shininess: 1e300,
            emission: [1e300, -1e300, 0.0],
            ..MaterialDesc::default()
        };
        let m = material(&desc, None, 8.0);
        assert_eq!(m.absorption, Vec3::new(4.0, 0.0, 16.0));
        assert_eq!((m.shininess, m.emission), (1e6, Vec3::new(f32::MAX, -f32::MAX, 0.0)));
    }

    #[test]
    fn materials_are_numbered_as_they_are_used() {
        let named = |name: &str| MaterialDesc { name: name.into(), ..MaterialDesc::default() };
        let object = |shape, material: Option<&str>| ObjectDesc {
            name: String::new(),
            shape,
            material: material.map(Into::into),
            transform: Vec::new(),
            place: Place::default(),
        };
        let quad = ShapeDesc::Quad { half: 1.0 };
        let mesh = ShapeDesc::Mesh { path: "a.obj".into(), smooth: None, place: Place::default() };
        let objects = vec![
            object(quad.clone(), Some("c")),
            object(mesh.clone(), None),
            object(quad.clone(), None),
            object(mesh, Some("a")),
            object(quad, Some("c")),
        ];
        let desc = SceneDesc { materials: vec![named("a"), named("b"), named("c")], objects, ..SceneDesc::default() };
        let palette = Palette::of(&desc);
        assert_eq!(palette.entries, [Some(2), None, Some(0)]);
        assert_eq!(palette.of_object, [0, Palette::OWN, 1, 2, 0]);
    }
}
