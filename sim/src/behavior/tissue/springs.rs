//! Springs in the order in which they are corrected.

use crate::geometry::Spring;

/// Springs that are corrected at once.
pub(super) const WIDTH: usize = 8;

/// [`WIDTH`] springs without a node in common. Places left over hold a spring of length 0 from a node
/// past the last to itself.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(align(64))]
pub(super) struct Block {
    pub(super) nodes: [[u32; 2]; WIDTH],
    /// The lengths at rest, in metres.
    pub(super) rest: [f32; WIDTH],
    /// By what a spring's elongation is to be multiplied for the impulse that a substep takes from it,
    /// times the substep's time: 1/(w₁ + w₂ + 1/(k h²)), in kilograms.
    pub(super) gain: [f32; WIDTH],
}

/// Springs of one stiffness.
///
/// They are corrected one after the other, each with what the ones before have done (Gauss–Seidel), in
/// the order of their colours: springs of one colour have no node in common. So within a colour they may
/// be computed in any number at once, and come to the same bits; and there is an order at all that does
/// not depend on how the body is computed. Colours are given greedily, in the order of the springs.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Springs {
    pub(super) blocks: Vec<Block>,
}

impl Springs {
    /// These springs of a body of so many nodes.
    pub(super) fn new(nodes: usize, springs: &[Spring]) -> Self {
        let mut blocks = Vec::new();
        for color in colors(nodes, springs) {
            for chunk in color.chunks(WIDTH) {
                let mut block = Block {
                    nodes: [[nodes as u32; 2]; WIDTH],
                    rest: [0.0; WIDTH],
                    gain: [0.0; WIDTH],
                };
                for (lane, spring) in chunk.iter().enumerate() {
                    block.nodes[lane] = spring.nodes;
                    block.rest[lane] = spring.rest;
                }
                blocks.push(block);
            }
        }
        Self { blocks }
    }

    /// Fits the gains to a stiffness (N/m), a substep's time (s) and the nodes' inverse masses (1/kg).
    pub(super) fn fit(&mut self, stiffness: f32, time: f32, inverse_masses: &[f32]) {
        let compliance = 1.0 / (stiffness * time * time);
        let inverse_mass = |node: u32| inverse_masses.get(node as usize).copied().unwrap_or(0.0);
        for block in &mut self.blocks {
            for (gain, &[a, b]) in block.gain.iter_mut().zip(&block.nodes) {
                // Of nothing to be moved, and of springs without stiffness, nothing comes.
                let total = inverse_mass(a) + inverse_mass(b);
                *gain = if total > 0.0 { 1.0 / (total + compliance) } else { 0.0 };
            }
        }
    }
}

/// The springs of each colour.
fn colors(nodes: usize, springs: &[Spring]) -> Vec<Vec<Spring>> {
    let mut taken: Vec<Vec<usize>> = vec![Vec::new(); nodes];
    let mut colors: Vec<Vec<Spring>> = Vec::new();
    for spring in springs {
        let [a, b] = spring.nodes.map(|node| node as usize);
        let is_free = |color: &usize| !taken[a].contains(color) && !taken[b].contains(color);
        let color = (0..colors.len()).find(is_free).unwrap_or(colors.len());
        if color == colors.len() {
            colors.push(Vec::new());
        }
        colors[color].push(*spring);
        taken[a].push(color);
        taken[b].push(color);
    }
    colors
}
