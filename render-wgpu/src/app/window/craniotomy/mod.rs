//! A craniotomy in a window: the mouse is the tool in one of two hands.

mod grip;
mod held;
mod panel;

use std::sync::Arc;

use dualframe_render_wgpu::camera::Camera;
use dualframe_render_wgpu::look::Look;
use dualframe_sim::blocking::Grain;
use dualframe_sim::device::link::SimulationEnd;
use dualframe_sim::device::thread::HapticThread;
use dualframe_sim::executor::{ExecutorError, OnFrame};
use dualframe_sim::manager::VeManager;
use dualframe_sim::scene::Scene;

use self::grip::{Devices, ToolGrip};
use super::Scenario;
use super::view::View;
use crate::app::args::CraniotomyArgs;
use crate::app::craniotomy::{self, Surgery};
use crate::app::error::RunError;
use crate::app::haptics::{Each, Loops};
use crate::app::manage::Manage;
use crate::app::recording::Recording;
use crate::app::scenes::Patient;

/// Frames from one score to the next; usually 30: half a second. It takes up to 2 ms.
const SCORE_FRAMES: u64 = 30;

/// A craniotomy in a window.
pub(in crate::app) struct CraniotomyAtHand<'a, 'c> {
    args: &'a CraniotomyArgs,
    patient: &'a Patient,
    pub(in crate::app) surgery: Surgery<'c>,
    /// As long as a script moves the tools.
    unlinked: Option<Each<SimulationEnd<'c>>>,
    /// The frame from which on the score is told again.
    next_score: u64,
    // Loops that are dropped end.
    _threads: Each<HapticThread<'c>>,
}

impl<'a, 'c> CraniotomyAtHand<'a, 'c> {
    /// It, and the hands that operate.
    pub(in crate::app) fn begin(
        args: &'a CraniotomyArgs,
        patient: &'a Patient,
        loops: Loops<'c, 'c>,
    ) -> (Self, ToolGrip<'c>) {
        let Loops { threads, places, inputs, ends } = loops;
        let surgery = Surgery::new(patient, args.step);
        let [priority, _] = threads.each_ref().map(|thread| thread.priority().to_string());
        let devices = Devices { places, inputs, priority, states: Default::default() };
        let hand = ToolGrip::new(Arc::clone(&patient.head), devices, surgery.frames() == 0);
        (
            Self { args, patient, surgery, unlinked: Some(ends), next_score: 0, _threads: threads },
            hand,
        )
    }

    /// Whether no script moves the tools in the frames that come.
    fn is_free(&self, manager: &VeManager) -> bool {
        manager.frame() >= self.surgery.frames()
    }
}

impl<'c> Scenario for CraniotomyAtHand<'_, 'c> {
    type Hand = ToolGrip<'c>;

    const GRAIN: Grain = Grain::Pairwise;

    fn look(&self) -> (Look, Camera) {
        craniotomy::look(self.surgery.region())
    }

    fn build(&self, _hand: &ToolGrip<'c>) -> Result<Scene, RunError> {
        Ok(self.patient.build(self.args.way.simd())?)
    }

    fn begin_anew(&mut self, _hand: &ToolGrip<'c>) {
        if let [Some(one), Some(other)] = self.surgery.unlink() {
            self.unlinked = Some([one, other]);
        }
        self.surgery = Surgery::new(self.patient, self.args.step);
        self.next_score = 0;
    }

    fn apply(
        &mut self,
        _hand: &ToolGrip<'c>,
        manager: &mut VeManager,
        _recording: &mut Recording<'_>,
    ) {
        // By now the devices are where the tools are.
        if self.is_free(manager)
            && let Some(ends) = self.unlinked.take()
        {
            (0..).zip(ends).for_each(|(hand, end)| self.surgery.link(hand, end));
        }
    }

    fn advance(
        &mut self,
        view: &mut View<ToolGrip<'c>>,
        manager: &mut VeManager,
        recording: &mut Recording<'_>,
        frames: u64,
        on_frame: &mut OnFrame<'_>,
    ) -> Result<(), ExecutorError> {
        self.surgery.advance(manager, recording, frames, view, on_frame)
    }

    fn tend(
        &mut self,
        view: &mut View<ToolGrip<'c>>,
        manager: VeManager,
        recording: &mut Recording<'_>,
        manage: Manage<'_>,
    ) -> Result<VeManager, RunError> {
        let manager = self.surgery.look(manager, recording, manage)?;
        view.hand.is_free = self.is_free(&manager);
        if manager.frame() >= self.next_score {
            view.hand.score = self.surgery.score(&manager);
            self.next_score = manager.frame() + SCORE_FRAMES;
        }
        view.hand.devices.states = self.surgery.devices;
        Ok(manager)
    }
}
