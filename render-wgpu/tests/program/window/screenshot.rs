//! What is to be seen of a window.

/// A window's pixels.
#[derive(Clone, PartialEq)]
pub(crate) struct Screenshot {
    pub(crate) width: usize,
    pub(crate) height: usize,
    /// Blue, green, red and nothing, row by row from the top.
    pub(super) pixels: Vec<u8>,
}

impl Screenshot {
    /// Red, green, blue.
    pub(crate) fn pixel(&self, x: usize, y: usize) -> [u8; 3] {
        let first = 4 * (y * self.width + x);
        [2, 1, 0].map(|color| self.pixels[first + color])
    }

    /// Whether anything was drawn: a window is black before.
    pub(crate) fn is_drawn(&self) -> bool {
        self.pixel(self.width - 1, self.height - 1) != [0; 3]
    }

    /// The overlay's sliders, from above: the right end of each one's bar.
    pub(crate) fn sliders(&self) -> Vec<(i16, i16)> {
        // Where the bars of sliders are, and no handle, border or text of anything else.
        const WITHIN: (usize, usize) = (145, 165);
        const HIGH: usize = 6;
        // Apart from the dithering.
        let is_bar = |x, y| self.pixel(x, y).iter().all(|color| (58..=62).contains(color));
        let is_row = |y| (WITHIN.0..WITHIN.1).all(|x| is_bar(x, y));
        let is_top = |&top: &usize| !is_row(top.saturating_sub(1)) && (top..top + HIGH).all(is_row);
        let end = |top: usize| {
            let y = top + HIGH / 2;
            let right = (WITHIN.1..self.width).find(|&x| !is_bar(x, y)).unwrap_or(self.width);
            (right as i16 - 3, y as i16)
        };
        (0..self.height - HIGH).filter(is_top).map(end).collect()
    }

    /// The number of pixels that another one of the same size has in another colour.
    pub(crate) fn difference(&self, other: &Self) -> usize {
        let pixels = self.pixels.chunks_exact(4).zip(other.pixels.chunks_exact(4));
        pixels.filter(|(one, other)| one[..3] != other[..3]).count()
    }
}
