//! From computed tomography to a patient: the skull as voxel bone, 27 deformable structures, what
//! joins them, and the operation's plan.
//!
//! **The world.** Its origin is in the middle of the cranium, at about the level of the frontal sinus.
//! The patient lies on the left side: +y, up, is the patient's right, +z, towards the viewer, the top of
//! the head, and −x the face. So the place of the operation, the right temple, faces up and towards a
//! surgeon who stands at the patient's head. Lengths are in metres.
//!
//! **How a head is understood.** The largest part of bone is the skull; holders, tables and noise are not.
//! The middle of the largest ball that holds neither bone nor air is in the brain. Rays from the middle of
//! the cranium find, in every direction, the skull's inner table, its outer table and the skin; the maps
//! of these radii are filled where rays find none and smoothed. So every surface is star-shaped around
//! that middle, and what is not (ears, orbits, the skull base's inside, openings wider than 6°) is only
//! roughly followed. The volume of bone is the image's own: no layer cuts it.
//!
//! **The structures** are surfaces of fields that are made of these layers and of planes in proportion to
//! the head: see [`Structure`]. Their grids' spacing is chosen such that edges have the length wanted, and
//! takes the place of a decimation.
//!
//! All of it consists of sums, products, quotients and square roots in a fixed order: a head has the same
//! bits on every machine.

mod anatomy;
mod attachments;
mod component;
mod error;
mod frame;
mod layers;
mod plan;
mod radial;
mod skull;
mod structures;
mod surface;
mod synthetic;

use std::ops::RangeInclusive;

use glam::{DVec3, Vec3};

use self::frame::{Field, Frame};
use self::layers::{Layers, Rays, centered, largest_room};
use self::skull::{Bone, Lattice};
use crate::geometry::Volume;
use crate::image::{self, AIR, Image, Thresholds};
use crate::parallel::on_all_cores;

pub use self::attachments::Attachment;
pub use self::error::HeadError;
pub use self::plan::{Entry, Plan, Pull};
pub use self::structures::{Form, Hold, Layer, Structure};
pub use self::synthetic::synthetic_ct;

/// A patient's head.
#[derive(Clone, Debug)]
pub struct Head {
    /// The skull's vault, at 0.5 mm, at rest. Its axes are the world's.
    pub skull: Volume,
    /// The 27 deformable structures, in the same order for every head.
    pub structures: Vec<Structure>,
    /// What joins them.
    pub attachments: Vec<Attachment>,
    /// Where the operation takes place.
    pub plan: Plan,
    image: Image,
    /// How much of each of the image's voxels is the skull's, of 255.
    densities: Vec<u8>,
    center: DVec3,
    layers: Layers,
    lattice: Lattice,
}

impl Head {
    /// The number of deformable structures.
    pub const STRUCTURES: usize = 27;
    /// The radii of the largest ball within a cranium, in metres: usually 60 to 70 mm.
    pub const ROOM: RangeInclusive<f32> = 0.03..=0.11;
    /// The least share of the directions upwards in which a cranium has bone; usually 0.75.
    pub const ENCLOSED: f32 = 0.75;

    /// The head in an image of computed tomography.
    ///
    /// # Errors
    /// No bone, or in more places than [`HeadError::MAX_RUNS`]; an image of more than
    /// [`HeadError::MAX_VOLUME`]; no memory for the densities of its voxels, a byte each; no room with bone
    /// around it in which a brain could be; a structure of which nothing is in the image. Where there is no memory
    /// for what is built from these, the process is aborted, as Rust programs are.
    pub fn from_ct(image: Image, thresholds: &Thresholds) -> Result<Self, HeadError> {
        let (grid, dims) = (image.grid().clone(), image.grid().dims());
        let volume = grid.spacing().element_product() * grid.voxels() as f64;
        if volume > HeadError::MAX_VOLUME {
            return Err(HeadError::Size { volume });
        }
        let mut densities = image.bone(thresholds)?;
        component::keep_largest(&mut densities, dims)?;
        let (seed, room) = largest_room(&grid, &densities, image.voxels(), thresholds.air());
        if !Self::ROOM.contains(&room) {
            return Err(HeadError::NoRoom { radius: room });
        }
        let rays = |frame: Frame| Rays {
            bone: Field { voxels: &densities, dims, frame, outside: 0 },
            hounsfield: Field { voxels: image.voxels(), dims, frame, outside: AIR },
            air: thresholds.air().into(),
            start: 0.5 * room,
            end: 2.2 * room,
        };
        let (center, frame) = centered(&grid, seed, rays);
        let rays = rays(frame);
        let share = rays.enclosed();
        if share < Self::ENCLOSED {
            return Err(HeadError::Open { share });
        }
        let layers = rays.layers();
        let lattice = Lattice::around(&layers);
        let bone = Bone::new(lattice, rays.bone)?;
        let (skull, structures) =
            on_all_cores(|| rayon::join(|| bone.volume(), || structures::structures(&layers)));
        let (skull, structures) = (skull?, structures?);
        let attachments = attachments::attachments(&structures);
        let plan = Plan::new(&layers, &skull);
        Ok(Self { skull, structures, attachments, plan, image, densities, center, layers, lattice })
    }

    /// The head of [`synthetic_ct`].
    ///
    /// # Errors
    /// None that is known.
    pub fn synthetic() -> Result<Self, HeadError> {
        Self::from_ct(synthetic_ct()?, &Thresholds::default())
    }

    /// The image that it was built from.
    #[must_use]
    pub fn image(&self) -> &Image {
        &self.image
    }

    /// The world's origin in the patient, in metres along the axes of the image's [grid](Image::grid).
    #[must_use]
    pub fn center(&self) -> DVec3 {
        self.center
    }

    /// How far the skin is from the origin along a direction of any length but 0, in metres.
    #[must_use]
    pub fn skin_at(&self, direction: Vec3) -> f32 {
        self.layers.skin.at(direction)
    }

    /// As [`Head::skin_at`], the skull's outer table.
    #[must_use]
    pub fn outer_at(&self, direction: Vec3) -> f32 {
        self.layers.outer.at(direction)
    }

    /// As [`Head::skin_at`], the skull's inner table.
    #[must_use]
    pub fn inner_at(&self, direction: Vec3) -> f32 {
        self.layers.inner.at(direction)
    }

    /// The image with what was drilled away: `skull` is what is left of [`Head::skull`], and `also` are
    /// pieces of it that lie elsewhere or again in their places; where one is in its place, nothing is
    /// missing. The numbers of voxels whose bone is gone, all or in part, are lowered towards air by as
    /// much of their bone as is; all others are exactly those of the image.
    ///
    /// [`save`](crate::image::save) writes the result's voxels with its grid.
    ///
    /// # Errors
    /// `skull` has not the voxels of this head's; no memory, of which it takes some two bytes for each of the
    /// image's voxels and one for each of the skull's.
    pub fn drilled(&self, skull: &Volume, also: &[&Volume]) -> Result<Image, HeadError> {
        if skull.dims() != self.lattice.dims {
            return Err(HeadError::NotTheSkull { given: skull.dims(), skull: self.lattice.dims });
        }
        let grid = self.image.grid();
        let frame = Frame::new(grid, self.center);
        let field = Field { voxels: &self.densities, dims: grid.dims(), frame, outside: 0 };
        let affine = grid.affine();
        let to_world =
            |voxel: [f64; 3]| Frame::in_world(self.center, affine.transform_point3(voxel.into()));
        let samples = grid
            .spacing()
            .to_array()
            .map(|spacing| (spacing / f64::from(skull::SPACING)).ceil().max(1.0) as u32);
        let mut voxels = image::room(grid.voxels())?;
        voxels.extend_from_slice(self.image.voxels());
        Bone::new(self.lattice, field)?.carve(&mut voxels, skull, also, to_world, samples)?;
        Ok(Image::new(grid.clone(), voxels)?)
    }
}
