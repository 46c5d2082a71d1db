//! An operator who does what a script says through two simulated haptic devices, in simulated time.

use dualframe_sim::device::DeviceDescription;
use dualframe_sim::device::law::ForceSettings;
use dualframe_sim::device::link::HapticLink;
use dualframe_sim::device::operator::{Hand, SimulatedDevice};
use dualframe_sim::device::thread::{HapticLoop, LoopError};
use dualframe_sim::scene::craniotomy::TIME_STEP;

use super::craniotomy::Surgery;
use super::haptics::Each;

/// Hands that hold their devices firmly, and look. Their loops tick between the frames, so that the same
/// script comes to the same bits however long a frame takes.
pub(super) struct Operator<'c> {
    loops: Vec<HapticLoop<'c, SimulatedDevice>>,
    /// Ticks a second.
    rate: f64,
    ticks: u64,
}

impl<'c> Operator<'c> {
    /// Gives the hands of an operation devices, as far as its script moves them, whose loops tick at `rate`
    /// hertz.
    pub(super) fn new(
        links: &'c mut Each<HapticLink>,
        surgery: &mut Surgery<'c>,
        rate: f64,
    ) -> Result<Self, LoopError> {
        let DeviceDescription { name: device, rates: [least, most], .. } =
            SimulatedDevice::DESCRIPTION;
        if !(least..=most).contains(&rate) {
            return Err(LoopError::Rate { rate, device, least, most });
        }
        let mut loops = Vec::new();
        for (hand, link) in links.iter_mut().enumerate() {
            let Some(motion) = surgery.motion(hand) else { continue };
            let (end, simulation) = link.split();
            let device = SimulatedDevice::new(Hand::GUIDED, motion);
            loops.push(HapticLoop::new(device, end, ForceSettings::at(rate)));
            surgery.link(hand, simulation);
        }
        Ok(Self { loops, rate, ticks: 0 })
    }

    /// The time of frame number `frame` has passed.
    pub(super) fn follow(&mut self, frame: u64) {
        let now = (frame + 1) as f64 * f64::from(TIME_STEP);
        while (self.ticks + 1) as f64 / self.rate <= now {
            self.ticks += 1;
            let time = self.ticks as f64 / self.rate;
            for ticking in &mut self.loops {
                ticking.tick(time);
            }
        }
    }
}
