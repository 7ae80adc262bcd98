//! Reading scene files: TOML and JSON, which say the same, and the `.ray` scenes of the course.
//!
//! [`parse`] takes the text of a file to a [`SceneDesc`]; nothing that the scene names is read
//! but the files it includes. Mistakes come back all at once, up to 20, each a [`Diagnostic`]
//! with its place. TOML and JSON become one tree of values with places, which is then read by
//! hand: serde would lose the places inside of tagged values.

mod assets;
mod diagnostic;
mod include;
mod json;
mod material;
mod mistakes;
mod model;
mod object;
mod overrides;
mod ray;
mod reader;
mod size;
mod suggest;
mod toml;
mod tree;
mod write;

pub use assets::{AssetError, resolve_asset};
pub use diagnostic::{Diagnostic, Look, Severity};
pub(super) use mistakes::Mistakes;
pub use overrides::Override;
pub(super) use size::memory_needed;
pub use write::to_toml;

use super::desc::{SceneDesc, ShapeDesc};
use diagnostic::Source;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use tree::{Context, Span};

/// What reading a scene depends on beside its text.
#[derive(Clone, Debug, Default)]
pub struct ReadOptions {
    /// Keys set from outside, in this order.
    pub overrides: Vec<Override>,
    /// Folders that may hold included files, beside the scene's own.
    pub allow: Vec<PathBuf>,
}

/// Which scene format a file is in, told by the end of its name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// `.toml`
    Toml,
    /// `.json`: the keys of TOML.
    Json,
    /// `.ray`: the scene language of the course.
    Ray,
}

impl Format {
    /// The format of `path`; `None` if it is no scene file.
    #[must_use]
    pub fn of(path: &Path) -> Option<Self> {
        let known = [("toml", Self::Toml), ("json", Self::Json), ("ray", Self::Ray)];
        let extension = path.extension()?;
        known.into_iter().find(|(e, _)| extension.eq_ignore_ascii_case(e)).map(|(_, format)| format)
    }
}

/// The scene in `text`, the content of `path`, in the format of its extension; and warnings, in
/// the order of their places. Paths in it stay as written (see [`resolve_asset`]).
///
/// # Errors
/// What is wrong with it, in the order of places: at most 20 mistakes, then perhaps a note of how
/// many there are more.
pub fn parse(path: &Path, text: &[u8], options: &ReadOptions) -> Result<(SceneDesc, Vec<Diagnostic>), Vec<Diagnostic>> {
    parse_keeping(path, text, options).map(|(desc, warnings, _)| (desc, warnings))
}

/// A scene, warnings, and where mistakes are told that turn up later.
type Parsed = (SceneDesc, Vec<Diagnostic>, Mistakes);

/// [`parse`], with the text kept to show mistakes in.
pub(super) fn parse_keeping(path: &Path, text: &[u8], options: &ReadOptions) -> Result<Parsed, Vec<Diagnostic>> {
    let mut ctx = Context::default();
    let format = Format::of(path);
    let source = decode(&mut ctx, path, text, format);
    let start = Span { file: 0, start: 0, end: 0 };
    let mut desc = SceneDesc::default();
    match format {
        _ if ctx.is_unreadable() => {}
        None => ctx.error(start, |s| no_format(path, s)),
        Some(Format::Ray) => {
            desc = ray::parse(&ctx, &source);
            if !options.overrides.is_empty() && !ctx.has_errors() {
                desc = override_desc(&mut ctx, desc, options);
            }
        }
        Some(Format::Toml | Format::Json) => {
            let mut root = include::join(&mut ctx, &source, &options.allow);
            if !ctx.is_unreadable() {
                overrides::apply(&mut ctx, &mut root, &options.overrides);
                desc = model::read(&ctx, &root);
            }
        }
    }
    ctx.finish().map(|warnings| (desc, warnings, Mistakes::new(ctx)))
}

/// Takes the text in. Only a `.ray` may have bytes that are not UTF-8: old comments.
fn decode(ctx: &mut Context, path: &Path, text: &[u8], format: Option<Format>) -> Arc<Source> {
    let bad = std::str::from_utf8(text).err();
    let shown = if format.is_none() { String::new() } else { String::from_utf8_lossy(text).into_owned() };
    let source = ctx.add(path.to_owned(), shown, PathBuf::new());
    if let (Some(e), Some(Format::Toml | Format::Json)) = (bad, format) {
        // Up to there nothing was replaced; a byte order mark was taken off.
        let start = e.valid_up_to() - if text.starts_with("\u{feff}".as_bytes()) { 3 } else { 0 };
        let end = start + char::REPLACEMENT_CHARACTER.len_utf8();
        ctx.unreadable(Span { file: 0, start, end }, |s| {
            Diagnostic::error(s, "this is not UTF-8 text").expected("expected the file saved as UTF-8")
        });
    }
    source
}

fn no_format(path: &Path, spot: diagnostic::Spot) -> Diagnostic {
    let extension = path.extension().unwrap_or_default().to_string_lossy().to_lowercase();
    if extension == "scn" {
        return Diagnostic::error(spot, "the format of .scn scenes is lost")
            .expected("expected a .toml, .json or .ray scene")
            .help("it was described in a report of 2011 that gives no grammar; write the scene as .toml");
    }
    let what = if extension.is_empty() {
        "a scene file without an extension".into()
    } else {
        format!(".{extension} is no scene format")
    };
    Diagnostic::error(spot, what)
        .expected("expected a .toml, .json or .ray scene")
        .suggest(&extension, ["toml", "json", "ray"])
}

/// A scene with keys set from outside, by way of the format that has those keys.
fn override_desc(ctx: &mut Context, desc: SceneDesc, options: &ReadOptions) -> SceneDesc {
    let rewritten = format!("{} (as TOML)", ctx.source(0).path.display());
    let text = ctx.add(rewritten.into(), to_toml(&desc), PathBuf::new());
    let mut root = include::join(ctx, &text, &[]);
    overrides::apply(ctx, &mut root, &options.overrides);
    let mut out = model::read(ctx, &root);
    for (new, old) in out.materials.iter_mut().zip(&desc.materials) {
        new.place = old.place;
        if let (Some(new), Some(old)) = (&mut new.texture, &old.texture) {
            new.place = old.place;
        }
    }
    for (new, old) in out.objects.iter_mut().zip(&desc.objects) {
        new.place = old.place;
        if let (ShapeDesc::Mesh { place: new, .. }, ShapeDesc::Mesh { place: old, .. }) = (&mut new.shape, &old.shape) {
            *new = *old;
        }
    }
    out
}
