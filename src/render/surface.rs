//! One surface point by itself, as branches and auxiliary images ask for it.

use super::block::Block;
use crate::geom::offset_origin;
use glam::{DVec3, Vec3};

/// A lane of a [`Block`].
#[derive(Clone, Copy, Debug)]
pub struct SurfacePoint {
    /// The point, scene space.
    pub p: DVec3,
    /// Unit geometric normal, turned to the side the ray came from.
    pub ng: DVec3,
    /// Unit shading normal on the same side.
    pub ns: DVec3,
    /// Unit vector back along the ray.
    pub to_eye: Vec3,
    /// Size of the primitive, for offsets.
    pub extent: f64,
    /// Diffuse colour, linear RGB.
    pub albedo: Vec3,
    /// Object and primitive.
    pub id: [u32; 2],
    /// Index of the material.
    pub material: usize,
    /// Whether the ray met the side that the surface calls outer.
    pub entering: bool,
}

impl SurfacePoint {
    /// Takes one out of a block.
    #[inline]
    #[must_use]
    pub fn of_lane(block: &Block, lane: usize) -> Self {
        Self {
            p: Block::dvec3(&block.p, lane),
            ng: Block::dvec3(&block.ng, lane),
            ns: Block::dvec3(&block.ns, lane),
            to_eye: Block::vec3(&block.to_eye, lane),
            extent: block.extent[lane],
            albedo: Block::vec3(&block.diffuse, lane),
            id: block.id[lane],
            material: block.material[lane] as usize,
            entering: block.entering[lane],
        }
    }

    /// Points just before the surface and just behind it, as far off as rays start.
    #[must_use]
    pub fn both_sides(&self) -> (DVec3, DVec3) {
        [self.ng, -self.ng].map(|n| offset_origin(self.p, n, self.extent).as_dvec3()).into()
    }

    /// Where a ray starts that leaves along `w` on its side of the facet.
    #[inline]
    #[must_use]
    pub fn origin_towards(&self, w: DVec3) -> Vec3 {
        let side = if w.dot(self.ng) >= 0.0 { self.ng } else { -self.ng };
        offset_origin(self.p, side, self.extent)
    }
}
