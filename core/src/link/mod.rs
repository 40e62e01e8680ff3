//! Serial link between a host and the embedded module: framed messages over a line that may lose bytes.
//!
//! [`Encoder`] turns a [`Command`] or a [`Report`] into bytes. [`Receiver`] turns bytes into messages and counts
//! damaged frames. [`MapAssembly`] and [`ChipAssembly`] reassemble maps and image chips. Samples are not copied:
//! they are read from the receive buffer ([`complex32s`], [`sc16s`], [`Row`]).
//!
//! **Not provided**: automatic retransmission, encryption, authentication. One in `2^32` damaged frames is accepted
//! wrongly, see [`Receiver`].
//!
//! # Frame format
//!
//! | offset | bytes | content |
//! |---|---|---|
//! | 0 | 1 | protocol version, [`PROTOCOL_VERSION`] = 3 |
//! | 1 | 4 | sequence number, little endian |
//! | 5 | n | message, below |
//! | 5 + n | 4 | CRC-32/ISO-HDLC (as in zlib) of all preceding bytes, little endian |
//!
//! These 9 + n bytes are encoded by COBS (consistent overhead byte stuffing). They are split at their zeros, with one
//! zero appended. Each piece, without its zero, is preceded by a code byte equal to its length plus 1. A piece of more
//! than 253 bytes is sent as code 255 with 254 bytes and continues without a zero; if nothing follows, no code
//! follows. One zero byte terminates the frame. Additional zeros between frames are ignored: a leading zero terminates
//! any noise before the frame.
//!
//! Every frame has a sequence number. [`Command::Hello`] and [`Report::Identity`], which open the conversation, have
//! number 0; the following frames have 1, 2, ..., and 1 again after `2^32 - 1`. Each direction counts separately.
//!
//! # Message format
//! Messages use [postcard](https://postcard.jamesmunns.com/wire-format): the variant number, then its fields in order.
//!
//! | type | bytes |
//! |---|---|
//! | variant, `u16`, `u32`, length | groups of 7 bits, least significant first; bit 7 set in all but the last |
//! | `u8` | 1 |
//! | `f32`, `f64` | 4, 8, little endian |
//! | `bytes`, `text` | length, then the bytes; text is UTF-8 |
//! | array `[T; n]`, struct | elements in order, no length |
//!
//! ## Host to module: [`Command`]
//!
//! | number | name | fields |
//! |---|---|---|
//! | 0 | `Hello` | |
//! | 1 | `Configure` | id `u32`, setup, total pulses `u32`, send maps `u8` (0 or 1) |
//! | 2 | `Weights` | first `u16`, weights `bytes` (4 each: `f32`) |
//! | 3 | `Patch` | index `u16`, count `u16`, patch |
//! | 4 | `Start` | run `u32`, first pulse `u32` |
//! | 5 | `Pulse` | pulse, encoding, samples `bytes` |
//! | 6 | `Stop` | |
//! | 7 | `Status` | |
//! | 8 | `Abort` | |
//! | 9 | `Chip` | grid |
//! | 10 | `Detect` | cfar |
//! | 11 | `Motion` | id `u32`, motion setup |
//! | 12 | `Antennas` | transmitters `u16`, places `bytes` (16 each: x, y metres `f64`), transmitters first |
//! | 13 | `Channel` | pulse `u32`, channel `u16`, reference path metres `f64`, encoding, samples `bytes` |
//! | 14 | `Profiles` | id `u32`, sweep setup |
//! | 15 | `Burst` | sweep `u32`, carrier `u16`, first sample `u32`, samples `bytes` (8 each: real and imaginary counts of the reference, then of the echo, 16-bit two's complement, little endian) |
//! | 16 | `Sweep` | sweep `u32` |
//! | 17 | `Accumulated` | first `u32` |
//! | 18 | `SendChip` | patch `u16` |
//! | 19 | `Log` | least level, if any |
//! | 20 | `StartFrontEnd` | run `u32`, first pulse `u32` |
//! | 21 | `Geometry` | pulse |
//! | 22 | `Power` | |
//! | 23 | `Dpca` | lag pulses `f64` |
//!
//! ## Module to host: [`Report`]
//!
//! | number | name | fields |
//! |---|---|---|
//! | 0 | `Identity` | protocol `u8`, arithmetic, capacity, image capacity, version `text` |
//! | 1 | `Status` | state, configuration `u32`, run `u32`, next pulse `u32`, accept through `u32`, maps `u32`, link counters, pulse counters |
//! | 2 | `MapStart` | map `u32`, header, encoding |
//! | 3 | `MapRow` | map `u32`, row `u16`, samples `bytes` |
//! | 4 | `MapEnd` | map `u32`, rows `u16`, crc `u32` |
//! | 5 | `ChipStart` | chip `u32`, grid, maps `u32`, weight sum `f32`, left out `u32`, pixel encoding |
//! | 6 | `ChipPart` | chip `u32`, part `u16`, samples `bytes` |
//! | 7 | `ChipEnd` | chip `u32`, parts `u16`, crc `u32` |
//! | 8 | `Detections` | map `u32`, sub-CPI `u32`, patch `u16`, first `u16`, total `u16`, channels `u16`, list `bytes` (16 + 8 channels each: range bin, Doppler bin, power, noise `f32`; then real, imaginary `f32` for each channel) |
//! | 9 | `Refused` | sequence `u32`, refusal |
//! | 10 | `Event` | event |
//! | 11 | `Increment` | pulse `u32`, since `u32`, targets `u16`, echoes `u16`, motion, if any |
//! | 12 | `ProfileStart` | profile `u32`, profile header |
//! | 13 | `ProfileRow` | profile `u32`, row `u16`, samples `bytes` (8 each) |
//! | 14 | `ProfileEnd` | profile `u32`, rows `u16`, crc `u32` |
//! | 15 | `Accumulated` | first `u32`, bits `bytes` (lowest bit first) |
//!
//! ## Types
//!
//! | name | fields, or number and name of each variant |
//! |---|---|
//! | setup | pulses `u16`, channels `u16`, frequencies `u16`, range length `u16`, Doppler length `u16`, start hertz `f64`, step hertz `f64` |
//! | patch | centre metres `[f64; 3]`, range reach `u16`, Doppler reach `u16` |
//! | pulse | number `u32`, time seconds `f64`, transmitter metres `[f64; 3]`, receiver metres `[f64; 3]`, reference path metres `f64`, weight `f32` |
//! | encoding | 0 `Complex32` (8 bytes a sample: real, imaginary `f32`), 1 `Sc16` (4 bytes a sample: real, imaginary 16-bit two's complement, little endian, in units of `2^-15`) |
//! | pixel encoding | 0 `Complex32`, 1 `Sc16`, both as above; 2 `Power` (4 bytes a pixel: `f32`) |
//! | cfar | guard and training cells in range, guard and training cells in Doppler, `u16` each; probability of false alarm `f64` |
//! | motion setup | frequencies `u16`, range length `u16`, start hertz `f64`, step hertz `f64`, side lobes dB `f64`, nearest and farthest range metres `[f64; 2]`, guard and training cells `u16` each, rank `f64`, probability of false alarm `f64`, least SNR dB `f64`, follow |
//! | follow | gate, acceleration, distance apart in cells `f64` each, seen, within, bridge pulses `u16` each |
//! | motion, if any | `u8` 0 for none; 1, along the array and ahead metres `[f64; 2]`, turn radians `f64`, residual metres `f32`, targets `u16`, doubtful `u16` |
//! | sweep setup | carriers `u16`, samples a period `u16`, samples a burst `u32`, bins `u16`, start hertz `f64`, step hertz `f64` |
//! | profile header | sweep `u32`, usable carriers `u16`, samples taken `u32`, bins `u16`, bins of a row `u16` |
//! | grid | patch `u16`, origin, column step, row step metres `[f64; 3]` each, columns `u16`, rows `u16` |
//! | arithmetic | 0 `Float`, 1 `Fixed` |
//! | capacity | pulses, frequencies, range bins, Doppler bins, patches, `u16` each |
//! | image capacity | pixels `u32`, sub-CPIs `u32` |
//! | least level, if any | `u8` 0 for none; 1, level |
//! | level | 0 `Info`, 1 `Warn`, 2 `Error` |
//! | event | 0 `Started` faults `u32`, 1 `RunStarted` run `u32`, 2 `RunEnded` run `u32` pulses `u32` maps `u32`, 3 `Refused` refusal, 4 `FramesDamaged` frames `u32`, 5 `FramesLost` frames `u32`, 6 `PulsesDropped` pulses `u32`, 7 `SamplesAtLimit` samples `u32`, 8 `ResultsSaturated` results `u32`, 9 `StepTooLong` taken `u32` most `u32` (microseconds), 10 `EventsDropped` events `u32`, 11 `RunCost` stack `u32` of `u32` (bytes) ticks `u32` (thousands) ticks per second `u32` |
//! | state | 0 `Idle`, 1 `Ready`, 2 `Running`, 3 `Finishing`, 4 `Done` |
//! | link counters | frames, corrupt, malformed, too long, version, lost, repeated, `u32` each |
//! | pulse counters | accepted, lost, repeated, refused, dropped, at limit, saturated, incomplete, `u32` each |
//! | header | sub-CPI `u32`, patch index `u16`, channel `u16`, pulses `u16`, patch, time of first and last pulse seconds `[f64; 2]`, weight sum `f32`, two nodes |
//! | node | transmitter metres `[f64; 3]`, receiver metres `[f64; 3]` |
//! | refusal | 0 `NotConfigured`, 1 `Running`, 2 `NotRunning`, 3 `Setup` setup error, 4 `Weights`, 5 `PatchIndex`, 6 `Encoding`, 7 `PulseLength` expected `u32` got `u32`, 8 `Chip` wanted `u32` most `u32`, 9 `Detect`, 10 `Unsupported`, 11 `Motion` motion error, 12 `Antennas`, 13 `Sweep` sweep error, 14 `SubCpis` wanted `u32` most `u32`, 15 `Channels` wanted `u16` most `u16`, 16 `Dpca` cancellation error |
//! | motion error | 0 `Frequencies` wanted `u16` most `u16`, 1 `RangeLength` wanted `u16` most `u16`, 2 `Band`, 3 `Window`, 4 `Ranges`, 5 `Detection`, 6 `TrackerSettings`, 7 `Channels` most `u16`, 8 `Array` |
//! | cancellation error | 0 `Channels` found `u16`, 1 `NoLag`, 2 `NotFinite`, 3 `LagTooLong` found `u32` most `u16`, 4 `Map` wanted `u32` most `u32` |
//! | sweep error | 0 `Size` sweep quantity, wanted `u32`, least `u32`, most `u32`; 1 `NoPowerOfTwo` `u16`; 2 `Band`; 3 `NotFinite` |
//! | sweep quantity | 0 carriers, 1 samples a period, 2 samples a burst, 3 bins, 4 weights |
//! | setup error | 0 `Size` quantity, wanted `u32`, most `u32`; 1 `RangeLength` `u16`; 2 `DopplerLength` `u16`; 3 `Band`; 4 `NotFinite` |
//! | quantity | 0 pulses, 1 frequencies, 2 weights, 3 range length, 4 range gate, 5 Doppler band, 6 map, 7 patches, 8 channels |
//!
//! A map row has `2 range_reach + 1` samples in ascending order. In `Sc16` they are mantissas, followed by one signed
//! byte per 32 samples or part thereof: the exponent of two that scales these mantissas. A map has
//! `2 doppler_reach + 1` rows in ascending order. The `crc` of an end message is CRC-32/ISO-HDLC of the header's
//! bytes (for a chip: the grid's) followed by the `samples` of all rows or parts.
//!
//! A chip's pixels are row-major. Every part has 64 pixels, the last one the rest, encoded as a map row of as many
//! samples.
//!
//! # Conversation
//! ```text
//! host                                                module
//! Hello                                          ->
//!                                                <-   Identity (also after a reset of the module)
//! Configure, Weights ..., Patch ..., Chip, Dpca, Detect ->
//!                                                <-   Status each; Ready once complete
//! Start                                          ->
//!                                                <-   Status: Running, credit
//! Pulse Pulse Pulse ...                          ->
//!                                                <-   Status: more credit
//!                                                <-   MapStart MapRow ... MapEnd, Detections ...
//! Stop                                           ->
//!                                                <-   Status: Finishing; the last maps
//!                                                <-   Status: Done
//! Accumulated, SendChip                          ->
//!                                                <-   Accumulated, ChipStart ChipPart ... ChipEnd
//! ```
//!
//! - `Hello` is answered by `Identity`. Commands for which no other answer is named here are answered by `Status`, or by `Refused`
//!   with the command's sequence number. Without an answer in time, or without `Ready`, the host repeats the command,
//!   or the configuration from `Configure` on. All commands may be repeated safely: a `Start` of the current run and a
//!   `Stop` or `Abort` of a finished run have no effect.
//! - `Pulse` is not answered, except that the first pulse of a run with a wrong length or encoding is `Refused`.
//!   `Status` counts accepted and rejected pulses. The module also sends it unrequested whenever the credit grows. The
//!   host sends only pulses with numbers below `accept_through`. Credit is absolute: the next `Status` replaces a lost
//!   one, and a lost pulse returns no credit. A host that waits for credit requests `Status`.
//! - Channels: with several channels in the setup, each channel of pulse `m` is sent as a pulse of its own, numbered
//!   `m C + c`; credit, counters and runs count these. Targets are detected on the map of channel 0. Each detection
//!   has the value of every channel's map at the nearest cell. Maps and images are of one channel.
//! - Clutter cancellation: with `Dpca`, in a configuration of two channels, targets are detected on the difference of the aligned maps
//!   ([`crate::dpca`]), and the two values of a detection are the aligned ones. The host sends the slow-time weights of
//!   [`Dpca::weight`](crate::dpca::Dpca::weight) with the pulses. `Dpca` is `Refused` for another number of channels or an invalid lag,
//!   `Start` if the map of a patch does not fit the pixels of the image capacity.
//! - Front end: `StartFrontEnd` replaces `Start`, and `Geometry` replaces `Pulse`: the samples come from a front end of the
//!   module. Geometry is accepted in the order of the pulses and ahead of their samples, as far as the credit; the next pulse
//!   of `Status` is the next geometry. A pulse whose samples the front end loses is counted as lost. After `Stop` the run ends
//!   once the samples of all pulses were received or lost.
//! - Increments: `Motion` and `Antennas` replace the configuration above, and `Channel` replaces `Pulse`, one per
//!   channel of a pulse. The credit is one pulse: the next pulse may be sent after the increment of the previous one. A
//!   host that receives no increment requests `Status` and repeats all channels of the pulse. The lost channels
//!   complete it; if the pulse was complete, its increment is sent again.
//! - Profiles: `Profiles` and `Weights`, one per carrier, replace the configuration above, and `Burst` replaces
//!   `Pulse`. A burst is sent in any number of parts of any sizes. Samples that were lost in transfer or never taken
//!   are missing from it. `Sweep` is answered by `ProfileStart`, `ProfileRow` and `ProfileEnd`; a host that does not
//!   receive all of them repeats it. The header states the number of received samples: a host that sent more may
//!   repeat the sweep from its first burst. There is no credit: samples are processed on arrival.
//! - Images: after `Chip` for every patch, each sub-CPI is added to all chips exactly once, in any number of runs. A
//!   sub-CPI that was already added is not added again, an incomplete one is not added, and an `Abort` first completes a
//!   sub-CPI that some chips contain: the run is over when `Status` says so. `Accumulated` is answered by the list of
//!   the sub-CPIs added, from which the host derives the sub-CPIs to repeat. `SendChip` between runs is answered by `ChipStart`,
//!   `ChipPart` and `ChipEnd`. A host that does not receive all of them repeats it. `Configure` discards the chips.
//! - `Log` is not answered by `Status` but by the event `Started`, if its level is requested. Events follow whenever the
//!   line has no other report to send; those that find the module's queue full are dropped and counted. `Log` may be
//!   repeated.
//! - Maps are not retransmitted. An incomplete map is lost and the rest of the run is not affected. The last `Status`
//!   of the run states the number of maps.
//! - A host that drops a frame as [`Damage::Repeated`] sends `Hello`: the module has restarted.
//!
//! # Sizes
//! A message without samples has at most [`MAX_MESSAGE_BYTES`]: a text has at most [`MAX_TEXT_BYTES`], a frame at most
//! [`MAX_LIST_BYTES`] of detections, and weights are split over several messages. Buffers: [`max_received_bytes`] and
//! [`max_frame_bytes`] of the maximum number of samples in a message.
//!
//! **Tests**: `tests/link/frames.rs` (round trip and bytes of every message, every bit flipped, lines with bit
//! errors), `tests/link/assembly.rs`.

mod assembly;
mod command;
mod event;
mod frame;
mod profiles;
mod receiver;
mod report;
mod samples;

pub use assembly::{
    AssembledChip, AssembledMap, ChipAssembly, Loss, LossCause, MapAssembly, TransferChecksum,
};
pub use command::{
    ChipGrid, Command, Configuration, Encoding, MotionConfiguration, PixelEncoding,
    SweepConfiguration,
};
pub use event::{Event, Level};
pub use frame::{
    CRC, EncodeError, Encoder, MAX_MESSAGE_BYTES, Message, OVERHEAD_BYTES, PROTOCOL_VERSION,
    max_frame_bytes, max_received_bytes,
};
pub use profiles::{AssembledProfile, ProfileAssembly};
pub use receiver::{Damage, LinkCounters, Received, Receiver};
pub use report::{
    Arithmetic, ImageCapacity, Increment, MAX_ACCUMULATED_BYTES, MAX_TEXT_BYTES, Motion,
    ProfileHeader, Refusal, Report, State, Status,
};
pub use samples::{
    CHIP_PART_PIXELS, MAX_ANTENNAS, MAX_LIST_BYTES, Row, complex32s, detection_bytes, detections,
    f32s, pairs, pixel_bytes, places, row_bytes, sc16s, write_block_row, write_complex32s,
    write_detections, write_f32s, write_map_row, write_pairs, write_pixels, write_places,
    write_sc16s,
};

/// Serialise bytes in one piece. serde would serialise a slice element by element, to the same bytes.
fn as_bytes<S: serde::Serializer>(bytes: &[u8], serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_bytes(bytes)
}
