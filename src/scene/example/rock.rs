//! The shape of the ball: lumps, plates of crust parted by cracks, and grain down to the grid's own size.
//!
//! The radius is `r(p) = 1 + h(p)` over unit `p`, with `h` built from gradient noise (Perlin, "Improving
//! Noise", 2002) in space. Gradients are carried along by the chain rule, so the normal is exact:
//! `r(x/|x|) - |x| = 0` has the outward normal `r p - s` with `s` the part of `∇h` across `p`.

use std::ops::{Add, Mul};

use glam::DVec3;

/// Edges of the grid that one cell of the finest noise spans; fewer would alias.
const EDGES_PER_CELL: f64 = 8.0;
/// How much cracks widen, in the unit of their field, for each cell of the finest noise that one of the field spans:
/// a wall then takes a few edges.
const WIDENING: f64 = 0.2;

/// The lava rock, with as much detail as a grid can carry.
#[derive(Debug)]
pub(super) struct Rock {
    /// Cells per unit length of the finest noise.
    finest: f64,
}

/// A value and its gradient over space.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Jet {
    v: f64,
    g: DVec3,
}

/// A sum of octaves, each twice as fine as the one before.
struct Octaves {
    seed: u32,
    /// Cells per unit length of the coarsest.
    coarsest: f64,
    /// Most octaves; fewer when the grid cannot carry them, so a large number means all it can.
    count: u32,
    /// Amplitude of the coarsest, and the factor from one to the next.
    amplitude: f64,
    gain: f64,
}

/// A crust of plates, parted by cracks where a field of noise is near zero.
struct Plates {
    field: Octaves,
    /// The crust has half its height where the field is this far from zero.
    width: f64,
}

/// The overall shape.
const LUMPS: Octaves = Octaves { seed: 11, coarsest: 1.3, count: 3, amplitude: 0.16, gain: 0.45 };
/// What cracks are the zeros of; amplitudes beyond the first make them jagged.
const FIELD: Octaves = Octaves { seed: 29, coarsest: 1.5, count: 4, amplitude: 1.0, gain: 0.3 };
/// Two families of cracks cross, so that plates get corners.
const PLATES: [Plates; 2] = [
    Plates { field: FIELD, width: 0.045 },
    Plates { field: Octaves { seed: 37, coarsest: 2.2, ..FIELD }, width: 0.05 },
];
/// Height of the plates.
const CRUST: f64 = 0.075;
/// What the plates are broken into.
const SHARDS: Plates = Plates { field: Octaves { seed: 47, coarsest: 6.1, ..FIELD }, width: 0.08 };
/// Height of the shards.
const SHARD: f64 = 0.025;
/// Roughness at every size that the grid can carry.
const GRAIN: Octaves = Octaves { seed: 71, coarsest: 8.0, count: 24, amplitude: 0.025, gain: 0.5 };

impl Rock {
    /// The rock for a geodesic grid of this frequency.
    pub(super) fn new(frequency: u64) -> Rock {
        // The icosahedron's edge, on the sphere, is about 1.1 long.
        Rock { finest: frequency as f64 / (1.1 * EDGES_PER_CELL) }
    }

    /// The surface in direction `p`, unit.
    pub(super) fn point(&self, p: DVec3) -> DVec3 {
        p * (1.0 + self.height(p).v)
    }

    /// The unit normal of the surface in direction `p`, unit.
    pub(super) fn normal(&self, p: DVec3) -> DVec3 {
        let h = self.height(p);
        let along = h.g - p * h.g.dot(p);
        (p * (1.0 + h.v) - along).normalize()
    }

    /// How deep in a crack between the plates direction `p` lies: 1 at its bottom, 0 far from any.
    pub(super) fn crack(&self, p: DVec3) -> f64 {
        1.0 - self.plates(p).v
    }

    fn height(&self, p: DVec3) -> Jet {
        let plates = self.plates(p);
        // Molten ground is smooth: grain and shards grow with the crust they sit on.
        let rough = plates * 0.9 + Jet::constant(0.1);
        let detail = self.crust(&SHARDS, p) * SHARD + self.sum(&GRAIN, p);
        Jet::constant(-0.05) + self.sum(&LUMPS, p) + plates * CRUST + rough * detail
    }

    fn plates(&self, p: DVec3) -> Jet {
        self.crust(&PLATES[0], p) * self.crust(&PLATES[1], p)
    }

    /// Height of the crust in 0..1: `c² / (c² + width²)` for the field `c`.
    fn crust(&self, plates: &Plates, p: DVec3) -> Jet {
        let c = self.sum(&plates.field, p);
        let width = plates.width + WIDENING * plates.field.coarsest / self.finest;
        let below = 1.0 / (c.v * c.v + width * width);
        Jet { v: c.v * c.v * below, g: c.g * (2.0 * c.v * width * width * below * below) }
    }

    /// The octaves that the grid can carry; the coarsest is always there.
    fn sum(&self, octaves: &Octaves, p: DVec3) -> Jet {
        let (mut frequency, mut amplitude) = (octaves.coarsest, octaves.amplitude);
        let mut total = Jet::constant(0.0);
        for octave in 0..octaves.count {
            if octave > 0 && frequency > self.finest {
                break;
            }
            let n = noise(p * frequency, octaves.seed + octave);
            total = total + Jet { v: n.v * amplitude, g: n.g * (amplitude * frequency) };
            frequency *= 2.0;
            amplitude *= octaves.gain;
        }
        total
    }
}

impl Jet {
    fn constant(v: f64) -> Jet {
        Jet { v, g: DVec3::ZERO }
    }
}

impl Add for Jet {
    type Output = Jet;
    fn add(self, o: Jet) -> Jet {
        Jet { v: self.v + o.v, g: self.g + o.g }
    }
}

impl Mul<f64> for Jet {
    type Output = Jet;
    fn mul(self, s: f64) -> Jet {
        Jet { v: self.v * s, g: self.g * s }
    }
}

impl Mul for Jet {
    type Output = Jet;
    fn mul(self, o: Jet) -> Jet {
        Jet { v: self.v * o.v, g: self.g * o.v + o.g * self.v }
    }
}

/// Gradient noise: about ±0.7, zero at every lattice point, twice differentiable.
fn noise(p: DVec3, seed: u32) -> Jet {
    let cell = p.floor();
    let t = p - cell;
    let at = |i: f64, odd: u32| (i as i32 as u32).wrapping_mul(odd);
    let (x, y, z) = (at(cell.x, X).wrapping_add(seed.wrapping_mul(SEED)), at(cell.y, Y), at(cell.z, Z));
    let ahead = |start: u32, step: u32, odd: u32| start.wrapping_add(step.wrapping_mul(odd));
    let corner = |dx: u32, dy: u32, dz: u32| {
        let g = gradient(ahead(x, dx, X) ^ ahead(y, dy, Y) ^ ahead(z, dz, Z));
        Jet { v: g.dot(t - DVec3::new(dx.into(), dy.into(), dz.into())), g }
    };
    let (fx, fy, fz) = (fade(t.x), fade(t.y), fade(t.z));
    let along_x = |dy, dz| blend(corner(0, dy, dz), corner(1, dy, dz), fx, DVec3::X);
    let along_y = |dz| blend(along_x(0, dz), along_x(1, dz), fy, DVec3::Y);
    blend(along_y(0), along_y(1), fz, DVec3::Z)
}

/// Odd numbers without a pattern, one per axis of the lattice and one for the octave.
const X: u32 = 0x9e37_79b1;
const Y: u32 = 0x85eb_ca77;
const Z: u32 = 0xc2b2_ae3d;
const SEED: u32 = 0x27d4_eb2f;

/// A vector in the cube of half size 1 for a point of the lattice.
fn gradient(lattice: u32) -> DVec3 {
    // The finaliser of MurmurHash3: every bit depends on every other.
    let h = (lattice ^ (lattice >> 16)).wrapping_mul(0x85eb_ca6b);
    let h = (h ^ (h >> 13)).wrapping_mul(0xc2b2_ae35);
    let h = h ^ (h >> 16);
    let part = |shift: u32| f64::from((h >> shift & 1023) as i32 - 512) * (1.0 / 512.0);
    DVec3::new(part(0), part(10), part(20))
}

/// `6t⁵ - 15t⁴ + 10t³` and its slope, for `t` in 0..1.
fn fade(t: f64) -> (f64, f64) {
    let (square, rest) = (t * t, t - 1.0);
    (square * t * (t * (t * 6.0 - 15.0) + 10.0), 30.0 * square * rest * rest)
}

/// From `a` to `b` by a weight whose slope lies along `axis`.
fn blend(a: Jet, b: Jet, (weight, slope): (f64, f64), axis: DVec3) -> Jet {
    let step = b.v - a.v;
    Jet { v: a.v + weight * step, g: a.g + (b.g - a.g) * weight + axis * (slope * step) }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Directions spread evenly, none on an axis (a golden spiral).
    fn directions(n: u32) -> impl Iterator<Item = DVec3> {
        (0..n).map(move |i| {
            let z = 1.0 - (2.0 * f64::from(i) + 1.0) / f64::from(n);
            let (sin, cos) = (2.399_963 * f64::from(i)).sin_cos();
            DVec3::new(cos, sin, z / (1.0 - z * z).sqrt()).normalize()
        })
    }

    #[test]
    fn gradients_agree_with_finite_differences() {
        for frequency in [1, 40, 512, 20_724] {
            let rock = Rock::new(frequency);
            let step = 0.01 / rock.finest.max(100.0) / 100.0;
            for p in directions(300) {
                let g = rock.height(p).g;
                let slope =
                    |axis: DVec3| (rock.height(p + axis * step).v - rock.height(p - axis * step).v) / (2.0 * step);
                let finite = DVec3::new(slope(DVec3::X), slope(DVec3::Y), slope(DVec3::Z));
                // Rounding of h (about 1e-16 of 1) over the step, and the step's own square.
                let tol = 1e-15 / step + 1e-5 * (1.0 + g.length());
                assert!((finite - g).abs().max_element() < tol, "f {frequency}, p {p}: {g} but {finite}");
            }
        }
    }

    #[test]
    fn normals_are_those_of_the_surface() {
        let rock = Rock::new(300);
        for p in directions(500) {
            let across = p.any_orthonormal_vector();
            let tangent =
                |d: DVec3| (rock.point((p + d * 1e-6).normalize()) - rock.point((p - d * 1e-6).normalize())) / 2e-6;
            let want = tangent(across).cross(tangent(p.cross(across))).normalize();
            let n = rock.normal(p);
            assert!((n.length() - 1.0).abs() < 1e-15);
            assert!(n.dot(want) > 1.0 - 1e-8, "p {p}: {n} but {want}");
        }
    }

    #[test]
    fn noise_is_smooth_across_its_lattice() {
        for axis in [DVec3::X, DVec3::Y, DVec3::Z] {
            let p = DVec3::splat(0.37) * (DVec3::ONE - axis) + axis * 3.0;
            let (left, right) = (noise(p - axis * 1e-9, 5), noise(p + axis * 1e-9, 5));
            assert!((left.v - right.v).abs() < 1e-8 && (left.g - right.g).length() < 1e-7);
        }
        assert_eq!(noise(DVec3::new(-2.0, 7.0, 1.0), 5).v, 0.0);
        assert_ne!(noise(DVec3::splat(0.4), 5), noise(DVec3::splat(0.4), 6));
    }

    #[test]
    fn the_ball_keeps_its_size() {
        for frequency in [1, 26, 1000] {
            let rock = Rock::new(frequency);
            let radii: Vec<f64> = directions(20_000).map(|p| rock.point(p).length()).collect();
            let mean = radii.iter().sum::<f64>() / radii.len() as f64;
            let (least, most) = radii.iter().fold((f64::MAX, 0f64), |(a, b), &r| (a.min(r), b.max(r)));
            assert!((0.93..1.05).contains(&mean), "f {frequency}: mean {mean}");
            assert!(least > 0.6 && most < 1.3, "f {frequency}: {least} to {most}");
        }
    }
}
