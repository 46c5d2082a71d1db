//! The objects and the modelled interactions.

use glam::Vec3;
use thiserror::Error;

use super::{
    FIRST_GROUP, FIRST_STRUCTURE, PIECES, SKULL, SKULL_GROUP, TIME_STEP, TOOL_GROUP, TOOLS,
};
use crate::behavior::tissue::{Material, Pin, Tissue, TissueError};
use crate::behavior::{Behavior, Bone, Instrument, Tool, Workpieces};
use crate::device::DeviceSample;
use crate::geometry::Geometry;
use crate::interaction::{
    Attached, BurrForce, BurrInBone, Compliant, Detection, InteractionPair, Link, NodesInBone,
    NodesInShape, PieceInBone, PieceOnBone, Response, ResponseError, RuleError, Rules,
};
use crate::message::Message;
use crate::object::{Group, Object, ObjectId, VisualProperties};
use crate::scene::Scene;
use crate::scene::head::{Form, Head, Hold, Layer, Structure};
use crate::simd::Simd;
use crate::stages::Stages;

/// Substeps of a frame; usually 16.
const SUBSTEPS: u32 = 16;
/// The stiffness of springs that resist bending over that of springs along edges; usually 0.05.
const BENDING: f32 = 0.05;
/// How fast tissue comes to rest, per second; usually 8: it lies in tissue.
const DAMPING: f32 = 8.0;
/// How much shorter scalp would be if it were free, as a share; usually 0.06: skin is under tension, and
/// an incision gapes.
const TENSION: f32 = 0.06;
/// Of a node that has grown onto what does not move: newtons per metre, and the force at which it tears, in
/// newtons.
const FIRM: [f32; 2] = [1_000.0, f32::INFINITY];
/// Of a node that lies on it; likewise.
const LOOSE: [f32; 2] = [100.0, 0.25];
/// Of a node of scalp over the loose tissue that lets it glide on the skull; likewise.
const GLIDING: [f32; 2] = [3.0, 0.05];
/// How much longer loose links hold, in metres; usually 4 mm.
const LOOSE_STRETCH: f32 = 0.004;
/// The stiffness below which a link is of loose tissue, in newtons per metre.
const LOOSE_LINK: f32 = 10.0;
/// The damping of a link, in seconds: times its stiffness, newton seconds per metre; usually 0.02.
const LINK_DAMPING: f32 = 0.02;
/// The stiffness and the damping of bone and tools against soft tissue, in newtons per metre and newton
/// seconds per metre.
const CONTACT: [f32; 2] = [200.0, 1.0];
/// The coefficient of friction of bone on bone; usually 0.4.
const FRICTION: f32 = 0.4;
/// The acceleration of gravity, in metres per second squared; usually 9.81 downwards (−y).
const GRAVITY: f32 = 9.81;
/// Bone's colour.
const IVORY: [f32; 4] = [0.86, 0.80, 0.66, 1.0];
/// A tool's colour.
const STEEL: [f32; 4] = [0.55, 0.57, 0.60, 1.0];

/// Why a craniotomy cannot be built.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum BuildError {
    /// A structure was refused.
    #[error("the {name} cannot be made")]
    Structure {
        /// Its name.
        name: &'static str,
        /// Why.
        #[source]
        source: TissueError,
    },
    /// A rule was refused.
    #[error(transparent)]
    Rule(#[from] RuleError),
    /// A response was refused.
    #[error(transparent)]
    Response(#[from] ResponseError),
}

/// The environment before an operation on a head: 30 objects. Its time step stays as it is: [`TIME_STEP`].
///
/// # Errors
/// A structure that is no tissue; none is known for a [`Head`].
pub fn build(head: &Head) -> Result<Scene, BuildError> {
    let mut objects: Vec<Object> = TOOLS.map(|id| tool(id, head)).into();
    for (number, structure) in head.structures.iter().enumerate() {
        objects.push(soft(number, structure)?);
    }
    let mut skull =
        Object::new(SKULL, SKULL_GROUP, Geometry::Volume(head.skull.clone()), Bone::new());
    skull.visual = VisualProperties { color: IVORY };
    objects.push(skull);
    let stages = Stages {
        rules: rules(head)?,
        time_step: TIME_STEP,
        gravity: Vec3::NEG_Y * GRAVITY,
        callback_budget: None,
        simd: Simd::detect(),
    };
    Ok(Scene::new(objects, stages))
}

/// A tool that rests above the place of the operation.
fn tool(id: ObjectId, head: &Head) -> Object {
    let outward = -head.plan.middle.inward;
    let aside =
        outward.cross(Vec3::Z).normalize_or(Vec3::X) * if id == TOOLS[0] { 0.05 } else { -0.05 };
    let place = head.plan.middle.point + outward * 0.08 + aside;
    let all = |is: fn(&Structure) -> bool| {
        let numbers = 0..head.structures.len();
        numbers.filter(|&number| is(&head.structures[number])).map(structure_id).collect()
    };
    let workpieces = Workpieces {
        tissue: all(|structure| structure.form == Form::Sheet),
        dura: all(|structure| structure.layer == Layer::Dura),
        bone: vec![SKULL],
        pieces: Vec::new(),
    };
    let (rigid, tool) = Tool::new(Instrument::Forceps, DeviceSample::at(place), workpieces);
    let mut object = Object::new(id, TOOL_GROUP, Geometry::Rigid(rigid), tool);
    object.visual = VisualProperties { color: STEEL };
    object
}

fn structure_id(number: usize) -> ObjectId {
    ObjectId(FIRST_STRUCTURE.0 + number as u32)
}

fn structure_group(number: usize) -> Group {
    Group(FIRST_GROUP + number as u8)
}

fn soft(number: usize, structure: &Structure) -> Result<Object, BuildError> {
    let refused = |source| BuildError::Structure { name: structure.name, source };
    let Structure { positions, triangles, stiffness, area_density, contact_radius, .. } = structure;
    let material = Material {
        stiffness: *stiffness,
        bending: BENDING * stiffness,
        to_center: if structure.form == Form::Solid { *stiffness } else { 0.0 },
        damping: DAMPING,
        area_density: *area_density,
    };
    let tension = if structure.layer == Layer::Scalp { TENSION } else { 0.0 };
    let middle = positions.iter().sum::<Vec3>() / positions.len().max(1) as f32;
    let rest: Vec<Vec3> =
        positions.iter().map(|&place| place - (place - middle) * tension).collect();
    let (mut mesh, tissue) =
        Tissue::new(&rest, triangles.clone(), material, *contact_radius, SUBSTEPS)
            .map_err(refused)?;
    for (node, &place) in positions.iter().enumerate() {
        mesh.positions.set(node, place);
    }
    let pins = structure.pins.iter().map(|&(node, hold)| {
        let [stiffness, strength] = match (hold, structure.layer) {
            (Hold::Firm, _) => FIRM,
            (Hold::Loose, Layer::Scalp) => GLIDING,
            (Hold::Loose, _) => LOOSE,
        };
        Pin { node, point: positions[node as usize], stiffness, strength }
    });
    let mut tissue = tissue.with_pins(pins.collect()).map_err(refused)?;
    // Scalp is held up by what it lies on. The brain floats in its fluid, and with all else the image
    // shows the form that it has under its own weight.
    tissue.process(&Message::Weightless(structure.layer != Layer::Scalp));
    let (id, group) = (structure_id(number), structure_group(number));
    let mut object = Object::new(id, group, Geometry::Mesh(mesh), tissue);
    object.visual = VisualProperties { color: structure.color };
    Ok(object)
}

fn rules(head: &Head) -> Result<Rules, BuildError> {
    let mut rules = Rules::new();
    let mut model = |first, second, detection: Box<dyn Detection>, response: Box<dyn Response>| {
        rules.model(first, second, InteractionPair { detection, response })
    };
    for bone in [SKULL_GROUP, PIECES] {
        model(TOOL_GROUP, bone, Box::new(BurrInBone), Box::new(BurrForce))?;
    }
    let in_bone = Box::new(PieceInBone { time_step: TIME_STEP });
    model(PIECES, SKULL_GROUP, in_bone, Box::new(PieceOnBone { friction: FRICTION }))?;
    let [stiffness, damping] = CONTACT;
    let contact = Compliant::contact(stiffness, damping)?;
    for (number, structure) in head.structures.iter().enumerate() {
        let group = structure_group(number);
        if matches!(structure.layer, Layer::Scalp | Layer::Muscle) {
            model(group, SKULL_GROUP, Box::new(NodesInBone), Box::new(contact))?;
        }
        if structure.layer == Layer::Dura {
            model(group, TOOL_GROUP, Box::new(NodesInShape), Box::new(contact))?;
        }
    }
    for attachment in &head.attachments {
        let [first, second] = attachment.structures;
        let bodies = [first, second].map(|number| &head.structures[number].positions);
        let link = |&nodes: &[u32; 2]| {
            let [a, b] = [0, 1].map(|end| bodies[end][nodes[end] as usize]);
            Link { nodes, rest: a.distance(b) }
        };
        let attached = Attached::new(attachment.links.iter().map(link).collect());
        let loose = attachment.stiffness < LOOSE_LINK;
        let attached = if loose { attached.within(LOOSE_STRETCH) } else { attached };
        let response = Compliant::link(attachment.stiffness, LINK_DAMPING * attachment.stiffness)?;
        let groups = [first, second].map(structure_group);
        model(groups[0], groups[1], Box::new(attached), Box::new(response))?;
    }
    Ok(rules)
}
