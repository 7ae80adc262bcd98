//! OBJ lines without the machinery of `format!`.

use glam::DVec3;

/// Appends `tag x y z` with six decimals, rounded to the nearest.
///
/// Components are finite and below 9e12 in size.
pub(super) fn push_vector(line: &mut Vec<u8>, tag: &str, v: DVec3) {
    line.extend_from_slice(tag.as_bytes());
    for x in v.to_array() {
        line.push(b' ');
        push_fixed(line, x);
    }
    line.push(b'\n');
}

/// Appends `f a//a b//b c//c`; corner 0 gets the number `first`.
pub(super) fn push_face(line: &mut Vec<u8>, corners: [u64; 3], first: u64) {
    line.push(b'f');
    for corner in corners {
        let mut digits = [0; 20];
        let digits = decimal(&mut digits, corner + first);
        line.push(b' ');
        line.extend_from_slice(digits);
        line.extend_from_slice(b"//");
        line.extend_from_slice(digits);
    }
    line.push(b'\n');
}

/// Appends `x` with six decimals; what rounds to zero has no sign.
fn push_fixed(line: &mut Vec<u8>, x: f64) {
    let millionths = (x.abs() * 1e6 + 0.5) as u64;
    if x < 0.0 && millionths > 0 {
        line.push(b'-');
    }
    // A leading one keeps the zeros of the fraction, and its place is the point's.
    let mut fraction = [0; 20];
    let fraction = decimal(&mut fraction, 1_000_000 + millionths % 1_000_000);
    let mut whole = [0; 20];
    line.extend_from_slice(decimal(&mut whole, millionths / 1_000_000));
    line.push(b'.');
    line.extend_from_slice(&fraction[1..]);
}

/// The decimal digits of `n`, at the end of `space`.
fn decimal(space: &mut [u8; 20], mut n: u64) -> &[u8] {
    let mut at = space.len();
    loop {
        at -= 1;
        space[at] = b'0' + (n % 10) as u8;
        n /= 10;
        if n == 0 {
            return &space[at..];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fixed_point_is_what_format_writes() {
        let text = |x: f64| {
            let mut line = Vec::new();
            push_fixed(&mut line, x);
            String::from_utf8(line).unwrap()
        };
        for x in [1.0, -1.0, 0.5, 123.456789, -0.000001, 0.999_999_4, 0.999_999_6, -9.999_999_9, 4e9] {
            assert_eq!(text(x), format!("{x:.6}"));
        }
        assert_eq!(text(-0.0), "0.000000");
        assert_eq!(text(-4e-7), "0.000000");
        // A sweep with an irrational step: no value lies on a tie.
        for i in -20_000..20_000 {
            let x = f64::from(i) * std::f64::consts::PI * 1e-5;
            assert_eq!(text(x).trim_start_matches('-'), format!("{:.6}", x.abs()));
        }
    }

    #[test]
    fn numbers_up_to_the_last() {
        let mut line = Vec::new();
        push_face(&mut line, [0, 9, u64::MAX - 1], 1);
        let last = u64::MAX;
        assert_eq!(String::from_utf8(line).unwrap(), format!("f 1//1 10//10 {last}//{last}\n"));
    }
}
