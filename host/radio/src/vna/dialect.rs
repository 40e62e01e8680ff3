//! Commands of the families of analysers.

use super::settings::{Analyser, ByteOrder, Dialect, Trigger};

/// Name of the trace that a capture measures.
pub(super) const TRACE: &str = "subap";

/// Bits of the operation status of an ENA: measuring, and waiting for a trigger.
pub(super) const BUSY: u32 = 16 | 32;

impl Dialect {
    /// Family of an identification (`*IDN?`); `None` if unknown.
    pub(super) fn of(identity: &str) -> Option<Self> {
        let lower = identity.to_ascii_lowercase();
        let has = |words: &[&str]| words.iter().any(|word| lower.contains(word));
        Some(match () {
            () if has(&["e5061", "e5063", "e5070", "e5071", "e5072"]) => Self::KeysightEna,
            () if has(&["keysight", "agilent"]) => Self::Keysight,
            () if has(&["rohde"]) => Self::RohdeSchwarz,
            () if has(&["cmt,", "copper mountain", "coppermountain"]) => Self::CopperMountain,
            () => return None,
        })
    }

    fn is_ena(self) -> bool {
        matches!(self, Self::KeysightEna | Self::CopperMountain)
    }

    /// Commands that set the analyser. The trace of a PNA is absent before.
    pub(super) fn configuration(self, analyser: &Analyser) -> Vec<String> {
        let parameter = analyser.parameter_name();
        let last_hz = analyser.frequency_hz(analyser.points - 1);
        let trace = match self {
            Self::Keysight => [
                format!("CALC1:PAR:DEF:EXT '{TRACE}','{parameter}'"),
                format!("CALC1:PAR:SEL '{TRACE}'"),
            ],
            Self::RohdeSchwarz => [
                format!("CALC1:PAR:SDEF '{TRACE}','{parameter}'"),
                format!("CALC1:PAR:SEL '{TRACE}'"),
            ],
            Self::KeysightEna | Self::CopperMountain => [
                format!("CALC1:PAR1:DEF {parameter}"),
                "CALC1:PAR1:SEL".to_owned(),
            ],
        };
        let mut commands = trace.to_vec();
        commands.extend([
            "SENS1:SWE:TYPE LIN".to_owned(),
            format!("SENS1:FREQ:STAR {}", analyser.start_hz),
            format!("SENS1:FREQ:STOP {last_hz}"),
            format!("SENS1:SWE:POIN {}", analyser.points),
            format!("SENS1:BAND {}", analyser.if_bandwidth_hz),
            format!("SOUR1:POW {}", analyser.power_dbm),
            "SENS1:AVER OFF".to_owned(),
            match self.is_ena() {
                true => "FORM:DATA REAL",
                false => "FORM:DATA REAL,64",
            }
            .to_owned(),
            match analyser.byte_order {
                ByteOrder::Little => "FORM:BORD SWAP",
                ByteOrder::Big => "FORM:BORD NORM",
            }
            .to_owned(),
        ]);
        commands.extend(
            self.trigger(analyser.trigger)
                .map(|command| (*command).to_owned()),
        );
        commands
    }

    fn trigger(self, trigger: Trigger) -> std::slice::Iter<'static, &'static str> {
        let commands: &'static [&'static str] = match (self, trigger) {
            (Self::Keysight, Trigger::Immediate) => &["SENS1:SWE:MODE HOLD", "TRIG:SOUR IMM"],
            (Self::Keysight, Trigger::External) => &["SENS1:SWE:MODE HOLD", "TRIG:SOUR EXT"],
            (Self::Keysight, Trigger::Bus) => &["SENS1:SWE:MODE HOLD", "TRIG:SOUR MAN"],
            (Self::RohdeSchwarz, Trigger::Immediate) => &["INIT1:CONT OFF", "TRIG1:SOUR IMM"],
            (Self::RohdeSchwarz, Trigger::External) => &["INIT1:CONT OFF", "TRIG1:SOUR EXT"],
            (Self::RohdeSchwarz, Trigger::Bus) => &["INIT1:CONT OFF", "TRIG1:SOUR MAN"],
            // An ENA completes *OPC? after its bus trigger only.
            (_, Trigger::External) => &["INIT1:CONT OFF", "TRIG:SOUR EXT"],
            (_, Trigger::Immediate | Trigger::Bus) => &["TRIG:SOUR BUS", "INIT1:CONT ON"],
        };
        commands.iter()
    }

    /// Commands that begin a sweep.
    pub(super) fn start(self, trigger: Trigger) -> &'static [&'static str] {
        match (self, trigger) {
            (Self::Keysight, Trigger::Bus) => &["SENS1:SWE:MODE SING", "INIT1:IMM"],
            (Self::Keysight, _) => &["SENS1:SWE:MODE SING"],
            (Self::RohdeSchwarz, Trigger::Bus) => &["INIT1:IMM", "*TRG"],
            (Self::RohdeSchwarz, _) | (_, Trigger::External) => &["INIT1:IMM"],
            (_, Trigger::Immediate | Trigger::Bus) => &["TRIG:SING"],
        }
    }

    /// Whether the end of a sweep shows in the operation status only.
    pub(super) fn polls(self, trigger: Trigger) -> bool {
        self.is_ena() && trigger == Trigger::External
    }

    /// Question for the corrected complex values of the trace.
    pub(super) fn values(self) -> &'static str {
        match self {
            Self::Keysight => "CALC1:DATA? SDATA",
            Self::RohdeSchwarz => "CALC1:DATA? SDAT",
            Self::KeysightEna | Self::CopperMountain => "CALC1:DATA:SDAT?",
        }
    }

    /// Question for the frequencies.
    pub(super) fn frequencies(self) -> &'static str {
        match self {
            Self::Keysight => "SENS1:X?",
            Self::RohdeSchwarz => "CALC1:DATA:STIM?",
            Self::KeysightEna | Self::CopperMountain => "SENS1:FREQ:DATA?",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn identifications_select_the_commands() {
        for (identity, dialect) in [
            (
                "Keysight Technologies,N5222B,MY1,A.16",
                Some(Dialect::Keysight),
            ),
            (
                "Keysight Technologies,E5080B,MY2,A.15",
                Some(Dialect::Keysight),
            ),
            (
                "Agilent Technologies,E5071C,MY3,B.11",
                Some(Dialect::KeysightEna),
            ),
            (
                "Rohde-Schwarz,ZNB20-4Port,1311,3.45",
                Some(Dialect::RohdeSchwarz),
            ),
            (
                "Rohde&Schwarz,ZVA40-4Port,1145,3.80",
                Some(Dialect::RohdeSchwarz),
            ),
            ("CMT,S5065,21113190,21.3", Some(Dialect::CopperMountain)),
            ("ACME,VNA-1,0,1", None),
        ] {
            assert_eq!(Dialect::of(identity), dialect, "{identity}");
        }
    }
}
