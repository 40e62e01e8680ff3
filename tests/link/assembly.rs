//! Reassembly of maps and chips from reports: complete and unchanged, or counted as lost.

use subaperture_core::Complex32;
use subaperture_core::link::{
    AssembledMap, ChipAssembly, ChipGrid, Encoding, LossCause, MapAssembly, PixelEncoding, Report,
    TransferChecksum, row_bytes, write_pixels,
};
use subaperture_core::stream::{MapHeader, Node, Patch};

/// Report that owns its bytes.
#[derive(Clone, Debug)]
enum Sent {
    Start(u32, MapHeader, Encoding),
    Row(u32, u16, Vec<u8>),
    End(u32, u16, u32),
}

impl Sent {
    fn report(&self) -> Report<'_> {
        match self {
            Self::Start(map, header, encoding) => Report::MapStart {
                map: *map,
                header: *header,
                encoding: *encoding,
            },
            Self::Row(map, row, samples) => Report::MapRow {
                map: *map,
                row: *row,
                samples,
            },
            Self::End(map, rows, crc) => Report::MapEnd {
                map: *map,
                rows: *rows,
                crc: *crc,
            },
        }
    }
}

const REACH: (u16, u16) = (20, 3);
const ROWS: usize = 2 * REACH.1 as usize + 1;

fn header(map: u32) -> MapHeader {
    MapHeader {
        sub_cpi: map / 4,
        patch_index: (map % 4) as u16,
        channel: 0,
        num_pulses: 64,
        patch: Patch {
            centre_m: [f64::from(map), 0.0, -1.0],
            range_reach: REACH.0,
            doppler_reach: REACH.1,
        },
        time_s: [0.5, 1.5],
        weight_sum: 33.0,
        nodes: [Node::default(); 2],
    }
}

/// All reports of a map, with bytes that depend on map, row and position.
fn map(number: u32, encoding: Encoding) -> Vec<Sent> {
    let width = 2 * usize::from(REACH.0) + 1;
    let len = row_bytes(encoding, width).expect("a number");
    let header = header(number);
    let mut checksum = TransferChecksum::new(&header);
    let mut all = vec![Sent::Start(number, header, encoding)];
    for row in 0..ROWS {
        let samples: Vec<u8> = (0..len)
            .map(|i| (number as usize + 31 * row + 7 * i) as u8)
            .collect();
        checksum.add_row(&samples);
        all.push(Sent::Row(number, row as u16, samples));
    }
    all.push(Sent::End(number, ROWS as u16, checksum.value()));
    all
}

fn bytes_of(all: &[Sent]) -> Vec<u8> {
    all.iter()
        .filter_map(|sent| match sent {
            Sent::Row(_, _, samples) => Some(samples.clone()),
            _ => None,
        })
        .flatten()
        .collect()
}

/// Complete maps: number and bytes.
type Whole = Vec<(u32, Vec<u8>)>;

/// Result of a sequence of reports: complete maps, and the causes of reported losses.
fn assemble(reports: &[Sent], maps: u32, room: usize) -> (Whole, Vec<LossCause>, u32) {
    let mut buffer = vec![0; room];
    let mut assembly = MapAssembly::new(&mut buffer);
    let (mut whole, mut causes) = (Vec::new(), Vec::new());
    for sent in reports {
        match assembly.take(&sent.report()) {
            Ok(Some(AssembledMap {
                map,
                header: came,
                bytes,
                ..
            })) => {
                assert_eq!(came, header(map));
                whole.push((map, bytes.to_vec()));
            }
            Ok(None) => {}
            Err(loss) => causes.push(loss.cause),
        }
    }
    assembly.finish(maps);
    assert_eq!(assembly.complete() as usize, whole.len());
    assert_eq!(assembly.complete() + assembly.lost(), maps);
    (whole, causes, assembly.lost())
}

const ENOUGH: usize = 8 * (2 * REACH.0 as usize + 1) * ROWS;

#[test]
fn complete_maps_are_reassembled_unchanged() {
    for encoding in [Encoding::Complex32, Encoding::Sc16] {
        let maps: Vec<_> = (0..5).map(|number| map(number, encoding)).collect();
        let (whole, causes, lost) = assemble(&maps.concat(), 5, ENOUGH);
        assert_eq!((causes, lost), (vec![], 0));
        for (number, bytes) in whole {
            assert_eq!(bytes, bytes_of(&maps[number as usize]));
        }
    }
}

/// If any one report of the second of three maps is missing, repeated or swapped with the next, that map is lost once
/// and the others are not.
#[test]
fn missing_repeated_or_swapped_report_loses_only_its_map() {
    let maps = [0, 1, 2].map(|number| map(number, Encoding::Sc16));
    let [first, second, third] = &maps;
    let check = |damaged: Vec<Sent>, case: &str| {
        let all = [first.as_slice(), &damaged, third].concat();
        let (whole, causes, lost) = assemble(&all, 3, ENOUGH);
        let numbers: Vec<u32> = whole.iter().map(|(number, _)| *number).collect();
        assert_eq!(numbers, [0, 2], "{case}");
        assert_eq!(lost, 1, "{case}");
        assert!(causes.len() <= 1, "{case}: {causes:?}");
        for (number, bytes) in whole {
            assert_eq!(bytes, bytes_of(&maps[number as usize]));
        }
    };
    for place in 0..second.len() {
        let mut missing = second.clone();
        missing.remove(place);
        check(missing, &format!("report {place} missing"));
        let last = place + 1 == second.len();
        if !last {
            // A repeated end arrives after the map is complete and is ignored.
            let mut doubled = second.clone();
            doubled.insert(place, second[place].clone());
            check(doubled, &format!("report {place} doubled"));
            let mut exchanged = second.clone();
            exchanged.swap(place, place + 1);
            check(exchanged, &format!("report {place} exchanged"));
        }
    }
    check(vec![], "all of it missing");
}

#[test]
fn repeated_end_is_ignored() {
    let mut all = map(0, Encoding::Complex32);
    all.push(all[all.len() - 1].clone());
    let (whole, causes, lost) = assemble(&all, 1, ENOUGH);
    assert_eq!((whole.len(), causes, lost), (1, vec![], 0));
}

/// A changed byte of any row, a changed header, a row of another length or of another map.
#[test]
fn changed_report_loses_its_map() {
    let good = map(0, Encoding::Complex32);
    let lose = |damaged: &[Sent], cause| {
        let (whole, causes, lost) = assemble(damaged, 1, ENOUGH);
        assert!(whole.is_empty());
        assert_eq!((causes, lost), (vec![cause], 1));
    };
    for row in 1..=ROWS {
        for (place, bit) in [(0, 0), (100, 3), (327, 7)] {
            let mut damaged = good.clone();
            if let Sent::Row(_, _, samples) = &mut damaged[row] {
                samples[place] ^= 1 << bit;
            }
            lose(&damaged, LossCause::Checksum);
        }
        let mut damaged = good.clone();
        if let Sent::Row(_, _, samples) = &mut damaged[row] {
            samples.pop();
        }
        lose(&damaged, LossCause::Length);
    }
    let mut damaged = good.clone();
    if let Sent::Start(_, header, _) = &mut damaged[0] {
        header.patch.centre_m[0] += 1.0e-9;
    }
    lose(&damaged, LossCause::Checksum);
    let mut damaged = good.clone();
    if let Sent::Start(_, header, _) = &mut damaged[0] {
        header.patch.doppler_reach -= 1;
    }
    lose(&damaged, LossCause::Rows);
    let mut damaged = good;
    if let Sent::End(_, rows, _) = &mut damaged[ROWS + 1] {
        *rows -= 1;
    }
    lose(&damaged, LossCause::Rows);
}

/// A map that fits the buffer exactly is accepted. With one byte less it is lost, and later maps that fit are still
/// accepted. Sizes that overflow are too large and do not panic.
#[test]
fn maps_larger_than_buffer_are_lost() {
    let large = map(0, Encoding::Complex32);
    let small = map(1, Encoding::Sc16);
    let all = [large, small].concat();
    let (whole, _, lost) = assemble(&all, 2, ENOUGH);
    assert_eq!((whole.len(), lost), (2, 0));
    let (whole, causes, lost) = assemble(&all, 2, ENOUGH - 1);
    assert_eq!((whole[0].0, causes, lost), (1, vec![LossCause::Room], 1));

    let mut huge = header(0);
    huge.patch.range_reach = u16::MAX;
    huge.patch.doppler_reach = u16::MAX;
    let (_, causes, _) = assemble(&[Sent::Start(0, huge, Encoding::Complex32)], 1, ENOUGH);
    assert_eq!(causes, [LossCause::Room]);
    let (_, causes, lost) = assemble(&[Sent::End(u32::MAX - 1, 0, 0)], u32::MAX, 0);
    assert_eq!((causes, lost), (vec![LossCause::NoStart], u32::MAX));
}

/// The checksum is CRC-32 over the header's bytes, at most 160, and the rows. Computed here with another library and a
/// header encoded field by field.
#[test]
fn checksum_matches_description() {
    let header = header(5);
    let mut bytes = vec![1, 1, 0, 64];
    bytes.extend([5.0f64, 0.0, -1.0].map(f64::to_le_bytes).concat());
    bytes.extend([20, 3]);
    bytes.extend([0.5f64, 1.5].map(f64::to_le_bytes).concat());
    bytes.extend(33.0f32.to_le_bytes());
    bytes.extend([0; 2 * 2 * 3 * 8]);
    let rows: [&[u8]; 2] = [b"first row", b"second"];
    bytes.extend(rows.concat());
    let mut checksum = TransferChecksum::new(&header);
    rows.iter().for_each(|row| checksum.add_row(row));
    assert_eq!(checksum.value(), crc32fast::hash(&bytes));
}

/// Chip of 160 pixels: two whole parts and one of 32 pixels.
fn check_chip(encoding: PixelEncoding) {
    let grid = ChipGrid {
        patch: 0,
        origin_m: [1.0, 2.0, 3.0],
        column_step_m: [0.5, 0.0, 0.0],
        row_step_m: [0.0, 0.5, 0.0],
        num_columns: 20,
        num_rows: 8,
    };
    let pixels: Vec<Complex32> = (0..160)
        .map(|i| Complex32::cis(i as f32) * 1.03f32.powi(i))
        .collect();
    let mut buffer = [0; 8 * 64];
    let parts: Vec<Vec<u8>> = pixels
        .chunks(64)
        .map(|part| {
            let bytes = write_pixels(encoding, part, 2.0, &mut buffer);
            bytes.expect("room for a part").to_vec()
        })
        .collect();
    let mut checksum = TransferChecksum::new(&grid);
    parts.iter().for_each(|part| checksum.add_row(part));
    let reports = |chip| {
        let mut all = vec![Report::ChipStart {
            chip,
            grid,
            maps: 7,
            weight_sum: 448.0,
            left_out: 0,
            encoding,
        }];
        all.extend((0..).zip(&parts).map(|(part, samples)| Report::ChipPart {
            chip,
            part,
            samples,
        }));
        all.push(Report::ChipEnd {
            chip,
            parts: 3,
            crc: checksum.value(),
        });
        all
    };
    let mut buffer = [0; 8 * 160];
    let mut assembly = ChipAssembly::new(&mut buffer);
    for (number, report) in reports(0).iter().enumerate() {
        let chip = assembly.take(report).expect("the reports are complete");
        assert_eq!(chip.is_some(), number == 4);
        if let Some(chip) = chip {
            assert_eq!((chip.grid, chip.maps, chip.weight_sum), (grid, 7, 448.0));
            let received: Vec<Complex32> = chip.pixels().collect();
            assert_eq!(received.len(), 160);
            for (i, (z, pixel)) in received.iter().zip(&pixels).enumerate() {
                let last = 2.0 * 1.03f32.powi((i as i32 / 32) * 32 + 31);
                // Half a unit of 2^-15 of at most twice the block's largest part, in each part.
                let (sent, most) = match encoding {
                    PixelEncoding::Complex32 => (*pixel, 0.0),
                    PixelEncoding::Sc16 => (*pixel, 1.5 * last / 32768.0),
                    PixelEncoding::Power => (Complex32::from(pixel.re), 0.0),
                };
                assert!((z - sent * 2.0).norm() <= most, "{i}: {z} {pixel}");
            }
        }
    }
    for missing in 0..5 {
        let mut all = reports(1);
        all.remove(missing);
        assembly.restart();
        for report in &all {
            assert!(
                !matches!(assembly.take(report), Ok(Some(_))),
                "{missing} is missing"
            );
        }
        assert_eq!(assembly.complete(), 0);
    }
    assembly.restart();
    for report in reports(2) {
        let _ = assembly.take(&report);
    }
    assert_eq!((assembly.complete(), assembly.lost()), (1, 2));
}

#[test]
fn chips_are_complete_or_lost() {
    check_chip(PixelEncoding::Complex32);
    check_chip(PixelEncoding::Sc16);
    check_chip(PixelEncoding::Power);
}

/// The largest part of a block keeps 15 bits at any level, and zeros stay zeros.
#[test]
fn pixels_in_16_bits_keep_their_relative_precision() {
    let mut buffer = [0; 8];
    for exponent in -120..120 {
        for mantissa in [1.0f32, 1.5, 1.999_99, 2.0 - f32::EPSILON] {
            let value = mantissa * 2f32.powi(exponent);
            let pixel = Complex32::new(-value, value / 3.0);
            let bytes = write_pixels(PixelEncoding::Sc16, &[pixel], 1.0, &mut buffer).unwrap();
            let row = subaperture_core::link::Row::new(Encoding::Sc16, 1, bytes).unwrap();
            let back = row.values().next().unwrap();
            assert!((back - pixel).norm() <= value / 16384.0, "{pixel} {back}");
        }
    }
    let bytes = write_pixels(PixelEncoding::Sc16, &[Complex32::ZERO], 1.0, &mut buffer);
    assert_eq!(bytes, Some(&[0; 5][..]));
}
