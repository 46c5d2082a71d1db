//! Surfaces of deformable bodies and rigid shapes.
//!
//! A deformable body's state is all that is sent: its nodes' positions as they are in memory, in one
//! copy. Vertices fetch them by number and make their normals from their neighbours, so that updates
//! have nothing to write for the renderer.

mod layouts;
mod make;
mod pipelines;

use std::collections::HashMap;
use std::sync::Arc;

use bytemuck::Pod;
use dualframe_sim::geometry::{Mesh, Rigid, Vectors};
use dualframe_sim::object::{Drawing, Object};
use wgpu::{
    BindGroup, Buffer, BufferDescriptor, BufferUsages, Device, Queue, RenderPass, RenderPipeline,
};

pub(crate) use self::layouts::Layouts;
pub(crate) use self::make::Instance;
use self::make::{Indices, Make};
use self::pipelines::Pipelines;
pub(crate) use self::pipelines::{INSTANCES, SHADOW};
use crate::error::GraphicsError;
use crate::look::Coloring;
use crate::target::Format;

/// Frames after which what is no longer drawn is forgotten: surfaces that are cut get a new make with
/// every cut.
pub(crate) const KEPT_FRAMES: u64 = 600;

/// The surfaces of a frame.
pub(crate) struct Surfaces {
    pipelines: Pipelines,
    makes: Vec<Make>,
    /// The makes by where their likeness is in memory; `None` for shapes that have no surface.
    by_address: HashMap<usize, Option<usize>>,
    numbers: List<f32>,
    instances: List<Instance>,
    bound_numbers: BindGroup,
    frame: u64,
}

impl Surfaces {
    pub(crate) fn new(device: &Device, layouts: &Layouts, format: Format) -> Self {
        let numbers = List::new(device, "numbers", BufferUsages::STORAGE);
        Self {
            pipelines: Pipelines::new(device, layouts, format),
            makes: Vec::new(),
            by_address: HashMap::new(),
            bound_numbers: layouts.list(device, &numbers.buffer),
            numbers,
            instances: List::new(device, "instances", BufferUsages::VERTEX),
            frame: 0,
        }
    }

    /// Forgets the last frame's bodies.
    pub(crate) fn clear(&mut self) {
        self.frame += 1;
        self.numbers.staged.clear();
        for make in &mut self.makes {
            make.surfaces.clear();
            make.wires.clear();
        }
        let oldest = self.frame.saturating_sub(KEPT_FRAMES);
        if self.makes.iter().any(|make| make.used < oldest) {
            self.makes.retain(|make| make.used >= oldest);
            // Found again at their next drawing.
            self.by_address.clear();
            let addresses = self.makes.iter().map(Make::address).enumerate();
            self.by_address.extend(addresses.map(|(index, address)| (address, Some(index))));
        }
    }

    /// Adds a deformable body.
    pub(crate) fn add_mesh(
        &mut self,
        device: &Device,
        layouts: &Layouts,
        object: &Object,
        mesh: &Mesh,
        coloring: Coloring,
    ) {
        let topology = mesh.topology();
        if mesh.positions.len() != topology.nodes() {
            return;
        }
        let address = Arc::as_ptr(topology).addr();
        let make = self.make(address, || Some(Make::deformable(device, layouts, topology)));
        let Some(make) = make else { return };
        let first = self.numbers.staged.len() as u32;
        self.stage(&mesh.positions);
        if coloring == Coloring::Speed {
            self.stage(&mesh.velocities);
        }
        self.add(make, object, first, [0.0, 0.0, 0.0, 1.0], [0.0; 3]);
    }

    /// Adds a rigid shape. One without bounds is not drawn.
    pub(crate) fn add_rigid(
        &mut self,
        device: &Device,
        layouts: &Layouts,
        object: &Object,
        rigid: &Rigid,
    ) {
        let address = Arc::as_ptr(&rigid.shape.0).addr();
        let make = self.make(address, || Make::rigid(device, layouts, &rigid.shape));
        let Some(make) = make else { return };
        let (turned, place) = (rigid.pose.rotation.to_array(), rigid.pose.translation.to_array());
        self.add(make, object, 0, turned, place);
    }

    fn make(&mut self, address: usize, new: impl FnOnce() -> Option<Make>) -> Option<usize> {
        let known = self.by_address.entry(address).or_insert_with(|| {
            new().map(|make| {
                self.makes.push(make);
                self.makes.len() - 1
            })
        });
        *known
    }

    fn stage(&mut self, vectors: &Vectors) {
        for component in vectors.as_slices() {
            self.numbers.staged.extend_from_slice(component);
        }
    }

    fn add(
        &mut self,
        make: usize,
        object: &Object,
        first: u32,
        rotation: [f32; 4],
        place: [f32; 3],
    ) {
        let make = &mut self.makes[make];
        let (color, nodes) = (object.visual.color, make.nodes);
        let instance = Instance { rotation, place, first, color, nodes, object: object.id().0 };
        make.used = self.frame;
        match object.drawing {
            Drawing::Edges => make.wires.push(instance),
            Drawing::Surface | Drawing::Hidden => make.surfaces.push(instance),
        }
    }

    /// Sends this frame's bodies to the device.
    ///
    /// # Errors
    /// More than the device's buffers hold.
    pub(crate) fn upload(
        &mut self,
        device: &Device,
        queue: &Queue,
        layouts: &Layouts,
    ) -> Result<(), GraphicsError> {
        self.instances.staged.clear();
        for make in &self.makes {
            self.instances.staged.extend_from_slice(&make.surfaces);
            self.instances.staged.extend_from_slice(&make.wires);
        }
        if self.numbers.upload(device, queue)? {
            self.bound_numbers = layouts.list(device, &self.numbers.buffer);
        }
        self.instances.upload(device, queue)?;
        Ok(())
    }

    /// Draws the bodies' shadows into a shadow map.
    pub(crate) fn cast(&self, pass: &mut RenderPass<'_>, globals: &BindGroup) {
        self.paint_with(pass, &self.pipelines.shadows, globals);
    }

    /// Draws the bodies.
    pub(crate) fn paint(&self, pass: &mut RenderPass<'_>, lit: &BindGroup) {
        pass.set_bind_group(0, lit, &[]);
        self.each(|batch| {
            pass.set_pipeline(match batch.make {
                _ if batch.are_wires => &self.pipelines.edges,
                make if make.is_open => &self.pipelines.open,
                _ => &self.pipelines.closed,
            });
            pass.set_bind_group(1, batch.numbers, &[]);
            pass.set_bind_group(2, &batch.make.rings, &[]);
            batch.draw(pass);
        });
    }

    /// Draws the bodies' surfaces by a pipeline of the caller's, which knows globals and numbers.
    pub(crate) fn paint_with(
        &self,
        pass: &mut RenderPass<'_>,
        pipeline: &RenderPipeline,
        globals: &BindGroup,
    ) {
        pass.set_pipeline(pipeline);
        pass.set_bind_group(0, globals, &[]);
        self.each(|batch| {
            if !batch.are_wires {
                pass.set_bind_group(1, batch.numbers, &[]);
                batch.draw(pass);
            }
        });
    }

    /// This frame's body of an object, and its nodes' positions as x, y and z.
    pub(crate) fn find(&self, object: u32) -> Option<(&Instance, [&[f32]; 3])> {
        let bodies = self.makes.iter().flat_map(|make| &make.surfaces);
        let body = bodies.into_iter().find(|body| body.object == object)?;
        let (first, nodes) = (body.first as usize, body.nodes as usize);
        let all = self.numbers.staged.get(first..first + 3 * nodes)?;
        let (x, rest) = all.split_at(nodes);
        let (y, z) = rest.split_at(nodes);
        Some((body, [x, y, z]))
    }

    /// The number of bodies in this frame.
    pub(crate) fn count(&self) -> usize {
        self.makes.iter().map(|make| make.surfaces.len() + make.wires.len()).sum()
    }

    /// Bodies that are drawn by one call.
    fn each<'a>(&'a self, mut draw: impl FnMut(Batch<'a>)) {
        let mut first = 0;
        for make in &self.makes {
            let numbers = make.own_numbers.as_ref().unwrap_or(&self.bound_numbers);
            let lists = [(&make.surfaces, &make.triangles), (&make.wires, &make.edges)];
            for (are_wires, (list, indices)) in [false, true].into_iter().zip(lists) {
                if !list.is_empty() {
                    let instances = &self.instances.buffer;
                    let count = list.len();
                    draw(Batch { make, numbers, indices, instances, first, count, are_wires });
                }
                first += list.len();
            }
        }
    }
}

/// Bodies that are drawn by one call.
struct Batch<'a> {
    make: &'a Make,
    numbers: &'a BindGroup,
    indices: &'a Indices,
    instances: &'a Buffer,
    first: usize,
    count: usize,
    are_wires: bool,
}

impl Batch<'_> {
    fn draw(&self, pass: &mut RenderPass<'_>) {
        let size = size_of::<Instance>();
        let (begin, end) = (self.first * size, (self.first + self.count) * size);
        pass.set_vertex_buffer(0, self.instances.slice(begin as u64..end as u64));
        pass.set_index_buffer(self.indices.buffer.slice(..), wgpu::IndexFormat::Uint32);
        pass.draw_indexed(0..self.indices.count, 0, 0..self.count as u32);
    }
}

/// A list that is sent anew every frame.
struct List<T> {
    staged: Vec<T>,
    buffer: Buffer,
    usage: BufferUsages,
    label: &'static str,
}

impl<T: Pod> List<T> {
    /// A storage buffer may not be empty.
    const LEAST: u64 = 4_096;

    fn new(device: &Device, label: &'static str, usage: BufferUsages) -> Self {
        let buffer = Self::buffer(device, label, usage, Self::LEAST);
        Self { staged: Vec::new(), buffer, usage, label }
    }

    fn buffer(device: &Device, label: &str, usage: BufferUsages, size: u64) -> Buffer {
        device.create_buffer(&BufferDescriptor {
            label: Some(label),
            size,
            usage: usage | BufferUsages::COPY_DST,
            mapped_at_creation: false,
        })
    }

    /// Sends the list; says whether the buffer is a new one.
    fn upload(&mut self, device: &Device, queue: &Queue) -> Result<bool, GraphicsError> {
        let bytes: &[u8] = bytemuck::cast_slice(&self.staged);
        let (needed, limits) = (bytes.len() as u64, device.limits());
        let most = limits.max_buffer_size.min(limits.max_storage_buffer_binding_size);
        if needed > most {
            return Err(GraphicsError::Frame { needed, most });
        }
        let grows = needed > self.buffer.size();
        if grows {
            let size = needed.next_power_of_two().min(most);
            self.buffer = Self::buffer(device, self.label, self.usage, size);
        }
        if !bytes.is_empty() {
            queue.write_buffer(&self.buffer, 0, bytes);
        }
        Ok(grows)
    }
}
