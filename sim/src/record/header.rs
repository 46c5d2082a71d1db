//! What a recording is of.

use super::wire::{Decoder, Encoder, Malformed};
use crate::scene::ParticleScene;

/// Bytes of the engine's version and of the scene's kind; usually 64.
const MOST_OF_A_NAME: usize = 64;

/// What describes a scene well enough to build it anew: every number that its building depends on.
pub trait SceneSpec: Sized {
    /// The name of this kind of scene, which no other has; at most 64 bytes.
    const KIND: &'static str;

    /// Writes it.
    fn encode(&self, to: &mut Encoder<'_>);

    /// Reads it, whatever the bytes are.
    ///
    /// # Errors
    /// The bytes are not those of a scene.
    fn decode(from: &mut Decoder<'_>) -> Result<Self, Malformed>;
}

/// What stands at the beginning of a recording.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Header {
    engine: String,
    kind: String,
    scene: Vec<u8>,
}

impl Header {
    /// Of a session in this scene, by this version of the engine.
    #[must_use]
    pub fn of<S: SceneSpec>(scene: &S) -> Self {
        const { assert!(S::KIND.len() <= MOST_OF_A_NAME, "a scene's kind is too long a name") };
        let mut bytes = Vec::new();
        scene.encode(&mut Encoder(&mut bytes));
        let engine = env!("CARGO_PKG_VERSION").to_owned();
        Self { engine, kind: S::KIND.to_owned(), scene: bytes }
    }

    /// The version of the engine that recorded it.
    #[must_use]
    pub fn engine(&self) -> &str {
        &self.engine
    }

    /// The kind of the scene, a [`SceneSpec::KIND`].
    #[must_use]
    pub fn kind(&self) -> &str {
        &self.kind
    }

    /// The scene.
    ///
    /// # Errors
    /// It is of another kind, or its bytes are not those of a scene.
    pub fn scene<S: SceneSpec>(&self) -> Result<S, Malformed> {
        if self.kind != S::KIND {
            return Err(Malformed::Kind { found: self.kind.clone(), wanted: S::KIND });
        }
        let mut decoder = Decoder(&self.scene);
        let scene = S::decode(&mut decoder)?;
        decoder.finish()?;
        Ok(scene)
    }

    pub(super) fn encode(&self, to: &mut Encoder<'_>) {
        to.text(&self.engine);
        to.text(&self.kind);
        to.bytes(&self.scene);
    }

    pub(super) fn decode(mut from: Decoder<'_>) -> Result<Self, Malformed> {
        let engine = from.text_within(MOST_OF_A_NAME, "the length of an engine's version")?;
        let kind = from.text_within(MOST_OF_A_NAME, "the length of a scene's kind")?;
        let scene = from.bytes()?.to_owned();
        from.finish()?;
        Ok(Self { engine: engine.to_owned(), kind: kind.to_owned(), scene })
    }
}

impl SceneSpec for ParticleScene {
    const KIND: &'static str = "particles";

    fn encode(&self, to: &mut Encoder<'_>) {
        let Self { objects, seed, gravity, damping, most_substeps } = *self;
        to.number(objects as u64);
        to.number(seed);
        to.flag(gravity);
        to.flag(damping);
        to.number(most_substeps.into());
    }

    fn decode(from: &mut Decoder<'_>) -> Result<Self, Malformed> {
        Ok(Self {
            objects: from.small("a number of particles")?,
            seed: from.number()?,
            gravity: from.flag("gravity")?,
            damping: from.flag("damping")?,
            most_substeps: from.small("a number of substeps")?,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Debug)]
    struct Other;

    impl SceneSpec for Other {
        const KIND: &'static str = "other";

        fn encode(&self, to: &mut Encoder<'_>) {
            to.byte(1);
        }

        fn decode(_: &mut Decoder<'_>) -> Result<Self, Malformed> {
            Ok(Self)
        }
    }

    #[test]
    fn a_scene_comes_back() {
        let scene = ParticleScene {
            objects: 77,
            seed: u64::MAX,
            gravity: true,
            damping: false,
            most_substeps: 3,
        };
        let header = Header::of(&scene);
        let mut bytes = Vec::new();
        header.encode(&mut Encoder(&mut bytes));
        let read = Header::decode(Decoder(&bytes)).expect("what was written");
        assert_eq!(read, header);
        assert_eq!(read.scene(), Ok(scene));
        for length in 0..bytes.len() {
            assert_eq!(Header::decode(Decoder(&bytes[..length])), Err(Malformed::Ended));
        }
    }

    #[test]
    fn names_are_short() {
        for (place, what) in ["the length of an engine's version", "the length of a scene's kind"]
            .into_iter()
            .enumerate()
        {
            for (length, expected) in
                [(64, Ok(())), (65, Err(Malformed::Value { what, value: 65 }))]
            {
                let mut bytes = Vec::new();
                let mut names = ["0.1.0".to_owned(), "other".to_owned()];
                names[place] = "x".repeat(length);
                names.iter().for_each(|name| Encoder(&mut bytes).text(name));
                Encoder(&mut bytes).bytes(&[]);
                assert_eq!(Header::decode(Decoder(&bytes)).map(drop), expected);
            }
        }
    }

    #[test]
    fn another_scene_is_none() {
        let error = Header::of(&Other).scene::<ParticleScene>().expect_err("it is another");
        let expected = "a scene of the kind \"other\" is not one of the kind \"particles\"";
        assert_eq!(error.to_string(), expected);
        let left = Header::of(&Other).scene::<Other>().expect_err("a byte is left");
        assert_eq!(left, Malformed::Left { left: 1 });
    }
}
