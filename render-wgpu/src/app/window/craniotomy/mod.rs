//! A craniotomy in a window: the mouse is the tool in one of two hands.

mod grip;
mod held;
mod panel;

use std::sync::Arc;

use dualframe_render_wgpu::camera::Camera;
use dualframe_render_wgpu::look::{Look, Quality};
use dualframe_sim::blocking::Grain;
use dualframe_sim::executor::FrameRecord;
use dualframe_sim::manager::VeManager;
use dualframe_sim::scene::Scene;

use self::grip::ToolGrip;
use super::view::View;
use super::{Manage, Scenario};
use crate::app::args::CraniotomyArgs;
use crate::app::craniotomy::{self, Surgery};
use crate::app::particles::RunError;
use crate::app::recording::Recording;
use crate::app::scenes::Patient;

/// A craniotomy in a window.
pub(in crate::app) struct CraniotomyAtHand<'a> {
    args: &'a CraniotomyArgs,
    patient: &'a Patient,
    pub(in crate::app) surgery: Surgery,
}

impl<'a> CraniotomyAtHand<'a> {
    pub(in crate::app) fn new(args: &'a CraniotomyArgs, patient: &'a Patient) -> Self {
        Self { args, patient, surgery: Surgery::new(patient, args.step) }
    }
}

impl Scenario for CraniotomyAtHand<'_> {
    type Hand = ToolGrip;

    const GRAIN: Grain = Grain::Pairwise;

    fn hand(&self) -> ToolGrip {
        ToolGrip::new(Arc::clone(&self.patient.head), self.surgery.frames() == 0)
    }

    fn look(&self, quality: Quality) -> (Look, Camera) {
        craniotomy::look(self.surgery.region(), quality)
    }

    fn build(&mut self, _hand: &ToolGrip) -> Result<Scene, RunError> {
        self.surgery = Surgery::new(self.patient, self.args.step);
        Ok(self.patient.build(self.args.way.simd())?)
    }

    fn apply(
        &mut self,
        _hand: &ToolGrip,
        _manager: &mut VeManager,
        _recording: &mut Recording<'_>,
    ) -> Result<(), RunError> {
        Ok(())
    }

    fn advance(
        &mut self,
        view: &mut View<ToolGrip>,
        manager: VeManager,
        recording: &mut Recording<'_>,
        frames: u64,
        host: (&mut dyn FnMut(&FrameRecord), Manage<'_>),
    ) -> Result<VeManager, RunError> {
        let manager = self.surgery.advance(manager, recording, frames, view, host)?;
        view.hand.is_free = manager.frame() >= self.surgery.frames();
        view.hand.score = self.surgery.score();
        Ok(manager)
    }
}
