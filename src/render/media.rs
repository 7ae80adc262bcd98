//! What a ray travels in: the solids that it has entered and not left again.

use super::block::Path;
use super::contacts::Crossed;
use crate::scene::Material;
use glam::Vec3;

/// A number for the solids around a ray, made by [`Media`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Medium(u32);

impl Medium {
    /// In none: index of refraction 1.
    pub const OUTSIDE: Self = Self(0);
}

/// All nestings of materials that rays have met so far. The one entered last is what a ray is
/// in: where solids overlap, the inner or later one wins until it is left.
///
/// Each nesting is stored once and named by a [`Medium`], so that a ray carries 4 bytes.
#[derive(Debug)]
pub struct Media {
    /// The nesting without the last material, and that material.
    nestings: Vec<Nesting>,
}

#[derive(Clone, Copy, Debug)]
struct Nesting {
    outer: Medium,
    material: u32,
    depth: u32,
    /// Of those with one material more, the one made last, and the one made before this one;
    /// `OUTSIDE` ends the list.
    inner: Medium,
    sibling: Medium,
}

impl Nesting {
    fn new(outer: Medium, material: u32, depth: u32) -> Self {
        Self { outer, material, depth, inner: Medium::OUTSIDE, sibling: Medium::OUTSIDE }
    }
}

/// What is on the two sides of a boundary.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Crossing {
    /// Index of refraction before over index behind.
    pub eta: f64,
    /// What a ray that passes travels in.
    pub behind: Medium,
    /// The same solid, or its like, is on both sides: there is nothing to see.
    pub hidden: bool,
}

/// Solids inside of each other that are told apart; a ray that enters more of them, say
/// through open surfaces that it never leaves, forgets the outermost.
const DEEPEST: u32 = 64;

impl Media {
    /// Nothing entered yet.
    #[must_use]
    pub fn new() -> Self {
        Self { nestings: vec![Nesting::new(Medium::OUTSIDE, u32::MAX, 0)] }
    }

    /// Forgets all nestings if there are many; no [`Medium`] but [`Medium::OUTSIDE`] may be used again.
    pub fn forget(&mut self) {
        if self.nestings.len() > 4096 {
            *self = Self::new();
        }
    }

    /// A ray in `medium` at the boundary of a solid of material `index`, whose outer side it met
    /// if `entering`; `also` tells what else begins and ends there.
    ///
    /// Leaving a solid that was never entered, as a camera inside does, counts as having been in it.
    pub fn cross(
        &mut self,
        materials: &[Material],
        medium: Medium,
        index: u32,
        entering: bool,
        also: Option<&Crossed>,
    ) -> Crossing {
        let (left, entered) = also.map_or((&[][..], &[][..]), |also| (&also.left, &also.entered));
        let (mut before, mut behind) = (self.top(medium), medium);
        if !entering {
            match self.leave(behind, index) {
                Some(outer) => behind = outer,
                None => before = Some(index),
            }
        }
        for &material in left {
            behind = self.leave(behind, material).unwrap_or(behind);
        }
        for &material in entered {
            behind = self.enter(behind, material);
        }
        if entering {
            behind = self.enter(behind, index);
        }
        let after = self.top(behind);
        let ior = |top: Option<u32>| top.map_or(1.0, |m| materials[m as usize].ior);
        Crossing { eta: ior(before) / ior(after), behind, hidden: before == after }
    }

    /// Material around a ray in `medium`; nothing outside.
    #[inline]
    #[must_use]
    pub fn top(&self, medium: Medium) -> Option<u32> {
        (medium != Medium::OUTSIDE).then(|| self.nesting(medium).material)
    }

    /// What is left of the weight of a path after `distance` in its medium (Beer-Lambert).
    #[must_use]
    pub fn absorbed(&self, materials: &[Material], path: &Path, distance: f64) -> Vec3 {
        let Some(material) = self.top(path.medium) else { return path.weight };
        let absorption = materials[material as usize].absorption;
        let passes = |a: f32| if a > 0.0 { (-f64::from(a) * distance).exp() as f32 } else { 1.0 };
        path.weight * Vec3::from_array(absorption.to_array().map(passes))
    }

    fn nesting(&self, medium: Medium) -> Nesting {
        self.nestings[medium.0 as usize]
    }

    fn enter(&mut self, outer: Medium, material: u32) -> Medium {
        let around = self.nesting(outer);
        let mut known = around.inner;
        while known != Medium::OUTSIDE {
            let nesting = self.nesting(known);
            if nesting.material == material {
                return known;
            }
            known = nesting.sibling;
        }
        if around.depth == DEEPEST {
            let mut inner = self.solids(outer);
            inner.push(material);
            return inner[1..].iter().fold(Medium::OUTSIDE, |m, &material| self.enter(m, material));
        }
        let medium = Medium(self.nestings.len() as u32);
        let sibling = std::mem::replace(&mut self.nestings[outer.0 as usize].inner, medium);
        self.nestings.push(Nesting { sibling, ..Nesting::new(outer, material, around.depth + 1) });
        medium
    }

    /// `medium` without the last solid of `material`; `None` if there is none.
    fn leave(&mut self, medium: Medium, material: u32) -> Option<Medium> {
        if medium == Medium::OUTSIDE {
            return None;
        }
        let Nesting { outer, material: last, .. } = self.nesting(medium);
        if last == material {
            return Some(outer);
        }
        let rest = self.leave(outer, material)?;
        Some(self.enter(rest, last))
    }

    /// The materials of `medium`, outermost first.
    fn solids(&self, mut medium: Medium) -> Vec<u32> {
        let mut list = Vec::new();
        while medium != Medium::OUTSIDE {
            let Nesting { outer, material, .. } = self.nesting(medium);
            list.push(material);
            medium = outer;
        }
        list.reverse();
        list
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn materials() -> Vec<Material> {
        [1.5, 1.33, 2.0].map(|ior| Material { ior, ..Material::default() }).into()
    }

    #[test]
    fn nested_solids_bend_by_what_is_on_both_sides() {
        let (mut media, materials) = (Media::new(), materials());
        let glass = media.cross(&materials, Medium::OUTSIDE, 0, true, None);
        assert_eq!(glass.eta, 1.0 / 1.5);
        let water = media.cross(&materials, glass.behind, 1, true, None);
        assert_eq!(water.eta, 1.5 / 1.33);
        let back = media.cross(&materials, water.behind, 1, false, None);
        assert_eq!((back.eta, back.behind), (1.33 / 1.5, glass.behind));
        let out = media.cross(&materials, back.behind, 0, false, None);
        assert_eq!((out.eta, out.behind), (1.5, Medium::OUTSIDE));
    }

    #[test]
    fn where_solids_overlap_the_later_one_hides_the_end_of_the_earlier() {
        let (mut media, materials) = (Media::new(), materials());
        let a = media.cross(&materials, Medium::OUTSIDE, 0, true, None);
        let b = media.cross(&materials, a.behind, 1, true, None);
        let a_ends = media.cross(&materials, b.behind, 0, false, None);
        assert_eq!((a_ends.eta, a_ends.hidden), (1.0, true));
        let b_ends = media.cross(&materials, a_ends.behind, 1, false, None);
        assert_eq!((b_ends.eta, b_ends.behind, b_ends.hidden), (1.33, Medium::OUTSIDE, false));
    }

    #[test]
    fn a_camera_inside_has_been_in_it_all_the_time() {
        let (mut media, materials) = (Media::new(), materials());
        let out = media.cross(&materials, Medium::OUTSIDE, 2, false, None);
        assert_eq!((out.eta, out.behind), (2.0, Medium::OUTSIDE));
    }

    #[test]
    fn solids_of_one_material_in_each_other_are_one() {
        let (mut media, materials) = (Media::new(), materials());
        let outer = media.cross(&materials, Medium::OUTSIDE, 0, true, None);
        let inner = media.cross(&materials, outer.behind, 0, true, None);
        assert!(inner.hidden);
        let back = media.cross(&materials, inner.behind, 0, false, None);
        assert_eq!((back.hidden, back.behind), (true, outer.behind));
    }

    #[test]
    fn touching_solids_are_left_and_entered_at_once() {
        let (mut media, materials) = (Media::new(), materials());
        let glass = media.cross(&materials, Medium::OUTSIDE, 0, true, None).behind;
        // Either of the two boundaries may be the one that is reported.
        let enters = Crossed { left: vec![], entered: vec![1] };
        let leaves = Crossed { left: vec![0], entered: vec![] };
        for (index, entering, also) in [(0, false, &enters), (1, true, &leaves)] {
            let contact = media.cross(&materials, glass, index, entering, Some(also));
            assert_eq!((contact.eta, contact.hidden), (1.5 / 1.33, false));
            let out = media.cross(&materials, contact.behind, 1, false, None);
            assert_eq!((out.eta, out.behind), (1.33, Medium::OUTSIDE));
        }
        let its_like = Crossed { left: vec![0], entered: vec![] };
        let contact = media.cross(&materials, glass, 0, true, Some(&its_like));
        assert_eq!((contact.eta, contact.hidden, contact.behind), (1.0, true, glass));
    }

    #[test]
    fn surfaces_that_are_never_left_do_not_pile_up() {
        let (mut media, materials) = (Media::new(), materials());
        let mut medium = Medium::OUTSIDE;
        for i in 0..100_000 {
            medium = media.cross(&materials, medium, i % 2, true, None).behind;
        }
        assert!(media.nestings.len() < 10 * DEEPEST as usize);
        assert_eq!(media.nesting(medium).depth, DEEPEST);
    }
}
