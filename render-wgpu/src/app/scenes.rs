//! The scenes that the program knows, and that a recording can be of.

use std::hash::Hasher;
use std::path::{self, Path};
use std::sync::Arc;

use dualframe_sim::blocking::Grain;
use dualframe_sim::image::{FileError, Image, Thresholds};
use dualframe_sim::record::wire::{Decoder, Encoder, Malformed};
use dualframe_sim::record::{Header, SceneSpec};
use dualframe_sim::scene::craniotomy::{self, BuildError, Operation};
use dualframe_sim::scene::head::{Head, HeadError};
use dualframe_sim::scene::{ParticleScene, Scene, SceneError};
use dualframe_sim::simd::Simd;
use thiserror::Error;

/// A scene of any kind.
pub(super) enum AnyScene {
    Particles(ParticleScene),
    Craniotomy(Patient),
}

/// Why a recording's scene cannot be built.
#[derive(Debug, Error)]
pub(super) enum AnySceneError {
    #[error("its scene is of a kind that this program does not know: {kind:?}")]
    Kind { kind: String },
    #[error("its scene is malformed")]
    Malformed(#[from] Malformed),
    #[error("its scene cannot be built")]
    Build(#[from] SceneError),
    #[error("its patient's head cannot be built")]
    Operation(#[from] BuildError),
    #[error(transparent)]
    Patient(#[from] PatientError),
    #[error("objects are added, which no {kind} scene does")]
    Addition { kind: &'static str },
    #[error("bone comes free, but there is none that is free")]
    NothingFree,
}

impl AnyScene {
    /// What a recording is of.
    pub(super) fn of(header: &Header) -> Result<Self, AnySceneError> {
        match header.kind() {
            ParticleScene::KIND => Ok(Self::Particles(header.scene()?)),
            PatientSpec::KIND => Ok(Self::Craniotomy(Patient::of(&header.scene()?)?)),
            kind => Err(AnySceneError::Kind { kind: kind.to_owned() }),
        }
    }

    pub(super) fn kind(&self) -> &'static str {
        match self {
            Self::Particles(_) => ParticleScene::KIND,
            Self::Craniotomy(_) => PatientSpec::KIND,
        }
    }

    /// The file that it is built from, besides the recording.
    pub(super) fn input(&self) -> Option<&Path> {
        match self {
            Self::Particles(_) => None,
            Self::Craniotomy(patient) => patient.spec.ct.as_ref().map(|(file, _)| Path::new(file)),
        }
    }

    /// The broad phase that fits it.
    pub(super) fn grain(&self) -> Grain {
        match self {
            Self::Particles(_) => Grain::Spatial,
            Self::Craniotomy(_) => Grain::Pairwise,
        }
    }

    /// The environment at its start.
    pub(super) fn build(&self, simd: Simd) -> Result<Scene, AnySceneError> {
        match self {
            Self::Particles(particles) => {
                let mut scene = particles.build()?;
                scene.stages.simd = simd;
                Ok(scene)
            }
            Self::Craniotomy(patient) => Ok(patient.build(simd)?),
        }
    }

    /// Adds objects as the bytes say that were recorded when they were added.
    pub(super) fn add(&self, scene: &mut Scene, _spec: &[u8]) -> Result<(), AnySceneError> {
        match self {
            Self::Particles(_) => Err(AnySceneError::Addition { kind: self.kind() }),
            Self::Craniotomy(patient) => {
                // Which bone is free follows from the skull.
                match Operation::new(Arc::clone(&patient.head), None).free(scene) {
                    0 => Err(AnySceneError::NothingFree),
                    _ => Ok(()),
                }
            }
        }
    }
}

/// Bytes of a file's name in a recording; usually 4,096, the most that Linux takes.
const MOST_OF_A_PATH: usize = 4_096;

/// Who is operated on.
pub(super) struct Patient {
    pub(super) head: Arc<Head>,
    spec: PatientSpec,
}

/// What says who is operated on.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct PatientSpec {
    /// The file of the computed tomography and the hash of what is in it; none for the synthetic head.
    ct: Option<(String, u64)>,
}

/// Why there is no patient.
#[derive(Debug, Error)]
pub(super) enum PatientError {
    // It says all that it comes from.
    #[error("{0}")]
    File(FileError),
    #[error("no head can be made of {file}")]
    Head {
        file: String,
        #[source]
        source: HeadError,
    },
    #[error(
        "{file} cannot be recorded: its whole path must be UTF-8 of at most {MOST_OF_A_PATH} bytes"
    )]
    Name { file: String },
    #[error("{file} is not the image that the session was recorded with")]
    Other { file: String },
}

impl Patient {
    /// The one whose computed tomography this is; without one, the synthetic one. If it `is_recorded`, a
    /// recording can say where the file is.
    pub(super) fn new(ct: Option<&Path>, is_recorded: bool) -> Result<Self, PatientError> {
        let named = |file: &str, made: Result<Head, HeadError>| match made {
            Ok(head) => Ok(Arc::new(head)),
            Err(source) => Err(PatientError::Head { file: file.to_owned(), source }),
        };
        let Some(path) = ct else {
            let head = named("nothing", Head::synthetic())?;
            return Ok(Self { head, spec: PatientSpec { ct: None } });
        };
        let file = path.to_string_lossy().into_owned();
        let place = match place(path) {
            Err(_) if !is_recorded => file.clone(),
            place => place?,
        };
        let image = Image::open(path).map_err(PatientError::File)?;
        let digest = digest(&image);
        let head = named(&file, Head::from_ct(image, &Thresholds::default()))?;
        Ok(Self { head, spec: PatientSpec { ct: Some((place, digest)) } })
    }

    /// The one that a session was recorded with.
    fn of(spec: &PatientSpec) -> Result<Self, PatientError> {
        let Some((file, digest)) = &spec.ct else { return Self::new(None, false) };
        let patient = Self::new(Some(Path::new(file)), false)?;
        let same = patient.spec.ct.as_ref().is_some_and(|(_, found)| found == digest);
        if same { Ok(patient) } else { Err(PatientError::Other { file: file.clone() }) }
    }

    /// The environment before the operation.
    pub(super) fn build(&self, simd: Simd) -> Result<Scene, BuildError> {
        let mut scene = craniotomy::build(&self.head)?;
        scene.stages.simd = simd;
        Ok(scene)
    }

    pub(super) fn spec(&self) -> &PatientSpec {
        &self.spec
    }
}

/// Where a file is, as a recording says it, which may be replayed from another folder.
fn place(path: &Path) -> Result<String, PatientError> {
    let absolute = path::absolute(path).ok();
    let place = absolute.and_then(|absolute| absolute.into_os_string().into_string().ok());
    let place = place.filter(|place| place.len() <= MOST_OF_A_PATH);
    place.ok_or_else(|| PatientError::Name { file: path.to_string_lossy().into_owned() })
}

/// A hash (FNV-1a, 64 bits) of an image's sides, of where it lies and of its voxels.
fn digest(image: &Image) -> u64 {
    let mut hasher = fnv::FnvHasher::default();
    image.grid().dims().iter().for_each(|side| hasher.write(&side.to_le_bytes()));
    let affine = image.grid().affine().to_cols_array();
    affine.iter().for_each(|number| hasher.write(&number.to_le_bytes()));
    image.voxels().iter().for_each(|voxel| hasher.write(&voxel.to_le_bytes()));
    hasher.finish()
}

impl SceneSpec for PatientSpec {
    const KIND: &'static str = "craniotomy";

    fn encode(&self, to: &mut Encoder<'_>) {
        to.flag(self.ct.is_some());
        if let Some((file, digest)) = &self.ct {
            to.text(file);
            to.wide(*digest);
        }
    }

    fn decode(from: &mut Decoder<'_>) -> Result<Self, Malformed> {
        if !from.flag("a computed tomography")? {
            return Ok(Self { ct: None });
        }
        let file = from.text_within(MOST_OF_A_PATH, "the length of a file's name")?;
        Ok(Self { ct: Some((file.to_owned(), from.wide()?)) })
    }
}

#[cfg(test)]
mod tests {
    use dualframe_sim::image::Grid;
    use glam::{DAffine3, DVec3};

    use super::*;

    #[test]
    fn an_image_is_told_by_what_is_in_it_and_where_it_lies() {
        let of = |spacing: f64, voxel| {
            let grid = Grid::new([2; 3], DAffine3::from_scale(DVec3::splat(spacing)));
            let image = Image::new(grid.expect("a valid grid"), vec![voxel; 8]);
            digest(&image.expect("as many voxels"))
        };
        assert_eq!(of(1e-3, 7), of(1e-3, 7));
        assert_ne!(of(1e-3, 7), of(2e-3, 7));
        assert_ne!(of(1e-3, 7), of(1e-3, 8));
    }

    #[test]
    fn names_of_files_are_as_long_as_names_can_be() {
        let patient = |length| PatientSpec { ct: Some(("x".repeat(length), 1)) };
        let back = |patient: &PatientSpec| {
            let mut bytes = Vec::new();
            patient.encode(&mut Encoder(&mut bytes));
            PatientSpec::decode(&mut Decoder(&bytes))
        };
        let longest = patient(MOST_OF_A_PATH);
        assert_eq!(back(&longest), Ok(longest));
        assert!(back(&patient(MOST_OF_A_PATH + 1)).is_err());
    }
}
