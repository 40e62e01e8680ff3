//! Methods of detection that are compared.

use std::fmt;

/// Method of detecting moving targets.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Method {
    /// Cell-averaging CFAR on one sub-CPI of the first channel: targets outside of the clutter's Doppler band.
    ExoClutter,
    /// Along-track interferometry of the images of the first two channels.
    Ati,
    /// Displaced phase centre antenna: difference of the images of the first two channels.
    Dpca,
    /// Adaptive matched filter of the images of all channels.
    Image,
    /// Extended factored algorithm on one sub-CPI of all channels.
    Efa {
        /// Adjacent Doppler bins of a snapshot.
        bins: usize,
    },
    /// Extended factored algorithm, integrated over all sub-CPIs.
    Integrated {
        /// Adjacent Doppler bins of a snapshot.
        bins: usize,
    },
}

impl Method {
    /// Whether theory gives the probability of detection.
    pub fn has_theory(self) -> bool {
        self != Self::Ati
    }
}

impl fmt::Display for Method {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = match self {
            Self::ExoClutter => "exo-clutter CFAR",
            Self::Ati => "ATI, image",
            Self::Dpca => "DPCA, image",
            Self::Image => "AMF, image",
            Self::Efa { bins } => return write!(f, "EFA of {bins}, one sub-CPI"),
            Self::Integrated { bins } => return write!(f, "EFA of {bins}, all sub-CPIs"),
        };
        f.write_str(name)
    }
}

impl serde::Serialize for Method {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}
