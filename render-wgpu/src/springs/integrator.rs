//! The device's side of mass–spring bodies.

use std::cell::{OnceCell, RefCell};
use std::collections::HashMap;
use std::sync::{Arc, Weak};

use bytemuck::{Pod, Zeroable};
use dualframe_sim::behavior::Springs;
use dualframe_sim::geometry::Topology;
use wgpu::{
    BindGroup, BindGroupDescriptor, BindGroupEntry, Buffer, BufferDescriptor, BufferUsages,
    CommandEncoder, ComputePipeline, ComputePipelineDescriptor, Device, DownlevelFlags,
    ShaderModuleDescriptor, ShaderSource,
};

use super::Task;
use crate::gpu::Gpu;

/// Invocations that integrate a body together; as `springs.wgsl` has it.
const WORKGROUP: u32 = 256;
/// Numbers of a node that are sent: position, velocity, mass.
const SENT: usize = 7;
/// Numbers of a node that come back: position, velocity.
const RETURNED: usize = 6;

/// What the shader reads; the layout of `Numbers` in `springs.wgsl`.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct Numbers {
    gravity: [f32; 3],
    nodes: u32,
    stiffness: f32,
    center_stiffness: f32,
    damping: f32,
    time: f32,
    step_time: f32,
    substeps: u32,
    has_center: u32,
    padding: u32,
}

impl Numbers {
    fn new(Task { topology, springs }: &Task) -> Self {
        let Springs { damping, stiffness, center_stiffness, gravity, time, substeps } = *springs;
        Self {
            gravity,
            nodes: topology.nodes() as u32,
            stiffness,
            center_stiffness,
            damping,
            time,
            step_time: springs.step_time(),
            substeps,
            has_center: u32::from(topology.center_rest().is_some()),
            padding: 0,
        }
    }
}

/// Integrates mass–spring bodies.
#[derive(Default)]
pub(crate) struct Integrator {
    /// Made for the first body.
    pipeline: OnceCell<ComputePipeline>,
    /// What the bodies of a topology are joined by, by where it is in memory.
    tables: RefCell<HashMap<usize, (Weak<Topology>, Buffer)>>,
}

impl Integrator {
    /// Encodes a frame of a body, of which `nodes` are the numbers and `body` what it has on the device
    /// already. Returns where its positions and velocities will be, or nothing if this device cannot do
    /// it.
    pub(super) fn encode(
        &self,
        gpu: &Gpu,
        task: &Task,
        nodes: &[f32],
        body: &mut Option<Body>,
        encoder: &mut CommandEncoder,
    ) -> Option<Buffer> {
        let Gpu { device, queue, .. } = gpu;
        let count = task.topology.nodes();
        if nodes.len() != SENT * count || !fits(gpu, &task.topology) {
            return None;
        }
        let pipeline = self.pipeline.get_or_init(|| pipeline(device));
        let address = Arc::as_ptr(&task.topology).addr();
        if body.as_ref().is_some_and(|body| Weak::as_ptr(&body.topology).addr() != address) {
            *body = None;
        }
        let body = body.get_or_insert_with(|| {
            Body::new(device, pipeline, &task.topology, &self.table(gpu, &task.topology))
        });
        queue.write_buffer(&body.numbers, 0, bytemuck::bytes_of(&Numbers::new(task)));
        queue.write_buffer(&body.state, 0, bytemuck::cast_slice(nodes));
        let mut pass = encoder.begin_compute_pass(&Default::default());
        pass.set_pipeline(pipeline);
        pass.set_bind_group(0, &body.group, &[]);
        pass.dispatch_workgroups(1, 1, 1);
        drop(pass);
        let steps = task.springs.substeps + u32::from(task.springs.damping > 0.0);
        // Every step but the first reads what the last one wrote.
        let written = if steps.is_multiple_of(2) { 0 } else { bytes(SENT * count) };
        let size = body.results.size();
        encoder.copy_buffer_to_buffer(&body.state, written, &body.results, 0, size);
        Some(body.results.clone())
    }

    fn table(&self, gpu: &Gpu, topology: &Arc<Topology>) -> Buffer {
        let mut tables = self.tables.borrow_mut();
        // An address that is still known to be in use is not given to another.
        let address = Arc::as_ptr(topology).addr();
        if let Some((_, table)) = tables.get(&address) {
            return table.clone();
        }
        tables.retain(|_, (known, _)| known.strong_count() > 0);
        let neighbours = neighbour_table(topology);
        let neighbours = bytemuck::cast_slice(&neighbours);
        let table = gpu.buffer("springs", neighbours, BufferUsages::STORAGE);
        tables.insert(address, (Arc::downgrade(topology), table.clone()));
        table
    }
}

/// Whether a body can be integrated by a device: there are nodes, compute shaders of so many invocations, and
/// buffers that hold it.
fn fits(gpu: &Gpu, topology: &Topology) -> bool {
    let limits = gpu.device.limits();
    let most = limits.max_buffer_size.min(limits.max_storage_buffer_binding_size);
    let largest = bytes(table_len(topology)).max(bytes((SENT + RETURNED) * topology.nodes()));
    let flags = gpu.adapter().get_downlevel_capabilities().flags;
    let invocations =
        limits.max_compute_workgroup_size_x.min(limits.max_compute_invocations_per_workgroup);
    topology.nodes() > 0
        && flags.contains(DownlevelFlags::COMPUTE_SHADERS)
        && invocations >= WORKGROUP
        && largest <= most
}

/// The size of so many numbers, in bytes.
fn bytes(numbers: usize) -> u64 {
    (numbers * size_of::<f32>()) as u64
}

fn table_len(topology: &Topology) -> usize {
    let nodes = topology.nodes();
    nodes + 1 + 4 * topology.springs().len() + topology.center_rest().map_or(0, <[f32]>::len)
}

/// The `table` of `springs.wgsl`. A node's springs are in the order in which the topology lists them.
fn neighbour_table(topology: &Topology) -> Vec<u32> {
    let mut neighbours = vec![Vec::new(); topology.nodes()];
    for spring in topology.springs() {
        let ([a, b], rest) = (spring.nodes, spring.rest.to_bits());
        neighbours[a as usize].push([b, rest]);
        neighbours[b as usize].push([a, rest]);
    }
    let mut table = Vec::with_capacity(table_len(topology));
    let mut begin = topology.nodes() as u32 + 1;
    table.push(begin);
    for own in &neighbours {
        begin += own.as_flattened().len() as u32;
        table.push(begin);
    }
    table.extend(neighbours.iter().flatten().flatten());
    table.extend(topology.center_rest().unwrap_or_default().iter().map(|rest| rest.to_bits()));
    table
}

/// What one body has on the device.
pub(super) struct Body {
    /// Kept, so that its address stays its own.
    topology: Weak<Topology>,
    numbers: Buffer,
    state: Buffer,
    results: Buffer,
    group: BindGroup,
}

impl Body {
    fn new(
        device: &Device,
        pipeline: &ComputePipeline,
        topology: &Arc<Topology>,
        table: &Buffer,
    ) -> Self {
        let nodes = topology.nodes();
        let buffer = |size, usage| {
            let label = Some("mass–spring body");
            device.create_buffer(&BufferDescriptor {
                label,
                size,
                usage,
                mapped_at_creation: false,
            })
        };
        let numbers =
            buffer(size_of::<Numbers>() as u64, BufferUsages::STORAGE | BufferUsages::COPY_DST);
        let both = BufferUsages::COPY_DST | BufferUsages::COPY_SRC;
        let state = buffer(bytes((SENT + RETURNED) * nodes), BufferUsages::STORAGE | both);
        let results = BufferUsages::MAP_READ | BufferUsages::COPY_DST;
        let entries = [(0, table), (1, &numbers), (2, &state)].map(|(binding, buffer)| {
            BindGroupEntry { binding, resource: buffer.as_entire_binding() }
        });
        Self {
            topology: Arc::downgrade(topology),
            group: device.create_bind_group(&BindGroupDescriptor {
                label: Some("mass–spring body"),
                layout: &pipeline.get_bind_group_layout(0),
                entries: &entries,
            }),
            results: buffer(bytes(RETURNED * nodes), results),
            numbers,
            state,
        }
    }
}

fn pipeline(device: &Device) -> ComputePipeline {
    let shader = device.create_shader_module(ShaderModuleDescriptor {
        label: Some("springs"),
        source: ShaderSource::Wgsl(include_str!("../shaders/springs.wgsl").into()),
    });
    device.create_compute_pipeline(&ComputePipelineDescriptor {
        label: Some("springs"),
        layout: None,
        module: &shader,
        entry_point: Some("advance_frame"),
        compilation_options: Default::default(),
        cache: None,
    })
}
