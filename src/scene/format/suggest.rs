//! The nearest of some names to one that was mistyped.

/// The name among `valid` that `written` was probably meant to be, if any is near enough:
/// at most a third of the letters wrong, case apart, swapped neighbours counting once.
pub(super) fn nearest<'a>(written: &str, valid: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    // Longer ones are not typed by hand, and the distance costs the product of the lengths.
    const LONGEST: usize = 64;
    let letters = |s: &str| s.chars().flat_map(char::to_lowercase).take(LONGEST + 1).collect::<Vec<_>>();
    let from = letters(written);
    if from.len() > LONGEST {
        return None;
    }
    let far = |name: &str| {
        let to = letters(name);
        let worst = from.len().max(to.len()) / 3;
        (to.len() <= LONGEST && to.len().abs_diff(from.len()) <= worst)
            .then(|| distance(&from, &to))
            .filter(|&d| d <= worst && d < from.len().max(to.len()))
    };
    valid.into_iter().filter_map(|name| Some((far(name)?, name))).min_by_key(|&(d, _)| d).map(|(_, name)| name)
}

/// Optimal string alignment: letters inserted, removed, replaced, or swapped with a neighbour.
fn distance(a: &[char], b: &[char]) -> usize {
    let mut before = vec![0; b.len() + 1];
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for i in 1..=a.len() {
        let mut next = vec![i; b.len() + 1];
        for j in 1..=b.len() {
            let replaced = row[j - 1] + usize::from(a[i - 1] != b[j - 1]);
            next[j] = replaced.min(row[j] + 1).min(next[j - 1] + 1);
            if i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1] {
                next[j] = next[j].min(before[j - 2] + 1);
            }
        }
        before = std::mem::replace(&mut row, next);
    }
    row[b.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn typing_mistakes_are_recognised_and_strangers_are_not() {
        let names = ["gold", "glass", "mirror", "Translate", "k_diffuse", "x"];
        let cases = [
            ("gld", Some("gold")),
            ("GOLD", Some("gold")),
            ("galss", Some("glass")),
            ("miror", Some("mirror")),
            ("translat", Some("Translate")),
            ("k_difuse", Some("k_diffuse")),
            ("water", None),
            ("y", None),
            ("", None),
        ];
        for (written, want) in cases {
            assert_eq!(nearest(written, names), want, "{written}");
        }
        assert_eq!(nearest(&"g".repeat(100_000), names), None);
    }

    #[test]
    fn distances_of_the_literature() {
        for (a, b, want) in [("kitten", "sitting", 3), ("ab", "ba", 1), ("", "abc", 3), ("ca", "abc", 3)] {
            let letters = |s: &str| s.chars().collect::<Vec<_>>();
            assert_eq!(distance(&letters(a), &letters(b)), want, "{a} {b}");
        }
    }
}
