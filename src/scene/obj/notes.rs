//! What is odd but readable, gathered piece by piece: one entry a kind.

use super::excerpt;

/// Keywords of the format that have no effect here, and none that could be missed.
const HARMLESS: [&[u8]; 9] = [b"o", b"g", b"s", b"mg", b"lod", b"bevel", b"c_interp", b"d_interp", b"shadow_obj"];

/// Keywords of the format whose effect is missed.
const UNSUPPORTED: [&[u8]; 36] = [
    b"vp",
    b"deg",
    b"bmat",
    b"step",
    b"cstype",
    b"curv",
    b"curv2",
    b"surf",
    b"parm",
    b"trim",
    b"hole",
    b"scrv",
    b"sp",
    b"end",
    b"con",
    b"trace_obj",
    b"ctech",
    b"stech",
    b"maplib",
    b"usemap",
    b"call",
    b"csh",
    b"fo",
    b"bsp",
    b"bzp",
    b"cdc",
    b"cdp",
    b"res",
    b"xyz",
    b"rgb",
    b"lf",
    b"l2",
    b"p2",
    b"vc",
    b"usemat",
    b"matlib",
];

/// A kind of oddity; ordered as the warnings are when two kinds begin on one line.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Kind {
    ShortFace,
    Polyline,
    PointElement,
    VertexColor,
    NamelessMaterial,
    NamelessLibrary,
    WrongCase,
    Unsupported(u8),
    Unknown,
}

/// Occurrences of one kind.
#[derive(Clone, Debug)]
pub(super) struct Note {
    pub(super) kind: Kind,
    pub(super) count: u64,
    /// Where the first one is, in the file.
    pub(super) offset: u64,
    /// The word of the first one.
    word: String,
}

/// One note a kind.
#[derive(Clone, Debug, Default)]
pub(super) struct Notes(Vec<Note>);

impl Notes {
    /// Notes one more of `kind`; offsets must not decrease from call to call.
    #[cold]
    pub(super) fn add(&mut self, kind: Kind, offset: u64, word: &[u8]) {
        match self.0.iter_mut().find(|n| n.kind == kind) {
            Some(n) => n.count += 1,
            None => self.0.push(Note { kind, count: 1, offset, word: excerpt(word) }),
        }
    }

    /// Notes a line that begins with `word`, which carries no geometry.
    pub(super) fn add_keyword(&mut self, offset: u64, word: &[u8]) {
        if HARMLESS.contains(&word) {
            return;
        }
        let kind = if let Some(i) = UNSUPPORTED.iter().position(|&k| k == word) {
            Kind::Unsupported(i as u8)
        } else if is_known(&word.to_ascii_lowercase()) {
            Kind::WrongCase
        } else {
            Kind::Unknown
        };
        self.add(kind, offset, word);
    }

    /// Adds the notes of a later piece of the file.
    pub(super) fn append(&mut self, later: Self) {
        for note in later.0 {
            match self.0.iter_mut().find(|n| n.kind == note.kind) {
                Some(n) => n.count += note.count,
                None => self.0.push(note),
            }
        }
    }

    /// How many there are of `kind`.
    pub(super) fn count(&self, kind: Kind) -> u64 {
        self.0.iter().find(|n| n.kind == kind).map_or(0, |n| n.count)
    }

    /// In the order of the file.
    pub(super) fn sorted(mut self) -> Vec<Note> {
        self.0.sort_by_key(|n| (n.offset, n.kind));
        self.0
    }
}

impl Note {
    /// What to tell the user.
    pub(super) fn message(&self) -> String {
        let word = &self.word;
        let what = match self.kind {
            Kind::ShortFace => "a face needs at least three corners: skipped".into(),
            Kind::Polyline => "lines ('l') are not rendered: skipped".into(),
            Kind::PointElement => "points ('p') are not rendered: skipped".into(),
            Kind::VertexColor => "colours of vertices are not used".into(),
            Kind::NamelessMaterial => "'usemtl' without a name: the default material is used".into(),
            Kind::NamelessLibrary => "'mtllib' without a file name: skipped".into(),
            Kind::WrongCase => {
                format!("'{word}' is not understood, did you mean '{}'? Skipped", word.to_ascii_lowercase())
            }
            Kind::Unsupported(_) => format!("'{word}' is not supported: skipped"),
            Kind::Unknown => format!("'{word}' is no keyword of the format: line skipped"),
        };
        with_more(what, self.count)
    }
}

/// `what`, and how many more there are.
pub(in crate::scene) fn with_more(what: String, count: u64) -> String {
    if count > 1 { format!("{what} (and {} more like it)", count - 1) } else { what }
}

fn is_known(word: &[u8]) -> bool {
    const READ: [&[u8]; 8] = [b"v", b"vt", b"vn", b"f", b"l", b"p", b"usemtl", b"mtllib"];
    READ.contains(&word) || HARMLESS.contains(&word) || UNSUPPORTED.contains(&word)
}
