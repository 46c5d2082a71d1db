//! The renderer: what the thread draws with that has it.

use dualframe_sim::geometry::Geometry;
use dualframe_sim::object::Object;
use dualframe_sim::render::Renderer;
use wgpu::{
    CommandEncoder, PollType, RenderPassDescriptor, SubmissionIndex, Texture, TextureFormat,
    TextureUsages, TextureView,
};

use crate::auxiliary::{Auxiliary, Context, Units};
use crate::camera::Camera;
use crate::error::GraphicsError;
use crate::globals::{Globals, View};
use crate::gpu::Gpu;
use crate::look::{Look, Quality};
use crate::pick::Picker;
use crate::picture::{Picture, read_texture};
use crate::room::Room;
use crate::springs::{GpuMassSpring, Integrator};
use crate::surface::{Layouts, Surfaces};
use crate::target::{Format, Target, texture};
use crate::volume::Volumes;

/// The format of pictures without a window.
pub const OFFSCREEN_FORMAT: TextureFormat = TextureFormat::Rgba8UnormSrgb;

/// Draws the objects of a frame into whatever texture it is given, all of them opaque.
///
/// Objects are taken one by one, in any order; nothing is sent to the device before
/// [`Painter::paint`] but what changed of volumes, and the springs of a [`GpuMassSpring`].
pub struct Painter {
    gpu: Gpu,
    /// From where the next frame is seen.
    pub camera: Camera,
    /// What the next frame looks like.
    pub look: Look,
    quality: Quality,
    layouts: Layouts,
    globals: Globals,
    surfaces: Surfaces,
    volumes: Volumes,
    room: Room,
    picker: Picker,
    integrator: Integrator,
    units: Units,
    format: Format,
    target: Target,
    /// The frame being drawn, from its first object on.
    view: Option<View>,
    failure: Option<GraphicsError>,
}

impl Painter {
    /// A painter of pictures of so many pixels in a texture format, sRGB by preference.
    ///
    /// # Errors
    /// No pixels, or more than the adapter allows.
    pub fn new(
        gpu: Gpu,
        look: Look,
        quality: Quality,
        color: TextureFormat,
        size: (u32, u32),
    ) -> Result<Self, GraphicsError> {
        check_size(&gpu, size)?;
        let device = &gpu.device;
        let format = Format { color, samples: quality.samples() };
        let layouts = Layouts::new(device);
        let surfaces = Surfaces::new(device, &layouts, format);
        Ok(Self {
            globals: Globals::new(device, &layouts, quality, surfaces.buffer()),
            surfaces,
            volumes: Volumes::new(device, &layouts, format, quality),
            room: Room::new(device, &layouts, format),
            picker: Picker::new(device, &layouts),
            integrator: Integrator::default(),
            units: Units::new(),
            target: Target::new(device, format, size.0, size.1),
            camera: Camera::around(&look.focus),
            layouts,
            format,
            look,
            quality,
            gpu,
            view: None,
            failure: None,
        })
    }

    /// The device.
    #[must_use]
    pub fn gpu(&self) -> &Gpu {
        &self.gpu
    }

    /// Where GPU work besides drawing is submitted.
    #[must_use]
    pub fn auxiliary(&self) -> Auxiliary {
        self.units.queue()
    }

    /// Draws at another size from the next frame on. To be called between two frames: one that was begun, by
    /// [`Painter::add`], is still seen at the old size, and would be painted at the new one.
    ///
    /// # Errors
    /// No pixels, or more than the adapter allows.
    pub fn resize(&mut self, width: u32, height: u32) -> Result<(), GraphicsError> {
        check_size(&self.gpu, (width, height))?;
        if (width, height) != self.size() {
            self.target = Target::new(&self.gpu.device, self.format, width, height);
        }
        Ok(())
    }

    /// The pictures' width and height, in pixels.
    #[must_use]
    pub fn size(&self) -> (u32, u32) {
        (self.target.width, self.target.height)
    }

    /// How many times the pictures are as wide as high.
    #[must_use]
    pub fn aspect(&self) -> f32 {
        self.target.aspect()
    }

    /// Why nothing is drawn any more, if so. The objects go on without pictures.
    #[must_use]
    pub fn failure(&self) -> Option<GraphicsError> {
        self.failure.clone().or_else(|| self.gpu.failure())
    }

    /// Takes an object of this frame, unless neither it nor its shadow is in the picture. The springs of
    /// a [`GpuMassSpring`] are integrated in any case. What is hidden or excluded is no part of a frame: a host that
    /// visits objects by itself may leave that to this, as executors leave it to [`stages::draw`].
    ///
    /// [`stages::draw`]: dualframe_sim::stages::draw
    pub fn add(&mut self, object: &Object) {
        if !object.is_drawn() {
            return;
        }
        let size = self.size();
        if self.view.is_none() && self.failure.is_none() {
            // Asked once a frame: the device's own note is behind a lock.
            self.failure = self.gpu.failure();
        }
        if self.failure.is_some() {
            return;
        }
        let Self { gpu, layouts, surfaces, volumes, picker, integrator, units, .. } = self;
        let view = self.view.get_or_insert_with(|| {
            surfaces.clear(&gpu.queue);
            volumes.clear();
            View::new(self.camera, self.look, self.quality, self.target.aspect())
        });
        if let Some(springs) = GpuMassSpring::of(object)
            && gpu.failure().is_none()
        {
            let context = Context { gpu, size, picture: None, view, surfaces, picker, integrator };
            springs.integrate(&context, units);
        }
        if !view.may_see(&object.bounds()) {
            return;
        }
        match &object.geometry {
            Geometry::Mesh(mesh) => {
                surfaces.add_mesh(gpu, layouts, object, mesh, view.look.coloring);
            }
            Geometry::Rigid(rigid) => surfaces.add_rigid(gpu, layouts, object, rigid),
            Geometry::Volume(volume) => {
                let added = volumes.add(&gpu.device, &gpu.queue, object, volume);
                self.failure = added.err();
            }
        }
    }

    /// Ends the frame without a picture. Units of GPU work that wait for one go on waiting.
    pub fn discard(&mut self) {
        if let Some(failure) = self.failure() {
            return self.fail(failure);
        }
        // What was written to the device waits in memory of its own until something is submitted.
        self.gpu.queue.submit([]);
        let Some(view) = self.view.take() else { return };
        let size = self.size();
        let Self { gpu, surfaces, picker, integrator, units, .. } = self;
        let view = &view;
        let context = Context { gpu, size, picture: None, view, surfaces, picker, integrator };
        units.finish(&context);
    }

    /// Ends the frame: encodes how `picture`, a view of a texture of this size and format, is made of
    /// what was taken. The encoder is to be submitted before the next frame's first object is taken: what a frame draws
    /// lies in memory that the next one's takes. Once the device has failed there is nothing to encode, and units of GPU
    /// work end with that.
    pub fn paint(&mut self, encoder: &mut CommandEncoder, picture: &TextureView) {
        if let Some(failure) = self.failure() {
            return self.fail(failure);
        }
        let view = self.view.take().unwrap_or_else(|| {
            self.surfaces.clear(&self.gpu.queue);
            self.volumes.clear();
            View::new(self.camera, self.look, self.quality, self.target.aspect())
        });
        let Gpu { device, queue, .. } = &self.gpu;
        let numbers = view.numbers();
        let words = numbers.as_words();
        match self.surfaces.upload((device, queue), encoder, &self.layouts, words) {
            Ok(false) => {}
            Ok(true) => self.globals.rebind(device, &self.layouts, self.surfaces.buffer()),
            Err(error) => return self.fail(error),
        }
        let mut pass = encoder.begin_render_pass(&RenderPassDescriptor {
            label: Some("shadows"),
            depth_stencil_attachment: Some(self.globals.shadow_map()),
            ..Default::default()
        });
        self.surfaces.cast(&mut pass, &self.globals.plain);
        self.volumes.cast(&mut pass, &self.globals.plain);
        drop(pass);
        let mut pass = encoder.begin_render_pass(&RenderPassDescriptor {
            label: Some("picture"),
            color_attachments: &[Some(self.target.color(picture))],
            depth_stencil_attachment: Some(self.target.depth()),
            ..Default::default()
        });
        if view.look.room {
            self.room.paint(&mut pass, &self.globals.lit);
        }
        self.surfaces.paint(&mut pass, &self.globals.lit);
        self.volumes.paint(&mut pass, &self.globals.lit);
        drop(pass);
        let size = self.size();
        let Self { gpu, surfaces, picker, integrator, units, .. } = self;
        let view = &view;
        let context = Context { gpu, size, picture: None, view, surfaces, picker, integrator };
        units.finish(&context);
        units.run_now(&context);
        units.encode(&Context { picture: Some(picture), ..context }, encoder);
    }

    /// Nothing is drawn from now on: whoever waits for a unit of GPU work is told.
    fn fail(&mut self, failure: GraphicsError) {
        let view = self.view.take();
        let view = view.unwrap_or_else(|| {
            View::new(self.camera, self.look, self.quality, self.target.aspect())
        });
        let size = self.size();
        let Self { gpu, surfaces, picker, integrator, units, .. } = self;
        let view = &view;
        let context = Context { gpu, size, picture: None, view, surfaces, picker, integrator };
        units.refuse(&context, &failure);
        self.failure = Some(failure);
    }
}

fn check_size(gpu: &Gpu, (width, height): (u32, u32)) -> Result<(), GraphicsError> {
    let most = gpu.most_pixels();
    let fits = |pixels: u32| (1..=most).contains(&pixels);
    if fits(width) && fits(height) {
        Ok(())
    } else {
        Err(GraphicsError::Size { width, height, most })
    }
}

/// What a painter's pictures are drawn to without a window.
fn picture_for(painter: &Painter) -> Texture {
    let usage = TextureUsages::RENDER_ATTACHMENT | TextureUsages::COPY_SRC;
    texture(&painter.gpu.device, "picture", OFFSCREEN_FORMAT, painter.size(), 1, usage)
}

/// Draws every frame without a window. The last frame's picture can be read.
pub struct Offscreen {
    /// What draws.
    pub painter: Painter,
    texture: Texture,
    view: TextureView,
    /// The frame submitted last: the device is at most one frame behind.
    submitted: Option<SubmissionIndex>,
}

impl Offscreen {
    /// A renderer of pictures of so many pixels.
    ///
    /// # Errors
    /// No pixels, or more than the adapter allows.
    pub fn new(
        gpu: Gpu,
        look: Look,
        quality: Quality,
        size: (u32, u32),
    ) -> Result<Self, GraphicsError> {
        let painter = Painter::new(gpu, look, quality, OFFSCREEN_FORMAT, size)?;
        let texture = picture_for(&painter);
        let view = texture.create_view(&Default::default());
        Ok(Self { painter, texture, view, submitted: None })
    }

    /// Reads the picture of the last frame.
    ///
    /// # Errors
    /// The device failed.
    pub fn picture(&self) -> Result<Picture, GraphicsError> {
        if let Some(failure) = self.painter.failure() {
            return Err(failure);
        }
        read_texture(self.painter.gpu(), &self.texture)
    }
}

impl Renderer for Offscreen {
    fn draw(&mut self, object: &Object) {
        self.painter.add(object);
    }

    fn swap(&mut self, _frame: u64) {
        if (self.texture.width(), self.texture.height()) != self.painter.size() {
            self.texture = picture_for(&self.painter);
            self.view = self.texture.create_view(&Default::default());
        }
        let mut encoder = self.painter.gpu().device.create_command_encoder(&Default::default());
        self.painter.paint(&mut encoder, &self.view);
        if self.painter.failure().is_some() {
            return;
        }
        let submitted = self.painter.gpu().queue.submit([encoder.finish()]);
        if let Some(before) = self.submitted.replace(submitted) {
            // A failure is noted, and ends the pictures with the next frame.
            let _ = self
                .painter
                .gpu()
                .poll(PollType::Wait { submission_index: Some(before), timeout: None });
        }
    }
}
