//! The rays of a packet in f64, as shapes test sixteen at a time.

use super::packet::bits;
use super::ray::Line;
use super::traverse::Walk;
use super::world::Shape;
use crate::geom::{LANES, Lanes, ShapeSet};
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

    /// Tests a shape with the rays of `lanes`; bits of those for which it is the best hit now.
    pub(super) fn test(&mut self, shape: &Shape<'_>, lanes: u32, walks: &mut [Option<Walk>]) -> u32 {
        self.t_far = [f64::NEG_INFINITY; LANES];
        for lane in bits(lanes) {
            self.t_far[lane] = walks[lane].as_ref().map_or(f64::NEG_INFINITY, |walk| walk.line.t_far);
        }
        let rays = Lanes { o: self.o.each_ref(), d: self.d.each_ref(), t_near: &self.t_near, t_far: &self.t_far };
        let Some(t) = with_shapes!(shape.set, set => set.hit_lanes(shape.prim, &rays)) else { return 0 };
        let mut met = 0;
        for lane in bits(lanes).filter(|&lane| t[lane] < f64::INFINITY) {
            met |= u32::from(walks[lane].as_mut().is_some_and(|walk| walk.offer(shape.hit(t[lane])))) << lane;
        }
        met
    }
}
