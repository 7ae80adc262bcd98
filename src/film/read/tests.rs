//! What is read of each kind, to the last bit.

use super::*;

fn file(name: &str, bytes: &[u8]) -> (tempfile::TempDir, PathBuf) {
    let dir = tempfile::tempdir().expect("a folder for the test");
    let path = dir.path().join(name);
    std::fs::write(&path, bytes).expect("it can be written");
    (dir, path)
}

fn read_bytes(bytes: &[u8]) -> Result<Picture, ReadError> {
    let (_dir, path) = file("picture", bytes);
    read(&path, None)
}

fn pixels(bytes: &[u8]) -> Vec<[f32; 3]> {
    read_bytes(bytes).unwrap_or_else(|e| panic!("{e}")).pixels
}

#[test]
fn pfm_of_both_kinds_and_orders() {
    let body = |order: fn(f32) -> [u8; 4], values: &[f32]| values.iter().flat_map(|v| order(*v)).collect::<Vec<u8>>();
    let file = |header: &str, body: Vec<u8>| [header.as_bytes(), &body].concat();
    let values = [1.0, -2.0, 0.5, f32::INFINITY, 1e-40, 3.0];
    let (upper, lower) = ([f32::INFINITY, 1e-40, 3.0], [1.0, -2.0, 0.5]);
    let little = file("PF\n1 2\n-1.0\n", body(f32::to_le_bytes, &values));
    let big = file("PF 1  2\r\n2.5\n", body(f32::to_be_bytes, &values));
    for bytes in [little, big] {
        assert_eq!(pixels(&bytes), [upper, lower], "rows go from the bottom up");
    }
    let grey = file("Pf\n3 1\n-1\n", body(f32::to_le_bytes, &values[..3]));
    assert_eq!(pixels(&grey), [[1.0; 3], [-2.0; 3], [0.5; 3]]);
    // The first byte of the numbers may be white space.
    let space = f32::from_le_bytes([b' ', b'\n', 0, 0x3f]);
    assert_eq!(pixels(&file("Pf\n1 1\n-1\n", body(f32::to_le_bytes, &[space]))), [[space; 3]]);
    for (header, want) in [
        ("PF\n1 2\n-1.0\n", "is cut off, 4 of 24 bytes are there"),
        ("PF\n0 2\n-1.0\n", "has no pixels"),
        ("PF\n70000 1\n-1.0\n", "at most 65536"),
        ("PF\n60000 60000\n-1.0\n", "would take 41198 MiB"),
        ("PF\n1 x\n-1.0\n", "damaged PFM header"),
        ("PF\n1 -2\n-1.0\n", "damaged PFM header"),
        ("PF\n1 2\n0\n", "damaged PFM header"),
        ("PF\n1 2\nnan\n", "damaged PFM header"),
        ("PF\n1 2", "damaged PFM header"),
        ("PF\n", "damaged PFM header"),
    ] {
        let bytes = if header.ends_with("0\n") { file(header, vec![0; 4]) } else { header.into() };
        let said = read_bytes(&bytes).expect_err(header).to_string();
        assert!(said.contains(want), "{header:?}: {said}");
    }
}

#[test]
fn transparent_pixels_are_seen_over_black() {
    let pixels = |image: DynamicImage| {
        let picture = picture(image);
        (picture.pixels, picture.transparent, picture.encoding)
    };
    let image = image::RgbaImage::from_raw(2, 1, vec![200, 100, 50, 51, 1, 2, 3, 255]).expect("two pixels");
    assert_eq!(pixels(image.into()), (vec![[40.0, 20.0, 10.0], [1.0, 2.0, 3.0]], true, Encoding::Srgb8));
    let image = image::GrayAlphaImage::from_raw(1, 1, vec![77, 255]).expect("one pixel");
    assert_eq!(pixels(image.into()), (vec![[77.0; 3]], false, Encoding::Srgb8));
    let half = DynamicImage::ImageLumaA16(image::ImageBuffer::from_raw(1, 1, vec![514, 0]).expect("one pixel"));
    assert_eq!(pixels(half), (vec![[0.0; 3]], true, Encoding::Srgb8));
}

#[test]
fn sixteen_bits_keep_what_eight_cannot_say() {
    let words: Vec<u16> = vec![0, 257, 65_535, 100, 101, 65_534];
    let image = DynamicImage::ImageRgb16(image::ImageBuffer::from_raw(2, 1, words).expect("two pixels"));
    let picture = picture(image);
    assert_eq!(picture.pixels[0], [0.0, 1.0, 255.0]);
    assert_eq!(picture.pixels[1], [100.0 / 257.0, 101.0 / 257.0, 65_534.0 / 257.0]);
}

#[test]
fn a_part_is_those_pixels() {
    let numbers = |n: u32| (0..n).map(|i| [i as f32; 3]).collect();
    let whole = Picture { width: 5, height: 4, encoding: Encoding::Linear, pixels: numbers(20), transparent: false };
    let part = whole.crop((1, 2), (4, 4));
    assert_eq!((part.width, part.height), (3, 2));
    assert_eq!(part.pixels.iter().map(|p| p[0]).collect::<Vec<_>>(), [11.0, 12.0, 13.0, 16.0, 17.0, 18.0]);
    assert_eq!(whole.crop((0, 0), (5, 4)), whole);
}

#[test]
fn a_jpeg_without_an_end_is_cut_off() {
    assert!(whole(&[0xff, 0xd8, 0xff, 0xda, 1, 2, 0xff, 0xd9]).is_ok());
    assert!(whole(&[0xff, 0xd8, 0xff, 0xd9, 0xff, 0xda, 1, 2]).is_err(), "the end of a thumbnail is not the end");
    assert!(whole(&[0x89, b'P', 0xff, 0xda]).is_ok(), "no JPEG");
}
