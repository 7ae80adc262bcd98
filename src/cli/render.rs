//! The run: read, build, render, write.

use super::both::{self, Comparison};
use super::camera::{self, Chosen};
use super::exit::{self, Exit, Failure};
use super::frame::Frame;
use super::memory::Memory;
use super::message::Messages;
use super::notice::Notice;
use super::plan::{Input, Plan};
use super::progress::{Progress, Stage};
use super::report::{Report, certificate};
use super::settings::Settings;
use super::signals::Signals;
use super::style::bytes;
use super::target::{Output, Target};
use super::{EMBREE, VERSION, config, limits, output, system, turntable};
use std::io::Cursor;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;
use tison::backend::{self, AnyBackend, BackendKind, BuildOptions, Estimate, native};
#[cfg(feature = "embree")]
use tison::embree;
use tison::film::{self, Display, Film, Notes, Tonemap};
use tison::math::{Filter, Sampler};
use tison::metrics::Difference;
use tison::render::{self, Adapted, Control, Job, Outcome, RenderStats, Stop};
use tison::scene::format::Override;
use tison::scene::obj::Reader;
use tison::scene::{self, CameraDesc, FreeMemory, Light, LoadOptions, Loaded, Scene, Skip, Skips};

/// Does what the plan says.
pub fn render(plan: &Plan, messages: &Messages) -> Result<Exit, Failure> {
    let started = Instant::now();
    let control = Arc::new(Control::default());
    let memory = Memory::watch(plan.max_memory, &control)?;
    if !plan.print_config {
        if let Some(frame) = plan.known_frame()? {
            limits::check(&frame, &plan.aovs, plan.picture.is_adaptive(), &memory)?;
        }
        plan.check_targets()?;
    }
    let signals =
        Signals::install(&control).map_err(|e| Failure::new(Exit::Internal, "cannot listen for signals").because(e))?;
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(plan.threads)
        .build()
        .map_err(|e| Failure::new(Exit::Render, format!("cannot start {} threads", plan.threads)).because(e))?;
    let progress = Progress::start(plan.progress, &control);
    let run = Run { plan, messages, control: &control, memory: &memory, progress };
    let done = pool.install(|| match plan.picture.pixel {
        _ if plan.print_config => run.config(),
        Some(_) => run.pixel(),
        None => run.images(started),
    });
    match (done, signals.caught()) {
        (Ok(exit), None) => Ok(exit),
        // Whatever failed after memory was full failed because of it.
        (Err(f), None) if f.exit != Exit::Output => memory.check().and(Err(f)),
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
    memory: &'a Memory,
    progress: Progress,
}

/// Seconds of each stage.
#[derive(Clone, Copy, Debug, Default)]
pub struct Seconds {
    /// Without the textures.
    pub read: f64,
    pub textures: f64,
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
    /// With two backends, what is above is of the first.
    pub comparison: Option<Comparison>,
}

/// One film of a frame.
#[derive(Clone, Copy, Debug)]
struct Part<'a> {
    frame: u32,
    /// What its files have in their names.
    name: &'static str,
    film: &'a Film,
    /// What 8-bit formats show.
    shown: &'a Film,
    /// What is known of its error.
    error: Option<&'a RenderStats>,
}

/// A scene that has been read, and how it is to be rendered.
#[derive(Debug)]
pub struct Ready {
    pub loaded: Loaded,
    pub settings: Settings,
    pub chosen: Chosen,
    /// Warnings, which have been shown.
    pub warnings: usize,
}

impl Run<'_> {
    fn images(self, started: Instant) -> Result<Exit, Failure> {
        let mut done = Done::default();
        let mut ready = timed(&mut done.seconds.read, || self.read())?;
        let frame = Frame { size: ready.settings.job.size, crop: ready.settings.job.crop, pixel: None };
        limits::check(&frame, &self.plan.aovs, self.plan.picture.is_adaptive(), self.memory)?;
        self.plan.check_read(&ready.loaded.files)?;
        done.warnings = ready.warnings;
        done.seconds.textures = ready.loaded.texture_seconds.min(done.seconds.read);
        done.seconds.read -= done.seconds.textures;
        let first = ready.chosen.camera;
        self.light(&mut ready.loaded.scene, &first);
        let backends = self.build_all(&ready, &mut done)?;
        for frame in 0..self.plan.camera.turntable.unwrap_or(1) {
            let camera = self.frame_camera(&ready.chosen, frame);
            self.light(&mut ready.loaded.scene, &camera);
            self.frame(frame, &camera, &ready, &backends, &mut done)?;
            if self.control.is_cancelled() {
                break;
            }
        }
        if done.finished == 0 {
            return Err(Failure::new(Exit::Render, STOPPED));
        }
        done.seconds.total = started.elapsed().as_secs_f64();
        let report = Report::new(self.plan, &ready, &backends, done);
        let messages = self.messages;
        drop(self);
        report.tell(messages)?;
        Ok(Exit::Done)
    }

    /// The hierarchies of all backends that are asked for.
    fn build_all(&self, ready: &Ready, done: &mut Done) -> Result<Vec<AnyBackend>, Failure> {
        let (kinds, mut backends) = (self.plan.backend.kinds(), Vec::new());
        self.check_hierarchies(ready)?;
        let mut took = [0.0; 2];
        for (&kind, took) in kinds.iter().zip(&mut took) {
            backends.push(timed(took, || self.build(kind, &ready.loaded.scene, &ready.settings.job))?);
        }
        done.seconds.build = took[0];
        done.comparison = (kinds.len() > 1).then(|| Comparison { build: took, ..Comparison::default() });
        Ok(backends)
    }

    /// Renders one frame and saves it, unless it was stopped before its first pixel.
    fn frame(
        &self,
        frame: u32,
        camera: &CameraDesc,
        ready: &Ready,
        backends: &[AnyBackend],
        done: &mut Done,
    ) -> Result<(), Failure> {
        let outcome = self.rendered(camera, ready, &backends[0])?;
        done.seconds.render += outcome.stats.seconds;
        merge(&mut done.stats, &outcome.stats, frame);
        done.finished += outcome.film.finished as u64;
        if outcome.film.finished == 0 {
            return Ok(());
        }
        let display = Display { depth_range: camera.clip, ..ready.settings.display };
        let part = Part { frame, name: "", film: &outcome.film, shown: &outcome.film, error: Some(&outcome.stats) };
        self.write(part, &display, (ready, &backends[0]), done)?;
        match (backends.get(1), &mut done.comparison) {
            (Some(second), Some(comparison)) => {
                comparison.render[0] += outcome.stats.seconds;
                self.second(&outcome.film, frame, camera, (ready, second), done)
            }
            _ => Ok(()),
        }
    }

    /// Renders the frame again and saves it, and how it differs from the `first` time if both are finished.
    fn second(
        &self,
        first: &Film,
        frame: u32,
        camera: &CameraDesc,
        (ready, backend): (&Ready, &AnyBackend),
        done: &mut Done,
    ) -> Result<(), Failure> {
        let Outcome { film, stats } = self.rendered(camera, ready, backend)?;
        if let Some(comparison) = &mut done.comparison {
            comparison.render[1] += stats.seconds;
        }
        if film.finished == 0 {
            return Ok(());
        }
        let display = Display { depth_range: camera.clip, ..ready.settings.display };
        let part = Part { frame, name: both::NATIVE, film: &film, shown: &film, error: Some(&stats) };
        self.write(part, &display, (ready, backend), done)?;
        if !(first.is_complete() && film.is_complete()) {
            return Ok(());
        }
        let difference = Difference::of(first, &film);
        let (shown, scale) = difference.scaled();
        if let Some(comparison) = &mut done.comparison {
            comparison.add(&difference, scale);
        }
        let part = Part { frame, name: both::DIFF, film: &difference.image, shown: &shown, error: None };
        self.write(part, &Display::default(), (ready, backend), done)
    }

    fn rendered(&self, camera: &CameraDesc, ready: &Ready, backend: &AnyBackend) -> Result<Outcome, Failure> {
        self.progress.stage(Stage::Render);
        let outcome = render::run(&ready.loaded.scene, camera, backend, &ready.settings.job, self.control);
        // What is left of a render that took too much is not kept.
        self.memory.check()?;
        outcome.map_err(|e| Failure::new(Exit::Usage, e))
    }

    fn write(
        &self,
        part: Part<'_>,
        display: &Display,
        (ready, backend): (&Ready, &AnyBackend),
        done: &mut Done,
    ) -> Result<(), Failure> {
        self.progress.stage(Stage::Write);
        let notes = Notes {
            error: part.error.map_or(String::new(), certificate),
            ..notes(self.plan, &ready.settings, backend)
        };
        timed(&mut done.seconds.write, || self.save(part, display, &notes, &mut done.written))
    }

    fn pixel(self) -> Result<Exit, Failure> {
        let mut ready = self.read()?;
        let (x, y) = ready.settings.pixel.expect("asked before");
        let camera = ready.chosen.camera;
        self.light(&mut ready.loaded.scene, &camera);
        let job = &ready.settings.job;
        let backend = self.build(self.plan.backend.kinds()[0], &ready.loaded.scene, job)?;
        let tree = render::explain_pixel(&ready.loaded.scene, &camera, &backend, job, x, y)
            .map_err(|e| Failure::new(Exit::Usage, e))?;
        drop(self);
        output::print(tree.as_bytes())
    }

    fn config(self) -> Result<Exit, Failure> {
        let mut ready = self.read()?;
        self.light(&mut ready.loaded.scene, &ready.chosen.camera);
        let text = config::text(self.plan, &ready);
        drop(self);
        output::print(text.as_bytes())
    }

    /// Reads the scene, settles what it leaves open, and shows the warnings.
    fn read(&self) -> Result<Ready, Failure> {
        let plan = self.plan;
        self.progress.stage(Stage::Read);
        let reading = Reading {
            skips: plan.skips,
            exact: false,
            reader: plan.reader,
            smooth: plan.smooth,
            allow: &plan.allow,
            defines: &plan.defines,
        };
        let free = || self.memory.free();
        let hierarchy = plan.backend.kinds().iter().map(|&kind| Estimate::at_least_for_each_triangle(kind)).sum();
        let free = FreeMemory::new(&free).with_triangles_of(hierarchy);
        let loaded = load_within(free, &plan.input, &reading, self.control, &self.progress);
        let loaded = loaded.map_err(|e| self.memory.explained(e.into()))?;
        self.memory.check()?;
        let mut notices = Notice::about(&loaded);
        let settings = Settings::new(plan, &loaded.render)?;
        let chosen = camera::choose(plan, &loaded, &settings)?;
        notices.extend(Notice::about_picture(&settings.job, &chosen.camera));
        let mut strict = Ok(());
        self.progress.aside(|| match (plan.strict, plan.quiet) {
            (true, _) => strict = self.messages.strict(&notices),
            (false, true) => {}
            (false, false) => self.messages.warnings(&notices, plan.verbose, "-v shows all"),
        });
        strict.map(|()| Ready { loaded, settings, chosen, warnings: notices.len() })
    }

    /// A bare mesh is lit from where it is looked at; a scene file says what light there is.
    fn light(&self, scene: &mut Scene, camera: &CameraDesc) {
        if self.plan.kind == Input::Mesh {
            scene.light_from(camera);
        }
    }

    fn frame_camera(&self, chosen: &Chosen, frame: u32) -> CameraDesc {
        match self.plan.camera.turntable {
            Some(frames) => turntable::turned(&chosen.camera, chosen.axis, frame, frames),
            None => chosen.camera,
        }
    }

    /// Refuses hierarchies that cannot fit, all of them together.
    fn check_hierarchies(&self, ready: &Ready) -> Result<(), Failure> {
        let (scene, job, kinds) = (&ready.loaded.scene, &ready.settings.job, self.plan.backend.kinds());
        let options = BuildOptions { rays_expected: rays_expected(self.plan, job, scene), ..self.build_options() };
        let needed = kinds.iter().map(|&kind| Estimate::of(kind, scene, &options).at_least).sum();
        match self.memory.free() {
            Some(free) if needed > free => Err(self.memory.explained(no_room_for_hierarchy(needed, free))),
            _ => Ok(()),
        }
    }

    fn build_options(&self) -> BuildOptions<'_> {
        BuildOptions {
            threads: self.plan.threads,
            memory_limit: self.memory.free().filter(|_| self.memory.is_limited()),
            ..BuildOptions::new(&self.control.cancel)
        }
    }

    fn build(&self, kind: BackendKind, scene: &Scene, job: &Job) -> Result<AnyBackend, Failure> {
        self.progress.stage(Stage::Build);
        self.progress.expect_pixels(pixels(self.plan, job) * self.plan.backend.kinds().len() as u64);
        let options = BuildOptions {
            rays_expected: rays_expected(self.plan, job, scene),
            progress: Some(&|share| self.progress.report(share)),
            ..self.build_options()
        };
        AnyBackend::build(kind, scene, &options).map_err(|e| self.memory.explained(build_failure(&e)))
    }

    fn save(
        &self,
        part: Part<'_>,
        display: &Display,
        notes: &Notes,
        written: &mut Vec<(PathBuf, u64)>,
    ) -> Result<(), Failure> {
        for Output { target, format } in &self.plan.outputs {
            let film = if format.is_linear() { part.film } else { part.shown };
            match target {
                Target::File(path) => {
                    let path = match self.plan.camera.turntable {
                        Some(_) => turntable::frame_path(path, part.frame),
                        None => path.clone(),
                    };
                    let path = both::beside(&path, part.name);
                    written.extend(film::save_all(film, &path, *format, display, notes)?);
                }
                Target::Stdout => {
                    let mut bytes = Cursor::new(Vec::new());
                    film::encode(film, *format, display, notes, &mut bytes)
                        .map_err(|e| Failure::new(Exit::Output, "cannot make the image for stdout").because(e))?;
                    output::print(bytes.get_ref())?;
                    written.push(("stdout".into(), bytes.get_ref().len() as u64));
                }
            }
        }
        Ok(())
    }
}

/// Pixels of all frames.
fn pixels(plan: &Plan, job: &Job) -> u64 {
    let (crop, frames) = (job.crop, plan.camera.turntable.unwrap_or(1));
    u64::from(crop.x1 - crop.x0) * u64::from(crop.y1 - crop.y0) * u64::from(frames)
}

/// Rays that decide which hierarchy is worth its time: camera and shadow rays of all frames.
pub fn rays_expected(plan: &Plan, job: &Job, scene: &Scene) -> u64 {
    if !job.skips.has(Skip::BuildQuality) {
        // However many there may be, a good hierarchy is worth while.
        return u64::MAX;
    }
    let at_light = |l: &Light| if l.radius > 0.0 { u64::from(job.light_samples) } else { 1 };
    let rays_per_sample = 1 + scene.lights.iter().map(at_light).sum::<u64>();
    pixels(plan, job).saturating_mul(u64::from(job.spp)).saturating_mul(rays_per_sample)
}

/// How a file is read, as the flags have it.
#[derive(Clone, Copy, Debug)]
pub struct Reading<'a> {
    pub skips: Skips,
    pub reader: Reader,
    /// See [`LoadOptions::exact`].
    pub exact: bool,
    pub smooth: Option<f64>,
    pub allow: &'a [PathBuf],
    pub defines: &'a [String],
}

/// Reads a scene and shows how far it is.
pub fn load(
    path: &Path,
    reading: &Reading<'_>,
    control: &Control,
    progress: &Progress,
) -> Result<Loaded, scene::Error> {
    load_within(FreeMemory::new(&system::available_memory), path, reading, control, progress)
}

/// The same within what memory is free.
fn load_within(
    free_memory: FreeMemory<'_>,
    path: &Path,
    reading: &Reading<'_>,
    control: &Control,
    progress: &Progress,
) -> Result<Loaded, scene::Error> {
    let report = |done: u64, total: u64| progress.report(done as f64 / total.max(1) as f64);
    let options = LoadOptions {
        reader: reading.reader,
        exact: reading.exact,
        skips: reading.skips,
        smooth: reading.smooth,
        allow: reading.allow.to_vec(),
        overrides: reading.defines.iter().map(|d| Override::from(d.as_str())).collect(),
        cancel: &control.cancel,
        free_memory,
        progress: Some(&report),
    };
    scene::load(path, &options)
}

/// What decides the pixels, and nothing else: no threads, no time, no folder.
fn notes(plan: &Plan, settings: &Settings, backend: &AnyBackend) -> Notes {
    let (job, name) = (&settings.job, plan.input.file_name().unwrap_or_default());
    let backend = match (backend.kind(), EMBREE) {
        (backend::BackendKind::Embree, Some(version)) => format!("embree {version}"),
        (kind, _) => kind.name().to_owned(),
    };
    let curve = match settings.display.tonemap {
        Tonemap::None => String::new(),
        other => format!(", tonemap {}", other.name()),
    };
    let exposure = match settings.display.exposure {
        0.0 => String::new(),
        ev => format!(", exposure {ev}"),
    };
    let stop = match job.stop {
        Stop::Count => String::new(),
        Stop::Noise(threshold) => format!(" at most, adaptive {threshold}"),
        Stop::Rmse(target) => format!(" at most, target error {target}"),
    };
    let sampler = match job.sampler {
        Sampler::Sobol => String::new(),
        other => format!(", sampler {}", other.name()),
    };
    let filter = match job.filter {
        Filter::BlackmanHarris => String::new(),
        _ if job.spp == 1 => String::new(),
        other => format!(", filter {}", other.name()),
    };
    Notes {
        software: format!("tison {}", *VERSION),
        title: name.to_string_lossy().into_owned(),
        comment: format!(
            "{}x{}, spp {}{stop}, seed {}, backend {backend}{sampler}{filter}{curve}{exposure}",
            job.size.0, job.size.1, job.spp, job.seed
        ),
        error: String::new(),
    }
}

/// Why there is no backend.
pub fn build_failure(e: &backend::Error) -> Failure {
    let exit = match e {
        backend::Error::NotCompiledIn => Exit::Usage,
        backend::Error::Native(native::BuildError::OverBudget { needed, limit }) => {
            return no_room_for_hierarchy(*needed, *limit);
        }
        #[cfg(feature = "embree")]
        backend::Error::Embree(embree::Error::OverBudget { needed, limit }) => {
            return no_room_for_hierarchy(*needed, *limit);
        }
        #[cfg(feature = "embree")]
        backend::Error::Embree(embree::Error::OutOfMemory { .. }) => Exit::Limit,
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

fn no_room_for_hierarchy(needed: u64, free: u64) -> Failure {
    let (needed, free) = (bytes(needed), bytes(free));
    Failure::new(Exit::Limit, format!("the hierarchy needs at least {needed} while it is built, but {free} are free"))
        .help(exit::MORE_MEMORY)
}

/// Adds frame number `index` to what came before.
fn merge(all: &mut RenderStats, one: &RenderStats, index: u32) {
    all.seconds += one.seconds;
    all.samples += one.samples;
    all.rays_for_estimate += one.rays_for_estimate;
    all.sampling_rmse = root_mean_square(all.sampling_rmse, one.sampling_rmse, index);
    all.adapted = one.adapted.map(|one| after(all.adapted, one));
    all.rays.add(&one.rays);
    all.cut_off_max = all.cut_off_max.max(one.cut_off_max);
    all.cut_off_is_estimate |= one.cut_off_is_estimate;
    all.cut_off_mean += (one.cut_off_mean - all.cut_off_mean) / f64::from(index + 1);
    all.non_finite_samples += one.non_finite_samples;
    all.shadow_rays_facing_away += one.shadow_rays_facing_away;
    all.shadow_rays_enclosed += one.shadow_rays_enclosed;
    all.shadow_rays_faint += one.shadow_rays_faint;
    all.rays_inside += one.rays_inside;
    all.branches_below_cut += one.branches_below_cut;
    all.work.add(&one.work);
    all.packets_outside += one.packets_outside;
    all.blocks_without_highlight += one.blocks_without_highlight;
}

/// Of frame number `index` and those before it.
fn root_mean_square(all: Option<f64>, one: Option<f64>, index: u32) -> Option<f64> {
    let (before, one) = (all.unwrap_or(0.0).powi(2), one?.powi(2));
    Some((before + (one - before) / f64::from(index + 1)).sqrt())
}

/// The last frame says why it ended.
fn after(all: Option<Adapted>, one: Adapted) -> Adapted {
    let Some(all) = all else { return one };
    Adapted { rounds: all.rounds + one.rounds, ended: one.ended, stopped_early: all.stopped_early + one.stopped_early }
}

fn timed<T>(seconds: &mut f64, f: impl FnOnce() -> T) -> T {
    let start = Instant::now();
    let value = f();
    *seconds += start.elapsed().as_secs_f64();
    value
}
