//! Splits polygons with more than three corners: convex ones stay the fan that they were
//! read as, all others are cut by ear clipping.

use glam::{DVec2, DVec3, Vec3};

/// Triangles over the corners of a polygon, `corners.len() - 2` of them, or nothing if the
/// fan around the first corner will do: the polygon is convex and no triangle of the fan
/// is without area, or it has no area at all and no splitting is better than another.
///
/// The polygon is looked at along the axis its normal is nearest to, which changes neither
/// convexity nor containment for a plane one. Work grows with the corners times the
/// reflex corners abreast of an ear.
pub(super) fn split(corners: &[Vec3]) -> Option<Vec<[u32; 3]>> {
    let flat = flatten(corners)?;
    if fan_will_do(&flat) { None } else { Some(Clipper::new(&flat).run()) }
}

/// Corners in the plane, counter-clockwise; nothing for a polygon without area. Dropping
/// an axis rounds nothing.
fn flatten(corners: &[Vec3]) -> Option<Vec<DVec2>> {
    let base = corners[0].as_dvec3();
    let at = |i: usize| corners[i].as_dvec3() - base;
    let normal = (1..corners.len() - 1).fold(DVec3::ZERO, |n, i| n + at(i).cross(at(i + 1)));
    let size = normal.abs();
    let axis = size.max_position();
    if size[axis] == 0.0 || !size[axis].is_finite() {
        return None;
    }
    let (mut x, mut y) = ((axis + 1) % 3, (axis + 2) % 3);
    if normal[axis] < 0.0 {
        std::mem::swap(&mut x, &mut y);
    }
    Some(corners.iter().map(|p| p.as_dvec3()).map(|p| DVec2::new(p[x], p[y])).collect())
}

/// Twice the signed area of a triangle, positive if counter-clockwise.
#[inline]
fn area(a: DVec2, b: DVec2, c: DVec2) -> f64 {
    (b - a).perp_dot(c - a)
}

/// Whether every corner turns left, once around in all, and every triangle of the fan has
/// area. A corner on a straight edge makes a fan triangle without area if it is next to
/// the first one; elsewhere it does no harm.
fn fan_will_do(p: &[DVec2]) -> bool {
    let n = p.len();
    let turns_left = (0..n).all(|i| area(p[i], p[(i + 1) % n], p[(i + 2) % n]) >= 0.0);
    turns_left && (1..n - 1).all(|i| area(p[0], p[i], p[i + 1]) > 0.0)
}

/// Ear clipping (Meisters 1975) on a ring of corners. Only reflex corners can lie in an
/// ear; they are kept in order of x, so that few are looked at.
struct Clipper<'a> {
    p: &'a [DVec2],
    next: Vec<u32>,
    previous: Vec<u32>,
    /// Corners that may be reflex, by x.
    reflex: Vec<u32>,
    /// Whether a corner of `reflex` still is.
    is_reflex: Vec<bool>,
    /// How many of `reflex` no longer are.
    stale: usize,
}

impl<'a> Clipper<'a> {
    fn new(p: &'a [DVec2]) -> Self {
        let n = p.len() as u32;
        let next: Vec<u32> = (0..n).map(|i| (i + 1) % n).collect();
        let previous: Vec<u32> = (0..n).map(|i| (i + n - 1) % n).collect();
        let mut ring = Self { p, next, previous, reflex: Vec::new(), is_reflex: Vec::new(), stale: 0 };
        ring.is_reflex = (0..n).map(|i| ring.area_at(i) <= 0.0).collect();
        ring.reflex = (0..n).filter(|&i| ring.is_reflex[i as usize]).collect();
        ring.reflex.sort_by(|&a, &b| p[a as usize].x.total_cmp(&p[b as usize].x));
        ring
    }

    fn run(mut self) -> Vec<[u32; 3]> {
        let mut left = self.p.len();
        let mut out = Vec::with_capacity(left - 2);
        // An ear is looked for at `at`; `tried` corners in a row were none.
        let (mut at, mut tried) = (0, 0);
        while left > 3 {
            if tried < left && !self.is_ear(at) {
                at = self.next[at as usize];
                tried += 1;
                continue;
            }
            if tried == left {
                at = self.least_bad(at, left);
            }
            let (before, after) = (self.previous[at as usize], self.next[at as usize]);
            out.push([before, at, after]);
            self.remove(at);
            left -= 1;
            tried = 0;
            // Not the neighbour: that would make a fan of slivers.
            at = self.next[after as usize];
        }
        out.push([self.previous[at as usize], at, self.next[at as usize]]);
        out
    }

    fn area_at(&self, i: u32) -> f64 {
        let (a, c) = (self.previous[i as usize], self.next[i as usize]);
        area(self.p[a as usize], self.p[i as usize], self.p[c as usize])
    }

    /// Whether the triangle at `i` has area, and no other corner inside or on its rim.
    /// Corners that coincide with one of its own are no obstacle: that is how a hole is
    /// joined to the outline.
    fn is_ear(&self, i: u32) -> bool {
        if self.is_reflex[i as usize] {
            return false;
        }
        let t = [self.previous[i as usize], i, self.next[i as usize]].map(|k| self.p[k as usize]);
        if area(t[0], t[1], t[2]) <= 0.0 {
            return false;
        }
        let (lo, hi) = (t[0].min(t[1]).min(t[2]), t[0].max(t[1]).max(t[2]));
        let first = self.reflex.partition_point(|&k| self.p[k as usize].x < lo.x);
        for &k in &self.reflex[first..] {
            let q = self.p[k as usize];
            if q.x > hi.x {
                break;
            }
            let abreast = self.is_reflex[k as usize] && q.y >= lo.y && q.y <= hi.y && !t.contains(&q);
            if abreast && (0..3).all(|e| area(t[e], t[(e + 1) % 3], q) >= 0.0) {
                return false;
            }
        }
        true
    }

    /// The corner to cut where there is no ear, which happens only in polygons that cross
    /// themselves: one that turns left, or any.
    fn least_bad(&self, from: u32, left: usize) -> u32 {
        let mut i = from;
        for _ in 0..left {
            if self.area_at(i) > 0.0 {
                return i;
            }
            i = self.next[i as usize];
        }
        from
    }

    fn remove(&mut self, i: u32) {
        let (a, c) = (self.previous[i as usize], self.next[i as usize]);
        self.next[a as usize] = c;
        self.previous[c as usize] = a;
        self.no_longer_reflex(i);
        for k in [a, c] {
            if self.area_at(k) > 0.0 {
                self.no_longer_reflex(k);
            }
        }
        if self.stale > 16 && 2 * self.stale > self.reflex.len() {
            self.reflex.retain(|&k| self.is_reflex[k as usize]);
            self.stale = 0;
        }
    }

    fn no_longer_reflex(&mut self, i: u32) {
        self.stale += usize::from(std::mem::take(&mut self.is_reflex[i as usize]));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn polygon(p: &[[f32; 2]]) -> Vec<Vec3> {
        p.iter().map(|&[x, y]| Vec3::new(x, y, 0.5)).collect()
    }

    fn area_of(corners: &[Vec3], t: [u32; 3]) -> f64 {
        let [a, b, c] = t.map(|i| corners[i as usize].as_dvec3());
        (b - a).cross(c - a).z
    }

    /// All triangles wind like the polygon, and their areas add up to its own.
    fn check(corners: &[Vec3]) {
        let fan: Vec<[u32; 3]> = (1..corners.len() as u32 - 1).map(|i| [0, i, i + 1]).collect();
        let whole: f64 = fan.iter().map(|&t| area_of(corners, t)).sum();
        let split = split(corners).unwrap_or(fan);
        assert_eq!(split.len(), corners.len() - 2);
        for &t in &split {
            assert!(area_of(corners, t) * whole.signum() > 0.0, "{t:?} of {corners:?}");
        }
        let sum: f64 = split.iter().map(|&t| area_of(corners, t)).sum();
        assert!((sum - whole).abs() <= 1e-9 * whole.abs(), "{sum} for {whole}");
    }

    #[test]
    fn convex_polygons_stay_fans() {
        assert_eq!(split(&polygon(&[[0., 0.], [1., 0.], [1., 1.], [0., 1.]])), None);
        assert_eq!(split(&polygon(&[[0., 1.], [1., 1.], [1., 0.], [0., 0.]])), None);
        let round: Vec<_> = (0..100).map(|i| (i as f32 * 0.062_83).sin_cos()).map(|(y, x)| [x, y]).collect();
        assert_eq!(split(&polygon(&round)), None);
    }

    #[test]
    fn concave_polygons_are_covered_once() {
        let arrow = [[0., 0.], [2., -1.], [0.5, 0.], [2., 1.]];
        for turn in 0..4 {
            let mut p = arrow;
            p.rotate_left(turn);
            check(&polygon(&p));
            p.reverse();
            check(&polygon(&p));
        }
        let comb: Vec<[f32; 2]> =
            (0..41).map(|i| [i as f32, if i % 2 == 0 { 0. } else { 9. }]).chain([[40., 10.], [0., 10.]]).collect();
        check(&polygon(&comb));
    }

    #[test]
    fn corners_on_straight_edges_make_no_empty_triangles() {
        check(&polygon(&[[0., 0.], [1., 0.], [2., 0.], [2., 1.], [2., 2.], [1., 2.], [0., 2.], [0., 1.]]));
        check(&polygon(&[[0., 0.], [1., 0.], [2., 0.], [1., 3.]]));
    }

    #[test]
    fn a_hole_joined_by_a_double_edge() {
        let frame =
            [[0., 0.], [6., 0.], [6., 6.], [0., 6.], [0., 0.], [2., 2.], [2., 4.], [4., 4.], [4., 2.], [2., 2.]];
        check(&polygon(&frame));
    }

    #[test]
    fn nonsense_gives_the_right_number_of_triangles() {
        let pentagram: Vec<_> = (0..5).map(|i| (i as f32 * 2.513_274).sin_cos()).map(|(y, x)| [x, y]).collect();
        let star = polygon(&pentagram);
        assert_eq!(split(&star).map_or(3, |t| t.len()), 3);
        assert_eq!(split(&[Vec3::ONE; 7]), None);
        assert_eq!(split(&[Vec3::NAN; 4]), None);
        let bow = polygon(&[[0., 0.], [2., 0.], [0., 1.], [3., 1.]]);
        assert_eq!(split(&bow).map_or(2, |t| t.len()), 2);
    }

    #[test]
    fn a_hundred_thousand_corners() {
        let corners: Vec<_> = (0..100_000u32)
            .map(|i| {
                let (angle, radius) = (f64::from(i) * std::f64::consts::TAU / 1e5, [1.0, 0.7, 0.9][i as usize % 3]);
                [(angle.cos() * radius) as f32, (angle.sin() * radius) as f32]
            })
            .collect();
        let start = std::time::Instant::now();
        check(&polygon(&corners));
        assert!(start.elapsed().as_secs() < 60, "took {:?}", start.elapsed());
    }

    proptest! {
        #[test]
        fn stars_are_covered_once(radii in proptest::collection::vec(0.1f64..1.0, 4..60), turned in 0.0f64..6.0, flip: bool) {
            let step = std::f64::consts::TAU / radii.len() as f64;
            let mut p: Vec<_> = radii.iter().enumerate().map(|(i, r)| {
                let a = turned + step * i as f64;
                [(r * a.cos()) as f32, (r * a.sin()) as f32]
            }).collect();
            if flip { p.reverse(); }
            check(&polygon(&p));
        }

        #[test]
        fn any_corners_give_the_right_number(p in proptest::collection::vec([-4i8..5, -4i8..5], 4..30)) {
            let p: Vec<_> = p.iter().map(|q| q.map(f32::from)).collect();
            prop_assert_eq!(split(&polygon(&p)).map_or(p.len() - 2, |t| t.len()), p.len() - 2);
        }
    }
}
