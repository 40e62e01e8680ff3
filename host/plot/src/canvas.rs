//! Drawing surface: pixels, rectangles, lines, text, and PNG encoding.

use ab_glyph::{Font, FontRef, GlyphId, PxScale, ScaleFont, point};

use super::PlotError;
use super::colours::RED;
use subaperture_model::PROGRAM;

/// Colour: red, green, blue.
pub(super) type Rgb = [u8; 3];

pub(super) const INK: Rgb = [25, 25, 25];

/// PNG compression.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Packing {
    /// Fast: speckle is noise, for which matching saves 4 % and takes thirty times as long.
    Quick,
    /// Small: halves the size of line drawings and uniform areas.
    Small,
}

/// Horizontal alignment of text.
#[derive(Clone, Copy)]
pub(super) enum Anchor {
    /// Left end at the point.
    Left,
    /// Centred on the point.
    Middle,
    /// Right end at the point.
    Right,
}

/// Page, initially white; row 0 is the top.
pub(super) struct Canvas {
    width: usize,
    height: usize,
    /// Channels per pixel: 1 (grey) until a colour is drawn, then 3.
    channels: usize,
    pixels: Vec<u8>,
}

impl Canvas {
    pub(super) fn new(width: usize, height: usize) -> Self {
        Self {
            width,
            height,
            channels: 1,
            pixels: vec![255; width * height],
        }
    }

    /// Convert the page to three channels if a colour needs it.
    fn admit(&mut self, colours: &[Rgb]) {
        if self.channels == 1 && !colours.iter().all(is_grey) {
            let levels = self.pixels.iter();
            self.pixels = levels.flat_map(|&level| [level; 3]).collect();
            self.channels = 3;
        }
    }

    /// Blend `colour` into a pixel with the opacity `part`; clipped to the page.
    pub(super) fn mix(&mut self, x: i64, y: i64, colour: Rgb, part: f32) {
        self.admit(&[colour]);
        let inside = |v: i64, size: usize| usize::try_from(v).ok().filter(|&v| v < size);
        if let (Some(x), Some(y)) = (inside(x, self.width), inside(y, self.height)) {
            let at = (y * self.width + x) * self.channels;
            for (old, new) in self.pixels[at..at + self.channels].iter_mut().zip(colour) {
                let (a, b) = (f32::from(*old), f32::from(new));
                *old = (a + (b - a) * part.clamp(0.0, 1.0)).round() as u8;
            }
        }
    }

    /// Fill a rectangle.
    pub(super) fn fill(&mut self, x: usize, y: usize, width: usize, height: usize, colour: Rgb) {
        self.admit(&[colour]);
        for row in y..(y + height).min(self.height) {
            for column in x..(x + width).min(self.width) {
                let at = (row * self.width + column) * self.channels;
                self.pixels[at..at + self.channels].copy_from_slice(&colour[..self.channels]);
            }
        }
    }

    /// Copy a row of colours to the page from (`x`, `y`) on, repeated in `rows` rows.
    ///
    /// # Panics
    /// If the row exceeds the page.
    pub(super) fn put(&mut self, x: usize, y: usize, rows: usize, colours: &[Rgb]) {
        assert!(x + colours.len() <= self.width && y + rows <= self.height);
        self.admit(colours);
        let at = (y * self.width + x) * self.channels;
        let row = &mut self.pixels[at..at + self.channels * colours.len()];
        match self.channels {
            1 => row
                .iter_mut()
                .zip(colours)
                .for_each(|(level, colour)| *level = colour[0]),
            _ => row.copy_from_slice(colours.as_flattened()),
        }
        let (first, stride) = (at..at + row.len(), self.channels * self.width);
        for row in 1..rows {
            self.pixels.copy_within(first.clone(), at + row * stride);
        }
    }

    /// Draw a frame of one pixel outside a rectangle.
    pub(super) fn frame(&mut self, x: usize, y: usize, width: usize, height: usize) {
        for row in [y - 1, y + height] {
            self.fill(x - 1, row, width + 2, 1, INK);
        }
        for column in [x - 1, x + width] {
            self.fill(column, y - 1, 1, height + 2, INK);
        }
    }

    /// Draw a straight antialiased line, about 1.6 pixels wide.
    pub(super) fn line(&mut self, (x0, y0): (f64, f64), (x1, y1): (f64, f64)) {
        const HALF: f64 = 0.8;
        let (dx, dy) = (x1 - x0, y1 - y0);
        let square = (dx * dx + dy * dy).max(1e-12);
        let range =
            |a: f64, b: f64| (a.min(b) - 2.0).floor() as i64..=(a.max(b) + 2.0).ceil() as i64;
        for y in range(y0, y1) {
            for x in range(x0, x1) {
                let (px, py) = (x as f64 + 0.5 - x0, y as f64 + 0.5 - y0);
                let along = ((px * dx + py * dy) / square).clamp(0.0, 1.0);
                let distance = (px - along * dx).hypot(py - along * dy);
                self.mix(x, y, INK, (HALF + 0.5 - distance) as f32);
            }
        }
    }

    /// Draw a line of text with its baseline at `y`.
    pub(super) fn text(&mut self, x: f32, y: f32, anchor: Anchor, font: &Typeface, text: &str) {
        let start = x - font.offset(anchor, text);
        font.draw(text, |along, down, cover| {
            self.mix(
                (start.round() as i64) + along,
                (y.round() as i64) + down,
                INK,
                cover,
            );
        });
    }

    /// Draw a line of text upwards, baseline at `x`, centred at `y`.
    pub(super) fn text_upwards(&mut self, x: f32, y: f32, font: &Typeface, text: &str) {
        let start = y + font.offset(Anchor::Middle, text);
        font.draw(text, |along, down, cover| {
            self.mix(
                (x.round() as i64) + down,
                (start.round() as i64) - along,
                INK,
                cover,
            );
        });
    }

    /// Join this page and another of the same width below it.
    pub(super) fn above(mut self, mut below: Self) -> Self {
        debug_assert_eq!(self.width, below.width);
        if self.channels != below.channels {
            self.admit(&[RED]);
            below.admit(&[RED]);
        }
        self.height += below.height;
        self.pixels.extend(below.pixels);
        self
    }

    /// Encode as PNG; in grey if the page has no colours, which takes a third of the time.
    pub(super) fn into_png(self, packing: Packing) -> Result<Vec<u8>, PlotError> {
        let (pixels, colours) = match self.channels {
            1 => (self.pixels, png::ColorType::Grayscale),
            // Colours may have been overdrawn.
            _ => match grey(&self.pixels) {
                Some(levels) => (levels, png::ColorType::Grayscale),
                None => (self.pixels, png::ColorType::Rgb),
            },
        };
        let mut out = Vec::new();
        let mut encoder = png::Encoder::new(&mut out, self.width as u32, self.height as u32);
        encoder.set_color(colours);
        encoder.set_depth(png::BitDepth::Eight);
        if packing == Packing::Quick {
            encoder.set_compression(png::Compression::Fast);
            // The default filter of this compression would double the file.
            encoder.set_filter(png::Filter::Adaptive);
        }
        // Marks the file as replaceable by a later run.
        encoder.add_text_chunk("Software".to_owned(), PROGRAM.to_owned())?;
        let mut writer = encoder.write_header()?;
        writer.write_image_data(&pixels)?;
        writer.finish()?;
        Ok(out)
    }
}

fn is_grey(&[red, green, blue]: &Rgb) -> bool {
    red == green && green == blue
}

/// Grey levels, if all pixels are grey.
fn grey(pixels: &[u8]) -> Option<Vec<u8>> {
    let (colours, _) = pixels.as_chunks::<3>();
    let all = colours.iter().all(is_grey);
    all.then(|| colours.iter().map(|&[red, ..]| red).collect())
}

/// Font at a size.
pub(super) struct Typeface {
    font: FontRef<'static>,
    scale: PxScale,
}

impl Typeface {
    /// DejaVu Sans with an em size of `size` pixels.
    pub(super) fn sans(size: f32, bold: bool) -> Self {
        let bytes = match bold {
            true => dejavu::sans::bold(),
            false => dejavu::sans::regular(),
        };
        let font = FontRef::try_from_slice(bytes).expect("the embedded font is valid");
        let scale = font
            .pt_to_px_scale(size * 0.75)
            .unwrap_or(PxScale::from(size));
        Self { font, scale }
    }

    fn offset(&self, anchor: Anchor, text: &str) -> f32 {
        match anchor {
            Anchor::Left => 0.0,
            Anchor::Middle => self.width(text) / 2.0,
            Anchor::Right => self.width(text),
        }
    }

    /// Width of a line of text, pixels.
    pub(super) fn width(&self, text: &str) -> f32 {
        let mut width = 0.0;
        self.place(text, |_, x, advance| width = x + advance);
        width
    }

    /// Truncate `text` to `width` pixels, with an ellipsis.
    pub(super) fn fitted(&self, text: &str, width: f32) -> String {
        if self.width(text) <= width {
            return text.to_owned();
        }
        // Measured from the start: the cost of a very long text is bounded by the width.
        let room = width - self.width("…");
        let mut end = 0;
        for (at, c) in text.char_indices() {
            let next = at + c.len_utf8();
            if self.width(&text[..next]) > room {
                break;
            }
            end = next;
        }
        format!("{}…", text[..end].trim_end())
    }

    /// Call `each` with glyph, position and advance.
    fn place(&self, text: &str, mut each: impl FnMut(GlyphId, f32, f32)) {
        let font = self.font.as_scaled(self.scale);
        let mut x = 0.0;
        let mut previous = None;
        for c in text.chars() {
            let glyph = font.glyph_id(c);
            if let Some(previous) = previous {
                x += font.kern(previous, glyph);
            }
            let advance = font.h_advance(glyph);
            each(glyph, x, advance);
            x += advance;
            previous = Some(glyph);
        }
    }

    /// Call `dot` with pixel offsets right of the start and below the baseline, and the coverage.
    fn draw(&self, text: &str, mut dot: impl FnMut(i64, i64, f32)) {
        self.place(text, |glyph, x, _| {
            let glyph = glyph.with_scale_and_position(self.scale, point(x, 0.0));
            if let Some(outline) = self.font.outline_glyph(glyph) {
                let corner = outline.px_bounds().min;
                outline.draw(|i, j, cover| {
                    let along = corner.x.round() as i64 + i64::from(i);
                    dot(along, corner.y.round() as i64 + i64::from(j), cover);
                });
            }
        });
    }
}
