//! Command line of the benchmark.

use std::time::Duration;

use crate::case::{Case, USUAL};
use crate::growth::Series;
use crate::measure::{Asked, MEMORY_BYTES};

/// Parsed options.
#[derive(Debug)]
pub(crate) struct Options {
    pub(crate) series: Vec<Series>,
    pub(crate) formers: Vec<Asked>,
    pub(crate) threads: Vec<usize>,
    /// Time limit of a measurement.
    pub(crate) limit: Duration,
    /// Memory budget of formers, bytes.
    pub(crate) memory_bytes: u64,
    pub(crate) peers: Peers,
    /// Revision to compare with.
    pub(crate) against: Option<String>,
    /// Number of measurements of each revision.
    pub(crate) rounds: usize,
}

/// Whether other programs are measured too.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Peers {
    /// If they are installed.
    IfThere,
    /// Install them if they are missing.
    Installed,
    No,
}

impl Options {
    /// Cases of all series.
    pub(crate) fn cases(&self) -> impl Iterator<Item = &Case> {
        self.series.iter().flat_map(|series| &series.cases)
    }

    /// Parse the words of the command line.
    ///
    /// # Errors
    /// The invalid word and the reason.
    pub(crate) fn parse(words: &[&str]) -> Result<Self, String> {
        let all = std::thread::available_parallelism().map_or(1, usize::from);
        let [mut cases, mut formers, mut threads] = [const { Vec::new() }; 3];
        let mut quick = false;
        let mut options = Self {
            series: Vec::new(),
            formers: Vec::new(),
            threads: Vec::new(),
            limit: Duration::from_secs(20),
            memory_bytes: MEMORY_BYTES,
            peers: Peers::IfThere,
            against: None,
            rounds: 7,
        };
        let mut words = words.iter().copied();
        while let Some(word) = words.next() {
            let mut value = || words.next().ok_or_else(|| format!("{word} wants a value"));
            let number = |text: &str| match text.parse::<usize>() {
                Ok(number) if number > 0 => Ok(number),
                _ => Err(format!("{word}: '{text}' is no whole number from 1")),
            };
            match word {
                "--formers" => formers = value()?.split(',').collect(),
                "--threads" => threads = value()?.split(',').collect(),
                "--limit" => options.limit = Duration::from_secs(number(value()?)? as u64),
                "--memory-mib" => options.memory_bytes = (number(value()?)? as u64) << 20,
                "--rounds" => options.rounds = number(value()?)?,
                "--against" => options.against = Some(value()?.to_owned()),
                "--quick" => quick = true,
                "--peers" => options.peers = Peers::Installed,
                "--no-peers" => options.peers = Peers::No,
                _ if word.starts_with('-') => return Err(format!("there is no option {word}")),
                _ => cases.push(word),
            }
            if word == "--threads" {
                options.threads = threads
                    .iter()
                    .map(|n| number(n))
                    .collect::<Result<_, _>>()?;
            }
        }
        if cases.is_empty() {
            // One case suffices to see a former become slower.
            cases = match quick || options.against.is_some() {
                true => vec!["a"],
                false => USUAL.to_vec(),
            };
        }
        for word in cases {
            options.series.extend(Series::named(word)?);
        }
        options.formers = match formers.is_empty() {
            true => Asked::usual(),
            false => formers
                .into_iter()
                .map(Asked::parse)
                .collect::<Result<_, _>>()?,
        };
        if options.threads.is_empty() {
            options.threads = match quick || options.against.is_some() || all == 1 {
                true => vec![all],
                false => vec![2, 1],
            };
        }
        // A former too slow on more threads is too slow on fewer.
        options.threads.sort_unstable_by(|a, b| b.cmp(a));
        if quick {
            options.limit = options.limit.min(Duration::from_secs(10));
        }
        Ok(options)
    }
}
