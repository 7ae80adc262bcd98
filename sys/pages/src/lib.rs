//! Huge pages under large arrays: fewer faults while they are filled, and fewer misses of the
//! translation buffer while they are read.

/// Memory that a huge page backs; smaller arrays gain nothing.
const HUGE: usize = 2 << 20;

/// `len` zeroes, of numbers that are all going to be written to. The system is asked to back them with huge pages, where
/// it gives those to who asks; without, everything works as before.
#[must_use]
pub fn zeroes<T: Copy + Default>(len: usize) -> Vec<T> {
    // Fresh from the system if it is large: nothing of it has been touched, so that it has no pages yet.
    let zeroes = vec![T::default(); len];
    prefer_huge(&zeroes);
    zeroes
}

/// Asks for the huge pages that lie wholly inside `array`.
fn prefer_huge<T>(array: &[T]) {
    let bytes = array.as_ptr_range();
    let (start, end) = ((bytes.start as usize).next_multiple_of(HUGE), bytes.end as usize / HUGE * HUGE);
    if start < end {
        advise(start, end - start);
    }
}

#[cfg(target_os = "linux")]
fn advise(start: usize, len: usize) {
    let at = std::ptr::without_provenance_mut(start);
    // SAFETY: the pages lie wholly inside an array that is borrowed, so that they are mapped, and this advice changes
    // neither what they hold nor who may read or write it. What it answers does not matter.
    unsafe { libc::madvise(at, len, libc::MADV_HUGEPAGE) };
}

#[cfg(not(target_os = "linux"))]
fn advise(_: usize, _: usize) {}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_array_is_as_any_other() {
        for len in [0, 1, 100, HUGE, HUGE + 7] {
            let mut array = zeroes::<[u32; 3]>(len);
            assert_eq!(array, vec![[0; 3]; len]);
            array.iter_mut().enumerate().for_each(|(i, x)| *x = [i as u32; 3]);
            prefer_huge(&array);
            array.extend([[1, 2, 3]; 9]);
            assert!(array[..len].iter().enumerate().all(|(i, &x)| x == [i as u32; 3]));
        }
    }
}
