//! Look-ups and files.

use super::*;
use image::{DynamicImage, ImageFormat, Rgb, RgbImage};
use std::path::{Path, PathBuf};

/// Texel (x, y) has the colour (x, y, 10 y + x), in 255ths.
fn numbered(width: u32, height: u32, nearest: bool) -> Texture {
    let texel = |i: u32| [i % width, i / width, 10 * (i / width) + i % width].map(|c| c as u8);
    Texture::from_bytes((width, height), (0..width * height).flat_map(texel).collect(), Encoding::Linear, nearest)
}

fn at(texture: &Texture, u: f32, v: f32) -> [f32; 3] {
    (texture.sample(Vec2::new(u, v)) * 255.0).to_array().map(|c| (c * 1e4).round() / 1e4)
}

#[test]
fn nearest_is_the_floor_and_repeats() {
    let t = numbered(4, 3, true);
    let just_below = 1f32.next_down();
    for (u, v, want) in [
        (0.0, 0.0, 0.0),
        (just_below, 0.0, 3.0),
        (0.0, just_below, 20.0),
        (just_below, just_below, 23.0),
        (1.0, 1.0, 0.0),
        (0.25, 0.34, 11.0),
        (0.25f32.next_down(), 0.33, 0.0),
        (-0.01, -0.01, 23.0),
        (-0.75, 5.5, 11.0),
        (-1e-30, 0.0, 3.0),
        (1e30, -1e30, 0.0),
        (16_777_217.0, -16_777_215.0, 0.0),
    ] {
        assert_eq!(at(&t, u, v)[2], want, "{u} {v}");
    }
}

#[test]
fn every_column_begins_exactly_where_it_should() {
    for width in [1, 3, 7, 640, 1023, 65_536] {
        let t = Texture::from_bytes((width, 1), vec![0; 3 * width as usize], Encoding::Linear, true);
        for column in (0..width).step_by(1 + width as usize / 100) {
            // The least f32 that is not before the column.
            let mut u = (f64::from(column) / f64::from(width)) as f32;
            if f64::from(u) * f64::from(width) < f64::from(column) {
                u = u.next_up();
            }
            assert_eq!(cell(place(u, width), t.width), column as usize, "{column} of {width}");
            if column > 0 {
                assert_eq!(cell(place(u.next_down(), width), width), column as usize - 1, "{column} of {width}");
            }
        }
    }
}

#[test]
fn a_blend_has_its_texels_at_halves_and_goes_on_over_the_border() {
    let t = numbered(4, 2, false);
    for (u, v, want) in [
        (0.125, 0.25, [0.0, 0.0, 0.0]),
        (0.875, 0.75, [3.0, 1.0, 13.0]),
        (0.25, 0.25, [0.5, 0.0, 0.5]),
        (0.125, 0.5, [0.0, 0.5, 5.0]),
        (0.3125, 0.625, [0.75, 0.75, 8.25]),
        (0.0, 0.25, [1.5, 0.0, 1.5]),
        (1.0, 0.25, [1.5, 0.0, 1.5]),
        (-0.0625, 0.25, [2.25, 0.0, 2.25]),
        (0.125, 0.0, [0.0, 0.5, 5.0]),
        (0.0, 0.0, [1.5, 0.5, 6.5]),
        (-3.0, 7.0, [1.5, 0.5, 6.5]),
    ] {
        assert_eq!(at(&t, u, v), want, "{u} {v}");
    }
    let one = numbered(1, 1, false);
    assert_eq!(at(&one, 0.3, -0.2), [0.0; 3]);
}

#[test]
fn what_is_no_number_gives_some_texel() {
    for nearest in [true, false] {
        let t = numbered(5, 3, nearest);
        for odd in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, f32::MAX, f32::MIN, -f32::MIN_POSITIVE] {
            for uv in [Vec2::new(odd, 0.5), Vec2::new(0.5, odd), Vec2::splat(odd)] {
                assert!(t.sample(uv).is_finite(), "{uv}");
            }
        }
    }
}

#[test]
fn bytes_mean_what_the_encoding_says() {
    let bytes: Vec<u8> = (0..=255).flat_map(|b| [b, b, b]).collect();
    for (encoding, formula) in [(Encoding::Srgb, colour::linear as fn(f64) -> f64), (Encoding::Linear, |x| x)] {
        let t = Texture::from_bytes((256, 1), bytes.clone(), encoding, true);
        for b in 0..256u16 {
            let got = t.sample(Vec2::new((f32::from(b) + 0.5) / 256.0, 0.5));
            assert_eq!(got, Vec3::splat(formula(f64::from(b) / 255.0) as f32), "{encoding:?} {b}");
        }
        assert_eq!(t.bytes(), 768);
    }
}

/// A folder, and a writer of files into it.
struct Folder(tempfile::TempDir);

impl Folder {
    fn new() -> Self {
        Self(tempfile::tempdir().expect("a folder for the test"))
    }

    fn image(&self, name: &str, image: &DynamicImage, format: ImageFormat) -> PathBuf {
        let path = self.0.path().join(name);
        image.save_with_format(&path, format).expect("the image can be written");
        path
    }

    fn file(&self, name: &str, bytes: &[u8]) -> PathBuf {
        let path = self.0.path().join(name);
        std::fs::write(&path, bytes).expect("the file can be written");
        path
    }
}

#[test]
fn every_kind_of_file_is_read_by_its_content() {
    let folder = Folder::new();
    let image = RgbImage::from_fn(16, 8, |x, _| if x < 8 { Rgb([128; 3]) } else { Rgb([255, 0, 0]) });
    let image = DynamicImage::ImageRgb8(image);
    let grey = colour::linear(128.0 / 255.0) as f32;
    let kinds = [
        ("a.png", ImageFormat::Png, image.clone(), 0.0),
        ("b.png", ImageFormat::Png, image.to_rgba8().into(), 0.0),
        ("wrong.png", ImageFormat::Bmp, image.clone(), 0.0),
        ("c.jpg", ImageFormat::Jpeg, image.clone(), 0.02),
        ("d.png", ImageFormat::Png, image.to_luma8().into(), 1.0),
        ("e.png", ImageFormat::Png, image.to_rgb16().into(), 0.0),
    ];
    for (name, format, image, red_tolerance) in kinds {
        let t = read(&folder.image(name, &image, format), Encoding::Srgb, true).expect(name);
        assert_eq!((t.width, t.height, t.nearest), (16, 8, true), "{name}");
        let got = t.sample(Vec2::new(0.1, 0.9));
        assert!((got - Vec3::splat(grey)).abs().max_element() < 0.02 * red_tolerance + 1e-6, "{name}: {got}");
        let red = t.sample(Vec2::new(0.99, 0.01));
        assert!((red - Vec3::X).abs().max_element() <= red_tolerance, "{name}: {red}");
        let per_texel = if name == "e.png" { 12 } else { 3 };
        assert_eq!(t.bytes(), 16 * 8 * per_texel, "{name}");
    }
    let hdr = DynamicImage::ImageRgb32F(image::Rgb32FImage::from_pixel(3, 2, Rgb([4.0, 0.5, 0.0])));
    let t = read(&folder.image("f.hdr", &hdr, ImageFormat::Hdr), Encoding::Srgb, false).expect("f.hdr");
    assert_eq!(t.sample(Vec2::splat(0.5)), Vec3::new(4.0, 0.5, 0.0), "linear as written");
}

fn refused(path: &Path) -> String {
    read(path, Encoding::Srgb, false).expect_err("it must be refused")
}

#[test]
fn broken_and_huge_files_are_refused_in_words() {
    let folder = Folder::new();
    let image = DynamicImage::ImageRgb8(RgbImage::new(64, 64));
    let whole = std::fs::read(folder.image("a.png", &image, ImageFormat::Png)).expect("it was written");
    let cut = folder.file("cut.png", &whole[..whole.len() / 2]);
    assert!(refused(&cut).starts_with("cannot be decoded: "), "{}", refused(&cut));
    assert_eq!(refused(&folder.file("text.png", b"solid")), "is no PNG, JPEG, BMP, HDR or PNM image");
    assert_eq!(refused(&folder.file("empty.png", b"")), "is no PNG, JPEG, BMP, HDR or PNM image");
    assert!(refused(Path::new("/nowhere/a.png")).starts_with("cannot be opened: "));
    // The header alone promises too much.
    for (header, want) in [
        ("P6 70000 1 255\n", "has 70000x1 pixels, but a side may have at most 65536"),
        ("P6 65536 65536 255\n", "would take 12288 MiB to decode, but at most 256 are given"),
        ("P6 10000 10000 255\n", "would take 286 MiB to decode, but at most 256 are given"),
    ] {
        let said = refused(&folder.file("huge.ppm", header.as_bytes()));
        assert!(said.contains(want), "{said}");
    }
}

#[test]
fn the_brightest_texel_bounds_what_a_surface_can_answer() {
    let bytes = Texture::from_bytes((1, 1), vec![3, 2, 1], Encoding::Linear, true);
    let floats = Texture::from_floats((2, 1), vec![0.1, 0.2, 0.3, 7.5, 0.0, 1.0], false);
    assert_eq!((bytes.brightest(), floats.brightest()), (1.0, 7.5));
}
