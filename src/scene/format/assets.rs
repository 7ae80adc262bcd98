//! Which file a path in a scene means, and whether the scene may name it.

use std::io;
use std::path::{Component, Path, PathBuf};

/// Why a file that a scene names cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum AssetError {
    /// It is not there.
    #[error("there is no file {}; looked for {}", written.display(), list(tried))]
    NotFound {
        /// As the scene says it.
        written: PathBuf,
        /// Where it could have been.
        tried: Vec<PathBuf>,
    },
    /// It is there, but not where the scene may reach.
    #[error(
        "{} is outside of {}, where the scene may name files; \
         move it there, or allow its folder with --allow-path {}",
        path.display(), folder.display(), path.parent().unwrap_or(path).display()
    )]
    Outside {
        /// The file, symbolic links followed.
        path: PathBuf,
        /// The folder that it would have to be in.
        folder: PathBuf,
    },
    /// Its place cannot be told.
    #[error("cannot look for {}", path.display())]
    Read {
        /// The path in question.
        path: PathBuf,
        /// What the system said.
        #[source]
        source: io::Error,
    },
}

fn list(paths: &[PathBuf]) -> String {
    paths.iter().map(|p| p.display().to_string()).collect::<Vec<_>>().join(", ")
}

/// The file that `written` means in the scene file `scene_file` (the one on the command line), as
/// an absolute path without symbolic links.
///
/// A `.ray` scene finds files next to itself, then in each folder above it but the root of the
/// file system; every other scene finds them below its own folder. A file that a symbolic link or
/// `..` leads out of the folder it was looked for in is refused, unless it is in one of the
/// folders `allow` (or below).
///
/// # Errors
/// [`AssetError`]: nothing there, or out of reach.
pub fn resolve_asset(scene_file: &Path, written: &Path, allow: &[PathBuf]) -> Result<PathBuf, AssetError> {
    let parent = scene_file.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let home = canonical(parent)?;
    let upward = scene_file.extension().is_some_and(|e| e.eq_ignore_ascii_case("ray"));
    if written.is_absolute() || !upward {
        return find(&[(home.clone(), home.join(written))], written, allow);
    }
    // What leads up is looked for in the folder it leads to.
    let ups = written.components().take_while(|&c| c == Component::ParentDir).count();
    let below: PathBuf = written.components().skip(ups).filter(|c| *c != Component::CurDir).collect();
    let folders = home.ancestors().skip(ups).filter(|f| f.parent().is_some() || *f == home);
    let mut places: Vec<_> = folders.map(|f| (f.to_owned(), f.join(&below))).collect();
    if ups > 0 {
        places.truncate(1);
    }
    if places.is_empty() {
        places.push((home.clone(), home.join(written)));
    }
    find(&places, written, allow)
}

/// The first of `places` (folder, file) with a file in it.
fn find(places: &[(PathBuf, PathBuf)], written: &Path, allow: &[PathBuf]) -> Result<PathBuf, AssetError> {
    let mut refused = None;
    for (folder, path) in places {
        let real = match canonical(path) {
            Ok(real) if real.is_file() => real,
            Ok(_) => continue,
            Err(AssetError::Read { source, .. }) if missing(&source) => continue,
            Err(e) => return Err(e),
        };
        let allowed = || allow.iter().any(|dir| dir.canonicalize().is_ok_and(|dir| real.starts_with(dir)));
        if real.starts_with(folder) || allowed() {
            return Ok(real);
        }
        refused.get_or_insert(AssetError::Outside { path: real, folder: folder.clone() });
    }
    let tried = || places.iter().map(|(_, path)| path.clone()).collect();
    Err(refused.unwrap_or_else(|| AssetError::NotFound { written: written.to_owned(), tried: tried() }))
}

/// A file in the way of a folder means as much as nothing there.
fn missing(e: &io::Error) -> bool {
    matches!(e.kind(), io::ErrorKind::NotFound | io::ErrorKind::NotADirectory | io::ErrorKind::InvalidInput)
}

fn canonical(path: &Path) -> Result<PathBuf, AssetError> {
    path.canonicalize().map_err(|source| AssetError::Read { path: path.to_owned(), source })
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    struct Folders {
        dir: tempfile::TempDir,
    }

    impl Folders {
        fn new() -> Self {
            let dir = tempfile::tempdir().expect("a folder for the test");
            let scene =
                ["course/scene/a.ray", "course/scene/a.toml", "course/scene/near.obj", "course/scene/sub/d.obj"];
            for path in scene.into_iter().chain(["course/data/b.obj", "secret/c.obj"]) {
                let file = dir.path().join(path);
                fs::create_dir_all(file.parent().expect("it has one")).expect("a folder");
                fs::write(file, "").expect("a file");
            }
            Self { dir }
        }

        fn path(&self, below: &str) -> PathBuf {
            self.dir.path().canonicalize().expect("it is there").join(below)
        }

        fn ask(&self, scene: &str, written: &str, allow: &[&str]) -> Result<PathBuf, AssetError> {
            let allow: Vec<_> = allow.iter().map(|a| self.path(a)).collect();
            resolve_asset(&self.path(scene), Path::new(written), &allow)
        }
    }

    #[test]
    fn files_are_found_where_each_format_looks() {
        let f = Folders::new();
        let found = |scene, written, want| assert_eq!(f.ask(scene, written, &[]).expect(written), f.path(want));
        found("course/scene/a.ray", "near.obj", "course/scene/near.obj");
        found("course/scene/a.ray", "data/b.obj", "course/data/b.obj");
        found("course/scene/a.ray", "../data/b.obj", "course/data/b.obj");
        found("course/scene/a.ray", "./sub/../near.obj", "course/scene/near.obj");
        found("course/scene/a.toml", "sub/d.obj", "course/scene/sub/d.obj");
        found("course/scene/a.toml", "sub/../near.obj", "course/scene/near.obj");
    }

    #[test]
    fn nothing_else_is_reached_unless_allowed() {
        let f = Folders::new();
        let absolute = f.path("secret/c.obj");
        let absolute = absolute.to_str().expect("the test's folder has a plain name");
        for (scene, written) in [
            ("course/scene/a.toml", "../data/b.obj"),
            ("course/scene/a.toml", absolute),
            ("course/scene/a.ray", absolute),
        ] {
            let e = f.ask(scene, written, &[]).expect_err(written);
            assert!(matches!(e, AssetError::Outside { .. }), "{e}");
            assert!(e.to_string().contains("--allow-path"), "{e}");
            f.ask(scene, written, &["course", "secret"]).expect(written);
        }
        // The root of the file system is nobody's project folder.
        let e = f.ask("course/scene/a.ray", "etc/passwd", &[]).expect_err("out of reach");
        assert!(matches!(e, AssetError::NotFound { .. }), "{e}");
        let e = f.ask("course/scene/a.ray", "no.obj", &[]).expect_err("not there");
        assert!(e.to_string().contains("course/scene/no.obj"), "{e}");
        // A file where a folder should be, and a folder where a file should be.
        f.ask("course/scene/a.toml", "near.obj/x.obj", &[]).expect_err("not there");
        f.ask("course/scene/a.toml", "sub", &[]).expect_err("no file");
    }

    #[cfg(unix)]
    #[test]
    fn symbolic_links_do_not_lead_out() {
        let f = Folders::new();
        std::os::unix::fs::symlink(f.path("secret"), f.path("course/scene/link")).expect("a link");
        for scene in ["course/scene/a.toml", "course/scene/a.ray"] {
            let e = f.ask(scene, "link/c.obj", &[]).expect_err("out of reach");
            assert!(matches!(e, AssetError::Outside { .. }), "{e}");
            f.ask(scene, "link/c.obj", &["secret"]).expect("allowed");
        }
    }
}
