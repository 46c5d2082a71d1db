//! Mass–spring bodies whose springs a graphics device integrates.

mod integrator;
#[cfg(test)]
mod tests;

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
/// no update waits for the device.
///
/// Until then the mesh has predicted positions, and those are drawn and touched: where its nodes come
/// if the springs change their velocities as in the frame before. Contacts with where a body was a frame
/// ago would act like negative damping, and throw everything about.
///
/// What the device did not integrate, the next update does by the processor, as [`Springs::advance`]:
/// if the object was not drawn, or only a copy of it was (as by [`RayonOverlappedExecutor`]), if somebody
/// changed the mesh's numbers in between, or if the device fails. If the mesh has another topology by then, as a cut one
/// has, what was left of its last frame is dropped. The device adds up in another order and may
/// divide less exactly: in 240 frames of vibration, falling and contacts a particle's nodes stay within
/// 10 µm of the processor's. Results are the same for any number of threads as long as the device is the
/// same, its driver too, and whoever renders gives a [`Painter`] every frame.
///
/// So this is the exception to what [`Settings`] promises: the state's hash is another one without pictures, or with an
/// executor that draws copies. A session that was recorded with pictures comes to a [`Difference`] in a replay without.
///
/// [`Painter`]: crate::renderer::Painter
/// [`Settings`]: dualframe_sim::manager::Settings
/// [`Difference`]: dualframe_sim::record::Difference
///
/// One workgroup of 256 invocations integrates a body, whatever its size; different bodies at once, up to 256 that were
/// updated before the first of them is drawn: for each one more, whoever draws it waits for the device.
///
/// [`RayonOverlappedExecutor`]: dualframe_sim::executor::RayonOverlappedExecutor
pub struct GpuMassSpring {
    own: MassSpring,
    auxiliary: Auxiliary,
    /// What the last update left to be done.
    left: Option<Springs>,
    /// What the mesh had after the last update: positions as predicted, velocities, masses, by
    /// components.
    predicted: Vec<f32>,
    /// By how much the springs changed the velocities in the frame before, by components.
    gained: Vec<f32>,
    frames_by_device: u64,
    slot: Arc<Mutex<Slot>>,
}

impl GpuMassSpring {
    /// Moves a body as `springs` would, by the device behind [`Painter::auxiliary`].
    ///
    /// [`Painter::auxiliary`]: crate::renderer::Painter::auxiliary
    #[must_use]
    pub fn new(springs: MassSpring, auxiliary: Auxiliary) -> Self {
        Self {
            own: springs,
            auxiliary,
            left: None,
            predicted: Vec::new(),
            gained: Vec::new(),
            frames_by_device: 0,
            slot: Arc::default(),
        }
    }

    /// The number of frames so far whose springs the device integrated.
    #[must_use]
    pub fn frames_by_device(&self) -> u64 {
        self.frames_by_device
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

    /// Makes the mesh what the springs of the last frame made of it.
    fn end_frame(&mut self, mesh: &mut Mesh, input: &mut Input<'_>) {
        let mut slot = lock(&self.slot);
        let Some(springs) = self.left.take().filter(|_| slot.is_of(mesh)) else {
            self.gained.clear();
            self.gained.resize(3 * mesh.velocities.len(), 0.0);
            return;
        };
        let is_changed = slot.restore(mesh, &self.predicted);
        self.gained.clear();
        mesh.velocities.as_slices().iter().for_each(|list| self.gained.extend_from_slice(list));
        if !is_changed && slot.take(mesh) {
            self.frames_by_device += 1;
        } else {
            drop(slot);
            springs.advance(mesh, input);
        }
        let after = mesh.velocities.as_slices().into_iter().flatten();
        for (gained, after) in self.gained.iter_mut().zip(after) {
            *gained = after - *gained;
        }
    }

    /// Moves the nodes to where they will probably be in `time` seconds.
    fn predict(&mut self, mesh: &mut Mesh, time: f32) {
        let [x, y, z, u, v, w] = components(mesh);
        let mut gained = self.gained.iter();
        for (positions, velocities) in [(x, u), (y, v), (z, w)] {
            for ((position, velocity), gained) in
                positions.iter_mut().zip(velocities).zip(&mut gained)
            {
                *position += (*velocity + gained) * time;
            }
        }
        self.predicted.clear();
        numbers(mesh).for_each(|list| self.predicted.extend_from_slice(list));
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
        self.end_frame(mesh, input);
        let springs = self.own.begin(mesh, input);
        self.left = Some(springs);
        lock(&self.slot).put(mesh, springs);
        self.predict(mesh, springs.time);
        self.submit();
    }

    fn process(&mut self, message: &Message) {
        self.own.process(message);
    }

    fn hash_state(&self, hasher: &mut dyn Hasher) {
        self.own.hash_state(hasher);
        let Some(left) = self.left else { return };
        let Springs { damping, stiffness, center_stiffness, gravity, time, substeps } = left;
        hasher.write(&substeps.to_le_bytes());
        let slot = lock(&self.slot);
        let own = [damping, stiffness, center_stiffness, time].into_iter().chain(gravity);
        own.chain(slot.nodes.iter().copied()).for_each(|value| hasher.write(&value.to_le_bytes()));
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
    Taken,
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

    /// Whether what was put last is this body.
    fn is_of(&self, mesh: &Mesh) -> bool {
        let masses = mesh.masses();
        self.nodes.len() == 7 * masses.len()
            && self.nodes.ends_with(masses)
            && [&mesh.positions, &mesh.velocities].iter().all(|list| list.len() == masses.len())
            && self.task.as_ref().is_some_and(|task| Arc::ptr_eq(&task.topology, mesh.topology()))
    }

    /// Gives the body the state that was put here instead of the one `predicted` from it. If somebody
    /// changed that, it is changed by as much, and the return value is `true`.
    fn restore(&self, mesh: &mut Mesh, predicted: &[f32]) -> bool {
        let mut is_changed = false;
        let now = components(mesh).into_iter().flatten();
        for ((now, put), predicted) in now.zip(&self.nodes).zip(predicted) {
            let change = *now - predicted;
            is_changed |= change != 0.0;
            *now = put + change;
        }
        is_changed
    }

    /// Notes what became of the body that was put here in a turn.
    fn receive(&mut self, turn: u64, bytes: &[u8]) {
        let (numbers, _) = bytes.as_chunks();
        let is_awaited = turn == self.turn && self.progress == Progress::Waiting;
        if is_awaited && 7 * numbers.len() == 6 * self.nodes.len() {
            self.integrated.clear();
            self.integrated.extend(numbers.iter().map(|&number| f32::from_ne_bytes(number)));
            self.progress = Progress::Integrated;
        }
    }

    /// Gives the body what became of it, if that was handed over and not taken yet.
    fn take(&mut self, mesh: &mut Mesh) -> bool {
        if self.progress != Progress::HandedOver {
            return false;
        }
        self.progress = Progress::Taken;
        let now = components(mesh).into_iter().flatten();
        now.zip(&self.integrated).for_each(|(now, integrated)| *now = *integrated);
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

/// Positions and velocities, by components.
fn components(mesh: &mut Mesh) -> [&mut [f32]; 6] {
    let Mesh { positions, velocities, .. } = mesh;
    let ([x, y, z], [u, v, w]) = (positions.as_mut_slices(), velocities.as_mut_slices());
    [x, y, z, u, v, w]
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
        // Without results the processor integrates.
        if let Ok(bytes) = results {
            lock(&self.slot).receive(self.turn, bytes);
        }
    }
}
