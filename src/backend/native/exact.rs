//! Rays in f64 through the hierarchy of the scene: boxes and the filter see them rounded, as in
//! the space of a placed mesh, and every decision is about the ray as it is.

use super::bvh::{Bvh, Child};
use super::ray::Line;
use super::traverse::{SMALL_STACK, STACK, Space, Waiting, Walk};
use super::world::World;
use crate::geom::{Hit64, Ray64};

/// The scene for rays whose origins are rounded.
struct Exact<'a>(&'a World);

impl Space for Exact<'_> {
    const PLACED: bool = true;

    #[inline]
    fn bvh(&self) -> &Bvh {
        self.0.bvh()
    }

    fn apart<const ANY: bool>(&self, walk: &mut Walk, index: usize, stack: &mut [Waiting]) -> bool {
        self.0.apart::<ANY>(walk, index, stack)
    }
}

impl World {
    /// The nearest hit of `ray` inside its open interval; the lowest ids among equal `t`.
    pub(super) fn nearest_exact(&self, ray: &Ray64) -> Option<Hit64> {
        const NONE: Waiting = (0.0, Child::NONE);
        let Ray64 { o, d, t_near, t_far } = *ray;
        let mut walk = Walk::placed(&Line { o, d, t_near, t_far })?;
        match self.stack_len {
            0 => return None,
            1..=SMALL_STACK => walk.descend::<false, _>(&Exact(self), Child::ROOT, &mut [NONE; SMALL_STACK]),
            _ => walk.descend::<false, _>(&Exact(self), Child::ROOT, &mut [NONE; 2 * STACK]),
        };
        walk.best().map(|best| self.hit_exact(best))
    }
}
