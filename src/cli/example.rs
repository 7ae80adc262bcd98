//! `example`: things to start from.

use super::args::Example;
use super::exit::{Exit, Failure};
use super::message::Messages;
use super::output;
use super::signals::Signals;
use super::style::{bytes, counted};
use std::io::{self, Write};
use std::path::Path;
use std::sync::Arc;
use tison::film::{self, SaveError};
use tison::render::Control;
use tison::scene::example;

const NAMES: &str = "\
scene  a first scene file with comments: a ball, a box, a cylinder, a floor, a lens and lights:
       tison example scene -o scene.toml && tison scene.toml
mesh   a closed, displaced sphere of radius about 1 with normals, as large as you like:
       tison example mesh --triangles 1000000 -o ball.obj
";

/// Writes the example called `name`, or lists the names.
pub fn example(name: Option<&Example>, messages: &Messages) -> Result<Exit, Failure> {
    match name {
        None => output::print(NAMES.as_bytes()),
        Some(Example::Scene { output }) => scene(output.as_deref(), messages),
        Some(Example::Mesh { triangles, output }) => mesh(*triangles, output, messages),
    }
}

/// A file is something to change: what somebody made of it is not replaced.
fn scene(path: Option<&Path>, messages: &Messages) -> Result<Exit, Failure> {
    let text = example::FIRST_SCENE;
    let Some(path) = path.filter(|p| p.as_os_str() != "-") else { return output::print(text.as_bytes()) };
    film::check_target(path)?;
    let is_other = |old: Vec<u8>| old != text.as_bytes();
    if !film::is_special_file(path) && std::fs::read(path).is_ok_and(is_other) {
        let what = format!("cannot write {}: there is such a file already", path.display());
        return Err(Failure::new(Exit::Output, what).help("name another one, or remove it first"));
    }
    let size = film::save(path, |out| out.write_all(text.as_bytes()))?;
    messages.line(&format!("wrote     {} ({})", path.display(), bytes(size)));
    Ok(Exit::Done)
}

fn mesh(triangles: u64, path: &Path, messages: &Messages) -> Result<Exit, Failure> {
    let control = Arc::new(Control::default());
    let signals =
        Signals::install(&control).map_err(|e| Failure::new(Exit::Internal, "cannot listen for signals").because(e))?;
    film::check_target(path)?;
    let mut counts = None;
    let saved = film::save(path, |out| {
        counts = Some(example::write_mesh(triangles, &mut Cancellable { out, control: &control })?);
        Ok(())
    });
    let size = match (saved, signals.caught()) {
        (Ok(size), _) => size,
        (Err(_), Some(exit)) => return Err(Failure::new(exit, "stopped: nothing is written")),
        (Err(SaveError::Write { source, .. }), _) if source.kind() == io::ErrorKind::InvalidInput => {
            return Err(Failure::usage(source.to_string()));
        }
        (Err(e), None) => return Err(e.into()),
    };
    if let Some(c) = counts {
        let (triangles, vertices) = (counted(c.triangles, "triangle"), counted(c.vertices, "vertex"));
        messages.line(&format!("wrote     {} ({}): {triangles}, {vertices}", path.display(), bytes(size)));
    }
    Ok(signals.caught().unwrap_or(Exit::Done))
}

/// Fails the next write once a signal has come.
struct Cancellable<'a, W: Write + ?Sized> {
    out: &'a mut W,
    control: &'a Control,
}

impl<W: Write + ?Sized> Write for Cancellable<'_, W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        // Not `Interrupted`, which means "try again" to every caller.
        if self.control.is_cancelled() { Err(io::Error::other("stopped")) } else { self.out.write(bytes) }
    }

    fn flush(&mut self) -> io::Result<()> {
        self.out.flush()
    }
}
