//! Mass–spring bodies whose springs a graphics device integrates.

mod integrator;

use std::any::Any;
use std::hash::Hasher;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use dualframe_sim::behavior::{Behavior, Input, MassSpring, Springs};
use dualframe_sim::geometry::{Geometry, Mesh, Topology};
use dualframe_sim::message::Message;
use dualframe_sim::object::Object;
use wgpu::{Buffer, CommandEncoder};

use self::integrator::Body;
pub(crate) use self::integrator::Integrator;
use crate::auxiliary::{Auxiliary, Context, GpuUnit, Units};
use crate::error::GraphicsError;

/// A mass–spring body whose springs the graphics device integrates between two updates.
///
/// A frame's update ends where [`MassSpring::begin`] does: contacts and pulls have changed the
/// velocities, and dashpots, springs and gravity are left. They go to the device as a unit of GPU work,
/// which is run when the object is rendered, and their outcome is there when the next update begins. So
/// no update waits for the device; and what is drawn, touched and hashed is the body before the springs
/// of the frame, one frame's motion behind that of a [`MassSpring`].
///
/// What the device did not integrate, the next update does by the processor, to the very bits of
/// [`Springs::advance`]: if the object was not drawn, or only a copy of it was (as by
/// [`RayonOverlappedExecutor`]), if a message changed the body in between, or if the device fails. The
/// device adds up in another order and may divide less exactly: in 240 frames of free vibration, falling
/// and contacts a particle's nodes stay within 10 µm of the processor's. Results are the same for any
/// number of threads as long as the device is the same, its driver too.
///
/// One workgroup of 256 invocations integrates a body, whatever its size; different bodies at once.
///
/// [`RayonOverlappedExecutor`]: dualframe_sim::executor::RayonOverlappedExecutor
pub struct GpuMassSpring {
    own: MassSpring,
    auxiliary: Auxiliary,
    /// What the last update left to be done.
    left: Option<Springs>,
    slot: Arc<Mutex<Slot>>,
}

impl GpuMassSpring {
    /// Moves a body as `springs` would, by the device behind [`Painter::auxiliary`].
    ///
    /// [`Painter::auxiliary`]: crate::renderer::Painter::auxiliary
    #[must_use]
    pub fn new(springs: MassSpring, auxiliary: Auxiliary) -> Self {
        Self { own: springs, auxiliary, left: None, slot: Arc::default() }
    }

    /// The behaviour of an object, if it is one of these.
    pub(crate) fn of(object: &Object) -> Option<&Self> {
        let behavior: &dyn Any = &*object.behavior;
        behavior.downcast_ref()
    }

    /// Runs what waits for the device, so that the next update finds the outcome. By whoever renders the
    /// object.
    pub(crate) fn integrate(&self, context: &Context<'_>, units: &mut Units) {
        units.run_now(context);
        if !lock(&self.slot).hand_over() {
            // The queue was full when it was updated.
            self.submit();
            units.run_now(context);
            lock(&self.slot).hand_over();
        }
    }

    fn submit(&self) {
        let turn = lock(&self.slot).turn;
        // From a full queue the unit comes back; who renders the object submits another.
        let _ = self.auxiliary.submit(Box::new(Unit { slot: Arc::clone(&self.slot), turn }));
    }
}

impl Behavior for GpuMassSpring {
    fn update(&mut self, geometry: &mut Geometry, input: &mut Input<'_>) {
        let Some(mesh) = geometry.as_mesh_mut() else { return };
        if let Some(springs) = self.left.take()
            && !lock(&self.slot).take(mesh)
        {
            springs.advance(mesh, input);
        }
        let springs = self.own.begin(mesh, input);
        self.left = Some(springs);
        lock(&self.slot).put(mesh, springs);
        self.submit();
    }

    fn process(&mut self, message: &Message) {
        self.own.process(message);
    }

    fn hash_state(&self, hasher: &mut dyn Hasher) {
        self.own.hash_state(hasher);
        let Some(left) = self.left else { return };
        for value in [left.damping, left.stiffness, left.center_stiffness, left.time]
            .into_iter()
            .chain(left.gravity)
        {
            hasher.write(&value.to_le_bytes());
        }
        hasher.write(&left.substeps.to_le_bytes());
    }
}

/// What a behaviour and its units share.
#[derive(Default)]
struct Slot {
    /// The number of the update that put something here last, so that no unit serves a later one.
    turn: u64,
    task: Option<Task>,
    /// What is to be integrated: positions, velocities and masses, by components.
    nodes: Vec<f32>,
    progress: Progress,
    /// The positions and velocities integrated, by components.
    integrated: Vec<f32>,
    body: Option<Body>,
}

/// What is to be done for the nodes.
struct Task {
    topology: Arc<Topology>,
    springs: Springs,
}

/// How far what was put last has come.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Progress {
    #[default]
    Waiting,
    Integrated,
    /// Integrated, and the object was rendered after its update: not before then does the outcome
    /// count, so that it never depends on who was faster whether it does.
    HandedOver,
}

impl Slot {
    /// Leaves a body to be integrated.
    fn put(&mut self, mesh: &Mesh, springs: Springs) {
        self.turn += 1;
        self.progress = Progress::Waiting;
        self.task = Some(Task { topology: Arc::clone(mesh.topology()), springs });
        self.nodes.clear();
        numbers(mesh).for_each(|list| self.nodes.extend_from_slice(list));
    }

    /// Gives the body what became of it, if that was handed over and nobody changed the body meanwhile.
    fn take(&mut self, mesh: &mut Mesh) -> bool {
        let Some(task) = self.task.take() else { return false };
        if self.progress != Progress::HandedOver || !Arc::ptr_eq(&task.topology, mesh.topology()) {
            return false;
        }
        let mut rest = self.nodes.as_slice();
        let unchanged = numbers(mesh).all(|list| {
            let Some((then, others)) = rest.split_at_checked(list.len()) else { return false };
            rest = others;
            then == list
        });
        if !unchanged {
            return false;
        }
        let mut integrated = self.integrated.as_slice();
        for vectors in [&mut mesh.positions, &mut mesh.velocities] {
            for component in vectors.as_mut_slices() {
                let (own, others) = integrated.split_at(component.len());
                component.copy_from_slice(own);
                integrated = others;
            }
        }
        true
    }

    /// Lets the next update take what was integrated; says whether there is something.
    fn hand_over(&mut self) -> bool {
        if self.progress == Progress::Integrated {
            self.progress = Progress::HandedOver;
        }
        self.progress == Progress::HandedOver
    }
}

/// Positions, velocities and masses, by components.
fn numbers(mesh: &Mesh) -> impl Iterator<Item = &[f32]> {
    let vectors = [&mesh.positions, &mesh.velocities].into_iter();
    vectors.flat_map(|vectors| vectors.as_slices()).chain([mesh.masses()])
}

fn lock(slot: &Mutex<Slot>) -> MutexGuard<'_, Slot> {
    slot.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Has the device integrate what an update put into its slot.
struct Unit {
    slot: Arc<Mutex<Slot>>,
    turn: u64,
}

impl GpuUnit for Unit {
    fn encode(&mut self, context: &Context<'_>, encoder: &mut CommandEncoder) -> Option<Buffer> {
        let mut slot = lock(&self.slot);
        if slot.turn != self.turn || slot.progress != Progress::Waiting {
            return None;
        }
        let Slot { task, nodes, body, .. } = &mut *slot;
        context.integrator.encode(context.gpu, task.as_ref()?, nodes, body, encoder)
    }

    fn finish(self: Box<Self>, _context: &Context<'_>, results: Result<&[u8], GraphicsError>) {
        let mut slot = lock(&self.slot);
        // Without results the processor integrates.
        let Ok(bytes) = results else { return };
        if slot.turn == self.turn {
            slot.integrated.clear();
            slot.integrated.extend(bytemuck::cast_slice::<u8, f32>(bytes));
            slot.progress = Progress::Integrated;
        }
    }
}
