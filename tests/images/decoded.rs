//! A picture as whoever opens the file sees it.

/// Red, green and blue of all pixels, row by row.
pub(super) struct Picture {
    pub(super) width: usize,
    pub(super) height: usize,
    pub(super) rgb: Vec<u8>,
    /// Whether the file has levels of grey alone.
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
}
