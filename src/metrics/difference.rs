//! How two films of the same size differ, as a film.

use super::values::{self, Values};
use crate::film::{Encoding, Film};
use rayon::prelude::*;

/// The difference of two films.
#[derive(Clone, Debug)]
pub struct Difference {
    /// Absolute differences of the linear colours, channel by channel.
    pub image: Film,
    /// The figures of them.
    pub values: Values,
}

impl Difference {
    /// Compares the colours of two films.
    ///
    /// # Panics
    /// If they are not of the same size.
    #[must_use]
    pub fn of(a: &Film, b: &Film) -> Self {
        assert_eq!((a.width, a.height), (b.width, b.height), "only films of the same size can be compared");
        let pairs = a.color.par_iter().zip(&b.color);
        let color: Vec<[f32; 3]> =
            pairs.map(|(a, b)| std::array::from_fn(|channel| (a[channel] - b[channel]).abs())).collect();
        let (values, _) = values::of(&a.color, &b.color, a.width, Encoding::Linear);
        let finished = color.len();
        let image = Film { width: a.width, height: a.height, color, aovs: Vec::new(), finished };
        Self { image, values }
    }

    /// The image with its largest value at 1, and what it was multiplied by; as it is where there is no difference.
    #[must_use]
    pub fn scaled(&self) -> (Film, f64) {
        if self.values.max == 0.0 {
            return (self.image.clone(), 1.0);
        }
        let scale = 1.0 / self.values.max;
        let mut image = self.image.clone();
        image.color.par_iter_mut().for_each(|c| *c = c.map(|x| (f64::from(x) * scale) as f32));
        (image, scale)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn film(color: &[[f32; 3]]) -> Film {
        Film { width: color.len() as u32, height: 1, color: color.to_vec(), aovs: vec![], finished: color.len() }
    }

    #[test]
    fn differences_by_hand() {
        let a = film(&[[0.5, 0.0, 1.0], [0.25; 3]]);
        let b = film(&[[0.25, 0.0, 1.5], [0.25; 3]]);
        let d = Difference::of(&a, &b);
        assert_eq!(d.image.color, [[0.25, 0.0, 0.5], [0.0; 3]]);
        assert_eq!((d.values.differing, d.values.max), (1, 0.5));
        assert!((d.values.rmse - ((0.0625f64 + 0.25) / 6.0).sqrt()).abs() < 1e-15);
        let (scaled, scale) = d.scaled();
        assert_eq!((scaled.color[0], scale), ([0.5, 0.0, 1.0], 2.0));
        let none = Difference::of(&a, &a);
        assert_eq!((none.values.differing, none.values.rmse, none.values.max, none.scaled().1), (0, 0.0, 0.0, 1.0));
    }
}
