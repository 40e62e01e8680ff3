//! File names of a collection.

use std::path::{Path, PathBuf};

/// Numbers of the channels of a collection.
pub const CHANNELS: [u8; 3] = [1, 2, 3];

/// Files of a collection, by the path of the samples of one channel, such as `durangoChallenge_chan1_mis2_PH`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Files {
    path: PathBuf,
    prefix: String,
    set: String,
    channel: u8,
}

impl Files {
    /// Files of the collection of `path`; `None` if its name is not `PREFIX_chanN_SET_PH` with `N` from 1 to 3.
    pub fn of(path: &Path) -> Option<Self> {
        let name = path.file_name()?.to_str()?.strip_suffix("_PH")?;
        let (prefix, rest) = name.rsplit_once("_chan")?;
        let (number, set) = rest.split_once('_')?;
        let channel = CHANNELS.into_iter().find(|n| n.to_string() == number)?;
        Some(Self {
            path: path.to_owned(),
            prefix: prefix.to_owned(),
            set: set.to_owned(),
            channel,
        })
    }

    /// Channel of the path.
    pub fn channel(&self) -> u8 {
        self.channel
    }

    /// Samples of a channel.
    pub fn samples(&self, channel: u8) -> PathBuf {
        let (prefix, set) = (&self.prefix, &self.set);
        self.path
            .with_file_name(format!("{prefix}_chan{channel}_{set}_PH"))
    }

    /// Auxiliary data of a channel.
    pub fn auxiliary(&self, channel: u8) -> PathBuf {
        let (prefix, set) = (&self.prefix, &self.set);
        let name = format!("{prefix}_chan{channel}_{set}_PH_auxSaveData.mat");
        self.path.with_file_name(name)
    }

    /// Antenna positions of the collection, converted to MATLAB's format.
    pub fn positions(&self) -> PathBuf {
        let name = format!("{}_{}_PAUX.mat", self.prefix, self.set);
        self.path.with_file_name(name)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_a_collection_follow_from_the_path_of_a_channel() {
        let files = Files::of(Path::new("data/durangoChallenge_chan2_ref4_PH")).unwrap();
        assert_eq!(files.channel(), 2);
        let at = |name: &str| Path::new("data").join(name);
        assert_eq!(files.samples(3), at("durangoChallenge_chan3_ref4_PH"));
        assert_eq!(
            files.auxiliary(1),
            at("durangoChallenge_chan1_ref4_PH_auxSaveData.mat")
        );
        assert_eq!(files.positions(), at("durangoChallenge_ref4_PAUX.mat"));
        for other in [
            "durangoChallenge_chan4_ref4_PH",
            "durangoChallenge_chan01_ref4_PH",
            "durangoChallenge_chan1_PH",
            "durangoChallenge_ref4_PAUX",
            "durangoChallenge_chan1_ref4_PH_auxSaveData.mat",
            "",
        ] {
            assert_eq!(Files::of(Path::new(other)), None, "{other}");
        }
    }
}
