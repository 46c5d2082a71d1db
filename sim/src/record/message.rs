//! Messages as bytes.

use glam::{Quat, Vec3};

use super::wire::{Decoder, Encoder, Malformed};
use crate::behavior::Instrument;
use crate::device::DeviceSample;
use crate::message::{Custom, Message};

const IMPULSE: u8 = 0;
const STIFFNESS: u8 = 1;
const DAMPING: u8 = 2;
const PULL: u8 = 3;
const RELEASE: u8 = 4;
const WEIGHTLESS: u8 = 5;
const DEVICE: u8 = 6;
const TAKE_UP: u8 = 7;
const REMOVE: u8 = 8;

/// Writes a message, unless it is of the application's own making: nobody could read that.
pub(super) fn encode<'m>(message: &'m Message, to: &mut Encoder<'_>) -> Result<(), &'m dyn Custom> {
    match message {
        Message::Impulse { node, impulse } => {
            to.byte(IMPULSE);
            to.number((*node).into());
            to.floats(*impulse);
        }
        Message::Stiffness { between_nodes, to_center } => {
            to.byte(STIFFNESS);
            to.floats([*between_nodes, *to_center]);
        }
        Message::Damping(damping) => {
            to.byte(DAMPING);
            to.float(*damping);
        }
        Message::Pull { node, target, stiffness } => {
            to.byte(PULL);
            to.number((*node).into());
            to.floats(*target);
            to.float(*stiffness);
        }
        Message::Release => to.byte(RELEASE),
        Message::Weightless(is_weightless) => {
            to.byte(WEIGHTLESS);
            to.flag(*is_weightless);
        }
        Message::Device(DeviceSample { position, orientation, buttons }) => {
            to.byte(DEVICE);
            to.floats(position.to_array());
            to.floats(orientation.to_array());
            to.number((*buttons).into());
        }
        Message::TakeUp(instrument) => {
            to.byte(TAKE_UP);
            to.byte(*instrument as u8);
        }
        Message::Remove => to.byte(REMOVE),
        Message::Custom(custom) => return Err(&**custom),
    }
    Ok(())
}

/// Reads a message.
pub(super) fn decode(from: &mut Decoder<'_>) -> Result<Message, Malformed> {
    Ok(match from.byte()? {
        IMPULSE => Message::Impulse { node: from.small("a node")?, impulse: from.floats()? },
        STIFFNESS => {
            let [between_nodes, to_center] = from.floats()?;
            Message::Stiffness { between_nodes, to_center }
        }
        DAMPING => Message::Damping(from.float()?),
        PULL => Message::Pull {
            node: from.small("a node")?,
            target: from.floats()?,
            stiffness: from.float()?,
        },
        RELEASE => Message::Release,
        WEIGHTLESS => Message::Weightless(from.flag("weightlessness")?),
        DEVICE => Message::Device(DeviceSample {
            position: Vec3::from_array(from.floats()?),
            orientation: Quat::from_array(from.floats()?),
            buttons: from.small("buttons")?,
        }),
        TAKE_UP => Message::TakeUp(instrument(from.byte()?)?),
        REMOVE => Message::Remove,
        value => return Err(Malformed::Value { what: "a message's kind", value: value.into() }),
    })
}

fn instrument(number: u8) -> Result<Instrument, Malformed> {
    let known = Instrument::ALL.into_iter().find(|&instrument| instrument as u8 == number);
    known.ok_or(Malformed::Value { what: "an instrument", value: number.into() })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::object::Object;

    #[derive(Debug)]
    struct Own;

    impl Custom for Own {
        fn process(&self, _: &mut Object) {}
    }

    fn messages() -> Vec<Message> {
        let strange = f32::from_bits(0xffa0_0001);
        let sample = DeviceSample {
            position: Vec3::new(-0.0, strange, 1e-40),
            orientation: Quat::from_xyzw(0.1, f32::INFINITY, -2.0, 3.0),
            buttons: u32::MAX,
        };
        let mut messages = vec![
            Message::Impulse { node: u32::MAX, impulse: [1.0, -2.0, strange] },
            Message::Stiffness { between_nodes: 60.0, to_center: f32::NAN },
            Message::Damping(0.02),
            Message::Pull { node: 300, target: [1.0, 2.0, 3.0], stiffness: 150.0 },
            Message::Release,
            Message::Weightless(true),
            Message::Weightless(false),
            Message::Device(sample),
            Message::Remove,
        ];
        messages.extend(Instrument::ALL.map(Message::TakeUp));
        messages
    }

    #[test]
    fn every_message_comes_back_bit_by_bit() {
        for message in messages() {
            let mut bytes = Vec::new();
            assert!(encode(&message, &mut Encoder(&mut bytes)).is_ok());
            let mut decoder = Decoder(&bytes);
            let read = decode(&mut decoder).expect("what was written");
            assert!(decoder.is_empty(), "{message:?}");
            assert_eq!(format!("{read:?}"), format!("{message:?}"));
            let mut again = Vec::new();
            assert!(encode(&read, &mut Encoder(&mut again)).is_ok());
            assert_eq!(again, bytes, "{message:?}");
            for length in 0..bytes.len() {
                assert!(decode(&mut Decoder(&bytes[..length])).is_err(), "{message:?}, {length}");
            }
        }
    }

    #[test]
    fn what_is_no_message() {
        for bytes in [&[9][..], &[TAKE_UP, 7], &[WEIGHTLESS, 2]] {
            assert!(matches!(decode(&mut Decoder(bytes)), Err(Malformed::Value { .. })));
        }
        let own = Message::Custom(Box::new(Own));
        assert!(encode(&own, &mut Encoder(&mut Vec::new())).is_err());
    }
}
