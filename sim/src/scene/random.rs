//! Random numbers with the same bits everywhere.

use crate::mix::mix;

/// SplitMix64 (Steele, Lea and Flood 2014): small, portable, good enough to scatter particles.
#[derive(Clone, Copy, Debug)]
pub(super) struct SplitMix64(u64);

impl SplitMix64 {
    pub(super) fn new(seed: u64) -> Self {
        Self(seed)
    }

    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        mix(self.0)
    }

    /// Uniform in [−1, 1), in steps that f32 holds exactly.
    pub(super) fn symmetric(&mut self) -> f32 {
        (self.next() >> 40) as f32 / (1_u32 << 23) as f32 - 1.0
    }

    /// Uniform in 1..=`most`.
    pub(super) fn up_to(&mut self, most: u32) -> u32 {
        let high = self.next() >> 32;
        ((high * u64::from(most)) >> 32) as u32 + 1
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn first_numbers_of_the_reference_implementation() {
        let mut random = SplitMix64::new(1_234_567);
        let expected = [6_457_827_717_110_365_317, 3_203_168_211_198_807_973];
        assert_eq!([random.next(), random.next()], expected);
    }

    #[test]
    fn ranges() {
        let mut random = SplitMix64::new(7);
        let mut seen = [false; 10];
        for _ in 0..1_000 {
            let value = random.symmetric();
            assert!((-1.0..1.0).contains(&value));
            seen[random.up_to(10) as usize - 1] = true;
        }
        assert_eq!(seen, [true; 10]);
    }
}
