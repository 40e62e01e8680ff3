//! Network parameters in Touchstone files (`.s1p`, `.s2p`, ...), versions 1.1 and 2.0, as vector network analysers write them.
//!
//! One scattering parameter is read, for all frequencies of the file. Numbers are real and imaginary part (`RI`), magnitude and angle in degrees (`MA`) or decibels and
//! angle (`DB`); frequencies are in Hz, kHz, MHz or GHz. Keywords and units do not depend on case, and `!` begins a comment. Version 1.1 has the number of ports in the file
//! name; two-port data have the order 11, 21, 12, 22. Version 2.0 states the number of ports, the order of two-port data and whether matrices are full, lower or upper
//! triangular. Noise data are ignored.
//!
//! The phase of a reflection with delay `t` is `exp(-j 2 pi f t)`: that of image formers.
//!
//! Source: Touchstone File Format Specification, versions 1.1 (2002) and 2.0 (2009), IBIS Open Forum.

use std::f64::consts::PI;

use num_complex::Complex64;

/// Largest number of ports.
const MAX_PORTS: usize = 99;

/// One scattering parameter over frequency.
#[derive(Clone, Debug, PartialEq)]
pub struct Parameter {
    /// Frequencies in hertz, ascending.
    pub frequencies_hz: Vec<f64>,
    /// Values at the frequencies.
    pub values: Vec<Complex64>,
}

/// Fault of a Touchstone file.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("line {line}: {message}")]
pub struct TouchstoneError {
    /// Number of the line, from 1.
    pub line: usize,
    /// Expected and found value.
    pub message: String,
}

fn fault<T>(line: usize, message: impl Into<String>) -> Result<T, TouchstoneError> {
    let message = message.into();
    Err(TouchstoneError { line, message })
}

/// Number of ports in the name of a version 1.1 file, such as 2 in `scan.s2p`; `None` for other names.
pub fn ports_of_name(name: &str) -> Option<usize> {
    let (_, extension) = name.rsplit_once('.')?;
    let lower = extension.to_ascii_lowercase();
    let digits = lower.strip_prefix('s')?.strip_suffix('p')?;
    let ports = digits.parse().ok()?;
    (1..=MAX_PORTS).contains(&ports).then_some(ports)
}

/// Receiving and transmitting port of a name such as `s21`, from 1.
pub fn parameter_of_name(name: &str) -> Option<[usize; 2]> {
    let digits = name.strip_prefix(['s', 'S'])?;
    let ports = match digits.split_once(',') {
        Some((to, from)) => [to.parse().ok()?, from.parse().ok()?],
        None if digits.len() == 2 && digits.is_ascii() => {
            [digits[..1].parse().ok()?, digits[1..].parse().ok()?]
        }
        None => return None,
    };
    let known = |port: &usize| (1..=MAX_PORTS).contains(port);
    ports.iter().all(known).then_some(ports)
}

/// Format of a complex number.
#[derive(Clone, Copy)]
enum Format {
    RealImaginary,
    MagnitudeAngle,
    DecibelAngle,
}

impl Format {
    fn value(self, [first, second]: [f64; 2]) -> Complex64 {
        let polar = |magnitude: f64| {
            let angle = second * PI / 180.0;
            Complex64::new(libm::cos(angle), libm::sin(angle)) * magnitude
        };
        match self {
            Self::RealImaginary => Complex64::new(first, second),
            Self::MagnitudeAngle => polar(first),
            Self::DecibelAngle => polar(libm::pow(10.0, first / 20.0)),
        }
    }
}

/// Elements of a matrix that the file contains.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Matrix {
    Full,
    Lower,
    Upper,
}

/// Header of a file as far as it was read.
struct Header {
    unit_hz: f64,
    format: Format,
    has_options: bool,
    is_version_2: bool,
    ports: Option<usize>,
    /// Whether two-port data have the order 11, 21, 12, 22.
    is_21_first: bool,
    matrix: Matrix,
    num_frequencies: Option<usize>,
}

impl Header {
    fn new(ports: Option<usize>) -> Self {
        Self {
            unit_hz: 1e9,
            format: Format::MagnitudeAngle,
            has_options: false,
            is_version_2: false,
            ports,
            is_21_first: true,
            matrix: Matrix::Full,
            num_frequencies: None,
        }
    }

    /// Read the option line without its `#`. Only the first one counts.
    fn take_options(&mut self, line: usize, text: &str) -> Result<(), TouchstoneError> {
        if std::mem::replace(&mut self.has_options, true) {
            return Ok(());
        }
        let mut words = text.split_whitespace();
        while let Some(word) = words.next() {
            match word.to_ascii_lowercase().as_str() {
                "hz" => self.unit_hz = 1.0,
                "khz" => self.unit_hz = 1e3,
                "mhz" => self.unit_hz = 1e6,
                "ghz" => self.unit_hz = 1e9,
                "s" => {}
                "ri" => self.format = Format::RealImaginary,
                "ma" => self.format = Format::MagnitudeAngle,
                "db" => self.format = Format::DecibelAngle,
                "r" => {
                    // Reference resistance, one or one for each port.
                    words.by_ref().for_each(drop);
                }
                "y" | "z" | "h" | "g" => {
                    return fault(
                        line,
                        format!(
                            "expected scattering parameters, S, found {word}: export S parameters"
                        ),
                    );
                }
                _ => {
                    return fault(
                        line,
                        format!("expected an option, such as MHz, S or RI, found '{word}'"),
                    );
                }
            }
        }
        Ok(())
    }

    /// Read a keyword of version 2.0 with its argument.
    fn take_keyword(
        &mut self,
        line: usize,
        keyword: &str,
        argument: &str,
    ) -> Result<(), TouchstoneError> {
        let number = || match argument.parse::<usize>() {
            Ok(number) if number > 0 => Ok(number),
            _ => fault(
                line,
                format!("[{keyword}]: expected a whole number above 0, found '{argument}'"),
            ),
        };
        match keyword {
            "version" => match argument {
                "2.0" | "2.1" => self.is_version_2 = true,
                _ => return fault(line, format!("expected version 2.0, found {argument}")),
            },
            "number of ports" => {
                let ports = number()?;
                if ports > MAX_PORTS {
                    return fault(
                        line,
                        format!("expected at most {MAX_PORTS} ports, found {ports}"),
                    );
                }
                self.ports = Some(ports);
            }
            "number of frequencies" => self.num_frequencies = Some(number()?),
            "two-port data order" => match argument {
                "21_12" => self.is_21_first = true,
                "12_21" => self.is_21_first = false,
                _ => {
                    return fault(
                        line,
                        format!(
                            "[two-port data order]: expected 12_21 or 21_12, found '{argument}'"
                        ),
                    );
                }
            },
            "matrix format" => {
                self.matrix = match argument.to_ascii_lowercase().as_str() {
                    "full" => Matrix::Full,
                    "lower" => Matrix::Lower,
                    "upper" => Matrix::Upper,
                    _ => {
                        return fault(
                            line,
                            format!(
                                "[matrix format]: expected full, lower or upper, found '{argument}'"
                            ),
                        );
                    }
                };
            }
            "mixed-mode order" => {
                return fault(
                    line,
                    "expected single-ended ports, found [mixed-mode order]: export single-ended S parameters",
                );
            }
            // Reference impedances, which may continue on the next line, and others without effect on the parameter.
            _ => {}
        }
        Ok(())
    }

    /// Number of complex values at each frequency.
    fn num_values(&self, ports: usize) -> usize {
        match self.matrix {
            Matrix::Full => ports * ports,
            Matrix::Lower | Matrix::Upper => ports * (ports + 1) / 2,
        }
    }

    /// Place of a parameter in the values at a frequency.
    fn place(&self, ports: usize, [to, from]: [usize; 2]) -> usize {
        let (row, column) = (to - 1, from - 1);
        let (least, most) = (row.min(column), row.max(column));
        match self.matrix {
            Matrix::Full if ports == 2 && self.is_21_first => column * 2 + row,
            Matrix::Full => row * ports + column,
            Matrix::Lower => most * (most + 1) / 2 + least,
            // Rows before have `ports`, `ports - 1`, ... values.
            Matrix::Upper => least * (2 * ports + 1 - least) / 2 + most - least,
        }
    }
}

/// Section of a version 2.0 file.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Section {
    Header,
    Information,
    Network,
    Noise,
}

/// Read a scattering parameter from the text of a file. `ports` is the number of ports of a version 1.1 file ([`ports_of_name`]). Default of `parameter`: that from port 1 to
/// port 2, or the reflection of a single port.
///
/// # Errors
/// [`TouchstoneError`] with the line.
pub fn read(
    text: &str,
    ports: Option<usize>,
    parameter: Option<[usize; 2]>,
) -> Result<Parameter, TouchstoneError> {
    let mut header = Header::new(ports);
    let mut section = Section::Header;
    let mut numbers: Vec<f64> = Vec::new();
    let mut found = Parameter {
        frequencies_hz: Vec::new(),
        values: Vec::new(),
    };
    let mut last_line = 1;
    for (index, raw) in text.lines().enumerate() {
        let line = index + 1;
        let content = raw.split('!').next().unwrap_or_default().trim();
        if content.is_empty() {
            continue;
        }
        last_line = line;
        if let Some(options) = content.strip_prefix('#') {
            header.take_options(line, options)?;
            continue;
        }
        if let Some((keyword, argument)) = keyword(content) {
            match keyword.as_str() {
                "begin information" => section = Section::Information,
                "end information" => section = Section::Header,
                "network data" => section = Section::Network,
                "noise data" => section = Section::Noise,
                "end" => break,
                _ => header.take_keyword(line, &keyword, argument)?,
            }
            continue;
        }
        let is_data = match header.is_version_2 {
            true => section == Section::Network,
            false => section != Section::Noise,
        };
        if !is_data {
            continue;
        }
        let Some(ports) = header.ports else {
            return fault(
                line,
                "expected the number of ports, in the file name (.s2p) or by [number of ports]",
            );
        };
        let chosen = parameter.unwrap_or(if ports == 1 { [1, 1] } else { [2, 1] });
        if chosen.iter().any(|&port| port > ports) {
            let [to, from] = chosen;
            return fault(
                line,
                format!("expected a parameter of {ports} ports, found s{to}{from}"),
            );
        }
        let first = numbers.len();
        for word in content.split_whitespace() {
            match word.parse::<f64>() {
                Ok(number) if number.is_finite() => numbers.push(number),
                _ => return fault(line, format!("expected finite numbers, found '{word}'")),
            }
        }
        // Noise parameters of version 1.1 follow two-port data, at a frequency that is not higher.
        let previous_hz = found.frequencies_hz.last().copied();
        let falls = first == 0 && previous_hz.is_some_and(|hz| numbers[0] * header.unit_hz <= hz);
        if falls && ports == 2 && !header.is_version_2 && numbers.len() == 5 {
            numbers.clear();
            section = Section::Noise;
            continue;
        }
        let width = 1 + 2 * header.num_values(ports);
        if numbers.len() > width {
            return fault(
                line,
                format!(
                    "expected {width} numbers for each frequency of {ports} ports, found {}",
                    numbers.len()
                ),
            );
        }
        if numbers.len() < width {
            continue;
        }
        let frequency_hz = numbers[0] * header.unit_hz;
        if previous_hz.is_some_and(|hz| frequency_hz <= hz) || frequency_hz < 0.0 {
            return fault(
                line,
                format!("expected ascending frequencies, found {frequency_hz} Hz"),
            );
        }
        let place = 1 + 2 * header.place(ports, chosen);
        let value = header.format.value([numbers[place], numbers[place + 1]]);
        if !(value.re.is_finite() && value.im.is_finite()) {
            return fault(
                line,
                "expected finite values, found a magnitude beyond the range of numbers",
            );
        }
        found.frequencies_hz.push(frequency_hz);
        found.values.push(value);
        numbers.clear();
    }
    if !numbers.is_empty() {
        return fault(
            last_line,
            format!(
                "the file ends within a matrix: found {} numbers of it",
                numbers.len()
            ),
        );
    }
    if found.values.is_empty() {
        return fault(
            last_line,
            "expected network data, found none: check that the file is Touchstone",
        );
    }
    if let Some(stated) = header.num_frequencies
        && stated != found.values.len()
    {
        return fault(
            last_line,
            format!(
                "expected {stated} frequencies as stated, found {}: the file is incomplete",
                found.values.len()
            ),
        );
    }
    Ok(found)
}

/// Keyword in brackets, in lower case, and the rest of the line.
fn keyword(content: &str) -> Option<(String, &str)> {
    let (keyword, argument) = content.strip_prefix('[')?.split_once(']')?;
    Some((keyword.trim().to_ascii_lowercase(), argument.trim()))
}

impl Parameter {
    /// First frequency and step, hertz, of at least two frequencies that are evenly spaced: off by at most a hundredth of the step, which turns the phase at the
    /// unambiguous range by 0.06 rad.
    ///
    /// # Errors
    /// Text that states the expected and the found frequency.
    pub fn band(&self) -> Result<[f64; 2], String> {
        let hz = &self.frequencies_hz;
        let count = hz.len();
        if count < 2 {
            return Err(format!("expected at least two frequencies, found {count}"));
        }
        let step_hz = (hz[count - 1] - hz[0]) / (count - 1) as f64;
        let uneven = (0..count).find(|&k| {
            let even_hz = hz[0] + k as f64 * step_hz;
            (hz[k] - even_hz).abs() > 0.01 * step_hz
        });
        match uneven {
            None => Ok([hz[0], step_hz]),
            Some(k) => Err(format!(
                "expected evenly spaced frequencies, {} Hz at number {k} (from 0), found {} Hz: sweep linearly, in one segment",
                hz[0] + k as f64 * step_hz,
                hz[k]
            )),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn near(found: &[Complex64], expected: &[(f64, f64)]) {
        assert_eq!(found.len(), expected.len());
        for (value, &(re, im)) in found.iter().zip(expected) {
            assert!((value - Complex64::new(re, im)).norm() < 1e-12, "{found:?}");
        }
    }

    #[test]
    fn formats_and_units_give_the_same_numbers() {
        // 0.5 exp(j 60 deg) is 0.25 + j 0.4330..., and -6.0206 dB.
        let half = 0.5 * 3f64.sqrt() / 2.0;
        let level = 20.0 * 0.5f64.log10();
        for text in [
            format!("# GHz S RI R 50\n1 0.25 {half}\n1.5 0 1 ! comment\n"),
            "! analyser\n# mhz s ma r 75\n1000 0.5 60\n1500 1 90\n".to_owned(),
            format!("# HZ S DB\n1e9 {level} 60\n1.5E9 0 90\n# GHz S RI\n"),
            "1 0.5 60\n1.5 1 90\n".to_owned(),
        ] {
            let read = read(&text, Some(1), None).unwrap();
            assert_eq!(read.frequencies_hz, [1e9, 1.5e9], "{text}");
            near(&read.values, &[(0.25, half), (0.0, 1.0)]);
        }
    }

    #[test]
    fn two_ports_have_21_before_12_and_noise_is_ignored() {
        let text = "# GHz S RI R 50\n1 11 0 21 0 12 0 22 0\n2 11 1 21 1 12 1 22 1\n1 2.5 0.4 -30 0.3\n2 3 0.5 -60 0.4\n";
        for (name, re) in [("s11", 11.0), ("S21", 21.0), ("s12", 12.0), ("s2,2", 22.0)] {
            let parameter = parameter_of_name(name);
            let read = read(text, ports_of_name("a.b.S2P"), parameter).unwrap();
            near(&read.values, &[(re, 0.0), (re, 1.0)]);
        }
        near(
            &read(text, Some(2), None).unwrap().values,
            &[(21.0, 0.0), (21.0, 1.0)],
        );
    }

    #[test]
    fn matrices_of_three_ports_span_lines() {
        let text = "# Hz S RI R 50\n5 11 0 12 0 13 0 !\n 21 0 22 0 23 0\n 31 0 32 0 33 0\n6 1 0 1 0 1 0 1 0 1 0 1 0 1 0 32 1 1 0\n";
        let parameter = parameter_of_name("s32");
        near(
            &read(text, Some(3), parameter).unwrap().values,
            &[(32.0, 0.0), (32.0, 1.0)],
        );
    }

    #[test]
    fn version_2_states_ports_order_and_triangle() {
        let of = |lines: &str, data: &str| {
            format!(
                "[Version] 2.0\n# MHz S RI R 50\n[Number of Ports] 3\n[Number of Frequencies] 1\n[Reference] 50\n 50 75\n{lines}[Network Data]\n7 {data}\n[Noise Data]\n1 2 3 4 5\n[End]\nrest\n"
            )
        };
        let lower = of("[Matrix Format] Lower\n", "11 0 21 0 22 0 31 0 32 0 33 0");
        let upper = of("[Matrix Format] Upper\n", "11 0 21 0 31 0 22 0 32 0 33 0");
        for text in [&lower, &upper] {
            for (name, re) in [
                ("s11", 11.0),
                ("s12", 21.0),
                ("s21", 21.0),
                ("s13", 31.0),
                ("s22", 22.0),
                ("s32", 32.0),
                ("s33", 33.0),
            ] {
                let found = read(text, None, parameter_of_name(name)).unwrap();
                assert_eq!(found.frequencies_hz, [7e6]);
                near(&found.values, &[(re, 0.0)]);
            }
        }
        for (order, re) in [("12_21", 12.0), ("21_12", 21.0)] {
            let text = format!(
                "[Version] 2.0\n# Hz S RI\n[Number of Ports] 2\n[Two-Port Data Order] {order}\n[Begin Information]\n[Manufacturer] none\n1 2\n[End Information]\n[Network Data]\n1 0 0 12 0 21 0 0 0\n[End]\n"
            );
            near(
                &read(&text, None, Some([1, 2])).unwrap().values,
                &[(re, 0.0)],
            );
        }
    }

    #[test]
    fn faults_state_line_and_value() {
        let two = "# GHz S RI R 50\n1 11 0 21 0 12 0 22 0\n";
        for (text, ports, parameter, line, part) in [
            ("# GHz Y RI\n1 0 0\n", Some(1), None, 1, "found Y"),
            ("# parsec\n", Some(1), None, 1, "'parsec'"),
            ("1 2\n", Some(1), None, 1, "within a matrix"),
            ("1 2 3 4\n", Some(1), None, 1, "expected 3 numbers"),
            ("1 2 x\n", Some(1), None, 1, "'x'"),
            ("1 2 3\n1 2 3\n", Some(1), None, 2, "ascending"),
            ("1 2 3\n", None, None, 1, "number of ports"),
            ("! empty\n", Some(1), None, 1, "found none"),
            (two, Some(2), Some([3, 1]), 2, "found s31"),
            ("[Version] 3.0\n", None, None, 1, "found 3.0"),
            (
                "[Version] 2.0\n[Number of Ports] 1\n[Number of Frequencies] 2\n[Network Data]\n1 0 0\n",
                None,
                None,
                5,
                "2 frequencies as stated, found 1",
            ),
        ] {
            let error = read(text, ports, parameter).unwrap_err();
            assert_eq!(error.line, line, "{text}: {error}");
            assert!(error.message.contains(part), "{text}: {error}");
        }
        assert_eq!(ports_of_name("scan.csv"), None);
        assert_eq!(parameter_of_name("s0,1"), None);
    }

    #[test]
    fn uneven_frequencies_are_refused_with_the_expected_one() {
        let of = |hz: &[f64]| Parameter {
            frequencies_hz: hz.to_vec(),
            values: vec![Complex64::ONE; hz.len()],
        };
        assert_eq!(of(&[1e9, 1.1e9, 1.2e9]).band(), Ok([1e9, 1e8]));
        let error = of(&[1e9, 1.2e9, 1.3e9, 1.6e9]).band().unwrap_err();
        assert!(error.contains("1400000000 Hz at number 2"), "{error}");
        assert!(of(&[1e9]).band().is_err());
    }
}
