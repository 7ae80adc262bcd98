//! Progress on stderr, by a thread that looks at counters: nothing is added to the ray loop.

use super::args::ProgressMode;
use super::style::{clock, counted};
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use serde_json::json;
use std::io::{self, IsTerminal, Write};
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};
use tison::render::Control;

/// Runs that are done by then show nothing.
const SILENT: Duration = Duration::from_millis(500);
/// Between two looks at the counters.
const TICK: Duration = Duration::from_millis(100);
const PLAIN_EVERY: Duration = Duration::from_secs(10);
const JSON_EVERY: Duration = Duration::from_millis(500);

/// Parts of a run, in order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    Read,
    Build,
    Render,
    #[cfg(feature = "embree")]
    Compare,
    Measure,
    Write,
}

impl Stage {
    fn name(self) -> &'static str {
        match self {
            Self::Read => "read",
            Self::Build => "build",
            Self::Render => "render",
            #[cfg(feature = "embree")]
            Self::Compare => "compare",
            Self::Measure => "measure",
            Self::Write => "write",
        }
    }
}

/// Shows how far a run is, while it lives.
#[derive(Debug)]
pub struct Progress {
    shared: Arc<Shared>,
    watcher: Option<JoinHandle<()>>,
}

#[derive(Debug)]
struct Shared {
    control: Arc<Control>,
    started: Instant,
    now: Mutex<Now>,
    /// Share of the stage that is done, in billionths, where the pixels do not tell.
    billionths: AtomicU64,
    /// Held while something is drawn.
    sink: Mutex<Sink>,
    wake: Condvar,
}

/// What is being done.
#[derive(Debug)]
struct Now {
    stage: Stage,
    since: Instant,
    /// Counters at `since`, for rates.
    rays: u64,
    pixels: u64,
    /// Pixels to render in all.
    pixels_total: u64,
    /// Of a measurement: shares of it that are done before and after `pixels_total` pixels more than `pixels`.
    shares: (f64, f64),
    over: bool,
}

#[derive(Debug)]
enum Sink {
    Bar(ProgressBar),
    Plain { last: Instant },
    Json { last: Option<(Instant, Stage)> },
}

impl Progress {
    /// Starts to watch `control`; the stage is [`Stage::Read`].
    pub fn start(mode: ProgressMode, control: &Arc<Control>) -> Self {
        let started = Instant::now();
        let terminal = io::stderr().is_terminal();
        let sink = match mode {
            ProgressMode::Auto if terminal => Some(Sink::bar()),
            ProgressMode::Bar => Some(Sink::bar()),
            ProgressMode::Auto | ProgressMode::Plain => Some(Sink::Plain { last: started }),
            ProgressMode::Json => Some(Sink::Json { last: None }),
            ProgressMode::None => None,
        };
        let watched = sink.is_some();
        let now = Now {
            stage: Stage::Read,
            since: started,
            rays: 0,
            pixels: 0,
            pixels_total: 0,
            shares: (0.0, 0.0),
            over: false,
        };
        let shared = Arc::new(Shared {
            control: Arc::clone(control),
            started,
            now: Mutex::new(now),
            billionths: AtomicU64::new(0),
            sink: Mutex::new(sink.unwrap_or(Sink::Plain { last: started })),
            wake: Condvar::new(),
        });
        let watch = Arc::clone(&shared);
        // Without a thread to spare the run goes on unwatched.
        let spawn = || std::thread::Builder::new().name("progress".into()).spawn(move || watch.watch()).ok();
        Self { watcher: if watched { spawn() } else { None }, shared }
    }

    /// The run goes on to `stage`.
    pub fn stage(&self, stage: Stage) {
        let control = &self.shared.control;
        let mut now = self.shared.now();
        (now.stage, now.since) = (stage, Instant::now());
        (now.rays, now.pixels) = (control.rays.load(Relaxed), control.pixels.load(Relaxed));
        self.shared.billionths.store(0, Relaxed);
    }

    /// Pixels of all images together.
    pub fn expect_pixels(&self, total: u64) {
        self.shared.now().pixels_total = total;
    }

    /// A measurement has come to share `from` (0 to 1) and takes so many pixels to get to share `to`.
    pub fn measure(&self, from: f64, to: f64, pixels: u64) {
        let mut now = self.shared.now();
        if now.stage != Stage::Measure {
            (now.stage, now.since) = (Stage::Measure, Instant::now());
        }
        (now.shares, now.pixels_total) = ((from, to), pixels);
        now.pixels = self.shared.control.pixels.load(Relaxed);
    }

    /// `share` (0 to 1) of the stage is done. May be called from any thread, often.
    pub fn report(&self, share: f64) {
        self.shared.billionths.store((share * 1e9) as u64, Relaxed);
    }

    /// Does `f`, which writes to stderr, with the bar out of its way.
    pub fn aside(&self, f: impl FnOnce()) {
        match &*self.shared.sink() {
            Sink::Bar(bar) => bar.suspend(f),
            _ => f(),
        }
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        self.shared.now().over = true;
        self.shared.wake.notify_all();
        if let Some(watcher) = self.watcher.take() {
            // A panic in there has been reported by the hook.
            let _ = watcher.join();
        }
        if let Sink::Bar(bar) = &*self.shared.sink() {
            bar.finish_and_clear();
        }
    }
}

impl Shared {
    fn now(&self) -> MutexGuard<'_, Now> {
        self.now.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn sink(&self) -> MutexGuard<'_, Sink> {
        self.sink.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn watch(&self) {
        let mut now = self.now();
        while !now.over {
            now = self.wake.wait_timeout(now, TICK).unwrap_or_else(PoisonError::into_inner).0;
            if now.over || self.started.elapsed() < SILENT {
                continue;
            }
            let view = self.view(&now);
            drop(now);
            self.sink().show(&view);
            now = self.now();
        }
    }

    fn view(&self, now: &Now) -> View {
        let (rays, pixels) = (self.control.rays.load(Relaxed), self.control.pixels.load(Relaxed));
        let in_stage = now.since.elapsed();
        let pixels_total = now.pixels_total.max(1) as f64;
        let (share, before) = match now.stage {
            Stage::Render => (pixels as f64 / pixels_total, now.pixels as f64 / pixels_total),
            Stage::Measure => {
                let part = ((pixels - now.pixels) as f64 / pixels_total).min(1.0);
                (now.shares.0 + part * (now.shares.1 - now.shares.0), 0.0)
            }
            _ => (self.billionths.load(Relaxed) as f64 / 1e9, 0.0),
        };
        View {
            stage: now.stage,
            share: share.clamp(0.0, 1.0),
            rays,
            mrays_per_s: (rays - now.rays) as f64 / in_stage.as_secs_f64().max(1e-9) / 1e6,
            elapsed: self.started.elapsed(),
            left: time_left(share - before, 1.0 - share, in_stage),
            stopping: self.control.is_cancelled(),
        }
    }
}

/// What is shown.
#[derive(Debug)]
struct View {
    stage: Stage,
    share: f64,
    rays: u64,
    mrays_per_s: f64,
    elapsed: Duration,
    left: Option<Duration>,
    stopping: bool,
}

/// As long again as `done` took, for `rest`; nothing while too little is done to tell.
fn time_left(done: f64, rest: f64, took: Duration) -> Option<Duration> {
    const ENOUGH: f64 = 0.005;
    let seconds = took.as_secs_f64() * rest.max(0.0) / done;
    if done < ENOUGH { None } else { Duration::try_from_secs_f64(seconds).ok() }
}

impl View {
    fn text(&self) -> String {
        let mut parts = Vec::new();
        if self.stage == Stage::Render {
            parts.push(format!("{:.1} Mrays/s", self.mrays_per_s));
        }
        parts.push(clock(self.elapsed));
        parts.extend(self.left.map(|left| format!("ETA {}", clock(left))));
        if self.stopping {
            parts.push("stopping".into());
        }
        parts.join("  ")
    }

    /// `render ████░░░░  50 %  3.0 Mrays/s …`; nobody knows how much of the writing is done.
    fn line(&self) -> String {
        const WIDTH: usize = 32;
        let (name, text) = (self.stage.name(), self.text());
        if self.stage == Stage::Write {
            return format!("{name:>6}  {text}");
        }
        let full = (self.share * WIDTH as f64) as usize;
        let bar = "█".repeat(full) + &"░".repeat(WIDTH - full);
        format!("{name:>6} {bar} {:>3.0} %  {text}", 100.0 * self.share)
    }

    fn json(&self) -> serde_json::Value {
        json!({
            "stage": self.stage.name(),
            "done": self.share,
            "rays": self.rays,
            "mrays_per_s": if self.stage == Stage::Render { Some(self.mrays_per_s) } else { None },
            "elapsed_s": self.elapsed.as_secs_f64(),
            "eta_s": self.left.map(|d| d.as_secs_f64()),
        })
    }
}

impl Sink {
    fn bar() -> Self {
        let bar = ProgressBar::with_draw_target(None, ProgressDrawTarget::stderr());
        // One field: each that is set would draw the line anew, half of it old.
        Self::Bar(bar.with_style(ProgressStyle::with_template("{wide_msg}").expect("a constant that the tests draw")))
    }

    fn show(&mut self, view: &View) {
        // Nobody reads a stderr that is closed.
        let line = |text: String| drop(writeln!(io::stderr().lock(), "{text}"));
        match self {
            Self::Bar(bar) => bar.set_message(view.line()),
            Self::Plain { last } if last.elapsed() >= PLAIN_EVERY => {
                *last = Instant::now();
                let rays = if view.rays > 0 { format!("  {}", counted(view.rays, "ray")) } else { String::new() };
                line(format!("{} {:.0} %{rays}  {}", view.stage.name(), 100.0 * view.share, view.text()));
            }
            Self::Json { last } => {
                let due = last.is_none_or(|(at, stage)| stage != view.stage || at.elapsed() >= JSON_EVERY);
                if due {
                    *last = Some((Instant::now(), view.stage));
                    line(view.json().to_string());
                }
            }
            Self::Plain { .. } => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn time_left_is_by_rule_of_three() {
        let ten = Duration::from_secs(10);
        assert_eq!(time_left(0.25, 0.75, ten), Some(Duration::from_secs(30)));
        assert_eq!(time_left(0.5, 0.0, ten), Some(Duration::ZERO));
        assert_eq!(time_left(0.0, 1.0, ten), None);
        assert_eq!(time_left(0.001, 0.999, ten), None);
    }

    #[test]
    fn shares_come_from_pixels_while_rendering_and_from_reports_else() {
        let control = Arc::new(Control::default());
        let progress = Progress::start(ProgressMode::None, &control);
        let view = || progress.shared.view(&progress.shared.now());
        progress.expect_pixels(200);
        progress.report(0.25);
        assert!((view().share - 0.25).abs() < 1e-8);
        control.pixels.store(50, Relaxed);
        progress.stage(Stage::Build);
        assert!(view().share.abs() < 1e-8);
        progress.stage(Stage::Render);
        control.pixels.store(150, Relaxed);
        control.rays.store(1_000_000, Relaxed);
        let shown = view();
        assert!((shown.share - 0.75).abs() < 1e-8 && shown.mrays_per_s > 0.0);
        progress.measure(0.5, 0.7, 100);
        control.pixels.store(200, Relaxed);
        assert!((view().share - 0.6).abs() < 1e-8);
        control.pixels.store(900, Relaxed);
        assert!((view().share - 0.7).abs() < 1e-8, "a picture that is rendered again adds nothing");
        let json = shown.json();
        assert_eq!(json["stage"], "render");
        assert_eq!(json["rays"], 1_000_000);
        assert!(json["eta_s"].is_number());
    }

    #[test]
    fn a_bar_can_be_drawn() {
        let view = View {
            stage: Stage::Render,
            share: 0.5,
            rays: 1,
            mrays_per_s: 3.0,
            elapsed: Duration::from_secs(61),
            left: Some(Duration::from_secs(5)),
            stopping: true,
        };
        assert_eq!(view.text(), "3.0 Mrays/s  1:01  ETA 0:05  stopping");
        let mut sink = Sink::bar();
        sink.show(&view);
        let Sink::Bar(bar) = &sink else { panic!("not a bar") };
        assert!(bar.message().starts_with("render ████████████████░░░░░░░░░░░░░░░░  50 %  3.0 Mrays/s"));
        bar.finish_and_clear();
        assert!(!View { stage: Stage::Write, ..view }.line().contains('%'));
    }
}
