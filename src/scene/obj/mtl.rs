//! Reads material libraries (MTL).

use super::super::Warning;
use super::cursor::Cursor;
use super::notes::with_more;
use super::{excerpt, text, trimmed, unquoted};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// A material as its library describes it; what is absent there is absent here. Colours
/// are linear RGB as written, not clamped.
#[derive(Clone, Debug, PartialEq)]
pub struct MtlMaterial {
    /// Name, `default` for the material of faces that name none.
    pub name: String,
    /// `Ka`: ambient colour.
    pub ka: Option<[f32; 3]>,
    /// `Kd`: diffuse colour.
    pub kd: Option<[f32; 3]>,
    /// `Ks`: specular colour.
    pub ks: Option<[f32; 3]>,
    /// `Ke`: emitted colour.
    pub ke: Option<[f32; 3]>,
    /// `Tf`: colour of what is let through.
    pub tf: Option<[f32; 3]>,
    /// `Ns`: specular exponent.
    pub ns: Option<f32>,
    /// `Ni`: index of refraction.
    pub ni: Option<f32>,
    /// `d`: opacity, 1 for opaque; from `Tr` (1 - d) only where there is no `d`.
    pub d: Option<f32>,
    /// `illum`: illumination model, 0 to 10.
    pub illum: Option<u8>,
    /// `Pm`: metallic, 0 to 1.
    pub pm: Option<f32>,
    /// `Pr`: roughness, 0 to 1.
    pub pr: Option<f32>,
    /// `map_Kd`: the image, options left out, as a path without links; absent as well where
    /// there is no such file. It lies in a folder that may be read.
    pub map_kd: Option<PathBuf>,
}

impl Default for MtlMaterial {
    /// The material of faces that name none: nothing is said about it.
    fn default() -> Self {
        Self::named("default".into())
    }
}

impl MtlMaterial {
    /// A material of which only the name is known.
    #[must_use]
    pub fn named(name: String) -> Self {
        Self {
            name,
            ka: None,
            kd: None,
            ks: None,
            ke: None,
            tf: None,
            ns: None,
            ni: None,
            d: None,
            illum: None,
            pm: None,
            pr: None,
            map_kd: None,
        }
    }
}

/// A library: materials in the order of the file.
#[derive(Debug, Default)]
pub(super) struct Library {
    pub(super) path: PathBuf,
    pub(super) entries: Vec<Entry>,
    pub(super) warnings: Vec<Warning>,
}

/// A material of a library. Its image is still as written, joined to the library's folder.
#[derive(Debug)]
pub(super) struct Entry {
    pub(super) name: Box<[u8]>,
    pub(super) material: MtlMaterial,
    /// Line of its `map_Kd`.
    pub(super) map_line: u64,
}

/// Statements that are read, in the spelling of the format.
const READ: [&str; 14] = ["newmtl", "Ka", "Kd", "Ks", "Ke", "Tf", "Ns", "Ni", "d", "Tr", "illum", "Pm", "Pr", "map_Kd"];

/// Statements of the format, or in wide use, that have no effect here.
const UNUSED: [&str; 24] = [
    "map_Ka",
    "map_Ks",
    "map_Ke",
    "map_Ns",
    "map_d",
    "map_Tr",
    "map_Pr",
    "map_Pm",
    "map_Ps",
    "map_bump",
    "map_aat",
    "bump",
    "disp",
    "decal",
    "norm",
    "refl",
    "sharpness",
    "Ps",
    "Pc",
    "Pcr",
    "aniso",
    "anisor",
    "map_refl",
    "map_norm",
];

/// Reads the text of the library at `path`.
pub(super) fn parse(bytes: &[u8], path: &Path) -> Library {
    let out = Library { path: path.to_owned(), ..Library::default() };
    let mut reader = Reader { path, out, tr: None, oddities: BTreeMap::new() };
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    for (i, line) in bytes.split(|&c| c == b'\n').enumerate() {
        let line = trimmed(line);
        if !line.is_empty() && line[0] != b'#' {
            reader.statement(line, i as u64 + 1);
        }
    }
    reader.finish()
}

struct Reader<'a> {
    path: &'a Path,
    out: Library,
    /// `Tr` of the current material.
    tr: Option<f32>,
    /// What is odd, by message: the first line, and how often.
    oddities: BTreeMap<String, (u64, u64)>,
}

impl Reader<'_> {
    fn statement(&mut self, line: &[u8], number: u64) {
        let word = Cursor::new(line).word();
        let rest = trimmed(&line[word.len()..]);
        let written = excerpt(word);
        let Some(&keyword) = READ.iter().find(|k| k.eq_ignore_ascii_case(&written)) else {
            let known = UNUSED.iter().any(|k| k.eq_ignore_ascii_case(&written));
            let what = if known { "has no effect here" } else { "is no keyword of the format" };
            return self.odd(number, format!("'{written}' {what}"));
        };
        if keyword != written {
            self.odd(number, format!("'{written}' is taken for '{keyword}'"));
        }
        if keyword == "newmtl" {
            self.close();
            let name = unquoted(rest);
            if name.is_empty() {
                self.odd(number, "'newmtl' without a name".into());
            }
            let material = MtlMaterial::named(text(name));
            self.out.entries.push(Entry { name: name.into(), material, map_line: 0 });
        } else if self.out.entries.is_empty() {
            self.odd(number, format!("'{keyword}' before the first 'newmtl': skipped"));
        } else if keyword == "map_Kd" {
            self.texture(rest, number);
        } else if self.value(keyword, rest).is_none() {
            let expected = if is_color(keyword) { "one number or three" } else { "a number" };
            self.odd(number, format!("'{keyword} {}': expected {expected}, skipped", excerpt(rest)));
        }
    }

    /// Stores what `keyword` says; `None` if it cannot be read.
    fn value(&mut self, keyword: &str, rest: &[u8]) -> Option<()> {
        let m = &mut self.out.entries.last_mut()?.material;
        match keyword {
            "Ka" => m.ka = Some(color(rest)?),
            "Kd" => m.kd = Some(color(rest)?),
            "Ks" => m.ks = Some(color(rest)?),
            "Ke" => m.ke = Some(color(rest)?),
            "Tf" => m.tf = Some(color(rest)?),
            "Ns" => m.ns = Some(scalar(rest)?),
            "Ni" => m.ni = Some(scalar(rest)?),
            "d" => m.d = Some(scalar(rest.strip_prefix(b"-halo").unwrap_or(rest))?),
            "Tr" => self.tr = Some(scalar(rest)?),
            "illum" => m.illum = Some(illum(rest)?),
            "Pm" => m.pm = Some(scalar(rest)?),
            "Pr" => m.pr = Some(scalar(rest)?),
            _ => return None,
        }
        Some(())
    }

    fn texture(&mut self, rest: &[u8], number: u64) {
        let (name, options) = without_options(rest);
        if options {
            self.odd(number, "the options of 'map_Kd' have no effect here".into());
        }
        let name = text(unquoted(name)).replace('\\', "/");
        if name.is_empty() {
            return self.odd(number, "'map_Kd' without a file name: skipped".into());
        }
        let folder = self.path.parent().unwrap_or(Path::new(""));
        if let Some(entry) = self.out.entries.last_mut() {
            entry.material.map_kd = Some(folder.join(name));
            entry.map_line = number;
        }
    }

    /// The current material is complete.
    fn close(&mut self) {
        let tr = self.tr.take();
        if let Some(Entry { material: m, .. }) = self.out.entries.last_mut() {
            m.d = m.d.or(tr.map(|tr| 1.0 - tr));
        }
    }

    fn odd(&mut self, line: u64, what: String) {
        self.oddities.entry(what).and_modify(|(_, count)| *count += 1).or_insert((line, 1));
    }

    fn finish(mut self) -> Library {
        const MOST: usize = 20;
        self.close();
        let mut odd: Vec<_> = std::mem::take(&mut self.oddities).into_iter().collect();
        odd.sort_by_key(|&(_, (line, _))| line);
        let beyond = odd.len().saturating_sub(MOST);
        odd.truncate(MOST);
        let warning = |(what, (line, count))| Warning::at(self.path, line, with_more(what, count));
        self.out.warnings.extend(odd.into_iter().map(warning));
        if beyond > 0 {
            self.out.warnings.push(Warning::about(self.path, format!("{beyond} more kinds of oddities")));
        }
        self.out
    }
}

fn is_color(keyword: &str) -> bool {
    matches!(keyword, "Ka" | "Kd" | "Ks" | "Ke" | "Tf")
}

/// All numbers of `rest`, at most three; `None` if there is anything else or none.
fn numbers(rest: &[u8]) -> Option<Vec<f32>> {
    let mut c = Cursor::new(rest);
    let mut out = Vec::new();
    while c.more() {
        let x = c.number()? as f32;
        if !x.is_finite() || !c.word_ends() || out.len() == 3 {
            return None;
        }
        out.push(x);
    }
    Some(out)
}

fn scalar(rest: &[u8]) -> Option<f32> {
    match numbers(rest)?[..] {
        [x] => Some(x),
        _ => None,
    }
}

/// A whole number, which some exporters write with a point.
fn illum(rest: &[u8]) -> Option<u8> {
    let x = scalar(rest)?;
    (x.fract() == 0.0 && (0.0..=10.0).contains(&x)).then_some(x as u8)
}

/// One number is a grey.
fn color(rest: &[u8]) -> Option<[f32; 3]> {
    match numbers(rest)?[..] {
        [x] => Some([x; 3]),
        [r, g, b] => Some([r, g, b]),
        _ => None,
    }
}

/// The file name of a texture statement, which may have spaces in it, and whether there
/// were options before it.
fn without_options(mut rest: &[u8]) -> (&[u8], bool) {
    let mut any = false;
    loop {
        let option = Cursor::new(rest).word();
        let (least, most) = match option {
            b"-blendu" | b"-blendv" | b"-boost" | b"-bm" | b"-cc" | b"-clamp" | b"-imfchan" | b"-texres" | b"-type" => {
                (1, 1)
            }
            b"-mm" => (2, 2),
            b"-o" | b"-s" | b"-t" => (1, 3),
            _ => return (rest, any),
        };
        any = true;
        rest = trimmed(&rest[option.len()..]);
        for i in 0..most {
            let word = Cursor::new(rest).word();
            if i >= least && scalar(word).is_none() {
                break;
            }
            rest = trimmed(&rest[word.len()..]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Library {
        parse(text.as_bytes(), Path::new("lib/a.mtl"))
    }

    fn only(text: &str) -> MtlMaterial {
        let library = read(text);
        assert_eq!(library.entries.len(), 1);
        library.entries[0].material.clone()
    }

    #[test]
    fn every_statement() {
        let m = only(
            "\u{feff}newmtl a\r\nKa 1 1 1\nKd 0.5\n\tKs 1e-1 .2 3 # note\nKe 0 0 0\nTf 1 0 0\nNs 96.5\nNi 1.5\n\
             d 0.25\nTr 0.1\nillum 7\nPm 1\nPr 0.5\nmap_Kd tex\\my wood.png\n",
        );
        assert_eq!(
            m,
            MtlMaterial {
                name: "a".into(),
                ka: Some([1.0; 3]),
                kd: Some([0.5; 3]),
                ks: Some([0.1, 0.2, 3.0]),
                ke: Some([0.0; 3]),
                tf: Some([1.0, 0.0, 0.0]),
                ns: Some(96.5),
                ni: Some(1.5),
                d: Some(0.25),
                illum: Some(7),
                pm: Some(1.0),
                pr: Some(0.5),
                map_kd: Some("lib/tex/my wood.png".into()),
            }
        );
    }

    #[test]
    fn transparency_counts_where_opacity_is_absent() {
        assert_eq!(only("newmtl a\nTr 0.25").d, Some(0.75));
        assert_eq!(only("newmtl a\nTr 0.25\nd 0.5").d, Some(0.5));
        assert_eq!(only("newmtl a\nd -halo 0.5").d, Some(0.5));
        let two = read("newmtl a\nTr 0.25\nnewmtl b\n");
        assert_eq!((two.entries[0].material.d, two.entries[1].material.d), (Some(0.75), None));
    }

    #[test]
    fn texture_options_are_left_out() {
        for (written, want) in [
            ("-s 1 1 1 a.png", "lib/a.png"),
            ("-o 0.5 a b.png", "lib/a b.png"),
            ("-bm 2 -mm 0 1 -clamp on \"a.png\"", "lib/a.png"),
            ("-s 1 1 1 1.png", "lib/1.png"),
            ("/abs/a.png", "/abs/a.png"),
        ] {
            let library = read(&format!("newmtl a\nmap_Kd {written}\n"));
            assert_eq!(library.entries[0].material.map_kd, Some(want.into()), "{written}");
            assert_eq!(library.warnings.len(), usize::from(written.starts_with('-')), "{written}");
        }
    }

    #[test]
    fn what_cannot_be_read_is_skipped_and_told_once() {
        let library =
            read("Kd 1\nnewmtl a\nKd 1 2\nKd x\nKd nan\nKd 1 2 3 4\nNs\nillum 2.5\nfoo\nfoo\nnorm a\nkd 0.5\n");
        assert_eq!(library.entries[0].material, MtlMaterial { kd: Some([0.5; 3]), ..MtlMaterial::named("a".into()) });
        let told: Vec<_> = library.warnings.iter().map(ToString::to_string).collect();
        assert_eq!(
            told,
            [
                "lib/a.mtl:1: 'Kd' before the first 'newmtl': skipped",
                "lib/a.mtl:3: 'Kd 1 2': expected one number or three, skipped",
                "lib/a.mtl:4: 'Kd x': expected one number or three, skipped",
                "lib/a.mtl:5: 'Kd nan': expected one number or three, skipped",
                "lib/a.mtl:6: 'Kd 1 2 3 4': expected one number or three, skipped",
                "lib/a.mtl:7: 'Ns ': expected a number, skipped",
                "lib/a.mtl:8: 'illum 2.5': expected a number, skipped",
                "lib/a.mtl:9: 'foo' is no keyword of the format (and 1 more like it)",
                "lib/a.mtl:11: 'norm' has no effect here",
                "lib/a.mtl:12: 'kd' is taken for 'Kd'",
            ]
        );
    }
}
