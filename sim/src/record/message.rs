//! Messages as bytes.

use std::any::Any;

use glam::Quat;

use super::wire::{Decoder, Encoder, Malformed};
use crate::behavior::tissue::{Cut, Scrape};
use crate::behavior::{Grasp, Hold, Instrument, LetGo};
use crate::device::DeviceSample;
use crate::geometry::Blade;
use crate::message::{Custom, Message};
use crate::object::ObjectId;

const IMPULSE: u8 = 0;
const STIFFNESS: u8 = 1;
const DAMPING: u8 = 2;
const PULL: u8 = 3;
const RELEASE: u8 = 4;
const WEIGHTLESS: u8 = 5;
const DEVICE: u8 = 6;
const TAKE_UP: u8 = 7;
const REMOVE: u8 = 8;
const GRASP: u8 = 9;
const HOLD: u8 = 10;
const LET_GO: u8 = 11;
const CUT: u8 = 12;
const SCRAPE: u8 = 13;

/// Writes a message, unless it is a custom one that is none of a host's for tissue and pieces: nobody could read that.
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
        Message::Custom(custom) => return encode_custom(&**custom, to),
    }
    Ok(())
}

fn encode_custom<'m>(
    custom: &'m (dyn Custom + 'static),
    to: &mut Encoder<'_>,
) -> Result<(), &'m dyn Custom> {
    let message: &dyn Any = custom;
    if let Some(Grasp { by, point, radius, stiffness, strength }) = message.downcast_ref() {
        to.byte(GRASP);
        to.number(by.0.into());
        to.floats(point.to_array());
        to.floats([*radius, *stiffness, *strength]);
    } else if let Some(Hold { by, position }) = message.downcast_ref() {
        to.byte(HOLD);
        to.number(by.0.into());
        to.floats(position.to_array());
    } else if let Some(LetGo { by }) = message.downcast_ref() {
        to.byte(LET_GO);
        to.number(by.0.into());
    } else if let Some(Cut { by, before, now }) = message.downcast_ref() {
        to.byte(CUT);
        to.number(by.0.into());
        for end in [before.tip, before.heel, now.tip, now.heel] {
            to.floats(end.to_array());
        }
    } else if let Some(Scrape { center, radius }) = message.downcast_ref() {
        to.byte(SCRAPE);
        to.floats(center.to_array());
        to.float(*radius);
    } else {
        return Err(custom);
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
            position: from.vector()?,
            orientation: Quat::from_array(from.floats()?),
            buttons: from.small("buttons")?,
        }),
        TAKE_UP => Message::TakeUp(instrument(from.byte()?)?),
        REMOVE => Message::Remove,
        GRASP => {
            let (by, point) = (tool(from)?, from.vector()?);
            let [radius, stiffness, strength] = from.floats()?;
            custom(Grasp { by, point, radius, stiffness, strength })
        }
        HOLD => custom(Hold { by: tool(from)?, position: from.vector()? }),
        LET_GO => custom(LetGo { by: tool(from)? }),
        CUT => custom(Cut { by: tool(from)?, before: blade(from)?, now: blade(from)? }),
        SCRAPE => custom(Scrape { center: from.vector()?, radius: from.float()? }),
        value => return Err(Malformed::Value { what: "a message's kind", value: value.into() }),
    })
}

fn instrument(number: u8) -> Result<Instrument, Malformed> {
    let known = Instrument::ALL.into_iter().find(|&instrument| instrument as u8 == number);
    known.ok_or(Malformed::Value { what: "an instrument", value: number.into() })
}

fn custom(message: impl Custom) -> Message {
    Message::Custom(Box::new(message))
}

fn tool(from: &mut Decoder<'_>) -> Result<ObjectId, Malformed> {
    from.small("a tool").map(ObjectId)
}

fn blade(from: &mut Decoder<'_>) -> Result<Blade, Malformed> {
    Ok(Blade { tip: from.vector()?, heel: from.vector()? })
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

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
        let by = ObjectId(300);
        let (point, other) = (Vec3::new(1.0, -0.0, strange), Vec3::new(f32::MAX, 1e-40, -3.0));
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
            custom(Grasp { by, point, radius: 0.005, stiffness: f32::INFINITY, strength: strange }),
            custom(Hold { by: ObjectId::HOST, position: point }),
            custom(LetGo { by }),
            custom(Cut {
                by,
                before: Blade { tip: point, heel: other },
                now: Blade { tip: other, heel: -point },
            }),
            custom(Scrape { center: other, radius: strange }),
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
        // No object has the number 2³².
        let no_tool = [LET_GO, 0x80, 0x80, 0x80, 0x80, 0x10];
        for bytes in [&[14][..], &[TAKE_UP, 7], &[WEIGHTLESS, 2], &no_tool] {
            assert!(matches!(decode(&mut Decoder(bytes)), Err(Malformed::Value { .. })));
        }
        let mut bytes = Vec::new();
        assert!(encode(&custom(Own), &mut Encoder(&mut bytes)).is_err());
        assert!(bytes.is_empty(), "nothing is left of it");
    }
}
