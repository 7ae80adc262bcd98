//! Two answers to one ray: whether they agree, and if not, why.

use super::facts::{self, Facts, Range, Side};
use super::report::Class;
use crate::backend::Backend;
use crate::geom::{Hit, Ray};
use crate::render::SurfacePoint;
use crate::scene::Scene;
use glam::DVec3;

/// Hits in a row, each behind the one before, that may be excused; no ray grazes more edges by chance.
const MOST_IN_A_ROW: usize = 64;

/// Angle between normals that were computed in f64 of the same hit, at most; rad.
const SAME_NORMAL: f64 = 1e-6;

/// A class, and how bad the case is within it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Verdict {
    pub(super) class: Class,
    pub(super) severity: f64,
}

impl Verdict {
    fn new(class: Class, severity: f64) -> Self {
        Self { class, severity: if severity.is_nan() { f64::INFINITY } else { severity } }
    }

    fn real(severity: f64) -> Self {
        Self::new(Class::Real, severity)
    }
}

/// Compares the answers of two backends.
#[derive(Debug)]
pub(super) struct Judge<'a, A, B> {
    pub(super) scene: &'a Scene,
    pub(super) first: &'a A,
    pub(super) second: &'a B,
}

impl<A: Backend, B: Backend> Judge<'_, A, B> {
    /// Of two nearest hits, and the points that a render makes of them.
    pub(super) fn nearest(
        &self,
        ray: &Ray,
        a: Option<Hit>,
        b: Option<Hit>,
        points: [Option<&SurfacePoint>; 2],
    ) -> Option<Verdict> {
        match (a, b) {
            (None, None) => None,
            (Some(a), Some(b)) if ids(&a) == ids(&b) => self.same_primitive(ray, &a, &b, points),
            _ => Some(self.different(ray, a, b)),
        }
    }

    /// The same primitive: `t`, the reported normals, the points that are made of it.
    fn same_primitive(&self, ray: &Ray, a: &Hit, b: &Hit, points: [Option<&SurfacePoint>; 2]) -> Option<Verdict> {
        let unit = |h: &Hit| h.ng.as_dvec3().try_normalize();
        let close = (a.t - b.t).abs() <= 2.0 * f32::EPSILON * a.t.abs().max(b.t.abs());
        let of_shape = self.scene.objects.get(a.geom_id as usize).is_none_or(|object| object.mesh().is_none());
        let off = match (unit(a), unit(b)) {
            // Of shapes it need not be reported.
            _ if of_shape => 0.0,
            (Some(a), Some(b)) => (a - b).length(),
            (None, None) => 0.0,
            _ => f64::INFINITY,
        };
        let made = points[0].zip(points[1]).map_or(0.0, |(a, b)| angle(a.ng, b.ng).max(angle(a.ns, b.ns)));
        if close && off <= 4.0 * f64::from(f32::EPSILON) && made <= SAME_NORMAL {
            return None;
        }
        let facts = self.facts(ray, a);
        if let Some(verdict) = t_of_same(&facts, a, b) {
            return Some(verdict);
        }
        let slack = 2.0 * facts.normal_slack;
        if off > slack {
            return Some(Verdict::new(Class::Normal, off / slack));
        }
        if made > SAME_NORMAL && facts.side != Side::InLine {
            return Some(Verdict::new(Class::Normal, made / SAME_NORMAL));
        }
        None
    }

    /// One of them misses what the other reports. What is nearer must be excused: then the next hit of the one
    /// that reported it takes its place.
    fn different(&self, ray: &Ray, a: Option<Hit>, b: Option<Hit>) -> Verdict {
        // What is true is asked of the whole ray; `rest` begins behind what was excused.
        let (mut rest, mut a, mut b) = (*ray, a, b);
        let mut excuse: Option<Verdict> = None;
        for _ in 0..MOST_IN_A_ROW {
            let of = |hit: Option<Hit>| hit.map(|hit| (hit, self.facts(ray, &hit)));
            let (of_a, of_b) = (of(a), of(b));
            for (hit, facts) in [of_a, of_b].into_iter().flatten() {
                if let Some(lie) = lie(&hit, &facts) {
                    return lie;
                }
            }
            let excused = |or: Verdict| excuse.map_or(or, |e| worse(e, or));
            let first_is_nearer = match (&of_a, &of_b) {
                (None, None) => return excuse.unwrap_or(Verdict::real(0.0)),
                (Some(_), None) => true,
                (None, Some(_)) => false,
                (Some((a, facts)), Some((b, _))) if ids(a) == ids(b) => {
                    let t = t_of_same(facts, a, b);
                    return t.map_or_else(|| excuse.unwrap_or(Verdict::real(0.0)), excused);
                }
                (Some((a, of_a)), Some((b, of_b))) if range(a, of_a).overlaps(range(b, of_b)) => {
                    let ulp = f64::from(f32::EPSILON * a.t.abs().max(b.t.abs()));
                    let bands = range(a, of_a).length() + range(b, of_b).length() + ulp;
                    return excused(Verdict::new(Class::Tie, f64::from((a.t - b.t).abs()) / bands));
                }
                (Some((a, _)), Some((b, _))) => a.t < b.t,
            };
            let Some((hit, facts)) = (if first_is_nearer { of_a } else { of_b }) else { break };
            let Some(this) = excuse_for(&facts) else { return Verdict::real(facts.margin) };
            excuse = Some(excuse.map_or(this, |e| worse(e, this)));
            rest.t_near = behind(&rest, &hit);
            if first_is_nearer {
                a = self.first.intersect(&rest);
            } else {
                b = self.second.intersect(&rest);
            }
        }
        Verdict::real(0.0)
    }

    /// Of two answers to whether anything is in the way.
    pub(super) fn any(&self, ray: &Ray, a: bool, b: bool) -> Option<Verdict> {
        if a == b {
            return None;
        }
        let (near_a, near_b) = (self.first.intersect(ray), self.second.intersect(ray));
        // Who found nothing in the way must have an excuse for all that is there, by the word of either.
        let (own, other) = if a { (near_a, near_b) } else { (near_b, near_a) };
        Some(match own.or(other) {
            Some(_) => self.excuse_all(ray, a == own.is_some()),
            None => self.beside(ray),
        })
    }

    /// Whether every hit of the first backend (or the second) is one that may be missed.
    fn excuse_all(&self, ray: &Ray, of_first: bool) -> Verdict {
        let (mut rest, mut excuse) = (*ray, None::<Verdict>);
        for _ in 0..MOST_IN_A_ROW {
            let next = if of_first { self.first.intersect(&rest) } else { self.second.intersect(&rest) };
            let Some(hit) = next else { return excuse.unwrap_or(Verdict::real(0.0)) };
            let facts = self.facts(ray, &hit);
            let Some(this) = excuse_for(&facts) else { return Verdict::real(facts.margin) };
            excuse = Some(excuse.map_or(this, |e| worse(e, this)));
            rest.t_near = behind(&rest, &hit);
        }
        Verdict::real(0.0)
    }

    /// Something is in the way by one answer, but no nearest hit says what: rays beside this one may.
    fn beside(&self, ray: &Ray) -> Verdict {
        let d = ray.d.as_dvec3();
        let Some(along) = d.try_normalize() else { return Verdict::real(0.0) };
        // Turned, not moved: what the ray leaves must not come in between.
        for turned in facts::beside(d, along, facts::slack_at(d.length())) {
            let moved = Ray { d: turned.as_vec3(), ..*ray };
            let hits = [self.first.intersect(&moved), self.second.intersect(&moved)];
            for facts in hits.into_iter().flatten().map(|hit| self.facts(ray, &hit)) {
                if let Some(excuse) = excuse_for(&facts) {
                    return excuse;
                }
            }
        }
        Verdict::real(0.0)
    }

    fn facts(&self, ray: &Ray, hit: &Hit) -> Facts {
        facts::of(self.scene, ray, hit.geom_id, hit.prim_id)
    }
}

fn ids(hit: &Hit) -> (u32, u32) {
    (hit.geom_id, hit.prim_id)
}

/// Angle between unit vectors, if it is small.
fn angle(a: DVec3, b: DVec3) -> f64 {
    (a - b).length()
}

/// Why a hit may be missed, if it may.
fn excuse_for(facts: &Facts) -> Option<Verdict> {
    match facts.side {
        Side::In | Side::Out => None,
        Side::Boundary => Some(Verdict::new(Class::Edge, facts.margin)),
        Side::InLine => Some(Verdict::new(Class::Grazing, facts.margin)),
    }
}

/// What excuses a hit at `t`s that the primitive does not allow: nothing.
fn lie(hit: &Hit, facts: &Facts) -> Option<Verdict> {
    match facts.side {
        Side::Out => Some(Verdict::real(facts.margin)),
        _ if !facts.allows(hit.t) => Some(Verdict::new(Class::T, beyond(facts, hit.t))),
        _ => None,
    }
}

/// Where a reported hit may be. If that is anywhere, the report is all there is.
fn range(hit: &Hit, facts: &Facts) -> Range {
    if facts.side == Side::InLine && facts.t.is_anywhere() { Range::around(f64::from(hit.t), 0.0) } else { facts.t }
}

/// How many times its band a `t` is off the middle of it.
fn beyond(facts: &Facts, t: f32) -> f64 {
    let half = 0.5 * facts.t.length();
    (f64::from(t) - (facts.t.lo + half)).abs() / half.max(f64::MIN_POSITIVE)
}

/// The same primitive, reported by both; nothing if each `t` may be.
fn t_of_same(facts: &Facts, a: &Hit, b: &Hit) -> Option<Verdict> {
    [a, b].into_iter().find_map(|hit| lie(hit, facts))
}

/// Where to go on behind a hit. A backend that rounds may report it before the start of the ray, and once more.
fn behind(ray: &Ray, hit: &Hit) -> f32 {
    hit.t.max(ray.t_near).next_up()
}

/// The one that says more.
fn worse(a: Verdict, b: Verdict) -> Verdict {
    let key = |v: &Verdict| (!v.class.is_explained(), v.severity);
    if key(&b) > key(&a) { b } else { a }
}
