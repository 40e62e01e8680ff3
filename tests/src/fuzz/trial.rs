//! Trial of a target: limits of memory and time, and storage of failing inputs.

use std::collections::HashSet;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::PathBuf;
use std::sync::mpsc::{self, Receiver, RecvTimeoutError, Sender};
use std::time::{Duration, Instant};

use peak_alloc::PeakAlloc;

use super::{Mutator, Target};
use crate::subap::root;

/// Time limit for reading an input, in processor time where available.
pub const LIMIT: Duration = Duration::from_secs(2);

/// Time after which reading an input counts as endless; a busy machine may need a few seconds for a valid one.
const ENDLESS: Duration = Duration::from_secs(60);

/// Maximum of inputs that are kept.
const POOL: usize = 4096;

/// Statistics of a fuzzing trial.
#[derive(Clone, Copy, Debug, Default)]
pub struct Tried {
    /// Number of inputs read without error.
    pub executions: u64,
    /// Number of inputs from which others were made.
    pub pool: usize,
    /// Longest time of an input.
    pub longest: Duration,
    /// Maximum of bytes allocated at once for an input.
    pub most_bytes: usize,
}

/// A target under trial.
pub struct Trial<'a> {
    target: &'a Target,
    memory: &'a PeakAlloc,
    tried: Tried,
    watch: Sender<Option<Vec<u8>>>,
}

impl<'a> Trial<'a> {
    /// A trial in a process whose allocator is `memory`; no other code may run in it.
    pub fn new(target: &'a Target, memory: &'a PeakAlloc) -> Self {
        let (watch, inputs) = mpsc::channel();
        let name = target.name;
        std::thread::spawn(move || guard(name, &inputs));
        Self {
            target,
            memory,
            tried: Tried::default(),
            watch,
        }
    }

    /// Read the seeds, then mutations of them for `time`.
    ///
    /// # Panics
    /// If a promise is broken; the message contains the path of the input.
    pub fn run(mut self, seed: u64, time: Duration) -> Tried {
        let mut pool = (self.target.seeds)();
        let mut seen = HashSet::new();
        for input in &pool {
            seen.insert(self.read(input));
        }
        let mut mutator = Mutator::new(seed);
        let start = Instant::now();
        while start.elapsed() < time {
            let input = mutator.make(self.target, &pool);
            // An outcome with new words shows that new code was reached.
            let outcome = self.read(&input);
            if seen.insert(outcome) && pool.len() < POOL {
                pool.push(input);
            }
        }
        self.tried.pool = pool.len();
        self.tried
    }

    /// Read one input; returns the outcome without its numbers.
    ///
    /// # Panics
    /// If a promise is broken.
    pub fn read(&mut self, input: &[u8]) -> String {
        let most_bytes = (self.target.most_bytes)(input.len());
        // A second time, because the first may have allocated memory that stays, and another program may have been busy.
        for last in [false, true] {
            let (outcome, took, bytes) = self.measure(input);
            if took <= LIMIT && bytes <= most_bytes {
                self.tried.executions += 1;
                self.tried.longest = self.tried.longest.max(took);
                self.tried.most_bytes = self.tried.most_bytes.max(bytes);
                return outcome;
            }
            if last {
                let fault = format!(
                    "took {took:?} (at most {LIMIT:?}) and {bytes} bytes (at most {most_bytes})"
                );
                broken(self.target.name, input, &fault);
            }
        }
        unreachable!("the second time is the last")
    }

    fn measure(&self, input: &[u8]) -> (String, Duration, usize) {
        let _ = self.watch.send(Some(input.to_vec()));
        let before = self.memory.current_usage();
        self.memory.reset_peak_usage();
        let (start, worked) = (Instant::now(), processor_time());
        let outcome = catch_unwind(AssertUnwindSafe(|| (self.target.read)(input)));
        let mut took = start.elapsed();
        // On a busy machine most of the time belongs to other programs.
        if let (Some(before), Some(after)) = (worked, processor_time()) {
            took = took.min(after.saturating_sub(before));
        }
        let bytes = self.memory.peak_usage().saturating_sub(before);
        let _ = self.watch.send(None);
        match outcome {
            Ok(outcome) => (without_numbers(&outcome), took, bytes),
            Err(_) => broken(self.target.name, input, "panicked, as printed above"),
        }
    }
}

/// Processor time of this process so far, on Linux.
fn processor_time() -> Option<Duration> {
    let text = std::fs::read_to_string("/proc/self/stat").ok()?;
    // The name may hold anything but the last parenthesis; user and system time are the 12th and 13th field after
    // it, in hundredths of a second.
    let (_, rest) = text.rsplit_once(')')?;
    let mut fields = rest.split_whitespace().skip(11);
    let mut hundredths = || fields.next()?.parse::<u64>().ok();
    Some(Duration::from_millis(10 * (hundredths()? + hundredths()?)))
}

/// End the process if reading an input never returns; the thread ends with the trial.
fn guard(name: &str, inputs: &Receiver<Option<Vec<u8>>>) {
    let mut reading = None;
    loop {
        match inputs.recv_timeout(ENDLESS) {
            Ok(next) => reading = next,
            Err(RecvTimeoutError::Disconnected) => return,
            Err(RecvTimeoutError::Timeout) => {
                if let Some(input) = &reading {
                    let path = keep(name, input);
                    eprintln!("{name}: {} is read for ever", path.display());
                    std::process::abort();
                }
            }
        }
    }
}

/// Keep the input and fail.
fn broken(name: &str, input: &[u8], fault: &str) -> ! {
    let path = keep(name, input);
    panic!(
        "{name}: {} bytes, kept in {}: {fault}",
        input.len(),
        path.display()
    )
}

fn keep(name: &str, input: &[u8]) -> PathBuf {
    let folder = root().join("target/fuzz-failures");
    let path = folder.join(format!("{name}-{:08x}", crc32fast::hash(input)));
    if let Err(error) = std::fs::create_dir_all(&folder).and_then(|()| std::fs::write(&path, input))
    {
        eprintln!("{}: {error}", path.display());
    }
    path
}

/// First words of an outcome with all numbers replaced and without quotes from the input.
fn without_numbers(text: &str) -> String {
    let mut out = String::new();
    for piece in text.split('\'').step_by(2) {
        for c in piece.chars() {
            let c = if c.is_ascii_digit() { '0' } else { c };
            if c != '0' || !out.ends_with('0') {
                out.push(c);
            }
        }
        if out.len() > 300 {
            break;
        }
    }
    out
}
