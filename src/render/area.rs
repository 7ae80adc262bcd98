//! A tile with the samples of its pixels.

use super::adapt::{FIRST, Progress};
use super::estimate::{ErrorSum, Twice};
use super::job::Crop;
use super::tile;
use super::worker::{Pixels, TileWorker};
use super::{Job, Sum};
use crate::backend::Backend;

/// A tile and what is known of its pixels.
#[derive(Debug, Default)]
pub struct Area {
    tile: Crop,
    pixels: Pixels,
    /// Their colours as the film has them: row by row.
    rows: Vec<[f32; 3]>,
    /// Places in `pixels` of those that are sampled twice.
    twice: Vec<usize>,
    /// Their second samples.
    again: Pixels,
    /// Whether all pixels have samples.
    is_begun: bool,
}

impl Area {
    /// Forgets what it was and becomes `tile`, without samples.
    pub fn become_tile(&mut self, tile: Crop, job: &Job, twice: Option<&Twice>) {
        self.tile = tile;
        tile::pixels(tile, &mut self.pixels.at);
        self.pixels.start(job.gathers_hits(), job.spp == 1 && twice.is_none());
        self.twice.clear();
        self.again.clear();
        if let Some(twice) = twice {
            self.twice.extend((0..self.pixels.at.len()).filter(|&i| twice.is(self.pixels.at[i])));
            self.again.at.extend(self.twice.iter().map(|&i| self.pixels.at[i]));
            self.again.start(false, false);
        }
        self.is_begun = false;
    }

    /// Takes the first samples of all pixels. Whether that was finished; if not, there are none.
    pub fn begin<B: Backend, const SECONDARY: bool>(
        &mut self,
        worker: &mut TileWorker<'_, B, SECONDARY>,
        samples: u32,
        twice: Option<&Twice>,
    ) -> bool {
        self.is_begun = worker.sample(&mut self.pixels, 0..samples)
            && twice.is_none_or(|twice| worker.sample_again(&mut self.again, 0..samples, twice));
        self.is_begun
    }

    /// Takes as many samples again of the pixels that `go_on`, up to `most`. Whether that was finished; if not, none is taken.
    pub fn go_on<B: Backend, const SECONDARY: bool>(
        &mut self,
        worker: &mut TileWorker<'_, B, SECONDARY>,
        most: u32,
        twice: &Twice,
        go_on: impl Fn((u32, u32)) -> bool,
    ) -> bool {
        let mut places: Vec<usize> = (0..self.pixels.at.len()).filter(|&i| go_on(self.pixels.at[i])).collect();
        // Those of one count go together; the sort keeps their order.
        places.sort_by_key(|&i| self.pixels.sums[i].taken);
        let mut done = Vec::new();
        for places in places.chunk_by(|&a, &b| self.pixels.sums[a].taken == self.pixels.sums[b].taken) {
            let taken = self.pixels.sums[places[0]].taken;
            let samples = taken..taken.saturating_mul(2).max(FIRST).min(most);
            let again: Vec<usize> =
                (0..self.twice.len()).filter(|&k| places.binary_search(&self.twice[k]).is_ok()).collect();
            let (mut first, mut second) = (self.pixels.of(places), self.again.of(&again));
            let whole = worker.sample(&mut first, samples.clone()) && worker.sample_again(&mut second, samples, twice);
            if !whole {
                return false;
            }
            done.push((places.to_vec(), first, again, second));
        }
        for (places, first, again, second) in done {
            first.give_back(&places, &mut self.pixels);
            second.give_back(&again, &mut self.again);
        }
        true
    }

    /// Samples taken for the picture.
    pub fn samples(&self) -> u64 {
        self.pixels.sums.iter().map(|pixel| u64::from(pixel.taken)).sum()
    }

    /// Adds up its errors.
    pub fn error(&self) -> ErrorSum {
        let mut sum = ErrorSum::default();
        if self.is_begun {
            self.pixels.sums.iter().for_each(|pixel| sum.add(pixel));
            self.twice.iter().zip(&self.again.sums).for_each(|(&i, again)| sum.add_pair(&self.pixels.sums[i], again));
        }
        sum
    }

    /// How far its pixels are, with their places.
    pub fn progress(&self) -> impl Iterator<Item = ((u32, u32), Progress)> {
        self.pixels.at.iter().copied().zip(self.pixels.sums.iter().map(Progress::of))
    }

    /// Puts its colours into the film's order, which nobody has to wait for.
    pub fn settle(&mut self) {
        let (tile, Pixels { at, sums, lone, .. }) = (self.tile, &self.pixels);
        self.rows.resize(at.len(), [0.0; 3]);
        match lone {
            Some(lone) => at.iter().zip(&lone.color).for_each(|(&xy, color)| self.rows[tile.index(xy)] = *color),
            None => at.iter().zip(sums).for_each(|(&xy, sum)| {
                self.rows[tile.index(xy)] = sum.mean().as_vec3().to_array();
            }),
        }
    }

    /// Puts it into the film, if it has been begun and [settled](Self::settle); the number of pixels.
    pub fn hand_in<const SECONDARY: bool>(&self, index: usize, crop: Crop, sum: &mut Sum) -> usize {
        if !self.is_begun {
            return 0;
        }
        let (tile, width) = (self.tile, (self.tile.x1 - self.tile.x0) as usize);
        for (y, row) in (tile.y0..tile.y1).zip(self.rows.chunks_exact(width)) {
            sum.film.color[crop.index((tile.x0, y))..][..width].copy_from_slice(row);
        }
        match &self.pixels.lone {
            Some(lone) => {
                sum.samples += lone.color.len() as u64;
                sum.non_finite += lone.non_finite;
                sum.note_cut(index, lone.cut.iter().copied());
            }
            None => {
                let sums = &self.pixels.sums;
                for pixel in sums {
                    sum.samples += u64::from(pixel.taken);
                    sum.non_finite += u64::from(pixel.taken - pixel.counted);
                }
                if SECONDARY {
                    sum.note_cut(index, sums.iter().map(|pixel| pixel.cut.map(|c| c / f64::from(pixel.taken))));
                }
            }
        }
        if let Some(error) = sum.error_of_tile.get_mut(index) {
            *error = self.error();
        }
        for (i, hits) in self.pixels.hits.iter().enumerate() {
            let taken = self.pixels.sums.get(i).map_or(1, |sum| sum.taken);
            let at = crop.index(self.pixels.at[i]);
            sum.film.aovs.iter_mut().for_each(|image| hits.write(image, at, taken));
        }
        let pixels = self.pixels.at.len();
        sum.film.finished += pixels;
        pixels
    }
}
