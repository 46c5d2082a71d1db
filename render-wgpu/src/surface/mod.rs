//! Surfaces of deformable bodies and rigid shapes.
//!
//! A deformable body's state is all that is sent: its nodes' positions as they are in memory, in one
//! copy to where the device takes it from. Vertices fetch them by number and make their normals from their neighbours, so that updates
//! have nothing to write for the renderer.

mod frame_buffer;
mod layouts;
mod make;
mod pipelines;

use std::collections::HashMap;
use std::sync::Arc;

use dualframe_sim::geometry::{Mesh, Rigid, Vectors};
use dualframe_sim::object::{Drawing, Object};
use parry3d::shape::SharedShape;
use wgpu::{
    BindGroup, Buffer, BufferSlice, CommandEncoder, Device, Queue, RenderPass, RenderPipeline,
};

use self::frame_buffer::FrameBuffer;
pub(crate) use self::frame_buffer::GLOBALS;
pub(crate) use self::layouts::Layouts;
pub(crate) use self::make::Instance;
use self::make::{Indices, Make};
use self::pipelines::Pipelines;
pub(crate) use self::pipelines::{INSTANCES, SHADOW};
use crate::error::GraphicsError;
use crate::gpu::Gpu;
use crate::look::Coloring;
use crate::target::Format;

/// Frames after which what is no longer drawn is forgotten. What nobody else has any more, as of a surface that gets a
/// new make with every cut the old one, is at once.
pub(crate) const KEPT_FRAMES: u64 = 600;

/// What a body does as a whole: how it is turned, where it is and how fast it goes.
struct Motion {
    turned: [f32; 4],
    place: [f32; 3],
    velocity: [f32; 3],
}

/// The surfaces of a frame.
pub(crate) struct Surfaces {
    pipelines: Pipelines,
    makes: Vec<Make>,
    /// The makes by where their likeness is in memory; `None` for shapes that have no surface.
    by_address: HashMap<usize, Option<usize>>,
    /// Those shapes, kept so that their addresses stay their own.
    without_surface: Vec<SharedShape>,
    sent: FrameBuffer,
    /// Where in it the instances begin, in bytes.
    instances: usize,
    frame: u64,
}

impl Surfaces {
    pub(crate) fn new(device: &Device, layouts: &Layouts, format: Format) -> Self {
        Self {
            pipelines: Pipelines::new(device, layouts, format),
            makes: Vec::new(),
            by_address: HashMap::new(),
            without_surface: Vec::new(),
            sent: FrameBuffer::new(device, layouts),
            instances: 0,
            frame: 0,
        }
    }

    /// Forgets the last frame's bodies.
    pub(crate) fn clear(&mut self, queue: &Queue) {
        self.frame += 1;
        self.sent.begin(queue);
        for make in &mut self.makes {
            make.surfaces.clear();
            make.wires.clear();
        }
        let oldest = self.frame.saturating_sub(KEPT_FRAMES);
        let is_kept = |make: &Make| make.used >= oldest && !make.is_gone();
        let is_known = |shape: &SharedShape| Arc::strong_count(&shape.0) > 1;
        if !self.makes.iter().all(is_kept) || !self.without_surface.iter().all(is_known) {
            self.makes.retain(is_kept);
            // Found again at their next drawing.
            self.by_address.clear();
            self.without_surface.clear();
            let addresses = self.makes.iter().map(Make::address).enumerate();
            self.by_address.extend(addresses.map(|(index, address)| (address, Some(index))));
        }
    }

    /// Adds a deformable body.
    pub(crate) fn add_mesh(
        &mut self,
        gpu: &Gpu,
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
        let make = self.make(address, || Some(Make::deformable(gpu, layouts, topology)));
        let Some(make) = make else { return };
        let first = self.sent.len() as u32;
        self.stage(&mesh.positions);
        if coloring == Coloring::Speed {
            self.stage(&mesh.velocities);
        }
        let of_body = Motion { turned: [0.0, 0.0, 0.0, 1.0], place: [0.0; 3], velocity: [0.0; 3] };
        self.add(make, object, first, of_body);
    }

    /// Adds a rigid shape. One without a bounded surface is not drawn.
    pub(crate) fn add_rigid(
        &mut self,
        gpu: &Gpu,
        layouts: &Layouts,
        object: &Object,
        rigid: &Rigid,
    ) {
        let address = Arc::as_ptr(&rigid.shape.0).addr();
        let is_new = !self.by_address.contains_key(&address);
        let make = self.make(address, || Make::rigid(gpu, layouts, &rigid.shape));
        let Some(make) = make else {
            if is_new {
                self.without_surface.push(rigid.shape.clone());
            }
            return;
        };
        let of_body = Motion {
            turned: rigid.pose.rotation.to_array(),
            place: rigid.pose.translation.to_array(),
            velocity: rigid.velocity.to_array(),
        };
        self.add(make, object, 0, of_body);
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
            self.sent.extend(component);
        }
    }

    fn add(&mut self, make: usize, object: &Object, first: u32, of_body: Motion) {
        let make = &mut self.makes[make];
        let instance = Instance {
            rotation: of_body.turned,
            place: of_body.place,
            first,
            color: object.visual.color,
            nodes: make.nodes,
            object: object.id().0,
            velocity: of_body.velocity,
        };
        make.used = self.frame;
        match object.drawing {
            Drawing::Edges => make.wires.push(instance),
            Drawing::Surface => make.surfaces.push(instance),
            Drawing::Hidden => {}
        }
    }

    /// Sends the frame's numbers and bodies to the device; says whether the buffer is a new one.
    ///
    /// # Errors
    /// More than the device's buffers hold.
    pub(crate) fn upload(
        &mut self,
        devices: (&Device, &Queue),
        encoder: &mut CommandEncoder,
        layouts: &Layouts,
        numbers: &[f32],
    ) -> Result<bool, GraphicsError> {
        self.instances = size_of::<f32>() * self.sent.len();
        for make in &self.makes {
            for list in [&make.surfaces, &make.wires] {
                self.sent.extend(bytemuck::cast_slice(list));
            }
        }
        self.sent.upload(devices, encoder, layouts, numbers)
    }

    /// The buffer that begins with the frame's numbers.
    pub(crate) fn buffer(&self) -> &Buffer {
        &self.sent.buffer
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

    /// Bodies that are drawn by one call.
    fn each<'a>(&'a self, mut draw: impl FnMut(Batch<'a>)) {
        let mut first = self.instances;
        for make in &self.makes {
            let numbers = make.own_numbers.as_ref().unwrap_or(&self.sent.list);
            let lists = [(&make.surfaces, &make.triangles), (&make.wires, &make.edges)];
            for (are_wires, (list, indices)) in [false, true].into_iter().zip(lists) {
                let end = first + size_of_val(list.as_slice());
                // There are bodies without triangles.
                if !list.is_empty() && indices.count > 0 {
                    let instances = self.sent.buffer.slice(first as u64..end as u64);
                    let count = list.len() as u32;
                    draw(Batch { make, numbers, indices, instances, count, are_wires });
                }
                first = end;
            }
        }
    }
}

/// Bodies that are drawn by one call.
struct Batch<'a> {
    make: &'a Make,
    numbers: &'a BindGroup,
    indices: &'a Indices,
    instances: BufferSlice<'a>,
    count: u32,
    are_wires: bool,
}

impl Batch<'_> {
    fn draw(&self, pass: &mut RenderPass<'_>) {
        pass.set_vertex_buffer(0, self.instances);
        pass.set_index_buffer(self.indices.buffer.slice(..), wgpu::IndexFormat::Uint32);
        pass.draw_indexed(0..self.indices.count, 0, 0..self.count);
    }
}
