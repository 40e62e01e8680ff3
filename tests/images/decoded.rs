//! Decoded PNG pictures.

/// Red, green and blue of all pixels, by row.
pub(super) struct Picture {
    pub(super) width: usize,
    pub(super) height: usize,
    pub(super) rgb: Vec<u8>,
    /// Whether the file has only levels of grey.
    pub(super) grey: bool,
}

impl Picture {
    pub(super) fn decode(bytes: &[u8]) -> Self {
        let mut reader = png::Decoder::new(std::io::Cursor::new(bytes))
            .read_info()
            .unwrap();
        let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
        let info = reader.next_frame(&mut pixels).unwrap();
        let grey = info.color_type == png::ColorType::Grayscale;
        if !grey {
            assert_eq!(info.color_type, png::ColorType::Rgb);
        }
        let rgb = match grey {
            true => pixels.into_iter().flat_map(|level| [level; 3]).collect(),
            false => pixels,
        };
        let (width, height) = (info.width as usize, info.height as usize);
        assert_eq!(rgb.len(), width * height * 3);
        Self {
            width,
            height,
            rgb,
            grey,
        }
    }

    pub(super) fn at(&self, x: usize, y: usize) -> [u8; 3] {
        let at = (y * self.width + x) * 3;
        [self.rgb[at], self.rgb[at + 1], self.rgb[at + 2]]
    }

    /// The plot's box: from the left frame line, a column of ink under the title, to its right one.
    pub(super) fn plot(&self) -> [usize; 4] {
        const INK: [u8; 3] = [25, 25, 25];
        // The top line of the frame is the first long run of dark pixels; its ends are the corners.
        let runs = |y: usize| {
            let mut best = (0, 0);
            let mut start = None;
            for x in 0..=self.width {
                let ink = x < self.width && self.at(x, y) == INK;
                match (ink, start) {
                    (true, None) => start = Some(x),
                    (false, Some(s)) => {
                        if x - s > best.1 - best.0 {
                            best = (s, x);
                        }
                        start = None;
                    }
                    _ => {}
                }
            }
            best
        };
        let lines: Vec<usize> = (0..self.height)
            .filter(|&y| {
                let (a, b) = runs(y);
                b - a > 150
            })
            .collect();
        let (left, right) = runs(lines[0]);
        [left + 1, lines[0] + 1, right - 1, lines[1]]
    }
}
