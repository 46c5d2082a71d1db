//! Soft tissue that can be cut, pinned, grasped and scraped (§7.1.2).

mod anchors;
mod kernel;
mod material;
mod messages;
mod shape;
mod springs;

use std::any::Any;
use std::hash::Hasher;
use std::sync::Arc;

use glam::Vec3;

use self::anchors::{Anchors, Grip};
use self::kernel::{Advance, Nodes, ToCenter};
use self::material::check;
use self::springs::Springs;
use super::{Behavior, Felt, Input};
use crate::geometry::{
    Bounds, CutNode, CutSurface, Geometry, Mesh, Sweep, Topology, Vectors, edges,
};
use crate::message::Message;
use crate::object::{Object, ObjectId};

pub use anchors::Pin;
pub use material::{Material, TissueError};
pub use messages::{Cut, Scrape};

/// The shortest edge that cutting leaves, as a share of the mean edge at the start; usually 0.1.
const SHORTEST: f32 = 0.1;

/// A surface of tissue: a mass–spring body whose springs are compliant distance constraints (XPBD in
/// small steps), which stays stable however stiff and however far it is stretched.
///
/// It keeps its rest shape, so that it can be cut: a cut makes new nodes, triangles and springs along
/// the blade's path, and masses and lengths anew from the rest shape. The mass of all nodes together
/// stays what it was, up to rounding. Nodes keep their numbers.
///
/// Of the engine's messages it knows [`Message::Stiffness`], [`Message::Weightless`],
/// [`Message::Damping`] (as [`Material::damping`], per second), and [`Message::Pull`] and
/// [`Message::Release`], by which the host holds one node at a point. What tools do comes as [`Grasp`],
/// [`Hold`], [`LetGo`], [`Scrape`] and [`Cut`].
///
/// [`Grasp`]: super::Grasp
/// [`Hold`]: super::Hold
/// [`LetGo`]: super::LetGo
#[derive(Clone, Debug)]
pub struct Tissue {
    material: Material,
    substeps: u32,
    weightless: bool,
    rest: Vec<Vec3>,
    edges: Springs,
    bending: Springs,
    /// The nodes' distances from the centre of mass at rest, in metres.
    to_center: Vec<f32>,
    /// The time of a substep that the springs are fitted to, in seconds; 0 for none yet.
    fitted: f32,
    anchors: Anchors,
    slits: Vec<[u32; 2]>,
    /// Where the tools' cuts go on from.
    fronts: Vec<Front>,
    /// The shortest edge that cutting leaves, in metres.
    shortest: f32,
    /// Of what never changes but by a cut.
    digest: u64,
    nodes: Nodes,
}

/// Where a tool's cut goes on from.
#[derive(Clone, Copy, Debug)]
struct Front {
    by: ObjectId,
    node: u32,
    /// Whether the tool has cut since the last update. One that has not has taken its blade out.
    is_cutting: bool,
}

impl Tissue {
    /// Tissue of this rest shape (metres) and its mesh, at rest, whose nodes carry contact spheres of
    /// `contact_radius` metres. The mesh's positions may be replaced: tissue on a patient is stretched.
    ///
    /// A frame is computed in `substeps` equal steps; usually 16 at 60 frames a second.
    ///
    /// # Errors
    /// A value of the material that is negative or not finite; no substeps; triangles that name nodes
    /// there are not, or that are more than one on one side of an edge; a node in no triangle with an
    /// area.
    pub fn new(
        rest: &[Vec3],
        triangles: Vec<[u32; 3]>,
        material: Material,
        contact_radius: f32,
        substeps: u32,
    ) -> Result<(Mesh, Self), TissueError> {
        material.check()?;
        if substeps == 0 {
            return Err(TissueError::NoSubsteps);
        }
        let joined = edges(&triangles);
        let topology = Topology::new(rest, triangles, &joined, material.to_center > 0.0)?;
        let lengths: f32 = topology.springs().iter().map(|spring| spring.rest).sum();
        let mut tissue = Self {
            material,
            substeps,
            weightless: false,
            rest: rest.to_vec(),
            edges: Springs::default(),
            bending: Springs::default(),
            to_center: Vec::new(),
            fitted: 0.0,
            anchors: Anchors::default(),
            slits: Vec::new(),
            fronts: Vec::new(),
            shortest: SHORTEST * lengths / topology.springs().len().max(1) as f32,
            digest: 0,
            nodes: Nodes::default(),
        };
        let mesh = tissue.join(topology, rest, contact_radius)?;
        Ok((mesh, tissue))
    }

    /// The same with nodes held to points in space. Masses are as without.
    ///
    /// # Errors
    /// A node that there is not, a point that is not finite, a stiffness or strength that is negative or
    /// no number.
    pub fn with_pins(mut self, pins: Vec<Pin>) -> Result<Self, TissueError> {
        let nodes = self.rest.len();
        for &Pin { node, point, stiffness, strength } in &pins {
            if node as usize >= nodes {
                return Err(TissueError::NoSuchNode { node, nodes });
            }
            check("a pin's point", if point.is_finite() { 0.0 } else { f32::NAN })?;
            for (what, value) in [("a pin's stiffness", stiffness), ("a pin's strength", strength)]
            {
                // Infinite is as good as the greatest; no number is not.
                check(what, if value == f32::INFINITY { f32::MAX } else { value })?;
            }
        }
        self.anchors.pins = pins;
        Ok(self)
    }

    /// The tissue that an object is, if it is.
    #[must_use]
    pub fn of(object: &Object) -> Option<&Self> {
        let behavior: &dyn Any = &*object.behavior;
        behavior.downcast_ref()
    }

    /// What it is made of.
    #[must_use]
    pub fn material(&self) -> &Material {
        &self.material
    }

    /// The rest shape: where each node is when nothing is strained, in metres.
    #[must_use]
    pub fn rest(&self) -> &[Vec3] {
        &self.rest
    }

    /// The area of the rest shape of these triangles, the mesh's, in square metres.
    #[must_use]
    pub fn rest_area(&self, mesh: &Mesh) -> f64 {
        shape::area(&self.rest, mesh.topology().triangles())
    }

    /// The pins that hold, in no particular order.
    #[must_use]
    pub fn pins(&self) -> &[Pin] {
        &self.anchors.pins
    }

    /// How many nodes a tool holds.
    #[must_use]
    pub fn held_nodes(&self, by: ObjectId) -> usize {
        self.anchors.grip(by).map_or(0, |grip| grip.nodes.len())
    }

    /// The mean force that what a tool holds had on it over the last frame, in newtons.
    #[must_use]
    pub fn held_force(&self, by: ObjectId) -> Vec3 {
        self.anchors.grip(by).map_or(Vec3::ZERO, |grip| grip.force)
    }

    /// The node at which a tool's cut goes on, if its blade is in the tissue.
    #[must_use]
    pub fn cut_front(&self, by: ObjectId) -> Option<u32> {
        self.fronts.iter().find(|front| front.by == by).map(|front| front.node)
    }

    /// A mesh of this topology, with masses from the rest shape, and the springs for it.
    fn join(
        &mut self,
        topology: Topology,
        positions: &[Vec3],
        contact_radius: f32,
    ) -> Result<Mesh, TissueError> {
        let triangles = topology.triangles();
        let bending = shape::bending(&self.rest, triangles, &self.slits)?;
        let masses = shape::masses(&self.rest, triangles, self.material.area_density);
        let is_there = |mass: &f32| *mass > 0.0;
        if let Some(node) = masses.iter().position(|mass| !is_there(mass)) {
            return Err(TissueError::Massless { node });
        }
        let nodes = topology.nodes();
        self.edges = Springs::new(nodes, topology.springs());
        self.bending =
            Springs::new(nodes, if self.material.bending > 0.0 { &bending } else { &[] });
        self.to_center = shape::to_center(&self.rest, &masses);
        self.fitted = 0.0;
        self.digest = shape::digest(&self.rest, triangles, &self.slits);
        Ok(Mesh::new(Arc::new(topology), positions, &masses, contact_radius)?)
    }

    /// Cuts where a tool's blade has been. A cut that cannot be is not made.
    fn cut(&mut self, mesh: &mut Mesh, by: ObjectId, sweep: Sweep) {
        // A pressed blade tells all tissue there is, most of which is far from it.
        let is_near = || Bounds::around(mesh.positions.iter()).overlaps(&sweep.bounds());
        if !self.fits(mesh) || !(self.cut_front(by).is_some() || is_near()) {
            return;
        }
        if let Some(front) = self.fronts.iter_mut().find(|front| front.by == by) {
            front.is_cutting = true;
        }
        let places = self.rest.iter().zip(mesh.positions.iter()).zip(mesh.velocities.iter());
        let node = |((&rest, position), velocity)| CutNode { rest, position, velocity };
        let mut surface = CutSurface {
            nodes: places.map(node).collect(),
            triangles: mesh.topology().triangles().to_vec(),
            slits: self.slits.clone(),
            births: Vec::new(),
            shortest: self.shortest,
        };
        let front = surface.cut(sweep, self.cut_front(by));
        let is_changed = !surface.births.is_empty() || surface.slits != self.slits;
        if is_changed {
            let Ok((new, tissue)) = self.rejoined(mesh, surface) else { return };
            *mesh = new;
            *self = tissue;
        }
        self.fronts.retain(|front| front.by != by);
        self.fronts.extend(front.map(|node| Front { by, node, is_cutting: true }));
    }

    /// This tissue with another surface, and its mesh.
    fn rejoined(&self, mesh: &Mesh, surface: CutSurface) -> Result<(Mesh, Self), TissueError> {
        let CutSurface { nodes, triangles, slits, births, .. } = surface;
        let rest: Vec<Vec3> = nodes.iter().map(|node| node.rest).collect();
        let positions: Vec<Vec3> = nodes.iter().map(|node| node.position).collect();
        let velocities: Vec<Vec3> = nodes.iter().map(|node| node.velocity).collect();
        let joined = edges(&triangles);
        let to_center = mesh.topology().center_rest().is_some();
        let topology = Topology::new(&rest, triangles, &joined, to_center)?;
        let mut tissue = self.clone();
        tissue.rest = rest;
        tissue.slits = slits;
        tissue.anchors.inherit(self.rest.len() as u32, &births);
        let mut mesh = tissue.join(topology, &positions, mesh.contact_radius())?;
        mesh.velocities = Vectors::from_slice(&velocities);
        Ok((mesh, tissue))
    }

    /// Whether the mesh is this tissue's own, which anybody may have replaced.
    fn fits(&self, mesh: &Mesh) -> bool {
        mesh.is_whole() && mesh.topology().nodes() == self.rest.len()
    }

    /// Tells the tools that hold it, or whose blades are in it, what they feel of it.
    fn tell(&self, input: &mut Input<'_>) {
        let hold = |grip: &&Grip| grip.by != ObjectId::HOST && !grip.nodes.is_empty();
        let held = self.anchors.grips.iter().filter(hold);
        let held = held.map(|grip| (grip.by, Felt { held: grip.force, cuts: false }));
        let felt = |front: &Front| (front.by, Felt { held: Vec3::ZERO, cuts: true });
        let cut = self.fronts.iter().map(felt);
        for (by, felt) in held.chain(cut) {
            input.post(by, Message::Custom(Box::new(felt)));
        }
    }

    /// Fits the springs to a substep's time, in seconds.
    fn fit(&mut self, time: f32, mesh: &Mesh) {
        if self.fitted != time {
            self.edges.fit(self.material.stiffness, time, mesh.inverse_masses());
            self.bending.fit(self.material.bending, time, mesh.inverse_masses());
            self.fitted = time;
        }
    }
}

impl Behavior for Tissue {
    fn update(&mut self, geometry: &mut Geometry, input: &mut Input<'_>) {
        self.fronts.retain_mut(|front| std::mem::take(&mut front.is_cutting));
        let Some(mesh) = geometry.as_mesh_mut().filter(|mesh| self.fits(mesh)) else { return };
        input.apply_contacts(mesh);
        let time = input.time_step / self.substeps as f32;
        self.fit(time, mesh);
        self.nodes.load(mesh);
        self.anchors.begin(mesh.inverse_masses(), self.nodes.origin(), time, self.substeps);
        let gravity = if self.weightless { Vec3::ZERO } else { input.gravity };
        let compliance = 1.0 / (self.material.to_center * time * time);
        let is_solid = mesh.topology().center_rest().is_some();
        let to_center = is_solid.then_some(ToCenter { rest: &self.to_center, compliance });
        input.simd.run(Advance {
            nodes: &mut self.nodes,
            springs: [&self.edges.blocks, &self.bending.blocks],
            to_center,
            anchors: &mut self.anchors.list,
            fall: (gravity * time).extend(0.0).to_array(),
            decay: 1.0 / (1.0 + self.material.damping * time),
            time,
            substeps: self.substeps,
        });
        self.nodes.store(mesh);
        self.anchors.end(time, self.substeps);
        self.tell(input);
    }

    fn process(&mut self, message: &Message) {
        match *message {
            Message::Stiffness { between_nodes, to_center } => {
                let material = &mut self.material;
                for (value, new) in
                    [(&mut material.stiffness, between_nodes), (&mut material.to_center, to_center)]
                {
                    if check("the stiffness", new).is_ok() {
                        *value = new;
                    }
                }
                self.fitted = 0.0;
            }
            Message::Damping(damping) if check("the damping", damping).is_ok() => {
                self.material.damping = damping;
            }
            Message::Pull { node, target, stiffness } => {
                let to = Vec3::from_array(target);
                let is_valid = (node as usize) < self.rest.len()
                    && to.is_finite()
                    && check("the stiffness", stiffness).is_ok();
                if is_valid {
                    let (by, strength, force) = (ObjectId::HOST, f32::INFINITY, Vec3::ZERO);
                    let nodes = vec![(node, Vec3::ZERO)];
                    let grip = Grip { by, from: to, to, stiffness, strength, nodes, force };
                    self.anchors.take(grip);
                }
            }
            Message::Release => self.anchors.let_go(ObjectId::HOST),
            Message::Weightless(weightless) => self.weightless = weightless,
            _ => {}
        }
    }

    fn hash_state(&self, hasher: &mut dyn Hasher) {
        let Material { stiffness, bending, to_center, damping, area_density } = self.material;
        for value in [stiffness, bending, to_center, damping, area_density, self.shortest] {
            hasher.write(&value.to_le_bytes());
        }
        hasher.write(&self.substeps.to_le_bytes());
        hasher.write(&[u8::from(self.weightless)]);
        hasher.write(&self.digest.to_le_bytes());
        for Front { by, node, .. } in &self.fronts {
            hasher.write(&by.0.to_le_bytes());
            hasher.write(&node.to_le_bytes());
        }
        self.anchors.hash_state(hasher);
    }
}
