//! The run: read, build, render, write.

use super::exit::{Exit, Failure};
use super::message::Messages;
use super::plan::{Output, Plan, Target};
use super::progress::{Progress, Stage};
use super::report::Report;
use super::signals::Signals;
use super::{EMBREE, VERSION, limits, output, turntable};
use std::io::Cursor;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;
use tison::backend::{self, AnyBackend, BuildOptions};
use tison::film::{self, Film, Notes};
use tison::render::{self, Control, RenderStats};
use tison::scene::{self, CameraDesc, LoadOptions, Loaded, Scene};

/// Does what the plan says.
pub fn render(plan: &Plan, messages: &Messages) -> Result<Exit, Failure> {
    let started = Instant::now();
    limits::check(plan)?;
    plan.check_targets()?;
    let control = Arc::new(Control::default());
    let signals =
        Signals::install(&control).map_err(|e| Failure::new(Exit::Internal, "cannot listen for signals").because(e))?;
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(plan.threads)
        .build()
        .map_err(|e| Failure::new(Exit::Render, format!("cannot start {} threads", plan.threads)).because(e))?;
    let run = Run { plan, messages, control: &control, progress: Progress::start(plan.progress, &control) };
    let done = pool.install(|| if plan.pixel.is_some() { run.pixel() } else { run.images(started) });
    match (done, signals.caught()) {
        (Ok(exit), None) => Ok(exit),
        // Whatever failed after a signal failed because of it, but for what the disk had to say.
        (Err(f), Some(exit)) if f.exit != Exit::Output => Err(Failure::new(exit, STOPPED)),
        (Ok(_), Some(exit)) => Ok(exit),
        (Err(failure), _) => Err(failure),
    }
}

const STOPPED: &str = "stopped before anything was rendered: nothing is written";

struct Run<'a> {
    plan: &'a Plan,
    messages: &'a Messages,
    control: &'a Control,
    progress: Progress,
}

/// Seconds of each stage.
#[derive(Clone, Copy, Debug, Default)]
pub struct Seconds {
    pub read: f64,
    pub build: f64,
    pub render: f64,
    pub write: f64,
    pub total: f64,
}

/// What has been done so far.
#[derive(Debug, Default)]
pub struct Done {
    pub seconds: Seconds,
    /// Of all frames together.
    pub stats: RenderStats,
    /// Pixels that were finished.
    pub finished: u64,
    /// Files and their sizes in bytes.
    pub written: Vec<(PathBuf, u64)>,
    pub warnings: usize,
}

impl Run<'_> {
    fn images(self, started: Instant) -> Result<Exit, Failure> {
        let mut done = Done::default();
        let (mut scene, warnings) = timed(&mut done.seconds.read, || self.read())?;
        done.warnings = warnings;
        let first = self.camera(&scene)?;
        let unlit = scene.lights.is_empty();
        if unlit {
            scene.light_from(&first);
        }
        let backend = timed(&mut done.seconds.build, || self.build(&scene))?;
        for frame in 0..self.plan.turntable.unwrap_or(1) {
            let camera = self.frame_camera(&first, frame);
            if unlit {
                scene.light_from(&camera);
            }
            self.frame(frame, &camera, &scene, &backend, &mut done)?;
            if self.control.is_cancelled() {
                break;
            }
        }
        if done.finished == 0 {
            return Err(Failure::new(Exit::Render, STOPPED));
        }
        done.seconds.total = started.elapsed().as_secs_f64();
        let report = Report::new(self.plan, &scene, &backend, &first, done);
        let messages = self.messages;
        drop(self);
        report.tell(messages)?;
        Ok(Exit::Done)
    }

    /// Renders one frame and saves it, unless it was stopped before its first pixel.
    fn frame(
        &self,
        frame: u32,
        camera: &CameraDesc,
        scene: &Scene,
        backend: &AnyBackend,
        done: &mut Done,
    ) -> Result<(), Failure> {
        self.progress.stage(Stage::Render);
        let outcome = render::run(scene, camera, backend, &self.plan.job, self.control)
            .map_err(|e| Failure::new(Exit::Usage, e))?;
        done.seconds.render += outcome.stats.seconds;
        merge(&mut done.stats, &outcome.stats, frame);
        done.finished += outcome.film.finished as u64;
        if outcome.film.finished == 0 {
            return Ok(());
        }
        self.progress.stage(Stage::Write);
        timed(&mut done.seconds.write, || self.save(&outcome.film, backend, frame, &mut done.written))
    }

    fn pixel(self) -> Result<Exit, Failure> {
        let (x, y) = self.plan.pixel.expect("asked before");
        let (mut scene, _) = self.read()?;
        let camera = self.camera(&scene)?;
        if scene.lights.is_empty() {
            scene.light_from(&camera);
        }
        let backend = self.build(&scene)?;
        let tree = render::explain_pixel(&scene, &camera, &backend, &self.plan.job, x, y)
            .map_err(|e| Failure::new(Exit::Usage, e))?;
        drop(self);
        output::print(tree.as_bytes())
    }

    /// The scene and the number of warnings about it, which have been shown.
    fn read(&self) -> Result<(Scene, usize), Failure> {
        self.progress.stage(Stage::Read);
        let loaded = load(&self.plan.input, self.plan.smooth, self.control, &self.progress)?;
        if !self.plan.quiet {
            let all = self.plan.verbose;
            self.progress.aside(|| self.messages.warnings(&loaded.warnings, all, "-v shows all"));
        }
        Ok((loaded.scene, loaded.warnings.len()))
    }

    fn camera(&self, scene: &Scene) -> Result<CameraDesc, Failure> {
        let (width, height) = self.plan.job.size;
        let aspect = f64::from(width) / f64::from(height);
        let camera =
            scene.auto_camera(self.plan.view, &self.plan.camera, aspect).map_err(|e| Failure::new(Exit::Usage, e))?;
        Ok(match self.plan.turntable {
            Some(_) => turntable::first(&camera, &self.plan.camera, scene.bounds(), aspect),
            None => camera,
        })
    }

    fn frame_camera(&self, first: &CameraDesc, frame: u32) -> CameraDesc {
        match self.plan.turntable {
            Some(frames) => turntable::turned(first, self.plan.camera.up.unwrap_or(glam::DVec3::Y), frame, frames),
            None => *first,
        }
    }

    fn build(&self, scene: &Scene) -> Result<AnyBackend, Failure> {
        self.progress.stage(Stage::Build);
        let crop = self.plan.job.crop;
        let pixels =
            u64::from(crop.x1 - crop.x0) * u64::from(crop.y1 - crop.y0) * u64::from(self.plan.turntable.unwrap_or(1));
        self.progress.expect_pixels(pixels);
        let rays_per_pixel = u64::from(self.plan.job.spp) * (1 + scene.lights.len() as u64);
        let options = BuildOptions {
            threads: self.plan.threads,
            rays_expected: pixels.saturating_mul(rays_per_pixel),
            cancel: &self.control.cancel,
            progress: Some(&|share| self.progress.report(share)),
        };
        AnyBackend::build(self.plan.backend, scene, &options).map_err(|e| build_failure(&e))
    }

    fn save(
        &self,
        film: &Film,
        backend: &AnyBackend,
        frame: u32,
        written: &mut Vec<(PathBuf, u64)>,
    ) -> Result<(), Failure> {
        let notes = notes(self.plan, backend);
        for Output { target, format } in &self.plan.outputs {
            match target {
                Target::File(path) => {
                    let path = self.plan.turntable.map_or_else(|| path.clone(), |_| turntable::frame_path(path, frame));
                    written.extend(film::save_all(film, &path, *format, &film::Display::default(), &notes)?);
                }
                Target::Stdout => {
                    let mut bytes = Cursor::new(Vec::new());
                    film::encode(film, *format, &film::Display::default(), &notes, &mut bytes)
                        .map_err(|e| Failure::new(Exit::Output, "cannot make the image for stdout").because(e))?;
                    output::print(bytes.get_ref())?;
                    written.push(("stdout".into(), bytes.get_ref().len() as u64));
                }
            }
        }
        Ok(())
    }
}

/// Reads a scene and shows how far it is.
pub fn load(path: &Path, smooth: Option<f64>, control: &Control, progress: &Progress) -> Result<Loaded, scene::Error> {
    let report = |done: u64, total: u64| progress.report(done as f64 / total.max(1) as f64);
    let options = LoadOptions {
        smooth,
        allow: Vec::new(),
        overrides: Vec::new(),
        cancel: &control.cancel,
        progress: Some(&report),
    };
    scene::load(path, &options)
}

/// What decides the pixels, and nothing else: no threads, no time, no folder.
fn notes(plan: &Plan, backend: &AnyBackend) -> Notes {
    let (job, name) = (&plan.job, plan.input.file_name().unwrap_or_default());
    let backend = match (backend.kind(), EMBREE) {
        (backend::BackendKind::Embree, Some(version)) => format!("embree {version}"),
        (kind, _) => kind.name().to_owned(),
    };
    Notes {
        software: format!("tison {}", *VERSION),
        title: name.to_string_lossy().into_owned(),
        comment: format!("{}x{}, spp {}, seed {}, backend {backend}", job.size.0, job.size.1, job.spp, job.seed),
    }
}

fn build_failure(e: &backend::Error) -> Failure {
    let exit = match e {
        backend::Error::NotCompiledIn => Exit::Usage,
        #[cfg(feature = "embree")]
        backend::Error::Embree(tison::embree::Error::OverBudget { .. } | tison::embree::Error::OutOfMemory { .. }) => {
            Exit::Limit
        }
        _ => Exit::Render,
    };
    let mut text = e.to_string();
    let mut source = std::error::Error::source(e);
    while let Some(cause) = source {
        text += &format!("\n  caused by: {cause}");
        source = cause.source();
    }
    Failure::new(exit, text)
}

/// Adds frame number `index` to what came before.
fn merge(all: &mut RenderStats, one: &RenderStats, index: u32) {
    all.seconds += one.seconds;
    all.rays.camera += one.rays.camera;
    all.rays.shadow += one.rays.shadow;
    all.rays.reflected += one.rays.reflected;
    all.rays.refracted += one.rays.refracted;
    all.cut_off_max = all.cut_off_max.max(one.cut_off_max);
    all.cut_off_mean += (one.cut_off_mean - all.cut_off_mean) / f64::from(index + 1);
    all.non_finite_samples += one.non_finite_samples;
    all.shadow_rays_facing_away += one.shadow_rays_facing_away;
    all.branches_below_cut += one.branches_below_cut;
}

fn timed<T>(seconds: &mut f64, f: impl FnOnce() -> T) -> T {
    let start = Instant::now();
    let value = f();
    *seconds += start.elapsed().as_secs_f64();
    value
}
