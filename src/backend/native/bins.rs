//! What the builder counts with: boxes with numbers, and bins along the three axes.

use crate::geom::Bounds;
use glam::{BVec4A, Vec3, Vec4};

/// Most bins per axis.
pub(super) const BINS: usize = 16;

const XYZ: BVec4A = BVec4A::new(true, true, true, false);

/// `hi.w` of an item that shares leaves, and of a box around nothing but such.
const SHARES: f32 = 0.0;

/// `hi.w` of an item that has a leaf to itself. It goes up into all boxes around the item.
const APART: f32 = 1.0;

/// No box reaches farther, so that sums and differences of its sides are finite.
const FARTHEST: f64 = 1e37;

/// Box and number of one thing, while the tree is built.
#[derive(Clone, Copy)]
pub(super) struct Item {
    /// x, y, z and the bits of the number.
    lo_id: Vec4,
    /// x, y, z and [`SHARES`] or [`APART`].
    pub(super) hi: Vec4,
}

impl Item {
    pub(super) fn triangle(corners: [Vec3; 3], id: u32) -> Self {
        let [a, b, c] = corners;
        Self { lo_id: a.min(b).min(c).extend(f32::from_bits(id)), hi: a.max(b).max(c).extend(SHARES) }
    }

    /// Something with a leaf to itself. Beyond 1e37 nothing is sure to be hit.
    pub(super) fn apart(bounds: &Bounds, id: u32) -> Self {
        let side = |x: f64, far: f64| if x.is_nan() { far } else { x.clamp(-FARTHEST, FARTHEST) };
        let lo = bounds.lo.map(|x| side(x, -FARTHEST)).as_vec3();
        let hi = bounds.hi.map(|x| side(x, FARTHEST)).as_vec3();
        Self { lo_id: lo.map(f32::next_down).extend(f32::from_bits(id)), hi: hi.map(f32::next_up).extend(APART) }
    }

    /// Whether it has a leaf to itself.
    pub(super) fn is_apart(&self) -> bool {
        self.hi.w == APART
    }

    #[inline]
    pub(super) fn lo(&self) -> Vec4 {
        Vec4::select(XYZ, self.lo_id, Vec4::ZERO)
    }

    #[inline]
    pub(super) fn id(&self) -> u32 {
        self.lo_id.w.to_bits()
    }

    /// Twice the middle of the box.
    #[inline]
    pub(super) fn centroid(&self) -> Vec4 {
        self.lo() + self.hi
    }
}

/// A box in f32. `hi.w` is that of the items in it.
#[derive(Clone, Copy)]
pub(super) struct Box4 {
    pub(super) lo: Vec4,
    pub(super) hi: Vec4,
}

impl Box4 {
    pub(super) const EMPTY: Self = Self { lo: Vec4::INFINITY, hi: Vec4::NEG_INFINITY };

    #[inline]
    pub(super) fn grow(&mut self, lo: Vec4, hi: Vec4) {
        self.lo = self.lo.min(lo);
        self.hi = self.hi.max(hi);
    }

    #[inline]
    pub(super) fn union(mut self, o: Self) -> Self {
        self.grow(o.lo, o.hi);
        self
    }

    #[inline]
    pub(super) fn size(&self) -> Vec4 {
        self.hi - self.lo
    }

    /// Half the surface, lengths counted in units of `1 / unit`; 0 for an empty box.
    #[inline]
    pub(super) fn half_area(&self, unit: f32) -> f32 {
        let e = (self.size() * unit).max(Vec4::ZERO);
        e.x * e.y + e.y * e.z + e.z * e.x
    }

    /// Whether nothing in it has a leaf to itself.
    pub(super) fn shares(&self) -> bool {
        self.hi.w <= SHARES
    }

    pub(super) fn longest_axis(&self) -> usize {
        let e = self.size();
        if e.x >= e.y && e.x >= e.z {
            0
        } else if e.y >= e.z {
            1
        } else {
            2
        }
    }

    /// What to multiply lengths with so that areas neither overflow nor vanish.
    pub(super) fn unit(&self) -> f32 {
        let e = self.size();
        1.0 / e.x.max(e.y).max(e.z).max(f32::MIN_POSITIVE)
    }

    /// The box a ray is tested against: wider by 2^-24 of its largest edge and two ulps.
    ///
    /// A ray that the f64 test lets hit may pass a triangle by 2^-50 of its size, and one
    /// that runs in a side of the box must be inside, so that `0 * inf` cannot decide. The
    /// second ulp is for origins that were rounded.
    pub(super) fn padded(&self) -> Self {
        let e = self.size();
        let pad = Vec4::splat(e.x.max(e.y).max(e.z) * (0.5 * f32::EPSILON));
        let out = |v: Vec4, f: fn(f32) -> f32| Vec4::new(f(v.x), f(v.y), f(v.z), 0.0);
        Self {
            lo: out(self.lo - pad, |x| x.next_down().next_down()),
            hi: out(self.hi + pad, |x| x.next_up().next_up()),
        }
    }
}

/// Which bin a centroid falls into.
#[derive(Clone, Copy, Debug)]
pub(super) struct Binning {
    lo: Vec4,
    scale: Vec4,
    bins: usize,
    /// Axes along which centroids differ enough to be told apart.
    usable: [bool; 3],
}

impl Binning {
    /// Divides the box around the centroids into `bins <= BINS` slices per axis.
    pub(super) fn new(centroids: Box4, bins: usize) -> Self {
        debug_assert!((2..=BINS).contains(&bins));
        let size = centroids.size();
        let scale = [0, 1, 2].map(|axis| bins as f32 * 0.999 / size[axis]);
        let usable = scale.map(f32::is_finite);
        let scale = [0, 1, 2].map(|axis| if usable[axis] { scale[axis] } else { 0.0 });
        Self { lo: centroids.lo, scale: Vec4::new(scale[0], scale[1], scale[2], 0.0), bins, usable }
    }

    /// Bins of a centroid along x, y and z; w is not used.
    #[inline]
    fn of(&self, centroid: Vec4) -> [u32; 4] {
        // Rounded by adding 2^23: the lowest bits are then the integer, and no float has
        // to be converted. Half a bin less, so that rounding to nearest rounds down.
        const MAGIC: f32 = 8_388_608.0;
        let x = (centroid - self.lo) * self.scale - 0.5;
        (x.max(Vec4::ZERO) + MAGIC).to_array().map(|f| f.to_bits() & (BINS as u32 - 1))
    }
}

/// A plane between two bins.
#[derive(Clone, Copy, Debug)]
pub(super) struct Plane {
    binning: Binning,
    axis: usize,
    /// First bin on the right side.
    bin: u32,
}

impl Plane {
    /// The plane that halves the longest edge of the box around the centroids; `None`
    /// where they coincide.
    pub(super) fn through_middle(centroids: Box4) -> Option<Self> {
        let (binning, axis) = (Binning::new(centroids, 2), centroids.longest_axis());
        binning.usable[axis].then_some(Self { binning, axis, bin: 1 })
    }

    #[inline]
    pub(super) fn is_left(&self, centroid: Vec4) -> bool {
        self.binning.of(centroid)[self.axis] < self.bin
    }
}

/// Boxes and numbers of the items in each bin, along each axis.
#[derive(Clone)]
pub(super) struct Bins {
    boxes: [[Box4; BINS]; 3],
    counts: [[u32; BINS]; 3],
}

impl Bins {
    pub(super) const EMPTY: Self = Self { boxes: [[Box4::EMPTY; BINS]; 3], counts: [[0; BINS]; 3] };

    /// Counts `items` into bins.
    pub(super) fn of(items: &[Item], binning: &Binning) -> Self {
        let mut bins = Self::EMPTY;
        for item in items {
            let (lo, hi) = (item.lo(), item.hi);
            let bin = binning.of(lo + hi);
            for (axis, &b) in bin[..3].iter().enumerate() {
                bins.boxes[axis][b as usize].grow(lo, hi);
                bins.counts[axis][b as usize] += 1;
            }
        }
        bins
    }

    /// Both together.
    pub(super) fn plus(mut self, o: Self) -> Self {
        for axis in 0..3 {
            for b in 0..BINS {
                self.boxes[axis][b] = self.boxes[axis][b].union(o.boxes[axis][b]);
                self.counts[axis][b] += o.counts[axis][b];
            }
        }
        self
    }

    /// The plane of least cost with items on both sides: area times tests, summed over
    /// both sides. Four things are one test.
    pub(super) fn best(&self, binning: &Binning, unit: f32) -> Option<Plane> {
        let mut best = (f32::INFINITY, None);
        for axis in (0..3).filter(|&axis| binning.usable[axis]) {
            let (boxes, counts) = (&self.boxes[axis][..binning.bins], &self.counts[axis][..binning.bins]);
            let mut right = [(0.0, 0); BINS];
            let mut side = (Box4::EMPTY, 0);
            for b in (1..binning.bins).rev() {
                side = (side.0.union(boxes[b]), side.1 + counts[b]);
                right[b] = (side.0.half_area(unit), side.1);
            }
            let mut side = (Box4::EMPTY, 0);
            for b in 1..binning.bins {
                side = (side.0.union(boxes[b - 1]), side.1 + counts[b - 1]);
                let (right_area, right_count) = right[b];
                if side.1 == 0 || right_count == 0 {
                    continue;
                }
                let tests = |n: u32| n.div_ceil(4) as f32;
                let cost = side.0.half_area(unit) * tests(side.1) + right_area * tests(right_count);
                if cost < best.0 {
                    best = (cost, Some(Plane { binning: *binning, axis, bin: b as u32 }));
                }
            }
        }
        best.1
    }
}
