//! Warnings about defects: the measured values of a [`Defect`], and the cure.

use super::Defects;
use subaperture_model::phase_history::{Defect, DefectKind, Examined};

/// Defects of a recording, and its warnings.
#[derive(Clone, Debug, Default)]
pub(crate) struct Report {
    /// Warnings about defects and about the examination.
    pub(crate) warnings: Vec<String>,
    pub(crate) defects: Vec<Defect>,
}

impl Report {
    /// Add a defect with its warning, which ends with `cure`.
    pub(crate) fn add(&mut self, defect: Defect, cure: &str) {
        self.warnings.push(format!("{}{cure}", defect.warning()));
        self.defects.push(defect);
    }

    /// Add the warnings and defects of another report.
    pub(crate) fn extend(&mut self, other: Self) {
        self.warnings.extend(other.warnings);
        self.defects.extend(other.defects);
    }
}

/// Names of the samples that have a defect.
#[derive(Clone, Copy, Default)]
pub(crate) struct Named<'a> {
    pub(crate) recording: &'a str,
    /// Channel of the file.
    pub(crate) channel: Option<&'a str>,
    /// Number from 1, of several receivers.
    pub(crate) receiver: Option<usize>,
}

impl Named<'_> {
    /// Examination of a number of pulses, out of another number.
    pub(crate) fn examined(&self, [examined_pulses, pulses]: [usize; 2]) -> Examined {
        Examined {
            recording: self.recording.to_owned(),
            channel: self.channel.map(str::to_owned),
            receiver: self.receiver,
            examined_pulses,
            pulses,
        }
    }

    /// Defect in a number of pulses, out of another number.
    pub(crate) fn defect(&self, pulses: [usize; 2], kind: DefectKind) -> Defect {
        let examined = self.examined(pulses);
        Defect { examined, kind }
    }
}

/// Ends of the warnings about samples: the settings that correct them.
#[derive(Clone, Copy)]
pub(crate) struct Cures<'a> {
    pub(crate) bias: &'a str,
    pub(crate) imbalance: &'a str,
    pub(crate) clipped: &'a str,
}

#[cfg(feature = "recording")]
impl Cures<'static> {
    /// Keys of a description of real or complex samples.
    pub(crate) fn of_description(real: bool) -> Self {
        Self {
            bias: match real {
                true => ": subtract it by [recording] background = \"mean\"",
                false => ": subtract it by [recording] background = \"mean\" or iq = \"correct\"",
            },
            imbalance: ": correct it by [recording] iq = \"correct\"",
            clipped: ": no setting restores them. Record with less gain, or leave these pulses out by [recording] first and count",
        }
    }
}

impl Defects {
    /// Defects of the samples, with warnings that end with the cures.
    pub(crate) fn report(&self, samples: &Named<'_>, cures: &Cures<'_>) -> Report {
        let mut report = Report::default();
        for (kind, cure) in [
            (self.bias(false), cures.bias),
            (self.imbalance(false), cures.imbalance),
            (self.clipped(), cures.clipped),
        ] {
            if let Some(kind) = kind {
                report.add(samples.defect(self.examined, kind), cure);
            }
        }
        report
    }

    /// Defects of the samples of a description, whose I and Q are corrected.
    #[cfg(feature = "recording")]
    pub(crate) fn corrected(&self, samples: &Named<'_>) -> Report {
        let kinds = [self.bias(true), self.imbalance(true)];
        let defects = kinds.into_iter().flatten();
        let defects: Vec<Defect> = defects
            .map(|kind| samples.defect(self.examined, kind))
            .collect();
        let measured: Vec<String> = defects.iter().map(Defect::measured).collect();
        let mut report = Report::default();
        let examined = samples.examined(self.examined);
        let (subject, of_pulses) = (examined.subject(), examined.of_pulses());
        report.warnings.push(match measured.is_empty() {
            true => format!(
                "{subject}: no significant bias and imbalance of I and Q{of_pulses}: iq = \"correct\" has no effect"
            ),
            false => format!("{subject}: corrected {}{of_pulses}", measured.join("; ")),
        });
        report.defects = defects;
        if let Some(kind) = self.clipped() {
            let cures = Cures::of_description(false);
            report.add(samples.defect(self.examined, kind), cures.clipped);
        }
        report
    }

    fn bias(&self, corrected: bool) -> Option<DefectKind> {
        let bias = self.balance.bias?;
        let [re_deviation, im_deviation] = self.balance.deviations;
        let of_q = |value: f64| (!self.real).then_some(value);
        Some(DefectKind::Bias {
            re: bias.re,
            im: of_q(bias.im),
            re_deviation,
            im_deviation: of_q(im_deviation),
            corrected,
        })
    }

    fn imbalance(&self, corrected: bool) -> Option<DefectKind> {
        let imbalance = self.balance.imbalance?;
        Some(DefectKind::Imbalance {
            gain_db: 20.0 * libm::log10(imbalance.gain),
            phase_deg: imbalance.phase_deg(),
            image_db: 20.0 * libm::log10(imbalance.image),
            corrected,
        })
    }

    fn clipped(&self) -> Option<DefectKind> {
        let clipped = self.clipping.clipped()?;
        let [low, high] = clipped.range.map(f64::from);
        Some(DefectKind::Clipped {
            share: clipped.share,
            low,
            high,
        })
    }
}
