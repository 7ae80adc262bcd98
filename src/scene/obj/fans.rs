//! Polygons as the fans that they are read as, and the fans that will not do.

use super::polygon;
use glam::Vec3;

/// A bit per triangle: it continues the polygon of the one before. Empty if none does.
#[derive(Debug, Default)]
pub(in crate::scene) struct Continues(Vec<u64>);

impl Continues {
    /// Whether triangle `t` does.
    pub(in crate::scene) fn at(&self, t: usize) -> bool {
        self.0.get(t / 64).is_some_and(|bits| bits >> (t % 64) & 1 == 1)
    }

    /// Says so of triangle `t` of `triangles`.
    #[inline]
    pub(in crate::scene) fn set(&mut self, t: usize, triangles: usize) {
        if self.0.is_empty() {
            self.0 = vec![0; triangles.div_ceil(64)];
        }
        self.0[t / 64] |= 1 << (t % 64);
    }

    /// Whether there are triangles only.
    pub(in crate::scene) fn is_empty(&self) -> bool {
        self.0.is_empty()
    }
}

/// Splits the polygons anew that a fan does not cover, in `faces` and what else has an entry per triangle (or
/// none at all). Returns how many those are.
pub(in crate::scene) fn split(
    points: &[f32],
    faces: &mut [[u32; 3]],
    mut others: [&mut [[u32; 3]]; 2],
    continues: &Continues,
) -> u64 {
    if continues.is_empty() {
        return 0;
    }
    let (mut clipped, mut corners) = (0, Vec::new());
    let mut first = 0;
    while first < faces.len() {
        let more = (first + 1..faces.len()).take_while(|&t| continues.at(t)).count();
        let polygon = first..first + more + 1;
        first = polygon.end;
        if more == 0 {
            continue;
        }
        corners.clear();
        let fan = &faces[polygon.clone()];
        corners.extend(fan_corners(fan).map(|i| Vec3::from_slice(&points[3 * i as usize..])));
        if let Some(triangles) = polygon::split(&corners) {
            clipped += 1;
            for all in std::iter::once(&mut *faces).chain(others.iter_mut().map(|o| &mut **o)) {
                if let Some(fan) = all.get_mut(polygon.clone()) {
                    rewrite(fan, &triangles);
                }
            }
        }
    }
    clipped
}

/// The corners of the polygon that a fan was made of.
pub(super) fn fan_corners(fan: &[[u32; 3]]) -> impl Iterator<Item = u32> {
    fan[0][..2].iter().copied().chain(fan.iter().map(|t| t[2]))
}

/// Replaces a fan by `triangles` over its corners.
pub(super) fn rewrite(fan: &mut [[u32; 3]], triangles: &[[u32; 3]]) {
    let corners: Vec<u32> = fan_corners(fan).collect();
    for (slot, t) in fan.iter_mut().zip(triangles) {
        *slot = t.map(|k| corners[k as usize]);
    }
}
