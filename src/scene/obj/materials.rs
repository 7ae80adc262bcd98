//! Which triangle has which material, and where the materials are described.

use super::super::{Error, Warning};
use super::mtl::{self, Entry, Library, MtlMaterial};
use super::notes::with_more;
use super::survey::{Survey, Tally};
use super::{excerpt, text, trimmed, unquoted};
use rayon::prelude::*;
use std::collections::{BTreeMap, BTreeSet};
use std::io;
use std::path::{Path, PathBuf};

/// Runs of triangles with one material.
#[derive(Debug, Default)]
pub(super) struct Runs {
    /// Names in order of first use; empty for the default material.
    pub(super) names: Vec<Box<[u8]>>,
    /// First triangle of each run and its material, an index into `names`.
    starts: Vec<(u64, u32)>,
}

impl Runs {
    /// Joins what the pieces say. Materials without triangles are left out.
    pub(super) fn join(surveys: &[Survey], before: &[Tally], triangles: u64) -> Self {
        let uses = surveys.iter().zip(before).flat_map(|(s, before)| {
            s.uses.iter().map(|&(at, name)| (before.triangles + u64::from(at), &s.names[name as usize]))
        });
        let (mut out, mut known) = (Self::default(), BTreeMap::new());
        let nameless = Box::default();
        let mut current = (0, &nameless);
        for (start, name) in uses.chain([(triangles, &nameless)]) {
            if start > current.0 {
                out.add(current.0, current.1, &mut known);
            }
            current = (start, name);
        }
        out
    }

    fn add<'a>(&mut self, start: u64, name: &'a [u8], known: &mut BTreeMap<&'a [u8], u32>) {
        let id = *known.entry(name).or_insert_with(|| {
            self.names.push(name.into());
            self.names.len() as u32 - 1
        });
        if self.starts.last().is_none_or(|&(_, last)| last != id) {
            self.starts.push((start, id));
        }
    }

    /// The material of each of `triangles`; nothing if one serves all.
    pub(super) fn per_triangle(&self, triangles: usize) -> Option<Vec<u32>> {
        const PART: usize = 1 << 16;
        if self.names.len() < 2 {
            return None;
        }
        let mut out = vec![0; triangles];
        out.par_chunks_mut(PART).enumerate().for_each(|(i, part)| {
            let first = (i * PART) as u64;
            let mut run = self.starts.partition_point(|&(start, _)| start <= first) - 1;
            for (t, material) in (first..).zip(part) {
                if self.starts.get(run + 1).is_some_and(|&(start, _)| start <= t) {
                    run += 1;
                }
                *material = self.starts[run].1;
            }
        });
        Some(out)
    }
}

/// A statement that names libraries: its line, and what follows the keyword.
#[derive(Clone, Debug)]
pub(super) struct LibraryStatement {
    pub(super) line: u64,
    pub(super) argument: Box<[u8]>,
}

/// What the libraries say about the materials in use.
#[derive(Debug, Default)]
pub(super) struct Described {
    pub(super) materials: Vec<MtlMaterial>,
    /// Described, but no triangle has them.
    pub(super) unused: usize,
    /// Images that only those name.
    pub(super) unused_images: usize,
    pub(super) warnings: Vec<Warning>,
}

/// Reads what `names` need from the libraries that `obj` names, and finds the images that those
/// materials name. A library or image that is missing, or a material that none describes, is a
/// warning, and a default grey or the colour alone.
pub(super) fn describe(
    names: &[Box<[u8]>],
    statements: &[LibraryStatement],
    obj: &Path,
    allow: &[PathBuf],
) -> Result<Described, Error> {
    let mut out = Described::default();
    // Faces that name no material need no library.
    let (mut finder, mut libraries) = (Finder::new(obj, allow), Vec::new());
    if names.iter().any(|n| !n.is_empty()) {
        libraries = finder.read_all(statements, &mut out.warnings)?;
    }
    let mut described: BTreeMap<&[u8], (&Library, &Entry)> = BTreeMap::new();
    for (library, entry) in libraries.iter().flat_map(|l: &Library| l.entries.iter().map(move |e| (l, e))) {
        // The first library that has a name is the one that counts.
        described.entry(&entry.name).or_insert((library, entry));
    }
    let (mut missing, mut images) = (Vec::new(), Images::default());
    for name in names {
        out.materials.push(match described.remove(&**name) {
            Some((library, entry)) => images.find(&finder, library, entry)?,
            None if name.is_empty() => MtlMaterial::default(),
            None => {
                missing.push(name);
                MtlMaterial::named(text(name))
            }
        });
    }
    out.unused = described.len();
    let unused = described.values().filter_map(|(_, e)| e.material.map_kd.as_deref());
    out.unused_images = unused.filter(|image| !images.wanted.contains(*image)).collect::<BTreeSet<_>>().len();
    if let Some(first) = missing.first() {
        let what = format!("material '{}' is not in any library: shown in grey", excerpt(first));
        out.warnings.push(Warning::about(obj, with_more(what, missing.len() as u64)));
    }
    out.warnings.extend(images.warning());
    if names.is_empty() {
        out.materials.push(MtlMaterial::default());
    }
    out.warnings.extend(libraries.into_iter().flat_map(|l| l.warnings));
    Ok(out)
}

/// Images that materials in use name.
#[derive(Default)]
struct Images {
    /// As written, below the library's folder.
    wanted: BTreeSet<PathBuf>,
    /// The first that is not there, and how many those are.
    missing: Option<(Warning, u64)>,
}

impl Images {
    /// The material of `entry` with the path of its image, if it has one that is there.
    fn find(&mut self, finder: &Finder<'_>, library: &Library, entry: &Entry) -> Result<MtlMaterial, Error> {
        let mut material = entry.material.clone();
        let Some(written) = material.map_kd.take() else { return Ok(material) };
        material.map_kd = finder.image(&written, library, entry.map_line)?;
        if self.wanted.insert(written.clone()) && material.map_kd.is_none() {
            let what = format!("image '{}' is not there: Kd is used alone", written.display());
            let first = || (Warning::at(&library.path, entry.map_line, what), 0);
            self.missing.get_or_insert_with(first).1 += 1;
        }
        Ok(material)
    }

    fn warning(self) -> Option<Warning> {
        self.missing.map(|(first, count)| Warning { what: with_more(first.what, count), ..first })
    }
}

/// Finds libraries and images, but only in the folders that may be read.
struct Finder<'a> {
    obj: &'a Path,
    folder: PathBuf,
    /// With links resolved.
    allowed: Vec<PathBuf>,
    read: BTreeSet<PathBuf>,
}

impl<'a> Finder<'a> {
    fn new(obj: &'a Path, allow: &[PathBuf]) -> Self {
        let folder = match obj.parent() {
            Some(p) if p != Path::new("") => p.to_owned(),
            _ => PathBuf::from("."),
        };
        let allowed = std::iter::once(&folder).chain(allow).filter_map(|p| p.canonicalize().ok()).collect();
        Self { obj, folder, allowed, read: BTreeSet::new() }
    }

    fn read_all(&mut self, statements: &[LibraryStatement], out: &mut Vec<Warning>) -> Result<Vec<Library>, Error> {
        let mut libraries = Vec::new();
        for s in statements {
            // The whole argument may be one name with spaces in it, or be several names.
            if let Some(path) = self.find(unquoted(&s.argument), s.line)? {
                libraries.extend(self.load(&path, s.line, out));
                continue;
            }
            for name in file_names(&s.argument) {
                match self.find(name, s.line)? {
                    Some(path) => libraries.extend(self.load(&path, s.line, out)),
                    None => {
                        let what =
                            format!("material library '{}' is not there: faces are shown in grey", excerpt(name));
                        out.push(Warning::at(self.obj, s.line, what));
                    }
                }
            }
        }
        Ok(libraries)
    }

    /// The file that `name` means: as written, or with slashes for backslashes, or next to the OBJ
    /// under its last name.
    fn find(&self, name: &[u8], line: u64) -> Result<Option<PathBuf>, Error> {
        let written = text(name);
        let slashed = written.replace('\\', "/");
        let last = slashed.rsplit('/').next().unwrap_or_default().to_owned();
        let candidates = [written, slashed, last].map(|name| self.folder.join(name));
        self.first_file(&candidates).map_err(|target| Error::Forbidden { path: self.obj.to_owned(), line, target })
    }

    /// The file of the image `written` on `line` of `library`, or the one of its name next to that.
    fn image(&self, written: &Path, library: &Library, line: u64) -> Result<Option<PathBuf>, Error> {
        let beside = written.file_name().map(|name| library.path.with_file_name(name));
        let candidates: Vec<_> = std::iter::once(written.to_owned()).chain(beside).collect();
        self.first_file(&candidates).map_err(|target| Error::Forbidden { path: library.path.clone(), line, target })
    }

    /// The first of `candidates` that is a file, links resolved. An error, if that may not be read.
    fn first_file(&self, candidates: &[PathBuf]) -> Result<Option<PathBuf>, PathBuf> {
        let files = candidates.iter().filter_map(|c| c.canonicalize().ok()).find(|target| target.is_file());
        match files {
            Some(target) if !self.allowed.iter().any(|folder| target.starts_with(folder)) => Err(target),
            found => Ok(found),
        }
    }

    /// Reads a library, unless it was read before.
    fn load(&mut self, path: &Path, line: u64, out: &mut Vec<Warning>) -> Option<Library> {
        const LARGEST: u64 = 64 << 20;
        if !self.read.insert(path.to_owned()) {
            return None;
        }
        let bytes = std::fs::metadata(path).and_then(|meta| match meta.len() {
            0..=LARGEST => std::fs::read(path),
            n => Err(io::Error::other(format!("{n} bytes are too much for a material library"))),
        });
        match bytes {
            Ok(bytes) => Some(mtl::parse(&bytes, path)),
            Err(e) => {
                let what = format!("cannot read the material library {}: {e}", path.display());
                out.push(Warning::at(self.obj, line, what));
                None
            }
        }
    }
}

/// Names separated by blanks, each perhaps in quotes.
fn file_names(argument: &[u8]) -> Vec<&[u8]> {
    let (mut out, mut rest) = (Vec::new(), trimmed(argument));
    while let Some(&first) = rest.first() {
        let quoted = rest.len() > 1 && first == b'"';
        let body = &rest[usize::from(quoted)..];
        let end = body.iter().position(|&c| if quoted { c == b'"' } else { c <= b' ' }).unwrap_or(body.len());
        out.push(&body[..end]);
        rest = trimmed(&body[(end + usize::from(quoted)).min(body.len())..]);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    fn survey(uses: &[(u32, &str)], triangles: u64) -> Survey {
        let tally = Tally { triangles, ..Tally::default() };
        let names = uses.iter().map(|&(_, name)| name.as_bytes().into()).collect();
        let uses = uses.iter().zip(0..).map(|(&(at, _), name)| (at, name)).collect();
        Survey { tally, names, uses, ..Survey::default() }
    }

    #[test]
    fn runs_go_on_across_pieces_and_empty_ones_vanish() {
        let surveys = [
            survey(&[(1, "a"), (2, "unused"), (2, "b")], 3),
            survey(&[], 2),
            survey(&[(0, "b"), (2, "a"), (4, "last")], 4),
        ];
        let (before, total) = super::super::survey::running_totals(&surveys);
        let runs = Runs::join(&surveys, &before, total.triangles);
        let names: Vec<_> = runs.names.iter().map(|n| text(n)).collect();
        assert_eq!(names, ["", "a", "b"]);
        assert_eq!(runs.per_triangle(9), Some(vec![0, 1, 2, 2, 2, 2, 2, 1, 1]));
        let one = [survey(&[(0, "a")], 5)];
        let (before, _) = super::super::survey::running_totals(&one);
        assert_eq!(Runs::join(&one, &before, 5).per_triangle(5), None);
    }

    #[test]
    fn long_runs_are_filled_in_parts() {
        let n = 200_001;
        let runs =
            Runs { names: vec![Box::default(); 2], starts: vec![(0, 1), (70_000, 0), (131_072, 1), (200_000, 0)] };
        let got = runs.per_triangle(n).expect("two materials");
        for (t, &m) in got.iter().enumerate() {
            let want = matches!(t, 0..70_000 | 131_072..200_000);
            assert_eq!(m, u32::from(want), "triangle {t}");
        }
    }

    #[test]
    fn names_in_one_statement() {
        let names = |s: &'static str| file_names(s.as_bytes()).into_iter().map(text).collect::<Vec<_>>();
        assert_eq!(names("a.mtl  b.mtl"), ["a.mtl", "b.mtl"]);
        assert_eq!(names("\"a b.mtl\" c.mtl \"d"), ["a b.mtl", "c.mtl", "d"]);
        assert!(names("").is_empty());
    }
}
