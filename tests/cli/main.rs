//! The command as others use it: flags, exit codes, streams, files, signals.

mod bad_input;
mod commands;
mod compare;
mod error;
mod images;
mod memory;
mod meshes;
mod probe;
mod sampling;
mod scenes;
mod signals;
mod skips;
mod verify;

use assert_cmd::Command;
use std::path::{Path, PathBuf};
use std::process::Output;

/// A folder with a little mesh in it.
struct Bench {
    dir: tempfile::TempDir,
}

const TETRAHEDRON: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n";

impl Bench {
    fn new() -> Self {
        let bench = Self { dir: tempfile::tempdir().unwrap() };
        bench.write("a.obj", TETRAHEDRON);
        bench
    }

    fn path(&self, name: &str) -> PathBuf {
        self.dir.path().join(name)
    }

    fn write(&self, name: &str, text: impl AsRef<[u8]>) {
        std::fs::write(self.path(name), text).unwrap();
    }

    fn read(&self, name: &str) -> Vec<u8> {
        std::fs::read(self.path(name)).unwrap_or_else(|e| panic!("{name}: {e}"))
    }

    /// Names of all files, hidden ones included.
    fn names(&self) -> Vec<String> {
        let entries = std::fs::read_dir(self.dir.path()).unwrap();
        let mut names: Vec<_> = entries.map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }

    /// Runs tison in the folder; the words are separated by spaces.
    fn run(&self, words: &str) -> Output {
        self.command(words).output().unwrap()
    }

    fn command(&self, words: &str) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_tison"));
        command.current_dir(self.dir.path()).args(words.split_whitespace());
        command.env_remove("NO_COLOR").env_remove("RUST_BACKTRACE");
        command
    }

    /// Runs it and expects this exit code.
    #[track_caller]
    fn expect(&self, words: &str, code: i32) -> Output {
        let output = self.run(words);
        assert_eq!(output.status.code(), Some(code), "tison {words}\n{}", text(&output.stderr));
        output
    }
}

fn text(bytes: &[u8]) -> &str {
    std::str::from_utf8(bytes).expect("messages are UTF-8")
}

/// Width, height and RGB bytes of a PNG.
fn decode(png: &[u8]) -> (u32, u32, Vec<u8>) {
    let mut reader = png::Decoder::new(std::io::Cursor::new(png)).read_info().unwrap();
    let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
    let info = reader.next_frame(&mut pixels).unwrap();
    assert_eq!(info.color_type, png::ColorType::Rgb);
    (info.width, info.height, pixels)
}

fn decode_file(path: &Path) -> (u32, u32, Vec<u8>) {
    decode(&std::fs::read(path).unwrap())
}
