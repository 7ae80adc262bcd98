//! What came of it.

use crate::geom::{Hit, Ray};
use crate::math::Frame;
use std::fmt;

/// A kind of rays.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Group {
    /// One ray a pixel, each by itself.
    Camera,
    /// The same in coherent packets of sixteen.
    CameraPackets,
    /// From what they hit to every light that it faces: whether anything is in the way.
    Shadow,
    /// Mirrored there.
    Mirrored,
    /// Refracted there, with an index of 1.5.
    Refracted,
    /// Into the half space there, as the cosine has it.
    Diffuse,
    /// At corners: of triangles, of the boxes of shapes.
    Vertices,
    /// At points of edges, likewise.
    Edges,
    /// Past edges between a facet that faces the ray's start and one that does not; past the outlines of shapes.
    Silhouettes,
    /// At points inside of triangles and shapes.
    Interiors,
    /// Through two random points around the scene.
    Chords,
}

impl Group {
    /// All of them, in the order of a report.
    pub const ALL: [Self; 11] = [
        Self::Camera,
        Self::CameraPackets,
        Self::Shadow,
        Self::Mirrored,
        Self::Refracted,
        Self::Diffuse,
        Self::Vertices,
        Self::Edges,
        Self::Silhouettes,
        Self::Interiors,
        Self::Chords,
    ];

    /// What to call it.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Camera => "camera",
            Self::CameraPackets => "camera, packets",
            Self::Shadow => "shadow",
            Self::Mirrored => "mirrored",
            Self::Refracted => "refracted",
            Self::Diffuse => "diffuse",
            Self::Vertices => "at vertices",
            Self::Edges => "at edges",
            Self::Silhouettes => "silhouettes",
            Self::Interiors => "at interiors",
            Self::Chords => "chords",
        }
    }
}

/// What a disagreement is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Class {
    /// The ray passes the boundary of what only one of them reports closer than f32 can tell.
    Edge,
    /// Both hits lie where the other may lie too: coincident or adjacent surfaces.
    Tie,
    /// The ray lies in the plane of what only one of them reports, as far as f32 can tell.
    Grazing,
    /// The same primitive at another `t` than rounding explains.
    T,
    /// The same primitive with another normal than rounding explains.
    Normal,
    /// Nothing of the above: one of them is wrong.
    Real,
}

impl Class {
    /// All of them, in the order of a report.
    pub const ALL: [Self; 6] = [Self::Edge, Self::Tie, Self::Grazing, Self::T, Self::Normal, Self::Real];

    /// What to call it.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Edge => "edge",
            Self::Tie => "tie",
            Self::Grazing => "grazing",
            Self::T => "t",
            Self::Normal => "normal",
            Self::Real => "real",
        }
    }

    /// Whether rounding explains it.
    #[must_use]
    pub fn is_explained(self) -> bool {
        matches!(self, Self::Edge | Self::Tie | Self::Grazing)
    }
}

/// A group's counts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Tally {
    /// Rays sent.
    pub rays: u64,
    /// Those that hit something, by the second backend.
    pub hits: u64,
    /// Disagreements by class, in the order of [`Class::ALL`].
    pub classes: [u64; 6],
}

impl Tally {
    /// Rays on which both agree.
    #[must_use]
    pub fn agreeing(&self) -> u64 {
        self.rays - self.classes.iter().sum::<u64>()
    }

    /// How many are of `class`.
    #[must_use]
    pub fn of(&self, class: Class) -> u64 {
        self.classes[class as usize]
    }

    pub(super) fn add(&mut self, other: &Self) {
        self.rays += other.rays;
        self.hits += other.hits;
        self.classes.iter_mut().zip(other.classes).for_each(|(a, b)| *a += b);
    }
}

/// What one backend says about a ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Answer {
    /// Nothing is hit, or in the way.
    Nothing,
    /// Something is in the way.
    Occluded,
    /// The nearest hit.
    Hit(Hit),
}

impl fmt::Display for Answer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Nothing => f.write_str("nothing"),
            Self::Occluded => f.write_str("something in the way"),
            Self::Hit(h) => write!(f, "object {}, primitive {} at t = {}", h.geom_id, h.prim_id, h.t),
        }
    }
}

/// A disagreement.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Case {
    /// Its kind of ray.
    pub group: Group,
    /// What it is.
    pub class: Class,
    /// The ray, scene space.
    pub ray: Ray,
    /// What the two backends say.
    pub answers: [Answer; 2],
    /// How bad it is: within its class, larger is worse.
    pub severity: f64,
    /// Number in its group.
    pub index: u64,
}

impl Case {
    /// The line that asks `tison probe` the same: world coordinates, 17 digits. Nothing is said of an end that
    /// is infinite.
    #[must_use]
    pub fn probe_line(&self, frame: &Frame) -> String {
        let o = frame.to_world(self.ray.o.as_dvec3());
        let d = self.ray.d.as_dvec3() * frame.world_per_local();
        let vector = |v: glam::DVec3| format!("[{:?},{:?},{:?}]", v.x, v.y, v.z);
        let t_near = f64::from(self.ray.t_near);
        let end = if self.ray.t_far.is_finite() {
            format!(",\"tmax\":{:?}", f64::from(self.ray.t_far))
        } else {
            String::new()
        };
        format!("{{\"o\":{},\"d\":{},\"tmin\":{t_near:?}{end}}}", vector(o), vector(d))
    }

    /// Worst first, and never equal but to itself.
    fn order(&self, other: &Self) -> std::cmp::Ordering {
        let key = |c: &Self| (c.group, c.index);
        other.severity.total_cmp(&self.severity).then(key(self).cmp(&key(other)))
    }
}

/// All groups, and the worst of each class.
#[derive(Clone, Debug, Default)]
pub struct Report {
    /// In the order of [`Group::ALL`].
    pub groups: [Tally; 11],
    /// In the order of [`Class::ALL`], the worst first.
    pub worst: [Vec<Case>; 6],
}

impl Report {
    /// The counts of `group`.
    #[must_use]
    pub fn of(&self, group: Group) -> &Tally {
        &self.groups[group as usize]
    }

    /// The counts of all groups together.
    #[must_use]
    pub fn total(&self) -> Tally {
        self.groups.iter().fold(Tally::default(), |mut sum, t| {
            sum.add(t);
            sum
        })
    }

    /// Disagreements that rounding does not explain.
    #[must_use]
    pub fn unexplained(&self) -> u64 {
        let total = self.total();
        Class::ALL.into_iter().filter(|c| !c.is_explained()).map(|c| total.of(c)).sum()
    }

    pub(super) fn tally(&mut self, group: Group) -> &mut Tally {
        &mut self.groups[group as usize]
    }

    pub(super) fn note(&mut self, case: Case) {
        self.tally(case.group).classes[case.class as usize] += 1;
        keep(&mut self.worst[case.class as usize], [case]);
    }

    /// The same, whichever is added to which.
    pub(super) fn with(mut self, other: Self) -> Self {
        self.groups.iter_mut().zip(&other.groups).for_each(|(a, b)| a.add(b));
        self.worst.iter_mut().zip(other.worst).for_each(|(a, b)| keep(a, b));
        self
    }
}

/// Adds cases and keeps the worst.
fn keep(worst: &mut Vec<Case>, more: impl IntoIterator<Item = Case>) {
    const FEW: usize = 5;
    worst.extend(more);
    worst.sort_by(Case::order);
    worst.truncate(FEW);
}
