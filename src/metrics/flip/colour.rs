//! Colour spaces: from linear sRGB to opponent colours, and to CIELAB as dim light changes it.

use crate::math::pow01;

/// Linear sRGB to XYZ, white being (0.9504, 1, 1.0889) of D65: exact ratios from the primaries.
const TO_XYZ: [[f64; 3]; 3] = [
    [10_135_552.0 / 24_577_794.0, 8_788_810.0 / 24_577_794.0, 4_435_075.0 / 24_577_794.0],
    [2_613_072.0 / 12_288_897.0, 8_788_810.0 / 12_288_897.0, 887_015.0 / 12_288_897.0],
    [1_425_312.0 / 73_733_382.0, 8_788_810.0 / 73_733_382.0, 70_074_185.0 / 73_733_382.0],
];
/// The same with white at (1, 1, 1).
const TO_SHARES: [[f64; 3]; 3] = {
    let mut m = TO_XYZ;
    let mut i = 0;
    while i < 3 {
        let white = TO_XYZ[i][0] + TO_XYZ[i][1] + TO_XYZ[i][2];
        let mut k = 0;
        while k < 3 {
            m[i][k] /= white;
            k += 1;
        }
        i += 1;
    }
    m
};
const FROM_SHARES: [[f64; 3]; 3] = inverse(TO_SHARES);

const fn inverse(m: [[f64; 3]; 3]) -> [[f64; 3]; 3] {
    let mut adjugate = [[0.0; 3]; 3];
    let mut i = 0;
    while i < 3 {
        let mut k = 0;
        while k < 3 {
            let (r0, r1, c0, c1) = ((k + 1) % 3, (k + 2) % 3, (i + 1) % 3, (i + 2) % 3);
            adjugate[i][k] = m[r0][c0] * m[r1][c1] - m[r0][c1] * m[r1][c0];
            k += 1;
        }
        i += 1;
    }
    let determinant = m[0][0] * adjugate[0][0] + m[0][1] * adjugate[1][0] + m[0][2] * adjugate[2][0];
    let mut i = 0;
    while i < 9 {
        adjugate[i / 3][i % 3] /= determinant;
        i += 1;
    }
    adjugate
}

#[inline(always)]
fn product(m: &[[f64; 3]; 3], v: [f64; 3]) -> [f64; 3] {
    [
        m[0][0] * v[0] + m[0][1] * v[1] + m[0][2] * v[2],
        m[1][0] * v[0] + m[1][1] * v[1] + m[1][2] * v[2],
        m[2][0] * v[0] + m[2][1] * v[1] + m[2][2] * v[2],
    ]
}

/// Linear sRGB to YCxCz: light against dark, red against green, blue against yellow; linear in light.
#[inline(always)]
pub fn opponent(light: [f64; 3]) -> [f64; 3] {
    let [x, y, z] = product(&TO_SHARES, light);
    [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
}

/// Back to linear sRGB, cut off at what a display can show.
#[inline(always)]
pub fn displayed([y, cx, cz]: [f64; 3]) -> [f64; 3] {
    let y = (y + 16.0) * (1.0 / 116.0);
    let [r, g, b] = product(&FROM_SHARES, [y + cx * (1.0 / 500.0), y, y - cz * (1.0 / 200.0)]);
    [r.clamp(0.0, 1.0), g.clamp(0.0, 1.0), b.clamp(0.0, 1.0)]
}

/// Linear sRGB from 0 to 1 to CIELAB in which the chroma weakens with the lightness, the Hunt effect.
#[inline(always)]
pub fn perceived(light: [f64; 3]) -> [f64; 3] {
    let [x, y, z] = product(&TO_SHARES, light);
    let (x, y, z) = (cube_root(x), cube_root(y), cube_root(z));
    let lightness = 116.0 * y - 16.0;
    let weaker = 0.01 * lightness;
    [lightness, weaker * 500.0 * (x - y), weaker * 200.0 * (y - z)]
}

/// The distance of green from blue, which no two colours of a display exceed.
pub fn farthest() -> f64 {
    distance(perceived([0.0, 1.0, 0.0]), perceived([0.0, 0.0, 1.0]))
}

/// HyAB: lightness by itself, and chroma as a distance in its plane.
fn distance(a: [f64; 3], b: [f64; 3]) -> f64 {
    (a[0] - b[0]).abs() + (a[1] - b[1]).hypot(a[2] - b[2])
}

/// CIELAB's: with a straight line near 0.
#[inline(always)]
fn cube_root(t: f64) -> f64 {
    const DELTA: f64 = 6.0 / 29.0;
    // White can round to a hair above 1.
    let root = pow01(t.clamp(0.0, 1.0), 1.0 / 3.0);
    if t > DELTA * DELTA * DELTA { root } else { t / (3.0 * DELTA * DELTA) + 4.0 / 29.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn white_black_and_the_way_back() {
        let white = opponent([1.0; 3]);
        assert!((white[0] - 100.0).abs() < 1e-12 && white[1].abs() < 1e-12 && white[2].abs() < 1e-12);
        for light in [[0.0; 3], [1.0; 3], [0.2, 0.7, 0.1], [0.0, 0.0, 1.0]] {
            let back = displayed(opponent(light));
            assert!(light.iter().zip(back).all(|(l, b)| (l - b).abs() < 1e-13), "{light:?} {back:?}");
        }
        let [l, a, b] = perceived([1.0; 3]);
        assert!((l - 100.0).abs() < 1e-9 && a.abs() < 1e-9 && b.abs() < 1e-9);
    }

    #[test]
    fn no_two_colours_are_farther_apart_than_green_and_blue() {
        const STEPS: u32 = 6;
        let grid = (0..(STEPS + 1).pow(3)).map(|i| {
            let part = |n: u32| f64::from(i / n % (STEPS + 1)) / f64::from(STEPS);
            perceived([part(1), part(STEPS + 1), part((STEPS + 1).pow(2))])
        });
        let colours: Vec<_> = grid.collect();
        for (i, &a) in colours.iter().enumerate() {
            assert!(colours[..i].iter().all(|&b| distance(a, b) <= farthest() + 1e-9), "{a:?}");
        }
    }
}
