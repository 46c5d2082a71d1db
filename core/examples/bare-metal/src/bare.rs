//! What both bare machines share: a pipeline in static memory, which interrupt handlers find.

use core::mem::MaybeUninit;
use core::sync::atomic::{AtomicPtr, Ordering};

use dualframe_core::pipeline::{Config, Pipeline};
use dualframe_core::storage::Static;
use dualframe_core::wait::Waiting;

use crate::run::{Report, Tables};
use crate::ve::{FRAMES, Fault, Room};

type Running<W> = Pipeline<'static, Room, W>;

/// The pipeline's place.
pub(crate) struct Place<W: Waiting> {
    tables: Static<Tables>,
    pipeline: Static<MaybeUninit<Running<W>>>,
    /// The pipeline, once it runs; null before.
    running: AtomicPtr<Running<W>>,
}

impl<W: Waiting> Place<W> {
    pub(crate) const fn new() -> Self {
        Self {
            tables: Static::new(Tables::new()),
            pipeline: Static::new(MaybeUninit::uninit()),
            running: AtomicPtr::new(core::ptr::null_mut()),
        }
    }

    /// Builds the pipeline, lets all frames run and shows it to everybody.
    pub(crate) fn start(&'static self, waiting: W) -> Result<&'static Running<W>, Fault> {
        let tables = self.tables.take().ok_or(Fault::Started)?;
        let place = self.pipeline.take().ok_or(Fault::Started)?;
        let pipeline = place.write(Pipeline::new(tables.lend(), Config::default(), waiting)?);
        pipeline.run(FRAMES)?;
        let pipeline = &*pipeline;
        // Release: whoever finds the pipeline finds it built.
        self.running.store(core::ptr::from_ref(pipeline).cast_mut(), Ordering::Release);
        Ok(pipeline)
    }

    /// The pipeline, if it runs.
    pub(crate) fn running(&self) -> Option<&'static Running<W>> {
        // Acquire: pairs with the Release in `start`.
        let pipeline = self.running.load(Ordering::Acquire);
        // SAFETY: null, or a shared reference to a static, which is never lent exclusively again.
        unsafe { pipeline.as_ref() }
    }
}

/// Whether a run is sound, letters came while frames ran, and every core was of use.
pub(crate) fn is_good(report: &Report<'_>) -> bool {
    report.is_sound()
        && report.picture.frames_with_letters > 1
        && report.steps.iter().all(|&steps| steps > 0)
}
