//! SIGINT and SIGTERM.

use super::{Bench, decode_file, text};
use std::io::{BufRead, BufReader, Read};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

/// A run takes 0.3 s to stop; these machines have other things to do.
const PATIENCE: Duration = Duration::from_secs(10);

/// A process that does not outlive its test.
struct Process(Child);

impl Drop for Process {
    fn drop(&mut self) {
        // It has ended already, if all went well.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

fn start(bench: &Bench, words: &str) -> Process {
    let child = Command::new(env!("CARGO_BIN_EXE_tison"))
        .current_dir(bench.dir.path())
        .args(words.split_whitespace())
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    Process(child)
}

fn signal(process: &Process, name: &str) {
    // The shell's own `kill`: a bare system has no other.
    let sent = Command::new("sh").args(["-c", &format!("kill -{name} {}", process.0.id())]).status().unwrap();
    assert!(sent.success());
}

/// Exit code; fails if it takes too long.
#[track_caller]
fn leave(process: &mut Process) -> i32 {
    let since = Instant::now();
    loop {
        if let Some(status) = process.0.try_wait().unwrap() {
            return status.code().expect("a code, not a signal");
        }
        assert!(since.elapsed() < PATIENCE, "still running {PATIENCE:?} after the signal");
        std::thread::sleep(Duration::from_millis(5));
    }
}

/// Reads progress until some of the image is rendered.
fn wait_for_pixels(process: &mut Process) -> BufReader<std::process::ChildStderr> {
    wait_for(process, "render", 0.0)
}

/// Reads progress until more than a share of a stage is done; the reader must live on, or the
/// command's messages go nowhere.
fn wait_for(process: &mut Process, stage: &str, share: f64) -> BufReader<std::process::ChildStderr> {
    let mut reader = BufReader::new(process.0.stderr.take().unwrap());
    let mut line = String::new();
    loop {
        line.clear();
        assert!(reader.read_line(&mut line).unwrap() > 0, "ended before it got so far");
        let Ok(progress) = serde_json::from_str::<serde_json::Value>(&line) else { continue };
        if progress["stage"] == stage && progress["done"].as_f64().unwrap() > share {
            return reader;
        }
    }
}

#[test]
fn the_first_signal_saves_what_is_rendered() {
    for (name, code) in [("INT", 130), ("TERM", 143)] {
        let bench = Bench::new();
        let mut child = start(&bench, "a.obj --size 1600x1200 --spp 300 --progress json -o part.png --stats s.json");
        let mut stderr = wait_for_pixels(&mut child);
        signal(&child, name);
        assert_eq!(leave(&mut child), code, "{name}");
        let mut said = String::new();
        stderr.read_to_string(&mut said).unwrap();
        assert!(said.contains("% of the pixels are rendered"), "{said}");
        let (w, h, pixels) = decode_file(&bench.path("part.png"));
        assert_eq!((w, h), (1600, 1200));
        let black = pixels.chunks(3).filter(|p| *p == [0; 3]).count();
        assert!(black > 0 && black < pixels.len() / 3, "{black} black pixels");
        let stats: serde_json::Value = serde_json::from_slice(&bench.read("s.json")).unwrap();
        let finished = stats["image"]["finished"].as_f64().unwrap();
        assert!(finished > 0.0 && finished < 1.0, "{finished}");
        assert_eq!(bench.names(), ["a.obj", "part.png", "s.json"]);
    }
}

#[test]
fn a_turntable_keeps_the_frames_that_are_done() {
    let bench = Bench::new();
    let mut child = start(&bench, "a.obj --size 64x48 --turntable 100000 --progress json -o t.png");
    let stderr = wait_for_pixels(&mut child);
    signal(&child, "TERM");
    assert_eq!(leave(&mut child), 143);
    drop(stderr);
    let names = bench.names();
    assert!(names.len() > 1 && names.len() < 100_000 && names[1..].iter().all(|n| n.starts_with("t-")), "{names:?}");
    for name in &names[1..] {
        assert_eq!(decode_file(&bench.path(name)).0, 64, "{name}");
    }
}

#[test]
fn an_example_that_is_stopped_leaves_nothing() {
    for again in [false, true] {
        let bench = Bench::new();
        let mut child = start(&bench, "example mesh --triangles 400000000 -o huge.obj");
        let since = Instant::now();
        while bench.names().len() < 2 {
            assert!(since.elapsed() < PATIENCE, "nothing is being written");
            std::thread::sleep(Duration::from_millis(5));
        }
        signal(&child, "TERM");
        if again {
            signal(&child, "TERM");
        }
        assert_eq!(leave(&mut child), 143);
        assert_eq!(bench.names(), ["a.obj"], "neither a part nor a temporary file");
    }
}

#[test]
fn the_second_signal_leaves_at_once() {
    let bench = Bench::new();
    // Nobody reads the pipe, so the run hangs in opening it, whatever the first signal asks for.
    let made = Command::new("mkfifo").arg(bench.path("pipe.png")).status().unwrap();
    assert!(made.success());
    let mut child = start(&bench, "a.obj --size 8x8 -q -o other.png -o pipe.png");
    let since = Instant::now();
    while !bench.path("other.png").exists() {
        assert!(since.elapsed() < PATIENCE);
        std::thread::sleep(Duration::from_millis(5));
    }
    std::thread::sleep(Duration::from_millis(50));
    signal(&child, "INT");
    std::thread::sleep(Duration::from_millis(300));
    assert!(child.0.try_wait().unwrap().is_none(), "the first signal alone cannot end it here");
    signal(&child, "INT");
    assert_eq!(leave(&mut child), 130);
    assert_eq!(bench.names(), ["a.obj", "other.png", "pipe.png"]);
}

#[test]
fn stopped_while_reading_nothing_is_written() {
    let bench = Bench::new();
    // A pipe that never ends keeps the reading busy.
    let pipe = bench.path("endless.obj");
    assert!(Command::new("mkfifo").arg(&pipe).status().unwrap().success());
    let mut child = start(&bench, "endless.obj -o out.png");
    // Opened both ways: to write only would wait for a reader.
    let feed = std::fs::OpenOptions::new().read(true).write(true).open(&pipe).unwrap();
    let feeder = Process(Command::new("yes").arg("v 0 0 0").stdout(feed).spawn().unwrap());
    std::thread::sleep(Duration::from_millis(300));
    signal(&child, "INT");
    let code = leave(&mut child);
    drop(feeder);
    let mut said = String::new();
    child.0.stderr.take().unwrap().read_to_string(&mut said).unwrap();
    assert_eq!(code, 130, "{said}");
    assert!(text(said.as_bytes()).starts_with("error: stopped before anything was rendered"), "{said}");
    assert_eq!(bench.names(), ["a.obj", "endless.obj"]);
}

#[test]
fn a_measurement_that_is_stopped_reports_what_it_has() {
    let bench = Bench::new();
    let words = "bench error lens edges --only sampling --size 16x9 --seeds 1 --spp 65536 --reference 16";
    let mut child = start(&bench, &format!("{words} --progress json --json j.json -o r.html"));
    // Most of the work is in the last two of nine numbers of samples.
    let mut stderr = wait_for(&mut child, "measure", 0.02);
    signal(&child, "INT");
    assert_eq!(leave(&mut child), 130);
    let mut said = String::new();
    stderr.read_to_string(&mut said).unwrap();
    assert!(said.contains("stopped: the report has what was finished"), "{said}");
    let json: serde_json::Value = serde_json::from_slice(&bench.read("j.json")).unwrap();
    let points = json["sections"]["error_lens"]["data"].as_array().unwrap();
    let most = points.iter().map(|p| p["spp"].as_f64().unwrap()).fold(0.0, f64::max);
    assert!((64.0..65_536.0).contains(&most), "{most}");
    assert!(json["sections"]["error_edges"].is_null(), "it did not get there");
    assert_eq!(bench.names(), ["a.obj", "j.json", "r.html"]);
}
