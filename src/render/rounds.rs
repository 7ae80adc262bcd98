//! Rounds of sampling: after each, the pixels that need it get twice the samples.

use super::adapt::{self, Choice, FIRST, Goal, Progress};
use super::area::Area;
use super::estimate::{ErrorSum, Twice};
use super::job::{Adapted, Ended, Outcome, Stop};
use super::worker::TileWorker;
use super::{Common, Render, Sum, lock};
use crate::backend::Backend;
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering::Relaxed};
use std::sync::{Mutex, PoisonError};

/// What a round is to leave of the error: the next one knows better where it is.
const STEP: f64 = 0.5;

/// A render in rounds.
pub struct Rounds<'a, B, const SECONDARY: bool> {
    render: &'a Render<'a, B, SECONDARY>,
    common: &'a Common,
    twice: Twice,
    areas: Vec<Mutex<Area>>,
    sum: Mutex<Sum>,
    /// Samples so far.
    samples: AtomicU64,
    /// Finished pixels when it began, and those that this render is about.
    pixels: (u64, u64),
}

/// One look at all pixels between rounds.
struct Look {
    pixels: Vec<Progress>,
    error: ErrorSum,
}

impl<'a, B: Backend, const SECONDARY: bool> Rounds<'a, B, SECONDARY> {
    /// Before the first.
    pub fn new(render: &'a Render<'a, B, SECONDARY>, common: &'a Common, twice: Twice) -> Self {
        let (job, control) = (render.job, render.control);
        let mut areas = Vec::new();
        for &tile in &common.tiles {
            let mut area = Area::default();
            area.become_tile(tile, job, Some(&twice));
            areas.push(Mutex::new(area));
        }
        Self {
            render,
            common,
            twice,
            areas,
            sum: Mutex::new(render.nothing(common)),
            samples: AtomicU64::new(0),
            pixels: (control.pixels.load(Relaxed), job.crop.pixels()),
        }
    }

    /// Samples until the job says that it is enough.
    pub fn run(self) -> Outcome {
        let job = self.render.job;
        let first = if job.time_limit.is_some() { 1 } else { FIRST }.min(job.spp);
        // Nobody knows yet; most pixels of most pictures stop soon.
        let guess = self.pixels.1 * u64::from(first) * 4;
        self.round(guess, |area, worker| area.begin(worker, first, Some(&self.twice)));
        let mut rounds = 1;
        let ended = loop {
            if self.render.control.is_cancelled() {
                break Ended::Stopped;
            }
            if self.is_out_of_time() {
                break Ended::Time;
            }
            let look = self.look();
            let choice = match self.choose(&look) {
                Ok(choice) => choice,
                Err(ended) => break ended,
            };
            let expected = self.samples.load(Relaxed) + choice.expected;
            let goes = |xy| choice.go_on[job.crop.index(xy)];
            self.round(expected, |area, worker| area.go_on(worker, job.spp, &self.twice, goes));
            rounds += 1;
        };
        self.outcome(rounds, ended)
    }

    /// Works on all tiles, on all threads, until done, cancelled or out of time; `expected` are the samples at the end of
    /// all rounds.
    fn round(&self, expected: u64, work: impl Fn(&mut Area, &mut TileWorker<'a, B, SECONDARY>) -> bool + Sync) {
        let next = AtomicUsize::new(0);
        let first = self.samples.load(Relaxed) == 0;
        rayon::broadcast(|_| {
            let mut worker = TileWorker::new(self.render, self.common);
            while !self.render.control.is_cancelled() && (first || !self.is_out_of_time()) {
                let Some(area) = self.areas.get(next.fetch_add(1, Relaxed)) else { break };
                let mut area = lock(area);
                let before = area.samples();
                if !work(&mut area, &mut worker) {
                    break;
                }
                self.samples.fetch_add(area.samples() - before, Relaxed);
                self.tell(expected);
            }
            lock(&self.sum).tally.add(&worker.waves.tally);
        });
    }

    /// Shows how much is done, of samples or of the time: never all, as long as there is a round to come.
    fn tell(&self, expected: u64) {
        let of_samples = self.samples.load(Relaxed) as f64 / expected as f64;
        let limit = self.render.job.time_limit.map(|limit| limit.as_secs_f64());
        let of_time = limit.map_or(0.0, |limit| self.common.started.elapsed().as_secs_f64() / limit);
        let share = of_samples.max(of_time).min(0.99);
        let (before, own) = self.pixels;
        self.render.control.pixels.store(before + (share * own as f64) as u64, Relaxed);
    }

    fn is_out_of_time(&self) -> bool {
        self.render.job.time_limit.is_some_and(|limit| self.common.started.elapsed() >= limit)
    }

    fn look(&self) -> Look {
        let crop = self.render.job.crop;
        let mut look = Look { pixels: vec![Progress::default(); crop.pixels() as usize], error: ErrorSum::default() };
        for area in &self.areas {
            let area = lock(area);
            look.error.merge(&area.error());
            area.progress().for_each(|(xy, progress)| look.pixels[crop.index(xy)] = progress);
        }
        look
    }

    /// The pixels that go on, or why none does.
    fn choose(&self, look: &Look) -> Result<Choice, Ended> {
        let job = self.render.job;
        let rmse = look.error.rmse().unwrap_or(f64::INFINITY);
        let target = if let Stop::Rmse(target) = job.stop { target } else { 0.0 };
        let goal = match job.stop {
            Stop::Noise(threshold) => Goal::Noise(threshold),
            Stop::Rmse(_) | Stop::Count if rmse > target => Goal::Rmse(target.max(STEP * rmse)),
            // Fewer samples may agree by chance.
            _ if look.pixels.iter().all(|p| p.taken >= FIRST.min(job.spp)) => return Err(Ended::Enough),
            _ => Goal::Rmse(target),
        };
        let width = (job.crop.x1 - job.crop.x0) as usize;
        let choice = adapt::choose(&look.pixels, width, job.spp, goal, look.error.factor());
        let quiet = |p: &Progress| matches!(goal, Goal::Noise(threshold) if !p.is_noisy(threshold));
        match choice.go_on.contains(&true) {
            true => Ok(choice),
            false if look.pixels.iter().all(quiet) => Err(Ended::Enough),
            false => Err(Ended::Most),
        }
    }

    fn outcome(self, rounds: u32, ended: Ended) -> Outcome {
        let (job, control) = (self.render.job, self.render.control);
        let mut sum = self.sum.into_inner().unwrap_or_else(PoisonError::into_inner);
        let mut stopped_early = 0;
        for (index, area) in self.areas.into_iter().enumerate() {
            let mut area = area.into_inner().unwrap_or_else(PoisonError::into_inner);
            area.settle();
            area.hand_in::<SECONDARY>(index, job.crop, &mut sum);
            stopped_early += area.progress().filter(|(_, p)| (1..job.spp).contains(&p.taken)).count() as u64;
        }
        control.pixels.store(self.pixels.0 + sum.film.finished as u64, Relaxed);
        self.render.outcome(self.common, sum, Some(Adapted { rounds, ended, stopped_early }))
    }
}
