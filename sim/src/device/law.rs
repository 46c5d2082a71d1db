//! The force law of the haptic loop: what a device exerts, tick by tick.

use glam::Vec3;
use thiserror::Error;

use super::entry::{SmoothEntry, limited_step};
use super::figures::Forces;
use super::model::{Bounded, LocalModel};
use super::passivity::Passivity;
use super::thread::RATE;
use super::watchdog::Watchdog;
use super::{DeviceDescription, DeviceSample, Wrench};

/// How forces come, change and go.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ForceSettings {
    /// The most by which the force changes from one tick to the next, in newtons. Usually 0.5: a wall of
    /// 2 kN/m, met at 0.25 m/s, comes up at just that at 1 kHz.
    pub max_step: f32,
    /// The most by which the torque changes from one tick to the next, in newton metres. Usually 0.02: as
    /// `max_step`, with the 4 cm from a tool's tip to the grip.
    pub max_torque_step: f32,
    /// How long a new model takes to come in, in seconds. Usually 1/60: a frame. One that follows while forces still
    /// come in after a stall takes as long as they do.
    pub entry: f64,
    /// How long after its predecessor a model may come before forces fade, in seconds. Usually 0.05:
    /// three frames of 1/60 s. Where models come more slowly it is three times the last interval, at most 0.25 s.
    pub timeout: f64,
    /// How long forces take to fade when no model comes, and to come in when one comes then, in seconds.
    /// Usually 0.1: about as fast as a hand reacts to a touch, so that it neither jerks nor sinks far.
    pub fade: f64,
    /// The most damping that the passivity controller adds, in newton seconds per metre; 0 switches it
    /// off. Usually 20: a fifth of m/T for a device of m = 0.1 kg at 1 kHz; damping by the speed of the tick
    /// before is itself unstable beyond m/T.
    pub max_damping: f64,
}

/// Settings that are none.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
#[error("{what} is {value}, which must be a number from 0 on")]
pub struct SettingsError {
    /// What is wrong.
    pub what: &'static str,
    /// What it is.
    pub value: f64,
}

impl ForceSettings {
    /// The usual settings for a loop at `rate` hertz: forces change as fast as at 1 kHz, and the damping is at most
    /// half of m/T for a device of m = 0.1 kg. A loop of less than 142 Hz has less of it than bone of
    /// 2 kN/m takes, K·T/2.
    #[must_use]
    pub fn at(rate: f64) -> Self {
        Self {
            max_step: (500.0 / rate) as f32,
            max_torque_step: (20.0 / rate) as f32,
            entry: 1.0 / 60.0,
            timeout: 0.05,
            fade: 0.1,
            max_damping: (0.05 * rate).min(20.0),
        }
    }

    /// The settings themselves if every one of them is a finite number from 0 on.
    ///
    /// # Errors
    /// [`SettingsError`] if one is not.
    pub fn checked(self) -> Result<Self, SettingsError> {
        let values = [
            ("the greatest step of the force", self.max_step.into()),
            ("the greatest step of the torque", self.max_torque_step.into()),
            ("the time in which a model comes in", self.entry),
            ("the time after which forces fade", self.timeout),
            ("the time in which forces fade", self.fade),
            ("the greatest damping", self.max_damping),
        ];
        let wrong = values.into_iter().find(|&(_, value)| !(value.is_finite() && value >= 0.0));
        wrong.map_or(Ok(self), |(what, value)| Err(SettingsError { what, value }))
    }
}

impl Default for ForceSettings {
    /// Those for a loop at 1 kHz.
    fn default() -> Self {
        Self::at(RATE)
    }
}

/// The force law: a state machine that is stepped by the time and the device's sample.
///
/// A tick evaluates the newest local model (Eq. 1), brings it in smoothly, lets it fade where models stay
/// away, takes back by damping what energy was generated, and bounds the force and its step. The same
/// inputs give the same bits.
///
/// Torques come in, fade and are bounded alike, but are not damped: Eq. 1 has no gradient for them, so
/// no stiff loop closes through them within a frame.
#[derive(Clone, Copy, Debug)]
pub struct ForceLaw {
    device: DeviceDescription,
    settings: ForceSettings,
    model: Bounded,
    /// The number of the model in use.
    number: u64,
    entry: SmoothEntry,
    watchdog: Watchdog,
    passivity: Passivity,
    /// The time and the place of the last sample. None before the first one and after a lost one.
    last: Option<(f64, Vec3)>,
    /// After a lost one.
    blind: Option<Blind>,
    /// What is being exerted.
    wrench: Wrench,
    forces: Forces,
}

/// Ticks without a sample.
#[derive(Clone, Copy, Debug)]
struct Blind {
    /// Where the tool was before them.
    place: Vec3,
    /// How many there were.
    ticks: u32,
    /// The sum of the forces that were held before each, in newtons.
    forces: Vec3,
}

impl ForceLaw {
    /// A law that exerts nothing until a model comes. The settings are used as they are:
    /// [`ForceSettings::checked`] says whether they are any.
    #[must_use]
    pub fn new(device: DeviceDescription, settings: ForceSettings) -> Self {
        Self {
            device,
            settings,
            model: Bounded::new(LocalModel::FREE, &device),
            number: 0,
            entry: SmoothEntry::default(),
            watchdog: Watchdog::new(settings.timeout, settings.fade),
            passivity: Passivity::new(settings.max_damping, device.resolution),
            last: None,
            blind: None,
            wrench: Wrench::default(),
            forces: Forces::default(),
        }
    }

    /// One tick: what to exert from `time` on, for the tool as `sample` has it. `model` is the newest
    /// local model, and `number` the how-manieth it is, from 1; 0 while there is none.
    ///
    /// Times must grow; a sample and a model must be finite.
    pub fn step(
        &mut self,
        time: f64,
        sample: &DeviceSample,
        (number, model): (u64, &LocalModel),
    ) -> Wrench {
        let position = sample.position;
        let (way, elapsed) =
            self.last.map_or((Vec3::ZERO, 0.0), |(then, place)| (position - place, time - then));
        self.passivity.observe(self.wrench.force, way);
        if let Some(Blind { place, ticks, forces }) = self.blind.take() {
            let mean = (forces + self.wrench.force) / (ticks as f32 + 1.0);
            self.passivity.observe(mean, position - place);
        }
        let is_new = number != self.number;
        if is_new || self.last.is_none() {
            self.enter(time, position, model, is_new);
            self.number = number;
        }
        let wanted = self.wanted(time, position);
        let share = self.watchdog.share(time);
        let stored = self.model.energy_at(position) * f64::from(share);
        let resistance = self.passivity.resistance(stored, way, elapsed);
        let lags = self.exert(Wrench { force: wanted.force + resistance, ..wanted });
        let shown = Wrench { force: self.wrench.force - resistance, ..self.wrench };
        // Where the damping alone could not come at once, the model has nothing to catch up on.
        let is_less = shown.force.length_squared() < wanted.force.length_squared();
        if lags && is_less && share == 1.0 {
            self.entry = self.entry.again(shown, self.modelled(position), time);
        }
        self.last = Some((time, position));
        self.forces.energy(time, &self.passivity);
        // One that has faded out is not felt any more.
        if self.number > 0 && share > 0.0 {
            self.forces.aged(time - self.model.model().time);
        }
        self.wrench
    }

    /// A tick without a sample: the force goes towards zero, and what comes after begins anew.
    pub fn step_blind(&mut self) -> Wrench {
        if let Some((_, place)) = self.last.take() {
            self.blind = Some(Blind { place, ticks: 0, forces: Vec3::ZERO });
        }
        if let Some(blind) = &mut self.blind {
            blind.ticks = blind.ticks.saturating_add(1);
            blind.forces += self.wrench.force;
        }
        self.exert(Wrench::default());
        self.wrench
    }

    /// What was measured.
    #[must_use]
    pub fn forces(&self) -> &Forces {
        &self.forces
    }

    /// A model comes in: a new one, or the one in use after ticks without a sample.
    fn enter(&mut self, time: f64, position: Vec3, model: &LocalModel, is_new: bool) {
        let begins = self.last.is_none() || self.watchdog.share(time) < 1.0;
        let shown = if begins { self.wrench } else { self.wanted(time, position) };
        let ForceSettings { fade, entry, .. } = self.settings;
        // What still comes in after a stall is not to come faster for a model that follows.
        let over = if begins { fade } else { entry.max(self.entry.left(time)) };
        let new = Bounded::new(*model, &self.device);
        if is_new {
            self.watchdog.feed(time);
            self.forces.models += 1;
        }
        if !begins {
            let at = new.model().position;
            self.forces.interpolated(new.force_at(at).distance(self.model.force_at(at)));
        }
        self.model = new;
        self.entry = SmoothEntry::new(shown, self.modelled(position), time, over);
    }

    /// What the model says.
    fn modelled(&self, position: Vec3) -> Wrench {
        Wrench { force: self.model.force_at(position), torque: self.model.model().torque }
    }

    /// What the model says, as far as it has come in and has not faded.
    fn wanted(&self, time: f64, position: Vec3) -> Wrench {
        let share = self.watchdog.share(time);
        let Wrench { force, torque } = self.entry.apply(self.modelled(position), time);
        Wrench { force: force * share, torque: torque * share }
    }

    /// Exerts what is wanted, within the bounds of the device and of a step. Whether a step was too
    /// large for a force that rises.
    ///
    /// Such a force must not catch up while the tool is on its way out, or it would give back more than it
    /// took: who calls lets the model come in anew from what is exerted.
    fn exert(&mut self, wanted: Wrench) -> bool {
        // A device that was once told what is no number would never be told anything else.
        let is_sound = wanted.force.is_finite() && wanted.torque.is_finite();
        let wanted = if is_sound { wanted } else { Wrench::default() };
        let most = wanted.force.clamp_length_max(self.device.max_force);
        let force = limited_step(self.wrench.force, most, self.settings.max_step);
        let torque = wanted.torque.clamp_length_max(self.device.max_torque);
        let torque = limited_step(self.wrench.torque, torque, self.settings.max_torque_step);
        self.forces.stepped(force.distance(self.wrench.force));
        self.wrench = Wrench { force, torque };
        most.length_squared() > force.length_squared()
    }
}

#[cfg(test)]
#[path = "law_tests.rs"]
mod tests;
