//! Cells of equal area over the unit square, and one point in each.

use super::{hash, mix, unit};

/// As many cells as there are points, in rows. Rows are alike, or differ by one cell; each is as high as it has cells.
#[derive(Clone, Copy, Debug)]
pub struct Strata {
    /// At least 1.
    cells: u32,
    rows: u32,
}

/// The greatest number below 1.
const BELOW_ONE: f64 = 1.0 - f64::EPSILON / 2.0;

impl Strata {
    /// Of `cells` cells, 0 counting as 1: as nearly square as any number of rows between half the square root and the
    /// root that divides them; if none does, rows differ.
    pub fn new(cells: u32) -> Self {
        let cells = cells.max(1);
        let root = cells.isqrt();
        let rows = (root.div_ceil(2).max(2)..=root).rev().find(|&rows| cells.is_multiple_of(rows)).unwrap_or(root);
        Self { cells, rows }
    }

    /// Point `index` of the set that `seed` chooses, in `[0, 1)` squared. Any `cells` in a row that begin at a multiple of
    /// that lie in different cells; their order is random. Their second coordinates, and where all rows are alike the
    /// first ones too, lie in different slices of width `1 / cells`.
    ///
    /// Source: A. Kensler, "Correlated Multi-Jittered Sampling", Pixar Technical Memo 13-01, 2013, section 3; the rows
    /// are ours where the cells are no product.
    pub fn point(self, index: u32, seed: u32) -> [f64; 2] {
        let Self { cells, rows } = self;
        let set = index / cells;
        let seed = if set == 0 { seed } else { hash(seed ^ hash(set)) };
        let cell = permute(index % cells, cells, hash(seed ^ 0x51));
        // The first `long` rows have a cell more.
        let (columns, long) = (cells / rows, cells % rows);
        let in_long = long * (columns + 1);
        let (row, column, columns) = if cell < in_long {
            (cell / (columns + 1), cell % (columns + 1), columns + 1)
        } else {
            (long + (cell - in_long) / columns, (cell - in_long) % columns, columns)
        };
        let jitter = mix(u64::from(seed) << 32 | u64::from(cell));
        let (jx, jy) = (unit((jitter >> 32) as u32), unit(jitter as u32));
        // Each row shifts its points to another part of their columns, each column to another part of its rows.
        let part_x = permute(row, rows, hash(seed ^ 0xa5));
        let part_y = permute(column, columns, hash(seed ^ 0x63));
        let x = (f64::from(column) + (f64::from(part_x) + jx) / f64::from(rows)) / f64::from(columns);
        let y = (f64::from(cell - column + part_y) + jy) / f64::from(cells);
        [x, y].map(|v| v.min(BELOW_ONE))
    }
}

/// Where `i` goes in the permutation of the numbers below `len` that `seed` chooses.
///
/// Bijections of the next power of two, repeated until the result is below `len`.
///
/// Source: A. Kensler, as above, listing 3. There the last step adds `seed` in 32 bits, and if that overflows two numbers
/// may meet; here it cannot.
fn permute(mut i: u32, len: u32, seed: u32) -> u32 {
    let mask = u32::MAX.checked_shr((len - 1).leading_zeros()).unwrap_or(0);
    loop {
        i = (i ^ seed).wrapping_mul(0xe170_893d);
        i ^= seed >> 16;
        i ^= (i & mask) >> 4;
        i = (i ^ seed >> 8).wrapping_mul(0x0929_eb3f);
        i ^= seed >> 23;
        i = (i ^ (i & mask) >> 1).wrapping_mul(1 | seed >> 27);
        i = i.wrapping_mul(0x6935_fa69);
        i = (i ^ (i & mask) >> 11).wrapping_mul(0x74dc_b303);
        i = (i ^ (i & mask) >> 2).wrapping_mul(0x9e50_1cc3);
        i = (i ^ (i & mask) >> 2).wrapping_mul(0xc860_a3df);
        i &= mask;
        i ^= i >> 5;
        if i < len {
            return ((u64::from(i) + u64::from(seed)) % u64::from(len)) as u32;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashSet;

    #[test]
    fn every_number_has_its_place() {
        for len in (1..70).chain([255, 256, 257, 4099]) {
            for seed in [0, 1, 0x1234_5678, u32::MAX - 1, u32::MAX] {
                let places: HashSet<u32> = (0..len).map(|i| permute(i, len, seed)).collect();
                assert!(places.len() == len as usize && places.iter().all(|&i| i < len), "{len}, seed {seed}");
            }
        }
        assert!(permute(u32::MAX - 1, u32::MAX, 5) < u32::MAX);
    }

    /// Number of the cell that a point lies in, found from its coordinates alone.
    fn cell_of(strata: Strata, [x, y]: [f64; 2]) -> u32 {
        let Strata { cells, rows } = strata;
        let mut start = 0;
        for row in 0..rows {
            let columns = cells / rows + u32::from(row < cells % rows);
            if y * f64::from(cells) < f64::from(start + columns) {
                return start + (x * f64::from(columns)) as u32;
            }
            start += columns;
        }
        panic!("{y} is above all rows")
    }

    fn all_different(mut numbers: Vec<u32>, count: u32) -> bool {
        numbers.sort_unstable();
        numbers.into_iter().eq(0..count)
    }

    #[test]
    fn any_number_of_points_has_one_in_each_cell() {
        for cells in (1..70).chain([97, 100, 128, 1009, 4096]) {
            let strata = Strata::new(cells);
            for (seed, first) in [(1, 0), (2, 0), (3, 5 * cells)] {
                let points: Vec<_> = (first..first + cells).map(|i| strata.point(i, hash(seed))).collect();
                assert!(points.iter().flatten().all(|v| (0.0..1.0).contains(v)), "{cells}");
                assert!(all_different(points.iter().map(|&p| cell_of(strata, p)).collect(), cells), "{cells}");
                let slices = |axis: usize| points.iter().map(|p| (p[axis] * f64::from(cells)) as u32).collect();
                assert!(all_different(slices(1), cells), "{cells}: rows");
                if cells.is_multiple_of(strata.rows) {
                    assert!(all_different(slices(0), cells), "{cells}: columns");
                }
            }
            assert!(
                (1..1000).all(|i| strata.point(i, 9) != strata.point(i + cells, 9)),
                "{cells}: the next set is new"
            );
        }
    }

    #[test]
    fn cells_are_nearly_square() {
        let rows = |cells| Strata::new(cells).rows;
        for (cells, want) in
            [(0, 1), (1, 1), (2, 1), (3, 1), (7, 2), (8, 2), (16, 4), (30, 5), (32, 4), (97, 9), (4096, 64)]
        {
            assert_eq!(rows(cells), want, "{cells}");
        }
        let [x, y] = Strata::new(u32::MAX).point(u32::MAX - 1, 3);
        assert!((0.0..1.0).contains(&x) && (0.0..1.0).contains(&y));
    }
}
