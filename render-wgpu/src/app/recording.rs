//! `--record`: a session on its way to a file.

use std::fs::File;

use dualframe_sim::executor::FrameRecord;
use dualframe_sim::manager::VeManager;
use dualframe_sim::record::{Control, Header, RecordError, Recorder, SceneSpec};
use dualframe_sim::render::Renderer;

use super::error::RunError;
use super::outputs;

/// Runs an environment, recorded if that was asked for.
pub(super) struct Recording<'a>(Option<Recorder<&'a File>>);

impl<'a> Recording<'a> {
    /// Begins a recording, if there is a file for it, of an environment built as `spec` says.
    pub(super) fn begin(
        file: Option<&'a File>,
        spec: &impl SceneSpec,
        manager: &VeManager,
    ) -> Result<Self, RecordError> {
        let begin = |file: &'a File| {
            outputs::empty(file)?;
            Recorder::begin(file, &Header::of(spec), manager)
        };
        file.map(begin).transpose().map(Self)
    }

    /// Advances by so many frames.
    pub(super) fn run(
        &mut self,
        manager: &mut VeManager,
        frames: u64,
        renderer: &mut dyn Renderer,
        on_frame: &mut dyn FnMut(&FrameRecord),
    ) -> Result<(), RunError> {
        match &mut self.0 {
            Some(recorder) => recorder.run(manager, frames, renderer, on_frame)?,
            None => manager.run(frames, renderer, on_frame)?,
        }
        Ok(())
    }

    /// Changes a number that all stages share.
    pub(super) fn control(
        &mut self,
        manager: &mut VeManager,
        control: Control,
    ) -> Result<(), RecordError> {
        match &mut self.0 {
            Some(recorder) => recorder.control(manager, control),
            None => {
                control.apply(manager);
                Ok(())
            }
        }
    }

    /// Objects were added that follow from the environment's state.
    pub(super) fn objects(&mut self, manager: &VeManager) -> Result<(), RecordError> {
        match &mut self.0 {
            Some(recorder) => recorder.objects(manager, &[]),
            None => Ok(()),
        }
    }

    /// Ends the recording; whether there was one.
    pub(super) fn end(&mut self, manager: &VeManager) -> Result<bool, RecordError> {
        let recorder = self.0.take();
        let is_recorded = recorder.is_some();
        recorder.map(|recorder| recorder.finish(manager)).transpose()?;
        Ok(is_recorded)
    }
}
