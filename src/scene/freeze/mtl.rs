//! What an entry of a material library means here.

use crate::scene::obj::MtlMaterial;
use crate::scene::{Material, Reflect, Textured};
use glam::Vec3;

/// A colour, part of it as it is and part of it times the texel.
#[derive(Clone, Copy)]
struct Color {
    plain: Vec3,
    texel: Vec3,
}

impl Color {
    fn scaled(self, by: Vec3) -> Self {
        Self { plain: self.plain * by, texel: self.texel * by }
    }

    fn plus(self, plain: Vec3) -> Self {
        Self { plain: self.plain + plain, ..self }
    }
}

const NONE: Color = Color { plain: Vec3::ZERO, texel: Vec3::ZERO };

/// The material that `m` describes; `illum` decides which of its colours count. `image` is the number of
/// its `map_Kd`, where that can be used: its texels multiply `Kd`, which is white unless given.
pub fn material(m: &MtlMaterial, image: Option<u32>) -> Material {
    let nothing = MtlMaterial { map_kd: m.map_kd.clone(), ..MtlMaterial::named(m.name.clone()) };
    if image.is_none() && *m == nothing {
        return Material { name: m.name.clone(), ..Material::default() };
    }
    let kd = Vec3::from(m.kd.unwrap_or(if image.is_some() { [1.0; 3] } else { [0.75; 3] }));
    let base = match image {
        Some(_) => Color { plain: Vec3::ZERO, texel: kd },
        None => Color { plain: kd, texel: Vec3::ZERO },
    };
    let parts = Parts::of(m, base);
    let roughness = m.pr.filter(|&r| r > 0.0);
    let from_roughness = roughness.map(|r| (2.0 / (r * r * r * r) - 2.0).max(0.0));
    Material {
        name: m.name.clone(),
        ambient: parts.ambient.plain,
        diffuse: parts.diffuse.plain,
        specular: parts.specular.plain,
        shininess: m.ns.or(from_roughness).unwrap_or(0.0).clamp(0.0, 1e6),
        emission: parts.emission.plain,
        reflect: reflect(m),
        refract: parts.refract,
        ior: parts.ior,
        absorption: Vec3::ZERO,
        texture: image.map(|image| Textured {
            image,
            ambient: parts.ambient.texel,
            diffuse: parts.diffuse.texel,
            specular: parts.specular.texel,
            emission: parts.emission.texel,
        }),
    }
}

/// `illum`, 1 or 2 where it is not given.
fn illum(m: &MtlMaterial) -> u8 {
    m.illum.unwrap_or(if m.ks.is_some() { 2 } else { 1 })
}

fn reflect(m: &MtlMaterial) -> Reflect {
    let ks = Vec3::from(m.ks.unwrap_or([0.0; 3]));
    match illum(m) {
        3 | 4 | 6 => Reflect::Constant(ks),
        5 => Reflect::Metal(ks),
        7 => Reflect::Fresnel,
        _ => Reflect::NONE,
    }
}

/// What depends on `illum` and the base colour.
struct Parts {
    ambient: Color,
    diffuse: Color,
    specular: Color,
    emission: Color,
    refract: Vec3,
    ior: f64,
}

impl Parts {
    fn of(m: &MtlMaterial, base: Color) -> Self {
        let illum = illum(m);
        let ks = Vec3::from(m.ks.unwrap_or([0.0; 3]));
        let metallic = m.pm.unwrap_or(0.0).clamp(0.0, 1.0);
        let shiny = !matches!(illum, 0 | 1);
        let emission = NONE.plus(Vec3::from(m.ke.unwrap_or([0.0; 3])));
        let tint = Vec3::from(m.tf.unwrap_or([1.0; 3]));
        let out = Self {
            // Many exporters always write `Ka 1 1 1`, others repeat Kd: the surface's colour is meant.
            ambient: match m.ka.filter(|&ka| ka != [1.0; 3] && Some(ka) != m.kd) {
                Some(ka) => NONE.plus(Vec3::from(ka)),
                None => base,
            },
            diffuse: base,
            specular: if shiny { base.scaled(metallic * ks).plus((1.0 - metallic) * ks) } else { NONE },
            emission,
            refract: Vec3::ZERO,
            ior: f64::from(m.ni.unwrap_or(if matches!(illum, 6 | 7) { 1.5 } else { 1.0 })),
        };
        let opacity = m.d.unwrap_or(1.0);
        match illum {
            0 => Self { ambient: NONE, diffuse: NONE, specular: NONE, emission: base.plus(emission.plain), ..out },
            4 | 6 | 7 | 9 => Self { refract: tint * m.d.map_or(1.0, |d| 1.0 - d), ..out },
            // Plain alpha: what is not covered is seen through, unbent.
            1 | 2 if opacity < 1.0 => Self {
                ambient: out.ambient.scaled(Vec3::splat(opacity)),
                diffuse: out.diffuse.scaled(Vec3::splat(opacity)),
                refract: tint * (1.0 - opacity),
                ior: 1.0,
                ..out
            },
            _ => out,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn named() -> MtlMaterial {
        MtlMaterial { kd: Some([0.5, 0.25, 1.0]), ks: Some([0.5; 3]), ..MtlMaterial::named("m".into()) }
    }

    #[test]
    fn nothing_said_is_the_default() {
        let nothing = MtlMaterial::named("a".into());
        let broken = MtlMaterial { map_kd: Some("broken.png".into()), ..nothing.clone() };
        for mtl in [nothing, broken] {
            assert_eq!(material(&mtl, None), Material { name: "a".into(), ..Material::default() });
        }
    }

    #[test]
    fn an_image_multiplies_kd_wherever_that_counts() {
        let kd = Vec3::new(0.5, 0.25, 1.0);
        let half = Vec3::splat(0.5);
        let cases = [
            ("plain", named(), [kd, kd, Vec3::ZERO, Vec3::ZERO]),
            (
                "Ka as exporters write it",
                MtlMaterial { ka: Some([1.0; 3]), ..named() },
                [kd, kd, Vec3::ZERO, Vec3::ZERO],
            ),
            ("Ka like Kd", MtlMaterial { ka: named().kd, ..named() }, [kd, kd, Vec3::ZERO, Vec3::ZERO]),
            ("Ka of its own", MtlMaterial { ka: Some([0.1; 3]), ..named() }, [Vec3::ZERO, kd, Vec3::ZERO, Vec3::ZERO]),
            ("metal", MtlMaterial { pm: Some(1.0), ..named() }, [kd, kd, kd * half, Vec3::ZERO]),
            ("half covered", MtlMaterial { d: Some(0.5), ..named() }, [kd * half, kd * half, Vec3::ZERO, Vec3::ZERO]),
            ("flat", MtlMaterial { illum: Some(0), ..named() }, [Vec3::ZERO, Vec3::ZERO, Vec3::ZERO, kd]),
        ];
        for (name, mtl, [ambient, diffuse, specular, emission]) in cases {
            let with = material(&mtl, Some(3));
            assert_eq!(with.texture, Some(Textured { image: 3, ambient, diffuse, specular, emission }), "{name}");
            // A white image changes nothing.
            let without = material(&mtl, None);
            let sum =
                (with.ambient + ambient, with.diffuse + diffuse, with.specular + specular, with.emission + emission);
            assert_eq!(sum, (without.ambient, without.diffuse, without.specular, without.emission), "{name}");
        }
        let bare = material(&MtlMaterial { illum: Some(1), ..MtlMaterial::named("m".into()) }, Some(0));
        assert_eq!(bare.texture.map(|t| t.diffuse), Some(Vec3::ONE), "the image alone");
    }
}
