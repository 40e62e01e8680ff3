//! Processor time, which is more meaningful than elapsed time on a busy machine.

/// Owner of the processor time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Of {
    /// This process with all its threads.
    Own,
    /// The calling thread.
    Thread,
    /// Ended child processes.
    Children,
}

/// Processor time so far, seconds, at most two hundredths too small; `None` where the system does not report it.
pub fn seconds(of: Of) -> Option<f64> {
    let whose = match of {
        Of::Thread => "thread-self",
        Of::Own | Of::Children => "self",
    };
    let stat = std::fs::read_to_string(format!("/proc/{whose}/stat")).ok()?;
    // proc(5): user and system time in hundredths of a second, fields 14 and 15 for this process, then those of its children. The second
    // field is a name in brackets. Both are rounded down.
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
    fn own_time_increases_and_that_of_children_only_when_one_ends() {
        let before = [Of::Own, Of::Children].map(seconds);
        assert_eq!(before.map(|s| s.is_some()), [cfg!(target_os = "linux"); 2]);
        let [Some(own), Some(children)] = before else {
            return;
        };
        let mut sum = 0u64;
        while seconds(Of::Own).unwrap() < own + 0.03 {
            sum = std::hint::black_box(sum + 1);
        }
        // Other threads of this program contribute to its time.
        let before = seconds(Of::Thread).unwrap();
        while seconds(Of::Thread).unwrap() < before + 0.03 {
            sum = std::hint::black_box(sum + 1);
        }
        // User and system time are separated differently for a thread and for the process, so a hundredth may be lost in the process's
        // rounding only.
        assert!(seconds(Of::Thread).unwrap() <= seconds(Of::Own).unwrap() + 0.015);
        // No other test of this program starts a process that ends.
        assert_eq!(seconds(Of::Children), Some(children));
    }
}
