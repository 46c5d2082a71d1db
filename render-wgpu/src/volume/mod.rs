//! Volumes: voxel bone, ray-marched.
//!
//! A volume's densities are a texture, of which only the bricks that changed are sent again. Its surface
//! is found by the fragment shader, with a depth of its own; see `volume.wgsl`.

mod cells;
mod grid;
mod pipelines;

use std::collections::HashMap;

use dualframe_sim::geometry::Volume;
use dualframe_sim::object::{Object, ObjectId};
use wgpu::{BindGroup, Device, Queue, RenderPass, RenderPipeline};

use self::grid::Grid;
use self::pipelines::Pipelines;
use crate::error::GraphicsError;
use crate::look::Quality;
use crate::surface::{KEPT_FRAMES, Layouts};
use crate::target::Format;

/// Two triangles on each of a box's six sides.
const CORNERS: u32 = 36;

/// The volumes of a frame, and those of the last frames.
pub(crate) struct Volumes {
    pipelines: Pipelines,
    grids: HashMap<ObjectId, Grid>,
    /// Steps of the march are so many voxels long.
    step: f32,
    frame: u64,
}

impl Volumes {
    pub(crate) fn new(
        device: &Device,
        layouts: &Layouts,
        format: Format,
        quality: Quality,
    ) -> Self {
        let step = match quality {
            Quality::Fast => 1.0,
            Quality::Fine => 0.5,
        };
        let pipelines = Pipelines::new(device, layouts, format);
        Self { pipelines, grids: HashMap::new(), step, frame: 0 }
    }

    /// Forgets the last frame's volumes; what they have on the device is kept for a while.
    pub(crate) fn clear(&mut self) {
        let oldest = self.frame.saturating_sub(KEPT_FRAMES);
        self.grids.retain(|_, grid| grid.used >= oldest);
        self.frame += 1;
    }

    /// Adds a volume, and sends what changed of it since it was last added.
    ///
    /// # Errors
    /// More voxels than the device's textures hold.
    pub(crate) fn add(
        &mut self,
        device: &Device,
        queue: &Queue,
        object: &Object,
        volume: &Volume,
    ) -> Result<(), GraphicsError> {
        let known = self.grids.get_mut(&object.id()).filter(|grid| grid.fits(volume));
        let grid = match known {
            Some(grid) => grid,
            None => {
                let grid = Grid::new(device, &self.pipelines, volume)?;
                self.grids.entry(object.id()).insert_entry(grid).into_mut()
            }
        };
        grid.used = self.frame;
        grid.upload(queue, volume, object.visual.color, self.step);
        Ok(())
    }

    /// Draws the volumes' shadows into a shadow map.
    pub(crate) fn cast(&self, pass: &mut RenderPass<'_>, globals: &BindGroup) {
        self.draw(pass, &self.pipelines.shadows, globals);
    }

    /// Draws the volumes.
    pub(crate) fn paint(&self, pass: &mut RenderPass<'_>, lit: &BindGroup) {
        self.draw(pass, &self.pipelines.volumes, lit);
    }

    fn draw(&self, pass: &mut RenderPass<'_>, pipeline: &RenderPipeline, globals: &BindGroup) {
        pass.set_pipeline(pipeline);
        pass.set_bind_group(0, globals, &[]);
        for grid in self.grids.values().filter(|grid| grid.used == self.frame) {
            pass.set_bind_group(1, &grid.bound, &[]);
            pass.draw(0..CORNERS, 0..1);
        }
    }
}
