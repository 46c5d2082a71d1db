//! `--record`: a session on its way to a file.

use std::fs::File;

use dualframe_sim::executor::{ExecutorError, OnFrame};
use dualframe_sim::manager::VeManager;
use dualframe_sim::record::{Control, Header, RecordError, Recorder, SceneSpec};
use dualframe_sim::render::Renderer;

use super::error::RunError;
use super::outputs;
use super::told::Told;

/// Runs an environment, recorded if that was asked for. A recording that fails ends, and the session goes on.
pub(super) struct Recording<'a> {
    recorder: Option<Recorder<&'a File>>,
    told: &'a Told,
}

impl<'a> Recording<'a> {
    /// Begins a recording, if there is a file for it, of an environment built as `spec` says. What is in the
    /// file is gone then: nothing that can be refused may come after it. Where it cannot begin, the session goes on
    /// without.
    pub(super) fn begin(
        file: Option<&'a File>,
        spec: &impl SceneSpec,
        manager: &VeManager,
        told: &'a Told,
    ) -> Self {
        let begin = |file: &'a File| {
            outputs::empty(file)?;
            Recorder::begin(file, &Header::of(spec), manager)
        };
        let begun = file.map(begin).transpose().map_err(RunError::from);
        Self { recorder: told.attempt(begun).flatten(), told }
    }

    /// Advances by so many frames.
    pub(super) fn run(
        &mut self,
        manager: &mut VeManager,
        frames: u64,
        renderer: &mut dyn Renderer,
        on_frame: &mut OnFrame<'_>,
    ) -> Result<(), ExecutorError> {
        let end = manager.frame() + frames;
        if let Some(recorder) = &mut self.recorder {
            match recorder.run(manager, frames, renderer, on_frame) {
                Ok(()) => return Ok(()),
                Err(RecordError::Executor(error)) => {
                    if !error.can_go_on() {
                        // The state depends on the schedule now: nothing may be recorded of it.
                        self.fail(RecordError::Over, manager);
                    }
                    return Err(error);
                }
                Err(error) => self.fail(error, manager),
            }
        }
        manager.run(end - manager.frame(), renderer, on_frame)
    }

    /// Changes a number that all stages share.
    pub(super) fn control(&mut self, manager: &mut VeManager, control: Control) {
        match &mut self.recorder {
            Some(recorder) => {
                let recorded = recorder.control(manager, control);
                self.check(recorded, manager);
            }
            None => control.apply(manager),
        }
    }

    /// Objects were added that follow from the environment's state.
    pub(super) fn objects(&mut self, manager: &VeManager) {
        if let Some(recorder) = &mut self.recorder {
            let recorded = recorder.objects(manager, &[]);
            self.check(recorded, manager);
        }
    }

    /// Ends the recording; whether there was one.
    pub(super) fn end(&mut self, manager: &VeManager) -> bool {
        let Some(recorder) = self.recorder.take() else { return false };
        let ended = recorder.finish(manager).map(drop);
        self.check(ended, manager);
        true
    }

    fn check(&mut self, recorded: Result<(), RecordError>, manager: &VeManager) {
        if let Err(error) = recorded {
            self.fail(error, manager);
        }
    }

    fn fail(&mut self, source: RecordError, manager: &VeManager) {
        self.recorder = None;
        self.told.failure(&RunError::Recording { frame: manager.frame(), source });
    }
}
