//! Points on their way into a mesh: put into its frame in f64, and rounded once.

use super::super::Error;
use crate::math::Frame;
use glam::DVec3;
use rayon::prelude::*;

/// Sizes that a stored mesh may have, as multiples of what the sample of its vertices led
/// to expect; beyond them the frame is made anew.
const FITTING: std::ops::RangeInclusive<f64> = 1.0 / 65_536.0..=4_294_967_296.0;

/// Whether a mesh of which the sample expects a size of about 1 may have this one.
pub(super) fn fits(reach: f64) -> bool {
    FITTING.contains(&reach)
}

/// Writes points, or what rounding takes from them.
pub(in crate::scene) struct PointWriter<'a> {
    origin: DVec3,
    local_per_world: f64,
    slots: std::slice::ChunksExactMut<'a, f32>,
    /// Whether what is rounded off is written instead.
    rests: bool,
    reach: f64,
}

impl<'a> PointWriter<'a> {
    /// Writes points in `frame` to `slots`, three numbers each.
    pub(in crate::scene) fn new(frame: &Frame, slots: &'a mut [f32]) -> Self {
        let slots = slots.chunks_exact_mut(3);
        Self { origin: frame.origin, local_per_world: frame.local_per_world(), slots, rests: false, reach: 0.0 }
    }

    /// Writes what rounding takes from them.
    pub(in crate::scene) fn of_rests(frame: &Frame, slots: &'a mut [f32]) -> Self {
        Self { rests: true, ..Self::new(frame, slots) }
    }

    /// Writes the next point; nothing if all places are taken.
    #[inline]
    pub(in crate::scene) fn put(&mut self, world: DVec3) -> Option<()> {
        let local = (world - self.origin) * self.local_per_world;
        self.reach = self.reach.max(local.abs().max_element());
        let rounded = local.as_vec3();
        let written = if self.rests { (local - rounded.as_dvec3()).as_vec3() } else { rounded };
        self.slots.next()?.copy_from_slice(&written.to_array());
        Some(())
    }

    /// The largest coordinate of all, before it was rounded; nothing if there are places left.
    pub(in crate::scene) fn finish(self) -> Option<f64> {
        (self.slots.len() == 0).then_some(self.reach)
    }
}

/// Makes sure that the frame, which a sample of the vertices led to, suits all that faces use, and has the points
/// written anew in another one if not. `reach` is the largest coordinate so far; `write` writes all points in a
/// frame and returns the largest. Returns the frame they are in.
pub(in crate::scene) fn settle_frame(
    points: &mut [f32],
    faces: &[[u32; 3]],
    mut frame: Frame,
    mut reach: f64,
    mut write: impl FnMut(&Frame, &mut [f32]) -> Result<f64, Error>,
) -> Result<Frame, Error> {
    if fits(reach) {
        return Ok(frame);
    }
    // Once for what the sample missed; more often only where a vertex that no face uses is
    // so far away that what faces use can only be approached in steps.
    loop {
        let used = used_reach(points, faces).min(f64::from(f32::MAX));
        let better = frame.rescaled(used);
        if fits(used) || better == frame {
            break;
        }
        frame = better;
        reach = write(&frame, points)?;
    }
    if reach > f64::from(f32::MAX) {
        // Only vertices that no face uses can be so far away.
        points.par_iter_mut().for_each(|x| *x = x.clamp(-f32::MAX, f32::MAX));
    }
    Ok(frame)
}

/// Largest coordinate of the vertices that faces use.
fn used_reach(points: &[f32], faces: &[[u32; 3]]) -> f64 {
    let reach = |i: u32| points[3 * i as usize..][..3].iter().fold(0.0, |m: f32, x| m.max(x.abs()));
    let largest = faces.par_iter().map(|f| f.iter().fold(0.0, |m: f32, &i| m.max(reach(i)))).reduce(|| 0.0, f32::max);
    f64::from(largest)
}
