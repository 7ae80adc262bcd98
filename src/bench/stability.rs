//! `tison bench stability`: wrong answers, leaks, false shadows, and what it costs to have none of them.

use super::closed::{self, Aim};
use super::leaving::{self, Body, Place};
use super::plot::{Line, Plot};
use super::report::{Machine, Report, Section, Table};
use super::wrong::{self, Count, MARGIN, Setting, Shape};
use super::{cost, setup};
use crate::backend::{self, BackendKind};
use crate::geom::{Ray, TriangleMesh};
use crate::scene::example::{self, Surface};
use crate::scene::{Mesh, Object, Scene};
use glam::Vec3;
use serde_json::{Value, json};
use std::sync::Arc;

/// What is measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// Wrong answers over the distance of the eye.
    Distance,
    /// Wrong answers over the size of the scene.
    Scale,
    /// Wrong answers over the length of the direction.
    Length,
    /// Rays that get out of closed meshes.
    Leaks,
    /// Rays that meet the surface that they leave.
    Shadows,
    /// Time of tests and refinements.
    Cost,
}

impl Part {
    /// All of them.
    pub const ALL: [Self; 6] = [Self::Distance, Self::Scale, Self::Length, Self::Leaks, Self::Shadows, Self::Cost];

    /// Name on the command line and in JSON.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Distance => "distance",
            Self::Scale => "scale",
            Self::Length => "length",
            Self::Leaks => "leaks",
            Self::Shadows => "shadows",
            Self::Cost => "cost",
        }
    }
}

/// How much to measure.
#[derive(Clone, Debug)]
pub struct Options {
    /// Rays for each case of leaks, and of shadows; `None` takes as many as make the whole run last about a minute.
    pub rays: Option<u64>,
    /// Parts to measure, in this order.
    pub parts: Vec<Part>,
}

/// Why there is no report.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
#[expect(missing_docs, reason = "the messages say it")]
pub enum Error {
    #[error("a scene to measure with cannot be built")]
    Build(#[from] backend::Error),
    #[error("rays that leave surfaces cannot be measured")]
    Leaving(#[from] leaving::Error),
}

/// Rays per shape and setting of the tables of wrong answers.
const RAYS: u64 = 20_000;
/// Rays per case of leaks unless told.
const LEAK_RAYS: u64 = 1_000_000;
/// Rays per case of shadows unless told.
const SHADOW_RAYS: u64 = 100_000;
/// Rounds of timing.
const ROUNDS: usize = 41;

/// Measures; `tell` hears what it is at.
///
/// # Errors
/// See [`Error`].
pub fn run(options: &Options, tell: &dyn Fn(&str)) -> Result<Report, Error> {
    let mut sections = Vec::new();
    for part in &options.parts {
        tell(part.name());
        sections.extend(match part {
            Part::Distance => wrong_over(Sweep::Distance)?,
            Part::Scale => wrong_over(Sweep::Scale)?,
            Part::Length => wrong_over(Sweep::Length)?,
            Part::Leaks => vec![leaks(options.rays.unwrap_or(LEAK_RAYS))?],
            Part::Shadows => vec![shadows(options.rays.unwrap_or(SHADOW_RAYS))?],
            Part::Cost => vec![test_cost(), refine_cost()?],
        });
    }
    let about = "Rays are f32, and taken as exact; the truth is computed with 32 digits. Ours, native and Embree + \
                 refine are what the renderer uses: shapes and refinements in f64, the scene in a frame that makes its \
                 size about 1.";
    Ok(Report { title: "tison: numerical stability".into(), about: about.into(), machine: Machine::this(), sections })
}

fn repeat(part: Part) -> String {
    format!("tison bench stability --only {}", part.name())
}

/// What a table of wrong answers goes through.
#[derive(Clone, Copy)]
enum Sweep {
    Distance,
    Scale,
    Length,
}

impl Sweep {
    fn values(self) -> &'static [f64] {
        match self {
            Self::Distance => &[1.5, 15.0, 150.0, 1.5e3, 1.5e4, 1.5e5, 1.5e6, 1.5e7],
            Self::Scale => &[1e-15, 1e-12, 1e-9, 1e-6, 1e-3, 1.0, 1e3, 1e6, 1e9, 1e12, 1e15],
            Self::Length => &[1e-30, 1e-25, 1e-20, 1e-17, 1e-15, 1e-10, 1e-5, 1.0, 1e5, 1e10, 1e15, 1e20, 1e25],
        }
    }

    fn setting(self, value: f64) -> Setting {
        match self {
            Self::Distance => Setting { distance: value, ..Setting::PLAIN },
            Self::Scale => Setting { scale: value, ..Setting::PLAIN },
            Self::Length => Setting { length: value, ..Setting::PLAIN },
        }
    }

    fn part(self) -> Part {
        match self {
            Self::Distance => Part::Distance,
            Self::Scale => Part::Scale,
            Self::Length => Part::Length,
        }
    }

    fn axis(self) -> &'static str {
        match self {
            Self::Distance => "distance of the eye, sizes",
            Self::Scale => "size of the shape",
            Self::Length => "length of the direction",
        }
    }

    fn section(self, shape: Shape) -> &'static str {
        let names = match self {
            Self::Distance => ["distance_sphere", "distance_cube", "distance_cylinder", "distance_triangle"],
            Self::Scale => ["scale_sphere", "scale_cube", "scale_cylinder", "scale_triangle"],
            Self::Length => ["length_sphere", "length_cube", "length_cylinder", "length_triangle"],
        };
        names[Shape::ALL.iter().position(|&s| s == shape).expect("it is one of them")]
    }
}

fn wrong_over(sweep: Sweep) -> Result<Vec<Section>, Error> {
    Shape::ALL.into_iter().map(|shape| wrong_of(sweep, shape)).collect()
}

fn wrong_of(sweep: Sweep, shape: Shape) -> Result<Section, Error> {
    let mut found: Vec<(f64, Vec<(&'static str, Count)>)> = Vec::new();
    for &value in sweep.values() {
        found.push((value, wrong::wrong(shape, sweep.setting(value), RAYS)?));
    }
    let names: Vec<&'static str> = found[0].1.iter().map(|(name, _)| *name).collect();
    let mut table =
        Table { columns: [sweep.axis()].iter().chain(&names).map(|&n| n.to_owned()).collect(), ..Table::default() };
    let mut data = Vec::new();
    for (value, counts) in &found {
        let error = |t: f64| if t == 0.0 { "0".to_owned() } else { format!("{t:.0e}") };
        let cell = |c: &Count| format!("{}/{}  {}", c.missed, c.made_up, error(c.worst_t));
        table.rows.push(std::iter::once(number(*value)).chain(counts.iter().map(|(_, c)| cell(c))).collect());
        data.extend(counts.iter().map(|(name, c)| {
            json!({
                "who": name, "at": value, "rays": c.rays, "missed": c.missed, "made_up": c.made_up,
                "worst_t": finite(c.worst_t),
            })
        }));
    }
    let line = |i: usize, of: fn(&Count) -> f64| Line {
        name: names[i].into(),
        points: found.iter().map(|(value, counts)| (*value, of(&counts[i].1))).collect(),
    };
    let plot = |y: &str, of: fn(&Count) -> f64| Plot {
        title: format!("{}: {y}", shape.name()),
        x: sweep.axis().into(),
        y: y.into(),
        lines: (0..names.len()).map(|i| line(i, of)).collect(),
        floor: None,
    };
    Ok(Section {
        name: sweep.section(shape).into(),
        title: format!("Wrong answers: {}, by the {}", shape.name(), sweep.axis()),
        about: format!(
            "Hits missed / made up, and the worst relative error of t, of {RAYS} rays without those that a relative \
             change below {MARGIN:e} would decide otherwise."
        ),
        repeat: repeat(sweep.part()),
        table,
        data: Value::Array(data),
        plots: vec![plot("share of wrong answers", Count::share), plot("worst relative error of t", |c| c.worst_t)],
        pictures: vec![],
    })
}

/// JSON has no infinity.
fn finite(x: f64) -> Value {
    if x.is_finite() { json!(x) } else { Value::Null }
}

/// As people write it.
fn number(x: f64) -> String {
    if (1e-2..1e5).contains(&x) { format!("{x}") } else { format!("{x:e}") }
}

type Tracer = Box<dyn Fn(&Ray) -> bool + Send + Sync>;

/// Who traces a closed mesh.
fn tracers(mesh: &Arc<TriangleMesh>) -> Result<Vec<(&'static str, Tracer)>, Error> {
    let scene = Scene::of(vec![Object::Mesh(Mesh::bare(Arc::clone(mesh)))]);
    let native = setup::build(BackendKind::Native, &scene)?;
    let native: Tracer = Box::new(move |ray| native.as_dyn().intersect(ray).is_some());
    Ok(std::iter::once(("native", native)).chain(embree_tracers(mesh)?).collect())
}

#[cfg(feature = "embree")]
fn embree_tracers(mesh: &Arc<TriangleMesh>) -> Result<Vec<(&'static str, Tracer)>, backend::Error> {
    use crate::embree::{Device, DeviceConfig, SceneBuilder, SceneOptions};
    let device = Device::new(&DeviceConfig::default())?;
    let tracer = |robust| -> Result<Tracer, backend::Error> {
        let mut builder = SceneBuilder::new(&device, SceneOptions { robust, ..SceneOptions::default() })?;
        builder.mesh(Arc::clone(mesh))?;
        let scene = builder.commit(None)?;
        Ok(Box::new(move |ray| scene.intersect(ray).is_some()))
    };
    Ok(vec![("Embree, robust", tracer(true)?), ("Embree, default flags", tracer(false)?)])
}

#[cfg(not(feature = "embree"))]
fn embree_tracers(_: &Arc<TriangleMesh>) -> Result<Vec<(&'static str, Tracer)>, backend::Error> {
    Ok(Vec::new())
}

fn leaks(rays: u64) -> Result<Section, Error> {
    /// What fits inside of each of the meshes.
    const ROOM: (Vec3, f32) = (Vec3::ZERO, 0.3);
    let meshes: [(&str, TriangleMesh); 5] = [
        ("icosphere", example::mesh(20_480, Surface::Round)),
        ("icosphere", example::mesh(80_000, Surface::Round)),
        ("rock", example::mesh(20_480, Surface::Rock)),
        ("rock", example::mesh(80_000, Surface::Rock)),
        ("room", closed::room(16, 1.0)),
    ];
    let mut table = Table::new(&["mesh", "triangles", "rays aimed"]);
    let mut data = Vec::new();
    for (name, mesh) in meshes {
        let mesh = Arc::new(mesh);
        let tracers = tracers(&mesh)?;
        for aim in Aim::ALL {
            let mut row = vec![name.to_owned(), mesh.face_count().to_string(), aim.name().to_owned()];
            for (who, tracer) in &tracers {
                if !table.columns.iter().any(|c| c == who) {
                    table.columns.push((*who).to_owned());
                }
                let leaks = closed::leaks(&mesh, ROOM, aim, rays, tracer);
                let share = leaks as f64 / rays.max(1) as f64;
                row.push(if leaks == 0 { "0".into() } else { format!("{leaks}  ({:.3} %)", 100.0 * share) });
                data.push(json!({
                    "mesh": name, "triangles": mesh.face_count(), "aim": aim.name(), "who": who, "rays": rays,
                    "leaks": leaks,
                }));
            }
            table.rows.push(row);
        }
    }
    Ok(Section {
        name: Part::Leaks.name().into(),
        title: "Leaks of closed meshes".into(),
        about: format!("Rays from inside that hit nothing, of {rays} in each case; half of them start in the middle."),
        repeat: format!("{} --rays {rays}", repeat(Part::Leaks)),
        table,
        data: Value::Array(data),
        plots: vec![],
        pictures: vec![],
    })
}

/// Sizes at the origin, then places at size 1.
const CASES: [(f64, Place); 14] = [
    (1e-3, Place::Moved(0.0)),
    (1e-2, Place::Moved(0.0)),
    (1e-1, Place::Moved(0.0)),
    (1.0, Place::Moved(0.0)),
    (1e1, Place::Moved(0.0)),
    (1e2, Place::Moved(0.0)),
    (1e3, Place::Moved(0.0)),
    (1e4, Place::Moved(0.0)),
    (1e5, Place::Moved(0.0)),
    (1e6, Place::Moved(0.0)),
    (1.0, Place::Moved(1e2)),
    (1.0, Place::Moved(1e4)),
    (1.0, Place::Moved(1e6)),
    (1.0, Place::Apart(1e4)),
];

fn shadows(rays: u64) -> Result<Section, Error> {
    let mut table = Table::new(&["case", "backend"]);
    table.columns.extend(Body::ALL.iter().map(|b| b.name().to_owned()));
    table.columns.extend(["moved by at most, sizes".into(), "saw an inner side".into()]);
    let mut data = Vec::new();
    for (size, place) in CASES {
        for &kind in BackendKind::COMPILED {
            let case = match place {
                Place::Moved(0.0) => format!("size {}", number(size)),
                Place::Moved(by) => format!("scene moved by {} sizes", number(by)),
                Place::Apart(by) => format!("{} sizes from the middle of its scene", number(by)),
            };
            let mut row = vec![case.clone(), kind.name().to_owned()];
            let (mut moved, mut through) = (0f64, 0);
            for body in Body::ALL {
                let found = leaving::leave(kind, body, size, place, rays)?;
                moved = moved.max(found.moved);
                through += found.through;
                row.push(found.hits.to_string());
                data.push(json!({
                    "case": case, "backend": kind.name(), "body": body.name(), "rays": found.rays,
                    "false_hits": found.hits, "moved": found.moved, "saw_inner_side": found.through,
                }));
            }
            row.extend([format!("{moved:.1e}"), through.to_string()]);
            table.rows.push(row);
        }
    }
    Ok(Section {
        name: Part::Shadows.name().into(),
        title: "False self-hits".into(),
        about: format!(
            "Shadow rays and mirrored rays of the renderer that meet the convex object that they leave, of at least \
             {rays} in each case. Scenes are read from files with coordinates in f64. The last columns are how far \
             shadow rays start off the surface, as seen from the object's middle, and how many camera rays met a mesh's \
             inner side first, which are left out."
        ),
        repeat: format!("{} --rays {rays}", repeat(Part::Shadows)),
        table,
        data: Value::Array(data),
        plots: vec![],
        pictures: vec![],
    })
}

fn test_cost() -> Section {
    let mut table = Table::new(&["shape", "textbook f32, ns", "ours f64, ns", "ratio", "ours, 16 at once, ns a ray"]);
    let mut data = Vec::new();
    for c in cost::tests(ROUNDS) {
        table.rows.push(vec![
            c.shape.into(),
            format!("{:.2}", c.textbook),
            format!("{:.2}", c.ours),
            format!("{:.2}", c.ratio),
            c.lanes.map_or("-".into(), |ns| format!("{ns:.2}")),
        ]);
        data.push(json!({
            "shape": c.shape, "textbook_ns": c.textbook, "ours_ns": c.ours, "ratio": c.ratio, "lanes_ns": c.lanes,
        }));
    }
    Section {
        name: "cost_of_tests".into(),
        title: "Cost of a test".into(),
        about: format!(
            "Nanoseconds of one ray against one shape, about half of them hits, on one thread: medians of {ROUNDS} \
             rounds in turn. The aim is a ratio of at most 1.6."
        ),
        repeat: repeat(Part::Cost),
        table,
        data: Value::Array(data),
        plots: vec![],
        pictures: vec![],
    }
}

fn refine_cost() -> Result<Section, Error> {
    let mut table = Table::new(&["hit on", "ns"]);
    let mut data = Vec::new();
    for c in cost::refining(ROUNDS)? {
        table.rows.push(vec![c.what.into(), format!("{:.1}", c.ns)]);
        data.push(json!({ "what": c.what, "ns": c.ns }));
    }
    Ok(Section {
        name: "cost_of_refining".into(),
        title: "Cost of refining a hit".into(),
        about: format!(
            "Nanoseconds that the surface point of a reported hit takes in f64, without texture coordinates, on one \
             thread: medians of {ROUNDS} rounds. The aim is 20."
        ),
        repeat: repeat(Part::Cost),
        table,
        data: Value::Array(data),
        plots: vec![],
        pictures: vec![],
    })
}
