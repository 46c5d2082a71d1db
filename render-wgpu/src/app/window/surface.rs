//! The window's surface: what is drawn to it, and what becomes of it.

use std::sync::Arc;

use dualframe_render_wgpu::error::GraphicsError;
use dualframe_render_wgpu::gpu::Gpu;
use wgpu::{
    Backends, CompositeAlphaMode, CurrentSurfaceTexture, Instance, PresentMode, Surface,
    SurfaceConfiguration, SurfaceTexture, TextureFormat, TextureUsages,
};
use winit::dpi::PhysicalSize;
use winit::window::Window;

/// A window's surface.
pub(super) struct Screen {
    surface: Surface<'static>,
    configuration: SurfaceConfiguration,
    window: Arc<Window>,
}

fn refused(reason: impl ToString) -> GraphicsError {
    GraphicsError::Surface { reason: reason.to_string() }
}

/// A surface of the window, before its device is known.
pub(super) fn create(
    instance: &Instance,
    window: &Arc<Window>,
) -> Result<Surface<'static>, GraphicsError> {
    instance.create_surface(Arc::clone(window)).map_err(|error| {
        // Without an adapter there is no surface either, and nobody says that this is why.
        let adapters = pollster::block_on(instance.enumerate_adapters(Backends::all()));
        if adapters.is_empty() { GraphicsError::NoAdapter } else { refused(error) }
    })
}

impl Screen {
    /// Takes over a surface that the device can draw to.
    pub(super) fn new(
        gpu: &Gpu,
        surface: Surface<'static>,
        window: Arc<Window>,
        size: PhysicalSize<u32>,
    ) -> Result<Self, GraphicsError> {
        let offers = surface.get_capabilities(gpu.adapter());
        let format = offers.formats.iter().copied().find(TextureFormat::is_srgb);
        let format = format.ok_or_else(|| refused("it has no format in sRGB"))?;
        // Whoever renders must not wait for the display, so that the rest of the frame does not.
        let preferred = [PresentMode::Mailbox, PresentMode::Immediate];
        let present_mode = preferred.into_iter().find(|mode| offers.present_modes.contains(mode));
        let configuration = SurfaceConfiguration {
            usage: TextureUsages::RENDER_ATTACHMENT,
            format,
            color_space: Default::default(),
            width: size.width.max(1),
            height: size.height.max(1),
            present_mode: present_mode.unwrap_or(PresentMode::Fifo),
            desired_maximum_frame_latency: 2,
            alpha_mode: CompositeAlphaMode::Auto,
            view_formats: Vec::new(),
        };
        surface.configure(&gpu.device, &configuration);
        Ok(Self { surface, configuration, window })
    }

    pub(super) fn format(&self) -> TextureFormat {
        self.configuration.format
    }

    pub(super) fn size(&self) -> (u32, u32) {
        (self.configuration.width, self.configuration.height)
    }

    /// Follows the window's size; says whether it is another one. A window without pixels keeps the last.
    pub(super) fn follow(&mut self, gpu: &Gpu, size: PhysicalSize<u32>) -> bool {
        let most = gpu.most_pixels();
        let (width, height) = (size.width.min(most), size.height.min(most));
        if width == 0 || height == 0 || (width, height) == self.size() {
            return false;
        }
        (self.configuration.width, self.configuration.height) = (width, height);
        self.surface.configure(&gpu.device, &self.configuration);
        true
    }

    /// The texture to draw the next picture to; `None` if there is none this time.
    pub(super) fn next(
        &mut self,
        gpu: &Gpu,
        instance: &Instance,
    ) -> Result<Option<SurfaceTexture>, GraphicsError> {
        match self.surface.get_current_texture() {
            // One that no longer quite fits is followed at the next event.
            CurrentSurfaceTexture::Success(texture)
            | CurrentSurfaceTexture::Suboptimal(texture) => Ok(Some(texture)),
            CurrentSurfaceTexture::Timeout | CurrentSurfaceTexture::Occluded => Ok(None),
            CurrentSurfaceTexture::Outdated => {
                self.surface.configure(&gpu.device, &self.configuration);
                Ok(None)
            }
            CurrentSurfaceTexture::Lost => {
                self.surface = create(instance, &self.window)?;
                self.surface.configure(&gpu.device, &self.configuration);
                Ok(None)
            }
            CurrentSurfaceTexture::Validation => Err(refused("its texture was refused")),
        }
    }
}
