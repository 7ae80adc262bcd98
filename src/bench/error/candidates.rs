//! Who renders, and with how many samples.

use super::Options;
use super::subject::Subject;
use crate::backend::BackendKind;
use crate::math::Sampler;
use crate::render::{Job, Stop};
use crate::scene::desc::LensSampler;

/// A way to render.
#[derive(Clone, Debug)]
pub struct Candidate {
    /// In tables and legends.
    pub name: &'static str,
    /// Whose rays.
    pub backend: BackendKind,
    /// What it does with a picture of so many samples a pixel.
    pub set: fn(&mut Job),
    /// Most samples a pixel that it gets.
    pub most: u32,
    /// Whether it differs from others by the lens alone: without one it is left out.
    pub lens_only: bool,
    /// Whether it samples until an error is reached.
    pub adaptive: bool,
}

/// What tison does unless told otherwise.
pub const OURS: usize = 0;
/// What the others are measured against: independent random numbers.
pub const BASELINE: usize = 1;
/// Samples that those get that are only shown beside the first.
const FEW: u32 = 256;
/// What who is adaptive aims at, in RMSE, where the others take so many samples a pixel.
const TARGETS: [(u32, f64); 5] = [(16, 1e-2), (64, 4e-3), (256, 2e-3), (1024, 1e-3), (4096, 5e-4)];
/// Most samples that such a pixel gets.
const MOST: u32 = 1 << 16;

/// All of them; [`OURS`] and [`BASELINE`] are where they say.
pub fn all(options: &Options) -> Vec<Candidate> {
    let most = options.most;
    let few = if options.all_to_most { most } else { FEW.min(most) };
    let of = |name, set: fn(&mut Job)| Candidate {
        name,
        backend: BackendKind::COMPILED[0],
        set,
        most: few,
        lens_only: false,
        adaptive: false,
    };
    let of_lens = |name, set| Candidate { lens_only: true, ..of(name, set) };
    let mut all = vec![
        Candidate { most, ..of("ours, Owen-Sobol", |_| {}) },
        Candidate { most, ..of("random", |job| job.sampler = Sampler::Random) },
        Candidate { most, adaptive: true, ..of("ours, adaptive", |_| {}) },
        of("stratified", |job| job.sampler = Sampler::Stratified),
        of_lens("random, rejection", |job| {
            (job.sampler, job.lens_sampler) = (Sampler::Random, LensSampler::Rejection);
        }),
        of_lens("uniform radius (biased)", |job| {
            (job.sampler, job.lens_sampler) = (Sampler::Random, LensSampler::PolarUniformRadius);
        }),
    ];
    all.extend(
        BackendKind::COMPILED.iter().skip(1).map(|&backend| Candidate { backend, ..of("ours, native", |_| {}) }),
    );
    all
}

impl Candidate {
    /// Whether it has anything to show of `subject`.
    pub fn takes_part(&self, subject: &Subject) -> bool {
        !self.lens_only || subject.camera.aperture > 0.0
    }

    /// Samples a pixel of its pictures, or what stands for them: powers of four.
    pub fn levels(&self) -> impl Iterator<Item = u32> + use<> {
        let (most, adaptive) = (self.most, self.adaptive);
        let powers = std::iter::successors(Some(1u32), |n| n.checked_mul(4)).take_while(move |&n| n <= most);
        powers.filter(move |&n| !adaptive || target(n).is_some())
    }

    /// What it aims at on a level, in RMSE.
    pub fn target(&self, level: u32) -> Option<f64> {
        target(level).filter(|_| self.adaptive)
    }

    /// `job` as it does it on a level.
    pub fn job(&self, level: u32, job: Job) -> Job {
        let mut job = match self.target(level) {
            Some(rmse) => Job { spp: MOST, stop: Stop::Rmse(rmse), estimate: true, ..job },
            None => Job { spp: level, ..job },
        };
        (self.set)(&mut job);
        job
    }
}

fn target(level: u32) -> Option<f64> {
    TARGETS.iter().find(|t| t.0 == level).map(|t| t.1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn levels_are_powers_of_four_up_to_the_most() {
        let levels = |most, full| {
            let options = Options { most, all_to_most: full, ..Options::quick(vec![]) };
            all(&options).iter().map(|c| c.levels().collect::<Vec<_>>()).collect::<Vec<_>>()
        };
        let quick = levels(4096, false);
        assert_eq!(quick[OURS], [1, 4, 16, 64, 256, 1024, 4096]);
        assert_eq!(quick[BASELINE], quick[OURS]);
        assert_eq!(quick[2], [16, 64, 256, 1024, 4096], "there is a target for each");
        assert!(quick[3..].iter().all(|l| *l == [1, 4, 16, 64, 256]));
        assert!(levels(4096, true)[3..].iter().all(|l| *l == quick[OURS]));
        assert!(levels(20, false)[3..].iter().all(|l| *l == [1, 4, 16]));
    }

    #[test]
    fn who_is_adaptive_is_given_a_target_and_the_others_a_number() {
        let job = |i: usize| all(&Options::quick(vec![]))[i].job(64, Job::whole((4, 3)));
        assert_eq!((job(OURS).spp, job(OURS).stop, job(OURS).sampler), (64, Stop::Count, Sampler::Sobol));
        assert_eq!((job(BASELINE).spp, job(BASELINE).sampler), (64, Sampler::Random));
        assert_eq!((job(2).spp, job(2).stop), (MOST, Stop::Rmse(4e-3)));
    }
}
