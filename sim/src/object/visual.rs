//! How an object looks.

/// The visual properties module of an object (Fig. 2).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VisualProperties {
    /// Red, green, blue and opacity, linear, from 0 to 1. What opacity does is for the renderer to say: that of
    /// `render-wgpu` draws all opaque.
    pub color: [f32; 4],
}

impl Default for VisualProperties {
    fn default() -> Self {
        Self { color: [0.8, 0.8, 0.8, 1.0] }
    }
}

/// The graphics renderer module of an object (Fig. 2): the way in which a [`Renderer`] is to draw its
/// geometry.
///
/// [`Renderer`]: crate::render::Renderer
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Drawing {
    /// As a closed, shaded surface.
    #[default]
    Surface,
    /// As the edges of its surface.
    Edges,
    /// Not at all; such an object never reaches the renderer.
    Hidden,
}
