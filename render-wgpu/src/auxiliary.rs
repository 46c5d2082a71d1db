//! GPU work besides drawing: the auxiliary queue of the render stage (§9).
//!
//! Anybody may submit a unit from any thread; whoever has the renderer runs it, since nobody else
//! may call the device.

use std::sync::Arc;
use std::sync::atomic::{AtomicU8, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};

use thiserror::Error;
use wgpu::{Buffer, CommandEncoder, MapMode, PollType, TextureView};

use crate::error::GraphicsError;
use crate::globals::View;
use crate::gpu::Gpu;
use crate::pick::Picker;
use crate::springs::Integrator;
use crate::surface::Surfaces;

/// Units that may wait at once; usually 256.
const CAPACITY: usize = 256;

/// A unit of GPU work.
pub trait GpuUnit: Send {
    /// Whether it looks at the frame that was drawn: such a unit runs when the next frame is, others as
    /// soon as the renderer comes to it.
    fn needs_frame(&self) -> bool {
        false
    }

    /// Encodes what it does, its results into a buffer that can be mapped for reading. `None` if there
    /// is nothing to do any more, or it cannot be done; that is then the end of the unit.
    fn encode(&mut self, context: &Context<'_>, encoder: &mut CommandEncoder) -> Option<Buffer>;

    /// Told, on the thread that has the renderer, what is in that buffer once the device is done, or why it
    /// never will be.
    fn finish(self: Box<Self>, context: &Context<'_>, results: Result<&[u8], GraphicsError>);
}

/// What a unit may use.
pub struct Context<'a> {
    /// The device.
    pub gpu: &'a Gpu,
    /// The pictures' width and height, in pixels.
    pub size: (u32, u32),
    /// The picture that was drawn, where a unit that [needs it](GpuUnit::needs_frame) is encoded; else none. The
    /// commands come after those that draw it. What can be done with it is up to whoever made its texture; that of an
    /// [`Offscreen`] can be copied from.
    ///
    /// [`Offscreen`]: crate::renderer::Offscreen
    pub picture: Option<&'a TextureView>,
    pub(crate) view: &'a View,
    pub(crate) surfaces: &'a Surfaces,
    pub(crate) picker: &'a Picker,
    pub(crate) integrator: &'a Integrator,
}

/// The queue is full, and the unit came back.
#[derive(Error)]
#[error("{CAPACITY} units of GPU work wait already")]
pub struct AuxiliaryFull(pub Box<dyn GpuUnit>);

impl std::fmt::Debug for AuxiliaryFull {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("AuxiliaryFull")
    }
}

/// Where units of GPU work are submitted.
#[derive(Clone)]
pub struct Auxiliary(SyncSender<Box<dyn GpuUnit>>);

impl Auxiliary {
    /// A queue that nobody serves: what is submitted is dropped. For environments without a renderer.
    #[must_use]
    pub fn unserved() -> Self {
        Self(sync_channel(0).0)
    }

    /// Submits a unit. If the renderer is gone it is dropped.
    ///
    /// # Errors
    /// Too many wait already.
    pub fn submit(&self, unit: Box<dyn GpuUnit>) -> Result<(), AuxiliaryFull> {
        match self.0.try_send(unit) {
            Ok(()) | Err(TrySendError::Disconnected(_)) => Ok(()),
            Err(TrySendError::Full(unit)) => Err(AuxiliaryFull(unit)),
        }
    }
}

/// How far the mapping of a buffer has come.
const MAPPING: u8 = 0;
const MAPPED: u8 = 1;
const FAILED: u8 = 2;

/// A unit whose commands are under way.
struct Encoded {
    unit: Box<dyn GpuUnit>,
    results: Buffer,
    state: Arc<AtomicU8>,
}

impl Encoded {
    fn is_done(&self) -> bool {
        // Acquire: with the Release of the mapping's callback, though the bytes are the device's.
        self.state.load(Ordering::Acquire) != MAPPING
    }

    fn finish(self, context: &Context<'_>) {
        // A buffer can be read even if what was to write it was refused.
        if let Some(failure) = context.gpu.failure() {
            return self.unit.finish(context, Err(failure));
        }
        let is_mapped = self.state.load(Ordering::Acquire) == MAPPED;
        let Some(bytes) = is_mapped.then(|| self.results.get_mapped_range(..).ok()).flatten()
        else {
            let reason = "its results cannot be read".to_owned();
            return self.unit.finish(context, Err(GraphicsError::Lost { reason }));
        };
        self.unit.finish(context, Ok(&bytes));
        drop(bytes);
        // Its unit's owner may use the buffer again.
        self.results.unmap();
    }
}

/// The renderer's end of the queue.
pub(crate) struct Units {
    sender: SyncSender<Box<dyn GpuUnit>>,
    receiver: Receiver<Box<dyn GpuUnit>>,
    /// Those that wait for a frame.
    for_frame: Vec<Box<dyn GpuUnit>>,
    /// Those encoded with a frame that the device is not known to be done with.
    encoded: Vec<Encoded>,
}

impl Units {
    pub(crate) fn new() -> Self {
        let (sender, receiver) = sync_channel(CAPACITY);
        Self { sender, receiver, for_frame: Vec::new(), encoded: Vec::new() }
    }

    pub(crate) fn queue(&self) -> Auxiliary {
        Auxiliary(self.sender.clone())
    }

    /// Encodes what waits for a frame, after one was drawn. What needs none was [run] before.
    ///
    /// [run]: Units::run_now
    pub(crate) fn encode(&mut self, context: &Context<'_>, encoder: &mut CommandEncoder) {
        let units = self.for_frame.drain(..);
        self.encoded.extend(units.filter_map(|unit| encode(unit, context, encoder)));
    }

    /// Finishes what the device is done with, without waiting.
    pub(crate) fn finish(&mut self, context: &Context<'_>) {
        if self.encoded.is_empty() {
            return;
        }
        // With the next frame a failure ends them all.
        let _ = context.gpu.poll(PollType::Poll);
        for encoded in self.encoded.extract_if(.., |encoded| encoded.is_done()) {
            encoded.finish(context);
        }
    }

    /// Ends all of them: those that were encoded are told why, the others are dropped, and so is what they would
    /// have answered by.
    pub(crate) fn refuse(&mut self, context: &Context<'_>, failure: &GraphicsError) {
        for Encoded { unit, .. } in self.encoded.drain(..) {
            unit.finish(context, Err(failure.clone()));
        }
        self.for_frame.clear();
        self.receiver.try_iter().for_each(drop);
    }

    /// Runs what waits and needs no frame, all at once, and waits for the results.
    pub(crate) fn run_now(&mut self, context: &Context<'_>) {
        let mut now = Vec::new();
        for unit in self.receiver.try_iter() {
            if unit.needs_frame() {
                self.for_frame.push(unit);
            } else {
                now.push(unit);
            }
        }
        if now.is_empty() {
            return;
        }
        let Gpu { device, queue, .. } = context.gpu;
        let mut encoder = device.create_command_encoder(&Default::default());
        let encode = |unit| encode(unit, context, &mut encoder);
        let encoded: Vec<_> = now.into_iter().filter_map(encode).collect();
        if encoded.is_empty() {
            return;
        }
        queue.submit([encoder.finish()]);
        // A failure is each unit's.
        let _ = context.gpu.poll(PollType::wait_indefinitely());
        for encoded in encoded {
            encoded.finish(context);
        }
    }
}

fn encode(
    mut unit: Box<dyn GpuUnit>,
    context: &Context<'_>,
    encoder: &mut CommandEncoder,
) -> Option<Encoded> {
    let results = unit.encode(context, encoder)?;
    let state = Arc::new(AtomicU8::new(MAPPING));
    let told = Arc::clone(&state);
    encoder.map_buffer_on_submit(&results, MapMode::Read, .., move |mapped| {
        let state = if mapped.is_ok() { MAPPED } else { FAILED };
        // Release: with the Acquire of whoever asks.
        told.store(state, Ordering::Release);
    });
    Some(Encoded { unit, results, state })
}
