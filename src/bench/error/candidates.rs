//! Who renders, and with how many samples.

use super::Options;
use super::subject::Subject;
use crate::backend::BackendKind;
use crate::render::Job;
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
}

/// What tison does unless told otherwise.
pub const OURS: usize = 0;
/// What the others are measured against.
pub const BASELINE: usize = 1;
/// Samples that those get that are only shown beside the first two.
const FEW: u32 = 256;

/// All of them; [`OURS`] and [`BASELINE`] are where they say.
pub fn all(options: &Options) -> Vec<Candidate> {
    let default = BackendKind::COMPILED[0];
    let few = if options.all_to_most { options.most } else { FEW.min(options.most) };
    let of = |name, set: fn(&mut Job)| Candidate { name, backend: default, set, most: few, lens_only: false };
    let of_lens = |name, set| Candidate { lens_only: true, ..of(name, set) };
    let mut all = vec![
        Candidate { most: options.most, ..of("ours, Owen-Sobol", |_| {}) },
        Candidate { most: options.most, ..of("polar", |job| job.lens_sampler = LensSampler::Polar) },
        of_lens("rejection", |job| job.lens_sampler = LensSampler::Rejection),
        of_lens("uniform radius", |job| job.lens_sampler = LensSampler::PolarUniformRadius),
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

    /// Samples a pixel of its pictures: powers of four.
    pub fn levels(&self) -> impl Iterator<Item = u32> + use<> {
        let most = self.most;
        std::iter::successors(Some(1u32), |n| n.checked_mul(4)).take_while(move |&n| n <= most)
    }
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
        assert!(quick[2..].iter().all(|l| *l == [1, 4, 16, 64, 256]));
        assert!(levels(4096, true).iter().all(|l| *l == quick[OURS]));
        assert!(levels(20, false).iter().all(|l| *l == [1, 4, 16]));
    }
}
