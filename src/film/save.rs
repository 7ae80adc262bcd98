//! Files that are either there whole or not at all.

use std::fs::{self, File, Metadata, OpenOptions, Permissions};
use std::io::{self, BufWriter, Cursor, Seek, Write};
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};
use tempfile::NamedTempFile;

/// Why a file was not written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
#[expect(missing_docs, reason = "the messages say it")]
pub enum SaveError {
    #[error("cannot write {}: the folder {} does not exist; make it first", path.display(), folder.display())]
    NoFolder { path: PathBuf, folder: PathBuf },
    #[error("cannot write {}: it is a folder; name a file in it", path.display())]
    IsFolder { path: PathBuf },
    #[error("cannot write {}: the file there is write-protected; choose another name or chmod u+w it", path.display())]
    Protected { path: PathBuf },
    #[error("cannot write {}", path.display())]
    Write {
        path: PathBuf,
        #[source]
        source: io::Error,
    },
}

/// What an image is written to: some formats go back to their header.
pub trait Sink: Write + Seek {}
impl<T: Write + Seek> Sink for T {}

/// Temporary files of this process that are not yet in place.
static PENDING: Mutex<Vec<PathBuf>> = Mutex::new(Vec::new());

/// Whether [`save`] can be expected to work, tried by making a file in the folder.
///
/// # Errors
///
/// The folder is missing or may not be written to, or `path` is a folder or write-protected.
pub fn check_target(path: &Path) -> Result<(), SaveError> {
    let failed = |source| SaveError::Write { path: path.to_owned(), source };
    let folder = folder_of(path);
    if !folder.is_dir() {
        return Err(SaveError::NoFolder { path: path.to_owned(), folder: folder.to_owned() });
    }
    match existing(path).map_err(failed)? {
        Some(old) if old.is_dir() => return Err(SaveError::IsFolder { path: path.to_owned() }),
        Some(old) if is_special(&old) => return Ok(()),
        // The owner of the machine may write to anything; a file without any write bit says "leave me".
        Some(old) if old.is_file() && old.permissions().readonly() => {
            return Err(SaveError::Protected { path: path.to_owned() });
        }
        _ => {}
    }
    Pending::new(folder, None).map_err(failed).map(drop)
}

/// Writes a file by way of a temporary one beside it, which takes its name when all is on
/// disk; returns its size in bytes.
///
/// The permissions of a file that is replaced are kept. A symbolic link is replaced, not
/// followed. A pipe or device is written to as it is.
///
/// # Errors
///
/// As [`check_target`], and whatever `write` or the disk reports. What was there before is
/// then untouched, and nothing else is left behind.
pub fn save(path: &Path, write: impl FnOnce(&mut dyn Sink) -> io::Result<()>) -> Result<u64, SaveError> {
    let failed = |source| SaveError::Write { path: path.to_owned(), source };
    let old = existing(path).map_err(failed)?;
    if old.as_ref().is_some_and(is_special) {
        return write_special(path, write).map_err(failed);
    }
    if old.as_ref().is_some_and(Metadata::is_dir) {
        return Err(SaveError::IsFolder { path: path.to_owned() });
    }
    let kept = old.filter(Metadata::is_file).map(|old| old.permissions());
    save_beside(path, kept, write).map_err(failed)
}

fn save_beside(
    path: &Path,
    permissions: Option<Permissions>,
    write: impl FnOnce(&mut dyn Sink) -> io::Result<()>,
) -> io::Result<u64> {
    let folder = folder_of(path);
    let pending = Pending::new(folder, permissions)?;
    let mut out = BufWriter::with_capacity(1 << 16, pending.file().as_file());
    write(&mut out)?;
    out.flush()?;
    drop(out);
    pending.file().as_file().sync_all()?;
    let bytes = pending.file().as_file().metadata()?.len();
    pending.persist(path)?;
    // Makes the new name last through a power cut. Not every file system can do this for a
    // folder, and the file itself is safe already.
    let _ = File::open(folder).and_then(|f| f.sync_all());
    Ok(bytes)
}

/// A pipe cannot be renamed over nor sought in: the file is made in memory first.
fn write_special(path: &Path, write: impl FnOnce(&mut dyn Sink) -> io::Result<()>) -> io::Result<u64> {
    let mut bytes = Cursor::new(Vec::new());
    write(&mut bytes)?;
    OpenOptions::new().write(true).open(path)?.write_all(bytes.get_ref())?;
    Ok(bytes.get_ref().len() as u64)
}

/// Removes the temporary files of every [`save`] under way and lets none begin: for a
/// process that is about to leave without unwinding.
pub fn abandon() {
    let pending = lock();
    for path in pending.iter() {
        // The process leaves whether or not this works.
        let _ = fs::remove_file(path);
    }
    std::mem::forget(pending);
}

/// Whether `path` is a pipe, socket or device.
#[must_use]
pub fn is_special_file(path: &Path) -> bool {
    fs::metadata(path).is_ok_and(|m| is_special(&m))
}

fn is_special(m: &Metadata) -> bool {
    !m.is_file() && !m.is_dir() && !m.is_symlink()
}

/// What is at `path`: a link itself, but for one that leads to a folder, pipe or device.
fn existing(path: &Path) -> io::Result<Option<Metadata>> {
    match fs::symlink_metadata(path) {
        Ok(link) if link.is_symlink() => Ok(Some(fs::metadata(path).ok().filter(|m| !m.is_file()).unwrap_or(link))),
        Ok(m) => Ok(Some(m)),
        Err(e) if e.kind() == io::ErrorKind::NotFound => Ok(None),
        Err(e) => Err(e),
    }
}

fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

fn lock() -> MutexGuard<'static, Vec<PathBuf>> {
    // A list of paths is whole after any panic.
    PENDING.lock().unwrap_or_else(PoisonError::into_inner)
}

/// A temporary file that is on the list of those to remove while it lives.
struct Pending(Option<NamedTempFile>);

impl Pending {
    fn new(folder: &Path, permissions: Option<Permissions>) -> io::Result<Self> {
        // Held while the file is made, so that `abandon` cannot come between.
        let mut list = lock();
        let mut builder = tempfile::Builder::new();
        builder.prefix(".tison-").suffix(".tmp");
        // Like any new file, less what the umask takes away; tempfile's own default is 0600.
        builder.permissions(Permissions::from_mode(0o666));
        let file = builder.tempfile_in(folder)?;
        list.push(file.path().to_owned());
        drop(list);
        let pending = Self(Some(file));
        if let Some(permissions) = permissions {
            pending.file().as_file().set_permissions(permissions)?;
        }
        Ok(pending)
    }

    fn file(&self) -> &NamedTempFile {
        self.0.as_ref().expect("taken by `persist` only, which consumes self")
    }

    fn persist(mut self, path: &Path) -> io::Result<()> {
        let file = self.0.take().expect("taken here only");
        let temporary = file.path().to_owned();
        let done = file.persist(path);
        lock().retain(|p| *p != temporary);
        // On an error the file comes back and is removed as it is dropped.
        done.map(drop).map_err(|e| e.error)
    }
}

impl Drop for Pending {
    fn drop(&mut self) {
        if let Some(file) = self.0.take() {
            let path = file.path().to_owned();
            drop(file);
            lock().retain(|p| *p != path);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(folder: &Path) -> Vec<String> {
        let mut names: Vec<_> =
            fs::read_dir(folder).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }

    #[test]
    fn a_failed_write_leaves_the_old_file_and_nothing_else() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.png");
        fs::write(&path, "old").unwrap();
        let failed = save(&path, |out| {
            out.write_all(b"half")?;
            Err(io::Error::other("the disk is full"))
        });
        assert!(matches!(failed, Err(SaveError::Write { .. })));
        assert_eq!(fs::read(&path).unwrap(), b"old");
        assert_eq!(names(dir.path()), ["a.png"]);
    }

    #[test]
    fn a_panic_in_the_writer_leaves_nothing_either() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.png");
        let panicked = std::panic::catch_unwind(|| save(&path, |_| panic!("encoder")));
        assert!(panicked.is_err());
        assert!(names(dir.path()).is_empty());
        assert_eq!(save(&path, |out| out.write_all(b"new")).unwrap(), 3);
    }

    #[test]
    fn the_permissions_of_the_old_file_are_kept() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.png");
        fs::write(&path, "old").unwrap();
        fs::set_permissions(&path, Permissions::from_mode(0o640)).unwrap();
        assert_eq!(save(&path, |out| out.write_all(b"newer")).unwrap(), 5);
        assert_eq!(fs::metadata(&path).unwrap().permissions().mode() & 0o777, 0o640);
        assert_eq!(fs::read(&path).unwrap(), b"newer");
        assert_eq!(names(dir.path()), ["a.png"]);
    }

    #[test]
    fn a_new_file_gets_the_permissions_of_any_new_file() {
        let dir = tempfile::tempdir().unwrap();
        let (ours, plain) = (dir.path().join("ours"), dir.path().join("plain"));
        save(&ours, |out| out.write_all(b"x")).unwrap();
        fs::write(&plain, "x").unwrap();
        let mode = |p: &Path| fs::metadata(p).unwrap().permissions().mode();
        assert_eq!(mode(&ours), mode(&plain));
    }

    #[test]
    fn a_link_is_replaced_and_what_it_led_to_is_left_alone() {
        let dir = tempfile::tempdir().unwrap();
        let (far, link) = (dir.path().join("far"), dir.path().join("link.png"));
        fs::write(&far, "far").unwrap();
        std::os::unix::fs::symlink(&far, &link).unwrap();
        save(&link, |out| out.write_all(b"new")).unwrap();
        assert_eq!(fs::read(&far).unwrap(), b"far");
        assert!(!fs::symlink_metadata(&link).unwrap().is_symlink());
    }

    #[test]
    fn targets_that_cannot_work_are_told_apart() {
        let dir = tempfile::tempdir().unwrap();
        let protected = dir.path().join("protected.png");
        fs::write(&protected, "x").unwrap();
        fs::set_permissions(&protected, Permissions::from_mode(0o444)).unwrap();
        assert!(matches!(check_target(&dir.path().join("no/a.png")), Err(SaveError::NoFolder { .. })));
        assert!(matches!(check_target(dir.path()), Err(SaveError::IsFolder { .. })));
        assert!(matches!(check_target(&protected), Err(SaveError::Protected { .. })));
        assert!(check_target(&dir.path().join("a.png")).is_ok());
        assert!(check_target(Path::new("/dev/null")).is_ok());
        assert_eq!(names(dir.path()), ["protected.png"], "a test of the target leaves no trace");
    }

    #[test]
    fn a_device_is_written_to_not_replaced() {
        assert_eq!(save(Path::new("/dev/null"), |out| out.write_all(b"gone")).unwrap(), 4);
        assert!(is_special_file(Path::new("/dev/null")));
    }
}
