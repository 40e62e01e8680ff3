//! Account of a file: records read, messages left out, and why.

use std::collections::{BTreeMap, BTreeSet};

/// Largest number of faults kept with their text; all are counted.
const MAX_FAULTS: usize = 20;

/// Time scale of a log.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Clock {
    /// GPS week and seconds of the week.
    #[default]
    Gps,
    /// Seconds of an unnamed GPS week ([`crate::Options::week`]).
    SecondsOfWeek,
    /// Seconds of a UTC day without a date ([`crate::Options::date`]).
    SecondsOfDay,
    /// Seconds of the log's own clock.
    Own,
}

/// Kind of a fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Wrong {
    /// Message that is truncated.
    Cut,
    /// Message with a wrong checksum.
    Checksum,
    /// Message with an impossible value, and a right checksum or none.
    Value,
    /// Record that is not later than the one before of its kind. It is omitted, but not damaged.
    Disorder,
}

/// Fault in a file.
#[derive(Clone, Debug, PartialEq)]
pub struct Fault {
    /// Offset from the file's beginning, bytes.
    pub byte: u64,
    /// Line number, from 1, if the file is text up to there.
    pub line: Option<u64>,
    /// Kind of the fault.
    pub wrong: Wrong,
    /// Description, with the text or value read.
    pub description: String,
}

impl std::fmt::Display for Fault {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self.line {
            Some(line) => write!(f, "line {line}: {}", self.description),
            None => write!(f, "byte {}: {}", self.byte, self.description),
        }
    }
}

/// Account of a file: records read, messages left out, and why.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ReadReport {
    /// Number of messages that became records, by name.
    pub read: BTreeMap<String, u64>,
    /// Number of valid messages of the same names that report no solution.
    pub unsolved: BTreeMap<String, u64>,
    /// Number of valid messages of other names.
    pub others: BTreeMap<String, u64>,
    /// Number of faults of each kind.
    pub wrong: BTreeMap<Wrong, u64>,
    /// First 20 faults with their texts.
    pub faults: Vec<Fault>,
    /// Number of bytes outside valid messages.
    pub lost_bytes: u64,
    /// Number of bytes of the file.
    pub bytes: u64,
    /// Time scale of the records.
    pub clock: Clock,
    /// GPS time minus UTC, seconds: as the log states, or from the table that converted UTC to GPS time.
    pub leap_seconds_s: Option<i32>,
    /// Remarks for the user.
    pub notes: BTreeSet<String>,
    /// Possible errors of the records: assumptions and contradictions. Always show these to the user.
    pub doubts: BTreeSet<String>,
}

impl ReadReport {
    /// Number of faults of any kind.
    pub fn faulty(&self) -> u64 {
        self.wrong.values().sum()
    }

    /// Number of messages that are truncated, damaged, or have an impossible value.
    pub fn damaged(&self) -> u64 {
        self.faulty() - self.disordered()
    }

    /// Number of records left out because their times do not ascend.
    pub fn disordered(&self) -> u64 {
        self.wrong.get(&Wrong::Disorder).copied().unwrap_or(0)
    }

    pub(crate) fn fault(&mut self, fault: Fault) {
        *self.wrong.entry(fault.wrong).or_default() += 1;
        if self.faults.len() < MAX_FAULTS {
            self.faults.push(fault);
        }
    }

    /// Add the faults of another account.
    pub(crate) fn add(&mut self, other: ReadReport) {
        for (wrong, count) in other.wrong {
            *self.wrong.entry(wrong).or_default() += count;
        }
        let room = MAX_FAULTS - self.faults.len();
        self.faults.extend(other.faults.into_iter().take(room));
    }

    pub(crate) fn doubt(&mut self, text: &str) {
        if !self.doubts.contains(text) {
            self.doubts.insert(text.to_owned());
        }
    }

    pub(crate) fn note(&mut self, text: &str) {
        if !self.notes.contains(text) {
            self.notes.insert(text.to_owned());
        }
    }
}

/// Increment the count of a name.
pub(crate) fn count(counts: &mut BTreeMap<String, u64>, name: &str) {
    match counts.get_mut(name) {
        Some(count) => *count += 1,
        None => drop(counts.insert(name.to_owned(), 1)),
    }
}

fn list<'a>(counts: impl Iterator<Item = (&'a String, &'a u64)>) -> String {
    let each: Vec<String> = counts
        .map(|(name, count)| format!("{count} {name}"))
        .collect();
    match each.is_empty() {
        true => "none".to_owned(),
        false => each.join(", "),
    }
}

/// Report in several lines of text.
impl std::fmt::Display for ReadReport {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "read: {}", list(self.read.iter()))?;
        if !self.unsolved.is_empty() {
            write!(f, "\nwithout a solution: {}", list(self.unsolved.iter()))?;
        }
        if !self.others.is_empty() {
            write!(
                f,
                "\nother messages, not read: {}",
                list(self.others.iter())
            )?;
        }
        let of = |wrong| self.wrong.get(&wrong).copied().unwrap_or(0);
        if self.faulty() > 0 {
            write!(
                f,
                "\nfaults: {} truncated messages, {} with a wrong checksum, {} with impossible values, {} records with times that do not ascend",
                of(Wrong::Cut),
                of(Wrong::Checksum),
                of(Wrong::Value),
                of(Wrong::Disorder)
            )?;
        }
        if self.lost_bytes > 0 {
            write!(
                f,
                "\n{} of {} bytes are outside valid messages",
                self.lost_bytes, self.bytes
            )?;
        }
        let listed_faults = self.faults.len() as u64;
        for fault in &self.faults {
            write!(f, "\n  {fault}")?;
        }
        if self.faulty() > listed_faults {
            write!(f, "\n  and {} more", self.faulty() - listed_faults)?;
        }
        for note in self.doubts.iter().chain(&self.notes) {
            write!(f, "\n{note}")?;
        }
        Ok(())
    }
}
