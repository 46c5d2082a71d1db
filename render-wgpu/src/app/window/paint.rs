//! The overlay on the device.

use std::num::NonZeroU64;

use dualframe_render_wgpu::gpu::Gpu;
use egui::{Context, TextureId, Ui, ViewportId};
use egui_wgpu::{Renderer, RendererOptions, ScreenDescriptor};
use egui_winit::State;
use wgpu::{
    Buffer, BufferDescriptor, BufferUsages, COPY_BUFFER_ALIGNMENT, CommandBuffer, CommandEncoder,
    LoadOp, Operations, RenderPassColorAttachment, RenderPassDescriptor, StoreOp, Texture,
    TextureFormat,
};
use winit::window::Window;

/// Draws egui's output over a picture.
pub(super) struct OverlayPainter {
    context: Context,
    renderer: Renderer,
    /// What is written to see whether the device takes anything.
    probe: Buffer,
    /// Textures given up with the last output, whose commands were not submitted yet.
    given_up: Vec<TextureId>,
}

impl OverlayPainter {
    pub(super) fn new(gpu: &Gpu, format: TextureFormat) -> Self {
        let renderer = Renderer::new(&gpu.device, format, RendererOptions::default());
        let context = Context::default();
        context.set_visuals(egui::Visuals::dark());
        let probe = gpu.device.create_buffer(&BufferDescriptor {
            label: Some("probe"),
            size: COPY_BUFFER_ALIGNMENT,
            usage: BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        Self { context, renderer, probe, given_up: Vec::new() }
    }

    /// What turns the window's events into egui's.
    pub(super) fn input(&self, gpu: &Gpu, window: &Window) -> State {
        let most = gpu.most_pixels() as usize;
        State::new(self.context.clone(), ViewportId::ROOT, window, None, None, Some(most))
    }

    /// Lays out what `show` says and encodes how it is drawn over `picture`, which may be of another size
    /// than the window has by now. Some commands must be submitted before the encoder's. Nothing is drawn by a device
    /// that is lost.
    pub(super) fn paint(
        &mut self,
        gpu: &Gpu,
        (window, input): (&Window, &mut State),
        (encoder, picture): (&mut CommandEncoder, &Texture),
        show: impl FnMut(&mut Ui),
    ) -> Vec<CommandBuffer> {
        let Gpu { device, queue, .. } = gpu;
        // Egui's renderer panics where the device is lost, which need not be noted yet.
        let size = NonZeroU64::new(self.probe.size());
        let is_lost = size.and_then(|size| queue.write_buffer_with(&self.probe, 0, size)).is_none();
        if is_lost {
            return Vec::new();
        }
        self.given_up.drain(..).for_each(|id| self.renderer.free_texture(&id));
        let mut output = self.context.run_ui(input.take_egui_input(window), show);
        input.handle_platform_output(window, output.platform_output);
        for (id, deltas) in &output.textures_delta.set {
            for delta in deltas {
                self.renderer.update_texture(device, queue, *id, delta);
            }
        }
        let triangles = self.context.tessellate(output.shapes, output.pixels_per_point);
        let screen = ScreenDescriptor {
            size_in_pixels: [picture.width(), picture.height()],
            pixels_per_point: output.pixels_per_point,
        };
        let before = self.renderer.update_buffers(device, queue, encoder, &triangles, &screen);
        let picture = picture.create_view(&Default::default());
        let pass = encoder.begin_render_pass(&RenderPassDescriptor {
            label: Some("overlay"),
            color_attachments: &[Some(RenderPassColorAttachment {
                view: &picture,
                depth_slice: None,
                resolve_target: None,
                ops: Operations { load: LoadOp::Load, store: StoreOp::Store },
            })],
            ..Default::default()
        });
        self.renderer.render(&mut pass.forget_lifetime(), &triangles, &screen);
        self.given_up.extend(&output.textures_delta.free);
        // What is left of it would be reported as forgotten.
        output.textures_delta.clear();
        before
    }
}
