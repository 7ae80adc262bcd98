//! What decides the pixels, settled: a flag wins over the scene file, which wins over the default.

use super::args::PictureArgs;
use super::exit::Failure;
use super::frame::Frame;
use super::plan::{Input, Plan};
use std::fmt;
use tison::film::{Display, Tonemap};
use tison::math::{Filter, Sampler};
use tison::render::{Job, Stop};
use tison::scene::desc::{LensSampler, RenderDesc};

/// Who says what a setting is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Origin {
    /// A flag of its own.
    Flag,
    /// A key of the scene file, set by `-D`.
    Define,
    /// The scene file.
    Scene,
    /// Nobody.
    Default,
}

impl fmt::Display for Origin {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::Flag => "flag",
            Self::Define => "-D",
            Self::Scene => "scene file",
            Self::Default => "default",
        })
    }
}

/// A setting as `--print-config` shows it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Setting {
    pub name: &'static str,
    pub value: String,
    pub origin: Origin,
}

/// The picture, settled but for the camera.
#[derive(Clone, Debug)]
pub struct Settings {
    pub job: Job,
    /// Tell about this pixel only.
    pub pixel: Option<(u32, u32)>,
    /// How 8-bit formats show it; the range of depths is the camera's to say.
    pub display: Display,
    /// Size that the scene file was written for.
    pub scene_size: Option<(u32, u32)>,
    /// Where it all comes from.
    pub list: Vec<Setting>,
}

/// Size of an image where nobody says it.
pub const SIZE: (u64, u64) = (1280, 720);
const RECURSION: u32 = 8;
const SPP_OF_A_MESH: u32 = 1;
const SPP_OF_A_SCENE: u32 = 16;
/// Samples that a pixel gets at most where something else says when it is enough.
const MOST_SPP: u32 = 1 << 16;
const MIN_WEIGHT: f32 = 1.0 / 1024.0;
/// The whole pixel.
const JITTER_RADIUS: f64 = 0.5;

impl Settings {
    /// Settles what the flags of `plan` leave open by what the scene file says.
    pub fn new(plan: &Plan, render: &RenderDesc) -> Result<Self, Failure> {
        let flags = &plan.picture;
        let mut all = Choices { defines: &plan.defines, list: Vec::new() };
        let wide = |(w, h): (u32, u32)| (u64::from(w), u64::from(h));
        let size = all.size(flags, render.size.map(wide));
        let frame = Frame::new(flags, size)?;
        let spp = match plan.kind {
            Input::Mesh => SPP_OF_A_MESH,
            Input::Scene => SPP_OF_A_SCENE,
        };
        let spp = match flags.stops_by_itself() {
            true => all.choose("spp", "render.samples", flags.spp, None, MOST_SPP),
            false => all.choose("spp", "render.samples", flags.spp, render.samples, spp),
        };
        let stop = all.stop(flags);
        let k_max = all.choose("recursion", "render.recursion", flags.recursion, render.recursion, RECURSION);
        let min_weight = all.choose("min-weight", "render.min_weight", flags.min_weight, render.min_weight, MIN_WEIGHT);
        let seed = all.choose("seed", "render.seed", flags.seed, render.seed, 0);
        let jitter_radius =
            all.choose("jitter-radius", "render.jitter_radius", None, render.jitter_radius, JITTER_RADIUS);
        let course = render.course_rules;
        let light_samples = render.samples.filter(|_| course);
        let light_samples = all.choose("light-samples", "render.samples", flags.light_samples, light_samples, 1);
        let filter = all.filter(flags, render, spp)?;
        let sampler = (flags.sampler, render.sampler);
        let sampler = all.by_name("sampler", "render.sampler", sampler, Sampler::default(), Sampler::name);
        let lens_sampler = (flags.lens_sampler, render.lens_sampler);
        let lens_sampler =
            all.by_name("lens-sampler", "render.lens_sampler", lens_sampler, LensSampler::default(), LensSampler::name);
        let tonemap = all.tonemap(flags, course);
        let exposure = all.choose("exposure", "", flags.exposure, None, 0.0);
        all.switch("centre", flags.centre);
        all.switch("no-error-estimate", flags.no_error_estimate);
        let job = Job {
            size: frame.size,
            crop: frame.crop,
            spp,
            stop,
            time_limit: flags.time_limit,
            estimate: spp > 1 && !flags.no_error_estimate,
            seed,
            k_max,
            min_weight,
            centre: flags.centre,
            filter,
            sampler,
            lens_sampler,
            jitter_radius,
            light_samples,
            aovs: plan.aovs.clone(),
            skips: plan.skips,
        };
        let display = Display { tonemap, exposure, depth_range: None };
        let settings = Self { job, pixel: frame.pixel, display, scene_size: render.size, list: all.list };
        settings.refuse_what_does_nothing(flags)?;
        Ok(settings)
    }

    fn refuse_what_does_nothing(&self, flags: &PictureArgs) -> Result<(), Failure> {
        if self.job.centre && self.job.spp > 1 {
            let what = match flags.spp {
                Some(spp) => format!("--centre is for one sample a pixel, not for --spp {spp}"),
                None => format!("--centre is for one sample a pixel, but there are {}; add --spp 1", self.job.spp),
            };
            return Err(Failure::usage(what).help("several samples are spread over the pixel in any case"));
        }
        if matches!(self.job.stop, Stop::Noise(_)) && self.job.spp <= Job::FIRST_SPP {
            let (first, spp) = (Job::FIRST_SPP, self.job.spp);
            let what = format!("--adaptive changes nothing: {first} samples come first, and --spp is {spp}");
            return Err(Failure::usage(what).help("name the most that a pixel may get, like --spp 256"));
        }
        if self.job.sampler == Sampler::Stratified && self.job.is_adaptive() {
            let what = "the sampler stratified has to know the number of samples, which is to be found here";
            return Err(Failure::usage(what).help("use --sampler sobol or random, or a plain --spp"));
        }
        if flags.exposure.is_some() && self.display.tonemap == Tonemap::Stretch {
            return Err(Failure::usage("--exposure changes nothing where the image is stretched to its own range")
                .help("leave it out, or choose another curve with --tonemap"));
        }
        Ok(())
    }
}

/// Who says what, noted on the way.
struct Choices<'a> {
    defines: &'a [String],
    list: Vec<Setting>,
}

impl Choices<'_> {
    /// `key` is the setting's place in the scene file.
    fn choose<T: fmt::Display>(
        &mut self,
        name: &'static str,
        key: &str,
        flag: Option<T>,
        scene: Option<T>,
        default: T,
    ) -> T {
        let (value, origin) = match (flag, scene) {
            (Some(value), _) => (value, Origin::Flag),
            (None, Some(value)) => (value, origin_in_scene(self.defines, key)),
            (None, None) => (default, Origin::Default),
        };
        self.list.push(Setting { name, value: value.to_string(), origin });
        value
    }

    fn size(&mut self, flags: &PictureArgs, scene: Option<(u64, u64)>) -> (u64, u64) {
        let value = flags.size.or(scene).unwrap_or(SIZE);
        let text = |(w, h): (u64, u64)| format!("{w}x{h}");
        self.choose("size", "render.size", flags.size.map(text), scene.map(text), text(SIZE));
        if let Some(scale) = flags.scale {
            self.list.push(Setting { name: "scale", value: scale.to_string(), origin: Origin::Flag });
        }
        value
    }

    /// When pixels have enough samples.
    fn stop(&mut self, flags: &PictureArgs) -> Stop {
        let given = |name, value: Option<f64>| {
            value.map(|value| Setting { name, value: value.to_string(), origin: Origin::Flag })
        };
        self.list.extend(given("adaptive", flags.adaptive));
        self.list.extend(given("target-error", flags.target_error));
        self.list.extend(given("time-limit", flags.time_limit.map(|limit| limit.as_secs_f64())));
        match (flags.adaptive, flags.target_error) {
            (Some(threshold), _) => Stop::Noise(threshold),
            (None, Some(target)) => Stop::Rmse(target),
            (None, None) => Stop::Count,
        }
    }

    /// A choice that is shown by its name; `said` is what the flag and the scene say.
    fn by_name<T: Copy>(
        &mut self,
        name: &'static str,
        key: &str,
        said: (Option<T>, Option<T>),
        default: T,
        text: fn(T) -> &'static str,
    ) -> T {
        self.choose(name, key, said.0.map(text), said.1.map(text), text(default));
        said.0.or(said.1).unwrap_or(default)
    }

    /// Course scenes, and those that say how wide the box is, keep the box. A lone sample is not spread.
    fn filter(&mut self, flags: &PictureArgs, render: &RenderDesc, spp: u32) -> Result<Filter, Failure> {
        if let Some(filter) = flags.filter.filter(|&f| f != Filter::Box) {
            let name = filter.name();
            if render.jitter_radius.is_some() {
                let what = format!("--filter {name} has a width of its own, but the scene sets jitter_radius");
                return Err(
                    Failure::usage(what).help("leave one of the two out; jitter_radius is the width of the box")
                );
            }
            if spp == 1 {
                let what = format!("--filter {name} changes nothing with one sample a pixel");
                return Err(Failure::usage(what).help("leave it out, or add --spp 16"));
            }
        }
        let (key, scene) = match render {
            RenderDesc { jitter_radius: Some(_), .. } => ("render.jitter_radius", Some(Filter::Box)),
            RenderDesc { filter: None, course_rules: true, .. } => ("render.course_rules", Some(Filter::Box)),
            _ => ("render.filter", render.filter),
        };
        let default = if spp == 1 { Filter::Box } else { Filter::BlackmanHarris };
        Ok(self.by_name("filter", key, (flags.filter, scene), default, Filter::name))
    }

    /// Course scenes are shown as the course's program shows them.
    fn tonemap(&mut self, flags: &PictureArgs, course: bool) -> Tonemap {
        let said = (flags.tonemap, course.then_some(Tonemap::Stretch));
        self.by_name("tonemap", "render.course_rules", said, Tonemap::default(), Tonemap::name)
    }

    fn switch(&mut self, name: &'static str, given: bool) {
        let (value, origin) = if given { ("yes", Origin::Flag) } else { ("no", Origin::Default) };
        self.list.push(Setting { name, value: value.into(), origin });
    }
}

/// Whether what the scene says at `key` was said by a `-D`.
pub fn origin_in_scene(defines: &[String], key: &str) -> Origin {
    let covers = |define: &String| {
        let path = define.split_once('=').map_or("", |(path, _)| path.trim());
        let below = |a: &str, b: &str| a.strip_prefix(b).is_some_and(|rest| rest.is_empty() || rest.starts_with('.'));
        below(path, key) || below(key, path)
    };
    if !key.is_empty() && defines.iter().any(covers) { Origin::Define } else { Origin::Scene }
}

#[cfg(test)]
mod tests;
