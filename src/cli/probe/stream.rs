//! Input in, answers out: in order, in parallel, in constant memory, and at once when the input pauses.

use crate::cli::exit::{Exit, Failure};
use rayon::prelude::*;
use std::io::{self, Read, Write};
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::time::Duration;

/// Bytes that are read at a time, at most.
const BLOCK: usize = 1 << 18;
/// Blocks that wait to be answered.
const WAITING: usize = 8;
/// Bytes from which on no more are taken before those that are there are answered.
pub const MOST: usize = 1 << 22;
/// Bytes that one thread answers at a time.
const PART: usize = 1 << 15;
/// How long a signal may go unnoticed.
const LOOK_UP: Duration = Duration::from_millis(50);

/// What a stream consists of: lines, or rows of numbers.
pub trait Items: Sync {
    /// Bytes of `pending` that can be answered; if it is `all` there is, all of it.
    /// So many items came `before`.
    fn whole(&self, pending: &[u8], before: u64, all: bool) -> Result<usize, Failure>;

    /// Where a part of `bytes` ends that has about `size` bytes.
    fn cut(&self, bytes: &[u8], size: usize) -> usize;

    /// Items in whole `bytes`.
    fn count(&self, bytes: &[u8]) -> u64;

    /// Whether no items follow after so many.
    fn is_done(&self, _before: u64) -> bool {
        false
    }

    /// Whether so many are all there should be.
    fn end(&self, _before: u64) -> Result<(), Failure> {
        Ok(())
    }

    /// Appends the answers to the items of `part`, up to one that is bad.
    fn answer(&self, part: &[u8], out: &mut Vec<u8>) -> Result<(), Stop>;
}

/// Why a part was not answered to its end.
pub enum Stop {
    /// A signal came.
    Cancelled,
    /// An item is bad. Makes the failure once it is known how many items came before the part.
    Bad(Box<dyn FnOnce(u64) -> Failure + Send>),
}

/// stdin, read by a thread of its own.
#[derive(Debug)]
pub struct Stream<'a> {
    blocks: Receiver<io::Result<Vec<u8>>>,
    pending: Vec<u8>,
    /// Nothing follows what is pending.
    over: bool,
    cancel: &'a AtomicBool,
}

impl<'a> Stream<'a> {
    /// Starts to read; setting `cancel` ends it.
    pub fn of_stdin(cancel: &'a AtomicBool) -> io::Result<Self> {
        let (to, blocks) = sync_channel(WAITING);
        // It may wait for input that never comes: nobody waits for it.
        std::thread::Builder::new().name("stdin".into()).spawn(move || read_all(&to))?;
        Ok(Self { blocks, pending: Vec::new(), over: false, cancel })
    }

    /// What has been read and not been answered.
    pub fn pending(&self) -> &[u8] {
        &self.pending
    }

    /// Whether nothing follows that, or nobody wants it any more.
    pub fn is_over(&self) -> bool {
        self.over
    }

    /// Forgets the first bytes of what is pending.
    pub fn skip(&mut self, bytes: usize) {
        self.pending.drain(..bytes);
    }

    /// Waits for input and takes what there is, up to a limit.
    pub fn wait(&mut self) -> Result<(), Failure> {
        loop {
            if self.cancel.load(Relaxed) {
                self.over = true;
                return Ok(());
            }
            match self.blocks.recv_timeout(LOOK_UP) {
                Ok(block) => self.take(block)?,
                Err(RecvTimeoutError::Timeout) => continue,
                Err(RecvTimeoutError::Disconnected) => self.over = true,
            }
            while self.pending.len() < MOST {
                let Ok(block) = self.blocks.try_recv() else { break };
                self.take(block)?;
            }
            return Ok(());
        }
    }

    fn take(&mut self, block: io::Result<Vec<u8>>) -> Result<(), Failure> {
        let block = block.map_err(|e| Failure::new(Exit::Input, "cannot read stdin").because(e))?;
        if self.pending.is_empty() {
            self.pending = block;
        } else {
            self.pending.extend_from_slice(&block);
        }
        Ok(())
    }

    /// Answers all of it. A bad item ends it after those before it have been answered.
    pub fn answer(&mut self, items: &impl Items) -> Result<(), Failure> {
        let mut before = 0;
        loop {
            let whole = items.whole(&self.pending, before, self.over)?;
            if !self.answer_whole(items, whole, &mut before)? || self.cancel.load(Relaxed) {
                return Ok(());
            }
            if self.over || items.is_done(before) {
                return items.end(before);
            }
            self.wait()?;
        }
    }

    /// Answers so many bytes; whether somebody still reads.
    fn answer_whole(&mut self, items: &impl Items, whole: usize, before: &mut u64) -> Result<bool, Failure> {
        let parts = parts(items, &self.pending[..whole]);
        let answered: Vec<_> = parts.par_iter().map(|part| answer(items, part)).collect();
        let mut out = io::stdout().lock();
        for ((answers, result), part) in answered.into_iter().zip(&parts) {
            if !write(&mut out, &answers)? {
                return Ok(false);
            }
            match result {
                Ok(()) => *before += items.count(part),
                Err(Stop::Cancelled) => break,
                Err(Stop::Bad(bad)) => {
                    flush(&mut out)?;
                    return Err(bad(*before));
                }
            }
        }
        self.pending.drain(..whole);
        flush(&mut out)
    }
}

fn read_all(to: &SyncSender<io::Result<Vec<u8>>>) {
    let mut stdin = io::stdin().lock();
    loop {
        let mut block = vec![0; BLOCK];
        let read = match stdin.read(&mut block) {
            Ok(0) => return,
            Ok(n) => {
                block.truncate(n);
                Ok(block)
            }
            Err(e) if e.kind() == io::ErrorKind::Interrupted => continue,
            Err(e) => Err(e),
        };
        let failed = read.is_err();
        if to.send(read).is_err() || failed {
            return;
        }
    }
}

/// Splits whole items into pieces of work.
fn parts<'b>(items: &impl Items, mut bytes: &'b [u8]) -> Vec<&'b [u8]> {
    let mut parts = Vec::new();
    while !bytes.is_empty() {
        let (part, rest) = bytes.split_at(items.cut(bytes, PART));
        parts.push(part);
        bytes = rest;
    }
    parts
}

fn answer(items: &impl Items, part: &[u8]) -> (Vec<u8>, Result<(), Stop>) {
    let mut out = Vec::with_capacity(4 * part.len());
    let result = items.answer(part, &mut out);
    (out, result)
}

/// Whether somebody still reads.
pub fn write(out: &mut impl Write, bytes: &[u8]) -> Result<bool, Failure> {
    told(out.write_all(bytes))
}

/// The same for what may be held back.
pub fn flush(out: &mut impl Write) -> Result<bool, Failure> {
    told(out.flush())
}

fn told(done: io::Result<()>) -> Result<bool, Failure> {
    match done {
        Ok(()) => Ok(true),
        Err(e) if e.kind() == io::ErrorKind::BrokenPipe => Ok(false),
        Err(e) => Err(Failure::new(Exit::Output, "cannot write to stdout").because(e)),
    }
}
