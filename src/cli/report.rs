//! What a run tells when it is over: one screen on stderr, and figures for programs.

use super::both::Comparison;
use super::cost::Cost;
use super::exit::Failure;
use super::message::Messages;
use super::plan::Plan;
use super::render::{Done, Ready};
use super::settings::Settings;
use super::skipped::{self, Skipped, skipped};
use super::style::{bytes, counted, grouped, seconds};
use super::target::Target;
use super::{output, stats, system};
use tison::backend::AnyBackend;
use tison::film;
use tison::render::{Adapted, Ended, RenderStats, Stop};
use tison::scene::{CameraDesc, Projection, Reflect, SceneCounts, Unused};

/// The story of a run.
#[derive(Debug)]
pub struct Report<'a> {
    pub plan: &'a Plan,
    pub settings: &'a Settings,
    pub counts: SceneCounts,
    /// Name of what a scene may need, and whether this one does.
    pub needs: Vec<(&'static str, bool)>,
    pub unused: Unused,
    /// Materials that mirror by Fresnel's equations between equal indices: nothing.
    pub fresnel: usize,
    /// Whether the first hierarchy was built quickly.
    pub quick: bool,
    pub cost: Cost,
    /// Release, packet width, build quality.
    pub details: String,
    /// Of the first frame.
    pub camera: CameraDesc,
    pub done: Done,
    pub peak_memory: Option<u64>,
}

impl<'a> Report<'a> {
    /// Of a run that is over.
    pub fn new(plan: &'a Plan, ready: &'a Ready, backends: &[AnyBackend], done: Done) -> Self {
        let scene = &ready.loaded.scene;
        Self {
            plan,
            settings: &ready.settings,
            counts: scene.counts(),
            needs: scene.needs().list().to_vec(),
            unused: ready.loaded.unused,
            fresnel: scene.materials.iter().filter(|m| m.reflect == Reflect::Fresnel && !m.reflects()).count(),
            quick: backends.first().is_some_and(AnyBackend::is_quick),
            cost: Cost::of_built(scene, backends),
            details: backends.iter().map(AnyBackend::details).collect::<Vec<_>>().join(" and "),
            camera: ready.chosen.camera,
            done,
            peak_memory: system::peak_memory(),
        }
    }

    /// Writes the summary and the figures to where the plan wants them.
    pub fn tell(&self, messages: &Messages) -> Result<(), Failure> {
        if !self.plan.quiet {
            self.lines().iter().for_each(|line| messages.line(line));
            if self.done.finished < self.pixels() {
                messages.warning(&format!(
                    "stopped: {:.1} % of the pixels are rendered, the others are black",
                    100.0 * self.done.finished as f64 / self.pixels() as f64
                ));
            }
        }
        let Some(target) = &self.plan.stats else { return Ok(()) };
        let text = format!("{:#}\n", stats::json(self));
        match target {
            Target::Stdout => output::print(text.as_bytes()).map(drop),
            Target::File(path) => Ok(film::save(path, |out| out.write_all(text.as_bytes())).map(drop)?),
        }
    }

    /// Pixels of all frames.
    pub fn pixels(&self) -> u64 {
        let (width, height) = self.image_size();
        u64::from(width) * u64::from(height) * u64::from(self.plan.camera.turntable.unwrap_or(1))
    }

    /// Pixels of one image across and down.
    pub fn image_size(&self) -> (u32, u32) {
        let crop = self.settings.job.crop;
        (crop.x1 - crop.x0, crop.y1 - crop.y0)
    }

    pub fn mrays_per_s(&self) -> f64 {
        if self.done.seconds.render > 0.0 {
            self.done.stats.rays.total() as f64 / self.done.seconds.render / 1e6
        } else {
            0.0
        }
    }

    fn lines(&self) -> Vec<String> {
        let mut lines = vec![self.input_line(), self.backend_line(), self.image_line(), self.rays_line()];
        lines.push(self.time_line());
        lines.extend(self.adapted_line());
        lines.extend(self.done.comparison.iter().flat_map(Comparison::lines));
        if self.plan.verbose {
            lines.push(self.camera_line());
        }
        lines.push(format!("memory    {}", self.cost.text()));
        if self.plan.verbose {
            lines.push(format!("buffers   {}", self.cost.buffers_text()));
        }
        lines.extend(self.skipped_line());
        lines.push(self.error_line());
        lines.extend(
            self.done.written.iter().map(|(path, size)| format!("wrote     {} ({})", path.display(), bytes(*size))),
        );
        lines
    }

    fn input_line(&self) -> String {
        let c = &self.counts;
        let all = [
            (c.triangles, "triangle"),
            (c.vertices, "vertex"),
            (c.instances, "instance"),
            (c.spheres, "sphere"),
            (c.cubes, "cube"),
            (c.cylinders, "cylinder"),
            (c.quads, "quad"),
            (c.materials, "material"),
            (c.textures, "texture"),
            (c.lights, "light"),
        ];
        let always = |what: &str| matches!(what, "material" | "light");
        let told = all.iter().filter(|&&(n, what)| n > 0 || always(what)).map(|&(n, what)| counted(n as u64, what));
        let mut line = format!("input     {}: {}", self.plan.input.display(), told.collect::<Vec<_>>().join(", "));
        if c.degenerate > 0 {
            line += &format!("; {} without area", grouped(c.degenerate as u64));
        }
        if c.non_finite > 0 {
            line += &format!("; {} out of range", grouped(c.non_finite as u64));
        }
        line
    }

    fn backend_line(&self) -> String {
        let threads = counted(self.plan.threads as u64, "thread");
        format!("backend   {}: {}; {threads}", self.plan.backend.name(), self.details)
    }

    fn image_line(&self) -> String {
        let (width, height) = self.image_size();
        let frames =
            self.plan.camera.turntable.map_or(String::new(), |n| format!(", {}", counted(u64::from(n), "frame")));
        let (spp, seed) = (self.settings.job.spp, self.settings.job.seed);
        let samples = match self.done.stats.adapted {
            Some(_) => {
                format!("{:.1} samples a pixel on average, at most {}", self.spp_mean(), grouped(u64::from(spp)))
            }
            None => {
                let hint = if spp.is_power_of_two() { "" } else { " (a power of two is spread better)" };
                format!("{} a pixel{hint}", counted(u64::from(spp), "sample"))
            }
        };
        format!("image     {width}x{height}, {samples}, seed {seed}{frames}")
    }

    /// Samples per pixel, over all pixels of all frames.
    pub fn spp_mean(&self) -> f64 {
        self.done.stats.samples as f64 / self.pixels() as f64
    }

    /// Why an adaptive render ended.
    fn adapted_line(&self) -> Option<String> {
        let (stats, job) = (&self.done.stats, &self.settings.job);
        let Adapted { rounds, ended, stopped_early } = stats.adapted?;
        let limit = job.time_limit.map_or(0.0, |limit| limit.as_secs_f64());
        let why = match (ended, job.stop) {
            (Ended::Enough, Stop::Rmse(target)) => format!("the error is at most {target}"),
            (Ended::Enough, _) => "every pixel is clean enough".into(),
            (Ended::Most, _) => format!("{} samples are the most a pixel may get", grouped(u64::from(job.spp))),
            (Ended::Time, _) => format!("{limit} seconds are over"),
            (Ended::Stopped, _) => "stopped".into(),
        };
        let rounds = counted(u64::from(rounds), "round");
        Some(format!(
            "adaptive  {rounds}, {} of {} pixels early; ended as {why}",
            grouped(stopped_early),
            grouped(self.pixels())
        ))
    }

    fn rays_line(&self) -> String {
        let rays = &self.done.stats.rays;
        let kinds = [
            ("camera", rays.camera),
            ("shadow", rays.shadow),
            ("reflected", rays.reflected),
            ("refracted", rays.refracted),
        ];
        let kinds = kinds.map(|(name, n)| format!("{} {name}", grouped(n)));
        format!("rays      {}; {:.1} Mrays/s", kinds.join(", "), self.mrays_per_s())
    }

    fn time_line(&self) -> String {
        let s = &self.done.seconds;
        let stages = [
            ("read", s.read),
            ("textures", s.textures),
            ("build", s.build),
            ("render", s.render),
            ("write", s.write),
            ("total", s.total),
        ];
        let textures = self.counts.textures > 0;
        let stages = stages.iter().filter(|&&(name, _)| textures || name != "textures");
        let stages: Vec<String> = stages.map(|&(name, t)| format!("{name} {}", seconds(t))).collect();
        let peak = self.peak_memory.map_or(String::new(), |p| format!("; peak memory {}", bytes(p)));
        format!("time      {}{peak}", stages.join(", "))
    }

    fn camera_line(&self) -> String {
        let CameraDesc { eye, target, up, projection, aperture, focus, .. } = self.camera;
        let projection = match projection {
            Projection::Perspective { fov_deg } => format!("--fov {fov_deg}"),
            Projection::Orthographic { height } => format!("--ortho {height}"),
        };
        let v = |v: glam::DVec3| format!("{},{},{}", v.x, v.y, v.z);
        let focus = focus.filter(|_| aperture > 0.0).map_or(String::new(), |f| format!(" --focus {f}"));
        format!(
            "camera    --eye {} --target {} --up {} {projection} --aperture {aperture}{focus}",
            v(eye),
            v(target),
            v(up)
        )
    }

    fn skipped_line(&self) -> Option<String> {
        let parts: Vec<String> = skipped(self)
            .into_iter()
            .filter(|(name, _)| self.plan.verbose || !skipped::is_detail(name))
            .map(|(name, why)| {
                let name = name.replace('_', " ");
                match why {
                    Skipped::Count(n) => format!("{name}: {}", grouped(n)),
                    Skipped::Because(why) => format!("{name} ({why})"),
                }
            })
            .collect();
        (!parts.is_empty()).then(|| format!("skipped   {}", parts.join(", ")))
    }

    fn error_line(&self) -> String {
        format!("error     {}", certificate(&self.done.stats))
    }
}

/// What is known of how wrong the picture can be.
pub fn certificate(s: &RenderStats) -> String {
    let cut = if s.cut_off_max == 0.0 {
        "nothing cut off".into()
    } else if s.cut_off_is_estimate {
        format!("cut-off estimated to add {:.2e} to a pixel, {:.2e} on average", s.cut_off_max, s.cut_off_mean)
    } else {
        format!("cut-off adds at most {:.2e} to a pixel, {:.2e} on average", s.cut_off_max, s.cut_off_mean)
    };
    let sampling = s.sampling_rmse.map_or(String::new(), |rmse| format!("; sampling about {rmse:.2e} RMSE"));
    format!("{cut}{sampling}; {}", counted(s.non_finite_samples, "non-finite sample"))
}
