//! Processor time: on a busy machine it tells more than the clock.

/// Whose.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Of {
    /// This process, all its threads.
    Own,
    /// The calling thread.
    Thread,
    /// All that it started and that has ended.
    Children,
}

/// What they took of the processors so far, seconds, less than two hundredths too little; `None` where the system does not say.
pub fn seconds(of: Of) -> Option<f64> {
    let whose = match of {
        Of::Thread => "thread-self",
        Of::Own | Of::Children => "self",
    };
    let stat = std::fs::read_to_string(format!("/proc/{whose}/stat")).ok()?;
    // proc(5): in hundredths of a second, user's and system's, fields 14 and 15 of this process, then those of children. The second field is a name
    // in brackets. Both are rounded down.
    let (_, fields) = stat.rsplit_once(") ")?;
    let skipped = match of {
        Of::Own | Of::Thread => 11,
        Of::Children => 13,
    };
    let mut ticks = fields.split(' ').skip(skipped).map(str::parse::<f64>);
    let (user, system) = (ticks.next()?.ok()?, ticks.next()?.ok()?);
    Some((user + system) / 100.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn own_time_passes_and_childrens_stands_until_one_ends() {
        let before = [Of::Own, Of::Children].map(seconds);
        assert_eq!(before.map(|s| s.is_some()), [cfg!(target_os = "linux"); 2]);
        let [Some(own), Some(children)] = before else {
            return;
        };
        let mut sum = 0u64;
        while seconds(Of::Own).unwrap() < own + 0.03 {
            sum = std::hint::black_box(sum + 1);
        }
        // Others of this program's threads have a part in its own time.
        let before = seconds(Of::Thread).unwrap();
        while seconds(Of::Thread).unwrap() < before + 0.03 {
            sum = std::hint::black_box(sum + 1);
        }
        // Which hundredths are user's and which the system's is told apart for a thread and for the whole: one of them may be rounded away for the whole alone.
        assert!(seconds(Of::Thread).unwrap() <= seconds(Of::Own).unwrap() + 0.015);
        // No other test of this program starts anything that ends.
        assert_eq!(seconds(Of::Children), Some(children));
    }
}
