//! What Hounsfield numbers mean.
//!
//! On Hounsfield's scale water is 0 HU and air −1,000 HU; a voxel that holds two materials has a number
//! between theirs.

use thiserror::Error;

/// The Hounsfield number of air, in HU.
pub const AIR: i16 = -1_000;

/// Why thresholds cannot be used.
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq)]
#[error("thresholds of {given:?} HU: air, soft tissue, trabecular and cortical bone must ascend")]
pub struct ThresholdError {
    /// The thresholds of air, soft tissue, trabecular and cortical bone, in HU.
    pub given: [i16; 4],
}

/// Where materials end and begin, in Hounsfield units.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Thresholds {
    air: i16,
    soft_tissue: i16,
    trabecular: i16,
    cortical: i16,
}

impl Default for Thresholds {
    /// What is usual for an adult's head without contrast medium. Fat is near −100 HU and the skin's
    /// surface, blurred, is sought between it and air; brain, muscle and fresh blood end at about 80 HU;
    /// 226 HU is the common threshold of bone and 662 HU that of compact bone (the presets of InVesalius).
    fn default() -> Self {
        Self { air: -300, soft_tissue: 100, trabecular: 226, cortical: 662 }
    }
}

impl Thresholds {
    /// Thresholds in HU: below `air` there is no tissue, up to `soft_tissue` there is no bone, from
    /// `trabecular` on there is bone, and from `cortical` on it is as hard as it gets.
    ///
    /// # Errors
    /// They do not ascend.
    pub fn new(
        air: i16,
        soft_tissue: i16,
        trabecular: i16,
        cortical: i16,
    ) -> Result<Self, ThresholdError> {
        let given = [air, soft_tissue, trabecular, cortical];
        if !given.is_sorted_by(|below, above| below < above) {
            return Err(ThresholdError { given });
        }
        Ok(Self { air, soft_tissue, trabecular, cortical })
    }

    /// Below it there is no tissue, in HU; the surface of the skin lies there. Usually −300.
    #[must_use]
    pub fn air(&self) -> i16 {
        self.air
    }

    /// Up to it there is no bone, in HU. Usually 100.
    #[must_use]
    pub fn soft_tissue(&self) -> i16 {
        self.soft_tissue
    }

    /// From it on there is bone, in HU; the surface of bone lies there. Usually 226.
    #[must_use]
    pub fn trabecular(&self) -> i16 {
        self.trabecular
    }

    /// From it on bone is compact, in HU. Usually 662.
    #[must_use]
    pub fn cortical(&self) -> i16 {
        self.cortical
    }

    /// How much of a voxel of `hounsfield` HU is bone, of 255: none up to the threshold of soft tissue,
    /// one half at that of trabecular bone, where a volume has its surface, and all from that of cortical
    /// bone on; linear between them.
    #[must_use]
    pub fn density(&self, hounsfield: i16) -> u8 {
        const HALF: f32 = 127.5;
        let share = |low: i16, high: i16| {
            let part = f32::from(hounsfield) - f32::from(low);
            (part / (f32::from(high) - f32::from(low))).clamp(0.0, 1.0)
        };
        let below = share(self.soft_tissue, self.trabecular);
        let above = share(self.trabecular, self.cortical);
        (HALF * (below + above)).round() as u8
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn densities() {
        let thresholds = Thresholds::default();
        let cases = [
            (i16::MIN, 0),
            (AIR, 0),
            (0, 0),
            (100, 0),
            (163, 64),
            (226, 128),
            (444, 191),
            (662, 255),
            (3_071, 255),
            (i16::MAX, 255),
        ];
        for (hounsfield, density) in cases {
            assert_eq!(thresholds.density(hounsfield), density, "{hounsfield} HU");
        }
        let all: Vec<u8> = (i16::MIN..=i16::MAX).map(|number| thresholds.density(number)).collect();
        assert!(all.is_sorted());
    }

    #[test]
    fn thresholds_ascend() {
        let error = Thresholds::new(-300, 226, 226, 662).expect_err("two are the same");
        assert_eq!(
            error.to_string(),
            "thresholds of [-300, 226, 226, 662] HU: air, soft tissue, trabecular and cortical bone \
             must ascend"
        );
        Thresholds::new(i16::MIN, -1, 0, i16::MAX).expect("they ascend");
    }
}
