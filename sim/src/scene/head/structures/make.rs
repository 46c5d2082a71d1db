//! From a surface to a structure.

use glam::Vec3;

use super::{Form, Hold, Layer, Structure};
use crate::scene::head::surface::Surface;

/// Half the root of 3, which makes a modulus times a thickness the stiffness of a spring on a lattice of
/// equilateral triangles, at Poisson's ratio 1/3.
const LATTICE: f32 = 0.866_025_4;

/// What something is made of.
pub(super) struct Tissue {
    pub(super) layer: Layer,
    pub(super) form: Form,
    /// Of a sheet, or of a vessel's wall, in metres.
    pub(super) thickness: f32,
    /// In kilograms per cubic metre.
    pub(super) density: f32,
    /// Young's modulus, in pascals.
    pub(super) modulus: f32,
    /// In metres.
    pub(super) contact_radius: f32,
    pub(super) color: [f32; 3],
}

/// Skin and galea; usually 3 to 6 mm, 1,100 kg/m³, and 1 MPa while it is little stretched.
pub(super) const SCALP: Tissue = Tissue {
    layer: Layer::Scalp,
    form: Form::Sheet,
    thickness: 0.005,
    density: 1_100.0,
    modulus: 1e6,
    contact_radius: 0.002,
    color: [0.80, 0.55, 0.43],
};

/// Resting muscle; usually 5 to 12 mm, 1,060 kg/m³, 60 kPa.
pub(super) const MUSCLE: Tissue = Tissue {
    layer: Layer::Muscle,
    form: Form::Sheet,
    thickness: 0.008,
    density: 1_060.0,
    modulus: 6e4,
    contact_radius: 0.002,
    color: [0.45, 0.10, 0.08],
};

/// The skin of the bone; usually 1 mm, 1,100 kg/m³, 10 MPa.
pub(super) const PERIOSTEUM: Tissue = Tissue {
    layer: Layer::Periosteum,
    form: Form::Sheet,
    thickness: 0.001,
    density: 1_100.0,
    modulus: 1e7,
    contact_radius: 0.000_5,
    color: [0.75, 0.50, 0.45],
};

/// Dura; usually 0.5 mm, 1,130 kg/m³, 31 to 68 MPa.
pub(super) const DURA: Tissue = Tissue {
    layer: Layer::Dura,
    form: Form::Sheet,
    thickness: 0.000_5,
    density: 1_130.0,
    modulus: 3.1e7,
    contact_radius: 0.000_5,
    color: [0.72, 0.66, 0.60],
};

/// Brain; usually 1,040 kg/m³ and 2 kPa.
pub(super) const BRAIN: Tissue = Tissue {
    layer: Layer::Brain,
    form: Form::Solid,
    thickness: 0.0,
    density: 1_040.0,
    modulus: 2e3,
    contact_radius: 0.002_5,
    color: [0.70, 0.48, 0.45],
};

/// Veins, full of blood; the wall usually 0.5 mm and 1 MPa, all of it 1,060 kg/m³.
pub(super) const VEIN: Tissue = Tissue {
    layer: Layer::Vessel,
    form: Form::Tube,
    thickness: 0.000_5,
    density: 1_060.0,
    modulus: 1e6,
    contact_radius: 0.001,
    color: [0.15, 0.10, 0.40],
};

/// Arteries; as veins, of usually 2 MPa.
pub(super) const ARTERY: Tissue = Tissue { modulus: 2e6, color: [0.65, 0.05, 0.05], ..VEIN };

impl Tissue {
    /// A structure of this tissue. `hold` says where it is held, of each node: its number, its place,
    /// and whether it is on the border.
    pub(super) fn structure(
        &self,
        name: &'static str,
        surface: Surface,
        hold: impl Fn(u32, Vec3, bool) -> Option<Hold>,
    ) -> Structure {
        let area = surface.node_areas().iter().sum::<f32>().max(f32::MIN_POSITIVE);
        let (area_density, stiffness) = match self.form {
            Form::Sheet => (self.density * self.thickness, LATTICE * self.modulus * self.thickness),
            Form::Solid => {
                (self.density * surface.volume() / area, self.modulus * mean_edge(&surface))
            }
            Form::Tube => {
                (self.density * surface.volume() / area, LATTICE * self.modulus * self.thickness)
            }
        };
        let nodes = (0..).zip(surface.positions.iter().zip(surface.on_border()));
        let pins = nodes.filter_map(|(node, (&position, border))| {
            hold(node, position, border).map(|hold| (node, hold))
        });
        let [red, green, blue] = self.color;
        Structure {
            name,
            layer: self.layer,
            form: self.form,
            pins: pins.collect(),
            stiffness,
            area_density,
            contact_radius: self.contact_radius,
            color: [red, green, blue, 1.0],
            positions: surface.positions,
            triangles: surface.triangles,
        }
    }
}

/// The mean length of a triangle's side, in metres.
fn mean_edge(surface: &Surface) -> f32 {
    let lengths = surface.triangles.iter().map(|triangle| {
        let [a, b, c] = triangle.map(|node| surface.positions[node as usize]);
        a.distance(b) + b.distance(c) + c.distance(a)
    });
    lengths.sum::<f32>() / (3 * surface.triangles.len()).max(1) as f32
}
