//! Pictures of candidates, the seconds that they take, and how far they are from the reference.

use super::candidates::{BASELINE, Candidate, OURS};
use super::reference::{Reference, is_lost, without_noise};
use super::subject::Subject;
use super::{Options, Progress};
use crate::bench::cost::median;
use crate::film::{Encoding, Film, Picture};
use crate::metrics::{self, PIXELS_PER_DEGREE};
use crate::render::{self, Job, Outcome, RenderStats};

/// Samples a pixel of the pictures that are kept for people to look at.
pub const SHOWN: [u32; 2] = [16, 256];
/// Seconds below which a picture is rendered again to time it, and how often at most.
const TOO_SHORT: f64 = 0.02;
const MOST_TIMES: usize = 5;
/// Samples of the pictures that nobody looks at.
const FIRST: u32 = 16;

/// What came of one candidate at one number of samples: medians over the seeds.
#[derive(Clone, Copy, Debug)]
pub struct Point {
    /// Samples a pixel; where they differ the mean, with the share that the estimate of the error adds.
    pub spp: f64,
    /// What it aimed at, in RMSE.
    pub target: Option<f64>,
    /// Of the render loop.
    pub seconds: f64,
    /// As measured, with the reference's noise in it.
    pub rmse_measured: f64,
    /// Without.
    pub rmse: f64,
    /// Whether it is less than that noise: then it says little.
    pub is_lost: bool,
    /// Of the smooth pixels, without the reference's noise; NaN where there are none.
    pub rmse_smooth: f64,
    /// Whether that is less than the noise there.
    pub smooth_is_lost: bool,
    /// The other figures are as measured.
    pub relmse: f64,
    pub relmse_trimmed: f64,
    pub smape: f64,
    pub max: f64,
    pub beyond_1_255: f64,
    /// Mean, as sRGB.
    pub flip: f64,
    /// As sRGB; NaN where the picture is too small for it.
    pub ssim: f64,
}

impl Point {
    /// Inverse of squared error times seconds: twice as much is as good in half the time.
    pub fn efficiency(&self) -> f64 {
        1.0 / (self.rmse * self.rmse * self.seconds)
    }
}

/// A candidate and what came of it, few samples first.
#[derive(Clone, Debug)]
pub struct Curve {
    pub candidate: Candidate,
    pub points: Vec<Point>,
}

/// What is shown of a candidate.
#[derive(Clone, Debug)]
pub struct Shown {
    pub name: &'static str,
    pub spp: u32,
    pub film: Film,
}

/// All that was measured of a scene.
#[derive(Clone, Debug, Default)]
pub struct Measured {
    /// In the order of the candidates.
    pub curves: Vec<Curve>,
    /// Of the first seed.
    pub shown: Vec<Shown>,
}

impl Measured {
    /// Renders everything. Candidates take turns at each number of samples, few samples first: who is interrupted has
    /// told as much about one as about the other, and what else the machine does hits all of them.
    ///
    /// # Errors
    /// A sentence, if the camera cannot be used.
    pub fn all(
        subject: &Subject,
        reference: &Reference,
        candidates: &[Candidate],
        options: &Options,
        progress: &Progress<'_>,
    ) -> Result<Self, String> {
        let curve = |c: &Candidate| Curve { candidate: c.clone(), points: Vec::new() };
        let mut all = Self { curves: candidates.iter().map(curve).collect(), shown: Vec::new() };
        let run = Run { subject, reference, progress };
        run.warm_up(candidates)?;
        let mut levels: Vec<u32> = candidates.iter().flat_map(Candidate::levels).collect();
        levels.sort_unstable();
        levels.dedup();
        for spp in levels {
            let taking_part = |i: &usize| candidates[*i].levels().any(|level| level == spp);
            let who: Vec<usize> = (0..candidates.len()).filter(taking_part).collect();
            let Some(found) = run.level(candidates, &who, spp, options.seeds.max(1))? else { return Ok(all) };
            for (&i, seeds) in who.iter().zip(found) {
                let figures: Vec<Figures> = seeds.iter().map(|s| s.figures).collect();
                all.curves[i].points.push(run.point(candidates[i].target(spp), &figures));
                if let (true, Some(seed)) =
                    (SHOWN.contains(&spp) && [OURS, BASELINE].contains(&i), seeds.into_iter().next())
                {
                    all.shown.push(Shown { name: candidates[i].name, spp, film: seed.film });
                }
            }
        }
        Ok(all)
    }

    /// Whether there is nothing to tell.
    pub fn is_empty(&self) -> bool {
        self.curves.iter().all(|c| c.points.is_empty())
    }
}

/// All samples of a picture, with as many more as the rays that only estimate its error are.
fn samples(stats: &RenderStats) -> f64 {
    let more = stats.rays_for_estimate as f64 / stats.rays.total() as f64;
    stats.samples as f64 * (1.0 + more)
}

/// What is measured of one picture.
#[derive(Clone, Copy, Debug)]
struct Figures {
    spp: f64,
    seconds: f64,
    rmse: f64,
    rmse_smooth: f64,
    relmse: f64,
    relmse_trimmed: f64,
    smape: f64,
    max: f64,
    beyond_1_255: f64,
    flip: f64,
    ssim: f64,
}

struct OfSeed {
    figures: Figures,
    film: Film,
}

struct Run<'a> {
    subject: &'a Subject,
    reference: &'a Reference,
    progress: &'a Progress<'a>,
}

impl Run<'_> {
    /// Caches, and threads that sleep.
    fn warm_up(&self, candidates: &[Candidate]) -> Result<(), String> {
        for candidate in candidates {
            self.picture(candidate, &self.job(candidate, FIRST, 0))?;
        }
        Ok(())
    }

    /// For each of those who take part a picture of each seed; nothing if it was stopped.
    fn level(
        &self,
        candidates: &[Candidate],
        who: &[usize],
        spp: u32,
        seeds: u32,
    ) -> Result<Option<Vec<Vec<OfSeed>>>, String> {
        let mut found: Vec<Vec<OfSeed>> = who.iter().map(|_| Vec::new()).collect();
        for seed in 1..=seeds {
            for (&i, found) in who.iter().zip(&mut found) {
                self.progress.begin(self.subject.pixels(), spp);
                let job = self.job(&candidates[i], spp, seed);
                let Some(outcome) = self.picture(&candidates[i], &job)? else { return Ok(None) };
                found.push(self.measured(outcome));
            }
        }
        Ok(Some(found))
    }

    fn job(&self, candidate: &Candidate, spp: u32, seed: u32) -> Job {
        candidate.job(spp, Job { seed, ..self.subject.job.clone() })
    }

    /// A finished picture with the median of its times; nothing if it was stopped.
    fn picture(&self, candidate: &Candidate, job: &Job) -> Result<Option<Outcome>, String> {
        let Subject { scene, camera, .. } = self.subject;
        let backend = self.subject.backend(candidate.backend);
        let mut seconds = Vec::new();
        loop {
            let mut outcome = render::run(scene, camera, backend, job, self.progress.watch.control)?;
            if self.progress.watch.control.is_cancelled() {
                return Ok(None);
            }
            seconds.push(outcome.stats.seconds);
            if seconds.len() == MOST_TIMES || seconds.iter().sum::<f64>() > TOO_SHORT {
                outcome.stats.seconds = median(seconds);
                return Ok(Some(outcome));
            }
        }
    }

    fn measured(&self, Outcome { film, stats }: Outcome) -> OfSeed {
        let (width, height) = (film.width, film.height);
        let picture =
            Picture { width, height, encoding: Encoding::Linear, pixels: film.color.clone(), transparent: false };
        let report = metrics::compare(&picture, &self.reference.picture, PIXELS_PER_DEGREE)
            .expect("they are of one size, and the eye's field is the usual one");
        let v = report.values;
        let figures = Figures {
            spp: samples(&stats) / self.subject.pixels() as f64,
            seconds: stats.seconds,
            rmse: v.rmse,
            rmse_smooth: self.reference.rmse_of_smooth(&film),
            relmse: v.relmse,
            relmse_trimmed: v.relmse_trimmed,
            smape: v.smape,
            max: v.max,
            beyond_1_255: v.beyond_1_255,
            flip: report.flip.mean,
            ssim: report.ssim.unwrap_or(f64::NAN),
        };
        OfSeed { figures, film }
    }

    fn point(&self, target: Option<f64>, seeds: &[Figures]) -> Point {
        let of = |f: fn(&Figures) -> f64| median(seeds.iter().map(f).collect());
        let (noise, noise_smooth) = (self.reference.noise, self.reference.noise_smooth);
        let (rmse, smooth) = (of(|f| f.rmse), of(|f| f.rmse_smooth));
        Point {
            spp: of(|f| f.spp),
            target,
            seconds: of(|f| f.seconds),
            rmse_measured: rmse,
            rmse: without_noise(rmse, noise),
            is_lost: is_lost(rmse, noise),
            rmse_smooth: without_noise(smooth, noise_smooth),
            smooth_is_lost: is_lost(smooth, noise_smooth),
            relmse: of(|f| f.relmse),
            relmse_trimmed: of(|f| f.relmse_trimmed),
            smape: of(|f| f.smape),
            max: of(|f| f.max),
            beyond_1_255: of(|f| f.beyond_1_255),
            flip: of(|f| f.flip),
            ssim: of(|f| f.ssim),
        }
    }
}
