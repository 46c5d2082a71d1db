//! What is drawn to: colours, depths, samples.

use wgpu::{
    Color, CompareFunction, DepthStencilState, Device, Extent3d, LoadOp, Operations,
    RenderPassColorAttachment, RenderPassDepthStencilAttachment, StoreOp, Texture,
    TextureDescriptor, TextureDimension, TextureFormat, TextureUsages, TextureView,
};

/// The format of depths.
const DEPTH_FORMAT: TextureFormat = TextureFormat::Depth32Float;

/// Depth is 1 at the nearest and 0 at infinity: floating-point numbers are then precise where it counts.
pub(crate) const DEPTH: DepthStencilState = DepthStencilState {
    format: DEPTH_FORMAT,
    depth_write_enabled: Some(true),
    depth_compare: Some(CompareFunction::Greater),
    stencil: wgpu::StencilState {
        front: wgpu::StencilFaceState::IGNORE,
        back: wgpu::StencilFaceState::IGNORE,
        read_mask: 0,
        write_mask: 0,
    },
    bias: wgpu::DepthBiasState { constant: 0, slope_scale: 0.0, clamp: 0.0 },
};

/// What there is behind everything; linear.
const BACKGROUND: Color = Color { r: 0.012, g: 0.014, b: 0.018, a: 1.0 };

/// What pipelines must know of what they draw to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Format {
    pub(crate) color: TextureFormat,
    pub(crate) samples: u32,
}

/// The textures of one size that a picture is made with.
pub(crate) struct Target {
    pub(crate) width: u32,
    pub(crate) height: u32,
    depth: TextureView,
    /// Where there are several samples a pixel: they are resolved into the picture.
    samples: Option<TextureView>,
}

impl Target {
    pub(crate) fn new(device: &Device, format: Format, width: u32, height: u32) -> Self {
        let view = |label, color, samples| {
            let usage = TextureUsages::RENDER_ATTACHMENT;
            let size = (width, height);
            texture(device, label, color, size, samples, usage).create_view(&Default::default())
        };
        Self {
            width,
            height,
            depth: view("depth", DEPTH_FORMAT, format.samples),
            samples: (format.samples > 1).then(|| view("samples", format.color, format.samples)),
        }
    }

    /// How many times it is as wide as high.
    pub(crate) fn aspect(&self) -> f32 {
        self.width as f32 / self.height as f32
    }

    /// The colours of a pass whose result is `picture`.
    pub(crate) fn color<'a>(&'a self, picture: &'a TextureView) -> RenderPassColorAttachment<'a> {
        let (view, resolve_target) = match &self.samples {
            Some(samples) => (samples, Some(picture)),
            None => (picture, None),
        };
        let store = if resolve_target.is_some() { StoreOp::Discard } else { StoreOp::Store };
        let ops = Operations { load: LoadOp::Clear(BACKGROUND), store };
        RenderPassColorAttachment { view, depth_slice: None, resolve_target, ops }
    }

    /// The depths of that pass.
    pub(crate) fn depth(&self) -> RenderPassDepthStencilAttachment<'_> {
        let ops = Operations { load: LoadOp::Clear(0.0), store: StoreOp::Discard };
        let view = &self.depth;
        RenderPassDepthStencilAttachment { view, depth_ops: Some(ops), stencil_ops: None }
    }
}

/// A texture without mip levels.
pub(crate) fn texture(
    device: &Device,
    label: &str,
    format: TextureFormat,
    (width, height): (u32, u32),
    sample_count: u32,
    usage: TextureUsages,
) -> Texture {
    device.create_texture(&TextureDescriptor {
        label: Some(label),
        size: Extent3d { width, height, depth_or_array_layers: 1 },
        mip_level_count: 1,
        sample_count,
        dimension: TextureDimension::D2,
        format,
        usage,
        view_formats: &[],
    })
}
