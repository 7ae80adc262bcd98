//! Every format is read back by another reader, or by its own definition.

use super::*;
use std::fs::{self, File};
use std::io::{BufReader, Cursor};

/// 5x3 with all kinds of auxiliary images, no two pixels alike.
fn film() -> Film {
    let mut film = Film::new(5, 3, &Aov::ALL);
    for (i, c) in film.color.iter_mut().enumerate() {
        let i = i as f32;
        *c = [i / 14.0, 1.0 - i / 14.0, 0.3 + 0.1 * i];
    }
    for aov in &mut film.aovs {
        for (i, v) in aov.data.iter_mut().enumerate() {
            *v = match aov.kind {
                Aov::Depth if i == 0 => f32::INFINITY,
                Aov::Normal => (i as f32 / 22.0 - 1.0).clamp(-1.0, 1.0),
                Aov::Id => f32::from_bits(1 + i as u32 * 1000),
                Aov::Hits | Aov::Albedo => i as f32 / 45.0,
                _ => i as f32 + 0.5,
            };
        }
    }
    film
}

fn notes() -> Notes {
    Notes {
        software: "tison 0".into(),
        title: "Kugel ümlaut 球.obj".into(),
        comment: "spp 1".into(),
        error: "0 ümlaut".into(),
    }
}

fn encoded(film: &Film, format: Format) -> Vec<u8> {
    let mut out = Cursor::new(Vec::new());
    encode(film, format, &Display::default(), &notes(), &mut out).unwrap();
    out.into_inner()
}

fn srgb(film: &Film) -> Vec<u8> {
    film.color.as_flattened().iter().map(|&c| crate::math::colour::srgb8_by_formula(c)).collect()
}

#[test]
fn lossless_8_bit_formats_hold_the_curve_of_each_pixel() {
    let film = film();
    for (format, kind) in [
        (Format::Png, image::ImageFormat::Png),
        (Format::Bmp, image::ImageFormat::Bmp),
        (Format::Ppm, image::ImageFormat::Pnm),
    ] {
        let read = image::load_from_memory_with_format(&encoded(&film, format), kind).unwrap().to_rgb8();
        assert_eq!((read.width(), read.height()), (5, 3), "{format:?}");
        assert_eq!(read.as_raw(), &srgb(&film), "{format:?}");
    }
}

#[test]
fn stretching_changes_8_bit_formats_and_no_other() {
    let film = film();
    let with = |format, tonemap| {
        let mut out = Cursor::new(Vec::new());
        encode(&film, format, &Display { tonemap, exposure: 0.0, depth_range: None }, &notes(), &mut out).unwrap();
        out.into_inner()
    };
    for format in [Format::Png, Format::Bmp, Format::Ppm, Format::Jpeg] {
        assert!(with(format, Tonemap::Stretch) != with(format, Tonemap::None), "{format:?}");
    }
    for format in [Format::Exr, Format::Hdr, Format::Pfm] {
        assert!(with(format, Tonemap::Stretch) == with(format, Tonemap::None), "{format:?}");
    }
    let read = image::load_from_memory(&with(Format::Png, Tonemap::Stretch)).unwrap().to_rgb8();
    // The film runs from 0 to a hair above 1.7, in blue.
    assert_eq!(read.as_raw()[..3], [0, 149, 45]);
    assert_eq!(read.as_raw()[42..], [149, 0, 255]);
    let info = |tonemap| {
        let bytes = with(Format::Png, tonemap);
        ::png::Decoder::new(Cursor::new(bytes)).read_info().unwrap().info().srgb.is_some()
    };
    assert!(info(Tonemap::None) && !info(Tonemap::Stretch), "what is stretched is on no curve");
}

#[test]
fn jpeg_is_close() {
    let mut film = film();
    film.color.fill([0.5, 0.25, 0.1]);
    let read = image::load_from_memory(&encoded(&film, Format::Jpeg)).unwrap().to_rgb8();
    for (got, want) in read.as_raw().iter().zip(srgb(&film)) {
        assert!(got.abs_diff(want) <= 3, "{got} {want}");
    }
}

#[test]
fn hdr_holds_linear_values_to_one_part_in_128() {
    let film = film();
    let read = image::load_from_memory_with_format(&encoded(&film, Format::Hdr), image::ImageFormat::Hdr).unwrap();
    for (got, want) in read.to_rgb32f().pixels().zip(&film.color) {
        let scale = want.iter().copied().fold(0.0, f32::max);
        for (g, w) in got.0.iter().zip(want) {
            assert!((g - w).abs() <= scale / 128.0, "{g} {w}");
        }
    }
}

#[test]
fn pfm_is_bottom_up_little_endian() {
    let film = film();
    let bytes = encoded(&film, Format::Pfm);
    let body = bytes.strip_prefix(b"PF\n5 3\n-1.0\n").unwrap();
    let values: Vec<f32> = body.as_chunks().0.iter().map(|&b| f32::from_le_bytes(b)).collect();
    assert_eq!(values.len(), 45);
    assert_eq!(values[..3], film.color[10], "the first pixel is the lowest row's");
    assert_eq!(values[42..], film.color[4], "the last is the top row's");
}

#[test]
fn png_notes_what_it_shows_and_no_time() {
    let bytes = encoded(&film(), Format::Png);
    let reader = ::png::Decoder::new(Cursor::new(&bytes)).read_info().unwrap();
    let info = reader.info();
    let texts: Vec<_> = info.uncompressed_latin1_text.iter().map(|t| (&*t.keyword, &*t.text)).collect();
    assert_eq!(texts, [("Software", "tison 0"), ("Comment", "spp 1")]);
    assert_eq!(info.utf8_text[0].get_text().unwrap(), "Kugel ümlaut 球.obj");
    assert!(info.srgb.is_some());
    assert!(!bytes.windows(4).any(|w| w == b"tIME"));
}

#[test]
fn exr_holds_every_value_of_every_channel() {
    let film = film();
    let bytes = encoded(&film, Format::Exr);
    let read = exr_channels(bytes);
    let names: Vec<&str> = read.iter().map(|(n, _)| n.as_str()).collect();
    let want = [
        "B",
        "G",
        "R",
        "Z",
        "albedo.B",
        "albedo.G",
        "albedo.R",
        "cost",
        "hits",
        "id.object",
        "id.primitive",
        "normal.X",
        "normal.Y",
        "normal.Z",
        "samples",
    ];
    assert_eq!(names, want);
    let channel = |name: &str| &read.iter().find(|(n, _)| n == name).unwrap().1;
    let aov = |kind| &film.aovs.iter().find(|a| a.kind == kind).unwrap().data;
    assert_eq!(channel("G"), &film.color.iter().map(|c| c[1]).collect::<Vec<_>>());
    assert_eq!(channel("Z"), aov(Aov::Depth));
    assert_eq!(channel("normal.Y"), &aov(Aov::Normal).iter().skip(1).step_by(3).copied().collect::<Vec<_>>());
    assert_eq!(
        channel("id.primitive"),
        &aov(Aov::Id).iter().skip(1).step_by(2).map(|v| v.to_bits() as f32).collect::<Vec<_>>()
    );
}

fn exr_channels(bytes: Vec<u8>) -> Vec<(String, Vec<f32>)> {
    use ::exr::prelude::{ReadChannels, ReadLayers, read};
    let image = read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .first_valid_layer()
        .all_attributes()
        .from_buffered(Cursor::new(bytes))
        .unwrap();
    let channels = image.layer_data.channel_data.list;
    channels.iter().map(|c| (c.name.to_string(), c.sample_data.values_as_f32().collect())).collect()
}

#[test]
fn each_auxiliary_image_has_its_own_file_unless_the_format_holds_them() {
    let dir = tempfile::tempdir().unwrap();
    let film = film();
    for (name, count) in [("a.png", 8), ("b.pfm", 8), ("c.exr", 1), ("d.hdr", 8)] {
        let path = dir.path().join(name);
        let format = Format::of(&path).unwrap();
        let written = save_all(&film, &path, format, &Display::default(), &notes()).unwrap();
        let named: Vec<_> = written.iter().map(|(p, _)| p.clone()).collect();
        assert_eq!(named, files(&path, format, &Aov::ALL), "{name}");
        assert_eq!(named.len(), count, "{name}");
        for (path, bytes) in written {
            assert_eq!(fs::metadata(&path).unwrap().len(), bytes, "{}", path.display());
        }
    }
    assert!(dir.path().join("a.depth.png").exists());
    let depth = fs::read(dir.path().join("b.depth.pfm")).unwrap();
    assert!(depth.starts_with(b"Pf\n5 3\n-1.0\n"));
    let reader = ::png::Decoder::new(BufReader::new(File::open(dir.path().join("a.depth.png")).unwrap()));
    assert!(reader.read_info().unwrap().info().srgb.is_none(), "a depth is not a colour");
}

#[test]
fn the_bytes_do_not_depend_on_the_threads() {
    let mut film = Film::new(301, 203, &Aov::ALL);
    for (i, c) in film.color.iter_mut().enumerate() {
        let i = i as f32;
        *c = [(i * 0.37).fract(), (i * 0.11).fract(), (i * 0.73).fract()];
    }
    let with = |threads: usize, format| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| encoded(&film, format))
    };
    for format in [Format::Png, Format::Exr] {
        assert_eq!(with(1, format), with(7, format), "{format:?}");
    }
}
