//! Files of all kinds, whole and broken.

use super::kit::{SMALL, linear, srgb8};
use std::fs;
use std::path::{Path, PathBuf};
use tison::film::{self, Aov, Display, Encoding, Film, Format, Notes, Picture};

/// A folder, and what tison writes into it.
struct Folder(tempfile::TempDir);

impl Folder {
    fn new() -> Self {
        Self(tempfile::tempdir().expect("a folder for the test"))
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn film(&self, name: &str, film: &Film) -> PathBuf {
        let path = self.path(name);
        let format = Format::of(&path).expect("a known extension");
        film::save_all(film, &path, format, &Display::default(), &Notes::default()).expect("it can be written");
        path
    }

    fn bytes(&self, name: &str, bytes: &[u8]) -> PathBuf {
        fs::write(self.path(name), bytes).expect("it can be written");
        self.path(name)
    }
}

/// Light with every auxiliary image.
fn film() -> Film {
    let [_, picture] = linear(SMALL);
    let mut film = Film::new(picture.width, picture.height, &Aov::ALL);
    film.color.clone_from(&picture.pixels);
    for aov in &mut film.aovs {
        let channels = aov.kind.channels();
        for (i, v) in aov.data.iter_mut().enumerate() {
            let n = (i / channels + 1000 * (i % channels)) as u32;
            *v = if aov.kind == Aov::Id { f32::from_bits(n) } else { n as f32 / 8.0 };
        }
    }
    film
}

fn read(path: &Path) -> Picture {
    film::read(path, None).unwrap_or_else(|e| panic!("{e}"))
}

fn refused(path: &Path) -> String {
    film::read(path, None).expect_err("it must be refused").to_string()
}

const ALL: [&str; 7] = ["a.png", "a.exr", "a.hdr", "a.pfm", "a.ppm", "a.jpg", "a.bmp"];

#[test]
fn what_is_written_is_read_back() {
    let (folder, film) = (Folder::new(), film());
    let bytes = Picture { pixels: film.color.clone(), ..linear(SMALL)[1].clone() }.into_srgb8().pixels;
    for name in ALL {
        let picture = read(&folder.film(name, &film));
        assert_eq!((picture.width, picture.height), SMALL, "{name}");
        match name {
            "a.exr" | "a.pfm" => {
                assert!(picture.pixels == film.color && picture.encoding == Encoding::Linear, "{name}")
            }
            "a.hdr" => {
                assert_eq!(picture.encoding, Encoding::Linear);
                for (got, want) in picture.pixels.iter().zip(&film.color) {
                    let scale = want.iter().copied().fold(0.0, f32::max);
                    assert!(got.iter().zip(want).all(|(g, w)| (g - w).abs() <= scale / 128.0), "{got:?} {want:?}");
                }
            }
            "a.jpg" => {
                let off = picture.pixels.iter().flatten().zip(bytes.iter().flatten()).map(|(a, b)| (a - b).abs());
                assert!(off.sum::<f32>() / (3.0 * bytes.len() as f32) < 12.0);
            }
            _ => assert!(picture.pixels == bytes && picture.encoding == Encoding::Srgb8, "{name}"),
        }
    }
}

#[test]
fn the_first_bytes_say_what_a_file_is() {
    let (folder, film) = (Folder::new(), film());
    let exr = fs::read(folder.film("a.exr", &film)).expect("it was written");
    assert_eq!(read(&folder.bytes("b.png", &exr)).pixels, film.color);
    for (name, bytes) in [("text", &b"solid"[..]), ("empty", b""), ("one", b"P"), ("pf", b"PF")] {
        let said = refused(&folder.bytes(name, bytes));
        assert!(said.contains(name) && said.contains("PNG, JPEG, BMP, HDR, PNM, PFM or EXR"), "{said}");
    }
    assert!(refused(&folder.path("none.png")).starts_with("cannot read "));
    assert!(refused(folder.0.path()).starts_with("cannot read "), "a folder");
}

#[test]
fn layers_of_an_exr() {
    let (folder, film) = (Folder::new(), film());
    let path = folder.film("a.exr", &film);
    let layer = |name: &str| film::read(&path, Some(name)).unwrap_or_else(|e| panic!("{e}")).pixels;
    let aov = |kind: Aov| film.aovs.iter().find(|a| a.kind == kind).expect("all were made");
    let grey = |kind: Aov| aov(kind).data.iter().map(|&v| [v; 3]).collect::<Vec<_>>();
    assert_eq!(layer("color"), film.color);
    assert_eq!(layer("depth"), grey(Aov::Depth));
    assert_eq!(layer("Z"), grey(Aov::Depth));
    assert_eq!(layer("hits"), grey(Aov::Hits));
    assert_eq!(layer("cost"), grey(Aov::Cost));
    assert_eq!(layer("samples"), grey(Aov::Samples));
    for kind in [Aov::Normal, Aov::Albedo] {
        assert_eq!(layer(kind.name()).as_flattened(), aov(kind).data);
    }
    let first = |kind: Aov, channel: usize| layer(kind.name())[3][channel];
    assert_eq!([0, 1, 2].map(|c| first(Aov::Id, c)), [3.0, 1003.0, 0.0], "object, primitive, nothing");
    let said = film::read(&path, Some("albedu")).expect_err("there is none").to_string();
    assert!(said.contains("no layer 'albedu'") && said.contains("albedo, cost, hits, id, normal, samples"), "{said}");
    let png = folder.film("a.png", &film);
    let said = film::read(&png, Some("albedo")).expect_err("a PNG has none").to_string();
    assert!(said.contains("only EXR files have layers"), "{said}");
}

#[test]
fn parts_of_an_exr_are_layers_too() {
    use exr::prelude::*;
    let folder = Folder::new();
    let part = |name: &str, channel: &'static str, value: f32| {
        let attributes = LayerAttributes::named(Text::new_or_panic(name));
        let channels =
            AnyChannels::sort(std::iter::once(AnyChannel::new(channel, FlatSamples::F32(vec![value; 6]))).collect());
        Layer::new((3, 2), attributes, Encoding::UNCOMPRESSED, channels)
    };
    let layers = Layers::from_iter([part("left", "Y", 1.0), part("right", "Y", 2.0)]);
    let path = folder.path("parts.exr");
    let window = ImageAttributes::new(IntegerBounds::from_dimensions((3, 2)));
    Image::from_layers(window, layers).write().to_file(&path).expect("it can be written");
    let pixels = |layer| film::read(&path, layer).expect("it is whole").pixels;
    assert_eq!(pixels(None), [[1.0; 3]; 6], "the first that has a picture");
    assert_eq!(pixels(Some("right")), [[2.0; 3]; 6]);
}

/// Cut anywhere and changed anywhere, a file is refused in words or read as something; nothing panics.
#[test]
fn broken_files_are_no_panic() {
    let (folder, film) = (Folder::new(), film());
    for name in ALL {
        let whole = fs::read(folder.film(name, &film)).expect("it was written");
        let step = 1 + whole.len() / 40;
        for cut in (0..whole.len()).step_by(step).chain(whole.len() - 3..whole.len()) {
            let path = folder.bytes("cut", &whole[..cut]);
            match film::read(&path, None) {
                Err(e) => assert!(e.to_string().len() > 10),
                // What lies behind the last pixel may be missing: the last chunks of a PNG, the end of a BMP's row.
                Ok(_) => assert!(cut + 16 >= whole.len(), "{name} without the last {} bytes", whole.len() - cut),
            }
        }
        for at in (0..whole.len()).step_by(step).chain(0..whole.len().min(60)) {
            for change in [0xff, 0x01] {
                let mut bytes = whole.clone();
                bytes[at] ^= change;
                if let Ok(picture) = film::read(&folder.bytes("changed", &bytes), None) {
                    assert_eq!(picture.pixels.len(), picture.width as usize * picture.height as usize);
                }
            }
        }
    }
}

#[test]
fn the_end_of_a_jpeg_is_missed() {
    let folder = Folder::new();
    let [picture, _] = srgb8(SMALL);
    let light = tison::math::colour::linear_of_srgb8();
    let mut film = Film::new(picture.width, picture.height, &[]);
    film.color = picture.pixels.iter().map(|p| p.map(|v| light[v as usize])).collect();
    let whole = fs::read(folder.film("a.jpg", &film)).expect("it was written");
    let said = refused(&folder.bytes("half.jpg", &whole[..whole.len() / 2]));
    assert!(said.contains("half.jpg cannot be decoded: the file is cut off"), "{said}");
}
