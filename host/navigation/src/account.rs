//! What was read of a file, what was not, and why.

use std::collections::{BTreeMap, BTreeSet};

/// Faults that are kept word for word, at most; all are counted.
const MOST_FAULTS: usize = 20;

/// By which clock a log's times go.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Clock {
    /// GPS time, week and seconds.
    #[default]
    Gps,
    /// Seconds of a GPS week that the file does not name ([`crate::Options::week`]).
    SecondsOfWeek,
    /// Seconds of a day of UTC that the file does not name ([`crate::Options::date`]).
    SecondsOfDay,
    /// Seconds of the log's own.
    Own,
}

/// How something is wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Wrong {
    /// A message that ends before it should.
    Cut,
    /// A message that is not what its checksum says.
    Checksum,
    /// A message whose checksum is right, or that has none, with a value that cannot be.
    Value,
    /// A record that is not later than the one before of its kind.
    Disorder,
}

/// Something wrong in a file.
#[derive(Clone, Debug, PartialEq)]
pub struct Fault {
    /// Where, in bytes from the file's beginning.
    pub byte: u64,
    /// Its line, from 1, if the file is text up to there.
    pub line: Option<u64>,
    /// How.
    pub wrong: Wrong,
    /// In words, with what was read.
    pub what: String,
}

impl std::fmt::Display for Fault {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self.line {
            Some(line) => write!(f, "line {line}: {}", self.what),
            None => write!(f, "byte {}: {}", self.byte, self.what),
        }
    }
}

/// What was read of a file, what was not, and why.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Account {
    /// Messages that made records, by name.
    pub read: BTreeMap<String, u64>,
    /// Sound messages of the same names that say they have no solution.
    pub unsolved: BTreeMap<String, u64>,
    /// Sound messages of other names.
    pub others: BTreeMap<String, u64>,
    /// What is wrong, counted.
    pub wrong: BTreeMap<Wrong, u64>,
    /// The first of what is wrong.
    pub faults: Vec<Fault>,
    /// Bytes that belong to no sound message.
    pub lost_bytes: u64,
    /// All bytes.
    pub bytes: u64,
    /// By which clock times go.
    pub clock: Clock,
    /// Seconds by which GPS time is ahead of UTC, as the log says or as they were taken from the table to make GPS times of UTC.
    pub leap_seconds_s: Option<i32>,
    /// What else its reader should know.
    pub notes: BTreeSet<String>,
}

impl Account {
    /// How much is wrong, of any kind.
    pub fn faulty(&self) -> u64 {
        self.wrong.values().sum()
    }

    pub(crate) fn fault(&mut self, fault: Fault) {
        *self.wrong.entry(fault.wrong).or_default() += 1;
        if self.faults.len() < MOST_FAULTS {
            self.faults.push(fault);
        }
    }

    /// Faults that were found apart.
    pub(crate) fn add(&mut self, other: Account) {
        for (wrong, count) in other.wrong {
            *self.wrong.entry(wrong).or_default() += count;
        }
        let room = MOST_FAULTS - self.faults.len();
        self.faults.extend(other.faults.into_iter().take(room));
    }

    pub(crate) fn note(&mut self, what: &str) {
        if !self.notes.contains(what) {
            self.notes.insert(what.to_owned());
        }
    }
}

/// One more of a name.
pub(crate) fn count(counts: &mut BTreeMap<String, u64>, name: &str) {
    match counts.get_mut(name) {
        Some(count) => *count += 1,
        None => drop(counts.insert(name.to_owned(), 1)),
    }
}

fn listed<'a>(counts: impl Iterator<Item = (&'a String, &'a u64)>) -> String {
    let each: Vec<String> = counts
        .map(|(name, count)| format!("{count} {name}"))
        .collect();
    match each.is_empty() {
        true => "none".to_owned(),
        false => each.join(", "),
    }
}

/// In some lines of text.
impl std::fmt::Display for Account {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "read: {}", listed(self.read.iter()))?;
        if !self.unsolved.is_empty() {
            write!(f, "\nwithout a solution: {}", listed(self.unsolved.iter()))?;
        }
        if !self.others.is_empty() {
            write!(f, "\nof other kinds: {}", listed(self.others.iter()))?;
        }
        let of = |wrong| self.wrong.get(&wrong).copied().unwrap_or(0);
        if self.faulty() > 0 {
            write!(
                f,
                "\nwrong: {} cut, {} with a wrong checksum, {} with values that cannot be, {} not in the order of time",
                of(Wrong::Cut),
                of(Wrong::Checksum),
                of(Wrong::Value),
                of(Wrong::Disorder)
            )?;
        }
        if self.lost_bytes > 0 {
            write!(
                f,
                "\n{} of {} bytes belong to no sound message",
                self.lost_bytes, self.bytes
            )?;
        }
        let told = self.faults.len() as u64;
        for fault in &self.faults {
            write!(f, "\n  {fault}")?;
        }
        if self.faulty() > told {
            write!(f, "\n  and {} more", self.faulty() - told)?;
        }
        for note in &self.notes {
            write!(f, "\n{note}")?;
        }
        Ok(())
    }
}
