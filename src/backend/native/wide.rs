//! The rays of a packet in f64, as shapes test sixteen at a time.

use super::packet::bits;
use super::ray::Line;
use super::traverse::Walk;
use crate::geom::{LANES, Lanes, ShapeSet};
use crate::scene::AnyShapes;
use crate::with_shapes;

type F64 = [f64; LANES];

/// Sixteen rays. Lanes without one hold numbers all the same.
#[repr(align(64))]
pub(super) struct Wide {
    o: [F64; 3],
    d: [F64; 3],
    t_near: F64,
    t_far: F64,
}

impl Default for Wide {
    fn default() -> Self {
        let none = [0.0; LANES];
        Self { o: [none; 3], d: [[1.0; LANES], none, none], t_near: none, t_far: [f64::NEG_INFINITY; LANES] }
    }
}

impl Wide {
    /// Takes over all rays.
    pub(super) fn fill(&mut self, walks: &[Option<Walk>]) {
        for (lane, walk) in walks.iter().enumerate() {
            let Some(walk) = walk else { continue };
            let Line { o, d, t_near, .. } = walk.line;
            for axis in 0..3 {
                self.o[axis][lane] = o[axis];
                self.d[axis][lane] = d[axis];
            }
            self.t_near[lane] = t_near;
        }
    }

    /// Where the rays of `lanes` meet a shape inside their intervals; infinity where they do not,
    /// `None` when all do not.
    pub(super) fn hit(&mut self, set: &AnyShapes, prim: u32, lanes: u32, walks: &[Option<Walk>]) -> Option<F64> {
        self.t_far = [f64::NEG_INFINITY; LANES];
        for lane in bits(lanes) {
            self.t_far[lane] = walks[lane].as_ref().map_or(f64::NEG_INFINITY, |walk| walk.line.t_far);
        }
        let rays = Lanes { o: self.o.each_ref(), d: self.d.each_ref(), t_near: &self.t_near, t_far: &self.t_far };
        with_shapes!(set, set => set.hit_lanes(prim, &rays))
    }
}
