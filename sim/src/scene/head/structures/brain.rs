//! The brain in lobes.

use glam::Vec3;

use super::make::BRAIN;
use super::{Hold, Structure};
use crate::scene::head::anatomy::{Scale, tentorium};
use crate::scene::head::frame::parts;
use crate::scene::head::layers::Layers;
use crate::scene::head::surface::extract;

/// The distance of the grids' nodes, in metres.
const SPACING: f32 = 0.006_5;
/// The fluid between skull and brain, in metres; usually 3 mm.
const FLUID: f32 = 0.003;
/// Half a gap between neighbours, in metres; usually 0.5 mm.
const GAP: f32 = 0.000_5;
/// How smooth the lobes become: four rounds of Taubin's shares.
const SMOOTH: (usize, [f32; 2]) = (4, [0.5, -0.53]);

/// The lobes, and what lies below them.
#[derive(Clone, Copy)]
enum Part {
    Frontal,
    Parietal,
    Temporal,
    Occipital,
    Cerebellum,
    Brainstem,
}

/// All parts, and on which side they are: right (1), left (−1) or in the middle (0).
const PARTS: [(&str, Part, f32); 10] = [
    ("right frontal lobe", Part::Frontal, 1.0),
    ("right parietal lobe", Part::Parietal, 1.0),
    ("right temporal lobe", Part::Temporal, 1.0),
    ("right occipital lobe", Part::Occipital, 1.0),
    ("left frontal lobe", Part::Frontal, -1.0),
    ("left parietal lobe", Part::Parietal, -1.0),
    ("left temporal lobe", Part::Temporal, -1.0),
    ("left occipital lobe", Part::Occipital, -1.0),
    ("cerebellum", Part::Cerebellum, 0.0),
    ("brainstem", Part::Brainstem, 0.0),
];

pub(super) fn make(layers: &Layers) -> impl Iterator<Item = Structure> {
    let scale = Scale::of(layers);
    let bounds = scale.inside(layers);
    PARTS.into_iter().map(move |(name, part, side)| {
        let field = |point: Vec3| {
            let wall = point.length() - (layers.inner.at(point) - FLUID);
            wall.max(part.field(scale, side, point))
        };
        let (rounds, shares) = SMOOTH;
        let surface = extract(&bounds, SPACING, field).relaxed(rounds, &shares, |point| point);
        BRAIN.structure(name, surface, |_, position, _| {
            part.is_held(layers, scale, position).then_some(Hold::Firm)
        })
    })
}

impl Part {
    /// Below 0 within the part, and of a slope of about 1. The boundaries are planes in a head of any
    /// size: between the hemispheres, along the central and the lateral sulcus, from the parieto-occipital
    /// sulcus to the notch below it, and the tentorium.
    fn field(self, scale: Scale, side: f32, point: Vec3) -> f32 {
        let scaled = |length: f32| length * scale.0;
        let [right, front, up] = parts(point);
        let hemisphere = 3.0 * GAP - side * right;
        let lateral = up - (scaled(-0.002) - 0.25 * front);
        let central = front - (scaled(0.02) - 0.5 * up);
        let occipital = front + scaled(0.05);
        let above_tentorium = tentorium(scale, right, front) + 4.0 * GAP - up;
        let cuts = match self {
            Self::Frontal => [hemisphere, GAP - lateral, GAP - central],
            Self::Parietal => [hemisphere, (GAP - lateral).max(central + GAP), GAP - occipital],
            Self::Temporal => [
                (scaled(0.015) + GAP - side * right).max(lateral + GAP),
                GAP - occipital,
                above_tentorium,
            ],
            Self::Occipital => [hemisphere, occipital + GAP, above_tentorium],
            Self::Cerebellum => {
                [front + scaled(0.03), 8.0 * GAP - above_tentorium, -scaled(0.058) - up]
            }
            Self::Brainstem => [
                right.abs() - scaled(0.014),
                (front - scaled(0.018)).max(scaled(-0.029) - front),
                (lateral + GAP).max(-scaled(0.055) - up),
            ],
        };
        cuts.into_iter().fold(f32::MIN, f32::max)
    }

    /// Whether a node has grown together with what is deeper: the brain's inner half, the cerebellum's
    /// stalks, the brainstem's lower end.
    fn is_held(self, layers: &Layers, scale: Scale, position: Vec3) -> bool {
        let [_, front, up] = parts(position);
        match self {
            Self::Cerebellum => front > -0.038 * scale.0,
            Self::Brainstem => up < -0.042 * scale.0,
            _ => position.length() < 0.5 * layers.inner.at(position),
        }
    }
}
