//! Secret in the address of a page. It excludes other users of the same machine, who can also reach its loopback
//! addresses.

use std::fmt;
use std::io;

/// Length of a secret, bytes; too long to guess.
const BYTES: usize = 16;

/// Random word at the start of every served path.
#[derive(Clone)]
pub(crate) struct Secret(String);

impl Secret {
    /// Generate a secret from the random numbers of the operating system.
    pub(crate) fn new() -> io::Result<Self> {
        let mut bytes = [0; BYTES];
        getrandom::fill(&mut bytes).map_err(|error| io::Error::other(error.to_string()))?;
        Ok(Self(
            bytes.iter().map(|byte| format!("{byte:02x}")).collect(),
        ))
    }

    pub(crate) fn word(&self) -> &str {
        &self.0
    }

    /// Remainder of a path that starts with the secret, from the following slash on.
    pub(crate) fn strip<'p>(&self, path: &'p str) -> Option<&'p str> {
        let (word, rest) = path.strip_prefix('/')?.split_at_checked(self.0.len())?;
        // All bytes are compared, so that the time does not reveal how many match.
        let pairs = word.bytes().zip(self.0.bytes());
        let differs = pairs.fold(0, |differs, (a, b)| differs | (a ^ b));
        (differs == 0 && rest.starts_with('/')).then_some(rest)
    }
}

impl fmt::Debug for Secret {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Secret")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_paths_with_the_secret_are_accepted() {
        let [one, two] = [(); 2].map(|()| Secret::new().unwrap());
        assert_eq!(one.word().len(), 32);
        assert_ne!(one.word(), two.word());
        let path = format!("/{}/tile/0", one.word());
        assert_eq!(one.strip(&path), Some("/tile/0"));
        assert_eq!(two.strip(&path), None);
        let word = one.word();
        for path in [
            "/".to_owned(),
            "/tile/0".to_owned(),
            format!("/{word}"),
            format!("/{word}x/"),
            format!("{word}/"),
            format!("//{word}/"),
            format!("/{}/", &word[1..]),
            format!("/{}é/", &word[..31]),
        ] {
            assert_eq!(one.strip(&path), None, "{path}");
        }
    }
}
