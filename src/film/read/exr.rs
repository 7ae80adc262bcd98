//! OpenEXR: one layer of its channels.
//!
//! A channel's full name is that of its part, if it has one, a dot, and its own; a layer is what stands before the
//! last dot, or a channel without one.

use super::{DECODER, Encoding, Picture};
use ::exr::error::Error as ExrError;
use ::exr::image::{AnyChannels, FlatSamples, Image, Layer};
use ::exr::meta::MetaData;
use ::exr::prelude::{ReadChannels, ReadLayers, read as reader};
use std::collections::BTreeSet;
use std::io::Cursor;

/// Why there is no picture.
#[derive(Debug)]
pub enum Error {
    /// What layers there are.
    NoLayer(String),
    /// In words that go on after the file's name.
    Bad(String),
}

/// Whether a file begins as one.
pub fn is_exr(bytes: &[u8]) -> bool {
    bytes.starts_with(&[0x76, 0x2f, 0x31, 0x01])
}

/// Reads `layer`, or the colours.
pub fn read(bytes: &[u8], layer: Option<&str>) -> Result<Picture, Error> {
    let bad = |e: ExrError| Error::Bad(format!("cannot be decoded: {e}"));
    let meta = MetaData::read_from_buffered(Cursor::new(bytes), false).map_err(bad)?;
    check_sizes(&meta).map_err(Error::Bad)?;
    let image = reader().no_deep_data().largest_resolution_level().all_channels().all_layers().all_attributes();
    let image = image.from_buffered(Cursor::new(bytes)).map_err(bad)?;
    let channels = Channel::all(&image);
    let chosen = channels_of(&channels, layer).ok_or_else(|| Error::NoLayer(layers(&channels)))?;
    Ok(picture(&chosen))
}

/// Before anything of that size is made.
fn check_sizes(meta: &MetaData) -> Result<(), String> {
    let mut bytes = 0u64;
    for header in &meta.headers {
        let size = header.layer_size;
        let side = |n: usize| u32::try_from(n).unwrap_or(u32::MAX);
        bytes = bytes.saturating_add(
            (size.width() as u64)
                .saturating_mul(size.height() as u64)
                .saturating_mul(header.channels.bytes_per_pixel as u64),
        );
        DECODER.check_size((side(size.width()), side(size.height())), bytes)?;
    }
    Ok(())
}

/// One channel of one part.
#[derive(Clone, Debug)]
struct Channel<'a> {
    name: String,
    width: usize,
    height: usize,
    samples: &'a FlatSamples,
}

impl<'a> Channel<'a> {
    fn all(image: &'a Image<::exr::image::Layers<AnyChannels<FlatSamples>>>) -> Vec<Self> {
        let several = image.layer_data.len() > 1;
        let of_layer = |layer: &'a Layer<AnyChannels<FlatSamples>>| {
            let part = layer.attributes.layer_name.as_ref().filter(|_| several).map(ToString::to_string);
            layer.channel_data.list.iter().map(move |channel| Self {
                name: part.iter().map(|p| format!("{p}.")).collect::<String>() + &channel.name.to_string(),
                width: layer.size.width(),
                height: layer.size.height(),
                samples: &channel.sample_data,
            })
        };
        image.layer_data.iter().flat_map(of_layer).collect()
    }

    fn layer(&self) -> &str {
        self.name.rsplit_once('.').map_or("", |(layer, _)| layer)
    }

    fn last(&self) -> &str {
        self.name.rsplit_once('.').map_or(&self.name, |(_, last)| last)
    }
}

/// One channel, or two or three of one layer.
fn channels_of<'c, 'a>(channels: &'c [Channel<'a>], layer: Option<&str>) -> Option<Vec<&'c Channel<'a>>> {
    let Some(layer) = layer else {
        // Colours of no layer, or of the first one that has any.
        return std::iter::once("").chain(channels.iter().map(Channel::layer)).find_map(|l| colours(channels, l));
    };
    let layer = if layer == "depth" { "Z" } else { layer };
    if let Some(alone) = channels.iter().find(|c| c.name == layer) {
        return Some(vec![alone]);
    }
    let layer = if layer == "color" && channels.iter().all(|c| c.layer() != "color") { "" } else { layer };
    colours(channels, layer).or_else(|| {
        let mut of_layer: Vec<_> = channels.iter().filter(|c| !layer.is_empty() && c.layer() == layer).collect();
        // As they are named: X before Y before Z, object before primitive.
        of_layer.sort_by(|a, b| a.last().cmp(b.last()));
        of_layer.truncate(3);
        (!of_layer.is_empty()).then_some(of_layer)
    })
}

fn colours<'c, 'a>(channels: &'c [Channel<'a>], layer: &str) -> Option<Vec<&'c Channel<'a>>> {
    let one = |name: &str| channels.iter().find(|c| c.layer() == layer && c.last() == name);
    let rgb: Option<Vec<_>> = ["R", "G", "B"].into_iter().map(one).collect();
    rgb.or_else(|| one("Y").filter(|_| one("X").is_none()).map(|y| vec![y]))
}

fn layers(channels: &[Channel<'_>]) -> String {
    let named: BTreeSet<&str> =
        channels.iter().map(|c| if c.layer().is_empty() { &c.name } else { c.layer() }).collect();
    match named.is_empty() {
        true => "no channel at all".into(),
        false => format!("there are {}", named.into_iter().collect::<Vec<_>>().join(", ")),
    }
}

/// Three channels are a colour, one is grey, two leave the third at 0.
fn picture(chosen: &[&Channel<'_>]) -> Picture {
    let (width, height) = (chosen[0].width, chosen[0].height);
    let mut pixels = vec![[0.0; 3]; width * height];
    for (i, channel) in chosen.iter().enumerate() {
        pixels.iter_mut().zip(channel.samples.values_as_f32()).for_each(|(p, v)| p[i] = v);
    }
    if let [_] = chosen {
        pixels.iter_mut().for_each(|p| *p = [p[0]; 3]);
    }
    let side = |n: usize| u32::try_from(n).expect("its size was checked");
    Picture { width: side(width), height: side(height), encoding: Encoding::Linear, pixels, transparent: false }
}
