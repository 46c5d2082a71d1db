use glam::Mat3;

use super::*;
use crate::device::operator::SimulatedDevice;

const PERIOD: f64 = 1e-3;
const WALL: LocalModel = LocalModel {
    gradient: Mat3::from_cols(Vec3::ZERO, Vec3::new(0.0, -1_000.0, 0.0), Vec3::ZERO),
    normal: Some(Vec3::Y),
    ..LocalModel::FREE
};

fn law() -> ForceLaw {
    ForceLaw::new(SimulatedDevice::DESCRIPTION, ForceSettings::default())
}

/// The forces of ticks `from` to `to` of a tool that rests 2 mm inside, with a new model each tick.
fn rest(law: &mut ForceLaw, from: u64, to: u64) -> Vec<f32> {
    let inside = DeviceSample::at(Vec3::Y * -2e-3);
    let step = |tick: u64| law.step(tick as f64 * PERIOD, &inside, (tick, &WALL)).force.y;
    (from..to).map(step).collect()
}

/// Whether no step from one force to the next is greater than the settings allow.
fn smooth(forces: &[f32]) -> bool {
    let most = ForceSettings::default().max_step * 1.000_001;
    forces.windows(2).all(|pair| (pair[1] - pair[0]).abs() <= most)
}

#[test]
fn comes_in_and_holds() {
    let mut law = law();
    let forces = rest(&mut law, 1, 400);
    assert_eq!(forces[0], 0.0, "the first tick knows no motion, and does not push");
    assert!((forces[398] - 2.0).abs() < 1e-3, "{}", forces[398]);
    assert!(smooth(&forces), "{forces:?}");
}

#[test]
fn blind_ticks_let_go_and_what_follows_comes_in_again() {
    let mut law = law();
    rest(&mut law, 1, 400);
    let blind: Vec<f32> = (0..10).map(|_| law.step_blind().force.y).collect();
    assert!(smooth(&blind) && blind[9] == 0.0, "{blind:?}");
    let back = rest(&mut law, 420, 820);
    assert!(back[0] < 0.1 && smooth(&back), "{back:?}");
    assert!((back[399] - 2.0).abs() < 1e-3, "{}", back[399]);
}

/// A tool that is pushed out unseen has taken work with it: the mean force times the way.
#[test]
fn blind_ticks_are_no_gift() {
    let mut law = law();
    rest(&mut law, 1, 400);
    let before = law.forces().absorbed;
    let blind: f32 = 2.0 + (0..4).map(|_| law.step_blind().force.y).sum::<f32>();
    let out = DeviceSample::at(Vec3::Y * 3e-3);
    law.step(0.5, &out, (400, &WALL));
    let given = before - law.forces().absorbed;
    let expected = f64::from(blind) / 5.0 * 5e-3;
    assert!((given - expected).abs() < 1e-6 && given > 4e-3, "{given} J, not {expected} J");
}

/// A tool that took more with it than it brought is braked at once, and never pushed on, in free space too.
#[test]
fn damping_does_not_come_in_like_a_model() {
    let mut law = law();
    rest(&mut law, 1, 400);
    (0..4).for_each(|_| _ = law.step_blind());
    let step = |law: &mut ForceLaw, tick: u32| {
        let out = DeviceSample::at(Vec3::Y * (3e-3 + 2e-4 * tick as f32));
        law.step(0.5 + f64::from(tick) * PERIOD, &out, (400, &WALL)).force.y
    };
    let forces: Vec<f32> = (0..100).map(|tick| step(&mut law, tick)).collect();
    let most = forces.iter().copied().fold(0.0, f32::min);
    assert!(most < -1.0 && smooth(&forces), "{forces:?}");
    let falls = forces.iter().position(|&force| force == most).unwrap_or(0);
    assert!(
        falls <= 4 + (most.abs() / 0.5).ceil() as usize,
        "it comes as fast as steps allow: {forces:?}"
    );
    assert!(
        forces[1..].iter().skip_while(|&&force| force > 0.0).all(|&force| force <= 1e-6),
        "{forces:?}"
    );
}

/// A tool that breaks in fast and goes out slowly: the force that could not rise in time must not
/// rise on the way out.
#[test]
fn a_force_that_lags_does_not_catch_up() {
    let mut law = law();
    let place = |tick: u64| if tick < 10 { -1e-3 * tick as f32 } else { -9e-3 };
    let mut forces = Vec::new();
    for tick in 0..12 {
        let sample = DeviceSample::at(Vec3::Y * place(tick));
        forces.push(law.step(1.0 + tick as f64 * PERIOD, &sample, (1 + tick, &WALL)).force.y);
    }
    assert!(forces[9] < 9.0 * 0.51 && smooth(&forces), "{forces:?}");
    assert!(forces[11] - forces[9] < 0.8, "{forces:?}");
}

/// A pipeline, or a loop, that is slow shows a hand at rest a force at rest; when it stalls, the force fades.
#[test]
fn a_slow_pipeline_is_no_stall() {
    let inside = DeviceSample::at(Vec3::Y * -2e-3);
    for (rate, models) in [(1e3, 15.0), (1e3, 10.0), (1e3, 5.0), (15.0, 15.0), (5.0, 5.0)] {
        let mut law = law();
        let mut forces = |from: f64, to: f64, last: f64| -> Vec<f32> {
            let ticks = (from * rate) as u64..(to * rate) as u64;
            let times = ticks.map(|tick| tick as f64 / rate);
            let number = |time: f64| 1 + (time.min(last) * models + 1e-6) as u64;
            times.map(|time| law.step(time, &inside, (number(time), &WALL)).force.y).collect()
        };
        let case = format!("{models} models a second in {rate} ticks");
        let came = forces(0.0, 2.0, 2.0);
        assert!(smooth(&came), "{case}: {came:?}");
        let rests = forces(2.0, 4.0, 4.0);
        assert!(rests.iter().all(|force| (force - 2.0).abs() < 1e-3), "{case}: {rests:?}");
        let stalled = forces(4.0, 6.0, 4.0);
        let stuck = stalled.iter().skip((0.4 * rate) as usize + 5).find(|&&force| force > 0.0);
        assert!(smooth(&stalled) && stuck.is_none(), "{case}: {stalled:?}");
    }
}

/// What passes for a model and is nonsense is felt as some force within bounds, and what comes after it as
/// ever.
#[test]
fn no_model_makes_it_exert_what_is_no_number() {
    let great = Vec3::splat(f32::MAX);
    let skew = Mat3::from_cols(Vec3::Y * -2e38, Vec3::X * -2e38, Vec3::ZERO);
    let nonsense = [
        LocalModel { gradient: skew, ..LocalModel::FREE },
        LocalModel { force: great, pull: great, torque: great, ..WALL },
        LocalModel { position: great, ..WALL },
    ];
    for model in nonsense {
        let mut law = law();
        let inside = DeviceSample::at(Vec3::Y * -2e-3);
        for tick in 1..50 {
            let wrench = law.step(tick as f64 * PERIOD, &inside, (tick, &model));
            assert!(wrench.force.is_finite() && wrench.torque.is_finite(), "{model:?}");
        }
        let forces = rest(&mut law, 50, 400);
        assert!((forces[349] - 2.0).abs() < 1e-3 && smooth(&forces), "{model:?}: {forces:?}");
    }
}

#[test]
fn torque_comes_in_and_is_bounded() {
    let device = DeviceDescription { max_torque: 0.1, ..SimulatedDevice::DESCRIPTION };
    let mut law = ForceLaw::new(device, ForceSettings::default());
    let model = LocalModel { torque: Vec3::X, ..LocalModel::FREE };
    let sample = DeviceSample::at(Vec3::ZERO);
    let step = |tick: u64| law.step(tick as f64 * PERIOD, &sample, (tick, &model)).torque.x;
    let torques: Vec<f32> = (1..200).map(step).collect();
    assert!(torques.windows(2).all(|pair| (pair[1] - pair[0]).abs() < 0.020_01), "{torques:?}");
    assert!((torques[198] - 0.1).abs() < 1e-6, "{}", torques[198]);
}

#[test]
fn an_error_is_of_what_replaces_another_model() {
    let mut law = law();
    let pressed = LocalModel { force: Vec3::Y * 2.0, position: Vec3::Y * -2e-3, ..WALL };
    let inside = DeviceSample::at(pressed.position);
    for tick in 0..5 {
        law.step(tick as f64 * PERIOD, &inside, (1 + tick / 2, &pressed));
    }
    let Forces { models, greatest_error, .. } = *law.forces();
    assert_eq!((models, greatest_error), (3, 0.0), "the first one replaces nothing");
    let softer = LocalModel { force: Vec3::Y, ..pressed };
    law.step(5.0 * PERIOD, &inside, (4, &softer));
    let Forces { models, interpolation_error, .. } = *law.forces();
    assert_eq!((models, interpolation_error), (4, 1.0));
}

/// With a model every 17 ms a force takes its time to come in, after silence, a stall, and a lost sample.
#[test]
fn models_that_follow_do_not_hurry_what_comes_in() {
    let (mut law, mut number) = (law(), 0);
    let inside = DeviceSample::at(Vec3::Y * -2e-3);
    let mut step = |law: &mut ForceLaw, tick: u64, comes: bool| {
        number += u64::from(comes);
        law.step(tick as f64 * PERIOD, &inside, (number, &WALL)).force.y
    };
    for (begin, what) in [(0, "silence"), (1_000, "a stall"), (2_000, "a lost sample")] {
        let ticks = begin..begin + 400;
        let forces: Vec<f32> =
            ticks.map(|tick| step(&mut law, tick, (tick - begin).is_multiple_of(17))).collect();
        assert!((forces[50] - 1.0).abs() < 0.1, "after {what}: {forces:?}");
        assert!((forces[120] - 2.0).abs() < 1e-3 && smooth(&forces), "after {what}: {forces:?}");
        match begin {
            0 => (400..1_000).for_each(|tick| _ = step(&mut law, tick, false)),
            _ => (0..10).for_each(|_| _ = law.step_blind()),
        }
    }
}

/// A tool that breaks in while forces fade meets what is left of them, as fast as steps allow.
#[test]
fn a_force_that_fades_does_not_come_in_anew() {
    let mut law = law();
    rest(&mut law, 1, 400);
    let step = |law: &mut ForceLaw, tick: u64, depth: f32| {
        let sample = DeviceSample::at(Vec3::Y * -depth);
        law.step(tick as f64 * PERIOD, &sample, (399, &WALL)).force.y
    };
    (400..500).for_each(|tick| _ = step(&mut law, tick, 2e-3));
    let forces: Vec<f32> = (500..510).map(|tick| step(&mut law, tick, 6e-3)).collect();
    let share = law.watchdog.share(509.0 * PERIOD);
    assert!((0.3..0.7).contains(&share) && smooth(&forces), "{forces:?}");
    assert!((forces[9] - 6.0 * share).abs() < 1e-3, "{forces:?}, of which {share} are left");
}

/// However long a device could not be read: as many ticks as can be counted.
#[test]
fn a_device_that_is_back_after_weeks_is_felt() {
    let mut law = law();
    rest(&mut law, 1, 400);
    (0..10).for_each(|_| _ = law.step_blind());
    law.blind.as_mut().expect("it was not read").ticks = u32::MAX;
    let back = rest(&mut law, 420, 820);
    assert!((back[399] - 2.0).abs() < 1e-3, "{}", back[399]);
}
