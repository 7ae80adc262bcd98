//! What the system says about memory.

use std::fs;

/// Bytes that new allocations can have without swapping; nothing where the system does not say.
pub fn available_memory() -> Option<u64> {
    field(&fs::read_to_string("/proc/meminfo").ok()?, "MemAvailable:")
}

/// Most bytes that this process has held in memory; nothing where the system does not say.
pub fn peak_memory() -> Option<u64> {
    field(&fs::read_to_string("/proc/self/status").ok()?, "VmHWM:")
}

/// Bytes that this process holds in memory; nothing where the system does not say.
pub fn resident_memory() -> Option<u64> {
    field(&fs::read_to_string("/proc/self/status").ok()?, "VmRSS:")
}

/// The kernel writes `Name:   123 kB`, where kB means 1024 bytes.
fn field(text: &str, name: &str) -> Option<u64> {
    let line = text.lines().find_map(|l| l.strip_prefix(name))?;
    let kibibytes: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    kibibytes.checked_mul(1024)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fields_are_found_and_nonsense_is_not() {
        let text = "MemFree:   1 kB\nMemAvailable:   2048 kB\nOdd: x kB\n";
        assert_eq!(field(text, "MemAvailable:"), Some(2 << 20));
        assert_eq!(field(text, "Odd:"), None);
        assert_eq!(field(text, "Swap:"), None);
    }

    #[test]
    #[cfg(target_os = "linux")]
    fn this_process_holds_some_memory_and_less_than_there_is() {
        let peak = peak_memory().unwrap();
        // The kernel adds up each in its own time: one may be ahead of the other.
        assert!((100_000..=2 * peak).contains(&resident_memory().unwrap()));
        assert!(peak > 100_000 && peak < available_memory().unwrap() * 100, "{peak}");
    }
}
